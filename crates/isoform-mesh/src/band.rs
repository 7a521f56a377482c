//! Splits the lattice into a band around the surface, as a complex, and a core of plain tetrahedra.

use crate::complex::{Complex, NONE};
use crate::lattice::{INSIDE_CELL, Lattice, OUTSIDE_CELL};
use crate::torus::Torus;
use isoform_control::Control;
use isoform_geom::Point3;
use rayon::prelude::*;
use std::collections::HashMap;

/// Number of layers of cells that the optimiser may change, next to the cells that the surface can
/// meet.
const OPTIMISED_CELL_LAYERS: usize = 1;

/// Tetrahedra of the lattice deep inside, which are not modified.
#[derive(Default)]
pub(crate) struct Core {
    /// Tetrahedra; vertex indices below the number of band vertices refer to the band.
    pub(crate) tets: Vec<[u32; 4]>,
    /// Further vertices, numbered after those of the band.
    pub(crate) points: Vec<Point3>,
}

/// The lattice around the surface as a complex, and the core inside it.
pub(crate) struct Band {
    pub(crate) complex: Complex,
    /// True for vertices shared with the core.
    pub(crate) frozen: Vec<bool>,
    pub(crate) core: Core,
}

impl Band {
    /// Splits a lattice. With `all` the core is empty and everything may change. After a stop by
    /// `control` cells are missing.
    pub(crate) fn new(
        lattice: &Lattice,
        with_core: bool,
        all: bool,
        control: &Control<'_>,
    ) -> Self {
        let faces = CellFaces {
            lattice,
            deep: if all {
                vec![false; lattice.state.len()]
            } else {
                deep_cells(lattice)
            },
            control,
        };
        let mut vertices = Vertices::new(lattice);
        let mut tets = Vec::new();
        faces.visit(|around, deep| {
            if !deep {
                vertices.take(around, &mut tets);
            }
        });
        let band = vertices.points.len();
        let mut core = Vec::new();
        // Without the core only its vertices shared with the band are needed.
        faces.visit(|around, deep| {
            if deep && (with_core || vertices.any_below(band as u32, around)) {
                vertices.take(around, &mut core);
            }
        });
        let mut frozen = vec![false; band];
        for v in core.iter().flatten().map(|&v| v as usize) {
            if v < band {
                frozen[v] = true;
            }
        }
        let mut points = vertices.points;
        let core_points = points.split_off(band);
        Self {
            complex: Complex::within(points, tets, control),
            frozen,
            core: if with_core {
                Core {
                    tets: core,
                    points: core_points,
                }
            } else {
                Core::default()
            },
        }
    }
}

impl Band {
    /// Creates the band of a unit cell: everything may change, and the sides consist of faces of
    /// tetrahedra.
    pub(crate) fn on_torus(lattice: &Lattice, torus: Torus, control: &Control<'_>) -> Self {
        let faces = CellFaces {
            lattice,
            deep: vec![false; lattice.state.len()],
            control,
        };
        let mut vertices = TorusVertices {
            lattice,
            number: HashMap::new(),
            points: Vec::new(),
        };
        let mut tets = Vec::new();
        faces.visit_pairs(|cell, axis, _| {
            let is_side = cell[axis] + 1 == lattice.n[axis];
            for t in Lattice::tets(cell, axis) {
                if is_side {
                    // The edge between the cell centres crosses the side at the centre of the face.
                    let mut middle = t[0];
                    middle[axis] += 1;
                    tets.push([t[0], middle, t[2], t[3]].map(|half| vertices.vertex(half)));
                    tets.push([middle, t[1], t[2], t[3]].map(|half| vertices.vertex(half)));
                } else {
                    tets.push(t.map(|half| vertices.vertex(half)));
                }
            }
        });
        let mut complex = Complex::within(vertices.points, tets, control);
        complex.torus = Some(torus);
        Self {
            frozen: vec![false; complex.points.len()],
            complex,
            core: Core::default(),
        }
    }
}

/// Indices of the lattice points of a unit cell, in order of first use.
struct TorusVertices<'l> {
    lattice: &'l Lattice,
    number: HashMap<[usize; 3], u32>,
    points: Vec<Point3>,
}

impl TorusVertices<'_> {
    fn vertex(&mut self, half: [usize; 3]) -> u32 {
        let n = self.lattice.n;
        let half = std::array::from_fn(|i| match self.lattice.repeats(i) {
            true => half[i] % (2 * n[i]),
            false => half[i],
        });
        *self.number.entry(half).or_insert_with(|| {
            self.points.push(self.lattice.point(half));
            self.points.len() as u32 - 1
        })
    }
}

/// The four tetrahedra around a face between two cells, as lattice points in half cells.
type AroundFace = [[[usize; 3]; 4]; 4];

/// Faces between cells of which at least one is not outside.
struct CellFaces<'l> {
    lattice: &'l Lattice,
    /// True for each cell of the core.
    deep: Vec<bool>,
    control: &'l Control<'l>,
}

impl CellFaces<'_> {
    /// Calls `show` with the tetrahedra around each face; true if both of its cells are deep.
    fn visit(&self, mut show: impl FnMut(&AroundFace, bool)) {
        self.visit_pairs(|cell, axis, deep| show(&Lattice::tets(cell, axis), deep));
    }

    /// Calls `show` with each face, given by a cell and the axis along which the next cell follows;
    /// true if both cells are deep.
    fn visit_pairs(&self, mut show: impl FnMut([usize; 3], usize, bool)) {
        let n = self.lattice.n;
        for k in 0..n[2] {
            if self.control.is_stopped() {
                return;
            }
            for j in 0..n[1] {
                for i in 0..n[0] {
                    for axis in 0..3 {
                        if let Some(deep) = self.is_deep([i, j, k], axis) {
                            show([i, j, k], axis, deep);
                        }
                    }
                }
            }
        }
    }

    /// Returns true if the cell and the next one along the axis are deep; `None` without a next
    /// cell, or if both are outside.
    fn is_deep(&self, cell: [usize; 3], axis: usize) -> Option<bool> {
        let mut next = cell;
        next[axis] += 1;
        if next[axis] == self.lattice.n[axis] {
            if !self.lattice.repeats(axis) {
                return None;
            }
            next[axis] = 0;
        }
        let (s, t) = (self.lattice.at(cell), self.lattice.at(next));
        let state = &self.lattice.state;
        (state[s] != OUTSIDE_CELL || state[t] != OUTSIDE_CELL).then(|| self.deep[s] && self.deep[t])
    }
}

/// Indices of lattice points in order of first use.
struct Vertices<'l> {
    lattice: &'l Lattice,
    /// Index of each corner of cells, followed by those of the cell centres.
    number: Vec<u32>,
    points: Vec<Point3>,
}

impl<'l> Vertices<'l> {
    fn new(lattice: &'l Lattice) -> Self {
        let n = lattice.n;
        let corners = (n[0] + 1) * (n[1] + 1) * (n[2] + 1);
        Self {
            lattice,
            number: vec![NONE; corners + n[0] * n[1] * n[2]],
            points: Vec::new(),
        }
    }

    /// Returns the position of a lattice point in the list of indices.
    #[inline]
    fn slot(&self, half: [usize; 3]) -> usize {
        let n = self.lattice.n;
        let [i, j, k] = half.map(|h| h / 2);
        if half[0].is_multiple_of(2) {
            (k * (n[1] + 1) + j) * (n[0] + 1) + i
        } else {
            (n[0] + 1) * (n[1] + 1) * (n[2] + 1) + (k * n[1] + j) * n[0] + i
        }
    }

    fn take(&mut self, around: &AroundFace, into: &mut Vec<[u32; 4]>) {
        for t in around {
            into.push(t.map(|half| self.vertex(half)));
        }
    }

    fn vertex(&mut self, half: [usize; 3]) -> u32 {
        let slot = self.slot(half);
        if self.number[slot] == NONE {
            self.number[slot] = self.points.len() as u32;
            self.points.push(self.lattice.point(half));
        }
        self.number[slot]
    }

    /// Returns true if any of the vertices has an index below `number`.
    fn any_below(&self, number: u32, around: &AroundFace) -> bool {
        let mut points = around.iter().flatten();
        points.any(|&half| self.number[self.slot(half)] < number)
    }
}

/// Marks the inner cells that have only inner cells within [`OPTIMISED_CELL_LAYERS`].
fn deep_cells(lattice: &Lattice) -> Vec<bool> {
    let n = lattice.n;
    let mut deep: Vec<bool> = lattice.state.iter().map(|&s| s == INSIDE_CELL).collect();
    let step = [1, n[0], n[0] * n[1]];
    for axis in 0..3 {
        for _ in 0..OPTIMISED_CELL_LAYERS {
            let before = deep.clone();
            deep.par_iter_mut().enumerate().for_each(|(c, d)| {
                let i = c / step[axis] % n[axis];
                *d = *d
                    && i > 0
                    && i + 1 < n[axis]
                    && before[c - step[axis]]
                    && before[c + step[axis]];
            });
        }
    }
    deep
}
