//! Houses that consist of bays. A façade is a grid of panels 3 m wide, and each kind of panel is stored once. A shell
//! closes the rest.
//!
//! In the frame of a panel, x goes along the façade from 0 to 3, z goes up from its floor, the street is towards −y, and
//! the wall's face is at y = 0.
//! All edges that panels share have short coordinates, so that abutting panels have exactly the same vertices.

use glam::DVec3;
use serde_json::json;

use super::glb::{Document, Material, MeshId, NodeId, Place, QuarterTurned};
use super::label;
use super::mesh::{Mesh, v};

pub const BAY: f64 = 3.0;
pub const GROUND_FLOOR: f64 = 4.0;
pub const FLOOR: f64 = 3.0;

/// The materials that all houses share. The walls differ.
#[derive(Clone, Copy)]
pub struct Fabric {
    pub frame: Material,
    pub glass: Material,
    pub stone: Material,
    pub door: Material,
    pub rail: Material,
    pub awning: Material,
    pub roof: Material,
}

impl Fabric {
    pub fn new(doc: &mut Document) -> Self {
        Self {
            frame: doc.grey("window frame", 0.65),
            glass: doc.material("window glass", [0.06, 0.07, 0.08]),
            stone: doc.material("sandstone", [0.45, 0.4, 0.32]),
            door: doc.material("green door", [0.05, 0.14, 0.09]),
            rail: doc.grey("wrought iron", 0.09),
            awning: doc.material("terracotta", [0.45, 0.14, 0.07]),
            roof: doc.material("slate", [0.13, 0.13, 0.15]),
        }
    }
}

/// The panels with walls of one colour.
#[derive(Clone, Copy)]
pub struct Bays {
    wall: Material,
    window: MeshId,
    balcony: MeshId,
    door: MeshId,
    shop: MeshId,
}

pub struct House<'n> {
    pub name: &'n str,
    /// The corner where the front begins (left, seen from the street), and the direction that it faces: at 0 quarter turns
    /// −y.
    pub frame: QuarterTurned,
    /// The numbers of bays of the front and of the sides.
    pub width: u32,
    pub depth: u32,
    /// The number of floors above the ground floor.
    pub floors: u32,
    /// The sides that have bays (front, right, back, left). The other sides are blank walls.
    pub bayed: [bool; 4],
    pub pitched: bool,
    pub shops: bool,
}

struct Opening {
    x: (f64, f64),
    z: (f64, f64),
    /// The distance by which the frame stands back.
    depth: f64,
}

fn upright(x: (f64, f64), y: f64, z: (f64, f64)) -> [DVec3; 4] {
    [v(x.0, y, z.0), v(x.1, y, z.0), v(x.1, y, z.1), v(x.0, y, z.1)]
}

/// Adds the front face with a hole, the reveals of the hole, a frame and a pane.
fn panel(mesh: &mut Mesh, height: f64, hole: &Opening, wall: Material, frame: Material, pane: Material) {
    let rim = 0.0625;
    let pane_depth = hole.depth + 0.03125;
    let outer = upright((0.0, BAY), 0.0, (0.0, height));
    let edge = upright(hole.x, 0.0, hole.z);
    let back = upright(hole.x, hole.depth, hole.z);
    let inner = |y| upright((hole.x.0 + rim, hole.x.1 - rim), y, (hole.z.0 + rim, hole.z.1 - rim));
    mesh.skin(&outer, &edge, wall);
    mesh.skin(&edge, &back, wall);
    mesh.skin(&back, &inner(hole.depth), frame);
    mesh.skin(&inner(hole.depth), &inner(pane_depth), frame);
    mesh.quad(inner(pane_depth), pane);
}

/// Adds bars across a pane, upright at `xs` and level at `zs`.
fn glazing_bars(mesh: &mut Mesh, hole: &Opening, xs: &[f64], zs: &[f64], frame: Material) {
    let (front, back) = (hole.depth + 0.005, hole.depth + 0.05);
    for &x in xs {
        mesh.cuboid(v(x - 0.03, front, hole.z.0 + 0.03), v(x + 0.03, back, hole.z.1 - 0.03), frame);
    }
    for &z in zs {
        mesh.cuboid(
            v(hole.x.0 + 0.03, front + 0.005, z - 0.025),
            v(hole.x.1 - 0.03, back + 0.005, z + 0.025),
            frame,
        );
    }
}

fn window(wall: Material, f: &Fabric) -> Mesh {
    let mut mesh = Mesh::new();
    let hole = Opening { x: (0.75, 2.25), z: (0.75, 2.5), depth: 0.1875 };
    panel(&mut mesh, FLOOR, &hole, wall, f.frame, f.glass);
    glazing_bars(&mut mesh, &hole, &[1.5], &[2.0], f.frame);
    mesh.cuboid(v(0.65, -0.09, 0.67), v(2.35, 0.17, 0.755), f.stone);
    mesh.cuboid(v(0.65, -0.05, 2.495), v(2.35, 0.08, 2.66), f.stone);
    mesh
}

fn balcony(wall: Material, f: &Fabric) -> Mesh {
    let mut mesh = Mesh::new();
    let hole = Opening { x: (0.5, 2.5), z: (0.125, 2.5), depth: 0.1875 };
    panel(&mut mesh, FLOOR, &hole, wall, f.frame, f.glass);
    glazing_bars(&mut mesh, &hole, &[1.5], &[], f.frame);
    mesh.cuboid(v(0.1, -1.1, -0.09), v(2.9, 0.17, 0.12), f.stone);
    let (left, right, front) = (0.16, 2.84, -1.04);
    let posts = 24;
    let bar = |mesh: &mut Mesh, x: f64, y: f64| {
        mesh.tube(&[(v(x, y, 0.1), 0.009), (v(x, y, 1.05), 0.009)], 6, f.rail);
    };
    for i in 0..=posts {
        bar(&mut mesh, left + (right - left) * f64::from(i) / f64::from(posts), front);
    }
    for i in 1..=8 {
        let y = front + 0.125 * f64::from(i);
        bar(&mut mesh, left, y);
        bar(&mut mesh, right, y);
    }
    let rail = [v(left, 0.02, 1.05), v(left, front, 1.05), v(right, front, 1.05), v(right, 0.02, 1.05)];
    mesh.limb(&rail.map(|p| (p, 0.025)), 10, f.rail);
    mesh
}

fn door(wall: Material, f: &Fabric) -> Mesh {
    let mut mesh = Mesh::new();
    let hole = Opening { x: (0.875, 2.125), z: (0.125, 3.25), depth: 0.25 };
    panel(&mut mesh, GROUND_FLOOR, &hole, wall, f.frame, f.door);
    glazing_bars(&mut mesh, &hole, &[1.5], &[2.5], f.frame);
    mesh.cuboid(v(0.7, -0.45, -0.02), v(2.3, 0.24, 0.13), f.stone);
    mesh.cuboid(v(0.6, -0.7, 3.3), v(2.4, 0.05, 3.4), f.stone);
    mesh.limb(&[(v(1.62, 0.2, 1.0), 0.015), (v(1.62, 0.2, 1.25), 0.015)], 8, f.rail);
    for x in [0.66, 2.1] {
        mesh.cuboid(v(x, -0.06, 0.0), v(x + 0.24, 0.03, 3.29), f.stone);
    }
    mesh
}

fn shop(wall: Material, f: &Fabric) -> Mesh {
    let mut mesh = Mesh::new();
    let hole = Opening { x: (0.25, 2.75), z: (0.5, 2.875), depth: 0.125 };
    panel(&mut mesh, GROUND_FLOOR, &hole, wall, f.frame, f.glass);
    glazing_bars(&mut mesh, &hole, &[1.08, 1.92], &[], f.frame);
    mesh.cuboid(v(0.2, -0.12, 0.38), v(2.8, 0.1, 0.51), f.stone);
    // These are the fascia and an awning that slopes out over the pavement.
    mesh.cuboid(v(0.1, -0.1, 3.2), v(2.9, 0.05, 3.7), f.door);
    let slope = |y: f64, z: f64| [v(0.15, y, z), v(2.85, y, z)];
    let ([a, b], [c, d]) = (slope(-0.02, 3.18), slope(-1.3, 2.72));
    let thick = v(0.0, -0.01, 0.03);
    mesh.prism(&[a, c, d, b].map(|p| p - thick), &[a, c, d, b], f.awning);
    mesh
}

impl Bays {
    pub fn new(doc: &mut Document, wall: Material, fabric: &Fabric) -> Self {
        Self {
            wall,
            window: doc.sheet("window bay", &window(wall, fabric)),
            balcony: doc.sheet("balcony bay", &balcony(wall, fabric)),
            door: doc.sheet("door bay", &door(wall, fabric)),
            shop: doc.sheet("shop bay", &shop(wall, fabric)),
        }
    }

    /// Panels of which few differ: windows in place of balconies and of shops.
    pub fn plain(doc: &mut Document, wall: Material, fabric: &Fabric) -> Self {
        let window = doc.sheet("window bay", &window(wall, fabric));
        let door = doc.sheet("door bay", &door(wall, fabric));
        Self { wall, window, balcony: window, door, shop: window }
    }

    /// The same panels with walls of another material.
    pub fn repainted(&self, doc: &mut Document, wall: Material) -> Self {
        let mut paint = |name: &str, mesh| doc.repainted(name, mesh, self.wall, wall);
        Self {
            wall,
            window: paint("window bay", self.window),
            balcony: paint("balcony bay", self.balcony),
            door: paint("door bay", self.door),
            shop: paint("shop bay", self.shop),
        }
    }
}

impl House<'_> {
    /// The height of the walls.
    fn height(&self) -> f64 {
        GROUND_FLOOR + FLOOR * f64::from(self.floors)
    }

    /// Adds the house to the scene, with a node for each side that has bays and one for the shell.
    pub fn build(&self, doc: &mut Document, bays: &Bays, fabric: &Fabric) {
        let sides = [self.width, self.depth, self.width, self.depth];
        let mut corner = DVec3::ZERO;
        for (side, &count) in sides.iter().enumerate() {
            // Each side begins at the end of the previous one and is rotated by a quarter turn.
            let along = quarter(side as u32) * (BAY * f64::from(count));
            if self.bayed[side] {
                let frame = QuarterTurned {
                    at: self.frame.at + turn(corner, self.frame.quarters),
                    quarters: self.frame.quarters + side as u32,
                };
                let children = self.side(doc, bays, count, side == 0);
                let name = format!("{} {}", self.name, ["front", "right side", "back", "left side"][side]);
                doc.group(&name, frame, &children, json!({ "label": label::BUILDING }));
            }
            corner += along;
        }
        let shell = doc.sheet("shell", &self.shell(bays.wall, fabric));
        let shell = doc.node("shell", shell, Place::at(0.0, 0.0, 0.0), json!(null));
        doc.group(self.name, self.frame, &[shell], json!({ "label": label::BUILDING }));
    }

    fn side(&self, doc: &mut Document, bays: &Bays, count: u32, front: bool) -> Vec<NodeId> {
        let mut places: [Vec<Place>; 4] = Default::default();
        for bay in 0..count {
            let x = BAY * f64::from(bay);
            let ground = if front && bay == count / 2 {
                2
            } else if self.shops {
                3
            } else {
                0
            };
            places[ground].push(Place::at(x, 0.0, 0.0));
            for floor in 0..self.floors {
                let balcony = front && !self.pitched && (bay % 3 == 1) && floor > 0;
                places[usize::from(balcony)].push(Place::at(x, 0.0, GROUND_FLOOR + FLOOR * f64::from(floor)));
            }
        }
        // A window panel is as high as a floor. On the ground floor a strip of wall fills the rest.
        let strip = places[0].iter().any(|p| p.position().z == 0.0);
        let kinds = [
            ("windows", bays.window),
            ("balconies", bays.balcony),
            ("door", bays.door),
            ("shops", bays.shop),
        ];
        let mut children: Vec<NodeId> = kinds
            .into_iter()
            .zip(&places)
            .filter(|(_, places)| !places.is_empty())
            .map(|((name, mesh), places)| doc.instances(name, mesh, places, json!(null)))
            .collect();
        if strip {
            let mut mesh = Mesh::new();
            for place in places[0].iter().filter(|p| p.position().z == 0.0) {
                let x = place.position().x;
                mesh.quad(upright((x, x + BAY), 0.0, (FLOOR, GROUND_FLOOR)), bays.wall);
            }
            let mesh = doc.sheet("strip", &mesh);
            children.push(doc.node("strip", mesh, Place::at(0.0, 0.0, 0.0), json!(null)));
        }
        children
    }

    /// The blank walls, the cornice and the roof.
    fn shell(&self, wall: Material, f: &Fabric) -> Mesh {
        let mut mesh = Mesh::new();
        let (w, d, top) = (BAY * f64::from(self.width), BAY * f64::from(self.depth), self.height());
        let corners = [v(0.0, 0.0, 0.0), v(w, 0.0, 0.0), v(w, d, 0.0), v(0.0, d, 0.0)];
        let up = |p: DVec3, z: f64| v(p.x, p.y, z);
        for side in 0..4 {
            let (a, b) = (corners[side], corners[(side + 1) % 4]);
            if !self.bayed[side] {
                mesh.quad([a, b, up(b, top), up(a, top)], wall);
            }
        }
        // Ledges end just short of those of the neighbouring house.
        mesh.cuboid(v(0.005, -0.14, top - 0.2), v(w - 0.005, 0.05, top + 0.06), f.stone);
        mesh.cuboid(v(0.005, -0.08, GROUND_FLOOR - 0.17), v(w - 0.005, 0.06, GROUND_FLOOR - 0.05), f.stone);
        if self.pitched {
            let (ridge, rise, eaves) = (d / 2.0, d * 0.42, 0.4);
            let slope = rise / ridge;
            for x in [0.0, w] {
                let gable = [v(x, 0.0, top), v(x, d, top), v(x, ridge, top + rise)];
                let [a, b, c] = gable;
                mesh.triangle(if x > 0.0 { [a, b, c] } else { [a, c, b] }, wall);
            }
            // Two slabs of tiles meet in the ridge.
            let (thick, out) = (0.18, 0.15);
            let section = |x: f64| {
                let low = top - slope * eaves;
                [
                    v(x, -eaves, low),
                    v(x, ridge, top + rise),
                    v(x, d + eaves, low),
                    v(x, d + eaves, low + thick),
                    v(x, ridge, top + rise + thick),
                    v(x, -eaves, low + thick),
                ]
            };
            let (left, right) = (section(-out), section(w + out));
            mesh.skin(&left, &right, f.roof);
            for [a, b, c, e] in [[0, 1, 4, 5], [1, 2, 3, 4]] {
                mesh.quad([left[e], left[c], left[b], left[a]], f.roof);
                mesh.quad([right[a], right[b], right[c], right[e]], f.roof);
            }
            for i in 0..self.width / 2 {
                self.dormer(&mut mesh, BAY * (2.0 * f64::from(i) + 1.0), top, slope, f);
            }
            for x in [0.18 * w, 0.71 * w] {
                mesh.cuboid(
                    v(x, ridge + 0.3, top + rise - 0.9),
                    v(x + 1.1, ridge + 0.9, top + rise + 1.3),
                    f.stone,
                );
                for i in 0..3 {
                    let base = v(x + 0.2 + 0.35 * f64::from(i), ridge + 0.6, top + rise + 1.29);
                    mesh.lathe(base, &[(0.11, 0.0), (0.09, 0.4)], 12, f.awning);
                }
            }
        } else {
            // The parapet has an outside, a coping and an inside. The roof lies between its sides.
            let high = top + 0.875;
            let ring = |inset: f64, z: f64| {
                [
                    v(inset, inset, z),
                    v(w - inset, inset, z),
                    v(w - inset, d - inset, z),
                    v(inset, d - inset, z),
                ]
            };
            mesh.skin(&ring(0.0, top), &ring(0.0, high), wall);
            mesh.skin(&ring(0.0, high), &ring(0.25, high), f.stone);
            mesh.skin(&ring(0.25, high), &ring(0.25, top - 0.125), wall);
            mesh.quad(ring(0.25, top - 0.125), f.roof);
            mesh.cuboid(v(w * 0.3, d * 0.4, top - 0.2), v(w * 0.3 + 3.0, d * 0.4 + 2.5, top + 2.4), wall);
            for i in 0..3 {
                let at = v(w * 0.62 + 1.3 * f64::from(i), d * 0.55, top - 0.13);
                mesh.cuboid(at, at + v(0.9, 1.1, 1.0), f.rail);
            }
        }
        mesh
    }

    fn dormer(&self, mesh: &mut Mesh, x: f64, top: f64, slope: f64, f: &Fabric) {
        let (front, half, sill, head) = (0.6, 0.7, top + slope * 0.6 - 0.1, top + slope * 0.6 + 1.5);
        let back = (head - top) / slope + 0.3;
        mesh.cuboid(v(x - half, front, sill), v(x + half, back, head), f.roof);
        mesh.cuboid(
            v(x - half - 0.12, front - 0.15, head - 0.02),
            v(x + half + 0.12, back + 0.1, head + 0.1),
            f.stone,
        );
        mesh.cuboid(
            v(x - half + 0.15, front - 0.03, sill + 0.35),
            v(x + half - 0.15, front + 0.02, head - 0.15),
            f.glass,
        );
        mesh.cuboid(v(x - 0.03, front - 0.05, sill + 0.32), v(x + 0.03, front + 0.01, head - 0.12), f.frame);
    }
}

/// The direction of the x axis after whole quarter turns.
fn quarter(quarters: u32) -> DVec3 {
    [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y][quarters as usize % 4]
}

fn turn(p: DVec3, quarters: u32) -> DVec3 {
    quarter(quarters) * p.x + quarter(quarters + 1) * p.y + v(0.0, 0.0, p.z)
}
