//! Trajectories and poses in jobs: every form of the same drive, closed forms of what is cast on the way, and what is refused.

use std::fmt::Write as _;
use std::path::Path;

use beamcast::angle::Angle;
use beamcast::config::{self, ActorBody, InScene, Job, Owner};
use beamcast::error::Error;
use beamcast::frame::{BODY_FROM_OPTICAL, Pose};
use beamcast::motion::Trajectory;
use beamcast::run::load_scene;
use beamcast::scan::{Progress, scan};
use beamcast::sensor::{
    Beam, Capture, Limited, Pattern, Pulse, RangeLimits, RayTable, RingOrder, Rotating, Sensor, direction,
};
use beamcast::source::{Diagnostic, Severity};
use beamcast::trace::Tracer;
use glam::{DMat3, DQuat, DVec3};

use crate::shapes::{alone, quad};

/// Metres and radians a second of the drive of which all forms are tried: a circle with a radius of 30 m.
const SPEED: f64 = 15.0;
const TURN: f64 = 0.5;

const NO_LIMITS: RangeLimits = RangeLimits { min_m: 0.0, max_m: f64::INFINITY, of: Limited::Range };

/// The pose of the drive at a time, in closed form.
fn on_the_circle(time_s: f64) -> Pose {
    let (sin, cos) = libm::sincos(TURN * time_s);
    let radius = SPEED / TURN;
    let translation = DVec3::new(radius * sin, radius * (1.0 - cos), 0.0);
    Pose {
        rotation: DMat3::from_cols(DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0), DVec3::Z),
        translation,
    }
}

/// A job with a sensor of 10 Hz and these lines besides, in a folder with these files.
fn job(lines: &str, files: &[(&str, String)]) -> Result<Job, Vec<Diagnostic>> {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in files {
        std::fs::write(folder.path().join(name), content).unwrap();
    }
    let text = format!(
        "scene = \"room.glb\"\n[output]\ndir = \"out\"\n{lines}\n[[sensor]]\nname = \"top\"\npose = {{}}\n[sensor.rotating]\n\
         elevations_deg = [0.0]\ncolumns = 100\nrate_hz = 10.0\n"
    );
    let path = folder.path().join("job.toml");
    std::fs::write(&path, text).unwrap();
    config::load_job(&path, &[]).map_err(|error| match error {
        Error::Config(found) => found,
        other => panic!("{other}"),
    })
}

/// The first error of a job that is refused.
fn refused(lines: &str, files: &[(&str, String)]) -> String {
    let found = job(lines, files).expect_err("it was taken");
    found.into_iter().find(|d| d.severity == Severity::Error).unwrap().to_string()
}

fn table(rows: impl IntoIterator<Item = (f64, Pose)>, separator: &str) -> String {
    let mut text = String::new();
    for (time, Pose { rotation, translation: t }) in rows {
        let q = DQuat::from_mat3(&rotation);
        let values = [time, t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(|x| format!("{x:?}"));
        writeln!(text, "{}", values.join(separator)).unwrap();
    }
    text
}

fn csv(rows: impl IntoIterator<Item = (f64, Pose)>) -> String {
    format!("t_s,x_m,y_m,z_m,qx,qy,qz,qw\n{}", table(rows, ","))
}

fn drive(step_s: f64) -> Vec<(f64, Pose)> {
    (0..=20).map(|k| (f64::from(k) * step_s, on_the_circle(f64::from(k) * step_s))).collect()
}

/// KITTI's rows of a drive, in the axes of a camera that looks forward.
fn kitti(rows: &[(f64, Pose)]) -> String {
    let mut text = String::new();
    for (_, pose) in rows {
        let Pose { rotation: r, translation: t } = BODY_FROM_OPTICAL.inverse() * *pose * BODY_FROM_OPTICAL;
        let rows = [r.row(0).extend(t.x), r.row(1).extend(t.y), r.row(2).extend(t.z)];
        let values = rows.map(|row| row.to_array().map(|x| format!("{x:?}")).join(" "));
        writeln!(text, "{}", values.join(" ")).unwrap();
    }
    text
}

fn inline(rows: &[(f64, Pose)]) -> String {
    let pose = |(time, pose): &(f64, Pose)| {
        let (t, q) = (pose.translation, DQuat::from_mat3(&pose.rotation).to_array());
        format!("{{ t_s = {time:?}, position_m = {:?}, quaternion_xyzw = {q:?} }}", t.to_array())
    };
    format!("[trajectory]\nposes = [{}]", rows.iter().map(pose).collect::<Vec<_>>().join(", "))
}

/// The greatest distance of a job's body from the drive, in metres.
fn deviation(job: &Job) -> f64 {
    let off = |k: i32| {
        let time = f64::from(k) * 1e-3;
        (job.trajectory.pose_at(time).translation - on_the_circle(time).translation).length()
    };
    (0..=2000).map(off).fold(0.0, f64::max)
}

/// The ranges of three pulses that are cast on the drive beside the wall y = 10.
fn ranges(trajectory: &Trajectory) -> [f64; 3] {
    let wall = [(-1e3, -1e3), (1e3, -1e3), (1e3, 1e3), (-1e3, 1e3)].map(|(x, z)| DVec3::new(x, 10.0, z));
    let pulse = |(time_s, azimuth): (f64, f64)| {
        Pulse::new(DVec3::ZERO, direction(Angle::deg(azimuth), Angle::default()), time_s)
    };
    let pulses = [(0.05, 90.0), (0.1, 60.0), (0.1, 120.0)].map(pulse).to_vec();
    let pattern = Pattern::Rays(RayTable::new(pulses, Some(10.0)).unwrap());
    let sensor = Sensor { pattern, range: NO_LIMITS, ring: RingOrder::Row, measurement: Default::default() };
    let capture = Capture::new(&sensor, Pose::IDENTITY, trajectory, 0, 0);
    let scene = alone(quad(wall));
    let frame = scan(&scene, &Tracer::build(&scene), &capture, &Progress::default()).unwrap();
    [0, 1, 2].map(|column| frame.get(0, column).unwrap().range_m)
}

/// One drive as CSV, TUM, KITTI, a list and a twist is the same, and pulses hit where the closed form says.
#[test]
fn a_drive_is_the_same_in_every_form() {
    let rows = drive(0.1);
    let shuffled = {
        let text = csv(rows.clone());
        let mut lines = text.lines().map(|line| line.split(',').rev().collect::<Vec<_>>().join(", "));
        format!("# a comment\r\n\r\n{}\r\n", lines.by_ref().collect::<Vec<_>>().join("\r\n"))
    };
    let times: String = rows.iter().map(|(time, _)| format!("{time:?}\n")).collect();
    for (lines, files) in [
        ("[trajectory]\nfile = \"drive.csv\"".to_owned(), vec![("drive.csv", csv(rows.clone()))]),
        ("[trajectory]\nfile = \"drive.csv\"".to_owned(), vec![("drive.csv", shuffled)]),
        (
            "[trajectory]\nfile = \"drive.tum\"".to_owned(),
            vec![("drive.tum", format!("# t x y z q\n{}", table(rows.clone(), " ")))],
        ),
        ("[trajectory]\nfile = \"drive.txt\"".to_owned(), vec![("drive.txt", table(rows.clone(), "  "))]),
        (
            "[trajectory]\nfile = \"drive.kitti\"\nrate_hz = 10.0".to_owned(),
            vec![("drive.kitti", kitti(&rows))],
        ),
        (
            "[trajectory]\nfile = \"drive.txt\"\ntimes = \"times.txt\"".to_owned(),
            vec![("drive.txt", kitti(&rows)), ("times.txt", times)],
        ),
        (inline(&rows), vec![]),
        (
            "[trajectory]\ntwist = { linear_m_s = [15, 0, 0], angular_deg_s = [0, 0, 28.64788975654116] }"
                .to_owned(),
            vec![],
        ),
    ] {
        let job = job(&lines, &files).unwrap_or_else(|found| panic!("{lines}: {found:?}"));
        assert!(job.warnings.is_empty(), "{lines}: {:?}", job.warnings);
        assert_eq!(job.inputs.len(), 1 + files.len());
        // Poses to 60 m are written with all digits of f64, and a relative motion of two has their ulps, 7e-15.
        assert!(deviation(&job) < 1e-12, "{lines}: {}", deviation(&job));
        for (range, expected) in
            ranges(&job.trajectory).into_iter().zip([9.993748372, 11.194675745, 11.860784744])
        {
            assert!((range - expected).abs() < 1e-9, "{lines}: {range} {expected}");
        }
    }
}

/// Going straight from pose to pose is off by v·ω·h²/8, which is told, and at ten times the rate it isn't.
#[test]
fn going_straight_is_told_by_how_much_it_errs() {
    let lines = "[trajectory]\nfile = \"drive.csv\"\ninterpolation = \"linear\"";
    for (step, is_told) in [(0.1, true), (0.01, false)] {
        let job = job(lines, &[("drive.csv", csv(drive(step)))]).unwrap();
        let bound = job.trajectory.interpolation_error_bound().unwrap().most_m;
        // The chord, by which the speed is measured, is shorter than the arc by (ωh)²/24.
        assert!((bound / (SPEED * TURN * step * step / 8.0) - 1.0).abs() < 1.1e-4, "{bound}");
        let told = job.warnings.iter().filter(|warning| warning.code == "pose-spacing").count();
        assert_eq!(told == 1, is_told, "{:?}", job.warnings);
        if is_told {
            assert!(deviation(&job) <= bound * 1.0002 && deviation(&job) > 0.99 * bound);
            assert!(job.warnings[0].to_string().contains("9.4 mm"), "{}", job.warnings[0]);
        }
    }
}

/// A body that speeds up, from a table: between poses it is off by at most a·h²/8, at the poses not at all.
#[test]
fn a_table_of_a_body_that_speeds_up_is_off_by_what_is_told() {
    let (a, h) = (4.0, 0.1);
    let x = |time: f64| 0.5 * a * time * time;
    let at = |time: f64| Pose { translation: DVec3::new(x(time), 0.0, 0.0), ..Pose::IDENTITY };
    let rows = (0..=10).map(|k| (f64::from(k) * h, at(f64::from(k) * h)));
    let job = job("[trajectory]\nfile = \"drive.csv\"", &[("drive.csv", csv(rows))]).unwrap();
    assert!(job.warnings.iter().any(|warning| warning.code == "pose-spacing"), "{:?}", job.warnings);
    let wall = [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)].map(|(y, z)| DVec3::new(64.0, y, z));
    let scene = alone(quad(wall));
    let pulses = (0..=100).map(|k| Pulse::new(DVec3::ZERO, DVec3::X, f64::from(k) * 0.01)).collect();
    let pattern = Pattern::Rays(RayTable::new(pulses, Some(0.5)).unwrap());
    let sensor = Sensor { pattern, range: NO_LIMITS, ring: RingOrder::Row, measurement: Default::default() };
    let capture = Capture::new(&sensor, Pose::IDENTITY, &job.trajectory, 0, 0);
    let frame = scan(&scene, &Tracer::build(&scene), &capture, &Progress::default()).unwrap();
    let bound = a * h * h / 8.0;
    let mut most = 0.0_f64;
    for k in 0..=100 {
        let off = (frame.get(0, k).unwrap().range_m - (64.0 - x(k as f64 * 0.01))).abs();
        assert!(off <= bound + 1e-9, "{k}: {off}");
        if k % 10 == 0 {
            assert!(off < 1e-9, "{k}: {off}");
        }
        most = most.max(off);
    }
    assert!(most > 0.999 * bound, "{most}");
}

/// Every point of a plane that is passed at a constant twist is where the closed form says: a LiDAR turns once while its body
/// goes round a bend, and the ray of each pulse is intersected with the plane by hand.
#[test]
fn a_plane_passed_at_a_constant_twist() {
    let beam = |i: i32| Beam {
        elevation: Angle::deg(f64::from(i) * 4.0 - 14.0),
        azimuth_offset: Angle::default(),
        time_s: f64::from(i) * 2e-6,
        file_index: 0,
    };
    let turn = (Angle::deg(180.0), Angle::deg(-180.0));
    let pattern = Rotating::new((0..8).map(beam).collect(), 180, turn, 10.0).unwrap();
    let sensor = Sensor {
        pattern: Pattern::Rotating(pattern),
        range: NO_LIMITS,
        ring: RingOrder::Row,
        measurement: Default::default(),
    };
    // The plane 0.6·x + 0.8·y = 16 about (12, 11, 0), to 640 m along it and 512 m up: its corners are whole numbers.
    let (middle, along) = (DVec3::new(12.0, 11.0, 0.0), DVec3::new(-512.0, 384.0, 0.0));
    let corner = |(u, z): (f64, f64)| middle + along * u + DVec3::Z * (512.0 * z);
    let scene = alone(quad([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(corner)));
    let rows = drive(0.1);
    let job = job("[trajectory]\nfile = \"drive.csv\"", &[("drive.csv", csv(rows))]).unwrap();
    for number in [0, 7] {
        let capture = Capture::new(&sensor, Pose::IDENTITY, &job.trajectory, number, 0);
        let frame = scan(&scene, &Tracer::build(&scene), &capture, &Progress::default()).unwrap();
        let mut seen = 0;
        for row in 0..8 {
            for column in 0..180 {
                let pulse = capture.pulse(row, column).unwrap();
                let body = on_the_circle(number as f64 * 0.1 + pulse.time_s);
                let ray = body.direction(pulse.direction);
                let normal = DVec3::new(0.6, 0.8, 0.0);
                let range_m = (16.0 - normal.dot(body.translation)) / normal.dot(ray);
                let Some(found) = frame.get(row, column) else {
                    let point = body.translation + ray * range_m - middle;
                    let part = point.dot(along) / along.length_squared();
                    assert!(range_m < 0.0 || part.abs() > 0.9999 || point.z.abs() > 511.9, "{row}, {column}");
                    continue;
                };
                // No vertex is rounded: what is left is 1e-9 m of f64 at right angles to the plane.
                let off = (found.range_m - range_m) * normal.dot(ray);
                assert!(off.abs() < 1e-9, "{row}, {column}: {} {range_m}", found.range_m);
                seen += 1;
            }
        }
        assert!(seen > 600, "{seen}");
    }
}

/// Frames beyond the poses are refused, with those that would do, and these do.
#[test]
fn frames_beyond_the_poses_are_refused_with_those_that_would_do() {
    let files = [("drive.csv", csv(drive(0.1).into_iter().map(|(time, pose)| (time + 5.0, pose))))];
    let lines = |start: &str, frames: u32| {
        format!("[sequence]\nstart_s = {start}\nframes = {frames}\n[trajectory]\nfile = \"drive.csv\"")
    };
    // Poses from 5 s to 7 s; a frame has its last column after 0.099 s.
    assert!(job(&lines("5.0", 20), &files).is_ok());
    assert!(job(&lines("6.9", 1), &files).is_ok());
    for (start, frames, good_start, good_frames) in [
        ("0.0", 1, "5.0", 1),
        ("0.0", 100, "5.0", 20),
        ("5.0", 21, "5.0", 20),
        ("6.5", 20, "6.5", 5),
        ("6.95", 1, "5.0", 1),
    ] {
        let said = refused(&lines(start, frames), &files);
        assert!(said.contains("and the poses from 5 s to 7 s"), "{said}");
        assert!(said.contains(&format!("`start_s = {good_start}` and `frames = {good_frames}`")), "{said}");
        assert!(job(&lines(good_start, good_frames), &files).is_ok());
    }
    // Poses over 0.04 s are not enough for a frame.
    let said = refused("[trajectory]\nfile = \"drive.csv\"", &[("drive.csv", csv(drive(0.002)))]);
    assert!(said.contains("a frame takes 0.099 s"), "{said}");
    // Frozen, a frame has one time.
    let frozen = "[sequence]\nstart_s = 7.0\nmotion = \"frozen\"\n[trajectory]\nfile = \"drive.csv\"";
    assert!(job(frozen, &files).is_ok());
}

/// The same pose as angles, a quaternion, a matrix, a target, and as renderers and vision libraries write it.
#[test]
fn a_pose_is_the_same_in_every_form() {
    let expected =
        Pose::from_rpy(DVec3::new(1.0, 2.0, 3.0), Angle::default(), Angle::deg(20.0), Angle::deg(120.0));
    let rows = |pose: Pose| {
        let (r, t) = (pose.rotation, pose.translation);
        let row = |i: usize| format!("{:?}", r.row(i).extend(t[i]).to_array());
        format!("[{}, {}, {}, [0.0, 0.0, 0.0, 1.0]]", row(0), row(1), row(2))
    };
    let quaternion = DQuat::from_mat3(&expected.rotation).to_array();
    let target = expected.point(DVec3::new(7.0, 0.0, 0.0)).to_array();
    let opencv = (expected * BODY_FROM_OPTICAL).inverse();
    let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let optical = expected * BODY_FROM_OPTICAL;
    let opengl = Pose { rotation: optical.rotation * flip, ..optical };
    for form in [
        "position_m = [1, 2, 3], rpy_deg = [0, 20, 120]".to_owned(),
        format!("position_m = [1, 2, 3], quaternion_xyzw = {quaternion:?}"),
        format!("position_m = [1, 2, 3], look_at_m = {target:?}"),
        format!("matrix = {}", rows(expected)),
        format!("matrix = {}, convention = \"opencv\"", rows(opencv)),
        format!("matrix = {}, convention = \"opengl\"", rows(opengl)),
    ] {
        let job = job(&format!("[trajectory]\npose = {{ {form} }}"), &[])
            .unwrap_or_else(|found| panic!("{form}: {found:?}"));
        let pose = job.trajectory.fixed_pose().unwrap();
        assert!(pose.translation.abs_diff_eq(expected.translation, 1e-14), "{form}");
        assert!(
            (pose.rotation - expected.rotation).to_cols_array().iter().all(|e| e.abs() < 1e-15),
            "{form}"
        );
        assert!(job.warnings.is_empty(), "{form}: {:?}", job.warnings);
    }
}

#[test]
fn what_is_no_trajectory_is_refused_at_its_place() {
    let row = "0,0,0,0,0,0,0,1\n";
    let header = "t_s,x_m,y_m,z_m,qx,qy,qz,qw\n";
    let of_csv = |content: &str| refused("[trajectory]\nfile = \"a.csv\"", &[("a.csv", content.to_owned())]);
    for (content, expected) in [
        (String::new(), "a.csv: the file of poses is empty"),
        (header.to_owned(), "a.csv:1:1: the file has no poses"),
        (format!("{header}{row}{row}"), "a.csv:3:1: `t_s` is 0, and the pose before has 0"),
        (format!("{header}0,0,0,0,0,0,0\n"), "a.csv:2:1: the line has 7 values"),
        (format!("{header}0,0,0,0,0,0,0,1,9\n"), "a.csv:2:17: the line has more than 8 values"),
        (format!("{header}0,nan,0,0,0,0,0,1\n"), "a.csv:2:3: `x_m` is `nan`"),
        (format!("{header}0,0,inf,0,0,0,0,1\n"), "a.csv:2:5: `y_m` is `inf`"),
        (format!("{header}0,0,0,0,0,0,0,0.5\n"), "a.csv:2:1: a quaternion of length 0.5"),
        (format!("{header}0,0,0,0,0,0,0,0\n"), "a.csv:2:1: a quaternion of length 0"),
        ("t_s,x_m,y_m,z_m,qx,qy,qz\n".to_owned(), "a.csv:1:1: the header lacks `qw`"),
        ("t_s,x_m,y_m,z_m,qx,qy,qz,qz\n".to_owned(), "a.csv:1:26: the column `qz` is there twice"),
        ("time,x_m,y_m,z_m,qx,qy,qz,qw\n".to_owned(), "a.csv:1:1: unknown column `time`"),
    ] {
        let said = of_csv(&content);
        assert!(said.contains(expected), "{said}\nfor {expected}");
    }
    let kitti_row = "1 0 0 0 0 1 0 0 0 0 1 0\n".to_owned();
    let scaled = "2 0 0 0 0 2 0 0 0 0 2 0\n".to_owned();
    let in_kitti = |more: &str| format!("[trajectory]\nfile = \"a.kitti\"\n{more}");
    for (lines, files, expected) in [
        (in_kitti(""), vec![("a.kitti", kitti_row.clone())], "KITTI's poses have no times"),
        (in_kitti("rate_hz = 1.0"), vec![("a.kitti", scaled)], "a.kitti:1:1: this matrix scales by 2"),
        (in_kitti("rate_hz = 1.0"), vec![("a.kitti", "1 0 0\n".to_owned())], "a.kitti:1:1: the line has 3 values"),
        (
            in_kitti("times = \"t\""),
            vec![("a.kitti", kitti_row.repeat(2)), ("t", "0\n".to_owned())],
            "t:1:1: there are 1 times for 2 poses",
        ),
        (
            in_kitti("times = \"t\""),
            vec![("a.kitti", kitti_row.clone()), ("t", "0\n1\n".to_owned())],
            "t:2:1: there are more times than poses",
        ),
        (in_kitti("times = \"t\"\nrate_hz = 1.0"), vec![("a.kitti", kitti_row), ("t", "0\n".to_owned())], "both"),
        ("[trajectory]\nfile = \"none.csv\"".to_owned(), vec![], "the file of poses `none.csv` can't be used"),
        ("[trajectory]\nfile = \"a.bag\"".to_owned(), vec![("a.bag", "x y\n".to_owned())], "no file of poses that is known"),
        ("[trajectory]\ntwist = {}\nposes = [{ t_s = 0.0 }]".to_owned(), vec![], "has `poses` or `twist`"),
        ("[trajectory]\nnode = \"car\"\ntwist = {}".to_owned(), vec![], "has `twist`, too"),
        ("[trajectory]\nposes = []".to_owned(), vec![], "poses"),
        ("[trajectory]\nposes = [{ t_s = 1.0 }, { t_s = 1.0 }]".to_owned(), vec![], "the pose before has 1"),
        ("[trajectory]\npose = {}\nrate_hz = 3.0".to_owned(), vec![], "says nothing without `file`"),
        ("[trajectory]\npose = { matrix = [[1, 0, 0], [0, 1, 0], [0, 0, 1]] }".to_owned(), vec![], "the fourth row"),
        (
            "[trajectory]\npose = { look_at_m = [0, 0, 5] }".to_owned(),
            vec![],
            "the target is straight above or below",
        ),
        ("[trajectory]\npose = { up = [0, 0, 5] }".to_owned(), vec![], "nothing to look at"),
        ("[trajectory]\npose = { camera = \"c\", position_m = [0, 0, 5] }".to_owned(), vec![], "has a pose of its own"),
        ("[[actor]]\nname = \"a\"\ntrajectory = {}".to_owned(), vec![], "has nothing that moves"),
        ("[[actor]]\nname = \"a\"\nscene = \"a.glb\"\nnode = \"b\"\ntrajectory = {}".to_owned(), vec![], "this has both"),
        (
            "[[actor]]\nname = \"a\"\nnode = \"a\"\ntrajectory = {}\n[[actor]]\nname = \"a\"\nnode = \"b\"\ntrajectory = {}".to_owned(),
            vec![],
            "two actors are called `a`",
        ),
    ] {
        let said = refused(&lines, &files);
        assert!(said.contains(expected), "{said}\nfor {expected}");
    }
}

/// Quaternions with w first turn a body upside down, which is told once.
#[test]
fn quaternions_with_w_first_are_told() {
    let swapped = drive(0.1).into_iter().map(|(time, pose)| {
        let q = DQuat::from_mat3(&pose.rotation);
        let wrong = DQuat::from_xyzw(q.w, q.x, q.y, q.z);
        (time, Pose { rotation: DMat3::from_quat(wrong), ..pose })
    });
    let rows: Vec<_> = swapped.collect();
    let job = job("[trajectory]\nfile = \"a.csv\"", &[("a.csv", csv(rows))]).unwrap();
    let told: Vec<_> = job.warnings.iter().filter(|warning| warning.code == "quaternion-order").collect();
    assert_eq!(told.len(), 1, "{:?}", job.warnings);
    assert!(told[0].to_string().contains("qw,qx,qy,qz"), "{}", told[0]);
}

/// Places that the scene decides are asked for by name, and an answer goes where it belongs.
#[test]
fn the_scene_is_asked_for_places() {
    let job = job(
        "[trajectory]\nnode = \"car\"\n[[actor]]\nname = \"van\"\nscene = \"van.glb\"\nlabel = 4\n\
         trajectory = { twist = { linear_m_s = [1, 0, 0] } }\n\
         [animation]\nclips = [\"walk\"]\nloop = true\nstart_s = 2.0",
        &[],
    )
    .unwrap();
    let actor = &job.actors[0];
    assert_eq!((actor.name.as_str(), actor.label), ("van", Some(4)));
    assert!(
        matches!(&actor.body, ActorBody::File { path, as_written } if path.ends_with("van.glb") && as_written == "van.glb")
    );
    assert_eq!(actor.trajectory.pose_at(2.0).translation, DVec3::new(2.0, 0.0, 0.0));
    let clips = job.animation.clips.as_ref().unwrap();
    assert_eq!((clips[0].0.as_str(), job.animation.is_looped, job.animation.start_s), ("walk", true, 2.0));
    assert_eq!(job.from_scene[0].wanted, InScene::Node("car".to_owned()));
}

/// The body and the sensor stand where a node and a camera of the scene do, the actor moves, and a name that is not there is an
/// error with the names that are.
#[test]
fn what_the_scene_is_asked_for_is_put_in_place() {
    let corners: Vec<u8> =
        [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|c| c.to_le_bytes()).collect();
    let scene = serde_json::json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "uri": "corners.bin", "byteLength": 36 }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }],
        "nodes": [
            { "name": "wall", "mesh": 0 },
            { "name": "car", "mesh": 0, "translation": [1.0, 2.0, -3.0] },
            { "name": "eye", "camera": 0, "translation": [0.0, 5.0, 0.0] }
        ],
        "scenes": [{ "nodes": [0, 1, 2] }]
    });
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("corners.bin"), corners).unwrap();
    std::fs::write(folder.path().join("scene.gltf"), scene.to_string()).unwrap();
    let load = |pose: &str, lines: &str| {
        let path = folder.path().join("job.toml");
        let text = format!(
            "scene = \"scene.gltf\"\n[output]\ndir = \"out\"\n{lines}\n[[sensor]]\n{pose}\n\
             [sensor.pinhole]\nwidth_px = 4\nheight_px = 3\nhfov_deg = 90.0\n"
        );
        std::fs::write(&path, text).unwrap();
        let mut job = config::load_job(&path, &[]).unwrap();
        load_scene(&mut job, &[]).map(|loaded| (job, loaded.scene))
    };
    let (job, _) = load("", "[trajectory]\nnode = \"car\"").unwrap();
    // glTF's (x, y, z) is (x, −z, y) in the world.
    let at_car = Pose { translation: DVec3::new(1.0, 3.0, 2.0), ..Pose::IDENTITY };
    assert_eq!((job.trajectory.fixed_pose(), job.from_scene.len()), (Some(at_car), 0));

    let (job, _) = load("pose = { camera = \"eye\" }", "").unwrap();
    let pose = job.sensors[0].body_from_sensor;
    assert_eq!(pose.translation, DVec3::new(0.0, 0.0, 5.0));
    // It looks along glTF's −z, which is the world's y.
    assert!(pose.direction(DVec3::X).abs_diff_eq(DVec3::Y, 1e-15), "{pose:?}");

    let actor = "[[actor]]\nname = \"van\"\nnode = \"car\"\nlabel = 4\n\
                 trajectory = { twist = { linear_m_s = [2, 0, 0] } }";
    let (_, scene) = load("", actor).unwrap();
    let mover = &scene.geometry.movers[0];
    assert_eq!(scene.geometry.groups[0].name, "van");
    let at = mover.motion.at(1.5).unwrap();
    assert!(at.translation.abs_diff_eq(DVec3::new(3.0, 0.0, 0.0), 1e-12), "{at:?}");

    let error = load("", "[trajectory]\nnode = \"cart\"").unwrap_err();
    let beamcast::error::Error::Scene(error) = error else { panic!("{error}") };
    assert!(error.problem.contains("no node called"), "{error:?}");
    assert!(error.help.as_ref().is_some_and(|help| help.contains("did you mean \"car\"?")), "{error:?}");
}

#[test]
fn a_sensor_stands_where_a_camera_of_the_scene_does() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("job.toml");
    let text = |more: &str| {
        format!(
            "scene = \"room.glb\"\n[output]\ndir = \"out\"\n{more}\n[[sensor]]\npose = {{ camera = \"Cam\" }}\n\
             [sensor.pinhole]\nwidth_px = 4\nheight_px = 3\nhfov_deg = 90.0\n"
        )
    };
    let load = |path: &Path, text: String| {
        std::fs::write(path, text).unwrap();
        config::load_job(path, &[])
    };
    let job = load(&path, text("")).unwrap();
    assert_eq!(
        (job.from_scene[0].owner, &job.from_scene[0].wanted),
        (Owner::Sensor(0), &InScene::Camera("Cam".to_owned()))
    );
    assert!(
        load(&path, text("[trajectory]\npose = {}")).unwrap_err().to_string().contains("stands in the world")
    );
}
