"""Makes a PLY file of Gaussians from a COLMAP reconstruction that is read by pycolmap.

    python colmap_to_asset.py [FOLDER] [-o car.ply] [--vehicle-from-world FILE] [--views NAME ...]

FOLDER holds sparse/0, images/ and masks/ (white is vehicle, same name as the image with .png); default: the sample of
this repository. COLMAP's world has an arbitrary pose and scale: FILE holds the similarity (4x4, JSON) to the vehicle's
frame, by default FOLDER/vehicle_from_world.json. vg.similarity_from_points makes it from measured camera centres.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import pycolmap
from PIL import Image

import vehicle_gaussians as vg

SAMPLE = Path(__file__).resolve().parents[1] / "tests" / "data" / "sedan"
SAMPLE_VIEWS = ["000.png", "001.png", "002.png", "003.png"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=SAMPLE)
    parser.add_argument("-o", "--output", type=Path, default=Path("car.ply"))
    parser.add_argument("--vehicle-from-world", type=Path)
    parser.add_argument("--views", nargs="+", help="images to use; all if not given")
    chosen = parser.parse_args()
    folder: Path = chosen.folder
    views = chosen.views or (SAMPLE_VIEWS if folder == SAMPLE else None)

    file = chosen.vehicle_from_world or folder / "vehicle_from_world.json"
    vehicle_from_world = np.array(json.loads(file.read_text())["vehicle_from_world"])
    model = pycolmap.Reconstruction(folder / "sparse" / "0")
    images, masks, cameras, names = [], [], [], []
    for image in sorted(model.images.values(), key=lambda image: image.name):
        if views is not None and image.name not in views:
            continue
        camera, camera_from_world = model.cameras[image.camera_id], image.cam_from_world()
        x, y, z, w = camera_from_world.rotation.quat
        pose = vg.pose_from_colmap((w, x, y, z), camera_from_world.translation, vehicle_from_world)
        cameras.append(vg.Camera.from_colmap(camera.model_name, camera.width, camera.height, camera.params, pose))
        images.append(np.asarray(Image.open(folder / "images" / image.name).convert("RGB")))
        masks.append(np.asarray(Image.open((folder / "masks" / image.name).with_suffix(".png")).convert("L")))
        names.append(image.name)

    made = vg.reconstruct(images, masks, cameras, names=names)
    made.gaussians.save_ply(chosen.output)
    length, width, height = made.report["vehicle"]["size_m"]
    print(f"{chosen.output}: {made.gaussians}, {length:.2f} x {width:.2f} x {height:.2f} m")


if __name__ == "__main__":
    main()
