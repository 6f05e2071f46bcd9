"""From a network to a finished file: the wrapper, the export, and the comparison of torch with onnxruntime.

The wrapper follows MapAnything (Keetha et al. 2025): image tokens, the features of rays and poses added to them,
blocks of attention that alternate between all views and one view, dense and pose and scale heads. It calls the parts
of a network one by one, because what upstream does around them cannot be exported: random input dropout, views in
Python lists, assignments by boolean masks. Everything that the contract asks of the graph is here: normalisation of
the pixels, rays from intrinsics, quaternions from poses, activations.
"""

from __future__ import annotations

import hashlib
import math
import os
import tempfile
import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
import onnx
import onnxruntime
import torch
from torch import Tensor, nn

from . import contract
from .script import Unavailable

#: ImageNet's, which DINOv2 was trained with.
IMAGENET_MEAN, IMAGENET_STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
#: Metres. Cameras closer together than this say nothing about the scale.
LEAST_BASELINE = 1e-4
#: Limit that the tracer may assume, which decides comparisons with upstream's memory limits; the file accepts more.
MOST_VIEWS = 32
#: Largest difference between torch and onnxruntime, relative to the largest value of an output where that is above 1.
#: The published network with random weights reached 1.1e-4, in rays that were nearly zero before they were normalised.
PARITY = 1e-3


class Given(NamedTuple):
    """The cameras in the form that the network takes."""

    #: Unit vectors through the pixel centres, camera axes, (N,3,H,W).
    rays: Tensor
    #: Camera to view 0, quaternions (x, y, z, w) with w >= 0, (N,4).
    rotation: Tensor
    #: Camera centres in view 0's axes, in units of their mean distance from view 0, (N,3).
    translation: Tensor
    #: Logarithm of that distance in metres, (1,1).
    log_distance: Tensor
    #: 1 where that distance is one, 0 where all cameras are at one point, (1,1).
    has_distance: Tensor


class Network(Protocol):
    """The parts of a multi-view network. T = H W / patch^2 tokens, C channels before and D behind `project`."""

    #: Pixels along each side of a token.
    patch: int
    #: Attention over all views, attention within each view, and so on.
    blocks: Sequence[Any]
    #: The blocks behind which `dense` takes its levels, besides the last.
    taps: Sequence[int]
    #: Whether the first level of `dense` is what goes into the blocks.
    fused_level: bool
    #: (C), learned: the token that the scale is read from.
    scale_token: Tensor
    #: (D), added to the tokens of view 0; None if all views are equal.
    reference: Tensor | None

    def encode_images(self, images: Tensor) -> tuple[Tensor, Tensor | None]:
        """(N,T,C), and tokens besides those of the patches (N,R,C), from normalised images (N,3,H,W)."""

    def encode_rays(self, rays: Tensor) -> Tensor:
        """(N,T,C)"""

    def encode_rotation(self, rotation: Tensor) -> Tensor:
        """(N,C)"""

    def encode_translation(self, translation: Tensor) -> Tensor:
        """(N,C)"""

    def encode_distance(self, log_distance: Tensor) -> Tensor:
        """(1,C)"""

    def fuse(self, tokens: Tensor) -> Tensor:
        """The normalisation of the sum of all features."""

    def project(self, tokens: Tensor) -> Tensor:
        """(..., C) to (..., D)"""

    def norm_tap(self, tokens: Tensor) -> Tensor: ...

    def norm(self, tokens: Tensor) -> Tensor: ...

    def dense(self, levels: list[Tensor], given: Given) -> Tensor:
        """(N,6,H,W) before activation, ray 3, depth, confidence, mask, from levels (N,C or D,H/patch,W/patch)."""

    def pose(self, last: Tensor, given: Given) -> Tensor:
        """Translation and quaternion (x, y, z, w) before normalisation, (N,7), from (N,D,H/patch,W/patch)."""

    def scale(self, token: Tensor, given: Given) -> Tensor:
        """The logarithm of metres per unit, (1), from (1,D)."""


class MultiViewPrior(nn.Module):
    """A `Network` behind the contract's inputs and outputs."""

    OUTPUTS = ("depth", "rays", "scale", "confidence", "mask", "cam_to_ref_pred")

    def __init__(
        self, network: Any, mean: Sequence[float] = IMAGENET_MEAN, std: Sequence[float] = IMAGENET_STD
    ) -> None:
        super().__init__()
        self.network = network
        self.register_buffer("mean", torch.tensor(mean).view(3, 1, 1))
        self.register_buffer("std", torch.tensor(std).view(3, 1, 1))

    def forward(self, images: Tensor, intrinsics: Tensor, cam_to_ref: Tensor) -> tuple[Tensor, ...]:
        height, width = images.shape[-2:]
        rows, columns = height // self.network.patch, width // self.network.patch
        given = cameras_for_network(intrinsics, cam_to_ref, height, width)
        fused, extra = self.fused(images, given)
        levels, scale_token = self.attend(fused, extra)
        maps = [level.transpose(1, 2).unflatten(2, (rows, columns)) for level in levels]
        channels = self.network.dense(maps, given)  # (N,6,H,W)
        pose = self.network.pose(maps[-1], given)
        scale = self.network.scale(scale_token, given).exp().clamp(min=1e-8)
        rays = channels[:, :3] / channels[:, :3].norm(dim=1, keepdim=True).clamp(min=1e-8)
        return (
            channels[:, 3].exp(),
            rays.permute(0, 2, 3, 1),
            scale,
            1 + channels[:, 4].exp(),
            channels[:, 5].sigmoid(),
            poses_from_quaternions(pose[:, :3], pose[:, 3:]),
        )

    def fused(self, images: Tensor, given: Given) -> tuple[Tensor, Tensor | None]:
        """Image tokens with the camera tokens added, (N,T,C), and the tokens besides, (N,R,C)."""
        network = self.network
        tokens, extra = network.encode_images((images - self.mean) / self.std)
        # Where there is no distance its logarithm is that of a rounding error, which no network was trained on.
        distance = given.has_distance * network.encode_distance(given.log_distance)
        per_view = network.encode_rotation(given.rotation) + network.encode_translation(given.translation) + distance
        return network.fuse(tokens + network.encode_rays(given.rays) + per_view[:, None]), extra

    def attend(self, fused: Tensor, extra: Tensor | None) -> tuple[list[Tensor], Tensor]:
        """The levels for the dense head, each (N,T,C or D), and the scale token (1,D)."""
        network = self.network
        views, patches, _ = fused.shape
        tokens = fused if extra is None else torch.cat([fused, extra], 1)
        views_tokens = network.project(tokens)  # (N,P,D)
        scale = network.project(network.scale_token.view(1, 1, -1))
        if network.reference is not None:
            first = (torch.arange(views) == 0).to(fused.dtype)
            views_tokens = views_tokens + first[:, None, None] * network.reference
        levels = [fused] if network.fused_level else []
        for index, block in enumerate(network.blocks):
            if index % 2 == 0:
                everything = block(torch.cat([views_tokens.reshape(1, -1, views_tokens.shape[-1]), scale], 1))
                views_tokens, scale = everything[:, :-1].reshape(views_tokens.shape), everything[:, -1:]
            else:
                views_tokens = block(views_tokens)
            if index in network.taps:
                levels.append(network.norm_tap(views_tokens)[:, :patches])
        levels.append(network.norm(views_tokens)[:, :patches])
        return levels, network.norm(scale)[:, 0]


def cameras_for_network(intrinsics: Tensor, cam_to_ref: Tensor, height: int, width: int) -> Given:
    centers = cam_to_ref[:, :3, 3]
    distances = centers.norm(dim=-1)
    # The mean over the cameras that are elsewhere than view 0.
    count = (distances > 0).to(distances.dtype).sum().clamp(min=1)
    mean = (distances.sum() / count).clamp(min=1e-8).view(1, 1)
    return Given(
        rays=rays_from_intrinsics(intrinsics, height, width),
        rotation=quaternions_from_rotations(cam_to_ref[:, :3, :3]),
        translation=centers / mean,
        log_distance=torch.log(mean + 1e-8),
        has_distance=(mean > LEAST_BASELINE).to(mean.dtype),
    )


def rays_from_intrinsics(intrinsics: Tensor, height: int, width: int) -> Tensor:
    """Unit vectors through the pixel centres (0.5, 0.5), (1.5, 0.5) ..., camera axes, (N,3,H,W)."""
    focal_x, focal_y = intrinsics[:, 0, 0, None, None], intrinsics[:, 1, 1, None, None]
    center_x, center_y = intrinsics[:, 0, 2, None, None], intrinsics[:, 1, 2, None, None]
    x = (torch.arange(width, dtype=intrinsics.dtype)[None, None] + 0.5 - center_x) / focal_x  # (N,1,W)
    y = (torch.arange(height, dtype=intrinsics.dtype)[None, :, None] + 0.5 - center_y) / focal_y  # (N,H,1)
    x, y = torch.broadcast_tensors(x, y)
    rays = torch.stack([x, y, torch.ones_like(x)], 1)
    return rays / rays.norm(dim=1, keepdim=True)


def quaternions_from_rotations(rotations: Tensor) -> Tensor:
    """(x, y, z, w) with w >= 0, (N,4).

    Row k of `candidates` is the quaternion times four times its k-th component; the longest row is the one with the
    largest component, which no subtraction made inaccurate. A gather, because a selection by mask cannot be exported.
    """
    rows = rotations.flatten(1).unbind(-1)
    xx, xy, xz, yx, yy, yz, zx, zy, zz = rows
    candidates = torch.stack(
        [
            torch.stack([1 + xx - yy - zz, xy + yx, xz + zx, zy - yz], -1),
            torch.stack([xy + yx, 1 - xx + yy - zz, yz + zy, xz - zx], -1),
            torch.stack([xz + zx, yz + zy, 1 - xx - yy + zz, yx - xy], -1),
            torch.stack([zy - yz, xz - zx, yx - xy, 1 + xx + yy + zz], -1),
        ],
        1,
    )  # (N,4,4)
    squares = torch.diagonal(candidates, dim1=1, dim2=2)
    best = squares.argmax(-1).view(-1, 1, 1).expand(-1, 1, 4)
    chosen = candidates.gather(1, best)[:, 0]
    chosen = chosen / chosen.norm(dim=-1, keepdim=True)
    return torch.where(chosen[:, 3:] < 0, -chosen, chosen)


def poses_from_quaternions(translations: Tensor, quaternions: Tensor) -> Tensor:
    """(N,4,4) from (N,3) and quaternions (x, y, z, w) of any length, (N,4)."""
    x, y, z, w = (quaternions / quaternions.norm(dim=-1, keepdim=True).clamp(min=1e-8)).unbind(-1)
    zero = torch.zeros_like(x)
    rows = [
        torch.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), translations[:, 0]], -1),
        torch.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), translations[:, 1]], -1),
        torch.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), translations[:, 2]], -1),
        torch.stack([zero, zero, zero, zero + 1], -1),
    ]
    return torch.stack(rows, 1)


def fix_position_embedding(transformer: Any, height: int, width: int, patch: int) -> None:
    """Interpolates a DINOv2 transformer's position embedding once, for the one size of the file.

    Left in the graph it would take its scale from the traced size, and fail at any other.
    """
    channels = transformer.pos_embed.shape[-1]
    tokens = torch.zeros(1, 1 + (height // patch) * (width // patch), channels)
    with torch.no_grad():
        # Upstream calls the rows w and the columns h, and passes them in this order.
        fixed = transformer.interpolate_pos_encoding(tokens, height, width).detach().clone()
    transformer.interpolate_pos_encoding = lambda tokens, rows, columns: fixed


def example_inputs(views: int, width: int, height: int, seed: int = 0) -> dict[str, Tensor]:
    """Smooth random pictures, and cameras on an arc of 8 m around a point, 20 degrees apart."""
    random = np.random.default_rng(seed)
    coarse = torch.from_numpy(random.random((views, 3, 6, 8))).float()
    images = nn.functional.interpolate(coarse, size=(height, width), mode="bilinear")
    noise = torch.from_numpy(random.random((views, 3, height, width))).float()
    focal = 0.9 * width * (1 + 0.05 * random.standard_normal(views))
    intrinsics = np.zeros((views, 3, 3))
    intrinsics[:, 0, 0] = intrinsics[:, 1, 1] = focal
    intrinsics[:, :2, 2] = np.array([width, height]) * (0.5 + 0.02 * random.standard_normal((views, 2)))
    intrinsics[:, 2, 2] = 1
    cam_to_ref = np.tile(np.eye(4), (views, 1, 1))
    for index in range(views):
        angle = math.radians(20 * index)
        cos, sin = math.cos(angle), math.sin(angle)
        cam_to_ref[index, :3, :3] = np.array([[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]])
        # Looks at (0, 0, 8) from 8 m; a little higher each time.
        cam_to_ref[index, :3, 3] = [8 * sin, -0.1 * index, 8 - 8 * cos]
    return {
        "images": (0.8 * images + 0.2 * noise).clamp(0, 1),
        "intrinsics": torch.from_numpy(intrinsics).float(),
        "cam_to_ref": torch.from_numpy(cam_to_ref).float(),
    }


@dataclass(frozen=True)
class Difference:
    """Difference between onnxruntime and torch in one output."""

    case: str
    output: str
    #: Largest absolute difference, and largest absolute value.
    largest: float
    value: float

    @property
    def relative(self) -> float:
        return self.largest / max(1.0, self.value)


def write(
    module: Any,
    path: Path,
    traced: Mapping[str, Tensor],
    dynamic: Mapping[str, Mapping[int, Any]],
    outputs: Sequence[str],
    metadata: Mapping[str, str],
    cases: Mapping[str, Mapping[str, Tensor]],
    opset: int,
    external: bool,
) -> list[Difference]:
    """Exports, stamps, checks, compares, and only then puts the file (and its external data) in its place.

    traced: the inputs to trace with. dynamic: per input the axes that stay free. cases: inputs to compare with.
    """
    module = module.float().eval()
    # Run before the export, so that upstream's caches hold real tensors and not those of the tracer.
    with torch.no_grad():
        references = {name: module(*inputs.values()) for name, inputs in cases.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".export-", dir=path.parent) as folder:
        unfinished = Path(folder) / path.name
        trace(module, unfinished, traced, dynamic, outputs, opset, external)
        contract.stamp(unfinished, metadata)
        contract.check(unfinished)
        differences = compare(unfinished, outputs, cases, references)
        worst = max(differences, key=lambda each: each.relative)
        if not worst.relative <= PARITY:
            raise Unavailable(
                f"{worst.output}: onnxruntime is {worst.largest:.2g} from torch with {worst.case}; "
                f"allowed: {PARITY:g} of {max(1.0, worst.value):.3g}; nothing was written"
            )
        # The weights are moved first, so that an existing file is complete.
        for file in sorted(Path(folder).iterdir(), key=lambda file: file.name == path.name):
            os.replace(file, path.parent / file.name)
    return differences


def trace(
    module: Any,
    path: Path,
    traced: Mapping[str, Tensor],
    dynamic: Mapping[str, Mapping[int, Any]],
    outputs: Sequence[str],
    opset: int,
    external: bool,
) -> None:
    with warnings.catch_warnings(), torch.no_grad():
        # Ignores the exporter's warnings about its internals; the result is checked afterwards.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            module,
            tuple(traced.values()),
            path,
            input_names=list(traced),
            output_names=list(outputs),
            opset_version=opset,
            dynamo=True,
            dynamic_shapes=tuple(dict(dynamic[name]) for name in traced),
            external_data=external,
            verbose=False,
        )
    model = onnx.load(path, load_external_data=False)
    refuse_fixed_axes(model, dynamic)
    forget_source(model)
    onnx.save(model, path)


def refuse_fixed_axes(model: Any, dynamic: Mapping[str, Mapping[int, Any]]) -> None:
    """Detects dynamic axes that the exporter has silently made constant."""
    for value in model.graph.input:
        for axis in dynamic[value.name]:
            dim = value.type.tensor_type.shape.dim[axis]
            if dim.HasField("dim_value"):
                raise Unavailable(
                    f"{value.name}: the export fixed axis {axis} to {dim.dim_value}, which has to stay free; "
                    "the network's code makes it a constant: try the versions in training/requirements-export.txt"
                )


def forget_source(model: Any) -> None:
    """Removes the exporter's notes on source lines: they name folders of this machine."""
    graphs = [model.graph, *model.functions]
    for graph in graphs:
        for part in [graph, *graph.node, *graph.value_info]:
            del part.metadata_props[:]
            part.doc_string = ""
    for part in [*model.graph.input, *model.graph.output, *model.graph.initializer]:
        del part.metadata_props[:]
        part.doc_string = ""
    model.doc_string = ""


def session(path: Path) -> Any:
    """onnxruntime on the CPU, without a second copy of the weights in memory."""
    options = onnxruntime.SessionOptions()
    options.add_session_config_entry("session.disable_prepacking", "1")
    options.enable_cpu_mem_arena = False
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])


def compare(
    path: Path,
    outputs: Sequence[str],
    cases: Mapping[str, Mapping[str, Tensor]],
    references: Mapping[str, Sequence[Tensor]],
) -> list[Difference]:
    running = session(path)
    wanted = {value.name for value in running.get_inputs()}
    differences = []
    for case, inputs in cases.items():
        answers = running.run(list(outputs), {name: value.numpy() for name, value in inputs.items() if name in wanted})
        for name, answer, reference in zip(outputs, answers, references[case], strict=True):
            expected = reference.numpy()
            if answer.shape != expected.shape:
                raise Unavailable(f"{name}: onnxruntime answers {answer.shape} with {case}, torch {expected.shape}")
            differences.append(
                Difference(case, name, float(np.abs(answer - expected).max()), float(np.abs(expected).max()))
            )
    return differences


def write_prior(
    module: Any,
    path: Path,
    width: int,
    height: int,
    metadata: Mapping[str, str],
    parity_views: Sequence[int],
    opset: int,
    external: bool,
) -> None:
    """Exports a geometry prior of fixed H x W for any number of views; prints how well torch and onnxruntime agree."""
    print(f"exporting {width}x{height}, opset {opset} ...", flush=True)
    # Traced with two: one view would let the exporter take the axis for a constant.
    views = {0: torch.export.Dim("N", min=1, max=MOST_VIEWS)}
    traced = example_inputs(2, width, height)
    differences = write(
        module,
        path,
        traced,
        {name: views for name in traced},
        module.OUTPUTS,
        metadata,
        {f"N = {count}": example_inputs(count, width, height, seed=count) for count in parity_views},
        opset,
        external,
    )
    report(path, metadata, differences)


def report(path: Path, metadata: Mapping[str, str], differences: Sequence[Difference]) -> None:
    print("| inputs | output | torch - onnxruntime, max abs | largest value |\n|---|---|---|---|")
    for each in differences:
        print(f"| {each.case} | {each.output} | {each.largest:.1e} | {each.value:.4g} |")
    for key, value in metadata.items():
        print(f"{key}={value}")
    total = sum(file.stat().st_size for file in (path, path.with_name(path.name + ".data")) if file.is_file())
    print(f"wrote {path} ({total / 1e6:.1f} MB with its weights)")


def prior_metadata(
    name: str, depth: str, metric: bool, resize: str, multiple: int, long_side: int, license: str, weights: str
) -> dict[str, str]:
    return {
        "vg.contract": contract.VERSION,
        "vg.prior": name,
        "vg.depth": depth,
        "vg.metric": "true" if metric else "false",
        "vg.size_multiple": str(multiple),
        "vg.long_side": str(long_side),
        "vg.resize": resize,
        "vg.license": license,
        "vg.weights": weights,
    }


def refuse_missing_tensors(model: Any, stored: Collection[str], file: Path) -> None:
    """Refuses weights that would leave a tensor at its random initial value."""
    # A tensor with two names, of a module that is known by both, is stored under one of them.
    names: dict[int, list[str]] = {}
    for name, tensor in model.state_dict(keep_vars=True).items():
        names.setdefault(tensor.data_ptr(), []).append(name)
    missing = [each[0] for each in names.values() if not any(name in stored for name in each)]
    if missing:
        raise Unavailable(f"weights {file}: {len(missing)} tensors missing, the first is {missing[0]}")


def file_hash(path: Path) -> str:
    """SHA-256 as the hub shows it for the file."""
    with path.open("rb") as file:
        return "sha256:" + hashlib.file_digest(file, "sha256").hexdigest()


def tensor_hash(module: Any) -> str:
    """SHA-256 over names, shapes and values, for weights that are not in a file."""
    digest = hashlib.sha256()
    for name, tensor in sorted(module.state_dict().items()):
        digest.update(f"{name} {tuple(tensor.shape)} {tensor.dtype};".encode())
        digest.update(np.ascontiguousarray(tensor.numpy()).tobytes())
    return "sha256:" + digest.hexdigest()
