//! Boundary representation of a model, with the topology of its mesh and the geometry of its
//! functions.

use crate::mesh_model::{mesh_solid, runs_somewhere};
use crate::meshing::meshable;
use crate::{MeshModelError, MeshModelOptions, ModelMesh, parameter_values};
use isoform_brep::{BrepError, Certificate, Finding, MeshedBrep, check, pieces, stands_alone};
use isoform_check::{Capped, Failure, Place};
use isoform_control::Control;
use isoform_field::RunField;
use isoform_field::hyperfun::Model;
use isoform_geom::{Aabb, Csg, Frame, Parts, Point3, SmoothPart, Solid, distance_squared};
use isoform_io::SolidProperties;
use isoform_mesh::WarningKind;
use isoform_mesh::features::START;
use isoform_patch::quadric_through;
use std::sync::Arc;

/// Default tolerance of spline surfaces, in largest sides of the model's box. Splines of smaller
/// tolerance need more control points.
const DEFAULT_SPLINE_TOLERANCE: f64 = 1e-6;
/// Maximum number of smooth parts of a piece: a block with rounded edges has some hundred.
const MAX_PARTS_PER_PIECE: usize = 1024;
/// Maximum number of times that the mesh size is halved if the mesh gives no solid, or one whose
/// certificate does not hold: small faces may lie between its nodes. Each halving takes several
/// times as long as the one before.
const MAX_MESH_HALVINGS: usize = 2;
/// Maximum deviation of the scale of a placement from 1 that counts as rounding, so that it is a
/// rigid motion.
const MAX_MOTION_SCALE_ERROR: f64 = 1e-12;
/// Maximum distance of a vertex from a corner that the mesh missed, in sizes of the model: both are
/// computed to rounding.
const MAX_CORNER_VERTEX_DISTANCE: f64 = 1e-9;
/// Codes of the failures of a mesh that concern the positions of its nodes, and not the solid.
const NODE_FAILURE_CODES: [&str; 4] = [
    "node-off-surface",
    "misclassified-node",
    "uncovered-curve",
    "missed-corner",
];

/// Reason why a model has no boundary representation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BrepModelError {
    /// The model has no mesh.
    #[error(transparent)]
    Mesh(#[from] MeshModelError),
    /// The surface cannot be divided into exact faces.
    #[error(transparent)]
    Brep(#[from] BrepError),
}

/// Boundary representation of a model, with its certificate.
#[derive(Debug)]
pub struct ModelBrep {
    /// Solids, with the triangles that represent their faces.
    pub built: MeshedBrep,
    /// Results of the checks.
    pub certificate: Certificate,
    /// Mesh from which the topology was taken.
    pub mesh: ModelMesh,
}

impl ModelBrep {
    /// Returns the measures that files state for the solids.
    pub fn properties(&self) -> SolidProperties {
        let total = &self.certificate.total;
        SolidProperties {
            volume: total.volume,
            area: total.area,
            centroid: self.certificate.centroid(),
            gap: self.certificate.gap,
        }
    }

    /// Moves the solid from coordinates of a frame to space. The mesh stays in the frame.
    fn placed(self, frame: &Frame) -> Self {
        Self {
            built: self.built.placed(frame),
            certificate: self.certificate.placed(frame),
            mesh: self.mesh,
        }
    }

    /// Returns true if all shells are closed; open ones are not written to files.
    pub fn is_closed(&self) -> bool {
        let is_open = |f: &Finding| matches!(f, Finding::OpenEdges(_));
        !self.certificate.failures.iter().any(is_open)
    }
}

/// Computes the boundary representation of a model with the values `a` of its parameters, and its
/// certificate: faces on exact planes, cylinders, cones, spheres, tori and ellipsoids, and on
/// spline surfaces elsewhere, with shared edges. Questions that the certificate of the mesh leaves
/// open stay open. Splines may be `tolerance` away from the model, in model units, by default 1e-6
/// of its largest side; exact faces at most 1e-8 of that side. Missing values are those of
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
/// [`BrepModelError`] if the model has no mesh, its faces cannot be computed, or on a stop.
pub fn brep_model(
    model: &Model,
    a: &[f64],
    options: &MeshModelOptions,
    tolerance: Option<f64>,
    control: &Control<'_>,
) -> Result<ModelBrep, BrepModelError> {
    control.report("model", 0.0);
    let region = options.mesh.region;
    if region.is_none()
        && let Some((own, frame)) = unplaced(model)
    {
        let a = parameter_values(model, a).map_err(MeshModelError::from)?;
        match brep_model(&own, &a, &within(&frame, options), tolerance, control) {
            Ok(made) => return Ok(made.placed(&frame)),
            Err(BrepModelError::Brep(error)) => return Err(placed(error, &frame).into()),
            // Errors are reported in coordinates of space.
            Err(BrepModelError::Mesh(_)) => {}
        }
    }
    let found = meshable(model, a, region, Some(MAX_PARTS_PER_PIECE), control)?;
    let solid = found.solid;
    let capped = region.map(|region| Capped::new(solid.as_ref(), region));
    let smooth = if let Some(parts) = found.parts {
        parts
    } else {
        runs_somewhere(model, a, region).map_err(MeshModelError::from)?;
        let field = RunField::new(model, a).map_err(MeshModelError::from)?;
        whole(Arc::new(field))
    };
    let work = BrepSearch {
        meshed: solid.as_ref(),
        solid: capped.as_ref().map_or(solid.as_ref(), |c| c),
        is_capped: capped.is_some(),
        smooth,
        tolerance,
        control,
    };
    let mut options = options.clone();
    options.mesh.surface_only = true;
    options.mesh.order = 1;
    work.best(options)
}

/// Returns the object that a program only moves, as fitted programs do, and the frame of its
/// coordinates. There its faces lie along the lattice of the mesher, and are found sooner. `None`
/// if the program does more, or scales the object.
fn unplaced(model: &Model) -> Option<(Model, Frame)> {
    let (own, place) = model.unplaced()?;
    let frame = Frame {
        rotation: place.rotation,
        translation: place.translation,
    };
    ((place.scale - 1.0).abs() <= MAX_MOTION_SCALE_ERROR).then_some((own, frame))
}

/// Returns the options for the mesh of an object in its own frame: the box in which its search
/// starts, if one is known, contains the given box in space.
fn within(frame: &Frame, options: &MeshModelOptions) -> MeshModelOptions {
    let mut options = options.clone();
    let start = &mut options.mesh.start;
    if *start != START {
        let ends = [start.lo, start.hi];
        let corner = |i: usize| std::array::from_fn(|k| ends[i >> k & 1][k]);
        *start = Aabb::from_points(&(0..8).map(|i| frame.within(corner(i))).collect::<Vec<_>>());
    }
    options
}

/// Maps the place of an error from a frame to space.
fn placed(mut error: BrepError, frame: &Frame) -> BrepError {
    if let BrepError::NoCurve { at, .. } | BrepError::NoVertex { at } = &mut error {
        *at = frame.out(*at);
    }
    error
}

/// Returns the rank of a solid; the lowest is the best.
fn rank(made: &ModelBrep) -> (usize, bool) {
    (made.certificate.failures.len(), !is_sound(made))
}

/// Returns true if the certificate holds, and readers reconstruct all edges: otherwise a finer mesh
/// may determine more surfaces exactly.
fn is_sound(made: &ModelBrep) -> bool {
    made.certificate.holds() && made.certificate.is_read_alike
}

/// Returns true if an optimised mesh would not help: all faces are exact, or no node is wrong.
fn is_conclusive(made: &ModelBrep) -> bool {
    made.built.is_exact() || made.mesh.certificate.failures().is_empty()
}

/// Returns true if all faces are exact, and no failure is due to the mesh.
fn is_final(made: &ModelBrep) -> bool {
    let is_of_geometry = |f: &Finding| {
        matches!(
            f,
            Finding::Reading { .. } | Finding::ShortEdge { .. } | Finding::SmallFace { .. }
        )
    };
    made.built.is_exact() && made.certificate.failures.iter().all(is_of_geometry)
}

/// Returns true if a finer mesh may help.
fn is_of_mesh(error: &BrepError) -> bool {
    matches!(
        error,
        BrepError::NoVertex { .. } | BrepError::NoCurve { .. } | BrepError::OffSurface { .. }
    )
}

/// Failure to derive a boundary representation from a mesh, with the size of the mesh.
struct RejectedMesh {
    error: BrepError,
    size: f64,
}

/// Data that all meshes of a search have in common.
struct BrepSearch<'a> {
    /// Solid without the sides of the box.
    meshed: &'a dyn Solid,
    /// Solid within the box.
    solid: &'a dyn Solid,
    /// True if sides of the box bound the solid; the mesher does not list the curves on them.
    is_capped: bool,
    smooth: Parts,
    tolerance: Option<f64>,
    control: &'a Control<'a>,
}

impl BrepSearch<'_> {
    /// Returns the best boundary representation: that of a first mesh, of an optimised mesh of the
    /// same size, or of finer ones.
    fn best(&self, mut options: MeshModelOptions) -> Result<ModelBrep, BrepModelError> {
        let is_free = options.size.is_none();
        // A mesh with unrestricted angles mostly gives the topology, even if some of its nodes are
        // wrong.
        let mut first = options.clone();
        first.mesh.rounds = 0;
        first.mesh.angles = [0.0, 180.0];
        let mut best = self.at_size(&first)?;
        for finer in 0..=MAX_MESH_HALVINGS {
            let size = match &best {
                Ok(made) if is_sound(made) && (finer > 0 || is_conclusive(made)) => break,
                Ok(made) if is_final(made) => break,
                Ok(made) => made.mesh.options.size,
                Err(RejectedMesh { size, .. }) => *size,
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
            let next = match self.at_size(&options) {
                // The present solid may be right, although it is not certified.
                Err(_) if best.is_ok() && self.control.is_late() => break,
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
            } else if finer > 0 && best.as_ref().is_ok_and(|made| made.certificate.holds()) {
                break;
            }
        }
        best.map_err(|refused| refused.error.into())
    }

    /// Computes the boundary representation with the topology of a mesh.
    fn at_size(
        &self,
        options: &MeshModelOptions,
    ) -> Result<Result<ModelBrep, RejectedMesh>, BrepModelError> {
        let mesh = mesh_solid(self.meshed, options, self.control)?;
        match self.of_mesh(&mesh) {
            Ok((built, certificate)) => Ok(Ok(ModelBrep {
                built,
                certificate,
                mesh,
            })),
            Err(BrepError::Stopped) => Err(BrepError::Stopped.into()),
            Err(error) => Ok(Err(RejectedMesh {
                error,
                size: mesh.options.size,
            })),
        }
    }

    fn of_mesh(&self, mesh: &ModelMesh) -> Result<(MeshedBrep, Certificate), BrepError> {
        self.control.begin("recognition")?;
        let labelled = &mesh.meshed.mesh;
        let pieces = pieces(labelled, self.solid, Some(&self.smooth), &quadric_through)?;
        let [x, y, z] = labelled.bounds().size();
        let tolerance = self
            .tolerance
            .unwrap_or(DEFAULT_SPLINE_TOLERANCE * x.max(y).max(z));
        let built = isoform_brep::brep(pieces, tolerance, self.control)?;
        self.control.begin("checking the solid")?;
        let witnesses = mesh.meshed.missed.witnesses.iter();
        let witnesses: Vec<Point3> = witnesses.map(|w| w.at).collect();
        let open = self.left_open(mesh, &built);
        let certificate = check(
            &built,
            self.solid,
            tolerance,
            &witnesses,
            open,
            self.control,
        )?;
        Ok((built, certificate))
    }

    /// Returns the questions that the mesh leaves open. Wrong nodes do not count if the solid
    /// itself shows that its faces are right.
    fn left_open(&self, mesh: &ModelMesh, built: &MeshedBrep) -> Vec<String> {
        let (of_nodes, of_solid): (Vec<Failure>, Vec<Failure>) = mesh
            .certificate
            .failures()
            .into_iter()
            .partition(is_of_nodes);
        let warnings = mesh.meshed.warnings.iter().map(|w| &w.kind);
        let (off, others): (Vec<&WarningKind>, Vec<&WarningKind>) =
            warnings.partition(|w| matches!(w, WarningKind::VertexOff | WarningKind::StrayFace));
        let of_nodes = of_nodes.iter().filter(|f| !is_excused(f, mesh, built));
        let mut of_nodes: Vec<String> = of_nodes.map(ToString::to_string).collect();
        of_nodes.extend(off.iter().map(ToString::to_string));
        if !of_nodes.is_empty() && !self.is_capped {
            let curves = mesh.meshed.features.curves.iter();
            let points = curves.flat_map(|c| c.points.iter().copied());
            if stands_alone(built, self.solid, points, self.control) {
                of_nodes.clear();
            }
        }
        let of_solid = of_solid.iter().map(ToString::to_string);
        let others = others.iter().map(ToString::to_string);
        of_solid.chain(of_nodes).chain(others).collect()
    }
}

/// Returns true if all wrong nodes are at points of contact, which are borders of the mesh, or if
/// all corners without a node are vertices of the solid, like tips of cones.
fn is_excused(failure: &Failure, mesh: &ModelMesh, built: &MeshedBrep) -> bool {
    let is_near = |p: Point3, q: &Point3, reach| distance_squared(*q, p).sqrt() <= reach;
    let is_vertex = |p: Point3| {
        let mut vertices = built.brep.vertices.iter();
        vertices.any(|v| is_near(p, v, MAX_CORNER_VERTEX_DISTANCE * built.size))
    };
    let is_in_contact = |p: Point3| {
        let mut contacts = built.contacts.iter();
        contacts.any(|(q, reach)| is_near(p, q, 2.0 * reach))
    };
    if failure.code == "missed-corner"
        && let Some(coverage) = &mesh.certificate.coverage
    {
        let missed = &coverage.missed_corners;
        if missed.places.len() == missed.count && missed.places.iter().all(|p| is_vertex(p.at)) {
            return true;
        }
    }
    let places: Vec<&Place> = failure.place.iter().chain(&failure.others).collect();
    places.len() >= failure.count && places.iter().all(|p| is_in_contact(p.at))
}

/// Returns a solid with one smooth part.
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

/// Returns true if the failure of a mesh concerns the positions of its nodes, and not the solid.
fn is_of_nodes(failure: &Failure) -> bool {
    NODE_FAILURE_CODES.contains(&failure.code)
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_field::hyperfun::Mode;

    /// A frame with walls of 0.2, rounded corners of radius 1 outside and 0.8 inside.
    const FRAME: &str = "m(x[3], a[1]) {
        ox = abs(x[1]) - 6.5; oy = abs(x[2]) - 3;
        corner = (ox & oy) \\ (1 - ox^2 - oy^2);
        inner_corner = (ox & oy) \\ (0.64 - ox^2 - oy^2);
        outer = ((7.5 - abs(x[1])) & (4 - abs(x[2]))) \\ corner;
        inner = ((7.3 - abs(x[1])) & (3.8 - abs(x[2]))) \\ inner_corner;
        m = ((outer \\ inner) & x[3]) & (1 - x[3]); }";
    const BLOCK: &str =
        "m(x[3], a[1]) { m = min(min(2 - abs(x[1]), 1 - abs(x[2])), 1 - abs(x[3])); }";
    /// The block with a bore through its top, off the centres of its faces.
    const BORED: &str = "m(x[3], a[1]) {
        block = min(min(2 - abs(x[1]), 1 - abs(x[2])), 1 - abs(x[3]));
        m = min(block, (x[1] - 1)^2 + (x[2] - 0.5)^2 - 0.01); }";
    /// A part of the block, less than half of it.
    const THIRD: &str =
        "m(x[3], a[1]) { m = min(min(x[1] - 0.7, 2 - x[1]), min(1 - abs(x[2]), 1 - abs(x[3]))); }";

    fn made_of(program: &str, size: Option<f64>) -> (Model, ModelBrep) {
        let model = Model::parse(program, Mode::Default).expect("a program");
        let options = MeshModelOptions {
            size,
            ..MeshModelOptions::default()
        };
        let control = Control::default();
        let made = brep_model(&model, &[], &options, None, &control).expect("a solid");
        (model, made)
    }

    /// Returns true if the solid of the first program shows by itself that it is that of the
    /// second.
    fn stands_for(program: &str, other: &str) -> bool {
        let (_, made) = made_of(program, None);
        let (model, of_other) = made_of(other, None);
        let control = Control::default();
        let found =
            meshable(&model, &[], None, Some(MAX_PARTS_PER_PIECE), &control).expect("a solid");
        let curves = of_other.mesh.meshed.features.curves.iter();
        let points = curves.flat_map(|c| c.points.iter().copied());
        stands_alone(&made.built, found.solid.as_ref(), points, &control)
    }

    #[test]
    fn nodes_off_the_seams_of_thin_walls_do_not_matter() {
        let (_, made) = made_of(FRAME, Some(0.5));
        let open = made.mesh.certificate.failures();
        assert!(open.iter().any(is_of_nodes), "{open:?}");
        assert_eq!(made.certificate.failures, []);
        let corners = 4.0 - std::f64::consts::PI;
        let area = (15.0 * 8.0 - corners) - (14.6 * 7.6 - 0.64 * corners);
        let volume = made.certificate.total.volume;
        assert!((volume / area - 1.0).abs() < 1e-9, "{volume} for {area}");
    }

    /// Programs that only move an object are converted in its frame, and the results moved to
    /// space.
    #[test]
    fn moved_objects_are_moved_solids() {
        let own = "part(x[3], a[1]) {
            r = sqrt(x[1]^2 + x[2]^2);
            can = min(a[1] - r, min(x[3], 2 - x[3]));
            tip = min((1 - x[3])/2 - sqrt((x[1] - 4)^2 + x[2]^2), x[3]);
            ring = 0.3 - sqrt((sqrt((x[1] - 8)^2 + x[2]^2) - 1)^2 + x[3]^2);
            egg = 1 - (x[1] - 12)^2 - x[2]^2/0.5 - x[3]^2/0.25;
            part = max(can, max(tip, max(ring, egg))); }";
        let moved = format!(
            "{own}
            -- @values b of part
            my_model(x[3], a[1]) {{
              array b[1], p[3];
              p[1] = 0.6*(x[1] - 10) + 0.8*(x[2] + 20);
              p[2] = (-0.8)*(x[1] - 10) + 0.6*(x[2] + 20);
              p[3] = x[3] - 30;
              b = [1.5];
              my_model = part(p, b);
            }}"
        );
        let out = |p: Point3| {
            [
                10.0 + 0.6 * p[0] - 0.8 * p[1],
                -20.0 + 0.8 * p[0] + 0.6 * p[1],
                30.0 + p[2],
            ]
        };
        let at_rest = Model::parse(own, Mode::Default).expect("a program");
        let options = MeshModelOptions::default();
        let control = Control::default();
        let at_rest = brep_model(&at_rest, &[1.5], &options, None, &control).expect("solids");
        let (model, made) = made_of(&moved, None);
        assert!(unplaced(&model).is_some());
        let (found, wanted) = (&made.certificate, &at_rest.certificate);
        assert_eq!(
            (&found.failures, found.euler),
            (&wanted.failures, wanted.euler)
        );
        assert_eq!(found.total.volume, wanted.total.volume);
        let off = |p: Point3, q: Point3| distance_squared(p, q).sqrt();
        assert!(off(found.centroid(), out(wanted.centroid())) < 1e-12);
        let field = RunField::new(&model, &[1.5]).expect("a field");
        let (brep, still) = (&made.built.brep, &at_rest.built.brep);
        for e in 0..brep.edges.len() as u32 {
            for s in [0.0, 0.3, 0.6, 1.0] {
                let p = brep.along(e, s).0;
                assert!(off(p, out(still.along(e, s).0)) < 1e-12);
            }
        }
        // The program's own function vanishes on the faces.
        let options = isoform_brep::FacetOptions {
            chord: 0.01,
            longest: 0.3,
        };
        let facets = isoform_brep::facets(brep, &options, &control).expect("facets");
        for p in &facets.points {
            let value = isoform_geom::Field::value(&field, *p);
            assert!(value.abs() < 1e-9, "{value} at {p:?}");
        }
        // Volume after a change of the parameter.
        let wider = brep_model(&model, &[1.8], &MeshModelOptions::default(), None, &control);
        let grown = wider.expect("solids").certificate.total.volume - found.total.volume;
        let wanted = 2.0 * std::f64::consts::PI * (1.8f64.powi(2) - 1.5f64.powi(2));
        assert!((grown - wanted).abs() < 1e-9, "{grown} for {wanted}");
    }

    /// A node below the top of a block makes its triangle belong to a plane that is elsewhere.
    #[test]
    fn parts_that_are_nowhere_on_the_surface_go_to_their_neighbours() {
        let program = "m(x[3], a[1]) {
            top = 1 - x[3]; far = 1.001 - x[3];
            sides = min(min(1 - abs(x[1]), 1 - abs(x[2])), 1 + x[3]);
            m = min(sides, min(top, max(far, x[1] - 7))); }";
        let (model, made) = made_of(program, None);
        let control = Control::default();
        let found =
            meshable(&model, &[], None, Some(MAX_PARTS_PER_PIECE), &control).expect("a solid");
        let mut mesh = made.mesh.meshed.mesh;
        let top = mesh.parts.iter().position(|n| n == "top").expect("a part") as u32;
        mesh.parts.push("far".to_owned());
        let far = mesh.parts.len() as u32 - 1;
        let all = 0..mesh.triangles.len();
        let inside = |v: &u32| {
            let p = mesh.points[*v as usize];
            p[2] == 1.0 && p[0].abs() < 0.9 && p[1].abs() < 0.9
        };
        let of_top = |t: &usize| mesh.triangle_parts[*t] == top;
        let is_inside = |t: &usize| mesh.triangles[*t].iter().all(inside);
        let stray = all
            .clone()
            .filter(of_top)
            .find(is_inside)
            .expect("a triangle");
        mesh.triangle_parts[stray] = far;
        let faces = |mesh: &isoform_geom::Mesh| {
            let smooth = found.parts.as_ref();
            let made = pieces(mesh, found.solid.as_ref(), smooth, &quadric_through)?;
            isoform_brep::brep(made, 1e-6, &control).map(|built| built.brep.faces.len())
        };
        // All nodes are on the surface, so the certificate of the mesh has no finding, and the part
        // stays.
        assert_ne!(faces(&mesh), Ok(6));
        let node = mesh.triangles[stray][0] as usize;
        mesh.points[node][2] -= 1e-3;
        assert_eq!(faces(&mesh), Ok(6));
    }

    /// A box with round edges and corners: 26 faces, 48 edges, 24 vertices.
    #[test]
    fn small_rounds_all_around_are_exact() {
        let sides = [9.0, 7.0, 5.0];
        let r = 0.5;
        let mut program = String::from("m(x[3], a[1]) {\n");
        let mut body =
            String::from("min(min(x[1] & (9 - x[1]), x[2] & (7 - x[2])), x[3] & (5 - x[3]))");
        // Each round runs along the axes without a sign.
        for n in 1..27 {
            let signs = [n % 3, n / 3 % 3, n / 9];
            let across: Vec<usize> = (0..3).filter(|k| signs[*k] > 0).collect();
            if across.len() < 2 {
                continue;
            }
            let place = |k: usize| if signs[k] == 1 { r } else { sides[k] - r };
            let beyond = across.iter().map(|k| {
                let x = format!("x[{}]", k + 1);
                if signs[*k] == 1 {
                    format!("({} - {x})", place(*k))
                } else {
                    format!("({x} - {})", place(*k))
                }
            });
            let beyond: Vec<String> = beyond.collect();
            let squares = across
                .iter()
                .map(|k| format!("(x[{}] - {})^2", k + 1, place(*k)));
            let squares: Vec<String> = squares.collect();
            let (beyond, squares) = (beyond.join(" & "), squares.join(" - "));
            program += &format!("round_{n} = ({beyond}) \\ ({r}^2 - {squares});\n");
            body += &format!(" \\ round_{n}");
        }
        program += &format!("m = {body}; }}");
        let (_, made) = made_of(&program, None);
        assert_eq!(made.certificate.failures, []);
        let brep = &made.built.brep;
        assert_eq!(brep.faces.len(), 26);
        let [a, b, c] = sides.map(|s| s - 2.0 * r);
        let pi = std::f64::consts::PI;
        let volume = a * b * c
            + 2.0 * r * (a * b + b * c + c * a)
            + pi * r * r * (a + b + c)
            + 4.0 / 3.0 * pi * r * r * r;
        let found = made.certificate.total.volume;
        assert!((found / volume - 1.0).abs() < 1e-12, "{found} for {volume}");
    }

    #[test]
    fn solids_stand_for_their_own_models_alone() {
        assert!(stands_for(BLOCK, BLOCK));
        assert!(stands_for(BORED, BORED));
        // Circles of the bore do not lie on edges of the block.
        assert!(!stands_for(BLOCK, BORED));
        // All edges of the bored block are its feature curves, those of the block among them.
        assert!(!stands_for(BORED, BLOCK));
        assert!(!stands_for(BLOCK, THIRD));
    }
}
