//! What there is to know before any place is drawn: surfaces by their names, the boxes of what is to stand on them, and the boxes
//! of what is there already.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use glam::DVec3;

use super::super::loading::{clips_of_actors, open_scene};
use crate::config::{Actor, ActorBody, Job, Placing, SurfaceName};
use crate::error::Error;
use crate::placing::{ATTEMPTS, Body, NoSurface, Refused, Standing, Surface};
use crate::scene::{self, Scene, gltf};
use crate::source::suggest::nearest;
use crate::source::words::{joined, list, quoted};
use crate::source::{Diagnostic, Doubt, Severity};
use crate::truth::OrientedBox;

/// Most names that a message lists.
const MOST_LISTED: usize = 12;

const EVERYWHERE: [[f64; 2]; 2] = [[f64::NEG_INFINITY, f64::INFINITY]; 2];

/// The scene of a job, without the actors that have no place yet, at the times at which places have to be free.
pub(super) struct Survey<'j> {
    job: &'j Job,
    allowed_folders: &'j [PathBuf],
    times_s: Vec<f64>,
    /// The scene at each of the times.
    pub snapshots: Vec<Scene>,
    /// What was found already: many actors stand on one surface, or are copies of one file.
    grounds: Vec<(SurfaceName, [[f64; 2]; 2], Rc<Ground>)>,
    extents: BTreeMap<PathBuf, (DVec3, DVec3)>,
}

/// A surface of the scene.
pub(super) struct Ground {
    pub surface: Surface,
    /// The objects that it is of.
    objects: BTreeSet<u32>,
}

/// What an actor is and where it may stand.
pub(super) struct Site {
    pub ground: Rc<Ground>,
    pub body: Body,
}

/// The box of an actor that is there already.
pub(super) struct Other {
    objects: BTreeSet<u32>,
    pub standing: Standing,
}

impl Site {
    /// The lowest and the highest corner of all that the actor may meet, in the world, in metres.
    pub fn reach(&self) -> (DVec3, DVec3) {
        let (low, high) = self.ground.surface.bounds();
        let Body { low: own_low, high: own_high, clearance_m, lift_m } = self.body;
        let farthest = own_low.abs().max(own_high.abs()).length() + 2.0 * clearance_m + lift_m;
        (low - farthest, high + farthest)
    }

    /// Whether the surface is a part of another actor: what stands on the bed of a truck is in the truck's box.
    pub fn is_on(&self, other: &Other) -> bool {
        !self.ground.objects.is_disjoint(&other.objects)
    }
}

impl<'j> Survey<'j> {
    pub fn new(job: &'j Job, allowed_folders: &'j [PathBuf], scene: &Scene, times_s: &[f64]) -> Self {
        Self {
            job,
            allowed_folders,
            times_s: times_s.to_vec(),
            snapshots: times_s.iter().map(|time_s| scene.at(*time_s)).collect(),
            grounds: Vec::new(),
            extents: BTreeMap::new(),
        }
    }

    /// What an actor is and where it may stand.
    ///
    /// # Errors
    /// [`Error::Config`] if there is no such surface or nothing can stand on it, [`Error::Scene`] if the actor's file can't be read.
    pub fn site(&mut self, actor: &Actor, placing: &Placing) -> Result<Site, Error> {
        let ground = self.ground(actor, placing)?;
        let (low, high) = self.extent(actor, placing)?;
        if low.z < -placing.lift_m {
            let message = format!(
                "actor {} reaches {:.3} m below its own origin, which is to stand on the surface",
                quoted(&actor.name),
                -low.z
            );
            let help = "in its file, lay the origin at its foot; with a larger `lift_m` it may reach as deep";
            return Err(wrong(placing, message, Some(help.to_owned())));
        }
        let Placing { clearance_m, lift_m, .. } = *placing;
        Ok(Site { ground, body: Body { low, high, clearance_m, lift_m } })
    }

    /// The surface of a place, as it is at the first of the times.
    fn ground(&mut self, actor: &Actor, placing: &Placing) -> Result<Rc<Ground>, Error> {
        let Placing { on, zone_m, .. } = placing;
        if let Some((.., known)) = self.grounds.iter().find(|(name, zone, _)| name == on && zone == zone_m) {
            return Ok(known.clone());
        }
        let scene = &self.snapshots[0];
        let name = quoted(&actor.name);
        let meant = Meant::of(self.job, scene, on).map_err(|help| {
            wrong(placing, format!("the scene has no {} for actor {name}", shown(on)), help)
        })?;
        let mut objects = BTreeSet::new();
        scene.triangles_of(|surface| {
            let is_meant = meant.has(scene, surface);
            objects.extend(is_meant.then_some(surface.object));
            is_meant
        });
        let of = |zone| Surface::of(scene, |surface| meant.has(scene, surface), zone);
        let surface = of(*zone_m).map_err(|problem| {
            let on = shown(on);
            let (problem, help) = match problem {
                NoSurface::Empty => (format!("{on} has no triangles"), None),
                NoSurface::NoneFacesUp(true) => {
                    let help = "some face down: are their corners given clockwise, as seen from above?";
                    (format!("no triangle of {on} faces up"), Some(help.to_owned()))
                }
                NoSurface::NoneFacesUp(false) => {
                    let help = "what rises by more than 45 degrees bears nothing: name a floor";
                    (format!("no triangle of {on} faces up"), Some(help.to_owned()))
                }
                NoSurface::NoneInZone => {
                    let reach = of(EVERYWHERE).map(|surface| surface.bounds()).ok();
                    let help = reach.map(|(low, high)| {
                        format!(
                            "it goes from {:.3} to {:.3} m in x and from {:.3} to {:.3} m in y",
                            low.x, high.x, low.y, high.y
                        )
                    });
                    (format!("nothing of {on} lies within `x_m` and `y_m`"), help)
                }
            };
            wrong(placing, format!("actor {name} can't stand there: {problem}"), help)
        })?;
        let ground = Rc::new(Ground { surface, objects });
        self.grounds.push((on.clone(), *zone_m, ground.clone()));
        Ok(ground)
    }

    /// The lowest and the highest corner of an actor's box, in its own frame, in metres.
    fn extent(&mut self, actor: &Actor, placing: &Placing) -> Result<(DVec3, DVec3), Error> {
        let ActorBody::File { path, as_written } = &actor.body else {
            return Err(wrong(placing, "a place is drawn for a file only".to_owned(), None));
        };
        if let Some(known) = self.extents.get(path) {
            return Ok(*known);
        }
        let scene = self.read(path, as_written)?;
        let snapshots = self.times_s.iter().map(|time_s| scene.at(*time_s));
        let found = crate::placing::extent(snapshots).ok_or_else(|| {
            let message = format!("nothing of actor {} is shown at that time", quoted(&actor.name));
            wrong(placing, message, None)
        })?;
        self.extents.insert(path.clone(), found);
        Ok(found)
    }

    /// An actor's file, as it stands at the world's origin.
    fn read(&self, path: &Path, as_written: &str) -> Result<Scene, Error> {
        let clips = clips_of_actors(self.job);
        let options = gltf::Options {
            up: self.job.up,
            allowed_folders: self.allowed_folders,
            clips: &clips,
            start_s: self.job.sequence.start_s,
            ..gltf::Options::default()
        };
        Ok(open_scene(path, as_written, &options)?.scene)
    }

    /// The boxes of the actors that are there already, at each of the times at which they are shown.
    pub fn boxes(&self) -> Vec<Other> {
        let mut found = Vec::new();
        for actor in self.job.actors.iter().filter(|actor| actor.placing.is_none()) {
            for (time_s, scene) in self.times_s.iter().zip(&self.snapshots) {
                let groups = scene.geometry.groups.iter().filter(|group| group.name == actor.name);
                let objects: BTreeSet<u32> = groups.flat_map(|group| group.objects.iter().copied()).collect();
                let runs = scene.triangles_of(|surface| objects.contains(&surface.object));
                let corners = runs.into_iter().flat_map(|(placement, run)| {
                    run.flat_map(move |triangle| scene.triangle_at(placement, triangle))
                });
                let pose = actor.trajectory.pose_at(*time_s);
                if let Some(oriented) = OrientedBox::in_frame(&pose, corners) {
                    found.push(Other { objects, standing: Standing { oriented, clearance_m: 0.0 } });
                }
            }
        }
        found
    }
}

/// The surfaces of a scene that a name stands for.
enum Meant {
    /// By the objects' and the materials' ids.
    Named {
        objects: Vec<bool>,
        materials: Vec<bool>,
    },
    Labelled(u32),
}

impl Meant {
    /// # Errors
    /// With what was probably meant, if the scene has nothing of that name.
    fn of(job: &Job, scene: &Scene, on: &SurfaceName) -> Result<Self, Option<String>> {
        let given = match on {
            SurfaceName::Label(label) => {
                let labels = scene.labels();
                if labels.contains(label) {
                    return Ok(Self::Labelled(*label));
                }
                let labels: Vec<String> = labels.iter().take(MOST_LISTED).map(u32::to_string).collect();
                return Err(Some(format!("its labels are {}", joined(&labels, "and"))));
            }
            SurfaceName::Name(name) => name,
        };
        let is_it = |name: &str| match given.strip_suffix('*') {
            Some(start) => name.starts_with(start),
            None => name == given,
        };
        let geometry = &scene.geometry;
        let objects: Vec<bool> = geometry.objects.iter().map(|object| is_it(&object.name)).collect();
        let materials: Vec<bool> = geometry.materials.iter().map(|material| is_it(&material.name)).collect();
        if objects.iter().chain(&materials).any(|is_it| *is_it) {
            return Ok(Self::Named { objects, materials });
        }
        if let Some(label) = job.labels.get(given) {
            return Ok(Self::Labelled(*label));
        }
        let objects = geometry.objects.iter().map(|object| object.name.as_str());
        let materials = geometry.materials.iter().map(|material| material.name.as_str());
        let names = objects.chain(materials).chain(job.labels.keys().map(String::as_str));
        let names: BTreeSet<&str> = names.filter(|name| !name.is_empty()).collect();
        let help = match nearest(given, names.iter().copied()) {
            Some(near) => format!("did you mean {}?", quoted(near)),
            None if names.is_empty() => {
                "its objects and materials have no names: `on_label` takes a label".to_owned()
            }
            None if names.len() <= MOST_LISTED => {
                format!("its objects and materials, and the job's labels, are called {}", list(names, "and"))
            }
            None => {
                let some = list(names.into_iter().take(MOST_LISTED), "and");
                format!(
                    "its objects and materials are called {some}, among others; `beamcast info` lists nodes"
                )
            }
        };
        Err(Some(help))
    }

    fn has(&self, scene: &Scene, surface: scene::Surface) -> bool {
        match self {
            Self::Named { objects, materials } => {
                objects[surface.object as usize] || materials[surface.material as usize]
            }
            Self::Labelled(label) => scene.label(surface) == *label,
        }
    }
}

/// A surface's name in a message.
fn shown(on: &SurfaceName) -> String {
    match on {
        SurfaceName::Name(name) => format!("surface {}", quoted(name)),
        SurfaceName::Label(label) => format!("surface with the label {label}"),
    }
}

/// The error that an actor finds no place.
pub(super) fn no_place(job: &Job, actor: &Actor, placing: &Placing, refused: Refused) -> Error {
    let frame = match job.frame.filter(|_| !placing.is_of_run) {
        Some(frame) => format!(" in frame {frame}"),
        None => String::new(),
    };
    let Refused { scene, others, inside } = refused;
    let message = format!(
        "actor {} finds no place on the {}{frame}: of {ATTEMPTS} attempts, {scene} met the scene, {others} another actor, and {inside} were inside of something",
        quoted(&actor.name),
        shown(&placing.on),
    );
    let help = if inside > scene.max(others) {
        "what encloses it shows its back all around: do the walls of a room face outwards?"
    } else if scene >= others {
        "a smaller `clearance_m`, another part of the surface by `x_m` and `y_m`, or a larger `lift_m` where the surface slopes, may do"
    } else {
        "fewer actors, a smaller `clearance_m` or a larger surface may do"
    };
    wrong(placing, message, Some(help.to_owned()))
}

/// An error about a place, where the job names its surface.
fn wrong(placing: &Placing, message: String, help: Option<String>) -> Error {
    let key = match placing.on {
        SurfaceName::Name(_) => "on",
        SurfaceName::Label(_) => "on_label",
    };
    let doubt = Doubt { help, ..Doubt::new("", key, message) };
    Error::Config(vec![Diagnostic { severity: Severity::Error, ..doubt.at(&placing.place) }])
}
