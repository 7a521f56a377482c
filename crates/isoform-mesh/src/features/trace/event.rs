//! Ends of curves between two of their points.

use super::walk::{MAX_TANGENT_MISS, Walk};
use super::{CurveEnd, Tracer, aligned_with};
use crate::features::CornerKind;
use crate::features::context::FeatureContext;
use crate::features::newton::{add_scaled, normalised, onto_three, onto_touching, onto_two, unit};
use crate::points::unique;
use isoform_geom::{Point3, cross, dot, norm, sub};

impl Tracer<'_> {
    /// Returns the end of a curve between the walk and `q`, where it is a different feature or
    /// none.
    pub(super) fn event(
        &mut self,
        walk: &mut Walk,
        q: Point3,
        points: &mut Vec<Point3>,
    ) -> CurveEnd {
        let search = self.search;
        if let Some(c) = self.crossing(walk, q) {
            return CurveEnd::Corner(c);
        }
        let from = walk.p;
        let far = search.approach_end(walk, q);
        // A shorter segment needs no point.
        if norm(sub(walk.p, from)) > 1e-3 * search.size() {
            points.push(walk.p);
        }
        if let Some(c) = self.crossing(walk, far) {
            return CurveEnd::Corner(c);
        }
        if let Some(c) = self.touching(walk, far) {
            return CurveEnd::Corner(c);
        }
        if !search.holds(far) {
            return CurveEnd::Open;
        }
        let fades = search
            .angle_at(walk.p, walk.pair)
            // The curve fades out where the angle is nearly the smallest of a feature.
            .is_none_or(|a| a < 2.0 * search.options.smallest_angle);
        let kind = if fades {
            CornerKind::Fading
        } else {
            CornerKind::Seam
        };
        self.force_corner(walk.p, kind)
    }

    /// Returns the corner where another piece touches the curve near its end.
    fn touching(&mut self, walk: &Walk, end: Point3) -> Option<usize> {
        let search = self.search;
        let reach = search.size() / 16.0;
        let new: Vec<u32> = search.touch(end).map(|t| t.pieces()).unwrap_or_default();
        new.into_iter()
            .filter(|k| !walk.pair.contains(k))
            .find_map(|k| {
                let r = onto_touching(search.solid, walk.pair, k, end, reach)?;
                self.add_corner(r, CornerKind::Tangent)
            })
    }

    /// Returns the first corner between the walk and `q`, with a piece whose sign changes there.
    fn crossing(&mut self, walk: &Walk, q: Point3) -> Option<usize> {
        let mut hits: Vec<(f64, Point3)> = self
            .search
            .other_pieces(walk, q)
            .into_iter()
            .filter_map(|k| self.search.crossing_with(walk, q, k))
            .collect();
        hits.sort_by(|a, b| a.0.total_cmp(&b.0));
        hits.into_iter()
            .find_map(|(_, r)| self.add_corner(r, CornerKind::Meeting))
    }
}

impl FeatureContext<'_> {
    /// Bisects for the point where the curve ends between the walk and `q`. Returns a point behind
    /// the end.
    fn approach_end(&self, walk: &mut Walk, q: Point3) -> Point3 {
        let mut far = q;
        // Nearly as many halvings as a double has binary digits.
        for _ in 0..48 {
            let way = sub(far, walk.p);
            let length = norm(way);
            if length < 1e-10 * self.size() {
                break;
            }
            let middle = add_scaled(walk.p, way, 0.5);
            let Some((m, n)) = onto_two(self.solid, walk.pair, middle, MAX_TANGENT_MISS * length)
            else {
                break;
            };
            match self.goes_on(walk, m, aligned_with(unit(cross(n[0], n[1])), walk.t)) {
                Some(next) => *walk = next,
                None => far = m,
            }
        }
        far
    }

    /// Returns the pieces other than those of the curve that matter at the walk or at `q`.
    fn other_pieces(&self, walk: &Walk, q: Point3) -> Vec<u32> {
        let mut pieces: Vec<u32> = Vec::new();
        for p in [walk.p, q] {
            if let Some(local) = self.octree.at(p) {
                pieces.extend(local.pieces.iter().filter(|k| !walk.pair.contains(k)));
            }
        }
        unique(pieces)
    }

    /// Returns the point where a piece crosses the curve between the walk and `q`, with its
    /// position as a share of the step.
    fn crossing_with(&self, walk: &Walk, q: Point3, k: u32) -> Option<(f64, Point3)> {
        let way = sub(q, walk.p);
        let length = norm(way);
        let u = normalised(self.solid, k, walk.p)?.d;
        let v = normalised(self.solid, k, q)?.d;
        // One end may already be on the piece, up to rounding.
        if u * v > 0.0 && u.abs().min(v.abs()) > self.tolerance {
            return None;
        }
        let share = if u == v {
            0.5
        } else {
            (u / (u - v)).clamp(0.0, 1.0)
        };
        let [i, j] = walk.pair;
        let start = add_scaled(walk.p, way, share);
        // The crossing may lie slightly off the step.
        let reach = length + 1e-6 * self.size();
        let (r, det) = onto_three(self.solid, [i, j, k], start, reach)?;
        let s = dot(sub(r, walk.p), way) / length.max(f64::MIN_POSITIVE).powi(2);
        let slack = self.tolerance / length.max(self.tolerance);
        // The pieces meet in a point, within the step.
        (det.abs() > 1e-6 && (-slack..=1.0 + slack).contains(&s)).then_some((s, r))
    }
}
