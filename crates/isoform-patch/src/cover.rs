//! Covering: patches until all of the surface in the region lies on one (the future work of Wurm,
//! Jüttler and Kim 2003, section 5).
//!
//! The surface is known by samples: random places of the region, projected. Each round starts a few
//! patches at uncovered samples far from what is covered and from one another, grown side by side;
//! in the end, patches that others make superfluous are left out.
//!
//! With a margin, samples have to lie so deep inside of patches, and a little deeper; then that is
//! proved of the whole surface. Where the proof fails, other patches are started.

use crate::depth::{Border, Proof, Question, Sheet, prove};
use crate::feet::reached;
use crate::singular::{self, Avoided};
use crate::surface::{Random, contains, project};
use crate::unit::UnitBox;
use crate::whole::{NearSingular, Whole};
use crate::{Error, Options, Parameterized, single};
use isoform_geom::{Aabb, Field, KdTree, Parts, Point3, distance_squared, norm, sub};
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
/// Samples at which no patch may be had are given up after so many failures altogether.
const MOST_FAILURES: usize = 200;
/// A patch that was made shorter so often before its distance could be proved has met something
/// hard: if there are singular points, those after it stay away from them.
const HARD: usize = 3;
/// Samples must lie this much deeper than the margin: what is left is for what lies between them,
/// and for cells of the proof. With less there are more and smaller cells.
const DEEPER: f64 = 1.25;
/// Proofs of the margin, with patches for what the one before left open in between.
const MOST_PROOFS: usize = 4;
/// The margin is proved this much beyond the region, in its diagonals: a region some million times
/// as far away as it is large has no sharper corners.
const CORNER: f64 = 1e-9;
/// The largest distance from singular points within which the surface may be left out, unless
/// given, in the region's largest edge.
const APART: f64 = 0.01;

/// How a surface is covered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Covering {
    /// The most patches.
    pub most: usize,
    /// How many threads work side by side; the result does not depend on it.
    pub threads: usize,
    /// How deep every point of the surface in the region shall lie inside of some patch, proved: so
    /// far, straight, from the patch's border.
    pub margin: Option<f64>,
    /// What lies within this distance of a singular point of the surface, where ∇F = 0, is left out
    /// where no patch is found for it; none: a hundredth of the region's largest edge.
    pub apart: Option<f64>,
}

impl Default for Covering {
    fn default() -> Self {
        Self {
            most: 1000,
            threads: 1,
            margin: None,
            apart: None,
        }
    }
}

/// What is known of the depth at which the surface lies inside of patches.
#[derive(Clone, Debug)]
pub struct Depth {
    /// The depth asked for.
    pub margin: f64,
    /// If all of the surface in the region is proved to be as deep: no point of it is farther than
    /// this from the place of its patch that is as deep.
    pub distance: Option<f64>,
    /// Boxes for which that could not be proved.
    pub open: Vec<Aabb>,
}

/// Patches with what they cover.
#[derive(Clone, Debug)]
pub struct Cover {
    /// The patches, in the order in which they were chosen.
    pub patches: Vec<Parameterized>,
    /// Points of the surface by which coverage was measured.
    pub samples: usize,
    /// How many of them lie on a patch, within the tolerance, and, with a margin, as deep.
    pub covered: usize,
    /// Samples besides that were left out near singular points.
    pub left_out: usize,
    /// Singular points, if something was left out about them: of curves of such points, some.
    pub singular: Vec<Point3>,
    /// What was left out is nearer than this to one of them.
    pub apart: f64,
    /// With a margin, what was proved of it.
    pub depth: Option<Depth>,
}

impl Cover {
    /// A cover made in the unit box, in space; `field` gives the functions of parts.
    fn out<'f>(
        self,
        unit: &UnitBox,
        covering: &Covering,
        field: &dyn Fn(usize) -> &'f dyn Field,
    ) -> Self {
        let out = |made: Parameterized| {
            let part = field(made.part);
            unit.made_out(made, part)
        };
        let depth = self.depth.map(|depth| Depth {
            margin: covering.margin.unwrap_or(0.0),
            distance: depth.distance.map(|d| unit.length_out(d)),
            open: depth.open.iter().map(|b| unit.region_out(b)).collect(),
        });
        Self {
            patches: self.patches.into_iter().map(out).collect(),
            singular: self.singular.into_iter().map(|p| unit.out(p)).collect(),
            apart: unit.length_out(self.apart),
            depth,
            ..self
        }
    }
}

/// Covers the surface in the region with patches that keep the tolerance.
///
/// `stop` is asked between rounds: the result depends on nothing else that is not in the options.
pub fn cover(
    field: &dyn Field,
    options: &Options,
    covering: &Covering,
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Cover, Error> {
    single::check(options)?;
    check(covering)?;
    let unit = UnitBox::of(&options.region);
    let (inside, options) = (unit.field(field), unit.options(options));
    let within = unit.covering(covering);
    cover_whole(&Whole::of_field(&inside), &options, &within, stop)
        .map(|cover| cover.out(&unit, covering, &|_| field))
        .map_err(|error| unit.error_out(error))
}

/// The same of a surface of parts: each patch stays on one, and ends at its edges. Nothing is
/// proved of a margin then, and points nearer to an edge than that may lie less deep.
pub fn cover_parts(
    parts: &Parts,
    options: &Options,
    covering: &Covering,
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Cover, Error> {
    single::check(options)?;
    check(covering)?;
    let unit = UnitBox::of(&options.region);
    let (inside, options) = (unit.parts(parts), unit.options(options));
    let whole = Whole::of_parts(&inside, &options.region);
    cover_whole(&whole, &options, &unit.covering(covering), stop)
        .map(|cover| {
            let field = |part: usize| parts.parts[part].field.as_ref();
            cover.out(&unit, covering, &field)
        })
        .map_err(|error| unit.error_out(error))
}

fn check(covering: &Covering) -> Result<(), Error> {
    let lengths = [
        ("the margin", covering.margin),
        ("the distance from singular points", covering.apart),
    ];
    for (name, value) in lengths {
        if let Some(value) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
            return Err(Error::Option { name, value });
        }
    }
    Ok(())
}

fn cover_whole(
    whole: &Whole<'_>,
    options: &Options,
    covering: &Covering,
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Cover, Error> {
    let mut work = Work::new(whole, options, covering)?;
    work.cover_samples(MOST_ROUNDS, stop);
    if work.patches.is_empty() {
        return Err(work.last_error);
    }
    work.patches = needed(std::mem::take(&mut work.patches));
    let depth = covering.margin.map(|margin| match whole.is_single() {
        true => work.prove_margin(margin, stop),
        false => Depth {
            margin,
            distance: None,
            open: vec![options.region],
        },
    });
    let is_covered = |i: &usize| work.patches.iter().any(|p| p.1[*i]);
    let left_out = work.left_out.iter().filter(|l| **l).count();
    let covered = (0..work.samples.len())
        .filter(|i| !work.left_out[*i] && is_covered(i))
        .count();
    Ok(Cover {
        samples: work.samples.len() - left_out,
        covered,
        left_out,
        singular: if left_out > 0 {
            work.singular
        } else {
            Vec::new()
        },
        apart: work.apart,
        depth,
        patches: work.patches.into_iter().map(|p| p.0).collect(),
    })
}

/// A cover in the making.
struct Work<'w> {
    whole: &'w Whole<'w>,
    /// For patches: with a margin they reach beyond the region that is to be covered.
    options: Options,
    region: Aabb,
    tolerance: f64,
    covering: &'w Covering,
    random: Random,
    samples: Vec<Point3>,
    /// The parts on which they lie,
    parts: Vec<usize>,
    /// how deep they have to lie inside of a patch,
    needs: Vec<f64>,
    /// whether they do not yet,
    open: Vec<bool>,
    /// the squared distance of those from samples that do and from tried seeds,
    far: Vec<f64>,
    /// and whether they are left out.
    left_out: Vec<bool>,
    /// Singular points near samples, and how far the surface about them may be left out.
    singular: Vec<Point3>,
    apart: f64,
    /// Whether patches stay away from them: not before one had trouble.
    avoided: Option<Avoided>,
    patches: Vec<(Parameterized, Vec<bool>)>,
    failures: usize,
    last_error: Error,
}

impl<'w> Work<'w> {
    fn new(whole: &'w Whole<'w>, options: &Options, covering: &'w Covering) -> Result<Self, Error> {
        let tolerance = options.tolerance.ok_or(Error::Option {
            name: "the tolerance",
            value: f64::NAN,
        })?;
        let region = options.region;
        let beyond = DEEPER * covering.margin.unwrap_or(0.0);
        let edge = region.size().into_iter().fold(0.0, f64::max);
        let mut work = Self {
            whole,
            options: Options {
                region: Aabb {
                    lo: region.lo.map(|v| v - beyond),
                    hi: region.hi.map(|v| v + beyond),
                },
                ..*options
            },
            region,
            tolerance,
            covering,
            random: Random::new(options.seed),
            samples: Vec::new(),
            parts: Vec::new(),
            needs: Vec::new(),
            open: Vec::new(),
            far: Vec::new(),
            left_out: Vec::new(),
            singular: Vec::new(),
            apart: covering.apart.unwrap_or(APART * edge),
            avoided: None,
            patches: Vec::new(),
            failures: 0,
            last_error: Error::NoSurface,
        };
        work.more_samples();
        if work.samples.is_empty() {
            return Err(Error::NoSurface);
        }
        if whole.is_single() {
            work.singular =
                singular::points(whole.field(0), &work.samples, work.apart, region.diagonal());
        }
        Ok(work)
    }

    /// Starts patches until all samples are covered, and, up to so often, all of another set.
    fn cover_samples(&mut self, rounds: usize, stop: &dyn Fn() -> bool) {
        let mut round = 1;
        while self.patches.len() < self.covering.most && self.failures < MOST_FAILURES && !stop() {
            if self.open.contains(&true) {
                self.grow_some();
                continue;
            }
            if round == rounds {
                break;
            }
            // Other samples see what lies between the first ones.
            round += 1;
            let first = self.samples.len();
            self.more_samples();
            let missed = self.open[first..].iter().filter(|o| **o).count();
            if (missed as f64) < ENOUGH * (self.samples.len() - first) as f64 {
                break;
            }
        }
    }

    /// Points of the surface in the region, and the parts they lie on.
    fn more_samples(&mut self) {
        let scale = self.region.diagonal();
        let whole = self.whole;
        let relevant = if whole.is_single() {
            vec![0]
        } else {
            whole.relevant()
        };
        let places = PLACES.min(MOST_PLACES / relevant.len().max(1));
        let mut fresh = Vec::new();
        for part in relevant {
            for _ in 0..places {
                let p = project(whole.field(part), self.random.place(&self.region), scale)
                    .filter(|p| contains(&self.region, *p));
                if let Some(p) = p.filter(|p| whole.is_on(part, *p, scale)) {
                    fresh.push((p, part));
                }
            }
        }
        self.add(&fresh);
    }

    /// Adds samples with the parts they lie on.
    fn add(&mut self, fresh: &[(Point3, usize)]) {
        let first = self.samples.len();
        let depth = DEEPER * self.covering.margin.unwrap_or(0.0);
        let scale = self.region.diagonal();
        for &(p, part) in fresh {
            // Patches end at edges.
            let edge = (depth > 0.0 && !self.whole.is_single())
                .then(|| self.whole.nearest_edge(part, p, scale))
                .flatten();
            let is_near = edge.is_some_and(|(q, _)| norm(sub(p, q)) <= depth);
            self.samples.push(p);
            self.parts.push(part);
            self.needs.push(if is_near { 0.0 } else { depth });
        }
        let mut open = vec![true; fresh.len()];
        let mut patches = std::mem::take(&mut self.patches);
        for (patch, covers) in &mut patches {
            let more = self.covers(patch, first);
            open.iter_mut().zip(&more).for_each(|(o, c)| *o &= !c);
            covers.extend(more);
        }
        self.patches = patches;
        self.open.extend(open);
        self.left_out.resize(self.samples.len(), false);
        self.far.resize(self.samples.len(), f64::INFINITY);
        if self.left_out.contains(&true) {
            self.leave_out();
        }
        self.update_far(&(0..self.samples.len()).collect::<Vec<_>>());
    }

    /// Which samples, from one on, lie on a patch, and as deep as they have to.
    fn covers(&self, made: &Parameterized, first: usize) -> Vec<bool> {
        let patch = &made.grown.patch;
        let mut covers = reached(patch, &self.samples[first..], self.tolerance);
        if let Some(margin) = self
            .covering
            .margin
            .filter(|_| made.distances.bound.is_some())
        {
            let border = Border::new(patch, margin);
            for (i, covers) in covers.iter_mut().enumerate() {
                let need = self.needs[first + i];
                *covers =
                    *covers && (need == 0.0 || border.distance(self.samples[first + i]) >= need);
            }
        }
        covers
    }

    /// Grows some patches side by side.
    fn grow_some(&mut self) {
        let count = ROUND.min(self.covering.most - self.patches.len());
        let seeds = next_seeds(&self.samples, &self.open, &self.far, count);
        let this = &*self;
        let made = side_by_side(seeds.len(), self.covering.threads, &|i| {
            let (part, sample) = (this.parts[seeds[i]], this.samples[seeds[i]]);
            let patch = single::at(
                this.whole,
                part,
                sample,
                &this.options,
                this.near_singular(),
            )?;
            let covers = this.covers(&patch, 0);
            Ok((patch, covers))
        });
        let mut done = seeds.clone();
        let was_avoided = self.avoided.is_some();
        for (seed, made) in seeds.iter().zip(made) {
            let keeps = |patch: &Parameterized| {
                patch.is_unfolded && patch.distances.bound.is_some_and(|b| b <= self.tolerance)
            };
            let is_hard = (made.as_ref()).map_or(true, |(p, _)| p.shortenings >= HARD || !keeps(p));
            if is_hard && !self.singular.is_empty() {
                self.avoided = Some(Avoided::new(&self.singular, self.apart));
            }
            // Its own sample is done with, even if rounding says that it is not quite reached.
            self.open[*seed] = false;
            self.far[*seed] = 0.0;
            match made {
                Ok((patch, covers)) if keeps(&patch) && covers.contains(&true) => {
                    for (i, c) in covers.iter().enumerate() {
                        if self.open[i] && *c {
                            self.open[i] = false;
                            done.push(i);
                        }
                    }
                    self.patches.push((patch, covers));
                }
                made => {
                    if let Err(error) = made {
                        self.last_error = error;
                    }
                    self.fail(*seed, was_avoided);
                }
            }
        }
        self.update_far(&done);
    }

    /// No patch was found at a sample: near a singular point all that is as near to one is left
    /// out; elsewhere it is tried again if singular points are to be avoided from now on.
    fn fail(&mut self, seed: usize, was_avoided: bool) {
        if self.is_near_singular(self.samples[seed]) {
            self.leave_out();
        } else if self.avoided.is_some() && !was_avoided {
            self.open[seed] = true;
        } else {
            self.failures += 1;
        }
    }

    /// What the next patches do near singular points.
    fn near_singular(&self) -> NearSingular<'_> {
        match &self.avoided {
            Some(avoided) => NearSingular::Avoid(avoided),
            None if self.singular.is_empty() => NearSingular::Cross,
            None => NearSingular::Try,
        }
    }

    fn is_near_singular(&self, p: Point3) -> bool {
        (self.singular.iter()).any(|s| distance_squared(*s, p) <= self.apart * self.apart)
    }

    /// Leaves out samples near singular points that lie on no patch.
    fn leave_out(&mut self) {
        for i in 0..self.samples.len() {
            let is_covered =
                !self.open[i] && self.patches.iter().any(|p| p.1.get(i) == Some(&true));
            if !is_covered && self.is_near_singular(self.samples[i]) {
                (self.open[i], self.left_out[i]) = (false, true);
            }
        }
    }

    /// The distances of open samples from those that no longer are, some of which are new.
    fn update_far(&mut self, done: &[usize]) {
        let done: Vec<Point3> = (done.iter().filter(|i| !self.open[**i]))
            .map(|i| self.samples[*i])
            .collect();
        if done.is_empty() {
            return;
        }
        let tree = KdTree::new(&done);
        for i in 0..self.samples.len() {
            if self.open[i] {
                let near = tree.nearest(self.samples[i]).map_or(f64::INFINITY, |n| n.1);
                self.far[i] = self.far[i].min(near);
            }
        }
    }

    /// Proves that all of the surface lies as deep; adds patches where that fails.
    fn prove_margin(&mut self, margin: f64, stop: &(dyn Fn() -> bool + Sync)) -> Depth {
        let mut proof = self.proof(margin, stop);
        for _ in 1..MOST_PROOFS {
            let before = self.patches.len();
            let scale = self.region.diagonal();
            let field = self.whole.field(0);
            let fresh: Vec<(Point3, usize)> = (proof.open.iter())
                .filter_map(|cell| project(field, cell.center(), scale))
                .filter(|p| contains(&self.region, *p))
                .map(|p| (p, 0))
                .collect();
            if fresh.is_empty() || stop() {
                break;
            }
            self.add(&fresh);
            self.cover_samples(1, stop);
            if self.patches.len() == before {
                break;
            }
            proof = self.proof(margin, stop);
        }
        Depth {
            margin,
            distance: proof.open.is_empty().then_some(proof.distance),
            open: proof.open,
        }
    }

    fn proof(&self, margin: f64, stop: &(dyn Fn() -> bool + Sync)) -> Proof {
        let sheets: Vec<Sheet<'_>> = (self.patches.iter())
            .filter_map(|(made, _)| Sheet::new(&made.grown.patch, made.distances.bound?, margin))
            .collect();
        let is_left_out = self.left_out.contains(&true);
        // Its corners are rounded on the way into the unit box.
        let more = CORNER * self.region.diagonal();
        let question = Question {
            field: self.whole.field(0),
            region: Aabb {
                lo: self.region.lo.map(|v| v - more),
                hi: self.region.hi.map(|v| v + more),
            },
            depth: margin,
            singular: if is_left_out { &self.singular } else { &[] },
            apart: self.apart,
        };
        prove(&question, &sheets, self.covering.threads, stop)
    }
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

/// Runs jobs on threads; results in their order.
pub(crate) fn side_by_side<T: Send>(
    jobs: usize,
    threads: usize,
    job: &(dyn Fn(usize) -> T + Sync),
) -> Vec<T> {
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
