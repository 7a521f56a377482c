//! What ends a curve between two of its points.

use super::walk::{MISS, Walk};
use super::{End, Tracer, toward};
use crate::features::CornerKind;
use crate::features::newton::{along, normalised, onto_three, onto_touching, onto_two, unit};
use crate::features::search::Search;
use crate::points::unique;
use isoform_geom::{Point3, cross, dot, norm, sub};

/// Halvings towards the place where a curve ends: as many as a double has digits, nearly.
const HALVINGS: usize = 48;
/// Part of the size to which that place is found.
const CLOSE: f64 = 1e-10;
/// Part of the size from which on the way there is worth a point.
const WORTH: f64 = 1e-3;
/// Parts of the size within which a piece that touches the curve is sought.
const TOUCH_REACH: f64 = 16.0;
/// Angle between the pieces, in smallest angles of a feature, below which a curve fades out.
const FADES: f64 = 2.0;
/// Part of the size by which a crossing may lie off the step.
const BESIDE: f64 = 1e-6;
/// Determinant of three normals above which their pieces meet in a point.
const TRANSVERSAL: f64 = 1e-6;

impl Tracer<'_> {
    /// The end of the curve between the walk and `q`, where it is not the same feature any more.
    pub(super) fn event(&mut self, walk: &mut Walk, q: Point3, points: &mut Vec<Point3>) -> End {
        let search = self.search;
        if let Some(c) = self.crossing(walk, q) {
            return End::Corner(c);
        }
        let from = walk.p;
        let far = search.approach_end(walk, q);
        if norm(sub(walk.p, from)) > WORTH * search.size() {
            points.push(walk.p);
        }
        if let Some(c) = self.crossing(walk, far) {
            return End::Corner(c);
        }
        if let Some(c) = self.touching(walk, far) {
            return End::Corner(c);
        }
        if !search.holds(far) {
            return End::Open;
        }
        let fades = search
            .angle_at(walk.p, walk.pair)
            .is_none_or(|a| a < FADES * search.options.smallest_angle);
        let kind = if fades {
            CornerKind::Fading
        } else {
            CornerKind::Seam
        };
        self.force_corner(walk.p, kind)
    }

    /// A corner where another piece touches the curve near its end.
    fn touching(&mut self, walk: &Walk, end: Point3) -> Option<usize> {
        let search = self.search;
        let reach = search.size() / TOUCH_REACH;
        let new: Vec<u32> = search.touch(end).map(|t| t.pieces()).unwrap_or_default();
        new.into_iter()
            .filter(|k| !walk.pair.contains(k))
            .find_map(|k| {
                let r = onto_touching(search.solid, walk.pair, k, end, reach)?;
                self.add_corner(r, CornerKind::Tangent)
            })
    }

    /// A corner between the walk and `q`, with a piece whose sign changes on the way.
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

impl Search<'_> {
    /// Goes by halves to where the curve ends between the walk and `q`. Returns a point behind the
    /// end.
    fn approach_end(&self, walk: &mut Walk, q: Point3) -> Point3 {
        let mut far = q;
        for _ in 0..HALVINGS {
            let way = sub(far, walk.p);
            let length = norm(way);
            if length < CLOSE * self.size() {
                break;
            }
            let middle = along(walk.p, way, 0.5);
            let Some((m, n)) = onto_two(self.solid, walk.pair, middle, MISS * length) else {
                break;
            };
            match self.goes_on(walk, m, toward(unit(cross(n[0], n[1])), walk.t)) {
                Some(next) => *walk = next,
                None => far = m,
            }
        }
        far
    }

    /// The pieces besides those of the curve that matter at the walk or at `q`.
    fn other_pieces(&self, walk: &Walk, q: Point3) -> Vec<u32> {
        let mut pieces: Vec<u32> = Vec::new();
        for p in [walk.p, q] {
            if let Some(local) = self.octree.at(p) {
                pieces.extend(local.pieces.iter().filter(|k| !walk.pair.contains(k)));
            }
        }
        unique(pieces)
    }

    /// Where a piece crosses the curve between the walk and `q`: the share of the way, and the
    /// point.
    fn crossing_with(&self, walk: &Walk, q: Point3, k: u32) -> Option<(f64, Point3)> {
        let way = sub(q, walk.p);
        let length = norm(way);
        let u = normalised(self.solid, k, walk.p)?.d;
        let v = normalised(self.solid, k, q)?.d;
        // One end may already be on it, to rounding.
        if u * v > 0.0 && u.abs().min(v.abs()) > self.tolerance {
            return None;
        }
        let share = if u == v {
            0.5
        } else {
            (u / (u - v)).clamp(0.0, 1.0)
        };
        let [i, j] = walk.pair;
        let start = along(walk.p, way, share);
        let reach = length + BESIDE * self.size();
        let (r, det) = onto_three(self.solid, [i, j, k], start, reach)?;
        let s = dot(sub(r, walk.p), way) / length.max(f64::MIN_POSITIVE).powi(2);
        let slack = self.tolerance / length.max(self.tolerance);
        (det.abs() > TRANSVERSAL && (-slack..=1.0 + slack).contains(&s)).then_some((s, r))
    }
}
