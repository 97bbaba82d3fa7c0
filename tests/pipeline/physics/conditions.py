"""The paper's conditions of sight, as it writes them."""

import numpy as np


def is_in_view(point, place, boresight, cosine, radius):
    """The paper's two conditions: between the tangents to the sphere, and inside the cone."""
    away = point - place
    is_facing_it = point @ place >= radius * np.linalg.norm(point)
    return bool(is_facing_it and away @ boresight >= cosine * np.linalg.norm(away))
