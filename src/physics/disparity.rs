//! Depth by triangulation: two cameras, or a camera and a projector, side by side with parallel axes.
//!
//! A point at the depth Z along the axes lies d = f·b/Z pixels apart in the two images, its disparity, with the focal length f in
//! pixels and the baseline b in metres. What a camera measures is the disparity, so its noise and its steps are constant in
//! pixels and grow with Z² in metres: σ_Z = Z²·σ_d/(f·b).
//!
//! The Kinect for Xbox 360 measures in steps of 1/8 px. J. T. Barron and J. Malik, "Intrinsic scene properties from a single RGB-D
//! image" (CVPR 2013), give Z' = 35130/⌊35130/Z + n + ½⌋ in centimetres, where n is normal with the standard deviation 1/6. That is
//! [`quantise`] of a disparity in eighths of a pixel, with f·b = 351.3/8 px·m and σ_d = 1/48 px.

/// Two views side by side whose images are rectified: a point lies in the same row of both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StereoPair {
    /// The focal length in pixels.
    pub focal_px: f64,
    /// The distance between the two views in metres.
    pub baseline_m: f64,
}

impl StereoPair {
    /// The disparity d = f·b/Z in pixels of a depth in metres; 0 at an infinite depth.
    pub fn disparity_px(&self, depth_m: f64) -> f64 {
        self.focal_px * self.baseline_m / depth_m
    }

    /// The depth Z = f·b/d in metres of a disparity in pixels; infinite for the disparity 0.
    pub fn depth_m(&self, disparity_px: f64) -> f64 {
        self.focal_px * self.baseline_m / disparity_px
    }

    /// How far the depth moves with the disparity: Z²/(f·b), in metres a pixel, to the first order. Times the standard deviation
    /// of a disparity, it is that of the depth; times the step of a disparity, it is the step of the depth.
    pub fn depth_per_px(&self, depth_m: f64) -> f64 {
        depth_m * depth_m / (self.focal_px * self.baseline_m)
    }

    /// The width in pixels of the strip of a far surface that one view sees and a near edge hides from the other:
    /// f·b·(1/Z1 − 1/Z2).
    pub fn occlusion_px(&self, near_m: f64, far_m: f64) -> f64 {
        self.disparity_px(near_m) - self.disparity_px(far_m)
    }
}

/// The disparity in whole steps of so many pixels: the nearest step, and the larger of two as near.
pub fn quantise(disparity_px: f64, step_px: f64) -> f64 {
    step_px * (disparity_px / step_px + 0.5).floor()
}

#[cfg(test)]
mod tests {
    use super::super::detection::normal_below;
    use super::super::testing::{agrees, close};
    use super::*;
    use crate::rng::Rng;

    const D435: StereoPair = StereoPair { focal_px: 430.14, baseline_m: 0.05015 };
    const D415: StereoPair = StereoPair { focal_px: 920.0, baseline_m: 0.0545 };
    const D455: StereoPair = StereoPair { focal_px: 430.0, baseline_m: 0.095 };
    /// f·b = 43.5 px·m.
    const KINECT: StereoPair = StereoPair { focal_px: 580.0, baseline_m: 0.075 };
    /// Barron and Malik's f·b: 351.3 m in eighths of a pixel.
    const BARRON_MALIK: StereoPair = StereoPair { focal_px: 351.3 / 8.0, baseline_m: 1.0 };

    /// K. Khoshelham and S. O. Elberink, "Accuracy and resolution of Kinect depth data for indoor mapping applications", Sensors 12,
    /// 1437 (2012): σ_Z = 2.85e-5 cm⁻¹·½·Z².
    fn khoshelham_m(depth: f64) -> f64 {
        1.425e-3 * depth * depth
    }

    /// C. V. Nguyen, S. Izadi and D. Lovell, "Modeling Kinect sensor noise for improved 3D reconstruction and tracking" (3DIMPVT
    /// 2012): the axial noise in metres of a plane at the depth z that faces the sensor. One that is turned by θ has
    /// .0001/√z·θ²/(π/2 − θ)² more.
    fn nguyen_m(depth: f64) -> f64 {
        0.0012 + 0.0019 * (depth - 0.4) * (depth - 0.4)
    }

    /// The noise of depth at .08 px, Khoshelham's and Nguyen's, and the step of 1/8 px, in mm as computed.
    #[test]
    fn noise_and_steps_grow_with_the_square_of_depth() {
        let table = [
            (0.5, [0.9, 0.4, 0.5], None),
            (1.0, [3.7, 1.6, 2.0], Some([1.4, 1.9, 2.9])),
            (2.0, [14.8, 6.4, 7.8], Some([5.7, 6.1, 11.5])),
            (3.0, [33.4, 14.4, 17.6], Some([12.8, 14.0, 25.9])),
            (4.0, [59.3, 25.5, 31.3], Some([22.8, 25.8, 46.0])),
        ];
        for (depth, cameras, kinect) in table {
            for (camera, sigma) in [D435, D415, D455].into_iter().zip(cameras) {
                agrees(1e3 * 0.08 * camera.depth_per_px(depth), sigma, 0.1);
            }
            if let Some([khoshelham, nguyen, step]) = kinect {
                agrees(1e3 * khoshelham_m(depth), khoshelham, 0.1);
                agrees(1e3 * nguyen_m(depth), nguyen, 0.1);
                agrees(1e3 * KINECT.depth_per_px(depth) / 8.0, step, 0.1);
            }
        }
    }

    #[test]
    fn depths_and_disparities_undo_each_other() {
        for depth in [0.3, 1.0, 7.7, f64::INFINITY] {
            let back = D435.depth_m(D435.disparity_px(depth));
            assert!(back == depth || (back / depth - 1.0).abs() < 3e-16, "{depth}: {back}");
        }
        // A step of e px is e·Z²/(f·b) to the first order, which is short by e/d of it.
        let (disparity, step) = (D415.disparity_px(2.0), 0.01);
        let moved = D415.depth_m(disparity - step) - 2.0;
        close(moved, step * D415.depth_per_px(2.0) / (1.0 - step / disparity), 1e-12);
    }

    #[test]
    fn steps_are_the_nearest() {
        for (disparity, rounded) in [(3.0, 3.0), (3.0624, 3.0), (3.0625, 3.125), (3.07, 3.125), (0.05, 0.0)] {
            assert_eq!(quantise(disparity, 0.125), rounded);
        }
        assert!(quantise(f64::NAN, 0.125).is_nan());
    }

    /// The left view stands at x = 0 and the right one at x = b. A near plane at x > e hides from the right view what lies to the left
    /// of its edge in the left view.
    #[test]
    fn what_an_edge_hides_has_its_width() {
        for (camera, near, far, edge) in
            [(D435, 1.0, 2.0, 0.1), (D415, 0.5, 4.0, -0.3), (KINECT, 1.2, 3.5, 0.0)]
        {
            let hidden_from = camera.baseline_m + (edge - camera.baseline_m) * far / near;
            let width = camera.focal_px * (edge / near - hidden_from / far);
            close(width, camera.occlusion_px(near, far), 1e-12);
        }
    }

    /// Barron and Malik's mean depth at 3 and 4 m in cm, beside the true one, by the probabilities of the steps: +.24 and −.68. The
    /// sampled mean agrees to four standard errors of 10⁵ draws.
    #[test]
    fn the_kinects_form_errs_by_its_own_steps_only() {
        let mut rng = Rng::new(3);
        for (depth, error_cm) in [(3.0, 0.24), (4.0, -0.68)] {
            let exact = BARRON_MALIK.disparity_px(depth);
            let (mut mean, mut square) = (0.0, 0.0);
            for step in 1..400 {
                let k = f64::from(step);
                let at = |edge: f64| normal_below((edge - 8.0 * exact) * 6.0);
                let share = at(k + 0.5) - at(k - 0.5);
                let error = BARRON_MALIK.depth_m(k / 8.0) - depth;
                mean += share * error;
                square += share * error * error;
            }
            agrees(100.0 * mean, error_cm, 0.01);
            let draws = 100_000;
            let sampled = (0..draws)
                .map(|_| BARRON_MALIK.depth_m(quantise(exact + rng.normal() / 48.0, 0.125)) - depth)
                .sum::<f64>()
                / f64::from(draws);
            let allowed = 4.0 * ((square - mean * mean) / f64::from(draws)).sqrt();
            assert!((sampled - mean).abs() < allowed, "{depth}: {sampled} {mean}");
        }
    }

    /// Khoshelham's law is .062 px of noise at f·b = 43.5: that of steps of 1/8 px, 1/(8√12), and .0504 px before them. Sampled
    /// over depths whose disparities are uniform in one step: 40,000 draws, χ² to four standard errors, and the change of Z² and
    /// its second order over the draws, both below 2 % at 1 to 4 m. Nguyen's law is up to
    /// 35 % above Khoshelham's, most at 1 m.
    #[test]
    fn steps_and_noise_together_make_khoshelhams_law() {
        let (mut rng, draws) = (Rng::new(9), 40_000);
        let total = 1.425e-3 * 43.5;
        let noise = (total * total - 1.0 / (64.0 * 12.0_f64)).sqrt();
        assert!((noise - 0.0504).abs() < 5e-5);
        for depth in [1.0, 2.0, 3.0, 4.0] {
            let mut square = 0.0;
            for _ in 0..draws {
                let exact = KINECT.disparity_px(depth) + (rng.unit() - 0.5) / 8.0;
                let measured = quantise(exact + noise * rng.normal(), 0.125);
                let error = KINECT.depth_m(measured) - KINECT.depth_m(exact);
                square += error * error / f64::from(draws);
            }
            let ratio = square / (khoshelham_m(depth) * khoshelham_m(depth));
            let allowed = 4.0 * (2.0 / f64::from(draws)).sqrt() + 0.02;
            assert!((ratio - 1.0).abs() < allowed, "{depth}: {ratio}");
            let nguyen = nguyen_m(depth) / square.sqrt();
            assert!((0.98..1.35).contains(&nguyen), "{depth}: {nguyen}");
        }
    }
}
