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

/// The disparity in whole steps, of which a pixel has `steps_per_px`: the nearest step, and the larger of two as near.
pub fn quantise(disparity_px: f64, steps_per_px: f64) -> f64 {
    (disparity_px * steps_per_px + 0.5).floor() / steps_per_px
}

/// How a camera with a projector of dots finds disparities: it finds a dot if the dots of the window around it agree, and gives the
/// pixels between the dots the disparity of the nearest.
///
/// Source: M. Gschwandtner et al., "BlenSor: Blender sensor simulation toolbox" (ISVC 2011), and A. Handa et al., "A benchmark for
/// RGB-D visual odometry, 3D reconstruction and SLAM" (ICRA 2014), which use a window of 9 × 9 px, agreement within .1 px, more
/// than 1/1.2 of the dots, and a reach of 3 px. Here windows end where the image does; theirs leave its margins empty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DotWindow {
    /// How many pixels the window reaches to each side: 4 for 9 × 9.
    pub reach_px: usize,
    /// How far the disparity of a dot may be from the mean of the window's, in pixels: for the dot in the middle. At the distance
    /// ρ from it, the limit is 1.44·ρ² times as large.
    pub agreement_px: f64,
    /// The share of the window's dots that more than so many agree.
    pub least_share: f64,
    /// The steps of disparity in a pixel.
    pub steps_per_px: f64,
    /// The farthest pixel that takes a dot's disparity, in pixels.
    pub fill_px: usize,
}

impl DotWindow {
    /// The Kinect's window for Xbox 360, with steps of 1/8 px.
    pub const KINECT_V1: Self =
        Self { reach_px: 4, agreement_px: 0.1, least_share: 1.0 / 1.2, steps_per_px: 8.0, fill_px: 3 };

    /// The disparity in whole steps of the dot at `pixel`, or NaN where no dot is found.
    ///
    /// `disparity` has a disparity for each pixel of an image that is `width` pixels wide, row by row, and NaN where there is none.
    /// `dots` says which pixels have a dot.
    pub fn dot(&self, disparity: &[f64], dots: &[bool], width: usize, pixel: usize) -> f64 {
        let own = disparity[pixel];
        if !dots[pixel] || own.is_nan() {
            return f64::NAN;
        }
        let (mut sum, mut valid) = (0.0, 0.0);
        for (at, _) in window(disparity.len(), width, pixel, self.reach_px) {
            if !disparity[at].is_nan() {
                sum += disparity[at];
                valid += 1.0;
            }
        }
        let mean = sum / valid;
        let (mut all, mut agreeing) = (0.0, 0.0);
        for (at, square) in window(disparity.len(), width, pixel, self.reach_px).filter(|(at, _)| dots[*at]) {
            let scale = if square == 0 { 1.0 } else { 1.44 * square as f64 };
            all += 1.0;
            // A comparison with NaN does not hold.
            if (disparity[at] - mean).abs() < self.agreement_px * scale {
                agreeing += 1.0;
            }
        }
        if agreeing > self.least_share * all { quantise(own, self.steps_per_px) } else { f64::NAN }
    }

    /// The disparity of a pixel: that of the nearest dot within reach, of several as near the first in the order of pixels, or NaN if
    /// there is none. `found` has for each pixel what [`DotWindow::dot`] gives.
    pub fn fill(&self, found: &[f64], width: usize, pixel: usize) -> f64 {
        let limit = self.fill_px * self.fill_px;
        window(found.len(), width, pixel, self.fill_px)
            .filter(|&(at, square)| square <= limit && !found[at].is_nan())
            .min_by_key(|&(_, square)| square)
            .map_or(f64::NAN, |(at, _)| found[at])
    }
}

/// The pixels of a square around a pixel, as far as the image reaches, in the order of pixels, each with its squared distance.
fn window(pixels: usize, width: usize, pixel: usize, reach: usize) -> impl Iterator<Item = (usize, usize)> {
    let (row, column) = (pixel / width, pixel % width);
    let rows = row.saturating_sub(reach)..(row + reach + 1).min(pixels / width);
    rows.flat_map(move |r| {
        let columns = column.saturating_sub(reach)..(column + reach + 1).min(width);
        columns.map(move |c| {
            let (down, right) = (r.abs_diff(row), c.abs_diff(column));
            (r * width + c, down * down + right * right)
        })
    })
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
            assert_eq!(quantise(disparity, 8.0), rounded);
        }
        assert!(quantise(f64::NAN, 8.0).is_nan());
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
                .map(|_| BARRON_MALIK.depth_m(quantise(exact + rng.normal() / 48.0, 8.0)) - depth)
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
                let measured = quantise(exact + noise * rng.normal(), 8.0);
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

    const WIDTH: usize = 40;
    const HEIGHT: usize = 24;

    fn measure(
        disparity: impl Fn(usize, usize) -> f64,
        dots: impl Fn(usize, usize) -> bool,
    ) -> [Vec<f64>; 2] {
        let pixels = WIDTH * HEIGHT;
        let image: Vec<_> = (0..pixels).map(|i| disparity(i / WIDTH, i % WIDTH)).collect();
        let dots: Vec<_> = (0..pixels).map(|i| dots(i / WIDTH, i % WIDTH)).collect();
        let window = DotWindow::KINECT_V1;
        let found: Vec<_> = (0..pixels).map(|i| window.dot(&image, &dots, WIDTH, i)).collect();
        let filled = (0..pixels).map(|i| window.fill(&found, WIDTH, i)).collect();
        [found, filled]
    }

    #[test]
    fn a_wall_is_found_in_steps_up_to_the_margins() {
        let [found, filled] = measure(|_, _| 20.3, |r, c| r % 3 == 0 && c % 3 == 0);
        // 20.3 is 162.4 steps.
        assert!(filled.iter().all(|&d| d == 20.25));
        assert_eq!(found.iter().filter(|d| !d.is_nan()).count(), 8 * 14);
        // A dot alone is found, and reaches 3 px.
        let [_, filled] = measure(|_, _| 20.3, |r, c| r == 10 && c == 20);
        let reached = |i: usize| (i / WIDTH).abs_diff(10).pow(2) + (i % WIDTH).abs_diff(20).pow(2) <= 9;
        assert!(filled.iter().enumerate().all(|(i, d)| d.is_nan() != reached(i)));
    }

    /// A step of 10 px between columns 19 and 20. The mean of a window across it is off by more than a pixel from all of its dots, more
    /// than the limit of those near the middle; so dots need 4 columns of their own wall, and pixels 3 px nearer are filled.
    #[test]
    fn no_dot_is_found_across_a_step() {
        let [found, filled] = measure(|_, c| if c < 20 { 10.0 } else { 20.0 }, |_, _| true);
        for i in 0..WIDTH * HEIGHT {
            let column = i % WIDTH;
            assert_eq!(found[i].is_nan(), (16..24).contains(&column), "{column}");
            assert_eq!(filled[i].is_nan(), (19..21).contains(&column), "{column}");
            assert!(filled[i].is_nan() || filled[i] == if column < 20 { 10.0 } else { 20.0 });
        }
        // A step within the agreement hides nothing.
        let [found, _] = measure(|_, c| if c < 20 { 10.0 } else { 10.09 }, |_, _| true);
        assert!(found.iter().all(|d| !d.is_nan()));
    }

    /// A slope of s px a pixel differs from the mean by s·ρ at most at the distance ρ, within .144·ρ² px for all dots if s is below
    /// .144, as the dot in the middle is the mean itself; and at 1 px a pixel, those nearer than 1/.144 = 6.9 px disagree.
    #[test]
    fn slopes_are_found_until_neighbours_disagree() {
        // Away from the margins, where windows are symmetric.
        let inside = |r: usize, c: usize| (4..HEIGHT - 4).contains(&r) && (4..WIDTH - 4).contains(&c);
        let share = |slope: f64| {
            let [found, _] = measure(|_, c| 10.0 + slope * c as f64, |_, _| true);
            let within = (0..WIDTH * HEIGHT).filter(|i| inside(i / WIDTH, i % WIDTH));
            let hits: Vec<_> = within.map(|i| !found[i].is_nan()).collect();
            hits.iter().filter(|hit| **hit).count() as f64 / hits.len() as f64
        };
        assert_eq!((share(0.0), share(0.14), share(1.0)), (1.0, 1.0, 0.0));
        // A dot and its two neighbours in the row: all three must agree, being more than 1/1.2 of them.
        let alone = |slope: f64| {
            let [found, _] = measure(|_, c| 10.0 + slope * c as f64, |r, c| r == 12 && (19..22).contains(&c));
            !found[12 * WIDTH + 20].is_nan()
        };
        assert_eq!((alone(0.143), alone(0.145)), (true, false));
    }

    #[test]
    fn holes_take_dots_with_them() {
        // Of 81 dots in a window, 68 and more must be there: .8333·81 = 67.5.
        for (missing, kept) in [(13, true), (14, false)] {
            let hole = |r: usize, c: usize| {
                (8..17).contains(&r) && (8..17).contains(&c) && (r - 8) * 9 + c - 8 < missing
            };
            let [found, filled] = measure(|r, c| if hole(r, c) { f64::NAN } else { 30.0 }, |_, _| true);
            assert_eq!(!found[12 * WIDTH + 12].is_nan(), kept, "{missing}");
            // A hole has no dot of its own, and is filled from its neighbours.
            assert!(found[8 * WIDTH + 12].is_nan());
            assert_eq!(filled[8 * WIDTH + 8], 30.0);
        }
        // Half way between two dots, the upper and the left one win.
        let [_, filled] = measure(
            |r, c| if r < 10 && c < 20 { 10.0 } else { 10.0 + 0.125 },
            |r, c| [(9, 19), (9, 23), (13, 19)].contains(&(r, c)),
        );
        assert_eq!([filled[9 * WIDTH + 21], filled[11 * WIDTH + 19]], [10.0, 10.0]);
    }
}
