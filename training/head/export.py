"""Writes a head as ONNX, contract "gaussian head" version 1, and compares ONNX Runtime's outputs with PyTorch's.

    python training/head/export.py --checkpoint head.pt --license "CC-BY-4.0" -o head.onnx
    python training/head/export.py --encoder resnet50 --random --seed 1 -o head.onnx

Inputs, all float32: images [N][3][H][W] RGB in [0, 1]; depth [N][H][W] planar z in metres, 0 = none; intrinsics
[N][3][3] in pixels, the centre of the top-left pixel at (0.5, 0.5). Output: attributes [N][38][H][W], raw. N, H and W
are free; H and W are multiples of `vg.size_multiple`: the host pads right and bottom with zeros and crops the
output. Every view is processed independently.
"""

import argparse
import hashlib
import warnings
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import torch

from network import SCALE_ACTIVATIONS, SIZE_MULTIPLE, Head, load

CONTRACT = "1"
OPSET = 18
INPUTS = ("images", "depth", "intrinsics")
OUTPUT = "attributes"
CHECK_SIZES = ((2, 96, 128), (1, 64, 160))  # N, H, W


def main():
    parser = argparse.ArgumentParser()
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--checkpoint", help="a checkpoint of train.py")
    source.add_argument("--random", action="store_true", help="an untrained head: the surfel solution")
    parser.add_argument("--encoder", default="resnet50", help="with --random")
    parser.add_argument("--scale-activation", choices=SCALE_ACTIVATIONS, default="softplus", help="with --random")
    parser.add_argument("--no-offset", action="store_true", help="with --random: the head does not move centres")
    parser.add_argument("--seed", type=int, default=1, help="with --random")
    parser.add_argument("--spread", type=float, default=0.0, help="with --random: spread of the last layer")
    parser.add_argument("--license", help="licence of the weights; required with --checkpoint")
    parser.add_argument("-o", "--output", required=True)
    args = parser.parse_args()

    if args.checkpoint:
        if not args.license:
            parser.error("--license: missing; required with --checkpoint, because it is stored in the file")
        head, license = load(args.checkpoint), args.license
        digest = hashlib.sha256(Path(args.checkpoint).read_bytes()).hexdigest()
        weights = f"{Path(args.checkpoint).name} sha256:{digest}"
    else:
        torch.manual_seed(args.seed)
        head = Head(args.encoder, args.scale_activation, not args.no_offset).eval()
        if args.spread:
            randomize(head, args.spread)
        license, weights = args.license or "MIT OR Apache-2.0", f"random, seed {args.seed}"

    write(head, args.output, weights, license)
    print(f"{args.output}: {Path(args.output).stat().st_size / 1e6:.2f} MB, {weights}")
    session = open_session(args.output)
    for shape in CHECK_SIZES:
        worst, largest = difference(head, session, shape)
        print(f"{shape}: PyTorch and ONNX Runtime differ by at most {worst:.2g}, largest value {largest:.3g}")


@torch.no_grad()
def randomize(head, spread):
    """An untrained head in which all layers affect the output, with statistics as after training: without
    them the outputs of a deep residual network are thousands, which makes precision meaningless."""
    norms = [module for module in head.modules() if isinstance(module, torch.nn.BatchNorm2d)]
    for norm in norms:
        norm.momentum = 1.0
    head.train()(*example((4, 128, 128), 0))
    for norm in norms:
        norm.momentum = 0.1
    torch.nn.init.normal_(head.last.weight, std=spread)
    head.eval()


def metadata(head, weights, license):
    return {
        "vg.contract": CONTRACT,
        "vg.head": f"{head.encoder_name}_unet",
        "vg.scale_activation": head.scale_activation,
        "vg.offset": "applied" if head.offset else "ignored",
        "vg.size_multiple": str(SIZE_MULTIPLE),
        "vg.license": license,
        "vg.weights": weights,
    }


def write(head, path, weights, license):
    views, rows, columns = (torch.export.Dim(name, min=1) for name in ("views", "rows", "columns"))
    height, width = SIZE_MULTIPLE * rows, SIZE_MULTIPLE * columns
    with warnings.catch_warnings():
        # The exporter warns that inputs share sizes, which is intended.
        warnings.filterwarnings("ignore", message=".*axis name.*")
        program = torch.onnx.export(
            head,
            example((2, 64, 96), 0),
            input_names=INPUTS,
            output_names=(OUTPUT,),
            opset_version=OPSET,
            dynamic_shapes=({0: views, 2: height, 3: width}, {0: views, 1: height, 2: width}, {0: views}),
            verbose=False,
        )
    model = program.model_proto
    strip(model.graph)
    # Plain names of the sizes, for readers of the file.
    sizes = {
        "images": ("N", 3, "H", "W"),
        "depth": ("N", "H", "W"),
        "intrinsics": ("N", 3, 3),
        OUTPUT: ("N", 38, "H", "W"),
    }
    for value in (*model.graph.input, *model.graph.output):
        value.CopyFrom(onnx.helper.make_tensor_value_info(value.name, onnx.TensorProto.FLOAT, sizes[value.name]))
    onnx.helper.set_model_props(model, metadata(head, weights, license))
    onnx.checker.check_model(model, full_check=True)
    onnx.save(model, path)


def strip(graph):
    """Removes the exporter's notes about its source, which are not needed and are half of a small model."""
    del graph.value_info[:], graph.metadata_props[:]
    for entry in (*graph.node, *graph.initializer, *graph.input, *graph.output):
        del entry.metadata_props[:]
        entry.doc_string = ""


def example(shape, seed):
    """Three inputs for N, H, W: noise, a depth with holes, and a pinhole."""
    views, height, width = shape
    draw = torch.Generator().manual_seed(seed)
    images = torch.rand((views, 3, height, width), generator=draw)
    depth = 4 + 4 * torch.rand((views, height, width), generator=draw)
    depth[torch.rand(depth.shape, generator=draw) < 0.3] = 0
    intrinsics = torch.tensor([[width * 1.1, 0, width / 2], [0, width * 1.2, height / 2], [0, 0, 1]])
    return images, depth, intrinsics.expand(views, 3, 3).contiguous()


def open_session(path, threads=2):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])


def answer(session, inputs):
    return session.run([OUTPUT], {name: t.numpy() for name, t in zip(INPUTS, inputs, strict=True)})[0]


@torch.no_grad()
def difference(head, session, shape, seed=1):
    """Largest absolute difference between PyTorch's and ONNX Runtime's attributes, and the largest attribute."""
    inputs = example(shape, seed)
    expected = head(*inputs).numpy()
    return float(np.abs(expected - answer(session, inputs)).max()), float(np.abs(expected).max())


if __name__ == "__main__":
    main()
