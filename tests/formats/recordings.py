"""What others write is read: recordings by the writers of mcap and rosbags, with each compression and without chunks, in layouts that no
driver of ours has, and E57 by pye57. `beamcast convert` makes NPY and NPZ of them, and `beamcast info` tells of their topics."""

import json
import subprocess

import mcap.writer
import numpy as np
import pye57
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from common import equal, near

STORE = get_typestore(Stores.ROS2_HUMBLE)
TYPES = STORE.types
CLOUD, IMAGE = "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/Image"
DATATYPES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
ROWS, COLUMNS = 3, 5


def header(number):
    stamp = TYPES["builtin_interfaces/msg/Time"](sec=1_700_000_000 + number, nanosec=5 * number)
    return TYPES["std_msgs/msg/Header"](stamp=stamp, frame_id="laser")


def cloud(rng, number, order):
    """An organised cloud whose fields are out of order, with gaps between fields, points and rows. Three bytes are one field."""
    dtype = np.dtype(
        {
            "names": ["y", "x", "ring", "z", "normal", "stamp"],
            "formats": [order + kind for kind in ("f8", "f4", "u2", "f4")] + [("i1", (3,)), order + "u4"],
            "offsets": [0, 8, 12, 16, 20, 24],
            "itemsize": 31,
        }
    )
    points = np.zeros((ROWS, COLUMNS), dtype)
    for name in dtype.names:
        points[name] = rng.integers(0, 100, points[name].shape) / (8.0 if name in "xyz" else 1.0)
    points["x"][1, 2] = np.nan
    step, gap = dtype.itemsize, 7
    data = b"".join(points[row].tobytes() + bytes([0xEE] * gap) for row in range(ROWS))
    fields = []
    for name in dtype.names:
        kind, offset = dtype.fields[name]
        count = int(np.prod(kind.shape, initial=1))
        code = DATATYPES[kind.base.str[1:]]
        fields.append(TYPES["sensor_msgs/msg/PointField"](name=name, offset=offset, datatype=code, count=count))
    message = TYPES[CLOUD](
        header=header(number),
        height=ROWS,
        width=COLUMNS,
        fields=fields,
        is_bigendian=order == ">",
        point_step=step,
        row_step=COLUMNS * step + gap,
        data=np.frombuffer(data, np.uint8),
        is_dense=False,
    )
    return points.reshape(-1), message


def image(rng, number):
    """Millimetres with nothing in one pixel, and four bytes behind each row."""
    pixels = rng.integers(1, 60_000, (ROWS, COLUMNS)).astype(">u2")
    pixels[0, 1] = 0
    data = np.concatenate([pixels.view(np.uint8).reshape(ROWS, -1), np.full((ROWS, 4), 9, np.uint8)], axis=1)
    message = TYPES[IMAGE](
        header=header(number),
        height=ROWS,
        width=COLUMNS,
        encoding="16UC1",
        is_bigendian=1,
        step=data.shape[1],
        data=data.reshape(-1),
    )
    return pixels.astype(np.float64) / 1000.0, message


def convert(beamcast, source, target, *more):
    subprocess.run([beamcast, "convert", "-q", "--overwrite", source, target, *more], check=True)
    return np.load(target)


def check_cloud(what, npy, points):
    equal(f"{what}: fields", list(npy.dtype.names), ["y", "x", "ring", "z", "normal[0]", "normal[1]", "normal[2]", "stamp"])
    for name in npy.dtype.names:
        field, _, index = name.partition("[")
        expected = points[field][:, int(index[0])] if index else points[field]
        equal(f"{what}: {name}", npy[name], expected.astype(expected.dtype.newbyteorder("=")))


def check_mcap(beamcast, folder, rng):
    """Two topics, each with three messages, in every way that the writer has."""
    kinds = mcap.writer.CompressionType
    for name, more in {
        "lz4": {"compression": kinds.LZ4},
        "zstd": {"compression": kinds.ZSTD, "chunk_size": 600},
        "none": {"compression": kinds.NONE},
        "without-chunks": {"use_chunking": False},
        "without-index": {"use_chunking": False, "index_types": mcap.writer.IndexType.NONE, "use_summary_offsets": False},
    }.items():
        path = folder / f"{name}.mcap"
        clouds, images = [], []
        with path.open("wb") as file:
            writer = mcap.writer.Writer(file, **more)
            writer.start("ros2")
            channels = {}
            for topic, kind in [("/scan", CLOUD), ("/camera/depth", IMAGE)]:
                definition, _ = STORE.generate_msgdef(kind, ros_version=2)
                schema = writer.register_schema(kind, "ros2msg", definition.encode())
                channels[kind] = writer.register_channel(topic, "cdr", schema)
            for number in range(3):
                order = "<>"[number % 2]
                points, message = cloud(rng, number, order)
                clouds.append(points)
                add(writer, channels[CLOUD], number, STORE.serialize_cdr(message, CLOUD, little_endian=number != 2))
                depth, message = image(rng, number)
                images.append(depth)
                add(writer, channels[IMAGE], number, STORE.serialize_cdr(message, IMAGE, little_endian=number != 1))
            writer.finish()
        for number in range(3):
            out = folder / f"{name}-{number}.npy"
            npy = convert(beamcast, path, out, "--topic", "/scan", "--frames", str(number))
            check_cloud(f"{name}: cloud {number}", npy, clouds[number])
            out = folder / f"{name}-{number}.npz"
            npz = convert(beamcast, path, out, "--topic", "/camera/depth", "--frames", str(number))
            expected = np.where(images[number] == 0.0, np.inf, images[number]).astype(np.float32)
            equal(f"{name}: depth {number}", npz["Z"], expected)
        told = subprocess.run([beamcast, "info", path, "--json"], check=True, capture_output=True).stdout
        depth, scan = json.loads(told)["bag"]["topics"]
        equal(f"{name}: sizes", [[of["frames"]["rows"], of["frames"]["columns"]] for of in (depth, scan)], [[ROWS, COLUMNS]] * 2)
        equal(f"{name}: stamps", scan["frames"]["stamps_s"], [1_700_000_000.0, 1_700_000_002.00000001])


def add(writer, channel, number, data):
    writer.add_message(channel, log_time=10 * number, data=bytes(data), publish_time=number)


def check_rosbag(beamcast, folder, rng):
    """A folder of rosbag2 as rosbags writes it, all of whose messages become files of a folder."""
    path = folder / "recorded"
    clouds = []
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/lidar/points", CLOUD, typestore=STORE)
        for number in range(4):
            points, message = cloud(rng, number, "<")
            clouds.append(points)
            writer.write(connection, 10 * number, STORE.serialize_cdr(message, CLOUD))
    out = folder / "recorded-npy"
    subprocess.run([beamcast, "convert", "-q", path, out, "--format", "npy"], check=True)
    for number, points in enumerate(clouds):
        check_cloud(f"rosbags: {number}", np.load(out / "lidar" / f"{number:06}.npy"), points)
    subprocess.run([beamcast, "verify", "-q", out], check=True)


def check_e57(beamcast, folder, rng):
    """One scan and two scans, as pye57 writes them and reads them back."""
    half = np.sqrt(0.5)
    poses = [(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)), (np.array([half, 0.0, 0.0, half]), np.array([10.0, -2.5, 0.25]))]
    for scans in (1, 2):
        path = folder / f"{scans}.e57"
        file = pye57.E57(str(path), mode="w")
        for rotation, translation in poses[2 - scans :]:
            count = 70_000
            points = {f"cartesian{axis}": rng.normal(0.0, 20.0, count) for axis in "XYZ"}
            points["intensity"] = rng.random(count)
            points |= {f"color{colour}": rng.integers(0, 256, count).astype(np.uint8) for colour in ("Red", "Green", "Blue")}
            points["rowIndex"], points["columnIndex"] = np.arange(count) % 700, np.arange(count) // 700
            file.write_scan_raw(points, rotation=rotation, translation=translation)
        file.close()
        npy = convert(beamcast, path, folder / f"e57-{scans}.npy")
        file = pye57.E57(str(path))
        raw = [file.read_scan_raw(index) for index in range(scans)]
        names = {"cartesianX": "x", "cartesianY": "y", "cartesianZ": "z", "colorRed": "red", "colorGreen": "green", "colorBlue": "blue"}
        for field in raw[0]:
            name, expected = names.get(field, field), np.concatenate([of_scan[field] for of_scan in raw])
            if not (scans == 2 and name in "xyz"):
                equal(f"e57 of {scans}: {name}", npy[name].astype(expected.dtype), expected)
        if scans == 2:
            # Coordinates below 128 m, and products and sums of a few such: some units in the last place, of 1.4e-14 m each.
            placed = [file.read_scan(index, ignore_missing_fields=True) for index in range(scans)]
            for axis in "XYZ":
                expected = np.concatenate([of_scan[f"cartesian{axis}"] for of_scan in placed])
                near(f"e57 of {scans}: {axis}", npy[axis.lower()], expected, 1e-12)
            equal("e57: scans", npy["scan"], np.repeat([0, 1], 70_000))


def check_recordings(beamcast, folder):
    rng = np.random.default_rng(7)
    check_mcap(beamcast, folder, rng)
    check_rosbag(beamcast, folder, rng)
    check_e57(beamcast, folder, rng)
