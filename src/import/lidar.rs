//! A LiDAR with a turning head, as every vendor's calibration comes to it.

use super::writer::Toml;

/// What a sensor file says of a rotating LiDAR; lists have one entry a beam, in the vendor's order of channels.
#[derive(Debug)]
pub(super) struct Lidar {
    pub elevations_deg: Vec<f64>,
    pub azimuth_offsets_deg: Vec<f64>,
    pub beam_times_us: Option<Vec<f64>>,
    /// Where the beams leave the head, in its own frame: x forward at the head's azimuth, y left, z up from the sensor's
    /// origin, metres.
    pub origins_m: Option<Vec<[f64; 3]>>,
    /// How far before a beam's origin its range begins.
    pub range_offset_m: f64,
    pub columns: u32,
    /// `None` for the full turn from behind, clockwise.
    pub sector_deg: Option<(f64, f64)>,
    pub rate_hz: f64,
}

impl Lidar {
    /// Beams that leave from the origin and all at once, a full turn in the usual columns at the usual rate: 0.2° at 10 Hz.
    pub fn usual(elevations_deg: Vec<f64>, azimuth_offsets_deg: Vec<f64>) -> Self {
        Self {
            elevations_deg,
            azimuth_offsets_deg,
            beam_times_us: None,
            origins_m: None,
            range_offset_m: 0.0,
            columns: 1800,
            sector_deg: None,
            rate_hz: 10.0,
        }
    }

    /// The same with firing times, and as many of the usual columns a turn as leave each beam its time.
    pub fn firing_at(self, times_us: Vec<f64>) -> Self {
        let last_s = times_us.iter().copied().fold(0.0, f64::max) * 1e-6;
        let fits = |columns: &u32| last_s * f64::from(*columns) * self.rate_hz < 1.0;
        let columns = [1800, 900, 600, 450, 360, 180].into_iter().find(fits).unwrap_or(90);
        Self { columns, beam_times_us: Some(times_us), ..self }
    }

    /// Writes `ring` and `[rotating]`.
    pub fn write(&self, ring: &str, toml: &mut Toml) {
        toml.text("ring", ring);
        toml.table("rotating");
        toml.numbers("elevations_deg", &self.elevations_deg);
        if self.azimuth_offsets_deg.iter().any(|offset| *offset != 0.0) {
            toml.numbers("azimuth_offsets_deg", &self.azimuth_offsets_deg);
        }
        if let Some(times) = &self.beam_times_us {
            toml.numbers("beam_times_us", times);
            toml.line("turns_while_firing = true");
        }
        if let Some(origins) = &self.origins_m {
            toml.vectors("beam_origins_m", origins);
        }
        if self.range_offset_m != 0.0 {
            toml.number("range_offset_m", self.range_offset_m);
        }
        toml.integer("columns", self.columns);
        if let Some((from, to)) = self.sector_deg {
            toml.sector("sector_deg", from, to);
        }
        toml.number("rate_hz", self.rate_hz);
        if self.range_offset_m != 0.0 {
            toml.line("\n# No range is less than the offset that all have.");
            toml.line("[range]");
            toml.number("min_m", self.range_offset_m);
        }
    }
}
