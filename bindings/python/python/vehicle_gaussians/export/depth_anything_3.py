"""Depth Anything 3 as an ONNX file: depth along the optical axis from images, intrinsics and poses.

    pip install torch onnx onnxscript onnxruntime omegaconf addict einops e3nn huggingface_hub safetensors
    pip install --no-deps depth-anything-3
    python -m vehicle_gaussians.export.depth_anything_3 -o da3.onnx

The package as a whole asks for much that an export does not use, therefore --no-deps. Depth is in the network's own
unit; the host finds the scale from the predicted poses, which takes two cameras or more. Of a nested pair of networks
the any-view one is exported. The file has a fixed size of the pictures and takes any number of views.
"""

from __future__ import annotations

import os
import sys

from .script import (
    add_prior_options,
    add_weights_options,
    check_multiple,
    licence,
    need,
    need_exporter,
    parser,
    run,
    weights_folder,
)

PATCH = 14
INSTALL = "pip install --no-deps depth-anything-3 && pip install omegaconf addict einops e3nn"
#: As the project's page states them.
LICENCES = {
    "depth-anything/DA3-SMALL": "Apache-2.0",
    "depth-anything/DA3-BASE": "Apache-2.0",
    "depth-anything/DA3-LARGE": "CC-BY-NC-4.0",
    "depth-anything/DA3-LARGE-1.1": "CC-BY-NC-4.0",
    "depth-anything/DA3-GIANT": "CC-BY-NC-4.0",
    "depth-anything/DA3-GIANT-1.1": "CC-BY-NC-4.0",
    "depth-anything/DA3NESTED-GIANT-LARGE": "CC-BY-NC-4.0",
    "depth-anything/DA3NESTED-GIANT-LARGE-1.1": "CC-BY-NC-4.0",
}


def main(arguments: list[str] | None = None) -> int:
    options = parser("depth_anything_3", "Depth Anything 3 as an ONNX file for the prior onnx", "da3.onnx")
    add_prior_options(options, "504x378", external=True)
    add_weights_options(options, "depth-anything/DA3-BASE", ["da3-small", "da3-base", "da3-large", "da3-giant"])
    options.add_argument("--preset", metavar="NAME", help="architecture, where the name of the weights does not say it")
    chosen = options.parse_args(arguments)
    check_multiple(chosen.size, PATCH)
    need_exporter()
    os.environ.setdefault("DA3_LOG_LEVEL", "WARN")
    need("depth_anything_3.model.da3", INSTALL)

    from . import depth_anything_3_network as network
    from .graph import file_hash, prior_metadata, tensor_hash, write_prior

    if chosen.random_weights:
        model = network.built(chosen.random_weights)
        terms, weights = "none: random weights", f"random {chosen.random_weights} {tensor_hash(model)}"
    else:
        terms = licence(chosen.weights, LICENCES, chosen.license)
        preset = chosen.preset or network.preset_of(chosen.weights)
        folder = weights_folder(chosen.weights)
        model = network.load(preset, folder)
        weights = f"{chosen.weights} {file_hash(folder / 'model.safetensors')}"
    width, height = chosen.size
    module = network.DepthAnything3Prior(model, chosen.size)
    metadata = prior_metadata("da3", "z", False, "stretch", PATCH, max(width, height), terms, weights)
    external = chosen.data == "external"
    write_prior(module, chosen.output, width, height, metadata, chosen.parity_views, chosen.opset, external)
    return 0


if __name__ == "__main__":
    sys.exit(run("depth_anything_3", main))
