"""Makes the bundled sample: eight posed, masked pictures of a procedural sedan.

    pip install -r scripts/sample/requirements.txt
    python scripts/sample/make_sedan.py tests/data/sedan

The car is drawn by the formulas in this folder, path traced on white, and written with its masks,
depths, poses and a COLMAP model in another gauge. The same numbers come out on every run. Files
are written under a temporary name and moved into place, so a reader never sees half a file.
"""

import argparse
import json
import os
import shutil
import tempfile

import numpy as np
from PIL import Image

import sparse
from cameras import CX, CY, FOCAL, HEIGHT, WIDTH, cameras
from render import Studio
from sedan import build

INPUTS = 4  # the first four cameras
MILLIMETRES = 1000.0


def opengl(vehicle_from_camera):
    """Camera-to-world with OpenGL axes: y up and z backwards."""
    return vehicle_from_camera @ np.diag([1.0, -1.0, -1.0, 1.0])


def write_json(path, value):
    with open(path, "w") as f:
        json.dump(value, f, indent=1)
        f.write("\n")


def write_png(path, array):
    Image.fromarray(array).save(path, optimize=True)


def frame(camera, has_depth):
    out = {"file_path": f"images/{camera.name}", "mask_path": f"masks/{camera.name}"}
    if has_depth:
        out["depth_file_path"] = f"depth/{camera.name}"
    out.update(w=WIDTH, h=HEIGHT, fl_x=FOCAL, fl_y=FOCAL, cx=CX, cy=CY)
    out["transform_matrix"] = opengl(camera.vehicle_from_camera).tolist()
    return out


def make(folder, samples, cell):
    car, size, ground_z = build(cell)
    views = cameras(ground_z)
    studio = Studio(car, ground_z)
    for name in ("images", "masks", "depth"):
        os.makedirs(os.path.join(folder, name))
    pictures = []
    for n, camera in enumerate(views):
        picture = np.round(studio.picture(camera, samples, seed=n)).astype(np.uint8)
        depth = studio.planar_depth(camera)
        mask = np.isfinite(depth)
        write_png(f"{folder}/images/{camera.name}", picture)
        write_png(f"{folder}/masks/{camera.name}", np.where(mask, 255, 0).astype(np.uint8))
        if n < INPUTS:
            millimetres = np.where(mask, np.round(np.where(mask, depth, 0) * MILLIMETRES), 0)
            write_png(f"{folder}/depth/{camera.name}", millimetres.astype(np.uint16))
        pictures.append(picture)
        print(f"{camera.name}: {mask.mean():.1%} vehicle", flush=True)
    sparse.write_sparse(f"{folder}/sparse/0", car, studio, views, pictures)
    write_json(
        f"{folder}/transforms.json",
        {
            "camera_model": "PINHOLE",
            "depth_unit_scale_factor": 1 / MILLIMETRES,
            "frames": [frame(c, n < INPUTS) for n, c in enumerate(views)],
        },
    )
    names = [c.name for c in views]
    write_json(f"{folder}/split.json", {"right_to_left": {"input": names[:INPUTS], "test": names[INPUTS:]}})
    write_json(
        f"{folder}/vehicle_from_world.json",
        {"vehicle_from_world": sparse.vehicle_from_world().tolist()},
    )
    write_json(
        f"{folder}/vehicle.json",
        {"size_m": [float(s) for s in size], "ground_z_m": ground_z},
    )


def move_into(source, target):
    """Replace the files of target by those of source, each in one step."""
    for folder, _, names in os.walk(source):
        there = os.path.join(target, os.path.relpath(folder, source))
        os.makedirs(there, exist_ok=True)
        for name in names:
            # Copied first: the temporary folder may be on another file system.
            part = os.path.join(there, name + ".part")
            shutil.copyfile(os.path.join(folder, name), part)
            os.replace(part, os.path.join(there, name))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--samples", type=int, default=25, help="per subpixel, of which a pixel has 16")
    parser.add_argument("--cell", type=float, default=0.014, help="mesh resolution in metres")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as work:
        make(work, args.samples, args.cell)
        move_into(work, args.folder)


if __name__ == "__main__":
    main()
