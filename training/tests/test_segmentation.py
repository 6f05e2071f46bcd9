"""The segmentation with random weights; skipped if torchvision is not installed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch

pytest.importorskip("torchvision")

from vehicle_gaussians.export import contract, script, segmentation, segmentation_network

NET = "lraspp_mobilenet_v3_large"


def stored(tmp_path: Path, name: str = NET) -> tuple[torch.nn.Module, Path]:
    """Weights in the layout of torchvision's files."""
    torch.manual_seed(5)
    network = segmentation_network.built(name).eval()
    file = tmp_path / "weights.pth"
    torch.save(network.state_dict(), file)
    return network, file


def test_the_file_gives_the_share_of_cars_and_buses(tmp_path: Path) -> None:
    network, file = stored(tmp_path)
    path = tmp_path / "segmentation.onnx"
    assert segmentation.main(["--net", NET, "--size", "128x96", "--file", str(file), "-o", str(path)]) == 0
    metadata = contract.check(path)
    assert metadata["vg.mask"] == NET and metadata["vg.weights"].startswith("weights.pth sha256:")
    inputs = segmentation_network.example_inputs(2, 96, 128, seed=9)
    mean = torch.tensor([0.485, 0.456, 0.406]).view(1, 3, 1, 1)
    std = torch.tensor([0.229, 0.224, 0.225]).view(1, 3, 1, 1)
    with torch.no_grad():
        shares = network((inputs["images"] - mean) / std)["out"].softmax(1)
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    (mask,) = session.run(["mask"], {"images": inputs["images"].numpy()})
    # Pascal VOC's classes, background first: 6 is bus, 7 is car.
    np.testing.assert_allclose(mask, (shares[:, 6] + shares[:, 7]).numpy(), atol=1e-5)


def test_another_networks_weights_are_refused(tmp_path: Path) -> None:
    _, file = stored(tmp_path)
    other = "deeplabv3_mobilenet_v3_large"
    with pytest.raises(script.Unavailable, match=f"weights .*weights.pth: no .*; not a {other}"):
        segmentation_network.load_weights(segmentation_network.built(other), other, file)


def test_a_segmentation_of_two_views_at_once_breaks_the_contract(tmp_path: Path) -> None:
    import onnx
    from onnx import helper

    images = helper.make_tensor_value_info("images", onnx.TensorProto.FLOAT, [2, 3, 8, 8])
    mask = helper.make_tensor_value_info("mask", onnx.TensorProto.FLOAT, [2, 8, 8])
    node = helper.make_node("ReduceMean", ["images"], ["mask"], axes=[1], keepdims=0)
    model = helper.make_model(helper.make_graph([node], "test", [images], [mask]))
    path = tmp_path / "two.onnx"
    onnx.save(model, path)
    contract.stamp(path, {"vg.contract": "1", "vg.mask": "two"})
    with pytest.raises(contract.ContractError, match="input images: N is 2; allowed: 1 or dynamic"):
        contract.check(path)
