//! What casting takes.

use std::ops::{AddAssign, Sub};

/// What casting took, over all rays: how much of the hierarchy was looked at, and how far the decisions whether rays pass
/// through triangles had to go. How the work is shared out among packets and single rays, and so all of this, is the tracer's
/// own business, and may change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalStats {
    /// Nodes visited, each by a packet or by a ray.
    pub nodes: u64,
    /// Leaves whose triangles were tested, each against a packet or a ray.
    pub leaves: u64,
    /// Tests of a ray against a triangle.
    pub tests: u64,
    /// Those of them that f32 left open: decided in f64.
    pub in_f64: u64,
    /// Those of them that f64 left open: decided exactly.
    pub exactly: u64,
}

impl AddAssign for TraversalStats {
    fn add_assign(&mut self, more: Self) {
        self.nodes += more.nodes;
        self.leaves += more.leaves;
        self.tests += more.tests;
        self.in_f64 += more.in_f64;
        self.exactly += more.exactly;
    }
}

impl Sub for TraversalStats {
    type Output = Self;

    fn sub(self, less: Self) -> Self {
        Self {
            nodes: self.nodes - less.nodes,
            leaves: self.leaves - less.leaves,
            tests: self.tests - less.tests,
            in_f64: self.in_f64 - less.in_f64,
            exactly: self.exactly - less.exactly,
        }
    }
}
