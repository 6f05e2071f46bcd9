"""Makes complete metric 3D Gaussian models of vehicles from a few photographs of one side.

>>> import vehicle_gaussians as vg
>>> scene = vg.open_scene("my-car")
>>> made = vg.reconstruct(scene.images, scene.masks, scene.cameras, scene.depths)
>>> made.gaussians.save_ply("car.ply")
>>> picture = made.gaussians.render(scene.cameras[0])

Conventions: the vehicle's frame is x forward, y left, z up in metres, with the plane of symmetry y = 0. A camera's
axes are x right, y down, z forward; the centre of the top-left pixel is (0.5, 0.5). Transforms are named to_from.
Quaternions are (w, x, y, z). Pictures are RGB, row 0 at the top.
"""

from . import _without_native as _without_native
from ._align import align_box, align_folder, align_points, align_scan
from ._alignment import Alignment
from ._errors import (
    ArgumentError,
    ArgumentTypeError,
    CancelledError,
    FileError,
    FileForbiddenError,
    FileMissingError,
    FormatError,
    InternalError,
    MissingError,
    NotBuiltError,
    ReconstructionError,
    Status,
    ThreadsError,
    VgError,
)
from ._evaluate import ViewScore, evaluate
from ._gradients import Gradients, Planes
from ._measures import PictureErrors, SurfaceErrors, ViewErrors
from ._metrics import picture_errors, surface_errors, view_errors
from ._native import (
    Camera,
    Gaussians,
    Model,
    Renderer,
    __version__,
    pose_from_box,
    pose_from_colmap,
    pose_from_opencv,
    pose_from_opengl,
    segment,
    similarity_from_points,
)
from ._reconstruct import Points, Reconstruction, reconstruct
from ._refine import Refined, refine
from ._report import Report
from ._scene import Scene, open_scene
from ._warn import VgWarning

__all__ = [
    "Alignment",
    "ArgumentError",
    "ArgumentTypeError",
    "Camera",
    "CancelledError",
    "FileError",
    "FileForbiddenError",
    "FileMissingError",
    "FormatError",
    "Gaussians",
    "Gradients",
    "InternalError",
    "MissingError",
    "Model",
    "NotBuiltError",
    "PictureErrors",
    "Planes",
    "Points",
    "Reconstruction",
    "ReconstructionError",
    "Refined",
    "Renderer",
    "Report",
    "Scene",
    "Status",
    "SurfaceErrors",
    "ThreadsError",
    "VgError",
    "VgWarning",
    "ViewErrors",
    "ViewScore",
    "__version__",
    "align_box",
    "align_folder",
    "align_points",
    "align_scan",
    "evaluate",
    "open_scene",
    "picture_errors",
    "pose_from_box",
    "pose_from_colmap",
    "pose_from_opencv",
    "pose_from_opengl",
    "reconstruct",
    "refine",
    "segment",
    "similarity_from_points",
    "surface_errors",
    "view_errors",
]
