"""Pictures of the car by path tracing (Mitsuba 3), and masks and depths by single rays.

The ground gives bounce light and reflections but is not in the picture: the frame is rendered at
four times the resolution, only subpixels that the car covers wholly give colour, and the result
is laid on white with the car's anti-aliased coverage.
"""

import os
import tempfile

import mitsuba as mi
import numpy as np

from cameras import CX, CY, FOCAL, HEIGHT, WIDTH, pixel_centres
from mesh import write_ply

mi.set_variant("scalar_rgb")

OVERSAMPLING = 4
GUIDES = {"type": "aov", "aovs": "albedo:albedo,normal:sh_normal", "image": {"type": "depth"}}
EXPOSURE = 1.15


def paint(rgb, **more):
    return {"type": "principled", "base_color": {"type": "rgb", "value": rgb}, "specular": 0.5, **more}


MATERIALS = {
    "paint": paint([0.004, 0.065, 0.30], roughness=0.35, clearcoat=1.0, clearcoat_gloss=0.93),
    "silver": paint([0.42, 0.44, 0.46], roughness=0.38, clearcoat=0.8, clearcoat_gloss=0.9),
    "white": paint([0.62, 0.61, 0.59], roughness=0.4, clearcoat=0.6, clearcoat_gloss=0.9),
    "accent": paint([0.85, 0.20, 0.02], roughness=0.4, clearcoat=0.8, clearcoat_gloss=0.9),
    "glass": {**paint([0.010, 0.014, 0.016], roughness=0.12), "specular": 0.4},
    "pillar": paint([0.09, 0.09, 0.095], roughness=0.4),
    "chrome": paint([0.66, 0.67, 0.68], roughness=0.22, metallic=1.0),
    "trim": paint([0.025, 0.025, 0.027], roughness=0.55),
    "seam": paint([0.008, 0.008, 0.010], roughness=0.8),
    "lamp": paint([0.88, 0.90, 0.92], roughness=0.2),
    "lamp_dark": paint([0.22, 0.24, 0.26], roughness=0.12),
    "tail": paint([0.50, 0.010, 0.012], roughness=0.15),
    "tyre": paint([0.022, 0.022, 0.022], roughness=0.75),
    "rim": paint([0.62, 0.63, 0.64], roughness=0.32, metallic=0.7),
    "wheel_dark": paint([0.03, 0.03, 0.032], roughness=0.6),
    "brake": paint([0.25, 0.24, 0.23], roughness=0.45, metallic=0.5),
    "liner": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.012, 0.012, 0.012]}},
    "plate": paint([0.85, 0.85, 0.80], roughness=0.5),
}


def sky(rows=64):
    """A soft sky with a wide, mild sun behind the front right; rows x 2 rows x 3, z up."""
    elevation = np.radians(90 - (np.arange(rows) + 0.5) * 180 / rows)[:, None]
    azimuth = ((np.arange(2 * rows) + 0.5) * np.pi / rows)[None, :]
    up = np.sin(elevation)
    horizon, zenith = np.array([0.62, 0.66, 0.72]), np.array([0.24, 0.36, 0.62])
    t = np.clip(up, 0, 1)[..., None] ** 0.55
    light = horizon * (1 - t) + zenith * t + 0 * azimuth[..., None]
    sun = np.radians([48.0, 62.0])  # elevation, azimuth in the map
    cosine = up * np.sin(sun[0]) + np.cos(elevation) * np.cos(sun[0]) * np.cos(azimuth - sun[1])
    for other in (-1, 1):  # two broad lights, one over each side, of different strength
        c = up * np.sin(sun[0]) + np.cos(elevation) * np.cos(sun[0]) * np.cos(azimuth - other * np.pi / 2)
        light = light + (1.6 if other < 0 else 1.3) * np.exp(-(1 - c[..., None]) / 0.05)
    light = light + np.array([1.0, 0.93, 0.82]) * 13.0 * np.exp(-(1 - cosine[..., None]) / 0.02)
    # A darker band of far trees low over the horizon, for reflections to bend around.
    band = np.exp(-(((np.degrees(elevation) - 3) / 5) ** 2))[..., None]
    return (light * (1 - 0.72 * band)).astype(np.float32)


class Studio:
    """The car's scenes, loaded once."""

    def __init__(self, car, ground_z):
        self.folder = tempfile.TemporaryDirectory()
        shapes = {}
        for material, mesh in car.items():
            path = os.path.join(self.folder.name, material + ".ply")
            write_ply(path, mesh)
            shapes[material] = {
                "type": "ply",
                "filename": path,
                "bsdf": {"type": "twosided", "bsdf": MATERIALS[material]},
            }
        self.car = mi.load_dict({"type": "scene", **shapes})
        frame = mi.ScalarTransform4f
        ground = {
            "type": "rectangle",
            "to_world": frame().translate([0, 0, ground_z]).scale([60, 60, 1]),
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.30, 0.29, 0.28]}},
        }
        light = {
            "type": "envmap",
            "bitmap": mi.Bitmap(sky()),
            "to_world": frame().rotate([1, 0, 0], 90),  # the map's pole is y up; ours is z
        }
        self.lit = mi.load_dict({"type": "scene", "ground": ground, "light": light, **shapes})

    def picture(self, camera, samples, seed):
        """sRGB image [h][w][3] in 0..255 on white."""
        k = OVERSAMPLING
        colour = _film(self.lit, {"type": "path", "max_depth": 5}, camera, samples, seed)[..., :3]
        guide = _film(self.car, GUIDES, camera, 4, seed)
        cover = guide[..., 3]
        whole = (cover > 0.999).astype(np.float64)
        colour = np.minimum(colour.astype(np.float64), 4.0)  # a lone bright sample must not speckle
        area = lambda a: a.reshape(HEIGHT, k, WIDTH, k, -1).mean((1, 3))
        weight = area(whole)
        partial = area(cover.astype(np.float64))
        over_car = lambda a: np.where(
            weight > 0,
            area(a * whole[..., None]) / np.maximum(weight, 1e-9),
            area(a * cover[..., None]) / np.maximum(partial, 1e-9),
        )
        shown = smooth(srgb(over_car(colour) * EXPOSURE), over_car(guide[..., 4:10]), partial > 0)
        return 255 * (shown * partial + (1 - partial))

    def planar_depth(self, camera):
        """Planar depth in metres [h][w], inf where the ray through the pixel centre misses."""
        return self.hit(camera.centre, camera.rays(pixel_centres())).reshape(HEIGHT, WIDTH)

    def hit(self, origin, directions):
        """Ray lengths in units of each direction [n], inf where nothing is hit."""
        origin = mi.Point3f([float(c) for c in origin])
        lengths = np.linalg.norm(directions, axis=1)
        out = np.empty(len(directions))
        for i, d in enumerate(directions / lengths[:, None]):
            ray = mi.Ray3f(origin, mi.Vector3f(float(d[0]), float(d[1]), float(d[2])))
            out[i] = self.car.ray_intersect_preliminary(ray).t
        return out / lengths


def _film(scene, integrator, camera, samples, seed):
    """Render at four times the resolution; returns RGBA, linear."""
    k = OVERSAMPLING
    # Mitsuba's principal point is the film's centre: a larger film, cropped, moves it.
    left, top = max(0, WIDTH - 2 * CX), max(0, HEIGHT - 2 * CY)
    full = int(round(k * 2 * (CX + left))), int(round(k * 2 * (CY + top)))
    pose = camera.vehicle_from_camera.copy()
    pose[:3, :2] *= -1  # Mitsuba's camera: x left, y up, z forward
    sensor = {
        "type": "perspective",
        "fov_axis": "x",
        "fov": float(np.degrees(2 * np.arctan(full[0] / 2 / (k * FOCAL)))),
        "near_clip": 0.1,
        "far_clip": 1000.0,
        "to_world": mi.ScalarTransform4f(pose),
        "sampler": {"type": "multijitter", "sample_count": samples},
        "film": {
            "type": "hdrfilm",
            "width": full[0],
            "height": full[1],
            "crop_offset_x": int(round(k * left)),
            "crop_offset_y": int(round(k * top)),
            "crop_width": k * WIDTH,
            "crop_height": k * HEIGHT,
            "pixel_format": "rgba",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
    }
    image = mi.render(scene, sensor=mi.load_dict(sensor), integrator=mi.load_dict(integrator), spp=samples, seed=seed)
    return np.array(image).reshape(k * HEIGHT, k * WIDTH, -1)


def smooth(colour, guide, valid, radius=3, guide_width=0.06, colour_width=0.05):
    """Take the last sampling noise out of a picture: a cross bilateral filter.

    A pixel is averaged with neighbours of the same paint and orientation (guide: albedo and
    normal, free of noise) and nearly the same colour, so highlights, edges and stripes stay.
    """
    pad = lambda a: np.pad(a, [(radius, radius)] * 2 + [(0, 0)] * (a.ndim - 2))
    colours, guides, valids = pad(colour), pad(guide), pad(valid.astype(float))
    total, weights = np.zeros_like(colour), np.zeros(colour.shape[:2] + (1,))
    rows, columns = colour.shape[:2]
    for dv in range(2 * radius + 1):
        for du in range(2 * radius + 1):
            at = np.s_[dv : dv + rows, du : du + columns]
            apart = ((guides[at] - guide) ** 2).sum(-1, keepdims=True) / guide_width**2
            apart = apart + ((colours[at] - colour) ** 2).sum(-1, keepdims=True) / colour_width**2
            w = np.exp(-apart) * valids[at]
            total += w * colours[at]
            weights += w
    return np.where(weights > 0, total / np.maximum(weights, 1e-12), colour)


def srgb(x):
    x = np.clip(x, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
