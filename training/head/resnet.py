"""ResNet encoders (He et al. 2016) in torchvision's layout, so that its ImageNet weights load by name.

The stem takes RGB and depth: four channels. As in torchvision's files the stride of a bottleneck is on its 3 x 3
convolution.
"""

import torch
from torch import nn


class Basic(nn.Module):
    """Two 3 x 3 convolutions around a shortcut."""

    EXPANSION = 1

    def __init__(self, inside, width, stride):
        super().__init__()
        self.conv1 = nn.Conv2d(inside, width, 3, stride, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(width)
        self.conv2 = nn.Conv2d(width, width, 3, 1, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(width)
        self.downsample = shortcut(inside, width, stride)

    def forward(self, x):
        out = torch.relu(self.bn1(self.conv1(x)))
        return torch.relu(self.bn2(self.conv2(out)) + self.downsample(x))


class Bottleneck(nn.Module):
    """1 x 1 down to `width`, 3 x 3, 1 x 1 up to four times `width`, around a shortcut."""

    EXPANSION = 4

    def __init__(self, inside, width, stride):
        super().__init__()
        outside = width * self.EXPANSION
        self.conv1 = nn.Conv2d(inside, width, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(width)
        self.conv2 = nn.Conv2d(width, width, 3, stride, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(width)
        self.conv3 = nn.Conv2d(width, outside, 1, bias=False)
        self.bn3 = nn.BatchNorm2d(outside)
        self.downsample = shortcut(inside, outside, stride)

    def forward(self, x):
        out = torch.relu(self.bn1(self.conv1(x)))
        out = torch.relu(self.bn2(self.conv2(out)))
        return torch.relu(self.bn3(self.conv3(out)) + self.downsample(x))


def shortcut(inside, outside, stride):
    """The identity if the shapes allow it, without weights and without a name in the file."""
    if stride == 1 and inside == outside:
        return nn.Identity()
    return nn.Sequential(nn.Conv2d(inside, outside, 1, stride, bias=False), nn.BatchNorm2d(outside))


class ResNet(nn.Module):
    """Features at 1/2, 1/4, 1/8, 1/16 and 1/32 of the input's size; `channels` has the number of each."""

    def __init__(self, block, counts, widths):
        super().__init__()
        stem, *widths = widths
        self.conv1 = nn.Conv2d(4, stem, 7, 2, 3, bias=False)
        self.bn1 = nn.BatchNorm2d(stem)
        self.maxpool = nn.MaxPool2d(3, 2, 1)
        inside, self.channels = stem, [stem]
        for k, (count, width) in enumerate(zip(counts, widths, strict=True)):
            blocks = []
            for i in range(count):
                blocks.append(block(inside, width, 2 if i == 0 and k > 0 else 1))
                inside = width * block.EXPANSION
            setattr(self, f"layer{k + 1}", nn.Sequential(*blocks))
            self.channels.append(inside)
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")

    def forward(self, x):
        features = [torch.relu(self.bn1(self.conv1(x)))]
        x = self.maxpool(features[0])
        for layer in (self.layer1, self.layer2, self.layer3, self.layer4):
            x = layer(x)
            features.append(x)
        return features

    def load_imagenet(self, state):
        """Loads torchvision's weights of the same depth (a state dict). The depth filter starts at zero: at
        first the encoder sees the input it was trained on."""
        state = {name: value for name, value in state.items() if not name.startswith("fc.")}
        rgb = state.get("conv1.weight")
        expected = (self.conv1.out_channels, 3, 7, 7)
        if rgb is None or tuple(rgb.shape) != expected:
            found = "missing" if rgb is None else tuple(rgb.shape)
            raise ValueError(f"conv1.weight: found {found}, a torchvision ResNet has {expected}")
        state["conv1.weight"] = torch.cat([rgb, torch.zeros_like(rgb[:, :1])], 1)
        self.load_state_dict(state)


ENCODERS = {
    "resnet50": lambda: ResNet(Bottleneck, (3, 4, 6, 3), (64, 64, 128, 256, 512)),
    "resnet18": lambda: ResNet(Basic, (2, 2, 2, 2), (64, 64, 128, 256, 512)),
    # For tests: the same code, small enough to live in the repository.
    "tiny": lambda: ResNet(Basic, (1, 1, 1, 1), (4, 4, 6, 6, 8)),
}
