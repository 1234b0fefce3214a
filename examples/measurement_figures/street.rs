//! The street as three LiDARs measure it, seen from above, coloured by what made each return.

use std::error::Error;
use std::path::Path;

use beamcast::output::{NO_RETURN_COLOUR, Picture, Rgb, TEXT_COLOUR};
use beamcast::run::{Item, load_scene};
use beamcast::{Cause, Progress, Session, load_job};

/// Pixels of a side of a view.
const SIDE: usize = 480;
/// Metres from the middle of a view to its edge.
const REACH_M: f64 = 32.0;

/// The causes with colours of their own. Surfaces are as bright as their return.
const COLOURS: [(Cause, Rgb); 7] = [
    (Cause::Mixed, [255, 70, 60]),
    (Cause::Mirror, [70, 160, 255]),
    (Cause::Glass, [0, 230, 230]),
    (Cause::Rain, [70, 255, 70]),
    (Cause::Fog, [255, 230, 60]),
    (Cause::FalseAlarm, [255, 0, 255]),
    (Cause::Interference, [255, 140, 0]),
];

/// Three views side by side, as a PNG.
pub fn picture() -> Result<Vec<u8>, Box<dyn Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/street_measured.toml");
    let mut job = load_job(&path, &[])?;
    let scene = load_scene(&mut job, &[])?.scene;
    let session = Session::open(job, &scene);
    let names: Vec<String> = session.job.sensors.iter().map(|sensor| sensor.name.clone()).collect();
    let mut picture = Picture::new(names.len() * SIDE, SIDE + 24, NO_RETURN_COLOUR);
    for (sensor, name) in names.iter().enumerate() {
        let item = Item { sensor, frame: 0, outputs: vec![] };
        let frame = session.cast(&item, &Progress::default()).expect("nobody cancels it");
        let shown = session.sensor_frame(&item, &frame);
        let mut view = Picture::new(SIDE, SIDE, NO_RETURN_COLOUR);
        let most = frame.iter().map(|(_, one)| one.intensity).fold(0.0_f32, f32::max).min(100.0);
        // Returns that no surface makes are drawn last.
        for is_surface in [true, false] {
            for pixel in 0..frame.pixels() {
                for slot in frame.slots(pixel) {
                    let Some(echo) = frame.echo(slot) else { continue };
                    let one = frame.returns().get(slot);
                    let colour = COLOURS.iter().find(|(cause, _)| *cause == echo.cause);
                    if colour.is_none() != is_surface {
                        continue;
                    }
                    let (row, column) = (pixel / frame.columns(), pixel % frame.columns());
                    let Some(point) = shown.point(row, column, one.range_m) else { continue };
                    let grey = 70.0 + 185.0 * (one.intensity / most).clamp(0.0, 1.0).sqrt();
                    let colour = colour.map_or([grey as u8; 3], |(_, colour)| *colour);
                    let at = |metres: f64| ((1.0 - metres / REACH_M) * 0.5 * SIDE as f64).floor() as i64;
                    // Forward is up, and left is left.
                    let (x, y) = (at(point.y), at(point.x));
                    if (0..SIDE as i64).contains(&x) && (0..SIDE as i64).contains(&y) {
                        view.set(x, y, colour);
                    }
                }
            }
        }
        view.text((8, 8), name, 2, TEXT_COLOUR);
        picture.paste((sensor * SIDE, 0), &view);
    }
    let mut x = 8;
    picture.text((x, SIDE as i64 + 8), "surface", 1, TEXT_COLOUR);
    for (cause, colour) in COLOURS {
        x += 110;
        picture.text((x, SIDE as i64 + 8), cause.name(), 1, colour);
    }
    Ok(picture.to_png()?)
}
