//! Progress on stderr: one bar on a terminal, one line per phase elsewhere, nothing with --quiet.

use crate::output::Context;
use std::io::{self, IsTerminal, Write};
use std::sync::Mutex;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::{Duration, Instant};

/// Letters of the bar: with its phase and number it fits a terminal of 40 columns. On one that is
/// narrower the bar would go on in the next line, and only that would be wiped.
const WIDTH: usize = 20;
/// The terminal's word for wiping from here to the end of the line (ECMA-48, EL).
const ERASE: &str = "\x1b[K";
/// Time between drawings of the bar.
const PAUSE: Duration = Duration::from_millis(80);

/// What is on the terminal.
struct Shown {
    /// Phase at hand.
    phase: String,
    /// When the bar was drawn last.
    drawn: Option<Instant>,
    /// When the work began; short work shows no bar.
    started: Instant,
}

/// Shows phases as they come.
pub(crate) struct Progress {
    /// Whether anything is shown, that is without --quiet.
    is_on: bool,
    /// Whether stderr is a terminal, which has a bar.
    is_bar: bool,
    shown: Mutex<Shown>,
}

impl Progress {
    /// Shows nothing yet.
    pub(crate) fn new(context: &Context) -> Self {
        let is_bar = io::stderr().is_terminal();
        let shown = Mutex::new(Shown {
            phase: String::new(),
            drawn: None,
            started: Instant::now(),
        });
        Self {
            is_on: !context.global.quiet,
            is_bar,
            shown,
        }
    }

    /// A phase has got this far (0 to 1).
    pub(crate) fn show(&self, phase: &str, done: f64) {
        if !self.is_on {
            return;
        }
        // A thread that is late with its news may keep them.
        let Ok(mut shown) = self.shown.try_lock() else {
            return;
        };
        let is_new = shown.phase != phase;
        if is_new {
            phase.clone_into(&mut shown.phase);
        }
        if !self.is_bar {
            if is_new {
                let _ = writeln!(io::stderr().lock(), "{phase} ...");
            }
        } else if shown.started.elapsed() > PAUSE
            && (is_new || shown.drawn.is_none_or(|t| t.elapsed() > PAUSE))
        {
            shown.drawn = Some(Instant::now());
            let full = (done.clamp(0.0, 1.0) * WIDTH as f64) as usize;
            let _ = write!(
                io::stderr().lock(),
                "\r{ERASE}{phase:<10.10} [{}{}] {:3.0} %",
                "#".repeat(full),
                ".".repeat(WIDTH - full),
                100.0 * done
            );
        }
    }
}

impl Progress {
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

impl Drop for Progress {
    /// Wipes the bar, so that what follows begins on an empty line.
    fn drop(&mut self) {
        if self.is_on && self.is_bar && self.shown.get_mut().is_ok_and(|s| s.drawn.is_some()) {
            let _ = write!(io::stderr().lock(), "\r{ERASE}");
        }
    }
}
