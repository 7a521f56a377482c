//! Gauss-Legendre quadrature.

/// Maximum number of Newton steps per node. Four suffice from the asymptotic start; the rest only
/// bounds the loop.
const MAX_NODE_STEPS: usize = 20;

/// Returns the nodes, ascending, and the weights of the rule with `n` nodes on \[0, 1\], which is
/// exact for polynomials up to degree 2n − 1.
///
/// The nodes are the zeros of the Legendre polynomial Pₙ, found by Newton's method from cos(π(k −
/// 1/4)/(n + 1/2)); the weight at x ∈ \[−1, 1\] is 2/((1 − x²) Pₙ′(x)²).
///
/// ```
/// let (x, w) = isoform_num::gauss_legendre(3);
/// let integral: f64 = x.iter().zip(&w).map(|(x, w)| w * x.powi(5)).sum();
/// assert!((integral - 1.0 / 6.0).abs() < 1e-15);
/// ```
pub fn gauss_legendre(n: usize) -> (Vec<f64>, Vec<f64>) {
    let (mut nodes, mut weights) = (vec![0.0; n], vec![0.0; n]);
    for k in 0..n.div_ceil(2) {
        let mut x = (std::f64::consts::PI * (k as f64 + 0.75) / (n as f64 + 0.5)).cos();
        for _ in 0..MAX_NODE_STEPS {
            let (p, d) = legendre(n, x);
            let step = p / d;
            x -= step;
            if step.abs() <= 1e-16 {
                break;
            }
        }
        if 2 * k + 1 == n {
            x = 0.0;
        }
        let (_, d) = legendre(n, x);
        let w = 1.0 / ((1.0 - x * x) * d * d);
        (nodes[k], nodes[n - 1 - k]) = (0.5 * (1.0 - x), 0.5 * (1.0 + x));
        (weights[k], weights[n - 1 - k]) = (w, w);
    }
    (nodes, weights)
}

/// Returns Pₙ(x) and Pₙ′(x) by the three-term recurrence.
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut before, mut p) = (0.0, 1.0);
    for k in 0..n {
        let k = k as f64;
        (before, p) = (p, ((2.0 * k + 1.0) * x * p - k * before) / (k + 1.0));
    }
    (p, n as f64 * (before - x * p) / (1.0 - x * x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_up_to_twice_the_nodes_and_no_further() {
        for n in 1..=40 {
            let (x, w) = gauss_legendre(n);
            assert!(x.windows(2).all(|p| p[0] < p[1]) && x[0] > 0.0 && x[n - 1] < 1.0);
            let integral = |degree: i32| {
                x.iter()
                    .zip(&w)
                    .map(|(x, w)| w * x.powi(degree))
                    .sum::<f64>()
            };
            for degree in 0..2 * n as i32 {
                let error = integral(degree) * f64::from(degree + 1) - 1.0;
                assert!(error.abs() < 1e-13, "{n} nodes, degree {degree}: {error:e}");
            }
            if n < 8 {
                assert!((integral(2 * n as i32) * (2 * n + 1) as f64 - 1.0).abs() > 1e-9);
            }
        }
    }
}
