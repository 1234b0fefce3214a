"""What the tests share. They run against the package that is installed."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import beamcast
from meshes import box

ROOT = Path(__file__).resolve().parents[2]
# Ray would tell its makers that it is used.
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
COMMAND = [sys.executable, "-m", "beamcast"]


@pytest.fixture
def examples(monkeypatch):
    """Lets a test import the examples."""
    monkeypatch.syspath_prepend(str(ROOT / "python" / "examples"))


@pytest.fixture(scope="session")
def room():
    """A scene of two boxes, one in the other: geometry 0 from -2 to 2, geometry 1 from -0.5 to 0.5."""
    scene = beamcast.Scene(*box([-2, -2, -2], [2, 2, 2]))
    assert scene.add_triangles(*box([-0.5, -0.5, -0.5], [0.5, 0.5, 0.5])) == 1
    return scene


@pytest.fixture(scope="session")
def job_file(tmp_path_factory):
    """A job with a LiDAR and a camera, some frames of a drive, in a folder of its own."""
    folder = tmp_path_factory.mktemp("job")
    shutil.copy(ROOT / "scenes" / "street.glb", folder)
    text = """
scene = "street.glb"

[[sensor]]
name = "top"
pose = { position_m = [0.0, 0.0, 1.8] }
rotating = { elevations_deg = { from = 10.0, to = -20.0, count = 16 }, columns = 180, rate_hz = 10.0 }
range = { min_m = 0.5, max_m = 60.0 }

[[sensor]]
name = "front"
pose = { position_m = [1.0, 0.0, 1.5] }
pinhole = { width_px = 64, height_px = 48, hfov_deg = 90.0, rate_hz = 20.0 }
range = { min_m = 0.1, max_m = 60.0 }

[trajectory]
twist = { linear_m_s = [5.0, 0.0, 0.0], angular_deg_s = [0.0, 0.0, 10.0] }

[sequence]
frames = 4

[truth]
boxes = "all"

[output]
dir = "out"
formats = ["npz", "npy"]
"""
    path = folder / "job.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def job(job_file):
    return beamcast.Job(job_file)


@pytest.fixture(scope="session")
def drive_file(job_file):
    """The job with more frames, each of which takes a while."""
    path = job_file.parent / "drive.toml"
    text = job_file.read_text("utf-8").replace("frames = 4", "frames = 60").replace("columns = 180", "columns = 720")
    path.write_text(text.replace('"npz", "npy"', '"exr", "npy"'), "utf-8")
    return path


def files(folder):
    folder = Path(folder)
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def scanned(path, out):
    subprocess.run([*COMMAND, "scan", "-q", str(path), "--out", str(out)], check=True)
    return files(out)


@pytest.fixture(scope="session")
def whole(job_file, tmp_path_factory):
    return scanned(job_file, tmp_path_factory.mktemp("whole"))


@pytest.fixture(scope="session")
def whole_drive(drive_file, tmp_path_factory):
    return scanned(drive_file, tmp_path_factory.mktemp("drive"))


def assert_same(folder, expected):
    found = files(folder)
    assert sorted(found) == sorted(expected)
    assert [name for name in found if found[name] != expected[name]] == []
