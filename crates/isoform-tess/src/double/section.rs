//! Sections: the points of a curve of parameters whose images lie in a plane of space.
//!
//! The first section is by a general complex plane. With forms of degree n, the curve is first
//! intersected with n general lines of the parameter plane, by Aberth's method; a homotopy leads
//! from the product of the lines to the pull-back of the plane, a form of equal degree n. Other
//! sections are tracked from a known one, through intermediate planes that are complex, too.

use super::source::{Source, Values};
use crate::complex::{
    C, Form, Monomials, Plane, Stream, V, along, conj, distance, dot, frame, in_frame, normalised,
};
use crate::homotopy::{MAX_CHART_STEP, MIN_FORM_NORM, follow, newton, runge_kutta};
use isoform_control::{Control, Stopped};

/// First starting value of Aberth's method, and the factor from one to the next. The values have no
/// symmetry that a real polynomial could share, and different absolute values.
const ABERTH_START: [C; 2] = [C::new(0.8, 0.3), C::new(0.4, 0.9)];
/// Coefficients of two vectors on a line in a frame of it, all non-zero: with zeros, the single
/// point of the curve on a coordinate line could be at infinity in the parametrization of that
/// line.
const ON_LINE: [[C; 2]; 2] = [
    [C::new(0.6, 0.3), C::new(0.2, -0.7)],
    [C::new(-0.2, -0.7), C::new(0.6, -0.3)],
];

/// Second equation q = 0 besides f = 0 at a time: returns q, its gradient, and its time derivative.
type Path<'a> = dyn Fn(f64, &V, &Values) -> (C, V, C) + 'a;

/// Solves two linear equations by Cramer's rule.
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

/// Returns the derivatives of f and of the second equation along the vectors of a basis.
#[inline]
fn rows(basis: &[V; 2], v: &Values, dq: &V) -> [[C; 2]; 2] {
    [
        basis.each_ref().map(|b| dot(&v.df, b)),
        basis.each_ref().map(|b| dot(dq, b)),
    ]
}

/// Tracks a solution from the time 0 to the time 1.
///
/// # Errors
/// The time and the point at which tracking stopped, if not at the end: usually next to a singular
/// point.
fn track(source: &Source, path: &Path<'_>, start: &V) -> Result<V, (f64, V)> {
    follow(start, |p, span| {
        let basis = frame(p);
        let d = runge_kutta(span, |time, d, h| {
            let at = along(p, &in_frame(&basis, *d), h);
            let v = source.eval(&at);
            let (_, dq, dt) = path(time, &at, &v);
            solve2(rows(&basis, &v, &dq), [C::ZERO, -dt])
        })?;
        if d[0].norm() + d[1].norm() >= MAX_CHART_STEP {
            return None;
        }
        let predicted = normalised(&along(p, &in_frame(&basis, d), 1.0));
        // A step after one below 1e-9 would be lost in rounding.
        newton(&predicted, 1e-9, |p| {
            let v = source.eval(p);
            let (q, dq, _) = path(span.to, p, &v);
            let basis = frame(p);
            let d = solve2(rows(&basis, &v, &dq), [-v.f, -q])?;
            let next = normalised(&along(p, &in_frame(&basis, d), 1.0));
            Some((next, d[0].norm() + d[1].norm()))
        })
    })
}

/// Returns the points of a curve on the line through two points, by Aberth's method.
fn on_line(curve: &Form, degree: usize, a: &V, b: &V) -> Vec<V> {
    let start = std::iter::successors(Some(ABERTH_START[0]), |&x| Some(x * ABERTH_START[1]));
    let mut roots: Vec<C> = start.take(degree).collect();
    let at = |x: C| [0, 1, 2].map(|i| a[i] + b[i] * x);
    // Multiple roots converge slowly, and to some digits only.
    for _ in 0..300 {
        let mut largest = 0.0f64;
        for k in 0..degree {
            let (f, df) = curve.eval(&Monomials::new(&at(roots[k]), degree));
            let d = aberth_step(&roots, k, f, dot(&df, b));
            if let Some(d) = d.filter(|d| d.norm().is_finite()) {
                roots[k] = roots[k] - d;
                largest = largest.max(d.norm() / (1.0 + roots[k].norm()));
            }
        }
        // Relative changes of the roots; rounding is not much less.
        if largest < 1e-14 {
            break;
        }
    }
    roots.into_iter().map(|x| normalised(&at(x))).collect()
}

/// Returns the step of Aberth's method at a root, from the value and the derivative there: Newton's
/// step, corrected for repulsion by the other roots.
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

/// Returns the path from the section by one plane to that by another. A phase multiplies the first
/// plane, so that the intermediate planes are complex.
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

/// Product of lines of the parameter plane times a phase: the start of the homotopy to the first
/// section.
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
    /// Returns the product and its gradient.
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
    /// Returns the path from the product to the pull-back of a plane.
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

/// Removes duplicates and base points.
fn distinct(source: &Source, points: impl IntoIterator<Item = V>) -> Vec<V> {
    let mut found: Vec<V> = Vec::new();
    for p in points {
        // The ends of paths have at least nine digits.
        if source.size(&p) > MIN_FORM_NORM && found.iter().all(|q| distance(&p, q) > 1e-8) {
            found.push(p);
        }
    }
    found
}

/// Returns the plane of the first section.
pub(super) fn general_plane() -> Plane {
    // Any other seed would do.
    Stream::new(11).complex()
}

impl Source {
    /// Returns the points of the curve on a line of the parameter plane.
    fn on_line(&self, line: &V) -> Vec<V> {
        let basis = frame(&conj(line));
        let [a, b] = ON_LINE.map(|c| in_frame(&basis, c));
        on_line(&self.curve, self.curve_degree, &a, &b)
    }
    /// Computes the section by a general plane. Returns true if no path was lost.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn find_section(
        &mut self,
        plane: &Plane,
        control: &Control<'_>,
    ) -> Result<bool, Stopped> {
        // Any other seed would do.
        let mut stream = Stream::new(7);
        // Each of the four attempts has other lines and other planes in between.
        for _ in 0..4 {
            let lines = Lines::new(self.degree, &mut stream);
            let path = lines.to(plane);
            let mut ends = Vec::new();
            let mut is_lost = false;
            for p in lines.all.iter().flat_map(|line| self.on_line(line)) {
                control.check()?;
                match track(self, &path, &p) {
                    Ok(p) => ends.push(p),
                    Err((time, p)) => {
                        // A path that stops just before its end, or close to a base point, has come
                        // to a multiple point at a base point, towards which steps become shorter
                        // and shorter.
                        is_lost |= time < 0.99 && self.size(&p) > 1e-4;
                    }
                }
            }
            let found = distinct(self, ends);
            // All general planes have equally many points.
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
    /// Returns the section by `plane`, tracked from the section `before`; if points are lost on the
    /// way, tracked from the general section.
    pub(super) fn section_by(&self, plane: &Plane, before: Option<(&Plane, &[V])>) -> Vec<V> {
        // Any other seed would do.
        let mut stream = Stream::new(13);
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
    /// Returns true if a section has as many points as the general one.
    pub(super) fn is_complete(&self, section: &[V]) -> bool {
        section.len() == self.section.len()
    }
}
