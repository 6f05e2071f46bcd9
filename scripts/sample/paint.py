"""Divides the body shell into materials: windows, lamps, grille, seams, stripes, two-tone paint.

Each region is a smooth field over the shell, negative inside, with its zero line as the border.
Fields are functions of (x, a = |y|, z), so the livery is mirror symmetric by construction.
"""

import numpy as np

from body import ARCH_RADIUS, FRONT_AXLE, REAR_AXLE, WHEEL_RADIUS, cabin_half_width, roof, rear_window
from body import smooth_max, windscreen
from mesh import split


def coordinates(p):
    return p[:, 0], np.abs(p[:, 1]), p[:, 2]


def all_of(*fields, k=0.03):
    out = fields[0]
    for f in fields[1:]:
        out = smooth_max(out, f, k)
    return out


def arch(x, a, z):
    """The wheel openings."""
    front = np.hypot(x - FRONT_AXLE, z - WHEEL_RADIUS)
    rear = np.hypot(x - REAR_AXLE, z - WHEEL_RADIUS)
    return np.maximum(np.minimum(front, rear) - ARCH_RADIUS, 0.45 - a)


def side_opening(x, a, z):
    """All side glass of one side, pillars included."""
    belt = 0.985 - 0.025 * x
    front = (x - 1.03) * 0.515 + (z - 0.91) * 0.857 + 0.135
    rear = -(x + 1.66) * 0.53 + (z - 0.98) * 0.848 + 0.065
    top = z - (1.395 - 0.05 * (x + 0.25) ** 2 - 0.028)
    return np.maximum(all_of(belt - z, front, rear, top, k=0.05), 0.5 - a)


def side_trim(x, a, z):
    return side_opening(x, a, z) - 0.016


def pillar(x, a, z):
    """The B pillar and the bar before the small rear pane."""
    b = np.abs(x + 0.42 + 0.06 * (z - 1.0)) - 0.042
    c = np.abs(x + 1.16 - 0.25 * (z - 1.0)) - 0.016
    return np.minimum(b, c)


def windscreen_glass(x, a, z):
    side = a - (cabin_half_width(x, z) - 0.075)
    return all_of(side, roof(x, a, z) + 0.075, 0.945 - z, 0.02 - x, np.abs(windscreen(x, a, z)) - 0.06, k=0.04)


def rear_glass(x, a, z):
    side = a - (cabin_half_width(x, z) - 0.10)
    return all_of(side, roof(x, a, z) + 0.085, 1.045 - z, x + 0.75, np.abs(rear_window(x, a, z)) - 0.07, k=0.05)


def head_lamp(x, a, z):
    top = z - (0.775 - 0.21 * (x - 1.80))
    bottom = (0.665 - 0.10 * (x - 1.80)) - z
    return all_of(top, bottom, 1.72 - x + 0.8 * (0.72 - z), 0.47 - a - 0.3 * (z - 0.65), k=0.03)


def lamp_inner(x, a, z):
    """The bright reflector inside the head lamp."""
    return np.hypot((a - 0.60), 1.2 * (z - 0.675)) - 0.045


def tail_lamp(x, a, z):
    return all_of(z - 0.945, 0.805 + 0.03 * (x + 2.2) - z, x + 1.90 - 0.9 * (z - 0.88), 0.40 - a, k=0.03)


def tail_reverse(x, a, z):
    return np.maximum(np.abs(z - 0.865) - 0.022, a - 0.60)


def grille(x, a, z):
    return all_of(np.abs(z - 0.605) - 0.062, a - 0.44 - 0.3 * (z - 0.6), 1.9 - x, k=0.04)


def slats(x, a, z):
    return 0.25 - np.sin((z - 0.605) * 2 * np.pi / 0.042)


def intake(x, a, z):
    return all_of(np.abs(z - 0.305) - 0.045, a - 0.66, 1.9 - x, k=0.04)


def fog_lamp(x, a, z):
    return np.maximum(np.hypot(a - 0.60, z - 0.42) - 0.042, 1.8 - x)


def sill(x, a, z):
    """Unpainted plastic along the lower edge."""
    return z - 0.265


def lower_tone(x, a, z):
    return z - (0.515 - 0.02 * x)


def stripe(x, a, z):
    """The coloured line between the two tones."""
    return np.abs(z - (0.535 - 0.02 * x)) - 0.020


def slashes(x, a, z):
    """Three leaning bars on the doors, wider towards the front."""
    s = x - 0.55 * (z - 0.6)
    band = np.minimum.reduce([np.abs(s - c) - h for c, h in ((0.42, 0.085), (0.14, 0.055), (-0.06, 0.03))])
    return all_of(band, z - 0.775 + 0.028 * x, 0.60 - 0.02 * x - z, 0.6 - a, k=0.01)


def roundel(x, a, z):
    """A disc on the rear door with a ring around it."""
    return np.maximum(np.hypot(x + 0.76, z - 0.685) - 0.085, 0.6 - a)


def roundel_ring(x, a, z):
    return np.abs(np.hypot(x + 0.76, z - 0.685) - 0.066) - 0.010


def bonnet_stripe(x, a, z):
    """Twin stripes over bonnet, roof and boot."""
    return np.maximum(np.abs(a - 0.23) - 0.085, np.where(x > 0, 0.70, 0.78) - z)


def door(x, z, front, rear, lean):
    """Distance to the outline of a door, negative inside."""
    return all_of(x - front - lean * (z - 0.6), rear - x, 0.315 - z, z - 0.975 + 0.025 * x, k=0.12)


def front_door(x, a, z):
    return np.maximum(door(x, z, 0.80, -0.42, -0.12), 0.6 - a)


def rear_door(x, a, z):
    r = np.hypot(x - REAR_AXLE, z - WHEEL_RADIUS)
    return np.maximum(smooth_max(door(x, z, -0.42, -1.20, 0.0), 0.455 - r, 0.05), 0.6 - a)


def bonnet(x, a, z):
    return all_of(a - 0.66 + 0.06 * (x - 1.0), x - 2.09 + 0.25 * a * a, 1.08 - 0.16 * a * a - x, 0.70 - z, k=0.1)


def boot(x, a, z):
    return all_of(a - 0.62, x + 1.84, 0.78 - z, k=0.08)


def bumper(x, a, z):
    """The joint between bumpers and wings."""
    front = np.maximum(1.83 - x - 0.15 * (z - 0.5), z - 0.60)
    rear = np.maximum(x + 1.83, z - 0.72)
    return np.minimum(front, rear)


def fuel_flap(x, a, z):
    return np.maximum(all_of(np.abs(x + 1.55) - 0.075, np.abs(z - 0.875) - 0.065, k=0.05), 0.6 - a)


SEAM_HALF_WIDTH = 0.0055


def materials(shell):
    """Cut the shell into a list of (material, mesh)."""
    out = []

    def take(mesh, field, material):
        """Give the region's inside a material, or hand it to a function; return the rest."""
        inside, rest = split(mesh, lambda p: field(*coordinates(p)))
        if callable(material):
            material(inside)
        elif len(inside.faces):
            out.append((material, inside))
        return rest

    def whole(material):
        return lambda mesh: out.append((material, mesh))

    def side_windows(mesh):
        glass_and_pillars, frame = split(mesh, lambda p: side_opening(*coordinates(p)))
        out.append(("chrome", frame))
        whole("glass")(take(glass_and_pillars, pillar, "pillar"))

    def head(mesh):
        whole("lamp_dark")(take(mesh, lamp_inner, "lamp"))

    def tail(mesh):
        whole("tail")(take(mesh, tail_reverse, "lamp"))

    def grille_parts(mesh):
        whole("trim")(take(mesh, slats, "chrome"))

    def disc(mesh):
        whole("white")(take(mesh, roundel_ring, "accent"))

    rest = split(shell, lambda p: arch(*coordinates(p)))[1]
    rest = take(rest, side_trim, side_windows)
    rest = take(rest, windscreen_glass, "glass")
    rest = take(rest, lambda x, a, z: windscreen_glass(x, a, z) - 0.02, "pillar")
    rest = take(rest, rear_glass, "glass")
    rest = take(rest, lambda x, a, z: rear_glass(x, a, z) - 0.02, "pillar")
    rest = take(rest, head_lamp, head)
    rest = take(rest, lambda x, a, z: head_lamp(x, a, z) - 0.010, "trim")
    rest = take(rest, tail_lamp, tail)
    rest = take(rest, lambda x, a, z: tail_lamp(x, a, z) - 0.008, "trim")
    rest = take(rest, grille, grille_parts)
    rest = take(rest, lambda x, a, z: grille(x, a, z) - 0.014, "chrome")
    rest = take(rest, intake, "trim")
    rest = take(rest, fog_lamp, "lamp")
    panels = []
    for outline in (front_door, rear_door, bonnet, boot, bumper, fuel_flap):
        # A seam is the band between two cuts by a smooth field, which needs no fine mesh.
        inner, rest = split(rest, lambda p: outline(*coordinates(p)) - SEAM_HALF_WIDTH)
        panel, seam = split(inner, lambda p: outline(*coordinates(p)) + SEAM_HALF_WIDTH)
        out.append(("seam", seam))
        panels.append(panel)
    for piece in panels + [rest]:
        piece = take(piece, sill, "trim")
        piece = take(piece, stripe, "accent")
        piece = take(piece, lower_tone, "silver")
        piece = take(piece, slashes, "white")
        piece = take(piece, roundel, disc)
        piece = take(piece, bonnet_stripe, "white")
        out.append(("paint", piece))
    return [(m, mesh) for m, mesh in out if len(mesh.faces)]
