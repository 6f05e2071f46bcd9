"""Differentiable rendering for PyTorch.

>>> from vehicle_gaussians.torch import render
>>> picture = render(means, quats, scales, opacities, sh, camera)
>>> (picture.color - photograph).square().mean().backward()

The library renders and computes the gradients on the CPU; only this module needs PyTorch: ``pip install torch``.
Tensors are float32 on the CPU; others are an error and are not moved, because copies to and from a device in every step
should be visible in the caller's code. Activations (exp for scales, sigmoid for opacities) are left to the caller.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from ._arguments import bad_type
from ._errors import ArgumentTypeError, Status, VgError
from ._native import Camera, Gaussians
from ._types import Backend, Background, DepthMode

try:
    import torch
    from torch.autograd.function import once_differentiable
except ImportError as error:
    raise ImportError(
        "vehicle_gaussians.torch needs PyTorch, which is not installed: pip install torch "
        "(for the processor alone: pip install torch --index-url https://download.pytorch.org/whl/cpu)"
    ) from error

__all__ = ["Picture", "render"]


class Picture(NamedTuple):
    """A rendered picture as differentiable float32 tensors."""

    color: torch.Tensor
    """sRGB-encoded, over the background; premultiplied by alpha where that is transparent. (height, width, 3)"""
    alpha: torch.Tensor
    """Coverage of the pixel by the vehicle, 0 to 1, for any background. (height, width)"""
    depth: torch.Tensor
    """Metres along the optical axis, 0 where there is no Gaussian. (height, width)"""


def render(
    means: torch.Tensor,
    quats: torch.Tensor,
    scales: torch.Tensor,
    opacities: torch.Tensor,
    sh: torch.Tensor,
    camera: Camera,
    *,
    background: Literal["white", "black", "transparent"] | torch.Tensor = "white",
    pose: torch.Tensor | None = None,
    antialiased: bool = False,
    near: float = 0.01,
    far: float = 1e10,
    sh_degree: int = 3,
    depth_mode: DepthMode = "expected",
    backend: Backend = "auto",
    threads: int = 0,
) -> Picture:
    """Renders Gaussians from a camera; gradients are computed for every tensor that requires them.

    The tensors of n Gaussians are means (n, 3) and scales (n, 3), standard deviations, in metres; quats (n, 4),
    quaternions (w, x, y, z) of any norm except zero, whose normalisation is part of the gradient; opacities (n,) from
    0 to 1; sh (n, (degree + 1)^2, 3).

    background is "white", "black", "transparent" or a tensor (3,) of numbers from 0 to 1. pose is a tensor (6,): the
    camera is rotated about its own axes by the rotation vector pose[:3], radians, and translated by pose[3:] along its
    original axes, metres; zeros do not move it. The other arguments are those of Gaussians.render_planes.

    Treated as constant are the depth order, the pixels that a Gaussian reaches, the cut of faint Gaussians, near and
    far. There are no second derivatives.
    """
    count = means.shape[0] if isinstance(means, torch.Tensor) and means.ndim > 0 else -1
    bands = sh.shape[1] if isinstance(sh, torch.Tensor) and sh.ndim == 3 else 16
    if bands not in (1, 4, 9, 16):
        raise VgError(Status.ARGUMENT, f"sh: shape {tuple(sh.shape)}; allowed: (n, K, 3) with K = 1, 4, 9 or 16")
    shapes = {
        "means": (means, (count, 3)),
        "quats": (quats, (count, 4)),
        "scales": (scales, (count, 3)),
        "opacities": (opacities, (count,)),
        "sh": (sh, (count, bands, 3)),
    }
    for name, (tensor, shape) in shapes.items():
        _expect(tensor, name, shape)
    if isinstance(background, torch.Tensor):
        _expect(background, "background", (3,))
    elif not isinstance(background, str):
        raise bad_type("background", background, "a name, or a tensor of shape (3,)")
    if pose is not None:
        _expect(pose, "pose", (6,))
    if not isinstance(camera, Camera):
        raise bad_type("camera", camera, "a vehicle_gaussians.Camera")
    settings = {
        "antialiased": antialiased,
        "near": near,
        "far": far,
        "sh_degree": sh_degree,
        "depth_mode": depth_mode,
        "backend": backend,
        "threads": threads,
    }
    drawn = _Render.apply(means, quats, scales, opacities, sh, background, pose, camera, settings)
    return Picture(*drawn)


class _Render(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any,
        means: torch.Tensor,
        quats: torch.Tensor,
        scales: torch.Tensor,
        opacities: torch.Tensor,
        sh: torch.Tensor,
        background: str | torch.Tensor,
        pose: torch.Tensor | None,
        camera: Camera,
        settings: dict[str, Any],
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        # Saved by PyTorch, which then detects changes in place and frees them after the backward pass.
        ctx.save_for_backward(
            *(means, quats, scales, opacities, sh),
            background if isinstance(background, torch.Tensor) else None,
            pose,
        )
        ctx.background, ctx.camera, ctx.settings = background, camera, settings
        ctx.set_materialize_grads(False)
        arrays = (means, quats, scales, opacities, sh)
        gaussians, placed, behind = _scene(arrays, camera, background, pose)
        planes = gaussians.render_planes(placed, behind, **settings)
        color, alpha, depth = (torch.from_numpy(plane) for plane in planes)
        return color, alpha, depth

    @staticmethod
    @once_differentiable  # type: ignore[untyped-decorator, unused-ignore]
    def backward(ctx: Any, *of_picture: torch.Tensor | None) -> tuple[torch.Tensor | None, ...]:
        *arrays, tensor, pose = ctx.saved_tensors
        nothing = (None,) * 9
        if all(plane is None for plane in of_picture):
            return nothing
        background = ctx.background if tensor is None else tensor
        gaussians, placed, behind = _scene(arrays, ctx.camera, background, pose)
        color, alpha, depth = (None if plane is None else _numpy(plane) for plane in of_picture)
        made = gaussians.render_backward(placed, color, alpha, depth, behind, **ctx.settings)
        # The library's gradient is perpendicular to the unit quaternion q / |q|: what is left of the chain is 1 / |q|.
        norms = np.linalg.norm(_numpy(arrays[1]).astype(np.float64), axis=1, keepdims=True)
        quats = made.quats / norms
        values = (
            made.means,
            quats,
            made.scales,
            made.opacities,
            made.sh,
            made.background,
            None if pose is None else _pose_gradient(_numpy(pose), made.pose),
        )
        gradients = [
            torch.from_numpy(np.ascontiguousarray(value, np.float32)) if needed and value is not None else None
            for value, needed in zip(values, ctx.needs_input_grad, strict=False)
        ]
        return (*gradients, None, None)


def _scene(
    arrays: Any,
    camera: Camera,
    background: Literal["white", "black", "transparent"] | torch.Tensor,
    pose: torch.Tensor | None,
) -> tuple[Gaussians, Camera, Background]:
    means, quats, scales, opacities, sh = (_numpy(array) for array in arrays)
    gaussians = Gaussians.from_arrays(means, scales, quats, opacities, sh)
    placed = camera if pose is None else camera.with_pose(_moved(camera.vehicle_from_camera, _numpy(pose)))
    return gaussians, placed, _numpy(background) if isinstance(background, torch.Tensor) else background


def _numpy(tensor: torch.Tensor) -> npt.NDArray[np.float32]:
    array: npt.NDArray[np.float32] = tensor.detach().contiguous().numpy()
    return array


def _moved(vehicle_from_camera: npt.NDArray[np.float64], pose: npt.NDArray[np.float32]) -> npt.NDArray[np.float64]:
    """The camera rotated and translated along its own axes: R exp([w]), t + R v."""
    moved = vehicle_from_camera.copy()
    rotation = vehicle_from_camera[:3, :3]
    w, v = pose[:3].astype(np.float64), pose[3:].astype(np.float64)
    moved[:3, :3] = rotation @ _exp(w)
    moved[:3, 3] += rotation @ v
    return moved


def _pose_gradient(pose: npt.NDArray[np.float32], at_camera: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Converts the gradient of small motions at the rendered pose to the gradient of the pose argument.

    exp(w + dw) = exp(w) exp(J dw), J the right Jacobian; dv is along the axes before the rotation.
    """
    w = pose[:3].astype(np.float64)
    return np.concatenate([_right_jacobian(w).T @ at_camera[:3], _exp(w) @ at_camera[3:]])


def _cross(w: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def _exp(w: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    angle, k = float(np.linalg.norm(w)), _cross(w)
    # np.sinc(x) is sin(pi x) / (pi x), and (1 - cos a) / a^2 = sinc(a / 2)^2 / 2 without the loss at 0.
    sine, cosine = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    turned: npt.NDArray[np.float64] = np.eye(3) + sine * k + cosine * (k @ k)
    return turned


def _right_jacobian(w: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    angle, k = float(np.linalg.norm(w)), _cross(w)
    first = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    # (a - sin a) / a^3; below 1e-3 its series, whose next term is 1e-14.
    second = 1 / 6 - angle**2 / 120 if angle < 1e-3 else (angle - np.sin(angle)) / angle**3
    jacobian: npt.NDArray[np.float64] = np.eye(3) - first * k + second * (k @ k)
    return jacobian


def _expect(tensor: object, argument: str, shape: tuple[int, ...]) -> None:
    if not isinstance(tensor, torch.Tensor):
        raise bad_type(argument, tensor, "a torch.Tensor of float32 on the CPU")
    wrong = None
    if tensor.dtype != torch.float32:
        wrong = f"of {tensor.dtype}; allowed: torch.float32, see .float()"
    elif tensor.device.type != "cpu":
        wrong = f"on {tensor.device}; allowed: on the CPU, see .cpu()"
    elif tensor.layout != torch.strided:
        wrong = f"of layout {tensor.layout}; allowed: torch.strided, see .to_dense()"
    if wrong is not None:
        raise ArgumentTypeError(Status.ARGUMENT, f"{argument}: tensor {wrong}")
    if tuple(tensor.shape) != shape:
        wanted = str(shape).replace("-1", "n")
        raise VgError(Status.ARGUMENT, f"{argument}: shape {tuple(tensor.shape)}; allowed: {wanted}")
