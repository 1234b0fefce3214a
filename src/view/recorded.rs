//! The views of files that a scan wrote.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;

use super::frames::View;
use super::playback::{self, Moment, Playback, chosen, note_of_chosen};
use super::rig::{Mounted, Rig};
use crate::error::Error;
use crate::frame::BODY_FROM_OPTICAL;
use crate::output::recorded::{
    Bag, BoxRow, CLOUD_ENDINGS, Cloud, Content, Folder, FrameKey, IMAGE_ENDINGS, InstanceNames, Message,
    Part, ReadError, Recorded, Wanted, read_boxes, read_poses,
};
use crate::output::{Channel, Image, Samples};
use crate::sensor::{Camera, Capture, Orthographic, Pattern, Sensor};

/// The largest number of a folder's frames that one page shows. Browsers become slow with more.
const MAX_FRAMES: usize = 16;

/// What a manifest says that ids stand for. A lone file has its own header.
#[derive(Default)]
struct Listed {
    instances: Option<InstanceNames>,
    labels: Option<BTreeMap<u32, String>>,
}

/// What there is to show of recorded files.
pub enum Recording {
    /// Frames, and a note about what is left out of them, which may be empty.
    Frames(Vec<View>, String),
    /// The page of a sequence, and the note that is on it.
    Sequence(String, String),
}

/// Reads what there is to show of a range image, a cloud, a recording or a folder that a scan wrote, which is called `title`. Of a sequence,
/// those frames count that are wanted. The numbers of all files that are shown at the same time may take `memory` bytes. `go_on` is asked
/// between frames, and its error ends the reading.
///
/// # Errors
/// [`Error::Input`] if a file can't be read or has nothing to show.
pub fn of_recording(
    path: &Path,
    title: &str,
    wanted: &Wanted,
    memory: u64,
    go_on: &dyn Fn() -> Result<(), Error>,
) -> Result<Recording, Error> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    match Recorded::open(path, memory)? {
        Recorded::Images(parts) => {
            let beside = CLOUD_ENDINGS.iter().rev().map(|ending| path.with_extension(ending));
            let beside = beside.into_iter().find(|path| path.is_file());
            let cloud = match beside.map(|path| Recorded::open(&path, memory)) {
                Some(Ok(Recorded::Cloud(cloud))) => Some(cloud),
                _ => None,
            };
            let views = of_images(&name, parts, cloud.as_ref(), &Listed::default());
            Ok(Recording::Frames(views, String::new()))
        }
        Recorded::Cloud(cloud) => {
            Ok(Recording::Frames(vec![of_cloud(&name, &cloud, &Listed::default())], String::new()))
        }
        Recorded::Bag(mut bag) => of_bag(path, &mut bag, title, wanted, go_on),
        Recorded::Folder(folder) => of_folder(&folder, title, &wanted.frames, memory, go_on),
    }
}

/// The messages of a recording: one, or a sequence of them.
fn of_bag(
    path: &Path,
    bag: &mut Bag,
    title: &str,
    wanted: &Wanted,
    go_on: &dyn Fn() -> Result<(), Error>,
) -> Result<Recording, Error> {
    let unreadable = |e: ReadError| Error::input(path, e);
    let (topic, numbers) = bag.wanted(wanted).map_err(unreadable)?;
    let count = numbers.end - numbers.start;
    let note = note_of_chosen(count);
    let mut first_ns = None;
    let mut playback = Playback::new(title, Rig::default(), chosen(count).count() as u64, 1);
    for index in chosen(count) {
        go_on()?;
        let number = numbers.start + index;
        let key = bag.key(topic, number);
        let Message { stamp_ns, content, .. } = bag.read(topic, number).map_err(unreadable)?;
        let mut views = match content {
            Content::Cloud(cloud) => vec![of_cloud(key.sensor(), &cloud, &Listed::default())],
            Content::Depth(part) => of_images(key.sensor(), vec![part], None, &Listed::default()),
        };
        if count == 1 {
            return Ok(Recording::Frames(views, String::new()));
        }
        views.iter_mut().for_each(|view| view.frame = Some(number));
        // Stamps count from the year 1970, or from whatever began.
        let start_ns = stamp_ns.saturating_sub(*first_ns.get_or_insert(stamp_ns));
        let moment = Moment { frame: number, start_s: Some(start_ns as f64 * 1e-9), ..Moment::default() };
        if !playback.add(moment, &views) {
            break;
        }
    }
    Ok(Recording::Sequence(playback.finish(&note), note))
}

/// The files of a frame: the image and the cloud that tell the most, each by its rank among the endings and its path.
#[derive(Clone, Debug, Default)]
struct Files {
    image: Option<(usize, String)>,
    cloud: Option<(usize, String)>,
}

impl Files {
    /// Reads the frame from its image with the points of its cloud, or from the one that is there. Gives its parts, and whether its
    /// points are in the frame of its sensor.
    fn read(
        &self,
        name: &str,
        folder: &Folder,
        listed: &Listed,
        memory: &mut u64,
    ) -> Result<(Vec<View>, bool), Error> {
        let mut read = |file: &(usize, String)| -> Result<Recorded, Error> {
            let recorded = folder.read(&file.1, *memory)?;
            *memory = memory.saturating_sub(recorded.memory());
            Ok(recorded)
        };
        let cloud = match self.cloud.as_ref().map(&mut read).transpose()? {
            Some(Recorded::Cloud(cloud)) => Some(cloud),
            _ => None,
        };
        let is_in_sensor = |cloud: &Cloud| {
            let frame = cloud.comments.iter().find_map(|comment| comment.strip_prefix("frame:"));
            frame.is_some_and(|frame| !frame.contains("body") && !frame.contains("world"))
        };
        let in_sensor = cloud.as_ref().is_none_or(is_in_sensor);
        let views = match self.image.as_ref().map(&mut read).transpose()? {
            Some(Recorded::Images(parts)) => of_images(name, parts, cloud.as_ref(), listed),
            _ => cloud.iter().map(|cloud| of_cloud(name, cloud, listed)).collect(),
        };
        Ok((views, in_sensor))
    }
}

/// The frames of a scan's folder, or its sequence.
fn of_folder(
    folder: &Folder,
    title: &str,
    range: &Range<u64>,
    mut memory: u64,
    go_on: &dyn Fn() -> Result<(), Error>,
) -> Result<Recording, Error> {
    let mut frames: BTreeMap<FrameKey, Files> = BTreeMap::new();
    for output in folder.outputs() {
        let Some((key, ending)) = FrameKey::of_file(output) else { continue };
        let [image, cloud] = [&IMAGE_ENDINGS[..], &CLOUD_ENDINGS[..]]
            .map(|endings| Some((endings.iter().position(|known| *known == ending)?, output.to_owned())));
        if image.is_none() && cloud.is_none() || key.frame().is_some_and(|frame| !range.contains(&frame)) {
            continue;
        }
        let files = frames.entry(key).or_default();
        files.image = files.image.take().max(image);
        files.cloud = files.cloud.take().max(cloud);
    }
    if frames.is_empty() {
        let problem = "has neither images (EXR, NPZ) nor clouds (PLY, PCD, NPY, LAS, LAZ, E57) to show: `formats` in the job's [output] says what is written";
        return Err(Error::input(folder.path(), problem));
    }
    let manifest = &folder.manifest;
    let listed = Listed { instances: Some(manifest.scene.instances()), labels: Some(manifest.label_names()) };
    let mut by_sensor: BTreeMap<&str, BTreeMap<u64, &Files>> = BTreeMap::new();
    for (key, files) in &frames {
        if let Some(frame) = key.frame() {
            by_sensor.entry(key.sensor()).or_default().insert(frame, files);
        }
    }
    if by_sensor.values().any(|frames| frames.len() > 1) {
        return sequence(folder, title, &by_sensor, &listed, memory, go_on);
    }
    let mut seen = Vec::new();
    for (key, files) in frames.iter().take(MAX_FRAMES) {
        go_on()?;
        // In a folder with one frame of each sensor, the sensor's name is enough.
        let name = if key.frame() == Some(0) { key.sensor().to_owned() } else { key.to_string() };
        seen.extend(files.read(&name, folder, &listed, &mut memory)?.0);
    }
    let note = match frames.len() {
        all if all > MAX_FRAMES => {
            format!("the first {MAX_FRAMES} of {all} frames; `view` shows any other by its file")
        }
        _ => String::new(),
    };
    Ok(Recording::Frames(seen, note))
}

/// The page of a recorded sequence. Its moments are the frames of the sensor that has the fewest, and to each belongs the frame of
/// every other sensor that is nearest in time or, where no table of poses tells the times, the one of the same number.
fn sequence(
    folder: &Folder,
    title: &str,
    by_sensor: &BTreeMap<&str, BTreeMap<u64, &Files>>,
    listed: &Listed,
    memory: u64,
    go_on: &dyn Fn() -> Result<(), Error>,
) -> Result<Recording, Error> {
    let broken = |name: &str, e: ReadError| Error::input(folder.path().join(name), e);
    let poses = match folder.table("poses.csv")? {
        Some(text) => read_poses(&text).map_err(|e| broken("poses.csv", e))?,
        None => BTreeMap::new(),
    };
    let Some((slowest, moments)) = by_sensor.iter().min_by_key(|(_, frames)| frames.len()) else {
        return Ok(Recording::Frames(Vec::new(), String::new()));
    };
    let time = |sensor: &str, frame: u64| poses.get(&FrameKey::new(sensor, frame)).map(|row| row.start_s);
    // The frame of a sensor that belongs to a moment.
    let frame_at = |sensor: &str, frames: &BTreeMap<u64, &Files>, moment: u64| -> Option<u64> {
        let Some(at) = time(slowest, moment).filter(|_| sensor != *slowest) else {
            return frames.contains_key(&moment).then_some(moment);
        };
        let off = |frame: u64| time(sensor, frame).map(|time| (time - at).abs());
        let nearest = frames.keys().filter_map(|&frame| Some((off(frame)?, frame)));
        nearest.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, frame)| frame)
    };
    let count = moments.len() as u64;
    let numbers: Vec<u64> = moments.keys().copied().collect();
    let shown: Vec<(u64, Vec<(&str, u64)>)> = chosen(count)
        .map(|index| {
            let moment = numbers[index as usize];
            let of_sensor = by_sensor
                .iter()
                .filter_map(|(&sensor, frames)| Some((sensor, frame_at(sensor, frames, moment)?)));
            (moment, of_sensor.collect())
        })
        .collect();
    let wanted: BTreeSet<FrameKey> = shown
        .iter()
        .flat_map(|(_, all)| all.iter().map(|(sensor, frame)| FrameKey::new(sensor, *frame)))
        .collect();
    let mut boxes = match folder.table("boxes.jsonl")? {
        Some(text) => read_boxes(&text, &|key| wanted.contains(key)).map_err(|e| broken("boxes.jsonl", e))?,
        None => BTreeMap::new(),
    };
    let mut playback: Option<Playback> = None;
    for (number, of_moment) in &shown {
        let (mut views, mut all_in_sensor, mut memory) = (Vec::new(), true, memory);
        // Without a table of poses, frames count from 0 s.
        let rate_hz = folder.manifest.rate_hz(slowest).filter(|_| poses.is_empty());
        let start_s = rate_hz.map(|rate| *number as f64 / rate);
        let mut moment = Moment { frame: *number, start_s, ..Moment::default() };
        for (sensor, frame) in of_moment {
            go_on()?;
            let Some(files) = by_sensor.get(sensor).and_then(|frames| frames.get(frame)) else { continue };
            let (parts, in_sensor) = files.read(sensor, folder, listed, &mut memory)?;
            // The first return of each pixel is what a page of a sequence shows.
            let first = parts.into_iter().next();
            views.extend(first.map(|view| View { name: (*sensor).to_owned(), frame: Some(*frame), ..view }));
            all_in_sensor &= in_sensor;
            let key = FrameKey::new(sensor, *frame);
            if let Some(row) = poses.get(&key) {
                moment.start_s.get_or_insert(row.start_s);
                moment.world_from_body.get_or_insert(row.world_from_body);
            }
            // Each sensor has its own boxes of the objects that it sees.
            for found in boxes.remove(&key).into_iter().flatten() {
                let is_known = |known: &BoxRow| known.name == found.name && known.label == found.label;
                if found.name.is_empty() || !moment.boxes.iter().any(is_known) {
                    moment.boxes.push(found);
                }
            }
        }
        let playback = playback.get_or_insert_with(|| {
            let mounted = |(sensor, frame): &(&str, u64)| {
                let row = poses.get(&FrameKey::new(sensor, *frame))?;
                let body_from_sensor = row.world_from_body.inverse() * row.world_from_sensor;
                Some(Mounted { name: (*sensor).to_owned(), body_from_sensor, edges: Vec::new() })
            };
            let sensors =
                if all_in_sensor { of_moment.iter().filter_map(mounted).collect() } else { Vec::new() };
            Playback::new(title, Rig { sensors, ..Rig::default() }, shown.len() as u64, by_sensor.len())
        });
        if !playback.add(moment, &views) {
            break;
        }
    }
    let longest = by_sensor.values().map(|frames| frames.len() as u64).max().unwrap_or(0);
    let mut note = note_of_chosen(count);
    if longest > count {
        note = format!("{note} {}", playback::FASTER).trim().to_owned();
    }
    Ok(Recording::Sequence(playback.map_or(String::new(), |playback| playback.finish(&note)), note))
}

/// The parts of an image. The cloud belongs to the first part, if it has as many points as the part has returns.
fn of_images(name: &str, parts: Vec<Part>, cloud: Option<&Cloud>, listed: &Listed) -> Vec<View> {
    let several = parts.len() > 1;
    let part = |(index, part): (usize, Part)| {
        let name = if several { format!("{name}, {}", part.name) } else { name.to_owned() };
        let depth = part.image.mask();
        let returns = depth.iter().filter(|seen| **seen).count();
        let points = match cloud.filter(|cloud| index == 0 && cloud.points == returns) {
            Some(cloud) => positions(cloud).map(|points| points.into_iter().map(|(_, p)| p).collect()),
            None => camera_points(&part),
        };
        // A cloud with a point that is no number does not fit its image.
        let points = points.ok_or_else(|| {
            "This image does not say where its beams went, so there is no cloud to turn: a cloud beside it (PLY, PCD, NPY, LAS, LAZ, E57) does."
                .to_owned()
        });
        let points = match points {
            Ok(points) if points.len() != returns => Err("The cloud does not fit the image.".to_owned()),
            other => other,
        };
        let instances = names_of_seen(&part.image, listed.instances.as_ref(), || part.instances());
        let labels = listed.labels.clone().unwrap_or_else(|| part.labels());
        View { name, frame: None, image: part.image, points, instances, labels }
    };
    parts.into_iter().enumerate().map(part).collect()
}

/// The names of the instances that an image shows, from the manifest or, without one, from the file's own header.
fn names_of_seen(
    image: &Image,
    listed: Option<&InstanceNames>,
    own: impl FnOnce() -> InstanceNames,
) -> BTreeMap<u32, String> {
    let ids = image.u32("id.instance").unwrap_or_default().iter().copied();
    listed.map_or_else(own, InstanceNames::clone).of(ids)
}

/// The points of a camera's image, by the intrinsics or, of parallel rays, the sides in its header: x forward, y left, z up.
fn camera_points(part: &Part) -> Option<Vec<[f32; 3]>> {
    let number = |key: &str| part.attributes.get(key)?.parse::<f64>().ok();
    if let (Some(width), Some(height)) = (number("beamcast:width_m"), number("beamcast:height_m")) {
        return parallel_points(&part.image, (width, height));
    }
    let focal = (number("beamcast:fx_px")?, number("beamcast:fy_px")?);
    let principal = (number("beamcast:cx_px")?, number("beamcast:cy_px")?);
    let image = &part.image;
    let camera = Camera::new((image.columns, image.rows), focal, principal, None).ok()?;
    let ranges = image.f32("range")?.iter().enumerate().filter(|(_, range)| range.is_finite());
    let point = |(i, &range): (usize, &f32)| {
        let (column, row) = ((i % image.columns) as f64, (i / image.columns) as f64);
        let direction = BODY_FROM_OPTICAL.direction(camera.optical_direction_at(column + 0.5, row + 0.5)?);
        Some((direction * f64::from(range)).as_vec3().to_array())
    };
    Some(ranges.filter_map(point).collect())
}

/// The points of the image of a camera of parallel rays, with so many metres from edge to edge.
fn parallel_points(image: &Image, size_m: (f64, f64)) -> Option<Vec<[f32; 3]>> {
    let camera = Orthographic::new((image.columns, image.rows), size_m, None).ok()?;
    let sensor = Sensor::new(Pattern::Orthographic(camera));
    let capture = Capture::at_origin(&sensor);
    let ranges = image.f32("range")?.iter().enumerate().filter(|(_, range)| range.is_finite());
    let point = |(i, &range): (usize, &f32)| {
        let pulse = capture.pulse(i / image.columns, i % image.columns)?;
        Some(pulse.point(range.into()).as_vec3().to_array())
    };
    Some(ranges.filter_map(point).collect())
}

/// The points of a cloud that are numbers, with their index: x forward, y left, z up also for a camera's optical frame.
fn positions(cloud: &Cloud) -> Option<Vec<(usize, [f32; 3])>> {
    let [x, y, z] = ["x", "y", "z"].map(|axis| cloud.field(axis));
    let (x, y, z) = (x?, y?, z?);
    let is_optical = cloud.comments.iter().any(|c| c.starts_with("frame:") && c.contains("optical"));
    let point = |i: usize| {
        let p = glam::DVec3::new(x[i], y[i], z[i]);
        if is_optical { BODY_FROM_OPTICAL.direction(p) } else { p }
    };
    let points = (0..cloud.points).map(|i| (i, point(i).as_vec3()));
    Some(points.filter(|(_, p)| p.is_finite()).map(|(i, p)| (i, p.to_array())).collect())
}

/// A cloud without an image is shown as an image of one row, with a pixel for each point.
fn of_cloud(name: &str, cloud: &Cloud, listed: &Listed) -> View {
    let positions = positions(cloud).unwrap_or_default();
    let kept = |values: &[f64]| positions.iter().map(|&(i, _)| values[i]).collect::<Vec<f64>>();
    let mut channels = Vec::new();
    for field in cloud.fields.iter().filter(|f| !["x", "y", "z"].contains(&f.name.as_str())) {
        let values = kept(&field.values);
        let measured = |scale: f64| Samples::F32(values.iter().map(|v| (v * scale) as f32).collect());
        // CloudCompare's names.
        let plain = field.name.strip_prefix("scalar_").unwrap_or(&field.name);
        let is_id = matches!(plain, "instance" | "label" | "ring" | "column");
        let (name, samples) = match plain {
            "instance" => ("id.instance", Samples::U32(values.iter().map(|v| *v as u32).collect())),
            "label" => ("id.semantic", Samples::U32(values.iter().map(|v| *v as u32).collect())),
            "t" => ("time", measured(1e-9)),
            other if is_id => (other, Samples::U32(values.iter().map(|v| *v as u32).collect())),
            other => (other, measured(1.0)),
        };
        channels.push(Channel { name: name.to_owned(), samples });
    }
    if !channels.iter().any(|c| c.name == "range") {
        let ranges = positions.iter().map(|(_, p)| glam::Vec3::from(*p).length()).collect();
        channels.push(Channel { name: "range".to_owned(), samples: Samples::F32(ranges) });
    }
    channels.sort_by(|a, b| a.name.cmp(&b.name));
    channels.dedup_by(|a, b| a.name == b.name);
    let image = Image { rows: 1, columns: positions.len(), channels };
    let points = positions.into_iter().map(|(_, p)| p).collect();
    let instances = names_of_seen(&image, listed.instances.as_ref(), || cloud.instances());
    let labels = listed.labels.clone().unwrap_or_else(|| cloud.labels());
    View { name: name.to_owned(), frame: None, image, points: Ok(points), instances, labels }
}
