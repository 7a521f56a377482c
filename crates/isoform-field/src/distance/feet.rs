//! Foot points on faces, edges and corners of a solid, and their derivatives by the parameters.

use super::finder::{CLEAR_DISTANCE_RATIO, FootFinder};
use super::search::{FootSearch, MAX_DISTANCE_RATIO, MAX_FOOT_STEPS, aside};
use crate::block::{Block, LANES};
use isoform_geom::{Foot, Point3, distance_squared, dot};

/// Maximum number of pieces near a point that are combined to edges and corners. A corner of more
/// faces is found as that of its nearest triple.
const MAX_NEAR_PIECES: usize = 5;

/// First-order feet of points.
struct FirstFeet {
    /// First-order distances: that of point i from piece k has the index k · points + i.
    off: Vec<f64>,
    /// For each piece, the points with this piece as the clearly nearest face.
    lone: Vec<Vec<u32>>,
    /// Points with several near faces.
    crowded: Vec<usize>,
}

/// Request to evaluate a piece: index of the [`FootSearch`] or foot, and index of the piece among
/// its pieces.
type EvaluationRequest = (u32, u8);

/// Point with several near pieces.
struct CrowdedPoint {
    /// Index of the point.
    point: usize,
    /// Nearest pieces, nearest first; the first `first` are used.
    near: Vec<u32>,
    first: usize,
    /// Distance to the nearest point found on the surface so far.
    best: f64,
}

impl CrowdedPoint {
    /// Selects the nearest of `count` pieces by their first-order distances `off`; at first only
    /// the pieces within reach are used.
    fn new(point: usize, count: u32, reach: f64, off: impl Fn(u32) -> f64) -> Self {
        let mut near: Vec<u32> = (0..count).collect();
        near.sort_by(|j, k| off(*j).total_cmp(&off(*k)));
        near.truncate(MAX_NEAR_PIECES);
        Self {
            point,
            first: near.iter().filter(|k| off(**k) <= reach).count(),
            near,
            best: f64::INFINITY,
        }
    }
}

impl FootFinder<'_> {
    /// Returns the feet of the points, and writes their distances.
    pub(super) fn distances(&mut self, points: &[Point3], out: &mut [f64]) -> Vec<Foot> {
        let mut feet = vec![Foot::NONE; points.len()];
        self.feet(points, &mut feet);
        out.iter_mut().zip(&feet).for_each(|(o, f)| *o = f.distance);
        feet
    }

    /// Computes the feet of the points. A point whose nearest face is clearly the nearest is
    /// projected to that face only.
    pub(super) fn feet(&mut self, points: &[Point3], out: &mut [Foot]) {
        let first = self.first_feet(points, out);
        for (k, wanted) in first.lone.iter().enumerate() {
            for wanted in wanted.chunks(LANES) {
                self.feet_on_face(k, wanted, points, out);
            }
        }
        if !first.crowded.is_empty() {
            self.crowded(points, &first.crowded, &first.off, out);
        }
    }

    /// Writes the first-order feet of the points, and separates the points with one near face from
    /// those with several.
    fn first_feet(&mut self, points: &[Point3], out: &mut [Foot]) -> FirstFeet {
        let (n, count) = (points.len(), self.solid.pieces.len());
        let mut found = FirstFeet {
            off: vec![0.0; n * count],
            lone: vec![Vec::new(); count],
            crowded: Vec::new(),
        };
        for (c, chunk) in points.chunks(LANES).enumerate() {
            let first = c * LANES;
            self.first_order(chunk);
            let (nearest, alone) = self.nearest_faces(chunk);
            for k in 0..count {
                let at = k * n + first;
                found.off[at..at + chunk.len()].copy_from_slice(&self.off[k].0[..chunk.len()]);
            }
            for (l, p) in chunk.iter().enumerate() {
                let piece = nearest.piece[l];
                out[first + l] = self.first_order_foot(piece, l, *p);
                if alone[l] {
                    found.lone[piece as usize].push((first + l) as u32);
                } else {
                    found.crowded.push(first + l);
                }
            }
        }
        found
    }

    /// Returns, for each piece, the points within twice the half thickness `shell` and their
    /// first-order feet.
    fn within_shells(&mut self, points: &[Point3], shell: f64) -> Vec<(Vec<Foot>, Vec<Point3>)> {
        let mut near = vec![(Vec::new(), Vec::new()); self.solid.pieces.len()];
        for chunk in points.chunks(LANES) {
            self.first_order(chunk);
            for (k, (near, from)) in near.iter_mut().enumerate() {
                for (l, p) in chunk.iter().enumerate() {
                    if self.off[k].0[l].abs() < 2.0 * shell {
                        near.push(self.first_order_foot(k as u32, l, *p));
                        from.push(*p);
                    }
                }
            }
        }
        near
    }

    /// Appends the projections to each piece of the points in its shell that lie on the surface.
    pub(super) fn area_samples(&mut self, points: &[Point3], shell: f64, found: &mut Vec<Foot>) {
        let shells = self.within_shells(points, shell);
        for (k, (mut near, from)) in shells.into_iter().enumerate() {
            let all: Vec<u32> = (0..near.len() as u32).collect();
            for wanted in all.chunks(LANES) {
                self.feet_on_face(k, wanted, &from, &mut near);
            }
            near.retain(|f| f.order == 1 && f.distance.abs() < shell);
            let tries: Vec<FootSearch> = near.iter().map(FootSearch::finished).collect();
            let sound = self.on_surface(&tries);
            for (foot, _) in near.iter().zip(&sound).filter(|(_, s)| **s) {
                found.push(Foot {
                    distance: 0.0,
                    ..*foot
                });
            }
        }
    }

    /// Computes foot points of points with several near pieces. The pieces within
    /// [`CLEAR_DISTANCE_RATIO`] first-order distances are tried first: a farther piece matters only
    /// if all of them fail.
    fn crowded(&mut self, points: &[Point3], crowded: &[usize], d: &[f64], out: &mut [Foot]) {
        let (n, count) = (points.len(), self.solid.pieces.len() as u32);
        let case = |&i: &usize| {
            let reach = CLEAR_DISTANCE_RATIO * out[i].distance.abs() + aside(points[i]);
            CrowdedPoint::new(i, count, reach, |k| d[k as usize * n + i].abs())
        };
        let mut cases: Vec<CrowdedPoint> = crowded.iter().map(case).collect();
        self.combine(points, &mut cases, d, out);
        cases.retain(|c| c.best.is_infinite() && c.first < c.near.len());
        for case in &mut cases {
            case.first = case.near.len();
        }
        self.combine(points, &mut cases, d, out);
    }

    /// Tries faces, nearest first, then edges, then corners of the first pieces of each point, as
    /// long as they can be nearer than the nearest point found so far.
    fn combine(
        &mut self,
        points: &[Point3],
        cases: &mut [CrowdedPoint],
        d: &[f64],
        out: &mut [Foot],
    ) {
        for face in 0..MAX_NEAR_PIECES {
            self.combine_some(points, cases, d, out, |near, each| {
                if let Some(&k) = near.get(face) {
                    each([k; 3], 1);
                }
            });
        }
        for order in 2..=3 {
            self.combine_some(points, cases, d, out, |near, each| {
                combinations(near, order, &mut |pieces| each(pieces, order));
            });
        }
    }

    /// Tries the combinations that `choose` forms of the first pieces of each point.
    fn combine_some(
        &mut self,
        points: &[Point3],
        cases: &mut [CrowdedPoint],
        d: &[f64],
        out: &mut [Foot],
        choose: impl Fn(&[u32], &mut dyn FnMut([u32; 3], usize)),
    ) {
        let (mut tries, whose) = useful_tries(points, cases, d, choose);
        self.descend(points, &mut tries);
        let sound = self.on_surface(&tries);
        for ((t, &c), sound) in tries.iter().zip(&whose).zip(&sound) {
            let away = distance_squared(points[t.point as usize], t.q).sqrt();
            if *sound && away < cases[c].best {
                cases[c].best = away;
                t.settle(points, out);
            }
        }
    }
    /// Iterates all searches to their foot points, in blocks by piece.
    pub(super) fn descend(&mut self, points: &[Point3], tries: &mut [FootSearch]) {
        let mut by_piece: Vec<Vec<EvaluationRequest>> = vec![Vec::new(); self.solid.pieces.len()];
        let mut at = Vec::new();
        for _ in 0..MAX_FOOT_STEPS {
            by_piece.iter_mut().for_each(Vec::clear);
            for (t, one) in tries.iter().enumerate().filter(|(_, t)| !t.done) {
                for c in 0..one.order {
                    by_piece[one.pieces[c as usize] as usize].push((t as u32, c));
                }
            }
            if by_piece.iter().all(Vec::is_empty) {
                break;
            }
            for (k, wanted) in by_piece.iter().enumerate().filter(|(_, w)| !w.is_empty()) {
                at.clear();
                at.extend(wanted.iter().map(|w| tries[w.0 as usize].q));
                self.evaluate(k, &at, |i, g, grad| {
                    let (t, c) = wanted[i];
                    let one = &mut tries[t as usize];
                    (one.g[c as usize], one.grad[c as usize]) = (g, grad);
                });
            }
            for t in tries.iter_mut().filter(|t| !t.done) {
                t.step(points[t.point as usize]);
            }
        }
    }

    /// Computes ∂d/∂a by the envelope theorem, one row per foot.
    pub(super) fn by_params(&mut self, feet: &[Foot], jac: &mut [f64]) {
        jac.fill(0.0);
        let mut wanted: Vec<Vec<EvaluationRequest>> = vec![Vec::new(); self.solid.pieces.len()];
        for (i, foot) in feet.iter().enumerate() {
            for c in 0..foot.order.max(1) {
                wanted[foot.pieces[c as usize] as usize].push((i as u32, c));
            }
        }
        for (k, wanted) in wanted.iter().enumerate().filter(|(_, w)| !w.is_empty()) {
            self.add_shares(k, wanted, feet, jac);
        }
    }

    /// Adds λ ∂g/∂a/|∇g| of piece k at the feet in which it has the coefficient λ.
    fn add_shares(&self, k: usize, wanted: &[EvaluationRequest], feet: &[Foot], jac: &mut [f64]) {
        let (piece, m) = (&self.solid.pieces[k], self.solid.n_params);
        let at: Vec<Point3> = wanted.iter().map(|w| feet[w.0 as usize].at).collect();
        let mut block = Block::gradients(&piece.tape, &piece.by_all);
        block.bind(self.a);
        for (chunk, wanted) in at.chunks(LANES).zip(wanted.chunks(LANES)) {
            block.load(chunk);
            block.forward();
            block.reverse();
            let by_space = block.by_space();
            for (l, (i, s)) in wanted.iter().enumerate() {
                let gradient: Point3 = std::array::from_fn(|x| by_space[x].0[l]);
                let length = dot(gradient, gradient).sqrt();
                let share = feet[*i as usize].shares[*s as usize] / length.max(1e-300);
                let row = &mut jac[*i as usize * m..(*i as usize + 1) * m];
                for (v, by) in row.iter_mut().zip(block.by_params()) {
                    *v += share * by.0[l];
                }
            }
        }
    }
}

/// Returns searches for the combinations that `choose` forms of the first pieces of each point, if
/// they can be nearer than the nearest point found so far; and the index of the point of each.
fn useful_tries(
    points: &[Point3],
    cases: &[CrowdedPoint],
    d: &[f64],
    choose: impl Fn(&[u32], &mut dyn FnMut([u32; 3], usize)),
) -> (Vec<FootSearch>, Vec<usize>) {
    let n = points.len();
    let (mut tries, mut whose) = (Vec::new(), Vec::new());
    for (c, case) in cases.iter().enumerate() {
        let p = points[case.point];
        let off = |k: u32| d[k as usize * n + case.point].abs();
        choose(&case.near[..case.first], &mut |pieces, order| {
            // The foot on a combination is not nearer than its farthest piece.
            let least = pieces[..order].iter().map(|&k| off(k)).fold(0.0, f64::max);
            if least < case.best {
                let most = case.best.min(MAX_DISTANCE_RATIO * least + aside(p));
                tries.push(FootSearch {
                    most,
                    ..FootSearch::new(case.point, pieces, order as u8, p)
                });
                whose.push(c);
            }
        });
    }
    (tries, whose)
}

/// Calls `each` with every combination of `order` pieces.
fn combinations(near: &[u32], order: usize, each: &mut impl FnMut([u32; 3])) {
    for (i, &u) in near.iter().enumerate() {
        if order == 1 {
            each([u; 3]);
            continue;
        }
        for (j, &v) in near.iter().enumerate().skip(i + 1) {
            if order == 2 {
                each([u, v, v]);
                continue;
            }
            for &w in &near[j + 1..] {
                each([u, v, w]);
            }
        }
    }
}
