//! Cars, bicycles and a forklift. Each stands at the origin and faces +x.

use glam::{DAffine3, DMat3, DVec3};

use super::glb::{Document, Material};
use super::mesh::{Mesh, circle, sincos_deg, turned, v};

/// Materials of a car.
#[derive(Clone, Copy)]
pub struct CarPaint {
    pub body: Material,
    pub glass: Material,
    pub tyre: Material,
    pub rim: Material,
    pub light: Material,
    pub tail: Material,
    pub trim: Material,
}

impl CarPaint {
    /// The materials of a car with a body of one.
    pub fn with_body(doc: &mut Document, body: Material) -> Self {
        Self {
            body,
            glass: doc.material("car glass", [0.04, 0.05, 0.05]),
            tyre: doc.grey("tyre", 0.04),
            rim: doc.grey("alloy", 0.55),
            light: doc.grey("headlight", 0.8),
            tail: doc.material("tail light", [0.5, 0.02, 0.02]),
            trim: doc.grey("black trim", 0.06),
        }
    }
}

/// The outline of a car in metres. x is measured forward from the middle.
pub struct CarShape {
    pub length: f64,
    pub width: f64,
    pub wheel_radius: f64,
    pub axles: [f64; 2],
    /// The upper outline of the body without the greenhouse, as (x, z) from the tail.
    pub belt: &'static [(f64, f64)],
    /// The line of the roof, from the foot of the rear window to the foot of the windscreen.
    pub roof: &'static [(f64, f64)],
    /// The ends of the side windows and the pillars between them.
    pub side_glass: &'static [(f64, f64)],
    /// The x of the rear window and of the windscreen, each as (foot, top).
    pub rear_window: (f64, f64),
    pub windscreen: (f64, f64),
}

pub const HATCHBACK: CarShape = CarShape {
    length: 4.1,
    width: 1.76,
    wheel_radius: 0.315,
    axles: [-1.28, 1.28],
    belt: &[
        (-2.05, 0.62),
        (-2.0, 0.86),
        (-1.85, 0.96),
        (0.7, 0.94),
        (1.05, 0.93),
        (1.7, 0.82),
        (1.98, 0.68),
        (2.05, 0.52),
    ],
    roof: &[(-2.0, 0.9), (-1.72, 1.3), (-1.35, 1.44), (-0.5, 1.5), (0.15, 1.47), (0.45, 1.38), (1.1, 0.94)],
    side_glass: &[(-1.42, -0.86), (-0.76, -0.02), (0.06, 0.72)],
    rear_window: (-1.93, -1.5),
    windscreen: (1.06, 0.38),
};

pub const SALOON: CarShape = CarShape {
    length: 4.7,
    width: 1.82,
    wheel_radius: 0.33,
    axles: [-1.42, 1.42],
    belt: &[
        (-2.35, 0.6),
        (-2.3, 0.88),
        (-2.1, 0.97),
        (-1.5, 0.97),
        (0.7, 0.92),
        (1.1, 0.91),
        (1.95, 0.8),
        (2.27, 0.66),
        (2.35, 0.5),
    ],
    roof: &[(-1.75, 0.96), (-1.05, 1.33), (-0.7, 1.41), (-0.1, 1.44), (0.2, 1.41), (0.45, 1.35), (1.2, 0.9)],
    side_glass: &[(-1.12, -0.72), (-0.64, 0.02), (0.1, 0.8)],
    rear_window: (-1.62, -0.98),
    windscreen: (1.14, 0.4),
};

pub const VAN: CarShape = CarShape {
    length: 5.1,
    width: 1.96,
    wheel_radius: 0.34,
    axles: [-1.6, 1.65],
    belt: &[
        (-2.55, 0.7),
        (-2.5, 1.1),
        (-2.4, 1.2),
        (0.9, 1.15),
        (1.75, 1.08),
        (2.3, 0.96),
        (2.5, 0.75),
        (2.55, 0.55),
    ],
    roof: &[(-2.5, 1.15), (-2.42, 1.8), (-2.25, 1.95), (-1.0, 2.0), (0.6, 1.98), (0.95, 1.9), (1.85, 1.07)],
    side_glass: &[(0.1, 0.62), (0.7, 1.22)],
    rear_window: (-2.49, -2.4),
    windscreen: (1.78, 0.95),
};

const WHEEL_WIDTH: f64 = 0.2;

/// A car. Its body, underbody, wheels and mirrors are closed meshes each.
pub fn car(shape: &CarShape, paint: &CarPaint) -> Mesh {
    let mut mesh = Mesh::new();
    body(&mut mesh, shape, paint, 72);
    let wheel = wheel(shape.wheel_radius, paint, 32);
    for (_, at, yaw_deg) in wheel_places(shape) {
        mesh.add(&wheel, turned(yaw_deg, at));
    }
    fittings(&mut mesh, shape, paint);
    mesh
}

/// The same car with fewer triangles and without wheels.
pub fn plain_car(shape: &CarShape, paint: &CarPaint) -> Mesh {
    let mut mesh = Mesh::new();
    body(&mut mesh, shape, paint, 36);
    fittings(&mut mesh, shape, paint);
    mesh
}

/// A wheel of [`plain_car`], as it stands at [`wheel_places`].
pub fn plain_wheel(shape: &CarShape, paint: &CarPaint) -> Mesh {
    wheel(shape.wheel_radius, paint, 16)
}

/// The wheels of a car by name, each with its place and the yaw that turns its outer side outwards.
pub fn wheel_places(shape: &CarShape) -> [(&'static str, DVec3, f64); 4] {
    let (y, r) = (shape.width / 2.0 - WHEEL_WIDTH - 0.02, shape.wheel_radius);
    let [rear, front] = shape.axles;
    [
        ("rear left wheel", v(rear, y, r), 0.0),
        ("rear right wheel", v(rear, -y, r), 180.0),
        ("front left wheel", v(front, y, r), 0.0),
        ("front right wheel", v(front, -y, r), 180.0),
    ]
}

/// The parts on a body, and between the wheels.
fn fittings(mesh: &mut Mesh, shape: &CarShape, paint: &CarPaint) {
    let half = shape.width / 2.0;
    // The wheel arches are filled between the wheels, so that one cannot look through under the car.
    let inner = half - WHEEL_WIDTH - 0.05;
    mesh.cuboid(
        v(shape.axles[0] - 0.42, -inner, 0.21),
        v(shape.axles[1] + 0.42, inner, shape.wheel_radius + 0.4),
        paint.trim,
    );
    let (mirror_x, mirror_z) = (shape.windscreen.0 - 0.35, at(shape.belt, shape.windscreen.0) + 0.07);
    for side in [-1.0, 1.0] {
        let centre = v(mirror_x, side * (half + 0.08), mirror_z);
        mesh.ellipsoid(centre, v(0.06, 0.1, 0.075), 12, 8, paint.body);
    }
    // These are the number plates.
    for (x, z) in [(-shape.length / 2.0, 0.66), (shape.length / 2.0, 0.42)] {
        mesh.cuboid(v(x - 0.012, -0.26, z - 0.055), v(x + 0.012, 0.26, z + 0.055), paint.rim);
    }
}

/// Linear interpolation in a table of (x, y).
fn at(table: &[(f64, f64)], x: f64) -> f64 {
    let after = table.iter().position(|&(k, _)| k > x).unwrap_or(table.len() - 1).max(1);
    let ((x0, y0), (x1, y1)) = (table[after - 1], table[after]);
    y0 + (y1 - y0) * ((x - x0) / (x1 - x0)).clamp(0.0, 1.0)
}

/// The mean of a table over ±`reach`, which rounds its corners.
fn smooth(table: &[(f64, f64)], x: f64, reach: f64) -> f64 {
    const TAPS: i32 = 4;
    let sum: f64 = (-TAPS..=TAPS).map(|i| at(table, x + reach * f64::from(i) / f64::from(TAPS))).sum();
    sum / f64::from(2 * TAPS + 1)
}

/// The body as a loft through `count_along` sections, and one more.
fn body(mesh: &mut Mesh, shape: &CarShape, paint: &CarPaint, count_along: usize) {
    let (length, half) = (shape.length, shape.width / 2.0);
    let (sill, arch) = (0.24, shape.wheel_radius + 0.055);
    let (roof_from, roof_to) = (shape.roof[0].0, shape.roof[shape.roof.len() - 1].0);
    // The materials of a segment depend on its position in the section, as a fraction of the way round the half section
    // from the middle below to the middle above.
    const UNDER: usize = 4;
    const SIDE: usize = 7;
    const GLASS: usize = 4;
    const ROOF: usize = 6;
    let mut rings = vec![];
    let mut stations = vec![];
    for i in 0..=count_along {
        // The sections are closer at the ends, where the outline bends.
        let t = 2.0 * i as f64 / count_along as f64 - 1.0;
        let t = t * (1.0 + 0.25 * (1.0 - t * t));
        let x = t * length / 2.0;
        let end = ((x.abs() - (length / 2.0 - 0.45)) / 0.45).max(0.0);
        let width = half * (1.0 - 0.2 * end * end - 0.02 * end);
        let low = shape.axles.iter().fold(sill + 0.14 * end * end, |low, &axle| {
            let dx = x - axle;
            let over = arch * arch - dx * dx;
            if over > 0.0 { low.max(shape.wheel_radius + over.sqrt()) } else { low }
        });
        let belt = smooth(shape.belt, x, 0.06).max(low + 0.12);
        let roof = if x > roof_from && x < roof_to { smooth(shape.roof, x, 0.08) } else { 0.0 };
        // The crown is flat where there is no greenhouse.
        let rise = (roof - belt).max(0.0);
        let crown = 0.035 * (1.0 - 0.5 * end);
        let shoulder = width * 0.985;
        let inward = (0.06 + 0.2 * rise).min(0.2);
        let mut half_ring = vec![];
        for k in 0..UNDER {
            half_ring.push((width * 0.94 * k as f64 / UNDER as f64, low));
        }
        for k in 0..SIDE {
            let t = k as f64 / SIDE as f64;
            let z = low + 0.03 + (belt - low - 0.03) * t;
            // The side bulges towards the middle of its height.
            let bulge = 1.0 - 4.0 * (t - 0.55) * (t - 0.55);
            half_ring.push((width * (0.955 + 0.045 * bulge.max(-0.3)), z));
        }
        for k in 0..=GLASS {
            let t = k as f64 / GLASS as f64;
            half_ring.push((shoulder - (0.02 + inward) * t - 0.02, belt + 0.012 + rise * 0.9 * t));
        }
        let edge = shoulder - 0.04 - inward;
        for k in 1..=ROOF {
            let t = k as f64 / ROOF as f64;
            let (s, c) = sincos_deg(90.0 * t);
            half_ring.push((
                edge * (0.86 * (1.0 - t) + 0.14 * c),
                belt + 0.012 + rise * 0.9 + (0.1 * rise + crown) * s,
            ));
        }
        // The ring goes along below to the left, up, over, and down on the right, which is counter-clockwise about +x.
        let count = half_ring.len();
        let mut ring: Vec<DVec3> = (0..count).map(|k| v(x, half_ring[k].0, half_ring[k].1)).collect();
        ring.extend((1..count - 1).rev().map(|k| v(x, -half_ring[k].0, half_ring[k].1)));
        rings.push(ring);
        stations.push((x, rise));
    }
    let count = rings[0].len();
    let top = count / 2;
    let material = |i: usize, j: usize| {
        let (x, rise) = ((stations[i].0 + stations[i + 1].0) / 2.0, stations[i].1.min(stations[i + 1].1));
        // Both halves are counted from below.
        let j = if j < top { j } else { count - 1 - j };
        let within = |(a, b): (f64, f64)| (a.min(b)..a.max(b)).contains(&x);
        let side_window = (UNDER + SIDE..UNDER + SIDE + GLASS).contains(&j);
        let above = j > UNDER + SIDE + GLASS;
        let side = (UNDER + 1..UNDER + SIDE).contains(&j);
        if side_window && rise > 0.22 && shape.side_glass.iter().any(|&w| within(w))
            || above && (within(shape.windscreen) || within(shape.rear_window))
        {
            paint.glass
        } else if j < UNDER {
            paint.trim
        } else if side && j > UNDER + 3 && x > length / 2.0 - 0.3 {
            paint.light
        } else if side && j > UNDER + 3 && x < -length / 2.0 + 0.16 {
            paint.tail
        } else {
            paint.body
        }
    };
    mesh.loft(&rings, material);
}

/// A wheel about y with its outer side towards +y and its inner side at y = 0.
fn wheel(radius: f64, paint: &CarPaint, sides: usize) -> Mesh {
    let mut upright = Mesh::new();
    let w = WHEEL_WIDTH;
    let r = radius;
    let tyre = [
        (r * 0.64, 0.0),
        (r * 0.93, 0.0),
        (r * 0.985, 0.02),
        (r, 0.045),
        (r, w - 0.045),
        (r * 0.985, w - 0.02),
        (r * 0.93, w),
        (r * 0.64, w - 0.015),
    ];
    upright.ring(DVec3::ZERO, &tyre, sides, paint.tyre);
    upright.lathe(
        DVec3::ZERO,
        &[(r * 0.66, 0.02), (r * 0.66, w - 0.06), (r * 0.2, w - 0.045), (r * 0.16, w - 0.02)],
        sides,
        paint.rim,
    );
    for i in 0..5 {
        let spoke = {
            let mut m = Mesh::new();
            m.cuboid(v(r * 0.14, -0.03, w - 0.07), v(r * 0.65, 0.03, w - 0.025), paint.rim);
            m
        };
        upright.add(&spoke, turned(72.0 * f64::from(i), DVec3::ZERO));
    }
    let mut lying = Mesh::new();
    // This maps z to y.
    let tip = DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y));
    lying.add(&upright, tip);
    lying
}

/// A bicycle on its wheels.
pub fn bicycle(frame: Material, tyre: Material) -> Mesh {
    let mut mesh = Mesh::new();
    let r = 0.34;
    let tip = |x: f64| DAffine3 {
        matrix3: DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
        translation: v(x, 0.0, r),
    };
    let mut wheel = Mesh::new();
    let profile: Vec<_> = circle(DVec3::ZERO, 0.02, 8).iter().map(|p| (r - 0.02 + p.x, p.y)).collect();
    wheel.ring(DVec3::ZERO, &profile, 40, tyre);
    for i in 0..14 {
        let (s, c) = sincos_deg(360.0 * f64::from(i) / 14.0);
        let z = if i % 2 == 0 { 0.03 } else { -0.03 };
        wheel.tube(
            &[(v(0.015 * c, 0.015 * s, z), 0.002), (v(c * (r - 0.035), s * (r - 0.035), 0.0), 0.002)],
            3,
            frame,
        );
    }
    wheel.tube(&[(v(0.0, 0.0, -0.05), 0.022), (v(0.0, 0.0, 0.05), 0.022)], 10, frame);
    mesh.add(&wheel, tip(-0.52));
    mesh.add(&wheel, tip(0.52));
    let (crank, seat, head, front) =
        (v(-0.08, 0.0, 0.3), v(-0.22, 0.0, 0.86), v(0.36, 0.0, 0.84), v(0.52, 0.0, r));
    let rear = v(-0.52, 0.0, r);
    let low_head = v(0.4, 0.0, 0.7);
    for (a, b, radius) in [
        (crank, seat, 0.016),
        (seat.lerp(crank, 0.15), head, 0.016),
        (crank, low_head, 0.019),
        (low_head, head + v(-0.02, 0.0, 0.1), 0.018),
    ] {
        mesh.limb(&[(a, radius), (b, radius)], 8, frame);
    }
    for y in [-0.06, 0.06] {
        let side = v(0.0, y, 0.0);
        mesh.limb(&[(rear + side, 0.009), (crank, 0.009)], 6, frame);
        mesh.limb(&[(rear + side, 0.008), (seat.lerp(crank, 0.15), 0.008)], 6, frame);
        mesh.limb(&[(front + side, 0.012), (low_head + side * 0.6, 0.012)], 6, frame);
        mesh.limb(&[(head + v(-0.03, 0.0, 0.11), 0.011), (head + v(0.0, y * 4.5, 0.13), 0.011)], 6, frame);
        mesh.cuboid(crank + v(-0.05, y * 1.6 - 0.04, -0.12), crank + v(0.05, y * 1.6 + 0.04, -0.1), tyre);
    }
    mesh.limb(&[(seat, 0.013), (seat + v(-0.03, 0.0, 0.12), 0.013)], 8, frame);
    mesh.ellipsoid(seat + v(-0.03, 0.0, 0.14), v(0.14, 0.08, 0.03), 12, 6, tyre);
    mesh
}

/// A counterbalance forklift. Its forks reach to x = 1.9 at the height `lift` above the floor.
pub fn forklift(body: Material, dark: Material, steel: Material, lift: f64) -> Mesh {
    let mut mesh = Mesh::new();
    // The chassis has a rounded counterweight at the back.
    let outline = |z: f64, grow: f64| {
        let mut points = vec![v(0.55, -0.5 - grow, z), v(0.55, 0.5 + grow, z)];
        points.extend((0..=12).map(|i| {
            let (s, c) = sincos_deg(90.0 + 15.0 * f64::from(i));
            v(-0.8 + (0.45 + grow) * c, (0.5 + grow) * s, z)
        }));
        points
    };
    let rings: Vec<_> = [(0.15, -0.03), (0.2, 0.0), (0.7, 0.0), (0.92, -0.02), (0.96, -0.08)]
        .iter()
        .map(|&(z, grow)| outline(z, grow))
        .collect();
    mesh.loft(&rings, |_, _| body);
    // These are the seat, the column and the steering wheel.
    mesh.cuboid(v(-0.75, -0.27, 0.955), v(-0.25, 0.27, 1.08), dark);
    mesh.cuboid(v(-0.8, -0.26, 1.07), v(-0.68, 0.26, 1.5), dark);
    mesh.limb(&[(v(0.35, 0.0, 0.9), 0.03), (v(0.1, 0.0, 1.25), 0.03)], 10, dark);
    let mut wheel = Mesh::new();
    let profile: Vec<_> = circle(DVec3::ZERO, 0.015, 8).iter().map(|p| (0.16 + p.x, p.y)).collect();
    wheel.ring(DVec3::ZERO, &profile, 32, dark);
    let (s, c) = sincos_deg(-35.0);
    let tilt = DAffine3 {
        matrix3: DMat3::from_cols(v(c, 0.0, -s), DVec3::Y, v(s, 0.0, c)),
        translation: v(0.1, 0.0, 1.25),
    };
    mesh.add(&wheel, tilt);
    // This is the overhead guard.
    for y in [-0.46, 0.46] {
        mesh.limb(
            &[
                (v(0.5, y, 0.8), 0.035),
                (v(0.2, y, 2.1), 0.035),
                (v(-0.85, y, 2.1), 0.035),
                (v(-1.0, y, 0.85), 0.035),
            ],
            10,
            dark,
        );
    }
    for i in 0..6 {
        let x = 0.15 - 0.19 * f64::from(i);
        mesh.limb(&[(v(x, -0.46, 2.1), 0.015), (v(x, 0.46, 2.1), 0.015)], 8, dark);
    }
    // The mast consists of two channels and the rails inside them.
    for side in [-1.0, 1.0] {
        let y = side * 0.3;
        mesh.cuboid(v(0.62, y - 0.045, 0.08), v(0.74, y + 0.045, 2.25), steel);
        mesh.cuboid(v(0.66, y * 0.7 - 0.035, 0.1), v(0.77, y * 0.7 + 0.035, 2.2 + lift * 0.5), dark);
        // Each fork has an upright and a blade.
        let f = side * 0.28;
        mesh.cuboid(v(0.8, f - 0.06, lift), v(0.85, f + 0.06, lift + 0.6), dark);
        let blade = [
            v(0.81, f - 0.055, lift),
            v(1.9, f - 0.055, lift),
            v(1.9, f + 0.055, lift),
            v(0.81, f + 0.055, lift),
        ];
        let thick = [0.045, 0.012, 0.012, 0.045];
        let top: Vec<_> = blade.iter().zip(thick).map(|(&p, t)| p + v(0.0, 0.0, t - 0.002)).collect();
        mesh.prism(&blade.map(|p| p - v(0.0, 0.0, 0.002)), &top, dark);
    }
    for z in [0.2, 2.1] {
        mesh.cuboid(v(0.6, -0.3, z), v(0.7, 0.3, z + 0.1), steel);
    }
    for z in [0.08, 0.45] {
        mesh.cuboid(v(0.77, -0.45, lift + z), v(0.81, 0.45, lift + z + 0.1), dark);
    }
    // This is the load backrest.
    for i in 0..6 {
        let y = -0.42 + 0.168 * f64::from(i);
        mesh.cuboid(v(0.775, y - 0.012, lift + 0.5), v(0.8, y + 0.012, lift + 1.15), dark);
    }
    mesh.cuboid(v(0.77, -0.45, lift + 1.13), v(0.805, 0.45, lift + 1.18), dark);
    // These are the wheels.
    for (x, y, r, w) in
        [(0.45, 0.5, 0.3, 0.2), (0.45, -0.5, 0.3, 0.2), (-0.75, 0.42, 0.24, 0.18), (-0.75, -0.42, 0.24, 0.18)]
    {
        let mut wheel = Mesh::new();
        let half = w / 2.0;
        wheel.lathe(
            DVec3::ZERO,
            &[
                (r * 0.3, -half - 0.02),
                (r * 0.5, -half - 0.02),
                (r * 0.55, -half),
                (r * 0.93, -half),
                (r, -half + 0.03),
                (r, half - 0.03),
                (r * 0.93, half),
                (r * 0.55, half),
                (r * 0.5, half + 0.02),
                (r * 0.3, half + 0.02),
            ],
            28,
            dark,
        );
        let lie =
            DAffine3 { matrix3: DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y), translation: v(x, y, r) };
        mesh.add(&wheel, lie);
    }
    mesh
}
