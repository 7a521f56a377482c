//! Disjoint sets of numbers that are united step by step.
//!
//! The forest of R. E. Tarjan (J. ACM 22, 1975) with path halving. The root of a set is always its
//! least number, whatever the order of the unions: what is numbered by roots is deterministic. The
//! price, a depth that is not balanced by rank, is paid back by the halving of paths.

/// A partition of 0, 1, …, n − 1, each number first in a set of its own.
///
/// ```
/// use isoform_geom::UnionFind;
///
/// let mut sets = UnionFind::new(5);
/// assert!(sets.unite(3, 4));
/// assert!(sets.unite(4, 1));
/// assert!(!sets.unite(1, 3), "they are in one set already");
/// assert_eq!((sets.root(4), sets.count()), (1, 3));
/// ```
#[derive(Clone, Debug, Default)]
pub struct UnionFind {
    /// Another number of the set, never larger; the number itself at the root.
    up: Vec<u32>,
    count: usize,
}

impl UnionFind {
    /// The partition of `n` numbers into sets of one.
    ///
    /// # Panics
    /// If there are more than 2³² numbers.
    #[must_use]
    pub fn new(n: usize) -> Self {
        let mut sets = Self::default();
        sets.reset(n);
        sets
    }

    /// Makes it the partition of `n` numbers into sets of one; memory is kept.
    ///
    /// # Panics
    /// If there are more than 2³² numbers.
    pub fn reset(&mut self, n: usize) {
        let n32 = u32::try_from(n).expect("numbers have 32 bits");
        self.up.clear();
        self.up.extend(0..n32);
        self.count = n;
    }

    /// A further number, in a set of its own.
    ///
    /// # Panics
    /// If there are 2³² numbers already.
    pub fn add(&mut self) -> u32 {
        let next = u32::try_from(self.up.len()).expect("numbers have 32 bits");
        self.up.push(next);
        self.count += 1;
        next
    }

    /// The least number of the set of `i`.
    ///
    /// # Panics
    /// If `i` is not among the numbers.
    #[inline]
    pub fn root(&mut self, mut i: u32) -> u32 {
        while self.up[i as usize] != i {
            let above = self.up[self.up[i as usize] as usize];
            self.up[i as usize] = above;
            i = above;
        }
        i
    }

    /// Unites the sets of two numbers; whether they were different ones.
    ///
    /// # Panics
    /// If one of them is not among the numbers.
    #[inline]
    pub fn unite(&mut self, a: u32, b: u32) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        self.up[a.max(b) as usize] = a.min(b);
        self.count -= usize::from(a != b);
        a != b
    }

    /// How many sets there are.
    pub fn count(&self) -> usize {
        self.count
    }

    /// How many numbers there are.
    pub fn len(&self) -> usize {
        self.up.len()
    }

    /// Whether there are no numbers.
    pub fn is_empty(&self) -> bool {
        self.up.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Against the transitive closure by labels.
        #[test]
        fn roots_are_the_least_numbers(pairs in prop::collection::vec((0u32..40, 0u32..40), 0..60)) {
            let mut sets = UnionFind::new(40);
            let mut label: Vec<u32> = (0..40).collect();
            for (a, b) in pairs {
                let (x, y) = (label[a as usize], label[b as usize]);
                prop_assert_eq!(sets.unite(a, b), x != y);
                for l in &mut label {
                    if *l == x.max(y) {
                        *l = x.min(y);
                    }
                }
            }
            for i in 0..40 {
                prop_assert_eq!(sets.root(i), label[i as usize]);
            }
            let roots = (0..40).filter(|&i| label[i as usize] == i).count();
            prop_assert_eq!(sets.count(), roots);
        }
    }

    #[test]
    fn numbers_can_be_added_and_forgotten() {
        let mut sets = UnionFind::default();
        assert!(sets.is_empty());
        let (a, b) = (sets.add(), sets.add());
        sets.unite(b, a);
        assert_eq!((sets.len(), sets.count(), sets.root(b)), (2, 1, 0));
        sets.reset(2);
        assert_eq!((sets.count(), sets.root(b)), (2, 1));
    }
}
