//! The body-centred cubic lattice over a solid, with the part of the tree that matters in each
//! cell.
//!
//! Boxes of cells are decided by intervals and halved: each cell is inside, outside, or has a
//! reduced tree of the pieces that can still decide the sign there. Only cells of the third kind
//! see the surface; the others are never evaluated (Labelle and Shewchuk, Isosurface stuffing,
//! 2007, use this lattice, too; the pruning is that of Duff, Interval arithmetic and recursive
//! subdivision, 1992).
//!
//! Lattice points are the corners and the centres of the cells. Around each face between two cells
//! four tetrahedra share the edge between the two centres; each also has one edge of the face.

use crate::decide::{Sign, reduced};
use crate::error::MeshError;
use crate::memory;
use crate::points::unique;
use crate::torus::Torus;
use isoform_control::Control;
use isoform_geom::{Aabb, Csg, Point3, Solid};
use isoform_num::Interval;
use rayon::prelude::*;
use std::collections::HashMap;

/// Edge of a lattice cell whose tetrahedra are as large as regular ones of edge 1: a³/12 = √2/12.
pub(crate) const CELL_EDGE: f64 = 1.122_462_048_309_373;

/// State of a cell that is surely inside.
pub(crate) const INSIDE_CELL: u32 = 0;
/// State of a cell that is surely outside.
pub(crate) const OUTSIDE_CELL: u32 = 1;
/// First state of an undecided cell: the index of the cell's reduced tree is added to it.
const FIRST_MIXED_STATE: u32 = 2;
/// Margin around a cell, in cells, for which it is decided: the result also holds for vertices that
/// are moved there.
const CELL_MARGIN: f64 = 0.75;
/// Number of cells per side of the blocks that are shared among threads.
const BLOCK_CELLS: usize = 16;
/// Distance from the lattice's origin to one cell before the region, in cells, in x, y and z. It is
/// uneven because models are full of round coordinates: with lattice planes on faces of the solid,
/// rounding would decide every tie.
const LATTICE_OFFSET_CELLS: [f64; 3] = [0.618, 0.414, 0.732];

/// Least number of bytes per cell: its state, and the indices of its corner and of its centre.
const MIN_CELL_BYTES: u64 = 12;

/// Part of a solid's tree that can decide the sign in a cell.
#[derive(Debug)]
pub(crate) struct ReducedTree {
    pub(crate) tree: Csg,
    /// Pieces of the tree, sorted, without duplicates.
    pub(crate) pieces: Vec<u32>,
}

/// A box of cells: by axis the first one and the one after the last.
pub(crate) type Cells = [[usize; 2]; 3];

/// All cells over a region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CellGrid {
    pub(crate) origin: Point3,
    /// Shortest edge of a cell.
    pub(crate) a: f64,
    /// Edges of a cell by axis.
    pub(crate) edges: [f64; 3],
    /// Cells by axis.
    pub(crate) n: [usize; 3],
    /// True for an axis along which the lattice is periodic.
    pub(crate) repeats: [bool; 3],
}

impl CellGrid {
    /// Creates the cells of edge `a` over a region.
    pub(crate) fn over(region: Aabb, a: f64) -> Self {
        let offset = LATTICE_OFFSET_CELLS.map(|o| (1.0 + o) * a);
        let origin: Point3 = std::array::from_fn(|i| region.lo[i] - offset[i]);
        let n = std::array::from_fn(|i| {
            // The lattice ends at least 1.6 cells behind the region.
            ((region.hi[i] + 1.6 * a - origin[i]) / a).ceil().max(3.0) as usize
        });
        Self {
            origin,
            a,
            edges: [a; 3],
            n,
            repeats: [false; 3],
        }
    }

    /// Creates the cells of a unit cell. Along periodic axes their edges are `a` or a little less,
    /// so that a whole number of cells fits; `a` is at most what `largest_size` allows.
    pub(crate) fn on_torus(torus: &Torus, a: f64) -> Self {
        let size = torus.region.size();
        let mut grid = Self::over(torus.region, a);
        grid.repeats = torus.axes;
        for i in (0..3).filter(|&i| torus.axes[i]) {
            // The slack is for rounding: a whole number of cells stays that number.
            grid.n[i] = (size[i] / a - 1e-6).ceil() as usize;
            grid.origin[i] = torus.region.lo[i];
            grid.edges[i] = size[i] / grid.n[i] as f64;
        }
        grid.a = grid.edges.into_iter().fold(a, f64::min);
        grid
    }

    pub(crate) fn all(&self) -> Cells {
        self.n.map(|n| [0, n])
    }
}

/// The cells of the lattice over a box, or a window of them.
#[derive(Debug)]
pub(crate) struct Lattice {
    /// Lower corner of the first cell of the whole lattice.
    pub(crate) origin: Point3,
    /// Shortest edge of a cell, the lattice's long edge.
    pub(crate) a: f64,
    /// Edges of a cell by axis.
    edges: [f64; 3],
    /// True for an axis along which the lattice is periodic.
    repeats: [bool; 3],
    /// Index of the first cell of the window, by axis.
    first: [usize; 3],
    /// Cells by axis.
    pub(crate) n: [usize; 3],
    /// True if the whole lattice continues before the first and after the last cell of the window,
    /// by axis.
    goes_on: [[bool; 2]; 3],
    /// [`INSIDE_CELL`], [`OUTSIDE_CELL`], or the index of a reduced tree plus `FIRST_MIXED_STATE`;
    /// x fastest.
    pub(crate) state: Vec<u32>,
    trees: Vec<ReducedTree>,
}

impl Lattice {
    /// Creates the lattice with cells of edge `a` over the region, which must hold the solid. On a
    /// stop by `control` cells remain undecided, and the lattice must not be used.
    ///
    /// # Errors
    /// [`MeshError::NoMemory`].
    pub(crate) fn new(
        solid: &dyn Solid,
        region: Aabb,
        a: f64,
        control: &Control<'_>,
    ) -> Result<Self, MeshError> {
        let grid = CellGrid::over(region, a);
        Self::window(solid, grid, grid.all(), control)
    }

    /// Creates the lattice of a unit cell, with cells of edge `a` or a little less.
    ///
    /// # Errors
    /// [`MeshError::NoMemory`].
    pub(crate) fn on_torus(
        solid: &dyn Solid,
        torus: &Torus,
        a: f64,
        control: &Control<'_>,
    ) -> Result<Self, MeshError> {
        let grid = CellGrid::on_torus(torus, a);
        Self::window(solid, grid, grid.all(), control)
    }

    /// Creates a window of the lattice over a region, with bitwise the points and states of the
    /// whole. Cells beyond the whole count like the nearest of its cells.
    ///
    /// # Errors
    /// [`MeshError::NoMemory`].
    pub(crate) fn window(
        solid: &dyn Solid,
        grid: CellGrid,
        cells: Cells,
        control: &Control<'_>,
    ) -> Result<Self, MeshError> {
        let n = cells.map(|c| c[1] - c[0]);
        let count = n.iter().fold(1, |count: usize, n| count.saturating_mul(*n));
        memory::check((count as u64).saturating_mul(MIN_CELL_BYTES))?;
        let mut lattice = Self {
            origin: grid.origin,
            a: grid.a,
            edges: grid.edges,
            repeats: grid.repeats,
            first: cells.map(|c| c[0]),
            n,
            goes_on: std::array::from_fn(|i| [cells[i][0] > 0, cells[i][1] < grid.n[i]]),
            state: memory::table(OUTSIDE_CELL, count)?,
            trees: Vec::new(),
        };
        let whole = WholeLattice {
            solid,
            n: grid.n,
            window: cells,
            control,
        };
        let (tree, pieces) = (solid.tree(), unique(solid.tree().pieces()));
        let mut found = lattice.decide_blocks(&whole, whole.blocks(), tree, &pieces);
        // Sorted by blocks, x fastest: the indices of trees do not depend on the order of the
        // threads.
        found.sort_by_key(|(cells, _)| [2, 1, 0].map(|i| cells[i][0] / BLOCK_CELLS));
        lattice.set(found.into_iter());
        memory::check(lattice.least_memory())?;
        Ok(lattice)
    }

    /// Returns a lower bound on the bytes that a mesh of the surface takes: for its own tables of
    /// all cells, and for the tetrahedra of the undecided ones.
    fn least_memory(&self) -> u64 {
        let mixed = self
            .state
            .par_iter()
            .filter(|s| **s >= FIRST_MIXED_STATE)
            .count();
        // An undecided cell has a dozen tetrahedra, each with four corners, four neighbours and a
        // mark.
        MIN_CELL_BYTES * self.state.len() as u64 + 12 * 36 * mixed as u64
    }

    /// Records the signs of boxes of cells; equal trees are stored once.
    fn set(&mut self, found: impl Iterator<Item = (Cells, Sign)>) {
        let mut known: HashMap<Csg, u32> = HashMap::new();
        for (cells, sign) in found {
            let state = match sign {
                Sign::Inside => INSIDE_CELL,
                Sign::Outside => OUTSIDE_CELL,
                Sign::Mixed(tree) => *known.entry(tree).or_insert_with_key(|tree| {
                    self.trees.push(ReducedTree {
                        tree: tree.clone(),
                        pieces: unique(tree.pieces()),
                    });
                    FIRST_MIXED_STATE + self.trees.len() as u32 - 1
                }),
            };
            self.fill(cells, state);
        }
    }

    /// Sets the state of those cells of the whole that lie in the window.
    fn fill(&mut self, cells: Cells, state: u32) {
        let cells: Cells = std::array::from_fn(|i| {
            let local = |c: usize| c.saturating_sub(self.first[i]).min(self.n[i]);
            cells[i].map(local)
        });
        for k in cells[2][0]..cells[2][1] {
            for j in cells[1][0]..cells[1][1] {
                let row = self.at([cells[0][0], j, k]);
                self.state[row..row + cells[0][1] - cells[0][0]].fill(state);
            }
        }
    }

    /// Returns an upper bound on the number of cells of the lattice, as a number that cannot
    /// overflow.
    pub(crate) fn cells(region: Aabb, a: f64) -> f64 {
        region
            .size()
            .iter()
            // The lattice has at most four cells beyond the region along an axis.
            .map(|s| (s / a + 4.0).ceil())
            .product()
    }

    /// Decides a box of blocks of the whole by intervals, and its halves if it is undecided; blocks
    /// without cells of the window are skipped.
    ///
    /// A block starts from the reduced tree of the box that it is half of: starting from the whole
    /// tree, each block of a model of many thousand pieces would visit all of them. The boxes are
    /// those of the whole, whatever the window, so that the trees of a block are equal in all
    /// windows.
    fn decide_blocks(
        &self,
        whole: &WholeLattice<'_>,
        blocks: Cells,
        tree: &Csg,
        pieces: &[u32],
    ) -> Vec<(Cells, Sign)> {
        let cells = whole.cells(blocks);
        let mut found = Vec::new();
        if !whole.is_seen(cells) || whole.control.is_stopped() {
            return found;
        }
        let Some([lower, upper]) = halves(blocks) else {
            self.decide(whole.solid, cells, tree, pieces, &mut found);
            return found;
        };
        match self.sign(whole.solid, cells, tree, pieces) {
            Sign::Mixed(tree) => {
                let pieces = unique(tree.pieces());
                let of = |blocks| self.decide_blocks(whole, blocks, &tree, &pieces);
                let (mut found, rest) = rayon::join(|| of(lower), || of(upper));
                found.extend(rest);
                found
            }
            decided => vec![(cells, decided)],
        }
    }

    /// Decides a box of cells of the whole by intervals, and its halves if it is undecided.
    fn decide(
        &self,
        solid: &dyn Solid,
        cells: Cells,
        tree: &Csg,
        pieces: &[u32],
        found: &mut Vec<(Cells, Sign)>,
    ) {
        match self.sign(solid, cells, tree, pieces) {
            Sign::Mixed(tree) => {
                let Some(halves) = halves(cells) else {
                    found.push((cells, Sign::Mixed(tree)));
                    return;
                };
                let pieces = unique(tree.pieces());
                for half in halves {
                    self.decide(solid, half, &tree, &pieces, found);
                }
            }
            decided => found.push((cells, decided)),
        }
    }

    /// Returns the sign that intervals prove in a box of cells of the whole and the margin around
    /// it. `pieces` are those of the tree, sorted.
    fn sign(&self, solid: &dyn Solid, cells: Cells, tree: &Csg, pieces: &[u32]) -> Sign {
        let corner = |k: usize, margin: f64| {
            std::array::from_fn(|i| self.origin[i] + (cells[i][k] as f64 + margin) * self.edges[i])
        };
        let region = Aabb {
            lo: corner(0, -CELL_MARGIN),
            hi: corner(1, CELL_MARGIN),
        };
        let mut ranges = vec![Interval::ALL; pieces.len()];
        solid.bounds(pieces, region, &mut ranges);
        reduced(tree, &|i| {
            let at = pieces.binary_search(&i);
            at.map_or(Interval::ALL, |k| ranges[k])
        })
    }

    pub(crate) fn at(&self, [i, j, k]: [usize; 3]) -> usize {
        (k * self.n[1] + j) * self.n[0] + i
    }

    /// Returns the indices by axis of a cell.
    pub(crate) fn indices(&self, cell: usize) -> [usize; 3] {
        let [nx, ny, _] = self.n;
        [cell % nx, cell / nx % ny, cell / (nx * ny)]
    }

    /// Returns the state of a cell; cells beyond the whole lattice are outside.
    pub(crate) fn cell(&self, c: [isize; 3]) -> u32 {
        let mut near = [0; 3];
        for i in 0..3 {
            if self.repeats[i] {
                near[i] = c[i].rem_euclid(self.n[i] as isize) as usize;
                continue;
            }
            let last = self.n[i] as isize - 1;
            let is_out = [c[i] < 0, c[i] > last];
            if (0..2).any(|end| is_out[end] && !self.goes_on[i][end]) {
                return OUTSIDE_CELL;
            }
            near[i] = c[i].clamp(0, last) as usize;
        }
        self.state[self.at(near)]
    }

    /// Returns the state of the cell that holds a point.
    pub(crate) fn state_at(&self, p: Point3) -> u32 {
        self.cell(std::array::from_fn(|i| {
            ((p[i] - self.origin[i]) / self.edges[i]).floor() as isize - self.first[i] as isize
        }))
    }

    /// Returns the reduced tree of a state; `None` for a decided one.
    pub(crate) fn reduced(&self, state: u32) -> Option<&ReducedTree> {
        self.trees
            .get(state.checked_sub(FIRST_MIXED_STATE)? as usize)
    }

    /// Returns the reduced tree of the cell that holds a point; `None` if the cell is decided.
    pub(crate) fn reduced_at(&self, p: Point3) -> Option<&ReducedTree> {
        self.reduced(self.state_at(p))
    }

    /// Returns the position of a lattice point given in half cells: even coordinates are corners of
    /// cells, odd ones centres.
    pub(crate) fn point(&self, half: [usize; 3]) -> Point3 {
        std::array::from_fn(|i| {
            self.origin[i] + 0.5 * self.edges[i] * (half[i] + 2 * self.first[i]) as f64
        })
    }

    /// Returns true if the lattice is periodic along an axis.
    pub(crate) fn repeats(&self, axis: usize) -> bool {
        self.repeats[axis]
    }

    /// Returns the four tetrahedra around the face between cell `c` and the next one along `axis`,
    /// by lattice points in half cells.
    pub(crate) fn tets(c: [usize; 3], axis: usize) -> [[[usize; 3]; 4]; 4] {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let centre = c.map(|i| 2 * i + 1);
        let mut next = centre;
        next[axis] += 2;
        let corner = |s: usize, t: usize| {
            let mut p = c.map(|i| 2 * i);
            p[axis] += 2;
            p[u] += 2 * s;
            p[v] += 2 * t;
            p
        };
        let q = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
        std::array::from_fn(|k| [centre, next, q[k], q[(k + 1) % 4]])
    }
}

/// Context in which the blocks of a lattice are decided.
struct WholeLattice<'a> {
    solid: &'a dyn Solid,
    /// Number of cells of the whole, by axis.
    n: [usize; 3],
    /// Cells of the window.
    window: Cells,
    control: &'a Control<'a>,
}

impl WholeLattice<'_> {
    /// Returns all blocks, numbered by axis; the last ones may be shorter.
    fn blocks(&self) -> Cells {
        self.n.map(|n| [0, n.div_ceil(BLOCK_CELLS)])
    }

    /// Returns the cells of a box of blocks.
    fn cells(&self, blocks: Cells) -> Cells {
        std::array::from_fn(|i| blocks[i].map(|b| (b * BLOCK_CELLS).min(self.n[i])))
    }

    /// Returns true if a box of cells holds cells of the window.
    fn is_seen(&self, cells: Cells) -> bool {
        (0..3).all(|i| cells[i][0] < self.window[i][1] && self.window[i][0] < cells[i][1])
    }
}

/// Halves a box of cells across its longest side; `None` for a single cell.
fn halves(cells: Cells) -> Option<[Cells; 2]> {
    let size = cells.map(|c| c[1] - c[0]);
    let axis = (0..3).fold(0, |best, i| if size[i] > size[best] { i } else { best });
    if size[axis] == 1 {
        return None;
    }
    let middle = cells[axis][0] + size[axis] / 2;
    let (mut lower, mut upper) = (cells, cells);
    lower[axis][1] = middle;
    upper[axis][0] = middle;
    Some([lower, upper])
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_field::Pieces;
    use isoform_field::hyperfun::{Mode, Model};
    use isoform_geom::{Field, OnePiece};
    use isoform_num::{Jet2, Real};
    use std::fmt::Write;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// A solid that counts how many pieces are bounded.
    struct Counted {
        solid: Pieces,
        bounded: AtomicUsize,
    }

    impl Solid for Counted {
        fn names(&self) -> &[String] {
            self.solid.names()
        }
        fn tree(&self) -> &Csg {
            self.solid.tree()
        }
        fn values(&self, which: &[u32], points: &[Point3], out: &mut [f64]) {
            self.solid.values(which, points, out);
        }
        fn gradient(&self, piece: u32, p: Point3) -> (f64, Point3) {
            self.solid.gradient(piece, p)
        }
        fn jet(&self, piece: u32, p: Point3) -> Jet2 {
            self.solid.jet(piece, p)
        }
        fn bounds(&self, which: &[u32], region: Aabb, out: &mut [Interval]) {
            self.bounded.fetch_add(which.len(), Ordering::Relaxed);
            self.solid.bounds(which, region, out);
        }
        fn sign_values(&self, points: &[Point3], out: &mut [f64]) {
            self.solid.sign_values(points, out);
        }
    }

    /// Balls of radius 0.4, one a unit along x.
    fn balls(n: usize) -> Counted {
        let mut text = String::from("balls(x[3], a[1]) { array c[3]; c = [0, 0, 0];");
        text += "t = hfSphere(x, c, 0.4);";
        for k in 1..n {
            write!(text, "c = [{k}, 0, 0]; t = t | hfSphere(x, c, 0.4);").expect("a string");
        }
        text += "balls = t; }";
        let model = Model::parse(&text, Mode::Default).expect("a program");
        Counted {
            solid: Pieces::of_model(&model, &[]).expect("a solid"),
            bounded: AtomicUsize::new(0),
        }
    }

    /// Ten times the balls in ten times the cells bound some ten times as many pieces: a block does
    /// not begin with all of them.
    #[test]
    fn pieces_are_bounded_where_they_are() {
        let cost = |n: usize| {
            let solid = balls(n);
            let region = Aabb {
                lo: [-0.5; 3],
                hi: [n as f64 - 0.5, 0.5, 0.5],
            };
            Lattice::new(&solid, region, 0.1, &Control::default()).expect("enough memory");
            solid.bounded.into_inner() as f64 / n as f64
        };
        let [few, many] = [40, 400].map(cost);
        assert!(many < 1.1 * few, "{few} and {many} bounds for each ball");
    }

    struct Nothing;

    impl Field for Nothing {
        fn value(&self, _: Point3) -> f64 {
            -1.0
        }
        fn jet(&self, _: Point3) -> Jet2 {
            Jet2::constant(-1.0)
        }
    }

    /// The four tetrahedra around a face between two cells of edge 2 have the volume of a third of
    /// a cell each side: 8/3 together.
    #[test]
    fn tetrahedra_of_a_face_fill_a_third_of_two_half_cells() {
        for axis in 0..3 {
            let volume: f64 = Lattice::tets([1, 2, 3], axis)
                .iter()
                .map(|t| isoform_check::quality::six_volume(t.map(|h| h.map(|i| i as f64))) / 6.0)
                .sum();
            assert!((volume - 8.0 / 3.0).abs() < 1e-12, "axis {axis}: {volume}");
        }
    }

    #[test]
    fn blocks_and_halves_hold_every_cell_once() {
        let solid = OnePiece::new(Nothing, "nothing");
        let control = Control::default();
        let whole = |n: [usize; 3], window: Cells| WholeLattice {
            solid: &solid,
            n,
            window,
            control: &control,
        };
        // All cells once, down to single blocks.
        let all = whole([17, 3, 40], [[0, 17], [0, 3], [0, 40]]);
        let (mut pending, mut count) = (vec![all.blocks()], 0);
        while let Some(blocks) = pending.pop() {
            match halves(blocks) {
                Some(parts) => pending.extend(parts),
                None => {
                    count += all
                        .cells(blocks)
                        .map(|r| r[1] - r[0])
                        .iter()
                        .product::<usize>()
                }
            }
        }
        assert_eq!(count, 17 * 3 * 40);
        // Blocks that hold some of the cells are whole.
        let some = whole([40, 3, 3], [[17, 33], [1, 2], [0, 3]]);
        let seen = |b: usize| some.is_seen(some.cells([[b, b + 1], [0, 1], [0, 1]]));
        assert_eq!([0, 1, 2].map(seen), [false, true, true]);
        assert_eq!(
            some.cells([[2, 3], [0, 1], [0, 1]]),
            [[32, 40], [0, 3], [0, 3]]
        );
        let [a, b] = halves([[0, 5], [2, 4], [0, 5]]).expect("more than one cell");
        assert_eq!((a[0], b[0]), ([0, 2], [2, 5]));
        assert!(halves([[3, 4], [5, 6], [0, 1]]).is_none());
    }
}
