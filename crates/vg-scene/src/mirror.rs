//! A view's mirror image across y = 0: the view of a symmetric vehicle by a camera on the other side.

use super::mask::Mask;
use super::{DepthMap, RgbImage, View};
use vg_geometry::{Camera, Intrinsics};

/// The flipped photograph, mask and depth of the mirrored camera. The view is a pinhole.
pub fn mirrored(view: &View) -> View {
    let camera = &view.camera;
    debug_assert!(camera.distortion.is_none());
    let i = camera.intrinsics;
    let (width, height) = (camera.width, camera.height);
    let whole = "flipping keeps the number of pixels";
    View {
        name: format!("{} (mirrored)", view.name),
        camera: Camera {
            intrinsics: Intrinsics { cx: f64::from(width) - i.cx, ..i },
            vehicle_from_camera: camera.vehicle_from_camera.mirrored(),
            ..*camera
        },
        image: RgbImage::new(width, height, flipped(view.image.pixels(), width)).expect(whole),
        mask: view.mask.as_ref().map(|m| Mask::new(width, height, flipped(m.labels(), width)).expect(whole)),
        depth: view.depth.as_ref().map(|d| {
            let depth = DepthMap::new(width, height, flipped(d.depth(), width)).expect(whole);
            match d.confidence() {
                Some(confidence) => depth.with_confidence(flipped(confidence, width)).expect(whole),
                None => depth,
            }
        }),
    }
}

/// The pixels with each row reversed.
fn flipped<T: Copy>(pixels: &[T], width: u32) -> Vec<T> {
    pixels.chunks_exact(width as usize).flat_map(|row| row.iter().rev().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mask::Label;
    use glam::{DMat3, DQuat, DVec3};
    use vg_geometry::Pose;

    #[test]
    fn a_mirrored_pixel_sees_the_mirrored_place_in_the_same_colour() {
        let i = Intrinsics { fx: 5.0, fy: 6.0, cx: 1.7, cy: 1.2 };
        let rotation = DMat3::from_quat(DQuat::from_xyzw(0.4, -0.3, 0.2, 0.8).normalize());
        let pose = Pose { rotation, translation: DVec3::new(1.0, -7.0, 1.4) };
        let colors: Vec<[u8; 3]> = (0..12).map(|k| [k, 2 * k, 3 * k]).collect();
        let labels = (0..12).map(|k| if k % 3 == 0 { Label::Vehicle } else { Label::Background }).collect();
        let view = View {
            name: "right".into(),
            camera: Camera::pinhole(4, 3, i, pose).unwrap(),
            image: RgbImage::new(4, 3, colors).unwrap(),
            mask: Some(Mask::new(4, 3, labels).unwrap()),
            depth: Some(DepthMap::new(4, 3, (1..=12).map(|k| k as f32).collect()).unwrap()),
        };
        let twin = mirrored(&view);
        for v in 0..3 {
            for u in 0..4 {
                let across = 3 - u;
                assert_eq!(view.image.get(u, v), twin.image.get(across, v));
                let is_vehicle = |view: &View, u| view.mask.as_ref().unwrap().is_vehicle(u, v);
                assert_eq!(is_vehicle(&view, u), is_vehicle(&twin, across));
                let z = view.depth.as_ref().unwrap().get(u, v).unwrap();
                assert_eq!(twin.depth.as_ref().unwrap().get(across, v), Some(z));
                let (place, mirror) = (view.lift(u, v, z), twin.lift(across, v, z));
                assert!(
                    (place.x - mirror.x).abs() + (place.y + mirror.y).abs() + (place.z - mirror.z).abs()
                        < 1e-5
                );
            }
        }
    }
}
