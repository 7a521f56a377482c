//! Places where rays and arcs leave the rectangles around base points.

use super::Openings;
use super::site::{Site, SiteArc};
use crate::fan::{Direction, Fan, Sector};
use crate::mesh::geometry::distance;
use crate::mesh::names::Ray;
use crate::surface::Point3;
use isoform_geom::distance_to_segment;

/// Distances on a ray of an infinitely near point between which its end on the rectangle is
/// searched for.
const REACHES: [f64; 2] = [1e-6, 1e6];

/// Ray of a base point in a unit triangle.
#[derive(Clone, Copy)]
pub(in crate::mesh) struct RayIn<'a> {
    open: &'a Openings<'a>,
    fan: &'a Fan,
    site: &'a Site,
    q: usize,
    d: &'a Direction,
    backward: bool,
}

impl<'a> RayIn<'a> {
    fn name(&self) -> Ray {
        (self.d.key(), self.backward)
    }
    /// Returns the arcs that are tangent to the ray.
    fn arcs(&self) -> impl Iterator<Item = &'a SiteArc> {
        let name = self.name();
        self.site.arcs.iter().filter(move |x| x.ray == name)
    }
    /// Returns half the width and half the height of the rectangle.
    fn size(&self) -> [f64; 2] {
        [self.open.widths[self.site.fan], self.site.height]
    }
    /// Returns the point of the ray at a distance from its node.
    pub(super) fn at(&self, distance: f64) -> Option<[f64; 2]> {
        self.fan.on_ray(self.q, self.d, self.backward, distance)
    }

    /// Returns the vertices of the rectangle in the direction of the ray, counterclockwise, if that
    /// leads into the unit triangle: the ends of the arcs that have this tangent, vertices that
    /// separate double ones, and the place on a side along it.
    pub(in crate::mesh) fn vertices(&self) -> Vec<[f64; 2]> {
        let mut found: Vec<[f64; 2]> = self.arcs().map(|x| x.end).collect();
        if found.is_empty() || self.fan.is_side(self.d) {
            found.extend(self.end());
        }
        // They span less than half a turn.
        let base = self.site.at;
        found.sort_by(|a, b| {
            let [x, y] = [a, b].map(|p| [p[0] - base[0], p[1] - base[1]]);
            0.0f64.total_cmp(&(x[0] * y[1] - x[1] * y[0]))
        });
        self.with_vertices_between_double(found)
    }
    /// Inserts a vertex between two arcs of the double curve with one tangent: an edge from one to
    /// the other could occur on another sheet, too.
    fn with_vertices_between_double(&self, ends: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
        let is_double = |at: [f64; 2]| {
            let mut arcs = self.site.arcs.iter();
            arcs.any(|x| x.end == at && self.open.curves.double.contains(&x.curve))
        };
        let mut found: Vec<[f64; 2]> = Vec::with_capacity(ends.len());
        for at in ends {
            if let Some(&last) = found.last()
                && is_double(last)
                && is_double(at)
            {
                found.push([0, 1].map(|i| 0.5 * (last[i] + at[i])));
            }
            found.push(at);
        }
        found
    }

    /// Returns the place where the ray leaves the rectangle.
    pub(super) fn end(&self) -> Option<[f64; 2]> {
        if self.d.node > 0 && !self.fan.is_side(self.d) {
            return self.at(self.reach()?);
        }
        Some(self.straight_end(self.direction()?))
    }
    /// Returns the direction in the unit triangle; `None` if the ray is bent there.
    fn direction(&self) -> Option<[f64; 2]> {
        let [u, v] = self.site.at;
        let [du, dv] = match self.d.node {
            0 => self.fan.direction_in(self.q, self.d, self.backward)?,
            _ => {
                // Direction, from an infinitely near point, along a side of the unit triangle.
                let x = self.at(1e-3)?;
                [x[0] - u, x[1] - v]
            }
        };
        // Along the side w = 0 up to rounding.
        let is_along_side = du != 0.0 && u + v == 1.0 && (du + dv).abs() < 1e-15;
        Some([du, if is_along_side { -du } else { dv }])
    }
    /// Returns the place where a straight ray leaves the rectangle: exactly on a side of the unit
    /// triangle if the ray lies on it.
    fn straight_end(&self, [du, dv]: [f64; 2]) -> [f64; 2] {
        let ([u, v], [h, height]) = (self.site.at, self.size());
        if du.abs() * height >= h * dv.abs() {
            let x = if du > 0.0 { u + h } else { u - h };
            let is_along_side = dv == -du && u + v == 1.0;
            let y = if is_along_side {
                1.0 - x
            } else {
                v + dv * (h / du.abs())
            };
            [x, y]
        } else {
            let y = if dv > 0.0 { v + height } else { v - height };
            [u + du * (height / dv.abs()), y]
        }
    }

    /// Returns the length, in its rectangle, of a ray of an infinitely near point.
    pub(super) fn reach(&self) -> Option<f64> {
        let (at, [h, height]) = (self.site.at, self.size());
        let is_out = |distance: f64| {
            self.at(distance)
                .is_none_or(|x| (x[0] - at[0]).abs() > h || (x[1] - at[1]).abs() > height)
        };
        self.fan.beginning(self.q, self.d, self.backward)?;
        let [least, most] = REACHES;
        let mut hi = least;
        while !is_out(hi) && hi < most {
            hi *= 1.5;
        }
        let mut lo = hi / 1.5;
        // Bisection to rounding.
        for _ in 0..60 {
            let middle = 0.5 * (lo + hi);
            if is_out(middle) {
                hi = middle
            } else {
                lo = middle
            }
        }
        (hi > least).then_some(lo)
    }
    /// Returns the midpoint of the ray from the base point to a vertex of the rectangle.
    pub(super) fn halfway(&self, end: [f64; 2]) -> [f64; 2] {
        let at = self.site.at;
        let straight = [0.5 * (at[0] + end[0]), 0.5 * (at[1] + end[1])];
        if self.d.node == 0 || self.fan.is_side(self.d) {
            return straight;
        }
        self.reach()
            .and_then(|r| self.at(0.5 * r))
            .unwrap_or(straight)
    }

    /// Returns points of the surface between a vertex of the rectangle and the seam, starting at
    /// the rectangle, where base points are infinitely near: rectangles cannot be small in space
    /// there.
    pub(in crate::mesh) fn points_to_seam(&self, at: [f64; 2]) -> Vec<Point3> {
        let arc = self.arcs().find(|x| x.end == at);
        let face = arc.and_then(|x| self.open.atlas.region.faces[x.curve].first().copied());
        let x = self.fan.lifted(self.q, at, self.d.node);
        let toward = self.d.signed(self.backward);
        let reach = (0..2).map(|i| x[i] * toward[i]).sum::<f64>();
        if !self.fan.is_tree()
            || self.arcs().count() > 1
            || (arc.is_some() && face.is_none())
            || !(reach > 0.0 && reach.is_finite())
        {
            return Vec::new();
        }
        let on = |t: f64| {
            self.fan
                .image_on_ray(self.d, self.backward, t * reach, face)
        };
        let faces = arc.map_or(0, |x| self.open.atlas.bits(x.curve));
        let first = self.open.atlas.image(self.q, at, faces);
        self.open.halved(&on, [first, self.fan.seam(self.d)])
    }
}

impl Openings<'_> {
    pub(in crate::mesh) fn ray<'a>(
        &'a self,
        q: usize,
        site: &'a Site,
        d: &'a Direction,
        backward: bool,
    ) -> RayIn<'a> {
        RayIn {
            open: self,
            fan: &self.fans[site.fan],
            site,
            q,
            d,
            backward,
        }
    }

    /// Returns points of a curve strictly between its ends at 1 and at 0, in this order, until
    /// chords between them are near the curve.
    fn halved(&self, on: &dyn Fn(f64) -> Point3, [first, last]: [Point3; 2]) -> Vec<Point3> {
        let mut found = Vec::new();
        let mut stack = vec![(1.0, first, 0.0, last, 0)];
        while let Some((a, p, b, r, depth)) = stack.pop() {
            let quarters = [0.75, 0.5, 0.25].map(|t| on(b + t * (a - b)));
            let off = quarters
                .iter()
                .map(|&x| distance_to_segment(x, [p, r]))
                .fold(0.0, f64::max);
            let is_rough = off > 0.3 * self.atlas.tolerance_at(p)
                || distance(p, r) > self.atlas.options.longest;
            // Rays between a rectangle and a seam are bisected at most twelve times.
            if depth < 12 && is_rough {
                let (m, middle) = (0.5 * (a + b), quarters[1]);
                stack.extend([(m, middle, b, r, depth + 1), (a, p, m, middle, depth + 1)]);
            } else if b > 0.0 {
                found.push(r);
            }
        }
        found
    }

    /// Returns the two vertices between which a sector lies in a unit triangle.
    pub(in crate::mesh) fn sector_ends(
        &self,
        q: usize,
        site: &Site,
        fan: &Fan,
        sector: &Sector,
    ) -> Option<[[f64; 2]; 2]> {
        let [first, second] = sector.rays.map(|(k, backward)| {
            let d = &fan.directions[k];
            let begins = fan.beginning(q, d, backward);
            begins.map(|_| self.ray(q, site, d, backward).vertices())
        });
        let (first, second) = (first?, second?);
        let ends = if fan.keeps_turn(q) {
            (first.last(), second.first())
        } else {
            (first.first(), second.last())
        };
        Some([*ends.0?, *ends.1?])
    }
}
