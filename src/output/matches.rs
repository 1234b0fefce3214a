//! What the searches for repeated bytes have in common.

/// The number of equal bytes from two places on, of which `at` is the later one.
#[inline(always)]
pub(super) fn common(bytes: &[u8], before: usize, at: usize) -> usize {
    let (later, earlier) = (&bytes[at..], &bytes[before..before + bytes.len() - at]);
    let (words, rest) = later.as_chunks::<8>();
    let (words_before, rest_before) = earlier.as_chunks::<8>();
    for (index, (a, b)) in words.iter().zip(words_before).enumerate() {
        let differs = u64::from_le_bytes(*a) ^ u64::from_le_bytes(*b);
        if differs != 0 {
            return 8 * index + (differs.trailing_zeros() / 8) as usize;
        }
    }
    8 * words.len() + rest.iter().zip(rest_before).take_while(|(a, b)| a == b).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_bytes_are_counted_up_to_the_end() {
        for same in 0..40 {
            for rest in [0, 1, 7, 8, 30] {
                let mut bytes = vec![0; 50];
                let at = bytes.len();
                bytes.extend(vec![0; same]);
                bytes.extend(vec![1; rest]);
                assert_eq!(common(&bytes, 0, at), same, "{rest}");
            }
        }
        // The later bytes can begin within the earlier ones.
        assert_eq!(common(&[7; 100], 0, 1), 99);
    }
}
