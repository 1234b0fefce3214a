"""What the tests share. They run against the package that is installed."""

import shutil
from pathlib import Path

import pytest

import beamcast
from meshes import box

ROOT = Path(__file__).resolve().parents[2]


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
