//! Boxes of everything that a box reaches while it moves.

use glam::{DAffine3, DMat3, DVec3};

use super::link::{Link, Motion, Trajectory};

/// A closed span of time, and a moment in it from which changes are counted.
#[derive(Clone, Copy)]
struct Window {
    from_s: f64,
    middle_s: f64,
    to_s: f64,
}

impl Window {
    fn new(from_s: f64, to_s: f64) -> Self {
        Self { from_s, middle_s: from_s + 0.5 * (to_s - from_s), to_s }
    }

    /// Seconds from the middle to the farther end.
    fn half_s(&self) -> f64 {
        (self.to_s - self.middle_s).max(self.middle_s - self.from_s)
    }
}

/// How a link's map at any time of a window differs from its map in the middle.
struct Spread {
    /// The map in the middle of the window.
    map: DAffine3,
    /// The most by which the map stretches a difference of two points.
    stretch: f64,
    /// The most by which it moves a point of the box elsewhere, in metres.
    moves_m: f64,
    /// The most by which the rotation in the map moves a unit vector elsewhere.
    turns: f64,
}

/// How many halvings of a window there are at most: 64 parts.
const MOST_HALVINGS: u32 = 6;

/// The part of the size of what is reached by which a part of a window may be too large before it is halved.
const LOOSENESS: f64 = 0.02;

impl Motion {
    /// A box, in the target's frame, of everything that the points of the source's box from `low` to `high` reach at the times of
    /// the closed span. If the source is hidden all that time, the box is empty: its low corner is +∞ and its high corner −∞.
    ///
    /// The box is rigorous. In the middle m of a window, a point x of the source's box is exactly at M(m)x, and the box of the
    /// eight corners' images holds all of these. At another time t of the window, the point is no farther from there than d,
    /// which follows link by link from the source's end. With M = L₁L₂…Lₙ and y(t) the point's place before link i,
    ///
    /// |Lᵢ(t)y(t) − Lᵢ(m)y(m)| ≤ |Lᵢ(t)y(t) − Lᵢ(t)y(m)| + |Lᵢ(t)y(m) − Lᵢ(m)y(m)| ≤ ‖Lᵢ(t)‖·dᵢ₊₁ + eᵢ,
    ///
    /// where eᵢ is the most by which the link alone moves a point of the box of the middle. That is a convex function of the
    /// point, or bounded by one, so the corners are enough. It is a speed times half the window for motions through poses (the
    /// speed of a point that moves along a screw does not change: |v + ω × y|), and the distance of the values that are reached
    /// from that in the middle for keyframes, which may jump.
    ///
    /// Windows are halved until d is a fiftieth of the size of what is reached, at most six times. Rounding is allowed for.
    pub fn bounds(&self, from_s: f64, to_s: f64, low: DVec3, high: DVec3) -> (DVec3, DVec3) {
        let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(|corner| {
            let side = |bit: i32, low: f64, high: f64| if (corner >> bit) & 1 == 0 { low } else { high };
            DVec3::new(side(0, low.x, high.x), side(1, low.y, high.y), side(2, low.z, high.z))
        });
        let mut reached = Hull::EMPTY;
        if !self.is_visible_in(from_s, to_s) {
            return (reached.low, reached.high);
        }
        // Part of what is reached: a size that no halving makes smaller.
        let size =
            [from_s, Window::new(from_s, to_s).middle_s, to_s].iter().fold(Hull::EMPTY, |mut hull, time| {
                let map = self.map_at(*time);
                corners.iter().for_each(|corner| hull.add(map.transform_point3(*corner), 0.0));
                hull
            });
        let allowed_m = LOOSENESS * (size.high - size.low).length();
        self.add_reached(Window::new(from_s, to_s), corners, allowed_m, MOST_HALVINGS, &mut reached);
        if !(reached.low.is_finite() && reached.high.is_finite()) {
            return (DVec3::NEG_INFINITY, DVec3::INFINITY);
        }
        (reached.low, reached.high)
    }

    fn add_reached(
        &self,
        window: Window,
        corners: [DVec3; 8],
        allowed_m: f64,
        halvings: u32,
        reached: &mut Hull,
    ) {
        if !self.is_visible_in(window.from_s, window.to_s) {
            return;
        }
        let (places, moved_m) = self.spread(window, corners);
        if moved_m > allowed_m && halvings > 0 {
            // What moves at a steady speed moves half as far in half the time, so that the number of halvings is known at once.
            let needed = (1..halvings).find(|halvings| moved_m <= allowed_m * f64::from(1 << halvings));
            let needed = needed.unwrap_or(halvings);
            let parts = 1 << needed;
            let time = |part: u32| match part {
                part if part == parts => window.to_s,
                part => window.from_s + (window.to_s - window.from_s) * f64::from(part) / f64::from(parts),
            };
            for part in 0..parts {
                let window = Window::new(time(part), time(part + 1));
                self.add_reached(window, corners, allowed_m, halvings - needed, reached);
            }
        } else {
            places.iter().for_each(|place| reached.add(*place, moved_m));
        }
    }

    /// The images of the corners in the middle of a window, and the most by which a point of the box is elsewhere in it.
    fn spread(&self, window: Window, mut corners: [DVec3; 8]) -> ([DVec3; 8], f64) {
        let mut moved_m = 0.0;
        for link in self.links.iter().rev() {
            let spread = link.spread(window, &corners);
            let before = farthest(&corners);
            corners = corners.map(|corner| spread.map.transform_point3(corner));
            moved_m = spread.stretch * moved_m + spread.moves_m;
            // Each map is computed, and applied to a point, with an error of a few ulps of what is added up.
            moved_m += 32.0 * f64::EPSILON * (spread.stretch * before + farthest(&corners));
        }
        (corners, moved_m)
    }
}

impl Link {
    fn spread(&self, window: Window, corners: &[DVec3; 8]) -> Spread {
        let map = self.map_at(window.middle_s);
        match self {
            Self::Fixed(_) | Self::Visible(_) => {
                Spread { map, stretch: most_stretch(map.matrix3), moves_m: 0.0, turns: 0.0 }
            }
            Self::Rigid(trajectory) => trajectory.spread(window, corners, map),
            Self::Animated { translation, rotation, scale } => {
                let reach = (window.from_s, window.middle_s, window.to_s);
                let (_, moves_m) = translation.reach(reach.0, reach.1, reach.2);
                let (scale, grows) = scale.reach(reach.0, reach.1, reach.2);
                let (rotation, away) = rotation.reach(reach.0, reach.1, reach.2);
                // The sine of the angle between two quaternions is at most their distance over the length of one. It is that of
                // half the angle between the rotations, which move a unit vector apart by twice that.
                let turns = 2.0 * (away / rotation.length()).min(1.0);
                let scaled = corners.iter().map(|corner| (*corner * scale).length()).fold(0.0, f64::max);
                let stretch = scale.abs().max_element() + grows;
                Spread { map, stretch, moves_m: moves_m + turns * scaled + grows * farthest(corners), turns }
            }
        }
    }
}

impl Trajectory {
    fn spread(&self, window: Window, corners: &[DVec3; 8], map: DAffine3) -> Spread {
        let (half_s, stretch) = (window.half_s(), 1.0 + 1e-12);
        let (speed, turn, rounding) = match self {
            Self::Fixed(_) => (0.0, 0.0, 0.0),
            Self::Twist { linear_m_s, angular_rad_s, .. } => {
                let speed = |point: &DVec3| (*linear_m_s + angular_rad_s.cross(*point)).length();
                let time = window.from_s.abs().max(window.to_s.abs());
                // The angle and the way since time 0 are rounded, and so is what is made of them.
                let turned = angular_rad_s.length() * time;
                let rounding = linear_m_s.length() * time * (1.0 + turned) + turned * farthest(corners);
                (corners.iter().map(speed).fold(0.0, f64::max), angular_rad_s.length(), rounding)
            }
            Self::Path(path) => {
                let (speed, turn) = path.most_speed(window.from_s, window.to_s, corners);
                (speed, turn, 0.0)
            }
            Self::Chain(motion) => {
                let (_, moves_m) = motion.spread(window, [DVec3::ZERO; 8]);
                let turns = motion.links.iter().map(|link| link.spread(window, &[DVec3::ZERO; 8]).turns);
                let turns = turns.sum::<f64>().min(2.0);
                return Spread { map, stretch, moves_m: moves_m + turns * farthest(corners), turns };
            }
        };
        let moves_m = speed * half_s * (1.0 + 1e-12) + 16.0 * f64::EPSILON * rounding;
        Spread { map, stretch, moves_m, turns: (turn * half_s).min(2.0) }
    }
}

/// An upper bound of the most by which a matrix stretches a vector: the root of the largest eigenvalue of MᵀM, which is at most the
/// largest sum of absolute values in one of its columns (Gershgorin). It is exact where the columns are at right angles.
fn most_stretch(matrix: DMat3) -> f64 {
    let square = matrix.transpose() * matrix;
    let sum = |column: DVec3| column.abs().element_sum();
    let largest = sum(square.x_axis).max(sum(square.y_axis)).max(sum(square.z_axis));
    largest.sqrt() * (1.0 + 1e-12)
}

fn farthest(points: &[DVec3; 8]) -> f64 {
    points.iter().map(|point| point.length_squared()).fold(0.0, f64::max).sqrt()
}

/// A box about points.
struct Hull {
    low: DVec3,
    high: DVec3,
}

impl Hull {
    const EMPTY: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    /// Makes room for a ball.
    fn add(&mut self, centre: DVec3, radius: f64) {
        // A minimum would forget what is no number.
        let (low, high) = (centre - radius, centre + radius);
        if low.is_nan() || high.is_nan() {
            (self.low, self.high) = (DVec3::NEG_INFINITY, DVec3::INFINITY);
        }
        self.low = self.low.min(low);
        self.high = self.high.max(high);
    }
}
