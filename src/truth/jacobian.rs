//! How the ranges of a frame change with the pose of its sensor, for calibration and for estimators.

use glam::DVec3;

use super::facet::{Facet, placement_of};
use crate::scan::{Cause, Frame, NO_OBJECT};
use crate::scene::Scene;
use crate::sensor::{Capture, Pulse, Ranging};

/// The cosine of the angle of incidence below which a range has no derivative. A beam that is so close to the plane of its triangle
/// slides by a million metres for each metre that the sensor moves, off any triangle. The cosine is known to a few units of 2⁻⁵³
/// (rotations and normals are rounded to that), so that above it the derivative is known to 10⁻⁹ of itself.
pub const LEAST_COSINE: f64 = 1e-6;

/// The derivative of each return's ideal range by the pose of the sensor, by the slot of the return. `scene` is the scene that was cast,
/// as it was arranged for the frame.
///
/// The sensor is moved in its own frame at each pulse's own time t: world_from_sensor(t)·exp(ξ), with ξ = (τ, φ), a translation τ in
/// metres along the axes of the sensor's body frame (x forward, y left, z up) and a rotation vector φ in radians about its origin. That
/// is what a wrong mount does to all pulses of a frame alike, also when the sensor moves. The six numbers are ∂r/∂τx, ∂r/∂τy, ∂r/∂τz,
/// without a unit, and ∂r/∂φx, ∂r/∂φy, ∂r/∂φz in metres a radian.
///
/// The triangle stays where it is at the time of the pulse. With o and d the pulse's origin and its unit direction, n the normal of the
/// triangle and a a corner, all in the sensor's frame, the moved axis o + τ + φ × o + t·(d + φ × d) meets the plane n·(x − a) = 0 at a
/// length t whose differential follows from the differential of the equation: n·τ + n·(φ × p) + n·d·δt = 0, where p = o + t·d is the
/// point that is met. By n·(φ × p) = φ·(p × n) it is
///
/// ∂t/∂τ = −n / (n·d),   ∂t/∂φ = −(p × n) / (n·d).
///
/// A range that counts along the axis ([`Ranging::Along`]) changes as t does. One that is the distance of p from the sensor's origin
/// ([`Ranging::FromOrigin`]) changes by ∂|o + t·d|/∂t = p·d / |p| of it, because o and d are fixed in the sensor's frame.
///
/// All six are NaN where a range has no such derivative: in slots without a return, at returns that do not come straight off one
/// surface (any cause but [`Cause::Surface`]: mirrors, glass, mixed pixels, particles, noise), and at an angle of incidence whose
/// cosine is less than [`LEAST_COSINE`]. Of a sensor that measures it is the derivative of the range that the axis of the pulse has on the return's
/// triangle: the sensor's errors, and what the width of the beam adds, are not in it.
pub fn range_jacobians(scene: &Scene, capture: &Capture, frame: &Frame) -> Vec<[f64; 6]> {
    let returns = frame.returns();
    let mut jacobians = vec![[f64::NAN; 6]; returns.range_m.len()];
    for pixel in 0..frame.pixels() {
        for (number, slot) in frame.slots(pixel).enumerate() {
            let triangle = returns.triangle[slot];
            if frame.cause(pixel, number) != Some(Cause::Surface) || triangle == NO_OBJECT {
                continue;
            }
            let Some(pulse) = capture.pulse(pixel / frame.columns(), pixel % frame.columns()) else {
                continue;
            };
            let time_s = capture.cast_at_s(pulse.time_s);
            let Some((placement, triangle)) = placement_of(scene, triangle, time_s) else { continue };
            let facet = Facet::of(scene, placement, triangle, capture, &pulse);
            if let Some(derivative) = facet.and_then(|facet| of_facet(&facet, &pulse)) {
                jacobians[slot] = derivative;
            }
        }
    }
    jacobians
}

fn of_facet(facet: &Facet, pulse: &Pulse) -> Option<[f64; 6]> {
    of_plane(facet.normal_in_sensor()?, facet.along_m(), pulse)
}

/// The derivative for a plane that the axis meets after a length in metres, by its unit normal in the sensor's frame. `None` if the
/// axis grazes it.
fn of_plane(normal: DVec3, along_m: f64, pulse: &Pulse) -> Option<[f64; 6]> {
    let cosine = normal.dot(pulse.direction);
    if cosine.abs() < LEAST_COSINE || !along_m.is_finite() {
        return None;
    }
    let point = pulse.origin + pulse.direction * along_m;
    let range_by_length = match pulse.ranging {
        Ranging::Along(_) => 1.0,
        // A point at the sensor's origin is at a corner of |p|, which has no derivative.
        Ranging::FromOrigin => point.try_normalize()?.dot(pulse.direction),
    };
    let scale = -range_by_length / cosine;
    let [translation, rotation] = [normal * scale, point.cross(normal) * scale];
    Some([translation.x, translation.y, translation.z, rotation.x, rotation.y, rotation.z])
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;
    use proptest::prelude::*;

    /// The range that a pulse has of the plane through `place` after the sensor was moved by a translation and a rotation vector.
    fn moved_range_m(normal: DVec3, place: DVec3, pulse: &Pulse, [translation, turn]: [DVec3; 2]) -> f64 {
        let rotation = match turn.try_normalize() {
            Some(axis) => DMat3::from_axis_angle(axis, turn.length()),
            None => DMat3::IDENTITY,
        };
        let (origin, direction) = (rotation * pulse.origin + translation, rotation * pulse.direction);
        pulse.range_m(normal.dot(place - origin) / normal.dot(direction))
    }

    #[test]
    fn a_wall_ahead_comes_nearer_as_the_sensor_advances() {
        let straight = Pulse::new(DVec3::ZERO, DVec3::X, 0.0);
        assert_eq!(
            of_plane(DVec3::NEG_X, 5.0, &straight).unwrap().map(|v| v + 0.0),
            [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        );
        // Of a beam 45° to the left, a turn to the left by φ makes 5·√2 m into 5/cos(45° + φ): by 5·sin 45°/cos² 45° a radian.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let aside = Pulse::new(DVec3::ZERO, DVec3::new(half, half, 0.0), 0.0);
        let found = of_plane(DVec3::X, 5.0 / half, &aside).unwrap();
        let expected = [-1.0 / half, 0.0, 0.0, 0.0, 0.0, 5.0 / half];
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-14), "{found:?}");
        assert_eq!(of_plane(DVec3::Z, 5.0, &straight), None);
    }

    proptest! {
        #[test]
        fn it_is_the_limit_of_differences(
            normal in prop::array::uniform3(-1.0f64..1.0),
            direction in prop::array::uniform3(-1.0f64..1.0),
            origin in prop::array::uniform3(-0.2f64..0.2),
            along_m in 1.0f64..50.0,
            from_origin: bool,
        ) {
            let unit = |v: [f64; 3]| DVec3::from_array(v).try_normalize();
            let (Some(normal), Some(direction)) = (unit(normal), unit(direction)) else { return Ok(()) };
            prop_assume!(normal.dot(direction).abs() > 0.1);
            let ranging = if from_origin { Ranging::FromOrigin } else { Ranging::Along(0.03) };
            let pulse = Pulse { ranging, ..Pulse::new(DVec3::from_array(origin), direction, 0.0) };
            let place = pulse.origin + direction * along_m;
            let found = of_plane(normal, along_m, &pulse).unwrap();
            // The central difference is off by h²/6 of the third derivative, and by the rounding of ranges over the step h = 10⁻⁵. About
            // an axis that turns the beam by φ in the plane of its incidence, the length t is t·cos α/cos(α + φ), whose third derivative
            // is t·tan α·(6/cos² α − 1): with t of at most 50 m and cos α of at least 0.1, less than 6·50·10³, so 5.0·10⁻⁶ of difference.
            // A beam whose origin turns with the sensor, 0.35 m aside, adds as much as 0.35 m of length; the curvature of |p| by that
            // origin counts where t is small, and is less than a tenth of the bound there. A quotient of coordinates of 50 m by 0.1 is
            // rounded by less than 10⁻¹² m: 10⁻⁷ over the step.
            let step = 1e-5;
            for (number, derivative) in found.into_iter().enumerate() {
                let axis = DVec3::AXES[number % 3] * step;
                let moved = |sign: f64| {
                    let motion = if number < 3 { [axis * sign, DVec3::ZERO] } else { [DVec3::ZERO, axis * sign] };
                    moved_range_m(normal, place, &pulse, motion)
                };
                let difference = (moved(1.0) - moved(-1.0)) / (2.0 * step);
                prop_assert!((difference - derivative).abs() < 5.2e-6, "{number}: {difference} {derivative}");
            }
        }
    }
}
