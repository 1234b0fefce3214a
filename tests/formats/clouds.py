"""Clouds that programs for point clouds read: NPY, PLY and PCD."""

import json
import sys

import numpy as np
import open3d as o3d
import plyfile
import pypcd4

from common import equal, npy_beside


# Fields that points of some sensors and jobs have, and the EXR's channels of the same values.
MORE = [("cause", "cause"), ("snr", "snr"), ("echo_width", "echo_width"), ("track", "id.track")]
MORE += [(f"{kind}_{axis.lower()}", f"{kind}.{axis}") for kind in ("velocity", "flow") for axis in "XYZ"]


def check_points(where, points, exr, seen):
    """The fields that clouds share. The EXR's channels are rows × columns × returns, of which `seen` tells which are there."""
    equal(f"{where}: range", points["range"], exr["range"][seen])
    equal(f"{where}: intensity", points["intensity"], exr["intensity"][seen])
    equal(f"{where}: instance", points["instance"], exr["id.instance"][seen])
    equal(f"{where}: label", points["label"], exr["id.semantic"][seen])
    rows = seen.shape[0]
    ring = np.broadcast_to(np.arange(rows)[:, None, None], seen.shape)
    # The LiDAR's maker counts rings from the lowest beam.
    ring = rows - 1 - ring if where.startswith("lidar") else ring
    equal(f"{where}: ring", points["ring"], ring[seen])
    names = set(points if isinstance(points, dict) else points.dtype.names)
    for name, channel in MORE:
        if name in names:
            equal(f"{where}: {name}", points[name], exr[channel][seen])
    if "return" in names:
        equal(f"{where}: return", points["return"], np.nonzero(seen)[2])


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
    rows, columns = seen.shape[:2]
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
    for name in set(points) - set("xyz"):
        equal(f"{where} by Open3D: {name}", by_open3d[name].numpy().reshape(-1)[is_there], points[name])
    with np.load(npy_beside(path, "npz"), allow_pickle=False) as arrays:
        pose = json.loads(arrays["about"].item())["world_from_sensor"]
    equal(f"{where}: viewpoint", meta.viewpoint[:3], pose["position_m"])
    if where.startswith("lidar"):
        x, y, z, w = pose["quaternion_xyzw"]
        equal(f"{where}: viewpoint", meta.viewpoint[3:], (w, x, y, z))
