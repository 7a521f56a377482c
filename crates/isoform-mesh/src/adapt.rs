//! A given mesh made better on the solid that it stands for.
//!
//! The faces of its surface are given to the pieces of the solid that they lie on, with edges along
//! those of the solid, and its vertices brought onto them. Then tetrahedra are optimised like those
//! of the mesher's own lattice, and bare triangles by splits, collapses, flips and moves.

mod align;
mod remesh;
mod skin;

use crate::check::{self, Certificate};
use crate::complex::{BOUNDARY, Complex, Ring};
use crate::cut::Inside;
use crate::features::{ExtentError, FeatureOptions, Features, extent_within, find};
use crate::lattice::{IN, Lattice, OUT};
use crate::measure::biased_sine;
use crate::mesher::{
    CELL, MeshError, Meshed, Options, Sizes, Warning, assemble, check_options, group, improve,
    raise_order,
};
use crate::optimise::Optimiser;
use crate::surface::{Surface, first_order_at};
use align::{Aligned, Cuttable, align, edges_of};
use isoform_control::Control;
use isoform_geom::{KdTree, Mesh, Point3, Solid, TET_EDGES, norm, sub};
use remesh::Remesher;
use skin::Skin;
use std::collections::HashMap;

/// Share of the diagonal by which a mesh may be off the model at all.
const OFF: f64 = 0.15;
/// Least share of the vertices that must be near the model.
const NEAR: f64 = 0.75;
/// Worst biased sine that a vertex of the surface moved onto a curve may leave to a tetrahedron;
/// less where it was less before.
const LEAST: f64 = 0.04;

fn wrong(why: impl Into<String>) -> MeshError {
    MeshError::Input { why: why.into() }
}

fn place([x, y, z]: Point3) -> String {
    format!("({x}, {y}, {z})")
}

/// Improves a mesh on a solid near its surface: its vertices are moved onto the parts, edges of the
/// surface laid along those of the solid, elements optimised, and edges split where they leave the
/// surface too far. Mid nodes and labels of the mesh given are dropped.
///
/// Tetrahedra keep their size; `options.size` should be near it, and [`mean_edge`] gives it. The
/// triangles of a bare surface are split and collapsed towards `options.size` and `options.sizes`;
/// [`own_sizes`] gives those that they have.
///
/// # Errors
/// As of [`mesh`](crate::mesh), and if the mesh is not a conforming volume mesh or a closed surface
/// without self-intersections, if its surface is nowhere near the solid's, or if its edges cannot
/// be made to follow those of the solid.
pub fn adapt(
    mesh: &Mesh,
    solid: &dyn Solid,
    options: &Options,
    control: &Control<'_>,
) -> Result<Meshed, MeshError> {
    if mesh.tets.is_empty() && mesh.triangles.is_empty() {
        return Err(wrong("has neither tetrahedra nor triangles"));
    }
    check_options(options)?;
    control.begin("check")?;
    let bare = welded(mesh);
    let certificate = check::certify(&bare, None, &check::Options::default(), control);
    check_given(&bare, &certificate)?;
    control.begin("lattice")?;
    let found =
        extent_within(solid, bare.bounds(), options.size, control).map_err(|e| match e {
            ExtentError::Empty { .. } => wrong("has nothing of the model near it"),
            e => e.into(),
        })?;
    let cell = (CELL * options.size).max(2.0 * distance(&bare, solid, found.bounds.diagonal())?);
    let needed = (Lattice::cells(found.bounds, cell) * 12.0) as u64;
    if needed > options.memory {
        return Err(MeshError::Memory {
            size: options.size,
            needed: needed >> 20,
            allowed: options.memory >> 20,
        });
    }
    let lattice = Lattice::new(solid, found.bounds, cell, control);
    let surface = Surface {
        solid,
        lattice: &lattice,
        zero: 1e-13 * found.bounds.diagonal(),
        control,
    };
    control.begin("features")?;
    let features = find(
        solid,
        found.bounds,
        &FeatureOptions {
            size: options.size,
            ..FeatureOptions::default()
        },
        control,
    );
    let mut warnings = Vec::new();
    let mesh = if bare.tets.is_empty() {
        of_triangles(bare, &surface, &features, options, control, &mut warnings)?
    } else {
        of_tetrahedra(bare, &surface, &features, options, control, &mut warnings)?
    };
    if let Some(at) = left_out(&mesh, &surface) {
        return Err(wrong(format!(
            "leaves out a part of the model near {}",
            place(at)
        )));
    }
    Ok(Meshed {
        mesh,
        region: found.bounds,
        region_certified: found.certified,
        caps: Vec::new(),
        features,
        warnings,
    })
}

/// The mesh without mid nodes, labels and unused nodes, nodes in the same place made one: files of
/// triangles repeat them.
fn welded(mesh: &Mesh) -> Mesh {
    let mut known: HashMap<[u64; 3], u32> = HashMap::new();
    let mut points = Vec::new();
    let mut number = |v: u32| {
        let p = mesh.points[v as usize];
        // Both zeros are one place.
        *known
            .entry(p.map(|x| (x + 0.0).to_bits()))
            .or_insert_with(|| {
                points.push(p);
                points.len() as u32 - 1
            })
    };
    let tets: Vec<[u32; 4]> = mesh.tets.iter().map(|t| t.map(&mut number)).collect();
    let bare_triangles = if tets.is_empty() {
        mesh.triangles.as_slice()
    } else {
        &[]
    };
    let triangles = bare_triangles.iter().map(|t| t.map(&mut number)).collect();
    Mesh {
        points,
        triangles,
        tets,
        ..Mesh::default()
    }
}

/// What cannot be worked on is refused, with a place.
fn check_given(mesh: &Mesh, certificate: &Certificate) -> Result<(), MeshError> {
    if !certificate.malformed.is_empty() {
        return Err(wrong("is malformed"));
    }
    if let Some(v) = &certificate.volume {
        let is_valid = v.inverted.is_empty() && v.flat.is_empty() && v.crowded_faces.is_empty();
        return if is_valid {
            Ok(())
        } else {
            Err(wrong("has inverted or overlapping tetrahedra"))
        };
    }
    let Some(s) = &certificate.surface else {
        return Err(wrong("has no inside"));
    };
    let findings = [
        (&s.open_edges, "is not closed: a triangle has no neighbour"),
        (
            &s.crowded_edges,
            "is no manifold: an edge has more than two triangles",
        ),
        (
            &s.pinched_nodes,
            "is no manifold: parts of the surface touch in one node",
        ),
        (&s.repeated_triangles, "has a triangle twice"),
        (
            &s.degenerate_triangles,
            "has a triangle with a corner twice",
        ),
        (
            &s.misoriented_edges,
            "is not oriented: neighbouring triangles face opposite ways",
        ),
        (&s.misplaced_shells, "has a shell that is inside out"),
    ];
    for (defects, why) in findings {
        if let Some(first) = defects.places.first() {
            return Err(wrong(format!("{why} at {}", place(first.at))));
        }
    }
    if let Some(first) = certificate
        .intersections
        .as_ref()
        .and_then(|i| i.pairs.places.first())
    {
        return Err(wrong(format!("intersects itself at {}", place(first.at))));
    }
    if mesh.points.len() < 4 {
        Err(wrong("has no inside"))
    } else {
        Ok(())
    }
}

/// The farthest that any vertex of a surface, or middle of a face, is from the solid; an error if
/// most are far away.
fn distance(mesh: &Mesh, solid: &dyn Solid, diagonal: f64) -> Result<f64, MeshError> {
    let tree = solid.tree();
    let value = |p: Point3| tree.value(&|i| first_order_at(solid, i, p)).abs();
    let (triangles, points) = (&mesh.triangles, &mesh.points);
    if triangles.is_empty() {
        return Ok(0.0);
    }
    let mut off: Vec<(f64, Point3)> = points.iter().map(|&p| (value(p), p)).collect();
    if let Some(at) = off.iter().find(|o| o.0.is_nan()) {
        return Err(MeshError::NotANumber { at: at.1 });
    }
    off.sort_by(|a, b| a.0.total_cmp(&b.0));
    let most = off[(NEAR * (off.len() - 1) as f64) as usize];
    if most.0 > OFF * diagonal {
        return Err(wrong(format!(
            "has a surface that is nowhere near the model's, as at {}",
            place(most.1)
        )));
    }
    let middles = triangles
        .iter()
        .map(|t| value(align::middle(t.map(|v| points[v as usize]))));
    let worst = middles.fold(off[off.len() - 1].0, f64::max);
    Ok(worst.min(OFF * diagonal))
}

/// What alignment left open: an error where most is far away, else warnings.
fn settled(aligned: &Aligned, n: usize, warnings: &mut Vec<Warning>) -> Result<(), MeshError> {
    if let (true, Some(&at)) = (
        (aligned.far.len() as f64) > (1.0 - NEAR) * n as f64,
        aligned.far.first(),
    ) {
        return Err(wrong(format!(
            "has a surface that is nowhere near the model's, as at {}",
            place(at)
        )));
    }
    let (missed, corners) = &aligned.missed;
    if let (true, Some(&at)) = (2 * missed.len() > *corners, missed.first()) {
        return Err(wrong(format!(
            "has nothing near most corners of the model, as at {}",
            place(at)
        )));
    }
    let warning = |message: &str, at: &Point3| Warning {
        message: message.into(),
        at: Some(*at),
    };
    warnings.extend(
        aligned
            .far
            .iter()
            .map(|at| warning("a vertex of the mesh given lies nowhere near the model", at)),
    );
    warnings.extend(aligned.lost.iter().map(|at| {
        warning(
            "the mesh given cannot be made to follow an edge of the model",
            at,
        )
    }));
    Ok(())
}

/// A bare surface.
fn of_triangles(
    bare: Mesh,
    surface: &Surface<'_>,
    features: &Features,
    options: &Options,
    control: &Control<'_>,
    warnings: &mut Vec<Warning>,
) -> Result<Mesh, MeshError> {
    control.begin("surface")?;
    let n = bare.points.len();
    let mut skin = Skin::new(bare.points, bare.triangles);
    let aligned = align(&mut skin, surface, features);
    settled(&aligned, n, warnings)?;
    Remesher::label(&mut skin, &aligned.labels);
    control.begin("optimisation")?;
    let mut remesher = Remesher::new(skin, surface, options, control);
    remesher.run();
    let off = remesher.off();
    warnings.extend(off.into_iter().map(|at| Warning {
        message: "a vertex could not be brought onto the surface".into(),
        at: Some(at),
    }));
    control.begin("assembly")?;
    let faces = remesher.faces();
    let mut number = vec![u32::MAX; remesher.skin.points.len()];
    let mut mesh = Mesh::default();
    for v in faces.iter().flat_map(|f| f.0) {
        let n = &mut number[v as usize];
        if *n == u32::MAX {
            *n = mesh.points.len() as u32;
            mesh.points.push(remesher.skin.points[v as usize]);
        }
    }
    let pieces = group(surface, &faces, &number, &mut mesh);
    raise_order(&mut mesh, surface, &pieces, options, control, warnings)?;
    Ok(mesh)
}

/// Tetrahedra.
fn of_tetrahedra(
    bare: Mesh,
    surface: &Surface<'_>,
    features: &Features,
    options: &Options,
    control: &Control<'_>,
    warnings: &mut Vec<Warning>,
) -> Result<Mesh, MeshError> {
    control.begin("surface")?;
    let mut complex = Complex::new(bare.points, bare.tets);
    let live: Vec<u32> = complex.live().collect();
    for t in live {
        complex.adjacent[t as usize]
            .iter_mut()
            .filter(|n| **n >= BOUNDARY)
            .for_each(|n| *n = BOUNDARY);
    }
    let mut boundary = Boundary { complex };
    let on_boundary = boundary.faces().len() / 2;
    let aligned = align(&mut boundary, surface, features);
    settled(&aligned, on_boundary, warnings)?;
    boundary.approach(&aligned.places, control);
    let mut complex = boundary.complex;
    let labels: HashMap<[u32; 3], u32> = aligned.labels.into_iter().collect();
    let live: Vec<u32> = complex.live().collect();
    for t in live {
        for i in 0..4 {
            if complex.adjacent[t as usize][i] >= BOUNDARY {
                complex.adjacent[t as usize][i] = BOUNDARY
                    | labels
                        .get(&complex.face(t, i))
                        .copied()
                        .unwrap_or(crate::complex::STRAY);
            }
        }
    }
    let n = complex.points.len();
    let number: Vec<u32> = (0..n as u32).collect();
    let inside = Inside {
        complex,
        frozen: vec![false; n],
        number: number.clone(),
        stray: Vec::new(),
    };
    control.begin("optimisation")?;
    let mut optimiser = Optimiser::new(surface, inside, options.size, control);
    improve(&mut optimiser, options, warnings);
    control.begin("assembly")?;
    let (mut mesh, pieces) = assemble(optimiser, &number, n, Vec::new(), Vec::new(), options)?;
    raise_order(&mut mesh, surface, &pieces, options, control, warnings)?;
    Ok(mesh)
}

/// The boundary of tetrahedra, cut with them.
struct Boundary {
    complex: Complex,
}

/// Rounds in which vertices approach their places on the surface, and what is around gives way.
const APPROACH: usize = 40;
/// Worst biased sine that a step of it may leave; the optimiser mends from there.
const TIGHT: f64 = 0.02;

impl Boundary {
    /// Brings vertices of the boundary to their places step by step, inner vertices giving way.
    fn approach(&mut self, places: &[Point3], control: &Control<'_>) {
        let on_boundary = crate::lattice::unique(self.faces().into_iter().flatten().collect());
        let mut left: Vec<u32> = on_boundary
            .iter()
            .copied()
            .filter(|&v| self.complex.points[v as usize] != places[v as usize])
            .collect();
        let mut star = Vec::new();
        for _ in 0..APPROACH {
            if left.is_empty() || control.is_stopped() {
                return;
            }
            left.retain(|&v| {
                let (old, goal) = (self.complex.points[v as usize], places[v as usize]);
                let least = TIGHT.min(self.worst_at(v, old));
                for share in [1.0, 0.6, 0.3, 0.1] {
                    let p = if share == 1.0 {
                        goal
                    } else {
                        std::array::from_fn(|i| old[i] + share * (goal[i] - old[i]))
                    };
                    if self.worst_at(v, p) >= least {
                        self.complex.points[v as usize] = p;
                        return share < 1.0;
                    }
                }
                true
            });
            let mut inner = Vec::new();
            for &v in &left {
                self.complex.star(v, &mut star);
                inner.extend(star.iter().flat_map(|&t| self.complex.tets[t as usize]));
            }
            for v in crate::lattice::unique(inner) {
                if on_boundary.binary_search(&v).is_err() {
                    self.give_way(v);
                }
            }
        }
    }

    /// Moves an inner vertex to the best of a few places around it.
    fn give_way(&mut self, v: u32) {
        let mut star = Vec::new();
        self.complex.star(v, &mut star);
        let p = self.complex.points[v as usize];
        let others: Vec<u32> = star
            .iter()
            .flat_map(|&t| self.complex.tets[t as usize])
            .filter(|&k| k != v)
            .collect();
        let mean: Point3 = std::array::from_fn(|i| {
            others
                .iter()
                .map(|&k| self.complex.points[k as usize][i])
                .sum::<f64>()
                / others.len() as f64
        });
        let step = norm(sub(self.complex.points[others[0] as usize], p));
        let mut best = (self.worst_at(v, p), p);
        let around = (0..6).map(|k| {
            std::array::from_fn(|i| {
                p[i] + if k / 2 == i {
                    [0.1, -0.1][k % 2] * step
                } else {
                    0.0
                }
            })
        });
        for q in around.chain([mean, std::array::from_fn(|i| 0.5 * (p[i] + mean[i]))]) {
            let worst = self.worst_at(v, q);
            if worst > best.0 {
                best = (worst, q);
            }
        }
        self.complex.points[v as usize] = best.1;
    }

    /// The worst tetrahedron at a vertex, were it at `p`.
    fn worst_at(&mut self, v: u32, p: Point3) -> f64 {
        let mut star = Vec::new();
        self.complex.star(v, &mut star);
        let at = |k: u32| {
            if k == v {
                p
            } else {
                self.complex.points[k as usize]
            }
        };
        star.iter()
            .map(|&t| biased_sine(self.complex.tets[t as usize].map(at)))
            .fold(f64::INFINITY, f64::min)
    }
}

impl Cuttable for Boundary {
    fn points(&self) -> &[Point3] {
        &self.complex.points
    }
    fn faces(&self) -> Vec<[u32; 3]> {
        let sides = self
            .complex
            .live()
            .flat_map(|t| (0..4).map(move |i| (t, i)));
        sides
            .filter(|&(t, i)| self.complex.adjacent[t as usize][i] >= BOUNDARY)
            .map(|(t, i)| self.complex.face(t, i))
            .collect()
    }
    fn move_to(&mut self, v: u32, p: Point3) -> bool {
        let before = self.worst_at(v, self.complex.points[v as usize]);
        let may = self.worst_at(v, p) > LEAST.min(0.5 * before);
        if may {
            self.complex.points[v as usize] = p;
        }
        may
    }
    fn settle(&mut self, v: u32, p: Point3) {
        // What is left of the way is the optimiser's, which makes room first.
        let old = self.complex.points[v as usize];
        for share in [1.0, 0.5, 0.25] {
            if self.move_to(v, std::array::from_fn(|i| old[i] + share * (p[i] - old[i]))) {
                return;
            }
        }
    }
    fn split(&mut self, [a, b]: [u32; 2], at: Point3, p: Point3) -> Option<u32> {
        let mut ring = Ring::default();
        if !self.complex.ring_of(a, b, &mut ring) || ring.closed {
            return None;
        }
        let m = self.complex.add_point(at);
        let mut made = Vec::new();
        self.complex.split(&ring, a, b, m, &mut made);
        self.settle(m, p);
        Some(m)
    }
}

/// A place of the solid's surface that the mesh does not reach, if there is one: in a cell with
/// surface there is a vertex no farther than an edge is long.
fn left_out(mesh: &Mesh, surface: &Surface<'_>) -> Option<Point3> {
    let tree = KdTree::new(&mesh.points);
    let longest = edges_of(&mesh.triangles)
        .into_iter()
        .map(|e| norm(sub(mesh.points[e[0] as usize], mesh.points[e[1] as usize])));
    let reach = longest.fold(0.0, f64::max).max(surface.lattice.a);
    let [nx, ny, _] = surface.lattice.n;
    let states = surface
        .lattice
        .state
        .iter()
        .enumerate()
        .filter(|(_, s)| **s != IN && **s != OUT);
    states
        .filter_map(|(k, _)| {
            let cell = [k % nx, k / nx % ny, k / nx / ny];
            let at = |d: [usize; 3]| {
                surface
                    .lattice
                    .point(std::array::from_fn(|i| 2 * (cell[i] + d[i])))
            };
            let (p, q) = (at([0; 3]), at([1; 3]));
            let (f, g) = (surface.value(p).0, surface.value(q).0);
            if !(f.is_finite() && g.is_finite() && (f < 0.0) != (g < 0.0)) {
                return None;
            }
            let (t, _) = surface.root(p, f, q, g)?;
            Some(std::array::from_fn(|i| p[i] + t * (q[i] - p[i])))
        })
        .find(|&p: &Point3| tree.nearest(p).is_some_and(|n| n.1 > reach * reach))
}

/// By how much sizes may grow per length, where those that a surface has are kept.
const GROWTH: f64 = 0.4;

/// The edge lengths that a surface has, by place: at each vertex the geometric mean of its edges,
/// growing slowly away from it.
pub fn own_sizes(mesh: &Mesh) -> Sizes {
    let mut sums = vec![(0.0, 0usize); mesh.points.len()];
    for e in edges_of(&mesh.triangles) {
        let l = norm(sub(mesh.points[e[0] as usize], mesh.points[e[1] as usize]));
        if l > 0.0 {
            e.iter().for_each(|&v| {
                sums[v as usize] = (sums[v as usize].0 + l.ln(), sums[v as usize].1 + 1)
            });
        }
    }
    let samples: Vec<(Point3, f64)> = mesh
        .points
        .iter()
        .zip(&sums)
        .filter(|(_, s)| s.1 > 0)
        .map(|(p, s)| (*p, (s.0 / s.1 as f64).exp()))
        .collect();
    Sizes::nearest(&samples, GROWTH)
}

/// Mean length of the edges of a mesh's tetrahedra, of its triangles where it has none; 0 if there
/// are neither.
pub fn mean_edge(mesh: &Mesh) -> f64 {
    let length = |a: u32, b: u32| norm(sub(mesh.points[a as usize], mesh.points[b as usize]));
    if mesh.tets.is_empty() {
        let edges = edges_of(&mesh.triangles);
        return edges.iter().map(|e| length(e[0], e[1])).sum::<f64>() / edges.len().max(1) as f64;
    }
    let sum: f64 = mesh
        .tets
        .iter()
        .flat_map(|t| TET_EDGES.map(|[i, j]| length(t[i], t[j])))
        .sum();
    sum / (6 * mesh.tets.len()) as f64
}
