//! Computation with growing precision, up to a limit, until the result is decided.

use isoform_control::{Control, Stopped};

/// Maximum number of bits of any computation.
///
/// The numbers refined here are known to differ: numbers without a common polynomial, or roots
/// whose number is known. Roots of a polynomial of degree d with coefficients of τ bits are more
/// than about 2^−d(τ + log d) apart (K. Mahler, Michigan Math. J. 11, 1964), and resultants of
/// typical curves decide within some thousand bits. A million bits mean an internal error. A
/// smaller bound could stop a computation that is merely hard; a larger one would let an error run
/// for hours before it is reported.
pub(crate) const MAX_PRECISION_BITS: usize = 1 << 20;

/// Growth of the number of bits from one attempt to the next.
pub type Growth = fn(usize) -> usize;

/// Doubling of the number of bits: the last attempt costs about as much as all previous ones.
pub const DOUBLED: Growth = |bits| 2 * bits;

/// Returns the result of the first attempt that decides, starting with `bits` bits. `control` is
/// checked before each attempt.
///
/// ```
/// use isoform_algebra::{DOUBLED, RBig, real_roots, refine_until, Poly};
/// use isoform_control::{Control, Stopped};
///
/// // √2 = 1.4142135623… differs from 1.41421356 in its 29th bit.
/// let p = Poly::parse("x^2 - 2", &["x"])?.to_upoly(0).expect("one variable");
/// let mut root = real_roots(&p).pop().expect("the larger root");
/// let near = RBig::from(141_421_356) / RBig::from(100_000_000);
/// let is_less = refine_until(8, DOUBLED, &Control::default(), |bits| {
///     root.refine(bits);
///     let (lo, hi) = root.interval();
///     let decided = lo > near || hi < near;
///     Ok::<_, Stopped>(decided.then_some(hi < near))
/// })?;
/// assert!(!is_less);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`Stopped`] as the error of the attempts, and their own errors.
///
/// # Panics
/// If 2²⁰ bits do not decide: what differs by exact arithmetic cannot be told apart, so that one of
/// the two is wrong.
pub fn refine_until<T, E: From<Stopped>>(
    mut bits: usize,
    growth: impl Fn(usize) -> usize,
    control: &Control<'_>,
    mut attempt: impl FnMut(usize) -> Result<Option<T>, E>,
) -> Result<T, E> {
    loop {
        control.check()?;
        if let Some(found) = attempt(bits)? {
            return Ok(found);
        }
        assert!(
            bits < MAX_PRECISION_BITS,
            "{bits} bits do not tell apart what differs: an error of the exact kernel"
        );
        bits = growth(bits).max(bits + 1);
    }
}

/// [`refine_until`] for what takes no time: without control and errors.
///
/// # Panics
/// If 2²⁰ bits do not decide.
pub fn decide<T>(
    bits: usize,
    growth: impl Fn(usize) -> usize,
    mut attempt: impl FnMut(usize) -> Option<T>,
) -> T {
    let found = refine_until(bits, growth, &Control::default(), |bits| {
        Ok::<_, Stopped>(attempt(bits))
    });
    found.expect("a control without deadline does not stop")
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
            Ok::<_, Stopped>((bits > 100).then_some(bits))
        });
        assert_eq!((found, tried), (Ok(192), vec![24, 48, 96, 192]));
    }

    #[test]
    fn it_can_be_stopped() {
        let mut tried = 0;
        let found: Result<(), Stopped> = refine_until(
            1,
            |bits| bits + 1,
            &Control::default().until(Instant::now()),
            |_| {
                tried += 1;
                Ok(None)
            },
        );
        assert_eq!((found, tried), (Err(Stopped), 0));
    }

    /// Even where the number of bits would not grow.
    #[test]
    #[should_panic(expected = "an error of the exact kernel")]
    fn it_ends() {
        decide(MAX_PRECISION_BITS - 3, |bits| bits, |_| None::<()>);
    }
}
