//! Steps along a curve.

use super::{CurveEnd, Tracer, aligned_with, common_elements};
use crate::features::CornerKind;
use crate::features::context::FeatureContext;
use crate::features::junction::{CurveState, HalfLine};
use crate::features::newton::{add_scaled, branch, normalised, onto_two, unit};
use isoform_geom::{Point3, cross, dot, norm, sub};

/// Minimum cosine of the angle by which a curve turns on a step, 10 degrees.
const MIN_STEP_COSINE: f64 = 0.985;
/// Maximum distance between a point on the tangent and the corrected point, as a fraction of the
/// step.
pub(super) const MAX_TANGENT_MISS: f64 = 0.3;
/// Minimum length of a step, in sizes.
const MIN_TRACE_STEP: f64 = 1e-3;
/// Maximum number of steps of one curve; at size/2 each that is far longer than the curves of a
/// solid of the largest allowed extent.
const MAX_TRACE_STEPS: usize = 200_000;
/// Distance ahead at which known points may end the curve, in steps.
const CORNER_SIGHT_STEPS: f64 = 1.5;
/// Angle by which the curve should turn in the next step (8 degrees), and lower bound of the last
/// turn with which it is compared.
const NEXT_TURN_RADIANS: [f64; 2] = [0.14, 0.035];

/// Current position of a trace: point, unit tangent, pieces and state of the curve.
#[derive(Clone, Debug)]
pub(super) struct Walk {
    pub(super) p: Point3,
    pub(super) t: Point3,
    pub(super) pair: [u32; 2],
    pub(super) state: CurveState,
}

/// Start of a curve, and the direction there; a closed curve returns to it in that direction.
#[derive(Clone, Copy)]
pub(super) struct CurveStart {
    pub(super) p: Point3,
    pub(super) t: Point3,
}

impl FeatureContext<'_> {
    /// Starts a walk at `p` in the direction of `way`; `None` if the curve is not a feature there.
    fn start(&self, p: Point3, pair: [u32; 2], n: [Point3; 2], way: Point3) -> Option<Walk> {
        let t = aligned_with(unit(cross(n[0], n[1])), way);
        let state = self.state(p, pair, t)?;
        Some(Walk { p, t, pair, state })
    }

    /// Returns the first point of a curve that leaves a corner.
    pub(super) fn depart(&self, origin: Point3, line: &HalfLine) -> Option<Walk> {
        let (size, pair) = (self.size(), line.pair);
        if let Some(p) = line.by {
            let a = normalised(self.solid, pair[0], p)?;
            let b = normalised(self.solid, pair[1], p)?;
            return self.start(p, pair, [a.n, b.n], sub(p, origin));
        }
        // Shorter steps follow, down to the minimum.
        let mut step = 0.125 * size;
        while step > MIN_TRACE_STEP * 0.1 * size {
            let ahead = add_scaled(origin, line.direction, step);
            if let Some((p, n)) = onto_two(self.solid, pair, ahead, MAX_TANGENT_MISS * step)
                && let Some(walk) = self.start(p, pair, n, sub(p, origin))
            {
                return Some(walk);
            }
            step *= 0.25;
        }
        None
    }

    /// Returns the walk from `p` backwards, with the pieces that a walk in the direction `t` had at
    /// its end.
    pub(super) fn reversed(&self, p: Point3, t: Point3, last: &Walk) -> Option<Walk> {
        let t = t.map(|v| -v);
        let state = self.state(p, last.pair, t)?;
        Some(Walk {
            p,
            t,
            pair: last.pair,
            state: CurveState {
                a: common_elements(&state.a, &last.state.a),
                b: common_elements(&state.b, &last.state.b),
                ..state
            },
        })
    }

    /// Returns the next point of a curve and the tangent there; `None` if the step is too long.
    fn advance(&self, walk: &Walk, step: f64) -> Option<(Point3, Point3)> {
        let ahead = add_scaled(walk.p, walk.t, step);
        let (q, n) = onto_two(self.solid, walk.pair, ahead, MAX_TANGENT_MISS * step)?;
        let t = aligned_with(unit(cross(n[0], n[1])), walk.t);
        // Past a point where the normals are parallel their product points back.
        (dot(t, walk.t) > MIN_STEP_COSINE && dot(sub(q, walk.p), walk.t) > 0.5 * step)
            .then_some((q, t))
    }

    /// Returns the walk at `q`; `None` if the curve is a different feature there.
    pub(super) fn goes_on(&self, walk: &Walk, q: Point3, t: Point3) -> Option<Walk> {
        let next = self.state(q, walk.pair, t)?;
        let (a, b) = (
            common_elements(&walk.state.a, &next.a),
            common_elements(&walk.state.b, &next.b),
        );
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
            state: CurveState { a, b, ..after },
        })
    }

    /// Returns true if the curve leads straight to `target`, at most `reach` ahead. It may fade out
    /// on the way if `may_fade` is set.
    pub(super) fn leads_to(&self, walk: &Walk, target: Point3, reach: f64, may_fade: bool) -> bool {
        let way = sub(target, walk.p);
        let length = norm(way);
        // The direction differs by more than 15 degrees.
        if length > reach || dot(way, walk.t) < 0.966 * length {
            return false;
        }
        if length < 1e-6 * self.size() {
            return true;
        }
        let middle = add_scaled(walk.p, way, 0.5);
        // A straight way passes near the curve.
        let Some((m, _)) = onto_two(self.solid, walk.pair, middle, 0.15 * length) else {
            return false;
        };
        match self.state(m, walk.pair, unit(way)) {
            Some(state) => state.faces == walk.state.faces,
            None => {
                let angle = self.angle_at(m, walk.pair);
                // The curve may be fading.
                may_fade && angle.is_some_and(|a| a < 4.0 * self.options.smallest_angle)
            }
        }
    }
}

impl Tracer<'_> {
    /// Traces a curve until it ends; a curve closes at `home`.
    pub(super) fn follow(
        &mut self,
        mut walk: Walk,
        points: &mut Vec<Point3>,
        home: Option<CurveStart>,
    ) -> (CurveEnd, Walk) {
        let search = self.search;
        let size = search.size();
        let mut step = 0.25 * size;
        for n in 0..MAX_TRACE_STEPS {
            if n % 8 == 7 && search.control.is_stopped() {
                break;
            }
            if let Some(c) = self.corner_ahead(&walk, CORNER_SIGHT_STEPS * step, None) {
                return (CurveEnd::Corner(c), walk);
            }
            let is_home = |home: CurveStart| {
                dot(home.t, walk.t) > 0.5
                    && search.leads_to(&walk, home.p, CORNER_SIGHT_STEPS * step, false)
            };
            if points.len() > 2 && home.is_some_and(is_home) {
                return (CurveEnd::Closed, walk);
            }
            let Some((q, t)) = search.advance(&walk, step) else {
                step *= 0.5;
                if step > MIN_TRACE_STEP * size {
                    continue;
                }
                return (self.singular_end(&walk), walk);
            };
            match search.goes_on(&walk, q, t) {
                Some(next) => {
                    let turn = dot(t, walk.t).clamp(-1.0, 1.0).acos();
                    walk = next;
                    points.push(q);
                    let longer =
                        (NEXT_TURN_RADIANS[0] / turn.max(NEXT_TURN_RADIANS[1])).clamp(0.5, 2.0);
                    step = (step * longer).min(0.5 * size);
                }
                // A shorter step is tried before the change is located.
                None if step > 0.3 * size => step *= 0.5,
                None => {
                    let end = self.event(&mut walk, q, points);
                    return (end, walk);
                }
            }
        }
        self.lost = true;
        (CurveEnd::Open, walk)
    }

    /// Ends a curve where every step is too long: the normals become parallel.
    fn singular_end(&mut self, walk: &Walk) -> CurveEnd {
        let reach = 0.1 * self.search.size();
        if let Some((b, _)) = branch(self.search.solid, walk.pair, walk.p, reach)
            && let Some(c) = self.add_corner(b, CornerKind::Branch)
        {
            return CurveEnd::Corner(c);
        }
        self.force_corner(walk.p, CornerKind::Fading)
    }
}
