//! A job's `[materials]`, `[weather]` and `[environment]`.

use glam::DVec3;

use super::super::job::MountedSensor;
use super::super::keys::job as job_keys;
use super::super::keys::surroundings::{self as keys, KindName};
use super::super::library::Measured;
use super::super::plausibility;
use super::super::table::{AnyKey, Table};
use crate::angle::Angle;
use crate::scene::{Environment, Optics, Sun, SurfaceKind, Weather};
use crate::source::words::quoted;

/// Most entries of `[materials]`.
const MOST_MATERIALS: usize = 10_000;

/// How surfaces send light back, in the order of their names. An entry that is wrong is reported and left out.
pub(super) fn materials(job: &Table<'_>) -> Vec<Optics> {
    let Some(given) = job.read(&job_keys::MATERIALS) else { return Vec::new() };
    if given.value.len() > MOST_MATERIALS {
        let message = format!("`materials` has {} entries", given.value.len());
        job.report().error(given.span, message, format!("expected at most {MOST_MATERIALS}"), None);
        return Vec::new();
    }
    given.value.iter().filter_map(|(name, t)| optics(name, &t.value)).collect()
}

/// The kinds that each key goes with, and the kind that the key of another surface is for.
const OF_KINDS: [(&dyn AnyKey, KindName); 6] = [
    (&keys::ROUGHNESS, KindName::Ggx),
    (&keys::F0, KindName::Ggx),
    (&keys::INDEX, KindName::Glass),
    (&keys::THICKNESS, KindName::Glass),
    (&keys::R_A, KindName::Retroreflector),
    (&keys::LOBE, KindName::Retroreflector),
];

fn optics(name: &str, t: &Table<'_>) -> Option<Optics> {
    let report = t.report();
    let kind = t.read(&keys::KIND).map(|kind| kind.value);
    let reflectance = t.read(&keys::REFLECTANCE);
    let wetness = t.value(&keys::WETNESS);
    let like = t.read(&keys::LIKE).map(|like| like.value);
    if t.is_empty() {
        let help = "such as `reflectance = 0.2`, or `like = \"grass\"`".to_owned();
        return report.fail(t.span, format!("{} has no properties", quoted(name)), "needs some", Some(help));
    }
    for (key, of) in OF_KINDS {
        if t.has(key) && kind != Some(of) && (kind.is_some() || !t.has(&keys::KIND)) {
            let message = match kind {
                Some(kind) => format!("`{}` does not go with `kind = \"{}\"`", key.name(), kind.name()),
                None => format!("`{}` has no meaning without a `kind`", key.name()),
            };
            let help = format!("`kind = \"{}\"` has it", of.name());
            report.error(t.span_of(key), message, "", Some(help));
        }
    }
    if t.has(&keys::LIKE) && t.has(&keys::REFLECTANCE) {
        let message = format!("{} has both `like` and `reflectance`", quoted(name));
        let help = "keep one of the two: each says the reflectance".to_owned();
        report.error(t.span_of(&keys::REFLECTANCE), message, "one too many", Some(help));
    }
    if let (Some(Measured::Retroreflector(_)), Some(kind)) = (like, kind) {
        let message = format!("a sheet of retroreflectors can't be of `kind = \"{}\"`", kind.name());
        report.error(t.span_of(&keys::KIND), message, "", Some("leave `kind` out".to_owned()));
    }
    let of_kind = match kind {
        None => like.and_then(Measured::kind),
        Some(KindName::Lambert) => Some(SurfaceKind::Lambert),
        Some(KindName::Ggx) => {
            t.need(&keys::ROUGHNESS, "`roughness = 0.3`, from 0 to 1");
            let f0 = t.value(&keys::F0);
            t.read(&keys::ROUGHNESS).map(|roughness| SurfaceKind::Ggx { roughness: roughness.value, f0 })
        }
        Some(KindName::Mirror) => {
            t.need(&keys::REFLECTANCE, "`reflectance = 0.9`, the part of the light that goes on");
            let reflectance = reflectance.as_ref()?;
            if reflectance.value > 1.0 {
                let message = format!("a mirror has the reflectance {}", reflectance.value);
                return report.fail(
                    reflectance.span,
                    message,
                    "expected a part of the light, at most 1",
                    None,
                );
            }
            // A mirror has no diffuse light.
            let kind = Some(SurfaceKind::Mirror { reflectance: reflectance.value });
            return Some(Optics { name: name.to_owned(), kind, wetness, ..Optics::default() });
        }
        Some(KindName::Glass) => {
            Some(SurfaceKind::Glass { index: t.value(&keys::INDEX), thickness_m: t.value(&keys::THICKNESS) })
        }
        Some(KindName::Water) => Some(SurfaceKind::Water),
        Some(KindName::Retroreflector) => {
            t.need(&keys::R_A, "`r_a = 300.0`, the coefficient of retroreflection in cd/(lx·m²)");
            t.need(&keys::LOBE, "`lobe_deg = 0.47`, the angle at which that has fallen to 1/e");
            let (r_a, lobe) = (t.read(&keys::R_A)?.value, t.read(&keys::LOBE)?.value);
            Some(SurfaceKind::Retroreflector { r_a, lobe_rad: Angle::deg(lobe).radians() })
        }
    };
    Some(Optics {
        name: name.to_owned(),
        reflectance: reflectance.map(|reflectance| reflectance.value),
        spectrum: like.and_then(Measured::spectrum),
        kind: of_kind,
        wetness,
    })
}

/// The air and the sun.
pub(super) fn environment(job: &Table<'_>) -> Environment {
    Environment {
        weather: job.read(&job_keys::WEATHER).map(|t| weather(&t.value)),
        sun: job.read(&job_keys::ENVIRONMENT).and_then(|t| sun(&t.value)),
    }
}

/// Warns of weather and of a sun where no sensor of the job measures light.
pub(super) fn warn_of_no_effect(job: &Table<'_>, environment: &Environment, sensors: &[MountedSensor]) {
    let measures = |mounted: &MountedSensor| {
        mounted.sensor.measurement.receiver.as_ref().is_some_and(|receiver| receiver.sensitivity.is_some())
    };
    if sensors.iter().any(measures) {
        return;
    }
    let given: [(bool, &dyn AnyKey); 2] = [
        (environment.weather.is_some(), &job_keys::WEATHER),
        (environment.sun.is_some(), &job_keys::ENVIRONMENT),
    ];
    for (_, key) in given.into_iter().filter(|(is_there, _)| *is_there) {
        job.report().doubt(job.span_of(key), plausibility::weather_without_receiver(key.name()));
    }
}

fn weather(t: &Table<'_>) -> Weather {
    Weather {
        visibility_m: t.read(&keys::VISIBILITY).map(|visibility| visibility.value),
        haze: t.value(&keys::HAZE),
        rain_mm_h: t.value(&keys::RAIN),
        snow_mm_h: t.value(&keys::SNOW),
        dust_per_m: t.value(&keys::DUST),
        lidar_ratio: t.value(&keys::LIDAR_RATIO),
        dust_lidar_ratio: t.value(&keys::DUST_LIDAR_RATIO),
        drop_gain: t.value(&keys::DROP_GAIN),
    }
}

/// The sun; `None` if it does not shine.
fn sun(t: &Table<'_>) -> Option<Sun> {
    let klx = t.value(&keys::SUN_KLX);
    let (azimuth, elevation) =
        (Angle::deg(t.value(&keys::SUN_AZIMUTH)), Angle::deg(t.value(&keys::SUN_ELEVATION)));
    let ((sin_azimuth, cos_azimuth), (up, level)) = (azimuth.sin_cos(), elevation.sin_cos());
    let direction = DVec3::new(level * cos_azimuth, level * sin_azimuth, up);
    (klx > 0.0).then_some(Sun { klx, direction })
}
