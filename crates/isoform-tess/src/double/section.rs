//! Sections: the points of a curve of parameters whose images lie in a plane of space.
//!
//! The first section is by a general complex plane. The degree of the forms is n: the curve meets n
//! general lines of the parameter plane in points that Aberth's method finds, and a homotopy leads
//! from the product of the lines to the plane pulled back, a form of the same degree. Other
//! sections are led from one that is known, by planes in between that are complex, too.

use super::source::{Source, Values};
use crate::complex::{
    C, Form, Monomials, Plane, Stream, V, along, conj, distance, dot, frame, in_frame, normalised,
};
use crate::homotopy::{follow, newton, runge_kutta};
use isoform_control::{Control, Stopped};

/// Predictions farther away than this, in the affine chart around a point, are none.
const FARTHEST: f64 = 0.3;
/// Newton's method ends with steps below this: the next one would be lost in rounding.
const DONE: f64 = 1e-9;
/// Where Aberth's method starts: the first number, and what leads from one to the next. The numbers
/// have no symmetry that a real polynomial could share, and different absolute values.
const ABERTH_START: [C; 2] = [C::new(0.8, 0.3), C::new(0.4, 0.9)];
/// Most rounds of Aberth's method. Multiple roots converge slowly, and are found to some digits
/// only.
const ABERTH_ROUNDS: usize = 300;
/// Changes of the roots, in shares of their size, that end Aberth's method: rounding is not much
/// less.
const ABERTH_DONE: f64 = 1e-14;
/// Two vectors on a line as combinations of a frame of it, without zeros: with zeros the only point
/// of a coordinate line may be infinite on this one.
const ON_LINE: [[C; 2]; 2] = [
    [C::new(0.6, 0.3), C::new(0.2, -0.7)],
    [C::new(-0.2, -0.7), C::new(0.6, -0.3)],
];
/// Points of a section are apart by more than this: the ends of paths have at least nine digits.
const APART: f64 = 1e-8;
/// The forms have a norm above this, but at base points: these are no points of a section.
const NO_BASE_POINT: f64 = 1e-8;
/// Tries to find the first section, each with other lines and other planes in between.
const TRIES: usize = 4;
/// Paths that stop after this time have come to their end: to a multiple point at a base point, to
/// which steps would get shorter and shorter.
const NEARLY_THERE: f64 = 0.99;
/// Paths that stop where the forms have a norm below this have come to a base point.
const NEAR_BASE_POINT: f64 = 1e-4;
/// The seeds of the lines of the first section, of its plane, and of the planes in between: any
/// others would do.
const LINES_SEED: u64 = 7;
/// See [`LINES_SEED`].
const PLANE_SEED: u64 = 11;
/// See [`LINES_SEED`].
const BETWEEN_SEED: u64 = 13;

/// The second equation q = 0 besides f = 0 at a time: q, its gradient, and its derivative by the
/// time.
type Path<'a> = dyn Fn(f64, &V, &Values) -> (C, V, C) + 'a;

/// The solution of two linear equations, by Cramer's rule.
#[inline]
fn solve2(rows: [[C; 2]; 2], right: [C; 2]) -> Option<[C; 2]> {
    let determinant = rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0];
    if determinant.norm2() == 0.0 {
        return None;
    }
    let inverse = determinant.inverse();
    let x = (right[0] * rows[1][1] - right[1] * rows[0][1]) * inverse;
    let y = (rows[0][0] * right[1] - rows[1][0] * right[0]) * inverse;
    (x.norm() + y.norm()).is_finite().then_some([x, y])
}

/// The derivatives of f and of the second equation along the vectors of a basis.
#[inline]
fn rows(basis: &[V; 2], v: &Values, dq: &V) -> [[C; 2]; 2] {
    [
        basis.each_ref().map(|b| dot(&v.df, b)),
        basis.each_ref().map(|b| dot(dq, b)),
    ]
}

/// A solution at the time 1 from one at the time 0.
///
/// # Errors
/// The time and the point up to which the path was followed, if not to its end: next to a singular
/// point, as a rule.
fn track(source: &Source, path: &Path<'_>, start: &V) -> Result<V, (f64, V)> {
    follow(start, |p, span| {
        let basis = frame(p);
        let d = runge_kutta(span, |time, d, h| {
            let at = along(p, &in_frame(&basis, *d), h);
            let v = source.eval(&at);
            let (_, dq, dt) = path(time, &at, &v);
            solve2(rows(&basis, &v, &dq), [C::ZERO, -dt])
        })?;
        if d[0].norm() + d[1].norm() >= FARTHEST {
            return None;
        }
        let predicted = normalised(&along(p, &in_frame(&basis, d), 1.0));
        newton(&predicted, DONE, |p| {
            let v = source.eval(p);
            let (q, dq, _) = path(span.to, p, &v);
            let basis = frame(p);
            let d = solve2(rows(&basis, &v, &dq), [-v.f, -q])?;
            let next = normalised(&along(p, &in_frame(&basis, d), 1.0));
            Some((next, d[0].norm() + d[1].norm()))
        })
    })
}

/// The points of a curve on the line through two points, by the method of Aberth.
fn on_line(curve: &Form, degree: usize, a: &V, b: &V) -> Vec<V> {
    let start = std::iter::successors(Some(ABERTH_START[0]), |&x| Some(x * ABERTH_START[1]));
    let mut roots: Vec<C> = start.take(degree).collect();
    let at = |x: C| [0, 1, 2].map(|i| a[i] + b[i] * x);
    for _ in 0..ABERTH_ROUNDS {
        let mut largest = 0.0f64;
        for k in 0..degree {
            let (f, df) = curve.eval(&Monomials::new(&at(roots[k]), degree));
            let d = aberth_step(&roots, k, f, dot(&df, b));
            if let Some(d) = d.filter(|d| d.norm().is_finite()) {
                roots[k] = roots[k] - d;
                largest = largest.max(d.norm() / (1.0 + roots[k].norm()));
            }
        }
        if largest < ABERTH_DONE {
            break;
        }
    }
    roots.into_iter().map(|x| normalised(&at(x))).collect()
}

/// The step that Aberth's method takes from a root, by the value and the derivative there: Newton's
/// step, repelled by the other roots.
fn aberth_step(roots: &[C], k: usize, value: C, slope: C) -> Option<C> {
    if value.norm2() == 0.0 || slope.norm2() == 0.0 {
        return None;
    }
    let newton = value * slope.inverse();
    let others = (0..roots.len())
        .filter(|&j| j != k)
        .map(|j| (roots[k] - roots[j]).inverse())
        .fold(C::ZERO, |s, c| s + c);
    Some(newton * (C::ONE - newton * others).inverse())
}

/// From the section by one plane to that by another, the first times a phase, so that the planes in
/// between are complex.
fn between<'a>(
    from: &'a Plane,
    to: &'a Plane,
    phase: C,
) -> impl Fn(f64, &V, &Values) -> (C, V, C) + 'a {
    move |time, _, v| {
        let plane: Plane =
            [0, 1, 2, 3].map(|i| (from[i] * phase).times(1.0 - time) + to[i].times(time));
        let speed: Plane = [0, 1, 2, 3].map(|i| to[i] - from[i] * phase);
        let (value, slope) = v.pulled_back(&plane);
        (value, slope, dot(&speed, &v.g))
    }
}

/// A product of lines of the parameter plane times a phase: where the first section is led from.
struct Lines {
    all: Vec<V>,
    phase: C,
}

impl Lines {
    fn new(count: usize, stream: &mut Stream) -> Self {
        let all = (0..count).map(|_| normalised(&stream.complex()));
        Self {
            all: all.collect(),
            phase: stream.phase(),
        }
    }
    /// The product and its gradient.
    fn eval(&self, p: &V) -> (C, V) {
        let factors: Vec<C> = self.all.iter().map(|l| dot(l, p)).collect();
        let mut product = self.phase;
        let mut gradient = [C::ZERO; 3];
        for (i, line) in self.all.iter().enumerate() {
            let others = factors
                .iter()
                .enumerate()
                .filter(|&(k, _)| k != i)
                .fold(self.phase, |product, (_, &c)| product * c);
            gradient = [0, 1, 2].map(|k| gradient[k] + line[k] * others);
            product = product * factors[i];
        }
        (product, gradient)
    }
    /// From the product to a plane pulled back.
    fn to<'a>(&'a self, plane: &'a Plane) -> impl Fn(f64, &V, &Values) -> (C, V, C) + 'a {
        move |time, p, v| {
            let (product, gradient) = self.eval(p);
            let (target, slope) = v.pulled_back(plane);
            let mixed = [0, 1, 2].map(|k| gradient[k].times(1.0 - time) + slope[k].times(time));
            (
                product.times(1.0 - time) + target.times(time),
                mixed,
                target - product,
            )
        }
    }
}

/// Each point once, without the base points.
fn distinct(source: &Source, points: impl IntoIterator<Item = V>) -> Vec<V> {
    let mut found: Vec<V> = Vec::new();
    for p in points {
        if source.size(&p) > NO_BASE_POINT && found.iter().all(|q| distance(&p, q) > APART) {
            found.push(p);
        }
    }
    found
}

/// The plane whose section is computed first.
pub(super) fn general_plane() -> Plane {
    Stream::new(PLANE_SEED).complex()
}

impl Source {
    /// The points of the curve on a line of the parameter plane.
    fn on_line(&self, line: &V) -> Vec<V> {
        let basis = frame(&conj(line));
        let [a, b] = ON_LINE.map(|c| in_frame(&basis, c));
        on_line(&self.curve, self.curve_degree, &a, &b)
    }
    /// Finds the section by a general plane; whether no path was lost.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn find_section(
        &mut self,
        plane: &Plane,
        control: &Control<'_>,
    ) -> Result<bool, Stopped> {
        let mut stream = Stream::new(LINES_SEED);
        for _ in 0..TRIES {
            let lines = Lines::new(self.degree, &mut stream);
            let path = lines.to(plane);
            let mut ends = Vec::new();
            let mut is_lost = false;
            for p in lines.all.iter().flat_map(|line| self.on_line(line)) {
                control.check()?;
                match track(self, &path, &p) {
                    Ok(p) => ends.push(p),
                    Err((time, p)) => {
                        is_lost |= time < NEARLY_THERE && self.size(&p) > NEAR_BASE_POINT;
                    }
                }
            }
            let found = distinct(self, ends);
            // All general planes have the same number of points.
            let is_again = !found.is_empty() && found.len() == self.section.len();
            if found.len() > self.section.len() {
                self.section = found;
            }
            if !is_lost || is_again {
                return Ok(true);
            }
        }
        Ok(false)
    }
    /// The points of the section by `plane`, tracked from the section `before`; if some are lost on
    /// the way, tracked from the general section.
    pub(super) fn section_by(&self, plane: &Plane, before: Option<(&Plane, &[V])>) -> Vec<V> {
        let mut stream = Stream::new(BETWEEN_SEED);
        let general = general_plane();
        let mut found = Vec::new();
        let known = (&general, &self.section[..]);
        for (from, points) in before.into_iter().chain([known; 2]) {
            let phase = stream.phase();
            let path = between(from, plane, phase);
            let ends = points.iter().filter_map(|p| track(self, &path, p).ok());
            let ends = distinct(self, ends.collect::<Vec<_>>());
            if ends.len() > found.len() {
                found = ends;
            }
            if self.is_complete(&found) {
                break;
            }
        }
        found
    }
    /// Whether a section has as many points as the general one.
    pub(super) fn is_complete(&self, section: &[V]) -> bool {
        section.len() == self.section.len()
    }
}
