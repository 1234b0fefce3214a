//! The result of one turn or one image: the returns of each pixel, column by column of memory.

use std::ops::Range;

use super::Waveforms;
use crate::physics::echo::Part;
use crate::sensor::Sensor;

/// Declares the causes once, in the order of their numbers.
macro_rules! causes {
    ($($(#[$doc:meta])* $variant:ident $name:literal,)*) => {
        /// The reason why a pixel has no return, or the origin of a return.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
        #[non_exhaustive]
        #[repr(u8)]
        pub enum Cause {
            $($(#[$doc])* $variant,)*
        }

        impl Cause {
            /// Every cause, by its number in files.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// The name in files, such as `too_near`.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)*
                }
            }
        }
    };
}

causes! {
    /// The pixel sent no pulse: the lens's model has no ray for it, or a prism reflects the beam inward.
    #[default]
    NoPulse "no_pulse",
    /// The pulse came back from a surface.
    Surface "surface",
    /// The pulse met no surface at any distance.
    Nothing "nothing",
    /// A surface nearer than the sensor's least range blocks the beam.
    TooNear "too_near",
    /// The first surface on the beam's way is farther than the sensor's largest range.
    OutOfRange "out_of_range",
    /// The light of several surfaces makes one return, which may lie between them.
    Mixed "mixed",
    /// The return is a surface's image in a mirror or in a film of water. It lies behind the mirror.
    Mirror "mirror",
    /// The light of the return went through glass, or was reflected by it.
    Glass "glass",
    /// A surface sends too little light back to be detected.
    BelowThreshold "below_threshold",
    /// A surface would be detected in clear air, but the air takes too much of its light.
    Absorbed "absorbed",
    /// A surface sends enough light back on average, but noise hides it this time.
    Dropped "dropped",
    /// Noise alone passes the threshold.
    FalseAlarm "false_alarm",
    /// The receiver takes the pulse of another device for its own.
    Interference "interference",
    /// The return is from a drop of rain.
    Rain "rain",
    /// The return is from a flake of snow.
    Snow "snow",
    /// The return is from fog.
    Fog "fog",
    /// The return is from dust.
    Dust "dust",
    /// The return is the halo of a bright return of another beam.
    Blooming "blooming",
    /// The return is the light of another channel that fires at the same time.
    Crosstalk "crosstalk",
    /// A surface that the second viewpoint of a depth camera does not see, or does not light.
    Occluded "occluded",
    /// The window of a stereo camera has too little texture to be matched.
    NoTexture "no_texture",
    /// Several depths fit what a depth camera measures, or its neighbours contradict it.
    Ambiguous "ambiguous",
    /// The light of a depth camera fills its pixel.
    Saturated "saturated",
}

impl Cause {
    /// The causes that frames of ideal sensors have.
    pub const IDEAL: &[Self] = Self::ALL.split_at(5).0;

    /// The number in files.
    pub fn number(self) -> u32 {
        self as u32
    }

    /// The cause with this number in files.
    pub fn numbered(number: u32) -> Option<Self> {
        Self::ALL.get(number as usize).copied()
    }
}

/// The index of the object and of the triangle of a return that no surface makes: from a particle, or from noise. Files have the id
/// 0 for it.
pub const NO_OBJECT: u32 = u32::MAX;

/// The measurement of a return by a sensor that is not ideal, beside the columns of [`Returns`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Echo {
    /// The origin of the return.
    pub cause: Cause,
    /// The signal-to-noise ratio of the peak, without this pulse's own noise. It is 0 of a return that no light made.
    pub snr: f32,
    /// The standard deviation of the echo in range, in metres: that of the pulse, widened by the spread of the ranges.
    pub width_m: f32,
    /// The sunlight that the surface scatters to the sensor, relative to a white plane that faces a sun of 100 klx.
    pub ambient: f32,
    /// The error budget of the range.
    pub terms: Terms,
}

/// The error budget of a range: the exact range, and each effect's part in the difference to the range that is reported. All in
/// metres, and they add up to the reported range.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Terms {
    /// The exact range of the surface on the beam's axis, if it is part of the return, else of the return's brightest part.
    pub ideal_m: f64,
    /// The error of the pulse's direction.
    pub angle_m: f64,
    /// The beam's width: the peak of all the light together. Of a depth camera, what other depths in the pixel or its window and
    /// indirect light add, and all that matching two images does.
    pub footprint_m: f64,
    /// What is left of the walk of a fixed threshold; of a receiver that counts photons, the shift by pile-up.
    pub walk_m: f64,
    /// The noise of this pulse.
    pub noise_m: f64,
    /// The bias of the beam.
    pub bias_m: f64,
    /// The rounding to the unit of ranges, or of a stereo camera's disparities.
    pub rounding_m: f64,
}

impl Terms {
    /// The names of the terms in files, without the ideal range.
    pub const NAMES: [&str; 6] = ["angle", "footprint", "walk", "noise", "bias", "rounding"];

    /// The terms in the order of [`Terms::NAMES`].
    pub fn errors_m(&self) -> [f64; 6] {
        [self.angle_m, self.footprint_m, self.walk_m, self.noise_m, self.bias_m, self.rounding_m]
    }

    /// The range before it is rounded to the sensor's unit.
    pub fn unrounded_m(&self) -> f64 {
        self.ideal_m + self.angle_m + self.footprint_m + self.walk_m + self.noise_m + self.bias_m
    }
}

/// Declares the images of [`Images`] once.
macro_rules! images {
    ($($(#[$doc:meta])* $name:ident,)*) => {
        /// What a depth camera makes beside its returns: a value for each pixel, whether it has a return or not, row by row. An image
        /// that the camera does not make is empty.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Images {
            $($(#[$doc])* pub $name: Vec<f32>,)*
        }

        impl Images {
            /// The number of images that the largest depth camera makes.
            const COUNT: usize = [$(stringify!($name)),*].len();
        }
    };
}

images! {
    /// What the camera's own imager sees: grey values, 0 to 255.
    ir_left,
    /// What the second imager sees.
    ir_right,
    /// The disparity in pixels, before ranges that are too near or too far are left out; 0 where none is found.
    disparity,
    /// How much better the best match is than the second best, 0 to 1.
    confidence,
    /// The amplitude of a tap by the modulated light, in electrons: the mean of the frequencies.
    amplitude,
    /// The light that is not modulated, in electrons of all taps: the mean of the frequencies.
    ambient,
    /// The phase of the first frequency in radians, 0 to 2π.
    phase_1,
    /// The phase of the second frequency.
    phase_2,
    /// The phase of the third frequency.
    phase_3,
}

/// Declares the columns of [`Returns`] once. Each column is a `Vec` there, and a field of one [`Return`].
macro_rules! columns {
    ($($(#[$doc:meta])* $name:ident: $kind:ty,)*) => {
        /// One return, with one value of each column.
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        pub struct Return {
            $($(#[$doc])* pub $name: $kind,)*
        }

        /// Returns, column by column. All columns have the same length.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Returns {
            $($(#[$doc])* pub $name: Vec<$kind>,)*
        }

        /// A writable run of slots of each column.
        pub(super) struct ReturnsMut<'f> {
            $($name: &'f mut [$kind],)*
        }

        impl Returns {
            /// Gives each column so many slots, whose values are unspecified. Memory that is there is used again, and new
            /// memory is not touched yet.
            fn set_slots(&mut self, slots: usize) {
                $(if self.$name.capacity() < slots {
                    self.$name = vec![Default::default(); slots];
                } else {
                    self.$name.resize(slots, Default::default());
                })*
            }

            /// The number of slots.
            fn slots(&self) -> usize {
                let lengths = [$(self.$name.len(),)*];
                assert!(lengths.iter().all(|length| *length == lengths[0]), "columns of unequal length");
                lengths[0]
            }

            /// The return in a slot.
            #[inline]
            pub fn get(&self, slot: usize) -> Return {
                Return { $($name: self.$name[slot],)* }
            }

            /// Appends a return.
            fn push(&mut self, one: Return) {
                $(self.$name.push(one.$name);)*
            }

            /// A writable view of all slots, which can be split among threads.
            fn as_mut(&mut self) -> ReturnsMut<'_> {
                ReturnsMut { $($name: &mut self.$name,)* }
            }
        }

        impl<'f> ReturnsMut<'f> {
            /// Splits off the first `slots` slots.
            pub fn take(&mut self, slots: usize) -> ReturnsMut<'f> {
                ReturnsMut { $($name: self.$name.split_off_mut(..slots).unwrap_or_default(),)* }
            }

            /// Writes a return to a slot.
            #[inline(always)]
            pub fn set(&mut self, slot: usize, one: Return) {
                $(self.$name[slot] = one.$name;)*
            }
        }

        /// The memory of one return, in bytes.
        pub(super) const BYTES_A_RETURN: usize = 0 $(+ size_of::<$kind>())*;
    };
}

columns! {
    /// The range in metres along the ray from the pulse's origin.
    range_m: f64,
    /// The intensity ρ·cos θ: reflectivity times the cosine of the angle of incidence, 0 to 1.
    intensity: f32,
    /// The unit geometric normal of the surface, towards the sensor, in the sensor's body frame at the pulse's own time.
    normal: [f32; 3],
    /// The index into [`Geometry::objects`](crate::scene::Geometry::objects).
    instance: u32,
    /// The semantic label.
    label: u32,
    /// The triangle's id.
    triangle: u32,
}

/// The result of one turn or one image: `rows × columns` pixels, row by row, each with any number of returns.
///
/// The returns of a pixel lie in neighbouring slots of the columns of [`Returns`], in the order in which the sensor reports
/// them. [`Frame::slots`] gives the slots of a pixel. The number of a return is its position among them, from 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    rows: usize,
    columns: usize,
    layout: Layout,
    returns: Returns,
    causes: Vec<Cause>,
    /// Whether the sensor is not ideal.
    is_measured: bool,
    /// Of each slot, if the sensor is not ideal.
    echoes: Vec<Echo>,
    images: Images,
    /// Of each pixel, if they were asked for before the frame was cast and the sensor is not ideal.
    waveforms: Option<Waveforms>,
}

/// The rule that assigns slots to pixels.
#[derive(Clone, Debug, Default, PartialEq)]
enum Layout {
    /// A pixel has the slot of its own number. If its cause is [`Cause::Surface`] the slot holds its return, if it is
    /// [`Cause::TooNear`] the surface that blocks it. The slots of the other pixels are zero.
    #[default]
    OneEach,
    /// Pixel i has the slots from entry i to entry i + 1 of this list, which has one entry more than there are pixels. A
    /// pixel whose cause is [`Cause::TooNear`] has at most one slot, which holds the surface that blocks it.
    From(Vec<usize>),
}

impl Frame {
    /// The memory of a pixel in a frame of at most one return a pixel, in bytes.
    pub const BYTES_A_PIXEL: usize = BYTES_A_RETURN + size_of::<Cause>();

    /// The memory of a pixel in a frame of a sensor, in bytes. A frame of a sensor that is not ideal is put together of parts, which
    /// take as much as the frame itself.
    pub fn bytes_a_pixel(sensor: &Sensor) -> usize {
        if sensor.measurement.is_ideal() {
            return Self::BYTES_A_PIXEL;
        }
        let of_returns = sensor.most_returns() * (BYTES_A_RETURN + size_of::<Echo>());
        let of_images = sensor.measurement.depth.as_ref().map_or(0, |_| Images::COUNT * size_of::<f32>());
        2 * (of_returns + size_of::<Cause>() + size_of::<usize>()) + of_images
    }

    /// Makes this a frame of so many pixels, with room for one return each. The values of all slots and causes are
    /// unspecified until they are written.
    pub(super) fn set_size(&mut self, rows: usize, columns: usize) {
        (self.rows, self.columns, self.layout) = (rows, columns, Layout::OneEach);
        self.returns.set_slots(rows * columns);
        self.causes.resize(rows * columns, Cause::NoPulse);
        self.is_measured = false;
        self.echoes.clear();
        self.images = Images::default();
    }

    /// Asks for the waveforms of the next frame that is [cast into](super::scan_into) this memory, or for none. A frame has none unless
    /// it is asked for them, because they take several times the memory of its returns.
    pub fn keep_waveforms(&mut self, keeps: bool) {
        match keeps {
            true => _ = self.waveforms.get_or_insert_default(),
            false => self.waveforms = None,
        }
    }

    /// Whether waveforms are asked for.
    pub(super) fn keeps_waveforms(&self) -> bool {
        self.waveforms.is_some()
    }

    /// The waveforms of all pixels. `None` of an ideal sensor, and if they were [not asked for](Self::keep_waveforms).
    pub fn waveforms(&self) -> Option<&Waveforms> {
        self.waveforms.as_ref().filter(|_| self.is_measured)
    }

    /// Begins the waveforms of a frame, if they are asked for.
    pub(super) fn begin_waveforms(&mut self, sigma_m: f64, threshold: Option<f64>) {
        if let Some(waveforms) = &mut self.waveforms {
            waveforms.begin(sigma_m, threshold);
        }
    }

    /// Adds the waveform of the next pixel, if they are asked for.
    pub(super) fn add_waveform(&mut self, parts: &[Part]) {
        if let Some(waveforms) = &mut self.waveforms {
            waveforms.add(parts);
        }
    }

    /// Makes this an empty frame of a sensor that is not ideal, to which pixels are added row by row.
    pub(super) fn begin_measured(&mut self, rows: usize, columns: usize) {
        self.set_size(rows, columns);
        self.returns.set_slots(0);
        self.causes.clear();
        self.layout = Layout::From(vec![0]);
        self.is_measured = true;
    }

    /// Adds the next pixel to a frame that was [begun](Self::begin_measured).
    pub(super) fn add_measured(&mut self, cause: Cause, returns: &[(Return, Echo)]) {
        for (one, echo) in returns {
            self.returns.push(*one);
            self.echoes.push(*echo);
        }
        self.causes.push(cause);
        if let Layout::From(first) = &mut self.layout {
            first.push(self.echoes.len());
        }
    }

    /// Gives the frame the images of a depth camera.
    pub(super) fn set_images(&mut self, images: Images) {
        self.images = images;
    }

    /// The images that a depth camera makes beside the returns.
    pub fn images(&self) -> &Images {
        &self.images
    }

    /// A frame from pixels, row by row. Each pixel has its cause and its returns. A pixel whose cause is [`Cause::TooNear`] has
    /// no returns; it may have instead the surface that blocks it.
    ///
    /// # Panics
    /// If the number of pixels is not `rows × columns`.
    pub fn from_pixels<'r>(
        rows: usize,
        columns: usize,
        pixels: impl IntoIterator<Item = (Cause, &'r [Return])>,
    ) -> Self {
        let (mut returns, mut causes, mut first) = (Returns::default(), Vec::new(), vec![0]);
        for (cause, of_pixel) in pixels {
            causes.push(cause);
            of_pixel.iter().for_each(|one| returns.push(*one));
            first.push(returns.slots());
        }
        assert_eq!(causes.len(), rows * columns, "a frame has rows × columns pixels");
        Self { rows, columns, layout: Layout::From(first), returns, causes, ..Self::default() }
    }

    /// A frame as an ideal sensor's is cast: each pixel has a slot of its own, which is empty unless a surface is in it.
    #[cfg(test)]
    pub(crate) fn of_own_slots(rows: usize, columns: usize, pixels: &[(Cause, Return)]) -> Self {
        let mut frame = Self::default();
        frame.set_size(rows, columns);
        let (mut returns, causes) = frame.parts();
        for (slot, (cause, one)) in pixels.iter().enumerate() {
            causes[slot] = *cause;
            let is_empty = !matches!(cause, Cause::Surface | Cause::TooNear);
            returns.set(slot, if is_empty { Return::default() } else { *one });
        }
        frame
    }

    /// The frame of a sensor that is not ideal, with the echo of each slot.
    ///
    /// # Panics
    /// If there is not one echo for each slot.
    #[must_use]
    pub fn with_echoes(self, echoes: Vec<Echo>) -> Self {
        assert_eq!(echoes.len(), self.returns.slots(), "a slot has an echo");
        Self { is_measured: true, echoes, ..self }
    }

    /// Rows of the range image.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Columns of the range image.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// The number of pixels, with or without returns.
    pub fn pixels(&self) -> usize {
        self.causes.len()
    }

    /// The columns of all returns, by slot. A slot that is not among the [`Frame::slots`] of any pixel is zero, or holds a
    /// surface that blocks a beam.
    pub fn returns(&self) -> &Returns {
        &self.returns
    }

    /// The slots of a pixel's returns, by the pixel's number.
    #[inline(always)]
    pub fn slots(&self, pixel: usize) -> Range<usize> {
        match &self.layout {
            Layout::OneEach => pixel..pixel + usize::from(self.causes[pixel] == Cause::Surface),
            Layout::From(first) if self.causes[pixel] == Cause::TooNear => first[pixel]..first[pixel],
            Layout::From(first) => first[pixel]..first[pixel + 1],
        }
    }

    /// The causes of all pixels, if a pixel whose cause is [`Cause::Surface`] has one return, in the slot of the pixel's own
    /// number, and every other pixel has none. Loops over such a frame need not look for slots.
    #[inline]
    pub fn causes_of_own_slots(&self) -> Option<&[Cause]> {
        match self.layout {
            Layout::OneEach => Some(&self.causes),
            Layout::From(_) => None,
        }
    }

    /// Calls `each` with the slot of each return, row by row.
    #[inline]
    pub fn each_slot(&self, mut each: impl FnMut(usize)) {
        match &self.layout {
            Layout::OneEach => {
                for (slot, cause) in self.causes.iter().enumerate() {
                    if *cause == Cause::Surface {
                        each(slot);
                    }
                }
            }
            Layout::From(_) => (0..self.pixels()).for_each(|pixel| self.slots(pixel).for_each(&mut each)),
        }
    }

    /// The surface that blocks a pixel's beam nearer than the sensor's least range, in the form of the return that it would
    /// have given.
    pub fn blocker(&self, pixel: usize) -> Option<Return> {
        if self.causes[pixel] != Cause::TooNear {
            return None;
        }
        match &self.layout {
            Layout::OneEach => Some(self.returns.get(pixel)),
            Layout::From(first) => (first[pixel]..first[pixel + 1]).next().map(|slot| self.returns.get(slot)),
        }
    }

    /// The slot of a pixel's return number `number`, if the pixel has that many returns.
    #[inline]
    pub fn slot(&self, pixel: usize, number: usize) -> Option<usize> {
        let slots = self.slots(pixel);
        (number < slots.len()).then_some(slots.start + number)
    }

    /// The largest number of returns of any pixel.
    pub fn most_returns(&self) -> usize {
        match &self.layout {
            Layout::OneEach => usize::from(self.causes.contains(&Cause::Surface)),
            Layout::From(_) => (0..self.pixels()).map(|pixel| self.slots(pixel).len()).max().unwrap_or(0),
        }
    }

    /// The number of pixels that have returns.
    pub fn hits(&self) -> usize {
        match &self.layout {
            Layout::OneEach => self.pixels_of(Cause::Surface),
            Layout::From(_) => (0..self.pixels()).filter(|&pixel| !self.slots(pixel).is_empty()).count(),
        }
    }

    /// The first return of a pixel of the range image.
    pub fn get(&self, row: usize, column: usize) -> Option<Return> {
        let slot = self.slot(row * self.columns + column, 0)?;
        Some(self.returns.get(slot))
    }

    /// The first return of each pixel, row by row.
    pub fn first_returns(&self) -> impl Iterator<Item = Option<Return>> {
        (0..self.pixels()).map(|pixel| self.slot(pixel, 0).map(|slot| self.returns.get(slot)))
    }

    /// Every return with the number of its pixel, row by row.
    pub fn iter(&self) -> impl Iterator<Item = (usize, Return)> {
        (0..self.pixels())
            .flat_map(move |pixel| self.slots(pixel).map(move |slot| (pixel, self.returns.get(slot))))
    }

    /// The number of returns.
    pub fn return_count(&self) -> usize {
        match &self.layout {
            Layout::OneEach => self.pixels_of(Cause::Surface),
            Layout::From(_) => (0..self.pixels()).map(|pixel| self.slots(pixel).len()).sum(),
        }
    }

    /// The number of pixels with a cause.
    pub fn pixels_of(&self, cause: Cause) -> usize {
        self.causes.iter().filter(|of_pixel| **of_pixel == cause).count()
    }

    /// The cause of each pixel, row by row.
    pub fn causes(&self) -> &[Cause] {
        &self.causes
    }

    /// What is known of the return in a slot beside its columns. `None` if the sensor is ideal.
    pub fn echo(&self, slot: usize) -> Option<&Echo> {
        self.echoes.get(slot)
    }

    /// Whether the sensor is not ideal, so that each slot has an [`Echo`].
    pub fn is_measured(&self) -> bool {
        self.is_measured
    }

    /// The cause of a pixel, or of its return number `number`. `None` if the pixel lacks that return, and `number` is not 0.
    pub fn cause(&self, pixel: usize, number: usize) -> Option<Cause> {
        match self.slot(pixel, number) {
            Some(slot) if self.is_measured => self.echoes.get(slot).map(|echo| echo.cause),
            None if self.is_measured && number > 0 => None,
            _ => Some(self.causes[pixel]),
        }
    }

    /// The number of pixels that sent no pulse.
    pub fn blind_pixels(&self) -> usize {
        self.pixels_of(Cause::NoPulse)
    }

    /// The slots and causes of all pixels of a frame of one return each, which can be split among threads.
    pub(super) fn parts(&mut self) -> (ReturnsMut<'_>, &mut [Cause]) {
        (self.returns.as_mut(), &mut self.causes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(range_m: f64) -> Return {
        Return { range_m, normal: [0.0, 0.0, 1.0], triangle: range_m as u32, ..Return::default() }
    }

    #[test]
    fn a_pixel_has_any_number_of_returns() {
        let pixels: [(Cause, &[Return]); 6] = [
            (Cause::Surface, &[at(1.0)]),
            (Cause::NoPulse, &[]),
            (Cause::Surface, &[at(2.0), at(3.0), at(4.0)]),
            (Cause::Nothing, &[]),
            (Cause::Nothing, &[]),
            (Cause::Surface, &[at(5.0)]),
        ];
        let frame = Frame::from_pixels(2, 3, pixels);
        assert_eq!((frame.rows(), frame.columns(), frame.pixels(), frame.return_count()), (2, 3, 6, 5));
        assert_eq!((frame.slots(2), frame.slots(3), frame.slots(5)), (1..4, 4..4, 4..5));
        assert_eq!((frame.slot(2, 2), frame.slot(2, 3), frame.slot(1, 0)), (Some(3), None, None));
        assert_eq!(frame.get(0, 2), Some(at(2.0)));
        assert_eq!(frame.get(1, 0), None);
        assert_eq!((frame.most_returns(), frame.blind_pixels()), (3, 1));
        let ranges: Vec<_> = frame.iter().map(|(pixel, one)| (pixel, one.range_m)).collect();
        assert_eq!(ranges, [(0, 1.0), (2, 2.0), (2, 3.0), (2, 4.0), (5, 5.0)]);
    }

    #[test]
    fn a_frame_of_one_return_each_takes_less_memory_than_a_row_of_structs() {
        // A row of `Option<Return>` would take 48 bytes a pixel: 40 for the fields and their padding, and 8 for the option.
        assert_eq!(Frame::BYTES_A_PIXEL, 8 + 4 + 12 + 3 * 4 + 1);
        let mut frame = Frame::default();
        frame.set_size(1, 3);
        assert_eq!((frame.return_count(), frame.blind_pixels(), frame.most_returns()), (0, 3, 0));
        let (mut returns, causes) = frame.parts();
        causes.copy_from_slice(&[Cause::Nothing, Cause::Surface, Cause::Surface]);
        let mut first = returns.take(2);
        first.set(1, at(7.0));
        returns.set(0, at(8.0));
        assert_eq!((frame.get(0, 0), frame.get(0, 1), frame.get(0, 2)), (None, Some(at(7.0)), Some(at(8.0))));
        assert_eq!(frame.iter().map(|(pixel, _)| pixel).collect::<Vec<_>>(), [1, 2]);
    }

    /// What blocks a beam in the dead zone is known, and is no return: in a frame as it is cast and in one made of pixels.
    #[test]
    fn what_blocks_a_beam_is_no_return() {
        let mut cast = Frame::default();
        cast.set_size(1, 3);
        let (mut returns, causes) = cast.parts();
        causes.copy_from_slice(&[Cause::TooNear, Cause::Surface, Cause::OutOfRange]);
        [at(0.25), at(7.0), Return::default()]
            .into_iter()
            .enumerate()
            .for_each(|(i, one)| returns.set(i, one));
        let pixels: [(Cause, &[Return]); 3] =
            [(Cause::TooNear, &[at(0.25)]), (Cause::Surface, &[at(7.0)]), (Cause::OutOfRange, &[])];
        for frame in [cast, Frame::from_pixels(1, 3, pixels)] {
            assert_eq!((frame.return_count(), frame.most_returns()), (1, 1));
            assert_eq!(frame.first_returns().collect::<Vec<_>>(), [None, Some(at(7.0)), None]);
            assert_eq!([0, 1, 2].map(|pixel| frame.blocker(pixel)), [Some(at(0.25)), None, None]);
            assert_eq!(frame.iter().map(|(pixel, _)| pixel).collect::<Vec<_>>(), [1]);
        }
    }

    #[test]
    fn causes_have_the_numbers_and_names_of_files() {
        for (number, cause) in (0..).zip(Cause::ALL) {
            assert_eq!((cause.number(), Cause::numbered(number)), (number, Some(*cause)));
        }
        assert_eq!(Cause::numbered(Cause::ALL.len() as u32), None);
        let ideal: Vec<_> = Cause::IDEAL.iter().map(|cause| cause.name()).collect();
        assert_eq!(ideal, ["no_pulse", "surface", "nothing", "too_near", "out_of_range"]);
    }

    #[test]
    #[should_panic(expected = "rows × columns")]
    fn a_frame_of_too_few_pixels_is_refused() {
        Frame::from_pixels(2, 2, [(Cause::Nothing, &[][..])]);
    }
}
