"""The any-view network of Depth Anything 3 behind the contract: planar depth in a unit of its own, and poses.

Its parts are called one by one, as in `graph.MultiViewPrior`: upstream's selection of a quaternion by mask and its
largest position as a Python number cannot be exported.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from depth_anything_3.cfg import create_object, load_config
from depth_anything_3.model.dinov2 import vision_transformer
from depth_anything_3.registry import MODEL_REGISTRY
from torch import Tensor, nn

from .graph import (
    IMAGENET_MEAN,
    IMAGENET_STD,
    fix_position_embedding,
    poses_from_quaternions,
    quaternions_from_rotations,
    refuse_missing_tensors,
)
from .script import Unavailable, need

PATCH = 14
#: Upstream's lower limit of the median camera distance, in the caller's unit.
LEAST_DISTANCE = 0.1
#: Parts that the wrapper uses; other parts of a checkpoint (Gaussians, the metric branch) are left out.
PARTS = ("backbone", "head", "cam_enc", "cam_dec")


class DepthAnything3Prior(nn.Module):
    """Estimates depth along the optical axis from images, intrinsics and poses; `size` is (width, height)."""

    OUTPUTS = ("depth", "confidence", "cam_to_ref_pred")

    def __init__(self, network: Any, size: tuple[int, int]) -> None:
        super().__init__()
        width, height = size
        # From this many views on upstream would choose the reference itself, were there no poses; a comparison of N
        # with it, though, fixes N in the export.
        vision_transformer.THRESH_FOR_REF_SELECTION = 0
        transformer = network.backbone.pretrained
        fix_position_embedding(transformer, height, width, PATCH)
        positions = 1 + max(height, width) // PATCH
        for block in transformer.blocks:
            if getattr(block.attn, "rope", None) is not None:
                channels = transformer.embed_dim // transformer.num_heads
                block.attn.rope = PositionRotation(channels, positions, transformer.rope.base_frequency)
        self.network = network
        self.register_buffer("mean", torch.tensor(IMAGENET_MEAN).view(3, 1, 1))
        self.register_buffer("std", torch.tensor(IMAGENET_STD).view(3, 1, 1))

    def forward(self, images: Tensor, intrinsics: Tensor, cam_to_ref: Tensor) -> tuple[Tensor, ...]:
        height, width = (int(side) for side in images.shape[-2:])
        network = self.network
        camera = self.camera_tokens(intrinsics, cam_to_ref, height, width)
        # With camera tokens given, view 0 stays the reference and no view changes its place.
        features, _ = network.backbone(
            ((images - self.mean) / self.std)[None],
            cam_token=camera,
            export_feat_layers=[],
            ref_view_strategy="first",
        )
        # Not in chunks of views: their number would be fixed by the comparison with the chunk's size.
        maps = network.head(features, height, width, patch_start_idx=0, chunk_size=None)
        pose = network.cam_dec(features[-1][1])[0]  # (N,9): translation, quaternion (x, y, z, w), fields of view
        world_from_camera = poses_from_quaternions(pose[:, :3], pose[:, 3:7])
        return maps["depth"][0], maps["depth_conf"][0], in_frame_of_first(world_from_camera)

    def camera_tokens(self, intrinsics: Tensor, cam_to_ref: Tensor, height: int, width: int) -> Tensor:
        """(1,N,C) from pose and fields of view; the principal point is taken to be the centre."""
        translation = cam_to_ref[:, :3, 3] / median(cam_to_ref[:, :3, 3].norm(dim=-1)).clamp(min=LEAST_DISTANCE)
        rotation = quaternions_from_rotations(cam_to_ref[:, :3, :3])
        half_angles = [torch.atan(height / 2 / intrinsics[:, 1, 1]), torch.atan(width / 2 / intrinsics[:, 0, 0])]
        encoding = torch.cat([translation, rotation, 2 * torch.stack(half_angles, -1)], -1)[None]
        encoder = self.network.cam_enc
        return encoder.trunk_norm(encoder.trunk(encoder.token_norm(encoder.pose_branch(encoding))))


def median(values: Tensor) -> Tensor:
    """Median, the lower of the middle two as in torch; by sorting, because the exporter has no median. (1)"""
    middle = torch.arange(values.shape[0])[-1:] // 2
    return values.sort().values.index_select(0, middle)


def in_frame_of_first(poses: Tensor) -> Tensor:
    """first_from_camera from world_from_camera, (N,4,4)."""
    rotation, translation = poses[:1, :3, :3].transpose(1, 2), poses[:1, :3, 3:]
    turned = rotation @ torch.cat([poses[:, :3, :3], poses[:, :3, 3:] - translation], 2)
    return torch.cat([turned, poses[:, 3:]], 1)


class PositionRotation(nn.Module):
    """Rotary position embedding in two dimensions (Heo et al. 2024) for positions below a constant.

    The first half of the channels turns with the row, the second with the column; channel i turns together with
    channel i + a quarter, by the position over frequency^(4 i / channels).
    """

    def __init__(self, channels: int, positions: int, frequency: float) -> None:
        super().__init__()
        quarter = channels // 4
        rates = frequency ** (-torch.arange(quarter, dtype=torch.float32) / quarter)
        angles = torch.arange(positions, dtype=torch.float32)[:, None] * rates
        self.register_buffer("cos", angles.cos())  # (positions, channels / 4)
        self.register_buffer("sin", angles.sin())

    def forward(self, tokens: Tensor, positions: Tensor) -> Tensor:
        """(B,heads,L,channels) turned by positions (B,L,2) of row and column."""
        quarters = tokens.chunk(4, -1)
        turned = []
        for axis in range(2):
            cos, sin = self.cos[positions[..., axis]][:, None], self.sin[positions[..., axis]][:, None]
            first, second = quarters[2 * axis : 2 * axis + 2]
            turned += [first * cos - second * sin, second * cos + first * sin]
        return torch.cat(turned, -1)


def preset_of(weights: str) -> str:
    """da3-small for depth-anything/DA3-SMALL or DA3-SMALL-1.1; the any-view branch for a nested pair."""
    name = Path(weights).name.lower().removesuffix("-1.1")
    return "da3-giant" if name == "da3nested-giant-large" else name


def built(preset: str) -> Any:
    """Random initial weights."""
    if preset not in MODEL_REGISTRY or "metric" in preset or "mono" in preset or "nested" in preset:
        raise Unavailable(f"--preset: {preset!r}; allowed: da3-small, da3-base, da3-large, da3-giant")
    config = load_config(MODEL_REGISTRY[preset])
    for part in ("gs_head", "gs_adapter"):
        config.pop(part, None)
    return create_object(config)


def load(preset: str, folder: Path) -> Any:
    """The any-view network with the weights of a folder."""
    network = built(preset)
    file = folder / "model.safetensors"
    stored = need("safetensors.torch", "pip install safetensors").load_file(str(file))
    prefix = "model.da3." if any(name.startswith("model.da3.") for name in stored) else "model."
    wanted = {
        name.removeprefix(prefix): tensor
        for name, tensor in stored.items()
        if name.startswith(tuple(f"{prefix}{part}." for part in PARTS))
    }
    try:
        network.load_state_dict(wanted, strict=False)
    except RuntimeError as error:  # sizes
        lines = [line.strip() for line in str(error).split("\n")]
        raise Unavailable(f"weights {file} are not those of {preset}: {lines[1] if lines[1:] else lines[0]}") from error
    refuse_missing_tensors(network, wanted, file)
    return network
