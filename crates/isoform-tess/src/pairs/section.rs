//! Sections: all pairs in a plane of space.
//!
//! The pairs in a general plane are found by random starts and monodromy; the trace test and their
//! number show that none are missing. Other planes are reached from there by paths.

use super::{Pair, Pairs, between};
use crate::complex::{C, Form, Monomials, Plane, Stream, V, distance, dot, norm, normalised};
use isoform_control::{Control, Stopped};
use std::collections::BTreeMap;

/// The number of times that all pairs of the section are led around at most.
const LOOPS: usize = 30;
/// The number of loops that may find nothing before the trace test is asked.
const IN_VAIN: usize = 2;
/// Random starts of a batch: pairs of components of low degree are rarely found, and monodromy does
/// not lead from one component to another.
const SEEDS: usize = 400;
/// Batches of random starts, as long as there are too few pairs.
const BATCHES: usize = 12;
/// The seed of the random starts and loops: any other would do.
const SEED: u64 = 5;
/// The distance of the planes of the trace test, in half widths of the box.
const FAR: f64 = 0.3;
/// The largest bend of the sum of images in the trace test, in shares of the sizes of its terms:
/// the errors of all paths together. Larger, and an incomplete section is taken for complete, which
/// the number of pairs shows; smaller, and complete ones are refused.
const BENT: f64 = 1e-7;
/// The number of times that a section is tried, with other planes in between.
const TRIES: usize = 3;
/// Paths that stop after this time have come to their end: a singular point, which planes that are
/// not general may meet.
const NEARLY_THERE: f64 = 0.9;
/// Images outside of this many boxes are far away.
const FAR_AWAY: f64 = 2.0;
/// W per norm of the forms that is taken for 0: rounding.
const INFINITE: f64 = 1e-9;
/// The largest distance of a parameter from a curve that it is on, as a sine: paths end with eight
/// digits.
const ON_CURVE: f64 = 1e-6;
/// Minimum distance between two pairs or parameters, as a sum of sines: paths end with eight
/// digits.
const APART: f64 = 1e-6;
/// The width of cells by which near pairs are found: more than an invariant changes within
/// [`APART`].
const CELL: f64 = 1e-5;

impl Pairs {
    /// Finds the pairs in a general plane; the section is complete if it passes the trace test.
    pub(super) fn first_section(
        &self,
        plane: &Plane,
        expected: &Expected,
        control: &Control<'_>,
    ) -> Result<Section, Stopped> {
        let mut stream = Stream::new(SEED);
        let mut section = self.seeds(plane, expected, &mut stream, control)?;
        let mut in_vain = 0;
        for _ in 0..LOOPS {
            let is_enough = in_vain >= IN_VAIN
                || section.parameters(self, expected.is_finite) == expected.parameters;
            if is_enough && self.passes_trace_test(plane, &section.pairs, &mut stream) {
                section.is_complete = true;
                break;
            }
            let known = section.pairs.len();
            self.lead_around(plane, &mut section, &mut stream, control)?;
            in_vain = if section.pairs.len() > known {
                0
            } else {
                in_vain + 1
            };
        }
        Ok(section)
    }
    /// Finds pairs in a plane from random starts: as a rule, at least one of each component.
    fn seeds(
        &self,
        plane: &Plane,
        expected: &Expected,
        stream: &mut Stream,
        control: &Control<'_>,
    ) -> Result<Section, Stopped> {
        let mut section = Section::new();
        for _ in 0..BATCHES {
            control.check()?;
            for _ in 0..SEEDS {
                if let Some(p) = self.seed(plane, stream) {
                    section.add(p);
                }
            }
            let count = section.parameters(self, expected.is_finite);
            if count >= expected.parameters || section.pairs.is_empty() {
                break;
            }
        }
        Ok(section)
    }
    /// Tracks all pairs through two other planes back to their own one, and adds the pairs reached
    /// (monodromy).
    fn lead_around(
        &self,
        plane: &Plane,
        section: &mut Section,
        stream: &mut Stream,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let [a, b]: [Plane; 2] = [stream.complex(), stream.complex()];
        let phases = [stream.phase(), stream.phase(), stream.phase()];
        let away = between(*plane, a, phases[0]);
        let on = between(a, b, phases[1]);
        let back = between(b, *plane, phases[2]);
        for k in 0..section.pairs.len() {
            control.check()?;
            let end = self
                .follow(&away, &section.pairs[k])
                .and_then(|p| self.follow(&on, &p))
                .and_then(|p| self.follow(&back, &p));
            if let Ok(p) = end {
                section.add(p);
            }
        }
        Ok(())
    }

    /// Returns true if the sum of the images moves on a line as the plane is translated.
    pub(super) fn passes_trace_test(
        &self,
        plane: &Plane,
        pairs: &[Pair],
        stream: &mut Stream,
    ) -> bool {
        let weights: [C; 3] = stream.complex();
        let [a, b, c, d] = *plane;
        let moved = |far: f64| [a, b, c, d + C::new(far, 0.0)];
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
        (a.0 + c.0 - b.0.times(2.0)).norm() <= BENT * (a.1 + b.1 + c.1)
    }

    /// Returns true if the image of a pair is finite.
    fn is_finite(&self, pair: &Pair) -> bool {
        let image = self.parts(pair).even.value;
        image[3].norm() > INFINITE * norm(&image)
    }

    /// Returns true if the image of a pair is far outside of the box.
    fn is_far(&self, pair: &Pair) -> bool {
        let image = self.parts(pair).even.value;
        (0..3).any(|i| image[i].norm() > FAR_AWAY * image[3].norm())
    }

    /// Tracks a section from one plane to another; it is incomplete if paths are lost.
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
                    Err((time, p)) if time > NEARLY_THERE && self.is_far(&p) => found.outside += 1,
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

/// Known numbers of parameters of a section, to test its completeness.
#[derive(Default)]
pub(crate) struct Expected {
    /// Number of parameters of the section.
    pub(crate) parameters: usize,
    /// True if parameters with an image at infinity are not counted.
    pub(crate) is_finite: bool,
    /// Curves of parameters with finite images, irreducible over Q, as forms with their degrees. If
    /// given, a section is also accepted if its finite pairs lie on them, with some on each of
    /// them.
    pub(crate) curves: Vec<(Form, usize)>,
}

impl Expected {
    /// Returns true if a section that passes the trace test has the known numbers.
    pub(super) fn is_met(&self, section: &Section, pairs: &Pairs) -> bool {
        section.parameters(pairs, self.is_finite) == self.parameters
            || !self.curves.is_empty() && self.is_on_curves(section, pairs)
    }
    fn is_on_curves(&self, section: &Section, pairs: &Pairs) -> bool {
        let mut has_any = vec![false; self.curves.len()];
        for pair in section.pairs.iter().filter(|p| pairs.is_finite(p)) {
            for p in pair.parameters().map(|p| normalised(&p)) {
                let on = self.curves.iter().position(|(form, degree)| {
                    let (value, slope) = form.eval(&Monomials::new(&p, *degree));
                    value.norm() <= ON_CURVE * norm(&slope)
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

/// The pairs in a plane.
pub(super) struct Section {
    pub(super) pairs: Vec<Pair>,
    known: Distinct<Pair>,
    /// Number of other pairs far outside of the box.
    pub(super) outside: usize,
    pub(super) is_complete: bool,
}

/// Returns a number that depends on a parameter continuously, and not on its phase.
fn invariant(p: &V) -> f64 {
    p[0].norm2() / p.iter().map(|c| c.norm2()).sum::<f64>()
}

/// A set of values no two of which are near to each other.
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
    /// Adds a value unless another one is near to it, by an invariant and a test; returns true if
    /// it was added.
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
    /// Counts the parameters of all pairs; if `is_finite`, without those with an image at infinity.
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
