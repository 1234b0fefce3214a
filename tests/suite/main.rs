//! The integration tests: one binary, a module a subject.

mod config;
mod shapes;
mod trace;
mod truth;
