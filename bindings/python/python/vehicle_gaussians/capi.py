"""The library through ctypes: the C interface of ``include/vg.h``, and thin functions over it.

For environments that load shared libraries but no extension modules, for other versions of the library, and as the
model of a binding in any language. Results are equal to those of the package, byte for byte.

>>> from vehicle_gaussians import capi
>>> scene = capi.open_scene("my-car")
>>> car = capi.reconstruct(scene.images, scene.masks, scene.cameras, scene.depths).gaussians
>>> car.save_ply("car.ply")
>>> picture = car.render(scene.cameras[0])

The package's own libvg is used, or the one that the environment variable VG_LIBRARY names. All functions of the header
are declared on ``library``; structures, fields and enumerators have the header's names.
"""

from __future__ import annotations

import contextlib
import ctypes as ct
import enum
import json
import os
import re
import signal
import sys
import threading
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import FrameType
from typing import Any, Literal, NamedTuple, NoReturn, Protocol, TypeAlias, overload

import numpy as np
import numpy.typing as npt

from . import _types
from ._alignment import Alignment
from ._arguments import bad_type, bad_value, doubles, floats, listed, pose, real, whole
from ._documented import documented
from ._equal import equal_by_value
from ._errors import ArgumentTypeError, Status, VgError
from ._evaluate import ViewScore, rows
from ._frozen import FrozenArray
from ._gradients import Gradients, Planes
from ._measures import PictureErrors, SurfaceErrors, ViewErrors
from ._pictures import in_range
from ._progress import Progress, wrapped
from ._select import indices
from ._warn import reconstructed, warn

#: The binary interface that this module is written for.
ABI_VERSION = 0


class Format(enum.IntEnum):
    """vg_format"""

    RGB8, BGR8, RGBA8, BGRA8, GRAY8, RGBA32F, DEPTH32F = range(1, 8)


class CameraModel(enum.IntEnum):
    """vg_camera_model"""

    SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, OPENCV_FISHEYE, FULL_OPENCV = range(7)


class Prior(enum.IntEnum):
    """vg_prior"""

    AUTO, GIVEN, HULL, ONNX, SHAPE = range(5)


class Provider(enum.IntEnum):
    """vg_provider"""

    CPU, CUDA = range(2)


class Prepack(enum.IntEnum):
    """vg_prepack"""

    AUTO, ALWAYS, NEVER = range(3)


class Calibrate(enum.IntEnum):
    """vg_calibrate"""

    AUTO, OFF = range(2)


class Symmetry(enum.IntEnum):
    """vg_symmetry"""

    AUTO, ALWAYS, NEVER, FLIP = range(4)


class Heading(enum.IntEnum):
    """vg_heading"""

    AUTO, FORWARD, BACKWARD = range(3)


class Relight(enum.IntEnum):
    """vg_relight"""

    AUTO, NEVER = range(2)


class Keep(enum.IntFlag):
    """vg_keep"""

    DUPLICATE_VIEWS, OVERLAP, SILHOUETTE_EDGE, FLOATERS, SH_BANDS = 1, 2, 4, 8, 16


class LogLevel(enum.IntEnum):
    """vg_log_level"""

    WARNING, INFO, DEBUG = range(1, 4)


class Calibration(enum.IntEnum):
    """vg_calibration"""

    NONE, NOT_NEEDED, ACCEPTED, REFUSED = range(4)


class Verdict(enum.IntEnum):
    """vg_verdict"""

    GOOD, UNCHECKED, DOUBTFUL, BAD = range(4)


class Backend(enum.IntEnum):
    """vg_backend"""

    AUTO, CPU, GPU = range(3)


class Background(enum.IntEnum):
    """vg_background"""

    COLOR, TRANSPARENT = range(2)


class Alpha(enum.IntEnum):
    """vg_alpha"""

    STRAIGHT, PREMULTIPLIED = range(2)


class DepthMode(enum.IntEnum):
    """vg_depth_mode"""

    EXPECTED, ACCUMULATED = range(2)


class RefineStop(enum.IntEnum):
    """vg_refine_stop"""

    DONE, HELD_OUT, DIVERGED, UNSEEN = range(4)


#: vg_progress_fn
ProgressFn = ct.CFUNCTYPE(ct.c_int32, ct.c_char_p, ct.c_double, ct.c_void_p)
#: vg_loss_fn
LossFn = ct.CFUNCTYPE(ct.c_int32, ct.c_void_p)
#: vg_log_fn
LogFn = ct.CFUNCTYPE(None, ct.c_int32, ct.c_char_p, ct.c_void_p)


class vg_context_options(ct.Structure):
    _fields_ = (("struct_size", ct.c_size_t), ("threads", ct.c_uint32), ("flags", ct.c_uint32))


class vg_camera(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("width", ct.c_uint32),
        ("height", ct.c_uint32),
        ("model", ct.c_int32),
        ("flags", ct.c_uint32),
        ("params", ct.c_double * 16),
        ("vehicle_from_camera", ct.c_double * 12),
        ("reserved", ct.c_uint64 * 4),
    )

    def __eq__(self, other: object) -> bool:
        return bytes(self) == bytes(other) if isinstance(other, vg_camera) else NotImplemented


class vg_image(ct.Structure):
    _fields_ = (
        ("data", ct.c_void_p),
        ("row_stride", ct.c_size_t),
        ("width", ct.c_uint32),
        ("height", ct.c_uint32),
        ("format", ct.c_int32),
        ("flags", ct.c_uint32),
    )


class vg_view(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("name", ct.c_char_p),
        ("camera", vg_camera),
        ("image", vg_image),
        ("mask", vg_image),
        ("depth", vg_image),
    )


class vg_model_options(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("runtime", ct.c_char_p),
        ("provider", ct.c_int32),
        ("fall_back", ct.c_int32),
        ("threads", ct.c_uint32),
        ("prepack", ct.c_int32),
        ("arena", ct.c_int32),
        ("flags", ct.c_uint32),
    )


class vg_options(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("context", ct.c_void_p),
        ("prior", ct.c_int32),
        ("symmetry", ct.c_int32),
        ("sh_degree", ct.c_int32),
        ("keep", ct.c_uint32),
        ("check", ct.c_int32),
        ("points", ct.c_int32),
        ("vehicle_size", ct.c_double * 3),
        ("progress", ProgressFn),
        ("progress_user", ct.c_void_p),
        ("log", LogFn),
        ("log_user", ct.c_void_p),
        ("calibrate", ct.c_int32),
        ("relight", ct.c_int32),
        ("photo", ct.c_int32),
        ("flags", ct.c_uint32),
        ("budget_s", ct.c_double),
        ("cloud", ct.c_void_p),
        ("cloud_count", ct.c_size_t),
        ("resolution", ct.c_double),
        ("max_views", ct.c_size_t),
        ("prior_model", ct.c_void_p),
        ("head_model", ct.c_void_p),
        ("refine_seconds", ct.c_double),
        ("refine_iterations", ct.c_uint32),
        ("refine_hold_out", ct.c_int32),
        ("refine_backend", ct.c_int32),
        ("refine_flags", ct.c_uint32),
        ("vehicle_center", ct.c_double * 3),
        ("vehicle_yaw", ct.c_double),
        ("has_vehicle_place", ct.c_int32),
        ("vehicle_flags", ct.c_uint32),
        ("progress_overall", ct.POINTER(ct.c_double)),
        ("max_gaussians", ct.c_size_t),
    )


class vg_report_figures(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("gaussian_count", ct.c_uint64),
        ("mirrored_count", ct.c_uint64),
        ("views_used", ct.c_uint32),
        ("threads", ct.c_uint32),
        ("prior", ct.c_int32),
        ("sh_degree", ct.c_int32),
        ("total_ms", ct.c_double),
        ("peak_rss_bytes", ct.c_uint64),
        ("has_input_error", ct.c_int32),
        ("has_box", ct.c_int32),
        ("input_psnr_db", ct.c_double),
        ("input_silhouette_iou", ct.c_double),
        ("box_size", ct.c_double * 3),
        ("extent_low", ct.c_double * 3),
        ("extent_high", ct.c_double * 3),
        ("relit_count", ct.c_uint64),
        ("cloud_used", ct.c_uint64),
        ("photo_found", ct.c_uint64),
        ("calibration", ct.c_int32),
        ("has_uncovered", ct.c_int32),
        ("calibration_yaw_degrees", ct.c_double),
        ("calibration_lateral_m", ct.c_double),
        ("uncovered_before", ct.c_double),
        ("uncovered_after", ct.c_double),
        ("refine_iterations", ct.c_uint32),
        ("refine_kept", ct.c_uint32),
        ("vehicle_size", ct.c_double * 3),
        ("vehicle_size_uncertainty", ct.c_double * 3),
        ("has_vehicle_size", ct.c_int32),
        ("budget_kept", ct.c_int32),
        ("input_mask_covered", ct.c_double),
        ("input_given_psnr_db", ct.c_double),
        ("input_given_silhouette_iou", ct.c_double),
        ("input_given_mask_covered", ct.c_double),
        ("verdict", ct.c_int32),
        ("reason_count", ct.c_uint32),
    )


class vg_gaussian_arrays(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("count", ct.c_size_t),
        ("positions", ct.c_void_p),
        ("scales", ct.c_void_p),
        ("rotations", ct.c_void_p),
        ("opacities", ct.c_void_p),
        ("sh", ct.c_void_p),
        ("sh_degree", ct.c_int32),
        ("flags", ct.c_uint32),
    )


class vg_render_options(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("context", ct.c_void_p),
        ("backend", ct.c_int32),
        ("background", ct.c_int32),
        ("background_color", ct.c_float * 3),
        ("alpha", ct.c_int32),
        ("depth_mode", ct.c_int32),
        ("sh_degree", ct.c_int32),
        ("antialiased", ct.c_int32),
        ("blur", ct.c_float),
        ("near_plane", ct.c_float),
        ("far_plane", ct.c_float),
        ("max_alpha", ct.c_float),
        ("flags", ct.c_uint32),
        ("progress", ProgressFn),
        ("progress_user", ct.c_void_p),
    )


class vg_renderer_options(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("context", ct.c_void_p),
        ("backend", ct.c_int32),
        ("flags", ct.c_uint32),
    )


class vg_image_target(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("width", ct.c_uint32),
        ("height", ct.c_uint32),
        ("color", ct.c_void_p),
        ("color_row_stride", ct.c_size_t),
        ("depth", ct.c_void_p),
        ("depth_row_stride", ct.c_size_t),
        ("color_format", ct.c_int32),
        ("flags", ct.c_uint32),
        ("alpha", ct.c_void_p),
        ("alpha_row_stride", ct.c_size_t),
    )


class vg_image_gradient(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("width", ct.c_uint32),
        ("height", ct.c_uint32),
        ("color", ct.c_void_p),
        ("color_row_stride", ct.c_size_t),
        ("alpha", ct.c_void_p),
        ("alpha_row_stride", ct.c_size_t),
        ("depth", ct.c_void_p),
        ("depth_row_stride", ct.c_size_t),
        ("loss", LossFn),
        ("loss_user", ct.c_void_p),
        ("flags", ct.c_uint64),
    )


class vg_gradients(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("count", ct.c_size_t),
        ("positions", ct.c_void_p),
        ("scales", ct.c_void_p),
        ("rotations", ct.c_void_p),
        ("opacities", ct.c_void_p),
        ("sh", ct.c_void_p),
        ("background", ct.c_void_p),
        ("pose", ct.c_void_p),
        ("view_matrix", ct.c_void_p),
        ("sh_degree", ct.c_int32),
        ("flags", ct.c_uint32),
    )


class vg_refine_options(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("context", ct.c_void_p),
        ("seconds", ct.c_double),
        ("iterations", ct.c_uint32),
        ("hold_out", ct.c_int32),
        ("densify", ct.c_int32),
        ("backend", ct.c_int32),
        ("progress", ProgressFn),
        ("progress_user", ct.c_void_p),
        ("flags", ct.c_uint64),
    )


class vg_refinement(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("iterations", ct.c_uint32),
        ("made", ct.c_uint32),
        ("kept", ct.c_uint32),
        ("stop", ct.c_int32),
        ("psnr_before_db", ct.c_double),
        ("psnr_after_db", ct.c_double),
        ("held_out_before_db", ct.c_double),
        ("held_out_after_db", ct.c_double),
    )


class vg_segment_options(ct.Structure):
    _fields_ = (("struct_size", ct.c_size_t), ("context", ct.c_void_p), ("flags", ct.c_uint64))


class vg_metrics_options(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("context", ct.c_void_p),
        ("lpips", ct.c_void_p),
        ("f_score_m", ct.c_double),
        ("flags", ct.c_uint64),
        ("progress", ProgressFn),
        ("progress_user", ct.c_void_p),
    )


class vg_picture_errors(ct.Structure):
    _fields_ = (("struct_size", ct.c_size_t), *((name, ct.c_double) for name in PictureErrors._fields))


class vg_view_errors(ct.Structure):
    _fields_ = (("struct_size", ct.c_size_t), *((name, ct.c_double) for name in ViewErrors._fields))


class vg_surface_errors(ct.Structure):
    _fields_ = (("struct_size", ct.c_size_t), *((name, ct.c_double) for name in SurfaceErrors._fields))


class vg_align_options(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("context", ct.c_void_p),
        ("heading", ct.c_int32),
        ("flags", ct.c_uint32),
        ("progress", ProgressFn),
        ("progress_user", ct.c_void_p),
    )


class vg_alignment(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("vehicle_from_world", ct.c_double * 16),
        ("scale", ct.c_double),
        ("residual_m", ct.c_double),
        ("confidence", ct.c_double),
        ("residual_px", ct.c_double),
        ("other_px", ct.c_double),
        ("used_count", ct.c_size_t),
    )


class vg_scene_options(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("context", ct.c_void_p),
        ("vehicle_from_world", ct.c_void_p),
        ("names", ct.POINTER(ct.c_char_p)),
        ("name_count", ct.c_size_t),
        ("depth_scale", ct.c_double),
        ("load_depth", ct.c_int32),
        ("flags", ct.c_uint32),
        ("log", LogFn),
        ("log_user", ct.c_void_p),
        ("progress", ProgressFn),
        ("progress_user", ct.c_void_p),
    )


_handle: Any = ct.c_void_p
_out: Any = ct.POINTER(ct.c_void_p)
_numbers: Any = ct.c_void_p
_size: Any = ct.c_size_t
_text: Any = ct.c_char_p
_f64: Any = ct.c_double
_u32: Any = ct.c_uint32
_i32: Any = ct.c_int32


def _pointer(structure: type[ct.Structure]) -> Any:
    return ct.POINTER(structure)


#: Result and arguments of every function of the header; handles and arrays are void pointers here.
PROTOTYPES: Mapping[str, tuple[Any, tuple[Any, ...]]] = {
    "vg_version": (_text, ()),
    "vg_abi_version": (_u32, ()),
    "vg_status_name": (_text, (_i32,)),
    "vg_error_code": (_i32, (_handle,)),
    "vg_error_message": (_text, (_handle,)),
    "vg_error_free": (None, (_handle,)),
    "vg_context_options_init": (_i32, (_pointer(vg_context_options), _size)),
    "vg_context_new": (_i32, (_pointer(vg_context_options), _out, _out)),
    "vg_context_threads": (_u32, (_handle,)),
    "vg_context_free": (None, (_handle,)),
    "vg_default_context_free": (None, ()),
    "vg_camera_init": (_i32, (_pointer(vg_camera), _size)),
    "vg_camera_from_colmap_model": (_i32, (_i32, _numbers, _size, _u32, _u32, _numbers, _pointer(vg_camera), _out)),
    "vg_camera_from_opencv": (
        _i32,
        (_numbers, _numbers, _size, _i32, _u32, _u32, _numbers, _pointer(vg_camera), _out),
    ),
    "vg_camera_scale": (_i32, (_pointer(vg_camera), _u32, _u32, _pointer(vg_camera), _out)),
    "vg_camera_crop": (_i32, (_pointer(vg_camera), _u32, _u32, _u32, _u32, _pointer(vg_camera), _out)),
    "vg_pose_from_colmap": (_i32, (_numbers, _numbers, _numbers, _numbers, _out)),
    "vg_pose_from_opencv": (_i32, (_numbers, _numbers, _numbers, _numbers, _out)),
    "vg_pose_look_at": (_i32, (_numbers, _numbers, _numbers, _numbers, _out)),
    "vg_pose_from_opengl": (_i32, (_numbers, _numbers, _numbers, _out)),
    "vg_pose_from_box": (_i32, (_numbers, _numbers, _numbers, _out)),
    "vg_camera_project": (_i32, (_pointer(vg_camera), _numbers, _numbers, _out)),
    "vg_camera_look_at": (_i32, (_numbers, _numbers, _numbers, _f64, _u32, _u32, _pointer(vg_camera), _out)),
    "vg_cameras_turntable": (_i32, (_handle, _size, _f64, _f64, _u32, _u32, _pointer(vg_camera), _out)),
    "vg_camera_project_points": (_i32, (_pointer(vg_camera), _numbers, _size, _numbers, _numbers, _out)),
    "vg_camera_unproject": (_i32, (_pointer(vg_camera), _numbers, _f64, _numbers, _out)),
    "vg_camera_unproject_points": (_i32, (_pointer(vg_camera), _numbers, _numbers, _size, _numbers, _out)),
    "vg_view_init": (_i32, (_pointer(vg_view), _size)),
    "vg_model_options_init": (_i32, (_pointer(vg_model_options), _size)),
    "vg_model_open": (_i32, (_text, _pointer(vg_model_options), _out, _out)),
    "vg_model_free": (None, (_handle,)),
    "vg_options_init": (_i32, (_pointer(vg_options), _size)),
    "vg_report_figures_init": (_i32, (_pointer(vg_report_figures), _size)),
    "vg_report_get_figures": (_i32, (_handle, _pointer(vg_report_figures), _out)),
    "vg_report_json": (_text, (_handle,)),
    "vg_report_reason": (_text, (_handle, _size)),
    "vg_report_point_count": (_size, (_handle,)),
    "vg_report_point_positions": (_numbers, (_handle,)),
    "vg_report_point_colors": (_numbers, (_handle,)),
    "vg_report_free": (None, (_handle,)),
    "vg_gaussian_arrays_init": (_i32, (_pointer(vg_gaussian_arrays), _size)),
    "vg_gaussians_count": (_size, (_handle,)),
    "vg_gaussians_sh_degree": (_i32, (_handle,)),
    "vg_gaussians_positions": (_numbers, (_handle,)),
    "vg_gaussians_scales": (_numbers, (_handle,)),
    "vg_gaussians_rotations": (_numbers, (_handle,)),
    "vg_gaussians_opacities": (_numbers, (_handle,)),
    "vg_gaussians_sh": (_numbers, (_handle,)),
    "vg_gaussians_load_ply": (_i32, (_text, _out, _out)),
    "vg_gaussians_save_ply": (_i32, (_handle, _text, _out)),
    "vg_gaussians_from_arrays": (_i32, (_pointer(vg_gaussian_arrays), _out, _out)),
    "vg_gaussians_transform": (_i32, (_handle, _numbers, _out, _out)),
    "vg_gaussians_mirror": (_i32, (_handle, _out, _out)),
    "vg_gaussians_merge": (_i32, (_handle, _handle, _out, _out)),
    "vg_gaussians_select": (_i32, (_handle, _numbers, _size, _out, _out)),
    "vg_gaussians_mask": (_i32, (_handle, _numbers, _size, _out, _out)),
    "vg_gaussians_crop": (_i32, (_handle, _numbers, _numbers, _out, _out)),
    "vg_gaussians_covariances": (_i32, (_handle, _numbers, _size, _out)),
    "vg_gaussians_load_ply_memory": (_i32, (_numbers, _size, _out, _out)),
    "vg_gaussians_ply_size": (_size, (_handle,)),
    "vg_gaussians_save_ply_memory": (_i32, (_handle, _numbers, _size, _out)),
    "vg_gaussians_free": (None, (_handle,)),
    "vg_reconstruct": (_i32, (_pointer(vg_view), _size, _pointer(vg_options), _out, _out, _out)),
    "vg_refine_options_init": (_i32, (_pointer(vg_refine_options), _size)),
    "vg_refinement_init": (_i32, (_pointer(vg_refinement), _size)),
    "vg_refine": (
        _i32,
        (
            _handle,
            _pointer(vg_view),
            _size,
            _pointer(vg_refine_options),
            _out,
            _pointer(vg_refinement),
            _out,
        ),
    ),
    "vg_render_options_init": (_i32, (_pointer(vg_render_options), _size)),
    "vg_image_target_init": (_i32, (_pointer(vg_image_target), _size)),
    "vg_render": (
        _i32,
        (_handle, _pointer(vg_camera), _pointer(vg_render_options), _pointer(vg_image_target), _out),
    ),
    "vg_renderer_options_init": (_i32, (_pointer(vg_renderer_options), _size)),
    "vg_renderer_new": (_i32, (_handle, _pointer(vg_renderer_options), _out, _out)),
    "vg_renderer_render": (
        _i32,
        (_handle, _pointer(vg_camera), _size, _pointer(vg_render_options), _pointer(vg_image_target), _out),
    ),
    "vg_renderer_backend": (_i32, (_handle,)),
    "vg_renderer_choice": (_text, (_handle,)),
    "vg_renderer_free": (None, (_handle,)),
    "vg_image_gradient_init": (_i32, (_pointer(vg_image_gradient), _size)),
    "vg_gradients_init": (_i32, (_pointer(vg_gradients), _size)),
    "vg_render_backward": (
        _i32,
        (
            _handle,
            _pointer(vg_camera),
            _pointer(vg_render_options),
            _pointer(vg_image_target),
            _pointer(vg_image_gradient),
            _pointer(vg_gradients),
            _out,
        ),
    ),
    "vg_segment_options_init": (_i32, (_pointer(vg_segment_options), _size)),
    "vg_segment": (
        _i32,
        (_handle, _pointer(vg_image), _pointer(vg_camera), _pointer(vg_segment_options), _numbers, _size, _out),
    ),
    "vg_metrics_options_init": (_i32, (_pointer(vg_metrics_options), _size)),
    "vg_picture_errors_init": (_i32, (_pointer(vg_picture_errors), _size)),
    "vg_view_errors_init": (_i32, (_pointer(vg_view_errors), _size)),
    "vg_surface_errors_init": (_i32, (_pointer(vg_surface_errors), _size)),
    "vg_metrics_pictures": (
        _i32,
        (_pointer(vg_image), _pointer(vg_image), _pointer(vg_metrics_options), _pointer(vg_picture_errors), _out),
    ),
    "vg_metrics_view": (
        _i32,
        (_handle, _pointer(vg_view), _pointer(vg_metrics_options), _pointer(vg_view_errors), _out),
    ),
    "vg_metrics_surface": (
        _i32,
        (_handle, _numbers, _size, _pointer(vg_metrics_options), _pointer(vg_surface_errors), _out),
    ),
    "vg_align_options_init": (_i32, (_pointer(vg_align_options), _size)),
    "vg_alignment_init": (_i32, (_pointer(vg_alignment), _size)),
    "vg_align_scan": (
        _i32,
        (
            _pointer(vg_view),
            _size,
            _numbers,
            _size,
            _numbers,
            _size,
            _pointer(vg_align_options),
            _pointer(vg_alignment),
            _out,
        ),
    ),
    "vg_align_box": (
        _i32,
        (
            _pointer(vg_view),
            _size,
            _numbers,
            _size,
            _numbers,
            _pointer(vg_align_options),
            _pointer(vg_alignment),
            _out,
        ),
    ),
    "vg_align_points": (_i32, (_numbers, _numbers, _size, _pointer(vg_alignment), _numbers, _numbers, _out)),
    "vg_align_folder": (_i32, (_text, _text, _pointer(vg_align_options), _pointer(vg_alignment), _out)),
    "vg_scene_options_init": (_i32, (_pointer(vg_scene_options), _size)),
    "vg_colmap_open": (_i32, (_text, _pointer(vg_scene_options), _out, _out)),
    "vg_transforms_open": (_i32, (_text, _pointer(vg_scene_options), _out, _out)),
    "vg_scene_view_count": (_size, (_handle,)),
    "vg_scene_get_view": (_i32, (_handle, _size, _pointer(vg_view), _out)),
    "vg_scene_free": (None, (_handle,)),
}


def library_path() -> Path:
    """The shared library: the one VG_LIBRARY names, else the package's own."""
    override = os.environ.get("VG_LIBRARY")
    if override:
        return Path(override)
    name = {"darwin": "libvg.dylib", "win32": "vg.dll"}.get(sys.platform, "libvg.so")
    return Path(__file__).parent / "lib" / name


def include_path() -> Path:
    """The folder with vg.h, for compilers."""
    return Path(__file__).parent / "include"


def _load(path: Path) -> ct.CDLL:
    hints = (
        "Hints: install the package from a checkout of the repository (`pip install ./bindings/python`), which builds "
        "the library and puts it there; or let the environment variable VG_LIBRARY name a libvg"
    )
    source = "It is set by VG_LIBRARY. " if os.environ.get("VG_LIBRARY") else ""
    if not path.is_file():
        raise ImportError(f"{path}: no such file. {source}{hints}")
    try:
        loaded = ct.CDLL(str(path))
    except OSError as error:
        raise ImportError(f"{path}: cannot be loaded: {error}. {source}{hints}") from error
    missing = [name for name in PROTOTYPES if not hasattr(loaded, name)]
    if "vg_abi_version" in missing:
        raise ImportError(f"{path}: not a libvg: it has no vg_abi_version. {source}{hints}")
    found = loaded.vg_abi_version()
    if found != ABI_VERSION:
        raise ImportError(f"{path}: has binary interface {found}; this module needs {ABI_VERSION}. {source}{hints}")
    if missing:
        raise ImportError(f"{path}: older than this module: it has no {', '.join(missing)}. {source}{hints}")
    for name, (result, arguments) in PROTOTYPES.items():
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments
    return loaded


#: The loaded library, all functions of the header declared.
library = _load(library_path())


def version() -> str:
    """Version of the library that is running."""
    return _utf8(library.vg_version())


def _utf8(text: bytes | None) -> str:
    return (text or b"").decode("utf-8", "replace")


def _call(name: str, *arguments: Any) -> None:
    """Calls a function whose last argument is out_error; raises a failure as a VgError."""
    error = ct.c_void_p()
    status = getattr(library, name)(*arguments, ct.byref(error))
    if status != Status.OK:
        message = _utf8(library.vg_error_message(error))
        library.vg_error_free(error)
        raise VgError(status, _in_python(message) if status in (Status.ARGUMENT, Status.NOT_BUILT) else message)


#: Names of arguments in the header and in this module.
_NAMES = (
    (r"^(options|arrays|gradient|view)\.", ""),
    (r"^views(\[\d+\])(?: \(.*?\))?\.(camera|image|mask|depth|name)\b", r"\2s\1"),
    (r"^(positions|means)\b", "means"),
    (r"^rotations\b", "quats"),
    (r"^(budget)_s\b|^(f_score)_m\b|^(near|far)_plane\b|^(background)_color\b", r"\1\2\3\4"),
    (r"^(scan|cloud)_count\b", r"\1"),
    (r"^(param|point)_count\b", r"\1s"),
    (r"^view_count\b", "cameras"),
)


def _in_python(message: str) -> str:
    """The message with the argument's name in Python: "options.budget_s: -1; ..." is about budget."""
    argument, colon, rest = message.partition(": ")
    for theirs, ours in _NAMES:
        argument = re.sub(theirs, ours, argument)
    return argument + colon + rest


def _initial(structure: type[ct.Structure]) -> Any:
    """A structure with its default values."""
    made = structure()
    status = getattr(library, structure.__name__ + "_init")(ct.byref(made), ct.sizeof(made))
    if status != Status.OK:
        raise VgError(status, f"{structure.__name__}_init failed")
    return made


class _Handle:
    """An object of the library, freed with the last reference to it."""

    #: Contents of the object, and the alternative to pickling it.
    _holds, _way_out = "memory of this process", "another process must make a new one"

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        raise TypeError(
            f"{type(self).__name__}: cannot be pickled or copied, because it holds {self._holds}; "
            f"threads may share it, and {self._way_out}"
        )

    def __init__(self, name: str, pointer: ct.c_void_p) -> None:
        self._as_parameter_ = pointer.value
        free = getattr(library, f"vg_{name}_free")
        # At the end of the process the system frees the memory, which arrays may still use.
        weakref.finalize(self, free, pointer.value).atexit = False

    def array(self, address: int | None, shape: tuple[int, ...], dtype: npt.DTypeLike) -> npt.NDArray[Any]:
        """A read-only view of memory of this object, which it keeps alive."""
        if not address:
            return np.zeros(shape, dtype)
        memory: Any = (ct.c_uint8 * (int(np.prod(shape)) * np.dtype(dtype).itemsize)).from_address(address)
        memory.owner = self
        return np.frombuffer(memoryview(memory).toreadonly(), dtype).reshape(shape).view(FrozenArray)


class Context(_Handle):
    """Worker threads and memory that several calls share; 0 threads means one per core."""

    _holds, _way_out = "threads of this process", "another process makes its own: Context(threads)"

    def __init__(self, threads: int = 0) -> None:
        options = _initial(vg_context_options)
        options.threads = _threads(threads)
        made = ct.c_void_p()
        _call("vg_context_new", ct.byref(options), ct.byref(made))
        super().__init__("context", made)

    @property
    def threads(self) -> int:
        return int(library.vg_context_threads(self))


class Model(_Handle):
    """A network in an ONNX file, for prior_model and head_model of reconstruct; the arguments are those of
    vehicle_gaussians.Model. Any number of threads may use one at a time."""

    _holds, _way_out = "a network that is open in this process", "another process must open the file again: Model(path)"

    def __init__(
        self,
        path: str | os.PathLike[str],
        runtime: str | os.PathLike[str] | None = None,
        provider: Literal["cpu", "cuda"] = "cpu",
        fall_back: bool = False,
        threads: int = 0,
        prepack: bool | None = None,
        arena: bool = False,
    ) -> None:
        options = _initial(vg_model_options)
        options.runtime = None if runtime is None else os.fsencode(runtime)
        options.provider = _choice(Provider, "provider", provider)
        options.fall_back, options.threads, options.arena = fall_back, _threads(threads), arena
        options.prepack = {None: Prepack.AUTO, True: Prepack.ALWAYS, False: Prepack.NEVER}[prepack]
        made = ct.c_void_p()
        _call("vg_model_open", os.fsencode(path), ct.byref(options), ct.byref(made))
        super().__init__("model", made)
        #: The file.
        self.path = Path(path)

    def __repr__(self) -> str:
        return f"Model({str(self.path)!r})"


def _threads(number: int) -> int:
    # The library checks the upper limit.
    return whole(number, "threads", 0, _U32, "0 (all cores) to 1024")


#: The largest number that an argument of 32 bits without sign holds.
_U32 = (1 << 32) - 1


class AnyCamera(Protocol):
    """Interface of vehicle_gaussians.Camera that is used here."""

    @property
    def model(self) -> str: ...
    @property
    def params(self) -> npt.NDArray[np.float64]: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def vehicle_from_camera(self) -> npt.NDArray[np.float64]: ...


Camera: TypeAlias = vg_camera | AnyCamera


def camera_from_colmap(
    model: str | int, width: int, height: int, params: npt.ArrayLike, vehicle_from_camera: npt.ArrayLike
) -> vg_camera:
    """Makes a camera of one of COLMAP's models; the pose is 3x4 or 4x4."""
    if not isinstance(model, (str, int)):
        raise bad_type("model", model, "COLMAP's name or number")
    number = CameraModel.__members__.get(model) if isinstance(model, str) else model
    if number not in list(CameraModel):
        raise bad_value("model", model, ", ".join(f"{m.name} ({m})" for m in CameraModel))
    values, rows, made = doubles(params, "params"), pose(vehicle_from_camera, "vehicle_from_camera"), vg_camera()
    size = _side(width, "width"), _side(height, "height")
    _call(
        "vg_camera_from_colmap_model",
        *(number, values.ctypes.data, values.size, *size, rows.ctypes.data, ct.byref(made)),
    )
    return made


def camera_from_opencv(
    K: npt.ArrayLike,
    vehicle_from_camera: npt.ArrayLike | None = None,
    width: int = 0,
    height: int = 0,
    distortion: npt.ArrayLike = (),
    *,
    fisheye: bool = False,
    rvec: npt.ArrayLike | None = None,
    tvec: npt.ArrayLike | None = None,
    vehicle_from_world: npt.ArrayLike | None = None,
) -> vg_camera:
    """Makes a camera from OpenCV's calibration, with the centre of the top-left pixel at (0, 0); the arguments are
    those of vehicle_gaussians.Camera.from_opencv."""
    k, bent = doubles(K, "K", (3, 3)), doubles(distortion, "distortion")
    if vehicle_from_camera is None and rvec is not None and tvec is not None:
        vehicle_from_camera = pose_from_opencv(rvec, tvec, vehicle_from_world)
    elif vehicle_from_camera is None or any(given is not None for given in (rvec, tvec, vehicle_from_world)):
        found = "no whole pose" if vehicle_from_camera is None else "more than one pose"
        raise bad_value("vehicle_from_camera, rvec, tvec", found, "vehicle_from_camera, or rvec and tvec")
    rows, made = pose(vehicle_from_camera, "vehicle_from_camera"), vg_camera()
    size = _side(width, "width"), _side(height, "height")
    _call(
        "vg_camera_from_opencv",
        *(k.ctypes.data, bent.ctypes.data, bent.size, fisheye, *size, rows.ctypes.data, ct.byref(made)),
    )
    return made


def camera_look_at(
    eye: npt.ArrayLike,
    target: npt.ArrayLike,
    width: int,
    height: int,
    *,
    fov_y_degrees: float = 35.0,
    up: npt.ArrayLike = (0.0, 0.0, 1.0),
) -> vg_camera:
    """Makes a pinhole camera; the arguments are those of vehicle_gaussians.Camera.look_at."""
    points = [doubles(point, name, (3,)) for point, name in ((eye, "eye"), (target, "target"), (up, "up"))]
    size, made = (_side(width, "width"), _side(height, "height")), vg_camera()
    addresses = [point.ctypes.data for point in points]
    _call("vg_camera_look_at", *addresses, real(fov_y_degrees, "fov_y_degrees"), *size, ct.byref(made))
    return made


@overload
def project(camera: Camera, points: npt.ArrayLike, depth: Literal[False] = False) -> npt.NDArray[np.float64]: ...
@overload
def project(
    camera: Camera, points: npt.ArrayLike, depth: Literal[True]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]: ...
def project(camera: Camera, points: npt.ArrayLike, depth: bool = False) -> Any:
    """Projects points to pixels and depths; the arguments are those of vehicle_gaussians.Camera.project."""
    posed, places = _camera(camera), _rows(points, "points", 3)
    pixels, depths = np.empty((len(places), 2)), np.empty(len(places))
    numbers = (places.ctypes.data, len(places), pixels.ctypes.data, depths.ctypes.data)
    _call("vg_camera_project_points", ct.byref(posed), *numbers)
    return (pixels, depths) if depth else pixels


def unproject(camera: Camera, pixels: npt.ArrayLike, depths: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Returns the points behind pixels; the arguments are those of vehicle_gaussians.Camera.unproject."""
    posed, places, along = _camera(camera), _rows(pixels, "pixels", 2), doubles(depths, "depths")
    if along.shape != (len(places),):
        raise bad_value("depths", f"shape {along.shape}", f"({len(places)},), one for each pixel")
    points = np.empty((len(places), 3))
    numbers = (places.ctypes.data, along.ctypes.data, len(places), points.ctypes.data)
    _call("vg_camera_unproject_points", ct.byref(posed), *numbers)
    return points


def _rows(numbers: npt.ArrayLike, argument: str, columns: int) -> npt.NDArray[np.float64]:
    array = doubles(numbers, argument)
    if array.ndim != 2 or array.shape[1] != columns:
        raise bad_value(argument, f"shape {array.shape}", f"an (n, {columns}) array")
    return array


def _side(number: int, argument: str) -> int:
    # The library checks the upper limit.
    return whole(number, argument, 1, _U32, "1 to 8192")


def pose_from_colmap(
    qvec: npt.ArrayLike, tvec: npt.ArrayLike, vehicle_from_world: npt.ArrayLike | None = None
) -> npt.NDArray[np.float64]:
    """Returns vehicle_from_camera (4x4) for COLMAP's world-to-camera quaternion (w, x, y, z) and translation."""
    q, t, world = doubles(qvec, "qvec", (4,)), doubles(tvec, "tvec", (3,)), _similarity(vehicle_from_world)
    made = np.eye(4)
    _call("vg_pose_from_colmap", q.ctypes.data, t.ctypes.data, _address(world), made.ctypes.data)
    return made


def pose_from_opencv(
    rvec: npt.ArrayLike, tvec: npt.ArrayLike, vehicle_from_world: npt.ArrayLike | None = None
) -> npt.NDArray[np.float64]:
    """Returns vehicle_from_camera (4x4) for OpenCV's world-to-camera rotation vector and translation."""
    vectors = []
    for vector, name in ((rvec, "rvec"), (tvec, "tvec")):
        array = doubles(vector, name)
        # OpenCV returns (3, 1).
        if array.size != 3:
            raise bad_value(name, f"shape {array.shape}", "3 numbers")
        vectors.append(array)
    world, made = _similarity(vehicle_from_world), np.eye(4)
    _call("vg_pose_from_opencv", *(v.ctypes.data for v in vectors), _address(world), made.ctypes.data)
    return made


def pose_from_opengl(
    camera_to_world: npt.ArrayLike, vehicle_from_world: npt.ArrayLike | None = None
) -> npt.NDArray[np.float64]:
    """Returns vehicle_from_camera (4x4) for a camera-to-world matrix with OpenGL's camera axes, as in nerfstudio."""
    matrix, world = pose(camera_to_world, "camera_to_world"), _similarity(vehicle_from_world)
    made = np.eye(4)
    _call("vg_pose_from_opengl", matrix.ctypes.data, _address(world), made.ctypes.data)
    return made


def pose_from_box(ego_from_vehicle: npt.ArrayLike, ego_from_camera: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Returns vehicle_from_camera (4x4) from the poses of a tracked box and of the camera in a common frame."""
    vehicle, camera = pose(ego_from_vehicle, "ego_from_vehicle"), pose(ego_from_camera, "ego_from_camera")
    made = np.eye(4)
    _call("vg_pose_from_box", vehicle.ctypes.data, camera.ctypes.data, made.ctypes.data)
    return made


def _similarity(vehicle_from_world: npt.ArrayLike | None) -> npt.NDArray[np.float64] | None:
    return None if vehicle_from_world is None else doubles(vehicle_from_world, "vehicle_from_world", (4, 4))


def _address(array: npt.NDArray[Any] | None) -> int | None:
    return None if array is None else array.ctypes.data


def _camera(camera: Camera, argument: str = "camera") -> vg_camera:
    if isinstance(camera, vg_camera):
        return camera
    try:
        members = (camera.model, camera.width, camera.height, camera.params, camera.vehicle_from_camera)
    except AttributeError:
        raise bad_type(argument, camera, "a vg_camera, or a Camera") from None
    return camera_from_colmap(*members)


def _lent_context(context: Context | None) -> int | None:
    if context is not None and not isinstance(context, Context):
        raise bad_type("context", context, "a Context")
    return None if context is None else context._as_parameter_


def _lent_gaussians(gaussians: Gaussians, argument: str = "gaussians") -> _Handle:
    if not isinstance(gaussians, Gaussians):
        way_out = "capi.Gaussians; arrays of others become one by capi.Gaussians.from_arrays"
        raise bad_type(argument, gaussians, way_out)
    return gaussians._handle


class Gaussians:
    """The Gaussians of a vehicle. They are immutable; arrays are read-only views that keep them alive."""

    def __init__(self, handle: _Handle) -> None:
        self._handle = handle

    @classmethod
    def _made_by(cls, name: str, *arguments: Any) -> Gaussians:
        made = ct.c_void_p()
        _call(name, *arguments, ct.byref(made))
        return cls(_Handle("gaussians", made))

    @classmethod
    def load_ply(cls, path: str | os.PathLike[str]) -> Gaussians:
        """Reads a PLY file in the layout of 3D Gaussian Splatting."""
        return cls._made_by("vg_gaussians_load_ply", os.fsencode(path))

    @classmethod
    def from_arrays(
        cls,
        means: _types.Floats,
        scales: _types.Floats,
        quats: _types.Floats,
        opacities: _types.Floats,
        sh: _types.Floats,
    ) -> Gaussians:
        """Copies arrays of shapes (n, 3), (n, 3), (n, 4), (n,) and (n, (degree + 1)^2, 3)."""
        given = {"means": means, "scales": scales, "quats": quats, "opacities": opacities, "sh": sh}
        taken = {name: np.ascontiguousarray(floats(array, name, "an array of floats")) for name, array in given.items()}
        n, bands = len(taken["means"]), taken["sh"].shape[1:2]
        degree = {(1,): 0, (4,): 1, (9,): 2, (16,): 3}.get(bands, -1)
        shapes = {"means": (n, 3), "scales": (n, 3), "quats": (n, 4), "opacities": (n,), "sh": (n, *bands, 3)}
        if degree < 0:
            raise bad_value("sh", f"shape {taken['sh'].shape}", "(n, K, 3) with K = 1, 4, 9 or 16")
        for name, shape in shapes.items():
            if taken[name].shape != shape:
                raise bad_value(name, f"shape {taken[name].shape}", f"{shape}")
        arrays = _initial(vg_gaussian_arrays)
        arrays.count, arrays.sh_degree = n, degree
        fields = ("positions", "scales", "rotations", "opacities", "sh")
        for field, array in zip(fields, taken.values(), strict=True):
            setattr(arrays, field, array.ctypes.data)
        return cls._made_by("vg_gaussians_from_arrays", ct.byref(arrays))

    def save_ply(self, path: str | os.PathLike[str]) -> None:
        """Writes a PLY file in the layout of 3D Gaussian Splatting."""
        _call("vg_gaussians_save_ply", self._handle, os.fsencode(path))

    @classmethod
    def from_ply_bytes(cls, data: bytes | bytearray | memoryview) -> Gaussians:
        """Reads the bytes of a PLY file in the layout of 3D Gaussian Splatting."""
        try:
            held = np.frombuffer(data, np.uint8)
        except (TypeError, ValueError):
            raise bad_type("data", data, "bytes") from None
        return cls._made_by("vg_gaussians_load_ply_memory", held.ctypes.data, held.size)

    def to_ply_bytes(self) -> bytes:
        """Returns the bytes that save_ply writes."""
        data = np.empty(library.vg_gaussians_ply_size(self._handle), np.uint8)
        _call("vg_gaussians_save_ply_memory", self._handle, data.ctypes.data, data.size)
        return data.tobytes()

    def __getitem__(
        self, index: slice | Sequence[int] | Sequence[bool] | npt.NDArray[np.integer[Any] | np.bool_]
    ) -> Gaussians:
        """The Gaussians that a NumPy index selects: a slice, bools, or whole numbers."""
        chosen = indices(index, len(self)).astype(np.uintp)
        return self._made_by("vg_gaussians_select", self._handle, chosen.ctypes.data, len(chosen))

    #: Not iterable: indexing returns Gaussians again.
    __iter__ = None

    def cropped(self, low: npt.ArrayLike, high: npt.ArrayLike) -> Gaussians:
        """The Gaussians whose centre lies in the box from low to high, metres, including its faces."""
        corners = doubles(low, "low", (3,)), doubles(high, "high", (3,))
        return self._made_by("vg_gaussians_crop", self._handle, *(corner.ctypes.data for corner in corners))

    def covariances(self) -> npt.NDArray[np.float32]:
        """Covariance matrices in the vehicle's frame, square metres. (n, 3, 3)"""
        upper = np.empty((len(self), 6), np.float32)
        _call("vg_gaussians_covariances", self._handle, upper.ctypes.data, len(self))
        return upper[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)

    def turntable(
        self,
        count: int,
        width: int,
        height: int,
        *,
        elevation_degrees: float = 12.0,
        fov_y_degrees: float = 35.0,
    ) -> list[vg_camera]:
        """Cameras on a circle around the vehicle; the arguments are those of vehicle_gaussians.Gaussians.turntable."""
        cameras = (vg_camera * whole(count, "count", 1, 100_000))()
        angles = real(elevation_degrees, "elevation_degrees"), real(fov_y_degrees, "fov_y_degrees")
        size = _side(width, "width"), _side(height, "height")
        _call("vg_cameras_turntable", self._handle, count, *angles, *size, cameras)
        return [vg_camera.from_buffer_copy(camera) for camera in cameras]

    def mirrored(self) -> Gaussians:
        """The mirror image across the plane of symmetry, y = 0."""
        return self._made_by("vg_gaussians_mirror", self._handle)

    def transformed(self, to_from_vehicle: npt.ArrayLike) -> Gaussians:
        """The Gaussians in another frame, transformed by a 4x4 similarity."""
        matrix = doubles(to_from_vehicle, "to_from_vehicle", (4, 4))
        return self._made_by("vg_gaussians_transform", self._handle, matrix.ctypes.data)

    def merged(self, other: Gaussians) -> Gaussians:
        """These Gaussians followed by those of other."""
        return self._made_by("vg_gaussians_merge", self._handle, _lent_gaussians(other, "other"))

    def render(
        self,
        camera: Camera,
        background: _types.Background = "white",
        *,
        dtype: npt.DTypeLike = np.uint8,
        antialiased: bool = False,
        context: Context | None = None,
    ) -> npt.NDArray[Any]:
        """Renders a camera's picture, RGB, or RGBA with straight alpha on a "transparent" background."""
        return self._draw(camera, background, np.dtype(dtype), antialiased, context, with_depth=False)[0]

    def render_with_depth(
        self,
        camera: Camera,
        background: _types.Background = "white",
        *,
        dtype: npt.DTypeLike = np.uint8,
        antialiased: bool = False,
        context: Context | None = None,
    ) -> tuple[npt.NDArray[Any], npt.NDArray[np.float32]]:
        """Renders the picture and its depth in metres, 0 where there is no Gaussian."""
        picture, depth = self._draw(camera, background, np.dtype(dtype), antialiased, context, with_depth=True)
        assert depth is not None
        return picture, depth

    def _draw(
        self,
        camera: Camera,
        background: _types.Background,
        dtype: np.dtype[Any],
        antialiased: bool,
        context: Context | None,
        with_depth: bool,
    ) -> tuple[npt.NDArray[Any], npt.NDArray[np.float32] | None]:
        posed, target = _camera(camera), _initial(vg_image_target)
        options = _render_options(background, antialiased, context)
        opaque = options.background == Background.COLOR
        if dtype == np.uint8:
            target.color_format, channels = (Format.RGB8, 3) if opaque else (Format.RGBA8, 4)
        elif dtype == np.float32:
            target.color_format, channels = Format.RGBA32F, 4
        else:
            raise ArgumentTypeError(Status.ARGUMENT, f"dtype: {dtype}; allowed: uint8 or float32")
        size = (posed.height, posed.width)
        picture = np.empty((*size, channels), dtype)
        depth = np.empty(size, np.float32) if with_depth else None
        target.width, target.height = posed.width, posed.height
        target.color, target.depth = picture.ctypes.data, _address(depth)
        with _reporting(options, None):
            _call("vg_render", self._handle, ct.byref(posed), ct.byref(options), ct.byref(target))
        return (picture[..., :3] if opaque else picture), depth

    def render_planes(
        self,
        camera: Camera,
        background: _types.Background = "white",
        *,
        antialiased: bool = False,
        depth_mode: _types.DepthMode = "expected",
        backend: _types.Backend = "auto",
        context: Context | None = None,
    ) -> Planes:
        """Renders a picture for use in a loss: colour over the background or premultiplied, alpha, and depth."""
        posed, target = _camera(camera), _initial(vg_image_target)
        options = _render_options(background, antialiased, context)
        options.alpha, options.depth_mode = Alpha.PREMULTIPLIED, _choice(DepthMode, "depth_mode", depth_mode)
        options.backend = _choice(Backend, "backend", backend)
        size = (posed.height, posed.width)
        picture, alpha, depth = np.empty((*size, 4), np.float32), np.empty(size, np.float32), np.empty(size, np.float32)
        target.width, target.height, target.color_format = posed.width, posed.height, Format.RGBA32F
        target.color, target.alpha, target.depth = picture.ctypes.data, alpha.ctypes.data, depth.ctypes.data
        with _reporting(options, None):
            _call("vg_render", self._handle, ct.byref(posed), ct.byref(options), ct.byref(target))
        return Planes(np.ascontiguousarray(picture[..., :3]), alpha, depth)

    def render_backward(
        self,
        camera: Camera,
        color: _types.Floats | None = None,
        alpha: _types.Floats | None = None,
        depth: _types.Floats | None = None,
        background: _types.Background = "white",
        *,
        antialiased: bool = False,
        depth_mode: _types.DepthMode = "expected",
        backend: _types.Backend = "auto",
        context: Context | None = None,
    ) -> Gradients:
        """Gradients of all inputs of a picture, from those of a loss with respect to its planes; the arguments
        are those of vehicle_gaussians.Gaussians.render_backward. Planes are read in place."""
        posed, gradient, out = _camera(camera), _initial(vg_image_gradient), _initial(vg_gradients)
        options = _render_options(background, antialiased, context)
        options.alpha, options.depth_mode = Alpha.PREMULTIPLIED, _choice(DepthMode, "depth_mode", depth_mode)
        options.backend = _choice(Backend, "backend", backend)
        gradient.width, gradient.height = size = (posed.width, posed.height)
        alive: list[Any] = []
        for name, array, channels in (("color", color, (3,)), ("alpha", alpha, ()), ("depth", depth, ())):
            if array is None:
                continue
            array = floats(array, name, "an array of floats")
            if array.shape != (*size[::-1], *channels):
                raise bad_value(name, f"shape {array.shape}", f"{(*size[::-1], *channels)}")
            lent = _lent(array, Format.DEPTH32F, alive)
            setattr(gradient, name, lent.data)
            setattr(gradient, name + "_row_stride", lent.row_stride)
        n, coefficients = len(self), (self.sh_degree + 1) ** 2
        made = Gradients(
            np.empty((n, 3), np.float32),
            np.empty((n, 3), np.float32),
            np.empty((n, 4), np.float32),
            np.empty(n, np.float32),
            np.empty((n, coefficients, 3), np.float32),
            np.empty(3),
            np.empty(6),
            np.empty((4, 4)),
        )
        fields = ("positions", "scales", "rotations", "opacities", "sh", "background", "pose", "view_matrix")
        arrays: tuple[npt.NDArray[Any], ...] = made
        for field, values in zip(fields, arrays, strict=True):
            setattr(out, field, values.ctypes.data)
        out.count, out.sh_degree = n, self.sh_degree
        arguments = (ct.byref(posed), ct.byref(options), None, ct.byref(gradient), ct.byref(out))
        with _reporting(options, None):
            _call("vg_render_backward", self._handle, *arguments)
        return made

    def _array(self, name: str, *per_gaussian: int) -> npt.NDArray[np.float32]:
        address = getattr(library, "vg_gaussians_" + name)(self._handle)
        return self._handle.array(address, (len(self), *per_gaussian), np.float32)

    @property
    def means(self) -> npt.NDArray[np.float32]:
        """Centres, metres. (n, 3)"""
        return self._array("positions", 3)

    @property
    def scales(self) -> npt.NDArray[np.float32]:
        """Standard deviations, metres. (n, 3)"""
        return self._array("scales", 3)

    @property
    def quats(self) -> npt.NDArray[np.float32]:
        """Unit quaternions (w, x, y, z). (n, 4)"""
        return self._array("rotations", 4)

    @property
    def opacities(self) -> npt.NDArray[np.float32]:
        """Peak opacities, 0 to 1. (n,)"""
        return self._array("opacities")

    @property
    def sh(self) -> npt.NDArray[np.float32]:
        """Spherical harmonics, RGB last. (n, (degree + 1)^2, 3)"""
        return self._array("sh", (self.sh_degree + 1) ** 2, 3)

    @property
    def sh_degree(self) -> int:
        """Highest degree of the spherical harmonics, 0 to 3."""
        return int(library.vg_gaussians_sh_degree(self._handle))

    def __len__(self) -> int:
        return int(library.vg_gaussians_count(self._handle))

    def __reduce__(self) -> tuple[Any, ...]:
        """Arrays for pickle, which restores them bit for bit."""
        return Gaussians.from_arrays, (self.means, self.scales, self.quats, self.opacities, self.sh)

    def __copy__(self) -> Gaussians:
        return self

    def __deepcopy__(self, memo: dict[int, Any], /) -> Gaussians:
        return self

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Gaussians):
            return NotImplemented
        names = ("means", "scales", "quats", "opacities", "sh")
        return all(np.array_equal(getattr(self, name), getattr(other, name)) for name in names)

    def __hash__(self) -> int:
        return hash((len(self), self.sh_degree, tuple(self.means[:1].ravel().tolist())))

    def __repr__(self) -> str:
        return f"Gaussians({len(self)}, sh_degree={self.sh_degree})"


class Renderer(_Handle):
    """Gaussians prepared for rendering many times: backend is "auto", "cpu" or "gpu". Any number of threads may use one
    at a time."""

    _holds = "working memory of this process"
    _way_out = "another process must make a new one from the Gaussians: Renderer(gaussians, backend)"

    def __init__(
        self,
        gaussians: Gaussians,
        backend: _types.Backend = "auto",
        context: Context | None = None,
    ) -> None:
        options = _initial(vg_renderer_options)
        options.backend = _choice(Backend, "backend", backend)
        options.context = _lent_context(context)
        made = ct.c_void_p()
        _call("vg_renderer_new", _lent_gaussians(gaussians), ct.byref(options), ct.byref(made))
        super().__init__("renderer", made)

    @property
    def backend(self) -> str:
        """The renderer that was chosen: "cpu" or "gpu"."""
        return Backend(library.vg_renderer_backend(self)).name.lower()

    @property
    def choice(self) -> str:
        """The renderer that was chosen, and why."""
        return _utf8(library.vg_renderer_choice(self))

    def render(
        self,
        cameras: Sequence[Camera],
        background: _types.Background = "white",
        *,
        antialiased: bool = False,
        progress: Progress | None = None,
        context: Context | None = None,
    ) -> npt.NDArray[np.uint8]:
        """Pictures of cameras of one size: uint8 (n, height, width, 3), or 4 with straight alpha on a "transparent"
        background."""
        posed = [_camera(camera, f"cameras[{i}]") for i, camera in enumerate(listed(cameras, "cameras"))]
        if len({(camera.width, camera.height) for camera in posed}) != 1:
            raise bad_value("cameras", f"{len(posed)} of several sizes or none", "of one size")
        options = _render_options(background, antialiased, context)
        opaque = options.background == Background.COLOR
        format, channels = (Format.RGB8, 3) if opaque else (Format.RGBA8, 4)
        pictures = np.empty((len(posed), posed[0].height, posed[0].width, channels), np.uint8)
        targets = (vg_image_target * len(posed))(*[_initial(vg_image_target) for _ in posed])
        for target, camera, picture in zip(targets, posed, pictures, strict=True):
            target.width, target.height = camera.width, camera.height
            target.color, target.color_format = picture.ctypes.data, format
        array = (vg_camera * len(posed))(*posed)
        with _reporting(options, progress):
            _call("vg_renderer_render", self, array, len(posed), ct.byref(options), targets)
        return pictures


def _render_options(background: _types.Background, antialiased: bool, context: Context | None) -> vg_render_options:
    options: vg_render_options = _initial(vg_render_options)
    options.context = _lent_context(context)
    options.antialiased = antialiased
    if isinstance(background, str) and background == "transparent":
        options.background = Background.TRANSPARENT
        return options
    named: dict[Any, Sequence[float]] = {"white": (1, 1, 1), "black": (0, 0, 0)}
    allowed = "white, black, transparent, or (r, g, b) from 0 to 1"
    if isinstance(background, str) and background not in named:
        raise bad_value("background", repr(background), allowed)
    color = doubles(named[background] if isinstance(background, str) else background, "background")
    if color.shape != (3,):
        raise bad_value("background", f"shape {color.shape}", allowed)
    options.background_color[:] = color.tolist()
    return options


@equal_by_value
class Points(NamedTuple):
    """The metric coloured point cloud."""

    positions: npt.NDArray[np.float32]
    """Metres, float32 (n, 3)."""
    colors: npt.NDArray[np.uint8]
    """sRGB, uint8 (n, 3)."""


@documented
class Refined(NamedTuple):
    """Result of a refinement."""

    gaussians: Gaussians
    """The best that was found."""
    report: dict[str, Any]
    """How many steps were planned, made and kept, why it ended, and the PSNR before and after."""


@equal_by_value
class Reconstruction(NamedTuple):
    """A finished reconstruction."""

    gaussians: Gaussians
    """The vehicle."""
    report: dict[str, Any]
    """The report: what was done, how long it took, what was left out and why."""
    points: Points | None
    """The point cloud, if asked for."""


def reconstruct(
    images: Iterable[npt.NDArray[np.uint8]],
    masks: Iterable[_types.Mask | None] | None,
    cameras: Iterable[Camera],
    depths: Iterable[_types.Floats | None] | None = None,
    *,
    prior: _types.Prior = "auto",
    prior_model: Model | None = None,
    head_model: Model | None = None,
    calibrate: _types.Calibrate = "auto",
    symmetry: _types.Symmetry = "auto",
    relight: _types.Relight = "auto",
    photo: bool = True,
    cloud: _types.Floats | None = None,
    vehicle_size: _types.Size | None = None,
    vehicle_place: _types.Placed | None = None,
    sh_degree: int = 2,
    keep: Keep | int | _types.Keep | Iterable[_types.Keep] = 0,
    check: bool = True,
    points: bool = False,
    budget: float | None = None,
    resolution: float = 1.0,
    max_views: int | None = None,
    max_gaussians: int | None = 12_000_000,
    refine_iterations: int | None = None,
    refine_seconds: float | None = None,
    refine_hold_out: bool = False,
    refine_backend: _types.Backend = "auto",
    names: Iterable[str] | None = None,
    progress: Progress | None = None,
    log: Callable[[LogLevel, str], object] | None = None,
    context: Context | None = None,
) -> Reconstruction:
    """Reconstructs the vehicle in the photographs; the arguments are those of vehicle_gaussians.reconstruct.

    Pictures are read in place if the pixels of each row are contiguous.
    """
    alive: list[Any] = []
    views = _views(images, masks, cameras, depths, names, alive)
    options = _initial(vg_options)
    options.context = _lent_context(context)
    # The options of the library's table.
    options.prior = _choice(Prior, "prior", prior)
    options.calibrate = _choice(Calibrate, "calibrate", calibrate)
    options.symmetry = _choice(Symmetry, "symmetry", symmetry)
    options.relight = _choice(Relight, "relight", relight)
    options.sh_degree = whole(sh_degree, "sh_degree", 0, 3, "0 to 3")
    options.keep = _kept(keep)
    options.check = check
    options.photo = photo
    options.budget_s = _real_or_0(budget, "budget", "seconds above 0")
    options.resolution = real(resolution, "resolution")
    options.max_views = _whole_or_0(max_views, "max_views", 1, sys.maxsize, "at least 1")
    options.max_gaussians = _whole_or_0(max_gaussians, "max_gaussians", 1, sys.maxsize, "at least 1")
    options.points = points
    # The others.
    # Referred to by this call's arguments until it returns.
    options.prior_model = _lent_model(prior_model, "prior_model")
    options.head_model = _lent_model(head_model, "head_model")
    options.refine_iterations = _whole_or_0(refine_iterations, "refine_iterations", 1, _U32, "1 to 1000000")
    options.refine_seconds = _real_or_0(refine_seconds, "refine_seconds", "above 0, at most 86400")
    options.refine_hold_out = refine_hold_out
    options.refine_backend = _choice(Backend, "refine_backend", refine_backend)
    if cloud is not None:
        alive.append(_measured(cloud, "cloud"))
        options.cloud, options.cloud_count = alive[-1].ctypes.data, len(alive[-1])
    if vehicle_size is not None:
        options.vehicle_size[:] = doubles(vehicle_size, "vehicle_size", (3,)).tolist()
    if vehicle_place is not None:
        *center, options.vehicle_yaw = doubles(vehicle_place, "vehicle_place", (4,)).tolist()
        options.vehicle_center[:], options.has_vehicle_place = center, 1
    car, report = ct.c_void_p(), ct.c_void_p()
    with _reporting(options, progress) as raised:
        options.log = LogFn(_logger(log, raised)) if log is not None else LogFn()
        _call("vg_reconstruct", views, len(views), ct.byref(options), ct.byref(car), ct.byref(report))
        gaussians, made = Gaussians(_Handle("gaussians", car)), _Handle("report", report)
    lifted = None
    if points:
        count = int(library.vg_report_point_count(made))
        lifted = Points(
            made.array(library.vg_report_point_positions(made), (count, 3), np.float32),
            made.array(library.vg_report_point_colors(made), (count, 3), np.uint8),
        )
    document = json.loads(library.vg_report_json(made))
    reconstructed(document)
    return Reconstruction(gaussians, document, lifted)


def _views(
    images: Iterable[Any],
    masks: Iterable[Any] | None,
    cameras: Iterable[Camera],
    depths: Iterable[Any] | None,
    names: Iterable[str] | None,
    alive: list[Any],
) -> ct.Array[vg_view]:
    """Views that point to the arrays in ``alive``."""
    pictures = listed(images, "images", 3)
    n = len(pictures)
    if n == 0:
        raise bad_value("images", "none", "at least one")
    columns: dict[str, list[Any]] = {
        "cameras": listed(cameras, "cameras"),
        "masks": [None] * n if masks is None else listed(masks, "masks", 2),
        "depths": [None] * n if depths is None else listed(depths, "depths", 2),
        "names": [f"{i:03}" for i in range(n)] if names is None else listed(names, "names"),
    }
    for argument, column in columns.items():
        if len(column) != n:
            raise VgError(Status.ARGUMENT, f"{argument}: {len(column)} entries; allowed: {n}, one per image")
    views = (vg_view * n)()
    for i, image in enumerate(pictures):
        views[i] = _initial(vg_view)
        views[i].name = _name(columns["names"][i], f"names[{i}]")
        views[i].camera = _camera(columns["cameras"][i], f"cameras[{i}]")
        views[i].image = _photograph(image, f"images[{i}]", alive)
        if columns["masks"][i] is not None:
            views[i].mask = _mask(columns["masks"][i], f"masks[{i}]", alive)
        if columns["depths"][i] is not None:
            views[i].depth = _depth(columns["depths"][i], f"depths[{i}]", alive)
    return views


def refine(
    gaussians: Gaussians,
    scene: Scene,
    *,
    iterations: int | None = None,
    seconds: float | None = None,
    hold_out: bool = False,
    densify: bool = False,
    backend: Literal["auto", "cpu", "gpu"] = "auto",
    progress: Progress | None = None,
    context: Context | None = None,
) -> Refined:
    """Optimises the Gaussians of any model against the photographs of a scene; the arguments are those of
    vehicle_gaussians.refine."""
    alive: list[Any] = []
    views = _views(scene.images, scene.masks, scene.cameras, scene.depths, scene.names, alive)
    options, done, made = _initial(vg_refine_options), _initial(vg_refinement), ct.c_void_p()
    options.context = _lent_context(context)
    if iterations is not None:
        options.iterations = whole(iterations, "iterations", 1, _U32, "1 to 1000000")
    if seconds is not None:
        if iterations is not None:
            raise bad_value("seconds", f"{seconds:g}, with iterations {iterations}", "only one of the two")
        # In C, 0 means none.
        if seconds == 0:
            raise bad_value("seconds", seconds, "above 0, at most 86400")
        options.seconds = real(seconds, "seconds")
    options.hold_out, options.densify = hold_out, densify
    options.backend = _choice(Backend, "backend", backend)
    handle = _lent_gaussians(gaussians)
    with _reporting(options, progress):
        _call("vg_refine", handle, views, len(views), ct.byref(options), ct.byref(made), ct.byref(done))
        refined = Gaussians(_Handle("gaussians", made))
    held_out = [done.held_out_before_db, done.held_out_after_db]
    report = {
        **{name: getattr(done, name) for name in ("iterations", "made", "kept")},
        "stop": RefineStop(done.stop).name.lower(),
        "psnr_db": [done.psnr_before_db, done.psnr_after_db],
        "held_out": None if held_out[0] != held_out[0] else {"psnr_db": held_out},
    }
    return Refined(refined, report)


@contextlib.contextmanager
def _reporting(options: Any, progress: Progress | None) -> Iterator[list[BaseException]]:
    """Makes a call with these options report to ``progress`` and end at Ctrl-C. Yields the list of exceptions that were
    raised in callbacks, of which the first is raised at the end."""
    raised: list[BaseException] = []
    report, overall = None if progress is None else wrapped(progress), ct.c_double()

    def on_progress(stage: bytes, fraction: float, _: object) -> int:
        try:
            part = overall.value if has_stages else fraction
            return int(bool(raised) or not (report is None or report(stage.decode(), fraction, part)))
        except BaseException as error:
            raised.append(error)
            return 1

    has_stages = isinstance(options, vg_options)
    if has_stages:
        options.progress_overall = ct.pointer(overall)
    # Always set: Python can handle Ctrl-C only when it is called.
    options.progress = ProgressFn(on_progress)
    try:
        with _signals_kept(raised):
            yield raised
    except VgError:
        if not raised:
            raise
    if raised:
        raise raised[0]


@contextlib.contextmanager
def _signals_kept(raised: list[BaseException]) -> Iterator[None]:
    """Keeps exceptions of the handler of Ctrl-C, which ctypes would print and drop in a callback."""
    usual = signal.getsignal(signal.SIGINT)
    if not callable(usual) or threading.current_thread() is not threading.main_thread():
        yield
        return

    def keep(number: int, frame: FrameType | None) -> None:
        try:
            usual(number, frame)
        except BaseException as error:
            raised.append(error)

    signal.signal(signal.SIGINT, keep)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)


def _logger(
    log: Callable[[LogLevel, str], object], raised: list[BaseException]
) -> Callable[[int, bytes, object], None]:
    def on_log(level: int, message: bytes, _: object) -> None:
        try:
            log(LogLevel(level), _utf8(message))
        except BaseException as error:
            raised.append(error)

    return on_log


def _whole_or_0(number: int | None, argument: str, lowest: int, highest: int, allowed: str) -> int:
    """A whole number for C, where 0 is none."""
    return 0 if number is None else whole(number, argument, lowest, highest, allowed)


def _real_or_0(number: float | None, argument: str, allowed: str) -> float:
    """A number for C, where 0 is none."""
    if number is None:
        return 0.0
    if number == 0:
        raise bad_value(argument, number, allowed)
    return real(number, argument)


def _choice(choices: type[enum.IntEnum], argument: str, name: str) -> int:
    allowed = ", ".join(choices.__members__).lower()
    if not isinstance(name, str):
        raise bad_type(argument, name, allowed)
    member = choices.__members__.get(name.upper())
    if member is None:
        raise bad_value(argument, repr(name), allowed)
    return int(member)


def _kept(keep: Keep | int | _types.Keep | Iterable[_types.Keep]) -> int:
    """Bits of Keep, also from the words of vehicle_gaussians.reconstruct."""
    if isinstance(keep, int):
        return whole(keep, "keep", 0, int(~Keep(0)), "bits of Keep, 0 to 31")
    words = {member.lower().replace("_", "-"): bit for member, bit in Keep.__members__.items()}
    words["all"] = ~Keep(0)
    bits = Keep(0)
    for word in [keep] if isinstance(keep, str) else listed(keep, "keep"):
        if word not in words:
            raise bad_value("keep", repr(word), ", ".join(words))
        bits |= words[word]
    return int(bits)


def _name(name: str, argument: str) -> bytes:
    if not isinstance(name, str):
        raise bad_type(argument, name, "text")
    return name.encode()


def _lent_model(model: Model | None, argument: str) -> int | None:
    if model is not None and not isinstance(model, Model):
        raise bad_type(argument, model, "a Model")
    return None if model is None else model._as_parameter_


def _expect(array: Any, argument: str, way_out: str, *dtypes: npt.DTypeLike) -> None:
    if not isinstance(array, np.ndarray) or all(array.dtype != np.dtype(d) for d in dtypes):
        raise bad_type(argument, array, f"a NumPy array of {' or '.join(str(np.dtype(d)) for d in dtypes)}; {way_out}")


def _photograph(array: npt.NDArray[np.uint8], argument: str, alive: list[Any]) -> vg_image:
    _expect(array, argument, "floats of 0 to 1 become one by (255 * image).round().astype(np.uint8)", np.uint8)
    formats = {3: Format.RGB8, 4: Format.RGBA8}
    if array.ndim != 3 or array.shape[2] not in formats:
        raise bad_value(argument, f"shape {array.shape}", "(height, width, 3 or 4)")
    return _lent(array, formats[array.shape[2]], alive)


def _mask(array: npt.NDArray[Any], argument: str, alive: list[Any]) -> vg_image:
    _expect(array, argument, "others become one by a comparison: mask > 0.5", np.uint8, np.bool_)
    if array.dtype == np.bool_:
        array = np.where(array, np.uint8(255), np.uint8(0))
    return _plane(array, argument, Format.GRAY8, alive)


def _depth(array: _types.Floats, argument: str, alive: list[Any]) -> vg_image:
    allowed = "an array of floats, metres, (height, width); millimetres become one by depth.astype(np.float32) / 1000"
    return _plane(floats(array, argument, allowed), argument, Format.DEPTH32F, alive)


def _plane(array: npt.NDArray[Any], argument: str, format: Format, alive: list[Any]) -> vg_image:
    if array.ndim != 2:
        raise bad_value(argument, f"shape {array.shape}", "(height, width)")
    return _lent(array, format, alive)


def _measured(points: npt.ArrayLike, argument: str) -> npt.NDArray[np.float32]:
    """Points in metres, (n, 3), in row order."""
    array = floats(points, argument, "an array of floats, metres, (n, 3)")
    if array.ndim != 2 or array.shape[1] != 3:
        raise bad_value(argument, f"shape {array.shape}", "(n, 3)")
    return np.require(array, requirements=["C", "A"])


def _lent(array: npt.NDArray[Any], format: Format, alive: list[Any]) -> vg_image:
    """The pixels in place if each row is contiguous and rows run downwards; else a copy."""
    height, width = array.shape[:2]
    pixel = array.itemsize * (array.shape[2] if array.ndim == 3 else 1)
    together = array.strides[1:] == ((pixel, array.itemsize) if array.ndim == 3 else (pixel,))
    if not (together and array.strides[0] >= width * pixel):
        array = np.ascontiguousarray(array)
    alive.append(array)
    return vg_image(array.ctypes.data, array.strides[0], width, height, format, 0)


def segment(
    model: Model, image: npt.NDArray[np.uint8], camera: Camera, *, context: Context | None = None
) -> npt.NDArray[np.uint8]:
    """Computes the mask of a photograph by a segmentation network: uint8 (height, width), 255 is the vehicle.

    The image is RGB or RGBA and read in place; alpha is ignored.
    """
    _lent_model(model, "model")
    alive: list[Any] = []
    picture, posed, options = _photograph(image, "image", alive), _camera(camera), _initial(vg_segment_options)
    options.context = _lent_context(context)
    mask = np.empty((picture.height, picture.width), np.uint8)
    _call("vg_segment", model, ct.byref(picture), ct.byref(posed), ct.byref(options), mask.ctypes.data, 0)
    return mask


def _metrics_options(lpips: Model | None, f_score: float, context: Context | None) -> vg_metrics_options:
    options: vg_metrics_options = _initial(vg_metrics_options)
    options.context = _lent_context(context)
    options.lpips, options.f_score_m = _lent_model(lpips, "lpips"), real(f_score, "f_score")
    return options


def _measures(errors: ct.Structure) -> list[float | None]:
    """All fields except the size; NAN becomes None."""
    values = (getattr(errors, field[0]) for field in errors._fields_[1:])
    return [None if value != value else value for value in values]


def _picture(array: npt.NDArray[Any], argument: str, alive: list[Any]) -> vg_image:
    if isinstance(array, np.ndarray) and array.dtype == np.uint8:
        return _photograph(array, argument, alive)
    array = floats(array, argument, "a NumPy array of uint8 or floats, (height, width, 3) or (height, width, 4)")
    if array.ndim != 3 or array.shape[2] not in (3, 4):
        raise bad_value(argument, f"shape {array.shape}", "(height, width, 3 or 4)")
    if array.shape[2] == 3:
        array = np.concatenate([array, np.ones_like(array[..., :1])], axis=2)
    return _lent(array, Format.RGBA32F, alive)


def picture_errors(
    a: npt.NDArray[Any],
    b: npt.NDArray[Any],
    *,
    data_range: float | None = None,
    lpips: Model | None = None,
    context: Context | None = None,
) -> PictureErrors:
    """Measures the difference of two pictures of one size, uint8 or floats in [0, 1], (height, width, 3 or 4); the
    arguments are those of vehicle_gaussians.picture_errors.
    """
    alive: list[Any] = []
    a, b = in_range(a, data_range), in_range(b, data_range)
    pictures = _picture(a, "a", alive), _picture(b, "b", alive)
    options, errors = _metrics_options(lpips, 0.05, context), _initial(vg_picture_errors)
    _call("vg_metrics_pictures", *map(ct.byref, pictures), ct.byref(options), ct.byref(errors))
    return PictureErrors(*_measures(errors))  # type: ignore[arg-type]


def view_errors(
    gaussians: Gaussians,
    image: npt.NDArray[np.uint8],
    mask: npt.NDArray[Any] | None,
    camera: Camera,
    depth: _types.Floats | None = None,
    *,
    lpips: Model | None = None,
    context: Context | None = None,
) -> ViewErrors:
    """Measures the error of a model, drawn on white, against one photograph, which its mask composites on white."""
    alive: list[Any] = []
    view = _initial(vg_view)
    view.camera, view.image = _camera(camera), _photograph(image, "image", alive)
    if mask is not None:
        view.mask = _mask(mask, "mask", alive)
    if depth is not None:
        view.depth = _depth(depth, "depth", alive)
    options, errors = _metrics_options(lpips, 0.05, context), _initial(vg_view_errors)
    with _reporting(options, None):
        _call("vg_metrics_view", _lent_gaussians(gaussians), ct.byref(view), ct.byref(options), ct.byref(errors))
    return ViewErrors(*_measures(errors))  # type: ignore[arg-type]


def surface_errors(
    gaussians: Gaussians, points: _types.Floats, *, f_score: float = 0.05, context: Context | None = None
) -> SurfaceErrors:
    """Measures the error of a model's surface against points on the vehicle: float32 (n, 3), metres, its frame.

    f_score: the distance below which a point counts as correct, metres.
    """
    scan = _measured(points, "points")
    options, errors = _metrics_options(None, f_score, context), _initial(vg_surface_errors)
    lists = (_lent_gaussians(gaussians), scan.ctypes.data, len(scan))
    with _reporting(options, None):
        _call("vg_metrics_surface", *lists, ct.byref(options), ct.byref(errors))
    return SurfaceErrors(*_measures(errors))  # type: ignore[arg-type]


def _align_options(heading: _types.Heading, context: Context | None) -> vg_align_options:
    options: vg_align_options = _initial(vg_align_options)
    options.context = _lent_context(context)
    options.heading = _choice(Heading, "heading", heading)
    return options


def _alignment(found: vg_alignment) -> Alignment:
    matrix = np.array(found.vehicle_from_world).reshape(4, 4)
    residual_px, other_px = (None if value != value else value for value in (found.residual_px, found.other_px))
    return Alignment(matrix, found.scale, found.residual_m, found.confidence, residual_px, other_px, found.used_count)


def _masked_views(
    masks: Sequence[npt.NDArray[Any] | None], cameras: Sequence[Camera], names: Sequence[str] | None, alive: list[Any]
) -> ct.Array[vg_view]:
    masks, cameras = listed(masks, "masks", 2), listed(cameras, "cameras")
    names = None if names is None else listed(names, "names")
    for argument, entries in (("masks", masks), ("names", names)):
        if entries is not None and len(entries) != len(cameras):
            raise bad_value(argument, len(entries), f"one for each of {len(cameras)} cameras")
    views = (vg_view * len(cameras))()
    for i, (mask, camera) in enumerate(zip(masks, cameras, strict=True)):
        views[i] = _initial(vg_view)
        views[i].camera = _camera(camera, f"cameras[{i}]")
        views[i].name = _name(names[i] if names is not None else f"{i:03}", f"names[{i}]")
        if mask is not None:
            views[i].mask = _mask(mask, f"masks[{i}]", alive)
    return views


def _points(points: npt.ArrayLike | None, argument: str) -> npt.NDArray[np.float64]:
    """Points of any unit, (n, 3), in row order; empty for None."""
    array = np.zeros((0, 3)) if points is None else doubles(points, argument)
    if array.ndim != 2 or array.shape[1] != 3:
        raise bad_value(argument, f"shape {array.shape}", "(n, 3)")
    return np.require(array, requirements=["C", "A"])


def align_scan(
    masks: Sequence[npt.NDArray[Any] | None],
    cameras: Sequence[Camera],
    scan: _types.Floats,
    sparse: npt.ArrayLike | None = None,
    *,
    heading: _types.Heading = "auto",
    names: Sequence[str] | None = None,
    progress: Progress | None = None,
    context: Context | None = None,
) -> Alignment:
    """Finds the vehicle's frame from points scanned on it; the arguments are those of vehicle_gaussians.align_scan."""
    alive: list[Any] = []
    views, found = _masked_views(masks, cameras, names, alive), _initial(vg_alignment)
    world, scanned = _points(sparse, "sparse"), _measured(scan, "scan")
    lists = (views, len(views), world.ctypes.data, len(world), scanned.ctypes.data, len(scanned))
    options = _align_options(heading, context)
    with _reporting(options, progress):
        _call("vg_align_scan", *lists, ct.byref(options), ct.byref(found))
    return _alignment(found)


def align_box(
    masks: Sequence[npt.NDArray[Any] | None],
    cameras: Sequence[Camera],
    sparse: npt.ArrayLike,
    size: npt.ArrayLike,
    *,
    heading: Literal["forward", "backward"],
    names: Sequence[str] | None = None,
    progress: Progress | None = None,
    context: Context | None = None,
) -> Alignment:
    """Finds the vehicle's frame from its size and the ground; arguments are those of vehicle_gaussians.align_box."""
    alive: list[Any] = []
    views, found = _masked_views(masks, cameras, names, alive), _initial(vg_alignment)
    world, sides = _points(sparse, "sparse"), doubles(size, "size", (3,))
    lists = (views, len(views), world.ctypes.data, len(world), sides.ctypes.data)
    options = _align_options(heading, context)
    with _reporting(options, progress):
        _call("vg_align_box", *lists, ct.byref(options), ct.byref(found))
    return _alignment(found)


def align_points(world: npt.ArrayLike, vehicle: npt.ArrayLike) -> Alignment:
    """Finds the similarity from points known in both frames, as vehicle_gaussians.align_points."""
    source, target = _points(world, "world"), _points(vehicle, "vehicle")
    if len(source) != len(target):
        raise bad_value("vehicle", len(target), f"as many as world, {len(source)}")
    found, kept = _initial(vg_alignment), np.zeros(len(source), np.bool_)
    residuals = np.empty(len(source))
    lists = (source.ctypes.data, target.ctypes.data, len(source))
    _call("vg_align_points", *lists, ct.byref(found), kept.ctypes.data, residuals.ctypes.data)
    return _alignment(found)._replace(kept=kept, residuals_m=residuals)


def align_folder(
    path: str | os.PathLike[str],
    scan: str | os.PathLike[str] | None = None,
    *,
    heading: _types.Heading = "auto",
    progress: Progress | None = None,
    context: Context | None = None,
) -> Alignment:
    """Runs align_scan on the files of a scene; the arguments are those of vehicle_gaussians.align_folder."""
    found, file = _initial(vg_alignment), None if scan is None else os.fsencode(scan)
    options = _align_options(heading, context)
    with _reporting(options, progress):
        _call("vg_align_folder", os.fsencode(path), file, ct.byref(options), ct.byref(found))
    return _alignment(found)


@equal_by_value
class Scene(NamedTuple):
    """Views of one vehicle, one list entry each; the arrays are read-only views of the library's memory."""

    images: list[npt.NDArray[np.uint8]]
    """RGB, uint8 (height, width, 3)."""
    masks: list[npt.NDArray[np.uint8] | None]
    """255 is vehicle, (height, width); None where there is no mask."""
    depths: list[npt.NDArray[np.float32] | None]
    """Metres along the optical axis, 0 for none, float32 (height, width); None where there is no depth map."""
    cameras: list[vg_camera]
    """Posed in the vehicle's frame."""
    names: list[str]
    """The pictures' paths below their images folder."""


def open_scene(
    path: str | os.PathLike[str],
    views: str | Iterable[str] | None = None,
    vehicle_from_world: npt.ArrayLike | None = None,
    *,
    depth_scale: float | None = None,
    load_depth: bool = True,
    progress: Progress | None = None,
    context: Context | None = None,
) -> Scene:
    """Opens a transforms.json, a folder that holds one, or a COLMAP folder; the arguments are those of
    vehicle_gaussians.open_scene. Legal input that looks like a mistake is reported as a warning."""
    options = _initial(vg_scene_options)
    options.context = _lent_context(context)
    world = _similarity(vehicle_from_world)
    options.vehicle_from_world = _address(world)
    asked = [] if views is None else [views] if isinstance(views, str) else listed(views, "views")
    wanted = [_name(name, f"views[{i}]") for i, name in enumerate(asked)]
    names = (ct.c_char_p * len(wanted))(*wanted)
    if wanted:
        options.names, options.name_count = names, len(wanted)
    options.depth_scale, options.load_depth = real(depth_scale or 0.0, "depth_scale"), load_depth
    notes: list[str] = []
    path = Path(path)
    has_transforms = path.is_file() or (path / "transforms.json").is_file()
    made = ct.c_void_p()
    name = "vg_transforms_open" if has_transforms else "vg_colmap_open"
    with _reporting(options, progress) as raised:
        options.log = LogFn(_logger(lambda _, note: notes.append(note), raised))
        _call(name, os.fsencode(path), ct.byref(options), ct.byref(made))
        handle = _Handle("scene", made)
    for note in notes:
        warn(note)

    scene = Scene([], [], [], [], [])
    for i in range(library.vg_scene_view_count(handle)):
        view = _initial(vg_view)
        _call("vg_scene_get_view", handle, i, ct.byref(view))
        size = (view.camera.height, view.camera.width)
        scene.images.append(handle.array(view.image.data, (*size, 3), np.uint8))
        scene.masks.append(handle.array(view.mask.data, size, np.uint8) if view.mask.data else None)
        scene.depths.append(handle.array(view.depth.data, size, np.float32) if view.depth.data else None)
        scene.cameras.append(vg_camera.from_buffer_copy(view.camera))
        scene.names.append(_utf8(view.name))
    return scene


def evaluate(
    gaussians: Gaussians,
    scene: Scene | str | os.PathLike[str],
    views: str | Iterable[str] | None = None,
    vehicle_from_world: npt.ArrayLike | None = None,
    *,
    lpips: Model | None = None,
    progress: Progress | None = None,
    context: Context | None = None,
) -> list[ViewScore]:
    """Measures the errors of a model in every view of a scene, one row for each; the arguments are those of
    vehicle_gaussians.evaluate."""
    if not isinstance(scene, Scene):
        scene = open_scene(scene, views, vehicle_from_world, context=context)
    elif views is not None or vehicle_from_world is not None:
        raise bad_value("views, vehicle_from_world", "given with an open scene", "with a path")
    return rows(scene, lambda *view: view_errors(gaussians, *view, lpips=lpips, context=context), progress)
