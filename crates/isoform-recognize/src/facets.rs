//! Recognition of meshes made from CAD models, by their triangles.
//!
//! The vertices of such a mesh lie on the surfaces of the model, up to rounding; facets are their
//! chords. Neighbourhoods in space tell little (a long cylinder is two rings of points), but
//! triangles side by side do: surfaces are fitted to a few of them and grown over edges as far as
//! vertices lie on them and facets are their chords ([`part`]). What counts as evidence for a bent
//! surface stands in [`evidence`], where facets end and planes begin at [`part::TURN`].
//!
//! A scanned mesh has noisy vertices, none of whose facets belong together so. The rule: a mesh is
//! one of a CAD model where the parts found cover [`LEAST_COVERED`] of its area; any other goes the
//! way of point clouds.

mod claim;
mod evidence;
mod flat;
mod mesh;
mod part;
mod points;
mod report;
mod seeds;

use crate::cloud::Scaling;
use crate::entity::Recognition;
use crate::recognize::{Error, Options};
use claim::{Claims, claim};
use flat::Flats;
use isoform_control::{Control, Stopped};
use isoform_geom::{Point3, PointCloud};
use mesh::{Facets, NONE};
use points::Inside;
use report::report;

/// The share of the area of a CAD mesh that its parts cover at least: scans have less than a
/// hundredth. Less would take a scan that was cut flat for a model, more would send models with
/// many free-form faces to the clouds.
const LEAST_COVERED: f64 = 0.2;

/// Minimum number of points of a part, vertices and those inside, unless the user gives one.
const FEWEST: usize = 20;

impl Options {
    /// Returns the minimum number of points of a part.
    fn fewest_of_part(&self) -> usize {
        self.min_points.unwrap_or(FEWEST)
    }
}

/// What was recognised in a CAD mesh.
#[derive(Clone, Debug)]
pub struct FacetRecognition {
    /// Points inside faces, on their surfaces, which follow the mesh's own.
    pub inside: Vec<Point3>,
    /// The entities, with labels of the mesh's points and those inside.
    pub recognition: Recognition,
}

/// The facets of a CAD mesh and the parts that explain them.
struct Explained {
    scaling: Scaling,
    facets: Facets,
    claims: Claims,
}

impl Explained {
    /// Explains a mesh all of whose corners are points; `None` unless it is that of a CAD model.
    fn of(mesh: &PointCloud, control: &Control<'_>) -> Result<Option<Self>, Error> {
        if !mesh.points.iter().flatten().all(|x| x.is_finite()) {
            return Err(Error::NotFinite);
        }
        control.begin("facets")?;
        let scaling = Scaling::of(&mesh.points).ok_or(Error::Line)?;
        let facets = Facets::new(mesh, &scaling);
        let flats = Flats::new(&facets);
        let claims = claim(&facets, &flats, control)?;
        let covered: f64 = claims.parts.iter().map(|p| facets.area(&p.triangles)).sum();
        let all: f64 = facets.areas.iter().sum();
        let is_cad = covered >= LEAST_COVERED * all && !claims.parts.is_empty();
        Ok(is_cad.then_some(Self {
            scaling,
            facets,
            claims,
        }))
    }

    /// Points in the scaled coordinates as points of the mesh.
    fn placed(&self, points: &[Inside]) -> Vec<Point3> {
        let back = |p: &Inside| -> Point3 {
            std::array::from_fn(|k| p.at[k] * self.scaling.unit + self.scaling.origin[k])
        };
        points.iter().map(back).collect()
    }
}

/// Recognises the planes, spheres, cylinders, cones and tori of a CAD mesh, about `wanted` points
/// inside whose faces are reported; `None` for a mesh that is no CAD model's. The corners of all
/// triangles have to be points.
///
/// # Errors
/// [`Error`].
pub fn recognize_facets(
    mesh: &PointCloud,
    wanted: usize,
    options: &Options,
    control: &Control<'_>,
) -> Result<Option<FacetRecognition>, Error> {
    let Some(mut found) = Explained::of(mesh, control)? else {
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
    let Explained {
        scaling,
        facets,
        claims,
    } = &found;
    Ok(Some(FacetRecognition {
        inside: positions,
        recognition: report(facets, claims, &inside, options, scaling),
    }))
}

/// Returns about `wanted` points inside the faces of a CAD mesh, on their surfaces, and how exact
/// its points are: the rounding of their coordinates, or of the modeller where that is more. `None`
/// for a mesh that is no CAD model's. The corners of all triangles have to be points.
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
    let found = match Explained::of(mesh, control) {
        Ok(Some(found)) => found,
        Err(Error::Stopped(stopped)) => return Err(stopped),
        // Points at one place, say, are no faces.
        Ok(None) | Err(_) => return Ok(None),
    };
    let fewest = Options::default().fewest_of_part();
    let mut inside = points::inside(&found.facets, &found.claims, wanted, fewest);
    inside.retain(|p| p.part != NONE);
    let exactness = found.facets.exactness() * found.scaling.unit;
    Ok(Some((found.placed(&inside), exactness)))
}
