use super::*;
use crate::rng::Rng;

/// The matcher straight from its formulas, pixel by pixel and without a thought of speed.
fn reference(left: &Gray, right: &Gray, s: &Settings) -> Matched {
    let (w, h, n) = (left.width as i64, left.height as i64, s.disparities as i64);
    let bits = s.bits() as i64;
    let (paths, block) = (s.paths.count() as i64, s.block as i64);
    let halvings =
        (0..).find(|k| paths * ((block * block * (bits + i64::from(s.p2))) >> k) <= 32767).unwrap();
    let window = |edge: i64| -(edge / 2)..=edge / 2;
    let around = |x: i64, y: i64, columns: i64, rows: i64| {
        window(rows).flat_map(move |j| {
            window(columns).map(move |i| ((x + i).clamp(0, w - 1), (y + j).clamp(0, h - 1)))
        })
    };
    let gray = |image: &Gray, (x, y): (i64, i64)| image.pixels[(y * w + x) as usize];
    let census = |image: &Gray, x: i64, y: i64| -> Vec<bool> {
        let (columns, rows) = (s.census.0 as i64, s.census.1 as i64);
        around(x, y, columns, rows).map(|at| gray(image, at) < gray(image, (x, y))).collect()
    };
    let all: Vec<(i64, i64)> = (0..h).flat_map(|y| (0..w).map(move |x| (x, y))).collect();
    let [lefts, rights] = [left, right]
        .map(|image| -> Vec<Vec<bool>> { all.iter().map(|&(x, y)| census(image, x, y)).collect() });
    let right_column = |x: i64, d: i64| x - i64::from(s.first_disparity) - d;
    let hamming = |(x, y): (i64, i64), d: i64| match right_column(x, d) {
        at if !(0..w).contains(&at) => bits / 2,
        at => {
            let pairs = lefts[(y * w + x) as usize].iter().zip(&rights[(y * w + at) as usize]);
            pairs.filter(|(a, b)| a != b).count() as i64
        }
    };
    let cost =
        |x: i64, y: i64, d: i64| around(x, y, block, block).map(|at| hamming(at, d)).sum::<i64>() >> halvings;
    let costs: Vec<Vec<i64>> = all.iter().map(|&(x, y)| (0..n).map(|d| cost(x, y, d)).collect()).collect();
    let [p1, p2] = [s.p1, s.p2].map(|p| (block * block * i64::from(p)) >> halvings);
    let mut sums = vec![vec![0; n as usize]; all.len()];
    let mut steps = vec![(1, 0), (-1, 0), (0, 1), (0, -1)];
    if s.paths == Paths::Eight {
        steps.extend([(1, 1), (-1, 1), (1, -1), (-1, -1)]);
    }
    for (dx, dy) in steps {
        let mut path: Vec<Option<Vec<i64>>> = vec![None; all.len()];
        let mut order = all.clone();
        order.sort_by_key(|(x, y)| (dy * y, dx * x));
        for (x, y) in order {
            let at = (y * w + x) as usize;
            let (fx, fy) = (x - dx, y - dy);
            let inside = (0..w).contains(&fx) && (0..h).contains(&fy);
            let now: Vec<i64> = match inside.then(|| path[(fy * w + fx) as usize].clone().unwrap()) {
                None => costs[at].clone(),
                Some(before) => (0..n as usize)
                    .map(|d| {
                        let least = *before.iter().min().unwrap();
                        let mut ways = vec![before[d], least + p2];
                        ways.extend(d.checked_sub(1).map(|d| before[d] + p1));
                        ways.extend(before.get(d + 1).map(|l| l + p1));
                        costs[at][d] + ways.iter().min().unwrap() - least
                    })
                    .collect(),
            };
            sums[at].iter_mut().zip(&now).for_each(|(sum, l)| *sum += l);
            path[at] = Some(now);
        }
    }
    choose(left, s, &costs, &sums)
}

/// The choice and the filters, for [`reference`].
fn choose(left: &Gray, s: &Settings, costs: &[Vec<i64>], sums: &[Vec<i64>]) -> Matched {
    let (w, h, n) = (left.width as i64, left.height as i64, s.disparities as i64);
    let first = i64::from(s.first_disparity);
    let best = |costs: &[i64]| (0..n).min_by_key(|&d| costs[d as usize]).unwrap();
    let second = |costs: &[i64], d: i64| {
        (0..n).filter(|k| (k - d).abs() > 1).map(|k| costs[k as usize]).min().unwrap_or(32767)
    };
    let mut matched = Matched {
        width: left.width,
        height: left.height,
        disparity: vec![],
        confidence: vec![],
        verdict: vec![],
    };
    for at in 0..w * h {
        let (x, y, sum, cost) = (at % w, at / w, &sums[at as usize], &costs[at as usize]);
        let d = best(sum);
        let (b, c) = (sum[d as usize], second(sum, d));
        let is_inside = |d: i64| (0..n).contains(&d) && (0..w).contains(&(x - first - d));
        let inside = is_inside(d - 1) && is_inside(d) && is_inside(d + 1);
        let mut disparity = (first + d) as f64;
        if inside {
            let [a, b, c] = [d - 1, d, d + 1].map(|d| cost[d as usize] as f64);
            let across = if s.sub_pixel == SubPixel::Parabola { a + c - 2.0 * b } else { a.max(c) - b };
            if b > a.min(c) {
                disparity += if a == c { 0.0 } else { 0.5 * (a - c).signum() };
            } else if across > 0.0 {
                disparity += (a - c) / (2.0 * across);
            }
        }
        let texture = (-(s.census.1 as i64 / 2)..=s.census.1 as i64 / 2)
            .flat_map(|j| (-(s.census.0 as i64 / 2)..=s.census.0 as i64 / 2).map(move |i| (i, j)))
            .filter(|&(i, j)| (i, j) != (0, 0))
            .map(|(i, j)| (y + j).clamp(0, h - 1) * w + (x + i).clamp(0, w - 1))
            .filter(|&other| {
                left.pixels[other as usize].abs_diff(left.pixels[at as usize]) >= s.texture.difference
            })
            .count();
        let close = |best: i64, second: i64, percent: u8| second * (100 - i64::from(percent)) <= 100 * best;
        let repeats = |percent| close(cost[d as usize], second(cost, d), percent);
        let disagrees = |most: u16| {
            let right = x - first - d;
            let seen = |k: i64| (0..w).contains(&(right + first + k));
            let of = |k: i64| sums[(y * w + right + first + k) as usize][k as usize];
            (0..n).filter(|&k| seen(k)).min_by_key(|&k| of(k)).unwrap().abs_diff(d) > u64::from(most)
        };
        matched.disparity.push((disparity * 256.0 + 0.5).floor() as i32);
        matched.confidence.push(if c == 0 { 0 } else { (255 * (c - b).max(0) / c) as u8 });
        matched.verdict.push(if texture < usize::from(s.texture.count) {
            Verdict::NoTexture
        } else if !inside {
            Verdict::OutsideSearch
        } else if close(b, c, s.uniqueness_percent) || s.repetition_percent.is_some_and(repeats) {
            Verdict::Ambiguous
        } else if s.left_right_px.is_some_and(disagrees) {
            Verdict::Occluded
        } else {
            Verdict::Matched
        });
    }
    filtered(matched, s)
}

/// The filters, for [`reference`]. Patches grow by the smallest number in them until nothing changes.
fn filtered(mut matched: Matched, s: &Settings) -> Matched {
    let (w, h) = (matched.width as i64, matched.height as i64);
    let good = |matched: &Matched, at: i64| matched.verdict[at as usize] == Verdict::Matched;
    if let Some(speckle) = s.speckle {
        let mut patch: Vec<i64> = (0..w * h).collect();
        loop {
            let before = patch.clone();
            for at in (0..w * h).filter(|&at| good(&matched, at)) {
                for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                    let (x, y) = (at % w + dx, at / w + dy);
                    let other = y * w + x;
                    let inside = (0..w).contains(&x) && (0..h).contains(&y);
                    if inside
                        && good(&matched, other)
                        && matched.disparity[at as usize].abs_diff(matched.disparity[other as usize])
                            <= speckle.step as u32
                    {
                        patch[at as usize] = patch[at as usize].min(patch[other as usize]);
                    }
                }
            }
            if before == patch {
                break;
            }
        }
        for at in (0..w * h).filter(|&at| good(&matched.clone(), at)).collect::<Vec<_>>() {
            let size = (0..w * h)
                .filter(|&other| {
                    !matches!(
                        matched.verdict[other as usize],
                        Verdict::NoTexture | Verdict::OutsideSearch | Verdict::Ambiguous | Verdict::Occluded
                    ) && patch[other as usize] == patch[at as usize]
                })
                .count();
            if size < speckle.pixels {
                matched.verdict[at as usize] = Verdict::Speckle;
            }
        }
    }
    let (before, reach) = (matched.clone(), s.median as i64 / 2);
    for at in (0..w * h).filter(|&at| good(&before, at)) {
        let near = |other: &i64| {
            (other % w - at % w).abs() <= reach
                && (other / w - at / w).abs() <= reach
                && good(&before, *other)
        };
        let mut window: Vec<i32> =
            (0..w * h).filter(near).map(|other| before.disparity[other as usize]).collect();
        window.sort_unstable();
        matched.disparity[at as usize] = window[(window.len() - 1) / 2];
    }
    matched
}

/// A pair of random images: the right one is the left one moved by `d`, by more in a rectangle, and with noise in part.
fn pair(width: usize, height: usize, d: usize, rng: &mut Rng) -> (Gray, Gray) {
    let texture: Vec<u8> = (0..(width + 40) * height).map(|_| rng.u32() as u8 >> 2).collect();
    let at = |x: usize, y: usize| texture[y * (width + 40) + x];
    let each = || (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let mut left: Vec<u8> = each().map(|(x, y)| at(x, y)).collect();
    let mut right: Vec<u8> = each().map(|(x, y)| at(x + d + usize::from(x > width / 2) * 3, y)).collect();
    for at in 0..width * height / 8 {
        right[8 * at] = rng.u32() as u8;
    }
    left[..width / 4].fill(9);
    (Gray::new(width, height, left).unwrap(), Gray::new(width, height, right).unwrap())
}

fn matched(left: &Gray, right: &Gray, settings: Settings) -> Matched {
    Matcher::new(settings).unwrap().matched(left, right).unwrap()
}

#[test]
fn every_byte_is_that_of_the_formulas() {
    let mut rng = Rng::new(1);
    let mut found = vec![];
    let (plain, all) = (Settings { speckle: None, median: 1, ..Settings::default() }, Settings::default());
    let speckle = Some(Speckle { pixels: 6, step: 300 });
    let texture = Texture { difference: 5, count: 3 };
    for (size, first, disparities, census, block, settings) in [
        ((23, 11), 0, 9, (7, 7), 7, Settings { texture, speckle, ..all }),
        (
            (31, 9),
            -3,
            17,
            (9, 7),
            1,
            Settings { paths: Paths::Eight, p1: 3, p2: 20, texture, speckle, ..all },
        ),
        ((30, 44), 1, 8, (3, 3), 3, Settings { sub_pixel: SubPixel::Parabola, median: 3, texture, ..all }),
        ((18, 13), 0, 40, (5, 3), 5, Settings { paths: Paths::Eight, left_right_px: None, ..plain }),
        ((17, 5), 2, 3, (1, 3), 1, Settings { uniqueness_percent: 0, left_right_px: Some(0), ..plain }),
        ((16, 6), 0, 12, (13, 5), 9, Settings { p1: 0, p2: 0, repetition_percent: None, median: 7, ..all }),
        ((12, 7), 0, 2, (65, 1), 31, Settings { p1: 1024, p2: 1024, paths: Paths::Eight, ..plain }),
    ] {
        let settings = Settings { first_disparity: first, disparities, census, block, ..settings };
        let (left, right) = pair(size.0, size.1, 4, &mut rng);
        let (ours, theirs) = (matched(&left, &right, settings), reference(&left, &right, &settings));
        assert_eq!(ours.verdict, theirs.verdict, "{settings:?}");
        assert_eq!(ours.confidence, theirs.confidence, "{settings:?}");
        assert_eq!(ours.disparity, theirs.disparity, "{settings:?}");
        found.extend(ours.verdict);
    }
    use Verdict as V;
    for verdict in [V::Matched, V::NoTexture, V::OutsideSearch, V::Ambiguous, V::Occluded, V::Speckle] {
        assert!(found.contains(&verdict), "{verdict:?}");
    }
}

#[test]
fn moved_dots_have_their_disparity_wherever_both_images_show_them() {
    let (w, h, d) = (160, 40, 21);
    let mut rng = Rng::new(2);
    let texture: Vec<u8> = (0..(w + d) * h).map(|_| rng.u32() as u8).collect();
    let [left, right] = [0, d].map(|from| {
        let pixels = (0..w * h).map(|at| texture[at / w * (w + d) + at % w + from]).collect();
        Gray::new(w, h, pixels).unwrap()
    });
    for paths in [Paths::Four, Paths::Eight] {
        for block in [1, 7] {
            // The censuses of two pixels that are the darkest of their windows are equal, so a block of one pixel may repeat.
            let repetition_percent = (block > 1).then_some(10);
            let settings = Settings {
                disparities: 64,
                paths,
                block,
                repetition_percent,
                median: 1,
                ..Settings::default()
            };
            let found = matched(&left, &right, settings);
            // Windows that reach beyond either image's border see other pixels in it than in the other image.
            let margin = settings.census.0 / 2 + block / 2;
            for (x, y) in (0..h).flat_map(|y| (d + margin..w - margin).map(move |x| (x, y))) {
                // A fraction is 0 but for the chance difference of the costs on both sides. Of one pixel, it is at most a half, so
                // that the whole disparity is right. The Hamming distance of two pixels of ranks p and q among all grey values has
                // the mean 48·(p + q − 2pq): 24 ± 8.0 bits over the ranks, ± 8.7 with the chance of each bit, and ± 1.24 as the mean
                // of 49 pixels. That makes a fraction of ± 1.24·√2/(2·24) = 0.037 px, and five times it are 0.18 px.
                let Some(whole) = found.at(x, y) else {
                    panic!("{:?} at {x}, {y}, {paths:?}, block {block}", found.verdict[y * w + x]);
                };
                let whole = (whole - d as f64).abs();
                assert!(whole <= if block == 1 { 0.5 } else { 0.18 }, "{whole} at {x}, {y}, block {block}");
            }
        }
    }
}

/// Gaussian dots at random places, integrated over each pixel, as seen by a camera that is moved to the right.
struct Dots {
    /// Column, row and energy of each.
    dots: Vec<[f64; 3]>,
    size: (usize, usize),
}

impl Dots {
    const SIGMA_PX: f64 = 0.7;

    fn new(width: usize, height: usize) -> Self {
        let mut rng = Rng::new(3);
        let (w, h) = (width as f64 + 60.0, height as f64);
        let dot = |_| [rng.unit() * w, rng.unit() * h, 200.0 + 200.0 * rng.unit()];
        Self { dots: (0..(width + 60) * height / 8).map(dot).collect(), size: (width, height) }
    }

    fn image(&self, moved: f64) -> Gray {
        let (width, height) = self.size;
        let mut light = vec![20.0; width * height];
        for [x, y, energy] in &self.dots {
            let share = |pixel: i64, centre: f64| {
                let below = |at: f64| libm::erf((at - centre) / (Self::SIGMA_PX * std::f64::consts::SQRT_2));
                0.5 * (below(pixel as f64 + 1.0) - below(pixel as f64))
            };
            let x = x - moved;
            for (v, u) in (*y as i64 - 5..*y as i64 + 6)
                .flat_map(|v| (x.floor() as i64 - 5..x.floor() as i64 + 6).map(move |u| (v, u)))
            {
                if (0..width as i64).contains(&u) && (0..height as i64).contains(&v) {
                    light[v as usize * width + u as usize] += energy * share(u, x) * share(v, *y);
                }
            }
        }
        Gray::new(width, height, light.iter().map(|light| (light + 0.5).min(255.0) as u8).collect()).unwrap()
    }

    /// The mean error of the disparity where both images show the dots, in pixels.
    fn bias_px(&self, disparity: f64, settings: Settings) -> f64 {
        let found = matched(&self.image(0.0), &self.image(disparity), settings);
        let each = (0..self.size.1).flat_map(|y| (30..self.size.0 - 10).map(move |x| (x, y)));
        let errors: Vec<f64> = each.filter_map(|(x, y)| found.at(x, y)).map(|d| d - disparity).collect();
        // A fill rate of 99 %, as a camera has on a wall.
        assert!(
            errors.len() * 100 >= (self.size.0 - 40) * self.size.1 * 99,
            "{} at {disparity}",
            errors.len()
        );
        errors.iter().sum::<f64>() / errors.len() as f64
    }
}

#[test]
fn fractions_of_a_pixel_are_as_good_as_stated() {
    let dots = Dots::new(240, 80);
    let curve = |sub_pixel, from: f64| -> Vec<f64> {
        let settings = Settings { disparities: 40, sub_pixel, median: 1, ..Settings::default() };
        (0..8).map(|eighth| dots.bias_px(from + f64::from(eighth) / 8.0, settings)).collect()
    };
    // The errors of single pixels have a standard deviation of 0.035 px and are independent 13 px apart, where their windows and
    // blocks end: those of 200·80 pixels have a mean with a standard error of 0.035·√(169/16000) = 0.0036 px.
    let error = 0.0036;
    for (sub_pixel, stated) in [(SubPixel::Equiangular, 0.018), (SubPixel::Parabola, 0.10)] {
        let (one, next) = (curve(sub_pixel, 18.0), curve(sub_pixel, 19.0));
        println!("{sub_pixel:?}: {one:.4?}, {next:.4?}");
        let largest = one.iter().fold(0.0_f64, |largest, bias| largest.max(bias.abs()));
        assert!(largest < stated + 2.0 * error, "{sub_pixel:?}: {one:?}");
        for eighth in 0..8 {
            // The right image is the same but for a column, so the two differ by what stands at its border.
            assert!((one[eighth] - next[eighth]).abs() < error, "period: {one:?}, {next:?}");
            assert!((one[eighth] + one[(8 - eighth) % 8]).abs() < 3.0 * error, "symmetry: {one:?}");
        }
    }
}

#[test]
fn what_the_right_camera_cannot_see_is_occluded_for_the_difference_of_the_disparities() {
    // A near plate before a far wall: the strip of f·b·(1/near − 1/far) px left of the plate is seen by the left camera alone.
    let (w, h, far, near) = (200_usize, 60_usize, 10, 25);
    let plate = |u: usize| (100..150).contains(&u);
    let mut rng = Rng::new(4);
    let mut noise = || -> Vec<u8> { (0..300 * h).map(|_| rng.u32() as u8).collect() };
    let (wall, front) = (noise(), noise());
    let each = || (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
    // Textures are fixed to the columns of the left image.
    let left = each().map(|(x, y)| if plate(x) { front[300 * y + x] } else { wall[300 * y + x] }).collect();
    let right = each().map(|(x, y)| match plate(x + near) {
        true => front[300 * y + x + near],
        false => wall[300 * y + x + far],
    });
    let (left, right) = (Gray::new(w, h, left).unwrap(), Gray::new(w, h, right.collect()).unwrap());
    for block in [1, 5] {
        let settings = Settings {
            disparities: 48,
            census: (5, 5),
            block,
            p1: 2,
            p2: 10,
            uniqueness_percent: 0,
            repetition_percent: None,
            speckle: None,
            median: 1,
            ..Settings::default()
        };
        let found = matched(&left, &right, settings);
        let widths: Vec<usize> = (10..h - 10)
            .map(|y| (70..130).filter(|x| found.verdict[y * w + x] == Verdict::Occluded).count())
            .collect();
        let mean = widths.iter().sum::<usize>() as f64 / widths.len() as f64;
        println!("block {block}: {mean}");
        // Windows that reach over the edge may give the strip's last pixels to the plate, or the plate's first ones to nothing.
        let reach = (settings.census.0 / 2 + block / 2) as f64;
        assert!((mean - (near - far) as f64).abs() <= reach, "{mean} px with a block of {block}: {widths:?}");
        for y in 10..h - 10 {
            assert_eq!(found.at(60, y).unwrap().round(), far as f64);
            assert_eq!(found.at(130, y).unwrap().round(), near as f64);
        }
    }
}

#[test]
fn black_has_no_texture_and_a_pattern_that_repeats_is_ambiguous() {
    let (w, h) = (120, 30);
    let texture = Texture { difference: 4, count: 2 };
    let settings = Settings { disparities: 32, texture, ..Settings::default() };
    let black = Gray::new(w, h, vec![0; w * h]).unwrap();
    assert!(matched(&black, &black, settings).verdict.iter().all(|verdict| *verdict == Verdict::NoTexture));
    // Without the check of texture all disparities are equal.
    let unchecked = Settings { texture: Texture { difference: 0, count: 0 }, ..settings };
    assert!(!matched(&black, &black, unchecked).verdict.contains(&Verdict::Matched));

    let mut rng = Rng::new(5);
    let period = 9;
    let tile: Vec<u8> = (0..period * h).map(|_| rng.u32() as u8).collect();
    let stripes = |from: usize| {
        let pixels = (0..w * h).map(|at| tile[at / w * period + (at % w + from) % period]).collect();
        Gray::new(w, h, pixels).unwrap()
    };
    // The left image is three of the right one's columns farther.
    let found = matched(&stripes(0), &stripes(3), settings);
    for (x, y) in (0..h).flat_map(|y| (settings.disparities + 6..w - 6).map(move |x| (x, y))) {
        assert_eq!(found.verdict[y * w + x], Verdict::Ambiguous, "{x}, {y}");
    }
    let once = Settings { disparities: 9, ..settings };
    let found = matched(&stripes(0), &stripes(3), once);
    assert_eq!(found.at(60, 15).unwrap().round(), 3.0, "one period has one repetition");
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let (left, right) = pair(150, 90, 7, &mut Rng::new(6));
    for paths in [Paths::Four, Paths::Eight] {
        let settings = Settings { disparities: 24, paths, ..Settings::default() };
        let [one, two, three] = [1, 2, 3].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| matched(&left, &right, settings))
        });
        assert!(one == two && two == three);
    }
}

#[test]
fn a_matcher_forgets_the_images_before() {
    let mut matcher = Matcher::new(Settings { disparities: 20, ..Settings::default() }).unwrap();
    let (large, small) = (pair(70, 40, 5, &mut Rng::new(7)), pair(33, 50, 3, &mut Rng::new(8)));
    let first = matcher.matched(&large.0, &large.1).unwrap();
    let second = matcher.matched(&small.0, &small.1).unwrap();
    assert_eq!(second, matched(&small.0, &small.1, matcher.settings));
    assert_eq!(first, matcher.matched(&large.0, &large.1).unwrap());
    assert_eq!(matcher.matched(&large.0, &small.1), None, "images of two sizes");
}

#[test]
fn no_size_is_too_small() {
    let sizes = [(1, 1), (2, 1), (1, 5), (3, 3), (5, 2), (9, 1)];
    for (width, height) in sizes {
        let (left, right) = pair(width, height, 1, &mut Rng::new(9));
        for first_disparity in [-4096, -5, 0, 7, 4096] {
            for disparities in [1, 2, 3, 4, 64] {
                for (paths, census) in
                    [(Paths::Four, (7, 7)), (Paths::Eight, (65, 1)), (Paths::Eight, (1, 65))]
                {
                    let settings =
                        Settings { first_disparity, disparities, census, paths, ..Settings::default() };
                    assert_eq!(
                        matched(&left, &right, settings).verdict,
                        reference(&left, &right, &settings).verdict
                    );
                }
            }
        }
    }
    let (left, right) = pair(20, 3, 1, &mut Rng::new(9));
    let found = matched(&left, &right, Settings::default());
    assert_eq!((found.at(20, 0), found.at(0, 3), found.at(usize::MAX, usize::MAX)), (None, None, None));
    assert_eq!(Gray::new(0, 3, vec![]), None);
    assert_eq!(Gray::new(2, 2, vec![0; 3]), None);
    assert_eq!(Gray::new(usize::MAX, 2, vec![0; 3]), None);
}

#[test]
fn settings_out_of_range_are_named() {
    let all = Settings::default();
    for (settings, name) in [
        (Settings { first_disparity: 5000, ..all }, "first_disparity"),
        (Settings { disparities: 0, ..all }, "disparities"),
        (Settings { census: (1, 1), ..all }, "census"),
        (Settings { census: (9, 9), ..all }, "census"),
        (Settings { census: (usize::MAX, usize::MAX), ..all }, "census"),
        (Settings { block: 4, ..all }, "block"),
        (Settings { p1: 33, ..all }, "p1"),
        (Settings { p2: 2000, ..all }, "p2"),
        (Settings { uniqueness_percent: 100, ..all }, "uniqueness_percent"),
        (Settings { repetition_percent: Some(100), ..all }, "repetition_percent"),
        (Settings { speckle: Some(Speckle { pixels: 1, step: -1 }), ..all }, "speckle"),
        (Settings { median: 9, ..all }, "median"),
    ] {
        assert_eq!(Matcher::new(settings).unwrap_err().setting, name);
    }
}
