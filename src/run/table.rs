//! The tables of a run: files that are made of rows from every frame.

use std::io::Write;

use crate::config::{Job, MountedSensor, TruthSettings};
use crate::output::{BOXES, EncodeError, Format, Notes, POSES, RunFile, VISIBLE};

/// A table of a run: a file that is made of rows from every frame.
#[derive(Clone, Debug)]
pub struct Table {
    name: String,
    kind: Kind,
}

/// How a table is made.
#[derive(Clone, Copy, Debug)]
enum Kind {
    /// The rows follow each other, after a line that may stand before the first.
    Rows { header: Option<&'static str> },
    /// The format of this name makes it of what it noted.
    Format { name: &'static str, file: &'static RunFile },
}

/// The tables of rows, each with the line before the first row.
const OF_ROWS: [(&str, Option<&str>); 3] = [(POSES.0, Some(POSES.1)), (BOXES, None), (VISIBLE, None)];

impl Table {
    /// The tables that a job asks for.
    pub fn of(job: &Job) -> Vec<Self> {
        let TruthSettings { poses, boxes, visible, .. } = job.truth;
        let asked = OF_ROWS.into_iter().zip([poses, boxes.is_some(), visible]);
        let of_rows = asked
            .filter(|(_, is_asked)| *is_asked)
            .map(|((name, header), _)| Self { name: name.to_owned(), kind: Kind::Rows { header } });
        let of_formats = job.output.formats.iter().flat_map(|format| Self::of_format(*format, job));
        of_rows.chain(of_formats).collect()
    }

    /// The tables of a format.
    fn of_format(format: Format, job: &Job) -> Vec<Self> {
        let mut tables: Vec<Self> = Vec::new();
        for file in format.run_files() {
            for MountedSensor { name, sensor, .. } in &job.sensors {
                let path = file.path_of(name);
                let is_new = tables.iter().all(|table| table.name != path);
                if is_new && format.makes_run_file(file, sensor, job.truth.boxes.is_some()) {
                    tables.push(Self { name: path, kind: Kind::Format { name: format.name(), file } });
                }
            }
        }
        tables
    }

    /// The table of that name.
    pub fn named(name: &str) -> Option<Self> {
        let of_rows = OF_ROWS.into_iter().find(|(of_rows, _)| *of_rows == name);
        let of_format = |format: Format| {
            let file = format.run_files().iter().find(|file| file.sensor_of(name).is_some())?;
            Some(Kind::Format { name: format.name(), file })
        };
        let kind = match of_rows {
            Some((_, header)) => Kind::Rows { header },
            None => Format::all().find_map(of_format)?,
        };
        Some(Self { name: name.to_owned(), kind })
    }

    /// Whether the file has rows of the frames, whatever formats these are written in.
    pub fn has_rows(&self) -> bool {
        matches!(self.kind, Kind::Rows { .. })
    }

    /// The file's path in the output folder.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The folder of the file in the output folder; an empty text if it lies in that itself.
    pub fn folder(&self) -> &str {
        self.name.rsplit_once('/').map_or("", |(folder, _)| folder)
    }

    /// The sensor whose frames alone have rows of the table. `None` if all have.
    pub fn sensor(&self) -> Option<&str> {
        match self.kind {
            Kind::Rows { .. } => None,
            Kind::Format { file, .. } => file.sensor_of(&self.name).filter(|sensor| !sensor.is_empty()),
        }
    }

    /// The name under which frames note what the table is made of.
    pub fn key(&self) -> &str {
        match self.kind {
            Kind::Rows { .. } => &self.name,
            Kind::Format { name, .. } => name,
        }
    }

    /// Writes the table of what was noted of its frames under its key.
    ///
    /// # Errors
    /// An error if the file can't be written or the notes can't be read.
    pub fn write(&self, notes: &Notes, file: &mut dyn Write) -> Result<(), EncodeError> {
        match self.kind {
            Kind::Rows { header } => {
                for row in header.map(str::to_owned).into_iter().chain(notes()?.map(|note| note.text)) {
                    file.write_all(row.as_bytes())?;
                    file.write_all(b"\n")?;
                }
                Ok(())
            }
            Kind::Format { file: declared, .. } => (declared.write)(notes, file),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_known_by_its_name() {
        for (name, sensor, folder) in [
            ("poses.csv", None, ""),
            ("boxes.jsonl", None, ""),
            ("top/poses.txt", Some("top"), "top"),
            ("front.left/times.txt", Some("front.left"), "front.left"),
        ] {
            let table = Table::named(name).unwrap();
            assert_eq!((table.name(), table.sensor(), table.folder()), (name, sensor, folder));
        }
        for name in
            ["poses.txt", "/poses.txt", "../poses.txt", "a/b/poses.txt", "top/notes.txt", "top/poses.csv"]
        {
            assert!(Table::named(name).is_none(), "{name}");
        }
    }
}
