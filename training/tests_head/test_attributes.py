"""The claims and numbers of the tests of crates/vehicle-gaussians/src/head/attributes.rs."""

import math

import pytest
import torch

from attributes import SCALE_BOUNDS, activate, lifted, scale
from gaussians import Y0

ACTIVATIONS = ("softplus", "sigmoid", "relu")
C, S = math.cos(0.5), math.sin(0.5)
TURN = torch.tensor([[[C, -S, 0.0], [S, C, 0.0], [0.0, 0.0, 1.0]]])
POINT = torch.tensor([[1.0, 2.0, 3.0]])
RGB = torch.tensor([[0.25, 0.5, 1.0]])


def activated(raw, offset=True):
    return activate(raw, POINT, TURN, RGB, "softplus", offset)


def test_zero_attributes_give_the_pixels_colour_at_the_lifted_point():
    g = activated(torch.zeros(1, 38))
    assert torch.equal(g.means, POINT)
    assert g.rotations.tolist() == [[1, 0, 0, 0]]
    assert g.opacities.item() == pytest.approx(0.9525741, abs=1e-6)  # sigmoid(3)
    assert g.scales[0, 0].item() == pytest.approx(math.log(2), abs=1e-6)  # softplus(0)
    torch.testing.assert_close(0.5 + Y0 * g.sh[:, 0], RGB, rtol=0, atol=1e-6)


def test_the_offset_rotates_with_the_camera_and_can_be_switched_off():
    raw = torch.zeros(1, 38)
    raw[0, 1] = 0.1
    expected = torch.tensor([[1 + 0.1 * C, 2 + 0.1 * S, 3.0]])
    torch.testing.assert_close(activated(raw).means, expected, rtol=0, atol=1e-6)
    assert torch.equal(activated(raw, offset=False).means, POINT)


def test_channels_are_in_the_librarys_order():
    raw = torch.arange(38.0)[None] / 100
    g = activated(raw, offset=True)
    q = raw[0, 4:8] / raw[0, 4:8].norm()
    torch.testing.assert_close(g.rotations[0], q)
    torch.testing.assert_close(g.scales[0], torch.log1p(raw[0, 8:11].exp()))
    # Coefficient by coefficient, colours innermost.
    torch.testing.assert_close(g.sh[0, 1:].flatten(), raw[0, 14:])
    torch.testing.assert_close(g.sh[0, 0], raw[0, 11:14] + (RGB[0] - 0.5) * 2 * math.sqrt(math.pi))


@pytest.mark.parametrize("value", [-1e4, -100.0, 0.0, 100.0, 1e4, 1e30, -1e30])
def test_raw_values_of_ten_thousand_stay_finite_and_in_bounds(value):
    g = activated(torch.full((1, 38), value))
    assert all(t.isfinite().all() for t in g)
    assert 0 <= g.opacities.item() <= 1
    for activation in ACTIVATIONS:
        found = scale(torch.tensor(value), activation).item()
        assert torch.tensor(SCALE_BOUNDS[0]).item() <= found <= SCALE_BOUNDS[1]


def test_a_zero_quaternion_means_no_rotation_and_has_a_finite_gradient():
    for value in (0.0, 1e-30, 1e30):
        raw = torch.full((1, 38), 1.0)
        raw[0, 4:8] = value
        raw.requires_grad_()
        g = activated(raw)
        expected = [1, 0, 0, 0] if value == 0 else [0.5] * 4
        assert g.rotations[0].tolist() == pytest.approx(expected, abs=1e-6)
        g.rotations[0, 1].backward()
        assert raw.grad.isfinite().all()


def test_softplus_keeps_its_relative_accuracy_for_very_negative_input():
    for s in (-5.0, -15.0, -20.0):
        expected = math.log1p(math.exp(s))
        assert scale(torch.tensor(s), "softplus").item() == pytest.approx(expected, rel=1e-6)


def test_lifting_follows_the_pixel_centres():
    intrinsics = torch.tensor([[10.0, 0, 2], [0, 20.0, 1], [0, 0, 1]])
    pose = torch.eye(4)
    pose[:3, :3], pose[:3, 3] = TURN[0], POINT[0]
    points = lifted(torch.full((3, 4), 2.0), intrinsics, pose)
    assert points.shape == (3, 4, 3)
    p_camera = torch.tensor([2 * (3.5 - 2) / 10, 2 * (2.5 - 1) / 20, 2.0])
    torch.testing.assert_close(points[2, 3], TURN[0] @ p_camera + POINT[0])
