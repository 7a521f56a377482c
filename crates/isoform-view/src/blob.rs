//! Arrays of numbers in a page: bytes, deflated if that is shorter.
//!
//! The document of the scene refers to an array by its index and its type; the bytes are in
//! elements of their own as base64, or behind the document ([`Blobs::packed`]), so that a browser
//! need not parse millions of numbers as text.

use serde_json::{Value, json};

/// Arrays of a page.
#[derive(Clone, Debug, Default)]
pub(crate) struct Blobs {
    arrays: Vec<Vec<u8>>,
}

impl Blobs {
    /// Adds little-endian bytes of numbers; returns the reference for the document.
    fn add(&mut self, kind: &str, count: usize, bytes: &[u8]) -> Value {
        // A higher level than 6 takes much longer and saves little. The browser's decoder takes
        // time, too: short arrays and those that shrink by less than 15 % stay plain.
        let packed = (bytes.len() >= 512)
            .then(|| miniz_oxide::deflate::compress_to_vec(bytes, 6))
            .filter(|packed| (packed.len() as f64) <= 0.85 * bytes.len() as f64);
        let is_packed = packed.is_some();
        self.arrays.push(packed.unwrap_or_else(|| bytes.to_vec()));
        let number = self.arrays.len() - 1;
        json!({"blob": number, "type": kind, "n": count, "deflated": is_packed})
    }

    /// Adds doubles.
    pub(crate) fn f64(&mut self, values: &[f64]) -> Value {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.add("f64", values.len(), &bytes)
    }

    /// Adds numbers rounded to single precision.
    pub(crate) fn f32(&mut self, values: impl IntoIterator<Item = f64>) -> Value {
        let mut bytes = Vec::new();
        for v in values {
            bytes.extend((v as f32).to_le_bytes());
        }
        self.add("f32", bytes.len() / 4, &bytes)
    }

    /// Adds 32-bit integers.
    pub(crate) fn u32(&mut self, values: &[u32]) -> Value {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.add("u32", values.len(), &bytes)
    }

    /// Adds 16-bit integers.
    pub(crate) fn u16(&mut self, values: &[u16]) -> Value {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.add("u16", values.len(), &bytes)
    }

    /// Adds bytes.
    pub(crate) fn u8(&mut self, values: &[u8]) -> Value {
        self.add("u8", values.len(), values)
    }

    /// Returns the elements of the page that hold the arrays.
    pub(crate) fn elements(&self) -> String {
        let mut html = String::new();
        for (number, bytes) in self.arrays.iter().enumerate() {
            html += &format!(
                "<script type=\"application/octet-stream\" data-isoform-blob=\"{number}\">"
            );
            html += &base64(bytes);
            html += "</script>\n";
        }
        html
    }

    /// Returns a document with its arrays as bytes: the length of the document as a little-endian
    /// 32-bit integer, the document with the lengths of the arrays as its key `arrays`, the arrays.
    pub(crate) fn packed(&self, mut document: Value) -> Vec<u8> {
        document["arrays"] = self.arrays.iter().map(Vec::len).collect();
        let text = document.to_string();
        // A document of names and parameters has far less than 4 GiB.
        let length = u32::try_from(text.len()).unwrap_or(u32::MAX);
        let mut bytes = length.to_le_bytes().to_vec();
        bytes.extend(text.into_bytes());
        bytes.extend(self.arrays.iter().flatten());
        bytes
    }
}

/// Encodes bytes as base64 (RFC 4648) with padding.
pub fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |i: usize| u32::from(chunk.get(i).copied().unwrap_or(0));
        let word = byte(0) << 16 | byte(1) << 8 | byte(2);
        for i in 0..4 {
            if i <= chunk.len() {
                text.push(char::from(LETTERS[(word >> (18 - 6 * i) & 63) as usize]));
            } else {
                text.push('=');
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_the_standard() {
        let pairs = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ];
        for (plain, text) in pairs {
            assert_eq!(base64(plain.as_bytes()), text);
        }
    }

    #[test]
    fn arrays_are_deflated_where_that_is_shorter() {
        let mut blobs = Blobs::default();
        let flat = blobs.u32(&vec![7; 10_000]);
        let short = blobs.u8(&[1, 2, 3]);
        assert_eq!(
            flat,
            json!({"blob": 0, "type": "u32", "n": 10_000, "deflated": true})
        );
        assert_eq!(
            short,
            json!({"blob": 1, "type": "u8", "n": 3, "deflated": false})
        );
        assert!(blobs.arrays[0].len() < 1000 && blobs.arrays[1] == [1, 2, 3]);
    }
}
