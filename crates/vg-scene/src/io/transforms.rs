//! nerfstudio's `transforms.json`, and instant-ngp's: intrinsics shared or per frame, camera-to-world poses with
//! OpenGL axes, and the files of each frame. This module does not access the file system.
//!
//! Keys that change the meaning of a picture or a pose are supported or refused. Keys for a trainer (`aabb_scale`,
//! `scale`, `offset`, `train_filenames`, `sharpness`, ...) are ignored: poses are used as written.

use super::files::{in_file, relative_inside};
use crate::{Place, VehicleBox};
use serde::Deserialize;
use serde::de::{SeqAccess, Visitor};
use serde_json::Value;
use std::path::{Path, PathBuf};
use vg_geometry::camera::MAX_SIDE;
use vg_geometry::frame::pose_from_opengl;
use vg_geometry::{Camera, CameraModel, Distortion, Error, Intrinsics, Pose, Result};

/// Content of a `transforms.json`.
#[derive(Clone, Debug, PartialEq)]
pub struct Transforms {
    /// Frames in the file's order; at least one.
    pub frames: Vec<Frame>,
    /// `depth_unit_scale_factor` or `integer_depth_scale`: metres per number in a depth file.
    pub depth_unit: Option<f64>,
    /// Whether depth is loaded: `enable_depth_loading`, true by default.
    pub loads_depth: bool,
    /// The key that shows that the poses were transformed or that z is not up, if any.
    pub moved_by: Option<&'static str>,
    /// `vehicle_box`: `{"size": [length, width, height]}`, or with `"center": [x, y, z], "yaw": radians` in the world
    /// of the poses.
    pub vehicle_box: Option<VehicleBox>,
}

/// One picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// `file_path`, relative to the file's folder and inside it.
    pub file_path: PathBuf,
    /// `mask_path`, relative to the file's folder and inside it.
    pub mask_path: Option<PathBuf>,
    /// `depth_file_path` or `depth_path`, relative to the file's folder and inside it.
    pub depth_file_path: Option<PathBuf>,
    /// `world_from_camera` with this library's camera axes.
    pub world_from_camera: Pose,
    /// `w`, `h`; without them the picture's own size is used.
    pub size: Option<(u32, u32)>,
    lens: Lens,
}

/// Calls a macro with the keys of a camera, each of which may be in the frame or, for all frames, at the top level, and
/// with the keys that are refused.
macro_rules! with_keys {
    ($then:ident! $($rest:tt)*) => {
        $then! {
            $($rest)*
            [
                w h fl_x fl_y cx cy camera_angle_x camera_angle_y x_fov y_fov
                k1 k2 k3 k4 k5 k6 p1 p2
            ]
            [
                ftheta_p0 latlong equirectangular
                transform_matrix_start transform_matrix_end
                white_transparent black_transparent
            ]
        }
    };
}

/// Declares a camera's keys.
macro_rules! lens {
    ([$($key:ident)*] [$($refused:ident)*]) => {
        #[derive(Clone, Debug, Default, PartialEq)]
        struct Lens {
            $($key: Option<f64>,)*
            camera_model: Option<String>,
        }
        impl Lens {
            /// These keys, with missing ones filled from `shared`.
            fn or(self, shared: Self) -> Self {
                Self {
                    $($key: self.$key.or(shared.$key),)*
                    camera_model: self.camera_model.or(shared.camera_model),
                }
            }
        }
    };
}

/// Declares a part of the document that may contain camera keys in addition to its own. serde's `flatten` would copy
/// every unknown key and lose the place of errors.
macro_rules! with_lens {
    (
        struct $name:ident { $($(#[$meta:meta])* $field:ident: $type:ty,)* }
        [$($key:ident)*] [$($refused:ident)*]
    ) => {
        #[derive(Deserialize)]
        struct $name {
            $($(#[$meta])* $field: $type,)*
            $($key: Option<f64>,)*
            camera_model: Option<String>,
            is_fisheye: Option<bool>,
            distortion_params: Option<Vec<f64>>,
            $($refused: Option<Value>,)*
        }
        impl $name {
            /// The camera keys of this part.
            fn lens(&self) -> std::result::Result<Lens, (&'static str, String)> {
                let refused = [$((stringify!($refused), &self.$refused),)*];
                let is_set = |value: &Option<Value>| value.as_ref().is_some_and(is_set);
                if let Some((key, _)) = refused.into_iter().find(|(_, value)| is_set(value)) {
                    return Err((key, why_refused(key).into()));
                }
                let lens = Lens { $($key: self.$key,)* camera_model: self.camera_model.clone() };
                lens.with_fisheye(self.is_fisheye)?.with_distortion_params(self.distortion_params.as_deref())
            }
        }
    };
}

with_keys! { lens! }

with_keys! { with_lens!
    struct DocumentJson {
        frames: Vec<FrameJson>,
        n_frames: Option<u64>,
        depth_unit_scale_factor: Option<f64>,
        integer_depth_scale: Option<f64>,
        enable_depth_loading: Option<bool>,
        applied_transform: Option<Rows>,
        applied_scale: Option<f64>,
        orientation_override: Option<String>,
        vehicle_box: Option<BoxJson>,
        up: Option<[f64; 3]>,
    }
}

with_keys! { with_lens!
    struct FrameJson {
        file_path: String,
        mask_path: Option<String>,
        depth_file_path: Option<String>,
        depth_path: Option<String>,
        transform_matrix: Rows,
    }
}

/// Whether a value enables its key.
fn is_set(value: &Value) -> bool {
    match value {
        Value::Null | Value::Bool(false) => false,
        Value::Number(number) => number.as_f64() != Some(0.0),
        _ => true,
    }
}

fn why_refused(key: &str) -> &'static str {
    match key {
        "transform_matrix_start" | "transform_matrix_end" => {
            "a camera that moves during the exposure is not supported; allowed: transform_matrix alone"
        }
        "white_transparent" | "black_transparent" => {
            "a colour instead of a mask is not supported; allowed: mask_path, a folder masks, or an alpha channel"
        }
        _ => {
            "this lens is not supported; allowed: camera_model with its coefficients. Undistort the pictures first"
        }
    }
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
                let reason = "missing although yaw is given; allowed: x, y, z of the box's centre, metres";
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
    if let Some(n) = document.n_frames.filter(|&n| n < document.frames.len() as u64) {
        let reason =
            format!("{n}, but there are {} frames; allowed: as many, or no key", document.frames.len());
        return Err(Error::format(path, "n_frames", reason));
    }
    let shared = document.lens().map_err(|(key, reason)| Error::format(path, key, reason))?;
    let frames = document.frames.iter().enumerate();
    let frames =
        frames.map(|(i, f)| frame(f, &shared, path, &format!("frames[{i}]"))).collect::<Result<_>>()?;
    let depth_unit = document.depth_unit(path)?;
    let loads_depth = document.enable_depth_loading.unwrap_or(true);
    let moved_by = document.moved_by();
    let vehicle_box = document.vehicle_box.map(|known| known.checked(path)).transpose()?;
    Ok(Transforms { frames, depth_unit, loads_depth, moved_by, vehicle_box })
}

impl DocumentJson {
    /// Metres per number in a depth file: nerfstudio's key or instant-ngp's.
    fn depth_unit(&self, path: &Path) -> Result<Option<f64>> {
        let keys = [
            ("depth_unit_scale_factor", self.depth_unit_scale_factor),
            ("integer_depth_scale", self.integer_depth_scale),
        ];
        for (key, unit) in keys {
            if let Some(unit) = unit.filter(|unit| !(*unit > 0.0 && unit.is_finite())) {
                let reason = format!("{unit}; allowed: metres per unit, above 0");
                return Err(Error::format(path, key, reason));
            }
        }
        match (self.depth_unit_scale_factor, self.integer_depth_scale) {
            (Some(unit), Some(other)) if unit != other => {
                let reason = format!("{other}, but depth_unit_scale_factor is {unit}; allowed: one of them");
                Err(Error::format(path, "integer_depth_scale", reason))
            }
            (unit, other) => Ok(unit.or(other)),
        }
    }

    fn moved_by(&self) -> Option<&'static str> {
        const IDENTITY: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        /// Cosine of the largest angle between the file's up axis and z, about 8 degrees.
        const UPRIGHT: f64 = 0.99;
        let is_up = |up: [f64; 3]| up[2] >= UPRIGHT * up.iter().map(|v| v * v).sum::<f64>().sqrt();
        let keys = [
            ("applied_transform", self.applied_transform.as_ref().is_some_and(|t| t.0 != IDENTITY)),
            ("applied_scale", self.applied_scale.is_some_and(|s| s != 1.0)),
            ("orientation_override", self.orientation_override.as_ref().is_some_and(|how| how != "none")),
            ("up", self.up.is_some_and(|up| !is_up(up))),
        ];
        keys.into_iter().find(|(_, moved)| *moved).map(|(key, _)| key)
    }
}

fn frame(json: &FrameJson, shared: &Lens, path: &Path, field: &str) -> Result<Frame> {
    let file = |key: &str, text: &str| {
        relative_inside(text).map_err(|reason| Error::format(path, format!("{field}.{key}"), reason))
    };
    let optional = |key: &str, text: &Option<String>| match text.as_deref() {
        None | Some("") => Ok(None),
        Some(text) => file(key, text).map(Some),
    };
    let own = json.lens().map_err(|(key, reason)| Error::format(path, format!("{field}.{key}"), reason))?;
    let lens = own.over(shared);
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
                "only one of them is given; allowed: both or none",
            ));
        }
    };
    let depths =
        [optional("depth_file_path", &json.depth_file_path)?, optional("depth_path", &json.depth_path)?];
    let depth_file_path = match depths {
        [Some(depth), Some(other)] if depth != other => {
            let reason = format!("{other:?}, but depth_file_path is {depth:?}; allowed: one of them");
            return Err(Error::format(path, format!("{field}.depth_path"), reason));
        }
        [depth, other] => depth.or(other),
    };
    let pose = pose_from_opengl(&format!("{field}.transform_matrix"), &json.transform_matrix.0);
    let frame = Frame {
        file_path: file("file_path", &json.file_path)?,
        mask_path: optional("mask_path", &json.mask_path)?,
        depth_file_path,
        world_from_camera: pose.map_err(|e| in_file(path, e))?,
        size,
        lens,
    };
    // Check the lens; its validity does not depend on the picture's size.
    frame.camera(frame.size.unwrap_or((1, 1)), path, field)?;
    Ok(frame)
}

impl Frame {
    /// The camera of a picture of this size, with the pose `world_from_camera`; `field` names the frame.
    pub fn camera(&self, (width, height): (u32, u32), path: &Path, field: &str) -> Result<Camera> {
        let lens = &self.lens;
        let (w, h) = (f64::from(width), f64::from(height));
        let from_angle = |size: f64, angle: f64| 0.5 * size / (0.5 * angle).tan();
        let focal = |length: Option<f64>, angle: Option<f64>, degrees: Option<f64>, size: f64| {
            length.or_else(|| angle.or(degrees.map(f64::to_radians)).map(|a| from_angle(size, a)))
        };
        let fx = focal(lens.fl_x, lens.camera_angle_x, lens.x_fov, w);
        let fy = focal(lens.fl_y, lens.camera_angle_y, lens.y_fov, h);
        // Square pixels unless both are given.
        let (Some(fx), Some(fy)) = (fx.or(fy), fy.or(fx)) else {
            return Err(Error::format(
                path,
                format!("{field}.fl_x"),
                "missing; allowed: fl_x (and fl_y), camera_angle_x or x_fov, in the frame or at the top",
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
    /// Applies instant-ngp's switch, which corresponds to a camera model's name in nerfstudio.
    fn with_fisheye(mut self, is_fisheye: Option<bool>) -> std::result::Result<Self, (&'static str, String)> {
        let Some(is_fisheye) = is_fisheye else { return Ok(self) };
        let [fisheye, brown] = [CameraModel::OpenCvFisheye, CameraModel::OpenCv].map(CameraModel::name);
        match self.camera_model.as_deref() {
            None => self.camera_model = Some(if is_fisheye { fisheye } else { brown }.to_owned()),
            Some(name) if (name == fisheye) == is_fisheye => {}
            Some(name) => {
                let reason = format!("{is_fisheye}, but camera_model is {name:?}; allowed: one of them");
                return Err(("is_fisheye", reason));
            }
        }
        Ok(self)
    }

    /// Applies nerfstudio's list of all coefficients.
    fn with_distortion_params(
        mut self,
        params: Option<&[f64]>,
    ) -> std::result::Result<Self, (&'static str, String)> {
        let Some(params) = params else { return Ok(self) };
        let key = "distortion_params";
        let &[k1, k2, k3, k4, p1, p2] = params else {
            return Err((key, format!("{} numbers; allowed: six, k1 k2 k3 k4 p1 p2", params.len())));
        };
        let single = [self.k1, self.k2, self.k3, self.k4, self.k5, self.k6, self.p1, self.p2];
        if single.iter().any(Option::is_some) {
            return Err((
                key,
                "given together with k1 or others; allowed: the list or the single coefficients".into(),
            ));
        }
        [self.k1, self.k2, self.k3, self.k4] = [k1, k2, k3, k4].map(Some);
        [self.p1, self.p2] = [p1, p2].map(Some);
        Ok(self)
    }

    /// A frame's own keys, completed by the shared ones. Its own focal length, in any form, replaces the shared one.
    fn over(self, shared: &Self) -> Self {
        let mut shared = shared.clone();
        if self.fl_x.or(self.camera_angle_x).or(self.x_fov).is_some() {
            [shared.fl_x, shared.camera_angle_x, shared.x_fov] = [None; 3];
        }
        if self.fl_y.or(self.camera_angle_y).or(self.y_fov).is_some() {
            [shared.fl_y, shared.camera_angle_y, shared.y_fov] = [None; 3];
        }
        self.or(shared)
    }

    /// Distortion of the lens: nerfstudio's k1, k2, k3, p1, p2 are Brown's; with OPENCV_FISHEYE k1 to k4 are the
    /// fisheye's.
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
    fn a_frame_s_own_focal_length_wins_in_any_form() {
        let c = camera(r#""fl_x": 100, "fl_y": 101,"#, r#""camera_angle_x": 1.5707963267948966,"#);
        assert!((c.intrinsics.fx - 200.0).abs() < 1e-12 && c.intrinsics.fy == 101.0);
        let c = camera(r#""camera_angle_x": 1,"#, r#""x_fov": 90, "y_fov": 90,"#);
        assert!((c.intrinsics.fx - 200.0).abs() < 1e-12 && (c.intrinsics.fy - 150.0).abs() < 1e-12);
    }

    #[test]
    fn all_notations_of_a_fisheye_and_its_coefficients_give_the_same_camera() {
        let fisheye = Distortion::Fisheye { k: [0.1, 0.2, 0.3, 0.4] };
        let single = r#""fl_x": 9, "k1": 0.1, "k2": 0.2, "k3": 0.3, "k4": 0.4,"#;
        let list = r#""distortion_params": [0.1, 0.2, 0.3, 0.4, 0, 0],"#;
        let model = r#""camera_model": "OPENCV_FISHEYE","#;
        for (top, frame) in [
            (format!("{single}{model}"), String::new()),
            (format!(r#"{single}"is_fisheye": true,"#), String::new()),
            (format!(r#"{single}{model}"is_fisheye": true,"#), String::new()),
            (r#""is_fisheye": true, "fl_x": 9,"#.into(), list.into()),
            (format!(r#"{list}"fl_x": 9, "is_fisheye": false,"#), r#""is_fisheye": true,"#.into()),
        ] {
            assert_eq!(camera(&top, &frame).distortion, fisheye, "{top} {frame}");
        }
        let brown = Distortion::Brown { k: [0.1, 0.2, 0.3, 0.0, 0.0, 0.0], p: [0.5, 0.6] };
        let list = r#""distortion_params": [0.1, 0.2, 0.3, 0, 0.5, 0.6], "fl_x": 9,"#;
        assert_eq!(camera(list, "").distortion, brown);
    }

    #[test]
    fn unsupported_keys_are_refused_by_name() {
        for (top, frame, field) in [
            (r#""is_fisheye": true, "camera_model": "OPENCV","#, "", "transforms.json: is_fisheye"),
            (r#""is_fisheye": false, "camera_model": "OPENCV_FISHEYE","#, "", "transforms.json: is_fisheye"),
            ("", r#""distortion_params": [0.1, 0.2, 0, 0],"#, "frames[0].distortion_params: 4 numbers"),
            (
                r#""distortion_params": [0,0,0,0,0,0], "k1": 0,"#,
                "",
                "transforms.json: distortion_params: given together",
            ),
            (r#""ftheta_p0": 1.5,"#, "", "transforms.json: ftheta_p0"),
            ("", r#""equirectangular": true,"#, "frames[0].equirectangular"),
            ("", r#""transform_matrix_end": [[1,0,0,0]],"#, "frames[0].transform_matrix_end"),
            (r#""white_transparent": true,"#, "", "transforms.json: white_transparent"),
            (r#""integer_depth_scale": 0,"#, "", "transforms.json: integer_depth_scale"),
            (r#""integer_depth_scale": 1, "depth_unit_scale_factor": 2,"#, "", "integer_depth_scale: 1, but"),
            ("", r#""depth_path": "a.png", "depth_file_path": "b.png","#, "frames[0].depth_path"),
            (r#""n_frames": 0,"#, "", "transforms.json: n_frames: 0, but there are 1"),
        ] {
            let error = one(&format!(r#""fl_x": 9, {top}"#), frame).unwrap_err().to_string();
            assert!(error.contains(field), "{top} {frame}: {error}");
        }
        let neutral = r#""aabb_scale": 16, "scale": 0.3, "offset": [1, 2, 3], "white_transparent": false, "n_frames": 1, "latlong": null, "fl_x": 9,"#;
        one(neutral, r#""sharpness": 12.5,"#).unwrap();
    }

    #[test]
    fn instant_ngp_s_depth_keys_are_supported() {
        let file = one(r#""fl_x": 1, "integer_depth_scale": 0.01,"#, r#""depth_path": "d\\a.png","#).unwrap();
        assert_eq!((file.depth_unit, file.loads_depth), (Some(0.01), true));
        assert_eq!(file.frames[0].depth_file_path.as_deref(), Some(Path::new("d/a.png")));
        assert!(!one(r#""fl_x": 1, "enable_depth_loading": false,"#, "").unwrap().loads_depth);
    }

    #[test]
    fn an_applied_transform_is_reported_and_an_identity_is_not() {
        let moved = |t: &str| one(&format!(r#""fl_x": 1, "applied_transform": {t},"#), "").unwrap().moved_by;
        assert_eq!(moved("[[1,0,0,0],[0,1,0,0],[0,0,1,0]]"), None);
        assert_eq!(moved("[[0,1,0,0],[1,0,0,0],[0,0,-1,0]]"), Some("applied_transform"));
        assert_eq!(one(r#""fl_x": 1, "applied_scale": 2,"#, "").unwrap().moved_by, Some("applied_scale"));
        let by = |key: &str| one(&format!(r#""fl_x": 1, {key},"#), "").unwrap().moved_by;
        assert_eq!(by(r#""orientation_override": "up""#), Some("orientation_override"));
        assert_eq!(by(r#""orientation_override": "none""#), None);
        assert_eq!(by(r#""up": [0, 1, 0]"#), Some("up"));
        assert_eq!(by(r#""up": [0, 0, 2]"#), None);
    }
}
