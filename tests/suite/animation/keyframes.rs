//! A reading of glTF files of its own, in plain f64, for tests to compare with: keyframes, nodes, skins and morph targets at a
//! time, written from the specification (glTF 2.0, sections 3.7 and 3.11, appendix C) and with nothing of the crate.

use std::path::Path;

use serde_json::Value;

pub type Matrix = [[f64; 4]; 4];
pub type Point = [f64; 3];

/// A file with its buffers.
pub struct Reading {
    pub json: Value,
    buffers: Vec<Vec<u8>>,
}

/// The triangles of a node's mesh at a time.
pub struct Posed {
    pub triangles: Vec<[Point; 3]>,
    /// The largest number that went into a position, in metres of the world: what rounding is relative to.
    pub size: f64,
}

fn index(value: &Value) -> Option<usize> {
    value.as_u64().map(|index| index as usize)
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], |list| &list[..])
}

fn numbers(value: &Value) -> Vec<f64> {
    list(value).iter().map(|number| number.as_f64().unwrap()).collect()
}

fn base64(text: &str) -> Vec<u8> {
    let (mut bytes, mut bits, mut held) = (Vec::new(), 0_u32, 0);
    for c in text.bytes().filter(|c| *c != b'=') {
        let six = match c {
            b'A'..=b'Z' => c - b'A',
            b'a'..=b'z' => c - b'a' + 26,
            b'0'..=b'9' => c - b'0' + 52,
            b'+' => 62,
            _ => 63,
        };
        bits = bits << 6 | u32::from(six);
        held += 6;
        if held >= 8 {
            held -= 8;
            bytes.push((bits >> held) as u8);
        }
    }
    bytes
}

impl Reading {
    pub fn open(path: &Path) -> Self {
        let file = std::fs::read(path).unwrap();
        let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
        let (json, chunk): (Value, &[u8]) = if file.starts_with(b"glTF") {
            let end = 20 + word(12);
            let chunk = if file.len() > end { &file[end + 8..end + 8 + word(end)] } else { &[] };
            (serde_json::from_slice(&file[20..end]).unwrap(), chunk)
        } else {
            (serde_json::from_slice(&file).unwrap(), &[])
        };
        let buffers = list(&json["buffers"]).iter().map(|buffer| match buffer["uri"].as_str() {
            None => chunk.to_vec(),
            Some(uri) if uri.starts_with("data:") => base64(uri.split_once(',').unwrap().1),
            Some(uri) => std::fs::read(path.parent().unwrap().join(uri)).unwrap(),
        });
        Self { buffers: buffers.collect(), json }
    }

    /// The elements of an accessor.
    fn accessor(&self, number: usize) -> Vec<Vec<f64>> {
        let accessor = &self.json["accessors"][number];
        let width = match accessor["type"].as_str().unwrap() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let component = accessor["componentType"].as_u64().unwrap();
        let size = [1, 1, 2, 2, 0, 4, 4][component as usize - 5120];
        let one = match (accessor["normalized"].as_bool(), component) {
            (Some(true), 5120) => 127.0,
            (Some(true), 5121) => 255.0,
            (Some(true), 5122) => 32767.0,
            (Some(true), 5123) => 65535.0,
            _ => 0.0,
        };
        assert!(accessor["sparse"].is_null(), "this reading knows no sparse accessors");
        let view = &self.json["bufferViews"][index(&accessor["bufferView"]).unwrap()];
        let bytes = &self.buffers[index(&view["buffer"]).unwrap()];
        let start = index(&view["byteOffset"]).unwrap_or(0) + index(&accessor["byteOffset"]).unwrap_or(0);
        let stride = index(&view["byteStride"]).unwrap_or(width * size);
        let value = |at: usize| {
            let raw = match component {
                5120 => f64::from(bytes[at] as i8),
                5121 => f64::from(bytes[at]),
                5122 => f64::from(i16::from_le_bytes([bytes[at], bytes[at + 1]])),
                5123 => f64::from(u16::from_le_bytes([bytes[at], bytes[at + 1]])),
                5125 => f64::from(u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())),
                _ => f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())),
            };
            if one > 0.0 { f64::max(raw / one, -1.0) } else { raw }
        };
        let count = index(&accessor["count"]).unwrap();
        (0..count).map(|i| (0..width).map(|c| value(start + i * stride + c * size)).collect()).collect()
    }

    /// The value of a property of a node in a clip, if the clip sets it.
    fn animated(&self, clip: &Value, node: usize, path: &str, time: f64) -> Option<Vec<f64>> {
        let channels = list(&clip["channels"]);
        let channel = channels.iter().find(|channel| {
            index(&channel["target"]["node"]) == Some(node) && channel["target"]["path"] == path
        })?;
        let sampler = &clip["samplers"][index(&channel["sampler"]).unwrap()];
        let times: Vec<f64> =
            self.accessor(index(&sampler["input"]).unwrap()).into_iter().map(|time| time[0]).collect();
        let output = self.accessor(index(&sampler["output"]).unwrap()).concat();
        let is_spline = sampler["interpolation"] == "CUBICSPLINE";
        let width = output.len() / times.len() / if is_spline { 3 } else { 1 };
        let row = |at: usize| output[at * width..][..width].to_vec();
        let value = |key: usize| if is_spline { row(3 * key + 1) } else { row(key) };
        let unit = |value: Vec<f64>| {
            let length = value.iter().map(|c| c * c).sum::<f64>().sqrt();
            if path == "rotation" { value.iter().map(|c| c / length).collect() } else { value }
        };
        let last = times.len() - 1;
        if time <= times[0] {
            return Some(unit(value(0)));
        }
        if time >= times[last] {
            return Some(unit(value(last)));
        }
        let key = (0..last).rev().find(|&key| times[key] <= time).unwrap();
        let span = times[key + 1] - times[key];
        let t = (time - times[key]) / span;
        let (a, b) = (value(key), value(key + 1));
        if sampler["interpolation"] == "STEP" {
            return Some(unit(a));
        }
        if is_spline {
            let (leaves, arrives) = (row(3 * key + 2), row(3 * key + 3));
            let (t2, t3) = (t * t, t * t * t);
            let spline = (0..width).map(|i| {
                (2.0 * t3 - 3.0 * t2 + 1.0) * a[i]
                    + span * (t3 - 2.0 * t2 + t) * leaves[i]
                    + (-2.0 * t3 + 3.0 * t2) * b[i]
                    + span * (t3 - t2) * arrives[i]
            });
            return Some(unit(spline.collect()));
        }
        if path == "rotation" {
            let (a, b) = (unit(a), unit(b));
            let dot: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
            let angle = libm::acos(dot.abs().min(1.0));
            // Slerp. For a small angle, of which acos loses digits, it is the straight line to within the angle's square.
            let (p, q) = if angle < 1e-4 {
                (1.0 - t, t)
            } else {
                (libm::sin((1.0 - t) * angle) / libm::sin(angle), libm::sin(t * angle) / libm::sin(angle))
            };
            return Some(unit(a.iter().zip(&b).map(|(a, b)| p * a + q * dot.signum() * b).collect()));
        }
        Some(a.iter().zip(&b).map(|(a, b)| a + t * (b - a)).collect())
    }

    /// The matrix of a node in its parent.
    fn local(&self, clip: &Value, node: usize, time: f64) -> Matrix {
        let json = &self.json["nodes"][node];
        if !json["matrix"].is_null() {
            let m = numbers(&json["matrix"]);
            return std::array::from_fn(|row| std::array::from_fn(|column| m[4 * column + row]));
        }
        let part = |path: &str, rest: &[f64]| {
            self.animated(clip, node, path, time).unwrap_or_else(|| match &json[path] {
                Value::Null => rest.to_vec(),
                own => numbers(own),
            })
        };
        let t = part("translation", &[0.0; 3]);
        let s = part("scale", &[1.0; 3]);
        let q = part("rotation", &[0.0, 0.0, 0.0, 1.0]);
        let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
        let [x, y, z, w] = [q[0] / length, q[1] / length, q[2] / length, q[3] / length];
        let rotation = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ];
        let row = |i: usize| [rotation[i][0] * s[0], rotation[i][1] * s[1], rotation[i][2] * s[2], t[i]];
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }

    /// The nodes of the default scene in document order, depth first, with their parents.
    fn nodes(&self) -> Vec<(usize, Option<usize>)> {
        let scene = index(&self.json["scene"]).unwrap_or(0);
        let mut stack: Vec<(usize, Option<usize>)> = list(&self.json["scenes"][scene]["nodes"])
            .iter()
            .rev()
            .map(|n| (index(n).unwrap(), None))
            .collect();
        let mut found = Vec::new();
        while let Some((node, parent)) = stack.pop() {
            found.push((node, parent));
            let children = list(&self.json["nodes"][node]["children"]).iter().rev();
            stack.extend(children.map(|child| (index(child).unwrap(), Some(node))));
        }
        found
    }

    /// The last time of a clip's keyframes.
    pub fn length(&self, clip: usize) -> f64 {
        let samplers = list(&self.json["animations"][clip]["samplers"]).iter();
        samplers.flat_map(|s| self.accessor(index(&s["input"]).unwrap()).concat()).fold(0.0, f64::max)
    }

    /// The triangles of each node that has a mesh, in document order, at a time of a clip.
    pub fn at(&self, clip: usize, time: f64) -> Vec<Posed> {
        let clip = &self.json["animations"][clip];
        let nodes = self.nodes();
        let mut world: Vec<Matrix> = vec![[[0.0; 4]; 4]; list(&self.json["nodes"]).len()];
        for &(node, parent) in &nodes {
            let local = self.local(clip, node, time);
            world[node] = parent.map_or(local, |parent| product(&world[parent], &local));
        }
        let meshes = nodes.iter().filter(|(node, _)| !self.json["nodes"][*node]["mesh"].is_null());
        meshes.map(|&(node, _)| self.posed(clip, node, &world, time)).collect()
    }

    fn posed(&self, clip: &Value, node: usize, world: &[Matrix], time: f64) -> Posed {
        let json = &self.json["nodes"][node];
        let mesh = &self.json["meshes"][index(&json["mesh"]).unwrap()];
        let weights = self.animated(clip, node, "weights", time).unwrap_or_else(|| {
            if json["weights"].is_null() { numbers(&mesh["weights"]) } else { numbers(&json["weights"]) }
        });
        let skin = index(&json["skin"]).map(|skin| &self.json["skins"][skin]);
        let joints: Vec<Matrix> = skin.map_or(vec![world[node]], |skin| {
            let bind = self.accessor(index(&skin["inverseBindMatrices"]).unwrap());
            let bind = |at: usize| -> Matrix {
                std::array::from_fn(|row| std::array::from_fn(|column| bind[at][4 * column + row]))
            };
            let joints = list(&skin["joints"]).iter().enumerate();
            joints.map(|(at, joint)| product(&world[index(joint).unwrap()], &bind(at))).collect()
        });
        let mut posed = Posed { triangles: Vec::new(), size: 0.0 };
        for primitive in list(&mesh["primitives"]) {
            let attribute = |name: &str| index(&primitive["attributes"][name]).map(|at| self.accessor(at));
            let mut positions = attribute("POSITION").unwrap();
            for (target, weight) in list(&primitive["targets"]).iter().zip(&weights) {
                let Some(accessor) = index(&target["POSITION"]) else { continue };
                for (position, delta) in positions.iter_mut().zip(self.accessor(accessor)) {
                    position.iter_mut().zip(delta).for_each(|(p, d)| *p += weight * d);
                }
            }
            let sets = (0..).map_while(|set| {
                Some((attribute(&format!("JOINTS_{set}"))?, attribute(&format!("WEIGHTS_{set}"))?))
            });
            let sets: Vec<_> = if skin.is_some() { sets.collect() } else { Vec::new() };
            let points: Vec<Point> = positions
                .iter()
                .enumerate()
                .map(|(vertex, position)| {
                    let own = [position[0], position[1], position[2]];
                    let mut terms = Vec::new();
                    for (joints_of, weights_of) in &sets {
                        let pairs = joints_of[vertex].iter().zip(&weights_of[vertex]);
                        terms.extend(pairs.map(|(joint, weight)| (*joint as usize, *weight)));
                    }
                    if terms.is_empty() {
                        terms.push((0, 1.0));
                    }
                    let total: f64 = terms.iter().map(|(_, weight)| weight).sum();
                    let mut sum = [0.0; 3];
                    for (joint, weight) in terms.into_iter().filter(|(_, weight)| *weight != 0.0) {
                        let at = applied(&joints[joint], own);
                        (0..3).for_each(|i| sum[i] += weight / total * at[i]);
                        // Each term of the product counts, as numbers that cancel are rounded before they do.
                        let largest = |i: usize| {
                            (0..3).map(|k| (joints[joint][i][k] * own[k]).abs()).sum::<f64>()
                                + joints[joint][i][3].abs()
                        };
                        posed.size = (0..3).map(largest).fold(posed.size, f64::max);
                    }
                    sum
                })
                .collect();
            assert!(primitive["mode"].is_null() || primitive["mode"] == 4, "this reading knows only lists");
            let corners: Vec<usize> = match index(&primitive["indices"]) {
                Some(accessor) => {
                    self.accessor(accessor).into_iter().map(|corner| corner[0] as usize).collect()
                }
                None => (0..points.len()).collect(),
            };
            posed
                .triangles
                .extend(corners.chunks_exact(3).map(|t| [points[t[0]], points[t[1]], points[t[2]]]));
        }
        posed
    }
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..4).map(|k| a[i][k] * b[k][j]).sum()))
}

fn applied(m: &Matrix, p: Point) -> Point {
    std::array::from_fn(|i| m[i][0] * p[0] + m[i][1] * p[1] + m[i][2] * p[2] + m[i][3])
}
