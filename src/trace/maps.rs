//! The maps of placements that move, at the times of rays. Many rays have the same time, such as the beams of a column, and neighbours
//! come again with the times of neighbours, so the latest maps are kept.

use glam::DAffine3;

use crate::scene::Placement;

/// The number of maps that are kept: those of a few placements at the times of the columns of a strip. They take 60 KiB.
const SLOTS: usize = 512;

/// The latest maps. They hold for one arrangement.
#[derive(Default)]
pub(super) struct Maps {
    /// The placement and the bits of the time of each slot's map. It is empty as long as nothing moves.
    keys: Vec<(u32, u64)>,
    maps: Vec<Option<DAffine3>>,
}

impl Maps {
    /// No placement moves, so none has this number.
    const NONE: (u32, u64) = (0, 0);

    /// Forgets all maps.
    pub fn clear(&mut self) {
        self.keys.clear();
        self.keys.resize(SLOTS, Self::NONE);
        self.maps.resize(SLOTS, None);
    }

    /// The map from the scene's space to that of placement `number`, at a ray's time if the placement moves. `None` if it is nowhere
    /// then.
    #[inline(always)]
    pub fn of<'m>(
        &'m mut self,
        number: u32,
        placement: &'m Placement,
        time_s: Option<f64>,
    ) -> Option<&'m DAffine3> {
        if placement.is_moving() {
            self.at(number, placement, time_s?)
        } else {
            Some(placement.mesh_from_scene())
        }
    }

    /// The map of a placement that moves. Kept out of the loops over placements, few of which do.
    #[inline(never)]
    fn at(&mut self, number: u32, placement: &Placement, time_s: f64) -> Option<&DAffine3> {
        let key = (number, time_s.to_bits());
        let mixed = (key.1 ^ u64::from(number) << 40).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let slot = (mixed >> (64 - SLOTS.ilog2())) as usize;
        if self.keys[slot] != key {
            (self.keys[slot], self.maps[slot]) = (key, placement.mesh_from_scene_at(time_s));
        }
        self.maps[slot].as_ref()
    }
}
