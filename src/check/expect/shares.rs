//! How many of the rays return and how many hit the vehicle, and what the returns come to in a second.

use super::bounds::Bounds;
use super::finding::Finding;
use super::seen::{Seen, blockers_on, returns_on, sight_of};
use super::target::Target;
use crate::angle::Angle;
use crate::check::outcome::Sight;
use crate::check::phrasing::percent;
use crate::output::SensorFrame;
use crate::scan::Cause;

/// The fraction of a sensor's rays or returns that satisfies a condition, 0 to 1.
pub(super) struct Share<'a> {
    pub(super) share: f64,
    pub(super) of: &'a SensorFrame<'a>,
}

impl Share<'_> {
    pub(super) fn place(&self) -> String {
        format!("sensor {}", self.of.name)
    }

    pub(super) fn sight(&self, channel: Option<&'static str>) -> Sight {
        sight_of(self.of, channel)
    }
}

/// The fraction that is furthest outside of the bounds, over all sensors, since each must lie within them. `count` counts a
/// frame's rays or returns: those that satisfy the condition, and all. `None` without a sensor.
pub(super) fn furthest_outside<'a>(
    seen: &'a Seen,
    bounds: &Bounds,
    count: &dyn Fn(&'a SensorFrame<'a>) -> (usize, usize),
) -> Option<Share<'a>> {
    let off = |share: f64| {
        let under = bounds.at_least.map_or(f64::NEG_INFINITY, |least| least - share);
        under.max(bounds.at_most.map_or(f64::NEG_INFINITY, |most| share - most))
    };
    let share = |of: &'a SensorFrame<'a>| {
        let (some, all) = count(of);
        Share { share: some as f64 / all as f64, of }
    };
    let shares = seen.frames.iter().map(share);
    shares.max_by(|a, b| off(a.share).total_cmp(&off(b.share)))
}

pub(super) fn returns(seen: &Seen, bounds: &Bounds) -> Finding {
    match furthest_outside(seen, bounds, &|of| {
        (of.frame.first_returns().flatten().count(), of.frame.pixels())
    }) {
        None => Finding::Nothing("no sensor".to_owned()),
        Some(worst) => {
            let frame = worst.of.frame;
            let blocked = frame.pixels_of(Cause::TooNear) as f64 / frame.pixels() as f64;
            let near = match blocked > 0.0 {
                true => format!(", {} are blocked nearer than the sensor's least range", percent(blocked)),
                false => String::new(),
            };
            let found = format!("{} of the rays return{near}", percent(worst.share));
            Finding::new(bounds.hold(worst.share), found, worst.place()).shown_by([worst.sight(None)])
        }
    }
}

pub(super) fn unobstructed(seen: &Seen, body: &Target, at_most: f64) -> Finding {
    if let Some(problem) = body.missing(seen.scene) {
        return Finding::Nothing(problem);
    }
    let bounds = Bounds { at_least: None, at_most: Some(at_most) };
    let scene = seen.scene;
    let too_near = |of: &SensorFrame| blockers_on(of, scene, body).count();
    let returned =
        |of: &SensorFrame| of.frame.first_returns().flatten().filter(|hit| body.is_hit(hit, scene)).count();
    let Some(worst) = furthest_outside(seen, &bounds, &|of| (returned(of) + too_near(of), of.frame.pixels()))
    else {
        return Finding::Nothing("no sensor".to_owned());
    };
    // The intervals of azimuth and elevation in which the sensor that sees most of the body is obstructed.
    let mut spans = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    let only = Seen { frames: std::slice::from_ref(worst.of), ..*seen };
    for point in returns_on(&only, body).chain(blockers_on(worst.of, scene, body)) {
        let d = point.pulse().direction;
        let angles = [libm::atan2(d.y, d.x), libm::asin(d.z.clamp(-1.0, 1.0))];
        for (span, angle) in spans.iter_mut().zip(angles) {
            let degrees = Angle::rad(angle).degrees();
            *span = [span[0].min(degrees), span[1].max(degrees)];
        }
    }
    let [azimuth, elevation] = spans;
    let directions = if azimuth[0] > azimuth[1] {
        String::new()
    } else {
        format!(
            ": azimuth {:.1}° to {:.1}°, elevation {:.1}° to {:.1}°",
            azimuth[0], azimuth[1], elevation[0], elevation[1]
        )
    };
    // Surfaces in the dead zone are not in the sensor's data, so the message tells of them.
    let blocked = too_near(worst.of) as f64 / worst.of.frame.pixels() as f64;
    let near = if blocked > 0.0 {
        format!(", {} of the rays nearer than the sensor's least range", percent(blocked))
    } else {
        String::new()
    };
    let found = format!("{} of the rays hit it{near}", percent(worst.share));
    Finding::new(bounds.hold(worst.share), found, format!("{}{directions}", worst.place()))
        .shown_by([worst.sight(Some("id.instance"))])
}

pub(super) fn points_per_second(seen: &Seen, bounds: &Bounds) -> Finding {
    let mut sum = 0.0;
    for frame in seen.frames {
        let Some(rate) = frame.capture.sensor.pattern.rate_hz() else {
            return Finding::Nothing(format!("sensor {} has no rate_hz", frame.name));
        };
        sum += frame.frame.return_count() as f64 * rate;
    }
    Finding::new(bounds.hold(sum), format!("{sum:.0} points a second"), "")
}
