//! Conversion of a model to a solid, and of a solid to a mesh with its certificate.

use crate::MeshModelError;
use isoform_check::{self as check, Capped, Certificate, Limits, certify};
use isoform_field::hyperfun::Model;
use isoform_field::{Pieces, RunField, SolidError, parts_of_pieces};
use isoform_geom::{Aabb, KdTree, Mesh, OnePiece, Parts, Point3, PointCloud, Solid};
use isoform_mesh::features::{Complement, ExtentError, Features, START, extent_within};
use isoform_mesh::{
    Control, MeshError, Meshed, Options, REST, Region, RegionSolid, adapt, mesh, mesh_regions,
};
use std::collections::HashSet;

/// Default number of elements along the diagonal of the box: some ten thousand tetrahedra in a
/// ball. Twice as many give eight times as many tetrahedra.
const ELEMENTS_PER_DIAGONAL: f64 = 40.0;
/// Initial tolerance of the search for the box of a solid, as a share of the starting box.
const START_TOLERANCE_SHARE: f64 = 1.0 / 80.0;
/// Distance from the origin, in model units, of the points at which a solid with a bounded
/// complement must be filled; the search for a box extends as far.
const FAR_POINT_DISTANCE: f64 = 1e6;
/// Maximum number of searches for the box, each with a finer tolerance: they resolve solids of size
/// 1e-6.
const MAX_EXTENT_SEARCHES: usize = 6;

/// Returns a model with the values `a` of its parameters as a solid, and true if its program must
/// be run statement by statement.
///
/// A solid that is run has one part, named after the model, no known edges, and no interval bounds.
/// Missing values are those of [`parameter_values`](crate::parameter_values).
///
/// # Errors
/// [`SolidError`] if the model does not describe a solid, or has too few or too many values.
pub fn solid_of(model: &Model, a: &[f64]) -> Result<(Box<dyn Solid>, bool), SolidError> {
    match Pieces::of_model(model, a) {
        Ok(pieces) => Ok((Box::new(pieces), false)),
        Err(SolidError::NoExpression(_)) => Ok((run_solid(model, a)?, true)),
        Err(error) => Err(error),
    }
}

/// Returns a model as a solid whose program is run statement by statement.
fn run_solid(model: &Model, a: &[f64]) -> Result<Box<dyn Solid>, SolidError> {
    let field = RunField::new(model, a)?;
    Ok(Box::new(OnePiece::new(field, model.name())))
}

/// Solid to be meshed. Jumps of its function through 0 are walls.
pub(crate) struct Meshable {
    pub(crate) solid: Box<dyn Solid>,
    pub(crate) is_run: bool,
    /// Smooth parts of the solid; `None` unless they were requested.
    pub(crate) parts: Option<Parts>,
}

/// Returns a model with the values `a` of its parameters as a solid to be meshed, without jumps in
/// its box. `parts` requests its smooth parts, at most that many per piece.
pub(crate) fn meshable(
    model: &Model,
    a: &[f64],
    region: Option<Aabb>,
    parts: Option<usize>,
    control: &Control<'_>,
) -> Result<Meshable, MeshModelError> {
    let mut pieces = match Pieces::of_model(model, a) {
        Err(SolidError::NoExpression(_)) => {
            let solid = run_solid(model, a)?;
            if region.is_none() {
                return Err(MeshModelError::NoBox);
            }
            return Ok(Meshable {
                solid,
                is_run: true,
                parts: None,
            });
        }
        pieces => pieces?,
    };
    // If the solid is unbounded, the mesher reports it.
    let bounds = || region.or_else(|| Some(sought(&pieces, START, control).ok()?.0));
    if pieces.may_jump()
        && let Some(bounds) = bounds()
        && let Some(walled) = pieces.without_jumps(bounds)?
    {
        pieces = walled;
    }
    Ok(Meshable {
        parts: parts.map(|most| parts_of_pieces(&pieces, most)),
        solid: Box::new(pieces),
        is_run: false,
    })
}

/// Returns an edge length that suits a solid, or its part in a region: a fortieth of the diagonal of
/// its bounding box, rounded to two digits.
///
/// ```
/// use isoform::field::hyperfun::{Mode, Model};
/// let text = "my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; my_model = hfSphere(x, c, a[1]); }";
/// let (ball, _) = isoform::solid_of(&Model::parse(text, Mode::Default)?, &[1.0])?;
/// assert_eq!(isoform::default_size(ball.as_ref(), None)?, 0.087);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`ExtentError`] if the solid is empty or unbounded.
pub fn default_size(solid: &dyn Solid, region: Option<Aabb>) -> Result<f64, ExtentError> {
    let options = Options {
        region,
        ..Options::default()
    };
    default_size_within(solid, &options, &Control::default())
}

/// Returns an edge length that suits a solid, like [`default_size`], under the given control.
///
/// # Errors
/// [`ExtentError`] if the solid is empty or unbounded, or on a stop.
pub fn default_size_within(
    solid: &dyn Solid,
    options: &Options,
    control: &Control<'_>,
) -> Result<f64, ExtentError> {
    let Some(region) = options.region else {
        return Ok(two_digits(sought(solid, options.start, control)?.1));
    };
    // The solid may be much smaller than the given box; what is wrong with it, the mesher tells.
    let found = sought(&Capped::new(solid, region), region, control);
    let size = found.map(|(_, size)| two_digits(size));
    Ok(size.unwrap_or(f64::INFINITY).min(usual_size(region)))
}

/// Returns the box of a solid, searched from `start`, and an edge length that suits it.
fn sought(
    solid: &dyn Solid,
    start: Aabb,
    control: &Control<'_>,
) -> Result<(Aabb, f64), ExtentError> {
    let mut tolerance = START_TOLERANCE_SHARE * start.size().into_iter().fold(0.0, f64::max);
    let mut times = 0;
    loop {
        let bounds = extent_within(solid, start, tolerance, control)?.bounds;
        let size = bounds.diagonal() / ELEMENTS_PER_DIAGONAL;
        if size >= tolerance {
            return Ok((bounds, size));
        }
        tolerance = size.min(0.1 * tolerance);
        times += 1;
        if times == MAX_EXTENT_SEARCHES {
            return Ok((bounds, tolerance));
        }
    }
}

/// Returns the bounding box of the complement of a solid; `None` if that is unbounded. The function
/// of such a solid is positive all around, and probably has the wrong sign.
pub(crate) fn bounded_complement(solid: &dyn Solid, control: &Control<'_>) -> Option<Aabb> {
    // A solid with a bounded complement contains all distant points.
    let axes =
        [0, 1, 2].map(|axis| [-FAR_POINT_DISTANCE, FAR_POINT_DISTANCE].map(|far| (axis, far)));
    let on_axes = axes.as_flattened().iter().map(|(axis, far)| {
        let mut p = [0.0; 3];
        p[*axis] = *far;
        p
    });
    let corners = (0..8).map(|i| {
        std::array::from_fn(|k| {
            if i >> k & 1 == 0 {
                -FAR_POINT_DISTANCE
            } else {
                FAR_POINT_DISTANCE
            }
        })
    });
    let far: Vec<Point3> = on_axes.chain(corners).collect();
    let mut values = vec![0.0; far.len()];
    solid.sign_values(&far, &mut values);
    if values.iter().any(|v| v.is_nan() || *v < 0.0) {
        return None;
    }
    let found = sought(&Complement::new(solid), START, control).ok()?;
    Some(found.0)
}

/// Returns the edge length that suits a solid that fills a box.
pub(crate) fn usual_size(region: Aabb) -> f64 {
    two_digits(region.diagonal() / ELEMENTS_PER_DIAGONAL)
}

/// Returns the triangles of a mesh's surface between all of its nodes, and the part of each. A face
/// with mid nodes becomes four triangles, a quadrilateral two.
///
/// ```
/// use isoform::geom::Mesh;
/// let mut mesh = Mesh::from_triangles(vec![[0.0; 3]; 6], vec![[0, 1, 2]]);
/// mesh.triangle_mids = vec![[3, 4, 5]];
/// let (triangles, _) = isoform::flat_triangles(&mesh);
/// assert_eq!(triangles, [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]);
/// ```
pub fn flat_triangles(mesh: &Mesh) -> (Vec<[u32; 3]>, Vec<u32>) {
    if mesh.triangle_mids.is_empty() {
        let mesh = mesh.simplices();
        return (mesh.triangles.clone(), mesh.triangle_parts.clone());
    }
    let mut triangles = Vec::with_capacity(4 * mesh.triangles.len());
    for (t, &[ab, bc, ca]) in mesh.triangles.iter().zip(&mesh.triangle_mids) {
        triangles.extend([[t[0], ab, ca], [ab, t[1], bc], [ca, bc, t[2]], [ab, bc, ca]]);
    }
    let parts = mesh.triangle_parts.iter().flat_map(|p| [*p; 4]).collect();
    (triangles, parts)
}

/// Returns the surface of a mesh as a cloud with triangles. A face with mid nodes becomes four
/// triangles, a quadrilateral two.
///
/// # Panics
/// If a triangle has a node that is not in the mesh; meshes that were read or computed have all of
/// theirs.
pub fn surface_of(mesh: &Mesh) -> PointCloud {
    let (mut triangles, _) = flat_triangles(mesh);
    let mut number = vec![u32::MAX; mesh.points.len()];
    let mut points = Vec::new();
    for v in triangles.as_flattened_mut() {
        let n = &mut number[*v as usize];
        if *n == u32::MAX {
            *n = points.len() as u32;
            points.push(mesh.points[*v as usize]);
        }
        *v = *n;
    }
    PointCloud {
        points,
        triangles,
        ..PointCloud::default()
    }
}

/// Maximum distance of the node of a corner from it, as a share of the diagonal: nodes are placed
/// at corners to rounding.
const MAX_CORNER_NODE_DISTANCE: f64 = 1e-9;

/// Meshes a solid and certifies the mesh: topology, shape, distances to the solid, and its feature
/// curves and corners.
///
/// # Errors
/// [`MeshError`] if the mesh cannot be computed, or on a stop.
pub fn certified_mesh(
    solid: &dyn Solid,
    options: &Options,
    limits: Limits,
    control: &Control<'_>,
) -> Result<(Meshed, Certificate), MeshError> {
    let meshed = mesh(solid, options, control)?;
    Ok(certified(meshed, solid, options, limits, control))
}

/// Meshes a solid in regions ([`isoform_mesh::mesh_regions`]), and certifies the whole and each
/// region with tetrahedra as a solid of its own.
///
/// # Errors
/// [`MeshError`] if the mesh cannot be computed, or on a stop.
pub fn certified_regions(
    solid: &dyn Solid,
    regions: &[Region<'_>],
    options: &Options,
    limits: Limits,
    control: &Control<'_>,
) -> Result<(Meshed, Certificate, Vec<RegionCertificate>), MeshError> {
    let meshed = mesh_regions(solid, regions, options, control)?;
    let (mut meshed, certificate) = certified(meshed, solid, options, limits, control);
    let capped = options.region.map(|region| Capped::new(solid, region));
    let whole: &dyn Solid = capped.as_ref().map_or(solid, |capped| capped);
    let names = regions.iter().map(|r| r.name).chain([REST]);
    let mut certificates = Vec::new();
    for (k, name) in names.enumerate() {
        let is_it = |other: &String| other == name;
        let Some(number) = meshed.mesh.regions.iter().position(is_it) else {
            continue;
        };
        let part = meshed.mesh.region(number as u32);
        let solid = RegionSolid::new(whole, regions, k);
        let (curves, corners) = wanted_features(&meshed.region_features[k]);
        let wanted = check::Options {
            size: Some(options.size),
            curves: &curves,
            corners: &corners,
            limits,
            ..check::Options::default()
        };
        let certificate = certify(&part, Some(&solid), &wanted, control);
        certificates.push(RegionCertificate {
            name: name.to_owned(),
            certificate,
        });
    }
    meshed.mesh.name_walls();
    Ok((meshed, certificate, certificates))
}

/// Certificate of one region of a mesh.
#[derive(Clone, Debug)]
pub struct RegionCertificate {
    /// Name of the region.
    pub name: String,
    /// Certificate of the region, checked as a mesh of its own.
    pub certificate: Certificate,
}

/// Adapts a volume mesh from another source to the solid that it approximates, and certifies it.
///
/// # Errors
/// [`MeshError`] if the mesh is invalid or cannot be adapted, or on a stop.
pub fn certified_adaptation(
    given: &Mesh,
    solid: &dyn Solid,
    options: &Options,
    limits: Limits,
    control: &Control<'_>,
) -> Result<(Meshed, Certificate), MeshError> {
    let meshed = adapt(given, solid, options, control)?;
    Ok(certified(meshed, solid, options, limits, control))
}

fn certified(
    mut meshed: Meshed,
    solid: &dyn Solid,
    options: &Options,
    limits: Limits,
    control: &Control<'_>,
) -> (Meshed, Certificate) {
    let (curves, corners) = wanted_features(&meshed.features);
    if meshed.mesh.corners.is_empty() {
        meshed.mesh.corners = nodes_at(&meshed.mesh, &corners);
    }
    let wanted = check::Options {
        size: Some(options.size),
        region: options.region,
        periodic: options.periodic,
        curves: &curves,
        corners: &corners,
        limits,
        ..check::Options::default()
    };
    let certificate = certify(&meshed.mesh, Some(solid), &wanted, control);
    (meshed, certificate)
}

/// Returns the curves and corners of a solid that its mesh must have.
fn wanted_features(features: &Features) -> (Vec<Vec<Point3>>, Vec<Point3>) {
    let curves = features.curves.iter().map(|c| c.points.clone());
    let corners = features.corners.iter().filter(|c| c.needs_node());
    (curves.collect(), corners.map(|c| c.point).collect())
}

/// Returns the nodes of feature edges at the given points, in their order.
fn nodes_at(mesh: &Mesh, corners: &[Point3]) -> Vec<u32> {
    let mut nodes: Vec<u32> = mesh.edges.as_flattened().to_vec();
    nodes.sort_unstable();
    nodes.dedup();
    let tree = KdTree::new(
        &nodes
            .iter()
            .map(|&v| mesh.points[v as usize])
            .collect::<Vec<_>>(),
    );
    let limit = (MAX_CORNER_NODE_DISTANCE * mesh.bounds().diagonal()).powi(2);
    let (mut found, mut known) = (Vec::with_capacity(corners.len()), HashSet::new());
    for corner in corners {
        if let Some((i, squared)) = tree.nearest(*corner)
            && squared <= limit
            && known.insert(nodes[i])
        {
            found.push(nodes[i]);
        }
    }
    found
}

/// Rounds a number to two significant digits.
fn two_digits(v: f64) -> f64 {
    format!("{v:.1e}").parse().unwrap_or(v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_field::hyperfun::Mode;

    fn model(body: &str) -> Model {
        Model::parse(
            &format!("m(x[3], a[1]) {{ array c[3]; c = [0, 0, 0]; {body} }}"),
            Mode::Default,
        )
        .expect("a program")
    }

    #[test]
    fn sizes_follow_the_solid() {
        for (radius, want) in [(1e-3, 8.7e-5), (1.0, 0.087), (100.0, 8.7)] {
            let (ball, _) =
                solid_of(&model("m = hfSphere(x, c, a[1]);"), &[radius]).expect("a solid");
            let size = default_size(ball.as_ref(), None).expect("a box");
            assert!((size / want - 1.0).abs() < 0.1, "{size} for {want}");
        }
        // In a box, that of the part of the solid there: an octant of a ball, all of it, or a cube.
        let (ball, _) = solid_of(&model("m = hfSphere(x, c, a[1]);"), &[1.0]).expect("a solid");
        for (lo, hi, want) in [(0.0, 2.0, 0.043), (-9.0, 9.0, 0.087), (-0.1, 0.1, 0.0087)] {
            let region = Aabb {
                lo: [lo; 3],
                hi: [hi; 3],
            };
            let size = default_size(ball.as_ref(), Some(region)).expect("a size");
            assert!((size / want - 1.0).abs() < 0.1, "{size} for {want}");
        }
    }

    #[test]
    fn the_surface_of_a_curved_mesh() {
        let points = vec![
            [9.0; 3],
            [0.0; 3],
            [2.0, 0.0, 0.0],
            [0.0, 2.0, 0.0],
            [1.0, 0.0, 0.1],
            [1.0, 1.0, 0.1],
            [0.0, 1.0, 0.1],
        ];
        let mut mesh = Mesh::from_triangles(points, vec![[1, 2, 3]]);
        let flat = surface_of(&mesh);
        assert_eq!(
            (flat.points.len(), flat.triangles.as_slice()),
            (3, &[[0, 1, 2]][..])
        );
        mesh.triangle_mids = vec![[4, 5, 6]];
        let curved = surface_of(&mesh);
        assert_eq!((curved.points.len(), curved.triangles.len()), (6, 4));
        assert!(
            curved.triangles.iter().all(|t| t.iter().all(|&v| v < 6))
                && !curved.points.contains(&[9.0; 3])
        );
    }

    #[test]
    fn quadrilaterals_of_layers_are_two_triangles_of_the_surface() {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let mesh = Mesh {
            points: points.to_vec(),
            quads: vec![[0, 1, 2, 3]],
            quad_parts: vec![0],
            parts: vec!["end".to_owned()],
            ..Mesh::default()
        };
        assert_eq!(surface_of(&mesh).triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(flat_triangles(&mesh).1, [0, 0]);
    }

    #[test]
    fn programs_that_are_no_expression_are_run() {
        let (solid, is_run) = solid_of(
            &model("i = 0; while x[1] > i loop i = i + 1; endloop; m = 4 - i - x[2]^2 - x[3]^2;"),
            &[0.0],
        )
        .expect("a solid");
        assert!(is_run && solid.names() == ["m"]);
        assert!(matches!(
            solid_of(&model("m = 1;"), &[0.0]),
            Err(SolidError::NoSurface { inside: true })
        ));
    }
}
