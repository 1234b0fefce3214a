//! D. Baldwin and M. Weber, "Fast Ray-Triangle Intersections by Coordinate Transformation", Journal of Computer Graphics
//! Techniques 5(3), 2016.
//!
//! An affine map takes A, B and C to (0, 0), (1, 0) and (0, 1) of a plane, and the plane of the triangle to w = 0. Applied to
//! the ray it gives t = −w(o) / w(d); applied to o + t·d it gives u and v. Its third axis is free, and is taken along the
//! largest component of N (say x): then w = x + (N_y/N_x)·y + (N_z/N_x)·z − N·A/N_x, and u and v do not depend on x:
//! u = ((y−A_y)·e2_z − (z−A_z)·e2_y) / N_x, v = ((z−A_z)·e1_y − (y−A_y)·e1_z) / N_x. The map is nine numbers and the axis.
//!
//! This code follows the paper. The point is inside when u ≥ 0, v ≥ 0 and u+v ≤ 1.

use glam::Vec3;

use super::kernel::{About, Axes, Crossing, Culling, Edges, Kernel, Ray, depth};

/// See the [module](self).
#[derive(Debug)]
pub struct BaldwinWeber;

/// The map: the factors of y, z and 1 in each row.
#[derive(Clone, Copy, Debug)]
pub struct Map {
    u: Vec3,
    v: Vec3,
    w: Vec3,
    axes: Axes,
}

impl Kernel for BaldwinWeber {
    const ABOUT: About = About {
        name: "baldwin-weber",
        paper: "Baldwin and Weber, JCGT 5(3), 2016",
        edges: Edges::Inclusive,
        culling: Culling::None,
        common_origin: false,
    };
    type Triangle = Map;
    type Ray = Ray;

    fn triangle([a, b, c]: [Vec3; 3], _origin: Vec3) -> Map {
        let (e1, e2) = (b - a, c - a);
        let n = e1.cross(e2);
        let axes = Axes::around_largest(n);
        let largest = axes.dropped(n);
        // A triangle without an area, as far as f32 can tell, has no inside: NaN fails every test.
        let scale = if largest.is_normal() { 1.0 / largest } else { f32::NAN };
        let (corner, e1, e2, n) =
            (axes.keep(a), axes.keep(e1) * scale, axes.keep(e2) * scale, axes.keep(n) * scale);
        Map {
            u: Vec3::new(e2.y, -e2.x, e2.x * corner.y - e2.y * corner.x),
            v: Vec3::new(-e1.y, e1.x, e1.y * corner.x - e1.x * corner.y),
            w: n.extend(-(axes.dropped(a) + n.dot(corner))),
            axes,
        }
    }

    fn ray(ray: Ray) -> Ray {
        ray
    }

    #[inline]
    fn intersect(&Map { u, v, w, axes }: &Map, ray: &Ray) -> Option<Crossing> {
        let (o, d) = (axes.keep(ray.origin), axes.keep(ray.direction));
        let along = axes.dropped(ray.direction) + w.truncate().dot(d);
        let t = depth(-(axes.dropped(ray.origin) + w.truncate().dot(o) + w.z), along)?;
        let p = o + d * t;
        let u = u.truncate().dot(p) + u.z;
        if u < 0.0 {
            return None;
        }
        let v = v.truncate().dot(p) + v.z;
        if !(v >= 0.0 && u + v <= 1.0) {
            return None;
        }
        Crossing::finite(t, u, v)
    }
}
