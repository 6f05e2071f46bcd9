//! The frame that positions and camera poses are in, as a type.
//!
//! A run has two frames. The caller's cameras are posed in the one and the result is returned in it. The stages between
//! work in the other, whose plane y = 0 is the plane of symmetry that the calibration found.

use super::run::PointCloud;
use std::marker::PhantomData;
use std::ops::Deref;
use vg_geometry::progress::Context;
use vg_geometry::{Result, Similarity};
use vg_scene::Cloud;
use vg_splat::Gaussians;

/// The vehicle frame of the caller's cameras.
#[derive(Clone, Copy, Debug)]
pub(super) enum Given {}

/// The frame that the stages work in: its plane y = 0 is the plane of symmetry.
#[derive(Clone, Copy, Debug)]
pub(super) enum Working {}

/// A value whose positions and poses are in the frame `F`.
#[derive(Clone, Debug)]
pub(super) struct InFrame<F, T> {
    value: T,
    frame: PhantomData<F>,
}

impl<F, T> InFrame<F, T> {
    /// Marks a value that is in the frame `F` already.
    pub(super) fn new(value: T) -> Self {
        Self { value, frame: PhantomData }
    }

    /// The value without its frame.
    pub(super) fn into_inner(self) -> T {
        self.value
    }
}

impl<F, T> Deref for InFrame<F, T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.value
    }
}

/// The transform from the working frame to the caller's; `None` where they are the same.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct GivenFromWorking(pub(super) Option<Similarity>);

impl GivenFromWorking {
    /// Gaussians in the caller's frame.
    pub(super) fn gaussians(
        &self,
        gaussians: InFrame<Working, Gaussians>,
        context: &Context,
    ) -> Result<InFrame<Given, Gaussians>> {
        let gaussians = gaussians.into_inner();
        Ok(InFrame::new(match &self.0 {
            Some(given_from_working) => context.parallel(|| gaussians.transformed(given_from_working))?,
            None => gaussians,
        }))
    }

    /// Coloured points in the caller's frame.
    pub(super) fn points(&self, points: InFrame<Working, PointCloud>) -> InFrame<Given, PointCloud> {
        let points = points.into_inner();
        InFrame::new(match &self.0 {
            Some(given_from_working) => points.transformed(given_from_working),
            None => points,
        })
    }

    /// Measured points of the caller in the working frame.
    pub(super) fn measured_points(&self, cloud: &Cloud) -> InFrame<Working, Cloud> {
        InFrame::new(match &self.0 {
            Some(given_from_working) => cloud.in_frame(given_from_working),
            None => cloud.clone(),
        })
    }
}
