//! The run: plan -> undistort -> calibrate -> prior -> pixels -> head -> symmetry -> check.

use super::budget::{self, BudgetPlan};
use super::check::checked;
use super::options::{Calibrate, Options, PriorChoice};
use super::pixels::{self, BETTER};
use super::report::{Clock, InputError, LeftOut, Report, peak_rss_bytes};
use super::size::VehicleSize;
use super::spread::spread;
use super::verdict::{self, Examined, Judged};
use super::{baseline, cap, cost, guard, measured, outline, plan};
use crate::calibrate::{self, Calibrated, Moved};
use crate::head::surfel::FOOTPRINT_SIGMA_PX;
use crate::head::{GaussianHead, NetworkHead, SurfelHead};
use crate::prior::volume::KnownBox;
use crate::prior::{DepthPrior, Geometry, GivenDepth, HullPrior, NetworkPrior, ShapePrior, WorkingBox};
use crate::refine::{self, tie::Clone as Tied};
use crate::relight::{Light, Relight, Relighting};
use crate::symmetry::{self, Completion, MirroredPlace, SymmetryMode};
use glam::{Quat, Vec3};
use rayon::prelude::*;
use vg_geometry::frame::pose_from_box;
use vg_geometry::progress::{Context, ProgressCallback, Threads};
use vg_geometry::{Camera, MIRROR_Y, Similarity};
use vg_geometry::{Error, Result};
use vg_scene::visibility::{Observer, SURFACE_M, Sight};
use vg_scene::{Cloud, Place, Scene, View, mirror, resize, undistort};
use vg_splat::Gaussians;

/// A finished reconstruction.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// The vehicle.
    pub gaussians: Gaussians,
    /// The metric coloured point cloud (paper eq. for P), if asked for: positions in metres and 8-bit colours.
    pub points: Option<PointCloud>,
    /// What was done.
    pub report: Report,
}

/// Points in the vehicle frame with their colours.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PointCloud {
    /// Metres. `[n][3]`
    pub positions: Vec<[f32; 3]>,
    /// sRGB. `[n][3]`
    pub colors: Vec<[u8; 3]>,
}

impl PointCloud {
    fn transformed(mut self, to_from: &Similarity) -> Self {
        for p in &mut self.positions {
            *p = to_from.transform_point(Vec3::from_array(*p).as_dvec3()).as_vec3().to_array();
        }
        self
    }
}

/// Reconstructs the vehicle of `scene`. `progress` is called on this thread at every stage boundary and inside
/// the long stages; if it breaks, the call returns [`Error::Cancelled`].
pub fn reconstruct<'a>(
    scene: &Scene,
    options: &Options,
    progress: &'a mut ProgressCallback<'a>,
) -> Result<Reconstruction> {
    reconstruct_on(&Threads::new(options.threads)?, scene, options, progress)
}

/// The same on threads that are there already; `options.threads` is not looked at.
pub fn reconstruct_on<'a>(
    threads: &'a Threads,
    scene: &Scene,
    options: &Options,
    progress: &'a mut ProgressCallback<'a>,
) -> Result<Reconstruction> {
    threads.check_process()?;
    options.validate()?;
    scene.validate()?;
    let context = Context::new(threads, progress);
    let mut clock = Clock::start();
    if let Some(how) = &options.baseline {
        return baseline::reconstruct(scene, options, how, clock, &context);
    }

    context.report("plan", 0.0)?;
    let mut left_out = Vec::new();
    let mut warnings = Vec::new();
    let asked = options.prior;
    let (options, budget) = budget::resolved(scene, options, &context, || clock.elapsed(), &mut left_out);
    let options = &options;
    context.follow(cost::course(&budget::load(scene), options, context.threads()));
    let used = plan::views(scene, &options.keep, &mut left_out)?;
    let used = chosen_views(scene, used, options, &mut left_out);
    let source = plan::prior(options.prior, used.iter().all(|&i| scene.views[i].depth.is_some()));
    let scene = &outline::masked(scene, &used, source, &mut left_out)?;
    clock.lap("plan");

    context.report("undistort", 0.0)?;
    let given = cap::fitted(scene, &used, options, &mut left_out, &context)?;
    let known_box = options.vehicle_box(scene);
    // A box that stands beside y = 0 brings its own plane of symmetry along.
    let beside = known_box.and_then(|known| known.place).filter(|place| !place.is_on_the_plane());
    let (views, vehicle_from_box) = match beside {
        Some(place) => (in_frame_of_box(given.clone(), &place), Some(place.vehicle_from_box())),
        None => (given.clone(), None),
    };
    clock.lap("undistort");

    context.report("calibrate", 0.0)?;
    let Calibrated { moved, report: calibration, left_out: why } = match options.calibrate {
        Calibrate::Auto => calibrate::calibrate(&views, &context)?,
        Calibrate::Off => Calibrated::default(),
    };
    plan::note(&mut left_out, "calibration", why.unwrap_or_default(), usize::from(why.is_some()));
    let moved = match vehicle_from_box {
        Some(vehicle_from_box) => Some(Moved::out_of_box(moved, &views, &vehicle_from_box)),
        None => moved,
    };
    // From here to the symmetry all is in the frame whose y = 0 is the plane that was found.
    let seen = moved.as_ref().map_or(views, |moved| moved.views.clone());
    let views = match options.symmetry {
        SymmetryMode::Flip => seen.iter().cloned().chain(seen.iter().map(mirror::mirrored)).collect(),
        _ => seen.clone(),
    };
    clock.lap("calibrate");

    context.report("prior", 0.0)?;
    let cloud = scene.cloud.as_ref().map(|cloud| match &moved {
        Some(moved) => cloud.in_frame(&moved.vehicle_from_corrected),
        None => cloud.clone(),
    });
    let with_depth = seen.iter().filter(|v| v.depth.is_some()).count();
    let cloud = match asked {
        PriorChoice::Auto if (1..seen.len()).contains(&with_depth) => {
            warnings.push(format!(
                "depth: {} of {} views have none: the depth of the others counts as measured points, to which the \
                 prior {} bends; prior given needs it for every view",
                seen.len() - with_depth,
                seen.len(),
                source.name()
            ));
            measured::points(&seen, cloud)?
        }
        _ => cloud,
    };
    let points_given = cloud.as_ref().map(|cloud| cloud.points().len());
    let placed = known_box.map(|known| KnownBox::in_working_frame(&known, beside.is_some()));
    let prior = chosen_prior(source, cloud, placed, options)?;
    let mut geometry = prior.estimate(&views, &context)?;
    let doubts = match source {
        PriorChoice::Given | PriorChoice::Onnx if !options.keep.floaters => {
            context.parallel(|| guard::doubtful(&views, &mut geometry.depths))
        }
        _ => Vec::new(),
    };
    geometry.find_normals(&views, &context);
    plan::note_size(&mut left_out, known_box.is_some(), &geometry);
    warnings.extend(geometry.working_box.as_ref().and_then(WorkingBox::warning));
    if let Some(count) = points_given {
        plan::note_cloud(&mut left_out, count, geometry.points);
    }
    clock.lap("prior");

    context.report("pixels", 0.0)?;
    let kept = context.parallel(|| pixels::kept(&views, &geometry, &doubts, &options.keep, &mut left_out));
    let points = options.points.then(|| point_cloud(&seen, &geometry));
    clock.lap("pixels");

    context.report("head", 0.0)?;
    let degree = plan::sh_degree(&views, &geometry, options, &mut left_out);
    let head: Box<dyn GaussianHead> = match &options.head_model {
        Some(model) => {
            let head = NetworkHead::new(model.clone(), degree)?;
            Box::new(if options.ignore_offset { head.without_offset() } else { head })
        }
        None => Box::new(SurfelHead::new(degree)),
    };
    let gaussians = head.predict(&views, &geometry, &kept, &context)?;
    if gaussians.is_empty() {
        return Err(Error::Reconstruction { stage: "head", reason: plan::nothing_kept(&left_out) });
    }
    clock.lap("head");

    context.report("symmetry", 0.0)?;
    let Completed { gaussians, completion, mirrored, relight } =
        context.parallel(|| complete(gaussians, options, &views, &geometry));
    plan::note(&mut left_out, "clones", "the mirrored place was observed by a view", completion.not_needed);
    clock.lap("symmetry");

    let (gaussians, refinement) = match &options.refine {
        Some(how) => {
            let (refined, done) = refine::refine(gaussians, &mirrored.tied(), &views, how, &context)?;
            (refined, Some(done))
        }
        None => (gaussians, None),
    };
    clock.lap("refine");
    let vehicle = VehicleSize::measured(&gaussians, &geometry);

    let originals: Vec<&View> = used.iter().map(|&i| &scene.views[i]).collect();
    let examined = Examined { given: &originals, used: &seen, geometry: Some(&geometry) };
    let evidence = match options.check {
        true => verdict::compare(&examined, &context),
        false => verdict::glance(&examined),
    };
    let (gaussians, points, views) = match &moved {
        Some(moved) => back_in_vehicle(&gaussians, points, moved, &context)?,
        None => (gaussians, points, seen),
    };
    let evidence = evidence.with_model(&gaussians, &views);
    let input_views = match options.check {
        true => checked(&gaussians, &views, &given, &context)?,
        false => Vec::new(),
    };
    let reasons = verdict::judge(&Judged {
        evidence: &evidence,
        checked: &input_views,
        calibration: calibration.as_ref(),
        has_depth: matches!(source, PriorChoice::Given | PriorChoice::Onnx),
        is_completed: options.symmetry != SymmetryMode::Never,
    });
    clock.lap("check");

    let (stages, total_ms) = clock.finish();
    let budget = budget.map(|plan| plan.after(&stages));
    warnings.extend(budget.as_ref().and_then(BudgetPlan::warning));
    let report = Report {
        version: env!("CARGO_PKG_VERSION"),
        prior: prior.name(),
        head: head.name(),
        stages,
        total_ms,
        peak_rss_bytes: peak_rss_bytes(),
        threads: context.threads(),
        gaussians: gaussians.len(),
        sh_degree: gaussians.sh_degree(),
        extent_m: gaussians.bounds(),
        views_used: views.iter().map(|v| v.name.clone()).collect(),
        calibration,
        vehicle,
        working_box: geometry.working_box.map(Into::into),
        cloud: geometry.points,
        photo: geometry.photo,
        masks: geometry.masks,
        network: geometry.network,
        plan: budget,
        left_out,
        warnings,
        symmetry: completion,
        relight,
        refinement,
        input_error: InputError::over(input_views.iter().map(|view| view.errors)),
        input_error_by_given_cameras: InputError::over(input_views.iter().map(|view| view.by_given_camera)),
        input_views,
        verdict: verdict::verdict(&reasons, options.check),
        verdict_reasons: reasons,
        evidence,
        settings: options.clone(),
    };
    context.report_end()?;
    Ok(Reconstruction { gaussians, points, report })
}

/// As many of the used views as the caller wants.
pub(super) fn chosen_views(
    scene: &Scene,
    used: Vec<usize>,
    options: &Options,
    left_out: &mut Vec<LeftOut>,
) -> Vec<usize> {
    let Some(most) = options.max_views.filter(|most| *most < used.len()) else { return used };
    let views: Vec<View> = used.iter().map(|&i| scene.views[i].clone()).collect();
    let why = format!("more than max_views, {most}: those that were kept spread best around the vehicle");
    plan::note(left_out, "views", &why, used.len() - most);
    spread(&views, most).into_iter().map(|i| used[i]).collect()
}

/// The views at the resolution to work at, as pinholes.
pub(super) fn undistorted(
    scene: &Scene,
    used: &[usize],
    resolution: f64,
    left_out: &mut Vec<LeftOut>,
    context: &Context,
) -> Result<Vec<View>> {
    let one = |&i: &usize| undistort::undistorted(&resize::resized(&scene.views[i], resolution)?);
    let mut views: Vec<View> = context.parallel(|| used.par_iter().map(one).collect::<Result<_>>())?;
    if resolution < 1.0 {
        let pixels = |camera: &Camera| camera.width as usize * camera.height as usize;
        let all: usize = used.iter().map(|&i| pixels(&scene.views[i].camera)).sum();
        let left: usize = views.iter().map(|v| pixels(&v.camera)).sum();
        let why = format!("averaged into fewer: the working resolution is {resolution}");
        plan::note(left_out, "pixels", &why, all.saturating_sub(left));
        views.retain(|v| v.mask.as_ref().is_none_or(|m| m.vehicle_pixels() > 0));
        let why = "at the working resolution no pixel shows the vehicle";
        plan::note(left_out, "views", why, used.len() - views.len());
        if views.is_empty() {
            let found = resolution.to_string();
            let allowed = "a share at which some pixel shows the vehicle";
            return Err(Error::argument("options.resolution", found, allowed));
        }
    }
    Ok(views)
}

/// The views of cameras in the box's own frame.
fn in_frame_of_box(mut views: Vec<View>, place: &Place) -> Vec<View> {
    let vehicle_from_box = place.vehicle_from_box();
    for view in &mut views {
        let pose = &mut view.camera.vehicle_from_camera;
        *pose = pose_from_box(&vehicle_from_box, pose);
    }
    views
}

fn chosen_prior(
    choice: PriorChoice,
    cloud: Option<Cloud>,
    known_box: Option<KnownBox>,
    options: &Options,
) -> Result<Box<dyn DepthPrior>> {
    let voxel_m = cost::voxel_m(options.resolution);
    Ok(match choice {
        PriorChoice::Onnx => {
            let model = options.prior_model.clone().expect("options were validated");
            Box::new(NetworkPrior::new(model)?)
        }
        PriorChoice::Given => Box::new(GivenDepth),
        PriorChoice::Hull => Box::new(HullPrior { known_box, cloud, voxel_m }),
        PriorChoice::Shape | PriorChoice::Auto => {
            Box::new(ShapePrior { known_box, cloud, photo: options.photo, voxel_m })
        }
    })
}

/// Every vehicle pixel with depth, lifted (paper eqs. `metric_point_ray`, `vehicle_point`).
fn point_cloud(views: &[View], geometry: &Geometry) -> PointCloud {
    let mut cloud = PointCloud::default();
    for (view, depth) in views.iter().zip(&geometry.depths) {
        for (v, u) in (0..view.camera.height).flat_map(|v| (0..view.camera.width).map(move |u| (v, u))) {
            if view.mask.as_ref().is_none_or(|m| m.is_vehicle(u, v))
                && let Some(z) = depth.get(u, v)
            {
                cloud.positions.push(view.lift(u, v, z).to_array());
                cloud.colors.push(view.image.get(u, v));
            }
        }
    }
    cloud
}

/// Cloning; in `Auto` the mirrored place counts as seen where a view looked at it and saw a surface, or saw
/// through it to another one. The background says nothing here: with poses a pixel off, the rim of every mirror
/// image lies in it. Clones are last; they are shown in the light of their own side.
fn complete(gaussians: Gaussians, options: &Options, views: &[View], geometry: &Geometry) -> Completed {
    let cameras: Vec<_> = views.iter().map(|v| v.camera).collect();
    let verdict = |observers: &[Observer], gaussians: &Gaussians, i: usize| {
        let (place, normal, own) = mirrored_place(gaussians, i);
        let mut mirrored = MirroredPlace::Unseen;
        for observer in observers {
            // Most views look at the other side: they need no look-up.
            let resolution = observer.resolution(place, normal);
            if resolution <= own / BETTER {
                continue;
            }
            match observer.sight(place, SURFACE_M) {
                Sight::Surface if resolution > BETTER * own => return MirroredPlace::SeenBetter,
                Sight::Surface | Sight::Through => mirrored = MirroredPlace::Seen,
                Sight::Background | Sight::Silent => {}
            }
        }
        mirrored
    };
    let light = match (options.relight, options.symmetry) {
        (Relight::Never, _) | (_, SymmetryMode::Never | SymmetryMode::Flip) => None,
        (Relight::Auto, _) => Light::estimate(&gaussians),
    };
    let (mut gaussians, completion, originals) =
        symmetry::complete(gaussians, options.symmetry, &cameras, |gaussians| {
            let observers = geometry.observers(views);
            (0..gaussians.len()).into_par_iter().map(|i| verdict(&observers, gaussians, i)).collect()
        });
    let range = gaussians.len() - completion.cloned..gaussians.len();
    let (relight, gains) = light.map(|light| light.apply(&mut gaussians, range)).unzip();
    Completed { gaussians, completion, mirrored: Mirrored { originals, gains }, relight }
}

/// A vehicle with both sides.
struct Completed {
    /// Originals, then clones.
    gaussians: Gaussians,
    completion: Completion,
    mirrored: Mirrored,
    relight: Option<Relighting>,
}

/// Of what each clone is the mirror image, and the factors that its colours took where they took any.
struct Mirrored {
    originals: Vec<u32>,
    gains: Option<Vec<[f32; 3]>>,
}

impl Mirrored {
    fn tied(&self) -> Vec<Tied> {
        let gain = |k: usize| self.gains.as_ref().map_or([1.0; 3], |gains| gains[k]);
        self.originals.iter().enumerate().map(|(k, &of)| Tied { of, gain: gain(k) }).collect()
    }
}

/// Centre and normal of the mirror image of a surfel, and the resolution at which the original was seen.
fn mirrored_place(gaussians: &Gaussians, i: usize) -> (Vec3, Vec3, f32) {
    let [w, x, y, z] = gaussians.rotations()[i];
    let normal = Quat::from_xyzw(x, y, z, w) * Vec3::Z;
    let coarsest = gaussians.scales()[i].into_iter().fold(0.0, f32::max);
    (Vec3::from_array(gaussians.means()[i]) * MIRROR_Y, normal * MIRROR_Y, FOOTPRINT_SIGMA_PX / coarsest)
}

/// All in the caller's frame again, the views with the cameras that the calibration found.
fn back_in_vehicle(
    gaussians: &Gaussians,
    points: Option<PointCloud>,
    moved: &Moved,
    context: &Context,
) -> Result<(Gaussians, Option<PointCloud>, Vec<View>)> {
    let back = &moved.vehicle_from_corrected;
    let gaussians = context.parallel(|| gaussians.transformed(back))?;
    Ok((gaussians, points.map(|cloud| cloud.transformed(back)), moved.in_vehicle.clone()))
}
