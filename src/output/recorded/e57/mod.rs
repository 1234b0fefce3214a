//! Reading of E57 (ASTM E2807) point clouds.
//!
//! ```text
//! pages   the content of the pages, whose checksums are compared
//! xml     the description of the scans, as a tree
//! scan    a scan: what the description says of it, and its points
//! bits    the values of points, from their streams of bits
//! ```
//!
//! The points of one scan stay in their own frame, with the scan's pose beside them, as a PCD has it. Those of several scans are carried
//! into the file's frame, and each has the number of its scan.

mod bits;
mod pages;
mod scan;
mod xml;

use self::pages::Pages;
use self::scan::Scan;
use self::xml::Element;
use super::cloud::{Cloud, Field};
use super::error::ReadError;

/// Reads the points of an E57, whose values may take `memory` bytes. `cartesianX` becomes `x`, `colorRed` becomes `red`, and spherical
/// coordinates become Cartesian ones; all other fields keep their names. A point whose `cartesianInvalidState` is not 0 has no place (NaN).
///
/// # Errors
/// A [`ReadError`] if the file is no E57, a page's checksum is wrong, the description can't be read, a scan is cut short, or the values
/// take more memory.
pub fn read_e57(bytes: &[u8], memory: u64) -> Result<Cloud, ReadError> {
    let pages = Pages::of(bytes)?;
    let root = Element::parse(pages.description()?)?;
    let described = root.child("data3D").map_or(&[][..], |scans| &scans.children);
    let scans: Vec<Scan> = described.iter().map(Scan::of).collect::<Result<_, _>>()?;
    // The clouds of several scans are in memory beside the joined one.
    let copies = if scans.len() > 1 { 2 } else { 1 };
    let all = scans.iter().map(Scan::memory).fold(0, u64::saturating_add);
    ReadError::check_memory(all.saturating_mul(copies), memory)?;
    let mut left = bytes.len();
    let read = |scan: &Scan| scan.read(&pages, &mut left);
    let mut clouds = scans.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let mut cloud = match (scans.as_slice(), clouds.len()) {
        ([], _) => return Err(ReadError::new("it has no scan")),
        ([_], 1) => clouds.remove(0),
        _ => joined(&scans, clouds),
    };
    let crs = root.child("coordinateMetadata").map(|crs| crs.text.trim()).filter(|crs| !crs.is_empty());
    cloud.comments.extend(crs.map(|crs| format!("crs: {crs}")));
    Ok(cloud)
}

/// The points of several scans in the file's frame, with the fields that all of them have, and the number of the scan.
fn joined(scans: &[Scan], mut clouds: Vec<Cloud>) -> Cloud {
    let points = clouds.iter().map(|cloud| cloud.points).sum();
    scans.iter().zip(&mut clouds).for_each(|(scan, cloud)| scan.carry_into_file(cloud));
    let kind_in = |cloud: &Cloud, name: &str| {
        cloud.fields.iter().find(|other| other.name == name).map(|other| other.kind)
    };
    let mut fields: Vec<Field> = Vec::new();
    for field in clouds.iter().take(1).flat_map(|cloud| &cloud.fields) {
        let kinds: Option<Vec<_>> = clouds.iter().map(|cloud| kind_in(cloud, &field.name)).collect();
        let Some(kinds) = kinds else { continue };
        // Numbers of several types have one that holds them all as exactly as they were read.
        let kind = if kinds.iter().all(|kind| *kind == field.kind) { field.kind } else { "double" };
        fields.push(Field { name: field.name.clone(), kind, values: Vec::with_capacity(points) });
    }
    let mut number = Field { name: "scan".to_owned(), kind: "uint", values: Vec::with_capacity(points) };
    let mut left_out: Vec<String> = Vec::new();
    for (index, cloud) in clouds.into_iter().enumerate() {
        for Field { name, values, .. } in cloud.fields {
            match fields.iter_mut().find(|field| field.name == name) {
                Some(field) => field.values.extend(values),
                None if left_out.contains(&name) => {}
                None => left_out.push(name),
            }
        }
        number.values.resize(number.values.len() + cloud.points, index as f64);
    }
    fields.push(number);
    let mut comments = vec![format!("frame: the file's, metres; {} scans", scans.len())];
    if !left_out.is_empty() {
        comments.push(format!("left out, because not all scans have them: {}", left_out.join(", ")));
    }
    Cloud { points, fields, comments }
}

#[cfg(test)]
mod tests;
