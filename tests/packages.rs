//! Packages for C and C++ programs: the installed package, moved to another folder, and the examples built against it,
//! with the error of their pictures of the unseen side. Also `vg.hpp`, under every compiler that is installed.
//!
//! The library is built once, optimised, in `target`, as the demo is. Tests whose tools are missing are skipped with a
//! printed reason; `VG_NO_SKIP=1` makes it a failure.

#![cfg(target_os = "linux")]

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, Mutex, Weak};
use vg::metrics::{ViewErrors, on_white, psnr};
use vg::render::{CpuRenderer, RenderOptions, Renderer};
use vg::{Scene, io};
use vg_testing::sample::{INPUTS, UNSEEN, open};
use vg_testing::tools::{STRICT, cc, cxx, have, output, run, scratch, target};
use vg_testing::{root, say};

// ---- The package

/// The package, moved from the folder where it was installed.
struct Package {
    folder: tempfile::TempDir,
}

impl Package {
    fn prefix(&self) -> PathBuf {
        self.folder.path().join("moved")
    }

    fn install() -> Self {
        let folder = scratch();
        let (build, installed) = (folder.path().join("build"), folder.path().join("installed"));
        // target/debug/deps -> target
        let cargo_target = target().parent().unwrap().parent().unwrap().to_owned();
        let mut configure = cmake();
        configure.arg("-S").arg(root()).arg("-B").arg(&build);
        configure.arg(define("VG_CARGO_TARGET_DIR", &cargo_target));
        configure.arg(define("CMAKE_INSTALL_PREFIX", &installed));
        configure.arg("-DCMAKE_INSTALL_LIBDIR=lib"); // the default is lib64 on some distributions
        if let Some(cargo) = std::env::var_os("CARGO") {
            configure.arg(define("CARGO_EXECUTABLE", Path::new(&cargo)));
        }
        run(&mut configure);
        run(cmake().arg("--build").arg(&build));
        run(cmake().arg("--install").arg(&build));
        let package = Self { folder };
        std::fs::rename(installed, package.prefix()).unwrap();
        std::fs::remove_dir_all(build).unwrap();
        package
    }
}

/// The package shared by all tests of this run, or `None` if a tool is missing.
fn package() -> Option<Arc<Package>> {
    static SHARED: Mutex<Weak<Package>> = Mutex::new(Weak::new());
    let what = "the CMake package";
    if !have("cmake", "cmake", what) || !have("make", "make", what) || !have(&cc(), "gcc", what) {
        return None;
    }
    let mut shared = SHARED.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let package = shared.upgrade().unwrap_or_else(|| Arc::new(Package::install()));
    *shared = Arc::downgrade(&package);
    Some(package)
}

/// A program that finds libraries as in a user's shell, without cargo's folders.
fn program(name: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(name);
    command.env_remove("LD_LIBRARY_PATH");
    command
}

fn cmake() -> Command {
    program("cmake")
}

fn define(name: &str, path: &Path) -> String {
    format!("-D{name}={}", path.display())
}

fn pkg_config(package: &Package, arguments: &[&str]) -> Vec<String> {
    let mut command = program("pkg-config");
    command.env("PKG_CONFIG_PATH", package.prefix().join("lib/pkgconfig"));
    run(command.args(arguments)).split_whitespace().map(str::to_owned).collect()
}

/// Whether pkg-config finds a library.
fn have_library(name: &str, package: &str, what: &str) -> bool {
    if !have("pkg-config", "pkg-config", what) {
        return false;
    }
    if output(program("pkg-config").args(["--exists", name])).status.success() {
        return true;
    }
    let line = format!("skipped: {what}: no {name} here (Debian: {package})");
    assert!(std::env::var_os("VG_NO_SKIP").is_none(), "{line}");
    say(&line);
    false
}

fn files_below(folder: &Path) -> BTreeSet<String> {
    let mut files = BTreeSet::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let entry = entry.unwrap();
            if entry.file_type().unwrap().is_dir() {
                folders.push(entry.path());
            } else {
                files.insert(entry.path().strip_prefix(folder).unwrap().to_str().unwrap().to_owned());
            }
        }
    }
    files
}

#[test]
fn the_package_has_its_files_and_no_path_of_the_build() {
    let Some(package) = package() else { return };
    let prefix = package.prefix();
    let version = env!("CARGO_PKG_VERSION");
    let mut expected: BTreeSet<String> = [
        "include/vg.h",
        "include/vg.hpp",
        "lib/libvg.a",
        "lib/libvg.so",
        "lib/libvg.so.0",
        "lib/cmake/vg/vgConfig.cmake",
        "lib/cmake/vg/vgConfigVersion.cmake",
        "lib/cmake/vg/vgTargets.cmake",
        "lib/pkgconfig/vg.pc",
    ]
    .map(str::to_owned)
    .into();
    expected.insert(format!("lib/libvg.so.{version}"));
    for entry in std::fs::read_dir(root()).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if name.starts_with("LICENSE") {
            expected.insert(format!("share/doc/vg/{name}"));
        }
    }
    let found = files_below(&prefix);
    assert_eq!(found, expected);

    let link = |name: &str| std::fs::read_link(prefix.join("lib").join(name)).unwrap();
    assert_eq!(link("libvg.so"), Path::new("libvg.so.0"));
    assert_eq!(link("libvg.so.0"), Path::new(&format!("libvg.so.{version}")));
    for name in found.iter().filter(|name| name.ends_with(".cmake") || name.ends_with(".pc")) {
        let text = std::fs::read_to_string(prefix.join(name)).unwrap();
        for place in [package.folder.path(), root()] {
            assert!(!text.contains(place.to_str().unwrap()), "{name} names {}:\n{text}", place.display());
        }
    }
    if have("readelf", "binutils", "the installed library") {
        let library = prefix.join("lib/libvg.so");
        let dynamic = run(program("readelf").args(["-d", "-W"]).arg(&library));
        assert!(dynamic.contains("Library soname: [libvg.so.0]"), "{dynamic}");
        let sections = run(program("readelf").args(["-S", "-W"]).arg(&library));
        assert!(!sections.contains(".debug_") && !sections.contains(".symtab"), "{sections}");
    }
}

#[test]
fn find_package_accepts_compatible_versions() {
    let Some(package) = package() else { return };
    let folder = scratch();
    let (major, minor) = (env!("CARGO_PKG_VERSION_MAJOR"), env!("CARGO_PKG_VERSION_MINOR"));
    let next_major = major.parse::<u32>().unwrap() + 1;
    let next_minor = minor.parse::<u32>().unwrap() + 1;
    let asks = [
        (format!("{major}.{minor}"), true),
        (env!("CARGO_PKG_VERSION").to_owned(), true),
        (format!("{major}.0"), true),
        (format!("{major}.{next_minor}"), false),
        (format!("{next_major}.0"), false),
    ];
    let mut script = String::from("cmake_minimum_required(VERSION 3.18)\nproject(ask LANGUAGES NONE)\n");
    for (version, served) in &asks {
        let wrong = if *served { "NOT vg_FOUND" } else { "vg_FOUND" };
        script += "unset(vg_DIR CACHE)\n";
        script += &format!("find_package(vg {version} CONFIG QUIET)\n");
        script += &format!("if({wrong})\n  message(FATAL_ERROR \"asked for {version}\")\nendif()\n");
    }
    std::fs::write(folder.path().join("CMakeLists.txt"), script).unwrap();
    let mut configure = cmake();
    configure.arg("-S").arg(folder.path()).arg("-B").arg(folder.path().join("build"));
    run(configure.arg(define("CMAKE_PREFIX_PATH", &package.prefix())));
}

// ---- The examples

/// Photographs, on white, of the side that no example gets as input.
fn unseen() -> Scene {
    open(&UNSEEN, false).unwrap()
}

fn sample() -> PathBuf {
    root().join("tests/data/sedan")
}

fn unit(pixels: &[[u8; 3]]) -> Vec<[f32; 3]> {
    pixels.iter().map(|rgb| rgb.map(|c| f32::from(c) / 255.0)).collect()
}

fn read_ppm(path: &Path) -> Vec<[f32; 3]> {
    let bytes = std::fs::read(path).unwrap();
    let header = bytes.iter().position(|&b| b == b'\n').unwrap() + 1;
    assert_eq!(&bytes[..header], b"P6 512 384 255\n");
    unit(bytes[header..].as_chunks::<3>().0)
}

/// Runs `embed_min` on the sample. Returns its error on the first view of the unseen side, dB.
fn embed_min_psnr(embed_min: &Path, folder: &Path) -> f64 {
    let picture = folder.join("unseen.ppm");
    run(program(embed_min).arg(sample()).arg(INPUTS.len().to_string()).arg(&picture));
    let psnr = psnr(&read_ppm(&picture), &on_white(&unseen().views[0]));
    std::fs::remove_file(picture).unwrap();
    psnr
}

/// Runs `opencv_onesided` on the sample. Returns its mean error on the unseen side, dB.
fn opencv_onesided_psnr(opencv_onesided: &Path, folder: &Path, flags: &[&str]) -> f64 {
    run(program(opencv_onesided).arg(sample()).arg(folder).args(flags));
    let psnrs = unseen().views.into_iter().zip(UNSEEN).map(|(view, name)| {
        let drawn = io::image::read(&folder.join(format!("{name}.png"))).unwrap().image;
        psnr(&unit(drawn.pixels()), &on_white(&view))
    });
    psnrs.sum::<f64>() / UNSEEN.len() as f64
}

/// Runs `colmap_vehicle` on the sample. Returns the mean error of its model on the unseen side, dB.
fn colmap_vehicle_psnr(colmap_vehicle: &Path, folder: &Path) -> f64 {
    let model = folder.join("car.ply");
    let mut command = program(colmap_vehicle);
    command.arg(sample()).arg(sample().join("vehicle_from_world.json")).arg(&model).args(INPUTS);
    let printed = run(&mut command);
    assert!(printed.contains("Gaussians of 4 views") && printed.contains("left out"), "{printed}");
    let (car, _) = io::ply::read(&model).unwrap();
    let renderer = CpuRenderer::new();
    let errors = unseen().views.into_iter().map(|view| {
        let drawn = renderer.render(&car, &view.camera, &RenderOptions::default()).unwrap();
        ViewErrors::of(&drawn, &view)
    });
    ViewErrors::mean(&errors.collect::<Vec<_>>()).unwrap().psnr_db
}

/// The bounds are more than half a decibel below the figures of README.md for the sample.
#[test]
fn examples_built_against_the_moved_package_draw_the_unseen_side() {
    let Some(package) = package() else { return };
    if !have(&cxx(), "g++", "the examples") {
        return;
    }
    let folder = scratch();
    let build = folder.path().join("build");
    let warnings = format!("{} -Wconversion", STRICT.join(" "));
    let mut configure = cmake();
    configure.arg("-S").arg(root().join("cpp-examples")).arg("-B").arg(&build);
    configure.arg(define("CMAKE_PREFIX_PATH", &package.prefix()));
    configure.args(["C", "CXX"].map(|language| format!("-DCMAKE_{language}_FLAGS={warnings}")));
    run(&mut configure);
    run(cmake().arg("--build").arg(&build));

    let psnr = embed_min_psnr(&build.join("embed_min"), folder.path());
    assert!(psnr > 22.0, "embed_min: {psnr:.2} dB");
    let psnr = colmap_vehicle_psnr(&build.join("colmap_vehicle"), folder.path());
    assert!(psnr > 23.5, "colmap_vehicle: {psnr:.2} dB");

    let opencv_onesided = build.join("opencv_onesided");
    if !opencv_onesided.exists() {
        let line = "skipped: opencv_onesided: CMake did not find OpenCV (Debian: libopencv-dev)";
        assert!(std::env::var_os("VG_NO_SKIP").is_none(), "{line}");
        say(line);
        return;
    }
    let psnr = opencv_onesided_psnr(&opencv_onesided, folder.path(), &[]);
    assert!(psnr > 23.5, "opencv_onesided: {psnr:.2} dB");
    let psnr = opencv_onesided_psnr(&opencv_onesided, folder.path(), &["--no-depth"]);
    assert!(psnr > 22.0, "opencv_onesided --no-depth: {psnr:.2} dB");
}

#[test]
fn pkg_config_links_a_program_with_the_shared_and_with_the_static_library() {
    let Some(package) = package() else { return };
    if !have("pkg-config", "pkg-config", "linking by pkg-config") {
        return;
    }
    assert_eq!(pkg_config(&package, &["--modversion", "vg"]), [env!("CARGO_PKG_VERSION")]);
    let folder = scratch();
    let source = root().join("cpp-examples/embed_min.c");
    let shared = folder.path().join("shared");
    let mut command = program(cc());
    command.arg(&source).args(pkg_config(&package, &["--cflags", "--libs", "vg"])).arg("-o").arg(&shared);
    run(command.arg(format!("-Wl,-rpath,{}", package.prefix().join("lib").display())));
    let psnr = embed_min_psnr(&shared, folder.path());
    assert!(psnr > 22.0, "shared: {psnr:.2} dB");

    let alone = folder.path().join("static");
    let mut command = program(cc());
    command.arg(&source).args(pkg_config(&package, &["--static", "--cflags", "--libs", "vg"]));
    run(command.arg("-static").arg("-o").arg(&alone));
    // The static program no longer needs the files of the package.
    drop(package);
    let the_same = embed_min_psnr(&alone, folder.path());
    assert!(psnr.to_bits() == the_same.to_bits(), "shared {psnr} dB, static {the_same} dB");
}

// ---- vg.hpp

const NO_EXCEPTIONS: [&str; 2] = ["-fno-exceptions", "-fno-rtti"];
const ALONE: [&str; 2] = ["-DVG_NO_OPENCV", "-DVG_NO_EIGEN"];

fn test_source(name: &str) -> PathBuf {
    root().join("tests/cpp").join(name)
}

/// A compiler with warnings as errors, with the header's folder. Headers of other projects are exempt.
fn strict(compiler: &str, standard: &str, system: &[String]) -> Command {
    let mut command = program(compiler);
    command.args(STRICT).args(["-Wconversion", "-Wshadow"]).arg(format!("-std={standard}"));
    command.arg("-I").arg(root().join("include"));
    command.args(system.iter().map(|flag| flag.replacen("-I", "-isystem", 1)));
    command
}

/// Compiles and runs a test in C++ with the library that cargo built.
fn run_test(mut compile: Command, sources: &[&str], libraries: &[String]) {
    let folder = scratch();
    vg_testing::tools::library_folder(folder.path());
    let test = folder.path().join("test");
    compile.args(sources.iter().map(|name| test_source(name))).arg("-o").arg(&test);
    compile.arg("-L").arg(folder.path()).arg(format!("-Wl,-rpath,{}", folder.path().display()));
    run(compile.args(libraries).arg("-lvg"));
    let result = output(program(&test).arg(folder.path()));
    let errors = String::from_utf8_lossy(&result.stderr);
    assert!(result.status.success() && errors.is_empty(), "{}\n{errors}", result.status);
}

/// The installed compilers, each with both standards.
fn compilers() -> Vec<(String, &'static str)> {
    let mut compilers = vec![];
    for name in ["g++", "clang++"] {
        if have(name, if name == "g++" { name } else { "clang" }, &format!("vg.hpp under {name}")) {
            compilers.extend(["c++17", "c++20"].map(|standard| (name.to_owned(), standard)));
        }
    }
    compilers
}

#[test]
fn vg_hpp_alone_compiles_clean_and_keeps_its_promises_without_exceptions() {
    for (compiler, standard) in compilers() {
        let mut command = strict(&compiler, standard, &[]);
        command.args(NO_EXCEPTIONS).args(ALONE);
        // Two files of one program, one of which includes it twice.
        run_test(command, &["core.cpp", "other_file.cpp"], &[]);
    }
}

#[test]
fn vg_hpp_throws_in_files_that_enable_exceptions_and_not_in_others() {
    for (compiler, standard) in compilers() {
        let command = |extra: &[&str], source: &str| {
            let mut command = strict(&compiler, standard, &[]);
            command.args(ALONE).args(extra).arg("-fsyntax-only").arg(test_source(source));
            command
        };
        let mut both = strict(&compiler, standard, &[]);
        both.args(ALONE);
        run_test(both, &["throwing.cpp", "other_file.cpp"], &[]);
        let refused = output(&mut command(&NO_EXCEPTIONS, "throwing.cpp"));
        let errors = String::from_utf8_lossy(&refused.stderr);
        assert!(!refused.status.success() && errors.contains("do without exceptions"), "{errors}");
    }
}

/// The programs in the opening comment of `vg.hpp`.
fn examples_of_vg_hpp() -> Vec<String> {
    let header = std::fs::read_to_string(root().join("include/vg.hpp")).unwrap();
    let comment = header.split_once("*/").unwrap().0;
    let mut examples = vec![String::new()];
    for line in comment.lines() {
        match line.strip_prefix(" *     ") {
            Some(code) => *examples.last_mut().unwrap() += &format!("{code}\n"),
            // An empty line inside a program, or the text after it.
            None if line == " *" => *examples.last_mut().unwrap() += "\n",
            None => examples.push(String::new()),
        }
    }
    examples.retain(|example| example.contains("int main("));
    examples
}

#[test]
fn the_examples_in_vg_hpp_compile_and_print_their_errors() {
    if !have(&cxx(), "g++", "the examples in vg.hpp") {
        return;
    }
    let examples = examples_of_vg_hpp();
    assert_eq!(examples.len(), 2, "{examples:?}");
    for example in examples {
        let folder = scratch();
        vg_testing::tools::library_folder(folder.path());
        let (source, test) = (folder.path().join("example.cpp"), folder.path().join("example"));
        std::fs::write(&source, &example).unwrap();
        let mut compile = strict(&cxx(), "c++17", &[]);
        compile.args(ALONE).arg(&source).arg("-o").arg(&test);
        compile.arg("-L").arg(folder.path()).arg(format!("-Wl,-rpath,{}", folder.path().display()));
        run(compile.arg("-lvg"));
        let result = output(program(&test).arg(folder.path()).current_dir(folder.path()));
        let errors = String::from_utf8_lossy(&result.stderr);
        assert_eq!(result.status.code(), Some(1), "{errors}");
        assert!(errors.starts_with("VG_STATUS_") && errors.contains(": "), "{errors}");
        assert!(!folder.path().join("car.ply").exists());
    }
}

#[test]
fn vg_hpp_reads_and_fills_matrices_of_opencv() {
    if !have(&cxx(), "g++", "vg.hpp with OpenCV")
        || !have_library("opencv4", "libopencv-dev", "vg.hpp with OpenCV")
    {
        return;
    }
    let query = |what: &str| -> Vec<String> {
        run(program("pkg-config").args([what, "opencv4"])).split_whitespace().map(str::to_owned).collect()
    };
    let include = query("--cflags-only-I");
    // Loading all of OpenCV takes a second.
    let mut libraries = query("--libs-only-L");
    libraries.push("-lopencv_core".into());
    run_test(strict(&cxx(), "c++17", &include), &["opencv.cpp"], &libraries);
    for (compiler, standard) in compilers().into_iter().filter(|(_, standard)| *standard == "c++20") {
        run(strict(&compiler, standard, &include).arg("-fsyntax-only").arg(test_source("opencv.cpp")));
    }
}

#[test]
fn vg_hpp_accepts_poses_of_eigen() {
    if !have(&cxx(), "g++", "vg.hpp with Eigen")
        || !have_library("eigen3", "libeigen3-dev", "vg.hpp with Eigen")
    {
        return;
    }
    let include = run(program("pkg-config").args(["--cflags-only-I", "eigen3"]));
    let include: Vec<String> = include.split_whitespace().map(str::to_owned).collect();
    run_test(strict(&cxx(), "c++17", &include), &["eigen.cpp"], &[]);
    for (compiler, standard) in compilers().into_iter().filter(|(_, standard)| *standard == "c++20") {
        let mut command = strict(&compiler, standard, &include);
        run(command.args(NO_EXCEPTIONS).arg("-fsyntax-only").arg(test_source("eigen.cpp")));
    }
}
