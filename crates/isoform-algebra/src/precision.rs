//! Precision that grows until it decides: the one loop of that kind, which ends.

use crate::resultant::ResultantError;
use isoform_control::Control;

/// Bits beyond which nothing is looked at more closely.
///
/// What is refined here differs, and is known to: numbers without a common polynomial, roots whose
/// number is known. Roots of a polynomial of degree d with coefficients of τ bits are more than
/// about 2^−d(τ + log d) apart (K. Mahler, Michigan Math. J. 11, 1964), and resultants of the curves
/// that anybody draws decide within some thousand bits. A million bits mean an error of this
/// program. A lower bound could stop what only is hard; a higher one would let an error run for
/// hours before it is said.
pub(crate) const MOST_BITS: usize = 1 << 20;

/// How the number of bits grows from one attempt to the next.
pub(crate) type Growth = fn(usize) -> usize;

/// Twice as many: the last attempt costs about as much as all before.
pub(crate) const DOUBLED: Growth = |bits| 2 * bits;

/// What the first attempt that decides finds, with `bits` bits and more. `control` is asked before
/// each of them.
///
/// # Errors
/// [`ResultantError::Stopped`], and those of the attempts.
///
/// # Panics
/// If [`MOST_BITS`] do not decide: what differs by exact arithmetic cannot be told apart, so that
/// one of the two is wrong.
pub(crate) fn refine_until<T>(
    mut bits: usize,
    growth: Growth,
    control: &Control<'_>,
    mut attempt: impl FnMut(usize) -> Result<Option<T>, ResultantError>,
) -> Result<T, ResultantError> {
    loop {
        if control.is_stopped() {
            return Err(ResultantError::Stopped);
        }
        if let Some(found) = attempt(bits)? {
            return Ok(found);
        }
        assert!(
            bits < MOST_BITS,
            "{bits} bits do not tell apart what differs: an error of the exact kernel"
        );
        bits = growth(bits).max(bits + 1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    #[test]
    fn the_first_precision_that_decides_counts() {
        let mut tried = Vec::new();
        let found = refine_until(24, DOUBLED, &Control::default(), |bits| {
            tried.push(bits);
            Ok((bits > 100).then_some(bits))
        });
        assert_eq!((found, tried), (Ok(192), vec![24, 48, 96, 192]));
    }

    #[test]
    fn it_can_be_stopped() {
        let mut tried = 0;
        let found: Result<(), _> = refine_until(
            1,
            |bits| bits + 1,
            &Control::default().until(Instant::now()),
            |_| {
                tried += 1;
                Ok(None)
            },
        );
        assert_eq!((found, tried), (Err(ResultantError::Stopped), 0));
    }

    /// Even where the number of bits would not grow.
    #[test]
    #[should_panic(expected = "an error of the exact kernel")]
    fn it_ends() {
        let _ = refine_until(
            MOST_BITS - 3,
            |bits| bits,
            &Control::default(),
            |_| Ok(None::<()>),
        );
    }
}
