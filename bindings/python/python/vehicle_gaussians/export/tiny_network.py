"""A small multi-view network of random weights with all the parts of a `graph.Network`.

It has learned nothing, but its answers pass the host's checks: rays, poses and scale are the given ones with small
random corrections, and depth is about the mean distance between the cameras.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from .graph import Given

CHANNELS, WIDTH, HEADS, LEVEL = 64, 96, 4, 24
#: Largest deviation of the random outputs from the given values.
CORRECTION = 0.01


class Attention(nn.Module):
    """Multi-head self-attention and an MLP, each normalised before and added, (B,L,D) to (B,L,D)."""

    def __init__(self) -> None:
        super().__init__()
        self.norm_attention, self.norm_mlp = nn.LayerNorm(WIDTH), nn.LayerNorm(WIDTH)
        self.queries_keys_values = nn.Linear(WIDTH, 3 * WIDTH)
        self.out = nn.Linear(WIDTH, WIDTH)
        self.mlp = nn.Sequential(nn.Linear(WIDTH, 3 * WIDTH), nn.GELU(), nn.Linear(3 * WIDTH, WIDTH))

    def forward(self, tokens: Tensor) -> Tensor:
        split = self.queries_keys_values(self.norm_attention(tokens)).unflatten(-1, (3, HEADS, WIDTH // HEADS))
        queries, keys, values = split.permute(2, 0, 3, 1, 4).unbind(0)  # (B,heads,L,D/heads)
        mixed = nn.functional.scaled_dot_product_attention(queries, keys, values)
        tokens = tokens + self.out(mixed.transpose(1, 2).flatten(2))
        return tokens + self.mlp(self.norm_mlp(tokens))


def vector_encoder(numbers: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(numbers, 32), nn.GELU(), nn.Linear(32, CHANNELS), nn.LayerNorm(CHANNELS))


class TinyNetwork(nn.Module):
    """About 0.5 M parameters for patches of 14 pixels; `size` is (width, height)."""

    taps = (1, 2)
    fused_level = True

    def __init__(self, size: tuple[int, int], patch: int = 14) -> None:
        super().__init__()
        self.patch = patch
        tokens = (size[0] // patch) * (size[1] // patch)
        self.embed = nn.Conv2d(3, CHANNELS, patch, patch)
        self.position = nn.Parameter(0.02 * torch.randn(tokens, CHANNELS))
        self.extra = nn.Parameter(0.02 * torch.randn(1, CHANNELS))
        self.ray_encoder = nn.Sequential(
            nn.PixelUnshuffle(patch),
            nn.Conv2d(3 * patch * patch, CHANNELS, 1),
            nn.GELU(),
            nn.Conv2d(CHANNELS, CHANNELS, 1),
        )
        self.rotation_encoder, self.translation_encoder = vector_encoder(4), vector_encoder(3)
        self.distance_encoder = vector_encoder(1)
        self.fusion_norm = nn.LayerNorm(CHANNELS)
        self.scale_token = nn.Parameter(0.02 * torch.randn(CHANNELS))
        self.project = nn.Linear(CHANNELS, WIDTH)
        self.reference = nn.Parameter(0.1 * torch.randn(WIDTH))
        self.blocks = nn.ModuleList([Attention() for _ in range(4)])
        self.norm = nn.LayerNorm(WIDTH)
        inside = [CHANNELS, WIDTH, WIDTH, WIDTH]
        self.levels = nn.ModuleList([nn.Conv2d(channels, LEVEL, 1) for channels in inside])
        self.refine = nn.ModuleList([nn.Conv2d(LEVEL, LEVEL, 3, padding=1) for _ in inside])
        self.last = nn.Conv2d(LEVEL, 6, 3, padding=1)
        self.pose_head, self.scale_head = nn.Linear(WIDTH, 7), nn.Linear(WIDTH, 1)

    def encode_images(self, images: Tensor) -> tuple[Tensor, Tensor]:
        tokens = self.embed(images).flatten(2).transpose(1, 2) + self.position
        return tokens, self.extra.expand(images.shape[0], -1, -1)

    def encode_rays(self, rays: Tensor) -> Tensor:
        return self.ray_encoder(rays).flatten(2).transpose(1, 2)

    def encode_rotation(self, rotation: Tensor) -> Tensor:
        return self.rotation_encoder(rotation)

    def encode_translation(self, translation: Tensor) -> Tensor:
        return self.translation_encoder(translation)

    def encode_distance(self, log_distance: Tensor) -> Tensor:
        return self.distance_encoder(log_distance)

    def fuse(self, tokens: Tensor) -> Tensor:
        return self.fusion_norm(tokens)

    def norm_tap(self, tokens: Tensor) -> Tensor:
        return self.norm(tokens)

    def dense(self, levels: list[Tensor], given: Given) -> Tensor:
        """From the last level to the first, each added at twice the size of the one before, as DPT does."""
        rows, columns = levels[0].shape[-2:]
        sum_ = torch.zeros(())
        for doublings, index in enumerate(reversed(range(len(levels)))):
            size = (rows << doublings, columns << doublings)
            sum_ = resized(sum_, size) if doublings else sum_
            sum_ = sum_ + resized(self.levels[index](levels[index]), size)
            sum_ = sum_ + self.refine[index](sum_.relu())
        channels = self.last(resized(sum_, given.rays.shape[-2:]))
        return torch.cat([given.rays + CORRECTION * channels[:, :3], 0.2 * channels[:, 3:5], 2 + channels[:, 5:]], 1)

    def pose(self, last: Tensor, given: Given) -> Tensor:
        correction = CORRECTION * self.pose_head(last.mean((2, 3)))
        return torch.cat([given.translation, given.rotation], 1) + correction

    def scale(self, token: Tensor, given: Given) -> Tensor:
        return (given.has_distance * given.log_distance + CORRECTION * self.scale_head(token)).view(1)


def resized(maps: Tensor, size: tuple[int, int]) -> Tensor:
    return nn.functional.interpolate(maps, size=size, mode="bilinear", align_corners=True)
