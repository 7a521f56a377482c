//! Sets of lattice indices: sorted, so that loops run in one order on every machine, and indexed by
//! a hash table.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Index of a cell or node of a lattice in x, y and z, non-negative.
pub(crate) type LatticeIndex = [i32; 3];

/// Bits of one coordinate in a key.
const KEY_BITS: u32 = 21;

/// Maximum number of cells or nodes along an axis, 2²¹: three coordinates fit into a key of 64
/// bits.
pub(crate) const MAX_AXIS_NODES: i32 = 1 << KEY_BITS;

/// Stands for no index where an index of 32 bits is stored.
pub(crate) const NO_INDEX: u32 = u32::MAX;

/// Packs an index into one number that orders by z, y, x.
#[inline]
pub(crate) fn key([x, y, z]: LatticeIndex) -> u64 {
    (z as u64) << (2 * KEY_BITS) | (y as u64) << KEY_BITS | x as u64
}

/// Unpacks the index of a key.
#[inline]
pub(crate) fn place(key: u64) -> LatticeIndex {
    let part = |shift: u32| (key >> shift & ((1 << KEY_BITS) - 1)) as i32;
    [part(0), part(KEY_BITS), part(2 * KEY_BITS)]
}

/// Hasher of keys: one multiplication suffices, as keys are distinct and not chosen by an
/// adversary.
#[derive(Clone, Debug, Default)]
pub(crate) struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.write_u64(u64::from(*byte));
        }
    }
    fn write_u64(&mut self, v: u64) {
        // 2⁶⁴ divided by the golden ratio: spreads neighbouring keys over the table.
        let m = (self.0 ^ v).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        self.0 = m ^ (m >> 32);
    }
}

/// Sorted set of lattice indices with the position of each.
#[derive(Clone, Debug, Default)]
pub(crate) struct IndexSet {
    sorted: Vec<u64>,
    index: HashMap<u64, u32, BuildHasherDefault<KeyHasher>>,
}

impl IndexSet {
    /// Collects a list of keys; duplicates count once.
    pub(crate) fn new(mut list: Vec<u64>) -> Self {
        list.sort_unstable();
        list.dedup();
        list.shrink_to_fit();
        let index = list.iter().zip(0..).map(|(k, i)| (*k, i)).collect();
        Self {
            sorted: list,
            index,
        }
    }
    pub(crate) fn len(&self) -> usize {
        self.sorted.len()
    }
    /// Returns the position of an index; `None` if it is not in the set.
    #[inline]
    pub(crate) fn find(&self, at: LatticeIndex) -> Option<usize> {
        if at.iter().any(|v| *v < 0) {
            return None;
        }
        self.index.get(&key(at)).map(|i| *i as usize)
    }
    #[inline]
    pub(crate) fn at(&self, i: usize) -> LatticeIndex {
        place(self.sorted[i])
    }
    /// Returns all indices in order.
    pub(crate) fn places(&self) -> impl Iterator<Item = LatticeIndex> + '_ {
        self.sorted.iter().map(|k| place(*k))
    }
}
