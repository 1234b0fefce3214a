//! `beamcast diff`: compares two outputs, channel by channel.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::builder::StringValueParser;
use serde_json::{Value, json};

use super::frames::FrameArgs;
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
use crate::output::recorded::{Cloud, FrameKey};
use crate::output::{CHANNEL_NAMES, Channel, Image, Samples, no_return, write_file};
use crate::run::sides::{Content, Pairing, Side, frames_in_words};
use crate::run::{Holding, Plan, Selection, Session, memory};
use crate::source::is_config;
use crate::source::words::{counted, joined, on_one_line};

/// The arguments of `beamcast diff`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A range image (EXR, NPZ), a cloud (PLY, PCD, NPY, LAS, LAZ, E57), a recording (MCAP), a folder that a scan wrote, or a job, which is run
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
    frames: FrameArgs,
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
    let (mut a, of_a) = side(&args.a, args, terminal, &interrupt)?;
    let (mut b, of_b) = side(&args.b, args, terminal, &interrupt)?;
    let Pairing { pairs, only } = a.pair(&b, [&args.a, &args.b])?;
    let mut labels = a.labels.clone();
    labels.extend(b.labels.clone());
    let is_sequence = pairs.iter().any(|(_, keys)| keys[0].frame().is_some_and(|frame| frame > 0));
    let mut told =
        Told { fields: CHANNEL_NAMES.iter().map(|name| (*name).to_owned()).collect(), ..Told::default() };
    let compare_all = || -> Result<(), Error> {
        for (name, [key_a, key_b]) in &pairs {
            let contents = (a.read(key_a, interrupt.progress())?, b.read(key_b, interrupt.progress())?);
            interrupt.check()?;
            let (Some(mut of_a), Some(mut of_b)) = contents else { continue };
            add_returns(&mut of_a, &of_b);
            add_returns(&mut of_b, &of_a);
            let lacks =
                |side: &[(String, Content)], other: &[(String, Content)], path: &Path, whole: &Path| {
                    let lacking = other.iter().find(|(part, _)| !side.iter().any(|(own, _)| own == part));
                    lacking.map(|(part, _)| {
                        Error::input(path, format!("has no {name}{part}, and {} does", whole.display()))
                    })
                };
            if let Some(error) =
                lacks(&of_a, &of_b, &args.a, &args.b).or_else(|| lacks(&of_b, &of_a, &args.b, &args.a))
            {
                return Err(error);
            }
            for (part, content) in &of_a {
                let Some((_, other)) = of_b.iter().find(|(own, _)| own == part) else { continue };
                told.fields.extend(fields_of(content).chain(fields_of(other)).map(str::to_owned));
                let is_further = part.starts_with(":return");
                let place = Place { name: &format!("{name}{part}"), is_further, key: key_a, is_sequence };
                told.add(compare_items(args, &place, content, other, &labels)?);
            }
        }
        Ok(())
    };
    terminal.with_progress(of_a.saturating_add(of_b), interrupt.progress(), compare_all)?;
    for (name, _) in &args.tolerances {
        if !told.fields.contains(name) {
            return Err(Error::Usage(format!(
                "there is no channel or field {name:?}: they are {}",
                CHANNEL_NAMES.join(", ")
            )));
        }
    }
    let is_same = told.found.iter().all(|found| found.within) && only.iter().all(Vec::is_empty);
    if args.json {
        let names = |keys: &[FrameKey]| keys.iter().map(FrameKey::to_string).collect::<Vec<_>>();
        terminal.json(&json::DIFF.of(json!({
            "same": is_same,
            "only_a": names(&only[0]),
            "only_b": names(&only[1]),
            "totals": told.totals(),
            "pairs": told.found.into_iter().map(|found| found.json).collect::<Vec<_>>(),
        })))?;
    } else {
        let mut text = told.text();
        for (keys, path) in only.iter().zip([&args.a, &args.b]) {
            if !keys.is_empty() {
                let count = counted(keys.len(), "frame");
                let path = on_one_line(&path.to_string_lossy());
                let _ = writeln!(text, "only {path} has {}: {count}", on_one_line(&frames_in_words(keys)));
            }
        }
        terminal.print(&text)?;
    }
    if is_same {
        return Ok(());
    }
    Err(Error::Difference(format!("{} differs from {}", args.b.display(), args.a.display())))
}

/// Opens a side, or prepares to run it if it is a job. Gives the rays that it casts.
fn side(path: &Path, args: &Args, terminal: &Terminal, interrupt: &Interrupt) -> Result<(Side, u64), Error> {
    if !is_config(path) {
        return Ok((Side::of_recording(path, &args.frames.wanted(), memory::for_recordings())?, 0));
    }
    let frames = args.frames.range();
    let mut job = load_job(path, &[], terminal)?;
    let plan = Plan::of(&job, &Selection { frames, ..Selection::ALL }, Holding::Image)?;
    let scene = load_scene(&mut job, &args.scenes, terminal)?.scene;
    interrupt.check()?;
    plan.check_scene(&scene)?;
    Ok((Side::of_session(Session::open(job, &scene), &plan, args.scenes.allowed_folders.clone()), plan.rays))
}

/// Adds to a side the images of further returns that the other side alone has, without any return: the other's pixels have more.
fn add_returns(side: &mut Vec<(String, Content)>, other: &[(String, Content)]) {
    let Some((_, Content::Image(first))) = side.first() else { return };
    let without = |of: &Image| {
        let channels = of.channels.iter().map(|channel| Channel {
            name: channel.name.clone(),
            samples: match channel.samples {
                Samples::F32(_) => Samples::F32(vec![no_return(&channel.name) as f32; first.pixels()]),
                Samples::U32(_) => Samples::U32(vec![no_return(&channel.name) as u32; first.pixels()]),
            },
        });
        Image { rows: first.rows, columns: first.columns, channels: channels.collect() }
    };
    let is_lacking = |(part, _): &&(String, Content)| {
        part.starts_with(":return") && !side.iter().any(|(own, _)| own == part)
    };
    let lacking = other.iter().filter(is_lacking).filter_map(|(part, content)| match content {
        Content::Image(image) => Some((part.clone(), Content::Image(without(image)))),
        Content::Cloud(_) => None,
    });
    let lacking: Vec<_> = lacking.collect();
    side.extend(lacking);
}

/// The names of a content's channels or fields.
fn fields_of(content: &Content) -> Box<dyn Iterator<Item = &str> + '_> {
    match content {
        Content::Image(image) => Box::new(image.channels.iter().map(|channel| channel.name.as_str())),
        Content::Cloud(cloud) => Box::new(cloud.fields.iter().map(|field| field.name.as_str())),
    }
}

/// What is compared: an image or a cloud of a frame.
struct Place<'a> {
    name: &'a str,
    /// Whether it is of further returns of the pixels.
    is_further: bool,
    key: &'a FrameKey,
    /// Whether there are other frames of the same sensor.
    is_sequence: bool,
}

/// The most pairs of which each has its line, though nothing differs.
const MOST_LINES: usize = 16;

/// What is told of all pairs.
#[derive(Default)]
struct Told {
    found: Vec<Found>,
    /// The names of all channels and fields.
    fields: BTreeSet<String>,
    /// Of each channel of images: the pixels that differ by more than their tolerance in all of them, the largest difference, and
    /// the image that has it.
    channels: BTreeMap<String, (usize, f64, String)>,
}

impl Told {
    fn add(&mut self, found: Found) {
        for (channel, differing, max) in &found.channels {
            let sum = self.channels.entry(channel.clone()).or_default();
            sum.0 += differing;
            if *max > sum.1 || sum.2.is_empty() {
                (sum.1, sum.2) = (*max, found.name.clone());
            }
        }
        self.found.push(found);
    }

    fn count(&self, which: fn(&Found) -> bool) -> usize {
        self.found.iter().filter(|found| which(found)).count()
    }

    fn totals(&self) -> Value {
        let channels = self.channels.iter().map(|(channel, (differing, max, worst))| {
            json!({ "channel": channel, "differing": differing, "max": max, "worst": worst })
        });
        json!({
            "pairs": self.found.len(),
            "same": self.count(|found| found.is_same),
            "within_tolerance": self.count(|found| found.within),
            "channels": channels.collect::<Vec<_>>(),
        })
    }

    /// The text of all pairs. Of very many, only those that differ have theirs, and then there is a sum.
    fn text(&self) -> String {
        let is_many = self.found.len() > MOST_LINES;
        let shown = self.found.iter().filter(|found| !is_many || !found.is_same);
        let mut text: String = shown.map(|found| found.text.as_str()).collect();
        if is_many {
            let [same, within] = [self.count(|found| found.is_same), self.count(|found| found.within)];
            let others =
                if within > same { format!(", {} within tolerance", within - same) } else { String::new() };
            let different = self.found.len() - within;
            let _ =
                writeln!(text, "{} pairs: {same} the same{others}, {different} different", self.found.len());
            for (channel, (differing, max, worst)) in &self.channels {
                if *differing > 0 {
                    let channel = on_one_line(channel);
                    let most = if *max > 0.0 {
                        format!(", max {} ({})", phrasing::digits(*max), on_one_line(worst))
                    } else {
                        String::new()
                    };
                    let _ = writeln!(text, "  {channel:<12} {} differ{most}", counted(*differing, "pixel"));
                }
            }
        }
        text
    }
}

struct Found {
    name: String,
    within: bool,
    /// Whether nothing differs at all.
    is_same: bool,
    /// Of each channel of an image: the pixels that differ by more than their tolerance, and the largest difference.
    channels: Vec<(String, usize, f64)>,
    text: String,
    json: Value,
}

fn compare_items(
    args: &Args,
    place: &Place,
    a: &Content,
    b: &Content,
    labels: &BTreeMap<u32, String>,
) -> Result<Found, Error> {
    match (a, b) {
        (Content::Image(a), Content::Image(b)) => compare_images(args, place, a, b, labels),
        (Content::Cloud(a), Content::Cloud(b)) => compare_two_clouds(args, place.name, a, b),
        _ => Err(Error::Usage(format!(
            "{} and {}: an image and a cloud can't be compared",
            args.a.display(),
            args.b.display()
        ))),
    }
}

fn compare_images(
    args: &Args,
    place: &Place,
    a: &Image,
    b: &Image,
    labels: &BTreeMap<u32, String>,
) -> Result<Found, Error> {
    let name = place.name;
    let prefix = if name.is_empty() { String::new() } else { format!("{}: ", on_one_line(name)) };
    if (a.rows, a.columns) != (b.rows, b.columns) {
        let text = format!("{prefix}{} × {} and {} × {} pixels\n", a.rows, a.columns, b.rows, b.columns);
        let sizes = json!({ "name": name, "sizes": [[a.rows, a.columns], [b.rows, b.columns]] });
        let name = name.to_owned();
        return Ok(Found { name, within: false, is_same: false, channels: Vec::new(), text, json: sizes });
    }
    let tolerance = |channel: &str| {
        let given = args.tolerances.iter().rev().find(|(name, _)| name == channel);
        Tolerance { pixels: args.pixels, ..given.map_or(Tolerance::default(), |(_, tolerance)| *tolerance) }
    };
    let difference = compare(a, b, &tolerance, &|_| 0.0);
    let found = difference.channels.iter().find(|c| c.channel == args.channel);
    if let (Some(path), Some(channel)) = (&args.png, found) {
        // Each of several images has a picture of its own. Of very many, only those that differ do.
        let path = match name.split('/').next() {
            Some(sensor) if !sensor.is_empty() => {
                let stem = path.file_stem().unwrap_or_default().to_string_lossy();
                let frame = place.key.frame().filter(|_| place.is_sequence);
                let frame = frame.map_or(String::new(), |frame| format!(".{frame:06}"));
                path.with_file_name(format!("{stem}.{sensor}{frame}.png"))
            }
            _ => path.clone(),
        };
        // The picture is that of the first returns.
        let is_wanted = !place.is_further && (!place.is_sequence || !channel.pixels.is_empty());
        if is_wanted && let Some(picture) = difference_picture(&prefix, a, b, channel) {
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
    let is_same = within
        && difference
            .channels
            .iter()
            .all(|c| c.differing.count() == 0 && c.statistics.is_none_or(|s| s.max == 0.0));
    let of_channel =
        |c: &ChannelDifference| (c.channel.clone(), c.pixels.len(), c.statistics.map_or(0.0, |s| s.max));
    let channels = difference.channels.iter().map(of_channel).collect();
    Ok(Found { name: name.to_owned(), within, is_same, channels, text, json })
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
            let is_same = fields.iter().all(|field| field["max"] == 0.0);
            let json =
                json!({ "name": name, "points": a.points, "within_tolerance": within, "fields": fields });
            Found { name: name.to_owned(), within, is_same, channels: Vec::new(), text, json }
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
            Found { name: name.to_owned(), within: false, is_same: false, channels: Vec::new(), text, json }
        }
    })
}
