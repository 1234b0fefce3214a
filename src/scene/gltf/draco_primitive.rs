//! KHR_draco_mesh_compression: primitives that get their elements from a stream of Draco.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::data::{Data, Elements};
use super::draco::Draco;
use super::fault::Fault;

/// The extension of a primitive.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Extension {
    buffer_view: u32,
    attributes: BTreeMap<String, u32>,
}

/// The compressed content of a primitive.
pub(super) struct DracoPrimitive<'d> {
    draco: &'d Draco,
    attributes: BTreeMap<String, u32>,
}

impl<'d> DracoPrimitive<'d> {
    /// Decodes what an extension of a primitive names.
    pub fn of(extension: &str, data: &'d Data) -> Result<Self, Fault> {
        let Extension { buffer_view, attributes } =
            serde_json::from_str(extension).map_err(|error| Fault::new("", error.to_string()))?;
        Ok(Self { draco: data.draco(buffer_view)?, attributes })
    }

    /// The elements of an attribute, with `components` components at least, if the stream has it.
    pub fn attribute(
        &self,
        name: &str,
        components: usize,
        is_normalized: bool,
    ) -> Result<Option<Elements<'d>>, Fault> {
        let Some(id) = self.attributes.get(name) else { return Ok(None) };
        let Some(attribute) = self.draco.attributes.get(id) else {
            return Err(Fault::new(name, format!("the stream has no attribute {id}")));
        };
        if attribute.components < components {
            let problem = format!("it has {} components where {components} are needed", attribute.components);
            return Err(Fault::new(name, problem));
        }
        let one = attribute.largest.filter(|_| is_normalized);
        Ok(Some(Elements::decoded(&attribute.values, attribute.components, one)))
    }

    /// The corners of the triangles, three to a triangle.
    pub fn indices(&self) -> Elements<'d> {
        Elements::decoded_integers(&self.draco.indices)
    }

    /// The number of vertices.
    pub fn points(&self) -> usize {
        self.draco.points
    }
}
