//! A frame as the page shows it, and the view of a frame that was cast.

use std::collections::BTreeMap;

use super::rig::Rig;
use crate::output::{CloudFrame, Image, Names, SensorFrame, id_of};
use crate::scan::{Frame, Return};
use crate::scene::Scene;
use crate::sensor::{Capture, Sensor};

/// A frame as the page shows it.
#[derive(Clone, Debug)]
pub struct View {
    /// The name of the frame's sensor or file.
    pub name: String,
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
    /// Shows a frame that was cast. Its points are in the sensor's body frame.
    pub fn of_frame(
        name: &str,
        sensor: &Sensor,
        frame: &Frame,
        scene: &Scene,
        labels: &BTreeMap<u32, String>,
    ) -> Self {
        let capture = Capture::at_origin(sensor);
        let names = Names::default();
        let seen = SensorFrame { capture, frame, name, cloud_frame: CloudFrame::Body, names, legend: false };
        let point = |(i, hit): (usize, Return)| {
            seen.point(i / frame.columns(), i % frame.columns(), hit.range_m).map(|p| p.as_vec3().to_array())
        };
        Self {
            name: name.to_owned(),
            image: Image::of(&seen),
            points: Ok(frame.iter().filter_map(point).collect()),
            instances: (0..)
                .map(id_of)
                .zip(scene.geometry.objects.iter().map(|instance| instance.name.clone()))
                .collect(),
            labels: labels.clone(),
        }
    }
}
