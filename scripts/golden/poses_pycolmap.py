"""Poses: COLMAP's quaternion and translation as matrices, and the same pose in nerfstudio's convention.

    python scripts/golden/poses_pycolmap.py tests/golden

Matrices and centres are pycolmap's. The OpenGL camera-to-world follows nerfstudio's COLMAP
converter (nerfstudio/process_data/colmap_utils.py, colmap_to_json): the inverse of COLMAP's
world-to-camera with columns 1 and 2 negated. That converter then also turns the world upright
(rows swapped, z negated); this is its choice of world, not of camera axes, and is left out here.
"""

import numpy as np
import pycolmap

import golden


def main():
    rng = np.random.default_rng(12)
    quaternions = rng.normal(size=(7, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    # No rotation, half turns (w = 0) and a rotation by 1e-7: cases where a conversion with branches goes wrong.
    special = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0.6, 0.8], [1, 5e-8, 0, 0]], float)
    poses = []
    for q in np.concatenate([quaternions, special]):
        t = rng.normal(size=3) * 10 ** rng.uniform(-1, 3)
        cam_from_world = pycolmap.Rigid3d(pycolmap.Rotation3d(q[[1, 2, 3, 0]]), t)  # takes x, y, z, w
        world_from_cam = cam_from_world.inverse().matrix()
        opengl = np.vstack([world_from_cam, [0, 0, 0, 1]])
        opengl[:, 1:3] *= -1
        poses.append(
            {
                "qvec_wxyz": q.tolist(),
                "tvec": t.tolist(),
                "cam_from_world": cam_from_world.matrix().tolist(),
                "world_from_cam": world_from_cam.tolist(),
                "projection_center": world_from_cam[:, 3].tolist(),
                "opengl_camera_to_world": opengl.tolist(),
            }
        )
    golden.write("poses_pycolmap.json", {"source": f"pycolmap {pycolmap.__version__}", "poses": poses})


if __name__ == "__main__":
    main()
