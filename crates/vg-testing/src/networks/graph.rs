//! Writes small ONNX files: the part of the protocol-buffer format that the graphs of these tests need.

use std::path::Path;

/// ONNX's type numbers of float32 and int64.
pub const FLOAT: u64 = 1;
pub const INT64: u64 = 7;

/// A model under construction.
#[derive(Clone, Default)]
pub struct Graph {
    nodes: Vec<Node>,
    initializers: Vec<Vec<u8>>,
    pub inputs: Vec<Port>,
    pub outputs: Vec<Port>,
    pub metadata: Vec<(String, String)>,
}

#[derive(Clone)]
struct Node {
    inputs: Vec<String>,
    output: String,
    /// The data that follows them in the file.
    rest: Vec<u8>,
}

/// An input or output; `None` is a free dimension.
#[derive(Clone)]
pub struct Port {
    pub name: String,
    pub element: u64,
    pub dimensions: Vec<Option<u64>>,
}

impl Port {
    pub fn new(name: &str, dimensions: &[Option<u64>]) -> Self {
        Self { name: name.into(), element: FLOAT, dimensions: dimensions.to_vec() }
    }
}

/// An attribute of a node.
pub enum Attribute<'a> {
    Int(&'a str, i64),
    Ints(&'a str, &'a [i64]),
}

impl Graph {
    pub fn node(&mut self, kind: &str, inputs: &[&str], output: &str, attributes: &[Attribute]) -> &mut Self {
        let mut out = Vec::new();
        text(&mut out, 4, kind);
        for attribute in attributes {
            let mut a = Vec::new();
            match attribute {
                Attribute::Int(name, value) => {
                    text(&mut a, 1, name);
                    number(&mut a, 3, value.cast_unsigned());
                    number(&mut a, 20, 2);
                }
                Attribute::Ints(name, values) => {
                    text(&mut a, 1, name);
                    values.iter().for_each(|v| number(&mut a, 8, v.cast_unsigned()));
                    number(&mut a, 20, 7);
                }
            }
            bytes(&mut out, 5, &a);
        }
        let inputs = inputs.iter().map(|name| (*name).to_owned()).collect();
        self.nodes.push(Node { inputs, output: output.into(), rest: out });
        self
    }

    /// Renames the output of the node that gives `output` to `name`; nodes that use it keep using it.
    pub fn rename_output_of(&mut self, output: &str, name: &str) {
        for node in &mut self.nodes {
            if node.output == output {
                node.output = name.into();
            }
        }
    }

    pub fn floats(&mut self, name: &str, dimensions: &[u64], values: &[f32]) -> &mut Self {
        assert_eq!(dimensions.iter().product::<u64>() as usize, values.len());
        let raw: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.constant(name, dimensions, FLOAT, &raw)
    }

    pub fn integers(&mut self, name: &str, values: &[i64]) -> &mut Self {
        let raw: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.constant(name, &[values.len() as u64], INT64, &raw)
    }

    fn constant(&mut self, name: &str, dimensions: &[u64], element: u64, raw: &[u8]) -> &mut Self {
        let mut out = Vec::new();
        dimensions.iter().for_each(|d| number(&mut out, 1, *d));
        number(&mut out, 2, element);
        text(&mut out, 8, name);
        bytes(&mut out, 9, raw);
        self.initializers.push(out);
        self
    }

    /// Sets a metadata entry, as `say` does, without returning the graph.
    pub fn set(&mut self, key: &str, value: &str) {
        self.say(key, value);
    }

    pub fn say(&mut self, key: &str, value: &str) -> &mut Self {
        self.metadata.retain(|(k, _)| k != key);
        self.metadata.push((key.into(), value.into()));
        self
    }

    pub fn write(&self, path: &Path) {
        let mut graph = Vec::new();
        for node in &self.nodes {
            let mut out = Vec::new();
            node.inputs.iter().for_each(|name| text(&mut out, 1, name));
            text(&mut out, 2, &node.output);
            out.extend_from_slice(&node.rest);
            bytes(&mut graph, 1, &out);
        }
        text(&mut graph, 2, "test");
        self.initializers.iter().for_each(|i| bytes(&mut graph, 5, i));
        self.inputs.iter().for_each(|p| bytes(&mut graph, 11, &port(p)));
        self.outputs.iter().for_each(|p| bytes(&mut graph, 12, &port(p)));
        let mut model = Vec::new();
        number(&mut model, 1, 8);
        bytes(&mut model, 7, &graph);
        let mut opset = Vec::new();
        text(&mut opset, 1, "");
        number(&mut opset, 2, 17);
        bytes(&mut model, 8, &opset);
        for (key, value) in &self.metadata {
            let mut entry = Vec::new();
            text(&mut entry, 1, key);
            text(&mut entry, 2, value);
            bytes(&mut model, 14, &entry);
        }
        std::fs::write(path, model).unwrap();
    }
}

fn port(port: &Port) -> Vec<u8> {
    let mut shape = Vec::new();
    for (k, dimension) in port.dimensions.iter().enumerate() {
        let mut d = Vec::new();
        match dimension {
            Some(n) => number(&mut d, 1, *n),
            None => text(&mut d, 2, &format!("free{k}")),
        }
        bytes(&mut shape, 1, &d);
    }
    let mut tensor = Vec::new();
    number(&mut tensor, 1, port.element);
    bytes(&mut tensor, 2, &shape);
    let mut kind = Vec::new();
    bytes(&mut kind, 1, &tensor);
    let mut out = Vec::new();
    text(&mut out, 1, &port.name);
    bytes(&mut out, 2, &kind);
    out
}

fn varint(out: &mut Vec<u8>, mut n: u64) {
    while n > 127 {
        out.push(n as u8 | 128);
        n >>= 7;
    }
    out.push(n as u8);
}

fn number(out: &mut Vec<u8>, field: u64, n: u64) {
    varint(out, field << 3);
    varint(out, n);
}

fn bytes(out: &mut Vec<u8>, field: u64, content: &[u8]) {
    varint(out, field << 3 | 2);
    varint(out, content.len() as u64);
    out.extend_from_slice(content);
}

fn text(out: &mut Vec<u8>, field: u64, content: &str) {
    bytes(out, field, content.as_bytes());
}
