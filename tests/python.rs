//! The Python package, installed from the checkout into a virtual environment below `target`: its tests, and a
//! comparison of its results with those of Rust.
//!
//! Tests whose tools are missing are skipped with a printed reason; `VG_NO_SKIP=1` makes it a failure, except for
//! PyTorch.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use vg::pipeline::Options;
use vg_testing::sample::{self, INPUTS};

/// Python with the package, or `None` if it cannot be installed.
fn python() -> Option<&'static Path> {
    static PYTHON: OnceLock<Option<PathBuf>> = OnceLock::new();
    PYTHON.get_or_init(installed).as_deref()
}

fn installed() -> Option<PathBuf> {
    let target = vg_testing::tools::target().parent()?.parent()?.to_owned();
    let environment = target.join("python");
    let python = environment.join("bin/python");
    // Without python3-venv, Debian's python3 leaves an environment without pip.
    if !environment.join("bin/pip").exists() {
        let mut venv = Command::new("python3");
        let made = venv.args(["-m", "venv"]).arg(&environment).output();
        if !made.is_ok_and(|output| output.status.success()) {
            return lacking("no python3 with venv here (Debian: python3-venv)");
        }
    }
    let mut pip = Command::new(&python);
    pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "./bindings/python[test]"]);
    // Shares the optimised dependencies with the build of the demo.
    let output =
        vg_testing::tools::output(pip.current_dir(vg_testing::root()).env("CARGO_TARGET_DIR", &target));
    let errors = String::from_utf8_lossy(&output.stderr);
    if output.status.success() {
        return Some(python);
    }
    // The package itself cannot cause this error.
    if errors.contains("No matching distribution found") {
        return lacking("packages that cannot be had from PyPI");
    }
    panic!("pip: {errors}");
}

fn lacking(what: &str) -> Option<PathBuf> {
    let line = format!("skipped: the Python package: {what}");
    assert!(std::env::var_os("VG_NO_SKIP").is_none(), "{line}");
    vg_testing::say(&line);
    None
}

#[test]
fn the_python_package_passes_its_tests() {
    let Some(python) = python() else { return };
    let mut pytest = Command::new(python);
    pytest.args(["-m", "pytest", "--quiet", "-rs", "bindings/python/tests"]).current_dir(vg_testing::root());
    let printed = vg_testing::tools::run(&mut pytest);
    assert!(printed.contains(" passed"), "{printed}");
    for line in printed.lines().filter(|line| line.starts_with("SKIPPED")) {
        // PyTorch has gigabytes and is not needed elsewhere, so it is not among the packages of the tests.
        let may_lack = line.ends_with("PyTorch is not installed");
        assert!(may_lack || std::env::var_os("VG_NO_SKIP").is_none(), "{line}");
        vg_testing::say(&format!("skipped: {line}"));
    }
}

/// Reconstructs the sample through both interfaces and writes their arrays, one file each.
const SCRIPT: &str = r#"
import sys
from pathlib import Path
import vehicle_gaussians as vg
from vehicle_gaussians import capi

sample, out, names = sys.argv[1], Path(sys.argv[2]), sys.argv[3:]
for name, face in ("native", vg), ("ctypes", capi):
    scene = face.open_scene(sample, views=names)
    car = face.reconstruct(scene.images, scene.masks, scene.cameras, scene.depths).gaussians
    for array in "means", "scales", "quats", "opacities", "sh":
        getattr(car, array).tofile(out / f"{name}.{array}")
"#;

#[test]
fn both_python_interfaces_return_the_bytes_of_rust() {
    let Some(python) = python() else { return };
    let made = sample::run(&sample::open(&INPUTS, true).unwrap(), &Options::default()).unwrap();
    let g = &made.gaussians;
    let arrays = [
        ("means", g.means().as_flattened()),
        ("scales", g.scales().as_flattened()),
        ("quats", g.rotations().as_flattened()),
        ("opacities", g.opacities()),
        ("sh", g.sh()),
    ];
    let folder = vg_testing::tools::scratch();
    let mut script = Command::new(python);
    script
        .args(["-c", SCRIPT])
        .arg(vg_testing::root().join("tests/data/sedan"))
        .arg(folder.path())
        .args(INPUTS);
    vg_testing::tools::run(&mut script);
    for face in ["native", "ctypes"] {
        for (name, expected) in arrays {
            let bytes = std::fs::read(folder.path().join(format!("{face}.{name}"))).unwrap();
            let expected: Vec<u8> = expected.iter().flat_map(|v| v.to_ne_bytes()).collect();
            assert!(bytes == expected, "{face}: {name}: {} bytes, {} by Rust", bytes.len(), expected.len());
        }
    }
}
