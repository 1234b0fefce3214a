//! What is true of a job's frames beside their returns: how surfaces move, and the rows of the run's tables.

use std::collections::BTreeMap;

use super::plan::Item;
use super::session::Session;
use super::table::Table;
use super::tracked::Tracked;
use crate::output::{SensorFrame, box_row, pose_row, visible_row};
use crate::scan::{self, Frame, Progress};
use crate::truth::{BoxTruth, SurfaceMotion, boxes, surface_colors, surface_motions};

/// What is true of a frame beside its returns.
#[derive(Clone, Debug, Default)]
pub struct FrameTruth<'s> {
    /// How the surface of each return moves, by the slot of the return. It is empty if no format tells it.
    pub motions: Vec<SurfaceMotion>,
    /// The linear red, green and blue of each return's surface, by the slot of the return. It is empty if no format tells it.
    pub colors: Vec<[f32; 3]>,
    /// The boxes of objects. `None` if the job asks for none.
    pub boxes: Option<Vec<BoxTruth<'s>>>,
    /// The rows of the run's tables, each without its line's end.
    pub rows: BTreeMap<Table, Vec<String>>,
}

impl Session {
    /// What is true of a frame that was cast. `None` when `progress` was cancelled.
    pub fn truth<'s>(&'s self, item: &Item, frame: &Frame, progress: &Progress) -> Option<FrameTruth<'s>> {
        let (job, capture) = (&*self.job, self.capture(item));
        let mut truth = FrameTruth::default();
        if job.output.formats.iter().any(|format| format.tells_motion()) {
            truth.motions = surface_motions(self.frame_tracer(item).scene(), &capture, frame);
        }
        if job.output.formats.iter().any(|format| format.tells_colors()) {
            truth.colors = surface_colors(self.frame_tracer(item).scene(), &capture, frame);
        }
        let seen = self.sensor_frame(item, frame);
        for table in Table::of(job) {
            let rows = match table {
                Table::Poses => vec![pose_row(&seen)],
                Table::Visible => vec![visible_row(&seen)],
                Table::Boxes => {
                    let found = truth.boxes.insert(self.boxes(item, &seen, progress)?);
                    found.iter().map(|truth| box_row(&seen, truth, job.truth.masks)).collect()
                }
            };
            truth.rows.insert(table, rows);
        }
        Some(truth)
    }

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
