//! STEP (ISO 10303-21, AP242): rational patches as faces of CAD.
//!
//! Each patch is an ADVANCED_FACE in an open shell of its own, bounded by its four borders as
//! rational B-spline curves. Its surface is the patch itself as a rational B-spline with clamped
//! knots, or the plane, sphere, cylinder, cone or torus that it lies on. CAD systems drop faces
//! that have a control weight of 0 or less without a word: knots are inserted until all are
//! positive, which changes no point of the surface.
//!
//! Equal patches give equal bytes: the time stamp is a fixed one unless another is given.

mod brep;
mod knots;
mod parse;
mod part21;
mod placement;
mod read;
mod spline;

use crate::{WriteError, write_atomic};
pub use brep::{SolidOptions, SolidProperties, step_solids, write_step_solids};
use isoform_geom::{Point3, Quadric, RationalPatch, distance_squared};
use part21::Document;
use placement::Placement;
pub use read::read_step_solids;
use spline::Spline;
use std::io::Write;
use std::path::Path;

/// Points this near to one another, in units of the largest coordinate, are one vertex.
const SAME: f64 = 1e-9;
/// The protocol of the schema, with its year.
const PROTOCOL: &str = "'international standard','ap242_managed_model_based_3d_engineering',2014";
/// What the file states as the accuracy of its lengths, in its unit.
const UNCERTAINTY: f64 = 1e-7;
/// The time stamp unless another is given: equal patches are to give equal files.
const EPOCH: &str = "1970-01-01T00:00:00";

/// A patch to be written as a face.
#[derive(Clone, Debug)]
pub struct StepFace {
    /// Its name; may be empty.
    pub name: String,
    /// The patch; ∂p/∂u × ∂p/∂v points outward.
    pub patch: RationalPatch,
    /// The surface that the patch lies on to rounding, if that is known.
    pub surface: Option<Quadric>,
}

/// How to write STEP.
#[derive(Clone, Debug, Default)]
pub struct StepOptions {
    /// Unit of length of the coordinates: um, mm, cm, m, in or ft; mm by default.
    pub units: Option<String>,
    /// Name of the product.
    pub name: String,
    /// Time stamp, such as `2026-01-31T12:00:00`; without one a fixed one, so that the same patches
    /// give the same bytes.
    pub time: Option<String>,
}

/// Units of length that STEP files can state here.
pub const STEP_UNITS: [&str; 6] = ["um", "mm", "cm", "m", "in", "ft"];

/// The text of a STEP file with a face for each patch.
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

/// Writes a STEP file, whole or not at all (see [`write_atomic`]).
pub fn write_step_path(
    faces: &[StepFace],
    path: &Path,
    options: &StepOptions,
) -> Result<(), WriteError> {
    let text = compose(faces, options, &path.display().to_string())?;
    write_atomic(path, |out: &mut dyn Write| out.write_all(text.as_bytes()))
}

/// The text of the file, or the refusal with the name of the file.
fn compose(faces: &[StepFace], options: &StepOptions, file: &str) -> Result<String, WriteError> {
    let refuse = |refusal: Refusal| WriteError {
        code: refusal.code,
        what: "cannot write STEP",
        file: file.to_owned(),
        why: refusal.why,
        hint: refusal.hint,
    };
    let unit = unit(options).map_err(refuse)?;
    let splines = splines(faces).map_err(refuse)?;
    let size = size(&splines).map_err(refuse)?;

    let mut doc = Document::default();
    let product = product(&mut doc, options, unit);
    let mut shells = Vec::with_capacity(faces.len());
    for (face, spline) in faces.iter().zip(&splines) {
        let advanced = write_face(&mut doc, face, spline, SAME * size);
        let (name, face) = (part21::text(&face.name), part21::id(advanced));
        shells.push(doc.add(&format!("OPEN_SHELL({name},({face}))")));
    }
    product.represent(&mut doc, &shells);
    Ok(doc.file(&options.name, options.time.as_deref().unwrap_or(EPOCH)))
}

/// Why patches cannot be written.
struct Refusal {
    code: &'static str,
    why: String,
    hint: &'static str,
}

/// The unit of length, which must be one that STEP files can state here.
fn unit(options: &StepOptions) -> Result<&str, Refusal> {
    let unit = options.units.as_deref().unwrap_or("mm");
    if STEP_UNITS.contains(&unit) {
        return Ok(unit);
    }
    Err(Refusal {
        code: "unit-unknown",
        why: format!(
            "\"{}\" is not among its units of length: {}",
            crate::input::shorten(unit),
            STEP_UNITS.join(", ")
        ),
        hint: "choose one of these",
    })
}

/// The surfaces of the faces, of which there must be one, with positive weights.
fn splines(faces: &[StepFace]) -> Result<Vec<Spline>, Refusal> {
    if faces.is_empty() {
        return Err(Refusal {
            code: "empty",
            why: "there is no patch".to_owned(),
            hint: "a file of faces needs one",
        });
    }
    let positive = |(face, number): (&StepFace, usize)| {
        Spline::positive(&face.patch).ok_or_else(|| Refusal {
            code: "weights",
            why: format!(
                "patch {number}: no positive control weights were found; its weight comes near 0, or below, inside"
            ),
            hint: "a smaller patch",
        })
    };
    faces.iter().zip(1..).map(positive).collect()
}

/// The largest coordinate of a control point.
fn size(splines: &[Spline]) -> Result<f64, Refusal> {
    let coordinates = splines.iter().flat_map(Spline::points).flatten();
    let size = coordinates.fold(0.0f64, |m, v| m.max(v.abs()));
    if size.is_finite() {
        return Ok(size);
    }
    Err(Refusal {
        code: "overflow",
        why: "a control point is beyond the largest number".to_owned(),
        hint: "a smaller patch",
    })
}

/// Instances of the product to which faces are tied.
struct Product {
    /// Shape of the product, which the representation defines.
    shape: usize,
    /// Units and accuracy of the coordinates.
    context: usize,
    /// Unit of length.
    length: usize,
    /// Axes at the origin.
    origin: usize,
}

/// What every file of a part says: the product, its units, and where the origin is.
fn product(doc: &mut Document, options: &StepOptions, unit: &str) -> Product {
    let name = part21::text(if options.name.is_empty() {
        "surface"
    } else {
        &options.name
    });
    Product::new(doc, &name, unit, PROTOCOL, UNCERTAINTY)
}

impl Product {
    /// The product of this name (in quotes), in a unit of length, by a protocol, with an accuracy.
    fn new(doc: &mut Document, name: &str, unit: &str, protocol: &str, accuracy: f64) -> Self {
        let shape = shape(doc, name, protocol);
        let (context, length) = context(doc, unit, accuracy);
        let origin = doc.placement(&Placement {
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
    /// The shape of the product is these shells.
    fn represent(&self, doc: &mut Document, shells: &[usize]) {
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

/// The product of this name, down to its shape.
fn shape(doc: &mut Document, name: &str, protocol: &str) -> usize {
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

/// The space of the coordinates: units of length and angle, and the accuracy; and the unit of
/// length.
fn context(doc: &mut Document, unit: &str, accuracy: f64) -> (usize, usize) {
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

/// One of [`STEP_UNITS`].
fn length_unit(doc: &mut Document, unit: &str) -> usize {
    let id = part21::id;
    let si = |doc: &mut Document, prefix: &str| {
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

/// A border of a face.
struct Border {
    /// Its control points, homogeneous.
    control: Vec<[f64; 4]>,
    /// Whether it runs along u, whose knots it has then.
    along_u: bool,
    /// Whether it runs along the loop around the face.
    forward: bool,
}

/// The borders around a face, its outside above.
fn borders(spline: &Spline) -> [Border; 4] {
    let (m, n) = spline.last();
    let row = |i: usize| (0..=n).map(|j| spline.at(i, j)).collect();
    let column = |j: usize| (0..=m).map(|i| spline.at(i, j)).collect();
    let border = |control, along_u, forward| Border {
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

/// The corners of a face that are written already.
struct Vertices {
    /// Points this near are one.
    same: f64,
    /// Places of the vertices with their numbers.
    written: Vec<(Point3, usize)>,
}

impl Vertices {
    /// Whether two points are one vertex.
    fn is_same(&self, p: Point3, q: Point3) -> bool {
        distance_squared(p, q) <= self.same * self.same
    }
    /// The vertex at a point.
    fn at(&mut self, doc: &mut Document, p: Point3) -> usize {
        if let Some((_, vertex)) = self.written.iter().find(|(q, _)| self.is_same(*q, p)) {
            return *vertex;
        }
        let at = doc.point(p);
        let vertex = doc.add(&format!("VERTEX_POINT('',{})", part21::id(at)));
        self.written.push((p, vertex));
        vertex
    }
}

/// A face with its surface, borders and corners.
fn write_face(doc: &mut Document, face: &StepFace, spline: &Spline, same: f64) -> usize {
    let mut vertices = Vertices {
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

/// The edge of a border; none where the border is a point, such as the pole of a sphere.
fn write_edge(
    doc: &mut Document,
    border: &Border,
    spline: &Spline,
    vertices: &mut Vertices,
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

/// The named surface that the patch lies on, if it can be placed, else the spline; and whether its
/// normal agrees with that of the patch.
fn write_surface(doc: &mut Document, face: &StepFace, spline: &Spline) -> (usize, bool) {
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
