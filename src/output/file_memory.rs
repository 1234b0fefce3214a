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
    formats: Mutex<BTreeMap<&'static str, OfFormat>>,
}

/// The memory of the files of a format.
#[derive(Debug, Default)]
struct OfFormat {
    free: Vec<Vec<u8>>,
    /// The number of files whose memory was taken here and did not come back yet.
    taken: usize,
}

impl FileMemory {
    /// Empty memory for a file of a format, that of an earlier one if there is some.
    pub fn take(&self, format: &'static str) -> Vec<u8> {
        let mut formats = self.formats.lock().unwrap_or_else(PoisonError::into_inner);
        let OfFormat { free, taken } = formats.entry(format).or_default();
        *taken += 1;
        free.pop().unwrap_or_default()
    }

    /// Gives back the memory of a file of a format. It is freed if the format takes none here: nobody would take it again, and a run
    /// would grow with each frame.
    pub fn give_back(&self, format: &'static str, mut content: Vec<u8>) {
        let mut formats = self.formats.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(OfFormat { free, taken }) = formats.get_mut(format)
            && *taken > 0
        {
            *taken -= 1;
            content.clear();
            free.push(content);
        }
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
    /// Memory that is kept is that of files which were there at the same time, however many come.
    #[test]
    fn memory_that_no_file_takes_is_freed() {
        let memory = FileMemory::default();
        let kept = |format| {
            let formats = memory.formats.lock().unwrap();
            formats.get(format).map_or(0, |of_format: &OfFormat| of_format.free.len())
        };
        for _ in 0..100 {
            memory.give_back("png", vec![7; 1000]);
            let both = [memory.take("ply"), memory.take("ply")];
            both.into_iter().for_each(|content| memory.give_back("ply", content));
        }
        memory.give_back("ply", vec![7; 1000]);
        assert_eq!((kept("png"), kept("ply")), (0, 2));
    }
}
