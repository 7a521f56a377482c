//! Steps along a curve.

use super::{End, Tracer, both, toward};
use crate::features::CornerKind;
use crate::features::junction::{HalfLine, State};
use crate::features::newton::{along, branch, normalised, onto_two, unit};
use crate::features::search::Search;
use isoform_geom::{Point3, cross, dot, norm, sub};

/// Cosine of the angle by which a curve may turn on a step, 10 degrees.
const TURN: f64 = 0.985;
/// Part of a step by which the corrected point may miss the tangent's.
pub(super) const MISS: f64 = 0.3;
/// Steps are not made shorter than this part of the size.
const SHORTEST: f64 = 1e-3;
/// A point ahead is where the curve is going if the direction to it differs by no more than 15
/// degrees.
const AHEAD: f64 = 0.966;
/// Steps of one curve; at size/2 each that is far more than a solid of the largest allowed extent
/// has.
const STEPS: usize = 200_000;
/// Steps between two looks at the clock.
const LOOK: usize = 8;
/// First step away from a corner, in sizes; shorter ones are each a quarter as long.
const DEPARTURE: f64 = 0.125;
/// First step of a curve, in sizes.
const FIRST: f64 = 0.25;
/// Longest step, in sizes.
const LONGEST: f64 = 0.5;
/// If the curve changes within a step longer than this, in sizes, a shorter step is tried before
/// the change is looked for.
const LONG: f64 = 0.3;
/// Steps ahead within which the curve may end in a known point.
const SIGHT: f64 = 1.5;
/// The least part of a step by which the curve must advance along its tangent.
const FORWARD: f64 = 0.5;
/// Least cosine between the directions in which a closed curve leaves its beginning and comes back
/// to it.
const HOMEWARD: f64 = 0.5;
/// The angle that the curve shall turn by in the next step (8 degrees), and the least turn that
/// this is compared with.
const NEXT_TURN: [f64; 2] = [0.14, 0.035];
/// A target nearer than this part of the size is reached.
const REACHED: f64 = 1e-6;
/// Distance, in lengths of the way, by which the curve may miss the middle of a straight way.
const BULGE: f64 = 0.15;
/// A curve may be fading where the angle between its pieces is below this many times the smallest
/// angle of a feature.
const FADING: f64 = 4.0;
/// Distance, in sizes, within which a branch point is sought where a curve becomes singular.
const BRANCH_REACH: f64 = 0.1;

/// Where a curve is being followed.
#[derive(Clone, Debug)]
pub(super) struct Walk {
    pub(super) p: Point3,
    pub(super) t: Point3,
    pub(super) pair: [u32; 2],
    pub(super) state: State,
}

/// Where a curve began: it closes where it comes by there in this direction.
#[derive(Clone, Copy)]
pub(super) struct Home {
    pub(super) p: Point3,
    pub(super) t: Point3,
}

impl Search<'_> {
    /// A walk in a curve through `p`, where it is a feature: on in the direction of `way`.
    fn start(&self, p: Point3, pair: [u32; 2], n: [Point3; 2], way: Point3) -> Option<Walk> {
        let t = toward(unit(cross(n[0], n[1])), way);
        let state = self.state(p, pair, t)?;
        Some(Walk { p, t, pair, state })
    }

    /// A first point of a curve that leaves a corner.
    pub(super) fn depart(&self, origin: Point3, line: &HalfLine) -> Option<Walk> {
        let (size, pair) = (self.size(), line.pair);
        if let Some(p) = line.by {
            let a = normalised(self.solid, pair[0], p)?;
            let b = normalised(self.solid, pair[1], p)?;
            return self.start(p, pair, [a.n, b.n], sub(p, origin));
        }
        let mut step = DEPARTURE * size;
        while step > SHORTEST * 0.1 * size {
            let ahead = along(origin, line.direction, step);
            if let Some((p, n)) = onto_two(self.solid, pair, ahead, MISS * step)
                && let Some(walk) = self.start(p, pair, n, sub(p, origin))
            {
                return Some(walk);
            }
            step *= 0.25;
        }
        None
    }

    /// The walk from `p` back, with the pieces that a walk in the direction `t` had at its end.
    pub(super) fn back(&self, p: Point3, t: Point3, last: &Walk) -> Option<Walk> {
        let t = t.map(|v| -v);
        let state = self.state(p, last.pair, t)?;
        Some(Walk {
            p,
            t,
            pair: last.pair,
            state: State {
                a: both(&state.a, &last.state.a),
                b: both(&state.b, &last.state.b),
                ..state
            },
        })
    }

    /// The next point of a curve and the tangent there; none where the step is too long for it.
    fn advance(&self, walk: &Walk, step: f64) -> Option<(Point3, Point3)> {
        let ahead = along(walk.p, walk.t, step);
        let (q, n) = onto_two(self.solid, walk.pair, ahead, MISS * step)?;
        let t = toward(unit(cross(n[0], n[1])), walk.t);
        // Past a point where the normals are parallel their product points back.
        (dot(t, walk.t) > TURN && dot(sub(q, walk.p), walk.t) > FORWARD * step).then_some((q, t))
    }

    /// The walk at `q`, if the curve is the same feature there as before.
    pub(super) fn goes_on(&self, walk: &Walk, q: Point3, t: Point3) -> Option<Walk> {
        let next = self.state(q, walk.pair, t)?;
        let (a, b) = (both(&walk.state.a, &next.a), both(&walk.state.b, &next.b));
        let kept = |sheet: &[u32], piece: u32| {
            let first = *sheet.first()?;
            Some(if sheet.contains(&piece) { piece } else { first })
        };
        let pair = [kept(&a, walk.pair[0])?, kept(&b, walk.pair[1])?];
        let (before, after) = if pair == walk.pair {
            (walk.state.faces, next)
        } else {
            let before = self.state(walk.p, pair, walk.t)?;
            (before.faces, self.state(q, pair, t)?)
        };
        (before == after.faces).then_some(Walk {
            p: q,
            t,
            pair,
            state: State { a, b, ..after },
        })
    }

    /// Whether the curve goes straight to `target`, at most `reach` ahead. It may fade out on the
    /// way if it `may_fade`.
    pub(super) fn leads_to(&self, walk: &Walk, target: Point3, reach: f64, may_fade: bool) -> bool {
        let way = sub(target, walk.p);
        let length = norm(way);
        if length > reach || dot(way, walk.t) < AHEAD * length {
            return false;
        }
        if length < REACHED * self.size() {
            return true;
        }
        let middle = along(walk.p, way, 0.5);
        let Some((m, _)) = onto_two(self.solid, walk.pair, middle, BULGE * length) else {
            return false;
        };
        match self.state(m, walk.pair, unit(way)) {
            Some(state) => state.faces == walk.state.faces,
            None => {
                let angle = self.angle_at(m, walk.pair);
                may_fade && angle.is_some_and(|a| a < FADING * self.options.smallest_angle)
            }
        }
    }
}

impl Tracer<'_> {
    /// Steps until the curve ends; `home` is where it would close.
    pub(super) fn follow(
        &mut self,
        mut walk: Walk,
        points: &mut Vec<Point3>,
        home: Option<Home>,
    ) -> (End, Walk) {
        let search = self.search;
        let size = search.size();
        let mut step = FIRST * size;
        for n in 0..STEPS {
            if n % LOOK == LOOK - 1 && search.control.is_stopped() {
                break;
            }
            if let Some(c) = self.corner_ahead(&walk, SIGHT * step, None) {
                return (End::Corner(c), walk);
            }
            let is_home = |home: Home| {
                dot(home.t, walk.t) > HOMEWARD
                    && search.leads_to(&walk, home.p, SIGHT * step, false)
            };
            if points.len() > 2 && home.is_some_and(is_home) {
                return (End::Closed, walk);
            }
            let Some((q, t)) = search.advance(&walk, step) else {
                step *= 0.5;
                if step > SHORTEST * size {
                    continue;
                }
                return (self.singular_end(&walk), walk);
            };
            match search.goes_on(&walk, q, t) {
                Some(next) => {
                    let turn = dot(t, walk.t).clamp(-1.0, 1.0).acos();
                    walk = next;
                    points.push(q);
                    let longer = (NEXT_TURN[0] / turn.max(NEXT_TURN[1])).clamp(0.5, 2.0);
                    step = (step * longer).min(LONGEST * size);
                }
                None if step > LONG * size => step *= 0.5,
                None => {
                    let end = self.event(&mut walk, q, points);
                    return (end, walk);
                }
            }
        }
        self.lost = true;
        (End::Open, walk)
    }

    /// Where no step is short enough: the normals become parallel.
    fn singular_end(&mut self, walk: &Walk) -> End {
        let reach = BRANCH_REACH * self.search.size();
        if let Some((b, _)) = branch(self.search.solid, walk.pair, walk.p, reach)
            && let Some(c) = self.add_corner(b, CornerKind::Branch)
        {
            return End::Corner(c);
        }
        self.force_corner(walk.p, CornerKind::Fading)
    }
}
