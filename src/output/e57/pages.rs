//! The pages of an E57: 1020 bytes of the file and the checksum of them.

/// The bytes of a page, and those of its content.
const PAGE_BYTES: u64 = 1024;
const CONTENT_BYTES: u64 = PAGE_BYTES - 4;

/// The size of pages, for the header.
pub(super) const PAGE_SIZE: u64 = PAGE_BYTES;

/// The place in the file of a byte of the content.
pub(super) fn place_of(content: u64) -> u64 {
    content / CONTENT_BYTES * PAGE_BYTES + content % CONTENT_BYTES
}

/// The length of a file with so many bytes of content.
pub(super) fn file_bytes(content: u64) -> u64 {
    content.div_ceil(CONTENT_BYTES) * PAGE_BYTES
}

/// The content in pages. The last one is filled with 0.
pub(super) fn in_pages(content: &[u8]) -> Vec<u8> {
    let mut file = Vec::with_capacity(file_bytes(content.len() as u64) as usize);
    for page in content.chunks(CONTENT_BYTES as usize) {
        let start = file.len();
        file.extend_from_slice(page);
        file.resize(start + CONTENT_BYTES as usize, 0);
        let checksum = crc32c(&file[start..]);
        file.extend_from_slice(&checksum.to_be_bytes());
    }
    file
}

/// The reversed polynomial of Castagnoli's CRC (RFC 3720, appendix B.4).
const CASTAGNOLI: u32 = 0x82f6_3b78;

/// The checksums of a byte that is followed by 0 to 7 bytes of 0, so that eight bytes are looked up at a time.
static TABLES: [[u32; 256]; 8] = {
    let mut tables = [[0; 256]; 8];
    let mut byte = 0;
    while byte < 256 {
        let (mut sum, mut bit) = (byte as u32, 0);
        while bit < 8 {
            sum = (sum >> 1) ^ (CASTAGNOLI & (sum & 1).wrapping_neg());
            bit += 1;
        }
        tables[0][byte] = sum;
        byte += 1;
    }
    let mut after = 1;
    while after < 8 {
        let mut byte = 0;
        while byte < 256 {
            let before = tables[after - 1][byte];
            tables[after][byte] = (before >> 8) ^ tables[0][(before & 0xff) as usize];
            byte += 1;
        }
        after += 1;
    }
    tables
};

/// The checksum of bytes, CRC-32C.
pub(in crate::output) fn crc32c(bytes: &[u8]) -> u32 {
    let (eights, rest) = bytes.as_chunks::<8>();
    let sum = eights.iter().fold(!0, |sum: u32, eight| {
        let word = (u64::from_le_bytes(*eight) ^ u64::from(sum)).to_le_bytes().map(usize::from);
        TABLES[7][word[0]]
            ^ TABLES[6][word[1]]
            ^ TABLES[5][word[2]]
            ^ TABLES[4][word[3]]
            ^ TABLES[3][word[4]]
            ^ TABLES[2][word[5]]
            ^ TABLES[1][word[6]]
            ^ TABLES[0][word[7]]
    });
    !rest.iter().fold(sum, |sum, byte| (sum >> 8) ^ TABLES[0][usize::from(sum as u8 ^ byte)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of RFC 3720, appendix B.4, and the check value of the catalogue of CRCs.
    #[test]
    fn checksums_are_castagnolis() {
        let counting: Vec<u8> = (0..32).collect();
        assert_eq!(crc32c(&[0; 32]), 0x8a91_36aa);
        assert_eq!(crc32c(&[0xff; 32]), 0x62a8_ab43);
        assert_eq!(crc32c(&counting), 0x46dd_794e);
        assert_eq!(crc32c(b"123456789"), 0xe306_9283);
    }

    #[test]
    fn content_is_found_where_its_place_says() {
        let content: Vec<u8> = (0..3000_u32).map(|index| index as u8).collect();
        let file = in_pages(&content);
        assert_eq!((file.len(), file.len() as u64), (3 * 1024, file_bytes(3000)));
        assert!(content.iter().enumerate().all(|(at, byte)| file[place_of(at as u64) as usize] == *byte));
        assert_eq!(file_bytes(2040), 2048);
    }
}
