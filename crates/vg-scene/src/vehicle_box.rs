//! The vehicle's box from a tracker, an annotator or a data sheet: its size and place.

use glam::{DMat3, DVec3};
use vg_geometry::{Error, Pose, Result, Similarity};

/// Allowed sides of road vehicles and of scale models, metres.
const SIDE_M: std::ops::RangeInclusive<f64> = 0.1..=30.0;

/// Size and place of a vehicle's box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleBox {
    /// Length, width, height, metres.
    pub size: [f64; 3],
    /// Place of the box; `None` if only the size is known.
    pub place: Option<Place>,
}

/// Place of a level box in the frame of the cameras.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Place {
    /// Centre of the box, metres.
    pub center: [f64; 3],
    /// Angle from the frame's x axis to the vehicle's, about z, anticlockwise from above, radians.
    pub yaw: f64,
}

impl VehicleBox {
    /// Checks that the sides are those of a road vehicle, the centre is finite, and the yaw is at most one turn.
    /// `argument` names the box in the error.
    pub fn validate(&self, argument: &str) -> Result<()> {
        if !self.size.iter().all(|side| SIDE_M.contains(side)) {
            return Err(Error::argument(
                size_name(argument),
                format!("{:?}", self.size),
                "length, width, height, each 0.1 to 30 m",
            ));
        }
        self.place.map_or(Ok(()), |place| place.validate(argument))
    }

    /// The box in another frame. `argument` names the box in the error.
    ///
    /// # Errors
    /// [`Error::Argument`] if the box would not be level in the other frame.
    pub fn moved(&self, argument: &str, to_from: &Similarity) -> Result<Self> {
        /// 1 - cosine of the largest tilt of a level box, 2 degrees.
        const LEVEL: f64 = 6e-4;
        let size = self.size.map(|side| side * to_from.scale);
        let Some(place) = self.place else { return Ok(Self { size, place: None }) };
        let up = to_from.rotation.z_axis;
        if up.z < 1.0 - LEVEL {
            let found = format!("a box whose up axis becomes {:.3}, {:.3}, {:.3}", up.x, up.y, up.z);
            let allowed = "a box in a frame whose z axis points up, as in the frame that it is moved to";
            return Err(Error::argument(argument, found, allowed));
        }
        let forward = to_from.rotation * DVec3::new(place.yaw.cos(), place.yaw.sin(), 0.0);
        let center = to_from.transform_point(DVec3::from_array(place.center)).to_array();
        Ok(Self { size, place: Some(Place { center, yaw: forward.y.atan2(forward.x) }) })
    }
}

/// Name of the size in errors: the options have separate fields for size and place.
fn size_name(argument: &str) -> String {
    if argument == "options" { "options.vehicle_size".into() } else { format!("{argument}.size") }
}

impl Place {
    fn validate(&self, argument: &str) -> Result<()> {
        let prefix = if argument == "options" { "options.vehicle_place".into() } else { argument.to_owned() };
        if !self.center.iter().all(|c| c.is_finite()) {
            let found = format!("{:?}", self.center);
            return Err(Error::argument(format!("{prefix}.center"), found, "finite numbers, metres"));
        }
        const TURN: f64 = std::f64::consts::TAU;
        if !(-TURN..=TURN).contains(&self.yaw) {
            let allowed = "-2 pi to 2 pi, in radians";
            return Err(Error::argument(format!("{prefix}.yaw"), self.yaw.to_string(), allowed));
        }
        Ok(())
    }

    /// Whether the box's plane of symmetry is y = 0, to 0.1 mm and a millionth of a radian, which no photograph
    /// resolves.
    pub fn is_on_the_plane(&self) -> bool {
        self.center[1].abs() < 1e-4 && self.yaw.abs() < 1e-6
    }

    /// Pose of the box's own frame (x forward, y left, z up, origin at its centre) in the frame of the cameras.
    pub fn vehicle_from_box(&self) -> Pose {
        Pose { rotation: DMat3::from_rotation_z(self.yaw), translation: DVec3::from_array(self.center) }
    }
}
