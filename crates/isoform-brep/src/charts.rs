//! Charts: smooth faces without a known surface are cut into pieces, each a graph over a plane.
//!
//! Cuts are planes. Each passes through one connected piece only, and is chosen such that normals
//! vary less on its two sides, that it crosses the surface and the borders at large angles, and
//! that it stays away from vertices. A piece whose normals lie within a cone is a graph; if no
//! spline is near enough it is cut once more.

use crate::cut::{Cut, LabelledMesh, crossing, imprint};
use crate::fit::{HeightRegion, cone, normal_of};
use crate::locus::{Distance, Locus};
use crate::topology::{TriangleSide, across_sides, ends_of, sides_of};
use crate::{BrepError, Control, SplineRefusal};
use isoform_geom::brep::{Axes, Graph, Surface};
use isoform_geom::{Aabb, Field, Point3, cross, dot, middle, norm, orthonormal_complement, sub};
use isoform_num::linalg::symmetric_eigen;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Minimum cosine between the normals of a chart and its direction, 50°: a larger one makes more
/// charts, a smaller one steep graphs, whose splines need more spans.
const MIN_NORMAL_COSINE: f64 = 0.64;
/// Number of directions that are tried in addition to the axes of the piece and of space.
const EXTRA_DIRECTIONS: usize = 12;

/// A smooth face without a known surface.
pub(crate) struct SmoothFace<'a> {
    /// Component of the face.
    pub(crate) component: u32,
    /// Function whose zero set it lies on.
    pub(crate) field: &'a Arc<dyn Field>,
    /// Maximum distance of splines, in model units.
    pub(crate) tolerance: f64,
    /// Maximum angle of splines with the function (radians), as far as more spans reduce it.
    pub(crate) turn: f64,
}

/// Splines of charts, each with a triangle of its chart that later cuts keep there.
pub(crate) type ChartSplines = Vec<(u32, Graph)>;

impl SmoothFace<'_> {
    /// Cuts the component into charts and finds their splines; the reason if it has too many
    /// charts, or one without a spline.
    ///
    /// # Errors
    /// Fails if the mesh is not closed, or the work is stopped.
    pub(crate) fn charts(
        &self,
        mesh: &mut LabelledMesh,
        across: &mut Vec<[TriangleSide; 3]>,
        control: &Control<'_>,
    ) -> Result<Result<ChartSplines, SplineRefusal>, BrepError> {
        let first = mesh.components.iter().position(|c| *c == self.component);
        let tried = |mesh: &LabelledMesh, across: &[[TriangleSide; 3]], t: u32| {
            (t, self.graph(mesh, &connected(mesh, across, t)))
        };
        let first = first.map(|t| tried(mesh, across, t as u32));
        let mut pending: Vec<(u32, Option<Graph>)> = first.into_iter().collect();
        let mut done = Vec::new();
        let locus = Locus::Zero(self.field.clone());
        while let Some((seed, graph)) = pending.pop() {
            control.check()?;
            if let Some(graph) = graph {
                done.push((seed, graph));
                continue;
            }
            let own = connected(mesh, across, seed);
            let refused = |mesh: &LabelledMesh, across: &[[TriangleSide; 3]]| {
                let mut left = std::iter::once(&seed).chain(pending.iter().map(|p| &p.0));
                let is_steep =
                    |&t: &u32| self.direction(mesh, &connected(mesh, across, t)).is_none();
                let charts = done.len() + pending.len() + 1;
                match left.any(is_steep) {
                    true => SplineRefusal::TurnsOver { charts },
                    false => SplineRefusal::TooFar { charts },
                }
            };
            // Fewer triangles do not tell the normals of a piece.
            if own.len() < 12 {
                return Ok(Err(refused(mesh, across)));
            }
            let number = mesh.cuts[self.component as usize].len() as u32;
            let junctions = junctions(mesh);
            let Some(plane) = PlaneChooser::new(mesh, across, &own, &junctions).best() else {
                return Ok(Err(refused(mesh, across)));
            };
            let plane = Locus::Exact(plane);
            mesh.cuts[self.component as usize].push(plane.clone());
            let cut = Cut {
                own: &own,
                number,
                locus: &plane,
                crossing: &|ends| crossing(ends, &locus, &plane),
                // Nodes that are made meanwhile are on this cut.
                is_vertex: &|v| junctions.get(v as usize) == Some(&true),
            };
            let new = imprint(mesh, &cut);
            *across = across_sides(&mesh.triangles)?;
            let parts = seeds(mesh, across, own.iter().copied().chain(new));
            if parts.len() < 2 {
                return Ok(Err(refused(mesh, across)));
            }
            let parts = parts.into_par_iter().rev();
            pending.par_extend(parts.map(|t| tried(mesh, across, t)));
        }
        Ok(Ok(done))
    }

    /// Returns the spline of a piece; `None` if its normals do not lie within a cone, or no spline
    /// fits.
    fn graph(&self, mesh: &LabelledMesh, own: &[u32]) -> Option<Graph> {
        let region = HeightRegion {
            field: self.field.as_ref(),
            triangles: own.iter().map(|t| mesh.corners(*t)).collect(),
            direction: self.direction(mesh, own)?,
        };
        region.fit(self.tolerance, self.turn)
    }

    /// Returns the direction over which a piece is a graph; `None` if its normals do not lie within
    /// a cone.
    fn direction(&self, mesh: &LabelledMesh, own: &[u32]) -> Option<Point3> {
        let mut seen = BTreeSet::new();
        let corners = own.iter().flat_map(|t| mesh.triangles[*t as usize]);
        let nodes = corners.filter(|v| seen.insert(*v));
        let locus = Locus::Zero(self.field.clone());
        let normals: Vec<Point3> = nodes
            .map(|v| locus.distance(mesh.points[v as usize]).1)
            .filter(|n| n.iter().all(|v| v.is_finite()))
            .collect();
        // Two directions of a cone differ by at most its aperture.
        let apart = 2.0 * MIN_NORMAL_COSINE * MIN_NORMAL_COSINE - 1.0;
        let first = *normals.first()?;
        if normals.iter().any(|n| dot(*n, first) < apart) {
            return None;
        }
        let (direction, cosine) = cone(&normals);
        (cosine >= MIN_NORMAL_COSINE).then_some(direction)
    }
}

/// Returns the piece around a triangle: neighbours of one component and chart.
fn connected(mesh: &LabelledMesh, across: &[[TriangleSide; 3]], seed: u32) -> Vec<u32> {
    let label = |t: u32| (mesh.components[t as usize], mesh.charts[t as usize]);
    let (mut own, mut seen) = (vec![seed], BTreeSet::from([seed]));
    let mut at = 0;
    while let Some(&t) = own.get(at) {
        at += 1;
        for (other, _) in across[t as usize] {
            if label(other) == label(seed) && seen.insert(other) {
                own.push(other);
            }
        }
    }
    own
}

/// Returns a triangle of each piece that some triangles belong to.
fn seeds(
    mesh: &LabelledMesh,
    across: &[[TriangleSide; 3]],
    triangles: impl Iterator<Item = u32>,
) -> Vec<u32> {
    let (mut found, mut seen) = (Vec::new(), BTreeSet::new());
    for t in triangles {
        if !seen.contains(&t) {
            seen.extend(connected(mesh, across, t));
            found.push(t);
        }
    }
    found
}

/// Returns, for each node, true if at least three faces meet there.
fn junctions(mesh: &LabelledMesh) -> Vec<bool> {
    let mut seen: Vec<[Option<(u32, u32)>; 2]> = vec![[None; 2]; mesh.points.len()];
    let mut is_junction = vec![false; mesh.points.len()];
    for (t, corners) in mesh.triangles.iter().enumerate() {
        let label = Some((mesh.components[t], mesh.charts[t]));
        for v in corners.map(|v| v as usize) {
            match seen[v].iter_mut().find(|s| s.is_none() || **s == label) {
                Some(place) => *place = label,
                None => is_junction[v] = true,
            }
        }
    }
    is_junction
}

/// Chooses the plane that cuts a piece.
struct PlaneChooser<'a> {
    mesh: &'a LabelledMesh,
    own: &'a [u32],
    /// Middles and area vectors of the triangles.
    middles: Vec<Point3>,
    normals: Vec<Point3>,
    /// Nodes on the border, with their neighbours there.
    border: BTreeMap<u32, Vec<u32>>,
    vertices: BTreeSet<u32>,
    size: f64,
}

impl<'a> PlaneChooser<'a> {
    /// Creates a chooser for the triangles `own`; `junctions` are those of the whole mesh.
    fn new(
        mesh: &'a LabelledMesh,
        across: &[[TriangleSide; 3]],
        own: &'a [u32],
        junctions: &[bool],
    ) -> Self {
        let is_own: BTreeSet<u32> = own.iter().copied().collect();
        let mut border: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for &t in own {
            for k in 0..3u8 {
                if !is_own.contains(&across[t as usize][k as usize].0) {
                    let [a, b] = ends_of(&mesh.triangles[t as usize], k);
                    border.entry(a).or_default().push(b);
                    border.entry(b).or_default().push(a);
                }
            }
        }
        let corners = |t: &u32| mesh.corners(*t);
        let nodes = sides_of(&mesh.triangles, own);
        let size = Aabb::from_points(nodes.iter().map(|s| &mesh.points[s[0] as usize])).diagonal();
        Self {
            mesh,
            own,
            middles: own.iter().map(|t| middle(corners(t))).collect(),
            normals: own.iter().map(|t| normal_of(&corners(t))).collect(),
            vertices: border
                .keys()
                .copied()
                .filter(|v| junctions[*v as usize] || border[v].len() != 2)
                .collect(),
            border,
            size,
        }
    }

    /// Returns the best plane; `None` if no plane has triangles on both sides.
    fn best(&self) -> Option<Surface> {
        let mut best: Option<(f64, Surface)> = None;
        for direction in self.directions() {
            let heights: Vec<f64> = self.middles.iter().map(|p| dot(*p, direction)).collect();
            let lo = heights.iter().copied().fold(f64::INFINITY, f64::min);
            let hi = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            // Shares of the piece's extent at which planes are tried, the middle first.
            for share in [0.5, 0.42, 0.58, 0.34, 0.66, 0.26, 0.74] {
                let offset = lo + share * (hi - lo);
                let least = best.as_ref().map_or(f64::NEG_INFINITY, |b| b.0);
                let score = self.score(direction, offset, &heights, least);
                if let Some(score) = score.filter(|s| *s > least) {
                    let origin = direction.map(|v| v * offset);
                    best = Some((score, Surface::Plane(Axes::along(origin, direction))));
                }
            }
        }
        best.map(|b| b.1)
    }

    /// Returns the directions to be tried: the axes of space, the principal axes of the piece and
    /// of its normals, and a spiral of directions over the half sphere.
    fn directions(&self) -> Vec<Point3> {
        let mut all = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let units = self.normals.iter().map(|n| n.map(|v| v / norm(*n)));
        for points in [self.middles.clone(), units.collect()] {
            let count = points.len() as f64;
            let mean: Point3 =
                std::array::from_fn(|k| points.iter().map(|p| p[k]).sum::<f64>() / count);
            let mut spread = [0.0; 9];
            for d in points.iter().map(|p| sub(*p, mean)) {
                (0..9).for_each(|n| spread[n] += d[n / 3] * d[n % 3]);
            }
            let (_, vectors) = symmetric_eigen(&spread, 3);
            all.extend((0..3).map(|k| std::array::from_fn(|i| vectors[3 * k + i])));
        }
        all.extend((0..EXTRA_DIRECTIONS).map(|k| {
            let z = 1.0 - (k as f64 + 0.5) / EXTRA_DIRECTIONS as f64;
            let (sin, cos) = (2.399_963_229_728_653 * k as f64).sin_cos();
            let [x, y] = orthonormal_complement([0.0, 0.0, 1.0]);
            let r = (1.0 - z * z).sqrt();
            std::array::from_fn(|i| r * (cos * x[i] + sin * y[i]) + if i == 2 { z } else { 0.0 })
        }));
        all.retain(|d: &Point3| d.iter().all(|v| v.is_finite()));
        all
    }

    /// Returns the score of a plane, higher for better ones; `None` if all is on one side, or if
    /// the score is at most `least` whichever triangles the plane crosses.
    fn score(&self, direction: Point3, offset: f64, heights: &[f64], least: f64) -> Option<f64> {
        let mut sums = [(0.0, [0.0; 3]); 2];
        for (h, n) in heights.iter().zip(&self.normals) {
            let (area, sum) = &mut sums[usize::from(*h > offset)];
            *area += norm(*n);
            (0..3).for_each(|k| sum[k] += n[k]);
        }
        if sums.iter().any(|s| s.0 == 0.0) {
            return None;
        }
        // Share of the area vectors that cancels because of their spread, before and after.
        let whole: Point3 = std::array::from_fn(|k| sums[0].1[k] + sums[1].1[k]);
        let area = sums[0].0 + sums[1].0;
        let before = 1.0 - norm(whole) / area;
        let after = 1.0 - (norm(sums[0].1) + norm(sums[1].1)) / area;
        let gain = (before - after) / before.max(1e-9);
        let balance = sums[0].0.min(sums[1].0) / area;
        let of = |value: f64, wanted: f64| (value / wanted).min(1.0);
        let total = |safe: f64| safe.min(0.5) * 10.0 + safe + 2.0 * gain + of(balance, 0.3);
        if total(1.0) <= least {
            return None;
        }
        let [angle, slope, away] = self.quality(direction, offset);
        // Above a sine of 0.5, a slope of 0.4 and a distance of 0.04 a cut is safe.
        let [a, b, c] = [0.5, 0.4, 0.04];
        Some(total(of(angle, a).min(of(slope, b)).min(of(away, c))))
    }

    /// Returns the smallest sine between plane and surface, the smallest slope at which the border
    /// is crossed, and the smallest distance of vertices and turning points of the border in sizes
    /// of the piece.
    fn quality(&self, direction: Point3, offset: f64) -> [f64; 3] {
        let at = |v: u32| dot(self.mesh.points[v as usize], direction) - offset;
        let [mut angle, mut slope, mut away] = [1.0f64; 3];
        for (t, n) in self.own.iter().zip(&self.normals) {
            let values = self.mesh.triangles[*t as usize].map(at);
            if values.iter().any(|v| *v > 0.0) && values.iter().any(|v| *v <= 0.0) {
                angle = angle.min(norm(cross(*n, direction)) / norm(*n));
            }
        }
        for (&v, beside) in &self.border {
            let here = at(v);
            if self.vertices.contains(&v) {
                away = away.min(here.abs() / self.size);
            }
            if let [a, b] = beside[..]
                && (at(a) - here) * (here - at(b)) <= 0.0
            {
                away = away.min(here.abs() / self.size);
            }
            for &w in beside.iter().filter(|w| (at(**w) < 0.0) != (here < 0.0)) {
                let length = norm(sub(
                    self.mesh.points[w as usize],
                    self.mesh.points[v as usize],
                ));
                slope = slope.min((at(w) - here).abs() / length.max(f64::MIN_POSITIVE));
            }
        }
        [angle, slope, away]
    }
}
