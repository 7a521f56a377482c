//! The files of patches: JSON, STEP, triangles.

use super::{Args, Made, document};
use crate::mesh::files as meshes;
use crate::output::{self, Failure};
use crate::scan;
use crate::watchdog::Writing;
use isoform::geom::Field;
use isoform::io::{MeshWriteOptions, StepOptions, write_mesh_path, write_step_path};
use isoform::{patch_mesh, step_faces};
use std::path::Path;

/// Where patches go, and as what.
pub(super) enum Target<'a> {
    Stdout,
    Json(&'a Path),
    Step(&'a Path),
    Triangles(&'a Path),
}

/// Finds out before the work whether every file can be written.
pub(super) fn targets(paths: &[impl AsRef<Path>]) -> Result<Vec<Target<'_>>, Failure> {
    let mut targets = Vec::new();
    for path in paths.iter().map(AsRef::as_ref) {
        if path == Path::new("-") {
            targets.push(Target::Stdout);
            continue;
        }
        let ending = path
            .extension()
            .unwrap_or_default()
            .to_string_lossy()
            .to_ascii_lowercase();
        targets.push(match ending.as_str() {
            "json" => Target::Json(path),
            "step" | "stp" => Target::Step(path),
            _ if meshes::is_mesh(path) => Target::Triangles(path),
            _ => {
                let failure = Failure::usage(format!(
                    "{}: patches are not written with this ending",
                    path.display()
                ));
                let why = format!(
                    "patches are written as json and step, and their triangles as {}",
                    meshes::formats()
                );
                return Err(failure
                    .why(why)
                    .hint("a name that ends in .json, .step, .obj, .ply or .glb"));
            }
        });
        output::check_folder(path)?;
    }
    Ok(targets)
}

/// Writes all files; gives back what is for stdout.
pub(super) fn write(
    made: &mut Made,
    field: &dyn Field,
    targets: &[Target<'_>],
    args: &Args,
) -> Result<Vec<u8>, Failure> {
    let _writing = Writing::new();
    let (mut stdout, mut mesh) = (Vec::new(), None);
    for target in targets {
        let path = match target {
            Target::Stdout => {
                stdout = document::patches(made);
                continue;
            }
            Target::Json(path) => {
                output::write_file(path, &document::patches(made))?;
                path
            }
            Target::Step(path) => {
                let name = Path::new(&made.name)
                    .file_stem()
                    .unwrap_or_default()
                    .to_string_lossy()
                    .into_owned();
                let options = StepOptions {
                    units: args.units.clone(),
                    name,
                    time: None,
                };
                write_step_path(&step_faces(field, &made.patches), path, &options)
                    .map_err(|e| scan::unwritable(&e))?;
                path
            }
            Target::Triangles(path) => {
                let mesh = mesh.get_or_insert_with(|| {
                    patch_mesh(field, &made.patches, usize::from(args.grid))
                });
                let options = MeshWriteOptions {
                    units: args.units.clone(),
                    ..MeshWriteOptions::default()
                };
                let report = write_mesh_path(mesh, path, None, &options)
                    .map_err(|e| scan::unwritable_mesh(&e))?;
                let told = report
                    .warnings
                    .into_iter()
                    .map(|w| format!("{}: {w}", path.display()));
                made.warnings.extend(told);
                path
            }
        };
        made.written.push(path.display().to_string());
    }
    Ok(stdout)
}
