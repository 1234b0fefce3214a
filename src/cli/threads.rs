//! The threads that all work of the process is shared among.

use std::num::NonZero;
use std::thread;

use crate::error::Error;

/// The largest number of threads.
const MOST: u16 = 1024;

/// The number of threads to work on, for subcommands that work on many.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
#[group(skip)] // the group would have the name of that of the subcommand's own arguments
pub struct Args {
    /// Threads to work on, 1 to 1024; the results are the same with any number [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST)))]
    threads: Option<u16>,
}

impl Args {
    /// So many threads.
    pub fn of(threads: u16) -> Self {
        Self { threads: Some(threads) }
    }

    /// Starts the threads. Nothing works in parallel before that: a pool that the system refuses has a message this way, and
    /// does not end the process.
    ///
    /// # Errors
    /// [`Error::Usage`] if there can't be so many.
    pub fn start(self) -> Result<(), Error> {
        let threads = match self.threads {
            Some(threads) => threads,
            None => by_default(std::env::var("RAYON_NUM_THREADS").ok().as_deref())?,
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into());
        pool.build_global().map_err(|e| {
            Error::Usage(format!("{threads} threads can't be had: {e}; --threads N asks for fewer"))
        })
    }
}

/// The number of threads if none is given: the environment's, else one for each core.
fn by_default(environment: Option<&str>) -> Result<u16, Error> {
    match environment.and_then(|text| text.parse::<u64>().ok()) {
        None | Some(0) => {
            let cores = thread::available_parallelism().map_or(1, NonZero::get);
            Ok(u16::try_from(cores).map_or(MOST, |cores| cores.min(MOST)))
        }
        Some(threads) => u16::try_from(threads)
            .ok()
            .filter(|threads| *threads <= MOST)
            .ok_or_else(|| Error::Usage(format!("RAYON_NUM_THREADS is {threads}: expected 1 to {MOST}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_environment_is_held_to_the_limit() {
        assert_eq!(by_default(Some("3")).unwrap(), 3);
        assert_eq!(by_default(Some("1024")).unwrap(), 1024);
        for nothing in [None, Some("0"), Some("many")] {
            assert!((1..=MOST).contains(&by_default(nothing).unwrap()), "{nothing:?}");
        }
        let error = by_default(Some("100000")).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert_eq!(error.to_string(), "RAYON_NUM_THREADS is 100000: expected 1 to 1024");
    }
}
