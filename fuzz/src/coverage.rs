//! The counts of the edges of the program that were taken, which LLVM's SanitizerCoverage keeps.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU8, Ordering};

/// The counters of each module of the program, as they announce themselves before `main`: address and number.
static MODULES: Mutex<Vec<(usize, usize)>> = Mutex::new(Vec::new());

/// Called by the constructor of each module that was compiled with counters.
///
/// # Safety
/// The two pointers are the bounds of an array that lives as long as the process.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn __sanitizer_cov_8bit_counters_init(start: *const AtomicU8, stop: *const AtomicU8) {
    let mut modules = MODULES.lock().unwrap();
    let module = (start as usize, stop as usize - start as usize);
    if module.1 > 0 && !modules.contains(&module) {
        modules.push(module);
    }
}

/// The edges that were seen, and how often in one run: in classes, as loops of ten and of eleven rounds say the same.
#[derive(Default)]
pub struct Coverage {
    seen: Vec<u8>,
}

impl Coverage {
    /// Whether there are counters at all.
    pub fn is_counted() -> bool {
        !MODULES.lock().unwrap().is_empty()
    }

    /// Takes the counts of a run and sets them back. Returns whether there was something new in them.
    pub fn take(&mut self) -> bool {
        let modules = MODULES.lock().unwrap();
        let total: usize = modules.iter().map(|(_, count)| count).sum();
        self.seen.resize(total, 0);
        let mut is_new = false;
        let mut seen = self.seen.iter_mut();
        for &(start, count) in modules.iter() {
            // SAFETY: the module that announced the counters is part of the program. Its own code adds to them without
            // synchronisation, and a count that is lost is no harm.
            let counters = unsafe { std::slice::from_raw_parts(start as *const AtomicU8, count) };
            for (counter, seen) in counters.iter().zip(&mut seen) {
                let value = counter.load(Ordering::Relaxed);
                if value != 0 {
                    counter.store(0, Ordering::Relaxed);
                    let class = 1 << value.ilog2();
                    is_new |= *seen & class == 0;
                    *seen |= class;
                }
            }
        }
        is_new
    }

    /// The number of edges that were seen.
    pub fn edges(&self) -> usize {
        self.seen.iter().filter(|classes| **classes != 0).count()
    }
}
