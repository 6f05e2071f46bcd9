"""The perceptual distance LPIPS as an ONNX file, to measure renders with.

    pip install torch onnx onnxscript onnxruntime torchvision lpips
    python -m vehicle_gaussians.export.lpips --net alex -o lpips.onnx

Downloads torchvision's ImageNet weights of the backbone on first use (alex 244 MB, vgg 553 MB, squeeze 5 MB). Say the
net with every figure: the three do not agree. Pictures are RGB in [0,1], any number of pairs of 64 pixels or more.
"""

from __future__ import annotations

import sys
from pathlib import Path

from .script import Unavailable, need, need_exporter, parser, run

#: Pixels; the deepest layers of a smaller picture are empty.
LEAST_SIDE = 64
#: Licences of the heads and of torchvision's code and weights, as the packages state them.
LICENCE = "BSD-2-Clause (lpips), BSD-3-Clause (torchvision)"


def main(arguments: list[str] | None = None) -> int:
    options = parser("lpips", "the perceptual distance LPIPS as an ONNX file", "lpips.onnx")
    options.add_argument("--net", choices=["alex", "vgg", "squeeze"], default="alex", help="backbone (%(default)s)")
    options.add_argument("--backbone", type=Path, metavar="FILE.pth", help="torchvision's weights, already downloaded")
    options.add_argument("--random-weights", action="store_true", help="random backbone, to try the export")
    options.add_argument("--seed", type=int, default=1, metavar="N", help="of the random backbone (1)")
    chosen = options.parse_args(arguments)
    if chosen.backbone is not None and not chosen.backbone.is_file():
        raise Unavailable(f"--backbone: {chosen.backbone}: no such file")
    need_exporter()
    need("torchvision", "pip install torchvision")
    need("lpips", "pip install lpips")

    import torch

    from . import contract, lpips_network
    from .graph import file_hash, report, tensor_hash, write

    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(chosen.seed)
        model = lpips_network.built(chosen.net)
    if chosen.random_weights:
        weights = f"random backbone, seed {chosen.seed}, {tensor_hash(model)}"
    else:
        file = chosen.backbone or lpips_network.backbone_file(chosen.net)
        lpips_network.load_backbone(model, chosen.net, file)
        weights = f"{file.name} {file_hash(file)}, lpips v0.1"
    metadata = {
        "vg.contract": contract.VERSION,
        "vg.metric": "lpips",
        "vg.lpips.net": chosen.net,
        "vg.range": "0..1",
        "vg.license": LICENCE,
        "vg.weights": weights,
    }
    axes = {
        0: torch.export.Dim("N", min=1),
        2: torch.export.Dim("H", min=LEAST_SIDE),
        3: torch.export.Dim("W", min=LEAST_SIDE),
    }
    print(f"exporting lpips {chosen.net}, opset {chosen.opset} ...", flush=True)
    differences = write(
        lpips_network.PerceptualDistance(model),
        chosen.output,
        lpips_network.example_inputs(2, 96, 128, seed=0),
        {"a": axes, "b": axes},
        ["lpips"],
        metadata,
        {
            f"{pairs} of {width}x{height}": lpips_network.example_inputs(pairs, height, width, seed=1)
            for pairs, width, height in [(1, 64, 64), (2, 128, 96), (3, 200, 131)]
        },
        chosen.opset,
        external=False,
    )
    report(chosen.output, metadata, differences)
    return 0


if __name__ == "__main__":
    sys.exit(run("lpips", main))
