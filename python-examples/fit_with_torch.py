"""Fits a perturbed model back to pictures with PyTorch.

    python fit_with_torch.py [SCENE] [--steps N] [-o FILE]

SCENE is a folder for open_scene; default: the sample of this repository. Its reconstruction is rendered, perturbed, and
fitted back to those pictures by Adam.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import torch

import vehicle_gaussians as vg
from vehicle_gaussians.torch import render

SAMPLE = Path(__file__).resolve().parents[1] / "tests" / "data" / "sedan"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="?", type=Path, default=SAMPLE)
    parser.add_argument("--steps", type=int, default=40)
    parser.add_argument("-o", "--output", type=Path, default=Path("fitted.ply"))
    chosen = parser.parse_args()
    scene = vg.open_scene(chosen.scene)
    car = vg.reconstruct(scene.images[:4], scene.masks[:4], scene.cameras[:4], scene.depths[:4], check=False).gaussians
    cameras = [camera.scaled(camera.width // 2, camera.height // 2) for camera in scene.cameras]
    wanted = [torch.from_numpy(car.render_planes(camera).color) for camera in cameras]

    torch.manual_seed(1)
    means, quats, scales, opacities, sh = (
        torch.from_numpy(array.copy()) for array in (car.means, car.quats, car.scales, car.opacities, car.sh)
    )
    means += 0.01 * torch.randn_like(means)
    sh += 0.1 * torch.randn_like(sh)
    adam = torch.optim.Adam([{"params": [means], "lr": 1e-3}, {"params": [sh], "lr": 1e-2}])
    for parameter in (means, sh):
        parameter.requires_grad_()
    for step in range(chosen.steps):
        i = step % len(cameras)
        picture = render(means, quats, scales, opacities, sh, cameras[i])
        loss = (picture.color - wanted[i]).square().mean()
        adam.zero_grad()
        loss.backward()
        adam.step()
        if i == 0:
            print(f"step {step}: {-10 * torch.log10(loss).item():.2f} dB")
    arrays = (tensor.detach().numpy() for tensor in (means, scales, quats, opacities, sh))
    vg.Gaussians.from_arrays(*arrays).save_ply(chosen.output)


if __name__ == "__main__":
    main()
