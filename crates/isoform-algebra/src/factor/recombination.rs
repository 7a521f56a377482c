//! Recombination: products of few of the lifted factors are tried before products of many.

use super::FactorError;
use isoform_control::Control;

/// Number of subsets between two checks of the control.
const SUBSETS_PER_CHECK: usize = 256;

/// Replaces a subset of 0 … n − 1 by the next one of its size in lexicographic order; returns false
/// after the last one.
fn next_subset(subset: &mut [usize], n: usize) -> bool {
    let k = subset.len();
    for i in (0..k).rev() {
        if subset[i] + (k - i) < n {
            subset[i] += 1;
            for j in i + 1..k {
                subset[j] = subset[j - 1] + 1;
            }
            return true;
        }
    }
    false
}

/// Divides `rest` by factors that are products of subsets, small subsets first: `test` returns the
/// factor that a subset of the indices gives, if it is one. The second result is the list of
/// remaining indices.
pub(super) fn by_subsets<F: Clone>(
    count: usize,
    control: &Control<'_>,
    mut test: impl FnMut(&[usize]) -> Option<F>,
) -> Result<(Vec<F>, Vec<usize>), FactorError> {
    let mut left: Vec<usize> = (0..count).collect();
    let mut factors = Vec::new();
    let mut size = 1;
    while 2 * size <= left.len() {
        match first_factor(&left, size, control, &mut test)? {
            Some((factor, chosen)) => {
                factors.push(factor);
                left.retain(|i| !chosen.contains(i));
            }
            None => size += 1,
        }
    }
    Ok((factors, left))
}

/// Returns the first subset of a size that gives a factor, with the factor.
fn first_factor<F>(
    left: &[usize],
    size: usize,
    control: &Control<'_>,
    test: &mut impl FnMut(&[usize]) -> Option<F>,
) -> Result<Option<(F, Vec<usize>)>, FactorError> {
    let mut subset: Vec<usize> = (0..size).collect();
    let mut trials = 0usize;
    loop {
        trials += 1;
        if trials.is_multiple_of(SUBSETS_PER_CHECK) {
            control.check()?;
        }
        let chosen: Vec<usize> = subset.iter().map(|&i| left[i]).collect();
        if let Some(factor) = test(&chosen) {
            return Ok(Some((factor, chosen)));
        }
        if !next_subset(&mut subset, left.len()) {
            return Ok(None);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The divisors 6, 35 and 11 of 2 · 3 · 5 · 7 · 11 are found without a remainder.
    #[test]
    fn small_products_come_first() {
        let primes = [2, 3, 5, 7, 11];
        let product = |chosen: &[usize]| -> u32 { chosen.iter().map(|&i| primes[i]).product() };
        let wanted = |chosen: &[usize]| [6, 35, 11].contains(&product(chosen));
        let found = by_subsets(5, &Control::default(), |chosen| {
            wanted(chosen).then(|| product(chosen))
        });
        assert_eq!(found, Ok((vec![11, 6], vec![2, 3])));
    }

    #[test]
    fn subsets_are_counted_by_binomials() {
        let mut subset = vec![0, 1, 2];
        let mut count = 1;
        while next_subset(&mut subset, 7) {
            count += 1;
        }
        assert_eq!((count, subset), (35, vec![4, 5, 6]));
    }
}
