//! The integration tests: one binary, a module a subject.

mod check;
mod cli;
mod config;
mod corpus;
mod dead_zone;
mod docs;
mod examples;
mod first_steps;
mod guards;
mod hostile_scenes;
mod import;
mod kernels;
mod layering;
mod mistakes;
mod open3d;
mod outputs;
mod patterns;
mod presets;
mod recognition;
mod regions;
mod scenes;
mod selftest;
mod shapes;
mod trace;
mod truth;
mod view;
