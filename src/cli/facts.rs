//! Facts about files, for people.

use std::fmt::Write as _;

use crate::run::Bytes;
use crate::run::facts::{
    AlphaFacts, BeamsFacts, DepthFacts, FileFacts, ImageFacts, MeasurementFacts, RangeShift, RangeSigma,
    SceneFacts, SensorSizes, SequenceFacts, WayFacts,
};
use crate::sensor::facts::SensorFacts;
use crate::source::words::{counted, joined, on_one_line, quoted};

/// The most labels, materials or images that a line lists.
const MOST_SHOWN: usize = 32;

/// The facts about a file as lines of text.
pub fn text(facts: &FileFacts) -> String {
    let mut text = format!("{}: {}\n", quoted(&facts.path).trim_matches('`'), facts.kind);
    if let Some(scene) = &facts.scene {
        write_scene(&mut text, scene);
    }
    for sensor in &facts.sensors {
        write_sensor(&mut text, sensor);
    }
    if let Some(sequence) = &facts.sequence {
        write_sequence(&mut text, sequence);
    }
    text
}

/// Writes a line of facts. Writing to a string can't fail.
macro_rules! fact {
    ($text:expr, $name:literal, $($what:tt)*) => {
        let _ = writeln!($text, "    {:<14}{}", $name, format_args!($($what)*));
    };
}

fn write_scene(text: &mut String, scene: &SceneFacts) {
    let _ = writeln!(text, "  scene {}", quoted(&scene.path).trim_matches('`'));
    let skipped = match scene.skipped_triangles {
        0 => String::new(),
        n => format!(", {} of zero area left out", grouped(n)),
    };
    fact!(text, "triangles", "{}{skipped}", grouped(scene.triangles));
    let [x, y, z] = scene.extent_m.map(|[low, high]| format!("{} to {}", tidy(low), tidy(high)));
    fact!(text, "extent", "x {x}, y {y}, z {z} m");
    let [x, y, z] = scene.centre_m.map(tidy);
    fact!(text, "centre", "({x}, {y}, {z}) m");
    if scene.regions > 1 {
        let rounding = tidy(scene.rounding_m * 1e3);
        fact!(
            text,
            "regions",
            "{}, vertices rounded by {rounding} mm at most",
            grouped(scene.regions.into())
        );
    }
    fact!(text, "instances", "{}", grouped(scene.instances as u64));
    fact!(text, "materials", "{}", grouped(scene.materials as u64));
    write_appearance(text, scene);
    let labels: Vec<String> =
        scene.labels.iter().take(MOST_SHOWN).map(|label| named(scene, *label)).collect();
    let more = if scene.labels.len() > MOST_SHOWN { ", …" } else { "" };
    fact!(text, "labels", "{}{more}", labels.join(", "));
    fact!(text, "memory", "about {}", Bytes(scene.memory_bytes));
}

/// Where surfaces let light pass by their alpha, and the images of their textures; nothing of a scene that has neither.
fn write_appearance(text: &mut String, scene: &SceneFacts) {
    let several = |shown: Vec<String>, count: usize| {
        let more = if count > shown.len() { format!(", … ({count} in all)") } else { String::new() };
        shown.join(", ") + &more
    };
    let alpha = |AlphaFacts { material, mode, cutoff }: &AlphaFacts| {
        let cutoff = cutoff.map_or(String::new(), |cutoff| format!(" below {cutoff}"));
        format!("{mode}{cutoff} of \"{}\"", on_one_line(material))
    };
    if !scene.alpha.is_empty() {
        let shown = scene.alpha.iter().take(MOST_SHOWN).map(alpha).collect();
        fact!(text, "alpha", "{}", several(shown, scene.alpha.len()));
    }
    let image = |ImageFacts { format, width, height, .. }: &ImageFacts| {
        format!("{width} × {height} {}", format.unwrap_or("texels"))
    };
    if !scene.images.is_empty() {
        let shown = scene.images.iter().take(MOST_SHOWN).map(image).collect();
        let count = counted(scene.images.len(), "image");
        fact!(text, "textures", "{count}: {}", several(shown, scene.images.len()));
    }
}

/// `3 "wall"`, or `3` if nothing tells what the label stands for.
fn named(scene: &SceneFacts, label: u32) -> String {
    match scene.label_names.get(&label) {
        Some(name) => format!("{label} \"{}\"", on_one_line(name)),
        None => label.to_string(),
    }
}

fn write_measurement(text: &mut String, facts: &MeasurementFacts) {
    let nominal = if facts.is_nominal { ", nominal" } else { "" };
    let tenths = |x: f64| tidy((x * 10.0).round() / 10.0);
    let percent = tidy(facts.detection * 1e2);
    let (range_10, range_80) = (tenths(facts.range_10_m), tenths(facts.range_80_m));
    fact!(
        text,
        "detects",
        "{range_10} m at 10 %, {range_80} m at 80 % reflectance, in {percent} % of pulses{nominal}"
    );
    for BeamsFacts { rows, range_10_m, range_80_m, .. } in &facts.beams {
        let (range_10, range_80) = (tenths(*range_10_m), tenths(*range_80_m));
        fact!(text, "", "{range_10} m at 10 %, {range_80} m at 80 % by rows {}{nominal}", runs(rows));
    }
    if facts.exponent != 2.0 {
        let misfit = tenths(facts.misfit * 1e2);
        let exponent = facts.exponent;
        fact!(text, "power falls", "with the range to the {exponent:.2}, off by {misfit} % at most{nominal}");
    }
    if facts.false_alarms_per_frame > 0.0 {
        fact!(text, "false alarms", "{} a frame{nominal}", tidy(facts.false_alarms_per_frame));
    }
    if let Some(spad) = &facts.spad {
        let (bin_m, blind) = (tidy(spad.bin_m), tenths(spad.blind * 1e2));
        fact!(
            text,
            "counts",
            "photons of {} cycles in bins of {bin_m} m; at {range_80} m {} are detected, and background blinds {blind} % of the \
             cycles before{nominal}",
            grouped(spad.cycles.into()),
            spad.least_counts
        );
        let shift = |shift: &RangeShift| format!("{} mm at {} m", tenths(shift.shift_m * 1e3), shift.range_m);
        let shifts: Vec<String> = spad.shifts.iter().map(shift).collect();
        if !shifts.is_empty() {
            fact!(text, "pile-up", "{} on 80 %{nominal}", shifts.join(", "));
        }
    }
    let is_exact = facts.range_sigmas.iter().all(|sigma| sigma.sigma_m == 0.0);
    if !is_exact {
        let sigma = |sigma: &RangeSigma| format!("{} mm at {} m", tenths(sigma.sigma_m * 1e3), sigma.range_m);
        let sigmas: Vec<String> = facts.range_sigmas.iter().map(sigma).collect();
        fact!(text, "range noise", "{} on 80 % (1σ){nominal}", sigmas.join(", "));
    }
}

fn write_depth(text: &mut String, facts: &DepthFacts) {
    let nominal = if facts.is_nominal { ", nominal" } else { "" };
    let least = facts.least_depth_m.map_or(String::new(), |m| format!(", from {} m on", tidy(m)));
    let repeats =
        facts.unambiguous_range_m.map_or(String::new(), |m| format!(", repeats after {} m", tidy(m)));
    fact!(text, "depth by", "{}{least}{repeats}{nominal}", facts.method);
    if facts.depth_sigmas.iter().any(|sigma| sigma.sigma_m > 0.0) {
        let sigma = |sigma: &RangeSigma| {
            format!("{} mm at {} m", tidy((sigma.sigma_m * 1e4).round() / 10.0), sigma.range_m)
        };
        let sigmas: Vec<String> = facts.depth_sigmas.iter().map(sigma).collect();
        fact!(text, "depth noise", "{} on 80 % (1σ){nominal}", sigmas.join(", "));
    }
}

/// The field of view or the size of the image, and its steps.
fn write_field(text: &mut String, facts: &SensorFacts) {
    if let (Some(image), Some(pixel)) = (facts.image_m, facts.pixel_m) {
        let ([width, height], [across, down]) = (image.map(tidy), pixel.map(|m| tidy(m * 1e3)));
        fact!(text, "image spans", "{width} m × {height} m, parallel rays");
        fact!(text, "a pixel", "{across} mm × {down} mm");
        return;
    }
    let [low, high] = facts.elevation_deg.map(tidy);
    fact!(
        text,
        "field of view",
        "{}° × {}°, elevations from {low}° to {high}°",
        tidy(facts.horizontal_fov_deg),
        tidy(facts.elevation_deg[1] - facts.elevation_deg[0])
    );
    if let Some(horizontal) = facts.azimuth_step_deg {
        let vertical = match facts.elevation_step_deg.map(|step| step.map(tidy)) {
            None => String::new(),
            Some([least, most]) if least == most => format!(" × {least}°"),
            Some([least, most]) => format!(" × {least}° to {most}°"),
        };
        let place = if facts.kind == "camera" { " in the middle" } else { "" };
        fact!(text, "steps", "{}°{vertical}{place}", tidy(horizontal));
    }
}

fn write_sensor(text: &mut String, sensor: &SensorSizes) {
    let facts = &sensor.facts;
    let name = sensor.name.as_deref().map_or(String::new(), |name| format!(" {name}"));
    let _ = writeln!(text, "  {}{name}", facts.kind);
    if let Some(stance) = &sensor.stance {
        let [x, y, z] = stance.position_m.map(tidy);
        fact!(text, "stands", "at ({x}, {y}, {z}) m, looks {}", stance.looks);
    }
    let (rows, columns) = (grouped(facts.rows as u64), grouped(facts.columns as u64));
    fact!(
        text,
        "image",
        "{rows} rows × {columns} columns, {} rays a frame",
        grouped(facts.rays_per_frame as u64)
    );
    write_field(text, facts);
    if facts.blind_pixels > 0 {
        fact!(
            text,
            "no ray for",
            "{} pixels: the model ends before them",
            grouped(facts.blind_pixels as u64)
        );
    }
    let of = if facts.limits_of == "depth" { " of depth" } else { "" };
    match facts.max_range_m {
        Some(max) => {
            fact!(text, "range", "{} m to {} m{of}", tidy(facts.min_range_m), tidy(max));
        }
        None => {
            fact!(text, "range", "{} m, without an upper limit{of}", tidy(facts.min_range_m));
        }
    }
    if let Some(measurement) = &sensor.measurement {
        write_measurement(text, measurement);
    }
    if let Some(depth) = &sensor.depth {
        write_depth(text, depth);
    }
    if let (Some(rate), Some(points)) = (facts.rate_hz, facts.points_per_second) {
        fact!(text, "rate", "{} Hz, at most {} points a second", tidy(rate), grouped(points.round() as u64));
    }
    if facts.frame_s > 0.0 {
        fact!(text, "frame takes", "{} ms", tidy(facts.frame_s * 1e3));
    }
    fact!(text, "memory", "{} a frame", Bytes(sensor.frame_bytes));
    let files: Vec<String> = sensor
        .output_bytes
        .iter()
        .map(|(format, size)| format!("{format} {}", Bytes(size.as_u64().unwrap_or(0))))
        .collect();
    fact!(text, "output", "{} a frame, uncompressed", files.join(", "));
}

fn write_sequence(text: &mut String, sequence: &SequenceFacts) {
    let SequenceFacts { frames, start_s, duration_s, rays, output_bytes, way } = sequence;
    let _ = writeln!(text, "  sequence");
    let frames: Vec<String> =
        frames.iter().map(|(sensor, count)| format!("{} of {sensor}", grouped(*count))).collect();
    fact!(text, "frames", "{}", frames.join(", "));
    fact!(text, "time", "{} s to {} s", tidy(*start_s), tidy(start_s + duration_s));
    fact!(text, "rays", "{}", grouped(*rays));
    fact!(text, "output", "at most {}: all files before compression", Bytes(*output_bytes));
    if let Some(WayFacts { length_m, speed_m_s: [least, most] }) = way {
        fact!(text, "way", "{} m at {} to {} m/s", tidy(*length_m), tidy(*least), tidy(*most));
    }
}

/// Whole numbers in words, those that follow each other by their ends: `0 to 7, 9 and 24 to 31`.
pub fn runs(numbers: &[usize]) -> String {
    let mut sorted = numbers.to_vec();
    sorted.sort_unstable();
    sorted.dedup();
    let parts: Vec<String> = sorted
        .chunk_by(|a, b| a + 1 == *b)
        .flat_map(|run| match run {
            [first, .., last] if run.len() > 2 => vec![format!("{first} to {last}")],
            _ => run.iter().map(usize::to_string).collect(),
        })
        .collect();
    joined(&parts, "and")
}

/// Rounds a number to four decimals, for display.
pub fn tidy(x: f64) -> f64 {
    let rounded = (x * 1e4).round() / 1e4;
    if rounded == 0.0 { 0.0 } else { rounded }
}

/// `1234567` as `1,234,567`.
pub fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_readable() {
        assert_eq!([0, 999, 1000, 1_234_567].map(grouped), ["0", "999", "1,000", "1,234,567"]);
        assert_eq!(tidy(-0.00001).to_string(), "0");
    }

    #[test]
    fn numbers_that_follow_each_other_are_told_by_their_ends() {
        let shown = [&[][..], &[3], &[4, 3], &[9, 2, 0, 1, 9], &[0, 1, 2, 24, 25, 26, 28]].map(runs);
        assert_eq!(shown, ["", "3", "3 and 4", "0 to 2 and 9", "0 to 2, 24 to 26 and 28"]);
    }

    #[test]
    fn facts_are_told_in_lines() {
        let facts = SensorFacts {
            kind: "LiDAR",
            rows: 3,
            columns: 360,
            rays_per_frame: 1080,
            horizontal_fov_deg: 360.0,
            elevation_deg: [-20.0, 10.0],
            azimuth_step_deg: Some(1.0),
            elevation_step_deg: Some([2.0, 28.0]),
            image_m: None,
            pixel_m: None,
            rate_hz: Some(10.0),
            points_per_second: Some(10_800.0),
            min_range_m: 0.5,
            max_range_m: Some(50.0),
            limits_of: "range",
            frame_s: 0.0997,
            blind_pixels: 0,
        };
        let output_bytes = [("exr".to_owned(), 43_200.into())].into_iter().collect();
        let sensor = SensorSizes {
            measurement: Some(MeasurementFacts {
                is_nominal: true,
                range_10_m: 90.0,
                range_80_m: 170.0,
                beams: vec![BeamsFacts {
                    rows: vec![0, 2],
                    range_10_m: 45.0,
                    range_80_m: 120.0,
                    misfit: 0.0,
                }],
                detection: 0.9,
                exponent: 3.27,
                misfit: 0.0,
                spad: None,
                false_alarms_per_frame: 0.108,
                range_sigmas: vec![RangeSigma { range_m: 10.0, sigma_m: 0.0123 }],
            }),
            depth: None,
            name: Some("top".to_owned()),
            stance: None,
            facts,
            frame_bytes: 51_840,
            output_bytes,
        };
        let scene = SceneFacts {
            path: "a.glb".to_owned(),
            triangles: 6,
            stored_triangles: 2,
            skipped_triangles: 0,
            instances: 3,
            materials: 1,
            alpha: vec![
                AlphaFacts { material: "leaf\n".to_owned(), mode: "MASK", cutoff: Some(0.5) },
                AlphaFacts { material: "pane".to_owned(), mode: "BLEND", cutoff: None },
            ],
            images: vec![ImageFacts { format: Some("PNG"), width: 512, height: 256, materials: 1 }],
            labels: vec![3, 7],
            label_names: [(7, "wall, \n…".to_owned())].into(),
            extent_m: [[0.0, 5.0], [0.0, 1.0], [0.0, 0.0]],
            centre_m: [2.5, 0.5, 0.0],
            rounding_m: 3e-6,
            regions: 2,
            memory_bytes: 200,
        };
        let sequence = SequenceFacts {
            frames: [("top".to_owned(), 1200)].into(),
            start_s: 0.5,
            duration_s: 120.0,
            rays: 1_296_000,
            output_bytes: 51_840_000,
            way: Some(WayFacts { length_m: 1800.0, speed_m_s: [14.0, 16.0] }),
        };
        let file = FileFacts {
            path: "a.toml".to_owned(),
            kind: "job",
            sensors: vec![sensor],
            sequence: Some(sequence),
            scene: Some(scene),
        };
        let text = text(&file);
        for line in [
            "a.toml: job\n",
            "  LiDAR top\n",
            "3 rows × 360 columns, 1,080 rays a frame\n",
            "1° × 2° to 28°\n",
            "    detects       90 m at 10 %, 170 m at 80 % reflectance, in 90 % of pulses, nominal\n",
            "                  45 m at 10 %, 120 m at 80 % by rows 0 and 2, nominal\n",
            "    power falls   with the range to the 3.27, off by 0 % at most, nominal\n",
            "    false alarms  0.108 a frame, nominal\n",
            "    range noise   12.3 mm at 10 m on 80 % (1σ), nominal\n",
            "exr 43.2 kB a frame, uncompressed\n",
            "extent        x 0 to 5, y 0 to 1, z 0 to 0 m\n",
            "alpha         MASK below 0.5 of \"leaf\\n\", BLEND of \"pane\"\n",
            "textures      1 image: 512 × 256 PNG\n",
            "regions       2, vertices rounded by 0.003 mm at most\n",
            "  sequence\n    frames        1,200 of top\n    time          0.5 s to 120.5 s\n",
            "output        at most 51.8 MB: all files before compression\n    way           1800 m at 14 to 16 m/s\n",
            "labels        3, 7 \"wall, \\n…\"\n",
        ] {
            assert!(text.contains(line), "{line:?} in:\n{text}");
        }
    }
}
