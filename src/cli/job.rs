//! The job that a subcommand runs: the flags that choose and change it, and the messages while it is read.

use std::path::{Path, PathBuf};

use super::terminal::Terminal;
use super::threads;
use crate::config::{self, Config, Job};
use crate::error::Error;
use crate::run::{self, Bytes};
use crate::scene::gltf;
use crate::source::{Diagnostic, Severity};

/// Reads what a user names as a sensor or a job: a file, or else a built-in sensor, whose name has no ending.
///
/// # Errors
/// [`Error::Config`] with everything that is wrong with it.
pub fn load_sensor_or_job(path: &Path) -> Result<Config, Error> {
    match path.to_str().filter(|_| path.extension().is_none() && !path.exists()) {
        Some(name) => config::load_preset(name).map(|file| Config::Sensor(Box::new(file))),
        None => config::load(path, &[]),
    }
}

/// The flags of every subcommand that reads scenes.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct SceneArgs {
    /// Let scenes read buffers from this folder too, and from all below it; can be given again
    #[arg(long = "allow-folder", value_name = "DIR")]
    pub allowed_folders: Vec<PathBuf>,
}

/// The flags that every subcommand that runs one job has.
#[derive(Debug, clap::Args)]
pub struct JobArgs {
    /// The job's file
    #[arg(value_name = "JOB.toml")]
    job: PathBuf,
    /// Change a key of the job, such as sensor.top.range.max_m=50; can be given again
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    #[command(flatten)]
    pub scenes: SceneArgs,
    #[command(flatten)]
    pub threads: threads::Args,
}

impl JobArgs {
    /// The job's file.
    pub fn path(&self) -> &Path {
        &self.job
    }

    /// Reads a job with these flags and, if one is given, another seed. Shows its warnings, or takes them for errors.
    ///
    /// # Errors
    /// [`Error::Config`] with everything that is wrong with the job.
    pub fn load_strictly(
        &self,
        path: &Path,
        seed: Option<u64>,
        is_strict: bool,
        terminal: &Terminal,
    ) -> Result<Job, Error> {
        let seed = seed.map(|seed| format!("seed={seed}"));
        let overrides: Vec<String> = self.overrides.iter().cloned().chain(seed).collect();
        let job = config::load_job(path, &overrides)?;
        heed(&job.warnings, is_strict, terminal)?;
        Ok(job)
    }

    /// Reads the job, and shows its warnings.
    ///
    /// # Errors
    /// [`Error::Config`] with everything that is wrong with the job.
    pub fn load(&self, terminal: &Terminal) -> Result<Job, Error> {
        load_job(&self.job, &self.overrides, terminal)
    }
}

/// Reads a job, and shows its warnings.
///
/// # Errors
/// [`Error::Config`] with everything that is wrong with the job.
pub fn load_job(path: &Path, overrides: &[String], terminal: &Terminal) -> Result<Job, Error> {
    let job = config::load_job(path, overrides)?;
    terminal.warn_of(&job.warnings);
    Ok(job)
}

/// Reads a job's scene, and shows its warnings and, if the user wants to know, its notes and its files.
///
/// # Errors
/// Those of [`run::load_scene`].
pub fn load_scene(job: &mut Job, args: &SceneArgs, terminal: &Terminal) -> Result<gltf::Loaded, Error> {
    let loaded = run::load_scene(job, &args.allowed_folders)?;
    terminal.notices(&loaded.notices);
    for file in &loaded.scene.geometry.files {
        terminal.detail(format_args!("read {} ({}, BLAKE3 {})", file.name, Bytes(file.bytes), file.blake3));
    }
    Ok(loaded)
}

/// Shows warnings, or makes them errors if the user is strict.
///
/// # Errors
/// [`Error::Config`] with the warnings as errors, if the user is strict and there are any. Notes are none.
pub fn heed(warnings: &[Diagnostic], is_strict: bool, terminal: &Terminal) -> Result<(), Error> {
    if !is_strict {
        terminal.warn_of(warnings);
        return Ok(());
    }
    strictly(warnings)
}

/// Warnings as errors.
///
/// # Errors
/// [`Error::Config`], if there are any.
pub fn strictly(warnings: &[Diagnostic]) -> Result<(), Error> {
    let is_warning = |problem: &&Diagnostic| problem.severity == Severity::Warning;
    let errors: Vec<Diagnostic> = warnings
        .iter()
        .filter(is_warning)
        .map(|warning| Diagnostic { severity: Severity::Error, ..warning.clone() })
        .collect();
    if errors.is_empty() { Ok(()) } else { Err(Error::Config(errors)) }
}
