//! The layouts of points in a `sensor_msgs/PointCloud2`, each as a driver or a program has it.

use std::fmt::Write as _;

/// The names of the layouts in a job. The last one is a message of its own type.
pub(super) const LAYOUTS: [&str; 8] =
    ["velodyne", "ouster", "hesai", "robosense", "livox", "autoware", "fast_lio", "livox_custom"];

/// The type of a field, with its number in a `sensor_msgs/PointField`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Type {
    U8 = 2,
    U16 = 4,
    U32 = 6,
    F32 = 7,
    F64 = 8,
}

impl Type {
    fn name(self) -> &'static str {
        match self {
            Self::U8 => "uint8",
            Self::U16 => "uint16",
            Self::U32 => "uint32",
            Self::F32 => "float32",
            Self::F64 => "float64",
        }
    }

    #[cfg(test)]
    fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The largest whole number, infinite for floats.
    pub fn most(self) -> f64 {
        match self {
            Self::U8 => u8::MAX.into(),
            Self::U16 => u16::MAX.into(),
            Self::U32 => u32::MAX.into(),
            Self::F32 | Self::F64 => f64::INFINITY,
        }
    }

    /// Writes a number, which whole numbers have rounded already.
    pub fn write(self, number: f64, to: &mut [u8]) {
        match self {
            Self::U8 => to[0] = number as u8,
            Self::U16 => to[..2].copy_from_slice(&(number as u16).to_le_bytes()),
            Self::U32 => to[..4].copy_from_slice(&(number as u32).to_le_bytes()),
            Self::F32 => to[..4].copy_from_slice(&(number as f32).to_le_bytes()),
            Self::F64 => to[..8].copy_from_slice(&number.to_le_bytes()),
        }
    }
}

/// What a field holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Value {
    /// A coordinate in metres: x, y or z.
    Coordinate(usize),
    /// The intensity, 0 to 255.
    Intensity,
    /// The number of the beam, as the sensor's maker counts.
    Ring,
    /// The time since the message's stamp, in parts of a second, so many of them.
    Since(f64),
    /// The time on the clock of the stamps, in seconds.
    Seconds,
    /// The time on the clock of the stamps, in nanoseconds.
    Nanoseconds,
    /// The range in whole millimetres.
    Millimetres,
    /// 0: the simulation has no such thing.
    Nothing,
    /// Livox's tag: the number of the return in bits 4 and 5.
    Tag,
    /// Autoware's number of the kind of return.
    ReturnType,
    /// The angle about z from x towards y, from the coordinates, in radians.
    Azimuth,
    /// The angle above the plane of x and y, from the coordinates, in radians.
    Elevation,
    /// The distance from the frame's origin, from the coordinates, in metres.
    Distance,
}

impl Value {
    fn about(self) -> &'static str {
        match self {
            Self::Coordinate(_) | Self::Distance => "m",
            Self::Intensity => "0 to 255",
            Self::Ring => "from 0, as the maker counts",
            Self::Since(1.0) => "s since the header's stamp",
            Self::Since(1e3) => "ms since the header's stamp",
            Self::Since(1e6) => "µs since the header's stamp",
            Self::Since(_) => "ns since the header's stamp",
            Self::Seconds => "s on the clock of the stamps",
            Self::Nanoseconds => "ns on the clock of the stamps",
            Self::Millimetres => "mm",
            Self::Nothing => "0",
            Self::Tag => "the number of the return, from 0 to 3, in bits 4 and 5",
            Self::ReturnType => {
                "1 is the only return of a sensor of one; of one of several, 7 is a single return, 3 and 4 the strongest if it is the \
                 first or a later one, 5 and 6 the others"
            }
            Self::Azimuth => "rad, atan2(y, x)",
            Self::Elevation => "rad, atan2(z, √(x² + y²))",
        }
    }
}

/// A field of a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct PointField {
    pub name: &'static str,
    /// Bytes from the point's first one.
    pub offset: usize,
    pub kind: Type,
    pub value: Value,
}

/// The fields of a point, and its size.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub fields: Vec<PointField>,
    /// Bytes of a point.
    pub step: usize,
}

const X: PointField = at(0, "x", Type::F32, Value::Coordinate(0));
const Y: PointField = at(4, "y", Type::F32, Value::Coordinate(1));
const Z: PointField = at(8, "z", Type::F32, Value::Coordinate(2));
const INTENSITY: PointField = at(12, "intensity", Type::F32, Value::Intensity);
const RING: PointField = at(16, "ring", Type::U16, Value::Ring);

const fn at(offset: usize, name: &'static str, kind: Type, value: Value) -> PointField {
    PointField { name, offset, kind, value }
}

impl Layout {
    /// The layout of a name. `None` of the message of its own type. `unit` is that of `fast_lio`.
    pub fn named(name: &str, unit: &str) -> Option<Self> {
        let (fields, step) = match name {
            "velodyne" => (vec![X, Y, Z, INTENSITY, RING, at(18, "time", Type::F32, Value::Since(1.0))], 22),
            "fast_lio" => {
                let time = match unit {
                    "s" => at(18, "time", Type::F32, Value::Since(1.0)),
                    "ms" => at(18, "time", Type::F32, Value::Since(1e3)),
                    "us" => at(18, "time", Type::F32, Value::Since(1e6)),
                    _ => at(18, "t", Type::U32, Value::Since(1e9)),
                };
                (vec![X, Y, Z, INTENSITY, RING, time], 22)
            }
            "hesai" | "robosense" => {
                (vec![X, Y, Z, INTENSITY, RING, at(18, "timestamp", Type::F64, Value::Seconds)], 26)
            }
            "livox" => {
                let of_livox = [
                    at(16, "tag", Type::U8, Value::Tag),
                    at(17, "line", Type::U8, Value::Ring),
                    at(18, "timestamp", Type::F64, Value::Nanoseconds),
                ];
                ([X, Y, Z, INTENSITY].into_iter().chain(of_livox).collect(), 26)
            }
            "ouster" => {
                let of_ouster = [
                    at(16, "intensity", Type::F32, Value::Intensity),
                    at(20, "t", Type::U32, Value::Since(1e9)),
                    at(24, "reflectivity", Type::U16, Value::Intensity),
                    at(26, "ring", Type::U16, Value::Ring),
                    at(28, "ambient", Type::U16, Value::Nothing),
                    at(32, "range", Type::U32, Value::Millimetres),
                ];
                ([X, Y, Z].into_iter().chain(of_ouster).collect(), 48)
            }
            "autoware" => {
                let of_autoware = [
                    at(12, "intensity", Type::U8, Value::Intensity),
                    at(13, "return_type", Type::U8, Value::ReturnType),
                    at(14, "channel", Type::U16, Value::Ring),
                    at(16, "azimuth", Type::F32, Value::Azimuth),
                    at(20, "elevation", Type::F32, Value::Elevation),
                    at(24, "distance", Type::F32, Value::Distance),
                    at(28, "time_stamp", Type::U32, Value::Since(1e9)),
                ];
                ([X, Y, Z].into_iter().chain(of_autoware).collect(), 32)
            }
            _ => return None,
        };
        Some(Self { fields, step })
    }

    /// The largest number of a beam that fits.
    pub fn most_ring(&self) -> f64 {
        let ring = self.fields.iter().find(|field| field.value == Value::Ring);
        ring.map_or(f64::INFINITY, |field| field.kind.most())
    }

    /// The longest time since the stamp that fits, in seconds.
    pub fn most_s(&self) -> f64 {
        let most_s = |field: &PointField| match field.value {
            Value::Since(parts) => field.kind.most() / parts,
            _ => f64::INFINITY,
        };
        self.fields.iter().map(most_s).fold(f64::INFINITY, f64::min)
    }
}

/// The layouts as tables of Markdown.
pub(super) fn tables() -> String {
    let mut text = String::new();
    for name in LAYOUTS {
        let Some(Layout { fields, step }) = Layout::named(name, "us") else { continue };
        let _ = write!(
            text,
            "\n`{name}`, {step} bytes a point:\n\n| field | at | type | unit or meaning |\n|---|---|---|---|\n"
        );
        for PointField { name, offset, kind, value } in fields {
            let _ = writeln!(text, "| {name} | {offset} | `{}` | {} |", kind.name(), value.about());
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_lie_behind_each_other_within_a_point() {
        for name in LAYOUTS {
            for unit in ["s", "ms", "us", "ns"] {
                let Some(Layout { fields, step }) = Layout::named(name, unit) else {
                    assert_eq!(name, "livox_custom");
                    continue;
                };
                let mut end = 0;
                for field in fields {
                    assert!(field.offset >= end, "{name} {}", field.name);
                    end = field.offset + field.kind.bytes();
                }
                assert!(end <= step, "{name}");
            }
        }
    }
}
