//! The model beside the photographs, view by view.

use super::pictures::{self, Picture};
use crate::job::Result;
use crate::shown::Bar;
use std::time::Instant;
use vg::metrics::{ViewErrors, on_white};
use vg::progress::Threads;
use vg::render::{CpuRenderer, RenderOptions, Renderer};
use vg::{Gaussians, View};

/// What views are to the method.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// It was made from them.
    Input,
    /// It never saw them.
    Test,
}

impl Role {
    /// Most views that are shown as pictures; the others are in the table of numbers.
    pub(super) fn most(self) -> usize {
        match self {
            Self::Input => 8,
            Self::Test => 12,
        }
    }
}

/// A view, and how far off the model is in it.
pub(super) struct Compared {
    pub(super) name: String,
    pub(super) errors: ViewErrors,
    /// Of one picture.
    pub(super) render_ms: f64,
    /// `None` where there are too many to show.
    pub(super) shown: Option<Shown>,
}

pub(super) struct Shown {
    /// The vehicle on white.
    pub(super) photograph: Picture,
    pub(super) render: Picture,
    /// Of a test view.
    pub(super) error: Option<Picture>,
}

/// Draws the model on white into all of these views. Of each, numbers and small pictures are kept.
pub(super) fn views(
    gaussians: &Gaussians,
    views: &[View],
    role: Role,
    threads: &Threads,
) -> Result<Vec<Compared>> {
    let (renderer, options) = (CpuRenderer::new(), RenderOptions::default());
    let bar = Bar::of_pictures(views.len());
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

/// Whether view `i` of `n` is one of the `most` that are spread evenly over them, the first among them.
fn is_shown(i: usize, n: usize, most: usize) -> bool {
    n <= most || (i * most).div_ceil(n) * n < (i + 1) * most
}

/// Means over views; `None` of nothing.
pub(super) fn mean(all: &[Compared]) -> Option<ViewErrors> {
    ViewErrors::mean(&all.iter().map(|one| one.errors).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_views_are_shown_as_may_be_and_the_first_is_one() {
        for n in 1..200 {
            let shown: Vec<usize> = (0..n).filter(|&i| is_shown(i, n, 12)).collect();
            assert_eq!((shown.len(), shown[0]), (n.min(12), 0), "{n}");
        }
    }
}
