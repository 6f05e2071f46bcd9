"""The paper's activations: 38 raw channels per pixel to Gaussians (method section 3), differentiable.

crates/vehicle-gaussians/src/head/attributes.rs of the library computes the same; the tests compare both with the same numbers.
"""

import torch

from gaussians import Gaussians, sh_from_rgb

SCALE_BOUNDS = (1e-10, 3.0)  # sigma_min and sigma_max, metres


def activate(raw, points_vehicle, vehicle_from_camera, rgb, activation="softplus", offset=True):
    """n Gaussians from raw [n][38], lifted points [n][3] in metres, rotations [n][3][3] and rgb [n][3] in [0, 1]."""
    o, dp, q, s, h = raw.split((1, 3, 4, 3, 27), -1)
    means = points_vehicle
    if offset:
        means = means + torch.einsum("nij,nj->ni", vehicle_from_camera, dp)
    sh = h.reshape(-1, 9, 3)
    sh = torch.cat([sh[:, :1] + sh_from_rgb(rgb)[:, None], sh[:, 1:]], 1)
    return Gaussians(means, rotation(q), scale(s, activation), opacity(o[:, 0]), sh)


def opacity(raw):
    return torch.sigmoid(raw + 3)


def scale(raw, activation):
    """clip(activation(s), 1e-10, 3), metres."""
    positive = {"softplus": torch.nn.functional.softplus, "sigmoid": torch.sigmoid, "relu": torch.relu}[activation]
    return positive(raw).clamp(*SCALE_BOUNDS)


def rotation(raw):
    """q / |q|; a zero quaternion means no rotation. [n][4]"""
    # Divided by the largest component first: squares of 1e-30 vanish and those of 1e30 overflow. The quotient does not
    # depend on it, so no gradient passes.
    largest = raw.detach().abs().amax(-1, keepdim=True)
    zero = largest == 0
    identity = raw.new_tensor([1.0, 0.0, 0.0, 0.0])
    q = torch.where(zero, identity, raw / torch.where(zero, torch.ones_like(largest), largest))
    return q / q.norm(dim=-1, keepdim=True)


def lifted(depth, intrinsics, vehicle_from_camera):
    """Vehicle-frame points [H][W][3] of planar depth [H][W] in metres (paper eqs. 3, 4)."""
    height, width = depth.shape
    u = torch.arange(width, dtype=depth.dtype, device=depth.device) + 0.5
    v = torch.arange(height, dtype=depth.dtype, device=depth.device) + 0.5
    x = ((u - intrinsics[0, 2]) / intrinsics[0, 0]).expand(height, width)
    y = ((v - intrinsics[1, 2]) / intrinsics[1, 1])[:, None].expand(height, width)
    points_camera = depth[..., None] * torch.stack([x, y, torch.ones_like(x)], -1)
    return points_camera @ vehicle_from_camera[:3, :3].T + vehicle_from_camera[:3, 3]
