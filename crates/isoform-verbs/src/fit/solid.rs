//! The solid of a fitted model, for `fit` and `recover`: the way of `isoform brep`, in the fit's
//! unit.
//!
//! Two things are said of it: the verdict of the fit, which tells whether the model is that of the
//! scan, and the certificate of the solid, which tells whether the solid is that of the model.

use super::job::Job;
use crate::brep::{self, MadeSolid, SolidInput};
use crate::context::Context;
use crate::failure::{DONE, Failure};
use crate::kind;
use crate::language;
use crate::language::Language;
use crate::outcome;
use crate::product::Statement;
use crate::solids;
use crate::watchdog;
use isoform::field::hyperfun::Model;
use isoform::geom::Aabb;
use isoform::{MeshModelOptions, parameter_values};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::time::Duration;

/// The fitted program, read like any other, with the values of its parameters.
pub(crate) fn fitted_model(job: &Job, language: &Language) -> Result<(Model, Vec<f64>), Failure> {
    let fitted = language::parse(&job.program(), language);
    let model = fitted.map_err(|e| {
        Failure::internal("fitted program").why(format!("it cannot be read: {}", e.message))
    })?;
    let values = parameter_values::<f64>(&model, &[])
        .map_err(|e| Failure::internal("fitted program").why(e.to_string()))?;
    Ok((model, values))
}

/// The unit of a fit's lengths, if it is known.
pub(crate) fn unit(job: &Job) -> Option<String> {
    Some(job.unit.unit.clone()).filter(|unit| !unit.is_empty())
}

/// Returns the box of the points, in the coordinates in which the fitted model is written.
pub(crate) fn extent(job: &Job) -> Aabb {
    match job.is_own_frame {
        true => job.found.own_extent(),
        false => job.found.extent(),
    }
}

/// Longest time that a solid may take where no --time-limit says another: what has many faces
/// without exact forms goes on for hours. Most parts take seconds.
const LIMIT: Duration = Duration::from_secs(300);

/// Solids to make of a fit, and the settings for them.
pub(crate) struct SolidRequest {
    /// The files.
    pub(crate) paths: Vec<PathBuf>,
    /// True if they were named with -o. Else they are written only where the fit is accepted and
    /// the certificate holds, and count for nothing in the exit code.
    pub(crate) is_asked: bool,
    /// True if those that were named are made of a fit that is in doubt, too.
    pub(crate) is_forced: bool,
    /// Options of the mesh that determines the topology.
    pub(crate) options: MeshModelOptions,
}

/// Result for the document, the table and the exit code.
pub(crate) struct SolidResult {
    /// Exit code: that of the fit, unless the solid that was asked for has a worse one.
    pub(crate) exit: u8,
    /// The key `solid` of the document.
    pub(crate) json: Value,
    /// Lines of the table.
    pub(crate) text: String,
    /// Files that were written.
    pub(crate) files: Vec<String>,
    /// Reason for a missing solid; `None` if one was made or none requested.
    pub(crate) failure: Option<Failure>,
}

impl SolidResult {
    /// Adds the result to the document of the fit.
    pub(crate) fn add_to(&self, json: &mut Value) {
        json["solid"] = self.json.clone();
        if let Some(failure) = &self.failure {
            json["error"] = failure.json();
        }
    }
}

/// Makes the solid of a fit and writes it. The fit's own files stand already: where the solid fails
/// this is said, and they are kept.
pub(crate) fn tell(
    job: &Job,
    language: &Language,
    wanted: &SolidRequest,
    context: &Context,
) -> SolidResult {
    let fit = job.exit();
    if fit != DONE && !(wanted.is_asked && wanted.is_forced) {
        return nothing(fit, "the fit is not accepted", "--force ", wanted, context);
    }
    let limit = context.global.time_limit.is_none().then_some(LIMIT);
    let minutes = |limit: Duration| format!("{} min", limit.as_secs() / 60);
    let may_take = limit.map_or(String::new(), |limit| {
        format!("it may take {}, and ", minutes(limit))
    });
    context.say(format_args!(
        "making the solid of the fitted model: {may_take}Ctrl-C keeps the fit"
    ));
    let made = watchdog::stage("solid of the fitted model", || {
        made(job, language, wanted, limit, context)
    });
    match made {
        Ok(made) if !wanted.is_asked && !made.solid.certificate.holds() => {
            let open = &made.solid.certificate.failures;
            let why = format!("its certificate does not hold: {}", open[0]);
            nothing(fit, &why, "", wanted, context)
        }
        Ok(made) => match written(job, &made, wanted, context) {
            Ok(told) => told,
            Err(failure) => failed(job, failure, context),
        },
        Err(mut failure) => {
            if let Some(limit) = limit.filter(|_| failure.code == "time-limit") {
                failure.why = format!("it took more than {}", minutes(limit));
                failure.hint = "--time-limit 1h, which sets the time of all stages".to_owned();
            }
            match wanted.is_asked {
                true => failed(job, failure, context),
                false => nothing(fit, &failure.message, "", wanted, context),
            }
        }
    }
}

fn made(
    job: &Job,
    language: &Language,
    wanted: &SolidRequest,
    limit: Option<Duration>,
    context: &Context,
) -> Result<MadeSolid, Failure> {
    let (model, values) = fitted_model(job, language)?;
    let subject = SolidInput {
        name: format!("fitted {}", job.template_name),
        model,
        values,
        unit: unit(job),
    };
    let mut control = context.control();
    if let Some(limit) = limit {
        control = control.for_seconds(limit.as_secs_f64());
    }
    let mut options = wanted.options.clone();
    options.mesh.start = extent(job);
    brep::make(subject, &options, None, &control, context)
}

fn written(
    job: &Job,
    made: &MadeSolid,
    wanted: &SolidRequest,
    context: &Context,
) -> Result<SolidResult, Failure> {
    let said = Statement {
        name: job.part_name(),
        ..Statement::named_after(&job.template_name, unit(job))
    };
    let name = format!("fitted {}", job.template_name);
    let (files, _) = solids::write(&made.solid, &wanted.paths, &said, &name, context)?;
    if said.unit.is_none() && wanted.paths.iter().any(|p| kind::is_step(p)) {
        context
            .warn("the unit of the scan is not known: STEP files state mm (--units says another)");
    }
    made.say(context);
    let report = made.report(files.clone());
    let fit = job.exit();
    let verdict = job.found.fit.verdict.as_str();
    Ok(SolidResult {
        exit: if fit == DONE { made.exit() } else { fit },
        json: outcome::json_of(&report),
        text: format!("\nsolid of the fit ({verdict})\n{}", brep::text(&report)),
        files,
        failure: None,
    })
}

/// A solid that was asked for failed.
fn failed(job: &Job, mut failure: Failure, context: &Context) -> SolidResult {
    failure.message = format!(
        "the model was fitted ({}), but there is no solid of it: {}",
        job.found.fit.verdict.as_str(),
        failure.message
    );
    context.complain(&failure);
    SolidResult {
        exit: failure.exit,
        json: json!({"ok": false, "error": failure.json()}),
        text: String::new(),
        files: Vec::new(),
        failure: Some(failure),
    }
}

/// A solid that was not asked for, or is not made without another option, is not written.
fn nothing(
    fit: u8,
    why: &str,
    option: &str,
    wanted: &SolidRequest,
    context: &Context,
) -> SolidResult {
    for path in wanted.paths.iter().filter(|p| p.exists()) {
        let path = path.display();
        context.warn(format_args!(
            "{path} is of an earlier run: no solid was written in this one"
        ));
    }
    let name = match (&wanted.paths[..], wanted.is_asked) {
        ([path, ..], true) => path.display().to_string(),
        _ => "part.step".to_owned(),
    };
    if wanted.is_asked && context.listener.is_some() {
        context.warn(format_args!("no solid was written: {why}"));
    }
    let text = format!("no solid  {why}; {option}-o {name} makes it all the same\n");
    SolidResult {
        exit: fit,
        json: json!({"ok": false, "skipped": why}),
        text,
        files: Vec::new(),
        failure: None,
    }
}
