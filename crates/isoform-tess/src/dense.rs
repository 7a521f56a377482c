//! Linear systems over Z, without fractions (E. H. Bareiss, Math. Comp. 22, 1968).

use isoform_algebra::IBig;

/// Solves A·y = d·b with d = ± det A, and returns y and d; `None` if A is singular.
pub(crate) fn solve(mut a: Vec<Vec<IBig>>, b: Vec<IBig>) -> Option<(Vec<IBig>, IBig)> {
    let n = a.len();
    for (row, c) in a.iter_mut().zip(b) {
        row.push(c);
    }
    let mut last = IBig::ONE;
    for k in 0..n {
        let pivot = (k..n).find(|&i| !a[i][k].is_zero())?;
        a.swap(k, pivot);
        let top = a[k].clone();
        for (i, row) in a.iter_mut().enumerate() {
            if i != k {
                let factor = row[k].clone();
                for j in k..=n {
                    row[j] = (&row[j] * &top[k] - &factor * &top[j]) / &last;
                }
                // Rows above are kept on the common diagonal.
                if i < k {
                    row[i] = top[k].clone();
                }
            }
        }
        last = top[k].clone();
    }
    Some((
        a.into_iter().map(|mut row| row.swap_remove(n)).collect(),
        last,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_systems() {
        let mut random = fastrand::Rng::with_seed(1);
        for n in 1..6 {
            for _ in 0..50 {
                let a: Vec<Vec<IBig>> = (0..n)
                    .map(|_| (0..n).map(|_| IBig::from(random.i32(-3..=3))).collect())
                    .collect();
                let b: Vec<IBig> = (0..n).map(|_| IBig::from(random.i32(-9..=9))).collect();
                if let Some((y, d)) = solve(a.clone(), b.clone()) {
                    for (row, c) in a.iter().zip(&b) {
                        let sum: IBig = row.iter().zip(&y).map(|(x, y)| x * y).sum();
                        assert_eq!(sum, &d * c);
                    }
                }
            }
        }
    }
}
