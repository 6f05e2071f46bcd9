"""The perceptual distance with a random backbone; skipped if the lpips package is not installed."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    pytest.importorskip("lpips")

from vehicle_gaussians.export import contract, lpips, lpips_network, script


def distances(file: Path, a: torch.Tensor, b: torch.Tensor) -> np.ndarray:
    session = onnxruntime.InferenceSession(str(file), providers=["CPUExecutionProvider"])
    (answer,) = session.run(["lpips"], {"a": a.numpy(), "b": b.numpy()})
    return np.asarray(answer)


@pytest.mark.parametrize("net", ["alex", "squeeze"])
def test_the_file_gives_the_results_of_the_package_at_any_size(net: str, tmp_path: Path) -> None:
    model = lpips_network.built(net)
    backbone = stored_backbone(model, tmp_path)
    path = tmp_path / "lpips.onnx"
    assert lpips.main(["--net", net, "--backbone", str(backbone), "-o", str(path)]) == 0
    metadata = contract.check(path)
    assert metadata["vg.lpips.net"] == net and metadata["vg.weights"].startswith("backbone.pth sha256:")
    for pairs, height, width in [(1, 64, 80), (3, 97, 75)]:
        inputs = lpips_network.example_inputs(pairs, height, width, seed=7)
        with torch.no_grad():
            # The package's own range is [-1,1].
            expected = model(2 * inputs["a"] - 1, 2 * inputs["b"] - 1).flatten().numpy()
        answer = distances(path, inputs["a"], inputs["b"])
        assert answer.shape == (pairs,) and (answer > 0).all()
        np.testing.assert_allclose(answer, expected, rtol=1e-4, atol=1e-7)
        np.testing.assert_array_equal(distances(path, inputs["a"], inputs["a"]), np.zeros(pairs, np.float32))


def stored_backbone(model: torch.nn.Module, folder: Path) -> Path:
    """A backbone in the layout of torchvision's files."""
    path = folder / "backbone.pth"
    tensors = {"features." + name.partition(".")[2]: tensor for name, tensor in model.net.state_dict().items()}
    torch.save(tensors, path)
    return path


def test_another_networks_backbone_is_refused(tmp_path: Path) -> None:
    backbone = stored_backbone(lpips_network.built("squeeze"), tmp_path)
    with pytest.raises(script.Unavailable, match=r"no features\.0\.weight of shape \(64, 3, 11, 11\); not a alexnet"):
        lpips_network.load_backbone(lpips_network.built("alex"), "alex", backbone)
