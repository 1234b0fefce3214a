//! The trees of nodes: parents, the roots of a scene, and where each node is at rest.

use std::collections::BTreeSet;

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::animation::{Animations, Moves, rest};
use super::document::Document;
use super::fault::{Fault, quoted};
use super::notices::Notices;
use super::rotation::{normalised, unit};
use super::schema::Node;
use crate::source::suggest::nearest;
use crate::source::words::counted;

/// The largest deviation of the last row of a matrix from [0, 0, 0, 1] that is read as that row. Exporters that invert or
/// multiply matrices in f32 leave a few units in the last place there, of numbers of the size of a scene.
const LAST_ROW_TOLERANCE: f64 = 1e-3;

/// The parents and the places of all nodes, and the nodes that a scene begins with.
pub(super) struct Hierarchy {
    /// The nodes that the scene begins with, in the order of the file.
    pub roots: Vec<u32>,
    /// The map of each node to the world, in glTF's axes, at rest.
    pub world_from_node: Vec<DAffine3>,
    /// The parent of each node in the scene.
    pub parents: Vec<Option<u32>>,
    /// All nodes, parents before their children.
    pub order: Vec<u32>,
    /// Where each node is in its parent, at rest.
    pub locals: Vec<Local>,
}

/// Where a node is in its parent.
#[derive(Clone, Copy)]
pub(super) enum Local {
    Matrix(DAffine3),
    Parts { translation: DVec3, rotation: DQuat, scale: DVec3 },
}

impl Local {
    pub fn map(self) -> DAffine3 {
        match self {
            Self::Matrix(map) => map,
            Self::Parts { translation, rotation, scale } => {
                DAffine3::from_scale_rotation_translation(scale, rotation, translation)
            }
        }
    }

    /// The same with what clips set once and for all. A matrix is split for that.
    fn with(self, moves: &Moves, place: &impl Fn() -> String, notices: &Notices) -> Self {
        if !moves.set_place() {
            return self;
        }
        if matches!(self, Self::Matrix(_)) {
            let message = "an animation moves it, though it has a matrix, which is split into translation, rotation and scale";
            notices.warn(place, message);
        }
        let (translation, rotation, scale) = self.parts();
        Self::Parts {
            translation: rest(&moves.translation).unwrap_or(translation),
            rotation: rest(&moves.rotation).map_or(rotation, normalised),
            scale: rest(&moves.scale).unwrap_or(scale),
        }
    }

    /// Translation, rotation and scale.
    pub fn parts(self) -> (DVec3, DQuat, DVec3) {
        match self {
            Self::Parts { translation, rotation, scale } => (translation, rotation, scale),
            Self::Matrix(map) => {
                let (scale, rotation, translation) = map.to_scale_rotation_translation();
                (translation, rotation, scale)
            }
        }
    }
}

impl Hierarchy {
    /// Checks that the nodes form trees and composes their transforms, as they are seen from `scene` (from the whole file, if it
    /// has no scenes). It takes time in proportion to the number of nodes, however deep the trees are.
    pub fn new(
        document: &Document,
        scene: Option<u32>,
        animations: &Animations,
        notices: &Notices,
    ) -> Result<Self, Fault> {
        let nodes = &document.nodes;
        let mut parents = parents(document, notices)?;
        let tops: Vec<u32> =
            (0_u32..).zip(&parents).filter(|(_, parent)| parent.is_none()).map(|(index, _)| index).collect();
        let mut stack = tops.clone();
        let mut is_reached = vec![false; nodes.len()];
        let mut order = Vec::with_capacity(nodes.len());
        while let Some(index) = stack.pop() {
            if !std::mem::replace(&mut is_reached[index as usize], true) {
                order.push(index);
                stack.extend(&nodes[index as usize].children);
            }
        }
        if let Some(lost) = is_reached.iter().position(|reached| !reached) {
            return Err(cycle(document, &parents, lost as u32));
        }

        let roots = match scene {
            None => tops,
            Some(index) => scene_roots(document, index, &order, &mut parents, notices)?,
        };
        let origin = DAffine3::from_translation(DVec3::from_array(document.origin));
        let mut world_from_node = vec![DAffine3::NAN; nodes.len()];
        let mut locals = vec![Local::Matrix(DAffine3::NAN); nodes.len()];
        for &index in &order {
            let at = index as usize;
            let place = || document.node_label(index);
            let mut local = local(&nodes[at], &place, notices).map_err(|fault| fault.within(place()))?;
            if let Some(moves) = animations.of(index) {
                local = local.with(moves, &place, notices);
            }
            let world_from_parent = parents[at].map_or(origin, |parent| world_from_node[parent as usize]);
            world_from_node[at] = world_from_parent * local.map();
            locals[at] = local;
        }
        Ok(Self { roots, world_from_node, parents, order, locals })
    }
}

/// The parent of each node.
fn parents(document: &Document, notices: &Notices) -> Result<Vec<Option<u32>>, Fault> {
    let nodes = &document.nodes;
    let mut parents: Vec<Option<u32>> = vec![None; nodes.len()];
    for (index, node) in (0_u32..).zip(nodes) {
        for &child in &node.children {
            let fault = |problem: String| Fault::new(document.node_label(index), problem);
            match parents.get_mut(child as usize) {
                None => {
                    let problem =
                        format!("its child {child} does not exist: the last node is {}", nodes.len() - 1);
                    return Err(fault(problem));
                }
                Some(Some(parent)) if *parent == index => {
                    let message = "a child is listed twice; it is placed once";
                    notices.warn(|| document.node_label(index), message);
                }
                Some(Some(other)) => {
                    let problem = format!(
                        "its child {} is a child of {} already",
                        document.node_label(child),
                        document.node_label(*other)
                    );
                    return Err(fault(problem).help("a node has one parent; two nodes may share a mesh"));
                }
                Some(parent) => *parent = Some(index),
            }
        }
    }
    Ok(parents)
}

/// The error that a node hangs below itself. `lost` has a parent, which has a parent, and so on, so the way up from it ends in
/// a cycle.
fn cycle(document: &Document, parents: &[Option<u32>], lost: u32) -> Fault {
    let mut seen = BTreeSet::new();
    let mut at = lost;
    while let Some(parent) = parents[at as usize].filter(|_| seen.insert(at)) {
        at = parent;
    }
    Fault::new(document.node_label(at), "it is among its own descendants").help("nodes form trees")
}

/// The nodes that a scene begins with. A root that has a parent in the scene is placed by that parent, once. A root whose
/// parent is not in the scene begins the scene all the same: its parent, which the scene leaves out, does not move it.
fn scene_roots(
    document: &Document,
    scene: u32,
    order: &[u32],
    parents: &mut [Option<u32>],
    notices: &Notices,
) -> Result<Vec<u32>, Fault> {
    let place = || document.scene_label(scene);
    let mut is_listed = vec![false; parents.len()];
    let mut roots = Vec::new();
    for &root in &document.scenes[scene as usize].nodes {
        match is_listed.get_mut(root as usize) {
            None => return Err(Fault::new(place(), format!("node {root} does not exist"))),
            Some(true) => notices.warn(
                || format!("{}, {}", place(), document.node_label(root)),
                "it is listed twice among the scene's nodes; it is placed once",
            ),
            Some(is_listed) => {
                *is_listed = true;
                roots.push(root);
            }
        }
    }
    // Whether a node is below a listed one, parents before children.
    let mut is_below = vec![false; parents.len()];
    for &index in order {
        if let Some(parent) = parents[index as usize] {
            is_below[index as usize] = is_listed[parent as usize] || is_below[parent as usize];
        }
    }
    roots.retain(|&root| {
        if parents[root as usize].is_none() {
            return true;
        }
        let place = || format!("{}, {}", place(), document.node_label(root));
        if is_below[root as usize] {
            notices.warn(place, "it is listed among the scene's nodes, but has a parent there, which places it");
            return false;
        }
        notices.warn(
            place,
            "it is listed among the scene's nodes, but has a parent, which the scene leaves out: the parent does \
             not move it",
        );
        true
    });
    for &root in &roots {
        parents[root as usize] = None;
    }
    Ok(roots)
}

/// Where a node is in its parent, as the file has it.
fn local(node: &Node, place: &impl Fn() -> String, notices: &Notices) -> Result<Local, Fault> {
    if let Some(m) = &node.matrix {
        // A valid file has no matrix beside a translation, rotation or scale. Where a file has both, the matrix counts.
        let row = [m[3], m[7], m[11], m[15]];
        let right = [0.0, 0.0, 0.0, 1.0];
        if row != right {
            if row.iter().zip(right).any(|(found, right)| (found - right).abs() > LAST_ROW_TOLERANCE) {
                let problem = format!("the last row of its matrix is {row:?}");
                return Err(Fault::new("", problem)
                    .help("it is [0, 0, 0, 1] in glTF, whose matrices are written column by column"));
            }
            notices.warn(place, "the last row of its matrix is nearly, and taken as, [0, 0, 0, 1]");
        }
        let column = |at: usize| DVec3::new(m[at], m[at + 1], m[at + 2]);
        let matrix3 = DMat3::from_cols(column(0), column(4), column(8));
        return Ok(Local::Matrix(DAffine3 { matrix3, translation: column(12) }));
    }
    let rotation = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    Ok(Local::Parts {
        scale: node.scale.map_or(DVec3::ONE, DVec3::from_array),
        rotation: unit(rotation, place, notices)?,
        translation: node.translation.map_or(DVec3::ZERO, DVec3::from_array),
    })
}

/// The index of the scene called `name`, or of the default scene; `None` if the file has no scenes.
pub(super) fn choose_scene(
    document: &Document,
    name: Option<&str>,
    notices: &Notices,
) -> Result<Option<u32>, Fault> {
    let scenes = &document.scenes;
    let Some(name) = name else {
        let first = (!scenes.is_empty()).then_some(0);
        return match document.scene {
            Some(index) if index as usize >= scenes.len() => {
                let instead = if first.is_some() { "its first scene is" } else { "all of its nodes are" };
                let message = format!("the file's default scene does not exist; {instead} read");
                notices.warn(|| format!("scene {index}"), message);
                Ok(first)
            }
            Some(index) => Ok(Some(index)),
            None => Ok(first),
        };
    };
    if let Some(index) = scenes.iter().position(|scene| scene.name.as_deref() == Some(name)) {
        return Ok(Some(index as u32));
    }
    const LISTED: usize = 20;
    let names: Vec<_> = scenes.iter().filter_map(|scene| scene.name.as_deref()).collect();
    let fault = Fault::new("scenes", format!("there is no scene {}", quoted(name)));
    if names.is_empty() {
        let count = counted(scenes.len(), "scene");
        return Err(fault.help(format!("the file has {count}, none with a name; leave the name out")));
    }
    let shown: Vec<_> = names.iter().take(LISTED).map(|name| quoted(name)).collect();
    let more = if names.len() > LISTED { ", …" } else { "" };
    let meant = nearest(name, names.iter().copied())
        .map_or(String::new(), |name| format!("did you mean {}? ", quoted(name)));
    Err(fault.help(format!("{meant}the file has {}{more}", shown.join(", "))))
}
