//! The bias of least squares beside edges and on curved pieces.
//!
//! Noise carries points across a convex edge outwards more often than back: beside edges its mean
//! along the normal is not nought, and the minimum moves by an amount of the order of noise² × edge
//! length / area, which does not shrink with the number of points. Curvature does alike (Kanatani,
//! *Guide to 3D Vision Computation*, chapter 2, for conics). The bias is one Gauss-Newton step from
//! the fit on what noise makes of places of the fitted surface, which is taken back. To second
//! order of the noise that is known of most places:
//!
//! - On a face, the mean distance is noise² / 2 × the sum of the curvatures.
//! - Beside an edge that is alone, planes on both sides give it by quadrature ([`wedge`]).
//!
//! There the data's own feet are the places, as dense as the data by themselves and the same ones
//! in any pose. Elsewhere (corners, thin walls, narrow blends) noise is simulated at random places
//! of the surface. What the places' randomness leaves goes into the covariance.

mod moves;
mod places;
mod simulation;
mod wedge;

pub(crate) use self::places::Cells;

use self::wedge::{Wedge, Wedges, density};
use crate::Loss;
use crate::chunks::Cloud;
use crate::identify::product;
use crate::polish::weight;
use crate::space::Space;
use crate::vector::{add, is_finite};
use isoform_geom::{Aabb, DistanceField, Edge, Foot, Frame, Nearby, Point3, distance_squared};

/// Most feet of data that are asked: then the step's randomness is some hundredths of its size.
pub(crate) const MOST_FEET: usize = 4000;
/// Faces within this many deviations of the noise of a place are near it.
const REACH: f64 = 6.0;
/// The length of an edge is told from the feet within at most this many deviations of it: the more
/// feet, the surer the length.
const STRIP: f64 = 18.0;
/// The strip's width times its curvature stays below this: faces beside a curved edge are wider or
/// narrower than planes by half that share.
const BENT: f64 = 0.2;
/// Where a smaller share of the feet than this lies near more than one edge, noise is simulated at
/// these feet themselves. Noise has moved them, mostly towards edges; as they are few, that does
/// not matter.
const FEW: f64 = 0.02;
/// Curvature × noise of faces that are neither flat nor round on the scale of the noise: there it
/// is simulated.
const ROUND: f64 = 0.1;
/// The bias is about √n × noise / size × this in standard deviations, at most.
const AT_MOST: f64 = 8.0;
/// A bias below this share of a deviation is not looked for.
const NEGLIGIBLE: f64 = 0.05;
/// Nodes of the quadrature over the loss.
const NODES: usize = 24;

/// What noise does to the fit.
pub(crate) struct Bias {
    /// To be added to the variables to take the bias away.
    pub(crate) correction: Vec<f64>,
    /// Covariance of the correction by its own randomness.
    pub(crate) covariance: Vec<f64>,
    /// Root mean square of the distances over the noise that made them.
    pub(crate) shrunk: f64,
}

/// The fit whose bias is asked for.
pub(crate) struct Biased<'a> {
    pub(crate) distance: &'a dyn DistanceField,
    pub(crate) space: &'a Space,
    pub(crate) x: &'a [f64],
    /// The data that were fitted.
    pub(crate) points: &'a Points<'a>,
    /// Deviation of the noise that neighbours do not share.
    pub(crate) noise: f64,
    pub(crate) loss: Loss,
    /// Robust scale of the loss.
    pub(crate) scale: f64,
    /// Inverse of the data's own Hessian.
    pub(crate) inverse: &'a [f64],
    /// Where the model stands: places and noise are made there.
    pub(crate) frame: Frame,
    pub(crate) seed: u64,
}

/// Points that were fitted.
pub(crate) enum Points<'a> {
    /// At hand.
    Here(Vec<Point3>),
    /// In chunks.
    InChunks(&'a Cloud<'a>),
}

impl Points<'_> {
    pub(crate) fn count(&self) -> usize {
        match self {
            Self::Here(points) => points.len(),
            Self::InChunks(cloud) => cloud.n_fitted(),
        }
    }

    /// Their box in a frame.
    fn within(&self, frame: &Frame) -> Aabb {
        match self {
            Self::Here(points) => Aabb::of(&within(points, frame)),
            Self::InChunks(cloud) => cloud.within(frame),
        }
    }

    /// How many there are in each cell of a frame.
    fn counted(&self, cells: &Cells, frame: &Frame) -> Vec<f64> {
        match self {
            Self::Here(points) => cells.counted(&within(points, frame)),
            Self::InChunks(cloud) => cloud.counted(cells, frame),
        }
    }

    /// Each `stride`-th, at most [`MOST_FEET`].
    fn strided(&self, stride: usize) -> Vec<Point3> {
        match self {
            Self::Here(points) => points.iter().step_by(stride).copied().collect(),
            Self::InChunks(cloud) => cloud.strided.clone(),
        }
    }
}

/// Points as a frame sees them.
fn within(points: &[Point3], frame: &Frame) -> Vec<Point3> {
    points.iter().map(|p| frame.within(*p)).collect()
}

/// What is known of the noise at a place.
enum Around {
    /// A face, with the sum of its curvatures.
    Face(f64),
    /// A face beside an edge, with the sum of its curvatures.
    Edge(Edge, f64),
    /// More than an edge: nothing is known in closed form.
    Much,
}

/// Sums over the noisy points.
struct Sums {
    /// Jᵀ r.
    pull: Vec<f64>,
    /// Covariance of the pull.
    covariance: Vec<f64>,
    /// Squares of the distances, weighted.
    squares: f64,
    weights: f64,
}

impl Sums {
    fn new(m: usize) -> Self {
        Self {
            pull: vec![0.0; m],
            covariance: vec![0.0; m * m],
            squares: 0.0,
            weights: 0.0,
        }
    }

    /// Adds the pull of one random place.
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

/// Places whose derivatives are wanted, each with its share of the pull.
#[derive(Default)]
struct Pulls {
    places: Vec<Foot>,
    shares: Vec<Share>,
}

/// A place's share of the pull.
enum Share {
    /// Of a face by its curvature, which is not random.
    Face(f64),
    /// Of one of the two faces of an edge; they follow each other.
    Edge(f64),
}

impl Pulls {
    fn push(&mut self, place: Foot, share: Share) {
        self.places.push(place);
        self.shares.push(share);
    }
}

/// Noise beside edges and on faces, in the units of the fit.
struct Known<'a> {
    wedges: Wedges<'a>,
    noise: f64,
    /// Data points that each foot stands for.
    share: f64,
    /// What the loss leaves of a small shift.
    round: f64,
    pulls: Pulls,
}

impl Known<'_> {
    /// Adds a foot, unless nothing is known of the noise there.
    fn add(&mut self, foot: &Foot, around: &Around, sums: &mut Sums) -> bool {
        let (bend, edge) = match around {
            Around::Face(bend) => (*bend, None),
            Around::Edge(edge, bend) => (*bend, Some(edge)),
            Around::Much => return false,
        };
        sums.weights += self.share;
        sums.squares += self.share * (self.noise * self.noise);
        if let Some(edge) = edge {
            sums.squares += self.add_edge(foot, edge);
        }
        self.add_face(foot, bend);
        true
    }

    /// Adds the pull of a foot on a face whose curvatures have this sum.
    fn add_face(&mut self, foot: &Foot, bend: f64) {
        if bend != 0.0 && foot.order == 1 {
            let variance = self.noise * self.noise;
            let by = self.share * 0.5 * variance * self.round * bend;
            self.pulls.push(*foot, Share::Face(by));
        }
    }

    /// Adds the pull of a foot beside an edge, if it is in the edge's strip; gives what the edge
    /// adds to the sum of squares.
    fn add_edge(&mut self, foot: &Foot, edge: &Edge) -> f64 {
        let is_in_strip = distance_squared(edge.at, foot.at).sqrt() < edge.width;
        if !is_in_strip {
            return 0.0;
        }
        let along = self.noise / edge.width;
        let wedge = self.wedges.at(edge.angle);
        for (face, by) in faces(edge).into_iter().zip(pulls_of(wedge, foot)) {
            let by = self.share * self.noise * along * by;
            self.pulls.push(face, Share::Edge(by));
        }
        self.share * (self.noise * self.noise) * along * wedge.squares
    }
}

/// Pulls of the two faces of an edge. Feet on the edge itself come from either face.
fn pulls_of(wedge: Wedge, foot: &Foot) -> [f64; 2] {
    if foot.order == 1 {
        [wedge.own, wedge.other]
    } else {
        [0.5 * (wedge.own + wedge.other); 2]
    }
}

impl Biased<'_> {
    /// None where the bias is next to nothing or the surface is not met.
    pub(crate) fn bias(&self) -> Option<Bias> {
        let data = self.points.within(&self.frame);
        if self.is_negligible(data) {
            return None;
        }
        let a = self.space.parameters(self.x);
        let mut sums = Sums::new(self.space.len());
        let others = self.known(&a, &mut sums);
        if others.len() as f64 > FEW * MOST_FEET.min(self.points.count()) as f64 {
            let (places, density) = self.places(&a, data)?;
            self.simulated(&a, &places, &density, &mut sums);
        } else {
            let density = vec![self.share(); others.len()];
            self.simulated(&a, &others, &density, &mut sums);
        }
        self.step(&sums)
    }

    /// Whether the largest bias that is possible is small beside the deviations.
    fn is_negligible(&self, data: Aabb) -> bool {
        let n = self.points.count() as f64;
        let expected = AT_MOST * n.sqrt() * self.noise / data.diagonal();
        expected.is_nan() || expected < NEGLIGIBLE
    }

    /// The Gauss-Newton step that the sums make; none without finite numbers.
    fn step(&self, sums: &Sums) -> Option<Bias> {
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

    /// Steps from one data point that is asked to the next.
    fn stride(&self) -> usize {
        self.points.count().div_ceil(MOST_FEET)
    }

    /// How many points one that is asked stands for.
    fn share(&self) -> f64 {
        let n = self.points.count();
        n as f64 / n.div_ceil(self.stride()) as f64
    }

    /// Adds what is known at the feet of the data; the other feet.
    fn known(&self, a: &[f64], sums: &mut Sums) -> Vec<Foot> {
        let points = self.points.strided(self.stride());
        let mut feet = vec![Foot::NONE; points.len()];
        self.distance.feet(&points, a, &mut feet);
        let weight = |r: f64| self.weight(r * self.noise);
        let mut known = Known {
            wedges: Wedges::new(&weight),
            noise: self.noise,
            share: self.share(),
            round: self.round(),
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

    /// Adds the pulls of places, in the variables.
    fn add_pulls(&self, a: &[f64], pulls: &Pulls, sums: &mut Sums) {
        let n = self.distance.dim();
        let mut jac = vec![0.0; pulls.places.len() * n];
        self.distance.jacobian_of(&pulls.places, a, &mut jac);
        // The pull of the first face of an edge, until that of the second one comes.
        let mut first: Option<Vec<f64>> = None;
        for (share, jac) in pulls.shares.iter().zip(jac.chunks_exact(n)) {
            let (Share::Face(by) | Share::Edge(by)) = share;
            let pull = |k: usize| by * self.space.derivative(k, jac);
            let row: Vec<f64> = (0..self.space.len()).map(pull).collect();
            match (share, first.take()) {
                (Share::Face(_), _) => add(&mut sums.pull, &row),
                (Share::Edge(_), None) => first = Some(row),
                (Share::Edge(_), Some(mut both)) => {
                    add(&mut both, &row);
                    sums.add(&both);
                }
            }
        }
    }

    /// What is around each foot: alike for places of the data and others.
    fn around(&self, a: &[f64], feet: &[Foot]) -> Vec<Around> {
        let reach = REACH * self.noise;
        let nearby = self.distance.nearby(feet, a, reach, STRIP * self.noise);
        // Curvatures are asked for at the feet and, beside edges, on both faces.
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
                Nearby::Edge(edge) => self.beside(edge, bend, [next(), next()]),
                nearby => self.on_face(nearby == Nearby::Face, bend),
            });
        }
        around
    }

    /// Whether a curvature is flat on the scale of the noise.
    fn is_flat(&self, bend: f64) -> bool {
        (bend * self.noise).abs() < ROUND
    }

    fn on_face(&self, is_face: bool, bend: f64) -> Around {
        if is_face && self.is_flat(bend) {
            Around::Face(bend)
        } else {
            Around::Much
        }
    }

    /// What is around a foot beside an edge, whose faces have these curvatures there.
    fn beside(&self, mut edge: Edge, bend: f64, faces: [f64; 2]) -> Around {
        let faces = faces.map(f64::abs);
        let is_flat = faces.into_iter().chain([bend]).all(|b| self.is_flat(b));
        if !is_flat || !Wedges::has(edge.angle) {
            return self.on_face(!edge.is_near, bend);
        }
        let straight = BENT / (faces[0] + faces[1]);
        let least = Edge::LEAST * (REACH * self.noise);
        edge.width = edge.width.min(straight).max(least);
        Around::Edge(edge, bend)
    }

    /// Weight of a distance in the loss.
    fn weight(&self, r: f64) -> f64 {
        weight(self.loss, r / self.scale)
    }

    /// What the loss leaves of a small shift of all distances: the mean of ψ′, which by Stein's
    /// lemma is that of z ψ(z).
    fn round(&self) -> f64 {
        let (nodes, weights) = isoform_num::gauss_legendre(NODES);
        let value = |t: f64| {
            let z = REACH * t;
            2.0 * REACH * density(z) * z * z * self.weight(z * self.noise)
        };
        nodes.iter().zip(weights).map(|(t, w)| w * value(*t)).sum()
    }
}

/// The place of an edge as one on either of its faces.
fn faces(edge: &Edge) -> [Foot; 2] {
    [0, 1].map(|side| Foot::on_face(edge.at, edge.inward[side], edge.pieces[side]))
}
