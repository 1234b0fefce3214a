"""Bags of a drive round a circle, read by rosbags and by mcap-ros2-support: every field of every point in every layout, images,
poses, and what the inertial sensor has to measure there."""

import json
import sys

import cv2
import mcap.reader
import mcap_ros2.decoder
import numpy as np
import rosbags.highlevel

from common import PROJECT, equal, near, read_exr, scan

JOB = """
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
        half_step = 0.5 * np.spacing(points["distance"]).astype(np.float64)
        near(f"{where}: distance", points["distance"], np.sqrt(x * x + y * y + z * z), half_step * (1 + 2.0**-20))
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
        info = check_images(where, bag, frame, exr, start_ns + frame * 50_000_000)
        equal(f"{where}: lens", info["distortion_model"], "plumb_bob")
        equal(f"{where}: D", info["d"], [-0.1, 0.01, 0.001, 0.0, 0.0])
        # ROS counts pixels from the centre of the top left one.
        equal(f"{where}: K", info["k"], [40.0, 0.0, 22.5, 0.0, 41.0, 16.5, 0.0, 0.0, 1.0])
        # OpenCV, with that K and D, projects what the pixels show back to them.
        check_projection(where, info, npy_of_camera=np.load(folder / "camera" / f"{frame:06}.npy"), seen=np.isfinite(exr["Z"]))
    check_circle(where, bag, poses, start_ns)
    check_boxes(where, bag, folder, start_ns, {7: "floor", 255: "crate", 12: "pillar"})


def check_images(where, bag, frame, exr, stamp):
    """A camera's depth and labels. Returns the message about its lens."""
    size = exr["Z"].shape
    depth, labels, info = (bag[f"/camera/{kind}"][frame][1] for kind in ("depth", "labels", "camera_info"))
    for image in (depth, labels, info):
        equal(f"{where}: image", (stamp_ns(image["header"]), image["height"], image["width"]), (stamp, *size))
        equal(f"{where}: image", image["header"]["frame_id"], "camera_optical")
    z = np.where(np.isfinite(exr["Z"]), exr["Z"], np.nan)
    if depth["encoding"] == "32FC1":
        equal(f"{where}: depth", np.frombuffer(depth["data"], "<f4").reshape(size), z)
    else:
        whole = np.nan_to_num(np.floor(z.astype(np.float64) * 1000 + 0.5)).astype(np.uint16)
        equal(f"{where}: depth", np.frombuffer(depth["data"], "<u2").reshape(size), whole)
    equal(f"{where}: labels", np.frombuffer(labels["data"], "<u2").reshape(size), exr["id.semantic"])
    return info


def check_projection(where, info, npy_of_camera, seen):
    points = np.stack([npy_of_camera[axis] for axis in "xyz"], axis=-1).astype(np.float64)
    k, d = np.reshape(info["k"], (3, 3)), np.array(info["d"])
    pixels = cv2.projectPoints(points, np.zeros(3), np.zeros(3), k, d)[0].reshape(-1, 2)
    rows, columns = np.nonzero(seen)
    # Coordinates of 6 m in 32 bits, seen from 1 m, at 41 px.
    near(f"{where}: projection", pixels, np.stack([columns, rows], axis=-1), 41 * 6 * 2.0**-23 * 4)


def check_odometry(where, bag, poses, zero_ns, tolerance):
    """The body's poses at the starts of frames are those of the table; the job's time 0 has the stamp `zero_ns`. Returns the messages by
    their stamps."""
    by_stamp = {stamp_ns(message["header"]): message for _, message in bag["/odom"]}
    for row in poses:
        message = by_stamp[zero_ns + round(row["t_s"] * 1e9)]
        equal(f"{where}: frames", (message["header"]["frame_id"], message["child_frame_id"]), ("world", "base_link"))
        pose = message["pose"]["pose"]
        near(f"{where}: position", vector(pose["position"]), [row[f"body_{axis}_m"] for axis in "xyz"], tolerance)
        near(f"{where}: attitude", vector(pose["orientation"]), [row[f"body_q{axis}"] for axis in "xyzw"], tolerance)
    transforms = [message["transforms"][0] for _, message in bag["/tf"]]
    equal(f"{where}: /tf", [stamp_ns(t["header"]) for t in transforms], sorted(by_stamp))
    for transform in transforms:
        pose = by_stamp[stamp_ns(transform["header"])]["pose"]["pose"]
        equal(f"{where}: /tf", vector(transform["transform"]["translation"]), vector(pose["position"]))
        equal(f"{where}: /tf", vector(transform["transform"]["rotation"]), vector(pose["orientation"]))
    return by_stamp


def check_circle(where, bag, poses, start_ns):
    # The end of a frame and the start of the next one may differ in the last bits of their time.
    by_stamp = check_odometry(where, bag, poses, start_ns, 1e-15)
    speed, turn = 1.5, np.pi / 3
    for row in poses:
        twist = by_stamp[start_ns + round(row["t_s"] * 1e9)]["twist"]["twist"]
        near(f"{where}: velocity", vector(twist["linear"]), [speed, 0, 0], 1e-15)
        near(f"{where}: turn", vector(twist["angular"]), [0, 0, turn], 1e-15)
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


def check_boxes(where, bag, folder, zero_ns, names):
    """The boxes of boxes.jsonl, each at its own time, in messages with the stamp of the points or the image of their frame."""
    rows = [json.loads(line) for line in (folder / "boxes.jsonl").read_text().splitlines()]
    for sensor, kind in (("lidar", "points"), ("camera", "depth")):
        for frame, (_, message) in enumerate(bag[f"/{sensor}/boxes"]):
            own = [row for row in rows if row["sensor"] == sensor and row["frame"] == frame]
            stamp = stamp_ns(bag[f"/{sensor}/{kind}"][frame][1]["header"])
            equal(f"{where}: boxes", (stamp_ns(message["header"]), len(message["detections"])), (stamp, len(own)))
            for row, found in zip(own, message["detections"]):
                equal(f"{where}: box", stamp_ns(found["header"]), zero_ns + round(row["t_s"] * 1e9))
                center, hypothesis = found["bbox"]["center"], found["results"][0]
                equal(f"{where}: box", vector(center["position"]), row["in_world"]["centre_m"])
                equal(f"{where}: box", vector(center["orientation"]), row["in_world"]["quaternion_xyzw"])
                equal(f"{where}: box", vector(found["bbox"]["size"]), [row[f"{side}_m"] for side in ("length", "width", "height")])
                equal(f"{where}: box", (found["id"], hypothesis["hypothesis"]["class_id"]), (str(row["track"]), names.get(row["label"], str(row["label"]))))
                if hypothesis["pose"]["pose"] != center or hypothesis["hypothesis"]["score"] != 1.0:
                    sys.exit(f"{where}: the hypothesis is another box")


def check_bags(beamcast, folder):
    dual = '[sensor.receiver]\nreturns = "dual"\nintensity = "velodyne"\n[sensor.footprint]\ndivergence_mrad = [9.0, 9.0]\nkind = "1/e2"\n'
    for layout in FIELDS:
        for is_organised in {False, layout in ("velodyne", "ouster")}:
            is_dual = layout in ("livox", "livox_custom", "autoware")
            options = f'layout = "{layout}"' + (", organised = true" if is_organised else "")
            options += ', time_unit = "ns"' if layout == "fast_lio" else ""
            options += ', depth = "16UC1", compression = "zstd"' if layout == "ouster" else ""
            receiver = dual if is_dual else ""
            job = JOB.format(scene=PROJECT / "scenes" / "room.glb", stamp=STAMP_S, options=options, receiver=receiver)
            out = scan(beamcast, folder, job, f"bag-{layout}-{is_organised}")
            check_bag(read_bag(out / "bag"), out, layout, is_organised, is_dual)
