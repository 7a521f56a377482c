//! Checks of the control in inner loops, where a check in each step would take longer than the
//! step.

use isoform_control::{Control, Stopped};
use std::cell::Cell;

/// Counter of steps that checks the control every 256th step. Once stopped, it stays stopped.
pub(super) struct StepCounter<'a> {
    control: &'a Control<'a>,
    steps: Cell<usize>,
    is_over: Cell<bool>,
}

impl<'a> StepCounter<'a> {
    pub(super) fn new(control: &'a Control<'a>) -> Self {
        Self {
            control,
            steps: Cell::new(0),
            is_over: Cell::new(false),
        }
    }
    /// Counts a step. Returns true if the work has to end.
    pub(super) fn is_over(&self) -> bool {
        let steps = self.steps.get() + 1;
        self.steps.set(steps);
        // A step may take as long as a list of some thousand neighbours makes it: 256 of them take
        // milliseconds.
        if steps.is_multiple_of(256) && self.control.is_stopped() {
            self.is_over.set(true);
        }
        self.is_over.get()
    }
    /// Counts a step. Returns an error if the work has to end.
    pub(super) fn check(&self) -> Result<(), Stopped> {
        if self.is_over() { Err(Stopped) } else { Ok(()) }
    }
}
