//! Proposal of a HyperFun template for recognised entities: their half spaces are joined by set
//! operations to the solid that the points bound, with named parameters.

mod cells;
mod contacts;
mod corner;
mod dimensions;
mod evidence;
mod footprint;
mod frame;
mod half;
mod program;
mod solid;
mod winding;

use crate::chart::Primitive;
use crate::cost::Cost;
use crate::entity::Recognition;
use crate::noise::MAX_EXACT_NOISE;
use crate::orient::orient;
use crate::segment::MIN_EVIDENCE;
use cells::{OrientedPoints, SideSample, bit, contradiction, feet, places, sides, votes};
use evidence::known_cells;
use footprint::footprint;
use frame::{PartFrame, longest};
use half::{HalfSpace, HalfSpaceSource, separators};
use isoform_control::{Control, Stopped};
use isoform_geom::{Aabb, Point3, PointCloud, dot};
use program::ProgramInput;
use solid::{Bits, MAX_HALVES, SolidFormula, ones, solid};

/// Maximum number of half spaces that are added if the entities' own do not separate the solid.
const MAX_ADDED_HALVES: usize = 24;
/// Maximum number of entities of a template: it leaves room for the half spaces that are added.
const MAX_TEMPLATE_ENTITIES: usize = MAX_HALVES - MAX_ADDED_HALVES;
/// Minimum share of the contradictions that an added half space removes, and the minimum decrease
/// of their weight: a few samples may be on the wrong side.
const MIN_CONTRADICTION_DECREASE: (f64, f64) = (0.05, 4.0);
/// Rounding of lengths in the program, as a share of the diagonal, or of the noise if that is more:
/// a fit starts from there, and need not recover what rounding removed.
const LENGTH_ROUNDING: (f64, f64) = (1e-10, 1e-2);

/// A template proposed for a scan.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// HyperFun program, with starts and bounds of its parameters.
    pub program: String,
    /// True for each entity that bounds the solid.
    pub used: Vec<bool>,
    /// Share of the scan's points that lie on those entities.
    pub explained: f64,
    /// Deficiencies of the template.
    pub gaps: Vec<Gap>,
}

impl Proposal {
    /// Returns true if the template closes with faces that were seen and explains all but a
    /// fiftieth of the points.
    pub fn is_complete(&self) -> bool {
        self.faults(0.0).next().is_none()
    }

    /// Returns the gaps for which it is not complete; `isolated` is the share of the points that
    /// lie apart from all others, which no entity needs to explain.
    pub fn faults(&self, isolated: f64) -> impl Iterator<Item = &Gap> {
        // Noise at edges leaves up to one point in a hundred.
        let is_explained = self.explained + isolated >= 1.0 - 0.02;
        self.gaps.iter().filter(move |gap| match gap {
            Gap::Unassigned(_) => !is_explained,
            Gap::Unused { needed, .. } => *needed > 0 || !is_explained,
            Gap::Standing(..) => false,
            Gap::Unseen(..) | Gap::Open(_) => true,
        })
    }
}

/// A deficiency of a proposed template.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Gap {
    /// This share of the points lies on no entity.
    Unassigned(f64),
    /// No face was seen on this side of the box (axis of the part's frame, true for the upper
    /// side); the box of the data closes the solid there.
    Unseen(usize, bool),
    /// The part stands on a plane on this side (axis of the part's frame, true for the upper side),
    /// which closes the solid there.
    Standing(usize, bool),
    /// The entities do not separate this share of the samples near the surface.
    Open(f64),
    /// Entities do not bound the solid.
    Unused {
        /// Number of entities.
        count: usize,
        /// Share of the points that lie on them.
        share: f64,
        /// Number of those whose points the surfaces of the solid do not explain.
        needed: usize,
    },
}

impl std::fmt::Display for Gap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unassigned(share) => write!(
                f,
                "{:.1} % of the points lie on no recognised entity",
                100.0 * share
            ),
            Self::Unseen(axis, is_upper) => {
                let end = end_of(*axis, *is_upper);
                write!(f, "no face closes {end}: the end of the data stands for it")
            }
            Self::Standing(axis, is_upper) => {
                let end = end_of(*axis, *is_upper);
                write!(
                    f,
                    "{end} was not seen: the plane on which the part stands closes it"
                )
            }
            Self::Open(share) => write!(
                f,
                "the entities do not close: {:.1} % of the places looked at lie on the wrong side",
                100.0 * share
            ),
            Self::Unused { count, share, .. } => write!(
                f,
                "{count} entities with {:.1} % of the points do not bound the solid",
                100.0 * share
            ),
        }
    }
}

/// Names an end of the part.
fn end_of(axis: usize, is_upper: bool) -> String {
    let side = if is_upper { "upper" } else { "lower" };
    format!(
        "the {side} end along the part's {} axis",
        ['x', 'y', 'z'][axis]
    )
}

/// Reasons why no template is proposed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ProposeError {
    /// No entity was recognised.
    #[error("no entity was recognised")]
    NoEntities,
    /// More entities than a template can hold.
    #[error("{0} entities are too many for a template, which holds {MAX_TEMPLATE_ENTITIES}")]
    Many(usize),
    /// The entities bound no solid.
    #[error("the entities bound no solid")]
    NoSolid,
    /// The work was cancelled, or its deadline has passed.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

/// Proposes a template for the points in which entities were recognised. A plane on which the part
/// stands (a point in the scan's coordinates and a unit normal) closes it where no face was seen.
///
/// # Errors
/// [`ProposeError`].
pub fn propose(
    scan: &PointCloud,
    found: &Recognition,
    supports: &[(Point3, Point3)],
    title: &str,
    control: &Control<'_>,
) -> Result<Proposal, ProposeError> {
    let count = found.entities.len();
    if count == 0 {
        return Err(ProposeError::NoEntities);
    }
    if count > MAX_TEMPLATE_ENTITIES {
        return Err(ProposeError::Many(count));
    }
    control.report("template", 0.0);
    let middle: Point3 = {
        let center = Aabb::from_points(&scan.points).center();
        std::array::from_fn(|k| center[k] + scan.origin[k])
    };
    let frame = PartFrame::from_recognition(found, middle);
    let upright = PosedPoints::new(scan, found, &frame, supports);
    let outward = upright.outward(&frame.surfaces);
    let halves: Vec<HalfSpace> = (0..count)
        .map(|i| HalfSpace::of_entity(&frame.surfaces[i], outward[i], i))
        .collect();
    let oriented = upright.oriented(found.noise);
    let feet = feet(&oriented, &halves);
    let places = places(&oriented, &feet, control)?;
    // With the corner of a blend known, the rest of its surface is seldom needed.
    let corners: Vec<HalfSpace> = corners(found, &frame).collect();
    let has_corner = |of: &HalfSpace| {
        let mut others = corners.iter();
        others.any(|c| c.source.entity() == of.source.entity())
    };
    let (mut more, mut halves): (Vec<HalfSpace>, Vec<HalfSpace>) =
        halves.into_iter().partition(has_corner);
    halves.extend(corners);
    halves.truncate(MAX_HALVES - MAX_ADDED_HALVES);
    let mut sides = sides(&halves, &places);
    let bounds = upright.bounds;
    more.extend(separators(&frame.surfaces, &bounds));
    separate(&mut halves, &mut sides, &more, &places);
    control.check()?;
    let known = known_cells(&halves, &feet, &votes(&sides, &places), &bounds);
    let solid = solid(&known.cells, halves.len());
    let is_side = |k: &usize| matches!(halves[*k].source, HalfSpaceSource::Side(..));
    let (unseen, seen): (Vec<usize>, Vec<usize>) = ones(solid.halves()).partition(is_side);
    // A sheet, for example. The two sides of a wall end on four sides of the box of the data.
    if seen.is_empty() || 2 * seen.len() < unseen.len() {
        return Err(ProposeError::NoSolid);
    }
    let part = ProgramInput {
        frame: &frame,
        found,
        halves: &halves,
        solid: &solid,
        outward: &outward,
        middle,
        bounds,
        digits: digits(bounds.diagonal(), found.noise),
    };
    let used = part.used();
    let needed = upright.needed(&frame.surfaces, &used, found.noise);
    Ok(Proposal {
        program: part.program(title),
        explained: share(&found.labels, |l| l.is_some_and(|l| used[l as usize])),
        gaps: gaps(
            found,
            (&halves, &solid),
            &used,
            (needed, known.contradicted),
            &upright.stands,
        ),
        used,
    })
}

/// Moves the end of a box to a plane on which the part stands, along the axis nearest to the
/// plane's normal; returns the axis, and true for the upper end.
pub fn stand_on(bounds: &mut Aabb, at: Point3, normal: Point3) -> (usize, bool) {
    let k = longest(normal);
    let mut middle = bounds.center();
    middle[k] = at[k];
    let height = at[k] + dot(normal, std::array::from_fn(|i| at[i] - middle[i])) / normal[k];
    let is_upper = height > bounds.center()[k];
    if is_upper {
        bounds.hi[k] = height;
    } else {
        bounds.lo[k] = height;
    }
    (k, is_upper)
}

/// The points in the frame of the part, with the faces that tables hide.
struct PosedPoints {
    points: Vec<Point3>,
    /// Unit normals, outwards.
    normals: Vec<Point3>,
    labels: Vec<Option<usize>>,
    /// Box of the points and of the planes on which the part stands.
    bounds: Aabb,
    /// Ends on which the part stands: an axis, and true for the upper end.
    stands: Vec<(usize, bool)>,
}

impl PosedPoints {
    fn new(
        scan: &PointCloud,
        found: &Recognition,
        frame: &PartFrame,
        supports: &[(Point3, Point3)],
    ) -> Self {
        let center = Aabb::from_points(&scan.points).center();
        let points = scan.points.iter().map(|p| frame.apply(*p, center));
        let turned = |n: &Point3| -> Point3 { frame.rows.map(|r| dot(r, *n)) };
        let points: Vec<Point3> = points.collect();
        let mut new = Self {
            bounds: Aabb::from_points(&points),
            points,
            normals: found.normals.iter().map(turned).collect(),
            labels: found.labels.iter().map(|l| l.map(|l| l as usize)).collect(),
            stands: Vec::new(),
        };
        let in_frame = |(at, normal): &(Point3, Point3)| {
            let at: Point3 = std::array::from_fn(|k| at[k] - scan.origin[k]);
            (frame.apply(at, center), turned(normal))
        };
        let supports: Vec<(Point3, Point3)> = supports.iter().map(in_frame).collect();
        if !found.is_oriented {
            let (points, labels) = (&new.points, &new.labels);
            orient(points, &mut new.normals, labels, &frame.surfaces, &supports);
        }
        for (at, normal) in supports {
            new.stand_on(at, normal);
        }
        new
    }

    /// Adds the face hidden by a plane on which the part stands.
    fn stand_on(&mut self, at: Point3, normal: Point3) {
        let end = stand_on(&mut self.bounds, at, normal);
        let (face, normal) = footprint(&self.points, &self.normals, &self.bounds, end);
        self.normals.extend(std::iter::repeat_n(normal, face.len()));
        self.labels.extend(std::iter::repeat_n(None, face.len()));
        self.points.extend(face);
        self.stands.push(end);
    }

    fn oriented(&self, noise: f64) -> OrientedPoints<'_> {
        OrientedPoints {
            points: &self.points,
            normals: &self.normals,
            halves: &self.labels,
            noise,
        }
    }

    /// Returns the number of entities that are not used although the surfaces of the used ones do
    /// not explain their points: without the entity these cost more than its evidence.
    fn needed(&self, surfaces: &[Primitive], used: &[bool], noise: f64) -> usize {
        // Of exact points a few are entities of their own that no face needs.
        let unit = self.bounds.diagonal();
        if noise < MAX_EXACT_NOISE * unit {
            return 0;
        }
        let cost = Cost::with_noise(noise / unit);
        let at = |s: &Primitive, p: &Point3| cost.of_point(s.distance(*p) / unit);
        let mut gains = vec![0.0; surfaces.len()];
        for (p, label) in self.points.iter().zip(&self.labels) {
            if let Some(own) = label.filter(|l| !used[*l]) {
                let others = surfaces.iter().zip(used).filter(|(_, used)| **used);
                let without = others.fold(cost.most, |least, (s, _)| least.min(at(s, p)));
                gains[own] += without - at(&surfaces[own], p);
            }
        }
        gains.iter().filter(|gain| **gain > MIN_EVIDENCE).count()
    }

    /// Returns the side of each surface on which most of the outward normals lie: 1 or −1.
    fn outward(&self, surfaces: &[Primitive]) -> Vec<f64> {
        let mut sums = vec![0.0; surfaces.len()];
        for (i, label) in self.labels.iter().enumerate() {
            if let Some(l) = label {
                let normal = surfaces[*l].normal(self.points[i]);
                sums[*l] += dot(normal, self.normals[i]).signum();
            }
        }
        sums.into_iter().map(f64::signum).collect()
    }
}

/// Returns the corners that blends round.
fn corners<'a>(
    found: &'a Recognition,
    frame: &'a PartFrame,
) -> impl Iterator<Item = HalfSpace> + 'a {
    found.blends.iter().filter_map(|blend| {
        let walls = corner::walls(blend, &found.blends, frame)?;
        let surface = &frame.surfaces[blend.entity];
        Some(HalfSpace::corner(surface, blend.entity, walls))
    })
}

/// Returns the number of decimals of lengths.
fn digits(diagonal: f64, noise: f64) -> usize {
    let least = (diagonal * LENGTH_ROUNDING.0).max(noise * LENGTH_ROUNDING.1);
    (-least.log10()).ceil().clamp(0.0, 18.0) as usize
}

fn share<T>(of: &[T], is_counted: impl Fn(&T) -> bool) -> f64 {
    of.iter().filter(|x| is_counted(x)).count() as f64 / of.len().max(1) as f64
}

/// Adds half spaces greedily while each reduces the contradictions, and records on which side the
/// samples lie.
fn separate(
    halves: &mut Vec<HalfSpace>,
    sides: &mut [Bits],
    candidates: &[HalfSpace],
    places: &[SideSample],
) {
    for _ in 0..MAX_ADDED_HALVES {
        let before = votes(sides, places);
        let now = contradiction(&before);
        // Samples in cells that hold both sides.
        let is_torn = |i: &usize| before[&sides[*i]].iter().all(|w| *w > 0.0);
        let of_torn: Vec<usize> = (0..places.len()).filter(is_torn).collect();
        let torn: Vec<SideSample> = of_torn.iter().map(|i| places[*i]).collect();
        let k = halves.len();
        let left = |candidate: &HalfSpace| {
            let more = of_torn
                .iter()
                .map(|i| sides[*i] | bit(candidate, k, places[*i].at));
            contradiction(&votes(&more.collect::<Vec<_>>(), &torn))
        };
        let best = candidates.iter().map(|c| (left(c), c));
        let Some((left, best)) = best.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            break;
        };
        if now - left
            < MIN_CONTRADICTION_DECREASE
                .1
                .max(MIN_CONTRADICTION_DECREASE.0 * now)
        {
            break;
        }
        for (bits, place) in sides.iter_mut().zip(places) {
            *bits |= bit(best, k, place.at);
        }
        halves.push(best.clone());
    }
}

fn gaps(
    found: &Recognition,
    (halves, solid): (&[HalfSpace], &SolidFormula),
    used: &[bool],
    (needed, open): (usize, f64),
    stands: &[(usize, bool)],
) -> Vec<Gap> {
    let mut gaps = Vec::new();
    let unassigned = share(&found.labels, Option::is_none);
    if unassigned > 0.0 {
        gaps.push(Gap::Unassigned(unassigned));
    }
    for k in ones(solid.halves()) {
        if let HalfSpaceSource::Side(axis, is_upper) = halves[k].source {
            gaps.push(match stands.contains(&(axis, is_upper)) {
                true => Gap::Standing(axis, is_upper),
                false => Gap::Unseen(axis, is_upper),
            });
        }
    }
    // The solid is closed if at most a hundredth of the weight of the samples is contradictory.
    if open > 0.01 {
        gaps.push(Gap::Open(open));
    }
    let count = used.iter().filter(|u| !**u).count();
    if count > 0 {
        let share = share(&found.labels, |l| l.is_some_and(|l| !used[l as usize]));
        gaps.push(Gap::Unused {
            count,
            share,
            needed,
        });
    }
    gaps
}
