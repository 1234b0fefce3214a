"""The derivatives of ranges are the limits of differences of real casts."""

import numpy as np
import pytest
from conftest import ROOT
from hypothesis import given, settings
from hypothesis import strategies as st

import beamcast

STEP = 1e-5
LEAST_COSINE = 0.1

ROTATING = """rotating = { elevations_deg = { from = 20.0, to = -30.0, count = 12 }, columns = 48, rate_hz = 10.0 }
range = { min_m = 0.3, max_m = 30.0 }"""
SENSORS = {
    "lidar": ROTATING,
    "camera": """pinhole = { width_px = 32, height_px = 24, hfov_deg = 90.0, rate_hz = 10.0 }
range = { min_m = 0.3, max_m = 30.0 }""",
    # Beams that leave beside the sensor's origin: ranges count from the axis and along the beam; and from the origin in a straight line.
    "ouster": 'preset = "ouster/os0-32"\nmode = "512x10"',
    "hesai": 'preset = "hesai/xt-32"',
}
MOVING = """
[trajectory]
twist = { linear_m_s = [1.0, 0.2, 0.0], angular_deg_s = [10.0, -5.0, 60.0] }
"""


@pytest.fixture(scope="module")
def job_of(tmp_path_factory):
    """Makes the job of a sensor in the room with a mount on a body that stands or moves."""
    folder = tmp_path_factory.mktemp("jacobian")

    def job(sensor, mount, moving, more=None):
        path = folder / f"{sensor}-{moving}.toml"
        text = f"""scene = {str(ROOT / "scenes" / "room.glb")!r}
[[sensor]]
name = "it"
pose = {{ position_m = [0.0, 0.0, 0.0] }}
{SENSORS[sensor]}
{MOVING if moving else ""}
[output]
dir = "out"
"""
        path.write_text(text, encoding="utf-8")
        overrides = {"sensor.it.pose": {"matrix": mount, "convention": "body"}, **(more or {})}
        if moving:
            overrides["trajectory.pose"] = {"position_m": [0.0, 0.0, 1.2]}
        return beamcast.Job(path, overrides)

    return job


def motion(xi):
    """[exp(φ) | τ], by the series of the matrix exponential, so that it owes nothing to the formula of the example."""
    (tx, ty, tz), (x, y, z) = xi[:3], xi[3:]
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation, term = np.eye(3), np.eye(3)
    for k in range(1, 30):
        term = term @ cross / k
        rotation = rotation + term
    return np.block([[rotation, np.array([[tx], [ty], [tz]])], [np.zeros((1, 3)), np.ones((1, 1))]])


def check(job_of, sensor, mount, moving):
    """Holds all six columns to central differences. Returns the number of beams that were compared."""
    frame = job_of(sensor, mount, moving).frame()
    jacobian = frame.range_jacobian()
    rows, columns = frame.shape
    assert jacobian.shape == (rows, columns, 6) and jacobian.dtype == np.float64
    is_seen = np.isfinite(frame["range_m"])
    assert np.isnan(jacobian[~is_seen]).all() and is_seen.mean() > 0.5
    # The length of ∂r/∂τ is 1/cos of the angle of incidence: never less than 1, but for ranges from the origin, of beams 0.1 m beside it.
    secant = np.linalg.norm(jacobian[..., :3], axis=-1)
    assert np.nanmin(secant) > (0.9 if sensor == "hesai" else 1 - 1e-12)
    fit = is_seen & (secant < 1 / LEAST_COSINE)
    compared = 0
    for axis in range(6):
        moved = []
        for sign in (1, -1):
            xi = np.zeros(6)
            xi[axis] = sign * STEP
            moved.append(job_of(sensor, mount @ motion(xi), moving).frame())
        # Where the beam stays on its triangle, the range is a quotient of linear functions of the sensor's position and direction.
        same = fit & (moved[0]["id.triangle"] == frame["id.triangle"]) & (moved[1]["id.triangle"] == frame["id.triangle"])
        difference = (moved[0]["range_m"] - moved[1]["range_m"])[same] / (2 * STEP)
        error = np.abs(difference - jacobian[same][:, axis])
        # A central difference is off by h²/6 of the third derivative, which is at most 6·r/cos³ for a turn (as src/truth/jacobian.rs derives;
        # a quarter more for beams 0.1 m beside the origin of a sensor that is at least 0.3 m from what it sees) and 0 for a shift; a range from
        # the origin bends by less than the turn does. Ranges and the mount's matrix are rounded to a few 2⁻⁵³ of coordinates of 10 m, which
        # 1/cos magnifies: 2·10⁻¹⁴/cos, twice, over 2h.
        r, s = frame["range_m"][same], secant[same]
        bound = STEP**2 * 1.25 * (r + 0.4) * s**3 + 4e-14 * s / (2 * STEP) + 1e-12
        assert (error <= bound).all(), (axis, float((error / bound).max()))
        compared += int(same.sum())
    return compared


@pytest.mark.parametrize("moving", [False, True], ids=["standing", "moving"])
@pytest.mark.parametrize("sensor", SENSORS)
def test_it_is_the_limit_of_differences(job_of, sensor, moving):
    mount = motion([0.1, -0.2, 0.1 if moving else 1.3, 0.05, -0.1, 0.7])
    assert check(job_of, sensor, mount, moving) > 2000


@settings(max_examples=12, deadline=None)
@given(
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(0.8, 2.2)),
    st.tuples(*[st.floats(-3, 3)] * 3),
)
def test_it_is_so_for_any_pose(job_of, place, turn):
    mount = motion([0, 0, 0, *turn])
    mount[:3, 3] = place
    check(job_of, "lidar", mount, False)


def test_closed_form_of_a_room(job_of):
    # A level LiDAR 1.2 m above the floor: r = h/sin ε below the horizon, so ∂r/∂z = 1/sin ε, and a turn about the vertical changes nothing.
    job = job_of("lidar", motion([0, 0, 1.2, 0, 0, 0]), False)
    frame, directions = job.frame(), job.sensors[0].directions()
    jacobian = frame.range_jacobian()
    normal = np.stack([frame[f"normal.{axis}"] for axis in "XYZ"], -1)
    floor = (normal == [0, 0, 1]).all(-1) & (np.abs(frame["range_m"] * directions[..., 2] + 1.2) < 1e-6)
    assert floor.sum() > 30
    down = -directions[..., 2][floor]
    expected = np.zeros((floor.sum(), 6))
    expected[:, 2] = 1 / down
    # p × z = (p_y, −p_x, 0)
    point = directions[floor] * frame["range_m"][floor][:, None]
    expected[:, 3], expected[:, 4] = point[:, 1] / down, -point[:, 0] / down
    # The range was rounded, and the floor's vertices are numbers of float32: it may be tilted by their rounding.
    assert np.allclose(jacobian[floor], expected, rtol=1e-6, atol=1e-6)
    # There is no second return, and so no derivative.
    assert np.isnan(frame.range_jacobian(1)).all()


def test_what_is_no_surface_has_none(job_of):
    # A beam with a width mixes the light of two surfaces at their edge, and noise is no matter of the mount.
    mount = motion([0, 0, 1.2, 0, 0, 0])
    wide = {"sensor.it.footprint": {"divergence_mrad": [20.0, 20.0], "kind": "1/e2", "samples": 7}, "sensor.it.noise": {"range_floor_m": 0.02}}
    measured, ideal = job_of("lidar", mount, False, wide).frame(), job_of("lidar", mount, False).frame()
    jacobian = measured.range_jacobian()
    causes = np.array(measured.cause_names())[measured.causes]
    assert {"surface", "mixed"} <= set(causes.flat)
    assert np.array_equal(np.isfinite(jacobian).all(-1), causes == "surface")
    # Of a return of the same triangle it is that of an ideal sensor, bit for bit: the noise is not in it.
    same = (causes == "surface") & (measured["id.triangle"] == ideal["id.triangle"])
    assert same.mean() > 0.5 and (measured["range_m"] != ideal["range_m"])[same].all()
    assert np.array_equal(jacobian[same], ideal.range_jacobian()[same])
