//! Recognition of meshes made from CAD models, by their triangles.
//!
//! The vertices of such a mesh lie on the surfaces of the model, up to rounding, and its facets are
//! chords. Neighbourhoods in space contain little information (a long cylinder is two rings of
//! points), adjacent triangles much: surfaces are fitted to a few of them and grown over edges as
//! far as vertices lie on them and facets are their chords ([`part`]). The evidence that a curved
//! surface needs is defined in [`evidence`]; the angle between facets above which they are planes
//! of their own is [`part::MIN_FACET_COSINE`].
//!
//! A scanned mesh has noisy vertices, and its facets do not fit together in this way. A mesh counts
//! as one of a CAD model if the recognised parts cover [`MIN_COVERED_SHARE`] of its area; any other
//! is treated as a point cloud.

mod claim;
mod evidence;
mod flat;
mod free;
mod mesh;
mod part;
mod points;
mod report;
mod seeds;

use crate::cloud::Scaling;
use crate::entity::Recognition;
use crate::labels::UNLABELLED;
use crate::recognize::{Error, Options};
use claim::{Claims, claim};
use flat::Flats;
use isoform_control::{Control, Stopped};
use isoform_geom::{Point3, PointCloud};
use mesh::Facets;
use points::FacetPoint;
use report::report;

/// Minimum share of the area of a CAD mesh that its parts cover: those of scans cover less than a
/// hundredth. A smaller bound would take a scan that was cut flat for a model, a larger one would
/// treat models with many free-form faces as clouds.
const MIN_COVERED_SHARE: f64 = 0.2;

impl Options {
    /// Returns the minimum number of points of a part.
    fn fewest_of_part(&self) -> usize {
        self.min_points.unwrap_or(20)
    }
}

/// Result of recognition in a CAD mesh.
#[derive(Clone, Debug)]
pub struct FacetRecognition {
    /// Points inside faces, on their surfaces; they are numbered after the mesh's own.
    pub inside: Vec<Point3>,
    /// Entities, with labels of the mesh's points and of those inside.
    pub recognition: Recognition,
}

/// Facets of a CAD mesh and the parts that explain them.
struct ClaimedFacets {
    scaling: Scaling,
    facets: Facets,
    claims: Claims,
}

impl ClaimedFacets {
    /// Explains a mesh all of whose corners are points; `None` unless it is that of a CAD model.
    fn from_mesh(mesh: &PointCloud, control: &Control<'_>) -> Result<Option<Self>, Error> {
        if !mesh.points.iter().flatten().all(|x| x.is_finite()) {
            return Err(Error::NotFinite);
        }
        control.begin("facets")?;
        let scaling = Scaling::from_points(&mesh.points).ok_or(Error::Line)?;
        let facets = Facets::new(mesh, &scaling);
        let flats = Flats::new(&facets);
        let claims = claim(&facets, &flats, control)?;
        let covered: f64 = claims.parts.iter().map(|p| facets.area(&p.triangles)).sum();
        let all: f64 = facets.areas.iter().sum();
        let is_cad = covered >= MIN_COVERED_SHARE * all && !claims.parts.is_empty();
        Ok(is_cad.then_some(Self {
            scaling,
            facets,
            claims,
        }))
    }

    /// Maps points from the scaled coordinates to those of the mesh.
    fn placed(&self, points: &[FacetPoint]) -> Vec<Point3> {
        let back = |p: &FacetPoint| -> Point3 {
            std::array::from_fn(|k| p.at[k] * self.scaling.unit + self.scaling.origin[k])
        };
        points.iter().map(back).collect()
    }
}

/// Recognises the planes, spheres, cylinders, cones and tori of a CAD mesh and reports the faces of
/// about `wanted` points inside them; `None` if the mesh is not that of a CAD model. The corners of
/// all triangles have to be points.
///
/// # Errors
/// [`Error`].
pub fn recognize_facets(
    mesh: &PointCloud,
    wanted: usize,
    options: &Options,
    control: &Control<'_>,
) -> Result<Option<FacetRecognition>, Error> {
    let Some(mut found) = ClaimedFacets::from_mesh(mesh, control)? else {
        return Ok(None);
    };
    let inside = points::inside(
        &found.facets,
        &found.claims,
        wanted,
        options.fewest_of_part(),
    );
    let positions = found.placed(&inside);
    for k in 0..3 {
        found.scaling.origin[k] += mesh.origin[k];
    }
    let ClaimedFacets {
        scaling,
        facets,
        claims,
    } = &found;
    Ok(Some(FacetRecognition {
        inside: positions,
        recognition: report(facets, claims, &inside, options, scaling),
    }))
}

/// Returns about `wanted` points inside the faces of a CAD mesh, on their surfaces, and the
/// accuracy of its points: the rounding of their coordinates, or of the modeller if that is larger.
/// `None` if the mesh is not that of a CAD model. The corners of all triangles have to be points.
///
/// # Errors
/// [`Stopped`].
pub fn points_on_facets(
    mesh: &PointCloud,
    wanted: usize,
    control: &Control<'_>,
) -> Result<Option<(Vec<Point3>, f64)>, Stopped> {
    if mesh.triangles.is_empty() || wanted == 0 {
        return Ok(None);
    }
    let found = match ClaimedFacets::from_mesh(mesh, control) {
        Ok(Some(found)) => found,
        Err(Error::Stopped(stopped)) => return Err(stopped),
        // Degenerate input, such as coincident points, has no faces.
        Ok(None) | Err(_) => return Ok(None),
    };
    let fewest = Options::default().fewest_of_part();
    let mut inside = points::inside(&found.facets, &found.claims, wanted, fewest);
    inside.retain(|p| p.part != UNLABELLED);
    let exactness = found.facets.exactness() * found.scaling.unit;
    Ok(Some((found.placed(&inside), exactness)))
}
