//! Tracing of arcs of the double curve, by predictor steps along tangents and correction.

use super::Pairs;
use super::real::{ArcPlace, Condition, RealPair, dot7};
use crate::complex::{C, V};
use crate::stepping::{
    ErrorBounds, FIRST_STEP_LENGTH, FREE_STEP_LENGTH, MAX_BRANCH_POINTS, halved_step,
    is_short_detour,
};
use isoform_geom::{distance_to_segment, norm};

/// Bounds on prediction errors along arcs of the double curve, where a larger error may lead to
/// another arc.
const ERROR_BOUNDS: ErrorBounds = ErrorBounds {
    rejecting: 0.1,
    growing: 0.02,
};

/// Distance up to which a coordinate of a singular end is rounded to 0, as such places are often on
/// the axes of the parameters, and up to which two singular ends are identified.
pub(super) const SNAP_DISTANCE: f64 = 1e-7;
/// Maximum distance between successive places in consistent forms: if it is larger, the forms
/// differ.
const MAX_FORM_DISTANCE: f64 = 0.3;

/// Reason why an arc ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ArcEnd {
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
struct ArcStep {
    /// Places after its start: a pinch point that is passed, if any, and the end of the step.
    way: Vec<ArcPlace>,
    end: Option<ArcEnd>,
    /// Error of the prediction.
    error: f64,
}

impl ArcPlace {
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
    pub(crate) fn part(&self, a: &ArcPlace, b: &ArcPlace, t: f64) -> Option<ArcPlace> {
        let b = self.like(a, b)?;
        let d = a.pair.to(&b.pair);
        let (place, _) = self.correct(&a.pair.moved(&d, t), &Condition::Across(d))?;
        Some(place.toward(&d))
    }
    /// Returns the place between two others at which coordinate k of one of the real parameters
    /// vanishes.
    pub(crate) fn on_side(
        &self,
        a: &ArcPlace,
        b: &ArcPlace,
        which: usize,
        k: usize,
    ) -> Option<ArcPlace> {
        let b = self.like(a, b)?;
        let value = |p: &ArcPlace| p.real().map(|r| r[which][k]);
        let (x, y) = (value(a)?, value(&b)?);
        let d = a.pair.to(&b.pair);
        let start = a.pair.moved(&d, x / (x - y));
        let (place, _) = self.correct(&start, &Condition::Side(which, k))?;
        let t = dot7(&a.pair.to(&place.pair), &d) / dot7(&d, &d);
        // A place may lie beyond its neighbours by a tenth of their distance.
        (t > -0.1 && t < 1.1).then_some(place)
    }
    /// Returns a place in the form nearest to the place before it on an arc.
    fn like(&self, a: &ArcPlace, b: &ArcPlace) -> Option<ArcPlace> {
        let near = |b: &ArcPlace| {
            let d = a.pair.to(&b.pair);
            dot7(&d, &d)
        };
        let other = self.flipped(b)?;
        Some(if near(&other) < near(b) { other } else { *b })
    }
    /// Returns the place halfway between two others with equal signs.
    fn halfway(&self, a: &ArcPlace, b: &ArcPlace) -> Option<ArcPlace> {
        let d = a.pair.to(&b.pair);
        let found = self.correct(&a.pair.moved(&d, 0.5), &Condition::Across(d));
        found.map(|p| p.0)
    }

    /// Traces an arc in the direction of its tangent, and returns its places.
    pub(super) fn trace(&self, start: &ArcPlace, fine: Fineness) -> (Vec<ArcPlace>, ArcEnd) {
        let forms = self.forms(start);
        let mut nodes = vec![*start];
        let mut step = FIRST_STEP_LENGTH;
        while nodes.len() < MAX_BRANCH_POINTS {
            let here = nodes[nodes.len() - 1];
            let Some(ArcStep { way, end, error }) = self.advance(&here, step, fine) else {
                let Some(half) = halved_step(step) else {
                    let end = self.singular_end(&here);
                    nodes.extend(end);
                    return (nodes, end.map_or(ArcEnd::Lost, |_| ArcEnd::Singular));
                };
                step = half;
                continue;
            };
            for next in way {
                let last = nodes[nodes.len() - 1];
                if nodes.len() > 2 && self.is_between(&forms, &last, &next) {
                    nodes.push(*start);
                    return (nodes, ArcEnd::Closed);
                }
                nodes.push(next);
            }
            if let Some(end) = end {
                return (nodes, end);
            }
            let last = nodes.len() - 1;
            if nodes[last].pair.is_at_base_point(self.degree) {
                return (nodes, ArcEnd::Base);
            }
            let Some(righted) = self.righted(&nodes[last]) else {
                return (nodes, ArcEnd::Lost);
            };
            nodes[last] = righted;
            step = ERROR_BOUNDS.next_step(step, error);
        }
        (nodes, ArcEnd::Lost)
    }

    /// Makes one step along an arc; `None` if it is too long.
    fn advance(&self, here: &ArcPlace, step: f64, fine: Fineness) -> Option<ArcStep> {
        let predicted = here.pair.moved(&here.tangent, step);
        let (next, error) = self.correct(&predicted, &Condition::Across(here.tangent))?;
        let mut next = next.toward(&here.tangent);
        if ERROR_BOUNDS.rejects(step, dot7(&here.tangent, &next.tangent), error) {
            return None;
        }
        let mut end = None;
        let mut way = Vec::new();
        if !next.is_inside() {
            (next, end) = (self.face_between(here, &next)?, Some(ArcEnd::Face));
            // Where an arc begins on a face it need not go on.
            if here.pair.distance(&next.pair) < 1e-10 {
                // A step that is too long may lead into the box and out again.
                return (!self.goes_in(here)).then_some(ArcStep { way, end, error });
            }
        }
        if here.pair.l * next.pair.l < 0.0 {
            way.push(self.pinch_between(here, &next)?);
        }
        way.push(next);
        let mut from = here;
        for to in &way {
            let is_fine = self.is_fine(from, to, fine)?;
            if !is_fine && step > FREE_STEP_LENGTH {
                return None;
            }
            from = to;
        }
        Some(ArcStep { way, end, error })
    }
    /// Returns true if the chord between two places is short, and near to the arc.
    fn is_fine(&self, from: &ArcPlace, to: &ArcPlace, fine: Fineness) -> Option<bool> {
        let middle = self.halfway(from, to)?;
        let ends = [from.point(), to.point()];
        let long = norm([0, 1, 2].map(|i| ends[1][i] - ends[0][i]));
        let off = distance_to_segment(middle.point(), ends);
        let is_too_coarse = off > fine.tolerance || long > fine.longest;
        Some(!is_too_coarse)
    }

    /// Returns true if an arc leads into the box from a place on a face.
    fn goes_in(&self, here: &ArcPlace) -> bool {
        // Farther than rounding, nearer than steps.
        let ahead = here.pair.moved(&here.tangent, 1e-7);
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
    ) -> Option<ArcPlace> {
        let (place, _) = self.correct(near, &Condition::Plane(face_plane(i, side)))?;
        let mut place = place.toward(tangent);
        place.image[i] = side * place.image[3];
        Some(place)
    }
    /// Returns the place at which an arc first leaves the box between two places.
    fn face_between(&self, a: &ArcPlace, b: &ArcPlace) -> Option<ArcPlace> {
        let d = a.pair.to(&b.pair);
        let mut best: Option<(f64, ArcPlace)> = None;
        for (i, side) in (0..3).flat_map(|i| [(i, -1.0), (i, 1.0)]) {
            // The images are scaled to a positive W.
            let value = |p: &ArcPlace| p.image[i] / p.image[3] - side;
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
    fn pinch_between(&self, a: &ArcPlace, b: &ArcPlace) -> Option<ArcPlace> {
        let t = a.pair.l / (a.pair.l - b.pair.l);
        let d = a.pair.to(&b.pair);
        let (place, _) = self.correct(&a.pair.moved(&d, t), &Condition::Pinch)?;
        Some(place.toward(&a.tangent))
    }

    /// Returns the end of an arc near to a place, if its two parameters coincide there and the
    /// differential has the rank 1.
    fn singular_end(&self, here: &ArcPlace) -> Option<ArcPlace> {
        let m = here.pair.m.map(|x| C::new(x, 0.0));
        let (minors, size) = minors_and_size(&self.at(&m).1);
        let snapped = here
            .pair
            .m
            .map(|x| if x.abs() < SNAP_DISTANCE { 0.0 } else { x });
        // Both values are proportional to the distance from the end, and tracing stops about 1e-9
        // before it.
        let is_singular = here.pair.l.abs() < 1e-5 && minors.sqrt() < 1e-5 * size;
        is_singular.then_some(ArcPlace {
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
    pub(super) fn is_between(&self, forms: &[RealPair], a: &ArcPlace, b: &ArcPlace) -> bool {
        let (mut from, mut to) = (a.pair, b.pair);
        if from.distance(&to) > MAX_FORM_DISTANCE {
            to = from.nearest(&self.forms(b));
        }
        if from.distance(&to) > MAX_FORM_DISTANCE {
            (from, to) = (b.pair.nearest(&self.forms(a)), b.pair);
        }
        let (d, length) = (from.to(&to), from.distance(&to));
        let is_near = |x: &RealPair| {
            let detour = from.distance(x) + x.distance(&to);
            is_short_detour(detour, length)
        };
        // Other pairs may be as near to a long step: the arc's place next to the pair decides.
        let is_on = |x: &RealPair| {
            let t = dot7(&from.to(x), &d) / (length * length);
            let here = self.correct(&from.moved(&d, t), &Condition::Across(d));
            // Scaling has moved the place along the arc.
            // Steps end with eight digits: the arc is known up to 1e-6.
            length < 1e-6 || here.is_none_or(|(here, _)| here.is_in_line(x, 1e-6))
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
