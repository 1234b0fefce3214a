"""The four scenes of the benchmark, and the rays that are cast in them, made from fixed seeds."""

import json
import struct
from pathlib import Path

import numpy as np


# ---------------------------------------------------------------------------------------------------------------- meshes


def merge(parts):
    """(vertices, triangles) of several."""
    vertices, triangles, first = [], [], 0
    for v, t in parts:
        vertices.append(np.asarray(v, np.float32))
        triangles.append(np.asarray(t, np.uint32) + np.uint32(first))
        first += len(v)
    return np.concatenate(vertices), np.concatenate(triangles)


def box(low, high):
    low, high = np.asarray(low, float), np.asarray(high, float)
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return low + corners * (high - low), triangles


def grid(points):
    """A sheet over an array of points (rows, columns, 3)."""
    rows, columns, _ = points.shape
    at = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]
    triangles = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], -2)
    return points.reshape(-1, 3), triangles.reshape(-1, 3)


def blob(centre, radii, detail, rough, rng):
    """A closed lump: a sphere of `detail` rows with a rough surface."""
    polar = np.linspace(0.02, np.pi - 0.02, detail)[:, None]
    turn = np.linspace(0, 2 * np.pi, 2 * detail)[None, :]
    radius = 1 + rough * rng.standard_normal((detail, 2 * detail))
    radius[:, -1] = radius[:, 0]
    unit = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar) + 0 * turn], -1)
    return grid(np.asarray(centre) + unit * radius[..., None] * np.asarray(radii))


def room():
    """A furnished room: 612 triangles."""
    rng = np.random.default_rng(1)
    parts = [box((-5, -4, 0), (5, 4, 3))]
    for _ in range(50):
        centre = np.array([*rng.uniform((-4.5, -3.5), (4.5, 3.5)), 0])
        if np.hypot(*centre[:2]) < 1.5:  # where the sensor stands
            centre[:2] *= 2 / np.hypot(*centre[:2])
        size = rng.uniform((0.2, 0.2, 0.3), (0.8, 0.8, 2.0))
        parts.append(box(centre - size * (0.5, 0.5, 0), centre + size * (0.5, 0.5, 1)))
    return merge(parts)


def street():
    """A street 200 m long: ground, facades with relief, cars, poles, trees; about a million triangles."""
    rng = np.random.default_rng(2)
    x, y = np.meshgrid(np.linspace(-100, 100, 401), np.linspace(-30, 30, 241), indexing="ij")
    parts = [grid(np.stack([x, y, 0.03 * np.sin(x) * np.cos(y)], -1))]
    for side in (-1, 1):
        for k in range(14):
            left = -98 + 14 * k
            width, height, front = 13, rng.uniform(8, 24), 11 + rng.uniform(0, 2)
            u, v = np.meshgrid(np.linspace(0, width, 131), np.linspace(0, height, 91), indexing="ij")
            window = ((u % 2.6) > 0.8) & ((v % 3.1) > 1.1)
            depth = np.where(window, 0.25, 0.0) + 0.01 * rng.standard_normal(u.shape)
            parts.append(grid(np.stack([left + u, side * (front + depth), v], -1)))
            back = sorted((side * front, side * (front + 12)))
            parts.append(box((left, back[0], height - 0.2), (left + width, back[1], height)))
    for _ in range(40):
        where = (rng.uniform(-95, 95), rng.choice((-1, 1)) * rng.uniform(3.5, 7), 0.8)
        parts.append(blob(where, (2.2, 0.9, 0.7), 40, 0.004, rng))
    for k in range(50):
        x, y = -98 + 4 * k, 9.5 * (-1) ** k
        parts.append(blob((x, y, 3), (0.08, 0.08, 3.2), 24, 0.0, rng))
        if k % 2:
            parts.append(blob((x, y, 6.5), (1.8, 1.8, 1.6), 46, 0.08, rng))
    return merge(parts)


def forest():
    """Two million thin triangles, each on its own, as needles and twigs are."""
    rng = np.random.default_rng(3)
    n = 2_000_000
    middle = rng.uniform((-100, -100, 0), (100, 100, 30), (n, 3))
    keep = np.linalg.norm(middle[:, :2], axis=1) > 2
    middle[~keep, :2] += 10
    along = rng.standard_normal((n, 3))
    along *= (rng.uniform(0.05, 0.3, (n, 1)) / np.linalg.norm(along, axis=1, keepdims=True))
    across = rng.standard_normal((n, 3))
    across *= 0.01 / np.linalg.norm(across, axis=1, keepdims=True)
    vertices = np.stack([middle - along, middle + along, middle + along + across], 1).reshape(-1, 3)
    return vertices.astype(np.float32), np.arange(3 * n, dtype=np.uint32).reshape(-1, 3)


def terrain():
    """A fractal landscape of 8 million triangles, two kilometres across."""
    rng = np.random.default_rng(4)
    n = 2001
    height = np.zeros((n, n))
    cells, amplitude = 4, 120.0
    while cells <= 2048:
        knots = rng.standard_normal((cells + 2, cells + 2))
        at = np.linspace(0, cells, n)
        k = np.minimum(at.astype(int), cells)
        f = at - k
        f = f * f * (3 - 2 * f)
        rows = knots[k] * (1 - f)[:, None] + knots[np.minimum(k + 1, cells + 1)] * f[:, None]
        height += amplitude * (rows[:, k] * (1 - f) + rows[:, np.minimum(k + 1, cells + 1)] * f)
        cells, amplitude = cells * 2, amplitude * 0.47
    x, y = np.meshgrid(np.linspace(-1000, 1000, n), np.linspace(-1000, 1000, n), indexing="ij")
    return tuple(a.astype(t) for a, t in zip(grid(np.stack([x, y, height], -1)), (np.float32, np.uint32)))


SCENES = {"room": room, "street": street, "forest": forest, "terrain": terrain}


def refined(triangles):
    """A rough sheet of about that many triangles, for the scaling table."""
    rng = np.random.default_rng(5)
    side = max(2, round((triangles / 2) ** 0.5) + 1)
    x, y = np.meshgrid(np.linspace(-50, 50, side), np.linspace(-50, 50, side), indexing="ij")
    rough = 10.0 * np.sin(x / 9) * np.cos(y / 7) + rng.standard_normal(x.shape) * 20.0 / side
    return tuple(a.astype(t) for a, t in zip(grid(np.stack([x, y, rough - 12], -1)), (np.float32, np.uint32)))


def write_glb(path, vertices, triangles):
    blob = triangles.astype("<u4").tobytes() + vertices.astype("<f4").tobytes()
    offset = triangles.size * 4
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": Path(path).stem}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 1}, "indices": 0}]}],
        "buffers": [{"byteLength": len(blob)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": offset},
            {"buffer": 0, "byteOffset": offset, "byteLength": len(blob) - offset},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5125, "count": triangles.size, "type": "SCALAR"},
            {
                "bufferView": 1,
                "componentType": 5126,
                "count": len(vertices),
                "type": "VEC3",
                "min": vertices.min(0).tolist(),
                "max": vertices.max(0).tolist(),
            },
        ],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + len(blob)
    with open(path, "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, total))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text)
        file.write(struct.pack("<I4s", len(blob), b"BIN\0"))
        file.write(blob)


def read_glb(path):
    """What write_glb wrote, as views of one buffer."""
    data = np.fromfile(path, np.uint8)
    length = int(data[12:16].view("<u4")[0])
    document = json.loads(data[20 : 20 + length].tobytes())
    body = data[20 + length + 8 :]
    triangles, vertices = document["accessors"]
    split = document["bufferViews"][1]["byteOffset"]
    return (
        body[split:].view("<f4").reshape(vertices["count"], 3),
        body[:split].view("<u4").reshape(triangles["count"] // 3, 3),
    )


# ------------------------------------------------------------------------------------------------------------------ rays


def eye(name, vertices):
    """Where the sensor stands: 1.8 m above what is below it."""
    if name in ("room", "street", "forest"):
        return np.array([0.1, 0.2, 1.8])
    near = np.argmin((vertices[:, 0] - 0.1) ** 2 + (vertices[:, 1] - 0.2) ** 2)
    return np.array([0.1, 0.2, float(vertices[near, 2]) + 1.8])


def tiled(image, rows, columns):
    """The pixels of an image (rows first) in tiles: tile by tile, each row by row."""
    height, width = image.shape[:2]
    order = np.arange(height * width).reshape(height, width)
    blocks = [
        order[r : r + rows, c : c + columns].ravel()
        for r in range(0, height, rows)
        for c in range(0, width, columns)
    ]
    return image.reshape(height * width, -1)[np.concatenate(blocks)]


def spherical(elevation, azimuth):
    e, a = np.radians(elevation), np.radians(azimuth)
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e) + 0 * a], -1)


def lidar():
    """128 beams by 2048 columns."""
    return spherical(np.linspace(22.5, -22.5, 128)[:, None], 180 - np.arange(2048)[None, :] * 360 / 2048)


def camera():
    """1920 × 1080, 90° wide."""
    u, v = np.meshgrid((np.arange(1920) + 0.5 - 960) / 960, (np.arange(1080) + 0.5 - 540) / 960)
    d = np.stack([np.ones_like(u), -u, -v], -1)
    return d / np.linalg.norm(d, axis=-1, keepdims=True)


def rays(kind, at, seen=None):
    """(directions, origins) of a kind of rays; f64 arrays whose values are f32's, so that both tracers get the same."""
    if kind == "camera":
        directions, origins = tiled(camera(), 8, 8), at[None]
    elif kind == "LiDAR":
        directions, origins = tiled(lidar(), 8, 8), at[None]
    elif kind == "moving LiDAR":
        # 10 m/s forward, 10 turns a second: an origin a column.
        directions = lidar()
        origins = at + np.array([1.0, 0.1, 0.0]) * (np.arange(2048) / 2048)[None, :, None] + np.zeros((128, 1, 1))
        directions, origins = tiled(directions, 8, 8), tiled(origins, 8, 8)
    else:
        # From the points that the LiDAR saw, in no order, to anywhere above the surface as good as random.
        rng = np.random.default_rng(6)
        d, t = seen
        hit = np.isfinite(t)
        points = at + d[hit] * t[hit, None]
        directions = rng.standard_normal((len(points), 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        towards = -d[hit]
        directions *= np.where((directions * towards).sum(1) < 0, -1, 1)[:, None]
        order = rng.permutation(len(points))
        directions, origins = directions[order], (points + (1e-3 + 1e-3 * t[hit, None]) * towards)[order]
    single = lambda a: np.ascontiguousarray(a, np.float32).astype(np.float64)
    return single(directions), single(origins)


def write_rays(path, directions, origins):
    with open(path, "wb") as file:
        file.write(struct.pack("<QQ", len(directions), len(origins)))
        file.write(directions.astype("<f8").tobytes())
        file.write(origins.astype("<f8").tobytes())
