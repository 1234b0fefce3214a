//! `beamcast kernels`: compares the published intersection methods.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde_json::{Value, json};

use super::job::SceneArgs;
use super::json;
use super::terminal::Terminal;
use crate::error::Error;
use crate::kernels::{self, AIMS, DISTANCES_M, Figures, HIT_RATIOS};
use crate::scene::{Scene, gltf};
use crate::trace::methods::{Culling, Edges};

/// The arguments of `beamcast kernels`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Measure on this scene (.glb or .gltf), seen from 1.8 m above the world's origin or, if nothing is seen from there,
    /// from its middle [default: a scene made in code]
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    scenes: SceneArgs,
    /// Look for leaks with this many rays for each method, and judge against exact arithmetic with a tenth of them
    #[arg(long, value_name = "N", default_value = "1000000", value_parser = clap::value_parser!(u64).range(1000..=1_000_000_000_000))]
    rays: u64,
    /// Print JSON
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print CSV, one line for each method
    #[arg(long)]
    csv: bool,
}

/// Measures every method and the exact definition.
///
/// # Errors
/// The errors of the scene.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let scene = match &args.scene {
        Some(path) => load(path, args, terminal)?,
        None => kernels::test_scene::yard(),
    };
    let all = kernels::measure(&scene, args.rays, &stopwatch)?;
    if args.json {
        let kernels: Vec<_> = all.iter().map(|f| Value::Object(columns(f).into_iter().collect())).collect();
        let triangles = scene.triangle_count();
        terminal
            .json(&json::KERNELS.of(json!({ "rays": args.rays, "triangles": triangles, "kernels": kernels })))
    } else if args.csv {
        terminal.data(&csv(&all))
    } else {
        terminal.data(&table(&all, scene.triangle_count()))
    }
}

fn load(path: &Path, args: &Args, terminal: &Terminal) -> Result<Scene, Error> {
    let options = gltf::Options { allowed_folders: &args.scenes.allowed_folders, ..gltf::Options::default() };
    let gltf::Loaded { scene, notices, .. } = gltf::load(path, &path.to_string_lossy(), &options)?;
    terminal.notices(&notices);
    Ok(scene)
}

fn name(figures: &Figures) -> &'static str {
    figures.method.map_or("exact", |m| m.about.name)
}

fn edges(figures: &Figures) -> &'static str {
    match figures.method.map(|m| m.about.edges) {
        Some(Edges::Inclusive) => "inclusive",
        Some(Edges::Exclusive) => "exclusive",
        Some(Edges::Consistent) => "consistent",
        None | Some(Edges::Watertight) => "watertight",
    }
}

fn culls(figures: &Figures) -> &'static str {
    match figures.method.map_or(Culling::None, |m| m.about.culling) {
        Culling::None => "none",
        Culling::Front => "front",
        Culling::Back => "back",
    }
}

/// Bytes that a method stores for a triangle. The exact definition stores the corners.
fn bytes_per_triangle(figures: &Figures) -> usize {
    figures.method.map_or(size_of::<[[f32; 3]; 3]>(), |m| m.bytes_per_triangle)
}

/// All figures of a method, each with the name of its column.
fn columns(figures: &Figures) -> Vec<(String, Value)> {
    let mut all: Vec<(String, Value)> = vec![
        ("name".into(), name(figures).into()),
        ("paper".into(), figures.method.map_or("the definition of a hit", |m| m.about.paper).into()),
        ("edges".into(), edges(figures).into()),
        ("culls".into(), culls(figures).into()),
        ("common_origin".into(), figures.method.is_some_and(|m| m.about.common_origin).into()),
        ("bytes_per_triangle".into(), bytes_per_triangle(figures).into()),
    ];
    let mut add = |key: String, value: f64| all.push((key, value.into()));
    for (ratio, ns) in HIT_RATIOS.iter().zip(figures.ns_per_test) {
        add(format!("ns_per_test_at_{ratio}"), ns);
    }
    add("mrays_per_s".into(), figures.mrays_per_s);
    for (aim, wrong) in AIMS.iter().zip(figures.wrong_per_1e6) {
        add(format!("wrong_per_1e6_{aim:?}").to_lowercase(), wrong);
    }
    for (distance, error) in DISTANCES_M.iter().zip(figures.t_error) {
        add(format!("t_error_mean_ulp_at_{distance}_m"), error.mean_ulp);
        add(format!("t_error_largest_ulp_at_{distance}_m"), error.largest_ulp);
        add(format!("t_error_mean_m_at_{distance}_m"), error.mean_m);
        add(format!("t_error_largest_m_at_{distance}_m"), error.largest_m);
    }
    for (aim, leaks) in AIMS.iter().zip(figures.leaks_per_1e8) {
        add(format!("leaks_per_1e8_{aim:?}").to_lowercase(), leaks);
    }
    all
}

fn csv(all: &[Figures]) -> String {
    let rows: Vec<Vec<(String, Value)>> = all.iter().map(columns).collect();
    let line = |cells: Vec<String>| cells.join(",") + "\n";
    let cell = |value: &Value| match value {
        Value::String(text) if text.contains(',') => format!("\"{text}\""),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    let head = rows.first().map(|row| line(row.iter().map(|(key, _)| key.clone()).collect()));
    let body = rows.iter().map(|row| line(row.iter().map(|(_, value)| cell(value)).collect()));
    head.into_iter().chain(body).collect()
}

/// The figures for people: two tables with a line for each method.
fn table(all: &[Figures], triangles: u64) -> String {
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{:<28} {:<11} {:<5} {:>5} | {:^17} | {:>7} | {:^23} | {:^29}",
        "", "", "", "bytes", "ns a test, hits", "Mrays/s", "wrong in 10⁶, aimed at", "leaks in 10⁸, aimed at"
    );
    let _ = writeln!(
        text,
        "{:<28} {:<11} {:<5} {:>5} | {:>5} {:>5} {:>5} | {:>7} | {:>7} {:>7} {:>7} | {:>9} {:>9} {:>9}",
        "kernel",
        "edges",
        "culls",
        "/tri",
        "10 %",
        "50 %",
        "90 %",
        "",
        "inside",
        "edge",
        "vertex",
        "inside",
        "edge",
        "vertex"
    );
    for f in all {
        let [a, b, c] = f.ns_per_test;
        let [wi, we, wv] = f.wrong_per_1e6;
        let [li, le, lv] = f.leaks_per_1e8;
        let _ = writeln!(
            text,
            "{:<28} {:<11} {:<5} {:>5} | {a:>5.1} {b:>5.1} {c:>5.1} | {:>7.2} | {wi:>7.0} {we:>7.0} {wv:>7.0} | {li:>9.0} {le:>9.0} {lv:>9.0}",
            name(f),
            edges(f),
            culls(f),
            bytes_per_triangle(f),
            f.mrays_per_s,
        );
    }
    let _ = writeln!(
        text,
        "\nerror of t: mean and largest, in units in the last place (ulp) of the true t as f32, and in micrometres"
    );
    let at = DISTANCES_M.map(|m| format!("| {:^33}", format!("at {m} m"))).join(" ");
    let _ = writeln!(text, "{:<28} {at}", "");
    let units = DISTANCES_M.map(|_| format!("| {:^14}   {:^16}", "ulp", "µm")).join(" ");
    let _ = writeln!(text, "{:<28} {units}", "kernel");
    for f in all {
        let errors = f.t_error.map(|e| {
            format!(
                "| {:>6.2} {:>7.1}   {:>7.2} {:>8.1}",
                e.mean_ulp,
                e.largest_ulp,
                e.mean_m * 1e6,
                e.largest_m * 1e6
            )
        });
        let _ = writeln!(text, "{:<28} {}", name(f), errors.join(" "));
    }
    let _ = writeln!(
        text,
        "\nMrays/s: whole scans of {triangles} triangles by a LiDAR, on one thread. `exact` is the default: its speed that of packets, \
         its single tests in f64.\nTimes are the least of many samples, and vary; all other figures are the same on every machine."
    );
    text
}

/// Measures how long some work takes, in seconds.
fn stopwatch(work: &mut dyn FnMut()) -> f64 {
    let start = Instant::now();
    work();
    start.elapsed().as_secs_f64()
}
