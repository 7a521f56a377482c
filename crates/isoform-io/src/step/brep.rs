//! Solids: closed shells of faces on exact surfaces that share edges and vertices.
//!
//! Parameter curves are not written: readers compute them up to rounding, and inaccurate ones harm.

use super::part21::{StepDocument, flag, id, ids, integers, real, reals, text};
use super::placement::AxisPlacement;
use super::{DEFAULT_TIME, StepOptions, StepProduct, unit};
use crate::{WriteError, write_atomic};
use isoform_geom::Point3;
use isoform_geom::brep::{
    Axes, BSpline, Body, Brep, Coedge, Curve, Ellipsoid, Face, Graph, Surface,
};
use std::io::Write;
use std::path::Path;

/// Cyclic colours of parts: red, green and blue.
const PART_COLORS: [Point3; 6] = [
    [0.62, 0.7, 0.8],
    [0.85, 0.65, 0.45],
    [0.55, 0.75, 0.6],
    [0.8, 0.75, 0.5],
    [0.7, 0.6, 0.75],
    [0.75, 0.55, 0.55],
];

/// Properties of solids stated in a file for comparison by the reader.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolidProperties {
    /// Volume of all solids, in cubic units of length.
    pub volume: f64,
    /// Area of their surface, in square units of length.
    pub area: f64,
    /// Centroid of the volume.
    pub centroid: Point3,
    /// Maximum distance of edges from their faces, in units of length; the stated accuracy follows
    /// from it.
    pub gap: f64,
}

/// Options of writing solids.
#[derive(Clone, Debug, Default)]
pub struct SolidOptions {
    /// Unit, name and time.
    pub step: StepOptions,
    /// True for AP214 instead of AP242.
    pub ap214: bool,
}

/// Returns the text of a STEP file with the solids of a boundary representation with closed shells.
///
/// # Errors
/// If the unit is unknown, solids are missing, or an edge does not separate two faces.
pub fn step_solids(
    brep: &Brep,
    properties: &SolidProperties,
    options: &SolidOptions,
) -> Result<String, WriteError> {
    compose(brep, properties, options, "output")
}

/// Writes a STEP file of solids atomically (see [`write_atomic`]).
///
/// # Errors
/// Errors of [`step_solids`] and of the file system.
pub fn write_step_solids(
    brep: &Brep,
    properties: &SolidProperties,
    path: &Path,
    options: &SolidOptions,
) -> Result<(), WriteError> {
    let text = compose(brep, properties, options, &path.display().to_string())?;
    write_atomic(path, |out: &mut dyn Write| out.write_all(text.as_bytes()))
}

fn compose(
    brep: &Brep,
    properties: &SolidProperties,
    options: &SolidOptions,
    file: &str,
) -> Result<String, WriteError> {
    let refuse = |code, why: String, hint| WriteError {
        code,
        what: "cannot write STEP",
        file: file.to_owned(),
        why,
        hint,
    };
    let unit = unit(&options.step).map_err(|r| refuse(r.code, r.why, r.hint))?;
    if brep.solids.is_empty() {
        let why = "there is no solid".to_owned();
        return Err(refuse("empty", why, "a file of solids needs one"));
    }
    let open = open_edges(brep);
    if open > 0 {
        let why = format!("{open} edges are not between two faces");
        return Err(refuse("open", why, "a closed shell is needed"));
    }
    let mut doc = StepDocument::default();
    let name = text(if options.step.name.is_empty() {
        "solid"
    } else {
        &options.step.name
    });
    let schema = if options.ap214 { AP214 } else { AP242 };
    // Readers merge points within the stated accuracy.
    let accuracy = (10.0 * properties.gap).max(super::LENGTH_UNCERTAINTY);
    let product = StepProduct::new(&mut doc, &name, unit, schema.protocol, accuracy);
    let mut writer = SolidWriter::new(doc, brep);
    writer.solids(&product);
    writer.properties(properties, &product);
    let time = options.step.time.as_deref().unwrap_or(DEFAULT_TIME);
    Ok(writer.doc.file_of(&options.step.name, time, schema.name))
}

/// Schema: its name in the header, and its application protocol with the year.
struct StepSchema {
    name: &'static str,
    protocol: &'static str,
}

const AP242: StepSchema = StepSchema {
    name: super::part21::AP242,
    protocol: super::AP242_PROTOCOL,
};
const AP214: StepSchema = StepSchema {
    name: "AUTOMOTIVE_DESIGN { 1 0 10303 214 3 1 1 }",
    protocol: "'international standard','automotive_design',2010",
};

/// Splits a knot vector into distinct knots and their multiplicities.
fn distinct(knots: &[f64]) -> (Vec<f64>, Vec<usize>) {
    let each = knots.chunk_by(|a, b| a == b);
    each.map(|same| (same[0], same.len())).unzip()
}

/// Counts the edges that are not used by two loops in opposite directions.
fn open_edges(brep: &Brep) -> usize {
    let mut uses = vec![[0usize; 2]; brep.edges.len()];
    for coedge in brep.faces.iter().flat_map(|f| f.loops.iter().flatten()) {
        uses[coedge.edge as usize][usize::from(coedge.forward)] += 1;
    }
    uses.iter().filter(|u| **u != [1, 1]).count()
}

struct SolidWriter<'a> {
    doc: StepDocument,
    brep: &'a Brep,
    /// Instances of the edges.
    edges: Vec<usize>,
    /// Instances of the faces.
    faces: Vec<usize>,
}

impl<'a> SolidWriter<'a> {
    /// Adds vertices, edges and faces.
    fn new(mut doc: StepDocument, brep: &'a Brep) -> Self {
        let vertices: Vec<usize> = brep
            .vertices
            .iter()
            .map(|p| {
                let at = doc.point(*p);
                doc.add(&format!("VERTEX_POINT('',{})", id(at)))
            })
            .collect();
        let mut writer = Self {
            doc,
            brep,
            edges: Vec::new(),
            faces: Vec::new(),
        };
        for (e, edge) in brep.edges.iter().enumerate() {
            let curve = writer.curve(e as u32, &edge.curve);
            let [start, end] = edge.ends.map(|v| id(vertices[v as usize]));
            let edge = format!("EDGE_CURVE('',{start},{end},{},.T.)", id(curve));
            let edge = writer.doc.add(&edge);
            writer.edges.push(edge);
        }
        for (f, face) in brep.faces.iter().enumerate() {
            let face = writer.face(&brep.face_name(f), face);
            writer.faces.push(face);
        }
        writer
    }

    fn axes(&mut self, axes: &Axes) -> String {
        id(self.doc.placement(&AxisPlacement {
            origin: axes.origin,
            z: axes.z,
            x: axes.x,
        }))
    }

    fn curve(&mut self, edge: u32, curve: &Curve) -> usize {
        let entity = match curve {
            Curve::Line => {
                let [a, b] = self.brep.ends(edge);
                return self.doc.line(a, b);
            }
            Curve::Circle(axes, radius) => {
                format!("CIRCLE('',{},{})", self.axes(axes), real(*radius))
            }
            Curve::Ellipse(axes, a, b) => {
                format!("ELLIPSE('',{},{},{})", self.axes(axes), real(*a), real(*b))
            }
            Curve::BSpline(spline) => return self.spline(spline),
        };
        self.doc.add(&entity)
    }

    fn spline(&mut self, spline: &BSpline) -> usize {
        let points = spline.control.iter();
        let points: Vec<usize> = points.map(|p| self.doc.point(*p)).collect();
        self.doc.add(&format!(
            "B_SPLINE_CURVE_WITH_KNOTS('',{},{},.UNSPECIFIED.,.F.,.F.,{},{},.UNSPECIFIED.)",
            spline.degree,
            ids(&points),
            integers(&spline.multiplicities),
            reals(&spline.knots)
        ))
    }

    fn surface(&mut self, surface: &Surface) -> usize {
        let entity = match surface {
            Surface::Plane(axes) => format!("PLANE('',{})", self.axes(axes)),
            Surface::Cylinder(axes, r) => {
                format!("CYLINDRICAL_SURFACE('',{},{})", self.axes(axes), real(*r))
            }
            Surface::Cone(axes, r, angle) => {
                let (axes, r, angle) = (self.axes(axes), real(*r), real(*angle));
                format!("CONICAL_SURFACE('',{axes},{r},{angle})")
            }
            Surface::Sphere(axes, r) => {
                format!("SPHERICAL_SURFACE('',{},{})", self.axes(axes), real(*r))
            }
            Surface::Torus(axes, major, minor) => {
                let (axes, major, minor) = (self.axes(axes), real(*major), real(*minor));
                format!("TOROIDAL_SURFACE('',{axes},{major},{minor})")
            }
            Surface::Revolved(turned) => {
                let (values, counts) = distinct(&turned.knots);
                let profile = self.spline(&BSpline {
                    degree: turned.degree,
                    knots: values,
                    multiplicities: counts,
                    control: turned.control_points(),
                });
                let axis = self.doc.axis(turned.axes.origin, turned.axes.z);
                format!("SURFACE_OF_REVOLUTION('',{},{})", id(profile), id(axis))
            }
            Surface::Ellipsoid(ball) => return self.ellipsoid(ball),
            Surface::Graph(graph) => return self.graph(graph),
        };
        self.doc.add(&entity)
    }

    /// Adds the B-spline of a height graph.
    fn graph(&mut self, graph: &Graph) -> usize {
        let points = self.grid(&graph.control(), graph.columns());
        let degree = graph.degree;
        let [(u, u_counts), (v, v_counts)] = [0, 1].map(|k| distinct(&graph.knots[k]));
        self.doc.add(&format!(
            "B_SPLINE_SURFACE_WITH_KNOTS('',{degree},{degree},{points},.UNSPECIFIED.,.F.,.F.,.F.,\
             {},{},{},{},.UNSPECIFIED.)",
            integers(&u_counts),
            integers(&v_counts),
            reals(&u),
            reals(&v)
        ))
    }

    /// Adds the chart of an ellipsoid around the x axis of its sphere as a rational biquadratic
    /// patch.
    fn ellipsoid(&mut self, ball: &Ellipsoid) -> usize {
        let (control, weights) = ball.chart(Ellipsoid::CHART_HALF_WIDTH);
        let points = self.grid(control.as_flattened(), 3);
        let weights: Vec<String> = weights.iter().map(|row| reals(row)).collect();
        self.doc.add(&format!(
            "(BOUNDED_SURFACE()B_SPLINE_SURFACE(2,2,{points},.UNSPECIFIED.,.F.,.F.,.F.)\
             B_SPLINE_SURFACE_WITH_KNOTS((3,3),(3,3),(0.,1.),(0.,1.),.UNSPECIFIED.)\
             GEOMETRIC_REPRESENTATION_ITEM()RATIONAL_B_SPLINE_SURFACE(({}))\
             REPRESENTATION_ITEM('')SURFACE())",
            weights.join(",")
        ))
    }

    /// Adds control points, and lists them row by row.
    fn grid(&mut self, points: &[Point3], columns: usize) -> String {
        let rows: Vec<String> = points
            .chunks(columns)
            .map(|row| {
                let row: Vec<usize> = row.iter().map(|p| self.doc.point(*p)).collect();
                ids(&row)
            })
            .collect();
        format!("({})", rows.join(","))
    }

    fn face(&mut self, name: &str, face: &Face) -> usize {
        let mut bounds = Vec::with_capacity(face.loops.len());
        for (i, around) in face.loops.iter().enumerate() {
            let coedges: Vec<usize> = around.iter().map(|c| self.coedge(c)).collect();
            let around = self.doc.add(&format!("EDGE_LOOP('',{})", ids(&coedges)));
            let kind = if i == 0 {
                "FACE_OUTER_BOUND"
            } else {
                "FACE_BOUND"
            };
            bounds.push(self.doc.add(&format!("{kind}('',{},.T.)", id(around))));
        }
        let surface = self.surface(&face.surface);
        self.doc.add(&format!(
            "ADVANCED_FACE({},{},{},{})",
            text(name),
            ids(&bounds),
            id(surface),
            flag(face.agrees)
        ))
    }

    fn coedge(&mut self, coedge: &Coedge) -> usize {
        let edge = id(self.edges[coedge.edge as usize]);
        let sense = flag(coedge.forward);
        self.doc
            .add(&format!("ORIENTED_EDGE('',*,*,{edge},{sense})"))
    }

    fn shell(&mut self, faces: &[u32]) -> usize {
        let faces: Vec<usize> = faces.iter().map(|f| self.faces[*f as usize]).collect();
        self.doc.add(&format!("CLOSED_SHELL('',{})", ids(&faces)))
    }

    /// Adds the solids, their representation and the colours of the faces.
    fn solids(&mut self, product: &StepProduct) {
        let count = self.brep.solids.len();
        let mut items = vec![product.origin];
        for (i, body) in self.brep.solids.iter().enumerate() {
            let name = if count == 1 {
                "solid".to_owned()
            } else {
                format!("solid {}", i + 1)
            };
            items.push(self.solid(&name, body));
        }
        let context = id(product.context);
        let representation = self.doc.add(&format!(
            "ADVANCED_BREP_SHAPE_REPRESENTATION('',{},{context})",
            ids(&items)
        ));
        self.doc.add(&format!(
            "SHAPE_DEFINITION_REPRESENTATION({},{})",
            id(product.shape),
            id(representation)
        ));
        self.colors(&context);
    }

    fn solid(&mut self, name: &str, body: &Body) -> usize {
        let outer = id(self.shell(&body.outer));
        let name = text(name);
        if body.voids.is_empty() {
            return self
                .doc
                .add(&format!("MANIFOLD_SOLID_BREP({name},{outer})"));
        }
        // The faces of a void point out of the material, into the void; the shell keeps its
        // orientation.
        let voids: Vec<usize> = body
            .voids
            .iter()
            .map(|faces| {
                let shell = id(self.shell(faces));
                self.doc
                    .add(&format!("ORIENTED_CLOSED_SHELL('',*,{shell},.T.)"))
            })
            .collect();
        self.doc
            .add(&format!("BREP_WITH_VOIDS({name},{outer},{})", ids(&voids)))
    }

    /// Adds colours by part. The intermediate PRESENTATION_STYLE_ASSIGNMENT, which newer practice
    /// omits and one reader rejects, is not written.
    fn colors(&mut self, context: &str) {
        let parts = self.brep.parts.len();
        let styles: Vec<usize> = PART_COLORS
            .iter()
            .take(parts)
            .map(|color| self.style(*color))
            .collect();
        let mut items = Vec::with_capacity(self.faces.len());
        for (f, face) in self.brep.faces.iter().enumerate() {
            let style = id(styles[face.part as usize % PART_COLORS.len()]);
            let item = id(self.faces[f]);
            items.push(self.doc.add(&format!("STYLED_ITEM('',({style}),{item})")));
        }
        self.doc.add(&format!(
            "MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',{},{context})",
            ids(&items)
        ));
    }

    fn style(&mut self, [red, green, blue]: Point3) -> usize {
        let (red, green, blue) = (real(red), real(green), real(blue));
        let mut last = self
            .doc
            .add(&format!("COLOUR_RGB('',{red},{green},{blue})"));
        for around in [
            "FILL_AREA_STYLE_COLOUR('',?)",
            "FILL_AREA_STYLE('',(?))",
            "SURFACE_STYLE_FILL_AREA(?)",
            "SURFACE_SIDE_STYLE('',(?))",
            "SURFACE_STYLE_USAGE(.BOTH.,?)",
        ] {
            last = self.doc.add(&around.replace('?', &id(last)));
        }
        last
    }

    /// Adds geometric validation properties (CAx-IF recommended practices 4.4): volume, area,
    /// centroid.
    fn properties(&mut self, properties: &SolidProperties, product: &StepProduct) {
        let (volume, area) = (real(properties.volume), real(properties.area));
        let units = &product.context;
        let measure = |name: &str, kind: &str, value: &str, unit: usize| {
            let value = format!("{kind}_MEASURE({value})");
            format!("MEASURE_REPRESENTATION_ITEM('{name}',{value},{})", id(unit))
        };
        let length = id(product.length);
        let square = self.derived(&length, 2);
        let cube = self.derived(&length, 3);
        let volume = self
            .doc
            .add(&measure("volume measure", "VOLUME", &volume, cube));
        let area = self
            .doc
            .add(&measure("surface area measure", "AREA", &area, square));
        let at = reals(&properties.centroid);
        let center = self
            .doc
            .add(&format!("CARTESIAN_POINT('centre point',{at})"));
        for (what, item) in [
            ("volume", volume),
            ("surface area", area),
            ("centroid", center),
        ] {
            let name = "geometric validation property";
            let shape = id(product.shape);
            let property = self.doc.add(&format!(
                "PROPERTY_DEFINITION('{name}','{what} of the solids',{shape})"
            ));
            let representation = self.doc.add(&format!(
                "REPRESENTATION('{what}',({}),{})",
                id(item),
                id(*units)
            ));
            self.doc.add(&format!(
                "PROPERTY_DEFINITION_REPRESENTATION({},{})",
                id(property),
                id(representation)
            ));
        }
    }

    /// Adds a power of the unit of length.
    fn derived(&mut self, length: &str, power: u32) -> usize {
        let element = self
            .doc
            .add(&format!("DERIVED_UNIT_ELEMENT({length},{power}.)"));
        self.doc.add(&format!("DERIVED_UNIT(({}))", id(element)))
    }
}
