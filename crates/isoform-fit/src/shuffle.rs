//! Random orders that are equal on machines of 32 and of 64 bits.

use fastrand::Rng;

/// Shuffles a slice as [`Rng::shuffle`] does where indices have 64 bits. Where they have 32, that
/// draws other numbers, and fits would begin elsewhere.
pub(crate) fn shuffle<T>(random: &mut Rng, slice: &mut [T]) {
    for i in 1..slice.len() {
        slice.swap(i, random.u64(..=i as u64) as usize);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_pointer_width = "64")]
    fn orders_are_those_of_64_bits() {
        for (seed, n) in [(1, 0), (2, 1), (3, 2), (4, 1000)] {
            let (mut ours, mut theirs): (Vec<usize>, Vec<usize>) =
                ((0..n).collect(), (0..n).collect());
            shuffle(&mut Rng::with_seed(seed), &mut ours);
            Rng::with_seed(seed).shuffle(&mut theirs);
            assert_eq!(ours, theirs);
        }
    }
}
