//! S. Woop, C. Benthin and I. Wald, "Watertight Ray/Triangle Intersection", Journal of Computer Graphics Techniques 2(1),
//! 2013.
//!
//! The corners, as seen from the ray's origin, are sheared so that the ray runs along one axis, k_z, its largest:
//! x = p[k_x] − S_x·p[k_z], y = p[k_y] − S_y·p[k_z], with S_x = d[k_x]/d[k_z], S_y = d[k_y]/d[k_z], S_z = 1/d[k_z]. Then
//! U = C_x·B_y − C_y·B_x, V = A_x·C_y − A_y·C_x, W = B_x·A_y − B_y·A_x must have one sign;
//! t = (U·A_z + V·B_z + W·C_z) / (U+V+W) with z = S_z·p[k_z], and U, V, W over their sum are the weights of A, B and C.
//!
//! The method cannot leak. A corner's x and y are the same for all triangles that share it. Rounding is monotonic, so the sign
//! of U, V or W, the difference of two rounded products, is never wrong, except that it may be zero where the true one is
//! not; then it is computed again in f64, where the products are exact. So all decisions are the exact ones of one plane
//! figure, the sheared corners as they are rounded.
//!
//! This code follows the paper without its culling, so that both sides are seen.

use glam::Vec3;

use super::kernel::{About, Crossing, Culling, Edges, Kernel, Ray, depth, same_sign};

/// See the [module](self).
#[derive(Debug)]
pub struct Watertight;

/// A ray and its shear.
#[derive(Clone, Copy, Debug)]
pub struct Sheared {
    origin: Vec3,
    kx: usize,
    ky: usize,
    kz: usize,
    s: Vec3,
}

impl Sheared {
    #[inline]
    fn carry(&self, p: Vec3) -> (f32, f32, f32) {
        let p = p - self.origin;
        let z = p[self.kz];
        (p[self.kx] - self.s.x * z, p[self.ky] - self.s.y * z, self.s.z * z)
    }
}

impl Kernel for Watertight {
    const ABOUT: About = About {
        name: "watertight",
        paper: "Woop, Benthin and Wald, JCGT 2(1), 2013",
        edges: Edges::Watertight,
        culling: Culling::None,
        common_origin: false,
    };
    type Triangle = [Vec3; 3];
    type Ray = Sheared;

    fn triangle(corners: [Vec3; 3], _origin: Vec3) -> [Vec3; 3] {
        corners
    }

    fn ray(Ray { origin, direction: d }: Ray) -> Sheared {
        let kz = d.abs().max_position();
        let (kx, ky) = ((kz + 1) % 3, (kz + 2) % 3);
        // Exchanging the two axes keeps the winding when the third points backwards.
        let (kx, ky) = if d[kz] < 0.0 { (ky, kx) } else { (kx, ky) };
        // The shear of an infinite direction would be 0. A NaN makes every number NaN that depends on it.
        let d = if d.is_finite() { d } else { Vec3::NAN };
        Sheared { origin, kx, ky, kz, s: Vec3::new(d[kx] / d[kz], d[ky] / d[kz], 1.0 / d[kz]) }
    }

    #[inline]
    fn intersect(&[a, b, c]: &[Vec3; 3], ray: &Sheared) -> Option<Crossing> {
        let ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = (ray.carry(a), ray.carry(b), ray.carry(c));
        let mut u = cx * by - cy * bx;
        let mut v = ax * cy - ay * cx;
        let mut w = bx * ay - by * ax;
        if u == 0.0 || v == 0.0 || w == 0.0 {
            (u, v, w) = (exact(cx, by, cy, bx), exact(ax, cy, ay, cx), exact(bx, ay, by, ax));
        }
        let weights = same_sign(u, v, w)?;
        let t = depth(u * az + v * bz + w * cz, u + v + w)?;
        Crossing::finite(t, weights.0, weights.1)
    }
}

/// p·q − r·s, with the exact sign.
#[cold]
fn exact(p: f32, q: f32, r: f32, s: f32) -> f32 {
    (f64::from(p) * f64::from(q) - f64::from(r) * f64::from(s)) as f32
}
