//! Tracing of feature curves from corner to corner.
//!
//! A curve is traced by steps along n₁ × n₂, each corrected onto both pieces (`walk`). It ends at a
//! corner: a known one that lies ahead, or one that is found because the solid about the curve has
//! changed within a step (`event`). Then points are inserted until chords are close enough to the
//! curve (`dense`).

mod dense;
mod event;
mod walk;

use super::CornerKind;
use super::context::FeatureContext;
use super::junction::{CurveState, HalfLine};
use super::newton::{add_scaled, onto_two, unit};
use isoform_geom::{Point3, cross, dot, norm, sub};
use std::collections::HashMap;
use walk::{CurveStart, Walk};

/// Distance, in sizes, within which corners are one.
const COINCIDENT_CORNER_DISTANCE: f64 = 1e-7;
/// Distance from a corner, in sizes, within which ends of curves are moved there.
const END_SNAP_DISTANCE: f64 = 1e-9;
/// Maximum number of curves of one solid; the search stops there as incomplete.
const MAX_TRACED_CURVES: usize = 1_000_000;

/// A corner with the curves that leave it.
#[derive(Clone, Debug)]
pub(crate) struct Junction {
    pub(crate) point: Point3,
    pub(crate) pieces: Vec<u32>,
    pub(crate) kind: CornerKind,
    pub(crate) lines: Vec<HalfLine>,
    used: Vec<bool>,
}

/// A traced curve.
#[derive(Clone, Debug)]
pub(crate) struct TracedCurve {
    /// Pieces that vanish all along, of one sheet and of the other.
    pub(crate) a: Vec<u32>,
    pub(crate) b: Vec<u32>,
    pub(crate) points: Vec<Point3>,
    pub(crate) angles: [f64; 2],
    pub(crate) corners: [Option<u32>; 2],
    pub(crate) closed: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum CurveEnd {
    Corner(usize),
    Closed,
    /// Border of the region, or a limit of the tracer.
    Open,
}

/// Corners and curves, in bins as large as the size.
pub(crate) struct Tracer<'a> {
    search: &'a FeatureContext<'a>,
    pub(crate) corners: Vec<Junction>,
    /// Corners by bin.
    at: HashMap<[i64; 3], Vec<usize>>,
    pub(crate) curves: Vec<TracedCurve>,
    /// Chords of all curves, each with the index of its curve.
    segments: Vec<(Point3, Point3, u32)>,
    /// Chords that begin or end in a bin, by bin.
    near: HashMap<[i64; 3], Vec<u32>>,
    /// True if a curve was abandoned before its end.
    pub(crate) lost: bool,
    /// Number of leading corners all of whose curves have been traced.
    traced: usize,
}

impl<'a> Tracer<'a> {
    pub(crate) fn new(search: &'a FeatureContext<'a>) -> Self {
        Self {
            search,
            corners: Vec::new(),
            at: HashMap::new(),
            curves: Vec::new(),
            segments: Vec::new(),
            near: HashMap::new(),
            lost: false,
            traced: 0,
        }
    }
}

impl Tracer<'_> {
    fn bin(&self, p: Point3) -> [i64; 3] {
        // The limits are far beyond any region.
        p.map(|v| (v / self.search.size()).floor().clamp(-1e15, 1e15) as i64)
    }

    /// Returns the bins around a point.
    fn bins_around(&self, p: Point3) -> impl Iterator<Item = [i64; 3]> {
        let b = self.bin(p);
        (0..27).map(move |k| [b[0] + k % 3 - 1, b[1] + k / 3 % 3 - 1, b[2] + k / 9 - 1])
    }

    /// Adds a corner unless `p` is a regular point of a curve. Returns the index of the corner at
    /// `p`, known or new.
    pub(crate) fn add_corner(&mut self, p: Point3, kind: CornerKind) -> Option<usize> {
        if let Some(known) = self.corner_at(p, COINCIDENT_CORNER_DISTANCE * self.search.size()) {
            return Some(known);
        }
        let pieces = self.search.touch(p)?.pieces();
        let lines = self.search.half_lines(p);
        let passes = match &lines[..] {
            [] => true,
            // A curve that continues through the point.
            [u, v] => {
                // The two half-lines are one curve that continues straight.
                dot(u.direction, v.direction) < -1.0 + 1e-6
                    && meet(u, v)
                    && kind != CornerKind::Branch
            }
            _ => false,
        };
        (!passes).then(|| self.push_corner(p, pieces, kind, lines))
    }

    /// Adds a corner even if the solid shows none; the curve ends open if `p` is off the surface.
    fn force_corner(&mut self, p: Point3, kind: CornerKind) -> CurveEnd {
        if let Some(known) = self.corner_at(p, COINCIDENT_CORNER_DISTANCE * self.search.size()) {
            return CurveEnd::Corner(known);
        }
        let Some(pieces) = self.search.touch(p).map(|t| t.pieces()) else {
            return CurveEnd::Open;
        };
        let lines = self.search.half_lines(p);
        CurveEnd::Corner(self.push_corner(p, pieces, kind, lines))
    }

    /// Adds the tip of a piece.
    pub(crate) fn add_apex(&mut self, p: Point3, piece: u32) {
        match self.corner_at(p, COINCIDENT_CORNER_DISTANCE * self.search.size()) {
            Some(known) if self.corners[known].kind == CornerKind::Apex => {
                let pieces = &mut self.corners[known].pieces;
                if let Err(at) = pieces.binary_search(&piece) {
                    pieces.insert(at, piece);
                }
            }
            Some(_) => {}
            None => {
                self.push_corner(p, vec![piece], CornerKind::Apex, Vec::new());
            }
        }
    }

    /// Returns the first corner within `reach` (at most the size) of a point.
    pub(crate) fn corner_at(&self, p: Point3, reach: f64) -> Option<usize> {
        let candidates = self
            .bins_around(p)
            .filter_map(|b| self.at.get(&b))
            .flatten();
        candidates
            .copied()
            .filter(|c| norm(sub(self.corners[*c].point, p)) <= reach)
            .min()
    }

    fn push_corner(
        &mut self,
        point: Point3,
        pieces: Vec<u32>,
        kind: CornerKind,
        lines: Vec<HalfLine>,
    ) -> usize {
        let used = vec![false; lines.len()];
        self.corners.push(Junction {
            point,
            pieces,
            kind,
            lines,
            used,
        });
        let bin = self.bin(point);
        self.at.entry(bin).or_default().push(self.corners.len() - 1);
        self.corners.len() - 1
    }

    /// Returns true if a curve passes within `reach` of `p` (at most the size). With `pair`, only
    /// curves of these two pieces count.
    pub(crate) fn passes(&self, p: Point3, reach: f64, pair: Option<[u32; 2]>) -> bool {
        self.bins_around(p)
            .filter_map(|b| self.near.get(&b))
            .flatten()
            .any(|s| {
                let (a, b, curve) = &self.segments[*s as usize];
                let c = &self.curves[*curve as usize];
                let fits = pair.is_none_or(|[i, j]| {
                    (c.a.contains(&i) && c.b.contains(&j)) || (c.a.contains(&j) && c.b.contains(&i))
                });
                fits && to_segment(p, *a, *b) <= reach
            })
    }

    /// Traces all curves that leave corners, including corners found on the way.
    pub(crate) fn trace_corners(&mut self) {
        while self.traced < self.corners.len() {
            for l in 0..self.corners[self.traced].lines.len() {
                if self.curves.len() >= MAX_TRACED_CURVES || self.search.control.is_stopped() {
                    self.lost = true;
                    return;
                }
                if !self.corners[self.traced].used[l] {
                    self.trace_line(self.traced, l);
                }
            }
            self.traced += 1;
        }
    }

    /// Traces a half-line from its corner.
    fn trace_line(&mut self, c: usize, l: usize) {
        self.corners[c].used[l] = true;
        let (origin, line) = (self.corners[c].point, self.corners[c].lines[l].clone());
        let mut points = vec![origin];
        let Some(walk) = self.search.depart(origin, &line) else {
            self.lost = true;
            return;
        };
        // The next corner may be nearer than the first point.
        let first = Walk {
            p: origin,
            t: line.direction,
            pair: walk.pair,
            state: walk.state.clone(),
        };
        let (end, last) = match self.corner_ahead(&first, norm(sub(walk.p, origin)), Some(c)) {
            Some(end) => (CurveEnd::Corner(end), first),
            None => {
                points.push(walk.p);
                self.follow(walk, &mut points, None)
            }
        };
        self.finish(points, [CurveEnd::Corner(c), end], last);
    }

    /// Traces the curve through `p`, a point of no traced curve and of no corner.
    pub(crate) fn trace_seed(&mut self, p: Point3, pair: [u32; 2]) {
        let Some((p, n)) = onto_two(self.search.solid, pair, p, self.search.size()) else {
            return;
        };
        let t = unit(cross(n[0], n[1]));
        let Some(state) = self.search.state(p, pair, t) else {
            return;
        };
        let mut points = vec![p];
        let walk = Walk { p, t, pair, state };
        let (end, last) = self.follow(walk, &mut points, Some(CurveStart { p, t }));
        if end == CurveEnd::Closed {
            self.finish(points, [CurveEnd::Closed, CurveEnd::Closed], last);
            return;
        }
        // The sheets keep only the pieces that remained at the other end.
        let Some(walk) = self.search.reversed(p, t, &last) else {
            return;
        };
        let mut rest = vec![p];
        let (start, last) = self.follow(walk, &mut rest, None);
        rest.reverse();
        rest.pop();
        rest.extend(points);
        self.finish(rest, [start, end], last);
    }

    /// Returns the nearest corner to which the curve leads.
    fn corner_ahead(&self, walk: &Walk, reach: f64, except: Option<usize>) -> Option<usize> {
        let mut best: Option<(f64, usize)> = None;
        let around = self.bins_around(walk.p).filter_map(|b| self.at.get(&b));
        for &c in around.flatten() {
            let corner = &self.corners[c];
            let distance = norm(sub(corner.point, walk.p));
            if Some(c) == except
                || distance > reach
                || best.is_some_and(|b| (b.0, b.1) <= (distance, c))
            {
                continue;
            }
            if self.leads_to_corner(walk, corner, reach) {
                best = Some((distance, c));
            }
        }
        best.map(|b| b.1)
    }

    /// Returns true if both pieces of a curve pass through a corner, and the curve leads there.
    fn leads_to_corner(&self, walk: &Walk, corner: &Junction, reach: f64) -> bool {
        let search = self.search;
        let on = |k: u32| corner.pieces.contains(&k) || search.lies_on(corner.point, k);
        let may_fade = matches!(corner.kind, CornerKind::Branch | CornerKind::Fading);
        walk.pair.into_iter().all(on) && search.leads_to(walk, corner.point, reach, may_fade)
    }

    /// Densifies a curve and adds it to the others.
    fn finish(&mut self, mut points: Vec<Point3>, ends: [CurveEnd; 2], last: Walk) {
        self.end_at(&mut points, ends, &last.state);
        if points.len() < 2 {
            return;
        }
        let closed =
            ends[0] == CurveEnd::Closed || (ends[0] == ends[1] && ends[0] != CurveEnd::Open);
        let (points, angles) = self.search.dense(&points, last.pair);
        self.add_segments(&points);
        let CurveState { a, b, .. } = last.state;
        self.curves.push(TracedCurve {
            a,
            b,
            points,
            angles,
            corners: ends.map(CurveEnd::corner),
            closed,
        });
    }

    /// Moves the ends of a curve to its corners; closes a closed one.
    fn end_at(
        &mut self,
        points: &mut Vec<Point3>,
        [start, end]: [CurveEnd; 2],
        state: &CurveState,
    ) {
        if let CurveEnd::Corner(c) = start {
            let corner = self.corners[c].point;
            if norm(sub(points[0], corner)) > END_SNAP_DISTANCE * self.search.size() {
                points.insert(0, corner);
            } else if points.len() > 1 {
                points[0] = corner;
            }
            let next = points[1.min(points.len() - 1)];
            self.arrive(c, unit(sub(next, corner)), state);
        }
        if let CurveEnd::Corner(c) = end {
            let corner = self.corners[c].point;
            let at = points.len() - 1;
            if norm(sub(points[at], corner)) > END_SNAP_DISTANCE * self.search.size() {
                points.push(corner);
            } else if points.len() > 1 {
                points[at] = corner;
            }
            let before = points[points.len().saturating_sub(2)];
            self.arrive(c, unit(sub(before, corner)), state);
        } else if end == CurveEnd::Closed {
            points.push(points[0]);
        }
    }

    /// Adds the chords of the next curve to the bins.
    fn add_segments(&mut self, points: &[Point3]) {
        let curve = self.curves.len() as u32;
        for w in points.windows(2) {
            let id = self.segments.len() as u32;
            self.segments.push((w[0], w[1], curve));
            let (a, b) = (self.bin(w[0]), self.bin(w[1]));
            self.near.entry(a).or_default().push(id);
            if a != b {
                self.near.entry(b).or_default().push(id);
            }
        }
    }

    /// Marks the half-line by which a curve has come to a corner.
    fn arrive(&mut self, c: usize, away: Point3, state: &CurveState) {
        let corner = &mut self.corners[c];
        let cosine = |l: &usize| dot(corner.lines[*l].direction, away);
        let best = (0..corner.lines.len())
            // The half-line must point back along the curve.
            .filter(|l| corner.lines[*l].has_sheets_of(state) && cosine(l) > 0.8)
            .max_by(|x, y| cosine(x).total_cmp(&cosine(y)));
        if let Some(l) = best {
            corner.used[l] = true;
        }
    }
}

impl CurveEnd {
    fn corner(self) -> Option<u32> {
        match self {
            Self::Corner(c) => Some(c as u32),
            Self::Closed | Self::Open => None,
        }
    }
}

impl HalfLine {
    /// Returns true if the sheets of the half-line share pieces with those of a curve, one with
    /// each.
    fn has_sheets_of(&self, state: &CurveState) -> bool {
        share_sheets([&self.a, &self.b], [&state.a, &state.b])
    }
}

/// Returns true if the sheets of two half-lines share pieces.
fn meet(u: &HalfLine, v: &HalfLine) -> bool {
    share_sheets([&u.a, &u.b], [&v.a, &v.b])
}

fn share_sheets([a, b]: [&[u32]; 2], [c, d]: [&[u32]; 2]) -> bool {
    let share = |a: &[u32], b: &[u32]| a.iter().any(|k| b.contains(k));
    (share(a, c) && share(b, d)) || (share(a, d) && share(b, c))
}

/// Returns t or −t, whichever points along `way`.
fn aligned_with(t: Point3, way: Point3) -> Point3 {
    if dot(t, way) < 0.0 { t.map(|v| -v) } else { t }
}

/// Returns the elements that both lists hold.
fn common_elements(a: &[u32], b: &[u32]) -> Vec<u32> {
    a.iter().copied().filter(|k| b.contains(k)).collect()
}

/// Returns the distance of a point from a segment.
fn to_segment(p: Point3, a: Point3, b: Point3) -> f64 {
    let (ab, ap) = (sub(b, a), sub(p, a));
    let l2 = dot(ab, ab);
    let s = if l2 > 0.0 {
        (dot(ap, ab) / l2).clamp(0.0, 1.0)
    } else {
        0.0
    };
    norm(sub(p, add_scaled(a, ab, s)))
}
