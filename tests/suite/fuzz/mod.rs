//! The fuzz targets for a short while, with the same inputs each time. The driver in fuzz/ looks for new ones.

mod mutate;
mod targets;

use std::fs;
use std::path::Path;

use beamcast::rng::Rng;
use rayon::prelude::*;

use targets::{TARGETS, Target};

/// Inputs that are made of the seeds, for each target. `BEAMCAST_THOROUGH=100` makes a hundred times as many.
const INPUTS: usize = 200;

/// The inputs that were found before: folders of them by target.
fn corpus(target: &Target) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz").join(target.name);
    let mut files: Vec<_> =
        fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.iter().map(|file| fs::read(file).unwrap()).collect()
}

#[test]
fn every_target_takes_what_was_found_and_what_is_made_of_it() {
    let thorough: usize = std::env::var("BEAMCAST_THOROUGH").map_or(1, |times| times.parse().unwrap());
    TARGETS.par_iter().for_each(|target| {
        let inputs = [(target.seeds)(), corpus(target)].concat();
        inputs.iter().for_each(|input| (target.run)(input));
        let mut random = Rng::new(7);
        for _ in 0..INPUTS * thorough {
            let [input, other] = [0, 1].map(|_| random.below(inputs.len()));
            (target.run)(&mutate::mutate(&inputs[input], &inputs[other], &mut random));
        }
    });
}
