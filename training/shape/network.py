"""The shape network: from the visual hull to the vehicle's signed distance.

A U-Net over (z, x); the slices along |y| are its channels, so it sees a whole column of the vehicle at once, and
length and height by convolution. Its outputs are a correction of the hull's signed distance and, per node, the
expected error (the scale of a Laplace distribution).
"""

import torch
from torch import nn

NODES = (16, 32, 96)  # |y|, z, x
NUMBERS = 11
CLAMP_M = 0.25  # metres per unit of the output; distances beyond are not distinguished
WIDTHS = (32, 48, 64, 96)
LEAST_SCALE, MOST_SCALE = -4.0, 1.0  # logarithms of the Laplace scale, units of CLAMP_M


def block(inside, outside, kernel, stride=1):
    # The normalisation is merged into the convolution when the weights are written.
    return nn.Sequential(
        nn.Conv2d(inside, outside, kernel, stride, kernel // 2, bias=False), nn.BatchNorm2d(outside), nn.ReLU()
    )


class UNet(nn.Module):
    """3 x 3 convolutions at four resolutions."""

    def __init__(self):
        super().__init__()
        a, b, c, d = WIDTHS
        first = NODES[0] + 2 + NUMBERS
        self.layers = nn.ModuleList(
            [
                block(first, a, 3), block(a, a, 3),
                block(a, b, 3, 2), block(b, b, 3),
                block(b, c, 3, 2), block(c, c, 3),
                block(c, d, 3, 2), block(d, d, 3), block(d, d, 3),
                block(d + c, c, 3), block(c + b, b, 3), block(b + a, a, 3),
            ]
        )  # fmt: skip
        self.last = nn.Conv2d(a, 2 * NODES[0], 3, padding=1)

    def forward(self, x):
        l = self.layers
        up = lambda t: nn.functional.interpolate(t, scale_factor=2, mode="nearest")
        full = l[1](l[0](x))
        half = l[3](l[2](full))
        quarter = l[5](l[4](half))
        deep = l[8](l[7](l[6](quarter)))
        quarter = l[9](torch.cat([up(deep), quarter], 1))
        half = l[10](torch.cat([up(quarter), half], 1))
        full = l[11](torch.cat([up(half), full], 1))
        return self.last(full)


class ColumnMlp(nn.Module):
    """The alternative: the same input, but every column along |y| independently."""

    def __init__(self, hidden=160):
        super().__init__()
        first = NODES[0] + 2 + NUMBERS
        self.layers = nn.ModuleList([block(first, hidden, 1), block(hidden, hidden, 1), block(hidden, hidden, 1)])
        self.last = nn.Conv2d(hidden, 2 * NODES[0], 1)

    def forward(self, x):
        for layer in self.layers:
            x = layer(x)
        return self.last(x)


KINDS = {"unet": UNet, "columns": ColumnMlp}


def network_input(hull, numbers):
    """Channels [n][16 + 2 + 11][32][96] from the hull [n][16][32][96] in units of 0.5 m and the view numbers [n][11]."""
    n, _, height, width = hull.shape
    z = torch.linspace(-1, 1, height).view(1, 1, height, 1).expand(n, 1, height, width)
    x = torch.linspace(-1, 1, width).view(1, 1, 1, width).expand(n, 1, height, width)
    constant = numbers.view(n, -1, 1, 1).expand(n, numbers.shape[1], height, width)
    return torch.cat([hull, x, z, constant], 1)


def answer(raw, hull):
    """Signed distance in units of CLAMP_M and the logarithm of its Laplace scale, each [n][16][32][96]."""
    correction, scale = raw.chunk(2, 1)
    return (2 * hull).clamp(-1, 1) + correction, scale.clamp(LEAST_SCALE, MOST_SCALE)
