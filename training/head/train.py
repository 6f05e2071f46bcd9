"""Trains a Gaussian head as the paper does (sec. "Training scheme").

    python training/head/train.py SCENE... --check SCENE --imagenet resnet50.pth --lpips lpips.pth -o head.pt

An iteration uses four vehicles. For each, N input views of one side become Gaussians at the prior's points; the side
with more of them and its mirror image are the vehicle; the loss is computed on two views of the other side, none of
them nearly a mirrored input: MSE + 0.05 LPIPS (LPIPS if a file of its weights is given). The prior is frozen: its
depth comes with the scenes. Pictures are reduced to --width x --height; the renderer is plain PyTorch and slow.
"""

import argparse
import time

import numpy as np
import torch

from attributes import activate, lifted
from gaussians import joined
from lpips import Lpips
from network import SCALE_ACTIVATIONS, Head, load, save
from resnet import ENCODERS
from scenes import Scene
from splat import render

LPIPS_WEIGHT = 0.05
REPORT_EVERY = 10  # iterations
SETTLING_BATCHES = 16


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("scenes", nargs="+", help="folders with transforms.json")
    parser.add_argument("--check", nargs="*", default=[], help="other vehicles, with split.json")
    parser.add_argument("--encoder", choices=ENCODERS, default="resnet50")
    parser.add_argument("--scale-activation", choices=SCALE_ACTIVATIONS, default="softplus")
    parser.add_argument("--no-offset", action="store_true")
    parser.add_argument("--imagenet", help="torchvision's weights of the encoder")
    parser.add_argument("--lpips", help="see lpips.py")
    parser.add_argument("--resume", help="checkpoint to continue from; replaces the three options of the head")
    parser.add_argument("--iterations", type=int, default=300, help="0: only check")
    parser.add_argument("--batch", type=int, default=4, help="vehicles per iteration")
    parser.add_argument("--views", type=int, default=4)
    parser.add_argument("--targets", type=int, default=2)
    parser.add_argument("--rate", type=float, default=1e-4)
    parser.add_argument("--width", type=int, default=512)
    parser.add_argument("--height", type=int, default=384)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("-o", "--output", required=True)
    args = parser.parse_args()

    torch.manual_seed(args.seed)
    torch.set_num_threads(args.threads)
    size = (args.width, args.height)
    scenes, checks = ([Scene(path, size) for path in paths] for paths in (args.scenes, args.check))
    perceptual = Lpips.read(args.lpips) if args.lpips else None
    if args.resume:
        head = load(args.resume)
    else:
        head = Head(args.encoder, args.scale_activation, not args.no_offset)
        if args.imagenet:
            head.encoder.load_imagenet(torch.load(args.imagenet, map_location="cpu", weights_only=True))

    report(head, checks, "before")
    optimizer = torch.optim.AdamW(head.parameters(), args.rate)
    random = np.random.default_rng(args.seed)
    start, losses = time.time(), []
    for iteration in range(1, args.iterations + 1):
        draws = draw(scenes, random, args.batch, args.views, args.targets)
        optimizer.zero_grad()
        losses.append(backward(head, draws, perceptual))
        optimizer.step()
        if iteration % REPORT_EVERY == 0 or iteration == args.iterations:
            print(f"iteration {iteration}: loss {np.mean(losses):.5f}, {time.time() - start:.0f} s", flush=True)
            losses = []
            save(head, args.output, iteration=iteration)
    if args.iterations:
        settle(head, scenes, random, args.batch, args.views)
        save(head, args.output, iteration=args.iterations)
        report(head, checks, "after")


def draw(scenes, random, batch, views, targets):
    """(inputs, targets) of `batch` vehicles, different ones if there are as many."""
    chosen = random.choice(len(scenes), batch, replace=len(scenes) < batch)
    return [scenes[index].draw(random, views, targets) for index in chosen]


def backward(head, draws, perceptual):
    """Adds the gradients of one batch of (inputs, targets) per vehicle. Returns the mean loss of the vehicles."""
    head.train()
    # All vehicles pass the head together: the batch normalisation must not use the statistics of a single vehicle.
    raw = predict(head, [frame for inputs, _ in draws for frame in inputs])
    # The renderer's graph is the large one, so it exists for one vehicle at a time.
    leaf = raw.detach().requires_grad_()
    total = 0.0
    for (inputs, targets), attributes in zip(draws, leaf.split(len(draws[0][0])), strict=True):
        loss = picture_loss(vehicle(head, inputs, attributes), targets, perceptual) / len(draws)
        loss.backward()
        total += loss.item()
    raw.backward(leaf.grad)
    return total


@torch.no_grad()
def settle(head, scenes, random, batch, views):
    """Recomputes the statistics of the batch normalisation as means over batches: the running ones lag behind weights
    that have just changed, visibly so after 300 iterations."""
    norms = [module for module in head.modules() if isinstance(module, torch.nn.BatchNorm2d)]
    momenta = [norm.momentum for norm in norms]
    for norm in norms:
        norm.reset_running_stats()
        norm.momentum = None  # cumulative mean
    head.train()
    for _ in range(SETTLING_BATCHES):
        draws = draw(scenes, random, batch, views, targets=0)
        predict(head, [frame for inputs, _ in draws for frame in inputs])
    for norm, momentum in zip(norms, momenta, strict=True):
        norm.momentum = momentum


def predict(head, inputs):
    """Raw attributes [n][38][H][W] of input frames. The head gets the prior's depth inside the mask only."""
    stack = lambda key: torch.stack([getattr(frame, key) for frame in inputs])
    return head.predict(stack("image"), stack("depth") * stack("mask"), stack("intrinsics"))


def vehicle(head, inputs, raw):
    """The complete vehicle from the raw attributes of `inputs`: lift, activate, clone."""
    parts = []
    for frame, attributes in zip(inputs, raw, strict=True):
        kept = frame.mask & (frame.depth > 0)
        points = lifted(frame.depth, frame.intrinsics, frame.vehicle_from_camera)[kept]
        rotation = frame.vehicle_from_camera[:3, :3].expand(len(points), 3, 3)
        rgb, attributes = frame.image[:, kept].T, attributes[:, kept].T
        parts.append(activate(attributes, points, rotation, rgb, head.scale_activation, head.offset))
    return joined(parts).completed([frame.side for frame in inputs])


def picture(gaussians, frame):
    """[H][W][3] on white."""
    camera_from_vehicle = torch.linalg.inv(frame.vehicle_from_camera)
    size = frame.mask.shape[::-1]
    return render(gaussians, camera_from_vehicle, frame.intrinsics, size, frame.on_white.new_ones(3)).color


def picture_loss(gaussians, targets, perceptual):
    """MSE + 0.05 LPIPS, summed over the targets (paper eq. 13)."""
    loss = 0
    for frame in targets:
        found = picture(gaussians, frame)
        loss = loss + (found - frame.on_white).square().mean()
        if perceptual:
            channels_first = (image.permute(2, 0, 1)[None] for image in (found, frame.on_white))
            loss = loss + LPIPS_WEIGHT * perceptual(*channels_first).sum()
    return loss


@torch.no_grad()
def unseen_psnr(head, inputs, targets):
    """PSNR in dB over the whole picture, on white, mean of the targets."""
    head.eval()
    full = vehicle(head, inputs, predict(head, inputs))
    errors = [(picture(full, f).clamp(0, 1) - f.on_white).square().mean().item() for f in targets]
    return float(np.mean([-10 * np.log10(e) for e in errors]))


def report(head, scenes, when):
    for scene in scenes:
        for name, inputs, targets in scene.splits():
            print(f"{when}: {scene.path.name} {name}: {unseen_psnr(head, inputs, targets):.3f} dB", flush=True)


if __name__ == "__main__":
    main()
