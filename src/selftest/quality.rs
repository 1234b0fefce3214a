//! The quality of a depth camera's depth over distance, as librealsense's Depth Quality Tool measures it, beside what the camera's
//! keys say and what its data sheet promises.
//!
//! The camera looks at a wall that faces it, without sunlight, with its own image, limits and noise. A camera that matches images without a
//! projector needs texture: its wall has a random pattern. Others see a wall of one reflectance.
//!
//! The metrics are those of a region in the middle of the image, 40 % of its width and of its height, which is what the tool starts
//! with (librealsense, tools/depth-quality/depth-quality-model.h, `_roi_percent`). The points of [`FRAMES`] frames count together.
//! The noise of a pixel over time follows from the differences between its frames, so that errors that do not change are not in it.

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use crate::frame::{BODY_FROM_OPTICAL, Pose};
use crate::motion::Trajectory;
use crate::physics::depth_quality::DepthQuality;
use crate::physics::detection::normal_below;
use crate::physics::disparity::StereoPair;
use crate::physics::unwrap::Unwrapper;
use crate::rng::Rng;
use crate::scan::{Progress, scan};
use crate::scene::{
    Corners, Image, Material, Optics, Scene, SceneBuildError, SceneBuilder, SourceInstance, SourceMesh,
    SourcePart, SurfaceKind, Texture,
};
use crate::sensor::{
    Camera, Capture, DepthSensing, Pattern, Published, Quantity, Sensor, Stereo, StereoMethod, TimeOfFlight,
};
use crate::trace::Tracer;

/// The frames that are cast of each wall: with two, the noise of a pixel is known from their difference.
pub const FRAMES: usize = 2;

/// The reflectance of a wall without texture.
pub const REFLECTANCE: f64 = 0.8;

/// The tenths of the image's width and height that lie outside of the region, on either side.
const MARGIN_TENTHS: usize = 3;

/// The seed of every frame and of the pattern of the wall.
const SEED: u64 = 1;

/// The number of distances that are spread evenly, in their logarithm, over what the camera measures.
const SPREAD: usize = 6;

/// The distances in metres at which depth cameras are compared, which are measured where they are in range.
const COMPARED_M: [f64; 3] = [1.0, 2.0, 4.0];

/// How far the spread distances keep from the limits, as a factor: at the limits, half of the noise would be cut off.
const INSIDE: f64 = 1.1;

/// The largest distance of a camera without a largest depth, in metres.
const FARTHEST_M: f64 = 10.0;

/// The least distance of a camera without a least depth, as a part of its largest.
const NEAREST_SHARE: f64 = 0.025;

/// The side of a texel in pixels of the image. Texels are mixed linearly, so that pixels sample the pattern finely enough.
const TEXEL_PX: f64 = 3.0;

/// The texels along a side of the pattern, which repeats: 1536 pixels are more than any camera searches.
const TEXELS: usize = 512;

/// The quality of a camera's depth.
#[derive(Clone, Debug, PartialEq)]
pub struct QualityReport {
    /// Whether the walls have a pattern.
    pub is_textured: bool,
    /// The walls, the nearest first.
    pub walls: Vec<WallQuality>,
    /// What the data sheet promises, and whether it is kept.
    pub published: Vec<Judged>,
}

impl QualityReport {
    /// Whether a wall was seen, no promise is broken, and one was judged if there are any.
    pub fn passed(&self) -> bool {
        let verdicts: Vec<bool> =
            self.published.iter().filter_map(|judged| judged.outcome.is_kept()).collect();
        self.walls.iter().any(|wall| wall.quality.fill_percent > 0.0)
            && verdicts.iter().all(|is_kept| *is_kept)
            && (self.published.is_empty() || !verdicts.is_empty())
    }
}

/// The quality of depth of a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallQuality {
    /// The distance from the camera in metres, along the optical axis.
    pub distance_m: f64,
    /// The pixels of the region, of all frames.
    pub pixels: usize,
    /// The tool's metrics.
    pub quality: DepthQuality,
    /// The mean depth less the distance, in metres. `None` without any depth.
    pub bias_m: Option<f64>,
    /// The standard deviation of a pixel's depth over time, in metres, in the mean of the variances. `None` if no pixel has depth in
    /// all frames.
    pub sigma_m: Option<f64>,
    /// What the camera's keys say that `sigma_m` is. `None` of a camera that matches images.
    pub expected_sigma_m: Option<f64>,
    /// What the camera's keys say that the noise of disparities is, in pixels. `None` of other cameras than analytic ones of two
    /// viewpoints.
    pub expected_disparity_px: Option<f64>,
}

impl WallQuality {
    /// The value of a quantity that data sheets bound, in its unit and without a sign. `None` if there is none.
    pub fn value(&self, quantity: Quantity) -> Option<f64> {
        let target = self.quality.target;
        match quantity {
            Quantity::ZAccuracy => Some(target?.z_accuracy_percent?.abs()),
            Quantity::FillRate => Some(self.quality.fill_percent),
            Quantity::PlaneRms => Some(target?.plane_rms_percent),
            Quantity::SubpixelRms => target?.subpixel_rms_px,
            Quantity::Sigma => self.sigma_m,
            Quantity::Bias => Some(self.bias_m?.abs()),
        }
    }
}

/// A promise of the data sheet, and what became of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judged {
    /// The promise.
    pub published: Published,
    /// The result.
    pub outcome: Outcome,
}

/// The outcome of a promise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// It was held against the wall that is worst for it.
    Judged {
        /// The distance of the wall in metres.
        distance_m: f64,
        /// The value there, in the unit of the quantity; `None` if the camera has no depth of the wall.
        found: Option<f64>,
        /// The bound there.
        limit: f64,
        /// Whether the bound is kept.
        is_kept: bool,
    },
    /// The camera does not measure at the stated distance.
    OutOfRange,
    /// The camera has no disparities.
    NoDisparities,
}

impl Outcome {
    /// Whether the promise is kept, if it was judged.
    pub fn is_kept(&self) -> Option<bool> {
        match self {
            Self::Judged { is_kept, .. } => Some(*is_kept),
            Self::OutOfRange | Self::NoDisparities => None,
        }
    }
}

/// The number of rays that [`measure`] casts for a sensor.
pub fn rays(sensor: &Sensor, published: &[Published]) -> u64 {
    let Some(bench) = Bench::new(sensor) else { return 0 };
    let of_pixel = match bench.sensing {
        DepthSensing::Stereo(Stereo { method: StereoMethod::Analytic(_), .. }) => 1,
        DepthSensing::Stereo(_) => 2,
        DepthSensing::TimeOfFlight(tof) => 1 + u64::from(tof.samples * tof.samples),
    };
    let frames = bench.distances_m(published).len() * FRAMES;
    frames as u64 * sensor.pattern.rays() as u64 * of_pixel
}

/// Casts a depth camera at walls, and measures the quality of what it sees of them. `None` if the sensor is no camera that finds depth,
/// or if `progress` was cancelled.
///
/// # Errors
/// If a wall is so far away that it can't be stored.
pub fn measure(
    sensor: &Sensor,
    published: &[Published],
    progress: &Progress,
) -> Result<Option<QualityReport>, SceneBuildError> {
    let Some(bench) = Bench::new(sensor) else { return Ok(None) };
    let mut walls = Vec::new();
    for (number, distance_m) in bench.distances_m(published).into_iter().enumerate() {
        // Each wall has frames of its own, so that all draws are new.
        let Some(wall) = bench.wall(distance_m, number * FRAMES, progress)? else { return Ok(None) };
        walls.push(wall);
    }
    let has_pair = bench.pair.is_some();
    let published = published.iter().map(|one| judge(one, &walls, has_pair)).collect();
    Ok(Some(QualityReport { is_textured: bench.is_textured, walls, published }))
}

/// Holds a promise against the wall that is worst for it: the one that exceeds its bound by the largest factor.
fn judge(published: &Published, walls: &[WallQuality], has_pair: bool) -> Judged {
    let quantity = published.quantity;
    if quantity == Quantity::SubpixelRms && !has_pair {
        return Judged { published: *published, outcome: Outcome::NoDisparities };
    }
    let badness = |wall: &WallQuality| match (quantity, wall.value(quantity)) {
        (_, None) => f64::INFINITY,
        (Quantity::FillRate, Some(found)) => -found,
        (_, Some(found)) => found / published.limit(wall.distance_m),
    };
    let about = walls.iter().filter(|wall| published.at.is_about(wall.distance_m));
    let outcome = match about.max_by(|a, b| badness(a).total_cmp(&badness(b))) {
        None => Outcome::OutOfRange,
        Some(wall) => {
            let (distance_m, found) = (wall.distance_m, wall.value(quantity));
            let is_kept = found.is_some_and(|found| published.is_kept(found, distance_m));
            Outcome::Judged { distance_m, found, limit: published.limit(distance_m), is_kept }
        }
    };
    Judged { published: *published, outcome }
}

/// A camera that is put to the test.
struct Bench<'a> {
    sensor: &'a Sensor,
    camera: &'a Camera,
    sensing: &'a DepthSensing,
    /// The two viewpoints, of a camera that has them.
    pair: Option<StereoPair>,
    is_textured: bool,
}

impl<'a> Bench<'a> {
    fn new(sensor: &'a Sensor) -> Option<Self> {
        let Pattern::Camera(camera) = &sensor.pattern else { return None };
        let sensing = sensor.measurement.depth.as_ref()?;
        let (pair, is_textured) = match sensing {
            DepthSensing::Stereo(stereo) => {
                let pair = stereo.pair(camera);
                let is_passive = match &stereo.method {
                    StereoMethod::Analytic(_) => false,
                    StereoMethod::Match(matching) => matching.projector.is_none(),
                };
                (Some(pair), is_passive)
            }
            DepthSensing::TimeOfFlight(_) => (None, false),
        };
        Some(Self { sensor, camera, sensing, pair, is_textured })
    }

    /// The least and the largest depth in metres that the camera can have.
    fn limits_m(&self) -> [f64; 2] {
        let limits = self.sensor.range;
        let [mut least_m, mut most_m] = [limits.min_m, limits.max_m];
        match (self.sensing, &self.pair) {
            (DepthSensing::Stereo(stereo), Some(pair)) => {
                let [first_px, end_px] = stereo.searched_px();
                least_m = least_m.max(pair.depth_m(end_px));
                most_m = most_m.min(pair.depth_m(first_px));
            }
            (DepthSensing::TimeOfFlight(tof), _) => {
                let repeats = Unwrapper::new(&tof.frequencies_hz).map(|unwrapper| unwrapper.range_m());
                most_m = most_m.min(repeats.unwrap_or(f64::INFINITY));
            }
            (DepthSensing::Stereo(_), None) => {}
        }
        if most_m.is_infinite() {
            most_m = FARTHEST_M.max(2.0 * INSIDE * INSIDE * least_m);
        }
        [if least_m > 0.0 { least_m } else { NEAREST_SHARE * most_m }, most_m]
    }

    /// The distances of the walls in metres, in ascending order: spread ones with two figures, those at which cameras are compared,
    /// and those that promises name, as far as they are in range.
    fn distances_m(&self, published: &[Published]) -> Vec<f64> {
        let [least_m, most_m] = self.limits_m();
        let (from_m, to_m) = (least_m * INSIDE, most_m / INSIDE);
        let step = libm::pow(to_m / from_m, 1.0 / (SPREAD - 1) as f64);
        let mut spread = from_m;
        let mut all = Vec::new();
        for _ in 0..SPREAD {
            all.push(two_figures(spread));
            spread *= step;
        }
        all.extend(COMPARED_M);
        all.extend(published.iter().filter_map(|one| one.at.distance_m()));
        all.retain(|distance_m| (least_m..=most_m).contains(distance_m));
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    }

    /// The quality of a wall's depth, in frames from number `first` on. `None` if `progress` was cancelled.
    fn wall(
        &self,
        distance_m: f64,
        first: usize,
        progress: &Progress,
    ) -> Result<Option<WallQuality>, SceneBuildError> {
        let scene =
            wall(distance_m, self.is_textured.then(|| TEXEL_PX * distance_m / self.camera.focal_px().0))?;
        // Where the wall is stored.
        let truth_m = f64::from(distance_m as f32);
        let tracer = Tracer::build(&scene);
        let trajectory = Trajectory::Fixed(Pose::IDENTITY);
        let [rows, columns] = [self.sensor.pattern.rows(), self.sensor.pattern.columns()].map(middle);
        let optical_from_body = BODY_FROM_OPTICAL.inverse();
        let mut frames: Vec<Vec<Option<DVec3>>> = Vec::new();
        for number in first..first + FRAMES {
            let capture = Capture::new(self.sensor, Pose::IDENTITY, &trajectory, number as u64, SEED);
            let Some(frame) = scan(&scene, &tracer, &capture, progress) else { return Ok(None) };
            let point = |row: usize, column: usize| {
                let slot = frame.slot(row * frame.columns() + column, 0)?;
                let direction = capture.pulse(row, column)?.direction;
                Some(optical_from_body.direction(direction) * frame.returns().range_m[slot])
            };
            let of_row = |row: usize| columns.clone().map(move |column| (row, column));
            frames.push(rows.clone().flat_map(of_row).map(|(row, column)| point(row, column)).collect());
        }
        let points: Vec<DVec3> = frames.iter().flatten().flatten().copied().collect();
        let pixels = FRAMES * rows.len() * columns.len();
        let mean_of = |sum: f64, count: usize| (count > 0).then(|| sum / count as f64);
        // Half of the squared difference of two draws has their variance as its mean.
        let squares: Vec<f64> = frames[0]
            .iter()
            .zip(&frames[1])
            .filter_map(|(one, other)| Some(0.5 * ((*one)?.z - (*other)?.z) * ((*one)?.z - (*other)?.z)))
            .collect();
        let expected = self.expected(distance_m);
        Ok(Some(WallQuality {
            distance_m,
            pixels,
            quality: DepthQuality::of(&points, pixels, self.pair.as_ref(), Some(truth_m)),
            bias_m: mean_of(points.iter().map(|point| point.z - truth_m).sum(), points.len()),
            sigma_m: mean_of(squares.iter().sum(), squares.len()).map(f64::sqrt),
            expected_sigma_m: expected.map(|(sigma_m, _)| sigma_m),
            expected_disparity_px: expected.and_then(|(_, disparity_px)| disparity_px),
        }))
    }

    /// The noise of depths in metres and of disparities in pixels that follows from the camera's keys.
    fn expected(&self, distance_m: f64) -> Option<(f64, Option<f64>)> {
        match (self.sensing, &self.pair) {
            (DepthSensing::Stereo(stereo), Some(pair)) => {
                let [sigma_m, disparity_px] =
                    noise_of_disparity(pair, stereo.sigma_px()?, stereo.unit_px, distance_m);
                Some((sigma_m, Some(disparity_px)))
            }
            (DepthSensing::TimeOfFlight(tof), _) => Some((self.noise_of_light(tof, distance_m), None)),
            (DepthSensing::Stereo(_), None) => None,
        }
    }

    /// The root of the mean variance of the region's depths, of a time-of-flight camera.
    ///
    /// At an angle θ to the axis, the wall is at the range R = Z/cos θ and sends back ρ·cos θ/R² of a white one at 1 m. Depth is R·cos θ,
    /// and its noise too.
    fn noise_of_light(&self, tof: &TimeOfFlight, distance_m: f64) -> f64 {
        let capture = Capture::at_origin(self.sensor);
        let [rows, columns] = [self.sensor.pattern.rows(), self.sensor.pattern.columns()].map(middle);
        let (mut sum, mut count) = (0.0, 0);
        for row in rows {
            for column in columns.clone() {
                let Some(cosine) = capture.depth_over_range(row, column) else { continue };
                let range_m = distance_m / cosine;
                let electrons = REFLECTANCE * tof.electrons_at_1_m * cosine / (range_m * range_m);
                let sigma_m = cosine * tof.range_sigma_m(electrons, range_m);
                sum += sigma_m * sigma_m;
                count += 1;
            }
        }
        (sum / f64::from(count)).sqrt()
    }
}

/// The standard deviations of depths in metres, and of disparities in pixels, of a wall at a distance: those of a normal disparity that
/// is rounded to a unit.
///
/// Noise at least as wide as the unit u makes the variance σ² + u²/12 (W. F. Sheppard 1898; what that leaves out falls with
/// e^(−2π²σ²/u²), 3·10⁻⁹), and depths have Z²/(f·b) times the deviation, to the first order. Less noise gives a few units only, whose
/// probabilities are summed.
fn noise_of_disparity(pair: &StereoPair, sigma_px: f64, unit_px: f64, distance_m: f64) -> [f64; 2] {
    if sigma_px >= unit_px {
        let of_disparity = (sigma_px * sigma_px + unit_px * unit_px / 12.0).sqrt();
        return [pair.depth_per_px(distance_m) * of_disparity, of_disparity];
    }
    let exact = pair.disparity_px(distance_m) / unit_px;
    let sigma = sigma_px / unit_px;
    let nearest = libm::floor(exact + 0.5);
    let below = |edge: f64| match sigma > 0.0 {
        true => normal_below((edge - exact) / sigma),
        false => f64::from(u8::from(edge > exact)),
    };
    // The noise is less than a unit, so that ten units are ten of its deviations or more.
    let of_units = |value: &dyn Fn(f64) -> f64| -> f64 {
        let units = (-10..=10).map(|step| nearest + f64::from(step)).filter(|unit| *unit > 0.0);
        units.map(|unit| (below(unit + 0.5) - below(unit - 0.5)) * value(unit * unit_px)).sum()
    };
    let total = of_units(&|_| 1.0);
    let deviation = |value: &dyn Fn(f64) -> f64| {
        let mean = of_units(value) / total;
        (of_units(&|px| (value(px) - mean) * (value(px) - mean)) / total).max(0.0).sqrt()
    };
    [deviation(&|px| pair.depth_m(px)), deviation(&|px| px)]
}

/// The indices of the region along a side of the image.
fn middle(count: usize) -> std::ops::Range<usize> {
    let margin = count * MARGIN_TENTHS / 10;
    margin..count - margin
}

/// A positive number to two figures.
fn two_figures(x: f64) -> f64 {
    let decimals = 1 - libm::floor(libm::log10(x)) as i32;
    let scale = libm::pow(10.0, f64::from(decimals.abs()));
    if decimals >= 0 { (x * scale).round() / scale } else { (x / scale).round() * scale }
}

/// A scene of one wall across x that sends light back by Lambert's law: of [`REFLECTANCE`], or with a random pattern of texels of a
/// side in metres.
fn wall(x_m: f64, texel_m: Option<f64>) -> Result<Scene, SceneBuildError> {
    // Rays up to 87° beside the axis meet it.
    let half_m = 20.0 * x_m;
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let triangles = vec![[0, 1, 2], [0, 2, 3]];
    let uv = |index: u32| {
        let of = |side: f64| (side * half_m / (texel_m.unwrap_or(1.0) * TEXELS as f64)) as f32;
        corners[index as usize].map(of)
    };
    let mut uvs = Corners::new(1, false);
    for corner in triangles.iter().flatten() {
        uvs.push(&[uv(*corner)], [1.0; 4]);
    }
    let is_textured = texel_m.is_some();
    let part =
        SourcePart { triangles, material: 0, corners: if is_textured { uvs } else { Corners::default() } };
    let positions = corners.map(|[y, z]| [x_m as f32, (half_m * y) as f32, (half_m * z) as f32]).to_vec();
    let material = Material {
        base_color: [1.0; 4],
        base_color_texture: is_textured.then(pattern).flatten().map(|image| Texture::new(Arc::new(image))),
        optics: Some(0),
        ..Material::default()
    };
    let instance =
        SourceInstance { mesh: 0, world_from_mesh: DAffine3::IDENTITY, ..SourceInstance::default() };
    let builder = SceneBuilder {
        meshes: vec![SourceMesh { positions, parts: vec![part] }],
        instances: vec![instance],
        materials: vec![material],
        files: vec![],
        groups: vec![],
    };
    let mut scene = builder.build()?;
    let reflectance = (!is_textured).then_some(REFLECTANCE);
    let optics = Optics { reflectance, kind: Some(SurfaceKind::Lambert), ..Optics::default() };
    Arc::make_mut(&mut scene.geometry).optics = vec![optics];
    Ok(scene)
}

/// Texels of random greys, from a dark one to white.
fn pattern() -> Option<Image> {
    let mut rng = Rng::new(SEED);
    let grey = |_| 64 + rng.below(192) as u8;
    Image::new(TEXELS as u32, 1, (0..TEXELS * TEXELS).map(grey).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::{Cast, Origins, Rays};

    const PAIR: StereoPair = StereoPair { focal_px: 580.0, baseline_m: 0.075 };

    /// Where the sum over units ends and Sheppard's variance begins, both are the same to the part that the latter leaves out.
    #[test]
    fn rounded_noise_goes_over_into_sheppards() {
        for distance_m in [0.8, 1.234, 3.9] {
            let [summed, sheppards] =
                [0.124_999, 0.125].map(|sigma| noise_of_disparity(&PAIR, sigma, 0.125, distance_m));
            // The deviations themselves differ by 8·10⁻⁶, and e^(−2π²) = 3·10⁻⁹ is multiplied by (2πσ/u)² and less than 10.
            assert!((summed[1] / sheppards[1] - 1.0).abs() < 1e-5, "{summed:?} {sheppards:?}");
            // Depths are summed as they are, and not to the first order: 4·(σ/d)² more.
            let relative = sheppards[1] / PAIR.disparity_px(distance_m);
            assert!((summed[0] / sheppards[0] - 1.0).abs() < 1e-5 + 8.0 * relative * relative);
        }
    }

    /// Of noise that is narrow, the rounded disparity is one unit, or midway between two it is either as often.
    #[test]
    fn narrow_noise_gives_one_unit_or_two() {
        let unit = 0.125;
        let on_a_unit_m = PAIR.depth_m(120.0 * unit);
        assert_eq!(noise_of_disparity(&PAIR, 0.0, unit, on_a_unit_m), [0.0, 0.0]);
        assert!(noise_of_disparity(&PAIR, 0.01, unit, on_a_unit_m)[1] < 1e-4);
        let [depth_m, disparity_px] = noise_of_disparity(&PAIR, 0.001, unit, PAIR.depth_m(120.5 * unit));
        assert!((disparity_px - 0.5 * unit).abs() < 1e-9, "{disparity_px}");
        assert!((depth_m - 0.5 * (PAIR.depth_m(120.0 * unit) - PAIR.depth_m(121.0 * unit))).abs() < 1e-9);
    }

    #[test]
    fn two_figures_are_left() {
        let rounded = [0.019_49, 0.331, 1.449, 9.09, 14.5, 181.0].map(two_figures);
        assert_eq!(rounded, [0.019, 0.33, 1.4, 9.1, 15.0, 180.0]);
    }

    /// Three pixels to a texel, and greys that differ from texel to texel.
    #[test]
    fn a_textured_wall_has_other_greys_from_texel_to_texel() {
        let texel_m = 0.01;
        let scene = wall(2.0, Some(texel_m)).unwrap();
        let tracer = Tracer::build(&scene);
        let greys: Vec<f64> = (0..200)
            .map(|texel| {
                // The middles of texels, clear of the diagonal between the triangles.
                let at = DVec3::new(0.0, (f64::from(texel) + 0.5) * texel_m, 3.5 * texel_m);
                let mut hits = [None];
                let origin = Origins::Common(at);
                tracer.cast(&Rays::unlimited(origin, &[DVec3::X]), &mut hits);
                let hit = hits[0].as_ref().unwrap();
                f64::from(scene.appearance(hit.placement, hit.triangle, hit.u, hit.v).reflectivity())
            })
            .collect();
        let mean = greys.iter().sum::<f64>() / 200.0;
        let spread = (greys.iter().map(|g| (g - mean) * (g - mean)).sum::<f64>() / 200.0).sqrt();
        // Greys are the squares, roughly, of numbers that are uniform from 1/4 to 1: (b³ − a³)/(3(b − a)) = .44, √(.266 − .19) = .27.
        assert!((mean - 0.42).abs() < 0.08 && (spread - 0.27).abs() < 0.06, "{mean} {spread}");
        let alike = greys.windows(2).filter(|two| (two[0] - two[1]).abs() < 0.01).count();
        assert!(alike < 20, "{alike}");
    }
}
