//! Formulas that are in circulation with a mistake. Each test shows that the printed formula fails and that the corrected one
//! holds, in f64, against the solution of o + t·d = A + u·e1 + v·e2 by determinants.

use glam::DVec3;

use crate::rng::Rng;

/// A triangle and a ray through its inside, with the true depth and weights.
struct Case {
    a: DVec3,
    b: DVec3,
    c: DVec3,
    e1: DVec3,
    e2: DVec3,
    n: DVec3,
    o: DVec3,
    d: DVec3,
    t: f64,
    u: f64,
    v: f64,
}

const CASES: usize = 2000;

fn cases() -> Vec<Case> {
    let mut rng = Rng::new(1);
    let mut cases = Vec::new();
    while cases.len() < CASES {
        let (a, b, c, o) = (rng.point(), rng.point(), rng.point(), rng.point() * 3.0);
        let (e1, e2) = (b - a, c - a);
        let n = e1.cross(e2);
        let (u, v) = (0.25 + 0.2 * rng.signed(), 0.25 + 0.2 * rng.signed());
        let t = 1.5 + 0.5 * rng.signed();
        let d = (a + e1 * u + e2 * v - o) / t;
        // Rays nearly in the plane and triangles nearly without an area are left out.
        if n.dot(d).abs() > 0.05 * d.length() {
            cases.push(Case { a, b, c, e1, e2, n, o, d, t, u, v });
        }
    }
    cases
}

fn holds(x: f64, y: f64) -> bool {
    (x - y).abs() < 1e-9
}

fn count(is_so: impl Fn(&Case) -> bool) -> usize {
    cases().iter().filter(|case| is_so(case)).count()
}

impl Case {
    fn p(&self) -> DVec3 {
        self.o + self.d * self.t
    }

    /// w·e1, w·e2, p1, p2, p3 of Sunday's method.
    fn sunday(&self) -> [f64; 5] {
        let w = self.p() - self.a;
        let Self { e1, e2, .. } = self;
        [w.dot(*e1), w.dot(*e2), e1.dot(*e2), e1.dot(*e1), e2.dot(*e2)]
    }

    /// d·(b×c), d·(c×a), d·(a×b) of Segura and Feito's.
    fn volumes(&self) -> [f64; 3] {
        let [a, b, c] = [self.a - self.o, self.b - self.o, self.c - self.o];
        [self.d.dot(b.cross(c)), self.d.dot(c.cross(a)), self.d.dot(a.cross(b))]
    }
}

#[test]
fn homogeneous_the_vector_for_b_is_perpendicular_to_ca() {
    let weight =
        |c: &Case, perpendicular: DVec3| (c.p() - c.c).dot(perpendicular) / (c.b - c.c).dot(perpendicular);
    assert_eq!(count(|c| holds(weight(c, c.n.cross(c.a - c.b)), c.u)), 0, "N×(A−B), as printed");
    assert_eq!(count(|c| holds(weight(c, c.n.cross(c.a - c.c)), c.u)), CASES);
}

#[test]
fn moller_trumbore_the_basis_is_of_edges_from_the_first_corner() {
    // s = o − A = −t·d + u·e1 + v·e2.
    let rest = |c: &Case, e1: DVec3, e2: DVec3| (e1 * c.u + e2 * c.v - c.d * c.t - (c.o - c.a)).length();
    assert_eq!(count(|c| holds(rest(c, c.a - c.b, c.a - c.c), 0.0)), 0, "v1−v2 and v1−v3, as printed");
    assert_eq!(count(|c| holds(rest(c, c.e1, c.e2), 0.0)), CASES);
}

#[test]
fn moller_trumbore_an_equals_sign_is_missing_between_determinants() {
    let (x, y, z) = (DVec3::new(1.0, 2.0, 4.0), DVec3::new(-1.0, 3.0, 0.5), DVec3::new(2.0, 0.0, 1.0));
    let determinant = x.cross(y).dot(z);
    assert_ne!(-x.cross(z).dot(y) - z.cross(y).dot(x), determinant, "as printed");
    assert_eq!(-x.cross(z).dot(y), determinant);
    assert_eq!(-z.cross(y).dot(x), determinant);
}

#[test]
fn moller_trumbore_an_absolute_epsilon_refuses_small_triangles() {
    use super::{Method, Ray};
    use glam::Vec3;

    // The target is a millimetre large and squarely in front.
    let corners = [Vec3::new(0.0, 0.0, 5.0), Vec3::new(1e-3, 0.0, 5.0), Vec3::new(0.0, 1e-3, 5.0)];
    let ray = Ray { origin: Vec3::new(2e-4, 2e-4, 0.0), direction: Vec3::Z };
    let (e1, e2) = (corners[1] - corners[0], corners[2] - corners[0]);
    let a = e1.dot(ray.direction.cross(e2));
    assert!(
        a.abs() <= 1.1e-6 && a != 0.0,
        "the customary epsilon of 1e-6 or 1e-5 takes it for parallel: {a}"
    );
    let hit = Method::named("moller-trumbore").unwrap().intersect(&ray, corners).unwrap();
    assert!((hit.t - 5.0).abs() < 1e-6 && (hit.u - 0.2).abs() < 1e-4);
}

#[test]
fn sunday_u_and_v() {
    let p4 = |[_, _, p1, p2, p3]: [f64; 5]| 1.0 / (p1 * p1 - p2 * p3);
    let printed_u = |s @ [we1, we2, p1, p2, _]: [f64; 5]| (p1 * we1 - p2 * we2) * p4(s);
    let printed_v = |s @ [we1, we2, p1, _, p3]: [f64; 5]| (p1 * we1 - p3 * we2) * p4(s);
    let u = |s @ [we1, we2, p1, _, p3]: [f64; 5]| (p1 * we2 - p3 * we1) * p4(s);
    let v = |s @ [we1, we2, p1, p2, _]: [f64; 5]| (p1 * we1 - p2 * we2) * p4(s);
    assert_eq!(count(|c| holds(printed_u(c.sunday()), c.u)), 0, "p1(w·e1) − p2(w·e2), as printed");
    assert_eq!(count(|c| holds(printed_v(c.sunday()), c.v)), 0, "p1(w·e1) − p3(w·e2), as printed");
    assert_eq!(count(|c| holds(u(c.sunday()), c.u) && holds(v(c.sunday()), c.v)), CASES);
}

#[test]
fn sunday_the_reciprocal_is_of_the_whole_difference() {
    let v = |[we1, we2, p1, p2, _]: [f64; 5], p4: f64| (p1 * we1 - p2 * we2) * p4;
    let printed = |s @ [_, _, p1, p2, p3]: [f64; 5]| v(s, 1.0 / (p1 * p1) - p2 * p3);
    let correct = |s @ [_, _, p1, p2, p3]: [f64; 5]| v(s, 1.0 / (p1 * p1 - p2 * p3));
    assert_eq!(count(|c| holds(printed(c.sunday()), c.v)), 0, "1/p1² − p2·p3, as printed");
    assert_eq!(count(|c| holds(correct(c.sunday()), c.v)), CASES);
}

#[test]
fn sunday_a_denominator_is_always_zero() {
    let printed = |c: &Case| c.e2.dot(c.n.cross(c.e2));
    assert_eq!(count(|c| holds(printed(c), 0.0)), CASES, "e2·(N×e2), as printed");
    let correct = |c: &Case| (c.p() - c.a).dot(c.n.cross(c.e2)) / c.e1.dot(c.n.cross(c.e2));
    assert_eq!(count(|c| holds(correct(c), c.u)), CASES);
}

#[test]
fn sunday_without_an_area_there_is_no_denominator() {
    // The tutorial says that corners on one line leave the denominators nonzero.
    let (e1, e2) = (DVec3::new(1.0, 2.0, -1.0), DVec3::new(3.0, 6.0, -3.0));
    assert_eq!(e1.dot(e2) * e1.dot(e2) - e1.dot(e1) * e2.dot(e2), 0.0);
    let n = e1.cross(e2);
    assert_eq!((e1.dot(n.cross(e2)), e2.dot(n.cross(e1))), (0.0, 0.0));
}

#[test]
fn badouel_the_normal_is_of_edges_not_of_corners() {
    let t = |c: &Case, n: DVec3| n.dot(c.a - c.o) / n.dot(c.d);
    assert_eq!(count(|c| holds(t(c, c.a.cross(c.b)), c.t)), 0, "v1×v2, as printed");
    assert_eq!(count(|c| holds(t(c, c.n), c.t)), CASES);
}

#[test]
fn badouel_each_difference_is_along_one_axis() {
    // Axes 0 and 1 are kept.
    let solve = |c: &Case, [b1, b2]: [f64; 2]| {
        let (a0, b0) = (c.p().x - c.a.x, c.p().y - c.a.y);
        let (a1, a2) = (c.b.x - c.a.x, c.c.x - c.a.x);
        (a0 * b2 - a2 * b0) / (a1 * b2 - a2 * b1)
    };
    let printed = |c: &Case| solve(c, [c.b.x - c.a.y, c.c.x - c.a.y]);
    let correct = |c: &Case| solve(c, [c.b.y - c.a.y, c.c.y - c.a.y]);
    // The projection along z must have an area.
    let projects = |c: &Case| c.n.z.abs() > 0.01;
    assert_eq!(count(|c| projects(c) && holds(printed(c), c.u)), 0, "v2[i1] − v1[i2], as printed");
    assert_eq!(count(|c| projects(c) && !holds(correct(c), c.u)), 0);
    assert!(count(projects) > CASES / 2);
}

#[test]
fn badouel_the_axis_is_that_of_the_largest_magnitude() {
    // By signed components, as printed, the largest component of (−1, 0, 0) is one of the zeros, and the projection has no
    // area.
    let n = DVec3::new(-1.0, 0.0, 0.0);
    let printed = if n.x > n.y && n.x > n.z {
        0
    } else if n.y < n.z {
        2
    } else {
        1
    };
    assert_eq!(n[printed], 0.0);
    assert_eq!(super::kernel::Axes::around_largest(n.as_vec3()).dropped(n.as_vec3()), -1.0);
}

#[test]
fn segura_feito_the_three_signs_go_round_one_way() {
    // The printed test, d·(v1×v3), d·(v1×v2), d·(v2×v3) > 0, for rays through the inside.
    let one_sign = |s: [f64; 3]| s.iter().all(|&x| x > 0.0) || s.iter().all(|&x| x < 0.0);
    let printed = |c: &Case| {
        let [ea, eb, ec] = c.volumes();
        [-eb, ec, ea]
    };
    assert_eq!(count(|c| one_sign(printed(c))), 0, "as printed");
    assert_eq!(count(|c| one_sign(c.volumes())), CASES);
}

#[test]
fn segura_feito_zeros_are_inside() {
    // A ray through an edge: one of the volumes is zero. The printed code refuses i ≤ 0; the theorem above it says ≥ 0.
    let (a, b, c) = (DVec3::new(-1.0, -1.0, 2.0), DVec3::new(1.0, -1.0, 2.0), DVec3::new(0.0, 1.0, 2.0));
    let d = (a + b) / 2.0;
    let volumes = [d.dot(b.cross(c)), d.dot(c.cross(a)), d.dot(a.cross(b))];
    assert!(!volumes.iter().all(|&v| v > 0.0) && !volumes.iter().all(|&v| v < 0.0), "as printed");
    assert!(volumes.iter().all(|&v| v >= 0.0) || volumes.iter().all(|&v| v <= 0.0));
}

#[test]
fn segura_feito_the_volumes_are_the_weights() {
    // The tutorial says that the method does not give barycentric coordinates.
    let weights = |c: &Case| {
        let [ea, eb, ec] = c.volumes();
        (eb / (ea + eb + ec), ec / (ea + eb + ec))
    };
    assert_eq!(count(|c| holds(weights(c).0, c.u) && holds(weights(c).1, c.v)), CASES);
}
