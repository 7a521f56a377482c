//! HyperFun program as a template for fitting, with a pose of its own if the program or the caller
//! requests one.

use crate::ModelTape;
use isoform_field::hyperfun::{
    Amount, Fixed, Model, ParamInfo, Placement, Pose, QuantityKind as ProgramKind,
};
use isoform_field::{Distance, Graph, Interpreted, NodeId, Ops, Residual, Shape, Tape};
use isoform_fit::{Kind, Parameter, Template, Tie};
use isoform_geom::{Aabb, DistanceField, Frame, ParamField, Point3};
use isoform_num::linalg::symmetric_eigen;

/// Reason why a program cannot be a template.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TemplateError {
    /// The object does not describe a solid in space.
    #[error("the model has {found} coordinates, a template for points in space has 3")]
    Dimension {
        /// Number of coordinates of the object.
        found: usize,
    },
}

/// Rotation matrix, by rows.
pub(crate) type Rotation = [[f64; 3]; 3];

/// All poses; recipes store the index of a pose in this list.
const POSES: [Pose; 5] = [
    Pose::None,
    Pose::Translate,
    Pose::Axis,
    Pose::Rigid,
    Pose::Similarity,
];

/// Extent of a cloud, in memory or in chunks: the data from which a template takes its frame and
/// bounds.
pub(crate) trait CloudExtent {
    /// Returns the second moments about the centre of the bounding box, by rows; `None` for fewer
    /// than four points.
    fn moments(&self) -> Option<[f64; 9]>;
    /// Returns the bounding box in the coordinates along the columns of a rotation.
    fn bounds_along(&self, base: &Rotation) -> Aabb;
}

/// Cloud in memory.
pub(crate) struct InMemoryPoints<'a>(pub(crate) &'a [Point3]);

impl CloudExtent for InMemoryPoints<'_> {
    fn moments(&self) -> Option<[f64; 9]> {
        let center = Aabb::from_points(self.0).center();
        (self.0.len() >= 4).then(|| isoform_fit::chunks::moments(self.0, center))
    }
    fn bounds_along(&self, base: &Rotation) -> Aabb {
        let turned = self.0.iter().map(|p| isoform_fit::chunks::along(base, p));
        Aabb::from_points(&turned.collect::<Vec<_>>())
    }
}

const IDENTITY: Rotation = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Compiled HyperFun program: its own function for the search, its metric function for distances,
/// and its parts.
///
/// With a pose, the point x of space becomes the model's point p = C(r)ᵀ R₀ᵀ (x − t) / scale: R₀ is
/// a fixed base rotation, C(r) the Cayley rotation of the Rodrigues vector r (tan of half the angle
/// along the axis), smooth everywhere below 180°. The parameters t, r and scale follow those of the
/// program.
pub struct FrepTemplate {
    model: Model,
    pose: Pose,
    base: Rotation,
    /// Translation that the program states for its pose, near which fits must stay; `None` if the
    /// points determine it.
    at: Option<Point3>,
    /// Factors by which the lower and upper bound of each parameter of the program were widened;
    /// they apply to bounds that are shares of the box.
    slack: Vec<(f64, f64)>,
    parameters: Vec<Parameter>,
    algebraic: Box<dyn ParamField>,
    metric: Box<dyn ParamField>,
    distance: Option<Distance>,
    /// Field that returns the index of the active part; `None` if there is only one part.
    part: Option<Residual>,
    part_names: Vec<String>,
}

impl FrepTemplate {
    /// Compiles a model with the pose that the program states (`-- @pose`), none by default. The
    /// base rotation is computed from the points.
    ///
    /// # Errors
    /// [`TemplateError`] if the object is not a function of space.
    pub fn new(model: &Model, points: &[Point3]) -> Result<Self, TemplateError> {
        Self::with_pose(model, model.info().pose.unwrap_or(Pose::None), points)
    }

    /// Compiles a model with a given pose instead of the program's.
    ///
    /// # Errors
    /// [`TemplateError`] if the object is not a function of space.
    pub fn with_pose(model: &Model, pose: Pose, points: &[Point3]) -> Result<Self, TemplateError> {
        Self::compile_in_pose(model, pose, &InMemoryPoints(points), [0.0; 3])
    }

    /// Compiles a model for a cloud that need not be in memory, relative to an origin.
    pub(crate) fn compile_in_pose(
        model: &Model,
        pose: Pose,
        points: &dyn CloudExtent,
        origin: Point3,
    ) -> Result<Self, TemplateError> {
        let stated = model.info().place.as_ref();
        let stated = stated.filter(|_| model.info().pose == Some(pose));
        let base = match (pose, stated) {
            (Pose::None | Pose::Translate, _) => IDENTITY,
            (_, Some(stated)) => stated.rotation,
            _ => upright_axes(points),
        };
        let at = stated.map(|stated| isoform_geom::sub(stated.translation, origin));
        Self::with_base(model, pose, (base, at), points)
    }

    /// Compiles the template of a recipe of [`Template::recipe`]. Its functions are those of the
    /// original, its bounds are not. `None` if the numbers are not a recipe.
    pub(crate) fn from_recipe(
        model: &Model,
        recipe: &[f64],
    ) -> Option<Result<Self, TemplateError>> {
        let (pose, base) = recipe.split_first()?;
        let pose = *POSES.get(*pose as usize)?;
        let base: &[f64; 9] = base.try_into().ok()?;
        let base = std::array::from_fn(|i| std::array::from_fn(|j| base[3 * i + j]));
        Some(Self::with_base(
            model,
            pose,
            (base, None),
            &InMemoryPoints(&[]),
        ))
    }

    /// Compiles a model with a base rotation and, if one is stated, a translation.
    fn with_base(
        model: &Model,
        pose: Pose,
        place: (Rotation, Option<Point3>),
        points: &dyn CloudExtent,
    ) -> Result<Self, TemplateError> {
        let slack = vec![(1.0, 1.0); model.n_params()];
        Self::with_base_and_slack(model, pose, place, points, &slack)
    }

    /// Compiles a model with a base rotation and a stated translation, and with factors on bounds
    /// that are shares of the box.
    fn with_base_and_slack(
        model: &Model,
        pose: Pose,
        (base, at): (Rotation, Option<Point3>),
        points: &dyn CloudExtent,
        slack: &[(f64, f64)],
    ) -> Result<Self, TemplateError> {
        if model.dimension() != 3 {
            return Err(TemplateError::Dimension {
                found: model.dimension(),
            });
        }
        let own = model.n_params();
        let (extents, center) = extents_along(&base, points);
        let mut parameters: Vec<Parameter> = model
            .params()
            .iter()
            .zip(slack)
            .map(|(info, slack)| own_parameter(info, extents, *slack))
            .collect();
        parameters.extend(pose_parameters(pose, extents, center, at));
        let n = parameters.len();
        let mut posed = Graph::new();
        let (point, scale) = posed_point(&mut posed, pose, &base, own);
        let mut graph = Graph::new();
        let Ok(root) = model.compile(&mut graph) else {
            let point = Tape::new(&posed, &point, 3, n);
            return Ok(Self {
                algebraic: Box::new(Interpreted::new(model.clone(), point.clone(), false)),
                metric: Box::new(Interpreted::new(model.clone(), point, true)),
                distance: None,
                part: None,
                part_names: vec![model.name().to_owned()],
                model: model.clone(),
                pose,
                base,
                at,
                slack: slack.to_vec(),
                parameters,
            });
        };
        let shape = Shape::new(&mut graph, root);
        let a: Vec<NodeId> = (0..own).map(|i| posed.param(i)).collect();
        let place =
            |posed: &mut Graph, id: NodeId| graph.rewrite(id, posed, &point, &a, |_, _, _| {});
        let f = place(&mut posed, root);
        let distance = place(&mut posed, shape.distance);
        let part = place(&mut posed, shape.part);
        let exact = Distance::new(&shape, &mut posed, n, place);
        let distance = scale.map_or(distance, |s| posed.mul(&distance, &s));
        let compile = |root: NodeId| Residual::new(Tape::new(&posed, &[root], 3, n));
        Ok(Self {
            model: model.clone(),
            pose,
            base,
            at,
            slack: slack.to_vec(),
            algebraic: Box::new(compile(f)),
            metric: Box::new(compile(distance)),
            distance: exact,
            part: Some(compile(part)),
            part_names: shape.parts.into_iter().map(|p| p.name).collect(),
            parameters,
        })
    }

    /// Returns templates with other base rotations, for scans that do not stand upright: the
    /// model's z axis along each principal axis of the points, in both directions, each with four
    /// rotations about it by quarter turns if the pose has one. Rotations within 20° of this
    /// template's base are left out, unless the program states its pose: the others need not stay
    /// near that.
    pub fn turned(&self, points: &[Point3]) -> Vec<Self> {
        self.turned_in(&InMemoryPoints(points))
    }

    /// Does the work of [`Self::turned`] for a cloud that need not be in memory.
    pub(crate) fn turned_in(&self, points: &dyn CloudExtent) -> Vec<Self> {
        let spins = match self.pose {
            Pose::None | Pose::Translate if self.at.is_none() => return Vec::new(),
            Pose::None | Pose::Translate => {
                let free = Self::with_base(&self.model, self.pose, (IDENTITY, None), points);
                return free.into_iter().collect();
            }
            Pose::Axis => 1,
            Pose::Rigid | Pose::Similarity => 4,
        };
        let Some(axes) = principal_axes(points).map(|(_, axes)| axes) else {
            return Vec::new();
        };
        let mut bases: Vec<Rotation> = Vec::new();
        for spin in 0..spins {
            for (k, sign) in UP_AXES {
                let base = base_rotation(&axes, k, sign, spin);
                let alike = |other: &Rotation| is_alike(self.pose, other, &base);
                let is_tried = self.at.is_none() && alike(&self.base);
                if !is_tried && !bases.iter().any(alike) {
                    bases.push(base);
                }
            }
        }
        bases
            .into_iter()
            .filter_map(|base| Self::with_base(&self.model, self.pose, (base, None), points).ok())
            .collect()
    }

    /// Returns the length of the fitted Rodrigues vector: tan of half the angle between the pose
    /// and the base.
    pub fn rodrigues_length(&self, values: &[f64]) -> f64 {
        let q = &values[self.model.n_params()..];
        let r = match self.pose {
            Pose::None | Pose::Translate => return 0.0,
            Pose::Axis => &q[3..5],
            Pose::Rigid | Pose::Similarity => &q[3..6],
        };
        r.iter().map(|v| v * v).sum::<f64>().sqrt()
    }

    /// Returns the template with its fitted pose as the base. The bounding box of the points, of
    /// which bounds and starts may be shares, is then measured along the template's own axes.
    pub fn aligned(&self, values: &[f64], points: &[Point3]) -> Self {
        self.aligned_in(values, &InMemoryPoints(points))
    }

    /// Does the work of [`Self::aligned`] for a cloud that need not be in memory.
    pub(crate) fn aligned_in(&self, values: &[f64], points: &dyn CloudExtent) -> Self {
        let place = match self.placement(values) {
            Some(p) => (p.rotation, self.at.map(|_| p.translation)),
            None => (self.base, self.at),
        };
        Self::with_base_and_slack(&self.model, self.pose, place, points, &self.slack)
            .expect("the model was compiled before")
    }

    /// Returns the template with wider bounds for values that have reached bounds that are shares
    /// of the box, as these assume that the scan shows the whole part. A value has reached a bound
    /// if it is nearer than `near` times its range. `None` if no value has.
    pub fn widened(&self, values: &[f64], points: &[Point3], near: f64) -> Option<Self> {
        self.widened_in(values, &InMemoryPoints(points), near)
    }

    /// Does the work of [`Self::widened`] for a cloud that need not be in memory.
    pub(crate) fn widened_in(
        &self,
        values: &[f64],
        points: &dyn CloudExtent,
        near: f64,
    ) -> Option<Self> {
        let mut slack = self.slack.clone();
        let mut is_wider = false;
        for (i, info) in self.model.params().iter().enumerate() {
            let p = &self.parameters[i];
            let range = p.max.unwrap_or(f64::INFINITY) - p.min.unwrap_or(f64::NEG_INFINITY);
            let gap = (near * range).max(0.0);
            let is_share = |amount: Option<Amount>| amount.is_some_and(Amount::is_share);
            if is_share(info.max) && p.max.is_some_and(|max| values[i] > max - gap) {
                (slack[i].1, is_wider) = (slack[i].1 * BOUND_WIDENING_FACTOR, true);
            }
            if is_share(info.min) && p.min.is_some_and(|min| values[i] < min + gap) {
                (slack[i].0, is_wider) = (slack[i].0 / BOUND_WIDENING_FACTOR, true);
            }
        }
        is_wider.then(|| {
            let place = (self.base, self.at);
            Self::with_base_and_slack(&self.model, self.pose, place, points, &slack)
                .expect("the model was compiled before")
        })
    }

    /// Returns the tape of the template, for other evaluators; `None` if the program is not an
    /// expression. `parameters` are the template's own, or those of the caller: tied ones follow
    /// the others, and values given for them are ignored.
    pub fn model_tape(&self, parameters: &[Parameter]) -> Option<ModelTape> {
        let own = self.model.n_params();
        let mut posed = Graph::new();
        let (point, scale) = posed_point(&mut posed, self.pose, &self.base, own);
        let mut graph = Graph::new();
        let root = self.model.compile(&mut graph).ok()?;
        let shape = Shape::new(&mut graph, root);
        let mut a: Vec<NodeId> = (0..own).map(|i| posed.param(i)).collect();
        for (i, parameter) in parameters.iter().enumerate().take(own) {
            if let Some(tie) = &parameter.tie {
                a[i] = tie_value(&mut posed, tie);
            }
        }
        let mut roots = shape.pieces;
        roots.extend([shape.distance, shape.part]);
        let mut roots = graph.rewrite_all(&roots, &mut posed, &point, &a, |_, _, _| {});
        if let Some(scale) = scale {
            let distance = roots.len() - 2;
            roots[distance] = posed.mul(&roots[distance], &scale);
        }
        Some(ModelTape {
            tape: Tape::new(&posed, &roots, 3, self.parameters.len()),
            tree: shape.tree,
            part_names: shape.parts.into_iter().map(|p| p.name).collect(),
        })
    }

    /// Returns the program.
    pub fn model(&self) -> &Model {
        &self.model
    }
    /// Returns the pose that is fitted.
    pub fn pose(&self) -> Pose {
        self.pose
    }

    /// Returns the pose of the model for values of all parameters; `None` for a template without
    /// one.
    pub fn placement(&self, values: &[f64]) -> Option<Placement> {
        let q = &values[self.model.n_params()..];
        let translation = match self.pose {
            Pose::None => return None,
            _ => [q[0], q[1], q[2]],
        };
        let r = match self.pose {
            Pose::None | Pose::Translate => [0.0; 3],
            Pose::Axis => [q[3], q[4], 0.0],
            Pose::Rigid | Pose::Similarity => [q[3], q[4], q[5]],
        };
        let scale = if self.pose == Pose::Similarity {
            q[6]
        } else {
            1.0
        };
        Some(Placement {
            rotation: product(&self.base, &cayley(r)),
            translation,
            scale,
        })
    }

    /// Prints the program with the values, as plain HyperFun in the coordinates of the file whose
    /// points were fitted relative to `origin`.
    pub fn fitted_program(&self, values: &[f64], origin: Point3) -> String {
        let placement = match self.placement(values) {
            Some(p) => Some(p),
            None if origin != [0.0; 3] => Some(Placement {
                rotation: IDENTITY,
                translation: [0.0; 3],
                scale: 1.0,
            }),
            None => None,
        };
        let moved = placement.map(|p| Placement {
            translation: std::array::from_fn(|i| p.translation[i] + origin[i]),
            ..p
        });
        self.model
            .print_fitted(&values[..self.model.n_params()], moved.as_ref())
    }
}

impl std::fmt::Debug for FrepTemplate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FrepTemplate")
            .field("model", &self.model.name())
            .field("pose", &self.pose)
            .finish_non_exhaustive()
    }
}

impl Template for FrepTemplate {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }
    fn algebraic(&self) -> &dyn ParamField {
        self.algebraic.as_ref()
    }
    fn metric(&self) -> &dyn ParamField {
        self.metric.as_ref()
    }
    fn distance(&self) -> Option<&dyn DistanceField> {
        self.distance.as_ref().map(|d| d as &dyn DistanceField)
    }
    fn frame(&self, a: &[f64]) -> Frame {
        self.placement(a).map_or(Frame::SPACE, |p| Frame {
            rotation: p.rotation,
            translation: p.translation,
        })
    }
    fn part_names(&self) -> &[String] {
        &self.part_names
    }
    fn recipe(&self) -> Vec<f64> {
        let pose = POSES.iter().position(|pose| *pose == self.pose);
        let pose = pose.expect("every pose is listed") as f64;
        std::iter::once(pose)
            .chain(self.base.into_iter().flatten())
            .collect()
    }
    fn parts(&self, points: &[Point3], a: &[f64], out: &mut [u32]) {
        let mut values = vec![0.0; points.len()];
        if let Some(part) = &self.part {
            part.values(points, a, &mut values);
        }
        for (o, v) in out.iter_mut().zip(values) {
            *o = v as u32;
        }
    }
}

/// Index of the principal axis along which the model's z axis is placed, and its direction.
const UP_AXES: [(usize, f64); 6] = [
    (0, 1.0),
    (0, -1.0),
    (1, 1.0),
    (1, -1.0),
    (2, 1.0),
    (2, -1.0),
];

/// Returns the rotation with z along ± axis `k` and x along another axis, after `spin` quarter
/// turns about z.
fn base_rotation(axes: &[Point3; 3], k: usize, sign: f64, spin: usize) -> Rotation {
    let z = axes[k].map(|v| sign * v);
    let x = if spin.is_multiple_of(2) {
        axes[(k + 1) % 3]
    } else {
        axes[(k + 2) % 3]
    };
    let x = if spin < 2 { x } else { x.map(|v| -v) };
    let y = isoform_geom::cross(z, x);
    std::array::from_fn(|i| [x[i], y[i], z[i]])
}

/// Returns true if two base rotations differ by less than 20°; for a pose without a rotation about
/// z, if their z axes do.
fn is_alike(pose: Pose, a: &Rotation, b: &Rotation) -> bool {
    match pose {
        Pose::Axis => (0..3).map(|i| a[i][2] * b[i][2]).sum::<f64>() > 0.94,
        // The trace is 1 + 2 cos of the angle between the two.
        _ => {
            (0..3)
                .flat_map(|i| (0..3).map(move |j| (i, j)))
                .map(|(i, j)| a[i][j] * b[i][j])
                .sum::<f64>()
                > 2.88
        }
    }
}

/// Converts the kind of a program's parameter to that of the fit.
fn kind_of(kind: ProgramKind) -> Kind {
    match kind {
        ProgramKind::X => Kind::X,
        ProgramKind::Y => Kind::Y,
        ProgramKind::Z => Kind::Z,
        ProgramKind::Length => Kind::Length,
        ProgramKind::Angle => Kind::Angle,
        ProgramKind::Ratio => Kind::Ratio,
        ProgramKind::Number => Kind::Number,
    }
}

/// Returns the value of a tie as an expression of the parameters that it follows.
fn tie_value(graph: &mut Graph, tie: &Tie) -> NodeId {
    let mut sum = graph.constant(tie.constant);
    for &(i, factor) in &tie.terms {
        let (factor, value) = (graph.constant(factor), graph.param(i));
        let term = graph.mul(&factor, &value);
        sum = graph.add(&sum, &term);
    }
    sum
}

/// Returns a bound, multiplied by the factor if it is a share of the box. A factor below 1 lowers
/// positive and negative bounds.
fn widened_bound(bound: Amount, extents: Point3, factor: f64) -> f64 {
    let value = bound.resolve(extents);
    let factor = if value < 0.0 { 1.0 / factor } else { factor };
    if bound.is_share() {
        factor * value
    } else {
        value
    }
}

/// Converts a parameter of the program, for points in a box with these extents; `slack` are the
/// factors on its bounds if these are shares of the box.
fn own_parameter(info: &ParamInfo, extents: Point3, slack: (f64, f64)) -> Parameter {
    let amount = |v: Option<Amount>| v.map(|v| v.resolve(extents));
    let widened = |v: Option<Amount>, factor| v.map(|v| widened_bound(v, extents, factor));
    Parameter {
        name: info.name.clone(),
        kind: kind_of(info.kind),
        min: widened(info.min, slack.0),
        max: widened(info.max, slack.1),
        start: amount(info.start),
        fixed: info.fixed.and_then(|f| match f {
            Fixed::At(v) => Some(v),
            Fixed::AtStart => amount(info.start),
        }),
        tie: info.tie.as_ref().map(|t| Tie {
            constant: t.constant,
            terms: t.terms.clone(),
        }),
        unit: info.unit.clone(),
        is_pose: false,
    }
}

/// Factor by which a bound is widened. A quarter of a round part shows half of its box: widening it
/// twice suffices.
const BOUND_WIDENING_FACTOR: f64 = 2.0;
/// Maximum of each component of the Rodrigues vector about the base rotation: 53° about each axis.
/// The base is at most 45° off for shapes whose principal axes are distinct, and scans of other
/// shapes mostly stand upright.
const MAX_RODRIGUES_COMPONENT: f64 = 0.5;
/// Share of the data's box by which it is enlarged on each side in the search for the model's
/// origin: templates keep their origin inside the shape.
const POSITION_MARGIN_SHARE: f64 = 0.25;

/// Factor on the bounds of the position and the rotation if the program states the pose.
const STATED_POSE_BOUND_SHARE: f64 = 0.1;

/// Returns the parameters of a pose, for points in a box with these extents about `center`; near
/// `at`, the position of the model's origin, if that is stated.
fn pose_parameters(
    pose: Pose,
    extents: Point3,
    center: Point3,
    at: Option<Point3>,
) -> Vec<Parameter> {
    let turns: &[&str] = match pose {
        Pose::None => return Vec::new(),
        Pose::Translate => &[],
        Pose::Axis => &["pose_rx", "pose_ry"],
        Pose::Rigid | Pose::Similarity => &["pose_rx", "pose_ry", "pose_rz"],
    };
    let share = if at.is_some() {
        STATED_POSE_BOUND_SHARE
    } else {
        1.0
    };
    let reach = share * (0.5 + POSITION_MARGIN_SHARE) * extents.into_iter().fold(0.0, f64::max);
    let turn = share * MAX_RODRIGUES_COMPONENT;
    let center = at.unwrap_or(center);
    let position = [
        ("pose_x", Kind::X),
        ("pose_y", Kind::Y),
        ("pose_z", Kind::Z),
    ];
    let limited = |name: &str, kind: Kind, lo: f64, start: f64, hi: f64| Parameter {
        min: (lo < hi).then_some(lo),
        max: (lo < hi).then_some(hi),
        start: Some(start),
        is_pose: true,
        ..Parameter::new(name, kind)
    };
    let place = |i: usize| {
        limited(
            position[i].0,
            position[i].1,
            center[i] - reach,
            center[i],
            center[i] + reach,
        )
    };
    let mut all: Vec<Parameter> = (0..3).map(place).collect();
    all.extend(
        turns
            .iter()
            .map(|name| limited(name, Kind::Ratio, -turn, 0.0, turn)),
    );
    if pose == Pose::Similarity {
        all.push(limited("pose_scale", Kind::Ratio, 1e-3, 1.0, 1e3));
    }
    all
}

/// Returns the extents of the points along the axes of the base rotation, and the centre of that
/// box in space.
fn extents_along(base: &Rotation, points: &dyn CloudExtent) -> (Point3, Point3) {
    let bounds = points.bounds_along(base);
    if bounds.is_empty() {
        return ([0.0; 3], [0.0; 3]);
    }
    let c = bounds.center();
    (
        bounds.size(),
        std::array::from_fn(|i| (0..3).map(|j| base[i][j] * c[j]).sum()),
    )
}

/// Returns the model's point as expressions of space and of the pose's parameters, which begin at
/// index `first`, and the scale, if there is one.
fn posed_point(
    g: &mut Graph,
    pose: Pose,
    base: &Rotation,
    first: usize,
) -> ([NodeId; 3], Option<NodeId>) {
    let x: [NodeId; 3] = std::array::from_fn(|i| g.x(i));
    if pose == Pose::None {
        return (x, None);
    }
    let moved: [NodeId; 3] = std::array::from_fn(|i| {
        let t = g.param(first + i);
        g.sub(&x[i], &t)
    });
    let turned = match pose {
        Pose::None | Pose::Translate => moved,
        Pose::Axis | Pose::Rigid | Pose::Similarity => {
            let y = in_base(g, base, &moved);
            let r = rodrigues(g, pose, first + 3);
            turned_back(g, &r, &y)
        }
    };
    if pose != Pose::Similarity {
        return (turned, None);
    }
    let scale = g.param(first + 6);
    (turned.map(|p| g.div(&p, &scale)), Some(scale))
}

/// Returns the Rodrigues vector of a pose whose rotation parameters begin at index `first`; a pose
/// that only tilts an axis has no rotation about z.
fn rodrigues(g: &mut Graph, pose: Pose, first: usize) -> [NodeId; 3] {
    let zero = g.constant(0.0);
    std::array::from_fn(|i| {
        if pose == Pose::Axis && i == 2 {
            zero
        } else {
            g.param(first + i)
        }
    })
}

/// Returns R₀ᵀ x for the base rotation R₀.
fn in_base(g: &mut Graph, base: &Rotation, x: &[NodeId; 3]) -> [NodeId; 3] {
    std::array::from_fn(|j| {
        let terms: [NodeId; 3] = std::array::from_fn(|i| g.scale(base[i][j], &x[i]));
        let s = g.add(&terms[0], &terms[1]);
        g.add(&s, &terms[2])
    })
}

/// Returns C(r)ᵀ y = ((1 − r²) y + 2 r (r·y) − 2 r × y) / (1 + r²).
fn turned_back(g: &mut Graph, r: &[NodeId; 3], y: &[NodeId; 3]) -> [NodeId; 3] {
    let dot = |g: &mut Graph, u: &[NodeId; 3], v: &[NodeId; 3]| {
        let t: [NodeId; 3] = std::array::from_fn(|i| product_or_zero(g, u[i], v[i]));
        let s = g.add(&t[0], &t[1]);
        g.add(&s, &t[2])
    };
    let (r2, ry) = (dot(g, r, r), dot(g, r, y));
    let one = g.constant(1.0);
    let (less, more) = (g.sub(&one, &r2), g.add(&one, &r2));
    let ry2 = g.scale(2.0, &ry);
    // Divisions depend on the parameters only and are computed once per call, not per point.
    let (c, k) = (g.div(&less, &more), g.div(&one, &more));
    let k2 = g.scale(2.0, &k);
    std::array::from_fn(|i| {
        let (j, l) = ((i + 1) % 3, (i + 2) % 3);
        let (p, q) = (
            product_or_zero(g, r[j], y[l]),
            product_or_zero(g, r[l], y[j]),
        );
        let cross = g.sub(&p, &q);
        let s = g.mul(&c, &y[i]);
        let along = product_or_zero(g, r[i], ry2);
        let along = product_or_zero(g, k, along);
        let across = g.mul(&k2, &cross);
        let s = g.add(&s, &along);
        g.sub(&s, &across)
    })
}

/// Returns u v; the constant 0 if a factor is the constant 0.
fn product_or_zero(g: &mut Graph, u: NodeId, v: NodeId) -> NodeId {
    let zero = g.constant(0.0);
    if u == zero || v == zero {
        zero
    } else {
        g.mul(&u, &v)
    }
}

/// Returns the matrix product.
fn product(a: &Rotation, b: &Rotation) -> Rotation {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Returns the rotation by 2 atan|r| about r.
fn cayley(r: Point3) -> Rotation {
    let r2 = isoform_geom::dot(r, r);
    let skew = [[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]];
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let unit = f64::from(u8::from(i == j));
            ((1.0 - r2) * unit + 2.0 * r[i] * r[j] + 2.0 * skew[i][j]) / (1.0 + r2)
        })
    })
}

/// Returns the principal axes of the points as a rotation, with the order and signs of the smallest
/// angle, since scans mostly stand upright. Axes whose moments are equal within a tenth are left at
/// the coordinate axes.
fn upright_axes(points: &dyn CloudExtent) -> Rotation {
    let Some((values, axes)) = principal_axes(points) else {
        return IDENTITY;
    };
    let alike = |i: usize, j: usize| values[j] - values[i] < 0.1 * values[j];
    match (alike(0, 1), alike(1, 2)) {
        (true, true) => IDENTITY,
        (false, false) => nearest_frame(&axes),
        // Two equal moments determine only the third axis: the nearest coordinate axis is turned
        // into it.
        (true, false) => shortest_turn(axes[2]),
        (false, true) => shortest_turn(axes[0]),
    }
}

/// Returns the moments, rising, and the principal axes of the points as a right-handed frame;
/// `None` for fewer than four points.
fn principal_axes(points: &dyn CloudExtent) -> Option<([f64; 3], [Point3; 3])> {
    let moments = points.moments()?;
    if moments.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let (values, vectors) = symmetric_eigen(&moments, 3);
    let (e0, e1) = (
        [vectors[0], vectors[1], vectors[2]],
        [vectors[3], vectors[4], vectors[5]],
    );
    Some((
        [values[0], values[1], values[2]],
        [e0, e1, isoform_geom::cross(e0, e1)],
    ))
}

/// Returns the proper rotation with columns ± the axes in some order that has the largest trace.
fn nearest_frame(axes: &[Point3; 3]) -> Rotation {
    const ORDERS: [([usize; 3], f64); 6] = [
        ([0, 1, 2], 1.0),
        ([1, 2, 0], 1.0),
        ([2, 0, 1], 1.0),
        ([0, 2, 1], -1.0),
        ([2, 1, 0], -1.0),
        ([1, 0, 2], -1.0),
    ];
    let det = isoform_geom::dot(axes[0], isoform_geom::cross(axes[1], axes[2])).signum();
    let mut best = (f64::NEG_INFINITY, IDENTITY);
    for (order, parity) in ORDERS {
        for signs in 0..8u32 {
            let sign = |k: usize| if signs >> k & 1 == 1 { -1.0 } else { 1.0 };
            if sign(0) * sign(1) * sign(2) * parity * det < 0.0 {
                continue;
            }
            let rotation: Rotation =
                std::array::from_fn(|i| std::array::from_fn(|j| sign(j) * axes[order[j]][i]));
            let trace = rotation[0][0] + rotation[1][1] + rotation[2][2];
            if trace > best.0 {
                best = (trace, rotation);
            }
        }
    }
    best.1
}

/// Returns the smallest rotation that takes a coordinate axis to ± the given direction.
fn shortest_turn(direction: Point3) -> Rotation {
    let k = (0..3).fold(0, |b, i| {
        if direction[i].abs() > direction[b].abs() {
            i
        } else {
            b
        }
    });
    let sign = direction[k].signum();
    let to = direction.map(|v| sign * v);
    let mut from = [0.0; 3];
    from[k] = 1.0;
    // r = tan(angle/2) · axis, and tan(angle/2) = sin/(1 + cos).
    let axis = isoform_geom::cross(from, to);
    let c = 1.0 + isoform_geom::dot(from, to);
    cayley(axis.map(|v| v / c))
}

#[cfg(test)]
mod tests {
    use super::*;
    use isoform_field::hyperfun::Mode;

    const BLOCK: &str = "-- @pose rigid
my_model(x[3], a[3]) { array v[3]; v[1] = 0-a[1]/2; v[2] = 0-a[2]/2; v[3] = 0-a[3]/2; my_model = hfBlock(x, v, a[1], a[2], a[3]); }";

    #[test]
    fn placement_undoes_the_pose() {
        let model = Model::parse(BLOCK, Mode::Default).expect("a program");
        let points: Vec<Point3> = (0..60)
            .map(|i| [f64::from(i), f64::from(i * i % 17), f64::from(i % 3)])
            .collect();
        let template = FrepTemplate::new(&model, &points).expect("a template");
        let values = [2.0, 3.0, 4.0, 0.5, -0.25, 1.0, 0.3, -0.2, 0.1];
        let place = template.placement(&values).expect("a pose");
        // The posed function vanishes at the image of a corner of the model.
        let corner = [1.0, 1.5, 2.0];
        let at: Point3 = std::array::from_fn(|i| {
            (0..3)
                .map(|k| place.rotation[i][k] * corner[k])
                .sum::<f64>()
                + place.translation[i]
        });
        let mut d = [0.0];
        template.metric().values(&[at], &values, &mut d);
        assert!(d[0].abs() < 1e-12, "{}", d[0]);
        // The printed program agrees with the template.
        let printed = Model::parse(
            &template.fitted_program(&values, [10.0, 0.0, 0.0]),
            Mode::Default,
        )
        .expect("plain HyperFun");
        let p = [0.7, 0.1, -0.4];
        template.algebraic().values(&[p], &values, &mut d);
        let f = printed
            .eval(&[p[0] + 10.0, p[1], p[2]], &values[..3], &[])
            .expect("a value")
            .f;
        assert!(
            (f - d[0]).abs() < 1e-9 * (1.0 + f.abs()),
            "{f} against {}",
            d[0]
        );
    }

    #[test]
    fn bounds_give_way_where_values_come_near_them() {
        let text = "-- @pose translate\n-- @param a[1] r length min=10%x max=60%x\n\
            my_model(x[3], a[1]) { my_model = a[1]^2 - x[1]^2 - x[2]^2 - x[3]^2; }";
        let model = Model::parse(text, Mode::Default).expect("a program");
        let points = [[0.0; 3], [10.0, 0.0, 0.0], [5.0, 5.0, 5.0]];
        let template = FrepTemplate::new(&model, &points).expect("a template");
        let top = template.parameters()[0].max.expect("a bound");
        let range = top - template.parameters()[0].min.expect("a bound");
        let values = [top - 0.03 * range, 0.0, 0.0, 0.0];
        assert!(template.widened(&values, &points, 0.005).is_none());
        let wider = template.widened(&values, &points, 0.05).expect("near");
        assert!(wider.parameters()[0].max.expect("a bound") > 1.9 * top);
    }

    #[test]
    fn programs_that_are_no_expression_are_fitted_too() {
        // The loop's end depends on a parameter, so this is run statement by statement: a ball of
        // radius a[1] + 1, as three halves.
        let text = "my_model(x[3], a[4]) { array c[3]; c[1] = a[2]; c[2] = a[3]; c[3] = a[4]; r = 0; i = 0;
            while i < abs(a[1])*0 + 2 loop r = r + a[1]/2 + 0.5; i = i + 1; endloop; my_model = hfSphere(x, c, r); }";
        let model = Model::parse(text, Mode::Default).expect("a program");
        assert!(
            model.compile(&mut Graph::new()).is_err(),
            "the test needs a program that is no expression"
        );
        let points: Vec<Point3> = (0..300)
            .map(|i| {
                let (t, z) = (f64::from(i) * 2.4, f64::from(i) / 150.0 - 1.0);
                let r = (1.0 - z * z).sqrt();
                [1.0 + 2.5 * r * t.cos(), 2.5 * r * t.sin() - 0.5, 2.5 * z]
            })
            .collect();
        let template = FrepTemplate::new(&model, &points).expect("a template");
        let found = isoform_fit::fit(
            &points,
            &template,
            &isoform_fit::Options::default(),
            &isoform_fit::Control::default(),
        )
        .expect("a fit");
        let a = found.values();
        // The radius counts squared: it may come with either sign.
        for (got, want) in [(a[0] + 1.0).abs(), a[1], a[2], a[3]]
            .into_iter()
            .zip([2.5, 1.0, -0.5, 0.0])
        {
            assert!((got - want).abs() < 1e-6, "{a:?}");
        }
    }

    #[test]
    fn cayley_is_a_rotation() {
        let r = cayley([0.3, -0.7, 0.2]);
        let s = product(
            &r,
            &std::array::from_fn(|i| std::array::from_fn(|j| r[j][i])),
        );
        for i in 0..3 {
            for j in 0..3 {
                assert!((s[i][j] - IDENTITY[i][j]).abs() < 1e-15);
            }
        }
        // A quarter turn about z takes x to y.
        assert!((cayley([0.0, 0.0, 1.0])[1][0] - 1.0).abs() < 1e-15);
    }
}
