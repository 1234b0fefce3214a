//! One pixel, cast by the code that casts its frame, with the story of its pulse.

use super::frame::{Cause, Frame};
use super::ideal::{Batch, Piece, Scanner, Strip};
use super::story::{Met, Sent, Story};
use super::strips::SensorPose;
use super::{depth, measured};
use crate::scene::Scene;
use crate::sensor::Capture;
use crate::trace::Cast;

/// Casts one pixel as [`scan`](super::scan) casts it in its frame, and tells the story of its pulse. `None` if the image has no
/// such pixel.
///
/// If bright returns bloom, or the pixels of a depth camera depend on each other, the whole frame is cast.
pub fn explain(
    scene: &Scene,
    tracer: &impl Cast,
    capture: &Capture,
    row: usize,
    column: usize,
) -> Option<Story> {
    if row >= capture.rows() || column >= capture.columns() {
        return None;
    }
    let measurement = &capture.sensor.measurement;
    Some(match &measurement.depth {
        Some(sensing) => {
            let ideal = explain_ideal(scene, tracer, capture, row, column);
            depth::explain(scene, tracer, capture, sensing, ideal)
        }
        None if measurement.is_ideal() => explain_ideal(scene, tracer, capture, row, column),
        None => measured::explain(scene, tracer, capture, row, column),
    })
}

/// The story of an ideal sensor's pulse.
fn explain_ideal(scene: &Scene, tracer: &impl Cast, capture: &Capture, row: usize, column: usize) -> Story {
    let mut frame = Frame::default();
    frame.set_size(1, 1);
    let (returns, causes) = frame.parts();
    let mut strip = Strip { first_row: row, first_column: column, rows: vec![Piece { returns, causes }] };
    let fixed = capture.fixed_world_from_sensor().map(SensorPose::new);
    let scanner = Scanner { scene, tracer, capture, fixed, is_see_through: scene.is_see_through() };
    let mut batch = Batch::default();
    scanner.fill(&mut strip, &mut batch);
    let mut story = Story::of_pixel(row, column);
    story.cause = frame.causes()[0];
    story.returns.extend(frame.get(0, 0).map(|one| (one, None)));
    story.blocker = frame.blocker(0).map(|one| (one, None));
    let Some(pulse) = capture.pulse(row, column) else { return story };
    story.pulse = Some(Sent::of(capture, &pulse, pulse.direction));
    let hit = batch.hits.first().copied().flatten();
    (story.sub_rays, story.lost_rays) = (1, usize::from(hit.is_none()));
    if let Some(hit) = hit {
        let surface = scene.surface(hit.placement, hit.triangle);
        story.met.push(Met {
            cause: Cause::Surface,
            object: Some(surface.object),
            material: Some(surface.material),
            label: scene.label(surface),
            sub_rays: 1,
            paths: 1,
            range_m: [pulse.range_m(hit.t); 2],
            energy: batch.through.share(0),
            share: 1.0,
            transmission: 1.0,
        });
    }
    story
}
