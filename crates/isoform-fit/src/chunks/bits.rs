//! A flag for each point of a chunk.

/// Flags by index; where there are none, all are set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bits(pub(super) Vec<u64>);

impl Bits {
    /// As many flags, none of them set.
    pub(super) fn none(count: usize) -> Self {
        // One word at least: no word would say that all are set.
        Self(vec![0; count.div_ceil(64).max(1)])
    }

    /// As many flags, all of them set.
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

    /// The values whose flags are set.
    pub(super) fn chosen<T: Copy>(&self, mut values: Vec<T>) -> Vec<T> {
        if !self.0.is_empty() {
            let mut at = 0..;
            values.retain(|_| at.next().is_some_and(|i| self.is_set(i)));
        }
        values
    }
}
