//! The boundary representation of a model: its mesh gives the topology, its functions the geometry.

use crate::mesh_model::{mesh_solid, runs_somewhere};
use crate::meshing::meshable;
use crate::{MeshModelError, MeshModelOptions, ModelMesh};
use isoform_brep::{BrepError, Built, Certificate, Finding, check, pieces};
use isoform_check::{Capped, Failure, Place};
use isoform_control::Control;
use isoform_field::RunField;
use isoform_field::hyperfun::Model;
use isoform_geom::brep::Face;
use isoform_geom::{Csg, Parts, Point3, SmoothPart, Solid, distance_squared};
use isoform_io::SolidProperties;
use isoform_patch::quadric_through;
use std::sync::Arc;

/// How far splines may be from the model where nothing else is asked for, in largest sides of its
/// box.
const TOLERANCE: f64 = 1e-6;
/// Smooth parts of a piece: a block with rounded edges has some hundred.
const MOST_PARTS: usize = 1024;
/// How often the mesh is halved where it gives no solid, or one whose certificate does not hold:
/// small faces may lie between its nodes.
const FINER: usize = 2;
/// How near a vertex is to a corner that the mesh missed, in sizes of the model.
const AT_CORNER: f64 = 1e-9;
/// Failures of a mesh that say where its nodes are, and nothing of the solid elsewhere.
const OF_NODES: [&str; 4] = [
    "node-off-surface",
    "misclassified-node",
    "uncovered-curve",
    "missed-corner",
];

/// Why a model has no boundary representation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BrepModelError {
    /// It has no mesh.
    #[error(transparent)]
    Mesh(#[from] MeshModelError),
    /// Its surface is not made of exact faces.
    #[error(transparent)]
    Brep(#[from] BrepError),
}

/// The boundary representation of a model.
#[derive(Debug)]
pub struct ModelBrep {
    /// The solids, with the triangles that stand for them.
    pub built: Built,
    /// What is known of them.
    pub certificate: Certificate,
    /// The mesh that the topology comes from.
    pub mesh: ModelMesh,
}

impl ModelBrep {
    /// What files state of the solids.
    pub fn properties(&self) -> SolidProperties {
        let total = &self.certificate.total;
        SolidProperties {
            volume: total.volume,
            area: total.area,
            centroid: self.certificate.centroid(),
            gap: self.certificate.gap,
        }
    }

    /// Whether all shells are closed; no other is written to a file.
    pub fn is_closed(&self) -> bool {
        let is_open = |f: &Finding| matches!(f, Finding::OpenEdges(_));
        !self.certificate.failures.iter().any(is_open)
    }
}

/// The boundary representation of a model with the values `a` of its parameters: faces on exact
/// planes, cylinders, cones, spheres, tori and ellipsoids, and on splines elsewhere, with shared
/// edges, and its certificate. What the certificate of the mesh leaves open, this one does, too.
/// Splines may be `tolerance` away from the model (model units; 1e-6 of its largest side where
/// there is none), exact faces never more than 1e-8 of that side. Missing values are those of
/// [`parameter_values`](crate::parameter_values).
///
/// ```
/// use isoform::{Control, MeshModelOptions, brep_model, template};
/// let ball = template("sphere").expect("a template of the gallery").model();
/// let made = brep_model(&ball, &[0.0, 0.0, 0.0, 1.0], &MeshModelOptions::default(), None, &Control::default())?;
/// let volume = 4.0 / 3.0 * std::f64::consts::PI;
/// assert!(made.certificate.holds());
/// assert!((made.certificate.total.volume / volume - 1.0).abs() < 1e-12);
/// # Ok::<(), isoform::BrepModelError>(())
/// ```
///
/// # Errors
/// [`BrepModelError`].
pub fn brep_model(
    model: &Model,
    a: &[f64],
    options: &MeshModelOptions,
    tolerance: Option<f64>,
    control: &Control<'_>,
) -> Result<ModelBrep, BrepModelError> {
    control.report("model", 0.0);
    let region = options.mesh.region;
    let found = meshable(model, a, region, Some(MOST_PARTS), control)?;
    let solid = found.solid;
    let capped = region.map(|region| Capped::new(solid.as_ref(), region));
    let smooth = if let Some(parts) = found.parts {
        parts
    } else {
        runs_somewhere(model, a, region).map_err(MeshModelError::from)?;
        let field = RunField::new(model, a).map_err(MeshModelError::from)?;
        whole(Arc::new(field))
    };
    let work = Work {
        meshed: solid.as_ref(),
        solid: capped.as_ref().map_or(solid.as_ref(), |c| c),
        smooth,
        tolerance,
        control,
    };
    let mut options = options.clone();
    options.mesh.surface_only = true;
    options.mesh.order = 1;
    let is_free = options.size.is_none();
    // Mostly the first mesh tells the topology, though some of its nodes are wrong.
    let rounds = std::mem::take(&mut options.mesh.rounds);
    let mut best = work.at_size(&options)?;
    options.mesh.rounds = rounds;
    for finer in 0..=FINER {
        let size = match &best {
            Ok(made) if is_sound(made) && (finer > 0 || is_told(made)) => break,
            Ok(made) => made.mesh.options.size,
            Err(Refused { size, .. }) => *size,
        };
        if finer > 0 {
            if !is_free
                || best
                    .as_ref()
                    .is_err_and(|refused| !is_of_mesh(&refused.error))
            {
                break;
            }
            options.size = Some(options.size.unwrap_or(size) / 2.0);
        }
        let next = match work.at_size(&options) {
            // What there is may be right, though it is not certified.
            Err(_) if best.is_ok() && control.is_late() => break,
            next => next?,
        };
        let is_better = match (&best, &next) {
            (Ok(a), Ok(b)) if finer == 0 => rank(b) <= rank(a),
            (Ok(a), Ok(b)) => rank(b) < rank(a),
            (Err(_), next) => next.is_ok() || finer == 0,
            (Ok(_), Err(_)) => false,
        };
        if is_better {
            best = next;
        }
    }
    best.map_err(|refused| refused.error.into())
}

/// Returns a rank of solids, the best one first.
fn rank(made: &ModelBrep) -> (usize, bool) {
    (made.certificate.failures.len(), !is_sound(made))
}

/// True if the certificate holds, and readers see edges where they are: a finer mesh may tell more
/// surfaces exactly.
fn is_sound(made: &ModelBrep) -> bool {
    made.certificate.holds() && made.certificate.is_read_alike
}

/// True if a mended mesh would tell no more: all faces are exact, or no node of it is wrong.
fn is_told(made: &ModelBrep) -> bool {
    let is_near = |face: &Face| face.surface.is_near_only();
    !made.built.brep.faces.iter().any(is_near) || made.mesh.certificate.failures().is_empty()
}

/// Whether a finer mesh may help.
fn is_of_mesh(error: &BrepError) -> bool {
    matches!(
        error,
        BrepError::NoVertex { .. } | BrepError::NoCurve { .. } | BrepError::OffSurface { .. }
    )
}

/// Why a mesh of a size gave no boundary representation.
struct Refused {
    error: BrepError,
    size: f64,
}

/// What stays the same while meshes become finer.
struct Work<'a> {
    /// The solid without the sides of the box.
    meshed: &'a dyn Solid,
    /// The solid within the box.
    solid: &'a dyn Solid,
    smooth: Parts,
    tolerance: Option<f64>,
    control: &'a Control<'a>,
}

impl Work<'_> {
    /// The boundary representation with the topology of a mesh.
    fn at_size(
        &self,
        options: &MeshModelOptions,
    ) -> Result<Result<ModelBrep, Refused>, BrepModelError> {
        let mesh = mesh_solid(self.meshed, options, self.control)?;
        match self.of_mesh(&mesh) {
            Ok((built, certificate)) => Ok(Ok(ModelBrep {
                built,
                certificate,
                mesh,
            })),
            Err(BrepError::Stopped) => Err(BrepError::Stopped.into()),
            Err(error) => Ok(Err(Refused {
                error,
                size: mesh.options.size,
            })),
        }
    }

    fn of_mesh(&self, mesh: &ModelMesh) -> Result<(Built, Certificate), BrepError> {
        self.control.begin("recognition")?;
        let labelled = &mesh.meshed.mesh;
        let pieces = pieces(labelled, self.solid, Some(&self.smooth), &quadric_through)?;
        let [x, y, z] = labelled.bounds().size();
        let tolerance = self.tolerance.unwrap_or(TOLERANCE * x.max(y).max(z));
        let built = isoform_brep::brep(pieces, tolerance, self.control)?;
        self.control.begin("checking the solid")?;
        let witnesses = mesh.meshed.missed.witnesses.iter();
        let witnesses: Vec<Point3> = witnesses.map(|w| w.at).collect();
        let open = left_open(mesh, &built);
        let certificate = check(&built, self.solid, tolerance, &witnesses, open);
        Ok((built, certificate))
    }
}

/// A surface with one function.
fn whole(field: Arc<RunField>) -> Parts {
    let part = SmoothPart {
        piece: 0,
        field,
        limits: Vec::new(),
        function: 0,
    };
    Parts {
        tree: Csg::Piece(0),
        parts: vec![part],
    }
}

/// What the mesh leaves open; but for corners that the solid has vertices at, though the mesh had
/// no node there, as at the tips of cones.
fn left_open(mesh: &ModelMesh, built: &Built) -> Vec<String> {
    let has_vertex = |p: Point3| {
        let near = |v: &Point3| distance_squared(*v, p).sqrt() <= AT_CORNER * built.size;
        built.brep.vertices.iter().any(near)
    };
    let coverage = mesh.certificate.coverage.as_ref();
    let are_vertices = coverage.is_some_and(|c| {
        let places = &c.missed_corners.places;
        places.len() == c.missed_corners.count && places.iter().all(|p| has_vertex(p.at))
    });
    // A border of the mesh that stands for a point has nodes on surfaces that meet there only.
    let is_in_contact = |at: Point3| {
        let near = |(p, reach): &(Point3, f64)| distance_squared(*p, at).sqrt() <= 2.0 * reach;
        built.contacts.iter().any(near)
    };
    let is_of_contacts = |f: &Failure| {
        let places: Vec<&Place> = f.place.iter().chain(&f.others).collect();
        OF_NODES.contains(&f.code)
            && places.len() >= f.count
            && places.iter().all(|p| is_in_contact(p.at))
    };
    let failures = mesh.certificate.failures().into_iter();
    let is_vertex = |f: &Failure| are_vertices && f.code == "missed-corner";
    let open = failures.filter(|f| !is_vertex(f) && !is_of_contacts(f));
    let warnings = mesh.meshed.warnings.iter().map(|w| w.kind.to_string());
    open.map(|f| f.to_string()).chain(warnings).collect()
}
