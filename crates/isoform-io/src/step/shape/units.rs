//! Units of representations.

use super::{Result, ShapeReader};
use crate::solids::wrong;
use crate::step::parse::Value;

/// Units with their lengths in metres.
const LENGTHS: [(&str, f64); 6] = [
    ("um", 1e-6),
    ("mm", 1e-3),
    ("cm", 1e-2),
    ("m", 1.0),
    ("in", 0.0254),
    ("ft", 0.3048),
];
/// Relative difference up to which a stated factor is that of a known unit: factors of inches and
/// degrees are written with some ten digits.
const FACTOR_TOLERANCE: f64 = 1e-6;
/// Maximum number of units that are defined by one another.
const MAX_UNIT_DEPTH: usize = 4;

/// Units of a representation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Units {
    /// Unit of length in metres.
    pub(super) length: f64,
    /// Unit of angles in radians.
    pub(super) angle: f64,
}

/// Units where a file states none: millimetres and radians.
pub(super) const UNSTATED: Units = Units {
    length: 1e-3,
    angle: 1.0,
};

/// Returns the name of a unit of length; `None` if it has none here.
pub(super) fn name_of(length: f64) -> Option<&'static str> {
    let near = |m: f64| (length - m).abs() <= FACTOR_TOLERANCE * m;
    LENGTHS.into_iter().find(|u| near(u.1)).map(|u| u.0)
}

impl ShapeReader<'_> {
    /// Reads the units of a context of representations.
    pub(super) fn units(&self, context: u64) -> Result<Units> {
        let Some(given) = self.find(context, "GLOBAL_UNIT_ASSIGNED_CONTEXT") else {
            return Ok(UNSTATED);
        };
        let mut units = UNSTATED;
        for unit in given.references(0)? {
            if self.find(unit, "LENGTH_UNIT").is_some() {
                units.length = self.metres(unit)?;
            } else if self.find(unit, "PLANE_ANGLE_UNIT").is_some() {
                units.angle = self.factor(unit, 0)?;
            }
        }
        Ok(units)
    }

    /// Returns a unit of length in metres, exactly where it is known.
    fn metres(&self, unit: u64) -> Result<f64> {
        let length = self.factor(unit, 0)?;
        let near = |m: f64| (length - m).abs() <= FACTOR_TOLERANCE * m;
        let known = LENGTHS.into_iter().find(|u| near(u.1));
        Ok(known.map_or(length, |u| u.1))
    }

    /// Returns a unit in metres or radians.
    fn factor(&self, unit: u64, depth: usize) -> Result<f64> {
        if depth > MAX_UNIT_DEPTH {
            let problem = "it is defined by too many other units";
            return Err(wrong(self.at(unit), problem));
        }
        if let Some(given) = self.find(unit, "CONVERSION_BASED_UNIT") {
            let by = given.reference(1)?;
            let measure = match self.find(by, "MEASURE_WITH_UNIT") {
                Some(measure) => measure,
                None => self.first(by)?,
            };
            let value = measure.measure(0)?;
            let base = self.factor(measure.reference(1)?, depth + 1)?;
            let factor = value * base;
            if !(factor > 0.0 && factor.is_finite()) {
                return Err(given.wrong("its factor must be positive"));
            }
            let is_degree = (factor - 1f64.to_radians()).abs() <= FACTOR_TOLERANCE * factor;
            return Ok(if is_degree { 1f64.to_radians() } else { factor });
        }
        self.si_factor(unit)
    }

    /// Returns the factor of the prefix of a unit.
    fn si_factor(&self, unit: u64) -> Result<f64> {
        let given = self.record(unit, "SI_UNIT")?;
        // A complex record states the prefix first; a plain one after the derived dimensions.
        let arguments = &given.record.arguments;
        let prefix = arguments.iter().rev().nth(1);
        let exponent = match prefix {
            Some(Value::Word(prefix)) => match prefix.as_str() {
                "NANO" => -9,
                "MICRO" => -6,
                "MILLI" => -3,
                "CENTI" => -2,
                "DECI" => -1,
                "KILO" => 3,
                _ => return Err(given.wrong("this prefix is not known")),
            },
            _ => 0,
        };
        Ok(match exponent {
            // A quotient is rounded correctly, a product is not.
            0 => 1.0,
            e if e > 0 => 10f64.powi(e),
            e => 1.0 / 10f64.powi(-e),
        })
    }
}
