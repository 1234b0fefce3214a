//! The shipped scenes as code. They use no assets and have the same bytes on every platform.
//!
//! Scene code uses the world's frame (metres, right-handed, z up), and [`glb`] converts it to glTF's frame.

mod actors;
mod buildings;
mod drive;
mod glb;
mod hall;
mod mesh;
mod props;
mod rng;
mod room;
mod street;
mod trees;
mod vehicles;
mod walker;
mod warehouse;

pub use glb::SceneFile;

/// Semantic labels of the shipped scenes, written as `extras.label` of the nodes. scenes/README.md has the same table.
mod label {
    pub const ROAD: u32 = 1;
    pub const SIDEWALK: u32 = 2;
    pub const BUILDING: u32 = 3;
    pub const VEGETATION: u32 = 4;
    pub const CAR: u32 = 5;
    pub const PERSON: u32 = 6;
    pub const POLE: u32 = 7;
    pub const SIGN: u32 = 8;
    pub const TERRAIN: u32 = 9;
    pub const MARKING: u32 = 10;
    pub const BICYCLE: u32 = 11;
    pub const OBJECT: u32 = 12;
    pub const FLOOR: u32 = 13;
    pub const WALL: u32 = 14;
    pub const FURNITURE: u32 = 15;
    pub const TARGET: u32 = 16;
    pub const RACK: u32 = 17;
    pub const PALLET: u32 = 18;
    pub const GOODS: u32 = 19;
    pub const FORKLIFT: u32 = 20;
}

/// Every table of poses that belongs to a shipped job: its path in configs/, and its text.
pub fn tables() -> Vec<(&'static str, String)> {
    vec![("street_drive/ego.csv", drive::ego())]
}

/// Every shipped scene.
pub fn all() -> Vec<SceneFile> {
    vec![
        room::make(),
        hall::make(),
        street::make(),
        warehouse::make(),
        drive::make(),
        actors::car(),
        actors::cyclist(),
        walker::make(),
    ]
}
