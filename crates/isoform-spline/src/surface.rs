//! The function of an implicit spline, its bounds and its file form.

use crate::bspline::{self, MAX_DEGREE, SplineRow};
use crate::keys::{LatticeIndex, MAX_AXIS_NODES, key};
use crate::level::{MAX_CELL_SPLINES, SplineLevel, block};
use isoform_geom::{Aabb, Expansion, Field, LevelData, Point3, SplineData, norm, sub};
use isoform_num::{Interval, Jet2, ORDERS};

/// Truncated hierarchical B-spline of three variables, fitted to points; inside is f ≥ 0.
///
/// The levels are lattices of cells, each with half the spacing of the coarser one. The first level
/// has all cells, the others those near data. Within a leaf cell f is a polynomial of degree d in
/// each variable, and f is d − 1 times continuously differentiable. Outside its box f falls with
/// the distance from it, so that every solid is bounded.
#[derive(Clone, Debug)]
pub struct ImplicitSpline {
    degree: usize,
    corner: Point3,
    count: LatticeIndex,
    levels: Vec<SplineLevel>,
    /// Positions in the coefficients of the (d + 1)² runs of each cell, by level and cell.
    runs: Vec<Vec<u32>>,
    /// Bernstein coefficients of the B-splines on a cell.
    to_bernstein: Vec<SplineRow>,
    /// Range of f on each cell, finer levels included, by level.
    ranges: Vec<Vec<[f64; 2]>>,
    /// True if the cell contains data, finer levels included, by level and cell.
    data: Vec<Vec<bool>>,
    /// Largest coefficient by absolute value.
    largest: f64,
}

/// Reason why data do not form an implicit spline.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DataError {
    /// The degree is not between 2 and 5.
    #[error("degree {0}: from 2 to {MAX_DEGREE} are possible")]
    Degree(usize),
    /// The lattice has no cells, too many, or a spacing that is not positive and finite.
    #[error("the lattice of {count:?} cells of size {spacing} is impossible")]
    Lattice {
        /// Number of cells along the axes.
        count: [i32; 3],
        /// Spacing of the cells.
        spacing: f64,
    },
    /// The spline has no levels, or too many.
    #[error("{0} levels")]
    Levels(usize),
    /// A cell lies outside the box, or not in a cell with data of the coarser level.
    #[error("level {level}: the cell {cell:?} is not in a cell with data of the level before")]
    Cell {
        /// Index of the level, from 0.
        level: usize,
        /// Index of the cell.
        cell: [i32; 3],
    },
    /// The number of coefficients differs from that of the active B-splines.
    #[error("level {level}: {found} coefficients for {wanted} B-splines")]
    Coefficients {
        /// Index of the level, from 0.
        level: usize,
        /// Number of coefficients given.
        found: usize,
        /// Number of active B-splines.
        wanted: usize,
    },
    /// A number is not finite.
    #[error("a number is not finite")]
    NotFinite,
}

/// Maximum number of cells of the first level: a box of 64³, far more than are needed to continue a
/// function smoothly away from its data. The bound limits the memory for hostile files.
const MAX_FIRST_CELLS: i64 = 1 << 18;

/// Point in a leaf cell.
struct LeafPoint<'a> {
    level: &'a SplineLevel,
    depth: usize,
    cell: LatticeIndex,
    /// Position of the cell in its level.
    index: usize,
    /// Coordinates in the cell, in \[0, 1\]³.
    at: Point3,
}

impl ImplicitSpline {
    /// Assembles a spline from fitted levels. `data` contains the cells with data of each level.
    pub(crate) fn new(
        degree: usize,
        corner: Point3,
        levels: Vec<SplineLevel>,
        data: &[Vec<LatticeIndex>],
    ) -> Self {
        let first = &levels[0].cells;
        let count = first.at(first.len() - 1).map(|v| v + 1);
        let flags = levels.iter().zip(data).map(|(level, cells)| {
            let mut holds = vec![false; level.cells.len()];
            for cell in cells {
                holds[level.cells.find(*cell).expect("data lies in a cell")] = true;
            }
            holds
        });
        let data = flags.collect();
        let all = levels.iter().flat_map(|level| &level.coefficients);
        let largest = all.fold(0.0, |largest: f64, c| largest.max(c.abs()));
        let mut spline = Self {
            degree,
            corner,
            count,
            levels,
            runs: Vec::new(),
            to_bernstein: bspline::bernstein(degree)[..=degree].to_vec(),
            ranges: Vec::new(),
            data,
            largest,
        };
        let runs = |level: &SplineLevel| {
            let cells = level.cells.places();
            let n = degree + 1;
            cells
                .flat_map(|cell| level.runs(cell, degree).into_iter().take(n * n))
                .collect()
        };
        spline.runs = spline.levels.iter().map(runs).collect();
        spline.ranges = spline.all_ranges();
        spline
    }

    /// Builds a spline from its file form.
    ///
    /// # Errors
    /// [`DataError`] if the data are inconsistent.
    pub fn from_data(data: &SplineData) -> Result<Self, DataError> {
        let SplineData {
            degree,
            corner,
            spacing,
            count,
            levels,
        } = data;
        if !(2..=MAX_DEGREE).contains(degree) {
            return Err(DataError::Degree(*degree));
        }
        let cells = count.iter().map(|c| i64::from(*c)).product::<i64>();
        let depth = levels.len() as u32;
        if !spacing.is_finite()
            || *spacing <= 0.0
            || count.iter().any(|c| *c < 1 || *c > MAX_FIRST_CELLS as i32)
            || cells > MAX_FIRST_CELLS
        {
            return Err(DataError::Lattice {
                count: *count,
                spacing: *spacing,
            });
        }
        if depth == 0
            || depth > 20
            || count
                .iter()
                .any(|c| i64::from(*c) << depth >= i64::from(MAX_AXIS_NODES) - 8)
        {
            return Err(DataError::Levels(levels.len()));
        }
        let numbers = levels.iter().flat_map(|l| &l.coefficients).chain(corner);
        if !numbers.into_iter().all(|v| v.is_finite()) {
            return Err(DataError::NotFinite);
        }
        let mut built = vec![SplineLevel::coarsest(*count, *spacing, *degree)];
        let mut parents: Vec<LatticeIndex> = Vec::new();
        for (l, given) in levels.iter().enumerate() {
            let mut sorted: Vec<u64> = Vec::with_capacity(given.cells.len());
            for cell in &given.cells {
                let inside = (0..3).all(|k| (0..count[k] << l).contains(&cell[k]));
                let parent = cell.map(|v| v >> 1);
                if !inside
                    || l > 0
                        && parents
                            .binary_search_by_key(&key(parent), |p| key(*p))
                            .is_err()
                {
                    return Err(DataError::Cell {
                        level: l,
                        cell: *cell,
                    });
                }
                sorted.push(key(*cell));
            }
            sorted.sort_unstable();
            sorted.dedup();
            parents = sorted.into_iter().map(crate::keys::place).collect();
            if l > 0 {
                let finer = count.map(|c| c << l);
                let next = built[l - 1].refined(&parents, finer, *degree);
                built.push(next);
            }
            let level = &mut built[l];
            let wanted = level.unknowns();
            if wanted != given.coefficients.len() {
                return Err(DataError::Coefficients {
                    level: l,
                    found: given.coefficients.len(),
                    wanted,
                });
            }
            let mut values = given.coefficients.iter();
            for (c, active) in level.coefficients.iter_mut().zip(&level.is_active) {
                if *active {
                    *c = *values.next().expect("as many as were counted");
                }
            }
        }
        let cells: Vec<Vec<LatticeIndex>> = levels.iter().map(|l| l.cells.clone()).collect();
        Ok(Self::new(*degree, *corner, built, &cells))
    }

    /// Returns the file form of the spline.
    pub fn data(&self) -> SplineData {
        let levels = self.levels.iter().zip(&self.data).map(|(level, holds)| {
            let cells = level.cells.places().zip(holds).filter(|(_, holds)| **holds);
            let active = level
                .coefficients
                .iter()
                .zip(&level.is_active)
                .filter(|(_, a)| **a);
            LevelData {
                cells: cells.map(|(cell, _)| cell).collect(),
                coefficients: active.map(|(c, _)| *c).collect(),
            }
        });
        SplineData {
            degree: self.degree,
            corner: self.corner,
            spacing: self.levels[0].spacing,
            count: self.count,
            levels: levels.collect(),
        }
    }

    /// Returns the tri-degree.
    pub fn degree(&self) -> usize {
        self.degree
    }
    /// Returns the number of free coefficients, which do not follow from coarser ones.
    pub fn unknowns(&self) -> usize {
        self.levels.iter().map(SplineLevel::unknowns).sum()
    }
    /// Returns the edge length of the finest cells.
    pub fn spacing(&self) -> f64 {
        self.levels.last().map_or(0.0, |l| l.spacing)
    }
    /// Returns the number of levels.
    pub fn depth(&self) -> usize {
        self.levels.len()
    }
    /// Returns the box in which the function is a spline.
    pub fn domain(&self) -> Aabb {
        let h = self.levels[0].spacing;
        Aabb {
            lo: self.corner,
            hi: std::array::from_fn(|k| self.corner[k] + h * f64::from(self.count[k])),
        }
    }
    /// Returns the number of cells with data that were not refined: the polynomial pieces that were
    /// fitted.
    pub fn data_cells(&self) -> usize {
        let of_level = |(l, level): (usize, &SplineLevel)| {
            let cells = level.cells.places().enumerate();
            cells
                .filter(|(i, cell)| self.data[l][*i] && !self.has_finer_data(l, *cell))
                .count()
        };
        self.levels.iter().enumerate().map(of_level).sum()
    }

    /// Returns true if a cell was refined for its data.
    fn has_finer_data(&self, l: usize, cell: LatticeIndex) -> bool {
        let Some(finer) = self.levels.get(l + 1) else {
            return false;
        };
        let lo = cell.map(|v| 2 * v);
        block(lo, lo.map(|v| v + 1))
            .any(|child| finer.cells.find(child).is_some_and(|i| self.data[l + 1][i]))
    }

    /// Returns true if data lie in a cell of a level or, if the cell was refined without data of
    /// its own, in the coarser cell around it.
    pub(crate) fn holds(&self, l: usize, cell: LatticeIndex) -> bool {
        let mut cell = cell;
        for k in (0..=l).rev() {
            let found = self.levels[k].cells.find(cell);
            if found.is_some_and(|i| self.data[k][i]) {
                return k == l || !self.has_finer_data(k, cell);
            }
            cell = cell.map(|v| v >> 1);
        }
        false
    }

    /// Returns true if data lie in the leaf cell of a point.
    pub fn holds_data(&self, p: Point3) -> bool {
        self.is_in_domain(p) && {
            let leaf = self.leaf(p);
            self.holds(leaf.depth, leaf.cell)
        }
    }

    /// Returns true if data lie in the leaf cell of a point or in a face neighbour.
    pub fn is_seen(&self, p: Point3) -> bool {
        if !self.is_in_domain(p) {
            return false;
        }
        let leaf = self.leaf(p);
        let beside = |axis: usize, step: i32| {
            let mut beside = leaf.cell;
            beside[axis] += step;
            beside[axis] >= 0 && self.holds(leaf.depth, beside)
        };
        self.holds(leaf.depth, leaf.cell) || (0..3).any(|k| beside(k, -1) || beside(k, 1))
    }

    pub(crate) fn is_in_domain(&self, p: Point3) -> bool {
        self.clamped(p) == p
    }

    pub(crate) fn levels(&self) -> &[SplineLevel] {
        &self.levels
    }

    /// Returns the leaf cell that contains a point of the domain.
    fn leaf(&self, p: Point3) -> LeafPoint<'_> {
        for (depth, level) in self.levels.iter().enumerate().rev() {
            let s: Point3 = std::array::from_fn(|k| (p[k] - self.corner[k]) / level.spacing);
            let cell: LatticeIndex =
                std::array::from_fn(|k| (s[k] as i32).clamp(0, (self.count[k] << depth) - 1));
            if let Some(index) = level.cells.find(cell) {
                let at = std::array::from_fn(|k| s[k] - f64::from(cell[k]));
                return LeafPoint {
                    level,
                    depth,
                    cell,
                    index,
                    at,
                };
            }
        }
        unreachable!("the first level covers the domain")
    }

    /// Returns the edge length of the leaf cell of a point of the domain.
    pub(crate) fn leaf_spacing(&self, p: Point3) -> f64 {
        self.leaf(p).level.spacing
    }

    /// Returns the largest coefficient by absolute value.
    pub(crate) fn largest(&self) -> f64 {
        self.largest
    }

    /// Returns f with gradient and Hessian at a point of the domain.
    pub(crate) fn jet_inside(&self, p: Point3) -> Jet2 {
        let leaf = self.leaf(p);
        let n = self.degree + 1;
        let [x, y, z] = leaf.at.map(|t| bspline::jets(self.degree, t));
        let mut out = [0.0; 10];
        for (row, line) in self.lines(leaf.depth, leaf.index).enumerate() {
            let (j, k) = (row % n, row / n);
            let along: [f64; 3] =
                std::array::from_fn(|o| line.iter().zip(&x[o]).map(|(c, b)| c * b).sum());
            for (out, [a, b, d]) in out.iter_mut().zip(ORDERS) {
                *out += along[a] * y[b][j] * z[d][k];
            }
        }
        let h = leaf.level.spacing;
        Jet2 {
            v: out[0],
            g: [out[1] / h, out[2] / h, out[3] / h],
            h: std::array::from_fn(|i| out[4 + i] / (h * h)),
        }
    }

    /// Returns f at a point of the domain.
    fn value_inside(&self, p: Point3) -> f64 {
        let leaf = self.leaf(p);
        let n = self.degree + 1;
        let [x, y, z] = leaf.at.map(|t| bspline::values(self.degree, t));
        let mut sum = 0.0;
        for (row, line) in self.lines(leaf.depth, leaf.index).enumerate() {
            let along: f64 = line.iter().zip(&x).map(|(c, b)| c * b).sum();
            sum += along * y[row % n] * z[row / n];
        }
        sum
    }

    /// Returns the coefficients of the B-splines that touch a cell, in lines along x.
    fn lines(&self, l: usize, index: usize) -> impl Iterator<Item = &[f64]> {
        let n = self.degree + 1;
        let runs = &self.runs[l][index * n * n..][..n * n];
        let coefficients = &self.levels[l].coefficients;
        runs.iter()
            .map(move |first| &coefficients[*first as usize..][..n])
    }

    /// Returns the nearest point of the domain.
    fn clamped(&self, p: Point3) -> Point3 {
        let domain = self.domain();
        std::array::from_fn(|k| p[k].clamp(domain.lo[k], domain.hi[k]))
    }

    /// Computes the range of f on each cell, from the finest level to the first.
    fn all_ranges(&self) -> Vec<Vec<[f64; 2]>> {
        let mut all: Vec<Vec<[f64; 2]>> = Vec::new();
        for (l, level) in self.levels.iter().enumerate().rev() {
            let finer = all.last().map(|ranges| (&self.levels[l + 1], ranges));
            let ranges = level
                .cells
                .places()
                .enumerate()
                .map(|(i, cell)| match finer {
                    Some((next, ranges)) if level.is_refined[i] => {
                        let lo = cell.map(|v| 2 * v);
                        block(lo, lo.map(|v| v + 1)).fold(
                            [f64::INFINITY, f64::NEG_INFINITY],
                            |r, c| {
                                let [a, b] =
                                    ranges[next.cells.find(c).expect("cells come in eights")];
                                [r[0].min(a), r[1].max(b)]
                            },
                        )
                    }
                    _ => self.range_in(l, i, [[0.0, 1.0]; 3]),
                });
            let ranges = ranges.collect();
            all.push(ranges);
        }
        all.reverse();
        all
    }

    /// Returns the range of f over a part of a cell, given by its level, its position in the level,
    /// and local coordinates.
    fn range_in(&self, l: usize, index: usize, part: [[f64; 2]; 3]) -> [f64; 2] {
        let n = self.degree + 1;
        let mut c = [0.0; MAX_CELL_SPLINES];
        for (row, line) in self.lines(l, index).enumerate() {
            c[row * n..][..n].copy_from_slice(line);
        }
        for axis in 0..3 {
            along(&mut c, n, axis, |line| {
                let mut out = [0.0; MAX_DEGREE + 1];
                for (v, row) in line.iter().zip(&self.to_bernstein) {
                    for k in 0..n {
                        out[k] += v * row[k];
                    }
                }
                out
            });
        }
        for (axis, [lo, hi]) in part.into_iter().enumerate() {
            if (lo, hi) != (0.0, 1.0) {
                along(&mut c, n, axis, |line| restricted(line, n, lo, hi));
            }
        }
        range_of(&c, self.degree)
    }

    /// Returns the intersection of a cell with a region of the domain, in local coordinates; `None`
    /// if it is empty.
    pub(crate) fn part_of(
        &self,
        l: usize,
        cell: LatticeIndex,
        region: Aabb,
    ) -> Option<[[f64; 2]; 3]> {
        let spacing = self.levels[l].spacing;
        let mut part = [[0.0, 1.0]; 3];
        for k in 0..3 {
            // Local coordinates of the region, widened by the rounding of a difference and a
            // quotient. The domain's own border is rounded, too: points on it belong to a cell.
            let end = f64::from(self.count[k] << l);
            let of = |p: f64| ((p - self.corner[k]) / spacing).clamp(0.0, end);
            let (a, b) = (of(region.lo[k]), of(region.hi[k]));
            let slack = 4.0 * f64::EPSILON * (1.0 + a.abs().max(b.abs()));
            let from = (a - slack - f64::from(cell[k])).max(0.0);
            let to = (b + slack - f64::from(cell[k])).min(1.0);
            if from > to {
                return None;
            }
            part[k] = [from, to];
        }
        Some(part)
    }

    /// Returns the first and the last cell of the first level that a region of the domain may
    /// touch.
    pub(crate) fn first_cells(&self, region: Aabb) -> (LatticeIndex, LatticeIndex) {
        let h = self.levels[0].spacing;
        let first = |p: Point3, k: usize| ((p[k] - self.corner[k]) / h) as i32;
        let lo = std::array::from_fn(|k| (first(region.lo, k) - 1).max(0));
        let hi = std::array::from_fn(|k| (first(region.hi, k) + 1).min(self.count[k] - 1));
        (lo, hi)
    }

    /// Extends `out` by the range of f over the part of a cell in a region, descending to finer
    /// levels while `budget` lasts.
    fn hull(
        &self,
        l: usize,
        cell: LatticeIndex,
        region: Aabb,
        budget: &mut u32,
        out: &mut [f64; 2],
    ) {
        let level = &self.levels[l];
        let Some(i) = level.cells.find(cell) else {
            return;
        };
        let known = self.ranges[l][i];
        if known[0] >= out[0] && known[1] <= out[1] {
            return;
        }
        let Some(part) = self.part_of(l, cell, region) else {
            return;
        };
        let mut add = |r: [f64; 2]| *out = [out[0].min(r[0]), out[1].max(r[1])];
        if *budget == 0 || part == [[0.0, 1.0]; 3] {
            return add(known);
        }
        *budget -= 1;
        if level.is_refined[i] {
            let lo = cell.map(|v| 2 * v);
            for child in block(lo, lo.map(|v| v + 1)) {
                self.hull(l + 1, child, region, budget, out);
            }
        } else {
            add(self.range_in(l, i, part));
        }
    }

    /// Returns the range of f over a region of the domain.
    fn range_inside(&self, region: Aabb) -> [f64; 2] {
        let (lo, hi) = self.first_cells(region);
        let mut out = [f64::INFINITY, f64::NEG_INFINITY];
        // A region of the size of the finest cells never needs as many cells. For large regions,
        // fewer widen the bounds, and more take longer.
        let mut budget = 256;
        for cell in block(lo, hi) {
            self.hull(0, cell, region, &mut budget, &mut out);
        }
        out
    }
}

/// Replaces every line of (d + 1)³ numbers along an axis, x fastest, by its image under `f`.
fn along(c: &mut [f64; MAX_CELL_SPLINES], n: usize, axis: usize, f: impl Fn(&[f64]) -> SplineRow) {
    let step = n.pow(axis as u32);
    for a in 0..n {
        for b in 0..n {
            let first = match axis {
                0 => (a * n + b) * n,
                1 => a * n * n + b,
                _ => a * n + b,
            };
            let mut line = [0.0; MAX_DEGREE + 1];
            for k in 0..n {
                line[k] = c[first + k * step];
            }
            let line = f(&line[..n]);
            for k in 0..n {
                c[first + k * step] = line[k];
            }
        }
    }
}

/// Returns the Bernstein coefficients of a polynomial on \[lo, hi\] of \[0, 1\], by de Casteljau's
/// algorithm.
fn restricted(line: &[f64], n: usize, lo: f64, hi: f64) -> SplineRow {
    let mut c = [0.0; MAX_DEGREE + 1];
    c[..n].copy_from_slice(line);
    if hi < 1.0 {
        // The left part of a cut at hi: the first coefficient of each round.
        let mut left = [0.0; MAX_DEGREE + 1];
        for round in 0..n {
            left[round] = c[0];
            for k in 0..n - 1 - round {
                c[k] += hi * (c[k + 1] - c[k]);
            }
        }
        c = left;
    }
    if lo > 0.0 {
        let at = if hi > 0.0 { lo / hi } else { 1.0 };
        // The right part of a cut: the last coefficient of each round.
        for round in 0..n - 1 {
            for k in 0..n - 1 - round {
                c[k] += at * (c[k + 1] - c[k]);
            }
        }
    }
    c
}

/// Returns the hull of Bernstein coefficients, widened by their rounding.
///
/// Each coefficient is a convex combination of B-spline coefficients, computed by at most three
/// rounds of d + 1 products and two cuts of d rounds along each of three axes: fewer than 64 d
/// rounded operations on numbers of at most the largest coefficient's size.
fn range_of(c: &[f64; MAX_CELL_SPLINES], degree: usize) -> [f64; 2] {
    let n = degree + 1;
    let c = &c[..n * n * n];
    let lo = c.iter().copied().fold(f64::INFINITY, f64::min);
    let hi = c.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let slack = 64.0 * degree as f64 * f64::EPSILON * lo.abs().max(hi.abs());
    [lo - slack, hi + slack]
}

impl Field for ImplicitSpline {
    fn value(&self, p: Point3) -> f64 {
        let inside = self.clamped(p);
        let f = self.value_inside(inside);
        if inside == p {
            f
        } else {
            f - norm(sub(p, inside))
        }
    }

    fn jet(&self, p: Point3) -> Jet2 {
        let inside = self.clamped(p);
        let mut jet = self.jet_inside(inside);
        if inside == p {
            return jet;
        }
        let away = sub(p, inside);
        let far = norm(away);
        jet.v -= far;
        for k in 0..3 {
            if p[k] != inside[k] {
                jet.g[k] = 0.0;
            }
            jet.g[k] -= away[k] / far;
        }
        jet.h = [0.0; 6];
        jet
    }

    fn expansion(&self, at: Point3, region: Aabb) -> Option<Expansion> {
        self.expansion_about(at, region)
    }

    fn bounds(&self, region: Aabb) -> Interval {
        let finite = region.lo.iter().chain(&region.hi).all(|v| v.is_finite());
        if !finite || region.is_empty() {
            return Interval::ALL;
        }
        let part = Aabb {
            lo: self.clamped(region.lo),
            hi: self.clamped(region.hi),
        };
        let [lo, hi] = self.range_inside(part);
        if part == region {
            return Interval::new(lo, hi);
        }
        // The smallest and the largest distance of the region from the domain.
        let domain = self.domain();
        let gap: Point3 = std::array::from_fn(|k| {
            (region.lo[k] - domain.hi[k])
                .max(domain.lo[k] - region.hi[k])
                .max(0.0)
        });
        let far: Point3 = std::array::from_fn(|k| {
            (region.hi[k] - domain.hi[k])
                .max(domain.lo[k] - region.lo[k])
                .max(0.0)
        });
        // Rounding of a norm and a difference.
        let slack = 1.0 + 8.0 * f64::EPSILON;
        let (low, high) = (lo - norm(far) * slack, hi - norm(gap) / slack);
        Interval::new(low.next_down(), high.next_up())
    }
}
