//! Names of recorded frames.

use std::fmt;

/// The name of a frame: its sensor, or the path of its file, and its number.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct FrameKey {
    sensor: String,
    frame: Option<u64>,
}

impl FrameKey {
    /// The frame of a sensor.
    pub fn new(sensor: &str, frame: u64) -> Self {
        Self { sensor: sensor.to_owned(), frame: Some(frame) }
    }

    /// The frame that a file shows, by its path without its ending.
    pub fn of_stem(stem: &str) -> Self {
        let number =
            |digits: &str| digits.bytes().all(|b| b.is_ascii_digit()).then(|| digits.parse().ok())?;
        match stem.rsplit_once('/').and_then(|(sensor, digits)| Some((sensor, number(digits)?))) {
            Some((sensor, frame)) => Self { sensor: sensor.to_owned(), frame: Some(frame) },
            None => Self { sensor: stem.to_owned(), frame: None },
        }
    }

    /// The frame that a file of a scan shows, and the ending of the file: of `top/000012.depth16.png` it is `depth16.png`. `None` of a
    /// file without an ending.
    pub fn of_file(path: &str) -> Option<(Self, &str)> {
        let name = path.rfind('/').map_or(0, |slash| slash + 1);
        let dot = name + path[name..].find('.')?;
        Some((Self::of_stem(&path[..dot]), &path[dot + 1..]))
    }

    /// The frame's sensor, or the path of its file.
    pub fn sensor(&self) -> &str {
        &self.sensor
    }

    /// The frame's number, if its file has one.
    pub fn frame(&self) -> Option<u64> {
        self.frame
    }
}

impl fmt::Display for FrameKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.frame {
            Some(frame) => write!(f, "{}/{frame:06}", self.sensor),
            None => f.write_str(&self.sensor),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ending_is_all_after_the_first_dot_of_the_name() {
        let of = |path| FrameKey::of_file(path).map(|(key, ending)| (key.to_string(), ending));
        assert_eq!(of("a.b/000012.exr"), Some(("a.b/000012".into(), "exr")));
        assert_eq!(of("top/000012.deep.exr"), Some(("top/000012".into(), "deep.exr")));
        assert_eq!(of("poses.csv"), Some(("poses".into(), "csv")));
        assert_eq!(of("a.b/000012"), None);
    }

    #[test]
    fn frames_are_known_by_sensor_and_number() {
        let key = |stem: &str| FrameKey::of_stem(stem);
        assert_eq!((key("top/000012").sensor(), key("top/000012").frame()), ("top", Some(12)));
        assert_eq!(key("top/000012").to_string(), "top/000012");
        // A sequence of very many frames has longer numbers, and the same frames.
        assert_eq!(key("top/00000012"), key("top/000012"));
        for other in ["top/notes", "000012", "", "top/", "top/99999999999999999999999"] {
            assert_eq!((key(other).frame(), key(other).to_string()), (None, other.to_owned()));
        }
    }
}
