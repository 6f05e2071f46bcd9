"""Writes a tiny head and its outputs, for the library's tests of running a head and of the activations.

    python training/head/parity.py tests/data/sedan -o tests/data/head

`tiny_head.onnx` is the contract's graph with narrow layers and random weights; its outputs are meaningless but use
everything. `tiny_head.bin` holds a case, little endian:

    8 bytes    "VGHEAD01"
    uint32     views n, width w, height h, every, samples m
    float32    intrinsics [n][3][3], pixels
    float32    vehicle_from_camera [n][3][4], [R | t], metres
    uint8      images [n][h][w][3], RGB; the head gets value / 255
    float32    depth [n][h][w], planar z in metres, 0 = none
    float32    raw [m][38], PyTorch's
    float32    gaussians [m][38]: mean 3, rotation 4 (w, x, y, z), scale 3, opacity 1, sh [9][3]; 0 without depth

Sample k is pixel k * every of the views in order, row by row. w and h are not multiples of 32: the host pads.
"""

import argparse
from pathlib import Path

import numpy as np
import torch

from attributes import activate, lifted
from export import answer, open_session, randomize, write
from network import CHANNELS, SIZE_MULTIPLE, Head
from scenes import Scene

MAGIC = b"VGHEAD01"
SIZE = (40, 30)
VIEWS = (0, 2)
EVERY = 5
SEED = 1
SPREAD = 0.3


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("scene")
    parser.add_argument("-o", "--output", required=True)
    args = parser.parse_args()
    output = Path(args.output)
    output.mkdir(parents=True, exist_ok=True)

    torch.manual_seed(SEED)
    torch.set_num_threads(1)
    head = Head("tiny")
    randomize(head, SPREAD)
    write(head, output / "tiny_head.onnx", f"random, seed {SEED}", "MIT OR Apache-2.0")

    frames = Scene(args.scene, SIZE).frames
    frames = [frames[i] for i in VIEWS]
    stack = lambda key: torch.stack([getattr(frame, key) for frame in frames])
    bytes_ = (stack("image") * 255).round().to(torch.uint8)
    images, depth, intrinsics, poses = bytes_ / 255, stack("depth"), stack("intrinsics"), stack("vehicle_from_camera")
    with torch.no_grad():
        raw = head.predict(images, depth, intrinsics)
        gaussians = [activated(*view) for view in zip(raw, images, depth, intrinsics, poses, strict=True)]
    print(
        f"PyTorch and ONNX Runtime differ by at most {runtime_difference(output, images, depth, intrinsics, raw):.2g}"
    )

    rows = raw.permute(0, 2, 3, 1).reshape(-1, CHANNELS)[::EVERY]
    gaussians = torch.cat(gaussians)[::EVERY]
    header = np.array([len(frames), *SIZE, EVERY, len(rows)], "<u4")
    floats = lambda t: np.ascontiguousarray(t.numpy(), "<f4").tobytes()
    with open(output / "tiny_head.bin", "wb") as file:
        file.write(MAGIC + header.tobytes())
        file.write(floats(intrinsics) + floats(poses[:, :3]))
        file.write(bytes_.permute(0, 2, 3, 1).contiguous().numpy().tobytes())
        file.write(floats(depth) + floats(rows) + floats(gaussians))


def activated(raw, image, depth, intrinsics, pose):
    """Rows [H * W][38] of the file for one view."""
    points = lifted(depth, intrinsics, pose).reshape(-1, 3)
    rgb = image.reshape(3, -1).T
    g = activate(raw.reshape(CHANNELS, -1).T, points, pose[:3, :3].expand(len(points), 3, 3), rgb)
    rows = torch.cat([g.means, g.rotations, g.scales, g.opacities[:, None], g.sh.flatten(1)], 1)
    return torch.where(depth.reshape(-1, 1) > 0, rows, torch.zeros_like(rows))


def runtime_difference(output, images, depth, intrinsics, raw):
    width, height = SIZE
    pad = (0, -width % SIZE_MULTIPLE, 0, -height % SIZE_MULTIPLE)
    inputs = (*(torch.nn.functional.pad(t, pad) for t in (images, depth)), intrinsics)
    found = answer(open_session(output / "tiny_head.onnx", 1), inputs)[:, :, :height, :width]
    return np.abs(found - raw.numpy()).max()


if __name__ == "__main__":
    main()
