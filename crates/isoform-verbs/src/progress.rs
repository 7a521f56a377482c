//! Progress on stderr: one bar on a terminal, one line per phase elsewhere, nothing with --quiet.
//!
//! A verb of several stages has one bar for all of them ([`Whole`]). How often a fit searches is not
//! known before, so that each stretch of work takes a share of what is left: the bar slows down, but
//! never goes back.

use std::io::{self, IsTerminal, Write};
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

/// Function that receives the name of a phase and the share of it that is done, 0 to 1.
pub type OnProgress = dyn Fn(&str, f64) + Send + Sync;

/// A caller in place of a terminal: Python, or a page.
pub struct Listener {
    /// Set by the caller to end the work with the best so far.
    pub cancelled: Arc<AtomicBool>,
    /// Receives the progress.
    pub progress: Box<OnProgress>,
}

/// Letters of the bar: with its phase and number it fits a terminal of 40 columns. On one that is
/// narrower the bar would go on in the next line, and only that would be wiped.
const WIDTH: usize = 20;
/// The terminal's word for wiping from here to the end of the line (ECMA-48, EL).
const ERASE: &str = "\x1b[K";
/// Time between drawings of the bar.
const PAUSE: Duration = Duration::from_millis(80);

/// Share of what is left of a whole run that its next stretch of work gets.
const STRETCH: f64 = 0.4;

/// A bar that stands for all stages of a run.
#[derive(Default)]
struct Stretches {
    /// Phases so far, with the number of times that each began.
    phases: Vec<(String, usize)>,
    /// Place of the bar where the stretch of work at hand began, from 0 to 1.
    base: f64,
    /// Share of the stretch that is done.
    done: f64,
}

impl Stretches {
    /// The place of the bar, which never goes back: a phase of which less is done than of the one
    /// before it begins a new stretch.
    fn place(&mut self, done: f64, is_new: bool) -> f64 {
        if done < self.done && (is_new || done == 0.0) {
            self.base = self.at(self.done);
            self.done = done;
        }
        self.done = self.done.max(done);
        self.at(self.done)
    }
    /// The place of a share of the stretch at hand.
    fn at(&self, done: f64) -> f64 {
        self.base + (1.0 - self.base) * STRETCH * done.clamp(0.0, 1.0)
    }
    /// A phase begins; the number of times that it has begun.
    fn enter(&mut self, phase: &str) -> usize {
        match self.phases.iter_mut().find(|p| p.0 == phase) {
            Some((_, times)) => {
                *times += 1;
                *times
            }
            None => {
                self.phases.push((phase.to_owned(), 1));
                1
            }
        }
    }
}

/// State of the line on the terminal.
struct TerminalLine {
    /// Phase at hand.
    phase: String,
    /// Label of the phase in print: with its number if the phase was repeated.
    label: String,
    /// When the bar was drawn last.
    drawn: Option<Instant>,
    /// When the work began; short work shows no bar.
    started: Instant,
    /// The bar of a run of several stages.
    stretches: Option<Stretches>,
}

impl TerminalLine {
    /// Nothing yet.
    fn new(stretches: Option<Stretches>) -> Self {
        Self {
            phase: String::new(),
            label: String::new(),
            drawn: None,
            started: Instant::now(),
            stretches,
        }
    }
}

/// One bar for all stages of a run.
pub(crate) struct Whole(Arc<Mutex<TerminalLine>>);

impl Whole {
    pub(crate) fn new() -> Self {
        Self(Arc::new(Mutex::new(TerminalLine::new(Some(
            Stretches::default(),
        )))))
    }
}

/// Shows phases as they come.
pub(crate) struct Progress<'c> {
    /// Listener of the caller; `None` on a terminal.
    listener: Option<&'c Listener>,
    /// True if anything is shown, that is without --quiet.
    is_on: bool,
    /// True if stderr is a terminal, which has a bar.
    is_bar: bool,
    /// True if the bar is that of a run of several stages.
    is_whole: bool,
    shown: Arc<Mutex<TerminalLine>>,
}

impl<'c> Progress<'c> {
    /// Returns a progress that shows nothing yet; `whole` is the bar of a run of several stages.
    pub(crate) fn new(
        listener: Option<&'c Listener>,
        whole: Option<&Whole>,
        is_quiet: bool,
    ) -> Self {
        let shown = match whole {
            Some(whole) => Arc::clone(&whole.0),
            None => Arc::new(Mutex::new(TerminalLine::new(None))),
        };
        Self {
            listener,
            is_on: listener.is_none() && !is_quiet,
            is_bar: io::stderr().is_terminal(),
            is_whole: whole.is_some(),
            shown,
        }
    }

    /// Returns the progress of a stage of many short phases: in a run of several stages they move
    /// the bar, and print nothing elsewhere.
    pub(crate) fn of_short_phases(mut self) -> Self {
        self.is_on &= self.is_bar || !self.is_whole;
        self
    }

    /// A phase has got this far (0 to 1).
    pub(crate) fn show(&self, phase: &str, done: f64) {
        if let Some(listener) = self.listener {
            (listener.progress)(phase, done);
        }
        if !self.is_on {
            return;
        }
        // A thread that is late with its news may keep them.
        let Ok(mut shown) = self.shown.try_lock() else {
            return;
        };
        let shown = &mut *shown;
        let is_new = shown.phase != phase;
        let mut times = 1;
        if is_new {
            phase.clone_into(&mut shown.phase);
            phase.clone_into(&mut shown.label);
            if let Some(whole) = &mut shown.stretches {
                times = whole.enter(phase);
                if times > 1 {
                    shown.label = format!("{phase} {times}");
                }
            }
        }
        let done = match &mut shown.stretches {
            Some(whole) => whole.place(done, is_new),
            None => done,
        };
        if !self.is_bar {
            if is_new && times == 1 {
                let _ = writeln!(io::stderr().lock(), "{phase} ...");
            }
        } else if shown.started.elapsed() > PAUSE
            && (is_new || shown.drawn.is_none_or(|t| t.elapsed() > PAUSE))
        {
            shown.drawn = Some(Instant::now());
            let full = (done.clamp(0.0, 1.0) * WIDTH as f64) as usize;
            let _ = write!(
                io::stderr().lock(),
                "\r{ERASE}{:<10.10} [{}{}] {:3.0} %",
                shown.label,
                "#".repeat(full),
                ".".repeat(WIDTH - full),
                100.0 * done
            );
        }
    }
}

impl Progress<'_> {
    /// Does some work of which nobody knows how much it is, and shows meanwhile which share of the
    /// time limit is over.
    pub(crate) fn during<T>(
        &self,
        phase: &str,
        limit: Option<Duration>,
        work: impl FnOnce() -> T,
    ) -> T {
        self.show(phase, 0.0);
        if !(self.is_on && self.is_bar) {
            return work();
        }
        let clock = Instant::now();
        let share = move || limit.map_or(0.0, |limit| clock.elapsed().div_duration_f64(limit));
        thread::scope(|scope| {
            // Dropped when the work ends, by a panic, too.
            let (working, over) = mpsc::channel::<()>();
            scope.spawn(move || {
                while over.recv_timeout(PAUSE) == Err(RecvTimeoutError::Timeout) {
                    self.show(phase, share());
                }
            });
            let result = work();
            drop(working);
            result
        })
    }
}

impl Drop for Progress<'_> {
    /// Wipes the bar, so that what follows begins on an empty line.
    fn drop(&mut self) {
        let is_drawn = |shown: &Mutex<TerminalLine>| shown.lock().is_ok_and(|s| s.drawn.is_some());
        if self.is_on && self.is_bar && is_drawn(&self.shown) {
            let _ = write!(io::stderr().lock(), "\r{ERASE}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_of_a_whole_run_never_goes_back() {
        let mut whole = Stretches::default();
        let (mut before, mut last) = (0.0, String::new());
        let attempt = [
            ("search", 0.0),
            ("search", 0.5),
            ("search", 0.99),
            ("polish", 0.0),
            ("polish", 0.3),
        ];
        let attempts = std::iter::repeat_n(attempt, 12).flatten();
        let solid = (0..21).map(|k| (["check", "lattice"][k % 2], k as f64 / 21.0));
        let mut times = 0;
        for (phase, done) in [("recognize", 0.0), ("recognize", 0.9)]
            .into_iter()
            .chain(attempts)
            .chain(solid)
        {
            let is_new = phase != last;
            if is_new {
                last = phase.to_owned();
                times = whole.enter(phase);
            }
            let place = whole.place(done, is_new);
            assert!(
                place >= before && place < 1.0,
                "{phase} {done}: {place} after {before}"
            );
            before = place;
        }
        assert_eq!(whole.phases[1], ("search".to_owned(), 12));
        assert!(times > 1 && before > 0.9);
    }
}
