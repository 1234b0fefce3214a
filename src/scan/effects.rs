//! The numbers of random effects, which never change: each effect has its own streams, so that one does not disturb another.

/// A random effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub(super) enum Effect {
    /// The noise of a peak's height, by pulse and path.
    Detection = 1,
    /// The noise of a range, by pulse and path.
    RangeNoise = 2,
    /// The bias of a beam's ranges, by beam.
    BeamBias = 3,
    /// The gain of a beam, by beam.
    BeamGain = 4,
    /// The direction of a pulse, by pulse.
    PulseAngle = 5,
    /// The direction of a beam, by beam.
    BeamAngle = 6,
    /// False alarms, by pulse.
    FalseAlarm = 7,
    /// Pulses of other devices, by pulse.
    Interference = 8,
    /// Drops of rain, by pulse.
    Rain = 9,
    /// Flakes of snow, by pulse.
    Snow = 10,
    /// The counts of an echo, by pulse and path.
    Counts = 11,
    /// The noise of a disparity, by pixel.
    Disparity = 20,
    /// The noise of a stereo camera's own image, by pixel.
    LeftImage = 21,
    /// The noise of the second imager's image, by pixel.
    RightImage = 22,
    /// The electrons of a time-of-flight pixel, by pixel and frequency.
    Electrons = 23,
    /// The directions of indirect light, by pixel and sub-ray.
    Indirect = 24,
}

/// The frame number of streams that are the same in every frame.
pub(super) const EVERY_FRAME: u64 = u64::MAX;
