//! The ids by which outputs call objects and triangles.

/// The id by which outputs call the object or triangle with this index. Ids count from 1, so that 0 always means nothing:
/// the id of [`NO_OBJECT`](crate::scan::NO_OBJECT). There are fewer than 2³² of either.
pub const fn id_of(index: u32) -> u32 {
    index.wrapping_add(1)
}

/// The index of the object or triangle that outputs call by this id. `None` for 0, which means nothing.
pub const fn index_of(id: u32) -> Option<u32> {
    id.checked_sub(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_count_from_1_and_0_is_nothing() {
        assert_eq!([0, 6, u32::MAX - 1, crate::scan::NO_OBJECT].map(id_of), [1, 7, u32::MAX, 0]);
        assert_eq!([0, 1, 7, u32::MAX].map(index_of), [None, Some(0), Some(6), Some(u32::MAX - 1)]);
    }
}
