//! Mistakes in jobs and sensor files, and the messages that users read.

/// Each entry has the text that is replaced in the valid job (or, if the job lacks it, in its sensor file), the
/// replacement, and the first message in the form `file:line:column: message | label | help`.
pub const MISTAKES: &[(&str, &str, &str)] = &[
    // Mistakes in keys.
    ("seed = 7", "sead = 7", "job.toml:2:1: unknown key `sead` in a job |  | did you mean `seed`?"),
    (
        "max_m = 50",
        "max_cm = 50",
        "job.toml:10:1: unknown key `max_cm` in `[range]` |  | did you mean `max_m`, in metres?",
    ),
    (
        "max_m = 50",
        "max = 50",
        "job.toml:10:1: unknown key `max` in `[range]` |  | did you mean `max_m`, in metres?",
    ),
    (
        "columns = 1800",
        "colums = 1800",
        "sensor.toml:5:1: unknown key `colums` in `[rotating]` |  | did you mean `columns`?",
    ),
    (
        "rate_hz = 10.0",
        "rate_rpm = 600.0",
        "sensor.toml:6:1: unknown key `rate_rpm` in `[rotating]` |  | did you mean `rate_hz`, in hertz?",
    ),
    (
        "elevations_deg = ",
        "elevations = ",
        "sensor.toml:3:1: unknown key `elevations` in `[rotating]` |  | did you mean `elevations_deg`, in degrees?",
    ),
    (
        "seed = 7",
        "columns = 7",
        "job.toml:2:1: unknown key `columns` in a job |  | `columns` belongs in `[rotating]`",
    ),
    (
        "max_m = 50",
        "wavelength = 9",
        "job.toml:10:1: unknown key `wavelength` in `[range]` |  | the keys of `[range]` are `min_m`, `max_m` and `of`",
    ),
    (
        "ring = \"bottom_up\"",
        "name = \"x\"",
        "sensor.toml:1:1: unknown key `name` in a sensor file |  | `name` belongs in `[[sensor]]`",
    ),
    (
        "dir = \"out\"",
        "",
        "job.toml:11:1: `[output]` has no `dir` | needs `dir` | add `dir = \"../out\"`, the folder to write to",
    ),
    (
        "scene = \"../scenes/room.glb\"",
        "",
        "job.toml:1:1: a job has no `scene` | needs `scene` | add `scene = \"../scenes/room.glb\"`, a glTF file",
    ),
    (
        "rate_hz = 10.0",
        "",
        "sensor.toml:2:1: `[rotating]` has no `rate_hz` | needs `rate_hz` | add `rate_hz = 10.0`, the turns a second",
    ),
    // Wrong kinds of values.
    (
        "seed = 7",
        "seed = -7",
        "job.toml:2:8: `seed` is -7 | expected a whole number from 0 to 18446744073709551615 | ",
    ),
    (
        "seed = 7",
        "seed = 7.5",
        "job.toml:2:8: `seed` is 7.5 | expected a whole number from 0 to 18446744073709551615 | ",
    ),
    (
        "wall = 3",
        "wall = 4294967296",
        "job.toml:4:8: `wall` is 4294967296 | expected a whole number from 0 to 4294967295 | ",
    ),
    (
        "max_m = 50",
        "max_m = \"far\"",
        "job.toml:10:9: `max_m` is the string \"far\" | expected a number of metres, greater than 0, or `inf` | ",
    ),
    (
        "max_m = 50",
        "max_m = nan",
        "job.toml:10:9: `max_m` is NaN | expected a number of metres, greater than 0, or `inf` | ",
    ),
    (
        "min_m = 0.5",
        "min_m = inf",
        "sensor.toml:8:9: `min_m` is inf | expected a finite number of metres, 0 or more | ",
    ),
    (
        "min_m = 0.5",
        "min_m = -1",
        "sensor.toml:8:9: `min_m` is -1 | expected a number of metres, 0 or more | ",
    ),
    (
        "columns = 1800",
        "columns = 0",
        "sensor.toml:5:11: `columns` is 0 | expected a whole number from 1 to 1000000 | ",
    ),
    (
        "columns = 1800",
        "columns = 1800.0",
        "sensor.toml:5:11: `columns` is 1800.0, a number with a fraction | expected a whole number from 1 to 1000000 | write 1800",
    ),
    (
        "rate_hz = 10.0",
        "rate_hz = 0",
        "sensor.toml:6:11: `rate_hz` is 0 | expected a number of hertz, greater than 0 | ",
    ),
    (
        "[-15.0, 1, 15.0]",
        "[-15.0, [1], 15.0]",
        "sensor.toml:3:26: `elevations_deg` has a list of 1 value | expected a number of degrees | ",
    ),
    (
        "[-15.0, 1, 15.0]",
        "15.0",
        "sensor.toml:3:18: `elevations_deg` is 15 | expected a list of numbers of degrees, from -90 to 90, or a table of `from`, `to` and `count` | ",
    ),
    (
        "[1.0, 2, 3.0]",
        "[1.0, 2]",
        "job.toml:8:23: `position_m` is a list of 2 values | expected a list of 3 numbers of metres: x, y, z | ",
    ),
    (
        "frame = \"world\"",
        "frame = \"wrld\"",
        "job.toml:14:9: `frame` is the string \"wrld\" | expected \"sensor\", \"body\" or \"world\" | did you mean \"world\"?",
    ),
    (
        "[\"exr\", \"ply\"]",
        "[\"exr\", \"exr\"]",
        "job.toml:13:19: `formats` lists \"exr\" twice | listed before | ",
    ),
    (
        "[\"exr\", \"ply\"]",
        "[]",
        "job.toml:13:11: `formats` is an empty list | expected at least one of \"exr\", \"ply\", \"png\", \"color\", \"depth16\", \"registered\", \"labels\", \"instances\", \"npz\", \"npy\", \"pcd\", \"poses\", \"waveform\", \"kitti\" or \"nuscenes\" | ",
    ),
    (
        "\"bottom_up\"",
        "\"top_down\"",
        "sensor.toml:1:8: `ring` is the string \"top_down\" | expected \"row\", \"bottom_up\" or \"file\" | ",
    ),
    (
        "[[sensor]]",
        "[sensor]",
        "job.toml:5:1: `sensor` is a table | expected a list of tables | write `[[sensor]]`, with two brackets, before each sensor's keys",
    ),
    ("dir = \"out\"", "dir = \"\"", "job.toml:12:7: `dir` is an empty string | expected some text | "),
    // Values that contradict each other.
    (
        "max_m = 50",
        "max_m = 0.25",
        "job.toml:10:9: nothing lies between `min_m` = 0.5 and `max_m` = 0.25 | `max_m` must be greater than `min_m` | ",
    ),
    (
        "max_m = 50",
        "min_m = 200",
        "job.toml:10:9: nothing lies between `min_m` = 200 and `max_m` = 100 | `max_m` must be greater than `min_m` | ",
    ),
    (
        "[0.0, 2.0, 4.0]",
        "[0.0, 2.0]",
        "sensor.toml:4:17: `beam_times_us` has 2 values for 3 elevations | expected 3: one a beam | ",
    ),
    (
        "[0.0, 2.0, 4.0]",
        "[0.0, \"early\", 4.0]",
        "sensor.toml:4:23: `beam_times_us` has the string \"early\" | expected a number of microseconds | ",
    ),
    (
        "columns = 1800",
        "columns = 1800\ncycle = []",
        "sensor.toml:6:9: `cycle` is an empty list | expected at least one | ",
    ),
    (
        "columns = 1800",
        "columns = 1800\ncycle = [{ beam_times_us = [0, 1] }]",
        "sensor.toml:6:28: `beam_times_us` has 2 values for 3 elevations | expected 3: one a beam | ",
    ),
    (
        "columns = 1800",
        "columns = 1800\ncycle = [{}, { silent_beams = [0, 3] }]",
        "sensor.toml:6:35: there is no beam 3: 3 beams count from 0 | expected at most 2 | ",
    ),
    (
        "columns = 1800",
        "columns = 1800\ncycle = [{ silent_beam = [0] }]",
        "sensor.toml:6:12: unknown key `silent_beam` in a column of `cycle` |  | did you mean `silent_beams`?",
    ),
    (
        "[sensor.range]\nmax_m = 50",
        "rotating.elevations_deg = [1, 2]",
        "job.toml:9:27: `beam_times_us` has 3 values for 2 elevations | 2 elevations | `beam_times_us` stays as it was given before: give one that fits here too",
    ),
    (
        "[-15.0, 1, 15.0]",
        "[-15.0, 91, 15.0]",
        "sensor.toml:3:26: no beam has an elevation of 91 degrees | expected -90 (straight down) to 90 (straight up) | ",
    ),
    (
        "[-15.0, 1, 15.0]",
        "{ from = 1, to = -1, count = 1 }",
        "sensor.toml:3:47: one beam can't reach from 1 to -1 degrees | expected 2 or more, or `from` the same as `to` | ",
    ),
    (
        "[-15.0, 1, 15.0]",
        "{ from = 1, to = -1, count = 1000001 }",
        "sensor.toml:3:47: `count` is 1000001 | expected a whole number from 1 to 1000000 | ",
    ),
    (
        "columns = 1800",
        "columns = 2\nsector_deg = { from = 0, to = 361 }",
        "sensor.toml:6:31: the sector from 0 to 361 turns by 361 degrees | expected a turn of more than 0 and at most 360 degrees | ",
    ),
    (
        "columns = 1800",
        "columns = 2\nsector_deg = { from = 0 }",
        "sensor.toml:6:14: `sector_deg` has no `to` | needs `to` | add `to = -180.0`, the azimuth where the sector ends in degrees",
    ),
    (
        "[-15.0, 1, 15.0]\nbeam_times_us = [0.0, 2.0, 4.0]\ncolumns = 1800",
        "{ from = 9, to = -9, count = 1000000 }\ncolumns = 5000",
        "sensor.toml:4:11: 1000000 rows of 5000 columns are more than 4294967296 rays a frame | expected fewer | ",
    ),
    (
        "rpy_deg = [0.0, 0.0, 90.0]",
        "rpy_deg = [0, 0, 0], quaternion_xyzw = [0, 0, 0, 1]",
        "job.toml:8:77: a pose has one rotation, and this has both `rpy_deg` and `quaternion_xyzw` | one too many | ",
    ),
    (
        "rpy_deg = [0.0, 0.0, 90.0]",
        "quaternion_xyzw = [0, 0, 0, 0]",
        "job.toml:8:56: a quaternion of length 0 is no rotation | expected x, y, z, w of length 1 | `[0.0, 0.0, 0.0, 1.0]` turns by nothing",
    ),
    (
        "[sensor.range]\nmax_m = 50",
        "pinhole.width_px = 3",
        "job.toml:9:1: a sensor has one pattern, and this has both `[rotating]` and `[pinhole]` | one too many | keep one of the two; a second sensor is a `[[sensor]]` of its own",
    ),
    (
        "preset = \"sensor.toml\"",
        "",
        "job.toml:5:1: the sensor has no pattern | needs one | add `[rotating]`, `[pinhole]` or another pattern or, in a job, a `preset` that has one",
    ),
    // Wrong names and files.
    (
        "name = \"top\"",
        "name = \"a/b\"",
        "job.toml:6:8: `a/b` can't name a sensor's output folder | expected letters, digits, `-`, `_` and inner `.` | ",
    ),
    (
        "name = \"top\"",
        "name = \"..\"",
        "job.toml:6:8: `..` can't name a sensor's output folder | expected letters, digits, `-`, `_` and inner `.` | ",
    ),
    (
        "name = \"top\"",
        "name = \"Com1.x\"",
        "job.toml:6:8: `Com1.x` can't name a sensor's output folder | Windows keeps this name for a device | ",
    ),
    (
        "[sensor.range]",
        "[[sensor]]\nname = \"TOP\"\npreset = \"sensor.toml\"\n[sensor.range]",
        "job.toml:10:8: two sensors are called `top` and `TOP` | expected a name that differs in more than upper and lower case | ",
    ),
    (
        "[sensor.range]",
        "[[sensor]]\npreset = \"sensor.toml\"\n[sensor.range]",
        "job.toml:9:1: `[[sensor]]` has no `name` | needs `name` | add `name = \"top\"`: each of several sensors needs one, for its output folder",
    ),
    (
        "\"sensor.toml\"",
        "\"sensro.toml\"",
        "job.toml:7:10: the sensor file `sensro.toml` can't be used | there is no such file | did you mean `sensor.toml`?",
    ),
    (
        "\"sensor.toml\"",
        "\".\"",
        "job.toml:7:10: there is no built-in sensor `.` | expected its name, or a path that ends in `.toml` | a sensor file's name ends in `.toml`",
    ),
    // Wrong syntax.
    (
        "seed = 7",
        "seed = seven",
        "job.toml:2:8: this is not valid TOML: a text without quotes |  | write seed = \"seven\"",
    ),
    (
        "\"../scenes/room.glb\"",
        "../scenes/room.glb",
        "job.toml:1:9: this is not valid TOML: a text without quotes |  | write scene = \"../scenes/room.glb\"",
    ),
    ("seed = 7", "seed = 7\nseed = 8", "job.toml:3:1: this is not valid TOML: duplicate key |  | "),
    (
        "columns = 1800",
        "columns = ",
        "sensor.toml:5:11: this is not valid TOML: string values must be quoted | expected literal string | ",
    ),
];
