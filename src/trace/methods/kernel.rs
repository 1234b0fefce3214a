//! The contract of a ray–triangle method, and the arithmetic that several methods share.

use std::fmt::Debug;

use glam::{Vec2, Vec3};

/// A ray in f32.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// The point that the ray starts at.
    pub origin: Vec3,
    /// The ray's direction, of any length.
    pub direction: Vec3,
}

impl Ray {
    /// The point at depth `t`.
    #[inline]
    pub(super) fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}

/// The point at which a ray's line crosses a triangle. All three numbers are finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Depth in lengths of the direction; negative behind the origin.
    pub t: f32,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Barycentric weight of the third corner.
    pub v: f32,
}

impl Crossing {
    /// `None` unless all three are finite.
    #[inline]
    pub(super) fn finite(t: f32, u: f32, v: f32) -> Option<Self> {
        (t.is_finite() && u.is_finite() && v.is_finite()).then_some(Self { t, u, v })
    }

    /// Divides the weights by `whole`; `None` if that is 0, or outside the range in which f32 has its full precision.
    #[inline]
    pub(super) fn over(whole: f32, t: f32, u: f32, v: f32) -> Option<Self> {
        if whole.is_normal() { Self::finite(t, u / whole, v / whole) } else { None }
    }
}

/// A ray–triangle intersection method.
///
/// Every method keeps this contract:
/// - Numbers are f32, and operations are those of IEEE 754, never fused, so that every machine gives the same bits.
/// - The method tests the ray's whole line. The caller applies limits on t.
/// - A ray in the triangle's plane (N·d = 0), a triangle without area, a number that is not finite, or a number that
///   leaves f32 on the way, is a miss: never a panic, and never a [`Crossing`] with a NaN.
/// - [`About::edges`] says which rays through an edge or a vertex hit, up to rounding.
pub trait Kernel: Debug + Send + Sync + 'static {
    /// The method's name, paper and properties.
    const ABOUT: About;
    /// The numbers that are kept of a triangle.
    type Triangle: Copy + Debug + Send + Sync;
    /// The numbers that are computed once for a ray.
    type Ray: Copy;

    /// Prepares a triangle with these corners, counter-clockwise seen from the front. With [`About::common_origin`], the
    /// result serves rays from `origin` only; without, `origin` has no effect.
    fn triangle(corners: [Vec3; 3], origin: Vec3) -> Self::Triangle;

    /// Prepares a ray.
    fn ray(ray: Ray) -> Self::Ray;

    /// The point at which the ray's line crosses the triangle, if it does.
    fn intersect(triangle: &Self::Triangle, ray: &Self::Ray) -> Option<Crossing>;
}

/// The name, the paper and the properties of a method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct About {
    /// The method's name in jobs.
    pub name: &'static str,
    /// The publication.
    pub paper: &'static str,
    /// The triangles that edges and vertices belong to.
    pub edges: Edges,
    /// The side that the method does not see.
    pub culling: Culling,
    /// Whether the numbers kept of a triangle serve rays from one origin only.
    pub common_origin: bool,
}

/// The triangles that a ray through an edge or a vertex hits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edges {
    /// Every triangle that the edge belongs to, up to rounding.
    Inclusive,
    /// No triangle.
    Exclusive,
    /// As [`Inclusive`](Edges::Inclusive); and the triangles at an edge compute the same number for it, so that they agree
    /// on which side of it a ray passes, and no ray passes between them. Around a vertex the numbers of the edges need not
    /// fit together.
    Consistent,
    /// At least one of its triangles, at edges and vertices of a closed mesh, always.
    Watertight,
}

/// The sides of triangles that a method does not see.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Culling {
    /// It sees both sides.
    None,
    /// It sees triangles from their backs only.
    Front,
    /// It sees triangles from their fronts only, the side from which the corners are counter-clockwise.
    Back,
}

impl Culling {
    /// Whether a ray that comes from a triangle's front (or else from its back) can hit the triangle.
    pub fn sees(self, from_front: bool) -> bool {
        match self {
            Self::None => true,
            Self::Front => !from_front,
            Self::Back => from_front,
        }
    }
}

/// The least slope, an area (m²) times a cosine, that gives a depth. It is that of a triangle with sides of 3·10⁻¹³ m, whose
/// volumes, and so the heights that slopes divide, are just within f32.
const LEAST_SLOPE: f32 = 1.0 / (1_u128 << 83) as f32;

/// The depth t of a plane that lies at `height` along its normal, and that the ray approaches by `slope` in each length of its
/// direction. `None` for a ray in the plane, a triangle without area, and numbers that leave f32.
#[inline]
pub(super) fn depth(height: f32, slope: f32) -> Option<f32> {
    (slope.abs() >= LEAST_SLOPE && slope.is_finite()).then(|| height / slope)
}

/// The weights (u, v) of B and C, given numbers in proportion to the weights of A, B and C; `None` unless all three have one
/// sign. A zero has either sign.
#[inline]
pub(super) fn same_sign(a: f32, b: f32, c: f32) -> Option<(f32, f32)> {
    let (least, most) = (a.min(b).min(c), a.max(b).max(c));
    let sum = a + b + c;
    ((least >= 0.0 || most <= 0.0) && sum.is_normal()).then(|| (b / sum, c / sum))
}

/// The axis that a projection drops. The two kept axes follow it in the cycle x, y, z, so that the sign of the normal's dropped
/// component gives the winding of the projected triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axes(u32);

impl Axes {
    /// Drops the axis along which |n| is largest.
    pub(super) fn around_largest(n: Vec3) -> Self {
        let n = n.abs();
        Self(if n.x >= n.y && n.x >= n.z {
            0
        } else if n.y >= n.z {
            1
        } else {
            2
        })
    }

    /// The two kept coordinates.
    #[inline]
    pub(super) fn keep(self, p: Vec3) -> Vec2 {
        match self.0 {
            0 => Vec2::new(p.y, p.z),
            1 => Vec2::new(p.z, p.x),
            _ => Vec2::new(p.x, p.y),
        }
    }

    /// The dropped coordinate.
    #[inline]
    pub(super) fn dropped(self, p: Vec3) -> f32 {
        match self.0 {
            0 => p.x,
            1 => p.y,
            _ => p.z,
        }
    }
}
