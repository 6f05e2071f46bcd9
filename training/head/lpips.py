"""LPIPS (Zhang et al. 2018) with AlexNet features, from a file of weights that the user provides.

The file is the state dict of the package `lpips`, which must not be distributed with this repository:

    python -c "import lpips, torch; torch.save(lpips.LPIPS(net='alex').state_dict(), 'lpips.pth')"
"""

import torch
from torch import nn

# Per layer: channels in and out, kernel side, stride, padding, and whether a 3 x 3 maximum at stride 2 comes first.
LAYERS = (
    (3, 64, 11, 4, 2, False),
    (64, 192, 5, 1, 2, True),
    (192, 384, 3, 1, 1, True),
    (384, 256, 3, 1, 1, False),
    (256, 256, 3, 1, 1, False),
)
NAMES = ("net.slice1.0", "net.slice2.3", "net.slice3.6", "net.slice4.8", "net.slice5.10")
LEAST_SIDE = 32  # smaller pictures are empty after the second maximum


class Lpips(nn.Module):
    """Frozen; gradients pass to the pictures."""

    def __init__(self):
        super().__init__()
        self.convolutions = nn.ModuleList(nn.Conv2d(i, o, k, s, p) for i, o, k, s, p, _ in LAYERS)
        self.weights = nn.ParameterList(torch.zeros(1, layer[1], 1, 1) for layer in LAYERS)
        self.register_buffer("shift", torch.tensor([-0.030, -0.088, -0.188]).view(1, 3, 1, 1))
        self.register_buffer("scale", torch.tensor([0.458, 0.448, 0.450]).view(1, 3, 1, 1))
        self.requires_grad_(False)

    @classmethod
    def read(cls, path):
        state, self = torch.load(path, map_location="cpu", weights_only=True), cls()
        for k, (name, convolution) in enumerate(zip(NAMES, self.convolutions, strict=True)):
            convolution.weight.copy_(state[f"{name}.weight"])
            convolution.bias.copy_(state[f"{name}.bias"])
            self.weights[k].copy_(state[f"lin{k}.model.1.weight"])
        return self.eval()

    def forward(self, found, expected):
        """Distance of two pictures [n][3][H][W] in [0, 1]. [n]"""
        distance = 0
        for weight, a, b in zip(self.weights, self.features(found), self.features(expected), strict=True):
            distance = distance + (weight * (unit(a) - unit(b)) ** 2).sum(1).mean((1, 2))
        return distance

    def features(self, image):
        x = (2 * image - 1 - self.shift) / self.scale
        for convolution, layer in zip(self.convolutions, LAYERS, strict=True):
            if layer[-1]:
                x = nn.functional.max_pool2d(x, 3, 2)
            x = torch.relu(convolution(x))
            yield x


def unit(x):
    return x / (x.square().sum(1, keepdim=True) + 1e-20).sqrt()
