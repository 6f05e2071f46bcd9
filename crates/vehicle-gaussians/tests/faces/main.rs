//! Declarations and documentation of the faces are what the library's tables say: `Options::fields`, and each `Choice`.
//!
//! Sources that must exist as text are kept in step here: C's structs and enumerations, which `include/vg.h` is made
//! of, and Python's signatures, docstrings, types and ctypes. Only what a table has is compared; what a face has of its
//! own stays as it is written. A new option or variant is added where its like are.
//!
//! `VG_BLESS=1 cargo test -p vehicle-gaussians --test faces` writes them. Then `VG_BLESS=1 cargo test --test abi` writes
//! `include/vg.h` and the golden files of the ABI.

mod c;
mod python;
mod text;

use vg::geometry::Choice;
use vg::geometry::choice::Enumeration;
use vg::geometry::measures::Measure;
use vg::geometry::options::{Face, Field};
use vg::metrics::{SurfaceErrors, ViewErrors};
use vg::pipeline::Options;
use vg_testing::root;
use vg_testing::tools::assert_golden;

/// Every enumeration that users meet.
fn enumerations() -> Vec<Enumeration> {
    vec![
        vg::pipeline::PriorChoice::enumeration(),
        vg::pipeline::Calibrate::enumeration(),
        vg::pipeline::KeepItem::enumeration(),
        vg::pipeline::Verdict::enumeration(),
        vg::symmetry::SymmetryMode::enumeration(),
        vg::relight::Relight::enumeration(),
        vg::calibrate::Verdict::enumeration(),
        vg::align::Heading::enumeration(),
        vg::refine::Stop::enumeration(),
        vg::render::Backend::enumeration(),
        vg::render::DepthMode::enumeration(),
        vg::onnx::Provider::enumeration(),
    ]
}

/// The options that a face takes from the table.
fn options(face: Face) -> Vec<Field> {
    let fields = Options::fields().into_iter();
    fields.filter(|field| !field.facts.apart.contains(&face)).collect()
}

/// The structs of measures: their names in Rust and Python, and in C without `vg_`.
const MEASURES: [(&str, &str, &[Measure]); 2] = [
    ("ViewErrors", "view_errors", ViewErrors::MEASURES),
    ("SurfaceErrors", "surface_errors", SurfaceErrors::MEASURES),
];

#[track_caller]
fn assert_in_step(path: &str, generate: fn(&str) -> String) {
    let path = root().join(path);
    let written = std::fs::read_to_string(&path).unwrap();
    let why = "the library's tables have changed: VG_BLESS=1 cargo test -p vehicle-gaussians --test faces rewrites the \
               file, and VG_BLESS=1 cargo test --test abi then include/vg.h";
    assert_golden(&path, &generate(&written), why);
}

/// One after the other: each rewrites files that another has a part in.
#[test]
fn options_enumerations_and_measures_of_c_are_the_librarys() {
    for file in ["align", "model", "options", "refine", "render", "report"] {
        assert_in_step(&format!("src/capi/{file}.rs"), c::enumerations);
    }
    assert_in_step("src/capi/options.rs", c::options);
    assert_in_step("src/capi/metrics.rs", c::measures);
    // The second witness of the ABI names them all.
    assert_in_step("src/capi/tests.rs", c::witness);
}

#[test]
fn the_measures_of_python_are_the_librarys() {
    assert_in_step("bindings/python/python/vehicle_gaussians/_measures.py", python::measures);
    assert_in_step("bindings/python/python/vehicle_gaussians/_evaluate.py", python::scores);
}

#[test]
fn every_enumeration_is_in_c() {
    let files: Vec<String> = std::fs::read_dir(root().join("src/capi"))
        .unwrap()
        .filter_map(|entry| std::fs::read_to_string(entry.unwrap().path()).ok())
        .collect();
    for e in enumerations() {
        let declaration = format!("pub enum vg_{} {{", e.name);
        assert!(files.iter().any(|file| file.contains(&declaration)), "no {declaration} in src/capi");
    }
}

#[test]
fn the_names_of_python_are_the_librarys() {
    assert_in_step("bindings/python/python/vehicle_gaussians/_types.py", python::types);
}

#[test]
fn the_options_of_python_are_the_librarys() {
    assert_in_step("bindings/python/python/vehicle_gaussians/_reconstruct.py", python::reconstruct);
}

#[test]
fn the_options_and_enumerations_of_ctypes_are_the_librarys() {
    assert_in_step("bindings/python/python/vehicle_gaussians/capi.py", python::capi);
}

#[test]
fn names_and_numbers_are_each_of_one_variant() {
    for e in enumerations() {
        for (i, a) in e.variants.iter().enumerate() {
            for b in &e.variants[..i] {
                assert!(
                    a.name != b.name && a.number != b.number,
                    "{}: {} and {}",
                    e.type_name,
                    a.ident,
                    b.ident
                );
            }
        }
    }
}
