"""Code that the export programs share before torch is imported: options, and errors for missing requirements."""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

PACKAGES = "pip install torch onnx onnxscript onnxruntime"


class Unavailable(Exception):
    """A missing requirement of a program; one line that names it and the remedy."""


def need(module: str, command: str) -> Any:
    """The module, or Unavailable with the command that installs it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        why = "" if error.name == package else f" completely ({error})"
        raise Unavailable(f"{package} is not installed{why}: {command}") from error


def need_exporter() -> None:
    """Options of every export."""
    for module in ("torch", "onnx", "onnxscript", "onnxruntime"):
        need(module, PACKAGES)


def run(name: str, main: Callable[[], int]) -> int:
    """Exits with code 2 and one line, without a traceback, for errors that the user can correct."""
    try:
        return main()
    except Unavailable as error:
        words = " ".join(str(error).split())
        print(f"vehicle_gaussians.export.{name}: error: {words}", file=sys.stderr)
        return 2


def size(text: str) -> tuple[int, int]:
    """Width and height from WxH."""
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}; allowed: WxH, for example 518x392") from None
    if width < 1 or height < 1:
        raise argparse.ArgumentTypeError(f"{text!r}; allowed: a width and a height above 0")
    return width, height


def counts(text: str) -> list[int]:
    try:
        numbers = [int(part) for part in text.split(",")]
    except ValueError:
        numbers = [0]
    if min(numbers) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}; allowed: numbers of views, for example 1,3")
    return numbers


def parser(name: str, description: str, output: str) -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(prog=f"python -m vehicle_gaussians.export.{name}", description=description)
    made.add_argument("-o", "--output", type=Path, default=Path(output), metavar="FILE.onnx", help=f"default {output}")
    made.add_argument("--opset", type=int, default=20, metavar="N", help="ONNX operator set (20)")
    return made


def add_prior_options(made: argparse.ArgumentParser, default_size: str, external: bool) -> None:
    """Options of the geometry priors."""
    made.add_argument(
        "--size", type=size, default=size(default_size), metavar="WxH", help=f"pixels, fixed ({default_size})"
    )
    made.add_argument(
        "--data",
        choices=["external", "inline"],
        default="external" if external else "inline",
        help="weights in FILE.onnx.data beside the file, or in it (below 2 GB only); default %(default)s",
    )
    made.add_argument(
        "--parity-views",
        type=counts,
        default=[3],
        metavar="N,...",
        help="numbers of views to compare torch and onnxruntime at (3); the graph is traced with 2",
    )


def add_weights_options(made: argparse.ArgumentParser, default: str, sizes: list[str]) -> None:
    made.add_argument(
        "--weights",
        default=default,
        metavar="NAME|DIR",
        help="a Hugging Face repository, or a folder with its config.json and model.safetensors (%(default)s)",
    )
    made.add_argument("--license", metavar="TEXT", help="licence of the weights, where this program does not know it")
    made.add_argument(
        "--random-weights",
        nargs="?",
        const=sizes[0],
        choices=sizes,
        help="random initial weights instead, to try the export; without a value: %(const)s",
    )


def check_multiple(chosen: tuple[int, int], multiple: int) -> None:
    if chosen[0] % multiple or chosen[1] % multiple:
        raise Unavailable(f"--size: {chosen[0]}x{chosen[1]}; allowed: multiples of {multiple}")


def licence(weights: str, known: dict[str, str], stated: str | None) -> str:
    """The licence of these weights: as stated, or as published."""
    if stated:
        return stated
    if weights in known:
        return known[weights]
    raise Unavailable(f"--license: missing; the licence of {weights} is not known here, known are: {', '.join(known)}")


def downloaded(address: str, what: str, option: str) -> Path:
    """The file of a public address: in torch's cache, or downloaded there; `option` names a local file instead."""
    hub = need("torch.hub", PACKAGES)
    name = address.rpartition("/")[2]
    file = Path(hub.get_dir()) / "checkpoints" / name
    if not file.is_file():
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            hub.download_url_to_file(address, str(file), hash_prefix=file.stem.rpartition("-")[2])
        except (OSError, RuntimeError) as error:
            raise Unavailable(
                f"the {what} cannot be had ({error}): where the network is, `curl -O {address}`, then {option} {name}"
            ) from error
    return file


def weights_folder(weights: str) -> Path:
    """The folder with config.json and model.safetensors: a local one, or a Hugging Face repository's, downloaded."""
    folder = Path(weights)
    if not folder.is_dir():
        hub = need("huggingface_hub", "pip install huggingface_hub")
        try:
            folder = Path(hub.snapshot_download(weights, allow_patterns=["config.json", "model.safetensors"]))
        except Exception as error:  # the package has many: of the network, the HTTP status, the name, its cache
            first = str(error).strip().split("\n")[0] or type(error).__name__
            raise Unavailable(
                f"weights {weights} cannot be had ({first}): where the network is, "
                f"`hf download {weights} --local-dir DIR`, then --weights DIR"
            ) from error
    for name in ("config.json", "model.safetensors"):
        if not (folder / name).is_file():
            raise Unavailable(f"weights {folder}: no {name}; `hf download REPOSITORY --local-dir DIR` gets both files")
    return folder


def config_of(folder: Path) -> dict[str, Any]:
    try:
        config = json.loads((folder / "config.json").read_text())
    except ValueError as error:
        raise Unavailable(f"weights {folder / 'config.json'}: not JSON: {error}") from error
    if not isinstance(config, dict):
        raise Unavailable(f"weights {folder / 'config.json'}: not a JSON object")
    return config
