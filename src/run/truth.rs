//! What is true of a job's frames beside their returns: how surfaces move, and the rows of the run's tables.

use std::collections::BTreeMap;

use super::plan::Item;
use super::session::Session;
use super::tracked::Tracked;
use crate::output::{BOXES, POSES, SensorFrame, VISIBLE, box_row, pose_row, visible_row};
use crate::scan::{self, Frame, Progress};
use crate::truth::{BoxTruth, SurfaceMotion, boxes, surface_colors, surface_motions};

/// What is true of a frame beside its returns.
#[derive(Clone, Debug, Default)]
pub struct FrameTruth<'s> {
    /// How the surface of each return moves, by the slot of the return. It is empty if no format tells it.
    pub motions: Vec<SurfaceMotion>,
    /// The linear red, green and blue of each return's surface, by the slot of the return. It is empty if no format tells it.
    pub colors: Vec<[f32; 3]>,
    /// The boxes of objects, in ascending order of their tracks. `None` if the job asks for none.
    pub boxes: Option<Vec<BoxTruth<'s>>>,
    /// What the run's tables are made of, each row without its line's end: the rows of a table by its name, and what a format
    /// notes by the format's.
    pub rows: BTreeMap<String, Vec<String>>,
}

impl Session {
    /// What is true of a frame that was cast. `None` when `progress` was cancelled.
    pub fn truth(&self, item: &Item, frame: &Frame, progress: &Progress) -> Option<FrameTruth<'_>> {
        let (job, capture) = (&*self.job, self.capture(item));
        let mut truth = FrameTruth::default();
        if job.output.formats.iter().any(|format| format.tells_motion()) {
            truth.motions = surface_motions(self.frame_tracer(item).scene(), &capture, frame);
        }
        if job.output.formats.iter().any(|format| format.tells_colors()) {
            truth.colors = surface_colors(self.frame_tracer(item).scene(), &capture, frame);
        }
        let seen = self.sensor_frame(item, frame);
        if job.truth.boxes.is_some() {
            truth.boxes = Some(self.boxes(item, &seen, progress)?);
        }
        let seen = SensorFrame { boxes: truth.boxes.as_deref(), ..seen };
        let mut rows = BTreeMap::new();
        if job.truth.poses {
            rows.insert(POSES.0.to_owned(), vec![pose_row(&seen)]);
        }
        if job.truth.boxes.is_some() {
            let row = |found| box_row(&seen, found, job.truth.masks);
            rows.insert(BOXES.to_owned(), seen.boxes.unwrap_or_default().iter().map(row).collect());
        }
        if job.truth.visible {
            rows.insert(VISIBLE.to_owned(), vec![visible_row(&seen)]);
        }
        for format in &job.output.formats {
            if let Some(note) = format.note(&seen) {
                rows.insert(format.name().to_owned(), vec![note]);
            }
        }
        truth.rows = rows;
        Some(truth)
    }

    /// A frame that was cast, with what is true of it.
    pub fn frame_with_truth<'f>(
        &'f self,
        item: &Item,
        frame: &'f Frame,
        truth: &'f FrameTruth<'f>,
    ) -> SensorFrame<'f> {
        let FrameTruth { motions, colors, boxes, .. } = truth;
        SensorFrame { motions, colors, boxes: boxes.as_deref(), ..self.sensor_frame(item, frame) }
    }

    /// The boxes of objects, of which there are none if the job asks for none.
    fn boxes(&self, item: &Item, seen: &SensorFrame, progress: &Progress) -> Option<Vec<BoxTruth<'_>>> {
        let Some(Tracked { targets, alone: Some(alone) }) = self.tracked.as_deref() else {
            return Some(Vec::new());
        };
        let tracer = self.arranged(alone, item);
        let track_of = |object| targets.track_of(object);
        let alone = scan::alone(tracer.scene(), &tracer, &seen.capture, &track_of, progress)?;
        Some(boxes(self.scene(), targets, &seen.capture, seen.frame, &alone))
    }
}
