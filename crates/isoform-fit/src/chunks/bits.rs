//! A flag per point of a chunk.

/// Flags by index; an empty list sets all.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bits(pub(super) Vec<u64>);

impl Bits {
    /// Returns flags for `count` points, all clear.
    pub(super) fn none(count: usize) -> Self {
        // At least one word: an empty list sets all flags.
        Self(vec![0; count.div_ceil(64).max(1)])
    }

    /// Returns flags for `count` points, all set.
    pub(super) fn all(count: usize) -> Self {
        Self(vec![u64::MAX; count.div_ceil(64).max(1)])
    }

    pub(super) fn clear(&mut self, at: usize) {
        self.0[at / 64] &= !(1 << (at % 64));
    }

    pub(super) fn set(&mut self, at: usize) {
        self.0[at / 64] |= 1 << (at % 64);
    }

    pub(super) fn is_set(&self, at: usize) -> bool {
        self.0.is_empty() || self.0[at / 64] >> (at % 64) & 1 == 1
    }

    /// Returns the values whose flags are set.
    pub(super) fn chosen<T: Copy>(&self, mut values: Vec<T>) -> Vec<T> {
        if !self.0.is_empty() {
            let mut at = 0..;
            values.retain(|_| at.next().is_some_and(|i| self.is_set(i)));
        }
        values
    }
}
