"""Compares beamcast's range images with Open3D's RaycastingScene (Embree) on the same scenes and patterns.

    python tests/open3d/check.py --beamcast target/release/beamcast configs/*.toml
    python tests/open3d/check.py --write-tables configs/*.toml     # what tests/suite/open3d.rs compares with

Rays and triangles are made here from the job's and the scene's own files (rays.py, glb.py); nothing is taken from
beamcast but its EXR. Open3D says which triangle a ray hits first, in f32. For each ray:

1. Both miss, or beamcast's range is that of the plane of Open3D's triangle, evaluated in f64 for the exact ray, within
   the rounding of the output to f32: 2^-24·t + 1e-8 m, the latter for f64's own rounding. This holds beamcast to far more
   than Open3D's f32.
2. Beamcast's range is Open3D's own t, within 4e-7·t + 1e-6 m and what is known to differ between the two questions: the
   ray's rounding to f32 (its effect on this plane is computed and taken off), the rounding to f32 of vertices of meshes
   placed many times (V/cos θ, V half an ulp of the largest coordinate in each of three components; beamcast keeps such
   meshes in their own space), and Embree's f32 arithmetic at grazing incidence, (R + t)·8u/cos θ, with u = 2^-24, θ the
   incidence and R the distance of the triangle's farthest corner: numerator a·N and denominator d·N of t are each a sum
   of products whose errors are relative to |a||N| and |d||N|, not to the sums.
3. Where 1 fails, the two see different triangles. That is right only for a ray that passes near an edge. All triangles
   are tried in f64. A ray passes within s of an edge bc (a, b, c relative to its origin, d its direction) when
   |det(d, b, c)| <= s·|c - b|, because det(d, b, c)/|c - b| is the distance between the two lines times the sine between
   them. s = 16u·R + |error of o| + R·|error of d| + V: 16u bounds the f32 roundings of vertex minus origin, edge, cross
   product and dot product (2 + 2 + 4 + 4, and room). A triangle is *surely* hit if the ray passes all edges inside by
   more than s, *possibly* if by more than -s. An answer (a range, or a miss) is admissible if it is that of a possible
   hit and no sure hit lies before it. Both answers must be admissible; then the ray is counted as explained.

Normals, intensities, labels and ids must be those of Open3D's triangle, or of another possible hit at that range.
"""

import argparse
import os
import subprocess
import sys
import tempfile

import numpy as np
import open3d as o3d

import glb
import moving
import rays

U = 2.0**-24
PIXELS_A_TABLE = 900
# More rays than this near edges are no accident; each is tried against every triangle.
MANY = 500
# In the first the walker is at the kerb, and in the others the cars, the cyclist and the walker are near, at speed and at a stand.
FRAMES_OF_DRIVES = [0, 37, 62, 95]
TABLES_OF_DRIVES = [37, 62]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--beamcast", help="the binary to check")
    parser.add_argument("--write-tables", action="store_true", help="write tests/open3d/*.tsv instead")
    parser.add_argument("jobs", nargs="+")
    arguments = parser.parse_args()
    if bool(arguments.beamcast) == arguments.write_tables:
        parser.error("either --beamcast BINARY or --write-tables")
    if arguments.write_tables:
        for path in arguments.jobs:
            job = rays.load_job(path)
            if moving.is_moving(job):
                world = World(rays.scene_path(path, job), job.get("up", "z"))
                for frame in TABLES_OF_DRIVES:
                    moving.write_tables(path, job, world, frame, PIXELS_A_TABLE)
            else:
                write_tables(path)
        return 0

    failed = drives([path for path in arguments.jobs if moving.is_moving(rays.load_job(path))], arguments.beamcast)
    header = ["job/sensor", "rays", "hits", "other triangle", "explained", "max |dt| f64 m", "ratio", "max |dt| Open3D m",
              "ratio", "grazing", "other surface"]
    print("\t".join(header))
    for path in arguments.jobs:
        if moving.is_moving(rays.load_job(path)):
            continue
        with tempfile.TemporaryDirectory() as out:
            command = [arguments.beamcast, "scan", path, "-q", "--out", out, "--set", 'output.formats=["exr"]']
            if subprocess.run(command, stdout=subprocess.DEVNULL).returncode != 0:
                print(f"{stem(path)}: failed: {' '.join(command)}", flush=True)
                failed = True
                continue
            job = rays.load_job(path)
            world = World(rays.scene_path(path, job), job.get("up", "z"))
            for sensor in rays.sensors(path, job, world.scene.centre):
                image = read_exr(os.path.join(out, sensor.name, "000000.exr"))
                row, problems = compare(world, sensor, image)
                print("\t".join([f"{stem(path)}/{sensor.name}"] + row), flush=True)
                for problem in problems:
                    print(f"  {problem}", flush=True)
                failed |= bool(problems)
    return 1 if failed else 0


def drives(jobs, beamcast):
    """Compares a few frames of each drive, column by column. Whether something is wrong."""
    print("\t".join(["job/sensor/frame", "rays", "hits", "on what moves", "other triangle", "explained", "max |dt| f64 m", "ratio"]))
    failed = False
    for path in jobs:
        job = rays.load_job(path)
        world = World(rays.scene_path(path, job), job.get("up", "z"))
        for frame in FRAMES_OF_DRIVES:
            with tempfile.TemporaryDirectory() as out:
                command = [beamcast, "scan", path, "-q", "--out", out, "--set", 'output.formats=["exr"]']
                command += ["--frames", f"{frame}..{frame + 1}"]
                if subprocess.run(command, stdout=subprocess.DEVNULL).returncode != 0:
                    print(f"{stem(path)}: failed: {' '.join(command)}", flush=True)
                    failed = True
                    continue

                def image(sensor, out=out, frame=frame):
                    return read_exr(os.path.join(out, sensor, f"{frame:06}.exr"))

                for sensor, row, problems in moving.compare(path, job, world, frame, image):
                    print("\t".join([f"{stem(path)}/{sensor}/{frame}"] + row), flush=True)
                    for problem in problems:
                        print(f"  {problem}", flush=True)
                    failed |= bool(problems)
    return failed


def stem(path):
    return os.path.splitext(os.path.basename(path))[0]


def read_exr(path):
    """Channels by name, (rows, columns) each."""
    import OpenEXR

    channels = OpenEXR.File(path, separate_channels=True).channels()
    return {name: channel.pixels for name, channel in channels.items()}


class World:
    """A scene and Open3D's tracer of it."""

    def __init__(self, path, up):
        self.scene = glb.load(path, up)
        self.tracer = o3d.t.geometry.RaycastingScene()
        vertices = self.scene.vertices.astype(np.float32)
        self.tracer.add_triangles(o3d.core.Tensor(vertices), o3d.core.Tensor(self.scene.triangles.astype(np.uint32)))
        # Half an ulp in each component, for meshes whose vertices beamcast does not round in this space.
        corners = np.abs(self.scene.vertices).max(1)[self.scene.triangles].max(1)
        half_ulp = np.spacing(corners.astype(np.float32)).astype(np.float64) / 2
        self.moved = np.where(self.scene.shared, np.sqrt(3) * half_ulp, 0.0)
        # Beamcast's ids: first what is placed once, then what is shared, each in document order.
        self.ids = np.empty(len(self.scene.triangles), np.int64)
        self.ids[np.argsort(self.scene.shared, kind="stable")] = np.arange(len(self.ids))

    def cast(self, sensor):
        """Open3D's ranges (inf where nothing is seen) and triangles, ray by ray."""
        cast = sensor.cast.reshape(-1, 6)
        length = np.linalg.norm(cast[:, 3:].astype(np.float64), axis=1)
        answer = self.tracer.cast_rays(o3d.core.Tensor(cast))
        t, triangle = answer["t_hit"].numpy() * length, answer["primitive_ids"].numpy().astype(np.int64)
        # What is nearer than the sensor's least range blocks the ray.
        limited = t * sensor.limited.reshape(-1)
        t[(limited < sensor.min_m) | (limited > sensor.max_m)] = np.inf
        return t, triangle

    def corners(self, triangle):
        a, b, c = np.moveaxis(self.scene.vertices[self.scene.triangles[triangle]], 1, 0)
        return a, b, c


def rowwise(a, b):
    return np.einsum("...i,...i->...", a, b)


def plane(origin, direction, corners):
    """t, cos θ and unit normal of rays against their triangles' planes, in f64."""
    a, b, c = corners
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    slope = rowwise(direction, normal)
    with np.errstate(divide="ignore", invalid="ignore"):
        return rowwise(a - origin, normal) / slope, np.abs(slope), normal


def farthest(origin, corners):
    return np.max([np.linalg.norm(p - origin, axis=-1) for p in corners], axis=0)


class Seen:
    """Where Open3D hits, seen with f64: arrays over the rays it hits with."""

    def __init__(self, world, sensor, hit, triangle, directions):
        corners = world.corners(triangle[hit])
        origin = sensor.origin - world.scene.centre
        cast = sensor.cast.reshape(-1, 6)[hit].astype(np.float64)
        direction32 = cast[:, 3:] / np.linalg.norm(cast[:, 3:], axis=1, keepdims=True)
        self.t, self.cos, self.normal = plane(origin, directions[hit], corners)
        # The same for the ray that Open3D was given, against the vertices that it was given.
        rounded = [p.astype(np.float32).astype(np.float64) for p in corners]
        t32, _, _ = plane(cast[:, :3], direction32, corners)
        self.ray_rounding = t32 - self.t
        reach = farthest(origin, rounded)
        self.moved = world.moved[triangle[hit]] / self.cos
        self.grazing = 8 * U * (reach + self.t) / self.cos


def compare(world, sensor, image):
    """A row of the table, and what is wrong."""
    directions = sensor.directions.reshape(-1, 3)
    ranges = image["range"].astype(np.float64)
    if ranges.shape != sensor.directions.shape[:2]:
        return ["-"] * 10, [f"the image has {ranges.shape} pixels, the pattern {sensor.directions.shape[:2]}"]
    columns = ranges.shape[1]
    ranges = ranges.reshape(-1)
    theirs, triangle = world.cast(sensor)
    hit = np.isfinite(theirs) & np.isfinite(ranges)
    seen = Seen(world, sensor, hit, triangle, directions)

    # 1: the plane of Open3D's triangle, exactly.
    exact = np.abs(ranges[hit] - seen.t)
    allowed = U * seen.t + 1e-8
    with np.errstate(invalid="ignore"):
        same = exact <= allowed
    agreed = np.isinf(theirs) & np.isinf(ranges)
    agreed[np.flatnonzero(hit)[same]] = True

    # 2: Open3D's own number.
    difference = np.abs(ranges[hit] + seen.ray_rounding - theirs[hit])[same]
    plain = (4e-7 * seen.t + 1e-6 + seen.moved)[same]
    ratio = difference / (plain + seen.grazing[same])
    problems = []
    for index in np.flatnonzero(same)[ratio > 1][:10]:
        ray = np.flatnonzero(hit)[index]
        problems.append(f"pixel {divmod(int(ray), columns)}: {ranges[ray]:.9g} m, Open3D {theirs[ray]:.9g} m")
    if "Z" in image and sensor.depth is not None:
        depth = image["Z"].reshape(-1).astype(np.float64)
        wrong = np.abs(depth[hit] - ranges[hit] * sensor.depth.reshape(-1)[hit]) > 4 * U * ranges[hit]
        if wrong.any() or not np.array_equal(np.isinf(depth), np.isinf(ranges)):
            problems.append(f"Z is not the depth of range in {wrong.sum()} pixels")

    # 3: other triangles.
    others = np.flatnonzero(~agreed)
    explained = 0
    if len(others) > MANY:
        problems.append(f"{len(others)} rays see other triangles: more than edges explain")
    else:
        admissible = Admissible(world, sensor)
        for ray in others:
            ours_ok, theirs_ok = (admissible(directions[ray], ray, t) for t in (ranges[ray], theirs[ray]))
            if ours_ok and theirs_ok:
                explained += 1
            elif len(problems) < 10:
                pixel = divmod(int(ray), columns)
                whose = " and ".join(n for n, ok in (("beamcast's", ours_ok), ("Open3D's", theirs_ok)) if not ok)
                problems.append(f"pixel {pixel}: {ranges[ray]:.9g} m, Open3D {theirs[ray]:.9g} m: {whose} can't be")
        if explained < len(others) and not problems:
            problems.append(f"{len(others) - explained} rays are not explained")

    doubtful, wrong = channels(world, sensor, image, ranges, triangle)
    problems += [f"{name} is right for no triangle there in {count} pixels" for name, count in wrong.items() if count]
    row = [
        str(len(ranges)),
        str(int(np.isfinite(ranges).sum())),
        str(len(others)),
        str(explained),
        f"{exact[same].max(initial=0):.2e}",
        f"{(exact / allowed)[same].max(initial=0):.3f}",
        f"{difference.max(initial=0):.2e}",
        f"{ratio.max(initial=0):.3f}",
        str(int((difference > plain).sum())),
        str(doubtful),
    ]
    return row, problems


def channels(world, sensor, image, ranges, triangle):
    """In how many pixels with a range the other channels are not those of Open3D's triangle but of another possible hit
    at that range (a neighbour, or a surface that crosses it there); and in how many each is that of none."""
    names = [n for n in ("normal", "intensity", "id.semantic", "id.instance", "id.triangle") if any(c.startswith(n) for c in image)]
    directions = sensor.directions.reshape(-1, 3)
    seen = np.flatnonzero(np.isfinite(ranges))
    ours = {}
    for name in names:
        parts = [f"normal.{k}" for k in "XYZ"] if name == "normal" else [name]
        ours[name] = np.stack([image[part].reshape(-1)[seen] for part in parts], -1).astype(np.float64)
    tolerance = {"normal": 2e-6, "intensity": 1e-6}

    def right(name, rows, values):
        return np.abs(ours[name][rows] - values).max(-1) <= tolerance.get(name, 0)

    known = triangle[seen] < len(world.scene.triangles)  # Open3D's word for none is larger
    expected = surface(world, sensor, directions[seen], np.where(known, triangle[seen], 0))
    good = known & np.all([right(name, slice(None), expected[name]) for name in names], axis=0)
    doubtful = np.flatnonzero(~good)
    wrong = dict.fromkeys(names, 0)
    if len(doubtful) > MANY:
        return len(doubtful), wrong | {"some channel": len(doubtful)}
    admissible = Admissible(world, sensor)
    for row in doubtful:
        ray = seen[row]
        candidates = admissible.hits(directions[ray], ray, ranges[ray])
        there = surface(world, sensor, np.broadcast_to(directions[ray], (len(candidates), 3)), candidates)
        fits = {name: right(name, row, there[name]) for name in names}
        if not np.any(np.all(list(fits.values()), axis=0)):
            best = max(range(len(candidates)), key=lambda i: sum(f[i] for f in fits.values()), default=None)
            for name in names:
                wrong[name] += best is None or not fits[name][best]
    return len(doubtful), wrong


def surface(world, sensor, directions, triangle):
    """What the other channels are where rays hit triangles, (rays, width) each."""
    scene = world.scene
    _, cos, normal = plane(sensor.origin - scene.centre, directions, world.corners(triangle))
    towards = normal * -np.sign(rowwise(normal, directions))[:, None]
    placed = np.searchsorted(scene.first, triangle, side="right") - 1
    return {
        "normal": towards @ sensor.axes,
        "intensity": (scene.reflectivity[triangle] * cos)[:, None],
        "id.semantic": scene.labels[placed][:, None],
        "id.instance": placed[:, None] + 1,
        "id.triangle": world.ids[triangle][:, None] + 1,
    }


def well_inside(world, sensor, hit, triangle, share=1e-4):
    """Whether the rays' barycentric coordinates in the triangles are all at least `share`."""
    origin = sensor.origin - world.scene.centre
    direction = sensor.directions.reshape(-1, 3)[hit]
    a, b, c = (p - origin for p in world.corners(triangle[hit]))
    w = np.stack([rowwise(direction, np.cross(p, q)) for p, q in ((b, c), (c, a), (a, b))], -1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return (w / w.sum(-1, keepdims=True)).min(-1) >= share


class Admissible:
    """Whether an answer can be right, whatever the f32 roundings: point 3 of this file's head."""

    def __init__(self, world, sensor):
        self.sensor = sensor
        self.origin = sensor.origin - world.scene.centre
        triangles = world.scene.triangles
        self.corners = [world.scene.vertices[triangles[:, k]] - self.origin for k in range(3)]
        a, b, c = self.corners
        self.edges = [np.cross(b, c), np.cross(c, a), np.cross(a, b)]
        self.lengths = [np.linalg.norm(q - p, axis=1) for p, q in ((b, c), (c, a), (a, b))]
        self.normal = np.cross(b - a, c - a)
        self.low, self.high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        self.reach = farthest(0.0, self.corners)
        self.moved = world.moved

    def __call__(self, direction, ray, t):
        """Whether t (inf: a miss) can be a ray's range."""
        index, at, allowed, sure = self.possible(direction, ray)
        if np.isfinite(t):
            blocked = (sure & (at > allowed) & (at + allowed < t)).any()
            return bool(not blocked and len(self.hits(direction, ray, t)))
        limited, off = (value * self.sensor.limited.reshape(-1)[ray] for value in (at, allowed))
        surely_seen = sure & (limited > self.sensor.min_m + off) & (limited < self.sensor.max_m - off)
        may_be_blocked = (at + allowed > 0) & (limited <= self.sensor.min_m + off)
        return bool(may_be_blocked.any() or not surely_seen.any())

    def hits(self, direction, ray, t):
        """The triangles that a ray may hit at t."""
        index, at, allowed, _ = self.possible(direction, ray)
        limited, off = (value * self.sensor.limited.reshape(-1)[ray] for value in (at, allowed))
        visible = (limited >= self.sensor.min_m - off) & (limited <= self.sensor.max_m + off) & (at + allowed > 0)
        return index[visible & (np.abs(at - t) <= allowed)]

    def possible(self, direction, ray):
        """Triangles that a ray may hit, where, how uncertain that is (m), and whether it surely does."""
        cast = self.sensor.cast.reshape(-1, 6)[ray].astype(np.float64)
        d32 = cast[3:] / np.linalg.norm(cast[3:])
        slack = (
            16 * U * self.reach
            + np.linalg.norm(cast[:3] - self.origin)
            + self.reach * np.linalg.norm(d32 - direction)
            + self.moved
        )
        w = [edge @ direction for edge in self.edges]
        sure, possible = np.zeros(len(slack), bool), np.zeros(len(slack), bool)
        for side in (1, -1):
            sure |= np.all([side * v > slack * length for v, length in zip(w, self.lengths)], axis=0)
            possible |= np.all([side * v >= -slack * length for v, length in zip(w, self.lengths)], axis=0)
        index = np.flatnonzero(possible)
        slope = self.normal[index] @ direction
        with np.errstate(divide="ignore", invalid="ignore"):
            at = rowwise(self.corners[0][index], self.normal[index]) / slope
            sine = np.abs(slope) / np.linalg.norm(self.normal[index], axis=1)
            allowed = 4e-7 * self.reach[index] + 1e-6 + slack[index] / sine
            # No hit lies outside its triangle's box; edge-on, the plane says less than the box.
            low, high = self.low[index] - slack[index, None], self.high[index] + slack[index, None]
            ends = np.stack([low / direction, high / direction])
        first, last = np.nanmax(ends.min(0), axis=1), np.nanmin(ends.max(0), axis=1)
        at = np.clip(np.nan_to_num(at), first, last)
        allowed = np.minimum(np.nan_to_num(allowed, nan=np.inf), last - first + 1e-6 + 4e-7 * self.reach[index])
        return index, at, allowed, sure[index]


def write_tables(path):
    """For each sensor some pixels' ranges as Open3D has them, with what a right answer may differ by."""
    job = rays.load_job(path)
    world = World(rays.scene_path(path, job), job.get("up", "z"))
    for sensor in rays.sensors(path, job, world.scene.centre):
        rows, columns = sensor.directions.shape[:2]
        t, triangle = world.cast(sensor)
        hit = np.isfinite(t)
        seen = Seen(world, sensor, hit, triangle, sensor.directions.reshape(-1, 3))
        good = ~hit
        good[hit] = well_inside(world, sensor, hit, triangle)
        good &= calm(world, sensor, t, triangle)
        # What Open3D says of its own rounded ray, brought to the ray itself.
        t[hit] -= seen.ray_rounding
        allowed = np.zeros(len(t))
        allowed[hit] = 4e-7 * seen.t + 1e-6 + seen.moved + seen.grazing
        # A step that shares no factor with the pixels' number goes through all rows and columns.
        chosen = np.arange(PIXELS_A_TABLE) * coprime(rows * columns, PIXELS_A_TABLE) % (rows * columns)
        chosen = np.sort(chosen[good[chosen]])
        name = os.path.join(os.path.dirname(os.path.abspath(__file__)), f"{stem(path)}.{sensor.name}.tsv")
        with open(name, "w", newline="\n") as file:
            print("row\tcolumn\trange_m\ttolerance_m", file=file)
            for ray in chosen:
                row, column = divmod(int(ray), columns)
                if hit[ray]:
                    print(f"{row}\t{column}\t{t[ray]:.7f}\t{allowed[ray]:.1e}", file=file)
                else:
                    print(f"{row}\t{column}\tinf\t0", file=file)
        print(f"{name}: {len(chosen)} pixels, {np.isfinite(t[chosen]).sum()} hits")


def calm(world, sensor, t, triangle):
    """Whether rays turned by 2e-5 rad all ways see the same triangle: no edge is near."""
    directions = sensor.directions.reshape(-1, 3)
    helper = np.where(np.abs(directions[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    right = np.cross(directions, helper)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    up = np.cross(right, directions)
    same = np.ones(len(t), bool)
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        turned = directions + 2e-5 * (x * right + y * up)
        origin = np.broadcast_to(sensor.origin - world.scene.centre, turned.shape)
        other = rays.Sensor(**vars(sensor) | {"cast": np.concatenate([origin, turned], -1).astype(np.float32)})
        other_t, other_triangle = world.cast(other)
        same &= np.isfinite(other_t) == np.isfinite(t)
        same &= ~np.isfinite(t) | (other_triangle == triangle)
    # Nor the ends of the sensor's range.
    limited = t * sensor.limited.reshape(-1)
    return same & (np.abs(limited - sensor.min_m) > 1e-3) & ~(np.abs(limited - sensor.max_m) < 1e-3)


def coprime(total, parts):
    step = total // parts
    while np.gcd(step, total) != 1:
        step += 1
    return step


if __name__ == "__main__":
    sys.exit(main())
