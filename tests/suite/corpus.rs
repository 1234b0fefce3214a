//! The glTF loader against third-party files: what conforms loads with the right number of triangles, what is hostile is
//! refused quickly and quietly. The files are not part of the project; BEAMCAST_CORPUS names their folder.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use beamcast::error::SceneError;
use beamcast::frame::UpAxis;
use beamcast::scene::gltf::{Loaded, Options, load};

/// What no file may take longer than. Generous: other tests run beside this one.
const TIMEOUT: Duration = Duration::from_secs(10);

fn corpus() -> Option<PathBuf> {
    let folder = std::env::var_os("BEAMCAST_CORPUS").map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: BEAMCAST_CORPUS not set");
    }
    folder
}

fn open(path: &Path) -> Result<Loaded, SceneError> {
    load(path, "scene", &Options { scene_name: None, up: UpAxis::Z, labels: &BTreeMap::new() })
}

/// Loads in a thread of its own, so that a file that never ends is a failure and not a hang.
fn open_in_time(path: &Path) -> (Result<Loaded, SceneError>, Duration) {
    let (sender, receiver) = mpsc::channel();
    let owned = path.to_path_buf();
    let start = Instant::now();
    std::thread::spawn(move || sender.send(open(&owned)));
    let result = receiver.recv_timeout(TIMEOUT);
    let result = result.unwrap_or_else(|_| panic!("{}: not done after {TIMEOUT:?}", path.display()));
    (result, start.elapsed())
}

/// The rows of an INDEX.tsv, without the head.
fn index(folder: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(folder.join("INDEX.tsv")).expect("the corpus has an index");
    text.lines().skip(1).map(|line| line.split('\t').map(str::to_owned).collect()).collect()
}

#[test]
fn valid_files_load_with_all_their_triangles() {
    let Some(corpus) = corpus() else { return };
    let folder = corpus.join("valid");
    let rows = index(&folder);
    assert!(!rows.is_empty());
    let mut wrong = Vec::new();
    for row in rows {
        let name = &row[0];
        match open(&folder.join(name)) {
            Ok(loaded) => {
                let count = loaded.scene.triangle_count() + loaded.scene.skipped_triangles;
                println!(
                    "{name}: {} + {} {:?}",
                    loaded.scene.triangle_count(),
                    loaded.scene.skipped_triangles,
                    loaded.warnings
                );
                if count.to_string() != row[1] {
                    wrong.push(format!("{name}: {count} triangles, not {}", row[1]));
                }
            }
            Err(error) => wrong.push(format!("{name}: {error}")),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn malformed_files_are_refused_or_read_but_never_hang_or_panic() {
    let Some(corpus) = corpus() else { return };
    let folder = corpus.join("malformed");
    for row in index(&folder) {
        let path = folder.join(&row[0]);
        let (result, time) = open_in_time(&path);
        match result {
            Ok(l) => println!(
                "{} {time:?}: ok {} {} {:?}",
                row[0],
                l.scene.triangle_count(),
                l.scene.skipped_triangles,
                l.warnings
            ),
            Err(error) => println!("{time:?} {}", error.to_string().split("malformed/").last().unwrap()),
        }
    }
}
