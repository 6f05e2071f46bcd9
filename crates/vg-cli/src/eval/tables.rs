//! Predefined tables: the paper's five, and the cost of the plan's omissions.

use super::import::{Import, Kind};
use super::system::{Maker, Method, Side, SplitFilter, System};
use crate::args::{EvalArgs, TableName};
use crate::job::Result;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Reasons why a row that needs networks is missing.
const NO_PRIOR_MODEL: &str = "needs a geometry network: --prior-model M.onnx";
const NO_HEAD_MODEL: &str = "needs a Gaussian head: --head-model M.onnx";

/// Rows of the table, then those of `--import`.
pub(super) fn systems(args: &EvalArgs) -> Result<Vec<System>> {
    let preset = Preset { args };
    let mut imports = args.imports.iter().map(|text| Import::read(text)).collect::<Result<Vec<_>>>()?;
    let mut rows = match args.table {
        None => Vec::new(),
        Some(TableName::Main) => preset.main(&mut imports)?,
        Some(TableName::Side) => preset.side()?,
        Some(TableName::Offset) => preset.offset()?,
        Some(TableName::Symmetry) => preset.symmetry()?,
        Some(TableName::Activation) => preset.activation()?,
        Some(TableName::Omissions) => preset.omissions()?,
    };
    for text in &args.systems {
        rows.push(System::read("--system", text, &args.with)?);
    }
    rows.extend(imports.into_iter().map(imported));
    Ok(rows)
}

fn imported((name, import): (String, Import)) -> System {
    System { name, maker: Maker::Import(import), splits: SplitFilter::default() }
}

struct Preset<'a> {
    args: &'a EvalArgs,
}

impl Preset<'_> {
    fn main(&self, imports: &mut Vec<(String, Import)>) -> Result<Vec<System>> {
        let mut made_by = |kind: Kind, name: &str, word: &str| match imports
            .iter()
            .position(|(_, import)| import.kind() == kind)
        {
            Some(i) => imported(imports.remove(i)),
            None => missing(name, &format!("made by another program: give --import \"{name}: {word} PATH\"")),
        };
        let (da3, trellis) =
            (made_by(Kind::DepthAnything3, "DA3", "da3"), made_by(Kind::Trellis, "TRELLIS", "trellis"));
        Ok(vec![
            self.row("3DGS", "--baseline 3dgs")?,
            da3,
            trellis,
            self.networks("paper: network prior and head", true, true, PAPER)?,
            self.networks("network prior", true, false, "")?,
            self.networks("given depth, network head", false, true, "--prior given")?,
            self.row("given depth", "--prior given")?,
            self.row("shape (default without depth)", "--prior shape")?,
            self.row("shape, refined 5 s", "--prior shape --refine 5s")?,
            self.row("hull", "--prior hull")?,
            self.row("shape, the paper's rules", &format!("--prior shape {PAPER}"))?,
            self.row("shape, without clone", "--prior shape --symmetry never")?,
            self.row("shape, image flipping", "--prior shape --symmetry flip")?,
        ])
    }

    fn side(&self) -> Result<Vec<System>> {
        let row = |name: &str, side: Side, all_tests: bool| -> Result<System> {
            Ok(System { splits: SplitFilter { side: Some(side), all_tests }, ..self.row(name, "")? })
        };
        Ok(vec![
            row("left in, right out", Side::Left, false)?,
            row("right in, left out", Side::Right, false)?,
            row("left in, both out", Side::Left, true)?,
            row("right in, both out", Side::Right, true)?,
        ])
    }

    fn offset(&self) -> Result<Vec<System>> {
        Ok(vec![
            self.networks("network head, with offset", false, true, "")?,
            self.networks("network head, without offset", false, true, "--no-offset")?,
            self.row("shape, moved to where photographs agree", "--prior shape")?,
            self.row("shape, not moved", "--prior shape --no-photo")?,
        ])
    }

    fn symmetry(&self) -> Result<Vec<System>> {
        Ok(vec![
            self.row("image flipping", "--symmetry flip")?,
            self.row("Gaussian cloning", "--symmetry always")?,
            self.row("cloning of what was not seen (default)", "--symmetry auto")?,
            self.row("neither", "--symmetry never")?,
        ])
    }

    /// Table 5; the name of the head's file contains `{activation}`.
    fn activation(&self) -> Result<Vec<System>> {
        let row = |activation: &str| {
            let Some(pattern) = &self.args.method.head_model else {
                let why = "needs heads trained with it: --head-model \"heads/{activation}.onnx\"";
                return Ok(missing(activation, why));
            };
            let file = PathBuf::from(pattern.to_string_lossy().replace("{activation}", activation));
            if !file.is_file() {
                return Ok(missing(activation, &format!("{}: no such file", file.display())));
            }
            self.with_models(activation, None, Some(&file), "")
        };
        ["softplus", "sigmoid", "relu"].map(row).into_iter().collect()
    }

    fn omissions(&self) -> Result<Vec<System>> {
        Ok(vec![
            self.row("default", "")?,
            self.row("nothing left out", "--keep all")?,
            self.row("duplicate views kept", "--keep duplicate-views")?,
            self.row("overlap kept", "--keep overlap")?,
            self.row("silhouette edge kept", "--keep silhouette-edge")?,
            self.row("floaters kept", "--keep floaters")?,
            self.row("SH bands kept", "--keep sh-bands")?,
            self.row("SH degree 0", "--sh-degree 0")?,
            self.row("cloned although seen", "--symmetry always")?,
            self.row("without clones", "--symmetry never")?,
            self.row("without relighting", "--relight never")?,
            self.row("without calibration", "--calibrate off")?,
            self.row("without photographs' shift", "--no-photo")?,
            self.row("half resolution", "--resolution 0.5")?,
            self.row("three views", "--max-views 3")?,
            self.row("two views", "--max-views 2")?,
            self.row("one view", "--max-views 1")?,
        ])
    }

    /// A row of this library, with the common options before its own.
    fn row(&self, name: &str, options: &str) -> Result<System> {
        self.with_models(name, None, None, options)
    }

    /// A row that needs networks; it is missing where they are.
    fn networks(&self, name: &str, prior: bool, head: bool, options: &str) -> Result<System> {
        let of = |wanted: bool, path: &'_ Option<PathBuf>| path.clone().filter(|_| wanted);
        let (prior_model, head_model) =
            (of(prior, &self.args.method.prior_model), of(head, &self.args.method.head_model));
        if prior && prior_model.is_none() {
            return Ok(missing(name, NO_PRIOR_MODEL));
        }
        if head && head_model.is_none() {
            return Ok(missing(name, NO_HEAD_MODEL));
        }
        self.with_models(name, prior_model.as_deref(), head_model.as_deref(), options)
    }

    fn with_models(
        &self,
        name: &str,
        prior: Option<&Path>,
        head: Option<&Path>,
        options: &str,
    ) -> Result<System> {
        let common = self.args.with.split_whitespace().chain(options.split_whitespace());
        let mut words: Vec<OsString> = common.map(Into::into).collect();
        if let Some(path) = prior {
            words.extend(["--prior".into(), "onnx".into(), "--prior-model".into(), path.into()]);
        }
        if let Some(path) = head {
            words.extend(["--head-model".into(), path.into()]);
        }
        let method = Method::parse(words, &format!("row \"{name}\", --with \"{}\"", self.args.with))?;
        Ok(System {
            name: name.into(),
            maker: Maker::Method(Box::new(method)),
            splits: SplitFilter::default(),
        })
    }
}

/// Options that follow the paper exactly: clone the whole denser side, do not relight, use the cameras as given.
const PAPER: &str = "--symmetry always --relight never --calibrate off";

fn missing(name: &str, why: &str) -> System {
    System { name: name.into(), maker: Maker::Missing(why.into()), splits: SplitFilter::default() }
}
