"""Scenes that rays of arrays are cast at."""

from __future__ import annotations

import os
from collections.abc import Iterable
from os import PathLike
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._native import NativeScene

INVALID_ID = 0xFFFFFFFF
"""The geometry and the primitive of a ray that hits nothing, as in Open3D."""

Rays = ArrayLike | tuple[ArrayLike, ArrayLike]


class Scene:
    """Triangles that rays are cast at, with the interface of Open3D's `RaycastingScene`.

    A scene is made of a glTF file (`Scene("street.glb")`), of arrays (`Scene(vertices, triangles)`), or mesh by mesh with
    `add_triangles`, as in Open3D. What a ray hits is decided exactly: rays neither pass between two triangles that share an edge nor
    hit a triangle that they miss by a hair.

    Rays are an array (…, 6) of float32 or float64, each with its origin x, y, z and its direction x, y, z; or a pair
    `(origins, directions)` of arrays (…, 3), of which one may be (3,) for all rays. Directions need not have length 1: depths count in
    lengths of the direction, so they are metres where it has length 1. A ray with a NaN, or without a direction, hits nothing. The
    pixels of an image, (…, rows, columns, 6), are cast faster than the same rays in one row, because neighbours go together.

    The methods may be called from several threads. They let other threads of Python run while they work, and Ctrl-C stops them.
    A scene is pickled as what it was made of: its arrays, or the path of its file. `threads` (Open3D's `nthreads`) is the number of threads to work on, 0 or None for one a core; results do not depend on it.
    """

    INVALID_ID = INVALID_ID

    def __init__(
        self,
        source: str | PathLike[str] | ArrayLike | None = None,
        triangles: ArrayLike | None = None,
        *,
        up: str = "z",
        allowed_folders: Iterable[str | PathLike[str]] | None = None,
        threads: int | None = None,
    ) -> None:
        """Makes a scene.

        Args:
            source: The path of a .gltf or .glb file, or vertices (n, 3) in metres; without it, the scene has no triangles yet.
            triangles: With vertices, the triangles (m, 3): indices of vertices.
            up: Of a file, the axis of the world that the file's y axis becomes: "z", or "y" to keep its axes.
            allowed_folders: Of a file, folders besides its own that its buffers may lie in.
            threads: The threads to read and build with.

        Raises:
            SceneError: The file can't be read.
            TypeError, ValueError: The arrays are no mesh.
        """
        self._file: tuple[str, str, list[str]] | None = None
        if isinstance(source, (str, PathLike)):
            if triangles is not None:
                raise TypeError("the triangles of a file are in the file")
            folders = [os.path.abspath(os.fspath(folder)) for folder in allowed_folders or ()]
            self._file = (os.path.abspath(os.fspath(source)), up, folders)
            self._native = NativeScene.of_file(source, up, folders, threads)
            return
        self._native = NativeScene()
        if source is not None:
            if triangles is None:
                raise TypeError("vertices need triangles")
            self.add_triangles(source, triangles)
        elif triangles is not None:
            raise TypeError("triangles need vertices")

    def __reduce__(self) -> tuple[Any, ...]:
        if self._file is not None:
            return _of_file, self._file
        meshes = [(v.reshape(-1, 3), t.reshape(-1, 3)) for v, t in self._native.meshes()]
        return _of_meshes, (meshes,)

    def add_triangles(self, vertex_positions: ArrayLike, triangle_indices: ArrayLike | None = None) -> int:
        """Adds a mesh.

        Args:
            vertex_positions: Vertices (n, 3) in metres, float32 or float64. Those of float32, and those of float64 that are numbers of
                float32, are taken as they are; others are rounded to 32 bits about the middle of the scene. Or a mesh that has
                `vertex.positions` and `triangle.indices` (Open3D's tensor meshes) or `vertices` and `faces` (trimesh).
            triangle_indices: Triangles (m, 3): indices of vertices, of any integer type, counter-clockwise seen from the front.

        Returns:
            The id of the mesh, which counts from 0.

        Raises:
            TypeError, ValueError: The arrays have another type or shape, a vertex is not finite, or an index is none of a vertex.
        """
        if triangle_indices is None:
            vertex_positions, triangle_indices = _parts_of_mesh(vertex_positions)
        vertices = _floats(vertex_positions, "vertices")
        triangles = np.asarray(triangle_indices)
        if triangles.size == 0:
            triangles = np.zeros((0, 3), np.uint32)
        if triangles.ndim != 2 or triangles.shape[1] != 3:
            raise ValueError(f"triangles have the shape {triangles.shape}: expected (m, 3)")
        if not np.issubdtype(triangles.dtype, np.integer):
            raise TypeError(f"triangles are {triangles.dtype}: expected integers")
        if triangles.size and (int(triangles.min()) < 0 or int(triangles.max()) >= len(vertices)):
            wrong = int(triangles.min()) if int(triangles.min()) < 0 else int(triangles.max())
            raise ValueError(f"a triangle has the corner {wrong}, and there are {len(vertices)} vertices")
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise ValueError(f"vertices have the shape {vertices.shape}: expected (n, 3)")
        return self._native.add_triangles(vertices, np.require(triangles, np.uint32, _LAYOUT))

    def cast_rays(self, rays: Rays, nthreads: int = 0, *, threads: int | None = None) -> dict[str, NDArray[Any]]:
        """Casts rays, and tells what each hits first.

        Args:
            rays: Rays (…, 6), or a pair of origins and directions (…, 3).
            nthreads: As in Open3D.
            threads: The same.

        Returns:
            Arrays of the shape (…) of the rays:
            `t_hit` float32, the depth in lengths of the direction, inf where nothing is hit;
            `t_hit_f64` float64, the same before it is rounded;
            `geometry_ids` uint32, the mesh (of a file: the object, from 0), `INVALID_ID` where nothing is hit;
            `primitive_ids` uint32, the triangle in its mesh (of a file: in the whole scene, from 0), `INVALID_ID` where nothing is hit;
            `primitive_uvs` float32 (…, 2), the barycentric weights of the triangle's second and third corner;
            `primitive_normals` float32 (…, 3), its unit normal, on the side from which its corners are counter-clockwise.
            The last two are 0 where nothing is hit.

        Raises:
            TypeError, ValueError: The arrays have another type or shape.
        """
        first, second, shape = _rays(rays)
        columns = shape[-1] if len(shape) >= 2 else 0
        found = self._native.cast_rays(first, second, columns, _threads(nthreads, threads))
        more = {"primitive_uvs": (2,), "primitive_normals": (3,)}
        return {name: values.reshape(shape + more.get(name, ())) for name, values in found.items()}

    def test_occlusions(
        self,
        rays: Rays,
        tnear: float = 0.0,
        tfar: float = float("inf"),
        nthreads: int = 0,
        *,
        threads: int | None = None,
    ) -> NDArray[np.bool_]:
        """Tells of each ray whether it hits anything.

        Args:
            rays: Rays (…, 6), or a pair of origins and directions (…, 3). With `b - a` as a direction and `tfar=1`, this is whether
                anything is between the points a and b.
            tnear: The least depth that counts, in lengths of the direction, included.
            tfar: The largest, included.
            nthreads: As in Open3D.
            threads: The same.

        Returns:
            A boolean array of the shape (…) of the rays.
        """
        first, second, shape = _rays(rays)
        found = self._native.test_occlusions(first, second, float(tnear), float(tfar), _threads(nthreads, threads))
        return found.reshape(shape)

    def count_intersections(self, rays: Rays, nthreads: int = 0, *, threads: int | None = None) -> NDArray[np.int32]:
        """Counts how often each ray goes through a surface, on its whole way.

        A ray through an edge or a vertex goes through the surface once there, though it hits all the triangles that share it: hits of
        one mesh whose depths are the same number of 32 bits count once, as in Open3D. Of a closed mesh, an odd number means that the
        origin is inside.

        Args:
            rays: Rays (…, 6), or a pair of origins and directions (…, 3).
            nthreads: As in Open3D.
            threads: The same.

        Returns:
            An int32 array of the shape (…) of the rays.
        """
        first, second, shape = _rays(rays)
        splits = self._native.list_intersections(first, second, _threads(nthreads, threads))["ray_splits"]
        return np.diff(splits).astype(np.int32).reshape(shape)

    def list_intersections(
        self, rays: Rays, nthreads: int = 0, *, threads: int | None = None
    ) -> dict[str, NDArray[Any]]:
        """Lists everything that each ray goes through, as `count_intersections` counts it.

        Args:
            rays: Rays (…, 6), or a pair of origins and directions (…, 3).
            nthreads: As in Open3D.
            threads: The same.

        Returns:
            Arrays of the length m of all intersections, ray by ray, and those of a ray in ascending order of depth:
            `ray_ids` uint32, the number of the ray if the rays are flattened;
            `t_hit` float32, `t_hit_f64` float64, `geometry_ids` and `primitive_ids` uint32, `primitive_uvs` float32 (m, 2), as
            `cast_rays` has them;
            and `ray_splits` int64 with one entry more than there are rays: those of ray i are from `ray_splits[i]` to before
            `ray_splits[i + 1]`.
        """
        first, second, _ = _rays(rays)
        found = self._native.list_intersections(first, second, _threads(nthreads, threads))
        found["primitive_uvs"] = found["primitive_uvs"].reshape(-1, 2)
        return found

    @property
    def triangle_count(self) -> int:
        """The number of triangles that rays can hit: those of zero area are left out."""
        return self._native.triangle_count(None)

    @property
    def object_names(self) -> list[str]:
        """Of a scene of a file, the names of the objects that `geometry_ids` count."""
        return self._native.object_names()

    @staticmethod
    def create_rays_pinhole(
        intrinsic_matrix: ArrayLike | None = None,
        extrinsic_matrix: ArrayLike | None = None,
        width_px: int = 0,
        height_px: int = 0,
        *,
        fov_deg: float | None = None,
        center: ArrayLike | None = None,
        eye: ArrayLike | None = None,
        up: ArrayLike | None = None,
    ) -> NDArray[np.float32]:
        """The rays of a pinhole camera's pixels, through their centres at (column + ½, row + ½), as Open3D makes them.

        Args:
            intrinsic_matrix: The matrix (3, 3) of focal lengths and principal point in pixels.
            extrinsic_matrix: The motion (4, 4) from the world to the camera, which has x right, y down and z forward.
            width_px: Columns of the image.
            height_px: Rows of the image.
            fov_deg: In place of the matrices: the horizontal field of view in degrees, with
            center: the point that is in the middle of the image,
            eye: the camera's place, and
            up: the direction in which rows follow each other: Open3D's cameras stand on their heads.

        Returns:
            A float32 array (height_px, width_px, 6). The depth along such a ray is that along the camera's axis.
        """
        if fov_deg is not None:
            focal = 0.5 * width_px / np.tan(0.5 * np.radians(fov_deg))
            intrinsic = np.array([[focal, 0, 0.5 * width_px], [0, focal, 0.5 * height_px], [0, 0, 1]])
            place = np.asarray(eye, np.float64)
            forward = np.asarray(center, np.float64) - place
            forward = forward / np.linalg.norm(forward)
            right = np.cross(np.asarray(up, np.float64), forward)
            right = right / np.linalg.norm(right)
            camera_from_world = np.stack([right, np.cross(forward, right), forward])
            position = -camera_from_world @ place
        else:
            intrinsic = np.asarray(intrinsic_matrix, np.float64)
            extrinsic = np.asarray(extrinsic_matrix, np.float64)
            camera_from_world, position = extrinsic[:3, :3], extrinsic[:3, 3]
        columns, rows = np.meshgrid(np.arange(width_px) + 0.5, np.arange(height_px) + 0.5)
        pixels = np.stack([columns, rows, np.ones_like(columns)], -1)
        rays = np.empty((height_px, width_px, 6), np.float32)
        rays[..., :3] = -camera_from_world.T @ position
        rays[..., 3:] = pixels @ (camera_from_world.T @ np.linalg.inv(intrinsic)).T
        return rays


def _of_file(path: str, up: str, allowed_folders: list[str]) -> Scene:
    return Scene(path, up=up, allowed_folders=allowed_folders)


def _of_meshes(meshes: list[tuple[NDArray[Any], NDArray[np.uint32]]]) -> Scene:
    scene = Scene()
    for vertices, triangles in meshes:
        scene.add_triangles(vertices, triangles)
    return scene


_LAYOUT: list[Literal["C_CONTIGUOUS", "ALIGNED"]] = ["C_CONTIGUOUS", "ALIGNED"]


def _parts_of_mesh(mesh: Any) -> tuple[Any, Any]:
    """The vertices and triangles of a mesh of another library."""
    if hasattr(mesh, "vertex") and hasattr(mesh, "triangle"):
        return mesh.vertex["positions"].numpy(), mesh.triangle["indices"].numpy()
    if hasattr(mesh, "vertices") and hasattr(mesh, "faces"):
        return mesh.vertices, mesh.faces
    raise TypeError("expected vertices and triangles, or a mesh")


def _threads(nthreads: int, threads: int | None) -> int:
    return nthreads if threads is None else threads


def _floats(values: Any, what: str) -> NDArray[Any]:
    """An array of native float32 or float64, row by row in memory."""
    array = np.asarray(values)
    if array.dtype.kind != "f" or array.dtype.itemsize not in (4, 8):
        raise TypeError(f"{what} are {array.dtype}: expected float32 or float64")
    return np.require(array, array.dtype.newbyteorder("="), _LAYOUT)


def _rays(rays: Any) -> tuple[NDArray[Any], NDArray[Any] | None, tuple[int, ...]]:
    """Rays as the native half takes them, and the shape of the results."""
    if isinstance(rays, tuple) and len(rays) == 2:
        origins, directions = _floats(rays[0], "origins"), _floats(rays[1], "directions")
        for array, what in ((origins, "origins"), (directions, "directions")):
            if array.ndim == 0 or array.shape[-1] != 3:
                raise ValueError(f"{what} have the shape {array.shape}: expected (…, 3)")
        if origins.dtype != directions.dtype:
            origins, directions = origins.astype(np.float64), directions.astype(np.float64)
        shape = np.broadcast_shapes(origins.shape, directions.shape)
        if origins.size != 3 or shape != directions.shape:
            origins = _floats(np.broadcast_to(origins, shape), "origins")
        directions = _floats(np.broadcast_to(directions, shape), "directions")
        return origins.reshape(-1, 3), directions.reshape(-1, 3), shape[:-1]
    array = _floats(rays, "rays")
    if array.ndim == 0 or array.shape[-1] != 6:
        raise ValueError(f"rays have the shape {array.shape}: expected (…, 6)")
    return array.reshape(-1, 6), None, array.shape[:-1]
