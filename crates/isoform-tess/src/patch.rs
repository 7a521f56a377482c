//! Rational Bézier patches as maps over [0, 1]² with exact coefficients.

use crate::domain::image_bounds;
use crate::field::exact;
use crate::map::{Map, MapError, MapOptions};
use isoform_algebra::{Poly, RBig};
use isoform_geom::RationalPatch;

/// A homogeneous control point: x·w, y·w, z·w, w.
pub type ControlPoint = [RBig; 4];

/// A rational Bézier patch p(s, t) = Σ Bᵢᵐ(s) Bⱼⁿ(t) cᵢⱼ over [0, 1]²; weights may be of any sign.
///
/// ```
/// use isoform_geom::RationalPatch;
/// use isoform_tess::{Patch, patch_bounds};
///
/// // The hyperbolic paraboloid z = x y over the unit square.
/// let corners = [[0.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0], [1.0; 4]];
/// let patch = Patch::from(&RationalPatch::new((1, 1), corners.to_vec())?);
/// let map = patch.map()?;
/// assert_eq!(map.degree(), 2);
/// let bounds = patch_bounds(&[patch]).expect("no pole");
/// assert_eq!(bounds, [[0.into(), 1.into()], [0.into(), 1.into()], [0.into(), 1.into()]]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Name of the patch, such as `patch 3` or `nurbs 1, span 2 1`, with numbers from 1.
    pub name: String,
    degree: [usize; 2],
    /// Control points, row by row of i.
    control: Vec<ControlPoint>,
}

impl From<&RationalPatch> for Patch {
    /// Creates the patch with exactly these control points, under the name `patch`.
    fn from(patch: &RationalPatch) -> Self {
        let (m, n) = patch.degree();
        let control = patch.control().iter().map(|p| p.map(exact)).collect();
        Self::new("patch".to_owned(), [m, n], control)
    }
}

impl Patch {
    /// Creates the patch of degrees m and n with (m + 1)(n + 1) control points, row by row of i = 0
    /// … m.
    ///
    /// # Panics
    /// If a degree is 0, or the number of control points does not match.
    pub fn new(name: String, degree: [usize; 2], control: Vec<ControlPoint>) -> Self {
        let [m, n] = degree;
        assert!(m > 0 && n > 0, "degrees of at least 1");
        assert_eq!(control.len(), (m + 1) * (n + 1), "the control points");
        Self {
            name,
            degree,
            control,
        }
    }
    /// Returns the map over [0, 1]²; a common factor of its polynomials is removed.
    ///
    /// # Errors
    /// [`MapError`]: the image is not a surface, or has no finite point.
    pub fn map(&self) -> Result<Map, MapError> {
        Map::new(self.polynomials(), MapOptions { reduce: true })
    }
    /// Returns X, Y, Z and W in s and t.
    fn polynomials(&self) -> [Poly; 4] {
        let [m, n] = self.degree;
        [0, 1, 2, 3].map(|c| {
            let mut rows: Vec<Vec<RBig>> = self
                .control
                .chunks(n + 1)
                .map(|row| to_powers(row.iter().map(|p| p[c].clone()).collect()))
                .collect();
            for j in 0..=n {
                let column = to_powers((0..=m).map(|i| rows[i][j].clone()).collect());
                for (row, x) in rows.iter_mut().zip(column) {
                    row[j] = x;
                }
            }
            let mut terms = Vec::new();
            for (i, row) in rows.into_iter().enumerate() {
                let powers = (0..).map(|j| [i as u16, j, 0, 0]);
                terms.extend(powers.zip(row).filter(|t| !t.1.is_zero()));
            }
            Poly::from_terms(terms)
        })
    }
    /// Returns the control points of a side, in the order of [`crate::Domain::rectangle`]: t = 0, s
    /// = 1, t = 1 backward, s = 0 backward.
    pub(crate) fn side(&self, side: usize) -> Vec<&ControlPoint> {
        let [m, n] = self.degree;
        let at = |i: usize, j: usize| &self.control[i * (n + 1) + j];
        match side {
            0 => (0..=m).map(|i| at(i, 0)).collect(),
            1 => (0..=n).map(|j| at(m, j)).collect(),
            2 => (0..=m).rev().map(|i| at(i, n)).collect(),
            _ => (0..=n).rev().map(|j| at(0, j)).collect(),
        }
    }
}

/// Returns a box that contains all patches, if none has a pole: the minimum and maximum of the
/// coordinates of control points, after halving patches whose weights have both signs.
pub fn patch_bounds(patches: &[Patch]) -> Option<[[RBig; 2]; 3]> {
    let unit = [0, 1].map(|_| [RBig::ZERO, RBig::ONE]);
    let mut all: Option<[[RBig; 2]; 3]> = None;
    for patch in patches {
        let next = image_bounds(&patch.polynomials(), &unit)?;
        all = Some(match all {
            None => next,
            Some(old) => std::array::from_fn(|k| hull(&old[k], &next[k])),
        });
    }
    all
}

/// Returns the smallest interval that contains two others.
fn hull([a, b]: &[RBig; 2], [c, d]: &[RBig; 2]) -> [RBig; 2] {
    [a.min(c).clone(), b.max(d).clone()]
}

/// Converts Bernstein coefficients to coefficients of powers.
fn to_powers(line: Vec<RBig>) -> Vec<RBig> {
    // The coefficient of the k-th power is the k-th difference of the first Bernstein coefficients,
    // times n over k.
    let n = line.len() - 1;
    let (mut differences, mut binomial, mut found) = (line, RBig::ONE, Vec::with_capacity(n + 1));
    for k in 0..=n {
        found.push(&differences[0] * &binomial);
        binomial = binomial * RBig::from(n - k) / RBig::from(k + 1);
        differences = differences.windows(2).map(|w| &w[1] - &w[0]).collect();
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn eval(p: &Patch, s: f64, t: f64) -> [f64; 3] {
        let at = [s, t].map(exact);
        let [x, y, z, w] = p.polynomials().map(|f| f.eval(&at));
        [x, y, z].map(|x| (x / &w).to_f64().value())
    }

    #[test]
    fn a_bilinear_patch() {
        let corners = [[0, 0, 0, 1], [0, 2, 0, 1], [3, 0, 0, 1], [6, 4, 10, 2]];
        let control = corners.map(|p| p.map(RBig::from)).to_vec();
        let patch = Patch::new("patch 1".to_owned(), [1, 1], control);
        assert_eq!(eval(&patch, 0.0, 1.0), [0.0, 2.0, 0.0]);
        assert_eq!(eval(&patch, 1.0, 1.0), [3.0, 2.0, 5.0]);
        assert_eq!(eval(&patch, 1.0, 0.0), [3.0, 0.0, 0.0]);
        let bounds = patch_bounds(&[patch])
            .expect("no pole")
            .map(|b| b.map(|x| x.to_f64().value()));
        assert_eq!(bounds, [[0.0, 3.0], [0.0, 2.0], [0.0, 5.0]]);
    }

    /// A patch of doubles keeps its points, and the bits of its control points.
    #[test]
    fn patches_of_doubles_are_taken_exactly() {
        let s = 0.5f64.sqrt();
        let arc = |z: f64| [[1.0, 0.0, z, 1.0], [s, s, s * z, s], [0.0, 1.0, z, 1.0]];
        let doubles = RationalPatch::new((1, 2), [arc(0.0), arc(2.0)].concat()).expect("a patch");
        let patch = Patch::from(&doubles);
        let [x, y] = [0, 1].map(|k| patch.control[1][k].to_f64().value());
        assert_eq!([x, y], [s, s]);
        let (a, b) = (eval(&patch, 0.25, 0.3), doubles.point(0.25, 0.3));
        assert!((0..3).all(|k| (a[k] - b[k]).abs() < 1e-15), "{a:?} {b:?}");
    }
}
