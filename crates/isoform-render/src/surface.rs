//! Surfaces of triangles: meshes, and the triangles of patches, maps and solids.

use crate::bvh::{Bvh, TriangleHit};
use crate::camera::{Ray, along, unit};
use crate::color::{Color, Scale, part_color};
use crate::exact::{Exact, facet_normal};
use crate::section::Section;
use crate::shade;
use isoform::geom::{Aabb, Point3, dot, norm, sub};
use std::collections::HashMap;

/// Colouring of triangles.
#[derive(Clone, Debug)]
pub(crate) enum Paint {
    /// One colour for all.
    Plain(Color),
    /// One colour for each part.
    Parts(Vec<Color>),
    /// One colour for each part, in a chequered pattern by its parameters.
    Chequered(Vec<Color>),
    /// Values at the corners of each triangle, with their scale.
    Values(Vec<[f64; 3]>, Scale),
}

/// Sine of the smallest angle between a ray and a surface for which coincident surfaces are
/// recognised: their distance along a ray grows with the inverse of the sine.
pub(crate) const MIN_INCIDENCE_SINE: f64 = 0.1;

/// Triangles prepared for rays.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    pub(crate) points: Vec<Point3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Part of each triangle; empty if there is one part.
    pub(crate) parts: Vec<u32>,
    pub(crate) paint: Paint,
    /// Exact surface, and the parameters of the corners of each triangle.
    pub(crate) exact: Option<(Exact, Vec<[[f64; 2]; 3]>)>,
    /// Normals at the corners of triangles that represent smooth faces.
    pub(crate) normals: Vec<[Point3; 3]>,
    /// Rank of each triangle, and the largest distance at which surfaces count as coincident: of
    /// these the one with the highest rank is visible.
    pub(crate) ranks: (Vec<u32>, f64),
    /// Distance by which it may be behind another layer and still be visible: that layer's surface
    /// does not hide its own approximation.
    pub(crate) lift: f64,
    /// True if the edges of triangles are drawn.
    pub(crate) has_edges: bool,
    /// Boundary of the solid that caps of sections fill.
    pub(crate) lid: Lid,
    tree: Bvh,
}

/// Boundary of a solid.
#[derive(Clone, Debug)]
pub(crate) enum Lid {
    /// No solid: the surface is open.
    Open,
    /// The triangles themselves.
    Own,
    /// Cut through tetrahedra.
    Cut(Box<Surface>),
}

/// Intersection of a ray with a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OnSurface {
    pub(crate) t: f64,
    pub(crate) normal: Point3,
    pub(crate) part: u32,
    pub(crate) meeting: TriangleHit,
}

impl Surface {
    pub(crate) fn new(points: Vec<Point3>, triangles: Vec<[u32; 3]>, paint: Paint) -> Self {
        let tree = Bvh::new(&points, &triangles);
        Self {
            points,
            triangles,
            parts: Vec::new(),
            paint,
            exact: None,
            normals: Vec::new(),
            ranks: (Vec::new(), 0.0),
            lift: 0.0,
            has_edges: false,
            lid: Lid::Open,
            tree,
        }
    }

    /// Returns the box of all corners of triangles.
    pub(crate) fn bounds(&self) -> Aabb {
        let corners = self.triangles.as_flattened().iter();
        Aabb::from_points(corners.map(|i| &self.points[*i as usize]))
    }

    pub(crate) fn corners(&self, triangle: u32) -> [Point3; 3] {
        self.triangles[triangle as usize].map(|i| self.points[i as usize])
    }

    fn part(&self, triangle: u32) -> u32 {
        self.parts.get(triangle as usize).copied().unwrap_or(0)
    }

    /// Returns the first intersection of a ray with the part of the surface that a section leaves;
    /// `None` if there is none.
    pub(crate) fn meet(
        &self,
        ray: &Ray,
        range: [f64; 2],
        section: Option<&Section>,
    ) -> Option<OnSurface> {
        let (ranks, apart) = &self.ranks;
        // The nearest intersection, and those behind it that may belong to coincident surfaces.
        let mut nearest = f64::INFINITY;
        let mut near: Vec<TriangleHit> = Vec::new();
        self.tree
            .visit((&self.points, &self.triangles), ray, range, |m| {
                if section.is_none_or(|s| s.keeps(along(ray.o, ray.d, m.t))) {
                    nearest = nearest.min(m.t);
                    near.retain(|other| other.t <= nearest + apart / MIN_INCIDENCE_SINE);
                    near.push(m);
                }
                nearest + apart / MIN_INCIDENCE_SINE
            });
        let rank = |m: &TriangleHit| ranks.get(m.triangle as usize).copied().unwrap_or(0);
        let is_on = |m: &&TriangleHit| {
            let n = unit(facet_normal(self.corners(m.triangle)));
            m.t <= nearest + apart / dot(n, ray.d).abs().max(MIN_INCIDENCE_SINE)
        };
        // The highest rank first, then the nearest.
        let best = near.iter().filter(is_on).max_by(|a, b| {
            let order = rank(a).cmp(&rank(b));
            order
                .then(b.t.total_cmp(&a.t))
                .then(b.triangle.cmp(&a.triangle))
        });
        best.map(|meeting| self.place(ray, *meeting))
    }

    /// Returns the point of the exact surface at an intersection with its triangle.
    fn place(&self, ray: &Ray, meeting: TriangleHit) -> OnSurface {
        let TriangleHit {
            t,
            triangle,
            shares,
            ..
        } = meeting;
        let part = self.part(triangle);
        let flat = |normal| OnSurface {
            t,
            normal,
            part,
            meeting,
        };
        if let Some((exact, corners)) = &self.exact {
            let uv = self.parameters(corners, &meeting);
            let diagonal = self.tree.bounds().diagonal();
            let found = exact.onto(ray, part, uv);
            // Farther from the triangle, Newton's method has found another sheet.
            if let Some((at, normal)) = found.filter(|f| (f.0 - t).abs() < 0.02 * diagonal) {
                return OnSurface {
                    t: at,
                    normal,
                    part,
                    meeting,
                };
            }
            let normal = exact.at(part, uv).normal();
            if norm(normal).is_finite() && norm(normal) > 0.0 {
                return flat(unit(normal));
            }
        }
        if let Some(normals) = self.normals.get(triangle as usize) {
            let sum = |k: usize| (0..3).map(|c| shares[c] * normals[c][k]).sum();
            return flat(unit(std::array::from_fn(sum)));
        }
        flat(unit(facet_normal(self.corners(triangle))))
    }

    fn parameters(&self, corners: &[[[f64; 2]; 3]], m: &TriangleHit) -> [f64; 2] {
        let uv = &corners[m.triangle as usize];
        [0, 1].map(|k| (0..3).map(|c| m.shares[c] * uv[c][k]).sum())
    }

    /// Returns the colour at an intersection.
    pub(crate) fn color(&self, m: &TriangleHit) -> Color {
        match &self.paint {
            Paint::Values(values, scale) => {
                let corners = &values[m.triangle as usize];
                scale.color((0..3).map(|c| m.shares[c] * corners[c]).sum())
            }
            _ => self.fill(self.part(m.triangle), self.tone(m)),
        }
    }

    /// Returns the index of the colour within its part: of the square of a chequered patch, or of
    /// the step of a scale.
    pub(crate) fn tone(&self, m: &TriangleHit) -> u16 {
        match &self.paint {
            Paint::Plain(_) | Paint::Parts(_) => 0,
            Paint::Chequered(_) => {
                let Some((_, corners)) = &self.exact else {
                    return 0;
                };
                let [u, v] = self
                    .parameters(corners, m)
                    .map(|v| (v * 8.0).floor() as i64);
                (u + v).rem_euclid(2) as u16
            }
            Paint::Values(values, scale) => {
                let corners = &values[m.triangle as usize];
                scale.step((0..3).map(|c| m.shares[c] * corners[c]).sum())
            }
        }
    }

    /// Returns the colour with a given index within a part.
    pub(crate) fn fill(&self, part: u32, tone: u16) -> Color {
        let of = |list: &[Color]| {
            let own = list.get(part as usize).copied();
            own.unwrap_or_else(|| part_color(part as usize))
        };
        match &self.paint {
            Paint::Plain(color) => *color,
            Paint::Parts(list) => of(list),
            Paint::Chequered(list) if tone == 1 => {
                of(list).map(|v| (0.78 * f64::from(v)).round() as u8)
            }
            Paint::Chequered(list) => of(list),
            Paint::Values(_, scale) => scale.step_color(tone),
        }
    }

    /// Returns `Some` if the point at which a ray passes a section is inside the solid; with the
    /// point on the cut through tetrahedra, if there is one.
    pub(crate) fn cap(&self, ray: &Ray, t: f64) -> Option<Option<OnSurface>> {
        match &self.lid {
            Lid::Open => None,
            Lid::Own => {
                let mesh = (self.points.as_slice(), self.triangles.as_slice());
                (self.tree.winding(mesh, ray, t) != 0).then_some(None)
            }
            Lid::Cut(cut) => cut
                .meet(ray, [f64::NEG_INFINITY, f64::INFINITY], None)
                .map(Some),
        }
    }

    /// Returns the cut through tetrahedra; `None` if there is none.
    pub(crate) fn cut(&self) -> Option<&Self> {
        match &self.lid {
            Lid::Cut(cut) => Some(cut),
            _ => None,
        }
    }

    /// Switches to smooth shading: normals at corners are the area-weighted means of the normals
    /// around, by part.
    pub(crate) fn smoothed(mut self) -> Self {
        let mut sums: HashMap<(u32, u32), Point3> = HashMap::new();
        for (k, t) in self.triangles.iter().enumerate() {
            let n = facet_normal(self.corners(k as u32));
            for i in t {
                let sum = sums.entry((*i, self.part(k as u32))).or_default();
                *sum = along(*sum, n, 1.0);
            }
        }
        let each = self.triangles.iter().enumerate();
        self.normals = each
            .map(|(k, t)| t.map(|i| unit(sums[&(i, self.part(k as u32))])))
            .collect();
        self
    }
}

/// Returns true if triangles are closed: each edge occurs equally often in both directions.
/// Triangles without area bound nothing and are ignored.
pub(crate) fn is_closed(points: &[Point3], triangles: &[[u32; 3]]) -> bool {
    let mut balance: HashMap<[u32; 2], i32> = HashMap::new();
    let has_area = |t: &&[u32; 3]| facet_normal(t.map(|i| points[i as usize])) != [0.0; 3];
    for t in triangles.iter().filter(has_area) {
        for k in 0..3 {
            let (i, j) = (t[k], t[(k + 1) % 3]);
            let sign = if i < j { 1 } else { -1 };
            *balance.entry([i.min(j), i.max(j)]).or_default() += sign;
        }
    }
    !balance.is_empty() && balance.values().all(|sum| *sum == 0)
}

/// Returns the polygons in which a section cuts tetrahedra, as triangles, with one part for each
/// region.
pub(crate) fn cut_of(
    points: &[Point3],
    tets: &[[u32; 4]],
    section: &Section,
    regions: &[u32],
) -> Surface {
    let height = |i: u32| section.height(points[i as usize]);
    let (mut nodes, mut triangles, mut parts) = (Vec::new(), Vec::new(), Vec::new());
    for (t, tet) in tets.iter().enumerate() {
        let (above, below): (Vec<u32>, Vec<u32>) = tet.iter().partition(|i| height(**i) > 0.0);
        let crossing = |i: u32, j: u32| -> Point3 {
            let (p, q) = (points[i as usize], points[j as usize]);
            along(p, sub(q, p), height(i) / (height(i) - height(j)))
        };
        let polygon: Vec<Point3> = match (above.as_slice(), below.as_slice()) {
            ([a, b], [c, d]) => [(a, c), (a, d), (b, d), (b, c)]
                .map(|(i, j)| crossing(*i, *j))
                .to_vec(),
            ([one], three) | (three, [one]) => three.iter().map(|j| crossing(*one, *j)).collect(),
            _ => continue,
        };
        let first = nodes.len() as u32;
        for k in 2..polygon.len() as u32 {
            triangles.push([first, first + k - 1, first + k]);
            parts.push(regions.get(t).copied().unwrap_or(0));
        }
        nodes.extend(polygon);
    }
    let count = parts.iter().max().map_or(1, |most| *most as usize + 1);
    // Region 0 has the colour of caps, which resembles the second hue of parts; so region 1 takes
    // the first hue.
    let color = |k: usize| match k {
        0 => shade::CAP,
        1 => part_color(0),
        _ => part_color(k),
    };
    let colors = (0..count).map(color);
    let mut cut = Surface::new(nodes, triangles, Paint::Parts(colors.collect()));
    cut.parts = parts;
    cut.has_edges = true;
    cut
}

/// Returns the quality of a triangle: 1 if it is equilateral, 0 if it has no area.
pub(crate) fn quality([a, b, c]: [Point3; 3]) -> f64 {
    let squares: f64 = [sub(b, a), sub(c, b), sub(a, c)]
        .iter()
        .map(|e| dot(*e, *e))
        .sum();
    let area = norm(facet_normal([a, b, c]));
    if squares > 0.0 {
        2.0 * 3.0_f64.sqrt() * area / squares
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_equilateral_triangle_has_quality_one() {
        let h = 0.75_f64.sqrt();
        let q = quality([[0.0; 3], [1.0, 0.0, 0.0], [0.5, h, 0.0]]);
        assert!((q - 1.0).abs() < 1e-15);
        assert_eq!(quality([[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), 0.0);
    }

    #[test]
    fn what_two_bodies_share_is_inside() {
        let mut points = Vec::new();
        let mut triangles = Vec::new();
        let skin = [[1_u32, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];
        for shift in [0.0, 0.1] {
            let first = points.len() as u32;
            let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            points.extend(corners.map(|p| p.map(|v| v + shift)));
            triangles.extend(skin.map(|t| t.map(|i| first + i)));
        }
        let mut both = Surface::new(points, triangles, Paint::Plain([0; 3]));
        both.lid = Lid::Own;
        let is_inside = |at: f64| {
            let ray = Ray {
                o: [at; 3],
                d: [0.0, 0.6, 0.8],
                from: 0.0,
            };
            both.cap(&ray, 0.0).is_some()
        };
        // Points in the first tetrahedron, in both, in the second, and in none.
        let found = [0.05, 0.2, 0.4, 0.5].map(is_inside);
        assert_eq!(found, [true, true, true, false]);
    }

    #[test]
    fn a_tetrahedron_is_closed_and_its_cut_flat() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let skin = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];
        assert!(is_closed(&points, &skin) && !is_closed(&points, &skin[1..]));
        let with_flat = [&skin[..], &[[0, 0, 1], [2, 2, 2]]].concat();
        assert!(is_closed(&points, &with_flat) && !is_closed(&points, &[[0, 0, 1]]));
        let section = Section::new([0.0, 0.0, 2.0], 1.0).expect("a plane");
        let cut = cut_of(&points, &[[0, 1, 2, 3]], &section, &[]);
        let area: f64 = (0..cut.triangles.len() as u32)
            .map(|k| 0.5 * norm(facet_normal(cut.corners(k))))
            .sum();
        assert!((area - 0.125).abs() < 1e-15, "{area}");
    }
}
