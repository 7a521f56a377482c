//! Thickness of the model's walls and width of its gaps, by tangent balls.
//!
//! ```text
//!   ────────×────────  surface, × the place
//!         (   )        a ball on one side that touches it there,
//!          ( )         shrunk until no other place is within
//!   ────────×────────  the other side of the wall
//! ```

use crate::deviation::SampledSurface;
use crate::task::Task;
use isoform_geom::{DistanceField, Foot, Point3, dot, sub};

/// Radius of the smallest ball tried, as a share of the data's diagonal.
const MIN_BALL_RADIUS_SHARE: f64 = 1e-4;

/// Balls that touch the surface at given foot points, all on one side of it.
struct TangentBalls<'a> {
    distance: &'a dyn DistanceField,
    a: &'a [f64],
    feet: &'a [Foot],
    /// 1 for the inside, −1 for the outside.
    side: f64,
    /// Radius of the smallest ball.
    least: f64,
}

impl TangentBalls<'_> {
    /// Returns the centre of the ball of radius r at foot point k.
    fn centre(&self, k: usize, r: f64) -> Point3 {
        let Foot { at, inward, .. } = self.feet[k];
        std::array::from_fn(|i| at[i] + self.side * r * inward[i])
    }

    /// Returns the diameters of the largest tangent balls without surface points inside: a ball
    /// that holds another point of the surface is shrunk to pass through it (Ma, Bae, Choi 2012,
    /// *3D medial axis point approximation using nearest neighbors*, section 3).
    fn diameters(&self, largest: f64) -> Vec<f64> {
        let mut r = vec![largest; self.feet.len()];
        let mut active: Vec<usize> = (0..r.len()).collect();
        let mut feet = vec![Foot::NONE; r.len()];
        // Two or three rounds are enough where the opposite side is flat.
        for _ in 0..12 {
            let centres: Vec<Point3> = active.iter().map(|k| self.centre(*k, r[*k])).collect();
            self.distance.feet(&centres, self.a, &mut feet);
            let mut found = feet.iter();
            active.retain(|&k| {
                let foot = found.next().expect("a foot by centre");
                self.shrink(k, foot, &mut r[k])
            });
            if active.is_empty() {
                break;
            }
        }
        r.iter().map(|r| 2.0 * r).collect()
    }

    /// Shrinks the ball at foot point k, whose centre has this foot; returns false when it is done.
    fn shrink(&self, k: usize, foot: &Foot, r: &mut f64) -> bool {
        // Within two per cent of the radius the ball touches the surface elsewhere.
        if self.side * foot.distance >= 0.98 * *r {
            return false;
        }
        // The ball that touches the surface at foot point k and passes through the other one.
        let to = sub(foot.at, self.feet[k].at);
        let through = dot(to, to) / (2.0 * self.side * dot(to, self.feet[k].inward));
        let is_sound = foot.order > 0 && through > 0.0;
        let next = if is_sound { through.min(*r) } else { 0.5 * *r };
        *r = next.max(self.least);
        *r > self.least
    }
}

impl Task<'_> {
    /// Returns the thickness of the thinnest wall and the width of the narrowest gap. They are the
    /// diameter of the largest inside and outside ball that touches the surface at a point; the
    /// upper quartile over a part, since edges are thin on any solid; and the minimum over all
    /// parts with enough samples.
    pub(super) fn thicknesses(
        &self,
        distance: &dyn DistanceField,
        a: &[f64],
        surface: &SampledSurface,
    ) -> (f64, f64) {
        let step = surface.points.len().div_ceil(200).max(1);
        let some: Vec<Point3> = surface.points.iter().copied().step_by(step).collect();
        // The bias was removed after the surface was sampled: a ball at a point slightly off the
        // surface would find that very point.
        let mut feet = vec![Foot::NONE; some.len()];
        distance.feet(&some, a, &mut feet);
        feet.retain(|foot| foot.order == 1);
        if feet.is_empty() {
            return (f64::INFINITY, f64::INFINITY);
        }
        let [wall, gap] = [1.0, -1.0].map(|side| {
            let touching = TangentBalls {
                distance,
                a,
                feet: &feet,
                side,
                least: MIN_BALL_RADIUS_SHARE * self.size(),
            };
            // No wall of half the diagonal is thin.
            let diameters = touching.diameters(0.25 * self.size());
            self.least_typical(&diameters, &feet)
        });
        (wall, gap)
    }

    /// Returns the minimum over the parts of the upper quartile of diameters; parts with fewer than
    /// 12 samples are left out.
    fn least_typical(&self, diameters: &[f64], feet: &[Foot]) -> f64 {
        // Where pieces touch without an edge, not even the smallest ball fits.
        let smallest = 4.0 * MIN_BALL_RADIUS_SHARE * self.size();
        let mut least = f64::INFINITY;
        for part in 0..self.template.part_names().len() as u32 {
            let own = diameters.iter().zip(feet);
            let own = own.filter(|(_, foot)| foot.pieces[0] == part);
            let own: Vec<f64> = own.map(|(d, _)| *d).collect();
            let is_told = own.len() >= 12;
            let typical = upper_quartile(own);
            if is_told && typical > smallest {
                least = least.min(typical);
            }
        }
        least
    }
}

/// Returns the upper quartile; zero for an empty list.
fn upper_quartile(mut v: Vec<f64>) -> f64 {
    v.sort_unstable_by(f64::total_cmp);
    v.get(3 * v.len() / 4).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_is_above_the_upper_quartile() {
        assert_eq!(upper_quartile((0..8).rev().map(f64::from).collect()), 6.0);
        assert_eq!(upper_quartile(Vec::new()), 0.0);
    }
}
