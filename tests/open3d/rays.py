"""Jobs to rays, from the job's text alone: the formulas of beamcast's contract written out again in numpy (f64), and for
cameras Open3D's own pinhole rays."""

import os
import tomllib
from dataclasses import dataclass

import numpy as np
import open3d as o3d

import glb


@dataclass
class Sensor:
    """A sensor of a job, with its rays in the world.

    origin       (3,) f64
    directions   (rows, columns, 3) f64, unit
    depth        (rows, columns): planar depth of a point at range 1; None for a LiDAR
    cast         (rows, columns, 6) f32 rays about `centre`, as Open3D is to cast them; not unit for a camera
    limited      (rows, columns): what the limits apply to, of a point at range 1
    axes         (3, 3) f64: from the frame that normals are given in (a camera's optical one) to the world
    """

    name: str
    origin: np.ndarray
    directions: np.ndarray
    depth: np.ndarray
    cast: np.ndarray
    axes: np.ndarray
    min_m: float
    max_m: float
    limited: np.ndarray


def load_job(path):
    with open(path, "rb") as file:
        return tomllib.load(file)


def scene_path(job_path, job):
    return os.path.join(os.path.dirname(job_path), job["scene"])


def sensors(job_path, job, centre):
    world_from_body = pose(job.get("trajectory", {}).get("pose", {}))
    mounted = []
    for entry in job["sensor"]:
        description = {}
        if "preset" in entry:
            with open(os.path.join(os.path.dirname(job_path), entry["preset"]), "rb") as file:
                description = tomllib.load(file)
        # Tables of the job add to the preset's or override their keys.
        for key, value in entry.items():
            if isinstance(value, dict) and key != "pose":
                description[key] = description.get(key, {}) | value
        world_from_sensor = world_from_body @ pose(entry.get("pose", {}))
        mounted.append(make(entry.get("name", "sensor"), description, world_from_sensor, centre))
    return mounted


def pose(table):
    """target_from_source of a pose table: R = Rz(yaw)·Ry(pitch)·Rx(roll), or a quaternion."""
    matrix = np.eye(4)
    if "quaternion_xyzw" in table:
        matrix[:3, :3] = glb.rotation(table["quaternion_xyzw"])
    else:
        roll, pitch, yaw = np.radians(table.get("rpy_deg", [0.0, 0.0, 0.0]))
        rx = [[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]]
        ry = [[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]]
        rz = [[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]]
        matrix[:3, :3] = np.array(rz) @ np.array(ry) @ np.array(rx)
    matrix[:3, 3] = table.get("position_m", [0.0, 0.0, 0.0])
    return matrix


def make(name, description, world_from_sensor, centre):
    limits = description.get("range", {})
    origin = world_from_sensor[:3, 3]
    if "pinhole" in description:
        axes = world_from_sensor[:3, :3] @ np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # body from optical
        optical, cast = camera(description["pinhole"], axes, origin - centre)
        directions, depth = optical @ axes.T, optical[..., 2]
    else:
        axes, depth = world_from_sensor[:3, :3], None
        directions = rotating(description["rotating"]) @ axes.T
        cast = np.concatenate([np.broadcast_to(origin - centre, directions.shape), directions], -1).astype(np.float32)
    low, high = limits.get("min_m", 0.0), limits.get("max_m", np.inf)
    of = limits.get("of", "depth" if "pinhole" in description else "range")
    limited = depth if of == "depth" else np.ones(directions.shape[:2])
    return Sensor(name, origin, directions, depth, cast, axes, low, high, limited)


def rotating(table):
    """Unit directions (rows, columns, 3): row 0 is the highest beam, columns in firing order."""
    elevations = table["elevations_deg"]
    if isinstance(elevations, dict):
        elevations = np.linspace(elevations["from"], elevations["to"], elevations["count"])
    elevations = np.radians(np.asarray(elevations, np.float64))
    offsets = np.radians(np.asarray(table.get("azimuth_offsets_deg", np.zeros(len(elevations))), np.float64))
    order = np.argsort(-elevations, kind="stable")
    elevations, offsets = elevations[order], offsets[order]
    columns = table["columns"]
    sector = table.get("sector_deg", {"from": 180.0, "to": -180.0})
    start, end = np.radians(sector["from"]), np.radians(sector["to"])
    full_turn = abs(sector["to"] - sector["from"]) == 360.0
    # A full turn has no repeated last column; a smaller sector ends on its last.
    steps = columns if full_turn else columns - 1
    azimuths = start + (end - start) * np.arange(columns) / max(steps, 1)
    a = azimuths[None, :] + offsets[:, None]
    e = np.broadcast_to(elevations[:, None], a.shape)
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], -1)


def camera(table, world_from_optical, position):
    """Unit directions (rows, columns, 3) in the optical frame (f64), and Open3D's own rays about the scene's centre."""
    width, height = table["width_px"], table["height_px"]
    if "hfov_deg" in table:
        fx = width / (2 * np.tan(np.radians(table["hfov_deg"]) / 2))
    else:
        fx = table["fx_px"]
    fy, cx, cy = table.get("fy_px", fx), table.get("cx_px", width / 2), table.get("cy_px", height / 2)
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    d = np.stack([(u + 0.5 - cx) / fx, (v + 0.5 - cy) / fy, np.ones_like(u, np.float64)], -1)
    unit = d / np.linalg.norm(d, axis=-1, keepdims=True)

    optical_from_centre = np.eye(4)
    optical_from_centre[:3, :3] = world_from_optical.T
    optical_from_centre[:3, 3] = -world_from_optical.T @ position
    intrinsics = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], np.float64)
    cast = o3d.t.geometry.RaycastingScene.create_rays_pinhole(
        o3d.core.Tensor(intrinsics), o3d.core.Tensor(optical_from_centre), width, height
    ).numpy()
    own = cast[..., 3:].astype(np.float64)
    own /= np.linalg.norm(own, axis=-1, keepdims=True)
    if np.abs(own - unit @ world_from_optical.T).max() > 4e-7 or np.abs(cast[..., :3] - position).max() > 1e-5:
        raise ValueError("Open3D's pinhole rays are not those of the formula")
    return unit, cast
