//! Rings of vertices on successively larger rectangles around base points.
//!
//! On small circles the map turns along the seam as fast as on the seam itself: triangles that lead
//! straight from there to distant vertices would be too thin.

use super::Openings;
use super::site::Site;
use crate::fan::{Fan, Sector};
use crate::mesh::geometry::distance;
use crate::surface::Point3;
use std::collections::BTreeMap;

/// Ratio of successive rectangles that are tried.
const RING_GROWTH_FACTOR: f64 = 1.5;

/// Vertex of a ring, and the places to which edges lead from it: the vertices next to it on its own
/// ring and on the previous one, along the rays.
pub(in crate::mesh) struct RingVertex {
    pub(in crate::mesh) at: [f64; 2],
    pub(in crate::mesh) legs: Vec<[f64; 2]>,
}

/// Vertices on one rectangle: one for each sector, with the index of the sector.
struct Ring {
    /// True if vertices lie between the directions, as on every second ring: collinear vertices
    /// would leave no room for flips.
    is_between: bool,
    vertices: Vec<(usize, [f64; 2], Point3)>,
}

impl Ring {
    fn places(&self) -> BTreeMap<usize, [f64; 2]> {
        self.vertices.iter().map(|x| (x.0, x.1)).collect()
    }
    fn images(&self) -> BTreeMap<usize, Point3> {
        self.vertices.iter().map(|x| (x.0, x.2)).collect()
    }
    /// Returns true if the median distance from the previous ring exceeds that between successive
    /// vertices, in space, so that triangles in between are round.
    fn is_far_from(&self, last: &BTreeMap<usize, Point3>) -> bool {
        let steps = self.vertices.windows(2);
        let along = median(steps.map(|w| distance(w[0].2, w[1].2)).collect());
        let to_last = |(s, _, p): &(usize, [f64; 2], Point3)| Some(distance(*last.get(s)?, *p));
        let across = median(self.vertices.iter().filter_map(to_last).collect());
        across
            .zip(along)
            .is_none_or(|(across, along)| across > along)
    }
}

fn median(mut x: Vec<f64>) -> Option<f64> {
    x.sort_by(f64::total_cmp);
    x.get(x.len() / 2).copied()
}

/// Base point in a unit triangle, with its fan.
#[derive(Clone, Copy)]
struct Center<'a> {
    open: &'a Openings<'a>,
    q: usize,
    site: &'a Site,
    fan: &'a Fan,
}

impl<'a> Center<'a> {
    /// Returns the index of the sector before another one.
    fn before(&self, s: usize) -> usize {
        (s + self.fan.sectors.len() - 1) % self.fan.sectors.len()
    }
    /// Returns true if a sector begins with an interior direction that belongs to neither a curve
    /// nor a side.
    fn begins_inside(&self, s: usize) -> bool {
        let d = &self.fan.directions[self.fan.sectors[s].rays[0].0];
        self.fan.sectors[self.before(s)].inside && d.factors.is_empty() && !self.fan.is_side(d)
    }
    /// Returns the place of a sector on the rectangle enlarged by a factor.
    fn place(&self, sector: &Sector, is_between: bool, scale: f64) -> Option<[f64; 2]> {
        let (k, backward) = sector.rays[0];
        let (d, backward) = match is_between {
            true => self.fan.between(sector, 0),
            false => (self.fan.directions[k].clone(), backward),
        };
        let ray = self.open.ray(self.q, self.site, &d, backward);
        match d.node {
            0 => {
                let (at, base) = (ray.end()?, self.site.at);
                Some([0, 1].map(|i| base[i] + scale * (at[i] - base[i])))
            }
            _ => ray.at(scale * ray.reach()?),
        }
    }
    /// Returns the vertices on a rectangle in the interior of the unit triangle.
    fn ring(&self, is_between: bool, scale: f64) -> Ring {
        let mut vertices = Vec::new();
        for (s, sector) in self.fan.sectors.iter().enumerate() {
            if sector.inside
                && (is_between || self.begins_inside(s))
                && let Some(at) = self.place(sector, is_between, scale)
                && at[0] > 0.0
                && at[1] > 0.0
                && at[0] + at[1] < 1.0
            {
                vertices.push((s, at, self.open.atlas.charts[self.q].at(at)));
            }
        }
        Ring {
            is_between,
            vertices,
        }
    }
    /// Returns a ring with the edges to it and to the previous one; `inner` is `None` for the base
    /// point's own rectangle.
    fn joined(
        &self,
        ring: &'a Ring,
        inner: Option<&'a BTreeMap<usize, [f64; 2]>>,
    ) -> impl Iterator<Item = RingVertex> {
        let here = ring.places();
        ring.vertices.iter().map(move |&(s, at, _)| {
            let sector = &self.fan.sectors[s];
            // Rays of infinitely near points.
            if sector
                .rays
                .iter()
                .any(|r| self.fan.directions[r.0].node > 0)
            {
                let legs = Vec::new();
                return RingVertex { at, legs };
            }
            // Neighbours on the inner ring: on its two rays, or between the rays on either side.
            let beside = match ring.is_between {
                true => [s, (s + 1) % self.fan.sectors.len()],
                false => [self.before(s), s],
            };
            let mut legs: Vec<[f64; 2]> = match inner {
                Some(inner) => beside
                    .iter()
                    .filter_map(|s| inner.get(s).copied())
                    .collect(),
                None => self
                    .open
                    .sector_ends(self.q, self.site, self.fan, sector)
                    .map_or_else(Vec::new, |ends| ends.to_vec()),
            };
            legs.extend(here.get(&self.before(s)));
            RingVertex { at, legs }
        })
    }
    /// Adds all rings on rectangles up to a size.
    fn rings(&self, largest: f64, found: &mut Vec<RingVertex>) {
        let mut last = self.ring(false, 1.0).images();
        let mut inner: Option<BTreeMap<usize, [f64; 2]>> = None;
        let mut is_between = true;
        let mut scale = RING_GROWTH_FACTOR;
        while scale * self.site.height < largest {
            let ring = self.ring(is_between, scale);
            if ring.is_far_from(&last) {
                found.extend(self.joined(&ring, inner.as_ref()));
                (last, inner) = (ring.images(), Some(ring.places()));
                is_between = !is_between;
            }
            scale *= RING_GROWTH_FACTOR;
        }
    }
}

impl Openings<'_> {
    /// Returns vertices around base points, in all their directions. On a long rectangle, the
    /// nearest ones lie next to the rays.
    pub(in crate::mesh) fn rings_around(&self, q: usize) -> Vec<RingVertex> {
        let mut found = Vec::new();
        for (_, site) in self.sites_in(q) {
            let apart = |other: &Site| {
                let [u, v] = [0, 1].map(|i| (other.at[i] - site.at[i]).abs());
                u.max(v)
            };
            let nearest = self
                .sites_in(q)
                .filter(|s| s.1.at != site.at)
                .map(|s| apart(s.1))
                .fold(1.0, f64::min);
            let center = Center {
                open: self,
                q,
                site,
                fan: &self.fans[site.fan],
            };
            // Rectangles are tried up to 0.4 of the distance from the nearest other base point.
            center.rings(0.4 * nearest, &mut found);
        }
        found
    }
}
