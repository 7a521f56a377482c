//! Arcs of the double curve in the box.

use super::real::{Condition, Place, REAL, RealPair, dot7};
use super::section::Expected;
use super::{Pair, Pairs, between};
use crate::complex::{C, Plane, Stream, length, normalised, real_line, real_plane};
use isoform_control::{Control, Stopped};
use isoform_geom::{distance_to_segment, dot, norm};

/// Why an arc ends.
#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    Face,
    Closed,
    /// At a parameter where the rank of the differential drops to 1.
    Singular,
    /// At a base point.
    Base,
    Lost,
}

/// What the chords of an arc may be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fineness {
    /// How far they leave it, and how long they are, in half-widths.
    pub(crate) tolerance: f64,
    pub(crate) longest: f64,
}

impl Pairs {
    /// The place of an arc beside its chord between two others, at a part of that.
    pub(crate) fn part(&self, a: &Place, b: &Place, t: f64) -> Option<Place> {
        let b = self.like(a, b)?;
        let d = a.pair.to(&b.pair);
        let (place, _) = self.correct(&a.pair.moved(&d, t), &Condition::Across(d))?;
        Some(if dot7(&place.tangent, &d) < 0.0 {
            place.turned()
        } else {
            place
        })
    }
    /// Where a coordinate of one of the real parameters vanishes between two places.
    pub(crate) fn on_side(&self, a: &Place, b: &Place, which: usize, k: usize) -> Option<Place> {
        let b = self.like(a, b)?;
        let value = |p: &Place| p.real().map(|r| r[which][k]);
        let (x, y) = (value(a)?, value(&b)?);
        let d = a.pair.to(&b.pair);
        let start = a.pair.moved(&d, x / (x - y));
        let (place, _) = self.correct(&start, &Condition::Side(which, k))?;
        let t = dot7(&a.pair.to(&place.pair), &d) / dot7(&d, &d);
        (t > -0.1 && t < 1.1).then_some(place)
    }
    /// The next place of an arc with signs like those of the one before.
    fn like(&self, a: &Place, b: &Place) -> Option<Place> {
        let near = |b: &Place| {
            let d = a.pair.to(&b.pair);
            dot7(&d, &d)
        };
        let other = self.flipped(b)?;
        Some(if near(&other) < near(b) { other } else { *b })
    }

    /// The place halfway between two that have the same signs.
    fn halfway(&self, a: &Place, b: &Place) -> Option<Place> {
        let d = a.pair.to(&b.pair);
        let found = self.correct(&a.pair.moved(&d, 0.5), &Condition::Across(d));
        found.map(|p| p.0)
    }

    /// Follows an arc in the direction of its tangent: the places after it.
    fn trace(&self, start: &Place, fine: Fineness) -> (Vec<Place>, End) {
        let forms = self.forms(start);
        let mut nodes = vec![*start];
        let mut step = 0.02f64;
        while nodes.len() < PLACES {
            let here = nodes[nodes.len() - 1];
            let Some((way, end, error)) = self.advance(&here, step, fine) else {
                step /= 2.0;
                if step < 1e-10 {
                    let end = self.singular_end(&here);
                    nodes.extend(end);
                    return (nodes, end.map_or(End::Lost, |_| End::Singular));
                }
                continue;
            };
            for next in way {
                let last = nodes[nodes.len() - 1];
                if nodes.len() > 2 && self.is_between(&forms, &last, &next) {
                    nodes.push(*start);
                    return (nodes, End::Closed);
                }
                nodes.push(next);
            }
            if let Some(end) = end {
                return (nodes, end);
            }
            let last = nodes.len() - 1;
            if nodes[last].pair.is_at_base_point(self.degree) {
                return (nodes, End::Base);
            }
            let Some(righted) = self.righted(&nodes[last]) else {
                return (nodes, End::Lost);
            };
            nodes[last] = righted;
            if error < 0.02 * step {
                step = (1.5 * step).min(0.1);
            }
        }
        (nodes, End::Lost)
    }

    /// One step along an arc: the places after it, with the pinch point that is passed, why it ends
    /// there, and how far the prediction was off. None if the step is too long.
    fn advance(
        &self,
        here: &Place,
        step: f64,
        fine: Fineness,
    ) -> Option<(Vec<Place>, Option<End>, f64)> {
        let predicted = here.pair.moved(&here.tangent, step);
        let (mut next, error) = self.correct(&predicted, &Condition::Across(here.tangent))?;
        let mut turn = dot7(&here.tangent, &next.tangent);
        if turn < 0.0 {
            next = next.turned();
            turn = -turn;
        }
        if turn < 0.95 || error > 0.1 * step {
            return None;
        }
        let mut end = None;
        if !next.is_inside() {
            (next, end) = (self.face_between(here, &next)?, Some(End::Face));
            if here.pair.distance(&next.pair) < ON_FACE {
                // The step may be so long that it leads in and out again.
                return (!self.goes_in(here)).then_some((Vec::new(), end, error));
            }
        }
        let mut way = Vec::new();
        if here.pair.l * next.pair.l < 0.0 {
            way.push(self.pinch_between(here, &next)?);
        }
        way.push(next);
        let mut from = *here;
        for to in &way {
            let middle = self.halfway(&from, to)?;
            let ends = [from.point(), to.point()];
            let long = norm([0, 1, 2].map(|i| ends[1][i] - ends[0][i]));
            let off = distance_to_segment(middle.point(), ends);
            if step > 1e-7 && (off > fine.tolerance || long > fine.longest) {
                return None;
            }
            from = *to;
        }
        Some((way, end, error))
    }

    /// Whether an arc leads into the box from a place on a face.
    fn goes_in(&self, here: &Place) -> bool {
        /// How far on it is looked at: farther than rounding, and nearer than steps.
        const LOOK: f64 = 1e-7;
        let ahead = here.pair.moved(&here.tangent, LOOK);
        let found = self.correct(&ahead, &Condition::Across(here.tangent));
        found.is_some_and(|(place, _)| place.is_inside())
    }

    /// Where an arc first leaves the box between two places.
    fn face_between(&self, a: &Place, b: &Place) -> Option<Place> {
        let d = a.pair.to(&b.pair);
        let mut best: Option<(f64, Place)> = None;
        for i in 0..3 {
            for side in [-1.0, 1.0] {
                let mut plane = [0.0; 4];
                plane[i] = 1.0;
                plane[3] = -side;
                // The images have the sign of W that is positive.
                let value = |p: &Place| p.image[i] / p.image[3] - side;
                let (x, y) = (value(a), value(b));
                if x * side > 0.0 || y * side <= 0.0 {
                    continue;
                }
                let t = x / (x - y);
                let (mut place, _) =
                    self.correct(&a.pair.moved(&d, t), &Condition::Plane(plane))?;
                if dot7(&place.tangent, &a.tangent) < 0.0 {
                    place = place.turned();
                }
                place.image[i] = side * place.image[3];
                if place.is_inside() && best.is_none_or(|b| t < b.0) {
                    best = Some((t, place));
                }
            }
        }
        best.map(|b| b.1)
    }

    /// Makes one of ends of arcs that are singular and near to each other.
    fn unite(arcs: &mut [Arc]) {
        let mut known: Vec<Place> = Vec::new();
        for arc in arcs {
            let last = arc.places.len() - 1;
            for k in [0, last] {
                let end = &mut arc.places[k];
                if end.pair.l != 0.0 {
                    continue;
                }
                let same = |p: &&Place| {
                    let sign = if dot(p.pair.m, end.pair.m) < 0.0 {
                        -1.0
                    } else {
                        1.0
                    };
                    norm([0, 1, 2].map(|i| p.pair.m[i] - sign * end.pair.m[i])) < NEAR
                };
                match known.iter().find(same) {
                    Some(p) => {
                        end.pair.m = p.pair.m;
                        end.image = p.image;
                    }
                    None => known.push(*end),
                }
            }
        }
    }

    /// The end of an arc near to a place, if its parameters are one there and the differential has
    /// the rank 1.
    fn singular_end(&self, here: &Place) -> Option<Place> {
        /// λ, and the second singular value per first, that are taken for zero next to it: both
        /// vanish like distances from the place.
        const ZERO: f64 = 1e-5;
        let m = here.pair.m.map(|x| C::new(x, 0.0));
        let (_, df) = self.at(&m);
        // The sum of the squares of the 2 × 2 minors by that of the products.
        let (mut minors, mut size) = (0.0, 0.0);
        for i in 0..4 {
            for j in i + 1..4 {
                for [a, b] in [[0, 1], [1, 2], [2, 0]] {
                    let minor = df[i][a].re * df[j][b].re - df[i][b].re * df[j][a].re;
                    minors += minor * minor;
                }
            }
            size += df[i].iter().map(|c| c.norm2()).sum::<f64>();
        }
        // Such places are often on the axes of the parameters.
        let snapped = here.pair.m.map(|x| if x.abs() < NEAR { 0.0 } else { x });
        (here.pair.l.abs() < ZERO && minors.sqrt() < ZERO * size).then_some(Place {
            pair: RealPair {
                m: snapped,
                l: 0.0,
                ..here.pair
            },
            ..*here
        })
    }

    /// Whether a pair, given by its forms, lies on an arc between two places next to each other,
    /// whose tangents differ by little.
    ///
    /// Not by its parameters: these differ by the root of λ, which turns where λ comes to 0.
    fn is_between(&self, forms: &[RealPair], a: &Place, b: &Place) -> bool {
        /// How much longer the way over what is between two places may be than the straight one.
        const DETOUR: f64 = 1.03;
        /// What is longer is no step, but written in another form.
        const LONG: f64 = 0.3;
        /// How far from the arc a pair on it may be for rounding.
        const OFF: f64 = 1e-6;
        let (mut from, mut to) = (a.pair, b.pair);
        if from.distance(&to) > LONG {
            to = from.nearest(&self.forms(b));
        }
        if from.distance(&to) > LONG {
            (from, to) = (b.pair.nearest(&self.forms(a)), b.pair);
        }
        let (d, length) = (from.to(&to), from.distance(&to));
        let is_near = |x: &RealPair| {
            let detour = from.distance(x) + x.distance(&to);
            detour <= DETOUR * length + 1e-9
        };
        // Others may be as near to a long step: the place beside the pair decides.
        let is_on = |x: &RealPair| {
            let t = dot7(&from.to(x), &d) / (length * length);
            let here = self.correct(&from.moved(&d, t), &Condition::Across(d));
            // Scaling has moved it along the arc.
            length < OFF || here.is_none_or(|(here, _)| here.is_in_line(x, OFF))
        };
        forms.iter().any(|x| is_near(x) && is_on(x))
    }

    fn pinch_between(&self, a: &Place, b: &Place) -> Option<Place> {
        let t = a.pair.l / (a.pair.l - b.pair.l);
        let d = a.pair.to(&b.pair);
        let (place, _) = self.correct(&a.pair.moved(&d, t), &Condition::Pinch)?;
        Some(if dot7(&place.tangent, &a.tangent) < 0.0 {
            place.turned()
        } else {
            place
        })
    }
}

/// Places of an arc at most.
const PLACES: usize = 100_000;

/// How near to each other singular ends are one: tracing stops about 1e-9 before them.
const NEAR: f64 = 1e-7;

/// How near to a face of the box what is found there is on it: where an arc begins it need not go
/// on.
const ON_FACE: f64 = 1e-10;

/// An arc of pairs with real images, in the box.
#[derive(Clone, Debug)]
pub(crate) struct Arc {
    /// The first is repeated as the last if it is closed.
    pub(crate) places: Vec<Place>,
    /// Whether a real parameter beside the pair leads to the same point, where that was looked at:
    /// before which place.
    covered: Vec<(usize, bool)>,
    /// Whether it ends before a base point.
    is_cut_off: bool,
    /// Whether another arc has the same images.
    is_repeated: bool,
}

impl Arc {
    /// The place before a pair on it, given by its forms.
    fn find(&self, pairs: &Pairs, forms: &[RealPair]) -> Option<usize> {
        self.places
            .windows(2)
            .position(|w| pairs.is_between(forms, &w[0], &w[1]))
    }
}

/// What is known of the pairs with real images in the box.
#[derive(Debug, Default)]
pub(crate) struct Arcs {
    pub(crate) arcs: Vec<Arc>,
    /// How many sections and ends of arcs were lost: with any, arcs may be missing.
    pub(crate) lost: usize,
}

impl Arcs {
    /// How many arcs come over a place of their own, or of another one, once more.
    ///
    /// Where branches of the curve of pairs cross, as at a parameter where the map is like a cube,
    /// tracing may change from one to another, and come back.
    fn count_doubled(&self, pairs: &Pairs) -> usize {
        /// Places of an arc that are looked at: what is doubled is so up to a crossing.
        const LOOKS: usize = 12;
        let is_doubled = |&k: &usize| {
            let places = &self.arcs[k].places;
            (0..LOOKS).any(|i| {
                let at = places.len() * (2 * i + 1) / (2 * LOOKS);
                let forms = pairs.forms(&places[at]);
                let is_again = |(other, arc): (usize, &Arc)| {
                    let elsewhere = |w: &usize| other != k || *w + 3 < at || *w > at + 2;
                    let mut windows = arc.places.windows(2).enumerate();
                    windows.any(|(w, x)| elsewhere(&w) && pairs.is_between(&forms, &x[0], &x[1]))
                };
                self.arcs.iter().enumerate().any(is_again)
            })
        };
        (0..self.arcs.len()).filter(is_doubled).count()
    }
    /// The arc of a pair, given by its forms, and the place before it.
    fn find(&self, pairs: &Pairs, forms: &[RealPair]) -> Option<(usize, usize)> {
        let mut arcs = self.arcs.iter().enumerate();
        arcs.find_map(|(k, arc)| Some((k, arc.find(pairs, forms)?)))
    }
    /// Whether a real parameter leads to a point of a pair of conjugate ones, somewhere.
    pub(crate) fn is_any_covered(&self) -> bool {
        self.arcs.iter().flat_map(|a| &a.covered).any(|c| c.1)
    }
    /// Whether arcs end before base points, beyond which they may go on.
    pub(crate) fn is_any_cut_off(&self) -> bool {
        self.arcs.iter().any(|a| a.is_cut_off)
    }
    /// The real parameters where pairs turn from real ones into conjugate ones.
    pub(crate) fn pinches(&self) -> Vec<[f64; 3]> {
        let places = self.arcs.iter().flat_map(|a| &a.places);
        places
            .filter(|p| p.pair.l == 0.0)
            .map(|p| p.pair.m)
            .collect()
    }
    /// The parts that real parameters reach, with the pinch points at their ends.
    pub(crate) fn real_parts(&self) -> Vec<Vec<Place>> {
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
    /// The parts that only conjugate parameters reach; none where that changes along one of them.
    pub(crate) fn solitary(&self) -> Option<Vec<Vec<[f64; 3]>>> {
        let mut found = Vec::new();
        for arc in self.arcs.iter().filter(|a| !a.is_repeated) {
            let mut from = 0;
            while from < arc.places.len() {
                let is_real = |k: usize| arc.places[k].pair.l >= 0.0;
                if is_real(from) {
                    from += 1;
                    continue;
                }
                let to = (from..arc.places.len())
                    .find(|&k| is_real(k))
                    .unwrap_or(arc.places.len());
                // With the pinch points at its ends.
                let part = from.saturating_sub(1)..(to + 1).min(arc.places.len());
                let inside =
                    |c: &&(usize, bool)| part.contains(&c.0) && !is_real(c.0) || c.0 + 1 == from;
                let covered: Vec<bool> = arc.covered.iter().filter(inside).map(|c| c.1).collect();
                let is_covered = covered.iter().any(|c| *c);
                if is_covered && !covered.iter().all(|c| *c) {
                    return None;
                }
                if !is_covered {
                    found.push(arc.places[part].iter().map(Place::point).collect());
                }
                from = to + 1;
            }
        }
        Some(found)
    }
}

/// Slices of the box.
const SLICES: usize = 16;

/// A direction without pattern, so that lines of symmetric surfaces are not parallel to the planes.
const NORMAL: [f64; 3] = [0.512, -0.387, 0.767];

/// The arcs of pairs in the box.
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
    let mut stream = Stream(17);
    let general: Plane = stream.complex();
    if expected.parameters == 0 {
        return Ok(found);
    }
    let section = pairs.first_section(&general, expected, control)?;
    if !section.is_complete || !expected.is_met(&section, pairs) {
        found.lost += 1;
        return Ok(found);
    }
    let from_general =
        |plane: &Plane, stream: &mut _| pairs.section(&general, &section.pairs, plane, stream);
    for k in 0..6 {
        control.check()?;
        let mut normal = [0.0; 3];
        normal[k / 2] = 1.0;
        let face = real_plane(normal, [-1.0, 1.0][k % 2]);
        let mut here = from_general(&face, &mut stream);
        if !here.is_complete {
            here = from_general(&face, &mut stream);
        }
        found.lost += usize::from(!here.is_complete);
        look(pairs, &here.pairs, true, fine, &mut found);
    }
    let mut before: Option<(Plane, Vec<Pair>)> = None;
    for k in 0..SLICES {
        control.check()?;
        let offset = 3f64.sqrt() * ((2 * k + 1) as f64 / SLICES as f64 - 1.0 + 0.013);
        let plane = real_plane(NORMAL.map(|x| x / norm(NORMAL)), offset);
        let here = before
            .as_ref()
            .map(|(from, known)| pairs.section(from, known, &plane, &mut stream));
        let mut here = here.unwrap_or_else(|| from_general(&plane, &mut stream));
        if !here.is_complete {
            here = from_general(&plane, &mut stream);
        }
        found.lost += usize::from(!here.is_complete);
        look(pairs, &here.pairs, false, fine, &mut found);
        if let Some((from, known)) = &before {
            look_between(pairs, [from, &plane], known, fine, &mut found);
        }
        before = (here.is_complete && here.outside == 0).then_some((plane, here.pairs));
    }
    found.lost += found.count_doubled(pairs);
    Pairs::unite(&mut found.arcs);
    Ok(found)
}

/// Traces the arcs that turn between two planes, and meet none of them.
///
/// Led straight from one plane to the next, pairs come to where two of them meet: an arc turns
/// there, with real pairs on one side and complex ones on the other.
fn look_between(
    pairs: &Pairs,
    planes: [&Plane; 2],
    known: &[Pair],
    fine: Fineness,
    found: &mut Arcs,
) {
    /// How far from being real, as a sine, the pairs may be where the path is given up.
    const NEARLY: f64 = 0.03;
    let path = between(*planes[0], *planes[1], C::ONE);
    for pair in known {
        let Err((_, stuck)) = pairs.follow(&path, pair) else {
            continue;
        };
        let place = pairs.place_near(&stuck, NEARLY);
        let Some(place) = place.filter(Place::is_inside) else {
            continue;
        };
        if found.find(pairs, &pairs.forms(&place)).is_none() {
            let arc = pairs.both_ways(&place, fine, &mut found.lost);
            found.arcs.push(arc);
        }
    }
}

/// Traces the arcs through the pairs of a section that are not known.
fn look(pairs: &Pairs, section: &[Pair], is_face: bool, fine: Fineness, found: &mut Arcs) {
    for pair in section {
        let Some(mut place) = pairs.place(pair) else {
            continue;
        };
        if place.pair.complex().distance(pair) > 1e-5 {
            continue;
        }
        if is_face {
            // On the face but for rounding.
            for i in 0..3 {
                let over = place.image[i].abs() / place.image[3].abs() - 1.0;
                if over.abs() < 1e-9 {
                    place.image[i] = place.image[3].abs() * place.image[i].signum();
                }
            }
        }
        if !place.is_inside() {
            continue;
        }
        let others: Vec<&Pair> = section
            .iter()
            .filter(|o| o.distance(pair) > 1e-6)
            .filter(|o| same_image(&pairs.parts(o).even.value, &place.image))
            .collect();
        let covered = others.iter().any(|other| {
            let parameters = other.parameters().map(|p| normalised(&p));
            parameters.iter().any(|p| length(&real_line(p)) < REAL)
        });
        let forms = pairs.forms(&place);
        if let Some((k, at)) = found.find(pairs, &forms) {
            found.arcs[k].covered.push((at, covered));
            continue;
        }
        let mut arc = pairs.both_ways(&place, fine, &mut found.lost);
        let at = arc.find(pairs, &forms).unwrap_or(0);
        arc.covered.push((at, covered));
        let is_known = |place: Place| found.find(pairs, &pairs.forms(&place)).is_some();
        arc.is_repeated = others.iter().any(|o| pairs.place(o).is_some_and(is_known));
        found.arcs.push(arc);
    }
}

fn same_image(a: &[C; 4], b: &[f64; 4]) -> bool {
    (0..3).all(|i| (a[i].times(b[3]) - a[3].times(b[i])).norm() < 1e-6 * (a[3].norm() * b[3].abs()))
}

impl Pairs {
    /// The arc through a place; counts ends that were lost.
    fn both_ways(&self, start: &Place, fine: Fineness, lost: &mut usize) -> Arc {
        let (ahead, end) = self.trace(start, fine);
        *lost += usize::from(end == End::Lost);
        let mut is_cut_off = end == End::Base;
        let mut places = ahead;
        if end != End::Closed {
            let (mut back, end) = self.trace(&start.turned(), fine);
            *lost += usize::from(end == End::Lost);
            is_cut_off |= end == End::Base;
            back.reverse();
            back.iter_mut().for_each(|p| *p = p.turned());
            back.extend(&places[1..]);
            places = back;
        }
        Arc {
            places,
            covered: Vec::new(),
            is_cut_off,
            is_repeated: false,
        }
    }
}
