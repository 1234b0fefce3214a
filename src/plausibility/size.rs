//! Scenes that are probably of another unit than metres, or that lie on their side.

use crate::scene::Extent;
use crate::source::Doubt;

/// Scenes this far across are of millimetres rather than metres: single precision is 1 mm there.
const TOO_WIDE_M: f64 = 10_000.0;

/// Scenes that are both so far across and so high are of centimetres or millimetres rather than mountains.
const WIDE_AND_HIGH_M: (f64, f64) = (1000.0, 300.0);

/// Scenes this far across are smaller than what sensors of ranges look at.
const TOO_SMALL_M: f64 = 0.4;

/// How many times flatter along y than along x and z a scene is that lies on its side.
const FLATTER: f64 = 2.5;

pub(super) fn doubts(extent: Extent) -> Vec<Doubt> {
    let [x, y, z] = extent.map(|[low, high]| high - low);
    let mut found = Vec::new();
    let across = x.max(y).max(z);
    if !across.is_finite() {
        return found;
    }
    let is_high = across >= WIDE_AND_HIGH_M.0 && x.min(y).min(z) >= WIDE_AND_HIGH_M.1;
    if across >= TOO_WIDE_M || is_high {
        let (unit, factor) =
            if across >= TOO_WIDE_M { ("millimetres", 1000.0) } else { ("centimetres", 100.0) };
        let help = format!(
            "glTF's unit is the metre: in {unit} it would be {} m across; scale it where it is exported",
            tidy(across / factor)
        );
        found.push(
            Doubt::new("scene-unit", "scene", format!("the scene is {} m across", tidy(across)))
                .label(format!("is it in {unit}?"))
                .help(help),
        );
    } else if across < TOO_SMALL_M {
        found.push(
            Doubt::new("scene-unit", "scene", format!("the scene is {} m across", tidy(across)))
                .label("was it scaled twice?")
                .help(format!(
                    "glTF's unit is the metre: times 100 it would be {} m across",
                    tidy(across * 100.0)
                )),
        );
    }
    let is_flat = y * FLATTER < x.min(z) && x.min(z) > 2.0;
    if is_flat {
        let message = format!(
            "the scene lies on its side: it is flat along y, {} m by {} m by {} m",
            tidy(x),
            tidy(y),
            tidy(z)
        );
        found.push(
            Doubt::new("scene-up", "scene", message)
                .label("an export with z up?")
                .help("glTF's y axis points up; `up = \"y\"` keeps the file's axes, for files whose z axis does, or leave it out"),
        );
    }
    found
}

/// A length as messages write it: three digits are enough.
fn tidy(metres: f64) -> f64 {
    let scale = if metres >= 100.0 { 1.0 } else { 100.0 };
    (metres * scale).round() / scale
}

#[cfg(test)]
mod tests {
    use super::*;

    fn codes(x: f64, y: f64, z: f64) -> Vec<&'static str> {
        doubts([[0.0, x], [-y, 0.0], [5.0, 5.0 + z]]).into_iter().map(|doubt| doubt.code).collect()
    }

    #[test]
    fn units_and_axes() {
        assert_eq!(codes(20_100.0, 18_000.0, 5000.0), ["scene-unit"]);
        assert_eq!(codes(2010.0, 1800.0, 500.0), ["scene-unit"]);
        assert_eq!(codes(0.2, 0.2, 0.05), ["scene-unit"]);
        assert_eq!(codes(20.0, 4.0, 18.0), ["scene-up"]);
        // A room, a street, a town on a plain, a floor, a wall that a sensor looks at, a table.
        for (x, y, z) in [
            (6.0, 5.0, 3.0),
            (120.0, 40.0, 12.0),
            (5000.0, 4000.0, 90.0),
            (50.0, 50.0, 0.0),
            (0.0, 8.0, 8.0),
            (1.2, 0.8, 0.7),
        ] {
            assert!(codes(x, y, z).is_empty(), "{x} {y} {z}");
        }
        assert!(doubts([[f64::INFINITY, f64::NEG_INFINITY]; 3]).is_empty());
    }
}
