"""Reads the program's files back with the tools that their users have, and compares every value with the EXR's.

    python tests/formats/check.py BEAMCAST    # with tests/open3d/requirements.txt

One frame of a LiDAR and one of a camera are scanned in all formats, with misses of each kind, ids, labels and times. Equal means
equal bits, apart from coordinates, which the EXR does not have: those are equal between PCD and NPY, and as far from the sensor
as the EXR's range says. Those of LAS and E57 are the NPY's, rounded to the formats' own steps. Waveforms are added up with NumPy, and have their peaks where the frame has its ranges.
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
import plyfile
import pye57
import pypcd4
from pye57 import libe57

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
        check_runs(beamcast, folder)
    print(f"{checks} values of {len(SENSORS)} frames are the EXR's, read by NumPy, PIL, OpenCV {cv2.__version__}, Open3D, plyfile, pypcd4, laspy and pye57")


main()
