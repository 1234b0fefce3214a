"""Reads the program's files back with the tools that their users have, and compares every value with the EXR's.

    python tests/formats/check.py BEAMCAST    # with tests/open3d/requirements.txt

One frame of a LiDAR and one of a camera are scanned in all formats, with misses of each kind, ids, labels and times. Equal means
equal bits, apart from coordinates, which the EXR does not have: those are equal between PCD and NPY, and as far from the sensor
as the EXR's range says. Those of LAS and E57 are the NPY's, rounded to the formats' own steps. Waveforms are added up with NumPy,
and have their peaks where the frame has its ranges. Every sample of a deep EXR is the return of that number in the EXR's parts, and
options of EXR and PLY change no value but those that half floats round. What these tools write of PCD, NPY and NPZ files is the same
to `beamcast diff`. Bags of a drive round a circle are read by rosbags and by mcap-ros2-support: every field of every point in every
layout, images, poses, and what the inertial sensor has to measure there.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import cv2
import laspy
import numpy as np
import open3d as o3d
import OpenEXR
import PIL.Image
import mcap.reader
import mcap_ros2.decoder
import plyfile
import pye57
import pypcd4
from pye57 import libe57
import rosbags.highlevel

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
# Those whose settings differ go to different folders.
RUNS = [
    'formats = ["exr", "png", "ply", "npy", "npz", "pcd", "las", "laz", "e57", "depth16", "labels", "instances"]',
    """formats = [
    "exr",
    { format = "npz", compressed = true },
    { format = "pcd", organised = true },
    { format = "las", scale = 0.001 },
    { format = "e57", returns = true },
    { format = "depth16", scale = 5000 },
    { format = "labels", bits = 8 },
    { format = "instances", palette = true },
]""",
    'formats = ["npz", { format = "depth16", scale = 256 }, { format = "labels", palette = true }]\n'
    'channels = ["range", "Z", "normal.X"]',
]
SENSORS = ["lidar", "camera"]
# A receiver without range pairs and without noise reports every peak where it is.
MEASURED = """
footprint = {{ divergence_mrad = [9.0, 9.0], kind = "1/e2" }}
receiver = {{ returns = 8 }}
"""
checks = 0


def equal(what, found, expected):
    """Equal shapes, types of one kind and bits; what is not a number is equal to itself."""
    global checks
    found, expected = np.asarray(found), np.asarray(expected)
    is_float = np.issubdtype(expected.dtype, np.floating)
    if found.shape != expected.shape or not np.array_equal(found, expected, equal_nan=is_float):
        sys.exit(f"{what}: {found.shape} {found.dtype} is not what the EXR says, {expected.shape} {expected.dtype}")
    checks += found.size


def read_exr(path):
    part = OpenEXR.File(str(path), separate_channels=True)
    return {name: channel.pixels for name, channel in part.channels().items()}


def check_npz(path, exr, names):
    with np.load(path, allow_pickle=False) as arrays:
        about = json.loads(arrays["about"].item())
        has_normal = all(f"normal.{axis}" in names for axis in "XYZ")
        expected = {name for name in names if not (has_normal and name.startswith("normal."))} | {"about"}
        expected |= {"normal"} if has_normal else set()
        equal(f"{path}: names", sorted(arrays.files), sorted(expected))
        for name in expected - {"about", "normal"}:
            equal(f"{path}: {name}", arrays[name], exr[name])
            if arrays[name].dtype != exr[name].dtype:
                sys.exit(f"{path}: {name} is {arrays[name].dtype}, and the EXR's {exr[name].dtype}")
        if has_normal:
            equal(f"{path}: normal", arrays["normal"], np.stack([exr[f"normal.{axis}"] for axis in "XYZ"], axis=-1))
        for name, array in about["arrays"].items():
            equal(f"{path}: the shape of {name}", array["shape"], list(arrays[name].shape))


def check_depth(path, channel, depth, scale):
    texts = PIL.Image.open(path).text
    equal(f"{path}: texts", (texts["beamcast:channel"], texts["beamcast:scale"]), (channel, str(scale)))
    expected = np.floor(depth.astype(np.float64) * scale + 0.5)
    expected[~np.isfinite(depth) | (expected > 65535)] = 0
    for reader, image in [
        ("PIL", np.asarray(PIL.Image.open(path))),
        ("OpenCV", cv2.imread(str(path), cv2.IMREAD_UNCHANGED)),
        ("Open3D", o3d.t.io.read_image(str(path)).as_tensor().numpy()[..., 0]),
    ]:
        equal(f"{path} by {reader}", image, expected.astype(np.uint16))
        if image.dtype != np.uint16:
            sys.exit(f"{path} by {reader} is {image.dtype}")


def check_numbers(path, numbers, has_palette=False):
    image = PIL.Image.open(path)
    equal(f"{path} by PIL", np.asarray(image), numbers)
    if has_palette:
        colours = np.reshape(image.getpalette(), (-1, 3))
        equal(f"{path}: different colours", len(np.unique(colours, axis=0)), 256)
        equal(f"{path}: 0 is black", colours[0], [0, 0, 0])
        # OpenCV has no indexed images, and reads the colours, blue first.
        equal(f"{path} by OpenCV", cv2.imread(str(path))[..., ::-1], colours[numbers])
    else:
        equal(f"{path} by OpenCV", cv2.imread(str(path), cv2.IMREAD_UNCHANGED), numbers)


def check_points(where, points, exr, seen):
    """The fields that NPY and PCD share, of the pixels that have a return."""
    equal(f"{where}: range", points["range"], exr["range"][seen])
    equal(f"{where}: intensity", points["intensity"], exr["intensity"][seen])
    equal(f"{where}: instance", points["instance"], exr["id.instance"][seen])
    equal(f"{where}: label", points["label"], exr["id.semantic"][seen])
    rows = exr["range"].shape[0]
    ring = np.broadcast_to(np.arange(rows)[:, None], exr["range"].shape)
    # The LiDAR's maker counts rings from the lowest beam.
    ring = rows - 1 - ring if where.startswith("lidar") else ring
    equal(f"{where}: ring", points["ring"], ring[seen])


def check_npy(path, where, exr):
    points = np.load(path, allow_pickle=False)
    seen = np.isfinite(exr["range"])
    check_points(where, points, exr, seen)
    equal(f"{where}: column", points["column"], np.nonzero(seen)[1])
    # Nanoseconds, and seconds in 32 bits, are each rounded once.
    if np.abs(points["t"] * 1e-9 - exr["time"][seen]).max() > 0.5e-9 + 2.0**-24 * exr["time"].max():
        sys.exit(f"{where}: t is not the EXR's time")
    distance = np.sqrt(sum(points[axis].astype(np.float64) ** 2 for axis in "xyz"))
    # A VLP-16's beams start beside the centre, and each coordinate is rounded.
    if np.abs(distance - exr["range"][seen]).max() > 0.1:
        sys.exit(f"{where}: the points are elsewhere than the EXR's range says")
    return points


def check_ply(path, npy):
    points = plyfile.PlyData.read(path)["vertex"].data
    by_open3d = o3d.t.io.read_point_cloud(str(path)).point
    equal(f"{path}: fields", points.dtype.names, npy.dtype.names)
    equal(f"{path} by Open3D", by_open3d.positions.numpy(), np.stack([npy[axis] for axis in "xyz"], axis=-1))
    for name in npy.dtype.names:
        equal(f"{path} by plyfile: {name}", points[name], npy[name])
        if name not in "xyz":
            equal(f"{path} by Open3D: {name}", by_open3d[name].numpy().reshape(-1), npy[name])


def check_pcd(path, where, exr, npy, organised):
    cloud = pypcd4.PointCloud.from_path(path)
    meta = cloud.metadata
    points = {name: cloud.pc_data[name] for name in cloud.fields}
    seen = np.isfinite(exr["range"])
    rows, columns = seen.shape
    size = (columns, rows) if organised else (int(seen.sum()), 1)
    equal(f"{where}: size", (meta.width, meta.height, meta.points), (*size, size[0] * size[1]))
    if organised:
        for name in ("x", "y", "z", "range"):
            equal(f"{where}: misses of {name}", np.isnan(points[name]), ~seen.reshape(-1))
        equal(f"{where}: time of all pixels", points["time"], exr["time"].reshape(-1))
        points = {name: values[seen.reshape(-1)] for name, values in points.items()}
    else:
        equal(f"{where}: time", points["time"], exr["time"][seen])
    check_points(where, points, exr, seen)
    for axis in "xyz":
        equal(f"{where}: {axis}", points[axis], npy[axis])
    by_open3d = o3d.t.io.read_point_cloud(str(path)).point
    is_there = np.isfinite(by_open3d["range"].numpy().reshape(-1))
    positions = by_open3d.positions.numpy()
    equal(f"{where} by Open3D: misses", np.isnan(positions).all(axis=1), ~is_there)
    equal(f"{where} by Open3D", positions[is_there], np.stack([npy[axis] for axis in "xyz"], axis=-1))
    for name in ("intensity", "ring", "time", "instance", "label", "range"):
        equal(f"{where} by Open3D: {name}", by_open3d[name].numpy().reshape(-1)[is_there], points[name])
    with np.load(npy_beside(path, "npz"), allow_pickle=False) as arrays:
        pose = json.loads(arrays["about"].item())["world_from_sensor"]
    equal(f"{where}: viewpoint", meta.viewpoint[:3], pose["position_m"])
    if where.startswith("lidar"):
        x, y, z, w = pose["quaternion_xyzw"]
        equal(f"{where}: viewpoint", meta.viewpoint[3:], (w, x, y, z))


def check_waveforms(beamcast, folder):
    lidar = JOB.split("[[sensor]]")[1].replace("max_m = 6.0", "max_m = 60.0")
    job = f'scene = "{PROJECT / "scenes" / "room.glb"}"\n[[sensor]]{lidar}{MEASURED}'.replace("{{", "{").replace("}}", "}")
    job += '[output]\ndir = "out"\nformats = ["npz", { format = "waveform", bin_m = 0.03, from_m = 1.0, to_m = 4.0 }]\n'
    (folder / "job.toml").write_text(job)
    subprocess.run([beamcast, "scan", "-q", folder / "job.toml"], check=True)
    files = folder / "out" / "lidar"
    with np.load(files / "000000.waveform.npz") as arrays, np.load(files / "000000.npz") as frame:
        about = json.loads(arrays["about"].item())
        returns = [frame[name] for name in frame.files if name.split("/")[-1] == "range"]
        offsets, sigma = arrays["offsets"], arrays["sigma"].item()
        ranges, amplitudes, samples = (arrays[name] for name in ("range", "amplitude", "samples"))
    equal("waveform: pixels", len(offsets), about["rows"] * about["columns"] + 1)
    equal("waveform: offsets", (offsets[0], offsets[-1], bool((np.diff(offsets.astype(np.int64)) >= 0).all())), (0, len(ranges), True))
    equal("waveform: samples", list(samples.shape), [about["rows"], about["columns"], 101])
    places = about["samples"]["from_m"] + about["samples"]["bin_m"] * np.arange(101)
    most = 0
    for pixel in range(0, len(offsets) - 1, 7):
        own = slice(offsets[pixel], offsets[pixel + 1])

        def pulses(r):
            z = (r[:, None] - ranges[own]) / sigma
            return z, amplitudes[own] * np.exp(-0.5 * z**2)

        height = pulses(places)[1].sum(axis=1)
        # A float32 is within 2^-24 of its value; what is below 2^-53 of a Gaussian's peak is left out.
        wrong = np.abs(samples.reshape(-1, 101)[pixel] - height) > 6e-8 * height + 1e-15 * amplitudes[own].sum()
        equal(f"waveform: samples of pixel {pixel}", int(wrong.sum()), 0)
        found = np.array([of.reshape(-1)[pixel] for of in returns], np.float64)
        found = found[np.isfinite(found)]
        most = max(most, len(found))
        # At a peak the slope is 0. A range in float32 is off by 2^-24 of it, which the curvature, at most sum/sigma^2, makes a slope.
        z, each = pulses(found)
        slope, sums = np.abs((z * each).sum(axis=1)) / sigma, np.abs((z**2 - 1) * each).sum(axis=1) / sigma**2
        equal(f"waveform: peaks of pixel {pixel}", int((slope > 6e-8 * found * sums * 1.01 + 1e-12).sum()), 0)
    if most < 2:
        sys.exit("no pulse has two peaks, and the waveforms test nothing")


BAG_JOB = """
scene = "{scene}"
labels = {{ floor = 7, crate = 255, pillar = 12 }}
seed = 5

[[sensor]]
name = "lidar"
preset = "velodyne/vlp-16"
rotating.columns = 90
range = {{ min_m = 1.5, max_m = 6.0 }}
pose = {{ position_m = [0.5, 0.0, 1.2], rpy_deg = [1.0, 2.0, 30.0] }}
{receiver}
[[sensor]]
name = "camera"
pose = {{ position_m = [0.0, 0.0, 1.2], rpy_deg = [0.0, 10.0, -20.0] }}
range = {{ max_m = 5.0 }}

[sensor.pinhole]
width_px = 48
height_px = 32
fx_px = 40.0
fy_px = 41.0
cx_px = 23.0
cy_px = 17.0
distortion = [-0.1, 0.01, 0.001, 0.0]
rate_hz = 20.0

[trajectory]
twist = {{ linear_m_s = [1.5, 0.0, 0.0], angular_deg_s = [0.0, 0.0, 60.0] }}

[sequence]
frames = 3

[truth]
boxes = "labelled"

[output]
dir = "out"
formats = ["exr", "npy", "poses", {{ format = "mcap", imu_hz = 200, labels = true, start_stamp_s = {stamp}, {options} }}]
"""
# Each layout with its fields as sensor_msgs/PointField has them: name, offset and type, and the step.
X_Y_Z_INTENSITY = [("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("intensity", 12, 7)]
FIELDS = {
    "velodyne": (X_Y_Z_INTENSITY + [("ring", 16, 4), ("time", 18, 7)], 22),
    "fast_lio": (X_Y_Z_INTENSITY + [("ring", 16, 4), ("t", 18, 6)], 22),
    "hesai": (X_Y_Z_INTENSITY + [("ring", 16, 4), ("timestamp", 18, 8)], 26),
    "robosense": (X_Y_Z_INTENSITY + [("ring", 16, 4), ("timestamp", 18, 8)], 26),
    "livox": (X_Y_Z_INTENSITY + [("tag", 16, 2), ("line", 17, 2), ("timestamp", 18, 8)], 26),
    "ouster": (
        X_Y_Z_INTENSITY[:3]
        + [("intensity", 16, 7), ("t", 20, 6), ("reflectivity", 24, 4), ("ring", 26, 4), ("ambient", 28, 4), ("range", 32, 6)],
        48,
    ),
    "autoware": (
        X_Y_Z_INTENSITY[:3]
        + [("intensity", 12, 2), ("return_type", 13, 2), ("channel", 14, 4), ("azimuth", 16, 7), ("elevation", 20, 7)]
        + [("distance", 24, 7), ("time_stamp", 28, 6)],
        32,
    ),
    "livox_custom": None,
}
TYPES = {2: "u1", 4: "<u2", 6: "<u4", 7: "<f4", 8: "<f8"}
STAMP_S = 1_700_000_000.25


def near(what, found, expected, tolerance):
    global checks
    found, expected = np.asarray(found, np.float64), np.asarray(expected, np.float64)
    if found.shape != expected.shape or not (np.abs(found - expected) <= tolerance).all():
        sys.exit(f"{what}: {found} is not {expected} to {tolerance}")
    checks += found.size


def as_lists(message):
    """A message as plain lists and numbers, whichever tool has read it."""
    if isinstance(message, np.ndarray):
        return message.tolist() if message.dtype != np.uint8 else message.tobytes()
    if isinstance(message, (bytes, bytearray)):
        return bytes(message)
    if isinstance(message, (list, tuple)):
        return [as_lists(one) for one in message]
    names = getattr(message, "__dataclass_fields__", None) or getattr(message, "__slots__", None)
    # The names of constants are in capitals.
    members = [name for name in names or () if name != "__msgtype__" and not name.isupper()]
    return {name: as_lists(getattr(message, name)) for name in members} if names else message


def read_bag(folder):
    """The messages of a bag by topic, each with the time of its log; both tools have to find the same."""
    by_mcap, by_rosbags, last = {}, {}, 0
    with open(folder / "bag_0.mcap", "rb") as file:
        reader = mcap.reader.make_reader(file, decoder_factories=[mcap_ros2.decoder.DecoderFactory()], validate_crcs=True)
        if reader.get_header().profile != "ros2":
            sys.exit(f"{folder}: the profile is {reader.get_header().profile!r}")
        for _, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
            if message.log_time < last:
                sys.exit(f"{folder}: {channel.topic} goes back in time")
            last = message.log_time
            by_mcap.setdefault(channel.topic, []).append((message.log_time, as_lists(decoded)))
    with rosbags.highlevel.AnyReader([folder]) as reader:
        for connection, log_time, raw in reader.messages():
            decoded = as_lists(reader.deserialize(raw, connection.msgtype))
            by_rosbags.setdefault(connection.topic, []).append((log_time, decoded))
    equal(f"{folder}: topics", sorted(by_rosbags), sorted(by_mcap))
    for topic, messages in by_mcap.items():
        if messages != by_rosbags[topic]:
            sys.exit(f"{folder}: the tools differ about {topic}")
    return by_mcap


def stamp_ns(header):
    return header["stamp"]["sec"] * 1_000_000_000 + header["stamp"]["nanosec"]


def vector(v):
    return [v[axis] for axis in "xyzw" if axis in v]


def check_cloud(where, layout, cloud, exr, npy, start_ns, is_organised, is_dual):
    seen = np.isfinite(exr["range"])
    rows, columns = seen.shape
    fields, step = FIELDS[layout]
    equal(f"{where}: fields", [(f["name"], f["offset"], f["datatype"], f["count"]) for f in cloud["fields"]], [(*f, 1) for f in fields])
    size = (rows, columns) if is_organised else (1, len(npy))
    equal(f"{where}: size", (cloud["height"], cloud["width"], cloud["point_step"], cloud["row_step"]), (*size, step, size[1] * step))
    equal(f"{where}: is_dense", (cloud["is_dense"], cloud["is_bigendian"]), (not is_organised, False))
    dtype = np.dtype({
        "names": [name for name, _, _ in fields],
        "formats": [TYPES[kind] for _, _, kind in fields],
        "offsets": [offset for _, offset, _ in fields],
        "itemsize": step,
    })
    points = np.frombuffer(cloud["data"], dtype)
    start = stamp_ns(cloud["header"])
    equal(f"{where}: stamp", start, start_ns)
    if is_organised:
        equal(f"{where}: misses", np.isnan(points["x"]), ~seen.reshape(-1))
        # A pixel without a return has the time of its pulse.
        times = (points["t"] if "t" in dtype.names else points["time"]).reshape(rows, columns)
        if not (np.diff(times.astype(np.float64), axis=1) > 0).all():
            sys.exit(f"{where}: the times of columns do not grow")
        points = points[seen.reshape(-1)]
        npy = npy[np.unique(npy["ring"].astype(np.int64) * -columns + npy["column"], return_index=True)[1]]
    else:
        order = np.argsort(npy["t"], kind="stable")
        # Points of one time stay column by column and row by row, highest beam first.
        order = np.lexsort((-npy["ring"].astype(np.int64), npy["column"], npy["t"]))
        npy = npy[order]
    for axis in "xyz":
        equal(f"{where}: {axis}", points[axis], npy[axis])
    check_fields(where, points, npy, start, is_dual)


def check_fields(where, points, npy, start, is_dual):
    """The fields beside the coordinates; NPY has the same returns in the same order."""
    names = points.dtype.names
    # An ideal sensor's intensity is 0 to 1; a receiver of this job has a maker's scale.
    intensity = npy["intensity"] * np.float32(1.0 if is_dual else 255.0)
    whole = np.floor(intensity.astype(np.float64) + 0.5)
    for name in set(names) & {"intensity", "reflectivity"}:
        is_float = points[name].dtype == np.float32
        equal(f"{where}: {name}", points[name], (intensity if is_float else whole).astype(points[name].dtype))
    for name in set(names) & {"ring", "channel", "line"}:
        equal(f"{where}: {name}", points[name], npy["ring"])
    for name in set(names) & {"t", "time_stamp", "offset_time"}:
        equal(f"{where}: {name}", points[name], npy["t"])
    if "time" in names:
        # Nanoseconds, and seconds in 32 bits, are each rounded once.
        near(f"{where}: time", points["time"], npy["t"] * 1e-9, 0.5e-9 + 2.0**-24 * npy["t"].max() * 1e-9)
    if "timestamp" in names:
        absolute = np.array([(start + int(t)) / (1 if "tag" in names else 1e9) for t in npy["t"]], np.float64)
        equal(f"{where}: timestamp", points["timestamp"], absolute)
    number = npy["return"] if is_dual else np.zeros(len(npy), int)
    if "tag" in names:
        equal(f"{where}: tag", points["tag"], number << 4)
    if "range" in names:
        millimetres = np.floor(npy["range"].astype(np.float64) * 1000 + 0.5)
        equal(f"{where}: range", points["range"], millimetres.astype(np.uint32))
        equal(f"{where}: ambient", points["ambient"], np.zeros(len(npy), np.uint16))
    if "azimuth" in names:
        x, y, z = (points[axis].astype(np.float64) for axis in "xyz")
        # Both sides are rounded once from f64, and NumPy's functions differ from libm's in the last bit of that.
        near(f"{where}: azimuth", points["azimuth"], np.arctan2(y, x), 2.0**-23)
        near(f"{where}: elevation", points["elevation"], np.arctan2(z, np.hypot(x, y)), 2.0**-24)
        near(f"{where}: distance", points["distance"], np.sqrt(x * x + y * y + z * z), 2.0**-22)
        kinds = set(points["return_type"].tolist())
        if not is_dual:
            equal(f"{where}: return_type", sorted(kinds), [1])
        elif not {7} < kinds <= {3, 4, 5, 6, 7}:
            sys.exit(f"{where}: return_type is {kinds}")


def check_bag(bag, folder, layout, is_organised, is_dual):
    where = f"bag {layout}"
    start_ns = int(STAMP_S) * 1_000_000_000 + round(STAMP_S % 1 * 1e9)
    poses = np.genfromtxt(folder / "poses.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    for frame, (log_time, message) in enumerate(bag["/lidar/points"]):
        own = start_ns + frame * 100_000_000
        exr, npy = read_exr(folder / "lidar" / f"{frame:06}.exr"), np.load(folder / "lidar" / f"{frame:06}.npy")
        equal(f"{where}: log", log_time, own)
        equal(f"{where}: frame", message["header"]["frame_id"], "lidar")
        if layout == "livox_custom":
            points = np.array(
                [tuple(point.values()) for point in message["points"]],
                [("offset_time", "u4"), *((axis, "f4") for axis in "xyz"), ("reflectivity", "u1"), ("tag", "u1"), ("line", "u1")],
            )
            equal(f"{where}: stamp", (stamp_ns(message["header"]), message["timebase"], message["point_num"]), (own, own, len(points)))
            npy = npy[np.lexsort((-npy["ring"].astype(np.int64), npy["column"], npy["t"]))]
            for axis in "xyz":
                equal(f"{where}: {axis}", points[axis], npy[axis])
            check_fields(where, points, npy, own, is_dual)
        else:
            check_cloud(where, layout, message, exr, npy, own, is_organised, is_dual)
    for frame in range(3):
        exr = read_exr(folder / "camera" / f"{frame:06}.exr")
        own = start_ns + frame * 50_000_000
        depth, labels, info = (bag[f"/camera/{kind}"][frame][1] for kind in ("depth", "labels", "camera_info"))
        for image in (depth, labels, info):
            equal(f"{where}: image", (stamp_ns(image["header"]), image["height"], image["width"]), (own, 32, 48))
            equal(f"{where}: image", image["header"]["frame_id"], "camera_optical")
        z = np.where(np.isfinite(exr["Z"]), exr["Z"], np.nan)
        if depth["encoding"] == "32FC1":
            equal(f"{where}: depth", np.frombuffer(depth["data"], "<f4").reshape(32, 48), z)
        else:
            whole = np.nan_to_num(np.floor(z.astype(np.float64) * 1000 + 0.5)).astype(np.uint16)
            equal(f"{where}: depth", np.frombuffer(depth["data"], "<u2").reshape(32, 48), whole)
        equal(f"{where}: labels", np.frombuffer(labels["data"], "<u2").reshape(32, 48), exr["id.semantic"])
        equal(f"{where}: lens", info["distortion_model"], "plumb_bob")
        equal(f"{where}: D", info["d"], [-0.1, 0.01, 0.001, 0.0, 0.0])
        # ROS counts pixels from the centre of the top left one.
        equal(f"{where}: K", info["k"], [40.0, 0.0, 22.5, 0.0, 41.0, 16.5, 0.0, 0.0, 1.0])
        # OpenCV, with that K and D, projects what the pixels show back to them.
        check_projection(where, info, npy_of_camera=np.load(folder / "camera" / f"{frame:06}.npy"), seen=np.isfinite(exr["Z"]))
    check_motion(where, bag, poses, start_ns)
    check_boxes(where, bag, folder, start_ns)


def check_projection(where, info, npy_of_camera, seen):
    points = np.stack([npy_of_camera[axis] for axis in "xyz"], axis=-1).astype(np.float64)
    k, d = np.reshape(info["k"], (3, 3)), np.array(info["d"])
    pixels = cv2.projectPoints(points, np.zeros(3), np.zeros(3), k, d)[0].reshape(-1, 2)
    rows, columns = np.nonzero(seen)
    # Coordinates of 6 m in 32 bits, seen from 1 m, at 41 px.
    near(f"{where}: projection", pixels, np.stack([columns, rows], axis=-1), 41 * 6 * 2.0**-23 * 4)


def check_motion(where, bag, poses, start_ns):
    by_stamp = {stamp_ns(message["header"]): message for _, message in bag["/odom"]}
    speed, turn = 1.5, np.pi / 3
    for row in poses:
        message = by_stamp[start_ns + round(row["t_s"] * 1e9)]
        equal(f"{where}: frames", (message["header"]["frame_id"], message["child_frame_id"]), ("world", "base_link"))
        pose, twist = message["pose"]["pose"], message["twist"]["twist"]
        # The end of a frame and the start of the next one may differ in the last bits of their time.
        near(f"{where}: position", vector(pose["position"]), [row[f"body_{axis}_m"] for axis in "xyz"], 1e-15)
        near(f"{where}: attitude", vector(pose["orientation"]), [row[f"body_q{axis}"] for axis in "xyzw"], 1e-15)
        near(f"{where}: velocity", vector(twist["linear"]), [speed, 0, 0], 1e-15)
        near(f"{where}: turn", vector(twist["angular"]), [0, 0, turn], 1e-15)
    transforms = [message["transforms"][0] for _, message in bag["/tf"]]
    equal(f"{where}: /tf", [stamp_ns(t["header"]) for t in transforms], sorted(by_stamp))
    for transform in transforms:
        pose = by_stamp[stamp_ns(transform["header"])]["pose"]["pose"]
        equal(f"{where}: /tf", vector(transform["transform"]["translation"]), vector(pose["position"]))
        equal(f"{where}: /tf", vector(transform["transform"]["rotation"]), vector(pose["orientation"]))
    # A frame of the LiDAR starts at 0, 0.1 and 0.2 s, and the last one ends at 0.3 s.
    equal(f"{where}: /odom", sorted(by_stamp), [start_ns + 50_000_000 * i for i in (0, 1, 2, 3, 4, 6)])
    stamps = [stamp_ns(message["header"]) for _, message in bag["/imu/data"]]
    equal(f"{where}: /imu/data", stamps, [start_ns + 5_000_000 * i for i in range(61)])
    for stamp, (_, message) in zip(stamps, bag["/imu/data"]):
        near(f"{where}: gyroscope", vector(message["angular_velocity"]), [0, 0, turn], 1e-15)
        # On a circle the acceleration is v·ω towards the centre, which is on the left; gravity pulls down.
        near(f"{where}: accelerometer", vector(message["linear_acceleration"]), [0, speed * turn, 9.80665], 1e-14)
        angle = turn * (stamp - start_ns) * 1e-9
        near(f"{where}: attitude", vector(message["orientation"]), [0, 0, np.sin(angle / 2), np.cos(angle / 2)], 1e-15)
    fixed = bag["/tf_static"][-1][1]["transforms"]
    equal(f"{where}: /tf_static", [(t["header"]["frame_id"], t["child_frame_id"]) for t in fixed],
          [("base_link", "lidar"), ("base_link", "camera"), ("camera", "camera_optical")])
    equal(f"{where}: mount", vector(fixed[0]["transform"]["translation"]), [0.5, 0.0, 1.2])
    near(f"{where}: optical", vector(fixed[2]["transform"]["rotation"]), [0.5, -0.5, 0.5, -0.5], 0)


def check_boxes(where, bag, folder, start_ns):
    rows = [json.loads(line) for line in (folder / "boxes.jsonl").read_text().splitlines()]
    names = {7: "floor", 255: "crate", 12: "pillar"}
    for sensor, period in (("lidar", 100_000_000), ("camera", 50_000_000)):
        for frame, (_, message) in enumerate(bag[f"/{sensor}/boxes"]):
            own = [row for row in rows if row["sensor"] == sensor and row["frame"] == frame]
            equal(f"{where}: boxes", (stamp_ns(message["header"]), len(message["detections"])), (start_ns + frame * period, len(own)))
            for row, found in zip(own, message["detections"]):
                equal(f"{where}: box", stamp_ns(found["header"]), start_ns + round(row["t_s"] * 1e9))
                center, hypothesis = found["bbox"]["center"], found["results"][0]
                equal(f"{where}: box", vector(center["position"]), row["in_world"]["centre_m"])
                equal(f"{where}: box", vector(center["orientation"]), row["in_world"]["quaternion_xyzw"])
                equal(f"{where}: box", vector(found["bbox"]["size"]), [row[f"{side}_m"] for side in ("length", "width", "height")])
                equal(f"{where}: box", (found["id"], hypothesis["hypothesis"]["class_id"]), (str(row["track"]), names.get(row["label"], str(row["label"]))))
                if hypothesis["pose"]["pose"] != center or hypothesis["hypothesis"]["score"] != 1.0:
                    sys.exit(f"{where}: the hypothesis is another box")


def check_bags(beamcast, folder):
    job = folder / "bag.toml"
    dual = '[sensor.receiver]\nreturns = "dual"\nintensity = "velodyne"\n[sensor.footprint]\ndivergence_mrad = [9.0, 9.0]\nkind = "1/e2"\n'
    for layout in FIELDS:
        for is_organised in {False, layout in ("velodyne", "ouster")}:
            is_dual = layout in ("livox", "livox_custom", "autoware")
            options = f'layout = "{layout}"' + (", organised = true" if is_organised else "")
            options += ', time_unit = "ns"' if layout == "fast_lio" else ""
            options += ', depth = "16UC1", compression = "zstd"' if layout == "ouster" else ""
            job.write_text(BAG_JOB.format(scene=PROJECT / "scenes" / "room.glb", stamp=STAMP_S, options=options, receiver=dual if is_dual else ""))
            out = folder / f"bag-{layout}-{is_organised}"
            subprocess.run([beamcast, "scan", "-q", job, "--out", out], check=True)
            check_bag(read_bag(out / "bag"), out, layout, is_organised, is_dual)


def parts_of(path):
    """The channels of each part, which is a number of return."""
    parts = OpenEXR.File(str(path), separate_channels=True).parts
    return [{name: channel.pixels for name, channel in part.channels.items()} for part in parts]


def check_deep(path, parts, depth):
    part = OpenEXR.File(str(path), separate_channels=True).parts[0]
    seen = np.stack([np.isfinite(of_return[depth]) for of_return in parts])
    counts = seen.sum(axis=0)
    names = sorted({name for name in parts[0] if name != "Y"} | {"Z"})
    equal(f"{path}: channels", sorted(part.channels), names)
    equal(f"{path}: most samples", part.header["maxSamplesPerPixel"], counts.max())
    for name in names:
        source = name if name in parts[0] else depth
        pixels = part.channels[name].pixels
        samples = [[] if pixel is None else list(pixel) for pixel in pixels.reshape(-1)]
        equal(f"{path}: samples of {name}", [len(pixel) for pixel in samples], counts.reshape(-1))
        values = np.array([value for pixel in samples for value in pixel])
        equal(f"{path}: type of {name}", str(values.dtype), str(parts[0][source].dtype))
        # Pixel by pixel, and in each the returns in their order.
        expected = np.stack([of_return[source] for of_return in parts])
        equal(f"{path}: {name}", values, np.moveaxis(expected, 0, -1)[np.moveaxis(seen, 0, -1)])


def check_options(beamcast, folder):
    """A LiDAR of two returns a pulse, and a camera, in each way that EXR, deep EXR and PLY can be written."""
    two = """footprint = { divergence_mrad = [9.0, 9.0], kind = "1/e2" }\nreceiver = { returns = "dual" }\n"""
    job = JOB.format(scene=PROJECT / "scenes" / "room.glb").replace("rotating.columns", two + "rotating.columns")
    runs = [
        ["exr", "deep", "ply"],
        ["exr compression zips", "deep compression none", "ply ascii true"],
        ["exr compression rle", "ply flavour cloudcompare"],
        ["exr compression piz", "ply flavour cloudcompare ascii true"],
        ["exr compression none"],
        ["exr half true"],
    ]

    def table(words):
        name, *options = words.split(" ")
        pairs = [f"{key} = {value if value == 'true' else json.dumps(value)}" for key, value in zip(options[::2], options[1::2])]
        return f"{{ {', '.join([f'format = {json.dumps(name)}', *pairs])} }}"

    folder = folder / "options"
    folder.mkdir()
    for number, formats in enumerate(runs):
        (folder / "job.toml").write_text(job + f"formats = [{', '.join(map(table, formats))}]\n")
        subprocess.run([beamcast, "scan", "-q", folder / "job.toml", "--out", folder / str(number)], check=True)
    for sensor in SENSORS:
        files = [folder / str(number) / sensor for number in range(len(runs))]
        parts = parts_of(files[0] / "000000.exr")
        if sensor == "lidar" and not np.isfinite(parts[1]["range"]).any():
            sys.exit("no pulse has two returns, and deep images test nothing")
        check_deep(files[0] / "000000.deep.exr", parts, "Z" if sensor == "camera" else "range")
        check_deep(files[1] / "000000.deep.exr", parts, "Z" if sensor == "camera" else "range")
        sizes = {path.stat().st_size for path in (file / "000000.exr" for file in files)}
        equal(f"{sensor}: sizes of the compressions", len(sizes), len(runs))
        for file in files[1:]:
            for of_return, again in zip(parts, parts_of(file / "000000.exr"), strict=True):
                for name, values in of_return.items():
                    rounded = file == files[-1] and (name == "intensity" or name.startswith("normal."))
                    equal(f"{file}: {name}", again[name], values.astype(np.float16) if rounded else values)
                    if rounded and again[name].dtype != np.float16:
                        sys.exit(f"{file}: {name} is {again[name].dtype}")
        ply = plyfile.PlyData.read(files[0] / "000000.ply")["vertex"].data
        plain, prefixed = ply.dtype.names, [name if name in "xyz" else f"scalar_{name}" for name in ply.dtype.names]
        for file, names in zip(files[1:4], (plain, prefixed, prefixed)):
            again = plyfile.PlyData.read(file / "000000.ply")["vertex"].data
            by_open3d = o3d.t.io.read_point_cloud(str(file / "000000.ply")).point
            equal(f"{file}: fields", again.dtype.names, names)
            equal(f"{file} by Open3D", by_open3d.positions.numpy(), np.stack([ply[axis] for axis in "xyz"], axis=-1))
            for name, of_plain in zip(names, plain):
                equal(f"{file} by plyfile: {name}", again[name], ply[of_plain])
                if name not in "xyz":
                    equal(f"{file} by Open3D: {name}", by_open3d[name].numpy().reshape(-1), ply[of_plain])


def check_read_back(beamcast, files, folder):
    """`beamcast diff` finds what other programs write of our files the same."""

    def same(first, second):
        run = subprocess.run([beamcast, "diff", first, second], capture_output=True, text=True)
        if run.returncode != 0 or not run.stdout.startswith("the same"):
            sys.exit(f"{first} and {second}: {run.stdout}{run.stderr}")

    pcd = files / "000000.pcd"
    cloud = pypcd4.PointCloud.from_path(pcd)
    for encoding in (pypcd4.Encoding.BINARY, pypcd4.Encoding.BINARY_COMPRESSED):
        cloud.save(folder / "pypcd4.pcd", encoding=encoding)
        same(pcd, folder / "pypcd4.pcd")
    # Open3D has the fields in an order of its own.
    cloud = o3d.t.io.read_point_cloud(str(pcd))
    for name, options in [("binary", {}), ("text", {"write_ascii": True}), ("compressed", {"compressed": True})]:
        o3d.t.io.write_point_cloud(str(folder / f"{name}.pcd"), cloud, **options)
        same(folder / "binary.pcd", folder / f"{name}.pcd")
    with np.load(files / "000000.npz", allow_pickle=False) as arrays:
        for save in (np.savez, np.savez_compressed):
            save(folder / "numpy.npz", **arrays)
            same(files / "000000.exr", folder / "numpy.npz")
        np.savez(folder / "numpy.npz", **{name: np.asfortranarray(array) for name, array in arrays.items()})
        same(files / "000000.exr", folder / "numpy.npz")
    points = np.load(files / "000000.npy", allow_pickle=False)
    np.save(folder / "numpy.npy", points.astype(np.dtype(points.dtype.descr, align=True).newbyteorder(">")))
    same(files / "000000.ply", folder / "numpy.npy")


def check_convert(beamcast, files, folder, exr, names, npy):
    """Other programs find every value of the NPY and of the EXR in what `convert` makes of them."""
    made = {}
    for source, ending in [("npy", "ply"), ("ply", "pcd"), ("npy", "las"), ("las", "laz"), ("exr", "npz")]:
        source, made[ending] = made.get(source, files / f"000000.{source}"), folder / f"converted.{ending}"
        subprocess.run([beamcast, "convert", "-q", "--overwrite", source, made[ending]], check=True)
    check_ply(made["ply"], npy)
    check_npz(made["npz"], exr, names)
    pcd = pypcd4.PointCloud.from_path(made["pcd"]).pc_data
    las, laz = (laspy.read(made[ending]) for ending in ("las", "laz"))
    equal("converted laz: records", laz.points.array, las.points.array)
    for name in npy.dtype.names:
        equal(f"converted pcd: {name}", pcd[name], npy[name])
        if name in "xyz":
            same_steps(f"converted las: {name}", np.asarray(las[name]), npy[name], 1e-4)
        else:
            # LAS's own intensity is an integer.
            equal(f"converted las: {name}", np.asarray(las["reflectivity" if name == "intensity" else name]), npy[name])


def same_steps(what, found, expected, step):
    """Coordinates in steps are those of another file in float32: each is rounded once."""
    global checks
    off = np.abs(np.asarray(found, np.float64) - expected)
    if found.shape != expected.shape or (off > 0.5 * step + 2.0**-24 * np.abs(expected) + 1e-9).any():
        sys.exit(f"{what}: {off.max()} m off, in steps of {step} m")
    checks += off.size


def check_las(path, where, exr, npy, scale, las=None):
    """A LAS or LAZ of one return a pixel. A LAZ has the records of the LAS beside it."""
    points = laspy.read(path)
    header = points.header
    equal(f"{where}: format", (str(header.version), header.point_format.id, header.point_count), ("1.4", 6, len(npy)))
    equal(f"{where}: scales", header.scales, [scale] * 3)
    equal(f"{where}: date, returns", (header.creation_date, *header.number_of_points_by_return), (None, len(npy), *[0] * 14))
    seen = np.isfinite(exr["range"])
    check_points(where, {**{name: np.asarray(points[name]) for name in ("range", "instance", "label", "ring")},
                         "intensity": exr["intensity"][seen]}, exr, seen)
    equal(f"{where}: column", np.asarray(points["column"]), npy["column"])
    equal(f"{where}: time", np.asarray(points["time"]), exr["time"][seen])
    # The frame starts at 0.
    equal(f"{where}: gps_time", np.asarray(points.gps_time).astype(np.float32), exr["time"][seen])
    steps = np.floor(exr["intensity"][seen].astype(np.float64) * 65535 + 0.5)
    equal(f"{where}: intensity", np.asarray(points.intensity), steps)
    equal(f"{where}: classification", np.asarray(points.classification), exr["id.semantic"][seen])
    for name, value in [("return_number", 1), ("number_of_returns", 1), ("scan_angle", 0), ("synthetic", 0)]:
        equal(f"{where}: {name}", np.unique(np.asarray(points[name])), [value])
    equal(f"{where}: source", np.unique(np.asarray(points.point_source_id)), [1 + SENSORS.index(where.split()[0])])
    for axis in "xyz":
        same_steps(f"{where}: {axis}", np.asarray(points[axis]), npy[axis], scale)
    positions = np.stack([points.x, points.y, points.z])
    equal(f"{where}: bounds", (header.mins, header.maxs), (positions.min(axis=1), positions.max(axis=1)))
    about = json.loads(next(vlr for vlr in header.vlrs if vlr.user_id == "beamcast").record_data_bytes())
    with np.load(npy_beside(path, "npz"), allow_pickle=False) as arrays:
        pose = json.loads(arrays["about"].item())["world_from_sensor"]
    equal(f"{where}: place", about["world_from_points"]["position_m"], pose["position_m"])
    if las is not None:
        equal(f"{where}: records", points.points.array, las.points.array)
    return points


def e57_field(e57, name, count):
    """A field that pye57's own methods leave out."""
    values = np.empty(count, "d")
    buffers = libe57.VectorSourceDestBuffer()
    buffers.append(libe57.SourceDestBuffer(e57.image_file, name, values, count, True, True))
    e57.get_header(0).points.reader(buffers).read()
    return values


def check_e57(path, where, exr, npy, has_returns):
    e57 = pye57.E57(str(path))
    equal(f"{where}: scans", e57.scan_count, 1)
    header = e57.get_header(0)
    points = e57.read_scan_raw(0, ignore_unsupported_fields=has_returns)
    seen = np.isfinite(exr["range"])
    for axis in "xyz":
        equal(f"{where}: {axis}", points[f"cartesian{axis.upper()}"], npy[axis].astype(np.float64))
        low, high = (header.cartesianBounds[f"{axis}{end}"].value() for end in ("Minimum", "Maximum"))
        equal(f"{where}: bounds", (low, high), (npy[axis].min(), npy[axis].max()))
    if not has_returns:
        easily = e57.read_scan(0, intensity=True, row_column=True, transform=False)
        for name, values in easily.items():
            equal(f"{where}: {name} by read_scan", values, points[name])
    equal(f"{where}: intensity", points["intensity"], exr["intensity"][seen])
    equal(f"{where}: rows", points["rowIndex"], np.nonzero(seen)[0])
    equal(f"{where}: columns", points["columnIndex"], np.nonzero(seen)[1])
    if has_returns:
        equal(f"{where}: time", e57_field(e57, "timeStamp", len(npy)).astype(np.float32), exr["time"][seen])
        equal(f"{where}: return", np.unique(e57_field(e57, "returnIndex", len(npy))), [0])
        equal(f"{where}: returns", np.unique(e57_field(e57, "returnCount", len(npy))), [1])
    with np.load(npy_beside(path, "npz"), allow_pickle=False) as arrays:
        pose = json.loads(arrays["about"].item())["world_from_sensor"]
    equal(f"{where}: place", header.translation, pose["position_m"])
    if where.startswith("lidar"):
        x, y, z, w = pose["quaternion_xyzw"]
        # pye57 normalises what it reads.
        if np.abs(header.rotation * np.sign(w) - (w, x, y, z)).max() > 1e-15:
            sys.exit(f"{where}: the rotation is not the sensor's")


def check_runs(beamcast, folder):
    """A run of a moving rig of an ideal camera and a LiDAR with several returns, in one file and in one a frame."""
    lidar, camera = JOB.split("[output]")[0].split("[[sensor]]")[1:]
    job = f'scene = "{PROJECT / "scenes" / "room.glb"}"\n[[sensor]]{lidar}{MEASURED}[[sensor]]{camera}'
    job = job.replace("{{", "{").replace("}}", "}").replace("[sensor.pinhole]", "[sensor.pinhole]\nrate_hz = 20.0")
    crs = 'PROJCS["made up", GEOGCS["of it", UNIT["degree", 0.0174532925199433]], UNIT["metre", 1.0]]'
    job += f"""
[trajectory.pose]
position_m = [0.25, 0.5, 0.0]
[trajectory.twist]
linear_m_s = [2.0, 0.0, 0.0]
[sequence]
frames = 3
start_s = 2.0
[output]
dir = "out"
frame = "world"
formats = ["npz", "e57", {{ format = "las", per = "run", crs = '{crs}' }}, {{ format = "laz", per = "frame" }}]
"""
    (folder / "job.toml").write_text(job)
    subprocess.run([beamcast, "scan", "-q", folder / "job.toml", "--overwrite"], check=True)
    run = laspy.read(folder / "out" / "run.las")
    equal("run: crs", run.header.vlrs.get("WktCoordinateSystemVlr")[0].string, crs)
    equal("run: encoding", run.header.global_encoding.wkt, True)
    total = 0
    for number, name in enumerate(SENSORS):
        for frame in range(3):
            own = np.asarray(run.point_source_id) == number + 1
            own &= np.asarray(run["frame"]) == frame
            alone = laspy.read(folder / "out" / name / f"{frame:06}.laz")
            total += len(alone.points)
            equal(f"run: {name} {frame}", int(own.sum()), len(alone.points))
            for dimension in run.point_format.dimension_names:
                if dimension in "XYZ":
                    axis = dimension.lower()
                    found = np.asarray(run[axis])[own] - np.asarray(alone[axis])
                    equal(f"run: {axis}", int((np.abs(found) > 1e-9).sum()), 0)
                elif dimension in alone.point_format.dimension_names:
                    equal(f"run: {dimension}", np.asarray(run[dimension])[own], np.asarray(alone[dimension]))
                elif dimension not in ("frame", "reflectivity"):
                    equal(f"run: {dimension} of no sensor", np.count_nonzero(np.asarray(run[dimension])[own]), 0)
            e57 = pye57.E57(str(folder / "out" / name / f"{frame:06}.e57")).read_scan_raw(0)
            for axis in "xyz":
                off = np.abs(np.asarray(alone[axis]) - e57[f"cartesian{axis.upper()}"])
                equal(f"e57: {axis} in the world", int((off > 0.5e-4 + 2e-9).sum()), 0)
            check_returns(folder / "out" / name / f"{frame:06}.npz", f"{name} {frame}", alone)
    equal("run: points", len(run.points), total)
    if len(np.unique(np.asarray(run.return_number))) < 2:
        sys.exit("no pulse has two returns, and the run tests nothing")


def check_returns(path, where, las):
    """The returns of all pixels, in the order of pixels, each with all that the NPZ has of it."""
    with np.load(path, allow_pickle=False) as arrays:
        numbers = [""] + [f"return{n}/" for n in range(1, 16) if f"return{n}/range" in arrays.files]
        ranges = np.stack([arrays[f"{number}range"].reshape(-1) for number in numbers], axis=1)
        seen = np.isfinite(ranges)
        count = np.broadcast_to(seen.sum(axis=1)[:, None], seen.shape)
        index = np.broadcast_to(np.arange(seen.shape[1]), seen.shape)
        equal(f"{where}: return numbers", np.asarray(las.return_number), index[seen] + 1)
        equal(f"{where}: numbers of returns", np.asarray(las.number_of_returns), count[seen])
        pairs = [("range", "range"), ("label", "id.semantic"), ("instance", "id.instance"), ("time", "time"), ("cause", "cause"),
                 ("snr", "snr"), ("reflectivity", "intensity"), ("classification", "id.semantic")]
        for dimension, channel in pairs:
            if dimension in las.point_format.dimension_names:
                expected = np.stack([arrays[f"{number}{channel}"].reshape(-1) for number in numbers], axis=1)[seen]
                equal(f"{where}: {dimension}", np.asarray(las[dimension]), expected)


def npy_beside(path, ending):
    return path.with_name(f"{path.name.split('.')[0]}.{ending}")


def main():
    beamcast = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        job = folder / "job.toml"
        for number, run in enumerate(RUNS):
            job.write_text(JOB.format(scene=PROJECT / "scenes" / "room.glb") + run + "\n")
            subprocess.run([beamcast, "scan", "-q", job, "--out", folder / str(number)], check=True)
        for sensor in SENSORS:
            first, second, third = (folder / str(number) / sensor for number in range(3))
            exr = read_exr(first / "000000.exr")
            channel = "Z" if sensor == "camera" else "range"
            depth = exr[channel]
            names = [name for name in exr if name != "Y"]
            if not 0 < np.isfinite(depth).sum() < depth.size or len(np.unique(exr["id.semantic"])) < 3:
                sys.exit(f"{sensor}: the frame has no misses or no labels, and tests nothing")
            npy = check_npy(first / "000000.npy", f"{sensor} npy", exr)
            check_ply(first / "000000.ply", npy)
            check_npz(first / "000000.npz", exr, names)
            check_npz(second / "000000.npz", exr, names)
            check_npz(third / "000000.npz", exr, [name for name in names if name in ("range", "Z", "normal.X")])
            check_pcd(first / "000000.pcd", f"{sensor} pcd", exr, npy, organised=False)
            check_pcd(second / "000000.pcd", f"{sensor} organised pcd", exr, npy, organised=True)
            check_read_back(beamcast, first, folder)
            check_convert(beamcast, first, folder, exr, names, npy)
            las = check_las(first / "000000.las", f"{sensor} las", exr, npy, 1e-4)
            check_las(first / "000000.laz", f"{sensor} laz", exr, npy, 1e-4, las)
            check_las(second / "000000.las", f"{sensor} coarse las", exr, npy, 1e-3)
            check_e57(first / "000000.e57", f"{sensor} e57", exr, npy, has_returns=False)
            check_e57(second / "000000.e57", f"{sensor} e57 with returns", exr, npy, has_returns=True)
            for place, scale in [(first, 1000), (second, 5000), (third, 256)]:
                check_depth(place / "000000.depth16.png", channel, depth, scale)
            equal(f"{sensor} png", np.asarray(PIL.Image.open(first / "000000.png")), cv2.imread(first / "000000.png")[..., ::-1])
            check_numbers(first / "000000.labels.png", exr["id.semantic"])
            check_numbers(second / "000000.labels.png", exr["id.semantic"])
            check_numbers(third / "000000.labels.png", exr["id.semantic"], has_palette=True)
            check_numbers(first / "000000.instances.png", exr["id.instance"])
            check_numbers(second / "000000.instances.png", exr["id.instance"], has_palette=True)
        check_waveforms(beamcast, folder)
        check_bags(beamcast, folder)
        check_options(beamcast, folder)
        check_runs(beamcast, folder)
    tools = f"NumPy, PIL, OpenCV {cv2.__version__}, Open3D, plyfile, pypcd4, laspy, pye57, rosbags and mcap-ros2-support"
    print(f"{checks} values are the EXR's, read by {tools}")


main()
