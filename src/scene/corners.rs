//! Texture coordinates and colours of the corners of triangles.
//!
//! They belong to triangles and not to vertices. So nothing has to be renumbered when triangles are left out, mirrored, shared
//! out to regions or placed many times, vertices that lie in one place stay one vertex for the tracer, and a mesh whose materials
//! need none of it has none of it.

/// The numbers that each corner of a triangle has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Layout {
    /// The pairs of texture coordinates.
    uv_sets: u8,
    has_color: bool,
}

impl Layout {
    /// The words of 32 bits that a corner takes: two for each pair of texture coordinates, and two for a colour.
    fn words(self) -> usize {
        2 * usize::from(self.uv_sets) + 2 * usize::from(self.has_color)
    }

    /// The words that a triangle takes.
    fn triangle_words(self) -> usize {
        3 * self.words()
    }
}

/// The texture coordinates and colours at the corners of a [`SourcePart`](super::SourcePart)'s triangles, corner by corner. The
/// default has none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Corners {
    layout: Layout,
    words: Vec<u32>,
}

impl Corners {
    /// The most sets of texture coordinates that a corner can have.
    pub const MOST_UV_SETS: usize = 8;

    /// No corners yet, each of which will have so many sets of texture coordinates, at most [`Corners::MOST_UV_SETS`], and
    /// perhaps a colour.
    pub fn new(uv_sets: usize, has_color: bool) -> Self {
        let uv_sets = uv_sets.min(Self::MOST_UV_SETS) as u8;
        Self { layout: Layout { uv_sets, has_color }, words: Vec::new() }
    }

    /// Bytes that a triangle with corners of this kind takes.
    pub fn triangle_bytes(&self) -> usize {
        self.layout.triangle_words() * size_of::<u32>()
    }

    /// Makes room for the corners of so many triangles.
    pub fn reserve(&mut self, triangles: usize) {
        self.words.reserve_exact(triangles * self.layout.triangle_words());
    }

    /// Adds a corner. A set that is missing is no number, where textures are white. The colour is linear, and is kept as fractions
    /// of 65535, in which fractions of 255 are exact.
    pub fn push(&mut self, uvs: &[[f32; 2]], color: [f32; 4]) {
        for set in 0..usize::from(self.layout.uv_sets) {
            let uv = uvs.get(set).copied().unwrap_or([f32::NAN; 2]);
            self.words.extend(uv.map(f32::to_bits));
        }
        if self.layout.has_color {
            // A cast of a number that is none gives 0.
            let [r, g, b, a] = color.map(|c| (c.clamp(0.0, 1.0) * 65535.0).round() as u32);
            self.words.extend([r | g << 16, b | a << 16]);
        }
    }

    /// The words of a triangle. A triangle whose corners were not all added has none.
    fn triangle(&self, index: usize) -> &[u32] {
        let words = self.layout.triangle_words();
        self.words.get(index * words..(index + 1) * words).unwrap_or(&[])
    }
}

/// The texture coordinates and colours at the corners of a [`Mesh`](super::Mesh)'s triangles, of those that have any.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MeshCorners {
    /// Runs of triangles with the same layout, in ascending order.
    runs: Vec<Run>,
    words: Vec<u32>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Run {
    layout: Layout,
    first_triangle: u32,
    /// One more than the run's last triangle.
    end: u32,
    /// The first of the run's words.
    start: usize,
}

/// The texture coordinates and the colour of a point of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CornerValues {
    /// Texture coordinates of sets that there are none of are no numbers.
    pub uvs: [[f64; 2]; Corners::MOST_UV_SETS],
    pub color: [f32; 4],
}

impl CornerValues {
    /// Of a triangle that has neither.
    const NONE: Self = Self { uvs: [[f64::NAN; 2]; Corners::MOST_UV_SETS], color: [1.0; 4] };
}

impl MeshCorners {
    /// Whether no triangle has any.
    pub fn is_empty(&self) -> bool {
        self.runs.is_empty()
    }

    /// The bytes that they take.
    pub fn bytes(&self) -> usize {
        self.words.len() * size_of::<u32>() + self.runs.len() * size_of::<Run>()
    }

    /// Forgets everything but its memory.
    pub(super) fn clear(&mut self) {
        self.runs.clear();
        self.words.clear();
    }

    /// Gives triangle `number`, which comes after all that were added, the corners of triangle `index` of a part. The second and
    /// the third change places if the triangle is `mirrored`.
    pub(super) fn push(&mut self, number: usize, part: &Corners, index: usize, mirrored: bool) {
        self.push_words(number, part.layout, part.triangle(index), mirrored);
    }

    /// Gives triangle `number`, which comes after all that were added, the corners of triangle `index` of another mesh.
    pub(super) fn push_of(&mut self, number: usize, other: &Self, index: usize) {
        if let Some(run) = other.run(index as u32) {
            self.push_words(number, run.layout, other.triangle(run, index as u32), false);
        }
    }

    fn push_words(&mut self, number: usize, layout: Layout, words: &[u32], mirrored: bool) {
        if words.is_empty() {
            return;
        }
        let number = number as u32;
        match self.runs.last_mut() {
            Some(run) if run.layout == layout && run.end == number => run.end += 1,
            _ => {
                let start = self.words.len();
                self.runs.push(Run { layout, first_triangle: number, end: number + 1, start });
            }
        }
        let corner = layout.words();
        let (first, others) = words.split_at(corner);
        let (second, third) = others.split_at(corner);
        self.words.extend_from_slice(first);
        let [second, third] = if mirrored { [third, second] } else { [second, third] };
        self.words.extend_from_slice(second);
        self.words.extend_from_slice(third);
    }

    fn run(&self, triangle: u32) -> Option<&Run> {
        let after = self.runs.partition_point(|run| run.first_triangle <= triangle);
        self.runs[..after].last().filter(|run| triangle < run.end)
    }

    fn triangle(&self, run: &Run, triangle: u32) -> &[u32] {
        let words = run.layout.triangle_words();
        let start = run.start + (triangle - run.first_triangle) as usize * words;
        &self.words[start..start + words]
    }

    /// Whether the corners of a triangle have colours.
    pub(super) fn has_colors(&self, triangle: u32) -> bool {
        self.run(triangle).is_some_and(|run| run.layout.has_color)
    }

    /// The values of the point of a triangle with the barycentric weights `u` of the second corner and `v` of the third.
    pub(super) fn at(&self, triangle: u32, u: f64, v: f64) -> CornerValues {
        let mut values = CornerValues::NONE;
        let Some(run) = self.run(triangle) else { return values };
        let words = self.triangle(run, triangle);
        let stride = run.layout.words();
        let weights = [1.0 - u - v, u, v];
        let mixed = |of_corner: &dyn Fn(&[u32]) -> f64| -> f64 {
            let corners = words.chunks_exact(stride).map(of_corner);
            corners.zip(weights).fold(0.0, |sum, (value, weight)| sum + value * weight)
        };
        for (set, uv) in values.uvs.iter_mut().take(run.layout.uv_sets.into()).enumerate() {
            let coordinate = |axis: usize| mixed(&|corner| f64::from(f32::from_bits(corner[2 * set + axis])));
            *uv = [coordinate(0), coordinate(1)];
        }
        if run.layout.has_color {
            let at = 2 * usize::from(run.layout.uv_sets);
            for (channel, value) in values.color.iter_mut().enumerate() {
                let of_corner = |corner: &[u32]| {
                    let integer = corner[at + channel / 2] >> (16 * (channel % 2)) & 0xffff;
                    f64::from(integer) / 65535.0
                };
                *value = mixed(&of_corner).clamp(0.0, 1.0) as f32;
            }
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A part of two triangles, whose corners are numbered by their texture coordinates.
    fn part(uv_sets: usize, has_color: bool) -> Corners {
        let mut corners = Corners::new(uv_sets, has_color);
        for corner in 0..6 {
            let uvs: Vec<_> = (0..uv_sets).map(|set| [corner as f32, set as f32]).collect();
            corners.push(&uvs, [corner as f32 / 5.0, 0.0, 1.0, 0.5]);
        }
        corners
    }

    #[test]
    fn a_point_between_the_corners_has_values_between_theirs() {
        let mut mesh = MeshCorners::default();
        assert!(mesh.is_empty());
        mesh.push(3, &part(2, true), 1, false);
        mesh.push(4, &part(2, true), 0, true);
        mesh.push(5, &part(0, false), 0, false);
        mesh.push(6, &part(1, false), 0, false);
        assert_eq!((mesh.runs.len(), mesh.bytes()), (2, 4 * (2 * 18 + 6) + 2 * size_of::<Run>()));
        let values = mesh.at(3, 0.25, 0.5);
        assert_eq!(values.uvs[..2], [[0.25 * 3.0 + 0.25 * 4.0 + 0.5 * 5.0, 0.0], [4.25, 1.0]]);
        assert!(values.uvs[2][0].is_nan());
        assert!((values.color[0] - 0.85).abs() < 1e-5 && (values.color[3] - 0.5).abs() < 1e-5);
        assert_eq!(values.color[1..3], [0.0, 1.0]);
        // The second and the third corner changed places.
        assert_eq!([mesh.at(4, 1.0, 0.0), mesh.at(4, 0.0, 1.0)].map(|v| v.uvs[0][0]), [2.0, 1.0]);
        assert!([0, 2, 5, 7].iter().all(|&other| mesh.at(other, 0.1, 0.1).color == [1.0; 4]));
        assert!(mesh.has_colors(4) && !mesh.has_colors(6) && !mesh.has_colors(5));
        let mut other = MeshCorners::default();
        (0..8).for_each(|triangle| other.push_of(triangle, &mesh, triangle));
        assert_eq!(other, mesh);
    }
}
