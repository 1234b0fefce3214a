//! The pattern that the projector of an active stereo camera throws: dots at random places, or an image.
//!
//! Places are the tangents of a ray's direction in the projector's frame: x is the distance to the right over the distance along the
//! axis, y the distance up over it. Irradiance is relative to that of a dot's centre or of a white pixel, across the ray; the fall with
//! the square of the range and the angle of incidence are the caller's.

use libm::{erf, exp, floor};

/// The distance, in radii of 1/e², beyond which a dot has no light: there its irradiance is e⁻¹² = 6·10⁻⁶ of its centre's, and what is
/// left out is as large a share of the dot's energy.
const REACH: f64 = 2.449_489_742_783_178;

/// The pattern that a projector throws.
#[derive(Clone, Debug, PartialEq)]
pub enum Projected {
    /// Dots.
    Dots(Dots),
    /// An image.
    Image(ImagePattern),
}

impl Projected {
    /// The mean irradiance of the field.
    pub fn mean(&self) -> f64 {
        match self {
            Self::Dots(dots) => dots.mean(),
            Self::Image(image) => image.mean(),
        }
    }

    /// The mean irradiance of a rectangle between its lower and its upper corner, which differ in both coordinates.
    pub fn irradiance_over(&self, lower: [f64; 2], upper: [f64; 2]) -> f64 {
        match self {
            Self::Dots(dots) => dots.irradiance_over(lower, upper),
            Self::Image(image) => image.irradiance_over(lower, upper),
        }
    }
}

/// The rectangle that a projector lights, about its axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// The tangent of half of the horizontal field of view, more than 0.
    pub half_width: f64,
    /// The tangent of half of the vertical field of view, more than 0.
    pub half_height: f64,
}

impl Field {
    /// The area in tangent space.
    pub fn area(&self) -> f64 {
        4.0 * self.half_width * self.half_height
    }
}

/// Gaussian dots, as a laser behind a diffractive element makes them: each has the irradiance exp(−2r²/w²) at the distance r from its
/// centre (A. E. Siegman, "Lasers", 1986, §17.1). Dots that overlap add up.
#[derive(Clone, Debug, PartialEq)]
pub struct Dots {
    field: Field,
    /// w, the radius at which the irradiance has fallen to 1/e².
    radius: f64,
    /// The centres, bucket by bucket.
    centres: Vec<[f64; 2]>,
    /// Where each bucket begins in `centres`, and where the last one ends. Buckets are the cells of a grid, row by row.
    starts: Vec<u32>,
    buckets: [usize; 2],
}

impl Dots {
    /// Dots at these centres, of which those outside the field are left out. `radius` is w in tangents, more than 0.
    pub fn new(field: Field, radius: f64, centres: &[[f64; 2]]) -> Self {
        let inside = |[x, y]: &&[f64; 2]| x.abs() <= field.half_width && y.abs() <= field.half_height;
        let mut centres: Vec<[f64; 2]> = centres.iter().filter(inside).copied().collect();
        // A bucket is about as large as a dot, and there are not many more buckets than dots.
        let edge = (REACH * radius).max((field.area() / (centres.len() + 1) as f64).sqrt());
        let count = |half: f64| (2.0 * half / edge).clamp(1.0, (centres.len() + 1) as f64) as usize;
        let buckets = [count(field.half_width), count(field.half_height)];
        let mut dots = Self { field, radius, centres: vec![], starts: vec![], buckets };
        let bucket = |&[x, y]: &[f64; 2]| dots.row(y) * buckets[0] + dots.column(x);
        centres.sort_by_key(bucket);
        let starts = (0..=buckets[0] * buckets[1])
            .map(|number| centres.partition_point(|centre| bucket(centre) < number) as u32)
            .collect();
        (dots.centres, dots.starts) = (centres, starts);
        dots
    }

    /// About `count` dots at random places that keep a distance: one in each cell of a grid of nearly square cells, at a random place
    /// in the middle of its cell. `spread`, 0 to 1, is the edge of that middle over the cell's. Each row of the grid is moved
    /// along by a random part of a cell, so that rows do not line up. `uniform` draws numbers that are uniform in [0, 1).
    ///
    /// The centres of two dots are at least 1 − `spread` of a cell's smaller edge apart.
    pub fn scattered(
        field: Field,
        radius: f64,
        count: usize,
        spread: f64,
        mut uniform: impl FnMut() -> f64,
    ) -> Self {
        let ratio = field.half_width / field.half_height;
        let whole = |cells: f64| cells.clamp(1.0, count.max(1) as f64).round() as usize;
        let columns = whole((count as f64 * ratio).sqrt());
        let rows = whole(count as f64 / columns as f64);
        let mut centres = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            let along = uniform();
            for column in 0..columns {
                let mut place = |cell: f64| cell + 0.5 * (1.0 - spread) + spread * uniform();
                let (x, y) = (place(column as f64) + along, place(row as f64));
                // What leaves the field on the right enters on the left.
                let x = x / columns as f64;
                let x = x - floor(x);
                let y = y / rows as f64;
                centres.push([(2.0 * x - 1.0) * field.half_width, (2.0 * y - 1.0) * field.half_height]);
            }
        }
        Self::new(field, radius, &centres)
    }

    /// The centres of the dots.
    pub fn centres(&self) -> &[[f64; 2]] {
        &self.centres
    }

    /// The mean irradiance of the field: the number of dots times πw²/2, the integral of one, over the field's area. Dots at the rim
    /// light what is outside of the field, too.
    pub fn mean(&self) -> f64 {
        self.centres.len() as f64 * self.energy() / self.field.area()
    }

    /// The irradiance at a place.
    pub fn irradiance(&self, [x, y]: [f64; 2]) -> f64 {
        let across = self.radius * self.radius;
        let light = |&[at_x, at_y]: &[f64; 2]| {
            let square = (x - at_x) * (x - at_x) + (y - at_y) * (y - at_y);
            if square <= REACH * REACH * across { exp(-2.0 * square / across) } else { 0.0 }
        };
        self.near([x, y], [x, y]).map(light).sum()
    }

    /// The mean irradiance of a rectangle, such as what a pixel sees, between its lower and its upper corner, which differ in both
    /// coordinates. Dots are left out whose centres are farther from the rectangle than [`Dots::irradiance`] looks.
    pub fn irradiance_over(&self, lower: [f64; 2], upper: [f64; 2]) -> f64 {
        let to_unit = std::f64::consts::SQRT_2 / self.radius;
        let share = |axis: usize, centre: f64| {
            0.5 * (erf((upper[axis] - centre) * to_unit) - erf((lower[axis] - centre) * to_unit))
        };
        let light: f64 = self.near(lower, upper).map(|&[x, y]| share(0, x) * share(1, y)).sum();
        light * self.energy() / ((upper[0] - lower[0]) * (upper[1] - lower[1]))
    }

    /// The integral of a dot's irradiance: πw²/2.
    fn energy(&self) -> f64 {
        0.5 * std::f64::consts::PI * self.radius * self.radius
    }

    /// The dots that reach a rectangle, and others near it, in the order of their buckets.
    fn near(&self, lower: [f64; 2], upper: [f64; 2]) -> impl Iterator<Item = &[f64; 2]> {
        let reach = REACH * self.radius;
        let columns = self.column(lower[0] - reach)..=self.column(upper[0] + reach);
        let rows = self.row(lower[1] - reach)..=self.row(upper[1] + reach);
        // The dots of neighbouring buckets in a row lie side by side.
        let runs = rows.map(move |row| {
            let first = row * self.buckets[0];
            let (from, to) = (self.starts[first + columns.start()], self.starts[first + columns.end() + 1]);
            &self.centres[from as usize..to as usize]
        });
        let within = move |&&[x, y]: &&[f64; 2]| {
            (lower[0] - reach..=upper[0] + reach).contains(&x)
                && (lower[1] - reach..=upper[1] + reach).contains(&y)
        };
        runs.flatten().filter(within)
    }

    fn column(&self, x: f64) -> usize {
        cell(x, self.field.half_width, self.buckets[0])
    }

    fn row(&self, y: f64) -> usize {
        cell(y, self.field.half_height, self.buckets[1])
    }
}

/// The cell, of `count` from −half to half, that a coordinate lies in, or the nearest one.
fn cell(at: f64, half: f64, count: usize) -> usize {
    let cells = floor((at + half) / (2.0 * half) * count as f64);
    cells.clamp(0.0, (count - 1) as f64) as usize
}

/// A pattern that is an image: each pixel is a rectangle of one irradiance, 0 for black and 1 for white. Nothing is lit outside of it.
#[derive(Clone, Debug, PartialEq)]
pub struct ImagePattern {
    field: Field,
    width: usize,
    height: usize,
    pixels: Vec<u8>,
    /// The sums of the pixels above and to the left of each corner, row by row: (width + 1)·(height + 1) whole numbers.
    sums: Vec<u64>,
}

impl ImagePattern {
    /// An image's grey values, linear in irradiance, row by row from the top, that fills the field. `None` if their number is not
    /// width·height, or is 0.
    pub fn new(field: Field, width: usize, height: usize, pixels: Vec<u8>) -> Option<Self> {
        if pixels.is_empty() || width.checked_mul(height) != Some(pixels.len()) {
            return None;
        }
        let mut sums = vec![0; width + 1];
        for row in pixels.chunks_exact(width) {
            let above = sums.len() - width - 1;
            let mut along = 0;
            sums.push(0);
            for (column, pixel) in row.iter().enumerate() {
                along += u64::from(*pixel);
                sums.push(sums[above + column + 1] + along);
            }
        }
        Some(Self { field, width, height, pixels, sums })
    }

    /// The mean irradiance of the field.
    pub fn mean(&self) -> f64 {
        let all = self.sums.last().copied().unwrap_or(0);
        all as f64 / (255.0 * self.width as f64 * self.height as f64)
    }

    /// The irradiance at a place.
    pub fn irradiance(&self, [x, y]: [f64; 2]) -> f64 {
        if x.abs() > self.field.half_width || y.abs() > self.field.half_height {
            return 0.0;
        }
        let column = cell(x, self.field.half_width, self.width);
        let row = cell(-y, self.field.half_height, self.height);
        f64::from(self.pixels[row * self.width + column]) / 255.0
    }

    /// The mean irradiance of a rectangle, such as what a pixel sees, between its lower and its upper corner, which differ in both
    /// coordinates. It is exact but for rounding: about 10⁻¹⁶ of the image's sum over the number of pixels that the rectangle covers.
    pub fn irradiance_over(&self, lower: [f64; 2], upper: [f64; 2]) -> f64 {
        let Field { half_width, half_height } = self.field;
        let column = |x: f64| (x + half_width) / (2.0 * half_width) * self.width as f64;
        let row = |y: f64| (half_height - y) / (2.0 * half_height) * self.height as f64;
        let (left, right) = (column(lower[0]), column(upper[0]));
        let (top, bottom) = (row(upper[1]), row(lower[1]));
        let light =
            self.sum(right, bottom) - self.sum(left, bottom) - self.sum(right, top) + self.sum(left, top);
        light / (255.0 * (right - left) * (bottom - top))
    }

    /// The integral of the image above and to the left of a point in it, in pixels. It is bilinear between the corners of a pixel.
    fn sum(&self, column: f64, row: f64) -> f64 {
        let split = |at: f64, count: usize| {
            let at = at.clamp(0.0, count as f64);
            let whole = floor(at).min((count - 1) as f64);
            (whole as usize, at - whole)
        };
        let ((column, right), (row, down)) = (split(column, self.width), split(row, self.height));
        let corner = |i: usize, j: usize| self.sums[(row + j) * (self.width + 1) + column + i] as f64;
        let along = |j: usize| corner(0, j) + right * (corner(1, j) - corner(0, j));
        along(0) + down * (along(1) - along(0))
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::close;
    use super::*;
    use crate::rng::Rng;

    const FIELD: Field = Field { half_width: 0.9, half_height: 0.5 };

    fn dots(radius: f64, spread: f64) -> Dots {
        let mut rng = Rng::new(1);
        Dots::scattered(FIELD, radius, 4000, spread, || rng.unit())
    }

    #[test]
    fn what_is_near_is_all_that_lights() {
        let mut rng = Rng::new(2);
        for radius in [0.001, 0.007, 0.1] {
            let dots = dots(radius, 0.8);
            for _ in 0..500 {
                // Places reach beyond the field, where dots at the rim still shine.
                let place = [1.1 * FIELD.half_width * rng.signed(), 1.1 * FIELD.half_height * rng.signed()];
                let light = |centre: &[f64; 2]| {
                    let square: f64 =
                        (0..2).map(|axis| (place[axis] - centre[axis]) * (place[axis] - centre[axis])).sum();
                    if square <= 6.0 * radius * radius { exp(-2.0 * square / (radius * radius)) } else { 0.0 }
                };
                // The sums differ in their order: of at most 4000 numbers up to 1, by 4000 roundings of their sum.
                let all: f64 = dots.centres().iter().map(light).sum();
                close(dots.irradiance(place), all, 4000.0 * f64::EPSILON);
            }
        }
    }

    #[test]
    fn the_mean_is_the_density_times_a_dots_integral() {
        let dots = dots(0.007, 0.8);
        let inner = [0.8 * FIELD.half_width, 0.8 * FIELD.half_height];
        let steps = 400;
        let step = |axis: usize, i: usize| inner[axis] * (2.0 * (i as f64 + 0.5) / steps as f64 - 1.0);
        let sum: f64 =
            (0..steps * steps).map(|i| dots.irradiance([step(0, i % steps), step(1, i / steps)])).sum();
        // The inner part has 2560 cells. The dots of the 204 cells on its rim are in or out by chance, so their number has a standard
        // deviation below √204/2 = 7: 0.3 %. Five times that is allowed.
        close(sum / (steps * steps) as f64, dots.mean(), 0.015);
        // The whole field and a margin have all the light.
        let (lower, upper) = ([-0.95, -0.55], [0.95, 0.55]);
        let all = dots.irradiance_over(lower, upper) * 1.9 * 1.1;
        // Each of erf's shares is right to 10⁻¹⁵.
        close(all, dots.mean() * FIELD.area(), 1e-12);
        close(dots.centres().len() as f64, 4000.0, 0.02);
    }

    #[test]
    fn a_rectangle_has_the_mean_of_its_places() {
        let dots = dots(0.007, 0.8);
        let mut rng = Rng::new(3);
        for _ in 0..50 {
            let lower = [0.8 * rng.signed(), 0.4 * rng.signed()];
            let size = [0.001 + 0.01 * rng.unit(), 0.001 + 0.01 * rng.unit()];
            let upper = [lower[0] + size[0], lower[1] + size[1]];
            let steps = 200;
            let at = |axis: usize, i: usize| lower[axis] + size[axis] * (i as f64 + 0.5) / f64::from(steps);
            let places =
                (0..steps * steps).map(|i| [at(0, (i % steps) as usize), at(1, (i / steps) as usize)]);
            let mean = places.map(|place| dots.irradiance(place)).sum::<f64>() / f64::from(steps * steps);
            // What a dot has beyond its reach is 6·10⁻⁶ of its centre, and at most 16 dots are as near as that: 10⁻⁴. The midpoint
            // rule errs by size²/(24·steps²) of the second derivative 4/w² on each axis: 2·10⁻⁵.
            let error = (dots.irradiance_over(lower, upper) - mean).abs();
            assert!(error < 1.2e-4, "{error}");
        }
    }

    #[test]
    fn dots_keep_their_distance_and_repeat_nowhere() {
        let dots = dots(0.007, 0.6);
        // √(4000·1.8) = 84.9 columns make 85, and 4000/85 = 47.06 rows make 47.
        let smallest = (1.8_f64 / 85.0).min(1.0 / 47.0) * (1.0 - 0.6);
        let nearest = |a: usize| {
            let [x, y] = dots.centres()[a];
            let others = dots.centres().iter().enumerate().filter(|(b, _)| *b != a);
            others.map(|(_, [u, v])| (u - x) * (u - x) + (v - y) * (v - y)).fold(f64::MAX, f64::min).sqrt()
        };
        let least = (0..dots.centres().len()).map(nearest).fold(f64::MAX, f64::min);
        assert!(least >= smallest * (1.0 - 1e-12), "{least} is less than {smallest}");

        // The pattern moved along by any distance from 3 radii to half of the field is no more like itself than by chance: the
        // coefficient of correlation over a strip of 38 by 9 cells stays below a half. A lattice reaches 1 at each of its cells.
        let strip: Vec<[f64; 2]> = (0..200 * 40).map(|i| [f64::from(i % 200), f64::from(i / 200)]).collect();
        let light = |moved: f64| -> Vec<f64> {
            strip.iter().map(|[i, j]| dots.irradiance([-0.85 + 0.004 * i + moved, 0.005 * j - 0.1])).collect()
        };
        let centred = |mut values: Vec<f64>| {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            values.iter_mut().for_each(|value| *value -= mean);
            let norm = values.iter().map(|value| value * value).sum::<f64>().sqrt();
            values.iter_mut().for_each(|value| *value /= norm);
            values
        };
        let still = centred(light(0.0));
        let alike = |moved: f64| -> f64 { still.iter().zip(centred(light(moved))).map(|(a, b)| a * b).sum() };
        let most = (0..250).map(|i| alike(0.021 + 0.0035 * f64::from(i))).fold(0.0, f64::max);
        assert!(most < 0.5, "{most}");
    }

    #[test]
    fn few_dots_and_odd_fields_are_no_trouble() {
        let narrow = Field { half_width: 1e-3, half_height: 2.0 };
        for field in [FIELD, narrow] {
            for count in [0, 1, 2, 7] {
                for radius in [1e-9, 1e-3, 100.0] {
                    let mut rng = Rng::new(4);
                    let dots = Dots::scattered(field, radius, count, 1.0, || rng.unit());
                    for centre in dots.centres() {
                        assert!(dots.irradiance(*centre) >= 1.0);
                    }
                    assert!(dots.irradiance([1e9, -1e9]) == 0.0);
                }
            }
        }
        let outside = Dots::new(FIELD, 0.01, &[[0.91, 0.0], [0.0, 0.2], [f64::NAN, 0.0]]);
        assert_eq!(outside.centres(), [[0.0, 0.2]]);
    }

    #[test]
    fn an_image_lights_what_its_pixels_cover() {
        let (width, height) = (13, 7);
        let mut rng = Rng::new(5);
        let pixels: Vec<u8> = (0..width * height).map(|_| rng.u32() as u8).collect();
        let image = ImagePattern::new(FIELD, width, height, pixels.clone()).unwrap();
        let size = [1.8 / width as f64, 1.0 / height as f64];
        for (at, pixel) in pixels.iter().enumerate() {
            let corner = [-0.9 + size[0] * (at % width) as f64, 0.5 - size[1] * ((at / width) as f64 + 1.0)];
            let value = f64::from(*pixel) / 255.0;
            assert_eq!(image.irradiance([corner[0] + 0.4 * size[0], corner[1] + 0.7 * size[1]]), value);
            // Sums are below 91·255, so they have an error of 91·2⁻⁵² of a pixel's, of which the rectangle is at least 0.01.
            let lower = [corner[0] + 0.3 * size[0], corner[1] + 0.2 * size[1]];
            let upper = [corner[0] + 0.4 * size[0], corner[1] + 0.9 * size[1]];
            assert!((image.irradiance_over(lower, upper) - value).abs() < 1e-11);
        }
        let mean = pixels.iter().map(|pixel| f64::from(*pixel)).sum::<f64>() / (255.0 * 91.0);
        close(image.irradiance_over([-0.9, -0.5], [0.9, 0.5]), mean, 1e-14);
        close(image.irradiance_over([-1.8, -1.0], [1.8, 1.0]), mean / 4.0, 1e-14);
        assert_eq!(image.irradiance([0.901, 0.0]), 0.0);
        assert_eq!(ImagePattern::new(FIELD, 2, 2, vec![0; 5]), None);
    }
}
