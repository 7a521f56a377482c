//! All pairs in a plane of space.

use super::{Pair, Pairs, between};
use crate::complex::{C, Form, Monomials, Plane, Stream, V, distance, dot, norm, normalised};
use isoform_control::{Control, Stopped};
use std::collections::BTreeMap;

/// How often all pairs of the section are carried around at most, and how often in vain before the
/// section is looked at.
const LOOPS: usize = 30;
const IN_VAIN: usize = 2;
/// Random starts, and how often as many as long as there are too few pairs: those of components of
/// a low degree are rarely found, and monodromy does not lead to them.
const SEEDS: usize = 400;
const BATCHES: usize = 12;

impl Pairs {
    /// The pairs in a general plane: all of them, if the trace test says so.
    pub(super) fn first_section(
        &self,
        plane: &Plane,
        expected: &Expected,
        control: &Control<'_>,
    ) -> Result<Section, Stopped> {
        let mut stream = Stream(5);
        let mut section = Section::new();
        for _ in 0..BATCHES {
            control.check()?;
            for _ in 0..SEEDS {
                if let Some(p) = self.seed(plane, &mut stream) {
                    section.add(p);
                }
            }
            if section.parameters(self, expected.is_finite) >= expected.parameters
                || section.pairs.is_empty()
            {
                break;
            }
        }
        let is_full = |s: &Section| s.parameters(self, expected.is_finite) == expected.parameters;
        let mut in_vain = 0;
        for _ in 0..LOOPS {
            let is_enough = in_vain >= IN_VAIN || is_full(&section);
            if is_enough && self.passes_trace_test(plane, &section.pairs, &mut stream) {
                section.is_complete = true;
                break;
            }
            let [a, b]: [Plane; 2] = [stream.complex(), stream.complex()];
            let phases = [stream.phase(), stream.phase(), stream.phase()];
            let known = section.pairs.len();
            for k in 0..known {
                control.check()?;
                let end = self
                    .follow(&between(*plane, a, phases[0]), &section.pairs[k])
                    .and_then(|p| self.follow(&between(a, b, phases[1]), &p))
                    .and_then(|p| self.follow(&between(b, *plane, phases[2]), &p));
                if let Ok(p) = end {
                    section.add(p);
                }
            }
            in_vain = if section.pairs.len() > known {
                0
            } else {
                in_vain + 1
            };
        }
        Ok(section)
    }

    /// Whether the sum of the images moves on a line as the plane moves parallel to itself.
    pub(super) fn passes_trace_test(
        &self,
        plane: &Plane,
        pairs: &[Pair],
        stream: &mut Stream,
    ) -> bool {
        let weights: [C; 3] = stream.complex();
        let moved = |far: f64| {
            let mut plane = *plane;
            plane[3] = plane[3] + C::new(far, 0.0);
            plane
        };
        let sum = |far: f64| {
            let path = between(*plane, moved(far), C::ONE);
            let mut sum = C::ZERO;
            let mut size = 0.0;
            for p in pairs {
                let image = self.parts(&self.follow(&path, p).ok()?).even.value;
                let value = dot(&weights, &[image[0], image[1], image[2]]) * image[3].inverse();
                sum = sum + value;
                size += value.norm();
            }
            Some((sum, size))
        };
        let (Some(a), Some(b), Some(c)) = (sum(-FAR), sum(0.0), sum(FAR)) else {
            return false;
        };
        (a.0 + c.0 - b.0.times(2.0)).norm() <= 1e-7 * (a.1 + b.1 + c.1)
    }

    /// Whether the image of a pair is not at infinity.
    fn is_finite(&self, pair: &Pair) -> bool {
        let image = self.parts(pair).even.value;
        image[3].norm() > INFINITE * norm(&image)
    }

    /// Whether the image of a pair is outside of twice the box.
    fn is_far(&self, pair: &Pair) -> bool {
        let image = self.parts(pair).even.value;
        (0..3).any(|i| image[i].norm() > 2.0 * image[3].norm())
    }

    /// The section by a plane from another one; less than that if paths are lost.
    pub(super) fn section(
        &self,
        from: &Plane,
        pairs: &[Pair],
        to: &Plane,
        stream: &mut Stream,
    ) -> Section {
        let mut best = Section::new();
        for _ in 0..TRIES {
            let path = between(*from, *to, stream.phase());
            let mut found = Section::new();
            for p in pairs {
                match self.follow(&path, p) {
                    Ok(p) => found.add(p),
                    // To a singular point, which planes that are not general may meet.
                    Err((time, p)) if time > 0.9 && self.is_far(&p) => found.outside += 1,
                    Err(_) => {}
                }
            }
            found.is_complete = found.pairs.len() + found.outside == pairs.len();
            if found.is_complete {
                return found;
            }
            if found.pairs.len() > best.pairs.len() {
                best = found;
            }
        }
        best
    }
}

/// How far planes of the trace test are apart, in half-widths.
const FAR: f64 = 0.3;
/// How often a section is tried.
const TRIES: usize = 3;

/// W per norm of the forms that is taken for 0.
const INFINITE: f64 = 1e-9;

/// What is known of a section beforehand.
#[derive(Default)]
pub(crate) struct Expected {
    /// How many parameters it has.
    pub(crate) parameters: usize,
    /// Whether those with an image at infinity do not count.
    pub(crate) is_finite: bool,
    /// The curves of parameters with finite images, irreducible over Q, if it is enough that the
    /// finite pairs lie on them, and some on each of them: forms and their degrees.
    pub(crate) curves: Vec<(Form, usize)>,
}

impl Expected {
    /// Whether a section that passes the trace test is what is expected.
    pub(super) fn is_met(&self, section: &Section, pairs: &Pairs) -> bool {
        section.parameters(pairs, self.is_finite) == self.parameters
            || !self.curves.is_empty() && self.is_on_curves(section, pairs)
    }
    fn is_on_curves(&self, section: &Section, pairs: &Pairs) -> bool {
        /// How far from a curve, as a sine, a parameter on it may be for rounding.
        const OFF: f64 = 1e-6;
        let mut has_any = vec![false; self.curves.len()];
        for pair in section.pairs.iter().filter(|p| pairs.is_finite(p)) {
            for p in pair.parameters().map(|p| normalised(&p)) {
                let on = self.curves.iter().position(|(form, degree)| {
                    let (value, slope) = form.eval(&Monomials::new(&p, *degree));
                    value.norm() <= OFF * norm(&slope)
                });
                match on {
                    Some(k) => has_any[k] = true,
                    None => return false,
                }
            }
        }
        has_any.iter().all(|any| *any)
    }
}

/// Pairs in a plane.
pub(super) struct Section {
    pub(super) pairs: Vec<Pair>,
    known: Distinct<Pair>,
    /// Others that are far outside of the box.
    pub(super) outside: usize,
    pub(super) is_complete: bool,
}

/// How far apart, as sines of angles, what is not one is.
const APART: f64 = 1e-6;
/// The width of cells by which what is near is found.
const CELL: f64 = 1e-5;

/// A number of a parameter that its neighbours have, too, whatever their phase.
fn invariant(p: &V) -> f64 {
    p[0].norm2() / p.iter().map(|c| c.norm2()).sum::<f64>()
}

/// Each of what is near to each other once.
struct Distinct<T> {
    cells: BTreeMap<i64, Vec<T>>,
    count: usize,
}

impl<T> Distinct<T> {
    fn new() -> Self {
        Self {
            cells: BTreeMap::new(),
            count: 0,
        }
    }
    /// Whether nothing is near to it: then it is taken.
    fn add(&mut self, invariant: f64, value: T, is_near: impl Fn(&T, &T) -> bool) -> bool {
        let cell = (invariant / CELL).floor() as i64;
        let mut around = (cell - 1..=cell + 1).filter_map(|c| self.cells.get(&c));
        if around.any(|known| known.iter().any(|other| is_near(other, &value))) {
            return false;
        }
        self.cells.entry(cell).or_default().push(value);
        self.count += 1;
        true
    }
}

impl Section {
    fn new() -> Self {
        Self {
            pairs: Vec::new(),
            known: Distinct::new(),
            outside: 0,
            is_complete: false,
        }
    }
    /// How many parameters the pairs have together; without those with an image at infinity, if
    /// asked for.
    pub(super) fn parameters(&self, pairs: &Pairs, is_finite: bool) -> usize {
        let is_counted = |p: &&Pair| !is_finite || pairs.is_finite(p);
        let counted = self.pairs.iter().filter(is_counted);
        let mut found = Distinct::new();
        for p in counted.flat_map(Pair::parameters).map(|p| normalised(&p)) {
            found.add(invariant(&p), p, |p, q| distance(p, q) < APART);
        }
        found.count
    }
    fn add(&mut self, pair: Pair) {
        let invariant = pair.parameters().iter().map(invariant).sum();
        if self
            .known
            .add(invariant, pair, |p, q| p.distance(q) < APART)
        {
            self.pairs.push(pair);
        }
    }
}
