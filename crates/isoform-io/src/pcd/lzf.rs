//! LZF, the compression of PCD files (Marc Lehmann's LibLZF).

/// Decompresses LZF. A control byte c below 32 starts a run of c + 1 literal bytes. Otherwise its
/// three high bits are the length less two of a copy (7: one more byte of length) from up to 8192
/// bytes back. Returns `None` unless the result has exactly `size` bytes.
pub(super) fn unpack(packed: &[u8], size: usize) -> Option<Vec<u8>> {
    // A copy takes three bytes and gives at most 264, so a small input cannot request much memory.
    if size / 264 > packed.len() {
        return None;
    }
    let mut out = Vec::with_capacity(size);
    let mut rest = packed;
    while let Some((&control, after)) = rest.split_first() {
        let control = usize::from(control);
        rest = after;
        if control < 32 {
            let (run, after) = rest.split_at_checked(control + 1)?;
            out.extend_from_slice(run);
            rest = after;
        } else {
            let mut byte = || {
                let (&b, after) = rest.split_first()?;
                rest = after;
                Some(usize::from(b))
            };
            let mut length = control >> 5;
            if length == 7 {
                length += byte()?;
            }
            let back = ((control & 31) << 8) + byte()? + 1;
            let from = out.len().checked_sub(back)?;
            for k in 0..length + 2 {
                out.push(out[from + k]);
            }
        }
        if out.len() > size {
            return None;
        }
    }
    (out.len() == size).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::unpack;

    #[test]
    fn runs_and_copies() {
        assert_eq!(
            unpack(&[2, b'a', b'b', b'c', 0x20, 2], 6).as_deref(),
            Some(&b"abcabc"[..])
        );
        assert_eq!(
            unpack(&[0, b'x', 0xe0, 3, 0], 13).as_deref(),
            Some(&b"xxxxxxxxxxxxx"[..]),
            "a copy may overlap itself"
        );
        assert_eq!(unpack(&[0, b'x', 0x20, 5], 4), None, "before the start");
        assert_eq!(unpack(&[5, b'x'], 6), None);
        assert_eq!(unpack(&[0, b'x', 0xe0], 12), None);
        assert_eq!(unpack(&[], usize::MAX), None);
        assert_eq!(unpack(&[], 0).as_deref(), Some(&b""[..]));
    }
}
