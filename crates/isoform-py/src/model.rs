//! HyperFun programs: their parameters, and their values at points.

use crate::arrays::{PointRows, PointsArg, are_finite, not_finite, not_finite_at, rows};
use crate::error::CallError;
use crate::run::{self, CallLimits};
use isoform::field::hyperfun::{Amount, BlockEvaluator, Mode, Model, ParamInfo, Pose};
use isoform::fit::Template;
use isoform::geom::Point3;
use isoform::{ChunkReader, FrepTemplate, parameter_values};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

/// Number of points per task: enough to amortise its start, few enough to balance the threads.
const POINTS_PER_TASK: usize = 2048;
/// Number of points per call of evaluators that use all threads themselves and split large models
/// by parts of the box of the points. Smaller blocks give less to prune by, larger ones delay
/// Ctrl-C.
const POINTS_PER_EVALUATION: usize = 1 << 17;

/// HyperFun program.
#[pyclass(frozen, module = "isoform._isoform")]
pub(crate) struct Program(Arc<CompiledProgram>);

/// Program, compiled at its first evaluation.
struct CompiledProgram {
    model: Arc<Model>,
    template: OnceLock<FrepTemplate>,
    reader: OnceLock<ChunkReader>,
}

impl CompiledProgram {
    /// Returns the compiled readings of the program, without a pose.
    fn template(&self) -> Result<&FrepTemplate, CallError> {
        if let Some(template) = self.template.get() {
            return Ok(template);
        }
        let made = FrepTemplate::with_pose(&self.model, Pose::None, &[])?;
        Ok(self.template.get_or_init(|| made))
    }
}

/// Name, kind, lower and upper bound, start value, unit and description of a parameter.
type ParameterFields = (
    String,
    String,
    Option<f64>,
    Option<f64>,
    Option<f64>,
    Option<String>,
    String,
);

#[pymethods]
impl Program {
    /// Parses a program; `object` selects one of several objects, `name` is the path of the
    /// program, from whose folder names of files start.
    #[new]
    #[pyo3(signature = (text, object=None, name=""))]
    fn new(py: Python<'_>, text: &str, object: Option<&str>, name: &str) -> PyResult<Self> {
        let parsed = run::shortly(py, || Model::parse(text, Mode::Default))?;
        let mut model = parsed.map_err(CallError::from)?;
        if !model.files().is_empty() {
            let path = PathBuf::from(name);
            model = run::run(py, &CallLimits::default(), move |control| {
                isoform_verbs::read_terms(&mut model, &path, control).map(|_| model)
            })?
            .map_err(CallError::from)?;
        }
        let model = model.object(object).map_err(|e| {
            CallError::usage(format!("no object is called {}", e.name))
                .hint(format!("one of: {}", e.objects.join(", ")))
        })?;
        Ok(Self(Arc::new(CompiledProgram {
            model: Arc::new(model),
            template: OnceLock::new(),
            reader: OnceLock::new(),
        })))
    }

    /// Returns the name of the object.
    #[getter]
    fn name(&self) -> &str {
        self.0.model.name()
    }

    /// Returns the annotated title and unit.
    #[getter]
    fn about(&self) -> (Option<&str>, Option<&str>) {
        let info = self.0.model.info();
        (info.title.as_deref(), info.unit.as_deref())
    }

    /// Returns warnings about the program, with line and column.
    #[getter]
    fn warnings(&self) -> Vec<(usize, usize, String)> {
        let warnings = self.0.model.warnings().iter();
        warnings
            .map(|w| (w.line, w.column, w.message.clone()))
            .collect()
    }

    /// Returns the parameters.
    #[getter]
    fn parameters(&self) -> Vec<ParameterFields> {
        self.0.model.params().iter().map(told).collect()
    }

    /// Completes partially given parameter values by the annotated defaults.
    fn filled(&self, given: Vec<Option<f64>>) -> PyResult<Vec<f64>> {
        Ok(self.values_of(&given)?)
    }

    /// Returns the names of all parameters of a fit, including those of the pose.
    #[pyo3(signature = (pose=None))]
    fn fitted_names(&self, pose: Option<&str>) -> PyResult<Vec<String>> {
        let is_it = |named: &(&str, Pose)| pose == Some(named.0);
        let asked = Pose::ALL.into_iter().find(is_it).map(|named| named.1);
        let pose = asked.or(self.0.model.info().pose).unwrap_or(Pose::None);
        let template =
            FrepTemplate::with_pose(&self.0.model, pose, &[]).map_err(CallError::from)?;
        let parameters = template.parameters().iter();
        Ok(parameters.map(|p| p.name.clone()).collect())
    }

    /// Returns the values of the function at points.
    fn values<'py>(
        &self,
        py: Python<'py>,
        points: PointsArg<'py>,
        given: Vec<f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.reading(py, &points, given, false)
    }

    /// Returns the gradients of the function at points.
    fn gradients<'py>(
        &self,
        py: Python<'py>,
        points: PointsArg<'py>,
        given: Vec<f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (template, a) = (self.compiled(py)?, self.values_of(&given)?);
        let gradients = of_points(py, &points, |block: &[Point3], out: &mut [Point3]| {
            let mut values = vec![0.0; block.len()];
            template.algebraic().gradients(block, &a, &mut values, out);
        })?;
        rows(py, gradients)
    }

    /// Returns the signed distances of points from the surface, to first order.
    fn metric<'py>(
        &self,
        py: Python<'py>,
        points: PointsArg<'py>,
        given: Vec<f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.reading(py, &points, given, true)
    }

    /// Returns the index of the nearest part of each point, and the names of all parts.
    fn parts<'py>(
        &self,
        py: Python<'py>,
        points: PointsArg<'py>,
        given: Vec<f64>,
    ) -> PyResult<(Bound<'py, PyArray1<u32>>, Vec<String>)> {
        let (template, a) = (self.compiled(py)?, self.values_of(&given)?);
        let parts = in_blocks(
            py,
            &points,
            POINTS_PER_EVALUATION,
            |block: &[Point3], out: &mut [u32]| {
                template.parts(block, &a, out);
            },
        )?;
        Ok((
            PyArray1::from_vec(py, parts),
            template.part_names().to_vec(),
        ))
    }

    /// Returns why the function has no value at a point, with line and column; `None` if it has
    /// one.
    fn trouble(&self, point: Point3, given: Vec<f64>) -> PyResult<Option<(usize, usize, String)>> {
        let a = self.values_of(&given)?;
        let found = self.0.model.eval(&point, &a, &[]);
        Ok(found.err().map(|e| (e.line, e.column, e.message)))
    }
}

impl Program {
    pub(crate) fn model(&self) -> &Model {
        &self.0.model
    }

    pub(crate) fn shared(&self) -> Arc<Model> {
        self.0.model.clone()
    }

    /// Returns the evaluator of chunks of a cloud.
    pub(crate) fn chunk_reader(&self) -> &ChunkReader {
        let make = || ChunkReader::new(Model::clone(&self.0.model));
        self.0.reader.get_or_init(make)
    }

    /// Returns the values of the function, or its metric reading. NaN where the program has no
    /// value, as on the command line.
    fn reading<'py>(
        &self,
        py: Python<'py>,
        points: &PointsArg<'py>,
        given: Vec<f64>,
        is_metric: bool,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (template, a) = (self.compiled(py)?, self.values_of(&given)?);
        let compute = |block: &[Point3], out: &mut [f64]| {
            template.algebraic().values(block, &a, out);
            let count = if are_finite(out) { 0 } else { out.len() };
            let doubtful: Vec<usize> = (0..count).filter(|k| !out[*k].is_finite()).collect();
            let decided = doubtful.par_chunks(BlockEvaluator::POINTS);
            let decided = decided.flat_map_iter(|those| {
                let points: Vec<Point3> = those.iter().map(|&k| block[k]).collect();
                let found = self.0.model.block_evaluator().eval(&points, &a);
                let values = found.into_iter().map(|e| e.map_or(f64::NAN, |e| e.f));
                those.iter().copied().zip(values)
            });
            let decided: Vec<(usize, f64)> = decided.collect();
            if is_metric {
                template.metric().values(block, &a, out);
            }
            for (k, value) in decided {
                if value.is_nan() || !is_metric {
                    out[k] = value;
                }
            }
        };
        Ok(PyArray1::from_vec(
            py,
            in_blocks(py, points, POINTS_PER_EVALUATION, compute)?,
        ))
    }

    /// Returns the readings, compiled in a thread that Ctrl-C can abandon, since large programs
    /// take long.
    fn compiled(&self, py: Python<'_>) -> PyResult<&FrepTemplate> {
        if self.0.template.get().is_none() {
            let theirs = self.0.clone();
            run::run(py, &CallLimits::default(), move |_| {
                theirs.template().map(drop)
            })??;
        }
        Ok(self.0.template()?)
    }

    /// Returns the values of all parameters, given some or all of them, which must be finite.
    pub(crate) fn values_of<V: Into<Option<f64>> + Copy>(
        &self,
        given: &[V],
    ) -> Result<Vec<f64>, CallError> {
        for (i, value) in given.iter().enumerate() {
            if let Some(value) = (*value).into().filter(|v| !v.is_finite()) {
                let name = self.0.model.params().get(i).map_or("", |p| p.name.as_str());
                let message = format!("parameter {} ({name}) is {value}", i + 1);
                return Err(CallError::new("not-finite", message));
            }
        }
        Ok(parameter_values(&self.0.model, given)?)
    }
}

/// Describes a parameter; bounds that are relative to the box of a scan are open.
fn told(info: &ParamInfo) -> ParameterFields {
    let number = |amount: Option<Amount>| amount.and_then(Amount::value);
    (
        info.name.clone(),
        format!("{:?}", info.kind).to_lowercase(),
        number(info.min),
        number(info.max),
        info.typical.or(number(info.start)),
        info.unit.clone(),
        info.description.clone(),
    )
}

/// Evaluates `compute` at points, block by block, on all cores if there are many points. The points
/// must be finite.
pub(crate) fn of_points<T: Clone + Default + Send>(
    py: Python<'_>,
    points: &PointsArg<'_>,
    compute: impl Fn(&[Point3], &mut [T]) + Sync,
) -> PyResult<Vec<T>> {
    in_blocks(py, points, POINTS_PER_TASK, compute)
}

/// Evaluates `compute` like [`of_points`], with `size` points per block.
fn in_blocks<T: Clone + Default + Send>(
    py: Python<'_>,
    points: &PointsArg<'_>,
    size: usize,
    compute: impl Fn(&[Point3], &mut [T]) + Sync,
) -> PyResult<Vec<T>> {
    let rows = PointRows::new(points)?;
    let mut out = vec![T::default(); rows.len()];
    let of_block = |(i, out): (usize, &mut [T])| {
        rows.block(i * size, out.len(), |block| {
            if let Some(k) = not_finite_at(block) {
                return Err(not_finite(i * size + k));
            }
            compute(block, out);
            Ok(())
        })
    };
    if out.len() <= POINTS_PER_TASK {
        run::shortly(py, || of_block((0, &mut out)))??;
    } else {
        let asked = CallLimits::default();
        run::scoped(py, &asked, |control| {
            out.par_chunks_mut(size).enumerate().try_for_each(|block| {
                control.check().map_err(CallError::stopped)?;
                of_block(block)
            })
        })??;
    }
    Ok(out)
}

/// Returns the program of a built-in template.
#[pyfunction]
pub(crate) fn template(name: &str) -> PyResult<(&'static str, &'static str)> {
    match isoform::template(name) {
        Some(found) => Ok((found.name, found.program)),
        None => {
            let names: Vec<&str> = isoform::templates().map(|t| t.name).collect();
            Err(
                CallError::new("template", format!("no template is called {name}"))
                    .hint(format!("one of: {}", names.join(", ")))
                    .into(),
            )
        }
    }
}

/// Returns the names of the built-in templates.
#[pyfunction]
pub(crate) fn templates() -> Vec<&'static str> {
    isoform::templates().map(|t| t.name).collect()
}
