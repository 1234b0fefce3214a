//! Cameras' intrinsics in the dialects that users have.

use std::path::Path;

use beamcast::import::{Format, Source, import, import_camera};
use beamcast::sensor::{Camera, Lens, Pattern};

use super::{imported, sensor, toml};

fn camera(text: &str) -> Camera {
    match imported(text).pattern {
        Pattern::Camera(camera) => camera,
        other => panic!("no camera: {other:?}"),
    }
}

/// Width, height, focal lengths and principal point.
fn numbers(camera: &Camera) -> [f64; 6] {
    let ([fx, fy], (cx, cy)) = (focal(camera), camera.principal_px());
    [camera.width() as f64, camera.height() as f64, fx, fy, cx, cy]
}

/// The focal lengths, by the directions one pixel from the principal point.
fn focal(camera: &Camera) -> [f64; 2] {
    let (cx, cy) = camera.principal_px();
    let right = camera.optical_direction_at(cx + 1.0, cy).unwrap();
    let down = camera.optical_direction_at(cx, cy + 1.0).unwrap();
    [right.z / right.x, down.z / down.y].map(|f| (f * 1e6).round() / 1e6)
}

fn kalibr(model: &str, intrinsics: &str, distortion: &str, coefficients: &str) -> String {
    format!(
        "cam0:\n  camera_model: {model}\n  intrinsics: [{intrinsics}]\n  distortion_model: {distortion}\n  \
         distortion_coeffs: [{coefficients}]\n  resolution: [640, 480]\n  rostopic: /cam0\n"
    )
}

fn realsense(model: &str, coefficients: &str) -> String {
    format!(
        "{{\"width\": 640, \"height\": 480, \"fx\": 525.0, \"fy\": 524.0, \"ppx\": 319.5, \"ppy\": 239.5, \
         \"model\": {model}, \"coeffs\": [{coefficients}]}}"
    )
}

/// The case camera_json_and_kalibr and its neighbours: the same camera, as six tools write it. All count pixels from the middle
/// of the first, so that half a pixel is added.
#[test]
fn every_dialect_gives_the_same_camera() {
    let open3d =
        "\"width\": 640, \"height\": 480, \"intrinsic_matrix\": [525.0, 0, 0, 0, 524.0, 0, 319.5, 239.5, 1]";
    let rows = "\"width\": 640, \"height\": 480, \"intrinsic_matrix\": [[525.0, 0, 319.5], [0, 524.0, 239.5], [0, 0, 1]]";
    let parameters = "{\"class_name\": \"PinholeCameraParameters\", \"extrinsic\": [1.0], \"intrinsic\": ";
    let kalibr_0 = kalibr("pinhole", "525, 524, 319.5, 239.5", "radtan", "0.0, 0, 0, 0");
    for text in [
        format!("{{{open3d}}}"),
        format!("{{\"color_format\": \"rgb8\", \"depth_scale\": 1000.0, \"fps\": 30, {open3d}}}"),
        format!(
            "{{{}}}",
            open3d.replace("0, 0, 0, 524.0, 0, 319.5, 239.5, 1", "0, 319.5, 0, 524.0, 239.5, 0, 0, 1")
        ),
        format!("{{{rows}}}"),
        format!("{parameters}{{{open3d}}}}}"),
        realsense("\"Brown Conrady\"", "0, 0, 0, 0, 0"),
        realsense("\"Inverse Brown Conrady\"", "0.0, 0, 0, 0, 0"),
        realsense("\"distortion.none\"", ""),
        realsense("4", "0, 0, 0, 0, 0"),
        format!("{{\"depth\": {}}}", realsense("\"None\"", "")),
        kalibr_0.clone(),
        kalibr_0.replace("pinhole", "pinhole-radtan").replace("  distortion_model: radtan\n", ""),
        // A camera file of Kalibr's, without the name of a camera.
        kalibr_0.replace("cam0:\n", "").replace("\n  ", "\n").trim_start().to_owned(),
        "{\"height\": 480, \"width\": 640, \"distortion_model\": \"plumb_bob\", \"D\": [0, 0, 0, 0, 0], \
         \"K\": [525.0, 0, 319.5, 0, 524.0, 239.5, 0, 0, 1], \"binning_x\": 0, \"binning_y\": 0, \
         \"roi\": {\"x_offset\": 0, \"y_offset\": 0, \"height\": 0, \"width\": 0, \"do_rectify\": false}}"
            .to_owned(),
    ] {
        let camera = camera(&text);
        assert_eq!(numbers(&camera), [640.0, 480.0, 525.0, 524.0, 320.0, 240.0], "{text}");
        assert_eq!(*camera.lens(), Lens::Ideal, "{text}");
    }
}

#[test]
fn lenses_are_taken_where_the_formula_is_the_same() {
    for (text, is_fisheye, coefficients) in [
        (
            kalibr("pinhole", "5e2, 5e2, 320, 240", "radtan", "-0.3, 0.1, 1e-4, 2e-4"),
            false,
            vec![-0.3, 0.1, 1e-4, 2e-4],
        ),
        (
            kalibr("pinhole", "5e2, 5e2, 320, 240", "equidistant", "0.1, 0.2, 0.3, 0.4"),
            true,
            vec![0.1, 0.2, 0.3, 0.4],
        ),
        (
            kalibr("pinhole-equi", "5e2, 5e2, 320, 240", "equi", "0.1, 0.2, 0.3, 0.4"),
            true,
            vec![0.1, 0.2, 0.3, 0.4],
        ),
        (
            realsense("\"Brown Conrady\"", "0.1, -0.2, 0.001, 0.002, 0.05"),
            false,
            vec![0.1, -0.2, 1e-3, 2e-3, 0.05],
        ),
        (
            realsense("\"RS2_DISTORTION_MODIFIED_BROWN_CONRADY\"", "0.1, -0.2, 0, 0, 0.05"),
            false,
            vec![0.1, -0.2, 0.0, 0.0, 0.05],
        ),
        (realsense("\"Kannala Brandt4\"", "0.1, 0.2, 0.3, 0.4, 0"), true, vec![0.1, 0.2, 0.3, 0.4]),
    ] {
        let camera = camera(&text);
        assert_eq!(matches!(camera.lens(), Lens::KannalaBrandt(_)), is_fisheye, "{text}");
        let mut found = camera.lens().coefficients();
        found.truncate(coefficients.len());
        assert_eq!(found, coefficients, "{text}");
    }
}

/// A quantity that cannot be known is refused with its reason, and a camera never hears of a LiDAR's keys.
#[test]
fn other_models_are_refused_with_a_reason() {
    let pinhole = "5e2, 5e2, 320, 240";
    for (text, message) in [
        (
            kalibr("omni", "1.9, 5e2, 5e2, 320, 240", "radtan", "0, 0, 0, 0"),
            "the camera model is `omni`: the omnidirectional model has a mirror's parameter xi, which no lens of beamcast has",
        ),
        (
            kalibr("ds", "1, 0.5, 5e2, 5e2, 320, 240", "none", ""),
            "the camera model is `ds`: no lens of beamcast is a double sphere (xi, alpha)",
        ),
        (
            kalibr("eucm", "1, 0.5, 5e2, 5e2, 320, 240", "none", ""),
            "the camera model is `eucm`: no lens of beamcast is the extended unified model (alpha, beta)",
        ),
        (
            kalibr("pinhole", pinhole, "fov", "0.9"),
            "the distortion model is `fov`, which no lens of beamcast has",
        ),
        (kalibr("pinhole", pinhole, "radtan", "0.9"), "`cam0.distortion_coeffs` has 1 numbers"),
        (
            kalibr("pinhole", "5e2, 5e2, 320", "radtan", "0, 0, 0, 0"),
            "`cam0.intrinsics` has not four numbers",
        ),
        (
            kalibr("pinhole", "0, 5e2, 320, 240", "radtan", "0, 0, 0, 0"),
            "the focal lengths are 0 and 500 pixels",
        ),
        (
            kalibr("pinhole", pinhole, "radtan", "0, 0, 0, 0").replace("[640, 480]", "[640]"),
            "`cam0.resolution` is no size of an image",
        ),
        (
            realsense("\"Inverse Brown Conrady\"", "0.1, 0, 0, 0, 0"),
            "the distortion model is `Inverse Brown Conrady`: its coefficients take pixels to directions, and those of beamcast's lenses directions to pixels",
        ),
        (
            realsense("1", "0.1, 0, 0.01, 0, 0"),
            "the distortion model is `1`: its tangential coefficients act on points that are distorted already, and OpenCV's do not",
        ),
        (
            realsense("\"F-Theta\"", "0.1, 0, 0, 0, 0"),
            "the distortion model is `F-Theta`: no lens of beamcast has this formula",
        ),
        (
            realsense("\"None\"", "0.1, 0, 0, 0, 0"),
            "the distortion model is `None`: the coefficients are not 0",
        ),
        (realsense("\"mei\"", "0, 0, 0, 0, 0"), "the distortion model `mei` is unknown"),
        (
            "{\"width\": 640, \"height\": 480, \"intrinsic_matrix\": [1, 2, 3]}".to_owned(),
            "`intrinsic_matrix` has 3 numbers",
        ),
        (
            "{\"width\": 640, \"height\": 480, \"intrinsic_matrix\": [500, 1, 0, 0, 500, 0, 320, 240, 1]}"
                .to_owned(),
            "`intrinsic_matrix` is no matrix of a pinhole camera",
        ),
        (
            "{\"width\": 640, \"fx\": 500, \"fy\": 500, \"ppx\": 1, \"ppy\": 1}".to_owned(),
            "the file has no `height`",
        ),
    ] {
        let found = toml(&text, None).expect_err(&text);
        assert_eq!(found[0].message, message, "{text}");
        for diagnostic in &found {
            assert!(!format!("{diagnostic:?}").replace(&text, "").contains("beam_"), "{diagnostic:?}");
        }
    }
    // A format that the user names is not that of the file.
    let found =
        import(Format::Camera, Source { name: "x.json", text: "{\"a\": {\"b\": 1}}" }, None).unwrap_err();
    assert_eq!(found[0].message, "the file has no camera's intrinsics");
    assert_eq!(found[0].path, Path::new("x.json"));
}

#[test]
fn one_camera_of_several_is_taken_and_named() {
    let second = kalibr("pinhole", "400, 400, 100, 50", "none", "").replace("cam0", "cam1");
    let both = kalibr("pinhole", "5e2, 5e2, 320, 240", "radtan", "0, 0, 0, 0") + &second;
    let source = Source { name: "camchain.yaml", text: &both };
    let first = import(Format::Camera, source, None).unwrap();
    assert!(
        first.contains(
            "# The file has the cameras `cam0` and `cam1`. This is `cam0`; --camera takes another.\n"
        ),
        "{first}"
    );
    assert!(first.contains("fx_px = 500.0\n"));
    let cam1 = import_camera(source, "cam1").unwrap();
    let Pattern::Camera(cam1) = sensor(&cam1).pattern else { panic!("no camera") };
    assert_eq!(numbers(&cam1), [640.0, 480.0, 400.0, 400.0, 100.5, 50.5]);
    let found = import_camera(source, "cam2").unwrap_err();
    assert_eq!(found[0].message, "the file has no camera `cam2`");
    let alone = realsense("\"None\"", "");
    let found = import_camera(Source { name: "d.json", text: &alone }, "depth").unwrap_err();
    assert_eq!(found[0].help.as_deref(), Some("leave --camera out"));
}

/// A part of the sensor, and combined pixels. A pixel of the image is looked up in the whole one: its middle is that of the
/// pixels that it consists of.
#[test]
fn a_region_of_interest_and_binning_see_the_same_directions() {
    let info = |more: &str| {
        format!(
            "width: 640\nheight: 480\ndistortion_model: plumb_bob\nd: [0.1, -0.05, 0.001, 0.002, 0.0]\n\
             k: [525.0, 0.0, 310.25, 0.0, 524.0, 245.5, 0.0, 0.0, 1.0]\n{more}"
        )
    };
    // Pixels that are not square, and a part beside the principal point, are doubted, and are right here.
    let camera = |text: &str| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sensor.toml");
        std::fs::write(&path, toml(text, None).unwrap()).unwrap();
        match beamcast::config::load_sensor(&path).unwrap().sensor.pattern {
            Pattern::Camera(camera) => camera,
            other => panic!("no camera: {other:?}"),
        }
    };
    let whole = camera(&info(""));
    for (more, size, offset, factor) in [
        (
            "roi: {x_offset: 100, y_offset: 40, width: 200, height: 120, do_rectify: false}\n",
            [200, 120],
            [100.0, 40.0],
            [1.0, 1.0],
        ),
        ("roi: {x_offset: 100, y_offset: 0, width: 0, height: 0}\n", [540, 480], [100.0, 0.0], [1.0, 1.0]),
        ("binning_x: 2\nbinning_y: 4\n", [320, 120], [0.0, 0.0], [2.0, 4.0]),
        (
            "binning_x: 2\nbinning_y: 2\nroi: {x_offset: 10, y_offset: 100, width: 301, height: 200}\n",
            [150, 100],
            [10.0, 100.0],
            [2.0, 2.0],
        ),
        ("binning_x: 1\nbinning_y: 0\nroi:\n  x_offset: 0\n  width: 0\n", [640, 480], [0.0, 0.0], [1.0, 1.0]),
    ] {
        let part = camera(&info(more));
        assert_eq!([part.width(), part.height()], size, "{more}");
        for (u, v) in [(0.5, 0.5), (20.5, 30.5), (99.5, 77.5)] {
            let of_whole =
                whole.optical_direction_at(offset[0] + factor[0] * u, offset[1] + factor[1] * v).unwrap();
            let of_part = part.optical_direction_at(u, v).unwrap();
            assert!(of_whole.distance(of_part) < 1e-12, "{more}: {u}, {v}");
        }
    }
    for (more, message) in [
        (
            "roi: {x_offset: 600, y_offset: 0, width: 100, height: 100}\n",
            "the region of interest of 100 × 100 pixels at (600, 0) is no part of the image",
        ),
        ("binning_x: 1000\n", "1000 by 1 pixels are combined, and the image has 640 × 480"),
        ("binning_x: -2\n", "`binning_x` is -2"),
        ("roi: {x_offset: 4294967295, width: 4294967295}\n", "`roi.x_offset` is 4294967295"),
    ] {
        assert_eq!(toml(&info(more), None).unwrap_err()[0].message, message);
    }
}
