//! Recorder of progress reports.

use std::sync::{Mutex, PoisonError};

/// Returns the phases that `work` reports to the callback it is given, in the order in which they
/// began, each with its reported shares.
///
/// # Panics
/// If the shares of a phase decrease, or its last share is not 1.
pub fn shares_told(work: impl FnOnce(&(dyn Fn(&str, f64) + Sync))) -> Vec<(String, Vec<f64>)> {
    let told: Mutex<Vec<(String, Vec<f64>)>> = Mutex::default();
    work(&|phase, done| {
        let mut told = told.lock().unwrap_or_else(PoisonError::into_inner);
        match told.iter_mut().find(|(known, _)| known == phase) {
            Some((_, shares)) => shares.push(done),
            None => told.push((phase.to_owned(), vec![done])),
        }
    });
    let told = told.into_inner().unwrap_or_else(PoisonError::into_inner);
    for (phase, shares) in &told {
        assert!(shares.is_sorted(), "{phase}: {shares:?}");
        assert_eq!(shares.last(), Some(&1.0), "{phase}");
    }
    told
}
