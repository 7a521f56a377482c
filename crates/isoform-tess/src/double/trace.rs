//! Tracing of solitary curves, by predictor steps along the tangents and correction.

use super::solution::SolutionState;
use super::source::Source;
use crate::complex::{V, conj, distance, inner, length, normalised, real_line};
use crate::stepping::{
    ErrorBounds, FIRST_STEP_LENGTH, FREE_STEP_LENGTH, MAX_BRANCH_POINTS, halved_step,
    is_short_detour,
};
use isoform_geom::distance_to_segment;

/// Bounds on prediction errors along solitary curves.
const ERROR_BOUNDS: ErrorBounds = ErrorBounds {
    rejecting: 0.25,
    growing: 0.05,
};
/// Length at which bisection on a face of the box ends: absolute, and relative to the step.
const FACE_PRECISION: [f64; 2] = [1e-15, 1e-14];

/// Accepted ratios of a halved distance to the distance before.
const HALVED: std::ops::Range<f64> = 0.4..0.6;

/// End of a branch of a solitary curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum BranchEnd {
    /// The curve meets a face of the box.
    Face,
    /// The curve meets a real parameter.
    Real,
    /// The curve closes.
    Closed,
    /// The curve could not be followed.
    Lost,
}

/// An accepted step.
struct BranchStep {
    next: SolutionState,
    end: Option<BranchEnd>,
    /// Error of the prediction, in the affine chart.
    error: f64,
}

/// Traces a curve from a solution in the direction of its tangent, and returns its solutions.
pub(super) fn trace(
    source: &Source,
    start: &SolutionState,
    tolerance: f64,
) -> (Vec<SolutionState>, BranchEnd) {
    let tracer = Tracer { source, tolerance };
    let mut nodes = vec![*start];
    let mut step = FIRST_STEP_LENGTH;
    while nodes.len() < MAX_BRANCH_POINTS {
        let here = nodes[nodes.len() - 1];
        let Some(BranchStep { next, end, error }) = tracer.advance(&here, step) else {
            let Some(half) = halved_step(step) else {
                return (nodes, BranchEnd::Lost);
            };
            step = half;
            continue;
        };
        let returns = |p: &V| is_on_step(p, &here.p, &next.p);
        if nodes.len() > 2 && (returns(&start.p) || returns(&conj(&start.p))) {
            nodes.push(*start);
            return (nodes, BranchEnd::Closed);
        }
        nodes.push(next);
        if let Some(end) = end {
            return (nodes, end);
        }
        step = ERROR_BOUNDS.next_step(step, error);
    }
    (nodes, BranchEnd::Lost)
}

/// The source whose curve is traced, and the tolerance in half widths of the box.
struct Tracer<'a> {
    source: &'a Source,
    tolerance: f64,
}

impl Tracer<'_> {
    /// Makes a step; `None` if it is too long.
    fn advance(&self, here: &SolutionState, step: f64) -> Option<BranchStep> {
        let predicted = here.ahead(step);
        let mut next = self.source.settle(&predicted)?;
        let error = distance(&predicted, &next.p);
        let mut cosine = inner(&here.tangent, &next.tangent).re;
        if cosine < 0.0 {
            next = next.reversed();
            cosine = -cosine;
        }
        if ERROR_BOUNDS.rejects(step, cosine, error) {
            return None;
        }
        let mut end = None;
        if passes_real_parameter(here, &next) {
            (next, end) = (real_end(self.source, here)?, Some(BranchEnd::Real));
        }
        if !next.is_inside() {
            (next, end) = (self.at_face(here, step)?, Some(BranchEnd::Face));
        }
        match self.source.settle_between(here, &next) {
            Some(middle) => {
                let off = distance_to_segment(middle.point(), [here.point(), next.point()]);
                // Parameters next to a base point reach far in space: very short steps are
                // accepted.
                if step > FREE_STEP_LENGTH && off > 0.5 * self.tolerance {
                    return None;
                }
            }
            None if end == Some(BranchEnd::Real) => {}
            // Newton's method fails in the immediate neighbourhood of a base point.
            None => return None,
        }
        Some(BranchStep { next, end, error })
    }
    /// Returns the last solution in the box on a step that leaves the box, moved onto the face.
    fn at_face(&self, here: &SolutionState, step: f64) -> Option<SolutionState> {
        let (mut lo, mut hi, mut last) = (0.0, step, *here);
        while hi - lo > FACE_PRECISION[0] + FACE_PRECISION[1] * hi {
            let middle = 0.5 * (lo + hi);
            let state = self.source.settle(&here.ahead(middle))?;
            if state.is_inside() {
                (lo, last) = (middle, state);
            } else {
                hi = middle;
            }
        }
        let x = last.image;
        let face = (0..3)
            .max_by(|&i, &j| x[i].abs().total_cmp(&x[j].abs()))
            .expect("three");
        last.image[face] = x[3].abs() * x[face].signum();
        Some(last)
    }
}

/// Returns the scalar product of the real lines through two points and their conjugates.
fn product(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>()
}

/// Returns true if the curve passes a real parameter on a step: beyond it, the curve returns along
/// the conjugate parameters.
fn passes_real_parameter(here: &SolutionState, next: &SolutionState) -> bool {
    if product(&real_line(&here.p), &real_line(&next.p)) > 0.0 {
        return false;
    }
    let back = blend(&here.p, -1.0);
    let chord = [0, 1, 2].map(|i| back[i] - here.p[i]);
    // Otherwise f = 0 has conjugate branches at the real parameter.
    inner(&here.tangent, &chord).re > 0.9 * inner(&chord, &chord).re.sqrt()
}

/// Neville's scheme, which extrapolates points to the parameter 0; one row for each point.
#[derive(Default)]
struct Neville {
    parameters: Vec<f64>,
    row: Vec<[f64; 3]>,
    /// Error estimate and value of the extrapolation that differs least from those before it.
    best: Option<(f64, [f64; 3])>,
}

impl Neville {
    fn add(&mut self, parameter: f64, point: [f64; 3]) {
        let k = self.parameters.len();
        self.parameters.push(parameter);
        let mut next = vec![point];
        for (order, old) in self.row.iter().enumerate() {
            let weight = self.parameters[k] / (self.parameters[k - order - 1] - self.parameters[k]);
            let value = [0, 1, 2].map(|c| next[order][c] + (next[order][c] - old[c]) * weight);
            let change =
                [&next[order], old].map(|other| length(&[0, 1, 2].map(|c| value[c] - other[c])));
            let error = change[0].max(change[1]);
            if error.is_finite() && self.best.is_none_or(|(least, _)| error < least) {
                self.best = Some((error, value));
            }
            next.push(value);
        }
        self.row = next;
    }
    /// Returns the extrapolation, if there are enough points.
    fn value(&self) -> Option<[f64; 3]> {
        let (error, value) = self.best?;
        let count = self.parameters.len();
        // An extrapolation from three or four values counts if its error is small, in half widths
        // of the box; one from five or more values always counts.
        let is_known = count > 4 || count > 2 && error < 1e-8;
        is_known.then_some(value)
    }
}

/// Returns the end of a curve at a real parameter nearby, if there is one. It is extrapolated, as
/// the equations are nearly singular close to it.
///
/// The curve continues along the conjugate parameters. For a coordinate u on the curve that changes
/// its sign under conjugation, the image is an even function of u.
fn real_end(source: &Source, here: &SolutionState) -> Option<SolutionState> {
    let side = real_line(&here.p);
    let coordinate = |p: &V| product(&real_line(p), &side) / length(&side);
    let mut last = *here;
    let mut scheme = Neville::default();
    // At most twelve halvings of the distance from the real parameter.
    for _ in 0..12 {
        let u = coordinate(&last.p);
        scheme.add(u * u, last.point());
        // Halves the distance from the real parameter, using this point and its conjugate at an
        // equal distance beyond.
        let Some(nearer) = source.settle(&normalised(&blend(&last.p, 0.5))) else {
            break;
        };
        let is_halved = (HALVED.start * u..HALVED.end * u).contains(&coordinate(&nearer.p));
        // The step may be at most twice the distance from the real parameter.
        if !is_halved || distance(&nearer.p, &last.p) > 2.0 * u {
            break;
        }
        last = nearer;
    }
    let x = scheme.value()?;
    let size = (1.0 + x.iter().map(|v| v * v).sum::<f64>()).sqrt();
    Some(SolutionState {
        p: normalised(&blend(&last.p, 0.0)),
        tangent: last.tangent,
        image: [x[0], x[1], x[2], 1.0].map(|v| v / size),
    })
}

/// Interpolates between a point, at 1, and its conjugate, at −1.
fn blend(p: &V, at: f64) -> V {
    let other = conj(p);
    let product = inner(&other, p);
    let phase = product.times(1.0 / product.norm());
    [0, 1, 2].map(|i| p[i].times(0.5 * (1.0 + at)) + (other[i] * phase).times(0.5 * (1.0 - at)))
}

/// Returns true if a point lies on the step between two others, whose tangents differ by little.
fn is_on_step(p: &V, a: &V, b: &V) -> bool {
    is_short_detour(distance(p, a) + distance(p, b), distance(a, b))
}

/// A traced solitary curve.
pub(super) struct TracedBranch {
    /// Index of its source.
    pub(super) source: usize,
    pub(super) nodes: Vec<SolutionState>,
}

impl TracedBranch {
    /// Returns the index of the node before a parameter, or before its conjugate, if that lies on
    /// the curve.
    pub(super) fn place(&self, p: &V) -> Option<usize> {
        let other = conj(p);
        let steps = self.nodes.windows(2);
        let is_here = |w: &[SolutionState]| {
            is_on_step(p, &w[0].p, &w[1].p) || is_on_step(&other, &w[0].p, &w[1].p)
        };
        steps.into_iter().position(is_here)
    }
    /// Returns true if an end of the curve is nearer to a parameter than a distance.
    pub(super) fn ends_at(&self, p: &V, distance_below: f64) -> bool {
        let ends = [&self.nodes[0], &self.nodes[self.nodes.len() - 1]];
        ends.iter().any(|s| distance(&s.p, p) < distance_below)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1 + 2u² + 3u⁴ in u² is found from three values, and confirmed by a fourth one.
    #[test]
    fn polynomials_are_extrapolated_exactly() {
        let mut scheme = Neville::default();
        for u in [1.0, 0.5, 0.25, 0.125] {
            let x: f64 = u * u;
            scheme.add(x, [1.0 + 2.0 * x + 3.0 * x * x, -x, 7.0]);
        }
        let found = scheme.value().expect("an error of rounding alone");
        assert!(
            length(&[found[0] - 1.0, found[1], found[2] - 7.0]) < 1e-13,
            "{found:?}"
        );
    }
}
