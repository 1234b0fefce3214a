//! Literals of Python, as far as the headers of NumPy's files have them. Nothing is evaluated.

/// A literal.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    /// A text.
    Text(String),
    /// A whole number that is not negative.
    Number(usize),
    /// `True` or `False`.
    Bool(bool),
    /// `None`.
    None,
    /// A list, or a tuple.
    List(Vec<Self>),
    /// A dictionary, in its order.
    Dictionary(Vec<(Self, Self)>),
}

/// The deepest that lists are nested.
const DEEPEST: usize = 16;

impl Value {
    /// Reads one literal, with space around it.
    pub fn parse(text: &str) -> Option<Self> {
        let mut rest = text;
        let value = value(&mut rest, 0)?;
        rest.trim().is_empty().then_some(value)
    }

    /// The value of a key, if this is a dictionary that has it.
    pub fn get(&self, key: &str) -> Option<&Self> {
        let Self::Dictionary(pairs) = self else { return None };
        pairs.iter().find(|(name, _)| name.text().is_some_and(|name| name == key)).map(|(_, value)| value)
    }

    /// The text, if this is one.
    pub fn text(&self) -> Option<&String> {
        if let Self::Text(text) = self { Some(text) } else { None }
    }

    /// The numbers of a list, or the only one.
    pub fn numbers(&self) -> Option<Vec<usize>> {
        let number = |value: &Self| if let Self::Number(number) = value { Some(*number) } else { None };
        match self {
            Self::List(values) => values.iter().map(number).collect(),
            other => number(other).map(|number| vec![number]),
        }
    }
}

/// Takes a literal from the beginning of `rest`.
fn value(rest: &mut &str, depth: usize) -> Option<Value> {
    *rest = rest.trim_start();
    if depth > DEEPEST {
        return None;
    }
    for (word, value) in [("True", Value::Bool(true)), ("False", Value::Bool(false)), ("None", Value::None)] {
        if let Some(after) = rest.strip_prefix(word) {
            *rest = after;
            return Some(value);
        }
    }
    let first = rest.chars().next()?;
    match first {
        '\'' | '"' => text(rest, first),
        '0'..='9' => number(rest),
        '(' | '[' => {
            let end = if first == '(' { ')' } else { ']' };
            let mut values = Vec::new();
            *rest = &rest[1..];
            let mut has_comma = false;
            while !taken(rest, end) {
                values.push(value(rest, depth + 1)?);
                has_comma = taken(rest, ',');
                if !has_comma {
                    if !taken(rest, end) {
                        return None;
                    }
                    break;
                }
            }
            // Without a comma, round brackets only hold a value together.
            if first == '(' && values.len() == 1 && !has_comma {
                values.pop()
            } else {
                Some(Value::List(values))
            }
        }
        '{' => {
            let mut pairs = Vec::new();
            *rest = &rest[1..];
            while !taken(rest, '}') {
                let key = value(rest, depth + 1)?;
                if !taken(rest, ':') {
                    return None;
                }
                pairs.push((key, value(rest, depth + 1)?));
                if !taken(rest, ',') {
                    if !taken(rest, '}') {
                        return None;
                    }
                    break;
                }
            }
            Some(Value::Dictionary(pairs))
        }
        _ => None,
    }
}

/// Takes a sign and the space before it, if it is there.
fn taken(rest: &mut &str, sign: char) -> bool {
    let after = rest.trim_start().strip_prefix(sign);
    if let Some(after) = after {
        *rest = after;
    }
    after.is_some()
}

/// Takes a text in these quotes. Of escapes, those of quotes and of the backslash are known.
fn text(rest: &mut &str, quote: char) -> Option<Value> {
    let (mut text, mut chars) = (String::new(), rest[1..].chars());
    loop {
        match chars.next()? {
            c if c == quote => break,
            '\\' => text.push(chars.next().filter(|c| matches!(c, '\'' | '"' | '\\'))?),
            c => text.push(c),
        }
    }
    *rest = chars.as_str();
    Some(Value::Text(text))
}

/// Takes a number. Python 2 wrote an `L` after long ones.
fn number(rest: &mut &str) -> Option<Value> {
    let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
    let (digits, after) = rest.split_at(end);
    *rest = after.strip_prefix('L').unwrap_or(after);
    digits.parse().ok().map(Value::Number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn literals_are_read() {
        let header = Value::parse(
            " {'descr': [('a\\'', \"<f4\", (2, 3L)), ], 'b': (7,), 'c': (7), 'd': (), 'e': None} \n",
        )
        .unwrap();
        let field = Value::List(vec![
            Value::Text("a'".into()),
            Value::Text("<f4".into()),
            Value::List(vec![Value::Number(2), Value::Number(3)]),
        ]);
        assert_eq!(header.get("descr"), Some(&Value::List(vec![field])));
        assert_eq!(header.get("b").unwrap().numbers().unwrap(), [7]);
        assert_eq!(header.get("c"), Some(&Value::Number(7)));
        assert_eq!(header.get("d").unwrap().numbers().unwrap(), [0; 0]);
        assert_eq!(header.get("e"), Some(&Value::None));
    }

    #[test]
    fn what_is_no_literal_is_refused() {
        let nested = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
        for text in
            ["", "{", "{'a' 1}", "[1 2]", "'a", "f()", "-1", "1.5", "99999999999999999999999", "1 1", &nested]
        {
            assert_eq!(Value::parse(text), None, "{}", &text[..text.len().min(30)]);
        }
    }

    proptest! {
        #[test]
        fn any_text_is_a_literal_or_not(text in "[\\[\\](){}',:0-9a-zL\\\\é ]{0,60}") {
            let _ = Value::parse(&text);
        }
    }
}
