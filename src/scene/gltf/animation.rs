//! Reads animations: which properties of nodes change over time, and how. No mistake in an animation keeps the geometry from
//! being read: a channel that makes no sense is left out, with a warning that names it.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::data::{Data, Elements, Layout};
use super::document::Document;
use super::fault::{Fault, missing, quoted};
use super::notices::Notices;
use super::options::Clips;
use super::rotation::{QUATERNION_TOLERANCE, normalised};
use super::schema::Component::{F32, I8, I16, U8, U16};
use super::schema::{AnimationChannel, Kind, Lenient, Sampler};
use crate::motion::{Blending, Channel, Clock, Track};
use crate::source::suggest::nearest;
use crate::source::words::counted;

const TIMES: Layout = Layout { purpose: "input", kind: Kind::Scalar, components: &[(F32, false)] };
const VECTORS: Layout = Layout { purpose: "output", kind: Kind::Vec3, components: &[(F32, false)] };
const ROTATIONS: Layout = Layout {
    purpose: "output",
    kind: Kind::Vec4,
    components: &[(F32, false), (I8, true), (U8, true), (I16, true), (U16, true)],
};
const WEIGHTS: Layout = Layout { kind: Kind::Scalar, ..ROTATIONS };
/// KHR_node_visibility.
const VISIBILITY: Layout = Layout { purpose: "output", kind: Kind::Scalar, components: &[(U8, false)] };

/// What the clips that are played do to nodes.
#[derive(Default)]
pub(super) struct Animations {
    /// The properties that clips set, by node.
    nodes: BTreeMap<u32, Moves>,
}

/// The properties of a node that clips set. The others are as the node has them.
#[derive(Default)]
pub(super) struct Moves {
    pub translation: Option<Channel<DVec3>>,
    pub rotation: Option<Channel<DQuat>>,
    pub scale: Option<Channel<DVec3>>,
    pub weights: Option<Channel<Vec<f64>>>,
    pub is_visible: Option<Channel<bool>>,
}

impl Moves {
    /// Whether the node's place depends on time.
    pub fn place_moves(&self) -> bool {
        let moves =
            |channel: &Option<Channel<DVec3>>| channel.as_ref().is_some_and(|channel| !channel.is_rest());
        let turns = self.rotation.as_ref().is_some_and(|channel| !channel.is_rest());
        moves(&self.translation) || turns || moves(&self.scale)
    }

    /// Whether a clip says where the node is.
    pub fn set_place(&self) -> bool {
        self.translation.is_some() || self.rotation.is_some() || self.scale.is_some()
    }
}

/// The value that a clip sets once and for all.
pub(super) fn rest<T: Clone>(channel: &Option<Channel<T>>) -> Option<T> {
    let channel = channel.as_ref().filter(|channel| channel.is_rest())?;
    Some(channel.held_at(0.0).clone())
}

impl Animations {
    /// The clips that are to be played, of the animations of the file.
    pub fn read(document: &Document, data: &Data, clips: &Clips, notices: &Notices) -> Result<Self, Fault> {
        let reader = Reader { document, data, notices };
        let mut all = Self::default();
        for clip in chosen(document, clips)? {
            reader.read_clip(clip, clips, &mut all.nodes)?;
        }
        Ok(all)
    }

    /// What clips do to a node.
    pub fn of(&self, node: u32) -> Option<&Moves> {
        self.nodes.get(&node)
    }

    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }
}

/// The indices of the animations that are to be played, in the order in which they are given.
fn chosen(document: &Document, clips: &Clips) -> Result<Vec<u32>, Fault> {
    let Some(names) = &clips.names else { return Ok((0..document.animations.len() as u32).collect()) };
    let all = || document.animations.iter().map(|animation| animation.name.given().map(String::as_str));
    let mut chosen = Vec::new();
    for name in names {
        let found: Vec<u32> = (0..)
            .zip(all())
            .filter(|(_, other)| *other == Some(name.as_str()))
            .map(|(index, _)| index)
            .collect();
        match found[..] {
            [clip] if chosen.contains(&clip) => {}
            [clip] => chosen.push(clip),
            [] => return Err(no_clip(name, all().flatten(), document.animations.len())),
            _ => {
                let count = counted(found.len(), "animation");
                let problem = format!("the file has {count} called {}", quoted(name));
                return Err(Fault::new("animations", problem).help("give them names of their own"));
            }
        }
    }
    Ok(chosen)
}

fn no_clip<'d>(name: &str, names: impl Iterator<Item = &'d str> + Clone, count: usize) -> Fault {
    const LISTED: usize = 20;
    let fault = Fault::new("animations", format!("there is no animation {}", quoted(name)));
    let shown: Vec<String> = names.clone().take(LISTED).map(quoted).collect();
    if shown.is_empty() {
        return fault.help(match count {
            0 => "the file has none".to_owned(),
            _ => format!("the file has {}, none with a name; leave `clips` out", counted(count, "animation")),
        });
    }
    let meant =
        nearest(name, names.clone()).map_or(String::new(), |name| format!("did you mean {}? ", quoted(name)));
    let more = if names.count() > LISTED { ", …" } else { "" };
    fault.help(format!("{meant}the file has {}{more}", shown.join(", ")))
}

/// A property of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Property {
    Translation,
    Rotation,
    Scale,
    Weights,
    Visibility,
}

/// The values of a channel over time, before it is known how long its clip is. Exporters write many keyframes of the same value
/// for bones that stand still; these become one.
enum Values {
    Translation(Track<DVec3>),
    Rotation(Track<DQuat>),
    Scale(Track<DVec3>),
    Weights(Track<Vec<f64>>),
    Visibility(Track<bool>),
}

/// The keyframes of a sampler.
struct Keyframes<'b> {
    times_s: Vec<f64>,
    blending: Blending,
    output: Elements<'b>,
    /// The number of the accessor of the values, for messages.
    accessor: u32,
    /// The elements of a value, which is more than one of weights.
    width: usize,
}

struct Reader<'d, 'a> {
    document: &'d Document,
    data: &'d Data<'a>,
    notices: &'d Notices,
}

impl Reader<'_, '_> {
    fn read_clip(&self, clip: u32, clips: &Clips, nodes: &mut BTreeMap<u32, Moves>) -> Result<(), Fault> {
        let animation = &self.document.animations[clip as usize];
        let place = || self.document.animation_label(clip);
        let channels = self.list(&animation.channels, place, "channels");
        let samplers = self.list(&animation.samplers, place, "samplers");
        // Reading takes time in proportion to the count, however little comes of it.
        self.data
            .spend(channels.len(), size_of::<AnimationChannel>())
            .map_err(|fault| fault.within(place()))?;
        let mut read = Vec::new();
        let mut last_s = 0.0_f64;
        for (number, channel) in channels.iter().enumerate() {
            let place = || format!("{}, channel {number}", place());
            let Some(channel) = channel.given() else {
                self.notices.warn(place, "it is not what glTF asks for, and is left out");
                continue;
            };
            let Some((node, property)) = self.target(channel, place) else { continue };
            match self.values(channel, node, property, samplers, &place) {
                Ok((span, values)) => {
                    last_s = last_s.max(span.1);
                    read.push((number, node, values));
                }
                Err(fault) => {
                    let Fault { element, problem, help, .. } = fault;
                    let place = || format!("{}, {element}", place());
                    let help = help.map_or(String::new(), |help| format!(" ({help})"));
                    let place = || place().trim_end_matches(", ").to_owned();
                    self.notices.warn(place, format!("{problem}{help}; the channel is left out"));
                }
            }
        }
        if read.is_empty() {
            self.notices.note(place, "it moves nothing", None);
            return Ok(());
        }
        let clock = clips.clock(last_s);
        let mut own = BTreeSet::new();
        for (number, node, values) in read {
            let property = (node, values.property());
            if nodes.entry(node).or_default().set(values, clock) {
                own.insert(property);
            } else if own.contains(&property) {
                let message = "an earlier channel of its animation moves the same; the earlier one counts";
                self.notices.warn(|| format!("{}, channel {number}", place()), message);
            } else {
                let message = "an animation that is played before it moves the same node in the same way, and counts; \
                               choose some of them with `clips`";
                self.notices.warn(|| format!("{}, {}", place(), self.document.node_label(node)), message);
            }
        }
        Ok(())
    }

    /// The elements of a list of an animation.
    fn list<'l, T>(&self, list: &'l Lenient<Vec<T>>, place: impl Fn() -> String, name: &str) -> &'l [T] {
        match list {
            Lenient::Given(list) => list,
            Lenient::Absent => &[],
            Lenient::Wrong => {
                self.notices.warn(|| format!("{}, {name}", place()), "this is no list, and is not read");
                &[]
            }
        }
    }

    /// What a channel moves. `None` if that is nothing here.
    fn target(&self, channel: &AnimationChannel, place: impl Fn() -> String) -> Option<(u32, Property)> {
        let Some((node, property)) = target_of(channel) else {
            if channel.target.extensions.pointer.is_some() {
                let message = "it moves no node (KHR_animation_pointer), and is not read";
                self.notices.note(place, message, None);
            } else {
                let path = quoted(&channel.target.path);
                self.notices.warn(place, format!("its path {path} is none that glTF knows; it is left out"));
            }
            return None;
        };
        let Some(node) = node else {
            self.notices.note(place, "it names no node, and is left out as glTF asks for", None);
            return None;
        };
        if node as usize >= self.document.nodes.len() {
            let message = "the node that it moves does not exist; the channel is left out";
            self.notices.warn(|| format!("{}, node {node}", place()), message);
            return None;
        }
        Some((node, property))
    }

    /// The values of a channel, and the times of its first and its last keyframe.
    fn values(
        &self,
        channel: &AnimationChannel,
        node: u32,
        property: Property,
        samplers: &[Lenient<Sampler>],
        channel_place: &dyn Fn() -> String,
    ) -> Result<((f64, f64), Values), Fault> {
        let place = || format!("sampler {}", channel.sampler);
        let sampler = samplers
            .get(channel.sampler as usize)
            .ok_or_else(|| missing("sampler", channel.sampler, samplers.len()))?;
        let sampler = sampler.given().ok_or_else(|| Fault::new(place(), "it is not what glTF asks for"))?;
        let keys = |layout: &Layout, width: usize| {
            self.keyframes(sampler, layout, width).map_err(|fault| fault.within(place()))
        };
        let (span, values) = match property {
            Property::Translation => {
                let keys = keys(&VECTORS, 1)?;
                (keys.span(), Values::Translation(keys.track(vector)?))
            }
            Property::Scale => {
                let keys = keys(&VECTORS, 1)?;
                (keys.span(), Values::Scale(keys.track(vector)?))
            }
            Property::Rotation => {
                let keys = keys(&ROTATIONS, 1)?;
                if !keys.check_rotations().map_err(|fault| fault.within(place()))? {
                    let message =
                        "the length of a quaternion among its keyframes is not 1; it was normalised";
                    self.notices.warn(channel_place, message);
                }
                // The values of a spline are normalised after it was evaluated, since its tangents belong to them as they are.
                let is_spline = keys.blending == Blending::Cubic;
                let rotation = |at: &[[f64; 4]]| {
                    let quaternion = DQuat::from_array(at[0]);
                    if is_spline { quaternion } else { normalised(quaternion) }
                };
                (keys.span(), Values::Rotation(keys.track(rotation)?))
            }
            Property::Weights => {
                let keys = keys(&WEIGHTS, self.target_count(node)?)?;
                let weights = |at: &[[f64; 1]]| at.as_flattened().to_vec();
                (keys.span(), Values::Weights(keys.track(weights)?))
            }
            Property::Visibility => {
                let keys = keys(&VISIBILITY, 1)?;
                if keys.blending != Blending::Step {
                    let message = "what is visible or not changes in steps, whatever its interpolation";
                    self.notices.warn(channel_place, message);
                }
                (keys.span(), Values::Visibility(keys.stepped().track(|at: &[[f64; 1]]| at[0] != [0.0])?))
            }
        };
        Ok((span, values))
    }

    /// The number of morph targets of a node's mesh.
    fn target_count(&self, node: u32) -> Result<usize, Fault> {
        let mesh = self.document.nodes[node as usize].mesh;
        let mesh = mesh.and_then(|mesh| self.document.meshes.get(mesh as usize));
        let primitives = mesh.map_or(&[][..], |mesh| &mesh.primitives[..]);
        match primitives.iter().map(|primitive| primitive.targets.len()).max() {
            Some(count) if count > 0 => Ok(count),
            _ => Err(Fault::new(
                self.document.node_label(node),
                "it has no morph targets that weights could move",
            )),
        }
    }

    fn keyframes(&self, sampler: &Sampler, layout: &Layout, width: usize) -> Result<Keyframes<'_>, Fault> {
        let blending = match sampler.interpolation.as_deref() {
            None | Some("LINEAR") => Blending::Linear,
            Some("STEP") => Blending::Step,
            Some("CUBICSPLINE") => Blending::Cubic,
            Some(other) => {
                let problem = format!("its interpolation {} is none that glTF knows", quoted(other));
                return Err(Fault::new("", problem).help("LINEAR, STEP or CUBICSPLINE"));
            }
        };
        let input = self.data.elements(sampler.input, &TIMES, None).map_err(|fault| fault.within("input"))?;
        let count = input.len();
        let accessor = || format!("input, accessor {}", sampler.input);
        if count == 0 {
            return Err(Fault::new(accessor(), "it has no keyframes"));
        }
        let values = count
            .checked_mul(width)
            .and_then(|n| n.checked_mul(values_a_key(blending)))
            .unwrap_or(usize::MAX);
        let output = self
            .data
            .elements(sampler.output, layout, Some(values))
            .map_err(|fault| fault.within("output"))?;
        // The times, and the values with as many bytes as the widest of them has an element.
        self.data.spend(count, size_of::<f64>())?;
        self.data.spend(values, layout.kind.components() * size_of::<f64>())?;
        let mut times_s: Vec<f64> = Vec::with_capacity(count);
        for key in 0..count {
            let [time] = input.get::<1>(key);
            if !time.is_finite() {
                return Err(Fault::new(accessor(), format!("keyframe {key} has the time {time}")));
            }
            if let Some(&before) = times_s.last()
                && time <= before
            {
                let problem = format!("keyframe {key} at {time} s does not come after {before} s");
                return Err(Fault::new(accessor(), problem).help("times rise from keyframe to keyframe"));
            }
            times_s.push(time);
        }
        Ok(Keyframes { times_s, blending, output, accessor: sampler.output, width })
    }
}

/// The node that a channel moves, and its property. `None` of what is no property of nodes.
pub(super) fn target_of(channel: &AnimationChannel) -> Option<(Option<u32>, Property)> {
    let target = &channel.target;
    if let Some(pointer) = &target.extensions.pointer {
        return pointed(&pointer.pointer).map(|(node, property)| (Some(node), property));
    }
    let property = match target.path.as_str() {
        "translation" => Property::Translation,
        "rotation" => Property::Rotation,
        "scale" => Property::Scale,
        "weights" => Property::Weights,
        _ => return None,
    };
    Some((target.node, property))
}

/// The node and its property that a JSON pointer leads to.
fn pointed(pointer: &str) -> Option<(u32, Property)> {
    let (node, property) = pointer.strip_prefix("/nodes/")?.split_once('/')?;
    let property = match property {
        "translation" => Property::Translation,
        "rotation" => Property::Rotation,
        "scale" => Property::Scale,
        "weights" => Property::Weights,
        "extensions/KHR_node_visibility/visible" => Property::Visibility,
        _ => return None,
    };
    Some((node.parse().ok()?, property))
}

impl Keyframes<'_> {
    /// The times of the first and the last keyframe.
    fn span(&self) -> (f64, f64) {
        (self.times_s[0], self.times_s[self.times_s.len() - 1])
    }

    fn accessor(&self) -> String {
        format!("output, accessor {}", self.accessor)
    }

    /// The keyframes as a track of what `value` makes of the numbers of a value.
    fn track<const N: usize, T>(self, value: impl Fn(&[[f64; N]]) -> T) -> Result<Track<T>, Fault> {
        let parts = values_a_key(self.blending);
        let mut values = Vec::with_capacity(self.times_s.len() * parts);
        let mut numbers = vec![[0.0; N]; self.width];
        let mut first = Vec::new();
        let mut is_still = true;
        for at in 0..self.times_s.len() * parts {
            for (element, numbers) in numbers.iter_mut().enumerate() {
                *numbers = self.output.get::<N>(at * self.width + element);
            }
            if !numbers.as_flattened().iter().all(|number| number.is_finite()) {
                let problem = format!("keyframe {} has a number that is not finite", at / parts);
                return Err(Fault::new(self.accessor(), problem));
            }
            // Of a spline's three, the value lies between the tangents.
            if at % parts == parts / 2 {
                if first.is_empty() {
                    first.clone_from(&numbers);
                }
                is_still &= first == numbers;
            } else {
                is_still &= numbers.as_flattened().iter().all(|&number| number == 0.0);
            }
            values.push(value(&numbers));
        }
        if is_still {
            return Ok(Track::rest(value(&first)));
        }
        let accessor = self.accessor();
        let track = Track::new(self.times_s, values, self.blending);
        track.map_err(|problem| Fault::new(accessor, problem.to_string()))
    }

    /// The same keyframes, whose values hold until the next.
    fn stepped(self) -> Self {
        Self { blending: Blending::Step, ..self }
    }

    /// Checks that the quaternions are rotations. Returns whether the length of all of them is 1.
    fn check_rotations(&self) -> Result<bool, Fault> {
        let mut are_units = true;
        for key in 0..self.times_s.len() {
            let parts = values_a_key(self.blending);
            let quaternion = self.output.get::<4>(key * parts + parts / 2);
            let length = DQuat::from_array(quaternion).length();
            are_units &= (length - 1.0).abs() <= QUATERNION_TOLERANCE;
            if !(length > 0.0 && length.is_finite()) {
                let problem = format!("the rotation of keyframe {key} is {quaternion:?}, which is none");
                return Err(
                    Fault::new(self.accessor(), problem).help("a quaternion [x, y, z, w] of length 1")
                );
            }
        }
        Ok(are_units)
    }
}

fn vector(at: &[[f64; 3]]) -> DVec3 {
    DVec3::from_array(at[0])
}

/// A spline has tangents before and after each value.
fn values_a_key(blending: Blending) -> usize {
    if blending == Blending::Cubic { 3 } else { 1 }
}

impl Values {
    fn property(&self) -> Property {
        match self {
            Self::Translation(_) => Property::Translation,
            Self::Rotation(_) => Property::Rotation,
            Self::Scale(_) => Property::Scale,
            Self::Weights(_) => Property::Weights,
            Self::Visibility(_) => Property::Visibility,
        }
    }
}

impl Moves {
    /// Takes over the values of a channel, unless a channel before it has set the property already. Returns whether it did.
    fn set(&mut self, values: Values, clock: Clock) -> bool {
        fn set<T>(property: &mut Option<Channel<T>>, track: Track<T>, clock: Clock) -> bool {
            let is_new = property.is_none();
            property.get_or_insert_with(|| Channel { track: Arc::new(track), clock });
            is_new
        }
        match values {
            Values::Translation(track) => set(&mut self.translation, track, clock),
            Values::Rotation(track) => set(&mut self.rotation, track, clock),
            Values::Scale(track) => set(&mut self.scale, track, clock),
            Values::Weights(track) => set(&mut self.weights, track, clock),
            Values::Visibility(track) => set(&mut self.is_visible, track, clock),
        }
    }
}
