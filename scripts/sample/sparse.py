"""The sparse model of the sample: surface points, their tracks, and the change of world frame."""

import numpy as np

import colmap
from cameras import CX, CY, FOCAL, HEIGHT, WIDTH

POINTS = 300
LOOSE = 6  # features per image without a 3D point, as every real model has
MARGIN = 2.0  # pixels from the frame's edge
DEPTH_TOLERANCE = 2e-3  # metres; a point is seen when the ray to it meets the surface this close


def vehicle_from_world():
    """The fixed similarity from the gauge of the COLMAP model to the vehicle frame."""
    rng = np.random.default_rng(37)
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    if np.linalg.det(q) < 0:
        q[:, 0] *= -1
    out = np.eye(4)
    out[:3, :3] = q / 0.37  # one unit of the model is 1 / 0.37 m
    out[:3, 3] = [-1.9, 3.3, 0.8]
    return out


def surface_samples(car, count, rng):
    """Points [count][3] uniform over the area of the car's surface."""
    points = np.concatenate([m.points[m.faces] for m in car.values()])
    area = np.linalg.norm(np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]), axis=1)
    p = points[rng.choice(len(points), count, p=area / area.sum())]
    s, t = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
    return p[:, 0] * (1 - s) + p[:, 1] * s * (1 - t) + p[:, 2] * s * t


def write_sparse(folder, car, studio, cameras, pictures):
    rng = np.random.default_rng(1)
    candidates = surface_samples(car, 3 * POINTS, rng)
    pixels, seen = [], []
    for camera in cameras:
        uv, depth = camera.project(candidates)
        free = studio.hit(camera.centre, (candidates - camera.centre) / depth[:, None])
        inside = ((uv > MARGIN) & (uv < (WIDTH - MARGIN, HEIGHT - MARGIN))).all(1)
        pixels.append(uv)
        seen.append(inside & (np.abs(free - depth) < DEPTH_TOLERANCE))
    pixels, seen = np.array(pixels), np.array(seen)
    chosen = np.flatnonzero(seen.sum(0) >= 2)[:POINTS]
    point_ids = np.array([1 + k + k // 7 for k in range(len(chosen))])  # real ids have gaps

    world_from_vehicle = np.linalg.inv(vehicle_from_world())
    scale = np.cbrt(np.linalg.det(world_from_vehicle[:3, :3]))
    images, slot = [], {}
    for n, camera in enumerate(cameras):
        mine = [k for k in range(len(chosen)) if seen[n, chosen[k]]]
        uv = np.concatenate([pixels[n, chosen[mine]], rng.uniform((3, 3), (WIDTH - 3, HEIGHT - 3), (LOOSE, 2))])
        ids = np.concatenate([point_ids[mine], np.full(LOOSE, colmap.NO_POINT)])
        order = rng.permutation(len(uv))
        for index, o in enumerate(order):
            if o < len(mine):
                slot[n, mine[o]] = index
        pose = world_from_vehicle @ camera.vehicle_from_camera
        rotation = (pose[:3, :3] / scale).T  # camera from world
        translation = -rotation @ pose[:3, 3]
        images.append(
            colmap.Image(n + 1, camera.name, colmap.quaternion(rotation), translation, uv[order], ids[order])
        )
    points = []
    for k, c in enumerate(chosen):
        views = np.flatnonzero(seen[:, c])
        colours = [pictures[n][int(pixels[n, c, 1]), int(pixels[n, c, 0])] for n in views]
        position = world_from_vehicle[:3, :3] @ candidates[c] + world_from_vehicle[:3, 3]
        colour = np.round(np.mean(colours, axis=0)).astype(int)
        points.append(
            colmap.Point(int(point_ids[k]), position, colour, 0.0, [(int(n) + 1, slot[n, k]) for n in views])
        )
    colmap.write_model(folder, (WIDTH, HEIGHT), (FOCAL, FOCAL, CX, CY), images, points)
