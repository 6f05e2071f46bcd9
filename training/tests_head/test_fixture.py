"""tests/data/head as documented in parity.py: the committed files equal the results of the code."""

import numpy as np
import onnxruntime
import pytest
from conftest import ROOT

FOLDER = ROOT / "tests" / "data" / "head"
Y0 = 0.28209479177387814


@pytest.fixture
def case():
    data = (FOLDER / "tiny_head.bin").read_bytes()
    assert data[:8] == b"VGHEAD01"
    n, w, h, every, m = (int(v) for v in np.frombuffer(data, "<u4", 5, 8))
    at, out = 28, {"every": every}
    for name, kind, shape in (
        ("intrinsics", "<f4", (n, 3, 3)),
        ("poses", "<f4", (n, 3, 4)),
        ("images", "u1", (n, h, w, 3)),
        ("depth", "<f4", (n, h, w)),
        ("raw", "<f4", (m, 38)),
        ("gaussians", "<f4", (m, 38)),
    ):
        out[name] = np.frombuffer(data, kind, int(np.prod(shape)), at).reshape(shape)
        at += out[name].nbytes
    assert at == len(data)
    return out


def test_the_stored_head_gives_the_stored_attributes(case):
    n, h, w, _ = case["images"].shape
    assert h % 32 and w % 32
    images = np.zeros((n, 3, -h // 32 * -32, -w // 32 * -32), np.float32)
    images[:, :, :h, :w] = case["images"].transpose(0, 3, 1, 2) / np.float32(255)
    depth = np.zeros((n, *images.shape[2:]), np.float32)
    depth[:, :h, :w] = case["depth"]
    session = onnxruntime.InferenceSession(FOLDER / "tiny_head.onnx", providers=["CPUExecutionProvider"])
    inputs = {"images": images, "depth": depth, "intrinsics": case["intrinsics"]}
    raw = session.run(["attributes"], inputs)[0][:, :, :h, :w]
    rows = raw.transpose(0, 2, 3, 1).reshape(-1, 38)[:: case["every"]]
    assert np.abs(rows - case["raw"]).max() < 1e-5
    # Random weights must use every channel, or the library's test would pass on zeros.
    assert (rows.std(0) > 0.05).all()


def test_the_stored_gaussians_follow_from_the_stored_attributes(case):
    """In float64, independent of the code that wrote the file."""
    n, h, w, _ = case["images"].shape
    pixels = np.arange(n * h * w)[:: case["every"]]
    view, v, u = np.unravel_index(pixels, (n, h, w))
    z = case["depth"][view, v, u].astype(float)
    k, poses, raw = (case[key].astype(float) for key in ("intrinsics", "poses", "raw"))
    rays = np.linalg.solve(k[view], np.stack([u + 0.5, v + 0.5, np.ones(len(u))], -1)[..., None])[..., 0]
    camera = z[:, None] * rays + raw[:, 1:4]
    means = np.einsum("nij,nj->ni", poses[view][:, :, :3], camera) + poses[view][:, :, 3]
    rgb = case["images"][view, v, u] / 255
    sh = raw[:, 11:].copy()
    sh[:, :3] += (rgb - 0.5) / Y0
    there = z > 0
    assert 0.1 < there.mean() < 0.9
    found = case["gaussians"]
    assert not found[~there].any()
    close = lambda columns, expected: np.testing.assert_allclose(
        found[there, columns], expected[there], rtol=1e-5, atol=1e-5
    )
    close(slice(0, 3), means)
    close(slice(3, 7), raw[:, 4:8] / np.linalg.norm(raw[:, 4:8], axis=1, keepdims=True))
    close(slice(7, 10), np.clip(np.logaddexp(0, raw[:, 8:11]), 1e-10, 3))
    close(10, 1 / (1 + np.exp(-raw[:, 0] - 3)))
    close(slice(11, 38), sh)


def test_the_fixture_is_small():
    assert sum(file.stat().st_size for file in FOLDER.iterdir()) < 400_000
