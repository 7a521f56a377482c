//! Angles covered by a face.

use std::f64::consts::TAU;

/// Arcs of a circle.
#[derive(Clone, Debug, Default)]
pub(crate) struct Arcs(Vec<[f64; 2]>);

impl Arcs {
    /// Adds the shorter arc between two angles.
    pub(crate) fn add(&mut self, a: f64, b: f64) {
        let by = (b - a).rem_euclid(TAU);
        let (from, by) = if by <= 0.5 * TAU {
            (a.rem_euclid(TAU), by)
        } else {
            (b.rem_euclid(TAU), TAU - by)
        };
        self.0.push([from, from + by]);
    }

    /// Returns the middle of the largest gap between the arcs, and its width: 2π without arcs.
    pub(crate) fn gap(mut self) -> (f64, f64) {
        self.0.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
        let Some(first) = self.0.first().copied() else {
            return (0.0, TAU);
        };
        // Arcs that reach beyond a full turn cover its beginning.
        let over = self.0.iter().fold(0.0f64, |m, a| m.max(a[1] - TAU));
        let (mut reached, mut best) = (first[1].max(over), (0.0, 0.0));
        for [from, to] in self.0.into_iter().chain([[first[0] + TAU; 2]]) {
            if from - reached > best.1 {
                best = (0.5 * (from + reached), from - reached);
            }
            reached = reached.max(to);
        }
        (best.0.rem_euclid(TAU), best.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_of_arcs() {
        let gap = |arcs: &[[f64; 2]]| {
            let mut all = Arcs::default();
            arcs.iter().for_each(|a| all.add(a[0], a[1]));
            all.gap()
        };
        let near = |(m, w): (f64, f64), (n, v): (f64, f64)| (m - n).abs() + (w - v).abs() < 1e-12;
        assert!(near(
            gap(&[[0.0, 2.0], [2.0, 4.0]]),
            (0.5 * (4.0 + TAU), TAU - 4.0)
        ));
        assert!(near(gap(&[[6.0, 7.0], [1.0, 2.0]]), (4.0, 4.0)));
        assert!(near(
            gap(&[[1.0, 2.0], [3.0, 3.5]]),
            (0.5 * (4.5 + TAU), TAU - 2.5)
        ));
        assert_eq!(gap(&[[0.0, 3.0], [3.0, 6.0], [6.0, 6.5]]).1, 0.0);
    }
}
