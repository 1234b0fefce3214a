//! The page of a sequence: a moment after the other, with a slider and playback, in a bounded number of bytes.
//!
//! Frames become text as they come, so that no frame is kept. A page has at most [`MOST_MOMENTS`] moments and [`MOST_BYTES`]
//! bytes: frames have fewer rows and columns than they were cast with where the moments would not fit otherwise.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use glam::DVec3;
use serde_json::{Value, json};

use super::frames::View;
use super::html::{escape, script};
use super::pack;
use super::page::{self, Part, document};
use super::rig::Rig;
use super::thin::Thinned;
use crate::frame::Pose;
use crate::output::recorded::BoxRow;
use crate::output::{self, Image, Samples, Scale};
use crate::source::words::{counted, escaped};

/// The most moments of a page.
pub const MOST_MOMENTS: u64 = 100;

/// The most bytes of a page.
pub const MOST_BYTES: usize = 48_000_000;

/// Bytes of a page for its script, its style and everything else that is no frame.
const BYTES_BESIDE_FRAMES: usize = 2_000_000;

/// Bytes of text that a pixel takes in a street, with the channels that a page of a sequence shows. Those of a page's first
/// moment are measured, and its pixels thinned out further if they take more than their share.
const BYTES_A_PIXEL: usize = 8;

/// The channels of a frame that the page of a sequence leaves out, because they say least to the eye for their bytes.
const LEFT_OUT: [&str; 4] = ["normal.X", "normal.Y", "normal.Z", "time"];

/// The body of a rig at a moment, and what is around it.
#[derive(Clone, Debug, Default)]
pub struct Moment {
    /// The frame's number, of the sensor with the fewest frames.
    pub frame: u64,
    /// The time at which the frame starts, in seconds.
    pub start_s: Option<f64>,
    /// The pose of the body in the world.
    pub world_from_body: Option<Pose>,
    /// The boxes of objects.
    pub boxes: Vec<BoxRow>,
}

/// A page of a sequence that is being made.
pub struct Playback {
    title: String,
    rig: Rig,
    moments: Vec<Moment>,
    /// The moments that there will be.
    planned: u64,
    sensors: Vec<Sensor>,
    bytes: usize,
    /// The bytes that all frames may take.
    most_bytes: usize,
    /// The pixels that a frame may have.
    most_pixels: usize,
    notes: Vec<String>,
}

/// A sensor on the page.
struct Sensor {
    name: String,
    /// What its section needs of its first frame.
    part: Part,
    note: String,
    /// The data of its frames, one for each moment, as HTML. It is empty at a moment at which the sensor has no frame.
    frames: Vec<String>,
    /// The least and the largest value that a channel's colours show.
    scales: BTreeMap<String, [f64; 2]>,
}

impl Playback {
    /// A page that will have so many moments of the sensors of a rig.
    pub fn new(title: &str, rig: Rig, moments: u64, sensors: usize) -> Self {
        Self::within(MOST_BYTES - BYTES_BESIDE_FRAMES, title, rig, moments, sensors)
    }

    /// A page whose frames have at most so many bytes.
    fn within(most_bytes: usize, title: &str, rig: Rig, moments: u64, sensors: usize) -> Self {
        let frames = (moments as usize).saturating_mul(sensors).max(1);
        let most_pixels = most_bytes / BYTES_A_PIXEL / frames;
        Self {
            title: title.to_owned(),
            rig,
            moments: Vec::new(),
            planned: moments.max(1),
            sensors: Vec::new(),
            bytes: 0,
            most_bytes,
            most_pixels: most_pixels.max(1),
            notes: Vec::new(),
        }
    }

    /// Adds a moment with the frames of it. Returns false, and leaves the moment out, if the page is full.
    pub fn add(&mut self, moment: Moment, views: &[View]) -> bool {
        let share = self.most_bytes / self.planned as usize;
        let mut frames = self.encode(views);
        let size =
            |frames: &[(Part, String, String)]| frames.iter().map(|(_, text, _)| text.len()).sum::<usize>();
        if self.moments.is_empty() {
            // Later moments may differ a little from the first.
            while size(&frames) > share / 10 * 9 && self.most_pixels > 1 {
                let fits = share as f64 / size(&frames) as f64;
                self.most_pixels = ((self.most_pixels as f64 * fits * 0.85) as usize).max(1);
                frames = self.encode(views);
            }
        }
        if self.bytes + size(&frames) > self.most_bytes {
            self.notes.push(format!(
                "The page ends with frame {}, because a page has at most {} MB: fewer frames would be shown whole.",
                self.moments.last().map_or(0, |moment| moment.frame),
                MOST_BYTES / 1_000_000
            ));
            return false;
        }
        self.bytes += size(&frames);
        let index = self.moments.len();
        self.moments.push(moment);
        for (view, (part, text, note)) in views.iter().zip(frames) {
            let known = self.sensors.iter().position(|sensor| sensor.name == view.name);
            let at = known.unwrap_or_else(|| {
                let name = view.name.clone();
                self.sensors.push(Sensor { name, part, note, frames: Vec::new(), scales: BTreeMap::new() });
                self.sensors.len() - 1
            });
            let sensor = &mut self.sensors[at];
            sensor.frames.resize(index, String::new());
            sensor.frames.push(text);
            widen(&mut sensor.scales, &view.image);
        }
        true
    }

    /// The frames of a moment as HTML, each with what its section needs, and with what is left out of it.
    fn encode(&self, views: &[View]) -> Vec<(Part, String, String)> {
        let encode = |view: &View| {
            let mut view = view.clone();
            view.image.channels.retain(|channel| !LEFT_OUT.contains(&channel.name.as_str()));
            let thinned = Thinned::to(&view, None, self.most_pixels);
            let part = Part::of(&view, &thinned);
            let data = page::data(&thinned, None);
            (part, script(&data), thinned.note.clone())
        };
        views.iter().map(encode).collect()
    }

    /// The page, with a note above it, which may be empty.
    pub fn finish(self, note: &str) -> String {
        let mut body = String::new();
        for note in
            std::iter::once(note).chain(self.notes.iter().map(String::as_str)).filter(|n| !n.is_empty())
        {
            let _ = write!(body, "<p>{}</p>", escape(note));
        }
        body += "<p class=\"hint\">Normals and the times of single pixels are not on this page: the page of one frame has them.</p>";
        body += &self.player();
        let names: Vec<&str> = self.sensors.iter().map(|sensor| sensor.name.as_str()).collect();
        if !self.rig.sensors.is_empty() {
            body += &page::rig_section("job0", &self.rig, &names);
        }
        for (index, sensor) in self.sensors.iter().enumerate() {
            body += &sensor.section(&format!("job0-frame{index}"), self.moments.len());
        }
        document(&self.title, &body)
    }

    /// The slider with its buttons, and where the body is at each moment.
    fn player(&self) -> String {
        // Poses count from the first one, so that 32 bits hold them anywhere on Earth.
        let origin =
            self.moments.iter().find_map(|m| m.world_from_body).map_or(DVec3::ZERO, |p| p.translation);
        let moment = |moment: &Moment| {
            let pose = moment.world_from_body.map(|pose| {
                json!({
                    "matrix": matrix(&Pose { translation: pose.translation - origin, ..pose }),
                    "words": pose_in_words(&pose),
                })
            });
            let lines = moment.boxes.iter().map(|shown| edges(shown, origin));
            let boxes: Vec<Value> = moment
                .boxes
                .iter()
                .zip(lines)
                .map(|(shown, edges)| {
                    json!({ "name": escaped(&shown.name), "label": shown.label, "edges": floats(&edges) })
                })
                .collect();
            json!({ "frame": moment.frame, "start_s": moment.start_s, "pose": pose, "boxes": boxes })
        };
        let data = json!({ "moments": self.moments.iter().map(moment).collect::<Vec<_>>() });
        let last = self.moments.len().saturating_sub(1);
        format!(
            "<section id=\"player\" class=\"player\" aria-label=\"Playback of {}\">\
             <div class=\"controls\"><button type=\"button\" class=\"play\" aria-label=\"Play\">▶</button>\
             <input type=\"range\" class=\"moment\" min=\"0\" max=\"{last}\" value=\"0\" step=\"1\" aria-label=\"Frame\">\
             <label>Speed <select class=\"speed\"></select></label></div><output class=\"where\"></output>\
             <p class=\"hint\">Space plays and stops; comma and full stop step from frame to frame.</p>{}</section>",
            counted(self.moments.len(), "frame"),
            script(&data)
        )
    }
}

impl Sensor {
    fn section(&self, id: &str, moments: usize) -> String {
        let mut frames: String = String::new();
        for moment in 0..moments {
            let text = self.frames.get(moment).map_or("", String::as_str);
            // A moment without a frame has an element without a frame, so that their numbers agree.
            frames += if text.is_empty() { "<script type=\"application/json\">null</script>" } else { text };
        }
        let scales = json!({ "scales": self.scales });
        let more = format!("<div class=\"frames\" hidden>{frames}</div>{}", script(&scales));
        page::section_of(id, &self.name, &self.part, &self.note, None, &more)
    }
}

/// Widens the scales of channels so that the values of an image are shown too.
fn widen(scales: &mut BTreeMap<String, [f64; 2]>, image: &Image) {
    let seen = image.mask();
    for channel in &image.channels {
        let Samples::F32(values) = &channel.samples else { continue };
        let is_log =
            output::channel(&channel.name).and_then(|spec| spec.shown).map(|s| s.scale) == Some(Scale::Log);
        let known = values.iter().zip(&seen).filter(|(v, seen)| **seen && v.is_finite());
        let mut known: Vec<f32> = known.map(|(v, _)| *v).collect();
        if known.is_empty() {
            continue;
        }
        known.sort_by(f32::total_cmp);
        // As in the page's script: an outlier of a range does not flatten the rest.
        let [low, high] = if is_log { [0.01, 0.99] } else { [0.0, 1.0] };
        let at = |part: f64| f64::from(known[((known.len() - 1) as f64 * part) as usize]);
        let scale = scales.entry(channel.name.clone()).or_insert([f64::INFINITY, f64::NEG_INFINITY]);
        *scale = [scale[0].min(at(low)), scale[1].max(at(high))];
    }
}

/// A pose as WebGL has it: column by column.
fn matrix(pose: &Pose) -> Vec<f64> {
    let columns = [0, 1, 2].map(|axis| pose.rotation.col(axis).extend(0.0).to_array());
    columns.iter().flatten().copied().chain(pose.translation.extend(1.0).to_array()).collect()
}

fn pose_in_words(pose: &Pose) -> String {
    let [x, y, z] = pose.translation.to_array();
    let yaw = libm::atan2(pose.rotation.x_axis.y, pose.rotation.x_axis.x).to_degrees();
    format!("body at ({x:.2}, {y:.2}, {z:.2}) m, yaw {:.1}°", yaw + 0.0)
}

fn floats(points: &[[f32; 3]]) -> String {
    pack::base64(&points.iter().flatten().copied().flat_map(f32::to_le_bytes).collect::<Vec<u8>>())
}

/// The ends of the twelve edges of a box, counted from `origin`, and of a line along its length.
fn edges(shown: &BoxRow, origin: DVec3) -> Vec<[f32; 3]> {
    let at = |x: f64, y: f64, z: f64| {
        let corner = shown.world_from_box.point(DVec3::new(x, y, z) * shown.size_m * 0.5);
        (corner - origin).as_vec3().to_array()
    };
    let mut lines = Vec::new();
    for (a, b) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
        lines.extend([
            at(-1.0, a, b),
            at(1.0, a, b),
            at(a, -1.0, b),
            at(a, 1.0, b),
            at(a, b, -1.0),
            at(a, b, 1.0),
        ]);
    }
    lines.extend([at(0.0, 0.0, -1.0), at(1.0, 0.0, -1.0)]);
    lines
}

/// A sentence about the frames of sensors of different rates.
pub const FASTER: &str = "Each sensor has as many frames here as the slowest one: of a faster sensor, those that are nearest in time.";

/// Of so many frames, one of how many a page shows.
fn step_of(count: u64) -> u64 {
    count.div_ceil(MOST_MOMENTS).max(1)
}

/// The frames that a page shows, of so many: all, or every so many.
pub fn chosen(count: u64) -> impl Iterator<Item = u64> {
    (0..count).step_by(step_of(count) as usize)
}

/// A sentence about the frames that a page of so many leaves out. Empty if it has all.
pub fn note_of_chosen(count: u64) -> String {
    match step_of(count) {
        1 => String::new(),
        step => format!(
            "One of {step} frames is shown: {count} are too many for a page, which has at most {MOST_MOMENTS} frames of a sensor. \
             --frames A..B shows others."
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::super::page::tests::{data, view};
    use super::*;

    fn moment(frame: u64) -> Moment {
        let at = DVec3::new(5e5 + frame as f64, 2.0, 0.0);
        let shown = BoxRow {
            name: "<car>".to_owned(),
            label: 4,
            world_from_box: Pose { translation: at + DVec3::new(10.0, 0.0, 0.0), ..Pose::IDENTITY },
            size_m: DVec3::new(4.0, 2.0, 1.5),
        };
        Moment {
            frame,
            start_s: Some(0.1 * frame as f64),
            world_from_body: Some(Pose { translation: at, ..Pose::IDENTITY }),
            boxes: vec![shown],
        }
    }

    #[test]
    fn a_playback_has_a_frame_of_each_moment_and_poses_that_count_from_the_first() {
        let mut playback = Playback::new("drive", Rig::default(), 3, 1);
        for frame in 0..3 {
            assert!(playback.add(moment(frame), &[View { name: "top".to_owned(), ..view() }]));
        }
        let page = playback.finish("a note");
        assert!(page.contains("<p>a note</p>") && page.contains("max=\"2\""));
        assert_eq!(page.matches("\"channels\"").count(), 3);
        assert!(!page.contains("<car>"));
        let player = data(&page);
        let moments = player["moments"].as_array().unwrap();
        assert_eq!((moments.len(), &moments[2]["pose"]["matrix"][12]), (3, &json!(2.0)));
        assert_eq!(moments[1]["pose"]["words"], "body at (500001.00, 2.00, 0.00) m, yaw 0.0°");
        assert_eq!(moments[0]["boxes"][0]["label"], 4);
        // Twelve edges and a line forward, each of two points of three numbers.
        assert_eq!(
            moments[0]["boxes"][0]["edges"].as_str().unwrap().len(),
            (26 * 3 * 4_usize).div_ceil(3) * 4
        );
    }

    #[test]
    fn a_page_stays_below_its_size_and_says_what_it_leaves_out() {
        // Noise, which takes all its bits: nothing of it can be predicted.
        let mut state = 1_u32;
        let mut noise = || {
            state = state.wrapping_mul(0x9e37_79b1).wrapping_add(0x7f4a_7c15);
            state ^ state >> 15
        };
        let (rows, columns) = (100, 300);
        let pixels = rows * columns;
        let of_frame = |noise: &mut dyn FnMut() -> u32| {
            let mut view = View { name: "top".to_owned(), ..view() };
            let range = (0..pixels).map(|_| 1.0 + (noise() >> 8) as f32).collect();
            view.image = Image {
                rows,
                columns,
                channels: vec![
                    crate::output::Channel {
                        name: "id.instance".to_owned(),
                        samples: Samples::U32((0..pixels).map(|_| noise()).collect()),
                    },
                    crate::output::Channel { name: "range".to_owned(), samples: Samples::F32(range) },
                ],
            };
            view.points = Err("none".to_owned());
            view
        };
        let most = 1_000_000;
        let mut playback = Playback::within(most, "noise", Rig::default(), 20, 1);
        for frame in 0..20 {
            assert!(
                playback.add(Moment { frame, ..Moment::default() }, &[of_frame(&mut noise)]),
                "frame {frame}"
            );
        }
        assert!(playback.bytes < most && playback.bytes > most / 3, "{} bytes", playback.bytes);
        let page = playback.finish("");
        assert!(page.len() < most + BYTES_BESIDE_FRAMES, "{} bytes", page.len());
        assert!(
            page.contains("100 × 300 pixels are too many for a page. It shows"),
            "frames are thinned out"
        );

        // A later moment that takes more than the first let expect is where the page ends, and it says so.
        let calm = View { name: "top".to_owned(), points: Err("none".to_owned()), ..view() };
        let mut playback = Playback::within(200_000, "noise", Rig::default(), 20, 1);
        assert!(playback.add(Moment::default(), &[calm]));
        let added = (1..20).take_while(|&frame| {
            playback.add(Moment { frame, ..Moment::default() }, &[of_frame(&mut noise)])
        });
        let last = added.last().unwrap();
        assert!(last < 19 && playback.bytes <= 200_000, "{last}");
        let said = format!("The page ends with frame {last}, because a page has at most 48 MB");
        assert!(playback.finish("").contains(&said));
    }

    #[test]
    fn very_many_frames_are_shown_one_of_several() {
        let shown = |count| (chosen(count).count(), note_of_chosen(count));
        assert_eq!(shown(100), (100, String::new()));
        let (count, note) = shown(1001);
        assert!(
            count == 91 && note.starts_with("One of 11 frames is shown: 1001 are too many"),
            "{count} {note}"
        );
    }
}
