//! Distances of a patch from the surface, sampled and proved.
//!
//! The proof goes cell by cell. About a point c near a cell, F = F(c) + ∇F·δ + δᵀHδ/2 + Tδδδ/6 up
//! to a remainder by which third derivatives differ from T there; with the homogeneous patch put in
//! for δ, times w³, the first part is a Bézier polynomial, and the quotients of its coefficients by
//! those of w³ bound it. Where n·∇F ≥ G > 0 for a unit vector n in a neighbourhood of the cell that
//! is wider by M/G than the cell itself, and |F| ≤ M on the cell, the surface is at most M/G away
//! along ±n. Where no such n exists (at self-intersections) cells are divided until they are small
//! against the bound; then it suffices that F changes its sign between c and a point nearby.
//!
//! On patches that lie on the surface to rounding, M is that of F∘p where F is a polynomial. At a
//! self-intersection there are unit vectors e and f with eᵀHe ≥ λ and fᵀHf ≤ −λ about the cell:
//! along ±e, whichever way F does not fall, it has grown by λt²/2 after t, along f fallen by as
//! much, so that the surface is at most √(2M/λ) away.
//!
//! Minima and maxima of parts keep both arguments: n·∇F is at least the least of the parts' that
//! matter, and the tree carries bounds of the parts over to one of F. As only signs count, each
//! piece is first divided by its gradient's length at c. Where a piece changes from one part to
//! another, as where a blend begins, each is bounded where none of its limits is negative: there
//! λ + ρ ≥ 0 for the linear part λ of a limit that is off by up to ρ, and with b ≥ 0 the function
//! F ± b (max λ − λ)(λ + ρ) bounds F.

use crate::cells::{Place, divided, lengths, middle_of, parts};
use crate::compose::{binomial, largest};
use crate::surface::ON_SURFACE;
use crate::whole::{Whole, Within};
use isoform_geom::{Aabb, Csg, Expansion, Field, Point3, RationalPatch, norm, sub};
use isoform_num::linalg::symmetric_eigen;
use isoform_num::{Interval, Jet2};
use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::time::Instant;

/// Samples in each direction.
const SAMPLES: usize = 41;
/// Newton steps towards the surface.
const STEPS: usize = 25;
/// Corrections of foot points.
const CORRECTIONS: usize = 2;
/// The proved bound may be so many times the sampled distance; if that fails, so many times.
const SLACK: [f64; 2] = [1.8, 2.7];
/// At edges, one that is so many times the sampled distance is not made better.
const ENOUGH: f64 = 2.5;
/// Bounds below this share of the largest coordinate are lost in rounding.
const ROUNDING: f64 = 1e-13;
/// Flat faces come to less, with few cells.
const LEAST_REFINED: f64 = 3e-14;
/// A patch this near to the surface, in units of the largest coordinate, lies on it to rounding. Of
/// such a one
const EXACT: f64 = 1e-12;
/// these bounds are tried in turn, with so many cells: what is left of rounding; at
/// self-intersections its root; and what expansions come to.
const EXACT_TARGETS: [(f64, usize); 3] = [(1e-13, 2000), (1e-12, 2000), (1e-6, 60_000)];
/// Compositions are worth their cost for bounds below this share of the largest coordinate.
const COMPOSED: f64 = 1e-5;
/// Cells that may be looked at.
const MOST_CELLS: usize = 60_000;
/// The same at edges, for a first bound,
const MOST_CELLS_AT_EDGES: usize = 6000;
/// and where it is made better cell by cell.
const MOST_REFINED: usize = 16_000;
/// Newton steps to a foot point about which the sign is looked at.
const FOOT_STEPS: usize = 8;
/// At self-intersections the bound is about the root of the distance times the size of a cell: it
/// is tried for cells up to so many times as large as what is to be proved.
const CROSSING: f64 = 4.0;
/// Divisions of the patch.
const MOST_DEPTH: u32 = 24;
/// The same where cells are halved in one direction at a time.
const MOST_HALVINGS: u32 = 40;
/// Halves in one direction whose bounds are less than so many times as large as those in the other
/// are no better:
const ALIKE: f64 = 1.2;
/// then, and where a cell is so many times as long as wide, the longer direction is halved.
const NARROW: f64 = 200.0;
/// The error of subdivision, per level of de Casteljau's algorithm, in the largest homogeneous
/// coordinate of the whole patch: half a unit, for points three coordinates of which are so far
/// off.
const SUBDIVISION: f64 = 0.5 * 1.8 * f64::EPSILON;
/// So many levels stand for what is rounded besides.
const OTHER_LEVELS: f64 = 16.0;

/// Distances from the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distances {
    /// No point of the patch is farther from the surface; none where that could not be proved.
    pub bound: Option<f64>,
    /// The largest distance among samples.
    pub sampled: f64,
    /// The root mean square over the area, by samples.
    pub rms: f64,
}

/// Samples the distance of a patch from the surface in a square grid of so many samples (at least
/// 2) in each direction: the largest, and the root mean square over the area.
pub fn sampled(field: &dyn Field, patch: &RationalPatch, samples: usize) -> (f64, f64) {
    sampled_by(patch, samples, &|points| foot_distances(field, points))
}

/// The same of a whole surface: where it has parts, to first order.
pub(crate) fn sampled_on(whole: &Whole<'_>, patch: &RationalPatch, samples: usize) -> (f64, f64) {
    if whole.is_single() {
        return sampled(whole.field(0), patch, samples);
    }
    sampled_by(patch, samples, &|points| {
        points
            .iter()
            .map(|p| whole.first_order(*p).0.abs())
            .collect()
    })
}

fn sampled_by(
    patch: &RationalPatch,
    samples: usize,
    distances: &dyn Fn(&[Point3]) -> Vec<f64>,
) -> (f64, f64) {
    let mut points = Vec::with_capacity(samples * samples);
    let mut areas = Vec::with_capacity(samples * samples);
    for i in 0..samples {
        for j in 0..samples {
            let t = patch.tangents(
                i as f64 / (samples - 1) as f64,
                j as f64 / (samples - 1) as f64,
            );
            points.push(t.point);
            // The trapezoidal rule: half at the border.
            let half = |i: usize| if i == 0 || i == samples - 1 { 0.5 } else { 1.0 };
            areas.push(norm(t.normal()) * half(i) * half(j));
        }
    }
    let distances = distances(&points);
    let (mut most, mut sum, mut area) = (0.0f64, 0.0, 0.0);
    for (d, a) in distances.iter().zip(&areas) {
        most = most.max(*d);
        sum += d * d * a;
        area += a;
    }
    (most, (sum / area).sqrt())
}

/// Distances of points from the surface, by foot points: exact where these converge to the nearest
/// one, too large elsewhere.
pub fn foot_distances(field: &dyn Field, points: &[Point3]) -> Vec<f64> {
    let mut feet = points.to_vec();
    let mut jets = project_all(field, &mut feet);
    let mut best: Vec<f64> = feet
        .iter()
        .zip(points)
        .map(|(q, p)| norm(sub(*p, *q)))
        .collect();
    for _ in 0..CORRECTIONS {
        // The part of p − q in the tangent plane leads to a better start.
        let mut moved: Vec<Point3> = Vec::with_capacity(points.len());
        for ((p, q), j) in points.iter().zip(&feet).zip(&jets) {
            let (d, g2) = (sub(*p, *q), j.g.iter().map(|g| g * g).sum::<f64>());
            let along = if g2 > 0.0 {
                (d[0] * j.g[0] + d[1] * j.g[1] + d[2] * j.g[2]) / g2
            } else {
                0.0
            };
            moved.push(std::array::from_fn(|k| q[k] + d[k] - along * j.g[k]));
        }
        jets = project_all(field, &mut moved);
        for ((b, q), p) in best.iter_mut().zip(&moved).zip(points) {
            *b = b.min(norm(sub(*p, *q)));
        }
        feet = moved;
    }
    best
}

/// Moves points onto the surface along gradients; gives back the jets there.
fn project_all(field: &dyn Field, points: &mut [Point3]) -> Vec<Jet2> {
    let mut jets = vec![
        Jet2 {
            v: 0.0,
            g: [0.0; 3],
            h: [0.0; 6]
        };
        points.len()
    ];
    for _ in 0..STEPS {
        field.jets(points, &mut jets);
        let mut most = 0.0f64;
        for (p, j) in points.iter_mut().zip(&jets) {
            let g2: f64 = j.g.iter().map(|g| g * g).sum();
            let step = j.v / g2;
            if j.v == 0.0 || !step.is_finite() {
                continue;
            }
            most = most.max(step.abs() * g2.sqrt());
            for k in 0..3 {
                p[k] -= step * j.g[k];
            }
        }
        if most <= ON_SURFACE {
            break;
        }
    }
    jets
}

/// Measures and proves: the bound is at least what is sampled, and aims at no more than 1.8 times
/// that (2.7 times where that cannot be proved) and, if that is not less than what is sampled, at
/// no more than the tolerance.
pub fn distances(field: &dyn Field, patch: &RationalPatch, tolerance: Option<f64>) -> Distances {
    distances_on(&Whole::of_field(field), patch, tolerance, None, None).0
}

/// The same from a whole surface; at edges a bound that is proved already is made no better than
/// 2.7 times what is sampled. After the deadline nothing more is proved. Also where a bound that is
/// larger than that comes from.
pub(crate) fn distances_on(
    whole: &Whole<'_>,
    patch: &RationalPatch,
    tolerance: Option<f64>,
    proved: Option<f64>,
    deadline: Option<Instant>,
) -> (Distances, Option<(f64, f64)>) {
    let prove = |target, cells| prove_on(whole, patch, target, Effort { cells, deadline });
    let (sampled, rms) = sampled_on(whole, patch, SAMPLES);
    let size = largest_coordinate(patch);
    if whole.is_single() && sampled <= EXACT * size {
        let proved =
            |(target, cells): &(f64, usize)| prove((target * size).max(2.0 * sampled), *cells);
        return (
            Distances {
                bound: EXACT_TARGETS
                    .iter()
                    .find_map(proved)
                    .map(|b| b.max(sampled)),
                sampled,
                rms,
            },
            None,
        );
    }
    let proved = proved.map(|b| b.max(sampled));
    let goal = |slack: f64| (slack * sampled).max(ROUNDING * size);
    // What would be aimed at is proved already.
    let enough = |b: &f64| match whole.is_single() {
        true => *b <= goal(SLACK[0]),
        false => *b <= (SLACK[1] * sampled).max(LEAST_REFINED * size),
    };
    if let Some(bound) = proved.filter(enough) {
        return (
            Distances {
                bound: Some(bound),
                sampled,
                rms,
            },
            None,
        );
    }
    let at_once = |slack: &f64| {
        let target = tolerance
            .filter(|t| *t >= sampled)
            .map_or(goal(*slack), |t| goal(*slack).min(t));
        prove(target, MOST_CELLS)
    };
    // At edges few cells take most of the work: from what is proved already, the worst are divided.
    let bound = if whole.is_single() {
        SLACK.iter().find_map(at_once)
    } else {
        None
    };
    let refine = || {
        let start = proved.or(tolerance
            .filter(|t| *t >= sampled)
            .and_then(|t| prove(t, MOST_CELLS_AT_EDGES)))?;
        Some(refined(
            whole,
            patch,
            start,
            (ENOUGH * sampled).max(LEAST_REFINED * size),
            Effort {
                cells: MOST_REFINED,
                deadline,
            },
        ))
    };
    let (bound, place) = bound.map(|b| (b, None)).or_else(refine).unzip();
    (
        Distances {
            bound: bound.map(|b| b.max(sampled)),
            sampled,
            rms,
        },
        place.flatten(),
    )
}

/// The largest coordinate of a patch, by samples: control points may be far away.
fn largest_coordinate(patch: &RationalPatch) -> f64 {
    const N: usize = 9;
    let at = |i: usize| i as f64 / (N - 1) as f64;
    let all = (0..N * N).flat_map(|k| patch.point(at(k / N), at(k % N)));
    all.fold(0.0, |m, v| m.max(v.abs()))
}

/// The largest of |X|, |Y| and |Z| of the control points (x, y and z multiplied by the weight), and
/// of their weights.
fn largest_homogeneous(patch: &RationalPatch) -> (f64, f64) {
    patch.control().iter().fold((0.0, 0.0), |(x, w), c| {
        (
            x.max(c[0].abs()).max(c[1].abs()).max(c[2].abs()),
            w.max(c[3].abs()),
        )
    })
}

/// A bound on the distance of all points of a patch from the surface that is at most `target`, if
/// such a one can be proved with so many cells.
pub fn prove(field: &dyn Field, patch: &RationalPatch, target: f64, cells: usize) -> Option<f64> {
    prove_on(
        &Whole::of_field(field),
        patch,
        target,
        Effort {
            cells,
            deadline: None,
        },
    )
}

/// What a proof may cost.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Effort {
    /// Cells that may be looked at.
    pub(crate) cells: usize,
    /// When it is given up.
    pub(crate) deadline: Option<Instant>,
}

/// The same from a whole surface.
pub(crate) fn prove_on(
    whole: &Whole<'_>,
    patch: &RationalPatch,
    target: f64,
    effort: Effort,
) -> Option<f64> {
    proof(whole, patch, target, effort).ok()
}

/// The same; where it fails, the parameters of a place that took too much.
pub(crate) fn proof(
    whole: &Whole<'_>,
    patch: &RationalPatch,
    target: f64,
    effort: Effort,
) -> Result<f64, (f64, f64)> {
    let products = Products::new(patch.degree());
    let size = largest_coordinate(patch);
    let terms = if whole.is_single() && target < COMPOSED * size {
        whole.field(0).terms()
    } else {
        None
    };
    let known = terms
        .and_then(|t| largest(&t, patch))
        .unwrap_or(f64::INFINITY);
    let mut pending = vec![(patch.clone(), [(0.0, 1.0); 2], 0u32)];
    let (mut worst, mut looked_at) = (0.0f64, 0);
    while let Some((cell, place, depth)) = pending.pop() {
        looked_at += 1;
        if looked_at > effort.cells || effort.deadline.is_some_and(|d| Instant::now() >= d) {
            return Err(middle_of(place));
        }
        match bound_of_cell(
            whole,
            &cell,
            (levels(patch, place), largest_homogeneous(patch)),
            target,
            known,
            &products,
        ) {
            Some(b) => worst = worst.max(b),
            None if depth == MOST_DEPTH => return Err(middle_of(place)),
            None => pending.extend(
                divided(&cell, place)
                    .into_iter()
                    .map(|(c, place)| (c, place, depth + 1)),
            ),
        }
    }
    Ok(worst)
}

/// A cell with what is proved of it; the greatest has the largest bound, and came first among
/// equals.
struct Bounded {
    bound: f64,
    number: usize,
    cell: RationalPatch,
    place: Place,
    depth: u32,
}

impl Ord for Bounded {
    fn cmp(&self, other: &Self) -> Ordering {
        self.bound
            .total_cmp(&other.bound)
            .then(other.number.cmp(&self.number))
    }
}
impl PartialOrd for Bounded {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Bounded {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}
impl Eq for Bounded {}

/// Makes a proved bound better: the cells with the largest bounds are divided until all are at most
/// `goal`, or the effort is spent. Then also the middle of the one with the largest.
fn refined(
    whole: &Whole<'_>,
    patch: &RationalPatch,
    proved: f64,
    goal: f64,
    effort: Effort,
) -> (f64, Option<(f64, f64)>) {
    let (products, size) = (Products::new(patch.degree()), largest_homogeneous(patch));
    let root = Bounded {
        bound: proved,
        number: 0,
        cell: patch.clone(),
        place: [(0.0, 1.0); 2],
        depth: 0,
    };
    let bound_of = |cell: &RationalPatch, place: Place, known: f64| {
        let of = |target: f64| {
            bound_of_cell(
                whole,
                cell,
                (levels(cell, place), size),
                target,
                f64::INFINITY,
                &products,
            )
        };
        of(goal)
            .or_else(|| of(known))
            .map_or(known, |b| b.min(known))
    };
    let mut all = BinaryHeap::from([Bounded {
        bound: bound_of(patch, root.place, proved),
        ..root
    }]);
    let mut looked_at = 1;
    while let Some(worst) = all.pop() {
        let is_over =
            looked_at >= effort.cells || effort.deadline.is_some_and(|d| Instant::now() >= d);
        if worst.bound <= goal || worst.depth == MOST_HALVINGS || is_over {
            let at = middle_of(worst.place);
            return (worst.bound, (worst.bound > goal).then_some(at));
        }
        // In the direction in which more is gained: along an edge cells may stay long.
        let depth = worst.depth + 1;
        let mut halved = |in_u: bool| {
            let halves = parts(&worst.cell, worst.place, in_u, !in_u)
                .into_iter()
                .map(|(cell, place)| {
                    looked_at += 1;
                    Bounded {
                        bound: bound_of(&cell, place, worst.bound),
                        number: looked_at,
                        cell,
                        place,
                        depth,
                    }
                });
            let halves: Vec<Bounded> = halves.collect();
            (
                halves.iter().fold(0.0, |sum, h| sum + h.bound.max(goal)),
                halves,
            )
        };
        let (in_u, in_v) = (halved(true), halved(false));
        let (along_u, along_v) = lengths(&worst.cell);
        // Edges that run askew gain a little from ever narrower cells, and much from shorter ones
        // later.
        let alike = in_u.0.max(in_v.0) <= ALIKE * in_u.0.min(in_v.0)
            || along_u.max(along_v) > NARROW * along_u.min(along_v);
        let is_in_u = if alike {
            along_u >= along_v
        } else {
            in_u.0 < in_v.0
        };
        all.extend(if is_in_u { in_u.1 } else { in_v.1 });
    }
    (proved, None)
}

/// Levels of de Casteljau's algorithm that lead to a part of a patch.
fn levels(patch: &RationalPatch, place: Place) -> f64 {
    let (m, n) = patch.degree();
    let halvings = |(a, b): (f64, f64)| -(b - a).log2();
    OTHER_LEVELS + m as f64 * halvings(place[0]) + n as f64 * halvings(place[1])
}

fn middle(i: &Interval) -> f64 {
    0.5 * i.lo() + 0.5 * i.hi()
}
/// The largest |x − middle|, rounded up.
fn radius(i: &Interval) -> f64 {
    let m = middle(i);
    (i.hi() - m).max(m - i.lo()).next_up()
}
fn magnitude(i: &Interval) -> f64 {
    i.lo().abs().max(i.hi().abs())
}

/// A bound on the distance of a cell from the surface, if one of at most `target` is found; of a
/// single function F, |F| is known to be at most
/// `known` on it.
fn bound_of_cell(
    whole: &Whole<'_>,
    cell: &RationalPatch,
    (levels, whole_size): (f64, (f64, f64)),
    target: f64,
    known: f64,
    products: &Products,
) -> Option<f64> {
    let (least, _) = cell.control_weights();
    if least <= 0.0 {
        return None;
    }
    let c = cell.point(0.5, 0.5);
    // δ over the cell lies within these; c need not be exact.
    let d: Vec<[f64; 4]> = cell
        .control()
        .iter()
        .map(|p| {
            [
                p[0] - c[0] * p[3],
                p[1] - c[1] * p[3],
                p[2] - c[2] * p[3],
                p[3],
            ]
        })
        .collect();
    let mut r = [0.0f64; 3];
    let mut largest = 0.0f64;
    for p in &d {
        for k in 0..3 {
            r[k] = r[k].max((p[k] / p[3]).abs() * (1.0 + 1e-12));
            largest = largest.max(c[k].abs() + r[k]);
        }
    }
    // x = X/w is off by (ΔX + |x| Δw)/w.
    let rounding =
        SUBDIVISION * levels * (whole_size.0 + largest * whole_size.1) / least * (1.0 + 1e-9);
    let reach = norm(r);
    // How far beyond the cell the surface is sought: as far as it seems to be, not as far as it may
    // be.
    let beyond = (2.0 * whole.first_order(c).0.abs() + 0.125 * reach).min(target);
    let beyond = if beyond.is_nan() { target } else { beyond };
    if let Some(b) = smooth_bound(
        whole,
        &CellOf {
            c,
            d: &d,
            r,
            rounding,
        },
        beyond,
        known,
        products,
    )
    .filter(|b| b + rounding <= target)
    {
        return Some(b + rounding);
    }
    if known.is_finite() || (whole.is_single() && reach <= CROSSING * target) {
        let e = whole.field(0).expansion(c, about(c, r, target))?;
        let (lo, hi) = range(&Taylor::new(&e, r), &d, r, products);
        let most = if lo <= hi {
            known.min(hi.max(-lo))
        } else {
            known
        };
        if let Some(b) =
            crossing_bound(&e, r.map(|v| v + target), most).filter(|b| b + rounding <= target)
        {
            return Some(b + rounding);
        }
    }
    // Small against the bound: any sign change nearby will do, if the functions are such of which
    // something can be proved.
    if reach > 0.85 * target {
        return None;
    }
    let near = about(c, r, target);
    if whole
        .within(near)?
        .parts
        .iter()
        .any(|&k| whole.field(k).expansion(c, near).is_none())
    {
        return None;
    }
    changes_sign(whole, c, (target - reach - rounding) * (1.0 - 1e-9)).then_some(target)
}

/// The box that reaches `by` beyond c ± r.
fn about(c: Point3, r: Point3, by: f64) -> Aabb {
    Aabb {
        lo: std::array::from_fn(|k| c[k] - r[k] - by),
        hi: std::array::from_fn(|k| c[k] + r[k] + by),
    }
}

/// √(2M/λ), where second derivatives have both signs by λ or more within `wide` of the point of
/// expansion.
fn crossing_bound(e: &Expansion, wide: Point3, most: f64) -> Option<f64> {
    let h: [f64; 6] = std::array::from_fn(|k| middle(&e.hessian[k]));
    let t: [f64; 10] = std::array::from_fn(|k| magnitude(&e.third[k]));
    let (values, vectors) =
        symmetric_eigen(&[h[0], h[1], h[2], h[1], h[3], h[4], h[2], h[4], h[5]], 3);
    // A lower bound of |eᵀHe| for an eigenvector e: from the value, what third derivatives, radii
    // and rounding may take away.
    let least = |k: usize| {
        let n: Point3 = std::array::from_fn(|i| vectors[3 * k + i].abs());
        let mut lost = 1e-14 * h.iter().map(|v| v.abs()).sum::<f64>();
        for i in 0..3 {
            for j in 0..3 {
                let along = |l: usize| t[Expansion::THIRD[i][j][l]] * wide[l];
                lost += n[i]
                    * n[j]
                    * (radius(&e.hessian[Expansion::SECOND[i][j]])
                        + (0..3).map(along).sum::<f64>());
            }
        }
        values[k].abs() * (1.0 - 1e-12) - lost
    };
    let lambda = least(0).min(least(2));
    if values[0] >= 0.0 || values[2] <= 0.0 || lambda.is_nan() || lambda <= 0.0 {
        return None;
    }
    Some((2.0 * most / lambda).sqrt() * (1.0 + 1e-12))
}

/// A cell of a patch.
struct CellOf<'d> {
    /// About its middle.
    c: Point3,
    /// Its control points less c times their weights.
    d: &'d [[f64; 4]],
    /// No coordinate differs from that of c by more.
    r: Point3,
    /// So far its points may be off.
    rounding: f64,
}

/// M/G, if that is no more than `beyond`; of a single function, M is no more than `known`.
fn smooth_bound(
    whole: &Whole<'_>,
    cell: &CellOf<'_>,
    beyond: f64,
    known: f64,
    products: &Products,
) -> Option<f64> {
    let CellOf { c, d, r, .. } = *cell;
    let region = about(c, r, beyond);
    let Within { tree, parts, alone } = whole.within(region)?;
    let expansions: Vec<Expansion> = parts
        .iter()
        .map(|&k| whole.field(k).expansion(c, region))
        .collect::<Option<_>>()?;
    let mut normals = Vec::with_capacity(parts.len());
    let mut lengths = Vec::with_capacity(parts.len());
    for e in &expansions {
        let g = slopes(e);
        let length = norm(g);
        if length == 0.0 || !length.is_finite() {
            return None;
        }
        lengths.push(length);
        normals.push(g.map(|v| v / length));
    }
    // The parts of a piece have one unit of length.
    let unit = |k: usize| {
        let same = parts
            .iter()
            .zip(&lengths)
            .filter(|(other, _)| whole.piece(**other) == whole.piece(parts[k]));
        same.fold(0.0f64, |m, (_, l)| m.max(*l))
    };
    let wide: Point3 = r.map(|v| v + beyond);
    // The least slope of the parts that are meant along the sum of their normals.
    let slope_of = |meant: &dyn Fn(usize) -> bool| {
        let list: Vec<usize> = (0..parts.len()).filter(|&k| meant(k)).collect();
        let n: Point3 = std::array::from_fn(|i| list.iter().map(|&k| normals[k][i]).sum());
        let length = norm(n);
        let along = Along {
            n: n.map(|v| v / length),
            beyond,
            wide,
            c,
            d,
        };
        let each = list.iter().map(|&k| along.slope(&expansions[k]) / unit(k));
        // A minimum would ignore NaN.
        each.fold(f64::INFINITY, |m, s| if s > 0.0 { m.min(s) } else { 0.0 }) * (1.0 - 1e-12)
    };
    let slope = slope_of(&|_| true);
    // Where a minimum is positive it comes to 0 as soon as one of its pieces does, which may be the
    // one that it is; so with a negative maximum.
    let own = || {
        tree.pieces()
            .iter()
            .map(|piece| slope_of(&|k| whole.piece(parts[k]) == *piece))
            .fold(f64::INFINITY, f64::min)
    };
    let is_flat = |children: &[Csg]| children.iter().all(|child| matches!(child, Csg::Piece(_)));
    let (up, down) = match &tree {
        Csg::Min(children) if is_flat(children) => (own(), slope),
        Csg::Max(children) if is_flat(children) => (slope, own()),
        _ => (slope, slope),
    };
    let boxed = (parts.len() > 1).then(|| about(c, r, 0.0));
    let range_of = |k: usize| {
        let (e, unit) = (&expansions[k], unit(k));
        let taylor = Taylor::new(e, r);
        let (mut lo, mut hi) = range(&taylor, d, r, products);
        if alone[k] && lo <= hi && boxed.is_some() {
            let others: Vec<&Expansion> = (0..parts.len())
                .filter(|&o| o != k && whole.piece(parts[o]) == whole.piece(parts[k]))
                .map(|o| &expansions[o])
                .collect();
            for limit in whole
                .limits(parts[k])
                .iter()
                .filter(|l| !others.is_empty() && l.bounds(region).lo() < 0.0)
            {
                let Some(l) = limit
                    .expansion(c, region)
                    .and_then(|l| Limit::new(&l, cell))
                else {
                    continue;
                };
                if l.most < 0.0 {
                    return None;
                }
                for other in &others {
                    let bend = l.bend(e, other);
                    let cut = range(&taylor.bent(&l, bend, r), d, r, products);
                    if bend > 0.0 {
                        hi = hi.min(cut.1)
                    } else {
                        lo = lo.max(cut.0)
                    }
                }
            }
        }
        // On flat faces along the axes intervals know more: that a square is nowhere negative, as
        // where a blend begins.
        let known = boxed.map_or(Interval::ALL, |b| whole.field(parts[k]).bounds(b));
        Some(if lo <= hi && known.lo() <= known.hi() {
            // Rounding of the cell's points may set the two apart, by less than is added for it:
            // then what lies between.
            let (lo, hi) = (lo.max(known.lo()), hi.min(known.hi()));
            Interval::new(lo.min(hi) / unit, lo.max(hi) / unit)
        } else {
            Interval::ALL
        })
    };
    let ranges: Vec<Option<Interval>> = (0..parts.len()).map(range_of).collect();
    let of_piece = |piece: u32| {
        let of = parts
            .iter()
            .zip(&ranges)
            .filter(|(k, _)| whole.piece(**k) == piece)
            .filter_map(|(_, r)| *r);
        of.reduce(|a, b| a.hull(&b)).unwrap_or(Interval::ALL)
    };
    let most = if whole.is_single() {
        known / unit(0)
    } else {
        f64::INFINITY
    };
    let range = tree.range(&of_piece);
    let above = if range.hi() > 0.0 {
        range.hi().min(most) / up
    } else {
        0.0
    };
    let below = if range.lo() < 0.0 {
        (-range.lo()).min(most) / down
    } else {
        0.0
    };
    let bound = above.max(below) * (1.0 + 1e-12);
    (bound.is_finite() && bound <= beyond).then_some(bound)
}

/// ∇F at the point.
fn slopes(e: &Expansion) -> Point3 {
    std::array::from_fn(|k| middle(&e.gradient[k]))
}

/// Where the surface is sought: from the points of a cell along ±n.
struct Along<'d> {
    n: Point3,
    /// So far.
    beyond: f64,
    /// No coordinate differs from those of c by more.
    wide: Point3,
    c: Point3,
    /// The cell's control points less c.
    d: &'d [[f64; 4]],
}

impl Along<'_> {
    /// A lower bound of n·∇F there.
    fn slope(&self, e: &Expansion) -> f64 {
        let (n, wide) = (self.n, self.wide);
        let g = slopes(e);
        let h: [f64; 6] = std::array::from_fn(|k| middle(&e.hessian[k]));
        let t: [f64; 10] = std::array::from_fn(|k| magnitude(&e.third[k]));
        let at = |i: usize, j: usize| Expansion::SECOND[i][j];
        let mut lost = 0.0;
        for i in 0..3 {
            lost += n[i].abs() * radius(&e.gradient[i]);
            for j in 0..3 {
                lost += n[i].abs() * radius(&e.hessian[at(i, j)]) * wide[j];
            }
        }
        // nᵀHδ is least at a control point.
        let nh: Point3 = std::array::from_fn(|j| (0..3).map(|i| n[i] * h[at(i, j)]).sum());
        let least = self
            .d
            .iter()
            .map(|p| (nh[0] * p[0] + nh[1] * p[1] + nh[2] * p[2]) / p[3])
            .fold(f64::INFINITY, f64::min);
        lost += self.beyond * (nh[0] * n[0] + nh[1] * n[1] + nh[2] * n[2]).abs();
        lost += 16.0
            * f64::EPSILON
            * (0..3)
                .map(|j| nh[j].abs() * (self.c[j].abs() + wide[j]))
                .sum::<f64>();
        lost += 0.5 * cubic(&t, wide, Some(n.map(f64::abs)));
        (0..3).map(|k| n[k] * g[k]).sum::<f64>() + least - lost
    }
}

/// F about c: its Taylor polynomial of order 2 or 3, and how far F may be off it on a cell.
#[derive(Clone, Copy)]
struct Taylor {
    value: f64,
    g: Point3,
    h: [f64; 6],
    /// 0 for order 2.
    third: [f64; 10],
    off: f64,
}

impl Taylor {
    /// With what third derivatives are in the middle of the cell: what they differ by from that
    /// falls with the fourth power of its size.
    fn new(e: &Expansion, r: Point3) -> Self {
        let third: [f64; 10] = std::array::from_fn(|k| middle(&e.third[k]));
        if third.iter().all(|t| t.is_finite()) {
            let differ = std::array::from_fn(|k| radius(&e.third[k]));
            Self::up_to(e, r, third, &differ)
        } else {
            Self::square(e, r)
        }
    }

    /// Of order 2.
    fn square(e: &Expansion, r: Point3) -> Self {
        let t = std::array::from_fn(|k| magnitude(&e.third[k]));
        Self::up_to(e, r, [0.0; 10], &t)
    }

    /// With `third`, from which third derivatives differ by no more than t.
    fn up_to(e: &Expansion, r: Point3, third: [f64; 10], t: &[f64; 10]) -> Self {
        let mut off = radius(&e.value) + cubic(t, r, None) / 6.0;
        for i in 0..3 {
            off += radius(&e.gradient[i]) * r[i];
            for j in 0..3 {
                off += 0.5 * radius(&e.hessian[Expansion::SECOND[i][j]]) * r[i] * r[j];
            }
        }
        Self {
            value: middle(&e.value),
            g: slopes(e),
            h: std::array::from_fn(|k| middle(&e.hessian[k])),
            third,
            off,
        }
    }

    /// Plus b (m − λ)(λ + ρ), which is nowhere negative where the limit is not, for b ≥ 0, and
    /// nowhere positive for b ≤ 0.
    fn bent(&self, l: &Limit, b: f64, r: Point3) -> Self {
        let (above, below) = (l.most - l.value, l.value + l.off);
        let slope = b * (above - below);
        let size = (0..3).map(|k| l.g[k].abs() * r[k]).sum::<f64>();
        let mut h = self.h;
        for i in 0..3 {
            for j in i..3 {
                h[Expansion::SECOND[i][j]] -= 2.0 * b * l.g[i] * l.g[j];
            }
        }
        let rounding = 16.0
            * f64::EPSILON
            * b.abs()
            * (l.most.abs() + l.value.abs() + size)
            * (l.value.abs() + l.off + size);
        Self {
            value: self.value + b * above * below,
            g: std::array::from_fn(|k| self.g[k] + slope * l.g[k]),
            h,
            third: self.third,
            off: self.off + rounding,
        }
    }
}

/// A limit of a part on a cell: where the part counts, the linear function λ = value + g·δ is at
/// least −off.
struct Limit {
    value: f64,
    g: Point3,
    off: f64,
    /// λ on the cell is at most so much; negative if the part does not count there.
    most: f64,
}

impl Limit {
    fn new(e: &Expansion, cell: &CellOf<'_>) -> Option<Self> {
        let taylor = Taylor::square(e, cell.r);
        let (g, r) = (taylor.g, cell.r);
        let mut off = taylor.off;
        for i in 0..3 {
            off += g[i].abs() * (cell.rounding + 4.0 * f64::EPSILON * r[i]);
            for j in 0..3 {
                off += 0.5 * taylor.h[Expansion::SECOND[i][j]].abs() * r[i] * r[j];
            }
        }
        let off = (off + 4.0 * f64::EPSILON * taylor.value.abs()) * (1.0 + 1e-12);
        // A linear function is largest at a control point.
        let along = cell
            .d
            .iter()
            .map(|p| (g[0] * p[0] + g[1] * p[1] + g[2] * p[2]) / p[3])
            .fold(f64::NEG_INFINITY, f64::max);
        let most = taylor.value + along + off;
        (off.is_finite() && most.is_finite()).then_some(Self {
            value: taylor.value,
            g,
            off,
            most,
        })
    }

    /// What part and neighbour differ by across the limit, as a multiple of the limit's square:
    /// with that bent, what the part's function is where it does not count is not seen.
    fn bend(&self, own: &Expansion, other: &Expansion) -> f64 {
        let n = slopes(own);
        let nn = n.iter().map(|v| v * v).sum::<f64>();
        let across = (0..3).map(|k| n[k] * self.g[k]).sum::<f64>() / nn;
        let t: Point3 = std::array::from_fn(|k| self.g[k] - across * n[k]);
        let slope = (0..3).map(|k| t[k] * self.g[k]).sum::<f64>();
        let mut difference = 0.0;
        for i in 0..3 {
            for j in 0..3 {
                difference += t[i]
                    * (middle(&own.hessian[Expansion::SECOND[i][j]])
                        - middle(&other.hessian[Expansion::SECOND[i][j]]))
                    * t[j];
            }
        }
        let bend = 0.5 * difference / (slope * slope);
        if bend.is_finite() { bend } else { 0.0 }
    }
}

/// Bounds of F on a cell.
fn range(taylor: &Taylor, d: &[[f64; 4]], r: Point3, products: &Products) -> (f64, f64) {
    let Taylor {
        value,
        g,
        h,
        third,
        off,
    } = *taylor;
    let at = |i: usize, j: usize| h[Expansion::SECOND[i][j]];
    let t = |i: usize, j: usize, k: usize| third[Expansion::THIRD[i][j][k]];
    // w² (F(c) + ∇F·δ + δᵀHδ/2) as a scalar product of (w δ, w) with (H w δ/2, F(c) w + ∇F·w δ);
    // and before it the coordinates of w² Tδδ/6, of wδ with T wδ/6.
    let right = |p: &[f64; 4]| {
        let h = |k: usize| 0.5 * (at(k, 0) * p[0] + at(k, 1) * p[1] + at(k, 2) * p[2]);
        let t =
            |i: usize, k: usize| (t(i, k, 0) * p[0] + t(i, k, 1) * p[1] + t(i, k, 2) * p[2]) / 6.0;
        [
            [t(0, 0), t(0, 1), t(0, 2), 0.0],
            [t(1, 0), t(1, 1), t(1, 2), 0.0],
            [t(2, 0), t(2, 1), t(2, 2), 0.0],
            [
                h(0),
                h(1),
                h(2),
                value * p[3] + g[0] * p[0] + g[1] * p[1] + g[2] * p[2],
            ],
        ]
    };
    let rights: Vec<[[f64; 4]; 4]> = d.iter().map(right).collect();
    let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
    for [q, w3] in products.of(d, &rights) {
        (lo, hi) = (lo.min(q / w3), hi.max(q / w3));
    }
    // What the coefficients leave out: rounding of the sums, radii of the derivatives, the
    // remainder.
    let size = value.abs()
        + (0..3)
            .map(|k| {
                g[k].abs() * r[k] + 0.5 * (0..3).map(|j| at(k, j).abs() * r[k] * r[j]).sum::<f64>()
            })
            .sum::<f64>()
        + cubic(&third.map(f64::abs), r, None) / 6.0;
    // Half a unit for each operation of the terms of a coefficient and of their sum, in both
    // products, the same for those of w³.
    let (m, n) = products.degree;
    let most = (48 + 2 * (m + 1) * (n + 1)) as f64 * f64::EPSILON * size + off;
    (lo - most, hi + most)
}

/// Σ t_ijk r_i r_j r_k over all i, j, k; with `n`, Σ t_ijk n_i r_j r_k.
fn cubic(t: &[f64; 10], r: Point3, n: Option<Point3>) -> f64 {
    let first = n.unwrap_or(r);
    let mut sum = 0.0;
    for i in 0..3 {
        for j in 0..3 {
            for k in 0..3 {
                let f = first[i] * r[j] * r[k];
                // 0 · ∞ is nothing here.
                if f > 0.0 {
                    sum += t[Expansion::THIRD[i][j][k]] * f;
                }
            }
        }
    }
    sum
}

/// Directions in which a change of sign is sought.
const DIRECTIONS: [[f64; 3]; 13] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.7, 0.7],
    [0.0, 0.7, -0.7],
    [0.7, 0.0, 0.7],
    [0.7, 0.0, -0.7],
    [0.7, 0.7, 0.0],
    [0.7, -0.7, 0.0],
    [0.57, 0.57, 0.57],
    [0.57, 0.57, -0.57],
    [0.57, -0.57, 0.57],
    [-0.57, 0.57, 0.57],
];

/// Whether F certainly vanishes within t of c: it has both signs in that ball, which is connected.
/// Points are tried about c, and about where Newton's method leads to from there, as the sectors
/// between two sheets that cross may be narrow.
fn changes_sign(whole: &Whole<'_>, c: Point3, t: f64) -> bool {
    let sign = |i: &Interval| i32::from(i.lo() > 0.0) - i32::from(i.hi() < 0.0);
    let here = sign(&whole.range_at(c));
    let (mut positive, mut negative) = (here > 0, here < 0);
    let mut seen = |p: Point3| {
        let there = sign(&whole.range_at(p));
        positive |= there > 0;
        negative |= there < 0;
        positive && negative
    };
    let mut around = |q: Point3, t: f64| {
        DIRECTIONS.iter().any(|d| {
            [-t, t]
                .into_iter()
                .any(|s| seen(std::array::from_fn(|k| q[k] + s * d[k])))
        })
    };
    if t <= 0.0 {
        return false;
    }
    if around(c, t) {
        return true;
    }
    let mut q = c;
    for _ in 0..FOOT_STEPS {
        let j = whole.field(whole.first_order(q).1).jet(q);
        let step = j.v / j.g.iter().map(|g| g * g).sum::<f64>();
        if !step.is_finite() {
            break;
        }
        for k in 0..3 {
            q[k] -= step * j.g[k];
        }
    }
    let left = t - norm(sub(q, c));
    left > 0.1 * t && around(q, 0.99 * left)
}

/// Products of three polynomials of degree (m, n), by Bernstein coefficients.
struct Products {
    degree: (usize, usize),
    /// Of two of them, in u and in v.
    two: [Shares; 2],
    /// Of such a product with one more.
    three: [Shares; 2],
}

/// By (i, k): what bᵢ cₖ adds to coefficient i + k of a product.
type Shares = Vec<Vec<f64>>;

impl Products {
    fn new(degree: (usize, usize)) -> Self {
        let table = |l: usize, n: usize| -> Shares {
            let share =
                |i: usize, k: usize| binomial(l, i) * binomial(n, k) / binomial(l + n, i + k);
            (0..=l)
                .map(|i| (0..=n).map(|k| share(i, k)).collect())
                .collect()
        };
        let (m, n) = degree;
        Self {
            degree,
            two: [table(m, m), table(n, n)],
            three: [table(2 * m, m), table(2 * n, n)],
        }
    }

    /// The coefficients of Σₖ aₖ (a·bₖ) for the four polynomials aₖ and four times four bₖ, of
    /// degree (3m, 3n), each with that of the cube of the last of a.
    fn of(&self, a: &[[f64; 4]], b: &[[[f64; 4]; 4]]) -> Vec<[f64; 2]> {
        let (m, n) = self.degree;
        // a·bₖ and the square of the last of a.
        let mut two = vec![[0.0; 5]; (2 * m + 1) * (2 * n + 1)];
        for (p, i, j) in a
            .iter()
            .zip(0..)
            .map(|(p, at)| (p, at / (n + 1), at % (n + 1)))
        {
            for k in 0..=m {
                let (fu, fv) = (self.two[0][i][k], &self.two[1][j]);
                let row = &mut two[(i + k) * (2 * n + 1) + j..][..n + 1];
                let (a, b) = (&a[k * (n + 1)..][..n + 1], &b[k * (n + 1)..][..n + 1]);
                for l in 0..=n {
                    let (f, q) = (fu * fv[l], &b[l]);
                    for (out, q) in row[l].iter_mut().zip(q) {
                        *out += f * (p[0] * q[0] + p[1] * q[1] + (p[2] * q[2] + p[3] * q[3]));
                    }
                    row[l][4] += f * p[3] * a[l][3];
                }
            }
        }
        let mut three = vec![[0.0; 2]; (3 * m + 1) * (3 * n + 1)];
        for (p, i, j) in
            (two.iter().zip(0..)).map(|(p, at)| (p, at / (2 * n + 1), at % (2 * n + 1)))
        {
            for k in 0..=m {
                let (fu, fv) = (self.three[0][i][k], &self.three[1][j]);
                let row = &mut three[(i + k) * (3 * n + 1) + j..][..n + 1];
                for (l, q) in a[k * (n + 1)..][..n + 1].iter().enumerate() {
                    let f = fu * fv[l];
                    row[l][0] += f * (p[0] * q[0] + p[1] * q[1] + (p[2] * q[2] + p[3] * q[3]));
                    row[l][1] += f * p[4] * q[3];
                }
            }
        }
        three
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_products() {
        let products = Products::new((2, 1));
        let list = |seed: f64| -> Vec<[f64; 4]> {
            (0..6)
                .map(|i| std::array::from_fn(|k| (seed + f64::from(i) * 1.3 + k as f64).sin()))
                .collect()
        };
        let a = list(0.2);
        let value = |c: &dyn Fn(usize) -> f64, m: usize, n: usize| {
            let (bu, bv) = (
                isoform_geom::bernstein(m, 0.3).0,
                isoform_geom::bernstein(n, 0.8).0,
            );
            (0..=m)
                .map(|i| {
                    (0..=n)
                        .map(|j| bu[i] * bv[j] * c(i * (n + 1) + j))
                        .sum::<f64>()
                })
                .sum::<f64>()
        };
        // Four times the same list with other seeds.
        let all: Vec<[[f64; 4]; 4]> = (0..6)
            .map(|i| [0.9, 0.4, 2.1, 3.3].map(|seed| list(seed)[i]))
            .collect();
        let product = products.of(&a, &all);
        let of_a = |k: usize| value(&|i| a[i][k], 2, 1);
        let want: f64 = (0..4)
            .map(|k| {
                let scalar = |l: usize| of_a(l) * value(&|i| all[i][k][l], 2, 1);
                of_a(k) * (0..4).map(scalar).sum::<f64>()
            })
            .sum();
        assert!((value(&|i| product[i][0], 6, 3) - want).abs() < 1e-14);
        assert!((value(&|i| product[i][1], 6, 3) - of_a(3).powi(3)).abs() < 1e-14);
    }

    /// Along a double curve a proof to 10⁻⁷ takes millions of cells: a deadline ends it.
    #[test]
    fn a_deadline_ends_a_proof() {
        let planes = isoform_field::Polynomial::new([([1, 1, 0], 1.0)]);
        let patch = RationalPatch::planar(
            (2, 2),
            [1e-10, -0.3, -0.3],
            [0.0, 0.6, 0.0],
            [0.0, 0.0, 0.6],
        );
        let start = Instant::now();
        let deadline = Some(start + std::time::Duration::from_millis(50));
        let effort = Effort {
            cells: usize::MAX,
            deadline,
        };
        assert_eq!(
            prove_on(&Whole::of_field(&planes), &patch, 1e-7, effort),
            None
        );
        let taken = start.elapsed().as_secs_f64();
        assert!((0.05..5.0).contains(&taken), "{taken}");
    }
}
