"""A drive past a car and a walker, with a LiDAR of two returns a pulse and a camera with a rolling shutter: every return in every
format that holds it, with its time, pose, object and motion."""

import csv
import json
import re
import sys
import tomllib

import numpy as np
import OpenEXR

from bags import check_boxes, check_cloud, check_images, check_odometry, read_bag
from clouds import MORE, check_npy, check_pcd, check_ply
from common import PROJECT, SENSORS, equal, near, parts_of, returns_of, scan
from images import check_npz
from options import check_deep
from surveyors import check_e57, check_las

LABELS = {"road": 40, "car": 10, "walker": 30}
START_S, STAMP_S = 2.0, 1_700_000_000
FRAMES = {"lidar": (3, 0.1), "camera": (6, 0.05)}
ROWS, COLUMNS = 32, 512
# The world is some tens of metres wide. Coordinates have steps of 7e-15 m there, and turning poses into other frames rounds a few
# dozen times.
NEAR_M = 1e-12
JOB = f"""
scene = "{PROJECT}/scenes/drive.glb"
labels = {{ {", ".join(f"{name} = {label}" for name, label in LABELS.items())} }}
seed = 3

[[sensor]]
name = "lidar"
pose = {{ position_m = [0.0, 0.0, 1.9], rpy_deg = [1.0, 2.0, 30.0] }}
footprint = {{ divergence_mrad = [9.0, 9.0], kind = "1/e2" }}
receiver = {{ returns = "dual", intensity = "velodyne" }}
ring = "bottom_up"
range = {{ min_m = 0.5, max_m = 60.0 }}
[sensor.rotating]
elevations_deg = {{ from = 15.0, to = -25.0, count = {ROWS} }}
columns = {COLUMNS}
rate_hz = 10.0

[[sensor]]
name = "camera"
pose = {{ position_m = [0.6, 0.0, 1.4] }}
range = {{ max_m = 60.0 }}
[sensor.pinhole]
width_px = 160
height_px = 90
hfov_deg = 80.0
rate_hz = 20.0
row_time_us = 200.0

[trajectory]
file = "{PROJECT}/configs/street_drive/ego.csv"

[sequence]
duration_s = 0.3
start_s = {START_S}

[[actor]]
name = "oncoming car"
scene = "{PROJECT}/scenes/actors/car.glb"
trajectory = {{ pose = {{ position_m = [20.0, 1.75, 0.0], rpy_deg = [0.0, 0.0, 180.0] }}, twist = {{ linear_m_s = [8.0, 0.0, 0.0] }} }}

[[actor]]
name = "passer-by"
scene = "{PROJECT}/scenes/actors/walker.glb"
trajectory = {{ pose = {{ position_m = [-15.0, -5.0, 0.0], rpy_deg = [0.0, 0.0, 90.0] }}, twist = {{ linear_m_s = [1.25, 0.0, 0.0] }} }}

[truth]
poses = true
boxes = "tracked"

[output]
dir = "out"
formats = [
    "exr",
    "deep",
    "npz",
    "poses",
    {{ format = "npy", motion = true }},
    {{ format = "ply", motion = true }},
    {{ format = "pcd", motion = true }},
    {{ format = "las", motion = true }},
    {{ format = "laz", motion = true }},
    {{ format = "e57", returns = true }},
    {{ format = "mcap", layout = "autoware", organised = false, labels = true, start_stamp_s = {STAMP_S} }},
]
channels = [
    "range", "Z", "intensity", "normal.X", "normal.Y", "normal.Z", "time", "id.instance", "id.semantic", "id.triangle", "id.track",
    "cause", "snr", "echo_width", "velocity.X", "velocity.Y", "velocity.Z", "flow.X", "flow.Y", "flow.Z",
]
"""


def check_pose(where, stem, row):
    """Every header has the pose of the table."""
    expected = {"position_m": [row[f"{axis}_m"] for axis in "xyz"], "quaternion_xyzw": [row[f"q{axis}"] for axis in "xyzw"]}
    header = OpenEXR.File(f"{stem}.exr", header_only=True).parts[0].header
    with np.load(f"{stem}.npz", allow_pickle=False) as arrays:
        about = json.loads(arrays["about"].item())
    told = {"NPZ": about["world_from_sensor"], "EXR": tomllib.loads(f'pose = {header["beamcast:world_from_sensor"]}')["pose"]}
    if where.startswith("lidar"):
        # A camera's points are in its optical frame.
        with open(f"{stem}.ply", "rb") as file:
            line = re.search(rb"comment world_from_points = (.*)\n", file.read())[1].decode()
        told["PLY"] = tomllib.loads(f"pose = {line}")["pose"]
    for name, pose in told.items():
        for key, numbers in expected.items():
            equal(f"{where}: {key} of the {name}", pose[key], numbers)


def check_lines(where, path, row, exr):
    """The pose of each column of a LiDAR, or row of a camera, at the time of its pulses, which all are cast at once."""
    with open(path, newline="") as file:
        lines = [{key: float(value) for key, value in line.items()} for line in csv.DictReader(file)]
    axis, seen = 0 if where.startswith("lidar") else 1, np.isfinite(exr["range"])
    equal(f"{where}: lines", [line["line"] for line in lines], np.arange(seen.shape[1 - axis]))
    # Pixels without a return have no time in the EXR, which has it in 32 bits.
    is_there = seen.any(axis=axis)
    time = exr["time"].max(axis=axis)[is_there].astype(np.float64)
    found = np.array([line["t_s"] for line in lines])[is_there]
    near(f"{where}: times of lines", found, row["t_s"] + time, 2.0**-24 * time + 2.0**-51 * START_S)
    pose = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
    equal(f"{where}: the first line", [lines[0][key] for key in pose], [row[key] for key in pose])


def check_places(where, npy, returns):
    """A LiDAR's points lie on the rays of their rows and columns, as far as the range says, and a camera's as deep as Z says."""
    seen = np.isfinite(returns["range"])
    if where.startswith("camera"):
        equal(f"{where}: depth", npy["z"], returns["Z"][seen])
        return
    rows, columns, _ = np.nonzero(seen)
    elevation = np.radians(15.0 - 40.0 * rows / (ROWS - 1))
    azimuth = np.radians(180.0 - 360.0 * columns / COLUMNS)
    along = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    # The range is rounded, and so is the coordinate, which is no longer.
    ranges = returns["range"][seen].astype(np.float64)
    for axis, direction in zip("xyz", along):
        near(f"{where}: {axis}", npy[axis], ranges * direction, 2.0**-23 * ranges)


def check_objects(where, header, returns, boxes):
    """Labels, ids and tracks are of one object each, whose box counts its returns."""
    actors = {"oncoming car": LABELS["car"], "passer-by": LABELS["walker"]}
    parts = {int(number): name.split("/")[0] for number, name in json.loads(header["beamcast:instances"]).items()}
    seen = np.isfinite(returns["range"])
    tracks = {box["track"]: box for box in boxes}
    for track, box in tracks.items():
        own = seen & (returns["id.track"] == track)
        found = {parts[number] for number in returns["id.instance"][own].tolist()}
        equal(f"{where}: actors of track {track}", sorted(found), [box["name"]] if own.any() else [])
        equal(f"{where}: label of track {track}", np.unique(returns["id.semantic"][own]), [actors[box["name"]]] if own.any() else [])
    # Cars that are parked have the label of a car, too.
    moving = np.isin(returns["id.instance"], [number for number, name in parts.items() if name in actors]) & seen
    equal(f"{where}: what has a track", (returns["id.track"] > 0) & seen, moving)
    equal(f"{where}: points of boxes", [box["points"] for box in boxes], [int((seen & (returns["id.track"] == t)).sum()) for t in tracks])
    return moving


def check_drive(beamcast, folder):
    out = scan(beamcast, folder, JOB, "drive")
    with open(out / "poses.csv", newline="") as file:
        rows = [{key: value if key == "sensor" else float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    boxes = [json.loads(line) for line in (out / "boxes.jsonl").read_text().splitlines()]
    bag, zero_ns = read_bag(out / "bag"), STAMP_S * 1_000_000_000
    for sensor in SENSORS:
        count, period_s = FRAMES[sensor]
        table = [row for row in rows if row["sensor"] == sensor]
        near(f"{sensor}: starts", [row["t_s"] for row in table], START_S + period_s * np.arange(count), 2.0**-51 * START_S)
        second, of_moving = 0, []
        for frame, row in enumerate(table):
            where, stem = f"{sensor} {frame} of the drive", out / sensor / f"{frame:06}"
            parts = parts_of(f"{stem}.exr")
            returns = returns_of(parts)
            own = [box for box in boxes if (box["sensor"], box["frame"]) == (sensor, frame)]
            npy = check_frame(where, stem, parts, row)
            check_places(where, npy, returns)
            header = OpenEXR.File(f"{stem}.exr", header_only=True).parts[0].header
            moving = check_objects(where, header, returns, own)
            of_moving.append(np.median(returns["range"][moving]))
            second += int(np.isfinite(returns["range"][..., 1:]).sum())
            stamp = zero_ns + round(row["t_s"] * 1e9)
            if sensor == "lidar":
                check_cloud(f"{where}: bag", "autoware", bag["/lidar/points"][frame][1], parts[0], npy, stamp, False, True)
            else:
                check_images(f"{where}: bag", bag, frame, parts[0], stamp)
        if len(np.unique(of_moving)) < count or sensor == "lidar" and not second:
            sys.exit(f"{sensor}: nothing moves, or no pulse has two returns, and the drive tests nothing")
    # The end of a frame and the start of the next one may differ in the last bits of their time.
    check_odometry("bag of the drive", bag, rows, zero_ns, NEAR_M)
    check_boxes("bag of the drive", bag, out, zero_ns, {label: name for name, label in LABELS.items()})


def check_frame(where, stem, parts, row):
    """The files of one frame. Returns the points of the NPY."""
    returns = returns_of(parts)
    is_lidar = where.startswith("lidar")
    names = {name for name in parts[0] if name != "Y"}
    npy = check_npy(stem.with_suffix(".npy"), f"{where}: npy", returns)
    more = {field for field, channel in MORE if channel in names and (is_lidar or channel != "cause")}
    equal(f"{where}: fields", sorted(set(npy.dtype.names[10:]) - {"return"}), sorted(more))
    check_ply(stem.with_suffix(".ply"), npy)
    check_npz(stem.with_suffix(".npz"), parts, names)
    check_pcd(stem.with_suffix(".pcd"), f"{where}: pcd", returns, npy, organised=False)
    check_deep(stem.with_suffix(".deep.exr"), parts, "range" if is_lidar else "Z")
    timing = {"start_s": row["t_s"], "top": 255.0 if is_lidar else 1.0}
    las = check_las(stem.with_suffix(".las"), f"{where}: las", returns, npy, 1e-4, **timing)
    check_las(stem.with_suffix(".laz"), f"{where}: laz", returns, npy, 1e-4, las, **timing)
    check_e57(stem.with_suffix(".e57"), f"{where}: e57", returns, npy, has_returns=True)
    check_pose(where, stem, row)
    check_lines(where, stem.with_suffix(".poses.csv"), row, parts[0])
    return npy
