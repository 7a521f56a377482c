//! The certificate of a mesh: all checks of its topology, shape and distance to a solid.
//!
//! [`certify`] decides topology by indices and geometry by exact signs, never by a tolerance: a
//! mesh without [`failures`] has a surface that is closed, oriented, manifold and free of
//! self-intersections, and tetrahedra that fill its interior exactly once (proof in the module of
//! [`Volume`]). Shape and distances are measured in doubles. Each kind of defect keeps its first
//! places, up to [`Options::places`]; counts are always complete. The certificate of a mesh is
//! identical for any number of threads.
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
mod turns;
mod volume;
mod walls;
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
pub use turns::PartTurn;
pub use volume::Volume;
pub use walls::Walls;
pub use wedges::WedgeQuality;

use isoform_control::Control;
use isoform_geom::{Aabb, Mesh, Point3, Solid};

/// Reference data of [`certify`], its limits, and the number of places to keep.
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    /// Maximum number of places kept per kind of defect.
    pub places: usize,
    /// Maximum number of self-intersecting pairs; the search ends once it has found more. A surface
    /// that coincides with itself has quadratically many.
    pub pairs: usize,
    /// Feature curves along which the mesh must have edges, as polylines.
    pub curves: &'a [Vec<Point3>],
    /// Corners at which the mesh must have nodes.
    pub corners: &'a [Point3],
    /// Requested element size, in model units; it sets the distance within which an edge covers a
    /// feature curve. `None` to use the mean edge length of the surface.
    pub size: Option<f64>,
    /// Box at which the solid was clipped; its sides then belong to the solid. `None` if it was not
    /// clipped.
    pub region: Option<Aabb>,
    /// True for each axis along which that box is a unit cell: the opposite sides across it must
    /// match.
    pub periodic: [bool; 3],
    /// Limits of the measured quantities.
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

/// Limits of the measured quantities. Topology, orientation and self-intersections have none: any
/// defect of these kinds is a failure, except for a border that is allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// True if the surface may have a border: edges of one triangle.
    pub has_border: bool,
    /// Minimum dihedral angle of tetrahedra, in degrees; 0 accepts all positive ones.
    pub dihedral_min: f64,
    /// Maximum dihedral angle of tetrahedra, in degrees.
    pub dihedral_max: f64,
    /// Minimum angle of triangles, in degrees.
    pub angle_min: f64,
    /// Minimum scaled Jacobian of tetrahedra with mid nodes; values ≤ 0 always fail.
    pub scaled_jacobian_min: f64,
    /// Maximum distance of nodes from the surface, and of nodes on curves from both surfaces, in
    /// diagonals of the mesh.
    pub node_distance: f64,
    /// Maximum distance of faces from the surface, in model units.
    pub chord: f64,
    /// Minimum share of the length of the feature curves that has edges.
    pub covered: f64,
    /// Maximum distance of corners of the solid from corner nodes, in diagonals of the mesh.
    pub corner_distance: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            has_border: false,
            dihedral_min: 0.0,
            dihedral_max: 180.0,
            angle_min: 0.0,
            scaled_jacobian_min: 0.0,
            // An iteration in doubles ends far nearer to the surface, and no part is manufactured
            // to such a tolerance.
            node_distance: 1e-9,
            chord: f64::INFINITY,
            covered: 0.999,
            corner_distance: 1e-9,
        }
    }
}

/// Results of all checks of a mesh. Parts that do not apply, or were not reached, are `None`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Certificate {
    /// Format errors that prevent all other checks.
    pub malformed: Vec<Malformed>,
    /// Topology, volume and area of the surface: of the mesh's triangles, or of the boundary of the
    /// tetrahedra if it has none.
    pub surface: Option<Surface>,
    /// Topology and volume of the tetrahedra.
    pub volume: Option<Volume>,
    /// Self-intersections of the surface.
    pub intersections: Option<Intersections>,
    /// Shape of the triangles.
    pub triangles: Option<TriangleQuality>,
    /// Shape of the tetrahedra.
    pub tets: Option<TetQuality>,
    /// Shape of the wedges. All other checks split each wedge into three tetrahedra and each
    /// quadrilateral into two triangles ([`Mesh::simplices`]); only [`Self::tets`] leaves these
    /// out.
    pub wedges: Option<WedgeQuality>,
    /// Jacobians of tetrahedra with mid nodes.
    pub curved: Option<CurvedQuality>,
    /// Layers of elements through the walls; wedges count as one layer each.
    pub walls: Option<Walls>,
    /// Largest angle between neighbouring triangles of each part; empty without a solid.
    pub turns: Vec<PartTurn>,
    /// Distances to the solid; `None` without a solid.
    pub deviation: Option<Deviation>,
    /// Share of the feature curves and corners that the mesh has; `None` without features.
    pub coverage: Option<Coverage>,
    /// Comparison of opposite sides of a unit cell, one entry per periodic axis.
    pub opposite: Vec<OppositeSides>,
    /// Number of nodes that no element uses.
    pub unused_nodes: usize,
    /// True if all checks ran to their end.
    pub complete: bool,
    /// Limits that the mesh was checked against.
    pub limits: Limits,
}

impl Certificate {
    /// Returns all defects and all measures beyond their limits.
    pub fn failures(&self) -> Vec<Failure> {
        failure::failures(self)
    }
    /// Returns true if the list of failures is empty and all checks ran to their end.
    pub fn is_ok(&self) -> bool {
        self.failures().is_empty()
    }
}

/// Checks a mesh for defects of all kinds; with a solid, also measures its distance from it.
///
/// Walls between the regions of a mesh, which have a tetrahedron on either side, are left out; to
/// check them, certify each region as a mesh of its own ([`Mesh::region`]).
///
/// After a stop by `control` the certificate lacks the remaining checks, and is not complete.
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

/// Runs all checks of a well-formed mesh, whose first `tets` tetrahedra are not parts of wedges;
/// `None` if stopped.
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
        certificate.turns = turns::examine(mesh, solid);
    }
    examine_features(mesh, triangles, options, control, certificate)
}

/// Compares the mesh with the feature curves and corners of the options, if any; `None` if stopped.
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

/// Checks the tetrahedra, if any. Returns their boundary; `None` if stopped.
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
    certificate.walls = walls::examine(mesh, &boundary);
    Some(boundary)
}

/// Checks the surface, if there is one; `None` if stopped.
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

/// Counts the nodes that no element uses as a corner or mid node.
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
