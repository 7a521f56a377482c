//! Cancellation, deadline and progress: one type for every stage that takes time.
//!
//! ```
//! use isoform_control::{Control, Stopped};
//! use std::time::{Duration, Instant};
//!
//! // The sum of 1/n², until the time is over.
//! fn sum(terms: u32, control: &Control<'_>) -> Result<f64, Stopped> {
//!     let mut sum = 0.0;
//!     for n in 1..=terms {
//!         control.check()?;
//!         sum += 1.0 / f64::from(n).powi(2);
//!     }
//!     Ok(sum)
//! }
//!
//! assert!(sum(1000, &Control::default()).is_ok());
//! let over = Control::default().until(Instant::now() - Duration::from_secs(1));
//! assert_eq!(sum(1000, &over), Err(Stopped));
//! ```
#![forbid(unsafe_code)]

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Receives the name of a phase and the share of it that is done, from 0 to 1.
pub type Progress<'a> = dyn Fn(&str, f64) + Sync + 'a;

/// Cancellation, deadline and progress of a stage; the default has none of the three.
#[derive(Clone, Copy, Default)]
pub struct Control<'a> {
    /// Flag that another thread sets to end the work.
    pub cancelled: Option<&'a AtomicBool>,
    /// Instant at which the work ends.
    pub deadline: Option<Instant>,
    /// Callback that receives the phase and the share of it that is done.
    pub progress: Option<&'a Progress<'a>>,
}

/// The work was cancelled or reached its deadline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("stopped")]
pub struct Stopped;

impl Control<'_> {
    /// Ends the work at this instant, or at the present deadline if that is earlier.
    #[must_use]
    pub fn until(self, deadline: Instant) -> Self {
        let deadline = self.deadline.map_or(deadline, |own| own.min(deadline));
        Self {
            deadline: Some(deadline),
            ..self
        }
    }

    /// Ends the work this many seconds from now, or at the present deadline if that is earlier;
    /// infinity sets no limit.
    #[must_use]
    pub fn for_seconds(self, seconds: f64) -> Self {
        let time = Duration::try_from_secs_f64(seconds.max(0.0)).ok();
        match time.and_then(|time| Instant::now().checked_add(time)) {
            Some(end) => self.until(end),
            None => self,
        }
    }

    /// Returns true if the work has to end now.
    pub fn is_stopped(&self) -> bool {
        let is_set = |flag: &AtomicBool| flag.load(Ordering::Relaxed);
        self.cancelled.is_some_and(is_set) || self.is_late()
    }

    /// Returns true if the deadline has passed.
    pub fn is_late(&self) -> bool {
        self.deadline.is_some_and(|end| Instant::now() >= end)
    }

    /// Returns the error that ends the work, for `?`.
    ///
    /// # Errors
    /// [`Stopped`] once the work has to end.
    pub fn check(&self) -> Result<(), Stopped> {
        if self.is_stopped() {
            Err(Stopped)
        } else {
            Ok(())
        }
    }

    /// Reports which share of a phase is done, from 0 to 1.
    pub fn report(&self, phase: &str, done: f64) {
        if let Some(progress) = self.progress {
            progress(phase, done);
        }
    }

    /// Reports the beginning of a phase.
    ///
    /// # Errors
    /// [`Stopped`] once the work has to end.
    pub fn begin(&self, phase: &str) -> Result<(), Stopped> {
        self.report(phase, 0.0);
        self.check()
    }
}

impl std::fmt::Debug for Control<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Control")
            .field("cancelled", &self.cancelled)
            .field("deadline", &self.deadline)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn a_flag_and_a_deadline_end_the_work() {
        let flag = AtomicBool::new(false);
        let control = Control {
            cancelled: Some(&flag),
            ..Control::default()
        };
        assert_eq!(control.check(), Ok(()));
        flag.store(true, Ordering::Relaxed);
        assert_eq!(control.check(), Err(Stopped));
        let now = Instant::now();
        assert!(Control::default().until(now).is_stopped());
    }

    #[test]
    fn the_earlier_deadline_counts() {
        let now = Instant::now();
        let late = now + Duration::from_secs(3600);
        let both = Control::default().until(late).until(now);
        assert_eq!(both.deadline, Some(now));
        assert_eq!(both.until(late).deadline, Some(now));
    }

    #[test]
    fn seconds_may_be_infinite_or_none() {
        let control = Control::default();
        assert_eq!(control.for_seconds(f64::INFINITY).deadline, None);
        assert_eq!(control.for_seconds(1e300).deadline, None);
        assert!(control.for_seconds(0.0).is_stopped());
        assert!(control.for_seconds(-1.0).is_stopped());
        assert!(!control.for_seconds(3600.0).is_stopped());
    }

    #[test]
    fn progress_hears_of_phases() {
        let heard = Mutex::new(Vec::new());
        let hear = |phase: &str, done: f64| {
            if let Ok(mut heard) = heard.lock() {
                heard.push((phase.to_owned(), done));
            }
        };
        let control = Control {
            progress: Some(&hear),
            ..Control::default()
        };
        assert_eq!(control.begin("search"), Ok(()));
        control.report("search", 0.5);
        let heard = heard.into_inner().unwrap_or_default();
        assert_eq!(
            heard,
            [("search".to_owned(), 0.0), ("search".to_owned(), 0.5)]
        );
    }
}
