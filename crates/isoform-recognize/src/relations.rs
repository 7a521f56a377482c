//! Relations between entities that hold within the uncertainty of both.
//!
//! Each relation is a vector g of the parameters of both that is 0 if it holds. With the covariance
//! S of g, gᵀ S⁻¹ g has a χ² distribution with as many degrees of freedom as g has components
//! (Wald's test).

use crate::chart::{
    DIFFERENCE_STEP, MAX_PARAMETERS, ParameterRow, Primitive, PrimitiveKind, ROUNDING_DEVIATION,
};
use crate::entity::{Relation, RelationKind};
use crate::fit;
use isoform_geom::{Point3, dot, sub};
use isoform_num::linalg::{cholesky, cholesky_solve};
use rayon::prelude::*;
use std::f64::consts::TAU;

mod tangency;

/// χ² that 1 to 5 components exceed once in 10⁵: hardly any true relation is lost among some
/// thousand pairs.
pub(crate) const CHI_SQUARED: [f64; 5] = [19.5, 23.0, 25.9, 28.5, 30.9];
/// Maximum standard deviation of directions of which a relation is decidable: the larger of an
/// angle (radians) and a multiple of the noise over the diagonal. Directions known less well are
/// parallel to anything.
pub(crate) const MAX_DIRECTION_DEVIATION: (f64, f64) = (0.01, 15.0);
/// Maximum standard deviation of places and radii of which a relation is decidable: the larger of a
/// length in diagonals and a multiple of the noise.
pub(crate) const MAX_PLACE_DEVIATION: (f64, f64) = (1e-6, 1.0);
/// Minimum odds of two axes to be one rather than any two, whose directions fill half a sphere and
/// whose distances fill the square of the diagonal: exp(−gᵀ S⁻¹ g/2)/(2π √det S). Smaller odds take
/// two poorly known axes for one by chance, 10⁶ loses short cones, whose directions are uncertain
/// by some degrees but which pass the axis exactly.
const MIN_COAXIAL_ODDS: f64 = 1e4;
/// Maximum standard deviation of the distance of two axes that may be one, in units of the noise.
/// Of 660 pairs of bands about one axis, many short and from one side, 616 are found with 4, 600
/// with 2; without a bound a bore 24 deviations from an axis is moved onto it.
const MAX_AXIS_DEVIATIONS: f64 = 4.0;
/// Maximum angle between directions that are tested for parallelism (radians).
pub(crate) const MAX_PARALLEL_ANGLE: f64 = 0.1;

/// Components of a relation.
pub(crate) type Components = [f64; CHI_SQUARED.len()];

/// A surface with the covariance of its parameters.
pub(crate) struct UncertainSurface {
    pub(crate) surface: Primitive,
    pub(crate) covariance: [ParameterRow; MAX_PARAMETERS],
}

impl UncertainSurface {
    /// Makes a surface about the centroid of its points, with its covariance for the variance of
    /// these: infinite if it is undetermined.
    pub(crate) fn from_points(surface: Primitive, points: &[Point3], variance: f64) -> Self {
        let open = [[f64::INFINITY; MAX_PARAMETERS]; MAX_PARAMETERS];
        let of = |c: [ParameterRow; MAX_PARAMETERS]| c.map(|row| row.map(|x| x * variance));
        Self {
            covariance: fit::covariance(&surface, points).map_or(open, of),
            surface,
        }
    }
}

/// Entities among which patterns and symmetries are sought.
pub(crate) struct EntitySet<'a> {
    pub(crate) known: &'a [UncertainSurface],
    pub(crate) outward: &'a [i8],
    pub(crate) points: &'a [Vec<Point3>],
    pub(crate) noise: f64,
}

/// Returns the relations that hold, in the order of their entities; lengths in units of `unit`.
pub(crate) fn relations(known: &[UncertainSurface], noise: f64, unit: f64) -> Vec<Relation> {
    let pairs = |i: usize| {
        (i + 1..known.len())
            .flat_map(|j| {
                let pair = [&known[i], &known[j]];
                let sought = |kind: &RelationKind| *kind != RelationKind::Tangent;
                let kinds = RelationKind::ALL.into_iter().filter(sought);
                kinds.filter_map(move |kind| {
                    let deviation = deviation(kind, pair, noise)?;
                    Some(relation(kind, [i, j], deviation, unit))
                })
            })
            .collect::<Vec<_>>()
    };
    (0..known.len())
        .into_par_iter()
        .flat_map_iter(pairs)
        .collect()
}

/// Adds relations that are given to those that were found, unless these are among them.
pub(crate) fn add_given(found: &mut Vec<Relation>, given: &[Relation]) {
    for r in given {
        if !found
            .iter()
            .any(|f| (f.kind, f.entities) == (r.kind, r.entities))
        {
            found.push(*r);
        }
    }
    found.sort_by_key(|r| (r.entities, r.kind));
}

/// Returns true for relations of directions alone.
pub(crate) fn is_angle(kind: RelationKind) -> bool {
    matches!(kind, RelationKind::Parallel | RelationKind::Perpendicular)
}

/// Returns a relation of entities that are off it by an angle, or by a length in units of `unit`.
pub(crate) fn relation(
    kind: RelationKind,
    entities: [usize; 2],
    deviation: f64,
    unit: f64,
) -> Relation {
    Relation {
        kind,
        entities,
        deviation: if is_angle(kind) {
            deviation
        } else {
            deviation * unit
        },
    }
}

/// Returns the deviation from a relation; `None` if it does not hold within the uncertainty.
fn deviation(kind: RelationKind, pair: [&UncertainSurface; 2], noise: f64) -> Option<f64> {
    let surfaces = pair.map(|k| &k.surface);
    if !has_meaning(kind, surfaces) {
        return None;
    }
    let frame = PairFrame::from_pair(surfaces);
    let g = failure(kind, &frame, surfaces);
    let n = g.count;
    let covariance = covariance(kind, &frame, pair);
    let is_angle = |k: usize| k < g.angles;
    let is_known = |k: usize| {
        let (least, noises) = if is_angle(k) {
            MAX_DIRECTION_DEVIATION
        } else {
            MAX_PLACE_DEVIATION
        };
        covariance[k * n + k].sqrt() <= least.max(noises * noise)
    };
    if kind != RelationKind::Coaxial && !(0..n).all(is_known) {
        return None;
    }
    let mut factor = covariance;
    let mut x = g.values[..n].to_vec();
    if !cholesky(&mut factor, n) {
        return None;
    }
    cholesky_solve(&factor, n, &mut x);
    let squared: f64 = (0..n).map(|k| x[k] * g.values[k]).sum();
    if kind == RelationKind::Coaxial && !is_one_axis(&factor, squared, noise) {
        return None;
    }
    (squared <= CHI_SQUARED[n - 1]).then_some(g.size())
}

/// Returns true if two axes can be identified as one. `factor` is the Cholesky factor of the
/// covariance of their tilts and distances, whose second block is the uncertainty of the distances
/// given the tilts; `squared` is gᵀ S⁻¹ g.
fn is_one_axis(factor: &[f64], squared: f64, noise: f64) -> bool {
    // The larger standard deviation of two components, in any frame.
    let open = |k: usize| {
        let (a, b, c) = (factor[5 * k], factor[5 * k + 4], factor[5 * k + 5]);
        let (xx, xy, yy) = (a * a, a * b, b * b + c * c);
        let half = ((xx - yy) / 2.0).hypot(xy);
        ((xx + yy) / 2.0 + half).sqrt()
    };
    let root: f64 = (0..4).map(|k| factor[5 * k]).product();
    let odds = (-squared / 2.0).exp() / (TAU * root);
    open(0) <= MAX_PARALLEL_ANGLE
        && open(2) <= MAX_PLACE_DEVIATION.0.max(MAX_AXIS_DEVIATIONS * noise)
        && odds >= MIN_COAXIAL_ODDS
}

/// Returns true if a relation is defined for two surfaces, and their directions are close to it.
fn has_meaning(kind: RelationKind, pair: [&Primitive; 2]) -> bool {
    is_defined(kind, pair.map(|s| s.kind))
        && angle_off(kind, pair).is_none_or(|angle| angle < MAX_PARALLEL_ANGLE)
}

/// Returns true if a relation is defined for two kinds of surfaces.
pub(crate) fn is_defined(kind: RelationKind, [a, b]: [PrimitiveKind; 2]) -> bool {
    use PrimitiveKind::{Cylinder, Plane, Sphere, Torus};
    let both = |is: fn(PrimitiveKind) -> bool| is(a) && is(b);
    match kind {
        RelationKind::Parallel | RelationKind::Perpendicular => both(|k| k != Sphere),
        RelationKind::Coaxial => both(|k| k > Sphere),
        RelationKind::Coplanar => both(|k| k == Plane),
        RelationKind::Concentric => both(|k| matches!(k, Sphere | Torus)),
        RelationKind::EqualRadius => a == b && matches!(a, Sphere | Cylinder),
        RelationKind::Tangent => tangency::is_defined([a, b]),
    }
}

/// Returns the angle by which two directions are off a relation, in radians; `None` if it is not
/// about directions.
pub(crate) fn angle_off(kind: RelationKind, [a, b]: [&Primitive; 2]) -> Option<f64> {
    let cosine = dot(a.axis, b.axis).abs().min(1.0);
    match kind {
        RelationKind::Perpendicular => Some(cosine.asin()),
        RelationKind::Parallel | RelationKind::Coaxial | RelationKind::Coplanar => {
            Some(cosine.acos())
        }
        RelationKind::Concentric | RelationKind::EqualRadius => None,
        RelationKind::Tangent => tangency::angle_off([a, b]),
    }
}

/// A fixed frame, so that small moves change coordinates only through the surfaces.
pub(crate) struct PairFrame {
    axis: Point3,
    across: [Point3; 2],
    /// −1 if the second direction is reversed, else 1.
    sign: f64,
}

impl PairFrame {
    pub(crate) fn from_pair([a, b]: [&Primitive; 2]) -> Self {
        // Spheres have no direction.
        let led = if a.kind == PrimitiveKind::Sphere {
            b
        } else {
            a
        };
        Self {
            axis: led.axis,
            across: led.frame(),
            sign: if dot(a.axis, b.axis) < 0.0 { -1.0 } else { 1.0 },
        }
    }

    /// Returns the components of a vector across the axis.
    fn across(&self, v: Point3) -> [f64; 2] {
        self.across.map(|e| dot(v, e))
    }

    /// Returns the difference of the directions, across the axis.
    fn tilt(&self, [a, b]: [&Primitive; 2]) -> [f64; 2] {
        self.across(std::array::from_fn(|k| self.sign * b.axis[k] - a.axis[k]))
    }

    /// Returns the way between two axes halfway between their reference points, across the axis.
    fn apart(&self, [a, b]: [&Primitive; 2]) -> [f64; 2] {
        let h = dot(sub(b.place, a.place), self.axis) / 2.0;
        let at = |s: &Primitive, h: f64, sign: f64| -> Point3 {
            std::array::from_fn(|k| s.place[k] + h * sign * s.axis[k])
        };
        self.across(sub(at(b, -h, self.sign), at(a, h, 1.0)))
    }
}

/// Vector that is 0 if a relation holds, angles first.
pub(crate) struct Failure {
    pub(crate) values: Components,
    pub(crate) count: usize,
    pub(crate) angles: usize,
}

impl Failure {
    /// Makes a vector of angles and lengths.
    fn new(angles: &[f64], lengths: &[f64]) -> Self {
        let mut values = Components::default();
        let given = angles.iter().chain(lengths);
        values.iter_mut().zip(given).for_each(|(v, x)| *v = *x);
        Self {
            values,
            count: angles.len() + lengths.len(),
            angles: angles.len(),
        }
    }

    /// Returns the norm of the angles if there is nothing else, otherwise that of the others.
    pub(crate) fn size(&self) -> f64 {
        let shown = match self.angles == self.count {
            true => 0..self.count,
            false => self.angles..self.count,
        };
        self.values[shown].iter().map(|v| v * v).sum::<f64>().sqrt()
    }
}

/// Returns by what two surfaces fail a relation.
pub(crate) fn failure(kind: RelationKind, frame: &PairFrame, pair: [&Primitive; 2]) -> Failure {
    let [a, b] = pair;
    let way = sub(b.place, a.place);
    match kind {
        RelationKind::Parallel => Failure::new(&frame.tilt(pair), &[]),
        RelationKind::Perpendicular => Failure::new(&[dot(a.axis, b.axis)], &[]),
        RelationKind::Coaxial => Failure::new(&frame.tilt(pair), &frame.apart(pair)),
        RelationKind::Coplanar => {
            let mean: Point3 = std::array::from_fn(|k| (a.axis[k] + frame.sign * b.axis[k]) / 2.0);
            Failure::new(&frame.tilt(pair), &[dot(way, mean)])
        }
        RelationKind::Concentric => Failure::new(&[], &way),
        RelationKind::EqualRadius => Failure::new(&[], &[b.size - a.size]),
        RelationKind::Tangent => tangency::failure(frame, pair),
    }
}

/// Returns the covariance of the failure, by central differences.
fn covariance(kind: RelationKind, frame: &PairFrame, pair: [&UncertainSurface; 2]) -> Vec<f64> {
    let surfaces = pair.map(|k| k.surface);
    let n = failure(kind, frame, [&surfaces[0], &surfaces[1]]).count;
    let mut sum = vec![0.0; n * n];
    for (which, known) in pair.iter().enumerate() {
        let parameters = known.surface.kind.parameters();
        let derivative = |k: usize| -> Components {
            let at = |h: f64| {
                let mut step = [0.0; MAX_PARAMETERS];
                step[k] = h;
                let mut moved = surfaces;
                moved[which] = known.surface.moved(&step);
                failure(kind, frame, [&moved[0], &moved[1]]).values
            };
            let (plus, minus) = (at(DIFFERENCE_STEP), at(-DIFFERENCE_STEP));
            std::array::from_fn(|i| (plus[i] - minus[i]) / (2.0 * DIFFERENCE_STEP))
        };
        let rows: Vec<Components> = (0..parameters).map(derivative).collect();
        for i in 0..n {
            for j in 0..n {
                for (p, row) in rows.iter().enumerate() {
                    for (q, other) in rows.iter().enumerate() {
                        sum[i * n + j] += row[i] * known.covariance[p][q] * other[j];
                    }
                }
            }
        }
    }
    for k in 0..n {
        sum[k * n + k] += ROUNDING_DEVIATION * ROUNDING_DEVIATION;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit;

    const BAND_NOISE: f64 = 1e-3;

    /// Returns a band about an axis parallel to z, as determined by points on `arc` radians of it.
    fn band(surface: Primitive, [from, to]: [f64; 2], arc: f64) -> UncertainSurface {
        let tan = match surface.kind {
            PrimitiveKind::Cone => surface.other.tan(),
            _ => 0.0,
        };
        let point = |k: usize| -> Point3 {
            let (sin, cos) = (arc * ((k % 20) as f64 / 19.0 - 0.5)).sin_cos();
            let z = from + (to - from) * (k / 20) as f64 / 9.0;
            let radius = surface.size + (z - surface.place[2]) * tan;
            [
                surface.place[0] + radius * cos,
                surface.place[1] + radius * sin,
                z,
            ]
        };
        let points: Vec<Point3> = (0..200).map(point).collect();
        let surface = surface.about(fit::mean(&points));
        let unit = fit::covariance(&surface, &points).expect("all parameters are determined");
        UncertainSurface {
            surface,
            covariance: unit.map(|row| row.map(|x| x * BAND_NOISE * BAND_NOISE)),
        }
    }

    fn is_found(kind: RelationKind, pair: [&UncertainSurface; 2]) -> bool {
        deviation(kind, pair, BAND_NOISE).is_some()
    }

    /// The direction of a chamfer is known only to some degrees, but its axis passes that of the
    /// adjacent cylinder.
    #[test]
    fn short_cones_are_about_the_axes_beside_them() {
        let cylinder = Primitive {
            kind: PrimitiveKind::Cylinder,
            place: [0.0; 3],
            axis: [0.0, 0.0, 1.0],
            size: 0.1,
            other: 0.0,
        };
        let chamfer = |off: f64| Primitive {
            kind: PrimitiveKind::Cone,
            place: [off, 0.0, 0.3],
            other: -0.8,
            ..cylinder
        };
        let long = band(cylinder, [0.0, 0.3], 3.0);
        let short = band(chamfer(0.0), [0.3, 0.32], 3.0);
        assert!(is_found(RelationKind::Coaxial, [&long, &short]));
        assert!(!is_found(RelationKind::Parallel, [&long, &short]));
        let beside = band(chamfer(20.0 * BAND_NOISE), [0.3, 0.32], 3.0);
        assert!(!is_found(RelationKind::Coaxial, [&long, &beside]));
        // The axis of a narrow arc may lie anywhere.
        let scrap = band(chamfer(0.0), [0.3, 0.32], 0.4);
        assert!(!is_found(RelationKind::Coaxial, [&long, &scrap]));
    }
}
