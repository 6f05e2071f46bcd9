"""Renders the unseen side of a vehicle through the C interface: ctypes, NumPy, and Pillow for the pictures.

    python ctypes_onesided.py [SCENE] [-o FOLDER]

SCENE is a folder with images/, masks/ and a transforms.json in nerfstudio's format; default: the sample of this
repository. Its split.json lists the input views and the test views, which are rendered into FOLDER.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from vehicle_gaussians import capi

SAMPLE = Path(__file__).resolve().parents[1] / "tests" / "data" / "sedan"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="?", type=Path, default=SAMPLE)
    parser.add_argument("-o", "--output", type=Path, default=Path("unseen"))
    chosen = parser.parse_args()
    scene: Path = chosen.scene
    frames = {Path(f["file_path"]).name: f for f in json.loads((scene / "transforms.json").read_text())["frames"]}
    split = next(iter(json.loads((scene / "split.json").read_text()).values()))

    images = [np.asarray(Image.open(scene / "images" / name).convert("RGB")) for name in split["input"]]
    masks = [np.asarray(Image.open(scene / "masks" / name).convert("L")) for name in split["input"]]
    cameras = [camera(frames[name]) for name in split["input"]]
    context = capi.Context()
    made = capi.reconstruct(images, masks, cameras, names=split["input"], context=context)
    print(f"libvg {capi.version()}: {made.gaussians} in {made.report['total_ms']:.0f} ms")

    chosen.output.mkdir(parents=True, exist_ok=True)
    made.gaussians.save_ply(chosen.output / "car.ply")
    for name in split["test"]:
        picture = made.gaussians.render(camera(frames[name]), context=context)
        Image.fromarray(picture).save(chosen.output / name)


def camera(frame: dict[str, Any]) -> capi.vg_camera:
    """A pinhole camera from transforms.json."""
    params = [frame["fl_x"], frame["fl_y"], frame["cx"], frame["cy"]]
    pose = capi.pose_from_opengl(frame["transform_matrix"])
    return capi.camera_from_colmap("PINHOLE", frame["w"], frame["h"], params, pose)


if __name__ == "__main__":
    main()
