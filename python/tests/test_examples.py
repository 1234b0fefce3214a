"""The examples do what they say."""

import sys

import numpy as np


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


def test_calibrate(examples):
    from calibrate import JOB, calibrate, cast, distance, motion

    rng = np.random.default_rng(3)
    drawn = np.eye(4)
    drawn[:3, 3] = [0, 0, 1.2]
    for _ in range(3):
        shift, turn = rng.standard_normal((2, 3))
        true = drawn @ motion(np.concatenate([0.05 * shift / np.linalg.norm(shift), np.radians(1) * turn / np.linalg.norm(turn)]))
        assert np.allclose(distance(true, drawn), (0.05, np.radians(1)), rtol=1e-3)
        [measured] = cast(true, [0], JOB, "vlp16")
        found = calibrate([measured["range_m"]], drawn)
        # Without noise only the rounding of poses and ranges is left, a few 2⁻⁵³ of 10 m; the steps end below 1e-9.
        assert max(distance(true, found)) < 1e-8
        # With a noise of σ, the covariance of ξ is σ²·(JᵀJ)⁻¹, of which four deviations in the worst direction may be met. Cauchy's weights have
        # 95 % of the efficiency of least squares at a scale of 2.385 deviations, and more at three: deviations are less than 1.03 times as large.
        sigma = 0.002
        jacobian = measured.range_jacobian().reshape(-1, 6)
        jacobian = jacobian[np.linalg.norm(jacobian[:, :3], axis=1) < 5]
        worst = sigma / np.linalg.svd(jacobian, compute_uv=False).min()
        noisy = measured["range_m"] + sigma * rng.standard_normal(measured.shape)
        off = max(distance(true, calibrate([noisy], drawn)))
        assert off < 4 * 1.03 * worst and off < 1e-4, (off, worst)


def test_calibrate_a_sensor_that_moves(examples, job_file):
    from calibrate import calibrate, cast, distance, motion

    drawn = np.eye(4)
    drawn[:3, 3] = [0, 0, 1.8]
    true = drawn @ motion(np.array([0.03, -0.04, 0.0, *(np.radians(1) * np.array([2, -1, 2]) / 3)]))
    measured = [frame["range_m"] for frame in cast(true, range(3), job_file, "top")]
    assert max(distance(true, calibrate(measured, drawn, range(3), job_file, "top"))) < 1e-4
