//! A given volume mesh made better on the solid that it stands for.
//!
//! The faces of its boundary are given to the pieces of the solid that they lie on, its vertices brought onto them, and its tetrahedra
//! optimised like those of the mesher's own lattice.

use crate::check;
use crate::complex::{BOUNDARY, Complex};
use crate::cut::Inside;
use crate::features::{FeatureOptions, extent, find};
use crate::lattice::{Lattice, unique};
use crate::mesher::{CELL, Control, MeshError, Meshed, Options, Warning, assemble, check_options, improve, raise_order};
use crate::optimise::Optimiser;
use crate::surface::Surface;
use isoform_geom::{Mesh, Point3, Solid, TET_EDGES, cross, dot, norm, sub};

/// Improves a mesh of tetrahedra on a solid near its surface: its vertices are moved onto the parts, tetrahedra optimised, edges of the
/// surface split where they leave it too far. Mid nodes and labels of the mesh given are dropped. `options.size` should be near the
/// mesh's own edge length; [`mean_edge`] gives it.
///
/// # Errors
/// As of [`mesh`](crate::mesh), and if the mesh is not a conforming volume mesh or its surface is nowhere near the solid's.
pub fn adapt(mesh: &Mesh, solid: &dyn Solid, options: &Options, control: &Control<'_>) -> Result<Meshed, MeshError> {
    check_options(options)?;
    let wrong = |why: &str| MeshError::Input { why: why.to_owned() };
    if mesh.tets.is_empty() {
        return Err(wrong("has no tetrahedra"));
    }
    control.phase("check")?;
    let bare = Mesh { points: mesh.points.clone(), tets: mesh.tets.clone(), ..Mesh::default() };
    let certificate = check::certify(&bare, None, &check::Options::default(), control);
    match certificate.volume {
        Some(v) if v.inverted.is_empty() && v.flat.is_empty() && v.crowded_faces.is_empty() => {}
        Some(_) => return Err(wrong("has inverted or overlapping tetrahedra")),
        None => return Err(wrong("is malformed")),
    }
    control.phase("lattice")?;
    let found = extent(solid, mesh.bounds(), options.size)?;
    let lattice = Lattice::new(solid, found.bounds, CELL * options.size);
    let surface = Surface { solid, lattice: &lattice, zero: 1e-13 * found.bounds.diagonal() };
    let features = find(solid, found.bounds, &FeatureOptions { size: options.size, ..FeatureOptions::default() }, control);
    let mut complex = Complex::new(bare.points, bare.tets);
    let (far, faces) = label(&mut complex, &surface, options.size);
    if far.len() > faces / 4 {
        return Err(wrong("has a surface that is nowhere near the model's"));
    }
    let mut warnings: Vec<Warning> =
        far.into_iter().map(|at| Warning { message: "a face of the mesh lies on no part of the model".into(), at: Some(at) }).collect();
    let n = complex.points.len();
    let inside = Inside { complex, frozen: vec![false; n], number: (0..n as u32).collect(), stray: Vec::new() };
    control.phase("optimisation")?;
    let mut optimiser = Optimiser::new(&surface, inside, options.size, control);
    let number: Vec<u32> = (0..n as u32).collect();
    improve(&mut optimiser, options, &mut warnings);
    control.phase("assembly")?;
    let (mut mesh, pieces) = assemble(optimiser, &number, n, Vec::new(), Vec::new(), options);
    raise_order(&mut mesh, &surface, &pieces, options, control, &mut warnings)?;
    Ok(Meshed { mesh, region: found.bounds, region_certified: found.certified, caps: Vec::new(), features, warnings })
}

/// Mean length of the edges of a mesh's tetrahedra; 0 if there are none.
pub fn mean_edge(mesh: &Mesh) -> f64 {
    let length = |t: &[u32; 4], [i, j]: [usize; 2]| norm(sub(mesh.points[t[i] as usize], mesh.points[t[j] as usize]));
    let sum: f64 = mesh.tets.iter().flat_map(|t| TET_EDGES.map(|e| length(t, e))).sum();
    sum / (6 * mesh.tets.len().max(1)) as f64
}

/// Labels the boundary: each face gets the piece that is nearest at its middle and faces its way, among those that bound the solid there.
/// Returns the middles of faces without one, and the number of all.
fn label(complex: &mut Complex, surface: &Surface<'_>, size: f64) -> (Vec<Point3>, usize) {
    let (mut far, mut faces) = (Vec::new(), 0);
    for t in 0..complex.tets.len() as u32 {
        for i in 0..4 {
            if complex.adjacent[t as usize][i] < BOUNDARY {
                continue;
            }
            faces += 1;
            let p = complex.face(t, i).map(|v| complex.points[v as usize]);
            let middle: Point3 = std::array::from_fn(|k| (p[0][k] + p[1][k] + p[2][k]) / 3.0);
            match nearest_piece(surface, p, middle, size) {
                Some(piece) => complex.adjacent[t as usize][i] = BOUNDARY | piece,
                None => {
                    complex.adjacent[t as usize][i] = BOUNDARY | crate::complex::STRAY;
                    far.push(middle);
                }
            }
        }
    }
    (far, faces)
}

fn nearest_piece(surface: &Surface<'_>, p: [Point3; 3], middle: Point3, size: f64) -> Option<u32> {
    let k = surface.lattice.state_at(middle).checked_sub(2)? as usize;
    let (tree, pieces) = &surface.lattice.trees[k];
    let normal = cross(sub(p[1], p[0]), sub(p[2], p[0]));
    let mut best: Option<(f64, u32)> = None;
    for piece in unique(pieces.clone()) {
        let Some(q) = surface.project(&[piece], middle) else { continue };
        // Where the piece does not bound the solid at its nearest point, the solid's own value there is not 0.
        // All three vertices must be near.
        let corners = p.iter().map(|v| surface.distance(piece, *v).abs()).fold(0.0, f64::max);
        let off = corners.max(norm(sub(q, middle))) + tree.value(&|i| surface.distance(i, q)).abs();
        let g = surface.solid.gradient(piece, q).1;
        let facing = -dot(normal, g) / (norm(normal) * norm(g)).max(1e-300);
        if facing > 0.1 && off < size && best.is_none_or(|b| off + size * (1.0 - facing) < b.0) {
            best = Some((off + size * (1.0 - facing), piece));
        }
    }
    best.map(|b| b.1)
}
