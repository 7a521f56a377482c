//! Times by phase.

use std::time::Instant;

/// Times of phases in seconds, in the order in which the phases began.
#[derive(Clone, Debug, Default)]
pub(crate) struct Seconds(pub(crate) Vec<(&'static str, f64)>);

impl Seconds {
    /// Adds time to a phase, which several stages may share.
    pub(crate) fn add(&mut self, phase: &'static str, seconds: f64) {
        match self.0.iter_mut().find(|(p, _)| *p == phase) {
            Some((_, s)) => *s += seconds,
            None => self.0.push((phase, seconds)),
        }
    }

    /// Adds the times of phases to those of equal names.
    pub(crate) fn add_all(&mut self, more: &[(&'static str, f64)]) {
        for (phase, seconds) in more {
            self.add(phase, *seconds);
        }
    }
}

/// A clock for consecutive phases.
#[derive(Clone, Debug)]
pub(crate) struct Clock {
    last: Instant,
    pub(crate) seconds: Seconds,
}

impl Clock {
    pub(crate) fn new() -> Self {
        Self::after(Seconds::default())
    }

    /// Starts a clock with the times of earlier phases.
    pub(crate) fn after(seconds: Seconds) -> Self {
        Self {
            last: Instant::now(),
            seconds,
        }
    }

    /// Adds the time since the last lap to a phase.
    pub(crate) fn lap(&mut self, phase: &'static str) {
        let now = Instant::now();
        self.seconds.add(phase, (now - self.last).as_secs_f64());
        self.last = now;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_of_one_name_are_one() {
        let mut seconds = Seconds::default();
        seconds.add("search", 1.0);
        seconds.add("polish", 2.0);
        seconds.add_all(&[("search", 0.5), ("report", 3.0)]);
        assert_eq!(
            seconds.0,
            [("search", 1.5), ("polish", 2.0), ("report", 3.0)]
        );
    }
}
