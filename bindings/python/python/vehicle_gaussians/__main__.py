"""``python -m vehicle_gaussians SCENE ASSET.ply``: reconstructs a scene to a PLY file and prints the report as JSON."""

from __future__ import annotations

import argparse
import json
import sys

from . import VgError, __version__, open_scene, reconstruct


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m vehicle_gaussians", description=__doc__)
    parser.add_argument("scene", metavar="SCENE", help="a transforms.json, a folder that holds one, or a COLMAP folder")
    parser.add_argument("asset", metavar="ASSET.ply", help="the model to write")
    parser.add_argument("--views", metavar="NAME,...", help="views to use; all if not given")
    parser.add_argument("--vehicle-from-world", metavar="FILE", help="similarity from the scene's world, JSON")
    parser.add_argument("--prior", choices=["auto", "given", "hull", "shape"], default="auto", help="depth source")
    parser.add_argument("--threads", type=int, default=0, metavar="N", help="worker threads; 0 means one per core")
    parser.add_argument("--version", action="version", version=__version__)
    chosen = parser.parse_args(arguments)
    # Protects photographs, masks and cameras of the scene: none has a name that ends in .ply.
    if not chosen.asset.lower().endswith(".ply"):
        parser.error(f"ASSET.ply: {chosen.asset}; expected a name that ends in .ply")
    views = chosen.views.split(",") if chosen.views else None
    try:
        scene = open_scene(chosen.scene, views, chosen.vehicle_from_world)
        made = reconstruct(
            scene.images,
            scene.masks,
            scene.cameras,
            scene.depths,
            prior=chosen.prior,
            threads=chosen.threads,
            names=scene.names,
        )
        made.gaussians.save_ply(chosen.asset)
    except VgError as error:
        print(f"vehicle_gaussians: error: {error}", file=sys.stderr)
        return 1
    print(json.dumps(made.report, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())
