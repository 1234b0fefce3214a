"""Jobs: their frames hold what the command writes."""

import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import beamcast


@pytest.fixture(scope="session")
def scanned(job_file):
    """The folder that the command writes for the job."""
    subprocess.run([sys.executable, "-m", "beamcast", "scan", "-q", str(job_file), "--overwrite"], check=True)
    return job_file.parent / "out"


def test_channels_are_those_of_the_files(job, scanned):
    frames = list(job.frames())
    assert [(frame.sensor, frame.number) for frame in frames] == [
        ("top", 0), ("front", 0), ("front", 1), ("top", 1), ("front", 2), ("front", 3), ("top", 2), ("top", 3),
    ]
    for frame in frames:
        arrays = np.load(scanned / frame.sensor / f"{frame.number:06}.npz")
        compared = 0
        for name in frame.keys():
            if name in arrays:
                assert frame[name].dtype == arrays[name].dtype and frame[name].shape == frame.shape
                assert np.array_equal(frame[name], arrays[name]), name
                compared += 1
        assert compared >= 6
        normal = np.stack([frame[f"normal.{axis}"] for axis in "XYZ"], -1)
        assert np.array_equal(normal, arrays["normal"])
        assert np.array_equal(frame["range_m"].astype(np.float32), frame["range"])
        assert frame["range_m"].dtype == np.float64 and np.isinf(frame["range_m"]).any()
        assert frame["range"] is frame["range"]
        assert ("Z" in frame) == (frame.sensor == "front")
    with pytest.raises(KeyError, match="has no channel"):
        frames[0]["nothing"]


def test_points_and_returns_belong_together(job):
    for frame in job.frames(range(2)):
        returns = frame.returns
        count = len(returns["range_m"])
        assert all(len(column) == count for column in returns.values()) and count > 100
        assert np.array_equal(frame["range_m"][returns["row"], returns["column"]], returns["range_m"])
        assert np.array_equal(frame.instances[returns["row"], returns["column"]], returns["instance"])
        assert np.array_equal(frame.labels[returns["row"], returns["column"]], returns["label"])
        assert {frame.cause_names()[cause] for cause in np.unique(returns["cause"])} == {"surface"}
        causes = {frame.cause_names()[cause] for cause in np.unique(frame.causes)}
        assert causes <= {"surface", "nothing", "too_near", "out_of_range"}
        points, times = frame.points(), frame.point_times_s()
        assert points.shape == (count, 3) and points.dtype == np.float64
        # Ranges count along unit directions from the sensor's own origin.
        assert np.allclose(np.linalg.norm(points, axis=1), returns["range_m"], rtol=1e-14)
        assert times.min() >= 0 and times.max() < 0.1
    camera = job.frame(0, "front")
    assert np.allclose(camera.points()[:, 2], camera["Z"][np.isfinite(camera["Z"])], rtol=1e-6)
    # The camera's optical frame in its body's: z forward is x, x right is -y, y down is -z.
    body = camera.points()[:, [2, 0, 1]] * [1, -1, -1]
    pose = job.frame(0, "front").world_from_sensor
    frozen = beamcast.Job(job.path, {"sequence.motion": "frozen"}).frame(0, "front")
    body = frozen.points()[:, [2, 0, 1]] * [1, -1, -1]
    assert np.allclose(body @ pose[:3, :3].T + pose[:3, 3], frozen.points("world"), atol=1e-12)
    with pytest.raises(ValueError, match="expected one of sensor, body, world"):
        camera.points("moon")


def test_boxes_are_those_of_the_file(job, scanned):
    rows = [json.loads(line) for line in (scanned / "boxes.jsonl").read_text().splitlines()]
    frame = job.frame(1, "top")
    assert frame.boxes == [row for row in rows if (row["sensor"], row["frame"]) == ("top", 1)]
    assert frame.boxes


def test_a_sensors_rays_are_those_of_its_frames(job):
    sensor = job.sensors[0]
    assert (sensor.name, sensor.shape, sensor.is_camera, sensor.rate_hz) == ("top", (16, 180), False, 10.0)
    assert sensor.limits_m == (0.5, 60.0)
    frozen = beamcast.Job(job.path, {"sequence.motion": "frozen"})
    frame = frozen.frame(2, "top")
    scene = beamcast.Scene(Path(job.path).parent / "street.glb")
    ranges = scene.cast_rays(sensor.rays(frame.world_from_sensor))["t_hit_f64"]
    expected = np.where((ranges >= 0.5) & (ranges <= 60), ranges, np.inf)
    assert np.array_equal(np.isfinite(expected), np.isfinite(frame["range_m"]))
    hit = np.isfinite(expected)
    # The poses are composed in another order, which rounds otherwise: a few ulps of 200 m at a grazing angle.
    assert np.abs(expected[hit] - frame["range_m"][hit]).max() < 1e-9


def test_presets_have_directions():
    sensor = beamcast.Sensor.preset("ouster/os1-128")
    directions = sensor.directions()
    assert directions.shape == (*sensor.shape, 3) and sensor.shape[0] == 128
    assert np.abs(np.linalg.norm(directions, axis=-1) - 1).max() < 1e-15
    elevation = np.degrees(np.arcsin(directions[..., 2]))
    assert 20 < elevation[0, 0] < 24 and -24 < elevation[-1, 0] < -20
    assert sensor.times_s().shape == sensor.shape == sensor.origins().shape[:2]
    assert "ouster/os1-128" in beamcast.Sensor.presets()
    with pytest.raises(beamcast.ConfigError, match="os1-128"):
        beamcast.Sensor.preset("ouster/os1-129")


def test_overrides_and_threads(job_file):
    job = beamcast.Job(
        job_file,
        {"sensor.top.range.max_m": 10.0, "seed": np.int64(3), "sensor.front.pose": {"position_m": np.array([1.0, 2.0, 3.0])},
         "sequence": {"frames": 2}, "output.legend": False},
        threads=1,
    )
    assert job.frame_count("top") == 2
    frame = job.frame()
    assert frame["range_m"][np.isfinite(frame["range_m"])].max() <= 10
    assert job.frame(0, "front").world_from_sensor[:3, 3].tolist() == [1, 2, 3]
    assert np.array_equal(job.frame(threads=2)["range_m"], frame["range_m"])
    assert [frame.number for frame in job.frames([1, 0, 7, -3], sensors=["top"])] == [0, 1]
    for wrong in ((9, "top"), (-1, "top"), (0, 5)):
        with pytest.raises(IndexError):
            job.frame(*wrong)
    with pytest.raises(KeyError, match="top, front"):
        job.frame(0, "rear")
    assert job.resolved["seed"] == 3


def test_errors_say_where(job_file, tmp_path):
    with pytest.raises(beamcast.ConfigError) as caught:
        beamcast.Job(job_file, {"sensor.top.range.max_m": "far"})
    assert caught.value.key == "max_m" and "max_m" in caught.value.message
    path = job_file.parent / "broken.toml"
    path.write_text(job_file.read_text().replace("max_m = 60.0", "maxm = 60.0", 1).replace("frames = 4", "frames = 0"))
    with pytest.raises(beamcast.ConfigError) as caught:
        beamcast.Job(path)
    error = caught.value
    assert (error.file, error.line) == (str(path), path.read_text().splitlines().index(
        next(line for line in path.read_text().splitlines() if "maxm" in line)) + 1)
    assert len(error.problems) == 2 and error.problems[0]["severity"] == "error"
    assert isinstance(error, ValueError) and isinstance(error, beamcast.Error)
    again = pickle.loads(pickle.dumps(error))
    assert (again.line, again.message, type(again)) == (error.line, error.message, type(error))
    with pytest.raises(beamcast.SceneError):
        beamcast.Job(job_file, {"scene": "none.glb"})
    with pytest.raises(beamcast.ConfigError):
        beamcast.Job(tmp_path / "none.toml")
    with pytest.raises(beamcast.UsageError, match="this machine has"):
        beamcast.Job(job_file, {"sensor.front.pinhole.width_px": 65_536, "sensor.front.pinhole.height_px": 65_536})
    with pytest.raises(TypeError):
        beamcast.Job(job_file, {"seed": object()})


def test_jobs_are_pickled_by_their_inputs(job_file, monkeypatch):
    monkeypatch.chdir(job_file.parent)
    job = beamcast.Job("job.toml", {"seed": 5})
    data = pickle.dumps(job)
    assert len(data) < 1000
    monkeypatch.chdir("/")
    again = pickle.loads(data)
    assert again.resolved == job.resolved
    assert np.array_equal(again.frame(1)["range_m"], job.frame(1)["range_m"])


def test_other_libraries_share_the_memory(job):
    frame = job.frame()
    shared = np.from_dlpack(frame["range"])
    assert np.shares_memory(shared, frame["range"]) and shared.ctypes.data == frame["range"].ctypes.data


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_a_signal_stops_a_frame(job_file):
    # Two thousand million rays, if the machine's memory lets them be asked for: else as many as do.
    for size in (20_000, 8_000, 4_000):
        try:
            job = beamcast.Job(job_file, {"sensor.front.pinhole.width_px": size, "sensor.front.pinhole.height_px": size})
            break
        except beamcast.UsageError:
            pass
    threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    start = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        for _ in range(100):
            job.frame(0, "front")
    assert time.monotonic() - start < 30


def test_reports(job_file, scanned, tmp_path):
    report = beamcast.diff(scanned / "top" / "000000.npz", scanned / "top" / "000000.npz")
    assert report and report.is_fine and report.data
    report = beamcast.diff(scanned / "top" / "000000.npz", scanned / "top" / "000001.npz")
    assert not report.is_fine
    with pytest.raises(beamcast.InputError, match="none.npz"):
        beamcast.diff(scanned / "none.npz", scanned / "top" / "000000.npz")
    checked = tmp_path / "checked.toml"
    text = job_file.read_text().replace('"street.glb"', json.dumps(str(job_file.parent / "street.glb")))
    checked.write_text(text + '\n[[expect]]\nsensor = "top"\nname = "it sees"\nreturns = { at_least = 0.1 }\n')
    report = beamcast.check(checked)
    assert report.is_fine, report.text
    assert not beamcast.check(checked, overrides={"sensor.top.range.max_m": 0.6}).is_fine
    with pytest.raises(beamcast.UsageError):
        beamcast.check()
