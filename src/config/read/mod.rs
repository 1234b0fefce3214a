//! Tables of TOML → jobs and sensors, by the declarations in `keys/`.

mod expect;
pub(super) mod job;
mod modes;
mod preset;
mod rays;
mod rig;
mod sensor;
pub(super) mod sensor_file;
#[cfg(test)]
mod tests;

pub(super) use sensor::is_pattern;
