//! The published ray–triangle methods, each as its paper has it, in f32.
//!
//! A job casts with the exact definition of a hit (see [`super::exact`]) unless its `[trace]` says `kernel = "…"`. Then one
//! of these decides, at the leaves of the same hierarchy, and every error of the method is in the output: that is what they
//! are for. `beamcast kernels` measures all of them against exact arithmetic.
#![doc = include_str!("measured.md")]

mod badouel;
mod baldwin_weber;
mod curless;
#[cfg(test)]
mod errata;
mod held;
mod homogeneous;
mod left_of_edge;
mod moller_trumbore;
mod plucker;
mod segura_feito;
mod sunday;
mod tracer;
pub mod truth;
mod watertight;

use std::fmt::Debug;
use std::sync::Arc;

use glam::{Vec2, Vec3};

use super::Tracer;
pub use tracer::{KernelTracer, MethodTracer};

/// A ray in f32.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3,
    /// Where it goes; of any length.
    pub direction: Vec3,
}

impl Ray {
    #[inline]
    fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}

/// Where a ray's line crosses a triangle. All three are finite.
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
    /// `None` unless all are finite.
    #[inline]
    fn finite(t: f32, u: f32, v: f32) -> Option<Self> {
        (t.is_finite() && u.is_finite() && v.is_finite()).then_some(Self { t, u, v })
    }

    /// With weights that are still to be divided by their `whole`; `None` if that is 0, or out of f32's full precision.
    #[inline]
    fn over(whole: f32, t: f32, u: f32, v: f32) -> Option<Self> {
        if whole.is_normal() { Self::finite(t, u / whole, v / whole) } else { None }
    }
}

/// A ray–triangle intersection method.
///
/// The contract, for all of them:
/// - Numbers are f32, operations IEEE 754's, never fused: the same bits on every machine.
/// - What is tested is the ray's whole line: limits on t are the caller's.
/// - A ray in the triangle's plane (N·d = 0), a triangle without area, a number that is not finite, or one that leaves
///   f32 on the way, is a miss: never a panic, never a [`Crossing`] with a NaN.
/// - Rays through an edge or a vertex: as [`About::edges`] says, up to rounding.
pub trait Kernel: Send + Sync + 'static {
    /// What there is to know about it.
    const ABOUT: About;
    /// What is kept of a triangle.
    type Triangle: Copy + Debug + Send + Sync;
    /// What is worked out once a ray.
    type Ray: Copy;

    /// Prepares a triangle with these corners, counter-clockwise seen from the front. If [`About::common_origin`], it then
    /// serves rays from `origin` only; if not, `origin` has no effect.
    fn triangle(corners: [Vec3; 3], origin: Vec3) -> Self::Triangle;

    /// Prepares a ray.
    fn ray(ray: Ray) -> Self::Ray;

    /// Where the ray's line crosses the triangle, if it does.
    fn intersect(triangle: &Self::Triangle, ray: &Self::Ray) -> Option<Crossing>;
}

/// What a method is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct About {
    /// Its name in jobs.
    pub name: &'static str,
    /// Where it was published.
    pub paper: &'static str,
    /// What edges and vertices belong to.
    pub edges: Edges,
    /// Which sides it does not see.
    pub culling: Culling,
    /// Whether what it keeps of a triangle serves rays from one origin only.
    pub common_origin: bool,
}

/// What a ray through an edge or a vertex hits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edges {
    /// Every triangle that the edge belongs to, where rounding lets it.
    Inclusive,
    /// None.
    Exclusive,
    /// As [`Inclusive`](Edges::Inclusive), and the triangles at an edge work out the same number for it: no ray passes
    /// between two of them for their disagreeing on which side it is. Around a vertex the numbers need not fit together.
    Consistent,
    /// At least one of its triangles, at edges and vertices of a closed mesh, always.
    Watertight,
}

/// The sides of triangles that a method does not see.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Culling {
    /// It sees both.
    None,
    /// It sees triangles from behind only.
    Front,
    /// It sees triangles from the front only: where their corners are counter-clockwise.
    Back,
}

impl Culling {
    /// Whether it lets a ray that comes from a triangle's front (or else its back) hit it.
    pub fn sees(self, from_front: bool) -> bool {
        match self {
            Self::None => true,
            Self::Front => !from_front,
            Self::Back => from_front,
        }
    }
}

/// A ray and a triangle's corners.
pub type RayTriangle = (Ray, [Vec3; 3]);

/// An entry of [`METHODS`]: a [`Kernel`] as a value.
#[derive(Clone, Copy, Debug)]
pub struct Method {
    /// What it is.
    pub about: About,
    /// What it keeps of a triangle, in bytes.
    pub bytes_per_triangle: usize,
    intersect: fn(&Ray, [Vec3; 3]) -> Option<Crossing>,
    batch: fn(&[RayTriangle]) -> Box<dyn Fn() -> usize>,
    tracer: for<'s> fn(&Arc<Tracer<'s>>) -> Box<dyn MethodTracer + 's>,
}

impl Method {
    const fn of<K: Kernel>() -> Self {
        Self {
            about: K::ABOUT,
            bytes_per_triangle: size_of::<K::Triangle>(),
            intersect: |ray, corners| K::intersect(&K::triangle(corners, ray.origin), &K::ray(*ray)),
            batch: |pairs| {
                let prepare =
                    |(ray, corners): &RayTriangle| (K::triangle(*corners, ray.origin), K::ray(*ray));
                let prepared: Vec<_> = pairs.iter().map(prepare).collect();
                Box::new(move || prepared.iter().filter(|(t, r)| K::intersect(t, r).is_some()).count())
            },
            tracer: |exact| Box::new(KernelTracer::<K>::new(exact.clone())),
        }
    }

    /// The method of a name.
    pub fn named(name: &str) -> Option<&'static Self> {
        METHODS.iter().find(|m| m.about.name == name)
    }

    /// Prepares ray and triangle and intersects them.
    pub fn intersect(&self, ray: &Ray, corners: [Vec3; 3]) -> Option<Crossing> {
        (self.intersect)(ray, corners)
    }

    /// Prepares pairs, and gives what intersects each of them and counts the crossings: the thing to time.
    pub fn batch(&self, pairs: &[RayTriangle]) -> Box<dyn Fn() -> usize> {
        (self.batch)(pairs)
    }

    /// A tracer that decides by this method, on the hierarchies of `exact`.
    pub fn tracer<'s>(&self, exact: &Arc<Tracer<'s>>) -> Box<dyn MethodTracer + 's> {
        (self.tracer)(exact)
    }
}

/// Every method there is.
pub static METHODS: [Method; 16] = [
    Method::of::<curless::Curless>(),
    Method::of::<homogeneous::Homogeneous>(),
    Method::of::<left_of_edge::LeftOfEdge>(),
    Method::of::<moller_trumbore::MollerTrumbore>(),
    Method::of::<moller_trumbore::MollerTrumboreFrontCulled>(),
    Method::of::<moller_trumbore::MollerTrumboreBackCulled>(),
    Method::of::<sunday::Sunday>(),
    Method::of::<sunday::SundayPrecomputed>(),
    Method::of::<badouel::Badouel>(),
    Method::of::<segura_feito::SeguraFeitoSegment>(),
    Method::of::<segura_feito::SeguraFeito>(),
    Method::of::<segura_feito::SeguraFeitoPrecomputed>(),
    Method::of::<held::Held>(),
    Method::of::<plucker::Plucker>(),
    Method::of::<watertight::Watertight>(),
    Method::of::<baldwin_weber::BaldwinWeber>(),
];

/// The least slope, an area (m²) times a cosine, that has a depth: sides of 3·10⁻¹³ m, whose volumes, and so the heights
/// that slopes divide, are just within f32.
const LEAST_SLOPE: f32 = 1.0 / (1_u128 << 83) as f32;

/// t of a plane at `height` along its normal, which a ray approaches by `slope` a length. `None` for a ray in the plane, a
/// triangle without area, and what leaves f32.
#[inline]
fn depth(height: f32, slope: f32) -> Option<f32> {
    (slope.abs() >= LEAST_SLOPE && slope.is_finite()).then(|| height / slope)
}

/// The weights (u, v) of B and C from numbers that are in proportion to those of A, B and C, if all have one sign; zeros
/// have either.
#[inline]
fn same_sign(a: f32, b: f32, c: f32) -> Option<(f32, f32)> {
    let (least, most) = (a.min(b).min(c), a.max(b).max(c));
    let sum = a + b + c;
    ((least >= 0.0 || most <= 0.0) && sum.is_normal()).then(|| (b / sum, c / sum))
}

/// Which axis a projection drops. The two that are kept follow it in the cycle x, y, z, so that a projected triangle's
/// winding is that of the sign of the normal's dropped component.
#[derive(Clone, Copy, Debug)]
struct Axes(u32);

impl Axes {
    /// Drops the axis along which |n| is largest.
    fn around_largest(n: Vec3) -> Self {
        let n = n.abs();
        Self(if n.x >= n.y && n.x >= n.z {
            0
        } else if n.y >= n.z {
            1
        } else {
            2
        })
    }

    #[inline]
    fn keep(self, p: Vec3) -> Vec2 {
        match self.0 {
            0 => Vec2::new(p.y, p.z),
            1 => Vec2::new(p.z, p.x),
            _ => Vec2::new(p.x, p.y),
        }
    }

    #[inline]
    fn dropped(self, p: Vec3) -> f32 {
        match self.0 {
            0 => p.x,
            1 => p.y,
            _ => p.z,
        }
    }
}
