import json

import numpy as np
import pytest
import torch

from attributes import lifted
from lpips import LAYERS, NAMES, Lpips
from network import Head
from scenes import Scene, nearly_mirrored
from train import backward, picture_loss, predict, settle, unseen_psnr, vehicle


@pytest.fixture
def scene(sedan):
    return Scene(sedan, (32, 24))


def test_lifted_points_of_one_view_fall_on_the_vehicle_in_another(sedan):
    frames = Scene(sedan, (128, 96)).frames
    for source, other in ((0, 1), (2, 1), (1, 4)):
        a, b = frames[source], frames[other]
        kept = a.mask & (a.depth > 0)
        points = lifted(a.depth, a.intrinsics, a.vehicle_from_camera)[kept]
        points_camera = (points - b.center) @ b.vehicle_from_camera[:3, :3]
        pixels = points_camera @ b.intrinsics.T
        u, v = (pixels[:, :2] / pixels[:, 2:]).floor().long().unbind(1)
        # Pixels at the rim may be off by one.
        grown = torch.nn.functional.max_pool2d(b.mask.float()[None], 3, 1, 1)[0] > 0
        assert grown[v, u].float().mean() > 0.99


def test_sides_come_from_the_cameras(scene):
    assert [frame.side for frame in scene.frames] == [-1] * 4 + [1] * 4


def test_targets_are_of_the_other_side_and_not_mirrored_inputs(scene):
    random = np.random.default_rng(1)
    inputs, targets = scene.draw(random, 4, 2)
    assert {f.side for f in inputs} == {-1} and {f.side for f in targets} == {1} and len(targets) == 2
    # A target at the position of a mirrored input is never drawn.
    copy = scene.frames[4].vehicle_from_camera
    copy[:3, 3] = scene.frames[0].center * torch.tensor([1, -1, 1]) + 0.2
    assert nearly_mirrored(scene.frames[4], inputs)
    for _ in range(20):
        assert all(f.name != "004.png" for f in scene.draw(random, 4, 2)[1])
    with pytest.raises(ValueError, match="no 5 views"):
        scene.draw(random, 5, 2)


def test_settings_at_the_top_of_the_file_hold_for_all_frames(sedan, tmp_path):
    transforms = json.loads((sedan / "transforms.json").read_text())
    for frame in transforms["frames"]:
        for key in ("fl_x", "fl_y", "cx", "cy"):
            transforms[key] = frame.pop(key)
        for key in ("file_path", "mask_path", "depth_file_path"):
            if key in frame:
                frame[key] = str(sedan / frame[key])
    (tmp_path / "transforms.json").write_text(json.dumps(transforms))
    a, b = Scene(sedan, (32, 24)).frames[1], Scene(tmp_path, (32, 24)).frames[1]
    assert torch.equal(a.intrinsics, b.intrinsics) and torch.equal(a.depth, b.depth)


def test_training_lowers_the_loss_and_keeps_the_unseen_side(scene):
    head = Head("tiny")
    optimizer = torch.optim.AdamW(head.parameters(), 3e-3)
    random = np.random.default_rng(1)
    _, inputs, targets = next(scene.splits())
    before = unseen_psnr(head, inputs, targets)
    losses = []
    for _ in range(12):
        optimizer.zero_grad()
        losses.append(backward(head, [scene.draw(random, 4, 2)], None))
        optimizer.step()
    settle(head, [scene], random, 1, 4)
    assert np.mean(losses[-3:]) < 0.8 * np.mean(losses[:3])
    assert unseen_psnr(head, inputs, targets) > before


def test_gradients_of_the_vehicles_add_up_to_the_batchs(scene):
    """The head's graph is evaluated backwards once for all vehicles, which must give the plain gradient."""
    head = Head("tiny").double()
    torch.nn.init.normal_(head.last.weight, std=0.01)
    for frame in scene.frames:
        for name, value in vars(frame).items():
            if isinstance(value, torch.Tensor) and value.is_floating_point():
                setattr(frame, name, value.double())
    _, inputs, targets = next(scene.splits())
    draws = [(inputs[:2], targets[:1]), (inputs[2:], targets[2:])]
    found_loss = backward(head, draws, None)
    found = [p.grad.clone() for p in head.parameters()]
    head.zero_grad()
    raw = predict(head, inputs)
    losses = [picture_loss(vehicle(head, i, r), t, None) for (i, t), r in zip(draws, raw.split(2), strict=True)]
    (sum(losses) / 2).backward()
    assert found_loss == pytest.approx(sum(losses).item() / 2, rel=1e-9)
    for a, p in zip(found, head.parameters(), strict=True):
        torch.testing.assert_close(a, p.grad, rtol=1e-7, atol=1e-12)


def test_lpips_reads_its_weights_and_is_zero_for_equal_pictures(tmp_path):
    state = {"scaling_layer.shift": torch.zeros(1, 3, 1, 1)}
    for k, (name, (inside, outside, kernel, *_)) in enumerate(zip(NAMES, LAYERS, strict=True)):
        state[f"{name}.weight"] = torch.randn(outside, inside, kernel, kernel) / (inside * kernel**2) ** 0.5
        state[f"{name}.bias"] = torch.zeros(outside)
        state[f"lin{k}.model.1.weight"] = torch.rand(1, outside, 1, 1)
    torch.save(state, tmp_path / "lpips.pth")
    distance = Lpips.read(tmp_path / "lpips.pth")
    a, b = torch.rand(2, 3, 72, 96), torch.rand(2, 3, 72, 96, requires_grad=True)
    assert distance(a, a).tolist() == [0, 0]
    apart = distance(a, b)
    assert apart.shape == (2,) and (apart > 0).all()
    apart.sum().backward()
    assert b.grad.isfinite().all() and b.grad.abs().max() > 0
