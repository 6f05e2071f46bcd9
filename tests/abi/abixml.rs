//! The part of an `abidw` dump that concerns the C functions: their declarations and every type that they use. The
//! rest, twenty times as much, describes Rust's own types.

use std::collections::{BTreeMap, BTreeSet};

/// One element; `abidw` writes one tag per line.
struct Node<'a> {
    open: &'a str,
    inside: Vec<Node<'a>>,
    close: Option<&'a str>,
}

impl Node<'_> {
    fn is(&self, element: &str) -> bool {
        self.open.trim_start().strip_prefix('<').is_some_and(|rest| rest.starts_with(element))
    }

    fn is_function(&self) -> bool {
        self.is("function-decl") && self.open.contains("mangled-name='vg_")
    }

    /// Whether this element only groups declarations.
    fn is_group(&self) -> bool {
        self.is("abi-corpus") || self.is("abi-instr") || self.is("namespace-decl")
    }
}

/// The part of `dump` about the functions whose names begin with `vg_`, without paths of the machine.
pub(crate) fn c_functions(dump: &str) -> String {
    let lines: Vec<&str> = dump.lines().filter(|line| !line.trim().is_empty()).collect();
    let (roots, _) = parse(&lines);
    let mut definitions = BTreeMap::new();
    let mut todo = Vec::new();
    for root in &roots {
        collect(root, &mut definitions, &mut todo);
    }
    let mut needed = BTreeSet::new();
    while let Some(node) = todo.pop() {
        each_line(node, &mut |line| {
            for id in attributes(line, " type-id='") {
                if needed.insert(id)
                    && let Some(definition) = definitions.get(id)
                {
                    todo.push(definition);
                }
            }
        });
    }
    let mut out = String::new();
    let mut units = 0;
    for root in &roots {
        write(root, &needed, &mut units, &mut out);
    }
    out
}

/// Parses elements up to the line that closes their parent. Returns them and the number of their lines.
fn parse<'a>(lines: &[&'a str]) -> (Vec<Node<'a>>, usize) {
    let mut nodes = Vec::new();
    let mut at = 0;
    while let Some(&open) = lines.get(at) {
        if open.trim_start().starts_with("</") {
            break;
        }
        at += 1;
        if open.ends_with("/>") || open.contains("</") {
            nodes.push(Node { open, inside: Vec::new(), close: None });
            continue;
        }
        let (inside, used) = parse(&lines[at..]);
        at += used;
        nodes.push(Node { open, inside, close: lines.get(at).copied() });
        at += 1;
    }
    (nodes, at)
}

fn collect<'n, 'a>(
    node: &'n Node<'a>,
    definitions: &mut BTreeMap<&'a str, &'n Node<'a>>,
    functions: &mut Vec<&'n Node<'a>>,
) {
    if node.is_function() {
        functions.push(node);
    } else if node.is_group() {
        node.inside.iter().for_each(|child| collect(child, definitions, functions));
    } else if let Some(id) = attributes(node.open, " id='").next() {
        definitions.entry(id).or_insert(node);
    }
}

/// Values of all attributes of this name in a line.
fn attributes<'a>(line: &'a str, name: &'static str) -> impl Iterator<Item = &'a str> {
    line.split(name).skip(1).filter_map(|rest| rest.split('\'').next())
}

fn each_line<'a>(node: &Node<'a>, visit: &mut impl FnMut(&'a str)) {
    visit(node.open);
    node.inside.iter().for_each(|child| each_line(child, visit));
}

fn write(node: &Node, needed: &BTreeSet<&str>, units: &mut usize, out: &mut String) {
    if node.is_group() {
        let mut inside = String::new();
        node.inside.iter().for_each(|child| write(child, needed, units, &mut inside));
        if inside.is_empty() {
            return;
        }
        if node.is("abi-instr") {
            *units += 1;
            out.push_str(&format!(
                "  <abi-instr address-size='64' path='{units}' language='LANG_UNKNOWN'>\n"
            ));
        } else {
            out.push_str(node.open);
            out.push('\n');
        }
        out.push_str(&inside);
        out.push_str(node.close.unwrap_or_default());
        out.push('\n');
        return;
    }
    let wanted = match attributes(node.open, " id='").next() {
        _ if node.is("function-decl") => node.is_function(),
        Some(id) => needed.contains(id),
        None => node.is("elf-"),
    };
    if wanted {
        write_whole(node, out);
    }
}

fn write_whole(node: &Node, out: &mut String) {
    out.push_str(node.open);
    out.push('\n');
    node.inside.iter().for_each(|child| write_whole(child, out));
    if let Some(close) = node.close {
        out.push_str(close);
        out.push('\n');
    }
}
