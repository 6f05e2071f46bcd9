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
    /// Scanned point cloud in the vehicle's frame, metres; without a file name, the scan of a 3DRealCar folder
    #[arg(long, value_name = "CLOUD.ply", num_args = 0..=1)]
    scan: Option<Option<PathBuf>>,
    /// Camera centres in the vehicle's frame, metres: {"000.jpg": [x, y, z], ...}, at least three; outliers are left
    /// out and reported
    #[arg(long, alias = "cameras", value_name = "CENTERS.json")]
    known_centers: Option<PathBuf>,
    /// Length, width and height of the vehicle in metres; the scene needs masks and sparse points on level ground
    #[arg(long = "box", value_name = "L,W,H", value_parser = vehicle_size)]
    size: Option<VehicleSize>,
    /// The similarity itself, which is checked: 16 numbers, row-major, as text or JSON
    #[arg(long, value_name = "FILE")]
    matrix: Option<PathBuf>,
    /// With --scan and --box: whether the first view by name that is not seen square from the side was taken from ahead
    /// of the vehicle's centre (forward) or from behind it (backward); auto: decided by the scan's shape
    #[arg(long, value_name = "auto|forward|backward", default_value = "auto", value_parser = choice::<Heading>(), conflicts_with_all = ["known_centers", "matrix"], hide_default_value = true, hide_possible_values = true)]
    pub(crate) heading: Heading,
    /// Worker threads; 0 means one per core
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
    /// Output file of the similarity, for --vehicle-from-world
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
}

/// Input from which the vehicle's frame is found.
pub(crate) enum Mode<'a> {
    /// A scan; `None` means the scan in the scene's folder.
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
            // The parser accepts exactly one of the four.
            _ => Mode::Scan(self.scan.as_ref().and_then(|scan| scan.as_deref())),
        }
    }
}
