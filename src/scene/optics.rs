//! How surfaces send light back at the sensor's wavelength, as a job says it of materials, nodes and labels.

/// How a surface sends light back. Each value that is absent follows from the scene's file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Optics {
    /// The name of the entry: that of a material, a node or a label.
    pub name: String,
    /// The diffuse reflectance at the sensor's wavelength, 1 for white. It may be above 1, as data sheets count relative to white.
    pub reflectance: Option<f64>,
    /// The way in which light goes on.
    pub kind: Option<SurfaceKind>,
    /// The share of the surface that a film of water covers, 0 to 1.
    pub wetness: f64,
}

/// The way in which light goes on from a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SurfaceKind {
    /// Diffuse in all directions, by Lambert's law.
    Lambert,
    /// Diffuse below a glossy lobe, as glTF's materials.
    Ggx {
        /// glTF's roughness, 0 to 1.
        roughness: f64,
        /// The reflectance of the lobe at a right angle.
        f0: f64,
    },
    /// A mirror.
    Mirror {
        /// The reflectance, 0 to 1.
        reflectance: f64,
    },
    /// Glass. With a thickness each surface of the scene is a pane with both of its faces; without one it is a single face.
    Glass {
        /// The index of refraction.
        index: f64,
        /// The thickness of the pane in metres, or 0.
        thickness_m: f64,
    },
    /// A surface of water, which is a mirror, and dark where light goes in.
    Water,
    /// A retroreflector.
    Retroreflector {
        /// The coefficient of retroreflection R_A at a right angle and without an angle between the light and the eye, in
        /// cd/(lx·m²).
        r_a: f64,
        /// The angle between the light and the eye at which R_A has fallen to 1/e, in radians.
        lobe_rad: f64,
    },
}
