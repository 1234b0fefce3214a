"""Reads the shipped scenes (binary glTF) with numpy alone: an independent reader, so that beamcast's is checked too.

Knows what the shipped scenes use: indexed float triangles, node trees with TRS or matrices, nodes that share a mesh,
EXT_mesh_gpu_instancing. Anything else is an error, never a guess.
"""

import json
import struct
from dataclasses import dataclass

import numpy as np

COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}
# glTF's y up to the world's z up: (x, y, z)_world = (x, -z, y)_glTF.
WORLD_FROM_GLTF = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], dtype=np.float64)


@dataclass
class Scene:
    """All triangles of a scene, each as often as it is placed, about the scene's centre.

    centre      (3,) f64, the world position of the space's origin
    vertices    (V, 3) f64, as beamcast's arithmetic places them: what is placed once is rounded to f32 there, what is
                placed many times is not (it stays in its own space)
    triangles   (T, 3) indices
    shared      (T,) whether the triangle's mesh is placed more than once
    first       (P + 1,) first triangle of each placement, in document order
    names       P names of nodes
    labels      (P,) semantic labels, 0 where there is none
    reflectivity (T,) of the materials
    """

    centre: np.ndarray
    vertices: np.ndarray
    triangles: np.ndarray
    shared: np.ndarray
    first: np.ndarray
    names: list
    labels: np.ndarray
    reflectivity: np.ndarray


def load(path, up="z"):
    gltf, binary = parse(path)
    meshes = [read_mesh(gltf, binary, mesh) for mesh in gltf["meshes"]]
    placed = place(gltf, binary, WORLD_FROM_GLTF if up == "z" else np.eye(4))
    return build(meshes, placed)


def parse(path):
    data = open(path, "rb").read()
    magic, version, length = struct.unpack_from("<4sII", data)
    if magic != b"glTF" or version != 2 or length != len(data):
        raise ValueError(f"{path}: not a GLB of version 2 and its own length")
    chunks, at = {}, 12
    while at < length:
        size, kind = struct.unpack_from("<I4s", data, at)
        chunks[kind] = data[at + 8 : at + 8 + size]
        at += 8 + size
    gltf = json.loads(chunks[b"JSON"])
    unknown = set(gltf.get("extensionsRequired", [])) - {"EXT_mesh_gpu_instancing"}
    if unknown:
        raise ValueError(f"{path}: requires {sorted(unknown)}, which this reader does not know")
    return gltf, chunks[b"BIN\0"]


def accessor(gltf, binary, index):
    a = gltf["accessors"][index]
    view = gltf["bufferViews"][a["bufferView"]]
    if "sparse" in a or a.get("normalized") or "byteStride" in view:
        raise ValueError(f"accessor {index}: sparse, normalised or strided data is not in the shipped scenes")
    width = WIDTHS[a["type"]]
    start = view.get("byteOffset", 0) + a.get("byteOffset", 0)
    values = np.frombuffer(binary, COMPONENTS[a["componentType"]], a["count"] * width, start)
    return values.reshape(-1, width) if width > 1 else values


def read_mesh(gltf, binary, mesh):
    vertices, triangles, colors, base = [], [], [], 0
    for primitive in mesh["primitives"]:
        if primitive.get("mode", 4) != 4:
            raise ValueError(f"mesh {mesh.get('name')}: only triangle lists are in the shipped scenes")
        positions = accessor(gltf, binary, primitive["attributes"]["POSITION"])
        indices = accessor(gltf, binary, primitive["indices"]).astype(np.int64).reshape(-1, 3)
        vertices.append(positions.astype(np.float64))
        triangles.append(indices + base)
        base += len(positions)
        material = gltf["materials"][primitive["material"]]
        color = material["pbrMetallicRoughness"]["baseColorFactor"]
        colors.append(np.full(len(indices), np.dot(color[:3], [0.2126, 0.7152, 0.0722])))
    return np.concatenate(vertices), np.concatenate(triangles), np.concatenate(colors)


def rotation(q):
    x, y, z, w = np.asarray(q, np.float64) / np.linalg.norm(np.asarray(q, np.float64))
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def transform(translation=(0, 0, 0), turn=(0, 0, 0, 1), scale=(1, 1, 1)):
    matrix = np.eye(4)
    matrix[:3, :3] = rotation(turn) * np.asarray(scale, np.float64)
    matrix[:3, 3] = translation
    return matrix


def place(gltf, binary, root):
    """(mesh, world_from_mesh, name, label) of each placement, depth first from the scene's roots."""
    placed = []
    nodes = gltf["nodes"]
    stack = [(n, root, 0) for n in reversed(gltf["scenes"][gltf.get("scene", 0)]["nodes"])]
    while stack:
        index, above, label = stack.pop()
        node = nodes[index]
        if "matrix" in node:
            own = np.array(node["matrix"], np.float64).reshape(4, 4).T
        else:
            own = transform(
                node.get("translation", (0, 0, 0)), node.get("rotation", (0, 0, 0, 1)), node.get("scale", (1, 1, 1))
            )
        world = above @ own
        label = node.get("extras", {}).get("label", label)
        if "mesh" in node:
            name = node.get("name", "")
            instancing = node.get("extensions", {}).get("EXT_mesh_gpu_instancing")
            if instancing is None:
                placed.append((node["mesh"], world, name, label))
            else:
                attributes = {k: accessor(gltf, binary, v) for k, v in instancing["attributes"].items()}
                count = len(next(iter(attributes.values())))
                for i in range(count):
                    keys = {"TRANSLATION": "translation", "ROTATION": "turn", "SCALE": "scale"}
                    each = transform(**{keys[k]: values[i] for k, values in attributes.items()})
                    placed.append((node["mesh"], world @ each, name, label))
        stack.extend((child, world, label) for child in reversed(node.get("children", [])))
    return placed


def apply(matrix, points):
    x, y, z = points[:, 0:1], points[:, 1:2], points[:, 2:3]
    return matrix[:3, 0] * x + matrix[:3, 1] * y + matrix[:3, 2] * z + matrix[:3, 3]


def build(meshes, placed):
    uses = np.bincount([p[0] for p in placed], minlength=len(meshes))
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for mesh, world, _, _ in placed:
        vertices, triangles, _ = meshes[mesh]
        corners = vertices[np.unique(triangles)]
        if uses[mesh] > 1:
            bounds = np.stack([corners.min(0), corners.max(0)])
            corners = np.array([[bounds[i, 0], bounds[j, 1], bounds[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
        points = apply(world, corners)
        low, high = np.minimum(low, points.min(0)), np.maximum(high, points.max(0))
    centre = scene_centre(low, high)

    all_vertices, all_triangles, shared, first, names, labels, colors = [], [], [], [0], [], [], []
    base = 0
    for mesh, world, name, label in placed:
        vertices, triangles, color = meshes[mesh]
        about_centre = world.copy()
        about_centre[:3, 3] -= centre
        points = apply(about_centre, vertices)
        if uses[mesh] == 1:
            points = np.float64(np.float32(points))
        if np.linalg.det(world[:3, :3]) < 0:
            triangles = triangles[:, [0, 2, 1]]
        all_vertices.append(points)
        all_triangles.append(triangles + base)
        base += len(points)
        shared.append(np.full(len(triangles), uses[mesh] > 1))
        colors.append(color)
        first.append(first[-1] + len(triangles))
        names.append(name)
        labels.append(label)
    return Scene(
        centre,
        np.concatenate(all_vertices),
        np.concatenate(all_triangles),
        np.concatenate(shared),
        np.array(first),
        names,
        np.array(labels),
        np.concatenate(colors),
    )


def scene_centre(low, high):
    """The middle of the bounds, rounded to a multiple of a sixteenth of the power of two below the half extent."""
    half_extent = ((high - low) / 2).max()
    middle = low / 2 + high / 2
    grid = 2.0 ** (np.frexp(half_extent)[1] - 1) / 16
    # Halves away from zero.
    return np.sign(middle) * np.floor(np.abs(middle) / grid + 0.5) * grid
