//! `beamcast init`: writes a job to start from.

use std::path::{Path, PathBuf};

use super::import::refuse_to_replace;
use super::terminal::Terminal;
use crate::config::toml_string;
use crate::error::Error;
use crate::output::write_file;
use crate::run::paths::seen_from;

/// The arguments of `beamcast init`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The sensor: one that comes with beamcast (see `beamcast presets`), or a sensor file
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "velodyne/vlp-16")]
    preset: String,
    /// The scene, .glb or .gltf
    #[arg(long, value_name = "FILE", default_value = "scene.glb")]
    scene: PathBuf,
    /// Write the job here
    #[arg(short, long, value_name = "JOB.toml", default_value = "job.toml")]
    output: PathBuf,
    /// Replace the job if it is there already
    #[arg(long)]
    overwrite: bool,
}

/// Writes the job, and shows the next commands.
///
/// # Errors
/// [`Error::Output`] if the job is there already or can't be written.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    refuse_to_replace(&args.output, args.overwrite)?;
    let folder = args.output.parent().unwrap_or(Path::new(""));
    let scene = seen_from(folder, &args.scene);
    let preset = match args.preset.ends_with(".toml") {
        true => seen_from(folder, Path::new(&args.preset)),
        false => args.preset.clone(),
    };
    write_file(&args.output, job(&scene, &preset).as_bytes())?;
    let name = args.output.display();
    terminal.say(format_args!("wrote {name}; next: beamcast lint {name}, then beamcast scan {name}"));
    if !args.scene.exists() {
        terminal.warn(format_args!("there is no scene {} yet", args.scene.display()));
    }
    Ok(())
}

fn job(scene: &str, preset: &str) -> String {
    // The preset is replaced first: no preset is called SCENE, and a scene may be called anything.
    TEMPLATE.replace("PRESET", &toml_string(preset)).replacen("SCENE", &toml_string(scene), 1)
}

const TEMPLATE: &str = r#"#:schema job.schema.json
# The line above is for editors: `beamcast schema job > job.schema.json`, and they complete and check the keys below.

# The scene: a glTF file, .glb or .gltf. Paths are relative to this file.
scene = SCENE

# Everything random follows from this number: the same job with the same seed gives the same bytes.
seed = 0

# Semantic labels by the names of the scene's nodes or materials, instead of those in the file.
# [labels]
# wall = 3

# A sensor; write more of these tables for a rig.
[[sensor]]
# Names its folder in the output.
name = "sensor"
# One that comes with beamcast (`beamcast presets`), or a sensor file (`beamcast import` makes them of calibrations).
preset = PRESET
# Where it sits on the body: metres, x forward, y left, z up; roll, pitch and yaw in degrees, a positive pitch looks down.
pose = { position_m = [0.0, 0.0, 1.8], rpy_deg = [0.0, 0.0, 0.0] }

# What is said here overrides the preset.
# [sensor.range]
# max_m = 50.0

# Where the body stands in the world, in the same units: `beamcast lint` says how far the scene reaches.
[trajectory]
pose = { position_m = [0.0, 0.0, 0.0], rpy_deg = [0.0, 0.0, 0.0] }

[output]
# The folder to write to, relative to this file.
dir = "out"
# Range images with all channels (exr), clouds (ply), previews (png).
formats = ["exr", "ply", "png"]
# The frame of the clouds: "sensor" (a camera's: optical), "body" or "world".
frame = "sensor"
"#;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_name_makes_a_job() {
        for name in ["a.glb", "a \"quoted\" name\\.glb", "PRESET", "é\n.glb"] {
            let table: toml::Table = job(name, "velodyne/vlp-16").parse().unwrap();
            assert_eq!(table["scene"].as_str(), Some(name));
        }
    }
}
