//! Feature curves from corner to corner.
//!
//! A curve is followed by steps along n₁ × n₂, each corrected onto both pieces. It ends at a
//! corner: one that is known already and lies ahead, or one that is found because the solid about
//! the curve has changed on a step.

use super::junction::{HalfLine, State};
use super::newton::{along, branch, normalised, onto_three, onto_touching, onto_two, unit};
use super::{CornerKind, Search};
use isoform_geom::{Point3, cross, dot, norm, sub};
use std::collections::HashMap;

/// Cosine of the angle by which a curve may turn on a step, 10 degrees.
const TURN: f64 = 0.985;
/// Part of a step by which the corrected point may miss the tangent's.
const MISS: f64 = 0.3;
/// Steps are not made shorter than this part of the size.
const SHORTEST: f64 = 1e-3;
/// A point ahead is where the curve is going if the direction to it differs by no more than 15
/// degrees.
const AHEAD: f64 = 0.966;
/// Corners nearer than this part of the size are one.
const SAME: f64 = 1e-7;
/// Steps of one curve; at size/2 each that is far more than a solid of the largest allowed extent
/// has.
const STEPS: usize = 200_000;
/// Curves of one solid; beyond, the search is given up.
const CURVES: usize = 1_000_000;

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

/// Where a curve is being followed.
#[derive(Clone, Debug)]
struct Walk {
    p: Point3,
    t: Point3,
    pair: [u32; 2],
    state: State,
}

pub(crate) struct Tracer<'a> {
    search: &'a Search<'a>,
    pub(crate) corners: Vec<Junction>,
    at: HashMap<[i64; 3], Vec<usize>>,
    pub(crate) curves: Vec<Traced>,
    segments: Vec<(Point3, Point3, u32)>,
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

    fn bin(&self, p: Point3) -> [i64; 3] {
        p.map(|v| (v / self.search.size()).floor().clamp(-1e15, 1e15) as i64)
    }

    fn around(&self, p: Point3) -> impl Iterator<Item = [i64; 3]> {
        let b = self.bin(p);
        (0..27).map(move |k| [b[0] + k % 3 - 1, b[1] + k / 3 % 3 - 1, b[2] + k / 9 - 1])
    }

    /// Adds a corner, if `p` is one; its number if it is or was.
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
                dot(u.direction, v.direction) < -1.0 + 1e-6
                    && meet(u, v)
                    && kind != CornerKind::Branch
            }
            _ => false,
        };
        (!passes).then(|| self.push_corner(p, pieces, kind, lines))
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

    pub(crate) fn corner_at(&self, p: Point3, reach: f64) -> Option<usize> {
        let candidates = self.around(p).filter_map(|b| self.at.get(&b)).flatten();
        candidates
            .copied()
            .filter(|c| norm(sub(self.corners[*c].point, p)) <= reach)
            .min()
    }

    pub(crate) fn push_corner(
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

    fn trace_line(&mut self, c: usize, l: usize) {
        self.corners[c].used[l] = true;
        let (origin, line) = (self.corners[c].point, self.corners[c].lines[l].clone());
        let mut points = vec![origin];
        let Some(walk) = self.depart(origin, &line) else {
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

    /// A first point of a curve that leaves a corner.
    fn depart(&self, origin: Point3, line: &HalfLine) -> Option<Walk> {
        let size = self.search.size();
        if let Some(p) = line.by {
            let (a, b) = (
                normalised(self.search.solid, line.pair[0], p)?,
                normalised(self.search.solid, line.pair[1], p)?,
            );
            let t = toward(unit(cross(a.n, b.n)), sub(p, origin));
            let state = self.search.state(p, line.pair, t)?;
            return Some(Walk {
                p,
                t,
                pair: line.pair,
                state,
            });
        }
        let mut step = 0.125 * size;
        while step > SHORTEST * 0.1 * size {
            if let Some((p, n)) = onto_two(
                self.search.solid,
                line.pair,
                along(origin, line.direction, step),
                MISS * step,
            ) {
                let t = toward(unit(cross(n[0], n[1])), sub(p, origin));
                if let Some(state) = self.search.state(p, line.pair, t) {
                    return Some(Walk {
                        p,
                        t,
                        pair: line.pair,
                        state,
                    });
                }
            }
            step *= 0.25;
        }
        None
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
        let (end, last) = self.follow(walk.clone(), &mut points, Some((p, t)));
        if end == End::Closed {
            self.finish(points, [End::Closed, End::Closed], last);
            return;
        }
        let back = t.map(|v| -v);
        let mut rest = vec![p];
        // The sheets' pieces are those left at the other end.
        let Some(state) = self.search.state(p, last.pair, back) else {
            return;
        };
        let state = State {
            a: both(&state.a, &last.state.a),
            b: both(&state.b, &last.state.b),
            ..state
        };
        let (start, last) = self.follow(
            Walk {
                p,
                t: back,
                pair: last.pair,
                state,
            },
            &mut rest,
            None,
        );
        rest.reverse();
        rest.pop();
        rest.extend(points);
        self.finish(rest, [start, end], last);
    }

    /// Steps until the curve ends; `home` is where it would close.
    fn follow(
        &mut self,
        mut walk: Walk,
        points: &mut Vec<Point3>,
        home: Option<(Point3, Point3)>,
    ) -> (End, Walk) {
        let search = self.search;
        let size = search.size();
        let mut step = 0.25 * size;
        for n in 0..STEPS {
            if n % 8 == 7 && search.control.is_stopped() {
                break;
            }
            if let Some(c) = self.corner_ahead(&walk, 1.5 * step, None) {
                return (End::Corner(c), walk);
            }
            if points.len() > 2
                && home.is_some_and(|(h, t)| {
                    dot(t, walk.t) > 0.5 && self.leads_to(&walk, h, 1.5 * step, false)
                })
            {
                return (End::Closed, walk);
            }
            let moved = onto_two(
                search.solid,
                walk.pair,
                along(walk.p, walk.t, step),
                MISS * step,
            )
            .and_then(|(q, n)| {
                let t = unit(cross(n[0], n[1]));
                let t = toward(t, walk.t);
                // Past a point where the normals are parallel their product points back.
                (dot(t, walk.t) > TURN && dot(sub(q, walk.p), walk.t) > 0.5 * step)
                    .then_some((q, t))
            });
            let Some((q, t)) = moved else {
                step *= 0.5;
                if step > SHORTEST * size {
                    continue;
                }
                return (self.singular_end(&walk), walk);
            };
            match self.goes_on(&walk, q, t) {
                Some(next) => {
                    let turn = dot(t, walk.t).clamp(-1.0, 1.0).acos();
                    walk = next;
                    points.push(q);
                    // The next step is to turn the curve by 8 degrees.
                    step = (step * (0.14 / turn.max(0.035)).clamp(0.5, 2.0)).min(0.5 * size);
                }
                None if step > 0.3 * size => step *= 0.5,
                None => {
                    let end = self.event(&mut walk, q, points);
                    return (end, walk);
                }
            }
        }
        self.lost = true;
        (End::Open, walk)
    }

    /// The walk at `q`, if the curve is the same feature there as before.
    fn goes_on(&self, walk: &Walk, q: Point3, t: Point3) -> Option<Walk> {
        let search = self.search;
        let next = search.state(q, walk.pair, t)?;
        let (a, b) = (both(&walk.state.a, &next.a), both(&walk.state.b, &next.b));
        let (i, j) = (*a.first()?, *b.first()?);
        let pair = [
            if a.contains(&walk.pair[0]) {
                walk.pair[0]
            } else {
                i
            },
            if b.contains(&walk.pair[1]) {
                walk.pair[1]
            } else {
                j
            },
        ];
        let same = if pair == walk.pair {
            next.faces == walk.state.faces
        } else {
            let (before, after) = (
                search.state(walk.p, pair, walk.t)?,
                search.state(q, pair, t)?,
            );
            before.faces == after.faces
        };
        let state = if pair == walk.pair {
            next
        } else {
            search.state(q, pair, t)?
        };
        same.then_some(Walk {
            p: q,
            t,
            pair,
            state: State { a, b, ..state },
        })
    }

    /// Whether the curve goes straight to `target`, at most `reach` ahead. It may fade out on the
    /// way if it `may_fade`.
    fn leads_to(&self, walk: &Walk, target: Point3, reach: f64, may_fade: bool) -> bool {
        let way = sub(target, walk.p);
        let length = norm(way);
        if length > reach || dot(way, walk.t) < AHEAD * length {
            return false;
        }
        if length < 1e-6 * self.search.size() {
            return true;
        }
        let middle = along(walk.p, way, 0.5);
        let Some((m, _)) = onto_two(self.search.solid, walk.pair, middle, 0.15 * length) else {
            return false;
        };
        match self.search.state(m, walk.pair, unit(way)) {
            Some(state) => state.faces == walk.state.faces,
            None => {
                may_fade
                    && self
                        .search
                        .angle_at(m, walk.pair)
                        .is_some_and(|a| a < 4.0 * self.search.options.smallest_angle)
            }
        }
    }

    /// The nearest corner to which the curve leads.
    fn corner_ahead(&self, walk: &Walk, reach: f64, except: Option<usize>) -> Option<usize> {
        let mut best: Option<(f64, usize)> = None;
        for c in self
            .around(walk.p)
            .filter_map(|b| self.at.get(&b))
            .flatten()
        {
            let corner = &self.corners[*c];
            let distance = norm(sub(corner.point, walk.p));
            if Some(*c) == except
                || distance > reach
                || best.is_some_and(|b| (b.0, b.1) <= (distance, *c))
            {
                continue;
            }
            let on = |k: u32| corner.pieces.contains(&k) || self.search.lies_on(corner.point, k);
            if on(walk.pair[0])
                && on(walk.pair[1])
                && self.leads_to(
                    walk,
                    corner.point,
                    reach,
                    matches!(corner.kind, CornerKind::Branch | CornerKind::Fading),
                )
            {
                best = Some((distance, *c));
            }
        }
        best.map(|b| b.1)
    }

    /// Where no step is short enough: the normals become parallel.
    fn singular_end(&mut self, walk: &Walk) -> End {
        let size = self.search.size();
        if let Some((b, _)) = branch(self.search.solid, walk.pair, walk.p, 0.1 * size)
            && let Some(c) = self.add_corner(b, CornerKind::Branch)
        {
            return End::Corner(c);
        }
        self.force_corner(walk.p, CornerKind::Fading)
    }

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

    /// The end of the curve between the walk and `q`, where it is not the same feature any more.
    fn event(&mut self, walk: &mut Walk, q: Point3, points: &mut Vec<Point3>) -> End {
        let search = self.search;
        if let Some(c) = self.crossing(walk, q) {
            return End::Corner(c);
        }
        // By halves, to where the change is.
        let (from, mut far) = (walk.p, q);
        for _ in 0..48 {
            let length = norm(sub(far, walk.p));
            if length < 1e-10 * search.size() {
                break;
            }
            let Some((m, n)) = onto_two(
                search.solid,
                walk.pair,
                along(walk.p, sub(far, walk.p), 0.5),
                MISS * length,
            ) else {
                break;
            };
            match self.goes_on(walk, m, toward(unit(cross(n[0], n[1])), walk.t)) {
                Some(next) => *walk = next,
                None => far = m,
            }
        }
        if norm(sub(walk.p, from)) > 1e-3 * search.size() {
            points.push(walk.p);
        }
        if let Some(c) = self.crossing(walk, far) {
            return End::Corner(c);
        }
        // A piece that touches the curve.
        let reach = search.size() / 16.0;
        let new: Vec<u32> = search.touch(far).map(|t| t.pieces()).unwrap_or_default();
        for k in new.into_iter().filter(|k| !walk.pair.contains(k)) {
            if let Some(r) = onto_touching(search.solid, walk.pair, k, far, reach)
                && let Some(c) = self.add_corner(r, CornerKind::Tangent)
            {
                return End::Corner(c);
            }
        }
        if !search.holds(far) {
            return End::Open;
        }
        let fades = search
            .angle_at(walk.p, walk.pair)
            .is_none_or(|a| a < 2.0 * search.options.smallest_angle);
        self.force_corner(
            walk.p,
            if fades {
                CornerKind::Fading
            } else {
                CornerKind::Seam
            },
        )
    }

    /// A corner between the walk and `q`, with a piece whose sign changes on the way.
    fn crossing(&mut self, walk: &Walk, q: Point3) -> Option<usize> {
        let search = self.search;
        let way = sub(q, walk.p);
        let length = norm(way);
        let mut pieces: Vec<u32> = Vec::new();
        for p in [walk.p, q] {
            if let Some(local) = search.octree.at(p) {
                pieces.extend(local.pieces.iter().filter(|k| !walk.pair.contains(k)));
            }
        }
        pieces.sort_unstable();
        pieces.dedup();
        let mut hits: Vec<(f64, Point3)> = Vec::new();
        for k in pieces {
            let (Some(u), Some(v)) = (
                normalised(search.solid, k, walk.p),
                normalised(search.solid, k, q),
            ) else {
                continue;
            };
            // One end may already be on it, to rounding.
            if u.d * v.d > 0.0 && u.d.abs().min(v.d.abs()) > search.tolerance {
                continue;
            }
            let start = along(
                walk.p,
                way,
                if u.d == v.d {
                    0.5
                } else {
                    (u.d / (u.d - v.d)).clamp(0.0, 1.0)
                },
            );
            let Some((r, det)) = onto_three(
                search.solid,
                [walk.pair[0], walk.pair[1], k],
                start,
                length + 1e-6 * search.size(),
            ) else {
                continue;
            };
            let s = dot(sub(r, walk.p), way) / length.max(f64::MIN_POSITIVE).powi(2);
            let slack = search.tolerance / length.max(search.tolerance);
            if det.abs() > 1e-6 && (-slack..=1.0 + slack).contains(&s) {
                hits.push((s, r));
            }
        }
        hits.sort_by(|a, b| a.0.total_cmp(&b.0));
        hits.into_iter()
            .find_map(|(_, r)| self.add_corner(r, CornerKind::Meeting))
    }

    /// Makes the curve dense and puts it with the others.
    fn finish(&mut self, mut points: Vec<Point3>, ends: [End; 2], last: Walk) {
        let search = self.search;
        for (k, end) in ends.into_iter().enumerate() {
            let first = k == 0;
            match end {
                End::Corner(c) => {
                    let corner = self.corners[c].point;
                    let at = if first { 0 } else { points.len() - 1 };
                    if norm(sub(points[at], corner)) > 1e-9 * search.size() {
                        if first {
                            points.insert(0, corner)
                        } else {
                            points.push(corner)
                        }
                    } else if points.len() > 1 {
                        points[at] = corner;
                    }
                    let n = points.len();
                    let away = if first {
                        sub(points[1.min(n - 1)], corner)
                    } else {
                        sub(points[n.saturating_sub(2)], corner)
                    };
                    self.arrive(c, unit(away), &last.state);
                }
                End::Closed if !first => points.push(points[0]),
                End::Closed | End::Open => {}
            }
        }
        if points.len() < 2 {
            return;
        }
        let closed = ends[0] == End::Closed || (ends[0] == ends[1] && ends[0] != End::Open);
        let corner = |e: End| {
            if let End::Corner(c) = e {
                Some(c as u32)
            } else {
                None
            }
        };
        let (points, angles) = search.dense(&points, last.pair);
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
        let State { a, b, .. } = last.state;
        self.curves.push(Traced {
            a,
            b,
            points,
            angles,
            corners: ends.map(corner),
            closed,
        });
    }

    /// Marks the half-line by which a curve has come to a corner.
    fn arrive(&mut self, c: usize, away: Point3, state: &State) {
        let corner = &mut self.corners[c];
        let shares = |l: &HalfLine| {
            !both(&l.a, &state.a).is_empty() && !both(&l.b, &state.b).is_empty()
                || !both(&l.a, &state.b).is_empty() && !both(&l.b, &state.a).is_empty()
        };
        let best = (0..corner.lines.len())
            .filter(|l| shares(&corner.lines[*l]) && dot(corner.lines[*l].direction, away) > 0.8)
            .max_by(|x, y| {
                dot(corner.lines[*x].direction, away)
                    .total_cmp(&dot(corner.lines[*y].direction, away))
            });
        if let Some(l) = best {
            corner.used[l] = true;
        }
    }
}

impl Search<'_> {
    pub(crate) fn angle_at(&self, p: Point3, [i, j]: [u32; 2]) -> Option<f64> {
        let (a, b) = (
            normalised(self.solid, i, p)?.n,
            normalised(self.solid, j, p)?.n,
        );
        Some(norm(cross(a, b)).atan2(dot(a, b)))
    }

    /// The curve with points so near to one another that chords miss it by no more than asked for,
    /// and the least and greatest angle of its faces' normals.
    fn dense(&self, points: &[Point3], pair: [u32; 2]) -> (Vec<Point3>, [f64; 2]) {
        let tolerance = self.options.chord * self.size();
        let mut angles = [f64::INFINITY, 0.0];
        let n = points.len();
        let closed = points[0] == points[n - 1];
        let tangents: Vec<Point3> = (0..n)
            .map(|k| {
                let chord = |x: usize, y: usize| sub(points[y], points[x]);
                let way = match (k, closed) {
                    (0, true) => sub(points[1], points[n - 2]),
                    (k, true) if k == n - 1 => sub(points[1], points[n - 2]),
                    (0, false) => chord(0, 1),
                    (k, _) if k == n - 1 => chord(n - 2, n - 1),
                    _ => chord(k - 1, k + 1),
                };
                let (Some(a), Some(b)) = (
                    normalised(self.solid, pair[0], points[k]),
                    normalised(self.solid, pair[1], points[k]),
                ) else {
                    return unit(way);
                };
                let t = cross(a.n, b.n);
                let sine = norm(t);
                let angle = sine.atan2(dot(a.n, b.n));
                angles = [angles[0].min(angle), angles[1].max(angle)];
                let t = toward(unit(t), way);
                if sine > 1e-3 && dot(t, unit(way)) > 0.9 {
                    t
                } else {
                    unit(way)
                }
            })
            .collect();
        let mut out = vec![points[0]];
        for k in 1..n {
            let (p, q) = (points[k - 1], points[k]);
            let length = norm(sub(q, p));
            let turn =
                norm(cross(tangents[k - 1], tangents[k])).atan2(dot(tangents[k - 1], tangents[k]));
            let parts = (length * turn / (8.0 * tolerance))
                .sqrt()
                .max(2.0 * length / self.size() * (1.0 - 1e-9))
                .ceil()
                .clamp(1.0, 256.0) as usize;
            for m in 1..parts {
                let s = m as f64 / parts as f64;
                let x = hermite(p, tangents[k - 1], q, tangents[k], length, s);
                if let Some((x, _)) = onto_two(self.solid, pair, x, 0.1 * length) {
                    out.push(x);
                }
            }
            out.push(q);
        }
        (out, angles)
    }
}

/// The cubic with these ends, tangents and chord length.
fn hermite(p: Point3, u: Point3, q: Point3, v: Point3, length: f64, s: f64) -> Point3 {
    let (s2, s3) = (s * s, s * s * s);
    let (a, b, c, d) = (
        2.0 * s3 - 3.0 * s2 + 1.0,
        s3 - 2.0 * s2 + s,
        3.0 * s2 - 2.0 * s3,
        s3 - s2,
    );
    std::array::from_fn(|i| a * p[i] + b * length * u[i] + c * q[i] + d * length * v[i])
}

/// ±t, so that it points along `way`.
fn toward(t: Point3, way: Point3) -> Point3 {
    if dot(t, way) < 0.0 { t.map(|v| -v) } else { t }
}

/// What both lists hold.
fn both(a: &[u32], b: &[u32]) -> Vec<u32> {
    a.iter().copied().filter(|k| b.contains(k)).collect()
}

fn meet(u: &HalfLine, v: &HalfLine) -> bool {
    let share = |a: &[u32], b: &[u32]| a.iter().any(|k| b.contains(k));
    (share(&u.a, &v.a) && share(&u.b, &v.b)) || (share(&u.a, &v.b) && share(&u.b, &v.a))
}

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
