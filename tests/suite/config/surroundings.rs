//! Keys about surfaces, the air and the sun.

use std::fs;

use beamcast::scene::{Environment, Haze, Surface, SurfaceKind, Weather};

use super::{JOB, SENSOR, load};

#[test]
fn surfaces_the_air_and_the_sun_are_as_the_job_says() {
    let job = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/schema/weather.toml")).unwrap();
    let job = job.replacen(
        "preset = \"measured.toml\"\nmode = \"far\"\nnominal = true",
        "preset = \"sensor.toml\"",
        1,
    );
    let job = job.replacen("samples = 37", "samples = 37\ndivergence_mrad = [1, 1]\nkind = \"1/e2\"", 1);
    let job = job.replacen("halo = 0.002", "reach_deg = 1", 1).replacen(
        "detection = 0.5",
        "range_pairs = [[1, 9]]",
        1,
    );
    let job = load(&job, SENSOR, &[]).unwrap();
    let of = |name: &str| job.materials.iter().find(|optics| optics.name == name).unwrap();
    assert_eq!(job.materials.len(), 7);
    let ball = of("ball");
    assert_eq!((ball.reflectance, ball.kind, ball.wetness), (Some(0.5), Some(SurfaceKind::Lambert), 0.5));
    let glossy = of("left wall");
    assert_eq!(
        (glossy.reflectance, glossy.kind),
        (Some(0.2), Some(SurfaceKind::Ggx { roughness: 0.3, f0: 0.05 }))
    );
    let plaster = of("wall");
    assert_eq!((plaster.reflectance_at(905e-9), plaster.kind), (Some(1.0), None));
    let mirror = of("mirror");
    assert_eq!((mirror.reflectance, mirror.kind), (None, Some(SurfaceKind::Mirror { reflectance: 0.9 })));
    assert_eq!(of("pane").kind, Some(SurfaceKind::Glass { index: 1.5, thickness_m: 0.006 }));
    let sign = of("sign");
    let lobe_rad = 0.47_f64.to_radians();
    assert_eq!(
        (sign.reflectance, sign.kind),
        (Some(0.3), Some(SurfaceKind::Retroreflector { r_a: 300.0, lobe_rad }))
    );

    let Environment { weather, sun } = job.environment;
    let expected = Weather {
        visibility_m: Some(200.0),
        haze: Haze::Kruse,
        rain_mm_h: 10.0,
        snow_mm_h: 1.0,
        dust_per_m: 0.001,
        lidar_ratio: 18.0,
        dust_lidar_ratio: 50.0,
        drop_gain: 2.0,
    };
    assert_eq!(weather, Some(expected));
    let sun = sun.unwrap();
    // Azimuth 30° from x, 60° up.
    let direction = glam::DVec3::new(0.5 * 0.75_f64.sqrt(), 0.25, 0.75_f64.sqrt());
    assert!(sun.klx == 100.0 && (sun.direction - direction).length() < 1e-15, "{sun:?}");
    let clear = load(JOB, SENSOR, &[]).unwrap();
    assert!(clear.materials.is_empty() && clear.environment == Environment::default());
    // The defaults of the keys are those of the value.
    let sensor = SENSOR.to_owned() + "[receiver]\nrange_pairs = [[1, 9]]\n";
    let plain = load(&JOB.replacen("wall = 3", "wall = 3\n[weather]", 1), &sensor, &[]).unwrap();
    assert_eq!(plain.environment.weather, Some(Weather::default()));
    let receiver = plain.sensors[0].sensor.measurement.receiver.clone().unwrap();
    let (range_pairs, sensitivity) = (receiver.range_pairs.clone(), receiver.sensitivity);
    let defaults = beamcast::sensor::Receiver { range_pairs, sensitivity, ..Default::default() };
    assert!((receiver.wavelength_m - defaults.wavelength_m).abs() < 1e-18);
    let wavelength_m = defaults.wavelength_m;
    assert_eq!(
        beamcast::sensor::Receiver { wavelength_m, pulse_fwhm_s: defaults.pulse_fwhm_s, ..receiver },
        defaults
    );
}

#[test]
fn a_jobs_scene_has_its_surfaces_and_its_air() {
    let scene = concat!("scene = '", env!("CARGO_MANIFEST_DIR"), "/scenes/room.glb'");
    let surroundings = "walls = 14\n[materials]\n\"white wall\" = { like = \"plaster\" }\nfloor = { wetness = 0.5 }\n[weather]\nrain_mm_h = 5\n";
    let job =
        JOB.replacen("scene = \"../scenes/room.glb\"", scene, 1).replacen("wall = 3\n", surroundings, 1);
    let mut job = load(&job, SENSOR, &[]).unwrap();
    let loaded = beamcast::run::load_scene(&mut job, &[]).unwrap();
    assert_eq!(loaded.scene.environment, job.environment);
    assert_eq!(loaded.scene.environment.weather.unwrap().rain_mm_h, 5.0);
    let geometry = &loaded.scene.geometry;
    let of = |name: &str| {
        let object = geometry.objects.iter().position(|object| object.name == name).unwrap() as u32;
        let optics = |material| loaded.scene.optics(Surface { object, material });
        (0..geometry.materials.len() as u32).map(|m| optics(m).map(|o| o.name.as_str())).collect::<Vec<_>>()
    };
    // The second material is the white wall, and the floor is a node.
    assert_eq!(of("walls and ceiling")[..3], [None, Some("white wall"), None]);
    assert_eq!(of("floor")[..2], [Some("floor"), Some("floor")]);
}
