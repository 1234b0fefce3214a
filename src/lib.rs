//! beamcast casts the beams of LiDARs and depth cameras against glTF scenes, exactly, on the CPU.
//!
//! ```text
//!  job.toml, sensor.toml            scene.glb
//!           │ config                    │ scene::gltf
//!           ▼                           ▼
//!   sensor::Capture                scene::Scene
//!           │                           │ trace::Tracer
//!           │  Pulse: direction, time   │ Hit: depth, triangle
//!           └─────────────┬─────────────┘
//!                         ▼ scan
//!             Frame: for each pixel its returns
//!                         │ output
//!                         ▼
//!         EXR range image, PLY cloud, PNG preview
//!                         │ check
//!                         ▼
//!     what differs from a baseline, what is not as expected
//! ```
//!
//! Each arrow is one module, and [`run`] goes through them in that order for a job; the command line is above it. Data flows
//! one way: no module imports a later one. [`import`] makes sensor files of vendors' calibrations.
//!
//! # Units and frames
//! Values are in metres, seconds and radians; names at the edges carry their unit (`max_m`, `hfov_deg`). The world is
//! right-handed with z up, and a sensor's frame has x forward, y left, z up; azimuth is counted from +x toward +y,
//! elevation toward +z. Poses are named `target_from_source`. See [`frame`].
//!
//! # What a beam hits
//! Geometry fixes what a beam hits, and the order of work does not matter: see [`trace`]. Results are the same bits on any
//! number of threads and any processor.
//!
//! # Example
//! A wall ten metres ahead of a LiDAR:
//!
//! ```
//! use beamcast::glam::DAffine3;
//! use beamcast::{
//!     Angle, Beam, Capture, Material, Pattern, Progress, Rotating, SceneBuilder, Sensor, SourceInstance, SourceMesh,
//!     SourcePart, Tracer, scan,
//! };
//!
//! let wall = SourceMesh {
//!     positions: vec![[10.0, -5.0, -5.0], [10.0, 5.0, -5.0], [10.0, 0.0, 5.0]],
//!     parts: vec![SourcePart { triangles: vec![[0, 1, 2]], material: 0, ..SourcePart::default() }],
//! };
//! let instance = SourceInstance { mesh: 0, world_from_mesh: DAffine3::IDENTITY, ..Default::default() };
//! let materials = vec![Material::default()];
//! let scene = SceneBuilder { meshes: vec![wall], instances: vec![instance], materials, files: vec![], groups: vec![] }.build()?;
//!
//! let beam = Beam { elevation: Angle::deg(0.0), azimuth_offset: Angle::deg(0.0), time_s: 0.0, file_index: 0 };
//! let full_turn = (Angle::deg(180.0), Angle::deg(-180.0));
//! let pattern = Pattern::Rotating(Rotating::new(vec![beam], 360, full_turn, 10.0)?);
//! let sensor = Sensor::new(pattern);
//!
//! let capture = Capture::at_origin(&sensor);
//! let frame = scan(&scene, &Tracer::build(&scene), &capture, &Progress::default()).unwrap();
//! assert_eq!(frame.get(0, 180).unwrap().range_m, 10.0); // the middle column looks forward
//! assert_eq!(frame.get(0, 0), None); // the first one backward
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod angle;
pub mod check;
#[cfg(feature = "cli")]
pub mod cli;
pub mod config;
pub mod error;
pub mod frame;
pub mod import;
pub mod kernels;
pub mod matching;
pub mod motion;
pub mod output;
pub mod physics;
pub mod placing;
pub mod plausibility;
pub mod rng;
pub mod run;
pub mod scan;
pub mod scene;
pub mod selftest;
pub mod sensor;
pub mod source;
pub mod trace;
pub mod truth;
pub mod view;

// The nouns of a scan, so that most programs need no path below the crate.
pub use angle::Angle;
pub use config::{Job, load_job};
pub use error::{Error, SceneError};
pub use frame::Pose;
pub use glam;
pub use motion::Trajectory;
pub use output::{Format, SensorFrame};
pub use run::Session;
pub use scan::{Cause, Frame, Progress, Return, scan};
pub use scene::{Material, Scene, SceneBuilder, SourceInstance, SourceMesh, SourcePart};
pub use sensor::{Beam, Camera, Capture, Pattern, Pulse, RangeLimits, RayTable, Rotating, Sensor};
pub use trace::{Cast, Hit, Origins, Rays, Tracer};
