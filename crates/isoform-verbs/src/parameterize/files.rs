//! The files of patches: JSON, STEP, triangles.

use super::{Args, MadePatches, document};
use crate::disk;
use crate::failure::Failure;
use crate::mesh::files as meshes;
use crate::scan;
use crate::watchdog::Writing;
use isoform::geom::{Field, Mesh};
use isoform::io::{MeshWriteOptions, StepOptions, write_mesh_path, write_step_path};
use isoform::{patch_mesh, step_faces};
use std::path::Path;

/// Output path of patches with its format.
pub(super) enum PatchTarget<'a> {
    /// The document on stdout.
    Stdout,
    /// The document of the patches.
    Json(&'a Path),
    /// Faces for CAD.
    Step(&'a Path),
    /// A mesh of the patches.
    Triangles(&'a Path),
}

/// Finds out before the work whether every file can be written.
pub(super) fn targets(paths: &[impl AsRef<Path>]) -> Result<Vec<PatchTarget<'_>>, Failure> {
    paths.iter().map(|path| target(path.as_ref())).collect()
}

/// Returns the format of an output path.
fn target(path: &Path) -> Result<PatchTarget<'_>, Failure> {
    if path == Path::new("-") {
        return Ok(PatchTarget::Stdout);
    }
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    let target = match ending.to_ascii_lowercase().as_str() {
        "json" => PatchTarget::Json(path),
        "step" | "stp" => PatchTarget::Step(path),
        _ if meshes::is_mesh(path) => PatchTarget::Triangles(path),
        _ => return Err(unknown_ending(path)),
    };
    disk::check_folder(path)?;
    Ok(target)
}

/// The failure of a name whose ending no format of patches has.
fn unknown_ending(path: &Path) -> Failure {
    let path = path.display();
    let why = format!(
        "patches are written as json and step, and their triangles as {}",
        meshes::formats()
    );
    Failure::usage(format!("{path}: patches are not written with this ending"))
        .why(why)
        .hint("a name that ends in .json, .step, .obj, .ply or .glb")
}

/// Writes all files; gives back what is for stdout.
pub(super) fn write(
    made: &mut MadePatches,
    field: &dyn Field,
    targets: &[PatchTarget<'_>],
    args: &Args,
) -> Result<Vec<u8>, Failure> {
    let _writing = Writing::new();
    let (mut stdout, mut mesh) = (Vec::new(), None);
    for target in targets {
        let path = match target {
            PatchTarget::Stdout => {
                stdout = document::patches(made);
                continue;
            }
            PatchTarget::Json(path) => {
                disk::write_file(path, &document::patches(made))?;
                path
            }
            PatchTarget::Step(path) => {
                write_step(made, field, path, args.units.clone())?;
                path
            }
            PatchTarget::Triangles(path) => {
                let mesh = mesh.get_or_insert_with(|| {
                    patch_mesh(field, &made.patches, usize::from(args.grid))
                });
                let warnings = write_triangles(mesh, path, args.units.clone())?;
                made.warnings.extend(warnings);
                path
            }
        };
        made.written.push(path.display().to_string());
    }
    Ok(stdout)
}

/// Writes STEP, a face per patch; the product has the name of the model's file.
fn write_step(
    made: &MadePatches,
    field: &dyn Field,
    path: &Path,
    units: Option<String>,
) -> Result<(), Failure> {
    let model = Path::new(&made.name).file_stem().unwrap_or_default();
    let options = StepOptions {
        units,
        name: model.to_string_lossy().into_owned(),
        time: None,
    };
    write_step_path(&step_faces(field, &made.patches), path, &options)
        .map_err(|e| scan::unwritable(&e))
}

/// Writes the triangles; what the format cannot hold is warned of.
fn write_triangles(
    mesh: &Mesh,
    path: &Path,
    units: Option<String>,
) -> Result<Vec<String>, Failure> {
    let options = MeshWriteOptions {
        units,
        ..MeshWriteOptions::default()
    };
    let report =
        write_mesh_path(mesh, path, None, &options).map_err(|e| scan::unwritable_mesh(&e))?;
    let warnings = report.warnings.into_iter();
    Ok(warnings
        .map(|w| format!("{}: {w}", path.display()))
        .collect())
}
