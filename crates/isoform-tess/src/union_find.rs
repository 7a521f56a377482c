//! Disjoint sets of numbers that are united step by step.

/// A partition of numbers 0, 1, …; the root of a set is its least number.
#[derive(Default)]
pub(crate) struct UnionFind {
    up: Vec<u32>,
    count: usize,
}

impl UnionFind {
    /// The partition of n numbers into sets of one.
    pub(crate) fn new(n: usize) -> Self {
        Self {
            up: (0..n as u32).collect(),
            count: n,
        }
    }
    /// A further number, in a set of its own.
    pub(crate) fn add(&mut self) -> u32 {
        let next = self.up.len() as u32;
        self.up.push(next);
        self.count += 1;
        next
    }
    pub(crate) fn root(&mut self, mut i: u32) -> u32 {
        while self.up[i as usize] != i {
            let above = self.up[self.up[i as usize] as usize];
            self.up[i as usize] = above;
            i = above;
        }
        i
    }
    pub(crate) fn unite(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.up[a.max(b) as usize] = a.min(b);
        self.count -= usize::from(a != b);
    }
    /// How many sets there are.
    pub(crate) fn count(&self) -> usize {
        self.count
    }
}
