//! Looks at the control from inner loops, where a look at each step would take longer than the step.

use isoform_control::{Control, Stopped};
use std::cell::Cell;

/// The number of steps between two looks at the control: steps that take as long as a list of some
/// thousand neighbours makes them are done in milliseconds.
const STEPS: usize = 256;

/// Counts steps, and looks at the control every so many of them. What is over stays so.
pub(super) struct Breath<'a> {
    control: &'a Control<'a>,
    steps: Cell<usize>,
    is_over: Cell<bool>,
}

impl<'a> Breath<'a> {
    pub(super) fn new(control: &'a Control<'a>) -> Self {
        Self {
            control,
            steps: Cell::new(0),
            is_over: Cell::new(false),
        }
    }
    /// Counts a step: whether the work has to end.
    pub(super) fn is_over(&self) -> bool {
        let steps = self.steps.get() + 1;
        self.steps.set(steps);
        if steps.is_multiple_of(STEPS) && self.control.is_stopped() {
            self.is_over.set(true);
        }
        self.is_over.get()
    }
    /// Counts a step: the error that ends the work.
    pub(super) fn check(&self) -> Result<(), Stopped> {
        if self.is_over() { Err(Stopped) } else { Ok(()) }
    }
}
