"""The wrapper around the public MapAnything class, with small random weights; skipped if the class is not installed.

The code of DINOv2 comes through torch.hub: from GitHub, or from the cache that TORCH_HOME names.
"""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import pytest

from conftest import stored_once

torch = pytest.importorskip("torch")
safetensors_torch = pytest.importorskip("safetensors.torch")
with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    pytest.importorskip("mapanything.models")

from vehicle_gaussians.export import contract, graph, mapanything_network, script  # noqa: E402

pytestmark = pytest.mark.filterwarnings("default")
WIDTH, HEIGHT = 70, 56


@pytest.fixture(scope="module")
def model() -> Any:
    with torch.random.fork_rng(devices=[]), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.manual_seed(3)
        try:
            made = mapanything_network.random("small")
        except script.Unavailable as error:
            pytest.skip(str(error))
        for name, parameter in made.named_parameters():
            if name.endswith("gamma"):
                # Initially 1e-5, with which no block would have an effect.
                torch.nn.init.uniform_(parameter, 0.3, 0.6)
    return made.eval()


def test_the_wrapper_gives_the_results_of_upstream(model: Any) -> None:
    inputs = graph.example_inputs(3, WIDTH, HEIGHT, seed=5)
    upstream = infer(model, inputs)
    module = graph.MultiViewPrior(mapanything_network.MapAnythingNetwork(model, (WIDTH, HEIGHT)))
    with torch.no_grad():
        depth, rays, scale, confidence, mask, poses = module(*inputs.values())
    # float32 sums in another order.
    close = {"rtol": 2e-5, "atol": 2e-5}
    torch.testing.assert_close(depth * scale, upstream["depth_along_ray"][..., 0], **close)
    torch.testing.assert_close(rays, upstream["ray_directions"], **close)
    torch.testing.assert_close(scale, upstream["metric_scaling_factor"][0], **close)
    torch.testing.assert_close(confidence, upstream["conf"], **close)
    torch.testing.assert_close(mask, upstream["non_ambiguous_mask_logits"].sigmoid(), **close)
    metric = poses.clone()
    metric[:, :3, 3] *= scale
    torch.testing.assert_close(metric, upstream["camera_poses"], **close)


def infer(model: Any, inputs: dict[str, Any]) -> dict[str, Any]:
    mean, std = (torch.tensor(values).view(3, 1, 1) for values in (graph.IMAGENET_MEAN, graph.IMAGENET_STD))
    views = []
    for image, intrinsics, pose in zip(*inputs.values(), strict=True):
        intrinsics = intrinsics.clone()
        intrinsics[:2, 2] -= 0.5  # OpenCV's pixel centres
        views.append(
            {
                "img": ((image - mean) / std)[None],
                "data_norm_type": ["dinov2"],
                "intrinsics": intrinsics[None],
                "camera_poses": pose[None],
            }
        )
    answers = model.infer(views, use_amp=False, apply_mask=False, mask_edges=False)
    return {key: torch.cat([each[key] for each in answers]) for key in answers[0]}


def test_the_file_keeps_the_contract_for_any_number_of_views(model: Any, tmp_path: Path) -> None:
    path = tmp_path / "mapanything.onnx"
    module = graph.MultiViewPrior(mapanything_network.MapAnythingNetwork(model, (WIDTH, HEIGHT)))
    metadata = graph.prior_metadata("mapanything", "along_ray", True, "cover_crop", 14, WIDTH, "none", "random")
    graph.write_prior(module, path, WIDTH, HEIGHT, metadata, [1, 3], 20, external=True)
    assert contract.check(path) == metadata
    assert path.stat().st_size < 1e6 < (tmp_path / "mapanything.onnx.data").stat().st_size


def test_weights_saved_and_loaded_are_the_same(model: Any, tmp_path: Path) -> None:
    save(model, tmp_path)
    assert graph.tensor_hash(mapanything_network.load(tmp_path)) == graph.tensor_hash(model)


def test_weights_that_lack_a_tensor_are_refused(model: Any, tmp_path: Path) -> None:
    save(model, tmp_path, without="scale_head.output_proj.bias")
    with pytest.raises(script.Unavailable, match=r"1 tensors missing, the first is scale_head.output_proj.bias"):
        mapanything_network.load(tmp_path)


def save(model: Any, folder: Path, without: str = "") -> None:
    (folder / "config.json").write_text(json.dumps(mapanything_network.architecture("small")))
    tensors = stored_once(model)
    tensors.pop(without, None)
    safetensors_torch.save_file(tensors, folder / "model.safetensors")
