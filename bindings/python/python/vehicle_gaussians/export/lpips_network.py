"""The perceptual distance of the lpips package (Zhang et al. 2018) on pictures in [0,1]."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import torch
from lpips import LPIPS
from torch import Tensor, nn

from .script import Unavailable, downloaded

#: torchvision's backbones, with the file that its loader keeps below TORCH_HOME.
BACKBONES = {
    "alex": ("alexnet", "alexnet-owt-7be5be79.pth"),
    "vgg": ("vgg16", "vgg16-397923af.pth"),
    "squeeze": ("squeezenet1_1", "squeezenet1_1-b8a52dc0.pth"),
}
ADDRESS = "https://download.pytorch.org/models/"


class PerceptualDistance(nn.Module):
    """One number per pair, (N), from two batches (N,3,H,W) of RGB in [0,1]."""

    def __init__(self, lpips: Any) -> None:
        super().__init__()
        self.lpips = lpips

    def forward(self, a: Tensor, b: Tensor) -> tuple[Tensor]:
        return (self.lpips(a, b, normalize=True).flatten(),)


def built(net: str) -> Any:
    """The package's own heads on a backbone of random weights."""
    with warnings.catch_warnings():
        # The package uses torchvision's arguments of 2017.
        warnings.simplefilter("ignore")
        return LPIPS(net=net, pnet_rand=True, verbose=False)


def load_backbone(model: Any, net: str, file: Path) -> None:
    """torchvision's ImageNet weights, from its file."""
    stored = torch.load(file, map_location="cpu", weights_only=True)
    # The package cuts the layers `features.I` into slices, and keeps their numbers.
    with torch.no_grad():
        for name, tensor in model.net.named_parameters():
            source = "features." + name.partition(".")[2]
            if source not in stored or stored[source].shape != tensor.shape:
                name_of_net = BACKBONES[net][0]
                raise Unavailable(f"backbone {file}: no {source} of shape {tuple(tensor.shape)}; not a {name_of_net}")
            tensor.copy_(stored[source])


def backbone_file(net: str) -> Path:
    """torchvision's file: in torch's cache, or downloaded there."""
    return downloaded(ADDRESS + BACKBONES[net][1], "backbone's weights", "--backbone")


def example_inputs(pairs: int, height: int, width: int, seed: int) -> dict[str, Tensor]:
    generator = torch.Generator().manual_seed(seed)
    a = torch.rand(pairs, 3, height, width, generator=generator)
    return {"a": a, "b": (a + 0.3 * torch.rand(a.shape, generator=generator)).clamp(0, 1)}
