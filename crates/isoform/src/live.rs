//! Model for other evaluators, as a tape with free parameters: what a page moves by sliders.

use crate::mesh_model::explained;
use crate::meshing::{default_size_within, solid_of};
use crate::{COORDINATES, FrepTemplate, MeshModelError, ScanFit};
use isoform_algebra::{ParseError, Poly};
use isoform_control::Control;
use isoform_field::hyperfun::{Amount, Model, ParamInfo, Pose};
use isoform_field::{Graph, Join, NodeId, Ops, Pieces, Shape, Tape, parameter_values};
use isoform_fit::{Status, Template};
use isoform_geom::{Aabb, Point3, PointCloud, Solid};
use isoform_mesh::MeshError;
use isoform_mesh::features::{START, extent_within};
use rayon::prelude::*;

/// Number of points that a thread evaluates at a time: enough to make scheduling negligible.
const POINTS_PER_TASK: usize = 4096;

/// Tape that evaluates a model, with free parameters.
#[derive(Clone, Debug)]
pub struct ModelTape {
    /// Tape of the coordinates and parameters. Its results are the functions of the parts, then the
    /// approximate signed distance, then the index of the nearest part.
    pub tape: Tape,
    /// Set operations that join the parts to the solid, in the order of evaluation.
    pub tree: Vec<Join>,
    /// Names of the parts.
    pub part_names: Vec<String>,
}

/// Parameter that may be changed.
#[derive(Clone, Debug, PartialEq)]
pub struct LiveParameter {
    /// Index among all parameters, from 0.
    pub index: usize,
    /// Name of the parameter.
    pub name: String,
    /// Description of the parameter; may be empty.
    pub description: String,
    /// Unit of the value; `None` if unknown.
    pub unit: Option<String>,
    /// Current value.
    pub value: f64,
    /// Smallest value.
    pub lower: f64,
    /// Largest value.
    pub upper: f64,
    /// Number to add to the value of the tape's parameter to get this value.
    pub shift: f64,
    /// True if a fit left the parameter undetermined.
    pub is_open: bool,
}

/// Model with values of its parameters, and its bounding box.
#[derive(Clone, Debug)]
pub struct LiveModel {
    /// Tape that evaluates the model.
    pub readings: ModelTape,
    /// Values of all parameters of the tape.
    pub values: Vec<f64>,
    /// Parameters that may be changed; tied and unused ones are not among them.
    pub parameters: Vec<LiveParameter>,
    /// Bounding box of the surface for these values, relative to the origin.
    pub bounds: Aabb,
    /// True if the box cuts the solid.
    pub is_cut: bool,
    /// True if the box is that of scanned points, beyond which the surface may extend.
    pub is_loose: bool,
    /// Vector to add to coordinates of the tape to get those of the file.
    pub origin: Point3,
}

impl LiveModel {
    /// Compiles a model with the values `a`; missing values are those of
    /// [`parameter_values`](crate::parameter_values). `region` restricts the model to a box.
    /// Returns `None` if the program is not an expression, so that it must be run statement by
    /// statement, or if its function is not a number in some part of the box, such as the square
    /// root of a negative number: evaluators differ in the result of that.
    ///
    /// ```
    /// use isoform::{Control, LiveModel, template};
    /// let ball = template("sphere").expect("a template of the gallery").model();
    /// let live = LiveModel::new(&ball, &[0.0, 0.0, 0.0, 2.0], None, &Control::default())?;
    /// let live = live.expect("an expression");
    /// assert_eq!(live.parameters[3].value, 2.0);
    /// assert!(live.bounds.size()[0] > 4.0 && live.bounds.size()[0] < 5.0);
    /// # Ok::<(), isoform::MeshModelError>(())
    /// ```
    ///
    /// # Errors
    /// [`MeshModelError`] if the surface is empty or invalid, or on a stop.
    pub fn new(
        model: &Model,
        a: &[f64],
        region: Option<Aabb>,
        control: &Control<'_>,
    ) -> Result<Option<Self>, MeshModelError> {
        let (solid, is_run) = solid_of(model, a)?;
        let template = FrepTemplate::with_pose(model, Pose::None, &[]);
        let Some(readings) = template
            .ok()
            .filter(|_| !is_run)
            .and_then(|t| t.model_tape(t.parameters()))
        else {
            return Ok(None);
        };
        let bounds = bounds_of(solid.as_ref(), region, control)?;
        if undefined_at(solid.as_ref(), &bounds).is_some() {
            return Ok(None);
        }
        let values = parameter_values(model, a)?;
        let used = used_parameters(&readings.tape);
        let all = model.params().iter().zip(&values);
        let parameters = all
            .filter(|(info, _)| used[info.index])
            .map(|(info, value)| own_parameter(info, *value, bounds.diagonal()))
            .collect();
        Ok(Some(Self {
            readings,
            values,
            parameters,
            bounds,
            is_cut: region.is_some(),
            is_loose: false,
            origin: [0.0; 3],
        }))
    }

    /// Compiles the solid that a polynomial F in x, y and z bounds within a region: the side of F =
    /// 0 with at most four of the region's corners. `None` if F is constant.
    ///
    /// ```
    /// use isoform::{LiveModel, geom::Aabb};
    /// let region = Aabb { lo: [-1.0; 3], hi: [1.0; 3] };
    /// let ball = LiveModel::of_polynomial("x^2 + y^2 + z^2 - 1/4", region)?.expect("a surface");
    /// let values = ball.readings.tape.eval_all(&[0.0; 3], &[], &mut Vec::new());
    /// assert_eq!(values[0], 0.25);
    /// # Ok::<(), isoform::algebra::ParseError>(())
    /// ```
    ///
    /// # Errors
    /// [`ParseError`] if the text is not a polynomial.
    pub fn of_polynomial(text: &str, region: Aabb) -> Result<Option<Self>, ParseError> {
        let Some((mut graph, sum)) = polynomial_within(text, region)? else {
            return Ok(None);
        };
        let shape = Shape::new(&mut graph, sum);
        let mut roots = shape.pieces;
        roots.extend([shape.distance, shape.part]);
        Ok(Some(Self {
            readings: ModelTape {
                tape: Tape::new(&graph, &roots, 3, 0),
                tree: shape.tree,
                part_names: vec!["F".to_owned(); shape.parts.len()],
            },
            values: Vec::new(),
            parameters: Vec::new(),
            bounds: region,
            is_cut: true,
            is_loose: false,
            origin: [0.0; 3],
        }))
    }

    /// Returns the approximate signed distances of points from the surface, positive inside, for
    /// the current values. Points are in the coordinates of the file.
    ///
    /// ```
    /// use isoform::{Control, LiveModel, template};
    /// let ball = template("sphere").expect("a template of the gallery").model();
    /// let live = LiveModel::new(&ball, &[0.0, 0.0, 0.0, 2.0], None, &Control::default())?;
    /// assert_eq!(live.expect("an expression").distances(&[[0.0, 0.0, 2.5]]), [-0.5]);
    /// # Ok::<(), isoform::MeshModelError>(())
    /// ```
    pub fn distances(&self, points: &[Point3]) -> Vec<f64> {
        let tape = &self.readings.tape;
        let reading = tape.n_results() - 2;
        let mut scratch = Vec::new();
        let mut at = |p: &Point3| {
            let place: Point3 = std::array::from_fn(|k| p[k] - self.origin[k]);
            tape.eval_all(&place, &self.values, &mut scratch)[reading]
        };
        points.iter().map(&mut at).collect()
    }

    /// Returns the signed distances to first order of a cloud's points, positive outside, in its
    /// unit; computes them on all threads.
    pub fn deviations(&self, cloud: &PointCloud) -> Vec<f64> {
        let places: Vec<Point3> = (0..cloud.points.len()).map(|i| cloud.absolute(i)).collect();
        let distances: Vec<Vec<f64>> = places
            .par_chunks(POINTS_PER_TASK)
            .map(|chunk| self.distances(chunk))
            .collect();
        distances.concat().into_iter().map(|d| -d).collect()
    }

    /// Compiles the fitted model of a scan, in the coordinates of the scan's points. `None` if the
    /// program is not an expression.
    pub fn of_fit(found: &ScanFit) -> Option<Self> {
        let frep = &found.template.frep;
        let readings = frep.model_tape(found.template.parameters())?;
        let values = found.fit.values();
        let bounds = found.cloud.bounds();
        let infos = frep.model().params();
        let used = used_parameters(&readings.tape);
        let all = found.template.parameters().iter().enumerate();
        let estimates = &found.fit.parameters;
        let is_open = |i: usize| {
            let estimate = estimates.get(i);
            estimate.is_some_and(|e| e.status == Status::Undetermined)
        };
        let parameters = all
            .filter(|(i, _)| used[*i])
            .map(|(i, p)| {
                let shift = found.template.shift[i];
                let value = values[i] + shift;
                let [lower, upper] = range(p.min, p.max, values[i], bounds.diagonal());
                LiveParameter {
                    index: i,
                    name: p.name.clone(),
                    description: infos
                        .get(i)
                        .map_or(String::new(), |i| i.description.clone()),
                    unit: p.unit.clone(),
                    value,
                    lower: (lower + shift).min(value),
                    upper: (upper + shift).max(value),
                    shift,
                    is_open: is_open(i),
                }
            })
            .collect();
        Some(Self {
            readings,
            values,
            parameters,
            bounds,
            is_cut: false,
            is_loose: true,
            origin: found.cloud.origin,
        })
    }
}

/// Returns the solid that a polynomial F in x, y and z bounds within a region, as
/// [`LiveModel::of_polynomial`] does. `None` if F is constant.
///
/// ```
/// use isoform::geom::{Aabb, Solid};
/// let region = Aabb { lo: [-1.0; 3], hi: [1.0; 3] };
/// let ball = isoform::solid_of_polynomial("x^2 + y^2 + z^2 - 1/4", region)?.expect("a surface");
/// assert_eq!(ball.gradient(0, [0.5, 0.0, 0.0]), (0.0, [-1.0, 0.0, 0.0]));
/// # Ok::<(), isoform::algebra::ParseError>(())
/// ```
///
/// # Errors
/// [`ParseError`] if the text is not a polynomial.
pub fn solid_of_polynomial(text: &str, region: Aabb) -> Result<Option<Pieces>, ParseError> {
    let found = polynomial_within(text, region)?;
    Ok(found.and_then(|(graph, root)| Pieces::new(&graph, root, &[]).ok()))
}

/// Returns a polynomial as an expression that is positive on the side with at most four of the
/// region's corners.
fn polynomial_within(text: &str, region: Aabb) -> Result<Option<(Graph, NodeId)>, ParseError> {
    let exact = Poly::parse(text, &COORDINATES)?;
    let terms = exact.to_f64();
    if exact.is_constant() || terms.iter().any(|t| !t.1.is_finite()) {
        return Ok(None);
    }
    let mut graph = Graph::new();
    let x: [NodeId; 3] = std::array::from_fn(|i| graph.x(i));
    let mut sum = graph.constant(0.0);
    for (exponents, c) in terms {
        let mut term = graph.constant(c);
        for (x, e) in x.iter().zip(exponents) {
            let power = graph.powi(x, i32::from(e));
            term = graph.mul(&term, &power);
        }
        sum = graph.add(&sum, &term);
    }
    let is_inside = |i: usize| {
        let corner: Point3 = std::array::from_fn(|k| [region.lo, region.hi][i >> k & 1][k]);
        graph.eval(sum, &corner, &[]) >= 0.0
    };
    if (0..8).filter(|i| is_inside(*i)).count() > 4 {
        sum = graph.neg(&sum);
    }
    Ok(Some((graph, sum)))
}

/// Returns the given region, or the box of the solid.
pub(crate) fn bounds_of(
    solid: &dyn Solid,
    region: Option<Aabb>,
    control: &Control<'_>,
) -> Result<Aabb, MeshModelError> {
    if let Some(region) = region {
        return Ok(region);
    }
    let found = default_size_within(solid, &isoform_mesh::Options::default(), control)
        .and_then(|size| extent_within(solid, START, size, control));
    found
        .map(|extent| extent.bounds)
        .map_err(|e| explained(MeshError::Extent(e), solid, control))
}

/// Number of samples along each side of a box at which a function is tested for undefined values.
/// More samples find smaller undefined parts; their cost is the cube of this number.
const SAMPLES_PER_SIDE: usize = 24;

/// Returns a point of a box at which the function of a part of a solid is not a number, such as the
/// square root of a negative number; `None` if no sample is such a point.
///
/// ```
/// use isoform::field::hyperfun::{Mode, Model};
/// use isoform::geom::Aabb;
/// let half_defined = "my_model(x[3], a[1]) { my_model = sqrt(x[1]) - x[2]; }";
/// let model = Model::parse(half_defined, Mode::Default)?;
/// let (solid, _) = isoform::solid_of(&model, &[])?;
/// let at = isoform::undefined_at(solid.as_ref(), &Aabb { lo: [-1.0; 3], hi: [1.0; 3] });
/// assert!(at.is_some_and(|p| p[0] < 0.0));
/// let right = Aabb { lo: [0.0; 3], hi: [1.0; 3] };
/// assert_eq!(isoform::undefined_at(solid.as_ref(), &right), None);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn undefined_at(solid: &dyn Solid, bounds: &Aabb) -> Option<Point3> {
    let size = bounds.size();
    // Offset from the centres of cells, where formulas of round numbers have their poles.
    let share = |i: usize| (i as f64 + 0.4142) / SAMPLES_PER_SIDE as f64;
    let point = |at: [usize; 3]| -> Point3 {
        std::array::from_fn(|k| bounds.lo[k] + share(at[k]) * size[k])
    };
    let which: Vec<u32> = (0..solid.names().len() as u32).collect();
    (0..SAMPLES_PER_SIDE).into_par_iter().find_map_first(|i| {
        let places =
            (0..SAMPLES_PER_SIDE).flat_map(|j| (0..SAMPLES_PER_SIDE).map(move |k| [i, j, k]));
        let points: Vec<Point3> = places.map(point).collect();
        let mut values = vec![0.0; which.len() * points.len()];
        solid.values(&which, &points, &mut values);
        let at = values.iter().position(|v| v.is_nan())?;
        Some(points[at % points.len()])
    })
}

/// Returns, for each parameter of a tape, true if a step or a result uses it.
fn used_parameters(tape: &Tape) -> Vec<bool> {
    let first = tape.constants().len() + tape.dimension();
    let mut used = vec![false; tape.n_params()];
    let mut see = |slot: u32| {
        let at = (slot as usize).wrapping_sub(first);
        if let Some(used) = used.get_mut(at) {
            *used = true;
        }
    };
    tape.results().iter().copied().for_each(&mut see);
    for step in tape.steps() {
        step.arguments().into_iter().for_each(&mut see);
    }
    used
}

/// Returns a parameter of a program with its value; `size` is that of the model.
fn own_parameter(info: &ParamInfo, value: f64, size: f64) -> LiveParameter {
    let number = |amount: Option<Amount>| amount.and_then(Amount::value);
    let [lower, upper] = range(number(info.min), number(info.max), value, size);
    LiveParameter {
        index: info.index,
        name: info.name.clone(),
        description: info.description.clone(),
        unit: info.unit.clone(),
        value,
        lower: lower.min(value),
        upper: upper.max(value),
        shift: 0.0,
        is_open: false,
    }
}

/// Returns bounds between which a parameter can be moved: the annotated ones. A missing bound is as
/// far from the value as 0 is, or by the size of the model if the value is 0.
fn range(min: Option<f64>, max: Option<f64>, value: f64, size: f64) -> [f64; 2] {
    let reach = if value == 0.0 { size } else { value.abs() };
    let lower = min.unwrap_or(value - reach);
    let upper = max.unwrap_or(value.max(lower) + reach);
    [lower, upper]
}
