//! Tables of TOML → jobs and sensors, by the declarations in `keys/`.

mod actors;
mod drawn;
mod expect;
mod job;
pub(super) mod layers;
mod modes;
mod nominal;
mod placing;
mod pose;
mod pose_files;
mod preset;
mod random;
mod rays;
mod rig;
mod sensor;
pub(super) mod sensor_file;
mod sensor_files;
mod surroundings;
#[cfg(test)]
mod tests;
mod trajectory;

pub(super) use sensor::is_pattern;
