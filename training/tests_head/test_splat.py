"""The renderer compared with an independent one, and the mirror rule in pictures.

`VG_GSPLAT_GOLDEN` or `../shared/data/gsplat_golden` holds the reference renders, as for crates/vg-splat/tests/render_golden.rs.
"""

import os
from pathlib import Path

import numpy as np
import pytest
import torch

from gaussians import Gaussians, seen_colors, sh_basis
from splat import Options, blend, project, render

ROOT = Path(__file__).parents[2]
GOLDEN = Path(os.environ.get("VG_GSPLAT_GOLDEN", ROOT.parent / "shared/data/gsplat_golden"))
golden = pytest.mark.skipif(not GOLDEN.is_dir(), reason=f"no reference renders at {GOLDEN}: set VG_GSPLAT_GOLDEN")


def read(name, kind):
    file = np.load(GOLDEN / f"{name}.npz")
    tensor = lambda key: torch.tensor(file[key]).to(kind)
    colors = tensor("sh" if "sh" in file.files else "colors")
    g = Gaussians(tensor("means"), tensor("quats_wxyz"), tensor("scales"), tensor("opacities"), colors)
    return tensor, g, (int(file["width"]), int(file["height"]))


def picture(tensor, g, size, options=Options()):  # noqa: B008
    camera = (tensor("viewmats")[0], tensor("Ks")[0], size)
    if g.sh.dim() == 3:
        return render(g, *camera, tensor("background"), options)
    return blend(project(g, g.sh, *camera, options), size, tensor("background"), options)


@golden
@pytest.mark.parametrize(
    ("name", "suffix", "options"),
    [
        ("garden_8k", "", Options()),
        ("garden_8k", "_maxalpha999", Options(max_alpha=0.999)),
        ("garden_8k", "_eps0p1", Options(blur_px2=0.1)),
        ("extreme_256", "", Options()),
        ("grad_sh_300", "", Options()),
        ("grad_colors_300", "", Options()),
    ],
)
def test_pictures_agree_with_the_reference(name, suffix, options):
    for kind in (torch.float64, torch.float32):
        tensor, g, size = read(name, kind)
        with torch.no_grad():
            found = picture(tensor, g, size, options)
        color = (found.color - tensor(f"color_cam0{suffix}")).abs().flatten()
        alpha = (found.alpha - tensor(f"alpha_cam0{suffix}")).abs()
        if kind is torch.float64:
            # The reference is stored as float32.
            assert max(color.max(), alpha.max()) < 1e-7
            torch.testing.assert_close(found.depth, tensor(f"depth_cam0{suffix}"), rtol=1e-6, atol=1e-7)
        else:
            # Thresholds flip under rounding: tight for nearly all pixels, loose for the rest.
            assert color.mean() < 1e-6 and color.sort().values[int(0.999 * len(color))] < 2e-5 and color.max() < 4e-3


@golden
def test_gradients_agree_with_the_reference():
    for kind, tolerance in ((torch.float64, 1e-9), (torch.float32, 1e-3)):
        tensor, g, size = read("grad_sh_300", kind)
        leaves = Gaussians(*(t.requires_grad_() for t in g))
        found = picture(tensor, leaves, size)
        for channel in ("color", "alpha", "depth"):
            loss = (getattr(found, channel) * tensor(f"weights_{channel}")).sum()
            gradients = torch.autograd.grad(loss, leaves, retain_graph=True, allow_unused=True)
            for name, gradient in zip(("means", "quats", "scales", "opacities", "sh"), gradients, strict=True):
                expected = tensor(f"grad_{channel}_{name}")
                if gradient is None:  # alpha and depth do not depend on colours
                    gradient = torch.zeros_like(expected)
                assert (gradient - expected).norm() <= tolerance * expected.norm(), (channel, name)


def some_gaussians(n=60, kind=torch.float64):
    draw = lambda *shape: torch.randn(*shape, dtype=kind)
    return Gaussians(
        draw(n, 3) * torch.tensor([1.5, 0.7, 0.5], dtype=kind),
        torch.nn.functional.normalize(draw(n, 4), dim=-1),
        (draw(n, 3) - 2).exp(),
        torch.sigmoid(draw(n)),
        0.3 * draw(n, 9, 3),
    )


def camera(kind=torch.float64):
    """camera_from_vehicle of a camera 6 m to the right and a little ahead, looking at the vehicle; intrinsics."""
    center = torch.tensor([1.0, -6.0, 1.5], dtype=kind)
    forward = torch.nn.functional.normalize(-center, dim=0)
    right = torch.nn.functional.normalize(torch.linalg.cross(forward, torch.tensor([0, 0, 1.0], dtype=kind)), dim=0)
    rotation = torch.stack([right, torch.linalg.cross(forward, right), forward])
    pose = torch.eye(4, dtype=kind)
    pose[:3, :3], pose[:3, 3] = rotation, -rotation @ center
    return pose, torch.tensor([[70.0, 0, 31], [0, 75, 22], [0, 0, 1]], dtype=kind)


def test_mirrored_gaussians_from_the_mirrored_camera_give_the_flipped_picture():
    size, white = (64, 48), torch.ones(3, dtype=torch.float64)
    g = some_gaussians()
    pose, intrinsics = camera()
    flip = lambda *signs: torch.diag(torch.tensor(signs, dtype=torch.float64))
    mirrored_pose = flip(-1.0, 1, 1, 1) @ pose @ flip(1.0, -1, 1, 1)
    mirrored_intrinsics = intrinsics.clone()
    mirrored_intrinsics[0, 2] = size[0] - intrinsics[0, 2]
    one = render(g, pose, intrinsics, size, white)
    other = render(g.mirrored(), mirrored_pose, mirrored_intrinsics, size, white)
    assert one.alpha.max() > 0.9
    for a, b in zip(one, other, strict=True):
        torch.testing.assert_close(a, b.flip(1), rtol=0, atol=1e-12)


def test_a_mirrored_colour_seen_along_a_mirrored_direction_is_the_same():
    g = some_gaussians()
    center = torch.tensor([1.0, -6.0, 1.5], dtype=torch.float64)
    mirrored_center = center * center.new_tensor([1, -1, 1])
    torch.testing.assert_close(
        seen_colors(g.means, g.sh, center), seen_colors(g.mirrored().means, g.mirrored().sh, mirrored_center)
    )


def test_the_basis_is_orthonormal():
    # Uniform directions: the integral over the sphere by Monte Carlo, 1e5 samples.
    directions = torch.nn.functional.normalize(torch.randn(100_000, 3, dtype=torch.float64), dim=-1)
    basis = sh_basis(directions, 16)
    gram = 4 * torch.pi * basis.T @ basis / len(directions)
    torch.testing.assert_close(gram, torch.eye(16, dtype=gram.dtype), rtol=0, atol=0.03)


def test_mirroring_twice_returns_the_same_numbers():
    g = some_gaussians()
    assert all(torch.equal(a, b) for a, b in zip(g, g.mirrored().mirrored(), strict=True))


def test_the_denser_side_becomes_both_sides():
    g = some_gaussians()
    right = g.where(g.means[:, 1] < 0)
    left = g.where(g.means[:, 1] > 0).where(slice(0, 3))
    parts = Gaussians(*(torch.cat(t) for t in zip(left, right, strict=True)))
    full = parts.completed([1, 1])
    assert len(full.means) == 2 * len(right.means)
    assert torch.equal(full.means[: len(right.means)], right.means)
    assert torch.equal(full.means[len(right.means) :], right.mirrored().means)


def test_equal_sides_are_decided_by_the_input_cameras_then_left():
    g = some_gaussians(2)
    g = g._replace(means=torch.tensor([[0, 1.0, 0], [0, -1.0, 0]], dtype=torch.float64))
    assert g.completed([-1, -1, 1]).means[0, 1] == -1
    assert g.completed([1, -1]).means[0, 1] == 1


def test_an_empty_scene_gives_the_background_and_alpha_zero():
    pose, intrinsics = camera()
    empty = some_gaussians().where(slice(0, 0))
    found = render(empty, pose, intrinsics, (17, 5), torch.tensor([0.2, 0.3, 0.4], dtype=torch.float64))
    assert found.color.shape == (5, 17, 3)
    assert found.alpha.max() == 0 and (found.color[0, 0] == torch.tensor([0.2, 0.3, 0.4], dtype=torch.float64)).all()
