//! Sets of places of a lattice: sorted, so that loops over them run in one order on every machine,
//! with an index for questions.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// A place of a lattice: numbers in x, y and z, none below 0.
pub(crate) type Place = [i32; 3];

/// Bits of a number in a key: lattices have at most 2²¹ places along an axis.
const BITS: u32 = 21;

/// The largest number of places along an axis.
pub(crate) const MOST: i32 = 1 << BITS;

/// The place as one number; z decides first, x last.
#[inline]
pub(crate) fn key([x, y, z]: Place) -> u64 {
    (z as u64) << (2 * BITS) | (y as u64) << BITS | x as u64
}

/// The place of a key.
#[inline]
pub(crate) fn place(key: u64) -> Place {
    let part = |shift: u32| (key >> shift & ((1 << BITS) - 1)) as i32;
    [part(0), part(BITS), part(2 * BITS)]
}

/// Mixes keys for a table: one multiplication, as keys are distinct numbers and not chosen by anyone.
#[derive(Clone, Debug, Default)]
pub(crate) struct Mix(u64);

impl Hasher for Mix {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.write_u64(u64::from(*byte));
        }
    }
    fn write_u64(&mut self, v: u64) {
        // 2⁶⁴ divided by the golden ratio: neighbouring keys are spread over the table.
        let m = (self.0 ^ v).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        self.0 = m ^ (m >> 32);
    }
}

/// Places in order, and the number of each.
#[derive(Clone, Debug, Default)]
pub(crate) struct Keys {
    sorted: Vec<u64>,
    index: HashMap<u64, u32, BuildHasherDefault<Mix>>,
}

impl Keys {
    /// The places of a list; repeated ones count once.
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
    /// The number of a place, if it is in the set.
    #[inline]
    pub(crate) fn find(&self, at: Place) -> Option<usize> {
        if at.iter().any(|v| *v < 0) {
            return None;
        }
        self.index.get(&key(at)).map(|i| *i as usize)
    }
    #[inline]
    pub(crate) fn at(&self, i: usize) -> Place {
        place(self.sorted[i])
    }
    /// All places in order.
    pub(crate) fn places(&self) -> impl Iterator<Item = Place> + '_ {
        self.sorted.iter().map(|k| place(*k))
    }
}
