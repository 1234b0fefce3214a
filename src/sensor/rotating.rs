//! Multi-beam LiDARs with a rotating head.

use glam::DVec3;

use super::{Pulse, Ranging};
use crate::angle::Angle;

/// A rotating head with beams at fixed elevations. Each beam fires once in each column, unless a cycle says otherwise.
#[derive(Clone, Debug, PartialEq)]
pub struct Rotating {
    /// The beams, highest first.
    beams: Vec<Beam>,
    columns: usize,
    from: Angle,
    to: Angle,
    rate_hz: f64,
    /// Sine and cosine of each column's azimuth, without the azimuth offset of a beam. They save a sine for each pulse.
    column_sin_cos: Vec<(f64, f64)>,
    /// The time of each column, in seconds from the frame's start: a pulse then costs no division.
    column_times_s: Vec<f64>,
    /// The origin of each beam, by row, in the frame of the head when the beam fires. If the list is empty, all beams leave
    /// from the sensor's origin.
    origins: Vec<DVec3>,
    ranging: Ranging,
    /// Whether the head turns on between the column's own time and the firing of a beam.
    turns: bool,
    /// The phases of the cycle of columns, at least one. Column k is in phase k modulo their number.
    phases: Vec<Vec<Firing>>,
    /// The number of columns by which each row of the image is moved to the right. If the list is empty, no row is moved.
    shifts: Vec<usize>,
}

/// One laser of a rotating LiDAR.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// The elevation above the sensor's xy plane.
    pub elevation: Angle,
    /// The angle that is added to the column's azimuth.
    pub azimuth_offset: Angle,
    /// The time of the beam's pulse, in seconds after the column's own time. It is negative if the beam fires before that.
    pub time_s: f64,
    /// The beam's index in the beam table of the sensor file, from 0.
    pub file_index: usize,
}

/// The firing of one beam in the columns of one phase.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Firing {
    /// Whether the beam fires at all.
    fires: bool,
    /// The time of the pulse, in seconds after the column's own time.
    time_s: f64,
    /// The angle by which the head turns from the column's own time on until the beam fires.
    turn: Angle,
    /// Sine and cosine of the elevation.
    elevation: (f64, f64),
    /// Sine and cosine of the azimuth offset and the turn together.
    azimuth: (f64, f64),
    /// The origin in the frame of the head at the column's own time.
    origin: DVec3,
}

/// The differences of one column of a cycle. A unit whose beams fire in turns repeats a few columns over and over: Hesai's
/// Pandar128 and OT128 go through two or four azimuth states, and QT128 through two loops.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Phase {
    /// The times of the beams in seconds after the column's own time, in the order of the sensor file. `None` stands for the
    /// beams' own times.
    pub times_s: Option<Vec<f64>>,
    /// The beams that do not fire, by their index in the sensor file.
    pub silent: Vec<usize>,
}

/// The reason why a rotating pattern is impossible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RotatingError {
    /// There are no beams.
    #[error("a rotating sensor needs at least one beam")]
    NoBeams,
    /// There are no columns.
    #[error("a rotating sensor needs at least one column")]
    NoColumns,
    /// The sector is empty, or larger than a full turn.
    #[error("a sector must turn by more than 0 and at most 360 degrees")]
    Sector,
    /// The rate is not a positive number.
    #[error("the rate must be positive")]
    Rate,
    /// An angle, a time or an origin of a beam is not finite, or its elevation is beyond straight up or down. Beams count
    /// from 0.
    #[error("beam {0}: elevations must lie within ±90 degrees, and angles, times and origins must be finite")]
    Beam(usize),
    /// A list has another length than the list of beams.
    #[error("there must be one for each beam")]
    Count,
    /// A cycle has no column, or one in which there is no such beam.
    #[error("a cycle needs at least one column, and its silent beams must be beams of the sensor")]
    Cycle,
    /// The sector is no full turn. Only the columns of a full turn wrap around, so only its rows can be moved.
    #[error("only a full turn can be destaggered, because its columns wrap around")]
    NotFullTurn,
    /// The range offset is negative or not finite.
    #[error("a range offset must be 0 or more")]
    RangeOffset,
}

impl Rotating {
    /// A pattern of `beams` that fire in `columns` columns from azimuth `from` to azimuth `to`, with a head that turns
    /// `rate_hz` times a second. The beams are in the order of the sensor file. The rows are the beams sorted by elevation,
    /// highest first; beams of equal elevation keep their order.
    ///
    /// A full turn has no repeated last column. The last column of a smaller sector is at `to`.
    ///
    /// # Errors
    /// A [`RotatingError`] that names the first wrong argument.
    pub fn new(
        mut beams: Vec<Beam>,
        columns: usize,
        (from, to): (Angle, Angle),
        rate_hz: f64,
    ) -> Result<Self, RotatingError> {
        if beams.is_empty() {
            return Err(RotatingError::NoBeams);
        }
        if columns == 0 {
            return Err(RotatingError::NoColumns);
        }
        let turn = (to - from).radians().abs();
        // The tolerance covers a few ulps, because 180 − (−180) degrees is 2π only up to rounding.
        if !(from.radians().is_finite() && turn > 0.0 && turn <= std::f64::consts::TAU * (1.0 + 1e-12)) {
            return Err(RotatingError::Sector);
        }
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(RotatingError::Rate);
        }
        if let Some(bad) = beams.iter().position(|b| {
            let finite = b.azimuth_offset.radians().is_finite() && b.time_s.is_finite();
            !(finite && b.elevation.radians().abs() <= std::f64::consts::FRAC_PI_2)
        }) {
            return Err(RotatingError::Beam(bad));
        }
        for (index, beam) in beams.iter_mut().enumerate() {
            beam.file_index = index;
        }
        beams.sort_by(|a, b| b.elevation.radians().total_cmp(&a.elevation.radians()));
        let mut pattern = Self {
            beams,
            columns,
            from,
            to,
            rate_hz,
            column_sin_cos: Vec::new(),
            column_times_s: Vec::new(),
            origins: Vec::new(),
            ranging: Ranging::default(),
            turns: false,
            phases: Vec::new(),
            shifts: Vec::new(),
        };
        pattern.phases = vec![pattern.firings(&Phase::default())];
        pattern.column_times_s = (0..columns).map(|column| pattern.column_time_s(column)).collect();
        pattern.column_sin_cos = (0..columns).map(|column| pattern.azimuth(column).sin_cos()).collect();
        Ok(pattern)
    }

    /// The same pattern with beams that leave from other points than the sensor's origin. `origins_m` has one origin in
    /// metres for each beam, in the order of the sensor file and in the frame of the head: x forward at the azimuth of the
    /// head (without the azimuth offset of the beam), y left, z up from the sensor's origin.
    ///
    /// Ouster's beams start on a circle of radius n at the encoder's angle, which is (n, 0, z) here (the lookup table of
    /// ouster-sdk). The centre of RoboSense's lens and the vertical offsets of Velodyne's lasers are such points too.
    ///
    /// # Errors
    /// [`RotatingError::Count`] if there is not one origin for each beam, [`RotatingError::Beam`] if an origin is not
    /// finite.
    pub fn with_origins(mut self, origins_m: &[DVec3]) -> Result<Self, RotatingError> {
        if origins_m.len() != self.beams.len() {
            return Err(RotatingError::Count);
        }
        if let Some(bad) = origins_m.iter().position(|o| !o.is_finite()) {
            return Err(RotatingError::Beam(bad));
        }
        self.origins = self.beams.iter().map(|beam| origins_m[beam.file_index]).collect();
        Ok(self.aimed())
    }

    /// The same pattern with ranges that begin `metres` before the beam's origin, as the unit reports them.
    ///
    /// Ouster's range r counts from the axis of rotation to the beam's origin and on along the beam: r = n + the length of
    /// the beam (the lookup table of ouster-sdk goes r − n along the beam).
    ///
    /// # Errors
    /// [`RotatingError::RangeOffset`] if the offset is negative or not finite.
    pub fn with_range_offset(mut self, metres: f64) -> Result<Self, RotatingError> {
        if !(metres >= 0.0 && metres.is_finite()) {
            return Err(RotatingError::RangeOffset);
        }
        self.ranging = Ranging::Along(metres);
        Ok(self)
    }

    /// The same pattern with ranges that are distances from the sensor's origin, as Hesai's units report them: a point of
    /// range r lies at c + s·u with |c + s·u| = r, for the optical centre c and the beam's direction u.
    #[must_use]
    pub fn with_ranges_from_origin(self) -> Self {
        Self { ranging: Ranging::FromOrigin, ..self }
    }

    /// The same pattern with a head that keeps turning while the beams of a column fire one after the other. A beam that
    /// fires t seconds later has its direction and its origin rotated further by 2π·rate·t. Without this, all beams of a
    /// column fire at the column's azimuth, whatever their times.
    #[must_use]
    pub fn turning_while_firing(self) -> Self {
        Self { turns: true, ..self }.aimed()
    }

    /// The same pattern with columns that differ, in a cycle that begins anew after its last column and with every frame.
    ///
    /// # Errors
    /// [`RotatingError::Cycle`] if there is no column, or if a silent beam does not exist; [`RotatingError::Count`] if a
    /// list of times has not one for each beam; [`RotatingError::Beam`] if a time is not finite.
    pub fn with_cycle(mut self, cycle: &[Phase]) -> Result<Self, RotatingError> {
        let beams = self.beams.len();
        if cycle.is_empty() || cycle.iter().flat_map(|phase| &phase.silent).any(|&beam| beam >= beams) {
            return Err(RotatingError::Cycle);
        }
        for times in cycle.iter().filter_map(|phase| phase.times_s.as_ref()) {
            if times.len() != beams {
                return Err(RotatingError::Count);
            }
            if let Some(bad) = times.iter().position(|time| !time.is_finite()) {
                return Err(RotatingError::Beam(bad));
            }
        }
        self.phases = cycle.iter().map(|phase| self.firings(phase)).collect();
        Ok(self)
    }

    /// The firings of the beams in a phase, by row.
    fn firings(&self, phase: &Phase) -> Vec<Firing> {
        let mut fires = vec![true; self.beams.len()];
        phase.silent.iter().for_each(|&beam| fires[beam] = false);
        let of_row = |(row, beam): (usize, &Beam)| {
            let time_s = phase.times_s.as_ref().map_or(beam.time_s, |times| times[beam.file_index]);
            self.firing_of(row, fires[beam.file_index], time_s)
        };
        self.beams.iter().enumerate().map(of_row).collect()
    }

    /// The firing of a row's beam at a time.
    fn firing_of(&self, row: usize, fires: bool, time_s: f64) -> Firing {
        let beam = &self.beams[row];
        let sense = (self.to - self.from).radians().signum();
        let turn =
            Angle::rad(if self.turns { std::f64::consts::TAU * self.rate_hz * sense * time_s } else { 0.0 });
        let origin = self.origins.get(row).copied().unwrap_or_default();
        Firing {
            fires,
            time_s,
            turn,
            elevation: beam.elevation.sin_cos(),
            azimuth: (beam.azimuth_offset + turn).sin_cos(),
            origin: if self.turns { rotated_about_z(origin, turn.sin_cos()) } else { origin },
        }
    }

    /// The same pattern with firings that follow its origins and its turning.
    fn aimed(mut self) -> Self {
        let aim = |phase: &Vec<Firing>| {
            phase.iter().enumerate().map(|(row, f)| self.firing_of(row, f.fires, f.time_s)).collect()
        };
        self.phases = self.phases.iter().map(aim).collect();
        self
    }

    /// The same pattern with an image whose columns are azimuths (a destaggered image). Each row is moved by its beam's
    /// azimuth offset, rounded to whole columns, so that neighbours in the image are neighbours in space. `column` then
    /// means a column of the image, and the pulses of a column have different times. Without this, the image is as
    /// measured, and a column is a firing.
    ///
    /// # Errors
    /// [`RotatingError::NotFullTurn`] if the sector is no full turn.
    pub fn destaggered(self) -> Result<Self, RotatingError> {
        let step = self.azimuth_step().radians();
        let shift = |beam: &Beam| (beam.azimuth_offset.radians() / step).round();
        let columns = self.columns as f64;
        let mut by_file = vec![0; self.beams.len()];
        for beam in &self.beams {
            by_file[beam.file_index] = shift(beam).rem_euclid(columns) as usize;
        }
        self.with_shifts(&by_file)
    }

    /// The same pattern with each row of the image moved to the right by as many columns as `shifts` says for its beam, in
    /// the order of the sensor file. This is Ouster's `pixel_shift_by_row`. Pixels beyond the right edge come in again at
    /// the left.
    ///
    /// # Errors
    /// [`RotatingError::Count`] if there is not one shift for each beam, [`RotatingError::NotFullTurn`] if the sector is no
    /// full turn.
    pub fn with_shifts(mut self, shifts: &[usize]) -> Result<Self, RotatingError> {
        if shifts.len() != self.beams.len() {
            return Err(RotatingError::Count);
        }
        if !self.is_full_turn() {
            return Err(RotatingError::NotFullTurn);
        }
        self.shifts = self.beams.iter().map(|beam| shifts[beam.file_index] % self.columns).collect();
        Ok(self)
    }

    /// Whether the rows of the image are moved against the order of firing.
    pub fn is_destaggered(&self) -> bool {
        !self.shifts.is_empty()
    }

    /// How ranges are counted.
    pub fn ranging(&self) -> Ranging {
        self.ranging
    }

    /// The least range in metres that the point at every beam's own origin may have. A smaller one would lie before it.
    pub fn least_range_m(&self) -> f64 {
        match self.ranging {
            Ranging::Along(before) => before,
            Ranging::FromOrigin => self.origins.iter().map(|origin| origin.length()).fold(0.0, f64::max),
        }
    }

    /// The beams, highest first. Each is a row of the image.
    pub fn beams(&self) -> &[Beam] {
        &self.beams
    }

    /// The number of firings in the sector.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Turns a second.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// The azimuths of the sector's start and end.
    pub fn sector(&self) -> (Angle, Angle) {
        (self.from, self.to)
    }

    /// Whether the sector is a full turn.
    pub fn is_full_turn(&self) -> bool {
        (self.to - self.from).radians().abs() > std::f64::consts::TAU * (1.0 - 1e-12)
    }

    /// The angle from one column to the next. It is negative when the head turns clockwise seen from above, and 0 for a
    /// single column.
    pub fn azimuth_step(&self) -> Angle {
        let steps = if self.is_full_turn() { self.columns } else { self.columns - 1 };
        Angle::rad(if steps == 0 { 0.0 } else { (self.to - self.from).radians() / steps as f64 })
    }

    /// The azimuth of a column, without the azimuth offset of a beam.
    pub fn azimuth(&self, column: usize) -> Angle {
        self.from + Angle::rad(self.azimuth_step().radians() * column as f64)
    }

    /// The time from one column to the next, in seconds. It is 0 for a single column.
    pub fn column_s(&self) -> f64 {
        self.azimuth_step().radians().abs() / std::f64::consts::TAU / self.rate_hz
    }

    /// The times of the first and the last pulse, in seconds from the first column's own time. The first one is negative if
    /// a beam fires before its column's time.
    pub fn pulse_times_s(&self) -> (f64, f64) {
        // The first pulse is in the first cycle, the last one in the last.
        let at_an_end =
            |column: &usize| *column < self.phases.len() || column + self.phases.len() >= self.columns;
        let times = (0..self.columns).filter(at_an_end).flat_map(|column| {
            self.phase(column).iter().filter(|f| f.fires).map(move |f| self.column_times_s[column] + f.time_s)
        });
        let (first, last) =
            times.fold((f64::INFINITY, f64::NEG_INFINITY), |(first, last), t| (first.min(t), last.max(t)));
        if first > last { (0.0, 0.0) } else { (first, last) }
    }

    /// The number of pixels whose beam does not fire in their column.
    pub fn silent_pixels(&self) -> usize {
        let silent = |phase: &Vec<Firing>| phase.iter().filter(|firing| !firing.fires).count();
        let columns_in = |phase: usize| (self.columns + self.phases.len() - 1 - phase) / self.phases.len();
        self.phases.iter().enumerate().map(|(phase, firings)| silent(firings) * columns_in(phase)).sum()
    }

    /// The firings of a column, by row.
    #[inline]
    fn phase(&self, firing: usize) -> &[Firing] {
        match &self.phases[..] {
            [only] => only,
            phases => &phases[firing % phases.len()],
        }
    }

    fn column_time_s(&self, firing: usize) -> f64 {
        (self.azimuth_step().radians() * firing as f64).abs() / std::f64::consts::TAU / self.rate_hz
    }

    /// The angle by which the head turns between a column's own time and the firing of a pixel's beam.
    pub fn turn_before(&self, row: usize, column: usize) -> Angle {
        self.phase(self.firing(row, column))[row].turn
    }

    /// The firing that fills a pixel of the image.
    #[inline]
    pub fn firing(&self, row: usize, column: usize) -> usize {
        match self.shifts.get(row) {
            Some(&shift) => moved(column, shift, self.columns),
            None => column,
        }
    }

    /// The pulses of a row of the image.
    #[inline(always)]
    pub(super) fn row(&self, row: usize) -> RotatingRow<'_> {
        let only = match &self.phases[..] {
            [only] => Some(&only[row]),
            _ => None,
        };
        let shift = self.shifts.get(row).copied().unwrap_or(0);
        RotatingRow {
            pattern: self,
            row,
            shift,
            only,
            sin_cos: &self.column_sin_cos,
            times_s: &self.column_times_s,
            is_from_origin: self.origins.is_empty(),
            ranging: self.ranging,
        }
    }

    /// The pulse of beam `row` (highest first) in column `column` of the image. The column is the firing unless the image
    /// is destaggered. `None` if the beam does not fire in that column.
    #[inline]
    pub(super) fn pulse(&self, row: usize, column: usize) -> Option<Pulse> {
        self.row(row).pulse(column)
    }
}

/// The firing that fills a column of a row that is moved to the right, of so many columns.
#[inline(always)]
fn moved(column: usize, shift: usize, columns: usize) -> usize {
    if column >= shift { column - shift } else { column + columns - shift }
}

/// The pulses of a beam: a row of the image.
#[derive(Clone, Copy, Debug)]
pub(super) struct RotatingRow<'r> {
    pattern: &'r Rotating,
    row: usize,
    /// The number of columns by which the row is moved to the right.
    shift: usize,
    /// The firing in every column, if there is one phase.
    only: Option<&'r Firing>,
    sin_cos: &'r [(f64, f64)],
    times_s: &'r [f64],
    /// Whether the beam leaves from the sensor's origin.
    is_from_origin: bool,
    ranging: Ranging,
}

impl RotatingRow<'_> {
    /// The pulse of a column. `None` if the beam does not fire in it.
    ///
    /// The direction is (cos ε · cos α, cos ε · sin α, sin ε) with elevation ε and azimuth α. The time is the part of the
    /// turn since the sector's start, over the rate, plus the beam's own time. The sine and the cosine of α come from those
    /// of the column's azimuth and of the beam's offset by the angle sum identities. The result is accurate to a few 10⁻¹⁶.
    #[inline(always)]
    pub fn pulse(&self, column: usize) -> Option<Pulse> {
        let (column, firing) = self.firing(column)?;
        let ((sin_el, cos_el), (sin_offset, cos_offset)) = (firing.elevation, firing.azimuth);
        let (sin_turn, cos_turn) = self.sin_cos[column];
        let sin_az = sin_turn * cos_offset + cos_turn * sin_offset;
        let cos_az = cos_turn * cos_offset - sin_turn * sin_offset;
        let direction = DVec3::new(cos_el * cos_az, cos_el * sin_az, sin_el);
        let origin = if self.is_from_origin {
            DVec3::ZERO
        } else {
            rotated_about_z(firing.origin, (sin_turn, cos_turn))
        };
        let time_s = self.times_s[column] + firing.time_s;
        Some(Pulse { origin, direction, time_s, ranging: self.ranging })
    }

    /// The time of the pulse of a column, in seconds from the frame's start. `None` if the beam does not fire in it.
    #[inline(always)]
    pub fn time_s(&self, column: usize) -> Option<f64> {
        let (column, firing) = self.firing(column)?;
        Some(self.times_s[column] + firing.time_s)
    }

    /// The number of the firing that fills a column of the image, and the beam's part in it, if the beam fires.
    #[inline(always)]
    fn firing(&self, column: usize) -> Option<(usize, &Firing)> {
        let column = moved(column, self.shift, self.times_s.len());
        let firing = match self.only {
            Some(only) => only,
            None => &self.pattern.phase(column)[self.row],
        };
        firing.fires.then_some((column, firing))
    }
}

/// Rotates a point about z by the angle with this sine and cosine.
fn rotated_about_z(p: DVec3, (sin, cos): (f64, f64)) -> DVec3 {
    DVec3::new(p.x * cos - p.y * sin, p.x * sin + p.y * cos, p.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn beam(elevation: f64) -> Beam {
        Beam {
            elevation: Angle::deg(elevation),
            azimuth_offset: Angle::default(),
            time_s: 0.0,
            file_index: 0,
        }
    }

    fn full_turn() -> (Angle, Angle) {
        (Angle::deg(180.0), Angle::deg(-180.0))
    }

    #[test]
    fn rows_go_from_the_top_and_remember_the_file() {
        let p = Rotating::new(vec![beam(-5.0), beam(15.0), beam(1.0)], 4, full_turn(), 10.0).unwrap();
        let files: Vec<_> = p.beams().iter().map(|b| b.file_index).collect();
        assert_eq!(files, [1, 2, 0]);
        assert!(p.pulse(0, 0).unwrap().direction.z > p.pulse(2, 0).unwrap().direction.z);
    }

    #[test]
    fn a_full_turn_starts_behind_turns_clockwise_and_looks_forward_in_the_middle() {
        let p = Rotating::new(vec![beam(0.0)], 4, full_turn(), 10.0).unwrap();
        let near = |c: usize, d: DVec3| {
            assert!(p.pulse(0, c).unwrap().direction.abs_diff_eq(d, 1e-15), "column {c}")
        };
        near(0, DVec3::NEG_X);
        near(1, DVec3::Y); // 90° is to the left, because the head comes clockwise from behind
        near(2, DVec3::X);
        near(3, DVec3::NEG_Y);
        assert!((p.pulse(0, 3).unwrap().time_s - 0.075).abs() < 1e-15);
    }

    #[test]
    fn a_sector_ends_on_its_last_column() {
        let sector = (Angle::deg(-30.0), Angle::deg(30.0));
        let p = Rotating::new(vec![beam(0.0)], 7, sector, 5.0).unwrap();
        assert!((p.azimuth(6).degrees() - 30.0).abs() < 1e-12);
        assert!((p.azimuth_step().degrees() - 10.0).abs() < 1e-12);
        // The column lies a sixth of a turn after the start, at 5 Hz.
        assert!((p.pulse(0, 6).unwrap().time_s - 1.0 / 30.0).abs() < 1e-15);
        assert_eq!(Rotating::new(vec![beam(0.0)], 1, sector, 5.0).unwrap().azimuth(0), sector.0);
    }

    #[test]
    fn offsets_and_beam_times_are_added() {
        let mut b = beam(10.0);
        b.azimuth_offset = Angle::deg(3.0);
        b.time_s = 2e-6;
        let p = Rotating::new(vec![b], 360, full_turn(), 10.0).unwrap();
        let pulse = p.pulse(0, 100).unwrap();
        let (sin, cos) = (libm::sin(83.0_f64.to_radians()), libm::cos(83.0_f64.to_radians()));
        let c = libm::cos(10.0_f64.to_radians());
        assert!(
            pulse
                .direction
                .abs_diff_eq(DVec3::new(c * cos, c * sin, libm::sin(10.0_f64.to_radians())), 1e-14)
        );
        assert!((pulse.time_s - (100.0 / 3600.0 + 2e-6)).abs() < 1e-15);
        assert!((pulse.direction.length() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn impossible_parameters_are_refused() {
        let new = |b, c, s, r| Rotating::new(b, c, s, r).unwrap_err();
        assert_eq!(new(vec![], 1, full_turn(), 1.0), RotatingError::NoBeams);
        assert_eq!(new(vec![beam(0.0)], 0, full_turn(), 1.0), RotatingError::NoColumns);
        let over = (Angle::deg(0.0), Angle::deg(361.0));
        assert_eq!(new(vec![beam(0.0)], 1, over, 1.0), RotatingError::Sector);
        assert_eq!(new(vec![beam(0.0)], 1, (over.0, over.0), 1.0), RotatingError::Sector);
        assert_eq!(new(vec![beam(0.0)], 1, full_turn(), f64::NAN), RotatingError::Rate);
        assert_eq!(new(vec![beam(0.0), beam(91.0)], 1, full_turn(), 1.0), RotatingError::Beam(1));
    }

    /// A beam that fires before its column's time looks where the head was then.
    #[test]
    fn negative_times_turn_the_head_back() {
        let mut early = beam(0.0);
        early.time_s = -40e-6;
        let origin = DVec3::new(0.03, 0.01, 0.02);
        let p = Rotating::new(vec![early], 360, full_turn(), 10.0).unwrap().turning_while_firing();
        let p = p.with_origins(&[origin]).unwrap();
        let pulse = p.pulse(0, 0).unwrap();
        // The head turns clockwise by 0.144° in 40 µs.
        let azimuth = (180.0 + 0.144_f64).to_radians();
        let expected = DVec3::new(libm::cos(azimuth), libm::sin(azimuth), 0.0);
        assert!(pulse.direction.abs_diff_eq(expected, 1e-15));
        assert!(pulse.origin.abs_diff_eq(rotated_about_z(origin, (expected.y, expected.x)), 1e-15));
        assert_eq!(pulse.time_s, -40e-6);
        let (first, last) = p.pulse_times_s();
        assert_eq!(first, -40e-6);
        assert!((last - (0.1 * 359.0 / 360.0 - 40e-6)).abs() < 1e-15);
    }

    #[test]
    fn columns_of_a_cycle_differ_in_beams_and_times() {
        let phases = [
            Phase { times_s: Some(vec![3e-6, 1e-6]), silent: vec![] },
            Phase { times_s: None, silent: vec![0] },
            Phase::default(),
        ];
        let p = Rotating::new(vec![beam(-5.0), beam(5.0)], 7, full_turn(), 10.0).unwrap();
        let p = p.turning_while_firing().with_cycle(&phases).unwrap();
        // The beam of index 0 is the lower one, row 1. It is silent in columns 1 and 4.
        let fires: Vec<bool> = (0..7).map(|column| p.pulse(1, column).is_some()).collect();
        assert_eq!(fires, [true, false, true, true, false, true, true]);
        assert!((0..7).all(|column| p.pulse(0, column).is_some()));
        assert_eq!(p.silent_pixels(), 2);
        let after = |row, column| p.pulse(row, column).unwrap().time_s - column as f64 / 70.0;
        assert!((after(1, 0) - 3e-6).abs() < 1e-15 && (after(0, 3) - 1e-6).abs() < 1e-15);
        assert!(after(1, 2).abs() < 1e-15);
        // The head has turned by 3 µs of a turn in 100 ms, clockwise.
        let turned =
            p.pulse(1, 0).unwrap().direction.angle_between(p.pulse(1, 0).unwrap().direction.with_y(0.0));
        assert!(
            (turned - libm::asin(libm::sin(std::f64::consts::TAU * 3e-5) * libm::cos(5_f64.to_radians())))
                .abs()
                < 1e-12
        );
        assert_eq!(p.turn_before(1, 3).radians(), -std::f64::consts::TAU * 3e-5);
        assert_eq!(p.turn_before(1, 2).radians(), 0.0);

        let new = || Rotating::new(vec![beam(0.0)], 4, full_turn(), 1.0).unwrap();
        let with = |times_s, silent| new().with_cycle(&[Phase { times_s, silent }]).unwrap_err();
        assert_eq!(new().with_cycle(&[]).unwrap_err(), RotatingError::Cycle);
        assert_eq!(with(None, vec![1]), RotatingError::Cycle);
        assert_eq!(with(Some(vec![]), vec![]), RotatingError::Count);
        assert_eq!(with(Some(vec![f64::NAN]), vec![]), RotatingError::Beam(0));
    }
}
