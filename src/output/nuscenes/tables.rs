//! The tables of nuScenes. Each is a list of JSON, whose rows refer to those of others by tokens.

use std::collections::BTreeMap;
use std::io::Write;

use serde_json::{Value, json};

use super::super::format::{EncodeError, Notes};
use super::layout::{MAP, ROOT};
use super::note::{Noted, NotedBox, unnamed};
use super::timeline::{Placed, Timeline};

/// Writes a table whose rows come from one of the functions below.
pub(super) fn write(
    notes: &Notes,
    file: &mut dyn Write,
    rows: fn(&Scene, Add) -> Result<(), EncodeError>,
) -> Result<(), EncodeError> {
    let timeline = Timeline::of(notes)?;
    let mut is_first = true;
    let mut add = |row: Value| -> Result<(), EncodeError> {
        let open = if is_first { "[\n" } else { ",\n" };
        is_first = false;
        Ok(write!(file, "{open}{row}")?)
    };
    rows(&Scene { timeline, notes }, &mut add)?;
    file.write_all(if is_first { b"[]\n" } else { b"\n]\n" })?;
    Ok(())
}

/// A scene, of which rows are made.
pub(super) struct Scene<'a, 'n> {
    timeline: Timeline,
    notes: &'a Notes<'n>,
}

/// Takes a row of a table.
type Add<'a> = &'a mut dyn FnMut(Value) -> Result<(), EncodeError>;

impl Scene<'_, '_> {
    /// All frames, in the order in which they start.
    fn frames(&self) -> Result<impl Iterator<Item = Result<(Noted, usize), EncodeError>>, EncodeError> {
        Ok((self.notes)()?.enumerate().map(|(index, note)| Ok((Noted::read(note)?, index))))
    }

    /// A token: it is the same whenever the scene has the same name, and no other thing of a scene has it.
    fn token(&self, kind: &str, parts: &[&dyn std::fmt::Display]) -> String {
        let mut name = json!([self.timeline.scene, kind]);
        for part in parts {
            name.as_array_mut().into_iter().for_each(|name| name.push(part.to_string().into()));
        }
        let mut hash = blake3::hash(name.to_string().as_bytes()).to_hex().to_string();
        hash.truncate(32);
        hash
    }

    /// The token of a sample, or an empty text for one that is not there.
    fn sample(&self, index: Option<usize>) -> String {
        let sample = index.and_then(|index| self.timeline.samples.get(index));
        sample.map_or_else(String::new, |sample| self.token("sample", &[&sample.frame]))
    }

    fn sample_data(&self, sensor: &str, frame: Option<u64>) -> String {
        frame.map_or_else(String::new, |frame| self.token("sample_data", &[&sensor, &frame]))
    }

    /// The token of a sensor's calibration, which follows from that: a job may draw another for each frame.
    fn calibrated_sensor(&self, noted: &Noted) -> String {
        let calibration = json!([noted.mount, noted.camera.map(|camera| camera.intrinsic)]);
        self.token("calibrated_sensor", &[&noted.sensor, &calibration])
    }
}

pub(super) fn nothing(_: &Scene, _: Add) -> Result<(), EncodeError> {
    Ok(())
}

pub(super) fn calibrated_sensors(scene: &Scene, add: Add) -> Result<(), EncodeError> {
    let mut known = std::collections::BTreeSet::new();
    for frame in scene.frames()? {
        let (noted, _) = frame?;
        let token = scene.calibrated_sensor(&noted);
        if known.insert(token.clone()) {
            add(json!({
                "token": token,
                "sensor_token": scene.token("sensor", &[&noted.sensor]),
                "translation": noted.mount.translation,
                "rotation": noted.mount.rotation,
                "camera_intrinsic": noted.camera.map_or_else(|| json!([]), |camera| json!(camera.intrinsic)),
            }))?;
        }
    }
    Ok(())
}

/// The categories are the labels. For lidarseg, there is one of each number up to the largest, because the kit counts them.
pub(super) fn categories(scene: &Scene, add: Add) -> Result<(), EncodeError> {
    let (mut labels, mut is_whole) = (BTreeMap::new(), false);
    for frame in scene.frames()? {
        let (noted, _) = frame?;
        labels.extend(noted.labels);
        is_whole |= noted.lidarseg;
    }
    if is_whole {
        for label in 0..labels.last_key_value().map_or(0, |(last, _)| *last) {
            labels.entry(label).or_insert_with(|| unnamed(label));
        }
    }
    for (label, name) in labels {
        let token = scene.token("category", &[&label]);
        add(json!({ "token": token, "name": name, "description": "", "index": label }))?;
    }
    Ok(())
}

pub(super) fn ego_poses(scene: &Scene, add: Add) -> Result<(), EncodeError> {
    for frame in scene.frames()? {
        let (noted, _) = frame?;
        add(json!({
            "token": scene.sample_data(&noted.sensor, Some(noted.frame)),
            "timestamp": noted.time_us,
            "rotation": noted.ego.rotation,
            "translation": noted.ego.translation,
        }))?;
    }
    Ok(())
}

pub(super) fn log(scene: &Scene, add: Add) -> Result<(), EncodeError> {
    let (token, name) = (scene.token("log", &[]), &scene.timeline.scene);
    // A simulation has no day.
    add(
        json!({ "token": token, "logfile": name, "vehicle": "beamcast", "date_captured": "1970-01-01", "location": "beamcast" }),
    )
}

pub(super) fn map(scene: &Scene, add: Add) -> Result<(), EncodeError> {
    let (token, logs) = (scene.token("map", &[]), [scene.token("log", &[])]);
    let filename = MAP.strip_prefix(ROOT);
    add(json!({ "token": token, "log_tokens": logs, "category": "semantic_prior", "filename": filename }))
}

pub(super) fn samples(scene: &Scene, add: Add) -> Result<(), EncodeError> {
    for (index, sample) in scene.timeline.samples.iter().enumerate() {
        add(json!({
            "token": scene.sample(Some(index)),
            "timestamp": sample.time_us,
            "prev": scene.sample(index.checked_sub(1)),
            "next": scene.sample(Some(index + 1)),
            "scene_token": scene.token("scene", &[]),
        }))?;
    }
    Ok(())
}

pub(super) fn scene(scene: &Scene, add: Add) -> Result<(), EncodeError> {
    let count = scene.timeline.samples.len();
    add(json!({
        "token": scene.token("scene", &[]),
        "log_token": scene.token("log", &[]),
        "nbr_samples": count,
        "first_sample_token": scene.sample(Some(0)),
        "last_sample_token": scene.sample(count.checked_sub(1)),
        "name": scene.timeline.scene,
        "description": "",
    }))
}

pub(super) fn sensors(scene: &Scene, add: Add) -> Result<(), EncodeError> {
    let mut known = std::collections::BTreeSet::new();
    for frame in scene.frames()? {
        let (Noted { sensor, camera, .. }, _) = frame?;
        if known.insert(sensor.clone()) {
            let modality = if camera.is_some() { "camera" } else { "lidar" };
            add(
                json!({ "token": scene.token("sensor", &[&sensor]), "channel": sensor, "modality": modality }),
            )?;
        }
    }
    Ok(())
}

pub(super) fn sample_data(scene: &Scene, add: Add) -> Result<(), EncodeError> {
    for frame in scene.frames()? {
        let (noted, index) = frame?;
        let Placed { sample, is_key, .. } = scene.timeline.frames[index];
        let [before, after] = scene.timeline.neighbours(index);
        let token = scene.sample_data(&noted.sensor, Some(noted.frame));
        let (width, height) = noted.camera.map_or((0, 0), |camera| (camera.width, camera.height));
        add(json!({
            "token": token,
            "sample_token": scene.sample(Some(sample)),
            "ego_pose_token": token,
            "calibrated_sensor_token": scene.calibrated_sensor(&noted),
            "filename": noted.data_path(),
            "fileformat": if noted.camera.is_some() { "png" } else { "pcd" },
            "width": width,
            "height": height,
            "timestamp": noted.time_us,
            "is_key_frame": is_key,
            "next": scene.sample_data(&noted.sensor, after),
            "prev": scene.sample_data(&noted.sensor, before),
        }))?;
    }
    Ok(())
}

pub(super) fn lidarseg(scene: &Scene, add: Add) -> Result<(), EncodeError> {
    for frame in scene.frames()? {
        let (noted, _) = frame?;
        if noted.camera.is_none() {
            let token = scene.sample_data(&noted.sensor, Some(noted.frame));
            add(json!({ "token": token, "sample_data_token": token, "filename": noted.labels_path() }))?;
        }
    }
    Ok(())
}

/// The levels of visibility: each with the share in percent from which it counts.
const LEVELS: [(&str, &str, f64); 4] =
    [("1", "v0-40", 0.0), ("2", "v40-60", 40.0), ("3", "v60-80", 60.0), ("4", "v80-100", 80.0)];

pub(super) fn visibilities(_: &Scene, add: Add) -> Result<(), EncodeError> {
    for (token, level, _) in LEVELS {
        let description = format!("{} % of the pixels are visible", &level[1..]);
        add(json!({ "token": token, "level": level, "description": description }))?;
    }
    Ok(())
}

/// An object in a sample.
struct Annotation {
    track: u32,
    label: u32,
    token: String,
    row: Value,
}

/// The facts that the key frames of a sample tell of an object.
struct Seen {
    /// The box, of a LiDAR if one has it, else of the first camera.
    found: NotedBox,
    is_of_lidar: bool,
    lidar_points: u64,
    /// The pixels that LiDARs and cameras see of it, and those that they would see if it were alone.
    pixels: [[u64; 2]; 2],
}

impl Seen {
    fn add(seen: Option<Self>, found: NotedBox, is_camera: bool) -> Self {
        let (points, pixels) = (found.points, [found.pixels, found.pixels_alone]);
        let mut seen = match seen {
            Some(seen) if seen.is_of_lidar || is_camera => seen,
            Some(seen) => Self { found, is_of_lidar: true, ..seen },
            None => Self { found, is_of_lidar: !is_camera, lidar_points: 0, pixels: [[0; 2]; 2] },
        };
        seen.lidar_points += if is_camera { 0 } else { points };
        let of_kind = &mut seen.pixels[usize::from(is_camera)];
        *of_kind = [of_kind[0] + pixels[0], of_kind[1] + pixels[1]];
        seen
    }

    /// The level of what all cameras see, or all LiDARs if no camera could.
    fn level(&self) -> &'static str {
        let [of_lidars, of_cameras] = self.pixels;
        let [pixels, alone] = if of_cameras[1] > 0 { of_cameras } else { of_lidars };
        let percent = 100.0 * pixels as f64 / alone.max(1) as f64;
        LEVELS.iter().rev().find(|level| percent >= level.2).map_or("1", |level| level.0)
    }
}

impl Scene<'_, '_> {
    /// Calls `each` with the objects of all samples, in order. The key frames of a sample are nearer to it than to the next one, so
    /// a sample is complete when the next one has begun.
    fn each_annotation(
        &self,
        each: &mut dyn FnMut(Annotation) -> Result<(), EncodeError>,
    ) -> Result<(), EncodeError> {
        let samples = &self.timeline.samples;
        let mut open: BTreeMap<usize, BTreeMap<u32, Seen>> = BTreeMap::new();
        for frame in self.frames()? {
            let (noted, index) = frame?;
            let is_complete = |sample: usize| {
                let next = samples.get(sample + 1);
                next.is_some_and(|next| next.start_s <= noted.start_s)
                    && samples[sample].start_s < noted.start_s
            };
            while let Some(entry) = open.first_entry().filter(|entry| is_complete(*entry.key())) {
                let (sample, of_sample) = entry.remove_entry();
                self.annotate(sample, of_sample, each)?;
            }
            let Placed { sample, is_key, .. } = self.timeline.frames[index];
            if is_key {
                let of_sample = open.entry(sample).or_default();
                for found in noted.boxes {
                    let track = found.track;
                    let seen = Seen::add(of_sample.remove(&track), found, noted.camera.is_some());
                    of_sample.insert(track, seen);
                }
            }
        }
        open.into_iter().try_for_each(|(sample, of_sample)| self.annotate(sample, of_sample, each))
    }

    fn annotate(
        &self,
        sample: usize,
        of_sample: BTreeMap<u32, Seen>,
        each: &mut dyn FnMut(Annotation) -> Result<(), EncodeError>,
    ) -> Result<(), EncodeError> {
        for (track, seen) in of_sample {
            let token = self.token("sample_annotation", &[&self.timeline.samples[sample].frame, &track]);
            let NotedBox { label, size, place, .. } = seen.found;
            let row = json!({
                "token": token,
                "sample_token": self.sample(Some(sample)),
                "instance_token": self.token("instance", &[&track]),
                "visibility_token": seen.level(),
                "attribute_tokens": [],
                "translation": place.translation,
                "size": size,
                "rotation": place.rotation,
                "prev": "",
                "next": "",
                "num_lidar_pts": seen.lidar_points,
                "num_radar_pts": 0,
            });
            each(Annotation { track, label, token, row })?;
        }
        Ok(())
    }
}

/// Each row waits until the next one of the same object is known.
pub(super) fn annotations(scene: &Scene, add: Add) -> Result<(), EncodeError> {
    let mut waiting: BTreeMap<u32, Annotation> = BTreeMap::new();
    scene.each_annotation(&mut |mut found| {
        if let Some(mut before) = waiting.remove(&found.track) {
            before.row["next"] = found.token.as_str().into();
            found.row["prev"] = before.token.into();
            add(before.row)?;
        }
        waiting.insert(found.track, found);
        Ok(())
    })?;
    waiting.into_values().try_for_each(|last| add(last.row))
}

pub(super) fn instances(scene: &Scene, add: Add) -> Result<(), EncodeError> {
    struct Instance {
        label: u32,
        count: u64,
        first: String,
        last: String,
    }
    let mut instances: BTreeMap<u32, Instance> = BTreeMap::new();
    scene.each_annotation(&mut |Annotation { track, label, token, .. }| {
        let new = || Instance { label, count: 0, first: token.clone(), last: String::new() };
        let instance = instances.entry(track).or_insert_with(new);
        instance.count += 1;
        instance.last = token;
        Ok(())
    })?;
    for (track, Instance { label, count, first, last }) in instances {
        add(json!({
            "token": scene.token("instance", &[&track]),
            "category_token": scene.token("category", &[&label]),
            "nbr_annotations": count,
            "first_annotation_token": first,
            "last_annotation_token": last,
        }))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::super::format::Note;
    use super::super::note::tests::note;
    use super::super::note::{Imager, Place};
    use super::*;

    type Rows = fn(&Scene, Add) -> Result<(), EncodeError>;

    fn rows(notes: &[Noted], rows: Rows) -> Vec<Value> {
        let note = |noted: &Noted| Note { text: noted.text(), files: Vec::new() };
        let mut file = Vec::new();
        write(&|| Ok(Box::new(notes.iter().map(note))), &mut file, rows).unwrap();
        serde_json::from_slice(&file).unwrap()
    }

    fn seen(track: u32, points: u64, pixels: u64, pixels_alone: u64) -> NotedBox {
        let place = Place { translation: [points as f64, 0.0, 0.0], rotation: [1.0, 0.0, 0.0, 0.0] };
        NotedBox { track, label: 9, size: [1.0, 2.0, 3.0], place, points, pixels, pixels_alone }
    }

    fn camera(noted: Noted) -> Noted {
        let intrinsic = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        Noted { camera: Some(Imager { width: 4, height: 3, intrinsic }), ..noted }
    }

    /// Object 1 is in all samples but the second, object 2 in the second alone.
    #[test]
    fn the_annotations_of_an_object_follow_each_other() {
        let with = |frame: u64, boxes: Vec<NotedBox>| Noted { boxes, ..note("top", frame, frame as f64) };
        let notes = [
            with(0, vec![seen(1, 5, 5, 5)]),
            with(1, vec![seen(2, 5, 5, 5)]),
            with(2, vec![seen(1, 5, 5, 5)]),
            with(3, vec![seen(1, 5, 5, 5)]),
        ];
        let found = rows(&notes, annotations);
        let instances = rows(&notes, instances);
        assert_eq!((found.len(), instances.len()), (4, 2));
        let by_token = |token: &Value| found.iter().find(|row| row["token"] == *token);
        let mut row = by_token(&instances[0]["first_annotation_token"]).unwrap();
        assert_eq!((&row["prev"], &instances[0]["nbr_annotations"]), (&json!(""), &json!(3)));
        for _ in 0..2 {
            let next = by_token(&row["next"]).unwrap();
            assert_eq!((&next["prev"], &next["instance_token"]), (&row["token"], &instances[0]["token"]));
            row = next;
        }
        assert_eq!((&row["next"], &row["token"]), (&json!(""), &instances[0]["last_annotation_token"]));
        let samples = rows(&notes, samples);
        assert_eq!(row["sample_token"], samples[3]["token"]);
        assert_eq!(rows(&[], annotations), [] as [Value; 0]);
    }

    /// A box is the LiDAR's, its points are those of LiDARs, and its visibility that of cameras.
    #[test]
    fn a_sample_has_one_annotation_of_what_several_sensors_see() {
        for is_camera_first in [true, false] {
            let lidar = Noted { boxes: vec![seen(1, 7, 1, 9)], ..note("top", 0, 0.0) };
            let left = camera(Noted { boxes: vec![seen(1, 40, 10, 10)], ..note("left", 0, 0.0) });
            let right = camera(Noted { boxes: vec![seen(1, 9, 3, 10)], ..note("right", 0, 0.0) });
            let notes = if is_camera_first { [left, right, lidar] } else { [lidar, right, left] };
            let found = rows(&notes, annotations);
            assert_eq!(found.len(), 1);
            assert_eq!((&found[0]["num_lidar_pts"], &found[0]["translation"][0]), (&json!(7), &json!(7.0)));
            // 13 of 20 pixels.
            assert_eq!(found[0]["visibility_token"], "3");
        }
        let alone = [Noted { boxes: vec![seen(1, 2, 2, 5)], ..note("top", 0, 0.0) }];
        assert_eq!(rows(&alone, annotations)[0]["visibility_token"], "2", "40 % of a LiDAR's pixels");
    }

    #[test]
    fn a_calibration_that_is_drawn_anew_has_a_row_of_its_own() {
        let mut notes = [note("top", 0, 0.0), note("top", 1, 1.0), note("top", 2, 2.0)];
        notes[2].mount.translation[2] = 1.5;
        let (calibrations, data) = (rows(&notes, calibrated_sensors), rows(&notes, sample_data));
        assert_eq!((calibrations.len(), rows(&notes, sensors).len()), (2, 1));
        let of_data: Vec<_> = data.iter().map(|row| &row["calibrated_sensor_token"]).collect();
        assert!(of_data[0] == of_data[1] && of_data[1] != of_data[2]);
        assert_eq!(*of_data[2], calibrations[1]["token"]);
    }

    #[test]
    fn categories_have_no_gaps_where_the_kit_counts_them() {
        let named = |lidarseg: bool| {
            let labels = BTreeMap::from([(0, "unlabelled".to_owned()), (3, "car".to_owned())]);
            rows(&[Noted { labels, lidarseg, ..note("top", 0, 0.0) }], categories)
        };
        let names = |rows: &[Value]| rows.iter().map(|row| row["name"].clone()).collect::<Vec<_>>();
        assert_eq!(names(&named(false)), ["unlabelled", "car"]);
        assert_eq!(names(&named(true)), ["unlabelled", "label 1", "label 2", "car"]);
        assert!(named(true).iter().enumerate().all(|(index, row)| row["index"] == index));
    }

    #[test]
    fn tokens_are_unlike_each_other_and_follow_from_the_scenes_name() {
        let token = |scene: &str, parts: &[&dyn std::fmt::Display]| {
            let timeline = Timeline { scene: scene.into(), ..Timeline::default() };
            Scene { timeline, notes: &|| Ok(Box::new(std::iter::empty())) }.token("sample_data", parts)
        };
        let all = [
            token("a", &[&"b", &12]),
            token("a", &[&"b1", &2]),
            token("ab", &[&"", &12]),
            token("a", &[&"b12"]),
        ];
        assert_eq!(all.iter().collect::<std::collections::BTreeSet<_>>().len(), all.len());
        assert!(all.iter().all(|token| token.len() == 32) && all[0] == token("a", &[&"b", &12]));
    }
}
