//! Makes inputs of other inputs.

use beamcast::rng::Rng;

/// The longest input that is made.
const LONGEST: usize = 1 << 18;

/// Words and numbers on which readers depend.
const WORDS: [&[u8]; 22] = [
    b"-1",
    b"0",
    b"1e308",
    b"5e-324",
    b"nan",
    b"inf",
    b"4294967295",
    b"18446744073709551616",
    b"null",
    b"[]",
    b"{}",
    b"\"\"",
    b"\n",
    b"\xff",
    b"\0\0\0\0",
    b"\xff\xff\xff\x7f",
    b"\xff\xff\xff\xff",
    b"\x00\x00\x80\x7f",
    b"\n[",
    b"=",
    b"1e-300",
    b"1000000",
];

/// Changes an input in a few places. `other` is one from which parts are taken.
pub fn mutate(input: &[u8], other: &[u8], random: &mut Rng) -> Vec<u8> {
    let mut bytes = input.to_vec();
    for _ in 0..=random.below(4) {
        change(&mut bytes, other, random);
    }
    bytes.truncate(LONGEST);
    bytes
}

fn change(bytes: &mut Vec<u8>, other: &[u8], random: &mut Rng) {
    if bytes.is_empty() {
        bytes.extend_from_slice(&other[..other.len().min(64)]);
        bytes.push(random.u32() as u8);
        return;
    }
    let at = random.below(bytes.len());
    let some = |random: &mut Rng, length: usize| {
        let start = random.below(length.max(1)).min(length);
        start..(start + 1 + random.below(32)).min(length)
    };
    match random.below(10) {
        0 => bytes[at] ^= 1 << random.below(8),
        1 => bytes[at] = random.u32() as u8,
        2 => bytes.truncate(at),
        3 => {
            let range = some(random, bytes.len());
            bytes.drain(range);
        }
        4 => {
            let copied = bytes[some(random, bytes.len())].to_vec();
            bytes.splice(at..at, copied);
        }
        5 => {
            let taken = other[some(random, other.len())].to_vec();
            bytes.splice(at..at, taken);
        }
        6 => {
            let word = WORDS[random.below(WORDS.len())];
            let end = (at + word.len()).min(bytes.len());
            let end = if random.below(2) == 0 { at } else { end };
            bytes.splice(at..end, word.iter().copied());
        }
        7 => {
            // A number in a text becomes another number.
            let is_part = |b: &u8| b.is_ascii_digit() || matches!(b, b'.' | b'-' | b'e');
            let Some(start) = bytes[at..].iter().position(u8::is_ascii_digit).map(|i| at + i) else { return };
            let length = bytes[start..].iter().take_while(|b| is_part(b)).count();
            let number = match random.below(3) {
                0 => WORDS[random.below(8)].to_vec(),
                1 => (random.u64() >> random.below(64)).to_string().into_bytes(),
                _ => format!("{:e}", f64::from_bits(random.u64())).into_bytes(),
            };
            bytes.splice(start..start + length, number);
        }
        8 => {
            let value = u32::from_le_bytes([0, 1, 2, 3].map(|i| bytes.get(at + i).copied().unwrap_or(0)));
            let value = value.wrapping_add(random.below(5) as u32).wrapping_sub(2);
            bytes.iter_mut().skip(at).zip(value.to_le_bytes()).for_each(|(byte, new)| *byte = new);
        }
        _ => {
            // Lines change places.
            let end = bytes[at..].iter().position(|b| *b == b'\n').map_or(bytes.len(), |i| at + i + 1);
            let line: Vec<u8> = bytes.drain(at..end).collect();
            let to = random.below(bytes.len() + 1);
            bytes.splice(to..to, line);
        }
    }
}
