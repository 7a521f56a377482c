//! Homotopy continuation: solutions of equations with a time parameter, tracked from the time 0 to
//! 1.

use crate::complex::C;

/// Maximum length of a predictor or Newton step, in the affine chart around a solution: longer ones
/// lead to another solution.
pub(crate) const MAX_CHART_STEP: f64 = 0.3;
/// Minimum norm of the forms at a solution, for parameters of norm 1: it is smaller at base points
/// only, which are excluded.
pub(crate) const MIN_FORM_NORM: f64 = 1e-8;

/// A time step; its length is `by`, up to the rounding of its end `to`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    from: f64,
    by: f64,
    pub(crate) to: f64,
}

/// Tracks a solution from the time 0 to the time 1; `step` advances it over a span and returns the
/// error of its prediction.
///
/// # Errors
/// The time and the solution at which tracking stopped, if not at the end.
pub(crate) fn follow<T: Copy>(
    start: &T,
    step: impl Fn(&T, Span) -> Option<(T, f64)>,
) -> Result<T, (f64, T)> {
    let (mut at, mut time, mut long) = (*start, 0.0, 0.1f64);
    while time < 1.0 {
        let by = long.min(1.0 - time);
        let to = if by < 1.0 - time { time + by } else { 1.0 };
        let span = Span { from: time, by, to };
        // Other solutions are farther away, so that paths are not confused.
        match step(&at, span).filter(|found| found.1 < 1e-4) {
            Some((next, error)) => {
                (at, time) = (next, to);
                long = if error < 2e-6 { 2.0 * by } else { by };
            }
            None => {
                long = by / 2.0;
                // The path comes to a singular point.
                if long < 1e-7 {
                    return Err((time, at));
                }
            }
        }
    }
    Ok(at)
}

/// Returns the step of a solution over a span, by the classical Runge–Kutta method. The arguments
/// of `slope` are the time, and a vector with a factor by which the start is displaced.
pub(crate) fn runge_kutta<const N: usize>(
    span: Span,
    slope: impl Fn(f64, &[C; N], f64) -> Option<[C; N]>,
) -> Option<[C; N]> {
    let Span { from, by: h, to } = span;
    let k1 = slope(from, &[C::ZERO; N], 0.0)?;
    let k2 = slope(from + h / 2.0, &k1, h / 2.0)?;
    let k3 = slope(from + h / 2.0, &k2, h / 2.0)?;
    let k4 = slope(to, &k3, h)?;
    Some(std::array::from_fn(|i| {
        (k1[i] + k4[i] + (k2[i] + k3[i]).times(2.0)).times(h / 6.0)
    }))
}

/// Finds a solution by Newton's method, and returns it with the length of the first step; `step`
/// returns the next iterate and the length of the step to it. Convergence is quadratic: after a
/// step below `done`, the next one would be lost in rounding.
pub(crate) fn newton<T: Copy>(
    start: &T,
    done: f64,
    step: impl Fn(&T) -> Option<(T, f64)>,
) -> Option<(T, f64)> {
    let (mut at, mut first, mut last) = (*start, 0.0, f64::INFINITY);
    for i in 0..6 {
        let (next, size) = step(&at)?;
        at = next;
        if i == 0 {
            first = size;
            // The start does not approximate a solution.
            if first > 1e-3 {
                return None;
            }
        }
        if size < done {
            return Some((at, first));
        }
        if size > 0.5 * last {
            return None;
        }
        last = size;
    }
    None
}
