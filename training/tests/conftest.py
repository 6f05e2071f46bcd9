"""Runs the export programs without the library, which they do not need and a training machine may not have.

pip install -r training/requirements-export.txt
python -m pytest training/tests
"""

from __future__ import annotations

import subprocess
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "bindings" / "python" / "python" / "vehicle_gaussians"

# The parent without its __init__, which imports the extension module.
_parent = types.ModuleType("vehicle_gaussians")
_parent.__path__ = [str(PACKAGE)]
sys.modules["vehicle_gaussians"] = _parent

#: Script for a new interpreter in which the modules named before "--" cannot be imported.
LAUNCHER = """
import runpy, sys, types
package, rest = sys.argv[1], sys.argv[2:]
cut = rest.index("--")
without = set(rest[:cut])
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name in without or name.partition(".")[0] in without:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Missing())
parent = sys.modules["vehicle_gaussians"] = types.ModuleType("vehicle_gaussians")
parent.__path__ = [package]
program, sys.argv = rest[cut + 1], rest[cut + 1 :]
runpy.run_module("vehicle_gaussians.export." + program, run_name="__main__", alter_sys=True)
"""


def stored_once(model: Any, prefix: str = "") -> dict[str, Any]:
    """Tensors as in the published weights: each once, under one of its names."""
    tensors: dict[int, tuple[str, Any]] = {}
    for name, tensor in model.state_dict(keep_vars=True).items():
        tensors.setdefault(tensor.data_ptr(), (prefix + name, tensor.detach().contiguous()))
    return dict(tensors.values())


Program = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Program:
    """Runs an export program in an interpreter of its own: `program("tiny", "--help", without=["torch"])`."""
    home = tmp_path_factory.mktemp("home")

    def start(name: str, *arguments: str, without: tuple[str, ...] = ()) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", LAUNCHER, str(PACKAGE), *without, "--", name, *arguments]
        # Prevents downloads by a proxy that does not exist and empty caches.
        refused = {"https_proxy": "http://127.0.0.1:9", "http_proxy": "http://127.0.0.1:9"}
        empty = {"HOME": str(home), "TORCH_HOME": str(home), "HF_HOME": str(home), "HF_HUB_ETAG_TIMEOUT": "2"}
        path = {"PATH": "/usr/bin:/bin"}
        return subprocess.run(
            command, capture_output=True, text=True, env={**path, **refused, **empty}, timeout=600, check=False
        )

    return start
