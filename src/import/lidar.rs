//! A LiDAR with a turning head: the keys of a sensor file that the vendors' calibrations are brought to.

use super::writer::Toml;
use crate::config::keys::sensor::{RANGE, RING, ROTATING, range, rotating};

/// Most beams of a calibration. No unit has more than 256; the bound keeps a table of something else, or a hostile one, from
/// becoming a sensor file that is too large to be read.
pub(super) const MOST_BEAMS: u32 = 4096;

/// One column of a cycle of columns that differ.
#[derive(Clone, Debug)]
pub(super) struct Turn {
    /// One a beam; that of a silent beam is 0.
    pub times_us: Vec<f64>,
    /// The indices of the beams that do not fire.
    pub silent: Vec<usize>,
}

/// The keys of a rotating LiDAR's sensor file. Lists have one entry a beam, in the vendor's order of channels.
#[derive(Debug)]
pub(super) struct Lidar {
    pub elevations_deg: Vec<f64>,
    pub azimuth_offsets_deg: Vec<f64>,
    pub beam_times_us: Option<Vec<f64>>,
    /// The columns that differ. Empty if all columns are alike.
    pub cycle: Vec<Turn>,
    /// The origins of the beams in the head's frame, in metres: x forward at the head's azimuth, y left, z up, from the sensor's
    /// origin.
    pub origins_m: Option<Vec<[f64; 3]>>,
    /// The distance before a beam's origin from which its range is counted, in metres.
    pub range_offset_m: f64,
    /// The columns by which the rows of a destaggered image are moved, if the file has them.
    pub pixel_shifts: Option<Vec<i32>>,
    pub columns: u32,
    /// `None` for a full turn that starts behind the sensor and goes clockwise.
    pub sector_deg: Option<(f64, f64)>,
    pub rate_hz: f64,
}

impl Lidar {
    /// Beams that all start at the origin and at the same time, in the usual columns and at the usual rate: a full turn in
    /// steps of 0.2° at 10 Hz.
    pub fn usual(elevations_deg: Vec<f64>, azimuth_offsets_deg: Vec<f64>) -> Self {
        Self {
            elevations_deg,
            azimuth_offsets_deg,
            beam_times_us: None,
            cycle: Vec::new(),
            origins_m: None,
            range_offset_m: 0.0,
            pixel_shifts: None,
            columns: 1800,
            sector_deg: None,
            rate_hz: 10.0,
        }
    }

    /// The same with firing times, one for each column of a cycle, and with the largest of the usual numbers of columns whose
    /// time lets every beam fire. Units whose beams fire in turns have twice as many columns as others.
    pub fn firing_in_turns(self, turns: &[Turn]) -> Self {
        let fires = |turn: &Turn, beam: usize| turn.silent.binary_search(&beam).is_err();
        let times = turns.iter().flat_map(|turn| {
            turn.times_us.iter().enumerate().filter(|(beam, _)| fires(turn, *beam)).map(|(_, time)| *time)
        });
        let (first, last) = times.fold((f64::INFINITY, f64::NEG_INFINITY), |(f, l), t| (f.min(t), l.max(t)));
        let spread_s = (last - first) * 1e-6;
        let fits = |columns: &u32| spread_s * f64::from(*columns) * self.rate_hz < 1.0;
        let is_in_turns = turns.iter().any(|turn| !turn.silent.is_empty());
        let usual = [3600, 1800, 900, 600, 450, 360, 180].into_iter().skip(usize::from(!is_in_turns));
        let columns = usual.into_iter().find(fits).unwrap_or(90);
        match turns {
            [all_alike] if all_alike.silent.is_empty() => {
                Self { columns, beam_times_us: Some(all_alike.times_us.clone()), ..self }
            }
            turns => Self { columns, cycle: turns.to_vec(), ..self },
        }
    }

    /// Writes `ring` and `[rotating]`.
    pub fn write(&self, ring: &str, toml: &mut Toml) {
        toml.text(RING.name(), ring);
        toml.table(ROTATING.name());
        toml.numbers(rotating::ELEVATIONS.name(), &self.elevations_deg);
        if self.azimuth_offsets_deg.iter().any(|offset| *offset != 0.0) {
            toml.numbers(rotating::AZIMUTH_OFFSETS.name(), &self.azimuth_offsets_deg);
        }
        if let Some(times) = &self.beam_times_us {
            toml.numbers(rotating::BEAM_TIMES.name(), times);
        }
        if self.beam_times_us.is_some() || !self.cycle.is_empty() {
            toml.flag(rotating::TURNS_WHILE_FIRING.name(), true);
        }
        if let Some(origins) = &self.origins_m {
            toml.vectors(rotating::BEAM_ORIGINS.name(), origins);
        }
        if self.range_offset_m != 0.0 {
            toml.number(rotating::RANGE_OFFSET.name(), self.range_offset_m);
        }
        if let Some(shifts) = &self.pixel_shifts {
            toml.text(rotating::LAYOUT.name(), "staggered");
            toml.integers(rotating::PIXEL_SHIFTS.name(), shifts);
        }
        toml.integer(rotating::COLUMNS.name(), self.columns);
        if let Some((from, to)) = self.sector_deg {
            toml.sector(rotating::SECTOR.name(), from, to);
        }
        toml.number(rotating::RATE.name(), self.rate_hz);
        for turn in &self.cycle {
            toml.line(&format!("\n[[{}.{}]]", ROTATING.name(), rotating::CYCLE.name()));
            toml.numbers(rotating::PHASE_TIMES.name(), &turn.times_us);
            if !turn.silent.is_empty() {
                toml.comment("Beams that do not fire in this column; their times above stand for nothing.");
                toml.line(&format!("{} = {:?}", rotating::SILENT_BEAMS.name(), turn.silent));
            }
        }
        if self.range_offset_m != 0.0 {
            toml.line("\n# Every range includes the offset, so none is less.");
            toml.line(&format!("[{}]", RANGE.name()));
            toml.number(range::MIN.name(), self.range_offset_m);
        }
    }
}
