"""Nothing that a program can hand over brings the interpreter down: every public function takes it, or raises an exception that says what is
wrong. A panic of the native half is a RuntimeError, which no test here lets pass."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from meshes import box

import beamcast

REFUSALS = (TypeError, ValueError, OverflowError, MemoryError, KeyError, IndexError, beamcast.Error)

floats = st.sampled_from([0.0, -0.0, 0.5, -2.0, 5e-324, 1e-320, 1e-45, 1e30, 3.4e38, 1e308, -1e308, np.inf, -np.inf, np.nan]) | st.floats(-3, 3)


def unaligned(array):
    """The same numbers, one byte beside where they belong."""
    bytes_ = np.zeros(array.nbytes + 1, np.uint8)
    view = bytes_[1:].view(array.dtype).reshape(array.shape)
    view[...] = array
    return view


def read_only(array):
    array = array.copy()
    array.setflags(write=False)
    return array


# Ways of lying in memory.
LAYOUTS = {
    "as it is": lambda a: a,
    "backwards": lambda a: a[::-1] if a.ndim else a,
    "mirrored": lambda a: a[..., ::-1] if a.ndim else a,
    "every second": lambda a: np.repeat(a, 2, axis=-1)[..., ::2] if a.ndim else a,
    "column by column": np.asfortranarray,
    "transposed": lambda a: a.T,
    "read only": read_only,
    "unaligned": unaligned,
    "other byte order": lambda a: a.astype(a.dtype.newbyteorder()),
    "one for all": lambda a: np.broadcast_to(a[:1], a.shape) if a.ndim and len(a) else a,
    "objects": lambda a: a.astype(object),
    "masked": lambda a: np.ma.masked_invalid(a) if a.dtype.kind == "f" else np.ma.array(a),
    "a list": lambda a: a.tolist(),
    "a column more": lambda a: a[..., None],
}

layouts = st.sampled_from(sorted(LAYOUTS))


@st.composite
def laid_out(draw, values):
    return LAYOUTS[draw(layouts)](draw(values))


def narrowed(array, kind):
    with np.errstate(over="ignore"):
        return array.astype(kind)


def of_width(width, kinds=(np.float32, np.float64)):
    """Arrays (n, width) and (m, n, width) of floats, some of them huge, tiny or no numbers, however they lie in memory."""
    shapes = st.tuples(st.integers(0, 9), st.just(width)) | st.tuples(st.integers(0, 3), st.integers(0, 40), st.just(width))

    def of(kind):
        made = arrays.arrays(np.float64, shapes, elements=floats)
        return made.map(lambda a: narrowed(a, kind))

    return laid_out(st.sampled_from(kinds).flatmap(of))


indices = laid_out(
    st.sampled_from([np.int8, np.int32, np.int64, np.uint8, np.uint32, np.uint64]).flatmap(
        lambda kind: arrays.arrays(kind, st.tuples(st.integers(0, 9), st.just(3)), elements=st.integers(0, 8) | st.sampled_from([100, 127, np.iinfo(kind).min, np.iinfo(kind).max]))
    )
)
anything = (
    laid_out(arrays.arrays(arrays.array_dtypes() | arrays.scalar_dtypes(), arrays.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=7)))
    | st.none() | st.text(max_size=3) | st.booleans() | st.integers() | st.floats() | st.binary(max_size=4)
    | st.builds(object) | st.lists(st.integers() | st.floats() | st.none(), max_size=6) | st.dictionaries(st.text(max_size=2), st.integers(), max_size=2)
)


def tried(call, *arguments, **options):
    """What a call gives, or None where it refuses its arguments."""
    with warnings.catch_warnings():
        # NumPy says that numbers become infinite in float32.
        warnings.simplefilter("ignore")
        try:
            return call(*arguments, **options)
        except REFUSALS as refusal:
            assert str(refusal) or isinstance(refusal, MemoryError)
            return None


def casts(scene):
    return scene.cast_rays, scene.test_occlusions, scene.count_intersections, scene.list_intersections


@settings(max_examples=200, deadline=None)
@given(of_width(3), indices)
def test_scenes_of_any_arrays(vertices, triangles):
    scene = tried(beamcast.Scene, vertices, triangles)
    if scene is None:
        return
    # An accepted mesh is one: whatever its numbers are, rays can be cast at it.
    rng = np.random.default_rng(1)
    rays = np.concatenate([rng.uniform(-4, 4, (64, 3)), rng.standard_normal((64, 3))], -1)
    hits = scene.cast_rays(rays)
    hit = hits["geometry_ids"] == 0
    assert np.array_equal(hit, np.isfinite(hits["t_hit_f64"])) and (hits["primitive_ids"][hit] < len(triangles)).all()
    assert np.array_equal(scene.count_intersections(rays) > 0, hit)
    assert 0 <= scene.triangle_count <= len(triangles)
    scene.__reduce__()


@settings(max_examples=200, deadline=None)
@given(of_width(6) | st.tuples(of_width(3), of_width(3)))
def test_rays_of_any_layout(room, rays):
    results = [tried(call, rays) for call in casts(room)]
    taken = {result is not None for result in results}
    assert len(taken) == 1, "all take the same rays"
    if results[0] is None:
        return
    hits, occluded, counts, listed = results
    # The same numbers in the plainest layout give the same.
    plain = tuple(np.array(part, order="C") for part in rays) if isinstance(rays, tuple) else np.array(rays, order="C")
    for name, values in room.cast_rays(plain).items():
        assert np.array_equal(values, hits[name]), name
    assert np.array_equal(occluded, np.isfinite(hits["t_hit_f64"])) and np.array_equal(counts > 0, occluded)
    assert len(listed["ray_ids"]) == counts.sum()


@settings(max_examples=200, deadline=None)
@given(anything, anything)
def test_things_that_are_no_arrays(room, one, other):
    for call in casts(room):
        tried(call, one)
        tried(call, (one, other))
    tried(beamcast.Scene, one, other) if not isinstance(one, (str, bytes)) else None
    tried(beamcast.Scene().add_triangles, one, other)
    tried(beamcast.Scene().add_triangles, one)
    vertices, triangles = box([0] * 3, [1] * 3)
    tried(beamcast.Scene, vertices, other)
    tried(beamcast.Scene, one, triangles) if not isinstance(one, (str, bytes)) else None


@settings(max_examples=100, deadline=None)
@given(anything, anything, anything)
def test_numbers_beside_the_rays(room, threads, near, far):
    rays = np.float64([[0, 0, 0, 1, 0, 0]])
    # 64 threads and more would be made, which takes longer than the test may.
    if not (isinstance(threads, int) and 8 < threads < 100_000):
        for call in casts(room):
            tried(call, rays, threads)
            tried(call, rays, threads=threads)
    tried(room.test_occlusions, rays, near, far)


@settings(max_examples=100, deadline=None)
@given(anything, anything, st.integers(-3, 40), st.integers(-3, 40), floats, of_width(3), of_width(3))
def test_pinhole_cameras_of_anything(intrinsic, extrinsic, width, height, fov, eye, up):
    tried(beamcast.Scene.create_rays_pinhole, intrinsic, extrinsic, width, height)
    tried(beamcast.Scene.create_rays_pinhole, np.eye(3), np.eye(4), width, height)
    tried(beamcast.Scene.create_rays_pinhole, fov_deg=fov, center=[0, 0, 0], eye=eye, up=up, width_px=width, height_px=height)


@settings(max_examples=60, deadline=None)
@given(anything, anything)
def test_jobs_sensors_and_frames_of_anything(job, one, other):
    frame, sensor = job.frame(0, "front"), job.sensors[1]
    for call in (frame.channel, frame.points, lambda a, b: frame.range_jacobian(a), lambda a, b: frame[a]):
        tried(call, one, other)
    tried(lambda: one in frame)
    tried(frame.channel, "range", other)
    for call in (sensor.directions, sensor.origins, sensor.times_s):
        tried(call, one)
    tried(sensor.rays, one, other)
    tried(sensor.rays, np.eye(4), other)
    tried(beamcast.Sensor.preset, one)
    tried(job.frame, one, other)
    tried(job.frame_count, one)
    tried(lambda: list(job.frame_keys([0], sensors=one)))
    if not isinstance(one, int):
        tried(lambda: list(job.frame_keys(one)))


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(["seed", "sensor.top.range.max_m", "sensor.top.pose", "sensor.top", "trajectory", "scene", "", "a.b", "sensor.9", "x[0]", "="]), anything)
def test_overrides_of_anything(job_file, key, value):
    tried(beamcast.Job, job_file, {key: value})


@pytest.mark.parametrize("shape", [(10**13, 6), (10**9, 10**4, 6)])
def test_more_rays_than_memory(room, shape):
    for call in casts(room):
        with pytest.raises(MemoryError):
            call(np.broadcast_to(np.float32(0), shape))
