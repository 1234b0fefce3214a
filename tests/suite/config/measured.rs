//! Keys by which sensors measure.

use std::fs;

use beamcast::config::{self, presets};
use beamcast::physics::detection::{RangePair, Sensitivity, normal_below};
use beamcast::physics::footprint::{E2_IN_FWHM, Samples};
use beamcast::physics::intensity::IntensityScale;
use beamcast::sensor::{Measurement, ReturnMode};
use beamcast::source::Severity;

use crate::plates::{cast, lambert, optics, scene, wall};

use super::{JOB, SENSOR, are_told, changed, diagnostics, folder, load, told};

/// Mistakes and the messages about them, as [`MISTAKES`](super::MISTAKES) has them.
const MISTAKES: &[(&str, &str, &str)] = &[
    // Footprints.
    (
        "max_m = 100.0",
        "max_m = 100.0\n[footprint]\ndivergence_mrad = [3.0, 1.5]",
        "sensor.toml:10:1: `[footprint]` has no `kind` | needs `kind` | add `kind = \"1/e2\"`, or \"fwhm\" where the data sheet states the full width at half maximum, which is 1.70 times less",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[footprint]\nkind = \"fwhm\"",
        "sensor.toml:10:1: `[footprint]` has no `divergence_mrad` | needs `divergence_mrad` | add `divergence_mrad = [3.0, 1.5]`, the full angles, horizontal and vertical",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[footprint]\nkind = \"1/e2\"\ndivergence_mrad = [3.0, 0.0]",
        "sensor.toml:12:19: a beam's divergence is 0 mrad | expected angles greater than 0 and less than 1000 | a degree is 17.45 mrad",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[footprint]\nkind = \"1/e2\"\ndivergence_mrad = [3000.0, 1.5]",
        "sensor.toml:12:19: a beam's divergence is 3000 mrad | expected angles greater than 0 and less than 1000 | a degree is 17.45 mrad",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[footprint]\nkind = \"1/e2\"\ndivergence_deg = [0.2, 0.1]",
        "sensor.toml:12:1: unknown key `divergence_deg` in `[footprint]` |  | did you mean `divergence_mrad`, in milliradians: a degree is 17.45?",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[footprint]\nkind = \"half\"\ndivergence_mrad = [3.0, 1.5]",
        "sensor.toml:11:8: `kind` is the string \"half\" | expected \"fwhm\" or \"1/e2\" | ",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[footprint]\nkind = \"1/e2\"\ndivergence_mrad = [3.0, 1.5]\nsamples = 12",
        "sensor.toml:13:11: `samples` is 12 | expected 1, 7, 19 or 37 | ",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[footprint]\nkind = \"1/e2\"\ndivergence_mrad = [3.0, 1.5]\nexit_radius_m = -0.1",
        "sensor.toml:13:17: `exit_radius_m` is -0.1 | expected a number of metres, 0 or more | ",
    ),
    // Receivers that count photons.
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nspad_cycles = 400",
        "sensor.toml:11:15: `spad_cycles` is of a detector that counts photons, and this one is linear | needs `detector = \"spad\"` | add `detector = \"spad\"`, or leave the keys out that begin with `spad_`",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\ndetector = \"spad\"\nrange_pairs = [[0.1, 90.0]]\nspad_bin_ns = 1.0",
        "sensor.toml:10:1: `[receiver]` has no `spad_cycles` | needs `spad_cycles` | add `spad_cycles = 500`, the laser's cycles times the diodes of a histogram",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\ndetector = \"spad\"\nrange_pairs = [[0.1, 90.0]]\nspad_cycles = 400",
        "sensor.toml:10:1: `[receiver]` has no `spad_bin_ns` | needs `spad_bin_ns` | add `spad_bin_ns = 1.0`, the width of a bin",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\ndetector = \"spad\"\nspad_cycles = 400\nspad_bin_ns = 1.0",
        "sensor.toml:11:12: a detector that counts photons has no range pairs | needs `range_pairs` | give `[receiver]` some `range_pairs`: they say how much light comes back from a plane",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\ndetector = \"spad\"\nrange_pairs = [[0.1, 90.0]]\nspad_cycles = 400\nspad_bin_ns = 0.001",
        "sensor.toml:14:15: a bin of 0.001 ns is one of 333564 up to 50 m | expected at most 65536 bins | 1 ns is 15 cm",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\ndetector = \"spad\"\nrange_pairs = [[0.1, 90.0]]\nspad_cycles = 400\nspad_bin_ns = 1.0\nspad_dead_ns = 10.0",
        "sensor.toml:15:16: a diode is blind for 10 ns, less than an echo lasts | expected at least 14.9 ns, seven standard deviations of the pulse | leave it out for a diode that is blind until the next cycle",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\ndetector = \"spad\"\nrange_pairs = [[0.1, 90.0]]\nspad_cycles = 400\nspad_bin_ns = 1.0\nspad_background_hz = 1e8",
        "sensor.toml:13:15: no light from 90 m is detected in 50 % of histograms of 400 cycles with 100000000 background counts a second | expected cycles that are left at the ranges of `range_pairs` | expect more cycles, less background, or a shorter dead time",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\ndetector = \"spad\"\nrange_pairs = [[0.1, 90.0]]\nspad_cycles = 400\nspad_bin_ns = 1.0\nwalk_residual = 0.1",
        "sensor.toml:15:17: `walk_residual` is 0.1, and a detector that counts photons has no threshold that a pulse walks over | is of `detector = \"linear\"` | leave it out, or give 0: the ranges of bright targets follow from pile-up",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\ndetector = \"spad\"\nrange_pairs = [[0.1, 90.0]]\nspad_cycles = 400\nspad_bin_ns = 1.0\n[noise]\nrange_a_m = 0.1",
        "sensor.toml:16:13: `range_a_m` is 0.1, and the noise of a detector that counts photons follows from its counts | is of `detector = \"linear\"` | give `range_a_m = 0.0`; `range_floor_m` adds to the noise of the counts",
    ),
    // Receivers.
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nrange_pairs = [[0.1, 90.0], [80, 60.0]]",
        "sensor.toml:11:29: a range pair has the reflectance 80 and the range 60 m | expected [reflectance, metres], such as [0.1, 90.0] | 80 % is a reflectance of 0.8",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nrange_pairs = [[0.1, 0.0]]",
        "sensor.toml:11:16: a range pair has the reflectance 0.1 and the range 0 m | expected [reflectance, metres], such as [0.1, 90.0] | a reflectance is greater than 0 and at most 2, 1 for white, and a range is greater than 0",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nrange_pairs = [[0.8, 50.0], [0.1, 90.0]]",
        "sensor.toml:11:29: a plane of the reflectance 0.1 is detected up to 90 m, and one of 0.8 only up to 50 m | expected ranges that grow with the reflectance | a pair is [reflectance, metres]; brighter planes are detected as far or farther",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nbeams = [{ rows = [0], range_pairs = [[0.1, 9.0]] }]",
        "sensor.toml:10:1: `[receiver]` has no `range_pairs` | needs `range_pairs` | add `range_pairs = [[0.1, 80.0]]`, how far all other beams see",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nrange_pairs = [[0.1, 80.0]]\nbeams = [{ rows = [0, 3], range_pairs = [[0.1, 50.0]] }]",
        "sensor.toml:12:23: there is no row 3: 3 rows count from 0 | expected at most 2 | ",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nrange_pairs = [[0.1, 80.0]]\nbeams = [{ rows = [0], range_pairs = [[0.1, 50.0]] }, { rows = [2, 0], range_pairs = [[0.1, 40.0]] }]",
        "sensor.toml:12:68: row 0 has range pairs already | listed twice | ",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nrange_pairs = [[0.1, 80.0]]\nbeams = [{ rows = [0], range_pairs = [[0.1, 88.0]] }]",
        "sensor.toml:12:38: these beams see 10.0 % farther than the receiver's `range_pairs` say | expected ranges that are not larger | give `[receiver]` the `range_pairs` of the beams that see farthest, and `beams` those of all others",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nrange_pairs = [[0.1, 80.0]]\nbeams = [{ rows = [0] }]",
        "sensor.toml:12:10: an element of `beams` has no `range_pairs` | needs `range_pairs` | add `range_pairs = [[0.1, 50.0]]`, how far these beams see",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nrange_pairs = []",
        "sensor.toml:11:15: `range_pairs` is an empty list | expected at least one | ",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nrange_pairs = [0.1, 90.0]",
        "sensor.toml:11:16: `range_pairs` has 0.1 | expected a list of 2 numbers: reflectance, range in metres | ",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\ndetection = 1",
        "sensor.toml:11:13: `detection` is 1 | expected a number, greater than 0 and less than 1 | ",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\ndetection = 0.0",
        "sensor.toml:11:13: `detection` is 0 | expected a number, greater than 0 and less than 1 | ",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nfalse_alarm = 0.5",
        "sensor.toml:11:15: `false_alarm` is 0.5 | expected a number, from 0 to 0.1 | ",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nwavelength_nm = 0.905",
        "sensor.toml:11:17: `wavelength_nm` is 0.905 | expected a number of nanometres, from 200 to 2500 | ",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nreturns = \"both\"",
        "sensor.toml:11:11: `returns` is the string \"both\" | expected \"strongest\", \"first\", \"last\" or \"dual\" | ",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nreturns = 17",
        "sensor.toml:11:11: `returns` is 17 | expected a whole number from 1 to 16 | ",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nreturns = true",
        "sensor.toml:11:11: `returns` is true | expected \"strongest\", \"first\", \"last\" or \"dual\", or a whole number from 1 to 16 | ",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nintensity = \"velodine\"",
        "sensor.toml:11:13: `intensity` is the string \"velodine\" | expected \"ideal\", \"percent\", \"velodyne\", \"vls128\", \"livox\", \"hesai\" or \"ouster\" | did you mean \"velodyne\"?",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nbounces = 17",
        "sensor.toml:11:11: `bounces` is 17 | expected a whole number from 0 to 16 | ",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\noverlap_m = [1.0, 0.9]",
        "sensor.toml:11:13: the fields of view come to overlap from 1 m to 0.9 m | expected 0 or more first, then more than that | ",
    ),
    (
        "max_m = 50",
        "max_m = inf\n[sensor.receiver]\ndetector = \"spad\"\nrange_pairs = [[0.1, 90.0]]\nspad_cycles = 400\nspad_bin_ns = 1.0",
        "job.toml:12:12: a detector that counts photons has a range without an end | needs `max_m` in `[range]` | give `[range]` a `max_m`, the end of the histogram",
    ),
    (
        "max_m = 50",
        "max_m = inf\n[sensor.receiver]\nfalse_alarm = 1e-4",
        "job.toml:12:15: `false_alarm` is 0.0001: such returns are at any range, and the sensor's range has no end | needs `max_m` in `[range]` | give `[range]` a `max_m`, the end of the range window",
    ),
    (
        "max_m = 50",
        "max_m = inf\n[sensor.receiver]\ninterference_hz = 1e4",
        "job.toml:12:19: `interference_hz` is 10000: such returns are at any range, and the sensor's range has no end | needs `max_m` in `[range]` | give `[range]` a `max_m`, the end of the range window",
    ),
    // Noise and blooming.
    (
        "max_m = 100.0",
        "max_m = 100.0\n[noise]\nrange_a_m = 0.5",
        "sensor.toml:11:13: `range_a_m` is 0.5: it scales with the signal-to-noise ratio, and no range pairs say what that is | needs `range_pairs` in `[receiver]` | give `[receiver]` some `range_pairs`, or use `range_floor_m`, which needs none",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[noise]\nbias_m = -0.01",
        "sensor.toml:11:10: `bias_m` is -0.01 | expected a number of metres, 0 or more | ",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[noise]\nstddev = 0.01",
        "sensor.toml:11:1: unknown key `stddev` in `[noise]` |  | did you mean `range_floor_m`, a standard deviation in metres?",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[blooming]\nhalo = 0.01\nreach_deg = 2.0",
        "sensor.toml:10:1: `[blooming]` has no `halo_deg` | needs `halo_deg` | add `halo_deg = 0.5`, the width of the halo",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[blooming]\nhalo = 0.01\nhalo_deg = 0.5",
        "sensor.toml:10:1: `[blooming]` has no `reach_deg` | needs `reach_deg` | add `reach_deg = 2.0`, the angle beyond which no light is spread",
    ),
    (
        "max_m = 100.0",
        "max_m = 100.0\n[blooming]\nreach_deg = 30.0",
        "sensor.toml:11:13: `reach_deg` is 30 | expected a number of degrees, greater than 0 and at most 20 | ",
    ),
    // Nominal figures.
    (
        "name = \"top\"",
        "name = \"top\"\nnominal = true",
        "job.toml:7:11: the sensor has no nominal figures | expected a preset with `[nominal]` | leave it out, and give the sensor tables of its own: `[sensor.receiver]`, `[sensor.noise]`",
    ),
    (
        "name = \"top\"",
        "name = \"top\"\nnominal = \"yes\"",
        "job.toml:7:11: `nominal` is the string \"yes\" | expected `true` or `false` | ",
    ),
    // Materials.
    (
        "wall = 3",
        "wall = 3\n[materials]\nwall = 0.5",
        "job.toml:6:8: `wall` is 0.5 | expected a table of `reflectance`, `like`, `kind`, `roughness`, `f0`, `index`, `thickness_m`, `r_a`, `lobe_deg` and `wetness` | ",
    ),
    (
        "wall = 3",
        "wall = 3\n[materials.wall]",
        "job.toml:5:1: `wall` has no properties | needs some | such as `reflectance = 0.2`, or `like = \"grass\"`",
    ),
    (
        "wall = 3",
        "wall = 3\n[materials.wall]\nreflectance = 20",
        "job.toml:6:15: `reflectance` is 20 | expected a number, from 0 to 2 | ",
    ),
    (
        "wall = 3",
        "wall = 3\n[materials.wall]\nroughness = 0.3",
        "job.toml:6:13: `roughness` has no meaning without a `kind` |  | `kind = \"ggx\"` has it",
    ),
    (
        "wall = 3",
        "wall = 3\n[materials.wall]\nkind = \"lambert\"\nthickness_m = 0.006",
        "job.toml:7:15: `thickness_m` does not go with `kind = \"lambert\"` |  | `kind = \"glass\"` has it",
    ),
    (
        "wall = 3",
        "wall = 3\n[materials.wall]\nkind = \"ggx\"",
        "job.toml:5:1: an entry of `[materials]` has no `roughness` | needs `roughness` | add `roughness = 0.3`, from 0 to 1",
    ),
    (
        "wall = 3",
        "wall = 3\n[materials.wall]\nkind = \"mirror\"",
        "job.toml:5:1: an entry of `[materials]` has no `reflectance` | needs `reflectance` | add `reflectance = 0.9`, the part of the light that goes on",
    ),
    (
        "wall = 3",
        "wall = 3\n[materials.wall]\nkind = \"mirror\"\nreflectance = 1.2",
        "job.toml:7:15: a mirror has the reflectance 1.2 | expected a part of the light, at most 1 | ",
    ),
    (
        "wall = 3",
        "wall = 3\n[materials.wall]\nkind = \"retroreflector\"\nr_a = 300.0",
        "job.toml:5:1: an entry of `[materials]` has no `lobe_deg` | needs `lobe_deg` | add `lobe_deg = 0.47`, the angle at which that has fallen to 1/e",
    ),
    (
        "wall = 3",
        "wall = 3\n[materials.wall]\nlike = \"gras\"",
        "job.toml:6:8: `like` is the string \"gras\" | expected \"asphalt\", \"grass\", \"dry grass\", \"conifer\", \"deciduous\", \"grey shingle\", \"red shingle\", \"wood\", \"aluminium\", \"copper\", \"tyre\", \"black foam rubber\", \"grey cardboard\", \"white paper\", \"plaster\", \"retro sheet type I\", \"retro sheet type II\" or \"retro sheet type III\" | did you mean \"grass\"?",
    ),
    (
        "wall = 3",
        "wall = 3\n[materials.wall]\nlike = \"grass\"\nreflectance = 0.5",
        "job.toml:7:15: `wall` has both `like` and `reflectance` | one too many | keep one of the two: each says the reflectance",
    ),
    (
        "wall = 3",
        "wall = 3\n[materials.wall]\nlike = \"retro sheet type I\"\nkind = \"lambert\"",
        "job.toml:7:8: a sheet of retroreflectors can't be of `kind = \"lambert\"` |  | leave `kind` out",
    ),
    // Weather and the sun.
    (
        "wall = 3",
        "wall = 3\n[weather]\nvisibility_m = 0",
        "job.toml:6:16: `visibility_m` is 0 | expected a number of metres, greater than 0 and at most 1000000 | ",
    ),
    (
        "wall = 3",
        "wall = 3\n[weather]\nvisibility_m = 2e6",
        "job.toml:6:16: `visibility_m` is 2000000 | expected a number of metres, greater than 0 and at most 1000000 | ",
    ),
    (
        "wall = 3",
        "wall = 3\n[weather]\nrain_mm_h = 600",
        "job.toml:6:13: `rain_mm_h` is 600 | expected a number, from 0 to 500 | ",
    ),
    (
        "wall = 3",
        "wall = 3\n[weather]\nfog = 100.0",
        "job.toml:6:1: unknown key `fog` in `[weather]` |  | did you mean `visibility_m`, in metres?",
    ),
    (
        "wall = 3",
        "wall = 3\n[weather]\nhaze = \"kimm\"",
        "job.toml:6:8: `haze` is the string \"kimm\" | expected \"kim\" or \"kruse\" | did you mean \"kim\"?",
    ),
    (
        "wall = 3",
        "wall = 3\n[environment]\nsun_klx = 200",
        "job.toml:6:11: `sun_klx` is 200 | expected a number of kilolux, from 0 to 150 | ",
    ),
    (
        "wall = 3",
        "wall = 3\n[environment]\nsun_elevation_deg = 91",
        "job.toml:6:21: `sun_elevation_deg` is 91 | expected a number of degrees, from -90 to 90 | ",
    ),
];

/// Values that are valid and probably not meant, with the warnings about them.
const DOUBTS: &[(&str, &str, &str)] = &[
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nrange_pairs = [[0.1, 20.0], [0.5, 21.0], [0.8, 49.0]]",
        "sensor.toml:11:15: the fit of the range pairs misses one of them by 67 % of its range: power falls with the range to the 1.54 | these pairs do not fit together | pairs of one mode and one probability of detection agree better; two pairs always fit",
    ),
    (
        "max_m = 50",
        "max_m = 50\n[sensor.receiver]\nrange_pairs = [[0.8, 60.0]]",
        "job.toml:12:16: a plane is detected up to 60 m, and `max_m` is 50 m | farther than the sensor reports | returns end at `max_m`; write `max_m = 60` if they should not",
    ),
    // 45 and 20 m are missed by √(45/20) − 1.
    (
        "max_m = 100.0",
        "max_m = 100.0\n[receiver]\nrange_pairs = [[0.1, 50.0]]\nbeams = [{ rows = [0], range_pairs = [[0.1, 20.0], [0.1, 45.0]] }]",
        "sensor.toml:12:38: power falls with the range as the receiver's own pairs say, and misses a pair of these beams by 50 % of its range | these pairs do not fit to those of the other beams | the beams of a sensor differ by a factor of power alone; one pair always fits",
    ),
    (
        "wall = 3",
        "wall = 3\n[weather]\nrain_mm_h = 5",
        "job.toml:5:1: `[weather]` changes nothing: no sensor has a receiver with range pairs | no sensor measures light | give a sensor `[sensor.receiver]` with `range_pairs`, or `nominal = true` if its preset has them",
    ),
    (
        "wall = 3",
        "wall = 3\n[environment]\nsun_klx = 80",
        "job.toml:5:1: `[environment]` changes nothing: no sensor has a receiver with range pairs | no sensor measures light | give a sensor `[sensor.receiver]` with `range_pairs`, or `nominal = true` if its preset has them",
    ),
];

#[test]
fn each_mistake_is_told_at_its_place() {
    are_told(MISTAKES);
}

#[test]
fn what_is_probably_not_meant_is_a_warning() {
    for &(from, to, expected) in DOUBTS {
        let (job, sensor) = changed(from, to);
        let job = load(&job, &sensor, &[]).unwrap();
        let found: Vec<String> = job.warnings.iter().map(told).collect();
        assert_eq!(found, [expected]);
        assert_eq!(job.warnings[0].severity, Severity::Warning);
    }
    // A job that shortens its sensor's range means that.
    let pairs = SENSOR.to_owned() + "[receiver]\nrange_pairs = [[0.8, 90.0]]\n";
    assert!(load(JOB, &pairs, &[]).unwrap().warnings.is_empty());
}

const MEASURED: &str = "\
[footprint]
divergence_mrad = [3.0, 1.5]
kind = \"fwhm\"
exit_radius_m = 0.005
samples = 19
[receiver]
range_pairs = [[0.8, 40.0], [0.1, 20.0]]
wavelength_nm = 1550
detection = 0.9
false_alarm = 1e-4
pulse_fwhm_ns = 3
returns = 4
separation_m = 1.0
intensity = \"vls128\"
saturation_snr = 500
overlap_m = [0.4, 1.5]
[noise]
range_floor_m = 0.01
range_a_m = 0.1
angle_deg = 0.05
[blooming]
core_deg = 0.2
reach_deg = 2
[nominal]
source = \"a data sheet\"
[nominal.footprint]
divergence_mrad = [2.0, 1.0]
kind = \"1/e2\"
[nominal.noise]
range_floor_m = 0.02
bias_m = 0.03
[modes.single.receiver]
returns = \"last\"
[modes.single.nominal.noise]
bias_m = 0.04
";

#[test]
fn a_sensor_measures_as_its_tables_say() {
    let ideal = load(JOB, SENSOR, &[]).unwrap();
    assert!(ideal.sensors[0].sensor.measurement.is_ideal());

    let sensor = SENSOR.to_owned() + MEASURED;
    let job = load(JOB, &sensor, &["output.terms=true"]).unwrap();
    assert!(job.output.formats.iter().all(|format| format.tells_terms()));
    let Measurement { footprint, receiver, noise, blooming, depth } =
        job.sensors[0].sensor.measurement.clone();
    assert_eq!(depth, None);
    let footprint = footprint.unwrap();
    let half = footprint.half_divergence.map(|angle| angle.radians());
    assert_eq!(half, [3.0, 1.5].map(|full| 0.5 * E2_IN_FWHM * full * 1e-3));
    assert_eq!((footprint.exit_radius_m, footprint.samples), (0.005, Samples::Nineteen));
    let receiver = receiver.unwrap();
    let pair = |reflectivity, range_m| RangePair { reflectivity, range_m };
    assert_eq!(receiver.range_pairs, [pair(0.1, 20.0), pair(0.8, 40.0)]);
    assert_eq!(receiver.sensitivity, Sensitivity::fit(&receiver.range_pairs));
    assert!((receiver.wavelength_m - 1550e-9).abs() < 1e-18 && (receiver.pulse_fwhm_s - 3e-9).abs() < 1e-20);
    assert_eq!((receiver.detection, receiver.false_alarm, receiver.separation_m), (0.9, 1e-4, 1.0));
    assert_eq!((receiver.returns, receiver.intensity), (ReturnMode::Several(4), IntensityScale::Vls128));
    assert_eq!((receiver.saturation_snr, receiver.overlap_m, receiver.bounces), (500.0, [0.4, 1.5], 3));
    let noise = noise.unwrap();
    assert_eq!((noise.range_floor_m, noise.range_a_m, noise.range_b, noise.bias_m), (0.01, 0.1, 0.6, 0.0));
    assert!((noise.angle.degrees() - 0.05).abs() < 1e-15);
    let blooming = blooming.unwrap();
    assert!((blooming.share(0.0) - 1.0).abs() < 1e-15 && blooming.share(0.5) < 1e-15);
}

#[test]
fn nominal_figures_lie_under_the_sensors_own_and_the_jobs() {
    let sensor = SENSOR.to_owned() + MEASURED;
    let with = |pairs: &[&str]| load(JOB, &sensor, pairs).unwrap().sensors[0].clone();
    let noise = |pairs: &[&str]| with(pairs).sensor.measurement.noise.unwrap();
    let plain = with(&["sensor.top.nominal=false"]);
    assert!(!plain.is_nominal && plain.sensor.measurement.noise.unwrap().bias_m == 0.0);
    // The sensor's own floor and divergence stand, and the bias is that of the data sheet.
    let nominal = with(&["sensor.top.nominal=true"]);
    assert_eq!(nominal.sensor.measurement.footprint, plain.sensor.measurement.footprint);
    let of_sheet = nominal.sensor.measurement.noise.unwrap();
    assert_eq!((nominal.is_nominal, of_sheet.range_floor_m, of_sheet.bias_m), (true, 0.01, 0.03));
    assert_eq!(noise(&["sensor.top.nominal=true", "sensor.top.noise.bias_m=0.5"]).bias_m, 0.5);
    let mode = ["sensor.top.nominal=true", "sensor.top.mode=single"];
    assert_eq!(noise(&mode).bias_m, 0.04);
    assert_eq!(with(&mode).sensor.measurement.receiver.unwrap().returns, ReturnMode::Last);

    let read = |text: &str| {
        let (folder, _) = folder(JOB, text);
        config::load_sensor(&folder.path().join("sensor.toml"))
    };
    let file = read(&sensor).unwrap();
    let nominal = file.nominal.unwrap();
    assert_eq!(
        (nominal.data_sheet.source.as_str(), nominal.measurement.noise.unwrap().bias_m),
        ("a data sheet", 0.03)
    );
    assert_eq!(file.sensor.measurement.noise.unwrap().bias_m, 0.0);
    // What is wrong with the figures is told though they are off, and though others lie over them.
    for (from, to, expected) in [
        ("source = \"a data sheet\"\n", "", "`[nominal]` has no `source`"),
        ("range_floor_m = 0.02", "range_floor_m = -0.02", "`range_floor_m` is -0.02"),
        ("bias_m = 0.04", "bias = 0.04", "unknown key `bias` in `[noise]`"),
    ] {
        let found = diagnostics(read(&sensor.replacen(from, to, 1)).unwrap_err());
        assert!(found[0].message.contains(expected), "{found:?}");
    }
    let none = SENSOR.to_owned() + "[nominal]\nsource = \"a data sheet\"\n";
    assert_eq!(diagnostics(read(&none).unwrap_err())[0].message, "`[nominal]` has no figures");
}

#[test]
fn values_of_a_measurement_are_drawn() {
    let sensor = SENSOR.to_owned() + MEASURED;
    let random = "[random]\n\"sensor.top.noise.gain\" = { uniform = [0.1, 0.2] }\n\"weather.rain_mm_h\" = { uniform = [1, 2] }\n[output]";
    let job = load(&JOB.replacen("[output]", random, 1), &sensor, &[]).unwrap();
    let drawn = job.of_frame(3).unwrap();
    let gain = drawn.sensors[0].sensor.measurement.noise.unwrap().gain;
    let rain_mm_h = drawn.environment.weather.unwrap().rain_mm_h;
    assert!((0.1..=0.2).contains(&gain) && (1.0..=2.0).contains(&rain_mm_h), "{gain} {rain_mm_h}");
    let nominal =
        random.replace("noise.gain\" = { uniform = [0.1, 0.2] }", "nominal\" = { choice = [true] }");
    let found = load(&JOB.replacen("[output]", &nominal, 1), &sensor, &[]).unwrap_err();
    assert!(found[0].message.contains("can't be drawn"), "{found:?}");
}

/// Ranges at 10 % and 80 % reflectance, which data sheets state or which follow by the square of the range from one pair, with the
/// probability of detection there; then standard deviations of ranges: reflectance, range, metres.
#[test]
fn presets_have_the_figures_of_their_data_sheets() {
    type Row = (&'static str, [f64; 2], f64, &'static [(f64, f64, f64)]);
    let rows: &[Row] = &[
        ("ouster/os0-128", [15.0, 45.0], 0.9, &[]),
        ("ouster/os1-128", [45.0, 100.0], 0.9, &[]),
        ("ouster/os2-128", [80.0, 210.0], 0.9, &[]),
        ("ouster/os0-128-rev7", [35.0, 75.0], 0.9, &[]),
        ("ouster/os1-128-rev7", [90.0, 170.0], 0.9, &[]),
        ("ouster/os1-64-gen1", [40.0, 120.0], 0.5, &[]),
        ("ouster/os1-16-gen1", [40.0, 120.0], 0.5, &[]),
        ("velodyne/puck-128", [120.0, 339.4], 0.5, &[]),
        ("hesai/xt-32", [80.0, 226.3], 0.5, &[]),
        ("livox/mid-40", [90.0, 260.0], 0.5, &[(0.8, 20.0, 0.02)]),
        (
            "livox/tele-15",
            [320.0, 569.6],
            0.5,
            &[(0.1, 70.0, 0.0183), (0.1, 120.0, 0.0304), (0.8, 220.0, 0.02), (0.8, 380.0, 0.04)],
        ),
    ];
    for &(name, ranges, detection, sigmas) in rows {
        let file = config::load_preset(name).unwrap();
        assert!(file.sensor.measurement.is_ideal(), "{name}");
        let Measurement { receiver, noise, .. } = file.nominal.unwrap().measurement;
        let (receiver, noise) = (receiver.unwrap(), noise.unwrap());
        let window_m = file.sensor.range.max_m;
        for (reflectance, range_m) in [0.1, 0.8].into_iter().zip(ranges) {
            let found = receiver.sensitivity.unwrap().range_m(reflectance);
            assert!((found / range_m - 1.0).abs() < 0.02, "{name}: {found} m at {reflectance}");
            let snr = receiver.snr(reflectance, found, window_m);
            let detected = normal_below(snr - receiver.threshold(window_m));
            assert!((detected - detection).abs() < 1e-9, "{name}: {detected}");
        }
        for &(reflectance, range_m, expected) in sigmas {
            let sigma = noise.range_sigma_m(receiver.snr(reflectance, range_m, window_m));
            assert!((sigma / expected - 1.0).abs() < 0.01, "{name}: {sigma} at {range_m} m");
        }
    }
    // The outer channels of the XT32: (50/80)² of the power.
    let xt32 = config::load_preset("hesai/xt-32").unwrap().nominal.unwrap().measurement.receiver.unwrap();
    let powers: Vec<f64> = (0..32).map(|row| xt32.power(row)).collect();
    let expected: Vec<f64> =
        (1..=32).map(|channel| if (9..=24).contains(&channel) { 1.0 } else { 0.390_625 }).collect();
    assert!(powers.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12), "{powers:?}");
    /// Their figures are held in `presets::cameras`.
    const DEPTH_CAMERAS: usize = 8;
    let nominal = presets::BUILT_IN.iter().filter(|(_, text)| text.contains("\n[nominal]\n")).count();
    assert_eq!(nominal, 18 + DEPTH_CAMERAS, "presets with figures of a data sheet");
}

/// Each key by which a sensor measures, set alone over the figures of a data sheet, is refused or leaves the sensor its points.
#[test]
fn no_key_of_a_measurement_alone_takes_a_sensors_points_away() {
    let keys =
        fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/schema/measured.toml")).unwrap();
    let keys: toml::Table = keys.parse().unwrap();
    let job = JOB.replacen("preset = \"sensor.toml\"", "preset = \"ouster/os1-16-gen1\"\nnominal = true", 1);
    let scene = optics(scene(&[wall(12.0, 1.0)]), &[lambert(0.5)]);
    let seen = |change: Option<&str>| {
        let shorter = ["sensor.top.rotating.columns=64", "sensor.top.footprint.samples=7"];
        let pairs: Vec<&str> = shorter.into_iter().chain(change).collect();
        let job = load(&job, SENSOR, &pairs).map_err(|found| told(&found[0]))?;
        let frame = cast(&scene, &job.sensors[0].sensor, 0);
        Ok::<_, String>((0..frame.pixels()).filter(|&pixel| !frame.slots(pixel).is_empty()).count())
    };
    let all = seen(None).unwrap();
    assert!(all > 400, "{all}");
    let mut tried = 0;
    for table in ["footprint", "receiver", "noise", "blooming"] {
        for (key, value) in keys[table].as_table().unwrap() {
            tried += 1;
            match seen(Some(&format!("sensor.top.{table}.{key}={value}"))) {
                Ok(seen) => assert!(seen * 10 > all * 9, "{table}.{key} = {value}: {seen} of {all}"),
                Err(message) => {
                    assert!(message.contains(key.as_str()) || message.contains(table), "{message}")
                }
            }
        }
    }
    assert!(tried > 30, "{tried}");
}
