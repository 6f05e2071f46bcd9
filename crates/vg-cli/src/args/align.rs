//! Options of `align`.

use super::values::{VehicleSize, choice, vehicle_size};
use clap::Args;
use std::path::{Path, PathBuf};
use vg::align::Heading;

#[derive(Args)]
#[command(group(clap::ArgGroup::new("mode").required(true).args(["scan", "known_centers", "size", "matrix"])))]
pub(crate) struct AlignArgs {
    /// The scene, usually a COLMAP folder
    pub(crate) scene: PathBuf,
    /// A scanned point cloud of the vehicle in its frame, metres; without a name, the one that a 3DRealCar folder holds
    #[arg(long, value_name = "CLOUD.ply", num_args = 0..=1)]
    scan: Option<Option<PathBuf>>,
    /// Camera centres in the vehicle's frame, metres: {"000.jpg": [x, y, z], ...}, at least three; wrong ones are left
    /// out and named
    #[arg(long, alias = "cameras", value_name = "CENTERS.json")]
    known_centers: Option<PathBuf>,
    /// The vehicle's length, width and height in metres; the scene must have masks, and sparse points of a level ground
    #[arg(long = "box", value_name = "L,W,H", value_parser = vehicle_size)]
    size: Option<VehicleSize>,
    /// The similarity itself, to be checked: 16 numbers, row-major, as text or JSON
    #[arg(long, value_name = "FILE")]
    matrix: Option<PathBuf>,
    /// With --scan and --box: whether the first view by name, of those not taken from abeam, was taken from ahead of
    /// the vehicle's middle (forward) or from behind it (backward); auto: by the scan's shape
    #[arg(long, value_name = "auto|forward|backward", default_value = "auto", value_parser = choice::<Heading>(), conflicts_with_all = ["known_centers", "matrix"], hide_default_value = true, hide_possible_values = true)]
    pub(crate) heading: Heading,
    /// Worker threads; 0 means one per core
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
    /// The similarity, for --vehicle-from-world
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
}

/// What the vehicle's frame is found from.
pub(crate) enum Mode<'a> {
    /// A scan; `None` means the one of the scene's folder.
    Scan(Option<&'a Path>),
    Centers(&'a Path),
    Box([f64; 3]),
    Matrix(&'a Path),
}

impl AlignArgs {
    pub(crate) fn mode(&self) -> Mode<'_> {
        match (&self.known_centers, self.size, &self.matrix) {
            (Some(centers), ..) => Mode::Centers(centers),
            (_, Some(size), _) => Mode::Box(size.0),
            (.., Some(matrix)) => Mode::Matrix(matrix),
            // The parser lets exactly one through.
            _ => Mode::Scan(self.scan.as_ref().and_then(|scan| scan.as_deref())),
        }
    }
}
