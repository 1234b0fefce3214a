"""Drives: rays from sensors that move, into scenes that move, cast by Open3D at each pulse's own time.

The static scene is one Open3D scene, in which each ray starts where its pulse does. Each rigid part that moves (a car's body, a
wheel) is an Open3D scene of its own, in the part's own space, and each ray is carried there by the part's place at the ray's own
time. A skin has a shape for each slice of the frame's time, that of the slice's middle, and moves with its actor. The nearest of
all is what a ray sees.

Trajectories, animations, skins and times are worked out here from the job and the files alone. For each ray, both miss or
beamcast's range is that of the plane of Open3D's triangle in f64, within the output's rounding, 2^-24·t, plus 1e-6 m for the
rounding of the poses, whose components of at most 100 m are products of a few f64 of 1e-16, and what the rounding of shared
vertices of the static scene is worth (check.py). Else it passes an edge: the range must be what one of the rays turned by
2e-5 rad, in eight directions, sees there.
"""

import csv
import os

import numpy as np
import open3d as o3d

import glb
import rays

U = 2.0**-24
# More rays than this share near edges are no accident.
SHARE = 5e-3
TURNED = 2e-5


def is_moving(job):
    return "sequence" in job or "actor" in job


class Trajectory:
    """world_from_body over time, of the forms that the shipped drive has."""

    def __init__(self, table, folder):
        self.pose = rays.pose(table.get("pose", {}))
        self.twist = table.get("twist")
        self.times = None
        if "file" in table:
            with open(os.path.join(folder, table["file"])) as file:
                rows = [[float(v) for v in row.values()] for row in csv.DictReader(file)]
            self.times = np.array([row[0] for row in rows])
            self.poses = []
            for row in rows:
                matrix = np.eye(4)
                matrix[:3, :3] = glb.rotation(row[4:8])
                matrix[:3, 3] = row[1:4]
                self.poses.append(matrix)

    def at(self, time):
        if self.times is not None:
            k = int(np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, len(self.times) - 2))
            part = (time - self.times[k]) / (self.times[k + 1] - self.times[k])
            v, w = logarithm(np.linalg.inv(self.poses[k]) @ self.poses[k + 1])
            return self.poses[k] @ exponential(v * part, w * part)
        if self.twist is not None:
            v = np.array(self.twist.get("linear_m_s", [0.0, 0.0, 0.0]))
            w = np.radians(self.twist.get("angular_deg_s", [0.0, 0.0, 0.0]))
            return self.pose @ exponential(v * time, w * time)
        return self.pose


def cross(w):
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def coefficients(angle):
    """(1 - cos)/angle^2 and (angle - sin)/angle^3."""
    if angle < 1e-3:
        return 0.5 - angle**2 / 24, 1 / 6 - angle**2 / 120
    return 2 * np.sin(angle / 2) ** 2 / angle**2, (angle - np.sin(angle)) / angle**3


def exponential(v, w):
    """The motion along v and about w, both constant in the moving frame."""
    angle = np.linalg.norm(w)
    k = cross(w)
    b, c = coefficients(angle)
    matrix = np.eye(4)
    matrix[:3, :3] = np.eye(3) + np.sinc(angle / np.pi) * k + b * k @ k
    matrix[:3, 3] = (np.eye(3) + b * k + c * k @ k) @ v
    return matrix


def logarithm(matrix):
    """The v and w whose exponential is a motion by less than half a turn."""
    r = matrix[:3, :3]
    axis = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / 2
    sine = np.linalg.norm(axis)
    angle = np.arctan2(sine, (np.trace(r) - 1) / 2)
    w = axis * (angle / sine if sine > 0 else 1.0)
    k = cross(w)
    b, c = coefficients(angle)
    return np.linalg.solve(np.eye(3) + b * k + c * k @ k, matrix[:3, 3]), w


class Animated:
    """A file whose only animation plays over and over, with straight lines between keys."""

    def __init__(self, path):
        self.gltf, self.binary = glb.parse(path)
        self.tracks = {}
        for animation in self.gltf.get("animations", []):
            for channel in animation["channels"]:
                sampler = animation["samplers"][channel["sampler"]]
                times = self.values(sampler["input"]).astype(np.float64)
                values = self.values(sampler["output"]).astype(np.float64)
                self.tracks[channel["target"]["node"], channel["target"]["path"]] = times, values
        self.duration = max(times[-1] for times, _ in self.tracks.values())

    def values(self, index):
        accessor = dict(self.gltf["accessors"][index])
        normalized = accessor.pop("normalized", False)
        values = glb.accessor({**self.gltf, "accessors": {index: accessor}}, self.binary, index)
        return values / 255.0 if normalized else values

    def own(self, index, time):
        node = self.gltf["nodes"][index]
        parts = []
        for path, rest in (("translation", (0, 0, 0)), ("rotation", (0, 0, 0, 1)), ("scale", (1, 1, 1))):
            if (index, path) not in self.tracks:
                parts.append(node.get(path, rest))
                continue
            times, values = self.tracks[index, path]
            at = time % self.duration
            k = int(np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2))
            u = (at - times[k]) / (times[k + 1] - times[k])
            a, b = values[k], values[k + 1]
            parts.append(slerp(a, b, u) if path == "rotation" else a + (b - a) * u)
        return glb.transform(*parts)

    def chains(self):
        """The nodes from a root to each node."""
        stack = [(root, ()) for root in self.gltf["scenes"][0]["nodes"]]
        while stack:
            index, above = stack.pop()
            yield (*above, index)
            stack.extend((child, (*above, index)) for child in self.gltf["nodes"][index].get("children", []))

    def from_node(self, chain, time):
        matrix = np.eye(4)
        for index in chain:
            matrix = matrix @ self.own(index, time)
        return matrix


def slerp(a, b, u):
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    dot = a @ b
    if dot < 0:
        b, dot = -b, -dot
    angle = np.arctan2(np.linalg.norm(b - a * dot), dot)
    return a if angle < 1e-12 else (np.sin((1 - u) * angle) * a + np.sin(u * angle) * b) / np.sin(angle)


class Part:
    """Triangles that move as one, and Open3D's tracer of them. `place` is world_from_part at a time."""

    def __init__(self, name, vertices, triangles, place, moved=0.0):
        self.name, self.vertices, self.triangles, self.place, self.moved = name, vertices, triangles, place, moved
        self.tracer = o3d.t.geometry.RaycastingScene()
        self.tracer.add_triangles(
            o3d.core.Tensor(vertices.astype(np.float32)), o3d.core.Tensor(triangles.astype(np.uint32))
        )

    def cast(self, origins, directions, times):
        """For each ray, the range in f64 of the plane of the triangle that Open3D says it hits first, how uncertain the range
        is."""
        if len(origins) == 0:
            return np.zeros(0), np.zeros(0)
        if callable(self.place):
            known, which = np.unique(times, return_inverse=True)
            inverse = np.array([np.linalg.inv(self.place(time)) for time in known])[which]
            o = np.einsum("nij,nj->ni", inverse[:, :3, :3], origins) + inverse[:, :3, 3]
            d = np.einsum("nij,nj->ni", inverse[:, :3, :3], directions)
        else:
            o, d = origins - self.place, directions
        answer = self.tracer.cast_rays(o3d.core.Tensor(np.concatenate([o, d], -1).astype(np.float32)))
        hit = np.isfinite(answer["t_hit"].numpy())
        t, allowed = np.full(len(o), np.inf), np.zeros(len(o))
        triangle = answer["primitive_ids"].numpy()[hit].astype(np.int64)
        a, b, c = np.moveaxis(self.vertices[self.triangles[triangle]], 1, 0)
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        slope = np.einsum("ni,ni->n", d[hit], normal)
        t[hit] = np.einsum("ni,ni->n", a - o[hit], normal) / slope
        moved = self.moved[triangle] if np.ndim(self.moved) else self.moved
        allowed[hit] = U * t[hit] + 1e-6 + moved / np.abs(slope)
        return t, allowed


class Bending:
    """A part that has another shape in each slice of time. `ends` are the times at which one slice ends and the next begins."""

    def __init__(self, name, ends, shapes):
        self.name, self.ends, self.shapes = name, ends, shapes

    def cast(self, origins, directions, times):
        t, allowed = np.full(len(origins), np.inf), np.zeros(len(origins))
        number = np.searchsorted(self.ends, times, side="right")
        for slice_ in np.unique(number):
            rays_of = number == slice_
            t[rays_of], allowed[rays_of] = self.shapes[slice_].cast(origins[rays_of], directions[rays_of], times[rays_of])
        return t, allowed


def slices(job, from_s, to_s):
    """The times at which the slices of a frame end, from its first pulse to its last: as few equal ones as are no longer than
    the job's `slice_s`."""
    longest = job.get("sequence", {}).get("slice_s", np.inf)
    count = max(int(np.ceil((to_s - from_s) / longest)), 1)
    return [from_s + (to_s - from_s) * (end / count) for end in range(count)] + [to_s]


def parts(path, job, world, from_s, to_s):
    """Everything that a frame whose first and last pulse have these times can see."""
    ends = slices(job, from_s, to_s)
    folder = os.path.dirname(path)
    scene = world.scene
    yield Part("scene", scene.vertices, scene.triangles, scene.centre, world.moved)
    for actor in job.get("actor", []):
        file = Animated(os.path.join(folder, actor["scene"]))
        trajectory = Trajectory(actor["trajectory"], folder)
        gltf = file.gltf

        def placed(chain, file=file, trajectory=trajectory):
            return lambda time: trajectory.at(time) @ glb.WORLD_FROM_GLTF @ file.from_node(chain, time)

        for chain in file.chains():
            node = gltf["nodes"][chain[-1]]
            if "mesh" not in node:
                continue
            name = f"{actor['name']}/{node['name']}"
            vertices, triangles, _ = glb.read_mesh(gltf, file.binary, gltf["meshes"][node["mesh"]])
            if "skin" not in node:
                yield Part(name, vertices, triangles, placed(chain))
                continue
            skin = gltf["skins"][node["skin"]]
            chains = {chain[-1]: chain for chain in file.chains()}
            inverse = file.values(skin["inverseBindMatrices"]).astype(np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
            # A primitive's vertices follow each other as `read_mesh` has them.
            attributes = [primitive["attributes"] for primitive in gltf["meshes"][node["mesh"]]["primitives"]]
            positions, weights, bones = (
                np.concatenate([file.values(each[key]) for each in attributes])
                for key in ("POSITION", "WEIGHTS_0", "JOINTS_0")
            )
            positions = positions.astype(np.float64)
            shapes = []
            for begin, end in zip(ends, ends[1:]):
                middle = begin / 2 + end / 2
                joints = [file.from_node(chains[joint], middle) @ bind for joint, bind in zip(skin["joints"], inverse)]
                blended = np.einsum("vk,vkij->vij", weights, np.array(joints)[bones])
                posed = np.einsum("vij,vj->vi", blended[:, :3, :3], positions) + blended[:, :3, 3]
                # A shape is kept in f32: half an ulp of at most 2 m in three components.
                shapes.append(Part(name, posed, triangles, placed(()), np.sqrt(3) * 2.0**-24))
            yield Bending(name, ends[1:-1], shapes)


def sensors(path, job):
    """(name, frame rate, rays in the sensor's frame, time of each column's pulse, world_from_sensor at a time, limits)."""
    folder = os.path.dirname(path)
    body = Trajectory(job.get("trajectory", {}), folder)
    for mounted, entry in zip(rays.sensors(path, {**job, "trajectory": {}}, np.zeros(3)), job["sensor"]):
        pose = rays.pose(entry.get("pose", {}))
        directions = mounted.directions @ pose[:3, :3]
        rows, columns = directions.shape[:2]
        if "rotating" in entry:
            rate = entry["rotating"]["rate_hz"]
            times = np.broadcast_to(np.arange(columns) / (columns * rate), (rows, columns))
        else:
            rate = entry["pinhole"]["rate_hz"]
            times = np.zeros((rows, columns))
        yield mounted, rate, directions, times, (lambda time, pose=pose: body.at(time) @ pose)


def nearest(everything, sensor, origins, directions, times):
    best, allowed = np.full(len(origins), np.inf), np.zeros(len(origins))
    name = np.full(len(origins), "nothing", dtype=object)
    for part in everything:
        t, uncertain = part.cast(origins, directions, times)
        nearer = t < best
        best[nearer], allowed[nearer], name[nearer] = t[nearer], uncertain[nearer], part.name
    limited = best * sensor.limited.reshape(-1)
    out = (limited < sensor.min_m) | (limited > sensor.max_m)
    best[out], name[out] = np.inf, "nothing"
    return best, allowed, name


def compare(path, job, world, frame, images):
    """For each sensor a row of a table, and what is wrong. `images` gives a sensor's EXR of the frame."""
    for sensor, rate, directions, times, place in sensors(path, job):
        start_s = job.get("sequence", {}).get("start_s", 0.0) + frame / rate
        at = (start_s + times).reshape(-1)
        known, which = np.unique(at, return_inverse=True)
        poses = np.array([place(time) for time in known])[which]
        origins = poses[:, :3, 3]
        turned = np.einsum("nij,nj->ni", poses[:, :3, :3], directions.reshape(-1, 3))
        everything = list(parts(path, job, world, at.min(), at.max()))
        theirs, allowed, names = nearest(everything, sensor, origins, turned, at)
        ours = images(sensor.name)["range"].reshape(-1).astype(np.float64)

        def agree(theirs, allowed, rows=slice(None)):
            with np.errstate(invalid="ignore"):
                return (np.isinf(theirs) & np.isinf(ours[rows])) | (np.abs(theirs - ours[rows]) <= allowed)

        same = agree(theirs, allowed)
        others = np.flatnonzero(~same)
        explained = np.zeros(len(others), bool)
        right = np.cross(turned[others], [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right, axis=1, keepdims=True)
        up = np.cross(right, turned[others])
        limits = rays.Sensor(**vars(sensor) | {"limited": sensor.limited.reshape(-1)[others]})
        for eighth in range(8):
            x, y = np.cos(np.pi / 4 * eighth), np.sin(np.pi / 4 * eighth)
            near = turned[others] + TURNED * (x * right + y * up)
            near /= np.linalg.norm(near, axis=1, keepdims=True)
            t, uncertain, _ = nearest(everything, limits, origins[others], near, at[others])
            # A ray that is turned by an angle hits a plane farther by at most t·angle·tan θ; edge-on, the box says less.
            explained |= agree(t, uncertain + 50 * TURNED * np.where(np.isfinite(t), t, 0), others)
        hits = np.isfinite(theirs) & same
        moving = hits & (names != "scene")
        difference = np.abs(ours[hits] - theirs[hits])
        row = [str(len(ours)), str(int(np.isfinite(ours).sum())), str(int(moving.sum())), str(len(others)),
               str(int(explained.sum())), f"{difference.max(initial=0):.2e}", f"{(difference / allowed[hits]).max(initial=0):.3f}"]
        problems = []
        if len(others) > SHARE * len(ours):
            problems.append(f"{len(others)} of {len(ours)} rays see other triangles: more than edges explain")
        for ray in others[~explained][:10]:
            pixel = divmod(int(ray), directions.shape[1])
            problems.append(f"pixel {pixel}: {ours[ray]:.9g} m, Open3D {theirs[ray]:.9g} m on {names[ray]}")
        if moving.sum() < 20:
            problems.append("hardly any ray hits anything that moves")
        yield sensor.name, row, problems


def write_tables(path, job, world, frame, pixels):
    """For each sensor the ranges of some pixels of a frame as Open3D has them, with what a right answer may differ by. Up to half
    of them are on what moves."""
    for sensor, rate, directions, times, place in sensors(path, job):
        start_s = job.get("sequence", {}).get("start_s", 0.0) + frame / rate
        at = (start_s + times).reshape(-1)
        known, which = np.unique(at, return_inverse=True)
        poses = np.array([place(time) for time in known])[which]
        turned = np.einsum("nij,nj->ni", poses[:, :3, :3], directions.reshape(-1, 3))
        everything = list(parts(path, job, world, at.min(), at.max()))
        t, allowed, names = nearest(everything, sensor, poses[:, :3, 3], turned, at)
        # A ray whose neighbours see another part, or another depth, is near an edge.
        calm = np.ones(len(t), bool)
        right = np.cross(turned, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right, axis=1, keepdims=True)
        up = np.cross(right, turned)
        for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            near = turned + TURNED * (x * right + y * up)
            near /= np.linalg.norm(near, axis=1, keepdims=True)
            other, _, other_names = nearest(everything, sensor, poses[:, :3, 3], near, at)
            with np.errstate(invalid="ignore"):
                calm &= (names == other_names) & (np.isinf(t) | (np.abs(t - other) <= 20 * TURNED * t))
        chosen = []
        is_still = (names == "scene") | (names == "nothing")
        for these, most in ((calm & ~is_still, pixels // 2), (calm & is_still, pixels)):
            these = np.flatnonzero(these)
            count = min(most - len(chosen), len(these))
            chosen.extend(these[np.arange(count) * len(these) // max(count, 1)])
        stem = os.path.splitext(os.path.basename(path))[0]
        name = os.path.join(os.path.dirname(os.path.abspath(__file__)), f"{stem}.{sensor.name}.{frame:06}.tsv")
        with open(name, "w", newline="\n") as file:
            print("row\tcolumn\trange_m\ttolerance_m", file=file)
            for ray in sorted(chosen):
                row, column = divmod(int(ray), directions.shape[1])
                if np.isfinite(t[ray]):
                    # The last digit is rounded, too.
                    print(f"{row}\t{column}\t{t[ray]:.7f}\t{allowed[ray] + 1e-7:.1e}", file=file)
                else:
                    print(f"{row}\t{column}\tinf\t0", file=file)
        print(f"{name}: {len(chosen)} pixels, {np.isfinite(t[chosen]).sum()} hits")
