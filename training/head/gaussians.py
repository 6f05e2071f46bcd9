"""Gaussians in the vehicle frame as tensors, their mirror image, and their colour.

The rules of the library (method: mirror across y = 0), differentiable.
"""

from typing import NamedTuple

import torch

Y0 = 0.28209479177387814
# Basis functions of degree 0 to 3 that change sign under y -> -y: order m < 0.
ODD_IN_Y = (1, 4, 5, 9, 10, 11)


class Gaussians(NamedTuple):
    """n Gaussians; vehicle frame, metres."""

    means: torch.Tensor  # [n][3]
    rotations: torch.Tensor  # [n][4] unit quaternions (w, x, y, z)
    scales: torch.Tensor  # [n][3] standard deviations
    opacities: torch.Tensor  # [n] in [0, 1]
    sh: torch.Tensor  # [n][(degree + 1)^2][3]

    def where(self, which):
        """The Gaussians selected by `which` [n]."""
        return Gaussians(*(t[which] for t in self))

    def mirrored(self):
        """The mirror image across y = 0. (w, x, y, z) becomes (w, -x, y, -z), the rotation M R M: the paper's
        M R is not a rotation, but gives the same covariance."""
        colors = self.means.new_ones(self.sh.shape[1])
        colors[[k for k in ODD_IN_Y if k < len(colors)]] = -1
        return Gaussians(
            self.means * self.means.new_tensor([1, -1, 1]),
            self.rotations * self.means.new_tensor([1, -1, 1, -1]),
            self.scales,
            self.opacities,
            self.sh * colors[:, None],
        )

    def completed(self, input_sides):
        """G_reference and its mirror image (paper eqs. 10, 12). Reference is the side of y = 0 with more
        Gaussians; if equal, with more input cameras (`input_sides`, +1 left, -1 right); then the left."""
        y = self.means[:, 1].detach()
        left, right = int((y > 0).sum()), int((y < 0).sum())
        side = (left > right) - (left < right) or (1 if sum(input_sides) >= 0 else -1)
        reference = self.where(y * side >= 0)
        return joined([reference, reference.mirrored()])


def joined(parts):
    return Gaussians(*(torch.cat(tensors) for tensors in zip(*parts, strict=True)))


def sh_from_rgb(rgb):
    """RGB2SH: coefficient of degree 0 that shows `rgb` in [0, 1]."""
    return (rgb - 0.5) / Y0


def sh_basis(directions, count):
    """The first `count` (1, 4, 9 or 16) real basis functions at unit `directions` [n][3], in the order and with
    the signs of 3DGS. [n][count]"""
    x, y, z = directions.unbind(-1)
    xx, yy, zz = x * x, y * y, z * z
    b = [torch.full_like(x, Y0)]
    if count > 1:
        c = 0.4886025119029199
        b += [-c * y, c * z, -c * x]
    if count > 4:
        c, d, e = 1.0925484305920792, 0.31539156525252005, 0.5462742152960396
        b += [c * x * y, -c * y * z, d * (2 * zz - xx - yy), -c * x * z, e * (xx - yy)]
    if count > 9:
        c, d, e, f, g = 0.5900435899266435, 2.890611442640554, 0.4570457994644658, 0.3731763325901154, 1.445305721320277
        b += [
            -c * y * (3 * xx - yy),
            d * x * y * z,
            -e * y * (4 * zz - xx - yy),
            f * z * (2 * zz - 3 * xx - 3 * yy),
            -e * x * (4 * zz - xx - yy),
            g * z * (xx - yy),
            -c * x * (xx - 3 * yy),
        ]
    return torch.stack(b, -1)


def seen_colors(means, sh, camera_center):
    """Colour of each Gaussian from `camera_center` [3]: max(0, 0.5 + sum_k sh_k Y_k(d)), d from the camera to the
    mean. [n][3]"""
    directions = torch.nn.functional.normalize(means - camera_center, dim=-1)
    basis = sh_basis(directions, sh.shape[1])
    return (0.5 + torch.einsum("nk,nkc->nc", basis, sh)).clamp(min=0)
