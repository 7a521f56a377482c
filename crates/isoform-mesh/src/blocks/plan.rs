//! Common data of all blocks: their interfaces, and properties of the whole model.

use super::{holds, within};
use crate::crowd::Crowd;
use crate::error::MeshError;
use crate::features::{Corner, Features, extent_within};
use crate::lattice::{CELL_EDGE, CellGrid, Cells};
use crate::mesher::features_of;
use crate::options::Options;
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid};

/// Number of rounds: a block is made, then tetrahedra near its sides are optimised again in blocks
/// with sides at other places. A point is near sides in three directions at most, so that in one of
/// four rounds it is near none.
pub const BLOCK_ROUNDS: usize = 4;
/// Shift of the sides in each round, as a fraction of a block.
const ROUND_SHIFTS: [f64; BLOCK_ROUNDS] = [0.0, 0.5, 0.25, 0.75];

/// A feature curve of the model.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedCurve {
    /// Pieces that meet in the curve, ascending.
    pub pieces: [u32; 2],
    /// Points in order along the curve.
    pub points: Vec<Point3>,
}

/// Common data of all blocks. A plan is computed once, in time and memory that grow with the
/// model's edges, not with its volume.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Box that is meshed.
    pub region: Aabb,
    /// True if intervals prove that nothing of the solid lies outside of the box.
    pub region_certified: bool,
    /// Number of blocks per axis.
    pub counts: [usize; 3],
    /// Requested edge length.
    pub size: f64,
    /// Feature curves.
    pub curves: Vec<PlannedCurve>,
    /// Corners at which the mesh must have nodes.
    pub corners: Vec<Point3>,
    /// Those of the corners that are tips of cones, without a curve.
    pub apexes: Vec<Corner>,
    /// True if intervals prove that all features were found.
    pub features_certified: bool,
    /// Points where features are close together, with the target edge length there.
    pub crowded: Vec<(Point3, f64)>,
}

impl Plan {
    /// Computes the model's box and features.
    ///
    /// # Errors
    /// Those of [`mesh`](crate::mesh); [`MeshError::Blocks`] for zero blocks or more than cells;
    /// and [`MeshError::Option`] for options that blocks do not support: second order, the surface
    /// alone.
    pub fn new(
        solid: &dyn Solid,
        counts: [usize; 3],
        options: &Options,
        control: &Control<'_>,
    ) -> Result<Self, MeshError> {
        options.check()?;
        check_kind(options)?;
        control.begin("extent")?;
        let start = options.region.unwrap_or(options.start);
        within(solid, options, |solid| {
            let extent = extent_within(solid, start, options.size, control)?;
            let grid = CellGrid::over(extent.bounds, CELL_EDGE * options.size);
            check_counts(counts, extent.bounds, grid)?;
            control.begin("features")?;
            let found = features_of(solid, extent.bounds, options, control);
            control.check()?;
            Ok(Self {
                region: extent.bounds,
                region_certified: extent.certified,
                counts,
                size: options.size,
                crowded: Crowd::new(&[&found], &[], options.size).places(),
                features_certified: found.certified,
                corners: corners(&found),
                apexes: found.apexes(),
                curves: curves(found),
            })
        })
    }

    /// Returns the number of blocks.
    pub fn blocks(&self) -> usize {
        self.counts.iter().product()
    }

    /// Returns the room of block `k`, x fastest, in a round; its lower sides belong to it.
    /// Outermost sides are infinitely far away.
    pub fn room(&self, round: usize, k: usize) -> Aabb {
        let at = self.indices(k);
        let side = |i: usize, k: usize| match k {
            0 => f64::NEG_INFINITY,
            k if k == self.counts[i] => f64::INFINITY,
            k => self.coordinate(i, self.sides(round, i)[k - 1]),
        };
        Aabb {
            lo: std::array::from_fn(|i| side(i, at[i])),
            hi: std::array::from_fn(|i| side(i, at[i] + 1)),
        }
    }

    /// Returns a predicate: true for points so near to sides in each of the first `rounds` rounds
    /// that tetrahedra there must be optimised again.
    pub(super) fn unsettled(&self, rounds: usize) -> impl Fn(Point3) -> bool + use<> {
        // Distance from sides, in cells, within which tetrahedra are optimised again. Less leaves
        // poor tetrahedra where those of both blocks would have to change; more duplicates work.
        let near = 6.0 * self.grid().a;
        let sides: Vec<[Vec<f64>; 3]> = (0..rounds)
            .map(|round| {
                std::array::from_fn(|i| {
                    let cells = self.sides(round, i).into_iter();
                    cells.map(|c| self.coordinate(i, c)).collect()
                })
            })
            .collect();
        move |p| {
            let is_near =
                |i: usize, at: &Vec<f64>| at.iter().any(|side| (p[i] - side).abs() <= near);
            let mut rounds = sides.iter();
            rounds.all(|sides| sides.iter().enumerate().any(|(i, at)| is_near(i, at)))
        }
    }

    /// Returns the cells that contain the tetrahedra of a room, and `more` beyond in each
    /// direction.
    pub(super) fn cells(&self, room: Aabb, more: usize) -> Cells {
        let grid = self.grid();
        std::array::from_fn(|i| {
            let cell = |x: f64| ((x - grid.origin[i]) / grid.a).floor();
            // Casts of out-of-range floats to usize saturate.
            let lo = cell(room.lo[i]) as usize;
            let hi = cell(room.hi[i]) as usize;
            [
                lo.saturating_sub(more).min(grid.n[i] - 1),
                hi.saturating_add(more + 1).min(grid.n[i]),
            ]
        })
    }

    /// Returns the box of a range of cells.
    pub(super) fn box_of(&self, cells: Cells) -> Aabb {
        let grid = self.grid();
        let corner =
            |k: usize| std::array::from_fn(|i| grid.origin[i] + cells[i][k] as f64 * grid.a);
        Aabb {
            lo: corner(0),
            hi: corner(1),
        }
    }

    /// Returns the whole lattice.
    pub(super) fn grid(&self) -> CellGrid {
        CellGrid::over(self.region, CELL_EDGE * self.size)
    }

    /// Returns the points near a room where features are close together.
    pub(super) fn crowd(&self, room: Aabb) -> Crowd {
        let room = room.widened(2.0 * self.size);
        let near = self.crowded.iter().filter(|p| holds(&room, p.0));
        Crowd::of_places(&near.copied().collect::<Vec<_>>(), self.size)
    }

    fn indices(&self, k: usize) -> [usize; 3] {
        let [nx, ny, _] = self.counts;
        [k % nx, k / nx % ny, k / (nx * ny)]
    }

    /// Returns the cells that contain the sides between blocks along an axis.
    fn sides(&self, round: usize, axis: usize) -> Vec<usize> {
        let (n, count) = (self.grid().n[axis], self.counts[axis]);
        let first = |k: usize| k * n / count;
        let shifted = |k: usize| {
            let width = (first(k + 1) - first(k)) as f64;
            first(k) + (ROUND_SHIFTS[round] * width).round() as usize
        };
        (1..count).map(shifted).collect()
    }

    fn coordinate(&self, axis: usize, cell: usize) -> f64 {
        let grid = self.grid();
        // Position of sides in their cells. Centroids of lattice tetrahedra lie at quarters of a
        // cell: sides midway between two of these leave no tie to rounding.
        grid.origin[axis] + (cell as f64 + 0.375) * grid.a
    }
}

fn check_kind(options: &Options) -> Result<(), MeshError> {
    let wrong = |name, wanted, value| {
        Err(MeshError::Option {
            name,
            wanted,
            value,
        })
    };
    if options.order != 1 {
        return wrong("order", "1 for blocks", f64::from(options.order));
    }
    if options.surface_only {
        return wrong("surface-only", "off for blocks", 1.0);
    }
    Ok(())
}

/// Checks that there is at least one block per axis, and a cell for each.
fn check_counts(asked: [usize; 3], region: Aabb, grid: CellGrid) -> Result<(), MeshError> {
    let most = region.size().map(|s| ((s / grid.a) as usize).max(1));
    if (0..3).all(|i| (1..=most[i]).contains(&asked[i])) {
        Ok(())
    } else {
        Err(MeshError::Blocks { asked, most })
    }
}

/// Returns the corners at which the mesh must have nodes.
fn corners(found: &Features) -> Vec<Point3> {
    let corners = found.corners.iter().filter(|c| c.needs_node());
    corners.map(|c| c.point).collect()
}

fn curves(found: Features) -> Vec<PlannedCurve> {
    let planned = found.curves.into_iter().map(|c| PlannedCurve {
        pieces: c.pieces,
        points: c.points,
    });
    planned.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(counts: [usize; 3]) -> Plan {
        Plan {
            region: Aabb {
                lo: [0.0; 3],
                hi: [60.0, 40.0, 30.0],
            },
            region_certified: true,
            counts,
            size: 1.0,
            curves: Vec::new(),
            corners: Vec::new(),
            apexes: Vec::new(),
            features_certified: true,
            crowded: Vec::new(),
        }
    }

    #[test]
    fn every_point_is_in_one_room_of_each_round() {
        let plan = plan([4, 3, 1]);
        for round in 0..BLOCK_ROUNDS {
            for k in 0..400 {
                let p = [0.37, 0.71, 0.13].map(|s| 61.0 * (s * f64::from(k)).fract() - 0.5);
                let rooms = (0..plan.blocks()).filter(|&b| holds(&plan.room(round, b), p));
                assert_eq!(rooms.count(), 1, "{p:?}");
            }
        }
    }

    #[test]
    fn no_place_is_near_sides_in_all_rounds() {
        let plan = plan([1, 1, 1]);
        assert!(!plan.unsettled(1)([30.0, 20.0, 15.0]));
        let plan = Plan {
            size: 0.1,
            ..self::plan([4, 3, 2])
        };
        let unsettled: Vec<_> = (0..=BLOCK_ROUNDS).map(|r| plan.unsettled(r)).collect();
        let mut most = 0;
        for k in 0..20_000 {
            let p = [0.618_033_988_7, 0.754_877_666_2, 0.569_840_291]
                .map(|s| 60.0 * (s * f64::from(k)).fract());
            most = most.max(
                (0..=BLOCK_ROUNDS)
                    .rev()
                    .find(|&r| unsettled[r](p))
                    .unwrap_or(0),
            );
        }
        assert_eq!(most, BLOCK_ROUNDS - 1);
    }

    #[test]
    fn counts_are_checked() {
        let plan = plan([1, 1, 1]);
        let check = |counts| check_counts(counts, plan.region, plan.grid());
        assert_eq!(check([4, 4, 4]), Ok(()));
        for wrong in [[0, 1, 1], [1, 1, 99]] {
            assert!(matches!(
                check(wrong),
                Err(MeshError::Blocks {
                    most: [53, 35, 26],
                    ..
                })
            ));
        }
    }
}
