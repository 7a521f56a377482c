//! Files of solids: STEP of any program, and our own form without loss (.brep.json).

use crate::context::Context;
use crate::disk;
use crate::failure::{Failure, NO_RESULT};
use crate::fit::table::millimetres;
use crate::kind::{self, SolidKind, is_json, is_solid, solid_kind};
use crate::memory::{self, Object};
use crate::product::Statement;
use crate::scan;
use crate::watchdog::Writing;
use isoform::brep::{FacetOptions, FacetsError};
use isoform::cad::{PreparedShape, ShapeError};
use isoform::geom::Aabb;
use isoform::io::{
    ShapeFile, SolidFile, SolidOptions, StepContent, StepOptions, is_solid_file, read_solids,
    read_step, step_solids, write_solids, write_step_solids,
};
use isoform::report::brief;
use isoform::{ExactSolid, ModelBrep, solid_gap};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Refuses names and formats of solids for a verb that makes none, with the one that does.
pub(crate) fn refuse(
    paths: &[PathBuf],
    to: Option<&str>,
    hint: impl Fn(&str) -> String,
) -> Result<(), Failure> {
    let named = to.map(|to| PathBuf::from(format!("part.{to}")));
    let Some(path) = named.iter().chain(paths).find(|p| is_solid(p)) else {
        return Ok(());
    };
    let path = path.display().to_string();
    let failure = Failure::usage(format!("{path}: this verb does not write solids"));
    Err(failure.hint(hint(&path)))
}

/// Finds out before the work whether every file can be written.
pub(crate) fn check(paths: &[PathBuf]) -> Result<(), Failure> {
    for path in paths.iter().filter(|p| *p != Path::new("-")) {
        if !is_solid(path) {
            let path = path.display();
            let message = format!("{path}: solids are not written with this ending");
            let hint = "a name that ends in .step, .stp or .brep.json";
            return Err(Failure::usage(message).hint(hint));
        }
        disk::check_folder(path)?;
    }
    Ok(())
}

/// Warns of STEP files whose coordinates have a rounding step above the tolerance of CAD kernels,
/// which then take the inside of a solid for its outside.
fn warn_of_distance(made: &ModelBrep, paths: &[PathBuf], said: &Statement, context: &Context) {
    let unit = said.unit.as_deref().and_then(millimetres).unwrap_or(1.0);
    let coordinates = made.built.brep.vertices.iter().flatten();
    let farthest = unit * coordinates.fold(0.0, |far: f64, v| far.max(v.abs()));
    let is_step = |path: &PathBuf| path == Path::new("-") || kind::is_step(path);
    // Kernels join points to 1e-7 mm.
    if farthest * f64::EPSILON > 1e-7 && paths.iter().any(is_step) {
        context.warn(format_args!(
            "coordinates are as large as {} km: CAD programs may read the solid inside out; \
             recover has --frame part",
            brief(1e-6 * farthest)
        ));
    }
}

/// Writes all files; gives back their names, and what is for stdout (STEP).
pub(crate) fn write(
    made: &ModelBrep,
    paths: &[PathBuf],
    said: &Statement,
    model: &str,
    context: &Context,
) -> Result<(Vec<String>, Vec<u8>), Failure> {
    if !made.is_closed() {
        let failure = Failure::new(NO_RESULT, "open", format!("{model}: a shell is not closed"));
        return Err(failure.hint("a smaller --size"));
    }
    warn_of_distance(made, paths, said, context);
    let properties = made.properties();
    let options = SolidOptions {
        step: StepOptions {
            units: said.unit.clone(),
            name: said.name.clone(),
            time: None,
        },
        ap214: said.ap214,
    };
    let _writing = Writing::new();
    let (mut files, mut stdout) = (Vec::new(), Vec::new());
    let brep = &made.built.brep;
    for path in paths {
        if path == Path::new("-") {
            let text = step_solids(brep, &properties, &options);
            stdout = text.map_err(|e| scan::unwritable(&e))?.into_bytes();
            continue;
        }
        if solid_kind(path) == Some(SolidKind::Own) {
            let file = SolidFile {
                brep: brep.clone(),
                name: said.name.clone(),
                unit: said.unit.clone(),
                properties,
            };
            disk::write_file(path, &write_solids(&file))?;
        } else {
            write_step_solids(brep, &properties, path, &options)
                .map_err(|e| scan::unwritable(&e))?;
        }
        files.push(path.display().to_string());
    }
    Ok((files, stdout))
}

/// Maximum distance of edges from their faces without a warning, in diagonals of the box of the
/// vertices: ten times that of splines in files that Isoform writes.
const LOOSE: f64 = 1e-5;

/// The solids of a file with their triangles, as fine as `options` say. Edges that leave their
/// faces are warned of: figures are worth no more than these agree.
pub(crate) fn divided(
    path: &Path,
    file: SolidFile,
    options: Option<FacetOptions>,
    context: &Context,
) -> Result<ExactSolid, Failure> {
    let name = path.display();
    let gap = solid_gap(&file.brep);
    let size = Aabb::from_points(&file.brep.vertices).diagonal();
    if gap > LOOSE * size.max(10.0 * file.properties.gap) {
        context.warn(format_args!(
            "{name}: edges are up to {gap:.1e} away from their faces"
        ));
    }
    ExactSolid::new(file.brep, options, &context.control()).map_err(|e| match e {
        FacetsError::Stopped => Failure::stopped(e.to_string(), ""),
        e => Failure::new(NO_RESULT, "not-closed", format!("{name}: {e}")),
    })
}

/// The shape of a STEP file with its triangles, as fine as `options` say. Items that are left out
/// and edges that leave their faces are warned of.
pub(crate) fn prepared(
    path: &Path,
    file: &mut ShapeFile,
    options: Option<FacetOptions>,
    context: &Context,
) -> Result<PreparedShape, Failure> {
    let name = path.display();
    for remark in &file.remarks {
        context.warn(format_args!("{name}: {remark}"));
    }
    let options = options.map(|o| isoform::cad::FacetOptions {
        chord: o.chord,
        longest: o.longest,
    });
    let shape = std::mem::take(&mut file.shape);
    let shape = PreparedShape::new(shape, options, &context.control());
    let shape = shape.map_err(|e| match e {
        ShapeError::Stopped => Failure::stopped(e.to_string(), ""),
        e => Failure::new(NO_RESULT, "not-closed", format!("{name}: {e}")),
    })?;
    let gap = shape.gap();
    if gap > LOOSE * shape.bounds().diagonal() {
        context.warn(format_args!(
            "{name}: edges are up to {gap:.1e} away from their faces"
        ));
    }
    Ok(shape)
}

/// Solids and surfaces of a file.
pub(crate) enum FoundSolids {
    /// Solids of this program.
    Own(Box<SolidFile>),
    /// Shape of a STEP file of any program.
    Shape(Box<ShapeFile>),
}

/// Reads the solids of a file; `None` if its name or its content is that of another kind.
pub(crate) fn find(path: &Path) -> Result<Option<FoundSolids>, Failure> {
    let unreadable = |code, e: isoform::io::SolidFileError| {
        Failure::input(code, format!("{}: {e}", path.display()))
    };
    if memory::find(path).is_some_and(|object| !matches!(object, Object::Bytes { .. })) {
        return Ok(None);
    }
    if solid_kind(path) == Some(SolidKind::Step) {
        let text = disk::text(disk::read_file(path)?);
        let read = read_step(&text).map_err(|e| {
            unreadable("step", e).hint("a STEP file of solids or surfaces: AP203, AP214 or AP242")
        });
        return read.map(|content| {
            Some(match content {
                StepContent::Own(file) => FoundSolids::Own(file),
                StepContent::Shape(file) => FoundSolids::Shape(file),
            })
        });
    }
    if !is_json(path) {
        return Ok(None);
    }
    let json = disk::text(disk::read_file(path)?);
    let json: Option<Value> = serde_json::from_str(&json).ok();
    let is_named = solid_kind(path) == Some(SolidKind::Own);
    match json {
        Some(json) if is_solid_file(&json) || is_named => read_solids(&json)
            .map(|file| Some(FoundSolids::Own(Box::new(file))))
            .map_err(|e| unreadable("solids", e).hint("isoform brep writes such files")),
        None if is_named => Err(Failure::input(
            "json",
            format!("{}: not JSON", path.display()),
        )),
        _ => Ok(None),
    }
}
