//! Fit of a HyperFun program to a scan in any pose, with clutter around the part.

use crate::constrained_template::{ConstrainedTemplate, ParameterError};
use crate::report::nominal;
use crate::template::{CloudExtent, InMemoryPoints};
use crate::{CornerError, FacesError, FrepTemplate, TemplateError, points_on_faces};
use isoform_control::Control;
use isoform_field::hyperfun::{Model, Placement, Pose};
use isoform_fit::{
    Candidate, ClutterKind, Finding, Fit, FitError, Kind, Method, Options, Scan, Status, Template,
    Warning, fit_to, search, settle,
};
use isoform_geom::{Aabb, Point3, PointCloud, recentering_origin, rounding};
use std::borrow::Cow;
use std::fmt;
use std::time::Instant;

/// Number of starts of the search in each other orientation: enough to recognise the right one. The
/// time of trying orientations is proportional to it.
const STARTS_PER_ORIENTATION: usize = 8;
/// Maximum ratio of two misfits at which the smaller one is better. Fits that are related by a
/// symmetry of the part differ by less and count as equal.
const MAX_BETTER_MISFIT_RATIO: f64 = 0.97;
/// Length of the Rodrigues vector (0.6 degrees) above which a scan is fitted again along the
/// template's own axes, since bounds that are shares of its box change with the frame.
const MIN_TILT: f64 = 5e-3;
/// Bits by which the seed of the second search differs from that of the first; any value except 0
/// does.
const SECOND_SEED_BITS: u64 = 0x5EED;
/// Maximum relative difference of the misfits of two searches that agree. A larger one would
/// confirm searches that ended in different minima.
const MAX_AGREEING_MISFIT_DIFFERENCE: f64 = 0.03;
/// Distance from a bound, as a share of the range, within which a value has reached it.
const BOUND_DISTANCE_SHARE: f64 = 0.005;
/// Distance from a bound, as a share of the range, within which a value has reached it if the fit
/// is not accepted: a value that the bound keeps from its place may also end near the bound.
const DOUBTFUL_BOUND_DISTANCE_SHARE: f64 = 0.05;
/// Maximum number of rounds in which bounds that are shares of the box are widened: two suffice for
/// a quarter of a round part. Each round that leads elsewhere is a complete search.
const MAX_WIDENING_ROUNDS: usize = 2;
/// Maximum share of the points that may be left out as clutter: if more are, the rest need not be
/// the part.
pub(crate) const MAX_LEFT_OUT_SHARE: f64 = 0.6;
/// Approximate number of points that are added on the faces of a CAD model. Fewer leave small faces
/// without points, more make the fit slower.
const ADDED_FACE_POINTS: usize = 6000;

/// Lower and upper bounds of parameters, by name, 1-based number, or `a[number]`.
pub type NamedBounds = Vec<(String, (f64, f64))>;

/// Options of a fit to a scan. Values, bounds and starts are in the file's coordinates and unit.
///
/// ```
/// use isoform::FitOptions;
/// // One parameter is known, another one has bounds.
/// let options = FitOptions {
///     fixed: vec![("radius".to_owned(), 2.0)],
///     bounds: vec![("height".to_owned(), (1.0, 9.0))],
///     ..FitOptions::default()
/// };
/// assert_eq!(options.fit.seed, 1);
/// ```
#[derive(Clone, Debug, Default)]
pub struct FitOptions {
    /// Start values of all parameters, or of those of the program without the pose; `None` for
    /// those of the template, or of the data.
    pub start: Option<Vec<f64>>,
    /// Bounds of parameters, by name, 1-based number, or `a[number]`.
    pub bounds: NamedBounds,
    /// Parameters that are fixed, with their values, by name, 1-based number, or `a[number]`.
    pub fixed: Vec<(String, f64)>,
    /// Motion of the whole template, as further parameters; `None` for that of the program.
    pub pose: Option<Pose>,
    /// Kinds of clutter that are fitted like the rest. If a fit is doubtful, clutter of other kinds
    /// is left out.
    pub keep: Vec<ClutterKind>,
    /// Method, loss, seed and effort. Its `start` and `bounds` are ignored.
    pub fit: Options,
}

/// Reason why a scan cannot be fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitScanError {
    /// The scan has no points.
    #[error("there is no point to fit to")]
    NoPoints,
    /// A triangle of the scan has a corner that is not the index of a point.
    #[error(transparent)]
    Corner(#[from] CornerError),
    /// The program cannot be a template.
    #[error(transparent)]
    Template(#[from] TemplateError),
    /// A parameter cannot be fixed.
    #[error("{}{error}", key_prefix(key))]
    Fixed {
        /// Name or number of the parameter to be fixed.
        key: String,
        /// Reason why it cannot be fixed.
        error: ParameterError,
    },
    /// Bounds are not valid for the parameters.
    #[error("{}{error}", key_prefix(key))]
    Bounds {
        /// Name or number of the parameter with bounds.
        key: String,
        /// Reason why the bounds are not valid.
        error: ParameterError,
    },
    /// Start values are not valid for the parameters.
    #[error(transparent)]
    Start(ParameterError),
    /// The number of points exceeds that of 32-bit indices.
    #[error("{count} points are more than the 2^32 that can be told apart")]
    TooMany {
        /// Number of points.
        count: usize,
    },
    /// The method needs all points in each step, and clouds in chunks are too large for that.
    #[error("clouds in chunks are fitted by the default method")]
    Method,
    /// The fit has no result.
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// Returns the prefix of an error of a parameter: its name, if it has one.
fn key_prefix(key: &str) -> String {
    if key.trim().is_empty() {
        return String::new();
    }
    format!("{key}: ")
}

impl From<FacesError> for FitScanError {
    fn from(error: FacesError) -> Self {
        match error {
            FacesError::Corner(error) => error.into(),
            FacesError::Stopped(_) => Self::Fit(FitError::Stopped),
        }
    }
}

/// Warning about the way in which a scan was fitted.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum FitScanWarning {
    /// Points were added on the faces of a CAD model.
    FacesAdded {
        /// Number of points added.
        added: usize,
        /// Number of vertices of the model.
        vertices: usize,
    },
    /// The points lie far from the origin, and the template has no pose that could be moved there.
    FarAndFixed,
    /// The points came in chunks, and clutter among them was fitted like the rest.
    ClutterFitted,
}

impl fmt::Display for FitScanWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FacesAdded { added, vertices } => write!(
                f,
                "a CAD model: {added} points on its faces were added to \
                 {vertices} vertices"
            ),
            Self::FarAndFixed => f.write_str(
                "the points lie far from the origin and the template cannot be moved: digits are \
                 lost; try --pose translate",
            ),
            Self::ClutterFitted => f.write_str(
                "planes or objects beside the part are not left out of clouds in chunks as large as \
                 this; a fit of a sample leaves them out",
            ),
        }
    }
}

/// Template fitted to a scan.
#[derive(Debug)]
pub struct ScanFit {
    /// Points that were fitted, including those added on the faces of a CAD model; of a cloud in
    /// chunks, its sample.
    pub cloud: PointCloud,
    /// Bounding box of all points that were fitted, relative to the origin of the cloud.
    pub bounds: Aabb,
    /// Template in the frame in which it was fitted.
    pub template: ConstrainedTemplate,
    /// Estimates and verdict, relative to the origin of the cloud.
    pub fit: Fit,
    /// Warnings in addition to [`Fit::warnings`].
    pub warnings: Vec<FitScanWarning>,
    /// Computing time by phase, in seconds.
    pub seconds: Vec<(&'static str, f64)>,
}

impl ScanFit {
    /// Returns the values of all parameters in the file's coordinates.
    pub fn values(&self) -> Vec<f64> {
        let relative = self.fit.parameters.iter().map(|p| p.value);
        relative
            .zip(&self.template.shift)
            .map(|(value, shift)| value + shift)
            .collect()
    }
    /// Prints the fitted program in the file's coordinates: plain HyperFun that any tool can
    /// evaluate.
    pub fn program(&self) -> String {
        let frep = &self.template.frep;
        frep.fitted_program(&self.fit.values(), self.cloud.origin)
    }
    /// Prints the fitted program in the template's own coordinates, without its pose.
    pub fn own_program(&self) -> String {
        let (model, values) = (self.template.frep.model(), self.fit.values());
        model.print_fitted(&values[..model.n_params()], None)
    }
    /// Returns the bounding box of the points that were fitted, in the file's coordinates.
    pub fn extent(&self) -> Aabb {
        let placed = |p: Point3| std::array::from_fn(|k| p[k] + self.cloud.origin[k]);
        Aabb {
            lo: placed(self.bounds.lo),
            hi: placed(self.bounds.hi),
        }
    }
    /// Returns the bounding box of the points that were fitted, in the template's own coordinates.
    pub fn own_extent(&self) -> Aabb {
        match self.placement() {
            Some(place) => {
                let origin = self.cloud.origin;
                let absolute = |p: &Point3| std::array::from_fn(|k| p[k] + origin[k]);
                let points = self.cloud.points.iter().map(absolute);
                Aabb::from_points(&points.map(|p| place.framed(p)).collect::<Vec<_>>())
            }
            None => self.extent(),
        }
    }
    /// Returns a round number that the designer may have meant for a parameter, in its unit (an
    /// angle is round in degrees). `None` for parameters that are fixed, tied, undetermined or of
    /// the pose, and if the number could as well be near by chance.
    pub fn nominal(&self, parameter: usize) -> Option<f64> {
        let (p, estimate) = (
            &self.template.parameters()[parameter],
            &self.fit.parameters[parameter],
        );
        let is_open = matches!(estimate.status, Status::Fixed | Status::Undetermined);
        if is_open || p.is_pose || p.tie.is_some() {
            return None;
        }
        let (low, high) = estimate.ci95?;
        let scale = match p.kind {
            Kind::Angle => 1_f64.to_degrees(),
            _ => 1.0,
        };
        let value = estimate.value + self.template.shift[parameter];
        let round = nominal(value * scale, 0.5 * (high - low) * scale)?;
        Some(round / scale)
    }
    /// Returns the signed distance of each point from the fitted model, positive outside.
    pub fn deviation(&self) -> Vec<f64> {
        self.fit.residuals.iter().map(|r| 0.0 - r).collect()
    }
    /// Returns the unit of a parameter; `length` is the unit of lengths in the scan. `None` if
    /// unknown.
    pub fn unit_of(&self, parameter: usize, length: Option<&str>) -> Option<String> {
        let p = &self.template.parameters()[parameter];
        match p.kind {
            Kind::X | Kind::Y | Kind::Z | Kind::Length => {
                length.map(str::to_owned).or_else(|| p.unit.clone())
            }
            Kind::Angle => Some("rad".to_owned()),
            Kind::Ratio => None,
            Kind::Number => p.unit.clone(),
        }
    }
    /// Returns the pose of the model in the file's coordinates; `None` for a template without one.
    pub fn placement(&self) -> Option<Placement> {
        let placement = self.template.frep.placement(&self.fit.values())?;
        let origin = self.cloud.origin;
        Some(Placement {
            translation: std::array::from_fn(|k| placement.translation[k] + origin[k]),
            ..placement
        })
    }
}

/// Fits a HyperFun program to a scan.
///
/// If the program does not fit in the orientation of the scan, other orientations are tried, its
/// box is measured along the template's own axes, and bounds that assume a complete part are
/// widened. If a fit is doubtful and there are planes or other objects next to the part, the scan
/// is also fitted without them. The faces of CAD meshes, which have no vertices inside, get points.
/// Points far from the origin are fitted relative to their centre, as readers of files do it;
/// values are in the file's coordinates.
///
/// ```
/// use isoform::{Control, FitOptions, fit_scan, geom::PointCloud, template};
/// // Points of a ball of radius 2 about (1, 0, 0).
/// let on_ball = |i: u32| {
///     let (t, z) = (f64::from(i) * 2.4, f64::from(i) / 150.0 - 1.0);
///     let r = (1.0 - z * z).sqrt();
///     [1.0 + 2.0 * r * t.cos(), 2.0 * r * t.sin(), 2.0 * z]
/// };
/// let scan = PointCloud::from_points((0..300).map(on_ball).collect());
/// let ball = template("sphere").expect("a template of the gallery").model();
/// let fitted = fit_scan(&scan, &ball, &FitOptions::default(), &Control::default())?;
/// let radius = fitted.template.index("radius").expect("a parameter");
/// assert!((fitted.values()[radius] - 2.0).abs() < 1e-9);
/// # Ok::<(), isoform::FitScanError>(())
/// ```
///
/// # Errors
/// [`FitScanError`] if the scan is empty, an option is not valid, or the fit has no result.
pub fn fit_scan(
    scan: &PointCloud,
    model: &Model,
    options: &FitOptions,
    control: &Control<'_>,
) -> Result<ScanFit, FitScanError> {
    let started = Instant::now();
    let mut warnings = Vec::new();
    let near = recentred(scan);
    let mut rounding = rounding(scan);
    let mut cloud = with_faces(&near, &mut warnings, &mut rounding, control)?;
    if cloud.points.is_empty() {
        return Err(FitScanError::NoPoints);
    }
    let make_template = template_constructor(model, options, cloud.origin);
    let mut template =
        ConstrainedTemplate::new(make_template(&InMemoryPoints(&cloud.points))?, cloud.origin);
    if cloud.origin != [0.0; 3] && !template.can_move() {
        // The template's own coordinates are those of the file.
        let absolute = (0..cloud.points.len()).map(|i| cloud.absolute(i)).collect();
        let moved = cloud.to_mut();
        (moved.points, moved.origin) = (absolute, [0.0; 3]);
        warnings.push(FitScanWarning::FarAndFixed);
        template =
            ConstrainedTemplate::new(make_template(&InMemoryPoints(&cloud.points))?, cloud.origin);
    }
    fix_parameters(&mut template, options)?;
    let task = ScanTask {
        options,
        inner: Options {
            rounding,
            ..inner_options(&template, options)?
        },
        control,
        origin: cloud.origin,
        make_template: &make_template,
    };
    let prepared = started.elapsed().as_secs_f64();
    let posed = task.fit_beside_clutter(&cloud.points, template)?;
    let mut seconds = vec![("template", prepared)];
    seconds.extend(posed.fit.seconds.iter().copied());
    Ok(ScanFit {
        bounds: cloud.bounds(),
        cloud: cloud.into_owned(),
        template: posed.template,
        fit: posed.fit,
        warnings,
        seconds,
    })
}

/// Returns a constructor of templates of a program in the requested pose, for points relative to an
/// origin.
pub(crate) fn template_constructor<'a>(
    model: &'a Model,
    options: &FitOptions,
    origin: Point3,
) -> impl Fn(&dyn CloudExtent) -> Result<FrepTemplate, TemplateError> + 'a {
    let pose = options.pose.or(model.info().pose).unwrap_or(Pose::None);
    move |points| FrepTemplate::compile_in_pose(model, pose, points, origin)
}

/// Returns the scan relative to the origin that a reader would give it.
fn recentred(scan: &PointCloud) -> Cow<'_, PointCloud> {
    if recentering_origin(&scan.bounds()) == [0.0; 3] {
        return Cow::Borrowed(scan);
    }
    Cow::Owned(scan.clone().recentred())
}

/// Returns the scan; a CAD model with points on its faces. `rounding` is raised to the exactness of
/// the model.
fn with_faces<'a>(
    scan: &'a PointCloud,
    warnings: &mut Vec<FitScanWarning>,
    rounding: &mut f64,
    control: &Control<'_>,
) -> Result<Cow<'a, PointCloud>, FacesError> {
    let Some(found) = points_on_faces(scan, ADDED_FACE_POINTS, control)? else {
        return Ok(Cow::Borrowed(scan));
    };
    let (added, vertices) = (found.added, scan.points.len());
    warnings.push(FitScanWarning::FacesAdded { added, vertices });
    *rounding = rounding.max(found.exactness);
    Ok(Cow::Owned(found.cloud))
}

/// Fixes the parameters that the caller fixes.
pub(crate) fn fix_parameters(
    template: &mut ConstrainedTemplate,
    options: &FitOptions,
) -> Result<(), FitScanError> {
    template
        .fix(&options.fixed)
        .map_err(|(place, error)| FitScanError::Fixed {
            key: options.fixed[place].0.clone(),
            error,
        })
}

/// Returns the options of the stage, in the template's coordinates.
pub(crate) fn inner_options(
    template: &ConstrainedTemplate,
    options: &FitOptions,
) -> Result<Options, FitScanError> {
    let start = match &options.start {
        Some(values) => Some(template.start(values).map_err(FitScanError::Start)?),
        None => None,
    };
    let bounds = if options.bounds.is_empty() {
        Vec::new()
    } else {
        let key = |place: usize| options.bounds[place].0.clone();
        template
            .bounds(&options.bounds)
            .map_err(|(place, error)| FitScanError::Bounds {
                key: key(place),
                error,
            })?
    };
    Ok(Options {
        start,
        bounds,
        ..options.fit.clone()
    })
}

/// Returns true if a fit is doubtful, and there are planes or other objects next to the part.
pub(crate) fn has_clutter(fit: &Fit) -> bool {
    let is_clutter = |f: &Finding| {
        matches!(
            f,
            Finding::Apart { .. } | Finding::Table { .. } | Finding::Stray { .. }
        )
    };
    fit.findings.iter().any(is_clutter)
}

/// Returns a warning for each kind of points that were left out.
fn left_out(beside: &[Option<ClutterKind>]) -> impl Iterator<Item = Warning> {
    let kinds = [ClutterKind::Plane, ClutterKind::Apart, ClutterKind::Stray];
    kinds.into_iter().filter_map(|why| {
        let count = beside.iter().filter(|b| **b == Some(why)).count();
        let points = beside.len();
        (count > 0).then_some(Warning::Beside { why, count, points })
    })
}

/// Returns the points that are not clutter.
fn kept_of(points: &[Point3], beside: &[Option<ClutterKind>]) -> Vec<Point3> {
    let kept = points.iter().zip(beside).filter(|(_, b)| b.is_none());
    kept.map(|(p, _)| *p).collect()
}

/// Returns true if a search probably ended in the minimum that has a known misfit.
fn agree(found: &Candidate, misfit: f64) -> bool {
    (found.misfit / misfit - 1.0).abs() < MAX_AGREEING_MISFIT_DIFFERENCE
}

/// Fit, and the template in the frame in which it was found.
pub(crate) struct PosedFit {
    pub(crate) template: ConstrainedTemplate,
    pub(crate) fit: Fit,
}

/// Result of a search, and the template with which it was made.
struct PosedCandidate {
    template: ConstrainedTemplate,
    candidate: Candidate,
}

impl PosedCandidate {
    /// Takes another candidate if it is better; its time counts in either case.
    fn offer(&mut self, template: ConstrainedTemplate, mut candidate: Candidate, is_better: bool) {
        if is_better {
            std::mem::swap(&mut self.candidate, &mut candidate);
            self.template = template;
        }
        self.candidate.add_seconds(candidate.seconds());
    }
}

/// Constructor of a template from the cloud whose frame it takes.
pub(crate) type TemplateConstructor<'a> =
    dyn Fn(&dyn CloudExtent) -> Result<FrepTemplate, TemplateError> + 'a;

/// Data of all stages of a fit.
pub(crate) struct ScanTask<'a> {
    pub(crate) options: &'a FitOptions,
    /// Options of the stage.
    pub(crate) inner: Options,
    pub(crate) control: &'a Control<'a>,
    /// Vector to add to the points to get the file's coordinates.
    pub(crate) origin: Point3,
    pub(crate) make_template: &'a TemplateConstructor<'a>,
}

impl ScanTask<'_> {
    /// Fits the points; if the fit is doubtful and there are planes or other objects next to the
    /// part, also without them, and returns the better fit.
    fn fit_beside_clutter(
        &self,
        points: &[Point3],
        template: ConstrainedTemplate,
    ) -> Result<PosedFit, FitScanError> {
        let scan = Scan::new(points, &self.inner, self.control)?;
        let mut whole = self.fit_in_pose(&scan, &InMemoryPoints(points), template)?;
        drop(scan);
        if !has_clutter(&whole.fit) {
            return Ok(whole);
        }
        if self.control.is_stopped() {
            whole.fit.stop_early();
            return Ok(whole);
        }
        let Some(mut part) = self.fit_part(points, &mut whole.fit)? else {
            return Ok(whole);
        };
        if part.fit.verdict >= whole.fit.verdict {
            whole.fit.add_seconds(&part.fit.seconds);
            return Ok(whole);
        }
        part.fit.add_seconds(&whole.fit.seconds);
        Ok(part)
    }

    /// Fits the points without clutter. `None` if nothing is clutter, if most points are clutter,
    /// or if too few points are left. The time of the search for clutter counts as that of `whole`.
    fn fit_part(
        &self,
        points: &[Point3],
        whole: &mut Fit,
    ) -> Result<Option<PosedFit>, FitScanError> {
        let started = Instant::now();
        let scan = Scan::new(points, &self.inner, self.control)?;
        let clutter = scan.clutter();
        let keep = &self.options.keep;
        let mut beside: Vec<Option<ClutterKind>> = points
            .iter()
            .map(|p| clutter.classify(*p).filter(|b| !keep.contains(b)))
            .collect();
        let mut kept = kept_of(points, &beside);
        let took = started.elapsed().as_secs_f64();
        whole.seconds.push(("clutter", took));
        let is_most = kept.len() as f64 >= (1.0 - MAX_LEFT_OUT_SHARE) * points.len() as f64;
        if kept.len() == points.len() || !is_most {
            return Ok(None);
        }
        let Some(mut part) = self.fit_alone(&kept)? else {
            return Ok(None);
        };
        let fringe = clutter.fringe(&part.fit, &kept);
        if fringe.contains(&true) && !keep.contains(&ClutterKind::Plane) {
            let mut of_kept = fringe.iter();
            for b in beside.iter_mut().filter(|b| b.is_none()) {
                *b = of_kept.next().filter(|f| **f).map(|_| ClutterKind::Plane);
            }
            kept = kept_of(points, &beside);
            let Some(mut again) = self.fit_alone(&kept)? else {
                return Ok(None);
            };
            again.fit.add_seconds(&part.fit.seconds);
            part = again;
        }
        part.fit = part.fit.with_left_out(&part.template, points, &beside);
        part.fit.warnings.extend(left_out(&beside));
        Ok(Some(part))
    }

    /// Fits some of the points; `None` if that fails, as with too few of them.
    fn fit_alone(&self, kept: &[Point3]) -> Result<Option<PosedFit>, FitScanError> {
        let template = self.fixed_template((self.make_template)(&InMemoryPoints(kept))?)?;
        let Ok(scan) = Scan::new(kept, &self.inner, self.control) else {
            return Ok(None);
        };
        Ok(self
            .fit_in_pose(&scan, &InMemoryPoints(kept), template)
            .ok())
    }

    /// Fits the points in any pose: if the template does not fit in the orientation of the scan,
    /// others are tried; then the box is measured along the template's own axes; then bounds that
    /// assume a complete part are widened if the fit has reached them.
    pub(crate) fn fit_in_pose(
        &self,
        scan: &Scan<'_>,
        points: &dyn CloudExtent,
        template: ConstrainedTemplate,
    ) -> Result<PosedFit, FitScanError> {
        let (inner, control) = (&self.inner, self.control);
        let is_free = self.options.start.is_none()
            && self.options.bounds.is_empty()
            && inner.method == Method::Default;
        if !is_free {
            let fit = fit_to(scan, &template, inner, control)?;
            return Ok(PosedFit { template, fit });
        }
        let candidate = search(scan, &template, inner, control)?;
        let mut found = PosedCandidate {
            template,
            candidate,
        };
        if !found.candidate.is_at_noise() {
            self.try_turned(scan, points, &mut found)?;
        }
        self.try_aligned(scan, points, &mut found)?;
        let misfit = found.candidate.misfit;
        let fit = settle(scan, &found.template, inner, control, found.candidate)?;
        self.widened(
            scan,
            points,
            PosedFit {
                template: found.template,
                fit,
            },
            misfit,
        )
    }

    /// Tries the template in other orientations.
    fn try_turned(
        &self,
        scan: &Scan<'_>,
        points: &dyn CloudExtent,
        best: &mut PosedCandidate,
    ) -> Result<(), FitScanError> {
        let quick = Options {
            most_starts: STARTS_PER_ORIENTATION,
            refine: false,
            ..self.inner.clone()
        };
        for frep in best.template.frep.turned_in(points) {
            if self.control.is_stopped() {
                break;
            }
            let turned = self.fixed_template(frep)?;
            let Ok(candidate) = search(scan, &turned, &quick, self.control) else {
                continue;
            };
            let is_better = candidate.misfit < MAX_BETTER_MISFIT_RATIO * best.candidate.misfit;
            best.offer(turned, candidate, is_better);
            if best.candidate.is_at_noise() {
                break;
            }
        }
        Ok(())
    }

    /// Tries a scan that is tilted, or whose search is doubtful, along the template's own axes.
    fn try_aligned(
        &self,
        scan: &Scan<'_>,
        points: &dyn CloudExtent,
        best: &mut PosedCandidate,
    ) -> Result<(), FitScanError> {
        let (frep, values) = (&best.template.frep, best.candidate.values());
        let is_settled = best.candidate.is_at_noise() && best.candidate.is_certain();
        let is_tilted = frep.rodrigues_length(values) > MIN_TILT;
        if (is_settled && !is_tilted) || self.control.is_stopped() {
            return Ok(());
        }
        let aligned = self.fixed_template(frep.aligned_in(values, points))?;
        let mut other = Options {
            seed: self.inner.seed ^ SECOND_SEED_BITS,
            refine: self.inner.refine && is_tilted,
            ..self.inner.clone()
        };
        let Ok(mut found) = search(scan, &aligned, &other, self.control) else {
            return Ok(());
        };
        // Along the axes an equal minimum is preferred. Otherwise pieces are perturbed only if the
        // search has found a better one.
        let most = match is_tilted {
            true => best.candidate.misfit / MAX_BETTER_MISFIT_RATIO,
            false => best.candidate.misfit * MAX_BETTER_MISFIT_RATIO,
        };
        let is_better = found.misfit < most;
        if is_better && other.refine != self.inner.refine {
            other.refine = true;
            let Ok(mut refined) = search(scan, &aligned, &other, self.control) else {
                return Ok(());
            };
            refined.add_seconds(found.seconds());
            found = refined;
        }
        if agree(&found, best.candidate.misfit) {
            found.confirm();
            best.candidate.confirm();
        }
        best.offer(aligned, found, is_better);
        Ok(())
    }

    /// Widens bounds that are shares of the box if the fit has reached them. `misfit` is that of
    /// the candidate from which the fit comes.
    fn widened(
        &self,
        scan: &Scan<'_>,
        points: &dyn CloudExtent,
        mut best: PosedFit,
        mut misfit: f64,
    ) -> Result<PosedFit, FitScanError> {
        for _ in 0..MAX_WIDENING_ROUNDS {
            let near = if best.fit.acceptable {
                BOUND_DISTANCE_SHARE
            } else {
                DOUBTFUL_BOUND_DISTANCE_SHARE
            };
            let values = best.fit.values();
            let Some(frep) = best.template.frep.widened_in(&values, points, near) else {
                break;
            };
            if self.control.is_stopped() {
                best.fit.stop_early();
                break;
            }
            let wider = self.fixed_template(frep)?;
            if self.stays(scan, &wider, &mut best, misfit) {
                if self.control.is_stopped() {
                    best.fit.stop_early();
                }
                break;
            }
            let Ok(candidate) = search(scan, &wider, &self.inner, self.control) else {
                break;
            };
            misfit = candidate.misfit;
            let mut again = settle(scan, &wider, &self.inner, self.control, candidate)?;
            let cost = |f: &Fit| f.rms * (1.0 + f.n_outliers as f64 / f.n_points as f64);
            if cost(&again) > cost(&best.fit) / MAX_BETTER_MISFIT_RATIO {
                best.fit.add_seconds(&again.seconds);
                break;
            }
            again.add_seconds(&best.fit.seconds);
            best = PosedFit {
                template: wider,
                fit: again,
            };
        }
        Ok(best)
    }

    /// Returns true if a search within wider bounds, without perturbed pieces, leads back to the
    /// fit: to values within its own bounds, and to an equal misfit or to noise. The time of the
    /// search counts as that of the fit.
    fn stays(
        &self,
        scan: &Scan<'_>,
        wider: &ConstrainedTemplate,
        fit: &mut PosedFit,
        misfit: f64,
    ) -> bool {
        let quick = Options {
            start: Some(fit.fit.values()),
            refine: false,
            ..self.inner.clone()
        };
        let Ok(found) = search(scan, wider, &quick, self.control) else {
            return false;
        };
        fit.fit.add_seconds(found.seconds());
        let bounds = fit.template.parameters();
        (found.is_at_noise() || agree(&found, misfit))
            && found.values().iter().zip(bounds).all(|(v, p)| p.allows(*v))
    }

    /// Returns the template with the parameters that the caller fixes.
    fn fixed_template(&self, frep: FrepTemplate) -> Result<ConstrainedTemplate, FitScanError> {
        let mut template = ConstrainedTemplate::new(frep, self.origin);
        fix_parameters(&mut template, self.options)?;
        Ok(template)
    }
}
