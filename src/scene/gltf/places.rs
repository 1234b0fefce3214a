//! Finds nodes and cameras by their names.

use glam::{DAffine3, DMat3, DVec3};

use super::chains::Chains;
use super::fault::{Fault, quoted};
use super::options::Place;
use crate::motion::Motion;
use crate::source::suggest::nearest;
use crate::source::words::counted;

/// The map to a camera's node from a sensor: cameras of glTF look along −z with y up, sensors along x with z up.
const NODE_FROM_SENSOR: DAffine3 =
    DAffine3 { matrix3: DMat3::from_cols(DVec3::NEG_Z, DVec3::NEG_X, DVec3::Y), translation: DVec3::ZERO };

impl Chains<'_, '_> {
    /// The map to the world from something in the scene, over time. A body at a node has its axes where the node's would be in the
    /// world if the node was not turned; a camera's are those of a sensor that looks the same way.
    pub fn find(&self, place: Place) -> Result<Motion, Fault> {
        match place {
            Place::Node(name) => self.place(self.node_named(name)?, self.world_from_gltf.inverse()),
            Place::Camera(name) => self.place(self.camera_named(name)?, NODE_FROM_SENSOR),
        }
    }

    /// The node of the scene that is called `name`.
    pub fn node_named(&self, name: &str) -> Result<u32, Fault> {
        let nodes = self.scene_nodes();
        let of = |node: u32| self.document.nodes[node as usize].name.as_deref();
        let pairs = nodes.into_iter().filter_map(|node| Some((of(node)?, node)));
        self.the_one("node", name, pairs.collect())
    }

    /// The node of the scene with the camera that is called `name`, or that is called so itself and has a camera.
    fn camera_named(&self, name: &str) -> Result<u32, Fault> {
        let mut pairs = Vec::new();
        for node in self.scene_nodes() {
            let own = &self.document.nodes[node as usize];
            let Some(&camera) = own.camera.given() else { continue };
            let camera = self.document.cameras.get(camera as usize).and_then(|camera| camera.name.given());
            let names =
                [own.name.as_deref(), camera.map(String::as_str).filter(|n| Some(*n) != own.name.as_deref())];
            pairs.extend(names.into_iter().flatten().map(|name| (name, node)));
        }
        self.the_one("camera", name, pairs)
    }

    /// The nodes of the scene.
    fn scene_nodes(&self) -> Vec<u32> {
        let mut stack: Vec<u32> = self.hierarchy.roots.iter().rev().copied().collect();
        let mut is_found = vec![false; self.document.nodes.len()];
        let mut found = Vec::new();
        while let Some(node) = stack.pop() {
            if !std::mem::replace(&mut is_found[node as usize], true) {
                found.push(node);
                stack.extend(self.document.nodes[node as usize].children.iter().rev());
            }
        }
        found
    }

    /// The one node whose name is `name`.
    fn the_one(&self, kind: &str, name: &str, pairs: Vec<(&str, u32)>) -> Result<u32, Fault> {
        const LISTED: usize = 10;
        let found: Vec<u32> =
            pairs.iter().filter(|(other, _)| *other == name).map(|(_, node)| *node).collect();
        match found[..] {
            [node] => Ok(node),
            [] => {
                let fault = Fault::new("", format!("the scene has no {kind} called {}", quoted(name)));
                if pairs.is_empty() {
                    return Err(fault.help(format!("it has no {kind} with a name")));
                }
                let names = pairs.iter().map(|(name, _)| *name);
                let meant = nearest(name, names.clone());
                let meant = meant.map_or(String::new(), |meant| format!("did you mean {}? ", quoted(meant)));
                let shown: Vec<String> = names.take(LISTED).map(quoted).collect();
                let more = if pairs.len() > LISTED { ", …; `beamcast info` lists all" } else { "" };
                Err(fault.help(format!("{meant}it has {}{more}", shown.join(", "))))
            }
            _ => {
                let shown: Vec<String> =
                    found.iter().take(LISTED).map(|&node| self.document.node_label(node)).collect();
                let count = counted(found.len(), kind);
                let problem = format!("the scene has {count} called {}: {}", quoted(name), shown.join(", "));
                Err(Fault::new("", problem).help("give the one that is meant a name of its own"))
            }
        }
    }
}
