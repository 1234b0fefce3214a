//! A furnished room of simple shapes. The `extras` of each node hold its closed form.

use glam::DVec3;
use serde_json::json;

use super::glb::{Document, Material, Place, SceneFile};
use super::label;
use super::mesh::{Mesh, circle, sincos_deg, v};
use super::rng::Rng;

/// The depth by which objects reach below the floor on which they stand (and pillars above the ceiling), so that no two
/// faces coincide.
pub const SUNK: f64 = 1.0 / 64.0;

pub fn make() -> SceneFile {
    let mut doc = Document::new();
    let floor = doc.material("oak floor", [0.42, 0.28, 0.16]);
    let wall = doc.grey("white wall", 0.8);
    let ceiling = doc.grey("ceiling", 0.9);
    let wood = doc.material("beech", [0.55, 0.38, 0.22]);
    let card = doc.material("cardboard", [0.45, 0.32, 0.18]);
    let blue = doc.material("blue paint", [0.05, 0.12, 0.45]);
    let red = doc.material("red rubber", [0.5, 0.04, 0.03]);
    let dark = doc.grey("black felt", 0.05);
    let concrete = doc.grey("concrete", 0.35);

    let (x, y, z) = (5.0, 4.0, 3.0);
    let mut mesh = Mesh::new();
    mesh.quad([v(-x, -y, 0.0), v(x, -y, 0.0), v(x, y, 0.0), v(-x, y, 0.0)], floor);
    let mesh = doc.sheet("floor", &mesh);
    let extras = json!({ "label": label::FLOOR, "shape": "plane", "point_m": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0] });
    let node = doc.node("floor", mesh, Place::at(0.0, 0.0, 0.0), extras);
    doc.add(node);

    let mut mesh = Mesh::new();
    let ring = |z| [v(-x, -y, z), v(-x, y, z), v(x, y, z), v(x, -y, z)]; // clockwise, so that the walls face in
    mesh.skin(&ring(0.0), &ring(z), wall);
    mesh.quad(ring(z), ceiling);
    let mesh = doc.sheet("walls and ceiling", &mesh);
    let extras = json!({
        "label": label::WALL, "shape": "box from inside", "low_m": [-x, -y, 0.0], "high_m": [x, y, z],
    });
    let node = doc.node("walls and ceiling", mesh, Place::at(0.0, 0.0, 0.0), extras);
    doc.add(node);

    // Of the cartons, one is parallel to the axes, one is rotated, and one stands on top of the first.
    let carton = |doc: &mut Document, name: &str, size: DVec3, place: Place, material| {
        let mut mesh = Mesh::new();
        let half = size / 2.0;
        mesh.cuboid(v(-half.x, -half.y, -SUNK), v(half.x, half.y, size.z), material);
        let mesh = doc.solid(name, &mesh);
        let extras = json!({ "label": label::OBJECT, "shape": "box", "size_m": size.to_array() });
        let node = doc.node(name, mesh, place, extras);
        doc.add(node);
    };
    carton(&mut doc, "crate", v(1.0, 1.0, 1.0), Place::at(-3.5, 2.5, 0.0), wood);
    carton(&mut doc, "carton on the crate", v(0.5, 0.375, 0.25), Place::at(-3.5, 2.5, 1.0).yaw(20.0), card);
    carton(&mut doc, "turned carton", v(0.75, 0.5, 0.5), Place::at(-1.5, 2.75, 0.0).yaw(30.0), card);
    carton(&mut doc, "black box", v(0.5, 0.5, 0.75), Place::at(1.0, -3.0, 0.0).yaw(-12.0), dark);

    for (name, at, radius, material) in
        [("ball", v(3.0, -1.5, 0.5), 0.5, red), ("small ball", v(2.5, 1.75, 1.0), 0.25, blue)]
    {
        let (sides, rows) = (48, 24);
        let mut mesh = Mesh::new();
        mesh.ellipsoid(DVec3::ZERO, DVec3::splat(radius), sides, rows, material);
        let mesh = doc.solid(name, &mesh);
        let extras = sphere_truth(label::OBJECT, at, radius, sides, rows);
        let node = doc.node(name, mesh, Place::at(at.x, at.y, at.z), extras);
        doc.add(node);
    }

    let mut mesh = Mesh::new();
    let (length, width, height) = (2.0, 1.0, 0.5);
    wedge(&mut mesh, length, width, height, concrete);
    let mesh = doc.solid("ramp", &mesh);
    let place = Place::at(-4.0, -3.0, 0.0);
    let extras = json!({
        "label": label::OBJECT, "shape": "wedge", "length_m": length, "width_m": width, "height_m": height,
        "point_m": [-4.0, -3.0, 0.0],
        "normal": v(-height, 0.0, length).normalize().to_array(),
    });
    let node = doc.node("ramp", mesh, place, extras);
    doc.add(node);

    let (radius, sides) = (0.25, 64);
    let mut mesh = Mesh::new();
    let ring = |z| circle(v(0.0, 0.0, z), radius, sides);
    mesh.prism(&ring(-SUNK), &ring(z + SUNK), concrete);
    let mesh = doc.solid("pillar", &mesh);
    let extras =
        json!({ "label": label::WALL, "shape": "cylinder", "axis_m": [-2.0, -1.5, 0.0], "radius_m": radius });
    let node = doc.node("pillar", mesh, Place::at(-2.0, -1.5, 0.0), extras);
    doc.add(node);

    let mut mesh = Mesh::new();
    table(&mut mesh, wood);
    let mesh = doc.solid("table", &mesh);
    let node = doc.node("table", mesh, Place::at(2.5, 1.5, 0.0), json!({ "label": label::FURNITURE }));
    doc.add(node);

    let mut mesh = Mesh::new();
    chair(&mut mesh, blue, wood);
    let mesh = doc.solid("chair", &mesh);
    for (name, place) in [
        ("chair at the table", Place::at(2.25, 0.5, 0.0).yaw(80.0)),
        ("chair by the window", Place::at(3.5, 2.625, 0.0).yaw(-110.0)),
        ("chair in the corner", Place::at(-4.25, 0.5, 0.0).yaw(-20.0)),
    ] {
        let node = doc.node(name, mesh, place, json!({ "label": label::FURNITURE }));
        doc.add(node);
    }

    let mut mesh = Mesh::new();
    shelf(&mut mesh, wood, &[red, blue, card, dark]);
    let mesh = doc.solid("shelf", &mesh);
    let node = doc.node("shelf", mesh, Place::at(0.0, 3.75, 0.0), json!({ "label": label::FURNITURE }));
    doc.add(node);

    doc.finish("room.glb", "A closed room of 10 x 8 x 3 m with simple shapes; extras give their closed forms in the world's z-up frame, metres.")
}

/// The known geometry of a ball: its vertices lie on the sphere, and its faces lie at most `sagitta_m` inside.
pub fn sphere_truth(label: u32, centre: DVec3, radius: f64, sides: usize, rows: usize) -> serde_json::Value {
    // A face spans 360/sides degrees of longitude and 180/rows degrees of latitude. Its corners lie within half the
    // diagonal of that from its middle, which is largest at the equator.
    let half_diagonal = 180.0 * (1.0 / (sides * sides) as f64 + 0.25 / (rows * rows) as f64).sqrt();
    let (_, cos) = sincos_deg(half_diagonal);
    json!({
        "label": label, "shape": "sphere", "centre_m": centre.to_array(), "radius_m": radius,
        "sagitta_m": radius * (1.0 - cos),
    })
}

/// A ramp that rises along +x from the origin, centred on y.
pub fn wedge(mesh: &mut Mesh, length: f64, width: f64, height: f64, material: Material) {
    let side = |y: f64| [v(length, y, -SUNK), v(length, y, height), v(0.0, y, 0.0), v(0.0, y, -SUNK)];
    let (right, left) = (side(-width / 2.0), side(width / 2.0));
    for i in 1..3 {
        mesh.triangle([right[0], right[i], right[i + 1]], material);
        mesh.triangle([left[0], left[i + 1], left[i]], material);
    }
    mesh.skin(&left, &right, material);
}

fn table(mesh: &mut Mesh, wood: Material) {
    mesh.cuboid(v(-0.875, -0.5, 0.703125), v(0.875, 0.5, 0.75), wood);
    for (x, y) in [(-0.75, -0.375), (0.75, -0.375), (0.75, 0.375), (-0.75, 0.375)] {
        mesh.cuboid(v(x - 0.03125, y - 0.03125, -SUNK), v(x + 0.03125, y + 0.03125, 0.71875), wood);
    }
}

/// A chair that faces +x.
fn chair(mesh: &mut Mesh, seat: Material, wood: Material) {
    mesh.cuboid(v(-0.21875, -0.21875, 0.4375), v(0.21875, 0.21875, 0.46875), seat);
    mesh.cuboid(v(-0.203125, -0.203125, 0.625), v(-0.1875, 0.203125, 0.875), seat);
    for y in [-0.1875, 0.1875] {
        mesh.limb(&[(v(0.1875, y, 0.015), 0.0175), (v(0.1875, y, 0.45), 0.0175)], 12, wood);
        mesh.limb(&[(v(-0.1875, y, 0.015), 0.0175), (v(-0.21, y, 0.9), 0.0175)], 12, wood);
    }
}

/// A bookcase of 1.5 x 0.375 x 2 m with its back to +y.
fn shelf(mesh: &mut Mesh, wood: Material, spines: &[Material]) {
    for x in [-0.75, 0.71875] {
        mesh.cuboid(v(x, -0.1875, -SUNK), v(x + 0.03125, 0.1875, 2.0), wood);
    }
    for i in 0..5 {
        let z = 0.0625 + 0.46875 * f64::from(i);
        // The boards reach a little into the sides.
        mesh.cuboid(v(-0.734375, -0.171875, z), v(0.734375, 0.171875, z + 0.03125), wood);
        if i == 4 {
            break;
        }
        let mut rng = Rng::new(40 + i as u64);
        let mut x = -0.7;
        while x < 0.3 + 0.1 * f64::from(i) {
            let (width, height, depth) = (rng.range(0.02, 0.06), rng.range(0.2, 0.34), rng.range(0.14, 0.22));
            let low = v(x, 0.16 - depth, z + 0.02);
            mesh.cuboid(low, v(x + width, 0.16, z + 0.03125 + height), spines[rng.below(spines.len())]);
            x += width + 0.002;
        }
    }
}
