//! `beamcast init`: writes a job to start from, or a whole drive.

use std::path::{Path, PathBuf};

use super::shell::presets_or;
use super::terminal::Terminal;
use clap::builder::StringValueParser;

use crate::config::{DRIVE_JOB, load_preset, load_sensor, starter_drive, starter_job};
use crate::error::Error;
use crate::output::{check_file, write_file};
use crate::run::paths::seen_from;

/// The arguments of `beamcast init`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The sensor: one that comes with beamcast (see `beamcast presets`), or a sensor file
    #[arg(long, value_name = "NAME|FILE.toml", default_value = "velodyne/vlp-16",
          value_parser = presets_or(StringValueParser::new()), hide_possible_values = true)]
    preset: String,
    /// The scene, .glb or .gltf
    #[arg(long, value_name = "FILE", default_value = "scene.glb")]
    scene: PathBuf,
    /// Write the job here
    #[arg(short, long, visible_alias = "out", value_name = "JOB.toml", default_value = "job.toml")]
    output: PathBuf,
    /// Write a complete drive to this folder instead: a job of ten seconds through a street with moving cars, a cyclist and a
    /// walker, and their scenes
    #[arg(long, value_name = "DIR", num_args = 0..=1, default_missing_value = "drive",
          conflicts_with_all = ["preset", "scene", "output"])]
    drive: Option<PathBuf>,
    /// Replace what is there already
    #[arg(long)]
    overwrite: bool,
}

/// Writes the job, and shows the next commands.
///
/// # Errors
/// [`Error::Config`] if there is no such sensor, [`Error::Output`] if the job is there already or can't be written.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    if let Some(folder) = &args.drive {
        return drive(folder, args.overwrite, terminal);
    }
    check_file(&args.output, args.overwrite)?;
    let folder = args.output.parent().unwrap_or(Path::new(""));
    let scene = seen_from(folder, &args.scene);
    let preset = match args.preset.ends_with(".toml") {
        true => seen_from(folder, Path::new(&args.preset)),
        false => args.preset.clone(),
    };
    // A sensor that comes with beamcast is known now; a file may come later, as the scene may.
    if !args.preset.ends_with(".toml") {
        load_preset(&args.preset)?;
    } else if Path::new(&args.preset).exists() {
        load_sensor(Path::new(&args.preset))?;
    } else {
        terminal.warn(format_args!("there is no sensor file {} yet", args.preset));
    }
    write_file(&args.output, starter_job(&scene, &preset).as_bytes())?;
    let name = args.output.display();
    terminal.say(format_args!("wrote {name}; next: beamcast lint {name}, then beamcast scan {name}"));
    if !args.scene.exists() {
        terminal.warn(format_args!("there is no scene {} yet", args.scene.display()));
    }
    Ok(())
}

/// Writes the files of a drive, and shows the next commands.
fn drive(folder: &Path, overwrite: bool, terminal: &Terminal) -> Result<(), Error> {
    let files = starter_drive();
    for (name, _) in &files {
        check_file(&folder.join(name), overwrite)?;
    }
    for (name, content) in &files {
        write_file(&folder.join(name), content)?;
    }
    let (job, out) = (folder.join(DRIVE_JOB), folder.join("out"));
    let (job, out, count) = (job.display(), out.display(), files.len() - 1);
    terminal.say(format_args!(
        "wrote {job} and {count} files beside it; next: beamcast scan {job}, then beamcast view {out} for a page, and beamcast film \
         {out} for an animated picture"
    ));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_name_makes_a_job() {
        for name in ["a.glb", "a \"quoted\" name\\.glb", "PRESET", "é\n.glb"] {
            let table: toml::Table = starter_job(name, "velodyne/vlp-16").parse().unwrap();
            assert_eq!(table["scene"].as_str(), Some(name));
        }
    }
}
