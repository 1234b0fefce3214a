//! The integration tests: one binary, a module a subject.

mod shapes;
mod trace;
mod truth;
