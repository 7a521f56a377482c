//! What all blocks share: where they meet, and what is known of the whole model.

use super::{holds, within};
use crate::crowd::Crowd;
use crate::error::MeshError;
use crate::features::{Corner, Features, extent_within};
use crate::lattice::{CELL, Cells, Grid};
use crate::mesher::features_of;
use crate::options::Options;
use isoform_control::Control;
use isoform_geom::{Aabb, Point3, Solid};

/// Rounds of work on a block: it is made, then what is near its sides is optimised once more in
/// blocks whose sides lie elsewhere. A place is near sides in three directions at most, so that of
/// four rounds one has none near it.
pub const ROUNDS: usize = 4;
/// By how much the sides are moved in each round, as shares of a block.
const SHIFTS: [f64; ROUNDS] = [0.0, 0.5, 0.25, 0.75];
/// How far from sides tetrahedra are optimised once more, in cells. Less leaves poor tetrahedra
/// where those of both blocks would have to change; more is work twice.
const NEAR: f64 = 6.0;
/// Where sides lie within their cells. Centroids of tetrahedra of the lattice lie at quarters of a
/// cell: sides in the middle between two of these leave no tie to rounding.
const WITHIN: f64 = 0.375;

/// A feature curve of the model.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedCurve {
    /// The pieces, ascending.
    pub pieces: [u32; 2],
    /// Points in order.
    pub points: Vec<Point3>,
}

/// What all blocks share. A plan is found once, in time and memory that grow with the model's
/// edges and not with its volume.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The box that is meshed.
    pub region: Aabb,
    /// Whether intervals prove that nothing of the solid lies outside of it.
    pub region_certified: bool,
    /// Blocks by axis.
    pub counts: [usize; 3],
    /// Edge length asked for.
    pub size: f64,
    /// Feature curves.
    pub curves: Vec<PlannedCurve>,
    /// Corners that the mesh must have nodes at.
    pub corners: Vec<Point3>,
    /// Those of them that are tips of cones, on no curve.
    pub apexes: Vec<Corner>,
    /// Whether all features were found, proved by intervals.
    pub features_certified: bool,
    /// Places where features crowd, with the edge length wanted there.
    pub crowded: Vec<(Point3, f64)>,
}

impl Plan {
    /// Finds the model's box and features.
    ///
    /// # Errors
    /// As of [`mesh`](crate::mesh); [`MeshError::Blocks`] if there are no blocks, or more than
    /// cells; and if options ask for what blocks do not have: second order, the surface alone.
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
            let grid = Grid::over(extent.bounds, CELL * options.size);
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

    /// The number of blocks.
    pub fn blocks(&self) -> usize {
        self.counts.iter().product()
    }

    /// The room of block `k`, x fastest, in a round: its lower sides belong to it. Outermost sides
    /// are infinitely far away.
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

    /// Tells of points whether they are so near to sides of each of the first `rounds` rounds that
    /// tetrahedra there are to be optimised once more.
    pub(super) fn unsettled(&self, rounds: usize) -> impl Fn(Point3) -> bool + use<> {
        let near = NEAR * self.grid().a;
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

    /// The cells that the tetrahedra of a room are made of, and `more` beyond in each direction.
    pub(super) fn cells(&self, room: Aabb, more: usize) -> Cells {
        let grid = self.grid();
        std::array::from_fn(|i| {
            let cell = |x: f64| ((x - grid.origin[i]) / grid.a).floor();
            // Numbers of floats beyond those of a usize are its ends.
            let lo = cell(room.lo[i]) as usize;
            let hi = cell(room.hi[i]) as usize;
            [
                lo.saturating_sub(more).min(grid.n[i] - 1),
                hi.saturating_add(more + 1).min(grid.n[i]),
            ]
        })
    }

    /// The box of some cells.
    pub(super) fn box_of(&self, cells: Cells) -> Aabb {
        let grid = self.grid();
        let corner =
            |k: usize| std::array::from_fn(|i| grid.origin[i] + cells[i][k] as f64 * grid.a);
        Aabb {
            lo: corner(0),
            hi: corner(1),
        }
    }

    /// The whole lattice.
    pub(super) fn grid(&self) -> Grid {
        Grid::over(self.region, CELL * self.size)
    }

    /// The places near a room where features crowd.
    pub(super) fn crowd(&self, room: Aabb) -> Crowd {
        let room = room.widened(2.0 * self.size);
        let near = self.crowded.iter().filter(|p| holds(&room, p.0));
        Crowd::of_places(&near.copied().collect::<Vec<_>>(), self.size)
    }

    fn indices(&self, k: usize) -> [usize; 3] {
        let [nx, ny, _] = self.counts;
        [k % nx, k / nx % ny, k / (nx * ny)]
    }

    /// The cells in which the sides between blocks lie, along an axis.
    fn sides(&self, round: usize, axis: usize) -> Vec<usize> {
        let (n, count) = (self.grid().n[axis], self.counts[axis]);
        let first = |k: usize| k * n / count;
        let shifted = |k: usize| {
            let width = (first(k + 1) - first(k)) as f64;
            first(k) + (SHIFTS[round] * width).round() as usize
        };
        (1..count).map(shifted).collect()
    }

    fn coordinate(&self, axis: usize, cell: usize) -> f64 {
        let grid = self.grid();
        grid.origin[axis] + (cell as f64 + WITHIN) * grid.a
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

/// Whether there are blocks, and cells for each.
fn check_counts(asked: [usize; 3], region: Aabb, grid: Grid) -> Result<(), MeshError> {
    let most = region.size().map(|s| ((s / grid.a) as usize).max(1));
    if (0..3).all(|i| (1..=most[i]).contains(&asked[i])) {
        Ok(())
    } else {
        Err(MeshError::Blocks { asked, most })
    }
}

/// Corners that the mesh must have nodes at.
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
        for round in 0..ROUNDS {
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
        let unsettled: Vec<_> = (0..=ROUNDS).map(|r| plan.unsettled(r)).collect();
        let mut most = 0;
        for k in 0..20_000 {
            let p = [0.618_033_988_7, 0.754_877_666_2, 0.569_840_291]
                .map(|s| 60.0 * (s * f64::from(k)).fract());
            most = most.max((0..=ROUNDS).rev().find(|&r| unsettled[r](p)).unwrap_or(0));
        }
        assert_eq!(most, ROUNDS - 1);
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
