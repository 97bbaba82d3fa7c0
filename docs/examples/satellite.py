"""Makes the satellite that ships as a chief of real shape: a body, two solar panels on booms, and a dish.

    python docs/examples/satellite.py conf/chief/satellite.obj

In chief axes, m: the body is a box of 4 m x 3 m x 3 m, the panels reach 9 m along +k and -k, the dish looks
along -i, to the Earth. It needs trimesh.
"""

import sys
from collections.abc import Sequence

import numpy as np
import trimesh

BODY = (4.0, 3.0, 3.0)
PANEL, PANEL_AT = (3.2, 0.08, 5.5), 6.25
BOOM, BOOM_AT = (0.2, 0.06, 2.0), 2.5
#: radius and depth of the dish, and how thick it is
DISH, DEPTH, THICK = 1.3, 0.5, 0.05
#: segments around the dish, and rings from its middle to its rim
SEGMENTS, RINGS = 24, 4


def box(extents: Sequence[float], along_k: float) -> trimesh.Trimesh:
    """Return a box whose centre lies on the k axis."""
    made = trimesh.creation.box(extents)
    made.apply_translation((0.0, 0.0, along_k))
    return made


def dish() -> trimesh.Trimesh:
    """Return a shell between two paraboloids about the i axis, on the side of the body towards the Earth."""
    reach = np.linspace(0.0, DISH, RINGS + 1)
    inner = np.column_stack([reach, DEPTH * (reach / DISH) ** 2 + THICK])
    outer = np.column_stack([reach, DEPTH * (reach / DISH) ** 2])
    made = trimesh.creation.revolve(np.vstack([outer, inner[::-1]]), sections=SEGMENTS)
    # from the k axis, about which it is turned, to -i
    made.apply_transform(trimesh.transformations.rotation_matrix(-0.5 * np.pi, (0.0, 1.0, 0.0)))
    made.apply_translation((-0.5 * BODY[0] - 0.02, 0.0, 0.0))
    return made


def satellite() -> trimesh.Trimesh:
    """Return all of it, with normals that look outwards."""
    sides = [
        box(size, sign * at) for sign in (1.0, -1.0) for size, at in ((PANEL, PANEL_AT), (BOOM, BOOM_AT))
    ]
    return trimesh.util.concatenate([box(BODY, 0.0), *sides, dish()])


if __name__ == "__main__":
    made = satellite()
    made.export(
        sys.argv[1], include_texture=False, include_color=False, digits=4, header="made by satellite.py"
    )
    print(f"{sys.argv[1]}: {len(made.faces)} triangles, {np.linalg.norm(made.vertices, axis=1).max():.2f} m")
