//! The formulas of a LiDAR's measurement, each with its source: pure functions of numbers, which know no sensor and no scene.
//!
//! Lengths are in metres and angles in radians. Power is counted relative to what comes back from a white Lambertian plane
//! at 1 m that the beam meets at a right angle, so that the constants of a receiver cancel.
//!
//! ```text
//! footprint  where the light of a beam goes: fixed sets of sub-rays of equal energy
//! echo       pulses that add up to a waveform, and its peaks
//! detection  thresholds, false alarms, the sensitivity that range limits of data sheets imply, and the noise of a range
//! intensity  the scales by which vendors tell intensity
//! ```

pub mod detection;
pub mod echo;
pub mod footprint;
pub mod intensity;
