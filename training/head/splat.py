"""EWA splatting in plain PyTorch (method section 5): the picture of a set of Gaussians, differentiable.

For training at reduced resolution and for tests; the library renders everything else. The steps, in order: project,
low-pass, sort, blend front to back, tile by tile. In training the blend of a tile is computed again in its backward
pass, so memory holds the pixels times Gaussians of one tile, not of the picture.
"""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch.utils.checkpoint import checkpoint

from gaussians import seen_colors

EXTENT_SIGMA = 3.33  # sqrt(2 ln 255) = 3.329: beyond, even an opaque Gaussian is below MIN_ALPHA
MIN_ALPHA = 1 / 255
LEAST_TRANSMITTANCE = 1e-4
CLAMP_MARGIN = 0.15  # the Jacobian is taken inside the image plus this fraction of its size
TILE_PX = 8  # at 96 x 72 pixels nine times faster than 16: fewer Gaussians that miss the pixel


@dataclass(frozen=True)
class Options:
    max_alpha: float = 0.99
    near_m: float = 0.01
    blur_px2: float = 0.3


class Picture(NamedTuple):
    color: torch.Tensor  # [H][W][3], on the background
    alpha: torch.Tensor  # [H][W]
    depth: torch.Tensor  # [H][W] accumulated: not divided by alpha


class Splats(NamedTuple):
    """Projected Gaussians, nearest first; pixels."""

    means: torch.Tensor  # [n][2]
    conics: torch.Tensor  # [n][3] upper triangle of the inverse covariance
    half_sizes: torch.Tensor  # [n][2] of the box outside of which nothing is drawn; no gradient
    depths: torch.Tensor  # [n] metres
    opacities: torch.Tensor  # [n]
    colors: torch.Tensor  # [n][3]


def render(gaussians, camera_from_vehicle, intrinsics, size, background, options=Options()):  # noqa: B008
    """The picture of a camera: `camera_from_vehicle` [4][4], intrinsics [3][3], `size` (width, height),
    `background` [3]."""
    rotation, translation = camera_from_vehicle[:3, :3], camera_from_vehicle[:3, 3]
    colors = seen_colors(gaussians.means, gaussians.sh, -rotation.T @ translation)
    return blend(project(gaussians, colors, camera_from_vehicle, intrinsics, size, options), size, background, options)


def project(gaussians, colors, camera_from_vehicle, intrinsics, size, options):
    rotation, translation = camera_from_vehicle[:3, :3], camera_from_vehicle[:3, 3]
    z = (gaussians.means @ rotation.T + translation)[:, 2].detach()
    # Depths that are equal in float32 keep their order, whatever the precision of the rest.
    order = torch.sort(z.float(), stable=True).indices
    order = order[z[order] > options.near_m]
    means, rotations, scales, opacities = (t[order] for t in gaussians[:4])
    x, y, z = (means @ rotation.T + translation).unbind(-1)

    (fx, _, cx), (_, fy, cy) = intrinsics[0], intrinsics[1]
    width, height = size
    # Far outside the image the linearised projection is meaningless; the Jacobian is evaluated at the rim.
    margin_x, margin_y = CLAMP_MARGIN * width / fx, CLAMP_MARGIN * height / fy
    tx = z * (x / z).clamp(-cx / fx - margin_x, (width - cx) / fx + margin_x)
    ty = z * (y / z).clamp(-cy / fy - margin_y, (height - cy) / fy + margin_y)
    zero = torch.zeros_like(z)
    jacobian = torch.stack([fx / z, zero, -fx * tx / z**2, zero, fy / z, -fy * ty / z**2], -1).view(-1, 2, 3)
    axes = jacobian @ (rotation @ matrices(rotations)) * scales[:, None, :]  # [n][2][3]
    a, b = axes.unbind(1)
    blur = options.blur_px2
    xx, xy, yy = (a * a).sum(-1), (a * b).sum(-1), (b * b).sum(-1)
    # Cauchy-Binet: xx yy - xy^2 without cancellation, which would destroy needles in float32.
    determinant = (blur**2 + blur * (xx + yy) + torch.linalg.cross(a, b).square().sum(-1)).clamp(min=1e-10)
    xx, yy = xx + blur, yy + blur
    return Splats(
        means=torch.stack([fx * x / z + cx, fy * y / z + cy], -1),
        conics=torch.stack([yy, -xy, xx], -1) / determinant[:, None],
        half_sizes=EXTENT_SIGMA * torch.stack([xx, yy], -1).detach().sqrt(),
        depths=z,
        opacities=opacities,
        colors=colors[order],
    )


def matrices(quaternions):
    """Rotation matrices [n][3][3] of quaternions (w, x, y, z), normalised here."""
    w, x, y, z = torch.nn.functional.normalize(quaternions, dim=-1).unbind(-1)
    rows = [
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ]  # fmt: skip
    return torch.stack(rows, -1).view(-1, 3, 3)


def blend(splats, size, background, options):
    width, height = size
    low, high = (splats.means.detach() + s * splats.half_sizes for s in (-1, 1))
    rows = []
    for top in range(0, height, TILE_PX):
        row, bottom = [], min(top + TILE_PX, height)
        in_row = (high[:, 1] > top) & (low[:, 1] < bottom)
        candidates = torch.nonzero(in_row)[:, 0]
        for left in range(0, width, TILE_PX):
            right = min(left + TILE_PX, width)
            here = candidates[(high[candidates, 0] > left) & (low[candidates, 0] < right)]
            if not len(here):
                row.append(splats.colors.new_zeros(bottom - top, right - left, 5))
                continue
            tile = Splats(*(t[here] for t in splats))
            arguments = (tile, (left, top, right, bottom), options)
            if torch.is_grad_enabled():
                row.append(checkpoint(blend_tile, *arguments, use_reentrant=False))
            else:
                row.append(blend_tile(*arguments))
        rows.append(torch.cat(row, 1))
    # [H][W][colour 3, alpha, depth]
    color, alpha, depth = torch.cat(rows, 0).split((3, 1, 1), -1)
    return Picture(color + (1 - alpha) * background, alpha[..., 0], depth[..., 0])


def blend_tile(splats, bounds, options):
    """Colour, alpha and depth [h][w][5] of the pixels in (left, top, right, bottom)."""
    left, top, right, bottom = bounds
    kind = {"dtype": splats.means.dtype, "device": splats.means.device}
    u = torch.arange(left, right, **kind) + 0.5
    v = torch.arange(top, bottom, **kind) + 0.5
    dx = (u[:, None] - splats.means[:, 0])[None]  # [1][w][n]
    dy = (v[:, None] - splats.means[:, 1])[:, None]  # [h][1][n]
    a, b, c = splats.conics.unbind(-1)
    exponent = 0.5 * (a * dx * dx + c * dy * dy) + b * dx * dy  # [h][w][n]
    alpha = (splats.opacities * torch.exp(-exponent)).clamp(max=options.max_alpha)
    alpha = torch.where((alpha >= MIN_ALPHA) & (exponent >= 0), alpha, torch.zeros_like(alpha))
    after = torch.cumprod(1 - alpha, -1)
    before = torch.cat([torch.ones_like(after[..., :1]), after[..., :-1]], -1)
    # The product only decreases: all from the first that would end below the threshold are left out.
    weight = torch.where(after > LEAST_TRANSMITTANCE, alpha * before, torch.zeros_like(alpha))
    values = torch.cat([splats.colors, torch.ones_like(splats.depths)[:, None], splats.depths[:, None]], -1)
    return weight @ values
