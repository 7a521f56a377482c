//! Solids and surfaces: shells, faces, loops, edges and vertices.

use super::surfaces::ReadSurface;
use super::units::Units;
use super::{Result, ShapeReader};
use crate::solids::wrong;
use crate::step::parse::Value;
use isoform_geom::Point3;
use isoform_geom::cad::{CadCurve, Coedge, Edge, Face, Shape, Shell};
use isoform_geom::{norm, sub};
use std::collections::BTreeMap;

/// Maximum number of oriented shells, faces or edges that refer to one another.
const MAX_ORIENTATIONS: usize = 4;

/// Reader of one solid or surface, in its own coordinates.
pub(super) struct PartReader<'r, 'f> {
    reader: &'r ShapeReader<'f>,
    units: Units,
    shape: Shape,
    vertices: BTreeMap<u64, u32>,
    edges: BTreeMap<u64, u32>,
    /// Edges of polygons by the numbers of their two points, the smaller one first.
    sides: BTreeMap<[u64; 2], u32>,
    surfaces: BTreeMap<u64, ReadSurface>,
    /// Number of coedges, faces and control points of edges that may still be read.
    budget: &'r mut usize,
}

/// Returns true if an item of a representation is a solid or a surface that can be read.
pub(super) fn is_part(kind: &str) -> bool {
    matches!(
        kind,
        "MANIFOLD_SOLID_BREP"
            | "BREP_WITH_VOIDS"
            | "FACETED_BREP"
            | "SHELL_BASED_SURFACE_MODEL"
            | "FACE_BASED_SURFACE_MODEL"
            | "OPEN_SHELL"
            | "CLOSED_SHELL"
            | "CONNECTED_FACE_SET"
    )
}

/// Reads a solid or a surface. Each coedge and face takes one of the budget.
pub(super) fn part(
    reader: &ShapeReader,
    number: u64,
    units: Units,
    budget: &mut usize,
) -> Result<Shape> {
    let mut part = PartReader {
        reader,
        units,
        shape: Shape::default(),
        vertices: BTreeMap::new(),
        edges: BTreeMap::new(),
        sides: BTreeMap::new(),
        surfaces: BTreeMap::new(),
        budget,
    };
    part.item(number)?;
    Ok(part.shape)
}

impl PartReader<'_, '_> {
    fn item(&mut self, number: u64) -> Result<()> {
        let given = self.reader.first(number)?;
        let shell = |this: &mut Self, n: u64, solid, is_void| {
            let faces = this.shell(n, true, 0)?;
            this.shape.shells.push(Shell {
                faces,
                solid,
                is_void,
            });
            Ok(())
        };
        match given.record.name.as_str() {
            "MANIFOLD_SOLID_BREP" | "FACETED_BREP" | "BREP_WITH_VOIDS" => {
                let solid = Some(0);
                self.shape
                    .solids
                    .push(given.text(0).unwrap_or("").to_owned());
                shell(self, given.reference(1)?, solid, false)?;
                if given.record.name == "BREP_WITH_VOIDS" {
                    for void in given.references(2)? {
                        shell(self, void, solid, true)?;
                    }
                }
                Ok(())
            }
            "SHELL_BASED_SURFACE_MODEL" | "FACE_BASED_SURFACE_MODEL" => {
                let mut shells = given.references(1)?.into_iter();
                shells.try_for_each(|n| shell(self, n, None, false))
            }
            _ => shell(self, number, None, false),
        }
    }

    /// Takes the size of an item from the budget.
    fn spend(&mut self, number: u64, size: usize) -> Result<()> {
        let Some(left) = self.budget.checked_sub(size) else {
            let problem = "faces and edges share more than the file is long";
            return Err(wrong(self.reader.at(number), problem));
        };
        *self.budget = left;
        Ok(())
    }

    /// Reads a shell, whose faces are turned over if `agrees` is false.
    fn shell(&mut self, number: u64, agrees: bool, depth: usize) -> Result<Vec<u32>> {
        let given = self.reader.first(number)?;
        match given.record.name.as_str() {
            "ORIENTED_CLOSED_SHELL" | "ORIENTED_OPEN_SHELL" if depth < MAX_ORIENTATIONS => {
                let agrees = agrees == given.flag(3)?;
                self.shell(given.reference(2)?, agrees, depth + 1)
            }
            "CLOSED_SHELL" | "OPEN_SHELL" | "CONNECTED_FACE_SET" => {
                let faces = given.references(1)?.into_iter();
                faces.map(|f| self.face(f, agrees, 0)).collect()
            }
            _ => Err(given.wrong("a shell is expected")),
        }
    }

    fn face(&mut self, number: u64, agrees: bool, depth: usize) -> Result<u32> {
        self.spend(number, 1)?;
        let given = self.reader.first(number)?;
        match given.record.name.as_str() {
            "ORIENTED_FACE" if depth < MAX_ORIENTATIONS => {
                let agrees = agrees == given.flag(3)?;
                return self.face(given.reference(2)?, agrees, depth + 1);
            }
            "ADVANCED_FACE" | "FACE_SURFACE" => {}
            _ => return Err(given.wrong("faces of this kind are not read")),
        }
        let surface = given.reference(2)?;
        let surface = match self.surfaces.get(&surface) {
            Some(known) => known.clone(),
            None => {
                let read = self.reader.surface(surface, self.units.angle)?;
                self.surfaces.insert(surface, read.clone());
                read
            }
        };
        let mut loops = Vec::new();
        for bound in given.references(1)? {
            let bound = self.reader.first(bound)?;
            if !matches!(
                bound.record.name.as_str(),
                "FACE_BOUND" | "FACE_OUTER_BOUND"
            ) {
                return Err(bound.wrong("a bound of a face is expected"));
            }
            let mut around = self.around(bound.reference(1)?)?;
            if bound.flag(2)? != agrees {
                around.reverse();
                around.iter_mut().for_each(|c| c.forward = !c.forward);
            }
            if !around.is_empty() {
                loops.push(around);
            }
        }
        let same = given.flag(3)? != surface.is_reversed;
        let index = self.shape.faces.len() as u32;
        self.shape.faces.push(Face {
            name: format!("{}, {}", self.reader.at(number), surface.surface.name()),
            surface: surface.surface,
            agrees: same == agrees,
            loops,
        });
        Ok(index)
    }

    /// Reads a loop; one of a single vertex is empty.
    fn around(&mut self, number: u64) -> Result<Vec<Coedge>> {
        let given = self.reader.first(number)?;
        match given.record.name.as_str() {
            "EDGE_LOOP" => {
                let edges = given.references(1)?.into_iter();
                edges.map(|e| self.coedge(e, true, 0)).collect()
            }
            "VERTEX_LOOP" => Ok(Vec::new()),
            "POLY_LOOP" => self.polygon(&given.references(1)?),
            _ => Err(given.wrong("loops of this kind are not read")),
        }
    }

    fn coedge(&mut self, number: u64, forward: bool, depth: usize) -> Result<Coedge> {
        self.spend(number, 1)?;
        let given = self.reader.first(number)?;
        match given.record.name.as_str() {
            "ORIENTED_EDGE" if depth < MAX_ORIENTATIONS => {
                let forward = forward == given.flag(4)?;
                self.coedge(given.reference(3)?, forward, depth + 1)
            }
            "EDGE_CURVE" => Ok(Coedge {
                edge: self.edge(number)?,
                forward,
            }),
            _ => Err(given.wrong("edges of this kind are not read")),
        }
    }

    fn polygon(&mut self, points: &[u64]) -> Result<Vec<Coedge>> {
        let mut around = Vec::new();
        let next = points.iter().cycle().skip(1);
        for (a, b) in points.iter().zip(next).filter(|(a, b)| a != b) {
            self.spend(*a, 1)?;
            let key = [*a.min(b), *a.max(b)];
            let edge = match self.sides.get(&key) {
                Some(edge) => *edge,
                None => {
                    let ends = [self.corner(key[0])?, self.corner(key[1])?];
                    let [p, q] = ends.map(|v| self.shape.vertices[v as usize]);
                    let way = sub(q, p);
                    if norm(way) == 0.0 {
                        let problem = "two corners of a polygon coincide";
                        return Err(wrong(self.reader.at(*a), problem));
                    }
                    self.shape.edges.push(Edge {
                        curve: CadCurve::Line(p, way),
                        range: [0.0, 1.0],
                        ends,
                    });
                    let edge = self.shape.edges.len() as u32 - 1;
                    self.sides.insert(key, edge);
                    edge
                }
            };
            let forward = key[0] == *a;
            around.push(Coedge { edge, forward });
        }
        Ok(around)
    }

    /// Reads a corner of a polygon.
    fn corner(&mut self, point: u64) -> Result<u32> {
        if let Some(known) = self.vertices.get(&point) {
            return Ok(*known);
        }
        let index = self.shape.vertices.len() as u32;
        self.shape.vertices.push(self.reader.point(point)?);
        self.vertices.insert(point, index);
        Ok(index)
    }

    fn vertex(&mut self, number: u64) -> Result<u32> {
        if let Some(known) = self.vertices.get(&number) {
            return Ok(*known);
        }
        let given = self.reader.record(number, "VERTEX_POINT")?;
        let point = self.reader.point(given.reference(1)?)?;
        let index = self.shape.vertices.len() as u32;
        self.shape.vertices.push(point);
        self.vertices.insert(number, index);
        Ok(index)
    }

    fn edge(&mut self, number: u64) -> Result<u32> {
        if let Some(known) = self.edges.get(&number) {
            return Ok(*known);
        }
        let given = self.reader.record(number, "EDGE_CURVE")?;
        let ends = [
            self.vertex(given.reference(1)?)?,
            self.vertex(given.reference(2)?)?,
        ];
        let read = self.reader.curve(given.reference(3)?)?;
        if let CadCurve::Nurbs(spline) = &read.curve {
            // The search for its ends takes as long as the curve is.
            self.spend(number, spline.control().count())?;
        }
        let forward = given.flag(4)? != read.is_reversed;
        let [p, q] = ends.map(|v| self.shape.vertices[v as usize]);
        let closed = ends[0] == ends[1];
        let range = range(&read.curve, forward, [p, q], closed);
        let range = range.filter(|r| r.iter().all(|t| t.is_finite()));
        let range = range.ok_or_else(|| given.wrong("its curve does not close at its vertex"))?;
        let index = self.shape.edges.len() as u32;
        self.shape.edges.push(Edge {
            curve: read.curve,
            range,
            ends,
        });
        self.edges.insert(number, index);
        Ok(index)
    }
}

/// Returns the parameters of the ends of an edge; `forward` is true if the edge runs along its
/// curve. `None` if a closed edge lies on a curve without an end.
fn range(
    curve: &CadCurve,
    forward: bool,
    [p, q]: [Point3; 2],
    is_closed: bool,
) -> Option<[f64; 2]> {
    let Some(period) = curve.period() else {
        if is_closed {
            let [lo, hi] = curve.domain();
            return lo
                .is_finite()
                .then_some(if forward { [lo, hi] } else { [hi, lo] });
        }
        return Some([curve.parameter(p), curve.parameter(q)]);
    };
    let from = curve.parameter(p);
    let sign = if forward { 1.0 } else { -1.0 };
    if is_closed {
        return Some([from, from + sign * period]);
    }
    let mut way = (sign * (curve.parameter(q) - from)).rem_euclid(period);
    // Ends that coincide up to rounding bound a short edge, not a whole turn: that has one vertex.
    if way > (1.0 - 1e-9) * period {
        way -= period;
    }
    Some([from, from + sign * way])
}

/// Returns the number of an argument's instance, if it is a reference.
pub(super) fn reference_of(value: Option<&Value>) -> Option<u64> {
    match value {
        Some(Value::Reference(number)) => Some(*number),
        _ => None,
    }
}
