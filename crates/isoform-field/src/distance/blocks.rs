//! Evaluation of all pieces, or of one face, for a block of points at a time: first-order
//! distances, nearest faces, foot points on a face, and tests of foot points for lying on the
//! surface.
//!
//! The loops over lanes are compiled for several instruction sets (see [`crate::block`]).

use super::finder::{CLEAR_DISTANCE_RATIO, FootFinder, NearestPiece};
use super::search::{
    ACCEPTED_STEP_RATIO, CONVERGED_STEP_RATIO, COORDINATE_ROUNDING, FootSearch, MAX_DISTANCE_RATIO,
    MAX_FOOT_STEPS, aside, first_order, solve,
};
use crate::block::{LANES, Lane, Row};
use crate::shape::Join;
use isoform_geom::{Foot, Point3, dot, sub};
use isoform_num::dispatch;

/// Distance, in test steps, beyond which a piece has one sign in all sectors of a foot point.
/// Sectors extend over many steps if pieces meet at sharp angles (see
/// `PARALLEL_GRAM_DETERMINANT`).
const CLEAR_TEST_STEPS: f64 = 2e3;
const ZERO: Row = Lane([0.0; LANES]);

/// Iteration of points to their foot points on one face.
struct FaceIteration {
    /// Points.
    p: [Row; 3],
    /// Current positions of the foot points.
    q: [Row; 3],
    /// Unit normals at the previous positions.
    normal: [Row; 3],
    /// Length of the last step.
    moved: Row,
    /// Flag that is 1 for points that have converged.
    done: Row,
}

impl FootFinder<'_> {
    /// Computes the first-order distances of up to [`LANES`] points from all pieces into `off`.
    pub(super) fn first_order(&mut self, points: &[Point3]) {
        let mut rows = [ZERO; 3];
        for l in 0..LANES {
            let p = points[l.min(points.len() - 1)];
            (0..3).for_each(|x| rows[x].0[l] = p[x]);
        }
        let mut off = std::mem::take(&mut self.off);
        for (k, off) in off.iter_mut().enumerate() {
            let block = self.block(k);
            block.load_rows(&rows);
            block.forward();
            block.reverse();
            first_order_rows(block.result(0), block.by_space(), &mut off.0);
        }
        self.off = off;
    }

    /// Returns the piece whose distance in `off` is the tree's value, and true if all others are
    /// clearly farther.
    pub(super) fn nearest_faces(&mut self, points: &[Point3]) -> (NearestPiece, [bool; LANES]) {
        let nearest = self.nearest();
        let mut reach = ZERO;
        for l in 0..LANES {
            let p = points[l.min(points.len() - 1)];
            reach.0[l] = CLEAR_DISTANCE_RATIO * nearest.value.0[l].abs() + aside(p);
        }
        let mut near = [0; LANES];
        for off in &self.off {
            count_near(off, &reach, &mut near);
        }
        // The nearest one itself is within its own reach.
        (nearest, near.map(|count| count <= 1))
    }

    /// Evaluates the tree over the distances in `off`.
    fn nearest(&mut self) -> NearestPiece {
        let mut stack = std::mem::take(&mut self.nearest);
        stack.clear();
        let mut steps = self.solid.tree.iter().peekable();
        while let Some(step) = steps.next() {
            match step {
                Join::Part(k) => {
                    let off = &self.off[*k as usize];
                    let joined = steps.next_if(|next| !matches!(next, Join::Part(_)));
                    if let (Some(join), Some(first)) = (joined, stack.last_mut()) {
                        choose(first, off, &[*k; LANES], sign(join));
                    } else {
                        stack.push(NearestPiece {
                            value: *off,
                            piece: [*k; LANES],
                        });
                    }
                }
                join => {
                    let second = stack.pop().expect("a join has two inputs");
                    let first = stack.last_mut().expect("a join has two inputs");
                    choose(first, &second.value, &second.piece, sign(join));
                }
            }
        }
        let nearest = stack.pop().expect("a tree has a root");
        self.nearest = stack;
        nearest
    }

    /// Returns the first-order foot on piece k of point p, lane l of the last block of
    /// [`FootFinder::first_order`].
    pub(super) fn first_order_foot(&mut self, k: u32, l: usize, p: Point3) -> Foot {
        Foot {
            distance: self.off[k as usize].0[l],
            at: p,
            inward: self.normal(k as usize, l),
            pieces: [k; 3],
            order: 0,
            shares: [1.0, 0.0, 0.0],
        }
    }

    /// Returns the unit normal of piece k in lane l of the last block.
    pub(super) fn normal(&mut self, k: usize, l: usize) -> Point3 {
        let rows = self.block(k).by_space();
        first_order(1.0, [rows[0].0[l], rows[1].0[l], rows[2].0[l]]).1
    }

    /// Returns, for each search, true if its foot point lies on the surface of the solid: the tree
    /// takes both signs in the sectors that its pieces form around the foot point.
    pub(super) fn on_surface(&mut self, tries: &[FootSearch]) -> Vec<bool> {
        let good: Vec<usize> = (0..tries.len()).filter(|&t| tries[t].good).collect();
        let mut sound = vec![false; tries.len()];
        for good in good.chunks(LANES) {
            let at: Vec<Point3> = good.iter().map(|&t| tries[t].q).collect();
            self.first_order(&at);
            let (positive, close) = self.signs(&at);
            let own: Vec<&FootSearch> = good.iter().map(|&t| &tries[t]).collect();
            let is_on = self.has_both_signs(&own, &positive);
            for (l, &t) in good.iter().enumerate() {
                // Pieces as close as the step may have both signs near the foot point.
                sound[t] = if close[l] <= u64::from(tries[t].order) {
                    is_on >> l & 1 == 1
                } else {
                    self.is_boundary(&tries[t], l)
                };
            }
        }
        sound
    }

    /// Returns, for each piece, the lanes in which its value in `off` is positive, and the number
    /// of close pieces in each lane.
    fn signs(&self, at: &[Point3]) -> (Vec<u32>, [u64; LANES]) {
        let (mut reach, mut close) = (ZERO, [0; LANES]);
        for l in 0..LANES {
            reach.0[l] = CLEAR_TEST_STEPS * aside(at[l.min(at.len() - 1)]);
        }
        let positive = self.off.iter().map(|off| {
            count_near(off, &reach, &mut close);
            let bits = off.0.iter().enumerate();
            bits.fold(0, |mask, (l, d)| mask | u32::from(*d > 0.0) << l)
        });
        (positive.collect(), close)
    }

    /// Returns the lanes whose tree takes both signs if their own pieces take all combinations of
    /// signs and the others keep theirs.
    fn has_both_signs(&mut self, own: &[&FootSearch], positive: &[u32]) -> u32 {
        let most = own.iter().map(|t| t.order).max().unwrap_or(0);
        let (mut inside, mut outside) = (0, 0);
        let mut stack = Vec::new();
        for sector in 0..1_u32 << most {
            let mut leaves = positive.to_vec();
            for (l, t) in own.iter().enumerate() {
                for c in 0..usize::from(t.order) {
                    let leaf = &mut leaves[t.pieces[c] as usize];
                    *leaf = *leaf & !(1 << l) | (sector >> c & 1) << l;
                }
            }
            let value = self.solid.is_inside(&mut stack, &leaves);
            inside |= value;
            outside |= !value;
        }
        inside & outside
    }

    /// Returns true if the tree takes both signs a step away from the foot point in lane l, like
    /// [`FootFinder::has_both_signs`].
    fn is_boundary(&mut self, t: &FootSearch, l: usize) -> bool {
        let count = self.solid.pieces.len();
        let m: Vec<Point3> = (0..count).map(|k| self.normal(k, l)).collect();
        let pieces = &t.pieces[..t.order as usize];
        let normals: Vec<Point3> = pieces.iter().map(|&k| m[k as usize]).collect();
        let step = aside(t.q);
        let (mut inside, mut outside) = (false, false);
        for signs in 0..1_u32 << t.order {
            let wanted: [f64; 3] =
                std::array::from_fn(|c| if signs >> c & 1 == 1 { step } else { -step });
            let Some(shares) = solve(&normals, &wanted) else {
                return false;
            };
            let by: Point3 =
                std::array::from_fn(|x| normals.iter().zip(shares).map(|(m, s)| s * m[x]).sum());
            let off = &self.off;
            let value = self.solid.value(&mut self.stack, |k| {
                let own = if pieces.contains(&k) {
                    0.0
                } else {
                    off[k as usize].0[l]
                };
                own + dot(m[k as usize], by)
            });
            inside |= value > 0.0;
            outside |= value < 0.0;
        }
        inside && outside
    }

    /// Computes foot points on face k of the points in `wanted`, from their first-order distances
    /// and normals in `out`.
    pub(super) fn feet_on_face(
        &mut self,
        k: usize,
        wanted: &[u32],
        points: &[Point3],
        out: &mut [Foot],
    ) {
        let mut walk = FaceIteration::new(wanted, points, out);
        let block = self.block(k);
        for _ in 1..MAX_FOOT_STEPS {
            block.load_rows(&walk.q);
            block.forward();
            block.reverse();
            step(&mut walk, block.result(0), block.by_space());
            if walk.done.0.iter().all(|d| *d == 1.0) {
                break;
            }
        }
        for (l, i) in wanted.iter().enumerate() {
            walk.settle(l, points[*i as usize], &mut out[*i as usize]);
        }
    }
}

impl FaceIteration {
    /// Makes the first steps of the points in `wanted`, along the normals in `feet`.
    fn new(wanted: &[u32], points: &[Point3], feet: &[Foot]) -> Self {
        let mut walk = Self {
            p: [ZERO; 3],
            q: [ZERO; 3],
            normal: [ZERO; 3],
            moved: ZERO,
            done: ZERO,
        };
        for l in 0..LANES {
            let i = wanted[l.min(wanted.len() - 1)] as usize;
            let foot = &feet[i];
            for x in 0..3 {
                walk.p[x].0[l] = points[i][x];
                walk.q[x].0[l] = points[i][x] - foot.distance * foot.inward[x];
            }
        }
        walk
    }

    /// Writes the foot point of p, in lane l, if it has reached the face and is plausible.
    fn settle(&self, l: usize, p: Point3, foot: &mut Foot) {
        let q: Point3 = std::array::from_fn(|x| self.q[x].0[l]);
        let normal: Point3 = std::array::from_fn(|x| self.normal[x].0[l]);
        let away = sub(p, q);
        let far = dot(away, away).sqrt();
        let size = p.iter().fold(0.0_f64, |s, v| s.max(v.abs()));
        let has_met =
            self.moved.0[l] <= ACCEPTED_STEP_RATIO * far + 1e3 * COORDINATE_ROUNDING * size;
        // A larger ratio occurs only if the first-order distance is meaningless.
        if has_met && far <= MAX_DISTANCE_RATIO * foot.distance.abs() + aside(p) {
            foot.distance = dot(away, normal);
            (foot.at, foot.inward, foot.order) = (q, normal, 1);
        }
    }
}

dispatch! {
    /// Computes g/|∇g| by lane; a very large distance if the gradient vanishes or is not finite.
    fn first_order_rows(value: &[f64; LANES], gradient: &[Row], out: &mut [f64; LANES]) = first_order_rows_body
}

#[inline(always)]
fn first_order_rows_body(value: &[f64; LANES], gradient: &[Row], out: &mut [f64; LANES]) {
    let (x, y, z) = (&gradient[0].0, &gradient[1].0, &gradient[2].0);
    for l in 0..LANES {
        let g = value[l];
        let length = (x[l] * x[l] + y[l] * y[l] + z[l] * z[l]).sqrt();
        let d = (g / length).clamp(-1e150, 1e150);
        let is_sound = length > 0.0 && length.is_finite() && g.is_finite();
        let none = if g < 0.0 { -1e150 } else { 1e150 };
        out[l] = if is_sound { d } else { none };
    }
}

dispatch! {
    /// Selects the second value in lanes in which it is less, or with the `sign` −1, greater.
    fn choose(first: &mut NearestPiece, value: &Row, piece: &[u32; LANES], sign: f64) = choose_body
}

#[inline(always)]
fn choose_body(first: &mut NearestPiece, value: &Row, piece: &[u32; LANES], sign: f64) {
    for l in 0..LANES {
        if sign * value.0[l] < sign * first.value.0[l] {
            first.value.0[l] = value.0[l];
            first.piece[l] = piece[l];
        }
    }
}

/// Returns 1 for a minimum, −1 for a maximum.
fn sign(join: &Join) -> f64 {
    if *join == Join::Max { -1.0 } else { 1.0 }
}

dispatch! {
    /// Counts the pieces within reach in each lane.
    fn count_near(off: &Row, reach: &Row, near: &mut [u64; LANES]) = count_near_body
}

#[inline(always)]
fn count_near_body(off: &Row, reach: &Row, near: &mut [u64; LANES]) {
    for l in 0..LANES {
        near[l] += u64::from(off.0[l].abs() <= reach.0[l]);
    }
}

dispatch! {
    /// Makes one step to the foot points, from the values and gradients at q.
    fn step(walk: &mut FaceIteration, value: &[f64; LANES], gradient: &[Row]) = step_body
}

#[inline(always)]
fn step_body(walk: &mut FaceIteration, value: &[f64; LANES], gradient: &[Row]) {
    let (gx, gy, gz) = (&gradient[0].0, &gradient[1].0, &gradient[2].0);
    for l in 0..LANES {
        let p: Point3 = [walk.p[0].0[l], walk.p[1].0[l], walk.p[2].0[l]];
        let q: Point3 = [walk.q[0].0[l], walk.q[1].0[l], walk.q[2].0[l]];
        let g: Point3 = [gx[l], gy[l], gz[l]];
        let squared = g[0] * g[0] + g[1] * g[1] + g[2] * g[2];
        let length = squared.sqrt();
        let along = g[0] * (q[0] - p[0]) + g[1] * (q[1] - p[1]) + g[2] * (q[2] - p[2]);
        let share = (along - value[l]) / squared;
        let to: Point3 = [
            p[0] + share * g[0],
            p[1] + share * g[1],
            p[2] + share * g[2],
        ];
        let (u, v, w) = (to[0] - q[0], to[1] - q[1], to[2] - q[2]);
        let moved = (u * u + v * v + w * w).sqrt();
        let far = (share * share * squared).sqrt();
        let size = p[0].abs().max(p[1].abs()).max(p[2].abs());
        // NaN ends the iteration; the comparison of `settle` then fails, and the foot point is
        // rejected.
        let has_settled =
            moved <= CONVERGED_STEP_RATIO * far + COORDINATE_ROUNDING * size || moved.is_nan();
        let is_done = walk.done.0[l] == 1.0;
        let keep = |old: f64, new: f64| if is_done { old } else { new };
        for x in 0..3 {
            walk.q[x].0[l] = keep(q[x], to[x]);
            walk.normal[x].0[l] = keep(walk.normal[x].0[l], g[x] / length);
        }
        walk.moved.0[l] = keep(walk.moved.0[l], moved);
        walk.done.0[l] = if is_done || has_settled { 1.0 } else { 0.0 };
    }
}
