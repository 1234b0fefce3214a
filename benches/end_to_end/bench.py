#!/usr/bin/env python3
"""Frames on the disk: beamcast beside a script of Open3D, numpy and OpenEXR, from the start of the process to its end.

    python3 -m venv venv && venv/bin/pip install -r tests/open3d/requirements.txt   # Debian: apt-get install libusb-1.0-0
    cargo build --release
    venv/bin/python benches/end_to_end/bench.py target/release/beamcast [--before OLDER] [--rounds 5] [--threads 2]

Both write the same frames of the shipped street with the same channels and fields: 50 of the LiDAR (128 × 2048) and 20 of a
camera (1920 × 1080) in its place, as EXR and PLY and as PLY alone, and one frame from a cold start. They take turns, the first
round is not counted, and the ratios are medians over the rounds. With `--before` an older build of beamcast takes turns with
both. beamcast flushes its files to the disk and hashes them; the script does neither. `frames` tells the frames alone,
without the import of modules, the scene and the build.
"""

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CAMERA = """
[pinhole]
width_px = 1920
height_px = 1080
hfov_deg = 80.0
rate_hz = 10.0
[range]
min_m = 0.5
max_m = 150.0
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("beamcast", type=Path)
    parser.add_argument("--before", type=Path, help="an older build")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--cases", default="LiDAR,camera,PLY,cold")
    parser.add_argument("--folder", type=Path, help="write here [default: the system's folder for temporary files]")
    args = parser.parse_args()
    cases = {
        "LiDAR": ("LiDAR", 50, "exr,ply"),
        "camera": ("camera", 20, "exr,ply"),
        "PLY": ("LiDAR", 50, "ply"),
        "cold": ("LiDAR", 1, "exr,ply"),
    }
    print(f"{args.threads} threads, medians of {args.rounds} rounds; × is how many times as long as beamcast")
    print("| frames | who | wall, s | × | CPU, s | × | frames alone, s | × | MB |\n|---|---|---|---|---|---|---|---|---|")
    for name in args.cases.split(","):
        compare(args, *cases[name])


def compare(args, sensor, frames, formats):
    runs = {"beamcast": [], "script": []} | ({"before": []} if args.before else {})
    with tempfile.TemporaryDirectory(dir=args.folder) as scratch:
        job = write_job(Path(scratch), sensor, frames, formats)
        for round_ in range(args.rounds + 1):
            for who, measured in runs.items():
                out = Path(scratch) / f"{who}-{round_}"
                if who == "script":
                    script = Path(__file__).with_name("script.py")
                    command = [sys.executable, script, job, frames, formats, args.threads, out]
                else:
                    binary = args.beamcast if who == "beamcast" else args.before
                    command = [binary, "scan", job, "--out", out, "--threads", args.threads, "--json"]
                found = run([str(word) for word in command], who)
                found["mb"] = sum(file.stat().st_size for file in out.rglob("*") if file.is_file()) / 1e6
                subprocess.run(["rm", "-r", out], check=True)
                if round_ > 0:
                    measured.append(found)
    for who, measured in runs.items():
        cells = [f"{frames} × {sensor}, {formats}", who]
        for key in ["wall", "cpu", "frames"]:
            ratios = [of[key] / ours[key] for of, ours in zip(measured, runs["beamcast"])]
            cells += [f"{statistics.median(of[key] for of in measured):.2f}", f"{statistics.median(ratios):.2f}"]
        print("| " + " | ".join(cells + [f"{measured[-1]['mb']:.0f}"]) + " |", flush=True)


def write_job(folder, sensor, frames, formats):
    """The shipped street's job with so many frames, and a camera in place of the LiDAR if it is asked for."""
    street = ROOT / "configs" / "sensors" / "lidar_128.toml"
    description = street.read_text() if sensor == "LiDAR" else CAMERA
    (folder / "sensor.toml").write_text(description)
    (folder / "scenes").symlink_to(ROOT / "scenes")
    job = folder / "job.toml"
    job.write_text(
        f"""scene = "scenes/street.glb"
[sequence]
frames = {frames}
[truth]
poses = false
[[sensor]]
name = "roof"
preset = "sensor.toml"
pose = {{ position_m = [0.0, 0.0, 1.8] }}
[output]
dir = "out"
formats = {json.dumps(formats.split(","))}
"""
    )
    return job


def run(command, who):
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "2"})
    wall = time.perf_counter() - begun
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        raise SystemExit(f"{who}: {done.stderr}")
    stages = json.loads(done.stdout if who != "script" else done.stdout.splitlines()[-1])
    once = ["load_s", "build_s"] if who != "script" else ["import", "load", "build", "rays"]
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"wall": wall, "cpu": cpu, "frames": wall - sum(stages[key] for key in once)}


main()
