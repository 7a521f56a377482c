//! Search for the arcs of the double curve in the box.

use super::real::{ArcPlace, RealPair};
use super::section::{Expected, Section};
use super::trace::{ArcEnd, Fineness, SNAP_DISTANCE};
use super::{Pair, Pairs, between};
use crate::complex::{C, MAX_REAL_SINE, Plane, Stream, length, normalised, real_line, real_plane};
use isoform_control::{Control, Stopped};
use isoform_geom::{dot, norm};
use std::ops::Range;

/// Number of slices of the box; an arc that meets none of their planes is found where it turns
/// between two of them.
const SLICE_COUNT: usize = 16;
/// Normal of the slices, in general position, so that lines of symmetric surfaces are not parallel
/// to them.
const NORMAL: [f64; 3] = [0.512, -0.387, 0.767];
/// Number of places of an arc that are tested for a second passage: a doubled arc is doubled up to
/// a crossing, so that few suffice.
const DOUBLING_SAMPLES: usize = 12;

/// An arc of pairs with real images, in the box.
#[derive(Clone, Debug)]
pub(crate) struct Arc {
    /// Places along the arc; the first one is repeated at the end of a closed arc.
    pub(crate) places: Vec<ArcPlace>,
    /// For each place that was tested, the place before it and true if a real parameter besides the
    /// pair reaches its point.
    covered: Vec<(usize, bool)>,
    /// True if the arc ends before a base point.
    is_cut_off: bool,
    /// True if another arc has identical images.
    is_repeated: bool,
}

impl Arc {
    /// Returns the ranges of places with conjugate parameters.
    fn conjugate_parts(&self) -> Vec<Range<usize>> {
        let mut parts: Vec<Range<usize>> = Vec::new();
        for k in (0..self.places.len()).filter(|&k| self.places[k].pair.l < 0.0) {
            match parts.last_mut() {
                Some(part) if part.end == k => part.end = k + 1,
                _ => parts.push(k..k + 1),
            }
        }
        parts
    }
    /// Returns true if real parameters reach the points of a range, too; `None` if the tests of its
    /// places disagree.
    fn is_covered(&self, part: &Range<usize>) -> Option<bool> {
        // The range begins after the place before it.
        let known = part.start.saturating_sub(1)..part.end;
        let looked_at = self.covered.iter().filter(|c| known.contains(&c.0));
        let mut is_covered = looked_at.map(|c| c.1);
        let first = is_covered.next().unwrap_or(false);
        is_covered.all(|is| is == first).then_some(first)
    }
    /// Returns the place before a pair on the arc, given by its forms.
    fn find(&self, pairs: &Pairs, forms: &[RealPair]) -> Option<usize> {
        self.places
            .windows(2)
            .position(|w| pairs.is_between(forms, &w[0], &w[1]))
    }
}

/// Arcs of pairs with real images in the box.
#[derive(Debug, Default)]
pub(crate) struct Arcs {
    pub(crate) arcs: Vec<Arc>,
    /// Number of lost sections and ends of arcs; if it is not 0, arcs may be missing.
    pub(crate) lost: usize,
}

impl Arcs {
    /// Counts the arcs with a place that is passed a second time, by the arc itself or by another
    /// one.
    ///
    /// Where branches of the curve of pairs cross, as at a parameter at which the map is like a
    /// cube, tracing may change from one branch to another, and return.
    fn count_doubled(&self, pairs: &Pairs) -> usize {
        let is_doubled = |&k: &usize| {
            let count = self.arcs[k].places.len();
            let mut looks =
                (0..DOUBLING_SAMPLES).map(|i| count * (2 * i + 1) / (2 * DOUBLING_SAMPLES));
            looks.any(|at| self.is_passed_again(pairs, k, at))
        };
        (0..self.arcs.len()).filter(is_doubled).count()
    }
    /// Returns true if a place of an arc is passed again, elsewhere on the arc or by another one.
    fn is_passed_again(&self, pairs: &Pairs, arc: usize, at: usize) -> bool {
        let forms = pairs.forms(&self.arcs[arc].places[at]);
        let mut others = self.arcs.iter().enumerate();
        others.any(|(k, other)| {
            let is_elsewhere = |w: usize| k != arc || w + 3 < at || w > at + 2;
            let mut windows = other.places.windows(2).enumerate();
            windows.any(|(w, x)| is_elsewhere(w) && pairs.is_between(&forms, &x[0], &x[1]))
        })
    }
    /// Returns the arc of a pair, given by its forms, and the place before it.
    fn find(&self, pairs: &Pairs, forms: &[RealPair]) -> Option<(usize, usize)> {
        let mut arcs = self.arcs.iter().enumerate();
        arcs.find_map(|(k, arc)| Some((k, arc.find(pairs, forms)?)))
    }
    /// Returns true if a real parameter reaches a point of any pair of conjugate ones.
    pub(crate) fn is_any_covered(&self) -> bool {
        self.arcs.iter().flat_map(|a| &a.covered).any(|c| c.1)
    }
    /// Returns true if arcs end before base points, beyond which they may continue.
    pub(crate) fn is_any_cut_off(&self) -> bool {
        self.arcs.iter().any(|a| a.is_cut_off)
    }
    /// Returns the real parameters at which pairs turn from real into conjugate ones.
    pub(crate) fn pinches(&self) -> Vec<[f64; 3]> {
        let places = self.arcs.iter().flat_map(|a| &a.places);
        places
            .filter(|p| p.pair.l == 0.0)
            .map(|p| p.pair.m)
            .collect()
    }
    /// Returns the parts reached by real parameters, with the pinch points at their ends.
    pub(crate) fn real_parts(&self) -> Vec<Vec<ArcPlace>> {
        let mut found = Vec::new();
        for arc in &self.arcs {
            for part in arc.places.split(|p| p.pair.l < 0.0) {
                if part.len() > 1 {
                    found.push(part.to_vec());
                }
            }
        }
        found
    }
    /// Returns the parts reached by conjugate parameters only, with the pinch points at their ends;
    /// `None` if that changes along one of them.
    pub(crate) fn solitary(&self) -> Option<Vec<Vec<[f64; 3]>>> {
        let mut found = Vec::new();
        for arc in self.arcs.iter().filter(|a| !a.is_repeated) {
            for part in arc.conjugate_parts() {
                let is_covered = arc.is_covered(&part)?;
                if !is_covered {
                    let end = (part.end + 1).min(arc.places.len());
                    let places = &arc.places[part.start.saturating_sub(1)..end];
                    found.push(places.iter().map(ArcPlace::point).collect());
                }
            }
        }
        Some(found)
    }
    /// Makes singular ends of arcs that are near to each other identical.
    fn unite_ends(&mut self) {
        let mut known: Vec<ArcPlace> = Vec::new();
        for arc in &mut self.arcs {
            for k in [0, arc.places.len() - 1] {
                let end = &mut arc.places[k];
                if end.pair.l != 0.0 {
                    continue;
                }
                match known.iter().find(|p| is_same_parameter(p, end)) {
                    Some(p) => {
                        end.pair.m = p.pair.m;
                        end.image = p.image;
                    }
                    None => known.push(*end),
                }
            }
        }
    }
}

/// Returns true if two pinch points have one parameter, up to sign.
fn is_same_parameter(a: &ArcPlace, b: &ArcPlace) -> bool {
    let (a, b) = (a.pair.m, b.pair.m);
    let sign = if dot(a, b) < 0.0 { -1.0 } else { 1.0 };
    norm([0, 1, 2].map(|i| a[i] - sign * b[i])) < SNAP_DISTANCE
}

/// Finds the arcs of pairs in the box.
///
/// # Errors
/// [`Stopped`].
pub(crate) fn arcs(
    pairs: &Pairs,
    fine: Fineness,
    expected: &Expected,
    control: &Control<'_>,
) -> Result<Arcs, Stopped> {
    let mut found = Arcs::default();
    // Any other seed of the planes would do.
    let mut stream = Stream::new(17);
    let general: Plane = stream.complex();
    if expected.parameters == 0 {
        return Ok(found);
    }
    let section = pairs.first_section(&general, expected, control)?;
    if !section.is_complete || !expected.is_met(&section, pairs) {
        found.lost += 1;
        return Ok(found);
    }
    let mut search = ArcSearch {
        pairs,
        fine,
        general,
        section,
        stream,
        found,
    };
    search.look_on_faces(control)?;
    search.look_in_slices(control)?;
    let mut found = search.found;
    found.lost += found.count_doubled(pairs);
    found.unite_ends();
    Ok(found)
}

/// Returns one of the planes that cut the box into slices.
fn slice(k: usize) -> Plane {
    // The shift keeps all planes off the centre of the box, about which surfaces are symmetric.
    let offset = 3f64.sqrt() * ((2 * k + 1) as f64 / SLICE_COUNT as f64 - 1.0 + 0.013);
    real_plane(NORMAL.map(|x| x / norm(NORMAL)), offset)
}

/// State of the search for arcs.
struct ArcSearch<'a> {
    pairs: &'a Pairs,
    fine: Fineness,
    /// A general plane.
    general: Plane,
    section: Section,
    stream: Stream,
    found: Arcs,
}

impl ArcSearch<'_> {
    /// Searches for arcs at the faces of the box.
    fn look_on_faces(&mut self, control: &Control<'_>) -> Result<(), Stopped> {
        for k in 0..6 {
            control.check()?;
            let mut normal = [0.0; 3];
            normal[k / 2] = 1.0;
            let face = real_plane(normal, [-1.0, 1.0][k % 2]);
            let here = self.section_by(&face, None);
            self.look(&here.pairs, true);
        }
        Ok(())
    }
    /// Searches for arcs in parallel planes, and between successive ones.
    fn look_in_slices(&mut self, control: &Control<'_>) -> Result<(), Stopped> {
        let mut before: Option<(Plane, Vec<Pair>)> = None;
        for k in 0..SLICE_COUNT {
            control.check()?;
            let plane = slice(k);
            let here = self.section_by(&plane, before.as_ref());
            self.look(&here.pairs, false);
            if let Some((from, known)) = &before {
                self.look_between([from, &plane], known);
            }
            before = (here.is_complete && here.outside == 0).then_some((plane, here.pairs));
        }
        Ok(())
    }
    /// Returns the section by a plane, tracked from the section by the plane before, if there is
    /// one, and from the general one if that is incomplete.
    fn section_by(&mut self, plane: &Plane, before: Option<&(Plane, Vec<Pair>)>) -> Section {
        let general = (&self.general, &self.section.pairs[..]);
        let (from, known) = before.map_or(general, |(from, known)| (from, &known[..]));
        let mut here = self.pairs.section(from, known, plane, &mut self.stream);
        if !here.is_complete {
            let (from, known) = general;
            here = self.pairs.section(from, known, plane, &mut self.stream);
        }
        self.found.lost += usize::from(!here.is_complete);
        here
    }

    /// Traces the arcs that turn between two planes without meeting either.
    ///
    /// On a straight path from one plane to the next, two pairs meet where an arc turns, with real
    /// pairs on one side and complex ones on the other.
    fn look_between(&mut self, planes: [&Plane; 2], known: &[Pair]) {
        let path = between(*planes[0], *planes[1], C::ONE);
        for pair in known {
            let Err((_, stuck)) = self.pairs.follow(&path, pair) else {
                continue;
            };
            // Paths stop before the turn of an arc, with parameters that are real or conjugate up
            // to this sine.
            let place = self.pairs.place_near(&stuck, 0.03);
            let Some(place) = place.filter(ArcPlace::is_inside) else {
                continue;
            };
            if !self.is_known(&place) {
                let arc = self.both_ways(&place);
                self.found.arcs.push(arc);
            }
        }
    }

    /// Traces the arcs through the pairs of a section that are not known yet.
    fn look(&mut self, section: &[Pair], is_face: bool) {
        for pair in section {
            let Some(mut place) = self.pairs.place(pair) else {
                continue;
            };
            // The place belongs to another pair; half of the digits are lost where parameters
            // coincide.
            if place.pair.complex().distance(pair) > 1e-5 {
                continue;
            }
            if is_face {
                place.put_on_faces();
            }
            if place.is_inside() {
                self.add(&place, &self.others(section, pair, &place));
            }
        }
    }
    /// Returns the other pairs of a section with the image of a place.
    fn others<'s>(&self, section: &'s [Pair], pair: &Pair, place: &ArcPlace) -> Vec<&'s Pair> {
        let image = |p: &Pair| self.pairs.parts(p).even.value;
        // Paths end with eight digits: nearer pairs are identical.
        let others = section.iter().filter(|o| o.distance(pair) > 1e-6);
        others
            .filter(|o| is_same_image(&image(o), &place.image))
            .collect()
    }
    /// Records on the arc of a place if it is covered; an unknown arc is traced.
    fn add(&mut self, place: &ArcPlace, others: &[&Pair]) {
        let pairs = self.pairs;
        let is_covered = others.iter().any(|other| {
            let parameters = other.parameters().map(|p| normalised(&p));
            parameters
                .iter()
                .any(|p| length(&real_line(p)) < MAX_REAL_SINE)
        });
        let forms = pairs.forms(place);
        if let Some((k, at)) = self.found.find(pairs, &forms) {
            self.found.arcs[k].covered.push((at, is_covered));
            return;
        }
        let mut arc = self.both_ways(place);
        let at = arc.find(pairs, &forms).unwrap_or(0);
        arc.covered.push((at, is_covered));
        let mut places = others.iter().filter_map(|o| pairs.place(o));
        arc.is_repeated = places.any(|place| self.is_known(&place));
        self.found.arcs.push(arc);
    }
    fn is_known(&self, place: &ArcPlace) -> bool {
        let forms = self.pairs.forms(place);
        self.found.find(self.pairs, &forms).is_some()
    }

    /// Traces the arc through a place in both directions, and counts ends that are lost.
    fn both_ways(&mut self, start: &ArcPlace) -> Arc {
        let (mut places, end) = self.pairs.trace(start, self.fine);
        let mut ends = vec![end];
        if end != ArcEnd::Closed {
            let (mut back, end) = self.pairs.trace(&start.turned(), self.fine);
            ends.push(end);
            back.reverse();
            for p in &mut back {
                *p = p.turned();
            }
            back.extend(&places[1..]);
            places = back;
        }
        self.found.lost += ends.iter().filter(|e| **e == ArcEnd::Lost).count();
        Arc {
            places,
            covered: Vec::new(),
            is_cut_off: ends.contains(&ArcEnd::Base),
            is_repeated: false,
        }
    }
}

impl ArcPlace {
    /// Moves the image onto the faces of the box on which it lies up to rounding.
    fn put_on_faces(&mut self) {
        for i in 0..3 {
            let over = self.image[i].abs() / self.image[3].abs() - 1.0;
            // Relative distance from a face up to which a place is on it.
            if over.abs() < 1e-9 {
                self.image[i] = self.image[3].abs() * self.image[i].signum();
            }
        }
    }
}

/// Returns true if the image of a pair equals the point of another one.
fn is_same_image(a: &[C; 4], b: &[f64; 4]) -> bool {
    // Coordinates are compared up to 1e-6 half widths of the box.
    let bound = 1e-6 * (a[3].norm() * b[3].abs());
    (0..3).all(|i| (a[i].times(b[3]) - a[3].times(b[i])).norm() < bound)
}
