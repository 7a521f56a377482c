//! The JSON document of a fit.

use super::job::Job;
use isoform::fit::{Loss, Method};
use serde_json::{Map, Value, json};

/// Everything that the fit found, in the file's coordinates and unit. All but `seconds` is the same
/// each time.
pub(crate) fn document(job: &Job, verb: &str) -> Value {
    let fit = &job.found.fit;
    let shift = &job.found.template.shift;
    let parameters: Vec<Value> = fit
        .parameters
        .iter()
        .enumerate()
        .map(|(i, p)| {
            json!({
                "name": p.name,
                "index": i + 1,
                "value": p.value + shift[i],
                "sd": p.sd,
                "ci95": p.ci95.map(|(lo, hi)| [lo + shift[i], hi + shift[i]]),
                "status": p.status.as_str(),
                "unit": job.unit_of(i),
                "bounds": [finite(p.bounds.0 + shift[i]), finite(p.bounds.1 + shift[i])],
                "at_bound": at_bound(p.value, p.bounds, p.status),
            })
        })
        .collect();
    let others: Vec<Value> = fit
        .other_minima
        .iter()
        .map(|m| {
            let values: Vec<f64> = m.parameters.iter().zip(shift).map(|(v, s)| v + s).collect();
            json!({"parameters": values, "sum_f2": m.sum_f2, "hits": m.hits})
        })
        .collect();
    let parts: Vec<Value> = fit
        .part_statistics
        .iter()
        .map(|p| json!({"name": p.name, "count": p.count, "rms": p.rms, "mean": 0.0 - p.mean, "max": p.max, "uncovered": p.uncovered}))
        .collect();
    let open: Vec<Value> = fit
        .undetermined
        .iter()
        .map(|o| json!({"parameters": o.parameters, "why": o.why}))
        .collect();
    let pose = job
        .found
        .template
        .frep
        .placement(&job.found.fit.values())
        .map(|p| {
            let t: [f64; 3] = std::array::from_fn(|k| p.translation[k] + job.found.cloud.origin[k]);
            json!({"rotation": p.rotation, "translation": t, "scale": p.scale})
        });
    let unit = Some(&job.unit.unit).filter(|u| !u.is_empty());
    json!({
        "verb": verb,
        "scan": {
            "file": job.scan, "format": job.read.format, "rows": job.read.rows, "dropped": job.read.dropped_points,
            "subsampled": job.read.subsampled, "origin": job.found.cloud.origin,
        },
        "template": {"name": job.template_name, "title": job.found.template.frep.model().info().title, "fits": job.found.template.frep.model().info().fits},
        "units": unit,
        "units_source": job.unit.reason,
        "verdict": fit.verdict.as_str(),
        "acceptable": fit.acceptable,
        "reasons": fit.reasons,
        "evidence": {
            "size": fit.evidence.size,
            "rms_of_all": fit.evidence.rms_of_all,
            "systematic": fit.evidence.systematic,
            "systematic_z": fit.evidence.systematic_z,
            "local_noise": fit.evidence.local_noise,
            "thickness": finite(fit.evidence.thickness),
            "detail": finite(fit.evidence.detail),
            "bare": fit.evidence.bare,
            "overlooked": fit.evidence.overlooked,
            "clustered": fit.evidence.clustered,
            "certain": fit.certain,
        },
        "complete": fit.complete,
        "parameters": parameters,
        "pose": pose,
        "undetermined": open,
        "sum_f2": fit.sum_f2,
        "rms": fit.rms,
        "noise": fit.noise,
        "n_points": fit.n_points,
        "n_used": fit.n_used,
        "n_fitted": fit.n_fitted,
        "n_outliers": fit.n_outliers,
        "n_left_out": fit.n_left_out,
        "two_sided": {
            "data_to_model": {"rms": fit.data_to_model.rms, "p95": fit.data_to_model.p95, "max": fit.data_to_model.max},
            "model_to_data": {
                "p95": finite(fit.model_to_data.p95), "share_uncovered": fit.model_to_data.share_uncovered,
                "uncovered_from": fit.model_to_data.uncovered_from, "samples": fit.model_to_data.samples,
                "share_outside": fit.model_to_data.share_outside,
            },
        },
        "parts": parts,
        "method": method(job.method),
        "loss": loss(fit.loss),
        "starts": fit.starts,
        "hits": fit.hits,
        "evaluations": fit.evaluations,
        "other_minima": others,
        "spacing": fit.spacing,
        "isolated": fit.isolated,
        "neighbour_correlation": fit.neighbour_correlation,
        "warnings": job.warnings,
        "seed": job.seed,
        "seconds": job.seconds.iter().map(|(k, v)| ((*k).to_owned(), json!(v))).collect::<Map<_, _>>(),
    })
}

fn finite(v: f64) -> Option<f64> {
    v.is_finite().then_some(v)
}

/// Which bound a value ran into.
fn at_bound(
    value: f64,
    (lo, hi): (f64, f64),
    status: isoform::fit::Status,
) -> Option<&'static str> {
    (status == isoform::fit::Status::AtBound).then_some(if value - lo < hi - value {
        "lower"
    } else {
        "upper"
    })
}

pub(crate) fn method(method: Method) -> &'static str {
    match method {
        Method::Default => "default",
        Method::Local(isoform::fit::Local::Lm) => "local",
        Method::Local(isoform::fit::Local::Bfgs) => "bfgs",
        Method::Annealing => "annealing",
        Method::Hybrid { .. } => "hybrid",
    }
}

pub(crate) fn loss(loss: Loss) -> &'static str {
    match loss {
        Loss::Auto => "auto",
        Loss::Squares => "squares",
        Loss::Cauchy => "cauchy",
        Loss::Tukey => "tukey",
    }
}
