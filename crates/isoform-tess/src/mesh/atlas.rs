//! The map on the four unit triangles of its parameters: queries of all stages about the region and
//! the map itself.

use super::chart::Chart;
use super::fineness::Fineness;
use super::geometry::{distance, middle};
use super::names::{Name, name_on};
use crate::map::Map;
use crate::region::Region;
use crate::surface::{MeshOptions, Point3};
use isoform_algebra::RBig;
use isoform_control::Control;

/// The region, the map in floating point on each unit triangle, and the requested fineness of its
/// triangles.
pub(super) struct Atlas<'a> {
    pub(super) region: &'a Region,
    pub(super) charts: [Chart; 4],
    pub(super) half_width: f64,
    pub(super) options: &'a MeshOptions,
    pub(super) fineness: &'a Fineness,
    pub(super) control: &'a Control<'a>,
}

impl<'a> Atlas<'a> {
    pub(super) fn new(
        map: &Map,
        region: &'a Region,
        options: &'a MeshOptions,
        fineness: &'a Fineness,
        control: &'a Control<'a>,
    ) -> Self {
        let half_width = region.half_width.to_f64().value();
        Self {
            region,
            charts: std::array::from_fn(|q| Chart::new(map, q, half_width)),
            half_width,
            options,
            fineness,
            control,
        }
    }
    /// Returns the faces of the box to which all curves through a point of a wall belong.
    pub(super) fn faces_at(&self, q: usize, wall: usize, point: usize) -> u8 {
        let a = &self.region.triangles[q].arrangement;
        let w = &a.walls[wall];
        let on = [wall == 0, point == 0, point + 1 == w.points.len()];
        let through = |f: usize| {
            w.points[point].curves.contains(&f)
                || w.vertical.contains(&f)
                || a.sides[f].iter().zip(on).any(|(side, on)| *side && on)
        };
        (0..self.region.factors.len())
            .filter(|&f| through(f))
            .fold(0, |bits, f| bits | self.bits(f))
    }
    /// Returns the faces of the box to which a whole side of a unit triangle is mapped.
    pub(super) fn faces_along(&self, q: usize, side: usize) -> u8 {
        let sides = &self.region.triangles[q].arrangement.sides;
        (0..self.region.factors.len())
            .filter(|&f| sides[f][side])
            .fold(0, |bits, f| bits | self.bits(f))
    }
    pub(super) fn bits(&self, factor: usize) -> u8 {
        self.region.faces[factor]
            .iter()
            .fold(0, |bits, face| bits | 1 << face)
    }
    pub(super) fn place(&self, q: usize, wall: usize, point: usize) -> [f64; 2] {
        let w = &self.region.triangles[q].arrangement.walls[wall];
        let u = w.u.to_f64();
        if point == 0 {
            return [u, 0.0];
        }
        if point + 1 == w.points.len() {
            return [u, 1.0 - u];
        }
        let p = &w.points[point];
        [u, ((&p.lo + &p.hi) / RBig::from(2)).to_f64().value()]
    }
    /// Returns the name of a point of a wall.
    pub(super) fn wall_name(&self, q: usize, wall: usize, point: usize) -> Name {
        let at = self.place(q, wall, point);
        let top = self.region.triangles[q].arrangement.walls[wall]
            .points
            .len()
            - 1;
        if wall == 0 {
            name_on(q, 0, at[1])
        } else if point == 0 {
            name_on(q, 1, at[0])
        } else if point == top {
            name_on(q, 2, at[0])
        } else {
            Name::Inner
        }
    }

    /// Returns the image of a point of a unit triangle, moved onto the faces of the box on which it
    /// is known to lie.
    pub(super) fn image(&self, q: usize, at: [f64; 2], faces: u8) -> Point3 {
        let mut p = self.charts[q].at(at);
        for face in (0..6).filter(|f| faces >> f & 1 == 1) {
            p[face / 2] = if face % 2 == 0 {
                -self.half_width
            } else {
                self.half_width
            };
        }
        p
    }

    /// Returns the maximum distance from the surface near a point.
    pub(super) fn tolerance_at(&self, p: Point3) -> f64 {
        self.options.tolerance * self.fineness.factor(p, self.half_width)
    }

    /// Returns true if a straight segment may replace a curve in space between two parameters.
    pub(super) fn is_fine(&self, at: &dyn Fn(f64) -> Point3, a: f64, b: f64) -> bool {
        let (p, q) = (at(a), at(b));
        let off = [0.25, 0.5, 0.75].map(|t| {
            let x: Point3 = std::array::from_fn(|i| p[i] + t * (q[i] - p[i]));
            distance(at(a + t * (b - a)), x)
        });
        // NaN is never fine.
        distance(p, q) <= self.options.longest
            && off
                .iter()
                .all(|&d| d <= 0.3 * self.tolerance_at(middle(p, q)))
    }

    pub(super) fn side_is_inside(&self, q: usize, side: usize, x: f64) -> bool {
        let t = &self.region.triangles[q];
        let walls = &t.arrangement.walls;
        if side == 0 {
            let p = (1..walls[0].points.len())
                .filter(|&p| self.place(q, 0, p)[1] < x)
                .count();
            return t.holds_segment(0, p);
        }
        let k = walls[1..walls.len() - 1]
            .iter()
            .filter(|w| w.u.to_f64() < x)
            .count();
        let cells = &t.inside[k];
        if side == 1 {
            cells[0]
        } else {
            cells[cells.len() - 1]
        }
    }
}
