//! Work on the four unit triangles side by side.

use rayon::Yield;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// How often it is asked whether to stop.
const POLL: Duration = Duration::from_millis(1);

/// What is made of each quadrant, in their order. `stop` is asked by the thread that calls only.
pub(crate) fn in_quadrants<T: Send>(stop: &dyn Fn() -> bool, work: impl Fn(usize, &dyn Fn() -> bool) -> T + Sync) -> [T; 4] {
    let stopped = AtomicBool::new(false);
    let left = AtomicUsize::new(4);
    let found = [const { Mutex::new(None) }; 4];
    rayon::in_place_scope(|scope| {
        for (quadrant, place) in found.iter().enumerate() {
            let (work, stopped, left) = (&work, &stopped, &left);
            scope.spawn(move |_| {
                let made = work(quadrant, &|| stopped.load(Ordering::Relaxed));
                *place.lock().unwrap_or_else(PoisonError::into_inner) = Some(made);
                left.fetch_sub(1, Ordering::Release);
            });
        }
        while left.load(Ordering::Acquire) > 0 {
            // A thread of the pool helps.
            if rayon::yield_now() != Some(Yield::Executed) {
                std::thread::sleep(POLL);
            }
            stopped.fetch_or(stop(), Ordering::Relaxed);
        }
    });
    found.map(|made| made.into_inner().unwrap_or_else(PoisonError::into_inner).expect("every quadrant is done"))
}
