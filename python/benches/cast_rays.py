#!/usr/bin/env python3
"""`Scene.cast_rays` beside Open3D's `RaycastingScene.cast_rays`, of a million rays, from an array to arrays.

    PYTHON -m pip install open3d ./python     # Debian: apt-get install libusb-1.0-0
    PYTHON python/benches/cast_rays.py [--scenes room,street] [--rounds 7] [--json FILE]

Both get the same float32 array (…, 6) and make all their arrays anew. They are cast in turn (A B A B …), and the first round does not
count. Times on one thread are CPU times, on two wall times; ratios are medians over the pairs of a round. The hits of both are
compared.
"""

import argparse
import json
import os
import platform
import statistics
import sys
import time
from pathlib import Path

import numpy as np
import open3d as o3d

import beamcast

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benches" / "open3d"))
import scenes

KINDS = ["camera", "LiDAR", "incoherent"]


def rays_of(kind, at, ours):
    """A million rays: a camera's image and a LiDAR's as (rows, columns, 6), and others in no order (n, 6)."""
    if kind == "camera":
        v, u = np.meshgrid((np.arange(1000) + 0.5) / 500 - 1, (np.arange(1000) + 0.5) / 500 - 1, indexing="ij")
        directions = np.stack([np.ones_like(u), -u, -v], -1)
    elif kind == "LiDAR":
        directions = scenes.spherical(np.linspace(22.5, -22.5, 128)[:, None], 180 - np.arange(8192)[None] * 360 / 8192)
    else:
        # From what a LiDAR sees, away from the surface, in no order.
        seen = rays_of("LiDAR", at, ours)
        found = ours.cast_rays(seen)
        hit = np.isfinite(found["t_hit"])
        rng = np.random.default_rng(6)
        t = found["t_hit"][hit][:, None]
        towards = -seen[hit][:, 3:]
        points = seen[hit][:, :3] - towards * t + towards * (1e-3 + 1e-3 * t)
        directions = rng.standard_normal(points.shape)
        directions *= np.where((directions * towards).sum(1) < 0, -1, 1)[:, None]
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        order = rng.permutation(len(points))
        return np.ascontiguousarray(np.concatenate([points, directions], -1)[order], np.float32)
    origins = np.broadcast_to(at, directions.shape)
    return np.concatenate([origins, directions], -1).astype(np.float32)


def timed(cast, threads):
    """The seconds of a cast: of the processor on one thread, which other work on the machine disturbs less, else of the clock."""
    clock = time.process_time if threads == 1 else time.perf_counter
    start = clock()
    cast()
    return clock() - start


def disagreement(ours, theirs):
    """The rays that only one sees hit, and those that both hit at other depths."""
    a, b = ours["t_hit"], theirs["t_hit"].numpy()
    both = np.isfinite(a) & np.isfinite(b)
    apart = np.abs(a[both] - b[both]) > 1e-3 * (0.1 + a[both])
    return int((np.isfinite(a) != np.isfinite(b)).sum()), int(apart.sum())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default="room,street")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    with open("/proc/cpuinfo") as file:
        name = next((line.split(":")[1].strip() for line in file if line.startswith("model name")), platform.machine())
    print(f"{time.strftime('%Y-%m-%d')}, {os.cpu_count()} cores of {name}, Open3D {o3d.__version__}, {options.rounds} rounds\n")
    print("| scene | rays | threads | beamcast, ms | Open3D, ms | times as fast (least – most) |\n|---|---|---|---|---|---|")
    results = []
    for scene in options.scenes.split(","):
        vertices, triangles = scenes.SCENES[scene]()
        at = scenes.eye(scene, vertices)
        ours, theirs = beamcast.Scene(vertices, triangles), o3d.t.geometry.RaycastingScene()
        theirs.add_triangles(o3d.core.Tensor(vertices), o3d.core.Tensor(triangles))
        for kind in KINDS:
            rays = rays_of(kind, at, ours)
            one_only, apart = disagreement(ours.cast_rays(rays), theirs.cast_rays(rays))
            if one_only + apart > 2e-3 * rays.size / 6:
                raise SystemExit(f"the tracers disagree: {one_only} rays hit for one only, {apart} at other depths")
            for threads in (1, 2):
                pairs = []
                for _ in range(options.rounds + 1):
                    pairs.append([timed(lambda scene=scene: scene.cast_rays(rays, nthreads=threads), threads) for scene in (ours, theirs)])
                pairs = pairs[1:]
                ratios = [b / a for a, b in pairs]
                row = {
                    "scene": scene, "rays": kind, "count": rays.size // 6, "threads": threads,
                    "beamcast_s": statistics.median(a for a, _ in pairs), "open3d_s": statistics.median(b for _, b in pairs),
                    "ratio": statistics.median(ratios), "least": min(ratios), "most": max(ratios),
                    "one_only": one_only, "apart": apart,
                }
                results.append(row)
                print(
                    f"| {scene} | {kind} | {threads} | {1e3 * row['beamcast_s']:.0f} | {1e3 * row['open3d_s']:.0f} "
                    f"| {row['ratio']:.1f} ({row['least']:.1f} – {row['most']:.1f}) |", flush=True,
                )
    if options.json:
        options.json.write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
