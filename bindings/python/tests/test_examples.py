"""The examples run as written, and their results look like the vehicle."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import vehicle_gaussians as vg
from conftest import REPOSITORY, SEDAN, on_white, psnr

EXAMPLES = REPOSITORY / "python-examples"


def run(name: str, *arguments: str | Path, cwd: Path) -> str:
    command = [sys.executable, str(EXAMPLES / name), *map(str, arguments)]
    ran = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return ran.stdout


def unseen_psnr(asset: Path, unseen: vg.Scene) -> float:
    gaussians = vg.Gaussians.load_ply(asset)
    views = zip(unseen.cameras, unseen.images, unseen.masks, strict=True)
    return float(np.mean([psnr(gaussians.render(c), on_white(i, m)) for c, i, m in views]))


def test_quickstart_draws_the_side_nobody_photographed(tmp_path: Path, sedan: vg.Scene, unseen: vg.Scene) -> None:
    pytest.importorskip("matplotlib")
    said = run("quickstart.py", cwd=tmp_path)
    assert "from 4 photographs" in said
    assert unseen_psnr(tmp_path / "car.ply", unseen) > 24.0
    # The sample is symmetric: the mirrored picture of the other side is the photograph of this side.
    picture = np.asarray(Image.open(tmp_path / "unseen.png").convert("RGB"))
    assert psnr(np.ascontiguousarray(picture[:, ::-1]), on_white(sedan.images[0], sedan.masks[0])) > 20
    figure = np.asarray(Image.open(tmp_path / "quickstart.png").convert("RGB"))
    assert figure.shape == (500, 1200, 3)
    # Both rows, and all columns, show something that is not white.
    for rows in (figure[:250], figure[250:]):
        for panel in np.split(rows, 4, axis=1):
            assert 0.1 < (panel.min(axis=2) < 200).mean() < 0.9


def test_quickstart_takes_a_folder_without_a_split(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    shutil.copytree(SEDAN, tmp_path / "car", ignore=shutil.ignore_patterns("split.json", "depth", "00[3-7].png"))
    text = (tmp_path / "car" / "transforms.json").read_text()
    scene = json.loads(text)
    scene["frames"] = [{k: v for k, v in f.items() if k != "depth_file_path"} for f in scene["frames"][:3]]
    (tmp_path / "car" / "transforms.json").write_text(json.dumps(scene))
    assert "from 3 photographs" in run("quickstart.py", "car", "-o", "out", cwd=tmp_path)
    with Image.open(tmp_path / "out" / "quickstart.png") as figure:
        assert figure.size == (900, 500)


def test_a_colmap_model_becomes_an_asset(tmp_path: Path, unseen: vg.Scene) -> None:
    pytest.importorskip("pycolmap")
    said = run("colmap_to_asset.py", cwd=tmp_path)
    assert unseen_psnr(tmp_path / "car.ply", unseen) > 24.9
    # Length and height from silhouettes; the width is that of the unseen side's mirror image.
    assert said.startswith("car.ply: Gaussians(")


def test_a_colmap_model_that_pycolmap_wrote_reads_alike_here_and_there(tmp_path: Path, unseen: vg.Scene) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    for part in ("images", "masks"):
        shutil.copytree(SEDAN / part, tmp_path / "car" / part)
    (tmp_path / "car" / "sparse" / "0").mkdir(parents=True)
    pycolmap.Reconstruction(SEDAN / "sparse" / "0").write(tmp_path / "car" / "sparse" / "0")
    similarity = SEDAN / "vehicle_from_world.json"
    names = ["000.png", "001.png", "002.png", "003.png"]
    run("colmap_to_asset.py", "car", "-o", "a.ply", "--vehicle-from-world", similarity, "--views", *names, cwd=tmp_path)
    scene = vg.open_scene(tmp_path / "car", names, similarity)
    made = vg.reconstruct(scene.images, scene.masks, scene.cameras)
    theirs = vg.Gaussians.load_ply(tmp_path / "a.ply")
    assert abs(len(theirs) - len(made.gaussians)) < 0.001 * len(theirs)
    assert abs(unseen_psnr(tmp_path / "a.ply", unseen) - 25.35) < 0.3


def test_the_unseen_side_comes_through_ctypes_alone(tmp_path: Path, unseen: vg.Scene) -> None:
    said = run("ctypes_onesided.py", "-o", "out", cwd=tmp_path)
    assert said.startswith(f"libvg {vg.__version__}: Gaussians(")
    for name, image, mask in zip(unseen.names, unseen.images, unseen.masks, strict=True):
        with Image.open(tmp_path / "out" / name) as picture:
            assert psnr(np.asarray(picture), on_white(image, mask)) > 21
    assert unseen_psnr(tmp_path / "out" / "car.ply", unseen) > 24.9


def test_a_shaken_model_is_fitted_back(tmp_path: Path, sedan_made: vg.Reconstruction, sedan: vg.Scene) -> None:
    pytest.importorskip("torch", reason="PyTorch is not installed")
    said = run("fit_with_torch.py", "--steps", "25", "-o", "car.ply", cwd=tmp_path).strip().splitlines()
    quality = [float(line.split()[2]) for line in said]
    assert len(quality) == 4 and quality[-1] > quality[0] + 3, said
    assert len(vg.Gaussians.load_ply(tmp_path / "car.ply")) == len(sedan_made.gaussians)
