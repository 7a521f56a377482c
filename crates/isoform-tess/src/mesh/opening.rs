//! Where base points are opened: rectangles around them whose vertices lie in the directions of their fans.
//!
//! A triangle with a base point as corner becomes a quadrilateral, whose fourth side is a piece of the seam curve.

use super::{Builder, Name, Site, contracted_curves, distance, middle};
use crate::analysis::Analysis;
use crate::base::BasePoint;
use crate::fan::{Direction, Fan};
use crate::map::Map;
use crate::surface::Point3;
use isoform_algebra::{Poly, RBig};

/// Largest half width of a rectangle, halvings of it, and directions of a base point.
const WIDTH: f64 = 1.0 / 16.0;
const HALVINGS: usize = 30;
const DIRECTIONS: usize = 2000;

impl Builder<'_> {
    pub(super) fn find_contracted(&mut self, map: &Map, analysis: &Analysis) {
        for side in 0..3 {
            let on: [Poly; 4] = map.forms().each_ref().map(|f| f.set(side, &RBig::ZERO));
            let rest: Vec<&Poly> = on.iter().filter(|f| !f.is_zero()).collect();
            if rest.windows(2).all(|w| w[0].is_associate(w[1])) {
                let [x, y, z, w] = on.each_ref().map(|f| f.leading_coefficient().to_f64().value());
                let image = self.image_of([x / w, y / w, z / w]);
                self.on_side[side] = Some(image);
            }
        }
        for (k, (_, images)) in contracted_curves(analysis).enumerate() {
            let images: Vec<usize> = images.into_iter().map(|p| self.image_of(p)).collect();
            for &f in &self.region.extra[k] {
                self.on_curve.entry(f).or_default().extend(&images);
            }
        }
    }
    /// The number of an image.
    fn image_of(&mut self, p: Point3) -> usize {
        let known = self.images.iter().position(|&q| distance(p, q) <= 1e-12 * self.half_width);
        known.unwrap_or_else(|| {
            self.images.push(p);
            self.images.len() - 1
        })
    }

    /// Finds the base points in the region and the rectangles around them.
    pub(super) fn open_base_points(&mut self, points: &[BasePoint]) {
        self.fans = points.iter().map(|p| Fan::new(p, self.region)).collect();
        let mut problems = Vec::new();
        for (q, t) in self.region.triangles.iter().enumerate() {
            for (k, wall) in t.arrangement.walls.iter().enumerate() {
                for p in 0..wall.points.len() {
                    if !t.holds_point(k, p) || self.faces_at(q, k, p) != 0b11_1111 {
                        continue;
                    }
                    let at = self.place(q, k, p);
                    let near = |f: &Fan| f.place(q).is_some_and(|x| (x[0] - at[0]).hypot(x[1] - at[1]) < 1e-9);
                    match self.fans.iter().position(near) {
                        Some(fan) => match &self.fans[fan].problem {
                            Some(problem) => problems.push(problem.clone()),
                            None => {
                                self.sites.insert((q, k, p), Site { fan, at, height: 0.0, arcs: Vec::new() });
                            }
                        },
                        None => problems.push("a base point was not recognised and is left open".to_owned()),
                    }
                }
            }
        }
        if !self.sites.is_empty() {
            self.match_arcs(&mut problems);
            self.width = WIDTH;
            let mut done = false;
            for _ in 0..HALVINGS {
                if (self.stop)() {
                    break;
                }
                if self.fit_rectangles() && self.refine_directions() {
                    done = true;
                    break;
                }
                self.width *= 0.5;
            }
            if !done {
                problems.push("the surface next to base points is not near enough to it, or W may change its sign there".to_owned());
            }
        }
        self.surface.unproven.extend(problems);
    }

    /// The directions in which the drawn arcs leave base points; each has to have as many arcs as its curve has branches.
    fn match_arcs(&mut self, problems: &mut Vec<String>) {
        let mut count = std::collections::BTreeMap::new();
        let keys: Vec<(usize, usize, usize)> = self.sites.keys().copied().collect();
        for (q, k, p) in keys {
            let a = &self.region.triangles[q].arrangement;
            let site = &self.sites[&(q, k, p)];
            let fan = &self.fans[site.fan];
            let mut arcs = Vec::new();
            for (slab, right) in [(k.wrapping_sub(1), false), (k, true)] {
                if slab >= a.slabs.len() {
                    continue;
                }
                let width = a.walls[slab + 1].u.to_f64() - a.walls[slab].u.to_f64();
                let step = 1e-7f64.min(0.25 * width);
                let u = if right { site.at[0] + step } else { site.at[0] - step };
                let ends_here: Vec<usize> =
                    self.drawn(q, slab).into_iter().filter(|&i| if right { a.slabs[slab].arcs[i].left == p } else { a.slabs[slab].arcs[i].right == p }).collect();
                if ends_here.is_empty() {
                    continue;
                }
                let over = RBig::try_from(u).map(|u| a.arcs_over(slab, &u)).unwrap_or_default();
                for i in ends_here {
                    let curve = a.slabs[slab].arcs[i].curve;
                    let Some(&v) = over.get(i) else { continue };
                    let (d, backward) = fan.toward(q, [u, v]);
                    let off = |e: &Direction| (e.at[0] * d.at[1] - e.at[1] * d.at[0]).abs();
                    let mine = fan.directions.iter().filter(|e| e.factors.contains(&curve));
                    let Some(e) = mine.min_by(|x, y| off(x).total_cmp(&off(y))).filter(|e| off(e) < 0.2) else {
                        problems.push("an arc's tangent in a base point was not found".to_owned());
                        continue;
                    };
                    // The same direction up to sign may be named by its opposite.
                    let same = e.at[0] * d.at[0] + e.at[1] * d.at[1] > 0.0;
                    let ray = (e.key(), backward == same);
                    *count.entry((site.fan, ray)).or_insert(0usize) += 1;
                    arcs.push((slab, i, ray));
                }
            }
            self.sites.get_mut(&(q, k, p)).expect("a site").arcs = arcs;
        }
        for site in self.sites.values() {
            let fan = &self.fans[site.fan];
            for (k, d) in fan.directions.iter().enumerate() {
                let before = fan.inside[(k + fan.inside.len() - 1) % fan.inside.len()];
                let expected = match (before, fan.inside[k]) {
                    (true, true) => d.factors.iter().filter(|f| self.region.faces[**f].is_empty()).count(),
                    (false, false) => 0,
                    _ => 1,
                };
                if fan.is_side(d) {
                    continue;
                }
                for backward in [false, true] {
                    if count.get(&(site.fan, (d.key(), backward))).copied().unwrap_or(0) != expected {
                        problems.push("arcs and tangents in a base point do not agree".to_owned());
                    }
                }
            }
        }
    }

    /// Heights of the rectangles for their width; whether they hold nothing but what ends in their base points.
    fn fit_rectangles(&mut self) -> bool {
        let h = self.width;
        let mut heights = vec![h; self.fans.len()];
        let mut columns = std::collections::BTreeMap::new();
        for (&(q, k, p), site) in &self.sites {
            let a = &self.region.triangles[q].arrangement;
            for (slab, right) in [(k.wrapping_sub(1), false), (k, true)] {
                if slab >= a.slabs.len() {
                    continue;
                }
                if a.walls[slab + 1].u.to_f64() - a.walls[slab].u.to_f64() < 3.0 * h {
                    return false;
                }
                let u = if right { site.at[0] + h } else { site.at[0] - h };
                let over = RBig::try_from(u).map(|u| a.arcs_over(slab, &u)).unwrap_or_default();
                for &(s, i, _) in site.arcs.iter().filter(|x| x.0 == slab) {
                    debug_assert_eq!(s, slab);
                    heights[site.fan] = heights[site.fan].max(1.25 * (over[i] - site.at[1]).abs());
                }
                columns.insert((q, k, p, right), (slab, over));
            }
        }
        for (&(q, k, p), site) in &mut self.sites {
            site.height = heights[site.fan];
            let a = &self.region.triangles[q].arrangement;
            let points = &a.walls[k].points;
            let beside = [p.checked_sub(1), Some(p + 1).filter(|&p| p < points.len())];
            for p in beside.into_iter().flatten() {
                let v = if p + 1 == points.len() { 1.0 - site.at[0] } else { points[p].lo.to_f64().value() };
                if (v - site.at[1]).abs() < 2.0 * site.height {
                    return false;
                }
            }
            for right in [false, true] {
                let Some((slab, over)) = columns.get(&(q, k, p, right)) else { continue };
                for (i, arc) in a.slabs[*slab].arcs.iter().enumerate() {
                    let ends_here = if right { arc.left == p } else { arc.right == p };
                    if !ends_here && (over[i] - site.at[1]).abs() < 1.2 * site.height {
                        return false;
                    }
                }
            }
        }
        true
    }

    /// The vertex of the rectangle in a direction, if that leads into the unit triangle.
    pub(super) fn ring(&self, q: usize, site: &Site, d: &Direction, backward: bool) -> Option<[f64; 2]> {
        let h = self.width;
        if let Some(&(slab, i, _)) = site.arcs.iter().find(|x| x.2 == (d.key(), backward)) {
            let a = &self.region.triangles[q].arrangement;
            let right = a.walls[slab].u.to_f64() == site.at[0];
            let u = if right { site.at[0] + h } else { site.at[0] - h };
            let over = RBig::try_from(u).map(|u| a.arcs_over(slab, &u)).ok()?;
            return Some([u, over[i]]);
        }
        let [du, dv] = self.fans[site.fan].direction_in(q, d, backward)?;
        let [u, v] = site.at;
        if du.abs() * site.height >= h * dv.abs() {
            let x = if du > 0.0 { u + h } else { u - h };
            let y = if dv == -du && u + v == 1.0 { 1.0 - x } else { v + dv * (h / du.abs()) };
            Some([x, y])
        } else {
            Some([u + du * (site.height / dv.abs()), if dv > 0.0 { v + site.height } else { v - site.height }])
        }
    }

    /// Vertices on larger and larger rectangles around base points, in all their directions: the map turns along the seam as fast as ever on
    /// small circles, and triangles that lead straight from there to far vertices would be too thin.
    pub(super) fn rings_around(&self, q: usize) -> Vec<[f64; 2]> {
        let mut found = Vec::new();
        let here: Vec<&Site> = self.sites.range((q, 0, 0)..(q + 1, 0, 0)).map(|s| s.1).collect();
        for site in &here {
            let fan = &self.fans[site.fan];
            let apart = |other: &&&Site| (other.at[0] - site.at[0]).abs().max((other.at[1] - site.at[1]).abs());
            let nearest = here.iter().filter(|s| s.at != site.at).map(|s| apart(&s)).fold(1.0, f64::min);
            let mut scale = 2.0;
            while scale * site.height.max(self.width) < 0.4 * nearest {
                for (k, d) in fan.directions.iter().enumerate() {
                    let before = fan.inside[(k + fan.inside.len() - 1) % fan.inside.len()];
                    if !(fan.inside[k] && before) || !d.factors.is_empty() || fan.is_side(d) {
                        continue;
                    }
                    for backward in [false, true] {
                        if let Some(at) = self.ring(q, site, d, backward) {
                            let at: [f64; 2] = std::array::from_fn(|i| site.at[i] + scale * (at[i] - site.at[i]));
                            if at[0] > 0.0 && at[1] > 0.0 && at[0] + at[1] < 1.0 {
                                found.push(at);
                            }
                        }
                    }
                }
                scale *= 2.0;
            }
        }
        found
    }

    /// The two rays of the sector after a direction, on either side of the base point.
    pub(super) fn sector(fan: &Fan, k: usize, backward: bool) -> [(usize, bool); 2] {
        let next = fan.next(k);
        let wraps = fan.directions[next].angle() < fan.directions[k].angle();
        [(k, backward), (next, backward != wraps)]
    }

    /// More directions, until seams and rectangles are near the surface and W keeps its sign. False if the rectangles are too large.
    fn refine_directions(&mut self) -> bool {
        let by_fan: Vec<Vec<(usize, &Site)>> =
            (0..self.fans.len()).map(|f| self.sites.iter().filter(|s| s.1.fan == f).map(|(key, s)| (key.0, s)).collect()).collect();
        let mut fans = Vec::new();
        for (f, sites) in by_fan.iter().enumerate() {
            let mut fan = self.fans[f].clone();
            if sites.is_empty() {
                fans.push(fan);
                continue;
            }
            let mut k = 0;
            let mut fresh = true;
            while k < fan.directions.len() {
                if !fan.inside[k] {
                    (k, fresh) = (k + 1, true);
                    continue;
                }
                let ends = [k, fan.next(k)].map(|k| fan.seam(&fan.directions[k]));
                let mut fine = self.is_near(fan.seam(&fan.between(k)), middle(ends[0], ends[1]), ends);
                for &(q, site) in sites {
                    for backward in [false, true] {
                        let rays = Self::sector(&fan, k, backward);
                        let ring = rays.map(|(k, b)| self.ring(q, site, &fan.directions[k], b));
                        let [Some(a), Some(b)] = ring else { continue };
                        let image = |x: [f64; 2]| self.charts[q].at(x);
                        let half = |a: [f64; 2], b: [f64; 2]| [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
                        if fresh {
                            for (end, at) in ends.iter().zip([a, b]) {
                                if !self.is_near(image(half(site.at, at)), middle(*end, image(at)), [*end, image(at)]) {
                                    return false;
                                }
                            }
                        }
                        fine &= self.is_near(image(half(a, b)), middle(image(a), image(b)), [image(a), image(b)]);
                        fine &= self.keeps_sign_from(q, [site.at, a, b], fan.multiplicity);
                    }
                }
                if fine {
                    (k, fresh) = (k + 1, true);
                } else if fan.directions.len() >= DIRECTIONS {
                    return false;
                } else {
                    // The first of all may have come before: it is looked at in the end, as nothing else has changed.
                    let at = fan.split(k);
                    k = if at == 0 { 0 } else { k };
                    fresh = true;
                }
            }
            fans.push(fan);
        }
        drop(by_fan);
        self.fans = fans;
        true
    }

    /// Whether the middle of a straight piece is near to the surface, and the piece short.
    fn is_near(&self, on: Point3, chord: Point3, ends: [Point3; 2]) -> bool {
        distance(on, chord) <= 0.5 * self.options.tolerance && distance(ends[0], ends[1]) <= self.options.longest
    }

    /// Whether W has one sign on a triangle with a base point as its first corner, the seam included.
    fn keeps_sign_from(&self, q: usize, at: [[f64; 2]; 3], multiplicity: usize) -> bool {
        let s = self.charts[q].signs;
        let corners = at.map(|[u, v]| [s[0] * u, s[1] * v, 1.0 - u - v]);
        let (lo, hi, error) = super::bernstein_range(&self.base, self.charts[q].degree, corners, multiplicity);
        lo > error || hi < -error
    }

    /// The vertex of a seam: its name, position and faces, and whether it is the image of a contracted curve.
    pub(super) fn seam_vertex(&self, fan: usize, d: &Direction) -> (Name, Point3, u8) {
        let f = &self.fans[fan];
        let p = f.seam(d);
        let mut images: Vec<usize> = d.factors.iter().filter_map(|f| self.on_curve.get(f)).flatten().copied().collect();
        images.extend(f.sides_along(d).filter_map(|side| self.on_side[side]));
        let near = |k: &usize| distance(self.images[*k], p) <= 1e-6 * self.half_width;
        match images.into_iter().find(near) {
            Some(k) => (Name::Image(k), self.images[k], 0),
            None => (Name::Seam(fan, d.key()), p, d.faces),
        }
    }

    /// The places of rectangles on a side that base points are on: the place of the base point, and those of the vertices.
    pub(super) fn places_on(&self, side: usize, quadrants: &[usize]) -> Vec<(f64, [f64; 2])> {
        let mut places: Vec<(f64, [f64; 2])> = Vec::new();
        for (&(q, _, _), site) in &self.sites {
            let [u, v] = site.at;
            let (on, x, step) = [(u == 0.0, v, site.height), (v == 0.0, u, self.width), (u + v == 1.0, u, self.width)][side];
            if quadrants.contains(&q) && on {
                places.push((x, [x - step, x + step]));
            }
        }
        places
    }
}
