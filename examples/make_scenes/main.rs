//! Generates the scenes that ship in `scenes/`, and the tables of poses of the jobs in `configs/` that move in them:
//! `cargo run --release --example make_scenes`.
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
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut stale = false;
    let mut put = |path: &Path, content: &[u8], about: &str| {
        let shown = path.strip_prefix(root).unwrap_or(path).display();
        if check {
            let same = std::fs::read(path).is_ok_and(|committed| committed == content);
            println!("{shown}: {}", if same { "up to date" } else { "differs from a fresh generation" });
            stale |= !same;
            return Ok::<(), ExitCode>(());
        }
        let folder = path.parent().unwrap_or(root);
        std::fs::create_dir_all(folder).and_then(|()| std::fs::write(path, content)).map_err(|error| {
            eprintln!("{shown}: {error}");
            ExitCode::from(4)
        })?;
        println!("{shown}: {about}{} bytes", content.len());
        Ok(())
    };
    let mut all = || -> Result<(), ExitCode> {
        for scene in world::all() {
            let (placed, stored) = (scene.placed_triangles, scene.stored_triangles);
            let about = format!("{placed} triangles placed, {stored} stored, ");
            put(&root.join("scenes").join(scene.file), &scene.glb, &about)?;
        }
        for (path, table) in world::tables() {
            put(&root.join("configs").join(path), table.as_bytes(), "")?;
        }
        Ok(())
    };
    match all() {
        Err(code) => code,
        Ok(()) => ExitCode::from(u8::from(stale)),
    }
}
