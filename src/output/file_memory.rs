//! The memory of files that are written, for files to come.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// The memory of the contents of files, by the name of their format. A run gives it back once a file is written, and a later file
/// of the format is encoded into it.
///
/// New memory of a large file costs a fault of the processor for each page of it. That was a tenth of the time of a camera's
/// frames, whose points are 83 MB.
#[derive(Debug, Default)]
pub struct FileMemory {
    free: Mutex<BTreeMap<&'static str, Vec<Vec<u8>>>>,
}

impl FileMemory {
    /// Empty memory for a file of a format, that of an earlier one if there is some.
    pub fn take(&self, format: &'static str) -> Vec<u8> {
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        free.get_mut(format).and_then(Vec::pop).unwrap_or_default()
    }

    /// Gives back the memory of a file of a format.
    pub fn give_back(&self, format: &'static str, mut content: Vec<u8>) {
        content.clear();
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        free.entry(format).or_default().push(content);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_comes_back_empty_and_to_its_format() {
        let memory = FileMemory::default();
        assert_eq!(memory.take("ply").capacity(), 0);
        let content = vec![7; 1000];
        let (address, capacity) = (content.as_ptr(), content.capacity());
        memory.give_back("ply", content);
        assert_eq!(memory.take("exr").capacity(), 0);
        let again = memory.take("ply");
        assert_eq!((again.as_ptr(), again.capacity(), again.len()), (address, capacity, 0));
        assert_eq!(memory.take("ply").capacity(), 0, "memory is given to one file at a time");
    }
}
