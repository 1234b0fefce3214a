//! Reading a frame: a job is run in memory, and its range image and cloud are read back from the bytes of their files.
//!
//! `cargo run --release --example read_frame`

use std::error::Error;
use std::path::Path;

use beamcast::output::Samples;
use beamcast::output::recorded::{read_exr, read_ply};
use beamcast::run::{Item, load_scene};
use beamcast::{Format, Progress, Session, load_job};

/// Runs the example.
pub fn main() -> Result<(), Box<dyn Error>> {
    // A job and its scene, as `beamcast scan configs/room_vlp16.toml` reads them.
    let mut job = load_job(&Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/room_vlp16.toml"), &[])?;
    let scene = load_scene(&mut job, &[])?.scene;
    let session = Session::open(job, &scene);

    // The first frame of its first sensor, and the files that a scan would write for it.
    let item = Item { sensor: 0, frame: 0, outputs: vec![] };
    let frame = session.cast(&item, &Progress::default()).expect("nobody cancels it");
    let written = session.sensor_frame(&item, &frame);
    let (exr, ply) = (Format::EXR.encode(&written)?, Format::PLY.encode(&written)?);

    // A range image: channels by name, row by row, with +∞ where nothing came back.
    let parts = read_exr(&exr, u64::MAX)?;
    let image = &parts[0].image;
    let Some(Samples::F32(ranges)) = image.channel("range") else { panic!("every image has ranges") };
    let finite = ranges.iter().filter(|range| range.is_finite()).count();
    println!("{} × {} pixels, {finite} with a return", image.rows, image.columns);

    // A cloud: its fields by name, a number for each point. Points without a return are left out.
    let cloud = read_ply(&ply, u64::MAX)?;
    let [x, y, z] = ["x", "y", "z"].map(|name| cloud.field(name).expect("every cloud has coordinates"));
    println!("the first of {} points is at ({:.3}, {:.3}, {:.3})", x.len(), x[0], y[0], z[0]);

    assert_eq!(finite, frame.return_count());
    assert_eq!(x.len(), finite);
    Ok(())
}
