"""The examples do what they say."""

import sys

import numpy as np
import pytest
from conftest import ROOT


@pytest.fixture
def examples(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "python" / "examples"))


def test_trimesh_rays(examples):
    import trimesh
    from trimesh_rays import RayMeshIntersector

    ball = trimesh.creation.icosphere(subdivisions=3)
    rays = RayMeshIntersector(ball)
    rng = np.random.default_rng(1)
    origins, directions = rng.uniform(-2, 2, (2000, 3)), rng.standard_normal((2000, 3))
    points, numbers, triangles = rays.intersects_location(origins, directions)
    corners = ball.triangles[triangles]
    # A point of a triangle: its weights are not negative, and make it again. Vertices are rounded to 32 bits of up to 1 m.
    weights = trimesh.triangles.points_to_barycentric(corners, points)
    assert weights.min() > -1e-5 and np.abs((corners * weights[:, :, None]).sum(1) - points).max() < 1e-6
    assert np.abs(np.cross(points - origins[numbers], directions[numbers])).max() < 1e-12
    hit = rays.intersects_any(origins, directions)
    assert sorted(set(numbers.tolist())) == np.flatnonzero(hit).tolist()
    first = rays.intersects_first(origins, directions)
    assert np.array_equal(first >= 0, hit)
    once, of = rays.intersects_id(origins, directions, multiple_hits=False)
    assert np.array_equal(first[of], once)
    # The ball's triangles lie between the spheres of these radii.
    inside, distance = rays.contains_points(origins), np.linalg.norm(origins, axis=1)
    least = np.linalg.norm(ball.triangles_center, axis=1).min()
    assert inside[distance < 0.99 * least].all() and not inside[distance > 1.0].any()
    assert "open3d" not in sys.modules
