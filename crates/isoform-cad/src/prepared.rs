//! Shape with what distances and measures need.

use crate::edges::{Divided, FacetOptions};
use crate::facets::{Made, ShapeError, ShapeFacets, make};
use crate::measure::{FaceMeasure, measured};
use crate::tree::{Item, ItemKind, ItemTree};
use crate::trim::TrimmedFace;
use isoform_control::Control;
use isoform_geom::cad::{CadCurve, Shape};
use isoform_geom::{Aabb, Mesh, Point3, cross, distance_to_segment, dot, norm, sub};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Default distance of the triangles from the faces, in diagonals of the box.
const DEFAULT_CHORD_SHARE: f64 = 1e-3;
/// Factor of measured deviations, in which the true ones lie.
const DEVIATION_MARGIN: f64 = 2.0;

/// Shape with the borders of its faces in the parameter plane, and its triangles.
#[derive(Debug)]
pub struct PreparedShape {
    pub(crate) shape: Shape,
    pub(crate) faces: Vec<TrimmedFace>,
    pub(crate) divided: Divided,
    pub(crate) facets: ShapeFacets,
    pub(crate) tree: ItemTree,
    /// Solid of each face, `None` for surfaces without an inside.
    pub(crate) solids: Vec<Option<u32>>,
    /// Maximum distance of the exact faces from their triangles.
    pub(crate) reach: f64,
}

/// Measures of a shape.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeMeasures {
    /// Area of each face, in square units.
    pub areas: Vec<f64>,
    /// Total area of the faces, in square units.
    pub area: f64,
    /// Volume of all solids, in cubic units; `None` without a solid.
    pub volume: Option<f64>,
    /// Centroid of the volume; `None` without a solid.
    pub centroid: Option<Point3>,
    /// Number of faces that are measured by their triangles, since they go round in two directions.
    pub by_triangles: usize,
    /// Largest distance of samples of the edges from the surfaces of their faces, and of the ends
    /// of edges from their vertices.
    pub gap: f64,
    /// Number of edges that do not have two sides in the shells of the solids.
    pub open_edges: usize,
}

impl PreparedShape {
    /// Triangulates a shape, as finely as `options` say; by default, triangles are within a
    /// thousandth of the diagonal of the box from the faces.
    ///
    /// # Errors
    /// [`ShapeError`] where a face has no triangles.
    pub fn new(
        shape: Shape,
        options: Option<FacetOptions>,
        control: &Control<'_>,
    ) -> Result<Self, ShapeError> {
        let options = options.unwrap_or_else(|| FacetOptions {
            chord: DEFAULT_CHORD_SHARE * extent(&shape).diagonal(),
            longest: f64::INFINITY,
        });
        let Made {
            faces,
            divided,
            facets,
        } = make(&shape, &options, control)?;
        let solids = shape.solids_of_faces();
        let mut made = Self {
            tree: ItemTree::new(Vec::new()),
            solids,
            reach: 0.0,
            shape,
            faces,
            divided,
            facets,
        };
        let items = made.items();
        made.reach = items.iter().map(|i| i.reach).fold(0.0, f64::max);
        made.tree = ItemTree::new(items);
        Ok(made)
    }

    /// Returns the shape.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }
    /// Returns the triangles of the faces.
    pub fn facets(&self) -> &ShapeFacets {
        &self.facets
    }
    /// Returns the smallest box around the nodes of the triangles.
    pub fn bounds(&self) -> Aabb {
        Aabb::from_points(self.used())
    }
    fn used(&self) -> impl Iterator<Item = &Point3> {
        let corners = self.facets.triangles.iter().flatten();
        corners.map(|v| &self.facets.points[*v as usize])
    }
    /// Returns the largest distance of middles of triangles and of their edges from the faces.
    pub fn deviation(&self) -> f64 {
        self.facets.deviations.iter().copied().fold(0.0, f64::max)
    }
    /// Returns the triangles as a mesh with a part for each face. It is closed if the shells are,
    /// since faces share the nodes of their edges.
    pub fn mesh(&self) -> Mesh {
        let names = self.shape.faces.iter().enumerate();
        let names = names.map(|(i, f)| format!("{} {}", f.surface.name(), i + 1));
        // Nodes that no triangle has are left out.
        let mut number = vec![u32::MAX; self.facets.points.len()];
        let mut points = Vec::new();
        let mut renumbered = |v: u32| {
            let known = &mut number[v as usize];
            if *known == u32::MAX {
                *known = points.len() as u32;
                points.push(self.facets.points[v as usize]);
            }
            *known
        };
        let triangles = self.facets.triangles.iter().map(|t| t.map(&mut renumbered));
        let triangles = triangles.collect();
        Mesh {
            triangle_parts: self.facets.face_of.clone(),
            parts: names.collect(),
            ..Mesh::from_triangles(points, triangles)
        }
    }

    /// Returns the items of the tree, with the distances of the exact shape from them.
    fn items(&self) -> Vec<Item> {
        let widened = |points: &[Point3], kind, reach: f64| Item {
            kind,
            bounds: Aabb::from_points(points).widened(reach),
            reach,
        };
        let reaches: Vec<f64> = (0..self.shape.edges.len())
            .into_par_iter()
            .map(|e| self.edge_reach(e))
            .collect();
        let mut items = Vec::new();
        for (e, along) in self.divided.along.iter().enumerate() {
            for (i, ends) in along.windows(2).enumerate() {
                let ends = [ends[0], ends[1]].map(|n| self.divided.points[n.1 as usize]);
                let kind = ItemKind::Piece(e as u32, i as u32);
                items.push(widened(&ends, kind, reaches[e]));
            }
        }
        let of_faces: Vec<f64> = (0..self.faces.len())
            .map(|f| {
                let border = self.shape.faces[f].loops.iter().flatten();
                let border = border.map(|c| reaches[c.edge as usize]);
                DEVIATION_MARGIN * self.facets.deviations[f] + border.fold(0.0, f64::max)
            })
            .collect();
        for (t, f) in self.facets.face_of.iter().enumerate() {
            let corners = self.facets.triangles[t].map(|v| self.facets.points[v as usize]);
            let kind = ItemKind::Triangle(t as u32);
            items.push(widened(&corners, kind, of_faces[*f as usize]));
        }
        items
    }

    /// Returns a bound of the distance of an edge from its chords, and of its ends from their
    /// vertices.
    fn edge_reach(&self, e: usize) -> f64 {
        let edge = &self.shape.edges[e];
        let mut worst = 0.0f64;
        for ends in self.divided.along[e].windows(2) {
            let points = [ends[0], ends[1]].map(|n| self.divided.points[n.1 as usize]);
            // Of a line only the ends may be off their vertices.
            let count = if matches!(edge.curve, CadCurve::Line(..)) {
                1
            } else {
                4
            };
            for k in 0..=count {
                let s = ends[0].0 + (ends[1].0 - ends[0].0) * f64::from(k) / f64::from(count);
                worst = worst.max(distance_to_segment(edge.at(s)[0], points));
            }
        }
        DEVIATION_MARGIN * worst
    }

    /// Measures the shape.
    pub fn measures(&self) -> ShapeMeasures {
        let center = self.bounds().center();
        let exact = |f: usize| {
            let is_simple = !self.touches_itself(f);
            is_simple.then(|| measured(&self.shape, f, &self.faces[f], center))?
        };
        let faces: Vec<(FaceMeasure, bool)> = (0..self.faces.len())
            .into_par_iter()
            .map(|f| match exact(f) {
                Some(exact) => (exact, true),
                None => (self.of_triangles(f, center), false),
            })
            .collect();
        let mut total = FaceMeasure::default();
        let mut of_solids = FaceMeasure::default();
        for ((face, _), solid) in faces.iter().zip(&self.solids) {
            total.add(face, 1.0);
            if solid.is_some() {
                of_solids.add(face, 1.0);
            }
        }
        let has_solid = self.solids.iter().any(Option::is_some);
        let volume = of_solids.volume;
        let centroid = std::array::from_fn(|k| center[k] + of_solids.moment[k] / volume);
        ShapeMeasures {
            areas: faces.iter().map(|f| f.0.area).collect(),
            area: total.area,
            volume: has_solid.then_some(volume),
            centroid: has_solid.then_some(centroid),
            by_triangles: faces.iter().filter(|f| !f.1).count(),
            gap: self.gap(),
            open_edges: self.open_edges(),
        }
    }

    /// Returns true if the border of a face passes a vertex twice, where the inside in the plane of
    /// parameters depends on rounding. Seams, which have the face on both sides, do not count.
    fn touches_itself(&self, face: usize) -> bool {
        let coedges = || self.shape.faces[face].loops.iter().flatten();
        let is_seam = |edge: u32| coedges().filter(|c| c.edge == edge).count() > 1;
        let mut passed = BTreeSet::new();
        coedges().filter(|c| !is_seam(c.edge)).any(|c| {
            let start = self.shape.edges[c.edge as usize].ends[usize::from(!c.forward)];
            !passed.insert(start)
        })
    }

    fn of_triangles(&self, face: usize, center: Point3) -> FaceMeasure {
        let mut sum = FaceMeasure::default();
        let triangles = self.facets.triangles.iter().zip(&self.facets.face_of);
        for (t, _) in triangles.filter(|(_, f)| **f as usize == face) {
            let [a, b, c] = t.map(|v| sub(self.facets.points[v as usize], center));
            let volume = dot(a, cross(b, c)) / 6.0;
            let part = FaceMeasure {
                area: 0.5 * norm(cross(sub(b, a), sub(c, a))),
                volume,
                moment: std::array::from_fn(|k| volume * (a[k] + b[k] + c[k]) / 4.0),
            };
            sum.add(&part, 1.0);
        }
        sum
    }

    /// Returns the largest distance of the middles of pieces of edges from the surfaces of their
    /// faces, and of the ends of edges from their vertices.
    pub fn gap(&self) -> f64 {
        let mut gap = 0.0f64;
        for face in &self.faces {
            for piece in face.face.loops.iter().flat_map(|l| &l.pieces) {
                let Some(e) = piece.edge else { continue };
                let edge = &self.shape.edges[e as usize];
                let share = 0.5 * (piece.shares[0] + piece.shares[1]);
                let at = face
                    .face
                    .place_on(edge, share, crate::loops::blend(piece.at, 0.5));
                let off = sub(edge.at(share)[0], face.face.chart.surface.at(at).p);
                gap = gap.max(norm(off));
            }
        }
        for edge in &self.shape.edges {
            for (share, vertex) in [0.0, 1.0].into_iter().zip(edge.ends) {
                let off = sub(edge.at(share)[0], self.shape.vertices[vertex as usize]);
                gap = gap.max(norm(off));
            }
        }
        gap
    }

    /// Returns the number of edges of solids that are not passed once in each direction.
    fn open_edges(&self) -> usize {
        let mut passed = vec![[0u32; 2]; self.shape.edges.len()];
        for (face, solid) in self.shape.faces.iter().zip(&self.solids) {
            if solid.is_some() {
                for coedge in face.loops.iter().flatten() {
                    passed[coedge.edge as usize][usize::from(coedge.forward)] += 1;
                }
            }
        }
        passed.iter().filter(|p| p[0] != p[1]).count()
    }
}

/// Returns the box of the vertices and of samples of the edges.
fn extent(shape: &Shape) -> Aabb {
    let mut bounds = Aabb::from_points(&shape.vertices);
    for edge in &shape.edges {
        for k in 1..8 {
            bounds.add(edge.at(f64::from(k) / 8.0)[0]);
        }
    }
    for face in shape.faces.iter().filter(|f| f.loops.is_empty()) {
        let whole = crate::facets::whole(&face.surface);
        bounds.add(whole.lo);
        bounds.add(whole.hi);
    }
    bounds
}
