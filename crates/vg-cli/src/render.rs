//! `vg render`: renders a model from a scene's cameras, or from all around.

use crate::args::RenderArgs;
use crate::guard::{self, Inputs};
use crate::job::{self, Failure, Outcome, Result};
use crate::shown::{self, Bar};
use crate::{files, info, scene};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use vg::geometry::Turntable;
use vg::io::{self, NamedCamera, image, splats};
use vg::progress::Threads;
use vg::render::{AssetRenderer, Background, RenderOptions, Rendered, Rgba8};
use vg::{Camera, Gaussians};

/// Reads the model and renders it from every camera.
pub(crate) fn run(args: &RenderArgs) -> Result {
    let (gaussians, _) = splats::read(files::input(&args.asset))?;
    info::linear_numbers(&gaussians).iter().for_each(|sign| job::note(sign));
    let mut inputs = Inputs::default().files([&args.asset]).files(&args.frame.vehicle_from_world);
    let cameras = match (&args.cameras, args.turntable) {
        (Some(path), _) => {
            // Only the cameras are read: neither pictures nor depth need exist.
            let options = scene::options(&args.frame, None, true)?;
            let index = io::list_scene(path, &scene::named(args.views.names().as_deref(), &options))?;
            inputs = inputs.files(&scene::view_files(&index)).scene(path);
            index.notes.iter().for_each(|note| job::note(note));
            index.cameras()
        }
        (None, n) => turntable(&gaussians, n.unwrap_or(1), args.size)?,
    };
    let names = picture_names(cameras.iter().map(|c| c.name.as_str()));
    let pictures: Vec<PathBuf> = names.iter().map(|name| args.output.join(name)).collect();
    let depths: Vec<PathBuf> = match args.depth {
        true => names.iter().map(|name| args.output.join("depth").join(name)).collect(),
        false => Vec::new(),
    };
    let outputs = [pictures.as_slice(), &depths].concat();
    guard::refuse_clashes(&outputs, &inputs)?;
    files::prepare_folder(&args.output)?;
    let folders: BTreeSet<&Path> = outputs.iter().filter_map(|output| output.parent()).collect();
    folders.into_iter().try_for_each(files::prepare_folder)?;

    let options = RenderOptions { background: args.background, ..RenderOptions::default() };
    let threads = Threads::new(args.threads)?;
    let ready = threads.run(|| AssetRenderer::new(Arc::new(gaussians), args.backend))?;
    let bar = Bar::for_pictures(cameras.len());
    let seen: Vec<Camera> = cameras.iter().map(|named| named.camera).collect();
    if args.depth {
        let each = |i: usize, drawn: &Rendered| {
            write(&pictures[i], drawn, options.background)?;
            let beyond = image::write_depth16(&depths[i], drawn.width, drawn.height, &drawn.depth)?;
            if beyond > 0 {
                let path = depths[i].display();
                job::note(&format!("{path}: pixels farther than 65.535 m, written as 0: {beyond}"));
            }
            bar.advance();
            Ok(())
        };
        threads.run(|| ready.render_each(&seen, &options, &mut Rendered::default(), each))?;
    } else {
        // Encoding takes longer than rendering, so pictures are encoded in parallel, one per thread.
        let mut waiting = Vec::new();
        let each = |i: usize, drawn: &Rgba8| {
            waiting.push((i, drawn.pixels.clone()));
            if i + 1 < seen.len() && waiting.len() < rayon::current_num_threads() {
                return Ok(());
            }
            let write = |(i, pixels): (usize, Vec<_>)| {
                write_bytes(&pictures[i], &seen[i], &pixels, options.background)?;
                bar.advance();
                Ok(())
            };
            // The error of the first picture in order, whichever occurred first.
            let written: Vec<vg::Result<()>> = waiting.par_drain(..).map(write).collect();
            written.into_iter().collect()
        };
        threads.run(|| ready.render_each(&seen, &options, &mut Rgba8::default(), each))?;
    }
    drop(bar);
    let (folder, pictures) = (shown::path(&args.output), shown::counted(cameras.len(), "picture"));
    Ok(Outcome::done(format!("{folder}: {pictures} by {}", ready.choice())))
}

/// As [`write`], for a picture of 8 bits per channel.
fn write_bytes(path: &Path, camera: &Camera, rgba: &[[u8; 4]], background: Background) -> vg::Result<()> {
    match background {
        Background::Color(_) => {
            let rgb: Vec<[u8; 3]> = rgba.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
            image::write_rgb8(path, camera.width, camera.height, &rgb)
        }
        Background::Transparent => image::write_rgba8(path, camera.width, camera.height, rgba),
    }
}

/// Writes an opaque picture, or one with alpha for a transparent background.
pub(crate) fn write(path: &Path, drawn: &Rendered, background: Background) -> vg::Result<()> {
    match background {
        Background::Color(_) => image::write_rgb8(path, drawn.width, drawn.height, &drawn.to_rgb8()),
        Background::Transparent => image::write_rgba8(path, drawn.width, drawn.height, &drawn.to_rgba8()),
    }
}

/// `<image stem>.png` for each picture's name; if two were equal, all with the folders of their names; if two were
/// still equal, also with their extensions.
pub(crate) fn picture_names<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<PathBuf> {
    let names: Vec<&str> = names.into_iter().collect();
    let png = |path: &Path| {
        let mut longer = path.as_os_str().to_owned();
        longer.push(".png");
        PathBuf::from(longer)
    };
    let stem = |name: &str| Path::new(name).with_extension("");
    let file_name = |path: PathBuf| path.file_name().map(PathBuf::from).unwrap_or(path);
    let ways: [&dyn Fn(&str) -> PathBuf; 3] =
        [&|name| png(&file_name(stem(name))), &|name| png(&stem(name)), &|name| png(Path::new(name))];
    let named =
        |way: &dyn Fn(&str) -> PathBuf| -> Vec<PathBuf> { names.iter().map(|name| way(name)).collect() };
    let are_distinct = |paths: &[PathBuf]| paths.iter().collect::<BTreeSet<_>>().len() == paths.len();
    let all = ways.map(named);
    let [short, ..] = &all;
    all.iter().find(|paths| are_distinct(paths)).unwrap_or(short).clone()
}

/// `n` cameras on a circle around the centre of the model, named by their numbers.
pub(crate) fn turntable(
    gaussians: &Gaussians,
    n: u32,
    (width, height): (u32, u32),
) -> Result<Vec<NamedCamera>> {
    let (low, high) =
        gaussians.bounds().ok_or_else(|| Failure::job("the model has no Gaussians to render"))?;
    let cameras = Turntable::default().cameras(low, high, n as usize, width, height)?;
    let digits = (n - 1).to_string().len().max(3);
    let named = |(i, camera)| NamedCamera { name: format!("{i:0digits$}.png"), camera };
    Ok(cameras.into_iter().enumerate().map(named).collect())
}
