//! The description of an E57: a tree of elements.

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::super::error::ReadError;

/// An element of the description.
#[derive(Clone, Debug, Default)]
pub(super) struct Element {
    /// The name, with the prefix of an extension.
    pub name: String,
    /// The attributes.
    pub attributes: Vec<(String, String)>,
    /// The text inside, without that of elements.
    pub text: String,
    /// The elements inside.
    pub children: Vec<Element>,
}

/// The most elements, and the deepest. An element takes some hundred bytes of memory; a scan has some eighty, at a depth of six.
const MOST_ELEMENTS: usize = 500_000;
const MOST_DEPTH: usize = 32;
/// The most attributes of an element.
const MOST_ATTRIBUTES: usize = 64;

impl Element {
    /// Reads a description. Entities that it declares itself are not read.
    ///
    /// # Errors
    /// A [`ReadError`] if it is no XML, or deeper or larger than a description is.
    pub fn parse(text: &str) -> Result<Self, ReadError> {
        let broken = |e: &dyn std::fmt::Display| ReadError::new(format!("its description is no XML: {e}"));
        let mut reader = Reader::from_str(text);
        let (mut open, mut count): (Vec<Self>, usize) = (Vec::new(), 0);
        loop {
            match reader.read_event().map_err(|e| broken(&e))? {
                Event::Start(start) => {
                    count += 1;
                    if count > MOST_ELEMENTS || open.len() >= MOST_DEPTH {
                        return Err(ReadError::new("its description is larger or deeper than is read"));
                    }
                    open.push(Self::begun(&start).ok_or_else(|| broken(&"an element is broken"))?);
                }
                Event::Empty(start) => {
                    count += 1;
                    let element = Self::begun(&start).ok_or_else(|| broken(&"an element is broken"))?;
                    let parent = open.last_mut().filter(|_| count <= MOST_ELEMENTS);
                    let parent = parent
                        .ok_or_else(|| ReadError::new("its description is empty, or larger than is read"))?;
                    parent.children.push(element);
                }
                Event::End(_) => {
                    let Some(element) = open.pop() else { return Err(broken(&"it ends twice")) };
                    match open.last_mut() {
                        Some(parent) => parent.children.push(element),
                        None => return Ok(element),
                    }
                }
                Event::Text(content) => {
                    if let Some(element) = open.last_mut() {
                        element.text += &content;
                    }
                }
                Event::CData(content) => {
                    if let Some(element) = open.last_mut() {
                        element.text += &content;
                    }
                }
                Event::GeneralRef(entity) => {
                    let entity = format!("&{};", &*entity);
                    if let Some(element) = open.last_mut() {
                        element.text += &quick_xml::escape::unescape(&entity).map_err(|e| broken(&e))?;
                    }
                }
                Event::Eof => return Err(broken(&"it ends before its last element")),
                _ => {}
            }
        }
    }

    fn begun(start: &BytesStart) -> Option<Self> {
        let mut attributes = Vec::new();
        for attribute in start.attributes() {
            let attribute = attribute.ok().filter(|_| attributes.len() < MOST_ATTRIBUTES)?;
            let value = quick_xml::escape::unescape(&attribute.value).ok()?.into_owned();
            attributes.push((attribute.key.as_ref().to_owned(), value));
        }
        Some(Self { name: start.name().as_ref().to_owned(), attributes, ..Self::default() })
    }

    /// The first element inside with this name.
    pub fn child(&self, name: &str) -> Option<&Self> {
        self.children.iter().find(|child| child.name == name)
    }

    /// The value of an attribute.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// The number in the element inside with this name. An element without a text is 0.
    pub fn number(&self, name: &str) -> Option<f64> {
        match self.child(name)?.text.trim() {
            "" => Some(0.0),
            text => text.parse().ok(),
        }
    }
}
