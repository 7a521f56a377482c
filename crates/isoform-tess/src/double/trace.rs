//! Tracing of solitary curves, by predictor steps along the tangents and correction.

use super::solution::State;
use super::source::Source;
use crate::complex::{V, conj, distance, inner, length, normalised, real_line};
use isoform_geom::distance_to_segment;

/// The first step, in the affine chart around a point.
const FIRST_STEP: f64 = 0.02;
/// The longest step.
const LONGEST_STEP: f64 = 0.1;
/// A curve that needs a shorter step is lost: it comes to a base point or a singular point.
const SHORTEST_STEP: f64 = 1e-10;
/// The most solutions of a curve: one that has more is lost.
const MOST_STEPS: usize = 100_000;
/// The least cosine of the tangents at both ends of a step: 18 degrees.
const LEAST_COSINE: f64 = 0.95;
/// The largest distance of a prediction from its solution, in steps: more, and the solution may be
/// on another branch.
const MOST_OFF: f64 = 0.25;
/// A prediction as good as this, in steps, lets them grow.
const LITTLE_OFF: f64 = 0.05;
/// The factor by which steps grow.
const GROWTH: f64 = 1.5;
/// Steps shorter than this need not be near to their chord: parameters next to a base point reach
/// far in space.
const FREE_STEP: f64 = 1e-7;
/// The largest distance of the middle of a step from its chord, in tolerances.
const BULGE: f64 = 0.5;
/// The least cosine of the tangent with the way to the conjugate point for which the curve goes
/// there: else f = 0 has conjugate branches at the real parameter.
const STRAIGHT_BACK: f64 = 0.9;
/// Length at which bisection on a face of the box ends: absolute, and relative to the step.
const FACE_PRECISION: [f64; 2] = [1e-15, 1e-14];
/// Maximum ratio of the way through a point to the step on which it lies, up to
/// [`ON_STEP_PRECISION`]. Tangents turn by at most 18 degrees, and an arc of that angle is 1.004
/// times its chord.
const ON_STEP: f64 = 1.03;
/// Absolute term of [`ON_STEP`], for the rounding of parameters on very short steps.
const ON_STEP_PRECISION: f64 = 1e-9;

/// The most halvings of the distance from a real parameter.
const HALVINGS: usize = 12;
/// Accepted ratios of a halved distance to the distance before.
const HALVED: std::ops::Range<f64> = 0.4..0.6;
/// The farthest that a point may move while its distance from the real parameter, 1, is halved.
const FARTHEST_HALVED: f64 = 2.0;
/// Extrapolations from more values than this are taken as they are.
const MANY_VALUES: usize = 4;
/// Extrapolations from more values than this are taken if their error is small.
const FEW_VALUES: usize = 2;
/// The largest error of an extrapolation from few values, in half widths of the box.
const SMALL_ERROR: f64 = 1e-8;

/// End of a branch of a solitary curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum End {
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
struct Advance {
    next: State,
    end: Option<End>,
    /// Error of the prediction, in the affine chart.
    error: f64,
}

/// Traces a curve from a solution in the direction of its tangent, and returns its solutions.
pub(super) fn trace(source: &Source, start: &State, tolerance: f64) -> (Vec<State>, End) {
    let tracer = Tracer { source, tolerance };
    let mut nodes = vec![*start];
    let mut step = FIRST_STEP;
    while nodes.len() < MOST_STEPS {
        let here = nodes[nodes.len() - 1];
        let Some(Advance { next, end, error }) = tracer.advance(&here, step) else {
            step /= 2.0;
            if step < SHORTEST_STEP {
                return (nodes, End::Lost);
            }
            continue;
        };
        let returns = |p: &V| is_on_step(p, &here.p, &next.p);
        if nodes.len() > 2 && (returns(&start.p) || returns(&conj(&start.p))) {
            nodes.push(*start);
            return (nodes, End::Closed);
        }
        nodes.push(next);
        if let Some(end) = end {
            return (nodes, end);
        }
        if error < LITTLE_OFF * step {
            step = (GROWTH * step).min(LONGEST_STEP);
        }
    }
    (nodes, End::Lost)
}

/// The source whose curve is traced, and the tolerance in half widths of the box.
struct Tracer<'a> {
    source: &'a Source,
    tolerance: f64,
}

impl Tracer<'_> {
    /// Makes a step; `None` if it is too long.
    fn advance(&self, here: &State, step: f64) -> Option<Advance> {
        let predicted = here.ahead(step);
        let mut next = self.source.settle(&predicted)?;
        let error = distance(&predicted, &next.p);
        let mut cosine = inner(&here.tangent, &next.tangent).re;
        if cosine < 0.0 {
            next = next.reversed();
            cosine = -cosine;
        }
        if cosine < LEAST_COSINE || error > MOST_OFF * step {
            return None;
        }
        let mut end = None;
        if passes_real_parameter(here, &next) {
            (next, end) = (real_end(self.source, here)?, Some(End::Real));
        }
        if !next.is_inside() {
            (next, end) = (self.at_face(here, step)?, Some(End::Face));
        }
        match self.source.settle_between(here, &next) {
            Some(middle) => {
                let off = distance_to_segment(middle.point(), [here.point(), next.point()]);
                if step > FREE_STEP && off > BULGE * self.tolerance {
                    return None;
                }
            }
            None if end == Some(End::Real) => {}
            // Newton's method fails in the immediate neighbourhood of a base point.
            None => return None,
        }
        Some(Advance { next, end, error })
    }
    /// Returns the last solution in the box on a step that leaves the box, moved onto the face.
    fn at_face(&self, here: &State, step: f64) -> Option<State> {
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

/// The scalar product of the real lines through two points and their conjugates.
fn product(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>()
}

/// Returns true if the curve passes a real parameter on a step: beyond it, the curve returns along
/// the conjugate parameters.
fn passes_real_parameter(here: &State, next: &State) -> bool {
    if product(&real_line(&here.p), &real_line(&next.p)) > 0.0 {
        return false;
    }
    let back = blend(&here.p, -1.0);
    let chord = [0, 1, 2].map(|i| back[i] - here.p[i]);
    inner(&here.tangent, &chord).re > STRAIGHT_BACK * inner(&chord, &chord).re.sqrt()
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
        let is_known = count > MANY_VALUES || count > FEW_VALUES && error < SMALL_ERROR;
        is_known.then_some(value)
    }
}

/// Returns the end of a curve at a real parameter nearby, if there is one. It is extrapolated, as
/// the equations are nearly singular close to it.
///
/// The curve continues along the conjugate parameters. For a coordinate u on the curve that changes
/// its sign under conjugation, the image is an even function of u.
/// sign with conjugation, the image is even in u.
fn real_end(source: &Source, here: &State) -> Option<State> {
    let side = real_line(&here.p);
    let coordinate = |p: &V| product(&real_line(p), &side) / length(&side);
    let mut last = *here;
    let mut scheme = Neville::default();
    for _ in 0..HALVINGS {
        let u = coordinate(&last.p);
        scheme.add(u * u, last.point());
        // Halves the distance from the real parameter, using this point and its conjugate at an
        // equal distance beyond.
        let Some(nearer) = source.settle(&normalised(&blend(&last.p, 0.5))) else {
            break;
        };
        let is_halved = (HALVED.start * u..HALVED.end * u).contains(&coordinate(&nearer.p));
        if !is_halved || distance(&nearer.p, &last.p) > FARTHEST_HALVED * u {
            break;
        }
        last = nearer;
    }
    let x = scheme.value()?;
    let size = (1.0 + x.iter().map(|v| v * v).sum::<f64>()).sqrt();
    Some(State {
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
    distance(p, a) + distance(p, b) <= ON_STEP * distance(a, b) + ON_STEP_PRECISION
}

/// A traced solitary curve.
pub(super) struct Traced {
    /// Index of its source.
    pub(super) source: usize,
    pub(super) nodes: Vec<State>,
}

impl Traced {
    /// Returns the index of the node before a parameter, or before its conjugate, if that lies on
    /// the curve.
    pub(super) fn place(&self, p: &V) -> Option<usize> {
        let other = conj(p);
        let steps = self.nodes.windows(2);
        let is_here =
            |w: &[State]| is_on_step(p, &w[0].p, &w[1].p) || is_on_step(&other, &w[0].p, &w[1].p);
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
