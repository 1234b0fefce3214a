use std::collections::BTreeSet;
use std::path::Path;

use super::super::keys::GRAMMAR;
use super::super::table::asked;
use super::super::{load_job, load_sensor};

/// Sensor files that have each table of a sensor between them.
const SENSORS: [&str; 16] = [
    "analytic",
    "equirectangular",
    "fisheye",
    "measured",
    "mirror",
    "orthographic",
    "pattern",
    "pinhole",
    "raster",
    "rays",
    "risley",
    "rotating",
    "spaced",
    "stereo",
    "structured_light",
    "tof",
];

/// Jobs that have each table of a job between them, except for the patterns.
const JOBS: [&str; 4] = [
    "tests/schema/job.toml",
    "tests/schema/places.toml",
    "tests/schema/weather.toml",
    "configs/street_rig.toml",
];

#[test]
fn every_key_that_is_declared_is_read() {
    let project = Path::new(env!("CARGO_MANIFEST_DIR"));
    asked::take();
    for name in SENSORS {
        load_sensor(&project.join(format!("tests/schema/{name}.toml"))).unwrap_or_else(|e| panic!("{e}"));
    }
    for job in JOBS {
        load_job(&project.join(job), &[]).unwrap_or_else(|e| panic!("{e}"));
    }
    let asked = asked::take();

    // A mode is read as a part of its sensor's table, over which it is laid.
    let tables = GRAMMAR.tables.iter().filter(|table| table.title != "a mode");
    let declared: BTreeSet<_> =
        tables.flat_map(|table| table.names().map(|name| (table.title, name))).collect();
    let never_read: Vec<_> = declared.difference(&asked).collect();
    assert!(never_read.is_empty(), "declared in src/config/keys/, and no reader reads them: {never_read:?}");
    assert!(asked.is_subset(&declared), "{:?}", asked.difference(&declared));
}
