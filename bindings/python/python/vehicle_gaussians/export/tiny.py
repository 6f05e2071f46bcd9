"""A small network of random weights as an ONNX file, to test a host without a download.

    python -m vehicle_gaussians.export.tiny -o tiny.onnx --seed 1

The same seed gives the same weights with the same version of torch.
"""

from __future__ import annotations

import sys

from .script import add_prior_options, check_multiple, need_exporter, parser, run

PATCH = 14


def main(arguments: list[str] | None = None) -> int:
    options = parser("tiny", "a small network of random weights as an ONNX file, to test a host", "tiny.onnx")
    add_prior_options(options, "112x84", external=False)
    options.add_argument("--seed", type=int, default=1, metavar="N", help="of the random weights (1)")
    chosen = options.parse_args(arguments)
    check_multiple(chosen.size, PATCH)
    need_exporter()

    import torch

    from .graph import MultiViewPrior, prior_metadata, tensor_hash, write_prior
    from .tiny_network import TinyNetwork

    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(chosen.seed)
        network = TinyNetwork(chosen.size, PATCH)
    metadata = prior_metadata(
        "tiny",
        "along_ray",
        True,
        "cover_crop",
        PATCH,
        max(chosen.size),
        "MIT OR Apache-2.0",
        f"random, seed {chosen.seed}, {tensor_hash(network)}",
    )
    module = MultiViewPrior(network)
    width, height = chosen.size
    external = chosen.data == "external"
    write_prior(module, chosen.output, width, height, metadata, chosen.parity_views, chosen.opset, external)
    return 0


if __name__ == "__main__":
    sys.exit(run("tiny", main))
