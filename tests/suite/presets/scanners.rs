//! Scanners of a plane, and of terrestrial and airborne surveys, by the figures of their makers and of HELIOS++.

use glam::DVec3;

use super::{Errors, Shot, TruePulse, Truth, sin_cos_deg};

const ALLOWED: Errors = Errors { angle_deg: 1e-6, time_ns: 1e-1, place_mm: 1e-4 };

pub fn truths() -> Vec<Truth> {
    vec![
        plane(
            "hokuyo/utm-30lx",
            1081,
            [-135.0, 0.25],
            40.0 * 1440.0,
            "data sheet; urg_node: steps 0 to 1080 of 1440",
            "–",
        ),
        plane(
            "sick/lms5xx",
            381,
            [-95.0, 0.5],
            50.0 * 720.0,
            "operating instructions of the LMS5xx",
            "which steps go with which rate; range",
        ),
        plane(
            "riegl/vux-1uav",
            2521,
            [1260.0 * 360.0 / 2750.0, -360.0 / 2750.0],
            550e3,
            "HELIOS++ scanners_als.xml",
            "the largest range is not set",
        ),
        survey(
            "riegl/vz-400",
            122e3,
            "HELIOS++ scanners_tls.xml; data sheet",
            "times within a line, range",
            // 60° a second from behind, clockwise; 120 lines a second of 100° from the top.
            &|t| [180.0 - 60.0 * t, 60.0 - 100.0 * (120.0 * t).fract()],
        ),
        survey(
            "riegl/vq-780i",
            666e3,
            "HELIOS++ scanners_als.xml; data sheet",
            "times within a line; the largest range is not set",
            &|t| [30.0 - 60.0 * (300.0 * t).fract(), 0.0],
        ),
        survey(
            "leica/als50",
            83e3,
            "HELIOS++ scanners_als.xml",
            "the mirror's motion, a sine; the largest range is not set",
            &|t| [37.5 * libm::cos(std::f64::consts::TAU * 25.0 * t), 0.0],
        ),
    ]
}

fn shot(row: usize, column: usize, time_s: f64, [azimuth, elevation]: [f64; 2]) -> Shot {
    let ((sin_az, cos_az), (sin_el, cos_el)) = (sin_cos_deg(azimuth), sin_cos_deg(elevation));
    let towards = DVec3::new(cos_el * cos_az, cos_el * sin_az, sin_el);
    let point: super::Place = Box::new(move |range| towards * range);
    Shot { row, column, pulse: Some(TruePulse { time_s: Some(time_s), ring: None, point }) }
}

/// A beam in a plane: `count` steps from an azimuth on, as degrees.
fn plane(
    preset: &'static str,
    count: usize,
    [from_deg, step_deg]: [f64; 2],
    pulse_rate_hz: f64,
    source: &'static str,
    nominal: &'static str,
) -> Truth {
    let columns = [0, 1, 2, count / 3, count / 2, count - 1];
    let shots = columns
        .map(|column| {
            let azimuth = from_deg + step_deg * column as f64;
            shot(0, column, column as f64 / pulse_rate_hz, [azimuth, 0.0])
        })
        .into_iter()
        .collect();
    Truth { preset, mode: None, source, nominal, allowed: ALLOWED, shots }
}

/// A beam whose azimuth and elevation in degrees follow from the time in seconds.
fn survey(
    preset: &'static str,
    pulse_rate_hz: f64,
    source: &'static str,
    nominal: &'static str,
    angles_deg: &dyn Fn(f64) -> [f64; 2],
) -> Truth {
    let columns = [0, 1, 10, 333, 1016, 5000, 7999];
    let time_s = |column: usize| column as f64 / pulse_rate_hz;
    let shots = columns
        .map(|column| shot(0, column, time_s(column), angles_deg(time_s(column))))
        .into_iter()
        .collect();
    Truth { preset, mode: None, source, nominal, allowed: ALLOWED, shots }
}
