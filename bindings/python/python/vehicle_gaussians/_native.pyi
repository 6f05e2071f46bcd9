from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path
from typing import Literal, final, overload

import numpy as np
import numpy.typing as npt

from ._gradients import Gradients, Planes

__all__ = [
    "Camera",
    "Gaussians",
    "Model",
    "Renderer",
    "__version__",
    "_panic_on_a_worker_thread",
    "align_box",
    "align_folder",
    "align_points",
    "align_scan",
    "open_scene",
    "picture_errors",
    "pose_from_box",
    "pose_from_colmap",
    "pose_from_opengl",
    "reconstruct",
    "segment",
    "similarity_from_points",
    "surface_errors",
    "view_errors",
]

__version__: str

@final
class Camera:
    @staticmethod
    def from_colmap(
        model: str | int,
        width: int,
        height: int,
        params: npt.ArrayLike,
        vehicle_from_camera: npt.ArrayLike,
    ) -> Camera: ...
    @staticmethod
    def from_matrix(
        K: npt.ArrayLike,
        vehicle_from_camera: npt.ArrayLike,
        width: int,
        height: int,
        distortion: npt.ArrayLike | None = None,
    ) -> Camera: ...
    @staticmethod
    def from_opencv(
        K: npt.ArrayLike,
        vehicle_from_camera: npt.ArrayLike,
        width: int,
        height: int,
        distortion: npt.ArrayLike | None = None,
        *,
        fisheye: bool = False,
    ) -> Camera: ...
    def scaled(self, width: int, height: int) -> Camera: ...
    def cropped(self, x: int, y: int, width: int, height: int) -> Camera: ...
    def with_pose(self, vehicle_from_camera: npt.ArrayLike) -> Camera: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def K(self) -> npt.NDArray[np.float64]: ...
    @property
    def vehicle_from_camera(self) -> npt.NDArray[np.float64]: ...
    @property
    def model(self) -> str: ...
    @property
    def params(self) -> npt.NDArray[np.float64]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Renderer:
    def __new__(cls, gaussians: Gaussians, backend: Literal["auto", "cpu", "gpu"] = "auto") -> Renderer: ...
    @property
    def backend(self) -> str: ...
    @property
    def choice(self) -> str: ...
    def render(
        self,
        camera: Camera,
        background: str | npt.ArrayLike = "white",
        threads: int = 0,
        *,
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
    ) -> npt.NDArray[np.uint8]: ...
    def render_many(
        self,
        cameras: Sequence[Camera],
        background: str | npt.ArrayLike = "white",
        threads: int = 0,
        *,
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
    ) -> list[npt.NDArray[np.uint8]]: ...

@final
class Gaussians:
    @staticmethod
    def from_arrays(
        means: npt.NDArray[np.float32],
        scales: npt.NDArray[np.float32],
        quats: npt.NDArray[np.float32],
        opacities: npt.NDArray[np.float32],
        sh: npt.NDArray[np.float32],
    ) -> Gaussians: ...
    @staticmethod
    def load_ply(path: str | PathLike[str]) -> Gaussians: ...
    def save_ply(self, path: str | PathLike[str]) -> None: ...
    def mirrored(self) -> Gaussians: ...
    def transformed(self, to_from_vehicle: npt.ArrayLike) -> Gaussians: ...
    def merged(self, other: Gaussians) -> Gaussians: ...
    @overload
    def render(
        self,
        camera: Camera,
        background: str | npt.ArrayLike = "white",
        depth: Literal[False] = False,
        threads: int = 0,
        *,
        dtype: Literal["uint8"] | type[np.uint8] = "uint8",
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
    ) -> npt.NDArray[np.uint8]: ...
    @overload
    def render(
        self,
        camera: Camera,
        background: str | npt.ArrayLike = "white",
        depth: Literal[False] = False,
        threads: int = 0,
        *,
        dtype: Literal["float32"] | type[np.float32],
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
    ) -> npt.NDArray[np.float32]: ...
    @overload
    def render(
        self,
        camera: Camera,
        background: str | npt.ArrayLike = "white",
        *,
        depth: Literal[True],
        threads: int = 0,
        dtype: Literal["uint8"] | type[np.uint8] = "uint8",
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
    ) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]: ...
    @overload
    def render(
        self,
        camera: Camera,
        background: str | npt.ArrayLike = "white",
        *,
        depth: Literal[True],
        threads: int = 0,
        dtype: Literal["float32"] | type[np.float32],
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]: ...
    def render_planes(
        self,
        camera: Camera,
        background: str | npt.ArrayLike = "white",
        threads: int = 0,
        *,
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
        depth_mode: str = "expected",
        backend: Literal["auto", "cpu", "gpu"] = "auto",
    ) -> Planes: ...
    def render_backward(
        self,
        camera: Camera,
        color: npt.NDArray[np.float32] | None = None,
        alpha: npt.NDArray[np.float32] | None = None,
        depth: npt.NDArray[np.float32] | None = None,
        background: str | npt.ArrayLike = "white",
        threads: int = 0,
        *,
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
        depth_mode: str = "expected",
        backend: Literal["auto", "cpu", "gpu"] = "auto",
    ) -> Gradients: ...
    @property
    def means(self) -> npt.NDArray[np.float32]: ...
    @property
    def scales(self) -> npt.NDArray[np.float32]: ...
    @property
    def quats(self) -> npt.NDArray[np.float32]: ...
    @property
    def opacities(self) -> npt.NDArray[np.float32]: ...
    @property
    def sh(self) -> npt.NDArray[np.float32]: ...
    @property
    def sh_degree(self) -> int: ...
    @property
    def bounds(self) -> npt.NDArray[np.float32] | None: ...
    def __len__(self) -> int: ...

@final
class Model:
    def __new__(
        cls,
        path: str | PathLike[str],
        runtime: str | PathLike[str] | None = None,
        provider: Literal["cpu", "cuda"] = "cpu",
        fall_back: bool = False,
        threads: int = 0,
        prepack: bool | None = None,
        arena: bool = False,
    ) -> Model: ...
    @property
    def path(self) -> Path: ...

def pose_from_colmap(
    qvec: npt.ArrayLike,
    tvec: npt.ArrayLike,
    vehicle_from_world: npt.ArrayLike | None = None,
) -> npt.NDArray[np.float64]: ...
def pose_from_opengl(
    camera_to_world: npt.ArrayLike,
    vehicle_from_world: npt.ArrayLike | None = None,
) -> npt.NDArray[np.float64]: ...
def pose_from_box(ego_from_vehicle: npt.ArrayLike, ego_from_camera: npt.ArrayLike) -> npt.NDArray[np.float64]: ...
def similarity_from_points(source: npt.ArrayLike, target: npt.ArrayLike) -> npt.NDArray[np.float64]: ...
def align_scan(
    masks: Sequence[npt.NDArray[np.generic] | None],
    cameras: Sequence[Camera],
    scan: npt.NDArray[np.float32],
    sparse: npt.ArrayLike | None,
    heading: str,
    names: Sequence[str] | None,
    threads: int,
) -> tuple[npt.NDArray[np.float64], float, float, float, float | None, float | None, int]: ...
def align_box(
    masks: Sequence[npt.NDArray[np.generic] | None],
    cameras: Sequence[Camera],
    sparse: npt.ArrayLike,
    size: npt.ArrayLike,
    heading: str,
    names: Sequence[str] | None,
    threads: int,
) -> tuple[npt.NDArray[np.float64], float, float, float, float | None, float | None, int]: ...
def align_points(
    world: npt.ArrayLike, vehicle: npt.ArrayLike
) -> tuple[
    npt.NDArray[np.float64],
    float,
    float,
    float,
    float | None,
    float | None,
    int,
    npt.NDArray[np.bool_],
    npt.NDArray[np.float64],
]: ...
def align_folder(
    path: str | PathLike[str], scan: str | PathLike[str] | None, heading: str, threads: int
) -> tuple[npt.NDArray[np.float64], float, float, float, float | None, float | None, int]: ...
def picture_errors(
    a: npt.NDArray[np.generic],
    b: npt.NDArray[np.generic],
    lpips: Model | None,
    threads: int,
) -> tuple[float, float | None, float | None]: ...
def view_errors(
    gaussians: Gaussians,
    image: npt.NDArray[np.uint8],
    mask: npt.NDArray[np.generic] | None,
    camera: Camera,
    depth: npt.NDArray[np.float32] | None,
    lpips: Model | None,
    threads: int,
) -> tuple[float, float | None, float | None, float | None, float, float | None, float | None]: ...
def surface_errors(
    gaussians: Gaussians,
    points: npt.NDArray[np.float32],
    f_score: float,
    threads: int,
) -> list[float]: ...
def segment(
    model: Model,
    image: npt.NDArray[np.uint8],
    camera: Camera,
    threads: int = 0,
) -> npt.NDArray[np.bool_]: ...
def reconstruct(
    images: Sequence[object],
    masks: Sequence[object] | None,
    cameras: Sequence[Camera],
    depths: Sequence[object] | None,
    *,
    prior: str,
    prior_model: Model | None,
    head_model: Model | None,
    calibrate: str,
    symmetry: str,
    relight: str,
    photo: bool,
    cloud: object | None,
    vehicle_size: Sequence[float] | None,
    sh_degree: int,
    keep: Sequence[str],
    check: bool,
    points: bool,
    budget: float | None,
    resolution: float,
    max_views: int | None,
    max_gaussians: int | None,
    refine_iterations: int | None,
    refine_seconds: float | None,
    refine_hold_out: bool,
    refine_backend: str,
    threads: int,
    names: Sequence[str] | None,
    progress: Callable[[str, float], object] | None,
) -> tuple[Gaussians, str, tuple[npt.NDArray[np.float32], npt.NDArray[np.uint8]] | None]: ...
def open_scene(
    path: str | PathLike[str],
    views: Sequence[str] | None,
    vehicle_from_world: npt.ArrayLike | str | PathLike[str] | None,
    depth_scale: float | None,
    load_depth: bool,
) -> tuple[
    list[npt.NDArray[np.uint8]],
    list[npt.NDArray[np.bool_] | None],
    list[npt.NDArray[np.float32] | None],
    list[Camera],
    list[str],
]: ...
def _panic_on_a_worker_thread() -> None: ...
