"""Time and memory of a head in ONNX Runtime, views one by one and all at once.

    python training/head/measure.py head.onnx --views 4 --width 512 --height 384 --threads 2

Each variant runs in a process of its own, because memory of a first run would hide that of the second. Linux only.
"""

import argparse
import multiprocessing
import time
from pathlib import Path

import onnxruntime

REPEATS = 3


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("model")
    parser.add_argument("--views", type=int, default=4)
    parser.add_argument("--width", type=int, default=512)
    parser.add_argument("--height", type=int, default=384)
    parser.add_argument("--threads", type=int, default=2)
    args = parser.parse_args()

    # Imported here, because the measuring processes must not load PyTorch.
    from export import INPUTS, example

    inputs = example((args.views, args.height, args.width), 1)
    inputs = {name: t.numpy() for name, t in zip(INPUTS, inputs, strict=True)}
    processes = multiprocessing.get_context("spawn")
    for name, size in (("one by one", 1), ("at once", args.views)):
        queue = processes.Queue()
        process = processes.Process(target=measure, args=(args, inputs, size, queue))
        process.start()
        opening, seconds, before, peak = queue.get()
        process.join()
        print(
            f"{args.views} views {args.width}x{args.height} {name}: {seconds:.2f} s (best of {REPEATS}) after "
            f"{opening:.2f} s to open; peak memory {peak:.0f} MB, {before:.0f} MB of it before opening",
            flush=True,
        )


def measure(args, inputs, size, queue):
    before = peak_megabytes()
    start = time.perf_counter()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = args.threads
    session = onnxruntime.InferenceSession(args.model, options, providers=["CPUExecutionProvider"])
    opening, seconds = time.perf_counter() - start, []
    for _ in range(REPEATS):
        start = time.perf_counter()
        for first in range(0, args.views, size):
            session.run(None, {name: t[first : first + size] for name, t in inputs.items()})
        seconds.append(time.perf_counter() - start)
    queue.put((opening, min(seconds), before, peak_megabytes()))


def peak_megabytes():
    # Not getrusage, whose peak starts with the parent's memory at the fork.
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024


if __name__ == "__main__":
    main()
