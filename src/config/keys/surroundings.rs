//! The keys of a job about what lies between and around its sensors: how surfaces send light back, the air, the sun.

use std::ops::Bound::{Excluded, Included};

use super::super::kinds::{ByName, Choice, Names, Nested, Number};
use super::super::library::{LIBRARY, Measured};
use super::super::table::{Key, TableKeys, key, table};
use crate::scene::Haze;

pub(crate) static MATERIALS: Key<ByName<Nested>> = key(
    "materials",
    ByName {
        of: Nested(&MATERIAL),
        names: Names::Any("materials, nodes or labels"),
        example: "`[materials.\"asphalt\"]`, then `reflectance = 0.2`",
    },
    "How surfaces send light back, by the names of materials, of nodes (with all below them) or, where none has the name, of `labels`.",
);
pub(crate) static WEATHER: Key<Nested> =
    key("weather", Nested(&WEATHER_KEYS), "The particles in the air; left out: the air is clear.");
pub(crate) static ENVIRONMENT: Key<Nested> =
    key("environment", Nested(&ENVIRONMENT_KEYS), "The sun; left out: there is no sunlight.");

/// The way in which light goes on from a surface, as a job names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum KindName {
    Lambert,
    Ggx,
    Mirror,
    Glass,
    Water,
    Retroreflector,
}

impl KindName {
    /// The kinds, by their names.
    pub const NAMED: [(&str, Self); 6] = [
        ("lambert", Self::Lambert),
        ("ggx", Self::Ggx),
        ("mirror", Self::Mirror),
        ("glass", Self::Glass),
        ("water", Self::Water),
        ("retroreflector", Self::Retroreflector),
    ];

    /// The name.
    pub fn name(self) -> &'static str {
        Self::NAMED.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| *name)
    }
}

static KINDS: [(&str, KindName); 6] = KindName::NAMED;

pub(crate) static MATERIAL: TableKeys = table(
    "an entry of `[materials]`",
    &[&REFLECTANCE, &LIKE, &KIND, &ROUGHNESS, &F0, &INDEX, &THICKNESS, &R_A, &LOBE, &WETNESS],
);
pub(crate) static REFLECTANCE: Key<Number> = key(
    "reflectance",
    Number::within(Included(0.0), Included(2.0)),
    "The diffuse reflectance at the sensor's wavelength, 1 for white; of a mirror, the part of the light that goes on.",
);
pub(crate) static LIKE: Key<Choice<Measured>> = key(
    "like",
    Choice(&LIBRARY),
    "A surface that was measured, in place of `reflectance`: its reflectance at the sensor's wavelength.",
);
pub(crate) static KIND: Key<Choice<KindName>> = key(
    "kind",
    Choice(&KINDS),
    "The way in which light goes on: diffuse (\"lambert\"), diffuse below a glossy lobe (\"ggx\"), or as its name says; left out: \
     as the scene's file says.",
);
pub(crate) static ROUGHNESS: Key<Number> =
    key("roughness", Number::SHARE, "Of \"ggx\": glTF's roughness of the lobe.");
pub(crate) static F0: Key<Number> =
    key("f0", Number::SHARE, "Of \"ggx\": the reflectance of the lobe at a right angle.").or("0.04");
pub(crate) static INDEX: Key<Number> =
    key("index", Number::within(Included(1.0), Included(4.0)), "Of \"glass\": the index of refraction.")
        .or("1.5");
pub(crate) static THICKNESS: Key<Number> = key(
    "thickness_m",
    Number::NOT_NEGATIVE,
    "Of \"glass\": the thickness of the pane that each surface is, with both of its faces; 0: each surface is a single face.",
)
.or("0.0");
pub(crate) static R_A: Key<Number> = key(
    "r_a",
    Number::POSITIVE,
    "Of \"retroreflector\": the coefficient of retroreflection at a right angle and without an angle between light and eye, in \
     cd/(lx·m²).",
);
pub(crate) static LOBE: Key<Number> = key(
    "lobe_deg",
    Number::within(Excluded(0.0), Included(90.0)),
    "Of \"retroreflector\": the angle between light and eye at which that has fallen to 1/e.",
);
pub(crate) static WETNESS: Key<Number> =
    key("wetness", Number::SHARE, "The part of the surface that a film of water covers.").or("0.0");

pub(crate) static WEATHER_KEYS: TableKeys = table(
    "`[weather]`",
    &[&VISIBILITY, &HAZE, &RAIN, &SNOW, &DUST, &LIDAR_RATIO, &DUST_LIDAR_RATIO, &DROP_GAIN],
);
pub(crate) static VISIBILITY: Key<Number> = key(
    "visibility_m",
    Number::within(Excluded(0.0), Included(1e6)),
    "The meteorological optical range of fog and haze, at which 5 % of the contrast is left; left out: there is none of either.",
);
pub(crate) static HAZE: Key<Choice<Haze>> = key(
    "haze",
    Choice(&[("kim", Haze::Kim), ("kruse", Haze::Kruse)]),
    "How the extinction of fog and haze depends on the wavelength: by Kim et al. (2001), in which dense fog is grey, or by Kruse \
     et al. (1962).",
)
.or("\"kim\"");
pub(crate) static RAIN: Key<Number> =
    key("rain_mm_h", Number::within(Included(0.0), Included(500.0)), "The rate of rain in mm an hour.")
        .or("0.0");
pub(crate) static SNOW: Key<Number> = key(
    "snow_mm_h",
    Number::within(Included(0.0), Included(100.0)),
    "The rate of snow in mm of water an hour.",
)
.or("0.0");
pub(crate) static DUST: Key<Number> = key(
    "dust_per_m",
    Number::within(Included(0.0), Included(100.0)),
    "The extinction coefficient of dust, in 1/m.",
)
.or("0.0");
pub(crate) static LIDAR_RATIO: Key<Number> = key(
    "lidar_ratio",
    Number::POSITIVE,
    "The ratio of the extinction of fog to its backscatter, in sr; left out: that of cloud droplets at 905 nm.",
)
.or("19.0");
pub(crate) static DUST_LIDAR_RATIO: Key<Number> = key(
    "dust_lidar_ratio",
    Number::POSITIVE,
    "The ratio of the extinction of dust to its backscatter, in sr.",
)
.or("40.0");
pub(crate) static DROP_GAIN: Key<Number> = key(
    "drop_gain",
    Number::NOT_NEGATIVE,
    "A factor on the backscatter of rain drops, which 1 takes for the reflection on the front of each.",
)
.or("1.0");

pub(crate) static ENVIRONMENT_KEYS: TableKeys =
    table("`[environment]`", &[&SUN_KLX, &SUN_AZIMUTH, &SUN_ELEVATION]);
pub(crate) static SUN_KLX: Key<Number> = key(
    "sun_klx",
    Number::within(Included(0.0), Included(150.0)),
    "The illuminance of a plane that faces the sun: some 100 on a clear day; 0: there is no sunlight.",
)
.or("0.0");
pub(crate) static SUN_AZIMUTH: Key<Number> = key(
    "sun_azimuth_deg",
    Number::ANY,
    "The direction towards the sun in the world: its azimuth from x toward y.",
)
.or("0.0");
pub(crate) static SUN_ELEVATION: Key<Number> = key(
    "sun_elevation_deg",
    Number::within(Included(-90.0), Included(90.0)),
    "The direction towards the sun in the world: its elevation above the horizon.",
)
.or("45.0");
