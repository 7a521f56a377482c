//! Rows of a cloud as text: names and values.

use crate::text::names::has_role;
use isoform_geom::PointCloud;
use std::io::{self, Write};

/// Names of all values of a row, chosen so that reading restores their roles.
pub(crate) struct ColumnNames {
    /// Names of the coordinates.
    pub(crate) positions: [&'static str; 3],
    /// Names of the components of normals; empty without normals.
    pub(crate) normals: Vec<&'static str>,
    /// Names of the colour components; empty without colours.
    pub(crate) colors: Vec<&'static str>,
    /// Distinct names of all other values.
    pub(crate) columns: Vec<String>,
}

impl ColumnNames {
    /// Returns all names in the order of a row: positions, normals, colours, columns.
    pub(crate) fn all(&self) -> Vec<&str> {
        let columns = self.columns.iter().map(String::as_str);
        self.positions
            .iter()
            .chain(&self.normals)
            .chain(&self.colors)
            .copied()
            .chain(columns)
            .collect()
    }
}

/// Returns names for a header. Blanks and separators become `_`; a name that is taken, or that
/// would be read as another role, gets a trailing `_`.
pub(crate) fn column_names(cloud: &PointCloud) -> ColumnNames {
    let mut columns: Vec<String> = Vec::new();
    for column in &cloud.columns {
        let mut name = plain(&column.name);
        while has_role(&name) || columns.contains(&name) {
            name.push('_');
        }
        columns.push(name);
    }
    let three = |are_there: bool, names: [&'static str; 3]| {
        if are_there {
            names.to_vec()
        } else {
            Vec::new()
        }
    };
    ColumnNames {
        positions: ["x", "y", "z"],
        normals: three(!cloud.normals.is_empty(), ["nx", "ny", "nz"]),
        colors: three(!cloud.colors.is_empty(), ["red", "green", "blue"]),
        columns,
    }
}

/// Turns a name into a single word that is not a number.
fn plain(name: &str) -> String {
    let fits = |c: char| c.is_alphanumeric() || "-+.:()[]%^*".contains(c);
    let mut plain: String = name
        .chars()
        .map(|c| if fits(c) { c } else { '_' })
        .collect();
    if plain.is_empty() || crate::input::parse_number(&plain).is_some() {
        plain.insert(0, '_');
    }
    plain
}

/// Formats the values of point `i` as one line of text, with the shortest numbers that read back to
/// the identical f64.
pub(crate) fn row(
    out: &mut dyn Write,
    separator: u8,
    cloud: &PointCloud,
    i: usize,
    line: &mut Vec<u8>,
) -> io::Result<()> {
    line.clear();
    let normal = cloud.normals.get(i).into_iter().flatten();
    for v in cloud.absolute(i).into_iter().chain(normal.copied()) {
        put(line, separator, v)?;
    }
    for &v in cloud.colors.get(i).into_iter().flatten() {
        put(line, separator, f64::from(v))?;
    }
    for column in &cloud.columns {
        put(line, separator, column.values[i])?;
    }
    line.push(b'\n');
    out.write_all(line)
}

/// Appends a number: decimal digits if they are short, otherwise an exponent; in both forms the
/// shortest text that reads back to the identical f64.
fn put(line: &mut Vec<u8>, separator: u8, v: f64) -> io::Result<()> {
    if !line.is_empty() {
        line.push(separator);
    }
    let is_plain = v == 0.0 || !v.is_finite() || (1e-5..1e16).contains(&v.abs());
    if is_plain {
        write!(line, "{v}")
    } else {
        write!(line, "{v:e}")
    }
}
