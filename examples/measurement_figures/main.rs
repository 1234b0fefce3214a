//! Draws the figures of docs/measurement.md from runs: `cargo run --release --example measurement_figures`.
//!
//! With `-- --check` nothing is written. The committed figures are compared with newly drawn ones instead.

mod models;
mod plot;
mod street;

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let is_check = std::env::args().skip(1).any(|argument| argument == "--check");
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let mut is_stale = false;
    let mut put = |name: &str, content: &[u8]| -> Result<(), Box<dyn Error>> {
        let path = docs.join(name);
        if is_check {
            let is_same = std::fs::read(&path).is_ok_and(|committed| committed == content);
            println!("docs/{name}: {}", if is_same { "up to date" } else { "differs from a fresh drawing" });
            is_stale |= !is_same;
            return Ok(());
        }
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        std::fs::write(&path, content)?;
        println!("docs/{name}: {} bytes", content.len());
        Ok(())
    };
    for (name, figure) in models::all() {
        put(&format!("measurement/{name}.svg"), figure.to_svg().as_bytes())?;
    }
    put("street_measured.png", &street::picture()?)?;
    Ok(ExitCode::from(u8::from(is_stale)))
}
