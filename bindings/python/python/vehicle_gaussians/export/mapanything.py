"""MapAnything as an ONNX file: metric depth from images, intrinsics and poses.

    pip install torch onnx onnxscript onnxruntime
    pip install "mapanything @ git+https://github.com/facebookresearch/map-anything"
    python -m vehicle_gaussians.export.mapanything -o mapanything.onnx

Downloads the weights (4.9 GB) on first use. Exporting and comparing take about 16 GB of memory and ten minutes. The
file has a fixed size of the pictures and takes any number of views; export one file for each aspect ratio in use.
518x392 is the network's own size for 4:3, 518x518 for squares.
"""

from __future__ import annotations

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
INSTALL = 'pip install "mapanything @ git+https://github.com/facebookresearch/map-anything"'
#: As the repositories of the weights state them.
LICENCES = {
    "facebook/map-anything-apache": "Apache-2.0",
    "facebook/map-anything-apache-v1": "Apache-2.0",
    "facebook/map-anything": "CC-BY-NC-4.0",
    "facebook/map-anything-v1": "CC-BY-NC-4.0",
}


def main(arguments: list[str] | None = None) -> int:
    options = parser("mapanything", "MapAnything as an ONNX file for the prior onnx", "mapanything.onnx")
    add_prior_options(options, "518x392", external=True)
    add_weights_options(options, "facebook/map-anything-apache", ["giant", "small"])
    chosen = options.parse_args(arguments)
    check_multiple(chosen.size, PATCH)
    need_exporter()
    need("mapanything.models", INSTALL)
    need("uniception.models.encoders", INSTALL)

    from . import mapanything_network as network
    from .graph import MultiViewPrior, file_hash, prior_metadata, tensor_hash, write_prior

    network.precise()
    if chosen.random_weights:
        model = network.random(chosen.random_weights)
        terms, weights = "none: random weights", f"random {chosen.random_weights} {tensor_hash(model)}"
    else:
        terms = licence(chosen.weights, LICENCES, chosen.license)
        folder = weights_folder(chosen.weights)
        model = network.load(folder)
        weights = f"{chosen.weights} {file_hash(folder / 'model.safetensors')}"
    width, height = chosen.size
    module = MultiViewPrior(network.MapAnythingNetwork(model, chosen.size))
    metadata = prior_metadata("mapanything", "along_ray", True, "cover_crop", PATCH, max(width, height), terms, weights)
    external = chosen.data == "external"
    write_prior(module, chosen.output, width, height, metadata, chosen.parity_views, chosen.opset, external)
    return 0


if __name__ == "__main__":
    sys.exit(run("mapanything", main))
