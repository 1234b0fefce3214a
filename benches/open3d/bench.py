#!/usr/bin/env python3
"""beamcast's tracer beside Open3D's RaycastingScene (Embree), in one run.

    python3 -m venv venv && venv/bin/pip install -r tests/open3d/requirements.txt   # Debian: apt-get install libusb-1.0-0
    venv/bin/python benches/open3d/bench.py [--scenes room,street] [--rays LiDAR,camera] [--rounds 7] [--scaling] [--json F]
    python3 benches/open3d/bench.py --before CASTER    # an earlier build of benches/caster.rs in Open3D's place; needs numpy only
    python3 benches/open3d/bench.py --embree           # Embree's own interface in C in Open3D's place; Debian: apt-get install libembree-dev

Makes four scenes as GLB in a scratch folder, builds both structures, checks that the hits agree, and casts the same rays
with both in turn (A B A B …, the first round discarded). Times on one thread are CPU times, on two wall times; ratios are
medians over the pairs of a round. Open3D's cast gives f32 depth, ids, u, v and normals in arrays that it allocates (its
interface has no other way); beamcast's f64 depth, ids, u, v and normals in memory that the caller keeps. Reading the rays is
in both.
"""

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
import scenes  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
KINDS = ["camera", "LiDAR", "moving LiDAR", "single"]


class Ours:
    """The caster, spoken to by lines."""

    def __init__(self, caster, scene, threads, words=()):
        command = [caster, str(scene), *words]
        environment = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment)
        self.built = self.answer()

    def answer(self):
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit("the caster has ended")
        return json.loads(line)

    def do(self, *words):
        print(*words, file=self.process.stdin, flush=True)
        return self.answer()

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def status(key):
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) * 1024 for line in file if line.startswith(key))


def open3d_build(path):
    """Open3D's scene, with how long the commit took and what memory it and loading took at most and for good."""
    import open3d as o3d

    before = status("VmRSS:")
    vertices, triangles = scenes.read_glb(path)
    start = time.perf_counter()
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor(np.ascontiguousarray(vertices)), o3d.core.Tensor(np.ascontiguousarray(triangles)))
    # The commit waits for the first cast.
    scene.cast_rays(o3d.core.Tensor(np.array([[0, 0, 1e9, 0, 0, 1]], np.float32)))
    built = {"build_s": time.perf_counter() - start, "peak": status("VmHWM:") - before}
    del vertices, triangles
    built["resident"] = status("VmRSS:") - before
    return scene, built


def cast_open3d(scene, tensor, threads):
    """Seconds of a cast, of as many as take 0.2 s, which is what the caster does."""
    cpu, wall, times = time.process_time(), time.perf_counter(), 0
    while time.perf_counter() - wall < 0.2:
        found = scene.cast_rays(tensor, nthreads=threads)
        times += 1
    return {"cpu_s": (time.process_time() - cpu) / times, "wall_s": (time.perf_counter() - wall) / times}, found


def compare(directory, ours, theirs, directions):
    """What the two disagree on: rays that only one sees hit, and the largest relative difference of depth elsewhere. `theirs`
    are depths, infinite for a miss."""
    ours.do("hits", directory / "hits.bin")
    n = len(directions)
    t = np.fromfile(directory / "hits.bin", "<f8", n)
    hit, their_hit = np.isfinite(t), np.isfinite(theirs)
    both = hit & their_hit
    difference = np.abs(t[both] - theirs[both]) / (0.1 + t[both])
    one_only = int((hit != their_hit).sum())
    far_off = int((difference > 1e-3).sum())
    # A ray within rounding of an edge may go to either side of it: a few in a million, more among loose thin triangles.
    if one_only + far_off > 2e-3 * n:
        raise SystemExit(f"the tracers disagree: {one_only} rays hit for one only, {far_off} at other depths, of {n}")
    return {"hits": int(both.sum()), "one_only": one_only, "other_depth": far_off}


def kinds_of_rays(directory, first, at, kinds):
    """Each kind with its rays, which the caster `first` is told of to find where single rays start."""
    seen = None
    if "single" in kinds:
        directions, origins = scenes.rays("LiDAR", at)
        scenes.write_rays(directory / "rays.bin", directions, origins)
        first.do("rays", directory / "rays.bin")
        first.do("cast", 1)
        first.do("hits", directory / "hits.bin")
        seen = directions, np.fromfile(directory / "hits.bin", "<f8", len(directions))
    for kind in kinds:
        directions, origins = scenes.rays(kind, at, seen)
        scenes.write_rays(directory / "rays.bin", directions, origins)
        yield kind, directions, origins


def measure(directory, caster, name, mesh, options):
    import open3d as o3d

    vertices, triangles = mesh
    path = directory / f"{name}.glb"
    scenes.write_glb(path, vertices, triangles)
    at = scenes.eye(name, vertices)
    count = len(triangles)
    del mesh, triangles, vertices
    result = {"triangles": count, "rays": {}}

    # Each in a process of its own, so that the memory is its own; the builds in turn.
    builds = {"ours": [], "open3d": []}
    for _ in range(options.builds):
        mine = Ours(caster, path, 2)
        builds["ours"].append(mine.built)
        mine.close()
        code = f"import sys, json; sys.path.insert(0, {str(Path(__file__).parent)!r}); import bench, open3d; " \
            f"print(json.dumps(bench.open3d_build({str(path)!r})[1]))"
        builds["open3d"].append(json.loads(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout))
    for who, runs in builds.items():
        result[who] = {key: statistics.median(run[key] for run in runs) for key in runs[0]}

    ours = Ours(caster, path, 2)
    scene, _ = open3d_build(path)
    for kind, directions, origins in kinds_of_rays(directory, ours, at, options.rays):
        ours.do("rays", directory / "rays.bin")
        both = np.concatenate([np.broadcast_to(origins, directions.shape), directions], 1).astype(np.float32)
        tensor = o3d.core.Tensor(np.ascontiguousarray(both))
        pairs = {1: [], 2: []}
        found = None
        for _ in range(options.rounds + 1):
            for threads in (1, 2):
                mine = ours.do("cast", threads)
                theirs, found = cast_open3d(scene, tensor, threads)
                key = "cpu_s" if threads == 1 else "wall_s"
                pairs[threads].append((mine[key], theirs[key]))
        agreement = compare(directory, ours, found["t_hit"].numpy().reshape(-1).astype(float), directions)
        n = len(directions)
        rate = lambda k, threads: n / statistics.median(p[k] for p in pairs[threads][1:]) / 1e6
        result["rays"][kind] = {
            "n": n,
            "ours": rate(0, 1),
            "open3d": rate(1, 1),
            "ratio": statistics.median(b / a for a, b in pairs[1][1:]),
            "ratios": sorted(round(b / a, 2) for a, b in pairs[1][1:]),
            "ours_two": rate(0, 2),
            "ratio_two": statistics.median(b / a for a, b in pairs[2][1:]),
            "agreement": agreement,
        }
        row = result["rays"][kind]
        print(
            f"{name:8} {kind:13} {row['ours']:8.2f} {row['open3d']:8.2f} {row['ratio']:7.2f}   "
            f"{row['ratios'][0]:5.2f}–{row['ratios'][-1]:5.2f} {row['ours_two'] / row['ours']:8.2f} {row['ratio_two']:8.2f}   "
            f"{agreement['one_only']:>5} {agreement['other_depth']:>6}",
            flush=True,
        )
    ours.close()
    return result


def measure_before(directory, caster, name, mesh, options):
    """The same rays with this build and an earlier one in turn: the ratios of their times on one thread, a pair a round."""
    vertices, triangles = mesh
    path = directory / f"{name}.glb"
    scenes.write_glb(path, vertices, triangles)
    at = scenes.eye(name, vertices)
    del mesh, triangles, vertices
    both = [Ours(caster, path, 1), Ours(options.before, path, 1)]
    builds = [who.built["build_s"] for who in both]
    result = {"build_s": builds, "bytes": [who.built["bytes"] for who in both], "rays": {}}
    for kind, directions, _ in kinds_of_rays(directory, both[0], at, options.rays):
        hits = []
        for who in both:
            who.do("rays", directory / "rays.bin")
            who.do("hits", directory / "hits.bin")
            hits.append((directory / "hits.bin").read_bytes())
        if hits[0] != hits[1]:
            raise SystemExit(f"{name}, {kind}: the hits are not the same bits as before")
        pairs = []
        for turn in range(options.rounds + 1):
            # Who goes first changes, so that a machine that slows down favours neither.
            order = (0, 1) if turn % 2 == 0 else (1, 0)
            times = {who: both[who].do("cast", 1)["cpu_s"] for who in order}
            pairs.append((times[0], times[1]))
        ratios = sorted(before / now for now, before in pairs[1:])
        now, before = (statistics.median(pair[who] for pair in pairs[1:]) for who in (0, 1))
        n = len(directions)
        result["rays"][kind] = {"now": n / now / 1e6, "before": n / before / 1e6, "ratio": statistics.median(ratios), "ratios": ratios}
        print(
            f"{name:8} {kind:13} {n / now / 1e6:8.2f} {n / before / 1e6:8.2f} {statistics.median(ratios):7.3f}   "
            f"{ratios[0]:5.2f}–{ratios[-1]:5.2f}",
            flush=True,
        )
    for who in both:
        who.close()
    return result


EMBREE = {"packets": ["packets"], "robust": ["packets", "robust"], "single": ["single"]}


def build_embree(directory):
    """Compiles benches/embree/caster.c with the Embree that the system has."""
    source = Path(__file__).parents[1] / "embree" / "caster.c"
    for library in ("embree4", "embree3"):
        command = ["cc", "-O3", "-march=native", "-o", directory / "embree", source, f"-l{library}", "-lpthread", "-lm"]
        if subprocess.run(command, stderr=subprocess.DEVNULL).returncode == 0:
            return directory / "embree"
    raise SystemExit("Embree's headers and library are missing; Debian: apt-get install libembree-dev")


def measure_embree(directory, caster, name, mesh, options):
    """The same rays with ours and with Embree in turn: coherent packets of 16, the same with the robust flag, and single rays.
    Ratios are Embree's time over ours, on one thread by CPU time and on two by wall time."""
    vertices, triangles = mesh
    path = directory / f"{name}.glb"
    scenes.write_glb(path, vertices, triangles)
    with open(directory / "mesh.bin", "wb") as file:
        np.array([len(vertices), len(triangles)], "<u8").tofile(file)
        np.ascontiguousarray(vertices, "<f4").tofile(file)
        np.ascontiguousarray(triangles, "<u4").tofile(file)
    at = scenes.eye(name, vertices)
    del mesh, triangles, vertices
    ours = Ours(caster, path, 2)
    rivals = {key: Ours(options.embree, directory / "mesh.bin", 2, words) for key, words in EMBREE.items()}
    result = {"version": rivals["packets"].built["version"], "rays": {}}
    for kind, directions, _ in kinds_of_rays(directory, ours, at, options.rays):
        ours.do("rays", directory / "rays.bin")
        disagreeing = {}
        for key, rival in rivals.items():
            rival.do("rays", directory / "rays.bin")
            rival.do("hits", directory / "theirs.bin")
            theirs = np.fromfile(directory / "theirs.bin", "<f8", len(directions))
            disagreeing[key] = compare(directory, ours, theirs, directions)
        times = {key: [] for key in ["ours", "ours two", *rivals, "packets two"]}
        for _ in range(options.rounds + 1):
            for key, seconds in times.items():
                who = ours if key.startswith("ours") else rivals[key.split()[0]]
                seconds.append(who.do("cast", 2)["wall_s"] if key.endswith("two") else who.do("cast", 1)["cpu_s"])
        times = {key: seconds[1:] for key, seconds in times.items()}
        n = len(directions)
        rates = {key: n / statistics.median(seconds) / 1e6 for key, seconds in times.items()}
        ratio = lambda key, own="ours": statistics.median(b / a for a, b in zip(times[own], times[key]))
        ratios = {key: ratio(key) for key in rivals} | {"two": ratio("packets two", "ours two"), "scaling": rates["ours two"] / rates["ours"]}
        result["rays"][kind] = {"rates": rates, "ratios": ratios, "disagreeing": disagreeing}
        print(
            f"{name:8} {kind:13} {rates['ours']:8.2f} {rates['packets']:8.2f}   "
            + " ".join(f"{ratios[key]:8.2f}" for key in [*rivals, "two", "scaling"]),
            flush=True,
        )
    for who in [ours, *rivals.values()]:
        who.close()
    return result


def build_table(results):
    print("\nscene    triangles   build s: ours  Open3D   B/triangle   peak MB: ours  Open3D   resident MB: ours  Open3D")
    for name, r in results.items():
        ours, theirs = r["ours"], r["open3d"]
        print(
            f"{name:8} {r['triangles']:9}  {ours['build_s']:13.2f} {theirs['build_s']:7.2f} {ours['bytes'] / r['triangles']:12.1f}"
            f" {ours['peak'] / 1e6:15.0f} {theirs['peak'] / 1e6:7.0f} {ours['resident'] / 1e6:19.0f} {theirs['resident'] / 1e6:7.0f}"
        )


def scaling(directory, caster, options):
    """Cost against triangles, rays and threads, on one rough sheet."""
    table = {"triangles": [], "rays": [], "threads": []}
    at = np.array([0.1, 0.2, 6.0])
    directions, origins = scenes.rays("LiDAR", at)

    def rate(ours, threads=1):
        key = "cpu_s" if threads == 1 else "wall_s"
        return statistics.median(ours.do("cast", threads)[key] for _ in range(options.rounds))

    print("\ntriangles   build s   B/triangle   LiDAR Mrays/s")
    for exponent in np.arange(3, 7.01, 0.5):
        vertices, triangles = scenes.refined(int(10**exponent))
        scenes.write_glb(directory / "sheet.glb", vertices, triangles)
        ours = Ours(caster, directory / "sheet.glb", 2)
        scenes.write_rays(directory / "rays.bin", directions, origins)
        n = ours.do("rays", directory / "rays.bin")["rays"]
        ours.do("cast", 1)
        row = (len(triangles), ours.built["build_s"], ours.built["bytes"] / len(triangles), n / rate(ours) / 1e6)
        table["triangles"].append(row)
        print(f"{row[0]:9} {row[1]:9.3f} {row[2]:12.1f} {row[3]:15.2f}", flush=True)
        if abs(exponent - 6) < 0.01:
            print("        rays   Mrays/s")
            for share in (256, 64, 16, 4, 1):
                # The same tiles, fewer of them: neighbours stay neighbours.
                few = directions.reshape(-1, 64, 3)[::share].reshape(-1, 3)
                scenes.write_rays(directory / "rays.bin", few, origins)
                ours.do("rays", directory / "rays.bin")
                ours.do("cast", 1)
                table["rays"].append((len(few), len(few) / rate(ours) / 1e6))
                print(f"{len(few):12} {table['rays'][-1][1]:9.2f}", flush=True)
            print("     threads   Mrays/s (wall)")
            for threads in sorted({1, 2, os.cpu_count()}):
                seconds = statistics.median(ours.do("cast", threads)["wall_s"] for _ in range(options.rounds))
                table["threads"].append((threads, n / seconds / 1e6))
                print(f"{threads:12} {table['threads'][-1][1]:9.2f}", flush=True)
        ours.close()
    return table


def machine():
    with open("/proc/cpuinfo") as file:
        name = next((line.split(":")[1].strip() for line in file if line.startswith("model name")), platform.machine())
    return f"{os.cpu_count()} cores of {name}, {platform.system()}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", default=",".join(scenes.SCENES))
    parser.add_argument("--rays", default=",".join(KINDS))
    parser.add_argument("--rounds", type=int, default=7, help="pairs of casts that count")
    parser.add_argument("--builds", type=int, default=3)
    parser.add_argument("--scaling", action="store_true", help="also cost against triangles, rays and threads")
    parser.add_argument("--before", metavar="CASTER", help="an earlier build of the caster, to be compared with in Open3D's place")
    parser.add_argument("--embree", action="store_true", help="Embree's own interface in C in Open3D's place")
    parser.add_argument("--json", type=Path, help="write all of it there")
    options = parser.parse_args()
    options.rays = options.rays.split(",")

    subprocess.run(["cargo", "build", "--release", "--bench", "caster"], cwd=ROOT, check=True)
    messages = subprocess.run(
        ["cargo", "build", "--release", "--bench", "caster", "--message-format=json", "-q"],
        cwd=ROOT, check=True, capture_output=True, text=True,
    ).stdout.splitlines()
    built = [m for m in map(json.loads, messages) if m.get("executable")]
    caster = next(m["executable"] for m in built if m["target"]["name"] == "caster")

    if options.before:
        print(f"{time.strftime('%Y-%m-%d')}, {machine()}; {options.rounds} rounds; one thread, Mrays/s\n")
        print("scene    rays               now    before   ratio   (min – max)")
        results = {}
        with tempfile.TemporaryDirectory(prefix="beamcast-bench-") as directory:
            for name in options.scenes.split(","):
                results[name] = measure_before(Path(directory), caster, name, scenes.SCENES[name](), options)
        if options.json:
            options.json.write_text(json.dumps({"machine": machine(), "scenes": results}, indent=1) + "\n")
        return

    if options.embree:
        print(f"{time.strftime('%Y-%m-%d')}, {machine()}; {options.rounds} rounds; Mrays/s on one thread, and Embree's time over ours\n")
        print("scene    rays              ours  packets    packets   robust   single      two  scaling")
        results = {}
        with tempfile.TemporaryDirectory(prefix="beamcast-bench-") as directory:
            options.embree = build_embree(Path(directory))
            for name in options.scenes.split(","):
                results[name] = measure_embree(Path(directory), caster, name, scenes.SCENES[name](), options)
        print(f"\nEmbree {results[name]['version']}")
        if options.json:
            options.json.write_text(json.dumps({"machine": machine(), "scenes": results}, indent=1) + "\n")
        return

    import open3d as o3d

    print(f"{time.strftime('%Y-%m-%d')}, {machine()}, Open3D {o3d.__version__}; {options.rounds} rounds\n")
    print("                        one thread, Mrays/s                    two threads        disagreeing rays")
    print("scene    rays              ours   Open3D   ratio   (min – max)  ×1 thread   ratio   hit   depth")
    results = {}
    with tempfile.TemporaryDirectory(prefix="beamcast-bench-") as directory:
        directory = Path(directory)
        for name in options.scenes.split(","):
            results[name] = measure(directory, caster, name, scenes.SCENES[name](), options)
        build_table(results)
        everything = {"machine": machine(), "scenes": results}
        if options.scaling:
            everything["scaling"] = scaling(directory, caster, options)
    if options.json:
        options.json.write_text(json.dumps(everything, indent=1) + "\n")


if __name__ == "__main__":
    main()
