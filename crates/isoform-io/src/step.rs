//! STEP (ISO 10303-21, AP242): rational patches as faces for CAD.
//!
//! Each patch is an ADVANCED_FACE in its own open shell, bounded by its four borders as rational
//! B-spline curves. Its surface is the patch itself as a rational B-spline with clamped knots, or
//! the plane, sphere, cylinder, cone or torus on which it lies. CAD systems silently drop faces
//! with a control weight of 0 or less; therefore knots are inserted until all weights are positive,
//! which leaves the surface unchanged.
//!
//! Equal patches give equal bytes: the time stamp is constant unless one is given.

mod brep;
mod knots;
mod parse;
mod part21;
mod placement;
mod read;
mod records;
mod shape;
mod spline;

use crate::{WriteError, write_atomic};
pub use brep::{SolidOptions, SolidProperties, step_solids, write_step_solids};
use isoform_geom::{Point3, Quadric, RationalPatch, distance_squared};
use part21::StepDocument;
use placement::AxisPlacement;
pub use read::{StepContent, read_step, read_step_solids};
pub use shape::ShapeFile;
use spline::Spline;
use std::io::Write;
use std::path::Path;

/// Maximum distance between coincident vertices, relative to the largest coordinate.
const VERTEX_MERGE_DISTANCE: f64 = 1e-9;
/// Application protocol of the schema, with its year.
const AP242_PROTOCOL: &str =
    "'international standard','ap242_managed_model_based_3d_engineering',2014";
/// Accuracy of lengths stated in the file, in its unit.
const LENGTH_UNCERTAINTY: f64 = 1e-7;
/// Default time stamp; it is constant, so that equal patches give equal files.
const DEFAULT_TIME: &str = "1970-01-01T00:00:00";

/// Patch to be written as a face.
#[derive(Clone, Debug)]
pub struct StepFace {
    /// Name; may be empty.
    pub name: String,
    /// Patch; ∂p/∂u × ∂p/∂v points outward.
    pub patch: RationalPatch,
    /// Surface on which the patch lies up to rounding; `None` if unknown.
    pub surface: Option<Quadric>,
}

/// Options of writing STEP.
#[derive(Clone, Debug, Default)]
pub struct StepOptions {
    /// Unit of length of the coordinates: um, mm, cm, m, in or ft; mm by default.
    pub units: Option<String>,
    /// Name of the product.
    pub name: String,
    /// Time stamp, such as `2026-01-31T12:00:00`. The default is constant, so that equal patches
    /// give equal bytes.
    pub time: Option<String>,
}

/// Supported units of length.
pub const STEP_UNITS: [&str; 6] = ["um", "mm", "cm", "m", "in", "ft"];

/// Returns the text of a STEP file with one face per patch.
///
/// ```
/// use isoform_geom::RationalPatch;
/// use isoform_io::{StepFace, StepOptions, step};
/// let square = RationalPatch::planar((1, 1), [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
/// let text = step(&[StepFace { name: String::new(), patch: square, surface: None }], &StepOptions::default())?;
/// assert!(text.starts_with("ISO-10303-21;\n") && text.contains("RATIONAL_B_SPLINE_SURFACE"));
/// # Ok::<(), isoform_io::WriteError>(())
/// ```
pub fn step(faces: &[StepFace], options: &StepOptions) -> Result<String, WriteError> {
    compose(faces, options, "output")
}

/// Writes a STEP file atomically (see [`write_atomic`]).
pub fn write_step_path(
    faces: &[StepFace],
    path: &Path,
    options: &StepOptions,
) -> Result<(), WriteError> {
    let text = compose(faces, options, &path.display().to_string())?;
    write_atomic(path, |out: &mut dyn Write| out.write_all(text.as_bytes()))
}

/// Returns the text of the file, or an error that names the file.
fn compose(faces: &[StepFace], options: &StepOptions, file: &str) -> Result<String, WriteError> {
    let refuse = |refusal: StepRefusal| WriteError {
        code: refusal.code,
        what: "cannot write STEP",
        file: file.to_owned(),
        why: refusal.why,
        hint: refusal.hint,
    };
    let unit = unit(options).map_err(refuse)?;
    let splines = splines(faces).map_err(refuse)?;
    let size = size(&splines).map_err(refuse)?;

    let mut doc = StepDocument::default();
    let product = product(&mut doc, options, unit);
    let mut shells = Vec::with_capacity(faces.len());
    for (face, spline) in faces.iter().zip(&splines) {
        let advanced = write_face(&mut doc, face, spline, VERTEX_MERGE_DISTANCE * size);
        let (name, face) = (part21::text(&face.name), part21::id(advanced));
        shells.push(doc.add(&format!("OPEN_SHELL({name},({face}))")));
    }
    product.represent(&mut doc, &shells);
    Ok(doc.file(
        &options.name,
        options.time.as_deref().unwrap_or(DEFAULT_TIME),
    ))
}

/// Reason why patches cannot be written.
struct StepRefusal {
    code: &'static str,
    why: String,
    hint: &'static str,
}

/// Returns the unit of length if it is one of [`STEP_UNITS`].
fn unit(options: &StepOptions) -> Result<&str, StepRefusal> {
    let unit = options.units.as_deref().unwrap_or("mm");
    if STEP_UNITS.contains(&unit) {
        return Ok(unit);
    }
    Err(StepRefusal {
        code: "unit-unknown",
        why: format!(
            "\"{}\" is not among its units of length: {}",
            crate::input::shorten(unit),
            STEP_UNITS.join(", ")
        ),
        hint: "choose one of these",
    })
}

/// Converts the patches, of which there must be at least one, to B-splines with positive weights.
fn splines(faces: &[StepFace]) -> Result<Vec<Spline>, StepRefusal> {
    if faces.is_empty() {
        return Err(StepRefusal {
            code: "empty",
            why: "there is no patch".to_owned(),
            hint: "a file of faces needs one",
        });
    }
    let positive = |(face, number): (&StepFace, usize)| {
        Spline::positive(&face.patch).ok_or_else(|| StepRefusal {
            code: "weights",
            why: format!(
                "patch {number}: no positive control weights were found; its weight comes near 0, or below, inside"
            ),
            hint: "a smaller patch",
        })
    };
    faces.iter().zip(1..).map(positive).collect()
}

/// Returns the largest absolute coordinate of all control points.
fn size(splines: &[Spline]) -> Result<f64, StepRefusal> {
    let coordinates = splines.iter().flat_map(Spline::points).flatten();
    let size = coordinates.fold(0.0f64, |m, v| m.max(v.abs()));
    if size.is_finite() {
        return Ok(size);
    }
    Err(StepRefusal {
        code: "overflow",
        why: "a control point is beyond the largest number".to_owned(),
        hint: "a smaller patch",
    })
}

/// Instances of the product to which the faces belong.
struct StepProduct {
    /// Shape of the product, which the representation defines.
    shape: usize,
    /// Context with units and accuracy of the coordinates.
    context: usize,
    /// Unit of length.
    length: usize,
    /// Axes at the origin.
    origin: usize,
}

/// Adds the instances common to all files of patches: product, units and origin.
fn product(doc: &mut StepDocument, options: &StepOptions, unit: &str) -> StepProduct {
    let name = part21::text(if options.name.is_empty() {
        "surface"
    } else {
        &options.name
    });
    StepProduct::new(doc, &name, unit, AP242_PROTOCOL, LENGTH_UNCERTAINTY)
}

impl StepProduct {
    /// Adds a product with a name (in quotes), unit of length, application protocol and accuracy.
    fn new(doc: &mut StepDocument, name: &str, unit: &str, protocol: &str, accuracy: f64) -> Self {
        let shape = shape(doc, name, protocol);
        let (context, length) = context(doc, unit, accuracy);
        let origin = doc.placement(&AxisPlacement {
            origin: [0.0; 3],
            z: [0.0, 0.0, 1.0],
            x: [1.0, 0.0, 0.0],
        });
        Self {
            shape,
            context,
            length,
            origin,
        }
    }
    /// Defines the shape of the product by these shells.
    fn represent(&self, doc: &mut StepDocument, shells: &[usize]) {
        let shells = part21::ids(shells);
        let model = doc.add(&format!("SHELL_BASED_SURFACE_MODEL('',{shells})"));
        let items = part21::ids(&[model, self.origin]);
        let context = part21::id(self.context);
        let representation = doc.add(&format!(
            "MANIFOLD_SURFACE_SHAPE_REPRESENTATION('',{items},{context})"
        ));
        doc.add(&format!(
            "SHAPE_DEFINITION_REPRESENTATION({},{})",
            part21::id(self.shape),
            part21::id(representation)
        ));
    }
}

/// Adds the product of this name, down to its shape.
fn shape(doc: &mut StepDocument, name: &str, protocol: &str) -> usize {
    let id = part21::id;
    let app = doc.add("APPLICATION_CONTEXT('managed model based 3d engineering')");
    doc.add(&format!(
        "APPLICATION_PROTOCOL_DEFINITION({protocol},{})",
        id(app)
    ));
    let context = doc.add(&format!("PRODUCT_CONTEXT('',{},'mechanical')", id(app)));
    let product = doc.add(&format!("PRODUCT({name},{name},'',({}))", id(context)));
    doc.add(&format!(
        "PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,({}))",
        id(product)
    ));
    let formation = doc.add(&format!(
        "PRODUCT_DEFINITION_FORMATION('','',{})",
        id(product)
    ));
    let design = doc.add(&format!(
        "PRODUCT_DEFINITION_CONTEXT('part definition',{},'design')",
        id(app)
    ));
    let definition = doc.add(&format!(
        "PRODUCT_DEFINITION('design','',{},{})",
        id(formation),
        id(design)
    ));
    doc.add(&format!(
        "PRODUCT_DEFINITION_SHAPE('','',{})",
        id(definition)
    ))
}

/// Adds the coordinate context, which states the units of length and angle and the accuracy.
/// Returns the context and the unit of length.
fn context(doc: &mut StepDocument, unit: &str, accuracy: f64) -> (usize, usize) {
    let id = part21::id;
    let length = length_unit(doc, unit);
    let angle = doc.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))");
    let solid = doc.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())");
    let accuracy = format!(
        "LENGTH_MEASURE({}),{},'distance_accuracy_value',''",
        part21::real(accuracy),
        id(length)
    );
    let accuracy = doc.add(&format!("UNCERTAINTY_MEASURE_WITH_UNIT({accuracy})"));
    let context = doc.add(&format!(
        "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({}))GLOBAL_UNIT_ASSIGNED_CONTEXT({})\
         REPRESENTATION_CONTEXT('','3D'))",
        id(accuracy),
        part21::ids(&[length, angle, solid])
    ));
    (context, length)
}

/// Adds one of [`STEP_UNITS`].
fn length_unit(doc: &mut StepDocument, unit: &str) -> usize {
    let id = part21::id;
    let si = |doc: &mut StepDocument, prefix: &str| {
        doc.add(&format!(
            "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT({prefix},.METRE.))"
        ))
    };
    match unit {
        "um" => si(doc, ".MICRO."),
        "cm" => si(doc, ".CENTI."),
        "m" => si(doc, "$"),
        "in" | "ft" => {
            let (name, size) = if unit == "in" {
                ("INCH", 25.4)
            } else {
                ("FOOT", 304.8)
            };
            let millimetre = si(doc, ".MILLI.");
            let measure = doc.add(&format!(
                "LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE({}),{})",
                part21::real(size),
                id(millimetre)
            ));
            let dimensions = doc.add("DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.)");
            doc.add(&format!(
                "(CONVERSION_BASED_UNIT('{name}',{})LENGTH_UNIT()NAMED_UNIT({}))",
                id(measure),
                id(dimensions)
            ))
        }
        _ => si(doc, ".MILLI."),
    }
}

/// Border of a face.
struct FaceBorder {
    /// Homogeneous control points.
    control: Vec<[f64; 4]>,
    /// True if the border runs along u and has the knots of u.
    along_u: bool,
    /// True if the border has the direction of the loop around the face.
    forward: bool,
}

/// Returns the borders of a face, counterclockwise as seen from outside.
fn borders(spline: &Spline) -> [FaceBorder; 4] {
    let (m, n) = spline.last();
    let row = |i: usize| (0..=n).map(|j| spline.at(i, j)).collect();
    let column = |j: usize| (0..=m).map(|i| spline.at(i, j)).collect();
    let border = |control, along_u, forward| FaceBorder {
        control,
        along_u,
        forward,
    };
    [
        border(column(0), true, true),
        border(row(m), false, true),
        border(column(n), true, false),
        border(row(0), false, false),
    ]
}

/// Vertices of a face written so far.
struct StepVertices {
    /// Maximum distance between coincident vertices.
    same: f64,
    /// Points of the vertices with their instances.
    written: Vec<(Point3, usize)>,
}

impl StepVertices {
    /// Returns true if two points are one vertex.
    fn is_same(&self, p: Point3, q: Point3) -> bool {
        distance_squared(p, q) <= self.same * self.same
    }
    /// Returns the vertex at a point; adds it if it is new.
    fn at(&mut self, doc: &mut StepDocument, p: Point3) -> usize {
        if let Some((_, vertex)) = self.written.iter().find(|(q, _)| self.is_same(*q, p)) {
            return *vertex;
        }
        let at = doc.point(p);
        let vertex = doc.add(&format!("VERTEX_POINT('',{})", part21::id(at)));
        self.written.push((p, vertex));
        vertex
    }
}

/// Adds a face with its surface, edges and vertices.
fn write_face(doc: &mut StepDocument, face: &StepFace, spline: &Spline, same: f64) -> usize {
    let mut vertices = StepVertices {
        same,
        written: Vec::new(),
    };
    let mut edges = Vec::new();
    for border in &borders(spline) {
        edges.extend(write_edge(doc, border, spline, &mut vertices));
    }
    let (surface, agrees) = write_surface(doc, face, spline);
    let around = doc.add(&format!("EDGE_LOOP('',{})", part21::ids(&edges)));
    let bound = doc.add(&format!("FACE_OUTER_BOUND('',{},.T.)", part21::id(around)));
    let (name, agrees) = (part21::text(&face.name), part21::flag(agrees));
    doc.add(&format!(
        "ADVANCED_FACE({name},({}),{},{agrees})",
        part21::id(bound),
        part21::id(surface)
    ))
}

/// Adds the edge of a border; `None` if the border is a point, such as the pole of a sphere.
fn write_edge(
    doc: &mut StepDocument,
    border: &FaceBorder,
    spline: &Spline,
    vertices: &mut StepVertices,
) -> Option<usize> {
    let points: Vec<Point3> = border.control.iter().map(spline::affine).collect();
    let (first, last) = (points[0], points[points.len() - 1]);
    if points.iter().all(|p| vertices.is_same(*p, first)) {
        return None;
    }
    let [start, end] = [first, last].map(|p| part21::id(vertices.at(doc, p)));
    let curve = part21::id(doc.curve(&border.control, spline.knots(border.along_u)));
    let edge = doc.add(&format!("EDGE_CURVE('',{start},{end},{curve},.T.)"));
    Some(doc.add(&format!(
        "ORIENTED_EDGE('',*,*,{},{})",
        part21::id(edge),
        part21::flag(border.forward)
    )))
}

/// Adds the named surface of the patch if it can be placed, else the spline. Returns true with it
/// if its normal agrees with that of the patch.
fn write_surface(doc: &mut StepDocument, face: &StepFace, spline: &Spline) -> (usize, bool) {
    let Some(placed) = face.surface.and_then(|s| placement::place(&s, &face.patch)) else {
        return (doc.surface(spline), true);
    };
    let axes = part21::id(doc.placement(&placed.axes));
    let numbers: String = placed
        .numbers
        .iter()
        .map(|v| format!(",{}", part21::real(*v)))
        .collect();
    let surface = doc.add(&format!("{}('',{axes}{numbers})", placed.entity));
    (surface, placed.agrees)
}
