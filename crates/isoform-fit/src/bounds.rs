//! Bounds of the variables of a solver.

/// Lower and upper bounds by variable; infinite if there is none.
#[derive(Clone, Copy)]
pub(crate) struct Bounds<'a> {
    pub(crate) lo: &'a [f64],
    pub(crate) hi: &'a [f64],
}

impl Bounds<'_> {
    /// Returns the width of the interval of variable i.
    pub(crate) fn range(self, i: usize) -> f64 {
        self.hi[i] - self.lo[i]
    }

    /// Returns the distance of x from the bound that variable i meets in the direction `towards`:
    /// the upper bound if that is positive.
    #[inline]
    pub(crate) fn gap(self, x: &[f64], i: usize, towards: f64) -> f64 {
        if towards > 0.0 {
            self.hi[i] - x[i]
        } else {
            x[i] - self.lo[i]
        }
    }

    /// Returns the greatest t such that x + t p is within the bounds.
    pub(crate) fn stride(self, x: &[f64], p: &[f64]) -> f64 {
        let moving = (0..x.len()).filter(|&i| p[i] != 0.0);
        let reach = moving.map(|i| self.gap(x, i, p[i]) / p[i].abs());
        reach.fold(f64::INFINITY, f64::min)
    }

    /// Draws a uniform value of variable i between its bounds, which must be finite.
    pub(crate) fn drawn(self, i: usize, random: &mut fastrand::Rng) -> f64 {
        self.lo[i] + self.range(i) * random.f64()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_wall_ends_a_stride() {
        let bounds = Bounds {
            lo: &[0.0, f64::NEG_INFINITY],
            hi: &[1.0, 4.0],
        };
        assert_eq!(bounds.stride(&[0.25, 0.0], &[1.0, 1.0]), 0.75);
        assert_eq!(bounds.stride(&[0.25, 0.0], &[-1.0, 20.0]), 0.2);
        assert_eq!(bounds.stride(&[0.25, 0.0], &[0.0, -3.0]), f64::INFINITY);
    }
}
