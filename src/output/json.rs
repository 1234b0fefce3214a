//! JSON for people and version control.

use serde_json::Value;

/// A value as text: a line for each key of an object, a line for each element of a list, and lists of numbers and texts on one
/// line. Elements that are small tables, such as the files of a manifest, take one line each too.
pub fn json_lines(value: &Value) -> String {
    let mut text = String::new();
    write(value, 0, &mut text);
    text.push('\n');
    text
}

/// The same for the value of a key that is indented by so many blanks, without a line feed at the end.
pub(super) fn json_indented(value: &Value, indent: usize) -> String {
    let mut text = String::new();
    write(value, indent, &mut text);
    text
}

fn is_leaf(value: &Value) -> bool {
    !value.is_object() && !value.is_array()
}

fn write(value: &Value, indent: usize, text: &mut String) {
    let new_line = |text: &mut String, indent: usize| {
        text.push('\n');
        text.extend(std::iter::repeat_n(' ', indent));
    };
    match value {
        Value::Object(keys) if !keys.is_empty() => {
            text.push('{');
            for (index, (key, value)) in keys.iter().enumerate() {
                text.push_str(if index > 0 { "," } else { "" });
                new_line(text, indent + 2);
                text.push_str(&Value::from(key.as_str()).to_string());
                text.push_str(": ");
                write(value, indent + 2, text);
            }
            new_line(text, indent);
            text.push('}');
        }
        Value::Array(values) if !values.iter().all(is_leaf) => {
            text.push('[');
            for (index, value) in values.iter().enumerate() {
                text.push_str(if index > 0 { "," } else { "" });
                new_line(text, indent + 2);
                match value {
                    Value::Object(keys) if keys.values().all(is_leaf) => write_row(keys, text),
                    value => write(value, indent + 2, text),
                }
            }
            new_line(text, indent);
            text.push(']');
        }
        Value::Array(values) => {
            let values: Vec<String> = values.iter().map(Value::to_string).collect();
            text.push_str(&format!("[{}]", values.join(", ")));
        }
        leaf => text.push_str(&leaf.to_string()),
    }
}

/// Writes a table of numbers and texts on one line.
pub(super) fn write_row(keys: &serde_json::Map<String, Value>, text: &mut String) {
    let pair = |(key, value): (&String, &Value)| format!("{}: {value}", Value::from(key.as_str()));
    let pairs: Vec<String> = keys.iter().map(pair).collect();
    text.push_str(&format!("{{ {} }}", pairs.join(", ")));
}

/// A value as JSON in one line of ASCII, for headers whose texts hold one byte a character. Other characters are escaped.
pub(super) fn json_ascii(value: &Value) -> String {
    let mut text = String::new();
    let mut units = [0; 2];
    for c in value.to_string().chars() {
        if c.is_ascii() {
            text.push(c);
        } else {
            c.encode_utf16(&mut units).iter().for_each(|unit| text.push_str(&format!("\\u{unit:04x}")));
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn small_tables_take_a_line_each() {
        let value = json!({
            "list": [1, 2.5, "a"],
            "rows": [{ "id": 1, "name": "x \"y\"" }, {}, { "deep": [1] }],
            "empty": {},
        });
        let text = json_lines(&value);
        assert_eq!(
            text,
            "{\n  \"list\": [1, 2.5, \"a\"],\n  \"rows\": [\n    { \"id\": 1, \"name\": \"x \\\"y\\\"\" },\n    {  },\n    \
             {\n      \"deep\": [1]\n    }\n  ],\n  \"empty\": {}\n}\n"
        );
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), value);
    }

    #[test]
    fn any_text_fits_a_header() {
        let value = json!({ "1": "Straße 𝄞 \n\u{7f}" });
        let text = json_ascii(&value);
        assert_eq!(text, "{\"1\":\"Stra\\u00dfe \\ud834\\udd1e \\n\u{7f}\"}");
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), value);
    }
}
