//! A calibration hall with targets of known shape, place and reflectivity around its middle.

use glam::DVec3;
use serde_json::json;

use super::glb::{Document, Material, Place, SceneFile};
use super::label;
use super::mesh::{Mesh, circle, sincos_deg, v};
use super::room::{SUNK, sphere_truth, wedge};

const THICKNESS: f64 = 0.0625;

pub fn make() -> SceneFile {
    let mut doc = Document::new();
    let floor = doc.grey("sealed concrete", 0.3);
    let wall = doc.grey("hall wall", 0.6);
    let roof = doc.grey("roof sheet", 0.45);
    let steel = doc.material("galvanised steel", [0.25, 0.26, 0.28]);
    let yellow = doc.material("safety yellow", [0.7, 0.5, 0.05]);
    let greys =
        [0.05, 0.1, 0.5, 0.8, 0.95].map(|r| (r, doc.grey(&format!("reflectivity {:.0} %", r * 100.0), r)));

    shell(&mut doc, floor, wall, roof, steel, yellow);
    checkers(&mut doc, &greys.map(|(_, m)| m), steel);
    grey_boards(&mut doc, &greys, steel);
    spheres(&mut doc, greys[3].1, steel);
    edges(&mut doc, greys[2].1);
    poles(&mut doc, steel);
    comb(&mut doc, greys[2].1);
    ramp_and_stairs(&mut doc, greys[2].1, yellow);

    doc.finish(
        "hall.glb",
        "A calibration hall of 60 x 20 x 8 m; extras give each target's true geometry in the world's z-up frame, metres.",
    )
}

fn shell(
    doc: &mut Document,
    floor: Material,
    wall: Material,
    roof: Material,
    steel: Material,
    yellow: Material,
) {
    let (x, y, z) = (30.0, 10.0, 8.0);
    let mut mesh = Mesh::new();
    mesh.quad([v(-x, -y, 0.0), v(x, -y, 0.0), v(x, y, 0.0), v(-x, y, 0.0)], floor);
    let mesh = doc.sheet("floor", &mesh);
    let extras =
        json!({ "label": label::FLOOR, "shape": "plane", "point_m": [0, 0, 0], "normal": [0, 0, 1] });
    let node = doc.node("floor", mesh, Place::at(0.0, 0.0, 0.0), extras);
    doc.add(node);

    let mut mesh = Mesh::new();
    let ring = |z| [v(-x, -y, z), v(-x, y, z), v(x, y, z), v(x, -y, z)]; // clockwise, so that the walls face in
    mesh.skin(&ring(0.0), &ring(z), wall);
    mesh.quad(ring(z), roof);
    let mesh = doc.sheet("walls and roof", &mesh);
    let extras = json!({
        "label": label::WALL, "shape": "box from inside", "low_m": [-x, -y, 0], "high_m": [x, y, z],
    });
    let node = doc.node("walls and roof", mesh, Place::at(0.0, 0.0, 0.0), extras);
    doc.add(node);

    // A frame stands every 6 m: two columns of I-section and a lattice girder.
    let mut mesh = Mesh::new();
    for side in [-1.0, 1.0] {
        for (half_width, low, high) in
            [(0.125, 0.0, 0.03125), (0.015625, 0.0234375, 0.2421875), (0.125, 0.234375, 0.265625)]
        {
            let (a, b) = (side * (10.0 - low - SUNK), side * (10.0 - high - SUNK));
            mesh.cuboid(v(-half_width, a.min(b), -SUNK), v(half_width, a.max(b), 7.0), steel);
        }
    }
    for z in [6.75, 7.625] {
        mesh.cuboid(v(-0.0625, -9.9375, z), v(0.0625, 9.9375, z + 0.125), steel);
    }
    for i in 0..16 {
        let y = -9.5 + 1.1875 * f64::from(i);
        let (a, b) = if i % 2 == 0 { (6.8125, 7.6875) } else { (7.6875, 6.8125) };
        mesh.tube(&[(v(0.0, y, a), 0.04), (v(0.0, y + 1.1875, b), 0.04)], 8, steel);
    }
    let frame = doc.solid("portal frame", &mesh);
    let places: Vec<_> = (0..9).map(|i| Place::at(-24.0 + 6.0 * f64::from(i), 0.0, 0.0)).collect();
    let node = doc.instances("portal frames", frame, &places, json!({ "label": label::WALL }));
    doc.add(node);

    let mut mesh = Mesh::new();
    for side in [-1.0, 1.0] {
        let edge = side * 9.0;
        mesh.quad(
            [
                v(-29.0, edge - 0.0625, 0.00390625),
                v(29.0, edge - 0.0625, 0.00390625),
                v(29.0, edge + 0.0625, 0.00390625),
                v(-29.0, edge + 0.0625, 0.00390625),
            ],
            yellow,
        );
    }
    let mesh = doc.sheet("floor lines", &mesh);
    let node = doc.node("floor lines", mesh, Place::at(0.0, 0.0, 0.0), json!({ "label": label::MARKING }));
    doc.add(node);
}

/// A board at the origin whose front faces +x. Each of its `rows` and `columns` of cells has a material.
fn board(width: f64, height: f64, cells: &[Vec<Material>], back: Material) -> Mesh {
    let mut mesh = Mesh::new();
    let (rows, columns) = (cells.len(), cells[0].len());
    let at = |x: f64, row: usize, column: usize| {
        v(x, width * (column as f64 / columns as f64 - 0.5), height * (row as f64 / rows as f64 - 0.5))
    };
    for (row, cells) in cells.iter().enumerate() {
        for (column, &material) in cells.iter().enumerate() {
            let corners = |x: f64| {
                [
                    at(x, row, column),
                    at(x, row, column + 1),
                    at(x, row + 1, column + 1),
                    at(x, row + 1, column),
                ]
            };
            mesh.quad(corners(0.0), material);
            let [a, b, c, d] = corners(-THICKNESS);
            mesh.quad([d, c, b, a], back);
        }
    }
    let mut rim: Vec<(usize, usize)> = (0..columns).map(|c| (0, c)).collect();
    rim.extend((0..rows).map(|r| (r, columns)));
    rim.extend((0..columns).map(|c| (rows, columns - c)));
    rim.extend((0..rows).map(|r| (rows - r, 0)));
    let ring = |x: f64| rim.iter().map(|&(row, column)| at(x, row, column)).collect::<Vec<_>>();
    mesh.skin(&ring(-THICKNESS), &ring(0.0), back);
    mesh
}

/// Places the middle of a board at a range and an azimuth from the z axis, on a post. `tilt` is the angle by which its
/// normal is turned away from the axis.
#[allow(clippy::too_many_arguments)] // a target has all of these properties
fn put_board(
    doc: &mut Document,
    name: &str,
    mesh: &Mesh,
    size: [f64; 2],
    (range, azimuth, z): (f64, f64, f64),
    tilt: f64,
    more: serde_json::Value,
    steel: Material,
) {
    let (s, c) = sincos_deg(azimuth);
    let centre = v(range * c, range * s, z);
    let place = Place::at(centre.x, centre.y, centre.z).yaw(azimuth + 180.0 + tilt);
    let normal = place.direction(DVec3::X);
    let mut extras = json!({
        "label": label::TARGET, "shape": "rectangle", "centre_m": centre.to_array(),
        "normal": normal.to_array(), "size_m": size, "tilt_deg": tilt,
    });
    if let (Some(extras), serde_json::Value::Object(more)) = (extras.as_object_mut(), more) {
        extras.extend(more);
    }
    let mesh = doc.solid(name, mesh);
    let board = doc.node(name, mesh, place, extras);
    doc.add(board);

    let mut post = Mesh::new();
    let top = z - size[1] / 2.0;
    post.tube(&[(v(0.0, 0.0, -SUNK), 0.03), (v(0.0, 0.0, top + 0.0078125), 0.03)], 12, steel);
    let plate = |z| circle(v(0.0, 0.0, z), 0.25, 24);
    post.prism(&plate(-SUNK), &plate(0.015625), steel);
    let post = doc.solid("post", &post);
    let foot = centre - normal * (THICKNESS / 2.0);
    let node =
        doc.node("post", post, Place::at(foot.x, foot.y, 0.0), json!({ "label": label::POLE, "of": name }));
    doc.add(node);
}

fn checkers(doc: &mut Document, greys: &[Material; 5], steel: Material) {
    for (range, azimuth, tilt) in [
        (5.0, 55.0, 0.0),
        (7.5, 32.0, 15.0),
        (10.0, -38.0, 30.0),
        (12.5, 15.0, -30.0),
        (15.0, -22.0, 45.0),
        (20.0, -11.0, 60.0),
        (25.0, 7.0, 75.0),
        (28.0, 0.0, 0.0),
    ] {
        let cells: Vec<Vec<_>> = (0..5).map(|r| (0..5).map(|c| greys[(r * 2 + c) % 5]).collect()).collect();
        let mesh = board(2.0, 2.0, &cells, steel);
        let name = format!("checker {range} m, tilt {tilt} deg");
        let more = json!({ "cells": [5, 5], "cell_reflectivity_first_row": [0.05, 0.1, 0.5, 0.8, 0.95] });
        put_board(doc, &name, &mesh, [2.0, 2.0], (range, azimuth, 1.75), tilt, more, steel);
    }
}

fn grey_boards(doc: &mut Document, greys: &[(f64, Material); 5], steel: Material) {
    for (range, azimuths) in
        [(10.0, [127.0, 139.0, 151.0, 209.0, 221.0]), (20.0, [166.0, 173.0, 180.0, 187.0, 194.0])]
    {
        for (&(reflectivity, material), azimuth) in greys.iter().zip(azimuths) {
            let mesh = board(1.25, 2.0, &[vec![material]], steel);
            let name = format!("board {:.0} % at {range} m", reflectivity * 100.0);
            let more = json!({ "reflectivity": reflectivity });
            put_board(doc, &name, &mesh, [1.25, 2.0], (range, azimuth, 1.75), 0.0, more, steel);
        }
    }
}

fn spheres(doc: &mut Document, white: Material, steel: Material) {
    for (radius, x, y, z) in
        [(0.25, 6.0, -1.0, 1.5), (0.5, -6.0, -1.5, 1.5), (1.0, -7.0, 2.5, 1.5), (0.125, 4.0, 1.25, 1.75)]
    {
        let (sides, rows) = (96, 48);
        let mut mesh = Mesh::new();
        mesh.ellipsoid(DVec3::ZERO, DVec3::splat(radius), sides, rows, white);
        let name = format!("sphere {radius} m");
        let mesh = doc.solid(&name, &mesh);
        let extras = sphere_truth(label::TARGET, v(x, y, z), radius, sides, rows);
        let node = doc.node(&name, mesh, Place::at(x, y, z), extras);
        doc.add(node);
        let mut stand = Mesh::new();
        stand.tube(&[(v(0.0, 0.0, -SUNK), 0.05), (v(0.0, 0.0, z - radius + radius / 16.0), 0.05)], 16, steel);
        let stand = doc.solid("stand", &stand);
        let node =
            doc.node("stand", stand, Place::at(x, y, 0.0), json!({ "label": label::POLE, "of": name }));
        doc.add(node);
    }
}

/// Upright wedges whose edges point at the middle of the hall, and a corner that opens to it.
fn edges(doc: &mut Document, material: Material) {
    for (angle, azimuth) in [(30.0, -60.0), (60.0, -75.0), (90.0, -90.0), (120.0, -105.0)] {
        let range = 7.0;
        let (s, c) = sincos_deg(azimuth);
        let (edge_s, edge_c) = sincos_deg(angle / 2.0);
        let side = 1.0;
        // The wedge's edge is at the local origin, and the wedge opens along +x.
        let foot =
            |z| [v(0.0, 0.0, z), v(side * edge_c, -side * edge_s, z), v(side * edge_c, side * edge_s, z)];
        let mut mesh = Mesh::new();
        mesh.prism(&foot(-SUNK), &foot(2.0), material);
        let name = format!("edge {angle} deg");
        let mesh = doc.solid(&name, &mesh);
        let edge = v(range * c, range * s, 0.0);
        let place = Place::at(edge.x, edge.y, 0.0).yaw(azimuth);
        let extras = json!({
            "label": label::TARGET, "shape": "edge", "dihedral_deg": angle, "foot_m": edge.to_array(),
            "height_m": 2.0, "bisector": place.direction(-DVec3::X).to_array(),
        });
        let node = doc.node(&name, mesh, place, extras);
        doc.add(node);
    }
    // The corner has three boards at right angles, 1 m each, seen from inside.
    let mut mesh = Mesh::new();
    let t = THICKNESS;
    let outline = [
        v(-t, -t, 0.0),
        v(1.0, -t, 0.0),
        v(1.0, 0.0, 0.0),
        v(0.0, 0.0, 0.0),
        v(0.0, 1.0, 0.0),
        v(-t, 1.0, 0.0),
    ];
    let lifted = |z: f64| outline.map(|p| p + v(0.0, 0.0, z));
    // The two upright boards form an L on a square base. Their inner faces end where the top of the base begins.
    let (low, middle, high) = (lifted(-t), lifted(0.0), lifted(1.0));
    for [a, b, c, d] in [[0, 1, 2, 3], [0, 3, 4, 5]] {
        mesh.quad([high[a], high[b], high[c], high[d]], material);
    }
    mesh.skin(&middle, &high, material);
    mesh.quad([middle[3], middle[2], v(1.0, 1.0, 0.0), middle[4]], material);
    let base = |ring: &[DVec3; 6]| [ring[0], ring[1], ring[2], v(1.0, 1.0, ring[0].z), ring[4], ring[5]];
    let (low, middle) = (base(&low), base(&middle));
    mesh.skin(&low, &middle, material);
    for i in 1..5 {
        mesh.triangle([low[0], low[i + 1], low[i]], material);
    }
    let mesh = doc.solid("corner", &mesh);
    let place = Place::at(-5.0, -7.5, 0.75).yaw(11.25);
    let extras = json!({
        "label": label::TARGET, "shape": "trihedral corner", "corner_m": [-5.0, -7.5, 0.75], "side_m": 1.0,
        "normals": [
            place.direction(DVec3::X).to_array(), place.direction(DVec3::Y).to_array(), [0.0, 0.0, 1.0],
        ],
    });
    let node = doc.node("corner", mesh, place, extras);
    doc.add(node);
}

fn poles(doc: &mut Document, steel: Material) {
    for (radius, azimuth) in [(0.005, 80.0), (0.01, 87.0), (0.02, 94.0), (0.05, 101.0), (0.1, 108.0)] {
        let (range, height, sides) = (6.0, 3.0, 48);
        let (s, c) = sincos_deg(azimuth);
        let mut mesh = Mesh::new();
        let ring = |z| circle(v(0.0, 0.0, z), radius, sides);
        mesh.prism(&ring(-SUNK), &ring(height), steel);
        let name = format!("pole {} mm", radius * 1000.0);
        let mesh = doc.solid(&name, &mesh);
        let at = v(range * c, range * s, 0.0);
        let extras = json!({
            "label": label::POLE, "shape": "cylinder", "axis_m": at.to_array(), "radius_m": radius,
            "height_m": height,
        });
        let node = doc.node(&name, mesh, Place::at(at.x, at.y, 0.0), extras);
        doc.add(node);
    }
}

/// Upright slats with increasing gaps, which show the angular resolution of a sensor.
fn comb(doc: &mut Document, material: Material) {
    let mut mesh = Mesh::new();
    let gaps = [0.005, 0.01, 0.02, 0.03, 0.04, 0.06, 0.08, 0.12];
    let slat = 0.05;
    let total: f64 = gaps.iter().sum::<f64>() + slat * (gaps.len() + 1) as f64;
    let mut x = -total / 2.0;
    for i in 0..=gaps.len() {
        mesh.cuboid(v(x, -0.01, 0.5), v(x + slat, 0.01, 2.0), material);
        x += slat + gaps.get(i).copied().unwrap_or(0.0);
    }
    // Rails behind the ends of the slats hold them.
    for z in [0.5625, 1.875] {
        mesh.cuboid(v(-total / 2.0 - 0.01, 0.005, z), v(total / 2.0 + 0.01, 0.03, z + 0.0625), material);
    }
    for side in [-1.0, 1.0] {
        let x = side * (total / 2.0 - slat / 2.0);
        mesh.cuboid(v(x - 0.02, 0.02, -SUNK), v(x + 0.02, 0.06, 1.9), material);
    }
    let mesh = doc.solid("comb", &mesh);
    let extras = json!({ "label": label::TARGET, "shape": "comb", "slat_m": slat, "gaps_m": gaps });
    let node = doc.node("comb", mesh, Place::at(-3.5, 7.5, 0.0), extras);
    doc.add(node);
}

fn ramp_and_stairs(doc: &mut Document, grey: Material, yellow: Material) {
    let (length, width, height) = (10.0, 2.5, 1.0);
    let mut mesh = Mesh::new();
    wedge(&mut mesh, length, width, height, grey);
    let ramp = doc.solid("ramp", &mesh);
    let extras = json!({
        "label": label::TARGET, "shape": "wedge", "point_m": [12.0, 7.0, 0.0], "length_m": length,
        "width_m": width, "height_m": height, "slope": height / length,
        "normal": v(-height, 0.0, length).normalize().to_array(),
    });
    let ramp = doc.node("ramp 10 %", ramp, Place::at(12.0, 7.0, 0.0), extras);
    doc.add(ramp);

    // The stairs are built step by step, with a column under each tread.
    let (steps, rise, tread) = (8, 0.171875, 0.28125);
    let mut mesh = Mesh::new();
    for i in 0..steps {
        let (a, b) = (f64::from(i) * tread, f64::from(i + 1) * tread);
        let top = f64::from(i + 1) * rise;
        for (y, flip) in [(-0.75, false), (0.75, true)] {
            let mut side = vec![v(a, y, -SUNK), v(b, y, -SUNK), v(b, y, top), v(a, y, top)];
            if i > 0 {
                side.push(v(a, y, f64::from(i) * rise));
            }
            if flip {
                side.reverse();
            }
            let middle = v((a + b) / 2.0, y, top / 2.0);
            for j in 0..side.len() {
                mesh.triangle([middle, side[j], side[(j + 1) % side.len()]], grey);
            }
        }
        let (low, high) = (-0.75, 0.75);
        mesh.quad([v(a, low, top), v(b, low, top), v(b, high, top), v(a, high, top)], yellow);
        let below = if i == 0 { -SUNK } else { f64::from(i) * rise };
        mesh.quad([v(a, high, below), v(a, low, below), v(a, low, top), v(a, high, top)], grey);
        mesh.quad([v(a, high, -SUNK), v(b, high, -SUNK), v(b, low, -SUNK), v(a, low, -SUNK)], grey);
    }
    let end = f64::from(steps) * tread;
    let top = f64::from(steps) * rise;
    mesh.quad([v(end, -0.75, -SUNK), v(end, 0.75, -SUNK), v(end, 0.75, top), v(end, -0.75, top)], grey);
    let stairs = doc.solid("stairs", &mesh);
    let extras = json!({
        "label": label::TARGET, "shape": "stairs", "steps": steps, "rise_m": rise, "tread_m": tread,
    });
    let stairs = doc.node("stairs", stairs, Place::at(-16.0, -7.0, 0.0).yaw(180.0), extras);
    doc.add(stairs);
}
