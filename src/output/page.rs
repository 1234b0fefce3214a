//! The page of all formats, in Markdown, made of their declarations.

use std::fmt::Write as _;

use super::channel::{CHANNELS, Sensors, Values, is_of_all_pixels};
use super::format::{Content, Field};
use super::registry::Format;

const INTRODUCTION: &str = "\
# Formats

What the files of a scan are, made of the program's own declarations: `beamcast schema formats` prints this page, and a test
holds it to the program. A job names its formats in `output.formats`, each by its name or by a table with options:

```toml
[output]
dir = \"../out\"
formats = [\"exr\", { format = \"depth16\", scale = 5000 }, { format = \"labels\", palette = true }]
channels = [\"range\", \"Z\", \"id.semantic\"]
```

A file is `SENSOR/000000.ENDING`, one a frame, or run.ENDING for all frames where an option asks for it. All numbers are little-endian but for PNG's, which are big-endian, and the same
frame gives the same bytes everywhere.

A PNG of numbers tells its channel in a text under `beamcast:channel`, and a depth image its `beamcast:scale`: the depth in metres
is the pixel's number divided by the scale. Of several returns of a pixel, PNGs of numbers and organised PCDs have the first, and
clouds have all.

```python
depth_m = cv2.imread(\"front/000000.depth16.png\", cv2.IMREAD_UNCHANGED) / 5000  # OpenCV 4 and 5, without EXR
labels = numpy.asarray(PIL.Image.open(\"front/000000.labels.png\"))
points = numpy.load(\"top/000000.npy\")  # points[\"x\"], points[\"intensity\"], points[\"label\"], …
cloud = open3d.t.io.read_point_cloud(\"top/000000.pcd\")
```
";

const CHANNELS_INTRODUCTION: &str = "
## Channels

What formats of channels hold: arrays of rows and columns, one number a pixel. A row is a beam, highest first, or a line of a
camera's image. `output.channels` chooses; left out, all are there but flow, velocity
and id.track, which have to be named. An EXR has besides a channel `Y`, the name that OpenCV reads:
it repeats Z of a camera and range of a LiDAR where those are chosen. Where a pixel has several returns, an EXR has a part
for each number of return, and an NPZ has the first under the plain names and the others under `return1/range` and so on.

In an NPZ, the three axes of the normal are one array `normal` of rows × columns × 3 if all are chosen, and the array `about`
is text: JSON with the pose, the names behind ids, and the shape, type and unit of each array.

```python
arrays = numpy.load(\"top/000000.npz\")
seen = numpy.isfinite(arrays[\"range\"])
pose = json.loads(arrays[\"about\"].item())[\"world_from_sensor\"]
```

| channel | type | unit | without a return | sensors | |
|---|---|---|---|---|---|
";

const WAVEFORM_INTRODUCTION: &str = "\
A waveform is the mean of what the receiver gets of a pulse, before its noise: the exact sum of Gaussians
Σ amplitude·exp(−(r − range)²/2·sigma²) over the range r that the sensor reports of light that took as long; the time since the
pulse is 2·r/c. It is never cut into bins, and `beamcast explain` tells the same of one pixel. Ideal sensors have none. Pixels
count row by row, and pixel i has the Gaussians `offsets[i]` to `offsets[i + 1]`, the nearest first; a pixel without a pulse, or to
which no light comes back, has none. With the option `bin_m` there are samples of the same sum besides.

```python
arrays = numpy.load(\"top/000000.waveform.npz\")
about = json.loads(arrays[\"about\"].item())  # threshold, noise, unit, the times of samples, the pose
pixel = row * about[\"columns\"] + column
own = slice(*arrays[\"offsets\"][pixel : pixel + 2])
z = (r[:, None] - arrays[\"range\"][own]) / arrays[\"sigma\"]
height = (arrays[\"amplitude\"][own] * numpy.exp(-0.5 * z**2)).sum(axis=1)
```

";

const LAS_INTRODUCTION: &str = "\
Points have the record format 6. After the fields of LAS come extra dimensions, described in the file as LAS demands, then those of the
options `terms` and `motion` and of sensors that are not ideal: `unsigned long` for `return`, `cause` and `track`, `float` for all
others. `return` counts from 0 without an end, where `return_number` ends at 15. In the file of a run, a dimension that a point's
sensor lacks is 0. `intensity` is that of the EXR times 65535 over the top of the sensor's scale, such as 257 for a scale up to 255; a
scale without a top has white at 65535, and `reflectivity` for what is brighter.

The times of pulses are `start_s` of the frame plus the pulse's own time. The header's bit for GPS time says seconds of a week, because LAS
has no other time that begins at 0. Dates and the GUID of the header are 0. In the file of a frame, the record `beamcast` 1 is JSON
with `world_from_points`, the pose that LAS has no field for.

```python
cloud = laspy.read(\"out/run.laz\")  # pip install laspy[lazrs]
cloud.xyz, cloud.gps_time, cloud[\"range\"], cloud.header.parse_crs()
```

";

const E57_INTRODUCTION: &str = "\
A file has one scan, whose `pose` is `world_from_points`. E57 has no field for labels, objects and beams that its readers would take.

```python
scan = pye57.E57(\"top/000000.e57\").read_scan(0, intensity=True, row_column=True)  # in the world
```

";

/// The page.
pub fn formats_page() -> String {
    let mut page = INTRODUCTION.to_owned();
    page.push_str("\n| format | files | | options | read back with |\n|---|---|---|---|---|\n");
    for format in Format::all() {
        let spec = format.spec;
        let anchor = format!("[options](keys.md#the-format-{})", spec.name);
        let options = if spec.options.is_empty() { "" } else { &anchor };
        let (name, ending, about, read_by) = (spec.name, spec.ending, spec.about, spec.read_by);
        let _ = writeln!(page, "| `{name}` | `000000.{ending}` | {about} | {options} | {read_by} |");
    }
    page.push_str(CHANNELS_INTRODUCTION);
    for channel in &CHANNELS {
        let kind =
            if matches!(channel.values, Values::F32(_) | Values::Image(_)) { "float32" } else { "uint32" };
        let sensors = match channel.sensors {
            Sensors::All => "all",
            Sensors::Cameras => "cameras",
            Sensors::Measured => "those that are not ideal",
            Sensors::Pulsed => "LiDARs that are not ideal",
            Sensors::Stereo => "stereo cameras",
            Sensors::TimeOfFlight => "time-of-flight cameras",
        };
        let (name, unit, none, about) = (channel.name, channel.unit, channel.no_return, channel.about);
        let none = if is_of_all_pixels(channel.name) { String::new() } else { none.to_string() };
        let _ = writeln!(page, "| `{name}` | {kind} | {unit} | {none} | {sensors} | {about} |");
    }
    for format in Format::all() {
        let (what, fields) = match format.spec.content {
            Content::Channels => continue,
            Content::Points(fields) => ("A point", fields),
            Content::Pixels(fields) => ("A pixel", fields),
            Content::Lines(fields) => ("A line", fields),
            Content::Arrays(fields) => ("An array", fields),
        };
        let _ = writeln!(page, "\n## {}\n\n{what} of {}.\n", format.name(), format.spec.about);
        if format.tells_waveforms() {
            page.push_str(WAVEFORM_INTRODUCTION);
        }
        page.push_str(match format.name() {
            "las" => LAS_INTRODUCTION,
            "e57" => E57_INTRODUCTION,
            _ => "",
        });
        page.push_str("| field | type | unit or meaning |\n|---|---|---|\n");
        for Field { name, kind, unit } in fields {
            let _ = writeln!(page, "| {name} | `{kind}` | {unit} |");
        }
    }
    page
}
