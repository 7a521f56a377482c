//! Solutions of equations that move with a time, followed from the time 0 to 1.

use crate::complex::C;

/// The most that a prediction may be off by, told by the first step of Newton's method: other
/// solutions are further away, so that paths are not confused.
const MOST_OFF: f64 = 1e-4;
/// A prediction as good as this lets steps grow.
const LITTLE_OFF: f64 = 2e-6;
/// Steps below this are none: the path comes to a singular point.
const LEAST: f64 = 1e-7;

/// A piece of time: `by` long, but for rounding at its end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    from: f64,
    by: f64,
    pub(crate) to: f64,
}

/// The solution at the time 1 from one at the time 0; `step` leads it over a span
/// and says how far off its prediction was.
///
/// # Errors
/// The time and the solution up to which it was followed, if not to the end.
pub(crate) fn follow<T: Copy>(
    start: &T,
    step: impl Fn(&T, Span) -> Option<(T, f64)>,
) -> Result<T, (f64, T)> {
    let (mut at, mut time, mut long) = (*start, 0.0, 0.1f64);
    while time < 1.0 {
        let by = long.min(1.0 - time);
        let to = if by < 1.0 - time { time + by } else { 1.0 };
        let span = Span { from: time, by, to };
        match step(&at, span).filter(|found| found.1 < MOST_OFF) {
            Some((next, error)) => {
                (at, time) = (next, to);
                long = if error < LITTLE_OFF { 2.0 * by } else { by };
            }
            None => {
                long = by / 2.0;
                if long < LEAST {
                    return Err((time, at));
                }
            }
        }
    }
    Ok(at)
}

/// The step of a solution over a span, by the classical method of Runge and Kutta: `slope` is asked
/// for at a time, moved from the start by a vector times a factor.
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

/// The solution by Newton's method, and the length of the first step: `step` makes one, and says
/// how long it is. Convergence is quadratic: below `done` the next one would be lost in rounding.
pub(crate) fn newton<T: Copy>(
    start: &T,
    done: f64,
    step: impl Fn(&T) -> Option<(T, f64)>,
) -> Option<(T, f64)> {
    /// The length of the first step from which the start is no approximation.
    const FAR: f64 = 1e-3;
    let (mut at, mut first, mut last) = (*start, 0.0, f64::INFINITY);
    for i in 0..6 {
        let (next, size) = step(&at)?;
        at = next;
        if i == 0 {
            first = size;
            if first > FAR {
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
