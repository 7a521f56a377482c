//! Bound M/G of a cell near which the surface is smooth or smooth parts meet in edges.

use super::cell::PatchCell;
use super::prover::Prover;
use super::taylor::{PartLimit, Taylor, cubic, magnitude, middle, radius, range, slopes};
use crate::whole::{PartsInRegion, Whole};
use isoform_geom::{Aabb, Csg, Expansion, Field, Point3, norm};
use isoform_num::Interval;

/// Returns M/G; `None` if it exceeds `beyond` or cannot be proved.
pub(super) fn smooth_bound(prover: &Prover<'_>, cell: &PatchCell, beyond: f64) -> Option<f64> {
    let near = NearbyParts::new(prover, cell, beyond)?;
    let (up, down) = near.slopes();
    let range = near.range();
    let most = if prover.whole.is_single() {
        prover.known / near.unit(0)
    } else {
        f64::INFINITY
    };
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

/// Parts of the surface near a cell.
struct NearbyParts<'a> {
    prover: &'a Prover<'a>,
    whole: &'a Whole<'a>,
    cell: &'a PatchCell,
    /// Distance beyond the cell in which the surface is sought.
    beyond: f64,
    /// Box that extends as far beyond the cell.
    region: Aabb,
    within: PartsInRegion,
    expansions: Vec<Expansion>,
    /// Length |∇F| of each part's gradient at c.
    lengths: Vec<f64>,
    /// Unit normal ∇F/|∇F| of each part at c.
    normals: Vec<Point3>,
}

impl<'a> NearbyParts<'a> {
    /// Prepares the parts near a cell; `None` if a part cannot be expanded or its gradient
    /// vanishes.
    fn new(prover: &'a Prover<'a>, cell: &'a PatchCell, beyond: f64) -> Option<Self> {
        let (whole, region) = (prover.whole, cell.around(beyond));
        let within = whole.within(region)?;
        let expand = |k: &usize| whole.field(*k).expansion(cell.c, region);
        let expansions: Vec<Expansion> = within.parts.iter().map(expand).collect::<Option<_>>()?;
        let mut normals = Vec::with_capacity(expansions.len());
        let mut lengths = Vec::with_capacity(expansions.len());
        for e in &expansions {
            let g = slopes(e);
            let length = norm(g);
            if length == 0.0 || !length.is_finite() {
                return None;
            }
            lengths.push(length);
            normals.push(g.map(|v| v / length));
        }
        Some(Self {
            prover,
            whole,
            cell,
            beyond,
            region,
            within,
            expansions,
            lengths,
            normals,
        })
    }

    /// Returns the piece to which the k-th part belongs.
    fn piece(&self, k: usize) -> u32 {
        self.whole.piece(self.within.parts[k])
    }

    /// Returns the parts of one piece.
    fn of_piece(&self, piece: u32) -> impl Iterator<Item = usize> + '_ {
        (0..self.within.parts.len()).filter(move |&k| self.piece(k) == piece)
    }

    /// Returns the unit of F for the k-th part: the largest |∇F| among the parts of its piece.
    fn unit(&self, k: usize) -> f64 {
        let same = self.of_piece(self.piece(k));
        same.fold(0.0f64, |m, k| m.max(self.lengths[k]))
    }

    /// Returns lower bounds of the rates at which F/|∇F| increases where it is positive, and
    /// decreases where it is negative.
    fn slopes(&self) -> (f64, f64) {
        let slope = self.slope_of(0..self.within.parts.len());
        // A positive minimum vanishes as soon as one of its pieces does, possibly the one that
        // attains it; likewise a negative maximum.
        let own = || {
            let pieces = self.within.tree.pieces().into_iter();
            let slopes = pieces.map(|piece| self.slope_of(self.of_piece(piece)));
            slopes.fold(f64::INFINITY, f64::min)
        };
        match &self.within.tree {
            Csg::Min(children) if are_pieces(children) => (own(), slope),
            Csg::Max(children) if are_pieces(children) => (slope, own()),
            _ => (slope, slope),
        }
    }

    /// Returns the least slope of some parts along the sum of their normals.
    fn slope_of(&self, parts: impl Iterator<Item = usize>) -> f64 {
        let list: Vec<usize> = parts.collect();
        let n: Point3 = std::array::from_fn(|i| list.iter().map(|&k| self.normals[k][i]).sum());
        let length = norm(n);
        let along = SearchSet {
            n: n.map(|v| v / length),
            beyond: self.beyond,
            wide: self.cell.r.map(|v| v + self.beyond),
            cell: self.cell,
        };
        let each = (list.iter()).map(|&k| along.slope(&self.expansions[k]) / self.unit(k));
        // `f64::min` would ignore NaN.
        each.fold(f64::INFINITY, |m, s| if s > 0.0 { m.min(s) } else { 0.0 }) * (1.0 - 1e-12)
    }

    /// Returns the range of F on the cell, each piece divided by its unit.
    fn range(&self) -> Interval {
        let all = 0..self.within.parts.len();
        let ranges: Vec<Option<Interval>> = all.map(|k| self.range_of(k)).collect();
        let of_piece = |piece: u32| {
            let of = self.of_piece(piece).filter_map(|k| ranges[k]);
            of.reduce(|a, b| a.hull(&b)).unwrap_or(Interval::ALL)
        };
        self.within.tree.range(&of_piece)
    }

    /// Returns the range of the k-th part in its unit; `None` if the part is not valid anywhere on
    /// the cell.
    fn range_of(&self, k: usize) -> Option<Interval> {
        let unit = self.unit(k);
        let taylor = Taylor::new(&self.expansions[k], self.cell.r);
        let (mut lo, mut hi) = range(&taylor, self.cell, &self.prover.products);
        let has_edges = self.within.parts.len() > 1;
        if self.within.alone[k] && lo <= hi && has_edges {
            (lo, hi) = self.cut_by_limits(k, &taylor, (lo, hi))?;
        }
        // On flat faces along the axes, intervals are sharper: they show that a square is nowhere
        // negative, as at the beginning of a blend.
        let known = if has_edges {
            let field = self.whole.field(self.within.parts[k]);
            field.bounds(self.cell.around(0.0))
        } else {
            Interval::ALL
        };
        if !(lo <= hi && known.lo() <= known.hi()) {
            return Some(Interval::ALL);
        }
        // Rounding of the cell's points may make the two ranges disjoint, by less than the error
        // that is added for it; then the gap between them is returned.
        let (lo, hi) = (lo.max(known.lo()), hi.min(known.hi()));
        Some(Interval::new(lo.min(hi) / unit, lo.max(hi) / unit))
    }

    /// Returns a range of the k-th part where none of its limits is negative; `None` if one limit
    /// is negative on the whole cell.
    fn cut_by_limits(
        &self,
        k: usize,
        taylor: &Taylor,
        (mut lo, mut hi): (f64, f64),
    ) -> Option<(f64, f64)> {
        let others: Vec<&Expansion> = self
            .of_piece(self.piece(k))
            .filter(|&o| o != k)
            .map(|o| &self.expansions[o])
            .collect();
        if others.is_empty() {
            return Some((lo, hi));
        }
        for limit in self.whole.limits(self.within.parts[k]) {
            let Some(limit) = self.limit(*limit) else {
                continue;
            };
            if limit.most < 0.0 {
                return None;
            }
            for other in &others {
                let bend = limit.bend(&self.expansions[k], other);
                let bent = taylor.bent(&limit, bend, self.cell.r);
                let cut = range(&bent, self.cell, &self.prover.products);
                if bend > 0.0 {
                    hi = hi.min(cut.1)
                } else {
                    lo = lo.max(cut.0)
                }
            }
        }
        Some((lo, hi))
    }

    /// Expands a limit on the cell; `None` if it is not negative near there or cannot be expanded.
    fn limit(&self, limit: &dyn Field) -> Option<PartLimit> {
        let may_be_negative = limit.bounds(self.region).lo() < 0.0;
        let expansion = may_be_negative.then(|| limit.expansion(self.cell.c, self.region));
        PartLimit::new(&expansion.flatten()?, self.cell)
    }
}

/// Returns true if all children of a minimum or maximum are pieces.
fn are_pieces(children: &[Csg]) -> bool {
    children.iter().all(|child| matches!(child, Csg::Piece(_)))
}

/// Set in which the surface is sought: the points of a cell, moved along ±n.
struct SearchSet<'c> {
    n: Point3,
    /// Maximum distance of the move.
    beyond: f64,
    /// Bounds on the differences of its coordinates from those of c.
    wide: Point3,
    cell: &'c PatchCell,
}

impl SearchSet<'_> {
    /// Returns a lower bound of n·∇F on the set.
    fn slope(&self, e: &Expansion) -> f64 {
        let (n, g, c) = (self.n, slopes(e), self.cell.c);
        let h: [f64; 6] = std::array::from_fn(|k| middle(&e.hessian[k]));
        let t: [f64; 10] = std::array::from_fn(|k| magnitude(&e.third[k]));
        let at = |i: usize, j: usize| Expansion::SECOND[i][j];
        let nh: Point3 = std::array::from_fn(|j| (0..3).map(|i| n[i] * h[at(i, j)]).sum());
        let mut lost = self.radii(e);
        lost += self.beyond * (nh[0] * n[0] + nh[1] * n[1] + nh[2] * n[2]).abs();
        lost += 16.0
            * f64::EPSILON
            * (0..3)
                .map(|j| nh[j].abs() * (c[j].abs() + self.wide[j]))
                .sum::<f64>();
        lost += 0.5 * cubic(&t, self.wide, Some(n.map(f64::abs)));
        (0..3).map(|k| n[k] * g[k]).sum::<f64>() + self.least(nh) - lost
    }

    /// Returns the amount by which the radii of first and second derivatives may reduce n·∇F.
    fn radii(&self, e: &Expansion) -> f64 {
        let mut lost = 0.0;
        for i in 0..3 {
            let n = self.n[i].abs();
            lost += n * radius(&e.gradient[i]);
            for j in 0..3 {
                lost += n * radius(&e.hessian[Expansion::SECOND[i][j]]) * self.wide[j];
            }
        }
        lost
    }

    /// Returns the minimum of nᵀHδ on the cell, which is attained at a control point.
    fn least(&self, nh: Point3) -> f64 {
        let at = |p: &[f64; 4]| (nh[0] * p[0] + nh[1] * p[1] + nh[2] * p[2]) / p[3];
        self.cell.d.iter().map(at).fold(f64::INFINITY, f64::min)
    }
}
