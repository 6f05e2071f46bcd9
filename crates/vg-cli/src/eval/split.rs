//! `split.json`: which views of a scene are the method's input and which are kept for testing.

use crate::job::{Failure, Result};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Names of views, as `--views` takes them.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Split {
    /// Input views of the method.
    pub(crate) input: Vec<String>,
    /// Views in which the result is measured.
    pub(crate) test: Vec<String>,
}

/// Path of a file that belongs to a scene: `path` if it exists, else in the scene's folder.
pub(crate) fn find(path: &Path, scene: &Path) -> PathBuf {
    let folder = if scene.is_dir() { scene } else { scene.parent().unwrap_or(Path::new("")) };
    let beside = folder.join(path);
    if !path.is_file() && beside.is_file() { beside } else { path.to_owned() }
}

/// Reads all splits of the file, or only the one of the given key.
pub(crate) fn read(path: &Path, only: Option<&str>) -> Result<BTreeMap<String, Split>> {
    let broken = |what: String| Failure::job(format!("{}: {what}", path.display()));
    let bytes = std::fs::read(path).map_err(|e| broken(e.to_string()))?;
    let mut splits: BTreeMap<String, Split> = serde_json::from_slice(&bytes).map_err(|e| {
        broken(format!("{e}; expected {{\"KEY\": {{\"input\": [views], \"test\": [views]}}, ...}}"))
    })?;
    if splits.is_empty() {
        return Err(broken("found no split; expected at least one".into()));
    }
    if let Some((key, _)) = splits.iter().find(|(_, s)| s.input.is_empty() || s.test.is_empty()) {
        return Err(broken(format!("{key}: no input view or no test view; expected at least one of each")));
    }
    if let Some(only) = only {
        let keys: Vec<&String> = splits.keys().collect();
        let missing = broken(format!("{only}: no such key; allowed: {keys:?}"));
        let split = splits.remove(only).ok_or(missing)?;
        splits = BTreeMap::from([(only.to_owned(), split)]);
    }
    Ok(splits)
}
