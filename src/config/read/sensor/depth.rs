//! The tables by which a depth camera finds depth → [`DepthSensing`].

use std::sync::Arc;

use super::super::super::keys::depth::{
    self as keys, imager, matcher, projector, stereo, structured_light, tof,
};
use super::super::super::kinds::{Integer, Nested, Number};
use super::super::super::plausibility;
use super::super::super::table::{AnyKey, Key, Table};
use super::super::sensor_files::{GreyImage, SensorFiles};
use crate::angle::Angle;
use crate::matching::{Paths, Settings, Speckle, Texture, UNITS_PER_PX};
use crate::physics::dots::{ImagePattern, Projected};
use crate::physics::unwrap::Unwrapper;
use crate::sensor::{
    AnalyticDisparity, DepthSensing, Imager, Lens, Matching, Measurement, Pattern, Projector,
    SecondViewpoint, Stereo, StereoMethod, TimeOfFlight,
};
use crate::source::tree::Entries;

/// How the depth camera of a table finds depth. A table that is wrong is reported, and counts as left out.
pub(super) fn sensing(t: &Table<'_>, files: &SensorFiles) -> Option<DepthSensing> {
    let read = |key: &Key<Nested>| t.read(key).map(|t| t.value);
    let stereo = read(&keys::STEREO).and_then(|t| stereo(&t, files));
    let structured = read(&keys::STRUCTURED_LIGHT).and_then(|t| structured_light(&t));
    let tof = read(&keys::TOF).and_then(|t| time_of_flight(&t));
    let given: Vec<&dyn AnyKey> = keys::METHODS.into_iter().filter(|key| t.has(*key)).collect();
    if let [a, b, ..] = given[..] {
        let span = t.report().later(t.span_of(a), t.span_of(b));
        let message = format!(
            "a depth camera finds depth in one way, and this has both `[{}]` and `[{}]`",
            a.name(),
            b.name()
        );
        t.report().error(span, message, "one too many", Some("keep one of the two".into()));
        return None;
    }
    stereo.or(structured).map(DepthSensing::Stereo).or(tof.map(DepthSensing::TimeOfFlight))
}

/// Reports a table by which depth is found of a sensor that it does not fit. `None` if there is one.
pub(super) fn check(t: &Table<'_>, pattern: &Pattern, measurement: &Measurement) -> Option<()> {
    let Some(sensing) = &measurement.depth else { return Some(()) };
    let key = keys::METHODS.into_iter().find(|key| t.has(*key))?;
    let fail = |message: String, label: &str, help: &str| {
        t.report().error(t.span_of(key), message, label, Some(help.to_owned()));
        None
    };
    let name = key.name();
    let Pattern::Camera(camera) = pattern else {
        let message = format!(
            "`[{name}]` is how a camera with a lens finds depth, and the sensor's pattern is `[{}]`",
            pattern.name()
        );
        return match pattern.is_camera() {
            true => {
                let help =
                    "parallel rays have no focal length, and meet in no place that light could go back to";
                fail(message, "needs a camera with a lens", help)
            }
            false => {
                fail(message, "needs a camera", "a LiDAR's measurement is set by `[receiver]` and `[noise]`")
            }
        };
    };
    if matches!(sensing, DepthSensing::Stereo(_)) && !matches!(camera.lens(), Lens::Ideal) {
        let message = format!("`[{name}]` compares rectified images, and the camera's lens distorts");
        return fail(
            message,
            "needs a `[pinhole]` without `distortion`",
            "give the intrinsics of the rectified images",
        );
    }
    let of_lidar = [
        ("footprint", measurement.footprint.is_some()),
        ("receiver", measurement.receiver.is_some()),
        ("noise", measurement.noise.is_some()),
        ("blooming", measurement.blooming.is_some()),
    ];
    if let Some((other, _)) = of_lidar.into_iter().find(|(_, is_given)| *is_given) {
        let message = format!("the sensor has both `[{name}]` and `[{other}]`, which is a LiDAR's");
        return fail(message, "one too many", "keep one of the two");
    }
    if let DepthSensing::TimeOfFlight(sensing) = sensing {
        warn_of_exposure(t, sensing, pattern.rate_hz());
    }
    Some(())
}

/// Warns of an exposure that is longer than a frame, or in which nothing can move.
fn warn_of_exposure(t: &Table<'_>, sensing: &TimeOfFlight, rate_hz: Option<f64>) {
    let Some(tof) = t.read(&keys::TOF).map(|tof| tof.value) else { return };
    let key = tof::EXPOSURE.name();
    let doubts = [
        rate_hz.and_then(|rate_hz| plausibility::exposure(key, sensing.exposure_s, rate_hz)),
        plausibility::exposure_of_one_ray(key, sensing.exposure_s, sensing.samples),
    ];
    for doubt in doubts.into_iter().flatten() {
        t.report().doubt(tof.span_of(&tof::EXPOSURE), doubt);
    }
}

/// The keys of a camera of two viewpoints.
struct Keys {
    second: SecondViewpoint,
    baseline: &'static Key<Number>,
    disparities: &'static Key<Integer<u32>>,
    unit: &'static Key<Number>,
    sigma: &'static Key<Number>,
    window: &'static Key<Integer<u32>>,
}

fn stereo(t: &Table<'_>, files: &SensorFiles) -> Option<Stereo> {
    let stereo = two_viewpoints(
        t,
        &Keys {
            second: SecondViewpoint::Imager,
            baseline: &stereo::BASELINE,
            disparities: &stereo::DISPARITIES,
            unit: &stereo::UNIT,
            sigma: &stereo::SIGMA,
            window: &stereo::WINDOW,
        },
    );
    let is_matched = t.value(&stereo::METHOD);
    let searched = [t.value(&stereo::FIRST_DISPARITY), t.value(&stereo::DISPARITIES)];
    let matching = matching(t, files, searched);
    let others: [&dyn AnyKey; 3] = [&stereo::PROJECTOR, &stereo::IMAGER, &stereo::MATCHER];
    let analytic: [&dyn AnyKey; 4] =
        [&stereo::SIGMA, &stereo::WINDOW, &stereo::INLIER, &stereo::INLIER_SHARE];
    let useless = if is_matched { &analytic[..] } else { &others[..] };
    if let Some(key) = useless.iter().find(|key| t.has(**key)) {
        let doubt = plausibility::key_of_other_method(key.name(), is_matched);
        t.report().doubt(t.span_of(*key), doubt);
    }
    match is_matched {
        true => Some(Stereo { method: StereoMethod::Match(matching?), ..stereo? }),
        false => stereo,
    }
}

/// The images of a stereo camera, and how they are matched. `None` if something is wrong.
fn matching(t: &Table<'_>, files: &SensorFiles, searched_px: [u32; 2]) -> Option<Matching> {
    let projector = match t.read(&stereo::PROJECTOR) {
        Some(t) => Some(projector(&t.value, files)?),
        None => None,
    };
    // A table that is left out has all of its defaults.
    let empty = Entries::new();
    let imager = t.read(&stereo::IMAGER).map(|t| t.value);
    let imager = imager.unwrap_or_else(|| Table::new(t.reading(), &imager::KEYS, &empty, t.span));
    let matcher = t.read(&stereo::MATCHER).map(|t| t.value);
    let matcher = matcher.unwrap_or_else(|| Table::new(t.reading(), &matcher::KEYS, &empty, t.span));
    let (imager, settings) = (imager_of(&imager), settings(&matcher, searched_px)?);
    Some(Matching { projector, imager, settings })
}

fn projector(t: &Table<'_>, files: &SensorFiles) -> Option<Projector> {
    let (offset, field) = (t.read(&projector::OFFSET), t.read(&projector::FIELD));
    let dots = t.value(&projector::DOTS);
    let dot_width = Angle::rad(t.value(&projector::DOT_WIDTH) * 1e-3);
    let (seed, flood) = (t.value(&projector::SEED), t.value(&projector::FLOOD));
    let image = t.read(&projector::PATTERN);
    let of_dots: [&dyn AnyKey; 3] = [&projector::DOTS, &projector::DOT_WIDTH, &projector::SEED];
    if let Some(key) = of_dots.iter().find(|key| image.is_some() && t.has(**key)) {
        t.report().doubt(t.span_of(*key), plausibility::dots_beside_a_pattern(key.name()));
    }
    let field = field?;
    if let Some(wrong) = field.value.iter().find(|degrees| !(**degrees > 0.0 && **degrees < 180.0)) {
        let message = format!("a projector's pattern is {wrong} degrees wide");
        let label = "expected angles greater than 0 and less than 180";
        return t.report().fail(field.span, message, label.to_owned(), None);
    }
    let field = Projector::field_of(field.value.map(Angle::deg));
    let pattern = match image {
        None => Projector::dots(field, dots, dot_width, seed),
        Some(file) => {
            // The errors of the file were reported when it was read.
            let GreyImage { width, height, pixels } = files.pattern(t.report(), file)?.clone();
            Projected::Image(ImagePattern::new(field, width, height, pixels)?)
        }
    };
    Some(Projector { offset_m: offset?.value, field, pattern: Arc::new(pattern), flood })
}

fn imager_of(t: &Table<'_>) -> Imager {
    Imager {
        wavelength_m: t.value(&imager::WAVELENGTH) * 1e-9,
        auto_level: t.read(&imager::AUTO_LEVEL).map(|level| level.value),
        projected_at_1_m: t.value(&imager::PROJECTED),
        ambient: t.value(&imager::AMBIENT),
        sun: t.value(&imager::SUN),
        noise: t.value(&imager::NOISE),
    }
}

fn settings(t: &Table<'_>, [first_disparity_px, disparities]: [u32; 2]) -> Option<Settings> {
    /// A whole number of a pair, which the rules of the matcher judge; what is none is one that they refuse.
    fn whole(value: f64) -> usize {
        if value >= 0.0 && value.fract() == 0.0 { value.min(1e6) as usize } else { usize::MAX >> 32 }
    }
    let [columns, rows] = t.value(&matcher::CENSUS).map(whole);
    let [p1, p2] = t.value(&matcher::PENALTIES).map(|penalty| whole(penalty).min(u16::MAX.into()) as u16);
    let speckle_px = t.value(&matcher::SPECKLE) as usize;
    let step = libm::round(t.value(&matcher::SPECKLE_STEP) * f64::from(UNITS_PER_PX)) as i32;
    let settings = Settings {
        first_disparity: first_disparity_px as i32,
        disparities: disparities as usize,
        census: (columns, rows),
        block: t.value(&matcher::BLOCK) as usize,
        p1,
        p2,
        paths: if t.value(&matcher::PATHS) { Paths::Eight } else { Paths::Four },
        uniqueness_percent: t.value(&matcher::UNIQUENESS) as u8,
        repetition_percent: t.read(&matcher::REPETITION).map(|percent| percent.value as u8),
        left_right_px: t.read(&matcher::LEFT_RIGHT).map(|px| px.value as u16),
        texture: Texture {
            count: t.value(&matcher::TEXTURE) as u8,
            difference: t.value(&matcher::TEXTURE_DIFFERENCE) as u8,
        },
        speckle: (speckle_px > 0).then_some(Speckle { pixels: speckle_px, step }),
        median: t.value(&matcher::MEDIAN) as usize,
        ..Settings::default()
    };
    match settings.unfit() {
        None => Some(settings),
        Some(unfit) => {
            let keys: [(&str, &dyn AnyKey); 4] = [
                ("census", &matcher::CENSUS),
                ("block", &matcher::BLOCK),
                ("p1", &matcher::PENALTIES),
                ("p2", &matcher::PENALTIES),
            ];
            let key = keys.into_iter().find(|(setting, _)| *setting == unfit.setting).map(|(_, key)| key);
            let span = key.map_or(t.span, |key| t.span_of(key));
            let message =
                format!("the matcher can't work with this `{}`", key.map_or(unfit.setting, AnyKey::name));
            t.report().fail(span, message, format!("expected {}", unfit.rule), None)
        }
    }
}

fn structured_light(t: &Table<'_>) -> Option<Stereo> {
    two_viewpoints(
        t,
        &Keys {
            second: SecondViewpoint::Projector,
            baseline: &structured_light::BASELINE,
            disparities: &structured_light::DISPARITIES,
            unit: &structured_light::UNIT,
            sigma: &structured_light::SIGMA,
            window: &structured_light::WINDOW,
        },
    )
}

fn two_viewpoints(t: &Table<'_>, keys: &Keys) -> Option<Stereo> {
    let baseline = t.read(keys.baseline);
    let window = t.read_or_default(keys.window);
    let stereo = |baseline_m| Stereo {
        second: keys.second,
        baseline_m,
        first_disparity_px: t.value(&stereo::FIRST_DISPARITY),
        disparities: t.value(keys.disparities),
        unit_px: t.value(keys.unit),
        method: StereoMethod::Analytic(AnalyticDisparity {
            sigma_px: t.value(keys.sigma),
            window_px: window.as_ref().map_or(1, |window| window.value),
            inlier_px: t.value(&stereo::INLIER),
            inlier_share: t.value(&stereo::INLIER_SHARE),
        }),
    };
    let stereo = stereo(baseline.as_ref().map_or(1.0, |baseline| baseline.value));
    if let Some(window) = window.filter(|window| window.value % 2 == 0) {
        let message = format!("a window about a pixel has an odd side, and this has {} pixels", window.value);
        t.report().error(window.span, message, "expected an odd number", None);
    }
    let baseline = baseline?;
    if baseline.value == 0.0 {
        let help = "depth follows from the disparity between two places".to_owned();
        t.report().error(baseline.span, "the baseline is 0", "expected another number", Some(help));
        return None;
    }
    Some(stereo)
}

fn time_of_flight(t: &Table<'_>) -> Option<TimeOfFlight> {
    let frequencies = t.read(&tof::FREQUENCIES);
    let electrons = t.read(&tof::ELECTRONS);
    let sensing = |frequencies_hz, electrons_at_1_m| TimeOfFlight {
        frequencies_hz,
        wavelength_m: t.value(&tof::WAVELENGTH) * 1e-9,
        electrons_at_1_m,
        contrast: t.value(&tof::CONTRAST),
        sun_electrons: t.value(&tof::SUN),
        read_noise: t.value(&tof::READ_NOISE),
        full_well: t.value(&tof::FULL_WELL),
        taps: t.value(&tof::TAPS),
        samples: t.value(&tof::SAMPLES),
        indirect_rays: t.value(&tof::INDIRECT),
        bounces: t.value(&tof::BOUNCES),
        third_harmonic: t.value(&tof::THIRD_HARMONIC),
        least_amplitude: t.value(&tof::LEAST_AMPLITUDE),
        exposure_s: t.value(&tof::EXPOSURE),
        disagreement_m: t.value(&tof::DISAGREEMENT),
    };
    let sensing = sensing(
        frequencies.iter().flat_map(|list| &list.value).map(|mhz| libm::round(mhz.value * 1e6)).collect(),
        electrons.as_ref().map_or(1.0, |electrons| electrons.value),
    );
    let frequencies = frequencies?;
    electrons?;
    if frequencies.value.len() > tof::MOST_FREQUENCIES {
        let message = format!("`frequencies_mhz` has {} numbers", frequencies.value.len());
        let label = format!("expected at most {}", tof::MOST_FREQUENCIES);
        return t.report().fail(frequencies.span, message, label, None);
    }
    if Unwrapper::new(&sensing.frequencies_hz).is_none() {
        let message = "the frequencies have no common divisor that is large enough to unwrap their phases";
        let help =
            "give whole hertz, such as [16.0, 80.0, 120.0], of which 8 MHz is the greatest common divisor";
        let label = "expected at most 10,000 periods of all together in the period of the divisor".to_owned();
        return t.report().fail(frequencies.span, message.to_owned(), label, Some(help.into()));
    }
    Some(sensing)
}
