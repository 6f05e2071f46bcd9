"""Parts that are not sheet metal: wheels, wheel wells, side mirrors, door handles, plates.

All are made for the left side (y > 0); the caller mirrors them.
"""

import numpy as np

from body import ARCH_RADIUS, FRONT_AXLE, REAR_AXLE, WHEEL_RADIUS, surface_y
from mesh import flat, from_grid, join

TURN = 96  # segments of a full turn


def lathe(profile, segments=TURN):
    """Revolve profile [n][(radius, y)] about the y axis."""
    profile = np.asarray(profile, float)
    t = np.linspace(0, 2 * np.pi, segments, endpoint=False)[:, None]
    r, y = profile[None, :, 0], profile[None, :, 1]
    return from_grid(np.stack([r * np.cos(t), y + 0 * t, r * np.sin(t)], -1), closed_u=True)


def blob(centre, half, power=3.0, n=40):
    """A superellipsoid: a box with round corners, rounder for a smaller power."""
    u = np.linspace(-np.pi / 2 + 1e-3, np.pi / 2 - 1e-3, n)[None, :]
    v = np.linspace(0, 2 * np.pi, 2 * n, endpoint=False)[:, None]
    d = np.stack([np.cos(u) * np.cos(v), np.cos(u) * np.sin(v), np.sin(u) + 0 * v], -1)
    d /= (np.abs(d) ** power).sum(-1, keepdims=True) ** (1 / power)
    return from_grid(d * np.asarray(half) + np.asarray(centre), closed_u=True)


def block(corners_low, corners_high):
    """A prism between two quads [4][3]."""
    ring = np.stack([corners_low, corners_high])  # [2][4][3]
    sides = from_grid(np.asarray(ring, float), closed_v=True)
    lid = from_grid(np.asarray(corners_high, float)[[0, 1, 3, 2]].reshape(2, 2, 3))
    return join([flat(sides), flat(lid)])


def wheel():
    """One wheel about the origin, its outside towards +y: {material: mesh}."""
    t = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    # Tyre: a rounded rectangle between rim and tread.
    c, s = np.cos(t), np.sin(t)
    k = (np.abs(c) ** 4 + np.abs(s) ** 4) ** -0.25
    tyre = lathe(np.stack([0.277 + 0.053 * k * c, 0.104 * k * s], -1)[list(range(40)) + [0]])
    rim = lathe([(0.214, 0.030), (0.219, 0.088), (0.231, 0.096), (0.238, 0.088), (0.240, 0.060)])
    well = lathe([(0.001, 0.012), (0.08, 0.012), (0.222, 0.0), (0.222, 0.03)])
    brake = lathe([(0.06, 0.020), (0.155, 0.020), (0.158, 0.014)])
    hub = lathe([(0.001, 0.084), (0.036, 0.084), (0.056, 0.076), (0.064, 0.045)])
    cap = lathe([(0.001, 0.087), (0.022, 0.087), (0.024, 0.080)], 32)
    spokes = []
    for turn in np.arange(5) * 2 * np.pi / 5 + np.pi / 2:
        for lean in (-1, 1):  # twin spokes that open towards the rim
            def quad(grow, y_hub, y_rim):
                q = []
                for r, across, y in ((0.045, 0.011, y_hub), (0.222, 0.030, y_rim)):
                    for edge in (-1, 1):
                        w = lean * across + edge * (0.011 + grow)
                        q.append((r, w, y))
                q = np.array([q[0], q[1], q[3], q[2]])
                x = q[:, 0] * np.cos(turn) - q[:, 1] * np.sin(turn)
                z = q[:, 0] * np.sin(turn) + q[:, 1] * np.cos(turn)
                return np.stack([x, q[:, 2], z], -1)[::-1]

            spokes.append(block(quad(0.005, 0.03, 0.03), quad(0.0, 0.078, 0.086)))
    bolts = [
        blob((0.042 * np.cos(a), 0.082, 0.042 * np.sin(a)), (0.007, 0.006, 0.007), n=8)
        for a in np.arange(5) * 2 * np.pi / 5
    ]
    return {
        "tyre": tyre,
        "rim": join([rim, hub] + spokes),
        "wheel_dark": join([well, cap] + bolts),
        "brake": brake,
    }


def wheel_well(axle):
    """The dark liner from the edge of the arch inwards, and the wall behind the wheel."""
    t = np.linspace(np.radians(-19.5), np.radians(199.5), 120)
    x, z = axle + ARCH_RADIUS * np.cos(t), WHEEL_RADIUS + ARCH_RADIUS * np.sin(t)
    edge = surface_y(x, np.maximum(z, 0.19))
    rows = [np.stack([x, edge * (1 - s) + 0.45 * s, z], -1) for s in np.linspace(0, 1, 6)]
    centre = np.stack([0 * x + axle, 0 * x + 0.45, 0 * z + WHEEL_RADIUS], -1)
    return join([from_grid(np.stack(rows)), from_grid(np.stack([rows[-1], centre]))])


def left_parts():
    """Everything of the left side, in place: list of (material, mesh)."""
    parts = []
    for axle in (FRONT_AXLE, REAR_AXLE):
        parts += [(m, mesh.moved((axle, 0.752, WHEEL_RADIUS))) for m, mesh in wheel().items()]
        parts.append(("liner", wheel_well(axle)))
    parts.append(("paint", blob((0.66, 0.868, 1.005), (0.075, 0.078, 0.062), 2.6)))
    parts.append(("glass", blob((0.598, 0.868, 1.005), (0.020, 0.064, 0.049), 4.0)))
    parts.append(("trim", blob((0.67, 0.79, 0.955), (0.045, 0.06, 0.022), 3.0)))
    for x in (-0.02, -0.93):
        z = 0.865 - 0.028 * x
        y = float(surface_y(x, z))
        parts.append(("chrome", blob((x, y + 0.016, z), (0.095, 0.013, 0.015), 3.0)))
        parts.append(("trim", blob((x, y, z), (0.075, 0.004, 0.028), 2.5)))
    # Number plates without numbers; each half is mirrored into a whole.
    parts.append(("plate", half_plate(2.316, 0.41, 1)))
    parts.append(("plate", half_plate(-2.312, 0.64, -1)))
    return parts


def half_plate(x, z, facing):
    y, h = 0.26, 0.056
    front = np.array([(x, 0, z - h), (x, y, z - h), (x, y, z + h), (x, 0, z + h)])
    back = front - np.array([0.05 * facing, 0, 0])
    return block(back[::facing], front[::facing])
