//! Files whose functions are terms of programs: `mesh("part.stl")`, `surface("scan.json")`.

use crate::context::Context;
use crate::failure::Failure;
use crate::{disk, scan, spline};
use isoform::field::Imported;
use isoform::field::hyperfun::{FileKind, FileTerm, Model};
use isoform::spline::SampleError;
use isoform::{Control, MeshDistanceError, mesh_distance};
use serde_json::Value;
use std::path::{Path, PathBuf, absolute};
use std::sync::Arc;

/// Reads the files that a program names, whose functions are terms of it, and returns warnings.
/// Relative names start at the folder of the program, which need not be a file.
///
/// # Errors
/// [`Failure`] for files that are missing or have no function.
pub fn read_terms(
    model: &mut Model,
    program: &Path,
    control: &Control,
) -> Result<Vec<String>, Failure> {
    let mut warnings = Vec::new();
    for k in 0..model.files().len() {
        let term = model.files()[k].clone();
        let path = file_of(&term, program);
        let function = function(&term, &path, control, &mut warnings).map_err(|failure| {
            if !failure.why.is_empty() {
                return failure;
            }
            let (name, program) = (term.kind.name(), program.display());
            failure.why(format!("`{name}` in {program} names it"))
        })?;
        let found = absolute(&path).ok();
        let found = found.and_then(|path| path.to_str().map(str::to_owned));
        model.set_file(k, function, found);
    }
    Ok(warnings)
}

/// Reads the files that a program of a run names, none of which may be written.
pub(crate) fn read(model: &mut Model, program: &Path, context: &Context) -> Result<(), Failure> {
    for term in model.files() {
        context.inputs.check_named(&file_of(term, program))?;
    }
    for warning in read_terms(model, program, &context.control())? {
        context.warn(warning);
    }
    Ok(())
}

/// Returns the path of a file that a program names.
fn file_of(term: &FileTerm, program: &Path) -> PathBuf {
    let folder = program.parent().map_or_else(PathBuf::new, Path::to_owned);
    folder.join(&term.path)
}

/// Returns the program whose value was typed in place of a file, if the text calls the function of a
/// file: `mesh("part.stl") - 0.5`.
pub(crate) fn program(text: &str) -> Option<String> {
    let compact: String = text.split_whitespace().collect();
    let calls = |kind: FileKind| compact.contains(&format!("{}(", kind.name()));
    let is_typed = compact.contains('"') && !compact.contains(['{', ';']);
    let is_term = is_typed && [FileKind::Mesh, FileKind::Surface].into_iter().any(calls);
    is_term.then(|| format!("my_model(x[3], a[1]) {{\n  my_model = {text};\n}}\n"))
}

/// Returns the function of a file.
fn function(
    term: &FileTerm,
    path: &Path,
    control: &Control,
    warnings: &mut Vec<String>,
) -> Result<Imported, Failure> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    match term.kind {
        FileKind::Mesh => {
            let (mesh, report) = scan::read_mesh_file(path, None)?;
            let said = report.warnings.iter();
            warnings.extend(said.map(|warning| format!("{}: {warning}", path.display())));
            let distance = mesh_distance(&mesh, term.accuracy, control);
            let distance = distance.map_err(|e| unmade(path, e))?;
            Ok(Imported::new(&stem, Arc::new(distance)))
        }
        FileKind::Surface => {
            let text = disk::text(disk::read_file(path)?);
            let json: Value = serde_json::from_str(&text).map_err(|e| {
                Failure::input("json", format!("{}: not JSON: {e}", path.display()))
            })?;
            let function = spline::of_document(path, &json)?;
            Ok(Imported::new(&stem, Arc::new(function)))
        }
    }
}

/// Returns the failure of a mesh without a signed distance.
fn unmade(path: &Path, error: MeshDistanceError) -> Failure {
    let message = format!("{}: {error}", path.display());
    match error {
        MeshDistanceError::Sampled(SampleError::Stopped) => Failure::stopped(message, ""),
        MeshDistanceError::Sampled(_) => {
            Failure::input("accuracy", message).hint("a larger accuracy, after the file's name")
        }
        MeshDistanceError::Crossing => Failure::input("crossing-mesh", message)
            .hint("repair the mesh; isoform inspect says more, and slivers count as such, too"),
        MeshDistanceError::Open => Failure::input("open-mesh", message)
            .hint("isoform implicitize makes a closed function of points; surface(...) reads it"),
        _ => Failure::input("empty", message),
    }
}
