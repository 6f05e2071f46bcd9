from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal, SupportsIndex, final, overload

import numpy as np
import numpy.typing as npt

from ._gradients import Gradients, Planes
from ._progress import Progress
from ._types import Backend, Background, DepthMode, Floats, Heading, Size

__all__ = [
    "Camera",
    "Gaussians",
    "Model",
    "Renderer",
    "__version__",
    "_camera",
    "_gaussians",
    "_panic_on_a_worker_thread",
    "align_box",
    "align_folder",
    "align_points",
    "align_scan",
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

__version__: str

@final
class Camera:
    @staticmethod
    def from_colmap(
        model: str | SupportsIndex,
        width: SupportsIndex,
        height: SupportsIndex,
        params: npt.ArrayLike,
        vehicle_from_camera: npt.ArrayLike,
    ) -> Camera: ...
    @staticmethod
    def from_matrix(
        K: npt.ArrayLike,
        vehicle_from_camera: npt.ArrayLike,
        width: SupportsIndex,
        height: SupportsIndex,
        distortion: npt.ArrayLike | None = None,
    ) -> Camera: ...
    @staticmethod
    @overload
    def from_opencv(
        K: npt.ArrayLike,
        vehicle_from_camera: npt.ArrayLike,
        width: int,
        height: int,
        distortion: npt.ArrayLike | None = None,
        *,
        fisheye: bool = False,
    ) -> Camera: ...
    @staticmethod
    @overload
    def from_opencv(
        K: npt.ArrayLike,
        vehicle_from_camera: None = None,
        width: int = 0,
        height: int = 0,
        distortion: npt.ArrayLike | None = None,
        *,
        fisheye: bool = False,
        rvec: npt.ArrayLike,
        tvec: npt.ArrayLike,
        vehicle_from_world: npt.ArrayLike | None = None,
    ) -> Camera: ...
    @staticmethod
    def look_at(
        eye: npt.ArrayLike,
        target: npt.ArrayLike,
        width: int,
        height: int,
        *,
        fov_y_degrees: float = 35.0,
        up: npt.ArrayLike = (0.0, 0.0, 1.0),
    ) -> Camera: ...
    @overload
    def project(self, points: npt.ArrayLike, depth: Literal[False] = False) -> npt.NDArray[np.float64]: ...
    @overload
    def project(
        self, points: npt.ArrayLike, depth: Literal[True]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]: ...
    def unproject(self, pixels: npt.ArrayLike, depths: npt.ArrayLike) -> npt.NDArray[np.float64]: ...
    def scaled(self, width: SupportsIndex, height: SupportsIndex) -> Camera: ...
    def cropped(self, x: SupportsIndex, y: SupportsIndex, width: SupportsIndex, height: SupportsIndex) -> Camera: ...
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
    def model(self) -> Literal["PINHOLE", "OPENCV", "FULL_OPENCV", "OPENCV_FISHEYE"]: ...
    @property
    def params(self) -> npt.NDArray[np.float64]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __copy__(self) -> Camera: ...
    def __deepcopy__(self, memo: object, /) -> Camera: ...

@final
class Renderer:
    def __new__(cls, gaussians: Gaussians, backend: Backend = "auto") -> Renderer: ...
    @property
    def backend(self) -> Literal["cpu", "gpu"]: ...
    @property
    def choice(self) -> str: ...
    def render(
        self,
        camera: Camera,
        background: Background = "white",
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
        background: Background = "white",
        threads: int = 0,
        *,
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
        progress: Progress | None = None,
    ) -> list[npt.NDArray[np.uint8]]: ...

@final
class Gaussians:
    @staticmethod
    def from_arrays(means: Floats, scales: Floats, quats: Floats, opacities: Floats, sh: Floats) -> Gaussians: ...
    @staticmethod
    def load_ply(path: str | PathLike[str]) -> Gaussians: ...
    def save_ply(self, path: str | PathLike[str]) -> None: ...
    @staticmethod
    def from_ply_bytes(data: bytes | bytearray | memoryview) -> Gaussians: ...
    def to_ply_bytes(self) -> bytes: ...
    def __getitem__(
        self, index: slice | Sequence[int] | Sequence[bool] | npt.NDArray[np.integer[Any] | np.bool_], /
    ) -> Gaussians: ...
    def cropped(self, low: npt.ArrayLike, high: npt.ArrayLike) -> Gaussians: ...
    def covariances(self) -> npt.NDArray[np.float32]: ...
    def turntable(
        self,
        count: int,
        width: int,
        height: int,
        *,
        elevation_degrees: float = 12.0,
        fov_y_degrees: float = 35.0,
    ) -> list[Camera]: ...
    def mirrored(self) -> Gaussians: ...
    def transformed(self, to_from_vehicle: npt.ArrayLike) -> Gaussians: ...
    def merged(self, other: Gaussians) -> Gaussians: ...
    @overload
    def render(
        self,
        camera: Camera,
        background: Background = "white",
        depth: Literal[False] = False,
        threads: int = 0,
        *,
        dtype: Literal["uint8"] | type[np.uint8] | np.dtype[np.uint8] = "uint8",
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
    ) -> npt.NDArray[np.uint8]: ...
    @overload
    def render(
        self,
        camera: Camera,
        background: Background,
        depth: Literal[True],
        threads: int = 0,
        *,
        dtype: Literal["uint8"] | type[np.uint8] | np.dtype[np.uint8] = "uint8",
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
    ) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]: ...
    @overload
    def render(
        self,
        camera: Camera,
        background: Background = "white",
        *,
        depth: Literal[True],
        threads: int = 0,
        dtype: Literal["uint8"] | type[np.uint8] | np.dtype[np.uint8] = "uint8",
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
    ) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]: ...
    @overload
    def render(
        self,
        camera: Camera,
        background: Background = "white",
        depth: bool = False,
        threads: int = 0,
        *,
        dtype: Literal["uint8"] | type[np.uint8] | np.dtype[np.uint8] = "uint8",
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
    ) -> npt.NDArray[np.uint8] | tuple[npt.NDArray[np.uint8], npt.NDArray[np.float32]]: ...
    @overload
    def render(
        self,
        camera: Camera,
        background: Background = "white",
        depth: Literal[False] = False,
        threads: int = 0,
        *,
        dtype: Literal["float32"] | type[np.float32] | np.dtype[np.float32],
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
    ) -> npt.NDArray[np.float32]: ...
    @overload
    def render(
        self,
        camera: Camera,
        background: Background,
        depth: Literal[True],
        threads: int = 0,
        *,
        dtype: Literal["float32"] | type[np.float32] | np.dtype[np.float32],
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]: ...
    @overload
    def render(
        self,
        camera: Camera,
        background: Background = "white",
        *,
        depth: Literal[True],
        threads: int = 0,
        dtype: Literal["float32"] | type[np.float32] | np.dtype[np.float32],
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]: ...
    @overload
    def render(
        self,
        camera: Camera,
        background: Background = "white",
        depth: bool = False,
        threads: int = 0,
        *,
        dtype: Literal["float32"] | type[np.float32] | np.dtype[np.float32],
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
    ) -> npt.NDArray[np.float32] | tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]: ...
    def render_planes(
        self,
        camera: Camera,
        background: Background = "white",
        threads: int = 0,
        *,
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
        depth_mode: DepthMode = "expected",
        backend: Backend = "auto",
    ) -> Planes: ...
    def render_backward(
        self,
        camera: Camera,
        color: Floats | None = None,
        alpha: Floats | None = None,
        depth: Floats | None = None,
        background: Background = "white",
        threads: int = 0,
        *,
        antialiased: bool = False,
        near: float = 0.01,
        far: float = 1e10,
        sh_degree: int = 3,
        depth_mode: DepthMode = "expected",
        backend: Backend = "auto",
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
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __copy__(self) -> Gaussians: ...
    def __deepcopy__(self, memo: object, /) -> Gaussians: ...

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
def pose_from_opencv(
    rvec: npt.ArrayLike, tvec: npt.ArrayLike, vehicle_from_world: npt.ArrayLike | None = None
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
    scan: Floats,
    sparse: npt.ArrayLike | None,
    heading: Heading,
    names: Sequence[str] | None,
    threads: int,
    progress: Progress | None,
) -> tuple[npt.NDArray[np.float64], float, float, float, float | None, float | None, int]: ...
def align_box(
    masks: Sequence[npt.NDArray[np.generic] | None],
    cameras: Sequence[Camera],
    sparse: npt.ArrayLike,
    size: npt.ArrayLike,
    heading: Heading,
    names: Sequence[str] | None,
    threads: int,
    progress: Progress | None,
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
    path: str | PathLike[str],
    scan: str | PathLike[str] | None,
    heading: Heading,
    threads: int,
    progress: Progress | None,
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
    depth: Floats | None,
    lpips: Model | None,
    threads: int,
) -> tuple[float, float | None, float | None, float | None, float, float | None, float | None]: ...
def surface_errors(
    gaussians: Gaussians,
    points: Floats,
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
    vehicle_size: Size | None,
    sh_degree: int,
    keep: Sequence[str],
    check: bool,
    points: bool,
    budget: float | None,
    resolution: float,
    max_views: int | None,
    refine_iterations: int | None,
    refine_seconds: float | None,
    refine_hold_out: bool,
    refine_backend: str,
    threads: int,
    names: Sequence[str] | None,
    progress: Progress | None,
) -> tuple[Gaussians, str, tuple[npt.NDArray[np.float32], npt.NDArray[np.uint8]] | None]: ...
def refine(
    gaussians: Gaussians,
    images: Sequence[npt.NDArray[np.uint8]],
    masks: Sequence[npt.NDArray[np.generic] | None],
    cameras: Sequence[Camera],
    depths: Sequence[Floats | None],
    names: Sequence[str],
    iterations: int | None,
    seconds: float | None,
    hold_out: bool,
    densify: bool,
    backend: Backend,
    threads: int,
    progress: Progress | None,
) -> tuple[Gaussians, str]: ...
def open_scene(
    path: str | PathLike[str],
    views: Sequence[str] | None,
    vehicle_from_world: npt.ArrayLike | str | PathLike[str] | None,
    depth_scale: float | None,
    load_depth: bool,
    progress: Progress | None,
) -> tuple[
    list[npt.NDArray[np.uint8]],
    list[npt.NDArray[np.bool_] | None],
    list[npt.NDArray[np.float32] | None],
    list[Camera],
    list[str],
]: ...
def _camera(
    model: str, width: int, height: int, params: Sequence[float], vehicle_from_camera: Sequence[float]
) -> Camera: ...
def _gaussians(means: Floats, scales: Floats, quats: Floats, opacities: Floats, sh: Floats) -> Gaussians: ...
def _panic_on_a_worker_thread() -> None: ...
