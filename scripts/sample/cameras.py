"""The eight cameras and their conventions.

Camera frame: x right, y down, z forward. The centre of the pixel in column u and row v is at
(u + 0.5, v + 0.5), and cx, cy follow that convention (COLMAP's). The principal point is off the
image centre and the cameras roll a little, so that a reader that ignores either is detected.
"""

from dataclasses import dataclass

import numpy as np

WIDTH, HEIGHT = 512, 384
FOCAL = 600.0
CX, CY = 258.75, 190.5

# Azimuth from the front (positive to the left), distance in plan, height over ground, roll; degrees
# and metres. The first four see the right side and are the inputs; the others are the unseen views.
STATIONS = [
    (-38.0, 6.20, 1.45, 0.6),
    (-71.0, 6.15, 1.70, -0.8),
    (-106.0, 6.15, 1.35, 0.4),
    (-142.0, 6.25, 1.80, -0.5),
    (52.0, 6.20, 1.60, 0.7),
    (88.0, 6.30, 1.50, -0.6),
    (124.0, 6.20, 1.90, 0.3),
    (153.0, 6.30, 1.40, -0.4),
]
# The target of each camera: x, y, height over ground.
AIMS = [
    (0.10, 0.02, 0.62), (0.06, 0.00, 0.66), (-0.06, 0.03, 0.60), (-0.06, 0.00, 0.64),
    (0.10, 0.00, 0.63), (0.03, 0.02, 0.66), (-0.08, 0.00, 0.61), (-0.04, 0.02, 0.63),
]


@dataclass
class Camera:
    name: str
    vehicle_from_camera: np.ndarray  # [4][4], rigid

    @property
    def rotation(self):
        return self.vehicle_from_camera[:3, :3]

    @property
    def centre(self):
        return self.vehicle_from_camera[:3, 3]

    def project(self, points):
        """Pixels [n][2] and planar depths [n] of vehicle points [n][3]."""
        p = (points - self.centre) @ self.rotation
        return p[:, :2] / p[:, 2:] * FOCAL + (CX, CY), p[:, 2]

    def rays(self, pixels):
        """Directions [n][3] in the vehicle frame with planar depth 1, through pixels [n][2]."""
        xy = (np.asarray(pixels) - (CX, CY)) / FOCAL
        return np.concatenate([xy, np.ones((len(xy), 1))], 1) @ self.rotation.T


def pixel_centres():
    v, u = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    return np.stack([u.ravel(), v.ravel()], -1)


def look_at(centre, aim, roll):
    forward = aim - centre
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    c, s = np.cos(np.radians(roll)), np.sin(np.radians(roll))
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = c * right + s * down, c * down - s * right, forward
    pose[:3, 3] = centre
    return pose


def cameras(ground_z):
    out = []
    for k, ((azimuth, distance, height, roll), aim) in enumerate(zip(STATIONS, AIMS)):
        a = np.radians(azimuth)
        centre = np.array([distance * np.cos(a), distance * np.sin(a), ground_z + height])
        aim = np.array(aim) + (0, 0, ground_z)
        out.append(Camera(f"{k:03d}.png", look_at(centre, aim, roll)))
    return out
