//! Buffered output of text and bytes that formats numbers without allocations.

use super::options::MeshWriteOptions;
use isoform_geom::Point3;
use std::io::{self, Write};

/// Buffer size in bytes.
const WRITE_BUFFER_BYTES: usize = 1 << 16;

/// Buffer for lines of text or rows of bytes; [`Out::end`] writes it to the sink when it is full.
pub(super) struct Out<'o> {
    out: &'o mut dyn Write,
    buffer: Vec<u8>,
}

impl<'o> Out<'o> {
    pub(super) fn new(out: &'o mut dyn Write) -> Self {
        Self {
            out,
            buffer: Vec::with_capacity(2 * WRITE_BUFFER_BYTES),
        }
    }
    /// Appends text.
    pub(super) fn str(&mut self, text: &str) -> &mut Self {
        self.buffer.extend_from_slice(text.as_bytes());
        self
    }
    /// Appends bytes.
    pub(super) fn bytes(&mut self, bytes: &[u8]) -> &mut Self {
        self.buffer.extend_from_slice(bytes);
        self
    }
    /// Appends an integer in decimal digits.
    pub(super) fn int(&mut self, v: impl itoa::Integer) -> &mut Self {
        self.buffer
            .extend_from_slice(itoa::Buffer::new().format(v).as_bytes());
        self
    }
    /// Appends the shortest text that reads back to the identical double.
    pub(super) fn float(&mut self, v: f64) -> &mut Self {
        self.buffer
            .extend_from_slice(zmij::Buffer::new().format(v).as_bytes());
        self
    }
    /// Appends a number with as many digits as fit, at most those of [`Out::float`].
    pub(super) fn narrow(&mut self, v: f64, width: usize) -> &mut Self {
        narrow(v, width, &mut self.buffer);
        self
    }
    /// Appends three coordinates as by [`Out::float`], separated by blanks.
    pub(super) fn point(&mut self, p: &Point3) -> &mut Self {
        self.float(p[0]).str(" ").float(p[1]).str(" ").float(p[2])
    }
    /// Appends a name, reduced to one line.
    pub(super) fn name(&mut self, name: &str) -> &mut Self {
        self.str(&on_one_line(name))
    }
    /// Appends a comment line with the unit of length, if it is known, after a comment mark.
    pub(super) fn units(&mut self, mark: &str, options: &MeshWriteOptions) -> io::Result<()> {
        match &options.units {
            None => Ok(()),
            Some(units) => self
                .str(mark)
                .str(" units: ")
                .str(&units.replace(['\n', '\r'], " "))
                .line(),
        }
    }
    /// Pads with blanks to a column of the text since `start` (a position returned by
    /// [`Out::mark`]).
    pub(super) fn pad(&mut self, start: usize, width: usize) -> &mut Self {
        let to = (start + width).max(self.buffer.len());
        self.buffer.resize(to, b' ');
        self
    }
    /// Returns the position of the next byte, which is valid until [`Out::end`].
    pub(super) fn mark(&self) -> usize {
        self.buffer.len()
    }
    /// Ends a row: writes the buffer out if it is full.
    pub(super) fn end(&mut self) -> io::Result<()> {
        if self.buffer.len() >= WRITE_BUFFER_BYTES {
            self.flush()?;
        }
        Ok(())
    }
    /// Ends a line.
    pub(super) fn line(&mut self) -> io::Result<()> {
        self.buffer.push(b'\n');
        self.end()
    }
    /// Writes the buffer out; must be the last call of a writer.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        self.out.write_all(&self.buffer)?;
        self.buffer.clear();
        Ok(())
    }
}

/// Replaces control characters of a name by blanks.
pub(super) fn on_one_line(name: &str) -> String {
    name.chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect()
}

/// Appends a number in at most `width` ≥ 12 characters, always with a decimal point: the shortest
/// text that reads back to the identical double if it fits, else rounded.
///
/// A leading zero before the point is dropped first: it is insignificant, and Fortran and C read
/// the number without it.
pub(super) fn narrow(v: f64, width: usize, text: &mut Vec<u8>) {
    let start = text.len();
    text.extend_from_slice(zmij::Buffer::new().format(v).as_bytes());
    set_decimal_point(text, start, width);
    if text.len() - start <= width {
        return;
    }
    let exponent = v.abs().log10().floor() as i32;
    let plain = (-2..width as i32 - 3).contains(&exponent);
    // Digits that sign, integer digits, point and exponent leave, plus one because the rounded
    // exponent may be one too small.
    let mut digits = width - 1 - if plain { exponent.max(0) as usize } else { 3 };
    while text.len() - start > width {
        text.truncate(start);
        let done = if plain {
            write!(text, "{v:.digits$}")
        } else {
            write!(text, "{v:.digits$e}")
        };
        done.expect("memory takes all");
        set_decimal_point(text, start, width);
        digits -= 1;
    }
}

/// Adds a missing decimal point, and drops a zero before it if the text is too long.
fn set_decimal_point(text: &mut Vec<u8>, start: usize, width: usize) {
    if !text[start..].contains(&b'.') {
        let at = text[start..]
            .iter()
            .position(|&b| b == b'e')
            .map_or(text.len(), |e| start + e);
        text.insert(at, b'.');
    }
    let digits = start + usize::from(text[start] == b'-');
    if text.len() - start > width && text[digits] == b'0' && text[digits + 1] == b'.' {
        text.remove(digits);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn narrowed(v: f64, width: usize) -> String {
        let mut text = b"x".to_vec();
        narrow(v, width, &mut text);
        String::from_utf8(text.split_off(1)).expect("ASCII")
    }

    #[test]
    fn examples() {
        assert_eq!(narrowed(0.0, 20), "0.0");
        assert_eq!(narrowed(1e16, 20), "1.e+16");
        assert_eq!(
            narrowed(-0.123_456_789_012_345_67, 20),
            "-0.12345678901234566"
        );
        assert_eq!(
            narrowed(-0.012_345_678_901_234_567, 20),
            "-.012345678901234567"
        );
        assert_eq!(narrowed(1.0 / 3.0, 16), ".333333333333333");
        assert_eq!(narrowed(-1.0 / 3e-5, 16), "-33333.333333333");
        assert_eq!(narrowed(-f64::MIN_POSITIVE, 12), "-2.2251e-308");
    }

    proptest! {
        #[test]
        fn fits_and_reads_back(v in prop::num::f64::NORMAL | prop::num::f64::ZERO, small in -1e3..1e3_f64) {
            for v in [v, small, small * 1e-3] {
                for (width, accuracy) in [(20, 1e-11), (16, 1e-7)] {
                    let text = narrowed(v, width);
                    prop_assert!(text.len() <= width && text.contains('.'), "{text}");
                    let again: f64 = text.parse().expect("a number");
                    prop_assert!((again - v).abs() <= accuracy * v.abs() || !again.is_finite(), "{v:e} {text}");
                }
                prop_assert_eq!(narrowed(v, 30).parse::<f64>().expect("a number").to_bits(), v.to_bits());
            }
        }
    }
}
