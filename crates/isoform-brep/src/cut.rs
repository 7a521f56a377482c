//! Cuts of faces that wrap around.
//!
//! Readers add a seam to a face that wraps around its axis, and lose digits in doing so. Hence a
//! cylinder or cone is cut by a plane through its axis, a torus also along its tube, and a sphere
//! or ellipsoid by three planes. A cut is imprinted on the triangles: its two sides are then two
//! charts. Cuts are placed away from the vertices, and across the edges that they meet.

use crate::arcs::Arcs;
use crate::fit::cone;
use crate::locus::{Distance, Locus};
use crate::newton::meet;
use crate::topology::{ends_of, sides_of};
use isoform_geom::brep::{Axes, Surface};
use isoform_geom::{Aabb, Point3, cross, distance_squared, dot, norm, orthonormal_complement, sub};
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

/// Minimum gap in the angles of a face that need not be cut (radians).
const MIN_FREE_ANGLE: f64 = 0.6;
/// Minimum cosine between a direction and the points of a face on a sphere that need not be cut:
/// 75°.
pub(crate) const MIN_CAP_COSINE: f64 = 0.26;
/// Minimum cosine between a direction and the points of a face on an ellipsoid, mapped to the unit
/// sphere, that need not be cut: 60°. Its chart covers 63°, and an octant needs 55°.
pub(crate) const MIN_ELLIPSOID_CAP_COSINE: f64 = 0.5;
/// Number of candidates for a cut.
const CUT_CANDIDATES: usize = 64;
/// Number of candidate frames of the three planes on a sphere.
const FRAME_CANDIDATES: usize = 200;

/// Labelled triangles of a mesh that is being cut.
#[derive(Debug, Default)]
pub(crate) struct LabelledMesh {
    pub(crate) points: Vec<Point3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Part of the mesh that each triangle belongs to.
    pub(crate) parts: Vec<u32>,
    /// Sheet that each triangle lies on: parts of one surface share a sheet.
    pub(crate) sheets: Vec<u32>,
    /// Component of the sheet before it was cut.
    pub(crate) components: Vec<u32>,
    /// Chart of each triangle: the set of cuts of its component above which it lies. A later cut
    /// may pass through only a part of the component; the other triangles then count as below.
    pub(crate) charts: Vec<u32>,
    /// Sets that the charts stand for.
    pub(crate) sets: ChartSets,
    /// Cuts by component.
    pub(crate) cuts: Vec<Vec<Locus>>,
}

impl LabelledMesh {
    /// Returns the corners of a triangle.
    pub(crate) fn corners(&self, triangle: u32) -> [Point3; 3] {
        self.triangles[triangle as usize].map(|v| self.points[v as usize])
    }
    /// Returns the cut between two neighbours of one component, if they lie on different sides of
    /// one: the first at which they differ, since up to there they were one piece.
    pub(crate) fn cut_between(&self, a: u32, b: u32) -> Option<&Locus> {
        let (a, b) = (a as usize, b as usize);
        if self.components[a] != self.components[b] {
            return None;
        }
        let cut = self.sets.first_difference(self.charts[a], self.charts[b])?;
        self.cuts[self.components[a] as usize].get(cut as usize)
    }
}

/// Sets of cuts, numbered: 0 is the empty set, and each other one is a set with one later cut.
#[derive(Debug, Default)]
pub(crate) struct ChartSets {
    /// Set without the last cut, and the last cut, of each set but the empty one.
    before: Vec<(u32, u32)>,
    numbers: BTreeMap<(u32, u32), u32>,
}

impl ChartSets {
    /// Returns the set with one more cut, which is later than those in the set.
    fn with(&mut self, set: u32, cut: u32) -> u32 {
        *self.numbers.entry((set, cut)).or_insert_with(|| {
            self.before.push((set, cut));
            self.before.len() as u32
        })
    }

    /// Returns the first cut that is in one of two sets alone.
    fn first_difference(&self, mut a: u32, mut b: u32) -> Option<u32> {
        let before = |set: u32| set.checked_sub(1).map(|k| self.before[k as usize]);
        let mut first = None;
        while a != b {
            let (of_a, of_b) = (before(a), before(b));
            let is_last = |own: Option<(u32, u32)>, other: Option<(u32, u32)>| {
                own.map(|o| o.1) >= other.map(|o| o.1)
            };
            // The last cuts go, of both where they are one.
            if let Some((rest, cut)) = of_a.filter(|_| is_last(of_a, of_b)) {
                (a, first) = (rest, Some(cut));
            }
            if let Some((rest, cut)) = of_b.filter(|_| is_last(of_b, of_a)) {
                (b, first) = (rest, Some(cut));
            }
        }
        first
    }
}

/// Outline of a component of a sheet that is to be cut.
pub(crate) struct Outline {
    /// Triangles of the component.
    pub(crate) triangles: Vec<u32>,
    /// Nodes around it, loop after loop; the last of a loop is followed by its first.
    pub(crate) around: Vec<Vec<u32>>,
    /// Nodes of the outline at which borders meet.
    pub(crate) vertices: Vec<u32>,
}

/// Returns the cuts that a component needs.
pub(crate) fn cuts_of(mesh: &LabelledMesh, surface: &Surface, outline: &Outline) -> Vec<Surface> {
    let chooser = CutChooser::new(mesh, surface, outline);
    let axes = *surface.axes();
    match *surface {
        Surface::Plane(_) | Surface::Graph(_) => Vec::new(),
        Surface::Cylinder(..) | Surface::Cone(..) | Surface::Revolved(_) => chooser.axial(&axes),
        Surface::Torus(_, major, _) => {
            let mut cuts = chooser.axial(&axes);
            cuts.extend(chooser.about_tube(&axes, major));
            cuts
        }
        Surface::Sphere(_, radius) => {
            let out = |p: Point3| sub(p, axes.origin).map(|v| v / radius);
            chooser.octants(&out, MIN_CAP_COSINE, radius, |n| n)
        }
        Surface::Ellipsoid(ball) => {
            let out = |p: Point3| ball.shrunk(p);
            let least = ball.half[0].min(ball.half[1]).min(ball.half[2]);
            chooser.octants(&out, MIN_ELLIPSOID_CAP_COSINE, least, |n| {
                ball.plane_normal(n)
            })
        }
    }
}

/// Returns the gaps in the parameters of a face: for each of the two angles the middle and the
/// width of the largest interval that its triangles leave free.
pub(crate) fn gaps_of(surface: &Surface, points: &[Point3], sides: &[[u32; 2]]) -> [(f64, f64); 2] {
    let mut arcs = [Arcs::default(), Arcs::default()];
    let scale =
        Aabb::from_points(sides.as_flattened().iter().map(|v| &points[*v as usize])).diagonal();
    let is_on_axis = |p: Point3| {
        let [x, y, _] = surface.axes().local(p);
        x.hypot(y) <= 1e-9 * scale
    };
    for side in sides {
        let [p, q] = side.map(|v| points[v as usize]);
        if is_on_axis(p) || is_on_axis(q) {
            continue;
        }
        let (a, b) = (surface.parameters(p), surface.parameters(q));
        (0..2).for_each(|k| arcs[k].add(a[k], b[k]));
    }
    arcs.map(Arcs::gap)
}

/// Returns the direction about which points lie, seen from the origin, if they lie within a cap:
/// its cosine is `cap`.
pub(crate) fn cap_direction(points: impl Iterator<Item = Point3>, cap: f64) -> Option<Point3> {
    let units = points.map(|d| {
        let r = norm(d);
        d.map(|v| v / r)
    });
    let (direction, least) = cone(&units.collect::<Vec<_>>());
    (least > cap).then_some(direction)
}

/// Chooses cuts of a component.
struct CutChooser<'a> {
    mesh: &'a LabelledMesh,
    surface: &'a Surface,
    outline: &'a Outline,
    sides: Vec<[u32; 2]>,
    /// Diagonal of the box of the component.
    size: f64,
}

impl<'a> CutChooser<'a> {
    fn new(mesh: &'a LabelledMesh, surface: &'a Surface, outline: &'a Outline) -> Self {
        let sides = sides_of(&mesh.triangles, &outline.triangles);
        let size = Aabb::from_points(sides.iter().map(|s| &mesh.points[s[0] as usize])).diagonal();
        Self {
            mesh,
            surface,
            outline,
            sides,
            size,
        }
    }

    fn point(&self, v: u32) -> Point3 {
        self.mesh.points[v as usize]
    }

    /// Returns a plane through the axis, if the face wraps around it.
    fn axial(&self, axes: &Axes) -> Vec<Surface> {
        if gaps_of(self.surface, &self.mesh.points, &self.sides)[0].1 >= MIN_FREE_ANGLE {
            return Vec::new();
        }
        let plane = |k: usize| {
            let angle = PI * (k as f64 + 0.5) / CUT_CANDIDATES as f64;
            let normal = axes.vector([angle.cos(), angle.sin(), 0.0]);
            vec![Surface::Plane(Axes::along(axes.origin, normal))]
        };
        self.best((0..CUT_CANDIDATES).map(plane))
    }

    /// Returns a cut along the tube of a torus, if the face wraps around it: the lines through the
    /// middle of the tube at one angle, which are a cylinder or a cone.
    fn about_tube(&self, axes: &Axes, major: f64) -> Vec<Surface> {
        if gaps_of(self.surface, &self.mesh.points, &self.sides)[1].1 >= MIN_FREE_ANGLE {
            return Vec::new();
        }
        let cut = |k: usize| {
            let angle = FRAC_PI_2 * (k as f64 / CUT_CANDIDATES as f64);
            vec![if k == 0 {
                Surface::Cylinder(*axes, major)
            } else {
                // r = major + z tan(angle) on this side, r = major − z tan(angle) on the other.
                Surface::Cone(*axes, major, angle)
            }]
        };
        self.best((0..CUT_CANDIDATES * 3 / 4).map(cut))
    }

    /// Returns three perpendicular planes through the centre of a sphere, unless the face lies
    /// within a cap. `out` maps a point to the unit sphere, whose radius is `radius` in space, and
    /// `in_space` the normal of a plane through the centre of the unit sphere to that in space.
    fn octants(
        &self,
        out: &dyn Fn(Point3) -> Point3,
        cap: f64,
        radius: f64,
        in_space: impl Fn(Point3) -> Point3,
    ) -> Vec<Surface> {
        let center = self.surface.axes().origin;
        let nodes = self.sides.iter().map(|s| out(self.point(s[0])));
        if cap_direction(nodes, cap).is_some() {
            return Vec::new();
        }
        let normals = |k: usize| {
            let z = spread(k);
            let [x, y] = orthonormal_complement(z);
            let (sin, cos) = (2.399_963 * k as f64).sin_cos();
            let x: Point3 = std::array::from_fn(|i| cos * x[i] + sin * y[i]);
            [x, cross(z, x), z]
        };
        // The distance of the border from the poles of the three frames, on the unit sphere.
        let poles_away = |normals: [Point3; 3]| {
            let border = self.outline.around.iter().flatten();
            let near = |v: &u32| {
                let q = out(self.point(*v));
                normals.iter().map(|n| dot(q, *n).abs()).fold(0.0, f64::max)
            };
            let nearest = border.map(near).fold(0.0, f64::max);
            2.0 * radius * (1.0 - nearest).max(0.0)
        };
        let mut best = (f64::NEG_INFINITY, Vec::new());
        for normals in (0..FRAME_CANDIDATES).map(normals) {
            let planes = normals.map(|n| Surface::Plane(Axes::along(center, in_space(n))));
            let each = planes.iter().map(|c| self.score(c));
            let score = each.fold(poles_away(normals), f64::min);
            if score > best.0 {
                best = (score, planes.to_vec());
            }
        }
        best.1
    }

    /// Returns the candidate with the highest score; the first of equal ones.
    fn best(&self, candidates: impl Iterator<Item = Vec<Surface>>) -> Vec<Surface> {
        let mut best = (f64::NEG_INFINITY, Vec::new());
        for cuts in candidates {
            let each = cuts.iter().map(|c| self.score(c));
            let score = each.fold(f64::INFINITY, f64::min);
            if score > best.0 {
                best = (score, cuts);
            }
        }
        best.1
    }

    /// Returns the score of a cut: its distance from vertices and from touching the border, in
    /// model units.
    fn score(&self, cut: &Surface) -> f64 {
        let on_all = |v: u32| {
            let tips = self.surface.tips();
            let is_at = |a: &Point3| norm(sub(*a, self.point(v))) <= 1e-9 * self.size;
            tips.iter().any(is_at)
        };
        let at = |v: u32| cut.distance(self.point(v)).0;
        let vertices = self.outline.vertices.iter().filter(|v| !on_all(**v));
        let mut score = vertices.map(|v| at(*v).abs()).fold(f64::INFINITY, f64::min);
        for around in &self.outline.around {
            let values: Vec<f64> = around.iter().map(|v| at(*v)).collect();
            let n = values.len();
            for i in 0..n {
                let (a, b, c) = (values[i], values[(i + 1) % n], values[(i + 2) % n]);
                if (b - a) * (c - b) <= 0.0 && !on_all(around[(i + 1) % n]) {
                    // The border runs across the cut between its turning points.
                    score = score.min(b.abs());
                }
                if (a < 0.0) != (b < 0.0) {
                    let [p, q] = [i, (i + 1) % n].map(|j| self.point(around[j]));
                    let slope = (b - a).abs() / norm(sub(q, p)).max(f64::MIN_POSITIVE);
                    // A perpendicular crossing is worth as much as a distance of 30 % of the size
                    // of the face.
                    score = score.min(0.3 * self.size * slope);
                }
            }
        }
        score
    }
}

/// Returns direction k of a uniform sequence on the sphere.
fn spread(k: usize) -> Point3 {
    let z = 1.0 - 2.0 * (k as f64 + 0.5) / FRAME_CANDIDATES as f64;
    let (sin, cos) = (2.399_963_229_728_653 * k as f64).sin_cos();
    let r = (1.0 - z * z).sqrt();
    [r * cos, r * sin, z]
}

/// A cut to be imprinted.
pub(crate) struct Cut<'a> {
    /// Triangles that it passes, or some more of their face.
    pub(crate) own: &'a [u32],
    /// Number of the cut among those of its component.
    pub(crate) number: u32,
    /// Locus of the cut.
    pub(crate) locus: &'a Locus,
    /// Function that returns the point of the surface on the cut, between two points on different
    /// sides of it.
    pub(crate) crossing: &'a dyn Fn([Point3; 2]) -> Point3,
    /// Function that is true for nodes that count as points of the cut only if they lie on it.
    pub(crate) is_vertex: &'a dyn Fn(u32) -> bool,
}

/// Imprints a cut: divides the triangles that it passes, and those across the border with them.
/// Returns the new triangles that came from the cut's own.
pub(crate) fn imprint(mesh: &mut LabelledMesh, cut: &Cut<'_>) -> Vec<u32> {
    let signs = signs(mesh, cut);
    let mut inserted: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    let mut is_own = vec![false; mesh.triangles.len()];
    for &t in cut.own {
        is_own[t as usize] = true;
        for k in 0..3 {
            let [a, b] = ends_of(&mesh.triangles[t as usize], k);
            let key = [a.min(b), a.max(b)];
            if signs[&a] * signs[&b] < 0 && !inserted.contains_key(&key) {
                let p = (cut.crossing)(key.map(|v| mesh.points[v as usize]));
                inserted.insert(key, mesh.points.len() as u32);
                mesh.points.push(p);
            }
        }
    }
    let mut new = Vec::new();
    for (t, is_own) in is_own.into_iter().enumerate() {
        let before = mesh.triangles.len() as u32;
        divide(mesh, t, &inserted, is_own.then_some(cut.number), &signs);
        if is_own {
            new.extend(before..mesh.triangles.len() as u32);
        }
    }
    new
}

/// Returns the side of the cut on which each of its nodes lies; 0 on it.
fn signs(mesh: &LabelledMesh, cut: &Cut<'_>) -> BTreeMap<u32, i32> {
    let mut shortest: BTreeMap<u32, f64> = BTreeMap::new();
    for corners in cut.own.iter().map(|t| &mesh.triangles[*t as usize]) {
        for k in 0..3 {
            let ends = ends_of(corners, k);
            let [p, q] = ends.map(|v| mesh.points[v as usize]);
            let d = distance_squared(p, q).sqrt();
            for v in ends {
                let s = shortest.entry(v).or_insert(f64::INFINITY);
                *s = s.min(d);
            }
        }
    }
    let sign = |(v, shortest): (u32, f64)| {
        let g = cut.locus.distance(mesh.points[v as usize]).0;
        // Nodes within 5 % of their shortest edge from the cut are taken for points of it.
        let near = if (cut.is_vertex)(v) { 1e-7 } else { 0.05 };
        let is_on = g.abs() <= near * shortest;
        (
            v,
            if is_on {
                0
            } else if g > 0.0 {
                1
            } else {
                -1
            },
        )
    };
    shortest.into_iter().map(sign).collect()
}

/// Returns the point of a cut between two points of a surface.
pub(crate) fn crossing(ends: [Point3; 2], surface: &dyn Distance, cut: &dyn Distance) -> Point3 {
    let [a, b] = ends.map(|p| cut.distance(p).0);
    let s = a / (a - b);
    // A limit may have no gradient at an end.
    let s = if (0.0..=1.0).contains(&s) { s } else { 0.5 };
    let p = std::array::from_fn(|k| (1.0 - s) * ends[0][k] + s * ends[1][k]);
    let on = meet([surface, cut], p);
    // The iteration must not leave the neighbourhood.
    let near = norm(sub(ends[0], ends[1]));
    if norm(sub(on, p)) <= near { on } else { p }
}

/// Divides triangle t at the nodes inserted on its sides. `cut` is the number of the cut, if the
/// triangle belongs to the component that is cut.
fn divide(
    mesh: &mut LabelledMesh,
    t: usize,
    inserted: &BTreeMap<[u32; 2], u32>,
    cut: Option<u32>,
    signs: &BTreeMap<u32, i32>,
) {
    let corners = mesh.triangles[t];
    let mut polygon = Vec::with_capacity(6);
    for k in 0..3 {
        let [a, b] = ends_of(&corners, k);
        let sign = cut.map_or(0, |_| signs[&a]);
        polygon.push((a, sign));
        polygon.extend(inserted.get(&[a.min(b), a.max(b)]).map(|m| (*m, 0)));
    }
    let Some(cut) = cut else {
        if polygon.len() > 3 {
            // A fan around an inserted node has no degenerate triangle.
            let first = polygon.iter().position(|p| !corners.contains(&p.0));
            polygon.rotate_left(first.unwrap_or(0));
            let nodes: Vec<u32> = polygon.iter().map(|p| p.0).collect();
            replace(mesh, t, &[(nodes, mesh.charts[t])]);
        }
        return;
    };
    let chart = mesh.charts[t];
    let has = |s: i32| polygon.iter().any(|p| p.1 == s);
    match (has(1), has(-1)) {
        (true, true) => {
            let part = |s: i32| -> Vec<u32> {
                let own = polygon.iter().filter(|p| p.1 != -s);
                own.map(|p| p.0).collect()
            };
            let above = mesh.sets.with(chart, cut);
            replace(mesh, t, &[(part(1), above), (part(-1), chart)]);
        }
        (_, true) => {}
        _ => mesh.charts[t] = mesh.sets.with(chart, cut),
    }
}

/// Replaces triangle t by convex polygons, as fans, with their charts.
pub(crate) fn replace(mesh: &mut LabelledMesh, t: usize, polygons: &[(Vec<u32>, u32)]) {
    let (part, sheet, component) = (mesh.parts[t], mesh.sheets[t], mesh.components[t]);
    let mut is_first = true;
    for (nodes, chart) in polygons {
        for k in 1..nodes.len() - 1 {
            let triangle = [nodes[0], nodes[k], nodes[k + 1]];
            if std::mem::take(&mut is_first) {
                (mesh.triangles[t], mesh.charts[t]) = (triangle, *chart);
            } else {
                mesh.triangles.push(triangle);
                mesh.parts.push(part);
                mesh.sheets.push(sheet);
                mesh.components.push(component);
                mesh.charts.push(*chart);
            }
        }
    }
}

/// Returns the borders of faces as outlines, without their triangles.
pub(crate) fn outlines(
    chains: &[crate::topology::BorderChain],
    loops: &[Vec<Vec<(u32, bool)>>],
    is_vertex: &dyn Fn(u32) -> bool,
) -> Vec<Outline> {
    loops
        .iter()
        .map(|around| {
            let nodes = |chains_around: &Vec<(u32, bool)>| -> Vec<u32> {
                let each = chains_around.iter().flat_map(|&(c, forward)| {
                    let mut nodes = chains[c as usize].nodes.clone();
                    if !forward {
                        nodes.reverse();
                    }
                    nodes.pop();
                    nodes
                });
                each.collect()
            };
            let around: Vec<Vec<u32>> = around.iter().map(nodes).collect();
            let vertices = around.iter().flatten().copied();
            Outline {
                triangles: Vec::new(),
                vertices: vertices.filter(|v| is_vertex(*v)).collect(),
                around,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// All sets of eight cuts, each against each other.
    #[test]
    fn sets_of_cuts_differ_first_where_their_members_do() {
        let mut sets = ChartSets::default();
        let members = |bits: u32| (0..8).filter(move |k| bits >> k & 1 == 1);
        let numbers: Vec<u32> = (0..256)
            .map(|bits| members(bits).fold(0, |set, cut| sets.with(set, cut)))
            .collect();
        assert_eq!(numbers.iter().collect::<BTreeSet<_>>().len(), 256);
        for (a, of_a) in numbers.iter().enumerate() {
            for (b, of_b) in numbers.iter().enumerate() {
                let differ = (a ^ b) as u32;
                let first = (differ != 0).then(|| differ.trailing_zeros());
                assert_eq!(sets.first_difference(*of_a, *of_b), first, "{a} {b}");
            }
        }
    }
}
