//! `beamcast diff`: compares two outputs, channel by channel.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::builder::StringValueParser;
use serde_json::{Value, json};

use super::interrupt::Interrupt;
use super::job::{SceneArgs, load_job, load_scene};
use super::json;
use super::shell::suggesting;
use super::terminal::Terminal;
use super::threads;
use crate::check::cloud::{CloudDifference, compare_clouds};
use crate::check::compare::{ChannelDifference, ImageDifference, compare};
use crate::check::{Tolerance, confusion_words, difference_picture, phrasing, report};
use crate::error::Error;
use crate::output::recorded::Cloud;
use crate::output::{CHANNEL_NAMES, Image, write_file};
use crate::run::sides::{Content, Side};
use crate::run::{Holding, Plan, Session, memory};
use crate::source::is_config;
use crate::source::words::{counted, joined, on_one_line};

/// The arguments of `beamcast diff`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// An EXR, a PLY, a folder that a scan wrote, or a job, which is run
    a: PathBuf,
    /// The same, to compare with: the newer one
    b: PathBuf,
    /// Let a channel (or a cloud's field) differ by this much, such as range=0.001 or intensity=1%; can be given again
    /// [default: not at all]
    #[arg(long = "tolerance", value_name = "CHANNEL=VALUE", value_parser = parse_tolerance)]
    tolerances: Vec<(String, Tolerance)>,
    /// Let this part of the pixels differ by more, 0 to 1
    #[arg(long, value_name = "SHARE", default_value = "0", value_parser = parse_share)]
    pixels: f64,
    /// Write a picture of the places where a channel differs
    #[arg(long, value_name = "FILE")]
    png: Option<PathBuf>,
    /// Show this channel in the picture
    #[arg(long, value_name = "CHANNEL", default_value = "range", requires = "png",
          value_parser = suggesting(StringValueParser::new(), || CHANNEL_NAMES.to_vec()), hide_possible_values = true)]
    channel: String,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    scenes: SceneArgs,
    #[command(flatten)]
    pub threads: threads::Args,
}

fn parse_tolerance(text: &str) -> Result<(String, Tolerance), String> {
    let (channel, value) = text.split_once('=').ok_or("expected CHANNEL=VALUE, such as range=0.001")?;
    let (number, is_relative) = match value.strip_suffix('%') {
        Some(percent) => (percent, true),
        None => (value, false),
    };
    let number: f64 = number.trim().parse().map_err(|_| format!("{value:?} is no number"))?;
    if !(number >= 0.0 && number.is_finite()) {
        return Err(format!("{value} is no tolerance: expected 0 or more"));
    }
    let tolerance = match is_relative {
        true => Tolerance { relative: number / 100.0, ..Tolerance::default() },
        false => Tolerance { absolute: number, ..Tolerance::default() },
    };
    Ok((channel.to_owned(), tolerance))
}

fn parse_share(text: &str) -> Result<f64, String> {
    let share: f64 = text.parse().map_err(|_| format!("{text:?} is no number"))?;
    if (0.0..=1.0).contains(&share) {
        Ok(share)
    } else {
        Err("expected a part of the whole, 0 to 1".to_owned())
    }
}

/// Compares two sides, prints the differences, and fails if one exceeds its tolerance.
///
/// # Errors
/// [`Error::Difference`] if something differs beyond its tolerance; [`Error::Input`] or an error of a job if a side can't be
/// read or run.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let interrupt = Interrupt::watch()?;
    let a = side(&args.a, args, 0, terminal, &interrupt)?;
    let b = side(&args.b, args, a.memory(), terminal, &interrupt)?;
    for (name, _) in &args.tolerances {
        let known = CHANNEL_NAMES.contains(&name.as_str()) || a.has(name) || b.has(name);
        if !known {
            return Err(Error::Usage(format!(
                "there is no channel or field {name:?}: they are {}",
                CHANNEL_NAMES.join(", ")
            )));
        }
    }
    let pairs = a.pairs(&b, [&args.a, &args.b])?;
    // The newer side's words for a label come first.
    let labels: BTreeMap<u32, String> =
        a.labels.iter().chain(&b.labels).map(|(n, l)| (*n, l.clone())).collect();
    let mut found = Vec::new();
    for (name, a, b) in pairs {
        found.push(compare_items(args, &name, a, b, &labels)?);
    }
    let is_same = found.iter().all(|pair| pair.within);
    if args.json {
        let pairs: Vec<&Value> = found.iter().map(|pair| &pair.json).collect();
        terminal.json(&json::DIFF.of(json!({ "same": is_same, "pairs": pairs })))?;
    } else {
        terminal.print(&found.iter().map(|pair| pair.text.as_str()).collect::<String>())?;
    }
    if is_same {
        return Ok(());
    }
    Err(Error::Difference(format!("{} differs from {}", args.b.display(), args.a.display())))
}

/// Reads a side, or runs it if it is a job. `held` are the bytes that the other side takes already.
fn side(
    path: &Path,
    args: &Args,
    held: u64,
    terminal: &Terminal,
    interrupt: &Interrupt,
) -> Result<Side, Error> {
    if !is_config(path) {
        return Side::of_recording(path, memory::for_recordings());
    }
    let job = load_job(path, &[], terminal)?;
    let plan = Plan::of(&job, Holding::Images)?;
    memory::check("the rig, beside what it is compared with,", plan.bytes.saturating_add(held))?;
    let scene = load_scene(&job, &args.scenes, terminal)?.scene;
    interrupt.check()?;
    plan.check_scene(&scene)?;
    let session = Session::open(job, &scene);
    terminal.with_progress(plan.rays, interrupt.progress(), || {
        let mut side = Side::of_session(&session);
        for item in &plan.items {
            let frame = session.cast(item, interrupt.progress());
            interrupt.check()?;
            if let Some(frame) = frame {
                side.add_frame(&session, item, &frame);
            }
        }
        Ok(side)
    })
}

struct Found {
    within: bool,
    text: String,
    json: Value,
}

fn compare_items(
    args: &Args,
    name: &str,
    a: &Content,
    b: &Content,
    labels: &BTreeMap<u32, String>,
) -> Result<Found, Error> {
    match (a, b) {
        (Content::Image(a), Content::Image(b)) => compare_images(args, name, a, b, labels),
        (Content::Cloud(a), Content::Cloud(b)) => compare_two_clouds(args, name, a, b),
        _ => Err(Error::Usage(format!(
            "{} and {}: an image and a cloud can't be compared",
            args.a.display(),
            args.b.display()
        ))),
    }
}

fn compare_images(
    args: &Args,
    name: &str,
    a: &Image,
    b: &Image,
    labels: &BTreeMap<u32, String>,
) -> Result<Found, Error> {
    let prefix = if name.is_empty() { String::new() } else { format!("{}: ", on_one_line(name)) };
    if (a.rows, a.columns) != (b.rows, b.columns) {
        let text = format!("{prefix}{} × {} and {} × {} pixels\n", a.rows, a.columns, b.rows, b.columns);
        let sizes = json!({ "name": name, "sizes": [[a.rows, a.columns], [b.rows, b.columns]] });
        return Ok(Found { within: false, text, json: sizes });
    }
    let tolerance = |channel: &str| {
        let given = args.tolerances.iter().rev().find(|(name, _)| name == channel);
        Tolerance { pixels: args.pixels, ..given.map_or(Tolerance::default(), |(_, tolerance)| *tolerance) }
    };
    let difference = compare(a, b, &tolerance, &|_| 0.0);
    let found = difference.channels.iter().find(|c| c.channel == args.channel);
    if let (Some(path), Some(channel)) = (&args.png, found) {
        // Each of several images has a picture of its own.
        let path = match name.split('/').next() {
            Some(sensor) if !sensor.is_empty() => {
                let stem = path.file_stem().unwrap_or_default().to_string_lossy();
                path.with_file_name(format!("{stem}.{sensor}.png"))
            }
            _ => path.clone(),
        };
        if let Some(picture) = difference_picture(&prefix, a, b, channel) {
            write_file(&path, &picture.to_png().map_err(|e| Error::output(&path, e))?)?;
        }
    }
    let within = difference.missing.is_empty()
        && difference.added.is_empty()
        && difference.channels.iter().all(|channel| channel.within_tolerance);
    let text = image_text(&prefix, &difference, b, within, labels);
    let channels: Vec<Value> =
        difference.channels.iter().map(|channel| report::channel(channel, b.columns)).collect();
    let confusion: Vec<Value> = difference
        .label_confusion
        .iter()
        .map(|c| {
            json!({
                "was": c.was,
                "was_name": labels.get(&c.was),
                "is": c.is,
                "is_name": labels.get(&c.is),
                "pixels": c.pixels,
            })
        })
        .collect();
    let points: Vec<Value> = difference
        .points_per_label
        .iter()
        .map(|(label, [a, b])| json!({ "label": label, "name": labels.get(label), "a": a, "b": b }))
        .collect();
    let json = json!({
        "name": name,
        "rows": b.rows,
        "columns": b.columns,
        "within_tolerance": within,
        "iou": difference.mask.iou(),
        "both": difference.mask.both,
        "appeared": difference.mask.appeared,
        "vanished": difference.mask.vanished,
        "missing": difference.missing,
        "added": difference.added,
        "channels": channels,
        "label_confusion": confusion,
        "points_per_label": points,
    });
    Ok(Found { within, text, json })
}

fn image_text(
    prefix: &str,
    difference: &ImageDifference,
    image: &Image,
    within: bool,
    labels: &BTreeMap<u32, String>,
) -> String {
    let mut text = String::new();
    let differing: Vec<&ChannelDifference> = difference
        .channels
        .iter()
        .filter(|c| c.differing.count() > 0 || c.statistics.is_some_and(|s| s.max > 0.0))
        .collect();
    let mask = difference.mask;
    if differing.is_empty() && within {
        let size = format!("{} × {}", image.rows, image.columns);
        let _ = writeln!(text, "{prefix}the same, {size} pixels, {}", counted(mask.both, "return"));
        return text;
    }
    let verdict = if within { "within tolerance" } else { "different" };
    let _ = writeln!(
        text,
        "{prefix}{verdict}: {} in both, {} appeared, {} vanished (IoU {:.6})",
        counted(mask.both, "return"),
        counted(mask.appeared, "return"),
        counted(mask.vanished, "return"),
        mask.iou()
    );
    for (which, names) in [("first", &difference.missing), ("second", &difference.added)] {
        if !names.is_empty() {
            let _ = writeln!(text, "  only the {which} has {}", on_one_line(&joined(names, "and")));
        }
    }
    if !differing.is_empty() {
        let _ = writeln!(
            text,
            "  {:<12} {:>10} {:>12} {:>12} {:>12} {:>12}  where",
            "channel", "pixels", "max", "mean", "RMS", "p99"
        );
    }
    let main = image.main_depth().map(|(name, _)| name);
    for c in differing {
        let number = |value: Option<f64>| value.map_or("-".to_owned(), phrasing::digits);
        let s = c.statistics;
        let region = phrasing::Region::of(&c.pixels, image.columns).words((image.rows, image.columns));
        let region = if region.is_empty() && !c.pixels.is_empty() { "all over".to_owned() } else { region };
        let _ = writeln!(
            text,
            "  {:<12} {:>10} {:>12} {:>12} {:>12} {:>12}  {region}{}",
            on_one_line(&c.channel),
            c.differing.count(),
            number(s.map(|s| s.max)),
            number(s.map(|s| s.mean)),
            number(s.map(|s| s.rms)),
            number(s.map(|s| s.p99)),
            if Some(c.channel.as_str()) == main && mask.appeared + mask.vanished > 0 {
                " (with what appeared and vanished)"
            } else {
                ""
            }
        );
    }
    for c in difference.label_confusion.iter().take(10) {
        let _ = writeln!(text, "  {}", confusion_words(c, labels));
    }
    for (label, [a, b]) in difference.points_per_label.iter().filter(|(_, [a, b])| a != b) {
        let name = labels.get(label).map_or(String::new(), |name| format!(" {name:?}"));
        let _ = writeln!(text, "  label {label}{name}: {a} → {}", counted(*b, "point"));
    }
    text
}

fn compare_two_clouds(args: &Args, name: &str, a: &Cloud, b: &Cloud) -> Result<Found, Error> {
    let tolerance = |field: &str| {
        let given = args.tolerances.iter().rev().find(|(name, _)| name == field);
        given.map_or(0.0, |(_, tolerance)| tolerance.absolute)
    };
    let difference = compare_clouds(a, b, &tolerance).map_err(|e| Error::input(&args.b, e))?;
    let prefix = if name.is_empty() { String::new() } else { format!("{}: ", on_one_line(name)) };
    let mut text = String::new();
    Ok(match difference {
        CloudDifference::SameLayout { fields } => {
            let may = (args.pixels * a.points as f64) as usize;
            let within = fields.iter().all(|field| field.differing <= may);
            if fields.iter().all(|field| field.max == 0.0) {
                let _ = writeln!(text, "{prefix}the same, {}", counted(a.points, "point"));
            } else {
                let verdict = if within { "within tolerance" } else { "different" };
                let _ = writeln!(text, "{prefix}{verdict}, {}", counted(a.points, "point"));
            }
            for field in fields.iter().filter(|field| field.max > 0.0) {
                let _ = writeln!(
                    text,
                    "  {:<12} {} of {} differ, max {}, mean {}",
                    on_one_line(&field.field),
                    field.differing,
                    counted(a.points, "point"),
                    phrasing::digits(field.max),
                    phrasing::digits(field.mean)
                );
            }
            let fields: Vec<Value> = fields
                .iter()
                .map(|f| json!({ "field": f.field, "differing": f.differing, "max": f.max, "mean": f.mean }))
                .collect();
            let json =
                json!({ "name": name, "points": a.points, "within_tolerance": within, "fields": fields });
            Found { within, text, json }
        }
        CloudDifference::Distances(d) => {
            let _ =
                writeln!(text, "{prefix}{} and {}", counted(a.points, "point"), counted(b.points, "point"));
            let way = |name: &str, mean: f64, max: f64| {
                format!("  {name} {} on average, {} at most\n", phrasing::metres(mean), phrasing::metres(max))
            };
            text += &way("from each of A to the nearest of B:", d.there_mean_m, d.there_max_m);
            text += &way("from each of B to the nearest of A:", d.back_mean_m, d.back_max_m);
            let _ = writeln!(text, "  Chamfer distance {}", phrasing::metres(d.chamfer_m));
            let _ = writeln!(
                text,
                "  density-aware Chamfer distance {} (0 the same, 1 apart)",
                phrasing::digits(d.density_aware)
            );
            let json = json!({
                "name": name,
                "points": [a.points, b.points],
                "within_tolerance": false,
                "a_to_b": { "mean_m": d.there_mean_m, "max_m": d.there_max_m },
                "b_to_a": { "mean_m": d.back_mean_m, "max_m": d.back_max_m },
                "chamfer_m": d.chamfer_m,
                "density_aware_chamfer": d.density_aware,
            });
            Found { within: false, text, json }
        }
    })
}
