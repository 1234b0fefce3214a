"""Scenes of arrays: hits with a closed form, shapes, types, and arguments that are wrong."""

import os
import signal
import threading
import time

import numpy as np
import pytest
from conftest import ROOT
from meshes import box
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import beamcast

INF = float("inf")


def test_hits_are_those_of_the_closed_form(room):
    # Eight directions from a point between the boxes: the inner box is 1.5 m away along +x, the outer 1 m along -x.
    rays = np.float32([[-1, 0.1, 0.2, 2, 0, 0], [-1, 0.1, 0.2, -2, 0, 0], [-1, 3, 0, 0, 1, 0]])
    hits = room.cast_rays(rays)
    assert hits["t_hit"].tolist() == [0.25, 0.5, INF]
    assert hits["t_hit_f64"].tolist() == [0.25, 0.5, INF]
    assert hits["geometry_ids"].tolist() == [1, 0, beamcast.INVALID_ID]
    assert hits["primitive_ids"][2] == beamcast.INVALID_ID == beamcast.Scene.INVALID_ID
    assert hits["primitive_normals"].tolist() == [[-1, 0, 0], [-1, 0, 0], [0, 0, 0]]
    assert hits["primitive_uvs"][2].tolist() == [0, 0]
    types = {"t_hit": "f4", "t_hit_f64": "f8", "geometry_ids": "u4", "primitive_ids": "u4"}
    types |= {"primitive_uvs": "f4", "primitive_normals": "f4"}
    assert {name: values.dtype.str[1:] for name, values in hits.items()} == types


def test_the_depth_is_exact_in_64_bits():
    # The plane z = 0.1 of f32, from 2 above: the depth along a direction of length 3.
    z = float(np.float32(0.1))
    scene = beamcast.Scene(np.float32([[-9, -9, z], [9, -9, z], [0, 9, z]]), [[0, 1, 2]])
    hits = scene.cast_rays(np.array([[0.0, 0.0, 2.0, 0.0, 0.0, -3.0]]))
    # The subtraction is exact, and the quotient is off by half an ulp of it and, from the determinants, a few.
    assert abs(hits["t_hit_f64"][0] - (2.0 - z) / 3.0) <= 4 * np.spacing(0.7)
    assert hits["t_hit"][0] == np.float32(hits["t_hit_f64"][0])


def test_hits_lie_where_weights_and_depths_say(room):
    rng = np.random.default_rng(1)
    origins, directions = rng.uniform(-1.9, 1.9, (4000, 3)), rng.standard_normal((4000, 3))
    hits = room.cast_rays((origins, directions))
    meshes = [box([-2] * 3, [2] * 3), box([-0.5] * 3, [0.5] * 3)]
    assert (hits["geometry_ids"] < 2).all(), "a ray left a closed box"
    corners = np.stack([meshes[g][0][meshes[g][1][p]] for g, p in zip(hits["geometry_ids"], hits["primitive_ids"])])
    u, v = hits["primitive_uvs"].T.astype(float)
    by_weights = corners[:, 0] * (1 - u - v)[:, None] + corners[:, 1] * u[:, None] + corners[:, 2] * v[:, None]
    by_depths = origins + directions * hits["t_hit_f64"][:, None]
    # Weights of 32 bits are off by 2^-25 of corners up to 2 m apart in each of two: below a micrometre.
    assert np.abs(by_weights - by_depths).max() < 1e-6
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    assert np.abs(normals - hits["primitive_normals"]).max() < 1e-6


@pytest.mark.parametrize("shape", [(), (0,), (1,), (7,), (3, 0), (2, 3), (40, 50), (3, 9, 20), (2, 33, 47)])
def test_results_have_the_shape_of_the_rays_and_no_order_matters(room, shape):
    rng = np.random.default_rng(2)
    rays = np.concatenate([rng.uniform(-3, 3, (*shape, 3)), rng.standard_normal((*shape, 3))], -1)
    found = room.cast_rays(rays)
    flat = room.cast_rays(rays.reshape(-1, 6))
    for name, more in (("t_hit", ()), ("geometry_ids", ()), ("primitive_uvs", (2,)), ("primitive_normals", (3,))):
        assert found[name].shape == shape + more
        assert np.array_equal(found[name].reshape(flat[name].shape), flat[name])
    assert room.test_occlusions(rays).shape == shape
    assert np.array_equal(room.test_occlusions(rays), np.isfinite(found["t_hit"]))
    counts = room.count_intersections(rays)
    assert counts.shape == shape and counts.dtype == np.int32
    assert np.array_equal(counts > 0, np.isfinite(found["t_hit"]))


def test_threads_and_the_way_of_giving_rays_change_nothing(room):
    rng = np.random.default_rng(3)
    rays = np.float32(np.concatenate([rng.uniform(-3, 3, (200, 100, 3)), rng.standard_normal((200, 100, 3))], -1))
    one = room.cast_rays(rays, threads=1)
    others = [
        room.cast_rays(rays),
        room.cast_rays(rays, 2),
        room.cast_rays(rays, nthreads=3),
        room.cast_rays(rays.astype(np.float64)),
        room.cast_rays((rays[..., :3], rays[..., 3:])),
        room.cast_rays((rays[..., :3].astype(np.float64), rays[..., 3:])),
        room.cast_rays(np.asfortranarray(rays)),
        room.cast_rays(np.concatenate([rays, rays], -1)[..., 6:]),
        room.cast_rays(rays[::-1][::-1]),
        room.cast_rays(rays.astype(">f4")),
        room.cast_rays(rays.tolist()),
    ]
    frozen = rays.copy()
    frozen.flags.writeable = False
    others.append(room.cast_rays(frozen))
    offset = np.frombuffer(b"\0" + rays.tobytes(), np.float32, rays.size, 1).reshape(rays.shape)
    others.append(room.cast_rays(offset))
    for other in others:
        assert all(np.array_equal(one[name], other[name]) for name in one)
    common = room.cast_rays((np.float64([0.1, 0.9, 0.3]), rays[..., 3:]))
    each = room.cast_rays((np.broadcast_to(np.float64([0.1, 0.9, 0.3]), (200, 100, 3)), rays[..., 3:]))
    assert all(np.array_equal(common[name], each[name]) for name in common)


def test_intersections_are_listed_ray_by_ray(room):
    rays = np.float64([[-5, 0.1, 0.2, 1, 0, 0], [0, 0.1, 0.2, 1, 0, 0], [9, 9, 9, 1, 0, 0], [0, 3, 0, 0, -1, 0]])
    listed = room.list_intersections(rays)
    assert listed["ray_splits"].tolist() == [0, 4, 6, 6, 10]
    assert listed["ray_ids"].tolist() == [0, 0, 0, 0, 1, 1, 3, 3, 3, 3]
    assert listed["t_hit"].tolist() == [3, 4.5, 5.5, 7, 0.5, 2, 1, 2.5, 3.5, 5]
    assert listed["geometry_ids"].tolist() == [0, 1, 1, 0, 1, 0, 0, 1, 1, 0]
    assert listed["primitive_uvs"].shape == (10, 2)
    # The last ray goes through the diagonals of all four faces: each is one crossing, and its origin is outside.
    assert room.count_intersections(rays).tolist() == [4, 2, 0, 4]


def test_inside_is_an_odd_number_of_crossings():
    scene = beamcast.Scene(*box([0, 0, 0], [1, 1, 1]))
    rng = np.random.default_rng(4)
    points = rng.uniform(-0.5, 1.5, (5000, 3))
    inside = ((points > 0) & (points < 1)).all(-1)
    counts = scene.count_intersections((points, np.array([0.3, 0.2, 1.0]))) % 2
    assert np.array_equal(counts == 1, inside)


def test_occlusions_have_limits(room):
    ray = np.float64([[-1, 0.1, 0.2, 2, 0, 0]])
    for near, far, expected in [
        (0, INF, True), (0, 0.25, True), (0, 0.2499, False), (0.25, 0.3, True), (0.26, 0.7, False), (-5, 0.3, True),
        (1, 0, False), (2, INF, False),
    ]:
        assert room.test_occlusions(ray, near, far).tolist() == [expected], (near, far)
    with pytest.raises(ValueError, match="NaN"):
        room.test_occlusions(ray, float("nan"))


def test_scenes_grow():
    scene = beamcast.Scene()
    up = np.float64([[0.2, 0.2, -1, 0, 0, 1]])
    assert scene.cast_rays(up)["t_hit"].tolist() == [INF]
    for z in (3, 2, 1):
        scene.add_triangles(np.float32([[0, 0, z], [1, 0, z], [0, 1, z]]), np.int64([[0, 0, 1], [0, 1, 2]]))
        assert scene.cast_rays(up)["t_hit"].tolist() == [z + 1]
    hits = scene.cast_rays(up)
    # The first triangle of each mesh has no area, and keeps its number.
    assert (hits["geometry_ids"].tolist(), hits["primitive_ids"].tolist()) == ([2], [1])
    assert scene.triangle_count == 3


def test_a_file_has_objects():
    scene = beamcast.Scene(ROOT / "scenes" / "street.glb")
    down = np.float64([[0, 0, 50, 0, 0, -1]])
    hits = scene.cast_rays(down)
    assert np.isfinite(hits["t_hit"]).all() and isinstance(scene.object_names[hits["geometry_ids"][0]], str)
    with pytest.raises(TypeError):
        scene.add_triangles(*box([0] * 3, [1] * 3))
    with pytest.raises(beamcast.SceneError) as caught:
        beamcast.Scene(ROOT / "scenes" / "none.glb")
    assert caught.value.file.endswith("none.glb")


def test_surveyed_coordinates_keep_their_precision():
    # f32 steps by half a metre at such coordinates.
    vertices, triangles = box([0, 0, 0], [1, 1, 1])
    place = np.array([500_000.000_1, 5_400_000.0, 300.0])
    scene = beamcast.Scene(vertices.astype(np.float64) + place, triangles)
    hits = scene.cast_rays((place + [0.5, 0.3, 9.0], np.array([0.0, 0.0, -1.0])))
    # The vertices are rounded to f32 within 1 m of the middle: by up to 2^-25 m.
    assert abs(float(hits["t_hit_f64"]) - 8.0) <= 2.0**-25 + 1e-9


def test_wrong_arguments_are_told(room):
    vertices, triangles = box([0] * 3, [1] * 3)
    for wrong, kind in [
        (np.zeros((4, 5)), ValueError), (np.zeros(6, int), TypeError), (np.zeros((2, 6), np.float16), TypeError),
        (np.zeros((2, 6), complex), TypeError), ("rays", TypeError), (None, TypeError), ([[1, 2], [3]], ValueError),
        ((np.zeros((4, 3)), np.zeros((5, 3))), ValueError), ((np.zeros((4, 2)), np.zeros((4, 3))), ValueError),
        (np.zeros((2, 6), object), TypeError), (np.float64(1.0), ValueError),
    ]:
        with pytest.raises(kind):
            room.cast_rays(wrong)
    for threads in (-1, 100_000):
        with pytest.raises(ValueError, match="threads"):
            room.cast_rays(np.zeros((1, 6)), threads=threads)
    for bad_vertices, bad_triangles, kind in [
        (vertices, triangles + 1, ValueError), (vertices, triangles.astype(np.int64) - 1, ValueError),
        (vertices, triangles.astype(float), TypeError), (vertices[:, :2], triangles, ValueError),
        (vertices, triangles[:, :2], ValueError), (vertices.astype(int), triangles, TypeError),
        (np.full_like(vertices, np.nan), triangles, ValueError), (vertices * np.float32(1e30), triangles, ValueError),
    ]:
        with pytest.raises(kind):
            beamcast.Scene().add_triangles(bad_vertices, bad_triangles)
    for arguments in [(vertices,), (None, triangles), ("street.glb", triangles)]:
        with pytest.raises(TypeError):
            beamcast.Scene(*arguments)
    with pytest.raises(MemoryError):
        room.cast_rays(np.broadcast_to(np.float32(0), (10**13, 6)))


numbers = st.one_of(
    st.floats(width=64, allow_nan=True, allow_infinity=True),
    st.sampled_from([0.0, -0.0, 1e-320, 1e308, -1e308, 1e100, 1e-100, float("nan"), INF, 0.5, -2.0]),
)


@settings(max_examples=150, deadline=None)
@given(arrays.arrays(np.float64, st.tuples(st.integers(0, 40), st.just(6)), elements=numbers))
def test_no_rays_do_harm(room, rays):
    hits = room.cast_rays(rays)
    hit = np.isfinite(hits["t_hit_f64"])
    assert (hit | (hits["t_hit_f64"] == INF)).all() and (hits["t_hit_f64"] >= 0).all()
    assert np.array_equal(hit, hits["geometry_ids"] != beamcast.INVALID_ID)
    broken = ~np.isfinite(rays).all(-1) | (rays[:, 3:] == 0).all(-1)
    assert not hit[broken].any()
    assert np.array_equal(room.test_occlusions(rays), hit)
    assert np.array_equal(room.count_intersections(rays) > 0, hit)
    with np.errstate(over="ignore"):
        narrow = room.cast_rays(rays.astype(np.float32))
    assert len(narrow["t_hit"]) == len(rays)


@settings(max_examples=150, deadline=None)
@given(
    arrays.arrays(st.sampled_from([np.float32, np.float64]), st.tuples(st.integers(0, 9), st.just(3)), elements=st.floats(-4, 4, width=16) | st.sampled_from([float("nan"), INF, 1e12, 1e30])),
    arrays.arrays(np.int64, st.tuples(st.integers(0, 12), st.just(3)), elements=st.integers(-1, 9)),
)
def test_no_mesh_does_harm(vertices, triangles):
    scene = beamcast.Scene()
    try:
        scene.add_triangles(vertices, triangles)
    except ValueError:
        return
    rng = np.random.default_rng(5)
    hits = scene.cast_rays((rng.uniform(-5, 5, (50, 3)), rng.standard_normal((50, 3))))
    ids = hits["primitive_ids"][hits["geometry_ids"] == 0]
    assert (ids < len(triangles)).all()


@settings(max_examples=60, deadline=None)
@given(arrays.arrays(arrays.array_dtypes() | arrays.scalar_dtypes(), arrays.array_shapes(max_dims=3, max_side=7)))
def test_no_array_crashes(room, anything):
    for call in (room.cast_rays, room.test_occlusions, room.count_intersections, room.list_intersections):
        for argument in (anything, (anything, anything)):
            try:
                call(argument)
            except (TypeError, ValueError):
                pass


def test_other_threads_run_meanwhile(room):
    rays = np.random.default_rng(6).standard_normal((400_000, 6))
    ticks, done = [0], threading.Event()

    def count():
        while not done.is_set():
            ticks[0] += 1
            time.sleep(0.001)

    counter = threading.Thread(target=count)
    counter.start()
    time.sleep(0.01)
    before = ticks[0]
    for _ in range(3):
        room.cast_rays(rays, threads=1)
    after = ticks[0]
    done.set()
    counter.join()
    # With the lock held, it would not have ticked during any of the three.
    assert after - before > 3
    results = [None] * 4
    def cast(k):
        results[k] = room.cast_rays(rays[:50_000], threads=1 + k % 2)["t_hit"]
    workers = [threading.Thread(target=cast, args=(k,)) for k in range(4)]
    [worker.start() for worker in workers]
    [worker.join() for worker in workers]
    assert all(np.array_equal(results[0], other) for other in results)


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_a_signal_stops_a_cast(room):
    # So many crossings of a thousand sheets take far longer than the signal.
    z = np.arange(1000, dtype=np.float32)
    corners = np.float32([[-9, -9, 0], [9, -9, 0], [0, 9, 0]])
    sheets = beamcast.Scene((corners + z[:, None, None] * [0, 0, 1]).reshape(-1, 3).astype(np.float32), np.arange(3000).reshape(-1, 3))
    rays = np.broadcast_to(np.float64([0, 0, -1, 0, 0, 1]), (400_000, 6))
    threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        sheets.list_intersections(rays)
    assert time.monotonic() - start < 20
    # The package goes on to work.
    assert sheets.count_intersections(rays[:1]).tolist() == [1000]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks")
def test_a_forked_process_casts(room):
    import multiprocessing

    rays = np.random.default_rng(7).standard_normal((50_000, 6))
    expected = room.cast_rays(rays)["t_hit"]
    # The processes inherit the scene as it is built, so nothing is built again.
    SHARED.update(scene=room, rays=rays)
    pool = multiprocessing.get_context("fork").Pool(2)
    try:
        found = pool.map_async(_cast, range(2)).get(timeout=60)
    finally:
        pool.terminate()
    assert all(np.array_equal(one, expected) for one in found)


SHARED = {}


def _cast(_):
    return SHARED["scene"].cast_rays(SHARED["rays"])["t_hit"]


def test_pinhole_rays_are_those_of_the_matrices():
    scene = beamcast.Scene(*box([4, -9, -9], [5, 9, 9]))
    rays = beamcast.Scene.create_rays_pinhole(fov_deg=90, center=[1, 0, 0], eye=[0, 0, 0], up=[0, 0, 1], width_px=30, height_px=20)
    assert rays.shape == (20, 30, 6) and rays.dtype == np.float32
    hits = scene.cast_rays(rays)
    assert np.abs(hits["t_hit"] - 4).max() < 1e-6
    # As in Open3D, rows follow each other along `up`.
    assert rays[0, 0, 3:] == pytest.approx([1, 1 / 30 - 1, 1 / 30 - 20 / 30])
    extrinsic = np.eye(4)
    extrinsic[:3, 3] = [1, 2, 3]
    rays = beamcast.Scene.create_rays_pinhole(np.array([[100.0, 0, 32], [0, 110, 24], [0, 0, 1]]), extrinsic, 3, 2)
    assert rays[0, 0] == pytest.approx([-1, -2, -3, -0.315, -23.5 / 110, 1], abs=1e-6)


def test_scenes_are_pickled_by_what_they_are_made_of(room):
    import pickle

    again = pickle.loads(pickle.dumps(room))
    rays = np.random.default_rng(8).standard_normal((100, 6))
    assert np.array_equal(again.cast_rays(rays)["t_hit_f64"], room.cast_rays(rays)["t_hit_f64"])
