//! The times at which the rows of an image are exposed.

/// A camera's shutter. Each row is exposed at one moment, which stands for the middle of its exposure; a global shutter exposes
/// all rows at the frame's start, and a rolling shutter exposes them one after the other.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shutter {
    row_time_s: f64,
    order: RowOrder,
}

/// The order in which a rolling shutter exposes the rows of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RowOrder {
    /// The top row is the first.
    #[default]
    TopDown,
    /// The bottom row is the first, as in a camera that is built in upside down and turns its image.
    BottomUp,
}

impl Shutter {
    /// All rows at once.
    pub const GLOBAL: Self = Self { row_time_s: 0.0, order: RowOrder::TopDown };

    /// A shutter that exposes a row `row_time_s` seconds after the row before it. With 0 it is global. `None` if the time is
    /// negative or not finite.
    pub fn rolling(row_time_s: f64, order: RowOrder) -> Option<Self> {
        (row_time_s >= 0.0 && row_time_s.is_finite()).then_some(Self { row_time_s, order })
    }

    /// The time from a row to the next, in seconds; 0 for a global shutter.
    pub fn row_time_s(&self) -> f64 {
        self.row_time_s
    }

    /// The order of the rows.
    pub fn order(&self) -> RowOrder {
        self.order
    }

    /// The time of a row of an image of so many, in seconds from the frame's start. Row 0 is the top.
    #[inline]
    pub fn time_s(&self, row: usize, rows: usize) -> f64 {
        let rows_before = match self.order {
            RowOrder::TopDown => row,
            RowOrder::BottomUp => rows - 1 - row,
        };
        rows_before as f64 * self.row_time_s
    }

    /// The time of the last row of an image of so many, in seconds from the frame's start.
    pub fn last_s(&self, rows: usize) -> f64 {
        (rows - 1) as f64 * self.row_time_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_follow_each_other_either_way() {
        let times = |shutter: Shutter| [0, 1, 2].map(|row| shutter.time_s(row, 3));
        let rolling = |order| Shutter::rolling(0.25, order).unwrap();
        assert_eq!(times(rolling(RowOrder::TopDown)), [0.0, 0.25, 0.5]);
        assert_eq!(times(rolling(RowOrder::BottomUp)), [0.5, 0.25, 0.0]);
        assert_eq!((times(Shutter::GLOBAL), Shutter::default()), ([0.0; 3], Shutter::GLOBAL));
        assert_eq!((rolling(RowOrder::BottomUp).last_s(3), Shutter::GLOBAL.last_s(3)), (0.5, 0.0));
        for wrong in [-1e-9, f64::NAN, f64::INFINITY] {
            assert_eq!(Shutter::rolling(wrong, RowOrder::TopDown), None);
        }
    }
}
