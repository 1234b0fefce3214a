//! Running jobs: everything between a job's file and the files that it gives.
//!
//! ```text
//! session     a job with its scene and its tracer: casts the job's frames
//! loading     the reading of scenes as jobs have them
//! places      the places that a job draws for its actors
//! plan        the frames of a job, the files that they become and the memory that they take, checked before anything is cast
//! memory      the machine's memory, and estimates of how much a run needs
//! journal     the folder that a run writes, and the record of the files in it
//! table       the tables of a run: files with rows from every frame
//! tracked     the objects that have boxes and tracks
//! truth       what is true of frames beside their returns: the motion of surfaces, and the rows of a run's tables
//! record      the file of that record: a line a frame that is finished
//! merge       the parts of a run made one
//! verify      whether a folder is as its run has left it
//! statistics  a frame in short
//! steps       the frames of a rig's sensors that belong together
//! checking    jobs that have something to be checked, and the outcome of each
//! baseline    the folder of a job's baseline: compared and accepted
//! convert     recorded files in other formats
//! remade      frames made anew of the range images of a run
//! sides       the two sides that a comparison has: recorded files, or the frames of a job
//! facts       facts about jobs, sensor files and scenes that are only read
//! paths       paths as people write them
//! ```
//!
//! Nothing here prints, reads a clock or knows a terminal: warnings are returned, and the caller, which drives a run step by
//! step, measures times and looks at signals between the steps.

pub mod baseline;
pub mod checking;
pub mod convert;
pub mod facts;
pub mod journal;
mod loading;
pub mod memory;
pub mod merge;
pub mod paths;
mod places;
pub mod plan;
pub mod record;
mod remade;
pub mod session;
pub mod sides;
pub mod statistics;
pub mod steps;
pub mod table;
mod tracked;
pub mod truth;
pub mod verify;

pub use journal::{Journal, Start};
pub use memory::{Bytes, Holding};
pub use plan::{Item, Output, Plan, Selection, Shard};
pub use session::{Session, load_scene};
pub use statistics::Statistics;
pub use steps::Steps;
pub use table::Table;
pub use truth::FrameTruth;
