//! Streams of Draco, each of which holds the vertices and the triangles of a primitive.

use std::collections::BTreeMap;

use draco_core::{DataType, DecodeLimits, DecoderBuffer, ErrorKind, FaceIndex, Mesh, MeshDecoder};

use super::fault::Fault;

/// A primitive that was decoded.
pub(super) struct Draco {
    /// The number of vertices.
    pub points: usize,
    /// Three `u32` to a triangle, little-endian.
    pub indices: Vec<u8>,
    /// The attributes by the number that the stream gives them.
    pub attributes: BTreeMap<u32, Attribute>,
}

/// An attribute of the vertices.
pub(super) struct Attribute {
    /// The components of a value.
    pub components: usize,
    /// The integer that stands for 1 if the accessor is normalised; `None` if the stream holds floats.
    pub largest: Option<f64>,
    /// `f32`, little-endian, point by point.
    pub values: Vec<u8>,
}

impl Draco {
    /// Decodes a stream that may become at most `limit` bytes.
    pub fn decode(stream: &[u8], limit: u64) -> Result<Self, Fault> {
        let vertices = limit / size_of::<[f32; 3]>() as u64;
        let limits = DecodeLimits::default()
            .with_max_decoded_bytes(limit)
            .with_max_points(vertices)
            .with_max_faces(vertices);
        let mut mesh = Mesh::new();
        let mut buffer = DecoderBuffer::new(stream).with_limits(limits);
        MeshDecoder::new().decode(&mut buffer, &mut mesh).map_err(|error| match error.kind() {
            ErrorKind::LimitExceeded => Fault::new(
                "",
                format!(
                    "its {} bytes of Draco unpack to more than the {limit} bytes of geometry allowed",
                    stream.len()
                ),
            ),
            _ => Fault::new("", format!("the Draco compression is broken: {error}")),
        })?;
        let points = mesh.num_points();
        let indices = (0..mesh.num_faces())
            .flat_map(|face| mesh.face(FaceIndex(face as u32)))
            .flat_map(|point| point.0.to_le_bytes())
            .collect();
        let mut attributes = BTreeMap::new();
        let mut total = 0_u64;
        for id in 0..mesh.num_attributes() {
            let attribute = mesh.attribute(id);
            let components = usize::from(attribute.num_components());
            let largest = match attribute.data_type() {
                DataType::Int8 => Some(f64::from(i8::MAX)),
                DataType::Uint8 => Some(f64::from(u8::MAX)),
                DataType::Int16 => Some(f64::from(i16::MAX)),
                DataType::Uint16 => Some(f64::from(u16::MAX)),
                DataType::Float32 => None,
                // glTF has no such components.
                _ => continue,
            };
            total = total.saturating_add((points as u64).saturating_mul(4 * components as u64));
            if total > limit {
                let problem = format!("its attributes take {total} bytes, more than the {limit} allowed");
                return Err(Fault::new("", problem));
            }
            let values = attribute.read_f32s(points, components);
            let values = values.into_iter().flat_map(f32::to_le_bytes).collect();
            attributes.insert(attribute.unique_id(), Attribute { components, largest, values });
        }
        Ok(Self { points, indices, attributes })
    }

    /// The bytes that it takes.
    pub fn bytes(&self) -> usize {
        self.indices.len() + self.attributes.values().map(|attribute| attribute.values.len()).sum::<usize>()
    }
}
