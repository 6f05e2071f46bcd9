"""Writes tests/data/colmap: a COLMAP model with multi-camera rigs, and its expected values.

    pip install pycolmap==4.2.1
    python tests/make_colmap_models.py tests/data/colmap

Eight cameras in four rigs of two, one camera of each supported model (and a second pinhole).
Folder bin/ holds the binary files of pycolmap, txt/ its text files; both with rigs and frames.
"""

import json
import sys
from pathlib import Path

import numpy as np
import pycolmap

MODELS = {
    "SIMPLE_PINHOLE": [500.0, 320.5, 239.25],
    "PINHOLE": [500.0, 510.0, 320.5, 239.25],
    "SIMPLE_RADIAL": [500.0, 320.5, 239.25, -0.05],
    "RADIAL": [500.0, 320.5, 239.25, -0.05, 0.01],
    "OPENCV": [500.0, 510.0, 320.5, 239.25, -0.05, 0.01, 0.001, -0.002],
    "OPENCV_FISHEYE": [500.0, 510.0, 320.5, 239.25, -0.05, 0.01, 0.001, -0.002],
    "FULL_OPENCV": [500.0, 510.0, 320.5, 239.25, -0.05, 0.01, 0.001, -0.002, 0.003, 0.01, 0.002, 0.001],
}


def main(out: Path) -> None:
    pycolmap.set_random_seed(7)
    options = pycolmap.SyntheticDatasetOptions()
    options.num_rigs = 4
    options.num_cameras_per_rig = 2
    options.num_frames_per_rig = 1
    options.num_points3D = 6
    options.num_points2D_without_point3D = 2
    options.camera_width, options.camera_height = 640, 480
    options.sensor_from_rig_translation_stddev = 0.2
    options.sensor_from_rig_rotation_stddev = 10.0
    model = pycolmap.synthesize_dataset(options)
    names = list(MODELS) + ["PINHOLE"]
    for camera_id, name in zip(sorted(model.cameras), names):
        camera = model.cameras[camera_id]
        camera.model = pycolmap.CameraModelId.__members__[name]
        camera.params = np.array(MODELS[name])
    for kind, write in (("bin", model.write_binary), ("txt", model.write_text)):
        (out / kind).mkdir(parents=True, exist_ok=True)
        write(out / kind)
    expected = {
        "images": {
            image.name: {
                "id": image.image_id,
                "camera_id": image.camera_id,
                "world_from_camera": image.cam_from_world().inverse().matrix().tolist(),
            }
            for image in model.images.values()
        },
        "cameras": {
            str(camera.camera_id): {
                "model": camera.model.name,
                "size": [camera.width, camera.height],
                "params": list(camera.params),
            }
            for camera in model.cameras.values()
        },
        "points": sorted(point.xyz.tolist() + point.color.tolist() for point in model.points3D.values()),
    }
    (out / "expected.json").write_text(json.dumps(expected, indent=1, sort_keys=True) + "\n")


main(Path(sys.argv[1]))
