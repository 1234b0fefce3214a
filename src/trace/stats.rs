//! Counters of the work that casting does.

use std::ops::{AddAssign, Sub};

/// The work of a cast, summed over all rays: how much of the hierarchies was visited, and which arithmetic decided whether
/// rays pass through triangles. The tracer alone decides how rays are parted into packets and single rays, so these numbers
/// may change from version to version.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalStats {
    /// Visits of a node, each by a packet or by a ray.
    pub nodes: u64,
    /// Visits of a leaf whose triangles were tested, each by a packet or by a ray.
    pub leaves: u64,
    /// Tests of one ray against one triangle.
    pub tests: u64,
    /// The tests that f32 left open and that were decided in f64.
    pub in_f64: u64,
    /// The tests that f64 left open and that were decided exactly.
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
