//! Makes procedural vehicles and the training data of the shape network: the hull that a few noisy silhouettes carve,
//! and the vehicle's true signed distance, on the network's lattice.

mod cameras;
mod grid;
mod noise;
mod preview;
mod scene;
mod solid;
mod vehicle;

use clap::{Parser, Subcommand};
use grid::Grid;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;
use vg::prior::shape::lattice::{HULL_CLAMP_M, Lattice, NODES, hull_on, view_numbers};
use vg::prior::volume::{KnownBox, Silhouette, find_box};

/// Distances are clamped to this in the training data, metres.
const DISTANCE_CLAMP_M: f32 = 0.25;

/// Scenes per vehicle: shapes cost more than views.
const SCENES_PER_VEHICLE: usize = 3;

#[derive(Parser)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Write training data: one record of int8 hull, int8 distance, float32 numbers and the class per scene
    Data {
        #[arg(long)]
        vehicles: usize,
        #[arg(long, default_value_t = 1)]
        seed: u64,
        #[arg(short, long)]
        output: PathBuf,
    },
    /// Draw some vehicles of every class as a picture
    Preview {
        #[arg(long, default_value_t = 1)]
        seed: u64,
        #[arg(short, long)]
        output: PathBuf,
    },
}

fn main() -> std::io::Result<()> {
    match Cli::parse().command {
        Command::Data { vehicles, seed, output } => data(vehicles, seed, &output),
        Command::Preview { seed, output } => preview::draw(seed, &output),
    }
}

/// Each vehicle has its own random sequence: the data do not depend on the number of threads.
pub fn random(seed: u64, vehicle: usize) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ vehicle as u64)
}

fn data(vehicles: usize, seed: u64, output: &Path) -> std::io::Result<()> {
    const AT_ONCE: usize = 64;
    let start = Instant::now();
    let mut file = BufWriter::new(File::create(output)?);
    let mut scenes = 0;
    for first in (0..vehicles).step_by(AT_ONCE) {
        let records: Vec<Vec<Vec<u8>>> =
            (first..(first + AT_ONCE).min(vehicles)).into_par_iter().map(|i| records(seed, i)).collect();
        for record in records.iter().flatten() {
            file.write_all(record)?;
            scenes += 1;
        }
        let minutes = start.elapsed().as_secs_f64() / 60.0;
        eprint!(
            "\r{} vehicles, {scenes} scenes, {:.0} a minute",
            first + AT_ONCE,
            f64::from(scenes) / minutes
        );
    }
    eprintln!();
    file.flush()
}

/// The scenes of one vehicle.
fn records(seed: u64, index: usize) -> Vec<Vec<u8>> {
    let mut rng = random(seed, index);
    let vehicle = vehicle::draw(&mut rng);
    let grid = Grid::from_vehicle(&vehicle, 0.035);
    (0..SCENES_PER_VEHICLE).filter_map(|_| record(&vehicle, &grid, &mut rng)).collect()
}

fn record(vehicle: &vehicle::Vehicle, grid: &Grid, rng: &mut impl Rng) -> Option<Vec<u8>> {
    let views = scene::draw(grid, rng)?;
    let silhouettes: Vec<Silhouette> = views.iter().map(Silhouette::new).collect();
    // Some callers know the size.
    let known = rng.random_bool(0.12).then(|| {
        let size = (grid.high_inside - grid.low_inside).as_dvec3();
        KnownBox { size: [size.x, 2.0 * size.y, size.z], center: None }
    });
    let vehicle_box = find_box(known.as_ref(), &views, &silhouettes).ok()?;
    let lattice = Lattice::around(&vehicle_box);
    let hull = hull_on(&lattice, &silhouettes);
    let [nx, ny, nz] = NODES;
    let byte = |value: f32, clamp: f32| ((value / clamp).clamp(-1.0, 1.0) * 127.0).round() as i8 as u8;
    let mut record = Vec::with_capacity(2 * hull.len() + 64);
    record.extend(hull.iter().map(|v| byte(*v, HULL_CLAMP_M)));
    for row in 0..ny * nz {
        for i in 0..nx {
            let p = lattice.node(i, row / nz, row % nz);
            record.push(byte(grid.distance(p), DISTANCE_CLAMP_M));
        }
    }
    for number in view_numbers(&vehicle_box, &views) {
        record.extend(number.to_le_bytes());
    }
    record.extend((vehicle.class as u32).to_le_bytes());
    Some(record)
}
