//! Where rays and arcs leave the rectangles around base points.

use super::Openings;
use super::site::Site;
use crate::fan::{Direction, Fan, Sector};
use crate::mesh::geometry::distance;
use crate::surface::Point3;
use isoform_geom::distance_to_segment;

impl Openings<'_> {
    /// The vertices of the rectangle in a direction, if that leads into the unit triangle,
    /// counterclockwise: the ends of the arcs that have this tangent, what keeps double ones apart,
    /// and the place on a side along it.
    pub(in crate::mesh) fn ring(
        &self,
        q: usize,
        site: &Site,
        d: &Direction,
        backward: bool,
    ) -> Vec<[f64; 2]> {
        let mut found: Vec<[f64; 2]> = site
            .arcs
            .iter()
            .filter(|x| x.ray == (d.key(), backward))
            .map(|x| x.end)
            .collect();
        if found.is_empty() || self.fans[site.fan].is_side(d) {
            found.extend(self.straight(q, site, d, backward));
        }
        // They span less than half a turn.
        found.sort_by(|a, b| {
            let [x, y] = [a, b].map(|p| [p[0] - site.at[0], p[1] - site.at[1]]);
            0.0f64.total_cmp(&(x[0] * y[1] - x[1] * y[0]))
        });
        // Between two arcs of the double curve with one tangent no edge may lead from one to the
        // other: another sheet may have it, too.
        let is_double = |at: [f64; 2]| {
            site.arcs
                .iter()
                .any(|x| x.end == at && self.curves.double.contains(&x.curve))
        };
        for k in (1..found.len())
            .rev()
            .filter(|&k| is_double(found[k - 1]) && is_double(found[k]))
            .collect::<Vec<_>>()
        {
            found.insert(k, [0, 1].map(|i| 0.5 * (found[k - 1][i] + found[k][i])));
        }
        found
    }

    /// Where a ray leaves the rectangle.
    pub(super) fn straight(
        &self,
        q: usize,
        site: &Site,
        d: &Direction,
        backward: bool,
    ) -> Option<[f64; 2]> {
        let h = self.widths[site.fan];
        let fan = &self.fans[site.fan];
        if d.node > 0 && !fan.is_side(d) {
            return fan.on_ray(q, d, backward, self.reach(q, site, d, backward)?);
        }
        let [du, dv] = match d.node {
            0 => fan.direction_in(q, d, backward),
            // Along the side.
            _ => fan
                .on_ray(q, d, backward, 1e-3)
                .map(|x| [x[0] - site.at[0], x[1] - site.at[1]]),
        }?;
        let dv = if du != 0.0 && site.at[0] + site.at[1] == 1.0 && (du + dv).abs() < 1e-15 {
            -du
        } else {
            dv
        };
        let [u, v] = site.at;
        if du.abs() * site.height >= h * dv.abs() {
            let x = if du > 0.0 { u + h } else { u - h };
            let y = if dv == -du && u + v == 1.0 {
                1.0 - x
            } else {
                v + dv * (h / du.abs())
            };
            Some([x, y])
        } else {
            Some([
                u + du * (site.height / dv.abs()),
                if dv > 0.0 {
                    v + site.height
                } else {
                    v - site.height
                },
            ])
        }
    }

    /// How far a ray of an infinitely near point reaches in its rectangle.
    pub(super) fn reach(
        &self,
        q: usize,
        site: &Site,
        d: &Direction,
        backward: bool,
    ) -> Option<f64> {
        let (fan, h) = (&self.fans[site.fan], self.widths[site.fan]);
        let is_out = |distance: f64| {
            fan.on_ray(q, d, backward, distance).is_none_or(|x| {
                (x[0] - site.at[0]).abs() > h || (x[1] - site.at[1]).abs() > site.height
            })
        };
        fan.beginning(q, d, backward)?;
        let mut hi = 1e-6;
        while !is_out(hi) && hi < 1e6 {
            hi *= 1.5;
        }
        let mut lo = hi / 1.5;
        for _ in 0..60 {
            let middle = 0.5 * (lo + hi);
            if is_out(middle) {
                hi = middle
            } else {
                lo = middle
            }
        }
        (hi > 1e-6).then_some(lo)
    }

    /// Halfway on a ray from the base point to a vertex of the rectangle.
    pub(super) fn halfway(
        &self,
        q: usize,
        site: &Site,
        d: &Direction,
        backward: bool,
        end: [f64; 2],
    ) -> [f64; 2] {
        let fan = &self.fans[site.fan];
        let straight = [0.5 * (site.at[0] + end[0]), 0.5 * (site.at[1] + end[1])];
        if d.node == 0 || fan.is_side(d) {
            return straight;
        }
        self.reach(q, site, d, backward)
            .and_then(|r| fan.on_ray(q, d, backward, 0.5 * r))
            .unwrap_or(straight)
    }

    /// Points of the surface between a vertex of the rectangle and the seam, from the rectangle on,
    /// where base points are infinitely near: there is no room for rectangles that are small in
    /// space.
    pub(in crate::mesh) fn points_on_ray(
        &self,
        q: usize,
        site: &Site,
        fan: &Fan,
        d: &Direction,
        backward: bool,
        at: [f64; 2],
    ) -> Vec<Point3> {
        let key = (d.key(), backward);
        let arc = site.arcs.iter().find(|x| x.ray == key && x.end == at);
        let face = arc.and_then(|x| self.atlas.region.faces[x.curve].first().copied());
        let x = fan.lifted(q, at, d.node);
        let reach = (0..2).map(|i| x[i] * d.signed(backward)[i]).sum::<f64>();
        let drawn = site.arcs.iter().filter(|x| x.ray == key).count();
        if !fan.is_tree()
            || drawn > 1
            || (arc.is_some() && face.is_none())
            || !(reach > 0.0 && reach.is_finite())
        {
            return Vec::new();
        }
        let on = |t: f64| fan.image_on_ray(d, backward, t * reach, face);
        let first = self
            .atlas
            .image(q, at, arc.map_or(0, |x| self.atlas.bits(x.curve)));
        let mut found = Vec::new();
        let mut stack = vec![(1.0, first, 0.0, fan.seam(d), 0)];
        while let Some((a, p, b, r, depth)) = stack.pop() {
            let quarters = [0.75, 0.5, 0.25].map(|t| on(b + t * (a - b)));
            let off = quarters
                .iter()
                .map(|&x| distance_to_segment(x, [p, r]))
                .fold(0.0, f64::max);
            if depth < 12
                && (off > 0.3 * self.atlas.tolerance_at(p)
                    || distance(p, r) > self.atlas.options.longest)
            {
                let m = 0.5 * (a + b);
                stack.extend([
                    (m, quarters[1], b, r, depth + 1),
                    (a, p, m, quarters[1], depth + 1),
                ]);
            } else if b > 0.0 {
                found.push(r);
            }
        }
        found
    }

    /// The two vertices between which a sector lies in a unit triangle.
    pub(in crate::mesh) fn sector_ends(
        &self,
        q: usize,
        site: &Site,
        fan: &Fan,
        sector: &Sector,
    ) -> Option<[[f64; 2]; 2]> {
        let [first, second] = sector.rays.map(|(k, b)| {
            let d = &fan.directions[k];
            fan.beginning(q, d, b).map(|_| self.ring(q, site, d, b))
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
