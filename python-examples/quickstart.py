"""Renders the other side of a vehicle from photographs of one side.

    python quickstart.py [SCENE] [-o FOLDER]

SCENE is a folder with a transforms.json; default: the sample of this repository. If it has a split.json, only its input
views are used. Writes car.ply, unseen.png and, with Matplotlib, quickstart.png into FOLDER.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import matplotlib.pyplot as plt

import vehicle_gaussians as vg

SAMPLE = Path(__file__).resolve().parents[1] / "tests" / "data" / "sedan"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="?", type=Path, default=SAMPLE)
    parser.add_argument("-o", "--output", type=Path, default=Path("."))
    chosen = parser.parse_args()
    chosen.output.mkdir(parents=True, exist_ok=True)

    scene = vg.open_scene(chosen.scene, inputs(chosen.scene))
    made = vg.reconstruct(scene.images, scene.masks, scene.cameras, scene.depths, names=scene.names)
    made.gaussians.save_ply(chosen.output / "car.ply")
    print(f"{made.gaussians} from {len(scene.images)} photographs in {made.report['total_ms']:.0f} ms")

    pictures = [made.gaussians.render(other_side(camera)) for camera in scene.cameras]
    plt.imsave(chosen.output / "unseen.png", pictures[0])
    figure, axes = plt.subplots(2, len(pictures), figsize=(3 * len(pictures), 5), squeeze=False, layout="constrained")
    for column, (photograph, picture) in enumerate(zip(scene.images, pictures, strict=True)):
        axes[0, column].imshow(photograph)
        axes[1, column].imshow(picture)
    axes[0, 0].set_title("photographs")
    axes[1, 0].set_title("the other side")
    for axis in axes.flat:
        axis.set_axis_off()
    figure.savefig(chosen.output / "quickstart.png")


def inputs(scene: Path) -> list[str] | None:
    """The views of split.json's input, or all."""
    split = scene / "split.json"
    if not split.is_file():
        return None
    first = next(iter(json.loads(split.read_text()).values()))
    return [str(name) for name in first["input"]]


def other_side(camera: vg.Camera) -> vg.Camera:
    """The camera mirrored across the plane of symmetry, y = 0; its columns are mirrored too, to keep a rotation."""
    pose = camera.vehicle_from_camera
    pose[1] *= -1
    pose[:, 0] *= -1
    return camera.with_pose(pose)


if __name__ == "__main__":
    main()
