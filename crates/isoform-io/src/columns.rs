//! Rows of a cloud as text: the names of their values, and their numbers.

use crate::roles::role_named;
use isoform_geom::PointCloud;
use std::io::{self, Write};

/// Names of all values of a row, such that reading gives the same roles again.
pub(crate) struct Names {
    pub(crate) positions: [&'static str; 3],
    pub(crate) normals: Vec<&'static str>,
    pub(crate) colors: Vec<&'static str>,
    pub(crate) columns: Vec<String>,
}

impl Names {
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

/// Names for a header: blanks and separators become `_`; a name that is taken, or would be read as
/// something else, gets a `_` behind it.
pub(crate) fn column_names(cloud: &PointCloud) -> Names {
    let mut columns: Vec<String> = Vec::new();
    for column in &cloud.columns {
        let plain = |c: char| {
            if c.is_alphanumeric() || "-+.:()[]%^*".contains(c) {
                c
            } else {
                '_'
            }
        };
        let mut name: String = column.name.chars().map(plain).collect();
        if name.is_empty() || crate::input::parse_number(&name).is_some() {
            name.insert(0, '_');
        }
        while role_named(&name).is_some() || columns.contains(&name) {
            name.push('_');
        }
        columns.push(name);
    }
    Names {
        positions: ["x", "y", "z"],
        normals: if cloud.normals.is_empty() {
            vec![]
        } else {
            vec!["nx", "ny", "nz"]
        },
        colors: if cloud.colors.is_empty() {
            vec![]
        } else {
            vec!["red", "green", "blue"]
        },
        columns,
    }
}

/// One line of text: shortest numbers that read back as the same f64.
pub(crate) fn row(
    out: &mut dyn Write,
    separator: u8,
    numbers: impl Iterator<Item = f64>,
    color: impl Iterator<Item = u8>,
    extra: impl Iterator<Item = f64>,
    line: &mut Vec<u8>,
) -> io::Result<()> {
    line.clear();
    let number = |line: &mut Vec<u8>, v: f64| {
        if !line.is_empty() {
            line.push(separator);
        }
        // Plain digits where they are short, an exponent otherwise; both are the shortest that read
        // back the same.
        let plain = v == 0.0 || !v.is_finite() || (1e-5..1e16).contains(&v.abs());
        if plain {
            write!(line, "{v}")
        } else {
            write!(line, "{v:e}")
        }
    };
    for v in numbers {
        number(line, v)?;
    }
    for v in color {
        number(line, f64::from(v))?;
    }
    for v in extra {
        number(line, v)?;
    }
    line.push(b'\n');
    out.write_all(line)
}
