//! Tracing of arcs of the double curve, by predictor steps along tangents and correction.

use super::Pairs;
use super::real::{Condition, Place, RealPair, dot7};
use crate::complex::{C, V};
use isoform_geom::{distance_to_segment, norm};

/// The first step, in the coordinates m, e and λ of a pair.
const FIRST_STEP: f64 = 0.02;
/// The longest step.
const LONGEST_STEP: f64 = 0.1;
/// An arc that needs a shorter step has come to its end: to a singular place, or it is lost.
const SHORTEST_STEP: f64 = 1e-10;
/// The most places of an arc.
const MOST_PLACES: usize = 100_000;
/// The least cosine of the tangents at both ends of a step: 18 degrees.
const LEAST_COSINE: f64 = 0.95;
/// The largest distance of a prediction from its place, in steps: more, and the place may be on
/// another arc.
const MOST_OFF: f64 = 0.1;
/// A prediction as good as this, in steps, lets them grow.
const LITTLE_OFF: f64 = 0.02;
/// The factor by which steps grow.
const GROWTH: f64 = 1.5;
/// Steps shorter than this need not be fine in space: next to a base point images reach far.
const FREE_STEP: f64 = 1e-7;
/// The distance from a face of the box up to which a place is on the face: where an arc begins it
/// need not go on.
const ON_FACE: f64 = 1e-10;
/// The length at which an arc that touches a face is looked at: farther than rounding, and nearer
/// than steps.
const LOOK: f64 = 1e-7;
/// The length beyond two places, in shares of their distance, within which a place between them may
/// be found.
const BEYOND: f64 = 0.1;
/// Maximum λ, and ratio of the second to the first singular value, at a singular end: both vanish
/// like the distance from it, and tracing stops about 1e-9 before it.
const ZERO: f64 = 1e-5;
/// Size below which a coordinate of a singular end is 0: such places are often on the axes of the
/// parameters.
pub(super) const NEAR: f64 = 1e-7;
/// The most that the way over a pair between two places may be longer by than the straight one:
/// tangents turn by 18 degrees, an arc of which is 1.004 times its chord.
const DETOUR: f64 = 1.03;
/// See [`DETOUR`]: rounding on very short steps.
const DETOUR_PRECISION: f64 = 1e-9;
/// Maximum distance between successive places in consistent forms: if it is larger, the forms
/// differ.
const OTHER_FORM: f64 = 0.3;
/// The distance from an arc that a pair on it may have for rounding: steps end with eight digits.
const OFF_ARC: f64 = 1e-6;

/// Reason why an arc ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum End {
    /// The arc meets a face of the box.
    Face,
    /// The arc closes.
    Closed,
    /// The arc reaches a parameter at which the rank of the differential drops to 1.
    Singular,
    /// The arc reaches a base point.
    Base,
    /// The arc could not be followed.
    Lost,
}

/// Bounds on the chords of an arc.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fineness {
    /// Maximum deviation from the arc, in half widths of the box.
    pub(crate) tolerance: f64,
    /// Maximum length, in half widths of the box.
    pub(crate) longest: f64,
}

/// An accepted step along an arc.
struct Advance {
    /// Places after its start: a pinch point that is passed, if any, and the end of the step.
    way: Vec<Place>,
    end: Option<End>,
    /// Error of the prediction.
    error: f64,
}

impl Place {
    /// Returns the place with its tangent oriented along a direction.
    fn toward(self, direction: &[f64; 7]) -> Self {
        if dot7(&self.tangent, direction) < 0.0 {
            self.turned()
        } else {
            self
        }
    }
}

impl Pairs {
    /// Returns the place of an arc next to its chord between two others, at a fraction of the
    /// chord.
    pub(crate) fn part(&self, a: &Place, b: &Place, t: f64) -> Option<Place> {
        let b = self.like(a, b)?;
        let d = a.pair.to(&b.pair);
        let (place, _) = self.correct(&a.pair.moved(&d, t), &Condition::Across(d))?;
        Some(place.toward(&d))
    }
    /// Returns the place between two others at which coordinate k of one of the real parameters
    /// vanishes.
    pub(crate) fn on_side(&self, a: &Place, b: &Place, which: usize, k: usize) -> Option<Place> {
        let b = self.like(a, b)?;
        let value = |p: &Place| p.real().map(|r| r[which][k]);
        let (x, y) = (value(a)?, value(&b)?);
        let d = a.pair.to(&b.pair);
        let start = a.pair.moved(&d, x / (x - y));
        let (place, _) = self.correct(&start, &Condition::Side(which, k))?;
        let t = dot7(&a.pair.to(&place.pair), &d) / dot7(&d, &d);
        (t > -BEYOND && t < 1.0 + BEYOND).then_some(place)
    }
    /// Returns a place in the form nearest to the place before it on an arc.
    fn like(&self, a: &Place, b: &Place) -> Option<Place> {
        let near = |b: &Place| {
            let d = a.pair.to(&b.pair);
            dot7(&d, &d)
        };
        let other = self.flipped(b)?;
        Some(if near(&other) < near(b) { other } else { *b })
    }
    /// Returns the place halfway between two others with equal signs.
    fn halfway(&self, a: &Place, b: &Place) -> Option<Place> {
        let d = a.pair.to(&b.pair);
        let found = self.correct(&a.pair.moved(&d, 0.5), &Condition::Across(d));
        found.map(|p| p.0)
    }

    /// Traces an arc in the direction of its tangent, and returns its places.
    pub(super) fn trace(&self, start: &Place, fine: Fineness) -> (Vec<Place>, End) {
        let forms = self.forms(start);
        let mut nodes = vec![*start];
        let mut step = FIRST_STEP;
        while nodes.len() < MOST_PLACES {
            let here = nodes[nodes.len() - 1];
            let Some(Advance { way, end, error }) = self.advance(&here, step, fine) else {
                step /= 2.0;
                if step < SHORTEST_STEP {
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
            if error < LITTLE_OFF * step {
                step = (GROWTH * step).min(LONGEST_STEP);
            }
        }
        (nodes, End::Lost)
    }

    /// Makes one step along an arc; `None` if it is too long.
    fn advance(&self, here: &Place, step: f64, fine: Fineness) -> Option<Advance> {
        let predicted = here.pair.moved(&here.tangent, step);
        let (next, error) = self.correct(&predicted, &Condition::Across(here.tangent))?;
        let mut next = next.toward(&here.tangent);
        if dot7(&here.tangent, &next.tangent) < LEAST_COSINE || error > MOST_OFF * step {
            return None;
        }
        let mut end = None;
        let mut way = Vec::new();
        if !next.is_inside() {
            (next, end) = (self.face_between(here, &next)?, Some(End::Face));
            if here.pair.distance(&next.pair) < ON_FACE {
                // A step that is too long may lead into the box and out again.
                return (!self.goes_in(here)).then_some(Advance { way, end, error });
            }
        }
        if here.pair.l * next.pair.l < 0.0 {
            way.push(self.pinch_between(here, &next)?);
        }
        way.push(next);
        let mut from = here;
        for to in &way {
            let is_fine = self.is_fine(from, to, fine)?;
            if !is_fine && step > FREE_STEP {
                return None;
            }
            from = to;
        }
        Some(Advance { way, end, error })
    }
    /// Returns true if the chord between two places is short, and near to the arc.
    fn is_fine(&self, from: &Place, to: &Place, fine: Fineness) -> Option<bool> {
        let middle = self.halfway(from, to)?;
        let ends = [from.point(), to.point()];
        let long = norm([0, 1, 2].map(|i| ends[1][i] - ends[0][i]));
        let off = distance_to_segment(middle.point(), ends);
        let is_too_coarse = off > fine.tolerance || long > fine.longest;
        Some(!is_too_coarse)
    }

    /// Returns true if an arc leads into the box from a place on a face.
    fn goes_in(&self, here: &Place) -> bool {
        let ahead = here.pair.moved(&here.tangent, LOOK);
        let found = self.correct(&ahead, &Condition::Across(here.tangent));
        found.is_some_and(|(place, _)| place.is_inside())
    }

    /// Returns the place near to a pair in the plane of the face of the box on which coordinate i
    /// is `side`, with its tangent oriented along another one.
    fn on_face(
        &self,
        near: &RealPair,
        tangent: &[f64; 7],
        (i, side): (usize, f64),
    ) -> Option<Place> {
        let (place, _) = self.correct(near, &Condition::Plane(face_plane(i, side)))?;
        let mut place = place.toward(tangent);
        place.image[i] = side * place.image[3];
        Some(place)
    }
    /// Returns the place at which an arc first leaves the box between two places.
    fn face_between(&self, a: &Place, b: &Place) -> Option<Place> {
        let d = a.pair.to(&b.pair);
        let mut best: Option<(f64, Place)> = None;
        for (i, side) in (0..3).flat_map(|i| [(i, -1.0), (i, 1.0)]) {
            // The images are scaled to a positive W.
            let value = |p: &Place| p.image[i] / p.image[3] - side;
            let (x, y) = (value(a), value(b));
            if x * side > 0.0 || y * side <= 0.0 {
                continue;
            }
            let t = x / (x - y);
            let place = self.on_face(&a.pair.moved(&d, t), &a.tangent, (i, side))?;
            if place.is_inside() && best.is_none_or(|b| t < b.0) {
                best = Some((t, place));
            }
        }
        best.map(|b| b.1)
    }

    /// Returns the pinch point between two places.
    fn pinch_between(&self, a: &Place, b: &Place) -> Option<Place> {
        let t = a.pair.l / (a.pair.l - b.pair.l);
        let d = a.pair.to(&b.pair);
        let (place, _) = self.correct(&a.pair.moved(&d, t), &Condition::Pinch)?;
        Some(place.toward(&a.tangent))
    }

    /// Returns the end of an arc near to a place, if its two parameters coincide there and the
    /// differential has the rank 1.
    fn singular_end(&self, here: &Place) -> Option<Place> {
        let m = here.pair.m.map(|x| C::new(x, 0.0));
        let (minors, size) = minors_and_size(&self.at(&m).1);
        let snapped = here.pair.m.map(|x| if x.abs() < NEAR { 0.0 } else { x });
        let is_singular = here.pair.l.abs() < ZERO && minors.sqrt() < ZERO * size;
        is_singular.then_some(Place {
            pair: RealPair {
                m: snapped,
                l: 0.0,
                ..here.pair
            },
            ..*here
        })
    }

    /// Returns true if a pair, given by its forms, lies on an arc between two successive places,
    /// whose tangents differ by little.
    ///
    /// The comparison does not use its parameters: these differ by the root of λ, whose direction
    /// turns where λ vanishes.
    pub(super) fn is_between(&self, forms: &[RealPair], a: &Place, b: &Place) -> bool {
        let (mut from, mut to) = (a.pair, b.pair);
        if from.distance(&to) > OTHER_FORM {
            to = from.nearest(&self.forms(b));
        }
        if from.distance(&to) > OTHER_FORM {
            (from, to) = (b.pair.nearest(&self.forms(a)), b.pair);
        }
        let (d, length) = (from.to(&to), from.distance(&to));
        let is_near = |x: &RealPair| {
            let detour = from.distance(x) + x.distance(&to);
            detour <= DETOUR * length + DETOUR_PRECISION
        };
        // Other pairs may be as near to a long step: the arc's place next to the pair decides.
        let is_on = |x: &RealPair| {
            let t = dot7(&from.to(x), &d) / (length * length);
            let here = self.correct(&from.moved(&d, t), &Condition::Across(d));
            // Scaling has moved the place along the arc.
            length < OFF_ARC || here.is_none_or(|(here, _)| here.is_in_line(x, OFF_ARC))
        };
        forms.iter().any(|x| is_near(x) && is_on(x))
    }
}

/// Returns the sum of the squares of the 2 × 2 minors of a real Jacobian, and that of its entries.
fn minors_and_size(df: &[V; 4]) -> (f64, f64) {
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
    (minors, size)
}

/// Returns the plane of the face of the box on which coordinate i is `side`, −1 or 1.
fn face_plane(i: usize, side: f64) -> [f64; 4] {
    let mut plane = [0.0; 4];
    plane[i] = 1.0;
    plane[3] = -side;
    plane
}
