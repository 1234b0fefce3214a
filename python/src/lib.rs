//! The native half of the Python package: arguments and results as Python has them. What is computed is computed by the library.
//! The package's other half, in beamcast/, gives arrays their shapes and documents everything.

mod arrays;
mod casting;
mod errors;
mod frame;
mod job;
mod scene;
mod sensor;
mod work;

use pyo3::prelude::*;

/// The native half of the package `beamcast`.
#[pymodule]
mod _native {
    use std::ffi::OsString;
    use std::io::{self, Write as _};

    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::frame::NativeFrame;
    #[pymodule_export]
    use crate::job::{NativeJob, start_threads};
    #[pymodule_export]
    use crate::scene::NativeScene;
    #[pymodule_export]
    use crate::sensor::{NativeSensor, preset_names};

    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");

    /// Runs the command line on arguments, the program's name first, and returns its exit code. It sets up the threads and the signals
    /// of the process, so a process can do it once.
    #[pyfunction]
    fn command(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
        py.detach(|| {
            let code = beamcast::cli::main_with(arguments);
            // What Rust's main would do at the end of the process.
            let _ = io::stdout().flush();
            code
        })
    }
}

/// The largest number of threads that a call may ask for.
const MOST_THREADS: usize = 1024;

/// The number of threads that a call works on: `None` and 0 are one for each core.
fn threads_of(threads: Option<i64>) -> PyResult<usize> {
    let threads = threads.unwrap_or(0);
    usize::try_from(threads).ok().filter(|threads| *threads <= MOST_THREADS).ok_or_else(|| {
        let message = format!("threads is {threads}: expected 1 to {MOST_THREADS}, or 0 for one a core");
        pyo3::exceptions::PyValueError::new_err(message)
    })
}
