//! The integration tests: one binary, a module a subject.

mod config;
mod corpus;
mod hostile_scenes;
mod shapes;
mod trace;
mod truth;
