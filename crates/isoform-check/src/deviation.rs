//! Distances of a mesh from a solid.
//!
//! The distance of a point from the surface of a piece g is the length of two Newton steps p ← p −
//! g ∇g/|∇g|² (the first-order distance, iterated twice). Over the faces the steps follow the
//! gradient at the centre of the face, and the second uses the slope measured by the first, so that
//! all samples of a face need one gradient and two batches of values. The length is still the
//! distance to a point of the surface, hence never less than the true distance by more than the
//! error of the iteration (of relative order θ⁴, with θ the angle that the face subtends).

use super::deciding::deciding_pieces;
use super::stars::blocks;
use super::{Defects, Options, Place};
use isoform_control::Control;
use isoform_geom::{Mesh, Point3, Solid, TRIANGLE_EDGES, cross, dot, norm, sub};
use rayon::prelude::*;
use std::collections::HashMap;

/// Number of nodes or triangles in a task.
const ITEMS_PER_TASK: usize = 256;
/// Samples of a face, in barycentric coordinates times 3: the centre, the midpoints of the edges,
/// and three points in between.
const FACE_SAMPLES: [Point3; 7] = [
    [1.0, 1.0, 1.0],
    [1.5, 1.5, 0.0],
    [0.0, 1.5, 1.5],
    [1.5, 0.0, 1.5],
    [2.0, 0.5, 0.5],
    [0.5, 2.0, 0.5],
    [0.5, 0.5, 2.0],
];
/// Maximum ratio of the second value to the first; above it the secant is not trusted, and the
/// sample gets gradients of its own.
const MAX_SECANT_RATIO: f64 = 0.5;
/// Marker of a label whose name is not a piece of the solid.
const UNKNOWN_LABEL: u32 = u32::MAX;

/// Distances of a mesh from a solid, in model units.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Deviation {
    /// Diagonal of the mesh, the unit of relative distance limits.
    pub diagonal: f64,
    /// Nodes of the surface, each from all the parts that its triangles are labelled with; next to
    /// a smooth seam, from the solid's surface.
    pub nodes: Distances,
    /// Mid nodes of the surface, likewise; empty unless the mesh is of second order.
    pub mids: Distances,
    /// Nodes and mid nodes of feature edges from both parts of their curves.
    pub curves: Distances,
    /// Samples of the faces (curved ones in a mesh of second order): the chord error. The mean is
    /// weighted by area.
    pub faces: Distances,
    /// Distances of nodes and faces by part, in the order of the mesh's labels.
    pub parts: Vec<PartDeviation>,
    /// Nodes on parts that do not bound the solid there; the value is that of the tree, evaluated
    /// on distances.
    pub misclassified: Defects,
    /// Labels of triangles or curves that are not pieces of the solid.
    pub unknown_parts: Vec<String>,
}

impl Deviation {
    /// Returns an empty deviation for a mesh with these labels.
    fn new(diagonal: f64, labels: &Labels<'_>) -> Self {
        let named = |part: &String| PartDeviation {
            part: part.clone(),
            ..PartDeviation::default()
        };
        Self {
            diagonal,
            parts: labels.names.iter().map(named).collect(),
            unknown_parts: labels.unknown.clone(),
            ..Self::default()
        }
    }
}

/// Distances of one part.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PartDeviation {
    /// Name of the part.
    pub part: String,
    /// Distances of its nodes.
    pub nodes: Distances,
    /// Distances of samples of its faces.
    pub faces: Distances,
}

/// Statistics of the distances of points from a surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Distances {
    /// Number of points.
    pub count: usize,
    /// Largest distance; infinite where the iteration fails.
    pub max: f64,
    /// Root mean square distance.
    pub rms: f64,
    /// Place of the largest distance.
    pub worst: Option<Place>,
}

/// Partial sums for [`Distances`], joined in a fixed order.
#[derive(Default)]
struct DistanceSums {
    /// Number of points.
    count: usize,
    /// Sum of the weights.
    weight: f64,
    /// Sum of the weighted squares of the distances.
    squares: f64,
    /// Largest distance.
    max: f64,
    /// Place of the largest distance.
    worst: Option<Place>,
}

impl DistanceSums {
    /// Adds a distance with its weight; NaN counts as infinite.
    fn add(&mut self, distance: f64, weight: f64, place: impl FnOnce() -> Place) {
        let distance = if distance.is_nan() {
            f64::INFINITY
        } else {
            distance
        };
        self.count += 1;
        self.weight += weight;
        self.squares += weight * distance * distance;
        if self.worst.is_none() || distance > self.max {
            (self.max, self.worst) = (
                distance,
                Some(Place {
                    value: distance,
                    ..place()
                }),
            );
        }
    }
    /// Adds the sums over later points.
    fn append(&mut self, later: &Self) {
        self.count += later.count;
        self.weight += later.weight;
        self.squares += later.squares;
        if self.worst.is_none() || later.max > self.max {
            (self.max, self.worst) = (later.max, later.worst.clone());
        }
    }
    /// Returns the statistics of the distances added so far.
    fn distances(self) -> Distances {
        let rms = if self.weight > 0.0 {
            (self.squares / self.weight).sqrt()
        } else {
            0.0
        };
        Distances {
            count: self.count,
            max: self.max,
            rms,
            worst: self.worst,
        }
    }
}

/// Measures the distances of the surface's triangles from the solid. After a stop by `control` some
/// are left out.
pub(super) fn measure(
    mesh: &Mesh,
    triangles: &[[u32; 3]],
    solid: &dyn Solid,
    options: &Options<'_>,
    control: &Control<'_>,
) -> Deviation {
    let diagonal = mesh.bounds().diagonal();
    let labels = Labels::new(mesh, triangles, solid, control);
    let mut out = Deviation::new(diagonal, &labels);
    let compared = Comparison {
        mesh,
        triangles,
        solid,
        labels: &labels,
        enough: options.limits.node_distance * diagonal,
    };
    let nodes = labelled_nodes(triangles, &labels.of_triangles);
    let parts = &mut out.parts;
    out.nodes = joined(compared.nodes(&nodes), |k, found| parts[k].nodes = found);
    if !mesh.triangle_mids.is_empty() {
        let mids = labelled_nodes(&mesh.triangle_mids, &labels.of_triangles);
        out.mids = joined(compared.nodes(&mids), |_, _| {});
    }
    // Feature edges lie on both of their parts, whatever the angle between these.
    let on_curves = Comparison {
        enough: f64::INFINITY,
        ..compared
    };
    out.curves = joined(on_curves.nodes(&curve_nodes(mesh)), |_, _| {});
    out.faces = joined(compared.faces(), |k, found| parts[k].faces = found);
    out.misclassified = compared.misclassified(&nodes, options.places);
    out
}

/// Labels of the triangles, and the pieces of the solid that they denote.
struct Labels<'c> {
    /// Name of each label.
    names: Vec<String>,
    /// Piece of each label, or [`UNKNOWN_LABEL`].
    pieces: Vec<u32>,
    /// Label of each triangle.
    of_triangles: Vec<u32>,
    /// Names of labels in use that are not pieces of the solid.
    unknown: Vec<String>,
    control: &'c Control<'c>,
}

impl<'c> Labels<'c> {
    /// Takes the labels of the mesh, or assigns labels by position if it has none.
    fn new(
        mesh: &Mesh,
        triangles: &[[u32; 3]],
        solid: &dyn Solid,
        control: &'c Control<'c>,
    ) -> Self {
        if mesh.triangle_parts.len() == triangles.len() {
            Self::by_name(mesh, solid, control)
        } else {
            Self::by_place(mesh, triangles, solid, control)
        }
    }

    /// Labels each triangle with the piece of the solid that decides at its centre.
    fn by_place(
        mesh: &Mesh,
        triangles: &[[u32; 3]],
        solid: &dyn Solid,
        control: &'c Control<'c>,
    ) -> Self {
        let names = solid.names().to_vec();
        Self {
            pieces: (0..names.len() as u32).collect(),
            names,
            of_triangles: deciding(mesh, triangles, solid, control),
            unknown: Vec::new(),
            control,
        }
    }

    /// Matches the labels of the mesh to the solid's pieces by name.
    fn by_name(mesh: &Mesh, solid: &dyn Solid, control: &'c Control<'c>) -> Self {
        let names = solid.names().iter().zip(0..);
        let known: HashMap<&str, u32> = names.map(|(n, piece)| (n.as_str(), piece)).collect();
        let piece = |name: &String| known.get(name.as_str()).copied().unwrap_or(UNKNOWN_LABEL);
        let pieces: Vec<u32> = mesh.parts.iter().map(piece).collect();
        let mut used = vec![false; pieces.len()];
        let on_curves = mesh.curves.iter().flat_map(|c| c.parts);
        for label in mesh.triangle_parts.iter().copied().chain(on_curves) {
            used[label as usize] = true;
        }
        let unknown = (0..pieces.len())
            .filter(|&k| used[k] && pieces[k] == UNKNOWN_LABEL)
            .map(|k| mesh.parts[k].clone())
            .collect();
        Self {
            names: mesh.parts.clone(),
            pieces,
            of_triangles: mesh.triangle_parts.clone(),
            unknown,
            control,
        }
    }
}

/// Returns the piece that decides at the centre of each triangle, by distances.
fn deciding(
    mesh: &Mesh,
    triangles: &[[u32; 3]],
    solid: &dyn Solid,
    control: &Control<'_>,
) -> Vec<u32> {
    let center = |t: &[u32; 3]| -> Point3 {
        std::array::from_fn(|i| t.iter().map(|&k| mesh.points[k as usize][i]).sum::<f64>() / 3.0)
    };
    triangles
        .par_iter()
        .map(|t| {
            if control.is_stopped() {
                return 0;
            }
            solid
                .tree()
                .value_and_piece(&|k| signed_distance(solid, k, center(t)))
                .1
        })
        .collect()
}

/// Returns the first-order distance to a piece, with the sign of its value.
fn signed_distance(solid: &dyn Solid, piece: u32, p: Point3) -> f64 {
    let (v, g) = solid.gradient(piece, p);
    if v == 0.0 { 0.0 } else { v / norm(g) }
}

/// Returns all distinct pairs of label and node, sorted; `nodes` are the corners or the mid nodes
/// of triangles.
fn labelled_nodes(nodes: &[[u32; 3]], labels: &[u32]) -> Vec<(u32, u32)> {
    let mut pairs: Vec<(u32, u32)> = nodes
        .iter()
        .zip(labels)
        .flat_map(|(t, &label)| t.map(|node| (label, node)))
        .collect();
    pairs.par_sort_unstable();
    pairs.dedup();
    pairs
}

/// Returns all distinct pairs of label and node on feature edges, sorted.
fn curve_nodes(mesh: &Mesh) -> Vec<(u32, u32)> {
    let mut pairs = Vec::new();
    for (k, &curve) in mesh.edge_curves.iter().enumerate() {
        for label in mesh.curves[curve as usize].parts {
            pairs.extend(
                mesh.edges[k]
                    .iter()
                    .chain(mesh.edge_mids.get(k))
                    .map(|&node| (label, node)),
            );
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// Returns the statistics over all labels, and passes those of each label to `each`.
fn joined(by_label: Vec<(u32, DistanceSums)>, mut each: impl FnMut(usize, Distances)) -> Distances {
    let mut all = DistanceSums::default();
    for (label, sums) in by_label {
        all.append(&sums);
        each(label as usize, sums.distances());
    }
    all.distances()
}

/// Returns the distance to the surface of a piece: the length of two Newton steps.
fn distance(solid: &dyn Solid, piece: u32, p: Point3) -> f64 {
    let mut q = p;
    for _ in 0..2 {
        let (v, g) = solid.gradient(piece, q);
        if v == 0.0 {
            break;
        }
        let step = v / dot(g, g);
        q = std::array::from_fn(|i| q[i] - step * g[i]);
    }
    let d = norm(sub(q, p));
    if d.is_nan() { f64::INFINITY } else { d }
}

/// Cosine of the largest angle, 20 degrees, between two pieces that count as one smooth surface:
/// next to the seam of pieces that touch tangentially, a node of a face may lie on the neighbouring
/// piece. Half an edge away from the seam, the angle is about that subtended by an edge.
const MIN_SMOOTH_COSINE: f64 = 0.94;

/// Returns the distance of a node from its piece; where another piece bounds the solid and forms
/// one smooth surface with it, the lesser of both distances.
fn node_distance(solid: &dyn Solid, piece: u32, p: Point3, enough: f64) -> f64 {
    let d = distance(solid, piece, p);
    if d <= enough {
        return d;
    }
    let (_, other) = solid
        .tree()
        .value_and_piece(&|k| signed_distance(solid, k, p));
    let [a, b] = [piece, other].map(|k| solid.gradient(k, p).1);
    if other != piece && dot(a, b) > MIN_SMOOTH_COSINE * norm(a) * norm(b) {
        d.min(distance(solid, other, p))
    } else {
        d
    }
}

/// Applies `work` to chunks of items with one label, given sorted by label, and that label's piece.
fn by_label<T: Sync>(
    items: &[T],
    label: impl Fn(&T) -> u32,
    labels: &Labels<'_>,
    work: impl Fn(u32, &[T]) -> DistanceSums + Sync,
) -> Vec<(u32, DistanceSums)> {
    let tasks: Vec<(u32, &[T])> = items
        .chunk_by(|a, b| label(a) == label(b))
        .filter(|group| labels.pieces[label(&group[0]) as usize] != UNKNOWN_LABEL)
        .flat_map(|group| {
            group
                .chunks(ITEMS_PER_TASK)
                .map(|chunk| (label(&chunk[0]), chunk))
        })
        .collect();
    let done: Vec<(u32, DistanceSums)> = tasks
        .into_par_iter()
        .map(|(label, chunk)| match labels.control.is_stopped() {
            true => (label, DistanceSums::default()),
            false => (label, work(labels.pieces[label as usize], chunk)),
        })
        .collect();
    joined_by_label(done)
}

/// Joins the sums of consecutive chunks with one label.
fn joined_by_label(chunks: Vec<(u32, DistanceSums)>) -> Vec<(u32, DistanceSums)> {
    let mut out: Vec<(u32, DistanceSums)> = Vec::new();
    for (label, sums) in chunks {
        match out.last_mut() {
            Some(last) if last.0 == label => last.1.append(&sums),
            _ => out.push((label, sums)),
        }
    }
    out
}

/// A mesh and the solid that it is compared with.
#[derive(Clone, Copy)]
struct Comparison<'m> {
    mesh: &'m Mesh,
    triangles: &'m [[u32; 3]],
    solid: &'m dyn Solid,
    labels: &'m Labels<'m>,
    /// Acceptable distance of nodes, in model units; alternatives are tried only above it.
    enough: f64,
}

/// Samples of faces of one piece, with their Newton steps.
struct Approach {
    samples: Vec<Point3>,
    /// ∇g/|∇g|² at the centre of each face.
    normals: Vec<Point3>,
    /// Values at the samples, and at the points reached by the first step.
    values: [Vec<f64>; 2],
}

impl Comparison<'_> {
    /// Measures the distances of nodes from the parts they are labelled with, by label. The pairs
    /// must be sorted; pairs with unknown labels are left out.
    fn nodes(&self, pairs: &[(u32, u32)]) -> Vec<(u32, DistanceSums)> {
        let distances = |piece: u32, chunk: &[(u32, u32)]| {
            let mut sums = DistanceSums::default();
            for &(_, node) in chunk {
                let at = self.mesh.points[node as usize];
                let d = node_distance(self.solid, piece, at, self.enough);
                sums.add(d, 1.0, || Place {
                    at,
                    nodes: vec![node],
                    ..Place::default()
                });
            }
            sums
        };
        by_label(pairs, |pair| pair.0, self.labels, distances)
    }

    /// Measures the distances of samples of the faces from their parts, by label.
    fn faces(&self) -> Vec<(u32, DistanceSums)> {
        let labels = self.labels.of_triangles.iter().enumerate();
        let mut order: Vec<(u32, u32)> = labels.map(|(k, &label)| (label, k as u32)).collect();
        order.par_sort_unstable();
        let distances = |piece: u32, chunk: &[(u32, u32)]| self.distances_of_faces(piece, chunk);
        by_label(&order, |item| item.0, self.labels, distances)
    }

    /// Measures the distances of samples of faces, given with their label, from a piece.
    fn distances_of_faces(&self, piece: u32, faces: &[(u32, u32)]) -> DistanceSums {
        let approach = self.approach(piece, faces);
        let mut sums = DistanceSums::default();
        for (i, &p) in approach.samples.iter().enumerate() {
            let d = approach
                .distance(i)
                .unwrap_or_else(|| distance(self.solid, piece, p));
            let k = faces[i / FACE_SAMPLES.len()].1;
            let t = self.triangles[k as usize];
            let [a, b, c] = t.map(|i| self.mesh.points[i as usize]);
            let area = 0.5 * norm(cross(sub(b, a), sub(c, a)));
            sums.add(d, area, || Place {
                at: p,
                nodes: t.to_vec(),
                elements: vec![k],
                value: 0.0,
            });
        }
        sums
    }

    /// Evaluates a piece at samples of faces and after one step of each.
    fn approach(&self, piece: u32, faces: &[(u32, u32)]) -> Approach {
        let samples: Vec<Point3> = faces
            .iter()
            .flat_map(|&(_, k)| samples(self.mesh, self.triangles, k as usize))
            .collect();
        let normal = |s: &[Point3]| {
            let g = self.solid.gradient(piece, s[0]).1;
            let gg = dot(g, g);
            g.map(|v| v / gg)
        };
        let normals: Vec<Point3> = samples.chunks(FACE_SAMPLES.len()).map(normal).collect();
        let mut first = vec![0.0; samples.len()];
        self.solid.values(&[piece], &samples, &mut first);
        let step = |i: usize, s: f64| -> Point3 {
            std::array::from_fn(|c| samples[i][c] - s * normals[i / FACE_SAMPLES.len()][c])
        };
        let moved: Vec<Point3> = (0..samples.len()).map(|i| step(i, first[i])).collect();
        let mut second = vec![0.0; samples.len()];
        self.solid.values(&[piece], &moved, &mut second);
        Approach {
            samples,
            normals,
            values: [first, second],
        }
    }

    /// Finds the surface nodes where the value of the tree, evaluated on distances, exceeds the
    /// limit.
    ///
    /// Values of pieces are not distances in general. The piece that decides by values is therefore
    /// measured first; only if it is too far away is the tree evaluated on the distances of all
    /// pieces.
    fn misclassified(&self, pairs: &[(u32, u32)], room: usize) -> Defects {
        let mut nodes: Vec<u32> = pairs.iter().map(|pair| pair.1).collect();
        nodes.par_sort_unstable();
        nodes.dedup();
        let place = |i: &u32| self.mesh.points[*i as usize];
        let points: Vec<Point3> = nodes.iter().map(place).collect();
        let deciding = deciding_pieces(self.solid, &points, self.labels.control);
        let parts: Vec<Defects> = blocks(nodes.len(), ITEMS_PER_TASK)
            .into_par_iter()
            .map(|range| match self.labels.control.is_stopped() {
                true => Defects::default(),
                false => self.misclassified_among(&nodes[range.clone()], &deciding[range], room),
            })
            .collect();
        let mut all = Defects::default();
        parts.into_iter().for_each(|part| all.append(room, part));
        all
    }

    /// Finds the misclassified nodes among some, in their order, each given with the piece that
    /// decides by values.
    fn misclassified_among(&self, nodes: &[u32], deciding: &[u32], room: usize) -> Defects {
        let solid = self.solid;
        let mut defects = Defects::default();
        for (&node, &piece) in nodes.iter().zip(deciding) {
            let p = self.mesh.points[node as usize];
            if signed_distance(solid, piece, p).abs() <= self.enough {
                continue;
            }
            let value = solid.tree().value(&|k| signed_distance(solid, k, p));
            if value.is_nan() || value.abs() > self.enough {
                defects.add(room, || Place {
                    at: p,
                    nodes: vec![node],
                    elements: Vec::new(),
                    value,
                });
            }
        }
        defects
    }
}

impl Approach {
    /// Returns the distance of a sample by the secant through both values; `None` if the first step
    /// did not come near enough, so that the sample needs gradients of its own.
    fn distance(&self, i: usize) -> Option<f64> {
        let [v, w] = [&self.values[0], &self.values[1]].map(|values| values[i]);
        if v == 0.0 {
            Some(0.0)
        } else if w.abs() < MAX_SECANT_RATIO * v.abs() {
            Some((v * v / (v - w)).abs() * norm(self.normals[i / FACE_SAMPLES.len()]))
        } else {
            None
        }
    }
}

/// Returns the sample points of a triangle, flat or curved.
fn samples(mesh: &Mesh, triangles: &[[u32; 3]], k: usize) -> [Point3; 7] {
    let p = triangles[k].map(|i| mesh.points[i as usize]);
    let mids = mesh
        .triangle_mids
        .get(k)
        .map(|m| m.map(|i| mesh.points[i as usize]));
    FACE_SAMPLES.map(|s| {
        let l = s.map(|v| v / 3.0);
        match mids {
            None => std::array::from_fn(|i| l[0] * p[0][i] + l[1] * p[1][i] + l[2] * p[2][i]),
            Some(m) => curved_point(p, m, l),
        }
    })
}

/// Returns the point of a triangle of second order at the barycentric coordinates λ: X = Σ λᵢ(2λᵢ −
/// 1)Pᵢ + 4 Σ λₐλᵦMₐᵦ.
fn curved_point(p: [Point3; 3], m: [Point3; 3], l: Point3) -> Point3 {
    std::array::from_fn(|i| {
        let corners: f64 = (0..3).map(|c| l[c] * (2.0 * l[c] - 1.0) * p[c][i]).sum();
        TRIANGLE_EDGES
            .iter()
            .zip(m)
            .fold(corners, |sum, (&[a, b], m)| sum + 4.0 * l[a] * l[b] * m[i])
    })
}
