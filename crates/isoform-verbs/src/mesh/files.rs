//! The files of a mesh.

use super::work::{MadeMesh, Written};
use crate::context::Context;
use crate::disk;
use crate::failure::Failure;
use crate::watchdog::Writing;
use crate::{scan, solids};
use isoform::geom::Mesh;
use isoform::io::{
    MeshWriteOptions, mesh_format_for, mesh_format_named, mesh_formats, write_mesh, write_mesh_path,
};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Output path of a mesh with its format.
pub(crate) struct MeshTarget {
    /// The file, or - for stdout.
    path: PathBuf,
    /// Given with --to, else the ending says.
    format: Option<String>,
}

/// Returns true if a mesh can be written with that name: with its ending, or as a folder.
pub(crate) fn is_mesh(path: &Path) -> bool {
    mesh_format_for(path).is_some()
}

/// Names of the formats that can be written.
pub(crate) fn formats() -> String {
    let names: Vec<&str> = mesh_formats().iter().map(|f| f.name).collect();
    names.join(", ")
}

/// Finds out before the work whether every file can be written.
pub(crate) fn targets(
    paths: &[PathBuf],
    to: Option<&str>,
    context: &Context,
) -> Result<Vec<MeshTarget>, Failure> {
    solids::refuse(paths, to, |path| format!("isoform brep MODEL -o {path}"))?;
    if let Some(name) = to.filter(|name| {
        mesh_format_named(name.trim_end_matches("-ascii").trim_end_matches("-binary")).is_none()
    }) {
        return Err(
            Failure::usage(format!("no format of meshes is called `{name}`"))
                .hint(format!("--to with one of: {}", formats())),
        );
    }
    for path in paths {
        let stdout = path == Path::new("-");
        if stdout && to.is_none() {
            return Err(Failure::usage("stdout has no ending that names a format")
                .hint(format!("--to with one of: {}", formats())));
        }
        if to.is_none() && !is_mesh(path) {
            let failure = Failure::usage(format!(
                "{}: no mesh is written with this ending",
                path.display()
            ));
            return Err(failure.hint(format!("an ending or --to out of: {}", formats())));
        }
        if !stdout {
            disk::check_folder(path)?;
        }
    }
    if paths.is_empty() && to.is_none() {
        context.note("no -o: nothing will be written");
    }
    Ok(paths
        .iter()
        .map(|p| MeshTarget {
            path: p.clone(),
            format: to.map(str::to_owned),
        })
        .collect())
}

/// Writes all files of a model's mesh and notes the time; gives back what is for stdout.
pub(crate) fn write(made: &mut MadeMesh, targets: &[MeshTarget]) -> Result<Vec<u8>, Failure> {
    let started = Instant::now();
    let (written, stdout) =
        write_mesh_files(&made.mesh.meshed.mesh, made.unit.as_deref(), targets)?;
    made.written.extend(written);
    if !targets.is_empty() {
        made.seconds
            .push(("write".to_owned(), started.elapsed().as_secs_f64()));
    }
    Ok(stdout)
}

/// Writes all files of a mesh; gives back what they are and what is for stdout.
pub(crate) fn write_mesh_files(
    mesh: &Mesh,
    unit: Option<&str>,
    targets: &[MeshTarget],
) -> Result<(Vec<Written>, Vec<u8>), Failure> {
    let options = MeshWriteOptions {
        units: unit.map(str::to_owned),
        ..MeshWriteOptions::default()
    };
    let _writing = Writing::new();
    let (mut written, mut stdout) = (Vec::new(), Vec::new());
    for MeshTarget { path, format } in targets {
        let report = if path == Path::new("-") {
            write_mesh(
                mesh,
                &mut stdout,
                format.as_deref().unwrap_or_default(),
                &options,
            )
        } else {
            write_mesh_path(mesh, path, format.as_deref(), &options)
        };
        let report = report.map_err(|e| scan::unwritable_mesh(&e))?;
        written.push(Written {
            path: path.display().to_string(),
            format: report.format,
            warnings: report.warnings,
        });
    }
    Ok((written, stdout))
}
