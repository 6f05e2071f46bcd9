"""Camera models: pixels of camera-frame points, and rays of pixels, by COLMAP's own code.

    python scripts/golden/cameras_pycolmap.py tests/golden

Each model has a mild and a strong set of parameters. Points are spread over the whole image and
kept only where the distortion is still monotone on the way out from the axis; pixels to unproject
include the image corners where COLMAP's inverse is good to 1e-6 pixels.
"""

import numpy as np
import pycolmap

import golden

POINTS = 38
ROUND_TRIP = 1e-6  # pixels

MODELS = {  # name: (id, [(width, height, params)])
    "SIMPLE_PINHOLE": (0, [(640, 480, [525.0, 320.0, 240.0]), (1920, 1080, [900.5, 941.25, 562.75])]),
    "PINHOLE": (1, [(640, 480, [525.0, 530.0, 318.5, 243.25]), (512, 384, [410.0, 395.5, 251.0, 200.5])]),
    "SIMPLE_RADIAL": (2, [(640, 480, [525.0, 320.0, 240.0, -0.03]), (1024, 768, [620.0, 500.5, 391.0, -0.16])]),
    "RADIAL": (
        3,
        [(640, 480, [525.0, 320.0, 240.0, 0.04, -0.01]), (1024, 768, [600.0, 505.5, 380.0, -0.25, 0.07])],
    ),
    "OPENCV": (
        4,
        [
            (640, 480, [525.0, 530.0, 318.5, 243.25, -0.03, 0.01, 0.0004, -0.0006]),
            (1280, 720, [760.0, 755.0, 650.0, 352.0, -0.27, 0.08, 0.003, -0.002]),
        ],
    ),
    "OPENCV_FISHEYE": (
        5,
        [
            (640, 480, [400.0, 402.0, 318.5, 243.25, -0.01, 0.004, -0.001, 0.0002]),
            (1024, 1024, [360.0, 362.0, 515.0, 508.0, 0.06, -0.02, 0.006, -0.001]),
        ],
    ),
    "FULL_OPENCV": (
        6,
        [
            (640, 480, [525.0, 530.0, 318.5, 243.25, -0.03, 0.01, 0.0004, -0.0006, 0.001, 0.01, -0.004, 0.001]),
            (1280, 720, [800.0, 796.0, 632.0, 366.0, 0.35, -0.12, -0.001, 0.0015, 0.015, 0.62, 0.02, -0.008]),
        ],
    ),
}


def monotone(camera, xy):
    """Whether the distance from the principal point grows all the way out to the ray (x, y, 1)."""
    t = np.linspace(0, 1.02, 400)[:, None]
    pixels = camera.img_from_cam(np.concatenate([xy * t, np.ones_like(t)], 1))
    return bool((np.diff(np.linalg.norm(pixels - pixels[0], axis=1)) > 0).all())


def returns(camera, pixel):
    """The ray of a pixel, if it projects back onto it and lies in the monotone region."""
    xy = camera.cam_from_img(pixel)
    if xy is None or not np.isfinite(xy).all():
        return None
    back = camera.img_from_cam(np.append(xy, 1.0))
    if back is None or np.abs(back - pixel).max() > ROUND_TRIP or not monotone(camera, xy):
        return None
    return xy


def case(model, model_id, width, height, params, rng):
    camera = pycolmap.Camera(model=model, width=width, height=height, params=params)
    assert camera.model == pycolmap.CameraModelId(model_id)
    corners = [[0.0, 0.0], [width, 0.0], [0.0, height], [width, height], [0.5, 0.5], [width - 0.5, height - 0.5]]
    random = rng.uniform((0, 0), (width, height), (400, 2))
    kept = [(p, xy) for p in np.array(corners + random.tolist()) if (xy := returns(camera, p)) is not None]
    kept = kept[:POINTS]
    assert len(kept) == POINTS
    # Points come from other random pixels, at depths over four decades, on the axis as well.
    spread = [xy for p in rng.uniform((0, 0), (width, height), (400, 2)) if (xy := returns(camera, p)) is not None]
    points = [[0.0, 0.0, 1.0]] + [
        (np.append(xy, 1.0) * 10 ** rng.uniform(-2, 2)).tolist() for xy in spread[: POINTS - 1]
    ]
    return {
        "model": model,
        "model_id": model_id,
        "width": width,
        "height": height,
        "params": params,
        "points": points,
        "pixels": camera.img_from_cam(np.array(points)).tolist(),
        "unproject_pixels": [p.tolist() for p, _ in kept],
        "unproject_rays": [xy.tolist() for _, xy in kept],
    }


def main():
    rng = np.random.default_rng(11)
    cases = [case(m, i, w, h, p, rng) for m, (i, sets) in MODELS.items() for w, h, p in sets]
    golden.write("cameras_pycolmap.json", {"source": f"pycolmap {pycolmap.__version__}", "cases": cases})


if __name__ == "__main__":
    main()
