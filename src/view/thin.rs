//! Fewer pixels of frames that are too large for a page.

use std::borrow::Cow;

use super::frames::View;
use crate::output::{Channel, Image, Samples};

/// The most pixels of a frame that a page shows. A browser takes about a hundred bytes and two microseconds for each.
const MOST_PIXELS: usize = 1 << 22;

/// The most pixels of all frames of a page.
const MOST_PIXELS_OF_A_PAGE: usize = 1 << 25;

/// The least rows and columns that are left if the other side can be thinned out instead.
const LEAST_OF_A_SIDE: usize = 64;

/// A frame as a page shows it: whole, or every so many rows and columns of it.
pub(super) struct Thinned<'v> {
    /// The frame.
    pub view: Cow<'v, View>,
    /// Its baseline, with the same rows and columns.
    pub baseline: Option<Cow<'v, Image>>,
    /// The steps from one row and one column that is shown to the next.
    pub steps: [usize; 2],
    /// A sentence about the pixels that are left out. Empty if none are.
    pub note: String,
}

impl<'v> Thinned<'v> {
    /// Thins out a frame of a page that has so many frames.
    pub fn of(view: &'v View, baseline: Option<&'v Image>, frames: usize) -> Self {
        Self::to(view, baseline, MOST_PIXELS.min(MOST_PIXELS_OF_A_PAGE / frames.max(1)))
    }

    /// Thins out a frame to about so many pixels.
    pub fn to(view: &'v View, baseline: Option<&'v Image>, most: usize) -> Self {
        let Image { rows, columns, .. } = view.image;
        let steps = steps(rows, columns, most);
        if steps == [1, 1] {
            let (view, baseline) = (Cow::Borrowed(view), baseline.map(Cow::Borrowed));
            return Self { view, baseline, steps, note: String::new() };
        }
        let points = view.points.as_ref().map(|points| points_of(&view.image, points, steps));
        let thin = View {
            name: view.name.clone(),
            frame: view.frame,
            image: thinned(&view.image, steps),
            points: points.map_err(Clone::clone),
            instances: view.instances.clone(),
            labels: view.labels.clone(),
        };
        let baseline = baseline.map(|baseline| Cow::Owned(thinned(baseline, steps)));
        Self { view: Cow::Owned(thin), baseline, steps, note: note([rows, columns], steps) }
    }
}

/// What is left out of a frame of so many rows and columns. One row is a cloud without an image.
fn note([rows, columns]: [usize; 2], steps: [usize; 2]) -> String {
    let every = |step: usize, noun: &str| match step {
        1 => format!("every {noun}"),
        _ => format!("one of {step} {noun}s"),
    };
    let [by_row, by_column] = steps;
    if rows == 1 {
        return format!("{columns} points are too many for a page. It shows {}.", every(by_column, "point"));
    }
    format!(
        "{rows} × {columns} pixels are too many for a page. It shows {} and {}.",
        every(by_row, "row"),
        every(by_column, "column")
    )
}

/// The steps from one row and one column that is shown to the next, so that at most so many pixels are.
fn steps(rows: usize, columns: usize, most: usize) -> [usize; 2] {
    let too_many = (rows * columns).div_ceil(most.max(1)).max(1);
    if too_many == 1 {
        return [1, 1];
    }
    let root = (1..).find(|root| root * root >= too_many).unwrap_or(too_many);
    match () {
        () if rows / root < LEAST_OF_A_SIDE => [1, too_many],
        () if columns / root < LEAST_OF_A_SIDE => [too_many, 1],
        () => [root, root],
    }
}

/// The numbers of the pixels that are shown.
fn pixels(image: &Image, [row_step, column_step]: [usize; 2]) -> impl Iterator<Item = usize> {
    let (rows, columns) = (image.rows, image.columns);
    (0..rows)
        .step_by(row_step)
        .flat_map(move |row| (0..columns).step_by(column_step).map(move |column| row * columns + column))
}

fn thinned(image: &Image, steps: [usize; 2]) -> Image {
    let samples = |samples: &Samples| match samples {
        Samples::F32(values) => Samples::F32(pixels(image, steps).map(|pixel| values[pixel]).collect()),
        Samples::U32(values) => Samples::U32(pixels(image, steps).map(|pixel| values[pixel]).collect()),
    };
    let channel =
        |channel: &Channel| Channel { name: channel.name.clone(), samples: samples(&channel.samples) };
    Image {
        rows: image.rows.div_ceil(steps[0]),
        columns: image.columns.div_ceil(steps[1]),
        channels: image.channels.iter().map(channel).collect(),
    }
}

/// The points of the pixels that are shown. There is one for each pixel with a return, in the pixels' order.
fn points_of(image: &Image, points: &[[f32; 3]], steps: [usize; 2]) -> Vec<[f32; 3]> {
    let [row_step, column_step] = steps;
    let is_shown = |pixel: usize| {
        (pixel / image.columns).is_multiple_of(row_step)
            && (pixel % image.columns).is_multiple_of(column_step)
    };
    let seen = image.mask();
    let returned = (0..seen.len()).filter(|&pixel| seen[pixel]);
    returned.zip(points).filter(|(pixel, _)| is_shown(*pixel)).map(|(_, point)| *point).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn view(rows: usize, columns: usize) -> View {
        // Every third pixel has no return, and the others have their numbers as ranges and as points.
        let range = |i: usize| if i.is_multiple_of(3) { f32::INFINITY } else { i as f32 };
        let channels = vec![
            Channel {
                name: "id.instance".into(),
                samples: Samples::U32((0..(rows * columns) as u32).collect()),
            },
            Channel { name: "range".into(), samples: Samples::F32((0..rows * columns).map(range).collect()) },
        ];
        let seen = (0..rows * columns).filter(|i| !i.is_multiple_of(3));
        View {
            name: "top".into(),
            frame: None,
            image: Image { rows, columns, channels },
            points: Ok(seen.map(|i| [i as f32, 0.0, 0.0]).collect()),
            instances: BTreeMap::new(),
            labels: BTreeMap::new(),
        }
    }

    #[test]
    fn a_frame_that_fits_is_shown_whole() {
        let view = view(100, 200);
        let shown = Thinned::of(&view, Some(&view.image), 1);
        assert!(matches!(shown.view, Cow::Borrowed(_)) && shown.note.is_empty());
    }

    #[test]
    fn each_pixel_that_is_left_keeps_its_point() {
        let view = view(2100, 2100);
        let shown = Thinned::of(&view, Some(&view.image), 1);
        assert_eq!(
            shown.note,
            "2100 × 2100 pixels are too many for a page. It shows one of 2 rows and one of 2 columns."
        );
        let image = &shown.view.image;
        assert_eq!((image.rows, image.columns, image.pixels()), (1050, 1050, 1050 * 1050));
        assert_eq!(**shown.baseline.as_ref().unwrap(), *image);
        let ranges = image.f32("range").unwrap().iter().filter(|range| range.is_finite());
        let points = shown.view.points.as_ref().unwrap();
        assert!(ranges.copied().eq(points.iter().map(|point| point[0])) && points.len() > 100_000);
        assert_eq!(image.u32("id.instance").unwrap()[1051], 2 * 2100 + 2);
    }

    #[test]
    fn the_longer_side_is_thinned_out_first() {
        assert_eq!(steps(4096, 8192, 1 << 22), [3, 3]);
        assert_eq!(steps(6, 10_000_000, 1 << 22), [1, 15]);
        assert_eq!(steps(10_000_000, 6, 1 << 22), [15, 1]);
        assert_eq!(steps(1, 0, 1 << 22), [1, 1]);
        for [rows, columns] in [[5000, 5000], [128, 100_000], [1 << 16, 1 << 16]] {
            let [row_step, column_step] = steps(rows, columns, 1 << 20);
            assert!(rows.div_ceil(row_step) * columns.div_ceil(column_step) <= (1 << 20) + rows + columns);
        }
        // Many frames share what a page has.
        let shared = view(1024, 1024);
        assert!(Thinned::of(&shared, None, 64).note.contains("one of 2 rows"));
        let cloud = Thinned::of(&view(1, (1 << 22) + 1), None, 1).note;
        assert_eq!(cloud, "4194305 points are too many for a page. It shows one of 2 points.");
    }
}
