//! The drive that `beamcast init --drive` writes: the shipped job configs/street_drive.toml with all its files.

/// The paths of the shipped job's files, as the job has them, and what they are in a folder of their own.
const MOVED: [(&str, &str); 4] = [
    ("#:schema schema/job.json", "#:schema job.schema.json"),
    ("\"../scenes/", "\"scenes/"),
    ("\"street_drive/", "\""),
    ("\"../out/street_drive\"", "\"out\""),
];

const JOB: &str = include_str!("../../configs/street_drive.toml");

/// The files beside the job.
const FILES: [(&str, &[u8]); 5] = [
    ("ego.csv", include_bytes!("../../configs/street_drive/ego.csv")),
    ("scenes/drive.glb", include_bytes!("../../scenes/drive.glb")),
    ("scenes/actors/car.glb", include_bytes!("../../scenes/actors/car.glb")),
    ("scenes/actors/cyclist.glb", include_bytes!("../../scenes/actors/cyclist.glb")),
    ("scenes/actors/walker.glb", include_bytes!("../../scenes/actors/walker.glb")),
];

/// The file name of the job in [`starter_drive`].
pub const DRIVE_JOB: &str = "drive.toml";

/// A complete drive to start from: the path of each file in its folder, with forward slashes, and its content. The job is the
/// last, so that a folder with a job is complete.
pub fn starter_drive() -> Vec<(&'static str, Vec<u8>)> {
    let job = MOVED.iter().fold(JOB.to_owned(), |job, (shipped, there)| job.replace(shipped, there));
    let files = FILES.iter().map(|(path, content)| (*path, content.to_vec()));
    files.chain([(DRIVE_JOB, job.into_bytes())]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every path in the job is that of a file beside it, and every file is named.
    #[test]
    fn the_job_names_the_files_beside_it() {
        let files = starter_drive();
        let job = String::from_utf8(files.last().unwrap().1.clone()).unwrap();
        assert!(!job.contains("../") && !job.contains("street_drive/"), "{job}");
        for (path, content) in &files[..files.len() - 1] {
            assert!(job.contains(&format!("\"{path}\"")), "{path}");
            assert!(!content.is_empty());
        }
        let bytes: usize = files.iter().map(|(_, content)| content.len()).sum();
        assert!(bytes < 500_000, "{bytes} bytes in the program");
    }
}
