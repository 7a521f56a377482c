//! Reader of the shapes in STEP files of any program: AP203, AP214 and AP242.
//!
//! Solids and surfaces are read with all of their faces, or the file is refused: a face that is
//! left out would falsify distances, areas and volumes. Other items, such as curves and points, are
//! named in remarks.

mod assembly;
mod curves;
mod placed;
mod surfaces;
mod topology;
mod units;

use super::parse::{StepFile, Value};
use super::read::written_by;
use super::records::RecordArguments;
use crate::solids::{SolidFileError, wrong};
use isoform_geom::Point3;
use isoform_geom::brep::Axes;
use isoform_geom::cad::Shape;
use isoform_geom::{dot, norm};
use std::collections::BTreeMap;

type Result<T> = std::result::Result<T, SolidFileError>;

/// Shape of a STEP file, with all parts in their places.
#[derive(Clone, Debug, Default)]
pub struct ShapeFile {
    /// Faces, edges and vertices.
    pub shape: Shape,
    /// Name of the product; may be empty.
    pub name: String,
    /// Unit of length: um, mm, cm, m, in or ft.
    pub unit: String,
    /// Schema that the file states, such as `AUTOMOTIVE_DESIGN`.
    pub schema: String,
    /// Program that wrote the file, as its header says; may be empty.
    pub program: String,
    /// Number of parts in their places: one, or those of an assembly.
    pub parts: usize,
    /// Items that are not part of the shape, with their numbers, in sentences.
    pub remarks: Vec<String>,
}

/// Reads the shape of a parsed file; `length` is that of its text in bytes.
pub(super) fn read(file: &StepFile, length: usize) -> Result<ShapeFile> {
    let reader = ShapeReader::new(file);
    let mut made = assembly::assemble(&reader, length)?;
    if made.shape.faces.is_empty() {
        let problem = match made.remarks.first() {
            Some(first) => format!("there is no face: {first}"),
            None => "there is no solid and no surface".to_owned(),
        };
        return Err(wrong("shape", problem));
    }
    made.name = reader.product_name();
    made.schema = reader.schema();
    made.program = written_by(file).to_owned();
    Ok(made)
}

/// Instances of a file by their kinds.
struct ShapeReader<'f> {
    file: &'f StepFile,
    /// Numbers of the instances by the names of their records, ascending.
    named: BTreeMap<&'f str, Vec<u64>>,
}

impl<'f> ShapeReader<'f> {
    fn new(file: &'f StepFile) -> Self {
        let mut named: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
        for (number, records) in &file.instances {
            for record in records {
                named.entry(&record.name).or_default().push(*number);
            }
        }
        Self { file, named }
    }
    /// Returns the numbers of all instances with a record of this name.
    fn all(&self, name: &str) -> &[u64] {
        self.named.get(name).map_or(&[], Vec::as_slice)
    }
    /// Returns the position of an instance for messages.
    fn at(&self, number: u64) -> String {
        match self.file.lines.get(&number) {
            Some(line) => format!("#{number} (line {line})"),
            None => format!("#{number}"),
        }
    }
    /// Returns the arguments of the record of this name in an instance, `None` if it has none.
    fn find(&self, number: u64, name: &str) -> Option<RecordArguments<'f>> {
        let records = self.file.instances.get(&number)?;
        let record = records.iter().find(|r| r.name == name)?;
        let line = self.file.lines.get(&number).copied();
        Some(RecordArguments {
            number,
            line,
            record,
        })
    }
    /// Returns the arguments of the record of this name in an instance.
    fn record(&self, number: u64, name: &str) -> Result<RecordArguments<'f>> {
        let found = self.find(number, name);
        found.ok_or_else(|| match self.kind(number) {
            "" => wrong(format!("#{number}"), "there is no such instance"),
            kind => wrong(self.at(number), format!("{name} is expected, not {kind}")),
        })
    }
    /// Returns the first record of an instance.
    fn first(&self, number: u64) -> Result<RecordArguments<'f>> {
        let records = self.file.instances.get(&number).and_then(|r| r.first());
        let line = self.file.lines.get(&number).copied();
        records
            .map(|record| RecordArguments {
                number,
                line,
                record,
            })
            .ok_or_else(|| wrong(format!("#{number}"), "there is no such instance"))
    }
    /// Returns the name of the first record of an instance; empty for a number without an instance.
    fn kind(&self, number: u64) -> &'f str {
        let records = self.file.instances.get(&number).and_then(|r| r.first());
        records.map_or("", |r| r.name.as_str())
    }
    /// Returns the names of the records of an instance, for messages.
    fn kinds(&self, number: u64) -> String {
        let records = self.file.instances.get(&number);
        let names = records.into_iter().flatten().map(|r| r.name.as_str());
        names.collect::<Vec<_>>().join(" + ")
    }

    fn point(&self, number: u64) -> Result<Point3> {
        let given = self.record(number, "CARTESIAN_POINT")?;
        given.point(1)
    }
    fn points(&self, list: &[Value], of: &RecordArguments) -> Result<Vec<Point3>> {
        let point = |v: &Value| match v {
            Value::Reference(number) => self.point(*number),
            _ => Err(of.wrong("references to points are expected")),
        };
        list.iter().map(point).collect()
    }
    /// Reads a direction as a unit vector.
    fn direction(&self, number: u64) -> Result<Point3> {
        let given = self.record(number, "DIRECTION")?;
        let d = given.point(1)?;
        unit(d).ok_or_else(|| given.wrong("its length is 0 or too large"))
    }
    /// Reads a vector.
    fn vector(&self, number: u64) -> Result<Point3> {
        let given = self.record(number, "VECTOR")?;
        let d = self.direction(given.reference(1)?)?;
        let length = given.number(2)?;
        if length == 0.0 {
            return Err(given.wrong("its length is 0"));
        }
        Ok(d.map(|v| v * length))
    }
    /// Reads a frame. Without directions, they are those of the coordinates, as ISO 10303-42 says.
    fn axes(&self, number: u64) -> Result<Axes> {
        let given = self.record(number, "AXIS2_PLACEMENT_3D")?;
        let origin = self.point(given.reference(1)?)?;
        let optional = |k: usize| match given.record.arguments.get(k) {
            Some(Value::Reference(number)) => self.direction(*number).map(Some),
            _ => Ok(None),
        };
        let z = optional(2)?.unwrap_or([0.0, 0.0, 1.0]);
        let x = optional(3)?;
        frame(origin, z, x).ok_or_else(|| given.wrong("its directions are parallel"))
    }

    /// Returns the name of the first product.
    fn product_name(&self) -> String {
        let given = self.all("PRODUCT").first();
        let given = given.and_then(|n| self.find(*n, "PRODUCT"));
        let text = |k: usize| given.as_ref().and_then(|g| g.text(k).ok()).unwrap_or("");
        let name = if text(1).is_empty() { text(0) } else { text(1) };
        name.to_owned()
    }
    /// Returns the name of the schema that the header states, without its object identifier.
    fn schema(&self) -> String {
        let header = self.file.header.iter().find(|r| r.name == "FILE_SCHEMA");
        match header.and_then(|r| r.arguments.first()) {
            Some(Value::List(list)) => match list.first() {
                Some(Value::Text(name)) => name.split([' ', '{']).next().unwrap_or("").to_owned(),
                _ => String::new(),
            },
            _ => String::new(),
        }
    }
}

/// Normalises a vector; `None` if its length is zero or overflows.
fn unit(d: Point3) -> Option<Point3> {
    let length = norm(d);
    (length > 0.0 && length.is_finite()).then(|| d.map(|v| v / length))
}

/// Returns a right-handed frame with the direction of z, and that of x as near to the given one as
/// possible; `None` if both are parallel.
fn frame(origin: Point3, z: Point3, x: Option<Point3>) -> Option<Axes> {
    let Some(x) = x else {
        let axes = Axes::along(origin, z);
        // The first direction of the coordinates that is not parallel to z.
        let first = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let first = first.into_iter().find(|e| dot(*e, z).abs() < 0.999_999);
        return Some(axes.turned(first.unwrap_or(axes.x)));
    };
    let axes = Axes::along(origin, z);
    let turned = axes.turned(x);
    // `turned` leaves a frame unchanged where x is parallel to z.
    let across = dot(x, x) - dot(x, z) * dot(x, z);
    (across > 1e-20).then_some(turned)
}
