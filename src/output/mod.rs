//! Encoding of frames to files: the channels, the formats, and the folder that a run writes. [`recorded`] reads the files.
//!
//! The declaration of a channel defines how a pixel without a return is encoded. No other place does.
//!
//! ```text
//! sensor_frame   a sensor's frame with all facts that a writer needs about its origin
//! id             the ids of objects and triangles, from 1
//! channel        the channels, with one declaration each
//! image          a frame as channels, whether it was just cast or read from a file
//! format         the declaration of a format; registry lists all of them
//! options        what a job says about a format: its options, and the channels
//! exr ply png color depth16 registered labels npz npy pcd   the formats, with one file each; exr has the deep images, too
//! las e57        the formats of surveyors, with one folder each; crs: the coordinate reference system of both
//! ros            ROS 2 bags of a whole run
//! waveform       the waveform of every pulse, as arrays
//! kitti nuscenes the folders of KITTI and SemanticKITTI, and of nuScenes
//! cloud_file     recorded clouds as files of another format, by cloud_columns; image_file: recorded images
//! page           the page of all formats, for docs
//! poses          where a sensor was: a row a frame in a run's table, and a row a column in a file of its own
//! objects        the boxes of objects and what is seen, as lines of JSON
//! points         the returns of a frame as points, for clouds
//! zip            the container of an NPZ
//! plot           directions as dots, for previews of patterns that are no picture
//! picture        pictures: drawing, text, PNG files; legend: what their colours mean
//! film           pictures of many frames: animated PNGs, and contact sheets
//! file_memory    the memory of files that are written, for files to come
//! files          the output folder of a run, whose files are complete or absent
//! whole          single files that are complete or absent, and claims on folders
//! manifest       the record of a run
//! names          the names behind ids, for headers
//! json           JSON as people and version control like it
//! ```

mod channel;
mod cloud_columns;
mod cloud_file;
mod color;
mod crs;
mod deflate;
mod depth16;
mod e57;
mod exr;
mod file_memory;
mod files;
mod film;
mod format;
mod id;
mod image;
mod image_file;
mod json;
mod kitti;
mod labels;
mod las;
mod legend;
mod manifest;
mod matches;
mod names;
mod npy;
mod npz;
mod nuscenes;
mod objects;
mod options;
mod page;
mod pcd;
mod picture;
mod places;
pub mod plot;
mod ply;
mod png;
mod points;
mod poses;
pub mod recorded;
mod registered;
mod registry;
mod ros;
mod sensor_frame;
mod waveform;
mod whole;
mod zip;

pub use channel::{
    BYTES_A_VALUE, CHANNEL_NAMES, CHANNELS, ChannelSpec, DEPTH_FOR_OPENCV, DEPTHS, NO_RETURN_M, Scale,
    Sensors, Shown, TERM_NAMES, UNASKED_CHANNEL_NAMES, Values, channel, is_of_all_pixels, no_return,
};
pub use cloud_file::CloudFormat;
pub use file_memory::FileMemory;
pub use files::{Destination, FileNames, GrowingFile, StagedFile, WrittenFile};
pub use film::{Palette, film};
pub use format::{
    Asked, Content, Encode, EncodeError, Field, Folder, FormatSpec, FrameFile, FramePath, Kind, LEAST_DIGITS,
    LossyContent, Note, Notes, RunFile, Stream,
};
pub use id::{id_of, index_of};
pub use image::{Channel, Image, Samples};
pub use image_file::ImageFormat;
pub use json::json_lines;
pub use las::SCALE as LAS_SCALE;
pub use legend::{Entry, round_step, ticks, with_legend};
pub use manifest::{Manifest, SensorFrames};
pub use names::Names;
pub use objects::{BOXES, VISIBLE, box_row, visible_row};
pub use options::{Channels, OptionSpec, OptionValue, OptionValues, Options};
pub use page::formats_page;
pub use picture::{LINE_COLOUR, NO_RETURN_COLOUR, Picture, Rgb, TEXT_COLOUR, text_width};
pub use places::{Line, Place};
pub use points::Point;
pub use poses::{POSES, pose_row};
pub use registry::{FORMATS, Format};
pub use sensor_frame::{CloudFrame, CloudTime, SensorFrame, pose_of_toml};
pub use whole::{check_file, write_file};
