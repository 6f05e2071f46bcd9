//! Behaviour of the functions with NULL, zero, bad numbers and sizes: a table of calls, each with one wrong or unusual
//! argument. `calls` has the functions and their arguments, and checks the promises that hold for every call.
#![allow(unsafe_code)]

use crate::symbols::declared;
use calls::{
    Call, Done, FEW, FIRST_SIZES, Made, Memory, Outcome, Value, World, bits32, blank, bytes_of, text,
};
use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;
use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr::{null, null_mut};
use vg_face::capi::*;
use vg_testing::tools::scratch;
use vg_testing::{root, vehicle};

mod calls;

/// Guard bytes on either side of all lent memory.
pub(crate) const GUARD: usize = 64;

/// The expected result of a row.
#[derive(Clone, Debug)]
enum Expect {
    Fine,
    /// `VG_STATUS_ARGUMENT`, and this text in the message.
    Refused(String),
    Fails(vg_status, String),
}
use Expect::{Fails, Fine};

fn refused(words: &str) -> Expect {
    Expect::Refused(words.into())
}

/// The rows, and the world in which they run.
struct Table {
    world: World,
    rows: usize,
    functions: BTreeSet<&'static str>,
    _folder: tempfile::TempDir,
}

impl Table {
    fn new() -> Self {
        Self::on_threads(2)
    }

    fn on_threads(threads: u32) -> Self {
        let folder = scratch();
        let world = World::on_threads(threads, &root().join("tests/data/sedan"), folder.path());
        Self { world, rows: 0, functions: BTreeSet::new(), _folder: folder }
    }

    /// Makes a call twice, with `out_error` and without.
    #[track_caller]
    fn row(
        &mut self,
        make: fn(&World) -> Call,
        what: &str,
        tweak: impl Fn(&mut Call),
        expect: Expect,
    ) -> Done {
        self.row_of(&|w| make(w), what, tweak, expect)
    }

    #[track_caller]
    fn row_of(
        &mut self,
        make: &dyn Fn(&World) -> Call,
        what: &str,
        tweak: impl Fn(&mut Call),
        expect: Expect,
    ) -> Done {
        let [done, without] = [true, false].map(|with_error| {
            let mut call = make(&self.world);
            tweak(&mut call);
            self.functions.insert(call.function);
            call.run(with_error)
        });
        self.rows += 1;
        let function = make(&self.world).function;
        let found = format!("{function}, {what}: {:?} {}", done.status, done.message);
        let (status, words) = match expect {
            Fine => (make(&self.world).good, String::new()),
            Expect::Refused(words) => (vg_status::Argument, words),
            Fails(status, words) => (status, words),
        };
        assert_eq!(done.status, status, "{found}");
        assert_eq!(without.status, status, "{found}: another status without out_error");
        // `_init` functions have no message.
        let silent = function.ends_with("_init");
        assert!(silent || done.message.contains(&words), "{found}: no \"{words}\"");
        done
    }

    /// Adds the rows that follow from the kind of an argument.
    fn generic_rows(&mut self, make: fn(&World) -> Call) {
        self.row(make, "as it is", |_| {}, Fine);
        let valid = make(&self.world);
        for (i, argument) in valid.arguments.iter().enumerate() {
            let (name, word) = (argument.name, argument.word);
            match &argument.value {
                Value::Number(_) => {
                    for &(bits, outcome) in &argument.tries {
                        let what = format!("{name} {}", bits.cast_signed());
                        let set = |call: &mut Call| call.arguments[i].value = Value::Number(bits);
                        self.row(make, &what, set, expected(outcome, word.into()));
                    }
                    continue;
                }
                Value::Doubles(values) => {
                    for (k, &(bits, outcome)) in
                        (0..values.len()).flat_map(|k| argument.tries.iter().map(move |t| (k, t)))
                    {
                        let what = format!("{name}[{k}] = {}", f64::from_bits(bits));
                        let set = |call: &mut Call| call.doubles(name)[k] = f64::from_bits(bits);
                        self.row(make, &what, set, expected(outcome, word.into()));
                    }
                }
                Value::Struct(_) => self.struct_rows(make, name),
                Value::OutStruct(_) if SIZED.contains(&valid.function) => self.size_rows(make, name),
                _ => {}
            }
            let expect = if argument.nullable { Fine } else { refused(name) };
            self.row(make, &format!("{name} NULL"), |call| call.arguments[i].value = Value::Null, expect);
        }
    }

    fn size_rows(&mut self, make: fn(&World) -> Call, name: &'static str) {
        let lent = make(&self.world).lent(name).clone();
        let element = if lent.is_array { format!("{name}[0]") } else { name.to_owned() };
        let size = lent.stride;
        let first = FIRST_SIZES.iter().find(|(of, _)| *of == lent.of).expect("a struct that says its size").1;
        for short in [0, 1, 7, 8, first - 1] {
            let expect = refused(&format!("{element}.struct_size"));
            self.row(
                make,
                &format!("{name} of {short} bytes"),
                |call| call.lent(name).resize(short, 0),
                expect,
            );
        }
        for (long, fill, expect) in [
            (first, 0, Fine),
            (size + 8, 0, Fine),
            (size + 64, 0, Fine),
            (4096, 0, Fine),
            (size + 8, 1, if SIZED.contains(&make(&self.world).function) { Fine } else { refused(name) }),
        ] {
            let what = format!("{name} of {long} bytes, {fill} behind");
            self.row(make, &what, |call| call.lent(name).resize(long, fill), expect);
        }
        for huge in [4097, usize::MAX / 2, usize::MAX] {
            let expect = refused(&format!("{element}.struct_size"));
            self.row(make, &format!("{name} says {huge}"), |call| call.lent(name).claim(0, huge), expect);
        }
        for shift in [1, 4] {
            self.row(make, &format!("{name} off by {shift}"), |call| call.lent(name).shift = shift, Fine);
        }
    }

    fn struct_rows(&mut self, make: fn(&World) -> Call, name: &'static str) {
        self.size_rows(make, name);
        let lent = make(&self.world).lent(name).clone();
        let element = if lent.is_array { format!("{name}[0]") } else { name.to_owned() };
        for field in &lent.fields {
            for (k, &(bits, outcome)) in
                (0..field.count).flat_map(|k| field.tries.iter().map(move |t| (k, t)))
            {
                let what = format!("{name}.{}[{k}] = {bits:#x}", field.name);
                let words = [element.as_str(), field.word.as_str()].into_iter().filter(|w| !w.is_empty());
                let words = words.collect::<Vec<_>>().join(".");
                // The error has the full name `target.size`.
                let words = if field.word.starts_with(name) { field.word.clone() } else { words };
                let set = |call: &mut Call| call.lent(name).put(&field.name, k, bits);
                // The error for a reserved number names its array.
                self.row(make, &what, set, expected(outcome, words));
            }
        }
    }
}

impl Drop for Table {
    fn drop(&mut self) {
        println!("{} rows", self.rows);
    }
}

fn expected(outcome: Outcome, words: String) -> Expect {
    match outcome {
        Outcome::Fine => Fine,
        Outcome::Refused => Expect::Refused(words),
        Outcome::NotBuilt => Fails(vg_status::NotBuilt, words),
    }
}

/// Functions that fill a struct up to its `struct_size`.
const SIZED: [&str; 2] = ["vg_report_get_figures", "vg_scene_get_view"];

/// Functions that cannot fail, all called by `functions_that_cannot_fail_accept_null`.
const NEVER_FAIL: [&str; 30] = [
    "vg_version",
    "vg_abi_version",
    "vg_status_name",
    "vg_error_code",
    "vg_error_message",
    "vg_error_free",
    "vg_context_threads",
    "vg_context_free",
    "vg_default_context_free",
    "vg_report_json",
    "vg_report_reason",
    "vg_report_point_count",
    "vg_report_point_positions",
    "vg_report_point_colors",
    "vg_report_free",
    "vg_gaussians_count",
    "vg_gaussians_sh_degree",
    "vg_gaussians_positions",
    "vg_gaussians_scales",
    "vg_gaussians_rotations",
    "vg_gaussians_opacities",
    "vg_gaussians_sh",
    "vg_gaussians_ply_size",
    "vg_gaussians_free",
    "vg_renderer_backend",
    "vg_renderer_choice",
    "vg_renderer_free",
    "vg_scene_view_count",
    "vg_scene_free",
    "vg_model_free",
];

#[test]
fn every_argument_and_field_of_every_function_is_checked() {
    let mut table = Table::new();
    for make in calls::CALLS {
        table.generic_rows(make);
    }
    let mut all: BTreeSet<String> = table.functions.iter().map(|&f| f.to_owned()).collect();
    assert!(NEVER_FAIL.iter().all(|&f| all.insert(f.to_owned())));
    assert_eq!(all, declared(), "the table has every function of the header");
    assert!(table.rows > 1000, "{} rows", table.rows);
}

#[test]
fn functions_that_cannot_fail_accept_null() {
    unsafe {
        assert_eq!(CStr::from_ptr(vg_version()).to_str(), Ok(env!("CARGO_PKG_VERSION")));
        assert_eq!(vg_abi_version(), VG_ABI_VERSION);
        assert_eq!(vg_error_code(null()), vg_status::Ok);
        assert_eq!(CStr::from_ptr(vg_status_name(1)), c"VG_STATUS_ARGUMENT");
        assert_eq!(CStr::from_ptr(vg_status_name(-7)), c"");
        assert_eq!(vg_gaussians_ply_size(null()), 0);
        assert_eq!(CStr::from_ptr(vg_error_message(null())), c"");
        assert_eq!(CStr::from_ptr(vg_report_json(null())), c"");
        assert_eq!(CStr::from_ptr(vg_report_reason(null(), 0)), c"");
        assert_eq!(vg_context_threads(null()), 0);
        assert_eq!(vg_report_point_count(null()), 0);
        assert!(vg_report_point_positions(null()).is_null() && vg_report_point_colors(null()).is_null());
        assert_eq!((vg_gaussians_count(null()), vg_gaussians_sh_degree(null())), (0, 0));
        for array in [
            vg_gaussians_positions,
            vg_gaussians_scales,
            vg_gaussians_rotations,
            vg_gaussians_opacities,
            vg_gaussians_sh,
        ] {
            assert!(array(null()).is_null());
        }
        assert_eq!(vg_renderer_backend(null()), vg_backend::Auto as i32);
        assert_eq!(CStr::from_ptr(vg_renderer_choice(null())), c"");
        assert_eq!(vg_scene_view_count(null()), 0);
        vg_renderer_free(null_mut());
        vg_error_free(null_mut());
        vg_context_free(null_mut());
        vg_default_context_free();
        vg_report_free(null_mut());
        vg_gaussians_free(null_mut());
        vg_scene_free(null_mut());
        vg_model_free(null_mut());
    }
}

#[test]
fn init_functions_fill_struct_size_bytes_and_none_beyond() {
    let mut table = Table::new();
    for make in calls::CALLS {
        let valid = make(&table.world);
        if !valid.function.ends_with("_init") {
            continue;
        }
        let name = valid.arguments[0].name;
        let Value::OutStruct(lent) = &valid.arguments[0].value else { panic!("a struct") };
        let size = lent.stride;
        let whole = table.row(make, "whole", |_| {}, Fine).memory[0].take().unwrap();
        let first = FIRST_SIZES.iter().find(|(of, _)| *of == lent.of).expect("a struct that says its size").1;
        for (told, there) in [(first, size + 40), (size, size + 40), (size + 8, size + 40), (4096, 4096)] {
            let tell = |call: &mut Call| {
                call.lent(name).bytes = vec![calls::CANARY; there];
                call.set("size", Value::Number(told as u64));
            };
            for shift in [0, 1] {
                let shifted = |call: &mut Call| {
                    tell(call);
                    call.lent(name).shift = shift;
                };
                let mut done = table.row(make, &format!("size {told}"), shifted, Fine);
                let memory = done.memory[0].take().unwrap();
                let bytes = memory.content();
                assert_eq!(bytes[..8], told.to_ne_bytes());
                let known = size.min(told);
                assert_eq!(bytes[8..known], whole.content()[8..known]);
                assert!(
                    bytes[known..told].iter().all(|&b| b == 0),
                    "what this library does not know is zero"
                );
                assert!(bytes[told..].iter().all(|&b| b == calls::CANARY), "written beyond {told} bytes");
            }
        }
    }
}

/// Modified copies of [`IDENTITY`] that are not rotations.
fn no_rotations() -> [[f64; 12]; 5] {
    let change = |entries: &[(usize, f64)]| {
        let mut pose = IDENTITY;
        entries.iter().for_each(|&(i, v)| pose[i] = v);
        pose
    };
    [
        change(&[(5, -1.0)]),
        change(&[(0, 2.0), (5, 2.0), (10, 2.0)]),
        change(&[(1, 0.5)]),
        change(&[(0, 0.0), (5, 0.0), (10, 0.0)]),
        change(&[(0, 1e200), (5, 1e200), (10, 1e200)]),
    ]
}

const IDENTITY: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// 4x4 matrices that are not similarities.
fn no_similarities() -> Vec<[f64; 16]> {
    let mut all: Vec<[f64; 16]> = Vec::new();
    for pose in no_rotations() {
        let mut matrix = [0.0; 16];
        matrix[..12].copy_from_slice(&pose);
        matrix[15] = 1.0;
        // A scale is allowed.
        if pose[0] != 2.0 && pose[0] != 1e200 {
            all.push(matrix);
        }
    }
    for (i, value) in [(12, 1e-9), (14, 1.0), (15, 0.0), (15, 2.0), (15, f64::NAN)] {
        let mut matrix = [0.0; 16];
        matrix[..12].copy_from_slice(&IDENTITY);
        matrix[15] = 1.0;
        matrix[i] = value;
        all.push(matrix);
    }
    all
}

#[test]
fn mirrors_scales_and_shears_are_not_poses() {
    let mut table = Table::new();
    for pose in no_rotations() {
        let what = format!("pose {pose:?}");
        for (make, name) in [
            (calls::camera_from_colmap_model as fn(&World) -> Call, "vehicle_from_camera"),
            (calls::camera_from_opencv, "vehicle_from_camera"),
            (calls::pose_from_opengl, "camera_to_world"),
            (calls::pose_from_box, "vehicle_in_ego"),
            (calls::pose_from_box, "camera_in_ego"),
        ] {
            table.row(make, &what, |call| call.doubles(name).copy_from_slice(&pose), refused(name));
        }
        let put = |call: &mut Call, argument: &str, field: &str| {
            for (k, value) in pose.iter().enumerate() {
                call.lent(argument).put(field, k, value.to_bits());
            }
        };
        for make in [
            calls::camera_scale as fn(&World) -> Call,
            calls::camera_project,
            calls::camera_unproject_points,
            calls::render,
        ] {
            let words = refused("camera.vehicle_from_camera");
            table.row(make, &what, |call| put(call, "camera", "vehicle_from_camera"), words);
        }
        let words = refused("views[0].camera.vehicle_from_camera");
        table.row(calls::reconstruct, &what, |call| put(call, "views", "camera.vehicle_from_camera"), words);
    }
    for matrix in no_similarities() {
        let what = format!("similarity {matrix:?}");
        for (make, name) in [
            (calls::pose_from_colmap as fn(&World) -> Call, "vehicle_from_world"),
            (calls::pose_from_opengl, "vehicle_from_world"),
            (calls::pose_from_opencv, "vehicle_from_world"),
            (calls::gaussians_transform, "to_from_vehicle"),
        ] {
            table.row(make, &what, |call| call.doubles(name).copy_from_slice(&matrix), refused(name));
        }
        for make in [calls::colmap_open as fn(&World) -> Call, calls::transforms_open] {
            let point = |call: &mut Call| {
                let mut memory = Memory::from_values(&matrix, 1);
                call.lent("options").put("vehicle_from_world", 0, memory.pointer() as u64);
                call.inputs.push(memory);
            };
            table.row(make, &what, point, refused("options.vehicle_from_world"));
        }
    }
    // Written with three digits, and none at all.
    table.row(calls::pose_from_opengl, "noise", |call| call.doubles("camera_to_world")[0] = 1e-3, Fine);
    let zero = |call: &mut Call| call.doubles("qvec").fill(0.0);
    table.row(calls::pose_from_colmap, "qvec 0", zero, refused("qvec"));
}

#[test]
fn numbers_that_overflow_are_refused_and_not_returned() {
    let mut table = Table::new();
    let far = 1.7e308;
    let tvec = |call: &mut Call| call.doubles("tvec").fill(far);
    table.row(calls::pose_from_colmap, "far, then scaled", tvec, refused("pose"));
    let world = |call: &mut Call| call.doubles("camera_to_world")[3] = far;
    table.row(calls::pose_from_opengl, "far, then scaled", world, refused("pose"));
    let apart = |call: &mut Call| {
        call.doubles("vehicle_in_ego")[3] = far;
        call.doubles("camera_in_ego")[3] = -far;
    };
    table.row(calls::pose_from_box, "far apart", apart, refused("pose"));

    let point =
        |values: [f64; 3]| move |call: &mut Call| call.doubles("point_vehicle").copy_from_slice(&values);
    for values in [[far, far, far], [1e308, -1e308, 0.0], [1e300, 1e300, 1e300]] {
        let mut call = calls::camera_project(&table.world);
        point(values)(&mut call);
        call.run(true);
    }
    // The camera looks from (distance cos, distance sin) at the middle: twice the middle is behind it.
    table.row(calls::camera_project, "behind", point([10.0, -10.0, 1.6]), refused("point_vehicle"));
    let at = vehicle::camera(-40.0, 6.5, 4, 4).center();
    table.row(calls::camera_project, "on the plane", point(at.to_array()), refused("point_vehicle"));

    table.row(calls::pose_from_opencv, "far, then scaled", tvec, refused("pose"));
    let turned = |call: &mut Call| call.doubles("rvec").fill(far);
    table.row(calls::pose_from_opencv, "no angle", turned, refused("rvec"));
    let beyond = |call: &mut Call| {
        call.set("depth_m", Value::Number(far.to_bits()));
        call.doubles("pixel")[0] = 1e300;
    };
    table.row(calls::camera_unproject, "beyond all numbers", beyond, refused("pixel"));

    // A float32 of 16 km does not resolve a millimetre.
    let utm = |call: &mut Call| call.doubles("to_from_vehicle")[3] = 5e6;
    table.row(calls::gaussians_transform, "UTM", utm, refused("to_from_vehicle"));
    for scale in [1e-60, 1e12, 1e60] {
        let matrix = |call: &mut Call| {
            for k in [1, 4, 10] {
                let sign = call.doubles("to_from_vehicle")[k].signum();
                call.doubles("to_from_vehicle")[k] = sign * scale;
            }
        };
        let expect = Fails(vg_status::Argument, String::new());
        table.row(calls::gaussians_transform, &format!("scale {scale}"), matrix, expect);
    }
}

/// `f64`s of an out array after a successful call.
fn numbers(done: &Done, argument: usize) -> Vec<f64> {
    done.memory[argument].as_ref().expect("memory").doubles()
}

#[test]
fn points_without_a_pixel_and_pixels_without_a_point_are_nan_between_the_others() {
    let table = Table::new();
    let world = &table.world;
    let mut call = calls::camera_project_points(world);
    let behind = vehicle::camera(-40.0, 6.5, 4, 4).center() * 2.0;
    let odd = [f64::NAN, 0.0, 0.0];
    let given = [[0.5, -0.25, 0.5], behind.to_array(), odd, [-1.0, 0.25, 0.0]];
    call.set("points", Value::Doubles(given.concat()));
    call.set("count", Value::Number(4));
    // Memory with numbers that are not finite does not fit the table's kinds of argument.
    let (mut pixels, mut depths) = ([7.0f64; 8], [7.0f64; 4]);
    call.set("out_pixels", Value::Handle(pixels.as_mut_ptr().expose_provenance()));
    call.set("out_depths", Value::Handle(depths.as_mut_ptr().expose_provenance()));
    assert!(call.run(true).is_ok());
    assert!(pixels[2..6].iter().all(|v| v.is_nan()) && depths[1..3].iter().all(|v| v.is_nan()));
    let one = calls::camera_project(world).run(true);
    assert_eq!(pixels[..2], numbers(&one, 2)[..]);

    let mut call = calls::camera_unproject_points(world);
    call.set("pixels", Value::Doubles(pixels.to_vec()));
    call.set("depths", Value::Doubles(depths.to_vec()));
    call.set("count", Value::Number(4));
    let mut points = [7.0f64; 12];
    call.set("out_points", Value::Handle(points.as_mut_ptr().expose_provenance()));
    assert!(call.run(true).is_ok());
    assert!(points[3..9].iter().all(|v| v.is_nan()));
    for (found, given) in points.iter().zip(given.concat()) {
        assert!(found.is_nan() || (found - given).abs() < 1e-12, "{points:?}");
    }
}

#[test]
fn every_index_and_every_file_in_memory_is_checked() {
    let mut table = Table::new();
    let indices = |values: [usize; 4]| {
        move |call: &mut Call| {
            let mut memory = Memory::from_values(&values, 0);
            call.set("indices", Value::Handle(memory.pointer()));
            call.inputs.push(memory);
        }
    };
    let select = calls::gaussians_select;
    table.row(select, "the last", indices([0, 1, 2, 2]), Fine);
    table.row(select, "one beyond", indices([0, 1, 2, 3]), refused("indices[3]: 3"));
    table.row(select, "far beyond", indices([usize::MAX, 0, 0, 0]), refused("indices[0]"));
    let none = |call: &mut Call| {
        call.set("indices", Value::Null);
        call.set("index_count", Value::Number(0));
    };
    table.row(select, "none", none, Fine);

    let load = calls::gaussians_load_ply_memory;
    let whole = bytes(table.row(load, "as it is", |_| {}, Fine).handle("out"));
    assert_eq!(whole, bytes(table.row(calls::gaussians_load_ply, "the file", |_| {}, Fine).handle("out")));
    for size in [0, 3, 100] {
        let cut = |call: &mut Call| call.set("size", Value::Number(size));
        let told = Fails(vg_status::Format, "PLY in memory: ".into());
        table.row(load, &format!("{size} bytes"), cut, told);
    }
    let mut save = calls::gaussians_save_ply_memory(&table.world);
    assert!(save.run(true).is_ok());
    assert_eq!(save.targets[0].memory.content(), std::fs::read(table.world.scratch.join("few.ply")).unwrap());
}

#[test]
fn cameras_of_every_model_are_read_with_the_number_of_parameters_of_the_model() {
    let mut table = Table::new();
    for (model, count) in [(0, 3), (1, 4), (2, 4), (3, 5), (4, 8), (5, 8), (6, 12)] {
        let params: Vec<f64> = [50.0, 50.0, 24.0, 18.0].into_iter().chain([1e-3; 8]).take(count).collect();
        let set = |call: &mut Call| {
            call.set("model", Value::Number(model));
            call.set("params", Value::Doubles(params.clone()));
            call.set("param_count", Value::Number(count as u64));
        };
        table.row(calls::camera_from_colmap_model, &format!("model {model}"), set, Fine);
        let in_struct = |extra: f64| {
            let mut params = params.clone();
            params.resize(16, 0.0);
            if count < 16 {
                params[count] = extra;
            }
            move |call: &mut Call| {
                call.lent("camera").put("model", 0, model);
                for (k, p) in params.iter().enumerate() {
                    call.lent("camera").put("params", k, p.to_bits());
                }
            }
        };
        for make in [calls::camera_scale as fn(&World) -> Call, calls::render] {
            table.row(make, &format!("model {model}"), in_struct(0.0), Fine);
            let words = refused(&format!("camera.params[{count}]"));
            table.row(make, &format!("model {model}, one more"), in_struct(1e-9), words);
        }
    }
    for (k, value) in [(0, 0.0), (0, -50.0), (1, 1e-4), (1, 1e10), (2, 1e10), (3, -1e10)] {
        let put = |call: &mut Call| call.lent("camera").put("params", k, f64::to_bits(value));
        table.row(calls::camera_project, &format!("params[{k}] = {value}"), put, refused("camera."));
    }
    let inner =
        |size: usize| move |call: &mut Call| call.lent("views").put("camera.struct_size", 0, size as u64);
    for size in [0, 279, 288, usize::MAX] {
        let words = refused("views[0].camera.struct_size");
        table.row(calls::reconstruct, &format!("inner camera of {size} bytes"), inner(size), words);
    }
}

#[test]
fn distortion_has_the_lengths_that_opencv_allows() {
    let mut table = Table::new();
    for count in 0..16usize {
        for fisheye in [0, 1] {
            let mut values = vec![1e-3; count.min(8)];
            values.resize(count, 0.0);
            let set = |call: &mut Call| {
                call.set("distortion", Value::Doubles(values.clone()));
                call.set("distortion_count", Value::Number(count as u64));
                call.set("fisheye", Value::Number(fisheye));
            };
            let allowed: &[usize] = if fisheye == 1 { &[0, 4] } else { &[0, 4, 5, 8, 12, 14] };
            let expect = if allowed.contains(&count) { Fine } else { refused("distortion") };
            table.row(calls::camera_from_opencv, &format!("{count} numbers"), set, expect);
        }
    }
    let none = |call: &mut Call| {
        call.set("distortion", Value::Null);
        call.set("distortion_count", Value::Number(0));
    };
    table.row(calls::camera_from_opencv, "NULL and 0", none, Fine);
    let tilted = |call: &mut Call| {
        call.set("distortion", Value::Doubles([vec![0.0; 13], vec![1e-3]].concat()));
        call.set("distortion_count", Value::Number(14));
    };
    table.row(calls::camera_from_opencv, "a tilted sensor", tilted, refused("distortion[13]"));
    for count in [1usize << 60, usize::MAX / 8 + 1, usize::MAX] {
        let set = |call: &mut Call| call.set("distortion_count", Value::Number(count as u64));
        table.row(calls::camera_from_opencv, &format!("{count} numbers"), set, refused("distortion"));
    }
    for (k, value) in [(1, 0.3), (3, 1e-3), (6, 1.0), (8, 2.0), (0, -1.0), (4, 0.0)] {
        table.row(
            calls::camera_from_opencv,
            &format!("k[{k}]"),
            |call| call.doubles("k")[k] = value,
            refused("camera"),
        );
    }
    // A `double *` that is NULL.
    for (make, name) in [
        (calls::camera_from_opencv as fn(&World) -> Call, "distortion"),
        (calls::camera_from_colmap_model, "params"),
    ] {
        let odd = |call: &mut Call| {
            let mut memory = Memory::from_values(&[50.0f64, 50.0, 24.0, 18.0], 4);
            call.set(name, Value::Handle(memory.pointer()));
            call.inputs.push(memory);
        };
        table.row(make, &format!("{name} off by 4"), odd, refused(name));
    }
}

const ARRAYS: [(&str, usize); 5] =
    [("positions", 3), ("scales", 3), ("rotations", 4), ("opacities", 1), ("sh", 3)];

#[test]
fn every_number_of_arrays_of_gaussians_is_checked() {
    let mut table = Table::new();
    let make = calls::gaussians_from_arrays;
    let empty = |call: &mut Call| {
        ARRAYS.iter().for_each(|(name, _)| call.lent("arrays").put(name, 0, 0));
        call.lent("arrays").put("count", 0, 0);
    };
    table.row(make, "none, all NULL", empty, Fine);
    table.row(make, "none", |call| call.lent("arrays").put("count", 0, 0), Fine);
    for (which, (name, each)) in ARRAYS.into_iter().enumerate() {
        let words = format!("arrays.{name}");
        table.row(make, &format!("{name} NULL"), |call| call.lent("arrays").put(name, 0, 0), refused(&words));
        for shift in [1, 2, 3] {
            let odd = |call: &mut Call| {
                let mut memory = Memory::from_values(FEW[which], shift);
                call.lent("arrays").put(name, 0, memory.pointer() as u64);
                call.inputs.push(memory);
            };
            table.row(make, &format!("{name} off by {shift}"), odd, refused(&words));
        }
        let only_aligned_to_floats = |call: &mut Call| {
            let mut memory = Memory::from_values(FEW[which], 4);
            call.lent("arrays").put(name, 0, memory.pointer() as u64);
            call.inputs.push(memory);
        };
        table.row(make, &format!("{name} off by 4"), only_aligned_to_floats, Fine);
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for i in 0..3 {
                let spoilt = |call: &mut Call| {
                    let mut values = FEW[which].to_vec();
                    values[i * each + each - 1] = bad;
                    let mut memory = Memory::from_values(&values, 0);
                    call.lent("arrays").put(name, 0, memory.pointer() as u64);
                    call.inputs.push(memory);
                };
                table.row(make, &format!("{name}[{i}] {bad}"), spoilt, refused(&format!("{words}[{i}]")));
            }
        }
    }
    let with = |which: usize, k: usize, value: f32| {
        move |call: &mut Call| {
            let mut values = FEW[which].to_vec();
            values[k] = value;
            let mut memory = Memory::from_values(&values, 0);
            call.lent("arrays").put(ARRAYS[which].0, 0, memory.pointer() as u64);
            call.inputs.push(memory);
        }
    };
    table.row(make, "a flat Gaussian", with(1, 4, 0.0), refused("arrays.scales[1]"));
    table.row(make, "a negative scale", with(1, 8, -0.1), refused("arrays.scales[2]"));
    table.row(make, "too opaque", with(3, 2, 1.0f32.next_up()), refused("arrays.opacities[2]"));
    table.row(make, "a negative opacity", with(3, 0, -1e-9), refused("arrays.opacities[0]"));
    table.row(make, "no rotation", with(2, 0, 0.0), refused("arrays.rotations[0]"));
    table.row(make, "far away", with(0, 0, 3e38), Fine);
    for degree in 0..4usize {
        let more = |call: &mut Call| {
            let mut memory = Memory::from_values(&vec![0.25f32; 3 * 3 * (degree + 1) * (degree + 1)], 0);
            call.lent("arrays").put("sh", 0, memory.pointer() as u64);
            call.lent("arrays").put("sh_degree", 0, degree as u64);
            call.inputs.push(memory);
        };
        table.row(make, &format!("degree {degree}"), more, Fine);
    }
    table.row(
        make,
        "degree 4",
        |call| call.lent("arrays").put("sh_degree", 0, 4),
        refused("arrays.sh_degree"),
    );
    table.row(
        calls::gaussians_merge,
        "one with itself",
        |call| call.arguments[1].value = Value::Handle(handle(call)),
        Fine,
    );
}

fn handle(call: &Call) -> usize {
    let Value::Handle(handle) = call.arguments[0].value else { panic!("a handle") };
    handle
}

#[test]
fn missing_and_malformed_files_are_errors_that_name_the_path() {
    let mut table = Table::new();
    let folder = table.world.scratch.clone();
    let junk = folder.join("junk.ply");
    let half = b"ply\nformat binary_little_endian 1.0\nelement vertex 3\n";
    std::fs::write(&junk, half).unwrap();
    let empty = folder.join("empty");
    std::fs::write(&empty, b"").unwrap();
    let path = |path: CString| move |call: &mut Call| call.set("path", Value::Text(path.clone()));
    let missing = CString::new(b"/nowhere/\xff\xfe/at all\nat all".to_vec()).unwrap();

    let load = calls::gaussians_load_ply;
    let (io, format) =
        (|words: &str| Fails(vg_status::Io, words.into()), |w: &str| Fails(vg_status::Format, w.into()));
    table.row(load, "a path that is not UTF-8", path(missing.clone()), io("/nowhere/"));
    table.row(load, "a folder", path(text(&folder)), io(folder.to_str().unwrap()));
    table.row(load, "half a header", path(text(&junk)), format("junk.ply"));
    table.row(load, "an empty file", path(text(&empty)), format("empty"));
    for (name, bytes, says) in [
        ("car.spz", &b"\x1f\x8b\x08\0"[..], "SPZ"),
        ("car.glb", b"glTF\x02", "GLB"),
        ("car.splat", &[0; 64], "splat-transform"),
    ] {
        let other = folder.join(name);
        std::fs::write(&other, bytes).unwrap();
        table.row(load, name, path(text(&other)), format(says));
    }

    let save = calls::gaussians_save_ply;
    table.row(save, "no such folder", path(missing.clone()), io("/nowhere/"));
    let spz = folder.join("new.spz");
    table.row(save, "another format's name", path(text(&spz)), Fails(vg_status::Argument, "path: ".into()));
    assert!(!spz.exists());
    table.row(save, "a folder", path(text(&folder)), format("is a folder"));
    table.row(save, "over an old file", path(text(&empty)), Fine);
    table.row(save, "no Gaussians", |call| call.arguments[0].value = Value::Handle(nothing()), Fine);
    assert_eq!(std::fs::read(&junk).unwrap(), half, "other files are as they were");

    for make in [calls::colmap_open as fn(&World) -> Call, calls::transforms_open] {
        table.row(make, "a path that is not UTF-8", path(missing.clone()), io("/nowhere/"));
        table.row(make, "junk", path(text(&junk)), Fails(vg_status::Format, "junk.ply".into()));
        table.row(
            make,
            "a folder without scenes",
            path(text(&folder)),
            Fails(vg_status::Format, String::new()),
        );
    }
    for make in [load as fn(&World) -> Call, save, calls::colmap_open, calls::transforms_open] {
        table.row(make, "no path", path(CString::default()), refused("path"));
        let long = CString::new(vec![b'x'; 100_000]).unwrap();
        table.row(make, "a long path", path(long), Fails(vg_status::Io, "xxx".into()));
    }
    let file = folder.join("few.ply").join("deeper.ply");
    table.row(save, "a file for a folder", path(text(&file)), io("deeper.ply"));
}

#[test]
fn photographs_without_masks_are_checked_before_the_network_is_required() {
    let mut table = Table::new();
    let make = calls::segment;
    let image = |change: fn(&mut vg_image)| {
        move |call: &mut Call| {
            let Value::Handle(at) = call.arguments[1].value else { panic!("a picture") };
            let mut image = unsafe { std::ptr::with_exposed_provenance::<vg_image>(at).read_unaligned() };
            change(&mut image);
            let mut memory = Memory::from_values(&[image], 1);
            call.set("image", Value::Handle(memory.pointer()));
            call.inputs.push(memory);
        }
    };
    table.row(make, "no pixels", image(|i| i.data = null()), refused("image.data"));
    table.row(make, "depth", image(|i| i.format = vg_format::Depth32f as i32), refused("image.format: 7"));
    table.row(make, "no format", image(|i| i.format = 0), refused("image.format: 0"));
    table.row(make, "flags", image(|i| i.flags = 1), refused("image.flags"));
    table.row(make, "no columns", image(|i| i.width = 0), refused("image: 0x36"));
    table.row(make, "too many rows", image(|i| i.height = 8193), refused("image: 48x8193"));
    table.row(make, "rows in one another", image(|i| i.row_stride = 143), refused("image.row_stride"));
    let close = |call: &mut Call| call.set("row_stride", Value::Number(0));
    // Nothing is written without a network, so the memory may be larger than rows without gaps.
    table.row(make, "rows without gaps", close, Fine);
    let words = if vg::onnx::is_built() { "model: NULL" } else { "build with the feature onnx" };
    let status = calls::segment(&table.world).good;
    table.row(make, "no model", |_| {}, Fails(status, words.into()));
}

/// A handle of zero Gaussians.
fn nothing() -> usize {
    use std::sync::OnceLock;
    static NOTHING: OnceLock<usize> = OnceLock::new();
    *NOTHING.get_or_init(|| unsafe {
        let mut arrays = std::mem::MaybeUninit::<vg_gaussian_arrays>::uninit();
        vg_gaussian_arrays_init(arrays.as_mut_ptr(), size_of::<vg_gaussian_arrays>());
        let mut out = null_mut();
        assert_eq!(vg_gaussians_from_arrays(arrays.as_ptr(), &raw mut out, null_mut()), vg_status::Ok);
        out.expose_provenance()
    })
}

#[test]
fn scenes_are_opened_by_the_names_of_existing_views() {
    let mut table = Table::new();
    for make in [calls::colmap_open as fn(&World) -> Call, calls::transforms_open] {
        let names = |names: &'static [Option<&'static [u8]>], count: usize| {
            move |call: &mut Call| {
                let mut pointers = Vec::new();
                for name in names {
                    let Some(name) = name else {
                        pointers.push(0);
                        continue;
                    };
                    let mut memory = Memory::new(name, 0);
                    pointers.push(memory.pointer());
                    call.inputs.push(memory);
                }
                let mut list = Memory::from_values(&pointers, 0);
                let pointer = if names.is_empty() { 0 } else { list.pointer() };
                call.lent("options").put("names", 0, pointer as u64);
                call.lent("options").put("name_count", 0, count as u64);
                call.inputs.push(list);
            }
        };
        let two: &[Option<&[u8]>] = &[Some(b"000\0"), None];
        table.row(make, "a NULL name", names(two, 2), refused("options.names[1]"));
        table.row(make, "the first name only", names(two, 1), Fine);
        table.row(make, "no UTF-8", names(&[Some(b"\xff\xfe\0")], 1), refused("options.names[0]"));
        table.row(make, "no names, two of them", names(&[], 2), refused("options.names"));
        table.row(
            make,
            "an unknown name",
            names(&[Some(b"9\n9\0")], 1),
            Fails(vg_status::Argument, String::new()),
        );
        table.row(make, "an empty name", names(&[Some(b"\0")], 1), Fails(vg_status::Argument, String::new()));
        let odd = |call: &mut Call| {
            let mut list = Memory::from_values(&[0usize], 4);
            call.lent("options").put("names", 0, list.pointer() as u64);
            call.inputs.push(list);
        };
        table.row(make, "names off by 4", odd, refused("options.names"));
        table.row(make, "no context", |call| call.lent("options").put("context", 0, 0), Fine);
        let without_depth = |call: &mut Call| call.lent("options").put("load_depth", 0, 0);
        table.row(make, "without depth", without_depth, Fine);
    }
    let unplaced = |call: &mut Call| call.lent("options").put("vehicle_from_world", 0, 0);
    table.row(calls::transforms_open, "the world is the vehicle's frame", unplaced, Fine);
    // The model is incomplete.
    let incomplete = Fails(vg_status::Format, "vehicle_from_world".into());
    table.row(calls::colmap_open, "a world that lies anywhere", unplaced, incomplete);
    let sample = text(&table.world.sample);
    table.row(
        calls::transforms_open,
        "the folder",
        |call| call.set("path", Value::Text(sample.clone())),
        Fine,
    );

    // Views from a scene can be passed in again.
    let done = table.row(calls::scene_get_view, "index 1", |_| {}, Fine);
    let memory = done.memory[2].as_ref().unwrap();
    let view = unsafe { memory.content().as_ptr().cast::<vg_view>().read_unaligned() };
    assert!(!view.image.data.is_null() && !view.mask.data.is_null() && !view.depth.data.is_null());
    assert_eq!(unsafe { CStr::from_ptr(view.name) }.to_str().unwrap(), "000.png");
    let mut gaussians = null_mut();
    let status =
        unsafe { vg_reconstruct(&raw const view, 1, null(), &raw mut gaussians, null_mut(), null_mut()) };
    assert_eq!(status, vg_status::Ok);
    unsafe { vg_gaussians_free(gaussians) };
}

/// The bytes of all arrays.
fn bytes(gaussians: usize) -> Vec<u8> {
    let gaussians = gaussians as *const vg_gaussians;
    unsafe {
        let (n, degree) = (vg_gaussians_count(gaussians), vg_gaussians_sh_degree(gaussians) as usize);
        let floats =
            |pointer: *const f32, each: usize| bytes_of(std::slice::from_raw_parts(pointer, n * each));
        [
            floats(vg_gaussians_positions(gaussians), 3),
            floats(vg_gaussians_scales(gaussians), 3),
            floats(vg_gaussians_rotations(gaussians), 4),
            floats(vg_gaussians_opacities(gaussians), 1),
            floats(vg_gaussians_sh(gaussians), (degree + 1).pow(2) * 3),
        ]
        .concat()
    }
}

#[test]
fn views_of_a_newer_program_give_the_same_bytes() {
    let mut table = Table::new();
    let make = calls::reconstruct;
    let expected = bytes(table.row(make, "as it is", |_| {}, Fine).handle("out_gaussians"));
    for size in [400, 456, 4096] {
        let done = table.row(
            make,
            &format!("views of {size} bytes"),
            |call| call.lent("views").resize(size, 0),
            Fine,
        );
        assert_eq!(bytes(done.handle("out_gaussians")), expected);
    }
    let odd = |call: &mut Call| call.lent("views").shift = 1;
    assert_eq!(bytes(table.row(make, "views off by 1", odd, Fine).handle("out_gaussians")), expected);

    for (element, size) in [(1, 400), (3, 0), (3, usize::MAX)] {
        let words = refused(&format!("views[{element}].struct_size"));
        table.row(make, "views of two sizes", |call| call.lent("views").claim(element, size), words);
    }
    for size in [393, 396, 399] {
        let words = refused("views[0].struct_size");
        table.row(make, &format!("views of {size} bytes"), |call| call.lent("views").resize(size, 0), words);
    }
    let last = |call: &mut Call| {
        call.lent("views").resize(400, 0);
        let at = call.lent("views").bytes.len() - 1;
        call.lent("views").bytes[at] = 1;
    };
    table.row(make, "an unknown number", last, refused("views[3]"));
}

#[test]
fn views_without_a_vehicle_are_errors_that_name_the_index() {
    let mut table = Table::new();
    let make = calls::reconstruct;
    let null = |field: &'static str| move |call: &mut Call| call.lent("views").put_in(1, field, 0, 0);
    table.row(make, "no picture", null("image.data"), refused("views[1].image.data"));
    table.row(make, "no mask", null("mask.data"), Fine);
    table.row(make, "no depth", null("depth.data"), Fine);
    for (part, width) in [("image", 47), ("image", 24), ("mask", 47), ("depth", 24)] {
        let other = |call: &mut Call| call.lent("views").put_in(1, &format!("{part}.width"), 0, width);
        table.row(make, &format!("{part} {width} wide"), other, refused(&format!("views[1].{part}")));
    }
    let tight = |call: &mut Call| {
        for part in ["image", "mask", "depth"] {
            call.lent("views").put(&format!("{part}.row_stride"), 0, 0);
        }
    };
    // Other pixels than the intended ones, but valid memory.
    table.row(make, "no strides", tight, Fine);

    let name = |name: &'static [u8]| {
        move |call: &mut Call| {
            let mut memory = Memory::new(name, 0);
            call.lent("views").put_in(1, "name", 0, memory.pointer() as u64);
            call.inputs.push(memory);
        }
    };
    table.row(make, "an empty name", name(b"\0"), Fine);
    table.row(make, "a name of two lines", name(b"a\nb\x07\0"), Fine);
    table.row(make, "no UTF-8", name(b"caf\xe9\0"), refused("views[1].name"));
    let named_and_wrong = |call: &mut Call| {
        name(b"two\nlines\0")(call);
        call.lent("views").put_in(1, "image.width", 0, 24);
    };
    table.row(make, "a name of two lines in a message", named_and_wrong, refused("lines"));

    for count in 1..4u64 {
        table.row(make, &format!("{count} views"), |call| call.set("view_count", Value::Number(count)), Fine);
    }
    let hull_of_one = |call: &mut Call| {
        call.set("view_count", Value::Number(1));
        call.lent("options").put("prior", 0, 2);
    };
    table.row(make, "a hull of one view", hull_of_one, Fine);
    let given = |call: &mut Call| {
        call.lent("options").put("prior", 0, 1);
        call.lent("views").put_in(2, "depth.data", 0, 0);
    };
    table.row(make, "depth that was not given", given, refused("views[2]"));

    // Depth without a measurement: every pixel NaN, infinite or negative.
    for bad in [f32::NAN, f32::INFINITY, -1.0, 0.0, f32::MAX, f32::from_bits(1)] {
        let spoilt = |call: &mut Call| {
            for i in 0..4 {
                let mut memory = Memory::from_values(&[bad; 48 * 36], 0);
                call.lent("views").put_in(i, "depth.data", 0, memory.pointer() as u64);
                call.lent("views").put_in(i, "depth.row_stride", 0, 0);
                call.inputs.push(memory);
            }
        };
        let mut call = make(&table.world);
        spoilt(&mut call);
        let done = call.run(true);
        assert!([vg_status::Ok, vg_status::Reconstruction].contains(&done.status), "{bad}: {}", done.message);
    }
    let blind = |call: &mut Call| {
        for i in 0..4 {
            let mut memory = Memory::new(&[127; 48 * 36], 0);
            for (field, value) in [
                ("mask.data", memory.pointer() as u64),
                ("mask.row_stride", 0),
                ("mask.width", 48),
                ("mask.height", 36),
                ("mask.format", vg_format::Gray8 as u64),
            ] {
                call.lent("views").put_in(i, field, 0, value);
            }
            call.inputs.push(memory);
        }
    };
    table.row(make, "masks without vehicle", blind, refused("views"));
    let unknown_size = |call: &mut Call| (0..3).for_each(|k| call.lent("options").put("vehicle_size", k, 0));
    table.row(make, "a vehicle of unknown size", unknown_size, Fine);
    let placed = |call: &mut Call| call.lent("options").put("has_vehicle_place", 0, 1);
    let degrees = |call: &mut Call| {
        placed(call);
        call.lent("options").put("vehicle_yaw", 0, 90f64.to_bits());
    };
    table.row(make, "a box turned by degrees", degrees, refused("options.vehicle_yaw"));
    let nowhere = |call: &mut Call| {
        placed(call);
        call.lent("options").put("vehicle_center", 1, f64::NAN.to_bits());
    };
    table.row(make, "a box that stands nowhere", nowhere, refused("options.vehicle_center"));
    let sizeless = |call: &mut Call| {
        placed(call);
        unknown_size(call);
    };
    table.row(make, "a place without a size", sizeless, refused("options.vehicle_size"));
    table.row(make, "no context", |call| call.lent("options").put("context", 0, 0), Fine);
}

#[test]
fn cameras_at_any_position_give_finite_numbers_or_an_error() {
    let table = Table::new();
    for far in [1e4, 1e6, 1e10, 1e19, 1e30, 1e39, 1e150, 1e300, 1.7e308] {
        for (prior, views) in [(1, 0..1), (1, 0..4), (2, 0..1), (2, 0..4)] {
            let mut call = calls::reconstruct(&table.world);
            call.lent("options").put("prior", 0, prior);
            for i in views {
                call.lent("views").put_in(i, "camera.vehicle_from_camera", 3, f64::to_bits(far));
            }
            call.run(true);
        }
        for make in [
            calls::render as fn(&World) -> Call,
            calls::render_through_a_lens,
            calls::render_backward,
            calls::render_backward_through_a_lens,
        ] {
            let mut call = make(&table.world);
            call.lent("camera").put("vehicle_from_camera", 3, f64::to_bits(far));
            call.run(true);
            let mut call = make(&table.world);
            call.lent("camera").put("params", 2, f64::to_bits(far.min(1e9)));
            call.run(true);
            let mut call = make(&table.world);
            call.lent("camera").put("params", 0, f64::to_bits(far.min(1e9)));
            call.run(true);
        }
        for k in 4..8 {
            for sign in [1.0, -1.0] {
                let mut call = calls::render_through_a_lens(&table.world);
                call.lent("camera").put("params", k, f64::to_bits(far * sign));
                call.run(true);
                let mut call = calls::reconstruct(&table.world);
                call.lent("views").put("camera.model", 0, vg_camera_model::Opencv as u64);
                call.lent("views").put("camera.params", k, f64::to_bits(far * sign));
                call.run(true);
            }
        }
    }
}

#[test]
fn pictures_are_written_in_every_format_at_any_address_and_only_there() {
    let mut table = Table::new();
    let make = calls::render;
    for transparent in [0, 1] {
        for (format, pixel) in [(1, 3), (2, 3), (3, 4), (4, 4), (5, 1), (6, 16), (7, 4)] {
            for (stride, shift) in [(0, 0), (48 * pixel + 1, 1), (48 * pixel, 3)] {
                let set = |call: &mut Call| {
                    let mut color = blank(36, 48 * pixel, stride.max(48 * pixel), shift, format == 6);
                    call.lent("options").put("background", 0, transparent);
                    call.lent("target").put("color", 0, color.memory.pointer() as u64);
                    call.lent("target").put("color_row_stride", 0, stride as u64);
                    call.lent("target").put("color_format", 0, format);
                    call.targets[0] = color;
                };
                let fits = [3, 4, 6].contains(&format) || (transparent == 0 && format < 3);
                let expect = if fits { Fine } else { refused("target.color_format") };
                table.row(make, &format!("format {format}, stride {stride}, off by {shift}"), set, expect);
            }
        }
    }
    for number in [-1, 0, 8, 77, i32::MIN, i32::MAX] {
        let set = |call: &mut Call| call.lent("target").put("color_format", 0, bits32(number));
        table.row(make, &format!("format {number}"), set, refused("target.color_format"));
        let unused = |call: &mut Call| {
            set(call);
            call.lent("target").put("color", 0, 0);
        };
        table.row(make, &format!("format {number} without colour"), unused, Fine);
    }
    let without = |names: &'static [&'static str]| {
        move |call: &mut Call| names.iter().for_each(|name| call.lent("target").put(name, 0, 0))
    };
    table.row(make, "only depth", without(&["color"]), Fine);
    table.row(make, "only colour", without(&["depth"]), Fine);
    table.row(make, "only alpha", without(&["color", "depth"]), Fine);
    table.row(make, "neither", without(&["color", "depth", "alpha"]), refused("target: neither"));
    table.row(make, "no context", |call| call.lent("options").put("context", 0, 0), Fine);
    table.row(make, "nothing to draw", |call| call.arguments[0].value = Value::Handle(nothing()), Fine);
    let close = |call: &mut Call| {
        call.lent("options").put("near_plane", 0, u64::from(2.0f32.to_bits()));
        call.lent("options").put("far_plane", 0, u64::from(1.0f32.to_bits()));
    };
    table.row(make, "far before near", close, refused("options.far_plane"));
}

/// Output of a backward call: arrays first, then pictures.
fn written(call: &Call) -> Vec<Vec<u8>> {
    call.targets.iter().map(|target| target.memory.content().to_vec()).collect()
}

#[test]
fn gradients_are_written_to_the_requested_arrays_and_nowhere_else() {
    let mut table = Table::new();
    let make = calls::render_backward;
    let mut whole = make(&table.world);
    assert!(whole.run(true).is_ok());
    let whole = written(&whole);
    assert!(whole.iter().all(|array| array.iter().any(|&byte| byte != calls::CANARY && byte != 0)));
    let arrays = ["positions", "scales", "rotations", "opacities", "sh", "background", "pose", "view_matrix"];
    for (i, wanted) in arrays.into_iter().enumerate() {
        let mut call = make(&table.world);
        for other in arrays.iter().filter(|other| **other != wanted) {
            call.lent("out").put(other, 0, 0);
        }
        // For gradients of only the camera and the background, the number of Gaussians does not matter.
        if i >= 5 {
            call.lent("out").put("count", 0, 0);
            call.lent("out").put("sh_degree", 0, 77);
        }
        assert!(call.run(true).is_ok(), "only {wanted}");
        for (k, found) in written(&call).into_iter().enumerate() {
            let expected = if k == i { whole[k].clone() } else { vec![calls::CANARY; found.len()] };
            assert!(found == expected, "only {wanted}: {}", arrays[k]);
        }
    }
    let none = |call: &mut Call| arrays.iter().for_each(|name| call.lent("out").put(name, 0, 0));
    table.row(make, "no array", none, refused("out: no array"));
    let few = |call: &mut Call| call.arguments[0].value = Value::Handle(nothing());
    table.row(make, "other Gaussians", few, refused("out.count"));
    let nothing_to_draw = |call: &mut Call| {
        few(call);
        call.lent("out").put("count", 0, 0);
        call.lent("out").put("sh_degree", 0, 0);
        call.targets.drain(..5);
    };
    table.row(make, "nothing to draw", nothing_to_draw, Fine);
}

#[test]
fn planes_of_a_gradient_are_read_in_place_and_must_be_finite() {
    let mut table = Table::new();
    let make = calls::render_backward;
    let planes = [("color", 12), ("alpha", 4), ("depth", 4)];
    for (k, (plane, pixel)) in planes.into_iter().enumerate() {
        let stride = calls::GRADIENT_STRIDES[k].max(48 * pixel);
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for (v, u) in [(0, 0), (17, 47), (35, 47)] {
                let spoil = |call: &mut Call| {
                    // The last byte of a pixel's last channel.
                    call.inputs[k].poke(v * stride + (u + 1) * pixel - 4, bytes_of(&[value]));
                };
                let words = refused(&format!("gradient.{plane}[{v}][{u}]: {value}"));
                for make in [make as fn(&World) -> Call, calls::render_backward_with_a_picture] {
                    table.row(make, &format!("{plane}, {value}"), spoil, words.clone());
                }
            }
        }
        let without = |call: &mut Call| call.lent("gradient").put(plane, 0, 0);
        table.row(make, &format!("no {plane}"), without, Fine);
        // Rows with and without gaps hold the same gradient.
        let mut expected = make(&table.world);
        let only = |call: &mut Call| {
            planes.iter().filter(|p| p.0 != plane).for_each(|p| call.lent("gradient").put(p.0, 0, 0));
        };
        only(&mut expected);
        assert!(expected.run(true).is_ok());
        let mut call = make(&table.world);
        only(&mut call);
        let rows = calls::noise(48 * 36 * pixel / 4);
        let mut bytes = vec![0xFF; 36 * (48 * pixel + 9)];
        for (v, row) in bytes_of(&rows).chunks_exact(48 * pixel).enumerate() {
            bytes[v * (48 * pixel + 9)..][..row.len()].copy_from_slice(row);
        }
        let mut memory = Memory::new(&bytes, 3);
        call.lent("gradient").put(plane, 0, memory.pointer() as u64);
        call.lent("gradient").put(&format!("{plane}_row_stride"), 0, 48 * pixel as u64 + 9);
        call.inputs.push(memory);
        assert!(call.run(true).is_ok());
        assert!(written(&call) == written(&expected), "{plane} with other gaps");
    }
    let without = |call: &mut Call| planes.iter().for_each(|p| call.lent("gradient").put(p.0, 0, 0));
    table.row(make, "no plane", without, refused("gradient: neither"));

    let straight = |call: &mut Call| {
        call.lent("options").put("background", 0, vg_background::Transparent as u64);
        call.lent("options").put("alpha", 0, vg_alpha::Straight as u64);
    };
    table.row(make, "of straight alpha", straight, refused("options.alpha: 0 (straight)"));
    let without_color = |call: &mut Call| {
        straight(call);
        call.lent("gradient").put("color", 0, 0);
    };
    table.row(make, "straight alpha without colour", without_color, Fine);
}

/// The user data of a loss in C.
struct Loss {
    world: *const World,
    caller: std::thread::ThreadId,
    /// The planes that it fills, and their contents.
    planes: [(*mut u8, Vec<u8>); 3],
    answer: i32,
    calls: usize,
    /// Contents of `target` at the time of the call.
    picture: Vec<u8>,
    target: (*const u8, usize),
}

unsafe extern "C" fn loss(user: *mut c_void) -> i32 {
    let loss = unsafe { &mut *user.cast::<Loss>() };
    loss.calls += 1;
    assert_eq!(std::thread::current().id(), loss.caller);
    loss.picture = unsafe { std::slice::from_raw_parts(loss.target.0, loss.target.1) }.to_vec();
    for (plane, bytes) in &loss.planes {
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), *plane, bytes.len()) };
    }
    // Uses the same context, while all of its threads wait.
    for make in [calls::render as fn(&World) -> Call, calls::render_backward_with_a_picture] {
        assert!(make(unsafe { &*loss.world }).run(true).is_ok());
    }
    loss.answer
}

#[test]
fn a_loss_gets_the_picture_fills_the_planes_and_may_call_the_library() {
    let mut table = Table::new();
    let one = {
        let mut call = calls::context_new(&table.world);
        call.lent("options").put("threads", 0, 1);
        call.run(true)
    };
    let make = calls::render_backward_with_a_picture;
    let mut expected = make(&table.world);
    assert!(expected.run(true).is_ok());
    // Gradients of a call without a picture, and the picture of a call without gradients.
    let mut apart = calls::render_backward(&table.world);
    let mut drawn = calls::render(&table.world);
    assert!(apart.run(true).is_ok() && drawn.run(true).is_ok());
    assert!(written(&expected) == [written(&apart), written(&drawn)].concat());

    for context in [table.world.context, one.handle("out"), 0] {
        for (answer, spoiled) in [(0, false), (1, false), (i32::MIN, false), (0, true)] {
            let mut call = make(&table.world);
            call.lent("options").put("context", 0, context as u64);
            // The planes contain noise until the loss fills them.
            let contents: Vec<Vec<u8>> = call.inputs.iter().map(|input| input.content().to_vec()).collect();
            let mut planes: Vec<Vec<u8>> = contents.iter().map(|c| vec![0xFF; c.len()]).collect();
            let names = ["color", "alpha", "depth"];
            for (name, plane) in names.iter().zip(&mut planes) {
                call.lent("gradient").put(name, 0, plane.as_mut_ptr().expose_provenance() as u64);
            }
            let mut contents = contents;
            if spoiled {
                contents[1][0..4].copy_from_slice(&f32::NAN.to_ne_bytes());
            }
            let of = |i: usize, planes: &mut [Vec<u8>]| (planes[i].as_mut_ptr(), contents[i].clone());
            let target = &mut call.targets[8];
            let target = (target.memory.pointer() as *const u8, target.memory.content().len());
            let mut user = Loss {
                world: &raw const table.world,
                caller: std::thread::current().id(),
                planes: [of(0, &mut planes), of(1, &mut planes), of(2, &mut planes)],
                answer,
                calls: 0,
                picture: vec![],
                target,
            };
            call.lent("gradient").put("loss", 0, loss as *const () as u64);
            call.lent("gradient").put("loss_user", 0, (&raw mut user).expose_provenance() as u64);
            // The picture is written before the loss can fail, so the check for untouched outputs excludes it.
            let pictures = if answer != 0 || spoiled { call.targets.split_off(8) } else { vec![] };
            let done = call.run(true);
            assert_eq!(user.calls, 1);
            assert!(user.picture == written(&drawn)[0], "the loss gets the picture");
            match (answer, spoiled) {
                (0, false) => {
                    assert!(done.is_ok(), "{}", done.message);
                    assert!(written(&call) == written(&expected));
                }
                (0, true) => {
                    assert_eq!(done.status, vg_status::Argument);
                    assert!(done.message.starts_with("gradient.alpha[0][0]: NaN"), "{}", done.message);
                }
                _ => {
                    assert_eq!(done.status, vg_status::Cancelled);
                    assert_eq!(done.message, "cancelled during loss");
                }
            }
            for (picture, drawn) in pictures.iter().zip(written(&drawn)) {
                assert!(picture.memory.content() == drawn);
            }
        }
    }
    let nothing_to_see = |call: &mut Call| {
        call.lent("gradient").put("loss", 0, loss as *const () as u64);
        call.arguments[3].value = Value::Null;
    };
    table.row(make, "a loss without a picture", nothing_to_see, refused("target: NULL"));
}

thread_local! {
    static CALLS_LEFT: Cell<usize> = const { Cell::new(0) };
    static LINES: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

unsafe extern "C" fn stop(_: *const c_char, fraction: f64, _: *mut c_void) -> i32 {
    assert!((0.0..=1.0).contains(&fraction));
    CALLS_LEFT.set(CALLS_LEFT.get().wrapping_sub(1));
    if CALLS_LEFT.get() == 0 { [1, -1, 2, i32::MIN][LINES.with_borrow(Vec::len) % 4] } else { 0 }
}

unsafe extern "C" fn log(level: i32, message: *const c_char, _: *mut c_void) {
    let message = unsafe { CStr::from_ptr(message) }.to_str().unwrap();
    assert!((1..=3).contains(&level) && !message.is_empty() && !message.contains('\n'));
    LINES.with_borrow_mut(|lines| lines.push(message.to_owned()));
}

#[test]
fn a_callback_may_stop_at_any_of_its_calls() {
    let mut table = Table::new();
    let callbacks = |call: &mut Call| {
        call.lent("options").put("progress", 0, stop as *const () as u64);
        call.lent("options").put("log", 0, log as *const () as u64);
    };
    for prior in [1, 2] {
        let with = |call: &mut Call| {
            callbacks(call);
            call.lent("options").put("prior", 0, prior);
        };
        let mut call = calls::reconstruct(&table.world);
        with(&mut call);
        CALLS_LEFT.set(usize::MAX);
        let expected = bytes(call.run(true).handle("out_gaussians"));
        let times = usize::MAX - CALLS_LEFT.get();
        assert!(times > 6, "{times} calls");
        for n in 1..=times {
            let arm = |call: &mut Call| {
                with(call);
                CALLS_LEFT.set(n);
            };
            table.row(
                calls::reconstruct,
                &format!("stopped at {n}"),
                arm,
                Fails(vg_status::Cancelled, "cancelled".into()),
            );
        }
        // The context still works.
        CALLS_LEFT.set(usize::MAX);
        let mut call = calls::reconstruct(&table.world);
        with(&mut call);
        assert_eq!(bytes(call.run(true).handle("out_gaussians")), expected);
    }
    assert!(LINES.with_borrow(Vec::len) > 10);
}

#[test]
fn depth_of_a_thousand_metres_is_a_warning_of_the_log_only() {
    let mut table = Table::new();
    for make in [calls::colmap_open as fn(&World) -> Call, calls::transforms_open] {
        LINES.with_borrow_mut(Vec::clear);
        let in_metres = |call: &mut Call| {
            call.lent("options").put("depth_scale", 0, 1.0f64.to_bits());
            call.lent("options").put("log", 0, log as *const () as u64);
        };
        table.row(make, "millimetres taken for metres", in_metres, Fine);
        let lines = LINES.take();
        assert!(lines.iter().any(|line| line.contains("depth")), "{lines:?}");
        let unheard = |call: &mut Call| call.lent("options").put("depth_scale", 0, 1.0f64.to_bits());
        table.row(make, "no log function", unheard, Fine);
    }
}

#[test]
fn figures_contain_the_prior_and_its_box() {
    let mut table = Table::new();
    for (prior, has_box) in [(vg_prior::Given, 0), (vg_prior::Hull, 1), (vg_prior::Shape, 1)] {
        let choose = |call: &mut Call| call.lent("options").put("prior", 0, prior as u64);
        let made = table.row(calls::reconstruct, "a prior", choose, Fine);
        let mut call = calls::report_get_figures(&table.world);
        call.set("report", Value::Handle(made.handle("out_report")));
        let done = call.run(true);
        let bytes = done.memory[1].as_ref().unwrap().content();
        let figures = unsafe { bytes.as_ptr().cast::<vg_report_figures>().read_unaligned() };
        assert_eq!((figures.prior, figures.has_box, figures.has_input_error), (prior as i32, has_box, 1));
        let count = unsafe { vg_gaussians_count(made.handle("out_gaussians") as _) };
        assert_eq!((figures.gaussian_count, figures.views_used, figures.threads), (count as u64, 4, 2));
        assert!((0..3).all(|k| figures.extent_low[k] < figures.extent_high[k]));
        assert_eq!((figures.box_size != [0.0; 3]), has_box == 1);
        assert_eq!(figures.has_uncovered, has_box);
        assert!(figures.uncovered_after <= figures.uncovered_before && figures.uncovered_before < 1.0);
        assert_eq!(figures.cloud_used, 0);

        // The report has the same numbers.
        let told = report(made.handle("out_report"));
        assert_eq!(figures.photo_found, told["photo"]["found"].as_u64().unwrap_or(0));
        assert_eq!(figures.relit_count, told["relight"]["clones"].as_u64().unwrap_or(0));
        let calibration = match told["calibration"]["verdict"].as_str() {
            None => vg_calibration::None,
            Some("not-needed") => vg_calibration::NotNeeded,
            Some("accepted") => vg_calibration::Accepted,
            Some("refused") => vg_calibration::Refused,
            Some(other) => panic!("{other}"),
        };
        assert_eq!(figures.calibration, calibration as i32);
        let verdict = match told["verdict"].as_str() {
            Some("good") => vg_verdict::Good,
            Some("unchecked") => vg_verdict::Unchecked,
            Some("doubtful") => vg_verdict::Doubtful,
            Some("bad") => vg_verdict::Bad,
            other => panic!("{other:?}"),
        };
        assert_eq!(figures.verdict, verdict as i32);
        let reasons = told["verdict_reasons"].as_array().unwrap();
        assert_eq!(figures.reason_count as usize, reasons.len());
        for (index, reason) in reasons.iter().enumerate() {
            let line = unsafe { CStr::from_ptr(vg_report_reason(made.handle("out_report") as _, index)) };
            assert!(line.to_str().unwrap().contains(reason["found"].as_str().unwrap()));
        }
        let beyond = unsafe { vg_report_reason(made.handle("out_report") as _, reasons.len()) };
        assert_eq!(unsafe { CStr::from_ptr(beyond) }, c"");
        for (error, [psnr, iou, covered]) in [
            (
                &told["input_error"],
                [figures.input_psnr_db, figures.input_silhouette_iou, figures.input_mask_covered],
            ),
            (
                &told["input_error_by_given_cameras"],
                [
                    figures.input_given_psnr_db,
                    figures.input_given_silhouette_iou,
                    figures.input_given_mask_covered,
                ],
            ),
        ] {
            let number = |name: &str| error[name].as_f64().unwrap();
            assert_eq!([psnr, iou, covered], ["psnr_db", "silhouette_iou", "mask_covered"].map(number));
        }
        let degrees = told["calibration"]["yaw_degrees"].as_f64().unwrap_or(0.0);
        assert!((figures.calibration_yaw_degrees - degrees).abs() < 1e-12);
    }
}

fn report(handle: usize) -> serde_json::Value {
    let json = unsafe { CStr::from_ptr(vg_report_json(handle as _)) };
    serde_json::from_str(json.to_str().unwrap()).unwrap()
}

/// A program of the first header has none of the later fields.
#[test]
fn options_of_an_older_program_have_the_defaults_of_later_fields() {
    let mut table = Table::new();
    let make = calls::reconstruct;
    let expected = bytes(table.row(make, "as it is", |_| {}, Fine).handle("out_gaussians"));
    let first = FIRST_SIZES.iter().find(|(of, _)| *of == "vg_options").unwrap().1;
    // Sizes up to the reserved field, the middle of the cloud, the resolution, and beyond it.
    for size in [first, first + 8, first + 12, first + 16, first + 24, first + 36, first + 40, first + 48] {
        let older = |call: &mut Call| {
            call.lent("options").put("photo", 0, if size > first + 8 { 1 } else { 77 });
            call.lent("options").resize(size, 0);
        };
        let done = table.row(make, &format!("options of {size} bytes"), older, Fine);
        assert_eq!(bytes(done.handle("out_gaussians")), expected);
        let settings = &report(done.handle("out_report"))["settings"];
        assert_eq!(settings["calibrate"], "auto");
        assert_eq!(settings["relight"], "auto");
        assert_eq!((settings["photo"].as_bool(), settings["budget_s"].is_null()), (Some(true), true));
        assert_eq!((settings["resolution"].as_f64(), settings["max_views"].is_null()), (Some(1.0), true));
        assert_eq!(settings["max_gaussians"], 12_000_000);
    }
}

#[test]
fn options_reach_the_library() {
    let mut table = Table::new();
    let set = |call: &mut Call| {
        for (name, value) in [("calibrate", 1), ("relight", 1), ("photo", 0)] {
            call.lent("options").put(name, 0, value);
        }
        call.lent("options").put("budget_s", 0, 1e6f64.to_bits());
        call.lent("options").put("resolution", 0, 0.5f64.to_bits());
        call.lent("options").put("max_views", 0, 1);
        call.lent("options").put("max_gaussians", 0, 500);
    };
    let done = table.row(calls::reconstruct, "nothing as it is", set, Fine);
    let told = report(done.handle("out_report"));
    let settings = &told["settings"];
    assert_eq!((settings["calibrate"].as_str(), settings["relight"].as_str()), (Some("off"), Some("never")));
    // The report has the plan of a budget next to the settings that it chose.
    assert_eq!((settings["photo"].as_bool(), told["plan"]["budget_s"].as_f64()), (Some(false), Some(1e6)));
    assert!(told["calibration"].is_null() && told["relight"].is_null());
    assert_eq!((settings["resolution"].as_f64(), settings["max_views"].as_u64()), (Some(0.5), Some(1)));
    assert_eq!(told["views_used"].as_array().map(Vec::len), Some(1));
    assert_eq!(settings["max_gaussians"], 500);
    assert!(told["gaussians"].as_u64().is_some_and(|n| n <= 500), "{}", told["gaussians"]);
}

#[test]
fn a_cloud_is_read_completely_and_copied() {
    let mut table = Table::new();
    let make = calls::reconstruct;
    // Points of the right side at the measured depth.
    let points = unsafe {
        let count = vg_report_point_count(table.world.report as _);
        std::slice::from_raw_parts(vg_report_point_positions(table.world.report as _), 3 * count)
    };
    let points: Vec<f32> = points.chunks_exact(3).step_by(10).flatten().copied().collect();
    let count = points.len() / 3;
    assert!(count > 50, "{count} points");
    let lend = |values: Vec<f32>, count: usize, prior: vg_prior| {
        move |call: &mut Call| {
            let mut memory = Memory::from_values(&values, 0);
            call.lent("options").put("cloud", 0, memory.pointer() as u64);
            call.lent("options").put("cloud_count", 0, count as u64);
            call.lent("options").put("prior", 0, prior as u64);
            call.inputs.push(memory);
        }
    };
    for prior in [vg_prior::Hull, vg_prior::Shape] {
        let done = table.row(make, "a cloud", lend(points.clone(), count, prior), Fine);
        let told = report(done.handle("out_report"));
        assert!(told["cloud"]["used"].as_u64().unwrap() as usize > count / 2, "{}", told["cloud"]);
        let mut call = calls::report_get_figures(&table.world);
        call.set("report", Value::Handle(done.handle("out_report")));
        let figures = call.run(true);
        let content = figures.memory[1].as_ref().unwrap().content();
        let figures = unsafe { content.as_ptr().cast::<vg_report_figures>().read_unaligned() };
        assert_eq!(Some(figures.cloud_used), told["cloud"]["used"].as_u64());
    }
    let given = table.row(make, "a cloud beside depth", lend(points.clone(), count, vg_prior::Given), Fine);
    let told = report(given.handle("out_report"));
    assert!(told["cloud"].is_null());
    assert!(told["left_out"].as_array().unwrap().iter().any(|l| l["count"].as_u64() == Some(count as u64)));

    let none = lend(points.clone(), 0, vg_prior::Given);
    let told = report(table.row(make, "none of them", none, Fine).handle("out_report"));
    assert!(told["left_out"].as_array().unwrap().iter().all(|l| l["count"].as_u64() != Some(count as u64)));
    let nowhere = |call: &mut Call| call.lent("options").put("cloud_count", 0, 2);
    table.row(make, "no points, but two", nowhere, refused("options.cloud: NULL"));
    let off = |call: &mut Call| {
        lend(points.clone(), count - 1, vg_prior::Given)(call);
        let at = call.inputs.last_mut().unwrap().pointer() as u64 + 2;
        call.lent("options").put("cloud", 0, at);
    };
    table.row(make, "points between floats", off, refused("options.cloud: address"));
    for (k, bad) in [(0, f32::NAN), (3 * count - 1, f32::INFINITY), (3 * count - 3, f32::NEG_INFINITY)] {
        let mut spoilt = points.clone();
        spoilt[k] = bad;
        let words = refused(&format!("options.cloud[{}]", k / 3));
        table.row(make, &format!("{bad} among the points"), lend(spoilt, count, vg_prior::Hull), words);
    }
    let far = |call: &mut Call| lend(vec![f32::MAX; 9], 3, vg_prior::Hull)(call);
    table.row(make, "points that are nowhere near", far, Fine);
}

/// User data of a callback that calls the library.
struct Inner {
    world: *const World,
    depth: Cell<u32>,
    calls: Cell<u32>,
}

unsafe fn call_again(user: *mut c_void) {
    let inner = unsafe { &*user.cast::<Inner>() };
    let world = unsafe { &*inner.world };
    inner.calls.set(inner.calls.get() + 1);
    if inner.depth.get() > 0 {
        return;
    }
    inner.depth.set(1);
    for make in [calls::render as fn(&World) -> Call, calls::render_through_a_lens, calls::gaussians_mirror] {
        assert!(make(world).run(true).is_ok());
    }
    // The inner call has an error of its own.
    assert_eq!(unsafe { vg_gaussians_mirror(null(), null_mut(), null_mut()) }, vg_status::Argument);
    let mut call = calls::reconstruct(world);
    call.lent("options").put("progress", 0, again as *const () as u64);
    call.lent("options").put("progress_user", 0, user.expose_provenance() as u64);
    assert!(call.run(true).is_ok());
    inner.depth.set(0);
}

unsafe extern "C" fn again(_: *const c_char, _: f64, user: *mut c_void) -> i32 {
    unsafe { call_again(user) };
    0
}

unsafe extern "C" fn log_again(_: i32, _: *const c_char, user: *mut c_void) {
    unsafe { call_again(user) };
}

#[test]
fn a_callback_may_call_the_library_with_the_same_context() {
    let mut table = Table::new();
    let expected = bytes(table.row(calls::reconstruct, "as it is", |_| {}, Fine).handle("out_gaussians"));
    let inner = Inner { world: &raw const table.world, depth: Cell::new(0), calls: Cell::new(0) };
    let mut call = calls::reconstruct(&table.world);
    let user = (&raw const inner).expose_provenance() as u64;
    for (name, value) in [
        ("progress", again as *const () as u64),
        ("progress_user", user),
        ("log", log_again as *const () as u64),
        ("log_user", user),
    ] {
        call.lent("options").put(name, 0, value);
    }
    assert_eq!(bytes(call.run(true).handle("out_gaussians")), expected);
    assert!(inner.calls.get() > 20, "{} calls", inner.calls.get());
}

#[test]
fn many_threads_in_one_context_get_the_same_bytes() {
    let table = Table::new();
    let world = &table.world;
    let expected = bytes(calls::reconstruct(world).run(true).handle("out_gaussians"));
    let picture = |make: fn(&World) -> Call| {
        let mut call = make(world);
        assert!(call.run(true).is_ok());
        call.targets[0].memory.content().to_vec()
    };
    let (straight, bent) = (picture(calls::render), picture(calls::render_through_a_lens));
    let (back, bent_back) =
        (picture(calls::render_backward_with_a_picture), picture(calls::render_backward_through_a_lens));
    // The world consists of handles, which any number of threads may use.
    struct Shared<'a>(&'a World);
    unsafe impl Sync for Shared<'_> {}
    impl Shared<'_> {
        fn world(&self) -> &World {
            self.0
        }
    }
    let shared = Shared(world);
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                let world = shared.world();
                for _ in 0..3 {
                    let done = calls::reconstruct(world).run(true);
                    assert_eq!(bytes(done.handle("out_gaussians")), expected);
                    for (make, expected) in [
                        (calls::render as fn(&World) -> Call, &straight),
                        (calls::render_through_a_lens, &bent),
                        (calls::render_backward_with_a_picture, &back),
                        (calls::render_backward_through_a_lens, &bent_back),
                    ] {
                        let mut call = make(world);
                        assert!(call.run(true).is_ok());
                        assert_eq!(call.targets[0].memory.content(), &expected[..]);
                    }
                    let mut call = calls::reconstruct(world);
                    call.lent("views").put_in(3, "camera.flags", 0, 1);
                    assert!(call.run(true).message.starts_with("views[3].camera.flags: "));
                }
            });
        }
    });
    // Another context, and no context, give the same bytes.
    for threads in [1, 3, 16] {
        let mut call = calls::context_new(world);
        call.lent("options").put("threads", 0, threads);
        let context = call.run(true);
        assert_eq!(u64::from(unsafe { vg_context_threads(context.handle("out") as _) }), threads);
        let mut call = calls::reconstruct(world);
        call.lent("options").put("context", 0, context.handle("out") as u64);
        assert_eq!(bytes(call.run(true).handle("out_gaussians")), expected);
    }
    let mut call = calls::reconstruct(world);
    call.lent("options").put("context", 0, 0);
    assert_eq!(bytes(call.run(true).handle("out_gaussians")), expected);
}

/// Threads of this process.
#[cfg(target_os = "linux")]
fn threads() -> usize {
    std::fs::read_dir("/proc/self/task").unwrap().count()
}

/// Threads of this process, once those that have ended are off the system's list: a joined thread no longer runs, but
/// is listed until the kernel has removed it. A thread that still runs stays on the list.
#[cfg(target_os = "linux")]
fn threads_left(expected: usize) -> usize {
    let start = std::time::Instant::now();
    while threads() != expected && start.elapsed().as_secs() < 2 {
        std::thread::yield_now();
    }
    threads()
}

/// Run alone, in a process of its own, by the test below.
#[cfg(target_os = "linux")]
#[test]
#[ignore = "counts the threads of its process"]
fn alone_threads_end_with_their_context() {
    let before = threads();
    let table = Table::new();
    let here = threads();
    assert_eq!(here, before + 2, "the world's context");
    let cores = std::thread::available_parallelism().unwrap().get();
    let of_the_process = if cores == 1 { 0 } else { cores };
    for _ in 0..3 {
        let mut call = calls::context_new(&table.world);
        call.lent("options").put("threads", 0, 7);
        let context = call.run(true);
        assert_eq!(threads(), here + 7);
        drop(context);
        assert_eq!(threads_left(here), here, "vg_context_free ends its threads");
        for make in [
            calls::reconstruct as fn(&World) -> Call,
            calls::render,
            calls::render_backward_with_a_picture,
            calls::transforms_open,
            calls::renderer_new,
            calls::renderer_render,
            calls::metrics_pictures,
            calls::metrics_view,
            calls::metrics_surface,
            calls::align_scan,
            calls::colmap_open,
        ] {
            let mut call = make(&table.world);
            call.lent("options").put("context", 0, 0);
            assert_eq!(call.run(true).status, call.good);
            assert_eq!(threads(), here + of_the_process, "{} uses the process's context", call.function);
        }
        unsafe { vg_default_context_free() };
        assert_eq!(threads_left(here), here, "vg_default_context_free ends its threads");
        assert!(calls::gaussians_transform(&table.world).run(true).is_ok());
        assert_eq!(threads(), here, "moving Gaussians needs none");
    }
    drop(table);
    assert_eq!(threads_left(before), before);
}

/// Run alone, in a process that starts no thread, by the test below.
#[cfg(target_os = "linux")]
#[test]
#[ignore = "starts no thread"]
fn alone_one_thread_is_the_calling_one() {
    let mut table = Table::on_threads(1);
    let here = threads();
    for make in calls::CALLS {
        table.row(make, "on this thread", |_| {}, Fine);
    }
    assert_eq!(threads(), here);
    let two = |call: &mut Call| call.lent("options").put("threads", 0, 2);
    let words = "threads: 0 of 2 could be started: Resource temporarily unavailable (os error 11); raise the system's \
                 limit of threads (ulimit -u), or ask for 1, which starts none";
    table.row(calls::context_new, "two threads", two, Fails(vg_status::Threads, words.into()));
    // One core needs one thread, which is the calling one.
    let cores = std::thread::available_parallelism().unwrap().get();
    let words = format!("threads: 0 of {cores} could be started");
    let expect = if cores == 1 { Fine } else { Fails(vg_status::Threads, words) };
    for make in [calls::render as fn(&World) -> Call, calls::transforms_open, calls::reconstruct] {
        let none = |call: &mut Call| call.lent("options").put("context", 0, 0);
        table.row(make, "the process's context", none, expect.clone());
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_context_of_one_thread_works_where_no_thread_can_be_started() {
    if !vg_testing::tools::have(&vg_testing::tools::cc(), "gcc", "a system that starts no thread") {
        return;
    }
    let folder = scratch();
    let mut command = std::process::Command::new(std::env::current_exe().unwrap());
    let name = "arguments::alone_one_thread_is_the_calling_one";
    command.args(["--exact", name, "--ignored", "--test-threads=1"]);
    command.env("LD_PRELOAD", vg_testing::tools::few_threads(folder.path())).env("VG_TEST_THREADS", "0");
    let output = vg_testing::tools::run(&mut command);
    assert!(output.contains("1 passed"), "{output}");
}

#[cfg(target_os = "linux")]
#[test]
fn threads_end_with_their_context_or_call() {
    let mut command = std::process::Command::new(std::env::current_exe().unwrap());
    let name = "arguments::alone_threads_end_with_their_context";
    let output = vg_testing::tools::run(command.args(["--exact", name, "--ignored", "--test-threads=1"]));
    assert!(output.contains("1 passed"), "{output}");
}

/// A possible value of an uninitialised variable.
fn garbage<T>() -> *mut T {
    std::ptr::without_provenance_mut(0xDEAD_BEE0)
}

#[test]
fn handles_of_failed_calls_are_null_and_made_ones_are_freed() {
    // `Call::run` passes a dangling pointer; here the initial value is that of a caller's variable.
    let (mut gaussians, mut report, mut error) =
        (garbage::<vg_gaussians>(), garbage::<vg_report>(), garbage::<vg_error>());
    unsafe {
        let status = vg_reconstruct(null(), 1, null(), &raw mut gaussians, &raw mut report, &raw mut error);
        assert_eq!(status, vg_status::Argument);
        assert!(gaussians.is_null() && report.is_null() && !error.is_null());
        vg_error_free(error);
        let status = vg_reconstruct(null(), 1, null(), null_mut(), &raw mut report, null_mut());
        assert_eq!(status, vg_status::Argument);
    }
    assert_eq!(
        [Made::Context, Made::Gaussians, Made::Report, Made::Scene].map(|m| unsafe { m.free(0) }).len(),
        4
    );
}
