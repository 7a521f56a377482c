//! Base points opened: the directions in which a base point is approached, and the points of its seam curve that they lead to.
//!
//! A direction and its opposite lead to the same point (C. L. Bajaj, A. Royappa, 1994, Theorem 1), so directions are kept up to sign, and
//! those that bound the region or lie on a curve that is drawn are among them: the tangents there.

use crate::base::{BasePoint, BinaryForm};
use crate::region::Region;
use crate::surface::Point3;
use isoform_algebra::{Poly, QUADRANTS, RBig, real_roots};
use std::f64::consts::PI;

/// A direction (a, b) of length 1 in the local coordinates, b > 0 or b = 0 < a.
#[derive(Clone, Debug)]
pub(crate) struct Direction {
    pub(crate) at: [f64; 2],
    /// Faces of the box that the seam crosses there, as bits.
    pub(crate) faces: u8,
    /// Factors of the region with this tangent.
    pub(crate) factors: Vec<usize>,
}

impl Direction {
    fn new(at: [f64; 2]) -> Self {
        let length = at[0].hypot(at[1]);
        let sign = if at[1] < 0.0 || (at[1] == 0.0 && at[0] < 0.0) { -1.0 } else { 1.0 };
        // No negative zeros: a direction names a vertex.
        Self { at: at.map(|x| sign * x / length + 0.0), faces: 0, factors: Vec::new() }
    }
    pub(crate) fn angle(&self) -> f64 {
        self.at[1].atan2(self.at[0])
    }
    /// What names the point of the seam.
    pub(crate) fn key(&self) -> [u64; 2] {
        self.at.map(f64::to_bits)
    }
}

/// A base point and its directions.
#[derive(Clone)]
pub(crate) struct Fan {
    /// Why it cannot be opened.
    pub(crate) problem: Option<String>,
    /// Homogeneous coordinates (s, t, w).
    point: [f64; 3],
    variables: [usize; 2],
    one: usize,
    pub(crate) multiplicity: usize,
    curve: [Vec<f64>; 4],
    half_width: f64,
    /// Ascending by angle in [0, π).
    pub(crate) directions: Vec<Direction>,
    /// Whether the seam is in the box between each direction and the next, the last and the first again.
    pub(crate) inside: Vec<bool>,
}

fn eval(form: &[f64], [a, b]: [f64; 2]) -> f64 {
    let d = form.len() - 1;
    form.iter().enumerate().map(|(j, c)| c * a.powi((d - j) as i32) * b.powi(j as i32)).sum()
}

/// The real zeros (a, b) of a binary form with these coefficients of aᵈ, aᵈ⁻¹b, …
fn zeros(coefficients: &[RBig]) -> Vec<[f64; 2]> {
    let terms = coefficients.iter().enumerate().map(|(j, c)| ([j as u16, 0, 0, 0], c.clone()));
    let mut found = Vec::new();
    if let Some(p) = Poly::from_terms(terms).to_upoly(0).filter(|p| !p.is_zero()) {
        found.extend(real_roots(&p.squarefree_part()).iter().map(|r| [1.0, r.to_f64()]));
    }
    if coefficients.last().is_some_and(RBig::is_zero) {
        found.push([0.0, 1.0]);
    }
    found
}

fn rationals(form: &BinaryForm) -> Vec<RBig> {
    let round = |x: f64| RBig::try_from(x).unwrap_or_default();
    form.coefficients.iter().map(|c| c.as_rational().unwrap_or_else(|| if c.is_zero() { RBig::ZERO } else { round(c.to_f64()) })).collect()
}

impl Fan {
    /// The directions that matter from the start: of the curves that bound the region or are drawn in it, and of the sides of the unit triangles.
    pub(crate) fn new(base: &BasePoint, region: &Region) -> Self {
        let named = || {
            let [s, t, w] = base.to_f64();
            format!("the base point ({s} : {t} : {w})")
        };
        let mut problem = None;
        if !base.seam.near.is_empty() {
            problem = Some(format!("{} is left open: base points are infinitely near to it", named()));
        }
        let ([u, v], one) = base.chart.variables();
        let mut directions: Vec<Direction> = Vec::new();
        let mut add = |at: [f64; 2], faces: u8, factors: &[usize]| {
            let new = Direction::new(at);
            let same = |d: &&mut Direction| {
                let cross = d.at[0] * new.at[1] - d.at[1] * new.at[0];
                cross.abs() < 1e-12
            };
            let d = match directions.iter_mut().find(same) {
                Some(d) => d,
                None => {
                    directions.push(new);
                    directions.last_mut().expect("just added")
                }
            };
            d.faces |= faces;
            d.factors.extend(factors.iter().filter(|f| !d.factors.contains(f)).copied().collect::<Vec<_>>());
        };
        // Exact ones first.
        for (k, at) in [(u, [0.0, 1.0]), (v, [1.0, 0.0])] {
            if base.point[k].is_zero() {
                add(at, 0, &[]);
            }
        }
        let [x, y, z, w] = base.seam.leading.each_ref().map(rationals);
        for face in 0..6 {
            let form = [&x, &y, &z][face / 2];
            let b = if face % 2 == 0 { region.half_width.clone() } else { -region.half_width.clone() };
            let sum: Vec<RBig> = form.iter().zip(&w).map(|(x, w)| x + &b * w).collect();
            if sum.iter().all(RBig::is_zero) {
                problem = Some(format!("{} is left open: its seam lies in a face of the box", named()));
                continue;
            }
            let factors: Vec<usize> = (0..region.factors.len()).filter(|&f| region.faces[f].contains(&face)).collect();
            for at in zeros(&sum) {
                add(at, 1 << face, &factors);
            }
        }
        let point = base.to_f64();
        for f in region.extra.iter().flatten().copied().filter(|&f| region.faces[f].is_empty()) {
            for at in tangents(&region.factors[f], point, [u, v], one) {
                add(at, 0, &[f]);
            }
        }
        // At least three, so that the two sides of the seam are two.
        for k in 0..4 {
            let angle = PI * (0.13 + 0.25 * f64::from(k));
            add([angle.cos(), angle.sin()], 0, &[]);
        }
        directions.sort_by(|a, b| a.angle().total_cmp(&b.angle()));
        let mut fan = Self {
            problem,
            point,
            variables: [u, v],
            one,
            multiplicity: base.multiplicity(),
            curve: base.seam.curve.each_ref().map(BinaryForm::to_f64),
            half_width: region.half_width.to_f64().value(),
            directions,
            inside: Vec::new(),
        };
        fan.inside = (0..fan.directions.len())
            .map(|k| {
                let [x, y, z, w] = fan.forms(fan.between(k).at);
                [x, y, z].iter().all(|x| x.abs() <= fan.half_width * w.abs())
            })
            .collect();
        fan
    }

    /// The lines s = 0, t = 0, w = 0 that lead through the base point in a direction.
    pub(crate) fn sides_along(&self, d: &Direction) -> impl Iterator<Item = usize> {
        let at = d.at;
        let [u, v] = self.variables;
        [(u, at[0]), (v, at[1])].into_iter().filter(|&(k, x)| self.point[k] == 0.0 && x == 0.0).map(|s| s.0).collect::<Vec<_>>().into_iter()
    }
    pub(crate) fn is_side(&self, d: &Direction) -> bool {
        self.sides_along(d).next().is_some()
    }

    fn forms(&self, at: [f64; 2]) -> [f64; 4] {
        self.curve.each_ref().map(|f| eval(f, at))
    }
    /// The point of the seam, put on the faces of the box that it is known to be on.
    pub(crate) fn seam(&self, d: &Direction) -> Point3 {
        let [x, y, z, w] = self.forms(d.at);
        let mut p = [x / w, y / w, z / w];
        for face in (0..6).filter(|f| d.faces >> f & 1 == 1) {
            p[face / 2] = if face % 2 == 0 { -self.half_width } else { self.half_width };
        }
        p
    }
    /// The direction after number k, up to sign.
    pub(crate) fn next(&self, k: usize) -> usize {
        (k + 1) % self.directions.len()
    }
    /// In the middle between number k and the next.
    pub(crate) fn between(&self, k: usize) -> Direction {
        let sign = if k + 1 == self.directions.len() { -1.0 } else { 1.0 };
        let (a, b) = (self.directions[k].at, self.directions[self.next(k)].at);
        Direction::new([a[0] + sign * b[0], a[1] + sign * b[1]])
    }
    /// Puts one more direction after number k; returns where it is.
    pub(crate) fn split(&mut self, k: usize) -> usize {
        let d = self.between(k);
        let inside = self.inside[k];
        // Beyond π it is the first.
        let at = if k + 1 == self.directions.len() && d.angle() < self.directions[0].angle() { 0 } else { k + 1 };
        self.directions.insert(at, d);
        self.inside.insert(at, inside);
        at
    }
    /// The sign that (s, t, w) needs to be in a quadrant, if it is in it.
    fn sign_in(&self, quadrant: usize) -> Option<f64> {
        let y = self.signed(quadrant, self.point);
        [1.0, -1.0].into_iter().find(|sign| y.iter().all(|y| sign * y >= 0.0))
    }
    fn signed(&self, quadrant: usize, x: [f64; 3]) -> [f64; 3] {
        let [s, t] = QUADRANTS[quadrant].map(|s| s as f64);
        [s * x[0], t * x[1], x[2]]
    }
    /// u and v in the unit triangle of a quadrant, if the point is in it.
    pub(crate) fn place(&self, quadrant: usize) -> Option<[f64; 2]> {
        let sign = self.sign_in(quadrant)?;
        let y = self.signed(quadrant, self.point).map(|y| sign * y);
        let sum: f64 = y.iter().sum();
        Some([y[0] / sum, y[1] / sum])
    }
    /// The direction ± d in the unit triangle of a quadrant, if it leads into it or along its sides.
    pub(crate) fn direction_in(&self, quadrant: usize, d: &Direction, backward: bool) -> Option<[f64; 2]> {
        let sign = self.sign_in(quadrant)?;
        let y = self.signed(quadrant, self.point).map(|y| sign * y);
        let mut x = [0.0; 3];
        let length = if backward { -1.0 } else { 1.0 };
        x[self.variables[0]] = length * d.at[0];
        x[self.variables[1]] = length * d.at[1];
        let dy = self.signed(quadrant, x).map(|y| sign * y);
        if (0..3).any(|k| y[k] == 0.0 && dy[k] < 0.0) {
            return None;
        }
        let (sum, rate): (f64, f64) = (y.iter().sum(), dy.iter().sum());
        let [u, v] = [0, 1].map(|k| (dy[k] - y[k] / sum * rate) / sum);
        // Along the third side.
        if y[2] == 0.0 && dy[2] == 0.0 { Some([u, -u]) } else { Some([u, v]) }
    }
    /// The direction, up to sign, from the base point to a point of a unit triangle, and whether it is backward.
    pub(crate) fn toward(&self, quadrant: usize, [u, v]: [f64; 2]) -> (Direction, bool) {
        let x = self.signed(quadrant, [u, v, 1.0 - u - v]);
        let local = self.variables.map(|k| x[k] / x[self.one] - self.point[k]);
        let d = Direction::new(local);
        let backward = d.at[0] * local[0] + d.at[1] * local[1] < 0.0;
        (d, backward)
    }
}

/// The real tangents of a curve in a point of it, from its terms of least degree there, which are known to rounding.
fn tangents(curve: &Poly, point: [f64; 3], [u, v]: [usize; 2], one: usize) -> Vec<[f64; 2]> {
    let round = |x: f64| RBig::try_from(x).unwrap_or_default();
    let p = curve.dehomogenise(one);
    let shift = |k: usize| Poly::var(k) + Poly::constant(round(point[k]));
    let local = p.substitute(u, &shift(u)).substitute(v, &shift(v));
    let size = local.to_f64().iter().map(|t| t.1.abs()).fold(0.0, f64::max);
    for degree in 0..=local.total_degree() {
        let part = local.homogeneous_part(degree);
        if part.to_f64().iter().any(|t| t.1.abs() > 1e-9 * size) {
            if degree == 0 {
                return Vec::new();
            }
            let coefficient = |j: usize| {
                let mut e = [0u16; 4];
                e[u] = (degree - j) as u16;
                e[v] = j as u16;
                let c = part.coefficient(e);
                if c.to_f64().value().abs() > 1e-9 * size { c } else { RBig::ZERO }
            };
            return zeros(&(0..=degree).map(coefficient).collect::<Vec<_>>());
        }
    }
    Vec::new()
}
