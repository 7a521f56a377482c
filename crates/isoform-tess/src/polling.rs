//! Work on other threads while the one that calls asks whether to stop.

use rayon::Yield;
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// How often it is asked.
const POLL: Duration = Duration::from_millis(1);

/// Does some work, which is told by the flag to stop; `stop` is asked by the thread that calls
/// only.
///
/// # Panics
/// If the work does.
pub fn polled<T: Send>(stop: &dyn Fn() -> bool, work: impl FnOnce(&AtomicBool) -> T + Send) -> T {
    let stopped = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let done = scope.spawn(|| work(&stopped));
        while !done.is_finished() {
            stopped.fetch_or(stop(), Ordering::Relaxed);
            // A thread of the pool helps.
            if rayon::yield_now() != Some(Yield::Executed) {
                std::thread::sleep(POLL);
            }
        }
        done.join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

/// What is made of each quadrant, in their order, side by side.
pub(crate) fn in_quadrants<T: Send>(
    stop: &dyn Fn() -> bool,
    work: impl Fn(usize, &dyn Fn() -> bool) -> T + Sync + Send,
) -> Vec<T> {
    polled(stop, |stopped| {
        (0..4)
            .into_par_iter()
            .map(|quadrant| work(quadrant, &|| stopped.load(Ordering::Relaxed)))
            .collect()
    })
}
