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

mod wedge;

use self::wedge::{Wedges, density};
use crate::Loss;
use crate::identify::product;
use crate::polish::weight;
use crate::space::Space;
use isoform_geom::{Aabb, DistanceField, Edge, Foot, Frame, Nearby, Point3, cross, norm};
use rayon::prelude::*;

/// Most feet of data that are asked: then the step's randomness is some hundredths of its size.
const MOST_FEET: usize = 4000;
/// Faces within this many deviations of the noise of a place are near it.
const REACH: f64 = 6.0;
/// Feet within this many deviations of an edge stand for its length at most: the more of them, the
/// surer is the length...
const STRIP: f64 = 18.0;
/// ... as long as the strip's width times its curvature is below this: faces beside a curved edge
/// are wider or narrower than planes by half that share.
const BENT: f64 = 0.2;
/// Share of the feet near more than an edge below which these feet themselves are the places that
/// noise is simulated at. Noise has moved them, towards edges above all, which is of no account
/// where they are few.
const FEW: f64 = 0.02;
/// Curvature × noise of faces that are neither flat nor round on the scale of the noise: there it
/// is simulated.
const ROUND: f64 = 0.1;
/// Most places that noise is simulated at, and fewest that tell anything.
const MOST_PLACES: usize = 8000;
const LEAST_PLACES: usize = 1000;
/// Simulated points, shared out among the places that need them...
const SIMULATED: usize = 1 << 14;
/// ... in sets of six, of which each place has one at least and at most this many.
const MOST_SETS: usize = 8;
/// The bias is about √n × noise / size × this in standard deviations, at most...
const AT_MOST: f64 = 8.0;
/// ... and not looked for below this.
const NEGLIGIBLE: f64 = 0.05;
/// Places expected per cell of the grid that densities are counted in; a place sees some nine.
const PER_CELL: f64 = 3.0;
/// Most cells along each side of that grid.
const MOST_CELLS: f64 = 64.0;
/// Simulated points per piece of parallel work.
const PIECE: usize = 2048;

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
    pub(crate) points: &'a [Point3],
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

/// What is known of the noise at a place.
enum Around {
    /// Curvatures' sum of the face.
    Face(f64),
    /// The same, beside an edge.
    Edge(Edge, f64),
    Much,
}

/// A simulated point, and the weight it stands for.
struct Noisy {
    at: Point3,
    weight: f64,
    place: u32,
}

/// Sums over the noisy points.
struct Sums {
    /// Jᵀ r.
    pull: Vec<f64>,
    /// Its covariance.
    covariance: Vec<f64>,
    /// Squares of the distances, and the weights.
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

impl Biased<'_> {
    /// None where the bias is next to nothing or the surface is not met.
    pub(crate) fn bias(&self) -> Option<Bias> {
        let within: Vec<Point3> = self.points.iter().map(|p| self.frame.within(*p)).collect();
        let data = Aabb::of(&within);
        let n = self.points.len() as f64;
        let expected = AT_MOST * n.sqrt() * self.noise / data.diagonal();
        if expected.is_nan() || expected < NEGLIGIBLE {
            return None;
        }
        let m = self.space.len();
        let mut a = vec![0.0; self.distance.dim()];
        self.space.parameters_at(self.x, &mut a);
        let mut sums = Sums::new(m);
        let others = self.known(&a, &mut sums);
        if others.len() as f64 > FEW * MOST_FEET.min(self.points.len()) as f64 {
            let (places, density) = self.places(&a, data, &within)?;
            self.simulated(&a, &places, &density, &mut sums);
        } else {
            let density = vec![self.share(); others.len()];
            self.simulated(&a, &others, &density, &mut sums);
        }
        let step = |from: &[f64]| -> Vec<f64> {
            let row = |j| (0..m).map(|k| self.inverse[j * m + k] * from[k]).sum();
            (0..m).map(row).collect()
        };
        let correction = step(&sums.pull);
        let half = product(self.inverse, &sums.covariance, m);
        let covariance = product(&half, self.inverse, m);
        let shrunk = (sums.squares / sums.weights).sqrt() / self.noise;
        let is_finite = |v: &[f64]| v.iter().all(|v| v.is_finite());
        let is_sound = is_finite(&correction) && is_finite(&covariance) && shrunk.is_finite();
        is_sound.then_some(Bias {
            correction,
            covariance,
            shrunk,
        })
    }

    /// Every so many data points are asked.
    fn stride(&self) -> usize {
        self.points.len().div_ceil(MOST_FEET)
    }

    /// How many points one that is asked stands for.
    fn share(&self) -> f64 {
        let n = self.points.len();
        n as f64 / n.div_ceil(self.stride()) as f64
    }

    /// Adds what is known at the feet of the data; the other feet.
    fn known(&self, a: &[f64], sums: &mut Sums) -> Vec<Foot> {
        let points: Vec<Point3> = self.points.iter().step_by(self.stride()).copied().collect();
        let share = self.share();
        let mut feet = vec![Foot::NONE; points.len()];
        self.distance.feet(&points, a, &mut feet);
        let around = self.around(a, &feet);
        let weight = |r: f64| self.weight(r * self.noise);
        let mut wedges = Wedges::new(&weight);
        let round = self.round();
        let variance = self.noise * self.noise;
        // Places whose derivatives are wanted, each with its share of the pull.
        let (mut asked, mut shares) = (Vec::new(), Vec::new());
        let mut others = Vec::new();
        for (foot, around) in feet.iter().zip(&around) {
            let bend = match around {
                Around::Face(bend) | Around::Edge(_, bend) => *bend,
                Around::Much => {
                    others.push(*foot);
                    continue;
                }
            };
            sums.weights += share;
            sums.squares += share * variance;
            if let Around::Edge(edge, _) = around {
                let off = isoform_geom::distance_squared(edge.at, foot.at).sqrt();
                if off < edge.width {
                    let along = self.noise / edge.width;
                    let wedge = wedges.at(edge.angle);
                    sums.squares += share * variance * along * wedge.squares;
                    // Feet on the edge itself come from either face.
                    let both = 0.5 * (wedge.own + wedge.other);
                    let by = if foot.order == 1 {
                        [wedge.own, wedge.other]
                    } else {
                        [both, both]
                    };
                    for (face, by) in faces(edge).into_iter().zip(by) {
                        asked.push(face);
                        shares.push((share * self.noise * along * by, true));
                    }
                }
            }
            if bend != 0.0 && foot.order == 1 {
                asked.push(*foot);
                shares.push((share * 0.5 * variance * round * bend, false));
            }
        }
        let (n, m) = (self.distance.dim(), self.space.len());
        let mut jac = vec![0.0; asked.len() * n];
        self.distance.jacobian_of(&asked, a, &mut jac);
        let mut row = vec![0.0; m];
        let mut edge = vec![0.0; m];
        let mut is_second = false;
        for ((by, is_edge), jac) in shares.iter().zip(jac.chunks_exact(n)) {
            for (k, v) in row.iter_mut().enumerate() {
                *v = by * self.column(k, jac);
            }
            if !is_edge {
                sums.pull.iter_mut().zip(&row).for_each(|(s, v)| *s += v);
            } else if is_second {
                edge.iter_mut().zip(&row).for_each(|(s, v)| *s += v);
                sums.add(&edge);
                is_second = false;
            } else {
                edge.clone_from(&row);
                is_second = true;
            }
        }
        others
    }

    /// What is around each foot: alike for places of the data and others.
    fn around(&self, a: &[f64], feet: &[Foot]) -> Vec<Around> {
        let reach = REACH * self.noise;
        let nearby = self.distance.nearby(feet, a, reach, STRIP * self.noise);
        let mut places = Vec::with_capacity(feet.len());
        for (foot, nearby) in feet.iter().zip(&nearby) {
            places.push(*foot);
            if let Nearby::Edge(edge) = nearby {
                places.extend(faces(edge));
            }
        }
        let bends = self.distance.bends(&places, a, self.noise);
        let is_flat = |bend: f64| (bend * self.noise).abs() < ROUND;
        let mut bends = bends.into_iter();
        let mut next = || bends.next().expect("one each");
        nearby
            .into_iter()
            .map(|nearby| {
                let bend = next();
                let mut is_face = nearby == Nearby::Face;
                if let Nearby::Edge(mut edge) = nearby {
                    let bends = [next(), next()].map(f64::abs);
                    if bends.into_iter().chain([bend]).all(is_flat) && Wedges::has(edge.angle) {
                        let straight = BENT / (bends[0] + bends[1]);
                        let least = Edge::LEAST * reach;
                        edge.width = edge.width.min(straight).max(least);
                        return Around::Edge(edge, bend);
                    }
                    is_face = !edge.is_near;
                }
                if is_face && is_flat(bend) {
                    Around::Face(bend)
                } else {
                    Around::Much
                }
            })
            .collect()
    }

    /// Places of the surface near more than an edge, with the data points that each stands for;
    /// None where the surface is not met.
    fn places(&self, a: &[f64], data: Aabb, within: &[Point3]) -> Option<(Vec<Foot>, Vec<f64>)> {
        let wanted = (4 * self.points.len()).clamp(LEAST_PLACES, MOST_PLACES);
        let region = grown(data, 3.0 * self.noise);
        let places = self
            .distance
            .area_samples(a, &self.frame, region, wanted, self.seed);
        if places.len() < LEAST_PLACES / 4 {
            return None;
        }
        let at: Vec<Point3> = places.iter().map(|f| self.frame.within(f.at)).collect();
        let density = densities(&at, within, data);
        let around = self.around(a, &places);
        let all = places.into_iter().zip(density).zip(around);
        let unknown =
            all.filter(|((_, density), around)| matches!(around, Around::Much) && *density > 0.0);
        Some(unknown.map(|(place, _)| place).unzip())
    }

    /// Adds noise that is simulated at places.
    fn simulated(&self, a: &[f64], places: &[Foot], density: &[f64], sums: &mut Sums) {
        if places.is_empty() {
            return;
        }
        let sets = (SIMULATED / (6 * places.len())).clamp(1, MOST_SETS);
        let mut noisy = Vec::with_capacity(6 * sets * places.len());
        let mut moves = Moves::new(self.seed);
        for (row, (place, density)) in places.iter().zip(density).enumerate() {
            for by in (0..sets).flat_map(|_| moves.next()) {
                let by = self.frame.turned(by.map(|v| self.noise * v));
                for sign in [1.0, -1.0] {
                    noisy.push(Noisy {
                        at: std::array::from_fn(|i| place.at[i] + sign * by[i]),
                        weight: density / (6 * sets) as f64,
                        place: row as u32,
                    });
                }
            }
        }
        let m = self.space.len();
        let pieces: Vec<Pieces> = noisy
            .par_chunks(PIECE)
            .map(|piece| self.sums(a, piece))
            .collect();
        // One row a place: a piece ends anywhere.
        let mut rows = vec![0.0; places.len() * m];
        for piece in &pieces {
            sums.squares += piece.squares;
            sums.weights += piece.weights;
            for (place, row) in &piece.rows {
                let at = *place as usize * m;
                let sum = rows[at..at + m].iter_mut().zip(row);
                sum.for_each(|(s, v)| *s += v);
            }
        }
        rows.chunks_exact(m).for_each(|row| sums.add(row));
    }

    /// Jᵀr of each place among some simulated points.
    fn sums(&self, a: &[f64], noisy: &[Noisy]) -> Pieces {
        let (n, m) = (self.distance.dim(), self.space.len());
        let points: Vec<Point3> = noisy.iter().map(|p| p.at).collect();
        let (mut r, mut jac) = (vec![0.0; points.len()], vec![0.0; points.len() * n]);
        self.distance.jacobian(&points, a, &mut r, &mut jac);
        let mut out = Pieces {
            rows: Vec::new(),
            squares: 0.0,
            weights: 0.0,
        };
        for ((p, r), jac) in noisy.iter().zip(&r).zip(jac.chunks_exact(n)) {
            if !r.is_finite() {
                continue;
            }
            out.squares += p.weight * r * r;
            out.weights += p.weight;
            if out.rows.last().is_none_or(|(place, _)| *place != p.place) {
                out.rows.push((p.place, vec![0.0; m]));
            }
            let sum = &mut out.rows.last_mut().expect("just pushed").1;
            let pull = p.weight * self.weight(*r) * r;
            for (k, v) in sum.iter_mut().enumerate() {
                *v += pull * self.column(k, jac);
            }
        }
        out
    }

    /// Derivative by variable k, from those by the parameters.
    fn column(&self, k: usize, jac: &[f64]) -> f64 {
        self.space.column(k).iter().map(|&(i, c)| c * jac[i]).sum()
    }

    /// Weight of a distance in the loss.
    fn weight(&self, r: f64) -> f64 {
        weight(self.loss, r / self.scale)
    }

    /// What the loss leaves of a small shift of all distances: the mean of ψ′, which by Stein's
    /// lemma is that of z ψ(z).
    fn round(&self) -> f64 {
        let (nodes, weights) = isoform_num::gauss_legendre(24);
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

/// Sums over a piece of the simulated points.
struct Pieces {
    /// By place.
    rows: Vec<(u32, Vec<f64>)>,
    /// Squares of the distances, and the weights.
    squares: f64,
    weights: f64,
}

/// Evenly spread standard normal moves: a sequence of Kronecker with the steps of Roberts (powers
/// of the root of x⁶ = x + 1), from a start that the seed draws.
struct Moves {
    at: [f64; 5],
}

impl Moves {
    /// x⁶ = x + 1.
    const ROOT: f64 = 1.134_724_138_401_519_5;

    fn new(seed: u64) -> Self {
        let mut random = fastrand::Rng::with_seed(seed ^ 0xB1A5);
        Self {
            at: std::array::from_fn(|_| random.f64()),
        }
    }

    /// Three moves of one length at right angles: with their opposites they give the mean of a
    /// quadratic but for the length, so that what cancels in the mean does in each set.
    fn next(&mut self) -> [Point3; 3] {
        let mut step = 1.0;
        for v in &mut self.at {
            step /= Self::ROOT;
            *v = (*v + step).fract();
        }
        let [p, q, r, s, turn] = self.at;
        let ((x, y), (z, _)) = (normal_pair([p, q]), normal_pair([r, s]));
        let first = [x, y, z];
        let length = norm(first).max(f64::MIN_POSITIVE);
        // Across the axis that it is least along.
        let least = (0..3).fold(0, |b, i| {
            if first[i].abs() < first[b].abs() {
                i
            } else {
                b
            }
        });
        let axis = std::array::from_fn(|i| f64::from(u8::from(i == least)));
        let u = cross(first, axis);
        let u = u.map(|v| v * length / norm(u));
        let v = cross(first, u).map(|v| v / length);
        let (sin, cos) = (std::f64::consts::TAU * turn).sin_cos();
        let second: Point3 = std::array::from_fn(|i| cos * u[i] + sin * v[i]);
        [
            first,
            second,
            std::array::from_fn(|i| cos * v[i] - sin * u[i]),
        ]
    }
}

/// Two independent standard normal numbers from even ones in [0, 1) (Box and Muller).
fn normal_pair(even: [f64; 2]) -> (f64, f64) {
    let radius = (-2.0 * (1.0 - even[0]).ln()).sqrt();
    let angle = std::f64::consts::TAU * even[1];
    (radius * angle.cos(), radius * angle.sin())
}

fn grown(mut region: Aabb, by: f64) -> Aabb {
    for i in 0..3 {
        region.lo[i] -= by;
        region.hi[i] += by;
    }
    region
}

/// Data points per place, about each place: both are counted in the cells of a grid and those
/// next to them.
fn densities(places: &[Point3], points: &[Point3], data: Aabb) -> Vec<f64> {
    let size = data.size();
    let area = 2.0 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0]);
    let cell = (area * PER_CELL / places.len() as f64).sqrt();
    let cell = cell.max(data.diagonal() / MOST_CELLS);
    // A rim of empty cells: every cell has neighbours.
    let count = size.map(|s| (s / cell) as usize + 3);
    let key = |p: Point3| -> usize {
        let along = |i: usize| {
            let at = ((p[i] - data.lo[i]) / cell).floor() as isize + 1;
            at.clamp(1, count[i] as isize - 2) as usize
        };
        (along(0) * count[1] + along(1)) * count[2] + along(2)
    };
    let counted = |points: &[Point3]| -> Vec<f64> {
        let mut counts = vec![0.0; count.iter().product()];
        points.iter().for_each(|p| counts[key(*p)] += 1.0);
        counts
    };
    let (there, met) = (counted(places), counted(points));
    let around = |counts: &[f64], at: usize| -> f64 {
        let rows = [count[1] * count[2], count[2], 1];
        let mut sum = 0.0;
        for cell in 0..27 {
            let to = |i: usize| (cell / 3_usize.pow(i as u32) % 3) * rows[i];
            sum += counts[at + to(0) + to(1) + to(2) - rows[0] - rows[1] - rows[2]];
        }
        sum
    };
    let mean = points.len() as f64 / places.len() as f64;
    places
        .iter()
        .map(|place| {
            let at = key(*place);
            let (there, met) = (around(&there, at), around(&met, at));
            // A few places only are drawn to the mean, unless there are no data.
            if met == 0.0 && there > 3.0 {
                0.0
            } else {
                (met + mean) / (there + 1.0)
            }
        })
        .collect()
}
