//! The integration tests: one binary, a module a subject.

mod open3d;
mod scenes;
