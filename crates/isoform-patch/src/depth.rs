//! Depth: distance by which a point of the surface lies inside a patch, measured and proved.
//!
//! The depth of a point is its straight distance from the border of its patch, the four curves u =
//! 0, u = 1, v = 0 and v = 1; measured along the surface, the border is at least as far. Solids
//! need it: curves along which patches are cut must not leave the patches.
//!
//! The proof subdivides the region into cells. On a cell where n·∇F ≥ G > 0 for a unit vector n,
//! Krawczyk's operator (R. Krawczyk: Newton-Algorithmen zur Bestimmung von Nullstellen mit
//! Fehlerschranken, Computing 4 (1969)), applied to p(u, v) − q across n, shows that the line along
//! n through every point q of the cell meets the patch at a point (u, v) near a known one. If F(q)
//! = 0, the patch is there no farther from q than |F(p(u, v))|/G, which is at most the proved
//! distance of the patch from the surface times max |∇F|/G. As the depth is 1-Lipschitz, the depth
//! at the centre of the cell minus the cell's radius is a lower bound. Cells on which this fails
//! are divided.

mod border;
mod krawczyk;
mod sheet;

pub(crate) use border::Border;
pub(crate) use sheet::DepthPatch;

use crate::places::wider;
use border::MAX_BORDER_DEVIATION;
use isoform_control::Control;
use isoform_geom::{Aabb, Field, Point3, norm, sub};
use isoform_num::{Interval, Real};
use krawczyk::across;
use rayon::prelude::*;

/// Radius of cells, in required depths, below which cells are not divided further.
const MIN_CELL_RADIUS: f64 = 1.0 / 64.0;
/// Number of blocks along each edge of the region that are proved in parallel; fixed, so that the
/// result does not depend on the number of threads.
const PROOF_BLOCKS_PER_EDGE: usize = 4;
/// Maximum number of open cells of a block; once it is reached, the proof of the block ends.
const MAX_OPEN_CELLS: usize = 2000;

/// Result of the proof of a depth.
#[derive(Clone, Debug, Default)]
pub(crate) struct DepthProof {
    /// Upper bound on the distance from a point of the surface, outside the open boxes, to a point
    /// of a patch at the required depth.
    pub(crate) distance: f64,
    /// Boxes in which the depth could not be proved.
    pub(crate) open: Vec<Aabb>,
}

/// Statement to be proved: the surface in a region lies `depth` inside patches.
pub(crate) struct DepthClaim<'a> {
    pub(crate) field: &'a dyn Field,
    pub(crate) region: Aabb,
    pub(crate) depth: f64,
    /// Singular points; cells wholly within `apart` of one are exempt.
    pub(crate) singular: &'a [Point3],
    pub(crate) apart: f64,
}

/// Result for one cell.
enum CellOutcome {
    /// The cell contains no part of the surface, or only exempt parts.
    Empty,
    /// All of the surface in the cell is deep enough in a patch, which is at most this far away.
    Deep(f64),
    /// The result may be known for parts of the cell.
    Unknown,
    /// The cell lies deep enough in no patch.
    Open,
}

/// Tries to prove that every point of the surface in a region lies at the required depth inside
/// some patch. Cells that remain when the control stops the proof count as open.
pub(crate) fn prove(
    question: &DepthClaim<'_>,
    sheets: &[DepthPatch<'_>],
    control: &Control<'_>,
) -> DepthProof {
    let blocks: Vec<DepthProof> = (0..PROOF_BLOCKS_PER_EDGE.pow(3))
        .into_par_iter()
        .map(|number| prove_block(question, sheets, block(&question.region, number), control))
        .collect();
    let mut all = DepthProof::default();
    for block in blocks {
        all.distance = all.distance.max(block.distance);
        all.open.extend(block.open);
    }
    all
}

/// Returns a block of a region by its number.
fn block(region: &Aabb, number: usize) -> Aabb {
    let Aabb { lo, hi } = region;
    let part = [
        number % PROOF_BLOCKS_PER_EDGE,
        number / PROOF_BLOCKS_PER_EDGE % PROOF_BLOCKS_PER_EDGE,
        number / PROOF_BLOCKS_PER_EDGE / PROOF_BLOCKS_PER_EDGE,
    ];
    let at = |k: usize, i: usize| match i {
        PROOF_BLOCKS_PER_EDGE => hi[k],
        i => lo[k] + (hi[k] - lo[k]) * i as f64 / PROOF_BLOCKS_PER_EDGE as f64,
    };
    Aabb {
        lo: std::array::from_fn(|k| at(k, part[k])),
        hi: std::array::from_fn(|k| at(k, part[k] + 1)),
    }
}

fn prove_block(
    question: &DepthClaim<'_>,
    sheets: &[DepthPatch<'_>],
    block: Aabb,
    control: &Control<'_>,
) -> DepthProof {
    let mut proof = DepthProof::default();
    let mut pending = vec![block];
    while let Some(cell) = pending.pop() {
        let is_large = 0.5 * cell.diagonal() > MIN_CELL_RADIUS * question.depth;
        match question.look(sheets, &cell) {
            CellOutcome::Empty => {}
            CellOutcome::Deep(distance) => proof.distance = proof.distance.max(distance),
            CellOutcome::Unknown if is_large && !control.is_stopped() => {
                pending.extend(halves(&cell));
            }
            CellOutcome::Unknown | CellOutcome::Open => {
                proof.open.push(cell);
                if proof.open.len() == MAX_OPEN_CELLS {
                    proof.open.append(&mut pending);
                }
            }
        }
    }
    proof
}

/// Splits a box in the middle of its longest edge.
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

/// Returns intervals that contain the points of a box minus c.
fn offsets(region: &Aabb, c: Point3) -> [Interval; 3] {
    std::array::from_fn(|k| Interval::new(region.lo[k], region.hi[k]) - Interval::constant(c[k]))
}

/// Returns half the diagonal of a cell, rounded up: an upper bound on the distance of its points
/// from its centre.
fn radius(cell: &Aabb) -> f64 {
    0.5 * cell.diagonal() * (1.0 + 1e-12)
}

/// Behaviour of F on a cell.
enum GradientBehaviour {
    /// F does not vanish.
    Away,
    /// Nothing is proved.
    Unknown,
    /// F increases along the unit vector n; `is_inside` if it vanishes near the centre.
    Along { n: Point3, is_inside: bool },
}

/// Patches near a cell.
struct NearbyPatches {
    /// Indices of patches in which the centre is deep enough, the deepest first, with the
    /// parameters of its foot.
    deep: Vec<(usize, (f64, f64))>,
    /// True if no point of the cell lies deep enough in any patch.
    is_hopeless: bool,
}

impl DepthClaim<'_> {
    fn look(&self, sheets: &[DepthPatch<'_>], cell: &Aabb) -> CellOutcome {
        if self.is_left_out(cell) {
            return CellOutcome::Empty;
        }
        let (n, is_inside) = match self.course(cell) {
            GradientBehaviour::Away => return CellOutcome::Empty,
            GradientBehaviour::Unknown => return CellOutcome::Unknown,
            GradientBehaviour::Along { n, is_inside } => (n, is_inside),
        };
        let near = self.near(sheets, cell);
        let mut deep = near.deep.iter();
        let deep = deep.find_map(|(at, foot)| self.lies_in(&sheets[*at], cell, n, *foot));
        match deep {
            Some(distance) => CellOutcome::Deep(distance),
            // Larger cells are divided first, as they may contain no surface.
            None if near.is_hopeless && is_inside && radius(cell) < 0.25 * self.depth => {
                CellOutcome::Open
            }
            None => CellOutcome::Unknown,
        }
    }

    /// Returns true if a cell provably contains no part of the surface, or lies within `apart` of a
    /// singular point.
    fn is_left_out(&self, cell: &Aabb) -> bool {
        let (c, radius) = (cell.center(), radius(cell));
        let is_within = |s: &Point3| norm(sub(*s, c)) + radius <= self.apart;
        !self.field.bounds(*cell).contains(0.0) || self.singular.iter().any(is_within)
    }

    fn course(&self, cell: &Aabb) -> GradientBehaviour {
        let c = cell.center();
        let Some(e) = self.field.expansion(c, *cell) else {
            return GradientBehaviour::Unknown;
        };
        let by = offsets(cell, c);
        let gradient = e.gradient_at(by);
        let value = (0..3).fold(e.value, |sum, k| sum + gradient[k] * by[k]);
        if !value.contains(0.0) {
            return GradientBehaviour::Away;
        }
        let slope = gradient.map(|g| 0.5 * g.lo() + 0.5 * g.hi());
        let length = norm(slope);
        if !(length > 0.0 && length.is_finite()) {
            return GradientBehaviour::Unknown;
        }
        GradientBehaviour::Along {
            n: slope.map(|g| g / length),
            is_inside: e.value.lo().abs() <= 0.5 * radius(cell) * length,
        }
    }

    fn near(&self, sheets: &[DepthPatch<'_>], cell: &Aabb) -> NearbyPatches {
        let (c, radius) = (cell.center(), radius(cell));
        // The pieces of borders deviate from straight lines by up to this fraction of the depth.
        let mut is_hopeless = true;
        let mut deep: Vec<(f64, usize, (f64, f64))> = (sheets.iter().zip(0..))
            .filter_map(|(sheet, at)| {
                let foot = sheet.foot(c, radius)?;
                let depth = sheet.border.distance(c);
                is_hopeless &= depth + radius < self.depth * (1.0 - MAX_BORDER_DEVIATION);
                (depth - radius >= self.depth).then_some((depth, at, foot))
            })
            .collect();
        deep.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        NearbyPatches {
            deep: deep.into_iter().map(|(_, at, foot)| (at, foot)).collect(),
            is_hopeless,
        }
    }

    /// Returns an upper bound on the distance of the surface in a cell from a patch, measured along
    /// n and at parameters near those of a given foot of the centre; `None` if no bound is proved.
    fn lies_in(
        &self,
        sheet: &DepthPatch<'_>,
        cell: &Aabb,
        n: Point3,
        foot: (f64, f64),
    ) -> Option<f64> {
        let c = cell.center();
        let part = across(sheet.patch, cell, n, foot)?;
        // The box contains the points of the patch there, those of the cell and all between them,
        // widened by the distance of the surface from the patch.
        let mut region = part.control_box()?;
        region.add(cell.lo);
        region.add(cell.hi);
        let wide = sheet.bound * (1.0 + 1e-9);
        let region = wider(&region, wide);
        let gradient = self
            .field
            .expansion(c, region)?
            .gradient_at(offsets(&region, c));
        let along = (0..3).fold(Interval::constant(0.0), |sum, k| {
            sum + gradient[k] * Interval::constant(n[k])
        });
        let most = norm(gradient.map(|g| g.lo().abs().max(g.hi().abs())));
        // The factor 1 + 1e-9 allows for the rounding of the unit vector n.
        let farther = most / along.lo() * (1.0 + 1e-9);
        // Where it exceeds 1.5, the normal turns too much on the cell.
        (along.lo() > 0.0 && farther <= 1.5).then_some(farther * sheet.bound)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_field::Polynomial;
    use isoform_geom::RationalPatch;

    fn square(x: (f64, f64), y: (f64, f64)) -> RationalPatch {
        let (a, b) = (x.1 - x.0, y.1 - y.0);
        RationalPatch::planar((3, 2), [x.0, y.0, 1e-6], [a, 0.0, 0.0], [0.0, b, 0.0])
    }

    /// Proves a depth for z = 0 (or another function) in the cube of edge 1 with patches 1e-6 away.
    fn prove_depth(field: &Polynomial, patches: &[RationalPatch], depth: f64) -> DepthProof {
        let sheets: Vec<DepthPatch<'_>> = (patches.iter())
            .map(|p| DepthPatch::new(p, 1e-6, depth).expect("positive weights"))
            .collect();
        let question = DepthClaim {
            field,
            region: Aabb {
                lo: [-0.5; 3],
                hi: [0.5; 3],
            },
            depth,
            singular: &[],
            apart: 0.0,
        };
        prove(&question, &sheets, &Control::default())
    }

    /// Two squares of a plane that overlap by 0.2: points in the overlap are at least 0.1 deep in
    /// one of them.
    #[test]
    fn a_margin_is_proved_as_far_as_patches_overlap() {
        let plane = Polynomial::new([([0, 0, 1], 1.0)]);
        let wide = (-0.7, 0.7);
        let both = [square((-0.7, 0.1), wide), square((-0.1, 0.7), wide)];
        for depth in [0.01, 0.09, 0.098] {
            let proof = prove_depth(&plane, &both, depth);
            assert!(proof.open.is_empty(), "{depth}: {:?}", proof.open.first());
            assert!((1e-6..1.1e-6).contains(&proof.distance));
        }
        let proof = prove_depth(&plane, &both, 0.102);
        assert!(!proof.open.is_empty());
        // Only cells in the overlap are open.
        for cell in &proof.open {
            assert!(cell.lo[0] < 0.01 && cell.hi[0] > -0.01, "{cell:?}");
        }
    }

    /// Uncovered parts of the surface are open: a strip, and a second sheet.
    #[test]
    fn what_is_not_covered_is_open() {
        let plane = Polynomial::new([([0, 0, 1], 1.0)]);
        let one = [square((-0.7, 0.4), (-0.7, 0.7))];
        let proof = prove_depth(&plane, &one, 0.05);
        assert!(proof.open.iter().any(|b| b.hi[0] > 0.45));
        assert!(proof.open.iter().all(|b| b.hi[0] > 0.34));
        let planes = Polynomial::new([([0, 0, 2], 1.0), ([0, 0, 1], -0.02)]);
        let proof = prove_depth(&planes, &[square((-0.7, 0.7), (-0.7, 0.7))], 0.05);
        assert!(proof.open.iter().all(|b| b.hi[2] > 0.015));
        assert!(proof.open.len() > 100);
    }
}
