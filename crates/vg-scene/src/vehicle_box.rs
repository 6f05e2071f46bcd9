//! The vehicle's box as a tracker, an annotator or a data sheet tells it: its size, and where it stands.

use glam::{DMat3, DVec3};
use vg_geometry::{Error, Result};
use vg_geometry::{Pose, Similarity};

/// Sides of road vehicles and of their models, metres.
const SIDE_M: std::ops::RangeInclusive<f64> = 0.1..=30.0;

/// Size and place of a vehicle's box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleBox {
    /// Length, width, height, metres.
    pub size: [f64; 3],
    /// Where it stands; `None` where only the size is known.
    pub place: Option<Place>,
}

/// Where a box stands in the frame of the cameras, level.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Place {
    /// Its centre, metres.
    pub center: [f64; 3],
    /// From the frame's x axis to the vehicle's, about z, anticlockwise from above, radians.
    pub yaw: f64,
}

impl VehicleBox {
    /// Sides of a road vehicle, a finite centre, a yaw of at most one turn. `argument` names the box in the error.
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
    /// [`Error::Argument`] where a box that stood level would lean.
    pub fn moved(&self, argument: &str, to_from: &Similarity) -> Result<Self> {
        /// A box leans by less than this if it is to count as level: 2 degrees.
        const LEVEL: f64 = 6e-4;
        let size = self.size.map(|side| side * to_from.scale);
        let Some(place) = self.place else { return Ok(Self { size, place: None }) };
        let up = to_from.rotation.z_axis;
        if up.z < 1.0 - LEVEL {
            let found = format!("a box whose upright axis becomes {:.3}, {:.3}, {:.3}", up.x, up.y, up.z);
            let allowed = "a box in a frame whose z axis is up, as in the frame that it is moved to";
            return Err(Error::argument(argument, found, allowed));
        }
        let forward = to_from.rotation * DVec3::new(place.yaw.cos(), place.yaw.sin(), 0.0);
        let center = to_from.transform_point(DVec3::from_array(place.center)).to_array();
        Ok(Self { size, place: Some(Place { center, yaw: forward.y.atan2(forward.x) }) })
    }
}

/// The options spell size and place as two fields of their own.
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

    /// Whether the box's plane of symmetry is y = 0, up to what no photograph tells: 0.1 mm, a millionth of a radian.
    pub fn is_on_the_plane(&self) -> bool {
        self.center[1].abs() < 1e-4 && self.yaw.abs() < 1e-6
    }

    /// Takes points of the box's own frame, x forward, y left, z up about its centre, to the frame of the cameras.
    pub fn vehicle_from_box(&self) -> Pose {
        Pose { rotation: DMat3::from_rotation_z(self.yaw), translation: DVec3::from_array(self.center) }
    }
}
