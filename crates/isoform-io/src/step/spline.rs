//! Conversion of a patch to a B-spline with positive control weights.
//!
//! A Bézier patch is a B-spline with one span in each direction. Its weight function may be
//! positive everywhere although a control weight is not. Inserting equally spaced knots moves the
//! control weights towards the weight function until all are positive, and leaves the surface
//! unchanged. New control points are blossoms of the old ones.

use super::knots::ClampedKnots;
use isoform_geom::{Point3, RationalPatch};

/// Minimum ratio of the smallest control weight to the largest; smaller weights are treated as 0,
/// since readers divide by them.
const MIN_WEIGHT_RATIO: f64 = 1e-6;
/// Maximum number of spans in each direction.
const MAX_SPANS: usize = 64;

/// Rational B-spline surface over [0, 1]² with homogeneous control points.
pub(super) struct Spline {
    /// Knots in u.
    u: ClampedKnots,
    /// Knots in v.
    v: ClampedKnots,
    /// Homogeneous control points, row by row of equal i.
    control: Vec<[f64; 4]>,
}

/// Returns x/w, y/w, z/w.
pub(super) fn affine(c: &[f64; 4]) -> Point3 {
    std::array::from_fn(|k| c[k] / c[3])
}

impl Spline {
    /// Converts a patch, refining the better direction until all control weights are positive;
    /// `None` if [`MAX_SPANS`] do not suffice.
    pub(super) fn positive(patch: &RationalPatch) -> Option<Self> {
        let mut best = Self::with_spans(patch, 1, 1);
        while !best.is_positive() {
            let (u, v) = (best.u.spans, best.v.spans);
            let finer = [(2 * u, v), (u, 2 * v)]
                .into_iter()
                .filter(|(u, v)| *u.max(v) <= MAX_SPANS);
            let finer = finer.map(|(u, v)| Self::with_spans(patch, u, v));
            best = finer.reduce(|a, b| if a.worst() >= b.worst() { a } else { b })?;
        }
        Some(best)
    }
    fn with_spans(patch: &RationalPatch, u: usize, v: usize) -> Self {
        let (m, n) = patch.degree();
        let (u, v) = (
            ClampedKnots {
                degree: m,
                spans: u,
            },
            ClampedKnots {
                degree: n,
                spans: v,
            },
        );
        if (u.spans, v.spans) == (1, 1) {
            return Self {
                u,
                v,
                control: patch.control().to_vec(),
            };
        }
        let rows: Vec<Vec<[f64; 4]>> = patch
            .control()
            .chunks(n + 1)
            .map(|row| insert(row, &v))
            .collect();
        let mut control = vec![[0.0; 4]; (m + u.spans) * (n + v.spans)];
        for j in 0..n + v.spans {
            let column: Vec<[f64; 4]> = rows.iter().map(|row| row[j]).collect();
            for (i, c) in insert(&column, &u).into_iter().enumerate() {
                control[i * (n + v.spans) + j] = c;
            }
        }
        Self { u, v, control }
    }
    /// Returns the indices of the last row and of the last column.
    pub(super) fn last(&self) -> (usize, usize) {
        (
            self.u.degree + self.u.spans - 1,
            self.v.degree + self.v.spans - 1,
        )
    }
    /// Returns the homogeneous control point in row i and column j.
    pub(super) fn at(&self, i: usize, j: usize) -> [f64; 4] {
        self.control[i * (self.last().1 + 1) + j]
    }
    /// Returns the knots along u or along v.
    pub(super) fn knots(&self, along_u: bool) -> &ClampedKnots {
        if along_u { &self.u } else { &self.v }
    }
    /// Returns the Cartesian control points.
    pub(super) fn points(&self) -> impl Iterator<Item = Point3> {
        self.control.iter().map(affine)
    }
    /// Returns the ratio of the smallest weight to the largest.
    fn worst(&self) -> f64 {
        let (lo, hi) = self
            .control
            .iter()
            .fold((f64::INFINITY, 0.0f64), |(lo, hi), c| {
                (lo.min(c[3]), hi.max(c[3]))
            });
        if hi > 0.0 { lo / hi } else { f64::NEG_INFINITY }
    }
    /// Returns true if the smallest weight exceeds [`MIN_WEIGHT_RATIO`] of the largest, so that all
    /// are positive.
    fn is_positive(&self) -> bool {
        self.worst() > MIN_WEIGHT_RATIO
    }
}

/// Returns the control points of a Bézier curve over refined knots: the i-th is the blossom at the
/// knots i + 1, …, i + degree.
fn insert(bezier: &[[f64; 4]], knots: &ClampedKnots) -> Vec<[f64; 4]> {
    let (degree, all) = (knots.degree, knots.all());
    let blossom = |at: &[f64]| {
        let mut c = bezier.to_vec();
        for (level, t) in at.iter().enumerate() {
            for i in 0..degree - level {
                for d in 0..4 {
                    c[i][d] = (1.0 - t) * c[i][d] + t * c[i + 1][d];
                }
            }
        }
        c[0]
    };
    (0..degree + knots.spans)
        .map(|i| blossom(&all[i + 1..=i + degree]))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Evaluates a B-spline by de Boor's algorithm.
    fn evaluate(control: &[[f64; 4]], knots: &ClampedKnots, t: f64) -> [f64; 4] {
        let (p, all) = (knots.degree, knots.all());
        let span = (p..p + knots.spans)
            .rev()
            .find(|k| all[*k] <= t)
            .expect("a span");
        let mut d: Vec<[f64; 4]> = (0..=p).map(|j| control[j + span - p]).collect();
        for r in 1..=p {
            for j in (r..=p).rev() {
                let (a, b) = (all[j + span - p], all[j + 1 + span - r]);
                let s = (t - a) / (b - a);
                d[j] = std::array::from_fn(|k| (1.0 - s) * d[j - 1][k] + s * d[j][k]);
            }
        }
        d[p]
    }

    #[test]
    fn inserted_knots_change_no_point() {
        let curve = [
            [0.0, 1.0, 2.0, 1.0],
            [1.0, -1.0, 0.5, -0.2],
            [2.0, 0.3, 0.1, 0.7],
            [0.4, 0.2, 3.0, 1.5],
        ];
        let whole = ClampedKnots {
            degree: 3,
            spans: 1,
        };
        for spans in [2, 4, 8] {
            let knots = ClampedKnots { degree: 3, spans };
            let finer = insert(&curve, &knots);
            assert_eq!(finer.len(), 3 + spans);
            for t in [0.0, 0.1, 0.5, 0.77, 0.99] {
                let (a, b) = (evaluate(&curve, &whole, t), evaluate(&finer, &knots, t));
                assert!((0..4).all(|k| (a[k] - b[k]).abs() < 1e-14), "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn weights_become_positive_where_they_can() {
        let patch = |w: f64| {
            let mut flat =
                RationalPatch::planar((2, 2), [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
            flat.control_mut()[4][3] = w;
            flat
        };
        let spans = |w: f64| Spline::positive(&patch(w)).map(|s| (s.u.spans, s.v.spans));
        assert_eq!(spans(0.5), Some((1, 1)));
        let (u, v) = spans(-0.5).expect("positive");
        assert!(u * v > 1 && u * v <= 16, "{u} {v}");
        assert_eq!(spans(-4.0), None);
    }
}
