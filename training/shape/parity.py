"""Writes the trained network's output for one scene, for the library's test of its own evaluation.

    python parity.py weights.bin check.bin -o ../../tests/data/shape/parity.bin

Little endian: the hull as int8 [16][32][96], the view numbers float32 [11], then every 29th value of the raw output
[32][32][96] as float32.
"""

import argparse

import numpy as np
import torch

from data import batch, open_records
from network import network_input
from weights import read_into

EVERY = 29


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("weights")
    parser.add_argument("data")
    parser.add_argument("--record", type=int, default=0)
    parser.add_argument("-o", "--output", required=True)
    args = parser.parse_args()
    records = open_records(args.data)
    hull, _, numbers = batch(records, [args.record])
    with torch.no_grad():
        raw = read_into(args.weights)(network_input(hull, numbers))
    with open(args.output, "wb") as file:
        file.write(records[args.record]["hull"].tobytes())
        file.write(numbers.numpy().astype("<f4").tobytes())
        file.write(np.ascontiguousarray(raw[0].numpy().ravel()[::EVERY]).astype("<f4").tobytes())


if __name__ == "__main__":
    main()
