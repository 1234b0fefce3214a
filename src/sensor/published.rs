//! The bounds that data sheets of depth cameras state: how good depth is on a flat target that faces the camera.

/// A bound that a data sheet states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Published {
    /// What is bounded.
    pub quantity: Quantity,
    /// The distances that the data sheet speaks of.
    pub at: StatedAt,
    /// The bound, in the unit of the quantity.
    pub bound: f64,
    /// How much of the distance is added to the bound, as data sheets state systematic errors; 0 of all others.
    pub share_of_distance: f64,
}

/// A quantity that has a bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// The error of depth without its sign, in percent of the distance; at most the bound.
    ZAccuracy,
    /// The pixels that have a depth, in percent; at least the bound.
    FillRate,
    /// The root mean square distance from the fitted plane, in percent of the distance; at most the bound.
    PlaneRms,
    /// The noise in pixels of disparity as librealsense's tool has it; at most the bound.
    SubpixelRms,
    /// The standard deviation over time of a pixel's depth, in metres; at most the bound.
    Sigma,
    /// The difference between the mean depth and the distance without its sign, in metres; at most the bound.
    Bias,
}

/// The distances that a bound holds at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StatedAt {
    /// One distance, in metres.
    At(f64),
    /// Every distance up to one, in metres.
    UpTo(f64),
    /// Every distance that the camera measures.
    All,
}

impl Published {
    /// The bound at a distance in metres.
    pub fn limit(&self, distance_m: f64) -> f64 {
        self.bound + self.share_of_distance * distance_m
    }

    /// Whether a value keeps the bound at a distance in metres. NaN does not.
    pub fn is_kept(&self, found: f64, distance_m: f64) -> bool {
        match self.quantity {
            Quantity::FillRate => found >= self.limit(distance_m),
            _ => found <= self.limit(distance_m),
        }
    }
}

impl StatedAt {
    /// The distance in metres that is named, if one is.
    pub fn distance_m(self) -> Option<f64> {
        match self {
            Self::At(distance_m) | Self::UpTo(distance_m) => Some(distance_m),
            Self::All => None,
        }
    }

    /// Whether a bound speaks of a distance in metres.
    pub fn is_about(self, distance_m: f64) -> bool {
        match self {
            Self::At(at_m) => distance_m == at_m,
            Self::UpTo(end_m) => distance_m <= end_m,
            Self::All => true,
        }
    }
}
