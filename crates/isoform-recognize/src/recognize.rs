//! Recognition of a scan.

use crate::accuracy::{degrees_of_freedom, uncertain_surface, with_rounding};
use crate::blends::{MIN_BORDER_PAIRS, blends};
use crate::border::{self, largest_first};
use crate::chart::{MAX_PARAMETERS, ParameterRow, Primitive, PrimitiveKind, frame, unit};
use crate::cloud::{Cloud, Scaling, sorted};
use crate::entity::{Deviations, Entity, Face, Recognition};
use crate::faces::FaceLabels;
use crate::fit::{covariance, squares};
use crate::form::within_noise_or_form;
use crate::grow::core;
use crate::labels::UNLABELLED;
use crate::noise::MAX_EXACT_NOISE;
use crate::orient::orient;
use crate::patchwork::free_share;
use crate::patterns::patterns;
use crate::pose::Pose;
use crate::relations::{EntitySet, UncertainSurface, add_given, relations};
use crate::segment::{DistanceTolerance, Limits, Segmentation, segment};
use crate::symmetry::symmetries;
use isoform_control::{Control, Stopped};
use isoform_geom::{Point3, PointCloud, cross, dot, norm, rounding, rounding_if_decimal, sub};
use rayon::prelude::*;

/// Options of recognition.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// Standard deviation of points from their surface, in the scan's unit; estimated from the
    /// points if `None`.
    pub noise: Option<f64>,
    /// Minimum number of points of an entity; as many as are evidence of it if `None`.
    pub min_points: Option<usize>,
}

/// Reasons why nothing is recognised.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Too few points for a surface.
    #[error("{points} points are too few for a surface")]
    Few {
        /// Number of distinct points.
        points: usize,
    },
    /// A coordinate is not finite.
    #[error("a coordinate is not finite")]
    NotFinite,
    /// The given noise is not a length: it is negative, infinite or NaN.
    #[error("a noise of {0} is no length")]
    Noise(f64),
    /// The points coincide or are collinear.
    #[error("the points lie on one line")]
    Line,
    /// The work was cancelled, or its deadline has passed.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

/// Minimum number of distinct points of a scan.
const MIN_SCAN_POINTS: usize = 16;

/// Recognises the planes, spheres, cylinders, cones and tori of a scan.
///
/// # Errors
/// [`Error`].
pub fn recognize(
    scan: &PointCloud,
    options: &Options,
    control: &Control<'_>,
) -> Result<Recognition, Error> {
    let ready = PreparedScan::new(scan, options, control)?;
    let cloud = &ready.cloud;
    let min_points = options.min_points.unwrap_or(0);
    let mut found = match ready.noise(options) {
        None => within_noise_or_form(cloud, min_points, control)?,
        Some(noise) => {
            let allowed = DistanceTolerance::Given(noise);
            segment(
                cloud,
                Limits {
                    min_points,
                    allowed,
                },
                control,
            )?
        }
    };
    control.check()?;
    let mut faces = FaceLabels::of_cloud(cloud, &found, min_points);
    faces.settle_shared(cloud, &mut found);
    Ok(ready.described(scan, found, &faces))
}

/// A scan prepared for recognition.
pub(crate) struct PreparedScan {
    pub(crate) cloud: Cloud,
    /// Index in the cloud of each point of the scan.
    pub(crate) index: Vec<u32>,
    pose: Pose,
    scaling: Scaling,
}

impl PreparedScan {
    /// Prepares a scan.
    pub(crate) fn new(
        scan: &PointCloud,
        options: &Options,
        control: &Control<'_>,
    ) -> Result<Self, Error> {
        if !scan.points.iter().flatten().all(|x| x.is_finite()) {
            return Err(Error::NotFinite);
        }
        if let Some(noise) = options.noise.filter(|n| !(n.is_finite() && *n >= 0.0)) {
            return Err(Error::Noise(noise));
        }
        control.begin("neighbours")?;
        let NormalizedScan {
            places,
            index,
            pose,
            scaling,
        } = NormalizedScan::from_scan(scan)?;
        let cloud = Cloud::new(
            places,
            rounding(scan) / scaling.unit,
            rounding_if_decimal(scan) / scaling.unit,
        );
        if is_line(&cloud.points) {
            return Err(Error::Line);
        }
        Ok(Self {
            cloud,
            index,
            pose,
            scaling,
        })
    }

    /// Returns a length of the scan in diagonals.
    pub(crate) fn diagonals(&self, length: f64) -> f64 {
        length / self.scaling.unit
    }

    /// Returns the diagonal in the scan's unit.
    pub(crate) fn unit(&self) -> f64 {
        self.scaling.unit
    }

    /// Returns the noise that is given, in diagonals; `None` if the points have to show it.
    pub(crate) fn noise(&self, options: &Options) -> Option<f64> {
        let given = options.noise.map(|n| self.diagonals(n));
        given.map(|noise| noise.max(self.cloud.floor))
    }

    /// Describes a segmentation with its faces in the terms of the scan.
    pub(crate) fn described(
        mut self,
        scan: &PointCloud,
        mut found: Segmentation,
        faces: &FaceLabels,
    ) -> Recognition {
        let (cloud, pose) = (&mut self.cloud, &self.pose);
        let given = given_normals(scan, &self.index, cloud.points.len(), pose);
        let is_oriented = given.is_some_and(|given| turn_as_given(cloud, &found, &given));
        if !is_oriented {
            turn_outwards(cloud, &found);
        }
        cloud.turn_back(pose);
        let back = |s: &mut Primitive| *s = pose.surface_back(s);
        found.surfaces.iter_mut().for_each(back);
        Recognition {
            is_oriented,
            ..report(cloud, &found, faces, &self.index, &self.scaling)
        }
    }
}

/// Returns the normals that a scan gives, by point of the cloud and turned with it; `None` if it
/// gives none.
fn given_normals(
    scan: &PointCloud,
    index: &[u32],
    places: usize,
    pose: &Pose,
) -> Option<Vec<Point3>> {
    if scan.normals.len() != index.len() {
        return None;
    }
    let mut given = vec![[0.0; 3]; places];
    for (place, normal) in index.iter().zip(&scan.normals) {
        given[*place as usize] = pose.turn(*normal);
    }
    Some(given)
}

/// Turns the normals to the sides of given ones, if these are consistent: then nearly all points of
/// a surface face one way. Returns true if they are.
///
/// Normals of a closed surface that face inwards on the whole are reversed: the mean over a closed
/// surface is zero, and that of p·n is three volumes over the area.
fn turn_as_given(cloud: &mut Cloud, found: &Segmentation, given: &[Point3]) -> bool {
    let (mut agreeing, mut all) = (0, 0);
    for (label, members) in found.members().iter().enumerate() {
        let surface = &found.surfaces[label];
        let side = |i: &&u32| {
            let i = **i as usize;
            dot(surface.normal(cloud.points[i]), given[i]) > 0.0
        };
        let ahead = members.iter().filter(side).count();
        agreeing += ahead.max(members.len() - ahead);
        all += members.len();
    }
    // Normals without a consistent side agree at half of the points.
    if all == 0 || (agreeing as f64) < 0.9 * all as f64 {
        return false;
    }
    let sum = |of: &dyn Fn(usize) -> f64| (0..given.len()).map(of).sum::<f64>();
    let count = given.len() as f64;
    let mean: Point3 = std::array::from_fn(|k| sum(&|i| given[i][k]) / count);
    let volume = sum(&|i| dot(cloud.points[i], given[i]));
    // The mean normal of a sphere seen from one side has the length 1/2.
    let sign = if norm(mean) < 0.1 && volume < 0.0 {
        -1.0
    } else {
        1.0
    };
    for (n, g) in cloud.normals.iter_mut().zip(given) {
        if sign * dot(*n, *g) < 0.0 {
            *n = n.map(|x| -x);
        }
    }
    true
}

/// A scan in its canonical pose, unit and order.
struct NormalizedScan {
    /// Distinct points, sorted.
    places: Vec<Point3>,
    /// Index in `places` of each point of the scan.
    index: Vec<u32>,
    pose: Pose,
    /// Map from `places`, turned back, to points of the scan.
    scaling: Scaling,
}

impl NormalizedScan {
    fn from_scan(scan: &PointCloud) -> Result<Self, Error> {
        let upright = Scaling::from_points(&scan.points);
        let few = |points| Err(Error::Few { points });
        let Some(upright) = upright else {
            let (places, _) = sorted(&scan.points);
            return match places.len() < MIN_SCAN_POINTS {
                true => few(places.len()),
                false => Err(Error::Line),
            };
        };
        let points: Vec<Point3> = scan.points.iter().map(|p| upright.apply(*p)).collect();
        // The order is fixed first: sums over the points depend on it by rounding.
        let pose = Pose::from_points(&sorted(&points).0);
        let turned: Vec<Point3> = points.iter().map(|p| pose.turn(*p)).collect();
        let scaling = Scaling::from_points(&turned).ok_or(Error::Line)?;
        let (places, index) = sorted(&turned);
        if places.len() < MIN_SCAN_POINTS {
            return few(places.len());
        }
        let origin = pose.back(scaling.origin);
        let at = |k: usize| upright.unit * origin[k] + upright.origin[k] + scan.origin[k];
        Ok(Self {
            places: places.iter().map(|p| scaling.apply(*p)).collect(),
            index,
            pose,
            scaling: Scaling {
                origin: std::array::from_fn(at),
                unit: upright.unit * scaling.unit,
            },
        })
    }
}

/// Turns the normals outwards, by casting rays at the surfaces found.
fn turn_outwards(cloud: &mut Cloud, found: &Segmentation) {
    let label = |l: &u32| (*l != UNLABELLED).then_some(*l as usize);
    let labels: Vec<Option<usize>> = found.labels.iter().map(label).collect();
    let normals = &mut cloud.normals;
    orient(&cloud.points, normals, &labels, &found.surfaces, &[]);
}

/// Returns true if sorted points lie on one line: that through the first and the last.
fn is_line(points: &[Point3]) -> bool {
    let (Some(first), Some(last)) = (points.first(), points.last()) else {
        return true;
    };
    let along = unit(sub(*last, *first));
    let off = |p: &Point3| norm(cross(sub(*p, *first), along));
    points.iter().all(|p| off(p) <= crate::noise::MIN_NOISE)
}

/// Reports the result in the scan's unit and order.
fn report(
    cloud: &Cloud,
    found: &Segmentation,
    faces: &FaceLabels,
    index: &[u32],
    scaling: &Scaling,
) -> Recognition {
    let members = found.members();
    let mut counts = vec![0; members.len()];
    for place in index {
        let label = found.labels[*place as usize];
        if label != UNLABELLED {
            counts[label as usize] += 1;
        }
    }
    let mut order: Vec<usize> = (0..members.len()).collect();
    if found.given.is_empty() {
        order.sort_by_key(|i| (std::cmp::Reverse(counts[*i]), *i));
    }
    let mut rank = vec![0; order.len()];
    order
        .iter()
        .enumerate()
        .for_each(|(new, old)| rank[*old] = new as u32);
    let entity = |i: &usize| entity(cloud, found, &members[*i], *i, counts[*i], scaling);
    let known: Vec<UncertainSurface> = order
        .iter()
        .map(|i| uncertain_surface(cloud, found, &members[*i], *i))
        .collect();
    let points: Vec<Vec<Point3>> = order.iter().map(|i| cloud.at(&members[*i])).collect();
    let ranked = |(a, b): (usize, usize)| (rank[a] as usize, rank[b] as usize);
    let pairs = found.neighbours(cloud).map(ranked);
    let label = |place: &u32| match found.labels[*place as usize] {
        UNLABELLED => None,
        label => Some(rank[label as usize]),
    };
    let entities: Vec<Entity> = order.iter().map(entity).collect();
    // Entities that were fitted once more at the end may lie beyond the tolerance.
    let of_form = entities.iter().filter(|e| found.is_form && e.is_explained);
    let rms = of_form.map(|e| e.rms);
    let noise = rms.fold(found.noise * scaling.unit, f64::max);
    let outward: Vec<i8> = entities.iter().map(|e| e.outward).collect();
    let set = EntitySet {
        known: &known,
        outward: &outward,
        points: &points,
        noise: found.noise,
    };
    let patterns = patterns(&set, (scaling.unit, scaling.origin));
    let (mut faces, face_labels, of_faces) = faces.report(
        |entity| Some(rank[entity as usize]),
        index.iter().copied(),
        cloud.pairs(),
    );
    add_borders(cloud, (&known, &outward), &mut faces, &of_faces, scaling);
    let mut relations = relations(&known, found.noise, scaling.unit);
    add_given(&mut relations, &found.related);
    Recognition {
        faces,
        face_labels,
        entities,
        symmetries: symmetries(&set, &patterns, (scaling.unit, scaling.origin)),
        patterns,
        labels: index.iter().map(label).collect(),
        normals: index.iter().map(|i| cloud.normals[*i as usize]).collect(),
        blends: blends(&known, &points, (pairs, MIN_BORDER_PAIRS), scaling.unit),
        relations,
        noise,
        is_form: found.is_form,
        free: free_share(cloud, found),
        is_oriented: false,
    }
}

/// Adds the borders of flat faces, given the surfaces and their outer sides, and the points of each
/// face.
fn add_borders(
    cloud: &Cloud,
    (known, outward): (&[UncertainSurface], &[i8]),
    faces: &mut [Face],
    members: &[Vec<u32>],
    scaling: &Scaling,
) {
    let of_points = faces.par_iter_mut().zip(members);
    of_points.for_each(|(face, members)| {
        let surface = &known[face.entity].surface;
        face.border = flat_border(surface, outward[face.entity], &cloud.at(members), scaling);
    });
}

/// Returns the border of points of a plane in the scan's unit, seen from the side of `outward`;
/// nothing for other surfaces.
fn flat_border(
    surface: &Primitive,
    outward: i8,
    points: &[Point3],
    scaling: &Scaling,
) -> Vec<Vec<Point3>> {
    if surface.kind != PrimitiveKind::Plane {
        return Vec::new();
    }
    let axis = surface.axis.map(|v| if outward < 0 { -v } else { v });
    let [u, v] = frame(axis);
    let flat: Vec<[f64; 2]> = points.iter().map(|p| [dot(*p, u), dot(*p, v)]).collect();
    let height = dot(crate::fit::mean(points), axis);
    let out = |[x, y]: [f64; 2]| {
        scaling.back(std::array::from_fn(|k| {
            x * u[k] + y * v[k] + height * axis[k]
        }))
    };
    let rings = border::of_points(&flat).into_iter();
    largest_first(
        rings
            .map(|ring| ring.into_iter().map(out).collect())
            .collect(),
    )
}

/// Returns the points that determine the accuracy of a surface: with noise, only interior ones,
/// since the assignment of points at an edge is uncertain.
fn sure_points(cloud: &Cloud, found: &Segmentation, members: &[u32], label: usize) -> Vec<Point3> {
    if found.noise < MAX_EXACT_NOISE {
        return cloud.at(members);
    }
    cloud.at(&core(cloud, members, found.surfaces[label].kind))
}

fn entity(
    cloud: &Cloud,
    found: &Segmentation,
    members: &[u32],
    label: usize,
    count: usize,
    scaling: &Scaling,
) -> Entity {
    let points = cloud.at(members);
    let mut surface = found.surfaces[label].about(crate::fit::mean(&points));
    if surface.kind == PrimitiveKind::Cone && surface.other < 0.0 {
        surface.axis = surface.axis.map(|x| -x);
        surface.other = -surface.other;
    }
    let rms = (squares(&surface, &points) / points.len() as f64).sqrt();
    // Few points given by hand may lie on a surface by chance more exactly than the noise.
    let least = found
        .given
        .get(label)
        .map_or(0.0, |_| found.noise / 3.0_f64.sqrt());
    let free = degrees_of_freedom(&surface, points.len());
    let sigma = (rms * (points.len() as f64 / free).sqrt()).max(least);
    let side: f64 = members
        .iter()
        .map(|i| {
            let i = *i as usize;
            dot(surface.normal(cloud.points[i]), cloud.normals[i]).signum()
        })
        .sum();
    let outward = match side / points.len() as f64 {
        s if s > 0.5 => 1,
        s if s < -0.5 => -1,
        _ => 0,
    };
    Entity {
        surface: surface.quadric(scaling.unit, scaling.origin),
        deviations: deviations(
            &surface,
            &sure_points(cloud, found, members, label),
            (sigma, found.rounding),
            scaling,
        ),
        outward,
        points: count,
        rms: rms * scaling.unit,
        extent: surface.extent(&points).map(|h| h * scaling.unit),
        label: found.given.get(label).map(|given| given.label),
        is_explained: found.is_explained(label),
    }
}

/// Returns the standard deviations of the parameters in the terms of CAD systems, from points with
/// the standard deviation `sigma` and a rounding that they may share, both in diagonals.
fn deviations(
    surface: &Primitive,
    points: &[Point3],
    (sigma, rounding): (f64, f64),
    scaling: &Scaling,
) -> Deviations {
    let Some(covariance) = covariance(surface, points) else {
        return Deviations::OPEN;
    };
    let covariance = covariance.map(|row| row.map(|x| x * sigma * sigma));
    let covariance = with_rounding(covariance, surface.kind, rounding);
    deviations_of(surface, &covariance, scaling)
}

/// Returns [`deviations`] from the covariance of the minimal parameters.
pub(crate) fn deviations_of(
    surface: &Primitive,
    covariance: &[ParameterRow; MAX_PARAMETERS],
    scaling: &Scaling,
) -> Deviations {
    let unit = scaling.unit;
    let n = surface.kind.parameters();
    // The standard deviation of a value with these derivatives by the minimal parameters.
    let of = |row: &ParameterRow| -> f64 {
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..n {
                sum += row[i] * covariance[i][j] * row[j];
            }
        }
        sum.max(0.0).sqrt()
    };
    let [e, f] = surface.frame();
    let row = |at: &[(usize, f64)]| {
        let mut row = [0.0; MAX_PARAMETERS];
        at.iter().for_each(|(k, v)| row[*k] = *v);
        of(&row)
    };
    let direction = std::array::from_fn(|k| row(&[(0, e[k]), (1, f[k])]));
    let a = surface.axis;
    match surface.kind {
        PrimitiveKind::Plane => Deviations {
            direction,
            size: {
                // d = n·x at the centroid of the points; a tilt about it also changes d.
                let x: Point3 =
                    std::array::from_fn(|k| surface.place[k] * unit + scaling.origin[k]);
                row(&[(0, dot(e, x)), (1, dot(f, x)), (2, unit)])
            },
            ..Deviations::default()
        },
        PrimitiveKind::Sphere => Deviations {
            place: std::array::from_fn(|k| unit * row(&[(k, 1.0)])),
            size: unit * row(&[(3, 1.0)]),
            ..Deviations::default()
        },
        PrimitiveKind::Cylinder => Deviations {
            direction,
            place: std::array::from_fn(|k| unit * row(&[(2, e[k]), (3, f[k])])),
            size: unit * row(&[(4, 1.0)]),
            ..Deviations::default()
        },
        PrimitiveKind::Cone => {
            let (tan, sin) = (surface.other.tan(), surface.other.sin());
            let h = -surface.size / tan;
            let place = std::array::from_fn(|k| {
                unit * row(&[
                    (0, h * e[k]),
                    (1, h * f[k]),
                    (2, e[k]),
                    (3, f[k]),
                    (4, -a[k] / tan),
                    (5, a[k] * surface.size / (sin * sin)),
                ])
            });
            Deviations {
                direction,
                place,
                size: row(&[(5, 1.0)]),
                minor: 0.0,
            }
        }
        PrimitiveKind::Torus => Deviations {
            direction,
            place: std::array::from_fn(|k| unit * row(&[(2 + k, 1.0)])),
            size: unit * row(&[(5, 1.0)]),
            minor: unit * row(&[(6, 1.0)]),
        },
    }
}
