//! The way from a solid to a mesh.

use crate::cap::Capped;
use crate::complex::{NONE, labelled_edges};
use crate::crowd::Crowd;
use crate::cut::{Band, Cutter};
use crate::features::{ExtentError, FeatureOptions, Features, START, extent_within, find};
use crate::lattice::Lattice;
use crate::optimise::Optimiser;
use crate::refine::{bisect, bisect_near, follow, resolve};
use crate::second::add_middles;
use crate::surface::{Surface, first_order_at, meet_at_an_angle};
use isoform_control::{Control, Stopped};
use isoform_geom::{Aabb, Curve, KdTree, Mesh, Point3, Solid};
use std::sync::Arc;

/// Edge of a lattice cell for tetrahedra as large as regular ones of edge 1: a³/12 = √2/12.
pub(crate) const CELL: f64 = 1.122_462_048_309_373;

/// Rounds in which the lattice is halved where it proves too coarse to be cut.
const FINER: usize = 3;

/// What to make.
#[derive(Clone, Debug)]
pub struct Options {
    /// Edge length wanted, the largest one where sizes vary.
    pub size: f64,
    /// Smaller edges where a face would leave the surface by more than this (chordal error, model
    /// units).
    pub grade: Option<f64>,
    /// Smaller edges where this says so, by place.
    pub sizes: Option<Sizes>,
    /// 1 for straight edges, 2 for nodes in their middles, on the true surface.
    pub order: u32,
    /// Only the surface.
    pub surface_only: bool,
    /// The box to mesh in: what sticks out is cut off, the cuts are parts named `cap.x_min` and so
    /// on. The solid's own box if not given.
    pub region: Option<Aabb>,
    /// Tetrahedra are optimised until their angles lie within these bounds (degrees), or nothing
    /// helps any more.
    pub angles: [f64; 2],
    /// Bytes that the mesher may use at most, by its own estimate.
    pub memory: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            size: 0.1,
            grade: None,
            sizes: None,
            order: 1,
            surface_only: false,
            region: None,
            angles: [21.0, 149.0],
            memory: 16 << 30,
        }
    }
}

/// Edge lengths wanted by place, in model units. What is not positive or no number counts as no
/// wish.
#[derive(Clone)]
pub struct Sizes(pub Arc<dyn Fn(Point3) -> f64 + Send + Sync>);

impl std::fmt::Debug for Sizes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Sizes")
    }
}

impl Sizes {
    /// From samples: the size of the nearest one, growing with the distance to it by no more than
    /// `growth` per length.
    pub fn nearest(samples: &[(Point3, f64)], growth: f64) -> Self {
        let tree = KdTree::new(&samples.iter().map(|s| s.0).collect::<Vec<_>>());
        let sizes: Vec<f64> = samples.iter().map(|s| s.1).collect();
        Self(Arc::new(move |p| {
            tree.nearest(p)
                .map_or(f64::INFINITY, |(i, d)| sizes[i] + growth * d.sqrt())
        }))
    }

    pub(crate) fn at(&self, p: Point3) -> f64 {
        let s = (self.0)(p);
        if s > 0.0 { s } else { f64::INFINITY }
    }
}

/// Why there is no mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// The solid has no box.
    #[error(transparent)]
    Extent(ExtentError),
    /// An option has no meaning.
    #[error("{name} must be {wanted}, not {value}")]
    Option {
        /// The option.
        name: &'static str,
        /// What it must be.
        wanted: &'static str,
        /// What it is.
        value: f64,
    },
    /// The mesh would not fit.
    #[error("a mesh of size {size} takes about {needed} MiB, {allowed} MiB are allowed")]
    Memory {
        /// Edge length asked for.
        size: f64,
        /// MiB by estimate.
        needed: u64,
        /// MiB allowed.
        allowed: u64,
    },
    /// The function is not a number at a place where the mesh needs it.
    #[error("the function is not a number near ({}, {}, {})", .at[0], .at[1], .at[2])]
    NotANumber {
        /// Where.
        at: Point3,
    },
    /// The solid is so thin or small that no lattice point or edge meets it.
    #[error("nothing of the solid is seen at size {size}")]
    TooCoarse {
        /// Edge length asked for.
        size: f64,
    },
    /// A mesh given to be adapted is no volume mesh of the solid.
    #[error("the mesh given {why}")]
    Input {
        /// What is wrong with it.
        why: String,
    },
    /// A fault of the mesher.
    #[error("the mesher made an error of its own: {what}")]
    Internal {
        /// What it left.
        what: String,
    },
    /// Stopped from outside or by time.
    #[error("stopped")]
    Stopped,
}

impl From<Stopped> for MeshError {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}

impl From<ExtentError> for MeshError {
    fn from(error: ExtentError) -> Self {
        match error {
            ExtentError::Stopped => Self::Stopped,
            ExtentError::NotANumber { at } => Self::NotANumber { at },
            error => Self::Extent(error),
        }
    }
}

/// A mesh and how it came about.
#[derive(Clone, Debug)]
pub struct Meshed {
    /// The mesh.
    pub mesh: Mesh,
    /// The box that was meshed.
    pub region: Aabb,
    /// Whether intervals prove that nothing of the solid lies outside of the box.
    pub region_certified: bool,
    /// Names of the caps where the box cuts the solid.
    pub caps: Vec<String>,
    /// The feature curves and corners of the solid.
    pub features: Features,
    /// Places where the solid could not be resolved, with what happened there.
    pub warnings: Vec<Warning>,
}

/// A place where the mesh may not follow the solid.
#[derive(Clone, Debug, PartialEq)]
pub struct Warning {
    /// What happened.
    pub message: String,
    /// Where, as far as there is one place.
    pub at: Option<Point3>,
}

/// Meshes a solid: tetrahedra with the labelled surface, or the surface alone.
///
/// # Errors
/// If the solid is empty, unbounded or not a number, if an option has no meaning, the memory does
/// not suffice, or on a stop.
pub fn mesh(
    solid: &dyn Solid,
    options: &Options,
    control: &Control<'_>,
) -> Result<Meshed, MeshError> {
    check_options(options)?;
    control.begin("extent")?;
    let start = options.region.unwrap_or(START);
    let capped;
    let (solid, region, region_certified): (&dyn Solid, Aabb, bool) = match options.region {
        Some(region) => {
            capped = Capped::new(solid, region);
            let extent = extent_within(&capped, start, options.size, control)?;
            (&capped, extent.bounds, extent.certified)
        }
        None => {
            let extent = extent_within(solid, start, options.size, control)?;
            (solid, extent.bounds, extent.certified)
        }
    };
    let cell = CELL * options.size;
    // Some 12 bytes per cell of the lattice and 400 per tetrahedron near the surface, 60 for
    // others.
    let needed = (Lattice::cells(region, cell) * 12.0 * 60.0) as u64;
    if needed > options.memory {
        return Err(MeshError::Memory {
            size: options.size,
            needed: needed >> 20,
            allowed: options.memory >> 20,
        });
    }
    control.begin("lattice")?;
    let lattice = Lattice::new(solid, region, cell, control);
    control.check()?;
    let surface = Surface {
        solid,
        lattice: &lattice,
        zero: 1e-13 * region.diagonal(),
        control,
    };
    if let Some(at) = surface.not_a_number() {
        return Err(MeshError::NotANumber { at });
    }
    control.check()?;
    let graded = options.grade.is_some() || options.sizes.is_some();
    let Band {
        mut complex,
        mut frozen,
        core,
        core_points,
    } = Band::new(&lattice, !options.surface_only, graded, control);
    let band_points = complex.points.len();
    let mut warnings = Vec::new();
    let limit = (options.memory / 400) as usize;
    control.begin("features")?;
    let features = find(
        solid,
        region,
        &FeatureOptions {
            size: options.size,
            ..FeatureOptions::default()
        },
        control,
    );
    let crowd = Crowd::new(&features, options.size);
    if !crowd.is_empty() {
        let mut found = Vec::new();
        bisect(control, &mut complex, &mut frozen, limit, |complex, t| {
            CELL * crowd.size_at(complex.middle(t), &mut found)
        });
    }
    control.begin("sizes")?;
    if follow(&surface, &mut complex, &mut frozen, limit, CELL, options) {
        warnings.push(Warning {
            message: "sizes were not refined as far as asked for: the limit of memory was met"
                .into(),
            at: None,
        });
    }
    control.begin("surface")?;
    let hidden = resolve(&surface, &mut complex, &mut frozen, limit);
    warnings.extend(hidden.into_iter().map(|at| Warning {
        message: "the surface is finer than the mesh can resolve here".into(),
        at: Some(at),
    }));
    control.check()?;
    let mut cutter = Cutter::new(&surface, complex.clone(), frozen.clone(), control);
    if let Some(at) = cutter.not_a_number() {
        return Err(MeshError::NotANumber { at });
    }
    control.check()?;
    cutter.run();
    for _ in 0..FINER {
        if cutter.undecided.is_empty() || control.is_stopped() {
            break;
        }
        // Too coarse there: halved, and cut again.
        let places = KdTree::new(&cutter.undecided);
        bisect_near(control, &mut complex, &mut frozen, limit, &places);
        cutter = Cutter::new(&surface, complex.clone(), frozen.clone(), control);
        cutter.run();
    }
    control.check()?;
    if let Some(&at) = cutter.undecided.first() {
        let message = format!(
            "{} tetrahedra could not be cut to the end: pieces touch too often for this size",
            cutter.undecided.len()
        );
        warnings.push(Warning {
            message,
            at: Some(at),
        });
    }
    let inside = cutter.inside();
    let inside = cutter.finish(&inside);
    if inside.complex.tets.is_empty() && core.is_empty() {
        return Err(MeshError::TooCoarse { size: options.size });
    }
    let stray = inside.stray.iter().map(|&at| Warning {
        message: "a face of the surface lies on no single part".into(),
        at: Some(at),
    });
    warnings.extend(stray);
    let number = inside.number.clone();
    control.begin("optimisation")?;
    let mut optimiser = Optimiser::new(&surface, inside, options.size, control);
    improve(&mut optimiser, options, &mut warnings);
    control.begin("assembly")?;
    let (mut mesh, pieces) = assemble(optimiser, &number, band_points, core, core_points, options)?;
    raise_order(
        &mut mesh,
        &surface,
        &pieces,
        options,
        control,
        &mut warnings,
    )?;
    let caps = mesh
        .parts
        .iter()
        .filter(|p| options.region.is_some() && p.starts_with("cap."))
        .cloned()
        .collect();
    Ok(Meshed {
        mesh,
        region,
        region_certified,
        caps,
        features,
        warnings,
    })
}

/// Optimises, brings every vertex onto the surface, and splits what leaves it too far.
pub(crate) fn improve(
    optimiser: &mut Optimiser<'_>,
    options: &Options,
    warnings: &mut Vec<Warning>,
) {
    let goal = options.angles[0]
        .to_radians()
        .sin()
        .max(0.7 * options.angles[1].to_radians().sin());
    optimiser.run(goal);
    let off = optimiser.settle(goal);
    warnings.extend(off.into_iter().map(|at| Warning {
        message: "a vertex could not be brought onto the surface".into(),
        at: Some(at),
    }));
    optimiser.refine_surface(options.grade.unwrap_or(f64::INFINITY), goal);
    optimiser.split_ears(0.5 * goal);
}

/// Middles of edges, if they are asked for.
pub(crate) fn raise_order(
    mesh: &mut Mesh,
    surface: &Surface<'_>,
    pieces: &[u32],
    options: &Options,
    control: &Control<'_>,
    warnings: &mut Vec<Warning>,
) -> Result<(), MeshError> {
    if options.order == 2 {
        control.begin("second order")?;
        let off = add_middles(mesh, surface, pieces);
        warnings.extend(off.into_iter().map(|at| Warning {
            message: "a mid-edge node could not be brought onto the surface".into(),
            at: Some(at),
        }));
    }
    Ok(())
}

pub(crate) fn check_options(options: &Options) -> Result<(), MeshError> {
    let positive = |name, value: f64| {
        if value > 0.0 && value.is_finite() {
            Ok(())
        } else {
            Err(MeshError::Option {
                name,
                wanted: "a positive number",
                value,
            })
        }
    };
    positive("size", options.size)?;
    if let Some(grade) = options.grade {
        positive("grade", grade)?;
    }
    if !(1..=2).contains(&options.order) {
        return Err(MeshError::Option {
            name: "order",
            wanted: "1 or 2",
            value: f64::from(options.order),
        });
    }
    Ok(())
}

pub(crate) fn assemble(
    optimiser: Optimiser<'_>,
    number: &[u32],
    band_points: usize,
    core: Vec<[u32; 4]>,
    core_points: Vec<Point3>,
    options: &Options,
) -> Result<(Mesh, Vec<u32>), MeshError> {
    let faces = optimiser.faces();
    let (surface, complex) = (optimiser.surface, &optimiser.complex);
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
        mesh.tets = complex
            .live()
            .map(|t| complex.tets[t as usize].map(|v| new[v as usize]))
            .collect();
        mesh.tets.extend(core.iter().map(|t| {
            t.map(|v| {
                if (v as usize) < band_points {
                    new[number[v as usize] as usize]
                } else {
                    v - band_points as u32 + offset
                }
            })
        }));
        mesh.tet_regions = vec![0; mesh.tets.len()];
        mesh.regions = vec!["solid".to_owned()];
    }
    if let Some(at) = faces
        .iter()
        .flat_map(|(f, _)| f)
        .find(|&&v| new[v as usize] == NONE)
    {
        let [x, y, z] = complex.points[*at as usize];
        let what = format!("a vertex of the surface at ({x}, {y}, {z}) lost its tetrahedra");
        return Err(MeshError::Internal { what });
    }
    let pieces = group(surface, &faces, &new, &mut mesh);
    Ok((mesh, pieces))
}

/// Gives a mesh its labelled triangles, parts, curves and corners; `new` are the numbers of the
/// vertices in it. Returns the pieces of its parts.
pub(crate) fn group(
    surface: &Surface<'_>,
    faces: &[([u32; 3], u32)],
    new: &[u32],
    mesh: &mut Mesh,
) -> Vec<u32> {
    let names = surface.solid.names();
    let mut part_of = vec![NONE; names.len()];
    let mut used: Vec<u32> = faces
        .iter()
        .map(|f| f.1)
        .filter(|&l| (l as usize) < part_of.len())
        .collect();
    used.sort_unstable();
    used.dedup();
    for (k, &piece) in used.iter().enumerate() {
        part_of[piece as usize] = k as u32;
        mesh.parts.push(names[piece as usize].clone());
    }
    mesh.triangles = faces
        .iter()
        .map(|(f, _)| f.map(|v| new[v as usize]))
        .collect();
    mesh.triangle_parts = faces
        .iter()
        .map(|(_, l)| part_of.get(*l as usize).copied().unwrap_or(0))
        .collect();
    feature_edges(surface, &used, mesh);
    used
}

/// Edges between faces of two parts that meet at an angle, where the ends lie on both: seams of
/// parts that touch are none.
fn feature_edges(surface: &Surface<'_>, pieces: &[u32], mesh: &mut Mesh) {
    let edges = labelled_edges(
        mesh.triangles
            .iter()
            .copied()
            .zip(mesh.triangle_parts.iter().copied()),
    );
    let mut found: Vec<([u32; 2], [u32; 2])> = Vec::new();
    for same in edges.chunk_by(|a, b| a.0 == b.0) {
        let parts = [same[0].1, same[same.len() - 1].1];
        let on_both = |v: u32| {
            parts.iter().all(|&k| {
                first_order_at(surface.solid, pieces[k as usize], mesh.points[v as usize]).abs()
                    <= surface.zero
            })
        };
        if parts[0] == parts[1] || !same[0].0.iter().all(|&v| on_both(v)) {
            continue;
        }
        let [p, q] = same[0].0.map(|v| mesh.points[v as usize]);
        let middle = std::array::from_fn(|i| 0.5 * (p[i] + q[i]));
        if meet_at_an_angle(surface.solid, parts.map(|k| pieces[k as usize]), middle) {
            found.push((parts, same[0].0));
        }
    }
    found.sort_unstable();
    for same in found.chunk_by(|a, b| a.0 == b.0) {
        let curve = mesh.curves.len() as u32;
        let parts = same[0].0;
        let name = format!(
            "{}/{}",
            mesh.parts[parts[0] as usize], mesh.parts[parts[1] as usize]
        );
        mesh.curves.push(Curve { name, parts });
        for (_, e) in same {
            mesh.edges.push(*e);
            mesh.edge_curves.push(curve);
        }
    }
    // A node where anything but two edges of one curve meet is a corner.
    let mut ends: Vec<(u32, u32)> = mesh
        .edges
        .iter()
        .zip(&mesh.edge_curves)
        .flat_map(|(e, &c)| e.map(|v| (v, c)))
        .collect();
    ends.sort_unstable();
    mesh.corners = ends
        .chunk_by(|a, b| a.0 == b.0)
        .filter(|at| at.len() != 2 || at[0].1 != at[1].1)
        .map(|at| at[0].0)
        .collect();
}
