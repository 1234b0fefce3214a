//! The memory that casting works in.

use glam::DVec3;

use super::batch::NearestHits;
use super::bvh::Child;
use super::maps::Maps;
use super::packet::{PacketStack, RayData};
use super::policy::PacketPolicy;
use super::single::RayStack;
use super::stats::TraversalStats;
use super::stream::RayStream;

/// The memory that casting works in, kept from packet to packet and from cast to cast.
#[derive(Default)]
pub(super) struct Scratch {
    /// The traversal stacks of packets in the hierarchy over placements and in that of a mesh.
    pub top: PacketStack,
    pub mesh: PacketStack,
    /// Directions and origins in the space of a placement.
    pub directions: Vec<DVec3>,
    pub origins: Vec<DVec3>,
    /// The data of a packet's rays in the scene's space and in that of a mesh.
    pub rays: RayData,
    pub mesh_rays: RayData,
    pub single: SingleScratch,
    /// The experience with rays of the kind that is cast now.
    pub policy: PacketPolicy,
    /// The experience with rays of the other kind.
    other_policy: PacketPolicy,
    /// Whether the rays that are cast now have origins of their own.
    origins_differ: bool,
    pub part: PartScratch,
}

/// The rays of a packet that visit a placement, if others of it do not, in the scene's space.
pub(super) struct PartScratch {
    pub directions: Vec<DVec3>,
    /// The origins, if they differ.
    pub origins: Vec<DVec3>,
    /// Their numbers in the packet.
    pub numbers: Vec<u8>,
    pub nearest: NearestHits,
}

impl Default for PartScratch {
    fn default() -> Self {
        Self {
            directions: Vec::new(),
            origins: Vec::new(),
            numbers: Vec::new(),
            nearest: NearestHits::new(0.0),
        }
    }
}

impl Scratch {
    /// New memory. This is kept out of casting, so that its temporary copy is not on the stack of that.
    #[cold]
    #[inline(never)]
    pub fn boxed() -> Box<Self> {
        Box::default()
    }

    /// Begins to cast rays that have origins of their own, or one in common. These kinds take turns where light goes on from surfaces,
    /// and what pays for one says little of the other.
    pub fn begin(&mut self, origins_differ: bool) {
        if self.origins_differ != origins_differ {
            std::mem::swap(&mut self.policy, &mut self.other_policy);
            self.origins_differ = origins_differ;
        }
    }

    /// The work that was done in this memory so far.
    pub fn stats(&self) -> TraversalStats {
        let mut stats =
            TraversalStats { nodes: self.top.visited + self.mesh.visited, ..TraversalStats::default() };
        for more in [self.rays.stats(), self.mesh_rays.stats(), self.single.stats()] {
            stats += more;
        }
        stats
    }
}

/// The memory for rays in no packet.
#[derive(Default)]
pub(super) struct SingleScratch {
    pub top: RayStack,
    pub mesh: RayStack,
    pub stream: RayStream,
    pub maps: Maps,
    pub scalar: ScalarScratch,
}

impl SingleScratch {
    /// The work that was done in this memory so far.
    pub fn stats(&self) -> TraversalStats {
        let mut stats = self.top.stats;
        stats += self.mesh.stats;
        stats += self.stream.stats();
        stats
    }
}

/// The traversal stacks of a ray that is cast in f64.
#[derive(Default)]
pub(super) struct ScalarScratch {
    pub top: Vec<(Child, f64)>,
    pub mesh: Vec<(Child, f64)>,
}
