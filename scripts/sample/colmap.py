"""Writes a COLMAP model, text and binary, from the same numbers.

Text uses the shortest decimal form that reads back to the same double, so both agree exactly.
"""

import os
import struct
from dataclasses import dataclass

import numpy as np

PINHOLE = 1  # COLMAP's model id
NO_POINT = -1  # a 2D feature without a 3D point


@dataclass
class Image:
    id: int
    name: str
    quaternion: np.ndarray  # [4] w, x, y, z; camera from world
    translation: np.ndarray  # [3]
    pixels: np.ndarray  # [k][2]
    point_ids: np.ndarray  # [k], NO_POINT where the feature is not part of a track


@dataclass
class Point:
    id: int
    position: np.ndarray  # [3]
    colour: np.ndarray  # [3], 0..255
    error: float  # mean reprojection error, pixels
    track: list  # [(image id, index into that image's pixels)]


def quaternion(r):
    """Unit quaternion (w, x, y, z), w >= 0, of a rotation matrix."""
    k = np.array(
        [
            [r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
            [0, r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
            [0, 0, r[1, 1] - r[0, 0] - r[2, 2], r[1, 2] + r[2, 1]],
            [0, 0, 0, r[2, 2] - r[0, 0] - r[1, 1]],
        ]
    )
    # The eigenvector of the largest eigenvalue is exact to rounding for every rotation angle.
    _, vectors = np.linalg.eigh(k + k.T - np.diag(np.diag(k)))
    q = vectors[:, -1]
    return q if q[0] >= 0 else -q


def write_model(folder, size, params, images, points):
    """One shared PINHOLE camera with id 1; params are fx, fy, cx, cy."""
    os.makedirs(folder, exist_ok=True)
    width, height = size
    path = lambda name: os.path.join(folder, name)

    with open(path("cameras.txt"), "w") as f:
        f.write("# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n")
        f.write(f"1 PINHOLE {width} {height} {_numbers(params)}\n")
    with open(path("cameras.bin"), "wb") as f:
        f.write(struct.pack("<QiiQQ4d", 1, 1, PINHOLE, width, height, *params))

    with open(path("images.txt"), "w") as f:
        f.write("# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n")
        f.write("# POINTS2D[] as (X, Y, POINT3D_ID)\n")
        for i in images:
            f.write(f"{i.id} {_numbers(i.quaternion)} {_numbers(i.translation)} 1 {i.name}\n")
            f.write(" ".join(f"{_numbers(uv)} {p}" for uv, p in zip(i.pixels, i.point_ids)) + "\n")
    with open(path("images.bin"), "wb") as f:
        f.write(struct.pack("<Q", len(images)))
        for i in images:
            f.write(struct.pack("<i7di", i.id, *i.quaternion, *i.translation, 1))
            f.write(i.name.encode() + b"\0" + struct.pack("<Q", len(i.pixels)))
            for (u, v), p in zip(i.pixels, i.point_ids):
                f.write(struct.pack("<ddq", u, v, p))

    with open(path("points3D.txt"), "w") as f:
        f.write("# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n")
        for p in points:
            rgb = " ".join(str(int(c)) for c in p.colour)
            track = " ".join(f"{i} {k}" for i, k in p.track)
            f.write(f"{p.id} {_numbers(p.position)} {rgb} {float(p.error)!r} {track}\n")
    with open(path("points3D.bin"), "wb") as f:
        f.write(struct.pack("<Q", len(points)))
        for p in points:
            f.write(struct.pack("<Q3d3Bd", p.id, *p.position, *(int(c) for c in p.colour), p.error))
            f.write(struct.pack("<Q", len(p.track)))
            for i, k in p.track:
                f.write(struct.pack("<ii", i, k))


def _numbers(values):
    return " ".join(repr(float(v)) for v in values)
