"""The wrapper around the smallest Depth Anything 3 with random weights; skipped if it is not installed."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import Any

import pytest

from conftest import stored_once

torch = pytest.importorskip("torch")
os.environ.setdefault("DA3_LOG_LEVEL", "WARN")
with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    pytest.importorskip("depth_anything_3.model.da3")

from vehicle_gaussians.export import contract, depth_anything_3_network, graph, script  # noqa: E402

pytestmark = pytest.mark.filterwarnings("default")
WIDTH, HEIGHT = 70, 56


def random_network() -> Any:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(3)
        made = depth_anything_3_network.built("da3-small").eval()
        # Initially zero, which would have no effect.
        torch.nn.init.normal_(made.backbone.pretrained.pos_embed, std=0.1)
        return made


@pytest.mark.parametrize("views", [1, 4, 5])
def test_the_wrapper_gives_the_results_of_upstream(views: int) -> None:
    inputs = graph.example_inputs(views, WIDTH, HEIGHT, seed=5)
    upstream = upstream_answer(random_network(), inputs)
    module = depth_anything_3_network.DepthAnything3Prior(random_network(), (WIDTH, HEIGHT))
    with torch.no_grad():
        depth, confidence, poses = module(*inputs.values())
    close = {"rtol": 2e-5, "atol": 2e-5}  # float32 sums in another order
    torch.testing.assert_close(depth, upstream["depth"][0], **close)
    torch.testing.assert_close(confidence, upstream["depth_conf"][0], **close)
    last_row = torch.tensor([[[0.0, 0.0, 0.0, 1.0]]]).expand(views, 1, 4)
    # Upstream returns camera_from_world.
    cameras = torch.linalg.inv(torch.cat([upstream["extrinsics"][0][:, :3], last_row], 1).double())
    torch.testing.assert_close(poses.double(), torch.linalg.inv(cameras[0]) @ cameras, rtol=1e-4, atol=1e-4)


def upstream_answer(network: Any, inputs: dict[str, Any]) -> Any:
    """Normalised as its interface does: the world is view 0, distances are in units of their median."""
    mean, std = (torch.tensor(values).view(3, 1, 1) for values in (graph.IMAGENET_MEAN, graph.IMAGENET_STD))
    world_from_camera = inputs["cam_to_ref"].clone()
    world_from_camera[:, :3, 3] /= world_from_camera[:, :3, 3].norm(dim=-1).median().clamp(min=0.1)
    with torch.no_grad():
        return network(
            ((inputs["images"] - mean) / std)[None],
            torch.linalg.inv(world_from_camera)[None],
            inputs["intrinsics"][None],
            ref_view_strategy="first",
        )


def test_the_file_keeps_the_contract_for_any_number_of_views(tmp_path: Path) -> None:
    path = tmp_path / "da3.onnx"
    module = depth_anything_3_network.DepthAnything3Prior(random_network(), (WIDTH, HEIGHT))
    metadata = graph.prior_metadata("da3", "z", False, "stretch", 14, WIDTH, "none", "random")
    graph.write_prior(module, path, WIDTH, HEIGHT, metadata, [1, 4], 20, external=True)
    assert contract.check(path) == metadata


@pytest.mark.parametrize("prefix", ["model.", "model.da3."])
def test_weights_saved_and_loaded_are_the_same(prefix: str, tmp_path: Path) -> None:
    safetensors_torch = pytest.importorskip("safetensors.torch")
    network = random_network()
    safetensors_torch.save_file(
        stored_once(network, prefix) | {"model.other.weight": torch.zeros(1)}, tmp_path / "model.safetensors"
    )
    loaded = depth_anything_3_network.load("da3-small", tmp_path)
    assert graph.tensor_hash(loaded) == graph.tensor_hash(network)


def test_weights_of_another_size_are_refused(tmp_path: Path) -> None:
    safetensors_torch = pytest.importorskip("safetensors.torch")
    safetensors_torch.save_file(stored_once(random_network(), "model."), tmp_path / "model.safetensors")
    with pytest.raises(script.Unavailable, match="not those of da3-base: size mismatch"):
        depth_anything_3_network.load("da3-base", tmp_path)


def test_a_network_without_poses_is_refused() -> None:
    with pytest.raises(script.Unavailable, match="allowed: da3-small"):
        depth_anything_3_network.built("da3metric-large")
