//! Every key of jobs and sensor files, each declared once.
//!
//! A declaration feeds the reader, the error messages, the JSON Schema (`beamcast schema job`), the reference page
//! (`beamcast schema keys`) and, if it has a starter, the job that `beamcast init` writes. A key that no reader reads fails
//! a test in `read/tests.rs`.

mod angles;
pub(crate) mod depth;
pub(crate) mod expect;
pub(crate) mod job;
pub(crate) mod limits;
pub(crate) mod measurement;
pub(crate) mod motion;
pub(crate) mod placing;
pub(crate) mod pose;
pub(crate) mod random;
pub(crate) mod sensor;
pub(crate) mod surroundings;

use std::sync::LazyLock;

use super::table::Grammar;

/// The grammar of jobs and sensor files.
pub(super) static GRAMMAR: LazyLock<Grammar> =
    LazyLock::new(|| Grammar::new(&[&job::JOB, &sensor::SENSOR_FILE]));
