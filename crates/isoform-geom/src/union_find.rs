//! Disjoint-set forests.
//!
//! The forest of R. E. Tarjan (J. ACM 22, 1975) with path halving. The root of a set is always its
//! least number, independently of the order of the unions, so that numbering by roots is
//! deterministic. Trees are therefore not balanced by rank; path halving keeps them shallow.

/// Partition of 0, 1, …, n − 1 into disjoint sets, initially of one number each.
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
    /// Parent of each number, never larger than the number; a root is its own parent.
    up: Vec<u32>,
    count: usize,
}

impl UnionFind {
    /// Returns the partition of `n` numbers into sets of one.
    ///
    /// # Panics
    /// If there are more than 2³² numbers.
    #[must_use]
    pub fn new(n: usize) -> Self {
        let mut sets = Self::default();
        sets.reset(n);
        sets
    }

    /// Resets to the partition of `n` numbers into sets of one; allocated memory is reused.
    ///
    /// # Panics
    /// If there are more than 2³² numbers.
    pub fn reset(&mut self, n: usize) {
        let n32 = u32::try_from(n).expect("numbers have 32 bits");
        self.up.clear();
        self.up.extend(0..n32);
        self.count = n;
    }

    /// Adds a number, in a set of its own, and returns it.
    ///
    /// # Panics
    /// If there are 2³² numbers already.
    pub fn add(&mut self) -> u32 {
        let next = u32::try_from(self.up.len()).expect("numbers have 32 bits");
        self.up.push(next);
        self.count += 1;
        next
    }

    /// Returns the least number of the set of `i`.
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

    /// Unites the sets of two numbers. Returns true if these were different sets.
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

    /// Returns the number of sets.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Returns the number of elements.
    pub fn len(&self) -> usize {
        self.up.len()
    }

    /// Returns true if the partition is empty.
    pub fn is_empty(&self) -> bool {
        self.up.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Compares with the transitive closure by labels.
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
