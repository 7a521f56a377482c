//! Covering: patches until all of the surface in the region lies on one (the future work of Wurm,
//! Jüttler and Kim 2003, section 5).
//!
//! The surface is known by samples: random places of the region, projected. Each round starts a few
//! patches at uncovered samples far from what is covered and from one another, grown side by side;
//! in the end, patches that others make superfluous are left out.

use crate::cells::{Place, middle_of};
use crate::surface::{Random, contains, project};
use crate::unit::UnitBox;
use crate::whole::Whole;
use crate::{Error, Options, Parameterized, single};
use isoform_geom::{Aabb, Field, Parts, Point3, RationalPatch, distance_squared, dot, norm, sub};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Random places that are projected to samples of a part.
const PLACES: usize = 30_000;
/// The same for all parts of a surface together.
const MOST_PLACES: usize = 150_000;
/// Patches that are grown side by side; fixed, so that the result does not depend on the number of
/// threads.
const ROUND: usize = 4;
/// Sets of samples that are covered in turn,
const MOST_ROUNDS: usize = 4;
/// unless no more than this share of a set is not covered already.
const ENOUGH: f64 = 3e-4;
/// Cells of a patch in each direction, from whose middles feet of samples are sought,
const GRID: usize = 32;
/// and from those of their quarters, so often in turn, where
const MOST_QUARTERINGS: u32 = 4;
/// normals at corners differ by more than 30°: round sharp ridges Newton's method needs near
/// starts.
const ALIKE: f64 = 0.87;
/// Newton steps towards the foot of a sample on a patch.
const STEPS: usize = 12;
/// Samples at which no patch may be had are given up after so many failures altogether.
const MOST_FAILURES: usize = 200;

/// Patches with what they cover.
#[derive(Clone, Debug)]
pub struct Cover {
    /// The patches, in the order in which they were chosen.
    pub patches: Vec<Parameterized>,
    /// Points of the surface by which coverage was measured.
    pub samples: usize,
    /// How many of them lie on a patch, within the tolerance.
    pub covered: usize,
}

impl Cover {
    /// A cover made in the unit box, in space; `field` gives the functions of parts.
    fn out<'f>(self, unit: &UnitBox, field: &dyn Fn(usize) -> &'f dyn Field) -> Self {
        let out = |made: Parameterized| {
            let part = field(made.part);
            unit.made_out(made, part)
        };
        Self {
            patches: self.patches.into_iter().map(out).collect(),
            ..self
        }
    }
}

/// Covers the surface in the region with patches that keep the tolerance.
///
/// `most` bounds their number, `stop` is asked between rounds, and `threads` work side by side; the
/// result depends on neither of the latter unless it is stopped.
pub fn cover(
    field: &dyn Field,
    options: &Options,
    most: usize,
    threads: usize,
    stop: &dyn Fn() -> bool,
) -> Result<Cover, Error> {
    single::check(options)?;
    let unit = UnitBox::of(&options.region);
    let (inside, options) = (unit.field(field), unit.options(options));
    cover_whole(&Whole::of_field(&inside), &options, most, threads, stop)
        .map(|cover| cover.out(&unit, &|_| field))
        .map_err(|error| unit.error_out(error))
}

/// The same of a surface of parts: each patch stays on one, and ends at its edges.
pub fn cover_parts(
    parts: &Parts,
    options: &Options,
    most: usize,
    threads: usize,
    stop: &dyn Fn() -> bool,
) -> Result<Cover, Error> {
    single::check(options)?;
    let unit = UnitBox::of(&options.region);
    let (inside, options) = (unit.parts(parts), unit.options(options));
    cover_whole(
        &Whole::of_parts(&inside, &options.region),
        &options,
        most,
        threads,
        stop,
    )
    .map(|cover| cover.out(&unit, &|part| parts.parts[part].field.as_ref()))
    .map_err(|error| unit.error_out(error))
}

fn cover_whole(
    whole: &Whole<'_>,
    options: &Options,
    most: usize,
    threads: usize,
    stop: &dyn Fn() -> bool,
) -> Result<Cover, Error> {
    let tolerance = options.tolerance.ok_or(Error::Option {
        name: "the tolerance",
        value: f64::NAN,
    })?;
    let (mut random, mut rounds) = (Random::new(options.seed), 1);
    let (mut samples, mut parts) = more_samples(whole, options, &mut random);
    if samples.is_empty() {
        return Err(Error::NoSurface);
    }
    let mut patches: Vec<(Parameterized, Vec<bool>)> = Vec::new();
    let mut open: Vec<bool> = vec![true; samples.len()];
    // The squared distance of each sample from covered samples and tried seeds.
    let mut far = vec![f64::INFINITY; samples.len()];
    let (mut failures, mut last_error) = (0, Error::NoSurface);
    while patches.len() < most && failures < MOST_FAILURES && !stop() {
        if !open.contains(&true) {
            if rounds == MOST_ROUNDS {
                break;
            }
            // Other samples see what lies between the first ones.
            rounds += 1;
            let (fresh, their_parts) = more_samples(whole, options, &mut random);
            let mut fresh_open = vec![true; fresh.len()];
            for (patch, covers) in &mut patches {
                let reached = reached(&patch.grown.patch, &fresh, tolerance);
                fresh_open
                    .iter_mut()
                    .zip(&reached)
                    .for_each(|(o, r)| *o &= !r);
                covers.extend(reached);
            }
            let missed = fresh_open.iter().filter(|o| **o).count();
            let count = fresh.len() as f64;
            samples.extend(fresh);
            parts.extend(their_parts);
            open.extend(fresh_open);
            far.resize(samples.len(), f64::INFINITY);
            if (missed as f64) < ENOUGH * count {
                break;
            }
            update_far(&samples, &open, &mut far);
            continue;
        }
        let seeds = next_seeds(&samples, &open, &far, ROUND.min(most - patches.len()));
        let made = side_by_side(seeds.len(), threads, &|i| {
            let patch = single::at(whole, parts[seeds[i]], samples[seeds[i]], options)?;
            let covers = reached(&patch.grown.patch, &samples, tolerance);
            Ok((patch, covers))
        });
        for (seed, made) in seeds.iter().zip(made) {
            match made {
                Ok((patch, covers))
                    if patch.is_unfolded
                        && patch.distances.bound.is_some_and(|b| b <= tolerance)
                        && covers.contains(&true) =>
                {
                    for (i, c) in covers.iter().enumerate() {
                        open[i] &= !c;
                    }
                    // Its own sample is done with, even if rounding says that it is not quite
                    // reached.
                    open[*seed] = false;
                    patches.push((patch, covers));
                }
                Ok(_) => {
                    failures += 1;
                    open[*seed] = false;
                }
                Err(error) => {
                    (failures, last_error) = (failures + 1, error);
                    open[*seed] = false;
                }
            }
            far[*seed] = 0.0;
        }
        update_far(&samples, &open, &mut far);
    }
    if patches.is_empty() {
        return Err(last_error);
    }
    let patches = needed(patches);
    let covered = (0..samples.len())
        .filter(|&i| patches.iter().any(|p| p.1[i]))
        .count();
    Ok(Cover {
        patches: patches.into_iter().map(|p| p.0).collect(),
        samples: samples.len(),
        covered,
    })
}

/// Points of the surface in the region, and the parts they lie on.
fn more_samples(
    whole: &Whole<'_>,
    options: &Options,
    random: &mut Random,
) -> (Vec<Point3>, Vec<usize>) {
    let scale = options.region.diagonal();
    let mut found = (Vec::new(), Vec::new());
    let relevant = if whole.is_single() {
        vec![0]
    } else {
        whole.relevant()
    };
    let places = PLACES.min(MOST_PLACES / relevant.len().max(1));
    for part in relevant {
        for _ in 0..places {
            let p = project(whole.field(part), random.place(&options.region), scale)
                .filter(|p| contains(&options.region, *p));
            if let Some(p) = p.filter(|p| whole.is_on(part, *p, scale)) {
                found.0.push(p);
                found.1.push(part);
            }
        }
    }
    found
}

/// Uncovered samples, each the farthest from what is covered and from those before it.
fn next_seeds(samples: &[Point3], open: &[bool], far: &[f64], count: usize) -> Vec<usize> {
    let mut far = far.to_vec();
    let mut seeds: Vec<usize> = Vec::new();
    for _ in 0..count {
        // The first among equals.
        let best = (0..samples.len())
            .filter(|&i| open[i])
            .max_by(|&a, &b| far[a].total_cmp(&far[b]).then(b.cmp(&a)));
        let Some(best) = best.filter(|b| !seeds.contains(b)) else {
            break;
        };
        seeds.push(best);
        for (f, p) in far.iter_mut().zip(samples) {
            *f = f.min(distance_squared(*p, samples[best]));
        }
    }
    seeds
}

/// The distances of open samples from those that no longer are.
fn update_far(samples: &[Point3], open: &[bool], far: &mut [f64]) {
    let done: Vec<Point3> = samples
        .iter()
        .zip(open)
        .filter(|(_, o)| !**o)
        .map(|(p, _)| *p)
        .collect();
    let tree = isoform_geom::KdTree::new(&done);
    for i in 0..samples.len() {
        if open[i] && !done.is_empty() {
            far[i] = far[i].min(tree.nearest(samples[i]).map_or(f64::INFINITY, |n| n.1));
        }
    }
}

/// Runs jobs on threads; results in their order.
fn side_by_side<T: Send>(jobs: usize, threads: usize, job: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    if threads <= 1 || jobs <= 1 {
        return (0..jobs).map(job).collect();
    }
    let next = AtomicUsize::new(0);
    let mut all: Vec<(usize, T)> = std::thread::scope(|scope| {
        let work = || {
            let mut mine = Vec::new();
            loop {
                let i = next.fetch_add(1, Ordering::Relaxed);
                if i >= jobs {
                    return mine;
                }
                mine.push((i, job(i)));
            }
        };
        let handles: Vec<_> = (0..threads.min(jobs)).map(|_| scope.spawn(work)).collect();
        handles
            .into_iter()
            .flat_map(|h| {
                h.join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            })
            .collect()
    });
    all.sort_by_key(|r| r.0);
    all.into_iter().map(|r| r.1).collect()
}

/// Which points lie within `tolerance` of a patch: the foot is sought by Newton's method from the
/// nearest of some places, which are closer together where the patch is more curved.
pub fn reached(patch: &RationalPatch, points: &[Point3], tolerance: f64) -> Vec<bool> {
    let mut starts = Starts::default();
    let at = |i: usize| i as f64 / GRID as f64;
    for k in 0..GRID * GRID {
        let (i, j) = (k / GRID, k % GRID);
        starts.add(patch, [(at(i), at(i + 1)), (at(j), at(j + 1))], 0);
    }
    let near = tolerance + starts.reach;
    let wide = beyond(patch, tolerance);
    let tree = isoform_geom::KdTree::new(&starts.points);
    let reaches = |p: Point3| {
        let Some((k, d2)) = tree.nearest(p).map(|n| (n.0, n.1)) else {
            return false;
        };
        d2 <= near * near && comes_to(patch, p, starts.parameters[k], tolerance)
    };
    points
        .iter()
        .map(|p| contains(&wide, *p) && reaches(*p))
        .collect()
}

/// A box beyond which nothing is within a distance of a patch, whose control points span it where
/// their weights are positive.
fn beyond(patch: &RationalPatch, distance: f64) -> Aabb {
    let mut all = Aabb::EMPTY;
    if patch.control_weights().0 <= 0.0 {
        return Aabb {
            lo: [f64::NEG_INFINITY; 3],
            hi: [f64::INFINITY; 3],
        };
    }
    for c in patch.control() {
        all.add([c[0] / c[3], c[1] / c[3], c[2] / c[3]]);
    }
    // Twice as much, as quotients are rounded.
    Aabb {
        lo: all.lo.map(|v| v - 2.0 * distance),
        hi: all.hi.map(|v| v + 2.0 * distance),
    }
}

/// Places of a patch from which feet are sought.
#[derive(Default)]
struct Starts {
    parameters: Vec<(f64, f64)>,
    points: Vec<Point3>,
    /// No point of the patch should be farther from one of them.
    reach: f64,
}

impl Starts {
    /// The middle of a cell, or of its quarters where its normals differ much.
    fn add(&mut self, patch: &RationalPatch, cell: Place, depth: u32) {
        let [(u0, u1), (v0, v1)] = cell;
        let corners = [(u0, v0), (u0, v1), (u1, v0), (u1, v1)].map(|(u, v)| patch.tangents(u, v));
        let normals = corners.map(|t| {
            let n = t.normal();
            n.map(|v| v / norm(n))
        });
        let turns = (1..4).any(|k| dot(normals[0], normals[k]) < ALIKE);
        let (u, v) = middle_of(cell);
        if turns && depth < MOST_QUARTERINGS {
            for side in [(u0, u), (u, u1)] {
                for other in [(v0, v), (v, v1)] {
                    self.add(patch, [side, other], depth + 1);
                }
            }
            return;
        }
        let point = patch.point(u, v);
        for corner in corners {
            self.reach = self.reach.max(norm(sub(corner.point, point)));
        }
        self.parameters.push((u, v));
        self.points.push(point);
    }
}

/// Whether Newton's method for the foot of a point comes within `tolerance` of it.
fn comes_to(patch: &RationalPatch, p: Point3, from: (f64, f64), tolerance: f64) -> bool {
    let (mut u, mut v) = from;
    for _ in 0..STEPS {
        let t = patch.tangents(u, v);
        let r = sub(p, t.point);
        if dot(r, r) <= tolerance * tolerance {
            return true;
        }
        let (a, b, c) = (dot(t.u, t.u), dot(t.u, t.v), dot(t.v, t.v));
        let (e, f) = (dot(t.u, r), dot(t.v, r));
        let determinant = (a * c - b * b).max(f64::MIN_POSITIVE);
        u = (u + (c * e - b * f) / determinant).clamp(0.0, 1.0);
        v = (v + (a * f - b * e) / determinant).clamp(0.0, 1.0);
    }
    false
}

/// A part of the patches that covers as much: greedily the one that covers most of what is open.
fn needed(mut patches: Vec<(Parameterized, Vec<bool>)>) -> Vec<(Parameterized, Vec<bool>)> {
    let count = patches.first().map_or(0, |p| p.1.len());
    let mut open: Vec<bool> = vec![true; count];
    let mut chosen = Vec::new();
    loop {
        let gain = |p: &(Parameterized, Vec<bool>)| {
            p.1.iter().zip(&open).filter(|(c, o)| **c && **o).count()
        };
        let best = (0..patches.len())
            .max_by(|&a, &b| gain(&patches[a]).cmp(&gain(&patches[b])).then(b.cmp(&a)));
        let Some(best) = best.filter(|&b| gain(&patches[b]) > 0) else {
            return chosen;
        };
        let patch = patches.remove(best);
        for (o, c) in open.iter_mut().zip(&patch.1) {
            *o &= !c;
        }
        chosen.push(patch);
    }
}
