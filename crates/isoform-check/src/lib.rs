//! The certificate of a mesh: everything that could be wrong with it, looked for.
//!
//! [`certify`] decides topology by indices and geometry by exact signs, never by a tolerance: a
//! mesh without [`failures`] has a surface that is closed, oriented, manifold and free of
//! self-intersections, and tetrahedra that fill its inside exactly once (the argument is in the
//! module of [`Volume`]). Shape and distances are measured in doubles. Each kind of finding keeps
//! its first places, up to [`Options::places`]; counts are always full. A mesh gives one and the
//! same certificate for any number of threads.
//!
//! ```
//! use isoform_geom::Mesh;
//! use isoform_check::{Options, certify};
//! use isoform_control::Control;
//!
//! let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
//! let mut mesh = Mesh::from_triangles(points, vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]);
//! let certificate = certify(&mesh, None, &Options::default(), &Control::default());
//! assert!(certificate.is_ok() && certificate.surface.is_some_and(|s| s.euler == 2));
//!
//! mesh.triangles.pop();
//! let failures = certify(&mesh, None, &Options::default(), &Control::default()).failures();
//! assert_eq!(failures[0].to_string(), "3 edges of one triangle only");
//! ```
//!
//! [`failures`]: Certificate::failures

#![forbid(unsafe_code)]

mod boxes;
mod cap;
mod coverage;
mod deciding;
mod defects;
mod deviation;
mod elements;
mod exact;
mod failure;
mod format;
mod intersections;
mod opposite;
pub mod quality;
mod stars;
mod surface;
mod volume;
mod wedges;

pub use cap::Capped;
pub use coverage::Coverage;
pub use defects::{Defects, Place};
pub use deviation::{Deviation, Distances, PartDeviation};
pub use elements::{CurvedQuality, Lengths, TetQuality, TriangleQuality};
pub use exact::triangles_meet;
pub use failure::Failure;
pub use format::Malformed;
pub use intersections::Intersections;
pub use opposite::OppositeSides;
pub use surface::{Shell, Surface};
pub use volume::Volume;
pub use wedges::WedgeQuality;

use isoform_control::Control;
use isoform_geom::{Aabb, Mesh, Point3, Solid};

/// What to compare a mesh with, and how much of what is found to keep.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// How many places are kept of each kind of finding.
    pub places: usize,
    /// The search for self-intersections ends when more pairs than this were found: a surface that
    /// lies on itself has a number of them that grows with the square of its size.
    pub pairs: usize,
    /// Feature curves that the mesh must have edges along, as polylines.
    pub curves: &'a [Vec<Point3>],
    /// Corners that the mesh must have nodes at.
    pub corners: &'a [Point3],
    /// The size of elements that was asked for; it tells how near edges must be to feature curves.
    /// Without it the mean edge length of the surface serves.
    pub size: Option<f64>,
    /// The box at which the solid was cut off, if it was: its sides are parts of the solid then.
    pub region: Option<Aabb>,
    /// The axes along which that box is a unit cell: its sides across these must be one.
    pub periodic: [bool; 3],
    /// What is acceptable.
    pub limits: Limits,
}

impl Default for Options<'_> {
    fn default() -> Self {
        Self {
            places: 20,
            pairs: 10_000_000,
            curves: &[],
            corners: &[],
            size: None,
            region: None,
            periodic: [false; 3],
            limits: Limits::default(),
        }
    }
}

/// What is acceptable. Topology, orientation and self-intersections know no measure: there any
/// finding is a failure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Smallest acceptable dihedral angle of tetrahedra, in degrees; 0 accepts all positive ones.
    pub dihedral_min: f64,
    /// Largest acceptable dihedral angle of tetrahedra, in degrees.
    pub dihedral_max: f64,
    /// Smallest acceptable angle of triangles, in degrees.
    pub angle_min: f64,
    /// Smallest acceptable scaled Jacobian of tetrahedra with mid nodes; only positive ones are
    /// ever accepted.
    pub scaled_jacobian_min: f64,
    /// Largest acceptable distance of nodes to the surface, and of nodes on curves to both
    /// surfaces, as a share of the diagonal.
    pub node_distance: f64,
    /// Largest acceptable distance of faces to the surface, in the units of the model.
    pub chord: f64,
    /// Smallest acceptable share of the feature curves that has edges.
    pub covered: f64,
    /// Largest acceptable distance of corners of the solid to nodes at corners, as a share of the
    /// diagonal.
    pub corner_distance: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            dihedral_min: 0.0,
            dihedral_max: 180.0,
            angle_min: 0.0,
            scaled_jacobian_min: 0.0,
            // An iteration in doubles ends far nearer to the surface, and no part is made to such a
            // tolerance.
            node_distance: 1e-9,
            chord: f64::INFINITY,
            covered: 0.999,
            corner_distance: 1e-9,
        }
    }
}

/// What is known about a mesh. Parts that do not apply to it, or were not reached, are `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Certificate {
    /// Why the mesh cannot be looked at; then there is nothing else.
    pub malformed: Vec<Malformed>,
    /// Topology and measure of the surface: of the mesh's triangles, or of the boundary of the
    /// tetrahedra if it has none.
    pub surface: Option<Surface>,
    /// Topology and measure of the tetrahedra.
    pub volume: Option<Volume>,
    /// Where the surface meets itself.
    pub intersections: Option<Intersections>,
    /// Shape of the triangles.
    pub triangles: Option<TriangleQuality>,
    /// Shape of the tetrahedra.
    pub tets: Option<TetQuality>,
    /// Shape of the wedges. All else takes each for three tetrahedra, and quadrilaterals for two
    /// triangles each ([`Mesh::simplices`]), but shapes of tetrahedra are those of the mesh's own.
    pub wedges: Option<WedgeQuality>,
    /// The Jacobian of tetrahedra with mid nodes.
    pub curved: Option<CurvedQuality>,
    /// Distances to the solid; if there is one to compare with.
    pub deviation: Option<Deviation>,
    /// How much of the feature curves and corners the mesh has; if there are some to compare with.
    pub coverage: Option<Coverage>,
    /// Opposite sides of a unit cell, by axes along which it repeats.
    pub opposite: Vec<OppositeSides>,
    /// Nodes that no element has.
    pub unused_nodes: usize,
    /// Whether everything was looked at.
    pub complete: bool,
    /// What is acceptable, as it was asked for.
    pub limits: Limits,
}

impl Certificate {
    /// Everything that is not acceptable.
    pub fn failures(&self) -> Vec<Failure> {
        failure::failures(self)
    }
    /// Whether all is acceptable, and everything was looked at.
    pub fn is_ok(&self) -> bool {
        self.failures().is_empty()
    }
}

/// Looks for everything that could be wrong with a mesh; with a solid, also whether the mesh
/// follows its surface.
///
/// Of a mesh of several regions the walls between them, which have a tetrahedron on either side,
/// are left out: [`Mesh::region`] makes a mesh of each region, which has them.
///
/// On a stop by `control` the certificate lacks what was not yet looked at, and is not complete.
pub fn certify(
    mesh: &Mesh,
    solid: Option<&dyn Solid>,
    options: &Options<'_>,
    control: &Control<'_>,
) -> Certificate {
    let mut certificate = Certificate {
        malformed: format::examine(mesh),
        limits: options.limits,
        ..Certificate::default()
    };
    if !certificate.malformed.is_empty() {
        certificate.complete = true;
        return certificate;
    }
    let tets = mesh.tets.len();
    certificate.wedges = wedges::examine(mesh, options);
    let mesh = mesh.simplices();
    let mesh = &mesh.without_walls();
    certificate.complete = examine(mesh, tets, solid, options, control, &mut certificate).is_some();
    certificate
}

/// All checks of a well-formed mesh, whose first `tets` tetrahedra are its own; `None` if stopped.
fn examine(
    mesh: &Mesh,
    tets: usize,
    solid: Option<&dyn Solid>,
    options: &Options<'_>,
    control: &Control<'_>,
    certificate: &mut Certificate,
) -> Option<()> {
    let boundary = examine_tetrahedra(mesh, tets, options, control, certificate)?;
    let triangles = if mesh.triangles.is_empty() {
        &boundary
    } else {
        &mesh.triangles
    };
    examine_surface(mesh, triangles, options, control, certificate)?;
    certificate.unused_nodes = unused_nodes(mesh);
    if let Some(region) = options.region {
        certificate.opposite = opposite::examine(mesh, triangles, region, options);
    }
    if let (Some(solid), false) = (solid, triangles.is_empty()) {
        control.begin("measuring distances").ok()?;
        let capped = options.region.map(|region| Capped::new(solid, region));
        let solid = capped.as_ref().map_or(solid, |c| c);
        let deviation = deviation::measure(mesh, triangles, solid, options, control);
        control.check().ok()?;
        certificate.deviation = Some(deviation);
    }
    examine_features(mesh, triangles, options, control, certificate)
}

/// The search for feature curves and corners, if there are some to look for; `None` if stopped.
fn examine_features(
    mesh: &Mesh,
    triangles: &[[u32; 3]],
    options: &Options<'_>,
    control: &Control<'_>,
    certificate: &mut Certificate,
) -> Option<()> {
    if options.curves.is_empty() && options.corners.is_empty() {
        return Some(());
    }
    control.begin("looking for features").ok()?;
    let mean = certificate.triangles.as_ref().map(|t| t.edges.mean);
    let size = options.size.or(mean).unwrap_or(0.0);
    let coverage = coverage::measure(mesh, triangles, size, options, control);
    control.check().ok()?;
    certificate.coverage = Some(coverage);
    Some(())
}

/// The checks of tetrahedra, if there are any. Returns their boundary; `None` if stopped.
fn examine_tetrahedra(
    mesh: &Mesh,
    tets: usize,
    options: &Options<'_>,
    control: &Control<'_>,
    certificate: &mut Certificate,
) -> Option<Vec<[u32; 3]>> {
    if mesh.tets.is_empty() {
        return Some(Vec::new());
    }
    control.begin("checking tetrahedra").ok()?;
    let (volume, boundary) = volume::examine(mesh, options);
    certificate.volume = Some(volume);
    control.begin("measuring tetrahedra").ok()?;
    certificate.tets = elements::tets(&mesh.points, &mesh.tets[..tets], options);
    certificate.curved = elements::curved(mesh, options);
    Some(boundary)
}

/// The checks of the surface, if there is one; `None` if stopped.
fn examine_surface(
    mesh: &Mesh,
    triangles: &[[u32; 3]],
    options: &Options<'_>,
    control: &Control<'_>,
    certificate: &mut Certificate,
) -> Option<()> {
    if triangles.is_empty() {
        return Some(());
    }
    control.begin("checking the surface").ok()?;
    let points = &mesh.points;
    let of = surface::Triangles { points, triangles };
    let flat = surface::without_area(of);
    let tree = intersections::tree(of);
    let found = surface::examine(of, &mesh.edges, &flat, &tree, options);
    certificate.surface = Some(found);
    certificate.triangles = elements::triangles(points, triangles, options);
    control.begin("looking for self-intersections").ok()?;
    let found = intersections::find(of, &flat, &tree, options, control);
    certificate.intersections = Some(found);
    Some(())
}

/// How many nodes are in no element, as corners or mid nodes.
fn unused_nodes(mesh: &Mesh) -> usize {
    let mut used = vec![false; mesh.points.len()];
    let arrays = [
        mesh.triangles.as_flattened(),
        mesh.triangle_mids.as_flattened(),
        mesh.tets.as_flattened(),
        mesh.tet_mids.as_flattened(),
        mesh.edges.as_flattened(),
        &mesh.edge_mids,
    ];
    for &i in arrays.into_iter().flatten() {
        used[i as usize] = true;
    }
    used.into_iter().filter(|&u| !u).count()
}

#[cfg(test)]
mod tests;
