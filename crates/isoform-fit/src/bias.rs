//! The bias of least squares caused by noise near edges and on curved faces.
//!
//! Noise carries points outwards across a convex edge more often than inwards. Near edges the mean
//! of the residuals is therefore not zero, and the minimum moves by an amount of the order of
//! noise² × edge length / area, which does not shrink with the number of points. Curvature has a
//! similar effect (Kanatani, *Guide to 3D Vision Computation*, chapter 2, for conics). The bias is
//! one Gauss-Newton step from the fit, computed from the expected effect of noise on points of the
//! fitted surface; it is subtracted. To second order in the noise, this effect has a closed form at
//! most points:
//!
//! - On a face, the mean distance is noise² / 2 × the sum of the principal curvatures.
//! - Near an isolated edge, it follows by quadrature for the tangent planes of the two faces
//!   ([`wedge`]).
//!
//! The closed forms are evaluated at the foot points of the data, which have the density of the
//! data and are equal in any pose. Elsewhere (corners, thin walls, narrow blends) noise is
//! simulated at random points of the surface. The variance of these random points is added to the
//! covariance.

mod moves;
mod places;
mod simulation;
mod wedge;

use self::wedge::{EdgeIntegralTable, EdgeIntegrals, REACH_DEVIATIONS, density};
use crate::Loss;
use crate::cells::Cells;
use crate::chunks::Cloud;
use crate::matrix::product;
use crate::polish::weight;
use crate::space::Space;
use crate::thresholds::MAX_BIAS_FEET;
use crate::vector::{add, is_finite};
use isoform_geom::{Aabb, DistanceField, Edge, Foot, Frame, Nearby, Point3, distance_squared};

/// Correction of a fit for the bias of noise.
pub(crate) struct Bias {
    /// Step to be added to the variables to remove the bias.
    pub(crate) correction: Vec<f64>,
    /// Covariance of the correction due to its random points.
    pub(crate) covariance: Vec<f64>,
    /// Root mean square of the distances over the noise that caused them.
    pub(crate) shrunk: f64,
}

/// A fit whose bias is estimated.
pub(crate) struct BiasProblem<'a> {
    pub(crate) distance: &'a dyn DistanceField,
    pub(crate) space: &'a Space,
    pub(crate) x: &'a [f64],
    /// Points that were fitted.
    pub(crate) points: &'a FittedPoints<'a>,
    /// Standard deviation of the noise that is independent between neighbouring points.
    pub(crate) noise: f64,
    pub(crate) loss: Loss,
    /// Robust scale of the loss.
    pub(crate) scale: f64,
    /// Inverse of the Hessian of the data.
    pub(crate) inverse: &'a [f64],
    /// Frame of the model; random points and noise are drawn in its coordinates.
    pub(crate) frame: Frame,
    pub(crate) seed: u64,
}

/// Points that were fitted.
pub(crate) enum FittedPoints<'a> {
    /// Held in memory.
    InMemory(Vec<Point3>),
    /// Held in chunks.
    InChunks(&'a Cloud<'a>),
}

impl FittedPoints<'_> {
    pub(crate) fn count(&self) -> usize {
        match self {
            Self::InMemory(points) => points.len(),
            Self::InChunks(cloud) => cloud.n_fitted(),
        }
    }

    /// Returns their bounding box in a frame.
    fn within(&self, frame: &Frame) -> Aabb {
        match self {
            Self::InMemory(points) => Aabb::from_points(&within(points, frame)),
            Self::InChunks(cloud) => cloud.within(frame),
        }
    }

    /// Counts them by cell of a grid in a frame.
    fn counted(&self, cells: &Cells, frame: &Frame) -> Vec<f64> {
        match self {
            Self::InMemory(points) => cells.counted(&within(points, frame)),
            Self::InChunks(cloud) => cloud.counted(cells, frame),
        }
    }

    /// Returns every `stride`-th point, at most [`MAX_BIAS_FEET`].
    fn strided(&self, stride: usize) -> Vec<Point3> {
        match self {
            Self::InMemory(points) => points.iter().step_by(stride).copied().collect(),
            Self::InChunks(cloud) => cloud.strided.clone(),
        }
    }
}

/// Transforms points to a frame.
fn within(points: &[Point3], frame: &Frame) -> Vec<Point3> {
    points.iter().map(|p| frame.within(*p)).collect()
}

/// Local geometry at a foot point, on the scale of the noise.
enum LocalGeometry {
    /// A face, with the sum of its principal curvatures.
    Face(f64),
    /// A face near a single edge, with the sum of its principal curvatures.
    Edge(Edge, f64),
    /// Anything else: no closed form is known.
    Other,
}

/// Sums over points with noise.
struct NoiseSums {
    /// Jᵀ r, the pull of the residuals on the variables.
    pull: Vec<f64>,
    /// Covariance of the pull.
    covariance: Vec<f64>,
    /// Weighted sum of squared distances.
    squares: f64,
    weights: f64,
}

impl NoiseSums {
    fn new(m: usize) -> Self {
        Self {
            pull: vec![0.0; m],
            covariance: vec![0.0; m * m],
            squares: 0.0,
            weights: 0.0,
        }
    }

    /// Adds the pull of one random point.
    fn add(&mut self, row: &[f64]) {
        let m = row.len();
        for j in 0..m {
            self.pull[j] += row[j];
            for k in 0..m {
                self.covariance[j * m + k] += row[j] * row[k];
            }
        }
    }
}

/// Foot points with their contributions to the pull, before derivatives are known.
#[derive(Default)]
struct Pulls {
    places: Vec<Foot>,
    shares: Vec<PullShare>,
}

/// Contribution of a foot point to the pull.
enum PullShare {
    /// Effect of the curvature of a face; deterministic.
    Face(f64),
    /// Effect on one of the two faces of an edge; the two entries are consecutive.
    Edge(f64),
}

impl Pulls {
    fn push(&mut self, place: Foot, share: PullShare) {
        self.places.push(place);
        self.shares.push(share);
    }
}

/// Accumulator of the closed-form bias, in the units of the fit.
struct ClosedFormBias<'a> {
    wedges: EdgeIntegralTable<'a>,
    noise: f64,
    /// Number of data points that each foot point represents.
    share: f64,
    /// Mean of ψ′, the factor by which the loss reduces a small shift.
    mean_slope: f64,
    pulls: Pulls,
}

impl ClosedFormBias<'_> {
    /// Adds a foot point. Returns false if no closed form is known there.
    fn add(&mut self, foot: &Foot, around: &LocalGeometry, sums: &mut NoiseSums) -> bool {
        let (bend, edge) = match around {
            LocalGeometry::Face(bend) => (*bend, None),
            LocalGeometry::Edge(edge, bend) => (*bend, Some(edge)),
            LocalGeometry::Other => return false,
        };
        sums.weights += self.share;
        sums.squares += self.share * (self.noise * self.noise);
        if let Some(edge) = edge {
            sums.squares += self.add_edge(foot, edge);
        }
        self.add_face(foot, bend);
        true
    }

    /// Adds the pull of a foot point on a face with this sum of curvatures.
    fn add_face(&mut self, foot: &Foot, bend: f64) {
        if bend != 0.0 && foot.order == 1 {
            let variance = self.noise * self.noise;
            let by = self.share * 0.5 * variance * self.mean_slope * bend;
            self.pulls.push(*foot, PullShare::Face(by));
        }
    }

    /// Adds the pull of a foot point near an edge, if it lies in the strip of the edge. Returns the
    /// contribution of the edge to the sum of squares.
    fn add_edge(&mut self, foot: &Foot, edge: &Edge) -> f64 {
        let is_in_strip = distance_squared(edge.at, foot.at).sqrt() < edge.width;
        if !is_in_strip {
            return 0.0;
        }
        let along = self.noise / edge.width;
        let wedge = self.wedges.at(edge.angle);
        for (face, by) in faces(edge).into_iter().zip(pulls_of(wedge, foot)) {
            let by = self.share * self.noise * along * by;
            self.pulls.push(face, PullShare::Edge(by));
        }
        self.share * (self.noise * self.noise) * along * wedge.squares
    }
}

/// Returns the pulls on the two faces of an edge. Feet on the edge itself come from either face.
fn pulls_of(wedge: EdgeIntegrals, foot: &Foot) -> [f64; 2] {
    if foot.order == 1 {
        [wedge.own, wedge.other]
    } else {
        [0.5 * (wedge.own + wedge.other); 2]
    }
}

impl BiasProblem<'_> {
    /// Estimates the bias; `None` if it is negligible or if the surface has too few samples near
    /// the data.
    pub(crate) fn bias(&self) -> Option<Bias> {
        let data = self.points.within(&self.frame);
        if self.is_negligible(data) {
            return None;
        }
        let a = self.space.parameters(self.x);
        let mut sums = NoiseSums::new(self.space.len());
        let others = self.known(&a, &mut sums);
        // Up to this share of feet without a closed form, noise is simulated at these feet
        // themselves. Noise has moved them, mostly towards edges; as they are few, that does not
        // matter.
        if others.len() as f64 > 0.02 * MAX_BIAS_FEET.min(self.points.count()) as f64 {
            let (places, density) = self.places(&a, data)?;
            self.simulated(&a, &places, &density, &mut sums);
        } else {
            let density = vec![self.share(); others.len()];
            self.simulated(&a, &others, &density, &mut sums);
        }
        self.step(&sums)
    }

    /// Returns true if an upper bound of the bias, 8 √n × noise / size in standard deviations, is
    /// below 0.05.
    fn is_negligible(&self, data: Aabb) -> bool {
        let n = self.points.count() as f64;
        let expected = 8.0 * n.sqrt() * self.noise / data.diagonal();
        expected.is_nan() || expected < 0.05
    }

    /// Returns the Gauss-Newton step of the sums; `None` if it is not finite.
    fn step(&self, sums: &NoiseSums) -> Option<Bias> {
        let m = self.space.len();
        let row = |j: usize| -> f64 {
            let products = (0..m).map(|k| self.inverse[j * m + k] * sums.pull[k]);
            products.sum()
        };
        let half = product(self.inverse, &sums.covariance, m);
        let bias = Bias {
            correction: (0..m).map(row).collect(),
            covariance: product(&half, self.inverse, m),
            shrunk: (sums.squares / sums.weights).sqrt() / self.noise,
        };
        let is_sound = is_finite(&bias.correction) && is_finite(&bias.covariance);
        (is_sound && bias.shrunk.is_finite()).then_some(bias)
    }

    /// Returns the distance between consecutive sampled data points in the random order.
    fn stride(&self) -> usize {
        self.points.count().div_ceil(MAX_BIAS_FEET)
    }

    /// Returns the number of points that a sampled point represents.
    fn share(&self) -> f64 {
        let n = self.points.count();
        n as f64 / n.div_ceil(self.stride()) as f64
    }

    /// Adds the closed-form bias at the feet of the data. Returns the feet without a closed form.
    fn known(&self, a: &[f64], sums: &mut NoiseSums) -> Vec<Foot> {
        let points = self.points.strided(self.stride());
        let mut feet = vec![Foot::NONE; points.len()];
        self.distance.feet(&points, a, &mut feet);
        let weight = |r: f64| self.weight(r * self.noise);
        let mut known = ClosedFormBias {
            wedges: EdgeIntegralTable::new(&weight),
            noise: self.noise,
            share: self.share(),
            mean_slope: self.mean_slope(),
            pulls: Pulls::default(),
        };
        let around = self.around(a, &feet);
        let mut others = Vec::new();
        for (foot, around) in feet.iter().zip(&around) {
            if !known.add(foot, around, sums) {
                others.push(*foot);
            }
        }
        self.add_pulls(a, &known.pulls, sums);
        others
    }

    /// Adds the pulls of foot points, in the variables.
    fn add_pulls(&self, a: &[f64], pulls: &Pulls, sums: &mut NoiseSums) {
        let n = self.distance.dim();
        let mut jac = vec![0.0; pulls.places.len() * n];
        self.distance.jacobian_of(&pulls.places, a, &mut jac);
        // The pull of the first face of an edge, until that of the second one comes.
        let mut first: Option<Vec<f64>> = None;
        for (share, jac) in pulls.shares.iter().zip(jac.chunks_exact(n)) {
            let (PullShare::Face(by) | PullShare::Edge(by)) = share;
            let pull = |k: usize| by * self.space.derivative(k, jac);
            let row: Vec<f64> = (0..self.space.len()).map(pull).collect();
            match (share, first.take()) {
                (PullShare::Face(_), _) => add(&mut sums.pull, &row),
                (PullShare::Edge(_), None) => first = Some(row),
                (PullShare::Edge(_), Some(mut both)) => {
                    add(&mut both, &row);
                    sums.add(&both);
                }
            }
        }
    }

    /// Classifies the local geometry at foot points, of the data or random ones.
    fn around(&self, a: &[f64], feet: &[Foot]) -> Vec<LocalGeometry> {
        let reach = REACH_DEVIATIONS * self.noise;
        // An edge's length is estimated from the feet in a strip along it: the wider, the surer.
        let nearby = self.distance.nearby(feet, a, reach, 18.0 * self.noise);
        // Curvatures are evaluated at the feet and, near edges, on both faces.
        let mut places = Vec::with_capacity(feet.len());
        for (foot, nearby) in feet.iter().zip(&nearby) {
            places.push(*foot);
            if let Nearby::Edge(edge) = nearby {
                places.extend(faces(edge));
            }
        }
        let mut bends = self.distance.bends(&places, a, self.noise).into_iter();
        let mut next = || bends.next().expect("one each");
        let mut around = Vec::with_capacity(feet.len());
        for nearby in nearby {
            let bend = next();
            around.push(match nearby {
                Nearby::Edge(edge) => self.near_edge(edge, bend, [next(), next()]),
                nearby => self.on_face(nearby == Nearby::Face, bend),
            });
        }
        around
    }

    /// Returns true if curvature × noise is below 0.1; above it the closed form is not valid.
    fn is_flat(&self, bend: f64) -> bool {
        (bend * self.noise).abs() < 0.1
    }

    fn on_face(&self, is_face: bool, bend: f64) -> LocalGeometry {
        if is_face && self.is_flat(bend) {
            LocalGeometry::Face(bend)
        } else {
            LocalGeometry::Other
        }
    }

    /// Classifies a foot point near an edge, whose faces have these curvatures.
    fn near_edge(&self, mut edge: Edge, bend: f64, faces: [f64; 2]) -> LocalGeometry {
        let faces = faces.map(f64::abs);
        let is_flat = faces.into_iter().chain([bend]).all(|b| self.is_flat(b));
        if !is_flat || !EdgeIntegralTable::has(edge.angle) {
            return self.on_face(!edge.is_near, bend);
        }
        // Faces next to a curved edge are wider or narrower than planes by half of width ×
        // curvature.
        let straight = 0.2 / (faces[0] + faces[1]);
        let least = Edge::MIN_WIDTH_RATIO * (REACH_DEVIATIONS * self.noise);
        edge.width = edge.width.min(straight).max(least);
        LocalGeometry::Edge(edge, bend)
    }

    /// Returns the weight of a distance in the loss.
    fn weight(&self, r: f64) -> f64 {
        weight(self.loss, r / self.scale)
    }

    /// Returns the mean of ψ′ under the noise, the factor by which the loss reduces a small shift
    /// of all distances; by Stein's lemma it is the mean of z ψ(z).
    fn mean_slope(&self) -> f64 {
        let (nodes, weights) = isoform_num::gauss_legendre(24);
        let value = |t: f64| {
            let z = REACH_DEVIATIONS * t;
            2.0 * REACH_DEVIATIONS * density(z) * z * z * self.weight(z * self.noise)
        };
        nodes.iter().zip(weights).map(|(t, w)| w * value(*t)).sum()
    }
}

/// Returns the foot point of an edge as a foot point on either of its faces.
fn faces(edge: &Edge) -> [Foot; 2] {
    [0, 1].map(|side| Foot::on_face(edge.at, edge.inward[side], edge.pieces[side]))
}
