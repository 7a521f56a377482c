//! Complex numbers, points of the complex projective plane, and forms evaluated there, in doubles.

use isoform_algebra::{Poly, RBig};
use isoform_num::Random;
use std::ops::{Add, Mul, Neg, Sub};

/// A complex number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct C {
    pub(crate) re: f64,
    pub(crate) im: f64,
}

impl C {
    pub(crate) const ZERO: Self = Self { re: 0.0, im: 0.0 };
    pub(crate) const ONE: Self = Self { re: 1.0, im: 0.0 };

    pub(crate) const fn new(re: f64, im: f64) -> Self {
        Self { re, im }
    }
    pub(crate) fn conj(self) -> Self {
        Self::new(self.re, -self.im)
    }
    pub(crate) fn norm2(self) -> f64 {
        self.re * self.re + self.im * self.im
    }
    pub(crate) fn norm(self) -> f64 {
        self.norm2().sqrt()
    }
    pub(crate) fn times(self, r: f64) -> Self {
        Self::new(self.re * r, self.im * r)
    }
    pub(crate) fn inverse(self) -> Self {
        self.conj().times(1.0 / self.norm2())
    }
}

impl Add for C {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self::new(self.re + o.re, self.im + o.im)
    }
}

impl Sub for C {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self::new(self.re - o.re, self.im - o.im)
    }
}

impl Neg for C {
    type Output = Self;
    fn neg(self) -> Self {
        Self::new(-self.re, -self.im)
    }
}

impl Mul for C {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        Self::new(
            self.re * o.re - self.im * o.im,
            self.re * o.im + self.im * o.re,
        )
    }
}

/// A point of the complex projective plane, normalised to norm 1, or a tangent vector there.
pub(crate) type V = [C; 3];

/// Returns the bilinear product.
pub(crate) fn dot<const N: usize>(a: &[C; N], b: &[C; N]) -> C {
    (0..N).fold(C::ZERO, |sum, i| sum + a[i] * b[i])
}

/// Returns the Hermitian product, conjugate linear in the first vector.
pub(crate) fn inner(a: &V, b: &V) -> C {
    dot(&conj(a), b)
}

/// Conjugates each coordinate.
pub(crate) fn conj(a: &V) -> V {
    a.map(C::conj)
}

/// Returns p + h d.
pub(crate) fn along(p: &V, d: &V, h: f64) -> V {
    [0, 1, 2].map(|i| p[i] + d[i].times(h))
}

/// Returns the Hermitian norm.
pub(crate) fn norm<const N: usize>(a: &[C; N]) -> f64 {
    a.iter().map(|c| c.norm2()).sum::<f64>().sqrt()
}

/// Returns the coordinate of largest absolute value.
pub(crate) fn largest<const N: usize>(a: &[C; N]) -> C {
    let all = a.iter().copied();
    let found = all.max_by(|a, b| a.norm2().total_cmp(&b.norm2()));
    found.expect("coordinates")
}

/// Divides a vector by its norm.
pub(crate) fn normalised(a: &V) -> V {
    let length = norm(a);
    a.map(|c| c.times(1.0 / length))
}

/// Returns the sine of the angle between two points.
pub(crate) fn distance(a: &V, b: &V) -> f64 {
    // |b − ⟨a, b⟩a| rather than √(1 − |⟨a, b⟩|²), which loses half of the digits.
    let c = inner(a, b);
    (0..3)
        .map(|i| (b[i] - c * a[i]).norm2())
        .sum::<f64>()
        .sqrt()
}

/// Returns the real line through a point and its conjugate, as a vector of length at most 1/2. It
/// does not depend on the phase of the point, is zero for real points, and changes its sign for the
/// conjugate.
pub(crate) fn real_line(p: &V) -> [f64; 3] {
    [[1, 2], [2, 0], [0, 1]].map(|[i, j]| p[i].re * p[j].im - p[j].re * p[i].im)
}

/// Maximum length of [`real_line`] at which a parameter counts as real, and maximum sine of the
/// angle at which two parameters count as conjugate: half of the digits are lost where a parameter
/// meets its conjugate. If it is larger, complex pairs are taken for real ones; if it is smaller,
/// an arc is missed by a section, and found by another one.
pub(crate) const MAX_REAL_SINE: f64 = 1e-6;

/// Returns the real coordinates of a real point.
pub(crate) fn real_point(v: &V) -> [f64; 3] {
    let phase = largest(v).inverse();
    v.map(|c| (c * phase).re)
}

/// Returns the length of a real vector.
pub(crate) fn length(v: &[f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Returns two vectors that complete a unit vector to a unitary basis.
pub(crate) fn frame(p: &V) -> [V; 2] {
    let least = (0..3)
        .min_by(|&i, &j| p[i].norm2().total_cmp(&p[j].norm2()))
        .expect("three");
    let mut first: V = [0, 1, 2].map(|i| -(p[least].conj() * p[i]));
    first[least] = first[least] + C::ONE;
    let first = normalised(&first);
    let second = [[1, 2], [2, 0], [0, 1]].map(|[i, j]| (p[i] * first[j] - p[j] * first[i]).conj());
    [first, second]
}

/// Returns the vector with given coordinates in a frame.
pub(crate) fn in_frame(frame: &[V; 2], d: [C; 2]) -> V {
    [0, 1, 2].map(|i| frame[0][i] * d[0] + frame[1][i] * d[1])
}

/// A form in three variables, stored by powers of the first one.
pub(crate) struct Form(Vec<Row>);

/// A power of the first variable, with its terms in the other two.
pub(crate) type Row = (usize, Vec<([usize; 2], f64)>);

/// Monomials at a point: powers of the first variable, and products of powers of the others.
pub(crate) struct Monomials {
    width: usize,
    first: Vec<C>,
    others: Vec<C>,
}

impl Monomials {
    pub(crate) fn new(p: &V, degree: usize) -> Self {
        let powers = |x: C| {
            let mut powers = vec![C::ONE; degree + 1];
            for i in 0..degree {
                powers[i + 1] = powers[i] * x;
            }
            powers
        };
        let [first, second, third] = p.map(powers);
        let width = degree + 1;
        let mut others = vec![C::ZERO; width * width];
        for j in 0..width {
            for k in 0..width - j {
                others[j * width + k] = second[j] * third[k];
            }
        }
        Self {
            width,
            first,
            others,
        }
    }
}

impl Form {
    pub(crate) fn new(terms: impl IntoIterator<Item = ([usize; 3], f64)>) -> Self {
        let mut rows: Vec<Row> = Vec::new();
        for ([i, j, k], c) in terms {
            match rows.iter_mut().find(|row| row.0 == i) {
                Some(row) => row.1.push(([j, k], c)),
                None => rows.push((i, vec![([j, k], c)])),
            }
        }
        Self(rows)
    }
    /// Returns the value and the gradient.
    pub(crate) fn eval(&self, m: &Monomials) -> (C, V) {
        let (mut value, mut gradient) = (C::ZERO, [C::ZERO; 3]);
        for (i, row) in &self.0 {
            let (mut sum, mut by_second, mut by_third) = (C::ZERO, C::ZERO, C::ZERO);
            for &([j, k], c) in row {
                let at = j * m.width + k;
                sum = sum + m.others[at].times(c);
                if j > 0 {
                    by_second = by_second + m.others[at - m.width].times(c * j as f64);
                }
                if k > 0 {
                    by_third = by_third + m.others[at - 1].times(c * k as f64);
                }
            }
            value = value + m.first[*i] * sum;
            if *i > 0 {
                gradient[0] = gradient[0] + m.first[i - 1] * sum.times(*i as f64);
            }
            gradient[1] = gradient[1] + m.first[*i] * by_second;
            gradient[2] = gradient[2] + m.first[*i] * by_third;
        }
        (value, gradient)
    }
}

/// Divides the coefficients of forms by the largest one and rounds the quotients, which are exact
/// up to then.
pub(crate) fn rounded<const N: usize>(forms: [&Poly; N]) -> [Vec<([usize; 3], f64)>; N] {
    let size = |p: &Poly| {
        p.terms()
            .iter()
            .map(|(_, c)| RBig::from(c.clone()))
            .map(|c| c.clone().max(-c))
            .max()
    };
    let largest = forms
        .iter()
        .filter_map(|p| size(p))
        .max()
        .unwrap_or(RBig::ONE);
    let inverse = RBig::ONE / largest;
    let indices = |(e, c): ([u16; 4], f64)| ([0, 1, 2].map(|v| usize::from(e[v])), c);
    forms.map(|p| {
        p.scale(&inverse)
            .to_f64()
            .into_iter()
            .map(indices)
            .collect()
    })
}

/// Scales the four forms of a map to units in which the box has the half-width 1.
pub(crate) fn in_half_widths(mut terms: [Vec<([usize; 3], f64)>; 4], half_width: f64) -> [Form; 4] {
    for term in &mut terms[3] {
        term.1 *= half_width;
    }
    let sizes = terms.iter().flatten().map(|t| t.1.abs());
    let largest = sizes.fold(0.0, f64::max);
    terms.map(|f| Form::new(f.into_iter().map(|(e, c)| (e, c / largest))))
}

/// Evaluates the forms of a map and their gradients.
pub(crate) fn eval_all(forms: &[Form; 4], at: &Monomials) -> ([C; 4], [V; 4]) {
    let (mut g, mut dg) = ([C::ZERO; 4], [[C::ZERO; 3]; 4]);
    for (i, form) in forms.iter().enumerate() {
        (g[i], dg[i]) = form.eval(at);
    }
    (g, dg)
}

/// A plane of space, as the linear form that vanishes on it.
pub(crate) type Plane = [C; 4];

/// Returns the plane of the points x with normal · x = offset.
pub(crate) fn real_plane(normal: [f64; 3], offset: f64) -> Plane {
    [normal[0], normal[1], normal[2], -offset].map(|x| C::new(x, 0.0))
}

/// Deterministic stream of pseudo-random complex numbers.
pub(crate) struct Stream(Random);

impl Stream {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Random::congruential(seed))
    }
    /// Returns numbers with real and imaginary parts from −1 to 1.
    pub(crate) fn complex<const N: usize>(&mut self) -> [C; N] {
        [(); N].map(|()| C::new(self.0.symmetric(), self.0.symmetric()))
    }
    /// Returns a number of absolute value 1.
    pub(crate) fn phase(&mut self) -> C {
        loop {
            let [c] = self.complex();
            if (0.3..1.0).contains(&c.norm()) {
                return c.times(1.0 / c.norm());
            }
        }
    }
}
