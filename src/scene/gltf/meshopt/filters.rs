//! Filters: what is done to the elements after they are decompressed.

/// Decodes an octahedral unit vector, given as x, y and the number that stands for 1, to x, y and z, where `largest` stands
/// for 1.
fn octahedral([x, y, one]: [f32; 3], largest: f32) -> [f32; 3] {
    let (mut x, mut y) = (x / one, y / one);
    let z = 1.0 - x.abs() - y.abs();
    let fold = z.min(0.0);
    x -= fold.copysign(x);
    y -= fold.copysign(y);
    let length = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|c| (c / length * largest).round())
}

pub(super) fn octahedral_8(element: &mut [u8; 4]) {
    let [x, y, one, _] = element.map(|byte| f32::from(byte as i8));
    let [x, y, z] = octahedral([x, y, one], 127.0).map(|c| c as i8 as u8);
    *element = [x, y, z, element[3]];
}

pub(super) fn octahedral_16(element: &mut [u8; 8]) {
    let [x, y, one, w] = shorts(*element);
    let [x, y, z] = octahedral([x, y, one].map(f32::from), 32767.0).map(|c| c as i16);
    *element = from_shorts([x, y, z, w]);
}

/// Decodes a unit quaternion, given as three components and the index of the missing one.
pub(super) fn quaternion(element: &mut [u8; 8]) {
    let input = shorts(*element);
    let one = f32::from(input[3] | 3);
    let [x, y, z] =
        [input[0], input[1], input[2]].map(|c| f32::from(c) / one * std::f32::consts::FRAC_1_SQRT_2);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let largest = (input[3] & 3) as usize;
    let mut output = [0; 4];
    for (at, component) in [w, x, y, z].into_iter().enumerate() {
        output[(largest + at) % 4] = (component * 32767.0).round() as i16;
    }
    *element = from_shorts(output);
}

/// Decodes a float, given as an 8-bit exponent above a 24-bit mantissa, both signed.
pub(super) fn exponential(element: &mut [u8; 4]) {
    let bits = i32::from_le_bytes(*element);
    let (exponent, mantissa) = (bits >> 24, bits << 8 >> 8);
    // This is 2^exponent exactly, because normal f64 numbers begin at 2^-1022.
    let scale = f64::from_bits(((1023 + exponent) as u64) << 52);
    *element = ((scale * f64::from(mantissa)) as f32).to_le_bytes();
}

/// Decodes red, green, blue and alpha up to `largest`, given as luma, two chroma components, and alpha below a marking bit.
fn color([y, co, cg, alpha]: [i32; 4], largest: f32) -> [f32; 4] {
    let all = match alpha.checked_ilog2() {
        Some(bit) => (1_i32 << (bit + 1)) - 1,
        None => 1,
    };
    let a = alpha & (all >> 1);
    let a = a << 1 | a & 1;
    [y + co - cg, y + cg, y - co - cg, a].map(|c| (c as f32 * (largest / all as f32)).round())
}

pub(super) fn color_8(element: &mut [u8; 4]) {
    let [y, co, cg, a] = *element;
    *element = color([y.into(), (co as i8).into(), (cg as i8).into(), a.into()], 255.0).map(|c| c as u8);
}

pub(super) fn color_16(element: &mut [u8; 8]) {
    let [y, co, cg, a] = shorts(*element);
    let input = [i32::from(y as u16), co.into(), cg.into(), i32::from(a as u16)];
    *element = from_shorts(color(input, 65535.0).map(|c| c as u16 as i16));
}

fn shorts(element: [u8; 8]) -> [i16; 4] {
    std::array::from_fn(|at| i16::from_le_bytes([element[2 * at], element[2 * at + 1]]))
}

fn from_shorts(element: [i16; 4]) -> [u8; 8] {
    std::array::from_fn(|at| element[at / 2].to_le_bytes()[at % 2])
}
