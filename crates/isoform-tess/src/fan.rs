//! Base points opened: the directions in which a base point is approached, and the points of its seam curve that they lead to.
//!
//! A direction and its opposite lead to the same point (C. L. Bajaj, A. Royappa, 1994, Theorem 1), so directions are kept up to sign, and
//! those that bound the region or lie on a curve that is drawn are among them: the tangents there.

use crate::base::{BasePoint, BinaryForm, Seam};
use crate::cover::Involution;
use crate::field::Algebraic;
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
    /// Whether both are one but for rounding.
    fn is_same(&self, other: &Self) -> bool {
        (self.at[0] * other.at[1] - self.at[1] * other.at[0]).abs() < 1e-12
    }
    pub(crate) fn angle(&self) -> f64 {
        self.at[1].atan2(self.at[0])
    }
    /// What names the point of the seam.
    pub(crate) fn key(&self) -> [u64; 2] {
        self.at.map(f64::to_bits)
    }
}

/// A blow-up in the direction (1 : v), or in the direction (0 : 1).
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    /// (u, v) = (u′, u′(v₀ + v′)).
    Along(f64),
    /// (u, v) = (u′v′, v′).
    Across,
}

/// All seams of a base point with the blow-ups that lead to them.
fn nodes<'a>(seam: &'a Seam, chain: &[Step], found: &mut Vec<(Vec<Step>, &'a Seam)>) {
    found.push((chain.to_vec(), seam));
    for near in &seam.near {
        let step = if near.direction[0].is_zero() { Step::Across } else { Step::Along(near.direction[1].to_f64()) };
        nodes(&near.seam, &[chain, &[step]].concat(), found);
    }
}

/// A base point and its directions.
#[derive(Clone)]
pub(crate) struct Fan {
    /// Why it cannot be opened.
    pub(crate) problem: Option<String>,
    /// Homogeneous coordinates (s, t, w).
    point: [f64; 3],
    /// Blow-ups to the base point infinitely near to it whose seam is meant.
    chain: Vec<Step>,
    variables: [usize; 2],
    one: usize,
    pub(crate) multiplicity: usize,
    curve: [Vec<f64>; 4],
    /// The pairs of directions with one image, if the seam runs twice through its points. Partners of directions are directions.
    cover: Option<Involution>,
    half_width: f64,
    /// Ascending by angle in [0, π).
    pub(crate) directions: Vec<Direction>,
    /// Whether the seam is in the box between each direction and the next, the last and the first again.
    pub(crate) inside: Vec<bool>,
}

/// A direction that faces of the box and factors of the region belong to, unless it is there already.
fn add_to(directions: &mut Vec<Direction>, at: [f64; 2], faces: u8, factors: &[usize]) {
    let new = Direction::new(at);
    let d = match directions.iter_mut().find(|d| d.is_same(&new)) {
        Some(d) => d,
        None => {
            directions.push(new);
            directions.last_mut().expect("just added")
        }
    };
    d.faces |= faces;
    d.factors.extend(factors.iter().filter(|f| !d.factors.contains(f)).copied().collect::<Vec<_>>());
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
    ///
    /// Of the seams of infinitely near points one at most may reach into the box, and not where it meets the others.
    pub(crate) fn new(base: &BasePoint, region: &Region, w: &Poly) -> Self {
        if base.seam.near.is_empty() {
            return Self::of_seam(base, &base.seam, Vec::new(), region, w);
        }
        let mut all = Vec::new();
        nodes(&base.seam, &[], &mut all);
        let mut fans: Vec<Self> = all.into_iter().map(|(chain, seam)| Self::of_seam(base, seam, chain, region, w)).collect();
        let in_box = |f: &Self| f.problem.is_some() || f.inside.contains(&true);
        let [s, t, w] = base.to_f64();
        let problem = Some(format!("the base point ({s} : {t} : {w}) is left open: base points are infinitely near to it"));
        match fans.iter().filter(|f| in_box(f)).count() {
            0 => fans.swap_remove(0),
            1 => {
                let place = fans.iter().position(in_box).expect("one of them");
                let mut fan = fans.swap_remove(place);
                if fan.meets_others(&base.seam) {
                    fan.problem = fan.problem.or(problem);
                }
                fan
            }
            _ => Self { problem, ..fans.swap_remove(0) },
        }
    }

    /// Whether the seam is in the box where other seams begin: in the direction of the exceptional line, and of near points.
    fn meets_others(&self, first: &Seam) -> bool {
        let mut seam = first;
        for step in &self.chain {
            let mine = |n: &&crate::base::Near| match step {
                Step::Across => n.direction[0].is_zero(),
                Step::Along(v) => !n.direction[0].is_zero() && n.direction[1].to_f64() == *v,
            };
            let Some(near) = seam.near.iter().find(mine) else { return true };
            seam = &near.seam;
        }
        let mut meeting: Vec<[f64; 2]> = seam.near.iter().map(|n| n.direction.each_ref().map(Algebraic::to_f64)).collect();
        meeting.extend(self.chain.last().map(|step| if *step == Step::Across { [1.0, 0.0] } else { [0.0, 1.0] }));
        meeting.into_iter().any(|at| {
            let d = Direction::new(at);
            let [x, y, z, w] = self.forms(d.at);
            [x, y, z].iter().all(|x| x.abs() <= (1.0 + 1e-9) * self.half_width * w.abs())
        })
    }

    fn of_seam(base: &BasePoint, seam: &Seam, chain: Vec<Step>, region: &Region, w_form: &Poly) -> Self {
        let named = || {
            let [s, t, w] = base.to_f64();
            format!("the base point ({s} : {t} : {w})")
        };
        let mut problem = None;
        let ([u, v], one) = base.chart.variables();
        let mut directions: Vec<Direction> = Vec::new();
        let mut add = |at: [f64; 2], faces: u8, factors: &[usize]| add_to(&mut directions, at, faces, factors);
        // Exact ones first.
        let lifts = [chain.iter().all(|s| *s == Step::Across), chain.iter().all(|s| *s == Step::Along(0.0))];
        for (k, at, lifts) in [(u, [0.0, 1.0], lifts[0]), (v, [1.0, 0.0], lifts[1])] {
            if base.point[k].is_zero() && lifts {
                add(at, 0, &[]);
            }
        }
        let [x, y, z, w] = seam.leading.each_ref().map(rationals);
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
            for at in tangents(&region.factors[f], point, [u, v], one, &chain).1 {
                add(at, 0, &[f]);
            }
        }
        // At least three, so that the two sides of the seam are two.
        for k in 0..4 {
            let angle = PI * (0.13 + 0.25 * f64::from(k));
            add([angle.cos(), angle.sin()], 0, &[]);
        }
        let cover = Involution::of(&seam.curve, &|| false).ok().flatten();
        if let Some(cover) = &cover {
            // Before the partners of others, so that near ones are known to be these.
            cover.fixed().into_iter().for_each(|at| add(at, 0, &[]));
            for d in directions.clone() {
                add_to(&mut directions, cover.partner(d.at), d.faces, &[]);
            }
            // Those that were there already.
            for d in directions.clone() {
                add_to(&mut directions, cover.partner(d.at), d.faces, &[]);
            }
        }
        directions.sort_by(|a, b| a.angle().total_cmp(&b.angle()));
        let mut fan = Self {
            problem,
            point,
            variables: [u, v],
            one,
            multiplicity: if chain.is_empty() { base.multiplicity() } else { tangents(w_form, point, [u, v], one, &[]).0 },
            chain,
            curve: seam.curve.each_ref().map(BinaryForm::to_f64),
            cover,
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
        // What is outside of the box need not be opened.
        if !fan.inside.contains(&true) {
            fan.problem = None;
        }
        fan
    }

    /// The lines s = 0, t = 0, w = 0 that lead through the base point in a direction.
    pub(crate) fn sides_along(&self, d: &Direction) -> impl Iterator<Item = usize> {
        let at = d.at;
        let [u, v] = self.variables;
        let lifts = [self.chain.iter().all(|s| *s == Step::Across), self.chain.iter().all(|s| *s == Step::Along(0.0))];
        let sides = [(u, at[0], lifts[0]), (v, at[1], lifts[1])].into_iter();
        sides.filter(|&(k, x, lifts)| self.point[k] == 0.0 && x == 0.0 && lifts).map(|s| s.0).collect::<Vec<_>>().into_iter()
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
    /// Puts one more direction after number k, and its partner if it has one; returns the first number after which there is a new one.
    pub(crate) fn split(&mut self, k: usize) -> usize {
        let d = self.between(k);
        let partner = self.cover.map(|c| Direction::new(c.partner(d.at)));
        let mut first = self.insert(d);
        if let Some(partner) = partner {
            first = first.min(self.insert(partner));
        }
        first
    }
    /// Puts a direction in its place; returns the number of the one before it, or 0 if it is the first.
    fn insert(&mut self, d: Direction) -> usize {
        let at = self.directions.partition_point(|e| e.angle() < d.angle());
        let before = at.checked_sub(1).unwrap_or(self.directions.len() - 1);
        let inside = self.inside[before];
        self.directions.insert(at, d);
        self.inside.insert(at, inside);
        at.saturating_sub(1)
    }
    /// Whether the seam runs twice through its points.
    pub(crate) fn is_double(&self) -> bool {
        self.cover.is_some()
    }
    /// Whether the seam turns back in a direction.
    pub(crate) fn is_fold(&self, d: &Direction) -> bool {
        self.cover.is_some_and(|c| c.fixed().into_iter().map(Direction::new).any(|f| f.is_same(d)))
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
    /// Whether the directions are those of a base point that is infinitely near.
    pub(crate) fn is_near(&self) -> bool {
        !self.chain.is_empty()
    }
    /// The point of a ray at a distance in the coordinates of the last blow-up, if it is in the unit triangle.
    pub(crate) fn on_ray(&self, quadrant: usize, d: &Direction, backward: bool, distance: f64) -> Option<[f64; 2]> {
        let length = if backward { -distance } else { distance };
        let mut at = d.at.map(|x| length * x);
        for step in self.chain.iter().rev() {
            let [x, y] = at;
            at = match step {
                Step::Along(v) => [x, x * (v + y)],
                Step::Across => [x * y, y],
            };
        }
        let mut x = self.point;
        x[self.variables[0]] += at[0];
        x[self.variables[1]] += at[1];
        let y = self.signed(quadrant, x);
        let sign = [1.0, -1.0].into_iter().find(|sign| y.iter().all(|y| sign * y >= 0.0))?;
        let sum: f64 = y.iter().map(|y| sign * y).sum();
        Some([sign * y[0] / sum, sign * y[1] / sum])
    }
    /// The direction, among those with a factor, nearest to that of a point of the factor's curve close by: its key, and whether it is backward.
    pub(crate) fn ray_toward(&self, quadrant: usize, at: [f64; 2], factor: usize) -> Option<([u64; 2], bool)> {
        let (d, backward) = self.toward(quadrant, at);
        let off = |e: &&Direction| (e.at[0] * d.at[1] - e.at[1] * d.at[0]).abs();
        let mine = self.directions.iter().filter(|e| e.factors.contains(&factor));
        let e = mine.min_by(|x, y| off(x).total_cmp(&off(y))).filter(|e| off(e) < 0.2)?;
        // The same direction up to sign may be named by its opposite.
        let same = e.at[0] * d.at[0] + e.at[1] * d.at[1] > 0.0;
        Some((e.key(), backward == same))
    }
    /// The direction, up to sign, from the base point to a point of a unit triangle, and whether it is backward.
    pub(crate) fn toward(&self, quadrant: usize, [u, v]: [f64; 2]) -> (Direction, bool) {
        let x = self.signed(quadrant, [u, v, 1.0 - u - v]);
        let mut local = self.variables.map(|k| x[k] / x[self.one] - self.point[k]);
        for step in &self.chain {
            let [x, y] = local;
            local = match step {
                Step::Along(v) => [x, y / x - v],
                Step::Across => [x / y, y],
            };
        }
        let d = Direction::new(local);
        let backward = d.at[0] * local[0] + d.at[1] * local[1] < 0.0;
        (d, backward)
    }
}

/// The multiplicity of a point of a curve, after blow-ups, and the real tangents there: from its terms of least degree, which are known to rounding.
fn tangents(curve: &Poly, point: [f64; 3], [u, v]: [usize; 2], one: usize, chain: &[Step]) -> (usize, Vec<[f64; 2]>) {
    let round = |x: f64| RBig::try_from(x).unwrap_or_default();
    let p = curve.dehomogenise(one);
    let shift = |k: usize| Poly::var(k) + Poly::constant(round(point[k]));
    let mut local = p.substitute(u, &shift(u)).substitute(v, &shift(v));
    for step in chain {
        let (x, y) = (Poly::var(u), Poly::var(v));
        let (moved, line) = match step {
            Step::Along(v0) => (local.substitute(v, &(&x * (Poly::constant(round(*v0)) + y))), x),
            Step::Across => (local.substitute(u, &(x * &y)), y),
        };
        local = moved;
        while let Some(quotient) = local.div_exact(&line) {
            local = quotient;
        }
    }
    let size = local.to_f64().iter().map(|t| t.1.abs()).fold(0.0, f64::max);
    for degree in 0..=local.total_degree() {
        let part = local.homogeneous_part(degree);
        if part.to_f64().iter().any(|t| t.1.abs() > 1e-9 * size) {
            if degree == 0 {
                return (0, Vec::new());
            }
            let coefficient = |j: usize| {
                let mut e = [0u16; 4];
                e[u] = (degree - j) as u16;
                e[v] = j as u16;
                let c = part.coefficient(e);
                if c.to_f64().value().abs() > 1e-9 * size { c } else { RBig::ZERO }
            };
            return (degree, zeros(&(0..=degree).map(coefficient).collect::<Vec<_>>()));
        }
    }
    (0, Vec::new())
}
