//! Moving a side onto an edge: parameter lines are extended or shortened to where they meet it.

use crate::stretch::beside;
use isoform_geom::{Field, Point3, RationalPatch, Tangents, bernstein, dot, norm};
use isoform_num::linalg::{cholesky, cholesky_solve};

/// Maximum distance from a side of the patch inward, and beyond its extrapolation outward, at which
/// an edge is sought onto which the side is moved; in lengths of the patch.
const EDGE_REACH: f64 = 0.6;

/// Moves a side of a patch onto an edge; `None` if parameter lines do not meet it nearby.
pub(super) fn put_on(
    patch: &RationalPatch,
    side: usize,
    share: f64,
    edge: &dyn Field,
) -> Option<RationalPatch> {
    let (m, n) = patch.degree();
    let count = if side < 2 { n } else { m };
    let line = |k: usize| ParameterLine {
        patch,
        side,
        t: k as f64 / count as f64,
    };
    let moved: Vec<f64> = (0..=count)
        .map(|k| line(k).meets(edge, share))
        .collect::<Option<_>>()?;
    let put = interpolated_at((m, n), |i, j| {
        let (s, t) = (i as f64 / m as f64, j as f64 / n as f64);
        let (u, v) = match side {
            0 => (-moved[j] + s * (1.0 + moved[j]), t),
            1 => (s * (1.0 + moved[j]), t),
            2 => (s, -moved[i] + t * (1.0 + moved[i])),
            _ => (s, t * (1.0 + moved[i])),
        };
        patch.homogeneous(u, v)[0]
    })?;
    Some(put).filter(|p| p.control_weights().0 > 0.0)
}

/// Parameter line across a side, at the parameter t of the side.
struct ParameterLine<'p> {
    patch: &'p RationalPatch,
    side: usize,
    t: f64,
}

impl ParameterLine<'_> {
    fn at(&self, e: f64) -> Tangents {
        let (u, v) = beside(self.side, self.t, e);
        self.patch.tangents(u, v)
    }

    /// Returns the distance beyond the side, in parameters, at which the line meets an edge; `None`
    /// if it does not nearby.
    fn meets(&self, edge: &dyn Field, share: f64) -> Option<f64> {
        let mut e = 0.0f64;
        for _ in 0..12 {
            let at = self.at(e);
            let j = edge.jet(at.point);
            let step = j.v / dot(j.g, outward(&at, self.side));
            e = (e - step).clamp(-2.0 * EDGE_REACH, share + 2.0 * EDGE_REACH);
            if !e.is_finite() {
                return None;
            }
            if step.abs() < 1e-10 {
                break;
            }
        }
        let (u, v) = beside(self.side, self.t, e);
        let j = edge.jet(self.patch.point(u, v));
        // A millionth of the patch, as measured by its tangents.
        let is_met = j.v.abs() <= 1e-6 * norm(j.g) * norm(self.patch.tangents(u, v).u);
        (e > -EDGE_REACH && e < share + EDGE_REACH && is_met).then_some(e)
    }
}

/// Returns the derivative of p outward across a side.
fn outward(at: &Tangents, side: usize) -> Point3 {
    match side {
        0 => at.u.map(|x| -x),
        1 => at.u,
        2 => at.v.map(|x| -x),
        _ => at.v,
    }
}

/// Returns the patch of degree (m, n) through these homogeneous points at (i/m, j/n), interpolated
/// first along v for each u, then along u.
fn interpolated_at(
    (m, n): (usize, usize),
    value: impl Fn(usize, usize) -> [f64; 4],
) -> Option<RationalPatch> {
    let row = |i: usize| interpolated(&(0..=n).map(|j| value(i, j)).collect::<Vec<_>>());
    let rows: Vec<Vec<[f64; 4]>> = (0..=m).map(row).collect::<Option<_>>()?;
    let column = |j: usize| interpolated(&rows.iter().map(|r| r[j]).collect::<Vec<_>>());
    let columns: Vec<Vec<[f64; 4]>> = (0..=n).map(column).collect::<Option<_>>()?;
    let control = (0..=m).flat_map(|i| columns.iter().map(move |c| c[i]));
    RationalPatch::new((m, n), control.collect()).ok()
}

/// Returns the Bernstein coefficients of the polynomial with these values at 0, 1/n, …, 1.
fn interpolated(values: &[[f64; 4]]) -> Option<Vec<[f64; 4]>> {
    let n = values.len();
    let rows: Vec<Vec<f64>> = (0..n)
        .map(|i| bernstein(n - 1, i as f64 / (n - 1) as f64).0)
        .collect();
    let mut normal: Vec<f64> = (0..n * n)
        .map(|k| rows.iter().map(|r| r[k / n] * r[k % n]).sum())
        .collect();
    if !cholesky(&mut normal, n) {
        return None;
    }
    let mut out = vec![[0.0; 4]; n];
    for k in 0..4 {
        let mut x: Vec<f64> = (0..n)
            .map(|i| rows.iter().zip(values).map(|(r, v)| r[i] * v[k]).sum())
            .collect();
        cholesky_solve(&normal, n, &mut x);
        for (o, x) in out.iter_mut().zip(x) {
            o[k] = x;
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The cubic with the values of x³ at 0, 1/3, 2/3 and 1 is x³.
    #[test]
    fn cubics_are_interpolated() {
        let values: Vec<[f64; 4]> = (0..4)
            .map(|i| [(f64::from(i) / 3.0).powi(3), 1.0, f64::from(i) / 3.0, 0.0])
            .collect();
        let control = interpolated(&values).expect("a polynomial");
        let want = [0.0, 0.0, 0.0, 1.0].into_iter().zip([0.0, 1.0, 2.0, 3.0]);
        for (c, (cube, linear)) in control.iter().zip(want) {
            assert!((c[0] - cube).abs() < 1e-12 && (c[1] - 1.0).abs() < 1e-12);
            assert!((c[2] - linear / 3.0).abs() < 1e-12);
        }
    }
}
