"""trimesh's ray interface (`mesh.ray`) on beamcast: the same methods with the same results, for programs that call them.

    mesh = trimesh.load("part.stl")
    rays = RayMeshIntersector(mesh)
    points, ray_indices, triangles = rays.intersects_location(origins, directions)
"""

import numpy as np

import beamcast


class RayMeshIntersector:
    """Casts rays at a mesh of trimesh. Origins and directions are arrays (n, 3)."""

    def __init__(self, mesh):
        self.mesh = mesh
        self.scene = beamcast.Scene()
        self.scene.add_triangles(mesh)

    def intersects_any(self, ray_origins, ray_directions):
        """Whether each ray hits anything: (n,) bool."""
        return self.scene.test_occlusions(_rays(ray_origins, ray_directions))

    def intersects_first(self, ray_origins, ray_directions):
        """The triangle that each ray hits first, -1 for none: (n,) int."""
        ids = self.scene.cast_rays(_rays(ray_origins, ray_directions))["primitive_ids"]
        return np.where(ids == beamcast.INVALID_ID, -1, ids.astype(np.int64))

    def intersects_id(self, ray_origins, ray_directions, multiple_hits=True, return_locations=False):
        """The triangles that are hit, and the ray of each: (m,) and (m,); with `return_locations` also the points (m, 3)."""
        rays = _rays(ray_origins, ray_directions)
        if multiple_hits:
            found = self.scene.list_intersections(rays)
            triangles, numbers, depths = found["primitive_ids"], found["ray_ids"], found["t_hit_f64"]
        else:
            found = self.scene.cast_rays(rays)
            numbers = np.flatnonzero(np.isfinite(found["t_hit_f64"]))
            triangles, depths = found["primitive_ids"][numbers], found["t_hit_f64"][numbers]
        triangles, numbers = triangles.astype(np.int64), numbers.astype(np.int64)
        if not return_locations:
            return triangles, numbers
        return triangles, numbers, rays[0][numbers] + rays[1][numbers] * depths[:, None]

    def intersects_location(self, ray_origins, ray_directions, multiple_hits=True):
        """The points that are hit, the ray of each and its triangle: (m, 3), (m,) and (m,)."""
        triangles, numbers, points = self.intersects_id(ray_origins, ray_directions, multiple_hits, return_locations=True)
        return points, numbers, triangles

    def contains_points(self, points):
        """Whether each point is inside of the mesh, if that is closed: (n,) bool."""
        points = np.asarray(points, np.float64)
        crossings = self.scene.count_intersections((points, np.array([0.27, 0.51, 0.82])))
        return crossings % 2 == 1


def _rays(origins, directions):
    return np.atleast_2d(np.asarray(origins, np.float64)), np.atleast_2d(np.asarray(directions, np.float64))
