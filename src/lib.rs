//! beamcast casts the beams of LiDARs and depth cameras against glTF scenes, exactly, on the CPU.

pub mod angle;
pub mod cli;
pub mod config;
pub mod error;
pub mod frame;
pub mod output;
pub mod scan;
pub mod scene;
pub mod sensor;
pub mod trace;
