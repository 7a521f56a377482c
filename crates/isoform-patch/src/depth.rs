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

mod border;
mod krawczyk;
mod sheet;

pub(crate) use border::Border;
pub(crate) use sheet::Sheet;

use crate::places::wider;
use border::STRAIGHT;
use isoform_control::Control;
use isoform_geom::{Aabb, Field, Point3, norm, sub};
use isoform_num::{Interval, Real};
use krawczyk::across;
use rayon::prelude::*;

/// Cells smaller than this, in the depth asked for, are not divided.
const SMALLEST: f64 = 1.0 / 64.0;
/// Cells smaller than this no point of which lies deep in a patch are not divided; larger ones may
/// hold none of the surface.
const SMALL: f64 = 0.25;
/// A patch may be this many times its proved distance away from a point along n; on cells where
/// that is more the normal turns too much.
const FARTHER: f64 = 1.5;
/// Blocks in each direction into which the region is divided, for threads; fixed, so that the
/// result does not depend on their number.
const BLOCKS: usize = 4;
/// Places that are told where a proof fails, in each block.
const MOST_OPEN: usize = 2000;

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

/// Tries to prove that every point of the surface in a region is as deep inside of some patch as
/// asked for. Where the control ends the proof, what is left counts as open.
pub(crate) fn prove(question: &Question<'_>, sheets: &[Sheet<'_>], control: &Control<'_>) -> Proof {
    let blocks: Vec<Proof> = (0..BLOCKS.pow(3))
        .into_par_iter()
        .map(|number| prove_block(question, sheets, block(&question.region, number), control))
        .collect();
    let mut all = Proof::default();
    for block in blocks {
        all.distance = all.distance.max(block.distance);
        all.open.extend(block.open);
    }
    all
}

/// A block of a region.
fn block(region: &Aabb, number: usize) -> Aabb {
    let Aabb { lo, hi } = region;
    let part = [
        number % BLOCKS,
        number / BLOCKS % BLOCKS,
        number / BLOCKS / BLOCKS,
    ];
    let at = |k: usize, i: usize| match i {
        BLOCKS => hi[k],
        i => lo[k] + (hi[k] - lo[k]) * i as f64 / BLOCKS as f64,
    };
    Aabb {
        lo: std::array::from_fn(|k| at(k, part[k])),
        hi: std::array::from_fn(|k| at(k, part[k] + 1)),
    }
}

fn prove_block(
    question: &Question<'_>,
    sheets: &[Sheet<'_>],
    block: Aabb,
    control: &Control<'_>,
) -> Proof {
    let mut proof = Proof::default();
    let mut pending = vec![block];
    while let Some(cell) = pending.pop() {
        let is_large = 0.5 * cell.diagonal() > SMALLEST * question.depth;
        match question.look(sheets, &cell) {
            Outcome::Empty => {}
            Outcome::Deep(distance) => proof.distance = proof.distance.max(distance),
            Outcome::Unknown if is_large && !control.is_stopped() => {
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

/// Half the diagonal of a cell, rounded up: no point of it is farther from its middle.
fn radius(cell: &Aabb) -> f64 {
    0.5 * cell.diagonal() * (1.0 + 1e-12)
}

/// F on a cell.
enum Course {
    /// It vanishes nowhere.
    Away,
    /// It cannot be said how it goes.
    Unknown,
    /// It grows along the unit vector n; whether it vanishes near the middle.
    Along { n: Point3, is_inside: bool },
}

/// What the patches are to a cell.
struct Nearness {
    /// Those in which its middle is deep enough, the deepest first, with the parameters of its
    /// foot.
    deep: Vec<(usize, (f64, f64))>,
    /// Whether no point of the cell lies deep enough in one.
    is_hopeless: bool,
}

impl Question<'_> {
    fn look(&self, sheets: &[Sheet<'_>], cell: &Aabb) -> Outcome {
        if self.is_left_out(cell) {
            return Outcome::Empty;
        }
        let (n, is_inside) = match self.course(cell) {
            Course::Away => return Outcome::Empty,
            Course::Unknown => return Outcome::Unknown,
            Course::Along { n, is_inside } => (n, is_inside),
        };
        let near = self.near(sheets, cell);
        let mut deep = near.deep.iter();
        let deep = deep.find_map(|(at, foot)| self.lies_in(&sheets[*at], cell, n, *foot));
        match deep {
            Some(distance) => Outcome::Deep(distance),
            None if near.is_hopeless && is_inside && radius(cell) < SMALL * self.depth => {
                Outcome::Open
            }
            None => Outcome::Unknown,
        }
    }

    /// Whether a cell holds certainly none of the surface that is asked for.
    fn is_left_out(&self, cell: &Aabb) -> bool {
        let (c, radius) = (cell.center(), radius(cell));
        let is_within = |s: &Point3| norm(sub(*s, c)) + radius <= self.apart;
        !self.field.bounds(*cell).contains(0.0) || self.singular.iter().any(is_within)
    }

    fn course(&self, cell: &Aabb) -> Course {
        let c = cell.center();
        let Some(e) = self.field.expansion(c, *cell) else {
            return Course::Unknown;
        };
        let by = offsets(cell, c);
        let gradient = e.gradient_at(by);
        let value = (0..3).fold(e.value, |sum, k| sum + gradient[k] * by[k]);
        if !value.contains(0.0) {
            return Course::Away;
        }
        let slope = gradient.map(|g| 0.5 * g.lo() + 0.5 * g.hi());
        let length = norm(slope);
        if !(length > 0.0 && length.is_finite()) {
            return Course::Unknown;
        }
        Course::Along {
            n: slope.map(|g| g / length),
            is_inside: e.value.lo().abs() <= 0.5 * radius(cell) * length,
        }
    }

    fn near(&self, sheets: &[Sheet<'_>], cell: &Aabb) -> Nearness {
        let (c, radius) = (cell.center(), radius(cell));
        // The borders' pieces are straight to a share of the depth only.
        let mut is_hopeless = true;
        let mut deep: Vec<(f64, usize, (f64, f64))> = (sheets.iter().zip(0..))
            .filter_map(|(sheet, at)| {
                let foot = sheet.foot(c, radius)?;
                let depth = sheet.border.distance(c);
                is_hopeless &= depth + radius < self.depth * (1.0 - STRAIGHT);
                (depth - radius >= self.depth).then_some((depth, at, foot))
            })
            .collect();
        deep.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        Nearness {
            deep: deep.into_iter().map(|(_, at, foot)| (at, foot)).collect(),
            is_hopeless,
        }
    }

    /// How far the points of the surface in a cell are from a patch at most, along n and at
    /// parameters about those of a place near the cell's middle; none where that cannot be said.
    fn lies_in(&self, sheet: &Sheet<'_>, cell: &Aabb, n: Point3, foot: (f64, f64)) -> Option<f64> {
        let c = cell.center();
        let part = across(sheet.patch, cell, n, foot)?;
        // The points of the patch there, those of the cell and all between them, and as far around
        // as the surface is from the patch.
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
        // n is a unit vector up to rounding.
        let farther = most / along.lo() * (1.0 + 1e-9);
        (along.lo() > 0.0 && farther <= FARTHER).then_some(farther * sheet.bound)
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
        prove(&question, &sheets, &Control::default())
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
}
