//! Comparison of surfaces that ought to coincide, in minimal parameters, and fits of models of
//! their layout.
//!
//! A model predicts each entity's surface from common parameters θ. The differences r of the
//! entities from it, whitened by their covariances, are minimised in least squares (Gauss–Newton).
//! Their sum of squares has a χ² distribution if the model is true; its decrease without one
//! entity, rᵀ(1 − H)⁻¹r with the leverage H, decides whether that entity belongs to the model
//! (deletion of one observation: R. Cook, S. Weisberg, Residuals and Influence in Regression, 1982,
//! ch. 2).

use crate::chart::{DIFFERENCE_STEP, MAX_PARAMETERS, ParameterRow, Primitive, PrimitiveKind};
use crate::relations::{CHI_SQUARED, UncertainSurface};
use isoform_geom::{Point3, dot, sub};
use isoform_num::linalg::{cholesky, cholesky_solve, symmetric_eigen};

/// Returns the χ² that `n` components exceed once in 10⁵ (E. Wilson and M. Hilferty, The
/// distribution of chi-square, PNAS 17, 1931, beyond the table).
pub(crate) fn limit(n: usize) -> f64 {
    if let Some(of) = n.checked_sub(1).and_then(|k| CHI_SQUARED.get(k)) {
        return *of;
    }
    let variance = 2.0 / (9.0 * n.max(1) as f64);
    // This normal deviate is exceeded once in 10⁵.
    n as f64 * (1.0 - variance + 4.265 * variance.sqrt()).powi(3)
}

/// Returns the difference of the parameters of `other` from those of a surface of its kind, in the
/// terms of [`Primitive::moved`].
pub(crate) fn difference(surface: &Primitive, other: &Primitive) -> ParameterRow {
    let way = sub(other.place, surface.place);
    let sizes = [other.size - surface.size, other.other - surface.other];
    if surface.kind == PrimitiveKind::Sphere {
        return [way[0], way[1], way[2], sizes[0], 0.0, 0.0, 0.0];
    }
    let [e, f] = surface.frame();
    let cosine = dot(surface.axis, other.axis);
    let tilt = [dot(other.axis, e) / cosine, dot(other.axis, f) / cosine];
    match surface.kind {
        PrimitiveKind::Torus => [tilt[0], tilt[1], way[0], way[1], way[2], sizes[0], sizes[1]],
        PrimitiveKind::Plane => {
            let off = dot(way, other.axis) / cosine;
            [tilt[0], tilt[1], off, 0.0, 0.0, 0.0, 0.0]
        }
        _ => {
            // The height at which the other axis passes the reference point.
            let h = -dot(way, surface.axis) / cosine;
            let shift: Point3 = std::array::from_fn(|k| way[k] + h * other.axis[k]);
            let angle = cosine.signum() * other.other - surface.other;
            let (widens, turn) = match surface.kind {
                PrimitiveKind::Cone => (h * other.other.tan(), angle),
                _ => (0.0, 0.0),
            };
            let size = sizes[0] + widens;
            let [x, y] = [dot(shift, e), dot(shift, f)];
            [tilt[0], tilt[1], x, y, size, turn, 0.0]
        }
    }
}

/// Adds the covariance of a value that depends on a surface, by linear propagation.
pub(crate) fn add_covariance(
    sum: &mut [ParameterRow; MAX_PARAMETERS],
    of: &UncertainSurface,
    value: impl Fn(&Primitive) -> ParameterRow,
) {
    let n = of.surface.kind.parameters();
    let derivative = |k: usize| -> ParameterRow {
        let at = |h: f64| {
            let mut step = [0.0; MAX_PARAMETERS];
            step[k] = h;
            value(&of.surface.moved(&step))
        };
        let (plus, minus) = (at(DIFFERENCE_STEP), at(-DIFFERENCE_STEP));
        std::array::from_fn(|i| (plus[i] - minus[i]) / (2.0 * DIFFERENCE_STEP))
    };
    let rows: Vec<ParameterRow> = (0..n).map(derivative).collect();
    for (p, row) in rows.iter().enumerate() {
        for (q, other) in rows.iter().enumerate() {
            for i in 0..MAX_PARAMETERS {
                for j in 0..MAX_PARAMETERS {
                    sum[i][j] += row[i] * of.covariance[p][q] * other[j];
                }
            }
        }
    }
}

/// Returns true if a parameter is an angle.
pub(crate) fn is_angle(kind: PrimitiveKind, k: usize) -> bool {
    (kind != PrimitiveKind::Sphere && k < 2) || (kind == PrimitiveKind::Cone && k == 5)
}

/// Whitening transformation: makes differences independent and of unit variance.
#[derive(Clone)]
pub(crate) struct Whitener {
    rows: Vec<ParameterRow>,
}

impl Whitener {
    /// Builds the transformation of differences with this covariance in the parameters of `which`.
    /// `scale` holds variances; directions with negligible variance in these units are left out.
    pub(crate) fn from_covariance(
        covariance: &[ParameterRow; MAX_PARAMETERS],
        which: &[usize],
        scale: Option<&ParameterRow>,
    ) -> Self {
        let n = which.len();
        let unit: Vec<f64> = which
            .iter()
            .map(|k| {
                scale.unwrap_or(&covariance[*k])[*k]
                    .sqrt()
                    .max(f64::MIN_POSITIVE)
            })
            .collect();
        let entry = |k: usize| covariance[which[k / n]][which[k % n]] / (unit[k / n] * unit[k % n]);
        let matrix: Vec<f64> = (0..n * n).map(entry).collect();
        let (values, vectors) = symmetric_eigen(&matrix, n);
        // Directions of less variance cannot differ if the covariance has unit scale.
        let least = if scale.is_some() { 1e-4 } else { 0.0 };
        let row = |i: usize| {
            let mut row = [0.0; MAX_PARAMETERS];
            for (k, of) in which.iter().enumerate() {
                row[*of] = vectors[i * n + k] / (unit[k] * values[i].sqrt());
            }
            row
        };
        let rows = (0..n).filter(|i| values[*i] > least).map(row).collect();
        Self { rows }
    }

    fn apply(&self, difference: &ParameterRow) -> Vec<f64> {
        let of = |row: &ParameterRow| row.iter().zip(difference).map(|(a, b)| a * b).sum();
        self.rows.iter().map(of).collect()
    }

    /// Returns the sum of squares of the whitened difference.
    pub(crate) fn squared(&self, difference: &ParameterRow) -> f64 {
        self.apply(difference).iter().map(|x| x * x).sum()
    }
}

/// Difference from a model, as a function of θ.
type Difference<'a> = Box<dyn Fn(&[f64]) -> ParameterRow + 'a>;

/// An entity, or a pair of them, that a model makes a prediction about.
pub(crate) struct Observation<'a> {
    pub(crate) difference: Difference<'a>,
    pub(crate) whitener: Whitener,
}

/// A model with the parameters that fit best.
pub(crate) struct ModelFit {
    pub(crate) theta: Vec<f64>,
    /// Covariance of θ, by rows.
    pub(crate) covariance: Vec<f64>,
    /// Decrease of the sum of squares when an observation is deleted, over what χ² allows; by
    /// observation.
    pub(crate) excess: Vec<f64>,
    squared: f64,
    free: usize,
}

impl ModelFit {
    /// Returns true if the entities, together and one by one, lie within their uncertainty.
    pub(crate) fn holds(&self) -> bool {
        self.squared <= limit(self.free) && self.excess.iter().all(|x| *x <= 1.0)
    }

    /// Returns the standard deviation of a parameter.
    pub(crate) fn deviation(&self, k: usize) -> f64 {
        self.covariance[k * self.theta.len() + k].max(0.0).sqrt()
    }
}

/// A whitened difference with its derivatives by θ, a row for each component.
struct LinearizedDifference {
    values: Vec<f64>,
    rows: Vec<Vec<f64>>,
}

fn linear(of: &Observation<'_>, theta: &[f64]) -> LinearizedDifference {
    let values = of.whitener.apply(&(of.difference)(theta));
    let mut rows = vec![vec![0.0; theta.len()]; values.len()];
    let mut at = theta.to_vec();
    for k in 0..theta.len() {
        let mut side = |h: f64| {
            at[k] = theta[k] + h;
            let values = of.whitener.apply(&(of.difference)(&at));
            at[k] = theta[k];
            values
        };
        let (plus, minus) = (side(DIFFERENCE_STEP), side(-DIFFERENCE_STEP));
        for (row, (p, m)) in rows.iter_mut().zip(plus.iter().zip(&minus)) {
            row[k] = (p - m) / (2.0 * DIFFERENCE_STEP);
        }
    }
    LinearizedDifference { values, rows }
}

/// Returns the Cholesky factor of the normal equations, and their right side.
fn normal(all: &[LinearizedDifference], m: usize) -> Option<(Vec<f64>, Vec<f64>)> {
    let (mut matrix, mut side) = (vec![0.0; m * m], vec![0.0; m]);
    for (row, value) in all.iter().flat_map(|l| l.rows.iter().zip(&l.values)) {
        for i in 0..m {
            side[i] -= row[i] * value;
            for j in 0..m {
                matrix[i * m + j] += row[i] * row[j];
            }
        }
    }
    cholesky(&mut matrix, m).then_some((matrix, side))
}

/// Fits a model of `m` parameters, which start at 0; `None` if they are not determined.
pub(crate) fn fit_model(m: usize, of: &[Observation<'_>]) -> Option<ModelFit> {
    let mut theta = vec![0.0; m];
    // Two or three steps of Gauss–Newton are usual, as models start close to the solution.
    for _ in 0..12 {
        let all: Vec<LinearizedDifference> = of.iter().map(|o| linear(o, &theta)).collect();
        let (factor, mut step) = normal(&all, m)?;
        cholesky_solve(&factor, m, &mut step);
        let largest = step.iter().fold(0.0, |l: f64, s| l.max(s.abs()));
        // A larger step leaves the region in which the model was sought.
        if largest.is_nan() || largest > 0.5 {
            return None;
        }
        theta.iter_mut().zip(&step).for_each(|(t, s)| *t += s);
        // Converged, in radians and diagonals.
        if largest < 1e-12 {
            break;
        }
    }
    let all: Vec<LinearizedDifference> = of.iter().map(|o| linear(o, &theta)).collect();
    let (factor, _) = normal(&all, m)?;
    let count: usize = all.iter().map(|l| l.values.len()).sum();
    Some(ModelFit {
        covariance: inverse(&factor, m),
        excess: all.iter().map(|l| excess(l, &factor, m)).collect(),
        squared: all.iter().flat_map(|l| &l.values).map(|x| x * x).sum(),
        free: count.saturating_sub(m),
        theta,
    })
}

fn inverse(factor: &[f64], m: usize) -> Vec<f64> {
    let column = |k: usize| {
        let mut x = vec![0.0; m];
        x[k] = 1.0;
        cholesky_solve(factor, m, &mut x);
        x
    };
    (0..m).flat_map(column).collect()
}

/// Returns rᵀ(1 − H)⁻¹r over its limit.
fn excess(of: &LinearizedDifference, factor: &[f64], m: usize) -> f64 {
    let n = of.values.len();
    let mut rest = vec![0.0; n * n];
    for i in 0..n {
        let mut x = of.rows[i].clone();
        cholesky_solve(factor, m, &mut x);
        for j in 0..n {
            let leverage: f64 = x.iter().zip(&of.rows[j]).map(|(a, b)| a * b).sum();
            // The addend keeps 1 − H regular where an entity alone determines a parameter.
            rest[i * n + j] = f64::from(u8::from(i == j)) * (1.0 + 1e-9) - leverage;
        }
    }
    let mut solved = of.values.clone();
    if !cholesky(&mut rest, n) {
        return 0.0;
    }
    cholesky_solve(&rest, n, &mut solved);
    let squared: f64 = solved.iter().zip(&of.values).map(|(a, b)| a * b).sum();
    squared / limit(n.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::unit;

    #[test]
    fn a_difference_is_the_move_that_makes_it() {
        let step = [2e-5, -1e-5, 3e-5, 1e-5, -2e-5, 2e-5, 1e-5];
        for kind in PrimitiveKind::ALL.iter().copied() {
            let surface = Primitive {
                kind,
                place: [0.3, -0.2, 0.1],
                axis: unit([1.0, 2.0, -0.5]),
                size: 0.5,
                other: 0.2,
            };
            let mut moved = surface.moved(&step);
            if kind != PrimitiveKind::Torus {
                moved.axis = moved.axis.map(|x| -x);
                moved.other = -moved.other;
            }
            let moved = moved.about([0.7, 0.1, 0.4]);
            let found = difference(&surface, &moved);
            for k in 0..kind.parameters() {
                assert!(
                    (found[k] - step[k]).abs() < 1e-9,
                    "{kind:?} {k}: {}",
                    found[k]
                );
            }
        }
    }

    #[test]
    fn chi_squared_beyond_the_table() {
        // By the closed forms for whole degrees: the approximation is a little above.
        assert!((limit(5) / 30.86 - 1.02).abs() < 0.02, "{}", limit(5));
        assert!((limit(12) / 45.08 - 1.02).abs() < 0.02, "{}", limit(12));
    }

    /// A mean of numbers of deviation 1, one of which is off.
    #[test]
    fn one_that_does_not_belong_is_told() {
        let mut unit = [[0.0; MAX_PARAMETERS]; MAX_PARAMETERS];
        unit[0][0] = 1.0;
        let excess = |off: f64| {
            let of = |x: f64| Observation {
                difference: Box::new(move |t: &[f64]| [t[0] - x, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
                whitener: Whitener::from_covariance(&unit, &[0], None),
            };
            let all: Vec<_> = [0.0, 0.0, 0.0, off].map(of).into_iter().collect();
            fit_model(1, &all).expect("a mean").excess
        };
        // Against the mean of three, whose variance is 1/3: x²/(4/3) over 19.5.
        let e = excess(0.3);
        assert!((e[3] - 0.09 * 0.75 / 19.5).abs() < 1e-9, "{e:?}");
    }
}
