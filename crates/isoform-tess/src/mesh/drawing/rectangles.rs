//! Drawing of base points with the rectangles around them.

use super::Drawing;
use crate::fan::{Direction, Fan};
use crate::mesh::names::{Name, Node, Ray, name_on};
use crate::mesh::opening::Site;
use crate::region::FOLD_BIT;
use spade::handles::FixedVertexHandle;

impl Drawing<'_> {
    /// Draws the triangles from base points to the edges of their rectangles.
    pub(super) fn draw_rectangles(&mut self) {
        let openings = self.glued.openings;
        for (&(_, k, p), site) in openings.sites_in(self.q) {
            let Some(&apex) = self.at_wall.get(&(k, p)) else {
                continue;
            };
            self.apexes.insert(apex.index(), site.fan);
            self.draw_rectangle(apex, site, &openings.fans[site.fan]);
        }
    }

    /// Draws the triangles between the arcs that share a ray.
    fn draw_ring_of_ray(
        &mut self,
        apex: FixedVertexHandle,
        site: &Site,
        d: &Direction,
        backward: bool,
    ) {
        let openings = self.glued.openings;
        let vertices = openings.ray(self.q, site, d, backward).vertices();
        let corners = vertices.into_iter();
        let corners = corners.map(|at| self.corner(site, at, (d.key(), backward)));
        let vertices: Vec<Option<FixedVertexHandle>> = corners.collect();
        for w in vertices.windows(2) {
            self.draw_triangle(apex, w[0], w[1]);
        }
    }
    fn draw_rectangle(&mut self, apex: FixedVertexHandle, site: &Site, fan: &Fan) {
        let (openings, q) = (self.glued.openings, self.q);
        for sector in fan.sectors.iter().filter(|s| s.inside) {
            let Some(ends) = openings.sector_ends(q, site, fan, sector) else {
                continue;
            };
            for (k, backward) in sector.rays {
                self.draw_ring_of_ray(apex, site, &fan.directions[k], backward);
            }
            let [a, b] = [0, 1].map(|i| {
                let (k, backward) = sector.rays[i];
                self.corner(site, ends[i], (fan.directions[k].key(), backward))
            });
            self.draw_triangle(apex, a, b);
        }
    }

    /// Draws the edges of a triangle at a base point, if its corners exist.
    fn draw_triangle(
        &mut self,
        apex: FixedVertexHandle,
        a: Option<FixedVertexHandle>,
        b: Option<FixedVertexHandle>,
    ) {
        if let (Some(a), Some(b)) = (a, b) {
            self.constraints.extend([[apex, a], [apex, b], [a, b]]);
        }
    }

    /// Returns the vertex of a rectangle where a ray leaves it, and records the ray.
    fn corner(&mut self, site: &Site, at: [f64; 2], ray: Ray) -> Option<FixedVertexHandle> {
        let (atlas, q) = (self.glued.atlas, self.q);
        let name = if at[0] == 0.0 {
            name_on(q, 0, at[1])
        } else if at[1] == 0.0 {
            name_on(q, 1, at[0])
        } else if at[1] == 1.0 - at[0] && site.at[0] + site.at[1] == 1.0 {
            name_on(q, 2, at[0])
        } else {
            Name::Inner
        };
        let arc = site.arcs.iter().find(|x| x.ray == ray && x.end == at);
        let faces = arc.map_or(0, |x| atlas.bits(x.curve));
        let image = arc.and_then(|x| self.glued.curves.nearest_image(q, x.curve, at));
        let is_fold = match name {
            Name::Side(side, ..) => atlas.region.is_fold_side(side),
            _ => arc.is_some_and(|x| atlas.region.is_fold(x.curve)),
        };
        let v = self.vertex(Node {
            name,
            image,
            borders: if is_fold { FOLD_BIT } else { 0 },
            ..Node::inner(at, faces)
        })?;
        self.rays.insert((v.index(), site.fan), ray);
        Some(v)
    }
}
