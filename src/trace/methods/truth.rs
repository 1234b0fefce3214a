//! The exact intersection of a ray and a triangle, in integers of any size, to judge methods by.
//!
//! Every f32 is a whole multiple of a power of two. Scaled by the least of these powers, all coordinates are integers, and so
//! are the determinants that decide, and the numerator and the denominator of t. Nothing is rounded.

use glam::Vec3;
use num_bigint::{BigInt, Sign};

use super::kernel::{About, Edges, Ray};

/// The exact intersection of a ray and a triangle.
#[derive(Clone, Debug)]
pub struct Truth {
    /// Signs of det(d, b, c), det(d, c, a), det(d, a, b), where a, b, c are the corners as seen from the origin.
    signs: [i8; 3],
    /// t = (a·N) / (d·N).
    height: BigInt,
    slope: BigInt,
}

/// The part of a triangle that a ray's line passes through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passage {
    /// The line passes through the inside.
    Interior,
    /// The line passes exactly through an edge.
    Edge,
    /// The line passes exactly through a vertex.
    Vertex,
    /// The line passes by the triangle.
    Outside,
    /// The line is in the triangle's plane, or the triangle has no area.
    InPlane,
}

impl Truth {
    /// Intersects the ray and the triangle; `None` if a number is not finite.
    pub fn of(ray: &Ray, corners: [Vec3; 3]) -> Option<Self> {
        let all = [ray.origin, ray.direction, corners[0], corners[1], corners[2]];
        if !all.iter().all(|p| p.is_finite()) {
            return None;
        }
        let parts = all.map(|p| p.to_array().map(parts));
        let least = parts.iter().flatten().filter(|(m, _)| *m != 0).map(|(_, e)| *e).min().unwrap_or(0);
        let [o, d, a, b, c] =
            parts.map(|p| p.map(|(m, e)| if m == 0 { BigInt::ZERO } else { BigInt::from(m) << (e - least) }));
        let [a, b, c] = [sub(&a, &o), sub(&b, &o), sub(&c, &o)];
        let sign = |p: &Integers, q: &Integers| match dot(&d, &cross(p, q)).sign() {
            Sign::Minus => -1,
            Sign::NoSign => 0,
            Sign::Plus => 1,
        };
        let signs = [sign(&b, &c), sign(&c, &a), sign(&a, &b)];
        let n = cross(&sub(&b, &a), &sub(&c, &a));
        Some(Self { signs, height: dot(&a, &n), slope: dot(&d, &n) })
    }

    /// The part of the triangle that the ray's line passes through.
    pub fn passage(&self) -> Passage {
        let count = |sign| self.signs.iter().filter(|&&s| s == sign).count();
        if self.slope.sign() == Sign::NoSign {
            Passage::InPlane
        } else if count(1) > 0 && count(-1) > 0 {
            Passage::Outside
        } else {
            match count(0) {
                0 => Passage::Interior,
                1 => Passage::Edge,
                _ => Passage::Vertex,
            }
        }
    }

    /// Whether the ray comes from the side on which the corners are counter-clockwise.
    pub fn from_front(&self) -> bool {
        self.slope.sign() == Sign::Minus
    }

    /// Whether a method without rounding errors finds a hit, by its own rule for edges and culling.
    pub fn is_hit(&self, about: &About) -> bool {
        about.culling.sees(self.from_front())
            && match self.passage() {
                Passage::Interior => true,
                Passage::Edge | Passage::Vertex => about.edges != Edges::Exclusive,
                Passage::Outside | Passage::InPlane => false,
            }
    }

    /// t, rounded once; NaN in the plane.
    pub fn t(&self) -> f64 {
        quotient(&self.height, &self.slope)
    }

    /// The error t̂ − t of a computed depth t̂: evaluated exactly and rounded once. NaN in the plane.
    pub fn error_of(&self, t: f32) -> f64 {
        let (m, e) = parts(t);
        // t̂ = m·2^e, so t̂ − t = (m·slope·2^e − height) / slope.
        let (computed, height, slope) = if e < 0 {
            (&self.slope * m, &self.height << -e, &self.slope << -e)
        } else {
            ((&self.slope * m) << e, self.height.clone(), self.slope.clone())
        };
        quotient(&(computed - height), &slope)
    }
}

type Integers = [BigInt; 3];

/// A finite f32 as mantissa and exponent: m·2^e.
fn parts(x: f32) -> (i32, i32) {
    let bits = x.to_bits();
    let (exponent, fraction) = ((bits >> 23 & 0xff) as i32, (bits & 0x7f_ffff) as i32);
    let (m, e) = if exponent == 0 { (fraction, -149) } else { (fraction | 1 << 23, exponent - 150) };
    // A mantissa without trailing zeros keeps the common scale, and so the integers, small.
    let zeros = if m == 0 { 0 } else { m.trailing_zeros() };
    let m = m >> zeros;
    (if bits >> 31 == 1 { -m } else { m }, e + zeros as i32)
}

fn sub(p: &Integers, q: &Integers) -> Integers {
    [&p[0] - &q[0], &p[1] - &q[1], &p[2] - &q[2]]
}

fn dot(p: &Integers, q: &Integers) -> BigInt {
    &p[0] * &q[0] + &p[1] * &q[1] + &p[2] * &q[2]
}

fn cross(p: &Integers, q: &Integers) -> Integers {
    [&p[1] * &q[2] - &p[2] * &q[1], &p[2] * &q[0] - &p[0] * &q[2], &p[0] * &q[1] - &p[1] * &q[0]]
}

/// p/q, with a relative error of at most 2⁻⁵².
fn quotient(p: &BigInt, q: &BigInt) -> f64 {
    if q.sign() == Sign::NoSign {
        return f64::NAN;
    }
    // The shift gives the integer quotient 64 bits or more, so the part that is cut off is less than its last bit.
    let shift = 65 + q.bits() as i64 - p.bits() as i64;
    let whole = if shift >= 0 { (p << shift) / q } else { p / (q << -shift) };
    let (sign, digits) = (whole.sign(), whole.magnitude());
    let extra = digits.bits().saturating_sub(64);
    let leading = (digits >> extra).iter_u64_digits().next().unwrap_or(0);
    let value = libm::ldexp(leading as f64, (extra as i64 - shift).clamp(-5000, 5000) as i32);
    if sign == Sign::Minus { -value } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(o: [f32; 3], d: [f32; 3], corners: [[f32; 3]; 3]) -> Truth {
        Truth::of(&Ray { origin: o.into(), direction: d.into() }, corners.map(Vec3::from)).unwrap()
    }

    const FACING: [[f32; 3]; 3] = [[2.0, -1.0, -1.0], [2.0, 1.0, -1.0], [2.0, 0.0, 1.0]];

    #[test]
    fn passages() {
        let at = |y: f32, z: f32| truth([0.0; 3], [2.0, y, z], FACING).passage();
        assert_eq!(at(0.0, 0.0), Passage::Interior);
        assert_eq!(at(0.0, -1.0), Passage::Edge);
        assert_eq!(at(0.5, 0.0), Passage::Edge);
        assert_eq!(at(0.0, 1.0), Passage::Vertex);
        assert_eq!(at(0.0, 1.0_f32.next_up()), Passage::Outside);
        assert_eq!(at(0.5, -f32::MIN_POSITIVE), Passage::Interior);
        assert_eq!(truth([0.0; 3], [0.0, 1.0, 0.0], FACING).passage(), Passage::InPlane);
        assert_eq!(truth([0.0; 3], [1.0, 0.0, 0.0], [[1.0; 3]; 3]).passage(), Passage::InPlane);
        // Counter-clockwise seen from +x; the ray comes from −x.
        assert!(!truth([0.0; 3], [1.0, 0.0, 0.0], FACING).from_front());
        assert!(truth([9.0, 0.0, 0.0], [-1.0, 0.0, 0.0], FACING).from_front());
        let nan = Ray { origin: Vec3::NAN, direction: Vec3::X };
        assert!(Truth::of(&nan, FACING.map(Vec3::from)).is_none());
    }

    #[test]
    fn depths_and_their_errors() {
        let t = truth([0.0; 3], [3.0, 0.0, 0.0], FACING);
        assert_eq!(t.t(), 2.0 / 3.0);
        let third = (2.0_f64 / 3.0) as f32;
        // 2/3 in f32 is (2²⁵ + 1)/3·2⁻²⁴ … off by exactly 2⁻²⁵·(2/3).
        assert_eq!(t.error_of(third), libm::ldexp(2.0 / 3.0, -25));
        assert!((t.error_of(-third) - (f64::from(-third) - 2.0 / 3.0)).abs() < 1e-15);
        assert_eq!(t.error_of(0.0), -2.0 / 3.0);
        // The extremes of f32 together.
        let far = truth([0.0; 3], [1e-38, 0.0, 0.0], FACING.map(|p| p.map(|x| x * 1e38)));
        assert!((far.t() / 2e76 - 1.0).abs() < 1e-7, "{}", far.t());
        assert_eq!(far.passage(), Passage::Interior);
        let near = truth([0.0; 3], [1e38, 0.0, 0.0], FACING.map(|p| p.map(|x| x * 1e-38)));
        assert!((near.t() / 2e-76 - 1.0).abs() < 1e-6, "{}", near.t());
    }

    #[test]
    fn numbers_come_apart_and_together() {
        for x in [0.0, -0.0, 1.0, -1.5, 1e-45, f32::MIN_POSITIVE, f32::MAX, 0.1] {
            let (m, e) = parts(x);
            assert_eq!(libm::ldexp(f64::from(m), e), f64::from(x));
        }
    }
}
