//! Adaptation: improves a given mesh on the solid that it approximates.
//!
//! Each face of its surface is assigned to the piece of the solid on which it lies, edges are laid
//! along those of the solid, and vertices are projected onto their pieces. Then tetrahedra are
//! optimised like those of the mesher's own lattice, and bare triangles by splits, collapses, flips
//! and moves.
//!
//! - `given`: validation of the input, and problems that alignment leaves;
//! - `align`: edges of the mesh along those of the solid;
//! - `boundary`: the boundary of tetrahedra during alignment;
//! - `skin`, `remesh`: bare triangles and their optimisation;
//! - `sizes`: edge lengths of a mesh.

mod align;
mod boundary;
mod given;
mod remesh;
mod sizes;
mod skin;

use crate::assemble::{CoreConnection, LabelledMesh, assemble_surface};
use crate::error::{MeshError, Warning, WarningKind};
use crate::features::{ExtentError, Features, extent_within};
use crate::inside::Inside;
use crate::lattice::{CELL_EDGE, INSIDE_CELL, Lattice, OUTSIDE_CELL};
use crate::mesher::{Meshed, features_of, improve};
use crate::options::Options;
use crate::points::lerp;
use crate::second::raise_order;
use crate::surface::Surface;
use crate::unmeshed::find_unmeshed;
use align::{align, edges_of};
use boundary::Boundary;
pub use given::check_nodes;
use given::{check_given, distance, place, settled, welded, wrong};
use isoform_check as check;
use isoform_control::Control;
use isoform_geom::{Aabb, KdTree, Mesh, Point3, Solid, norm, sub};
use remesh::Remesher;
pub use sizes::{mean_edge, own_sizes};
use skin::EditableSurface;

/// Improves a mesh on a solid near its surface: moves its vertices onto the parts, lays edges of
/// the surface along those of the solid, optimises the elements, and splits edges that leave the
/// surface too far. Mid nodes and labels of the given mesh are dropped.
///
/// Tetrahedra keep their size; `options.size` should be near it, and [`mean_edge`] computes it. The
/// triangles of a bare surface are split and collapsed towards `options.size` and `options.sizes`;
/// [`own_sizes`] computes the present ones.
///
/// # Errors
/// Those of [`mesh`](crate::mesh). Also if the mesh is neither a conforming volume mesh nor a
/// closed surface without self-intersections, if its surface is far from the solid's, or if its
/// edges cannot be made to follow those of the solid.
pub fn adapt(
    mesh: &Mesh,
    solid: &dyn Solid,
    options: &Options,
    control: &Control<'_>,
) -> Result<Meshed, MeshError> {
    if mesh.tets.is_empty() && mesh.triangles.is_empty() {
        return Err(wrong("has neither tetrahedra nor triangles"));
    }
    options.check()?;
    check_nodes(mesh)?;
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
    let region = found.bounds;
    let lattice = lattice_around(&bare, solid, region, options, control)?;
    // The edge lengths of the mesh are given.
    let surface = Surface {
        bends: false,
        ..Surface::new(solid, &lattice, region, control)
    };
    control.begin("features")?;
    let features = features_of(solid, region, options, control);
    let mut warnings = Vec::new();
    let mesh = if bare.tets.is_empty() {
        of_triangles(bare, &surface, &features, options, &mut warnings)?
    } else {
        of_tetrahedra(bare, &surface, &features, options, &mut warnings)?
    };
    if let Some(at) = left_out(&mesh, &surface) {
        let at = place(at);
        return Err(wrong(format!("leaves out a part of the model near {at}")));
    }
    control.begin("what the mesh misses")?;
    let missed = find_unmeshed(solid, &mesh, region, options.size, control);
    warnings.extend(missed.warning());
    Ok(Meshed {
        missed,
        mesh,
        region,
        region_certified: found.certified,
        caps: Vec::new(),
        features,
        region_features: Vec::new(),
        warnings,
    })
}

/// Creates a lattice in which the surface vertices of the mesh lie in cells with surface.
fn lattice_around(
    mesh: &Mesh,
    solid: &dyn Solid,
    region: Aabb,
    options: &Options,
    control: &Control<'_>,
) -> Result<Lattice, MeshError> {
    let off = distance(mesh, solid, region.diagonal())?;
    // Cells are at least twice as large as the mesh is off the model, so that its vertices lie in
    // cells with surface.
    let cell = (CELL_EDGE * options.size).max(2.0 * off);
    // The cells of the lattice, 12 bytes each, are all that grows with the model's box here.
    options.check_memory((Lattice::cells(region, cell) * 12.0) as u64)?;
    Lattice::new(solid, region, cell, control)
}

/// Adapts a bare surface.
fn of_triangles(
    bare: Mesh,
    surface: &Surface<'_>,
    features: &Features,
    options: &Options,
    warnings: &mut Vec<Warning>,
) -> Result<Mesh, MeshError> {
    let control = surface.control;
    control.begin("surface")?;
    let n = bare.points.len();
    let mut skin = EditableSurface::new(bare.points, bare.triangles);
    let aligned = align(&mut skin, surface, features);
    warnings.extend(settled(&aligned, n)?);
    skin.label(&aligned.labels);
    control.begin("optimisation")?;
    let mut remesher = Remesher::new(skin, surface, options, control);
    remesher.run();
    warnings.extend(Warning::each(WarningKind::VertexOff, remesher.off()));
    control.begin("assembly")?;
    let skin = &remesher.skin;
    let mut labelled = assemble_surface(surface, &skin.labelled_faces(), &skin.points);
    warnings.extend(raise_order(&mut labelled, surface, options)?);
    let LabelledMesh { mesh, .. } = labelled;
    Ok(mesh)
}

/// Adapts a mesh of tetrahedra.
fn of_tetrahedra(
    bare: Mesh,
    surface: &Surface<'_>,
    features: &Features,
    options: &Options,
    warnings: &mut Vec<Warning>,
) -> Result<Mesh, MeshError> {
    surface.control.begin("surface")?;
    let mut boundary = Boundary::from_mesh(bare);
    // A closed surface of n vertices has about 2 n triangles.
    let on_boundary = boundary.faces().len() / 2;
    let aligned = align(&mut boundary, surface, features);
    warnings.extend(settled(&aligned, on_boundary)?);
    boundary.approach(&aligned.places, surface.control);
    let complex = boundary.labelled(aligned.labels);
    let inside = Inside {
        frozen: vec![false; complex.points.len()],
        complex,
        number: Vec::new(),
        stray: Vec::new(),
    };
    improve(
        inside,
        surface,
        options,
        CoreConnection::default(),
        warnings,
    )
}

/// Finds a point of the solid's surface that the mesh does not reach. Every cell with surface
/// should have a vertex within the longest edge.
fn left_out(mesh: &Mesh, surface: &Surface<'_>) -> Option<Point3> {
    let tree = KdTree::new(&mesh.points);
    let longest = edges_of(&mesh.triangles)
        .into_iter()
        .map(|e| norm(sub(mesh.points[e[0] as usize], mesh.points[e[1] as usize])));
    let reach = longest.fold(0.0, f64::max).max(surface.lattice.a);
    let states = surface.lattice.state.iter().enumerate();
    states
        .filter(|(_, s)| **s != INSIDE_CELL && **s != OUTSIDE_CELL)
        .filter_map(|(k, _)| root_in_cell(surface, k))
        .find(|&p| tree.nearest(p).is_some_and(|n| n.1 > reach * reach))
}

/// Returns a point of the surface on the diagonal of a cell; `None` if the surface does not cross
/// it.
fn root_in_cell(surface: &Surface<'_>, cell: usize) -> Option<Point3> {
    let cell = surface.lattice.indices(cell);
    let corner = |d: usize| surface.lattice.point(cell.map(|i| 2 * (i + d)));
    let (p, q) = (corner(0), corner(1));
    let (f, g) = (surface.value(p).0, surface.value(q).0);
    if !(f.is_finite() && g.is_finite() && (f < 0.0) != (g < 0.0)) {
        return None;
    }
    let (t, _) = surface.root((p, f), (q, g))?;
    Some(lerp(p, q, t))
}
