//! Surfaces of faces.

use super::curves::{all_numbers, expanded, implied_knots};
use super::{Result, ShapeReader, frame};
use crate::solids::wrong;
use crate::step::parse::Value;
use crate::step::records::RecordArguments;
use isoform_geom::cad::{CadSurface, NurbsSurface};
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// Maximum number of surfaces that trim one another.
const MAX_SURFACE_DEPTH: usize = 4;

/// Surface, with the sense of its normal in the file.
#[derive(Clone)]
pub(super) struct ReadSurface {
    pub(super) surface: CadSurface,
    /// True if the file means the opposite normal.
    pub(super) is_reversed: bool,
}

impl ShapeReader<'_> {
    /// Reads a surface; `angle` is the unit of angles in radians.
    pub(super) fn surface(&self, number: u64, angle: f64) -> Result<ReadSurface> {
        self.surface_within(number, angle, 0)
    }

    fn surface_within(&self, number: u64, angle: f64, depth: usize) -> Result<ReadSurface> {
        let given = self.first(number)?;
        if depth > MAX_SURFACE_DEPTH {
            return Err(given.wrong("too many surfaces refer to one another"));
        }
        let surface = match given.record.name.as_str() {
            "SURFACE_OF_REVOLUTION" | "SURFACE_OF_LINEAR_EXTRUSION" => return self.swept(&given),
            "RECTANGULAR_TRIMMED_SURFACE" => {
                let mut basis = self.surface_within(given.reference(1)?, angle, depth + 1)?;
                basis.is_reversed ^= given.flag(6)? != given.flag(7)?;
                return Ok(basis);
            }
            "PLANE" => CadSurface::Plane(self.axes(given.reference(1)?)?),
            "CYLINDRICAL_SURFACE" | "SPHERICAL_SURFACE" | "TOROIDAL_SURFACE" => {
                self.round(&given)?
            }
            "CONICAL_SURFACE" => self.cone(&given, angle)?,
            _ => self.spline_surface(number)?,
        };
        Ok(ReadSurface {
            surface,
            is_reversed: false,
        })
    }

    /// Reads a cylinder, a sphere or a torus.
    fn round(&self, given: &RecordArguments) -> Result<CadSurface> {
        let (axes, radius) = (self.axes(given.reference(1)?)?, given.radius(2)?);
        match given.record.name.as_str() {
            "CYLINDRICAL_SURFACE" => return Ok(CadSurface::Cylinder(axes, radius)),
            "SPHERICAL_SURFACE" => return Ok(CadSurface::Sphere(axes, radius)),
            _ => {}
        }
        let minor = given.radius(3)?;
        if minor >= radius {
            return Err(given.wrong("a torus that meets its axis is not read"));
        }
        Ok(CadSurface::Torus(axes, radius, minor))
    }

    fn cone(&self, given: &RecordArguments, angle: f64) -> Result<CadSurface> {
        let axes = self.axes(given.reference(1)?)?;
        let (at_origin, half) = (given.number(2)?, given.number(3)? * angle);
        if at_origin < 0.0 || !(half.abs() > 0.0 && half.abs() < FRAC_PI_2) {
            let problem = "its radius must not be negative, its angle below 90 degrees";
            return Err(given.wrong(problem));
        }
        Ok(CadSurface::Cone(axes, at_origin, half))
    }

    /// Reads a surface of revolution or extrusion.
    fn swept(&self, given: &RecordArguments) -> Result<ReadSurface> {
        let profile = self.curve(given.reference(1)?)?;
        let by = given.reference(2)?;
        let surface = if given.record.name == "SURFACE_OF_REVOLUTION" {
            let axis = self.record(by, "AXIS1_PLACEMENT")?;
            let origin = self.point(axis.reference(1)?)?;
            let z = match axis.record.arguments.get(2) {
                Some(Value::Reference(z)) => self.direction(*z)?,
                _ => [0.0, 0.0, 1.0],
            };
            let axes = frame(origin, z, None).ok_or_else(|| given.wrong("it has no axis"))?;
            CadSurface::Revolved(axes, profile.curve)
        } else {
            CadSurface::Extruded(profile.curve, self.vector(by)?)
        };
        Ok(ReadSurface {
            surface,
            is_reversed: profile.is_reversed,
        })
    }

    fn spline_surface(&self, number: u64) -> Result<CadSurface> {
        let plain = self.first(number)?;
        let (base, shift) = match self.find(number, "B_SPLINE_SURFACE") {
            Some(base) => (base, 0),
            None => (plain, 1),
        };
        let kinds = ["BEZIER_SURFACE", "UNIFORM_SURFACE", "QUASI_UNIFORM_SURFACE"];
        let implied = kinds.into_iter().find(|k| self.find(number, k).is_some());
        let stated = self.find(number, "B_SPLINE_SURFACE_WITH_KNOTS");
        if stated.is_none() && implied.is_none() {
            let kinds = self.kinds(number);
            let problem = format!("surfaces of the kind {kinds} are not read");
            return Err(wrong(self.at(number), problem));
        }
        let degrees = [base.whole(shift)?, base.whole(shift + 1)?];
        let rows = self.rows(base.list(shift + 2)?, &base)?;
        let counts = [rows.len(), rows.first().map_or(0, Vec::len)];
        if rows.iter().any(|r| r.len() != counts[1]) {
            return Err(base.wrong("its rows of control points differ in length"));
        }
        let knots = |k: usize| match (&stated, implied) {
            (Some(stated), _) => {
                let skipped = if shift == 0 { 0 } else { 8 };
                let values = stated.numbers(skipped + 2 + k)?;
                expanded(
                    &values,
                    &stated.wholes(skipped + k)?,
                    stated,
                    counts[k],
                    degrees[k],
                )
            }
            (None, kind) => implied_knots(kind.unwrap_or(""), counts[k], degrees[k], &base),
        };
        let knots = [knots(0)?, knots(1)?];
        let weights = match self.find(number, "RATIONAL_B_SPLINE_SURFACE") {
            Some(rational) => Some(all_numbers(rational.list(0)?, &rational)?),
            None => None,
        };
        let points = rows.concat();
        let spline = NurbsSurface::new(degrees, knots, &points, weights.as_deref());
        let spline = spline.map_err(|e| plain.wrong(&e.to_string()))?;
        Ok(CadSurface::Nurbs(Arc::new(spline)))
    }

    fn rows(&self, list: &[Value], of: &RecordArguments) -> Result<Vec<Vec<[f64; 3]>>> {
        let row = |v: &Value| match v {
            Value::List(row) => self.points(row, of),
            _ => Err(of.wrong("rows of points are expected")),
        };
        list.iter().map(row).collect()
    }
}
