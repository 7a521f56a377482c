//! Splitting of long edges and collapsing of short ones.

use super::{Hold, MIN_COLLAPSE_SINE, MIN_FACING_COSINE, MIN_SINE_GAIN, Remesher};
use crate::complex::Face;
use crate::measure::smallest_sine;
use crate::points::midpoint;
use crate::surface::On;
use isoform_geom::{norm, sub};

/// Ratios to the target length above which edges are split and below which they are collapsed. 4/3
/// and 4/5 would balance long and short edges (Botsch and Kobbelt); these are farther apart, so
/// that edges are not split and collapsed alternately.
const LENGTH_RATIO_LIMITS: [f64; 2] = [1.4, 0.7];

impl Remesher<'_> {
    /// Splits edges that are too long or too far from the surface; with `only_far` only the latter.
    /// Returns their number.
    pub(super) fn split_long(&mut self, only_far: bool) -> usize {
        let edges = self.skin.edges().into_iter();
        let mut found: Vec<(f64, [u32; 2])> = edges
            .filter_map(|[a, b]| {
                let long = self.share_of_wanted([a, b]) / LENGTH_RATIO_LIMITS[0];
                let off = self.middle(a, b)?.excess;
                let much = if only_far { off } else { off.max(long) };
                (much > 1.0).then_some((much, [a, b]))
            })
            .collect();
        if let Some(error) = self.options.grade {
            let faces = self.skin.live();
            found.extend(faces.filter_map(|f| self.longest_of_bulging(f, error)));
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        found.retain(|&(_, [a, b])| self.split(a, b));
        found.len()
    }

    /// Returns the longest edge of a face whose centroid is farther from its piece than `error`,
    /// with the excess ratio. The edges of such a face may all be within the limit.
    fn longest_of_bulging(&self, f: u32, error: f64) -> Option<(f64, [u32; 2])> {
        let m = self.skin.middle(f);
        let on = self.surface.project(&[self.skin.label_of(f)], m)?;
        let off = norm(sub(on, m));
        let by_length =
            |a: &[u32; 2], b: &[u32; 2]| self.skin.length(*a).total_cmp(&self.skin.length(*b));
        let longest = self.skin.edges_at(f).into_iter().max_by(by_length)?;
        (off > error).then_some((off / error, longest))
    }

    /// Splits an edge at its midpoint on the surface, if the new faces have an area and do not turn
    /// away from their pieces.
    pub(super) fn split(&mut self, a: u32, b: u32) -> bool {
        let (Some(middle), Some(sides)) = (self.middle(a, b), self.skin.sides(a, b)) else {
            return false;
        };
        let is_fair = sides.iter().all(|&f| {
            let label = self.skin.label_of(f);
            let before = self.facing(self.skin.corners(f), label);
            [a, b].iter().all(|&end| {
                let p = self.skin.corners_with(f, end, middle.at);
                // Excludes degenerate triangles.
                smallest_sine(p) > 1e-6 && self.facing(p, label) >= MIN_FACING_COSINE.min(before)
            })
        });
        let is_split = is_fair && self.skin.split_at(a, b, middle.at).is_some();
        if is_split {
            self.hold.push(Hold::On(middle.on));
        }
        is_split
    }

    /// Collapses edges that are too short, shortest first. Returns their number.
    pub(super) fn collapse_short(&mut self) -> usize {
        let edges = self.skin.edges().into_iter();
        let mut short: Vec<(f64, [u32; 2])> = edges
            .map(|ends| (self.share_of_wanted(ends), ends))
            .filter(|found| found.0 < LENGTH_RATIO_LIMITS[1])
            .collect();
        short.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        short.retain(|&(_, [a, b])| {
            self.skin.has_edge(a, b) && (self.collapse(a, b, false) || self.collapse(b, a, false))
        });
        short.len()
    }

    /// Collapses the edge from `u` to `w` into `w`, if the pieces of `u` and the shape of the faces
    /// allow it. With `better` the smallest angle must increase.
    pub(super) fn collapse(&mut self, u: u32, w: u32, better: bool) -> bool {
        let Hold::On(on) = self.hold[u as usize] else {
            return false;
        };
        let Some(sides) = self.skin.sides(u, w) else {
            return false;
        };
        let is_along = || {
            self.sharp(u, w)
                .is_some_and(|pieces| On::from_pieces(&pieces) == on)
        };
        if on.len() == 2 && !is_along() {
            return false;
        }
        if !self.keeps_topology(u, w, sides) {
            return false;
        }
        let before = self.skin.worst_at(u, self.skin.at(u));
        let least = if better {
            before + MIN_SINE_GAIN
        } else {
            MIN_COLLAPSE_SINE.min(before)
        };
        let star = self.skin.around[u as usize].clone();
        let left = || star.iter().copied().filter(|f| !sides.contains(f));
        if !left().all(|f| self.may_follow(f, u, w, least)) {
            return false;
        }
        // The remaining edge along a curve must not leave it too far.
        if on.len() == 2 {
            let mut neighbours = self.skin.neighbours(u).into_iter();
            let next = neighbours.find(|&v| v != w && self.sharp(u, v).is_some());
            if next.is_none_or(|next| self.leaves(w, next, on.slice())) {
                return false;
            }
        }
        let kept: Vec<Face> = left().map(|f| self.skin.exchanged(f, u, w)).collect();
        self.skin.replace(&star, &kept);
        true
    }

    /// Returns true if a collapse keeps the surface manifold: the only common neighbours of `u` and
    /// `w` must be the third vertices of the two faces at their edge.
    fn keeps_topology(&self, u: u32, w: u32, sides: [u32; 2]) -> bool {
        let others = self.skin.neighbours(w);
        let mine = self.skin.neighbours(u).into_iter();
        let degree = |v: u32| self.skin.around[v as usize].len();
        let tips = sides.map(|f| self.skin.opposite(f, u, w));
        mine.filter(|v| others.contains(v)).count() == 2
            && degree(u) >= 3
            && tips.into_iter().all(|v| degree(v) > 3)
    }

    /// Returns true if a face may be moved from its vertex `u` to `w`: no sine falls below `least`,
    /// it does not turn away, and none of its edges would be split again.
    fn may_follow(&self, f: u32, u: u32, w: u32, least: f64) -> bool {
        let new = self.skin.corners_with(f, u, self.skin.at(w));
        let label = self.skin.label_of(f);
        if smallest_sine(new) < least || self.faces_away(self.skin.corners(f), new, label) {
            return false;
        }
        let vertices = self.skin.faces[f as usize].into_iter();
        let mut others = vertices.filter(|&v| v != u);
        !others.any(|v| self.is_too_long(w, v, label))
    }

    /// Returns true if a new edge would be split again.
    fn is_too_long(&self, a: u32, b: u32, label: u32) -> bool {
        let middle = midpoint(self.skin.at(a), self.skin.at(b));
        self.skin.length([a, b]) > LENGTH_RATIO_LIMITS[0] * self.wanted(middle)
            || self.leaves(a, b, &[self.piece_at([a, b], label)])
    }
}
