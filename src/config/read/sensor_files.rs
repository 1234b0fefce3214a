//! The files that sensors name: tables of rays, and the patterns of projectors.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::PathBuf;

use png::{ColorType, Decoder, Transformations};

use super::super::job::InputFile;
use super::super::keys::depth::{STEREO, projector, stereo};
use super::super::keys::measurement::NOMINAL;
use super::rays::RayFiles;
use crate::source::tree::{Entries, Value};
use crate::source::words::quoted;
use crate::source::{Report, Spanned, portable, read_file};

/// The largest image of a pattern that is read, in bytes.
const MAX_BYTES: u64 = 64 << 20;

/// The most pixels of a pattern: 64 million.
const MAX_PIXELS: u64 = 1 << 26;

/// The files that the sensors of a configuration name. Sensors that name the same file share it.
#[derive(Debug, Default)]
pub(super) struct SensorFiles {
    /// The tables of rays.
    pub rays: RayFiles,
    /// The patterns by path. `None`: the file can't be used, which was reported.
    patterns: BTreeMap<PathBuf, Option<GreyImage>>,
    /// The files of patterns in the order in which they were read.
    inputs: Vec<InputFile>,
}

/// An image of grey values, row by row from the top.
#[derive(Clone, Debug)]
pub(super) struct GreyImage {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<u8>,
}

impl SensorFiles {
    /// Reads the files that a sensor names, unless they were read before. Their paths are relative to the file that names them.
    pub fn read(&mut self, report: &mut Report, sensor: &Entries) {
        self.rays.read(report, sensor);
        let nominal = table_in(sensor, NOMINAL.name());
        for of_sensor in std::iter::once(sensor).chain(nominal) {
            let stereo = table_in(of_sensor, STEREO.name());
            if let Some(projector) = stereo.and_then(|stereo| table_in(stereo, stereo::PROJECTOR.name())) {
                self.read_pattern(report, projector);
            }
        }
    }

    /// All files in the order in which they were read: first the tables of rays.
    pub fn inputs(&self) -> impl Iterator<Item = &InputFile> {
        self.rays.inputs.iter().chain(&self.inputs)
    }

    /// The image of a pattern that was read. `None` if there is something wrong with its file.
    pub fn pattern(&self, report: &Report, file: Spanned<&str>) -> Option<&GreyImage> {
        self.patterns.get(&report.folder(file.span).join(file.value))?.as_ref()
    }

    fn read_pattern(&mut self, report: &Report, projector: &Entries) {
        let Some(file) = projector.get(projector::PATTERN.name()).map(|entry| &entry.node) else { return };
        let Value::String(as_written) = &file.value else { return }; // reported when it is read
        let path = report.folder(file.span).join(as_written);
        if as_written.is_empty() || self.patterns.contains_key(&path) {
            return;
        }
        let fail = |problem: String, help: Option<String>| {
            let message = format!("the pattern {} can't be used", quoted(as_written));
            report.error(file.span, message, problem, help);
            None
        };
        let pattern = match read_file(&path, MAX_BYTES) {
            Err(problem) => fail(problem.to_string(), problem.help(as_written, &path)),
            Ok(bytes) => {
                self.inputs.push(InputFile::new(portable(as_written), &bytes));
                grey_image(&bytes).or_else(|problem| fail(problem, None).ok_or(())).ok()
            }
        };
        self.patterns.insert(path, pattern);
    }
}

fn table_in<'e>(entries: &'e Entries, key: &str) -> Option<&'e Entries> {
    match &entries.get(key)?.node.value {
        Value::Table(table) => Some(table),
        _ => None,
    }
}

/// The grey values of a PNG of one channel. Of 16 bits, the upper 8 count.
fn grey_image(bytes: &[u8]) -> Result<GreyImage, String> {
    let broken = |error: png::DecodingError| format!("it is no PNG that can be read: {error}");
    let mut decoder = Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(Transformations::EXPAND | Transformations::STRIP_16);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let info = decoder.read_header_info().map_err(broken)?;
    let (width, height) = (info.width, info.height);
    if info.color_type != ColorType::Grayscale {
        return Err("it has colours or transparency, and a pattern is a PNG of grey values alone".to_owned());
    }
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(format!("it has {width} × {height} pixels, more than the {MAX_PIXELS} of a pattern"));
    }
    let mut reader = decoder.read_info().map_err(broken)?;
    let mut pixels = vec![0; width as usize * height as usize];
    if reader.output_buffer_size() != Some(pixels.len()) {
        return Err("it has more than one grey value a pixel".to_owned());
    }
    reader.next_frame(&mut pixels).map_err(broken)?;
    if pixels.iter().all(|grey| *grey == 0) {
        return Err("it is black, and a pattern needs light".to_owned());
    }
    Ok(GreyImage { width: width as usize, height: height as usize, pixels })
}
