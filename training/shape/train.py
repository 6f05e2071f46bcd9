"""Trains the shape network on procedural vehicles.

    python train.py train.bin --check check.bin -o ../../src/prior/shape/weights.bin

Equal data, seed, number of threads, versions and kind of processor give equal bytes.
"""

import argparse
import time

import numpy as np
import torch

from data import batch, open_records
from network import CLAMP_M, KINDS, answer, network_input
from weights import write

BATCH = 16
PEAK_RATE = 2e-3
WEIGHT_DECAY = 1e-3


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("data")
    parser.add_argument("--check", required=True, help="data of other vehicles")
    parser.add_argument("--kind", choices=KINDS, default="unet")
    parser.add_argument("--steps", type=int, default=6000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("-o", "--output", required=True)
    args = parser.parse_args()

    torch.manual_seed(args.seed)
    torch.set_num_threads(args.threads)
    torch.use_deterministic_algorithms(True)
    network = KINDS[args.kind]().to(memory_format=torch.channels_last)
    print(sum(p.numel() for p in network.parameters()), "parameters", flush=True)
    optimizer = torch.optim.AdamW(network.parameters(), PEAK_RATE, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, PEAK_RATE, args.steps, pct_start=0.1)
    draw = np.random.default_rng(args.seed)
    start, shown = time.time(), []
    records = open_records(args.data)
    for step in range(args.steps):
        hull, distance, numbers = batch(records, draw.integers(0, len(records), BATCH))
        with torch.autocast("cpu", torch.bfloat16):
            raw = network(network_input(hull, numbers))
        found, scale = answer(raw.float(), hull)
        loss = laplace(found, scale, distance)
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        schedule.step()
        shown.append(loss.item())
        if (step + 1) % 250 == 0:
            print(f"step {step + 1}: loss {np.mean(shown):.4f}, {time.time() - start:.0f} s", flush=True)
            shown = []
        if (step + 1) % 1000 == 0 or step + 1 == args.steps:
            check(network, args.check)
            write(network, args.output)


def laplace(found, scale, truth):
    """Negative log-likelihood, weighted towards the surface."""
    error = found - truth
    # A true value beyond the clamp is only a bound.
    fine = ((truth >= 1) & (found > 1)) | ((truth <= -1) & (found < -1))
    error = torch.where(fine, torch.zeros_like(error), error.abs())
    weight = torch.where(truth.abs() < 0.7, 1.0, 0.15)
    return (weight * (error * torch.exp(-scale) + scale)).sum() / weight.sum()


@torch.no_grad()
def check(network, path):
    """Mean error of the signed distance near the true surface, centimetres, by class."""
    names = "sedan hatchback estate SUV sports pickup van truck bus".split()
    records = open_records(path)
    network.eval()
    errors = {}
    for first in range(0, len(records), BATCH):
        rows = range(first, min(first + BATCH, len(records)))
        hull, distance, numbers = batch(records, rows)
        found, scale = answer(network(network_input(hull, numbers)), hull)
        near = distance.abs() < 0.2
        for k, row in enumerate(rows):
            off = lambda a: (a[k].clamp(-1, 1) - distance[k]).abs()[near[k]].mean().item() * 100 * CLAMP_M
            expected = scale[k].exp()[near[k]].mean().item() * 100 * CLAMP_M
            errors.setdefault(names[records[row]["class"]], []).append((off(2 * hull), off(found), expected))
    network.train()
    everything = sum(errors.values(), [])
    errors["all"] = everything
    for name in names + ["all"]:
        if name in errors:
            hull, found, expected = np.nanmean(errors[name], 0)
            print(f"  {name:10} hull {hull:6.2f} cm, network {found:6.2f} cm, expected {expected:6.2f} cm", flush=True)


if __name__ == "__main__":
    main()
