//! A model's inputs, outputs and metadata, and checks against a contract.

use std::collections::BTreeMap;
use std::str::FromStr;

/// A model's inputs, outputs and metadata.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ports {
    /// Inputs, in the model's order.
    pub inputs: Vec<Port>,
    /// Outputs, in the model's order.
    pub outputs: Vec<Port>,
    /// Custom metadata.
    pub metadata: BTreeMap<String, String>,
}

/// An input or output.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Port {
    /// Name of the port.
    pub name: String,
    /// Dimensions; `None` if the port is not a tensor of float32 numbers. A free dimension is `None`.
    pub dimensions: Option<Vec<Option<usize>>>,
}

/// A violation of a contract.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Broken {
    /// Name of the field: `input images`, `output depth`, `metadata vg.prior`.
    pub field: String,
    /// The value that was found and the allowed ones.
    pub reason: String,
}

impl Broken {
    /// A broken promise of `field`.
    pub fn new(field: impl Into<String>, reason: impl Into<String>) -> Self {
        Self { field: field.into(), reason: reason.into() }
    }
}

type Dimensions = [Option<usize>];
type Checked<T> = Result<T, Broken>;

impl Ports {
    /// The dimensions of an input, if it exists; an error unless they agree with the expected ones.
    pub fn input(&self, name: &str, expected: &Dimensions) -> Checked<Option<&Dimensions>> {
        let found = self.inputs.iter().find(|p| p.name == name);
        found.map(|port| port.fitting("input", expected)).transpose()
    }

    /// The index of an output, if it exists; an error unless its dimensions agree with the expected ones.
    pub fn output(&self, name: &str, expected: &Dimensions) -> Checked<Option<usize>> {
        let found = self.outputs.iter().position(|p| p.name == name);
        found.map(|at| self.outputs[at].fitting("output", expected).map(|_| at)).transpose()
    }

    /// [`Ports::input`] for an input that must exist.
    pub fn required_input(&self, name: &str, expected: &Dimensions) -> Checked<&Dimensions> {
        self.input(name, expected)?.ok_or_else(|| Broken::new(format!("input {name}"), "missing"))
    }

    /// [`Ports::output`] for an output that must exist.
    pub fn required_output(&self, name: &str, expected: &Dimensions) -> Checked<usize> {
        self.output(name, expected)?.ok_or_else(|| Broken::new(format!("output {name}"), "missing"))
    }

    /// Returns an error if the model has an input that is not in `known`.
    pub fn no_inputs_but(&self, known: &[&str]) -> Checked<()> {
        match self.inputs.iter().find(|p| !known.contains(&p.name.as_str())) {
            Some(port) => {
                let reason = format!("unknown; allowed: {}", known.join(", "));
                Err(Broken::new(format!("input {}", port.name), reason))
            }
            None => Ok(()),
        }
    }

    /// The value of a metadata key that must exist.
    pub fn required(&self, key: &str) -> Checked<&str> {
        let value = self.metadata.get(key).map(String::as_str);
        value.ok_or_else(|| Broken::new(format!("metadata {key}"), "missing"))
    }

    /// The choice named by the value of a metadata key, which must exist unless there is a default.
    pub fn one_of<T: Copy>(&self, key: &str, choices: &[(&str, T)], default: Option<T>) -> Checked<T> {
        let value = match (self.metadata.get(key), default) {
            (None, Some(default)) => return Ok(default),
            _ => self.required(key)?,
        };
        let chosen = choices.iter().find(|(name, _)| *name == value).map(|(_, choice)| *choice);
        chosen.ok_or_else(|| {
            let allowed: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
            Broken::new(format!("metadata {key}"), format!("{value:?}; allowed: {}", allowed.join(", ")))
        })
    }

    /// The value of a metadata key as a number of pixels.
    pub fn count(&self, key: &str, default: u32) -> Checked<u32> {
        let Some(value) = self.metadata.get(key) else { return Ok(default) };
        let count = u32::from_str(value).ok().filter(|n| (1..=8192).contains(n));
        count.ok_or_else(|| Broken::new(format!("metadata {key}"), format!("{value:?}; allowed: 1 to 8192")))
    }

    /// The value of a metadata key as three numbers.
    pub(crate) fn color(&self, key: &str, default: [f32; 3]) -> Checked<[f32; 3]> {
        let Some(value) = self.metadata.get(key) else { return Ok(default) };
        let numbers: Option<Vec<f32>> =
            value.split(',').map(|n| n.trim().parse().ok().filter(|n: &f32| n.is_finite())).collect();
        numbers.and_then(|numbers| numbers.try_into().ok()).ok_or_else(|| {
            let reason = format!("{value:?}; allowed: three numbers, \"r,g,b\"");
            Broken::new(format!("metadata {key}"), reason)
        })
    }
}

impl Port {
    fn fitting(&self, side: &str, expected: &Dimensions) -> Checked<&Dimensions> {
        let field = || format!("{side} {}", self.name);
        let Some(found) = &self.dimensions else {
            return Err(Broken::new(field(), "not a tensor of float32; allowed: float32"));
        };
        let agree = |(f, e): (&Option<usize>, &Option<usize>)| f.is_none() || e.is_none() || f == e;
        if found.len() != expected.len() || !found.iter().zip(expected).all(agree) {
            let reason = format!("shape {}; allowed: {}", words(found), words(expected));
            return Err(Broken::new(field(), reason));
        }
        Ok(found)
    }
}

fn words(dimensions: &Dimensions) -> String {
    let sides: Vec<String> = dimensions.iter().map(|d| d.map_or("any".into(), |n| n.to_string())).collect();
    format!("[{}]", sides.join(", "))
}
