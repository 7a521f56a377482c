//! The end of a run that does not end by itself: `--time-limit` holds even where one step of the
//! work takes longer than all of it was to take.
//!
//! Every loop looks at the clock and stops with the best so far. What is left are single steps on
//! programs of a hundred thousand operations. They cannot be interrupted, so the run is ended with
//! an error; files that were written by then stay.

use crate::failure::{Failure, NO_RESULT};
use crate::terminal::give_up;
use std::panic::AssertUnwindSafe;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A run may take this share of its limit more, and [`SECONDS`], before it is ended: loops stop in
/// that time, and proofs that are cut short still say what they have. Less would throw away
/// results that are about to be written; more is not what was asked for.
const SHARE: f64 = 0.2;
/// See [`SHARE`].
const SECONDS: f64 = 1.5;
/// Interval of checks while files are written.
const AGAIN: Duration = Duration::from_millis(50);

/// Files that are being written; a run is not ended meanwhile.
static WRITING: AtomicUsize = AtomicUsize::new(0);
/// The stage of the work, for the message.
static STAGE: Mutex<String> = Mutex::new(String::new());

/// Says what is being worked on.
fn enter(stage: &str) {
    stage.clone_into(&mut STAGE.lock().unwrap_or_else(PoisonError::into_inner));
}

/// Runs a stage of the work. A panic in it is a failure of that stage, so that what was made
/// before it is still there to be written.
pub(crate) fn stage<T>(
    name: &str,
    work: impl FnOnce() -> Result<T, Failure>,
) -> Result<T, Failure> {
    enter(name);
    std::panic::catch_unwind(AssertUnwindSafe(work))
        .unwrap_or_else(|_| Err(Failure::internal(name)))
}

/// While this lives files are written, or the run is over.
pub(crate) struct Writing;

impl Writing {
    /// Files are being written from here on.
    pub(crate) fn new() -> Self {
        WRITING.fetch_add(1, Ordering::SeqCst);
        Self
    }
}

impl Drop for Writing {
    fn drop(&mut self) {
        WRITING.fetch_sub(1, Ordering::SeqCst);
    }
}

/// From now on the run is ended some time after its limit.
pub(crate) fn watch(limit: Duration, json: bool) {
    let Some(end) = Instant::now().checked_add(limit.mul_f64(1.0 + SHARE)) else {
        return;
    };
    let end = end + Duration::from_secs_f64(SECONDS);
    // Without a thread the limit holds as far as loops look at the clock.
    let _ = std::thread::Builder::new().spawn(move || {
        while let Some(left) = end.checked_duration_since(Instant::now()) {
            std::thread::sleep(left.max(Duration::from_millis(1)));
        }
        while WRITING.load(Ordering::SeqCst) > 0 {
            std::thread::sleep(AGAIN);
        }
        let stage = STAGE.lock().unwrap_or_else(PoisonError::into_inner).clone();
        give_up(json, &failure(limit, &stage));
    });
}

/// Why the run is ended.
fn failure(limit: Duration, stage: &str) -> Failure {
    let place = if stage.is_empty() {
        String::new()
    } else {
        format!(" (while it worked on the {stage}; what was written before stays)")
    };
    let message = format!(
        "no result within the time limit of {} s{place}",
        limit.as_secs_f64()
    );
    Failure::new(NO_RESULT, "time-limit", message)
        .why("a single step of the work takes longer than what was left of it")
        .hint("a longer --time-limit, or a smaller model")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::failure::INTERNAL;

    #[test]
    fn a_panic_is_a_failure_of_its_stage() {
        let Err(failure) = stage("mesh", || -> Result<(), Failure> { panic!("on purpose") }) else {
            panic!("it has a result");
        };
        assert_eq!((failure.exit, failure.code), (INTERNAL, "internal"));
        assert!(failure.message.contains("mesh"), "{}", failure.message);
        assert_eq!(stage("", || Ok(1)).ok(), Some(1));
    }
}
