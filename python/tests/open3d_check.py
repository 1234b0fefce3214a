"""Holds `beamcast.Scene` to Open3D's RaycastingScene: names, types, shapes and values. Needs open3d beside beamcast."""

import numpy as np
import open3d as o3d
from meshes import box

import beamcast


def blob(rng, rows, at):
    """A closed lump of triangles of all shapes."""
    polar, turn = np.linspace(0.05, np.pi - 0.05, rows)[:, None], np.linspace(0, 2 * np.pi, 2 * rows)[None]
    radius = 1 + 0.2 * rng.standard_normal((rows, 2 * rows))
    radius[:, -1] = radius[:, 0]
    unit = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar) + 0 * turn], -1)
    at_rows = np.arange(rows * 2 * rows).reshape(rows, 2 * rows)
    a, b, c, d = at_rows[:-1, :-1], at_rows[:-1, 1:], at_rows[1:, 1:], at_rows[1:, :-1]
    triangles = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], -2).reshape(-1, 3)
    return np.float32(at + (unit * radius[..., None]).reshape(-1, 3)), np.uint32(triangles)


def scenes(rng):
    meshes = [blob(rng, 20, (0, 0, 0)), blob(rng, 12, (3, 0, 1)), box((-5, -5, -5), (5, 5, 5))]
    ours, theirs = beamcast.Scene(), o3d.t.geometry.RaycastingScene()
    for vertices, triangles in meshes:
        assert ours.add_triangles(vertices, triangles) == theirs.add_triangles(o3d.core.Tensor(vertices), o3d.core.Tensor(triangles))
    return ours, theirs


def share_within(a, b, tolerance):
    """The share of values that differ by no more than a tolerance, relative where they are large."""
    return np.mean(np.abs(a - b) <= tolerance * (1 + np.abs(b))) if a.size else 1.0


def main():
    rng = np.random.default_rng(1)
    ours, theirs = scenes(rng)
    rays = np.concatenate([rng.uniform(-6, 6, (60, 70, 3)), rng.standard_normal((60, 70, 3)) * rng.uniform(0.1, 9, (60, 70, 1))], -1)
    rays = rays.astype(np.float32)
    for shape in ((60, 70, 6), (4200, 6), (6, 10, 70, 6)):
        shaped = rays.reshape(shape)
        a, b = ours.cast_rays(shaped), {name: value.numpy() for name, value in theirs.cast_rays(shaped).items()}
        assert set(b) == set(a) - {"t_hit_f64"}
        for name, value in b.items():
            assert (a[name].dtype, a[name].shape) == (value.dtype, value.shape), name
    # Rays within Open3D's rounding of an edge may go to either side of it: a few in a thousand of such thin triangles.
    same = (a["primitive_ids"] == b["primitive_ids"]) & (a["geometry_ids"] == b["geometry_ids"])
    assert same.mean() > 0.998, same.mean()
    hit = same & np.isfinite(b["t_hit"])
    assert np.array_equal(np.isinf(a["t_hit"][same]), np.isinf(b["t_hit"][same]))
    for name, tolerance in (("t_hit", 1e-5), ("primitive_uvs", 1e-3), ("primitive_normals", 1e-4)):
        # Open3D computes in 32 bits, so that thin triangles have rough weights.
        share = share_within(a[name][hit], b[name][hit], tolerance)
        assert share > 0.998, (name, share)
    miss = same & np.isinf(b["t_hit"])
    for name in a:
        if name != "t_hit_f64":
            assert np.array_equal(a[name][miss], b[name][miss]), name

    counts, their_counts = ours.count_intersections(rays), theirs.count_intersections(rays).numpy()
    assert (counts.dtype, counts.shape) == (their_counts.dtype, their_counts.shape)
    assert (counts == their_counts).mean() > 0.998
    flat = rays.reshape(-1, 6)
    for tnear, tfar in ((0.0, np.inf), (0.5, 3.0), (0.0, 0.2)):
        a, b = ours.test_occlusions(flat, tnear, tfar), theirs.test_occlusions(flat, tnear, tfar).numpy()
        assert (a.dtype, a.shape) == (b.dtype, b.shape) and (a == b).mean() > 0.998
    a = ours.list_intersections(flat)
    b = {name: value.numpy() for name, value in theirs.list_intersections(flat).items()}
    assert set(b) == set(a) - {"t_hit_f64"}
    for name, value in b.items():
        if name != "ray_splits":
            assert a[name].dtype == value.dtype and a[name].shape[1:] == value.shape[1:], name

    def of(found):
        return {(r, g, p) for r, g, p in zip(found["ray_ids"], found["geometry_ids"], found["primitive_ids"])}
    both = of(a) & of(b)
    assert len(both) > 0.998 * max(len(of(a)), len(of(b)))

    for given in (
        dict(fov_deg=73, center=[1, 2, 3], eye=[4, -1, 0.5], up=[0, 0.3, 1], width_px=31, height_px=17),
        dict(intrinsic_matrix=np.array([[100.0, 0, 32], [0, 110, 24], [0, 0, 1]]), extrinsic_matrix=np.linalg.inv(
            np.array([[0, 0, 1, 3.0], [-1, 0, 0, 2], [0, -1, 0, 1], [0, 0, 0, 1]])), width_px=64, height_px=48),
    ):
        a, b = ours.create_rays_pinhole(**given), theirs.create_rays_pinhole(**given).numpy()
        assert a.shape == b.shape and a.dtype == b.dtype and np.abs(a - b).max() < 1e-4, np.abs(a - b).max()
    mesh = o3d.t.geometry.TriangleMesh.from_legacy(o3d.geometry.TriangleMesh.create_sphere(1.0))
    scene = beamcast.Scene()
    scene.add_triangles(mesh)
    assert np.isfinite(scene.cast_rays(np.float32([[0.01, 0.02, 5, 0, 0, -1]]))["t_hit"]).all()
    print("beamcast.Scene does as Open3D's RaycastingScene does")


if __name__ == "__main__":
    main()
