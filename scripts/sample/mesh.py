"""Triangle meshes with smooth normals: cut along a scalar field, mirror, join, write as PLY.

Paint boundaries, windows and seams are cuts of the body mesh along the zero line of a smooth
field, so their edges stay crisp at any mesh resolution.
"""

from dataclasses import dataclass

import numpy as np


@dataclass
class Mesh:
    points: np.ndarray  # [n][3], metres
    normals: np.ndarray  # [n][3], unit
    faces: np.ndarray  # [m][3], counter-clockwise from outside

    def mirrored(self):
        """The mesh reflected in y = 0; faces are reversed so that they still face outwards."""
        flip = np.array([1.0, -1.0, 1.0])
        return Mesh(self.points * flip, self.normals * flip, self.faces[:, ::-1])

    def moved(self, offset):
        return Mesh(self.points + np.asarray(offset, float), self.normals, self.faces)


def join(meshes):
    """One mesh from many, vertices kept apart."""
    offsets = np.cumsum([0] + [len(m.points) for m in meshes[:-1]])
    return Mesh(
        np.concatenate([m.points for m in meshes]),
        np.concatenate([m.normals for m in meshes]),
        np.concatenate([m.faces + o for m, o in zip(meshes, offsets)]),
    )


def split(mesh, field):
    """Cut along field(points) = 0. Returns (part where the field is negative, the rest)."""
    value = field(mesh.points)
    value = np.where(np.abs(value) < 1e-9, 1e-9, value)  # no vertex lies exactly on the cut
    negative = value < 0
    count = negative[mesh.faces].sum(axis=1)
    inside, outside = [mesh.faces[count == 3]], [mesh.faces[count == 0]]
    points, normals, base = [mesh.points], [mesh.normals], len(mesh.points)
    # A mixed triangle has one corner alone on its side: the cut makes a triangle and a quad.
    for alone_is_inside in (True, False):
        faces = mesh.faces[count == (1 if alone_is_inside else 2)]
        if len(faces) == 0:
            continue
        alone = np.argmax(negative[faces] == alone_is_inside, axis=1)
        rows = np.arange(len(faces))
        a, b, c = (faces[rows, (alone + k) % 3] for k in range(3))
        cuts = []
        for other in (b, c):
            t = (value[a] / (value[a] - value[other]))[:, None]
            points.append(mesh.points[a] * (1 - t) + mesh.points[other] * t)
            n = mesh.normals[a] * (1 - t) + mesh.normals[other] * t
            normals.append(n / np.linalg.norm(n, axis=1, keepdims=True))
            cuts.append(base + rows)
            base += len(faces)
        ab, ac = cuts
        tip = np.stack([a, ab, ac], 1)
        rest = np.concatenate([np.stack([ab, b, c], 1), np.stack([ab, c, ac], 1)])
        (inside if alone_is_inside else outside).append(tip)
        (outside if alone_is_inside else inside).append(rest)
    points, normals = np.concatenate(points), np.concatenate(normals)
    return tuple(_compact(points, normals, np.concatenate(f)) for f in (inside, outside))


def _compact(points, normals, faces):
    used, index = np.unique(faces, return_inverse=True)
    return Mesh(points[used], normals[used], index.reshape(-1, 3))


def from_grid(points, closed_u=False, closed_v=False):
    """A mesh from a grid of points [u][v][3], with normals averaged over the faces."""
    nu, nv = points.shape[:2]
    index = np.arange(nu * nv).reshape(nu, nv)
    if closed_u:
        index = np.concatenate([index, index[:1]])
    if closed_v:
        index = np.concatenate([index, index[:, :1]], axis=1)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    )
    return with_face_normals(points.reshape(-1, 3), faces)


def with_face_normals(points, faces):
    """Vertex normals as the area-weighted mean of the adjacent faces' normals."""
    p = points[faces]
    n = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    normals = np.zeros_like(points)
    for k in range(3):
        np.add.at(normals, faces[:, k], n)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(points, normals / np.maximum(length, 1e-12), faces)


def flat(mesh):
    """The same surface with hard edges: every face has its own vertices and normal."""
    points = mesh.points[mesh.faces].reshape(-1, 3)
    return with_face_normals(points, np.arange(len(points)).reshape(-1, 3))


def write_ply(path, mesh):
    """Binary PLY with positions and normals, the form the renderer loads."""
    vertex = np.concatenate([mesh.points, mesh.normals], axis=1).astype("<f4")
    face = np.empty(len(mesh.faces), dtype=[("n", "u1"), ("v", "<i4", 3)])
    face["n"], face["v"] = 3, mesh.faces
    names = "x y z nx ny nz".split()
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertex)}"]
    header += [f"property float {n}" for n in names]
    header += [f"element face {len(face)}", "property list uchar int vertex_indices", "end_header"]
    with open(path, "wb") as f:
        f.write(("\n".join(header) + "\n").encode() + vertex.tobytes() + face.tobytes())
