//! Functions of files.

use super::{Call, FormulaError, Outcome};
use crate::hyperfun::machine::Machine;
use crate::library::Native;

/// Returns the function of the file in argument 1 at the point in argument 0.
pub(super) fn value<'c, M: Machine>(c: &mut Call<'c, M>) -> Outcome<'c, M> {
    let file = c.file(1);
    let Some(function) = &file.function else {
        return Err(FormulaError {
            message: format!("the file {} has not been read", file.path),
            unknown: false,
        });
    };
    let [x, y, z] = c.point(0);
    Ok(x.native(Native::Imported(function.clone()), &[&y, &z]))
}
