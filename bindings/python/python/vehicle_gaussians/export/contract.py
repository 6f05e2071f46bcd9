"""Contracts of ONNX files: the contract "geometry prior", version 1, and those of the segmentation and the
perceptual distance.

All tensors are float32, views first, without a batch axis. N views of H x W pixels:

inputs    images (N,3,H,W) RGB in [0,1], normalised by the graph; intrinsics (N,3,3) in pixels, the centre of the
          top-left pixel is (0.5, 0.5); cam_to_ref (N,4,4) from each camera (x right, y down, z forward) to that of
          view 0, metres, the first one is the identity.
outputs   depth (N,H,W) above 0; rays (N,H,W,3) unit vectors in the camera's axes; scale (1) metres per unit of depth;
          confidence (N,H,W) of which only the order counts; mask (N,H,W) probability; cam_to_ref_pred (N,4,4)
          predicted poses, translations in the unit of depth.

Required are images and depth. What else the host needs to know is in the file's metadata, see `PRIOR`. A
segmentation has images and mask (N,H,W), the probability of vehicle; N may be fixed to 1.

    python -m vehicle_gaussians.export.contract FILE.onnx
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from .script import need, run

VERSION = "1"
#: Numbers are fixed sizes; letters are sizes that agree wherever they occur.
Shape = tuple[int | str, ...]
INPUTS: dict[str, Shape] = {
    "images": ("N", 3, "H", "W"),
    "intrinsics": ("N", 3, 3),
    "cam_to_ref": ("N", 4, 4),
}
OUTPUTS: dict[str, Shape] = {
    "depth": ("N", "H", "W"),
    "rays": ("N", "H", "W", 3),
    "scale": (1,),
    "confidence": ("N", "H", "W"),
    "mask": ("N", "H", "W"),
    "cam_to_ref_pred": ("N", 4, 4),
}


def one_of(*allowed: str) -> Callable[[str], str | None]:
    """None for one of these values, otherwise what is allowed."""
    return lambda text: None if text in allowed else " or ".join(allowed)


def whole_number(text: str) -> str | None:
    return None if re.fullmatch("[1-9][0-9]*", text) else "a whole number above 0"


def three_numbers(text: str) -> str | None:
    parts = text.split(",")
    try:
        return None if len(parts) == 3 and all(float(part) == float(part) for part in parts) else "r,g,b"
    except ValueError:
        return "r,g,b"


def some_text(text: str) -> str | None:
    return None if text.strip() else "some text"


#: Known keys: whether each is required, and its allowed values. Other keys are ignored.
Keys = Mapping[str, tuple[bool, Callable[[str], str | None]]]
#: How photographs are resized to H x W.
FRAMING: Keys = {
    "vg.size_multiple": (False, whole_number),
    "vg.long_side": (False, whole_number),
    "vg.resize": (False, one_of("cover_crop", "stretch")),
    "vg.mean": (False, three_numbers),
    "vg.std": (False, three_numbers),
}
ORIGIN: Keys = {"vg.license": (False, some_text), "vg.weights": (False, some_text)}


class Contract(NamedTuple):
    """Contract of one kind of file."""

    keys: Keys
    inputs: Mapping[str, Shape]
    outputs: Mapping[str, Shape]
    required: tuple[str, ...]


PRIOR = Contract(
    {
        "vg.contract": (True, one_of(VERSION)),
        "vg.prior": (True, some_text),
        "vg.depth": (True, one_of("along_ray", "z")),
        "vg.metric": (True, one_of("true", "false")),
        **FRAMING,
        **ORIGIN,
    },
    INPUTS,
    OUTPUTS,
    ("images", "depth"),
)
SEGMENTATION = Contract(
    {"vg.contract": (True, one_of(VERSION)), "vg.mask": (True, some_text), **FRAMING, **ORIGIN},
    {"images": ("N", 3, "H", "W")},
    {"mask": ("N", "H", "W")},
    ("images", "mask"),
)
LPIPS = Contract(
    {
        "vg.contract": (True, one_of(VERSION)),
        "vg.metric": (True, one_of("lpips")),
        "vg.lpips.net": (True, one_of("alex", "vgg", "squeeze")),
        "vg.range": (True, one_of("0..1")),
        **ORIGIN,
    },
    {"a": ("N", 3, "H", "W"), "b": ("N", 3, "H", "W")},
    {"lpips": ("N",)},
    ("a", "b", "lpips"),
)


class ContractError(Exception):
    """A file that violates the contract: which part, what was found, what is allowed."""


def stamp(path: str | os.PathLike[str], entries: Mapping[str, str]) -> None:
    """Writes metadata into a finished file and replaces values of the same keys.

    The weights stay where they are: a file of external data is neither read nor written.
    """
    onnx = need_onnx()
    path = Path(path)
    model = onnx.load(path, load_external_data=False)
    known = {entry.key: entry.value for entry in model.metadata_props} | dict(entries)
    del model.metadata_props[:]
    for key, value in known.items():
        model.metadata_props.add(key=key, value=value)
    # In the folder of the file, so that the names of external data stay valid while it is written.
    unfinished = path.with_name(path.name + ".unfinished")
    try:
        onnx.save(model, unfinished)
        os.replace(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def check(path: str | os.PathLike[str]) -> dict[str, str]:
    """Checks the file against the contract and returns its metadata; raises ContractError."""
    path = Path(path)
    model = load(path)
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    kind = kind_of(metadata)
    check_metadata(metadata, kind.keys)
    stored = {tensor.name for tensor in model.graph.initializer}
    given = [value for value in model.graph.input if value.name not in stored]
    sizes: dict[str, int | str] = {}
    check_values("input", given, kind.inputs, kind.required, sizes)
    check_values("output", model.graph.output, kind.outputs, kind.required, sizes)
    if "images" in kind.inputs:
        check_size(metadata, sizes)
    if kind is SEGMENTATION and sizes["N"] not in (1, "dynamic"):
        raise ContractError(f"input images: N is {sizes['N']}; allowed: 1 or dynamic, views are shown one by one")
    if kind is PRIOR:
        names = {value.name for value in model.graph.output}
        if metadata["vg.metric"] == "false" and "cam_to_ref_pred" not in names:
            raise ContractError(
                "vg.metric: false without an output cam_to_ref_pred, from which the scale would have to come; "
                "allowed: both, or depth in metres"
            )
    check_operators(model)
    check_external_data(model, path)
    return metadata


def kind_of(metadata: Mapping[str, str]) -> Contract:
    if metadata.get("vg.metric") == "lpips":
        return LPIPS
    return SEGMENTATION if "vg.mask" in metadata else PRIOR


def load(path: Path) -> Any:
    onnx = need_onnx()
    from google.protobuf.message import DecodeError  # onnx brings it

    try:
        return onnx.load(path, load_external_data=False)
    except OSError as error:
        raise ContractError(f"cannot be read: {error.strerror or error}") from error
    except DecodeError as error:
        raise ContractError("not an ONNX file") from error


def check_metadata(metadata: Mapping[str, str], keys: Keys) -> None:
    for key, (required, refuses) in keys.items():
        if key not in metadata:
            if required:
                raise ContractError(f"metadata {key}: missing; allowed: {refuses('') or 'any'}")
        elif (allowed := refuses(metadata[key])) is not None:
            raise ContractError(f"metadata {key}: {metadata[key]!r}; allowed: {allowed}")


def check_values(
    kind: str, values: Any, shapes: Mapping[str, Shape], required: tuple[str, ...], sizes: dict[str, int | str]
) -> None:
    """Checks names, types and shapes; `sizes` collects N, H and W: a number, or "dynamic"."""
    found = {value.name: value.type.tensor_type for value in values}
    for name in found:
        if name not in shapes:
            raise ContractError(f"{kind} {name}: unknown; allowed: {', '.join(shapes)}")
    for name, shape in shapes.items():
        if name not in found:
            if name in required:
                raise ContractError(f"{kind} {name}: missing; found: {', '.join(found) or 'none'}")
            continue
        tensor = found[name]
        if tensor.elem_type != need_onnx().TensorProto.FLOAT:
            kind_found = need_onnx().TensorProto.DataType.Name(tensor.elem_type).lower()
            raise ContractError(f"{kind} {name}: {kind_found}; allowed: float (float32)")
        dims = [dim.dim_value if dim.HasField("dim_value") else "dynamic" for dim in tensor.shape.dim]
        words = f"{kind} {name}: {shown(dims)}; allowed: {shown(shape)}"
        if not tensor.HasField("shape") or len(dims) != len(shape):
            raise ContractError(words)
        for size, wanted in zip(dims, shape, strict=True):
            if isinstance(wanted, int) and size != wanted:
                raise ContractError(words)
            if isinstance(wanted, str) and sizes.setdefault(wanted, size) != size:
                raise ContractError(f"{words}, where {wanted} is {sizes[wanted]} in what comes before")


def shown(shape: Any) -> str:
    return "(" + ", ".join(map(str, shape)) + ")"


def check_size(metadata: Mapping[str, str], sizes: Mapping[str, int | str]) -> None:
    """Checks that a fixed size meets its own rule and that a dynamic one has a rule."""
    dynamic = "dynamic" in (sizes["H"], sizes["W"])
    for key in ("vg.size_multiple", "vg.long_side"):
        if dynamic and key not in metadata:
            raise ContractError(f"metadata {key}: missing; required where H or W is dynamic")
    multiple = int(metadata.get("vg.size_multiple", "1"))
    for letter in "HW":
        size = sizes[letter]
        if isinstance(size, int) and size % multiple:
            raise ContractError(f"input images: {letter} is {size}; allowed: multiples of {multiple}")


def check_operators(model: Any) -> None:
    """Checks that only standard operators, and functions that the file itself defines, are used."""
    own = {function.domain for function in model.functions}
    for graph in [model.graph, *model.functions]:
        for node in graph.node:
            if node.domain not in ("", "ai.onnx") and node.domain not in own:
                raise ContractError(f"node {node.name}: {node.domain}::{node.op_type}; allowed: standard operators")


def check_external_data(model: Any, path: Path) -> None:
    """Checks that the external weights exist and are long enough."""
    external = need_onnx().TensorProto.EXTERNAL
    for tensor in model.graph.initializer:
        if tensor.data_location != external:
            continue
        entry = {item.key: item.value for item in tensor.external_data}
        file = path.parent / entry["location"]
        if not file.is_file():
            raise ContractError(f"external data {file}: missing; keep it in the folder of {path.name}")
        end = int(entry.get("offset", 0)) + int(entry.get("length", 0))
        if file.stat().st_size < end:
            raise ContractError(f"external data {file}: {file.stat().st_size} bytes; needed: {end} for {tensor.name}")


def need_onnx() -> Any:
    return need("onnx", "pip install onnx")


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m vehicle_gaussians.export.contract", description="checks an ONNX file and prints its metadata"
    )
    parser.add_argument("file", metavar="FILE.onnx")
    chosen = parser.parse_args(arguments)
    try:
        metadata = check(chosen.file)
    except ContractError as error:
        print(f"{chosen.file}: {error}", file=sys.stderr)
        return 1
    for key, value in metadata.items():
        print(f"{key}={value}")
    return 0


if __name__ == "__main__":
    sys.exit(run("contract", main))
