//! Looks for inputs that break a reader or a tracer: it changes inputs, and keeps those that reach something new.
//!
//! `cargo run --release -- [--seconds N] [--save] [TARGET…] [FILE…]`

mod coverage;
#[path = "../../tests/suite/fuzz/mutate.rs"]
mod mutate;
#[path = "../../tests/suite/fuzz/targets.rs"]
mod targets;

use std::collections::hash_map::DefaultHasher;
use std::fs;
use std::hash::{Hash, Hasher};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use beamcast::rng::Rng;
use coverage::Coverage;
use targets::{TARGETS, Target};

/// The longest that one input may take. No reader takes a tenth of that for an input of this size.
const LONGEST: Duration = Duration::from_secs(20);

/// The longest input that `--save` keeps: the corpus is part of the repository.
const LONGEST_SAVED: usize = 2000;

fn main() -> ExitCode {
    let (mut seconds, mut save, mut chosen, mut files) = (60, false, Vec::new(), Vec::new());
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--seconds" => seconds = args.next().and_then(|n| n.parse().ok()).expect("--seconds N"),
            "--save" => save = true,
            name => match TARGETS.iter().find(|target| target.name == name) {
                Some(target) => chosen.push(target),
                None => files.push(PathBuf::from(name)),
            },
        }
    }
    if chosen.is_empty() {
        chosen.extend(TARGETS);
    }
    if !files.is_empty() {
        for file in files {
            let bytes = fs::read(&file).expect("the file is there");
            chosen.iter().for_each(|target| (target.run)(&bytes));
        }
        return ExitCode::SUCCESS;
    }
    if !Coverage::is_counted() {
        println!("without coverage: run it in the folder fuzz/, whose .cargo/config.toml asks for it");
    }
    let each = Duration::from_secs(seconds) / chosen.len() as u32;
    let found: usize = chosen.iter().map(|target| usize::from(!fuzz(target, each, save))).sum();
    if found == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Where what is found is written, and from where a corpus comes.
fn folder(of: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(of)
}

fn hash(bytes: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    bytes.hash(&mut hasher);
    hasher.finish()
}

fn keep(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    fs::create_dir_all(folder).expect("the folder can be made");
    let path = folder.join(name);
    fs::write(&path, bytes).expect("the input can be written");
    path
}

/// Fuzzes one target. Returns false if it found something.
fn fuzz(target: &'static Target, time: Duration, save: bool) -> bool {
    let corpus = folder("../tests/fuzz").join(target.name);
    let mut inputs = (target.seeds)();
    let mut files: Vec<_> = fs::read_dir(&corpus).into_iter().flatten().flatten().map(|e| e.path()).collect();
    files.sort();
    inputs.extend(files.iter().map(|file| fs::read(file).expect("the corpus can be read")));
    let known = inputs.len();
    // What runs now, and since when: a run without end is found by another thread.
    let now: Arc<Mutex<Option<(Instant, Vec<u8>)>>> = Arc::default();
    let watched = now.clone();
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(Duration::from_millis(500));
            let now = watched.lock().unwrap().clone();
            if let Some((since, input)) = now.filter(|(since, _)| since.elapsed() > LONGEST) {
                let path =
                    keep(&folder("found"), &format!("{}-slow-{:016x}", target.name, hash(&input)), &input);
                println!("{}: not done after {:?}: {}", target.name, since.elapsed(), path.display());
                std::process::exit(1);
            }
        }
    });
    let mut coverage = Coverage::default();
    let mut slowest = Duration::ZERO;
    let mut run = |input: &[u8]| -> Option<bool> {
        let begun = Instant::now();
        *now.lock().unwrap() = Some((begun, input.to_vec()));
        let result = catch_unwind(AssertUnwindSafe(|| (target.run)(input)));
        *now.lock().unwrap() = None;
        slowest = slowest.max(begun.elapsed());
        let is_new = coverage.take();
        if result.is_err() {
            let path = keep(&folder("found"), &format!("{}-{:016x}", target.name, hash(input)), input);
            println!("{}: it panicked: {}", target.name, path.display());
            return None;
        }
        Some(is_new)
    };
    let begun = Instant::now();
    let mut random = Rng::new(hash(target.name.as_bytes()));
    for input in &inputs {
        if run(input).is_none() {
            return false;
        }
    }
    let mut runs = 0_u64;
    while begun.elapsed() < time {
        let [input, other] = [0, 1].map(|_| random.below(inputs.len()));
        let input = mutate::mutate(&inputs[input], &inputs[other], &mut random);
        runs += 1;
        match run(&input) {
            Some(false) => {}
            Some(true) => inputs.push(input),
            None => return false,
        }
    }
    println!(
        "{}: {runs} inputs, {} edges, {} inputs that reach something new, the slowest {slowest:.0?}",
        target.name,
        coverage.edges(),
        inputs.len() - known
    );
    if save {
        for input in inputs[known..].iter().filter(|input| input.len() <= LONGEST_SAVED) {
            keep(&corpus, &format!("{:016x}", hash(input)), input);
        }
    }
    true
}
