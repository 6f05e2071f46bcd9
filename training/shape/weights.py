"""Writes a trained network for the library: convolutions with their normalisation merged in, as float16.

For each layer, little endian: channels out and in, kernel side (uint16 each), weights [out][in][k][k], biases [out].
"""

import numpy as np

MAGIC = b"VGSHAPE1"


def folded(network):
    """(weights, biases) of every convolution in order."""
    for layer in network.layers:
        conv, norm = layer[0], layer[1]
        factor = norm.weight / (norm.running_var + norm.eps).sqrt()
        yield conv.weight * factor.view(-1, 1, 1, 1), norm.bias - norm.running_mean * factor
    yield network.last.weight, network.last.bias


def write(network, path):
    layers = [tuple(t.detach().contiguous().numpy() for t in layer) for layer in folded(network)]
    with open(path, "wb") as file:
        file.write(MAGIC + np.array([len(layers)], "<u2").tobytes())
        for weight, bias in layers:
            out, inside, k, _ = weight.shape
            file.write(np.array([out, inside, k], "<u2").tobytes())
            file.write(weight.astype("<f2").tobytes() + bias.astype("<f2").tobytes())


def read_into(path):
    """The U-Net as the library evaluates it: the file's float16 weights, without normalisation."""
    import torch

    from network import UNet

    network = UNet().eval()
    data = open(path, "rb").read()
    assert data.startswith(MAGIC)
    at = len(MAGIC) + 2

    def take(kind, shape):
        nonlocal at
        count = int(np.prod(shape))
        out = np.frombuffer(data, kind, count, at).reshape(shape)
        at += out.nbytes
        return out

    for layer in [*network.layers, None]:
        out, inside, k = (int(v) for v in take("<u2", 3))
        weight = torch.from_numpy(take("<f2", (out, inside, k, k)).astype(np.float32))
        bias = torch.from_numpy(take("<f2", (out,)).astype(np.float32))
        if layer is None:
            network.last.weight.data, network.last.bias.data = weight, bias
        else:
            layer[0].weight.data = weight
            norm = layer[1]
            norm.weight.data.fill_((1 + norm.eps) ** 0.5)
            norm.bias.data = bias
    assert at == len(data)
    return network
