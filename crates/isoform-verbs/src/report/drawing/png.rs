//! Small PNG pictures with few tones: enough for the shading of a drawing.
//!
//! Rows are stored as differences to the row above and packed as runs of equal bytes (RFC 1950,
//! 1951, 2083), which suits smooth shades of few tones: 100 000 pixels take some 10 kB.

/// A PNG of palette colours, the first of which is transparent.
pub(super) fn encode(width: usize, pixels: &[u8], palette: &[[u8; 3]]) -> Vec<u8> {
    let height = pixels.len() / width.max(1);
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut header = Vec::new();
    header.extend((width as u32).to_be_bytes());
    header.extend((height as u32).to_be_bytes());
    // Eight bits per pixel, palette, no interlace.
    header.extend([8, 3, 0, 0, 0]);
    chunk(&mut png, b"IHDR", &header);
    chunk(&mut png, b"PLTE", palette.as_flattened());
    chunk(&mut png, b"tRNS", &[0]);
    chunk(&mut png, b"IDAT", &zlib(&filtered(width, pixels)));
    chunk(&mut png, b"IEND", &[]);
    png
}

/// Each row behind the number of its filter: 2, differences to the row above.
fn filtered(width: usize, pixels: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(pixels.len() + pixels.len() / width.max(1));
    let mut above = vec![0; width];
    for row in pixels.chunks_exact(width.max(1)) {
        out.push(2);
        out.extend(row.iter().zip(&above).map(|(p, a)| p.wrapping_sub(*a)));
        above.copy_from_slice(row);
    }
    out
}

/// Adds a chunk: length, name, data, and the sum of name and data.
fn chunk(png: &mut Vec<u8>, name: &[u8; 4], data: &[u8]) {
    png.extend((data.len() as u32).to_be_bytes());
    let from = png.len();
    png.extend(name);
    png.extend(data);
    let sum = crc(&png[from..]);
    png.extend(sum.to_be_bytes());
}

/// CRC-32 of PNG (RFC 2083), bit by bit.
fn crc(data: &[u8]) -> u32 {
    !data.iter().fold(!0, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |c, _| {
            (c >> 1) ^ (0xedb8_8320 * (c & 1))
        })
    })
}

/// Bits, the low ones first.
#[derive(Default)]
struct Bits {
    bytes: Vec<u8>,
    /// Bits of the last byte that are not taken.
    free: u32,
}

impl Bits {
    /// Adds the low bits of a value.
    fn put(&mut self, value: u32, count: u32) {
        for i in 0..count {
            if self.free == 0 {
                self.bytes.push(0);
                self.free = 8;
            }
            let last = self.bytes.len() - 1;
            self.bytes[last] |= ((value >> i & 1) as u8) << (8 - self.free);
            self.free -= 1;
        }
    }
    /// A code of the fixed Huffman table of literals and lengths; codes have their high bits first.
    fn code(&mut self, symbol: u32) {
        let (code, count) = match symbol {
            0..=143 => (0x30 + symbol, 8),
            144..=255 => (0x190 + symbol - 144, 9),
            256..=279 => (symbol - 256, 7),
            _ => (0xc0 + symbol - 280, 8),
        };
        self.put(code.reverse_bits() >> (32 - count), count);
    }
    /// The byte before this once more, 3 to 258 times.
    fn again(&mut self, times: u32) {
        match times {
            258 => self.code(285),
            3..=10 => self.code(254 + times),
            _ => {
                let n = times - 3;
                let extra = n.ilog2() - 2;
                self.code(257 + 4 * extra + (n >> extra));
                self.put(n, extra);
            }
        }
        // Distance 1 is code 0 of five bits.
        self.put(0, 5);
    }
}

/// Bytes as a stream of zlib, whose runs of equal bytes are packed and nothing else; Adler-32
/// stands behind them.
fn zlib(data: &[u8]) -> Vec<u8> {
    let mut bits = Bits::default();
    // The last block, with the fixed table.
    bits.put(3, 3);
    let mut i = 0;
    while i < data.len() {
        bits.code(u32::from(data[i]));
        let run = data[i..].iter().take_while(|b| **b == data[i]).count() - 1;
        let mut left = run;
        while left >= 3 {
            let times = left.min(258);
            bits.again(times as u32);
            left -= times;
        }
        i += 1 + run - left;
    }
    bits.code(256);
    let (mut a, mut b) = (1_u32, 0_u32);
    for byte in data {
        a = (a + u32::from(*byte)) % 65521;
        b = (b + a) % 65521;
    }
    let mut out = vec![0x78, 0x01];
    out.extend(bits.bytes);
    out.extend((b << 16 | a).to_be_bytes());
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_the_standards() {
        // The check value of CRC-32, and the end of every PNG.
        assert_eq!(crc(b"123456789"), 0xcbf4_3926);
        assert!(encode(1, &[0], &[[0; 3]]).ends_with(b"\0\0\0\0IEND\xae\x42\x60\x82"));
        // Adler-32 of "abc" is 0x024d0127 (RFC 1950's sum, by hand).
        assert!(zlib(b"abc").ends_with(&[0x02, 0x4d, 0x01, 0x27]));
    }

    #[test]
    fn runs_are_packed_as_the_standard_says() {
        // One block of fixed codes: literal 0 (00110000), length 4 = code 258 (0000010), distance 1
        // (00000), end (0000000).
        let packed = zlib(&[0; 5]);
        let mut bits = String::new();
        for byte in &packed[2..packed.len() - 4] {
            bits.extend((0..8).map(|i| if byte >> i & 1 == 1 { '1' } else { '0' }));
        }
        assert_eq!(bits.trim_end_matches('0').len(), 3 + 8 + 6, "{bits}");
        assert!(bits.starts_with("110001100000000010"), "{bits}");
        // Length 18 is code 268 (0001100), which stands for 17, with the extra bit 1.
        let mut b = Bits::default();
        b.again(18);
        assert_eq!(b.bytes[0], 0b1001_1000, "{:08b}", b.bytes[0]);
    }
}
