//! Pictures of the ground that a rig covers, and of the differences between images.

use super::compare::ChannelDifference;
use super::expect::{Seen, Zone};
use crate::output::Image;

/// A picture with 8 bits for each colour channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// The width in pixels.
    pub width: usize,
    /// The height in pixels.
    pub height: usize,
    /// The pixels as red, green and blue, row by row.
    pub pixels: Vec<u8>,
}

const UNSEEN: [u8; 3] = [0x14, 0x14, 0x18];
const SENSOR: [u8; 3] = [0xff, 0x30, 0x60];

/// The ground that a rig sees, from above, with forward (+x) up. A cell is brighter the more returns it has (Viridis,
/// logarithmic), dark if it is unseen, and red where a sensor stands.
pub fn coverage_map(seen: &Seen, zone: &Zone) -> Picture {
    let counts = zone.count(seen);
    let (nx, ny) = zone.cells();
    // The picture has at least 400 pixels on its longer side, so that a person recognises the cells.
    let scale = (400 / nx.max(ny)).max(1);
    let most = counts.iter().copied().max().unwrap_or(0).max(1);
    let (width, height) = (ny * scale, nx * scale);
    let mut pixels = Vec::with_capacity(3 * width * height);
    for down in 0..height {
        for across in 0..width {
            // +x is up and +y is left.
            let (x, y) = (nx - 1 - down / scale, ny - 1 - across / scale);
            let count = counts[y * nx + x];
            let brightness = libm::log1p(f64::from(count)) / libm::log1p(f64::from(most));
            let colour = colorous::VIRIDIS.eval_continuous(0.15 + 0.85 * brightness);
            pixels.extend(if count == 0 { UNSEEN } else { [colour.r, colour.g, colour.b] });
        }
    }
    for frame in seen.frames {
        let at = frame.capture.body_from_sensor.translation;
        let up = (at.x - zone.x_m[0]) / zone.cell_m * scale as f64;
        let left = (at.y - zone.y_m[0]) / zone.cell_m * scale as f64;
        for (dx, dy) in (-2..=2).flat_map(|dx| (-2..=2).map(move |dy| (dx, dy))) {
            let (down, across) = (height as f64 - up + f64::from(dx), width as f64 - left + f64::from(dy));
            if (0.0..height as f64).contains(&down) && (0.0..width as f64).contains(&across) {
                let start = 3 * (down as usize * width + across as usize);
                pixels[start..start + 3].copy_from_slice(&SENSOR);
            }
        }
    }
    Picture { width, height, pixels }
}

const BOTH_MISS: [u8; 3] = [0x10, 0x10, 0x14];
const SAME: [u8; 3] = [0x40, 0x40, 0x48];
const APPEARED: [u8; 3] = [0x30, 0xd0, 0x50];
const VANISHED: [u8; 3] = [0x30, 0x80, 0xff];

/// The differences of a channel between images of the same size. The colour goes from dark red to white with the difference
/// (Inferno, logarithmic over three decades below the greatest). Green pixels appeared, blue ones vanished, and grey ones
/// are unchanged.
pub fn heat_map(first: &Image, second: &Image, found: &ChannelDifference) -> Picture {
    let masks = [first.mask(), second.mask()];
    let (Some(a), Some(b)) = (first.channel(&found.channel), second.channel(&found.channel)) else {
        return Picture { width: 0, height: 0, pixels: Vec::new() };
    };
    let is_main = second.main_depth().is_some_and(|(name, _)| name == found.channel);
    let max = found.statistics.map_or(1.0, |s| s.max);
    let colour = |index: usize| match (masks[0][index], masks[1][index]) {
        (false, true) if is_main => APPEARED,
        (true, false) if is_main => VANISHED,
        (true, true) => {
            let difference = (a.get(index) - b.get(index)).abs();
            if difference == 0.0 {
                return SAME;
            }
            let decades = if found.statistics.is_some() { libm::log10(difference / max) } else { 0.0 };
            let colour =
                colorous::INFERNO.eval_continuous((0.4 + 0.6 * (1.0 + decades / 3.0)).clamp(0.4, 1.0));
            [colour.r, colour.g, colour.b]
        }
        _ => BOTH_MISS,
    };
    // The image of a LiDAR is a narrow stripe, so its rows are repeated until it is a quarter as tall as wide.
    let repeat = (second.columns / (4 * second.rows)).clamp(1, 16);
    let mut pixels = Vec::with_capacity(3 * second.pixels() * repeat);
    for row in 0..second.rows {
        let line: Vec<u8> =
            (0..second.columns).flat_map(|column| colour(row * second.columns + column)).collect();
        for _ in 0..repeat {
            pixels.extend(&line);
        }
    }
    Picture { width: second.columns, height: second.rows * repeat, pixels }
}
