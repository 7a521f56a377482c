//! Writer of ISO 10303-21: numbered instances, reals, strings.

use super::knots::ClampedKnots;
use super::placement::AxisPlacement;
use super::spline::{Spline, affine};
use isoform_geom::{Point3, norm, sub};
use std::fmt::Write;

/// Default schema.
pub(super) const AP242: &str =
    "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 1 1 4 }";
/// Column after which lines are broken at the next comma.
const LINE_BREAK_COLUMN: usize = 120;

/// Data section, built instance by instance.
#[derive(Default)]
pub(super) struct StepDocument {
    /// Text of the instances.
    data: String,
    /// Number of instances.
    count: usize,
}

impl StepDocument {
    /// Adds an instance and returns its number.
    pub(super) fn add(&mut self, entity: &str) -> usize {
        self.count += 1;
        let start = self.data.len();
        let _ = write!(self.data, "#{}=", self.count);
        let mut line = self.data.len() - start;
        let mut quoted = false;
        for c in entity.chars() {
            self.data.push(c);
            line += 1;
            quoted ^= c == '\'';
            if c == ',' && !quoted && line > LINE_BREAK_COLUMN {
                self.data.push('\n');
                line = 0;
            }
        }
        self.data.push_str(";\n");
        self.count
    }
    /// Returns the complete file in the default schema.
    pub(super) fn file(&self, name: &str, time: &str) -> String {
        self.file_of(name, time, AP242)
    }
    /// Returns the complete file in a schema.
    pub(super) fn file_of(&self, name: &str, time: &str, schema: &str) -> String {
        let (name, time) = (text(name), text(time));
        format!(
            "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\n\
             FILE_NAME({name},{time},(''),(''),'isoform {version}','isoform','');\n\
             FILE_SCHEMA(('{schema}'));\nENDSEC;\n\
             DATA;\n{data}ENDSEC;\nEND-ISO-10303-21;\n",
            version = env!("CARGO_PKG_VERSION"),
            data = self.data
        )
    }
    /// Adds a point and returns its number.
    pub(super) fn point(&mut self, p: Point3) -> usize {
        self.add(&format!("CARTESIAN_POINT('',{})", reals(&p)))
    }
    /// Adds a direction and returns its number.
    fn direction(&mut self, d: Point3) -> usize {
        self.add(&format!("DIRECTION('',{})", reals(&d)))
    }
    /// Adds the line through two points and returns its number.
    pub(super) fn line(&mut self, from: Point3, to: Point3) -> usize {
        let d = sub(to, from);
        let length = norm(d);
        let (point, direction) = (self.point(from), self.direction(d.map(|v| v / length)));
        let vector = self.add(&format!("VECTOR('',{},1.)", id(direction)));
        self.add(&format!("LINE('',{},{})", id(point), id(vector)))
    }
    /// Adds axes with their origin and returns their number.
    pub(super) fn placement(&mut self, axes: &AxisPlacement) -> usize {
        let (origin, z, x) = (
            self.point(axes.origin),
            self.direction(axes.z),
            self.direction(axes.x),
        );
        self.add(&format!(
            "AXIS2_PLACEMENT_3D('',{},{},{})",
            id(origin),
            id(z),
            id(x)
        ))
    }
    /// Adds an axis, given by a point and its direction, and returns its number.
    pub(super) fn axis(&mut self, origin: Point3, z: Point3) -> usize {
        let (origin, z) = (self.point(origin), self.direction(z));
        self.add(&format!("AXIS1_PLACEMENT('',{},{})", id(origin), id(z)))
    }
    /// Adds a rational B-spline curve.
    pub(super) fn curve(&mut self, control: &[[f64; 4]], knots: &ClampedKnots) -> usize {
        let points: Vec<usize> = control.iter().map(|c| self.point(affine(c))).collect();
        let weights: Vec<f64> = control.iter().map(|c| c[3]).collect();
        self.add(&format!(
            "(BOUNDED_CURVE()B_SPLINE_CURVE({degree},{points},.UNSPECIFIED.,.F.,.F.)\
             B_SPLINE_CURVE_WITH_KNOTS({counts},{values},.UNSPECIFIED.)CURVE()GEOMETRIC_REPRESENTATION_ITEM()\
             RATIONAL_B_SPLINE_CURVE({weights})REPRESENTATION_ITEM(''))",
            degree = knots.degree,
            points = ids(&points),
            counts = integers(&knots.counts()),
            values = reals(&knots.values()),
            weights = reals(&weights)
        ))
    }
    /// Adds a rational B-spline surface.
    pub(super) fn surface(&mut self, spline: &Spline) -> usize {
        let (m, n) = spline.last();
        let (mut points, mut weights) = (Vec::new(), Vec::new());
        for i in 0..=m {
            let row: Vec<usize> = (0..=n)
                .map(|j| self.point(affine(&spline.at(i, j))))
                .collect();
            points.push(ids(&row));
            weights.push(reals(
                &(0..=n).map(|j| spline.at(i, j)[3]).collect::<Vec<_>>(),
            ));
        }
        let (u, v) = (spline.knots(true), spline.knots(false));
        self.add(&format!(
            "(BOUNDED_SURFACE()B_SPLINE_SURFACE({},{},({}),.UNSPECIFIED.,.F.,.F.,.F.)\
             B_SPLINE_SURFACE_WITH_KNOTS({},{},{},{},.UNSPECIFIED.)GEOMETRIC_REPRESENTATION_ITEM()\
             RATIONAL_B_SPLINE_SURFACE(({}))REPRESENTATION_ITEM('')SURFACE())",
            u.degree,
            v.degree,
            points.join(","),
            integers(&u.counts()),
            integers(&v.counts()),
            reals(&u.values()),
            reals(&v.values()),
            weights.join(",")
        ))
    }
}

/// Formats a reference to an instance.
pub(super) fn id(number: usize) -> String {
    format!("#{number}")
}
/// Formats a list of references.
pub(super) fn ids(numbers: &[usize]) -> String {
    list(numbers.iter().map(|n| id(*n)))
}
/// Formats a list of integers.
pub(super) fn integers(numbers: &[usize]) -> String {
    list(numbers.iter().map(usize::to_string))
}
/// Formats a list of reals.
pub(super) fn reals(numbers: &[f64]) -> String {
    list(numbers.iter().map(|v| real(*v)))
}
/// Formats items in parentheses, separated by commas.
fn list(items: impl Iterator<Item = String>) -> String {
    format!("({})", items.collect::<Vec<_>>().join(","))
}
/// Formats a logical value.
pub(super) fn flag(is: bool) -> &'static str {
    if is { ".T." } else { ".F." }
}

/// Formats the shortest real that reads back identically, always with a decimal point and a capital
/// E for the exponent.
pub(super) fn real(v: f64) -> String {
    let mut buffer = zmij::Buffer::new();
    let short = buffer.format(v);
    let (digits, exponent) = short
        .split_once('e')
        .map_or((short, None), |(d, e)| (d, Some(e)));
    let mut text = digits.strip_suffix(".0").unwrap_or(digits).to_owned();
    if !text.contains('.') {
        text.push('.');
    }
    if let Some(exponent) = exponent {
        text.push('E');
        text.push_str(exponent.trim_start_matches('+'));
    }
    text
}

/// Formats a string in quotes: ASCII as is, other characters as UTF-16 (\X2\…\X0\) or UTF-32
/// (\X4\…\X0\) in hexadecimal.
pub(super) fn text(plain: &str) -> String {
    let mut text = String::from("'");
    for c in plain.chars() {
        let _ = match c {
            '\'' => write!(text, "''"),
            '\\' => write!(text, "\\\\"),
            ' '..='~' => write!(text, "{c}"),
            _ if c.is_control() => write!(text, " "),
            _ if (c as u32) < 0x1_0000 => write!(text, "\\X2\\{:04X}\\X0\\", c as u32),
            _ => write!(text, "\\X4\\{:08X}\\X0\\", c as u32),
        };
    }
    text.push('\'');
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn reals_and_strings() {
        let reals = [
            (0.0, "0."),
            (-1.5, "-1.5"),
            (1e-300, "1.E-300"),
            (1.25e22, "1.25E22"),
            (0.1, "0.1"),
        ];
        for (v, expected) in reals {
            assert_eq!(real(v), expected);
        }
        assert_eq!(
            text("it's a\\b é\n😀"),
            "'it''s a\\\\b \\X2\\00E9\\X0\\ \\X4\\0001F600\\X0\\'"
        );
    }

    #[test]
    fn long_lines_are_broken_but_not_in_strings() {
        let mut doc = StepDocument::default();
        doc.add(&format!("X('{}',1,2)", "a,".repeat(200)));
        assert_eq!(doc.data, format!("#1=X('{}',\n1,2);\n", "a,".repeat(200)));
    }

    proptest! {
        #[test]
        fn reals_read_back(v in prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO) {
            let text = real(v);
            let mantissa = text.split('E').next().unwrap_or_default();
            prop_assert!(mantissa.contains('.') && !text.contains('e'), "{}", text);
            prop_assert_eq!(text.parse::<f64>().expect("a number").to_bits(), v.to_bits());
        }
    }
}
