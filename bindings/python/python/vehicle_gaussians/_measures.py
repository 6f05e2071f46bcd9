"""What measures come back as."""

from __future__ import annotations

from typing import NamedTuple


class PictureErrors(NamedTuple):
    """The difference of two pictures; None where a measure does not exist."""

    #: Peak signal-to-noise ratio, dB; infinite for equal pictures.
    psnr_db: float
    #: Structural similarity, at most 1; None for a picture smaller than 11x11.
    ssim: float | None
    #: None without a model that measures it, and for a picture smaller than 64x64.
    lpips: float | None


class ViewErrors(NamedTuple):
    """The error of a model in one photograph; None where a measure does not exist."""

    #: Peak signal-to-noise ratio over the full frame, dB.
    psnr_db: float
    #: The same inside the bounding box of the mask; None where the mask is empty.
    psnr_box_db: float | None
    #: Structural similarity over the full frame, at most 1; None for a picture smaller than 11x11.
    ssim: float | None
    #: None without a model that measures it, and for a picture smaller than 64x64.
    lpips: float | None
    #: Intersection over union of the mask and the pixels that the model covers by half or more.
    silhouette_iou: float
    #: Mean absolute difference of depth, metres; None without depth.
    depth_mae_m: float | None
    #: 90th percentile of that difference, metres.
    depth_p90_m: float | None


class SurfaceErrors(NamedTuple):
    """The error of a model's surface against a scan."""

    #: Mean distance from the model's surface to the scan, metres; distances above 0.5 m count as 0.5 m.
    accuracy_m: float
    #: Mean distance from the scan to the model's surface, metres, likewise.
    completeness_m: float
    #: Mean of the two.
    chamfer_m: float
    #: Share of the model's surface that is nearer to the scan than the threshold.
    precision: float
    #: Share of the scan that is nearer to the model's surface than the threshold.
    recall: float
    #: Harmonic mean of the two.
    f_score: float
    #: How much longer (x) the model is than the scan, percent; negative: shorter.
    length_error_percent: float
    #: The same of the width (y).
    width_error_percent: float
    #: The same of the height (z).
    height_error_percent: float
