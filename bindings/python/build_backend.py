"""Build backend (PEP 517): maturin, after the C library has been put into the package.

A wheel holds two faces of one library: the extension module ``_native``, and ``lib/libvg.so`` with ``include/vg.h``
for ctypes and for C. ``python build_backend.py`` alone prepares a checkout for ``maturin develop``.

``pip install ./bindings/python --config-settings features=onnx`` builds both with networks, ``features=gpu`` with
pictures by graphics processors, ``features=gpu,onnx`` with both.

There is no source distribution: the sources are those of the repository that this folder is a part of.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PACKAGE = HERE / "python" / "vehicle_gaussians"
LICENCES = ("LICENSE-MIT", "LICENSE-APACHE")
#: Optional features.
FEATURES = ("gpu", "onnx")


def features_of(config_settings: Any) -> list[str]:
    """The features that were requested through pip, separated by commas."""
    wanted = [name for name in ((config_settings or {}).get("features") or "").split(",") if name]
    for name in wanted:
        if name not in FEATURES:
            sys.exit(f"vehicle-gaussians: features: {name!r}; allowed: {', '.join(FEATURES)}")
    return wanted


def for_maturin(config_settings: Any) -> Any:
    """The settings as arguments of maturin."""
    features = features_of(config_settings)
    if not features:
        return config_settings
    others = {name: value for name, value in config_settings.items() if name != "features"}
    if "build-args" in others:
        sys.exit("vehicle-gaussians: build-args beside features; allowed: one of them")
    return {**others, "build-args": "--features " + ",".join(features)}


def prepare(config_settings: Any = None) -> None:
    """Copies the shared library, the header and the licences to where maturin reads them."""
    check_checkout()
    library = build_library(features_of(config_settings))
    fill(PACKAGE / "lib", [library])
    fill(PACKAGE / "include", [ROOT / "include" / "vg.h"])


def check_checkout() -> None:
    """The library's sources are above this folder; copies the licences."""
    if not (ROOT / "Cargo.toml").is_file():
        sys.exit(
            f"vehicle-gaussians: {ROOT} holds no Cargo.toml: build from a checkout of the whole repository, "
            "with `pip install ./bindings/python`"
        )
    for licence in LICENCES:
        shutil.copyfile(ROOT / licence, HERE / licence)


def build_library(features: list[str]) -> Path:
    """The shared library with the C functions, built with the dependencies and settings of the extension module."""
    command = [find_cargo(), "build", "--release", "--locked", "--package", "libvg", "--lib"]
    if features:
        command += ["--features", ",".join(features)]
    command += ["--manifest-path", str(ROOT / "Cargo.toml"), "--message-format", "json-render-diagnostics"]
    print("Running `" + " ".join(command) + "`", flush=True)
    built = subprocess.run(command, stdout=subprocess.PIPE, check=False, text=True)
    if built.returncode != 0:
        sys.exit(f"vehicle-gaussians: cargo ended with exit code {built.returncode}")
    for message in map(json.loads, built.stdout.splitlines()):
        if message["reason"] == "compiler-artifact" and message["target"]["name"] == "vg":
            for file in map(Path, message["filenames"]):
                if file.suffix in (".so", ".dylib", ".dll"):
                    return file
    sys.exit("vehicle-gaussians: cargo built no shared library")


def find_cargo() -> str:
    """Checks for cargo, because without it maturin tries to install Rust and fails with a traceback."""
    cargo = shutil.which("cargo")
    if cargo is None:
        sys.exit(
            "vehicle-gaussians: no Rust here (cargo is not on PATH), which this package is built with. Install Rust 1.89 or "
            "newer (https://rustup.rs), or take a wheel that was built elsewhere: `pip wheel ./bindings/python` makes one"
        )
    return cargo


def fill(folder: Path, files: list[Path]) -> None:
    """Makes `folder` contain exactly these files."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for file in files:
        shutil.copyfile(file, folder / file.name)


def maturin() -> Any:
    import maturin  # only installed while a build runs

    return maturin


def build_wheel(wheel_directory: str, config_settings: Any = None, metadata_directory: str | None = None) -> str:
    prepare(config_settings)
    return str(maturin().build_wheel(wheel_directory, for_maturin(config_settings), metadata_directory))


def build_editable(wheel_directory: str, config_settings: Any = None, metadata_directory: str | None = None) -> str:
    prepare(config_settings)
    return str(maturin().build_editable(wheel_directory, for_maturin(config_settings), metadata_directory))


def build_sdist(sdist_directory: str, config_settings: Any = None) -> str:
    sys.exit(
        "vehicle-gaussians: there is no source distribution: build a wheel from a checkout of the whole "
        "repository, with `pip wheel ./bindings/python` or `python -m build --wheel bindings/python`"
    )


def prepare_metadata_for_build_wheel(metadata_directory: str, config_settings: Any = None) -> str:
    check_checkout()
    find_cargo()
    return str(maturin().prepare_metadata_for_build_wheel(metadata_directory, for_maturin(config_settings)))


def prepare_metadata_for_build_editable(metadata_directory: str, config_settings: Any = None) -> str:
    check_checkout()
    find_cargo()
    return str(maturin().prepare_metadata_for_build_editable(metadata_directory, for_maturin(config_settings)))


def get_requires_for_build_wheel(config_settings: Any = None) -> list[str]:
    return []


def get_requires_for_build_editable(config_settings: Any = None) -> list[str]:
    return []


if __name__ == "__main__":
    os.chdir(HERE)
    prepare()
