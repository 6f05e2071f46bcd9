"""torchvision's segmentation networks as one probability per pixel: vehicle or not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torchvision.models import get_model, get_model_weights

from .script import Unavailable, downloaded

#: Vehicles among the classes of Pascal VOC.
VEHICLES = ("bus", "car")
#: Normalisation of torchvision's networks.
MEAN, STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)


class VehicleProbability(nn.Module):
    """(N,H,W) from RGB in [0,1], (N,3,H,W)."""

    def __init__(self, network: nn.Module, classes: list[int]) -> None:
        super().__init__()
        self.network, self.classes = network, classes
        self.register_buffer("mean", torch.tensor(MEAN).view(1, 3, 1, 1), persistent=False)
        self.register_buffer("std", torch.tensor(STD).view(1, 3, 1, 1), persistent=False)

    def forward(self, images: Tensor) -> tuple[Tensor]:
        scores = self.network((images - self.mean) / self.std)["out"]
        # A sum of probabilities may exceed 1 by rounding.
        return (scores.softmax(1)[:, self.classes].sum(1).clamp(0, 1),)


def built(name: str) -> nn.Module:
    """The architecture with random weights, without its auxiliary classifier, which only training needs."""
    return get_model(name, weights=None, weights_backbone=None, num_classes=len(categories(name)), aux_loss=False)


def categories(name: str) -> list[str]:
    return list(published(name).meta["categories"])


def vehicle_classes(name: str) -> list[int]:
    return [categories(name).index(vehicle) for vehicle in VEHICLES]


def published(name: str) -> Any:
    return get_model_weights(name).DEFAULT


def weights_file(name: str) -> Path:
    """torchvision's file: in torch's cache, or downloaded there."""
    return downloaded(published(name).url, "weights", "--file")


def load_weights(network: nn.Module, name: str, file: Path) -> None:
    stored = torch.load(file, map_location="cpu", weights_only=True)
    missing = [key for key in network.state_dict() if key not in stored]
    if missing:
        raise Unavailable(f"weights {file}: no {missing[0]}; not a {name}")
    try:
        network.load_state_dict({key: stored[key] for key in network.state_dict()})
    except RuntimeError as error:
        raise Unavailable(f"weights {file}: not a {name}: {error}") from error


def example_inputs(views: int, height: int, width: int, seed: int) -> dict[str, Tensor]:
    generator = torch.Generator().manual_seed(seed)
    return {"images": torch.rand(views, 3, height, width, generator=generator)}
