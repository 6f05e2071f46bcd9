//! nerfstudio's `transforms.json`: intrinsics shared or per frame, camera-to-world poses with OpenGL axes, and
//! the files of each frame. Nothing here touches the file system.

use super::files::{in_file, relative_inside};
use crate::error::{Error, Result};
use crate::geometry::camera::MAX_SIDE;
use crate::geometry::frame::pose_from_opengl;
use crate::geometry::{Camera, CameraModel, Distortion, Intrinsics, Pose};
use crate::scene::{Place, VehicleBox};
use serde::Deserialize;
use serde::de::{SeqAccess, Visitor};
use std::path::{Path, PathBuf};

/// What the file says.
#[derive(Clone, Debug, PartialEq)]
pub struct Transforms {
    /// In the file's order; at least one.
    pub frames: Vec<Frame>,
    /// `depth_unit_scale_factor`: metres per number in a depth file.
    pub depth_unit: Option<f64>,
    /// The key that says that the poses were moved from where they were measured, if one does.
    pub moved_by: Option<&'static str>,
    /// `vehicle_box`: `{"size": [length, width, height]}`, or with `"center": [x, y, z], "yaw": radians` in the world of
    /// the poses.
    pub vehicle_box: Option<VehicleBox>,
}

/// One picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// `file_path`, relative to the file's folder and inside it.
    pub file_path: PathBuf,
    /// `mask_path`, likewise.
    pub mask_path: Option<PathBuf>,
    /// `depth_file_path`, likewise.
    pub depth_file_path: Option<PathBuf>,
    /// `world_from_camera` with our camera axes.
    pub world_from_camera: Pose,
    /// `w`, `h`; without them the picture's own size counts.
    pub size: Option<(u32, u32)>,
    lens: Lens,
}

/// The keys of a camera, each of which may stand in the frame or, for all frames, at the top.
#[derive(Clone, Debug, Default, PartialEq)]
struct Lens {
    w: Option<f64>,
    h: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    k5: Option<f64>,
    k6: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
    camera_model: Option<String>,
}

/// Declares a part of the document that may hold camera keys beside its own: serde's `flatten` would do, but it
/// copies every unknown key and loses where an error is.
macro_rules! with_lens {
    (struct $name:ident { $($(#[$meta:meta])* $field:ident: $type:ty,)* } [$($key:ident)*]) => {
        #[derive(Deserialize)]
        struct $name {
            $($(#[$meta])* $field: $type,)*
            $($key: Option<f64>,)*
            camera_model: Option<String>,
        }
        impl $name {
            /// These camera keys; those that are missing from `shared`.
            fn lens(&self, shared: &Lens) -> Lens {
                Lens {
                    $($key: self.$key.or(shared.$key),)*
                    camera_model: self.camera_model.clone().or_else(|| shared.camera_model.clone()),
                }
            }
        }
    };
}

with_lens! {
    struct DocumentJson {
        frames: Vec<FrameJson>,
        depth_unit_scale_factor: Option<f64>,
        applied_transform: Option<Rows>,
        applied_scale: Option<f64>,
        vehicle_box: Option<BoxJson>,
    } [w h fl_x fl_y cx cy camera_angle_x camera_angle_y k1 k2 k3 k4 k5 k6 p1 p2]
}

with_lens! {
    struct FrameJson {
        file_path: String,
        mask_path: Option<String>,
        depth_file_path: Option<String>,
        transform_matrix: Rows,
    } [w h fl_x fl_y cx cy camera_angle_x camera_angle_y k1 k2 k3 k4 k5 k6 p1 p2]
}

/// See [`Transforms::vehicle_box`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BoxJson {
    size: [f64; 3],
    center: Option<[f64; 3]>,
    yaw: Option<f64>,
}

impl BoxJson {
    fn checked(self, path: &Path) -> Result<VehicleBox> {
        const FIELD: &str = "vehicle_box";
        let place = match (self.center, self.yaw) {
            (Some(center), yaw) => Some(Place { center, yaw: yaw.unwrap_or(0.0) }),
            (None, None) => None,
            (None, Some(_)) => {
                let reason = "missing beside a yaw; allowed: x, y, z of the box's centre, metres";
                return Err(Error::format(path, format!("{FIELD}.center"), reason));
            }
        };
        let known = VehicleBox { size: self.size, place };
        known.validate(FIELD).map_err(|e| in_file(path, e))?;
        Ok(known)
    }
}

/// The rows of a 3x4 matrix, or of a 4x4 one whose last row is 0 0 0 1.
#[derive(Debug)]
struct Rows([f64; 12]);

impl<'de> Deserialize<'de> for Rows {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct RowsVisitor;
        impl<'de> Visitor<'de> for RowsVisitor {
            type Value = Rows;

            fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str("3 or 4 rows of 4 numbers, the last of 4 rows being 0 0 0 1")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> std::result::Result<Rows, A::Error> {
                use serde::de::Error as _;
                let mut m = [0.0; 12];
                for i in 0..3 {
                    let row: [f64; 4] =
                        seq.next_element()?.ok_or_else(|| A::Error::invalid_length(i, &self))?;
                    m[4 * i..4 * i + 4].copy_from_slice(&row);
                }
                if let Some(last) = seq.next_element::<[f64; 4]>()?
                    && last != [0.0, 0.0, 0.0, 1.0]
                {
                    return Err(A::Error::custom(format!("last row {last:?}; expected 0 0 0 1")));
                }
                match seq.next_element::<[f64; 4]>()? {
                    None => Ok(Rows(m)),
                    Some(_) => Err(A::Error::invalid_length(5, &self)),
                }
            }
        }
        deserializer.deserialize_seq(RowsVisitor)
    }
}

/// Reads the text of a `transforms.json`; `path` is for messages only.
pub fn parse(bytes: &[u8], path: &Path) -> Result<Transforms> {
    let document: DocumentJson = super::json::parse_object(bytes, path)?;
    if document.frames.is_empty() {
        return Err(Error::format(path, "frames", "empty; allowed: at least one frame"));
    }
    if let Some(unit) = document.depth_unit_scale_factor
        && !(unit > 0.0 && unit.is_finite())
    {
        let reason = format!("{unit}; allowed: metres per unit, above 0");
        return Err(Error::format(path, "depth_unit_scale_factor", reason));
    }
    let shared = document.lens(&Lens::default());
    let frames = document.frames.iter().enumerate();
    let frames =
        frames.map(|(i, f)| frame(f, &shared, path, &format!("frames[{i}]"))).collect::<Result<_>>()?;
    const IDENTITY: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let moved_by = if document.applied_transform.is_some_and(|t| t.0 != IDENTITY) {
        Some("applied_transform")
    } else {
        document.applied_scale.filter(|&s| s != 1.0).map(|_| "applied_scale")
    };
    let vehicle_box = document.vehicle_box.map(|known| known.checked(path)).transpose()?;
    Ok(Transforms { frames, depth_unit: document.depth_unit_scale_factor, moved_by, vehicle_box })
}

fn frame(json: &FrameJson, shared: &Lens, path: &Path, field: &str) -> Result<Frame> {
    let file = |key: &str, text: &str| {
        relative_inside(text).map_err(|reason| Error::format(path, format!("{field}.{key}"), reason))
    };
    let optional = |key: &str, text: &Option<String>| match text.as_deref() {
        None | Some("") => Ok(None),
        Some(text) => file(key, text).map(Some),
    };
    let lens = json.lens(shared);
    let size = match (lens.w, lens.h) {
        (None, None) => None,
        (Some(w), Some(h)) => {
            let side = |s: f64| (1.0..=f64::from(MAX_SIDE)).contains(&s) && s.fract() == 0.0;
            if !(side(w) && side(h)) {
                let reason = format!("{w}x{h}; allowed: whole numbers, 1x1 to {MAX_SIDE}x{MAX_SIDE}");
                return Err(Error::format(path, format!("{field}.w, h"), reason));
            }
            Some((w as u32, h as u32))
        }
        _ => {
            return Err(Error::format(
                path,
                format!("{field}.w, h"),
                "only one of them; allowed: both or none",
            ));
        }
    };
    let pose = pose_from_opengl(&format!("{field}.transform_matrix"), &json.transform_matrix.0);
    let frame = Frame {
        file_path: file("file_path", &json.file_path)?,
        mask_path: optional("mask_path", &json.mask_path)?,
        depth_file_path: optional("depth_file_path", &json.depth_file_path)?,
        world_from_camera: pose.map_err(|e| in_file(path, e))?,
        size,
        lens,
    };
    // What is wrong with the lens is wrong whatever the picture's size.
    frame.camera(frame.size.unwrap_or((1, 1)), path, field)?;
    Ok(frame)
}

impl Frame {
    /// The camera of a picture of this size, its pose being `world_from_camera`; `field` names the frame.
    pub fn camera(&self, (width, height): (u32, u32), path: &Path, field: &str) -> Result<Camera> {
        let lens = &self.lens;
        let (w, h) = (f64::from(width), f64::from(height));
        let from_angle = |size: f64, angle: f64| 0.5 * size / (0.5 * angle).tan();
        let fx = lens.fl_x.or(lens.camera_angle_x.map(|a| from_angle(w, a)));
        let fy = lens.fl_y.or(lens.camera_angle_y.map(|a| from_angle(h, a)));
        // Square pixels unless both are given.
        let (Some(fx), Some(fy)) = (fx.or(fy), fy.or(fx)) else {
            return Err(Error::format(
                path,
                format!("{field}.fl_x"),
                "missing; allowed: fl_x (and fl_y) or camera_angle_x, in the frame or at the top",
            ));
        };
        let intrinsics =
            Intrinsics { fx, fy, cx: lens.cx.unwrap_or(0.5 * w), cy: lens.cy.unwrap_or(0.5 * h) };
        let camera = Camera {
            width,
            height,
            intrinsics,
            distortion: lens.distortion(path, field)?,
            vehicle_from_camera: self.world_from_camera,
        };
        camera.validate(field).map_err(|e| in_file(path, e))?;
        Ok(camera)
    }
}

impl Lens {
    /// nerfstudio's k1, k2, k3, p1, p2 are Brown's; with OPENCV_FISHEYE k1 to k4 are the fisheye's.
    fn distortion(&self, path: &Path, field: &str) -> Result<Distortion> {
        let k = [self.k1, self.k2, self.k3, self.k4, self.k5, self.k6].map(|v| v.unwrap_or(0.0));
        let p = [self.p1, self.p2].map(|v| v.unwrap_or(0.0));
        let brown = Distortion::Brown { k, p };
        let unused = |from: usize, p_too: bool| {
            let stray = k[from..].iter().chain(if p_too { &p[..] } else { &[] }).find(|&&v| v != 0.0);
            let Some(stray) = stray else { return Ok(()) };
            let name = self.camera_model.as_deref().unwrap_or("OPENCV");
            let reason = format!(
                "{name} with a coefficient {stray} that it does not have; allowed: OPENCV with k1 k2 k3 p1 p2, FULL_OPENCV with k1 to k6 p1 p2, OPENCV_FISHEYE with k1 to k4"
            );
            Err(Error::format(path, format!("{field}.camera_model"), reason))
        };
        let model = match self.camera_model.as_deref() {
            // Files without the key are OPENCV; zero coefficients make it a pinhole.
            None => CameraModel::OpenCv,
            Some(name) => CameraModel::from_name(name).ok_or_else(|| {
                let all = CameraModel::ALL.map(CameraModel::name).join(", ");
                Error::format(path, format!("{field}.camera_model"), format!("{name:?}; allowed: {all}"))
            })?,
        };
        match model {
            CameraModel::SimplePinhole | CameraModel::Pinhole => unused(0, true)?,
            CameraModel::SimpleRadial => unused(1, true)?,
            CameraModel::Radial => unused(2, true)?,
            CameraModel::OpenCv => unused(3, false)?,
            CameraModel::FullOpenCv => {}
            CameraModel::OpenCvFisheye => {
                unused(4, true)?;
                return Ok(Distortion::Fisheye { k: [k[0], k[1], k[2], k[3]] });
            }
        }
        Ok(if brown.is_none() { Distortion::None } else { brown })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POSE: &str = "[[1,0,0,0.5],[0,1,0,2],[0,0,1,-3],[0,0,0,1]]";

    fn one(top: &str, frame: &str) -> Result<Transforms> {
        let text = format!(
            r#"{{{top} "frames": [{{"file_path": "images/a.png", {frame} "transform_matrix": {POSE}}}]}}"#
        );
        parse(text.as_bytes(), Path::new("transforms.json"))
    }

    fn camera(top: &str, frame: &str) -> Camera {
        let file = one(top, frame).unwrap();
        file.frames[0].camera((400, 300), Path::new("transforms.json"), "frames[0]").unwrap()
    }

    #[test]
    fn a_frame_s_own_intrinsics_win_over_the_shared_ones() {
        let c = camera(r#""fl_x": 100, "fl_y": 101, "cx": 7.5,"#, r#""fl_x": 200.5,"#);
        assert_eq!(c.intrinsics, Intrinsics { fx: 200.5, fy: 101.0, cx: 7.5, cy: 150.0 });
        assert_eq!(c.distortion, Distortion::None);
    }

    #[test]
    fn a_field_of_view_of_90_degrees_is_a_focal_length_of_half_the_width() {
        let c = camera(r#""camera_angle_x": 1.5707963267948966,"#, "");
        assert!((c.intrinsics.fx - 200.0).abs() < 1e-12 && c.intrinsics.fx == c.intrinsics.fy);
    }

    #[test]
    fn coefficients_keep_their_places_in_brown_and_in_fisheye() {
        let k = r#""fl_x": 100, "k1": 0.1, "k2": 0.2, "k3": 0.3, "p1": 0.01, "p2": 0.02,"#;
        let brown = Distortion::Brown { k: [0.1, 0.2, 0.3, 0.0, 0.0, 0.0], p: [0.01, 0.02] };
        assert_eq!(camera(k, "").distortion, brown);
        let fisheye = r#""camera_model": "OPENCV_FISHEYE", "fl_x": 9, "k1": 0.1, "k4": 0.4,"#;
        assert_eq!(camera(fisheye, "").distortion, Distortion::Fisheye { k: [0.1, 0.0, 0.0, 0.4] });
    }

    #[test]
    fn opengl_axes_are_turned_into_ours() {
        let pose = one(r#""fl_x": 1,"#, "").unwrap().frames[0].world_from_camera;
        assert_eq!(pose.translation.to_array(), [0.5, 2.0, -3.0]);
        assert_eq!(pose.rotation.z_axis.to_array(), [0.0, 0.0, -1.0]);
        assert_eq!(pose.rotation.y_axis.to_array(), [0.0, -1.0, 0.0]);
    }

    #[test]
    fn a_vehicle_s_box_has_a_size_and_perhaps_a_place_and_nothing_else() {
        let known = |text: &str| Ok(one(&format!(r#""fl_x": 1, "vehicle_box": {text},"#), "")?.vehicle_box);
        let size = [4.4, 1.8, 1.5];
        let only: Result<_> = known(r#"{"size": [4.4, 1.8, 1.5]}"#);
        assert_eq!(only.unwrap(), Some(VehicleBox { size, place: None }));
        let place = Place { center: [3.0, -2.0, 0.8], yaw: 0.5 };
        let placed: Result<_> = known(r#"{"size": [4.4, 1.8, 1.5], "center": [3, -2, 0.8], "yaw": 0.5}"#);
        assert_eq!(placed.unwrap(), Some(VehicleBox { size, place: Some(place) }));
        for (bad, cause) in [
            (r#"{"size": [4.4, 1.8]}"#, "vehicle_box"),
            (r#"{"size": [4.4, 1.8, 1500]}"#, "vehicle_box.size"),
            (r#"{"size": [4.4, 1.8, 1.5], "yaw": 1}"#, "vehicle_box.center"),
            (r#"{"size": [4.4, 1.8, 1.5], "center": [0, 0, 0], "yaw": 90}"#, "radians"),
            (r#"{"size": [4.4, 1.8, 1.5], "centre": [0, 0, 0]}"#, "centre"),
        ] {
            let error = known(bad).unwrap_err().to_string();
            assert!(error.contains(cause), "{bad}: {error}");
        }
    }

    #[test]
    fn an_applied_transform_is_reported_and_an_identity_is_not() {
        let moved = |t: &str| one(&format!(r#""fl_x": 1, "applied_transform": {t},"#), "").unwrap().moved_by;
        assert_eq!(moved("[[1,0,0,0],[0,1,0,0],[0,0,1,0]]"), None);
        assert_eq!(moved("[[0,1,0,0],[1,0,0,0],[0,0,-1,0]]"), Some("applied_transform"));
        assert_eq!(one(r#""fl_x": 1, "applied_scale": 2,"#, "").unwrap().moved_by, Some("applied_scale"));
    }
}
