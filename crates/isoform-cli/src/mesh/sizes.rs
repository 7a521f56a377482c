//! Edge lengths by place, from a table or a program.

use crate::eval;
use crate::model::{self, Language};
use crate::output::{self, Context, Failure};
use isoform::field::RunField;
use isoform::geom::{Field, Point3};
use isoform::mesh::Sizes;
use std::path::Path;
use std::sync::Arc;

/// By how much lengths may grow per length of way from a sample.
const GROWTH: f64 = 0.5;

/// Reads the file: a HyperFun program if it ends in .hf, else a table of x, y, z and the length
/// there.
pub(crate) fn read(path: &Path, context: &Context) -> Result<Sizes, Failure> {
    if path.extension().is_some_and(|e| e == "hf") {
        let model = model::read(path, &Language::default(), context)?;
        let a = eval::values(&model, &[])?;
        let field = RunField::new(&model, &a)
            .map_err(|e| Failure::input("model", format!("{}: {e}", path.display())))?;
        return Ok(Sizes(Arc::new(move |p| field.value(p))));
    }
    let text = output::text(output::read_file(path)?);
    let mut samples: Vec<(Point3, f64)> = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let row = line.trim();
        // A first line of words is a header.
        if row.is_empty()
            || row.starts_with('#')
            || (i == 0 && row.starts_with(|c: char| c.is_alphabetic()))
        {
            continue;
        }
        match output::numbers(row).as_deref() {
            Ok(&[x, y, z, h]) if h > 0.0 && [x, y, z, h].iter().all(|v| v.is_finite()) => {
                samples.push(([x, y, z], h))
            }
            _ => {
                return Err(
                    Failure::input("sizes", "x,y,z and a positive length are expected").at(
                        path,
                        i + 1,
                        1,
                    ),
                );
            }
        }
    }
    if samples.is_empty() {
        return Err(
            Failure::input("sizes", format!("{} holds no sizes", path.display()))
                .hint("lines of x,y,z,length"),
        );
    }
    Ok(Sizes::nearest(&samples, GROWTH))
}
