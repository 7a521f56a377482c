//! Detection of surface of the solid that a mesh has missed: features smaller than its triangles.
//!
//! Cells of the region are halved as long as intervals leave their sign open, until each piece that
//! may bound the solid in a cell is known there: the mesh has triangles of it in the cell or just
//! next to it, and intervals of its gradient show one sheet that turns no farther than those
//! triangles. In the smallest cells unknown pieces are searched by Newton's method. A point of the
//! solid's surface found so is a *witness*: it may still lie on the mesh, which only the caller,
//! who knows what the mesh represents, can decide.

use crate::decide::{Local, NarrowedTree, Scratch};
use crate::error::{Warning, WarningKind};
use crate::features::newton::{add_scaled, normalised, onto_one_within};
use crate::features::octree;
use crate::points::unit;
use isoform_control::Control;
use isoform_geom::{Aabb, Mesh, Point3, Solid, cross, dot, norm, orthonormal_complement, sub};
use isoform_num::{Interval, Real};
use rayon::prelude::*;
use std::collections::HashMap;

/// Distance from a cell within which triangles count as in it, in sizes of the mesh: chords miss a
/// surface by an eighth of the size where its radius is the size. Features lower than this are not
/// defects of a mesh.
const NEAR_TRIANGLE_SIZES: f64 = 0.35;
/// Margin by which cells are widened when slopes are bounded, in their own sizes: a sheet that
/// bends back just outside of a cell counts as bent.
const SLOPE_MARGIN_CELLS: f64 = 0.25;
/// Maximum angle of normals to those of the triangles (25 degrees), and to one direction in total
/// (80 degrees; less than 90, so that there is one sheet).
const MAX_SHEET_TURNS: [f64; 2] = [0.4363, 1.3963];
/// Number of levels of cells below the size of the mesh: bumps of a hundredth of the size are
/// found. More levels cost time along every edge of a blend, fewer miss surfaces that turn only
/// there.
const MAX_CELL_LEVELS: i32 = 8;
/// Maximum number of cells examined: a constant, and a number per triangle, for a tenth of the
/// mesher's time. With less, blends exhaust it before small features are reached.
const CELL_BUDGET: [usize; 2] = [20_000, 4];
/// Distance from a witness at which points on both sides must have different signs, in sizes of the
/// cell.
const SIGN_PROBE_CELLS: f64 = 1e-3;
/// Maximum number of witnesses kept: a solid is compared with each, in milliseconds.
const MAX_WITNESSES: usize = 20_000;

/// A point of the solid's surface in a cell in which the mesh proves nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Witness {
    /// Position.
    pub at: Point3,
    /// Index of the piece on which it lies.
    pub piece: u32,
    /// True if the mesh has triangles within a third of the size of it.
    pub near: bool,
}

/// Parts of the solid's surface that a mesh may have missed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UnmeshedSurface {
    /// Points of the surface where the mesh may have none.
    pub witnesses: Vec<Witness>,
    /// Number of cells in which nothing was found and nothing is proved.
    pub open: usize,
    /// Number of cells examined.
    pub cells: usize,
}

impl UnmeshedSurface {
    /// Adds the result of another part of the mesh.
    pub(crate) fn add(&mut self, other: Self) {
        self.witnesses.extend(other.witnesses);
        self.open += other.open;
        self.cells += other.cells;
    }

    /// Returns a warning if the solid has surface far from the mesh.
    pub(crate) fn warning(&self) -> Option<Warning> {
        let first = self.places().next();
        first.map(|at| Warning::at(WarningKind::Missed, at))
    }

    /// Returns points of the solid's surface with no triangle of the mesh near.
    pub(crate) fn places(&self) -> impl Iterator<Item = Point3> {
        let far = self.witnesses.iter().filter(|w| !w.near);
        far.map(|w| w.at)
    }
}

/// A cell, the part of the solid that matters in it and its margin, and the triangles in it or
/// near.
struct SearchCell {
    cell: Aabb,
    around: Local,
    triangles: Vec<u32>,
}

/// A witness found by the reduced tree, with points on both sides of its surface.
#[derive(Clone, Copy)]
struct SignedWitness {
    witness: Witness,
    /// Points on both sides; the first is inside.
    beside: [Point3; 2],
}

/// Outcome of the examination of a cell.
#[derive(Default)]
struct CellOutcome {
    parts: Vec<SearchCell>,
    witnesses: Vec<SignedWitness>,
    open: usize,
}

impl CellOutcome {
    fn found(witnesses: Vec<SignedWitness>) -> Self {
        Self {
            witnesses,
            ..Self::default()
        }
    }
}

/// Knowledge of a piece in a cell.
enum PieceCoverage {
    /// The mesh has the only sheet of the piece.
    ByMesh,
    /// The piece has one sheet, but the mesh has none by this name; holds a point of the surface.
    By(SignedWitness),
    No,
}

impl PieceCoverage {
    fn witness(self) -> Option<SignedWitness> {
        match self {
            Self::By(witness) => Some(witness),
            Self::ByMesh | Self::No => None,
        }
    }
}

/// The mesh, prepared for the search.
struct MissedSearch<'a> {
    solid: &'a dyn Solid,
    mesh: &'a Mesh,
    size: f64,
    /// Piece of each part of the mesh; `None` if the part is not a piece.
    pieces: Vec<Option<u32>>,
    boxes: Vec<Aabb>,
    normals: Vec<Point3>,
    /// Size of the smallest cells.
    smallest: f64,
}

/// Searches the region for surface of the solid that the mesh has missed.
pub(crate) fn find_unmeshed(
    solid: &dyn Solid,
    mesh: &Mesh,
    region: Aabb,
    size: f64,
    control: &Control<'_>,
) -> UnmeshedSurface {
    let search = MissedSearch::new(solid, mesh, size);
    if !search.has_bounds() {
        return UnmeshedSurface {
            open: 1,
            ..UnmeshedSurface::default()
        };
    }
    let budget = CELL_BUDGET[0] + CELL_BUDGET[1] * mesh.triangles.len();
    let (mut out, mut found) = (UnmeshedSurface::default(), Vec::new());
    let mut level = vec![SearchCell {
        cell: region,
        around: Local::everywhere(solid),
        triangles: (0..mesh.triangles.len() as u32).collect(),
    }];
    while !level.is_empty() && !control.is_stopped() {
        out.cells += level.len();
        // Each level has up to four times the cells of the last, as most hold no surface.
        let is_last = out.cells + 4 * level.len() > budget;
        let fates: Vec<CellOutcome> = level
            .par_iter()
            .map_init(
                || Scratch::new(solid),
                |scratch, cell| search.fate(cell, is_last, scratch),
            )
            .collect();
        level.clear();
        for fate in fates {
            level.extend(fate.parts);
            found.extend(fate.witnesses);
            out.open += fate.open;
        }
    }
    // Those far from the mesh first: they are missed whatever the mesh represents.
    found.sort_by_key(|w| w.witness.near);
    found.truncate(MAX_WITNESSES);
    let kept = confirmed(solid, &found);
    out.open += found.len() - kept.len();
    out.witnesses = kept;
    out
}

/// Keeps the witnesses on both sides of which the solid's own function has different signs, too.
///
/// The own function of a model of many thousand bodies takes milliseconds: it is called once, for
/// all points.
fn confirmed(solid: &dyn Solid, found: &[SignedWitness]) -> Vec<Witness> {
    let beside: Vec<Point3> = found.iter().flat_map(|f| f.beside).collect();
    let mut signs = vec![0.0; beside.len()];
    let tasks = beside.par_chunks(256).zip(signs.par_chunks_mut(256));
    tasks.for_each(|(points, out)| solid.sign_values(points, out));
    let pairs = found.iter().zip(signs.chunks(2));
    let sound = pairs.filter(|(_, s)| s[0] >= 0.0 && s[1] < 0.0);
    sound.map(|(f, _)| f.witness).collect()
}

impl<'a> MissedSearch<'a> {
    fn new(solid: &'a dyn Solid, mesh: &'a Mesh, size: f64) -> Self {
        let names = solid.names().iter().enumerate();
        let piece_of: HashMap<&str, u32> = names.map(|(k, n)| (n.as_str(), k as u32)).collect();
        let corners = |t: &[u32; 3]| t.map(|i| mesh.points[i as usize]);
        Self {
            solid,
            mesh,
            size,
            pieces: mesh
                .parts
                .iter()
                .map(|n| piece_of.get(n.as_str()).copied())
                .collect(),
            boxes: mesh
                .triangles
                .par_iter()
                .map(|t| Aabb::from_points(&corners(t)))
                .collect(),
            normals: mesh
                .triangles
                .par_iter()
                .map(|t| inward(corners(t)))
                .collect(),
            smallest: size * 0.5f64.powi(MAX_CELL_LEVELS),
        }
    }

    /// Returns true if the solid has finite bounds, unlike programs that are executed. Tested near
    /// one triangle, since ranges over the whole region may be infinite.
    fn has_bounds(&self) -> bool {
        let all: Vec<u32> = (0..self.solid.names().len() as u32).collect();
        let mut ranges = vec![Interval::ALL; all.len()];
        let Some(cell) = self.boxes.first() else {
            return true;
        };
        self.solid.bounds(&all, *cell, &mut ranges);
        ranges
            .iter()
            .any(|r| r.lo().is_finite() || r.hi().is_finite())
    }

    /// Examines a cell; if it is one of the last, it is not halved.
    fn fate(&self, from: &SearchCell, is_last: bool, scratch: &mut Scratch) -> CellOutcome {
        let cell = from.cell;
        let NarrowedTree::Mixed(around) = from.around.narrow(self.solid, room(&cell), scratch)
        else {
            return CellOutcome::default();
        };
        let NarrowedTree::Mixed(local) = around.narrow(self.solid, octree::slack(cell), scratch)
        else {
            return CellOutcome::default();
        };
        let side = octree::longest(&cell);
        let near = self.near(
            &cell,
            &from.triangles,
            SLOPE_MARGIN_CELLS * side + NEAR_TRIANGLE_SIZES * self.size,
        );
        // Larger cells with several pieces are always halved.
        let is_small = side <= 2.0 * self.size || local.pieces.len() == 1;
        if is_small && near.is_empty() {
            // The mesh has nothing here: one witness suffices.
            let mut pieces = local.pieces.iter();
            if let Some(witness) =
                pieces.find_map(|k| self.witness(*k, &cell, &around, &near, scratch))
            {
                return CellOutcome::found(vec![witness]);
            }
        }
        let is_halved = !is_last && side > self.smallest;
        // In a large cell with several pieces, knowledge counts only if the cell is not halved.
        let known: Vec<PieceCoverage> = if is_small || !is_halved {
            let pieces = local.pieces.iter();
            pieces
                .map(|k| self.known(*k, &cell, &around, &near, scratch))
                .collect()
        } else {
            Vec::new()
        };
        if is_small && known.iter().all(|k| !matches!(k, PieceCoverage::No)) {
            return CellOutcome::found(
                known
                    .into_iter()
                    .filter_map(PieceCoverage::witness)
                    .collect(),
            );
        }
        if is_halved {
            let parts = octree::split(cell).map(|cell| SearchCell {
                cell,
                around: around.clone(),
                triangles: near.clone(),
            });
            return CellOutcome {
                parts: parts.collect(),
                ..CellOutcome::default()
            };
        }
        let unknown = local
            .pieces
            .iter()
            .zip(&known)
            .filter(|(_, k)| matches!(k, PieceCoverage::No));
        let found: Vec<SignedWitness> = unknown
            .filter_map(|(k, _)| self.witness(*k, &cell, &around, &near, scratch))
            .collect();
        CellOutcome {
            open: usize::from(found.is_empty()),
            ..CellOutcome::found(found)
        }
    }

    /// Returns the triangles in a cell or near it.
    fn near(&self, cell: &Aabb, triangles: &[u32], reach: f64) -> Vec<u32> {
        let is_near = |t: &&u32| {
            let own = &self.boxes[**t as usize];
            (0..3).all(|i| own.lo[i] <= cell.hi[i] + reach && own.hi[i] >= cell.lo[i] - reach)
        };
        triangles.iter().filter(is_near).copied().collect()
    }

    /// Examines a piece in a cell: it is known if it is one sheet and the mesh has triangles of it
    /// there, or if a point of the solid's surface is found on it, which may lie on a face of
    /// another name.
    fn known(
        &self,
        piece: u32,
        cell: &Aabb,
        around: &Local,
        near: &[u32],
        scratch: &mut Scratch,
    ) -> PieceCoverage {
        let own = near.iter().filter(|t| self.piece_of(**t) == Some(piece));
        let normals: Vec<Point3> = own.map(|t| self.normals[*t as usize]).collect();
        if let Some((axis, spread)) = cone(&normals) {
            let is_known = self.is_one_sheet(
                piece,
                cell,
                axis,
                (MAX_SHEET_TURNS[0] + spread).min(MAX_SHEET_TURNS[1]),
            );
            return if is_known {
                PieceCoverage::ByMesh
            } else {
                PieceCoverage::No
            };
        }
        if near.is_empty() {
            return PieceCoverage::No;
        }
        let witness = self.witness(piece, cell, around, near, scratch);
        let axis = witness.and_then(|w| normalised(self.solid, piece, w.witness.at));
        match (witness, axis) {
            // 60 degrees, without a triangle for comparison.
            (Some(witness), Some(axis))
                if self.is_one_sheet(piece, cell, axis.n, std::f64::consts::FRAC_PI_3) =>
            {
                PieceCoverage::By(witness)
            }
            _ => PieceCoverage::No,
        }
    }

    fn piece_of(&self, triangle: u32) -> Option<u32> {
        let part = *self.mesh.triangle_parts.get(triangle as usize)?;
        *self.pieces.get(part as usize)?
    }

    /// Returns true if the gradient of a piece is within an angle of an axis all over a cell, or if
    /// the solid has no bounds of gradients.
    fn is_one_sheet(&self, piece: u32, cell: &Aabb, axis: Point3, angle: f64) -> bool {
        let Some(slopes) = self.solid.slopes(piece, wider(cell)) else {
            return true;
        };
        let component = |a: Point3| {
            (0..3).fold(Interval::constant(0.0), |sum, i| {
                sum + slopes[i] * Interval::constant(a[i])
            })
        };
        let ahead = component(axis).lo();
        let [u, v] = orthonormal_complement(axis).map(|a| component(a).magnitude());
        ahead > 0.0 && u.hypot(v) <= angle.tan() * ahead
    }

    /// Returns a point near a cell at which a piece bounds the solid.
    fn witness(
        &self,
        piece: u32,
        cell: &Aabb,
        around: &Local,
        near: &[u32],
        scratch: &mut Scratch,
    ) -> Option<SignedWitness> {
        let side = octree::longest(cell);
        let reach = 1.5 * cell.diagonal();
        // A hundredth of the tolerance of solids; functions of thin bores cancel all further
        // digits.
        let at = onto_one_within(self.solid, piece, cell.center(), reach, 1e-10 * self.size)?;
        if !octree::holds(&wider(cell), at) {
            return None;
        }
        let n = normalised(self.solid, piece, at)?.n;
        let beside = [SIGN_PROBE_CELLS, -SIGN_PROBE_CELLS].map(|by| add_scaled(at, n, by * side));
        let [inside, outside] = beside.map(|p| around.value(self.solid, p, scratch));
        let place = Aabb { lo: at, hi: at };
        (inside >= 0.0 && outside < 0.0).then(|| SignedWitness {
            witness: Witness {
                at,
                piece,
                near: !self
                    .near(&place, near, NEAR_TRIANGLE_SIZES * self.size)
                    .is_empty(),
            },
            beside,
        })
    }
}

/// Widens a cell by the margin of slopes.
fn wider(cell: &Aabb) -> Aabb {
    cell.widened(SLOPE_MARGIN_CELLS * octree::longest(cell))
}

/// Widens a cell to the box of its witnesses and their probes; the box also holds those of its
/// parts.
fn room(cell: &Aabb) -> Aabb {
    cell.widened((SLOPE_MARGIN_CELLS + 2.0 * SIGN_PROBE_CELLS) * octree::longest(cell))
}

/// Returns the unit normal of a triangle into the solid.
fn inward([a, b, c]: [Point3; 3]) -> Point3 {
    unit(cross(sub(c, a), sub(b, a)))
}

/// Returns the mean direction of normals and the largest angle between it and one of them; `None`
/// if their sum vanishes.
fn cone(normals: &[Point3]) -> Option<(Point3, f64)> {
    let mut sum = [0.0; 3];
    for n in normals {
        sum = std::array::from_fn(|i| sum[i] + n[i]);
    }
    let length = norm(sum);
    (length > 0.0).then(|| {
        let axis = sum.map(|v| v / length);
        let angle = |n: &Point3| norm(cross(*n, axis)).atan2(dot(*n, axis));
        (axis, normals.iter().map(angle).fold(0.0, f64::max))
    })
}
