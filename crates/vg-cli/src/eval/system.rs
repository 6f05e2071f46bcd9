//! What is compared: systems, each a row of a table or a point of a sweep.

use super::import::Import;
use super::split;
use crate::args::{DepthArgs, MethodArgs, VehiclesArgs};
use crate::job::{Failure, Result, USAGE};
use crate::scene;
use clap::Parser;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use vg::pipeline::Options;

/// A row: what makes the models, and in which splits.
pub(crate) struct System {
    pub(crate) name: String,
    pub(crate) maker: Maker,
    pub(crate) takes: Takes,
}

/// Where models come from.
pub(crate) enum Maker {
    /// This library.
    Method(Box<Method>),
    /// Another program, which ran before.
    Import(Import),
    /// Nowhere: why.
    Missing(String),
}

/// Settings of a reconstruction, and what it is shown.
pub(crate) struct Method {
    pub(crate) settings: Options,
    /// Metres per number in the depth files, instead of what the scene says.
    pub(crate) depth_scale: Option<f64>,
    /// Points measured on the vehicle, and how many are shown of those that the input cameras see.
    pub(crate) cloud: Option<PathBuf>,
    pub(crate) cloud_points: Option<usize>,
    /// What was said, for another process; `None` where it was not said in words of its own.
    pub(crate) words: Option<Vec<OsString>>,
}

/// The splits a system is measured in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Takes {
    /// Those whose input cameras stand on this side.
    pub(crate) side: Option<Side>,
    /// Measured in the test views of all of the vehicle's splits but what is shown, not in the split's own alone.
    pub(crate) all_tests: bool,
}

/// Of the vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Left,
    Right,
}

/// Options of one system, as `vg eval` has them.
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
    /// Of `[NAME:] OPTIONS`, the value of `argument`, after the options that all have. Words are separated by white
    /// space.
    pub(crate) fn read(argument: &str, text: &str, common: &str) -> Result<Self> {
        let (name, options) = match text.split_once(':') {
            Some((name, options)) if !name.trim_start().starts_with('-') => (name.trim(), options.trim()),
            _ => (text.trim(), text.trim()),
        };
        let words = common.split_whitespace().chain(options.split_whitespace());
        let method = Method::of(words.map(Into::into), &format!("{argument} \"{text}\""))?;
        let name = if name.is_empty() { "default" } else { name }.to_owned();
        Ok(Self { name, maker: Maker::Method(Box::new(method)), takes: Takes::default() })
    }

    /// The files that another program made of a scene, one for each split.
    pub(crate) fn imported(&self, vehicles: &VehiclesArgs, scene: &Path) -> Vec<PathBuf> {
        let Maker::Import(import) = &self.maker else { return Vec::new() };
        // What is wrong with the split is told where it is measured.
        let splits = split::read(&split::find(&vehicles.split, scene), vehicles.only.as_deref());
        let keys = splits.into_iter().flatten().map(|(key, _)| key);
        keys.flat_map(|key| import.files(&scene::name(scene), &key)).collect()
    }
}

impl Method {
    /// Of words of the command line; `said_in` is where they stand, for messages.
    pub(crate) fn of(words: impl IntoIterator<Item = OsString>, said_in: &str) -> Result<Self> {
        let words = last_of_each(words);
        let args = SystemArgs::try_parse_from(&words).map_err(|e| {
            let message = format!("{said_in}: {}", crate::one_line(&e.render().to_string()));
            Failure { message, code: USAGE }
        })?;
        let settings = args
            .method
            .options()
            .map_err(|failure| Failure { message: format!("{said_in}: {}", failure.message), ..failure })?;
        Ok(Self {
            settings,
            depth_scale: args.depth.depth_scale,
            cloud: args.method.cloud,
            cloud_points: args.cloud_points.map(|n| n as usize),
            words: Some(words),
        })
    }
}

/// Each option once, as it was said last: a row's own stands for what all rows have.
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
    fn what_is_said_last_stands() {
        let said = "--prior hull --no-photo --threads=1 --prior shape --threads 2 --no-photo";
        let words = last_of_each(said.split(' ').map(Into::into));
        assert_eq!(words, ["--prior", "shape", "--threads", "2", "--no-photo"].map(OsString::from));
        assert_eq!(last_of_each(["stray".into()]), [OsString::from("stray")]);
    }
}
