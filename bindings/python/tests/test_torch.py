"""Differentiable rendering with PyTorch; without PyTorch, the error."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import vehicle_gaussians as vg
from conftest import looking_at_the_origin

NAMES = ("means", "quats", "scales", "opacities", "sh", "background", "pose")


def test_importing_the_package_does_not_import_torch() -> None:
    code = "import sys, vehicle_gaussians; assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_without_torch_the_error_says_what_to_install() -> None:
    # An entry of None makes Python treat the module as missing.
    code = "import sys; sys.modules['torch'] = None; import vehicle_gaussians.torch"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert ran.returncode == 1
    said = ran.stderr.strip().splitlines()[-1]
    assert said.startswith("ImportError: vehicle_gaussians.torch needs PyTorch") and "pip install torch" in said


@pytest.fixture(scope="module")
def torch() -> Any:
    return pytest.importorskip("torch", reason="PyTorch is not installed")


@pytest.fixture(scope="module")
def camera() -> vg.Camera:
    K = [[20, 0, 8], [0, 20, 6], [0, 0, 1]]
    return vg.Camera.from_matrix(K, looking_at_the_origin((3.0, -4.0, 1.0)), 16, 12)


@pytest.fixture
def scene(torch: Any) -> dict[str, Any]:
    """Three Gaussians, so wide that every pixel is inside each: small motions cause no jumps."""
    values = {
        "means": [[0.3, 0.2, 0.1], [-0.2, 0.4, -0.3], [0.1, -0.5, 0.2]],
        # Norms 2.6, 0.6 and 1.3.
        "quats": [[2.0, 1.0, -1.0, 0.9], [0.1, 0.4, 0.3, -0.3], [0.9, -0.2, 0.9, 0.1]],
        "scales": [[2.0, 1.2, 1.5], [1.3, 2.2, 1.6], [1.8, 1.5, 2.4]],
        "opacities": [0.5, 0.7, 0.4],
        "sh": (0.3 * np.sin(np.arange(36.0))).reshape(3, 4, 3),
        "background": [0.2, 0.5, 0.7],
        "pose": [0.05, -0.1, 0.08, 0.1, 0.05, -0.2],
    }
    return {name: torch.tensor(np.array(v), dtype=torch.float32, requires_grad=True) for name, v in values.items()}


def draw(scene: dict[str, Any], camera: vg.Camera, **settings: Any) -> Any:
    from vehicle_gaussians.torch import render

    arrays = [scene[name] for name in NAMES[:5]]
    chosen = {"background": scene["background"], "pose": scene["pose"], "threads": 1, **settings}
    return render(*arrays, camera, **chosen)


def weighted(torch: Any, picture: Any) -> Any:
    """A loss of every number of the picture, in doubles, so that differences of losses are exact."""
    total = torch.zeros((), dtype=torch.float64)
    for k, plane in enumerate(picture):
        weights = torch.cos(torch.arange(plane.numel(), dtype=torch.float64) * 0.7 + k).reshape(plane.shape)
        total = total + (weights * plane.double()).sum() + 0.1 * plane.double().square().sum()
    return total


@pytest.mark.parametrize("depth_mode", ["expected", "accumulated"])
def test_gradients_are_those_of_finite_differences(
    torch: Any, scene: dict[str, Any], camera: vg.Camera, depth_mode: str
) -> None:
    weighted(torch, draw(scene, camera, depth_mode=depth_mode)).backward()
    step = 4e-3
    for name, tensor in scene.items():
        found = tensor.grad.numpy().ravel()
        assert tensor.grad.dtype == torch.float32 and tensor.grad.shape == tensor.shape
        expected = np.zeros_like(found)
        for i in range(tensor.numel()):
            losses = []
            for sign in (1, -1):
                moved = {k: t.detach().clone() for k, t in scene.items()}
                moved[name].view(-1)[i] += sign * step
                losses.append(float(weighted(torch, draw(moved, camera, depth_mode=depth_mode))))
            expected[i] = (losses[0] - losses[1]) / (2 * step)
        # Pictures are float32: 1e-6 of a loss of 100, over the step; and the third derivative times step squared.
        np.testing.assert_allclose(found, expected, rtol=0.01, atol=0.01 * np.abs(expected).max() + 0.02, err_msg=name)
        assert np.abs(expected).max() > 0.1, name


def test_the_gradient_of_a_quaternion_of_any_norm_is_its_own(
    torch: Any, scene: dict[str, Any], camera: vg.Camera
) -> None:
    weighted(torch, draw(scene, camera)).backward()
    first = scene["quats"].grad.clone()
    longer = {name: t.detach().clone().requires_grad_() for name, t in scene.items()}
    with torch.no_grad():
        longer["quats"] *= -8
    weighted(torch, draw(longer, camera)).backward()
    # Eight times as long and negated: the same rotation, an eighth of the gradient.
    torch.testing.assert_close(longer["quats"].grad, first / -8, rtol=1e-4, atol=1e-5)
    along = (scene["quats"].grad * scene["quats"]).sum(1)
    assert along.abs().max() < 1e-3 * first.abs().max()


def test_only_what_requires_gradients_gets_them(torch: Any, scene: dict[str, Any], camera: vg.Camera) -> None:
    whole = {name: t.detach().clone().requires_grad_() for name, t in scene.items()}
    draw(whole, camera).alpha.sum().backward()
    for name in NAMES:
        only = {k: t.detach().clone().requires_grad_(k == name) for k, t in scene.items()}
        draw(only, camera).alpha.sum().backward()
        assert all((t.grad is None) == (k != name) for k, t in only.items())
        torch.testing.assert_close(only[name].grad, whole[name].grad, rtol=0, atol=0)
    assert not draw({k: t.detach() for k, t in scene.items()}, camera).color.requires_grad


def test_backgrounds_by_name_and_no_pose(torch: Any, scene: dict[str, Any], camera: vg.Camera) -> None:
    gaussians = vg.Gaussians.from_arrays(
        *(scene[name].detach().numpy() for name in ("means", "scales", "quats", "opacities", "sh"))
    )
    for background in ("white", "black", "transparent"):
        picture = draw(scene, camera, background=background, pose=None)
        for plane, expected in zip(picture, gaussians.render_planes(camera, background), strict=True):
            np.testing.assert_array_equal(plane.detach().numpy(), expected)
        picture.color.sum().backward()
    assert scene["background"].grad is None and scene["pose"].grad is None and scene["means"].grad is not None
    zeros = draw(scene, camera, background="white", pose=torch.zeros(6))
    np.testing.assert_array_equal(zeros.alpha.detach().numpy(), gaussians.render_planes(camera).alpha)


def test_steps_of_adam_lower_a_loss(torch: Any, scene: dict[str, Any], camera: vg.Camera) -> None:
    wanted = draw({k: t.detach() for k, t in scene.items()}, camera)
    with torch.no_grad():
        scene["means"] += torch.tensor([0.3, -0.2, 0.1])
        scene["pose"] += 0.05
        scene["sh"] *= 0.5
    adam = torch.optim.Adam([scene[name] for name in ("means", "quats", "sh", "pose")], lr=0.02)
    losses = []
    for _ in range(30):
        adam.zero_grad()
        loss = (draw(scene, camera).color - wanted.color).square().mean()
        losses.append(loss.item())
        loss.backward()
        adam.step()
    assert losses[1] < losses[0] and losses[-1] < 0.2 * losses[0], losses


def test_a_second_way_back_is_an_error(torch: Any, scene: dict[str, Any], camera: vg.Camera) -> None:
    loss = weighted(torch, draw(scene, camera))
    loss.backward()
    with pytest.raises(RuntimeError, match="backward through the graph a second time"):
        loss.backward()
    loss = weighted(torch, draw(scene, camera))
    (first,) = torch.autograd.grad(loss, scene["means"], create_graph=True)
    with pytest.raises(RuntimeError, match="once_differentiable"):
        first.sum().backward()
    # The input of the render was changed in place.
    loss = weighted(torch, draw(scene, camera))
    with torch.no_grad():
        scene["means"] += 1
    with pytest.raises(RuntimeError, match="modified by an inplace operation"):
        loss.backward()


def test_bad_tensors_are_named(torch: Any, scene: dict[str, Any], camera: vg.Camera) -> None:
    for name in NAMES:
        for bad, message in [
            (scene[name].double(), f"^{name}: tensor of torch.float64; allowed: torch.float32"),
            (scene[name].to("meta"), f"^{name}: tensor on meta; allowed: on the CPU"),
            (3, f"^{name}: int; allowed: "),
        ]:
            with pytest.raises(TypeError, match=message):
                draw({**scene, name: bad}, camera)
        bad = scene[name].detach().reshape(1, *scene[name].shape)
        with pytest.raises(vg.VgError, match=rf"^{name}: shape \(.*\); allowed: \("):
            draw({**scene, name: bad}, camera)
    with pytest.raises(vg.VgError, match=r"^opacities\[1\]"):
        draw({**scene, "opacities": scene["opacities"].detach() * torch.tensor([1.0, 5.0, 1.0])}, camera)
    with pytest.raises(vg.VgError, match=r"^quats\[2\]"):
        draw({**scene, "quats": scene["quats"].detach() * torch.tensor([[1.0], [1.0], [0.0]])}, camera)
    with pytest.raises(TypeError, match="^camera: int; allowed: a vehicle_gaussians.Camera"):
        draw(scene, 3)  # type: ignore[arg-type]
    picture = draw(scene, camera)
    with pytest.raises(vg.VgError, match=r"^color\[3, 4\]: inf; allowed: finite"):
        (picture.color[3, 4] * torch.inf).sum().backward()
