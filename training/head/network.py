"""The Gaussian head (paper sec. "Gaussian Attribute Estimation"): a ResNet encoder and a UNet decoder that compute
38 raw attributes per pixel, [o 1, dp 3, q 4, s 3, h 27], from a view's picture and the prior's depth.

An untrained head is the surfel solution. The last layer's weights start at zero and its bias at no rotation, and
the raw scale is an offset from the one whose activation is the pixel's footprint: every Gaussian starts round, with
size FOOTPRINT_SIGMA_PX in its own view, at the prior's position, in the pixel's colour, nearly opaque.
"""

import torch
from torch import nn

from resnet import ENCODERS

CHANNELS = 38  # o 1, dp 3, q 4, s 3, h 27
QUATERNION_W = 4  # channel
SCALES = slice(8, 11)  # channels

SIZE_MULTIPLE = 32  # the encoder halves five times
DEPTH_SPREAD_M = 2.5  # half of a car's length: normalised depth stays near [-1, 1]
IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_STD = (0.229, 0.224, 0.225)

FOOTPRINT_SIGMA_PX = 0.5  # as in the surfel head
SCALE_WITHOUT_DEPTH_M = 0.01
SCALE_ACTIVATIONS = ("softplus", "sigmoid", "relu")
DECODER_WIDTHS = {"resnet50": (256, 128, 64, 64, 32), "resnet18": (256, 128, 64, 64, 32), "tiny": (6, 6, 4, 4, 4)}


class Head(nn.Module):
    """Maps views to raw attributes, as an exported head does."""

    def __init__(self, encoder="resnet50", scale_activation="softplus", offset=True):
        super().__init__()
        if scale_activation not in SCALE_ACTIVATIONS:
            raise ValueError(f"scale_activation: found {scale_activation!r}, allowed {SCALE_ACTIVATIONS}")
        self.encoder_name, self.scale_activation, self.offset = encoder, scale_activation, offset
        self.encoder = ENCODERS[encoder]()
        self.decoder = Decoder([4, *self.encoder.channels], DECODER_WIDTHS[encoder])
        self.last = nn.Conv2d(DECODER_WIDTHS[encoder][-1], CHANNELS, 1)
        nn.init.zeros_(self.last.weight)
        nn.init.zeros_(self.last.bias)
        self.last.bias.data[QUATERNION_W] = 1.0
        # Not in checkpoints: the normalisation is part of the contract, not of the weights.
        self.register_buffer("mean", torch.tensor(IMAGENET_MEAN).view(1, 3, 1, 1), persistent=False)
        self.register_buffer("std", torch.tensor(IMAGENET_STD).view(1, 3, 1, 1), persistent=False)

    def forward(self, images, depth, intrinsics):
        """Raw attributes [N][38][H][W] of N views, each processed independently.

        images [N][3][H][W] RGB in [0, 1]; depth [N][H][W] planar z in metres, 0 = none; intrinsics [N][3][3] in
        pixels. H and W are multiples of SIZE_MULTIPLE; see `predict` for other sizes."""
        valid = depth > 0
        x = torch.cat([(images - self.mean) / self.std, normalized_depth(depth, valid).unsqueeze(1)], 1)
        raw = self.last(self.decoder([x, *self.encoder(x)]))
        start = scale_start(depth, valid, intrinsics, self.scale_activation).unsqueeze(1)
        before, scales, after = raw.split((SCALES.start, 3, CHANNELS - SCALES.stop), 1)
        return torch.cat([before, scales + start, after], 1)

    def predict(self, images, depth, intrinsics):
        """`forward` at any size, as a host runs it: pads right and bottom with zeros and crops the output."""
        height, width = depth.shape[1:]
        pad = (0, -width % SIZE_MULTIPLE, 0, -height % SIZE_MULTIPLE)
        padded = [nn.functional.pad(t, pad) for t in (images, depth)]
        return self(*padded, intrinsics)[:, :, :height, :width]


class Decoder(nn.Module):
    """Upwards from the deepest features: doubles the size, appends the encoder's features, applies two convolutions."""

    def __init__(self, channels, widths):
        super().__init__()
        *skips, inside = channels
        self.stages = nn.ModuleList()
        for skip, width in zip(reversed(skips), widths, strict=True):
            self.stages.append(nn.Sequential(*convolution(inside + skip, width), *convolution(width, width)))
            inside = width

    def forward(self, features):
        *skips, x = features
        for stage, skip in zip(self.stages, reversed(skips), strict=True):
            x = stage(torch.cat([nn.functional.interpolate(x, scale_factor=2.0, mode="nearest"), skip], 1))
        return x


def convolution(inside, outside):
    conv = nn.Conv2d(inside, outside, 3, 1, 1, bias=False)
    nn.init.kaiming_normal_(conv.weight, mode="fan_out", nonlinearity="relu")
    return conv, nn.BatchNorm2d(outside), nn.ReLU()


def normalized_depth(depth, valid):
    """(z - mean of the view's valid z) / DEPTH_SPREAD_M, and 0 where there is none. [N][H][W]"""
    there = valid.to(depth.dtype)
    z = torch.where(valid, depth, torch.zeros_like(depth))
    mean = z.sum((1, 2), keepdim=True) / there.sum((1, 2), keepdim=True).clamp(min=1.0)
    return (z - mean) * there / DEPTH_SPREAD_M


def scale_start(depth, valid, intrinsics, activation):
    """Raw scale of a Gaussian as large as its pixel: activation^-1(FOOTPRINT_SIGMA_PX z / f). [N][H][W]

    f is the smaller focal length: no gaps in either direction."""
    focal = torch.minimum(intrinsics[:, 0, 0], intrinsics[:, 1, 1]).view(-1, 1, 1)
    footprint = torch.where(valid, depth * (FOOTPRINT_SIGMA_PX / focal), torch.full_like(depth, SCALE_WITHOUT_DEPTH_M))
    return INVERSES[activation](footprint)


# The inverses stay finite for any footprint: clamped at the smallest scale from below and the largest from above.


def softplus_inverse(y):
    """ln(e^y - 1), metres to raw. For small y the difference cancels; there the series ln y + y/2 + y^2/24 -
    y^4/2880 is exact in float32 (the next term, y^6 / 181440, is 9e-8)."""
    y = y.clamp(1e-10, 3.0)
    small = y.clamp(max=0.5)
    series = small.log() + small / 2 + small**2 / 24 - small**4 / 2880
    return torch.where(y < 0.5, series, y + torch.log1p(-torch.exp(-y.clamp(min=0.5))))


def sigmoid_inverse(y):
    """ln(y / (1 - y)); a sigmoid stays below 1 m."""
    y = y.clamp(1e-10, 1 - 1e-6)
    return y.log() - torch.log1p(-y)


def relu_inverse(y):
    return y.clamp(1e-10, 3.0)


INVERSES = {"softplus": softplus_inverse, "sigmoid": sigmoid_inverse, "relu": relu_inverse}


def save(head, path, **more):
    """Writes a checkpoint: the weights and the settings to build their head."""
    options = {"encoder": head.encoder_name, "scale_activation": head.scale_activation, "offset": head.offset}
    torch.save({"options": options, "weights": head.state_dict(), **more}, path)


def load(path):
    """The head of a checkpoint, in evaluation mode."""
    checkpoint = torch.load(path, map_location="cpu", weights_only=True)
    head = Head(**checkpoint["options"])
    head.load_state_dict(checkpoint["weights"])
    return head.eval()
