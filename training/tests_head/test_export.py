import onnx
import pytest

from export import difference, metadata, open_session, randomize, write
from network import Head


def some_head(encoder, activation, offset=True):
    head = Head(encoder, activation, offset)
    randomize(head, 0.1)
    return head


@pytest.mark.parametrize(
    ("encoder", "activation"),
    [("tiny", "softplus"), ("tiny", "sigmoid"), ("tiny", "relu"), ("resnet18", "softplus")],
)
def test_onnx_runtime_gives_the_results_of_pytorch(tmp_path, encoder, activation):
    head = some_head(encoder, activation)
    write(head, tmp_path / "head.onnx", "random, seed 1", "MIT")
    session = open_session(tmp_path / "head.onnx")
    for shape in ((1, 32, 32), (2, 64, 96), (5, 96, 32)):
        worst, largest = difference(head, session, shape)
        assert worst < 1e-4 and largest > 1


def test_the_file_has_the_metadata_for_a_host(tmp_path):
    head = some_head("tiny", "relu", offset=False)
    write(head, tmp_path / "head.onnx", "random, seed 1", "MIT")
    model = onnx.load(tmp_path / "head.onnx")
    found = {p.key: p.value for p in model.metadata_props}
    assert found == metadata(head, "random, seed 1", "MIT")
    assert found["vg.contract"] == "1" and found["vg.size_multiple"] == "32"
    assert found["vg.head"] == "tiny_unet"
    assert found["vg.scale_activation"] == "relu" and found["vg.offset"] == "ignored"
    shape = lambda v: [d.dim_param or d.dim_value for d in v.type.tensor_type.shape.dim]
    assert {v.name: shape(v) for v in (*model.graph.input, *model.graph.output)} == {
        "images": ["N", 3, "H", "W"],
        "depth": ["N", "H", "W"],
        "intrinsics": ["N", 3, 3],
        "attributes": ["N", 38, "H", "W"],
    }
    assert (tmp_path / "head.onnx").stat().st_size < 60_000
