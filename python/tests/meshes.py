"""Meshes of arrays, for tests."""

import numpy as np


def box(low, high):
    """The vertices and triangles of a closed box, seen from outside counter-clockwise."""
    low, high = np.float32(low), np.float32(high)
    corners = np.float32([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return low + corners * (high - low), np.uint32(triangles)
