//! Generates the scenes that ship in `scenes/`: `cargo run --release --example make_scenes`.
//!
//! With `-- --check` nothing is written. The committed files are compared with newly generated ones instead.

mod world;

use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let check = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => false,
        ["--check"] => true,
        _ => {
            eprintln!("usage: make_scenes [--check]");
            return ExitCode::from(2);
        }
    };
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut stale = false;
    for scene in world::all() {
        let path = folder.join(scene.file);
        if check {
            let same = std::fs::read(&path).is_ok_and(|committed| committed == scene.glb);
            println!(
                "{}: {}",
                scene.file,
                if same { "up to date" } else { "differs from a fresh generation" }
            );
            stale |= !same;
        } else if let Err(error) = std::fs::write(&path, &scene.glb) {
            eprintln!("{}: {error}", path.display());
            return ExitCode::from(4);
        } else {
            println!(
                "{}: {} triangles placed, {} stored, {} bytes",
                scene.file,
                scene.placed_triangles,
                scene.stored_triangles,
                scene.glb.len()
            );
        }
    }
    ExitCode::from(u8::from(stale))
}
