"""The library through ctypes alone: the C interface of ``include/vg.h``, and thin functions over it.

For environments that load shared libraries but no extension modules, for other versions of the library, and as the
model of a binding in any language. It gives the same bytes as the package itself.

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
import signal
import sys
import threading
import warnings
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import FrameType
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from ._alignment import Alignment
from ._errors import Status, VgError
from ._gradients import Gradients, Planes
from ._measures import PictureErrors, SurfaceErrors, ViewErrors

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


class vg_segment_options(ct.Structure):
    _fields_ = (("struct_size", ct.c_size_t), ("context", ct.c_void_p), ("flags", ct.c_uint64))


class vg_metrics_options(ct.Structure):
    _fields_ = (
        ("struct_size", ct.c_size_t),
        ("context", ct.c_void_p),
        ("lpips", ct.c_void_p),
        ("f_score_m", ct.c_double),
        ("flags", ct.c_uint64),
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
    )


_handle: Any = ct.c_void_p
_out: Any = ct.POINTER(ct.c_void_p)
_numbers: Any = ct.c_void_p
_size: Any = ct.c_size_t
_text: Any = ct.c_char_p
_u32: Any = ct.c_uint32
_i32: Any = ct.c_int32


def _pointer(structure: type[ct.Structure]) -> Any:
    return ct.POINTER(structure)


#: Result and arguments of every function of the header; handles and arrays are void pointers here.
PROTOTYPES: Mapping[str, tuple[Any, tuple[Any, ...]]] = {
    "vg_version": (_text, ()),
    "vg_abi_version": (_u32, ()),
    "vg_error_code": (_i32, (_handle,)),
    "vg_error_message": (_text, (_handle,)),
    "vg_error_free": (None, (_handle,)),
    "vg_context_options_init": (_i32, (_pointer(vg_context_options), _size)),
    "vg_context_new": (_i32, (_pointer(vg_context_options), _out, _out)),
    "vg_context_threads": (_u32, (_handle,)),
    "vg_context_free": (None, (_handle,)),
    "vg_camera_init": (_i32, (_pointer(vg_camera), _size)),
    "vg_camera_from_colmap_model": (_i32, (_i32, _numbers, _size, _u32, _u32, _numbers, _pointer(vg_camera), _out)),
    "vg_camera_from_opencv": (
        _i32,
        (_numbers, _numbers, _size, _i32, _u32, _u32, _numbers, _pointer(vg_camera), _out),
    ),
    "vg_camera_scale": (_i32, (_pointer(vg_camera), _u32, _u32, _pointer(vg_camera), _out)),
    "vg_camera_crop": (_i32, (_pointer(vg_camera), _u32, _u32, _u32, _u32, _pointer(vg_camera), _out)),
    "vg_pose_from_colmap": (_i32, (_numbers, _numbers, _numbers, _numbers, _out)),
    "vg_pose_from_opengl": (_i32, (_numbers, _numbers, _numbers, _out)),
    "vg_pose_from_box": (_i32, (_numbers, _numbers, _numbers, _out)),
    "vg_camera_project": (_i32, (_pointer(vg_camera), _numbers, _numbers, _out)),
    "vg_view_init": (_i32, (_pointer(vg_view), _size)),
    "vg_model_options_init": (_i32, (_pointer(vg_model_options), _size)),
    "vg_model_open": (_i32, (_text, _pointer(vg_model_options), _out, _out)),
    "vg_model_free": (None, (_handle,)),
    "vg_options_init": (_i32, (_pointer(vg_options), _size)),
    "vg_report_figures_init": (_i32, (_pointer(vg_report_figures), _size)),
    "vg_report_get_figures": (_i32, (_handle, _pointer(vg_report_figures), _out)),
    "vg_report_json": (_text, (_handle,)),
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
    "vg_gaussians_free": (None, (_handle,)),
    "vg_reconstruct": (_i32, (_pointer(vg_view), _size, _pointer(vg_options), _out, _out, _out)),
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
    said = "VG_LIBRARY names it. " if os.environ.get("VG_LIBRARY") else ""
    if not path.is_file():
        raise ImportError(f"{path}: there is no such library. {said}{hints}")
    try:
        loaded = ct.CDLL(str(path))
    except OSError as error:
        raise ImportError(f"{path}: cannot be loaded: {error}. {said}{hints}") from error
    missing = [name for name in PROTOTYPES if not hasattr(loaded, name)]
    if "vg_abi_version" in missing:
        raise ImportError(f"{path}: not a libvg: it has no vg_abi_version. {said}{hints}")
    found = loaded.vg_abi_version()
    if found != ABI_VERSION:
        raise ImportError(f"{path}: has binary interface {found}; this module needs {ABI_VERSION}. {said}{hints}")
    if missing:
        raise ImportError(f"{path}: older than this module: it has no {', '.join(missing)}. {said}{hints}")
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
    """Calls a function whose last argument is out_error; a failure is a VgError."""
    error = ct.c_void_p()
    status = getattr(library, name)(*arguments, ct.byref(error))
    if status != Status.OK:
        message = _utf8(library.vg_error_message(error))
        library.vg_error_free(error)
        raise VgError(status, message)


def _initial(structure: type[ct.Structure]) -> Any:
    """A structure with its default values."""
    made = structure()
    status = getattr(library, structure.__name__ + "_init")(ct.byref(made), ct.sizeof(made))
    if status != Status.OK:
        raise VgError(status, f"{structure.__name__}_init failed")
    return made


class _Handle:
    """An object of the library, freed when nobody refers to it any more."""

    def __init__(self, name: str, pointer: ct.c_void_p) -> None:
        self._as_parameter_ = pointer.value
        free = getattr(library, f"vg_{name}_free")
        # At the end of the process the system takes the memory; arrays may still look at it.
        weakref.finalize(self, free, pointer.value).atexit = False

    def array(self, address: int | None, shape: tuple[int, ...], dtype: npt.DTypeLike) -> npt.NDArray[Any]:
        """A read-only view of memory of this object, which it keeps alive."""
        if not address:
            return np.zeros(shape, dtype)
        memory: Any = (ct.c_uint8 * (int(np.prod(shape)) * np.dtype(dtype).itemsize)).from_address(address)
        memory.owner = self
        return np.frombuffer(memoryview(memory).toreadonly(), dtype).reshape(shape)


class Context(_Handle):
    """Worker threads and memory for calls that follow each other; 0 threads means one per core."""

    def __init__(self, threads: int = 0) -> None:
        options = _initial(vg_context_options)
        options.threads = threads
        made = ct.c_void_p()
        _call("vg_context_new", ct.byref(options), ct.byref(made))
        super().__init__("context", made)

    @property
    def threads(self) -> int:
        return int(library.vg_context_threads(self))


class Model(_Handle):
    """A network in an ONNX file, for prior_model and head_model of reconstruct; the arguments are those of
    vehicle_gaussians.Model. Any number of threads may use one at a time."""

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
        options.fall_back, options.threads, options.arena = fall_back, threads, arena
        options.prepack = {None: Prepack.AUTO, True: Prepack.ALWAYS, False: Prepack.NEVER}[prepack]
        made = ct.c_void_p()
        _call("vg_model_open", os.fsencode(path), ct.byref(options), ct.byref(made))
        super().__init__("model", made)
        #: The file.
        self.path = Path(path)

    def __repr__(self) -> str:
        return f"Model({str(self.path)!r})"


class AnyCamera(Protocol):
    """What vehicle_gaussians.Camera offers."""

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
    """A camera of one of COLMAP's models; the pose is 3x4 or 4x4."""
    number = CameraModel.__members__.get(model, -1) if isinstance(model, str) else model
    values, pose, made = _doubles(params), _pose(vehicle_from_camera), vg_camera()
    _call(
        "vg_camera_from_colmap_model",
        *(number, values.ctypes.data, values.size, width, height, pose.ctypes.data, ct.byref(made)),
    )
    return made


def camera_from_opencv(
    K: npt.ArrayLike,
    vehicle_from_camera: npt.ArrayLike,
    width: int,
    height: int,
    distortion: npt.ArrayLike = (),
    *,
    fisheye: bool = False,
) -> vg_camera:
    """A camera of OpenCV's calibration, which puts the centre of the top-left pixel at (0, 0)."""
    k, bent, pose, made = _doubles(K, (3, 3)), _doubles(distortion), _pose(vehicle_from_camera), vg_camera()
    _call(
        "vg_camera_from_opencv",
        *(k.ctypes.data, bent.ctypes.data, bent.size, fisheye, width, height, pose.ctypes.data, ct.byref(made)),
    )
    return made


def pose_from_colmap(
    qvec: npt.ArrayLike, tvec: npt.ArrayLike, vehicle_from_world: npt.ArrayLike | None = None
) -> npt.NDArray[np.float64]:
    """vehicle_from_camera (4x4) of COLMAP's world-to-camera quaternion (w, x, y, z) and translation."""
    q, t, world = _doubles(qvec, (4,)), _doubles(tvec, (3,)), _optional_doubles(vehicle_from_world, (4, 4))
    pose = np.eye(4)
    _call("vg_pose_from_colmap", q.ctypes.data, t.ctypes.data, _address(world), pose.ctypes.data)
    return pose


def pose_from_opengl(
    camera_to_world: npt.ArrayLike, vehicle_from_world: npt.ArrayLike | None = None
) -> npt.NDArray[np.float64]:
    """vehicle_from_camera (4x4) of a camera-to-world matrix with OpenGL's camera axes, as nerfstudio writes it."""
    matrix, world = _pose(camera_to_world), _optional_doubles(vehicle_from_world, (4, 4))
    pose = np.eye(4)
    _call("vg_pose_from_opengl", matrix.ctypes.data, _address(world), pose.ctypes.data)
    return pose


def pose_from_box(ego_from_vehicle: npt.ArrayLike, ego_from_camera: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """vehicle_from_camera (4x4) of a tracked box and the camera in one frame."""
    vehicle, camera, pose = _pose(ego_from_vehicle), _pose(ego_from_camera), np.eye(4)
    _call("vg_pose_from_box", vehicle.ctypes.data, camera.ctypes.data, pose.ctypes.data)
    return pose


def _doubles(values: npt.ArrayLike, shape: tuple[int, ...] | None = None) -> npt.NDArray[np.float64]:
    array = np.ascontiguousarray(values, dtype=np.float64)
    if shape is not None and array.shape != shape:
        raise VgError(Status.ARGUMENT, f"an array of shape {array.shape}; allowed: {shape}")
    return array


def _optional_doubles(values: npt.ArrayLike | None, shape: tuple[int, ...]) -> npt.NDArray[np.float64] | None:
    return None if values is None else _doubles(values, shape)


def _address(array: npt.NDArray[Any] | None) -> int | None:
    return None if array is None else array.ctypes.data


def _pose(matrix: npt.ArrayLike) -> npt.NDArray[np.float64]:
    array = _doubles(matrix)
    if array.shape not in ((3, 4), (4, 4)) or (array.shape == (4, 4) and array[3].tolist() != [0, 0, 0, 1]):
        raise VgError(Status.ARGUMENT, f"a pose of shape {array.shape}; allowed: 3x4, or 4x4 with last row 0 0 0 1")
    return array


def _camera(camera: Camera) -> vg_camera:
    if isinstance(camera, vg_camera):
        return camera
    try:
        members = (camera.model, camera.width, camera.height, camera.params, camera.vehicle_from_camera)
    except AttributeError:
        raise TypeError(f"camera: {type(camera).__name__}; allowed: a vg_camera, or a Camera") from None
    return camera_from_colmap(*members)


class Gaussians:
    """The Gaussians of a vehicle. They do not change; arrays are read-only views that keep them alive."""

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
        means: npt.NDArray[np.float32],
        scales: npt.NDArray[np.float32],
        quats: npt.NDArray[np.float32],
        opacities: npt.NDArray[np.float32],
        sh: npt.NDArray[np.float32],
    ) -> Gaussians:
        """Copies float32 arrays of shapes (n, 3), (n, 3), (n, 4), (n,) and (n, (degree + 1)^2, 3)."""
        n, coefficients = len(means), sh.shape[1] if sh.ndim == 3 else -1
        degree = {1: 0, 4: 1, 9: 2, 16: 3}.get(coefficients, -1)
        arrays = _initial(vg_gaussian_arrays)
        alive = []
        shapes = {
            "positions": (n, 3),
            "scales": (n, 3),
            "rotations": (n, 4),
            "opacities": (n,),
            "sh": (n, coefficients, 3),
        }
        for (field, shape), array in zip(shapes.items(), (means, scales, quats, opacities, sh), strict=True):
            _expect(array, field, np.float32)
            if array.shape != shape:
                raise VgError(Status.ARGUMENT, f"{field}: shape {array.shape}; allowed: {shape}")
            alive.append(np.ascontiguousarray(array))
            setattr(arrays, field, alive[-1].ctypes.data)
        arrays.count, arrays.sh_degree = n, degree
        return cls._made_by("vg_gaussians_from_arrays", ct.byref(arrays))

    def save_ply(self, path: str | os.PathLike[str]) -> None:
        """Writes a PLY file in the layout of 3D Gaussian Splatting."""
        _call("vg_gaussians_save_ply", self._handle, os.fsencode(path))

    def mirrored(self) -> Gaussians:
        """The mirror image across the plane of symmetry, y = 0."""
        return self._made_by("vg_gaussians_mirror", self._handle)

    def transformed(self, to_from_vehicle: npt.ArrayLike) -> Gaussians:
        """These in another frame, moved by a 4x4 similarity."""
        matrix = _doubles(to_from_vehicle, (4, 4))
        return self._made_by("vg_gaussians_transform", self._handle, matrix.ctypes.data)

    def merged(self, other: Gaussians) -> Gaussians:
        """These, then those of other."""
        return self._made_by("vg_gaussians_merge", self._handle, other._handle)

    def render(
        self,
        camera: Camera,
        background: str | Sequence[float] = "white",
        *,
        dtype: npt.DTypeLike = np.uint8,
        antialiased: bool = False,
        context: Context | None = None,
    ) -> npt.NDArray[Any]:
        """The picture a camera takes, RGB, or RGBA with straight alpha on a "transparent" background."""
        return self._draw(camera, background, np.dtype(dtype), antialiased, context, with_depth=False)[0]

    def render_with_depth(
        self,
        camera: Camera,
        background: str | Sequence[float] = "white",
        *,
        dtype: npt.DTypeLike = np.uint8,
        antialiased: bool = False,
        context: Context | None = None,
    ) -> tuple[npt.NDArray[Any], npt.NDArray[np.float32]]:
        """The picture, and its depth in metres, 0 where there is nothing."""
        picture, depth = self._draw(camera, background, np.dtype(dtype), antialiased, context, with_depth=True)
        assert depth is not None
        return picture, depth

    def _draw(
        self,
        camera: Camera,
        background: str | Sequence[float],
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
            raise TypeError(f"dtype: {dtype}; allowed: uint8 or float32")
        size = (posed.height, posed.width)
        picture = np.empty((*size, channels), dtype)
        depth = np.empty(size, np.float32) if with_depth else None
        target.width, target.height = posed.width, posed.height
        target.color, target.depth = picture.ctypes.data, _address(depth)
        _call("vg_render", self._handle, ct.byref(posed), ct.byref(options), ct.byref(target))
        return (picture[..., :3] if opaque else picture), depth

    def render_planes(
        self,
        camera: Camera,
        background: str | Sequence[float] = "white",
        *,
        antialiased: bool = False,
        depth_mode: Literal["expected", "accumulated"] = "expected",
        backend: Literal["auto", "cpu", "gpu"] = "auto",
        context: Context | None = None,
    ) -> Planes:
        """The picture as losses look at it: colour over the background or premultiplied, alpha, and depth."""
        posed, target = _camera(camera), _initial(vg_image_target)
        options = _render_options(background, antialiased, context)
        options.alpha, options.depth_mode = Alpha.PREMULTIPLIED, _choice(DepthMode, "depth_mode", depth_mode)
        options.backend = _choice(Backend, "backend", backend)
        size = (posed.height, posed.width)
        picture, alpha, depth = np.empty((*size, 4), np.float32), np.empty(size, np.float32), np.empty(size, np.float32)
        target.width, target.height, target.color_format = posed.width, posed.height, Format.RGBA32F
        target.color, target.alpha, target.depth = picture.ctypes.data, alpha.ctypes.data, depth.ctypes.data
        _call("vg_render", self._handle, ct.byref(posed), ct.byref(options), ct.byref(target))
        return Planes(np.ascontiguousarray(picture[..., :3]), alpha, depth)

    def render_backward(
        self,
        camera: Camera,
        color: npt.NDArray[np.float32] | None = None,
        alpha: npt.NDArray[np.float32] | None = None,
        depth: npt.NDArray[np.float32] | None = None,
        background: str | Sequence[float] = "white",
        *,
        antialiased: bool = False,
        depth_mode: Literal["expected", "accumulated"] = "expected",
        backend: Literal["auto", "cpu", "gpu"] = "auto",
        context: Context | None = None,
    ) -> Gradients:
        """Gradients of everything a picture is made of, from those of a loss with respect to its planes; the arguments
        are those of vehicle_gaussians.Gaussians.render_backward. Planes are read where they are."""
        posed, gradient, out = _camera(camera), _initial(vg_image_gradient), _initial(vg_gradients)
        options = _render_options(background, antialiased, context)
        options.alpha, options.depth_mode = Alpha.PREMULTIPLIED, _choice(DepthMode, "depth_mode", depth_mode)
        options.backend = _choice(Backend, "backend", backend)
        gradient.width, gradient.height = size = (posed.width, posed.height)
        alive: list[Any] = []
        for name, array, channels in (("color", color, (3,)), ("alpha", alpha, ()), ("depth", depth, ())):
            if array is None:
                continue
            _expect(array, name, np.float32)
            if array.shape != (*size[::-1], *channels):
                raise VgError(Status.ARGUMENT, f"{name}: shape {array.shape}; allowed: {(*size[::-1], *channels)}")
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

    def __repr__(self) -> str:
        return f"Gaussians({len(self)}, sh_degree={self.sh_degree})"


class Renderer(_Handle):
    """Gaussians made ready to be drawn many times: backend is "auto", "cpu" or "gpu". Any number of threads may use one
    at a time."""

    def __init__(
        self,
        gaussians: Gaussians,
        backend: Literal["auto", "cpu", "gpu"] = "auto",
        context: Context | None = None,
    ) -> None:
        options = _initial(vg_renderer_options)
        options.backend = _choice(Backend, "backend", backend)
        options.context = None if context is None else context._as_parameter_
        made = ct.c_void_p()
        _call("vg_renderer_new", gaussians._handle, ct.byref(options), ct.byref(made))
        super().__init__("renderer", made)

    @property
    def backend(self) -> str:
        """Who draws: "cpu" or "gpu"."""
        return Backend(library.vg_renderer_backend(self)).name.lower()

    @property
    def choice(self) -> str:
        """Who draws, and why."""
        return _utf8(library.vg_renderer_choice(self))

    def render(
        self,
        cameras: Sequence[Camera],
        background: str | Sequence[float] = "white",
        *,
        antialiased: bool = False,
        context: Context | None = None,
    ) -> npt.NDArray[np.uint8]:
        """Pictures of cameras of one size: uint8 (n, height, width, 3), or 4 with straight alpha on a "transparent"
        background."""
        posed = [_camera(camera) for camera in cameras]
        if len({(camera.width, camera.height) for camera in posed}) != 1:
            raise VgError(Status.ARGUMENT, f"cameras: {len(posed)} of several sizes or none; allowed: of one size")
        options = _render_options(background, antialiased, context)
        opaque = options.background == Background.COLOR
        format, channels = (Format.RGB8, 3) if opaque else (Format.RGBA8, 4)
        pictures = np.empty((len(posed), posed[0].height, posed[0].width, channels), np.uint8)
        targets = (vg_image_target * len(posed))(*[_initial(vg_image_target) for _ in posed])
        for target, camera, picture in zip(targets, posed, pictures, strict=True):
            target.width, target.height = camera.width, camera.height
            target.color, target.color_format = picture.ctypes.data, format
        array = (vg_camera * len(posed))(*posed)
        _call("vg_renderer_render", self, array, len(posed), ct.byref(options), targets)
        return pictures


def _render_options(background: str | Sequence[float], antialiased: bool, context: Context | None) -> vg_render_options:
    options: vg_render_options = _initial(vg_render_options)
    options.context = None if context is None else context._as_parameter_
    options.antialiased = antialiased
    if isinstance(background, str) and background == "transparent":
        options.background = Background.TRANSPARENT
        return options
    named: dict[Any, Sequence[float]] = {"white": (1, 1, 1), "black": (0, 0, 0)}
    color = named.get(background, ()) if isinstance(background, str) else background
    if len(color) != 3:
        allowed = "white, black, transparent, or (r, g, b) from 0 to 1"
        raise VgError(Status.ARGUMENT, f"background: {background!r}; allowed: {allowed}")
    options.background_color[:] = color
    return options


class Points(NamedTuple):
    """The metric coloured point cloud."""

    #: Metres, float32 (n, 3).
    positions: npt.NDArray[np.float32]
    #: sRGB, uint8 (n, 3).
    colors: npt.NDArray[np.uint8]


class Reconstruction(NamedTuple):
    """A finished reconstruction."""

    gaussians: Gaussians
    report: dict[str, Any]
    points: Points | None


def reconstruct(
    images: Iterable[npt.NDArray[np.uint8]],
    masks: Iterable[npt.NDArray[np.bool_] | npt.NDArray[np.uint8] | None] | None,
    cameras: Iterable[Camera],
    depths: Iterable[npt.NDArray[np.float32] | None] | None = None,
    *,
    prior: Literal["auto", "given", "hull", "shape", "onnx"] = "auto",
    prior_model: Model | None = None,
    head_model: Model | None = None,
    calibrate: Literal["auto", "off"] = "auto",
    symmetry: Literal["auto", "always", "never", "flip"] = "auto",
    relight: Literal["auto", "never"] = "auto",
    photo: bool = True,
    cloud: npt.NDArray[np.float32] | None = None,
    vehicle_size: Sequence[float] | None = None,
    sh_degree: int = 2,
    keep: Keep | int = 0,
    check: bool = True,
    points: bool = False,
    budget: float | None = None,
    resolution: float = 1.0,
    max_views: int | None = None,
    max_gaussians: int | None = 12_000_000,
    refine_iterations: int | None = None,
    refine_seconds: float | None = None,
    refine_hold_out: bool = False,
    refine_backend: Literal["auto", "cpu", "gpu"] = "auto",
    names: Iterable[str] | None = None,
    progress: Callable[[str, float], object] | None = None,
    log: Callable[[LogLevel, str], object] | None = None,
    context: Context | None = None,
) -> Reconstruction:
    """Reconstructs the vehicle that the photographs show; the arguments are those of vehicle_gaussians.reconstruct.

    Pictures whose pixels lie together are read where they are, whatever lies between their rows.
    """
    images, cameras = list(images), list(cameras)
    n = len(images)
    columns: dict[str, list[Any]] = {
        "cameras": cameras,
        "masks": [None] * n if masks is None else list(masks),
        "depths": [None] * n if depths is None else list(depths),
        "names": [f"{i:03}" for i in range(n)] if names is None else list(names),
    }
    for argument, column in columns.items():
        if len(column) != n:
            raise VgError(Status.ARGUMENT, f"{argument}: {len(column)} entries; allowed: {n}, one per image")
    alive: list[Any] = []
    views = (vg_view * n)()
    for i, image in enumerate(images):
        views[i] = _initial(vg_view)
        views[i].name = columns["names"][i].encode()
        views[i].camera = _camera(cameras[i])
        views[i].image = _photograph(image, f"images[{i}]", alive)
        if columns["masks"][i] is not None:
            views[i].mask = _mask(columns["masks"][i], f"masks[{i}]", alive)
        if columns["depths"][i] is not None:
            views[i].depth = _plane(columns["depths"][i], f"depths[{i}]", np.float32, Format.DEPTH32F, alive)

    options = _initial(vg_options)
    options.context = None if context is None else context._as_parameter_
    options.prior, options.symmetry = _choice(Prior, "prior", prior), _choice(Symmetry, "symmetry", symmetry)
    # Referred to by this call's arguments until it returns.
    options.prior_model = _lent_model(prior_model, "prior_model")
    options.head_model = _lent_model(head_model, "head_model")
    options.calibrate = _choice(Calibrate, "calibrate", calibrate)
    options.relight, options.photo = _choice(Relight, "relight", relight), photo
    if budget is not None:
        # Of C, 0 is none.
        if budget == 0:
            raise VgError(Status.ARGUMENT, f"budget: {budget}; allowed: seconds above 0")
        options.budget_s = budget
    options.resolution = resolution
    if max_views is not None:
        # Of C, 0 is all.
        if max_views < 1:
            raise VgError(Status.ARGUMENT, f"max_views: {max_views}; allowed: at least 1")
        options.max_views = max_views
    # Of C, 0 is any number.
    if max_gaussians is not None and max_gaussians < 1:
        raise VgError(Status.ARGUMENT, f"max_gaussians: {max_gaussians}; allowed: at least 1")
    options.max_gaussians = max_gaussians or 0
    if refine_iterations is not None:
        # Of C, 0 is none.
        if not 1 <= refine_iterations < 1 << 32:
            allowed = "1 to 1000000"
            raise VgError(Status.ARGUMENT, f"refine_iterations: {refine_iterations}; allowed: {allowed}")
        options.refine_iterations = refine_iterations
    if refine_seconds is not None:
        if refine_seconds == 0:
            raise VgError(Status.ARGUMENT, f"refine_seconds: {refine_seconds}; allowed: above 0, at most 86400")
        options.refine_seconds = refine_seconds
    options.refine_hold_out = refine_hold_out
    options.refine_backend = _choice(Backend, "refine_backend", refine_backend)
    if cloud is not None:
        _expect(cloud, "cloud", np.float32)
        if cloud.ndim != 2 or cloud.shape[1] != 3:
            raise VgError(Status.ARGUMENT, f"cloud: shape {cloud.shape}; allowed: (n, 3)")
        alive.append(np.require(cloud, requirements=["C", "A"]))
        options.cloud, options.cloud_count = alive[-1].ctypes.data, len(cloud)
    options.sh_degree, options.keep, options.check, options.points = sh_degree, keep, check, points
    options.vehicle_size[:] = (0, 0, 0) if vehicle_size is None else vehicle_size
    raised: list[BaseException] = []

    def on_progress(stage: bytes, fraction: float, _: object) -> int:
        try:
            return int(bool(raised) or (progress is not None and bool(progress(stage.decode(), fraction))))
        except BaseException as error:
            raised.append(error)
            return 1

    # Always there: between two calls of it Python cannot see Ctrl-C.
    options.progress = ProgressFn(on_progress)
    options.log = LogFn(_logger(log, raised)) if log is not None else LogFn()
    car, report = ct.c_void_p(), ct.c_void_p()
    try:
        with _signals_kept(raised):
            _call("vg_reconstruct", views, n, ct.byref(options), ct.byref(car), ct.byref(report))
    except VgError:
        if not raised:
            raise
    gaussians, told = Gaussians(_Handle("gaussians", car)), _Handle("report", report)
    if raised:
        raise raised[0]
    lifted = None
    if points:
        count = int(library.vg_report_point_count(told))
        lifted = Points(
            told.array(library.vg_report_point_positions(told), (count, 3), np.float32),
            told.array(library.vg_report_point_colors(told), (count, 3), np.uint8),
        )
    return Reconstruction(gaussians, json.loads(library.vg_report_json(told)), lifted)


@contextlib.contextmanager
def _signals_kept(raised: list[BaseException]) -> Iterator[None]:
    """Keeps what the handler of Ctrl-C raises: in a callback, ctypes would print it and forget it."""
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


def _choice(choices: type[enum.IntEnum], argument: str, name: str) -> int:
    member = choices.__members__.get(name.upper())
    if member is None:
        allowed = ", ".join(choices.__members__).lower()
        raise VgError(Status.ARGUMENT, f"{argument}: {name!r}; allowed: {allowed}")
    return int(member)


def _lent_model(model: Model | None, argument: str) -> int | None:
    if model is not None and not isinstance(model, Model):
        raise TypeError(f"{argument}: {type(model).__name__}; allowed: a Model")
    return None if model is None else model._as_parameter_


def _expect(array: Any, argument: str, *dtypes: npt.DTypeLike) -> None:
    if not isinstance(array, np.ndarray) or all(array.dtype != np.dtype(d) for d in dtypes):
        found = f"array of {array.dtype}" if isinstance(array, np.ndarray) else type(array).__name__
        allowed = " or ".join(str(np.dtype(d)) for d in dtypes)
        raise TypeError(f"{argument}: {found}; allowed: a NumPy array of {allowed}")


def _photograph(array: npt.NDArray[np.uint8], argument: str, alive: list[Any]) -> vg_image:
    _expect(array, argument, np.uint8)
    formats = {3: Format.RGB8, 4: Format.RGBA8}
    if array.ndim != 3 or array.shape[2] not in formats:
        raise VgError(Status.ARGUMENT, f"{argument}: shape {array.shape}; allowed: (height, width, 3 or 4)")
    return _lent(array, formats[array.shape[2]], alive)


def _mask(array: npt.NDArray[Any], argument: str, alive: list[Any]) -> vg_image:
    _expect(array, argument, np.uint8, np.bool_)
    if array.dtype == np.bool_:
        array = np.where(array, np.uint8(255), np.uint8(0))
    return _plane(array, argument, np.uint8, Format.GRAY8, alive)


def _plane(array: npt.NDArray[Any], argument: str, dtype: npt.DTypeLike, format: Format, alive: list[Any]) -> vg_image:
    _expect(array, argument, dtype)
    if array.ndim != 2:
        raise VgError(Status.ARGUMENT, f"{argument}: shape {array.shape}; allowed: (height, width)")
    return _lent(array, format, alive)


def _lent(array: npt.NDArray[Any], format: Format, alive: list[Any]) -> vg_image:
    """The pixels where they are, if they lie together and rows follow each other downwards; else a copy."""
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
    """The mask of a photograph that has none, by a segmentation network: uint8 (height, width), 255 is the vehicle.

    The image is RGB or RGBA and read where it is; alpha is not looked at.
    """
    _lent_model(model, "model")
    alive: list[Any] = []
    picture, posed, options = _photograph(image, "image", alive), _camera(camera), _initial(vg_segment_options)
    options.context = None if context is None else context._as_parameter_
    mask = np.empty((picture.height, picture.width), np.uint8)
    _call("vg_segment", model, ct.byref(picture), ct.byref(posed), ct.byref(options), mask.ctypes.data, 0)
    return mask


def _metrics_options(lpips: Model | None, f_score: float, context: Context | None) -> vg_metrics_options:
    options: vg_metrics_options = _initial(vg_metrics_options)
    options.context = None if context is None else context._as_parameter_
    options.lpips, options.f_score_m = _lent_model(lpips, "lpips"), f_score
    return options


def _measures(errors: ct.Structure) -> list[float | None]:
    """All fields but the size; NAN is None."""
    values = (getattr(errors, field[0]) for field in errors._fields_[1:])
    return [None if value != value else value for value in values]


def _picture(array: npt.NDArray[Any], argument: str, alive: list[Any]) -> vg_image:
    _expect(array, argument, np.uint8, np.float32)
    if array.dtype == np.uint8:
        return _photograph(array, argument, alive)
    if array.ndim != 3 or array.shape[2] not in (3, 4):
        raise VgError(Status.ARGUMENT, f"{argument}: shape {array.shape}; allowed: (height, width, 3 or 4)")
    if array.shape[2] == 3:
        array = np.concatenate([array, np.ones_like(array[..., :1])], axis=2)
    return _lent(array, Format.RGBA32F, alive)


def picture_errors(
    a: npt.NDArray[Any], b: npt.NDArray[Any], *, lpips: Model | None = None, context: Context | None = None
) -> PictureErrors:
    """The difference of two pictures of one size, uint8 or float32 in [0, 1], (height, width, 3 or 4).

    What their alpha leaves open is white.
    """
    alive: list[Any] = []
    pictures = _picture(a, "a", alive), _picture(b, "b", alive)
    options, errors = _metrics_options(lpips, 0.05, context), _initial(vg_picture_errors)
    _call("vg_metrics_pictures", *map(ct.byref, pictures), ct.byref(options), ct.byref(errors))
    return PictureErrors(*_measures(errors))  # type: ignore[arg-type]


def view_errors(
    gaussians: Gaussians,
    image: npt.NDArray[np.uint8],
    mask: npt.NDArray[Any] | None,
    camera: Camera,
    depth: npt.NDArray[np.float32] | None = None,
    *,
    lpips: Model | None = None,
    context: Context | None = None,
) -> ViewErrors:
    """The error of a model, drawn on white, in one photograph, which its mask puts on white."""
    alive: list[Any] = []
    view = _initial(vg_view)
    view.camera, view.image = _camera(camera), _photograph(image, "image", alive)
    if mask is not None:
        view.mask = _mask(mask, "mask", alive)
    if depth is not None:
        view.depth = _plane(depth, "depth", np.float32, Format.DEPTH32F, alive)
    options, errors = _metrics_options(lpips, 0.05, context), _initial(vg_view_errors)
    _call("vg_metrics_view", gaussians._handle, ct.byref(view), ct.byref(options), ct.byref(errors))
    return ViewErrors(*_measures(errors))  # type: ignore[arg-type]


def surface_errors(
    gaussians: Gaussians, points: npt.NDArray[np.float32], *, f_score: float = 0.05, context: Context | None = None
) -> SurfaceErrors:
    """The error of a model's surface against points measured on the vehicle: float32 (n, 3), metres, its frame.

    f_score: the distance below which a point counts as met, metres.
    """
    _expect(points, "points", np.float32)
    if points.ndim != 2 or points.shape[1] != 3:
        raise VgError(Status.ARGUMENT, f"points: shape {points.shape}; allowed: (n, 3)")
    points = np.require(points, requirements=["C", "A"])
    options, errors = _metrics_options(None, f_score, context), _initial(vg_surface_errors)
    _call(
        "vg_metrics_surface", gaussians._handle, points.ctypes.data, len(points), ct.byref(options), ct.byref(errors)
    )
    return SurfaceErrors(*_measures(errors))  # type: ignore[arg-type]


def _align_options(heading: str, context: Context | None) -> vg_align_options:
    options: vg_align_options = _initial(vg_align_options)
    options.context = None if context is None else context._as_parameter_
    options.heading = _choice(Heading, "heading", heading)
    return options


def _alignment(found: vg_alignment) -> Alignment:
    matrix = np.array(found.vehicle_from_world).reshape(4, 4)
    residual_px, other_px = (None if value != value else value for value in (found.residual_px, found.other_px))
    return Alignment(
        matrix, found.scale, found.residual_m, found.confidence, residual_px, other_px, found.used_count
    )


def _masked_views(
    masks: Sequence[npt.NDArray[Any] | None], cameras: Sequence[Camera], names: Sequence[str] | None, alive: list[Any]
) -> ct.Array[vg_view]:
    for argument, entries in (("masks", masks), ("names", names)):
        if entries is not None and len(entries) != len(cameras):
            allowed = f"one for each of {len(cameras)} cameras"
            raise VgError(Status.ARGUMENT, f"{argument}: {len(entries)}; allowed: {allowed}")
    views = (vg_view * len(cameras))()
    for i, (mask, camera) in enumerate(zip(masks, cameras, strict=True)):
        views[i] = _initial(vg_view)
        views[i].camera = _camera(camera)
        views[i].name = (names[i] if names is not None else f"{i:03}").encode()
        if mask is not None:
            views[i].mask = _mask(mask, f"masks[{i}]", alive)
    return views


def _points(points: npt.ArrayLike | None, argument: str, dtype: type) -> npt.NDArray[Any]:
    """(n, 3) in row order; none for None."""
    array = np.require([] if points is None else points, dtype, ["C", "A"])
    if points is None:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise VgError(Status.ARGUMENT, f"{argument}: shape {array.shape}; allowed: (n, 3)")
    return array


def align_scan(
    masks: Sequence[npt.NDArray[Any] | None],
    cameras: Sequence[Camera],
    scan: npt.NDArray[np.float32],
    sparse: npt.ArrayLike | None = None,
    *,
    heading: str = "auto",
    names: Sequence[str] | None = None,
    context: Context | None = None,
) -> Alignment:
    """The vehicle's frame by points scanned on the vehicle; the arguments are those of vehicle_gaussians.align_scan."""
    _expect(scan, "scan", np.float32)
    alive: list[Any] = []
    views, found = _masked_views(masks, cameras, names, alive), _initial(vg_alignment)
    world, scanned = _points(sparse, "sparse", np.float64), _points(scan, "scan", np.float32)
    lists = (views, len(views), world.ctypes.data, len(world), scanned.ctypes.data, len(scanned))
    _call("vg_align_scan", *lists, ct.byref(_align_options(heading, context)), ct.byref(found))
    return _alignment(found)


def align_box(
    masks: Sequence[npt.NDArray[Any] | None],
    cameras: Sequence[Camera],
    sparse: npt.ArrayLike,
    size: npt.ArrayLike,
    *,
    heading: str,
    names: Sequence[str] | None = None,
    context: Context | None = None,
) -> Alignment:
    """The vehicle's frame by its size and the ground; the arguments are those of vehicle_gaussians.align_box."""
    alive: list[Any] = []
    views, found = _masked_views(masks, cameras, names, alive), _initial(vg_alignment)
    world, sides = _points(sparse, "sparse", np.float64), _doubles(size, (3,))
    lists = (views, len(views), world.ctypes.data, len(world), sides.ctypes.data)
    _call("vg_align_box", *lists, ct.byref(_align_options(heading, context)), ct.byref(found))
    return _alignment(found)


def align_points(world: npt.ArrayLike, vehicle: npt.ArrayLike) -> Alignment:
    """The similarity between points known in both frames; the arguments are those of vehicle_gaussians.align_points."""
    source, target = _points(world, "world", np.float64), _points(vehicle, "vehicle", np.float64)
    if len(source) != len(target):
        raise VgError(Status.ARGUMENT, f"vehicle: {len(target)}; allowed: as many as world, {len(source)}")
    found, kept = _initial(vg_alignment), np.zeros(len(source), np.bool_)
    residuals = np.empty(len(source))
    lists = (source.ctypes.data, target.ctypes.data, len(source))
    _call("vg_align_points", *lists, ct.byref(found), kept.ctypes.data, residuals.ctypes.data)
    return _alignment(found)._replace(kept=kept, residuals_m=residuals)


def align_folder(
    path: str | os.PathLike[str],
    scan: str | os.PathLike[str] | None = None,
    *,
    heading: str = "auto",
    context: Context | None = None,
) -> Alignment:
    """align_scan with the files of a scene; the arguments are those of vehicle_gaussians.align_folder."""
    found, file = _initial(vg_alignment), None if scan is None else os.fsencode(scan)
    options = _align_options(heading, context)
    _call("vg_align_folder", os.fsencode(path), file, ct.byref(options), ct.byref(found))
    return _alignment(found)


class Scene(NamedTuple):
    """Views of one vehicle, a list entry each; the arrays are read-only views of the library's memory."""

    images: list[npt.NDArray[np.uint8]]
    #: 255 is vehicle.
    masks: list[npt.NDArray[np.uint8] | None]
    depths: list[npt.NDArray[np.float32] | None]
    cameras: list[vg_camera]
    names: list[str]


def open_scene(
    path: str | os.PathLike[str],
    views: Iterable[str] | None = None,
    vehicle_from_world: npt.ArrayLike | None = None,
    *,
    depth_scale: float | None = None,
    load_depth: bool = True,
    context: Context | None = None,
) -> Scene:
    """Opens a transforms.json, a folder with one, or a COLMAP folder; the arguments are those of
    vehicle_gaussians.open_scene. What is legal but looks like a mistake is a warning."""
    options = _initial(vg_scene_options)
    options.context = None if context is None else context._as_parameter_
    world = _optional_doubles(vehicle_from_world, (4, 4))
    options.vehicle_from_world = _address(world)
    wanted = [] if views is None else [name.encode() for name in views]
    names = (ct.c_char_p * len(wanted))(*wanted)
    if wanted:
        options.names, options.name_count = names, len(wanted)
    options.depth_scale, options.load_depth = depth_scale or 0.0, load_depth
    notes: list[str] = []
    raised: list[BaseException] = []
    options.log = LogFn(_logger(lambda _, note: notes.append(note), raised))
    path = Path(path)
    has_transforms = path.is_file() or (path / "transforms.json").is_file()
    made = ct.c_void_p()
    name = "vg_transforms_open" if has_transforms else "vg_colmap_open"
    _call(name, os.fsencode(path), ct.byref(options), ct.byref(made))
    handle = _Handle("scene", made)
    for note in notes:
        warnings.warn(note, stacklevel=2)

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
