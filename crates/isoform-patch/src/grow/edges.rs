//! Growing up to the edges of a part.
//!
//! A patch grows on the smooth function of its part, which goes on beyond the part's edges; where a
//! side comes to an edge it is put onto it, if the whole side comes to the same edge nearby, and is
//! then held there by a term of the objective. Else it stops.

use super::{Growth, SPILL, balanced};
use crate::surface::contains;
use crate::whole::{Beyond, On};
use isoform_geom::{Field, Point3, RationalPatch, bernstein, dot, norm};
use isoform_num::linalg::{cholesky, cholesky_solve};

/// What a side of a patch does.
#[derive(Clone, Copy)]
pub(crate) enum Side<'f> {
    /// It moves outward.
    Free,
    /// It lies on an edge, where this vanishes.
    At(&'f dyn Field),
    /// It has come to an edge that it cannot follow.
    Stopped,
}

impl Side<'_> {
    pub(crate) fn is_at_edge(&self) -> bool {
        matches!(self, Self::At(_))
    }
}

/// The share of the tolerance by which a patch may reach beyond edges.
pub(crate) const OVERLAP: f64 = 0.3;
/// Samples along a side.
const SAMPLES: usize = 25;
/// The same where nothing must lie between them.
const FINE_SAMPLES: usize = 241;
/// Where something does, so many more within this of it.
const CLOSE_SAMPLES: usize = 161;
const CLOSE: f64 = 1.0 / 120.0;
/// Newton steps to where a parameter line meets an edge.
const STEPS: usize = 12;
/// How far in, and beyond an extrapolation, an edge may be that a side is put onto, in the patch's
/// lengths.
const REACH: (f64, f64) = (-0.6, 0.6);
/// Bisections towards an edge.
const BISECTIONS: usize = 12;
/// The share of a side that is near its end.
const NEAR_END: f64 = 0.25;
/// The most of a patch that is taken back at one side.
const MOST_TRIMMED: f64 = 0.4;
/// What lies beyond the region by more than this share of that is taken back to where sides stop.
const MOST_SPILL: f64 = 0.3;
/// A side that gets no farther than this share of the patch has come to its edge.
const STUCK: f64 = 0.02;

/// Numbers from 0 to 1.
fn evenly(count: usize) -> Vec<f64> {
    (0..count).map(|i| i as f64 / (count - 1) as f64).collect()
}

/// The parameters of the point at `t` along a side and `e` beyond it.
fn parameters(side: usize, t: f64, e: f64) -> (f64, f64) {
    match side {
        0 => (-e, t),
        1 => (1.0 + e, t),
        2 => (t, -e),
        _ => (t, 1.0 + e),
    }
}

/// The patch longer by a share at one side.
fn extended(patch: &RationalPatch, side: usize, share: f64) -> RationalPatch {
    let whole = (0.0, 1.0);
    match side {
        0 => patch.part((-share, 1.0), whole),
        1 => patch.part((0.0, 1.0 + share), whole),
        2 => patch.part(whole, (-share, 1.0)),
        _ => patch.part(whole, (0.0, 1.0 + share)),
    }
}

/// The coefficients in the Bernstein basis of what has these values at 0, 1/n, …, 1.
fn interpolated(values: &[[f64; 4]]) -> Option<Vec<[f64; 4]>> {
    let n = values.len();
    let rows: Vec<Vec<f64>> = (0..n)
        .map(|i| bernstein(n - 1, i as f64 / (n - 1) as f64).0)
        .collect();
    let mut normal: Vec<f64> = (0..n * n)
        .map(|k| rows.iter().map(|r| r[k / n] * r[k % n]).sum())
        .collect();
    if !cholesky(&mut normal, n) {
        return None;
    }
    let mut out = vec![[0.0; 4]; n];
    for k in 0..4 {
        let mut x: Vec<f64> = (0..n)
            .map(|i| rows.iter().zip(values).map(|(r, v)| r[i] * v[k]).sum())
            .collect();
        cholesky_solve(&normal, n, &mut x);
        for (o, x) in out.iter_mut().zip(x) {
            o[k] = x;
        }
    }
    Some(out)
}

impl<'f> Growth<'f> {
    /// How far the border lies beyond the edges of the part, or off the edges that it is held on.
    pub(crate) fn off_edges(&self, on: On<'f>) -> f64 {
        let mut most = 0.0f64;
        for side in 0..4 {
            for i in 0..SAMPLES {
                let (u, v) = parameters(side, i as f64 / (SAMPLES - 1) as f64, 0.0);
                let p = self.patch.point(u, v);
                if let Side::At(edge) = self.sides[side] {
                    let j = edge.jet(p);
                    most = most.max(j.v.abs() / norm(j.g));
                }
                most = most.max(on.beyond(p).map_or(0.0, |b| b.by));
            }
        }
        most
    }

    /// Whether a start patch lies on its part; one at an edge need not fit that yet.
    pub(crate) fn starts_within(
        on: On<'f>,
        patch: &RationalPatch,
        allowed: f64,
        at_edge: bool,
    ) -> bool {
        let first = usize::from(at_edge);
        (0..5).all(|i| {
            (first..5).all(|j| {
                on.beyond(patch.point(i as f64 / 4.0, j as f64 / 4.0))
                    .is_none_or(|b| b.by <= allowed)
            })
        })
    }

    /// Where a side lies farthest beyond an edge. Near its ends it may lie beyond those that its
    /// neighbours `held` are held on: Newton steps see to them.
    fn farthest(
        on: On<'f>,
        patch: &RationalPatch,
        side: usize,
        (allowed, samples): (f64, &[f64]),
        held: [Side<'f>; 2],
    ) -> Option<Beyond<'f>> {
        let mut worst: Option<Beyond<'f>> = None;
        for &t in samples {
            let (u, v) = parameters(side, t, 0.0);
            let Some(beyond) = on
                .beyond(patch.point(u, v))
                .filter(|b| b.by > worst.map_or(allowed, |w| w.by))
            else {
                continue;
            };
            let is_held = |side: Side<'f>| matches!(side, Side::At(edge) if std::ptr::addr_eq(edge, beyond.edge));
            if !(t < NEAR_END && is_held(held[0]) || t > 1.0 - NEAR_END && is_held(held[1])) {
                worst = Some(beyond);
            }
        }
        worst
    }

    /// Takes back sides that Newton steps have moved far beyond the region: where a surface can be
    /// shifted along itself, as a cylinder can, nothing else keeps them. Only to a tolerance, for
    /// which steps go far.
    fn trim_to_region(&mut self) {
        let mut patch = self.patch.clone();
        for side in 0..4 {
            let is_beyond = |share: f64, spill: f64| {
                let wide = self.wider(spill);
                let shorter = extended(&patch, side, -share);
                evenly(SAMPLES).into_iter().any(|t| {
                    let (u, v) = parameters(side, t, 0.0);
                    !contains(&wide, shorter.point(u, v))
                })
            };
            if !is_beyond(0.0, MOST_SPILL) || is_beyond(MOST_TRIMMED, SPILL) {
                continue;
            }
            let (mut lo, mut hi) = (0.0, MOST_TRIMMED);
            for _ in 0..BISECTIONS {
                let share = 0.5 * (lo + hi);
                if is_beyond(share, SPILL) {
                    lo = share
                } else {
                    hi = share
                }
            }
            patch = extended(&patch, side, -hi);
        }
        self.put(patch);
    }

    /// Whether no side lies far beyond the region.
    pub(crate) fn is_near_region(&self) -> bool {
        let wide = self.wider(MOST_SPILL);
        (0..4).all(|side| {
            evenly(SAMPLES).into_iter().all(|t| {
                let (u, v) = parameters(side, t, 0.0);
                contains(&wide, self.patch.point(u, v))
            })
        })
    }

    /// Takes a patch that is another one.
    fn put(&mut self, patch: RationalPatch) {
        if patch != self.patch
            && let patch = balanced(patch)
            && let Some((targets, at)) = self.retargeted(&patch)
        {
            self.take(patch, targets, at);
        }
    }

    /// Takes back sides that Newton steps have moved beyond edges, and far beyond the region.
    pub(crate) fn trim(&mut self) {
        if self.options.tolerance.is_some() {
            self.trim_to_region();
        }
        let samples = evenly(SAMPLES);
        self.trim_to(
            self.overlap(),
            &std::array::from_fn(|_| samples.clone()),
            false,
        );
    }

    /// Takes back what lies beyond edges by more than that between samples, too, above all near a
    /// place where that seems to be.
    pub(crate) fn trim_finely(&mut self, allowed: f64, near: Option<(f64, f64)>) {
        let samples = |side: usize| {
            let mut samples = evenly(FINE_SAMPLES);
            if let Some((u, v)) = near {
                let t = if side < 2 { v } else { u };
                let close = evenly(CLOSE_SAMPLES)
                    .into_iter()
                    .map(|s| t + (2.0 * s - 1.0) * CLOSE);
                samples.extend(close.filter(|t| (0.0..=1.0).contains(t)));
            }
            samples
        };
        self.trim_to(allowed, &std::array::from_fn(samples), true);
    }

    /// The same with samples for each side; with `held`, where that fails, what lies beyond edges
    /// that the neighbours are held on does not count.
    fn trim_to(&mut self, allowed: f64, samples: &[Vec<f64>; 4], held: bool) {
        if self.on.whole.is_single() {
            return;
        }
        let on = self.on;
        let mut patch = self.patch.clone();
        for side in 0..4 {
            if self.sides[side].is_at_edge() {
                continue;
            }
            let neighbours = if side < 2 {
                [self.sides[2], self.sides[3]]
            } else {
                [self.sides[0], self.sides[1]]
            };
            for neighbours in [Some([Side::Free; 2]), held.then_some(neighbours)]
                .into_iter()
                .flatten()
            {
                let is_beyond = |share: f64| {
                    let shorter = extended(&patch, side, -share);
                    Self::farthest(on, &shorter, side, (allowed, &samples[side]), neighbours)
                        .is_some()
                };
                if !is_beyond(0.0) {
                    break;
                }
                if is_beyond(MOST_TRIMMED) {
                    continue;
                }
                let (mut lo, mut hi) = (0.0, MOST_TRIMMED);
                for _ in 0..BISECTIONS {
                    let share = 0.5 * (lo + hi);
                    if is_beyond(share) {
                        lo = share
                    } else {
                        hi = share
                    }
                }
                patch = extended(&patch, side, -hi);
                break;
            }
        }
        self.put(patch);
    }

    /// The patch longer by shares of its edges at its four sides, but no longer than the part; and
    /// what its sides do then.
    pub(crate) fn within_edges(
        &self,
        on: On<'f>,
        by: [f64; 4],
        allowed: f64,
    ) -> (RationalPatch, [Side<'f>; 4]) {
        let (mut patch, mut sides) = (self.patch.clone(), self.sides);
        let samples = evenly(SAMPLES);
        for side in 0..4 {
            let longer = extended(&patch, side, by[side]);
            let held = if side < 2 {
                [sides[2], sides[3]]
            } else {
                [sides[0], sides[1]]
            };
            if by[side] <= 0.0 {
                patch = longer;
                continue;
            }
            let Some(beyond) = Self::farthest(on, &longer, side, (allowed, &samples), held) else {
                patch = longer;
                continue;
            };
            if let Some(put) = Self::put_on(&patch, side, by[side], beyond.edge) {
                (patch, sides[side]) = (put, Side::At(beyond.edge));
                continue;
            }
            let (mut lo, mut hi) = (0.0, by[side]);
            for _ in 0..BISECTIONS {
                let share = 0.5 * (lo + hi);
                match Self::farthest(
                    on,
                    &extended(&patch, side, share),
                    side,
                    (allowed, &samples),
                    held,
                ) {
                    None => lo = share,
                    Some(_) => hi = share,
                }
            }
            patch = extended(&patch, side, lo);
            if lo < STUCK {
                sides[side] = Side::Stopped;
            }
        }
        (balanced(patch), sides)
    }

    /// The patch with a side moved onto an edge; none where parameter lines do not meet it nearby.
    fn put_on(
        patch: &RationalPatch,
        side: usize,
        share: f64,
        edge: &dyn Field,
    ) -> Option<RationalPatch> {
        let (m, n) = patch.degree();
        let count = if side < 2 { n } else { m };
        let meets = |t: f64| {
            let mut e = 0.0f64;
            for _ in 0..STEPS {
                let (u, v) = parameters(side, t, e);
                let at = patch.tangents(u, v);
                let d: Point3 = match side {
                    0 => at.u.map(|x| -x),
                    1 => at.u,
                    2 => at.v.map(|x| -x),
                    _ => at.v,
                };
                let j = edge.jet(at.point);
                let step = j.v / dot(j.g, d);
                e = (e - step).clamp(2.0 * REACH.0, share + 2.0 * REACH.1);
                if !e.is_finite() {
                    return None;
                }
                if step.abs() < 1e-10 {
                    break;
                }
            }
            let (u, v) = parameters(side, t, e);
            let j = edge.jet(patch.point(u, v));
            (e > REACH.0
                && e < share + REACH.1
                && j.v.abs() <= 1e-6 * norm(j.g) * norm(patch.tangents(u, v).u))
            .then_some(e)
        };
        let moved: Vec<f64> = (0..=count)
            .map(|k| meets(k as f64 / count as f64))
            .collect::<Option<_>>()?;
        // Interpolated where the old patch is at new parameters: first along v for each u, then
        // along u.
        let value = |i: usize, j: usize| {
            let (s, t) = (i as f64 / m as f64, j as f64 / n as f64);
            let (u, v) = match side {
                0 => (-moved[j] + s * (1.0 + moved[j]), t),
                1 => (s * (1.0 + moved[j]), t),
                2 => (s, -moved[i] + t * (1.0 + moved[i])),
                _ => (s, t * (1.0 + moved[i])),
            };
            patch.homogeneous(u, v)[0]
        };
        let rows: Vec<Vec<[f64; 4]>> = (0..=m)
            .map(|i| interpolated(&(0..=n).map(|j| value(i, j)).collect::<Vec<_>>()))
            .collect::<Option<_>>()?;
        let columns: Vec<Vec<[f64; 4]>> = (0..=n)
            .map(|j| interpolated(&rows.iter().map(|r| r[j]).collect::<Vec<_>>()))
            .collect::<Option<_>>()?;
        let control = (0..=m)
            .flat_map(|i| columns.iter().map(move |c| c[i]))
            .collect();
        RationalPatch::new((m, n), control)
            .ok()
            .filter(|p| p.control_weights().0 > 0.0)
    }
}
