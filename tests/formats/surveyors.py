"""Clouds for surveyors: LAS, LAZ and E57. Coordinates are those of the NPY, rounded to the formats' own steps."""

import json
import sys

import laspy
import numpy as np
import pye57
from pye57 import libe57

from clouds import check_points
from common import JOB, MEASURED, PROJECT, SENSORS, equal, near, npy_beside, scan


def same_steps(what, found, expected, step):
    """Coordinates in steps are those of another file in float32: each is rounded once."""
    near(what, found, expected, 0.5 * step + 2.0**-24 * np.abs(expected) + 1e-9)


def check_las(path, where, exr, npy, scale, las=None, start_s=0.0, top=1.0):
    """A LAS or LAZ of a frame that starts at `start_s`, whose intensities are at most `top`. A LAZ has the records of the LAS beside
    it."""
    points = laspy.read(path)
    header = points.header
    equal(f"{where}: format", (str(header.version), header.point_format.id, header.point_count), ("1.4", 6, len(npy)))
    equal(f"{where}: scales", header.scales, [scale] * 3)
    seen = np.isfinite(exr["range"])
    number, count = np.nonzero(seen)[2], np.broadcast_to(seen.sum(axis=2, keepdims=True), seen.shape)[seen]
    equal(f"{where}: date", header.creation_date, None)
    equal(f"{where}: returns", header.number_of_points_by_return, np.bincount(number, minlength=15))
    dimensions = {name: np.asarray(points[name]) for name in points.point_format.extra_dimension_names}
    check_points(where, {**dimensions, "intensity": exr["intensity"][seen]}, exr, seen)
    equal(f"{where}: column", np.asarray(points["column"]), npy["column"])
    equal(f"{where}: time", np.asarray(points["time"]), exr["time"][seen])
    # The EXR's time is rounded to 32 bits, and the sum to 64.
    since = exr["time"][seen].astype(np.float64)
    near(f"{where}: gps_time", points.gps_time, start_s + since, 2.0**-24 * since + 2.0**-52 * start_s)
    steps = np.floor(exr["intensity"][seen].astype(np.float64) * (65535 / top) + 0.5)
    equal(f"{where}: intensity", np.asarray(points.intensity), steps)
    equal(f"{where}: classification", np.asarray(points.classification), exr["id.semantic"][seen])
    for name, value in [("return_number", number + 1), ("number_of_returns", count), ("scan_angle", 0 * count), ("synthetic", 0 * count)]:
        equal(f"{where}: {name}", np.asarray(points[name]), value)
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
        equal(f"{where}: return", e57_field(e57, "returnIndex", len(npy)), np.nonzero(seen)[2])
        count = np.broadcast_to(seen.sum(axis=2, keepdims=True), seen.shape)
        equal(f"{where}: returns", e57_field(e57, "returnCount", len(npy)), count[seen])
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
    out = scan(beamcast, folder, job, "run")
    run = laspy.read(out / "run.las")
    equal("run: crs", run.header.vlrs.get("WktCoordinateSystemVlr")[0].string, crs)
    equal("run: encoding", run.header.global_encoding.wkt, True)
    total = 0
    for number, name in enumerate(SENSORS):
        for frame in range(3):
            own = np.asarray(run.point_source_id) == number + 1
            own &= np.asarray(run["frame"]) == frame
            alone = laspy.read(out / name / f"{frame:06}.laz")
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
            e57 = pye57.E57(str(out / name / f"{frame:06}.e57")).read_scan_raw(0)
            for axis in "xyz":
                off = np.abs(np.asarray(alone[axis]) - e57[f"cartesian{axis.upper()}"])
                equal(f"e57: {axis} in the world", int((off > 0.5e-4 + 2e-9).sum()), 0)
            check_returns(out / name / f"{frame:06}.npz", f"{name} {frame}", alone)
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
