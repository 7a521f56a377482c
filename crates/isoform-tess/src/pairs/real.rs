//! Pairs with real images: of real parameters, or of conjugate ones.

use super::{MIN_NEWTON_STEP, Pair, Pairs, Parts, Rows, solve, turn};
use crate::complex::{
    self, C, MAX_REAL_SINE, V, conj, distance, largest, length, normalised, real_line, real_point,
};
use crate::homotopy::MAX_CHART_STEP;
use isoform_geom::norm;

/// A pair of real parameters (λ ≥ 0), or of conjugate ones, with a real image.
///
/// The signs of real parameters are chosen such that m is at least as long as h e. Then φ(p) =
/// φ(q), or φ(p) = −φ(q) if they are opposed: in that case (m, e, λ) is a solution of E = 0 in
/// place of O = 0, and O is the image.
#[derive(Clone, Copy, Debug)]
pub(super) struct RealPair {
    pub(super) m: [f64; 3],
    pub(super) e: [f64; 3],
    pub(super) l: f64,
    pub(super) is_opposed: bool,
}

/// A place on an arc.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ArcPlace {
    pub(super) pair: RealPair,
    /// Unit tangent of the arc.
    pub(super) tangent: [f64; 7],
    /// Image (X : Y : Z : W) in half widths of the box, of norm 1.
    pub(super) image: [f64; 4],
}

impl RealPair {
    pub(super) fn complex(&self) -> Pair {
        let real = |v: [f64; 3]| v.map(|x| C::new(x, 0.0));
        Pair {
            m: real(self.m),
            e: real(self.e),
            l: C::new(self.l, 0.0),
        }
    }
    /// Creates the pair of two real vectors.
    fn from_vectors(p: [f64; 3], q: [f64; 3], is_opposed: bool) -> Self {
        let m = [0, 1, 2].map(|i| 0.5 * (p[i] + q[i]));
        let e = [0, 1, 2].map(|i| 0.5 * (p[i] - q[i]));
        Self {
            m,
            e,
            l: 1.0,
            is_opposed,
        }
        .scaled()
    }
    fn scaled(&self) -> Self {
        let (m, e) = (norm(self.m), norm(self.e));
        Self {
            m: self.m.map(|x| x / m),
            e: self.e.map(|x| x / e),
            l: self.l * (e / m).powi(2),
            is_opposed: self.is_opposed,
        }
    }
    pub(super) fn moved(&self, d: &[f64; 7], h: f64) -> Self {
        Self {
            m: [0, 1, 2].map(|i| self.m[i] + h * d[i]),
            e: [0, 1, 2].map(|i| self.e[i] + h * d[3 + i]),
            l: self.l + h * d[6],
            is_opposed: self.is_opposed,
        }
    }
    /// Returns the difference to another pair.
    pub(super) fn to(&self, other: &Self) -> [f64; 7] {
        let mut d = [0.0; 7];
        for i in 0..3 {
            d[i] = other.m[i] - self.m[i];
            d[3 + i] = other.e[i] - self.e[i];
        }
        d[6] = other.l - self.l;
        d
    }
    /// Returns the distance to another pair in its given form; infinite if their signs disagree.
    pub(super) fn distance(&self, other: &Self) -> f64 {
        if self.is_opposed != other.is_opposed {
            return f64::INFINITY;
        }
        let d = self.to(other);
        dot7(&d, &d).sqrt()
    }
    /// Returns the nearest of some forms.
    pub(super) fn nearest(&self, forms: &[Self]) -> Self {
        let by_distance = |a: &&Self, b: &&Self| self.distance(a).total_cmp(&self.distance(b));
        *forms.iter().min_by(by_distance).expect("forms of a pair")
    }
    /// Returns true if the forms of a map of a degree nearly vanish at one of the parameters,
    /// relative to their values at the other one.
    pub(super) fn is_at_base_point(&self, degree: usize) -> bool {
        self.real().is_some_and(|[p, q]| {
            let [p, q] = [norm(p), norm(q)];
            // This quotient is the distance from the base point, and its inverse the loss of
            // digits.
            (p.min(q) / p.max(q)).powi(degree as i32) < 1e-9
        })
    }
    /// Returns the real parameters; `None` if they are conjugate.
    pub(super) fn real(&self) -> Option<[[f64; 3]; 2]> {
        (self.l >= 0.0).then(|| {
            let h = self.l.sqrt();
            [h, -h].map(|h| [0, 1, 2].map(|i| self.m[i] + h * self.e[i]))
        })
    }
}

pub(super) fn dot7(a: &[f64; 7], b: &[f64; 7]) -> f64 {
    (0..7).map(|i| a[i] * b[i]).sum()
}

/// Fourth condition, besides the three equations of a pair.
pub(super) enum Condition {
    /// The step is perpendicular to a direction.
    Across([f64; 7]),
    /// The image lies in a plane.
    Plane([f64; 4]),
    /// λ = 0.
    Pinch,
    /// A coordinate of the first parameter (with h) or of the second one (with −h) vanishes.
    Side(usize, usize),
}

/// Solves equations with real coefficients, after removing imaginary parts, which are rounding
/// errors.
fn solve_real(mut rows: Rows) -> Option<[f64; 7]> {
    for c in rows.iter_mut().flatten() {
        c.im = 0.0;
    }
    Some(solve(rows)?.map(|c| c.re))
}

impl Pairs {
    /// Returns the real form of the equations at a pair, with the row of a plane or an empty one as
    /// the fourth, and the image.
    fn real_rows(&self, x: &RealPair, plane: Option<&[f64; 4]>) -> (Rows, [f64; 4]) {
        let pair = x.complex();
        let Parts { even, odd } = self.parts(&pair);
        let (zero, image) = match x.is_opposed {
            true => (even, odd),
            false => (odd, even),
        };
        let mut rows = self.rows(&pair, &zero);
        if let Some(plane) = plane {
            rows[4] = Self::plane_row(&image, &plane.map(|x| C::new(x, 0.0)));
        }
        (rows, unit(image.value.map(|c| c.re)))
    }

    /// Returns the place near to a pair that meets a condition, and the length of the first step of
    /// Newton's method.
    pub(super) fn correct(
        &self,
        start: &RealPair,
        condition: &Condition,
    ) -> Option<(ArcPlace, f64)> {
        let (mut x, mut first, mut last) = (*start, 0.0, f64::INFINITY);
        // At most eight Newton steps; each has to halve the one before.
        for i in 0..8 {
            let d = solve_real(self.rows_with(&x, condition))?;
            let size = dot7(&d, &d).sqrt();
            if i == 0 {
                first = size;
            }
            if size > 0.5 * last || size > MAX_CHART_STEP {
                return None;
            }
            x = x.moved(&d, 1.0).scaled();
            if size < MIN_NEWTON_STEP {
                if matches!(condition, Condition::Pinch) {
                    x.l = 0.0;
                }
                let tangent = self.tangent(&x)?;
                let (_, image) = self.real_rows(&x, None);
                let place = ArcPlace {
                    pair: x,
                    tangent,
                    image,
                };
                return Some((place, first));
            }
            last = size;
        }
        None
    }
    /// Returns the equations for a step of Newton's method towards a condition.
    fn rows_with(&self, x: &RealPair, condition: &Condition) -> Rows {
        if let Condition::Plane(plane) = condition {
            return self.real_rows(x, Some(plane)).0;
        }
        let (mut rows, _) = self.real_rows(x, None);
        let real = |x: f64| C::new(x, 0.0);
        match condition {
            Condition::Across(d) => {
                for k in 0..7 {
                    rows[4][k] = real(d[k]);
                }
            }
            Condition::Pinch => {
                rows[4][6] = C::ONE;
                rows[4][7] = real(-x.l);
            }
            &Condition::Side(which, k) => {
                let h = if which == 0 { x.l.sqrt() } else { -x.l.sqrt() };
                rows[4][k] = C::ONE;
                rows[4][3 + k] = real(h);
                rows[4][6] = real(0.5 * x.e[k] / h);
                rows[4][7] = real(-(x.m[k] + h * x.e[k]));
            }
            Condition::Plane(_) => {}
        }
        rows
    }

    /// Returns the unit tangent of the solutions, of either sign.
    fn tangent(&self, x: &RealPair) -> Option<[f64; 7]> {
        let (rows, _) = self.real_rows(x, None);
        let mut best: Option<[f64; 7]> = None;
        for axis in 0..7 {
            let mut rows = rows;
            for row in &mut rows {
                row[7] = C::ZERO;
            }
            rows[4] = [C::ZERO; 8];
            rows[4][axis] = C::ONE;
            rows[4][7] = C::ONE;
            let Some(d) = solve_real(rows) else { continue };
            let size = dot7(&d, &d).sqrt();
            if best.is_none_or(|b| size < dot7(&b, &b).sqrt()) {
                best = Some(d);
            }
        }
        let best = best?;
        let size = dot7(&best, &best).sqrt();
        Some(best.map(|x| x / size))
    }

    /// Returns a place with the proper signs of its pair, or the proper phases.
    pub(super) fn righted(&self, place: &ArcPlace) -> Option<ArcPlace> {
        let is_right = match place.pair.real() {
            Some([p, q]) => isoform_geom::dot(p, q) >= 0.0,
            None => {
                let l = place.pair.l;
                let best = || self.conjugates(&place.pair.complex().parameters()[0]).l;
                // λ vanishes at a pinch point. Near 0 the pair keeps its phase; elsewhere it takes
                // the phase of least |λ|, if that is less than half of its own. With a factor of 1
                // it would change to and fro.
                l > -0.1 || l > 2.0 * best()
            }
        };
        if is_right {
            Some(*place)
        } else {
            self.flipped(place)
        }
    }
    /// Returns a place with the opposite sign of the second parameter. For conjugate parameters,
    /// returns it with the phase for which the first one is nearest to real.
    pub(super) fn flipped(&self, place: &ArcPlace) -> Option<ArcPlace> {
        let x = match place.pair.real() {
            Some([p, q]) => {
                let is_opposed = place.pair.is_opposed != (self.degree % 2 == 1);
                RealPair::from_vectors(p, q.map(|c| -c), is_opposed)
            }
            None => self.conjugates(&place.pair.complex().parameters()[0]),
        };
        if !x.l.is_finite() {
            return Some(*place);
        }
        let tangent = self.tangent(&x)?;
        let (_, image) = self.real_rows(&x, None);
        let flipped = ArcPlace {
            pair: x,
            tangent,
            image,
        };
        // The direction in space is unchanged.
        let a = self.way(place, &image);
        let b = self.way(&flipped, &image);
        let is_turned = (0..4).map(|i| a[i] * b[i]).sum::<f64>() < 0.0;
        Some(if is_turned { flipped.turned() } else { flipped })
    }
    /// Returns the vector from an image to the image ahead of a place.
    fn way(&self, place: &ArcPlace, from: &[f64; 4]) -> [f64; 4] {
        // A difference quotient has half of the digits.
        let (_, to) = self.real_rows(&place.pair.moved(&place.tangent, 1e-5), None);
        let is_opposite = (0..4).map(|i| to[i] * from[i]).sum::<f64>() < 0.0;
        let sign = if is_opposite { -1.0 } else { 1.0 };
        [0, 1, 2, 3].map(|i| sign * to[i] - from[i])
    }
    /// Returns the forms in which arcs may contain a pair: with both signs of m, of e, and of the
    /// second parameter, or all phases of conjugate ones.
    pub(super) fn forms(&self, place: &ArcPlace) -> Vec<RealPair> {
        let ways = match place.pair.real() {
            Some(_) => {
                let flipped = self.flipped(place).map(|p| p.pair);
                [Some(place.pair), flipped].into_iter().flatten().collect()
            }
            None => self.phases(&place.pair.complex().parameters()[0]),
        };
        let signs = [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)];
        let signed = |x: RealPair| {
            signs.map(|(sign_of_m, sign_of_e)| RealPair {
                m: x.m.map(|c| sign_of_m * c),
                e: x.e.map(|c| sign_of_e * c),
                ..x
            })
        };
        ways.into_iter().flat_map(signed).collect()
    }

    /// Returns a parameter with a real image and its conjugate, with the phase for which they are
    /// nearest to real.
    fn conjugates(&self, p: &V) -> RealPair {
        let phases = self.phases(p).into_iter();
        let best = phases.max_by(|a, b| a.l.total_cmp(&b.l));
        best.expect("phases")
    }
    /// Returns a parameter and its conjugate in all phases for which their images agree.
    fn phases(&self, p: &V) -> Vec<RealPair> {
        let (f, _) = self.at(p);
        let largest = largest(&f);
        let n = self.degree as f64;
        let angle = -largest.im.atan2(largest.re) / n;
        let turned = |k: usize| {
            let phase = turn(angle + std::f64::consts::PI * k as f64 / n);
            let p = p.map(|c| c * phase);
            RealPair {
                m: p.map(|c| c.re),
                e: p.map(|c| c.im),
                l: -1.0,
                is_opposed: false,
            }
            .scaled()
        };
        (0..self.degree).map(turned).collect()
    }

    /// Returns the place of a pair in a section, if its parameters are real or conjugate.
    pub(super) fn place(&self, pair: &Pair) -> Option<ArcPlace> {
        self.place_near(pair, MAX_REAL_SINE)
    }
    /// Returns the place near to a pair whose parameters are real or conjugate up to the sine `far`
    /// of angles.
    pub(super) fn place_near(&self, pair: &Pair, far: f64) -> Option<ArcPlace> {
        let [p, q] = pair.parameters().map(|p| normalised(&p));
        let is_real = |p: &V| length(&real_line(p)) < far;
        let x = if is_real(&p) && is_real(&q) {
            self.of_real([p, q].map(|p| real_point(&p)))
        } else if distance(&p, &conj(&q)) < far {
            self.conjugates(&p)
        } else {
            return None;
        };
        let tangent = self.tangent(&x)?;
        self.correct(&x, &Condition::Across(tangent)).map(|p| p.0)
    }
    /// Returns two real parameters with one image as a pair, scaled for equal images.
    fn of_real(&self, [p, q]: [[f64; 3]; 2]) -> RealPair {
        let [f, g] = [p, q].map(|p| self.at(&p.map(|x| C::new(x, 0.0))).0);
        let size = complex::norm::<4>;
        let product: f64 = (0..4).map(|i| f[i].re * g[i].re).sum();
        let scale = (size(&f) / size(&g)).powf(1.0 / self.degree as f64);
        let is_opposed = product < 0.0;
        if isoform_geom::dot(p, q) < 0.0 {
            let is_odd = self.degree % 2 == 1;
            RealPair::from_vectors(p, q.map(|x| -x * scale), is_opposed != is_odd)
        } else {
            RealPair::from_vectors(p, q.map(|x| x * scale), is_opposed)
        }
    }
}

/// Returns a vector divided by its length.
fn unit(v: [f64; 4]) -> [f64; 4] {
    let size = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    v.map(|x| x / size)
}

impl ArcPlace {
    pub(super) fn is_inside(&self) -> bool {
        (0..3).all(|i| self.image[i].abs() <= self.image[3].abs())
    }
    /// Returns the point of space, in half widths of the box.
    pub(crate) fn point(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.image[i] / self.image[3])
    }
    /// Returns true if a pair nearby is within a distance of the tangent.
    pub(super) fn is_in_line(&self, pair: &RealPair, far: f64) -> bool {
        let d = self.pair.to(pair);
        let along = dot7(&d, &self.tangent);
        let across: [f64; 7] = std::array::from_fn(|i| d[i] - along * self.tangent[i]);
        dot7(&across, &across).sqrt() < far && along.abs() < far.sqrt()
    }
    pub(super) fn turned(&self) -> Self {
        Self {
            tangent: self.tangent.map(|x| -x),
            ..*self
        }
    }
    /// Returns true if the two parameters coincide.
    pub(crate) fn is_pinch(&self) -> bool {
        self.pair.l == 0.0
    }
    /// Returns (X : Y : Z : W) in half widths of the box.
    pub(crate) fn image(&self) -> [f64; 4] {
        self.image
    }
    /// Returns the distance between two pairs, in the better one of the two orders.
    pub(crate) fn distance(&self, other: &Self) -> f64 {
        self.pair.complex().distance(&other.pair.complex())
    }
    /// Returns the real parameters (s : t : w); `None` if they are conjugate.
    pub(crate) fn real(&self) -> Option<[[f64; 3]; 2]> {
        self.pair.real()
    }
}
