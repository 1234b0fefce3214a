//! The objects that boxes are made for.

use glam::DVec3;

use super::oriented::OrientedBox;
use crate::motion::{Trajectory, Velocity};
use crate::scene::{Group, Mover, Scene};

/// Which objects boxes are made for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// What moves: actors, and nodes that an animation moves, each with all below it.
    #[default]
    Tracked,
    /// What moves, and every other object that has a label besides 0.
    Labelled,
    /// What moves, and every other object.
    All,
}

impl Choice {
    /// Every choice with its name in a job.
    pub const NAMED: [(&'static str, Self); 3] =
        [("tracked", Self::Tracked), ("labelled", Self::Labelled), ("all", Self::All)];
}

/// An object that boxes are made for, or several that move as one.
#[derive(Clone, Debug)]
pub struct Target {
    /// Its number, from 1. It is the same in all frames of all sensors, and what moves has the same whatever else is chosen.
    pub track: u32,
    /// The name of the actor or the node.
    pub name: String,
    /// The semantic label; 0 is none.
    pub label: u32,
    /// The ids of its objects, in ascending order.
    pub objects: Vec<u32>,
    frame: Frame,
}

/// The axes of a target's box.
#[derive(Clone, Debug)]
enum Frame {
    /// It moves, and the box has the axes of this trajectory.
    Moving(Trajectory),
    /// It stands still, and the box stands upright around it.
    Still(OrientedBox),
}

/// The objects of a scene that boxes are made for.
#[derive(Clone, Debug, Default)]
pub struct Targets {
    all: Vec<Target>,
    /// For each object its target's place in the list, or [`NONE`].
    of_object: Vec<u32>,
}

/// In place of a target's place in the list.
const NONE: u32 = u32::MAX;

impl Targets {
    /// The chosen objects of a scene: what moves first, then the others by their ids.
    pub fn of(scene: &Scene, choice: Choice) -> Self {
        let geometry = &scene.geometry;
        let labels = scene.labels_of_objects();
        let label_of = |object: u32| labels[object as usize];
        let mut targets = Self { all: Vec::new(), of_object: vec![NONE; geometry.objects.len()] };
        for Group { name, label, objects, world_from_group } in &geometry.groups {
            let of_objects = objects.iter().map(|&object| label_of(object)).find(|label| *label != 0);
            let frame = Frame::Moving(Trajectory::Chain(world_from_group.clone()));
            targets.add(name, label.or(of_objects).unwrap_or(0), objects.clone(), frame);
        }
        for Mover { object, motion, .. } in &geometry.movers {
            if targets.track_of(*object).is_none() {
                let name = &geometry.objects[*object as usize].name;
                let frame = Frame::Moving(Trajectory::Chain(motion.clone()));
                targets.add(name, label_of(*object), vec![*object], frame);
            }
        }
        if choice == Choice::Tracked {
            return targets;
        }
        for (object, corners) in scene.corners_by_object() {
            let label = label_of(object);
            if targets.track_of(object).is_some() || (choice == Choice::Labelled && label == 0) {
                continue;
            }
            if let Some(still) = OrientedBox::upright(&corners) {
                let name = &geometry.objects[object as usize].name;
                targets.add(name, label, vec![object], Frame::Still(still));
            }
        }
        targets
    }

    fn add(&mut self, name: &str, label: u32, objects: Vec<u32>, frame: Frame) {
        let place = self.all.len() as u32;
        objects.iter().for_each(|&object| self.of_object[object as usize] = place);
        self.all.push(Target { track: place + 1, name: name.to_owned(), label, objects, frame });
    }

    /// The targets, by their tracks.
    pub fn iter(&self) -> impl Iterator<Item = &Target> {
        self.all.iter()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// The track of an object, if it is a target or belongs to one.
    #[inline]
    pub fn track_of(&self, object: u32) -> Option<u32> {
        let place = *self.of_object.get(object as usize)?;
        (place != NONE).then(|| place + 1)
    }
}

impl Target {
    /// The box at a time, with the velocities of what is at its centre, in the world's axes. `None` while all of it is hidden.
    pub fn at(&self, scene: &Scene, time_s: f64) -> Option<(OrientedBox, Velocity)> {
        let trajectory = match &self.frame {
            Frame::Still(still) => return Some((*still, Velocity::default())),
            Frame::Moving(trajectory) => trajectory,
        };
        let found =
            OrientedBox::in_frame(&trajectory.pose_at(time_s), self.points_at(scene, time_s).into_iter())?;
        let Velocity { linear_m_s, angular_rad_s } = trajectory.velocity(time_s);
        let arm = found.world_from_box.translation - trajectory.pose_at(time_s).translation;
        Some((found, Velocity { linear_m_s: linear_m_s + angular_rad_s.cross(arm), angular_rad_s }))
    }

    /// The world positions of the target's vertices at a time.
    pub fn points_at(&self, scene: &Scene, time_s: f64) -> Vec<DVec3> {
        let geometry = &scene.geometry;
        let mut points = Vec::new();
        for &object in &self.objects {
            match geometry.movers.binary_search_by_key(&object, |mover| mover.object) {
                Ok(place) => {
                    points.extend(geometry.movers[place].positions_at(geometry, time_s).into_iter().flatten())
                }
                Err(_) => points.extend(scene.corners_of(object)),
            }
        }
        points
    }
}
