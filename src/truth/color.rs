//! The colours of the surfaces that returns come from, for pictures that people look at.

use glam::DVec3;

use super::facet::{Facet, placement_of};
use super::surface::weights;
use crate::scan::{Frame, NO_OBJECT};
use crate::scene::Scene;
use crate::sensor::{Capture, Pulse};

/// The linear red, green and blue of each return's surface in the light of a lamp at the sensor, 0 to 1, by the slot of the return:
/// the base colour with texture and vertex colours, times the cosine of the angle of incidence. Slots without a return, and returns
/// that no surface makes, are black. `scene` is the scene that was cast, as it was arranged for the frame.
///
/// A texture is looked up where the axis of the pulse meets the plane of the return's triangle, or at the nearest place of the
/// triangle: a return that came by way of a mirror or from beside the axis may have another place's colour.
pub fn surface_colors(scene: &Scene, capture: &Capture, frame: &Frame) -> Vec<[f32; 3]> {
    let returns = frame.returns();
    let mut colors = vec![[0.0; 3]; returns.range_m.len()];
    for pixel in 0..frame.pixels() {
        for slot in frame.slots(pixel) {
            let triangle = returns.triangle[slot];
            let pulse = capture.pulse(pixel / frame.columns(), pixel % frame.columns());
            let Some(pulse) = pulse.filter(|_| triangle != NO_OBJECT) else { continue };
            let time_s = capture.cast_at_s(pulse.time_s);
            let Some((number, triangle)) = placement_of(scene, triangle, time_s) else { continue };
            let [u, v] = match scene.varies(number, triangle) {
                true => place_on(scene, number, triangle, capture, &pulse).unwrap_or([1.0 / 3.0; 2]),
                false => [0.0; 2],
            };
            let normal = DVec3::from_array(returns.normal[slot].map(f64::from));
            let cosine = normal.dot(pulse.direction).abs().min(1.0);
            let [red, green, blue, _] = scene.appearance(number, triangle, u, v).base_color;
            colors[slot] = [red, green, blue].map(|linear| (f64::from(linear) * cosine) as f32);
        }
    }
    colors
}

/// The barycentric weights of the second and the third corner of a triangle at the place that is nearest, in weights, to where a
/// pulse's axis meets its plane. `None` if it meets none.
fn place_on(scene: &Scene, number: u32, triangle: u32, capture: &Capture, pulse: &Pulse) -> Option<[f64; 2]> {
    let facet = Facet::of(scene, number, triangle, capture, pulse)?;
    let within = weights(facet.corners, facet.point(facet.along_m()))?.map(|weight| weight.max(0.0));
    let sum: f64 = within.iter().sum();
    (sum.is_finite() && sum > 0.0).then(|| [within[1] / sum, within[2] / sum])
}
