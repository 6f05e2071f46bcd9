"""The whole sedan: {material: mesh} in the vehicle frame, and its size.

Vehicle frame: x forward, y left, z up, metres, origin at the centre of the bounding box. The
left half is built and mirrored, so y = 0 is an exact symmetry plane.
"""

import numpy as np

from body import shell_mesh
from mesh import join
from paint import materials
from parts import left_parts


def build(cell=0.014):
    """Returns ({material: mesh}, size [length, width, height], z of the ground)."""
    half = materials(shell_mesh(cell)) + left_parts()
    by_material = {}
    for material, mesh in half:
        by_material.setdefault(material, []).extend([mesh, mesh.mirrored()])
    car = {material: join(meshes) for material, meshes in by_material.items()}
    points = np.concatenate([m.points for m in car.values()])
    low, high = points.min(0), points.max(0)
    centre = (low + high) / 2
    centre[1] = 0.0
    car = {material: mesh.moved(-centre) for material, mesh in car.items()}
    return car, high - low, float(-centre[2])
