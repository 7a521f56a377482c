//! Midpoints, hashes and other small functions of points that the whole mesher uses.
//!
//! Sums are taken in one order everywhere, so that the midpoint of an edge is bitwise equal for
//! every caller.

use isoform_geom::{Point3, norm};

/// Returns the pairs of entries of a list, in its order.
pub(crate) fn pairs(list: &[u32]) -> impl Iterator<Item = [u32; 2]> + '_ {
    let with = |(k, &a): (usize, &u32)| list[k + 1..].iter().map(move |&b| [a, b]);
    list.iter().enumerate().flat_map(with)
}

/// Returns the midpoint of two points.
#[inline]
pub(crate) fn midpoint(p: Point3, q: Point3) -> Point3 {
    std::array::from_fn(|i| 0.5 * (p[i] + q[i]))
}

/// Returns the point at share `t` of the way from `p` to `q`.
#[inline]
pub(crate) fn lerp(p: Point3, q: Point3, t: f64) -> Point3 {
    std::array::from_fn(|i| p[i] + t * (q[i] - p[i]))
}

/// Returns the centroid of a triangle.
#[inline]
pub(crate) fn centroid(p: [Point3; 3]) -> Point3 {
    std::array::from_fn(|i| (p[0][i] + p[1][i] + p[2][i]) / 3.0)
}

/// Returns the vector divided by its length; a vector of length 0 is unchanged.
#[inline]
pub(crate) fn unit(v: Point3) -> Point3 {
    let n = norm(v).max(1e-300);
    v.map(|x| x / n)
}

/// Returns 64 pseudorandom bits, computed from all bits of a point's coordinates.
pub(crate) fn hash(p: Point3) -> u64 {
    hash_words(&p.map(f64::to_bits), 0x6a09_e667_f3bc_c908)
}

/// Returns 64 pseudorandom bits of words, by multiplications and shifts (Steele, Lea and Flood,
/// Fast splittable pseudorandom number generators, 2014); `start` selects one of several such
/// hashes.
pub(crate) fn hash_words(words: &[u64], start: u64) -> u64 {
    let mix = |mut z: u64| {
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    let step = 0x9e37_79b9_7f4a_7c15u64;
    words
        .iter()
        .fold(start, |h, &w| mix(h.wrapping_add(step) ^ mix(w ^ start)))
}

/// Returns the list sorted, without duplicates.
pub(crate) fn unique<T: Ord>(mut v: Vec<T>) -> Vec<T> {
    v.sort_unstable();
    v.dedup();
    v
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_the_way_is_the_middle() {
        let (p, q) = ([0.0, 1.0, -2.0], [4.0, 3.0, 2.0]);
        assert_eq!(midpoint(p, q), [2.0, 2.0, 0.0]);
        assert_eq!(lerp(p, q, 0.5), midpoint(p, q));
        assert_eq!(centroid([p, q, [2.0, 2.0, 3.0]]), [2.0, 2.0, 1.0]);
        assert_eq!(unit([0.0, 3.0, 4.0]), [0.0, 0.6, 0.8]);
        assert_eq!(unit([0.0; 3]), [0.0; 3]);
        assert_eq!(unique(vec![3, 1, 3]), [1, 3]);
    }
}
