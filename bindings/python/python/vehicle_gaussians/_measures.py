"""Results of measurements."""

from __future__ import annotations

from typing import NamedTuple

from ._documented import documented


@documented
class PictureErrors(NamedTuple):
    """The difference of two pictures; None where a measure is not defined."""

    psnr_db: float
    """Peak signal-to-noise ratio, dB; infinite for equal pictures."""
    ssim: float | None
    """Structural similarity, at most 1; None for a picture smaller than 11x11."""
    lpips: float | None
    """Perceptual distance LPIPS; None without a model for it, and for a picture smaller than 64x64."""


@documented
class ViewErrors(NamedTuple):
    """The error of a model in one photograph; None where a measure is not defined."""

    psnr_db: float
    """Peak signal-to-noise ratio over the full frame, dB; infinite for equal pictures."""
    psnr_box_db: float | None
    """Peak signal-to-noise ratio inside the bounding box of the mask, dB; None where the mask is empty."""
    ssim: float | None
    """Structural similarity over the full frame, at most 1; None for a picture smaller than 11x11."""
    lpips: float | None
    """Perceptual distance LPIPS; None without a model for it, and for a picture smaller than 64x64."""
    silhouette_iou: float
    """Intersection over union of the mask and the pixels that the model covers by half or more, 0 to 1."""
    depth_mae_m: float | None
    """Mean absolute difference of depth where the view has depth and the model covers the pixel by half or more,
    metres; None where that is nowhere."""
    depth_p90_m: float | None
    """90th percentile of that difference, metres."""


@documented
class SurfaceErrors(NamedTuple):
    """The error of a model's surface against a scan."""

    accuracy_m: float
    """Mean distance from the model's surface to the scan, metres; distances above 0.5 m count as 0.5 m."""
    completeness_m: float
    """Mean distance from the scan to the model's surface, metres, likewise."""
    chamfer_m: float
    """Mean of the two."""
    precision: float
    """Share of the model's surface that is nearer to the scan than f_score."""
    recall: float
    """Share of the scan that is nearer to the model's surface than f_score."""
    f_score: float
    """Harmonic mean of the two."""
    length_error_percent: float
    """How much longer (x) the model is than the scan, percent; negative: shorter."""
    width_error_percent: float
    """The same of the width (y)."""
    height_error_percent: float
    """The same of the height (z)."""
