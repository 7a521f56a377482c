//! Loops over the control points of a row, with their number as a constant.

/// Calls a function with the number of control points in a row as a constant, which lets its loops
/// be unrolled. The number is 1 to 9, the most that [`crate::MOST_DEGREE`] allows.
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
            _ => $f::<9>($($argument),*),
        }
    };
}

pub(crate) use sized;
