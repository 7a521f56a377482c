//! Loops over the control points of a row, with their number as a constant.

/// Returns the first N of at least N values.
#[inline(always)]
pub(crate) fn chunk<const N: usize>(values: &[f64]) -> &[f64; N] {
    values.first_chunk().expect("N values")
}

/// Calls a function with the number of control points in a row as a constant, so that its loops can
/// be unrolled. The number is from 1 to [`crate::MAX_PATCH_DEGREE`] + 1.
macro_rules! sized {
    ($n:expr, $f:ident($($argument:expr),*)) => {
        match $n {
            1 => $f::<1>($($argument),*),
            2 => $f::<2>($($argument),*),
            3 => $f::<3>($($argument),*),
            4 => $f::<4>($($argument),*),
            5 => $f::<5>($($argument),*),
            6 => $f::<6>($($argument),*),
            7 => $f::<7>($($argument),*),
            8 => $f::<8>($($argument),*),
            9 => $f::<9>($($argument),*),
            _ => unreachable!("degrees were checked"),
        }
    };
}

pub(crate) use sized;
