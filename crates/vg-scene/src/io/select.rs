//! Selection of a scene's views by name.

use super::listing::ListedView;
use std::path::Path;
use vg_geometry::{Error, Result};

/// Maximum of names that an error lists.
const SHOWN: usize = 8;

/// Indices into `views` of `names`, in their order. A name is a view's path in the scene file, its name, its
/// file name, or that without extension; the first of these levels with a match must have exactly one.
pub(super) fn select(views: &[ListedView], names: &[String]) -> Result<Vec<usize>> {
    names.iter().enumerate().map(|(i, name)| one(views, name, i)).collect()
}

/// Index of the view that `name` matches.
fn one(views: &[ListedView], name: &str, position: usize) -> Result<usize> {
    let file_name = |path: &str| Path::new(path).file_name().map(|f| f.to_string_lossy().into_owned());
    let stem = |path: &str| Path::new(path).with_extension("").to_string_lossy().into_owned();
    let levels: [&dyn Fn(&ListedView) -> bool; 5] = [
        &|view| view.path_in_file == name,
        &|view| view.name == name,
        &|view| file_name(&view.name).as_deref() == Some(name),
        &|view| stem(&view.path_in_file) == name || stem(&view.name) == name,
        &|view| file_name(&stem(&view.name)).as_deref() == Some(name),
    ];
    let argument = || format!("views[{position}]");
    for matches in levels {
        let mut found = (0..views.len()).filter(|&i| matches(&views[i]));
        match (found.next(), found.next()) {
            (Some(only), None) => return Ok(only),
            (Some(first), Some(second)) => {
                let (first, second) = (&views[first].path_in_file, &views[second].path_in_file);
                return Err(Error::argument(
                    argument(),
                    format!("{name:?}, which matches {first:?} and {second:?}"),
                    "the name of exactly one view; give its path",
                ));
            }
            _ => {}
        }
    }
    let mut available: Vec<&str> = views.iter().take(SHOWN).map(|v| v.name.as_str()).collect();
    let more = format!("and {} more", views.len().saturating_sub(SHOWN));
    if views.len() > SHOWN {
        available.push(&more);
    }
    Err(Error::argument(argument(), format!("{name:?}, which matches no view"), available.join(", ")))
}
