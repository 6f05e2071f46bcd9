"""Cameras and poses, compared with pycolmap."""

from __future__ import annotations

import numpy as np
import pycolmap
import pytest

import vehicle_gaussians as vg
from conftest import looking_at_the_origin

POSE = looking_at_the_origin((5.0, -4.0, 1.0))
PARAMS = {
    "SIMPLE_PINHOLE": [600, 320, 240],
    "PINHOLE": [600, 610, 320, 240],
    "SIMPLE_RADIAL": [600, 320, 240, -0.1],
    "RADIAL": [600, 320, 240, -0.1, 0.02],
    "OPENCV": [600, 610, 320, 240, -0.1, 0.02, 1e-3, -2e-3],
    "OPENCV_FISHEYE": [600, 610, 320, 240, -0.01, 0.02, -1e-3, 1e-4],
    "FULL_OPENCV": [600, 610, 320, 240, -0.1, 0.02, 1e-3, -2e-3, 0.01, 0.02, -0.01, 0.001],
}


@pytest.mark.parametrize("model", PARAMS)
def test_colmap_models_come_by_name_and_number_and_go_back(model: str) -> None:
    camera = vg.Camera.from_colmap(model, 640, 480, PARAMS[model], POSE)
    number = int(pycolmap.CameraModelId.__members__[model].value)
    assert vg.Camera.from_colmap(number, 640, 480, PARAMS[model], POSE) == camera
    again = vg.Camera.from_colmap(camera.model, 640, 480, camera.params, camera.vehicle_from_camera)
    np.testing.assert_array_equal(again.params, camera.params)
    theirs = pycolmap.Camera(model=model, width=640, height=480, params=PARAMS[model])
    np.testing.assert_allclose(camera.K, theirs.calibration_matrix())
    same = pycolmap.Camera(model=camera.model, width=640, height=480, params=camera.params)
    for point in ([0.3, -0.2, 1.0], [-0.1, 0.25, 1.0]):
        np.testing.assert_allclose(same.img_from_cam(point), theirs.img_from_cam(point), atol=1e-9)


def test_a_pose_is_3x4_or_4x4_and_comes_back_as_4x4() -> None:
    K = [[600, 0, 320], [0, 610, 240], [0, 0, 1]]
    for pose in (POSE, POSE[:3], POSE.tolist(), np.asfortranarray(POSE)):
        camera = vg.Camera.from_matrix(K, pose, 640, 480)
        np.testing.assert_allclose(camera.vehicle_from_camera, POSE, atol=1e-12)
    assert (camera.width, camera.height, camera.model) == (640, 480, "PINHOLE")
    np.testing.assert_array_equal(camera.K, K)
    moved = camera.with_pose(np.eye(4))
    np.testing.assert_array_equal(moved.vehicle_from_camera, np.eye(4))
    assert moved != camera and moved.with_pose(POSE) == camera
    assert "PINHOLE, 640x480" in repr(camera)


def test_opencvs_principal_point_moves_by_half_a_pixel() -> None:
    K = np.array([[600.0, 0, 319.5], [0, 610, 239.5], [0, 0, 1]])
    camera = vg.Camera.from_opencv(K, POSE, 640, 480)
    np.testing.assert_array_equal(camera.K[:2, 2], [320, 240])
    assert camera == vg.Camera.from_matrix(camera.K, POSE, 640, 480)
    # As cv2.calibrateCamera returns them.
    bent = vg.Camera.from_opencv(K, POSE, 640, 480, np.array([[0.1, 0.2, 0.3, 0.4, 0.5]]))
    np.testing.assert_array_equal(bent.params, [600, 610, 320, 240, 0.1, 0.2, 0.3, 0.4, 0.5, 0, 0, 0])
    fisheye = vg.Camera.from_opencv(K, POSE, 640, 480, [[0.1], [0.2], [0.3], [0.4]], fisheye=True)
    assert fisheye == vg.Camera.from_colmap("OPENCV_FISHEYE", 640, 480, fisheye.params, POSE)


def test_a_matrix_keeps_its_principal_point_to_the_last_bit() -> None:
    K = np.array([[600.0, 0, 0.1], [0, 600, 1 / 3], [0, 0, 1]])
    np.testing.assert_array_equal(vg.Camera.from_matrix(K, POSE, 640, 480).K, K)


def test_a_point_is_drawn_at_its_pixel() -> None:
    # A dot on the optical axis lights the four pixels around the principal point alike; half a pixel off, one of them.
    def brightest(cx: float) -> np.ndarray:
        camera = vg.Camera.from_matrix([[50, 0, cx], [0, 50, cx], [0, 0, 1]], np.eye(4), 8, 8)
        dot = vg.Gaussians.from_arrays(
            *(np.array(a, np.float32) for a in ([[0, 0, 1]], [[1e-3] * 3], [[1, 0, 0, 0]], [0.9], [[[1.77] * 3]]))
        )
        return dot.render(camera, "black")[..., 0]

    middle = brightest(4.0)
    assert len(set(middle[3:5, 3:5].ravel())) == 1 and middle[3, 3] == middle.max()
    off = brightest(4.5)
    assert (off == off.max()).sum() == 1 and off[4, 4] == off.max()


def test_opencv_coefficients_are_in_opencvs_order() -> None:
    K = [[600, 0, 320], [0, 610, 240], [0, 0, 1]]
    expected = {4: PARAMS["OPENCV"], 8: PARAMS["FULL_OPENCV"]}
    for count, params in expected.items():
        camera = vg.Camera.from_matrix(K, POSE, 640, 480, params[4:][:count])
        assert camera == vg.Camera.from_colmap("OPENCV" if count == 4 else "FULL_OPENCV", 640, 480, params, POSE)
    five = vg.Camera.from_matrix(K, POSE, 640, 480, [0.1, 0.2, 0.3, 0.4, 0.5])
    np.testing.assert_array_equal(five.params[4:], [0.1, 0.2, 0.3, 0.4, 0.5, 0, 0, 0])
    assert vg.Camera.from_matrix(K, POSE, 640, 480, []).model == "PINHOLE"


def test_scaling_scales_the_intrinsics_and_keeps_the_lens() -> None:
    camera = vg.Camera.from_colmap("OPENCV", 640, 480, PARAMS["OPENCV"], POSE).scaled(320, 120)
    np.testing.assert_allclose(camera.params[:4], [300, 152.5, 160, 60])
    np.testing.assert_array_equal(camera.params[4:], PARAMS["OPENCV"][4:])
    assert (camera.width, camera.height) == (320, 120)


def test_a_cropped_camera_sees_what_was_in_that_part() -> None:
    camera = vg.Camera.from_matrix([[50, 0, 32], [0, 50, 24], [0, 0, 1]], np.eye(4), 64, 48)
    dot = vg.Gaussians.from_arrays(
        *(
            np.array(a, np.float32)
            for a in ([[0.1, 0, 1]], [[0.1, 0.05, 0.1]], [[1, 0, 0, 0]], [0.9], [[[1.0, 0.2, 0.1]]])
        )
    )
    whole, part = dot.render(camera), dot.render(camera.cropped(20, 10, 24, 30))
    np.testing.assert_array_equal(part, whole[10:40, 20:44])


def test_a_tracked_box_gives_the_camera_in_the_vehicles_frame() -> None:
    ego_from_vehicle = looking_at_the_origin((30.0, 4.0, 1.5))
    pose = vg.pose_from_box(ego_from_vehicle, ego_from_vehicle @ POSE)
    np.testing.assert_allclose(pose, POSE, atol=1e-12)


def test_a_colmap_pose_is_pycolmaps_inverse() -> None:
    rotation = pycolmap.Rotation3d([0.1, -0.2, 0.3, 0.9])
    rotation.normalize()
    camera_from_world = pycolmap.Rigid3d(rotation, [1.0, 2.0, 3.0])
    x, y, z, w = camera_from_world.rotation.quat
    pose = vg.pose_from_colmap([w, x, y, z], camera_from_world.translation)
    np.testing.assert_allclose(pose[:3], camera_from_world.inverse().matrix(), atol=1e-12)
    vehicle_from_world = np.eye(4)
    vehicle_from_world[:3, :3] *= 2.0
    vehicle_from_world[:3, 3] = [1, 0, 0]
    scaled = vg.pose_from_colmap([w, x, y, z], camera_from_world.translation, vehicle_from_world)
    np.testing.assert_allclose(scaled[:3, :3], pose[:3, :3], atol=1e-12)
    np.testing.assert_allclose(scaled[:3, 3], 2 * pose[:3, 3] + [1, 0, 0], atol=1e-12)


def test_an_opengl_pose_has_its_y_and_z_axes_turned() -> None:
    pose = vg.pose_from_opengl(POSE)
    np.testing.assert_allclose(pose, POSE @ np.diag([1, -1, -1, 1]), atol=1e-12)
    np.testing.assert_allclose(vg.pose_from_opengl(POSE[:3], np.eye(4)), pose, atol=1e-12)


def test_points_known_in_both_frames_give_the_similarity() -> None:
    random = np.random.default_rng(0)
    expected = POSE.copy()
    expected[:3, :3] *= 0.37
    points = random.normal(size=(6, 3))
    found = vg.similarity_from_points(points, points @ expected[:3, :3].T + expected[:3, 3])
    np.testing.assert_allclose(found, expected, atol=1e-12)
    with pytest.raises(vg.VgError, match="one line"):
        vg.similarity_from_points([[0, 0, 0], [1, 0, 0], [2, 0, 0]], np.eye(3))
