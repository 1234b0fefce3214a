//! Huge pages for large hierarchies. A ray visits places all over a hierarchy, each of which takes an entry of the processor's table of
//! pages; with pages of 2 MiB far fewer entries do.

use std::ffi::{c_int, c_void};

/// The size of a huge page on x86-64, in bytes.
const HUGE: usize = 1 << 21;

/// The advice of that name in Linux's `madvise`.
const MADV_HUGEPAGE: c_int = 14;

unsafe extern "C" {
    fn madvise(address: *mut c_void, length: usize, advice: c_int) -> c_int;
}

/// Asks the system to put the memory that a vector has reserved on huge pages, as far as it covers whole ones. It is best asked before
/// the memory is written to. Nothing but speed depends on the answer, so a refusal is no error.
pub(in crate::trace) fn prefer_huge_pages<T>(vector: &mut Vec<T>) {
    let start: *mut c_void = vector.as_mut_ptr().cast();
    let bytes = vector.capacity() * size_of::<T>();
    let before = start.addr().next_multiple_of(HUGE) - start.addr();
    if before + HUGE <= bytes {
        let whole = (bytes - before) / HUGE * HUGE;
        // SAFETY: the range lies within the vector's own memory, and this advice changes nothing that is in it.
        unsafe { madvise(start.wrapping_byte_add(before), whole, MADV_HUGEPAGE) };
    }
}
