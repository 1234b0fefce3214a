//! Stopping on SIGINT (Ctrl-C), SIGTERM and SIGHUP, with nothing half-written.

use std::io::{self, Write};
use std::sync::atomic::{AtomicI32, Ordering};
use std::sync::{Arc, PoisonError, RwLock, TryLockError};
use std::thread;
use std::time::Duration;

use crate::error::Error;
use crate::scan::Progress;

/// Watches for the signals that ask to stop.
///
/// Work stops in two ways. A scan looks at [`Progress::cancelled`] all the time, and all other work calls
/// [`check`](Self::check) between its steps. The process ends during a step that takes too long for that, such as loading a
/// large scene, but not while a file is being written: files are written through [`uncut`](Self::uncut).
#[derive(Clone, Debug, Default)]
pub struct Interrupt {
    shared: Arc<Shared>,
}

#[derive(Debug, Default)]
struct Shared {
    /// The first signal that came, or 0.
    signal: AtomicI32,
    progress: Progress,
    /// Read while files are written, of which several can be at a time.
    uncut: RwLock<()>,
}

impl Interrupt {
    /// Starts to watch, for the rest of the process.
    ///
    /// # Errors
    /// [`Error::Usage`] if the system refuses.
    pub fn watch() -> Result<Self, Error> {
        let interrupt = Self::default();
        system::watch(interrupt.shared.clone())
            .map_err(|e| Error::Usage(format!("signals can't be watched: {e}")))?;
        Ok(interrupt)
    }

    /// The progress of scans, by which they are stopped.
    pub fn progress(&self) -> &Progress {
        &self.shared.progress
    }

    /// Checks whether to go on.
    ///
    /// # Errors
    /// [`Error::Interrupted`] once a signal has come.
    pub fn check(&self) -> Result<(), Error> {
        match self.shared.signal.load(Ordering::SeqCst) {
            0 => Ok(()),
            signal => Err(Error::Interrupted { signal }),
        }
    }

    /// Does work during which the process should not end: a signal waits for it, but not for ever.
    pub fn uncut<T>(&self, work: impl FnOnce() -> T) -> T {
        let _held = self.shared.uncut.read().unwrap_or_else(PoisonError::into_inner);
        work()
    }
}

/// The time that work has to end by itself.
const GRACE: Duration = Duration::from_millis(700);

/// The steps of waiting for a file that is being written, and their number.
const STEP: Duration = Duration::from_millis(20);
const PATIENCE: usize = 50;

/// Starts a thread that waits for a signal, as `next` does, and then has the process end.
fn spawn(shared: Arc<Shared>, next: impl FnOnce() -> Option<i32> + Send + 'static) -> io::Result<()> {
    thread::Builder::new().name("signals".into()).spawn(move || {
        let Some(signal) = next() else { return };
        shared.signal.store(signal, Ordering::SeqCst);
        shared.progress.cancelled.store(true, Ordering::Relaxed);
        thread::sleep(GRACE);
        // A file that is being written is finished first. One that takes longer, such as a pipe that nobody reads, is given up;
        // it has no name yet.
        for _ in 0..PATIENCE {
            match shared.uncut.try_write() {
                Err(TryLockError::WouldBlock) => thread::sleep(STEP),
                _ => break,
            }
        }
        let error = Error::Interrupted { signal };
        let _ = writeln!(io::stderr(), "error: {error}");
        std::process::exit(error.exit_code().into());
    })?;
    Ok(())
}

#[cfg(unix)]
mod unix {
    use std::io;
    use std::sync::Arc;

    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    use crate::cli::interrupt::{Shared, spawn};

    pub fn watch(shared: Arc<Shared>) -> io::Result<()> {
        // A signal that is watched is no longer ignored, and whoever started the process with `nohup` wants it to go on.
        let hangup = (!is_ignored(SIGHUP)).then_some(SIGHUP);
        let mut signals = Signals::new([SIGINT, SIGTERM].into_iter().chain(hangup))?;
        spawn(shared, move || signals.forever().next())
    }

    /// Whether the process was started with a signal ignored. Linux tells; elsewhere no signal is known to be.
    fn is_ignored(signal: i32) -> bool {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
        mask >> (signal - 1) & 1 == 1
    }

    /// Lets a write beyond the limit of file sizes (`ulimit -f`) fail with an error, where the signal for it would end the
    /// process without a word.
    pub fn outlive_file_limits() {
        // A signal that has an action does nothing but set the flag. If the system refuses, all is as it would be.
        let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
    }
}

/// Windows tells of Ctrl-C as SIGINT, but has nothing that a thread could wait on: a flag is looked at again and again.
#[cfg(not(unix))]
mod elsewhere {
    use std::io;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::thread;

    use signal_hook::consts::{SIGINT, SIGTERM};

    use crate::cli::interrupt::{STEP, Shared, spawn};

    pub fn watch(shared: Arc<Shared>) -> io::Result<()> {
        let came = Arc::new(AtomicUsize::new(0));
        for signal in [SIGINT, SIGTERM] {
            signal_hook::flag::register_usize(signal, Arc::clone(&came), signal as usize)?;
        }
        spawn(shared, move || {
            loop {
                match came.load(Ordering::SeqCst) {
                    0 => thread::sleep(STEP),
                    signal => return i32::try_from(signal).ok(),
                }
            }
        })
    }

    /// Does nothing: files have no such limit.
    pub fn outlive_file_limits() {}
}

#[cfg(not(unix))]
use elsewhere as system;
#[cfg(unix)]
use unix as system;

pub use system::outlive_file_limits;
