//! Transfer of the vertices of the double curve to sides, lines and spokes, and its arcs in space.

use super::pieces::{CurvePiece, CurvePieces, PieceVertex};
use super::{Gluing, Track};
use crate::double::Fibres;
use crate::finding::{Finding, JoinedCurve};
use crate::mesh::names::ClassId;
use crate::mesh::opening::Openings;
use crate::mesh::places::in_plane;
use crate::mesh::sides::Sides;
use crate::mesh::stretch::Columns;
use crate::surface::{DoubleArc, Point3};
use std::collections::{BTreeMap, BTreeSet};

/// Edge of the double curve: the classes of its ends, the smaller one first.
type Edge = [ClassId; 2];

fn edge(a: ClassId, b: ClassId) -> Edge {
    [a.min(b), a.max(b)]
}

/// Number of sheets that meet in each edge of the double curve.
struct SheetCounts {
    of: BTreeMap<Edge, usize>,
    /// Edges that belong to an arc.
    done: BTreeSet<Edge>,
}

impl SheetCounts {
    fn new(pieces: &[CurvePiece]) -> Self {
        let mut of: BTreeMap<Edge, usize> = BTreeMap::new();
        for w in pieces.iter().flat_map(|p| p.knots.windows(2)) {
            if let [Some(a), Some(b)] = [w[0].class, w[1].class] {
                *of.entry(edge(a, b)).or_default() += 1;
            }
        }
        let done = BTreeSet::new();
        Self { of, done }
    }
    fn at(&self, edge: &Edge) -> usize {
        self.of.get(edge).copied().unwrap_or(0)
    }
    /// Returns true if fewer than two sheets meet in an edge, or if one of its ends has no class.
    fn is_single(&self, ends: &[PieceVertex]) -> bool {
        match [ends[0].class, ends[1].class] {
            [Some(a), Some(b)] => self.at(&edge(a, b)) < 2,
            _ => true,
        }
    }
    /// Returns the arcs along a piece, given by the classes of its vertices, that are not part of a
    /// previous piece: runs of classes with a constant number of sheets.
    fn arcs(&mut self, classes: &[ClassId]) -> Vec<(Vec<ClassId>, usize)> {
        let mut found = Vec::new();
        let mut run: Vec<ClassId> = Vec::new();
        let mut sheets = 0;
        for w in classes.windows(2) {
            let edge = edge(w[0], w[1]);
            let n = self.at(&edge);
            if !self.done.insert(edge) || (n != sheets && !run.is_empty()) {
                found.push((std::mem::take(&mut run), sheets));
            }
            if run.last() != Some(&w[0]) {
                run = vec![w[0]];
            }
            if self.of.remove(&edge).is_some() {
                sheets = n;
                run.push(w[1]);
            } else {
                run.clear();
            }
        }
        found.push((run, sheets));
        found.retain(|(run, sheets)| run.len() > 1 && *sheets > 1);
        found
    }
}

fn middle(ends: &[PieceVertex]) -> [f64; 2] {
    [0, 1].map(|i| 0.5 * (ends[0].at[i] + ends[1].at[i]))
}

impl CurvePieces<'_> {
    /// Names the vertices and stores them as places on sides, lines and spokes; stores the arcs in
    /// space along which sheets meet.
    pub(super) fn settle(self, gluing: &mut Gluing, sides: &mut Sides, fibres: Option<&Fibres>) {
        let Self { open, pieces } = self;
        let mut sheets = SheetCounts::new(&pieces);
        let alone = |piece: &CurvePiece| open.edges_without_partner(piece, &sheets, fibres);
        let edges: usize = pieces.iter().map(alone).sum();
        gluing.findings.extend(open.partners_missing(edges));
        for mut piece in pieces {
            if !open.is_border(&piece) {
                let classes: Vec<ClassId> = piece.knots.iter().filter_map(|k| k.class).collect();
                gluing.meeting.extend(&classes);
                for (run, sheets) in sheets.arcs(&classes) {
                    let points = run.iter().map(|&c| gluing.image(c)).collect();
                    gluing.arcs.push(DoubleArc { points, sheets });
                }
            }
            let named = piece.knots.iter().filter_map(|k| Some((k.key, k.class?)));
            named.for_each(|(key, class)| gluing.name_class(key, class));
            open.take_spokes(&mut piece, gluing);
            hand_over(&piece, gluing, sides);
        }
    }
}

/// Stores the vertices of a piece on its side or line.
fn hand_over(piece: &CurvePiece, gluing: &mut Gluing, sides: &mut Sides) {
    match piece.track {
        Track::Side(side, sign, _) => {
            let places = sides.get_mut(&(side, sign)).expect("the side");
            let (Some(first), Some(last)) = (piece.knots.first(), piece.knots.last()) else {
                return;
            };
            let (from, to) = (piece.along(first.at), piece.along(last.at));
            places.retain(|p| p.0 <= from || p.0 >= to);
            let at = places.partition_point(|p| p.0 <= from);
            let inner = piece.knots[1..piece.knots.len() - 1].iter();
            places.splice(at..at, inner.map(|k| (piece.along(k.at), true)));
        }
        Track::Seam(..) => {}
        track => gluing.set_line(track, piece.knots.iter().map(|k| k.at).collect()),
    }
}

impl Openings<'_> {
    /// Returns the image of a point of an edge, if possible of one that is not an end of its piece.
    fn image_between(&self, piece: &CurvePiece, ends: &[PieceVertex]) -> Point3 {
        match ends.iter().find(|k| !k.fixed) {
            Some(knot) => knot.image,
            None if piece.is_seam() => ends[0].image,
            None => self.atlas.charts[piece.q].at(middle(ends)),
        }
    }
    /// Returns the finding about edges without a partner, if there are any.
    fn partners_missing(&self, edges: usize) -> Option<Finding> {
        let curve = match self.curves.glued {
            true => JoinedCurve::Double,
            false => JoinedCurve::FundamentalDomain,
        };
        (edges > 0).then_some(Finding::PartnersMissing { edges, curve })
    }
    /// Returns the number of edges of a piece that have one sheet and should have more. Each piece
    /// needs two sheets, unless a pinch point folds one sheet onto itself or the partner parameters
    /// are complex.
    fn edges_without_partner(
        &self,
        piece: &CurvePiece,
        sheets: &SheetCounts,
        fibres: Option<&Fibres>,
    ) -> usize {
        if self.is_fold(piece) {
            return 0;
        }
        let edges = piece.knots.windows(2);
        let mut single: Vec<&[PieceVertex]> = edges.filter(|w| sheets.is_single(w)).collect();
        // Partners may be outside of the domain along a part of the piece only.
        if let (Some(_), Some(fibres), false) = (&self.atlas.region.domain, fibres, piece.is_seam())
        {
            single.retain(|ends| !self.is_alone_in_domain(piece, ends, fibres));
        }
        let Some(ends) = single.get(single.len() / 2) else {
            return 0;
        };
        let image = self.image_between(piece, ends);
        let deck = self.atlas.region.deck.as_ref();
        match fibres.is_some_and(|f| f.is_met_by_conjugates(image, deck)) {
            true => 0,
            false => single.len(),
        }
    }
    /// Returns true if all partners of an edge are outside of the domain.
    fn is_alone_in_domain(
        &self,
        piece: &CurvePiece,
        ends: &[PieceVertex],
        fibres: &Fibres,
    ) -> bool {
        let at = self.on_curve_of(piece, middle(ends));
        let domain = self.atlas.region.domain.as_ref();
        let is_outside = |p: [f64; 3]| domain.is_some_and(|d| d.is_outside(p));
        let image = self.atlas.charts[piece.q].at(at);
        fibres.is_alone(image, in_plane(piece.q, at), &is_outside)
    }

    /// Moves the vertices between base points and their rectangles from a piece to the spokes.
    fn take_spokes(&self, piece: &mut CurvePiece, gluing: &mut Gluing) {
        for (end, ray) in piece.rays.into_iter().enumerate() {
            let Some((fan, ray)) = ray else { continue };
            if end == 1 {
                piece.knots.reverse();
            }
            let first = (1..piece.knots.len())
                .find(|&j| piece.knots[j].fixed && self.is_ring(piece, &piece.knots[j]))
                .unwrap_or(1);
            let ring = piece
                .knots
                .get(first)
                .map_or([0; 2], |k| k.at.map(f64::to_bits));
            let inner: Vec<PieceVertex> = piece.knots.drain(..first).collect();
            let outward = inner[1..].iter().rev();
            let list = outward.filter_map(|k| Some((k.class?, k.at))).collect();
            gluing.spokes.insert((fan, ray, ring), list);
            if end == 1 {
                piece.knots.reverse();
            }
        }
    }
    /// Returns true if a vertex of a piece is on a rectangle around a base point.
    fn is_ring(&self, piece: &CurvePiece, knot: &PieceVertex) -> bool {
        let x = knot.at;
        self.sites
            .iter()
            .filter(|s| s.0.0 == piece.q || matches!(piece.track, Track::Side(..)))
            .any(|(_, s)| {
                let (h, v) = (self.widths[s.fan], s.height);
                let on_arc = s.arcs.iter().any(|a| a.end == x);
                on_arc || (x[0] - s.at[0]).abs() == h || (x[1] - s.at[1]).abs() == v
            })
    }

    /// Returns true if a piece is on the border of a fundamental domain and the surface continues
    /// there.
    fn is_border(&self, piece: &CurvePiece) -> bool {
        let deck = self.atlas.region.deck.as_ref();
        let is_side = |side: usize| deck.is_some_and(|d| d.seams.sides[side]);
        self.is_of(piece, &|f| self.curves.seams.contains(&f), &is_side)
    }
    /// Returns true if the surface ends in a piece: other pieces may end there or not.
    pub(super) fn is_fold(&self, piece: &CurvePiece) -> bool {
        let region = self.atlas.region;
        let is_side = |side: usize| region.is_fold_side(side);
        self.is_of(piece, &|f| region.is_fold(f), &is_side)
    }
    /// Returns true if a piece lies on one of some factors or sides of unit triangles.
    fn is_of(
        &self,
        piece: &CurvePiece,
        is_factor: &dyn Fn(usize) -> bool,
        is_side: &dyn Fn(usize) -> bool,
    ) -> bool {
        let arrangement = |q: usize| &self.atlas.region.triangles[q].arrangement;
        match piece.track {
            Track::Arc(q, slab, i) => is_factor(arrangement(q).slabs[slab].arcs[i].curve),
            Track::Wall(q, wall, _) => {
                let lines = &arrangement(q).walls[wall].vertical;
                lines.iter().any(|&f| is_factor(f))
            }
            Track::Side(side, ..) => is_side(side),
            Track::Seam(..) => false,
        }
    }
    /// Returns the point of a piece above or below a point of one of its chords.
    pub(super) fn on_curve_of(&self, piece: &CurvePiece, at: [f64; 2]) -> [f64; 2] {
        match piece.track {
            Track::Arc(q, slab, i) => {
                let a = &self.atlas.region.triangles[q].arrangement;
                let height = Columns::new(a, slab).at(at[0], i);
                height.map_or(at, |v| [at[0], v])
            }
            _ => at,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn classes<const N: usize>(numbers: [usize; N]) -> Vec<ClassId> {
        numbers.map(ClassId).to_vec()
    }
    fn sheets(edges: &[([usize; 2], usize)]) -> SheetCounts {
        let of = edges.iter().map(|&(e, n)| (e.map(ClassId), n));
        SheetCounts {
            of: of.collect(),
            done: BTreeSet::new(),
        }
    }

    /// Two sheets along 0 1 2, four between 2 and 3, one at 4: arcs end where the number changes.
    #[test]
    fn arcs_have_as_many_sheets_all_along() {
        let mut s = sheets(&[([0, 1], 2), ([1, 2], 2), ([2, 3], 4), ([3, 4], 1)]);
        let all = [(classes([0, 1, 2]), 2), (classes([2, 3]), 4)];
        assert_eq!(s.arcs(&classes([0, 1, 2, 3, 4])), all);
        // The other sheets follow in either direction.
        assert!(
            s.arcs(&classes([4, 3, 2, 1, 0])).is_empty() && s.arcs(&classes([0, 1, 2])).is_empty()
        );
    }

    /// A sheet that leaves an arc and returns to it has the vertices in between for itself.
    #[test]
    fn arcs_are_told_apart_where_sheets_part() {
        let mut s = sheets(&[([0, 1], 2), ([1, 2], 2), ([1, 5], 2), ([2, 5], 2)]);
        assert_eq!(s.arcs(&classes([0, 1, 2])), [(classes([0, 1, 2]), 2)]);
        assert_eq!(s.arcs(&classes([0, 1, 5, 2])), [(classes([1, 5, 2]), 2)]);
    }
}
