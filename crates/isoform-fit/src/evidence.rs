//! What a verdict rests on, in numbers.

use crate::deviation::Surface;
use crate::fit::{EXACT, Task};
use crate::judge::Finding;
use crate::polish::Polish;
use crate::report::PartStatistics;
use crate::scan::MANY_STRAYS;
use isoform_geom::{DistanceField, Foot, KdTree, Point3, dot, sub};

/// Points whose neighbours are asked whether they are off alike.
const PROBES: usize = 3000;
/// Points among which neighbours are looked for.
const DENSEST: usize = 20_000;
/// Neighbours of each: few, so that misfit of small extent shows.
const NEIGHBOURS: usize = 4;
/// Outliers whose eighth neighbour is no farther than this many typical mean distances to eight
/// neighbours lie on a surface.
const DENSE: f64 = 2.2;
/// Places whose thickness is measured.
const THICKNESSES: usize = 200;
/// Balls tried at a place, each smaller than the one before: two or three are enough where the
/// other side is flat.
const SHRINKS: usize = 12;
/// Radius of the smallest ball that is tried, as a share of the data's diagonal.
const SMALLEST: f64 = 1e-4;
/// Radius of the largest: no wall of half the size is thin.
const LARGEST: f64 = 0.25;
/// A ball within the solid touches the surface elsewhere when its centre is nearer to it than this
/// share of its radius.
const TOUCHES: f64 = 0.98;
/// Places on a part that tell its thickness, at least.
const FEWEST: usize = 12;

/// A piece is off its points where their root mean square exceeds that of the noise by this factor.
/// Right models of clean parts show up to 1.2, holes of another size or place 1.7 to 3; real
/// objects as much as those, but not on clean parts.
const OFF_RMS: f64 = 1.5;
/// ... and that is beyond chance by this many deviations.
const OFF_SURE: f64 = 5.0;
/// A point is far off the model from this many robust deviations on: one of 16,000 by noise alone.
pub(crate) const FAR: f64 = 4.0;
/// Neighbours to its side that are as far make it one of a group...
const ALIKE: usize = 2;
/// ... and this many such points a feature: chance makes none, and dust has fewer.
const LEAST_TOGETHER: usize = 9;
/// Deviations by which one side must outnumber the other, were they equally likely.
const ONE_SIDED: f64 = 3.0;
/// Samples that each bare one is compared with.
const COMPARED: usize = 400;
/// Cosine of the angle within which normals face the same way: 37 degrees, so that a view that sees
/// one sees the other.
const SAME_WAY: f64 = 0.8;

/// Numbers that a verdict rests on; lengths in the units of the scan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evidence {
    /// Diagonal of the data's box.
    pub size: f64,
    /// Root of the mean square distance of all points, outliers included.
    pub rms_of_all: f64,
    /// The same of what neighbouring points share, outliers left out: misfit of shape rather than
    /// noise.
    pub systematic: f64,
    /// The systematic part in deviations of what independent residuals show.
    pub systematic_z: f64,
    /// Deviation of points from planes through their neighbours: noise, and curvature at this
    /// density.
    pub local_noise: f64,
    /// Thickness of the model's thinnest wall.
    pub thickness: f64,
    /// The smallest of its walls and gaps.
    pub detail: f64,
    /// Share of the model's surface without data, parts that the fit leaves open not counted.
    pub bare: f64,
    /// Share of the model's surface, open parts and all, without data although most of what faces
    /// the same way has them.
    pub overlooked: f64,
    /// Share of the outliers that lie on a surface of their own.
    pub clustered: f64,
}

/// Outliers that lie on surfaces of their own.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Clusters {
    /// Share of the outliers.
    pub(crate) share: f64,
    /// Their mean square over all points.
    pub(crate) misfit: f64,
}

impl Task<'_> {
    /// Looks at a fit: residuals of all points, and the surface of the model. Clusters are told by
    /// [`Task::clusters`].
    pub(crate) fn evidence(
        &self,
        a: &[f64],
        residuals: &[f64],
        at: &[Point3],
        outliers: &[bool],
        surface: &Surface,
        open_parts: &[bool],
    ) -> Evidence {
        let far = self.data.diagonal();
        let off: Vec<f64> = residuals
            .iter()
            .map(|r| if r.is_finite() { *r } else { far })
            .collect();
        let n = off.len().max(1) as f64;
        let square = off.iter().map(|r| r * r).sum::<f64>() / n;
        let used: Vec<f64> = off
            .iter()
            .zip(outliers)
            .map(|(r, out)| if *out { 0.0 } else { *r })
            .collect();
        let (shared, z) = self.shared(&used, at);
        let kept = surface
            .parts
            .iter()
            .map(|p| open_parts.get(*p as usize) != Some(&true));
        let bare = surface
            .bare
            .iter()
            .zip(kept.clone())
            .filter(|(bare, kept)| **bare && *kept)
            .count();
        let kept = kept.filter(|k| *k).count().max(1);
        let none = (f64::INFINITY, f64::INFINITY);
        let (thickness, gap) = self
            .template
            .distance()
            .map_or(none, |d| self.thicknesses(d, a, surface));
        Evidence {
            size: self.data.diagonal(),
            rms_of_all: square.sqrt(),
            systematic: shared.max(0.0).sqrt(),
            systematic_z: z,
            local_noise: self.scan.local_noise,
            thickness,
            detail: thickness.min(gap),
            bare: bare as f64 / kept as f64,
            overlooked: overlooked(surface),
            clustered: 0.0,
        }
    }

    /// Mean product of the residuals of neighbours, and the same in deviations of what it is for
    /// independent ones.
    fn shared(&self, r: &[f64], at: &[Point3]) -> (f64, f64) {
        let chosen: Vec<usize> = self
            .order
            .iter()
            .map(|&i| i as usize)
            .take(DENSEST)
            .collect();
        let places: Vec<Point3> = chosen.iter().map(|&i| at[i]).collect();
        let tree = KdTree::new(&places);
        let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
        let mut found = Vec::new();
        for (k, &i) in chosen.iter().enumerate().take(PROBES) {
            tree.nearest_k(places[k], NEIGHBOURS + 1, &mut found);
            for j in found.iter().map(|f| f.1 as usize).filter(|j| *j != k) {
                sum += r[i] * r[chosen[j]];
                count += 1.0;
            }
            squares += r[i] * r[i];
        }
        let mean = sum / f64::max(count, 1.0);
        let variance = squares / self.order.len().clamp(1, PROBES) as f64;
        // Neighbours are mostly mutual: pairs count half.
        let z = mean / (variance / (0.5 * count).max(1.0).sqrt()).max(f64::MIN_POSITIVE);
        (mean, z)
    }

    /// The piece that is farthest off its points, in deviations of the noise, where all but such
    /// pieces show nothing but noise: a hole of another size, or at another place. `statistics` is
    /// by piece, `parts` the piece of each point.
    pub(crate) fn misplaced(
        &self,
        residuals: &[f64],
        outliers: &[bool],
        at: &[Point3],
        parts: &[u32],
        statistics: &[PartStatistics],
        noise: f64,
    ) -> Option<Finding> {
        if noise <= EXACT * self.data.diagonal() {
            return None;
        }
        let off = |s: &PartStatistics| -> Option<f64> {
            // The mean tells less: narrow pieces get the points that noise has moved to them.
            let (n, rms) = (s.count as f64, s.rms / noise);
            let is_sure = (rms - 1.0) * (2.0 * n).sqrt() > OFF_SURE;
            (rms > OFF_RMS && is_sure).then_some(rms)
        };
        let offs: Vec<Option<f64>> = statistics.iter().map(off).collect();
        let farthest = offs
            .iter()
            .zip(statistics)
            .filter_map(|(o, s)| Some(((*o)?, s)));
        let (ratio, worst) = farthest.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let rest: Vec<f64> = (residuals.iter().zip(outliers).zip(parts))
            .map(|((r, out), part)| {
                let is_off = offs.get(*part as usize).is_some_and(Option::is_some);
                if *out || is_off || !r.is_finite() {
                    0.0
                } else {
                    *r
                }
            })
            .collect();
        let is_noise = self.shared(&rest, at).1 < OFF_SURE;
        is_noise.then(|| Finding::Misplaced {
            piece: worst.name.clone(),
            ratio,
        })
    }

    /// Points far off the model to one side that lie together, where all others show nothing but
    /// noise: a feature that the template lacks, or has where there is none.
    pub(crate) fn together(&self, residuals: &[f64], at: &[Point3]) -> Option<Finding> {
        let noise = Polish::scale(residuals);
        let limit = FAR * noise;
        let is_far = |i: usize| residuals[i].abs() > limit || !residuals[i].is_finite();
        let far: Vec<usize> = (0..residuals.len()).filter(|i| is_far(*i)).collect();
        let is_exact = noise <= EXACT * self.data.diagonal();
        if is_exact || far.len() < LEAST_TOGETHER || self.scan.isolated > MANY_STRAYS {
            return None;
        }
        let tree = KdTree::new(&far.iter().map(|i| self.points[*i]).collect::<Vec<_>>());
        let reach = (DENSE * self.near.spacing).powi(2);
        let (mut inside, mut outside) = (0_usize, 0_usize);
        let mut rest = residuals.to_vec();
        let mut found = Vec::new();
        for &i in &far {
            rest[i] = 0.0;
            // Its four nearest neighbours of all points, two of which at least are far.
            self.near
                .tree
                .nearest_k(self.points[i], NEIGHBOURS + 1, &mut found);
            let most = found.last().map_or(0.0, |f| f.0).min(reach);
            let mut alike = 0;
            tree.near(self.points[i], most, &mut |_, j| {
                let j = far[j as usize];
                alike += usize::from(j != i && residuals[i] * residuals[j] > 0.0);
                most
            });
            if alike >= ALIKE {
                let side = if residuals[i] > 0.0 {
                    &mut inside
                } else {
                    &mut outside
                };
                *side += 1;
            }
        }
        let count = inside + outside;
        // Noise that is larger in places goes to both sides.
        let is_one_sided = inside.abs_diff(outside) as f64 > ONE_SIDED * (count as f64).sqrt();
        let is_found = count >= LEAST_TOGETHER && is_one_sided;
        (is_found && self.shared(&rest, at).1 < OFF_SURE).then_some(Finding::Together { count })
    }

    /// Looks for outliers that lie as densely as the surface does, among others alike: a shape that
    /// the template lacks, no stray points.
    pub(crate) fn clusters(&self, residuals: &[f64], outliers: &[bool]) -> Clusters {
        // A tree over a part of the points holds the first ones in the order.
        let (tree, order) = (&self.near.tree, self.order);
        let is_whole = tree.len() == outliers.len();
        let place = |j: u32| if is_whole { j } else { order[j as usize] };
        let mut found = Vec::new();
        let (mut all, mut alike, mut squares) = (0.0_f64, 0.0, 0.0);
        let seen = &order[..tree.len()];
        let outlying = seen.iter().filter(|i| outliers[**i as usize]);
        for &i in outlying.clone().take(PROBES / 4) {
            tree.nearest_k(self.points[i as usize], 2 * NEIGHBOURS + 1, &mut found);
            let around = found.iter().map(|f| place(f.1)).filter(|j| *j != i);
            let others = around.filter(|j| outliers[*j as usize]).count();
            // Stray points are farther from each other than points of a surface.
            let spacing = found.last().map_or(f64::INFINITY, |f| f.0.sqrt());
            all += 1.0;
            if others > NEIGHBOURS && spacing < DENSE * self.near.spacing {
                let r = residuals[i as usize];
                alike += 1.0;
                squares += if r.is_finite() { r * r } else { 0.0 };
            }
        }
        let each = outlying.count() as f64 / f64::max(all, 1.0);
        Clusters {
            share: alike / all.max(1.0),
            misfit: squares * each / seen.len().max(1) as f64,
        }
    }

    /// Thickness of the thinnest wall and width of the narrowest gap: twice the radius of the
    /// largest ball, inside and outside, that touches the surface at a place; the upper quartile of
    /// a part, since edges are thin on any solid; the least of all parts that are large enough to
    /// tell.
    fn thicknesses(
        &self,
        distance: &dyn DistanceField,
        a: &[f64],
        surface: &Surface,
    ) -> (f64, f64) {
        let step = surface.points.len().div_ceil(THICKNESSES).max(1);
        let some: Vec<Point3> = surface.points.iter().copied().step_by(step).collect();
        // The bias was taken away after the surface was sampled: a ball from beside the surface
        // would find that very place.
        let mut feet = vec![Foot::NONE; some.len()];
        distance.feet(&some, a, &mut feet);
        feet.retain(|foot| foot.order == 1);
        let at: Vec<Point3> = feet.iter().map(|foot| foot.at).collect();
        let parts: Vec<u32> = feet.iter().map(|foot| foot.pieces[0]).collect();
        if at.is_empty() {
            return (f64::INFINITY, f64::INFINITY);
        }
        let inward: Vec<Point3> = feet.iter().map(|foot| foot.inward).collect();
        let sides = [1.0, -1.0].map(|side| self.balls(distance, a, &at, &inward, side));
        let least = |diameters: &[f64]| {
            let mut least = f64::INFINITY;
            for part in 0..self.template.part_names().len() as u32 {
                let own = diameters.iter().zip(&parts).filter(|(_, p)| **p == part);
                let mut own: Vec<f64> = own.map(|(d, _)| *d).collect();
                own.sort_unstable_by(f64::total_cmp);
                let typical = own.get(3 * own.len() / 4).copied().unwrap_or(0.0);
                // Not even the smallest ball fits where pieces touch without an edge.
                if own.len() >= FEWEST && typical > 4.0 * SMALLEST * self.data.diagonal() {
                    least = least.min(typical);
                }
            }
            least
        };
        (least(&sides[0]), least(&sides[1]))
    }

    /// Diameters of the largest balls on one side of the surface that touch it at some places: a
    /// ball that holds another place of the surface is shrunk to go through that (Ma, Bae, Choi
    /// 2012, *3D medial axis point approximation using nearest neighbors*, section 3).
    fn balls(
        &self,
        distance: &dyn DistanceField,
        a: &[f64],
        at: &[Point3],
        inward: &[Point3],
        side: f64,
    ) -> Vec<f64> {
        let size = self.data.diagonal();
        let mut r = vec![LARGEST * size; at.len()];
        let mut active: Vec<usize> = (0..at.len()).collect();
        let mut feet = vec![Foot::NONE; at.len()];
        for _ in 0..SHRINKS {
            let centre = |k: usize| std::array::from_fn(|i| at[k][i] + side * r[k] * inward[k][i]);
            let centres: Vec<Point3> = active.iter().map(|k| centre(*k)).collect();
            distance.feet(&centres, a, &mut feet);
            let mut found = feet.iter();
            active.retain(|&k| {
                let foot = found.next().expect("a foot by centre");
                if side * foot.distance >= TOUCHES * r[k] {
                    return false;
                }
                // The ball that touches the surface at the place and goes through the foot point.
                let to = sub(foot.at, at[k]);
                let through = dot(to, to) / (2.0 * side * dot(to, inward[k]));
                let is_sound = foot.order > 0 && through > 0.0;
                let least = SMALLEST * size;
                r[k] = if is_sound {
                    through.min(r[k])
                } else {
                    0.5 * r[k]
                }
                .max(least);
                r[k] > least
            });
            if active.is_empty() {
                break;
            }
        }
        r.iter().map(|r| 2.0 * r).collect()
    }
}

/// Share of the samples that are bare while most of those that face the same way are not.
fn overlooked(surface: &Surface) -> f64 {
    let step = surface.inward.len().div_ceil(COMPARED).max(1);
    let is_overlooked = |i: &usize| {
        let (mut alike, mut bare) = (0, 0);
        for j in (0..surface.inward.len()).step_by(step) {
            if dot(surface.inward[*i], surface.inward[j]) > SAME_WAY {
                alike += 1;
                bare += usize::from(surface.bare[j]);
            }
        }
        2 * bare < alike
    };
    let bare = (0..surface.inward.len()).filter(|i| surface.bare[*i]);
    bare.filter(is_overlooked).count() as f64 / surface.inward.len().max(1) as f64
}
