//! The shipped jobs against ranges that Open3D (Embree) found for the same rays. `python tests/open3d/check.py
//! --write-tables configs/*.toml`, which makes rays and triangles independently, wrote the tables tests/open3d/*.tsv.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use exr::prelude::{FlatSamples, ReadChannels, ReadLayers, read};

/// The pixels of each sensor, by its name.
type Sensors = Vec<(String, Vec<Pixel>)>;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn files(folder: &str, extension: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(root().join(folder)).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<_> = entries.filter(|path| path.extension().is_some_and(|e| e == extension)).collect();
    files.sort();
    files
}

/// One pixel of a table: its row, its column, its range (infinite for a miss), and the tolerance of the range in metres.
type Pixel = (usize, usize, f64, f64);

fn read_table(path: &Path) -> Vec<Pixel> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("row\tcolumn\trange_m\ttolerance_m"), "{}", path.display());
    let pixel = |line: &str| {
        let mut fields = line.split('\t');
        let mut next = || fields.next().unwrap_or_else(|| panic!("{}: {line}", path.display()));
        let (row, column) = (next().parse().unwrap(), next().parse().unwrap());
        (row, column, next().parse().unwrap(), next().parse().unwrap())
    };
    lines.map(pixel).collect()
}

/// The image's channel `range`, and its width.
fn read_ranges(path: &Path) -> (Vec<f32>, usize) {
    let image =
        read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let layer = image.from_file(path).unwrap().layer_data;
    let mut channels = layer.channel_data.list.into_iter();
    match channels.find(|channel| channel.name.eq("range")).unwrap().sample_data {
        FlatSamples::F32(samples) => (samples, layer.size.width()),
        other => panic!("range is {other:?}"),
    }
}

#[test]
fn shipped_jobs_see_what_open3d_sees() {
    // By job, for each sensor and frame: `job.sensor.tsv` is of frame 0, and `job.sensor.000037.tsv` of a frame of a drive.
    let mut tables: BTreeMap<String, BTreeMap<u64, Sensors>> = BTreeMap::new();
    for path in files("tests/open3d", "tsv") {
        let name = path.file_stem().unwrap().to_str().unwrap();
        let (job, rest) = name.split_once('.').unwrap();
        let (sensor, frame) = rest.split_once('.').unwrap_or((rest, "0"));
        let frames = tables.entry(job.to_owned()).or_default();
        frames.entry(frame.parse().unwrap()).or_default().push((sensor.to_owned(), read_table(&path)));
    }
    let out = tempfile::tempdir().unwrap();
    for job in files("configs", "toml") {
        let name = job.file_stem().unwrap().to_str().unwrap();
        // Open3D's rays have no width and no noise, and it has no depth cameras.
        if name.ends_with("_measured") || name == "warehouse_cameras" {
            continue;
        }
        let frames = tables.remove(name).unwrap_or_else(|| panic!("no table in tests/open3d for {name}"));
        for (frame, sensors) in frames {
            let folder = out.path().join(format!("{name}.{frame}"));
            let run = super::cli::program()
                .args(["scan", "-q", "--set", "output.formats=[\"exr\"]"])
                .args(["--frames", &format!("{frame}..{}", frame + 1)])
                .args([&job, Path::new("--out"), &folder])
                .output()
                .unwrap();
            assert!(run.status.success(), "{name}: {}", String::from_utf8_lossy(&run.stderr));
            for (sensor, pixels) in sensors {
                let path = folder.join(&sensor).join(format!("{frame:06}.exr"));
                same_ranges(&format!("{name}/{sensor}/{frame}"), &path, &pixels);
            }
        }
    }
    assert!(tables.is_empty(), "tables of no job: {:?}", tables.keys());
}

/// Compares an image with what Open3D found for some of its pixels.
fn same_ranges(name: &str, image: &Path, pixels: &[Pixel]) {
    let (ranges, width) = read_ranges(image);
    let (mut hits, mut misses) = (0, 0);
    for &(row, column, theirs, tolerance) in pixels {
        let ours = f64::from(ranges[row * width + column]);
        let at = format!("{name}, row {row}, column {column}: {ours} m, Open3D {theirs} m");
        if theirs.is_finite() {
            hits += 1;
            assert!((ours - theirs).abs() <= tolerance, "{at}, ± {tolerance} m");
        } else {
            misses += 1;
            assert_eq!(ours, f64::INFINITY, "{at}");
        }
    }
    // The table must have enough hits and misses to be a test.
    assert!(hits >= 400 && hits + misses >= 800, "{name}: {hits} hits, {misses} misses");
}
