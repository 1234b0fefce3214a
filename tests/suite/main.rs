//! The integration tests: one binary, a module a subject.

mod corpus;
mod hostile_scenes;
