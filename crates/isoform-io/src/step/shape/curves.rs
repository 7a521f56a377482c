//! Curves of edges and profiles.

use super::{Result, ShapeReader};
use crate::solids::wrong;
use crate::step::parse::Value;
use crate::step::records::{RecordArguments, numbers};
use isoform_geom::cad::{CadCurve, MAX_DEGREE, NurbsCurve};
use std::sync::Arc;

/// Maximum number of curves that trim or accompany one another.
const MAX_CURVE_DEPTH: usize = 8;

/// Curve, with its direction in the file.
pub(super) struct ReadCurve {
    pub(super) curve: CadCurve,
    /// True if the file means the opposite direction.
    pub(super) is_reversed: bool,
}

impl ShapeReader<'_> {
    /// Reads a curve; the unit of angles does not matter, since none is read from trimmed curves.
    pub(super) fn curve(&self, number: u64) -> Result<ReadCurve> {
        self.curve_within(number, 0)
    }

    fn curve_within(&self, number: u64, depth: usize) -> Result<ReadCurve> {
        let given = self.first(number)?;
        if depth > MAX_CURVE_DEPTH {
            return Err(given.wrong("too many curves refer to one another"));
        }
        let basis = || self.curve_within(given.reference(1)?, depth + 1);
        let curve = match given.record.name.as_str() {
            "SURFACE_CURVE" | "SEAM_CURVE" | "INTERSECTION_CURVE" => return basis(),
            "TRIMMED_CURVE" => {
                let mut basis = basis()?;
                basis.is_reversed ^= !given.flag(4)?;
                return Ok(basis);
            }
            "LINE" => {
                let from = self.point(given.reference(1)?)?;
                CadCurve::Line(from, self.vector(given.reference(2)?)?)
            }
            "CIRCLE" | "ELLIPSE" | "PARABOLA" | "HYPERBOLA" => self.conic(&given)?,
            "POLYLINE" => self.polyline(&given)?,
            _ => self.spline_curve(number)?,
        };
        Ok(ReadCurve {
            curve,
            is_reversed: false,
        })
    }

    fn conic(&self, given: &RecordArguments) -> Result<CadCurve> {
        let axes = self.axes(given.reference(1)?)?;
        let first = given.radius(2)?;
        Ok(match given.record.name.as_str() {
            "CIRCLE" => CadCurve::Circle(axes, first),
            "ELLIPSE" => CadCurve::Ellipse(axes, first, given.radius(3)?),
            "PARABOLA" => CadCurve::Parabola(axes, first),
            _ => CadCurve::Hyperbola(axes, first, given.radius(3)?),
        })
    }

    fn polyline(&self, given: &RecordArguments) -> Result<CadCurve> {
        let points = self.points(given.list(1)?, given)?;
        let last = points.len().saturating_sub(1) as f64;
        let mut knots = vec![0.0];
        knots.extend((0..points.len()).map(|i| i as f64));
        knots.push(last);
        let spline = NurbsCurve::new(1, knots, &points, None);
        let spline = spline.map_err(|e| given.wrong(&e.to_string()))?;
        Ok(CadCurve::Nurbs(Arc::new(spline)))
    }

    fn spline_curve(&self, number: u64) -> Result<CadCurve> {
        let other = || {
            let problem = format!("curves of the kind {} are not read", self.kinds(number));
            wrong(self.at(number), problem)
        };
        // A plain instance begins with its name, and inherits the arguments of all its kinds.
        let plain = self.first(number)?;
        let (base, shift) = match self.find(number, "B_SPLINE_CURVE") {
            Some(base) => (base, 0),
            None => (plain, 1),
        };
        let kinds = ["BEZIER_CURVE", "UNIFORM_CURVE", "QUASI_UNIFORM_CURVE"];
        let implied = kinds.into_iter().find(|k| self.find(number, k).is_some());
        let stated = self.find(number, "B_SPLINE_CURVE_WITH_KNOTS");
        if stated.is_none() && implied.is_none() {
            return Err(other());
        }
        let degree = base.whole(shift)?;
        let points = self.points(base.list(shift + 1)?, &base)?;
        let knots = match (stated, implied) {
            (Some(stated), _) => {
                let skipped = if shift == 0 { 0 } else { 6 };
                let counts = stated.wholes(skipped)?;
                expanded(
                    &stated.numbers(skipped + 1)?,
                    &counts,
                    &stated,
                    points.len(),
                    degree,
                )?
            }
            (None, kind) => implied_knots(kind.unwrap_or(""), points.len(), degree, &base)?,
        };
        let weights = match self.find(number, "RATIONAL_B_SPLINE_CURVE") {
            Some(rational) => Some(rational.numbers(0)?),
            None => None,
        };
        let spline = NurbsCurve::new(degree, knots, &points, weights.as_deref());
        let spline = spline.map_err(|e| plain.wrong(&e.to_string()))?;
        Ok(CadCurve::Nurbs(Arc::new(spline)))
    }
}

/// Repeats knots as often as they count; the sum of the counts must fit the control points, so that
/// a count cannot exhaust the memory.
pub(super) fn expanded(
    values: &[f64],
    counts: &[usize],
    given: &RecordArguments,
    controls: usize,
    degree: usize,
) -> Result<Vec<f64>> {
    let total = counts.iter().try_fold(0usize, |a, b| a.checked_add(*b));
    let wanted = degree.checked_add(controls).and_then(|n| n.checked_add(1));
    if degree > MAX_DEGREE || values.len() != counts.len() || total != wanted || total.is_none() {
        let problem = "the numbers of knots, of control points and the degree do not agree";
        return Err(given.wrong(problem));
    }
    let each = values.iter().zip(counts);
    Ok(each
        .flat_map(|(t, n)| std::iter::repeat_n(*t, *n))
        .collect())
}

/// Returns the knots that a kind of splines has without stating them.
pub(super) fn implied_knots(
    kind: &str,
    controls: usize,
    degree: usize,
    given: &RecordArguments,
) -> Result<Vec<f64>> {
    let is_valid = (1..=MAX_DEGREE).contains(&degree) && controls > degree;
    let pieces = controls.saturating_sub(1) / degree.max(1);
    if !is_valid || (kind.starts_with("BEZIER") && pieces * degree + 1 != controls) {
        return Err(given.wrong("the number of control points and the degree do not agree"));
    }
    let total = controls + degree + 1;
    let knot = |i: usize| -> f64 {
        if kind.starts_with("BEZIER") {
            (i.saturating_sub(1) / degree).min(pieces) as f64
        } else if kind.starts_with("QUASI") {
            (i.max(degree) - degree).min(controls - degree) as f64
        } else {
            i as f64 - degree as f64
        }
    };
    Ok((0..total).map(knot).collect())
}

/// Returns the weights of rows, one after another.
pub(super) fn all_numbers(rows: &[Value], given: &RecordArguments) -> Result<Vec<f64>> {
    let rows: Option<Vec<Vec<f64>>> = rows.iter().map(numbers).collect();
    let rows = rows.ok_or_else(|| given.wrong("rows of numbers are expected"))?;
    Ok(rows.concat())
}
