//! Pinch points, and solitary curves: real points of a surface that are reached only by pairs of
//! complex conjugate parameters.
//!
//! A map of degree 1 sends a non-real parameter p to a real point only if it sends the conjugate of
//! p to that point: p lies on the double locus D. Along an irreducible factor f of D that is
//! not contracted, real points are the solutions of f(p) = 0, Im φ(p) = 0. Of the second condition
//! one real equation remains where f = 0 is smooth. At a singular point of f = 0, the second
//! condition alone still has the rank 3 of a curve, as long as the sheets at p and at its conjugate
//! cross. Gauss–Newton (`solution`) solves both together, in the affine chart of the complex
//! projective plane around the point itself, so that no parameter is at infinity.
//!
//! An improper map may send whole regions of non-real parameters to real points, where a deck
//! transformation maps a parameter to its conjugate. Of these, only the points on D are found.
//!
//! A real base point is blown up to a line, of which a pair of conjugate directions may reach real
//! points, too (the conoid of Plücker): its seam curves are traced likewise, as maps of the
//! line c = 0 in a plane (a : b : c).
//!
//! Curves are found by sections (`section`): the points of f = 0 in a general complex plane of
//! space, computed by homotopy from those on lines of the parameter plane, are tracked to planes
//! that cut the box into slices, and to its faces. From there the curves are traced (`trace`).
//!
//! - *source*: a curve of parameters with a map into space: a factor f with φ, or a seam.
//! - *section*: the points of a source whose images lie in a plane.
//! - *hit*: a point of a section with a real image, but a non-real parameter.
//! - *covered*: a point that a real parameter reaches, too; it lies on no solitary curve.
//!
//! All lengths are in half widths of the box.

mod pinch;
mod search;
mod section;
mod solution;
mod source;
mod trace;

pub use pinch::pinch_points;

use crate::complex::{C, V, distance, normalised, real_point};
use crate::deck::Deck;
use crate::finding::{Finding, Phase};
use crate::map::Map;
use crate::singular::{CurveKind, Singular, SingularCurve};
use isoform_control::{Control, Stopped};
use search::{Partner, SolitarySearch};

/// Sine of the angle up to which two parameters are taken for one: half of the digits are lost next
/// to folds and pinch points. If it is larger, partners near a pinch point coincide; if it is
/// smaller, a parameter is taken for a partner of itself.
const SAME_PARAMETER_SINE: f64 = 1e-5;

/// Finds the solitary curves in the box |x|, |y|, |z| ≤ `half_width`, as polylines whose vertices
/// lie on them up to rounding and whose chords deviate by at most about `tolerance`. The findings,
/// empty if the search succeeds, say what could not be completed.
///
/// Apart from isolated points, these curves are reached by pairs of conjugate parameters only;
/// conjugate directions of real base points are included. The curves end at pinch points, where the
/// pair becomes real, at faces of the box, and where a real parameter joins them. The first point
/// of a closed curve is repeated as its last. The search uses parallel planes in three directions,
/// a seventh to a seventeenth of the box's diagonal apart: the fewer points have to be tracked, the
/// denser they are. A curve that lies between two such planes and reaches neither a face nor a
/// pinch point may be missed.
pub fn solitary_arcs(
    map: &Map,
    singular: &Singular,
    half_width: f64,
    tolerance: f64,
    control: &Control<'_>,
) -> (Vec<Vec<[f64; 3]>>, Vec<Finding>) {
    if singular.double.is_none() {
        return (Vec::new(), vec![Finding::DoubleLocusUnknown]);
    }
    let mut search = SolitarySearch::new(tolerance / half_width);
    if search.run(map, singular, half_width, control).is_err() {
        search.problems.push(Finding::Stopped(Phase::SolitaryArcs));
    }
    for x in search.arcs.iter_mut().flatten() {
        *x = x.map(|v| v * half_width);
    }
    (search.arcs, search.problems)
}

/// Parameters of points of the double curve, found on demand.
pub(crate) struct Fibres {
    search: SolitarySearch,
    half_width: f64,
    /// Number of sources that are curves of parameters; the others are seams.
    curves: usize,
}

impl Fibres {
    pub(crate) fn new(
        map: &Map,
        singular: &Singular,
        half_width: f64,
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        // No curves are traced, so that the tolerance is unused.
        let mut search = SolitarySearch::new(1e-3);
        search.prepare(map, singular, half_width, control)?;
        let curves = curves_of(map, singular).count();
        Ok(Self {
            search,
            half_width,
            curves,
        })
    }
    /// Returns all parameters on double curves of a point in units of space.
    fn over(&self, [x, y, z]: [f64; 3]) -> Vec<Partner> {
        let b = self.half_width;
        self.search.fibre(&[x / b, y / b, z / b, 1.0])
    }
    /// Returns true if one real parameter and conjugate ones reach a point, and no other ones do.
    /// Parameters exchanged by deck transformations count as one.
    pub(crate) fn is_met_by_conjugates(&self, p: [f64; 3], deck: Option<&Deck>) -> bool {
        let found = self.over(p);
        let real: Vec<&V> = found.iter().filter(|f| f.is_real).map(|f| &f.p).collect();
        let is_one = |p: &V, q: &V| {
            distance(p, q) < SAME_PARAMETER_SINE
                || deck.is_some_and(|d| d.may_exchange(real_point(p), real_point(q)))
        };
        found.len() > real.len() && real.windows(2).all(|w| is_one(w[0], w[1]))
    }
    /// Returns true if all partners of a real parameter `own` (s : t : w) with the image `p` are
    /// conjugate, or in the part of the plane given by `is_elsewhere`.
    pub(crate) fn is_alone(
        &self,
        p: [f64; 3],
        own: [f64; 3],
        is_elsewhere: &dyn Fn([f64; 3]) -> bool,
    ) -> bool {
        let own = normalised(&own.map(|x| C::new(x, 0.0)));
        let mut others = self.over(p);
        others.retain(|f| !f.is_real || distance(&f.p, &own) > SAME_PARAMETER_SINE);
        let is_left_out =
            |f: &Partner| !f.is_real || f.source < self.curves && is_elsewhere(real_point(&f.p));
        !others.is_empty() && others.iter().all(is_left_out)
    }
}

/// Iterates over the singular curves whose images are curves in space.
pub(crate) fn curves_of<'a>(
    map: &'a Map,
    singular: &'a Singular,
) -> impl Iterator<Item = &'a SingularCurve> {
    let is_left_out = |c: &&SingularCurve| {
        matches!(c.kind, CurveKind::Contracted(_)) || map.forms()[3].is_multiple_of(&c.curve)
    };
    singular.curves.iter().filter(move |c| !is_left_out(c))
}
