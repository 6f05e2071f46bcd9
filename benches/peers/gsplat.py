"""Times gsplat's CUDA kernels on a model and a camera; benches/gpu_vs_gsplat runs it.

    python gsplat.py MODEL.ply WIDTH HEIGHT K VIEW [VIEW ...]

K is fx,fy,cx,cy; each VIEW is a row-major 4x4 matrix from the vehicle to the camera, sixteen numbers with commas; the views
are drawn in turns. Prints the medians of the forward pass and of forward and backward, with depth, in milliseconds, or the
reason why there are none.
"""

from __future__ import annotations

import statistics
import sys
import time
from pathlib import Path

import numpy as np

#: Seconds that each of the two may take.
BUDGET = 6.0


def read(path: Path) -> dict[str, np.ndarray]:
    """Attributes of a PLY in 3DGS's layout, in the form that rasterization takes."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    header = data[:end].decode("ascii").splitlines()
    names = [line.split()[2] for line in header if line.startswith("property float ")]
    rows = np.frombuffer(data, "<f4", offset=end).reshape(-1, len(names))
    column = {name: rows[:, i] for i, name in enumerate(names)}

    def block(prefix: str) -> np.ndarray:
        return np.stack([column[name] for name in names if name.startswith(prefix)], axis=1)

    rest = block("f_rest_").reshape(len(rows), 3, -1).transpose(0, 2, 1)
    return {
        "means": np.stack([column[axis] for axis in "xyz"], axis=1),
        "quats": block("rot_"),
        "scales": np.exp(block("scale_")),
        "opacities": 1 / (1 + np.exp(-column["opacity"])),
        "colors": np.concatenate([block("f_dc_")[:, None], rest], axis=1),
    }


def main(arguments: list[str]) -> None:
    model, width, height, intrinsics, *views = arguments
    attributes = read(Path(model))
    try:
        import torch
        from gsplat import rasterization
    except ImportError as e:
        print(f"none: {e}")
        return
    if not torch.cuda.is_available():
        print("none: PyTorch sees no CUDA device")
        return
    fx, fy, cx, cy = map(float, intrinsics.split(","))
    k = torch.tensor([[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]], device="cuda")
    posed = [torch.tensor([float(v) for v in view.split(",")], device="cuda").reshape(1, 4, 4) for view in views]
    tensors = {name: torch.tensor(np.ascontiguousarray(array), device="cuda") for name, array in attributes.items()}

    def draw(turn: int) -> torch.Tensor:
        color, _, _ = rasterization(
            **tensors,
            viewmats=posed[turn % len(posed)],
            Ks=k,
            width=int(width),
            height=int(height),
            sh_degree=3,
            render_mode="RGB+ED",
            packed=False,
        )
        return color

    def forward(turn: int) -> None:
        with torch.no_grad():
            draw(turn)

    def forward_backward(turn: int) -> None:
        for tensor in tensors.values():
            tensor.grad = None
        draw(turn).square().mean().backward()

    def median(work: object) -> float:
        times: list[float] = []
        begin = time.perf_counter()
        while len(times) < 13 or (time.perf_counter() - begin < BUDGET and len(times) < 60):
            torch.cuda.synchronize()
            start = time.perf_counter()
            work(len(times))  # type: ignore[operator]
            torch.cuda.synchronize()
            times.append(1e3 * (time.perf_counter() - start))
        # The first runs compile, and fill caches.
        return statistics.median(times[3:])

    once = median(forward)
    for tensor in tensors.values():
        tensor.requires_grad_()
    print(f"{once:.2f} ms forward, {median(forward_backward):.2f} ms forward and backward, {torch.cuda.get_device_name()}")


if __name__ == "__main__":
    main(sys.argv[1:])
