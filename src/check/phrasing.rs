//! The wording of differences for sensor engineers: how many, how much, where, and on which objects.

use super::baseline::SensorRecord;

/// The rows and columns of the pixels that differ, as far as they are known.
#[derive(Clone, Debug, Default)]
pub struct Region {
    /// The rows with a difference, in order.
    pub rows: Vec<usize>,
    /// The columns with a difference, in order. It is empty if they are not known.
    pub columns: Vec<usize>,
}

impl Region {
    /// The region of pixels that are given by number.
    pub fn of(pixels: &[u32], columns: usize) -> Self {
        let sorted = |numbers: Vec<usize>| {
            let mut numbers = numbers;
            numbers.sort_unstable();
            numbers.dedup();
            numbers
        };
        Self {
            rows: sorted(pixels.iter().map(|&p| p as usize / columns).collect()),
            columns: sorted(pixels.iter().map(|&p| p as usize % columns).collect()),
        }
    }

    /// The region in words, for an image of so many rows and columns: `all in row 17`, `all in rows 3 to 9, columns 100 to
    /// 140`. It is empty if the region covers nearly all of the image.
    pub fn words(&self, (rows, columns): (usize, usize)) -> String {
        let rows = run("row", &self.rows, rows);
        let columns = run("column", &self.columns, columns);
        match (rows, columns) {
            (Some(rows), Some(columns)) => format!("all in {rows}, {columns}"),
            (Some(one), None) | (None, Some(one)) => format!("all in {one}"),
            (None, None) => String::new(),
        }
    }
}

/// A run of numbers in words: `row 17`, `rows 3 and 5`, `rows 3 to 9`. `None` if they cover nearly all.
fn run(noun: &str, numbers: &[usize], all: usize) -> Option<String> {
    let (first, last) = (*numbers.first()?, *numbers.last()?);
    match numbers {
        _ if all == 1 => None,
        [only] => Some(format!("{noun} {only}")),
        [a, b] => Some(format!("{noun}s {a} and {b}")),
        // The bounding interval of the pixels is informative only if it is clearly smaller than the image.
        _ if (last - first + 1) * 4 <= all * 3 => Some(format!("{noun}s {first} to {last}")),
        _ => None,
    }
}

/// The objects that the pixels show, if they are few: `all on "crate_3"`, `93 % on "crate_3"`. A pixel counts for the
/// object that it shows in either image.
pub fn objects<'a>(pixels: &[u32], images: [(&'a SensorRecord, Option<&'a [u32]>); 2]) -> String {
    const ENOUGH: f64 = 0.8;
    let mut counts: std::collections::BTreeMap<&str, usize> = std::collections::BTreeMap::new();
    for &pixel in pixels {
        let name = |(record, ids): (&'a SensorRecord, Option<&'a [u32]>)| {
            let id = ids?.get(pixel as usize)?;
            record.instances.get(id).map(String::as_str)
        };
        let [first, second] = images.map(name);
        for name in first.into_iter().chain(second.filter(|_| second != first)) {
            *counts.entry(name).or_default() += 1;
        }
    }
    let Some((name, count)) = counts.into_iter().filter(|(name, _)| !name.is_empty()).max_by_key(|(_, n)| *n)
    else {
        return String::new();
    };
    let share = count as f64 / pixels.len() as f64;
    match share {
        s if s >= 1.0 => format!("all on {name:?}"),
        s if s >= ENOUGH => format!("{:.0} % on {name:?}", (100.0 * s).floor()),
        _ => String::new(),
    }
}

/// A length in metres with its significant digits: `1.2 m`, `3.4 mm`.
pub fn metres(value: f64) -> String {
    match value.abs() {
        0.0 => "0 m".to_owned(),
        v if !v.is_finite() => format!("{value} m"),
        v if v < 0.1 => format!("{} mm", digits(value * 1e3)),
        _ => format!("{} m", digits(value)),
    }
}

/// A number rounded to three digits.
pub fn digits(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let before = libm::log10(value.abs()).floor() as i32 + 1;
    match before {
        -3..=2 => {
            let text = format!("{value:.*}", (3 - before).max(0) as usize);
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        }
        3..=15 => format!("{value:.0}"),
        _ => format!("{value:.2e}"),
    }
}

/// A share of 0 to 1 in percent: `12.5 %`.
pub fn percent(share: f64) -> String {
    format!("{} %", digits(100.0 * share))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let shown = [1.2345, 0.00123, 12.0, 0.5, 123.4, 99999.0, 0.0, 1e-9].map(digits);
        assert_eq!(shown, ["1.23", "0.00123", "12", "0.5", "123", "99999", "0", "1.00e-9"]);
        assert_eq!([1.2, 0.0034, 0.0].map(metres), ["1.2 m", "3.4 mm", "0 m"]);
    }

    #[test]
    fn regions_are_told_if_they_are_small() {
        let words = |pixels: &[(u32, u32)]| {
            let numbers: Vec<u32> = pixels.iter().map(|(row, column)| row * 2048 + column).collect();
            Region::of(&numbers, 2048).words((128, 2048))
        };
        assert_eq!(words(&[(17, 3), (17, 2000), (17, 9)]), "all in row 17");
        assert_eq!(words(&[(17, 3), (18, 3)]), "all in rows 17 and 18, column 3");
        assert_eq!(words(&[(1, 30), (5, 31), (9, 40)]), "all in rows 1 to 9, columns 30 to 40");
        assert_eq!(words(&[(0, 0), (60, 1000), (127, 2047)]), "");
    }

    #[test]
    fn objects_are_named_if_they_are_few() {
        let record = SensorRecord {
            instances: [(1, "floor".to_owned()), (5, "crate".to_owned())].into(),
            ..SensorRecord::default()
        };
        let ids = [1, 5, 5, 5, 5, 5];
        let of = |pixels: &[u32]| objects(pixels, [(&record, Some(&ids)), (&record, Some(&ids))]);
        assert_eq!(of(&[1, 2, 3]), "all on \"crate\"");
        assert_eq!(of(&[0, 1, 2, 3, 4, 5]), "83 % on \"crate\"");
        assert_eq!(of(&[0, 1]), "");
    }
}
