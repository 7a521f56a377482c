//! Segmentation: the assignment of points to surfaces, by region growing first and then by joint
//! relaxation of labels and fits.

use crate::chart::{Primitive, PrimitiveDistances, PrimitiveKind};
use crate::choose::{KnownSurfaces, Noise, best_region, follows, is_called_for, least_points};
use crate::cloud::{Cloud, MAX_NEIGHBOURS};
use crate::cost::Cost;
use crate::entity::Relation;
use crate::fit::{Precision, fit, fit_weighted, squares};
use crate::grow::{MIN_NORMAL_AGREEMENT, SurfaceRegion, core};
use crate::kinds::best_kind;
use crate::labels::{ISOLATION_COST, UNLABELLED};
use crate::noise::NORMAL_MEDIAN;
use crate::share::{MembershipWeights, labels_by_side, shares};
use crate::split::{FailedSplits, split};
use isoform_control::{Control, Stopped};
use isoform_geom::{Point3, dot};
use rayon::prelude::*;

/// Maximum number of rounds of labels, fits, mergers and new regions.
const MAX_ROUNDS_OF_REGIONS: usize = 3;
/// Factor by which the noise may be larger than estimated once surfaces are known.
pub(crate) const NOISE_SLACK: f64 = 1.03;
/// Maximum factor by which the noise may exceed its first estimate.
pub(crate) const MAX_NOISE_GROWTH: f64 = 1.5;
/// Number of seeds that are tried at half the noise level, and inverse of the minimum share of the
/// points of a region that counts: small regions follow any noise.
const HALF_NOISE_TRIALS: (usize, usize) = (24, 30);
/// Minimum increase of the cost of its points without an entity, beyond the cost of its parameters,
/// for which the entity is kept, in nats.
pub(crate) const MIN_EVIDENCE: f64 = 20.0;

/// Entities found so far, and the label of each point: the index of its entity.
#[derive(Clone)]
pub(crate) struct Segmentation {
    pub(crate) surfaces: Vec<Primitive>,
    pub(crate) labels: Vec<u32>,
    pub(crate) noise: f64,
    /// Noise estimated before any surface was known.
    first_noise: f64,
    /// True if the noise is a tolerance of form.
    pub(crate) is_form: bool,
    /// True if surfaces are fitted independently, without the axes and directions of larger ones.
    pub(crate) is_free: bool,
    /// True if plane sections were searched.
    pub(crate) is_swept: bool,
    /// True if further rounds cannot find anything.
    pub(crate) is_finished: bool,
    /// Entities that could not be split.
    whole: FailedSplits,
    /// Labels of the entities, if these were given by hand; empty after a search.
    pub(crate) given: Vec<GivenEntity>,
    /// Relations of these that were given by hand, and hold.
    pub(crate) related: Vec<Relation>,
    /// Error that all points may share, in diagonals; 0 after a search.
    pub(crate) rounding: f64,
}

/// Entity whose points were given by hand.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GivenEntity {
    /// Label of the points.
    pub(crate) label: u32,
    /// True if the surface explains the points within the noise.
    pub(crate) is_explained: bool,
}

/// Tolerance of the distance of points from their surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum DistanceTolerance {
    /// The noise that the points themselves show.
    Shown,
    /// A length given by the user: a tolerance of form if the points show less noise.
    Given(f64),
    /// A tolerance of form.
    Form(f64),
}

/// Limits of a segmentation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Minimum number of points of an entity.
    pub(crate) min_points: usize,
    /// Tolerance of the distance of points from their surfaces.
    pub(crate) allowed: DistanceTolerance,
}

/// Finds the surfaces of a cloud.
pub(crate) fn segment(
    cloud: &Cloud,
    limits: Limits,
    control: &Control<'_>,
) -> Result<Segmentation, Stopped> {
    Segmentation::begin(cloud, limits, control)?.finished(cloud, limits, control)
}

/// Returns the distinct directions of planes and axes.
pub(crate) fn directions(surfaces: &[Primitive]) -> Vec<Point3> {
    let mut directions: Vec<Point3> = Vec::new();
    for surface in surfaces.iter().filter(|s| s.kind != PrimitiveKind::Sphere) {
        let is_known = |d: &Point3| dot(*d, surface.axis).abs() > 0.999;
        if !directions.iter().any(is_known) {
            directions.push(surface.axis);
        }
    }
    directions
}

/// Returns the window of this width that holds the most of sorted heights, if it holds three times
/// as many as its two neighbours.
fn fullest(heights: &[(f64, u32)], width: f64) -> Option<std::ops::Range<usize>> {
    let mut best = 0..0;
    let mut from = 0;
    for to in 0..heights.len() {
        while heights[to].0 - heights[from].0 > width {
            from += 1;
        }
        if to + 1 - from > best.len() {
            best = from..to + 1;
        }
    }
    let bounds = (heights.get(best.start)?.0, heights[best.end - 1].0);
    let beside = heights
        .iter()
        .filter(|h| h.0 >= bounds.0 - width && h.0 <= bounds.1 + width)
        .count()
        - best.len();
    (beside * 3 <= best.len()).then_some(best)
}

/// Returns the order in which points are tried as seeds: those far from edges first, then those at
/// smooth places.
fn seeds(cloud: &Cloud, noise: f64) -> Vec<u32> {
    let n = cloud.points.len();
    let mut depth = vec![u32::MAX; n];
    let rough = |i: &u32| cloud.roughness[*i as usize] > 1.6 * noise;
    let mut ring: Vec<u32> = (0..n as u32).filter(rough).collect();
    let mut at = 0;
    while !ring.is_empty() {
        ring.iter().for_each(|i| depth[*i as usize] = at);
        at += 1;
        let mut next: Vec<u32> = ring.iter().flat_map(|i| cloud.near(*i)).copied().collect();
        next.retain(|i| depth[*i as usize] == u32::MAX);
        next.sort_unstable();
        next.dedup();
        ring = next;
    }
    let mut order: Vec<u32> = (0..n as u32).collect();
    order.sort_by(|&i, &j| {
        let rough = |i: u32| cloud.roughness[i as usize];
        depth[j as usize]
            .cmp(&depth[i as usize])
            .then(rough(i).total_cmp(&rough(j)))
            .then(i.cmp(&j))
    });
    order
}

/// Returns the positions in an order of the next `count` seeds to be tried if all of them fail, and
/// the position after the last. Neighbours of a seed that fails are skipped.
fn next_seeds(
    cloud: &Cloud,
    order: &[u32],
    count: usize,
    is_tried: &mut [bool],
) -> (Vec<usize>, usize) {
    let (mut next, mut at) = (Vec::new(), 0);
    while at < order.len() && next.len() < count {
        let seed = order[at];
        if !std::mem::replace(&mut is_tried[seed as usize], true) {
            next.push(at);
            // Three neighbours of a seed that fails are not tried.
            let near = cloud.near(seed).iter().take(3);
            near.for_each(|j| is_tried[*j as usize] = true);
        }
        at += 1;
    }
    (next, at)
}

/// Returns half the noise, or a quarter, if surfaces follow points as well with it: neighbourhoods
/// that reach over thin walls make it look larger.
pub(crate) fn lower_noise(cloud: &Cloud, noise: f64) -> f64 {
    let order = seeds(cloud, noise);
    let step = (order.len() / HALF_NOISE_TRIALS.0).max(1);
    let succeeds = |noise: f64, seed: &u32| {
        let noise = Noise {
            deviation: noise,
            slack: NOISE_SLACK,
            is_form: false,
        };
        best_region(
            cloud,
            *seed,
            &PrimitiveKind::ALL[..3],
            noise,
            KnownSurfaces::default(),
            &|_| true,
        )
        .is_some_and(|r| r.points.len() * HALF_NOISE_TRIALS.1 >= cloud.points.len())
    };
    let mut noise = noise;
    for _ in 0..2 {
        if cloud.is_exact(noise) {
            break;
        }
        let tried: Vec<bool> = order
            .par_iter()
            .step_by(step)
            .map(|seed| succeeds(noise / 2.0, seed))
            .collect();
        if tried.iter().filter(|t| **t).count() * 2 < tried.len() {
            break;
        }
        noise /= 2.0;
    }
    noise
}

/// Returns the label of least cost among those of a point and its neighbours.
fn cheapest(
    cloud: &Cloud,
    labels: &[u32],
    distances: &[PrimitiveDistances<'_>],
    i: usize,
    cost: Cost,
) -> u32 {
    let near = cloud.near(i as u32);
    let share = ISOLATION_COST / near.len().max(1) as f64;
    let mut tried = [UNLABELLED; MAX_NEIGHBOURS + 2];
    let tried = &mut tried[..near.len() + 2];
    tried[0] = labels[i];
    for (to, j) in tried[1..].iter_mut().zip(near) {
        *to = labels[*j as usize];
    }
    tried.sort_unstable();
    let mut best = (f64::INFINITY, UNLABELLED);
    for (k, label) in tried.iter().enumerate() {
        if k > 0 && tried[k - 1] == *label {
            continue;
        }
        let apart = near
            .iter()
            .filter(|j| labels[**j as usize] != *label)
            .count();
        let own = match distances.get(*label as usize) {
            None => cost.most,
            Some(of) => cost.if_near(of.at(cloud.points[i])),
        };
        let cost = share * apart as f64 + own;
        if cost < best.0 {
            best = (cost, *label);
        }
    }
    best.1
}

impl Segmentation {
    /// Runs the first round, which finds most surfaces if they follow the points.
    pub(crate) fn begin(
        cloud: &Cloud,
        limits: Limits,
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        let (noise, is_form) = match limits.allowed {
            _ if cloud.is_volume => (cloud.noise, false),
            DistanceTolerance::Shown => (lower_noise(cloud, cloud.noise), false),
            DistanceTolerance::Given(noise) => {
                (noise, noise > 1.5 * lower_noise(cloud, cloud.noise))
            }
            DistanceTolerance::Form(noise) => (noise, true),
        };
        let now = Self::first_round(cloud, limits, (noise, is_form), control)?;
        // Surfaces found with less noise may show that it was too little.
        let is_more = limits.allowed == DistanceTolerance::Shown && now.noise > 1.4 * noise;
        if is_more && noise < cloud.noise {
            return Self::first_round(cloud, limits, (cloud.noise, false), control);
        }
        Ok(now)
    }

    /// Builds a segmentation of given surfaces, labels of all points, and noise.
    pub(crate) fn new(
        surfaces: Vec<Primitive>,
        labels: Vec<u32>,
        noise: f64,
        is_form: bool,
    ) -> Self {
        Self {
            surfaces,
            whole: FailedSplits::new(labels.len()),
            labels,
            noise,
            first_noise: noise,
            is_form,
            is_free: true,
            is_swept: false,
            is_finished: false,
            given: Vec::new(),
            related: Vec::new(),
            rounding: 0.0,
        }
    }

    /// Returns true if an entity explains its points within the noise, as all do after a search.
    pub(crate) fn is_explained(&self, label: usize) -> bool {
        self.given.get(label).is_none_or(|given| given.is_explained)
    }

    fn first_round(
        cloud: &Cloud,
        limits: Limits,
        (noise, is_form): (f64, bool),
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        let mut now = Self::new(
            Vec::new(),
            vec![UNLABELLED; cloud.points.len()],
            noise,
            is_form,
        );
        if !cloud.is_volume {
            now.advance(cloud, limits, 0, control)?;
        }
        Ok(now)
    }

    /// Runs the remaining rounds.
    pub(crate) fn finished(
        mut self,
        cloud: &Cloud,
        limits: Limits,
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        if cloud.is_volume {
            return Ok(self);
        }
        self.sweep(cloud, limits, control)?;
        for round in 1..MAX_ROUNDS_OF_REGIONS {
            if self.is_finished {
                break;
            }
            self.advance(cloud, limits, round, control)?;
        }
        self.uncover(cloud, limits, control)?;
        self.simplify(cloud, limits, control)?;
        self.turn_into_coaxial(cloud, limits);
        self.turn_zones(cloud);
        self.is_free = true;
        self.relax(cloud, limits);
        if !cloud.is_exact(self.noise) {
            for _ in 0..2 {
                self.labels = labels_by_side(cloud, &self.surfaces, &self.labels, self.noise);
            }
        }
        self.complete(cloud, limits, control)?;
        Ok(self)
    }

    /// Runs one round: new regions, then labels, fits and mergers until nothing changes.
    fn advance(
        &mut self,
        cloud: &Cloud,
        limits: Limits,
        round: usize,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        control.report("recognize", round as f64 / MAX_ROUNDS_OF_REGIONS as f64);
        // Before any surface is known the noise is known less well.
        let slack = if round == 0 { 1.1 } else { NOISE_SLACK };
        self.add_regions(cloud, slack, limits, control)?;
        self.settle(cloud, limits);
        if round == 0 && self.add_scattered_planes(cloud, limits) {
            self.settle(cloud, limits);
        }
        // Sections are searched before: an entity that does not follow its points may be replaced
        // by what they show.
        if round > 0 || self.is_form {
            self.is_finished = !self.dissolve(cloud);
        }
        Ok(())
    }

    /// Returns the noise of points about their surfaces.
    pub(crate) fn deviation(&self, slack: f64) -> Noise {
        Noise {
            deviation: self.noise,
            slack,
            is_form: self.is_form,
        }
    }

    /// Adds planes in the known directions through points without an entity that lie in many small
    /// pieces, such as the floors of counterbores. Returns true if any was added.
    fn add_scattered_planes(&mut self, cloud: &Cloud, limits: Limits) -> bool {
        let open: Vec<u32> = (0..self.labels.len() as u32)
            .filter(|i| self.labels[*i as usize] == UNLABELLED)
            .collect();
        let mut is_new = false;
        for axis in directions(&self.surfaces) {
            // Rows of a regular sample on other faces may also have one height.
            let is_open = |i: &&u32| {
                let i = **i as usize;
                self.labels[i] == UNLABELLED
                    && dot(cloud.normals[i], axis).abs() >= MIN_NORMAL_AGREEMENT
            };
            let mut heights: Vec<(f64, u32)> = open
                .iter()
                .filter(is_open)
                .map(|i| (dot(cloud.points[*i as usize], axis), *i))
                .collect();
            heights.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            while let Some(layer) = fullest(&heights, 4.0 * self.noise) {
                let of: Vec<u32> = heights[layer.clone()].iter().map(|h| h.1).collect();
                if of.len() < least_points(PrimitiveKind::Plane, self.noise).max(limits.min_points)
                {
                    break;
                }
                self.add(&SurfaceRegion {
                    surface: crate::start::plane(&cloud.at(&of)),
                    core: of.clone(),
                    points: of,
                });
                heights.drain(layer);
                is_new = true;
            }
        }
        is_new
    }

    /// Grows regions from points without a label.
    pub(crate) fn add_regions(
        &mut self,
        cloud: &Cloud,
        slack: f64,
        limits: Limits,
        control: &Control<'_>,
    ) -> Result<(), Stopped> {
        let noise = self.deviation(slack);
        let order = seeds(cloud, self.noise);
        let mut is_tried: Vec<bool> = self.labels.iter().map(|l| *l != UNLABELLED).collect();
        let most = 2 * rayon::current_num_threads();
        // Several seeds are tried at a time as long as they fail. Those after one that succeeds are
        // tried again, since its points are taken now.
        let (mut at, mut width) = (0, 1);
        while at < order.len() {
            control.check()?;
            let before = is_tried.clone();
            let (tried, next) = next_seeds(cloud, &order[at..], width, &mut is_tried);
            let known = KnownSurfaces {
                surfaces: &self.surfaces,
                labels: &self.labels,
            };
            let is_free = |i: u32| known.labels[i as usize] == UNLABELLED;
            let regions: Vec<Option<SurfaceRegion>> = (tried.par_iter())
                .map(|k| {
                    best_region(
                        cloud,
                        order[at + k],
                        PrimitiveKind::ALL,
                        noise,
                        known,
                        &is_free,
                    )
                })
                .map(|region| region.filter(|r| r.points.len() >= limits.min_points))
                .collect();
            match regions.iter().position(Option::is_some) {
                None => (at, width) = (at + next, most.min(2 * width)),
                Some(first) => {
                    is_tried = before;
                    next_seeds(cloud, &order[at..], first, &mut is_tried);
                    for region in regions.into_iter().flatten().take(1) {
                        region
                            .points
                            .iter()
                            .for_each(|i| is_tried[*i as usize] = true);
                        self.add(&region);
                    }
                    (at, width) = (at + tried[first] + 1, 1);
                    is_tried[order[at - 1] as usize] = true;
                }
            }
        }
        Ok(())
    }

    fn add(&mut self, region: &SurfaceRegion) {
        let label = self.surfaces.len() as u32;
        self.surfaces.push(region.surface);
        for i in &region.points {
            self.labels[*i as usize] = label;
        }
    }

    /// Removes entities that do not follow their points. Returns true if there were any.
    pub(crate) fn dissolve(&mut self, cloud: &Cloud) -> bool {
        let noise = self.deviation(NOISE_SLACK);
        let members = self.members();
        let kept: Vec<Option<Primitive>> = members
            .par_iter()
            .zip(&self.surfaces)
            .map(|(points, surface)| {
                let core = core(cloud, points, surface.kind);
                follows(cloud, [&core, points], surface, noise).then_some(*surface)
            })
            .collect();
        for label in self.labels.iter_mut().filter(|l| **l != UNLABELLED) {
            if kept[*label as usize].is_none() {
                *label = UNLABELLED;
            }
        }
        self.keep(&kept);
        kept.iter().any(Option::is_none)
    }

    /// Returns the points of each entity.
    pub(crate) fn members(&self) -> Vec<Vec<u32>> {
        let mut members = vec![Vec::new(); self.surfaces.len()];
        for (i, label) in self.labels.iter().enumerate() {
            if *label != UNLABELLED {
                members[*label as usize].push(i as u32);
            }
        }
        members
    }

    /// Returns the entities of neighbours that have different ones, once for each such pair of
    /// points.
    pub(crate) fn neighbours<'a>(
        &'a self,
        cloud: &'a Cloud,
    ) -> impl Iterator<Item = (usize, usize)> + 'a {
        let of = |i: u32| self.labels[i as usize];
        let pairs = cloud.pairs().map(move |(i, j)| (of(i), of(j)));
        pairs
            .filter(|(a, b)| a != b && *a != UNLABELLED && *b != UNLABELLED)
            .map(|(a, b)| (a as usize, b as usize))
    }

    /// Alternates between labels, surfaces, noise, mergers and removals until nothing changes.
    pub(crate) fn settle(&mut self, cloud: &Cloud, limits: Limits) {
        for _ in 0..4 {
            self.relax(cloud, limits);
            let merged = self.merge(cloud);
            let removed = self.prune(cloud, limits);
            let changed = self.change_kinds(cloud) | self.split(cloud, limits);
            if !(merged || removed || changed) {
                break;
            }
        }
        self.relax(cloud, limits);
    }

    /// Alternates between labels, surfaces and noise until labels hardly change.
    pub(crate) fn relax(&mut self, cloud: &Cloud, limits: Limits) {
        // Labels along tangent faces move slowly.
        for _ in 0..10 {
            let before = self.labels.clone();
            self.compete(cloud);
            self.refit(cloud, limits);
            self.measure_noise(cloud, limits);
            let changed = before.iter().zip(&self.labels).filter(|(a, b)| a != b);
            if changed.count() * 1000 < before.len() {
                break;
            }
        }
    }

    /// Assigns each point to the surface of a neighbour that explains it best.
    fn compete(&mut self, cloud: &Cloud) {
        let cost = Cost::with_noise(self.noise);
        let distances: Vec<PrimitiveDistances<'_>> =
            self.surfaces.iter().map(Primitive::distances).collect();
        // A point is visited again when the label of a neighbour has changed.
        let mut is_due = vec![true; cloud.points.len()];
        for _ in 0..8 {
            let mut is_changed = false;
            for i in 0..cloud.points.len() {
                if !std::mem::take(&mut is_due[i]) {
                    continue;
                }
                let best = cheapest(cloud, &self.labels, &distances, i, cost);
                if best != self.labels[i] {
                    self.labels[i] = best;
                    is_changed = true;
                    let beside = cloud.adjacent(i as u32).iter();
                    beside.for_each(|j| is_due[*j as usize] = true);
                }
            }
            if !is_changed {
                break;
            }
        }
    }

    /// Fits each surface to its points, and drops those with too few.
    fn refit(&mut self, cloud: &Cloud, limits: Limits) {
        let mut counts = vec![0; self.surfaces.len()];
        let known = self.labels.iter().filter(|l| **l != UNLABELLED);
        known.for_each(|l| counts[*l as usize] += 1);
        let shares = shares(cloud, &self.surfaces, &self.labels, self.noise);
        let fitted: Vec<Option<Primitive>> = shares
            .par_iter()
            .zip(&self.surfaces)
            .zip(&counts)
            .map(|((shares, surface), count)| {
                if *count < least_points(surface.kind, self.noise).max(limits.min_points) {
                    return None;
                }
                let (of, weights): (Vec<u32>, Vec<f64>) = shares.iter().copied().unzip();
                let fitted = fit_weighted(surface, &cloud.at(&of), Some(&weights), Precision::Full);
                (fitted.map(|f| f.0)).filter(|s| s.is_wider_than(self.noise))
            })
            .collect();
        let tied = self.tied(cloud, fitted, &shares);
        self.keep(&tied);
    }

    /// Replaces the surfaces by these; those that are `None` are dropped and their labels cleared.
    pub(crate) fn keep(&mut self, surfaces: &[Option<Primitive>]) {
        let mut new = vec![UNLABELLED; surfaces.len()];
        self.surfaces.clear();
        for (old, surface) in surfaces.iter().enumerate() {
            if let Some(surface) = surface {
                new[old] = self.surfaces.len() as u32;
                self.surfaces.push(*surface);
            }
        }
        for label in self.labels.iter_mut().filter(|l| **l != UNLABELLED) {
            *label = new[*label as usize];
        }
    }

    /// Drops surfaces without points.
    pub(crate) fn drop_empty(&mut self) {
        let kept: Vec<Option<Primitive>> = (self.members().iter())
            .zip(&self.surfaces)
            .map(|(of, surface)| (!of.is_empty()).then_some(*surface))
            .collect();
        self.keep(&kept);
    }

    /// Estimates the noise from the median distance of explained points. Of exact points it is that
    /// of the entity with the most: planes along the axes of coordinates have none, and surfaces
    /// that a modeller approximates have more than rounding.
    fn measure_noise(&mut self, cloud: &Cloud, limits: Limits) {
        if limits.allowed != DistanceTolerance::Shown {
            return;
        }
        if cloud.is_exact(self.first_noise) {
            let members = self.members();
            let deviation = |(surface, of): (&Primitive, &Vec<u32>)| {
                let free = of.len().saturating_sub(surface.kind.parameters()).max(1);
                (squares(surface, &cloud.at(of)) / free as f64).sqrt()
            };
            let each = self.surfaces.iter().zip(&members).map(deviation);
            self.noise = each.fold(cloud.floor, f64::max).min(cloud.exact());
            return;
        }
        let explained = (0..cloud.points.len()).filter(|i| self.labels[*i] != UNLABELLED);
        let distance = |i: usize| {
            let surface = &self.surfaces[self.labels[i] as usize];
            surface.distance(cloud.points[i]).abs()
        };
        let mut distances: Vec<f64> = explained.map(distance).collect();
        if distances.is_empty() {
            return;
        }
        let half = distances.len() / 2;
        let median = *distances.select_nth_unstable_by(half, f64::total_cmp).1;
        self.noise = (median / NORMAL_MEDIAN)
            .min(MAX_NOISE_GROWTH * self.first_noise)
            .max(cloud.floor);
    }

    /// Merges entities of one kind that one surface explains. Returns true if any were merged.
    fn merge(&mut self, cloud: &Cloud) -> bool {
        let mut members = self.members();
        let mut surfaces: Vec<Option<Primitive>> =
            self.surfaces.iter().copied().map(Some).collect();
        let mut order: Vec<usize> = (0..surfaces.len()).collect();
        order.sort_by_key(|i| (std::cmp::Reverse(members[*i].len()), *i));
        let mut changed = false;
        for (k, &a) in order.iter().enumerate() {
            for &b in &order[k + 1..] {
                let (Some(first), Some(second)) = (surfaces[a], surfaces[b]) else {
                    continue;
                };
                if let Some(one) = self.joined(cloud, [&first, &second], [&members[a], &members[b]])
                {
                    surfaces[a] = Some(one);
                    surfaces[b] = None;
                    let moved = std::mem::take(&mut members[b]);
                    moved
                        .iter()
                        .for_each(|i| self.labels[*i as usize] = a as u32);
                    members[a].extend(moved);
                    changed = true;
                }
            }
        }
        self.keep(&surfaces);
        changed
    }

    /// Returns the common surface of two entities; `None` if they are not pieces of one.
    fn joined(&self, cloud: &Cloud, two: [&Primitive; 2], of: [&[u32]; 2]) -> Option<Primitive> {
        let [large, small] = two;
        if large.kind < small.kind {
            return None;
        }
        let (first, second) = (cloud.at(of[0]), cloud.at(of[1]));
        // Points of the smaller one far from the other need no fit.
        let apart = (squares(large, &second) / second.len() as f64).sqrt();
        if apart > 30.0 * self.noise.max(1e-6) {
            return None;
        }
        let both: Vec<_> = first.iter().chain(&second).copied().collect();
        let alone = squares(large, &first) + squares(small, &second);
        let [p, q] = [
            small.kind.parameters(),
            large.kind.parameters() + small.kind.parameters(),
        ];
        let are_two = |joint: f64| {
            let count = both.len().min(4 * second.len());
            is_called_for(p, count, joint, alone, q, self.deviation(NOISE_SLACK))
        };
        // A fit of a sample already separates most pairs: it leaves a residual far larger than a
        // joint surface may leave.
        // Σ r² of 800 points is known to 5 %.
        let step = (both.len() / 800).max(1);
        if step > 1 {
            let some = |points: &[Point3]| -> Vec<Point3> {
                points.iter().step_by(step).copied().collect()
            };
            let (some_first, some_second) = (some(&first), some(&second));
            let each = squares(large, &some_first) + squares(small, &some_second);
            let some: Vec<_> = some_first.into_iter().chain(some_second).collect();
            let (_, joint) = fit(large, &some, Precision::Full)?;
            if are_two(alone + (joint - each) * step as f64 / 2.0) {
                return None;
            }
        }
        let (one, joint) = fit(large, &both, Precision::Full)?;
        (!are_two(joint)).then_some(one)
    }

    /// Removes entities whose points others explain nearly as well. Returns true if any were
    /// removed.
    fn prune(&mut self, cloud: &Cloud, limits: Limits) -> bool {
        let members = self.members();
        let mut order: Vec<usize> = (0..members.len()).collect();
        order.sort_by_key(|i| (members[*i].len(), *i));
        let mut surfaces: Vec<Option<Primitive>> =
            self.surfaces.iter().copied().map(Some).collect();
        for label in order {
            let gain = self.gain(cloud, label as u32, &members[label]);
            let p = self.surfaces[label].kind.parameters() as f64;
            let n = members[label].len().max(1) as f64;
            if gain < p * n.ln() / 2.0 + MIN_EVIDENCE || members[label].len() < limits.min_points {
                surfaces[label] = None;
                // Points go to the neighbours' surfaces when labels compete next.
                members[label]
                    .iter()
                    .for_each(|i| self.labels[*i as usize] = UNLABELLED);
            }
        }
        let removed = surfaces.iter().any(Option::is_none);
        self.keep(&surfaces);
        removed
    }

    /// Returns the increase of the cost of its points without an entity, with the surfaces of
    /// entities nearby.
    fn gain(&self, cloud: &Cloud, label: u32, members: &[u32]) -> f64 {
        let cost = Cost::with_noise(self.noise);
        let mut around: Vec<u32> = members
            .iter()
            .flat_map(|i| cloud.near(*i))
            .map(|j| self.labels[*j as usize])
            .filter(|l| *l != label && *l != UNLABELLED)
            .collect();
        around.sort_unstable();
        around.dedup();
        let at = |i: u32, label: u32| {
            cost.of_point(self.surfaces[label as usize].distance(cloud.points[i as usize]))
        };
        let without = |i: u32| around.iter().fold(cost.most, |c, l| c.min(at(i, *l)));
        members.iter().map(|i| without(*i) - at(*i, label)).sum()
    }

    /// Changes the kind of entities whose points justify another one. Returns true if any changed.
    fn change_kinds(&mut self, cloud: &Cloud) -> bool {
        let noise = self.deviation(NOISE_SLACK);
        let shares = shares(cloud, &self.surfaces, &self.labels, self.noise);
        let change = |of: &MembershipWeights, surface: &Primitive| {
            let new = best_kind(cloud, of, surface, noise);
            let is_less = new.kind < surface.kind;
            match is_less && !self.simpler_kinds(surface).contains(&new.kind) {
                true => *surface,
                false => new,
            }
        };
        let new: Vec<Primitive> = (shares.par_iter().zip(&self.surfaces))
            .map(|(of, surface)| change(of, surface))
            .collect();
        let changed = new
            .iter()
            .zip(&self.surfaces)
            .any(|(a, b)| a.kind != b.kind);
        self.surfaces = new;
        changed
    }

    /// Returns the points of an entity.
    pub(crate) fn members_of(&self, label: usize) -> Vec<u32> {
        let all = 0..self.labels.len() as u32;
        all.filter(|i| self.labels[*i as usize] == label as u32)
            .collect()
    }

    /// Splits entities whose points simpler ones explain better. Returns true if any were split.
    fn split(&mut self, cloud: &Cloud, limits: Limits) -> bool {
        let members = self.members();
        let noise = self.deviation(NOISE_SLACK);
        let tried: Vec<Option<Option<Vec<SurfaceRegion>>>> = members
            .par_iter()
            .zip(&self.surfaces)
            .map(|(of, surface)| {
                let is_due = !self.whole.holds(surface.kind, of, self.noise);
                is_due.then(|| split(cloud, of, surface, &self.simpler_kinds(surface), noise))
            })
            .collect();
        for ((of, surface), parts) in members.iter().zip(&self.surfaces).zip(&tried) {
            if matches!(parts, Some(None)) {
                self.whole.add(surface.kind, of, self.noise);
            }
        }
        let parts = tried.into_iter().map(Option::flatten);
        let is_large = |r: &SurfaceRegion| r.points.len() >= limits.min_points;
        let mut changed = false;
        for (label, parts) in parts.enumerate() {
            let Some(parts) = parts.filter(|p| p.iter().all(is_large)) else {
                continue;
            };
            changed = true;
            for (k, part) in parts.iter().enumerate() {
                let new = if k == 0 { label } else { self.surfaces.len() };
                if k == 0 {
                    self.surfaces[label] = part.surface;
                } else {
                    self.surfaces.push(part.surface);
                }
                part.points
                    .iter()
                    .for_each(|i| self.labels[*i as usize] = new as u32);
            }
        }
        changed
    }
}
