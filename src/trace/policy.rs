//! How many rays are tried as one packet: what packets cost, beside what the same rays would cost one by one.
//!
//! Rays that are far apart have nothing in common in a detailed scene: a packet of them visits all that any of them meets, and
//! tests each of it against all of them. How far apart is too far depends on the scene, so no angle tells. The tracer finds
//! out as it goes: a packet that has already cost more than its rays are expected to cost one by one is given up, its rays are
//! cast one by one. When such packets have cost more than the others saved, the next packets are smaller. Larger ones are tried
//! again later, ever more seldom as long as they do not pay. Hits do not depend on any of this, because packets and single rays give the same.
//!
//! Work is estimated from counts of what was visited, never from a clock. A unit is about a nanosecond on a processor of 2024;
//! only the ratios of the weights below matter. They were fitted to `cargo bench --bench resolutions -- --counts`.

use super::batch::PACKET_RAYS;
use super::stats::TraversalStats;

/// The work of a packet's visit to a node, and of its look at a leaf.
pub(super) const PACKET_NODE: u64 = 45;
pub(super) const PACKET_LEAF: u64 = 30;
/// The work of a leaf that some rays of a packet reach, beside its tests, each of which is a unit.
pub(super) const PACKET_LEAF_MET: u64 = 40;
/// The work of one ray of a packet that is prepared for a mesh.
pub(super) const PACKET_RAY: u64 = 8;
/// The work of one ray that is carried to a placement by the map of its own time.
pub(super) const MOVING_RAY: u64 = 20;

/// The work of a single ray beside its visits.
const SINGLE_RAY: u64 = 60;
/// The work of a single ray's visit to a node, to a leaf, and of carrying it to a placement.
const STREAM_NODE: u64 = 9;
const SINGLE_LEAF: u64 = 10;
const SINGLE_PLACEMENT: u64 = 40;

/// The fewest rays of a smaller packet that is tried in place of a larger one that was given up.
pub(super) const LEAST: usize = 16;

/// A packet is given up at so many times the work of its rays one by one. It is above 1 because the estimates are rough, and
/// because most of a packet's work may be done by then.
const PATIENCE: f64 = 1.5;

/// How far packets may be in credit: what so many rays cost one by one. What was saved in one part of an image is soon no
/// reason to lose as much in another.
const MOST_CREDIT_RAYS: f64 = 8.0 * PACKET_RAYS as f64;

/// Packets that cost less than this a ray are better than single rays in any scene.
const CHEAP: u64 = 60;

/// The most tiles between two measurements of single rays where packets are not cheap.
const SAMPLE_EVERY: u32 = 256;

/// A thread's experience with packets.
#[derive(Clone, Debug)]
pub(super) struct PacketPolicy {
    /// The most rays that are tried as a packet: [`PACKET_RAYS`], a power of two from [`LEAST`] on, or 0.
    most: usize,
    /// The tiles until larger packets are tried, and how many there will be if these are given up.
    wait: u32,
    next_wait: u32,
    /// Larger packets are tried now than before, and none of them is cast yet.
    grew: bool,
    /// The work that packets saved, less what was lost on those that were given up.
    credit: f64,
    /// The work of a single ray, as far as is known.
    single: f64,
    /// The tiles since single rays were last cast.
    unsampled: u32,
    /// The next tile is cast ray by ray, to measure it.
    samples: bool,
}

impl Default for PacketPolicy {
    fn default() -> Self {
        // Nothing is known of single rays, so they are measured as soon as a packet is not cheap.
        Self {
            most: PACKET_RAYS,
            wait: 0,
            next_wait: 1,
            grew: false,
            credit: 0.0,
            single: 300.0,
            unsampled: SAMPLE_EVERY,
            samples: false,
        }
    }
}

impl PacketPolicy {
    /// Begins a tile. Returns the most rays that are to be tried as a packet in it, or 0 if all are to be cast one by one.
    #[inline(always)]
    pub fn begin_tile(&mut self) -> usize {
        self.unsampled = self.unsampled.saturating_add(1);
        if std::mem::take(&mut self.samples) {
            return 0;
        }
        if self.most < PACKET_RAYS {
            if self.wait == 0 {
                self.most = (2 * self.most).max(LEAST);
                // Savings of smaller packets are no reason to lose as much on larger ones, but one loss is no proof.
                self.credit = PATIENCE * self.single * self.most as f64;
                self.wait = self.next_wait;
                self.grew = true;
            } else {
                self.wait -= 1;
            }
        }
        self.most
    }

    /// The most rays that are tried as a packet now.
    #[inline(always)]
    pub fn most(&self) -> usize {
        self.most
    }

    /// The work at which a packet of so many rays is given up.
    #[inline(always)]
    pub fn budget(&self, rays: usize) -> u64 {
        (PATIENCE * self.single * rays as f64) as u64
    }

    /// The work of so many rays one by one, as far as is known.
    #[inline(always)]
    pub fn single_work(&self, rays: usize) -> u64 {
        (self.single * rays as f64) as u64
    }

    /// A packet of so many rays was given up.
    #[cold]
    pub fn gave_up(&mut self, rays: usize) {
        self.credit -= PATIENCE * self.single * rays as f64;
        if self.credit > -1e-6 * self.single {
            return;
        }
        (self.credit, self.grew) = (0.0, false);
        self.most = if rays / 2 >= LEAST { (rays / 2).next_power_of_two().min(self.most) } else { 0 };
        // Two packets of the next larger size, which are given up at one and a half times their rays' work, in as many tiles as
        // they have rays: a loss of two percent. Small packets, which lose little, are so tried again soon.
        let longest = (2 * self.most).max(LEAST) as u32;
        self.wait = self.next_wait.min(longest);
        self.next_wait = (2 * self.next_wait).min(longest);
    }

    /// A packet of so many rays was cast for so much work.
    #[inline(always)]
    pub fn succeeded(&mut self, rays: usize, work: u64) {
        let saved = self.single * rays as f64 - work as f64;
        self.credit = (self.credit + saved).min(MOST_CREDIT_RAYS * self.single);
        if self.grew && rays >= self.most {
            self.grew = false;
            self.next_wait = (self.next_wait / 2).max(1);
            self.wait = self.wait.min(self.next_wait);
        }
        if work > CHEAP * rays as u64 && self.unsampled > SAMPLE_EVERY {
            (self.unsampled, self.samples) = (0, true);
        }
    }

    /// So many single rays were cast with so many visits, and were carried to a placement so many times.
    #[inline(always)]
    pub fn measured(&mut self, rays: usize, effort: TraversalStats, carried: u64) {
        let visits = STREAM_NODE * effort.nodes + SINGLE_LEAF * effort.leaves;
        let work = SINGLE_RAY * rays as u64 + visits + SINGLE_PLACEMENT * carried;
        // The memory of about a thousand rays.
        let share = (rays as f64 / 1024.0).min(1.0);
        self.single += share * (work as f64 / rays as f64 - self.single);
        self.unsampled = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Casts tiles of [`PACKET_RAYS`] rays, of which packets of more than `good` rays cost more than they may, and smaller ones
    /// a quarter of single rays. Returns the rays that were cast as packets, singly, and in packets that were given up.
    fn cast(policy: &mut PacketPolicy, tiles: usize, good: usize) -> [usize; 3] {
        let mut rays = [0; 3];
        for _ in 0..tiles {
            let mut left = if policy.begin_tile() == 0 { 0 } else { PACKET_RAYS };
            rays[1] += PACKET_RAYS - left;
            while left > 0 {
                let packet = policy.most().min(left);
                if packet == 0 {
                    rays[1] += left;
                    break;
                }
                left -= packet;
                if packet <= good {
                    policy.succeeded(packet, policy.single_work(packet) / 4);
                    rays[0] += packet;
                } else {
                    policy.gave_up(packet);
                    rays[1] += packet;
                    rays[2] += packet;
                }
            }
        }
        rays
    }

    #[test]
    fn packets_that_do_not_pay_are_hardly_ever_tried() {
        let mut policy = PacketPolicy::default();
        let [packets, single, lost] = cast(&mut policy, 4000, 0);
        assert_eq!((packets, single), (0, 4000 * PACKET_RAYS));
        assert!(lost * 50 < single, "{lost} of {single} rays were tried in vain");
    }

    #[test]
    fn packets_are_as_large_as_pays() {
        let mut policy = PacketPolicy::default();
        for good in [16, 32, 64, 128] {
            let all = 4000 * PACKET_RAYS;
            let [packets, _, lost] = cast(&mut policy, 4000, good);
            assert!(packets * 100 > all * 95, "{good}: {packets} of {all} rays are cast in packets");
            assert!(lost * 50 < all, "{good}: {lost} of {all} rays were tried in vain");
        }
    }

    /// A few tiles of a fine image are no reason to cast the others ray by ray.
    #[test]
    fn a_loss_is_paid_from_what_was_saved() {
        let mut policy = PacketPolicy::default();
        cast(&mut policy, 100, PACKET_RAYS);
        for _ in 0..100 {
            let [_, single, _] = cast(&mut policy, 1, 0);
            assert_eq!(single, PACKET_RAYS);
            let [packets, single, _] = cast(&mut policy, 9, PACKET_RAYS);
            assert!(single <= PACKET_RAYS && packets >= 8 * PACKET_RAYS, "{packets}, {single}");
        }
    }

    #[test]
    fn costs_of_single_rays_are_learned_where_packets_are_dear() {
        let mut policy = PacketPolicy::default();
        assert_eq!(policy.begin_tile(), PACKET_RAYS);
        policy.succeeded(PACKET_RAYS, 200 * PACKET_RAYS as u64);
        assert_eq!(policy.begin_tile(), 0);
        let effort = TraversalStats { nodes: 4 * 1024, leaves: 1024, ..TraversalStats::default() };
        policy.measured(1024, effort, 0);
        assert_eq!(policy.single_work(1), SINGLE_RAY + 4 * STREAM_NODE + SINGLE_LEAF);
        assert_eq!(policy.begin_tile(), PACKET_RAYS);
        policy.succeeded(PACKET_RAYS, 200 * PACKET_RAYS as u64);
        assert_eq!(policy.begin_tile(), PACKET_RAYS, "it was measured just now");
    }
}
