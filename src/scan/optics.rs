//! Where the light of a beam goes when it meets a surface.

use crate::physics::film::WetDiffuse;
use crate::physics::fresnel::dielectric_reflectance;
use crate::physics::pane::Pane;
use crate::physics::retro;
use crate::physics::surface::{MetallicRoughness, dielectric_f0, lambert, schlick};
use crate::scan::Cause;
use crate::scene::{Appearance, Optics, SurfaceKind};

/// The index of refraction of water in the near infrared.
const WATER_INDEX: f64 = 1.33;

/// The exponent by which a retroreflector's coefficient falls with the cosine of the entrance angle: ASTM D4956 asks white sheeting
/// of type III for 250 cd/(lx·m²) at 4° and 150 at 30°, so ln(250/150)/ln(cos 4°/cos 30°).
const ENTRANCE_EXPONENT: f64 = 3.61;

/// The shares of the light that meets a surface, there and back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Split {
    /// The diffuse reflectance.
    pub reflectance: f64,
    /// The power that comes straight back, relative to a white Lambertian plane at a right angle.
    pub back: f64,
    /// The share of light from behind the surface that arrives through it, both ways.
    pub passed: f64,
    /// The cause of a return from behind the surface, if it is another than without it.
    pub passed_cause: Option<Cause>,
    /// How much longer the light's way is through the surface than through air, in metres.
    pub delay_m: f64,
    /// How far a pane moves the beam sideways, towards its normal's foot, in metres.
    pub shift_m: f64,
    /// The share of light that arrives by the mirror image, both ways.
    pub mirrored: f64,
    /// The cause of a return by the mirror image.
    pub mirrored_cause: Cause,
}

impl Split {
    /// A surface that sends light back and lets nothing go on.
    fn opaque(back: f64) -> Self {
        Self {
            reflectance: 0.0,
            back,
            passed: 0.0,
            passed_cause: None,
            delay_m: 0.0,
            shift_m: 0.0,
            mirrored: 0.0,
            mirrored_cause: Cause::Mirror,
        }
    }
}

/// What a beam knows when it meets a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Meeting {
    /// The cosine of the angle of incidence, 0 to 1.
    pub cosine: f64,
    /// The length of the light's way so far, in metres.
    pub length_m: f64,
    /// The distance between transmitter and receiver, in metres.
    pub spacing_m: f64,
    /// The wavelength in metres.
    pub wavelength_m: f64,
    /// The roughness below which a lobe is narrower than the beam, so that it is a mirror's.
    pub mirror_roughness: f64,
}

/// The split of light at a surface of this appearance. A job's optics, if it has any for the surface, go before what the scene's file
/// says. The cover of a texture's alpha is the caller's.
pub(super) fn split(appearance: &Appearance, optics: Option<&Optics>, at: Meeting) -> Split {
    let Meeting { cosine, .. } = at;
    let reflectance = optics.and_then(|o| o.reflectance_at(at.wavelength_m));
    let of_colour = || f64::from(appearance.reflectivity());
    let rho = reflectance.unwrap_or_else(of_colour);
    let wetness = optics.map_or(0.0, |o| o.wetness);
    let mut split = match optics.and_then(|o| o.kind) {
        Some(SurfaceKind::Lambert) => Split::opaque(lambert(rho, cosine)),
        Some(SurfaceKind::Ggx { roughness, f0 }) => {
            glossy(&MetallicRoughness { roughness, f0, ..MetallicRoughness::rough(rho) }, at)
        }
        Some(SurfaceKind::Mirror { reflectance }) => {
            Split { mirrored: reflectance * reflectance, ..Split::opaque(0.0) }
        }
        Some(SurfaceKind::Glass { index, thickness_m }) => glass(index, thickness_m, cosine),
        Some(SurfaceKind::Water) => {
            let film = dielectric_reflectance(cosine, WATER_INDEX).two_way_scrambled();
            let inside = WetDiffuse { reflectance: reflectance.unwrap_or(0.0), index: WATER_INDEX };
            return Split { mirrored: film, ..Split::opaque(inside.power_factor(cosine)) };
        }
        Some(SurfaceKind::Retroreflector { r_a, lobe_rad }) => {
            let lobe = retro::Lobe { peak: r_a, width_rad: lobe_rad };
            let r_a = lobe.coefficient(retro::observation_angle_rad(at.spacing_m, at.length_m));
            Split::opaque(retro::power_factor(r_a * libm::pow(cosine, ENTRANCE_EXPONENT), cosine))
        }
        None if reflectance.is_some() => Split::opaque(lambert(rho, cosine)),
        None => glossy(&of_file(appearance, rho), at),
    };
    split.reflectance = rho;
    if wetness > 0.0 {
        let film = WetDiffuse { reflectance: rho.min(1.0), index: WATER_INDEX };
        let mirrored = dielectric_reflectance(cosine, WATER_INDEX).two_way_scrambled();
        split.back += wetness * (film.power_factor(cosine) - split.back);
        split.mirrored += wetness * (mirrored - split.mirrored);
    }
    split
}

/// The material of a glTF file.
fn of_file(appearance: &Appearance, reflectivity: f64) -> MetallicRoughness {
    let [metallic, roughness, clearcoat, transmission, specular, ior] = [
        appearance.metallic,
        appearance.roughness,
        appearance.clearcoat,
        appearance.transmission,
        appearance.specular,
        appearance.ior,
    ]
    .map(f64::from);
    MetallicRoughness {
        base_reflectance: reflectivity,
        metallic,
        roughness,
        f0: dielectric_f0(ior, specular, 1.0),
        clearcoat,
        // A coat as rough as its base is seen as one lobe; the extension's own roughness is not read.
        clearcoat_roughness: roughness,
        transmission,
    }
}

/// A lobe over a diffuse base. A lobe narrower than the beam is a mirror.
fn glossy(material: &MetallicRoughness, at: Meeting) -> Split {
    let Meeting { cosine, .. } = at;
    let passed = if material.transmission > 0.0 { material.passed(cosine) } else { 0.0 };
    let mut split = match material.roughness < at.mirror_roughness {
        false => Split::opaque(material.power_factor(cosine)),
        true => {
            let coat = material.coat_transmission(cosine);
            let f0 = material.normal_reflectance();
            let mirrored = if material.metallic >= 1.0 { f0 } else { schlick(f0, cosine) };
            Split { mirrored: mirrored * mirrored, ..Split::opaque(coat * coat * material.diffuse(cosine)) }
        }
    };
    if passed > 0.0 {
        split.passed = passed * passed;
        split.passed_cause = Some(Cause::Glass);
    }
    split
}

fn glass(index: f64, thickness_m: f64, cosine: f64) -> Split {
    let [passed, mirrored, delay_m, shift_m] = if thickness_m > 0.0 {
        let pane = Pane::clear(index, thickness_m);
        [
            pane.transmission(cosine).two_way_kept(),
            pane.reflectance(cosine).two_way_scrambled(),
            pane.delay_m(cosine),
            pane.shift_m(cosine),
        ]
    } else {
        let face = dielectric_reflectance(cosine, index);
        [face.map(|r| 1.0 - r).two_way_kept(), face.two_way_scrambled(), 0.0, 0.0]
    };
    Split {
        passed,
        passed_cause: Some(Cause::Glass),
        delay_m,
        shift_m,
        mirrored,
        mirrored_cause: Cause::Glass,
        ..Split::opaque(0.0)
    }
}
