//! Lenses: the projection of directions to the image plane, and its inverse.
//!
//! A distortion model maps undistorted points to distorted ones, and a ray needs the inverse. Every such model folds
//! somewhere: beyond the fold it maps a second direction to the same point, and Newton's method would find either of them.
//! The inverse here is the direction that is connected to the image's centre without crossing the fold. If there is none,
//! the pixel has no ray.

use std::f64::consts::PI;

use glam::{DMat2, DVec2, DVec3};

use super::polynomial::{bisect, derivative, product, sign_changes, value};

/// The projection of a lens. Image coordinates are those of a focal length of 1: (0, 0) is the optical axis, x points
/// right, y points down.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Lens {
    /// A pinhole, which keeps straight lines straight.
    #[default]
    Ideal,
    /// A pinhole with radial and tangential distortion.
    BrownConrady(BrownConrady),
    /// A fisheye.
    KannalaBrandt(KannalaBrandt),
}

impl Lens {
    /// The unit direction of an ideal lens for a point of the image plane.
    #[inline]
    pub(super) fn ideal(image: DVec2) -> DVec3 {
        image.extend(1.0).normalize()
    }

    /// The unit direction in the optical frame (x right, y down, z forward) that is projected to `image`. `None` if the
    /// model has none.
    pub fn unproject(&self, image: DVec2) -> Option<DVec3> {
        match self {
            Self::Ideal => Some(Self::ideal(image)),
            Self::BrownConrady(lens) => lens.undistort(image).map(|p| p.extend(1.0).normalize()),
            Self::KannalaBrandt(lens) => lens.unproject(image),
        }
    }

    /// The image point of a direction in the optical frame, of any length. `None` if the direction is outside of the
    /// model's domain.
    pub fn project(&self, direction: DVec3) -> Option<DVec2> {
        let plane = || (direction.z > 0.0).then(|| direction.truncate() / direction.z);
        match self {
            Self::Ideal => plane(),
            Self::BrownConrady(lens) => plane().filter(|&p| lens.is_valid(p)).map(|p| lens.distort(p)),
            Self::KannalaBrandt(lens) => lens.project(direction),
        }
    }
}

impl Lens {
    /// The distortion coefficients of the lens, in OpenCV's order.
    pub fn coefficients(&self) -> Vec<f64> {
        match self {
            Self::Ideal => Vec::new(),
            Self::BrownConrady(lens) => {
                let ([_, k1, k2, k3], [_, k4, k5, k6], [p1, p2]) = (lens.numerator, lens.denominator, lens.p);
                vec![k1, k2, p1, p2, k3, k4, k5, k6]
            }
            Self::KannalaBrandt(lens) => lens.coefficients[1..].to_vec(),
        }
    }
}

/// Brown's radial and tangential distortion (D. C. Brown, "Close-range camera calibration", 1971) with the rational radial
/// part of OpenCV's `calib3d`: with r² = x² + y² and R = (1 + k1·r² + k2·r⁴ + k3·r⁶)/(1 + k4·r² + k5·r⁴ + k6·r⁶),
///
/// ```text
/// x' = x·R + 2·p1·x·y + p2·(r² + 2x²)
/// y' = y·R + p1·(r² + 2y²) + 2·p2·x·y
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct BrownConrady {
    /// The numerator of R, in powers of r².
    numerator: [f64; 4],
    denominator: [f64; 4],
    p: [f64; 2],
    /// The radius at which r·R stops growing or has its pole. It is infinite if r·R always grows.
    fold: f64,
}

/// No lens is assumed to see beyond this undistorted radius, which is 89.99994 degrees off the axis.
const FARTHEST: f64 = 1e6;

impl BrownConrady {
    /// A lens with the coefficients k1, k2, p1, p2, k3, k4, k5, k6 in OpenCV's order. `None` if one of them is not finite.
    pub fn new([k1, k2, p1, p2, k3, k4, k5, k6]: [f64; 8]) -> Option<Self> {
        let (numerator, denominator) = ([1.0, k1, k2, k3], [1.0, k4, k5, k6]);
        if ![numerator, denominator].concat().iter().chain(&[p1, p2]).all(|c| c.is_finite()) {
            return None;
        }
        // With s = r²: d(r·N/D)/dr = (N·D + 2s·(N'·D − N·D'))/D².
        let (dn, dd) = (derivative(&numerator), derivative(&denominator));
        let mut slope = product(&numerator, &denominator);
        slope.resize(8, 0.0);
        for (power, (a, b)) in product(&dn, &denominator).iter().zip(product(&numerator, &dd)).enumerate() {
            slope[power + 1] += 2.0 * (a - b);
        }
        let ends = [&slope[..], &denominator[..]]
            .map(|c| sign_changes(c, 0.0, FARTHEST * FARTHEST).first().copied().unwrap_or(f64::INFINITY));
        Some(Self { numerator, denominator, p: [p1, p2], fold: ends[0].min(ends[1]).sqrt() })
    }

    /// The distorted image of a point of the undistorted image plane.
    pub fn distort(&self, q: DVec2) -> DVec2 {
        let (r2, [p1, p2]) = (q.length_squared(), self.p);
        let tangential = DVec2::new(
            2.0 * p1 * q.x * q.y + p2 * (r2 + 2.0 * q.x * q.x),
            p1 * (r2 + 2.0 * q.y * q.y) + 2.0 * p2 * q.x * q.y,
        );
        q * self.radial(r2) + tangential
    }

    fn radial(&self, r2: f64) -> f64 {
        value(&self.numerator, r2) / value(&self.denominator, r2)
    }

    /// The Jacobian of [`Self::distort`].
    fn jacobian(&self, q: DVec2) -> DMat2 {
        let (r2, [p1, p2]) = (q.length_squared(), self.p);
        let (n, d) = (value(&self.numerator, r2), value(&self.denominator, r2));
        let slope = |c: &[f64; 4]| c[1] + r2 * (2.0 * c[2] + r2 * 3.0 * c[3]);
        // dR/dr²
        let growth = (slope(&self.numerator) * d - n * slope(&self.denominator)) / (d * d);
        let across = 2.0 * q.x * q.y * growth + 2.0 * p1 * q.x + 2.0 * p2 * q.y;
        let xx = n / d + 2.0 * q.x * q.x * growth + 2.0 * p1 * q.y + 6.0 * p2 * q.x;
        let yy = n / d + 2.0 * q.y * q.y * growth + 6.0 * p1 * q.y + 2.0 * p2 * q.x;
        DMat2::from_cols(DVec2::new(xx, across), DVec2::new(across, yy))
    }

    /// Whether the straight line from the centre to a point stays inside the fold. With tangential distortion the fold is
    /// no circle, so the line is sampled at steps that are much finer than the bends of the fold.
    fn is_valid(&self, q: DVec2) -> bool {
        const STEPS: u32 = 16;
        let tangential = || {
            self.p == [0.0; 2]
                || (1..=STEPS)
                    .all(|i| self.jacobian(q * (f64::from(i) / f64::from(STEPS))).determinant() > 0.0)
        };
        q.length() < self.fold.min(FARTHEST) && tangential()
    }

    /// The undistorted point that is drawn at `image` and lies on the centre's side of the fold.
    fn undistort(&self, image: DVec2) -> Option<DVec2> {
        let target = image.length();
        if target == 0.0 && self.p == [0.0; 2] {
            return Some(DVec2::ZERO);
        }
        // The radial part alone is monotonic up to the fold, so bisection always finds its inverse. Beyond its end the
        // tangential part may reach a little farther.
        let reach = |r: f64| r * self.radial(r * r);
        let mut high = self.fold.min(1.0);
        while high < self.fold.min(FARTHEST) && reach(high) < target {
            high = (2.0 * high).min(self.fold).min(FARTHEST);
        }
        let radius = bisect(0.0, high, |r| reach(r) <= target);
        if self.p == [0.0; 2] {
            let found = image * (radius / target);
            // Close to a pole the image radius grows by more than this tolerance from one float to the next. The target
            // then lies between the images of two neighbouring floats.
            let reached =
                (reach(radius) - target).abs() <= 1e-12 * target.max(1.0) || reach(radius.next_up()) > target;
            return Some(found).filter(|&q| reached && self.is_valid(q));
        }
        let start = if target > 0.0 { image * (radius / target) } else { DVec2::ZERO };
        let is_found = |q: &DVec2| {
            let miss = (self.distort(*q) - image).length();
            q.is_finite() && miss <= 1e-12 * target.max(1.0) && self.is_valid(*q)
        };
        let found = Some(self.approach(start, image)).filter(is_found);
        found.or_else(|| Some(self.approach_steadily(start, image)).filter(is_found))
    }

    /// Goes from a point towards the one that is drawn at `image`, by Newton's method.
    fn approach(&self, start: DVec2, image: DVec2) -> DVec2 {
        let mut q = start;
        for _ in 0..50 {
            let miss = self.distort(q) - image;
            if miss.length() <= 1e-13 * image.length().max(1.0) {
                break;
            }
            let step = self.jacobian(q).inverse() * miss;
            // A longer step would leave the neighbourhood in which the lens is nearly linear.
            let longest = 0.2 * (1.0 + q.length());
            q -= if step.length() > longest { step * (longest / step.length()) } else { step };
        }
        q
    }

    /// Goes there in steps of Newton's method that stay within the fold and are halved until they come nearer. It takes longer, and
    /// finds points close to a fold at which the image grows steeply, where whole steps go back and forth.
    fn approach_steadily(&self, start: DVec2, image: DVec2) -> DVec2 {
        const HALVINGS: i32 = 6;
        let mut q = start;
        let mut miss = self.distort(q) - image;
        for _ in 0..30 {
            if miss.length() <= 1e-13 * image.length().max(1.0) {
                break;
            }
            let step = self.jacobian(q).inverse() * miss;
            let nearer = (0..=HALVINGS).find_map(|halvings| {
                let next = q - step / f64::from(1 << halvings);
                let left = self.distort(next) - image;
                let is_nearer = left.length() < miss.length() && next.length() < self.fold.min(FARTHEST);
                is_nearer.then_some((next, left))
            });
            let Some(nearer) = nearer else { break };
            (q, miss) = nearer;
        }
        q
    }
}

/// The fisheye model of J. Kannala and S. S. Brandt ("A generic camera model and calibration method", 2006) with the odd
/// powers of OpenCV's `fisheye`: a direction at angle θ from the axis is projected to the radius θ·(1 + k1·θ² + k2·θ⁴ +
/// k3·θ⁶ + k4·θ⁸).
#[derive(Clone, Debug, PartialEq)]
pub struct KannalaBrandt {
    /// The coefficients of the radius over θ, in powers of θ².
    coefficients: [f64; 5],
    /// The angle in radians at which the radius stops growing, at most half a turn.
    fold: f64,
}

impl KannalaBrandt {
    /// A lens with the coefficients k1, k2, k3, k4. `None` if one of them is not finite.
    pub fn new([k1, k2, k3, k4]: [f64; 4]) -> Option<Self> {
        let coefficients = [1.0, k1, k2, k3, k4];
        if !coefficients.iter().all(|c| c.is_finite()) {
            return None;
        }
        // With s = θ²: d(θ·P(s))/dθ = P + 2s·P', term by term (2i + 1)·c_i·s^i.
        let slope: Vec<f64> = coefficients.iter().enumerate().map(|(i, c)| (2 * i + 1) as f64 * c).collect();
        let fold = sign_changes(&slope, 0.0, PI * PI).first().map_or(PI, |s| s.sqrt());
        Some(Self { coefficients, fold })
    }

    fn radius(&self, angle: f64) -> f64 {
        angle * value(&self.coefficients, angle * angle)
    }

    fn project(&self, direction: DVec3) -> Option<DVec2> {
        let across = direction.truncate();
        let angle = libm::atan2(across.length(), direction.z);
        if angle > self.fold {
            return None;
        }
        Some(if across.length() > 0.0 {
            across * (self.radius(angle) / across.length())
        } else {
            DVec2::ZERO
        })
    }

    fn unproject(&self, image: DVec2) -> Option<DVec3> {
        let radius = image.length();
        if radius == 0.0 {
            return Some(DVec3::Z);
        }
        if radius > self.radius(self.fold) {
            return None;
        }
        let angle = bisect(0.0, self.fold, |angle| self.radius(angle) <= radius);
        let (sin, cos) = libm::sincos(angle);
        Some((image * (sin / radius)).extend(cos))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The distortion formula of OpenCV's documentation, written out independently.
    fn opencv([k1, k2, p1, p2, k3, k4, k5, k6]: [f64; 8], (x, y): (f64, f64)) -> DVec2 {
        let r2 = x * x + y * y;
        let radial = (1.0 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2)
            / (1.0 + k4 * r2 + k5 * r2 * r2 + k6 * r2 * r2 * r2);
        DVec2::new(
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    }

    /// The pixel lies just before a pole of the rational radial part, where one float's step of the radius moves the image
    /// by 1e-9. The pixel has a ray although no float maps to it exactly.
    #[test]
    fn a_pixel_close_to_a_pole_has_a_ray() {
        let k = [
            0.0,
            0.0,
            0.0,
            0.0,
            0.382717508750669,
            -0.039786426550727366,
            -0.398945233720656,
            -0.1367824473031873,
        ];
        let lens = Lens::BrownConrady(BrownConrady::new(k).unwrap());
        let ray = DVec3::new(0.37825404579805855, 1.0684005238950856, 1.0).normalize();
        let image = lens.project(ray).unwrap();
        assert!(image.length() > 1e3, "{image}");
        assert!(lens.unproject(image).unwrap().abs_diff_eq(ray, 1e-15));
    }

    /// The pixel lies just before the fold, where areas grow by a factor of 28. Whole steps of Newton's method go back and forth
    /// about it.
    #[test]
    fn a_pixel_close_to_a_steep_fold_has_a_ray() {
        let k = [
            -0.2714542400874896,
            0.0,
            0.013256656913992896,
            0.0,
            0.09055901229428019,
            -0.26245161066731304,
            -0.25828290098017487,
            0.09746951968373314,
        ];
        let lens = Lens::BrownConrady(BrownConrady::new(k).unwrap());
        let ray = DVec3::new(0.9260368929119627, 1.256435220938261, 1.0).normalize();
        let image = lens.project(ray).unwrap();
        assert!(lens.unproject(image).unwrap().abs_diff_eq(ray, 1e-12));
    }

    #[test]
    fn distortion_is_opencvs() {
        let k = [0.1, -0.2, 1e-3, -2e-3, 0.05, 0.01, 0.02, -0.003];
        let lens = BrownConrady::new(k).unwrap();
        for (x, y) in [(0.0, 0.0), (0.3, -0.4), (-0.5, 0.1)] {
            assert!((lens.distort(DVec2::new(x, y)) - opencv(k, (x, y))).length() < 1e-15);
        }
        let fisheye = KannalaBrandt::new([0.01, -0.002, 3e-4, -1e-5]).unwrap();
        let theta: f64 = 1.2;
        let t2 = theta * theta;
        let expected =
            theta * (1.0 + 0.01 * t2 - 0.002 * t2 * t2 + 3e-4 * t2 * t2 * t2 - 1e-5 * t2 * t2 * t2 * t2);
        let (sin, cos) = libm::sincos(theta);
        let drawn = fisheye.project(DVec3::new(0.6 * sin, -0.8 * sin, cos)).unwrap();
        assert!((drawn - DVec2::new(0.6, -0.8) * expected).length() < 1e-15);
    }

    #[test]
    fn the_derivative_is_the_limit_of_differences() {
        let lens = BrownConrady::new([0.1, -0.2, 1e-2, -2e-2, 0.05, 0.01, 0.02, -0.003]).unwrap();
        let (q, h) = (DVec2::new(0.4, -0.3), 1e-6);
        for (axis, column) in [(DVec2::X, 0), (DVec2::Y, 1)] {
            let slope = (lens.distort(q + axis * h) - lens.distort(q - axis * h)) / (2.0 * h);
            assert!((slope - lens.jacobian(q).col(column)).length() < 1e-9);
        }
    }

    /// With k1 = −0.3 alone, r − 0.3·r³ is largest at r = 1/√0.9, where it is 0.7027. Pixels farther out have no ray, and
    /// Newton's method from the pixel itself would run to the root on the other side of the fold.
    #[test]
    fn past_the_fold_there_is_no_ray() {
        let lens = BrownConrady::new([-0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
        let fold = 1.0 / 0.9_f64.sqrt();
        assert!((lens.fold - fold).abs() < 1e-12);
        let edge = fold - 0.3 * fold * fold * fold;
        let at = |r: f64| Lens::BrownConrady(lens.clone()).unproject(DVec2::new(0.0, r));
        assert!(at(edge + 1e-9).is_none() && at(1.0).is_none() && at(1e9).is_none());
        let d = at(edge - 1e-9).unwrap();
        assert!(d.y / d.z < fold && d.y / d.z > fold - 1e-3);
        let fisheye = KannalaBrandt::new([-0.1, 0.0, 0.0, 0.0]).unwrap();
        let fold = (1.0 / 0.3_f64).sqrt();
        let lens = Lens::KannalaBrandt(fisheye.clone());
        assert!((fisheye.fold - fold).abs() < 1e-12);
        assert!(lens.unproject(DVec2::new(fisheye.radius(fold) + 1e-9, 0.0)).is_none());
        assert!(lens.project(DVec3::new(libm::sin(fold + 1e-6), 0.0, libm::cos(fold + 1e-6))).is_none());
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

        #[test]
        fn a_distorted_pixel_goes_back_to_its_ray(
            k in prop::array::uniform8(-0.4..0.4_f64),
            x in -1.5..1.5_f64,
            y in -1.5..1.5_f64,
        ) {
            let [k1, k2, p1, p2, k3, k4, k5, k6] = k;
            // The tangential parts of real lenses are small.
            let (p1, p2) = (p1 * 0.05, p2 * 0.05);
            for k in [[k1, k2, p1, p2, k3, k4, k5, k6], [k1, k2, 0.0, 0.0, k3, k4, k5, k6]] {
                let lens = Lens::BrownConrady(BrownConrady::new(k).unwrap());
                let ray = DVec3::new(x, y, 1.0).normalize();
                if let Some(image) = lens.project(ray) {
                    let back = lens.unproject(image);
                    // Near the fold the pixel hardly moves while the ray does, so the model cannot determine the ray any
                    // better.
                    let Lens::BrownConrady(model) = &lens else { unreachable!() };
                    let flat = model.jacobian(DVec2::new(x, y)).determinant();
                    if flat > 1e-2 {
                        let back = back.ok_or_else(|| TestCaseError::fail(format!("no way back: {k:?}")))?;
                        prop_assert!((back - ray).length() < 1e-9, "{back} {ray} {flat}");
                    }
                }
                // Any pixel that has a ray is also the projection of that ray.
                if let Some(ray) = lens.unproject(DVec2::new(x, y)) {
                    let image = lens.project(ray).ok_or_else(|| TestCaseError::fail("a ray past the fold"))?;
                    prop_assert!((image - DVec2::new(x, y)).length() < 1e-10, "{image}");
                }
            }
        }

        #[test]
        fn a_fisheye_pixel_goes_back_to_its_ray(
            k in prop::array::uniform4(-0.1..0.1_f64),
            angle in 0.0..3.1_f64,
            around in 0.0..6.3_f64,
        ) {
            let model = KannalaBrandt::new(k).unwrap();
            let (sin, cos) = libm::sincos(angle);
            let (y, x) = libm::sincos(around);
            let ray = DVec3::new(x * sin, y * sin, cos);
            let lens = Lens::KannalaBrandt(model.clone());
            if angle < model.fold * 0.999 {
                let image = lens.project(ray).unwrap();
                let back = lens.unproject(image).unwrap();
                prop_assert!((back - ray).length() < 1e-9, "{back} {ray}");
            } else if angle > model.fold {
                prop_assert!(lens.project(ray).is_none());
            }
        }
    }
}
