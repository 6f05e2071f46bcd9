//! Compares the model with the photographs, view by view.

use super::pictures::{self, Picture};
use crate::job::Result;
use crate::shown::Bar;
use std::time::Instant;
use vg::metrics::{ViewErrors, on_white};
use vg::progress::Threads;
use vg::render::{CpuRenderer, RenderOptions, Renderer};
use vg::{Gaussians, View};

/// Role of views for the method.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// Views the model was made from.
    Input,
    /// Views the method did not use.
    Test,
}

impl Role {
    /// Largest number of views that are shown as pictures; the others appear only in the table of numbers.
    pub(super) fn most(self) -> usize {
        match self {
            Self::Input => 8,
            Self::Test => 12,
        }
    }
}

/// A view and the model's errors in it.
pub(super) struct Compared {
    pub(super) name: String,
    pub(super) errors: ViewErrors,
    /// Render time of one picture.
    pub(super) render_ms: f64,
    /// `None` where there are too many to show.
    pub(super) shown: Option<Shown>,
}

pub(super) struct Shown {
    /// The vehicle on white.
    pub(super) photograph: Picture,
    pub(super) render: Picture,
    /// Difference of the two; only for a test view.
    pub(super) error: Option<Picture>,
}

/// Renders the model on white into all of these views and keeps the numbers and small pictures of each.
pub(super) fn views(
    gaussians: &Gaussians,
    views: &[View],
    role: Role,
    threads: &Threads,
) -> Result<Vec<Compared>> {
    let (renderer, options) = (CpuRenderer::new(), RenderOptions::default());
    let bar = Bar::for_pictures(views.len());
    let mut all = Vec::with_capacity(views.len());
    for (i, view) in views.iter().enumerate() {
        let start = Instant::now();
        let drawn = threads.run(|| renderer.render(gaussians, &view.camera, &options))?;
        let render_ms = start.elapsed().as_secs_f64() * 1e3;
        let errors = threads.run(|| ViewErrors::of(&drawn, view));
        let shown = match is_shown(i, views.len(), role.most()) {
            true => {
                let (size, photograph) = ((drawn.width, drawn.height), on_white(view));
                Some(Shown {
                    error: match role {
                        Role::Test => Some(pictures::error(size, &photograph, &drawn.color)?),
                        Role::Input => None,
                    },
                    photograph: pictures::picture(size, &photograph)?,
                    render: pictures::picture(size, &drawn.color)?,
                })
            }
            false => None,
        };
        all.push(Compared { name: view.name.clone(), errors, render_ms, shown });
        bar.advance();
    }
    Ok(all)
}

/// Whether view `i` of `n` is one of the `most` that are spread evenly over them, including the first.
fn is_shown(i: usize, n: usize, most: usize) -> bool {
    n <= most || (i * most).div_ceil(n) * n < (i + 1) * most
}

/// Means over views; `None` for no views.
pub(super) fn mean(all: &[Compared]) -> Option<ViewErrors> {
    ViewErrors::mean(&all.iter().map(|one| one.errors).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_views_are_shown_as_allowed_including_the_first() {
        for n in 1..200 {
            let shown: Vec<usize> = (0..n).filter(|&i| is_shown(i, n, 12)).collect();
            assert_eq!((shown.len(), shown[0]), (n.min(12), 0), "{n}");
        }
    }
}
