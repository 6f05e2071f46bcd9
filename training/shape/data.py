"""Reads the output of `vehicle-gaussians-training data`."""

import numpy as np
import torch

from network import NODES, NUMBERS

RECORD = np.dtype([("hull", "i1", NODES), ("distance", "i1", NODES), ("numbers", "<f4", NUMBERS), ("class", "<u4")])


def open_records(path):
    with open(path, "rb") as file:
        size = file.seek(0, 2)
    return np.memmap(path, RECORD, "r", shape=(size // RECORD.itemsize,))


def batch(records, indices):
    """hull [n][16][32][96] in units of 0.5 m, distance in units of 0.25 m, numbers [n][11]."""
    rows = [records[i] for i in indices]
    stack = lambda key: torch.from_numpy(np.stack([row[key] for row in rows]).astype(np.float32))
    return stack("hull") / 127, stack("distance") / 127, stack("numbers")
