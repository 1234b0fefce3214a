//! How nodes move: the chain of links from the world to a node, in which neighbours that stand still are one.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DAffine3, DVec3};

use super::actors::rigid;
use super::animation::Animations;
use super::data::Data;
use super::document::Document;
use super::fault::Fault;
use super::hierarchy::Hierarchy;
use crate::motion::{Channel, Link, Motion, Trajectory};

/// How the nodes of a scene move.
pub(super) struct Chains<'d, 'a> {
    pub document: &'d Document,
    pub data: &'d Data<'a>,
    pub hierarchy: &'d Hierarchy,
    pub animations: &'d Animations,
    pub world_from_gltf: DAffine3,
    /// The nodes that trajectories move, each with the size that it keeps.
    driven: BTreeMap<u32, (&'d Trajectory, DVec3)>,
    /// For each node the topmost at or above it whose place changes over time; empty if there is none.
    tops: Vec<Option<u32>>,
    /// For each node whether it is hidden at times, as it or a node above it is; empty if there is none.
    blinks: Vec<bool>,
}

/// A node on the way to others that are looked at together.
pub(super) struct Bone {
    /// The node that it hangs below, among those before it.
    pub parent: Option<u32>,
    /// The map from the node to its parent; of the first nodes, to the common anchor.
    pub motion: Motion,
}

/// Nodes as they are seen from a common anchor.
pub(super) struct Bones {
    /// The node in whose space they are; `None` is glTF's world.
    pub anchor: Option<u32>,
    /// Parents before their children.
    pub bones: Vec<Bone>,
    /// The bones of the nodes that were asked for; `None` is the anchor itself.
    pub asked: Vec<Option<u32>>,
}

impl Bones {
    /// Whether a node moves in the anchor's space.
    pub fn bend(&self) -> bool {
        self.bones.iter().any(|bone| !bone.motion.links.iter().all(Link::is_fixed))
    }

    /// The maps of the nodes that were asked for to the anchor, at a time.
    pub fn maps_at(&self, time_s: f64) -> Vec<DAffine3> {
        let mut maps: Vec<DAffine3> = Vec::with_capacity(self.bones.len());
        for bone in &self.bones {
            let own = bone.motion.map_at(time_s);
            maps.push(bone.parent.map_or(own, |parent| maps[parent as usize] * own));
        }
        self.asked.iter().map(|bone| bone.map_or(DAffine3::IDENTITY, |bone| maps[bone as usize])).collect()
    }
}

/// Links, with the neighbours among them that stand still multiplied.
#[derive(Default)]
struct Chain {
    links: Vec<Link>,
    fixed: DAffine3,
}

impl Chain {
    fn push(&mut self, link: Link) {
        match link {
            Link::Fixed(map) => self.fixed *= map,
            link => {
                self.flush();
                self.links.push(link);
            }
        }
    }

    fn flush(&mut self) {
        let fixed = std::mem::take(&mut self.fixed);
        if fixed != DAffine3::IDENTITY {
            self.links.push(Link::Fixed(fixed));
        }
    }

    fn motion(mut self) -> Motion {
        self.flush();
        Motion { links: self.links }
    }
}

impl<'d, 'a> Chains<'d, 'a> {
    /// The nodes of a scene, moved by its animations.
    pub fn new(
        document: &'d Document,
        data: &'d Data<'a>,
        hierarchy: &'d Hierarchy,
        animations: &'d Animations,
        world_from_gltf: DAffine3,
    ) -> Self {
        let driven = BTreeMap::new();
        let (tops, blinks) = (Vec::new(), Vec::new());
        let mut chains =
            Self { document, data, hierarchy, animations, world_from_gltf, driven, tops, blinks };
        chains.survey();
        chains
    }

    /// Lets a trajectory move a node, with all below it.
    pub fn drive(&mut self, node: u32, trajectory: &'d Trajectory) {
        let (scale, ..) = self.hierarchy.world_from_node[node as usize].to_scale_rotation_translation();
        self.driven.insert(node, (trajectory, scale));
        self.survey();
    }

    /// Finds the nodes that move.
    fn survey(&mut self) {
        if self.animations.is_empty() && self.driven.is_empty() {
            return;
        }
        let count = self.document.nodes.len();
        (self.tops, self.blinks) = (vec![None; count], vec![false; count]);
        for &index in &self.hierarchy.order {
            let at = index as usize;
            let moves = self.animations.of(index);
            let is_driven = self.driven.contains_key(&index);
            let parent = self.hierarchy.parents[at];
            let own = is_driven || moves.is_some_and(|moves| moves.place_moves());
            self.tops[at] = parent
                .filter(|_| !is_driven)
                .and_then(|parent| self.tops[parent as usize])
                .or(own.then_some(index));
            self.blinks[at] = parent.is_some_and(|parent| self.blinks[parent as usize])
                || moves
                    .and_then(|moves| moves.is_visible.as_ref())
                    .is_some_and(|channel| !channel.is_rest());
        }
    }

    /// Whether there are nodes that move.
    pub fn any_move(&self) -> bool {
        !self.tops.is_empty()
    }

    /// The topmost node at or above a node whose place changes over time.
    pub fn top(&self, node: u32) -> Option<u32> {
        self.tops.get(node as usize).copied().flatten()
    }

    /// Whether a node, or one above it, is hidden at times.
    pub fn blinks(&self, node: u32) -> bool {
        self.blinks.get(node as usize).copied().unwrap_or(false)
    }

    /// The map to the world from something at `below` in the space of a node.
    pub fn place(&self, node: u32, below: DAffine3) -> Result<Motion, Fault> {
        let mut chain = self.chain(Some(node))?;
        chain.push(Link::Fixed(below));
        Ok(chain.motion())
    }

    /// The map to the world from something at `below` in the space of `anchor` (of glTF's world, if that is none), which is hidden
    /// when the node `seen` is.
    pub fn seen_place(&self, seen: u32, anchor: Option<u32>, below: DAffine3) -> Result<Motion, Fault> {
        let mut chain = self.chain(anchor)?;
        chain.push(Link::Fixed(below));
        if self.blinks(seen) {
            let mut next = Some(seen);
            while let Some(node) = next {
                self.data.spend(1, size_of::<Link>())?;
                let moves = self.animations.of(node).and_then(|moves| moves.is_visible.as_ref());
                if let Some(channel) = moves.filter(|channel| !channel.is_rest()) {
                    chain.push(Link::Visible(channel.clone()));
                }
                next = self.hierarchy.parents[node as usize];
            }
        }
        Ok(chain.motion())
    }

    fn chain(&self, node: Option<u32>) -> Result<Chain, Fault> {
        let mut path = Vec::new();
        let mut next = node;
        while let Some(node) = next {
            self.data.spend(1, size_of::<Link>())?;
            path.push(node);
            next = self.parent(node);
        }
        let mut chain = Chain::default();
        chain.push(Link::Fixed(self.world_from_gltf));
        for (at, &node) in path.iter().rev().enumerate() {
            if at == 0 {
                self.top_links(node).into_iter().for_each(|link| chain.push(link));
            } else {
                chain.push(self.link(node));
            }
        }
        Ok(chain)
    }

    /// The parent of a node, unless a trajectory moves the node: then it has no place in its parent.
    fn parent(&self, node: u32) -> Option<u32> {
        self.hierarchy.parents[node as usize].filter(|_| !self.driven.contains_key(&node))
    }

    /// CESIUM_RTC.
    fn gltf_from_file(&self) -> DAffine3 {
        DAffine3::from_translation(DVec3::from_array(self.document.origin))
    }

    /// The map to glTF's world from a node without a [`Self::parent`].
    fn top_links(&self, node: u32) -> Vec<Link> {
        match self.driven.get(&node) {
            None => vec![Link::Fixed(self.gltf_from_file()), self.link(node)],
            Some((trajectory, scale)) => vec![
                Link::Fixed(self.world_from_gltf.inverse()),
                rigid(trajectory),
                Link::Fixed(self.world_from_gltf * DAffine3::from_scale(*scale)),
            ],
        }
    }

    /// The map from a node to its parent.
    fn link(&self, node: u32) -> Link {
        let local = self.hierarchy.locals[node as usize];
        let Some(moves) = self.animations.of(node).filter(|moves| moves.place_moves()) else {
            return Link::Fixed(local.map());
        };
        let (translation, rotation, scale) = local.parts();
        fn channel<T: Clone>(own: &Option<Channel<T>>, rest: T) -> Channel<T> {
            own.clone().filter(|own| !own.is_rest()).unwrap_or_else(|| Channel::rest(rest))
        }
        Link::Animated {
            translation: channel(&moves.translation, translation),
            rotation: channel(&moves.rotation, rotation),
            scale: channel(&moves.scale, scale),
        }
    }

    /// Nodes as they are seen from the lowest node that is above all of them, or is one of them.
    pub fn bones(&self, asked: &[u32]) -> Result<Bones, Fault> {
        let anchor = self.common(asked)?;
        let mut numbers: BTreeMap<u32, u32> = BTreeMap::new();
        let mut bones = Vec::new();
        let mut path = Vec::new();
        for &node in asked {
            let mut next = Some(node);
            while let Some(node) = next
                && Some(node) != anchor
                && !numbers.contains_key(&node)
            {
                path.push(node);
                next = self.parent(node);
            }
            while let Some(node) = path.pop() {
                self.data.spend(1, size_of::<Bone>() + size_of::<Link>())?;
                let parent = self.parent(node).and_then(|parent| numbers.get(&parent)).copied();
                let is_top = parent.is_none() && anchor.is_none();
                let links = if is_top { self.top_links(node) } else { vec![self.link(node)] };
                numbers.insert(node, bones.len() as u32);
                bones.push(Bone { parent, motion: Motion { links } });
            }
        }
        let asked = asked.iter().map(|node| numbers.get(node).copied()).collect();
        Ok(Bones { anchor, bones, asked })
    }

    /// The lowest node that is at or above all of some nodes.
    fn common(&self, nodes: &[u32]) -> Result<Option<u32>, Fault> {
        let parent = |node: &u32| self.parent(*node);
        let Some((&first, others)) = nodes.split_first() else { return Ok(None) };
        let path: Vec<u32> = std::iter::successors(Some(first), parent).collect();
        self.data.spend(path.len(), size_of::<u32>())?;
        let depth: BTreeMap<u32, usize> =
            path.iter().rev().zip(0..).map(|(&node, depth)| (node, depth)).collect();
        let mut lowest = path.len() - 1;
        let mut known = BTreeSet::new();
        for &node in others {
            let mut next = Some(node);
            loop {
                let Some(node) = next else { return Ok(None) };
                if let Some(&depth) = depth.get(&node) {
                    lowest = lowest.min(depth);
                    break;
                }
                if !known.insert(node) {
                    break;
                }
                self.data.spend(1, size_of::<u64>())?;
                next = parent(&node);
            }
        }
        Ok(Some(path[path.len() - 1 - lowest]))
    }
}
