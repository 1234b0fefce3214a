//! The paths of nuScenes' folder, and the options of the format.

use super::super::format::FramePath;
use super::super::options::{OptionSpec, OptionValues};

/// The cloud of a LiDAR.
pub(super) const CLOUD: FramePath = FramePath { stem: "nuscenes/samples/SENSOR/FRAME", ending: "pcd.bin" };

/// The picture of a camera.
pub(super) const PICTURE: FramePath =
    FramePath { stem: "nuscenes/samples/SENSOR/FRAME", ending: "color.png" };

/// The labels of a cloud's points.
pub(super) const LABELS: FramePath =
    FramePath { stem: "nuscenes/lidarseg/v1.0-beamcast/SENSOR-FRAME_lidarseg", ending: "bin" };

/// The folder that the kit is given. Paths in tables begin below it.
pub(super) const ROOT: &str = "nuscenes/";

/// The image of an empty map.
pub(super) const MAP: &str = "nuscenes/maps/none.png";

pub(super) const SCENE: OptionSpec = OptionSpec {
    name: "scene",
    about: "The name of the scene. All tokens follow from it, so that scenes of different names can be put into one set of tables.",
    values: OptionValues::Text { default: "scene-0001" },
};

pub(super) const LIDARSEG: OptionSpec = OptionSpec {
    name: "lidarseg",
    about: "Whether each LiDAR's point has its label, of 255 at most, in a file beside. The development kit knows colours for its own \
            categories alone, and has to be given a `colormap` with those of the job.",
    values: OptionValues::Flag { default: false },
};
