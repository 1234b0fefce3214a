//! The definition of a hit. All other code of the tracer only avoids calling it.
//!
//! The arithmetic is in f64, multiplications and additions only (never fused), in one fixed order, so that every machine
//! gives the same bits. The decision is exact: a filter with a proven error bound answers nearly always, and the adaptive
//! predicate of Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates" (1997),
//! answers the rest. Where its products could underflow, which that predicate rules out, integers of any size answer.
//!
//! The definition is for rays whose direction's largest |component| is from [`SHORTEST`] to [`FARTHEST`], and for corners no farther
//! than [`FARTHEST`] from the origin; all other rays miss. Within that, components may be of any size, subnormal numbers included.
//!
//! A ray is carried into the space of a placement by the inverse of that placement's map, in f64, once. The map of a placement that
//! moves is that of the ray's own time, and so is its inverse: both are computed for that time alone, in the same way wherever the
//! same time comes up, so a hit depends on the ray and its time and on nothing else. Where the mesh is hidden at that time, or the map
//! has no precise inverse ([`Placement::mesh_from_scene_at`]), the ray misses it. A region of a large scene
//! is placed by moving it only, and origins are rounded such that this is exact
//! ([`Geometry::ray_origin`](crate::scene::Geometry::ray_origin)), so all regions decide as one mesh would.

use glam::{DAffine3, DVec3};

use super::dyadic::{Dyadic, determinant};
use super::rays::{Hit, Origins, Rays};
use super::stats::TraversalStats;
use crate::scene::{Mesh, Placement};

/// One f64 or several side by side, with operations of IEEE 754, whose results are fixed to the bit. The definition is written
/// once over this trait, for one ray and for eight.
pub trait Real: Copy {
    /// The same number in every lane.
    fn splat(x: f64) -> Self;
    /// self + other.
    fn add(self, other: Self) -> Self;
    /// self − other.
    fn sub(self, other: Self) -> Self;
    /// self · other.
    fn mul(self, other: Self) -> Self;
    /// self / other.
    fn div(self, other: Self) -> Self;
    /// √self.
    fn sqrt(self) -> Self;
    /// |self|.
    fn abs(self) -> Self;
    /// The lesser of the two, if neither is NaN.
    fn min(self, other: Self) -> Self;
    /// The larger of the two, if neither is NaN.
    fn max(self, other: Self) -> Self;
    /// One bit for each lane, set if self ≤ other; not set for NaN.
    fn le(self, other: Self) -> u32;
}

impl Real for f64 {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self + other
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self - other
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self * other
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self / other
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        u32::from(self <= other)
    }
}

/// Three coordinates of one ray or of several.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Xyz<R>(pub R, pub R, pub R);

impl<R: Real> Xyz<R> {
    #[inline(always)]
    pub(super) fn splat(one: &Xyz<f64>) -> Self {
        Self(R::splat(one.0), R::splat(one.1), R::splat(one.2))
    }

    /// The same point in every lane.
    #[inline(always)]
    pub(super) fn constant(p: DVec3) -> Self {
        Self(R::splat(p.x), R::splat(p.y), R::splat(p.z))
    }

    #[inline(always)]
    pub(super) fn sub(self, q: Self) -> Self {
        Self(self.0.sub(q.0), self.1.sub(q.1), self.2.sub(q.2))
    }

    #[inline(always)]
    pub(super) fn add(self, q: Self) -> Self {
        Self(self.0.add(q.0), self.1.add(q.1), self.2.add(q.2))
    }

    #[inline(always)]
    fn times(self, factor: R) -> Self {
        Self(self.0.mul(factor), self.1.mul(factor), self.2.mul(factor))
    }

    /// x·x′ + y·y′ + z·z′, left to right.
    #[inline(always)]
    fn dot(self, q: Self) -> R {
        self.0.mul(q.0).add(self.1.mul(q.1)).add(self.2.mul(q.2))
    }

    #[inline(always)]
    fn cross(self, q: Self) -> Self {
        Self(
            self.1.mul(q.2).sub(self.2.mul(q.1)),
            self.2.mul(q.0).sub(self.0.mul(q.2)),
            self.0.mul(q.1).sub(self.1.mul(q.0)),
        )
    }

    /// The vector scaled to unit length; zero for zero. It is scaled to about 1 first, so that the square of its length neither
    /// overflows nor vanishes.
    #[inline(always)]
    pub(super) fn normalized(self) -> Self {
        let not_zero = R::splat(f64::MIN_POSITIVE);
        let largest = self.0.abs().max(self.1.abs()).max(self.2.abs()).max(not_zero);
        let scaled = self.times(R::splat(1.0).div(largest));
        let length = scaled.dot(scaled).sqrt().max(not_zero);
        scaled.times(R::splat(1.0).div(length))
    }
}

/// The part of a hit that depends on the triangle and the ray's origin only. It is computed once for all rays that hit the
/// triangle from that origin.
#[derive(Clone, Copy)]
pub(super) struct Facet<R> {
    /// N = (b−a) × (c−a). Its length is twice the triangle's area; it points to the side from which a, b, c are
    /// counter-clockwise.
    pub normal: Xyz<R>,
    /// a·N.
    volume: R,
    /// b × c, c × a, a × b.
    sides: [Xyz<R>; 3],
    /// The triangle's bounds, each moved outward by 10⁻¹² of itself.
    low: Xyz<R>,
    high: Xyz<R>,
}

impl<R: Real> Facet<R> {
    /// The facet of a triangle whose corners are given relative to the origin.
    #[inline(always)]
    pub fn new([a, b, c]: [Xyz<R>; 3]) -> Self {
        let normal = b.sub(a).cross(c.sub(a));
        let bounds = (bounds(a.0, b.0, c.0), bounds(a.1, b.1, c.1), bounds(a.2, b.2, c.2));
        Self {
            normal,
            volume: a.dot(normal),
            sides: [b.cross(c), c.cross(a), a.cross(b)],
            low: Xyz(bounds.0.0, bounds.1.0, bounds.2.0),
            high: Xyz(bounds.0.1, bounds.1.1, bounds.2.1),
        }
    }

    /// The same facet in every lane.
    #[inline(always)]
    pub fn splat(one: &Facet<f64>) -> Self {
        let [a, b, c] = &one.sides;
        Self {
            normal: Xyz::splat(&one.normal),
            volume: R::splat(one.volume),
            sides: [Xyz::splat(a), Xyz::splat(b), Xyz::splat(c)],
            low: Xyz::splat(&one.low),
            high: Xyz::splat(&one.high),
        }
    }

    /// The depth t = (a·N)/(d·N) at which rays along d meet the triangle's plane, and one bit for each lane that is set if the
    /// point at that depth is within the bounds.
    #[inline(always)]
    pub fn plane_depth(&self, d: Xyz<R>) -> (R, u32) {
        let t = self.volume.div(d.dot(self.normal));
        let (x, y, z) = (t.mul(d.0), t.mul(d.1), t.mul(d.2));
        let within = self.low.0.le(x) & self.low.1.le(y) & self.low.2.le(z);
        let within = within & x.le(self.high.0) & y.le(self.high.1) & z.le(self.high.2);
        (t.add(R::splat(0.0)), within) // adding 0 turns −0 into 0
    }

    /// Barycentric weights (u, v) of b and c at the points where rays along d pass: the determinants that decide whether they
    /// pass, divided by their sum (Segura and Feito). 0 where the sum is zero.
    #[inline(always)]
    pub fn weights(&self, d: Xyz<R>) -> (R, R) {
        let (ea, eb, ec) = (d.dot(self.sides[0]), d.dot(self.sides[1]), d.dot(self.sides[2]));
        let per_sum = R::splat(1.0).div(ea.add(eb).add(ec));
        (clamped(eb.mul(per_sum)), clamped(ec.mul(per_sum)))
    }
}

#[inline(always)]
fn bounds<R: Real>(a: R, b: R, c: R) -> (R, R) {
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let slack = R::splat(1e-12);
    (low.sub(low.abs().mul(slack)), high.add(high.abs().mul(slack)))
}

/// The number, clamped to 0 to 1; 0 for NaN.
#[inline(always)]
fn clamped<R: Real>(weight: R) -> R {
    weight.max(R::splat(0.0)).min(R::splat(1.0))
}

/// A ray in the space of a mesh. The direction may have any length; depths are counted in that length.
#[derive(Clone, Copy, Debug)]
pub struct LocalRay {
    /// The point that the ray starts at.
    pub origin: DVec3,
    /// The ray's direction.
    pub direction: DVec3,
}

impl LocalRay {
    /// Carries a ray from the scene's space into a placement's. Depths are the same numbers in both. `None` if the placement moves
    /// and is nowhere at the ray's time (NaN for none).
    #[inline]
    pub fn carried(self, placement: &Placement, time_s: Option<f64>) -> Option<Self> {
        if !placement.is_moving() {
            return Some(self.carried_by(placement.mesh_from_scene()));
        }
        Some(self.carried_by(&placement.mesh_from_scene_at(time_s?)?))
    }

    /// Carries a ray into another space by a map, in which depths are the same numbers.
    #[inline]
    pub fn carried_by(self, map: &DAffine3) -> Self {
        if *map == DAffine3::IDENTITY {
            return self;
        }
        let (origin, direction) = (xyz(self.origin), xyz(self.direction));
        Self {
            origin: point(carried_point(map, origin)),
            direction: point(carried_direction(map, direction)),
        }
    }
}

/// Applies the linear part of a map, summing from left to right.
#[inline(always)]
pub(super) fn carried_direction<R: Real>(map: &DAffine3, v: Xyz<R>) -> Xyz<R> {
    let m = &map.matrix3;
    let (x, y, z) = (Xyz::constant(m.x_axis), Xyz::constant(m.y_axis), Xyz::constant(m.z_axis));
    x.times(v.0).add(y.times(v.1)).add(z.times(v.2))
}

#[inline(always)]
pub(super) fn carried_point<R: Real>(map: &DAffine3, p: Xyz<R>) -> Xyz<R> {
    carried_direction(map, p).add(Xyz::constant(map.translation))
}

/// Carries rays as [`LocalRay::carried_by`] does. The directions are written to `carried`; the origins are returned, and borrow
/// `room`.
pub(super) fn carry<'o>(
    map: &DAffine3,
    origins: Origins<'o>,
    directions: &[DVec3],
    carried: &mut Vec<DVec3>,
    room: &'o mut Vec<DVec3>,
) -> Origins<'o> {
    carried.clear();
    if *map == DAffine3::IDENTITY {
        carried.extend_from_slice(directions);
        return origins;
    }
    carried.extend(directions.iter().map(|&d| point(carried_direction(map, xyz(d)))));
    match origins {
        Origins::Common(origin) => Origins::Common(point(carried_point(map, xyz(origin)))),
        Origins::Each(all) => {
            room.clear();
            room.extend(all.iter().map(|&origin| point(carried_point(map, xyz(origin)))));
            Origins::Each(room)
        }
    }
}

/// The least largest |component| of a direction.
pub const SHORTEST: f64 = 1e-100;

/// The largest |component| of a direction, and the largest |coordinate| of a corner relative to the origin: no product of three of
/// them overflows.
pub const FARTHEST: f64 = 1e100;

/// A triangle's corners relative to a ray's origin, each rounded once. All triangles that share a vertex get the same numbers
/// for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corners {
    /// The first corner.
    pub a: DVec3,
    /// The second corner.
    pub b: DVec3,
    /// The third corner.
    pub c: DVec3,
}

impl Corners {
    /// The corners of triangle `triangle` of `mesh` relative to `origin`.
    #[inline]
    pub fn of(mesh: &Mesh, triangle: u32, origin: DVec3) -> Self {
        Self::from_positions(mesh.triangles[triangle as usize].map(|v| mesh.positions[v as usize]), origin)
    }

    /// The corners at these positions, relative to `origin`.
    #[inline(always)]
    pub fn from_positions([a, b, c]: [[f32; 3]; 3], origin: DVec3) -> Self {
        Self { a: from(a, origin), b: from(b, origin), c: from(c, origin) }
    }

    /// Whether the line along `d` through the origin passes through the triangle, its edges and vertices included: the
    /// determinants det(d, b, c), det(d, c, a), det(d, a, b) are all ≥ 0 or all ≤ 0, and not all zero (a line in the
    /// triangle's plane misses it). The answer is exact. It is false if a number is not finite, or larger than [`FARTHEST`], or the
    /// direction is shorter than [`SHORTEST`].
    #[inline]
    pub fn passes(&self, d: DVec3) -> bool {
        self.passes_how(d).0
    }

    /// [`Corners::passes`]; counts the test as decided in f64, and as decided exactly if f64 could not decide it.
    pub(super) fn passes_counted(&self, d: DVec3, stats: &mut TraversalStats) -> bool {
        let (passes, is_close) = self.passes_how(d);
        stats.in_f64 += 1;
        stats.exactly += u64::from(is_close);
        passes
    }

    /// [`Corners::passes`], and whether the decision took exact arithmetic.
    #[inline]
    fn passes_how(&self, d: DVec3) -> (bool, bool) {
        let Self { a, b, c } = *self;
        let largest = a.abs().max(b.abs()).max(c.abs()).max_element();
        let length = d.abs().max_element();
        if !(largest <= FARTHEST && (SHORTEST..=FARTHEST).contains(&length)) {
            return (false, false);
        }
        // The error of a determinant d·(p × q) computed in f64, u = 2⁻⁵³, m the largest |coordinate|: a component of the
        // cross product is off by at most (2u + u²)(|p_i q_j| + |p_j q_i|) ≤ (4u + 2u²) m²; the dot product adds at most
        // 3u(1 + u)² of Σ|d_k|·2m²(1+u)². With Σ|d_k| ≤ 3 |d|∞ that is ≤ 3·(4 + 6)·u·m²|d|∞ = 30u·m²|d|∞ plus terms in
        // u²; 64u has room for these and for the rounding of the bound itself. A product that underflows is off by 2⁻¹⁰⁷⁵ besides:
        // six times in the cross product, times |d|∞, and three times in the dot product. 2⁻¹⁰²² times both is far more.
        const U: f64 = f64::EPSILON / 2.0;
        let bound = 64.0 * U * (largest * largest) * length + f64::MIN_POSITIVE * (length + 1.0);
        let mut is_close = false;
        let mut sign = |p: DVec3, q: DVec3| -> i8 {
            let determinant = dot(d, cross(p, q));
            if determinant > bound {
                1
            } else if determinant < -bound {
                -1
            } else if determinant.is_nan() {
                // A ray or a corner with a NaN is on no side.
                2
            } else {
                is_close = true;
                exact_sign(d, p, q)
            }
        };
        let first = sign(b, c);
        let second = sign(c, a);
        if first * second < 0 {
            return (false, is_close); // most triangles are decided here
        }
        let third = sign(a, b);
        let signs = [first, second, third];
        let passes = !signs.contains(&2)
            && (signs.iter().all(|&s| s >= 0) || signs.iter().all(|&s| s <= 0))
            && signs.iter().any(|&s| s != 0);
        (passes, is_close)
    }

    /// The depth at which the ray along `d` meets the triangle's plane, kept within the triangle's own box.
    ///
    /// t = (a·N)/(d·N) with N = (b−a) × (c−a). For a triangle seen edge-on this is rounding noise. The point at that depth may
    /// lie outside the triangle's box, and a tracer that prunes by boxes would not look for it there. So if a coordinate of
    /// t·d is outside the triangle's bounds by more than 10⁻¹² of the bound, t is clamped to the depths at which the ray is
    /// inside those bounds; the true t is among them. (In all other cases t is good to a few ulps, and 10⁻¹² does not change
    /// it.)
    ///
    /// The depth has a meaning only if [`Corners::passes`].
    #[inline]
    pub fn depth(&self, d: DVec3) -> f64 {
        let (t, within) = Facet::new(self.xyz()).plane_depth(xyz(d));
        if within != 0 {
            return t;
        }
        let low = self.a.min(self.b).min(self.c);
        let high = self.a.max(self.b).max(self.c);
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..3 {
            if d[axis] != 0.0 {
                let (t0, t1) = (low[axis] / d[axis], high[axis] / d[axis]);
                enter = enter.max(t0.min(t1));
                leave = leave.min(t0.max(t1));
            }
        }
        // A NaN becomes the near end, and so does an interval whose ends rounding exchanged.
        let t = if t > leave { leave } else { t };
        (if t >= enter { t } else { enter }) + 0.0
    }

    /// Barycentric weights (u, v) of the second and third corner at the point where the line along `d` passes.
    #[inline]
    pub fn weights(&self, d: DVec3) -> (f64, f64) {
        Facet::new(self.xyz()).weights(xyz(d))
    }

    #[inline(always)]
    pub(super) fn xyz(&self) -> [Xyz<f64>; 3] {
        [xyz(self.a), xyz(self.b), xyz(self.c)]
    }
}

#[inline(always)]
pub(super) fn xyz(p: DVec3) -> Xyz<f64> {
    Xyz(p.x, p.y, p.z)
}

#[inline(always)]
fn point(p: Xyz<f64>) -> DVec3 {
    DVec3::new(p.0, p.1, p.2)
}

/// A triangle that a ray meets, before the rest of the [`Hit`] is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// The depth.
    pub t: f64,
    /// Index of the placement.
    pub placement: u32,
    /// Index of the triangle in the placement's mesh.
    pub triangle: u32,
}

impl Candidate {
    /// Whether this hit is nearer than the other, or at the same depth and of a lower triangle id. (Ids rise from placement to
    /// placement, so the pair of placement and triangle compares as the id does.)
    #[inline]
    pub fn beats(&self, other: &Self) -> bool {
        self.t < other.t
            || (self.t == other.t && (self.placement, self.triangle) < (other.placement, other.triangle))
    }

    /// The whole hit, given the triangle's corners and the ray's direction in the placement's space, and the map by which the ray was
    /// carried there.
    #[inline]
    pub fn finish(&self, corners: &Corners, direction: DVec3, mesh_from_scene: &DAffine3) -> Hit {
        let facet = Facet::new(corners.xyz());
        let (u, v) = facet.weights(xyz(direction));
        let normal = out_of(mesh_from_scene, facet.normal).normalized();
        let normal = DVec3::new(normal.0, normal.1, normal.2);
        Hit { t: self.t, u, v, normal, placement: self.placement, triangle: self.triangle }
    }
}

/// The limits on the hits of one ray.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// The least depth, included. It is at least that of `after`.
    pub t_min: f64,
    /// The largest depth, included.
    pub t_max: f64,
    /// A hit that the ray's hit must follow in the order of [`Candidate::beats`].
    pub after: Option<Candidate>,
}

impl Limits {
    /// The limits of one ray of a batch.
    pub fn of(rays: &Rays, ray: usize) -> Self {
        Self::new(rays.t_min, rays.t_max, rays.after.and_then(|after| after[ray]))
    }

    /// Limits on the depth of hits that come after another hit, if there is one.
    #[inline(always)]
    pub(super) fn new(t_min: f64, t_max: f64, after: Option<Hit>) -> Self {
        let after = after.map(|hit| Candidate { t: hit.t, placement: hit.placement, triangle: hit.triangle });
        Self { t_min: after.map_or(t_min, |after| t_min.max(after.t)), t_max, after }
    }

    /// Whether a hit keeps within the limits.
    #[inline]
    pub fn admits(&self, found: &Candidate) -> bool {
        self.admits_for::<true>(found)
    }

    /// [`Limits::admits`], for code that knows whether there is a hit to come after (`AFTER`).
    #[inline(always)]
    pub(super) fn admits_for<const AFTER: bool>(&self, found: &Candidate) -> bool {
        (self.t_min..=self.t_max).contains(&found.t)
            && (!AFTER || self.after.is_none_or(|after| after.beats(found)))
    }
}

/// Carries a normal from a placement's space to the scene's, given the map from the scene's space; its length changes. Normals
/// transform by the transpose of the inverse, and a mirroring map reverses the winding.
#[inline(always)]
pub(super) fn out_of<R: Real>(map: &DAffine3, normal: Xyz<R>) -> Xyz<R> {
    if *map == DAffine3::IDENTITY {
        return normal;
    }
    let m = &map.matrix3;
    let turn = if xyz(m.x_axis).dot(xyz(m.y_axis).cross(xyz(m.z_axis))) < 0.0 { -1.0 } else { 1.0 };
    let (x, y, z) = (Xyz::constant(m.x_axis), Xyz::constant(m.y_axis), Xyz::constant(m.z_axis));
    Xyz(x.dot(normal), y.dot(normal), z.dot(normal)).times(R::splat(turn))
}

/// The dot product x·y, summed from left to right.
#[inline]
fn dot(x: DVec3, y: DVec3) -> f64 {
    (x.x * y.x + x.y * y.y) + x.z * y.z
}

/// A position relative to an origin, rounded once.
#[inline(always)]
fn from([x, y, z]: [f32; 3], origin: DVec3) -> DVec3 {
    DVec3::new(f64::from(x), f64::from(y), f64::from(z)) - origin
}

#[inline]
fn cross(p: DVec3, q: DVec3) -> DVec3 {
    DVec3::new(p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x)
}

/// The sign of det(d, p, q), exactly.
///
/// `robust` computes with sums of f64 that hold a product of three numbers without rounding. Its last digit is that of 159 binary
/// digits, so it is above 2⁻¹⁰⁷⁴, the last of f64, where no factor is below 2⁻³⁰⁰ (and 2⁻³⁰⁰ < 10⁻⁹⁰). Other numbers, but for 0,
/// are left to integers of any size.
#[cold]
fn exact_sign(d: DVec3, p: DVec3, q: DVec3) -> i8 {
    let is_ordinary = |x: f64| x == 0.0 || (1e-90..=1e90).contains(&x.abs());
    if ![d, p, q].iter().all(|v| is_ordinary(v.x) && is_ordinary(v.y) && is_ordinary(v.z)) {
        let [d, p, q] = [d, p, q].map(|v| v.to_array().map(Dyadic::of));
        return determinant(&d, &p, &q).sign();
    }
    let point = |v: DVec3| robust::Coord3D { x: v.x, y: v.y, z: v.z };
    let determinant = robust::orient3d(point(d), point(p), point(q), point(DVec3::ZERO));
    i8::from(determinant > 0.0) - i8::from(determinant < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;

    fn corners(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> Corners {
        Corners { a: a.into(), b: b.into(), c: c.into() }
    }

    /// A triangle in the plane x = 2 that faces the origin.
    fn facing() -> Corners {
        corners([2.0, -1.0, -1.0], [2.0, 0.0, 1.0], [2.0, 1.0, -1.0])
    }

    #[test]
    fn passes_inside_on_edges_and_on_vertices_from_both_sides() {
        let t = facing();
        let back = Corners { a: t.b, b: t.a, c: t.c };
        let inside = [DVec3::X, DVec3::new(2.0, 0.1, -0.3)];
        let edge = [DVec3::new(2.0, 0.0, -1.0), DVec3::new(2.0, 0.5, 0.0), DVec3::new(4.0, -1.0, 0.0)];
        let outside = [DVec3::Y, DVec3::new(2.0, 0.51, 0.0), DVec3::new(2.0, 0.0, -1.0 - 1e-15)];
        for triangle in [t, back] {
            for d in inside.iter().chain(&edge).chain(&[t.a, t.b, t.c]) {
                assert!(triangle.passes(*d), "{d}");
                assert!(triangle.passes(-*d), "a line has no direction: {d}");
                assert!((triangle.depth(*d) * d.x - 2.0).abs() < 1e-15);
            }
            for d in outside {
                assert!(!triangle.passes(d), "{d}");
            }
        }
    }

    #[test]
    fn the_sign_of_the_predicate_is_that_of_the_determinant() {
        assert_eq!(exact_sign(DVec3::X, DVec3::Y, DVec3::Z), 1);
        assert_eq!(exact_sign(DVec3::Y, DVec3::X, DVec3::Z), -1);
        // A determinant of exactly one unit in 2¹⁰⁶: far below what f64 sees.
        let tiny = f64::EPSILON;
        let (p, q) = (DVec3::new(0.0, 1.0 + tiny, 1.0), DVec3::new(0.0, 1.0, 1.0 - tiny));
        assert_eq!(p.y * q.z - p.z * q.y, 0.0, "f64 sees nothing");
        assert_eq!(exact_sign(DVec3::X, p, q), -1);
    }

    /// The case brute-force-subnormal: products that underflow took the sign from a determinant, and a triangle far behind a ray
    /// seemed to be at its origin.
    #[test]
    fn decisions_are_exact_for_numbers_of_any_size() {
        let mut rng = Rng::new(9);
        let sizes =
            [0.0, 5e-324, 1e-321, 1e-310, 3e-308, 1e-200, 1e-160, 1e-110, 1e-99, 1e-30, 1.0, 1e20, 9e99];
        let (mut passed, mut missed) = (0, 0);
        for _ in 0..30_000 {
            // Few sizes together, so that many determinants are nearly zero.
            let some = [sizes[rng.below(13)], sizes[rng.below(13)], 1.0];
            let mut point = || {
                let mut number = || (rng.signed() * 8.0).round() / 8.0 * some[rng.below(3)];
                DVec3::new(number(), number(), number())
            };
            let (t, d) = (Corners { a: point(), b: point(), c: point() }, point());
            let exact = |v: DVec3| v.to_array().map(Dyadic::of);
            let sign = |p: DVec3, q: DVec3| determinant(&exact(d), &exact(p), &exact(q)).sign();
            let signs = [sign(t.b, t.c), sign(t.c, t.a), sign(t.a, t.b)];
            let is_short = d.abs().max_element() < SHORTEST;
            let expected = !is_short && signs != [0; 3] && !(signs.contains(&1) && signs.contains(&-1));
            assert_eq!(t.passes(d), expected, "{t:?} along {d:?}");
            if expected { passed += 1 } else { missed += 1 }
        }
        assert!(passed > 3000 && missed > 3000, "{passed} {missed}");
        let behind = corners([17.0, 3.0, 0.0], [19.0, 3.5, 0.0], [18.0, 21.0, 0.0]);
        assert!(!behind.passes(DVec3::new(-1.0, -1.0, 9.93e-322)));
    }

    #[test]
    fn rays_outside_of_the_definition_miss() {
        let t = facing();
        for size in [1e-100, 1.0, 1e100] {
            assert!(t.passes(DVec3::X * size), "{size}");
            assert!(((t.depth(DVec3::X * size) * size) - 2.0).abs() < 1e-15);
        }
        for size in [0.0, 5e-324, 9e-101, 1.1e100, f64::MAX] {
            assert!(!t.passes(DVec3::X * size), "{size}");
        }
        let far = corners([2e100, -1.0, -1.0], [2e100, 0.0, 1.0], [2e100, 1.0, -1.0]);
        assert!(!far.passes(DVec3::X));
    }

    #[test]
    fn a_line_in_the_plane_misses() {
        let floor = corners([1.0, -1.0, 0.0], [3.0, 0.0, 0.0], [1.0, 1.0, 0.0]);
        assert!(!floor.passes(DVec3::X));
        assert!(!floor.passes(DVec3::new(1.0, 0.1, 0.0)));
    }

    #[test]
    fn not_a_number_is_a_miss() {
        assert!(!facing().passes(DVec3::splat(f64::NAN)));
        assert!(!facing().passes(DVec3::new(f64::INFINITY, 0.0, 0.0)));
        assert!(!corners([f64::NAN; 3], [2.0, 0.0, 1.0], [2.0, 1.0, 0.0]).passes(DVec3::X));
        assert!(!facing().passes(DVec3::ZERO));
    }

    #[test]
    fn an_edge_on_depth_stays_in_the_box() {
        // A sliver seen edge-on: the plane's depth is noise, anywhere from −∞ to ∞; the true one lies in the box.
        let h = 1e-14;
        let sliver = corners([1.0, -h, -1.0], [2.0, h, 1.0], [1.5, 0.3 * h, 1.0]);
        for weights in [[0.2, 0.3, 0.5], [0.5, 0.25, 0.25], [0.1, 0.1, 0.8]] {
            let [wa, wb, wc] = weights;
            let d = (sliver.a * wa + sliver.b * wb + sliver.c * wc).normalize();
            assert!(sliver.passes(d));
            let t = sliver.depth(d);
            assert!((1.0 - 1e-12..=2.0 + 1e-12).contains(&(t * d.x)), "{t}");
        }
        // The plane holds the ray up to rounding: N·d underflows to nothing, and the near end of the box is taken.
        let edge_on = corners([1.0, 1e-300, -1.0], [1.0, -1e-300, 1.0], [3.0, 0.0, 0.0]);
        let t = edge_on.depth(DVec3::X);
        assert!((1.0..=3.0).contains(&t), "{t}");
    }

    #[test]
    fn weights_are_barycentric() {
        let t = facing();
        let at = |wa: f64, wb: f64, wc: f64| t.a * wa + t.b * wb + t.c * wc;
        let (u, v) = t.weights(at(0.2, 0.3, 0.5));
        assert!((u - 0.3).abs() < 1e-15 && (v - 0.5).abs() < 1e-15);
        assert_eq!(t.weights(t.b), (1.0, 0.0));
    }
}
