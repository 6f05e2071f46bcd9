//! Meaning of numbers in the C interface: each field and each enumerator is checked against its counterpart in Rust.
//!
//! Fields and enumerators come from the golden layout. A field without an entry here fails the test by name. All values
//! are different, so that exchanged fields are detected. Pictures and measurements are checked in
//! `tests/abi/meaning.rs`.

use super::super::report::ReportObject;
use super::*;
use serde_json::Value;
use std::fmt::Debug;
use std::ops::ControlFlow;
use std::sync::OnceLock;
use vg::Error;
use vg::calibrate::Verdict;
use vg::geometry::Choice;
use vg::geometry::camera::CameraModel;
use vg::geometry::options::{self, Face, Field, Kind};
use vg::io::{SceneOptions, open_scene};
use vg::onnx::ModelOptions;
use vg::pipeline::{self, InputError, KeepItem, Options, PriorChoice, Reason, ReasonCode, Report, Severity};
use vg::refine::{Amount, RefineOptions, Refinement, Stop};
use vg::relight::Relighting;
use vg::render::{Background, RenderOptions};
use vg::scene::Cloud;

/// Fields of a struct in the golden layout, in order.
fn golden_fields(of: &str) -> Vec<String> {
    let prefix = format!("{of}.");
    let layout = golden_layout();
    let fields = layout.lines().filter_map(|line| line.strip_prefix(&prefix)?.split(' ').next());
    fields.map(str::to_owned).collect()
}

/// Fails if a field of the struct has no entry, or an entry no field, and names it.
#[track_caller]
fn assert_all_checked(of: &str, checked: &[&str]) {
    let fields = golden_fields(of);
    for field in &fields {
        assert!(checked.contains(&field.as_str()), "{of}.{field} has no entry in {}", file!());
    }
    for field in checked {
        assert!(fields.iter().any(|f| f == field), "{}: {of} has no field {field}", file!());
    }
}

/// A field of options: a function that sets it, and a condition on the Rust options that holds only if it is set.
type Set<C, R> = (&'static str, fn(&mut C), fn(&R) -> bool);

/// Checks that each field has its effect, and only if it is set. `elsewhere`: fields that other tests check.
#[track_caller]
fn assert_effects<C: Copy, R>(
    of: &str,
    initial: C,
    read: impl Fn(&C) -> vg::Result<R>,
    effects: &[Set<C, R>],
    elsewhere: &[&str],
) {
    let default = read(&initial).unwrap();
    for (field, set, holds) in effects {
        assert!(!holds(&default), "{of}.{field}: holds without being set");
        let mut options = initial;
        set(&mut options);
        assert!(holds(&read(&options).unwrap()), "{of}.{field} does something else");
    }
    let named: Vec<&str> = effects.iter().map(|effect| effect.0).chain(elsewhere.iter().copied()).collect();
    assert_all_checked(of, &named);
}

#[test]
fn each_option_of_a_reconstruction_sets_its_namesake() {
    fn refinement(options: &Options) -> RefineOptions {
        options.refine.unwrap_or_default()
    }
    fn place(options: &mut vg_options) -> &mut vg_options {
        (options.vehicle_size, options.has_vehicle_place) = ([4.5, 1.75, 1.5], 1);
        options
    }
    let effects: [Set<vg_options, Options>; 8] = [
        ("vehicle_size", |o| o.vehicle_size = [4.5, 1.75, 1.5], |r| r.vehicle_size == Some([4.5, 1.75, 1.5])),
        (
            "vehicle_center",
            |o| place(o).vehicle_center = [1.5, 2.5, 3.5],
            |r| r.vehicle_place.is_some_and(|p| p.center == [1.5, 2.5, 3.5]),
        ),
        ("vehicle_yaw", |o| place(o).vehicle_yaw = 0.25, |r| r.vehicle_place.is_some_and(|p| p.yaw == 0.25)),
        ("has_vehicle_place", |o| place(o).vehicle_flags = 0, |r| r.vehicle_place.is_some()),
        (
            "refine_seconds",
            |o| o.refine_seconds = 1.5,
            |r| r.refine.is_some() && refinement(r).amount == Amount::Seconds(1.5),
        ),
        (
            "refine_iterations",
            |o| o.refine_iterations = 7,
            |r| r.refine.is_some() && refinement(r).amount == Amount::Iterations(7),
        ),
        (
            "refine_hold_out",
            |o| (o.refine_iterations, o.refine_hold_out) = (7, 1),
            |r| refinement(r).hold_out,
        ),
        (
            "refine_backend",
            |o| (o.refine_iterations, o.refine_backend) = (7, vg_backend::Cpu as i32),
            |r| format!("{:?}", refinement(r).backend) == "Cpu",
        ),
    ];
    // Options of the table are in the next test; `cloud` is below; callbacks are called by the client of each release,
    // models by the tests of networks.
    let elsewhere = [
        "struct_size",
        "context",
        "progress",
        "progress_user",
        "log",
        "log_user",
        "flags",
        "cloud",
        "cloud_count",
        "prior_model",
        "head_model",
        "refine_flags",
        "vehicle_flags",
        "progress_overall",
    ];
    let table = options_of_the_table();
    let elsewhere: Vec<&str> = elsewhere.into_iter().chain(table.iter().map(|field| field.name)).collect();
    let read = |options: &vg_options| unsafe { options.to_options() };
    assert_effects("vg_options", vg_options::initial(), read, &effects, &elsewhere);
    assert_eq!(read(&vg_options::initial()).unwrap(), Options::default(), "the defaults are Rust's");

    let points = [[1.0f32, 2.0, 3.0], [4.0, 5.0, 6.0]];
    let options = vg_options { cloud: points.as_ptr().cast(), cloud_count: 2, ..vg_options::initial() };
    assert_eq!(unsafe { options.to_cloud() }.unwrap().unwrap().points(), points);
}

/// Options that C has from the library's table.
fn options_of_the_table() -> Vec<Field> {
    let fields = Options::fields().into_iter();
    fields.filter(|field| !field.facts.apart.contains(&Face::C)).collect()
}

/// Values other than the default, each with its bytes in C: all names, and a number that no other option gets.
fn others(field: &Field, i: u8) -> Vec<(options::Value, Vec<u8>)> {
    use options::Value;
    let int = |number: i32| number.to_ne_bytes().to_vec();
    match field.kind {
        Kind::Choice(e) => {
            let others = e().variants.into_iter().map(|v| (Value::Name(v.name.into()), int(v.number)));
            others.filter(|other| other.0 != field.default).collect()
        }
        Kind::Set(e) => {
            e().variants.iter().map(|v| (Value::Names(vec![v.name.into()]), int(v.number))).collect()
        }
        Kind::Flag => {
            let other = field.default == Value::Flag(false);
            vec![(Value::Flag(other), int(other.into()))]
        }
        Kind::Whole => {
            (0..=3u64).map(|n| (Value::Whole(n), int(n as i32))).filter(|o| o.0 != field.default).collect()
        }
        Kind::MaybeWhole => {
            let number = 100 + usize::from(i);
            vec![(Value::Whole(number as u64), number.to_ne_bytes().to_vec())]
        }
        Kind::Real | Kind::MaybeReal => {
            let number = 0.25 + f64::from(i) / 256.0;
            vec![(Value::Real(number), number.to_ne_bytes().to_vec())]
        }
    }
}

/// A field of C, found by the golden layout, sets the option of its name to the same value, and no other option.
#[test]
fn each_option_of_the_table_sets_its_namesake_and_nothing_else() {
    let (table, layout) = (options_of_the_table(), golden_layout());
    for (i, field) in table.iter().enumerate() {
        let line =
            layout.lines().find_map(|line| line.strip_prefix(&format!("vg_options.{} at ", field.name)));
        let (at, size) = line.and_then(|line| line.split_once(" size ")).expect("a line of the layout");
        for (value, bytes) in others(field, i as u8) {
            assert_eq!(bytes.len().to_string(), size, "{}", field.name);
            let mut options = vg_options::initial();
            let at = (&raw mut options).cast::<u8>().wrapping_add(at.parse().unwrap());
            unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), at, bytes.len()) };
            let read = unsafe { options.to_options() }.unwrap();
            for other in &table {
                let expected = if other.name == field.name { &value } else { &other.default };
                assert_eq!(
                    read.get(other.name).as_ref(),
                    Some(expected),
                    "{} sets {}",
                    field.name,
                    other.name
                );
            }
        }
    }
    assert!(table.len() >= 13);
}

#[test]
fn each_option_of_a_picture_sets_its_namesake() {
    let effects: [Set<vg_render_options, (RenderOptions, vg_alpha)>; 10] = [
        (
            "background",
            |o| o.background = vg_background::Transparent as i32,
            |r| r.0.background == Background::Transparent,
        ),
        (
            "background_color",
            |o| o.background_color = [0.25, 0.5, 0.75],
            |r| r.0.background == Background::Color([0.25, 0.5, 0.75]),
        ),
        ("alpha", |o| o.alpha = vg_alpha::Premultiplied as i32, |r| r.1 == vg_alpha::Premultiplied),
        (
            "depth_mode",
            |o| o.depth_mode = vg_depth_mode::Accumulated as i32,
            |r| format!("{:?}", r.0.depth_mode) == "Accumulated",
        ),
        ("sh_degree", |o| o.sh_degree = 1, |r| r.0.sh_degree == 1),
        ("antialiased", |o| o.antialiased = 1, |r| r.0.antialiased),
        ("blur", |o| o.blur = 0.5, |r| r.0.blur == 0.5),
        ("near_plane", |o| o.near_plane = 0.25, |r| r.0.near == 0.25),
        ("far_plane", |o| o.far_plane = 70.0, |r| r.0.far == 70.0),
        ("max_alpha", |o| o.max_alpha = 0.75, |r| r.0.max_alpha == 0.75),
    ];
    let elsewhere = ["struct_size", "context", "backend", "flags", "progress", "progress_user"];
    let initial = vg_render_options::initial();
    assert_effects("vg_render_options", initial, vg_render_options::read, &effects, &elsewhere);
    assert_eq!(initial.read().unwrap().0, RenderOptions::default(), "the defaults are Rust's");
}

#[test]
fn each_option_of_a_scene_sets_its_namesake() {
    /// Twice the size, moved.
    const MATRIX: [f64; 16] =
        [2.0, 0.0, 0.0, 1.0, 0.0, 2.0, 0.0, -3.0, 0.0, 0.0, 2.0, 0.5, 0.0, 0.0, 0.0, 1.0];
    static NAMES: [&CStr; 2] = [c"b", c"a"];
    let effects: [Set<vg_scene_options, SceneOptions>; 4] = [
        (
            "vehicle_from_world",
            |o| o.vehicle_from_world = MATRIX.as_ptr(),
            |r| r.vehicle_from_world.is_some_and(|s| s.to_row_major() == MATRIX),
        ),
        (
            "names",
            |o| {
                let names: Box<[_; 2]> = Box::new(NAMES.map(CStr::as_ptr));
                (o.names, o.name_count) = (Box::leak(names).as_ptr(), 2);
            },
            |r| r.views == Some(vec!["b".to_owned(), "a".to_owned()]),
        ),
        ("depth_scale", |o| o.depth_scale = 0.25, |r| r.depth_scale == Some(0.25)),
        ("load_depth", |o| o.load_depth = 0, |r| !r.load_depth),
    ];
    let elsewhere =
        ["struct_size", "context", "name_count", "flags", "log", "log_user", "progress", "progress_user"];
    let read = |options: &vg_scene_options| unsafe { options.read() };
    assert_effects("vg_scene_options", vg_scene_options::initial(), read, &effects, &elsewhere);
}

#[test]
fn each_option_of_a_model_sets_its_namesake() {
    let effects: [Set<vg_model_options, ModelOptions>; 6] = [
        (
            "runtime",
            |o| o.runtime = c"/a/lib.so".as_ptr(),
            |r| r.runtime.as_deref() == Some(Path::new("/a/lib.so")),
        ),
        ("provider", |o| o.provider = vg_provider::Cuda as i32, |r| format!("{:?}", r.provider) == "Cuda"),
        ("fall_back", |o| o.fall_back = 1, |r| r.fall_back),
        ("threads", |o| o.threads = 3, |r| r.threads == 3),
        ("prepack", |o| o.prepack = vg_prepack::Never as i32, |r| r.prepack == Some(false)),
        (
            "arena",
            |o| o.arena = i32::from(!ModelOptions::default().arena),
            |r| r.arena != ModelOptions::default().arena,
        ),
    ];
    let read = |options: &vg_model_options| unsafe { options.read() };
    let initial = vg_model_options::initial();
    assert_effects("vg_model_options", initial, read, &effects, &["struct_size", "flags"]);
    assert_eq!(read(&initial).unwrap(), ModelOptions::default(), "the defaults are Rust's");
}

/// A report of a run that has every part, with a different number in each figure.
fn report() -> Report {
    static MADE: OnceLock<Report> = OnceLock::new();
    let mut report = MADE.get_or_init(made).clone();
    (report.gaussians, report.symmetry.cloned, report.threads, report.sh_degree) = (1001, 1002, 1003, 1);
    report.views_used = ["a", "b", "c", "d", "e"].map(str::to_owned).into();
    (report.total_ms, report.peak_rss_bytes) = (1234.5, Some(1004));
    report.extent_m = Some(([-1.5, -2.5, -3.5], [4.5, 5.5, 6.5]));
    let input_error = report.input_error.as_mut().expect("the check");
    (input_error.psnr_db, input_error.silhouette_iou, input_error.mask_covered) = (21.5, 0.875, 0.125);
    report.working_box.as_mut().expect("a box").size_m = [7.5, 8.5, 9.5];
    let vehicle = report.vehicle.as_mut().expect("a size");
    (vehicle.size_m, vehicle.uncertainty_m) = ([10.5, 11.5, 12.5], [13.5, 14.5, 15.5]);
    report.input_error_by_given_cameras =
        Some(InputError { psnr_db: 20.5, silhouette_iou: 0.625, mask_covered: 0.0625 });
    report.verdict = pipeline::Verdict::Doubtful;
    report.verdict_reasons = [(); 3].map(|()| reason()).into();
    report.relight = Some(Relighting { left_over_right: 0.5, sun: [0.0; 3], clones: 1005 });
    let cloud = report.cloud.as_mut().expect("points");
    (cloud.used, cloud.outside) = (1006, 1007);
    let photo = report.photo.as_mut().expect("photographs");
    (photo.patches, photo.found) = (1008, 1009);
    let calibration = report.calibration.as_mut().expect("a calibration");
    calibration.verdict = Verdict::Refused;
    (calibration.yaw_degrees, calibration.roll_degrees, calibration.lateral_m) = (-2.25, 1.25, -0.375);
    let masks = report.masks.as_mut().expect("masks");
    (masks.uncovered_before, masks.uncovered_after) = (0.75, 0.25);
    let refinement = report.refinement.as_mut().expect("an optimisation");
    (refinement.iterations, refinement.made, refinement.kept) = (1010, 1011, 1012);
    report
}

fn reason() -> Reason {
    let text = || "made for a test".to_owned();
    Reason {
        code: ReasonCode::TooLarge,
        severity: Severity::Doubtful,
        view: None,
        found: text(),
        expected: text(),
        cause: text(),
        remedy: text(),
    }
}

/// A run of the sample, the smallest that has every part.
fn made() -> Report {
    let folder = vg_testing::root().join("tests/data/sedan");
    let views = Some(["000", "001"].map(str::to_owned).into());
    let scene = SceneOptions { views, load_depth: false, ..SceneOptions::default() };
    let options = Options {
        prior: PriorChoice::Shape,
        resolution: 0.2,
        refine: Some(RefineOptions { amount: Amount::Iterations(1), ..RefineOptions::default() }),
        ..Options::default()
    };
    Threads::new(1).unwrap().run(|| {
        let mut scene = open_scene(&folder, &scene).unwrap().scene;
        scene.cloud = Some(Cloud::new(vec![[0.0, -0.9, 0.8], [1.0, -0.9, 0.8]]).unwrap());
        let made = pipeline::reconstruct(&scene, &Options { threads: 1, ..options }, &mut |_| {
            ControlFlow::Continue(())
        });
        made.unwrap().report
    })
}

/// The number at a place of the JSON; `true` is 1.
fn number(json: &Value, place: &str) -> f64 {
    let value = json.pointer(place).unwrap_or_else(|| panic!("no {place} in {json}"));
    value.as_f64().unwrap_or_else(|| f64::from(u8::from(value.as_bool().unwrap_or(!value.is_null()))))
}

#[test]
fn each_figure_of_a_report_is_rusts_number_and_the_jsons() {
    let report = report();
    let json: Value = serde_json::from_str(&serde_json::to_string(&report).unwrap()).unwrap();
    let figures = vg_report_figures::of(&report);
    let through_c = unsafe {
        let object = ReportObject::new(report.clone(), None).into_raw();
        let mut out = vg_report_figures::initial();
        assert_eq!(vg_report_get_figures(object, &raw mut out, null_mut()), vg_status::Ok);
        assert_eq!(
            serde_json::from_slice::<Value>(CStr::from_ptr(vg_report_json(object)).to_bytes()).unwrap(),
            json
        );
        vg_report_free(object);
        out
    };
    /// A figure: its field in C, its value, and its place in the JSON; an empty place if the JSON has a word instead.
    type Figure = (&'static str, fn(&vg_report_figures) -> f64, f64, &'static str);
    let figures_of: [Figure; 46] = [
        ("gaussian_count", |f| f.gaussian_count as f64, 1001.0, "/gaussians"),
        ("mirrored_count", |f| f.mirrored_count as f64, 1002.0, "/symmetry/cloned"),
        ("views_used", |f| f.views_used.into(), 5.0, ""),
        ("threads", |f| f.threads.into(), 1003.0, "/threads"),
        ("prior", |f| f.prior.into(), f64::from(vg_prior::Shape as i32), ""),
        ("sh_degree", |f| f.sh_degree.into(), 1.0, "/sh_degree"),
        ("total_ms", |f| f.total_ms, 1234.5, "/total_ms"),
        ("peak_rss_bytes", |f| f.peak_rss_bytes as f64, 1004.0, "/peak_rss_bytes"),
        ("has_input_error", |f| f.has_input_error.into(), 1.0, "/input_error"),
        ("has_box", |f| f.has_box.into(), 1.0, "/working_box"),
        ("input_psnr_db", |f| f.input_psnr_db, 21.5, "/input_error/psnr_db"),
        ("input_silhouette_iou", |f| f.input_silhouette_iou, 0.875, "/input_error/silhouette_iou"),
        ("box_size", |f| f.box_size[0], 7.5, "/working_box/size_m/0"),
        ("box_size", |f| f.box_size[1], 8.5, "/working_box/size_m/1"),
        ("box_size", |f| f.box_size[2], 9.5, "/working_box/size_m/2"),
        ("extent_low", |f| f.extent_low[0], -1.5, "/extent_m/0/0"),
        ("extent_low", |f| f.extent_low[1], -2.5, "/extent_m/0/1"),
        ("extent_low", |f| f.extent_low[2], -3.5, "/extent_m/0/2"),
        ("extent_high", |f| f.extent_high[0], 4.5, "/extent_m/1/0"),
        ("extent_high", |f| f.extent_high[1], 5.5, "/extent_m/1/1"),
        ("extent_high", |f| f.extent_high[2], 6.5, "/extent_m/1/2"),
        ("relit_count", |f| f.relit_count as f64, 1005.0, "/relight/clones"),
        ("cloud_used", |f| f.cloud_used as f64, 1006.0, "/cloud/used"),
        ("photo_found", |f| f.photo_found as f64, 1009.0, "/photo/found"),
        ("calibration", |f| f.calibration.into(), f64::from(vg_calibration::Refused as i32), ""),
        ("has_uncovered", |f| f.has_uncovered.into(), 1.0, "/masks"),
        ("calibration_yaw_degrees", |f| f.calibration_yaw_degrees, -2.25, "/calibration/yaw_degrees"),
        ("calibration_lateral_m", |f| f.calibration_lateral_m, -0.375, "/calibration/lateral_m"),
        ("uncovered_before", |f| f.uncovered_before, 0.75, "/masks/uncovered_before"),
        ("uncovered_after", |f| f.uncovered_after, 0.25, "/masks/uncovered_after"),
        ("refine_iterations", |f| f.refine_iterations.into(), 1010.0, "/refinement/iterations"),
        ("refine_kept", |f| f.refine_kept.into(), 1012.0, "/refinement/kept"),
        ("vehicle_size", |f| f.vehicle_size[0], 10.5, "/vehicle/size_m/0"),
        ("vehicle_size", |f| f.vehicle_size[1], 11.5, "/vehicle/size_m/1"),
        ("vehicle_size", |f| f.vehicle_size[2], 12.5, "/vehicle/size_m/2"),
        ("vehicle_size_uncertainty", |f| f.vehicle_size_uncertainty[0], 13.5, "/vehicle/uncertainty_m/0"),
        ("vehicle_size_uncertainty", |f| f.vehicle_size_uncertainty[1], 14.5, "/vehicle/uncertainty_m/1"),
        ("vehicle_size_uncertainty", |f| f.vehicle_size_uncertainty[2], 15.5, "/vehicle/uncertainty_m/2"),
        ("has_vehicle_size", |f| f.has_vehicle_size.into(), 1.0, "/vehicle"),
        ("budget_kept", |f| f.budget_kept.into(), 1.0, ""),
        ("input_mask_covered", |f| f.input_mask_covered, 0.125, "/input_error/mask_covered"),
        ("input_given_psnr_db", |f| f.input_given_psnr_db, 20.5, "/input_error_by_given_cameras/psnr_db"),
        (
            "input_given_silhouette_iou",
            |f| f.input_given_silhouette_iou,
            0.625,
            "/input_error_by_given_cameras/silhouette_iou",
        ),
        (
            "input_given_mask_covered",
            |f| f.input_given_mask_covered,
            0.0625,
            "/input_error_by_given_cameras/mask_covered",
        ),
        ("verdict", |f| f.verdict.into(), f64::from(vg_verdict::Doubtful as i32), ""),
        ("reason_count", |f| f.reason_count.into(), 3.0, ""),
    ];
    for (field, of, expected, place) in figures_of {
        assert_eq!((of(&figures), of(&through_c)), (expected, expected), "vg_report_figures.{field}");
        if !place.is_empty() {
            assert_eq!(number(&json, place), expected, "{place} is vg_report_figures.{field}");
        }
    }
    assert_eq!(json["views_used"].as_array().unwrap().len(), 5);
    assert_eq!(
        (json["prior"].as_str(), json["calibration"]["verdict"].as_str()),
        (Some("shape"), Some("refused"))
    );
    let checked = figures_of.iter().map(|figure| figure.0).chain(["struct_size"]);
    assert_all_checked("vg_report_figures", &checked.collect::<Vec<_>>());

    // A run without these parts.
    let bare = Report {
        input_error: None,
        working_box: None,
        vehicle: None,
        masks: None,
        calibration: None,
        peak_rss_bytes: None,
        ..report
    };
    let figures = vg_report_figures::of(&bare);
    assert_eq!((figures.has_input_error, figures.has_box, figures.has_uncovered), (0, 0, 0));
    assert_eq!((figures.has_vehicle_size, figures.vehicle_size), (0, [0.0; 3]));
    assert_eq!((figures.calibration, figures.peak_rss_bytes), (vg_calibration::None as i32, 0));
}

/// Enumerators that were checked against Rust.
#[derive(Default)]
struct CheckedEnumerators(BTreeSet<String>);

impl CheckedEnumerators {
    /// Every variant of an enumeration that C shares with the library, and what Rust makes of its number.
    #[track_caller]
    fn all<T: Choice + Debug>(&mut self, enumeration: &str, rust: impl Fn(i32) -> T) {
        let numbers = numbers_of_rust();
        for variant in T::ALL.iter().map(|choice| choice.variant()) {
            let line = format!("{} = {}", enumerator(enumeration, variant.ident), variant.number);
            assert!(numbers.contains(&line), "C has no {line}");
            self.check(enumeration, format_args!("{}", variant.ident), rust(variant.number));
        }
    }

    /// Checks that `variant` of an enumeration of C becomes the variant of Rust with the same name, ignoring case.
    #[track_caller]
    fn check(&mut self, enumeration: &str, variant: impl Debug, rust: impl Debug) {
        let (variant, rust) = (format!("{variant:?}"), format!("{rust:?}"));
        let name = enumerator(enumeration, &variant);
        // Only the name of a variant that holds data.
        let word = rust.split([' ', '(']).next().unwrap();
        assert_eq!(word.to_lowercase(), variant.to_lowercase(), "{name}");
        self.0.insert(name);
    }
}

#[test]
fn each_enumerator_means_its_namesake_in_rust() {
    let mut checked = CheckedEnumerators::default();
    let options = |set: &dyn Fn(&mut vg_options)| {
        let mut options = vg_options::initial();
        set(&mut options);
        unsafe { options.to_options() }.unwrap()
    };
    checked.all("vg_prior", |n| options(&|o| o.prior = n).prior);
    for prior in PriorChoice::ALL.iter().filter(|prior| **prior != PriorChoice::Auto) {
        assert_eq!(vg_report_figures::of(&Report { prior: prior.name(), ..report() }).prior, prior.number());
    }
    checked.all("vg_symmetry", |n| options(&|o| o.symmetry = n).symmetry);
    checked.all("vg_calibrate", |n| options(&|o| o.calibrate = n).calibrate);
    checked.all("vg_relight", |n| options(&|o| o.relight = n).relight);
    for bit in KeepItem::ALL {
        let keep = serde_json::to_value(options(&|o| o.keep = bit.number() as u32).keep).unwrap();
        let kept: Vec<&String> = keep
            .as_object()
            .unwrap()
            .iter()
            .filter(|(_, kept)| **kept == Value::Bool(true))
            .map(|k| k.0)
            .collect();
        assert_eq!(kept.len(), 1, "{bit:?}");
        assert_eq!(enumerator("vg_keep", &format!("{bit:?}")), format!("VG_KEEP_{}", kept[0].to_uppercase()));
        checked.check("vg_keep", bit, bit);
    }
    for verdict in [
        pipeline::Verdict::Good,
        pipeline::Verdict::Unchecked,
        pipeline::Verdict::Doubtful,
        pipeline::Verdict::Bad,
    ] {
        let found = vg_report_figures::of(&Report { verdict, ..report() }).verdict;
        let named = [vg_verdict::Good, vg_verdict::Unchecked, vg_verdict::Doubtful, vg_verdict::Bad];
        let named = named.into_iter().find(|v| *v as i32 == found).unwrap();
        checked.check("vg_verdict", named, verdict);
    }
    for stop in [Stop::Done, Stop::HeldOut, Stop::Diverged, Stop::Unseen] {
        let done = Refinement { stop, ..report().refinement.expect("an optimisation") };
        let found = vg_refinement::from(&done).stop;
        let named =
            [vg_refine_stop::Done, vg_refine_stop::HeldOut, vg_refine_stop::Diverged, vg_refine_stop::Unseen];
        checked.check("vg_refine_stop", named.into_iter().find(|s| *s as i32 == found).unwrap(), stop);
    }
    for verdict in [Verdict::NotNeeded, Verdict::Accepted, Verdict::Refused] {
        let mut report = report();
        report.calibration.as_mut().unwrap().verdict = verdict;
        let found = vg_report_figures::of(&report).calibration;
        let named = [vg_calibration::NotNeeded, vg_calibration::Accepted, vg_calibration::Refused];
        let named = named.into_iter().find(|c| *c as i32 == found).unwrap();
        checked.check("vg_calibration", named, verdict);
    }
    let none = vg_report_figures::of(&Report { calibration: None, ..report() }).calibration;
    assert_eq!(none, vg_calibration::None as i32);
    checked.check("vg_calibration", vg_calibration::None, Option::<()>::None);

    let drawing = |set: &dyn Fn(&mut vg_render_options)| {
        let mut options = vg_render_options::initial();
        set(&mut options);
        options.read().unwrap()
    };
    for background in [vg_background::Color, vg_background::Transparent] {
        let rust = drawing(&|o| o.background = background as i32).0.background;
        checked.check("vg_background", background, rust);
    }
    for alpha in [vg_alpha::Straight, vg_alpha::Premultiplied] {
        checked.check("vg_alpha", alpha, drawing(&|o| o.alpha = alpha as i32).1);
    }
    checked.all("vg_depth_mode", |n| drawing(&|o| o.depth_mode = n).0.depth_mode);
    for backend in [vg_backend::Auto, vg_backend::Cpu, vg_backend::Gpu] {
        match render::backend("backend", backend as i32) {
            Ok(rust) => checked.check("vg_backend", backend, rust),
            Err(Error::NotBuilt { found, .. }) => {
                checked.check("vg_backend", backend, format_args!("{}", found.trim_matches('"')));
            }
            Err(other) => panic!("{other}"),
        }
    }
    checked.all("vg_heading", |n| {
        vg_align_options { heading: n, ..vg_align_options::initial() }.heading().unwrap()
    });
    for model in CameraModel::ALL {
        let named = [
            vg_camera_model::SimplePinhole,
            vg_camera_model::Pinhole,
            vg_camera_model::SimpleRadial,
            vg_camera_model::Radial,
            vg_camera_model::Opencv,
            vg_camera_model::OpencvFisheye,
            vg_camera_model::FullOpencv,
        ];
        let named = named.into_iter().find(|m| CameraModel::from_id(*m as i32) == Some(model)).unwrap();
        checked.check("vg_camera_model", named, model);
    }
    let opening = |set: &dyn Fn(&mut vg_model_options)| {
        let mut options = vg_model_options::initial();
        set(&mut options);
        unsafe { options.read() }.unwrap()
    };
    checked.all("vg_provider", |n| opening(&|o| o.provider = n).provider);
    for (prepack, rust) in
        [(vg_prepack::Auto, None), (vg_prepack::Always, Some(true)), (vg_prepack::Never, Some(false))]
    {
        assert_eq!(opening(&|o| o.prepack = prepack as i32).prepack, rust);
        checked.check("vg_prepack", prepack, prepack);
    }
    for error in one_of_each_error() {
        checked.check("vg_status", vg_status::from(&error), error);
    }
    // Success, and a panic, which other tests check.
    checked.check("vg_status", vg_status::Ok, message_of(|| Ok(())).0);
    checked.check("vg_status", vg_status::Internal, message_of(|| panic!("made for a test")).0);

    let mut all = numbers_of_rust();
    // These are checked by their effect in tests/abi/meaning.rs.
    all.retain(|line| !["VG_FORMAT_", "VG_LOG_LEVEL_"].iter().any(|prefix| line.starts_with(prefix)));
    for line in all {
        let name = line.split(' ').next().unwrap();
        assert!(checked.0.contains(name), "{name} has no entry in {}", file!());
    }
}

/// One error of every kind; a new kind has a number of its own, and its absence here fails.
fn one_of_each_error() -> Vec<Error> {
    let text = || "made for a test".to_owned();
    let all = vec![
        Error::argument(text(), text(), text()),
        Error::format(Path::new("file"), text(), text()),
        Error::io(Path::new("file"), std::io::Error::other("made for a test")),
        Error::Reconstruction { stage: "prior", reason: text() },
        Error::NotBuilt { argument: text(), found: text(), remedy: text() },
        Error::Missing { what: "device", found: text(), remedy: text() },
        Error::Threads { count: 2, started: 1, found: text() },
        Error::Cancelled { stage: "prior" },
    ];
    // A panic is the one failure without an error.
    let lines = numbers_of_rust();
    let numbers = lines.iter().filter(|line| line.starts_with("VG_STATUS_"));
    let expected: BTreeSet<i32> = numbers.filter_map(|line| line.split(" = ").nth(1)?.parse().ok()).collect();
    let without = [vg_status::Ok, vg_status::Internal].map(|status| status as i32);
    let made = all.iter().map(|error| vg_status::from(error) as i32);
    assert_eq!(made.chain(without).collect::<BTreeSet<_>>(), expected);
    all
}
