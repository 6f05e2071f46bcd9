"""The report of a reconstruction with names and types, and its JSON schema.

``docs/report.schema.json`` is what ``schema()`` gives; a test holds real reports to it.
"""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from ._documented import field_texts

T = TypeVar("T")


@dataclass(frozen=True)
class Stage:
    """One stage of the run."""

    name: str
    """plan, undistort, calibrate, prior, pixels, head, symmetry, refine, check; of a baseline plan, undistort, start,
    refine, check."""
    ms: float
    """Wall time, milliseconds."""


@dataclass(frozen=True)
class LeftOut:
    """Something the scene did not need."""

    what: str
    """What: views, calibration, pixels, SH bands, clones."""
    why: str
    """Why it is not needed."""
    count: int
    """How many."""


@dataclass(frozen=True)
class ViewCalibration:
    """How a view's camera was moved about the vehicle's middle, beside the plane's motion, which all share."""

    name: str
    """The view's name."""
    pixels: float
    """How far the picture of the vehicle's middle moved, pixels of the undistorted view."""
    degrees: float
    """Rotation, degrees."""
    metres: float
    """Translation of the vehicle's middle, metres."""
    vehicle_from_camera: list[float]
    """The corrected camera in the caller's vehicle frame, 12 numbers, row-major [R | t]."""
    ignored: bool
    """Whether its silhouette was left out of the estimate and carves nothing."""


@dataclass(frozen=True)
class Calibration:
    """What the calibration found; of a refused correction, what was refused."""

    verdict: Literal["not-needed", "accepted", "refused"]
    """What became of the correction."""
    why: str
    """Why, in words."""
    yaw_degrees: float
    """Rotation about z that brings the true plane of symmetry onto y = 0, degrees."""
    roll_degrees: float
    """Rotation about x that does, degrees."""
    lateral_m: float
    """Shift along y, at the vehicle's middle, that does, metres."""
    corrected_from_vehicle: list[float]
    """The plane's whole motion, 12 numbers, row-major [R | t]."""
    views: list[ViewCalibration]
    """How each used view's camera was moved."""
    coverage_before: float
    """Part of the masks' pixels whose rays meet the hull of all other views and of all mirrored ones, before."""
    coverage_after: float
    """Part of the masks' pixels whose rays meet the hull of the others with the correction."""
    edge_error_before_px: float
    """Mean of what rays on the silhouettes' edges miss the hull by, before, pixels; each at most 20."""
    edge_error_after_px: float
    """Mean of what rays on the silhouettes' edges miss the hull by with the correction, pixels."""
    held_out_before_px: float | None
    """Mean miss of those rays only that the correction was not fitted to, before; None where nothing was fitted."""
    held_out_after_px: float | None
    """Mean miss of those rays with the correction."""


@dataclass(frozen=True)
class VehicleSize:
    """How long, wide and high the vehicle is; outer mirrors are often missing from the width."""

    size_m: list[float]
    """Length, width, height, metres."""
    uncertainty_m: list[float]
    """Their expected errors, metres."""


@dataclass(frozen=True)
class WorkingBox:
    """The box the prior looked for the vehicle in, which is larger than the vehicle."""

    source: Literal["given", "estimated"]
    """Whether the caller's size bounds it, or the silhouettes alone."""
    size_m: list[float]
    """Length, width, height, metres."""
    low_m: list[float]
    """Lowest corner, metres."""
    contradicted_m: float
    """By how much the caller's size and the silhouettes contradict each other, metres; 0 where they agree."""


@dataclass(frozen=True)
class PointFit:
    """What became of the points measured on the vehicle."""

    used: int
    """Points the surface was moved to."""
    outside: int
    """Points outside the silhouettes' hull, which the vehicle cannot reach."""
    before_m: float
    """Median distance of the used points to the surface before, metres."""
    after_m: float
    """Median distance of the used points to the surface after, metres."""


@dataclass(frozen=True)
class PhotoFit:
    """What the photographs said of the prior's surface."""

    patches: int
    """Patches that were looked for in other views."""
    found: int
    """Patches that were found."""
    before_m: float
    """Median distance of the found places to the surface before, metres."""
    after_m: float
    """Median distance of the found places to the surface after, metres."""


@dataclass(frozen=True)
class Filled:
    """How the prior closed what its surface left open of the masks: the largest share of a mask, 0 to 1."""

    uncovered_before: float
    """Left open by the surface as it was."""
    uncovered_after: float
    """Left open after it was bent."""


@dataclass(frozen=True)
class Network:
    """What the network said whose depth was taken."""

    prior: str
    """What the network calls itself."""
    size: list[int]
    """Width and height of the pictures it was shown."""
    ray_degrees: float | None
    """Median angle between its rays and those of the intrinsics, degrees."""
    scale: float
    """Metres per unit of its depth, as it says itself; 1 where it says nothing."""
    poses: dict[str, Any] | None
    """Its cameras against the caller's; None if it gives none or no two cameras are apart."""
    rescaled: bool
    """Whether depth was multiplied by the scale of the poses as well."""
    views: dict[str, Any] | None
    """Its views against each other; None where no two see the same place."""
    without_depth: int
    """Vehicle pixels without depth: cut off, or of which it was not sure."""
    warnings: list[str]
    """What makes the result doubtful."""


@dataclass(frozen=True)
class Machine:
    """How fast the machine was found to be, as multiples of the reference machine."""

    serial: float
    """One thread."""
    parallel: float
    """All threads of the call together."""


@dataclass(frozen=True)
class Chosen:
    """The options that a budget decides on."""

    prior: Literal["auto", "given", "hull", "shape", "onnx"]
    """Depth source."""
    resolution: float
    """Share of the views' width and height."""
    max_views: int | None
    """Most views."""
    calibrate: Literal["auto", "off"]
    """Correction of the cameras."""
    photo: bool
    """Photo-consistency."""
    relight: Literal["auto", "never"]
    """Light of the unseen side."""
    check: bool
    """Error on the input views."""


@dataclass(frozen=True)
class Plan:
    """How the options were chosen where the caller gave a budget."""

    budget_s: float
    """The caller's, seconds."""
    predicted_s: float
    """The time predicted for what was chosen, seconds."""
    fits: bool
    """Whether that leaves enough room in the budget; if not, the fastest settings were chosen."""
    took_s: float
    """What the call took, seconds, without an optimisation that was asked for in addition."""
    kept: bool
    """Whether that is within the budget."""
    machine: Machine
    """How fast this machine was found to be."""
    chosen: Chosen
    """What was chosen."""


@dataclass(frozen=True)
class Symmetry:
    """How the unseen side was completed."""

    mode: Literal["auto", "always", "never", "flip"]
    """The rule."""
    reference_side: Literal["left", "right"]
    """The side with more Gaussians."""
    cloned: int
    """Gaussians added as mirror images."""
    replaced: int
    """Observed Gaussians given up for mirror images."""
    not_needed: int
    """Gaussians not cloned because their mirrored place was observed too."""


@dataclass(frozen=True)
class Relighting:
    """The light of the unseen side."""

    left_over_right: float
    """Light on a surface facing left over light on one facing right, logarithm."""
    sun: list[float]
    """Mean direction towards the sun, vehicle frame; shorter than 1 where it is not certain."""
    clones: int
    """Clones that were corrected."""


@dataclass(frozen=True)
class HeldOut:
    """The view that took no part in a refinement."""

    view: str
    """Its name."""
    psnr_db: list[float]
    """Its PSNR before and after, dB."""


@dataclass(frozen=True)
class Refinement:
    """What an optimisation did."""

    iterations: int
    """Steps that were planned."""
    made: int
    """Steps that were made."""
    kept: int
    """Steps that the result has seen; 0 if nothing was better than the beginning."""
    stop: Literal["done", "held_out", "diverged", "unseen"]
    """Why it ended."""
    loss: list[float]
    """Loss of the first step, and the mean of the last round over the views."""
    psnr_db: list[float]
    """Mean PSNR of the views that took part before and after, dB."""
    held_out: HeldOut | None
    """The view that took no part, where one was held out."""
    exposures: list[list[float]]
    """Factors of the views' exposures, RGB, in the order of the views."""
    densified: dict[str, Any] | None
    """What density control did, where it was wanted."""
    drawn_by: str
    """Who drew, and why."""


@dataclass(frozen=True)
class InputError:
    """The model rendered back into the input views, against the masked photographs on white."""

    psnr_db: float
    """Mean over the used views, full frame, dB."""
    silhouette_iou: float
    """Mean over the used views: alpha of half and more against the mask."""
    mask_covered: float
    """The least over the used views: the part of the mask that is drawn with alpha of half and more, 0 to 1."""


@dataclass(frozen=True)
class InputView:
    """The model rendered back into one input view."""

    name: str
    """The view's name."""
    psnr_db: float
    """Full frame, dB, drawn by the camera that was used: the calibration's, where it moved the camera."""
    silhouette_iou: float
    """Alpha of half and more against the mask."""
    mask_covered: float
    """The part of the mask that is drawn with alpha of half and more, 0 to 1."""
    by_given_camera: InputError
    """The same drawn by the caller's own camera."""


@dataclass(frozen=True)
class Reason:
    """Why the verdict is not good."""

    code: str
    """What it is about."""
    severity: Literal["doubtful", "bad"]
    """How much it weighs."""
    view: str | None
    """The view's name, where one is concerned."""
    found: str
    """What was found."""
    expected: str
    """What is expected."""
    cause: str
    """The likely cause."""
    remedy: str
    """The way out."""


@dataclass(frozen=True)
class Report:
    """What a reconstruction did, how long it took, what was left out and why.

    >>> report = Report.of(made.report)
    >>> report.input_error.psnr_db > 20
    True
    """

    version: str
    """Version of the library."""
    prior: str
    """Depth source that was used; none for a baseline."""
    head: str
    """Gaussian head that was used; of a baseline its name."""
    stages: list[Stage]
    """Wall time of each stage, in order."""
    total_ms: float
    """Wall time of the whole call, milliseconds."""
    peak_rss_bytes: int | None
    """Highest resident memory of the process so far, bytes; None where the system does not tell."""
    threads: int
    """Worker threads."""
    gaussians: int
    """Gaussians in the result."""
    sh_degree: int
    """Degree of the result's spherical harmonics."""
    extent_m: list[list[float]] | None
    """Lowest and highest centre in the caller's vehicle frame, metres."""
    views_used: list[str]
    """Names of the views that were used."""
    calibration: Calibration | None
    """How the cameras were corrected; None if that was switched off or these views cannot be calibrated."""
    vehicle: VehicleSize | None
    """How long, wide and high the vehicle is; None for a baseline."""
    working_box: WorkingBox | None
    """The box the prior looked for the vehicle in, in the corrected frame."""
    cloud: PointFit | None
    """What the prior made of points measured on the vehicle."""
    photo: PhotoFit | None
    """What the photographs said of the prior's surface, where they were asked."""
    masks: Filled | None
    """How the prior closed what its surface left open of the masks."""
    network: Network | None
    """What the network said whose depth was taken."""
    plan: Plan | None
    """How the options were chosen, where the caller gave a budget."""
    left_out: list[LeftOut]
    """Work this scene did not need."""
    warnings: list[str]
    """What is legal but looks like a mistake, or did not turn out as it was asked for."""
    symmetry: Symmetry
    """How the unseen side was completed."""
    relight: Relighting | None
    """The light of the unseen side, where it was estimated."""
    refinement: Refinement | None
    """What the optimisation did, where it was asked for."""
    input_error: InputError | None
    """Error on the input views as drawn by the cameras that were used, unless the check was switched off."""
    input_error_by_given_cameras: InputError | None
    """The same as drawn by the caller's own cameras."""
    input_views: list[InputView]
    """The errors in each view; empty if the check was switched off."""
    verdict: Literal["good", "unchecked", "doubtful", "bad"]
    """Whether the result is to be believed."""
    verdict_reasons: list[Reason]
    """Why it is not good."""
    evidence: dict[str, Any]
    """The numbers that the verdict goes by."""
    settings: dict[str, Any]
    """The options of the call; where it had a budget, those that were chosen."""

    @classmethod
    def of(cls, report: Mapping[str, Any]) -> Report:
        """The report that ``reconstruct`` returns or the program writes, without what only a newer library says."""
        return _made(cls, report)


def _made(kind: type[T], fields: Mapping[str, Any]) -> T:
    hints = get_type_hints(kind)
    return kind(**{f.name: _value(hints[f.name], fields[f.name]) for f in dataclasses.fields(kind)})  # type: ignore[arg-type]


def _value(kind: Any, value: Any) -> Any:
    if dataclasses.is_dataclass(kind):
        return _made(kind, value)  # type: ignore[arg-type]
    if _is_union(kind):
        return None if value is None else _value(_without_none(kind), value)
    if get_origin(kind) is list:
        return [_value(get_args(kind)[0], entry) for entry in value]
    return float(value) if kind is float else value


def schema() -> dict[str, Any]:
    """The JSON schema of a report, draft 2020-12."""
    definitions: dict[str, Any] = {}
    whole = _schema_of_class(Report, definitions)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Report of a reconstruction",
        **whole,
        "$defs": dict(sorted(definitions.items())),
    }


def _schema_of_class(kind: type[Any], definitions: dict[str, Any]) -> dict[str, Any]:
    hints, texts = get_type_hints(kind), field_texts(kind)
    names = [field.name for field in dataclasses.fields(kind)]
    return {
        "description": (kind.__doc__ or "").split("\n\n")[0],
        "type": "object",
        "properties": {
            name: {"description": " ".join(texts[name].split()), **_schema_of(hints[name], definitions)}
            for name in names
        },
        "required": names,
        "additionalProperties": False,
    }


def _schema_of(kind: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    simple = {str: "string", int: "integer", float: "number", bool: "boolean"}
    if kind in simple:
        return {"type": simple[kind]}
    if _is_union(kind):
        return {"anyOf": [_schema_of(_without_none(kind), definitions), {"type": "null"}]}
    if get_origin(kind) is Literal:
        return {"enum": list(get_args(kind))}
    if get_origin(kind) is list:
        return {"type": "array", "items": _schema_of(get_args(kind)[0], definitions)}
    if get_origin(kind) is dict:
        return {"type": "object"}
    if kind.__name__ not in definitions:
        definitions[kind.__name__] = {}
        definitions[kind.__name__] = _schema_of_class(kind, definitions)
    return {"$ref": f"#/$defs/{kind.__name__}"}


def _is_union(kind: Any) -> bool:
    return get_origin(kind) in (Union, types.UnionType)


def _without_none(kind: Any) -> Any:
    (one,) = (part for part in get_args(kind) if part is not type(None))
    return one
