//! How truly a mesh follows a solid.
//!
//! The distance of a point to the surface of a piece g is the length of two Newton steps p ← p − g
//! ∇g/|∇g|² (the first order distance, iterated twice). Over the faces the steps go along the
//! gradient at the centre of the face, the second one with the slope that the first has met: one
//! gradient and two rounds of values in blocks for all samples of a face, and what is measured is
//! still the distance to a point of the surface, never less than the true one by more than the
//! error of the iteration (relatively of the order of the angle that a face subtends to the power
//! of four).

use super::stars::blocks;
use super::{Defects, Limits, Options, Place};
use isoform_control::Control;
use isoform_geom::{Csg, Mesh, Point3, Solid, TRIANGLE_EDGES, cross, dot, norm, sub};
use rayon::prelude::*;

/// Nodes or triangles per task.
const TASK: usize = 256;
/// Where faces are sampled, by barycentric coordinates times 3: the centre, the middles of the
/// edges, and between.
const SAMPLES: [Point3; 7] = [
    [1.0, 1.0, 1.0],
    [1.5, 1.5, 0.0],
    [0.0, 1.5, 1.5],
    [1.5, 0.0, 1.5],
    [2.0, 0.5, 0.5],
    [0.5, 2.0, 0.5],
    [0.5, 0.5, 2.0],
];
/// No piece: a label whose name the solid does not know.
const UNKNOWN: u32 = u32::MAX;

/// Distances of a mesh to a solid, in the units of the model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Deviation {
    /// Diagonal of the mesh, which the limits of distances are shares of.
    pub diagonal: f64,
    /// Nodes of the surface from all the parts that their triangles are labelled with; next to a
    /// smooth seam from the solid's surface.
    pub nodes: Distances,
    /// Mid nodes of the surface likewise; of a mesh of second order.
    pub mids: Distances,
    /// Nodes and mid nodes of feature edges from both parts of their curves.
    pub curves: Distances,
    /// Points of the faces (curved ones, of a mesh of second order): the chord error. The mean is
    /// taken by area.
    pub faces: Distances,
    /// The same by parts, in the order of the mesh's labels.
    pub parts: Vec<PartDeviation>,
    /// Nodes on parts that are not the solid's surface there; the value is that of the tree, by
    /// distances.
    pub misclassified: Defects,
    /// Labels of triangles or curves that the solid does not know.
    pub unknown_parts: Vec<String>,
}

/// Distances of one part.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PartDeviation {
    /// Its name.
    pub part: String,
    /// Nodes.
    pub nodes: Distances,
    /// Points of the faces.
    pub faces: Distances,
}

/// Some distances.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Distances {
    /// How many.
    pub count: usize,
    /// The largest; infinite where there is no way to the surface.
    pub max: f64,
    /// The root of their mean square.
    pub rms: f64,
    /// Where the largest is.
    pub worst: Option<Place>,
}

/// Sums towards [`Distances`], joined in a fixed order.
#[derive(Default)]
struct Sums {
    count: usize,
    weight: f64,
    squares: f64,
    max: f64,
    worst: Option<Place>,
}

impl Sums {
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
    fn append(&mut self, later: &Self) {
        self.count += later.count;
        self.weight += later.weight;
        self.squares += later.squares;
        if self.worst.is_none() || later.max > self.max {
            (self.max, self.worst) = (later.max, later.worst.clone());
        }
    }
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

/// Distances of the surface's triangles to the solid. On a stop by `control` some are left out.
pub(super) fn measure(
    mesh: &Mesh,
    triangles: &[[u32; 3]],
    solid: &dyn Solid,
    options: &Options<'_>,
    control: &Control<'_>,
) -> Deviation {
    let diagonal = mesh.bounds().diagonal();
    let mut out = Deviation {
        diagonal,
        ..Deviation::default()
    };
    let labels = Labels::new(mesh, triangles, solid, control);
    out.unknown_parts.clone_from(&labels.unknown);
    let mut parts: Vec<PartDeviation> = labels
        .names
        .iter()
        .map(|part| PartDeviation {
            part: part.clone(),
            ..PartDeviation::default()
        })
        .collect();

    let nodes = labelled_nodes(triangles, &labels.of_triangles);
    let enough = options.limits.node_distance * diagonal;
    let mut all = Sums::default();
    for (label, sums) in node_distances(mesh, solid, &labels, &nodes, enough) {
        all.append(&sums);
        parts[label as usize].nodes = sums.distances();
    }
    out.nodes = all.distances();
    if !mesh.triangle_mids.is_empty() {
        out.mids = joined(node_distances(
            mesh,
            solid,
            &labels,
            &labelled_nodes(&mesh.triangle_mids, &labels.of_triangles),
            enough,
        ));
    }
    // Feature edges are on both of their parts, whatever the angle.
    out.curves = joined(node_distances(
        mesh,
        solid,
        &labels,
        &curve_nodes(mesh),
        f64::INFINITY,
    ));

    let mut all = Sums::default();
    for (label, sums) in face_distances(mesh, triangles, solid, &labels) {
        all.append(&sums);
        parts[label as usize].faces = sums.distances();
    }
    out.faces = all.distances();
    out.parts = parts;
    out.misclassified = misclassified(
        mesh,
        &nodes,
        solid,
        diagonal,
        &options.limits,
        options.places,
        control,
    );
    out
}

/// The labels of the triangles, and the pieces of the solid that they mean.
struct Labels<'c> {
    names: Vec<String>,
    /// The piece of each label, or [`UNKNOWN`].
    pieces: Vec<u32>,
    of_triangles: Vec<u32>,
    unknown: Vec<String>,
    control: &'c Control<'c>,
}

impl<'c> Labels<'c> {
    /// Those of the mesh, found among the solid's by name. Without labels, the piece that decides
    /// at the centre of each triangle.
    fn new(
        mesh: &Mesh,
        triangles: &[[u32; 3]],
        solid: &dyn Solid,
        control: &'c Control<'c>,
    ) -> Self {
        if mesh.triangle_parts.len() != triangles.len() {
            let names = solid.names().to_vec();
            let pieces = (0..names.len() as u32).collect();
            let of_triangles = deciding(mesh, triangles, solid, control);
            return Self {
                names,
                pieces,
                of_triangles,
                unknown: Vec::new(),
                control,
            };
        }
        let piece = |name: &String| {
            solid
                .names()
                .iter()
                .position(|n| n == name)
                .map_or(UNKNOWN, |i| i as u32)
        };
        let pieces: Vec<u32> = mesh.parts.iter().map(piece).collect();
        let mut used = vec![false; pieces.len()];
        mesh.triangle_parts
            .iter()
            .for_each(|&label| used[label as usize] = true);
        mesh.curves
            .iter()
            .flat_map(|c| c.parts)
            .for_each(|label| used[label as usize] = true);
        let unknown = (0..pieces.len())
            .filter(|&k| used[k] && pieces[k] == UNKNOWN)
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

/// All pieces of the solid at some points: piece k at point i is number k · points + i.
fn all_values(solid: &dyn Solid, points: &[Point3]) -> Vec<f64> {
    let which: Vec<u32> = (0..solid.names().len() as u32).collect();
    let mut out = vec![0.0; which.len() * points.len()];
    solid.values(&which, points, &mut out);
    out
}

/// The piece that decides, by distances, at the centre of each triangle.
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

/// The first order distance to a piece, with the sign of its value.
fn signed_distance(solid: &dyn Solid, piece: u32, p: Point3) -> f64 {
    let (v, g) = solid.gradient(piece, p);
    if v == 0.0 { 0.0 } else { v / norm(g) }
}

/// All different pairs of label and node, sorted; `nodes` are those of triangles, corners or mid
/// nodes.
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

/// All different pairs of label and node on feature edges, sorted.
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

fn joined(by_label: Vec<(u32, Sums)>) -> Distances {
    let mut all = Sums::default();
    by_label.iter().for_each(|(_, sums)| all.append(sums));
    all.distances()
}

/// Two Newton steps to the surface of a piece: how far.
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

/// Cosine of the largest angle between pieces at a node that count as one smooth surface: next to
/// the seam of pieces that touch tangentially a node of a face may lie on the neighbouring piece.
/// At half an edge from the seam that is the angle an edge may turn.
const SMOOTH: f64 = 0.94;

/// Distance of a node to a piece, or to the one that is the solid's surface there if both make one
/// smooth surface.
fn node_distance(solid: &dyn Solid, piece: u32, p: Point3, enough: f64) -> f64 {
    let d = distance(solid, piece, p);
    if d <= enough {
        return d;
    }
    let (_, other) = solid
        .tree()
        .value_and_piece(&|k| signed_distance(solid, k, p));
    let [a, b] = [piece, other].map(|k| solid.gradient(k, p).1);
    if other != piece && dot(a, b) > SMOOTH * norm(a) * norm(b) {
        d.min(distance(solid, other, p))
    } else {
        d
    }
}

/// Distances of nodes to the parts they are labelled with, by labels. The pairs are sorted; those
/// with unknown labels are left out.
fn node_distances(
    mesh: &Mesh,
    solid: &dyn Solid,
    labels: &Labels<'_>,
    pairs: &[(u32, u32)],
    enough: f64,
) -> Vec<(u32, Sums)> {
    by_label(
        pairs,
        |pair| pair.0,
        labels,
        |piece, chunk| {
            let mut sums = Sums::default();
            for &(_, node) in chunk {
                let at = mesh.points[node as usize];
                sums.add(node_distance(solid, piece, at, enough), 1.0, || Place {
                    at,
                    nodes: vec![node],
                    ..Place::default()
                });
            }
            sums
        },
    )
}

/// Works on items sorted by label in chunks of one label, with the label's piece.
fn by_label<T: Sync>(
    items: &[T],
    label: impl Fn(&T) -> u32,
    labels: &Labels<'_>,
    work: impl Fn(u32, &[T]) -> Sums + Sync,
) -> Vec<(u32, Sums)> {
    let tasks: Vec<(u32, &[T])> = items
        .chunk_by(|a, b| label(a) == label(b))
        .filter(|group| labels.pieces[label(&group[0]) as usize] != UNKNOWN)
        .flat_map(|group| group.chunks(TASK).map(|chunk| (label(&chunk[0]), chunk)))
        .collect();
    let done: Vec<(u32, Sums)> = tasks
        .into_par_iter()
        .map(|(label, chunk)| match labels.control.is_stopped() {
            true => (label, Sums::default()),
            false => (label, work(labels.pieces[label as usize], chunk)),
        })
        .collect();
    let mut out: Vec<(u32, Sums)> = Vec::new();
    for (label, sums) in done {
        match out.last_mut() {
            Some(last) if last.0 == label => last.1.append(&sums),
            _ => out.push((label, sums)),
        }
    }
    out
}

/// Distances of samples of the faces to their parts, by labels.
fn face_distances(
    mesh: &Mesh,
    triangles: &[[u32; 3]],
    solid: &dyn Solid,
    labels: &Labels<'_>,
) -> Vec<(u32, Sums)> {
    let mut order: Vec<(u32, u32)> = labels
        .of_triangles
        .iter()
        .enumerate()
        .map(|(k, &label)| (label, k as u32))
        .collect();
    order.par_sort_unstable();
    by_label(
        &order,
        |item| item.0,
        labels,
        |piece, chunk| {
            let samples: Vec<Point3> = chunk
                .iter()
                .flat_map(|&(_, k)| samples(mesh, triangles, k as usize))
                .collect();
            let normals: Vec<Point3> = samples
                .chunks(SAMPLES.len())
                .map(|s| {
                    let g = solid.gradient(piece, s[0]).1;
                    let gg = dot(g, g);
                    g.map(|v| v / gg)
                })
                .collect();
            let mut first = vec![0.0; samples.len()];
            solid.values(&[piece], &samples, &mut first);
            let step = |i: usize, s: f64| -> Point3 {
                std::array::from_fn(|c| samples[i][c] - s * normals[i / SAMPLES.len()][c])
            };
            let moved: Vec<Point3> = (0..samples.len()).map(|i| step(i, first[i])).collect();
            let mut second = vec![0.0; samples.len()];
            solid.values(&[piece], &moved, &mut second);
            let mut sums = Sums::default();
            for (i, &p) in samples.iter().enumerate() {
                let (v, w) = (first[i], second[i]);
                // By the secant through both values; where the first step has not got near, by
                // gradients of its own.
                let d = if v == 0.0 {
                    0.0
                } else if w.abs() < 0.5 * v.abs() {
                    (v * v / (v - w)).abs() * norm(normals[i / SAMPLES.len()])
                } else {
                    distance(solid, piece, p)
                };
                let k = chunk[i / SAMPLES.len()].1;
                let t = triangles[k as usize];
                let [a, b, c] = t.map(|i| mesh.points[i as usize]);
                let area = 0.5 * norm(cross(sub(b, a), sub(c, a)));
                sums.add(d, area, || Place {
                    at: p,
                    nodes: t.to_vec(),
                    elements: vec![k],
                    value: 0.0,
                });
            }
            sums
        },
    )
}

/// The sample points of a triangle, flat or curved.
fn samples(mesh: &Mesh, triangles: &[[u32; 3]], k: usize) -> [Point3; 7] {
    let p = triangles[k].map(|i| mesh.points[i as usize]);
    let mids = mesh
        .triangle_mids
        .get(k)
        .map(|m| m.map(|i| mesh.points[i as usize]));
    SAMPLES.map(|s| {
        let l = s.map(|v| v / 3.0);
        std::array::from_fn(|i| match &mids {
            None => l[0] * p[0][i] + l[1] * p[1][i] + l[2] * p[2][i],
            Some(m) => {
                let corners: f64 = (0..3).map(|c| l[c] * (2.0 * l[c] - 1.0) * p[c][i]).sum();
                TRIANGLE_EDGES
                    .iter()
                    .zip(m)
                    .fold(corners, |sum, (&[a, b], m)| sum + 4.0 * l[a] * l[b] * m[i])
            }
        })
    })
}

/// Surface nodes where the tree, by distances, is farther from zero than the limit.
///
/// The values of the pieces need not be distances, so the piece that decides by values is asked for
/// its distance first; only where that is too much are the distances of all pieces put into the
/// tree.
fn misclassified(
    mesh: &Mesh,
    pairs: &[(u32, u32)],
    solid: &dyn Solid,
    diagonal: f64,
    limits: &Limits,
    room: usize,
    control: &Control<'_>,
) -> Defects {
    let mut nodes: Vec<u32> = pairs.iter().map(|pair| pair.1).collect();
    nodes.par_sort_unstable();
    nodes.dedup();
    let (tree, limit): (&Csg, f64) = (solid.tree(), limits.node_distance * diagonal);
    let parts: Vec<Defects> = blocks(nodes.len(), TASK)
        .into_par_iter()
        .map(|range| {
            let mut defects = Defects::default();
            if control.is_stopped() {
                return defects;
            }
            let points: Vec<Point3> = nodes[range.clone()]
                .iter()
                .map(|&i| mesh.points[i as usize])
                .collect();
            let (values, n) = (all_values(solid, &points), points.len());
            for (i, &p) in points.iter().enumerate() {
                let (_, piece) = tree.value_and_piece(&|k| values[k as usize * n + i]);
                if signed_distance(solid, piece, p).abs() <= limit {
                    continue;
                }
                let value = tree.value(&|k| signed_distance(solid, k, p));
                if value.is_nan() || value.abs() > limit {
                    defects.add(room, || Place {
                        at: p,
                        nodes: vec![nodes[range.start + i]],
                        elements: Vec::new(),
                        value,
                    });
                }
            }
            defects
        })
        .collect();
    let mut all = Defects::default();
    parts.into_iter().for_each(|part| all.append(room, part));
    all
}
