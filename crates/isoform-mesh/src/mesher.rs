//! The way from a solid to a mesh.

use crate::complex::NONE;
use crate::cut::{Band, Cutter};
use crate::lattice::Lattice;
use crate::optimise::Optimiser;
use crate::surface::Surface;
use isoform_geom::{Aabb, Curve, Mesh, Solid, norm};

/// Edge of a lattice cell for tetrahedra as large as regular ones of edge 1: a³/12 = √2/12.
const CELL: f64 = 1.122_462_048_309_373;

/// What to make.
#[derive(Clone, Debug)]
pub struct Options {
    /// Edge length wanted.
    pub size: f64,
    /// Only the surface.
    pub surface_only: bool,
    /// Measure below which tetrahedra are optimised: the sine of the dihedral angles, obtuse ones weighted by 0.7.
    pub goal: f64,
    /// Rounds of optimisation at most.
    pub rounds: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { size: 0.1, surface_only: false, goal: 0.36, rounds: 30 }
    }
}

/// Meshes the solid, which must lie within the region.
pub fn mesh(solid: &dyn Solid, region: Aabb, options: &Options) -> Mesh {
    let trace = std::env::var_os("ISOFORM_TRACE").is_some();
    let clock = std::time::Instant::now();
    let say = |what: &str| {
        if trace {
            eprintln!("{:8.3} s  {what}", clock.elapsed().as_secs_f64());
        }
    };
    let lattice = Lattice::new(solid, region, CELL * options.size);
    say(&format!("lattice {:?}, {} trees", lattice.n, lattice.trees.len()));
    let surface = Surface { solid, lattice: &lattice, zero: 1e-13 * region.diagonal() };
    let Band { complex, frozen, core, core_points } = Band::new(&lattice, !options.surface_only);
    let band_points = complex.points.len();
    say(&format!("band of {} tets, core of {}", complex.tets.len(), core.len()));
    let mut cutter = Cutter::new(&surface, complex, frozen);
    cutter.run();
    say(&format!("cut: {} tets, {:?}", cutter.complex.live().count(), cutter.trouble));
    let inside = cutter.inside();
    let inside = cutter.finish(&inside);
    say(&format!("inside: {} tets, {} stray faces", inside.complex.tets.len(), inside.stray));
    let number = inside.number.clone();
    let mut optimiser = Optimiser::new(&surface, inside);
    optimiser.run(options.goal, options.rounds);
    say("optimised");
    assemble(solid, optimiser, &number, band_points, core, core_points, options)
}

fn assemble(
    solid: &dyn Solid,
    optimiser: Optimiser<'_>,
    number: &[u32],
    band_points: usize,
    core: Vec<[u32; 4]>,
    core_points: Vec<isoform_geom::Point3>,
    options: &Options,
) -> Mesh {
    let faces = optimiser.faces();
    let complex = &optimiser.complex;
    let mut new = vec![NONE; complex.points.len()];
    let mut mesh = Mesh::default();
    if options.surface_only {
        for (f, _) in &faces {
            for &v in f {
                if new[v as usize] == NONE {
                    new[v as usize] = mesh.points.len() as u32;
                    mesh.points.push(complex.points[v as usize]);
                }
            }
        }
    } else {
        for v in 0..new.len() {
            if complex.tet_of[v] != NONE {
                new[v] = mesh.points.len() as u32;
                mesh.points.push(complex.points[v]);
            }
        }
        let offset = mesh.points.len() as u32;
        mesh.points.extend(core_points);
        mesh.tets = complex.live().map(|t| complex.tets[t as usize].map(|v| new[v as usize])).collect();
        mesh.tets.extend(core.iter().map(|t| {
            t.map(|v| {
                if (v as usize) < band_points { new[number[v as usize] as usize] } else { v - band_points as u32 + offset }
            })
        }));
        mesh.tet_regions = vec![0; mesh.tets.len()];
        mesh.regions = vec!["solid".to_owned()];
    }
    let mut part_of = vec![NONE; solid.names().len()];
    let mut used: Vec<u32> = faces.iter().map(|f| f.1).filter(|&l| (l as usize) < part_of.len()).collect();
    used.sort_unstable();
    used.dedup();
    for (k, &piece) in used.iter().enumerate() {
        part_of[piece as usize] = k as u32;
        mesh.parts.push(solid.names()[piece as usize].clone());
    }
    mesh.triangles = faces.iter().map(|(f, _)| f.map(|v| new[v as usize])).collect();
    mesh.triangle_parts = faces.iter().map(|(_, l)| part_of.get(*l as usize).copied().unwrap_or(0)).collect();
    feature_edges(solid, &used, &mut mesh);
    mesh
}

/// Edges between faces of two parts that meet at an angle.
fn feature_edges(solid: &dyn Solid, pieces: &[u32], mesh: &mut Mesh) {
    let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * mesh.triangles.len());
    for (f, &part) in mesh.triangles.iter().zip(&mesh.triangle_parts) {
        for i in 0..3 {
            let (a, b) = (f[i], f[(i + 1) % 3]);
            edges.push(([a.min(b), a.max(b)], part));
        }
    }
    edges.sort_unstable();
    let mut found: Vec<([u32; 2], [u32; 2])> = Vec::new();
    for same in edges.chunk_by(|a, b| a.0 == b.0) {
        let parts = [same[0].1, same[same.len() - 1].1];
        if parts[0] == parts[1] {
            continue;
        }
        let [p, q] = same[0].0.map(|v| mesh.points[v as usize]);
        let middle = std::array::from_fn(|i| 0.5 * (p[i] + q[i]));
        let [a, b] = parts.map(|k| solid.gradient(pieces[k as usize], middle).1);
        let sine = norm(isoform_geom::cross(a, b)) / (norm(a) * norm(b)).max(1e-300);
        if sine > crate::surface::TANGENT || isoform_geom::dot(a, b) < 0.0 {
            found.push((parts, same[0].0));
        }
    }
    found.sort_unstable();
    for same in found.chunk_by(|a, b| a.0 == b.0) {
        let curve = mesh.curves.len() as u32;
        let parts = same[0].0;
        let name = format!("{}/{}", mesh.parts[parts[0] as usize], mesh.parts[parts[1] as usize]);
        mesh.curves.push(Curve { name, parts });
        for (_, e) in same {
            mesh.edges.push(*e);
            mesh.edge_curves.push(curve);
        }
    }
}
