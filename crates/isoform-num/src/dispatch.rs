//! Functions compiled for several instruction sets.

/// Defines a function that runs a body compiled for the best instruction set of the machine:
/// AVX-512, AVX2 or the baseline of the target. The body, and every function it calls in its inner
/// loops, must be `#[inline(always)]`: otherwise they are compiled for the baseline. Sums are
/// evaluated in the order in which they are written, without fused multiply-add, so that results
/// are identical, bit for bit, on every machine.
///
/// ```
/// isoform_num::dispatch! {
///     /// y += a x.
///     fn add(y: &mut [f64], a: f64, x: &[f64]) = add_body
/// }
///
/// #[inline(always)]
/// fn add_body(y: &mut [f64], a: f64, x: &[f64]) {
///     for (y, x) in y.iter_mut().zip(x) {
///         *y += a * x;
///     }
/// }
///
/// let mut y = [1.0, 2.0, 3.0];
/// add(&mut y, 2.0, &[10.0, 20.0, 30.0]);
/// assert_eq!(y, [21.0, 42.0, 63.0]);
/// ```
#[macro_export]
macro_rules! dispatch {
    (
        $(#[$doc:meta])*
        $vis:vis fn $name:ident($($arg:ident : $ty:ty),* $(,)?) $(-> $ret:ty)? = $body:path
    ) => {
        $(#[$doc])*
        $vis fn $name($($arg: $ty),*) $(-> $ret)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2($($arg: $ty),*) $(-> $ret)? { $body($($arg),*) }
                #[target_feature(enable = "avx512f,avx512dq,avx512vl")]
                fn avx512($($arg: $ty),*) $(-> $ret)? { $body($($arg),*) }
                if is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
                {
                    #[allow(unsafe_code, reason = "the processor was asked for AVX-512")]
                    return unsafe { avx512($($arg),*) };
                }
                if is_x86_feature_detected!("avx2") {
                    #[allow(unsafe_code, reason = "the processor was asked for AVX2")]
                    return unsafe { avx2($($arg),*) };
                }
            }
            $body($($arg),*)
        }
    };
}
