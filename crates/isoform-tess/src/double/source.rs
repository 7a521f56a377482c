//! Curves of parameters with a map into space: the sources of solitary curves.

use crate::complex::{
    C, Form, Monomials, Plane, V, dot, eval_all, in_half_widths, largest, norm, rounded,
};
use isoform_algebra::Poly;

/// Exponents and coefficient of a term.
type Term = ([usize; 3], f64);

/// A curve in a plane, with a map of it into space.
pub(super) struct Source {
    pub(super) curve: Form,
    pub(super) curve_degree: usize,
    /// Forms of the map, in units in which the box has the half width 1.
    forms: [Form; 4],
    pub(super) degree: usize,
    /// Points of the curve in a general complex plane of space, without base points.
    pub(super) section: Vec<V>,
}

/// Values and gradients of the curve's form f and of the map's forms g at a point.
pub(super) struct Values {
    pub(super) f: C,
    pub(super) df: V,
    pub(super) g: [C; 4],
    pub(super) dg: [V; 4],
}

impl Values {
    /// Returns the value and the gradient of the pull-back of a linear form of space.
    #[inline]
    pub(super) fn pulled_back(&self, plane: &Plane) -> (C, V) {
        (dot(plane, &self.g), self.slope(plane))
    }
    /// Returns the gradient of the pull-back alone.
    #[inline]
    pub(super) fn slope(&self, plane: &Plane) -> V {
        [0, 1, 2].map(|k| (0..4).fold(C::ZERO, |sum, i| sum + plane[i] * self.dg[i][k]))
    }
}

impl Source {
    /// Creates the source for a curve of parameters of a map, given by its rounded forms and their
    /// degree.
    pub(super) fn of_curve(
        curve: &Poly,
        forms: [Vec<Term>; 4],
        degree: usize,
        half_width: f64,
    ) -> Self {
        let [terms] = rounded([curve]);
        Self {
            curve: Form::new(terms),
            curve_degree: curve.total_degree(),
            forms: in_half_widths(forms, half_width),
            degree,
            section: Vec::new(),
        }
    }
    /// Creates the source for the seam of a base point, as a map of the line c = 0 of a plane (a :
    /// b : c), with forms given by the coefficients of aᵈ, aᵈ⁻¹b, …, bᵈ; `None` if the seam is at
    /// infinity.
    pub(super) fn of_seam(seam: [Vec<f64>; 4], half_width: f64) -> Option<Self> {
        let degree = seam[0].len() - 1;
        let forms = seam.map(|coefficients| {
            let terms = coefficients.into_iter().enumerate();
            let terms = terms.filter(|(_, c)| *c != 0.0);
            let terms = terms.map(|(j, c)| ([degree - j, j, 0], c));
            terms.collect::<Vec<Term>>()
        });
        if forms[3].is_empty() {
            return None;
        }
        Some(Self {
            curve: Form::new([([0, 0, 1], 1.0)]),
            curve_degree: 1,
            forms: in_half_widths(forms, half_width),
            degree,
            section: Vec::new(),
        })
    }
    pub(super) fn eval(&self, p: &V) -> Values {
        let m = Monomials::new(p, self.curve_degree.max(self.degree));
        let (f, df) = self.curve.eval(&m);
        let (g, dg) = eval_all(&self.forms, &m);
        Values { f, df, g, dg }
    }
    /// Returns the norm of the forms' values: small near base points only.
    pub(super) fn size(&self, p: &V) -> f64 {
        norm(&self.eval(p).g)
    }
}

/// A point (X : Y : Z : W) of space as a vector of norm 1.
pub(super) type Image = [f64; 4];

/// Returns the real vector of norm 1 nearest to complex homogeneous coordinates, for any phase of
/// these, and the norm of the imaginary part that is dropped; `None` at base points.
pub(super) fn real_image(g: &[C; 4]) -> Option<(Image, f64)> {
    let size = norm(g);
    // Smaller values, next to a base point, consist of rounding errors and have no direction.
    if size < 1e-13 {
        return None;
    }
    let largest = largest(g);
    let turned = g.map(|c| (c * largest.conj()).times(1.0 / (largest.norm() * size)));
    let real = turned.iter().map(|c| c.re * c.re).sum::<f64>().sqrt();
    let imaginary = turned.iter().map(|c| c.im * c.im).sum::<f64>().sqrt();
    Some((turned.map(|c| c.re / real), imaginary))
}

/// Returns true if two points of the box coincide.
pub(super) fn is_same_point(a: &Image, b: &Image) -> bool {
    // At pinch points, parameters have half of their digits.
    (0..3).all(|i| (a[i] * b[3] - b[i] * a[3]).abs() < 1e-6 * (a[3] * b[3]).abs())
}
