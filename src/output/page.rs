//! The page of all formats, in Markdown, made of their declarations.

use std::fmt::Write as _;

use super::channel::{CHANNELS, Sensors, is_of_all_pixels};
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

A file is `SENSOR/000000.ENDING`, one a frame, but for the files of a whole run, which lie in the output folder itself: some formats
have no others, and some have them where an option asks for it. The formats that are folders say below which files they have. All
numbers are little-endian but for PNG's, which are big-endian, and the same
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

A deep EXR has a list of samples for each pixel, sample k of return k, and none where nothing came back. `Z`, by which programs for
deep images sort, is always there: it is the depth of a camera, and the range of any other sensor. The samples are in the order of the
returns, which need not be that of their depths.

In an NPZ, the three axes of the normal are one array `normal` of rows × columns × 3 if all are chosen, and the array `about`
is text: JSON with the pose, the names behind ids, and the shape, type and unit of each array.

```python
arrays = numpy.load(\"top/000000.npz\")
seen = numpy.isfinite(arrays[\"range\"])
pose = json.loads(arrays[\"about\"].item())[\"world_from_sensor\"]
deep = OpenEXR.File(\"top/000000.deep.exr\", separate_channels=True)
ranges = deep.channels()[\"range\"].pixels[row, column]  # an array of the pixel's returns, or None
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

/// The page's text about a format, beside its fields.
fn prose(format: Format) -> &'static str {
    match format.name() {
        _ if format.tells_waveforms() => WAVEFORM_INTRODUCTION,
        "las" => LAS_INTRODUCTION,
        "e57" => E57_INTRODUCTION,
        "kitti" => KITTI_INTRODUCTION,
        "nuscenes" => NUSCENES_INTRODUCTION,
        _ => "",
    }
}

const KITTI_INTRODUCTION: &str = "\
The folder of a sensor is a sequence of the odometry benchmark. Points are in the frame of the job's clouds, with x forward for every
sensor: with `cloud_time` they are compensated as KITTI's are, left out they are raw, and their pose is that of the frame's start.
`Tr` turns axes and moves nothing, so a reader that computes inv(Tr)·P·Tr gets the pose of the points. Poses and times count from the
first frame of the run. Tools that want `sequences/00` and `poses/00.txt` are given links. A box's bounds are those of its vertices in the
image, cut off at its edges; pixels have their centres at whole numbers, as in P0 to P3, which know no distortion of the lens. The
bottom's centre is exact, and only the turn about the camera's y axis is there: of a camera that is tilted, boxes are tilted with it.

";

const NUSCENES_INTRODUCTION: &str = "\
The kit is given the folder `nuscenes` and the version `v1.0-beamcast`. Name the sensors of a job as the kit knows them, such as
`LIDAR_TOP` and `CAM_FRONT`. Each frame of the sensor that has the fewest is a sample; of every other sensor, the frame that starts
nearest is its key frame, and the rest are sweeps, which lie in the same folder. Points have x forward, unlike those of nuScenes' own LiDAR,
whose x is right: `calibrated_sensor` says so. The time of a frame is that of its start, or that which `cloud_time` compensates to. An
annotation has the box as the LiDAR's key frame saw it, else the first camera's, at the time of its points; its visibility is that of all
cameras' pixels, or of the LiDARs' where no camera could see it. Categories are the job's labels.

```python
kit = NuScenes(\"v1.0-beamcast\", \"out/nuscenes\", colormap=collections.defaultdict(lambda: (0, 0, 0)))
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
with `points`, the frame of the points, and `world_from_points`, the pose that LAS has no field for. In one that `convert` wrote,
the record `beamcast` 2 has the comments of the cloud, a line each, and fields whose values LAS's own could not hold are extra dimensions,
such as `reflectivity`.

```python
cloud = laspy.read(\"out/run.laz\")  # pip install laspy[lazrs]
cloud.xyz, cloud.gps_time, cloud[\"range\"], cloud.header.parse_crs()
```

";

const E57_INTRODUCTION: &str = "\
A file has one scan, whose `pose` is `world_from_points`. E57 has no field for labels, objects and beams that its readers would take.
Of an E57 that is read, one scan's points stay in their own frame, with the pose as a PCD's `VIEWPOINT`; those of several scans are carried
into the file's frame, and `scan` numbers them.

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
        let of_stream = format.stream_files().join("`, `");
        let files = match spec.content {
            Content::Files(_) => format!("[a folder](#{name})"),
            _ if of_stream.is_empty() => format!("`000000.{ending}`"),
            _ => format!("`{of_stream}`"),
        };
        let _ = writeln!(page, "| `{name}` | {files} | {about} | {options} | {read_by} |");
    }
    page.push_str(CHANNELS_INTRODUCTION);
    for channel in &CHANNELS {
        let kind = if channel.is_measurement() { "float32" } else { "uint32" };
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
            Content::Messages(text) => {
                let _ = writeln!(page, "\n## {}\n\n{}", format.name(), text().trim_end());
                continue;
            }
            Content::Points(fields) => ("A point", fields),
            Content::Pixels(fields) => ("A pixel", fields),
            Content::Lines(fields) => ("A line", fields),
            Content::Arrays(fields) => ("An array", fields),
            Content::Files(fields) => ("The files", fields),
        };
        let _ = writeln!(page, "\n## {}\n\n{what} of {}.\n", format.name(), format.spec.about);
        page.push_str(prose(format));
        let place = if matches!(format.spec.content, Content::Files(_)) { "file" } else { "field" };
        let _ = writeln!(page, "| {place} | type | unit or meaning |\n|---|---|---|");
        for Field { name, kind, unit } in fields {
            let _ = writeln!(page, "| {name} | `{kind}` | {unit} |");
        }
    }
    page
}
