"""Steps of OpenSplat's CPU renderer, timed in turns with those of the library: a child process of `benches/refine.rs`.

    python opensplat.py CHECKOUT FOLDER

CHECKOUT is a clone of OpenSplat; PyTorch, NumPy and ninja are needed. Its sources and `opensplat.cpp` are built into an
extension, which PyTorch caches. FOLDER holds `start.ply`, `job.json` and `targets.f32`. The answer to a line `gradients`,
`step` or `fused_step` is the wall and processor seconds of one such step for each view; the answer to `look` is the loss of
the first view, with `picture.f32`, `means.f32` and `means_turning.f32` written to the folder.
"""

import json
import os
import sys
import time
from pathlib import Path

# OpenMP's threads spin while they wait, and compete with OpenSplat's own threads and other programs: four times the
# processor time on a busy machine. The variable is read when PyTorch is loaded.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

import numpy as np  # noqa: E402
import torch  # noqa: E402
from torch.utils.cpp_extension import load  # noqa: E402

THREADS = 2
SOURCES = [
    "rasterizer/gsplat-cpu/gsplat_cpu.cpp",
    "project_gaussians.cpp",
    "rasterize_gaussians.cpp",
    "spherical_harmonics.cpp",
    "ssim.cpp",
]


def main():
    # Standard output is only for answers.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    checkout, folder = (Path(path) for path in sys.argv[1:])
    torch.set_num_threads(THREADS)
    # OpenSplat starts a thread per processor; if there are more, they share as many as the library has.
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:THREADS])
    # Location of `ninja` if it was installed next to this Python.
    os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    extension = load(
        name="vg_bench_opensplat",
        sources=[str(Path(__file__).with_name("opensplat.cpp")), *(str(checkout / source) for source in SOURCES)],
        extra_include_paths=[str(checkout), str(checkout / "rasterizer")],
        extra_cflags=["-O3", "-march=native", "-DNDEBUG"],
        with_cuda=False,
    )
    job = json.loads((folder / "job.json").read_text())
    width, height = job["size"]
    views = len(job["cameras"])
    targets = np.fromfile(folder / "targets.f32", "<f4").reshape(views, height, width, 3)
    parameters, degree = read_gaussians(folder / "start.ply")
    peer = extension.Peer(
        parameters,
        degree,
        torch.tensor(job["cameras"]),
        torch.tensor(job["intrinsics"]),
        torch.from_numpy(targets),
        job["rates"],
        job["noise"],
    )

    for line in sys.stdin:
        word = line.strip()
        if word == "reset":
            peer.reset()
            answer = [0.0, 0.0]
        elif word == "look":
            picture, loss, means = peer.look(0, False)
            turning = peer.look(0, True)[2]
            for name, values in ("picture", picture), ("means", means), ("means_turning", turning):
                values.numpy().astype("<f4").tofile(folder / f"{name}.f32")
            answer = [float(loss), 0.0]
        else:
            run = getattr(peer, word)
            wall, processor = time.perf_counter(), time.process_time()
            for view in range(views):
                run(view)
            answer = [time.perf_counter() - wall, time.process_time() - processor]
        print(*answer, file=answers, flush=True)


def read_gaussians(path):
    """Parameters in OpenSplat's form, and the SH degree, from a PLY file of floats."""
    data = path.read_bytes()
    header, body = data.split(b"end_header\n", 1)
    names = [line.split()[-1] for line in header.decode().splitlines() if line.startswith("property")]
    rows = np.frombuffer(body, "<f4").reshape(-1, len(names))
    column = {name: rows[:, k] for k, name in enumerate(names)}

    def block(prefix, count):
        return np.stack([column[f"{prefix}_{k}"] for k in range(count)], 1)

    bands = sum(name.startswith("f_rest_") for name in names) // 3
    # The file has the channels one after the other.
    rest = block("f_rest", 3 * bands).reshape(-1, 3, bands).transpose(0, 2, 1)
    means = np.stack([column[axis] for axis in "xyz"], 1)
    arrays = [means, block("scale", 3), block("rot", 4), column["opacity"][:, None], block("f_dc", 3), rest]
    return [torch.from_numpy(np.ascontiguousarray(array)) for array in arrays], round((bands + 1) ** 0.5) - 1


if __name__ == "__main__":
    main()
