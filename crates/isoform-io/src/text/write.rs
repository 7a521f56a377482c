//! Writers of XYZ and CSV: a line of names, then a line per point.

use crate::WriteOptions;
use crate::columns::{column_names, row};
use isoform_geom::PointCloud;
use std::io::{self, Write};

/// Writes lines of numbers separated by blanks, after a `#` line with their names.
pub(crate) fn write_xyz(
    cloud: &PointCloud,
    out: &mut dyn Write,
    options: &WriteOptions,
) -> io::Result<()> {
    if let Some(units) = &options.units {
        writeln!(out, "# units: {}", units.replace(['\n', '\r'], " "))?;
    }
    write!(out, "# ")?;
    lines(cloud, out, ' ')
}

/// Writes comma-separated values after a line with their names.
pub(crate) fn write_csv(
    cloud: &PointCloud,
    out: &mut dyn Write,
    _: &WriteOptions,
) -> io::Result<()> {
    lines(cloud, out, ',')
}

/// Writes a line of names and a line per point.
fn lines(cloud: &PointCloud, out: &mut dyn Write, separator: char) -> io::Result<()> {
    let names = column_names(cloud);
    writeln!(out, "{}", names.all().join(&separator.to_string()))?;
    let mut line = Vec::new();
    for i in 0..cloud.points.len() {
        row(out, separator as u8, cloud, i, &mut line)?;
    }
    Ok(())
}
