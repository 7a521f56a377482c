//! Progress of phases that may be repeated: reported fractions never decrease.

use isoform_control::Control;
use std::sync::Mutex;

/// Relay of progress that reports the largest fraction of each phase so far: seeds without a patch
/// are followed by others, which begin with the first phase again.
pub(crate) struct MonotoneProgress<'a> {
    control: &'a Control<'a>,
    /// Phases reported so far, with their largest fractions.
    told: Mutex<Vec<(String, f64)>>,
}

impl<'a> MonotoneProgress<'a> {
    /// Runs `work` under a control whose fractions never decrease.
    pub(crate) fn during<T>(control: &'a Control<'a>, work: impl FnOnce(&Control<'_>) -> T) -> T {
        let rising = Self {
            control,
            told: Mutex::default(),
        };
        let hear = |phase: &str, done: f64| rising.tell(phase, done);
        work(&Control {
            progress: control.progress.is_some().then_some(&hear as _),
            ..*control
        })
    }

    fn tell(&self, phase: &str, done: f64) {
        let Ok(mut told) = self.told.lock() else {
            return;
        };
        let share = match told.iter_mut().find(|known| known.0 == phase) {
            Some(known) => {
                known.1 = known.1.max(done.min(1.0));
                known.1
            }
            None => {
                let share = done.clamp(0.0, 1.0);
                told.push((phase.to_owned(), share));
                share
            }
        };
        self.control.report(phase, share);
    }
}
