"""Another alternative to the network: boosted trees over the values of one node and its neighbours.

    python trees.py train.bin --check check.bin      # needs scikit-learn as well
"""

import argparse

import numpy as np
from sklearn.ensemble import HistGradientBoostingRegressor

from data import open_records
from network import CLAMP_M, NODES

NODES_PER_SCENE = 150


def features(record, at):
    """Hull in a neighbourhood of up to two nodes, position on the lattice, view numbers. [n][...]"""
    hull = np.pad(record["hull"].astype(np.float32) / 127, 2, mode="edge")
    j, k, i = at
    steps = [(a, b, c) for a in (-2, -1, 0, 1, 2) for b in (-2, -1, 0, 1, 2) for c in (-2, -1, 0, 1, 2)]
    steps = [s for s in steps if sum(v != 0 for v in s) <= 1 or max(abs(v) for v in s) == 1]
    around = [hull[j + 2 + a, k + 2 + b, i + 2 + c] for a, b, c in steps]
    column = [hull[2:-2, 2:-2, 2:-2][a][k, i] for a in range(0, NODES[0], 3)]
    place = [j / NODES[0], k / NODES[1], i / NODES[2]]
    numbers = [np.full(len(j), v) for v in record["numbers"]]
    return np.stack([*around, *column, *place, *numbers], 1)


def table(records, scenes, rng):
    rows, truths, hulls = [], [], []
    for index in scenes:
        record = records[index]
        truth = record["distance"].astype(np.float32) / 127
        near = np.flatnonzero(np.abs(truth.ravel()) < 0.7)
        if len(near) < NODES_PER_SCENE:
            continue
        chosen = rng.choice(near, NODES_PER_SCENE, replace=False)
        at = np.unravel_index(chosen, NODES)
        rows.append(features(record, at))
        truths.append(truth.ravel()[chosen])
        hulls.append(np.clip(2 * record["hull"].ravel()[chosen].astype(np.float32) / 127, -1, 1))
    return np.concatenate(rows), np.concatenate(truths), np.concatenate(hulls)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("data")
    parser.add_argument("--check", required=True)
    args = parser.parse_args()
    rng = np.random.default_rng(1)
    records, checks = open_records(args.data), open_records(args.check)
    x, truth, hull = table(records, range(0, len(records), 3), rng)
    trees = HistGradientBoostingRegressor(loss="absolute_error", max_iter=300, max_leaf_nodes=63, random_state=1)
    trees.fit(x, truth - hull)
    x, truth, hull = table(checks, range(len(checks)), rng)
    found = np.clip(hull + trees.predict(x), -1, 1)
    near = np.abs(truth) < 0.2
    for name, values in (("hull", hull), ("trees", found)):
        print(f"{name:6} {100 * CLAMP_M * np.abs(values - truth)[near].mean():.2f} cm")


if __name__ == "__main__":
    main()
