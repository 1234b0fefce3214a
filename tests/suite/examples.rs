//! The examples run, and their own assertions hold.

#[path = "../../examples/first_scan.rs"]
mod first_scan;
#[path = "../../examples/own_pattern.rs"]
mod own_pattern;
#[path = "../../examples/own_rays.rs"]
mod own_rays;
#[path = "../../examples/read_frame.rs"]
mod read_frame;

#[test]
fn a_first_scan() {
    first_scan::main().unwrap();
}

#[test]
fn a_pattern_of_ones_own() {
    own_pattern::main().unwrap();
}

#[test]
fn rays_of_ones_own() {
    own_rays::main().unwrap();
}

#[test]
fn a_frame_that_is_read_back() {
    read_frame::main().unwrap();
}
