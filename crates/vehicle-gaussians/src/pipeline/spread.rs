//! The choice of views where not all may be used: those that show the vehicle from the most different directions.

use crate::prior::volume::whereabouts;
use glam::DVec3;
use vg_geometry::MIRROR_Y;
use vg_scene::{Mask, View};

/// Ascending indices of at most `most` views. A view and its mirrored twin show the same, so directions are compared
/// across y = 0 as well.
pub(super) fn spread(views: &[View], most: usize) -> Vec<usize> {
    if views.len() <= most {
        return (0..views.len()).collect();
    }
    // Without masks the vehicle is taken to be at the origin of its frame.
    let middle = whereabouts(views).map_or(DVec3::ZERO, |(middle, _)| middle);
    let directions: Vec<DVec3> =
        views.iter().map(|v| (v.camera.center() - middle).normalize_or(DVec3::X)).collect();
    let mirror = MIRROR_Y.as_dvec3();
    let apart = |a: usize, b: usize| {
        let (a, b) = (directions[a], directions[b]);
        a.angle_between(b).min(a.angle_between(b * mirror))
    };
    // The view with the most vehicle pixels first, then always the one farthest from those chosen.
    let shown = |i: usize| views[i].mask.as_ref().map_or(0, Mask::vehicle_pixels);
    let largest = (0..views.len()).rev().max_by_key(|&i| shown(i)).unwrap_or(0);
    let mut taken = vec![largest];
    let mut distance: Vec<f64> = (0..views.len()).map(|i| apart(i, largest)).collect();
    while taken.len() < most {
        let left = (0..views.len()).rev().filter(|i| !taken.contains(i));
        let Some(next) = left.max_by(|a, b| distance[*a].total_cmp(&distance[*b])) else { break };
        taken.push(next);
        distance.iter_mut().enumerate().for_each(|(i, d)| *d = d.min(apart(i, next)));
    }
    taken.sort_unstable();
    taken
}

#[cfg(test)]
mod tests {
    use super::*;
    use vg_geometry::{Camera, Intrinsics, Pose};
    use vg_scene::RgbImage;

    fn from(degrees: f64) -> View {
        let angle = degrees.to_radians();
        let translation = 6.0 * DVec3::new(angle.cos(), angle.sin(), 0.0);
        let intrinsics = Intrinsics { fx: 4.0, fy: 4.0, cx: 2.0, cy: 2.0 };
        let pose = Pose { translation, ..Pose::IDENTITY };
        let camera = Camera::pinhole(4, 4, intrinsics, pose).unwrap();
        let image = RgbImage::new(4, 4, vec![[0; 3]; 16]).unwrap();
        View { name: String::new(), camera, image, mask: None, depth: None }
    }

    #[test]
    fn similar_views_are_left_out_first_and_mirrored_twins_are_similar() {
        let views = [10.0, 12.0, -11.0, 90.0, 88.0, 170.0].map(from);
        assert_eq!(spread(&views, 3), [0, 3, 5]);
        assert_eq!(spread(&views, 1), [0]);
        assert_eq!(spread(&views, 6), [0, 1, 2, 3, 4, 5]);
        assert_eq!(spread(&views, 99).len(), 6);
    }
}
