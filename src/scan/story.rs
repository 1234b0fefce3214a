//! The story of one pulse: where it goes, what it meets, what comes back of it, and what becomes of that.

use glam::DVec3;

use super::frame::{Cause, Echo, NO_OBJECT, Return};
use crate::physics::echo::{Part, Waveform};
use crate::scene::Scene;
use crate::sensor::{Capture, Pulse};

/// The story of a pixel's pulse. Its returns are those of the frame, bit by bit.
#[derive(Clone, Debug, PartialEq)]
pub struct Story {
    /// The row of the pixel.
    pub row: usize,
    /// The column of the pixel.
    pub column: usize,
    /// The cause of the pixel.
    pub cause: Cause,
    /// The pulse, if the pixel sends one.
    pub pulse: Option<Sent>,
    /// The number of the rays that stand for the pulse's width.
    pub sub_rays: usize,
    /// The number of those of which no light comes back.
    pub lost_rays: usize,
    /// The extinction of the air, a metre.
    pub extinction_per_m: f64,
    /// What sends light back, the nearest first.
    pub met: Vec<Met>,
    /// What the receiver makes of the light. `None` if the sensor is ideal, or the pixel sends no pulse.
    pub signal: Option<Signal>,
    /// The returns in the order in which the sensor reports them. An ideal sensor's have no echo.
    pub returns: Vec<(Return, Option<Echo>)>,
    /// The surface that blocks the beam nearer than the sensor's least range, in the form of the return that it would have given.
    pub blocker: Option<(Return, Option<Echo>)>,
}

/// A pulse as it leaves the sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sent {
    /// The time at which it is cast, in seconds on the clock of the trajectory and of the scene.
    pub time_s: f64,
    /// The point that it leaves from, in the sensor's body frame, in metres.
    pub origin_m: DVec3,
    /// The unit direction that the sensor believes in, in its body frame.
    pub direction: DVec3,
    /// The point that it leaves from, in the world, in metres.
    pub world_origin_m: DVec3,
    /// The unit direction that the sensor believes in, in the world.
    pub world_direction: DVec3,
    /// The angle between the direction that the sensor believes in and that of the beam's axis, in radians.
    pub off_rad: f64,
}

/// Something that sends light of a pulse back: an object's surface of one material, or particles of one kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Met {
    /// How the light comes: straight, by a mirror or through glass, from particles, in the halo of another beam, or
    /// from another channel.
    pub cause: Cause,
    /// The index into [`Geometry::objects`](crate::scene::Geometry::objects), if it is an object.
    pub object: Option<u32>,
    /// The index into [`Geometry::materials`](crate::scene::Geometry::materials), if it is an object.
    pub material: Option<u32>,
    /// The semantic label.
    pub label: u32,
    /// The number of sub-rays whose light it sends back; 0 of particles, halos and crosstalk.
    pub sub_rays: usize,
    /// The number of paths on which light comes back from it.
    pub paths: usize,
    /// The least and the largest range of these paths, in metres as the sensor reports them.
    pub range_m: [f64; 2],
    /// The energy of the light: in the unit of the [`Signal`]. Of an ideal sensor, the share of the pulse that the surface has.
    pub energy: f64,
    /// The share of all the energy that comes back, 0 to 1.
    pub share: f64,
    /// The share of the light that the air leaves on the way there and back, 0 to 1.
    pub transmission: f64,
}

/// What a receiver makes of the light of a pulse: a waveform of Gaussian pulses, and its peaks.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// What energies and heights are.
    pub unit: SignalUnit,
    /// The standard deviation of the pulse in range, in metres.
    pub sigma_m: f64,
    /// The height that a peak must exceed, if the receiver's sensitivity is known and it measures power.
    pub threshold: Option<f64>,
    /// The light by range, with the beam's gain.
    pub parts: Vec<Part>,
    /// The peaks, and what is detected without any light, the nearest first.
    pub peaks: Vec<SignalPeak>,
}

/// What the energies and the heights of a [`Signal`] are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignalUnit {
    /// The power relative to that of a white plane at 1 m that takes the whole beam.
    Energy,
    /// The power over the standard deviation of the noise.
    Snr,
    /// The mean number of counts in the gate of an echo, if no count blinded the detector for others. The heights of the peaks are with
    /// those that are blinded, and with background.
    Counts,
}

/// The counts of an echo, by a receiver that counts photons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Counts {
    /// The number in this histogram.
    pub drawn: u32,
    /// Its mean.
    pub mean: f64,
    /// The mean number that background alone has there.
    pub background: f64,
    /// The least number that is detected.
    pub least: u32,
}

/// A peak of a [`Signal`].
#[derive(Clone, Debug, PartialEq)]
pub struct SignalPeak {
    /// The range in metres.
    pub range_m: f64,
    /// The mean height; 0 of what no light makes.
    pub height: f64,
    /// The height with the noise of this pulse, which the threshold is held to. Of what no light makes it is a signal-to-noise ratio.
    pub amplitude: f64,
    /// The counts, if the receiver counts photons and light makes the peak.
    pub counts: Option<Counts>,
    /// The standard deviation of the peak in range, in metres.
    pub width_m: f64,
    /// The origin of the peak.
    pub cause: Cause,
    /// What becomes of it.
    pub fate: Fate,
    /// What sends the light of the peak: indices into [`Story::met`], each with its share in the height, the largest first.
    pub sources: Vec<(usize, f64)>,
}

/// What becomes of a peak.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// The sensor reports it as the return of this number, from 0.
    Returned(usize),
    /// The receiver detects it, and reports others instead.
    NotChosen,
    /// The receiver does not report it, for this cause.
    Lost(Cause),
}

impl Signal {
    /// The mean height of the waveform at a range in metres.
    pub fn height(&self, range_m: f64) -> f64 {
        Waveform::new(&self.parts, self.sigma_m).height(range_m)
    }

    /// The ranges in metres between which there is something to see: five standard deviations of the pulse around all light and
    /// all peaks. `None` without both.
    pub fn window_m(&self) -> Option<[f64; 2]> {
        let all = || self.parts.iter().map(|part| part.range_m).chain(self.peaks.iter().map(|p| p.range_m));
        let (least, most) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
        let around_m = 5.0 * self.sigma_m;
        least.is_finite().then(|| [(least - around_m).max(0.0), most + around_m])
    }
}

impl Story {
    /// The story of a pixel of which nothing is known yet.
    pub(super) fn of_pixel(row: usize, column: usize) -> Self {
        Self {
            row,
            column,
            cause: Cause::NoPulse,
            pulse: None,
            sub_rays: 0,
            lost_rays: 0,
            extinction_per_m: 0.0,
            met: Vec::new(),
            signal: None,
            returns: Vec::new(),
            blocker: None,
        }
    }
}

impl Sent {
    /// A pulse of a capture whose axis goes in the direction `axis` of the sensor's body frame.
    pub(super) fn of(capture: &Capture, pulse: &Pulse, axis: DVec3) -> Self {
        let world_from_sensor = match capture.fixed_world_from_sensor() {
            Some(pose) => pose,
            None => capture.world_from_sensor(pulse.time_s),
        };
        let &Pulse { origin, direction, time_s, .. } = pulse;
        Self {
            time_s: capture.cast_at_s(time_s),
            origin_m: origin,
            direction,
            world_origin_m: world_from_sensor.point(origin),
            world_direction: world_from_sensor.direction(direction),
            off_rad: libm::atan2(direction.cross(axis).length(), direction.dot(axis)),
        }
    }
}

/// The material of the triangle with an id in a scene, if any has it.
pub(super) fn material_of(scene: &Scene, triangle: u32) -> Option<u32> {
    if triangle == NO_OBJECT {
        return None;
    }
    let placements = &scene.arrangement.placements;
    // The ids rise from placement to placement.
    let index = placements.partition_point(|p| p.first_triangle <= triangle).checked_sub(1)?;
    let (placement, in_mesh) = (&placements[index], triangle - placements[index].first_triangle);
    let is_there = (in_mesh as usize) < scene.mesh(placement.mesh).triangles.len();
    is_there.then(|| scene.surface(index as u32, in_mesh).material)
}
