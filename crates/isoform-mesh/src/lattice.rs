//! The body-centred cubic lattice over a solid, with the part of the tree that matters in each
//! cell.
//!
//! Cells are decided by intervals from large boxes down: inside, outside, or a reduced tree of the
//! pieces that can still decide the sign there. Only cells of the third kind see the surface; the
//! others are never evaluated at all (Labelle and Shewchuk, Isosurface stuffing, 2007, use the same
//! lattice; the pruning is that of Duff, Interval arithmetic and recursive subdivision, 1992).
//!
//! Lattice points are the corners and the centres of the cells. Around each face between two cells
//! four tetrahedra share the edge between the two centres; each has one edge of the face besides.

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

/// Edge of a lattice cell for tetrahedra as large as regular ones of edge 1: a³/12 = √2/12.
pub(crate) const CELL: f64 = 1.122_462_048_309_373;

/// Cell surely inside.
pub(crate) const IN: u32 = 0;
/// Cell surely outside.
pub(crate) const OUT: u32 = 1;
/// Cells from here on are undecided: the number of the cell's reduced tree, plus this.
const MIXED: u32 = 2;
/// Cells are looked at with this margin (in cells) around them, so that what is found for a cell
/// also holds for vertices moved there.
const MARGIN: f64 = 0.75;
/// Cells per side of the blocks that are shared among threads.
const BLOCK: usize = 16;
/// The lattice begins this many cells and one more before the region, in x, y and z: off the round
/// numbers that models are full of, for lattice planes on faces of the solid leave every tie to
/// rounding.
const OFFSET: [f64; 3] = [0.618, 0.414, 0.732];
/// Share of a cell by which the cells of a unit cell may be larger than asked for, for rounding.
const SLIGHTLY: f64 = 1e-6;
/// Cells by which the lattice goes on behind the region.
const BEHIND: f64 = 1.6;
/// Cells that the lattice has beyond the region in each direction, at most.
const BEYOND: f64 = 4.0;

/// Bytes that a cell takes at least: its state, and the numbers of its corner and of its centre.
const LEAST: u64 = 12;
/// Bytes that the tetrahedra of an undecided cell take at least: a dozen of them, each with four
/// corners, four neighbours and a mark.
const LEAST_MIXED: u64 = 12 * 36;

/// The part of a solid's tree that can decide the sign in a cell.
#[derive(Debug)]
pub(crate) struct Reduced {
    pub(crate) tree: Csg,
    /// The pieces of the tree, sorted, each once.
    pub(crate) pieces: Vec<u32>,
}

/// A box of cells: by axis the first one and the one behind the last.
pub(crate) type Cells = [[usize; 2]; 3];

/// All cells over a region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grid {
    pub(crate) origin: Point3,
    /// Edge of a cell, the shortest one.
    pub(crate) a: f64,
    /// Edges of a cell by axis.
    pub(crate) edges: [f64; 3],
    /// Cells by axis.
    pub(crate) n: [usize; 3],
    /// Whether behind the last cell along an axis comes the first one again.
    pub(crate) repeats: [bool; 3],
}

impl Grid {
    /// The cells of edge `a` over a region.
    pub(crate) fn over(region: Aabb, a: f64) -> Self {
        let offset = OFFSET.map(|o| (1.0 + o) * a);
        let origin: Point3 = std::array::from_fn(|i| region.lo[i] - offset[i]);
        let n = std::array::from_fn(|i| {
            ((region.hi[i] + BEHIND * a - origin[i]) / a)
                .ceil()
                .max(3.0) as usize
        });
        Self {
            origin,
            a,
            edges: [a; 3],
            n,
            repeats: [false; 3],
        }
    }

    /// The cells of a unit cell, with edges of `a` or less along axes that repeat, where a whole
    /// number of them fits in; `a` is at most what [`Torus::largest_size`] allows.
    pub(crate) fn on_torus(torus: &Torus, a: f64) -> Self {
        let size = torus.region.size();
        let mut grid = Self::over(torus.region, a);
        grid.repeats = torus.axes;
        for i in (0..3).filter(|&i| torus.axes[i]) {
            // Rounded up but for rounding: a whole number of cells is that number.
            grid.n[i] = (size[i] / a - SLIGHTLY).ceil() as usize;
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

/// The cells of the lattice over a box, or some of them.
#[derive(Debug)]
pub(crate) struct Lattice {
    /// Where the first cell of all begins.
    pub(crate) origin: Point3,
    /// Edge of a cell, the lattice's long edge; the shortest one.
    pub(crate) a: f64,
    /// Edges of a cell by axis.
    edges: [f64; 3],
    /// Whether behind the last cell along an axis comes the first one again.
    repeats: [bool; 3],
    /// The first of these cells, by axis.
    first: [usize; 3],
    /// Cells by axis.
    pub(crate) n: [usize; 3],
    /// Whether the whole goes on before the first cells and behind the last ones, by axis.
    goes_on: [[bool; 2]; 3],
    /// [`IN`], [`OUT`], or the number of a reduced tree after these, x fastest.
    pub(crate) state: Vec<u32>,
    trees: Vec<Reduced>,
}

impl Lattice {
    /// The lattice with cells of edge `a` over the region, which must hold the solid. On a stop by
    /// `control` cells are left undecided, and the lattice must not be used.
    ///
    /// # Errors
    /// [`MeshError::NoMemory`].
    pub(crate) fn new(
        solid: &dyn Solid,
        region: Aabb,
        a: f64,
        control: &Control<'_>,
    ) -> Result<Self, MeshError> {
        let grid = Grid::over(region, a);
        Self::window(solid, grid, grid.all(), control)
    }

    /// The lattice of a unit cell, with cells of edge `a` or a little less.
    ///
    /// # Errors
    /// [`MeshError::NoMemory`].
    pub(crate) fn on_torus(
        solid: &dyn Solid,
        torus: &Torus,
        a: f64,
        control: &Control<'_>,
    ) -> Result<Self, MeshError> {
        let grid = Grid::on_torus(torus, a);
        Self::window(solid, grid, grid.all(), control)
    }

    /// Some cells of the lattice over a region, with the points and states that they have in the
    /// whole, bit for bit. What is beyond them counts as it does in the nearest of them.
    ///
    /// # Errors
    /// [`MeshError::NoMemory`].
    pub(crate) fn window(
        solid: &dyn Solid,
        grid: Grid,
        cells: Cells,
        control: &Control<'_>,
    ) -> Result<Self, MeshError> {
        let n = cells.map(|c| c[1] - c[0]);
        let count = n.iter().fold(1, |count: usize, n| count.saturating_mul(*n));
        memory::check((count as u64).saturating_mul(LEAST))?;
        let mut lattice = Self {
            origin: grid.origin,
            a: grid.a,
            edges: grid.edges,
            repeats: grid.repeats,
            first: cells.map(|c| c[0]),
            n,
            goes_on: std::array::from_fn(|i| [cells[i][0] > 0, cells[i][1] < grid.n[i]]),
            state: memory::table(OUT, count)?,
            trees: Vec::new(),
        };
        let whole = Whole {
            solid,
            n: grid.n,
            window: cells,
            control,
        };
        let (tree, pieces) = (solid.tree(), unique(solid.tree().pieces()));
        let mut found = lattice.decide_blocks(&whole, whole.blocks(), tree, &pieces);
        // By blocks, x fastest: trees have the same numbers however the blocks are come by.
        found.sort_by_key(|(cells, _)| [2, 1, 0].map(|i| cells[i][0] / BLOCK));
        lattice.set(found.into_iter());
        memory::check(lattice.least_memory())?;
        Ok(lattice)
    }

    /// Bytes that a mesh of the surface takes at least: for its own tables of all cells, and for
    /// the tetrahedra of the undecided ones.
    fn least_memory(&self) -> u64 {
        let mixed = self.state.par_iter().filter(|s| **s >= MIXED).count();
        LEAST * self.state.len() as u64 + LEAST_MIXED * mixed as u64
    }

    /// Writes down what was found for boxes of cells; equal trees are kept once.
    fn set(&mut self, found: impl Iterator<Item = (Cells, Sign)>) {
        let mut known: HashMap<Csg, u32> = HashMap::new();
        for (cells, sign) in found {
            let state = match sign {
                Sign::Inside => IN,
                Sign::Outside => OUT,
                Sign::Mixed(tree) => *known.entry(tree).or_insert_with_key(|tree| {
                    self.trees.push(Reduced {
                        tree: tree.clone(),
                        pieces: unique(tree.pieces()),
                    });
                    MIXED + self.trees.len() as u32 - 1
                }),
            };
            self.fill(cells, state);
        }
    }

    /// Sets the state of those cells of the whole that are here.
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

    /// About how many cells the lattice would have, as a number that cannot overflow.
    pub(crate) fn cells(region: Aabb, a: f64) -> f64 {
        region
            .size()
            .iter()
            .map(|s| (s / a + BEYOND).ceil())
            .product()
    }

    /// Decides a box of blocks of the whole by intervals, by halves where all of it is undecided;
    /// blocks without cells of the window are left out.
    ///
    /// A block starts from the tree of the box that it is half of: from the whole tree, each block
    /// of a model of many thousand pieces would go over all of them. The boxes are those of the
    /// whole, whatever the window, so that each block comes to the same trees.
    fn decide_blocks(
        &self,
        whole: &Whole<'_>,
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

    /// Decides a box of cells of the whole by intervals, by halves where the whole is undecided.
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

    /// What intervals tell of the sign in a box of cells of the whole and the margin around it.
    /// The pieces are those of the tree, sorted.
    fn sign(&self, solid: &dyn Solid, cells: Cells, tree: &Csg, pieces: &[u32]) -> Sign {
        let corner = |k: usize, margin: f64| {
            std::array::from_fn(|i| self.origin[i] + (cells[i][k] as f64 + margin) * self.edges[i])
        };
        let region = Aabb {
            lo: corner(0, -MARGIN),
            hi: corner(1, MARGIN),
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

    /// The indices by axis of a cell.
    pub(crate) fn indices(&self, cell: usize) -> [usize; 3] {
        let [nx, ny, _] = self.n;
        [cell % nx, cell / nx % ny, cell / (nx * ny)]
    }

    /// State of a cell; outside the grid there is nothing.
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
                return OUT;
            }
            near[i] = c[i].clamp(0, last) as usize;
        }
        self.state[self.at(near)]
    }

    /// State of the cell that holds a point.
    pub(crate) fn state_at(&self, p: Point3) -> u32 {
        self.cell(std::array::from_fn(|i| {
            ((p[i] - self.origin[i]) / self.edges[i]).floor() as isize - self.first[i] as isize
        }))
    }

    /// The reduced tree of a state; none for a decided one.
    pub(crate) fn reduced(&self, state: u32) -> Option<&Reduced> {
        self.trees.get(state.checked_sub(MIXED)? as usize)
    }

    /// The reduced tree of the cell that holds a point; none if the cell is decided.
    pub(crate) fn reduced_at(&self, p: Point3) -> Option<&Reduced> {
        self.reduced(self.state_at(p))
    }

    /// Position of a lattice point in half cells: even coordinates are corners of cells, odd ones
    /// centres.
    pub(crate) fn point(&self, half: [usize; 3]) -> Point3 {
        std::array::from_fn(|i| {
            self.origin[i] + 0.5 * self.edges[i] * (half[i] + 2 * self.first[i]) as f64
        })
    }

    /// Whether behind the last cell along an axis comes the first one again.
    pub(crate) fn repeats(&self, axis: usize) -> bool {
        self.repeats[axis]
    }

    /// The four tetrahedra around the face between cell `c` and the next one along `axis`, by
    /// lattice points in half cells.
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

/// What the blocks of a lattice are decided of.
struct Whole<'a> {
    solid: &'a dyn Solid,
    /// Cells of the whole by axis.
    n: [usize; 3],
    /// The cells that are asked for.
    window: Cells,
    control: &'a Control<'a>,
}

impl Whole<'_> {
    /// All blocks, numbered by axis; the last ones may be shorter.
    fn blocks(&self) -> Cells {
        self.n.map(|n| [0, n.div_ceil(BLOCK)])
    }

    /// The cells of a box of blocks.
    fn cells(&self, blocks: Cells) -> Cells {
        std::array::from_fn(|i| blocks[i].map(|b| (b * BLOCK).min(self.n[i])))
    }

    /// Whether a box of cells holds some of those asked for.
    fn is_seen(&self, cells: Cells) -> bool {
        (0..3).all(|i| cells[i][0] < self.window[i][1] && self.window[i][0] < cells[i][1])
    }
}

/// The halves of a box of cells across its longest side; none of a single cell.
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
        let whole = |n: [usize; 3], window: Cells| Whole {
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
