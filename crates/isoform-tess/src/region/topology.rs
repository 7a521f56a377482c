//! Euler characteristic, components and boundary loops of a region, by counting the pieces of its
//! decomposition.
//!
//! The region is the closure of its cells. Open cells, and the arcs, segments of walls and points
//! inside a unit triangle are counted triangle by triangle. A piece on one of the lines s = 0, t =
//! 0 and w = 0 belongs to two triangles, and has one name in both:
//!
//! ```text
//! (0:1:0) = Corner(2)
//!    | \
//!    |   \   line 2: w = 0
//!    |     \
//!    line 0: s = 0
//!    |         \
//! (0:0:1) ------- (1:0:0) = Corner(1)
//! = Corner(0)  line 1: t = 0
//! ```

use super::{Region, RegionCell, Triangle};
use isoform_algebra::{Arc, QUADRANTS};
use isoform_geom::UnionFind;
use std::collections::{BTreeMap, BTreeSet};

/// Topology of a region. It is that of the surface in the box unless two parameters have one image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RegionTopology {
    /// Euler characteristic.
    pub euler: i64,
    /// Number of connected components.
    pub components: usize,
    /// Number of connected components of the boundary.
    pub loops: usize,
}

impl Region {
    /// Computes the Euler characteristic and the numbers of components and boundary loops. The
    /// region is the closure of its cells.
    pub fn topology(&self) -> RegionTopology {
        let mut count = Count::default();
        for (quadrant, triangle) in self.triangles.iter().enumerate() {
            count.add(&Named::new(triangle, quadrant));
        }
        count.finish()
    }
}

/// One of the lines s = 0, t = 0, w = 0 between its two corners. Each line has two such sides,
/// distinguished by the sign of t, s, or s t.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    line: usize,
    sign: i64,
}

impl Side {
    /// Returns the sides of a unit triangle.
    fn sides_of_quadrant(quadrant: usize) -> [Self; 3] {
        let [s, t] = QUADRANTS[quadrant];
        let signs = [t, s, s * t];
        [0, 1, 2].map(|line| Self {
            line,
            sign: signs[line],
        })
    }
    /// Returns the corners in which the side begins and ends, in the order of the walls and points
    /// on it.
    fn corners(self) -> [RegionPiece; 2] {
        [[0, 2], [0, 1], [2, 1]][self.line].map(RegionPiece::Corner)
    }
}

/// A piece of the decomposition.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum RegionPiece {
    /// A cell: quadrant, slab, place.
    Cell(usize, usize, usize),
    /// A point of a wall inside a triangle: quadrant, wall, point.
    Inner(usize, usize, usize),
    /// A point of a side through which a curve passes, by order.
    Point(Side, usize),
    /// The open interval of a side after a number of its points.
    Interval(Side, usize),
    /// The corner (0:0:1), (1:0:0) or (0:1:0).
    Corner(usize),
}

/// A unit triangle with names for the points of its walls. Points of sides that occur only in this
/// triangle's decomposition belong to the interval around them.
struct Named<'a> {
    triangle: &'a Triangle,
    quadrant: usize,
    sides: [Side; 3],
    /// Names of the points, by walls.
    names: Vec<Vec<RegionPiece>>,
}

impl<'a> Named<'a> {
    fn new(triangle: &'a Triangle, quadrant: usize) -> Self {
        let mut named = Self {
            triangle,
            quadrant,
            sides: Side::sides_of_quadrant(quadrant),
            names: Vec::new(),
        };
        let mut seen = [0; 3];
        for (k, wall) in triangle.arrangement.walls.iter().enumerate() {
            let points = 0..wall.points.len();
            let names = points.map(|p| named.name(k, p, &mut seen)).collect();
            named.names.push(names);
        }
        named
    }
    /// Returns the name of a point of a wall. Points have to be named in order: `seen` counts the
    /// points of each side through which a curve passes.
    fn name(&self, wall: usize, point: usize, seen: &mut [usize; 3]) -> RegionPiece {
        let walls = &self.triangle.arrangement.walls;
        let is_top = point + 1 == walls[wall].points.len();
        let line = match (wall, point) {
            _ if wall + 1 == walls.len() => return RegionPiece::Corner(1),
            (0, 0) => return RegionPiece::Corner(0),
            (0, _) if is_top => return RegionPiece::Corner(2),
            (0, _) => 0,
            (_, 0) => 1,
            _ if is_top => 2,
            _ => return RegionPiece::Inner(self.quadrant, wall, point),
        };
        let side = self.sides[line];
        if self.triangle.is_real(wall, point) {
            seen[line] += 1;
            RegionPiece::Point(side, seen[line])
        } else {
            RegionPiece::Interval(side, seen[line])
        }
    }
    fn cell(&self, cell: RegionCell) -> RegionPiece {
        RegionPiece::Cell(self.quadrant, cell.slab, cell.place)
    }
    /// Returns the side on which an arc lies.
    fn side_of(&self, arc: &Arc) -> Option<Side> {
        let number = arc.curve.checked_sub(self.triangle.arrangement.lower())?;
        Some(self.sides[1 + number])
    }
    /// Returns the names of all points of walls on a side, from its first corner to its last one.
    fn along(&self, side: Side) -> impl Iterator<Item = RegionPiece> {
        let last = |names: &Vec<RegionPiece>| names[names.len() - 1];
        let names: Vec<RegionPiece> = match side.line {
            0 => self.names[0].clone(),
            1 => self.names.iter().map(|names| names[0]).collect(),
            _ => self.names.iter().map(last).collect(),
        };
        names.into_iter()
    }
    /// Returns the interval of a side that begins with one of its first points, counted along the
    /// walls.
    fn interval(&self, side: Side, from: usize) -> RegionPiece {
        let points = self.along(side).take(from + 1).filter(is_point);
        RegionPiece::Interval(side, points.count())
    }
}

/// Returns true if a piece is a point of a side through which a curve passes.
fn is_point(place: &RegionPiece) -> bool {
    matches!(place, RegionPiece::Point(..))
}

/// Sums over the pieces of the region: open cells separately for each triangle, pieces on sides
/// once for both triangles.
#[derive(Default)]
struct Count {
    euler: i64,
    /// Pieces on the sides.
    on_sides: BTreeSet<RegionPiece>,
    /// Cells inside.
    cells: Vec<RegionPiece>,
    /// Pairs of pieces that touch.
    touching: Vec<(RegionPiece, RegionPiece)>,
    /// Ends of pieces of the boundary.
    bounding: Vec<(RegionPiece, RegionPiece)>,
    /// Quadrants, as bits, in which an interval of a side is adjacent to a cell inside.
    side_cells: BTreeMap<RegionPiece, u8>,
    /// Ends of the intervals of the sides.
    side_ends: BTreeMap<RegionPiece, (RegionPiece, RegionPiece)>,
}

impl Count {
    /// Adds the pieces of a triangle.
    fn add(&mut self, t: &Named<'_>) {
        self.add_cells(t);
        for slab in 0..t.triangle.arrangement.slabs.len() {
            self.add_arcs(t, slab);
        }
        for wall in 0..t.names.len() {
            self.add_points(t, wall);
            self.add_stretches(t, wall);
        }
        for side in t.sides {
            self.add_ends(t, side);
        }
    }
    fn add_cells(&mut self, t: &Named<'_>) {
        for (slab, inside) in t.triangle.inside.iter().enumerate() {
            for place in (0..inside.len()).filter(|&i| inside[i]) {
                self.euler += 1;
                self.cells.push(t.cell(RegionCell { slab, place }));
            }
        }
    }
    fn add_arcs(&mut self, t: &Named<'_>, slab: usize) {
        let inside = &t.triangle.inside[slab];
        let arcs = &t.triangle.arrangement.slabs[slab].arcs;
        for (i, arc) in arcs.iter().enumerate() {
            let cell = |place: usize| {
                let is_inside = inside.get(place).is_some_and(|&is| is);
                is_inside.then(|| t.cell(RegionCell { slab, place }))
            };
            let cells = [i.checked_sub(1).and_then(cell), cell(i)];
            if let Some(side) = t.side_of(arc) {
                for cell in cells.into_iter().flatten() {
                    self.add_beside(t, t.interval(side, slab), cell);
                }
                continue;
            }
            match cells {
                [Some(below), Some(above)] => self.touching.push((below, above)),
                [None, None] => continue,
                _ => {
                    let ends = (t.names[slab][arc.left], t.names[slab + 1][arc.right]);
                    self.bounding.push(ends);
                }
            }
            self.euler -= 1;
        }
    }
    /// Adds an interval of a side, adjacent to a cell inside.
    fn add_beside(&mut self, t: &Named<'_>, interval: RegionPiece, cell: RegionPiece) {
        self.on_sides.insert(interval);
        self.touching.push((interval, cell));
        *self.side_cells.entry(interval).or_default() |= 1 << t.quadrant;
    }
    fn add_points(&mut self, t: &Named<'_>, wall: usize) {
        for (p, &name) in t.names[wall].iter().enumerate() {
            if !t.triangle.holds_point(wall, p) {
                continue;
            }
            if matches!(name, RegionPiece::Inner(..)) {
                self.euler += 1;
            } else {
                self.on_sides.insert(name);
            }
            let cells = t.triangle.cells_at(wall, p, p);
            self.touching.extend(cells.map(|c| (t.cell(c), name)));
        }
    }
    /// Adds the segments of a wall between its points.
    fn add_stretches(&mut self, t: &Named<'_>, wall: usize) {
        let is_curve = !t.triangle.arrangement.walls[wall].vertical.is_empty();
        for (p, ends) in t.names[wall].windows(2).enumerate() {
            let cells = t.triangle.cells_at(wall, p, p + 1).map(|c| t.cell(c));
            let cells: Vec<RegionPiece> = cells.collect();
            if wall == 0 {
                for &cell in &cells {
                    self.add_beside(t, t.interval(t.sides[0], p), cell);
                }
                continue;
            }
            match cells[..] {
                [] => continue,
                [left, right] => self.touching.push((left, right)),
                _ if is_curve => self.bounding.push((ends[0], ends[1])),
                _ => {}
            }
            self.euler -= 1;
        }
    }
    fn add_ends(&mut self, t: &Named<'_>, side: Side) {
        let [mut before, last] = side.corners();
        let points = t.along(side).filter(is_point);
        for (number, next) in points.chain([last]).enumerate() {
            let interval = RegionPiece::Interval(side, number);
            self.side_ends.insert(interval, (before, next));
            before = next;
        }
    }

    fn finish(mut self) -> RegionTopology {
        for place in &self.on_sides {
            match place {
                RegionPiece::Point(..) | RegionPiece::Corner(_) => self.euler += 1,
                RegionPiece::Interval(..) => self.euler -= 1,
                RegionPiece::Cell(..) | RegionPiece::Inner(..) => {}
            }
        }
        // A side with the region on one side only belongs to the boundary.
        for (place, triangles) in &self.side_cells {
            if triangles.count_ones() == 1
                && let Some(&ends) = self.side_ends.get(place)
            {
                self.bounding.push(ends);
            }
        }
        let alone = self.cells.iter().map(|&c| (c, c));
        RegionTopology {
            euler: self.euler,
            components: groups(self.touching.iter().copied().chain(alone)),
            loops: groups(self.bounding.iter().copied()),
        }
    }
}

/// Returns the number of connected components of a graph, given by its edges.
fn groups(edges: impl Iterator<Item = (RegionPiece, RegionPiece)>) -> usize {
    let mut numbers: BTreeMap<RegionPiece, u32> = BTreeMap::new();
    let mut sets = UnionFind::default();
    for (a, b) in edges {
        let [a, b] = [a, b].map(|p| *numbers.entry(p).or_insert_with(|| sets.add()));
        sets.unite(a, b);
    }
    sets.count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::Map;
    use isoform_algebra::{Poly, RBig};
    use isoform_control::Control;

    fn topology(texts: [&str; 4], half_width: &str) -> [i64; 3] {
        let map = Map::parse(texts, Default::default()).expect("a map");
        let half_width = Poly::parse(half_width, &[])
            .expect("a number")
            .as_constant()
            .expect("a number");
        let t = Region::new(&map, &half_width, &[], &Control::default())
            .expect("a region")
            .topology();
        [t.euler, t.components as i64, t.loops as i64]
    }

    #[test]
    fn planes_and_spheres() {
        assert_eq!(topology(["s", "t", "0", "1"], "1"), [1, 1, 1], "a square");
        assert_eq!(
            topology(["s", "t", "s + t", "1"], "1"),
            [1, 1, 1],
            "a hexagon"
        );
        assert_eq!(
            topology(["2*s", "2*t", "s^2 + t^2 - 1", "s^2 + t^2 + 1"], "2"),
            [1, 1, 0],
            "the whole projective plane"
        );
        let sphere = ["4*s", "4*t", "2*s^2 + 2*t^2 - 2", "s^2 + t^2 + 1"];
        assert_eq!(
            topology(sphere, "1"),
            [0, 0, 0],
            "a sphere of radius 2 around the box"
        );
        assert_eq!(topology(sphere, "3/2"), [-4, 1, 6], "the caps cut off");
        assert_eq!(
            topology(sphere, "5/4"),
            [8, 8, 8],
            "only what is near the diagonals of the box is left"
        );
    }

    /// Maps without real base points, whose topology is known from an independent count.
    #[test]
    fn regions_of_the_zoo() {
        let mut compared = 0;
        for file in isoform_testdata::files("zoo", "json") {
            let text = std::fs::read_to_string(&file).expect("readable");
            let known: serde_json::Value = serde_json::from_str(&text).expect("JSON");
            let counted = &known["box_topology_normalised"];
            let Some(true) = counted["stable"].as_bool() else {
                continue;
            };
            let read = isoform_io::read_map(&text).expect("a file of a map");
            let map = Map::new(read.polynomials, Default::default()).expect("a map");
            let half_width = RBig::from(known["box"].as_i64().expect("a number"));
            let t = Region::new(&map, &half_width, &[], &Control::default())
                .expect("a region")
                .topology();
            let expected = ["chi", "components", "boundary_loops"]
                .map(|k| counted[k].as_i64().expect("a number"));
            assert_eq!(
                [t.euler, t.components as i64, t.loops as i64],
                expected,
                "{}",
                file.display()
            );
            compared += 1;
        }
        assert!(compared >= 11, "{compared} regions compared");
    }
}
