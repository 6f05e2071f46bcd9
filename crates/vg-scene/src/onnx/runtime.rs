//! Finds and loads ONNX Runtime, once per process.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use vg_geometry::{Error, Result};

const VARIABLE: &str = "VG_ONNXRUNTIME";

/// Path of the runtime that this process has loaded.
static LOADED: Mutex<Option<PathBuf>> = Mutex::new(None);

/// Loads the runtime named by the caller, or else by the environment, or else the one in a Python installation.
pub(super) fn load(asked: Option<&Path>) -> Result<()> {
    let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
    let asked = asked.map(library_in).transpose()?;
    if let Some(loaded) = &*loaded {
        return match asked.filter(|asked| canonical(asked) != *loaded) {
            None => Ok(()),
            Some(other) => {
                let allowed = format!("{}, which this process has loaded already", loaded.display());
                Err(Error::argument("runtime", other.display().to_string(), allowed))
            }
        };
    }
    let named = || std::env::var_os(VARIABLE).filter(|v| !v.is_empty());
    let path = match (asked, named()) {
        (Some(path), _) => path,
        (None, Some(named)) => library_in(Path::new(&named))?,
        (None, None) => find_in_python().ok_or_else(|| missing("not found in any Python installation"))?,
    };
    let path = canonical(&path);
    let environment = ort::init_from(&path).map_err(|e| missing(&e.to_string()))?;
    environment.with_name("vg").with_telemetry(false).commit();
    *loaded = Some(path);
    Ok(())
}

fn missing(found: &str) -> Error {
    let found = found.split_whitespace().collect::<Vec<_>>().join(" ");
    let oldest = ort::MINOR_VERSION;
    let remedy = format!(
        "version 1.{oldest} or newer is needed: pip install onnxruntime, or name the library (libonnxruntime.so) with \
         {VARIABLE} or in the options"
    );
    Error::Missing { what: "ONNX Runtime", found, remedy }
}

fn canonical(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

/// The library at a path, which may be the library itself or its folder.
fn library_in(path: &Path) -> Result<PathBuf> {
    if !path.is_dir() {
        return match path.exists() {
            true => Ok(path.to_owned()),
            false => Err(missing(&format!("{} does not exist", path.display()))),
        };
    }
    let found = newest(path, is_library);
    found.ok_or_else(|| missing(&format!("no libonnxruntime in {}", path.display())))
}

fn is_library(name: &str) -> bool {
    name == "onnxruntime.dll"
        || name.starts_with("libonnxruntime.so")
        || (name.starts_with("libonnxruntime.") && name.ends_with(".dylib"))
}

/// Finds the library in the active environment, in the user's own packages, or next to the `python3` on the path.
fn find_in_python() -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let mut prefixes: Vec<PathBuf> =
        ["VIRTUAL_ENV", "CONDA_PREFIX"].iter().filter_map(|n| folder(n)).collect();
    prefixes.extend(folder("HOME").map(|home| home.join(".local")));
    for bin in std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default()) {
        let python = bin.join("python3");
        if python.exists() {
            let parents = [Some(python.clone()), python.canonicalize().ok()];
            prefixes
                .extend(parents.into_iter().flatten().filter_map(|p| Some(p.parent()?.parent()?.to_owned())));
        }
    }
    prefixes.iter().find_map(|prefix| find_in_prefix(prefix))
}

fn find_in_prefix(prefix: &Path) -> Option<PathBuf> {
    let packages = |lib: &Path| {
        ["site-packages", "dist-packages"]
            .iter()
            .find_map(|packages| newest(&lib.join(packages).join("onnxruntime/capi"), is_library))
    };
    let lib = prefix.join("lib");
    let entries = std::fs::read_dir(&lib).ok()?;
    let mut versions: Vec<PathBuf> = entries
        .flatten()
        .filter(|e| e.file_name().to_string_lossy().starts_with("python3"))
        .map(|e| e.path())
        .collect();
    versions.sort();
    versions.iter().rev().find_map(|lib| packages(lib))
}

/// The last wanted file of a folder by name.
fn newest(folder: &Path, is_wanted: impl Fn(&str) -> bool) -> Option<PathBuf> {
    let entries = std::fs::read_dir(folder).ok()?.flatten();
    entries.filter(|e| is_wanted(&e.file_name().to_string_lossy())).map(|e| e.path()).max()
}
