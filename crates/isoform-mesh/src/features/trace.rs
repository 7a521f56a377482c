//! Feature curves from corner to corner.
//!
//! A curve is followed by steps along n₁ × n₂, each corrected onto both pieces (`walk`). It ends at
//! a corner: one that is known already and lies ahead, or one that is found because the solid about
//! the curve has changed on a step (`event`). Then points are put between its points until chords
//! are near enough to it (`dense`).

mod dense;
mod event;
mod walk;

use super::CornerKind;
use super::junction::{HalfLine, State};
use super::newton::{along, onto_two, unit};
use super::search::Search;
use isoform_geom::{Point3, cross, dot, norm, sub};
use std::collections::HashMap;
use walk::{Home, Walk};

/// Corners nearer than this part of the size are one.
const SAME: f64 = 1e-7;
/// Ends of curves nearer to a corner than this part of the size are moved there.
const AT_CORNER: f64 = 1e-9;
/// Cosine, but for the sign, of two half-lines above which they are one curve that goes on.
const STRAIGHT: f64 = 1e-6;
/// Cosine of the direction in which a curve has come to a corner and of a half-line there, above
/// which the two belong together.
const ARRIVING: f64 = 0.8;
/// Curves of one solid; beyond, the search is given up.
const CURVES: usize = 1_000_000;
/// Largest number of a bin, far beyond any region.
const FARTHEST: f64 = 1e15;

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
pub(crate) struct Traced {
    /// Pieces that vanish all along, of the one sheet and of the other.
    pub(crate) a: Vec<u32>,
    pub(crate) b: Vec<u32>,
    pub(crate) points: Vec<Point3>,
    pub(crate) angles: [f64; 2],
    pub(crate) corners: [Option<u32>; 2],
    pub(crate) closed: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum End {
    Corner(usize),
    Closed,
    /// The border of the region, or the tracer's limits.
    Open,
}

/// Corners and curves in bins as large as the size.
pub(crate) struct Tracer<'a> {
    search: &'a Search<'a>,
    pub(crate) corners: Vec<Junction>,
    /// The corners of each bin.
    at: HashMap<[i64; 3], Vec<usize>>,
    pub(crate) curves: Vec<Traced>,
    /// The chords of all curves, with their curve.
    segments: Vec<(Point3, Point3, u32)>,
    /// The chords that begin or end in each bin.
    near: HashMap<[i64; 3], Vec<u32>>,
    /// Whether a curve was given up before its end.
    pub(crate) lost: bool,
    /// Corners before this one have had all their curves followed.
    traced: usize,
}

impl<'a> Tracer<'a> {
    pub(crate) fn new(search: &'a Search<'a>) -> Self {
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
        p.map(|v| (v / self.search.size()).floor().clamp(-FARTHEST, FARTHEST) as i64)
    }

    /// The bins around a point.
    fn around(&self, p: Point3) -> impl Iterator<Item = [i64; 3]> {
        let b = self.bin(p);
        (0..27).map(move |k| [b[0] + k % 3 - 1, b[1] + k / 3 % 3 - 1, b[2] + k / 9 - 1])
    }

    /// Adds a corner, if `p` is one that is not yet known. Returns the number of the corner at `p`.
    pub(crate) fn add_corner(&mut self, p: Point3, kind: CornerKind) -> Option<usize> {
        if let Some(known) = self.corner_at(p, SAME * self.search.size()) {
            return Some(known);
        }
        let pieces = self.search.touch(p)?.pieces();
        let lines = self.search.half_lines(p);
        let passes = match &lines[..] {
            [] => true,
            // A curve that goes on as it came.
            [u, v] => {
                dot(u.direction, v.direction) < -1.0 + STRAIGHT
                    && meet(u, v)
                    && kind != CornerKind::Branch
            }
            _ => false,
        };
        (!passes).then(|| self.push_corner(p, pieces, kind, lines))
    }

    /// Adds a corner whether the solid shows one or not; the curve is open where nothing of it is.
    fn force_corner(&mut self, p: Point3, kind: CornerKind) -> End {
        if let Some(known) = self.corner_at(p, SAME * self.search.size()) {
            return End::Corner(known);
        }
        let Some(pieces) = self.search.touch(p).map(|t| t.pieces()) else {
            return End::Open;
        };
        let lines = self.search.half_lines(p);
        End::Corner(self.push_corner(p, pieces, kind, lines))
    }

    /// Adds the tip of a piece.
    pub(crate) fn add_apex(&mut self, p: Point3, piece: u32) {
        match self.corner_at(p, SAME * self.search.size()) {
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

    /// The first corner within `reach` (at most the size) of a point.
    pub(crate) fn corner_at(&self, p: Point3, reach: f64) -> Option<usize> {
        let candidates = self.around(p).filter_map(|b| self.at.get(&b)).flatten();
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

    /// Whether a curve passes within `reach` of `p` (at most the size); of any pieces, or with one
    /// of each given sheet.
    pub(crate) fn passes(&self, p: Point3, reach: f64, pair: Option<[u32; 2]>) -> bool {
        self.around(p)
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

    /// Follows all curves that leave corners, those found on the way included.
    pub(crate) fn trace_corners(&mut self) {
        while self.traced < self.corners.len() {
            for l in 0..self.corners[self.traced].lines.len() {
                if self.curves.len() >= CURVES || self.search.control.is_stopped() {
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

    /// Follows a half-line from its corner.
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
            Some(end) => (End::Corner(end), first),
            None => {
                points.push(walk.p);
                self.follow(walk, &mut points, None)
            }
        };
        self.finish(points, [End::Corner(c), end], last);
    }

    /// Follows the curve through `p`, a point of no traced curve and of no corner.
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
        let (end, last) = self.follow(walk, &mut points, Some(Home { p, t }));
        if end == End::Closed {
            self.finish(points, [End::Closed, End::Closed], last);
            return;
        }
        // The sheets' pieces are those left at the other end.
        let Some(walk) = self.search.back(p, t, &last) else {
            return;
        };
        let mut rest = vec![p];
        let (start, last) = self.follow(walk, &mut rest, None);
        rest.reverse();
        rest.pop();
        rest.extend(points);
        self.finish(rest, [start, end], last);
    }

    /// The nearest corner to which the curve leads.
    fn corner_ahead(&self, walk: &Walk, reach: f64, except: Option<usize>) -> Option<usize> {
        let mut best: Option<(f64, usize)> = None;
        let around = self.around(walk.p).filter_map(|b| self.at.get(&b));
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

    /// Whether both pieces of a curve pass through a corner, and the curve leads there.
    fn leads_to_corner(&self, walk: &Walk, corner: &Junction, reach: f64) -> bool {
        let search = self.search;
        let on = |k: u32| corner.pieces.contains(&k) || search.lies_on(corner.point, k);
        let may_fade = matches!(corner.kind, CornerKind::Branch | CornerKind::Fading);
        walk.pair.into_iter().all(on) && search.leads_to(walk, corner.point, reach, may_fade)
    }

    /// Makes the curve dense and puts it with the others.
    fn finish(&mut self, mut points: Vec<Point3>, ends: [End; 2], last: Walk) {
        self.end_at(&mut points, ends, &last.state);
        if points.len() < 2 {
            return;
        }
        let closed = ends[0] == End::Closed || (ends[0] == ends[1] && ends[0] != End::Open);
        let (points, angles) = self.search.dense(&points, last.pair);
        self.add_segments(&points);
        let State { a, b, .. } = last.state;
        self.curves.push(Traced {
            a,
            b,
            points,
            angles,
            corners: ends.map(End::corner),
            closed,
        });
    }

    /// Lets the points of a curve begin and end in its corners; a closed one ends where it began.
    fn end_at(&mut self, points: &mut Vec<Point3>, [start, end]: [End; 2], state: &State) {
        if let End::Corner(c) = start {
            let corner = self.corners[c].point;
            if norm(sub(points[0], corner)) > AT_CORNER * self.search.size() {
                points.insert(0, corner);
            } else if points.len() > 1 {
                points[0] = corner;
            }
            let next = points[1.min(points.len() - 1)];
            self.arrive(c, unit(sub(next, corner)), state);
        }
        if let End::Corner(c) = end {
            let corner = self.corners[c].point;
            let at = points.len() - 1;
            if norm(sub(points[at], corner)) > AT_CORNER * self.search.size() {
                points.push(corner);
            } else if points.len() > 1 {
                points[at] = corner;
            }
            let before = points[points.len().saturating_sub(2)];
            self.arrive(c, unit(sub(before, corner)), state);
        } else if end == End::Closed {
            points.push(points[0]);
        }
    }

    /// Puts the chords of the next curve into bins.
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
    fn arrive(&mut self, c: usize, away: Point3, state: &State) {
        let corner = &mut self.corners[c];
        let cosine = |l: &usize| dot(corner.lines[*l].direction, away);
        let best = (0..corner.lines.len())
            .filter(|l| corner.lines[*l].has_sheets_of(state) && cosine(l) > ARRIVING)
            .max_by(|x, y| cosine(x).total_cmp(&cosine(y)));
        if let Some(l) = best {
            corner.used[l] = true;
        }
    }
}

impl End {
    fn corner(self) -> Option<u32> {
        match self {
            Self::Corner(c) => Some(c as u32),
            Self::Closed | Self::Open => None,
        }
    }
}

impl HalfLine {
    /// Whether its sheets share pieces with those of a curve, one with the one and one with the
    /// other.
    fn has_sheets_of(&self, state: &State) -> bool {
        share_sheets([&self.a, &self.b], [&state.a, &state.b])
    }
}

/// Whether the sheets of two half-lines share pieces.
fn meet(u: &HalfLine, v: &HalfLine) -> bool {
    share_sheets([&u.a, &u.b], [&v.a, &v.b])
}

fn share_sheets([a, b]: [&[u32]; 2], [c, d]: [&[u32]; 2]) -> bool {
    let share = |a: &[u32], b: &[u32]| a.iter().any(|k| b.contains(k));
    (share(a, c) && share(b, d)) || (share(a, d) && share(b, c))
}

/// ±t, so that it points along `way`.
fn toward(t: Point3, way: Point3) -> Point3 {
    if dot(t, way) < 0.0 { t.map(|v| -v) } else { t }
}

/// What both lists hold.
fn both(a: &[u32], b: &[u32]) -> Vec<u32> {
    a.iter().copied().filter(|k| b.contains(k)).collect()
}

/// The distance of a point from a segment.
fn to_segment(p: Point3, a: Point3, b: Point3) -> f64 {
    let (ab, ap) = (sub(b, a), sub(p, a));
    let l2 = dot(ab, ab);
    let s = if l2 > 0.0 {
        (dot(ap, ab) / l2).clamp(0.0, 1.0)
    } else {
        0.0
    };
    norm(sub(p, along(a, ab, s)))
}
