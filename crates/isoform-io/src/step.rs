//! STEP (ISO 10303-21, AP242): rational patches as faces of CAD.
//!
//! Each patch is an ADVANCED_FACE in an open shell of its own, bounded by its four borders as
//! rational B-spline curves. Its surface is the patch itself as a rational B-spline with clamped
//! knots, or the plane, sphere, cylinder, cone or torus that it lies on. CAD systems drop faces
//! that have a control weight of 0 or less without a word: knots are inserted until all are
//! positive, which changes no point of the surface.
//!
//! The same patches give the same bytes: the time stamp is a fixed one unless another is given.

mod knots;
mod part21;
mod placement;
mod spline;

use crate::{WriteError, write_atomic};
use isoform_geom::{Point3, Quadric, RationalPatch, distance_squared};
use part21::Document;
use placement::Placement;
use spline::Spline;
use std::io::Write;
use std::path::Path;

/// Points this near to one another, in units of the largest coordinate, are one vertex.
const SAME: f64 = 1e-9;
/// What the file states as the accuracy of its lengths, in its unit.
const UNCERTAINTY: f64 = 1e-7;
/// The time of files that are to be the same each time.
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

fn compose(faces: &[StepFace], options: &StepOptions, file: &str) -> Result<String, WriteError> {
    let refuse = |code, why: String, hint| WriteError {
        code,
        what: "cannot write STEP",
        file: file.to_owned(),
        why,
        hint,
    };
    let unit = options.units.as_deref().unwrap_or("mm");
    if !STEP_UNITS.contains(&unit) {
        let why = format!(
            "\"{}\" is not among its units of length: {}",
            crate::input::shorten(unit),
            STEP_UNITS.join(", ")
        );
        return Err(refuse("unit-unknown", why, "choose one of these"));
    }
    if faces.is_empty() {
        return Err(refuse(
            "empty",
            "there is no patch".to_owned(),
            "a file of faces needs one",
        ));
    }
    let mut splines = Vec::with_capacity(faces.len());
    for (i, face) in faces.iter().enumerate() {
        splines.push(Spline::positive(&face.patch).ok_or_else(|| {
            let why = format!("patch {}: no positive control weights were found; its weight comes near 0, or below, inside", i + 1);
            refuse("weights", why, "a smaller patch")
        })?);
    }
    let size = splines
        .iter()
        .flat_map(Spline::points)
        .flatten()
        .fold(0.0f64, |m, v| m.max(v.abs()));
    if !size.is_finite() {
        return Err(refuse(
            "overflow",
            "a control point is beyond the largest number".to_owned(),
            "a smaller patch",
        ));
    }

    let mut doc = Document::default();
    let (shape, context, origin) = product(&mut doc, options, unit);
    let mut shells = Vec::with_capacity(faces.len());
    for (face, spline) in faces.iter().zip(&splines) {
        let advanced = write_face(&mut doc, face, spline, SAME * size);
        let shell = doc.add(&format!(
            "OPEN_SHELL({},({}))",
            part21::text(&face.name),
            part21::id(advanced)
        ));
        shells.push(shell);
    }
    let model = doc.add(&format!(
        "SHELL_BASED_SURFACE_MODEL('',{})",
        part21::ids(&shells)
    ));
    let items = part21::ids(&[model, origin]);
    let representation = doc.add(&format!(
        "MANIFOLD_SURFACE_SHAPE_REPRESENTATION('',{items},{})",
        part21::id(context)
    ));
    doc.add(&format!(
        "SHAPE_DEFINITION_REPRESENTATION({},{})",
        part21::id(shape),
        part21::id(representation)
    ));
    Ok(doc.file(&options.name, options.time.as_deref().unwrap_or(EPOCH)))
}

/// What every file of a part says: the product, its units, and where the origin is. Gives back the
/// shape, the context and the origin.
fn product(doc: &mut Document, options: &StepOptions, unit: &str) -> (usize, usize, usize) {
    let id = part21::id;
    let name = part21::text(if options.name.is_empty() {
        "surface"
    } else {
        &options.name
    });
    let app = doc.add("APPLICATION_CONTEXT('managed model based 3d engineering')");
    let standard = "'international standard','ap242_managed_model_based_3d_engineering',2014";
    doc.add(&format!(
        "APPLICATION_PROTOCOL_DEFINITION({standard},{})",
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
    let shape = doc.add(&format!(
        "PRODUCT_DEFINITION_SHAPE('','',{})",
        id(definition)
    ));

    let si = |doc: &mut Document, prefix: &str| {
        doc.add(&format!(
            "(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT({prefix},.METRE.))"
        ))
    };
    let length = match unit {
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
    };
    let angle = doc.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))");
    let solid = doc.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())");
    let accuracy = format!(
        "LENGTH_MEASURE({}),{},'distance_accuracy_value',''",
        part21::real(UNCERTAINTY),
        id(length)
    );
    let accuracy = doc.add(&format!("UNCERTAINTY_MEASURE_WITH_UNIT({accuracy})"));
    let context = doc.add(&format!(
        "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({}))GLOBAL_UNIT_ASSIGNED_CONTEXT({})\
         REPRESENTATION_CONTEXT('','3D'))",
        id(accuracy),
        part21::ids(&[length, angle, solid])
    ));
    let origin = doc.placement(&Placement {
        origin: [0.0; 3],
        z: [0.0, 0.0, 1.0],
        x: [1.0, 0.0, 0.0],
    });
    (shape, context, origin)
}

/// A face with its surface, borders and corners.
fn write_face(doc: &mut Document, face: &StepFace, spline: &Spline, same: f64) -> usize {
    let (m, n) = spline.last();
    // Around the face, its outside above: the control points of each border, and whether they run
    // along the loop.
    let sides: [(Vec<[f64; 4]>, bool, bool); 4] = [
        ((0..=m).map(|i| spline.at(i, 0)).collect(), true, true),
        ((0..=n).map(|j| spline.at(m, j)).collect(), false, true),
        ((0..=m).map(|i| spline.at(i, n)).collect(), true, false),
        ((0..=n).map(|j| spline.at(0, j)).collect(), false, false),
    ];
    let mut vertices: Vec<(Point3, usize)> = Vec::new();
    let mut edges = Vec::new();
    for (control, along_u, forward) in &sides {
        let points: Vec<Point3> = control.iter().map(spline::affine).collect();
        let (first, last) = (points[0], points[points.len() - 1]);
        // A side may be a point, such as the pole of a sphere: no edge then.
        if points
            .iter()
            .all(|p| distance_squared(*p, first) <= same * same)
        {
            continue;
        }
        let [start, end] = [first, last].map(|p| {
            match vertices
                .iter()
                .find(|(q, _)| distance_squared(*q, p) <= same * same)
            {
                Some((_, vertex)) => *vertex,
                None => {
                    let at = doc.point(p);
                    let vertex = doc.add(&format!("VERTEX_POINT('',{})", part21::id(at)));
                    vertices.push((p, vertex));
                    vertex
                }
            }
        });
        let curve = doc.curve(control, spline.knots(*along_u));
        let ends = format!(
            "{},{},{}",
            part21::id(start),
            part21::id(end),
            part21::id(curve)
        );
        let edge = doc.add(&format!("EDGE_CURVE('',{ends},.T.)"));
        edges.push(doc.add(&format!(
            "ORIENTED_EDGE('',*,*,{},{})",
            part21::id(edge),
            part21::flag(*forward)
        )));
    }
    let (surface, agrees) = match face.surface.and_then(|s| placement::place(&s, &face.patch)) {
        Some(placed) => {
            let axes = part21::id(doc.placement(&placed.axes));
            let numbers: String = placed
                .numbers
                .iter()
                .map(|v| format!(",{}", part21::real(*v)))
                .collect();
            (
                doc.add(&format!("{}('',{axes}{numbers})", placed.entity)),
                placed.agrees,
            )
        }
        None => (doc.surface(spline), true),
    };
    let around = doc.add(&format!("EDGE_LOOP('',{})", part21::ids(&edges)));
    let bound = doc.add(&format!("FACE_OUTER_BOUND('',{},.T.)", part21::id(around)));
    let (name, agrees) = (part21::text(&face.name), part21::flag(agrees));
    doc.add(&format!(
        "ADVANCED_FACE({name},({}),{},{agrees})",
        part21::id(bound),
        part21::id(surface)
    ))
}
