//! The views of files that a scan wrote.

use std::collections::BTreeMap;
use std::path::Path;

use super::frames::View;
use crate::error::Error;
use crate::frame::BODY_FROM_OPTICAL;
use crate::output::recorded::{Cloud, Folder, InstanceNames, Part, Recorded};
use crate::output::{Channel, Image, Samples};
use crate::sensor::Camera;

/// The largest number of a folder's frames that one page shows. Browsers become slow with more.
const MAX_FRAMES: usize = 16;

/// What a manifest says that ids stand for. A lone file has its own header.
#[derive(Default)]
struct Listed {
    instances: Option<InstanceNames>,
    labels: Option<BTreeMap<u32, String>>,
}

/// Reads the views of an EXR, a PLY or a folder that a scan wrote, with a note about what is left out, which may be empty. The
/// numbers of all files may take `memory` bytes.
///
/// # Errors
/// [`Error::Input`] if a file can't be read or has nothing to show.
pub fn of_recording(path: &Path, memory: u64) -> Result<(Vec<View>, String), Error> {
    match Recorded::open(path, memory)? {
        Recorded::Exr(parts) => {
            let beside = path.with_extension("ply");
            let cloud = match beside.is_file().then(|| Recorded::open(&beside, memory)) {
                Some(Ok(Recorded::Cloud(cloud))) => Some(cloud),
                _ => None,
            };
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            Ok((of_exr(&name, parts, cloud.as_ref(), &Listed::default()), String::new()))
        }
        Recorded::Cloud(cloud) => {
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            Ok((vec![of_cloud(&name, &cloud, &Listed::default())], String::new()))
        }
        Recorded::Folder(folder) => of_folder(&folder, memory),
    }
}

/// The frames of a scan's folder. Each is read from its EXR with the points of its PLY, or from the one that is there.
fn of_folder(folder: &Folder, mut memory: u64) -> Result<(Vec<View>, String), Error> {
    let mut frames: BTreeMap<&str, [bool; 2]> = BTreeMap::new();
    for output in folder.outputs() {
        let Some((stem, extension)) = output.rsplit_once('.') else { continue };
        match extension {
            "exr" => frames.entry(stem).or_default()[0] = true,
            "ply" => frames.entry(stem).or_default()[1] = true,
            _ => {}
        }
    }
    if frames.is_empty() {
        let problem =
            "has neither EXR nor PLY files to show: `formats` in the job's [output] says what is written";
        return Err(Error::input(folder.path(), problem));
    }
    let manifest = &folder.manifest;
    let listed = Listed { instances: Some(manifest.scene.instances()), labels: Some(manifest.label_names()) };
    let mut seen = Vec::new();
    for (&stem, &[has_exr, has_ply]) in frames.iter().take(MAX_FRAMES) {
        let mut read = |extension: &str| -> Result<Recorded, Error> {
            let recorded = folder.read(&format!("{stem}.{extension}"), memory)?;
            memory = memory.saturating_sub(recorded.memory());
            Ok(recorded)
        };
        let cloud = match has_ply.then(|| read("ply")).transpose()? {
            Some(Recorded::Cloud(cloud)) => Some(cloud),
            _ => None,
        };
        // In a folder with one frame of each sensor, the sensor's name is enough.
        let name = match stem.rsplit_once('/') {
            Some((sensor, "000000")) => sensor,
            _ => stem,
        };
        match has_exr.then(|| read("exr")).transpose()? {
            Some(Recorded::Exr(parts)) => seen.extend(of_exr(name, parts, cloud.as_ref(), &listed)),
            _ => seen.extend(cloud.map(|cloud| of_cloud(name, &cloud, &listed))),
        }
    }
    let note = match frames.len() {
        all if all > MAX_FRAMES => {
            format!("the first {MAX_FRAMES} of {all} frames; `view` shows any other by its file")
        }
        _ => String::new(),
    };
    Ok((seen, note))
}

/// The parts of an EXR. The cloud belongs to the first part, if it has as many points as the part has returns.
fn of_exr(name: &str, parts: Vec<Part>, cloud: Option<&Cloud>, listed: &Listed) -> Vec<View> {
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
            "A range image of a LiDAR does not say where its beams went, so there is no cloud to turn: a PLY beside it does."
                .to_owned()
        });
        let points = match points {
            Ok(points) if points.len() != returns => Err("The cloud does not fit the image.".to_owned()),
            other => other,
        };
        let instances = names_of_seen(&part.image, listed.instances.as_ref(), || part.instances());
        let labels = listed.labels.clone().unwrap_or_else(|| part.labels());
        View { name, image: part.image, points, instances, labels }
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

/// The points of a camera's image, by the intrinsics in its header: x forward, y left, z up.
fn camera_points(part: &Part) -> Option<Vec<[f32; 3]>> {
    let number = |key: &str| part.attributes.get(key)?.parse::<f64>().ok();
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
        let is_id = matches!(field.name.as_str(), "instance" | "label" | "ring" | "column");
        let (name, samples) = match field.name.as_str() {
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
    View { name: name.to_owned(), image, points: Ok(points), instances, labels }
}
