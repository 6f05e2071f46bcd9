"""A public segmentation network as an ONNX file, for photographs without masks.

    pip install torch onnx onnxscript onnxruntime torchvision
    python -m vehicle_gaussians.export.segmentation -o segmentation.onnx
    vg reconstruct SCENE --mask-model segmentation.onnx -o car.ply

torchvision's networks of the 20 classes of Pascal VOC, trained on COCO; cars and buses count as vehicles. Downloads the
weights on first use (deeplabv3_resnet50 168 MB, deeplabv3_mobilenet_v3_large 44 MB, lraspp_mobilenet_v3_large 13 MB).
"""

from __future__ import annotations

import sys
from pathlib import Path

from .script import Unavailable, need, need_exporter, parser, run, size

ARCHITECTURES = ["deeplabv3_resnet50", "deeplabv3_mobilenet_v3_large", "lraspp_mobilenet_v3_large"]
#: Licence of torchvision's code and weights, as the package states it.
LICENCE = "BSD-3-Clause (torchvision)"
#: Pixels; for smaller pictures, the deepest layers have almost no pixels.
LEAST_SIDE = 64


def main(arguments: list[str] | None = None) -> int:
    options = parser("segmentation", "a public segmentation network as an ONNX file, for masks", "segmentation.onnx")
    options.add_argument("--net", choices=ARCHITECTURES, default=ARCHITECTURES[0], help="which (%(default)s)")
    options.add_argument(
        "--size", type=size, default=(768, 576), metavar="WxH", help="pixels, fixed: photographs are stretched"
    )
    options.add_argument("--file", type=Path, metavar="FILE.pth", help="torchvision's weights, already downloaded")
    options.add_argument("--random-weights", action="store_true", help="random weights, to try the export")
    chosen = options.parse_args(arguments)
    if min(chosen.size) < LEAST_SIDE:
        raise Unavailable(f"--size: {chosen.size[0]}x{chosen.size[1]}; allowed: sides of {LEAST_SIDE} or more")
    if chosen.file is not None and not chosen.file.is_file():
        raise Unavailable(f"--file: {chosen.file}: no such file")
    need_exporter()
    need("torchvision", "pip install torchvision")

    import torch

    from . import contract, segmentation_network
    from .graph import file_hash, report, tensor_hash, write

    network = segmentation_network.built(chosen.net)
    if chosen.random_weights:
        weights = f"random, {tensor_hash(network)}"
    else:
        file = chosen.file or segmentation_network.weights_file(chosen.net)
        segmentation_network.load_weights(network, chosen.net, file)
        weights = f"{file.name} {file_hash(file)}"
    metadata = {
        "vg.contract": contract.VERSION,
        "vg.mask": chosen.net,
        "vg.resize": "stretch",
        "vg.license": LICENCE,
        "vg.weights": weights,
    }
    width, height = chosen.size
    print(f"exporting {chosen.net} {width}x{height}, opset {chosen.opset} ...", flush=True)
    differences = write(
        segmentation_network.VehicleProbability(network, segmentation_network.vehicle_classes(chosen.net)),
        chosen.output,
        # Traced with two pictures: with one, the exporter could make the axis constant.
        segmentation_network.example_inputs(2, height, width, seed=0),
        {"images": {0: torch.export.Dim("N", min=1, max=64)}},
        ["mask"],
        metadata,
        {f"N = {n}": segmentation_network.example_inputs(n, height, width, seed=n) for n in (1, 3)},
        chosen.opset,
        external=False,
    )
    report(chosen.output, metadata, differences)
    return 0


if __name__ == "__main__":
    sys.exit(run("segmentation", main))
