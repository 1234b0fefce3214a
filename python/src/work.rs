//! Work without Python's lock, on threads of its own, that Ctrl-C stops.

use std::num::NonZero;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use beamcast::Progress;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::MOST_THREADS;

/// How long a signal of Python waits for its handler.
const PATIENCE: Duration = Duration::from_millis(20);

/// Pools that are kept for the next call.
const KEPT: usize = 4;

/// A pool, the process that it was made in, and its number of threads.
struct Kept {
    process: u32,
    threads: usize,
    pool: Arc<ThreadPool>,
}

static POOLS: Mutex<Vec<Kept>> = Mutex::new(Vec::new());

/// A pool of so many threads; 0 is one a core, or as many as RAYON_NUM_THREADS says.
///
/// Rayon's own pool is never used: its threads do not live on in a process that was forked, as PyTorch's loaders and Python's
/// multiprocessing do, and work would wait for them for ever. The lock is only taken while Python's own lock is held, so no fork
/// finds it taken.
fn pool(threads: usize) -> PyResult<Arc<ThreadPool>> {
    let threads = if threads == 0 { by_default() } else { threads };
    let process = std::process::id();
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    // The pools of the process that this one was forked from have no threads that could end.
    for kept in std::mem::take(&mut *pools) {
        if kept.process == process { pools.push(kept) } else { std::mem::forget(kept) }
    }
    if let Some(place) = pools.iter().position(|kept| kept.threads == threads) {
        let kept = pools.remove(place);
        let pool = Arc::clone(&kept.pool);
        pools.push(kept);
        return Ok(pool);
    }
    let built =
        ThreadPoolBuilder::new().num_threads(threads).thread_name(|k| format!("beamcast-{k}")).build();
    let pool = built.map(Arc::new).map_err(|problem| {
        PyRuntimeError::new_err(format!(
            "{threads} threads can't be had: {problem}; threads=N asks for fewer"
        ))
    })?;
    if pools.len() == KEPT {
        pools.remove(0);
    }
    pools.push(Kept { process, threads, pool: Arc::clone(&pool) });
    Ok(pool)
}

fn by_default() -> usize {
    let environment = std::env::var("RAYON_NUM_THREADS").ok().and_then(|text| text.parse::<usize>().ok());
    let cores = || std::thread::available_parallelism().map_or(1, NonZero::get);
    environment.filter(|threads| *threads > 0).unwrap_or_else(cores).min(MOST_THREADS)
}

/// Does work on so many threads, while other threads of Python run. When a signal's handler raises, as that of Ctrl-C does, the
/// progress is cancelled, and the exception is the error. So is a panic, which is a mistake of beamcast.
pub fn on_threads<T: Send>(
    py: Python<'_>,
    threads: usize,
    work: impl FnOnce(&Progress) -> T + Send,
) -> PyResult<T> {
    let pool = pool(threads)?;
    let progress = Progress::default();
    let mut raised = None;
    let outcome = py.detach(|| {
        let (send, receive) = channel();
        let (progress, raised) = (&progress, &mut raised);
        pool.in_place_scope(|scope| {
            scope.spawn(move |_| {
                let outcome = catch_unwind(AssertUnwindSafe(|| work(progress)));
                // The receiver waits for it.
                let _ = send.send(outcome);
            });
            loop {
                match receive.recv_timeout(PATIENCE) {
                    Ok(outcome) => return Some(outcome),
                    Err(RecvTimeoutError::Disconnected) => return None,
                    Err(RecvTimeoutError::Timeout) if raised.is_none() => {
                        *raised = Python::attach(|py| py.check_signals()).err();
                        progress.cancelled.store(raised.is_some(), Ordering::Relaxed);
                    }
                    Err(RecvTimeoutError::Timeout) => {}
                }
            }
        })
    });
    match (raised, outcome) {
        (Some(error), _) => Err(error),
        (None, Some(Ok(value))) => Ok(value),
        (None, Some(Err(panic))) => Err(mistake(
            panic.downcast_ref::<&str>().copied().or(panic.downcast_ref::<String>().map(String::as_str)),
        )),
        (None, None) => Err(mistake(None)),
    }
}

/// The exception that a panic becomes.
fn mistake(message: Option<&str>) -> PyErr {
    let message = message.unwrap_or("a panic");
    PyRuntimeError::new_err(format!("this is a mistake of beamcast, please report it: {message}"))
}
