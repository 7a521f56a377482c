//! Knot vectors of the B-splines of a STEP file.

/// Clamped uniform knots 0, 1/s, 2/s, … 1: multiplicity degree + 1 at the ends, 1 inside.
pub(super) struct ClampedKnots {
    pub(super) degree: usize,
    pub(super) spans: usize,
}

impl ClampedKnots {
    /// Returns all knots, repeated by multiplicity.
    pub(super) fn all(&self) -> Vec<f64> {
        self.counts()
            .iter()
            .zip(self.values())
            .flat_map(|(count, value)| std::iter::repeat_n(value, *count))
            .collect()
    }
    /// Returns the multiplicity of each knot.
    pub(super) fn counts(&self) -> Vec<usize> {
        (0..=self.spans)
            .map(|k| {
                if k == 0 || k == self.spans {
                    self.degree + 1
                } else {
                    1
                }
            })
            .collect()
    }
    /// Returns the distinct knots.
    pub(super) fn values(&self) -> Vec<f64> {
        (0..=self.spans)
            .map(|k| k as f64 / self.spans as f64)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::ClampedKnots;

    #[test]
    fn clamped_and_even() {
        let knots = ClampedKnots {
            degree: 2,
            spans: 4,
        };
        let all = [0.0, 0.0, 0.0, 0.25, 0.5, 0.75, 1.0, 1.0, 1.0];
        assert_eq!(knots.all(), all);
    }
}
