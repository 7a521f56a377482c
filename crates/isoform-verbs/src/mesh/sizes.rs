//! Edge lengths by place, from a table or a program.

use crate::arguments;
use crate::context::Context;
use crate::disk;
use crate::failure::Failure;
use crate::language::Language;
use crate::model;
use crate::parameters::{self, Given};
use isoform::field::RunField;
use isoform::geom::{Field, Point3};
use isoform::mesh::Sizes;
use std::path::Path;
use std::sync::Arc;

/// Maximum growth of edge lengths per unit of distance from a sample.
const GROWTH: f64 = 0.5;

/// A point and the length of edges there.
type Sample = (Point3, f64);

/// Reads the file: a HyperFun program if it ends in .hf, else a table of x, y, z and the length
/// there.
pub(crate) fn read(path: &Path, context: &Context) -> Result<Sizes, Failure> {
    if path.extension().is_some_and(|e| e == "hf") {
        return program(path, context);
    }
    let text = disk::text(disk::read_file(path)?);
    let samples = samples(path, &text)?;
    if samples.is_empty() {
        return Err(
            Failure::input("sizes", format!("{} holds no sizes", path.display()))
                .hint("lines of x,y,z,length"),
        );
    }
    Ok(Sizes::nearest(&samples, GROWTH))
}

/// The values of a program are the lengths.
fn program(path: &Path, context: &Context) -> Result<Sizes, Failure> {
    let model = model::read(path, &Language::default(), context)?.into_written(path)?;
    let a = parameters::values(&model, &Given::default(), context)?;
    let field = RunField::new(&model, &a)
        .map_err(|e| Failure::input("model", format!("{}: {e}", path.display())))?;
    Ok(Sizes(Arc::new(move |p| field.value(p))))
}

/// Reads a table. Empty lines and comments are passed over, and a first line of words, which is a
/// header.
fn samples(path: &Path, text: &str) -> Result<Vec<Sample>, Failure> {
    let is_header = |i: usize, row: &str| i == 0 && row.starts_with(char::is_alphabetic);
    let rows = text.lines().map(str::trim).enumerate();
    rows.filter(|(i, row)| !row.is_empty() && !row.starts_with('#') && !is_header(*i, row))
        .map(|(i, row)| {
            sample(row).ok_or_else(|| {
                Failure::input("sizes", "x,y,z and a positive length are expected").at(
                    path,
                    i + 1,
                    1,
                )
            })
        })
        .collect()
}

/// A line of four numbers, the last of which is positive.
fn sample(row: &str) -> Option<Sample> {
    match arguments::numbers(row).as_deref() {
        Ok(&[x, y, z, h]) if h > 0.0 && [x, y, z, h].iter().all(|v| v.is_finite()) => {
            Some(([x, y, z], h))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_of_sizes() {
        let read = |text: &str| samples(Path::new("p"), text);
        let table = read("x,y,z,h\n# c\n\n1,2,3,0.5\n -1, 0, 0, 2 \n");
        let table = table.unwrap_or_else(|e| panic!("{}", e.message));
        assert_eq!(table, [([1.0, 2.0, 3.0], 0.5), ([-1.0, 0.0, 0.0], 2.0)]);
        // Lines count from 1, those that hold no sample too.
        for (bad, line) in [("1,2,3", 1), ("# c\n1,2,3,0", 2), ("1,2,3,1\nx,y,z,h", 2)] {
            let e = read(bad).err().unwrap_or_else(|| panic!("{bad} was read"));
            assert_eq!(e.place.line, Some(line), "{bad}");
        }
    }
}
