"""Tests of training/head: `pytest training/tests_head`, with training/requirements-head.txt installed."""

import sys
from pathlib import Path

import pytest
import torch

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "training" / "head"))


@pytest.fixture(autouse=True)
def seed():
    torch.manual_seed(1)
    torch.set_num_threads(2)


@pytest.fixture
def sedan():
    return ROOT / "tests" / "data" / "sedan"
