//! Judging what a sensor sees: against closed forms.

pub mod selftest;
