//! Solids of exact faces as JSON: the native, lossless form of a boundary representation.
//!
//! ```json
//! {"schema": 1, "kind": "brep", "name": "part", "unit": "mm",
//!  "properties": {"volume": V, "area": A, "centroid": [x, y, z], "gap": g},
//!  "vertices": [[x, y, z], …],
//!  "edges": [{"ends": [i, j], "curve": "line"},
//!            {"ends": [i, j], "curve": "circle", "axes": F, "radius": r},
//!            {"ends": [i, j], "curve": "ellipse", "axes": F, "radii": [a, b]},
//!            {"ends": [i, j], "curve": "spline", "degree": p, "knots": [t, …],
//!             "multiplicities": [n, …], "control": [[x, y, z], …]}, …],
//!  "parts": ["name", …],
//!  "faces": [{"part": k, "chart": n, "outward": true, "surface": "plane", "axes": F,
//!             "loops": [[[edge, forward], …], …]}, …],
//!  "solids": [{"outer": [face, …], "voids": [[face, …], …]}, …]}
//! ```
//!
//! F is a frame, `{"origin": [x, y, z], "z": [x, y, z], "x": [x, y, z]}` with directions of length
//! 1 at right angles. Surfaces are `plane`; `cylinder` and `sphere` with `radius`; `cone` with
//! `radius` and `half_angle` (radians); `torus` with `major` and `minor`; `ellipsoid` with `half`
//! (three half axes) and `sphere` (the frame of its longitudes); `revolved`, a B-spline about the z
//! of its frame, with `degree`, `knots` (each as often as it counts) and `control` (distances from
//! the axis and heights); and `spline`, a graph over the plane of its frame, with `degree`, `knots`
//! (of x and of y) and `heights`. [`Brep`] says what each means. Numbers of vertices, edges, parts
//! and faces are from 0. Unknown keys are ignored. `unit` is null where the unit is not known.
//!
//! Reading checks all that [`Brep::validate`] does: what is read can be worked on.

use crate::SolidProperties;
use isoform_geom::Point3;
use isoform_geom::brep::{
    Axes, BSpline, Body, Brep, Coedge, Curve, Edge, Ellipsoid, Face, Graph, Revolved, Surface,
};
use serde_json::{Map, Value, json};
use std::sync::Arc;

/// Value of the key `kind`.
const SOLID_KIND: &str = "brep";
/// Version of the form. Files with a larger one are refused, as their meaning may differ.
const SCHEMA_VERSION: u64 = 1;

/// Solids with the properties stated in their file.
#[derive(Clone, Debug, PartialEq)]
pub struct SolidFile {
    /// Boundary representation of the solids.
    pub brep: Brep,
    /// Name; may be empty.
    pub name: String,
    /// Unit of length; `None` if unknown.
    pub unit: Option<String>,
    /// Stated volume, area, centroid and gap; not verified when read.
    pub properties: SolidProperties,
}

/// Reason why solids cannot be read from a file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{at}: {problem}")]
pub struct SolidFileError {
    /// Position: a key with indices from 0, or an instance of a STEP file.
    pub at: String,
    /// Description of the problem.
    pub problem: String,
}

type Result<T> = std::result::Result<T, SolidFileError>;

pub(crate) fn wrong(at: impl Into<String>, problem: impl Into<String>) -> SolidFileError {
    SolidFileError {
        at: at.into(),
        problem: problem.into(),
    }
}

/// Returns true if a JSON document contains solids.
pub fn is_solid_file(json: &Value) -> bool {
    json.get("kind").and_then(Value::as_str) == Some(SOLID_KIND)
}

/// Writes a file of solids. Equal solids give equal bytes, and reading returns identical doubles.
///
/// ```
/// use isoform_geom::brep::{Axes, Body, Brep, Coedge, Curve, Edge, Face, Surface};
/// use isoform_io::{SolidFile, SolidProperties, read_solids, write_solids};
/// // A ball of two halves.
/// let axes = Axes::along([0.0; 3], [0.0, 0.0, 1.0]);
/// let half = |forward: bool| Face {
///     surface: Surface::Sphere(axes, 1.0),
///     agrees: true,
///     part: 0,
///     chart: u32::from(!forward),
///     loops: vec![vec![Coedge { edge: 0, forward }]],
/// };
/// let brep = Brep {
///     vertices: vec![axes.x],
///     edges: vec![Edge { curve: Curve::Circle(axes, 1.0), ends: [0, 0] }],
///     faces: vec![half(true), half(false)],
///     parts: vec!["ball".to_owned()],
///     solids: vec![Body { outer: vec![0, 1], voids: vec![] }],
/// };
/// let properties = SolidProperties { volume: 4.19, area: 12.57, centroid: [0.0; 3], gap: 0.0 };
/// let file = SolidFile { brep, name: "ball".into(), unit: Some("mm".into()), properties };
/// let bytes = write_solids(&file);
/// assert_eq!(read_solids(&serde_json::from_slice(&bytes)?)?, file);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_solids(file: &SolidFile) -> Vec<u8> {
    let SolidFile {
        brep,
        name,
        unit,
        properties,
    } = file;
    let edges: Vec<Value> = brep.edges.iter().map(edge_json).collect();
    let faces: Vec<Value> = brep.faces.iter().map(face_json).collect();
    let solids = brep.solids.iter();
    let solids: Vec<Value> = solids
        .map(|s| json!({"outer": s.outer, "voids": s.voids}))
        .collect();
    let mut bytes = json!({
        "schema": SCHEMA_VERSION,
        "kind": SOLID_KIND,
        "name": name,
        "unit": unit,
        "properties": {
            "volume": properties.volume,
            "area": properties.area,
            "centroid": properties.centroid,
            "gap": properties.gap,
        },
        "vertices": brep.vertices,
        "edges": edges,
        "parts": brep.parts,
        "faces": faces,
        "solids": solids,
    })
    .to_string()
    .into_bytes();
    bytes.push(b'\n');
    bytes
}

fn axes_json(axes: &Axes) -> Value {
    json!({"origin": axes.origin, "z": axes.z, "x": axes.x})
}

fn edge_json(edge: &Edge) -> Value {
    let mut json = json!({"ends": edge.ends, "curve": edge.curve.name()});
    let more = match &edge.curve {
        Curve::Line => json!({}),
        Curve::Circle(axes, radius) => json!({"axes": axes_json(axes), "radius": radius}),
        Curve::Ellipse(axes, a, b) => json!({"axes": axes_json(axes), "radii": [a, b]}),
        Curve::BSpline(spline) => json!({
            "degree": spline.degree,
            "knots": spline.knots,
            "multiplicities": spline.multiplicities,
            "control": spline.control,
        }),
    };
    join(&mut json, more);
    json
}

fn face_json(face: &Face) -> Value {
    let mut json = json!({
        "part": face.part,
        "chart": face.chart,
        "outward": face.agrees,
        "surface": face.surface.name(),
        "axes": axes_json(face.surface.axes()),
    });
    let more = match &face.surface {
        Surface::Plane(_) => json!({}),
        Surface::Cylinder(_, radius) | Surface::Sphere(_, radius) => json!({"radius": radius}),
        Surface::Cone(_, radius, angle) => json!({"radius": radius, "half_angle": angle}),
        Surface::Torus(_, major, minor) => json!({"major": major, "minor": minor}),
        Surface::Ellipsoid(ball) => {
            json!({"half": ball.half, "sphere": axes_json(&ball.sphere)})
        }
        Surface::Revolved(turned) => json!({
            "degree": turned.degree,
            "knots": turned.knots,
            "control": turned.control,
        }),
        Surface::Graph(graph) => json!({
            "degree": graph.degree,
            "knots": graph.knots,
            "heights": graph.heights,
        }),
    };
    join(&mut json, more);
    let coedge = |c: &Coedge| json!([c.edge, c.forward]);
    let around = |l: &Vec<Coedge>| l.iter().map(coedge).collect::<Vec<_>>();
    json["loops"] = face.loops.iter().map(around).collect::<Vec<_>>().into();
    json
}

/// Adds the keys of one object to another.
fn join(json: &mut Value, more: Value) {
    if let (Some(json), Value::Object(more)) = (json.as_object_mut(), more) {
        json.extend(more);
    }
}

/// Reads the solids of a document.
///
/// # Errors
/// [`SolidFileError`] if a key is missing or has a wrong value, or if the solids are inconsistent
/// ([`Brep::validate`]).
pub fn read_solids(json: &Value) -> Result<SolidFile> {
    let Some(top) = json.as_object().filter(|_| is_solid_file(json)) else {
        return Err(wrong("kind", "brep is expected"));
    };
    let top = KeyedObject::new(top, "");
    let schema: u64 = top.whole("schema")?;
    if schema != SCHEMA_VERSION {
        let problem = format!("version {schema} is not known here, only {SCHEMA_VERSION}");
        return Err(wrong("schema", problem));
    }
    let stated = top.inner("properties")?;
    let file = SolidFile {
        name: top.text("name")?.to_owned(),
        unit: match top.get("unit")? {
            Value::Null => None,
            _ => Some(top.text("unit")?.to_owned()),
        },
        properties: SolidProperties {
            volume: stated.number("volume")?,
            area: stated.number("area")?,
            centroid: stated.point("centroid")?,
            gap: stated.number("gap")?,
        },
        brep: Brep {
            vertices: top.points("vertices")?,
            edges: top.each("edges", edge)?,
            faces: top.each("faces", face)?,
            parts: top.texts("parts")?,
            solids: top.each("solids", body)?,
        },
    };
    checked(file)
}

/// Returns a file whose solids are consistent and whose numbers are finite; an error otherwise.
pub(crate) fn checked(file: SolidFile) -> Result<SolidFile> {
    let SolidProperties {
        volume,
        area,
        centroid: [x, y, z],
        gap,
    } = file.properties;
    if [volume, area, gap, x, y, z].iter().any(|v| !v.is_finite()) {
        return Err(wrong("properties", "a number is not finite"));
    }
    let defect = file.brep.validate().err();
    match defect {
        None => Ok(file),
        Some(defect) => Err(wrong(defect.at, defect.problem)),
    }
}

fn edge(keys: &KeyedObject) -> Result<Edge> {
    let curve = match keys.text("curve")? {
        "line" => Curve::Line,
        "circle" => Curve::Circle(keys.axes("axes")?, keys.number("radius")?),
        "ellipse" => {
            let [a, b] = keys.several("radii")?;
            Curve::Ellipse(keys.axes("axes")?, a, b)
        }
        "spline" => Curve::BSpline(BSpline {
            degree: keys.whole("degree")?,
            knots: keys.numbers("knots")?,
            multiplicities: keys.wholes("multiplicities")?,
            control: keys.points("control")?,
        }),
        _ => return Err(keys.wrong("curve", "line, circle, ellipse or spline is expected")),
    };
    let ends = keys.wholes("ends")?;
    let ends = ends.try_into();
    let ends = ends.map_err(|_| keys.wrong("ends", "two numbers are expected"))?;
    Ok(Edge { curve, ends })
}

fn face(keys: &KeyedObject) -> Result<Face> {
    let loops = keys.list("loops")?.iter();
    let around = |l: &Value| l.as_array()?.iter().map(coedge).collect();
    let loops: Option<Vec<Vec<Coedge>>> = loops.map(around).collect();
    let outward = keys.get("outward")?.as_bool();
    Ok(Face {
        surface: surface(keys)?,
        agrees: outward.ok_or_else(|| keys.wrong("outward", "true or false is expected"))?,
        part: keys.whole("part")?,
        chart: keys.whole("chart")?,
        loops: loops.ok_or_else(|| {
            keys.wrong("loops", "lists of pairs are expected: edge, true or false")
        })?,
    })
}

fn coedge(pair: &Value) -> Option<Coedge> {
    let [edge, forward] = pair.as_array()?.as_slice() else {
        return None;
    };
    Some(Coedge {
        edge: u32::try_from(edge.as_u64()?).ok()?,
        forward: forward.as_bool()?,
    })
}

fn surface(keys: &KeyedObject) -> Result<Surface> {
    let axes = keys.axes("axes")?;
    Ok(match keys.text("surface")? {
        "plane" => Surface::Plane(axes),
        "cylinder" => Surface::Cylinder(axes, keys.number("radius")?),
        "cone" => Surface::Cone(axes, keys.number("radius")?, keys.number("half_angle")?),
        "sphere" => Surface::Sphere(axes, keys.number("radius")?),
        "torus" => Surface::Torus(axes, keys.number("major")?, keys.number("minor")?),
        "ellipsoid" => Surface::Ellipsoid(Ellipsoid {
            axes,
            half: keys.several("half")?,
            sphere: keys.axes("sphere")?,
        }),
        "revolved" => revolved(axes, keys)?,
        "spline" => {
            let knots = keys.list("knots")?.iter().map(numbers);
            let knots: Option<Vec<Vec<f64>>> = knots.collect();
            let knots = knots.and_then(|k| <[Vec<f64>; 2]>::try_from(k).ok());
            Surface::Graph(Arc::new(Graph {
                axes,
                degree: keys.whole("degree")?,
                knots: knots
                    .ok_or_else(|| keys.wrong("knots", "two lists of numbers are expected"))?,
                heights: keys.numbers("heights")?,
            }))
        }
        _ => return Err(keys.wrong("surface", "plane, cylinder, … or spline is expected")),
    })
}

fn revolved(axes: Axes, keys: &KeyedObject) -> Result<Surface> {
    let control = keys.list("control")?.iter().map(numbers);
    let pair = |c: Option<Vec<f64>>| <[f64; 2]>::try_from(c?).ok();
    let control: Option<Vec<[f64; 2]>> = control.map(pair).collect();
    Ok(Surface::Revolved(Arc::new(Revolved {
        axes,
        degree: keys.whole("degree")?,
        knots: keys.numbers("knots")?,
        control: control.ok_or_else(|| keys.wrong("control", "pairs of numbers are expected"))?,
    })))
}

fn body(keys: &KeyedObject) -> Result<Body> {
    let voids = keys.list("voids")?.iter().map(wholes);
    let voids: Option<Vec<Vec<u32>>> = voids.collect();
    Ok(Body {
        outer: keys.wholes("outer")?,
        voids: voids.ok_or_else(|| keys.wrong("voids", "lists of whole numbers are expected"))?,
    })
}

/// JSON object with its position in the document.
struct KeyedObject<'j> {
    object: &'j Map<String, Value>,
    at: String,
}

impl<'j> KeyedObject<'j> {
    fn new(object: &'j Map<String, Value>, at: impl Into<String>) -> Self {
        Self {
            object,
            at: at.into(),
        }
    }
    fn wrong(&self, key: &str, problem: &str) -> SolidFileError {
        let at = if self.at.is_empty() {
            key.to_owned()
        } else {
            format!("{}, {key}", self.at)
        };
        wrong(at, problem)
    }
    fn get(&self, key: &str) -> Result<&'j Value> {
        let value = self.object.get(key);
        value.ok_or_else(|| self.wrong(key, "it is missing"))
    }
    /// Converts a value by `as_it`; an error states the expected kind if the conversion fails.
    fn read<T>(
        &self,
        key: &str,
        as_it: impl FnOnce(&'j Value) -> Option<T>,
        expected: &str,
    ) -> Result<T> {
        as_it(self.get(key)?).ok_or_else(|| self.wrong(key, expected))
    }
    fn inner(&self, key: &str) -> Result<Self> {
        let object = self.read(key, Value::as_object, "an object is expected")?;
        Ok(Self::new(object, key))
    }
    fn list(&self, key: &str) -> Result<&'j [Value]> {
        let list = self.read(key, Value::as_array, "a list is expected")?;
        Ok(list)
    }
    /// Reads each object of a list.
    fn each<T>(&self, key: &str, read: impl Fn(&KeyedObject) -> Result<T>) -> Result<Vec<T>> {
        let list = self.list(key)?.iter().enumerate();
        list.map(|(i, value)| {
            let at = format!("{key} {i}");
            let object = value.as_object();
            let object = object.ok_or_else(|| wrong(&at, "an object is expected"))?;
            read(&KeyedObject::new(object, at))
        })
        .collect()
    }
    fn text(&self, key: &str) -> Result<&'j str> {
        self.read(key, Value::as_str, "a text is expected")
    }
    fn texts(&self, key: &str) -> Result<Vec<String>> {
        let texts = |v: &Value| {
            let list = v.as_array()?.iter();
            list.map(|v| v.as_str().map(str::to_owned)).collect()
        };
        self.read(key, texts, "a list of texts is expected")
    }
    fn number(&self, key: &str) -> Result<f64> {
        self.read(key, Value::as_f64, "a number is expected")
    }
    fn numbers(&self, key: &str) -> Result<Vec<f64>> {
        self.read(key, numbers, "a list of numbers is expected")
    }
    fn several<const N: usize>(&self, key: &str) -> Result<[f64; N]> {
        let several = |v: &Value| numbers(v)?.try_into().ok();
        self.read(key, several, &format!("{N} numbers are expected"))
    }
    fn point(&self, key: &str) -> Result<Point3> {
        self.several(key)
    }
    fn points(&self, key: &str) -> Result<Vec<Point3>> {
        let point = |v: &Value| numbers(v)?.try_into().ok();
        let points = |v: &Value| v.as_array()?.iter().map(point).collect();
        self.read(key, points, "a list of points is expected")
    }
    fn whole<T: TryFrom<u64>>(&self, key: &str) -> Result<T> {
        let whole = |v: &Value| T::try_from(v.as_u64()?).ok();
        self.read(key, whole, "a whole number is expected")
    }
    fn wholes<T: TryFrom<u64>>(&self, key: &str) -> Result<Vec<T>> {
        self.read(key, wholes, "a list of whole numbers is expected")
    }
    fn axes(&self, key: &str) -> Result<Axes> {
        let object = self.read(key, Value::as_object, "a frame is expected")?;
        let keys = Self::new(object, self.wrong(key, "").at);
        Ok(Axes {
            origin: keys.point("origin")?,
            z: keys.point("z")?,
            x: keys.point("x")?,
        })
    }
}

fn numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(Value::as_f64).collect()
}

fn wholes<T: TryFrom<u64>>(value: &Value) -> Option<Vec<T>> {
    let whole = |v: &Value| T::try_from(v.as_u64()?).ok();
    value.as_array()?.iter().map(whole).collect()
}
