//! Systems that are compared, each a row of a table or a point of a sweep.

use super::import::Import;
use super::split;
use crate::args::{DepthArgs, MethodArgs, VehiclesArgs};
use crate::job::{Failure, Result, USAGE};
use crate::scene;
use clap::Parser;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use vg::pipeline;

/// A system: the maker of its models, and the splits in which it is measured.
pub(crate) struct System {
    pub(crate) name: String,
    pub(crate) maker: Maker,
    pub(crate) splits: SplitFilter,
}

/// Origin of a system's models.
pub(crate) enum Maker {
    /// This library.
    Method(Box<Method>),
    /// Another program, which was run before.
    Import(Import),
    /// No origin, with the reason.
    Missing(String),
}

/// Settings and input of a reconstruction.
pub(crate) struct Method {
    pub(crate) settings: pipeline::Method,
    /// Metres per unit of the depth files; overrides the scene's value.
    pub(crate) depth_scale: Option<f64>,
    /// Points measured on the vehicle, and the number to use of those that the input cameras see.
    pub(crate) cloud: Option<PathBuf>,
    pub(crate) cloud_points: Option<usize>,
    /// Command-line words of the settings, for a child process; `None` where there are no separate words.
    pub(crate) words: Option<Vec<OsString>>,
}

/// Splits and test views in which a system is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SplitFilter {
    /// Only splits whose input cameras are on this side.
    pub(crate) side: Option<Side>,
    /// Whether to measure in the test views of all splits of the vehicle, without this split's input views.
    pub(crate) all_tests: bool,
}

/// Side of the vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Left,
    Right,
}

/// Options of one system, a subset of those of `vg eval`.
#[derive(Parser)]
#[command(no_binary_name = true, disable_help_flag = true)]
struct SystemArgs {
    #[command(flatten)]
    method: MethodArgs,
    #[command(flatten)]
    depth: DepthArgs,
    #[arg(long, requires = "cloud", value_parser = clap::value_parser!(u32).range(1..))]
    cloud_points: Option<u32>,
}

impl System {
    /// Parses `[NAME:] OPTIONS`, the value of `argument`, appended to the common options. Words are separated by white
    /// space.
    pub(crate) fn read(argument: &str, text: &str, common: &str) -> Result<Self> {
        let (name, options) = match text.split_once(':') {
            Some((name, options)) if !name.trim_start().starts_with('-') => (name.trim(), options.trim()),
            _ => (text.trim(), text.trim()),
        };
        let words = common.split_whitespace().chain(options.split_whitespace());
        let method = Method::parse(words.map(Into::into), &format!("{argument} \"{text}\""))?;
        let name = if name.is_empty() { "default" } else { name }.to_owned();
        Ok(Self { name, maker: Maker::Method(Box::new(method)), splits: SplitFilter::default() })
    }

    /// The files that another program made of a scene, one for each split.
    pub(crate) fn imported(&self, vehicles: &VehiclesArgs, scene: &Path) -> Vec<PathBuf> {
        let Maker::Import(import) = &self.maker else { return Vec::new() };
        // Errors of the split are reported where it is measured.
        let splits = split::read(&split::find(&vehicles.split, scene), vehicles.only.as_deref());
        let keys = splits.into_iter().flatten().map(|(key, _)| key);
        keys.flat_map(|key| import.files(&scene::name(scene), &key)).collect()
    }
}

impl Method {
    /// Parses words of the command line; `context` says in messages where they come from.
    pub(crate) fn parse(words: impl IntoIterator<Item = OsString>, context: &str) -> Result<Self> {
        let words = last_of_each(words);
        let args = SystemArgs::try_parse_from(&words).map_err(|e| {
            let message = format!("{context}: {}", crate::one_line(&e.render().to_string()));
            Failure { message, code: USAGE }
        })?;
        let settings = args
            .method
            .method()
            .map_err(|failure| Failure { message: format!("{context}: {}", failure.message), ..failure })?;
        Ok(Self {
            settings,
            depth_scale: args.depth.depth_scale,
            cloud: args.method.cloud,
            cloud_points: args.cloud_points.map(|n| n as usize),
            words: Some(words),
        })
    }
}

/// Keeps the last occurrence of each option: a row's own options override the common ones.
fn last_of_each(words: impl IntoIterator<Item = OsString>) -> Vec<OsString> {
    let mut options: Vec<(OsString, Vec<OsString>)> = Vec::new();
    for word in words {
        let text = word.to_string_lossy();
        let begins = text.starts_with("--");
        let name: OsString = text.split('=').next().unwrap_or_default().into();
        match options.last_mut().filter(|_| !begins) {
            Some((_, words)) => words.push(word),
            None => {
                options.retain(|(other, _)| *other != name);
                options.push((name, vec![word]));
            }
        }
    }
    options.into_iter().flat_map(|(_, words)| words).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_occurrence_of_an_option_is_kept() {
        let given = "--prior hull --no-photo --threads=1 --prior shape --threads 2 --no-photo";
        let words = last_of_each(given.split(' ').map(Into::into));
        assert_eq!(words, ["--prior", "shape", "--threads", "2", "--no-photo"].map(OsString::from));
        assert_eq!(last_of_each(["stray".into()]), [OsString::from("stray")]);
    }
}
