//! Writer of PLY for clouds: coordinates, normals and columns as doubles, colours as bytes,
//! triangles as lists of three.

use crate::WriteOptions;
use crate::columns::{ColumnNames, column_names, row};
use isoform_geom::PointCloud;
use std::io::{self, Write};

/// Writes all data of a cloud, with absolute coordinates: binary little endian, or ASCII with the
/// shortest numbers that read back identically.
pub(crate) fn write(
    cloud: &PointCloud,
    out: &mut dyn Write,
    options: &WriteOptions,
) -> io::Result<()> {
    write_header(cloud, out, options)?;
    let mut bytes = Vec::new();
    for i in 0..cloud.points.len() {
        if options.ascii {
            row(out, b' ', cloud, i, &mut bytes)?;
        } else {
            binary_row(cloud, i, &mut bytes);
            out.write_all(&bytes)?;
        }
    }
    for t in &cloud.triangles {
        if options.ascii {
            writeln!(out, "3 {} {} {}", t[0], t[1], t[2])?;
        } else {
            bytes.clear();
            bytes.push(3);
            t.iter()
                .for_each(|c| bytes.extend_from_slice(&c.to_le_bytes()));
            out.write_all(&bytes)?;
        }
    }
    Ok(())
}

/// Writes the header: encoding, unit, elements.
fn write_header(cloud: &PointCloud, out: &mut dyn Write, options: &WriteOptions) -> io::Result<()> {
    let encoding = if options.ascii {
        "ascii"
    } else {
        "binary_little_endian"
    };
    writeln!(out, "ply\nformat {encoding} 1.0")?;
    writeln!(out, "comment written by isoform")?;
    if let Some(units) = &options.units {
        writeln!(out, "comment units: {}", units.replace(['\n', '\r'], " "))?;
    }
    writeln!(out, "element vertex {}", cloud.points.len())?;
    write_properties(&column_names(cloud), out)?;
    if !cloud.triangles.is_empty() {
        writeln!(
            out,
            "element face {}\nproperty list uchar int vertex_indices",
            cloud.triangles.len()
        )?;
    }
    writeln!(out, "end_header")
}

/// Writes the properties of the vertices, in the order of a row.
fn write_properties(names: &ColumnNames, out: &mut dyn Write) -> io::Result<()> {
    for name in names.positions.iter().chain(&names.normals) {
        writeln!(out, "property double {name}")?;
    }
    for name in &names.colors {
        writeln!(out, "property uchar {name}")?;
    }
    for name in &names.columns {
        writeln!(out, "property double {name}")?;
    }
    Ok(())
}

/// Encodes all values of point `i`, in the order of the properties.
fn binary_row(cloud: &PointCloud, i: usize, bytes: &mut Vec<u8>) {
    bytes.clear();
    let put = |v: f64, bytes: &mut Vec<u8>| bytes.extend_from_slice(&v.to_le_bytes());
    cloud.absolute(i).into_iter().for_each(|v| put(v, bytes));
    let normal = cloud.normals.get(i).into_iter().flatten();
    normal.for_each(|&v| put(v, bytes));
    bytes.extend(cloud.colors.get(i).into_iter().flatten());
    cloud.columns.iter().for_each(|c| put(c.values[i], bytes));
}
