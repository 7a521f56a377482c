//! Reader of solids in STEP files written by this crate ([`super::step_solids`]); [`super::shape`]
//! reads those of other programs.
//!
//! Reading returns the written solids to the last digit, except the frames of splines and ellipsoids: STEP
//! cannot store them, so they are computed from the control points up to rounding. Parts come in
//! the order of their first faces.

use super::parse::{StepFile, Value, parse};
use super::records::{InstanceIndices, RecordArguments, numbers};
use super::shape::{self, ShapeFile};
use super::{LENGTH_UNCERTAINTY, SolidProperties};
use crate::solids::{SolidFile, SolidFileError, checked, wrong};
use isoform_geom::brep::{
    Axes, BSpline, Body, Brep, Coedge, Curve, Edge, Ellipsoid, Face, Graph, Revolved, Surface,
};
use isoform_geom::{Aabb, Point3, norm, sub};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Maximum deviation of recomputed control points from those of the file, relative to the size of
/// the face: some hundred rounding errors.
const ROUND_TRIP_TOLERANCE: f64 = 1e-12;

type Result<T> = std::result::Result<T, SolidFileError>;

/// Content of a STEP file.
#[derive(Clone, Debug)]
pub enum StepContent {
    /// Solids that this crate wrote.
    Own(Box<SolidFile>),
    /// Shape of any program.
    Shape(Box<ShapeFile>),
}

/// Reads a STEP file of any program; solids that this crate wrote come back without loss.
///
/// # Errors
/// [`SolidFileError`].
pub fn read_step(text: &str) -> Result<StepContent> {
    let file = parse(text)?;
    let has = |name: &str| {
        let mut records = file.instances.values().flatten();
        records.any(|r| r.name == name)
    };
    let has_solids = || has("MANIFOLD_SOLID_BREP") || has("BREP_WITH_VOIDS");
    if written_by(&file).starts_with(OWN_PROGRAM) && has_solids() {
        return solids(&file).map(|s| StepContent::Own(Box::new(s)));
    }
    shape::read(&file, text.len()).map(|s| StepContent::Shape(Box::new(s)))
}

/// Reads the solids of a STEP file written by [`step_solids`](super::step_solids).
///
/// # Errors
/// [`SolidFileError`] for any other text, including STEP files of other programs, which
/// [`read_step`] reads.
pub fn read_step_solids(text: &str) -> Result<SolidFile> {
    let file = parse(text)?;
    let by = written_by(&file);
    if !by.starts_with(OWN_PROGRAM) {
        let by = crate::input::shorten(by);
        let problem = format!("written by `{by}`; only STEP files of isoform brep can be read");
        return Err(wrong("FILE_NAME", problem));
    }
    solids(&file)
}

/// First characters of the program's name in files that this crate writes.
const OWN_PROGRAM: &str = "isoform ";

/// Returns the program that wrote a file, as its header says; empty if it does not.
pub(super) fn written_by(file: &StepFile) -> &str {
    let header = file.header.iter().find(|r| r.name == "FILE_NAME");
    match header.and_then(|r| r.arguments.get(4)) {
        Some(Value::Text(by)) => by,
        _ => "",
    }
}

/// Reads the solids of a file that this crate wrote.
fn solids(file: &StepFile) -> Result<SolidFile> {
    let mut reader = SolidReader::new(file);
    checked(SolidFile {
        brep: reader.brep()?,
        name: reader.product()?,
        unit: Some(reader.unit()?),
        properties: reader.properties()?,
    })
}

struct SolidReader<'f> {
    file: &'f StepFile,
    /// Numbers of the instances by the names of their records, ascending.
    named: BTreeMap<&'f str, Vec<u64>>,
    /// Instances already consumed.
    taken: BTreeSet<u64>,
}

impl<'f> SolidReader<'f> {
    fn new(file: &'f StepFile) -> Self {
        let mut named: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
        for (number, records) in &file.instances {
            for record in records {
                named.entry(&record.name).or_default().push(*number);
            }
        }
        let taken = BTreeSet::new();
        Self { file, named, taken }
    }

    /// Consumes an instance. Files of this crate refer to each of these once; a second reference is
    /// an error, since a hostile file could reference a long instance many times to exhaust memory.
    fn take(&mut self, number: u64) -> Result<u64> {
        if self.taken.insert(number) {
            return Ok(number);
        }
        let at = format!("#{number}");
        Err(wrong(at, "it is referred to more than once"))
    }

    /// Returns the numbers of all instances with a record of this name.
    fn all(&self, name: &str) -> &[u64] {
        self.named.get(name).map_or(&[], Vec::as_slice)
    }
    /// Returns the arguments of the record of this name in an instance.
    fn record(&self, number: u64, name: &str) -> Result<RecordArguments<'f>> {
        let records = self.file.instances.get(&number);
        let record = records.and_then(|r| r.iter().find(|r| r.name == name));
        record
            .map(|record| RecordArguments {
                number,
                line: None,
                record,
            })
            .ok_or_else(|| wrong(format!("#{number}"), format!("{name} is expected")))
    }

    fn brep(&mut self) -> Result<Brep> {
        if self.all("MANIFOLD_SOLID_BREP").is_empty() && self.all("BREP_WITH_VOIDS").is_empty() {
            let problem = "there is none: patches and faces alone are not read";
            return Err(wrong("solids", problem));
        }
        let mut brep = Brep::default();
        let mut at_vertex = InstanceIndices::new();
        let [vertices, edges, faces] =
            ["VERTEX_POINT", "EDGE_CURVE", "ADVANCED_FACE"].map(|name| self.all(name).to_vec());
        for number in vertices {
            at_vertex.insert(number, brep.vertices.len() as u32);
            let point = self.record(number, "VERTEX_POINT")?.reference(1)?;
            brep.vertices.push(self.point(point)?);
        }
        let mut at_edge = InstanceIndices::new();
        for number in edges {
            at_edge.insert(number, brep.edges.len() as u32);
            brep.edges.push(self.edge(number, &at_vertex)?);
        }
        let mut at_face = InstanceIndices::new();
        let mut parts = BTreeMap::new();
        for number in faces {
            at_face.insert(number, brep.faces.len() as u32);
            let name = self.record(number, "ADVANCED_FACE")?.text(0)?;
            let (name, chart) = part_of(name);
            let part = *parts.entry(name).or_insert_with(|| {
                brep.parts.push(name.to_owned());
                brep.parts.len() as u32 - 1
            });
            brep.faces.push(self.face(number, &at_edge, part, chart)?);
        }
        let mut bodies: Vec<u64> = self.all("MANIFOLD_SOLID_BREP").to_vec();
        bodies.extend(self.all("BREP_WITH_VOIDS"));
        bodies.sort_unstable();
        let bodies = bodies.into_iter().map(|b| self.body(b, &at_face));
        brep.solids = bodies.collect::<Result<_>>()?;
        Ok(brep)
    }

    fn point(&self, number: u64) -> Result<Point3> {
        self.record(number, "CARTESIAN_POINT")?.point(1)
    }
    fn direction(&self, number: u64) -> Result<Point3> {
        self.record(number, "DIRECTION")?.point(1)
    }
    fn axes(&self, number: u64) -> Result<Axes> {
        let given = self.record(number, "AXIS2_PLACEMENT_3D")?;
        Ok(Axes {
            origin: self.point(given.reference(1)?)?,
            z: self.direction(given.reference(2)?)?,
            x: self.direction(given.reference(3)?)?,
        })
    }

    fn edge(&mut self, number: u64, at_vertex: &InstanceIndices) -> Result<Edge> {
        let given = self.record(number, "EDGE_CURVE")?;
        let end = |k: usize| given.indexed(k, at_vertex);
        let curve = self.take(given.reference(3)?)?;
        Ok(Edge {
            ends: [end(1)?, end(2)?],
            curve: self.curve(curve)?,
        })
    }

    fn curve(&self, number: u64) -> Result<Curve> {
        let given = self.only(number)?;
        Ok(match given.record.name.as_str() {
            "LINE" => Curve::Line,
            "CIRCLE" => Curve::Circle(self.axes(given.reference(1)?)?, given.number(2)?),
            "ELLIPSE" => {
                let axes = self.axes(given.reference(1)?)?;
                Curve::Ellipse(axes, given.number(2)?, given.number(3)?)
            }
            "B_SPLINE_CURVE_WITH_KNOTS" => Curve::BSpline(BSpline {
                degree: given.whole(1)?,
                control: self.points(given.list(2)?, &given)?,
                multiplicities: given.wholes(6)?,
                knots: given.numbers(7)?,
            }),
            _ => return Err(given.wrong("a curve of this kind is not read")),
        })
    }

    /// Returns the first record of an instance.
    fn only(&self, number: u64) -> Result<RecordArguments<'f>> {
        let records = self.file.instances.get(&number);
        let record = records.and_then(|r| r.first());
        record
            .map(|record| RecordArguments {
                number,
                line: None,
                record,
            })
            .ok_or_else(|| wrong(format!("#{number}"), "there is no such instance"))
    }

    fn points(&self, list: &[Value], of: &RecordArguments) -> Result<Vec<Point3>> {
        let point = |v: &Value| match v {
            Value::Reference(number) => self.point(*number),
            _ => Err(of.wrong("references to points are expected")),
        };
        list.iter().map(point).collect()
    }

    /// Reads rows of control points.
    fn grid(&self, list: &[Value], of: &RecordArguments) -> Result<Vec<Vec<Point3>>> {
        let row = |v: &Value| match v {
            Value::List(row) => self.points(row, of),
            _ => Err(of.wrong("rows of points are expected")),
        };
        list.iter().map(row).collect()
    }

    fn face(
        &mut self,
        number: u64,
        at_edge: &InstanceIndices,
        part: u32,
        chart: u32,
    ) -> Result<Face> {
        let given = self.record(number, "ADVANCED_FACE")?;
        let mut loops = Vec::new();
        for bound in given.references(1)? {
            let bound = self.take(bound)?;
            loops.push(self.around(bound, at_edge)?);
        }
        let surface = self.take(given.reference(2)?)?;
        Ok(Face {
            surface: self.surface(surface)?,
            agrees: given.flag(3)?,
            part,
            chart,
            loops,
        })
    }

    fn around(&mut self, bound: u64, at_edge: &InstanceIndices) -> Result<Vec<Coedge>> {
        let around = self.only(bound)?.reference(1)?;
        let around = self.take(around)?;
        let around = self.record(around, "EDGE_LOOP")?;
        let coedge = |number: u64| {
            let given = self.record(number, "ORIENTED_EDGE")?;
            Ok(Coedge {
                edge: given.indexed(3, at_edge)?,
                forward: given.flag(4)?,
            })
        };
        around.references(1)?.into_iter().map(coedge).collect()
    }

    fn surface(&self, number: u64) -> Result<Surface> {
        let given = self.only(number)?;
        if given.record.name == "BOUNDED_SURFACE" {
            return self.ellipsoid(number);
        }
        if given.record.name == "B_SPLINE_SURFACE_WITH_KNOTS" {
            return self.graph(&given);
        }
        if given.record.name == "SURFACE_OF_REVOLUTION" {
            return self.revolved(&given);
        }
        let axes = || self.axes(given.reference(1)?);
        Ok(match given.record.name.as_str() {
            "PLANE" => Surface::Plane(axes()?),
            "CYLINDRICAL_SURFACE" => Surface::Cylinder(axes()?, given.number(2)?),
            "CONICAL_SURFACE" => Surface::Cone(axes()?, given.number(2)?, given.number(3)?),
            "SPHERICAL_SURFACE" => Surface::Sphere(axes()?, given.number(2)?),
            "TOROIDAL_SURFACE" => Surface::Torus(axes()?, given.number(2)?, given.number(3)?),
            _ => return Err(given.wrong("a surface of this kind is not read")),
        })
    }

    /// Reads a surface of revolution, whose profile lies in a half-plane of the axis.
    fn revolved(&self, given: &RecordArguments) -> Result<Surface> {
        let other = || given.wrong("this is no spline in a half-plane about the axis");
        let Curve::BSpline(spline) = self.curve(given.reference(1)?)? else {
            return Err(other());
        };
        let axis = self.record(given.reference(2)?, "AXIS1_PLACEMENT")?;
        let origin = self.point(axis.reference(1)?)?;
        let z = self.direction(axis.reference(2)?)?;
        let axes = Axes::along(origin, z);
        let out = |p: &Point3| {
            let [x, y, _] = axes.local(*p);
            x.hypot(y)
        };
        let all = spline.control.iter();
        let farthest = all.max_by(|p, q| out(p).total_cmp(&out(q)));
        let farthest = farthest.ok_or_else(other)?;
        let rounding = 16.0 * f64::EPSILON * (out(farthest) + norm(origin));
        let axes = Axes {
            origin,
            z,
            x: axes.turned(sub(*farthest, origin)).x,
        };
        let knots = flat(&spline.knots, &spline.multiplicities).ok_or_else(other)?;
        let control = spline
            .control
            .iter()
            .map(|p| axes.local(*p))
            // Endpoints on the axis are stored up to rounding.
            .map(|[r, _, z]| [if r.abs() <= rounding { 0.0 } else { r }, z]);
        let turned = Revolved {
            axes,
            degree: spline.degree,
            knots,
            control: control.collect(),
        };
        if !agree_up_to_rounding(&spline.control, &turned.control_points()) {
            return Err(other());
        }
        Ok(Surface::Revolved(Arc::new(turned)))
    }

    /// Recovers the ellipsoid of a chart.
    fn ellipsoid(&self, number: u64) -> Result<Surface> {
        let given = self.record(number, "B_SPLINE_SURFACE")?;
        let rows = self.grid(given.list(2)?, &given)?;
        let other = || given.wrong("this is no chart of an ellipsoid");
        let rows: Option<Vec<[Point3; 3]>> = rows.into_iter().map(|r| r.try_into().ok()).collect();
        let control: Option<[[Point3; 3]; 3]> = rows.and_then(|r| r.try_into().ok());
        let control = control.ok_or_else(other)?;
        let ball = Ellipsoid::of_chart(&control, Ellipsoid::CHART_HALF_WIDTH).ok_or_else(other)?;
        let (again, weights) = ball.chart(Ellipsoid::CHART_HALF_WIDTH);
        let stated = self.record(number, "RATIONAL_B_SPLINE_SURFACE")?;
        let stated: Option<Vec<Vec<f64>>> = stated.list(0)?.iter().map(numbers).collect();
        let are_stated = stated.is_some_and(|s| s == weights.map(Vec::from));
        if !are_stated || !agree_up_to_rounding(control.as_flattened(), again.as_flattened()) {
            return Err(other());
        }
        Ok(Surface::Ellipsoid(ball))
    }

    /// Recovers the height graph with these control points.
    fn graph(&self, given: &RecordArguments) -> Result<Surface> {
        let other = || given.wrong("this is no graph over a plane");
        let degree = given.whole(1)?;
        let rows = self.grid(given.list(3)?, given)?;
        let columns = rows.first().map_or(0, Vec::len);
        let knots = [(8, 10), (9, 11)].map(|(counts, values)| {
            flat(&given.numbers(values)?, &given.wholes(counts)?).ok_or_else(other)
        });
        let [u, v] = knots;
        let knots = [u?, v?];
        let fits = |k: usize, n: usize| Some(knots[k].len()) == n.checked_add(degree + 1);
        let is_net = rows.iter().all(|r| r.len() == columns)
            && fits(0, rows.len())
            && fits(1, columns)
            && (1..=7).contains(&degree)
            && columns > 0;
        if !is_net {
            return Err(other());
        }
        let control: Vec<Point3> = rows.into_iter().flatten().collect();
        let graph = Graph::of_control(degree, knots, &control).ok_or_else(other)?;
        if !agree_up_to_rounding(&control, &graph.control()) {
            return Err(other());
        }
        Ok(Surface::Graph(Arc::new(graph)))
    }

    fn body(&mut self, number: u64, at_face: &InstanceIndices) -> Result<Body> {
        let given = self.only(number)?;
        let mut body = Body {
            outer: self.shell(given.reference(1)?, at_face)?,
            voids: Vec::new(),
        };
        if given.record.name == "BREP_WITH_VOIDS" {
            for void in given.references(2)? {
                let void = self.record(void, "ORIENTED_CLOSED_SHELL")?;
                body.voids.push(self.shell(void.reference(2)?, at_face)?);
            }
        }
        Ok(body)
    }

    fn shell(&mut self, number: u64, at_face: &InstanceIndices) -> Result<Vec<u32>> {
        let number = self.take(number)?;
        let given = self.record(number, "CLOSED_SHELL")?;
        let faces = given.references(1)?.into_iter();
        faces
            .map(|f| {
                let face = at_face.get(&f).copied();
                face.ok_or_else(|| given.wrong("references to faces are expected"))
            })
            .collect()
    }

    fn product(&self) -> Result<String> {
        let Some(&number) = self.all("PRODUCT").first() else {
            return Err(wrong("PRODUCT", "it is missing"));
        };
        Ok(self.record(number, "PRODUCT")?.text(0)?.to_owned())
    }

    /// Returns the unit of length. A conversion-based unit takes precedence over its base unit.
    fn unit(&self) -> Result<String> {
        let unknown = || wrong("LENGTH_UNIT", "this unit of length is not known");
        if let Some(&number) = self.all("CONVERSION_BASED_UNIT").first() {
            return match self.record(number, "CONVERSION_BASED_UNIT")?.text(0)? {
                "INCH" => Ok("in".to_owned()),
                "FOOT" => Ok("ft".to_owned()),
                _ => Err(unknown()),
            };
        }
        let number = *self.all("LENGTH_UNIT").first().ok_or_else(unknown)?;
        let unit = match self.record(number, "SI_UNIT")?.record.arguments.first() {
            Some(Value::Nothing) => "m",
            Some(Value::Word(prefix)) => match prefix.as_str() {
                "MICRO" => "um",
                "MILLI" => "mm",
                "CENTI" => "cm",
                _ => return Err(unknown()),
            },
            _ => return Err(unknown()),
        };
        Ok(unit.to_owned())
    }

    /// Reads volume, area and centroid. The stated accuracy is the larger of a constant and ten
    /// times the gap, so a tenth of it bounds the gap.
    fn properties(&self) -> Result<SolidProperties> {
        let missing = |what: &str| wrong(what, "it is missing");
        let mut found = [None; 2];
        for &number in self.all("MEASURE_REPRESENTATION_ITEM") {
            let given = self.record(number, "MEASURE_REPRESENTATION_ITEM")?;
            match given.text(0)? {
                "volume measure" => found[0] = Some(given.measure(1)?),
                "surface area measure" => found[1] = Some(given.measure(1)?),
                _ => {}
            }
        }
        let points = self.all("CARTESIAN_POINT").iter();
        let points = points.map(|n| self.record(*n, "CARTESIAN_POINT"));
        let mut named = points.filter_map(|p| p.ok().filter(|p| p.text(0) == Ok("centre point")));
        let centroid = named.next().ok_or_else(|| missing("centre point"))?;
        let accuracy = match self.all("UNCERTAINTY_MEASURE_WITH_UNIT").first() {
            Some(&n) => self
                .record(n, "UNCERTAINTY_MEASURE_WITH_UNIT")?
                .measure(0)?,
            None => LENGTH_UNCERTAINTY,
        };
        Ok(SolidProperties {
            volume: found[0].ok_or_else(|| missing("volume measure"))?,
            area: found[1].ok_or_else(|| missing("surface area measure"))?,
            centroid: centroid.point(1)?,
            gap: accuracy / 10.0,
        })
    }
}

/// Splits the name of a face into its part and the index of its chart, from 0.
fn part_of(name: &str) -> (&str, u32) {
    let chart = name.rsplit_once("#chart");
    let numbered = chart.and_then(|(part, n)| Some((part, n.parse::<u32>().ok()?.checked_sub(1)?)));
    numbered.unwrap_or((name, 0))
}

/// Expands knots by multiplicity; `None` if a multiplicity exceeds twenty.
fn flat(values: &[f64], counts: &[usize]) -> Option<Vec<f64>> {
    if values.len() != counts.len() || counts.iter().any(|n| *n > 20) {
        return None;
    }
    let each = values.iter().zip(counts);
    Some(
        each.flat_map(|(t, n)| std::iter::repeat_n(*t, *n))
            .collect(),
    )
}

/// Returns true if two lists of points agree up to rounding.
fn agree_up_to_rounding(given: &[Point3], found: &[Point3]) -> bool {
    let size = Aabb::from_points(given).diagonal();
    let far = given.iter().flatten().fold(size, |m, v| m.max(v.abs()));
    let near = |(p, q): (&Point3, &Point3)| norm(sub(*p, *q)) <= ROUND_TRIP_TOLERANCE * far;
    given.len() == found.len() && given.iter().zip(found).all(near)
}
