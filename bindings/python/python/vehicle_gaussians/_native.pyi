from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal, SupportsIndex, final, overload

import numpy as np
import numpy.typing as npt

from ._gradients import Gradients, Planes
from ._progress import Progress
from ._types import Backend, Background, DepthMode, Floats, Heading, Placed, Size

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
    """An immutable posed camera: methods return new cameras.

    >>> K = [[600, 0, 320], [0, 600, 240], [0, 0, 1]]
    >>> camera = Camera.from_matrix(K, vehicle_from_camera, width=640, height=480)
    >>> half = camera.scaled(320, 240)
    """
    @staticmethod
    def from_colmap(
        model: str | SupportsIndex,
        width: SupportsIndex,
        height: SupportsIndex,
        params: npt.ArrayLike,
        vehicle_from_camera: npt.ArrayLike,
    ) -> Camera:
        """Makes a camera from a COLMAP camera model, by name or number, and its parameters in COLMAP's order.

        vehicle_from_camera is a 3x4 or 4x4 rigid transform in metres; camera axes are x right, y down, z forward.

            >>> camera = Camera.from_colmap("SIMPLE_RADIAL", 640, 480, [600, 320, 240, -0.05], vehicle_from_camera)
            >>> camera.model
            'OPENCV'
        """
    @staticmethod
    def from_matrix(
        K: npt.ArrayLike,
        vehicle_from_camera: npt.ArrayLike,
        width: SupportsIndex,
        height: SupportsIndex,
        distortion: npt.ArrayLike | None = None,
    ) -> Camera:
        """Makes a camera from a 3x3 matrix K of focal lengths and principal point in pixels, without skew.

        The centre of the top-left pixel is (0.5, 0.5), as in COLMAP: a principal point in the centre is width / 2. For
        the K of OpenCV's calibration use from_opencv. distortion is k1, k2, p1, p2[, k3[, k4, k5, k6]].

            >>> camera = Camera.from_matrix([[600, 0, 320], [0, 600, 240], [0, 0, 1]], vehicle_from_camera, 640, 480)
        """
    @staticmethod
    def from_opencv(
        K: npt.ArrayLike,
        vehicle_from_camera: npt.ArrayLike | None = None,
        width: SupportsIndex = 0,
        height: SupportsIndex = 0,
        distortion: npt.ArrayLike | None = None,
        *,
        fisheye: bool = False,
        rvec: npt.ArrayLike | None = None,
        tvec: npt.ArrayLike | None = None,
        vehicle_from_world: npt.ArrayLike | None = None,
    ) -> Camera:
        """Makes a camera from OpenCV's calibration. OpenCV has the centre of the top-left pixel at (0, 0), so half a pixel
        is added to the principal point.

        distortion is that of cv2.calibrateCamera or, with fisheye=True, of cv2.fisheye. rvec and tvec replace the pose,
        as cv2.solvePnP and cv2.calibrateCamera return them, from the world of the object's points. vehicle_from_world
        is a 4x4 similarity; without it, that world is the vehicle's frame.

            >>> K = [[600, 0, 319.5], [0, 600, 239.5], [0, 0, 1]]
            >>> camera = Camera.from_opencv(K, vehicle_from_camera, 640, 480)
            >>> float(camera.K[0, 2])
            320.0
            >>> rvec, tvec = [0.0, 0.0, 1.5], [0.0, 0.5, 6.0]
            >>> camera = Camera.from_opencv(K, width=640, height=480, distortion=[-0.1, 0, 0, 0], rvec=rvec, tvec=tvec)
        """
    @staticmethod
    def look_at(
        eye: npt.ArrayLike,
        target: npt.ArrayLike,
        width: SupportsIndex,
        height: SupportsIndex,
        *,
        fov_y_degrees: float = 35.0,
        up: npt.ArrayLike = (0.0, 0.0, 1.0),
    ) -> Camera:
        """Makes a pinhole camera at eye, a point of the vehicle's frame in metres, whose optical axis goes through target.
        Its picture shows fov_y_degrees from top to bottom, and the direction up points up. For another lens use
        with_pose.

            >>> camera = Camera.look_at((6, -4, 1.5), (0, 0, 0.7), 640, 480)
            >>> camera.project([[0, 0, 0.7]]).round(6)
            array([[320., 240.]])
        """
    @overload
    def project(self, points: npt.ArrayLike, depth: Literal[False] = False) -> npt.NDArray[np.float64]:
        """Projects points (n, 3) of the vehicle's frame, metres, to pixels (n, 2), column and row; with depth=True returns
        a pair of the pixels and the depths (n,) along the optical axis, metres. NaN where the camera does not see a
        point: behind it, and beyond the angle at which its lens folds back. The centre of the top-left pixel is (0.5,
        0.5); pixels beyond 0 to width and 0 to height are outside the picture.

            >>> pixels, depths = camera.project(car.means, depth=True)
        """
    @overload
    def project(
        self, points: npt.ArrayLike, depth: Literal[True]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]: ...
    def unproject(self, pixels: npt.ArrayLike, depths: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Returns the points (n, 3) of the vehicle's frame, metres, behind pixels (n, 2), column and row, at depths (n,)
        along the optical axis, metres. NaN where a depth is no measurement (0, negative, NaN), and where the lens
        defines no ray.

            >>> point = camera.unproject([[320.0, 240.0]], [6.0])
        """
    def scaled(self, width: SupportsIndex, height: SupportsIndex) -> Camera:
        """The camera for pictures resized to width x height.

        >>> half = camera.scaled(camera.width // 2, camera.height // 2)
        """
    def cropped(self, x: SupportsIndex, y: SupportsIndex, width: SupportsIndex, height: SupportsIndex) -> Camera:
        """The camera of the part image[y : y + height, x : x + width] of its pictures.

        >>> part = camera.cropped(x=100, y=50, width=64, height=32)  # of image[50:82, 100:164]
        """
    def with_pose(self, vehicle_from_camera: npt.ArrayLike) -> Camera:
        """The camera, including its lens, at another pose.

        >>> moved = camera.with_pose(other_vehicle_from_camera)
        """
    @property
    def width(self) -> int:
        """Width of the picture, pixels."""
    @property
    def height(self) -> int:
        """Height of the picture, pixels."""
    @property
    def K(self) -> npt.NDArray[np.float64]:
        """Camera matrix, 3x3; the centre of the top-left pixel is (0.5, 0.5)."""
    @property
    def vehicle_from_camera(self) -> npt.NDArray[np.float64]:
        """Pose, 4x4, metres."""
    @property
    def model(self) -> Literal["PINHOLE", "OPENCV", "FULL_OPENCV", "OPENCV_FISHEYE"]:
        """The COLMAP model that holds this lens: PINHOLE, OPENCV, FULL_OPENCV or OPENCV_FISHEYE."""
    @property
    def params(self) -> npt.NDArray[np.float64]:
        """The parameters of that model, in COLMAP's order."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __copy__(self) -> Camera: ...
    def __deepcopy__(self, memo: object, /) -> Camera: ...

@final
class Renderer:
    """Gaussians prepared for rendering many times. backend is "auto", a GPU if this build and this machine have one
    and there are 20,000 Gaussians or more, else the CPU; "cpu"; or "gpu", an error if there is none. With "auto"
    the CPU takes over if the GPU fails.

        >>> ready = Renderer(car, "cpu")
        >>> pictures = [ready.render(camera) for camera in cameras]
    """
    def __new__(cls, gaussians: Gaussians, backend: Backend = "auto") -> Renderer: ...
    @property
    def backend(self) -> Literal["cpu", "gpu"]:
        """The renderer that was chosen: "cpu" or "gpu"."""
    @property
    def choice(self) -> str:
        """The renderer that was chosen, and why."""
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
    ) -> npt.NDArray[np.uint8]:
        """Renders a camera's picture: uint8 (height, width, 3), or (height, width, 4) with straight alpha on a
        "transparent" background. Arguments are those of Gaussians.render.

            >>> picture = Renderer(car).render(camera, "transparent")
        """
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
    ) -> list[npt.NDArray[np.uint8]]:
        """Renders the pictures of several cameras; returns a list of the results of render. A GPU draws a picture while
        the previous one is copied. progress is as for reconstruct, with the single stage "render".

            >>> pictures = Renderer(car).render_many(cameras)
        """

@final
class Gaussians:
    """The Gaussians of a vehicle, in its frame (x forward, y left, z up, metres). They are immutable: methods return
    new Gaussians, and the arrays are read-only views that keep them alive.

        >>> car = Gaussians.load_ply("car.ply")
        >>> picture = car.render(camera)
        >>> red = car.sh.copy()
        >>> red[:, 0] = [1.77, -1.77, -1.77]
        >>> car = Gaussians.from_arrays(car.means, car.scales, car.quats, car.opacities, red)
    """
    @staticmethod
    def from_arrays(means: Floats, scales: Floats, quats: Floats, opacities: Floats, sh: Floats) -> Gaussians:
        """Makes n Gaussians from arrays of floats: means (n, 3) and scales (n, 3), standard deviations, in metres; quats
        (n, 4) as (w, x, y, z) of any norm; opacities (n,) from 0 to 1; sh (n, (degree + 1)^2, 3).

            >>> means, scales, quats = np.zeros((2, 3)), np.full((2, 3), 0.1), np.tile([1.0, 0, 0, 0], (2, 1))
            >>> Gaussians.from_arrays(means, scales, quats, opacities=np.ones(2), sh=np.zeros((2, 1, 3)))
            Gaussians(2, sh_degree=0)
        """
    @staticmethod
    def load_ply(path: str | PathLike[str]) -> Gaussians:
        """Reads a PLY file in the layout of 3D Gaussian Splatting.

        >>> car = Gaussians.load_ply("car.ply")
        """
    def save_ply(self, path: str | PathLike[str]) -> None:
        """Writes a PLY file in the layout of 3D Gaussian Splatting. An existing file is replaced only after the new one is
        complete.

            >>> car.save_ply("copy.ply")
        """
    @staticmethod
    def from_ply_bytes(data: bytes | bytearray | memoryview) -> Gaussians:
        """Reads the bytes of a PLY file in the layout of 3D Gaussian Splatting.

        >>> same = Gaussians.from_ply_bytes(car.to_ply_bytes())
        """
    def to_ply_bytes(self) -> bytes:
        """Returns the bytes that save_ply writes.

        >>> car.to_ply_bytes()[:4]
        b'ply\n'
        """
    def __getitem__(
        self, index: slice | Sequence[int] | Sequence[bool] | npt.NDArray[np.integer[Any] | np.bool_], /
    ) -> Gaussians: ...
    def cropped(self, low: npt.ArrayLike, high: npt.ArrayLike) -> Gaussians:
        """The Gaussians whose centre lies in the box from low to high, three numbers each, metres, including its faces.
        Infinite sides are open.

            >>> front = car.cropped((0, -10, -10), (10, 10, 10))
        """
    def covariances(self) -> npt.NDArray[np.float32]:
        """Covariance matrices in the vehicle's frame, square metres. (n, 3, 3)

        >>> volumes = np.sqrt(np.linalg.det(car.covariances()))
        """
    def turntable(
        self,
        count: SupportsIndex,
        width: SupportsIndex,
        height: SupportsIndex,
        *,
        elevation_degrees: float = 12.0,
        fov_y_degrees: float = 35.0,
    ) -> list[Camera]:
        """Returns count cameras on a circle around the vehicle, from its front to its left, each with all of it in view.

        >>> pictures = Renderer(car).render_many(car.turntable(36, 320, 240))
        """
    def mirrored(self) -> Gaussians:
        """The mirror image across the plane of symmetry, y = 0.

        >>> car.mirrored().mirrored() == car
        True
        """
    def transformed(self, to_from_vehicle: npt.ArrayLike) -> Gaussians:
        """The Gaussians in another frame: to_from_vehicle is a 4x4 similarity. Colours turn with the vehicle. Coordinates
        must stay below 16384 m, where a float32 still resolves a millimetre.

            >>> twice_as_large = car.transformed(np.diag([2.0, 2.0, 2.0, 1.0]))
        """
    def merged(self, other: Gaussians) -> Gaussians:
        """These Gaussians followed by those of other, at the higher of their degrees of spherical harmonics.

        >>> both = car.merged(car.mirrored())
        >>> len(both) == 2 * len(car)
        True
        """
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
    ) -> npt.NDArray[np.uint8]:
        """Renders a camera's picture: uint8 (height, width, 3), or (height, width, 4) with straight alpha on a
        "transparent" background. With dtype float32 colours are not clamped above 1. With depth=True returns a pair of
        the picture and its depth in metres, float32 (height, width), 0 where there is no Gaussian.

        background is "white", "black", "transparent" or (r, g, b) from 0 to 1; near and far are metres; bands of the
        colour above sh_degree are left out; threads=0 means one per core.

            >>> picture = car.render(camera)
            >>> rgba, depth = car.render(camera, "transparent", depth=True)
        """
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
    ) -> Planes:
        """Renders a picture for use in a loss: Planes of color (height, width, 3), over the background or, with a
        "transparent" one, premultiplied; alpha and depth (height, width). All are float32. Arguments are those of
        render, and depth_mode, "expected" or "accumulated" (depth times alpha). backend is "cpu", "gpu" (an error if
        there is none), or "auto", the CPU; to draw the same Gaussians many times, use Renderer.

            >>> color, alpha, depth = car.render_planes(camera, "black")
        """
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
    ) -> Gradients:
        """Propagates the gradient of a loss with respect to the planes of a picture, as drawn by render_planes, back to
        Gradients of all its inputs. color (height, width, 3), alpha and depth (height, width) are float32 and finite;
        None where the loss does not use the plane. The picture is rendered again for that.

        Treated as constant are the depth order, the pixels that a Gaussian reaches, the cut of faint Gaussians, near
        and far.

            >>> planes = car.render_planes(camera)
            >>> gradients = car.render_backward(camera, color=2 * (planes.color - photograph))
            >>> gradients.means.shape == car.means.shape
            True
        """
    @property
    def means(self) -> npt.NDArray[np.float32]:
        """Centres, metres. (n, 3)"""
    @property
    def scales(self) -> npt.NDArray[np.float32]:
        """Standard deviations along the Gaussians' own axes, metres. (n, 3)"""
    @property
    def quats(self) -> npt.NDArray[np.float32]:
        """vehicle_from_gaussian, unit quaternions (w, x, y, z). (n, 4)"""
    @property
    def opacities(self) -> npt.NDArray[np.float32]:
        """Peak opacities, 0 to 1. (n,)"""
    @property
    def sh(self) -> npt.NDArray[np.float32]:
        """Spherical harmonics in the order and with the signs of 3D Gaussian Splatting, RGB last:
        colour = 0.5 + sum of coefficient times basis. (n, (degree + 1)^2, 3)
        """
    @property
    def sh_degree(self) -> int:
        """Highest degree of the spherical harmonics, 0 to 3."""
    @property
    def bounds(self) -> npt.NDArray[np.float32] | None:
        """Lowest and highest centre, metres, or None when there is no Gaussian. (2, 3)"""
    def __len__(self) -> int: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __copy__(self) -> Gaussians: ...
    def __deepcopy__(self, memo: object, /) -> Gaussians: ...

@final
class Model:
    """A network in an ONNX file, opened by ONNX Runtime, for reconstruct's prior_model and head_model.

    It is opened once and may be used by any number of threads at a time; its runs are serialised. It keeps its
    weights and threads until it is garbage-collected. It cannot be used in a forked process.

        >>> network = Model("depth.onnx")  # doctest: +SKIP
        >>> made = reconstruct(images, masks, cameras, prior="onnx", prior_model=network)  # doctest: +SKIP
    """
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
    def path(self) -> Path:
        """Path of the file."""

def pose_from_colmap(
    qvec: npt.ArrayLike,
    tvec: npt.ArrayLike,
    vehicle_from_world: npt.ArrayLike | None = None,
) -> npt.NDArray[np.float64]:
    """Returns vehicle_from_camera (4x4) for COLMAP's world-to-camera quaternion (w, x, y, z) and translation.

    vehicle_from_world is the similarity (4x4) from the model's world to the vehicle's frame; without it, the two
    are the same. pycolmap stores quaternions as (x, y, z, w).

        >>> vehicle_from_camera = pose_from_colmap([1, 0, 0, 0], [0, 0, 5], vehicle_from_world)
    """
def pose_from_opencv(
    rvec: npt.ArrayLike, tvec: npt.ArrayLike, vehicle_from_world: npt.ArrayLike | None = None
) -> npt.NDArray[np.float64]:
    """Returns vehicle_from_camera (4x4) for OpenCV's world-to-camera rvec and tvec, as cv2.solvePnP returns them.

    vehicle_from_world is the similarity (4x4) from that world to the vehicle's frame; without it, the two are the
    same.

        >>> vehicle_from_camera = pose_from_opencv([0.0, 0.0, 1.5], [0.0, 0.5, 6.0])
    """
def pose_from_opengl(
    camera_to_world: npt.ArrayLike,
    vehicle_from_world: npt.ArrayLike | None = None,
) -> npt.NDArray[np.float64]:
    """Returns vehicle_from_camera (4x4) for a camera-to-world matrix with OpenGL's camera axes (x right, y up, z
    backward), as in nerfstudio's transforms.json and in Blender.

    vehicle_from_world is the similarity (4x4) from that world to the vehicle's frame; without it, the two are the
    same.

        >>> vehicle_from_camera = pose_from_opengl(frame["transform_matrix"])
    """

def pose_from_box(ego_from_vehicle: npt.ArrayLike, ego_from_camera: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Returns vehicle_from_camera (4x4) for a vehicle that was tracked as a box, from the poses (3x4 or 4x4, metres)
    of the box and of the camera in a common frame (ego, map, UTM) at the time of the picture. The box's axes are x
    forward, y left, z up, and its origin lies on the vehicle's plane of symmetry.

        >>> vehicle_from_camera = pose_from_box(ego_from_vehicle, ego_from_camera)
    """

def similarity_from_points(source: npt.ArrayLike, target: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Returns the similarity (4x4) that best maps source to target, both (n, 3) with n >= 3 (Umeyama 1991): for
    example vehicle_from_world from camera centres that are known in both frames.

        >>> vehicle_from_world = similarity_from_points(centers_in_world, centers_in_vehicle)
    """

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
) -> dict[str, float | None]: ...
def surface_errors(
    gaussians: Gaussians,
    points: Floats,
    f_score: float,
    threads: int,
) -> dict[str, float | None]: ...
def segment(
    model: Model,
    image: npt.NDArray[np.uint8],
    camera: Camera,
    threads: int = 0,
) -> npt.NDArray[np.bool_]:
    """Computes the mask of a photograph by a segmentation network: bool (height, width), True for the vehicle at the
    origin of the camera's vehicle frame.

    image: RGB, uint8 (height, width, 3); the alpha of a fourth channel is ignored.
    threads: worker threads; 0 means one per core.

        >>> mask = segment(Model("segmentation.onnx"), images[0], cameras[0])  # doctest: +SKIP
    """

def reconstruct(
    images: Sequence[object],
    masks: Sequence[object] | None,
    cameras: Sequence[Camera],
    depths: Sequence[object] | None,
    *,
    options: Mapping[str, object],
    prior_model: Model | None,
    head_model: Model | None,
    cloud: object | None,
    vehicle_size: Size | None,
    vehicle_place: Placed | None,
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
