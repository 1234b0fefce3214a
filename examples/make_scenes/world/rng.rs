//! Reproducible random numbers for shapes.

/// The generator SplitMix64 (Steele, Lea and Flood 2014, "Fast splittable pseudorandom number generators").
pub struct Rng(u64);

impl Rng {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number that is uniform in [low, high).
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        let unit = (self.next() >> 11) as f64 / (1_u64 << 53) as f64;
        low + (high - low) * unit
    }

    /// A number that is uniform among `0..count`.
    pub fn below(&mut self, count: usize) -> usize {
        ((self.range(0.0, 1.0) * count as f64) as usize).min(count - 1)
    }

    /// A point that is uniform in the unit ball.
    pub fn in_ball(&mut self) -> glam::DVec3 {
        loop {
            let p = glam::DVec3::new(self.range(-1.0, 1.0), self.range(-1.0, 1.0), self.range(-1.0, 1.0));
            if p.length_squared() <= 1.0 {
                return p;
            }
        }
    }

    /// A point that is uniform on the unit sphere.
    pub fn direction(&mut self) -> glam::DVec3 {
        loop {
            let p = self.in_ball();
            if p.length_squared() > 1e-3 {
                return p.normalize();
            }
        }
    }
}
