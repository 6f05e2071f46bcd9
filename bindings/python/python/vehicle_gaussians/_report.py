"""The report of a reconstruction with names and types, and its JSON schema.

``docs/report.schema.json`` contains the result of ``schema()``; a test validates real reports against it.
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
    """Work that was left out because the scene did not need it."""

    what: str
    """Kind of work: views, calibration, pixels, SH bands, clones."""
    why: str
    """Reason why it is not needed."""
    count: int
    """Number of items."""


@dataclass(frozen=True)
class ViewCalibration:
    """Correction of a view's camera, relative to the vehicle's centre, in addition to the motion of the plane."""

    name: str
    """The view's name."""
    pixels: float
    """Motion of the image of the vehicle's centre, pixels of the undistorted view."""
    degrees: float
    """Rotation, degrees."""
    metres: float
    """Translation of the vehicle's centre, metres."""
    vehicle_from_camera: list[float]
    """The corrected camera in the caller's vehicle frame, 12 numbers, row-major [R | t]."""
    ignored: bool
    """Whether its silhouette was left out of the estimate and of the hull."""


@dataclass(frozen=True)
class Calibration:
    """Result of the calibration; for a refused correction, the refused values."""

    verdict: Literal["not-needed", "accepted", "refused"]
    """Whether the correction was needed and accepted."""
    why: str
    """Reason of the verdict."""
    yaw_degrees: float
    """Rotation about z that brings the true plane of symmetry onto y = 0, degrees."""
    roll_degrees: float
    """Rotation about x that brings the true plane of symmetry onto y = 0, degrees."""
    lateral_m: float
    """Shift along y, at the vehicle's centre, that brings the true plane of symmetry onto y = 0, metres."""
    corrected_from_vehicle: list[float]
    """The whole motion of the plane, 12 numbers, row-major [R | t]."""
    views: list[ViewCalibration]
    """Correction of each used view's camera."""
    coverage_before: float
    """Fraction of the masks' pixels whose rays meet the hull of all other and all mirrored views, before."""
    coverage_after: float
    """Fraction of the masks' pixels whose rays meet the hull of the others, with the correction."""
    edge_error_before_px: float
    """Mean distance of rays on the silhouettes' edges from the hull, before, pixels; each counts at most 20."""
    edge_error_after_px: float
    """Mean distance of rays on the silhouettes' edges from the hull, with the correction, pixels."""
    held_out_before_px: float | None
    """Mean distance of the rays that the correction was not fitted to, before, pixels; None if nothing was fitted."""
    held_out_after_px: float | None
    """Mean distance of those rays with the correction, pixels."""


@dataclass(frozen=True)
class VehicleSize:
    """Size of the vehicle; outer mirrors are often missing from the width."""

    size_m: list[float]
    """Length, width, height, metres."""
    uncertainty_m: list[float]
    """Their expected errors, metres."""


@dataclass(frozen=True)
class WorkingBox:
    """The prior's search box, which is larger than the vehicle."""

    source: Literal["given", "estimated"]
    """Whether the caller's size bounds it, or only the silhouettes."""
    size_m: list[float]
    """Length, width, height, metres."""
    low_m: list[float]
    """Lowest corner, metres."""
    contradicted_m: float
    """Contradiction between the caller's size and the silhouettes, metres; 0 if they agree."""


@dataclass(frozen=True)
class PointFit:
    """Fit of the surface to points measured on the vehicle."""

    used: int
    """Points that the surface was fitted to."""
    outside: int
    """Points outside the silhouettes' hull, which the vehicle cannot reach."""
    before_m: float
    """Median distance of the used points to the surface before, metres."""
    after_m: float
    """Median distance of the used points to the surface after, metres."""


@dataclass(frozen=True)
class PhotoFit:
    """Correction of the prior's surface by photo-consistency."""

    patches: int
    """Patches that were searched in other views."""
    found: int
    """Patches that were found."""
    before_m: float
    """Median distance of the found patches from the surface before, metres."""
    after_m: float
    """Median distance of the found patches from the surface after, metres."""


@dataclass(frozen=True)
class Filled:
    """Extension of the prior's surface to cover the masks: the largest uncovered fraction of a mask, 0 to 1."""

    uncovered_before: float
    """Uncovered fraction before."""
    uncovered_after: float
    """Uncovered fraction after."""


@dataclass(frozen=True)
class Network:
    """Report of the network that estimated the depth."""

    prior: str
    """Name of the network."""
    size: list[int]
    """Width and height of its input pictures."""
    ray_degrees: float | None
    """Median angle between its rays and those of the intrinsics, degrees."""
    scale: float
    """Metres per unit of its depth, according to the network; 1 if it has no such output."""
    poses: dict[str, Any] | None
    """Its cameras against the caller's; None if it has none or all cameras are at one point."""
    rescaled: bool
    """Whether depth was also multiplied by the scale of the poses."""
    views: dict[str, Any] | None
    """Consistency of its views; None where no two views overlap."""
    without_depth: int
    """Vehicle pixels without depth: cropped, or with low confidence."""
    warnings: list[str]
    """Reasons to doubt the result."""


@dataclass(frozen=True)
class Machine:
    """Measured speed of the machine, as multiples of the reference machine."""

    serial: float
    """Speed of one thread."""
    parallel: float
    """Speed of all threads of the call together."""


@dataclass(frozen=True)
class Chosen:
    """The options that a budget decides on."""

    prior: Literal["auto", "given", "hull", "shape", "onnx"]
    """Depth source."""
    resolution: float
    """Fraction of the views' width and height."""
    max_views: int | None
    """Largest number of views."""
    calibrate: Literal["auto", "off"]
    """Correction of the cameras."""
    photo: bool
    """Correction of the surface by photo-consistency."""
    relight: Literal["auto", "never"]
    """Relighting of the unseen side."""
    check: bool
    """Check of the error in the input views."""


@dataclass(frozen=True)
class Plan:
    """Choice of the options for the caller's budget."""

    budget_s: float
    """The caller's budget, seconds."""
    predicted_s: float
    """The time predicted for the chosen options, seconds."""
    fits: bool
    """Whether the predicted time fits the budget; if not, the fastest settings were chosen."""
    took_s: float
    """Time of the call, seconds, without an additional optimisation."""
    kept: bool
    """Whether the time of the call is within the budget."""
    machine: Machine
    """Measured speed of this machine."""
    chosen: Chosen
    """The chosen options."""


@dataclass(frozen=True)
class Symmetry:
    """Completion of the unseen side."""

    mode: Literal["auto", "always", "never", "flip"]
    """The rule."""
    reference_side: Literal["left", "right"]
    """The side with more Gaussians."""
    cloned: int
    """Gaussians added as mirror images."""
    replaced: int
    """Observed Gaussians that were replaced by mirror images."""
    not_needed: int
    """Gaussians that were not cloned because their mirrored position was also observed."""


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
    """The view that was held out of a refinement."""

    view: str
    """Its name."""
    psnr_db: list[float]
    """Its PSNR before and after, dB."""


@dataclass(frozen=True)
class Refinement:
    """Report of an optimisation."""

    iterations: int
    """Steps that were planned."""
    made: int
    """Steps that were made."""
    kept: int
    """Steps of the returned state; 0 if no state was better than the first."""
    stop: Literal["done", "held_out", "diverged", "unseen"]
    """Reason for stopping."""
    loss: list[float]
    """Loss of the first step, and the mean of the last round over the views."""
    psnr_db: list[float]
    """Mean PSNR of the optimised views before and after, dB."""
    held_out: HeldOut | None
    """The held-out view, if any."""
    exposures: list[list[float]]
    """Factors of the views' exposures, RGB, in the order of the views."""
    densified: dict[str, Any] | None
    """Report of the density control, if requested."""
    drawn_by: str
    """The renderer that was chosen, and why."""


@dataclass(frozen=True)
class InputError:
    """The model rendered back into the input views, against the masked photographs on white."""

    psnr_db: float
    """Mean over the used views, full frame, dB."""
    silhouette_iou: float
    """Mean over the used views: pixels with alpha of at least half against the mask."""
    mask_covered: float
    """Smallest over the used views: fraction of the mask that is drawn with alpha of at least half, 0 to 1."""


@dataclass(frozen=True)
class InputView:
    """The model rendered back into one input view."""

    name: str
    """The view's name."""
    psnr_db: float
    """Full frame, dB, rendered from the camera that was used: the corrected one, if the calibration moved it."""
    silhouette_iou: float
    """Pixels with alpha of at least half against the mask."""
    mask_covered: float
    """Fraction of the mask that is drawn with alpha of at least half, 0 to 1."""
    by_given_camera: InputError
    """Errors when rendered from the caller's own camera."""


@dataclass(frozen=True)
class Reason:
    """A reason why the verdict is not good."""

    code: str
    """Identifier of the reason."""
    severity: Literal["doubtful", "bad"]
    """Severity of the reason."""
    view: str | None
    """Name of the view, if it concerns one."""
    found: str
    """The value that was found."""
    expected: str
    """The expected value."""
    cause: str
    """Likely cause."""
    remedy: str
    """Suggested remedy."""


@dataclass(frozen=True)
class Report:
    """Report of a reconstruction: what was done, how long it took, what was left out and why.

    >>> report = Report.of(made.report)
    >>> report.input_error.psnr_db > 20
    True
    """

    version: str
    """Version of the library."""
    prior: str
    """Depth source that was used; none for a baseline."""
    head: str
    """Gaussian head that was used; for a baseline, its name."""
    stages: list[Stage]
    """Wall time of each stage, in order."""
    total_ms: float
    """Wall time of the whole call, milliseconds."""
    peak_rss_bytes: int | None
    """Peak resident memory of the process so far, bytes; None where the system does not report it."""
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
    """Correction of the cameras; None if it was switched off or these views cannot be calibrated."""
    vehicle: VehicleSize | None
    """Size of the vehicle; None for a baseline."""
    working_box: WorkingBox | None
    """The prior's search box, in the corrected frame."""
    cloud: PointFit | None
    """Fit of the prior's surface to points measured on the vehicle."""
    photo: PhotoFit | None
    """Correction of the prior's surface by photo-consistency, if any."""
    masks: Filled | None
    """Extension of the prior's surface to cover the masks."""
    network: Network | None
    """Report of the network that estimated the depth."""
    plan: Plan | None
    """Choice of the options, if the caller gave a budget."""
    left_out: list[LeftOut]
    """Work that this scene did not need."""
    warnings: list[str]
    """Warnings about legal input that looks like a mistake, or a request that could not be met."""
    symmetry: Symmetry
    """Completion of the unseen side."""
    relight: Relighting | None
    """The light of the unseen side, if it was estimated."""
    refinement: Refinement | None
    """Report of the optimisation, if requested."""
    input_error: InputError | None
    """Error in the input views, rendered from the cameras that were used; None if the check was switched off."""
    input_error_by_given_cameras: InputError | None
    """Error in the input views, rendered from the caller's own cameras."""
    input_views: list[InputView]
    """Errors in each view; empty if the check was switched off."""
    verdict: Literal["good", "unchecked", "doubtful", "bad"]
    """Whether the result is reliable."""
    verdict_reasons: list[Reason]
    """Reasons why the verdict is not good."""
    evidence: dict[str, Any]
    """Numbers on which the verdict is based."""
    settings: dict[str, Any]
    """Options of the call; with a budget, the options that were chosen."""

    @classmethod
    def of(cls, report: Mapping[str, Any]) -> Report:
        """Parses a report of ``reconstruct`` or of the program; fields of newer versions are ignored."""
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
