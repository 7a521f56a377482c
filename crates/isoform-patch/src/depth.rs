//! Depth: how far inside of a patch a point of the surface lies, measured and proved.
//!
//! The depth of a point is its straight distance from the border of the patch on which it lies, the
//! four curves u = 0, u = 1, v = 0 and v = 1; along the surface the border is at least as far.
//! Solids need it: where patches are to be cut along common curves, these must not leave them.
//!
//! The proof goes cell by cell through the region. On a cell where n·∇F ≥ G > 0 for a unit vector
//! n, Krawczyk's operator (R. Krawczyk: Newton-Algorithmen zur Bestimmung von Nullstellen mit
//! Fehlerschranken, Computing 4 (1969)) for p(u, v) − q across n shows that the line along n
//! through every point q of the cell meets the patch at a place (u, v) near one that is known. If
//! F(q) = 0, the patch is there no farther from q than |F(p(u, v))|/G, which is at most the proved
//! distance of the patch from the surface times max |∇F|/G. And as the depth of two points differs
//! by no more than they are apart, that of the cell's middle less its radius is a bound. What fails
//! is divided.

use crate::cells::halve_net;
use crate::cover::side_by_side;
use crate::feet::step_to_foot;
use isoform_geom::{
    Aabb, Field, Point3, RationalPatch, cross, distance_to_segment, dot, norm, sub,
};
use isoform_num::{Interval, Real};

/// Pieces of a border are halved until they are this straight, in the depth asked for: less is
/// lost.
const STRAIGHT: f64 = 0.01;
/// Halvings of a border, at most.
const MOST_HALVINGS: usize = 8;
/// Cells smaller than this, in the depth asked for, are not divided.
const SMALLEST: f64 = 1.0 / 64.0;
/// Cells smaller than this no point of which lies deep in a patch are not divided; larger ones may
/// hold none of the surface.
const SMALL: f64 = 0.25;
/// The places of W may be so many times as far from the known one as a linear patch would need.
const WIDER: f64 = 1.5;
/// W must hold what Krawczyk's operator makes of it with this share to spare: ten thousand times
/// what is rounded on the way on the smallest cells of any use.
const TO_SPARE: f64 = 1e-6;
/// A patch may be so many times its proved distance away from a point along n; on cells where that
/// is more the normal turns too much.
const FARTHER: f64 = 1.5;
/// Places of a patch in each direction from which feet are sought.
const GRID: usize = 16;
/// Newton steps towards a foot.
const STEPS: usize = 8;
/// The region is divided into so many blocks in each direction, for threads.
const BLOCKS: usize = 4;
/// Places that are told where a proof fails, in each block.
const MOST_OPEN: usize = 2000;

/// A piece of a border: no point of it is farther than `off` from the line between two points.
#[derive(Clone, Copy, Debug)]
struct Piece {
    ends: [Point3; 2],
    off: f64,
}

impl Piece {
    /// A lower bound of its distance from a point.
    fn distance(&self, p: Point3) -> f64 {
        let [a, b] = self.ends;
        distance_to_segment(p, [a, b]) - self.off
    }
}

/// The four borders of a patch with positive control weights.
#[derive(Clone, Debug)]
pub(crate) struct Border(Vec<Piece>);

impl Border {
    /// As pieces that are straight to a share of the depth.
    pub(crate) fn new(patch: &RationalPatch, depth: f64) -> Self {
        let (m, n) = patch.degree();
        let control = patch.control();
        let along_v = |i: usize| control[i * (n + 1)..][..n + 1].to_vec();
        let along_u = |j: usize| (0..=m).map(|i| control[i * (n + 1) + j]).collect();
        let mut pieces = Vec::new();
        for curve in [along_v(0), along_v(m), along_u(0), along_u(n)] {
            divide(curve, STRAIGHT * depth, 0, &mut pieces);
        }
        Self(pieces)
    }

    /// A lower bound of the distance of a point from the border.
    pub(crate) fn distance(&self, p: Point3) -> f64 {
        (self.0.iter()).fold(f64::INFINITY, |least, piece| least.min(piece.distance(p)))
    }
}

/// Adds a curve as pieces; its points lie in the hull of its control points.
fn divide(curve: Vec<[f64; 4]>, straight: f64, halvings: usize, pieces: &mut Vec<Piece>) {
    let points: Vec<Point3> = (curve.iter())
        .map(|c| [c[0] / c[3], c[1] / c[3], c[2] / c[3]])
        .collect();
    let ends = [points[0], points[points.len() - 1]];
    let off = (points.iter())
        .map(|p| distance_to_segment(*p, ends))
        .fold(0.0, f64::max);
    if off <= straight || halvings == MOST_HALVINGS {
        // Coordinates are rounded in each halving, and distances.
        let size = points
            .as_flattened()
            .iter()
            .fold(0.0f64, |m, v| m.max(v.abs()));
        let off = off * (1.0 + 1e-9) + 1e-13 * size;
        pieces.push(Piece { ends, off });
        return;
    }
    let mean = |a: [f64; 4], b: [f64; 4]| std::array::from_fn(|k| 0.5 * (a[k] + b[k]));
    for upper in [false, true] {
        let mut half = curve.clone();
        halve_net(&mut half, (0, curve.len() - 1), false, upper, mean);
        divide(half, straight, halvings + 1, pieces);
    }
}

/// A patch that points may lie in.
pub(crate) struct Sheet<'p> {
    patch: &'p RationalPatch,
    /// Its proved distance from the surface.
    bound: f64,
    border: Border,
    /// It lies in this box.
    region: Aabb,
    /// Places from which feet are sought, with how far apart they are.
    starts: Vec<((f64, f64), Point3)>,
    apart: f64,
}

impl<'p> Sheet<'p> {
    /// None where control weights are not positive.
    pub(crate) fn new(patch: &'p RationalPatch, bound: f64, depth: f64) -> Option<Self> {
        let region = patch.control_box()?;
        let at = |i: usize| (i as f64 + 0.5) / GRID as f64;
        let starts: Vec<((f64, f64), Point3)> = (0..GRID * GRID)
            .map(|k| (at(k / GRID), at(k % GRID)))
            .map(|(u, v)| ((u, v), patch.point(u, v)))
            .collect();
        let apart = |k: usize| norm(sub(starts[k].1, starts[k + 1].1));
        let apart = (0..GRID * GRID - 1).map(apart).fold(0.0, f64::max);
        Some(Self {
            patch,
            bound,
            border: Border::new(patch, depth),
            region,
            starts,
            apart,
        })
    }

    /// The parameters of a place of the patch near a point; none where that is not within `reach`.
    fn foot(&self, p: Point3, reach: f64) -> Option<(f64, f64)> {
        let far = reach + self.bound;
        let is_near = |k: usize| self.region.lo[k] - far <= p[k] && p[k] <= self.region.hi[k] + far;
        if !(0..3).all(is_near) {
            return None;
        }
        let distance = |q: &Point3| isoform_geom::distance_squared(*q, p);
        let nearest =
            (self.starts.iter()).min_by(|a, b| distance(&a.1).total_cmp(&distance(&b.1)))?;
        if distance(&nearest.1).sqrt() > far + 4.0 * self.apart {
            return None;
        }
        let (mut u, mut v) = nearest.0;
        for _ in 0..STEPS {
            let t = self.patch.tangents(u, v);
            let (du, dv) = step_to_foot(&t, sub(p, t.point));
            (u, v) = ((u + du).clamp(0.0, 1.0), (v + dv).clamp(0.0, 1.0));
            if du * du * dot(t.u, t.u) + dv * dv * dot(t.v, t.v) <= 1e-6 * reach * reach {
                break;
            }
        }
        (norm(sub(self.patch.point(u, v), p)) <= far).then_some((u, v))
    }
}

/// What has been proved of the depth of a surface in patches.
#[derive(Clone, Debug, Default)]
pub(crate) struct Proof {
    /// No point of the surface is farther from the place of a patch as deep as asked for.
    pub(crate) distance: f64,
    /// Boxes of which nothing could be proved.
    pub(crate) open: Vec<Aabb>,
}

/// What is asked of the surface in a region.
pub(crate) struct Question<'a> {
    pub(crate) field: &'a dyn Field,
    pub(crate) region: Aabb,
    pub(crate) depth: f64,
    /// What lies wholly within `apart` of one of these points is not asked for.
    pub(crate) singular: &'a [Point3],
    pub(crate) apart: f64,
}

/// What comes of a cell.
enum Outcome {
    /// It holds none of the surface, or none that is asked for.
    Empty,
    /// All of the surface in it is as deep in a patch, which is no farther from it.
    Deep(f64),
    /// Parts of it may be told.
    Unknown,
    /// It lies in no patch deep enough.
    Open,
}

/// Tries to prove that every point of the surface in a region is so deep inside of some patch.
/// `stop` is asked in between; where it ends the proof, what is left counts as open.
pub(crate) fn prove(
    question: &Question<'_>,
    sheets: &[Sheet<'_>],
    threads: usize,
    stop: &(dyn Fn() -> bool + Sync),
) -> Proof {
    let Aabb { lo, hi } = question.region;
    let blocks = side_by_side(BLOCKS.pow(3), threads, &|block| {
        let part = [
            block % BLOCKS,
            block / BLOCKS % BLOCKS,
            block / BLOCKS / BLOCKS,
        ];
        let at = |k: usize, i: usize| match i {
            BLOCKS => hi[k],
            i => lo[k] + (hi[k] - lo[k]) * i as f64 / BLOCKS as f64,
        };
        let block = Aabb {
            lo: std::array::from_fn(|k| at(k, part[k])),
            hi: std::array::from_fn(|k| at(k, part[k] + 1)),
        };
        prove_block(question, sheets, block, stop)
    });
    let mut all = Proof::default();
    for block in blocks {
        all.distance = all.distance.max(block.distance);
        all.open.extend(block.open);
    }
    all
}

fn prove_block(
    question: &Question<'_>,
    sheets: &[Sheet<'_>],
    block: Aabb,
    stop: &(dyn Fn() -> bool + Sync),
) -> Proof {
    let mut proof = Proof::default();
    let mut pending = vec![block];
    while let Some(cell) = pending.pop() {
        let radius = 0.5 * cell.diagonal();
        match question.look(sheets, &cell) {
            Outcome::Empty => {}
            Outcome::Deep(distance) => proof.distance = proof.distance.max(distance),
            Outcome::Unknown if radius > SMALLEST * question.depth && !stop() => {
                pending.extend(halves(&cell));
            }
            Outcome::Unknown | Outcome::Open => {
                proof.open.push(cell);
                if proof.open.len() == MOST_OPEN {
                    proof.open.append(&mut pending);
                }
            }
        }
    }
    proof
}

/// The halves of a box across its longest edge.
fn halves(cell: &Aabb) -> [Aabb; 2] {
    let size = cell.size();
    let along = (0..3)
        .max_by(|&a, &b| size[a].total_cmp(&size[b]))
        .unwrap_or(0);
    let middle = 0.5 * (cell.lo[along] + cell.hi[along]);
    let (mut lower, mut upper) = (*cell, *cell);
    (lower.hi[along], upper.lo[along]) = (middle, middle);
    [lower, upper]
}

/// Intervals that hold the places of a box less a point.
fn offsets(region: &Aabb, c: Point3) -> [Interval; 3] {
    std::array::from_fn(|k| Interval::new(region.lo[k], region.hi[k]) - Interval::constant(c[k]))
}

impl Question<'_> {
    fn look(&self, sheets: &[Sheet<'_>], cell: &Aabb) -> Outcome {
        let c = cell.center();
        let radius = 0.5 * cell.diagonal() * (1.0 + 1e-12);
        let is_within = |s: &Point3| norm(sub(*s, c)) + radius <= self.apart;
        if !self.field.bounds(*cell).contains(0.0) || self.singular.iter().any(is_within) {
            return Outcome::Empty;
        }
        let Some(e) = self.field.expansion(c, *cell) else {
            return Outcome::Unknown;
        };
        let by = offsets(cell, c);
        let gradient = e.gradient_at(by);
        let value = (0..3).fold(e.value, |sum, k| sum + gradient[k] * by[k]);
        if !value.contains(0.0) {
            return Outcome::Empty;
        }
        let slope = gradient.map(|g| 0.5 * g.lo() + 0.5 * g.hi());
        let length = norm(slope);
        if !(length > 0.0 && length.is_finite()) {
            return Outcome::Unknown;
        }
        let n = slope.map(|g| g / length);
        // The surface passes near the middle.
        let is_inside = e.value.lo().abs() <= 0.5 * radius * length;
        // The deepest first. The borders' pieces are straight to a share of the depth only.
        let mut is_hopeless = true;
        let mut near: Vec<(f64, usize, (f64, f64))> = (sheets.iter().zip(0..))
            .filter_map(|(sheet, at)| {
                let foot = sheet.foot(c, radius)?;
                let depth = sheet.border.distance(c);
                is_hopeless &= depth + radius < self.depth * (1.0 - STRAIGHT);
                (depth - radius >= self.depth).then_some((depth, at, foot))
            })
            .collect();
        near.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let deep =
            (near.iter()).find_map(|(_, at, foot)| self.lies_in(&sheets[*at], cell, n, *foot));
        match deep {
            Some(distance) => Outcome::Deep(distance),
            None if is_hopeless && is_inside && radius < SMALL * self.depth => Outcome::Open,
            None => Outcome::Unknown,
        }
    }

    /// How far the points of the surface in a cell are from a patch at most, along n and at
    /// parameters about those of a place near the cell's middle; none where that cannot be said.
    fn lies_in(
        &self,
        sheet: &Sheet<'_>,
        cell: &Aabb,
        n: Point3,
        (u, v): (f64, f64),
    ) -> Option<f64> {
        let c = cell.center();
        let part = across(sheet.patch, cell, n, (u, v))?;
        // The points of the patch there, those of the cell and all between them, and as far around
        // as the surface is from the patch.
        let mut region = part.control_box()?;
        region.add(cell.lo);
        region.add(cell.hi);
        let wide = sheet.bound * (1.0 + 1e-9);
        let region = Aabb {
            lo: region.lo.map(|v| v - wide),
            hi: region.hi.map(|v| v + wide),
        };
        let gradient = self
            .field
            .expansion(c, region)?
            .gradient_at(offsets(&region, c));
        let along = (0..3).fold(Interval::constant(0.0), |sum, k| {
            sum + gradient[k] * Interval::constant(n[k])
        });
        let most = norm(gradient.map(|g| g.lo().abs().max(g.hi().abs())));
        // n is a unit vector up to rounding.
        let farther = most / along.lo() * (1.0 + 1e-9);
        (along.lo() > 0.0 && farther <= FARTHER).then_some(farther * sheet.bound)
    }
}

/// A part of a patch, about given parameters, that every line along n through a point of a cell
/// meets, by Krawczyk's operator; none where that does not show it.
fn across(
    patch: &RationalPatch,
    cell: &Aabb,
    n: Point3,
    (u, v): (f64, f64),
) -> Option<RationalPatch> {
    let c = cell.center();
    let t = patch.tangents(u, v);
    // Rows that take a vector to its share of the tangents, across n.
    let volume = dot(n, cross(t.u, t.v));
    if volume == 0.0 {
        return None;
    }
    let rows = [cross(t.v, n), cross(n, t.u)].map(|row| row.map(|x| x / volume));
    let half = cell.size().map(|s| 0.5 * s * (1.0 + 1e-12));
    let off = sub(t.point, c);
    // |A⁻¹(p − q)| at the known place for all q of the cell.
    let first = rows.map(|row| {
        let wide: f64 = (0..3).map(|k| row[k].abs() * half[k]).sum();
        dot(row, off).abs() + wide
    });
    let [du, dv] = first.map(|f| WIDER * f);
    let ranges = [(u - du, u + du), (v - dv, v + dv)];
    if !(ranges.iter()).all(|r| r.0 >= 0.0 && r.1 <= 1.0 && r.0 < r.1) {
        return None;
    }
    let part = patch.part(ranges[0], ranges[1]);
    let slopes = slopes_of(&part, t.point, rows)?;
    // With parameters from −1 to 1 about the known place: |A⁻¹(p − q)| + |1 − A⁻¹p′| ≤ 1.
    for (k, reach) in [du, dv].into_iter().enumerate() {
        let mut sum = first[k] / reach;
        for l in 0..2 {
            // The part's parameters go from 0 to 1: its derivatives are twice those wanted.
            let share = Interval::constant(0.5 / reach) * slopes[k][l];
            let unit = if k == l { 1.0 } else { 0.0 };
            sum += (share.hi() - unit).max(unit - share.lo());
        }
        if sum.is_nan() || sum > 1.0 - TO_SPARE {
            return None;
        }
    }
    Some(part)
}

/// Ranges of the derivatives in both parameters, in the inner order, of a patch's products with
/// vectors; `c` is near it. None where a control weight is not positive.
fn slopes_of(patch: &RationalPatch, c: Point3, rows: [Point3; 2]) -> Option<[[Interval; 2]; 2]> {
    let (m, n) = patch.degree();
    let control = patch.control();
    let (least, most) = patch.control_weights();
    if least <= 0.0 {
        return None;
    }
    let weight = Interval::new(least, most);
    let at = |i: usize, j: usize| i * (n + 1) + j;
    // The range of the derivative of a polynomial, by its coefficients' differences.
    let derivative = |values: &[f64], l: usize| {
        let range = |pairs: &mut dyn Iterator<Item = (usize, usize)>, factor: f64| {
            let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
            for (a, b) in pairs {
                let d = factor * (values[b] - values[a]);
                (lo, hi) = (lo.min(d), hi.max(d));
            }
            Interval::new(lo, hi)
        };
        let pairs = |di: usize, dj: usize| {
            (0..=m - di)
                .flat_map(move |i| (0..=n - dj).map(move |j| (at(i, j), at(i + di, j + dj))))
        };
        if l == 0 {
            range(&mut pairs(1, 0), m as f64)
        } else {
            range(&mut pairs(0, 1), n as f64)
        }
    };
    let weights: Vec<f64> = control.iter().map(|p| p[3]).collect();
    let by_weight = [derivative(&weights, 0), derivative(&weights, 1)];
    Some(rows.map(|row| {
        let values: Vec<f64> = (control.iter())
            .map(|p| (0..3).map(|k| row[k] * (p[k] - c[k] * p[3])).sum())
            .collect();
        let range = (values.iter().zip(&weights))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), (v, w)| {
                (lo.min(v / w), hi.max(v / w))
            });
        // (X/w)′ = (X′ − (X/w) w′)/w.
        let quotient = Interval::new(range.0, range.1);
        [0, 1].map(|l| (derivative(&values, l) - quotient * by_weight[l]) / weight)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_field::Polynomial;

    fn never() -> bool {
        false
    }

    fn square(x: (f64, f64), y: (f64, f64)) -> RationalPatch {
        let (a, b) = (x.1 - x.0, y.1 - y.0);
        RationalPatch::planar((3, 2), [x.0, y.0, 1e-6], [a, 0.0, 0.0], [0.0, b, 0.0])
    }

    /// What is proved of z = 0 (or another function) in the cube of edge 1 for patches 1e-6 away.
    fn of(field: &Polynomial, patches: &[RationalPatch], depth: f64) -> Proof {
        let sheets: Vec<Sheet<'_>> = (patches.iter())
            .map(|p| Sheet::new(p, 1e-6, depth).expect("positive weights"))
            .collect();
        let question = Question {
            field,
            region: Aabb {
                lo: [-0.5; 3],
                hi: [0.5; 3],
            },
            depth,
            singular: &[],
            apart: 0.0,
        };
        prove(&question, &sheets, 2, &never)
    }

    /// Two squares of a plane that overlap by 0.2: where they do, points are 0.1 deep.
    #[test]
    fn a_margin_is_proved_as_far_as_patches_overlap() {
        let plane = Polynomial::new([([0, 0, 1], 1.0)]);
        let wide = (-0.7, 0.7);
        let both = [square((-0.7, 0.1), wide), square((-0.1, 0.7), wide)];
        for depth in [0.01, 0.09, 0.098] {
            let proof = of(&plane, &both, depth);
            assert!(proof.open.is_empty(), "{depth}: {:?}", proof.open.first());
            assert!((1e-6..1.1e-6).contains(&proof.distance));
        }
        let proof = of(&plane, &both, 0.102);
        assert!(!proof.open.is_empty());
        // Only where they overlap.
        for cell in &proof.open {
            assert!(cell.lo[0] < 0.01 && cell.hi[0] > -0.01, "{cell:?}");
        }
    }

    /// What no patch covers is open, wherever it is: a strip, and another sheet of the surface.
    #[test]
    fn what_is_not_covered_is_open() {
        let plane = Polynomial::new([([0, 0, 1], 1.0)]);
        let one = [square((-0.7, 0.4), (-0.7, 0.7))];
        let proof = of(&plane, &one, 0.05);
        assert!(proof.open.iter().any(|b| b.hi[0] > 0.45));
        assert!(proof.open.iter().all(|b| b.hi[0] > 0.34));
        let planes = Polynomial::new([([0, 0, 2], 1.0), ([0, 0, 1], -0.02)]);
        let proof = of(&planes, &[square((-0.7, 0.7), (-0.7, 0.7))], 0.05);
        assert!(proof.open.iter().all(|b| b.hi[2] > 0.015));
        assert!(proof.open.len() > 100);
    }

    /// A rational curve's pieces are never farther than its points, and nearly as far.
    #[test]
    fn pieces_of_a_border_are_as_far_as_its_points() {
        let control = (0..16).map(|i| {
            let (a, w) = (f64::from(i), 1.0 + 0.4 * f64::from(i * 7).sin());
            [(a * 1.3).sin() * w, (a * 0.7).cos() * w, 0.1 * a * w, w]
        });
        let patch = RationalPatch::new((3, 3), control.collect()).expect("a patch");
        let border = Border::new(&patch, 0.1);
        for k in 0..40 {
            let p: Point3 = std::array::from_fn(|i| f64::from(k * 3 + i as i32).sin());
            let nearest = (0..=2000)
                .map(|i| f64::from(i) / 2000.0)
                .flat_map(|t| [(t, 0.0), (t, 1.0), (0.0, t), (1.0, t)])
                .map(|(u, v)| norm(sub(patch.point(u, v), p)))
                .fold(f64::INFINITY, f64::min);
            let bound = border.distance(p);
            assert!(
                bound <= nearest && nearest - bound < 4e-3,
                "{bound} {nearest}"
            );
        }
    }

    /// x′ falls from 3 to 0 at u = 0.34, where the patch turns back: a small cell is met, one that
    /// comes near is not known to be.
    #[test]
    fn cells_near_a_fold_are_not_known_to_be_met() {
        let row = |x: f64| [0.0, 0.5, 1.0].map(|y| [x, y, 0.0, 1.0]);
        let control = [0.0, 1.0, -0.2, 0.8].map(row).concat();
        let patch = RationalPatch::new((3, 2), control).expect("a patch");
        let c = patch.point(0.15, 0.5);
        let met = |half: f64| {
            let cell = Aabb {
                lo: [c[0] - half, c[1] - 0.01, -0.01],
                hi: [c[0] + half, c[1] + 0.01, 0.01],
            };
            across(&patch, &cell, [0.0, 0.0, 1.0], (0.15, 0.5)).is_some()
        };
        assert!(met(0.02));
        assert!(!met(0.12));
    }

    /// Every line through a cell inside of the patch meets it; not so beyond its border.
    #[test]
    fn lines_are_met_where_the_operator_says_so() {
        let patch = square((-0.5, 0.5), (-0.5, 0.5));
        let cell = |c: Point3, r: f64| Aabb {
            lo: c.map(|v| v - r),
            hi: c.map(|v| v + r),
        };
        let n = [0.0, 0.0, 1.0];
        let part = across(&patch, &cell([0.1, 0.1, 0.0], 0.01), n, (0.6, 0.6)).expect("met");
        let region = part.control_box().expect("a box");
        assert!(region.lo[0] < 0.09 && region.hi[0] > 0.11);
        // Too near the border, and about a place that is too far.
        assert!(across(&patch, &cell([0.49, 0.1, 0.0], 0.01), n, (0.99, 0.6)).is_none());
        assert!(across(&patch, &cell([0.1, 0.1, 0.0], 0.01), n, (0.2, 0.6)).is_none());
    }
}
