//! A frame as the page shows it, and the view of a frame that was cast.

use std::collections::BTreeMap;

use super::rig::Rig;
use crate::output::{Image, SensorFrame, id_of};
use crate::scan::Return;
use crate::scene::Scene;

/// A frame as the page shows it.
#[derive(Clone, Debug)]
pub struct View {
    /// The name of the frame's sensor or file.
    pub name: String,
    /// The frame's number, if it is one of several.
    pub frame: Option<u64>,
    /// The frame's channels.
    pub image: Image,
    /// The points of the pixels that have a return, in the pixels' order, in metres, with x forward, y left and z up; or a
    /// sentence that says why the points are not known.
    pub points: Result<Vec<[f32; 3]>, String>,
    /// The names of the instances, by id.
    pub instances: BTreeMap<u32, String>,
    /// What labels stand for, in words.
    pub labels: BTreeMap<u32, String>,
}

/// What a page shows of a job.
#[derive(Clone, Debug, Default)]
pub struct Shown {
    /// The frames.
    pub views: Vec<View>,
    /// The rig that they are of. It has no sensors if nothing is known of it.
    pub rig: Rig,
}

impl View {
    /// Shows a frame that was cast. Its points are in the sensor's body frame, each at its own time.
    pub fn of_frame(seen: &SensorFrame, scene: &Scene, labels: &BTreeMap<u32, String>) -> Self {
        let frame = seen.frame;
        let point = |(i, hit): (usize, Return)| {
            let pulse = seen.capture.pulse(i / frame.columns(), i % frame.columns())?;
            Some(pulse.point(hit.range_m).as_vec3().to_array())
        };
        Self {
            name: seen.name.to_owned(),
            frame: None,
            image: Image::of(seen),
            points: Ok(frame.iter().filter_map(point).collect()),
            instances: (0..)
                .map(id_of)
                .zip(scene.geometry.objects.iter().map(|instance| instance.name.clone()))
                .collect(),
            labels: labels.clone(),
        }
    }

    /// The same as one of several frames, with its number.
    #[must_use]
    pub fn in_sequence(self, frame: Option<u64>) -> Self {
        Self { frame, ..self }
    }

    /// What the frame is called: `roof`, or `roof, frame 50` of several.
    pub fn title(&self) -> String {
        match self.frame {
            Some(frame) => format!("{}, frame {frame}", self.name),
            None => self.name.clone(),
        }
    }
}
