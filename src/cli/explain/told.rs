//! A story with everything that it takes to tell it.

use std::collections::BTreeMap;

use crate::scan::{Signal, SignalUnit, Story};
use crate::scene::Scene;
use crate::sensor::Sensor;

/// A story with the names that it is told with.
pub struct Told<'s> {
    pub story: &'s Story,
    pub scene: &'s Scene,
    pub sensor: &'s Sensor,
    pub sensor_name: &'s str,
    pub frame: u64,
    pub label_names: BTreeMap<u32, String>,
}

/// The ranges in metres that pictures and tables show of a signal. Without light, they are those of the sensor's limits.
pub fn window_m(told: &Told, signal: &Signal) -> [f64; 2] {
    let max_m = told.sensor.range.max_m;
    signal.window_m().unwrap_or([0.0, if max_m.is_finite() { max_m } else { 100.0 }])
}

/// The name of what the heights of a signal are.
pub fn unit(signal: &Signal) -> &'static str {
    match signal.unit {
        SignalUnit::Energy => "relative energy",
        SignalUnit::Snr => "signal-to-noise ratio",
        SignalUnit::Counts => "counts without pile-up",
    }
}

/// The name of the same in files.
pub fn unit_in_files(signal: &Signal) -> &'static str {
    match signal.unit {
        SignalUnit::Energy => "energy",
        SignalUnit::Snr => "snr",
        SignalUnit::Counts => "counts",
    }
}
