//! The error bounds of the tests in f32, held to exact arithmetic.

use glam::DVec3;

use super::triangles::{EDGE, EDGE_AIMED, EDGE_MULTI_ORIGIN, Middle, PreparedTriangles, SLOPE, VOLUME};
use super::{PacketStack, RayData, RayPacket};
use crate::rng::Rng;
use crate::trace::adversary::Case;
use crate::trace::batch::{NearestHits, PACKET_RAYS, chunk};
use crate::trace::bvh::{self, LeafBlock};
use crate::trace::dyadic::{Dyadic, cross, determinant, difference, dot};
use crate::trace::rays::Origins;
use crate::trace::rounding::{TINY, U};
use crate::trace::simd::{self, F32x8, F32x16, PortableF32x8, SimdTask};

/// The largest errors that were seen, in the units of the constants, and the number of tests.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    edge: f64,
    volume: f64,
    slope: f64,
    aimed_edge: f64,
    /// The largest share of its bound by which an edge function of g′ differs from that of the ray, and the number of these.
    aim: f64,
    aimed: usize,
    tests: usize,
}

impl Errors {
    fn or(self, other: Self) -> Self {
        Self {
            edge: self.edge.max(other.edge),
            volume: self.volume.max(other.volume),
            slope: self.slope.max(other.slope),
            aimed_edge: self.aimed_edge.max(other.aimed_edge),
            aim: self.aim.max(other.aim),
            aimed: self.aimed + other.aimed,
            tests: self.tests + other.tests,
        }
    }
}

/// Measures the errors over many cases.
struct Measure<const MULTI_ORIGIN: bool>;

impl<const MULTI_ORIGIN: bool> SimdTask for Measure<MULTI_ORIGIN> {
    type Output = Errors;

    #[inline(always)]
    fn run<S: F32x8>(self) -> Errors {
        let mut rng = Rng::new(1);
        let mut errors = Errors::default();
        for _ in 0..1500 {
            let spread = if MULTI_ORIGIN { [1e-9, 1e-5, 1e-3][rng.below(3)] } else { 0.0 };
            errors = errors.or(errors_of::<S, MULTI_ORIGIN>(&Case::new(&mut rng, spread)));
        }
        errors
    }
}

/// x, y and z in the packet's axes, w reversed as the packet's is.
fn in_axes<const MULTI_ORIGIN: bool>(packet: &RayPacket<MULTI_ORIGIN>, p: DVec3) -> [Dyadic; 3] {
    let [u, v, w] = packet.axes.map(|axis| Dyadic::of(p[axis]));
    [u, v, if packet.reversed { -w } else { w }]
}

#[inline(always)]
fn errors_of<S: F32x8, const MULTI_ORIGIN: bool>(case: &Case) -> Errors {
    let mut errors = Errors::default();
    let bvh = bvh::build(&case.mesh);
    let origins = if MULTI_ORIGIN { Origins::Each(&case.origins) } else { Origins::Common(case.origins[0]) };
    let (mut data, mut stack) = (RayData::default(), PacketStack::default());
    let nearest = NearestHits::new(f64::INFINITY);
    let limits = (0.0, f64::INFINITY);
    let packet =
        RayPacket::<MULTI_ORIGIN>::new::<S>(&bvh, 0, origins, &case.directions, limits, &nearest, &mut data);
    let Some(packet) = packet else { return errors };
    packet.push_root::<S>(&mut stack);
    while let Some(leaf) = packet.next_leaf::<S>(&mut stack) {
        let block = LeafBlock::at(&bvh.blocks, leaf.number);
        let m = leaf.bounds.largest_coordinate();
        let middle = Middle::of(&packet, &leaf.bounds, m);
        let prepared = PreparedTriangles::<S, MULTI_ORIGIN>::new(&packet, &block, m, &middle);
        let met = packet.rays_in::<S>(&leaf);
        for ray in 0..case.directions.len() {
            let meets = met >> ray & 1 != 0;
            errors = errors.or(errors_of_ray(&packet, &block, &prepared, (&middle, m), ray, meets));
        }
    }
    errors
}

/// The errors of one ray against all triangles of a leaf.
#[inline(always)]
fn errors_of_ray<S: F32x8, const MULTI_ORIGIN: bool>(
    packet: &RayPacket<MULTI_ORIGIN>,
    block: &LeafBlock,
    prepared: &PreparedTriangles<S, MULTI_ORIGIN>,
    (middle, m): (&Middle, f32),
    ray: usize,
    meets: bool,
) -> Errors {
    let mut errors = Errors::default();
    // In f32, as a leaf is tested.
    let pair = ray & !1;
    let eight = |values: &[[f32; PACKET_RAYS]; 2]| [0, 1].map(|k| S::load(chunk(&values[k], 0)));
    let lines = prepared.lines(eight(&packet.rays.g), eight(&packet.rays.offset));
    let edges = prepared.for_pairs().edges_of(&lines, pair);
    let half = |edge: S::F32x16| if ray == pair { edge.halves().0 } else { edge.halves().1 };
    let edges = edges.map(|edge| stored(half(edge)));
    let one_by_one = prepared.one_by_one();
    let of_ray = |values: &[f32]| S::splat(values[ray]);
    let slope = prepared.normal.dot_ray([of_ray(&packet.rays.g[0]), of_ray(&packet.rays.g[1])]);
    let mut volume = prepared.volume;
    if MULTI_ORIGIN {
        let s = [0, 1].map(|k| of_ray(&packet.rays.offset[k]));
        volume = prepared.normal.less_offset(s, volume);
    }
    let (z_low, z_high) = prepared.depths(slope, volume);
    let (slopes, volumes, z_low, z_high) = (stored(slope), stored(volume), stored(z_low), stored(z_high));

    // Exactly. With the ray's direction d in place of g, everything is d_w times as large.
    let d = in_axes(packet, packet.directions[ray]);
    let o = in_axes(packet, packet.origin(ray));
    let common = in_axes(packet, packet.start);
    let from_common = difference(&o, &common);
    let start = from_common[2].clone();
    // d_w·g′, with d_w·s = d_w·(o_u − o′_u, o_v − o′_v) − start·(d_u, d_v).
    let aim = |k: usize| {
        let s = from_common[k].clone() * d[2].clone() - d[k].clone() * start.clone();
        d[k].clone() + s * Dyadic::of(middle.per_depth.into())
    };
    let aim = [aim(0), aim(1), d[2].clone()];
    let per = |error: Dyadic, bound: f32, constant: f32| {
        // error / d_w in units of which the bound has `constant`.
        error.abs().to_f64() / d[2].to_f64() / f64::from(bound) * f64::from(constant)
    };
    for lane in (0..block.triangles).filter(|lane| prepared.oriented >> lane & 1 != 0) {
        errors.tests += 1;
        let corners = block.positions(lane).map(|p| in_axes(packet, DVec3::from(p.map(f64::from))));
        let [a, b, c] = [0, 1, 2].map(|k| difference(&corners[k], &o));
        let normal = cross(&difference(&b, &a), &difference(&c, &a));
        let side = |x: Dyadic, is_front: bool| if is_front { x } else { -x };
        let slope = dot(&d, &normal);
        let volume = dot(&a, &normal) * d[2].clone() + start.clone() * slope.clone();
        let is_front = volume.sign() > 0;
        let determinants = [determinant(&d, &b, &c), determinant(&d, &c, &a), determinant(&d, &a, &b)];
        let [a, b, c] = [0, 1, 2].map(|k| difference(&corners[k], &common));
        let aimed = [determinant(&aim, &b, &c), determinant(&aim, &c, &a), determinant(&aim, &a, &b)];
        let bound = middle.edge_error(block.extent() * (1.0 + 4.0 * U) + 4.0 * U * m);
        let (is_aimed, constant, off) = match prepared.aimed {
            Some(_) => (true, EDGE_AIMED, bound),
            None => (false, if MULTI_ORIGIN { EDGE_MULTI_ORIGIN } else { EDGE }, 0.0),
        };
        let of_triangle = one_by_one.edges_of::<S>(lane, &lines).map(|edge| stored(edge)[ray]);
        let found = edges.iter().map(|edge| edge[lane]).zip(of_triangle);
        for ((found, aimed), exact) in found.zip(aimed).zip(determinants) {
            let (aimed, exact) = (aimed * Dyadic::of(2.0), exact * Dyadic::of(2.0));
            if MULTI_ORIGIN && meets {
                errors.aimed += 1;
                errors.aim = errors.aim.max(per(aimed.clone() - exact.clone(), bound + TINY, 1.0));
            }
            let exact = side(if is_aimed { aimed } else { exact }, is_front);
            let largest = if is_aimed { &mut errors.aimed_edge } else { &mut errors.edge };
            // Of eight triangles at a time, and of one.
            for found in [found.0, found.1] {
                let error = Dyadic::of(found.into()) * d[2].clone() - exact.clone();
                *largest = largest.max(per(error, prepared.edge_error - off, constant));
            }
        }
        let (volume, slope) = (side(volume, is_front), side(slope, is_front));
        let error = Dyadic::of(volumes[lane].into()) * d[2].clone() - volume.clone();
        errors.volume = errors.volume.max(per(error, prepared.volume_error, VOLUME));
        let error = Dyadic::of(slopes[lane].into()) * d[2].clone() - slope.clone();
        errors.slope = errors.slope.max(per(error, prepared.slope_error, SLOPE));
        if slopes[lane] >= 4.0 * prepared.slope_error {
            let low = Dyadic::of(z_low[lane].into()) * slope.clone() - volume.clone();
            let high = Dyadic::of(z_high[lane].into()) * slope - volume;
            assert!(low.sign() <= 0 && high.sign() >= 0, "the bounds of z must hold it");
        }
    }
    errors
}

#[inline(always)]
fn stored<S: F32x8>(x: S) -> [f32; 8] {
    let mut to = [0.0; 8];
    x.store(&mut to);
    to
}

fn measured<const MULTI_ORIGIN: bool>() -> Errors {
    let mut errors = Measure::<MULTI_ORIGIN>.run::<PortableF32x8>();
    #[cfg(target_arch = "x86_64")]
    {
        if simd::has_avx2() {
            errors = errors.or(simd::run_with_avx2(Measure::<MULTI_ORIGIN>));
        }
        if simd::has_avx512() {
            errors = errors.or(simd::run_with_avx512(Measure::<MULTI_ORIGIN>));
        }
    }
    errors
}

/// The bounds add up the worst cases of all roundings, which never meet. The largest errors seen were 5.3 of [`EDGE`], 3.2 of
/// [`VOLUME`] and 1.4 of [`SLOPE`], so the test fails if a constant is made a fifteenth of what it is.
#[test]
fn the_bounds_of_packets_from_one_point_hold() {
    let Errors { edge, volume, slope, tests, .. } = measured::<false>();
    assert!(tests > 10_000, "{tests}");
    assert!(edge <= f64::from(EDGE), "{edge}");
    assert!(volume <= f64::from(VOLUME), "{volume}");
    assert!(slope <= f64::from(SLOPE), "{slope}");
}

/// The largest errors seen were 3.0 of [`EDGE_MULTI_ORIGIN`], 6.9 of [`EDGE_AIMED`], 2.5 of [`VOLUME`] and 1.0 of [`SLOPE`]. Aiming
/// changed an edge function by up to 0.55 of the bound of that.
#[test]
fn the_bounds_of_packets_from_many_points_hold() {
    let Errors { edge, volume, slope, aimed_edge, aim, aimed, tests } = measured::<true>();
    assert!(tests > 10_000, "{tests}");
    assert!(aimed > 10_000, "{aimed}");
    assert!(aim <= 1.0, "{aim}");
    assert!(aimed_edge <= f64::from(EDGE_AIMED), "{aimed_edge}");
    assert!(edge <= f64::from(EDGE_MULTI_ORIGIN), "{edge}");
    assert!(volume <= f64::from(VOLUME), "{volume}");
    assert!(slope <= f64::from(SLOPE), "{slope}");
}
