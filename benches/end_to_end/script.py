"""What a user would write with Open3D, numpy and OpenEXR: a job's frames as EXR and PLY, with the channels and fields that
beamcast writes of them. `bench.py` runs it; its last line of output tells its stages in seconds as JSON.

    python script.py JOB.toml FRAMES FORMATS THREADS OUT      # FORMATS is a list such as exr,ply
"""

import json
import sys
import time
from pathlib import Path

BEGUN = time.perf_counter()

import numpy as np  # noqa: E402
import OpenEXR  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "open3d"))
import glb  # noqa: E402
import open3d as o3d  # noqa: E402
import rays  # noqa: E402

POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<i4"), ("column", "<i4"),
                  ("t", "<i4"), ("instance", "<i4"), ("label", "<i4"), ("range", "<f4")])
TYPES = {"<f4": "float", "<i4": "int"}


def main():
    path, frames, formats, threads, out = sys.argv[1], int(sys.argv[2]), sys.argv[3].split(","), int(sys.argv[4]), Path(sys.argv[5])
    stages = {"import": time.perf_counter() - BEGUN}

    def timed(stage, work, *arguments):
        begun = time.perf_counter()
        result = work(*arguments)
        stages[stage] = stages.get(stage, 0.0) + time.perf_counter() - begun
        return result

    job = rays.load_job(path)
    scene = timed("load", glb.load, rays.scene_path(path, job))
    caster = timed("build", build, scene, threads)
    for sensor in rays.sensors(path, job, scene.centre):
        (out / sensor.name).mkdir(parents=True)
        tables = timed("rays", Tables, scene, sensor)
        for frame in range(frames):
            hits = timed("cast", caster.cast_rays, tables.rays, threads)
            seen = timed("channels", tables.frame, hits)
            if "exr" in formats:
                timed("exr", write_exr, out / sensor.name / f"{frame:06}.exr", seen)
            if "ply" in formats:
                timed("ply", write_ply, out / sensor.name / f"{frame:06}.ply", tables, seen)
    print(json.dumps(stages))


def build(scene, threads):
    caster = o3d.t.geometry.RaycastingScene(threads)
    vertices = o3d.core.Tensor(scene.vertices.astype(np.float32))
    caster.add_triangles(vertices, o3d.core.Tensor(scene.triangles.astype(np.uint32)))
    # The structure is built by the first cast.
    caster.cast_rays(o3d.core.Tensor(np.zeros((1, 6), np.float32)))
    return caster


class Tables:
    """What does not change from frame to frame."""

    def __init__(self, scene, sensor):
        self.rays = o3d.core.Tensor(np.ascontiguousarray(sensor.cast))
        self.directions = (sensor.directions @ sensor.axes).astype(np.float32)
        self.depth = None if sensor.depth is None else sensor.depth.astype(np.float32)
        self.limits = sensor.min_m, sensor.max_m
        self.lengths = np.linalg.norm(sensor.cast[..., 3:], axis=-1).astype(np.float32)
        self.axes = sensor.axes.astype(np.float32)
        counts = np.diff(scene.first)
        self.instances = np.repeat(np.arange(1, len(counts) + 1, dtype=np.uint32), counts)
        self.labels = np.repeat(scene.labels.astype(np.uint32), counts)
        self.reflectivity = scene.reflectivity.astype(np.float32)
        rows, columns = self.lengths.shape
        self.time = np.broadcast_to(np.arange(columns, dtype=np.float32) * np.float32(0.1 / columns), (rows, columns))
        self.ring, self.column = np.indices((rows, columns), dtype=np.int32)

    def frame(self, hits):
        ranges = hits["t_hit"].numpy() * self.lengths
        is_hit = np.isfinite(ranges) & (ranges >= self.limits[0]) & (ranges <= self.limits[1])
        triangle = np.where(is_hit, hits["primitive_ids"].numpy(), 0)
        normals = np.where(is_hit[..., None], hits["primitive_normals"].numpy() @ self.axes, 0).astype(np.float32)
        cosine = np.abs(np.einsum("ijk,ijk->ij", normals, self.directions))
        shown = np.where(is_hit, ranges, np.inf).astype(np.float32)
        channels = {
            "range": shown,
            "cause": np.where(is_hit, 1, 2).astype(np.uint32),
            "intensity": np.where(is_hit, self.reflectivity[triangle] * cosine, 0).astype(np.float32),
            "id.instance": np.where(is_hit, self.instances[triangle], 0).astype(np.uint32),
            "id.semantic": np.where(is_hit, self.labels[triangle], 0).astype(np.uint32),
            "id.triangle": triangle.astype(np.uint32),
            "time": np.where(is_hit, self.time, 0).astype(np.float32),
        }
        channels |= {f"normal.{axis}": np.ascontiguousarray(normals[..., i]) for i, axis in enumerate("XYZ")}
        if self.depth is not None:
            channels["Z"] = np.where(is_hit, ranges * self.depth, np.inf).astype(np.float32)
        channels["Y"] = channels.get("Z", shown)
        return channels


def write_exr(path, channels):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, dict(channels)) as file:
        file.write(str(path))


def write_ply(path, tables, channels):
    is_hit = np.isfinite(channels["range"])
    points = np.empty(int(is_hit.sum()), POINT)
    ranges = channels["range"][is_hit]
    for i, axis in enumerate("xyz"):
        points[axis] = tables.directions[..., i][is_hit] * ranges
    points["range"], points["t"] = ranges, (tables.time[is_hit] * np.float32(1e9)).astype(np.int32)
    points["ring"], points["column"] = tables.ring[is_hit], tables.column[is_hit]
    for field, channel in [("intensity", "intensity"), ("instance", "id.instance"), ("label", "id.semantic")]:
        points[field] = channels[channel][is_hit]
    with open(path, "wb") as file:
        fields = "".join(f"property {TYPES[POINT[name].str]} {name}\n" for name in POINT.names)
        file.write(f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{fields}end_header\n".encode())
        points.tofile(file)


main()
