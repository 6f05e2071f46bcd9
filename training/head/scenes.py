"""Scenes for training: posed pictures with masks, and the prior's depth for those that may be input.

A folder with nerfstudio's transforms.json (camera-to-world, OpenGL axes; world = vehicle frame, metres) whose frames
name picture, mask and depth (16 bit planar z, `depth_unit_scale_factor` metres per unit, 0 = none); tests/data/sedan
is one. Its depth stands for that of the frozen prior: to train for a prior, write its depth there.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from PIL import Image

MIRRORED_DISTANCE_M = 0.5  # a target nearer to a mirrored input camera would be a copy of its picture
SIDE_M = 0.5  # cameras nearer to the plane y = 0 see the front or the rear, not a side
VEHICLE = 128  # smallest mask value of the vehicle
OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass
class Frame:
    name: str
    image: torch.Tensor  # [3][H][W] RGB in [0, 1], as taken
    on_white: torch.Tensor  # [H][W][3] the vehicle alone
    mask: torch.Tensor  # [H][W] bool
    depth: torch.Tensor | None  # [H][W] planar z in metres, 0 = none or not vehicle
    intrinsics: torch.Tensor  # [3][3] pixels
    vehicle_from_camera: torch.Tensor  # [4][4]

    @property
    def center(self):
        return self.vehicle_from_camera[:3, 3]

    @property
    def side(self):
        """+1 left, -1 right, 0 front or rear."""
        y = self.center[1].item()
        return 0 if abs(y) <= SIDE_M else (1 if y > 0 else -1)


class Scene:
    """All frames of a folder, reduced to `size` (width, height)."""

    def __init__(self, path, size):
        self.path = Path(path)
        self.transforms = json.loads((self.path / "transforms.json").read_text())
        self.frames = [self.read(frame, size) for frame in self.transforms["frames"]]

    def read(self, frame, size):
        value = lambda key: frame.get(key, self.transforms.get(key))
        image = open_rgb(self.path / frame["file_path"])
        mask = np.asarray(Image.open(self.path / frame["mask_path"]).convert("L")) >= VEHICLE
        height, width = mask.shape
        # The vehicle is cut out before it is reduced: afterwards its rim would contain background.
        on_white = np.where(mask[..., None], image, 1.0).astype(np.float32)
        depth = None
        if "depth_file_path" in frame:
            millimetres = np.asarray(Image.open(self.path / frame["depth_file_path"]))
            # Depth is sampled, because means across an edge are on no surface.
            u, v = ((np.arange(n) + 0.5) * m / n for n, m in zip(size, (width, height), strict=True))
            depth = millimetres.astype(np.float32) * self.transforms.get("depth_unit_scale_factor", 0.001)
            depth = np.where(mask, depth, 0)[np.ix_(v.astype(int), u.astype(int))]
        sx, sy = size[0] / width, size[1] / height
        intrinsics = [[sx * value("fl_x"), 0, sx * value("cx")], [0, sy * value("fl_y"), sy * value("cy")], [0, 0, 1]]
        pose = np.array(frame["transform_matrix"]) @ OPENCV_FROM_OPENGL
        tensor = lambda a: torch.tensor(np.asarray(a), dtype=torch.float32)
        return Frame(
            name=Path(frame["file_path"]).name,
            image=tensor(reduced(image, size)).permute(2, 0, 1),
            on_white=tensor(reduced(on_white, size)),
            mask=torch.tensor(reduced(mask[..., None].astype(np.float32), size)[..., 0] >= 0.5),
            depth=None if depth is None else tensor(depth),
            intrinsics=tensor(intrinsics),
            vehicle_from_camera=tensor(pose),
        )

    def draw(self, random, views, targets):
        """`views` input frames of one side and `targets` of the other (paper sec. "Training scheme")."""
        for _ in range(100):
            side = random.choice([-1, 1])
            sources = [f for f in self.frames if f.side == side and f.depth is not None]
            if len(sources) < views:
                continue
            inputs = [sources[i] for i in random.permutation(len(sources))[:views]]
            unseen = [f for f in self.frames if f.side == -side and not nearly_mirrored(f, inputs)]
            if len(unseen) >= targets:
                return inputs, [unseen[i] for i in random.permutation(len(unseen))[:targets]]
        raise ValueError(f"{self.path}: no {views} views with depth of one side and {targets} targets of the other")

    def splits(self):
        """(name, inputs, targets) of every division that split.json names."""
        frames = {frame.name: frame for frame in self.frames}
        for name, split in json.loads((self.path / "split.json").read_text()).items():
            yield name, [frames[f] for f in split["input"]], [frames[f] for f in split["test"]]


def nearly_mirrored(target, inputs):
    mirror = target.center.new_tensor([1, -1, 1])
    return any((frame.center * mirror - target.center).norm() < MIRRORED_DISTANCE_M for frame in inputs)


def open_rgb(path):
    """[H][W][3] in [0, 1]."""
    return np.asarray(Image.open(path).convert("RGB"), dtype=np.float32) / 255


def reduced(image, size):
    """Means over each pixel's area; [H][W][C] to `size` (width, height)."""
    if size == image.shape[1::-1]:
        return image
    channels = [np.asarray(Image.fromarray(c).resize(size, Image.Resampling.BOX)) for c in np.moveaxis(image, -1, 0)]
    return np.stack(channels, -1)
