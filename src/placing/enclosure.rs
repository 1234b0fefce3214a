//! Whether a point is inside of something.
//!
//! A thing in a closed house meets no wall of it, and yet can't be there. Who is inside of a closed mesh sees the backs of its
//! triangles all around; who is in a room that is meant to be looked at sees their fronts. Scenes are not made with that much care:
//! walls have openings, and leaves and awnings are single sheets that show their backs to those below. So most directions have to
//! agree.

use glam::DVec3;

use crate::trace::{Cast, Hit, Origins, Rays};

/// How many of the directions must end on the back of a triangle: more than two thirds. A single sheet above is met by at most 9.
const MOST: usize = 12;

/// Whether a point, in the world and in metres, is inside of something: of 17 directions, which are 8 nearly level, 8 that rise and
/// one straight up, at least 12 end on the back of a triangle. Below is what things stand on.
pub(super) fn is_inside(tracer: &impl Cast, point: DVec3) -> bool {
    const AROUND: [[f64; 2]; 8] = [
        [1.0, 0.0],
        [0.7, 0.7],
        [0.0, 1.0],
        [-0.7, 0.7],
        [-1.0, 0.0],
        [-0.7, -0.7],
        [0.0, -1.0],
        [0.7, -0.7],
    ];
    let rising = |rise: f64| AROUND.map(|[x, y]| DVec3::new(x, y, rise).normalize());
    let directions = [rising(0.05).as_slice(), &rising(1.0), &[DVec3::Z]].concat();
    let mut hits: Vec<Option<Hit>> = vec![None; directions.len()];
    tracer.cast(&Rays::unlimited(Origins::Common(point), &directions), &mut hits);
    let is_from_behind =
        |(hit, direction): &(&Option<Hit>, &DVec3)| hit.is_some_and(|hit| hit.normal.dot(**direction) > 0.0);
    hits.iter().zip(&directions).filter(is_from_behind).count() >= MOST
}
