//! `fit`: the parameters of a template from points.

use crate::arrays::rows;
use crate::document;
use crate::error::Trouble;
use crate::model::Program;
use crate::points::Cloud;
use crate::run::{self, Asked};
use isoform::field::hyperfun::Pose;
use isoform::fit::{Beside, Local, Loss, Method};
use isoform::io::ReadReport;
use isoform::report::{About, FitReport, loss_name, method_name};
use isoform::{FitOptions, ScanFit, fit_scan};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

/// All methods; reports have their names.
const METHODS: [Method; 5] = [
    Method::Default,
    Method::Hybrid {
        local: Local::Lm,
        threshold: None,
    },
    Method::Local(Local::Lm),
    Method::Local(Local::Bfgs),
    Method::Annealing,
];
/// All losses; reports have their names.
const LOSSES: [Loss; 4] = [Loss::Auto, Loss::Squares, Loss::Cauchy, Loss::Tukey];
/// All poses with their names.
pub(crate) const POSES: [(&str, Pose); 5] = [
    ("none", Pose::None),
    ("translate", Pose::Translate),
    ("axis", Pose::Axis),
    ("rigid", Pose::Rigid),
    ("similarity", Pose::Similarity),
];
/// All kinds of clutter with their names.
const CLUTTER: [(&str, Beside); 3] = [
    ("planes", Beside::Plane),
    ("apart", Beside::Apart),
    ("outliers", Beside::Stray),
];

/// How a scan is fitted, as Python says it.
#[derive(FromPyObject)]
pub(crate) struct Wanted {
    #[pyo3(item)]
    start: Option<Vec<f64>>,
    #[pyo3(item)]
    bounds: Vec<(String, (f64, f64))>,
    #[pyo3(item)]
    fixed: Vec<(String, f64)>,
    #[pyo3(item)]
    pose: Option<String>,
    #[pyo3(item)]
    method: String,
    #[pyo3(item)]
    loss: String,
    #[pyo3(item)]
    keep: Vec<String>,
    #[pyo3(item)]
    seed: u64,
}

impl Wanted {
    /// As the library takes it.
    pub(crate) fn options(self) -> Result<FitOptions, Trouble> {
        let poses = POSES.map(|(name, pose)| (name, Some(pose)));
        let keep = self.keep.iter().map(|k| named("keep", k, CLUTTER));
        let keep = keep.collect::<Result<Vec<_>, _>>()?;
        let pose = self.pose.map(|p| named("pose", &p, poses));
        let mut options = FitOptions {
            start: self.start,
            bounds: self.bounds,
            fixed: self.fixed,
            pose: pose.transpose()?.flatten(),
            ..FitOptions::default()
        };
        let methods = METHODS.map(|m| (method_name(m), m));
        options.fit.method = named("method", &self.method, methods)?;
        options.fit.loss = named("loss", &self.loss, LOSSES.map(|l| (loss_name(l), l)))?;
        options.fit.seed = self.seed;
        options.fit.filter_outliers = !keep.contains(&Beside::Stray);
        options.keep = keep;
        Ok(options)
    }
}

/// The one of that name.
pub(crate) fn named<T, const N: usize>(
    what: &str,
    name: &str,
    all: [(&str, T); N],
) -> Result<T, Trouble> {
    let names = all.each_ref().map(|one| one.0).join(", ");
    let found = all.into_iter().find(|one| one.0 == name);
    found.map(|one| one.1).ok_or_else(|| {
        Trouble::usage(format!("{what} is {name}, which is not known"))
            .hint(format!("one of: {names}"))
    })
}

/// A template fitted to points.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct Fit {
    pub(crate) found: ScanFit,
    document: String,
}

impl Fit {
    /// A fit with its document.
    pub(crate) fn new(found: ScanFit, document: String) -> Self {
        Self { found, document }
    }
}

#[pymethods]
impl Fit {
    /// The document of `fit --json`, as text.
    #[getter]
    fn document(&self) -> &str {
        &self.document
    }
    /// The deviations of the points, positive outside.
    fn deviation<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.found.deviation())
    }
    /// Which points are outliers.
    fn outliers<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<bool>> {
        PyArray1::from_slice(py, &self.found.fit.outliers)
    }
    /// The points that were fitted, those added on the faces of a CAD mesh included.
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let cloud = &self.found.cloud;
        let place = |i| cloud.absolute(i);
        rows(py, (0..cloud.points.len()).map(place).collect())
    }
    /// The fitted program.
    fn program(&self) -> String {
        self.found.program()
    }
}

/// Fits a template to points; the names are for the document.
#[pyfunction]
pub(crate) fn fit(
    py: Python<'_>,
    cloud: Py<Cloud>,
    program: Py<Program>,
    names: (String, String),
    wanted: Wanted,
    asked: Asked<'_>,
) -> PyResult<Fit> {
    let options = wanted.options()?;
    let (seed, method) = (options.fit.seed, options.fit.method);
    let theirs = cloud.clone_ref(py);
    let found = run::run(py, &asked, move |control| {
        let (scan, model) = (&theirs.get().cloud, program.get().model());
        fit_scan(scan, model, &options, control)
    })?;
    let found = found.map_err(Trouble::from)?;
    Ok(reported(found, &cloud.get().report, &names, (method, seed)))
}

/// A fit with its document, as the program writes it, with the names of the points and of the
/// template.
pub(crate) fn reported(
    found: ScanFit,
    read: &ReadReport,
    names: &(String, String),
    (method, seed): (Method, u64),
) -> Fit {
    let unit = found.unit(read, &names.1);
    let warnings = found.all_warnings(read, &unit);
    let about = About {
        verb: "fit",
        scan: &names.0,
        read,
        template: &names.1,
        unit: &unit,
        method,
        seed,
        warnings: &warnings,
        seconds: &found.seconds,
    };
    let document = document::text(&FitReport::new(&found, &about));
    Fit::new(found, document)
}
