//! The coordinate reference system of a cloud, for the formats of surveyors.

use super::format::EncodeError;
use super::options::{OptionSpec, OptionValues, Options};

/// The option that names the coordinate reference system.
pub(super) const CRS: OptionSpec = OptionSpec {
    name: "crs",
    about: "The coordinate reference system of the cloud's coordinates in WKT, such as `pyproj.CRS(25832).to_wkt()` prints it; \
            left out: none. The coordinates themselves stay as they are, so that `output.frame` is `\"world\"` where it makes sense.",
    values: OptionValues::Text { default: "" },
};

/// The most bytes of a WKT: those that the record of a LAS holds, with a 0 at the end.
const MOST_BYTES: usize = u16::MAX as usize - 1;

/// Checks that the option is WKT by its form: a keyword, and the rest in brackets.
pub(super) fn check_crs(options: &Options) -> Result<(), EncodeError> {
    let text = options.text(&CRS).trim();
    let is_wkt = || {
        let keyword = text.split('[').next().unwrap_or_default().trim_end();
        let is_word = !keyword.is_empty() && keyword.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
        // A name in quotes may have any brackets.
        let depth =
            |bracket| text.split('"').step_by(2).map(|part| part.matches(bracket).count()).sum::<usize>();
        is_word && text.ends_with(']') && depth('[') == depth(']') && !text.contains('\0')
    };
    if text.len() > MOST_BYTES {
        return Err(EncodeError::new(format!(
            "`crs` has {} bytes, and a file holds at most {MOST_BYTES}",
            text.len()
        )));
    }
    if text.is_empty() || is_wkt() {
        return Ok(());
    }
    let start: String = text.chars().take(40).collect();
    Err(EncodeError::new(format!(
        "`crs` is WKT, such as PROJCS[\"…\", …], and {start:?} is none: `pyproj.CRS(…).to_wkt()` in Python makes it of a code"
    )))
}

/// The WKT, or `None` if the job gives none.
pub(super) fn crs_of(options: &Options) -> Option<&'static str> {
    let text = options.text(&CRS).trim();
    (!text.is_empty()).then_some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(text: &str) -> Result<(), String> {
        static OPTIONS: [OptionSpec; 1] = [CRS];
        let mut options = Options::none(&OPTIONS);
        options.set(&CRS, super::super::options::OptionValue::text(text));
        check_crs(&options).map_err(|problem| problem.to_string())
    }

    #[test]
    fn only_wkt_is_a_coordinate_reference_system() {
        for right in ["", " LOCAL_CS[\"site\", UNIT[\"metre\", 1.0]]\n", "GEOGCRS [\"a [b\"]"] {
            assert_eq!(checked(right), Ok(()), "{right}");
        }
        for wrong in ["EPSG:25832", "25832", "PROJCS[\"a\"", "PROJCS[\"a\"]]", "[]", "+proj=utm +zone=32"] {
            let problem = checked(wrong).unwrap_err();
            assert!(problem.contains(&format!("{wrong:?}")) && problem.contains("to_wkt()"), "{problem}");
        }
        let long = format!("PROJCS[\"{}\"]", "a".repeat(65_535));
        assert!(checked(&long).unwrap_err().contains("at most 65534"));
    }
}
