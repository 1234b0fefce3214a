//! Grids of azimuths and elevations: mirrors that scan line by line, flash LiDARs, and spherical images.

use glam::DVec3;

use super::{Pulse, Shutter};
use crate::angle::Angle;

/// A grid with an elevation for each row and an azimuth for each column.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    /// Sine and cosine of each column's azimuth.
    azimuths: Vec<(f64, f64)>,
    /// Sine and cosine of each row's elevation.
    elevations: Vec<(f64, f64)>,
    order: Order,
    pulse_rate_hz: f64,
    /// The shutter of a grid whose rows are seen as a whole.
    shutter: Shutter,
    rate_hz: Option<f64>,
}

/// The order in which the pulses of a grid go out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// All pulses go out at once, as in a flash LiDAR.
    Flash,
    /// The rows follow each other, and each begins at the first column.
    Lines,
    /// The rows follow each other. Every second row begins at the last column.
    BackAndForth,
}

/// The reason why a grid is impossible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RasterError {
    /// There are no rows or no columns.
    #[error("a grid needs at least one azimuth and one elevation")]
    Empty,
    /// An angle is not finite, or an elevation is beyond straight up or down.
    #[error("azimuths must be finite, and elevations must lie within ±90 degrees")]
    Angle,
    /// A rate is not a positive number.
    #[error("rates must be positive")]
    Rate,
}

impl Raster {
    /// A grid of `azimuths` (columns, left first) and `elevations` (rows, top first). Pulses follow each other at
    /// `pulse_rate_hz`, which a flash does not use.
    ///
    /// # Errors
    /// A [`RasterError`] that names the first wrong argument.
    pub fn new(
        azimuths: &[Angle],
        elevations: &[Angle],
        order: Order,
        pulse_rate_hz: f64,
        rate_hz: Option<f64>,
    ) -> Result<Self, RasterError> {
        if azimuths.is_empty() || elevations.is_empty() {
            return Err(RasterError::Empty);
        }
        let limit = std::f64::consts::FRAC_PI_2 * (1.0 + 1e-15);
        let steep = |e: &Angle| e.radians().is_nan() || e.radians().abs() > limit;
        if azimuths.iter().any(|a| !a.radians().is_finite()) || elevations.iter().any(steep) {
            return Err(RasterError::Angle);
        }
        let is_rate = |rate: f64| rate > 0.0 && rate.is_finite();
        if (order != Order::Flash && !is_rate(pulse_rate_hz)) || rate_hz.is_some_and(|r| !is_rate(r)) {
            return Err(RasterError::Rate);
        }
        let sin_cos = |angles: &[Angle]| angles.iter().map(|a| a.sin_cos()).collect();
        Ok(Self {
            azimuths: sin_cos(azimuths),
            elevations: sin_cos(elevations),
            order,
            pulse_rate_hz,
            shutter: Shutter::GLOBAL,
            rate_hz,
        })
    }

    /// An equirectangular image of (columns, rows) pixels that spans `hfov` by `vfov` about straight ahead. All pixels span
    /// the same angles, and the centre of the pixel in column u has the azimuth hfov/2 − (u + ½)·hfov/columns.
    ///
    /// # Errors
    /// A [`RasterError`] that names the first wrong argument.
    pub fn equirectangular(
        (columns, rows): (usize, usize),
        (hfov, vfov): (Angle, Angle),
        rate_hz: Option<f64>,
    ) -> Result<Self, RasterError> {
        let centres = |count: usize, span: Angle| -> Vec<Angle> {
            let pixel = span.radians() / count as f64;
            (0..count).map(|i| Angle::rad(span.radians() / 2.0 - (i as f64 + 0.5) * pixel)).collect()
        };
        Self::new(&centres(columns, hfov), &centres(rows, vfov), Order::Flash, f64::INFINITY, rate_hz)
    }

    /// The same grid behind a shutter, which says when its rows are seen if its order is [`Order::Flash`].
    #[must_use]
    pub fn with_shutter(self, shutter: Shutter) -> Self {
        Self { shutter, ..self }
    }

    /// The number of rows, which is that of the elevations.
    pub fn rows(&self) -> usize {
        self.elevations.len()
    }

    /// The number of columns, which is that of the azimuths.
    pub fn columns(&self) -> usize {
        self.azimuths.len()
    }

    /// Frames a second, if given.
    pub fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    /// The time of the last pulse, in seconds from the first pulse.
    pub fn last_pulse_s(&self) -> f64 {
        match self.order {
            Order::Flash => self.shutter.last_s(self.rows()),
            _ => (self.rows() * self.columns() - 1) as f64 / self.pulse_rate_hz,
        }
    }

    /// The shutter, if the rows are seen as wholes.
    pub fn shutter(&self) -> Option<&Shutter> {
        (self.order == Order::Flash).then_some(&self.shutter)
    }

    /// The time of a pulse by its place in its row, counted in the order of firing.
    fn time_s(&self, row: usize, in_line: usize) -> f64 {
        match self.order {
            Order::Flash => self.shutter.time_s(row, self.rows()),
            _ => (row * self.columns() + in_line) as f64 / self.pulse_rate_hz,
        }
    }

    /// The pulse of a pixel.
    #[inline]
    pub(super) fn pulse(&self, row: usize, column: usize) -> Pulse {
        let columns = self.columns();
        let in_line =
            if self.order == Order::BackAndForth && row % 2 == 1 { columns - 1 - column } else { column };
        let ((sin_az, cos_az), (sin_el, cos_el)) = (self.azimuths[column], self.elevations[row]);
        let direction = DVec3::new(cos_el * cos_az, cos_el * sin_az, sin_el);
        Pulse::new(DVec3::ZERO, direction, self.time_s(row, in_line))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::{RowOrder, azimuth_elevation};

    fn grid(order: Order) -> Raster {
        let degrees = |list: &[f64]| list.iter().map(|&d| Angle::deg(d)).collect::<Vec<_>>();
        Raster::new(&degrees(&[10.0, 0.0, -10.0]), &degrees(&[5.0, -5.0]), order, 1e3, Some(10.0)).unwrap()
    }

    #[test]
    fn pulses_go_out_in_their_order() {
        let times = |order| -> Vec<f64> {
            let p = grid(order);
            (0..6).map(|i| (p.pulse(i / 3, i % 3).time_s * 1e3).round()).collect()
        };
        assert_eq!(times(Order::Flash), [0.0; 6]);
        assert_eq!(times(Order::Lines), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(times(Order::BackAndForth), [0.0, 1.0, 2.0, 5.0, 4.0, 3.0]);
        assert_eq!(grid(Order::Lines).last_pulse_s(), 5e-3);
        let (az, el) = azimuth_elevation(grid(Order::Lines).pulse(1, 0).direction);
        assert!((az.degrees() - 10.0).abs() < 1e-12 && (el.degrees() + 5.0).abs() < 1e-12);
    }

    #[test]
    fn a_sphere_has_pixels_of_equal_angle_and_none_twice() {
        let whole = (Angle::deg(360.0), Angle::deg(180.0));
        let sphere = Raster::equirectangular((8, 4), whole, None).unwrap();
        let at = |row, column| {
            let (az, el) = azimuth_elevation(sphere.pulse(row, column).direction);
            (az.degrees(), el.degrees())
        };
        let near = |(a, b): (f64, f64), (c, d): (f64, f64)| (a - c).abs() < 1e-12 && (b - d).abs() < 1e-12;
        assert!(near(at(0, 0), (157.5, 67.5)), "{:?}", at(0, 0));
        assert!(near(at(3, 7), (-157.5, -67.5)));
        assert!(near(at(1, 3), (22.5, 22.5)));
        assert_eq!((sphere.last_pulse_s(), sphere.pulse(3, 0).time_s), (0.0, 0.0));
        let rolling = sphere.with_shutter(Shutter::rolling(1e-3, RowOrder::BottomUp).unwrap());
        assert_eq!(
            (rolling.last_pulse_s(), rolling.pulse(3, 0).time_s, rolling.pulse(0, 7).time_s),
            (3e-3, 0.0, 3e-3)
        );
    }

    #[test]
    fn impossible_parameters_are_refused() {
        let zero = [Angle::default()];
        let new = |a: &[Angle], e: &[Angle], rate| Raster::new(a, e, Order::Lines, rate, None).unwrap_err();
        assert_eq!(new(&[], &zero, 1.0), RasterError::Empty);
        assert_eq!(new(&zero, &[Angle::deg(91.0)], 1.0), RasterError::Angle);
        assert_eq!(new(&zero, &zero, 0.0), RasterError::Rate);
    }
}
