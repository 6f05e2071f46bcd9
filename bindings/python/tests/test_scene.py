"""Scenes on disk."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import vehicle_gaussians as vg
from conftest import INPUTS, SEDAN
from vehicle_gaussians.__main__ import main


def test_the_sample_opens_as_pillow_reads_it(sedan: vg.Scene) -> None:
    assert sedan.names == ["000.png", "001.png", "002.png", "003.png"]
    for i, name in enumerate(sedan.names):
        np.testing.assert_array_equal(sedan.images[i], np.asarray(Image.open(SEDAN / "images" / name)))
        mask, depth = sedan.masks[i], sedan.depths[i]
        assert mask is not None and depth is not None
        np.testing.assert_array_equal(mask, np.asarray(Image.open(SEDAN / "masks" / name)) >= 128)
        millimetres = np.asarray(Image.open(SEDAN / "depth" / name))
        np.testing.assert_allclose(depth, millimetres * 1e-3, rtol=1e-6)
    frames = json.loads((SEDAN / "transforms.json").read_text())["frames"]
    for camera, frame in zip(sedan.cameras, frames, strict=False):
        np.testing.assert_allclose(
            camera.vehicle_from_camera, vg.pose_from_opengl(frame["transform_matrix"]), atol=1e-12
        )


def test_views_come_in_the_order_asked_for() -> None:
    scene = vg.open_scene(str(SEDAN / "transforms.json"), ["003", "images/001.png"], load_depth=False)
    assert scene.names == ["003.png", "001.png"] and scene.depths == [None, None]
    assert vg.open_scene(SEDAN, "002").names == ["002.png"]


def test_a_colmap_model_needs_the_similarity_and_takes_it_as_a_file_or_a_matrix(
    sedan: vg.Scene, tmp_path: Path
) -> None:
    for part in ("images", "masks", "sparse"):
        shutil.copytree(SEDAN / part, tmp_path / part)
    with pytest.raises(vg.VgError, match="vehicle_from_world") as caught:
        vg.open_scene(tmp_path)
    assert caught.value.code is vg.Status.FORMAT
    file = SEDAN / "vehicle_from_world.json"
    matrix = np.array(json.loads(file.read_text())["vehicle_from_world"])
    for similarity in (file, str(file), matrix, matrix.tolist()):
        scene = vg.open_scene(tmp_path, INPUTS, similarity)
        for ours, theirs in zip(scene.cameras, sedan.cameras, strict=True):
            np.testing.assert_allclose(ours.vehicle_from_camera, theirs.vehicle_from_camera, atol=1e-6)


def test_what_looks_like_a_mistake_is_a_warning(tmp_path: Path) -> None:
    shutil.copytree(SEDAN, tmp_path / "car")
    file = tmp_path / "car" / "transforms.json"
    scene = json.loads(file.read_text())
    for frame in scene["frames"]:
        del frame["mask_path"]
    file.write_text(json.dumps(scene))
    shutil.rmtree(tmp_path / "car" / "masks")
    with pytest.warns(UserWarning, match=r"no view has a mask; searched for masks/\{000,000.png,000_mask") as caught:
        vg.open_scene(tmp_path / "car", "000")
    assert caught[0].filename == __file__


def test_the_command_makes_a_ply_file_and_prints_the_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asset = tmp_path / "car.ply"
    assert main([str(SEDAN), str(asset), "--views", ",".join(INPUTS)]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["gaussians"] == len(vg.Gaussians.load_ply(asset))
    assert main([str(tmp_path), str(asset)]) == 1
    assert capsys.readouterr().err.startswith("vehicle_gaussians: error: ")
    # A photograph is not replaced, and a PLY file cannot have another format's name.
    for name in ("000.png", "car.spz"):
        with pytest.raises(SystemExit):
            main([str(SEDAN), str(tmp_path / name)])
        assert "expected a name that ends in .ply" in capsys.readouterr().err
