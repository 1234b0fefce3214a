//! Stopping on SIGINT and SIGTERM, with nothing half-written.

use std::sync::atomic::{AtomicI32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::Error;
use crate::scan::Progress;

/// Watches for the signals that ask to stop.
///
/// Work stops in two ways. A scan looks at [`Progress::cancelled`] all the time, and all other work calls
/// [`check`](Self::check) between its steps. The process ends during a step that takes too long for that, such as loading a
/// large scene, but never while a file is being written: files are written through [`uncut`](Self::uncut).
#[derive(Clone, Debug, Default)]
pub struct Interrupt {
    shared: Arc<Shared>,
}

#[derive(Debug, Default)]
struct Shared {
    /// The first signal that came, or 0.
    signal: AtomicI32,
    progress: Progress,
    uncut: Mutex<()>,
}

impl Interrupt {
    /// Starts to watch, for the rest of the process.
    ///
    /// # Errors
    /// [`Error::Usage`] if the system refuses.
    pub fn watch() -> Result<Self, Error> {
        let interrupt = Self::default();
        #[cfg(unix)]
        unix::watch(interrupt.shared.clone())
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

    /// Does work during which the process must not end.
    pub fn uncut<T>(&self, work: impl FnOnce() -> T) -> T {
        let _held = self.shared.uncut.lock().unwrap_or_else(PoisonError::into_inner);
        work()
    }
}

#[cfg(unix)]
mod unix {
    use std::io::{self, Write};
    use std::sync::atomic::Ordering;
    use std::sync::{Arc, PoisonError};
    use std::thread;
    use std::time::Duration;

    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    use crate::cli::interrupt::Shared;
    use crate::error::Error;

    /// The time that work has to end by itself.
    const GRACE: Duration = Duration::from_millis(700);

    pub fn watch(shared: Arc<Shared>) -> io::Result<()> {
        let mut signals = Signals::new([SIGINT, SIGTERM])?;
        thread::Builder::new().name("signals".into()).spawn(move || {
            let Some(signal) = signals.forever().next() else { return };
            shared.signal.store(signal, Ordering::SeqCst);
            shared.progress.cancelled.store(true, Ordering::Relaxed);
            thread::sleep(GRACE);
            let _held = shared.uncut.lock().unwrap_or_else(PoisonError::into_inner);
            let error = Error::Interrupted { signal };
            let _ = writeln!(io::stderr(), "error: {error}");
            std::process::exit(error.exit_code().into());
        })?;
        Ok(())
    }
}
