//! A scan: what the description says of it, and its points.

use glam::{DQuat, DVec3};

use super::super::cloud::{Cloud, Field, MAX_FIELDS};
use super::super::error::ReadError;
use super::super::number::Number;
use super::bits::{Encoding, streams};
use super::pages::Pages;
use super::xml::Element;

/// A scan.
#[derive(Debug)]
pub(super) struct Scan {
    points: u64,
    /// The place of the points in the file.
    place: u64,
    fields: Vec<(String, Encoding)>,
    /// Where the points' frame is in the file's. `None` if nothing is said.
    file_from_points: Option<(DQuat, DVec3)>,
    name: String,
    description: String,
}

/// The names that coordinates and colours have here.
const RENAMED: [(&str, &str); 6] = [
    ("cartesianX", "x"),
    ("cartesianY", "y"),
    ("cartesianZ", "z"),
    ("colorRed", "red"),
    ("colorGreen", "green"),
    ("colorBlue", "blue"),
];

/// Spherical coordinates: metres, and radians from x towards y and from there upwards.
const SPHERICAL: [&str; 3] = ["sphericalRange", "sphericalAzimuth", "sphericalElevation"];

impl Scan {
    /// What a description says.
    pub fn of(element: &Element) -> Result<Self, ReadError> {
        let wrong = |what: &str| ReadError::new(format!("a scan's {what} are not as they should be"));
        let points = element.child("points").ok_or_else(|| wrong("points"))?;
        let number = |name: &str| points.attribute(name).and_then(|number| number.trim().parse::<u64>().ok());
        let (place, count) =
            number("fileOffset").zip(number("recordCount")).ok_or_else(|| wrong("points"))?;
        let prototype = points.child("prototype").map_or(&[][..], |prototype| &prototype.children);
        if prototype.len() > MAX_FIELDS {
            return Err(ReadError::new(format!("it has more than {MAX_FIELDS} fields a point")));
        }
        let fields: Vec<(String, Encoding)> = prototype.iter().map(field).collect::<Result<_, _>>()?;
        // Without a bit there could be any number of points.
        if fields.iter().all(|(_, encoding)| encoding.bits() == 0) {
            return Err(ReadError::new("its points have no fields, or none that differs"));
        }
        let text =
            |name: &str| element.child(name).map_or(String::new(), |child| child.text.trim().to_owned());
        let pose = element.child("pose").map(pose);
        let pose = pose.map(|pose| pose.ok_or_else(|| wrong("pose and rotation"))).transpose()?;
        Ok(Self {
            points: count,
            place,
            fields,
            file_from_points: pose,
            name: text("name"),
            description: text("description"),
        })
    }

    /// The bytes of memory that its values take: coordinates may be made anew, and the number of the scan is added.
    pub fn memory(&self) -> u64 {
        self.points.saturating_mul(((self.fields.len() + 4) * size_of::<f64>()) as u64)
    }

    /// Reads its points. The bytes of its packets are taken from those that are `left` of the file.
    pub fn read(&self, pages: &Pages, left: &mut usize) -> Result<Cloud, ReadError> {
        let encodings: Vec<Encoding> = self.fields.iter().map(|(_, encoding)| *encoding).collect();
        let mut streams = streams(pages, (self.place, self.points), &encodings, left)?;
        let broken = || ReadError::new("a section of points is broken");
        let points = usize::try_from(self.points).map_err(|_| broken())?;
        let mut fields = Vec::new();
        for ((name, encoding), stream) in self.fields.iter().zip(&mut streams) {
            let values = encoding.values(&std::mem::take(stream), points).ok_or_else(broken)?;
            fields.push(Field { name: name.clone(), kind: encoding.number().name(), values });
        }
        let mut cloud = Cloud { points, fields, comments: self.comments() };
        make_cartesian(&mut cloud);
        forget_invalid(&mut cloud);
        Ok(cloud)
    }

    /// The pose as that of a PCD, and what the scan is called.
    fn comments(&self) -> Vec<String> {
        let named = [("scan", &self.name), ("description", &self.description)];
        let named = named.into_iter().filter(|(_, text)| !text.is_empty());
        let mut comments: Vec<String> = named.map(|(key, text)| format!("{key}: {text}")).collect();
        if let Some((rotation, at)) = self.file_from_points {
            let DQuat { x, y, z, w } = rotation;
            comments.push(format!("VIEWPOINT {:?} {:?} {:?} {w:?} {x:?} {y:?} {z:?}", at.x, at.y, at.z));
        }
        comments
    }

    /// Carries the points into the file's frame.
    pub fn carry_into_file(&self, cloud: &mut Cloud) {
        let place = |name: &str, cloud: &Cloud| cloud.fields.iter().position(|field| field.name == name);
        let places = (place("x", cloud), place("y", cloud), place("z", cloud));
        let (Some(x), Some(y), Some(z)) = places else { return };
        let (rotation, translation) = self.file_from_points.unwrap_or((DQuat::IDENTITY, DVec3::ZERO));
        for point in 0..cloud.points {
            let old = DVec3::from([x, y, z].map(|axis| cloud.fields[axis].values[point]));
            let new = rotation * old + translation;
            for (axis, value) in [x, y, z].into_iter().zip(new.to_array()) {
                cloud.fields[axis].values[point] = value;
            }
        }
        [x, y, z].into_iter().for_each(|axis| cloud.fields[axis].kind = Number::F64.name());
    }
}

/// The name and the encoding of a field.
fn field(element: &Element) -> Result<(String, Encoding), ReadError> {
    let name = RENAMED.iter().find(|(name, _)| *name == element.name);
    let name = name.map_or(element.name.clone(), |(_, own)| (*own).to_owned());
    let wrong = || ReadError::new(format!("the type of its field {:?} is none that is read", element.name));
    let integer = |key: &str, default: i64| match element.attribute(key) {
        Some(text) => text.trim().parse().ok(),
        None => Some(default),
    };
    let float = |key: &str, default: f64| match element.attribute(key) {
        Some(text) => text.trim().parse().ok(),
        None => Some(default),
    };
    let encoding = match element.attribute("type") {
        Some("Float") => match element.attribute("precision") {
            Some("single") => Some(Encoding::Float(Number::F32)),
            None | Some("double") => Some(Encoding::Float(Number::F64)),
            Some(_) => None,
        },
        Some(kind @ ("Integer" | "ScaledInteger")) => {
            let range = integer("minimum", i64::MIN).zip(integer("maximum", i64::MAX));
            let scale = match kind {
                "Integer" => Some(None),
                _ => float("scale", 1.0).zip(float("offset", 0.0)).map(Some),
            };
            let range = range.filter(|(least, most)| least <= most);
            range.zip(scale).map(|((least, most), scale)| Encoding::Integer { least, most, scale })
        }
        _ => None,
    };
    Ok((name, encoding.ok_or_else(wrong)?))
}

/// A rotation, which is no rotation unless it has a length, and a translation in metres. What is left out turns and moves nothing.
fn pose(element: &Element) -> Option<(DQuat, DVec3)> {
    let part = |of: Option<&Element>, name: &str, default: f64| match of {
        Some(of) => of.number(name),
        None => Some(default),
    };
    let (rotation, translation) = (element.child("rotation"), element.child("translation"));
    let [x, y, z] = ["x", "y", "z"].map(|axis| part(rotation, axis, 0.0));
    let rotation = DQuat::from_xyzw(x?, y?, z?, part(rotation, "w", 1.0)?);
    let [x, y, z] = ["x", "y", "z"].map(|axis| part(translation, axis, 0.0));
    let translation = DVec3::new(x?, y?, z?);
    let length = rotation.length();
    let is_one = length.is_finite() && length > 1e-9 && translation.is_finite();
    // Writers round the four numbers; one that is exact stays as it is.
    let rotation = if (length - 1.0).abs() < 1e-14 { rotation } else { rotation / length };
    is_one.then_some((rotation, translation))
}

/// Makes Cartesian coordinates of spherical ones, if there are no others.
fn make_cartesian(cloud: &mut Cloud) {
    let places = SPHERICAL.map(|name| cloud.fields.iter().position(|field| field.name == name));
    let [Some(range), Some(azimuth), Some(elevation)] = places else { return };
    if cloud.field("x").is_some() {
        return;
    }
    for point in 0..cloud.points {
        let [r, a, e] = [range, azimuth, elevation].map(|field| cloud.fields[field].values[point]);
        let across = r * libm::cos(e);
        let new = [across * libm::cos(a), across * libm::sin(a), r * libm::sin(e)];
        for (field, value) in [range, azimuth, elevation].into_iter().zip(new) {
            cloud.fields[field].values[point] = value;
        }
    }
    for (field, name) in [range, azimuth, elevation].into_iter().zip(["x", "y", "z"]) {
        (cloud.fields[field].name, cloud.fields[field].kind) = (name.to_owned(), Number::F64.name());
    }
}

/// Takes the place of points that have none.
fn forget_invalid(cloud: &mut Cloud) {
    let names = ["cartesianInvalidState", "sphericalInvalidState"];
    let invalid: Vec<usize> = names
        .iter()
        .filter_map(|name| cloud.field(name))
        .flat_map(|states| {
            states.iter().enumerate().filter(|(_, state)| **state != 0.0).map(|(point, _)| point)
        })
        .collect();
    for field in cloud.fields.iter_mut().filter(|field| ["x", "y", "z"].contains(&field.name.as_str())) {
        // Integers have no NaN.
        field.kind = if invalid.is_empty() || ["float", "double"].contains(&field.kind) {
            field.kind
        } else {
            "double"
        };
        invalid.iter().for_each(|point| field.values[*point] = f64::NAN);
    }
}
