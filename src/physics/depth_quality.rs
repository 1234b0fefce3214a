//! The quality of depth on a flat target, by the measures of the Depth Quality Tool for Intel's RealSense cameras, so that a
//! simulated camera can be compared with one on the desk: fill rate, error of depth, and noise in metres and in pixels.
//!
//! The measures are those of librealsense, tools/depth-quality/rs-depth-quality.cpp and depth-metrics.h. Points are in a camera's
//! frame, z along its optical axis.

use glam::DVec3;

use super::disparity::StereoPair;

/// A plane: the points p with `normal`·p = `offset_m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// The unit normal on the side away from the camera.
    pub normal: DVec3,
    /// The plane's distance from the camera in metres, at least 0.
    pub offset_m: f64,
}

impl Plane {
    /// The plane whose distances from the points, along its normal, have the least squares: through their centroid, across the
    /// axis of their least variance. `None` for points that lie on a line, to within 10⁻⁶ of its length, or are fewer than 3.
    pub fn fit(points: &[DVec3]) -> Option<Self> {
        if points.len() < 3 {
            return None;
        }
        let centroid = points.iter().sum::<DVec3>() / points.len() as f64;
        let mut spread = [[0.0; 3]; 3];
        for point in points {
            let p = (*point - centroid).to_array();
            for (row, a) in spread.iter_mut().zip(p) {
                for (sum, b) in row.iter_mut().zip(p) {
                    *sum += a * b;
                }
            }
        }
        let (variances, axes) = principal_axes(spread);
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| variances[a].total_cmp(&variances[b]));
        // Neither holds for a NaN.
        if !(variances[order[1]] > 1e-12 * variances[order[2]] && variances[order[2]].is_finite()) {
            return None;
        }
        let normal = DVec3::from_array(std::array::from_fn(|i| axes[i][order[0]])).normalize();
        let normal = if normal.dot(centroid) < 0.0 { -normal } else { normal };
        Some(Self { normal, offset_m: normal.dot(centroid) })
    }

    /// How far a point lies behind the plane, in metres: negative in front of it.
    pub fn behind_m(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset_m
    }

    /// The depth Z in metres where the ray from the camera through a point meets the plane.
    pub fn depth_along_m(&self, point: DVec3) -> f64 {
        point.z * self.offset_m / self.normal.dot(point)
    }
}

/// The variances of a symmetric matrix along its principal axes, and these as the columns of a matrix, by C. G. J. Jacobi's
/// rotations (G. H. Golub and C. F. Van Loan, "Matrix Computations", 1996, section 8.4). Each sweep squares the rest, so that 12
/// leave nothing of it.
fn principal_axes(mut a: [[f64; 3]; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    let mut axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..12 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            // The tangent of the angle that makes a[p][q] vanish, the smaller of two.
            let ratio = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let tan = ratio.signum() / (ratio.abs() + (ratio * ratio + 1.0).sqrt());
            let cos = 1.0 / (tan * tan + 1.0).sqrt();
            let sin = tan * cos;
            let turn = |m: &mut [[f64; 3]; 3]| {
                for row in m {
                    (row[p], row[q]) = (cos * row[p] - sin * row[q], sin * row[p] + cos * row[q]);
                }
            };
            turn(&mut a);
            transpose(&mut a);
            turn(&mut a);
            (a[p][q], a[q][p]) = (0.0, 0.0);
            turn(&mut axes);
        }
    }
    ([a[0][0], a[1][1], a[2][2]], axes)
}

fn transpose(m: &mut [[f64; 3]; 3]) {
    *m = std::array::from_fn(|i| std::array::from_fn(|k| m[k][i]));
}

/// The quality of depth in a region of an image that shows a flat target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthQuality {
    /// The pixels of the region that have a depth, in percent.
    pub fill_percent: f64,
    /// What the points tell of the target, if they have a plane.
    pub target: Option<TargetQuality>,
}

/// What the points of a flat target tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TargetQuality {
    /// The plane of all points.
    pub plane: Plane,
    /// The noise along the plane's normal in metres: the root of the mean square distance from the plane.
    pub plane_rms_m: f64,
    /// The noise in percent of the plane's distance.
    pub plane_rms_percent: f64,
    /// With a ground truth: the median of the points' errors of depth in percent of the true one, positive if they lie too far
    /// away. The error of a point is that of the plane on the optical axis and the point's distance behind the plane. The tool
    /// subtracts the latter, which makes the same median of symmetric noise.
    pub z_accuracy_percent: Option<f64>,
    /// Of a pair: the noise in pixels of disparity as the tool has it, the root mean square of f·b/|P| − f·b/|P'| of points P and
    /// their feet P' on the plane. It takes distances from the camera for depths, so the noise at an angle θ from the optical axis
    /// counts cos³θ of itself.
    pub subpixel_rms_px: Option<f64>,
    /// Of a pair: the noise of the disparities themselves, the root mean square of f·b/Z − f·b/Z' of all points, where Z' is the
    /// depth at which the pixel's own ray meets the plane.
    pub disparity_rms_px: Option<f64>,
}

impl DepthQuality {
    /// The quality of a region of `pixels` pixels whose depths, where there are any, make these points. `pair` is the camera's
    /// focal length and baseline, for those that measure disparities, and `truth_m` is the true depth of the target on the optical
    /// axis, or a positive number at least.
    ///
    /// Except for the plane, the fill rate and `disparity_rms_px`, the nearest and the farthest half percent of the points are
    /// left out, as by the tool. That takes 7.5 % from the variance of normal noise on a target that faces the camera, 3.8 % from
    /// its root.
    pub fn of(points: &[DVec3], pixels: usize, pair: Option<&StereoPair>, truth_m: Option<f64>) -> Self {
        let fill_percent = if pixels == 0 { 0.0 } else { 100.0 * points.len() as f64 / pixels as f64 };
        let target = Plane::fit(points).map(|plane| TargetQuality::of(points, plane, pair, truth_m));
        Self { fill_percent, target }
    }
}

impl TargetQuality {
    fn of(points: &[DVec3], plane: Plane, pair: Option<&StereoPair>, truth_m: Option<f64>) -> Self {
        let mut kept = points.to_vec();
        kept.sort_by(|a, b| a.z.total_cmp(&b.z));
        let outliers = kept.len() / 200;
        let kept = &kept[outliers..kept.len() - outliers];
        let plane_rms_m = rms(kept, |p| plane.behind_m(p));
        let foot = |p: DVec3| p - plane.normal * plane.behind_m(p);
        let on_axis = plane.offset_m / plane.normal.z;
        Self {
            plane,
            plane_rms_m,
            plane_rms_percent: 100.0 * plane_rms_m / plane.offset_m,
            z_accuracy_percent: truth_m.map(|truth| {
                let mut errors: Vec<_> = kept.iter().map(|p| on_axis - truth + plane.behind_m(*p)).collect();
                errors.sort_by(f64::total_cmp);
                100.0 * errors[errors.len() / 2] / truth
            }),
            subpixel_rms_px: pair.map(|pair| {
                rms(kept, |p| pair.disparity_px(p.length()) - pair.disparity_px(foot(p).length()))
            }),
            disparity_rms_px: pair.map(|pair| {
                rms(points, |p| pair.disparity_px(p.z) - pair.disparity_px(plane.depth_along_m(p)))
            }),
        }
    }
}

/// The root of the mean square of a number of each point.
fn rms(points: &[DVec3], of: impl Fn(DVec3) -> f64) -> f64 {
    let sum: f64 = points.iter().map(|p| of(*p) * of(*p)).sum();
    (sum / points.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::testing::{agrees, close};
    use super::*;
    use crate::rng::Rng;

    const PAIR: StereoPair = StereoPair { focal_px: 430.14, baseline_m: 0.05015 };

    /// What normal noise has left without the outer half percents: 1 − 2aφ(a)/.99 of its variance, with Φ(a) = .995.
    fn trimmed_variance() -> f64 {
        let a = 2.575_829_303_5_f64;
        1.0 - 2.0 * a * libm::exp(-0.5 * a * a) / (2.0 * std::f64::consts::PI).sqrt() / 0.99
    }

    /// The points of a plane that rays of a camera meet, with the noise of each as a factor on its depth.
    fn seen(plane: Plane, half_width: f64, count: usize, mut depth: impl FnMut(f64) -> f64) -> Vec<DVec3> {
        let mut rng = Rng::new(77);
        let ray = |rng: &mut Rng| DVec3::new(half_width * rng.signed(), half_width * rng.signed(), 1.0);
        let rays: Vec<_> = (0..count).map(|_| ray(&mut rng)).collect();
        rays.into_iter().map(|ray| ray * depth(plane.depth_along_m(ray))).collect()
    }

    fn tilted(x: f64, y: f64, offset_m: f64) -> Plane {
        Plane { normal: DVec3::new(x, y, 1.0).normalize(), offset_m }
    }

    #[test]
    fn a_plane_without_noise_is_found() {
        for plane in
            [tilted(0.0, 0.0, 1.0), tilted(0.3, -0.2, 2.5), tilted(-1.0, 0.1, 0.4), tilted(0.0, 1.5, 30.0)]
        {
            let points = seen(plane, 0.3, 500, |z| z);
            let found = Plane::fit(&points).unwrap();
            assert!((found.normal - plane.normal).length() < 1e-12, "{found:?} {plane:?}");
            close(found.offset_m, plane.offset_m, 1e-13);
            let quality = DepthQuality::of(&points, 1000, Some(&PAIR), Some(plane.offset_m / plane.normal.z));
            let target = quality.target.unwrap();
            assert_eq!(quality.fill_percent, 50.0);
            assert!(target.plane_rms_m < 1e-12 && target.subpixel_rms_px.unwrap() < 1e-10, "{target:?}");
            assert!(target.z_accuracy_percent.unwrap().abs() < 1e-10);
        }
    }

    #[test]
    fn points_without_a_plane_have_none() {
        let line: Vec<_> = (0..50).map(|i| DVec3::new(0.1, 0.2, 1.0) * f64::from(i + 1)).collect();
        for points in [&[][..], &line[..2], &line, &[DVec3::ONE; 9], &[DVec3::NAN; 9]] {
            let quality = DepthQuality::of(points, 100, Some(&PAIR), None);
            assert_eq!((quality.target, quality.fill_percent), (None, points.len() as f64));
        }
        assert_eq!(DepthQuality::of(&[], 0, None, None).fill_percent, 0.0);
        // A strip of 50 m has a plane if it is wider than 10⁻⁶ of its length.
        let strip = |width: f64| {
            let wide = DVec3::new(width, 0.0, 0.0);
            line.iter().flat_map(|p| [*p - wide, *p + wide]).collect::<Vec<_>>()
        };
        assert_eq!(Plane::fit(&strip(1e-6)), None);
        // Along (1, 0, 0) and (.1, .2, 1): the normal is as (0, 5, −1). The sums of squares, 5·10⁴ m², round to 10⁻¹¹, 10⁻⁷ of the
        // 10⁻⁴ m² across.
        let normal = Plane::fit(&strip(1e-3)).unwrap().normal;
        assert!(normal.x.abs() < 1e-6 && (normal.y / normal.z + 5.0).abs() < 26.0 * 1e-6, "{normal:?}");
    }

    /// No plane near the one that is found is nearer to the points.
    #[test]
    fn the_fit_has_the_least_squares() {
        let mut rng = Rng::new(6);
        for _ in 0..50 {
            let stretch = DVec3::new(rng.unit(), rng.unit(), rng.unit());
            let points: Vec<_> = (0..30).map(|_| rng.point() * stretch + DVec3::new(0.2, 0.1, 3.0)).collect();
            let best = Plane::fit(&points).unwrap();
            let squares = |plane: Plane| rms(&points, |p| plane.behind_m(p));
            for _ in 0..20 {
                let normal = (best.normal + rng.point() * 1e-3).normalize();
                let near = Plane { normal, offset_m: best.offset_m + 1e-3 * rng.signed() };
                assert!(squares(near) >= squares(best), "{best:?} {near:?}");
            }
        }
    }

    /// Normal noise of 3 mm along the normal of a wall at 1.5 m: the root mean square is that of the noise without its outer half
    /// percents, to four standard errors, √(1/(2n)) of it and for a trimmed normal less.
    #[test]
    fn noise_along_the_normal_is_the_plane_rms() {
        let (mut rng, count) = (Rng::new(12), 160_000);
        let wall = tilted(0.0, 0.0, 1.5);
        let points: Vec<_> =
            seen(wall, 0.4, count, |z| z).iter().map(|p| *p + wall.normal * (0.003 * rng.normal())).collect();
        let target = DepthQuality::of(&points, count, None, None).target.unwrap();
        let expected = 0.003 * trimmed_variance().sqrt();
        agrees(trimmed_variance(), 0.925, 1e-3);
        close(target.plane_rms_m, expected, 4.0 * (0.5 / count as f64).sqrt());
        close(target.plane_rms_percent, 100.0 * target.plane_rms_m / 1.5, 1e-4);
        assert_eq!(
            (target.subpixel_rms_px, target.disparity_rms_px, target.z_accuracy_percent),
            (None, None, None)
        );
    }

    /// Noise of .08 px in the disparities of a wall at 1 m, seen to 22° on either side, and of one that is turned by 30°: the noise
    /// of the disparities is told as it is, to four standard errors; the tool's figure is less by the trimming and by cos³θ.
    #[test]
    fn noise_of_disparities_is_told_in_pixels() {
        let (mut rng, count, sigma) = (Rng::new(14), 40_000, 0.08);
        let allowed = 4.0 * (0.5 / count as f64).sqrt();
        for turned in [0.0, 0.577_350_269] {
            let wall = tilted(turned, 0.0, 1.0);
            let points =
                seen(wall, 0.4, count, |z| PAIR.depth_m(PAIR.disparity_px(z) + sigma * rng.normal()));
            let truth = wall.offset_m / wall.normal.z;
            let target = DepthQuality::of(&points, count, Some(&PAIR), Some(truth)).target.unwrap();
            close(target.disparity_rms_px.unwrap(), sigma, allowed);
            // The median of depths errs as the mean of normal noise does, by √(π/2)·σ_Z/√n, and the turned wall has up to 1.7² of it.
            let error = 100.0 * sigma * PAIR.depth_per_px(1.7) * (1.58 / count as f64).sqrt();
            assert!(target.z_accuracy_percent.unwrap().abs() < 4.0 * error, "{target:?}");
            if turned == 0.0 {
                let sixth = points.iter().map(|p| (p.z / p.length()) * (p.z / p.length()));
                let share = sixth.map(|square| square * square * square).sum::<f64>() / count as f64;
                close(
                    target.subpixel_rms_px.unwrap(),
                    sigma * (share * trimmed_variance()).sqrt(),
                    1.2 * allowed,
                );
            }
        }
    }

    #[test]
    fn depths_too_long_are_positive() {
        for (offset, truth, percent) in [(1.02, 1.0, 2.0), (1.96, 2.0, -2.0)] {
            let points = seen(tilted(0.0, 0.0, offset), 0.2, 999, |z| z);
            let told = DepthQuality::of(&points, 999, None, Some(truth)).target.unwrap().z_accuracy_percent;
            assert!((told.unwrap() - percent).abs() < 1e-9);
        }
        // Three quarters of the points at 1 m and a quarter at 1.04 m: the plane lies at 1.01 m, and the median point at 1 m, not
        // at 1.02. Which points lie where is spread over the image at random, which tilts the plane: .0173 m of scatter at 4000
        // points over ±.2 m, √(1/3) of that in the mean, is a slope of .0024, half a millimetre at the edge of the image.
        let mut index = 0;
        let points = seen(tilted(0.0, 0.0, 1.0), 0.2, 4000, |z| {
            index += 1;
            z * if index % 4 == 0 { 1.04 } else { 1.0 }
        });
        let target = DepthQuality::of(&points, 4000, None, Some(1.0)).target.unwrap();
        assert!((target.plane.offset_m - 1.01).abs() < 0.002, "{target:?}");
        assert!(target.z_accuracy_percent.unwrap().abs() < 0.2, "{target:?}");
    }
}
