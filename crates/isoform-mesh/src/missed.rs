//! Surface of the solid that a mesh of it passes by: features smaller than its triangles.
//!
//! Cells of the region are halved as long as intervals leave their sign open, until each piece that
//! may bound the solid in a cell is known there: the mesh has triangles of it in the cell or just
//! beside, and intervals of its gradient show one sheet that turns no farther than those triangles.
//! What is not known in the smallest cells is looked for by Newton's method. A point of the solid's
//! surface that is found so is a *witness*: it may lie on the mesh all the same, which whoever
//! knows what the mesh stands for has to decide.

use crate::decide::{Local, Narrowed, Scratch};
use crate::error::{Warning, WarningKind};
use crate::features::newton::{along, normalised, onto_one_within};
use crate::features::octree;
use crate::points::unit;
use isoform_control::Control;
use isoform_geom::{Aabb, Mesh, Point3, Solid, across, cross, dot, norm, sub};
use isoform_num::{Interval, Real};
use rayon::prelude::*;
use std::collections::HashMap;

/// How far from a cell triangles count as in it, in sizes of the mesh: chords miss a surface by an
/// eighth of the size where its radius is the size. Features lower than this are no fault of a
/// mesh.
const NEAR: f64 = 0.35;
/// How far cells are widened when slopes are bounded, in their own sizes: a sheet that bends back
/// just outside of a cell counts as bent.
const WIDER: f64 = 0.25;
/// Cells in which several pieces may bound the solid are no larger than this many sizes.
const SEVERAL: f64 = 2.0;
/// How far normals may be from those of the triangles (25 degrees), and from one direction in all
/// (80 degrees; less than 90, so that there is one sheet).
const TURN: [f64; 2] = [0.4363, 1.3963];
/// How far normals may turn where there is no triangle to compare with, 60 degrees.
const ALONE: f64 = std::f64::consts::FRAC_PI_3;
/// Levels of cells below the size of the mesh: bumps of a hundredth of the size are met. More cost
/// time along every edge of a blend, less pass by what turns only there.
const LEVELS: i32 = 8;
/// Cells that are looked at: so many, and so many for each triangle, a tenth of the mesher's time.
/// With less, blends use it all up before small features are reached.
const BUDGET: [usize; 2] = [20_000, 4];
/// Cells of a level for each of the one before, of which most hold no surface.
const GROWTH: usize = 4;
/// How far from the middle of a cell a surface is sought, in diagonals.
const REACH: f64 = 1.5;
/// How far witnesses may be from their surface, in sizes of the mesh: a hundredth of what solids
/// are held to; functions of thin bores cancel all further digits.
const OFF: f64 = 1e-10;
/// Points on both sides of a witness have different signs at this part of the cell's size from it.
const BESIDE: f64 = 1e-3;
/// Points that are asked for their signs at once.
const TASK: usize = 256;
/// Witnesses that are kept: a solid is compared with each, in milliseconds.
const MOST: usize = 20_000;

/// A point of the solid's surface in a cell in which the mesh proves nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Witness {
    /// The point.
    pub at: Point3,
    /// The piece that it lies on.
    pub piece: u32,
    /// Whether the mesh has triangles near it, within a third of the size.
    pub near: bool,
}

/// What a mesh may pass by.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Missed {
    /// Points of the surface where the mesh may have none.
    pub witnesses: Vec<Witness>,
    /// Cells in which nothing was found and nothing is proved.
    pub open: usize,
    /// Cells looked at.
    pub cells: usize,
}

impl Missed {
    /// Adds what is missed of another part of the mesh.
    pub(crate) fn add(&mut self, other: Self) {
        self.witnesses.extend(other.witnesses);
        self.open += other.open;
        self.cells += other.cells;
    }

    /// A warning if the mesh has nothing where the solid has surface.
    pub(crate) fn warning(&self) -> Option<Warning> {
        let first = self.places().next();
        first.map(|at| Warning::at(WarningKind::Missed, at))
    }

    /// Places where the mesh has nothing though the solid has surface.
    pub(crate) fn places(&self) -> impl Iterator<Item = Point3> {
        let far = self.witnesses.iter().filter(|w| !w.near);
        far.map(|w| w.at)
    }
}

/// A cell, what matters in it and the room about it, and the triangles in it or near.
struct Cell {
    cell: Aabb,
    around: Local,
    triangles: Vec<u32>,
}

/// A witness by the tree, with points on both sides of its surface.
#[derive(Clone, Copy)]
struct Found {
    witness: Witness,
    /// The first is inside.
    beside: [Point3; 2],
}

/// What became of a cell.
#[derive(Default)]
struct Fate {
    parts: Vec<Cell>,
    witnesses: Vec<Found>,
    open: usize,
}

impl Fate {
    fn found(witnesses: Vec<Found>) -> Self {
        Self {
            witnesses,
            ..Self::default()
        }
    }
}

/// Whether a piece is known in a cell.
enum Known {
    /// The mesh has its only sheet.
    ByMesh,
    /// It has a sheet that the mesh has not by this name, with a point of the surface.
    By(Found),
    No,
}

impl Known {
    fn witness(self) -> Option<Found> {
        match self {
            Self::By(witness) => Some(witness),
            Self::ByMesh | Self::No => None,
        }
    }
}

/// The mesh, ready to be asked.
struct Search<'a> {
    solid: &'a dyn Solid,
    mesh: &'a Mesh,
    size: f64,
    /// The piece of each part of the mesh.
    pieces: Vec<Option<u32>>,
    boxes: Vec<Aabb>,
    normals: Vec<Point3>,
    /// The smallest cells.
    smallest: f64,
}

/// Looks for surface of the solid in the region that the mesh passes by.
pub(crate) fn missed(
    solid: &dyn Solid,
    mesh: &Mesh,
    region: Aabb,
    size: f64,
    control: &Control<'_>,
) -> Missed {
    let search = Search::new(solid, mesh, size);
    if !search.has_bounds() {
        return Missed {
            open: 1,
            ..Missed::default()
        };
    }
    let budget = BUDGET[0] + BUDGET[1] * mesh.triangles.len();
    let (mut out, mut found) = (Missed::default(), Vec::new());
    let mut level = vec![Cell {
        cell: region,
        around: Local::everywhere(solid),
        triangles: (0..mesh.triangles.len() as u32).collect(),
    }];
    while !level.is_empty() && !control.is_stopped() {
        out.cells += level.len();
        let is_last = out.cells + GROWTH * level.len() > budget;
        let fates: Vec<Fate> = level
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
    // Those far from the mesh first: they are missing whatever the mesh stands for.
    found.sort_by_key(|w| w.witness.near);
    found.truncate(MOST);
    let kept = confirmed(solid, &found);
    out.open += found.len() - kept.len();
    out.witnesses = kept;
    out
}

/// The witnesses on both sides of which the solid's own function has different signs, too.
///
/// The own function of a model of many thousand bodies takes milliseconds: it is asked once, for
/// all points.
fn confirmed(solid: &dyn Solid, found: &[Found]) -> Vec<Witness> {
    let beside: Vec<Point3> = found.iter().flat_map(|f| f.beside).collect();
    let mut signs = vec![0.0; beside.len()];
    let tasks = beside.par_chunks(TASK).zip(signs.par_chunks_mut(TASK));
    tasks.for_each(|(points, out)| solid.sign_values(points, out));
    let pairs = found.iter().zip(signs.chunks(2));
    let sound = pairs.filter(|(_, s)| s[0] >= 0.0 && s[1] < 0.0);
    sound.map(|(f, _)| f.witness).collect()
}

impl<'a> Search<'a> {
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
                .map(|t| Aabb::of(&corners(t)))
                .collect(),
            normals: mesh
                .triangles
                .par_iter()
                .map(|t| inward(corners(t)))
                .collect(),
            smallest: size * 0.5f64.powi(LEVELS),
        }
    }

    /// Whether intervals say anything of the solid, as they do not of programs that are run: looked
    /// at about a triangle, since ranges over all may be infinite.
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

    /// What becomes of a cell; if it is one of the last, it is not halved.
    fn fate(&self, from: &Cell, is_last: bool, scratch: &mut Scratch) -> Fate {
        let cell = from.cell;
        let Narrowed::Mixed(around) = from.around.narrow(self.solid, room(&cell), scratch) else {
            return Fate::default();
        };
        let Narrowed::Mixed(local) = around.narrow(self.solid, octree::slack(cell), scratch) else {
            return Fate::default();
        };
        let side = octree::longest(&cell);
        let near = self.near(&cell, &from.triangles, WIDER * side + NEAR * self.size);
        let is_small = side <= SEVERAL * self.size || local.pieces.len() == 1;
        if is_small && near.is_empty() {
            // No need to look closer: the mesh has nothing here.
            let mut pieces = local.pieces.iter();
            if let Some(witness) =
                pieces.find_map(|k| self.witness(*k, &cell, &around, &near, scratch))
            {
                return Fate::found(vec![witness]);
            }
        }
        let is_halved = !is_last && side > self.smallest;
        // Of a large cell with several pieces, what is known counts only if it is not halved.
        let known: Vec<Known> = if is_small || !is_halved {
            let pieces = local.pieces.iter();
            pieces
                .map(|k| self.known(*k, &cell, &around, &near, scratch))
                .collect()
        } else {
            Vec::new()
        };
        if is_small && known.iter().all(|k| !matches!(k, Known::No)) {
            return Fate::found(known.into_iter().filter_map(Known::witness).collect());
        }
        if is_halved {
            let parts = octree::split(cell).map(|cell| Cell {
                cell,
                around: around.clone(),
                triangles: near.clone(),
            });
            return Fate {
                parts: parts.collect(),
                ..Fate::default()
            };
        }
        let unknown = local
            .pieces
            .iter()
            .zip(&known)
            .filter(|(_, k)| matches!(k, Known::No));
        let found: Vec<Found> = unknown
            .filter_map(|(k, _)| self.witness(*k, &cell, &around, &near, scratch))
            .collect();
        Fate {
            open: usize::from(found.is_empty()),
            ..Fate::found(found)
        }
    }

    /// Triangles in a cell or near it.
    fn near(&self, cell: &Aabb, triangles: &[u32], reach: f64) -> Vec<u32> {
        let is_near = |t: &&u32| {
            let own = &self.boxes[**t as usize];
            (0..3).all(|i| own.lo[i] <= cell.hi[i] + reach && own.hi[i] >= cell.lo[i] - reach)
        };
        triangles.iter().filter(is_near).copied().collect()
    }

    /// Whether a piece is one sheet in a cell, and the mesh has triangles of it there; or else has
    /// a point of the solid's surface there, which may lie on a face of another name.
    fn known(
        &self,
        piece: u32,
        cell: &Aabb,
        around: &Local,
        near: &[u32],
        scratch: &mut Scratch,
    ) -> Known {
        let own = near.iter().filter(|t| self.piece_of(**t) == Some(piece));
        let normals: Vec<Point3> = own.map(|t| self.normals[*t as usize]).collect();
        if let Some((axis, spread)) = cone(&normals) {
            let is_known = self.is_one_sheet(piece, cell, axis, (TURN[0] + spread).min(TURN[1]));
            return if is_known { Known::ByMesh } else { Known::No };
        }
        if near.is_empty() {
            return Known::No;
        }
        let witness = self.witness(piece, cell, around, near, scratch);
        let axis = witness.and_then(|w| normalised(self.solid, piece, w.witness.at));
        match (witness, axis) {
            (Some(witness), Some(axis)) if self.is_one_sheet(piece, cell, axis.n, ALONE) => {
                Known::By(witness)
            }
            _ => Known::No,
        }
    }

    fn piece_of(&self, triangle: u32) -> Option<u32> {
        let part = *self.mesh.triangle_parts.get(triangle as usize)?;
        *self.pieces.get(part as usize)?
    }

    /// Whether the gradient of a piece is within an angle of an axis all over a cell. Where nothing
    /// is known of gradients, nothing speaks against it.
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
        let [u, v] = across(axis).map(|a| component(a).magnitude());
        ahead > 0.0 && u.hypot(v) <= angle.tan() * ahead
    }

    /// A point near a cell at which a piece bounds the solid.
    fn witness(
        &self,
        piece: u32,
        cell: &Aabb,
        around: &Local,
        near: &[u32],
        scratch: &mut Scratch,
    ) -> Option<Found> {
        let side = octree::longest(cell);
        let reach = REACH * cell.diagonal();
        let at = onto_one_within(self.solid, piece, cell.center(), reach, OFF * self.size)?;
        if !octree::holds(&wider(cell), at) {
            return None;
        }
        let n = normalised(self.solid, piece, at)?.n;
        let beside = [BESIDE, -BESIDE].map(|by| along(at, n, by * side));
        let [inside, outside] = beside.map(|p| around.value(self.solid, p, scratch));
        let place = Aabb { lo: at, hi: at };
        (inside >= 0.0 && outside < 0.0).then(|| Found {
            witness: Witness {
                at,
                piece,
                near: !self.near(&place, near, NEAR * self.size).is_empty(),
            },
            beside,
        })
    }
}

/// A cell with some room around it.
fn wider(cell: &Aabb) -> Aabb {
    cell.widened(WIDER * octree::longest(cell))
}

/// What witnesses of a cell and the points beside them lie in; holds the rooms of its parts.
fn room(cell: &Aabb) -> Aabb {
    cell.widened((WIDER + 2.0 * BESIDE) * octree::longest(cell))
}

/// The unit normal of a triangle into the solid.
fn inward([a, b, c]: [Point3; 3]) -> Point3 {
    unit(cross(sub(c, a), sub(b, a)))
}

/// The mean direction of normals and the largest angle between it and one of them.
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
