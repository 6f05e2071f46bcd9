"""Checks the bundled sample against its mesh, with readers other than the code that wrote it.

    python scripts/sample/check_sedan.py tests/data/sedan

The poses come from transforms.json, so that file is checked too. Prints every figure and fails
when one is out of bounds.
"""

import json
import os
import sys

import numpy as np
import pycolmap
from PIL import Image

from sedan import build
from sparse import vehicle_from_world

failures = []


def claim(text, value, limit):
    ok = value <= limit
    print(f"{'ok  ' if ok else 'FAIL'} {text}: {value:.4g} (at most {limit:g})")
    if not ok:
        failures.append(text)


class View:
    def __init__(self, folder, frame):
        c2w = np.array(frame["transform_matrix"]) @ np.diag([1.0, -1.0, -1.0, 1.0])
        self.name = os.path.basename(frame["file_path"])
        self.rotation, self.centre = c2w[:3, :3], c2w[:3, 3]
        self.k = np.array([[frame["fl_x"], 0, frame["cx"]], [0, frame["fl_y"], frame["cy"]], [0, 0, 1]])
        read = lambda key: np.array(Image.open(f"{folder}/{frame[key]}"))
        self.picture, self.mask = read("file_path"), read("mask_path")
        self.depth = read("depth_file_path") if "depth_file_path" in frame else None
        assert self.picture.shape == (frame["h"], frame["w"], 3) and self.mask.shape == self.picture.shape[:2]

    def project(self, points):
        p = (points - self.centre) @ self.rotation @ self.k.T
        return p[:, :2] / p[:, 2:]


def planar_depth(view, mesh_points, faces):
    """Planar depth by projecting every triangle, in double precision; inf where there is no car."""
    height, width = view.mask.shape
    out = np.full((height, width), np.inf)
    uv = view.project(mesh_points)[faces]
    inverse_z = 1 / ((mesh_points - view.centre) @ view.rotation[:, 2])[faces]
    low = np.maximum(np.ceil(uv.min(1) - 0.5), 0).astype(int)
    high = np.minimum(np.floor(uv.max(1) - 0.5), (width - 1, height - 1)).astype(int)
    covers = np.flatnonzero((low <= high).all(1))
    for t, w, (u0, v0), (u1, v1) in zip(uv[covers], inverse_z[covers], low[covers], high[covers]):
        gv, gu = np.mgrid[v0 : v1 + 1, u0 : u1 + 1] + 0.5
        # Edge functions; the one opposite a corner is that corner's barycentric weight.
        e = []
        for k in range(3):
            p, q = t[(k + 1) % 3], t[(k + 2) % 3]
            e.append((q[0] - p[0]) * (gv - p[1]) - (q[1] - p[1]) * (gu - p[0]))
        area = e[0] + e[1] + e[2]
        inside = ((np.minimum.reduce(e) >= 0) | (np.maximum.reduce(e) <= 0)) & (area != 0)
        area = np.where(inside, area, 1.0)
        z = np.where(inside, area / np.where(inside, sum(a * b for a, b in zip(e, w)), 1.0), np.inf)
        tile = out[v0 : v1 + 1, u0 : u1 + 1]
        np.minimum(tile, z, out=tile)
    return out


def picture_offset(view):
    """(du, dv) of the picture's silhouette against the mask, in pixels.

    The anti-aliased border is about as wide to the left as to the right, so the midpoint of a
    row's extent is where the mask's is. The mean of the middle rows (and columns) is taken, as
    highlights that touch the border look like background.
    """
    out = []
    shown, mask = view.picture.min(2) < 250, view.mask > 0
    for a, b in ((shown, mask), (shown.T, mask.T)):
        rows = a.any(1) & b.any(1)
        middle = lambda m: (np.argmax(m, 1) + m.shape[1] - 1 - np.argmax(m[:, ::-1], 1)) / 2
        d = np.sort((middle(a) - middle(b))[rows])
        out.append(d[len(d) // 5 : -len(d) // 5].mean())
    return out


def main(folder):
    car, size, _ = build()
    vehicle = json.load(open(f"{folder}/vehicle.json"))
    claim("size in vehicle.json against the mesh, metres", np.abs(size - vehicle["size_m"]).max(), 1e-9)
    points = np.concatenate([m.points for m in car.values()])
    offsets = np.cumsum([0] + [len(m.points) for m in car.values()])
    faces = np.concatenate([m.faces + o for m, o in zip(car.values(), offsets)])
    keys = np.round(points / 1e-9).astype(np.int64)
    mirror = keys * (1, -1, 1)
    together = np.unique(np.concatenate([keys, mirror]), axis=0)
    claim("vertices without a mirror image", len(together) - len(np.unique(keys, axis=0)), 0)

    transforms = json.load(open(f"{folder}/transforms.json"))
    views = [View(folder, f) for f in transforms["frames"]]
    for view in views:
        mask = view.mask == 255
        claim(f"{view.name} mask values other than 0 and 255", int((view.mask % 255 != 0).sum()), 0)
        exact = planar_depth(view, points, faces)
        claim(f"{view.name} mask pixels against projected triangles", int((mask ^ np.isfinite(exact)).sum()), 20)
        uv = view.project(points)
        v, u = np.nonzero(mask)
        bounds = np.append(uv.min(0) - (u.min(), v.min()), uv.max(0) - (u.max() + 1, v.max() + 1))
        claim(f"{view.name} mask's box against projected vertices, pixels", np.abs(bounds).max(), 1.0)
        margin = min(uv.min(), view.mask.shape[1] - uv[:, 0].max(), view.mask.shape[0] - uv[:, 1].max())
        claim(f"{view.name} car leaves the frame by, pixels", -margin, -4.0)
        claim(f"{view.name} non-white pixels far outside the mask", stray(view), 0)
        claim(f"{view.name} picture against mask, pixels", np.abs(picture_offset(view)).max(), 0.15)
        if view.depth is not None:
            claim(f"{view.name} depth defined elsewhere than the mask", int(((view.depth > 0) ^ mask).sum()), 0)
            both = mask & np.isfinite(exact)
            error = np.abs(view.depth[both] - 1000 * exact[both])
            # A ray along an edge may take either side of it in another precision.
            claim(f"{view.name} pixels whose depth is off by more than 0.55 mm", int((error > 0.55).sum()), 20)
            claim(f"{view.name} median depth error, millimetres", np.median(error), 0.3)
    inputs, tests = views[:4], views[4:]
    gap = min(np.linalg.norm(t.centre - i.centre * (1, -1, 1)) for t in tests for i in inputs)
    claim("unseen cameras nearer than this to a mirrored input, metres", -gap, -0.5)
    check_sparse(folder, views)
    total = sum(os.path.getsize(os.path.join(d, n)) for d, _, names in os.walk(folder) for n in names)
    claim("bytes in all", total, 800_000)
    sys.exit(f"{len(failures)} failed" if failures else 0)


def stray(view):
    grown = view.mask > 0
    for axis in (0, 1):
        grown = grown | np.roll(grown, 1, axis) | np.roll(grown, -1, axis)
    return int(((view.picture < 255).any(2) & ~grown).sum())


def check_sparse(folder, views):
    to_vehicle = np.array(json.load(open(f"{folder}/vehicle_from_world.json"))["vehicle_from_world"])
    claim("vehicle_from_world against the script", np.abs(to_vehicle - vehicle_from_world()).max(), 0)
    scale = np.cbrt(np.linalg.det(to_vehicle[:3, :3]))
    binary, text = pycolmap.Reconstruction(), pycolmap.Reconstruction()
    binary.read_binary(f"{folder}/sparse/0")
    text.read_text(f"{folder}/sparse/0")
    print(binary.summary())
    differ = 0
    for i, image in binary.images.items():
        other = text.images[i]
        differ += not np.array_equal(image.cam_from_world().matrix(), other.cam_from_world().matrix())
        pixels = [[(*p.xy, p.point3D_id) for p in im.points2D] for im in (image, other)]
        differ += pixels[0] != pixels[1]
    for k, point in binary.points3D.items():
        differ += not np.array_equal(point.xyz, text.points3D[k].xyz)
    claim("differences between text and binary", differ, 0)
    worst_pose, worst_pixel, observations = 0.0, 0.0, 0
    camera = binary.cameras[1]
    for image in binary.images.values():
        view = next(v for v in views if v.name == image.name)
        centre = to_vehicle[:3, :3] @ image.projection_center() + to_vehicle[:3, 3]
        rotation = (to_vehicle[:3, :3] / scale) @ image.cam_from_world().rotation.matrix().T
        worst_pose = max(worst_pose, np.abs(centre - view.centre).max(), np.abs(rotation - view.rotation).max())
        for p in image.points2D:
            if p.has_point3D():
                xyz = image.cam_from_world() * binary.points3D[p.point3D_id].xyz
                worst_pixel = max(worst_pixel, np.abs(camera.img_from_cam(xyz) - p.xy).max())
                observations += 1
    claim("sparse poses against transforms.json", worst_pose, 1e-12)
    claim("reprojection error, pixels", worst_pixel, 1e-9)
    claim("3D points short of 250", 250 - len(binary.points3D), 0)
    tracked = sum(p.track.length() for p in binary.points3D.values())
    claim("observations missing from tracks", abs(observations - tracked), 0)
    claim("track element that does not point back", sum(
        binary.images[e.image_id].points2D[e.point2D_idx].point3D_id != k
        for k, p in binary.points3D.items() for e in p.track.elements), 0)


if __name__ == "__main__":
    main(sys.argv[1])
