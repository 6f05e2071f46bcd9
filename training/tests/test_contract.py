"""The check of a finished file: what it accepts, and its messages for what it refuses."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import onnx
import pytest
from onnx import TensorProto, helper

from vehicle_gaussians.export import contract

GOOD = {
    "vg.contract": "1",
    "vg.prior": "test",
    "vg.depth": "z",
    "vg.metric": "true",
    "vg.size_multiple": "14",
    "vg.long_side": "518",
}
PERCEPTUAL = {"vg.contract": "1", "vg.metric": "lpips", "vg.lpips.net": "alex", "vg.range": "0..1"}
IMAGES = ["N", 3, "H", "W"]

Shapes = dict[str, Sequence[int | str]]


def written(
    folder: Path, inputs: Shapes, outputs: Shapes, metadata: dict[str, str], kind: int = TensorProto.FLOAT
) -> Path:
    """A file with these inputs and outputs; its one node is never run."""
    values = [
        [helper.make_tensor_value_info(name, kind, shape) for name, shape in each.items()] for each in (inputs, outputs)
    ]
    node = helper.make_node("Identity", list(inputs)[:1], list(outputs)[:1])
    model = helper.make_model(helper.make_graph([node], "graph", *values))
    helper.set_model_props(model, metadata)
    path = folder / "prior.onnx"
    onnx.save(model, path)
    return path


def refusal(path: Path) -> str:
    with pytest.raises(contract.ContractError) as caught:
        contract.check(path)
    return str(caught.value)


def test_images_to_depth_is_enough(tmp_path: Path) -> None:
    path = written(tmp_path, {"images": IMAGES}, {"depth": ["N", "H", "W"]}, GOOD)
    assert contract.check(path) == GOOD


def test_all_inputs_and_outputs_and_keys_are_accepted(tmp_path: Path) -> None:
    sizes: dict[int | str, int | str] = {"N": "views", "H": 28, "W": 42}
    inputs = {name: [sizes.get(each, each) for each in shape] for name, shape in contract.INPUTS.items()}
    outputs = {name: [sizes.get(each, each) for each in shape] for name, shape in contract.OUTPUTS.items()}
    more = {
        "vg.resize": "stretch",
        "vg.mean": "0.5,0.5,0.5",
        "vg.std": "1, 1, 1",
        "vg.license": "MIT",
        "vg.weights": "none",
        "vg.later": "a key of another version",
        "author": "somebody",
    }
    assert contract.check(written(tmp_path, inputs, outputs, GOOD | more)) == GOOD | more


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"vg.contract": None}, "metadata vg.contract: missing; allowed: 1"),
        ({"vg.contract": "2"}, "metadata vg.contract: '2'; allowed: 1"),
        ({"vg.prior": ""}, "metadata vg.prior: ''; allowed: some text"),
        ({"vg.depth": None}, "metadata vg.depth: missing; allowed: along_ray or z"),
        ({"vg.depth": "euclidean"}, "metadata vg.depth: 'euclidean'; allowed: along_ray or z"),
        ({"vg.metric": "True"}, "metadata vg.metric: 'True'; allowed: true or false"),
        (
            {"vg.metric": "false"},
            "vg.metric: false without an output cam_to_ref_pred, from which the scale would have to come; "
            "allowed: both, or depth in metres",
        ),
        ({"vg.resize": "crop"}, "metadata vg.resize: 'crop'; allowed: cover_crop or stretch"),
        ({"vg.size_multiple": "0"}, "metadata vg.size_multiple: '0'; allowed: a whole number above 0"),
        ({"vg.long_side": None}, "metadata vg.long_side: missing; required where H or W is dynamic"),
        ({"vg.mean": "0.5,0.5"}, "metadata vg.mean: '0.5,0.5'; allowed: r,g,b"),
        ({"vg.std": "nan,1,1"}, "metadata vg.std: 'nan,1,1'; allowed: r,g,b"),
    ],
)
def test_metadata_is_refused_with_what_is_allowed(tmp_path: Path, changes: dict[str, Any], words: str) -> None:
    metadata = {key: value for key, value in (GOOD | changes).items() if value is not None}
    assert refusal(written(tmp_path, {"images": IMAGES}, {"depth": ["N", "H", "W"]}, metadata)) == words


@pytest.mark.parametrize(
    ("inputs", "outputs", "words"),
    [
        (
            {"image": IMAGES},
            {"depth": ["N", "H", "W"]},
            "input image: unknown; allowed: images, intrinsics, cam_to_ref",
        ),
        (
            {"intrinsics": ["N", 3, 3]},
            {"depth": ["N", "H", "W"]},
            "input images: missing; found: intrinsics",
        ),
        (
            {"images": ["N", "H", "W", 3]},
            {"depth": ["N", "H", "W"]},
            "input images: (dynamic, dynamic, dynamic, 3); allowed: (N, 3, H, W)",
        ),
        (
            {"images": [1, "N", 3, "H", "W"]},
            {"depth": ["N", "H", "W"]},
            "input images: (1, dynamic, 3, dynamic, dynamic); allowed: (N, 3, H, W)",
        ),
        ({"images": IMAGES}, {"rays": ["N", "H", "W", 3]}, "output depth: missing; found: rays"),
        (
            {"images": IMAGES},
            {"depth": ["N", 1, "H", "W"]},
            "output depth: (dynamic, 1, dynamic, dynamic); allowed: (N, H, W)",
        ),
        (
            {"images": IMAGES},
            {"depth": [2, "H", "W"]},
            "output depth: (2, dynamic, dynamic); allowed: (N, H, W), where N is dynamic in what comes before",
        ),
        (
            {"images": ["N", 3, 28, 42]},
            {"depth": ["N", 42, 28]},
            "output depth: (dynamic, 42, 28); allowed: (N, H, W), where H is 28 in what comes before",
        ),
        (
            {"images": ["N", 3, 30, 42]},
            {"depth": ["N", 30, 42]},
            "input images: H is 30; allowed: multiples of 14",
        ),
        (
            {"images": IMAGES},
            {"depth": ["N", "H", "W"], "scale": ["N"]},
            "output scale: (dynamic); allowed: (1)",
        ),
    ],
)
def test_names_and_shapes_are_refused_with_what_is_allowed(
    tmp_path: Path, inputs: Shapes, outputs: Shapes, words: str
) -> None:
    assert refusal(written(tmp_path, inputs, outputs, GOOD)) == words


def test_half_precision_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, {"images": IMAGES}, {"depth": ["N", "H", "W"]}, GOOD, TensorProto.FLOAT16)
    assert refusal(path) == "input images: float16; allowed: float (float32)"


def test_operators_that_only_some_runtimes_have_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path, {"images": IMAGES}, {"depth": ["N", "H", "W"]}, GOOD)
    model = onnx.load(path)
    model.graph.node[0].domain, model.graph.node[0].name = "com.microsoft", "first"
    onnx.save(model, path)
    assert refusal(path) == "node first: com.microsoft::Identity; allowed: standard operators"


def test_other_files_are_refused_as_not_onnx(tmp_path: Path) -> None:
    path = tmp_path / "prior.onnx"
    assert refusal(path) == "cannot be read: No such file or directory"
    path.write_bytes(b"ply\nformat ascii 1.0\n")
    assert refusal(path) == "not an ONNX file"


def test_a_perceptual_distance_has_its_own_contract(tmp_path: Path) -> None:
    good: tuple[Shapes, Shapes] = {"a": IMAGES, "b": IMAGES}, {"lpips": ["N"]}
    assert contract.check(written(tmp_path, *good, PERCEPTUAL)) == PERCEPTUAL
    wrong = PERCEPTUAL | {"vg.lpips.net": "resnet"}
    assert (
        refusal(written(tmp_path, *good, wrong)) == "metadata vg.lpips.net: 'resnet'; allowed: alex or vgg or squeeze"
    )
    assert refusal(written(tmp_path, good[0], {"lpips": ["N", 1, 1, 1]}, PERCEPTUAL)) == (
        "output lpips: (dynamic, 1, 1, 1); allowed: (N)"
    )


def test_a_stamp_replaces_its_keys_and_keeps_others(tmp_path: Path) -> None:
    path = written(tmp_path, {"images": IMAGES}, {"depth": ["N", "H", "W"]}, {"author": "somebody", "vg.depth": "z"})
    contract.stamp(path, GOOD | {"vg.depth": "along_ray"})
    assert contract.check(path) == {"author": "somebody"} | GOOD | {"vg.depth": "along_ray"}
    assert [each.name for each in tmp_path.iterdir()] == ["prior.onnx"]
