//! Normalisation of parameters: an affine change of parameters after which a map's coefficients are
//! nearly as small as possible.
//!
//! Of all maps φ(M·(s, t, w)) with det M = 1, the one of least Bombieri norm is where the moment
//! map μᵢⱼ = Σ ⟨xⱼ ∂ᵢF, F⟩ is a multiple of the identity (G. Kempf, L. Ness, *The length of vectors
//! in representation spaces*, 1979). The norm is convex along geodesics, and M ← M·exp(−τ(μ − tr
//! μ/3)) descends to the minimum. The norm is invariant under rotations, so M is taken upper
//! triangular: an affine map.

use crate::analysis::Analysis;
use crate::deck::linear;
use crate::domain::{Domain, Parameters};
use crate::field::{Algebraic, Element};
use crate::map::Map;
use crate::singular::RealPart;
use crate::zeros::Chart;
use isoform_algebra::{Exponents, Poly, RBig};
use isoform_geom::Gram;

/// An affine change of the parameters: (s : t : w) = M·(s′ : t′ : w′), M upper triangular.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    matrix: [[RBig; 3]; 3],
}

/// A matrix in floating point, by rows.
type Matrix = [[f64; 3]; 3];

/// The identity matrix.
const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    let entry = |i: usize, j: usize| (0..3).map(|k| a[i][k] * b[k][j]).sum();
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)))
}

/// Returns exp A, by the series at A/4, squared twice.
fn exponential(a: &Matrix) -> Matrix {
    let small = a.map(|row| row.map(|x| 0.25 * x));
    let (mut sum, mut term) = (IDENTITY, IDENTITY);
    for k in 1..16 {
        term = times(&term, &small).map(|row| row.map(|x| x / f64::from(k)));
        for (sum, term) in sum.iter_mut().flatten().zip(term.iter().flatten()) {
            *sum += term;
        }
    }
    let half = times(&sum, &sum);
    times(&half, &half)
}

/// Returns the upper triangular matrix with positive diagonal that differs from a matrix by a
/// rotation from the right.
fn triangular(m: &Matrix) -> Matrix {
    let mut rows = *m;
    let mut upper = [[0.0; 3]; 3];
    for i in (0..3).rev() {
        let length = rows[i].iter().map(|x| x * x).sum::<f64>().sqrt();
        let axis = rows[i].map(|x| x / length);
        upper[i][i] = length;
        for k in 0..i {
            let along = (0..3).map(|j| rows[k][j] * axis[j]).sum::<f64>();
            upper[k][i] = along;
            for j in 0..3 {
                rows[k][j] -= along * axis[j];
            }
        }
    }
    upper
}

fn factorial(n: usize) -> f64 {
    (1..=n).map(|k| k as f64).product()
}

/// Returns the squared Bombieri norm of forms, and their moment map divided by it.
fn moment(forms: &[Poly; 4]) -> (f64, Matrix) {
    let mut norm = 0.0;
    let mut moment = [[0.0; 3]; 3];
    for form in forms {
        let terms = form.to_f64();
        let weight = |e: [usize; 3]| e.iter().map(|&n| factorial(n)).product::<f64>();
        for (e, c) in &terms {
            let e = [0, 1, 2].map(|v| usize::from(e[v]));
            norm += c * c * weight(e);
            for i in (0..3).filter(|&i| e[i] > 0) {
                for j in 0..3 {
                    let mut to = e;
                    to[i] -= 1;
                    to[j] += 1;
                    let other = coefficient(&terms, &exponents(to));
                    moment[i][j] += c * other * e[i] as f64 * weight(to);
                }
            }
        }
    }
    (norm, moment.map(|row| row.map(|x| x / norm)))
}

/// Returns the exponents of a form in s, t and w.
fn exponents(e: [usize; 3]) -> Exponents {
    let [i, j, k] = e.map(|n| n as u16);
    [i, j, k, 0]
}

/// Returns the coefficient of a monomial.
fn coefficient(terms: &[(Exponents, f64)], e: &Exponents) -> f64 {
    terms.iter().find(|t| t.0 == *e).map_or(0.0, |t| t.1)
}

/// Returns the inner product of two coefficient vectors.
fn inner(a: &[(Exponents, f64)], b: &[(Exponents, f64)]) -> f64 {
    a.iter().map(|(e, c)| c * coefficient(b, e)).sum()
}

/// Returns the translation that minimises the terms of second highest degree of the four
/// polynomials: a + ∂ₛT x + ∂ₜT y for terms T of highest degree, by least squares.
fn centre(map: &Map) -> Matrix {
    let mut normal = [[0.0; 2]; 2];
    let mut right = [0.0; 2];
    for p in map.affine().iter().filter(|p| p.total_degree() > 0) {
        let top = p.homogeneous_part(p.total_degree());
        let next = p.homogeneous_part(p.total_degree() - 1).to_f64();
        let slopes = [0, 1].map(|v| top.derivative(v).to_f64());
        let top = top.to_f64();
        let size = inner(&top, &top);
        for i in 0..2 {
            for j in 0..2 {
                normal[i][j] += inner(&slopes[i], &slopes[j]) / size;
            }
            right[i] -= inner(&slopes[i], &next) / size;
        }
    }
    let [x, y] = least_squares(normal, right);
    [[1.0, 0.0, x], [0.0, 1.0, y], [0.0, 0.0, 1.0]]
}

/// Solves normal equations; if they are singular, solves the one with the larger diagonal entry.
fn least_squares([[uu, uv], [_, vv]]: [[f64; 2]; 2], right: [f64; 2]) -> [f64; 2] {
    let gram = Gram { uu, uv, vv };
    // The slopes are known from doubles with half of their digits.
    if gram.is_regular(1e-9) {
        gram.solve(right)
    } else if uu >= vv && uu > 0.0 {
        [right[0] / uu, 0.0]
    } else if vv > 0.0 {
        [0.0, right[1] / vv]
    } else {
        [0.0, 0.0]
    }
}

/// Rounds a matrix to as few binary digits as suffice, with the last entry 1: the entries of a row
/// to a sixteenth of what moves a parameter by its size.
fn rounded(m: &Matrix) -> Option<Frame> {
    let m = m.map(|row| row.map(|x| x / m[2][2]));
    let [[a, b, _], [_, c, _], _] = m;
    // The largest entries of the inverse in the first two columns.
    let sizes = [1.0 / a, (1.0 / c).abs().max((b * (1.0 / c) / a).abs())];
    let row = |i: usize| {
        let size = sizes[i].abs();
        let unit = (-(16.0 * size).log2().ceil()).exp2();
        let exact = |x: f64| RBig::try_from((x / unit).round() * unit).ok();
        let [a, b, c] = m[i].map(exact);
        Some([a?, b?, c?])
    };
    let matrix = [row(0)?, row(1)?, [RBig::ZERO, RBig::ZERO, RBig::ONE]];
    let is_regular = (0..2).all(|i| !matrix[i][i].is_zero());
    is_regular.then_some(Frame { matrix })
}

impl Frame {
    /// Returns the frame in which a map's coefficients are small, if they are much smaller there.
    pub fn find(map: &Map) -> Option<Self> {
        let start = Self::level(map, &IDENTITY)?.0;
        let centre = centre(map);
        let centred = Self::level(map, &centre)?;
        // A torus with s scaled by 10³ gains 4.4; typical maps gain less than 1.5 and keep their
        // parameters.
        let is_worth = |level: f64| start - level > 4.0;
        let found = Self::least(map, centre, centred).filter(|found| is_worth(found.0));
        let moved = || is_worth(centred.0).then_some(centre);
        found.map(|f| f.1).or_else(moved).and_then(|m| rounded(&m))
    }
    /// Returns the level, moment map and matrix after a step against the gradient. The step is
    /// doubled as long as the norm decreases.
    fn descend(map: &Map, matrix: &Matrix, gradient: &Matrix) -> Option<((f64, Matrix), Matrix)> {
        let degree = map.degree() as f64;
        let mut best: Option<((f64, Matrix), Matrix)> = None;
        // Up to six doublings of the step.
        for k in 0..=6 {
            // The shortest step is a quarter of the stable one for a single monomial.
            let length = 0.25 / degree * f64::from(1 << k);
            let step = exponential(&gradient.map(|row| row.map(|x| -length * x)));
            let next = triangular(&times(matrix, &step));
            let there = Self::level(map, &next)?;
            if best.as_ref().is_some_and(|b| b.0.0 <= there.0) {
                break;
            }
            best = Some((there, next));
        }
        best
    }
    /// Returns the level and matrix of least norm, descending from a start; `None` if the descent
    /// does not converge.
    fn least(map: &Map, mut matrix: Matrix, mut here: (f64, Matrix)) -> Option<(f64, Matrix)> {
        let degree = map.degree() as f64;
        // Parameters off by a factor of 10⁶ take about ten steps. If no minimum exists, more
        // steps diverge.
        for _ in 0..40 {
            let mut rest = here.1;
            for (i, row) in rest.iter_mut().enumerate() {
                row[i] -= degree / 3.0;
            }
            let largest = rest.iter().flatten().fold(0.0, |m: f64, x| m.max(x.abs()));
            // A bound a hundred times smaller changes nothing visible.
            if largest < 0.05 * degree {
                return Some((here.0, matrix));
            }
            (here, matrix) = Self::descend(map, &matrix, &rest)?;
        }
        None
    }
    /// Returns the logarithm of the norm with a matrix, scaled to determinant 1, and the moment
    /// map.
    fn level(map: &Map, matrix: &Matrix) -> Option<(f64, Matrix)> {
        let frame = rounded(matrix)?;
        let (norm, moment) = moment(&frame.forms(map));
        let diagonal = (0..3).map(|i| frame.matrix[i][i].to_f64().value().abs().ln());
        let scale = diagonal.sum::<f64>() * map.degree() as f64 / 3.0;
        let level = 0.5 * norm.ln() - scale;
        let is_finite = level.is_finite() && moment.iter().flatten().all(|x| x.is_finite());
        is_finite.then_some((level, moment))
    }
    /// Returns the rows of M.
    pub fn matrix(&self) -> Matrix {
        self.matrix
            .each_ref()
            .map(|row| row.each_ref().map(|x| x.to_f64().value()))
    }
    fn forms(&self, map: &Map) -> [Poly; 4] {
        let rows = self.matrix.each_ref().map(linear);
        map.forms().each_ref().map(|f| f.compose(&rows))
    }
    /// Returns the map in the parameters of the frame.
    pub fn map(&self, map: &Map) -> Map {
        let affine = self.forms(map).map(|f| f.dehomogenise(2));
        Map::new(affine, Default::default()).expect("as good a map as before")
    }
    /// Returns M⁻¹.
    fn inverse(&self) -> [[RBig; 3]; 3] {
        let m = &self.matrix;
        let mut x: [[RBig; 3]; 3] = Default::default();
        for j in 0..3 {
            for i in (0..=j).rev() {
                let one = if i == j { RBig::ONE } else { RBig::ZERO };
                let rest = (i + 1..=j).fold(one, |sum, k| sum - &m[i][k] * &x[k][j]);
                x[i][j] = rest / &m[i][i];
            }
        }
        x
    }
    /// Returns a domain in the parameters of the frame.
    pub fn domain(&self, domain: &Domain) -> Domain {
        let inverse = self.inverse();
        let moved = |[s, t]: &Parameters| {
            let [x, y, w] = inverse
                .each_ref()
                .map(|row| &row[0] * s + &row[1] * t + &row[2]);
            [x / &w, y / w]
        };
        let corners = domain.corners().iter().map(moved).collect();
        Domain::polygon(corners).expect("as simple a polygon as before")
    }
    /// Converts an analysis in the parameters of the frame to the map's own parameters; seams of
    /// base points keep the coordinates of the frame.
    pub fn analysis(&self, mut found: Analysis) -> Analysis {
        let back = self.inverse().each_ref().map(linear);
        let curve = |f: &mut Poly| Self::moved_back(f, &back);
        for p in found.base_points.iter_mut().flatten() {
            (p.chart, p.point) = self.point(&p.point);
        }
        for (factor, _) in found.pole.iter_mut().flatten() {
            curve(factor);
        }
        if let Some(singular) = &mut found.singular {
            if let Some(double) = &mut singular.double {
                curve(double);
            }
            curve(&mut singular.minors);
            for c in &mut singular.curves {
                curve(&mut c.curve);
                if let RealPart::Points(points) = &mut c.real {
                    for p in points {
                        *p = self.point(p).1;
                    }
                }
            }
        }
        found
    }
    /// Converts curves in the parameters of the frame to the map's own parameters.
    pub(crate) fn curves(&self, curves: &mut [Poly]) {
        let back = self.inverse().each_ref().map(linear);
        curves.iter_mut().for_each(|f| Self::moved_back(f, &back));
    }
    fn moved_back(f: &mut Poly, back: &[Poly; 3]) {
        *f = f.compose(back).primitive();
    }
    /// Multiplies a column by the matrix.
    fn moved(&self, p: &[Algebraic; 3]) -> [Element; 3] {
        let element = |x: &Algebraic| match x.as_rational() {
            Some(r) => Element::rational(&r),
            None => x.element().clone(),
        };
        let p = p.each_ref().map(element);
        self.matrix
            .each_ref()
            .map(|row| (0..3).fold(Element::zero(), |sum, v| sum.add(&p[v].scaled(&row[v]))))
    }
    /// Converts a point (s′ : t′ : w′) to (s : t : w) in the first chart that contains it.
    fn point(&self, p: &[Algebraic; 3]) -> (Chart, [Algebraic; 3]) {
        // One of the coordinates is 1; the others belong to one field.
        let of = p.iter().find(|x| x.field().degree() > 1).unwrap_or(&p[0]);
        let (field, root) = (of.field().clone(), of.root());
        let moved = self.moved(p);
        let chart = [Chart::Affine, Chart::Infinite, Chart::Corner]
            .into_iter()
            .find(|c| !moved[c.variables().1].is_zero())
            .expect("a regular matrix");
        let one = chart.variables().1;
        let inverse = field.inverse(&moved[one]);
        let point = moved
            .each_ref()
            .map(|x| Algebraic::new(&field, root, field.mul(x, &inverse)));
        (chart, point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::{Budget, analyse};
    use isoform_control::Control;

    const TORUS: [&str; 4] = [
        "(1 - S^2)*(T^2 + 3)",
        "2*S*(T^2 + 3)",
        "2*T*(S^2 + 1)",
        "(S^2 + 1)*(T^2 + 1)",
    ];
    const SPHERE: [&str; 4] = ["2*S", "2*T", "S^2 + T^2 - 1", "S^2 + T^2 + 1"];
    const WHITNEY: [&str; 4] = ["S*T", "S", "T^2", "1"];

    fn map(texts: [&str; 4], [s, t]: [&str; 2]) -> Map {
        let put = |x: &str| x.replace('S', s).replace('T', t);
        let texts = texts.map(put);
        Map::parse(texts.each_ref().map(String::as_str), Default::default()).expect("a map")
    }

    /// Typical parameters are not changed.
    #[test]
    fn what_is_in_place_stays() {
        for texts in [TORUS, SPHERE, WHITNEY] {
            for parameters in [["s", "t"], ["(2*s - t)", "(s + 3)"], ["(10*s)", "(t - 4)"]] {
                assert_eq!(
                    Frame::find(&map(texts, parameters)),
                    None,
                    "{texts:?} {parameters:?}"
                );
            }
        }
    }

    /// Badly scaled parameters are normalised to small coefficients, and an analysis in the frame
    /// equals that of the map.
    #[test]
    fn what_is_far_away_comes_back() {
        for (texts, parameters) in [
            (SPHERE, ["(s - 100000)", "(t + 100000)"]),
            (SPHERE, ["(s*1000000)", "(t*1000000)"]),
            (TORUS, ["(s*1000000)", "t"]),
            (TORUS, ["(s/1000000 - 700)", "(3*s/1000000 + t)"]),
            (WHITNEY, ["(s - 123456)", "(t + 99999)"]),
        ] {
            let far = map(texts, parameters);
            let frame = Frame::find(&far).expect("far away");
            let near = frame.map(&far);
            let size = |m: &Map| {
                let terms = m.forms().iter().flat_map(|f| f.to_f64());
                let sizes: Vec<f64> = terms.map(|(_, c)| c.abs()).collect();
                let least = sizes.iter().copied().fold(f64::INFINITY, f64::min);
                sizes.iter().copied().fold(0.0, f64::max) / least
            };
            assert!(size(&near) < 1e4, "{parameters:?}: {}", size(&near));
            let known = |m: &Map| analyse(m, &Budget::default(), &Control::default());
            let (found, expected) = (frame.analysis(known(&near)), known(&far));
            let points = |a: &Analysis| {
                let all = a.base_points.iter().flatten();
                let mut list: Vec<String> = all
                    .map(|p| {
                        let at = p.point.each_ref().map(|x| x.as_rational());
                        format!("{:?} {at:?} {}", p.chart, p.multiplicity())
                    })
                    .collect();
                list.sort();
                list
            };
            assert_eq!(points(&found), points(&expected), "{parameters:?}");
            let curves = |a: &Analysis| {
                let singular = a.singular.iter().flat_map(|s| &s.curves).map(|c| &c.curve);
                let pole = a.pole.iter().flatten().map(|p| &p.0);
                let mut list: Vec<String> = singular.chain(pole).map(ToString::to_string).collect();
                list.sort();
                list
            };
            assert_eq!(curves(&found), curves(&expected), "{parameters:?}");
        }
    }

    /// A frame maps a domain to the parameters of the map in that frame.
    #[test]
    fn domains_move_along() {
        let far = map(TORUS, ["(s - 100000)", "(t/1000)"]);
        let frame = Frame::find(&far).expect("far away");
        let near = frame.map(&far);
        let corners = [[100_000, 0], [100_002, 0], [100_001, 3000]];
        let corners: Vec<Parameters> = corners.map(|c| c.map(RBig::from)).to_vec();
        let domain = Domain::polygon(corners.clone()).expect("a triangle");
        for (p, q) in corners.iter().zip(frame.domain(&domain).corners()) {
            let image = |m: &Map, p: &Parameters| {
                let [x, y, z, w] = m.affine().each_ref().map(|f| f.eval(p));
                [x / &w, y / &w, z / w]
            };
            assert_eq!(image(&far, p), image(&near, q));
        }
    }
}
