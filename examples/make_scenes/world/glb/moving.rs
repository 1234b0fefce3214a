//! Moving parts of a scene: trees of nodes, skins and animations.

use glam::{DQuat, DVec3};
use serde_json::{Map, Value, json};

use super::super::mesh::Mesh;
use super::{
    ARRAY_BUFFER, Document, F32, NodeId, Place, U8, Welded, floats, gltf_rotation, gltf_vector, insert_place,
};

/// The joints that carry a vertex, by their index in the skin, each with its share.
pub type Weights = [(u8, f64); 2];

/// A mesh that follows joints.
#[derive(Default)]
pub struct Skin {
    pub mesh: Mesh,
    /// The weights of each of the mesh's vertices.
    pub weights: Vec<Weights>,
}

impl Skin {
    /// Adds what `add` adds to a mesh, with weights by the place of a vertex.
    pub fn add(&mut self, add: impl FnOnce(&mut Mesh), weights: impl Fn(DVec3) -> Weights) {
        add(&mut self.mesh);
        let new = &self.mesh.positions[self.weights.len()..];
        self.weights.extend(new.iter().map(|&p| weights(p)));
    }
}

/// The values of a node at the times of an animation.
pub enum Keys {
    Translations(Vec<DVec3>),
    Rotations(Vec<DQuat>),
}

impl Document {
    /// A node above `children`, without a mesh. It is not in the scene until [`Self::add`] adds it, or a parent.
    pub fn branch(&mut self, name: &str, place: Place, children: &[NodeId], extras: Value) -> NodeId {
        let mut node = Map::new();
        node.insert("name".into(), json!(name));
        insert_place(&mut node, place);
        if !children.is_empty() {
            node.insert("children".into(), json!(children.iter().map(|c| c.0).collect::<Vec<_>>()));
        }
        self.push_node(node, extras)
    }

    /// Puts `children` below a node.
    pub fn adopt(&mut self, parent: NodeId, children: &[NodeId]) {
        let children = children.iter().map(|c| json!(c.0));
        match &mut self.nodes[parent.0]["children"] {
            Value::Array(known) => known.extend(children),
            none => *none = children.collect(),
        }
    }

    /// A node of a mesh that follows `joints`. In the pose of the mesh each joint stands at `rest`, unrotated.
    pub fn skinned(
        &mut self,
        name: &str,
        skin: &Skin,
        joints: &[NodeId],
        rest: &[DVec3],
        extras: Value,
    ) -> NodeId {
        let welded = Welded::of(&skin.mesh);
        let (mut bones, mut shares) = (vec![], vec![]);
        for source in &welded.sources {
            let [(a, share), (b, _)] = skin.weights[*source as usize];
            // The shares of a vertex are whole 255ths with the sum 255, as the specification demands. A share of 0 belongs to
            // joint 0.
            let share = (share * 255.0).round() as u8;
            let joint = |joint: u8, share: u8| if share == 0 { 0 } else { joint };
            bones.extend([joint(a, share), joint(b, 255 - share), 0, 0]);
            shares.extend([share, 255 - share, 0, 0]);
        }
        let attributes = json!({
            "POSITION": self.positions(&welded.positions),
            "JOINTS_0": self.four_bytes(&bones, false),
            "WEIGHTS_0": self.four_bytes(&shares, true),
        });
        let mesh = self.welded(name, &welded, &attributes, false);
        let inverse: Vec<f32> = rest
            .iter()
            .flat_map(|&joint| {
                let [x, y, z] = gltf_vector(-joint);
                [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0]
            })
            .collect();
        let inverse = self.instance_attribute(&inverse, "MAT4");
        self.skins.push(json!({
            "name": name,
            "inverseBindMatrices": inverse,
            "joints": joints.iter().map(|joint| joint.0).collect::<Vec<_>>(),
        }));
        let node = self.node(name, mesh, Place::at(0.0, 0.0, 0.0), extras);
        self.nodes[node.0]["skin"] = json!(self.skins.len() - 1);
        node
    }

    fn four_bytes(&mut self, bytes: &[u8], normalized: bool) -> usize {
        let view = self.view(bytes, Some(ARRAY_BUFFER));
        let mut accessor =
            json!({ "bufferView": view, "componentType": U8, "count": bytes.len() / 4, "type": "VEC4" });
        if normalized {
            accessor["normalized"] = json!(true);
        }
        self.accessor(accessor)
    }

    /// Adds an animation: the values of nodes at the same times, with straight lines between them.
    pub fn animation(&mut self, name: &str, times: &[f64], tracks: &[(NodeId, Keys)]) {
        let times: Vec<f32> = times.iter().map(|&t| t as f32).collect();
        let bytes: Vec<u8> = times.iter().flat_map(|t| t.to_le_bytes()).collect();
        let view = self.view(&bytes, None);
        let input = self.accessor(json!({
            "bufferView": view, "componentType": F32, "count": times.len(), "type": "SCALAR",
            "min": floats(&times[..1]), "max": floats(&times[times.len() - 1..]),
        }));
        let (mut samplers, mut channels) = (vec![], vec![]);
        for (node, keys) in tracks {
            let (path, output) = match keys {
                Keys::Translations(keys) => {
                    let values: Vec<f32> = keys.iter().flat_map(|&v| gltf_vector(v)).collect();
                    ("translation", self.instance_attribute(&values, "VEC3"))
                }
                Keys::Rotations(keys) => {
                    // A quaternion and its negative are one rotation. Of the two, the one nearer to the key before it is
                    // written, so that a reader that does not look for the shorter way takes it, too.
                    let mut last = DQuat::IDENTITY;
                    let mut values = vec![];
                    for &key in keys {
                        last = if last.dot(key) < 0.0 { -key } else { key };
                        values.extend(gltf_rotation(last));
                    }
                    ("rotation", self.instance_attribute(&values, "VEC4"))
                }
            };
            channels.push(json!({ "sampler": samplers.len(), "target": { "node": node.0, "path": path } }));
            samplers.push(json!({ "input": input, "interpolation": "LINEAR", "output": output }));
        }
        self.animations.push(json!({ "name": name, "channels": channels, "samplers": samplers }));
    }
}
