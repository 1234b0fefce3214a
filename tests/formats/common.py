"""What the checks of formats have in common: the frames that are read, and comparisons that count what they compare."""

import pathlib
import subprocess
import sys

import numpy as np
import OpenEXR

PROJECT = pathlib.Path(__file__).parents[2]
JOB = """
scene = "{scene}"
labels = {{ floor = 7, crate = 255, pillar = 12 }}

[[sensor]]
name = "lidar"
preset = "velodyne/vlp-16"
rotating.columns = 360
range = {{ min_m = 1.5, max_m = 6.0 }}
pose = {{ position_m = [0.0, 0.0, 1.2], rpy_deg = [1.0, 2.0, 30.0] }}

[[sensor]]
name = "camera"
pose = {{ position_m = [0.0, 0.0, 1.2], rpy_deg = [0.0, 10.0, -20.0] }}

[sensor.pinhole]
width_px = 96
height_px = 64
hfov_deg = 70.0

[sensor.range]
max_m = 5.0

[output]
dir = "out"
"""
SENSORS = ["lidar", "camera"]
# A receiver without range pairs and without noise reports every peak where it is.
MEASURED = """
footprint = {{ divergence_mrad = [9.0, 9.0], kind = "1/e2" }}
receiver = {{ returns = 8 }}
"""
checks = 0


def scan(beamcast, folder, job, out):
    """Scans a job, whose output is the folder of this name."""
    (folder / "job.toml").write_text(job)
    subprocess.run([beamcast, "scan", "-q", folder / "job.toml", "--out", folder / out], check=True)
    return folder / out


def equal(what, found, expected):
    """Equal shapes and bits; what is not a number is equal to itself."""
    global checks
    found, expected = np.asarray(found), np.asarray(expected)
    is_float = np.issubdtype(expected.dtype, np.floating)
    if found.shape != expected.shape or not np.array_equal(found, expected, equal_nan=is_float):
        sys.exit(f"{what}: {found.shape} {found.dtype} {found} is not {expected.shape} {expected.dtype} {expected}")
    checks += found.size


def read_exr(path):
    part = OpenEXR.File(str(path), separate_channels=True)
    return {name: channel.pixels for name, channel in part.channels().items()}


def near(what, found, expected, tolerance):
    """Equal shapes, and numbers that differ by no more than the tolerance, which is a number or one for each."""
    global checks
    found, expected = np.asarray(found, np.float64), np.asarray(expected, np.float64)
    if found.shape != expected.shape or not (np.abs(found - expected) <= tolerance).all():
        off = f" by {np.abs(found - expected).max()}" if found.shape == expected.shape else ""
        sys.exit(f"{what}: {found} is not {expected}{off}, to {np.max(tolerance)}")
    checks += found.size


def parts_of(path):
    """The channels of each part, which is a number of return."""
    parts = OpenEXR.File(str(path), separate_channels=True).parts
    return [{name: channel.pixels for name, channel in part.channels.items()} for part in parts]


def returns_of(parts):
    """The channels of all returns, as rows × columns × returns."""
    return {name: np.stack([part[name] for part in parts], axis=-1) for name in parts[0]}


def npy_beside(path, ending):
    return path.with_name(f"{path.name.split('.')[0]}.{ending}")
