//! The tables by which a depth camera finds depth → [`DepthSensing`].

use super::super::super::keys::depth::{self as keys, stereo, structured_light, tof};
use super::super::super::table::{AnyKey, Key, Table};
use crate::config::kinds::{Integer, Nested, Number};
use crate::sensor::{
    AnalyticDisparity, DepthSensing, Lens, Measurement, Pattern, SecondViewpoint, Stereo, StereoMethod,
    TimeOfFlight,
};

/// How the depth camera of a table finds depth. A table that is wrong is reported, and counts as left out.
pub(super) fn sensing(t: &Table<'_>) -> Option<DepthSensing> {
    let read = |key: &Key<Nested>| t.read(key).map(|t| t.value);
    let stereo = read(&keys::STEREO).and_then(|t| stereo(&t));
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
            "`[{name}]` is how a camera finds depth, and the sensor's pattern is `[{}]`",
            pattern.name()
        );
        return fail(message, "needs a camera", "a LiDAR's measurement is set by `[receiver]` and `[noise]`");
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
    Some(())
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

fn stereo(t: &Table<'_>) -> Option<Stereo> {
    two_viewpoints(
        t,
        &Keys {
            second: SecondViewpoint::Imager,
            baseline: &stereo::BASELINE,
            disparities: &stereo::DISPARITIES,
            unit: &stereo::UNIT,
            sigma: &stereo::SIGMA,
            window: &stereo::WINDOW,
        },
    )
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
        samples: t.value(&tof::SAMPLES),
        indirect_rays: t.value(&tof::INDIRECT),
        third_harmonic: t.value(&tof::THIRD_HARMONIC),
        least_amplitude: t.value(&tof::LEAST_AMPLITUDE),
        disagreement_m: t.value(&tof::DISAGREEMENT),
    };
    let sensing = sensing(
        frequencies.iter().flat_map(|list| &list.value).map(|mhz| mhz.value * 1e6).collect(),
        electrons.as_ref().map_or(1.0, |electrons| electrons.value),
    );
    let frequencies = frequencies?;
    electrons?;
    if frequencies.value.len() > tof::MOST_FREQUENCIES {
        let message = format!("`frequencies_mhz` has {} numbers", frequencies.value.len());
        let label = format!("expected at most {}", tof::MOST_FREQUENCIES);
        return t.report().fail(frequencies.span, message, label, None);
    }
    Some(sensing)
}
