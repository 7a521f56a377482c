//! The border of the real image of an improper map.
//!
//! Along a curve that a deck transformation σ fixes pointwise, φ folds the parameter plane: it is
//! locally like (x, y) ↦ (x², y), whose real image ends at x = 0. The surface continues with
//! imaginary x. In general, a parameter p whose conjugate is σ(p) has a real image, as φ(p) =
//! φ(σ(p)) is conjugate to φ(p). Such parameters form a family of two real dimensions next to every
//! fold, and for every linear involution σ: in coordinates in which σ changes the sign of one of
//! them, they are the points with that coordinate imaginary and the others real.

use crate::deck::{Deck, linear};
use crate::map::{Map, MapOptions};
use crate::singular::{RealPart, real_part};
use isoform_algebra::{Poly, RBig};
use isoform_control::Control;
use isoform_geom::Point3;

/// The border of the real image of an improper map, and the surface beyond it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RealBorder {
    /// Curves of parameters, in s, t and w, along which the map folds the plane: those with real
    /// arcs and finite images.
    pub folds: Vec<Poly>,
    /// Images of the folds in the box, and of base points that are blown up to folds.
    pub lines: Vec<Vec<Point3>>,
    /// Real maps onto the points reached by parameters whose conjugates are their images under a
    /// linear deck transformation.
    pub beyond: Vec<Map>,
}

impl RealBorder {
    /// Creates the border of a map with deck transformations, without its lines on a surface.
    pub(crate) fn new(map: &Map, deck: &Deck, control: &Control<'_>) -> Self {
        let sides = (0..3).filter(|&k| deck.folds.sides[k]).map(Poly::var);
        // Where W vanishes, the surface ends at infinity.
        let is_finite = |f: &Poly| !map.forms()[3].is_multiple_of(f);
        let is_real = |f: &Poly| matches!(real_part(f, control), Ok(RealPart::Curve));
        let folds = sides.chain(deck.folds.curves.iter().cloned());
        Self {
            folds: folds.filter(|f| is_finite(f) && is_real(f)).collect(),
            lines: Vec::new(),
            beyond: deck.linear().filter_map(|m| beyond(map, &m)).collect(),
        }
    }
    /// Returns true if nothing is known to be beyond the real image.
    pub fn is_empty(&self) -> bool {
        self.folds.is_empty() && self.lines.is_empty() && self.beyond.is_empty()
    }
}

type Matrix = [[RBig; 3]; 3];

/// Returns the map φ(M·(x, y, z)) with one coordinate imaginary: the one whose sign an involution
/// changes in the coordinates of M. `None` if the matrix is not an involution.
fn beyond(map: &Map, involution: &Matrix) -> Option<Map> {
    // The eigenvalues are λ, λ and −λ, so that λ is the trace.
    let trace = (0..3).fold(RBig::ZERO, |sum, k| sum + &involution[k][k]);
    let square = |i: usize, j: usize| {
        (0..3).fold(RBig::ZERO, |sum, k| {
            sum + &involution[i][k] * &involution[k][j]
        })
    };
    let on_diagonal = |i: usize, j: usize, x: &RBig| if i == j { x.clone() } else { RBig::ZERO };
    let is_square = |i: usize, j: usize| square(i, j) == on_diagonal(i, j, &(&trace * &trace));
    if trace == RBig::ZERO || !(0..9).all(|k| is_square(k / 3, k % 3)) {
        return None;
    }
    // The columns of the matrix ± λ span the eigenspaces of ±λ.
    let column = |sign: i32, j: usize| {
        [0, 1, 2].map(|i| on_diagonal(i, j, &trace) * RBig::from(sign) + &involution[i][j])
    };
    let is_zero = |c: &[RBig; 3]| c.iter().all(|x| *x == RBig::ZERO);
    let turned = (0..3).find(|&j| !is_zero(&column(-1, j)))?;
    let is_parallel = |a: &[RBig; 3], b: &[RBig; 3]| {
        (0..3).all(|i| (0..i).all(|j| &a[i] * &b[j] == &a[j] * &b[i]))
    };
    let mut kept: Vec<[RBig; 3]> = Vec::new();
    for c in (1..4).map(|k| column(1, (turned + k) % 3)) {
        if !is_zero(&c) && !kept.iter().any(|k| is_parallel(k, &c)) {
            kept.push(c);
        }
    }
    let mut columns: Matrix = Default::default();
    columns[turned] = column(-1, turned);
    for (k, c) in (1..3).zip(kept) {
        columns[(turned + k) % 3] = c;
    }
    let parts = [0, 1, 2].map(|i| linear(&[0, 1, 2].map(|k| columns[k][i].clone())));
    let forms = map.forms().each_ref().map(|f| f.compose(&parts));
    // Only even powers of that coordinate occur, since the forms have no common factor.
    if forms
        .iter()
        .any(|f| f.terms().iter().any(|t| t.0[turned] % 2 == 1))
    {
        return None;
    }
    let imaginary = forms.each_ref().map(|f| {
        Poly::from_terms(f.terms().iter().map(|&(e, _)| {
            let c = f.coefficient(e);
            let c = if e[turned] % 4 == 2 { -c } else { c };
            ([e[0], e[1], 0, 0], c)
        }))
    });
    Map::new(imaginary, MapOptions { reduce: true }).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(rows: [[i64; 3]; 3]) -> Matrix {
        rows.map(|row| row.map(RBig::from))
    }
    fn beyond_of(texts: [&str; 4], rows: [[i64; 3]; 3]) -> Option<Map> {
        let map = Map::parse(texts, Default::default()).expect("a map");
        beyond(&map, &matrix(rows))
    }

    /// Points of the maps found lie on the surface, beyond its border.
    #[test]
    fn the_other_sides_are_reached() {
        // z = x² + y² with x = s² ≥ 0.
        let half = ["s^2", "t", "s^4 + t^2", "1"];
        let other = beyond_of(half, [[-1, 0, 0], [0, 1, 0], [0, 0, 1]]).expect("a map");
        let at = |map: &Map, p: [i64; 3]| {
            let forms = map.forms();
            [0, 1, 2, 3].map(|k| forms[k].eval(&p.map(RBig::from)).to_f64().value())
        };
        for p in [[1, 2, 1], [3, -1, 2], [-5, 4, 1]] {
            let [x, y, z, w] = at(&other, p);
            assert_eq!(x * x + y * y, z * w);
            assert!(x / w < 0.0);
        }
        // The map x = s + t, y = s t reaches x² ≥ 4 y, and with conjugate s and t the rest of the
        // plane.
        let swap = [[0, 1, 0], [1, 0, 0], [0, 0, 1]];
        let other = beyond_of(["s + t", "s*t", "0", "1"], swap).expect("a map");
        for p in [[1, 2, 1], [3, -1, 2], [-5, 4, 1]] {
            let [x, y, _, w] = at(&other, p);
            assert!(x * x <= 4.0 * y * w, "{x} {y} {w}");
        }
        assert!(beyond_of(half, [[0, 1, 0], [0, 0, 1], [1, 0, 0]]).is_none());
    }
}
