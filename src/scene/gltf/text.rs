//! The text of a file's JSON before it is parsed: the element that a byte belongs to, and what is mended so that a parser
//! reads on.
//!
//! Serialisers write `null` where a value is absent, and `inf` or `NaN` where a number is none. Neither is glTF, the second is
//! not even JSON, and both stand mostly where no geometry is concerned. A `null` is taken out of the text, and a number that is
//! none becomes an empty text, which the parser passes over where it needs no number. Programs that number elements from 0 also
//! write -1 for no element, which is taken out as `null` is.

use std::borrow::Cow;
use std::ops::Range;

use super::fault::quoted;
use super::notices::Notices;

/// The levels of nesting whose places are known. What lies deeper is of no use to glTF.
const DEEPEST: usize = 32;

/// The extensions whose content is mended as glTF's own: those that are read as a part of the whole document.
const MENDED_EXTENSIONS: [&str; 4] =
    ["EXT_mesh_gpu_instancing", "KHR_node_visibility", "CESIUM_RTC", "KHR_draco_mesh_compression"];

/// A list or an object that the scanner is in.
struct Level {
    is_object: bool,
    /// Its first byte.
    start: usize,
    /// The key of the member that the scanner is at.
    key: Range<usize>,
    /// The number of the element that the scanner is at.
    index: usize,
    /// Where the member or element begins that the scanner is at.
    member: usize,
    /// The comma after the last member that was not taken out, until another such member follows.
    comma: Option<usize>,
    /// Whether the member that the scanner is at is taken out.
    is_out: bool,
}

/// A piece of the text.
enum Token {
    Open,
    /// The bracket and the level that it closes, if the level is known.
    Close(Option<Level>),
    Key,
    Comma,
    /// A text, a number or a word.
    Value,
}

/// Goes through the text token by token and knows where it is. It takes any bytes: what is no JSON is for the parser to find.
struct Scanner<'t> {
    text: &'t [u8],
    at: usize,
    levels: Vec<Level>,
    /// The levels beyond [`DEEPEST`].
    deeper: usize,
}

impl<'t> Scanner<'t> {
    fn new(text: &'t [u8], at: usize) -> Self {
        Self { text, at, levels: Vec::new(), deeper: 0 }
    }

    fn next(&mut self) -> Option<(Token, Range<usize>)> {
        let text = self.text;
        loop {
            let start = self.at;
            let byte = *text.get(start)?;
            self.at += 1;
            let token = match byte {
                b' ' | b'\t' | b'\r' | b'\n' | b':' => continue,
                b'{' | b'[' => {
                    if self.levels.len() < DEEPEST && self.deeper == 0 {
                        self.begin_member(start);
                        self.levels.push(Level {
                            is_object: byte == b'{',
                            start,
                            key: 0..0,
                            index: 0,
                            member: usize::MAX,
                            comma: None,
                            is_out: false,
                        });
                    } else {
                        self.deeper += 1;
                    }
                    Token::Open
                }
                b'}' | b']' if self.deeper > 0 => {
                    self.deeper -= 1;
                    Token::Close(None)
                }
                b'}' | b']' => Token::Close(self.levels.pop()),
                b',' => {
                    if let Some(level) = self.levels.last_mut().filter(|_| self.deeper == 0) {
                        level.index += 1;
                        level.member = usize::MAX;
                    }
                    Token::Comma
                }
                b'"' => {
                    while let Some(&byte) = text.get(self.at) {
                        self.at += if byte == b'\\' { 2 } else { 1 };
                        if byte == b'"' {
                            break;
                        }
                    }
                    self.at = self.at.min(text.len());
                    let at = self.at;
                    self.begin_member(start);
                    match self.levels.last_mut().filter(|level| level.is_object && level.member == start) {
                        Some(level) if self.deeper == 0 => {
                            level.key = start + 1..at.saturating_sub(1).max(start + 1);
                            Token::Key
                        }
                        _ => Token::Value,
                    }
                }
                _ => {
                    let is_inside = |b: &u8| b.is_ascii_alphanumeric() || b"+-.#_()".contains(b);
                    self.at += text[self.at..].iter().take_while(|b| is_inside(b)).count();
                    self.begin_member(start);
                    Token::Value
                }
            };
            return Some((token, start..self.at));
        }
    }

    fn begin_member(&mut self, start: usize) {
        let level = self.levels.last_mut().filter(|level| level.member == usize::MAX);
        if let Some(level) = level.filter(|_| self.deeper == 0) {
            level.member = start;
        }
    }

    fn key(&self, level: &Level) -> &'t [u8] {
        self.text.get(level.key.clone()).unwrap_or_default()
    }

    /// The keys of the objects that the scanner is in, from the outside in.
    fn keys(&self) -> impl Iterator<Item = &'t [u8]> + '_ {
        self.levels.iter().filter(|level| level.is_object).map(|level| self.key(level))
    }

    /// Names the element that the scanner is at, from the outside in, such as `node 3 "wall", children`.
    fn place(&self) -> String {
        let mut steps: Vec<String> = Vec::new();
        for (depth, level) in self.levels.iter().enumerate() {
            if level.is_object {
                let key = String::from_utf8_lossy(self.key(level));
                if !key.is_empty() {
                    steps.push(quoted(&key).trim_matches('"').to_owned());
                }
            } else if let Some(list) = steps.last_mut() {
                let element = self.levels.get(depth + 1).filter(|_| depth == 1);
                let name = element.and_then(|element| name_of(self.text, element.start));
                let name = name.map_or(String::new(), |name| format!(" {}", quoted(&name)));
                *list = format!("{} {}{name}", singular(list), level.index);
            }
        }
        steps.join(", ")
    }

    /// Whether a number here is a whole one.
    fn wants_integer(&self) -> bool {
        let mut keys = self.levels.iter().rev().filter(|level| level.is_object).map(|level| self.key(level));
        keys.next().is_some_and(|key| WHOLE_NUMBERS.contains(&key)) || keys.next() == Some(b"attributes")
    }

    /// Whether a number here is that of an element, which may be left out.
    fn wants_element(&self) -> bool {
        let in_object = self.levels.last().filter(|level| level.is_object);
        self.is_gltf() && in_object.is_some_and(|level| OPTIONAL_ELEMENTS.contains(&self.key(level)))
    }

    /// Whether a `null` here stands for a value that is absent, and not for something that glTF leaves to others.
    fn is_gltf(&self) -> bool {
        let mut keys = self.keys();
        while let Some(key) = keys.next() {
            match key {
                b"extras" => return false,
                b"extensions" => {
                    return keys
                        .next()
                        .is_none_or(|name| MENDED_EXTENSIONS.iter().any(|mended| mended.as_bytes() == name));
                }
                _ => {}
            }
        }
        true
    }
}

/// The members whose values are whole numbers, alone or in a list.
const WHOLE_NUMBERS: [&[u8]; 22] = [
    b"buffer",
    b"bufferView",
    b"byteLength",
    b"byteOffset",
    b"byteStride",
    b"camera",
    b"children",
    b"componentType",
    b"count",
    b"indices",
    b"inverseBindMatrices",
    b"joints",
    b"material",
    b"mesh",
    b"mode",
    b"nodes",
    b"skin",
    b"scene",
    b"POSITION",
    b"TRANSLATION",
    b"ROTATION",
    b"SCALE",
];

/// The members whose value is the number of an element that need not be there.
const OPTIONAL_ELEMENTS: [&[u8]; 9] = [
    b"bufferView",
    b"camera",
    b"indices",
    b"inverseBindMatrices",
    b"material",
    b"mesh",
    b"scene",
    b"skeleton",
    b"skin",
];

/// `node` for `nodes`.
fn singular(list: &str) -> &str {
    match list {
        "meshes" => "mesh",
        "indices" | "children" => list,
        _ => list.strip_suffix('s').unwrap_or(list),
    }
}

/// The member `name` of the object that begins at `start`.
fn name_of(text: &[u8], start: usize) -> Option<String> {
    let mut scanner = Scanner::new(text, start);
    while let Some((token, at)) = scanner.next() {
        match token {
            Token::Value if scanner.levels.len() == 1 && scanner.keys().next() == Some(b"name") => {
                return serde_json::from_slice(&text[at]).ok();
            }
            Token::Close(_) if scanner.levels.is_empty() => return None,
            _ => {}
        }
    }
    None
}

/// The element at a byte of the text, and the piece of the text that stands there.
pub(super) fn place_of(text: &[u8], byte: usize) -> (String, &[u8]) {
    let mut scanner = Scanner::new(text, 0);
    loop {
        match scanner.next() {
            None => return (scanner.place(), b""),
            Some((Token::Close(Some(level)), at)) if at.end > byte => {
                // The bracket belongs to what it closes.
                scanner.levels.push(level);
                return (scanner.place(), &text[at]);
            }
            Some((_, at)) if at.end > byte => return (scanner.place(), &text[at]),
            Some(_) => {}
        }
    }
}

/// Where the fraction of a whole number begins: 2 for `36.0`. glTF only recommends that whole numbers have none.
fn needless_fraction(value: &[u8]) -> Option<usize> {
    let point = value.iter().position(|&b| b == b'.').filter(|&point| point > 0)?;
    let (digits, zeros) = (&value[..point], &value[point + 1..]);
    let is_whole = digits.iter().all(u8::is_ascii_digit) && zeros.iter().all(|&b| b == b'0');
    (is_whole && !zeros.is_empty()).then_some(point)
}

/// Whether a value is a word for a number that is none, as serialisers of several languages write it.
fn is_no_number(value: &[u8]) -> bool {
    const LONGEST: usize = 24;
    const WORDS: [&[u8]; 4] = [b"inf", b"nan", b"#ind", b"#qnan"];
    let has = |word: &&[u8]| value.windows(word.len()).any(|part| part.eq_ignore_ascii_case(word));
    value.len() <= LONGEST && !value.starts_with(b"\"") && WORDS.iter().any(has)
}

/// The text as it is to be parsed. What was mended is warned of.
pub(super) fn mended<'t>(text: &'t [u8], notices: &Notices) -> Cow<'t, [u8]> {
    let text = match text.strip_prefix(b"\xef\xbb\xbf") {
        Some(text) => {
            notices.warn(String::new, "the JSON begins with a byte order mark, which is passed over");
            text
        }
        None => text,
    };
    let is_padding = |b: &&u8| **b == 0 || b.is_ascii_whitespace();
    let padding = text.iter().rev().take_while(is_padding).count();
    let (text, padding) = text.split_at(text.len() - padding);
    if padding.contains(&0) && !text.is_empty() {
        notices.warn(String::new, "the JSON is padded with NUL characters, where glTF asks for spaces");
    }
    let text = match std::str::from_utf8(text) {
        Ok(_) => Cow::Borrowed(text),
        Err(_) => {
            notices
                .warn(String::new, "the JSON is not UTF-8; the characters that can't be read are replaced");
            Cow::Owned(String::from_utf8_lossy(text).into_owned().into_bytes())
        }
    };
    match mended_values(&text, notices) {
        Some(mended) => Cow::Owned(mended),
        None => text,
    }
}

/// What becomes of a value that is mended.
enum Mend {
    /// Its member or element is taken out.
    TakeOut,
    /// It is replaced by a text of at most four bytes.
    Replace(&'static [u8]),
}

/// The text with the same number of bytes, so that places stay the same; `None` if nothing is to be mended.
fn mended_values(text: &[u8], notices: &Notices) -> Option<Vec<u8>> {
    let mut mended: Option<Vec<u8>> = None;
    let mut scanner = Scanner::new(text, 0);
    while let Some((token, at)) = scanner.next() {
        match token {
            Token::Value if scanner.deeper == 0 => {
                if let Some(fraction) =
                    needless_fraction(&text[at.clone()]).filter(|_| scanner.wants_integer())
                {
                    let bytes = mended.get_or_insert_with(|| text.to_vec());
                    bytes[at.start + fraction..at.end].fill(b' ');
                    continue;
                }
                let mend = match &text[at.clone()] {
                    b"null" => mend_of_null(&scanner),
                    b"-1" => scanner.wants_element().then_some(Mend::TakeOut),
                    value if is_no_number(value) => Some(Mend::Replace(b"\"\"")),
                    _ => None,
                };
                let Some(mend) = mend else { continue };
                let bytes = mended.get_or_insert_with(|| text.to_vec());
                let message = match &text[at.clone()] {
                    b"null" => "null is read as if it was not there",
                    b"-1" => "-1 is no element, and is read as if it was not there",
                    _ => "inf or NaN is neither JSON nor a number of glTF, and is passed over",
                };
                notices.warn(|| scanner.place(), message);
                match mend {
                    Mend::TakeOut => {
                        let Some(level) = scanner.levels.last_mut() else { continue };
                        bytes[level.member..at.end].fill(b' ');
                        level.is_out = true;
                    }
                    Mend::Replace(by) => {
                        bytes[at.clone()].fill(b' ');
                        bytes[at.start..][..by.len()].copy_from_slice(by);
                    }
                }
            }
            Token::Value if is_no_number(&text[at.clone()]) => {
                // Too deep for its place to be known, and so for it to be of use.
                let bytes = mended.get_or_insert_with(|| text.to_vec());
                bytes[at.clone()].fill(b' ');
                bytes[at.start..][..2].copy_from_slice(b"\"\"");
            }
            Token::Comma if scanner.deeper == 0 => {
                let Some(level) = scanner.levels.last_mut() else { continue };
                if level.is_out {
                    if let Some(bytes) = &mut mended {
                        bytes[at.start] = b' ';
                    }
                } else {
                    level.comma = Some(at.start);
                }
                level.is_out = false;
            }
            // Nothing may follow the last comma.
            Token::Close(Some(Level { is_out: true, comma: Some(comma), .. })) => {
                if let Some(bytes) = &mut mended {
                    bytes[comma] = b' ';
                }
            }
            _ => {}
        }
    }
    mended
}

fn mend_of_null(scanner: &Scanner) -> Option<Mend> {
    if !scanner.is_gltf() {
        return None;
    }
    let (level, outer) = scanner.levels.split_last()?;
    if level.is_object {
        return Some(Mend::TakeOut);
    }
    // The numbers of elements count their place in a list, so that an element that is nothing keeps its own.
    match scanner.key(outer.last()?) {
        b"children" | b"extensionsUsed" | b"extensionsRequired" => Some(Mend::TakeOut),
        b"nodes" if outer.len() > 1 => Some(Mend::TakeOut),
        b"primitives" | b"targets" => Some(Mend::Replace(b"{}")),
        _ if outer.len() == 1 => Some(Mend::Replace(b"{}")),
        _ => None,
    }
}
