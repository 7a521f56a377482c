//! Sections: all pairs in a plane of space.
//!
//! The pairs in a general plane are found by random starts and monodromy; the trace test and their
//! number show that none are missing. Other planes are reached from there by paths.

use super::{Pair, Pairs, between};
use crate::complex::{C, Form, Monomials, Plane, Stream, V, distance, dot, norm, normalised};
use isoform_control::{Control, Stopped};
use std::collections::BTreeMap;

/// Distance of the planes of the trace test from the middle one, in half widths of the box.
const TRACE_TEST_OFFSET: f64 = 0.3;
/// Minimum distance between two pairs or parameters, as a sum of sines: paths end with eight
/// digits.
const SAME_PAIR_DISTANCE: f64 = 1e-6;

impl Pairs {
    /// Finds the pairs in a general plane; the section is complete if it passes the trace test.
    pub(super) fn first_section(
        &self,
        plane: &Plane,
        expected: &Expected,
        control: &Control<'_>,
    ) -> Result<Section, Stopped> {
        // Any other seed would do.
        let mut stream = Stream::new(5);
        let mut section = self.seeds(plane, expected, &mut stream, control)?;
        let mut in_vain = 0;
        // All pairs are led around at most thirty loops.
        for _ in 0..30 {
            // After two loops without a new pair the trace test decides.
            let is_enough =
                in_vain >= 2 || section.parameters(self, expected.is_finite) == expected.parameters;
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
        // Batches of random starts, as long as pairs are missing.
        for _ in 0..12 {
            control.check()?;
            // Random starts rarely find components of low degree, and monodromy does not lead from
            // one component to another.
            for _ in 0..400 {
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
        let (Some(a), Some(b), Some(c)) =
            (sum(-TRACE_TEST_OFFSET), sum(0.0), sum(TRACE_TEST_OFFSET))
        else {
            return false;
        };
        // The bound covers the errors of all paths together. If it were larger, an incomplete
        // section would pass, which the number of pairs shows; if it were smaller, complete ones
        // would fail.
        (a.0 + c.0 - b.0.times(2.0)).norm() <= 1e-7 * (a.1 + b.1 + c.1)
    }

    /// Returns true if the image of a pair is finite.
    fn is_finite(&self, pair: &Pair) -> bool {
        let image = self.parts(pair).even.value;
        // A smaller W is zero up to rounding.
        image[3].norm() > 1e-9 * norm(&image)
    }

    /// Returns true if the image of a pair is far outside of the box.
    fn is_far(&self, pair: &Pair) -> bool {
        let image = self.parts(pair).even.value;
        // Far away is beyond a box of twice the size.
        (0..3).any(|i| image[i].norm() > 2.0 * image[3].norm())
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
        // Each of the three attempts has other planes in between.
        for _ in 0..3 {
            let path = between(*from, *to, stream.phase());
            let mut found = Section::new();
            for p in pairs {
                match self.follow(&path, p) {
                    Ok(p) => found.add(p),
                    // The path ends in a singular point, which special planes may meet.
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
                    // Paths end with eight digits.
                    value.norm() <= 1e-6 * norm(&slope)
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
        // Cells are wider than the change of the invariant within `SAME_PAIR_DISTANCE`.
        let cell = (invariant / 1e-5).floor() as i64;
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
            found.add(invariant(&p), p, |p, q| distance(p, q) < SAME_PAIR_DISTANCE);
        }
        found.count
    }
    fn add(&mut self, pair: Pair) {
        let invariant = pair.parameters().iter().map(invariant).sum();
        if self
            .known
            .add(invariant, pair, |p, q| p.distance(q) < SAME_PAIR_DISTANCE)
        {
            self.pairs.push(pair);
        }
    }
}
