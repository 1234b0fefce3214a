//! Sensor files as text, with comments that say where the values come from. Numbers are read back as the same bits.

use std::fmt::Write as _;

use crate::config::{comment, toml_string};

/// A sensor file that is being written.
#[derive(Debug, Default)]
pub(super) struct Toml(String);

impl Toml {
    /// Comments, wrapped. An empty line separates paragraphs.
    pub fn comment(&mut self, text: &str) {
        self.0.push_str(&comment(text));
    }

    /// A line as it is, such as `#:schema …`.
    pub fn line(&mut self, text: &str) {
        self.0.push_str(text);
        self.0.push('\n');
    }

    /// An empty line, then the header of a table.
    pub fn table(&mut self, name: &str) {
        let _ = writeln!(self.0, "\n[{name}]");
    }

    pub fn integer(&mut self, key: &str, value: u32) {
        let _ = writeln!(self.0, "{key} = {value}");
    }

    pub fn flag(&mut self, key: &str, value: bool) {
        let _ = writeln!(self.0, "{key} = {value}");
    }

    pub fn number(&mut self, key: &str, value: f64) {
        let _ = writeln!(self.0, "{key} = {}", number(value));
    }

    pub fn sector(&mut self, key: &str, from: f64, to: f64) {
        let _ = writeln!(self.0, "{key} = {{ from = {}, to = {} }}", number(from), number(to));
    }

    pub fn text(&mut self, key: &str, value: &str) {
        let _ = writeln!(self.0, "{key} = {}", toml_string(value));
    }

    /// A list, eight numbers a line.
    pub fn numbers(&mut self, key: &str, values: &[f64]) {
        self.list(key, values, |value| number(*value));
    }

    /// A list of whole numbers, eight a line.
    pub fn integers(&mut self, key: &str, values: &[i32]) {
        self.list(key, values, i32::to_string);
    }

    fn list<T>(&mut self, key: &str, values: &[T], written: impl Fn(&T) -> String) {
        let _ = writeln!(self.0, "{key} = [");
        for line in values.chunks(8) {
            let line: Vec<String> = line.iter().map(&written).collect();
            let _ = writeln!(self.0, "    {},", line.join(", "));
        }
        self.0.push_str("]\n");
    }

    /// A list of positions, or one position if they are all the same.
    pub fn vectors(&mut self, key: &str, values: &[[f64; 3]]) {
        let vector = |[x, y, z]: &[f64; 3]| format!("[{}, {}, {}]", number(*x), number(*y), number(*z));
        match values {
            [first, rest @ ..] if rest.iter().all(|value| value == first) => {
                let _ = writeln!(self.0, "{key} = {}", vector(first));
            }
            _ => {
                let _ = writeln!(self.0, "{key} = [");
                for value in values {
                    let _ = writeln!(self.0, "    {},", vector(value));
                }
                self.0.push_str("]\n");
            }
        }
    }

    pub fn into_text(self) -> String {
        self.0
    }
}

/// A float of TOML: it has a point, and the fewest digits that are read back as the same number.
fn number(value: f64) -> String {
    // Debug writes the shortest digits, with a point or an exponent.
    if value == 0.0 { "0.0".to_owned() } else { format!("{value:?}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_wrap_and_carry_no_control_characters() {
        let mut toml = Toml::default();
        toml.comment(&format!("one\n\n{}", "word\u{1b}[2J ".repeat(30)));
        let text = toml.into_text();
        assert!(text.starts_with("# one\n#\n# word"), "{text}");
        assert!(text.lines().all(|line| line.starts_with('#') && line.chars().count() <= 110), "{text}");
        assert!(!text.contains('\u{1b}'));
    }

    #[test]
    fn values_are_toml() {
        let written: Vec<_> = [0.1 + 0.2, -0.0, 3.0, 1e-9, 1e300].map(number).into();
        assert_eq!(written, ["0.30000000000000004", "0.0", "3.0", "1e-9", "1e300"]);
    }
}
