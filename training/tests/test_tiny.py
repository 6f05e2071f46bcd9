"""The steps from a network to a file, with the tiny network: export, metadata, check and comparison."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import pytest
import torch

from conftest import Program
from vehicle_gaussians.export import contract, graph, script, tiny, tiny_network

WIDTH, HEIGHT = 112, 84
OUTPUTS = ["depth", "rays", "scale", "confidence", "mask", "cam_to_ref_pred"]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("tiny") / "tiny.onnx"
    assert tiny.main(["-o", str(path), "--seed", "1"]) == 0
    return path


@pytest.fixture(scope="module")
def module() -> Any:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(1)
        return graph.MultiViewPrior(tiny_network.TinyNetwork((WIDTH, HEIGHT))).eval()


def run(file: Path, inputs: dict[str, Any]) -> dict[str, Any]:
    session = onnxruntime.InferenceSession(str(file), providers=["CPUExecutionProvider"])
    answers = session.run(OUTPUTS, {name: value.numpy() for name, value in inputs.items()})
    return dict(zip(OUTPUTS, answers, strict=True))


@pytest.mark.parametrize("views", [1, 2, 3, 4])
def test_traced_with_two_views_it_gives_torchs_results_for_any_number(file: Path, module: Any, views: int) -> None:
    inputs = graph.example_inputs(views, WIDTH, HEIGHT, seed=11)
    with torch.no_grad():
        expected = module(*inputs.values())
    answers = run(file, inputs)
    for name, reference in zip(OUTPUTS, expected, strict=True):
        # float32: the order of sums differs.
        np.testing.assert_allclose(answers[name], reference.numpy(), rtol=0, atol=1e-5, err_msg=name)


def test_the_outputs_pass_the_checks_of_a_host(file: Path) -> None:
    inputs = graph.example_inputs(3, WIDTH, HEIGHT, seed=2)
    answers = run(file, inputs)
    assert all(np.isfinite(answer).all() for answer in answers.values())
    assert (answers["depth"] > 0).all() and (answers["scale"] > 0).all()
    assert ((answers["mask"] >= 0) & (answers["mask"] <= 1)).all() and (answers["mask"] > 0.5).mean() > 0.9
    np.testing.assert_allclose(np.linalg.norm(answers["rays"], axis=-1), 1, atol=1e-6)
    given = graph.rays_from_intrinsics(inputs["intrinsics"], HEIGHT, WIDTH).permute(0, 2, 3, 1).numpy()
    cosines = (answers["rays"] * given).sum(-1).clip(-1, 1)
    assert np.degrees(np.arccos(cosines)).max() < 3
    metric = answers["cam_to_ref_pred"][:, :3, 3] * answers["scale"]
    np.testing.assert_allclose(metric, inputs["cam_to_ref"][:, :3, 3], atol=0.1)


def test_onnxruntime_reads_the_metadata_back(file: Path) -> None:
    session = onnxruntime.InferenceSession(str(file), providers=["CPUExecutionProvider"])
    metadata = session.get_modelmeta().custom_metadata_map
    assert metadata == contract.check(file)
    assert metadata | {"vg.weights": ""} == {
        "vg.contract": "1",
        "vg.prior": "tiny",
        "vg.depth": "along_ray",
        "vg.metric": "true",
        "vg.size_multiple": "14",
        "vg.long_side": "112",
        "vg.resize": "cover_crop",
        "vg.license": "MIT OR Apache-2.0",
        "vg.weights": "",
    }
    assert metadata["vg.weights"].startswith("random, seed 1, sha256:")


def test_the_same_seed_gives_the_same_bytes_and_the_file_names_no_folder(file: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.onnx"
    assert tiny.main(["-o", str(again), "--seed", "1"]) == 0
    assert hashlib.sha256(again.read_bytes()).digest() == hashlib.sha256(file.read_bytes()).digest()
    assert str(Path(torch.__file__).parent).encode() not in file.read_bytes()


def test_external_data_is_stamped_without_being_touched_and_runs(file: Path, tmp_path: Path) -> None:
    path = tmp_path / "external.onnx"
    assert tiny.main(["-o", str(path), "--seed", "1", "--data", "external", "--parity-views", "1"]) == 0
    assert sorted(each.name for each in tmp_path.iterdir()) == ["external.onnx", "external.onnx.data"]
    data = tmp_path / "external.onnx.data"
    before = data.read_bytes(), data.stat().st_mtime_ns
    contract.stamp(path, {"vg.prior": "renamed"})
    assert (data.read_bytes(), data.stat().st_mtime_ns) == before
    assert contract.check(path)["vg.prior"] == "renamed"
    inputs = graph.example_inputs(2, WIDTH, HEIGHT)
    for name, answer in run(path, inputs).items():
        np.testing.assert_array_equal(answer, run(file, inputs)[name])
    data.write_bytes(before[0][:-4])
    with pytest.raises(contract.ContractError, match=r"external\.onnx\.data: \d+ bytes; needed: \d+"):
        contract.check(path)
    data.unlink()
    with pytest.raises(contract.ContractError, match=r"external\.onnx\.data: missing"):
        contract.check(path)


def test_it_runs_as_a_program_and_prints_the_parity(program: Program, tmp_path: Path) -> None:
    path = tmp_path / "tiny.onnx"
    done = program("tiny", "-o", str(path), "--size", "56x42", "--parity-views", "1,3")
    assert done.returncode == 0, done.stderr
    assert "| N = 3 | depth |" in done.stdout and "| N = 1 | rays |" in done.stdout
    shape = onnx.load(path).graph.input[0].type.tensor_type.shape
    assert [dim.dim_param or dim.dim_value for dim in shape.dim] == ["N", 3, 42, 56]
    checked = program("contract", str(path))
    assert checked.returncode == 0 and "vg.prior=tiny" in checked.stdout


def test_a_network_that_depends_on_the_number_of_views_is_refused(module: Any, tmp_path: Path) -> None:
    class Fixed(torch.nn.Module):
        def forward(self, images: Any, intrinsics: Any, cam_to_ref: Any) -> tuple[Any]:
            return (images[:, 0].exp() * (1 if images.shape[0] == 2 else 2) + 0 * intrinsics.sum() * cam_to_ref.sum(),)

    inputs = graph.example_inputs(2, 28, 28)
    axes = {name: {0: torch.export.Dim("N", min=1)} for name in inputs}
    with pytest.raises(script.Unavailable, match="images: the export fixed axis 0 to 2, which has to stay free"):
        graph.write(Fixed(), tmp_path / "fixed.onnx", inputs, axes, ["depth"], {}, {}, 20, False)
    assert list(tmp_path.iterdir()) == []


class TestGeometry:
    """The parts of the wrapper that replace upstream's."""

    def test_quaternions_of_random_rotations_give_the_rotations_back(self) -> None:
        quaternions = torch.randn(200, 4, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
        quaternions[:4] = torch.eye(4)  # half turns about the axes, and none
        poses = graph.poses_from_quaternions(torch.zeros(200, 3, dtype=torch.float64), quaternions)
        found = graph.quaternions_from_rotations(poses[:, :3, :3])
        unit = quaternions / quaternions.norm(dim=1, keepdim=True)
        torch.testing.assert_close((found * unit).sum(1).abs(), torch.ones(200, dtype=torch.float64))
        assert (found[:, 3] >= 0).all()

    def test_a_ray_goes_through_the_middle_of_its_pixel(self) -> None:
        intrinsics = torch.tensor([[[10.0, 0, 2.5], [0, 20.0, 1.5], [0, 0, 1]]])
        rays = graph.rays_from_intrinsics(intrinsics, 3, 5)[0]
        torch.testing.assert_close(rays[:, 1, 2], torch.tensor([0.0, 0.0, 1.0]))
        torch.testing.assert_close(rays[:, 0, 4] / rays[2, 0, 4], torch.tensor([0.2, -0.05, 1.0]))

    def test_the_mean_distance_leaves_view_zero_out(self) -> None:
        poses = torch.eye(4).repeat(3, 1, 1)
        poses[1, 0, 3], poses[2, 2, 3] = 2.0, 4.0
        given = graph.cameras_for_network(torch.eye(3).repeat(3, 1, 1), poses, 2, 2)
        torch.testing.assert_close(given.log_distance.exp(), torch.tensor([[3.0]]))
        torch.testing.assert_close(given.translation[2], torch.tensor([0.0, 0.0, 4 / 3]))
        assert given.has_distance.item() == 1

    def test_cameras_at_one_point_have_no_distance(self) -> None:
        given = graph.cameras_for_network(torch.eye(3)[None], torch.eye(4)[None], 2, 2)
        assert given.has_distance.item() == 0 and given.translation.abs().max() == 0
