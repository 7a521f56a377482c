//! Pinch points, and solitary curves: real points of a surface that only pairs of complex conjugate
//! parameters reach.
//!
//! A map of degree 1 takes a non-real parameter p to a real point only where it takes the conjugate
//! of p to the same point: p lies on the double locus D. Along an irreducible factor f of D that is
//! not contracted, real points are the solutions of f(p) = 0, Im φ(p) = 0, of which one real
//! equation is left where f = 0 is smooth; where it is not, the second condition alone still has
//! the rank 3 of a curve as long as the sheets at p and at its conjugate cross. Both together are
//! solved by Gauss–Newton (`solution`), in the affine chart of the complex projective plane around
//! the point itself, so that no parameter is at infinity.
//!
//! An improper map may take whole regions of non-real parameters to real points, where a deck
//! transformation gives the conjugate. Of these only what lies on D is found.
//!
//! A real base point is blown up to a line, of which a pair of conjugate directions may reach real
//! points, too (the conoid of Plücker): its seam curves are traced in the same way, as maps of the
//! line c = 0 in a plane (a : b : c).
//!
//! Curves are found by sections (`section`): the points of f = 0 in a general complex plane of
//! space, from those on lines of the parameter plane by homotopy, are carried to planes that cut
//! the box into slices, and to its faces. From there they are followed (`trace`).
//!
//! - *source*: a curve of parameters with a map into space: a factor f with φ, or a seam.
//! - *section*: the points of a source whose images lie in a plane.
//! - *hit*: a point of a section with a real image, but no real parameter.
//! - *covered*: a point that a real parameter reaches, too; it is on no solitary curve.
//!
//! All of this is in half widths of the box.

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
use search::{Partner, Search};

/// Parameters are one if the sine of their angle is at most this: half of the digits are lost next
/// to folds and pinch points. Larger, and partners near a pinch point are taken for one; smaller,
/// and a parameter is taken for a partner of itself.
const SAME_PARAMETER: f64 = 1e-5;
/// The tolerance of a search that follows no curves.
const UNUSED_TOLERANCE: f64 = 1e-3;

/// Solitary curves in the box |x|, |y|, |z| ≤ `half_width`, as polylines whose vertices lie on them
/// up to rounding and whose chords leave them by at most about `tolerance`, and what could not be
/// completed; nothing if all is well.
///
/// The points of these curves have no real parameter, apart from isolated ones, but a pair of
/// conjugate ones; conjugate directions of real base points are included. The curves end at pinch
/// points, where the pair becomes real, at faces of the box, and where a real parameter joins them.
/// The first point of a closed curve is repeated as its last. Curves that lie between two of the
/// planes by which they are looked for (a seventh to a seventeenth of the box's diagonal apart in
/// each of three directions, the fewer points are followed the nearer), and reach neither a face
/// nor a pinch point, may be missed.
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
    let mut search = Search::new(tolerance / half_width);
    if search.run(map, singular, half_width, control).is_err() {
        search.problems.push(Finding::Stopped(Phase::SolitaryArcs));
    }
    for x in search.arcs.iter_mut().flatten() {
        *x = x.map(|v| v * half_width);
    }
    (search.arcs, search.problems)
}

/// The parameters of points of the double curve.
pub(crate) struct Fibres {
    search: Search,
    half_width: f64,
    /// The number of sources that are curves of parameters: the rest are seams.
    curves: usize,
}

impl Fibres {
    pub(crate) fn new(
        map: &Map,
        singular: &Singular,
        half_width: f64,
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        let mut search = Search::new(UNUSED_TOLERANCE);
        search.prepare(map, singular, half_width, control)?;
        let curves = curves_of(map, singular).count();
        Ok(Self {
            search,
            half_width,
            curves,
        })
    }
    /// All parameters of a point, in units of space, on double curves.
    fn over(&self, [x, y, z]: [f64; 3]) -> Vec<Partner> {
        let b = self.half_width;
        self.search.fibre(&[x / b, y / b, z / b, 1.0])
    }
    /// Whether one real parameter and conjugate ones lead to a point, and nothing else. Those that
    /// deck transformations exchange count as one.
    pub(crate) fn is_met_by_conjugates(&self, p: [f64; 3], deck: Option<&Deck>) -> bool {
        let found = self.over(p);
        let real: Vec<&V> = found.iter().filter(|f| f.is_real).map(|f| &f.p).collect();
        let is_one = |p: &V, q: &V| {
            distance(p, q) < SAME_PARAMETER
                || deck.is_some_and(|d| d.may_exchange(real_point(p), real_point(q)))
        };
        found.len() > real.len() && real.windows(2).all(|w| is_one(w[0], w[1]))
    }
    /// Whether all the partners of a real parameter (s : t : w) with a given image were found to be
    /// conjugate or in a part of the plane.
    pub(crate) fn is_alone(
        &self,
        p: [f64; 3],
        own: [f64; 3],
        is_elsewhere: &dyn Fn([f64; 3]) -> bool,
    ) -> bool {
        let own = normalised(&own.map(|x| C::new(x, 0.0)));
        let mut others = self.over(p);
        others.retain(|f| !f.is_real || distance(&f.p, &own) > SAME_PARAMETER);
        let is_left_out =
            |f: &Partner| !f.is_real || f.source < self.curves && is_elsewhere(real_point(&f.p));
        !others.is_empty() && others.iter().all(is_left_out)
    }
}

/// The curves with images that are curves in space.
pub(crate) fn curves_of<'a>(
    map: &'a Map,
    singular: &'a Singular,
) -> impl Iterator<Item = &'a SingularCurve> {
    let is_left_out = |c: &&SingularCurve| {
        matches!(c.kind, CurveKind::Contracted(_)) || map.forms()[3].is_multiple_of(&c.curve)
    };
    singular.curves.iter().filter(move |c| !is_left_out(c))
}
