//! The integration tests: one binary, a module a subject.

mod cli;
mod config;
mod corpus;
mod hostile_scenes;
mod kernels;
mod layering;
mod mistakes;
mod open3d;
mod outputs;
mod patterns;
mod scenes;
mod shapes;
mod trace;
mod truth;
