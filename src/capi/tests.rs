//! The ABI according to two sources independent of cbindgen, and panics in every function.

#[path = "../../tests/abi/contents.rs"]
mod contents;
mod meaning;

use super::guard::{guarded, injection};
use super::read::Versioned;
use super::*;
use contents::Contents;
use std::collections::BTreeSet;
use std::ffi::CStr;
use std::fmt::Write;
use std::path::Path;
use std::ptr::{null, null_mut};
use vg::progress::Threads;
use vg_testing::tools;

/// The golden layout without the enumerators, which are plain numbers in Rust.
fn golden_layout() -> String {
    let golden = std::fs::read_to_string(tools::golden().join("layout_x86_64.txt")).unwrap();
    golden.lines().filter(|line| !line.contains(" = ")).fold(String::new(), |text, line| text + line + "\n")
}

/// Layout of every struct of the header according to rustc.
fn layout_of_rust() -> String {
    fn size<T, F>(_: fn(&T) -> &F) -> usize {
        size_of::<F>()
    }
    let mut lines = String::new();
    macro_rules! lay_out {
        ($($name:ident { $($field:ident)* })*) => { $(
            let _ = writeln!(lines, "{} size {} align {}", stringify!($name), size_of::<$name>(), align_of::<$name>());
            $(
                let at = std::mem::offset_of!($name, $field);
                let bytes = size(|s: &$name| &s.$field);
                let _ = writeln!(lines, "{}.{} at {at} size {bytes}", stringify!($name), stringify!($field));
            )*
        )* };
    }
    lay_out! {
        vg_align_options {
            struct_size context heading flags progress progress_user
        }
        vg_alignment {
            struct_size vehicle_from_world scale residual_m confidence residual_px other_px used_count
        }
        vg_camera { struct_size width height model flags params vehicle_from_camera reserved }
        vg_context_options { struct_size threads flags }
        vg_gaussian_arrays { struct_size count positions scales rotations opacities sh sh_degree flags }
        vg_gradients {
            struct_size count positions scales rotations opacities sh background pose view_matrix sh_degree flags
        }
        vg_image { data row_stride width height format flags }
        vg_image_gradient {
            struct_size width height color color_row_stride alpha alpha_row_stride depth depth_row_stride loss
            loss_user flags
        }
        vg_image_target {
            struct_size width height color color_row_stride depth depth_row_stride color_format flags alpha
            alpha_row_stride
        }
        vg_metrics_options {
            struct_size context lpips f_score_m flags progress progress_user
        }
        vg_model_options { struct_size runtime provider fall_back threads prepack arena flags }
        vg_options {
            struct_size context prior symmetry sh_degree keep check points vehicle_size progress progress_user log
            log_user calibrate relight photo flags budget_s cloud cloud_count resolution
            max_views prior_model head_model refine_seconds refine_iterations refine_hold_out
            refine_backend refine_flags vehicle_center vehicle_yaw has_vehicle_place vehicle_flags progress_overall
            max_gaussians
        }
        vg_picture_errors { struct_size psnr_db ssim lpips }
        vg_refine_options {
            struct_size context seconds iterations hold_out densify backend progress progress_user flags
        }
        vg_refinement {
            struct_size iterations made kept stop psnr_before_db psnr_after_db held_out_before_db held_out_after_db
        }
        vg_render_options {
            struct_size context backend background background_color alpha depth_mode sh_degree antialiased blur
            near_plane far_plane max_alpha flags progress progress_user
        }
        vg_renderer_options { struct_size context backend flags }
        vg_report_figures {
            struct_size gaussian_count mirrored_count views_used threads prior sh_degree total_ms peak_rss_bytes
            has_input_error has_box input_psnr_db input_silhouette_iou box_size extent_low extent_high relit_count
            cloud_used photo_found calibration has_uncovered calibration_yaw_degrees calibration_lateral_m
            uncovered_before uncovered_after refine_iterations refine_kept vehicle_size vehicle_size_uncertainty
            has_vehicle_size budget_kept input_mask_covered input_given_psnr_db
            input_given_silhouette_iou input_given_mask_covered verdict reason_count
        }
        vg_scene_options {
            struct_size context vehicle_from_world names name_count depth_scale load_depth flags log log_user
            progress progress_user
        }
        vg_segment_options { struct_size context flags }
        vg_surface_errors {
            struct_size accuracy_m completeness_m chamfer_m precision recall f_score length_error_percent
            width_error_percent height_error_percent
        }
        vg_view { struct_size name camera image mask depth }
        vg_view_errors { struct_size psnr_db psnr_box_db ssim lpips silhouette_iou depth_mae_m depth_p90_m }
    }
    lines
}

#[test]
fn rust_sees_the_golden_layout() {
    if cfg!(target_arch = "x86_64") {
        assert_eq!(layout_of_rust(), golden_layout());
    }
}

/// C's name of an enumeration's variant: `VG_KEEP_SH_BANDS` for `vg_keep` and `ShBands`.
fn enumerator(enumeration: &str, variant: &str) -> String {
    let word = |(i, c): (usize, char)| match c.is_ascii_uppercase() && i > 0 {
        true => format!("_{c}"),
        false => c.to_ascii_uppercase().to_string(),
    };
    let name: String = variant.chars().enumerate().map(word).collect();
    format!("{}_{name}", enumeration.to_ascii_uppercase())
}

/// Every enumerator with its number, by its name in C.
fn numbers_of_rust() -> BTreeSet<String> {
    let mut lines = BTreeSet::new();
    let mut note = |enumeration: &str, variant: &str, number: i32| {
        lines.insert(format!("{} = {number}", enumerator(enumeration, variant)));
    };
    macro_rules! number {
        ($($name:ident { $($variant:ident)* })*) => {
            $( $( note(stringify!($name), stringify!($variant), $name::$variant as i32); )* )*
        };
    }
    number! {
        vg_alpha { Straight Premultiplied }
        vg_backend { Auto Cpu Gpu }
        vg_background { Color Transparent }
        vg_calibrate { Auto Off }
        vg_calibration { None NotNeeded Accepted Refused }
        vg_camera_model { SimplePinhole Pinhole SimpleRadial Radial Opencv OpencvFisheye FullOpencv }
        vg_depth_mode { Expected Accumulated }
        vg_format { Rgb8 Bgr8 Rgba8 Bgra8 Gray8 Rgba32f Depth32f }
        vg_heading { Auto Forward Backward }
        vg_keep { DuplicateViews Overlap SilhouetteEdge Floaters ShBands }
        vg_log_level { Warning Info Debug }
        vg_prepack { Auto Always Never }
        vg_prior { Auto Given Hull Onnx Shape }
        vg_provider { Cpu Cuda }
        vg_refine_stop { Done HeldOut Diverged Unseen }
        vg_relight { Auto Never }
        vg_status { Ok Argument Format Io Reconstruction Cancelled NotBuilt Internal Missing Threads }
        vg_symmetry { Auto Always Never Flip }
        vg_verdict { Good Unchecked Doubtful Bad }
    }
    lines
}

#[test]
fn rust_has_the_golden_numbers() {
    let golden = std::fs::read_to_string(tools::golden().join("layout_x86_64.txt")).unwrap();
    let golden: BTreeSet<String> = golden.lines().filter(|l| l.contains(" = ")).map(str::to_owned).collect();
    assert_eq!(numbers_of_rust(), golden);
}

#[test]
fn every_status_is_called_what_the_header_calls_it() {
    let golden = std::fs::read_to_string(tools::golden().join("layout_x86_64.txt")).unwrap();
    let statuses = golden.lines().filter(|l| l.starts_with("VG_STATUS_")).filter_map(|l| l.split_once(" = "));
    let mut count = 0;
    for (name, number) in statuses {
        let found = unsafe { CStr::from_ptr(vg_status_name(number.parse().unwrap())) };
        assert_eq!(found.to_str(), Ok(name));
        count += 1;
    }
    assert!(count >= 9, "{count} statuses");
}

/// Uses every struct, so that safer-ffi writes them all into its header.
#[safer_ffi::ffi_export]
fn vg_abi_witness(
    _: &vg_camera,
    _: &vg_context_options,
    _: &vg_gaussian_arrays,
    _: &vg_gradients,
    _: &vg_image_target,
    _: &vg_model_options,
    _: &vg_options,
) {
}

/// Uses the remaining structs, because a safer-ffi function takes few arguments.
#[safer_ffi::ffi_export]
fn vg_abi_witness_more(
    _: &vg_image_gradient,
    _: &vg_render_options,
    _: &vg_renderer_options,
    _: &vg_report_figures,
    _: &vg_scene_options,
    _: &vg_segment_options,
    _: &vg_view,
) {
}

/// Uses the structs of the metrics.
#[safer_ffi::ffi_export]
fn vg_abi_witness_metrics(
    _: &vg_metrics_options,
    _: &vg_picture_errors,
    _: &vg_view_errors,
    _: &vg_surface_errors,
) {
}

/// Uses the structs of the refinement.
#[safer_ffi::ffi_export]
fn vg_abi_witness_refine(_: &vg_refine_options, _: &vg_refinement) {}

/// Uses the structs of the alignment.
#[safer_ffi::ffi_export]
fn vg_abi_witness_align(_: &vg_align_options, _: &vg_alignment) {}

/// safer-ffi derives each struct's C form from the compiled type, by traits that only FFI-safe types have; cbindgen
/// reads the source text. The two are independent.
#[test]
fn a_second_generator_writes_a_header_of_the_golden_layout() {
    if !cfg!(target_arch = "x86_64") || !tools::have(&tools::cc(), "gcc", "the second header") {
        return;
    }
    let folder = tools::scratch();
    let header = folder.path().join("witness.h");
    safer_ffi::headers::builder().to_file(&header).unwrap().generate().unwrap();
    let contents = Contents::of(&std::fs::read_to_string(&header).unwrap());
    assert_eq!(contents.printed_by(&tools::cc(), "c11", &header), golden_layout());
}

/// Calls a function with a pointer for its error.
type Call = Box<dyn Fn(*mut *mut vg_error) -> Outcome>;

/// Each function with arbitrary arguments, because the panic comes first. Status functions get an error pointer.
fn every_function() -> Vec<(&'static str, Call)> {
    macro_rules! functions {
        ($($name:ident ( $($argument:expr),* ) $kind:ident;)*) => { vec![$((
            stringify!($name),
            Box::new(|error: *mut *mut vg_error| {
                let _ = error;
                functions!(@call $kind, error, $name($($argument),*))
            }) as Call,
        )),*] };
        (@call reports, $error:ident, $name:ident($($argument:expr),*)) => {
            Outcome::Status(unsafe { $name($($argument,)* $error) })
        };
        (@call status, $error:ident, $name:ident($($argument:expr),*)) => {
            Outcome::Silent(unsafe { $name($($argument),*) })
        };
        (@call value, $error:ident, $name:ident($($argument:expr),*)) => {
            Outcome::Value(unsafe { $name($($argument),*) } as usize)
        };
        (@call text, $error:ident, $name:ident($($argument:expr),*)) => {
            Outcome::Text(unsafe { CStr::from_ptr($name($($argument),*)) })
        };
        (@call none, $error:ident, $name:ident($($argument:expr),*)) => {{
            unsafe { $name($($argument),*) };
            Outcome::Value(0)
        }};
    }
    functions! {
        vg_status_name(1) text;
        vg_error_message(null()) text;
        vg_error_free(null_mut()) none;
        vg_context_options_init(null_mut(), 0) status;
        vg_context_new(null(), null_mut()) reports;
        vg_context_threads(null()) value;
        vg_context_free(null_mut()) none;
        vg_default_context_free() none;
        vg_camera_init(null_mut(), 0) status;
        vg_camera_from_colmap_model(0, null(), 0, 0, 0, null(), null_mut()) reports;
        vg_camera_from_opencv(null(), null(), 0, 0, 0, 0, null(), null_mut()) reports;
        vg_camera_scale(null(), 0, 0, null_mut()) reports;
        vg_camera_crop(null(), 0, 0, 0, 0, null_mut()) reports;
        vg_camera_project(null(), null(), null_mut()) reports;
        vg_pose_from_colmap(null(), null(), null(), null_mut()) reports;
        vg_pose_from_opengl(null(), null(), null_mut()) reports;
        vg_pose_from_opencv(null(), null(), null(), null_mut()) reports;
        vg_pose_from_box(null(), null(), null_mut()) reports;
        vg_pose_look_at(null(), null(), null(), null_mut()) reports;
        vg_camera_look_at(null(), null(), null(), 0.0, 0, 0, null_mut()) reports;
        vg_cameras_turntable(null(), 0, 0.0, 0.0, 0, 0, null_mut()) reports;
        vg_camera_project_points(null(), null(), 0, null_mut(), null_mut()) reports;
        vg_camera_unproject(null(), null(), 0.0, null_mut()) reports;
        vg_camera_unproject_points(null(), null(), null(), 0, null_mut()) reports;
        vg_view_init(null_mut(), 0) status;
        vg_model_options_init(null_mut(), 0) status;
        vg_model_open(null(), null(), null_mut()) reports;
        vg_model_free(null_mut()) none;
        vg_options_init(null_mut(), 0) status;
        vg_report_figures_init(null_mut(), 0) status;
        vg_report_get_figures(null(), null_mut()) reports;
        vg_report_json(null()) text;
        vg_report_reason(null(), 0) text;
        vg_report_point_count(null()) value;
        vg_report_point_positions(null()) value;
        vg_report_point_colors(null()) value;
        vg_report_free(null_mut()) none;
        vg_gaussian_arrays_init(null_mut(), 0) status;
        vg_gaussians_count(null()) value;
        vg_gaussians_sh_degree(null()) value;
        vg_gaussians_positions(null()) value;
        vg_gaussians_scales(null()) value;
        vg_gaussians_rotations(null()) value;
        vg_gaussians_opacities(null()) value;
        vg_gaussians_sh(null()) value;
        vg_gaussians_load_ply(null(), null_mut()) reports;
        vg_gaussians_save_ply(null(), null()) reports;
        vg_gaussians_from_arrays(null(), null_mut()) reports;
        vg_gaussians_transform(null(), null(), null_mut()) reports;
        vg_gaussians_mirror(null(), null_mut()) reports;
        vg_gaussians_merge(null(), null(), null_mut()) reports;
        vg_gaussians_select(null(), null(), 0, null_mut()) reports;
        vg_gaussians_mask(null(), null(), 0, null_mut()) reports;
        vg_gaussians_crop(null(), null(), null(), null_mut()) reports;
        vg_gaussians_covariances(null(), null_mut(), 0) reports;
        vg_gaussians_load_ply_memory(null(), 0, null_mut()) reports;
        vg_gaussians_ply_size(null()) value;
        vg_gaussians_save_ply_memory(null(), null_mut(), 0) reports;
        vg_gaussians_free(null_mut()) none;
        vg_reconstruct(null(), 0, null(), null_mut(), null_mut()) reports;
        vg_refine_options_init(null_mut(), 0) status;
        vg_refinement_init(null_mut(), 0) status;
        vg_refine(null(), null(), 0, null(), null_mut(), null_mut()) reports;
        vg_render_options_init(null_mut(), 0) status;
        vg_image_target_init(null_mut(), 0) status;
        vg_render(null(), null(), null(), null()) reports;
        vg_renderer_options_init(null_mut(), 0) status;
        vg_renderer_new(null(), null(), null_mut()) reports;
        vg_renderer_render(null(), null(), 0, null(), null()) reports;
        vg_renderer_backend(null()) value;
        vg_renderer_choice(null()) text;
        vg_renderer_free(null_mut()) none;
        vg_image_gradient_init(null_mut(), 0) status;
        vg_gradients_init(null_mut(), 0) status;
        vg_render_backward(null(), null(), null(), null(), null(), null()) reports;
        vg_segment_options_init(null_mut(), 0) status;
        vg_segment(null(), null(), null(), null(), null_mut(), 0) reports;
        vg_metrics_options_init(null_mut(), 0) status;
        vg_picture_errors_init(null_mut(), 0) status;
        vg_view_errors_init(null_mut(), 0) status;
        vg_surface_errors_init(null_mut(), 0) status;
        vg_metrics_pictures(null(), null(), null(), null_mut()) reports;
        vg_metrics_view(null(), null(), null(), null_mut()) reports;
        vg_metrics_surface(null(), null(), 0, null(), null_mut()) reports;
        vg_align_options_init(null_mut(), 0) status;
        vg_alignment_init(null_mut(), 0) status;
        vg_align_scan(null(), 0, null(), 0, null(), 0, null(), null_mut()) reports;
        vg_align_box(null(), 0, null(), 0, null(), null(), null_mut()) reports;
        vg_align_points(null(), null(), 0, null_mut(), null_mut(), null_mut()) reports;
        vg_align_folder(null(), null(), null(), null_mut()) reports;
        vg_scene_options_init(null_mut(), 0) status;
        vg_colmap_open(null(), null(), null_mut()) reports;
        vg_transforms_open(null(), null(), null_mut()) reports;
        vg_scene_view_count(null()) value;
        vg_scene_get_view(null(), 0, null_mut()) reports;
        vg_scene_free(null_mut()) none;
        vg_error_code(null()) status;
    }
}

/// Result of a function.
enum Outcome {
    /// A status with an error object.
    Status(vg_status),
    /// A status without an error object.
    Silent(vg_status),
    Value(usize),
    Text(&'static CStr),
}

#[test]
fn a_panic_in_any_function_comes_back_as_a_status_with_its_place() {
    for (name, call) in every_function() {
        let mut error = null_mut();
        injection::arm();
        let outcome = call(&raw mut error);
        assert!(!injection::is_armed(), "{name} has no guard");
        match outcome {
            Outcome::Status(status) => {
                assert_eq!(status, vg_status::Internal, "{name}");
                let message = unsafe { CStr::from_ptr(vg_error_message(error)) }.to_str().unwrap();
                assert!(message.contains("injected") && message.contains("guard.rs:"), "{name}: {message}");
                unsafe { vg_error_free(error) };
            }
            Outcome::Silent(status) => assert_eq!(status, vg_status::Internal, "{name}"),
            Outcome::Value(value) => assert_eq!(value, 0, "{name}"),
            Outcome::Text(text) => assert!(text.is_empty(), "{name}"),
        }
    }
}

#[test]
fn no_function_is_missing_from_that_list() {
    let header = std::fs::read_to_string(vg_testing::root().join("include/vg.h")).unwrap();
    let declared = contents::functions(&header);
    let mut listed: BTreeSet<String> = every_function().iter().map(|(name, _)| (*name).to_owned()).collect();
    // These return constants and cannot panic.
    listed.extend(["vg_version", "vg_abi_version"].map(str::to_owned));
    assert_eq!(listed, declared);
}

fn message_of(body: impl FnOnce() -> vg::Result<()>) -> (vg_status, String) {
    let mut error = null_mut();
    let status = unsafe { guarded(&raw mut error, body) };
    let message = unsafe { CStr::from_ptr(vg_error_message(error)) }.to_str().unwrap().to_owned();
    unsafe { vg_error_free(error) };
    (status, message)
}

#[test]
fn a_panic_on_a_worker_thread_keeps_its_message_and_its_place() {
    let (status, message) = message_of(|| {
        Threads::new(2)?.run(|| {
            rayon::join(|| (), || panic!("on a worker, number {}", 7));
        });
        Ok(())
    });
    assert_eq!(status, vg_status::Internal);
    assert!(message.contains("on a worker, number 7 (") && message.contains("tests.rs:"), "{message}");
}

#[test]
fn a_panic_without_words_still_has_a_message() {
    let (status, message) = message_of(|| std::panic::panic_any(7));
    assert_eq!(status, vg_status::Internal);
    assert!(message.contains("panic without a message"), "{message}");
}

/// Run by the next test in a separate process.
#[test]
#[ignore = "prints nothing, which only another process can see"]
fn panics_quietly() {
    a_panic_in_any_function_comes_back_as_a_status_with_its_place();
    a_panic_on_a_worker_thread_keeps_its_message_and_its_place();
}

#[test]
fn a_panic_prints_nothing() {
    let mut child = std::process::Command::new(std::env::current_exe().unwrap());
    child.args(["--exact", "capi::tests::panics_quietly", "--ignored", "--nocapture", "--test-threads=1"]);
    let output = tools::output(&mut child);
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success() && out.contains("1 passed"), "{out}{err}");
    assert!(err.is_empty() && !out.contains("injected") && !out.contains("on a worker"), "{out}{err}");
}

#[test]
fn panics_elsewhere_still_reach_the_hosts_hook() {
    let mut child = std::process::Command::new(std::env::current_exe().unwrap());
    child.args(["--exact", "capi::tests::panics_outside_the_guard", "--ignored", "--nocapture"]);
    let output = tools::output(&mut child);
    let err = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && err.contains("the host's own"), "{err}");
}

/// Run by the previous test in a separate process.
#[test]
#[ignore = "panics, in a process of its own"]
fn panics_outside_the_guard() {
    assert_eq!(message_of(|| Ok(())).0, vg_status::Ok);
    panic!("the host's own");
}
