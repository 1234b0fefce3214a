//! `beamcast view` as users run it. The tests in tests/browser cover the rendering of the pages in a browser.

use std::fs;
use std::path::Path;
use std::process::Output;

use serde_json::Value;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn beamcast(folder: &Path, args: &[&str]) -> Output {
    super::cli::program().args(args).current_dir(folder).output().unwrap()
}

fn good(folder: &Path, args: &[&str]) -> String {
    let output = beamcast(folder, args);
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The data of each frame on a page.
fn frames(page: &str) -> Vec<Value> {
    let parts = page.split("<script type=\"application/json\">").skip(1);
    let data = parts.map(|part| serde_json::from_str(part.split("</script>").next().unwrap()).unwrap());
    // Other sections hold the rig and its map.
    data.filter(|data: &Value| data["channels"].is_array()).collect()
}

fn count(frame: &Value) -> u64 {
    frame["points"][0]["packed"]["count"].as_u64().unwrap_or_default()
}

#[test]
fn a_job_its_folder_and_its_files_show_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let job = format!("{ROOT}/configs/street_rig.toml");
    good(folder, &["scan", &job, "--out", "out", "-q"]);

    let run = frames(&good(folder, &["view", &job, "-o", "-"]));
    assert_eq!(run.len(), 3);
    let recorded = frames(&good(folder, &["view", "out", "-o", "-"]));
    // The sensors of a folder are sorted by name.
    let by_count = |frames: &[Value]| {
        let mut counts: Vec<u64> = frames.iter().map(count).collect();
        counts.sort_unstable();
        counts
    };
    assert_eq!(by_count(&recorded), by_count(&run));
    assert!(by_count(&run)[0] > 1000);
    let of_roof = |frames: &[Value]| frames.iter().find(|f| f["columns"] == 2048).unwrap().clone();
    assert_eq!(of_roof(&recorded)["channels"], of_roof(&run)["channels"], "bit for bit");
    assert_eq!(of_roof(&recorded)["instances"], of_roof(&run)["instances"]);

    // The image of a camera determines its points. The image of a LiDAR takes them from the cloud beside it.
    let camera = frames(&good(folder, &["view", "out/windscreen/000000.exr", "-o", "-"]));
    assert!(run.iter().any(|frame| count(frame) == count(&camera[0])));
    let roof = frames(&good(folder, &["view", "out/roof/000000.exr", "-o", "-"]));
    assert_eq!(count(&roof[0]), count(&of_roof(&run)));
    fs::rename(folder.join("out/roof/000000.ply"), folder.join("cloud.ply")).unwrap();
    let page = good(folder, &["view", "out/roof/000000.exr", "-o", "-"]);
    assert!(frames(&page)[0]["points"].is_null() && page.contains("does not say where its beams went"));
    let cloud = frames(&good(folder, &["view", "cloud.ply", "-o", "-"]));
    assert_eq!((count(&cloud[0]), &cloud[0]["rows"]), (count(&of_roof(&run)), &1.into()));
    let keys: Vec<_> =
        cloud[0]["channels"].as_array().unwrap().iter().map(|c| c["key"].as_str().unwrap()).collect();
    assert_eq!(keys, ["range", "intensity", "id.instance", "id.semantic", "time", "column", "ring"]);
}

#[test]
fn a_page_is_written_where_it_is_wanted_and_kept_if_it_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let job = format!("{ROOT}/configs/room_vlp16.toml");
    let first = beamcast(folder, &["view", &job]);
    assert_eq!((first.status.code(), first.stdout.len()), (Some(0), 0));
    assert!(String::from_utf8_lossy(&first.stderr).contains("wrote room_vlp16.html"));
    let page = fs::read_to_string(folder.join("room_vlp16.html")).unwrap();
    assert_eq!(page, good(folder, &["view", &job, "-o", "-"]), "the same bytes");
    assert_eq!(beamcast(folder, &["view", &job]).status.code(), Some(4));
    good(folder, &["view", &job, "--overwrite"]);
    good(folder, &["view", &job, "-o", "deeper/page.html"]);
    assert_eq!(fs::read_to_string(folder.join("deeper/page.html")).unwrap(), page);
    assert_eq!(fs::read_dir(folder).unwrap().count(), 2, "and nothing else");
}

#[test]
fn a_page_of_128_by_2048_is_small() {
    let page = good(Path::new(ROOT), &["view", "configs/street_128.toml", "-o", "-"]);
    assert!(page.len() < 6_000_000, "{} bytes", page.len());
}

#[test]
fn inputs_without_a_view_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("not.exr"), "an image").unwrap();
    fs::create_dir(folder.join("empty")).unwrap();
    let sensor = format!("{ROOT}/configs/sensors/lidar_128.toml");
    for (path, code, part) in [
        ("not.exr", 3, "this is not a range image (EXR, NPZ), a cloud (PLY, PCD, NPY, LAS, LAZ, E57)"),
        ("empty", 3, "no scan wrote it"),
        ("nowhere.ply", 3, "there is no such file"),
        ("nowhere.toml", 2, "nowhere.toml"),
        (sensor.as_str(), 2, "sees nothing without a job"),
    ] {
        let output = beamcast(folder, &["view", path]);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{message}");
        assert!(message.contains(part), "{message}");
    }
    assert_eq!(fs::read_dir(folder).unwrap().count(), 2, "nothing is left behind");
}
