//! Global options and the context of a run: limits, messages, the result in memory.

use crate::failure::Failure;
use crate::inputs::Inputs;
use crate::interrupt;
use crate::memory;
use crate::outcome::document;
use crate::product::Product;
use crate::progress::{Listener, Progress, Whole};
use crate::terminal::{say, to_stdout};
use crate::watchdog;
use clap::ArgAction;
use isoform::Control;
use serde_json::Value;
use std::fmt::Display;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Seed of everything random unless another is given.
const DEFAULT_SEED: u64 = 1;
/// Bytes of stack of a thread: those that Linux gives to a program's first one. Trees of deeply
/// nested models are walked by recursion.
const STACK: usize = 8 << 20;

#[derive(clap::Args)]
#[command(next_help_heading = crate::help::COMMON)]
pub(crate) struct Global {
    /// Make stdout exactly one JSON document, on failure too
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Number of threads; results do not depend on it [default: all cores]
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) threads: Option<u16>,
    /// Seed of everything random
    #[arg(long, global = true, value_name = "N", default_value_t = DEFAULT_SEED)]
    pub(crate) seed: u64,
    /// Say nothing on stderr but errors
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
    /// Say more on stderr
    #[arg(short, long, global = true, action = ArgAction::Count)]
    pub(crate) verbose: u8,
    /// Let results overwrite the files that they come from, and recover make the solid of a fit that
    /// is in doubt
    #[arg(long, global = true)]
    pub(crate) force: bool,
    /// Stop after this time with the best so far: 30s, 2m, 1h
    #[arg(long, global = true, value_name = "TIME", value_parser = duration)]
    pub(crate) time_limit: Option<Duration>,
}

impl Default for Global {
    fn default() -> Self {
        Self {
            json: false,
            threads: None,
            seed: DEFAULT_SEED,
            quiet: false,
            verbose: 0,
            force: false,
            time_limit: None,
        }
    }
}

/// Returns the builder of a pool of as many threads, by default one for each core. As WebAssembly,
/// which starts no thread, it has the thread at hand.
pub(crate) fn pool(threads: Option<u16>) -> rayon::ThreadPoolBuilder {
    let pool = rayon::ThreadPoolBuilder::new().stack_size(STACK);
    match cfg!(target_family = "wasm") {
        true => pool.num_threads(1).use_current_thread(),
        false => pool.num_threads(threads.map_or(0, usize::from)),
    }
}

/// Reads a time: a number with ms, s, m or h behind it, seconds without.
fn duration(text: &str) -> Result<Duration, String> {
    let (number, unit) = match text.trim_end_matches(|c: char| c.is_ascii_alphabetic()) {
        number if number.len() == text.len() => (text, "s"),
        number => text.split_at(number.len()),
    };
    let scale = match unit {
        "ms" => 1e-3,
        "s" => 1.0,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        _ => return Err(format!("`{unit}` is no unit of time; ms, s, m and h are")),
    };
    let seconds = number
        .parse::<f64>()
        .map_err(|_| format!("`{number}` is not a number"))?
        * scale;
    Duration::try_from_secs_f64(seconds).map_err(|e| e.to_string())
}

/// The settings of this run.
pub(crate) struct Context {
    /// Options that all verbs share.
    pub(crate) global: Global,
    /// When to stop.
    pub(crate) deadline: Option<Instant>,
    /// Input files, which must not be overwritten.
    pub(crate) inputs: Inputs,
    /// One bar for all stages, of verbs that have several.
    pub(crate) whole: Option<Whole>,
    /// The caller's listener; `None` on a terminal.
    pub(crate) listener: Option<Listener>,
    /// Warnings so far, for a caller.
    warnings: Mutex<Vec<String>>,
    /// The result in memory, for a caller.
    product: Mutex<Option<Product>>,
}

impl Context {
    /// Returns the context of a run; `None` as listener stands for the terminal.
    pub(crate) fn new(global: Global, listener: Option<Listener>) -> Self {
        Self {
            deadline: global
                .time_limit
                .and_then(|t| Instant::now().checked_add(t)),
            global,
            inputs: Inputs::default(),
            whole: None,
            listener,
            warnings: Mutex::default(),
            product: Mutex::default(),
        }
    }
    /// Starts the watch over the time limit and the pool of threads of a program.
    pub(crate) fn begin(&self) {
        let global = &self.global;
        if let Some(limit) = global.time_limit {
            watchdog::watch(limit, global.json);
        }
        // Fails only if a pool exists already, and nothing has made one yet.
        let _ = pool(global.threads).build_global();
    }
    /// Ends work at Ctrl-C and at the time limit.
    pub(crate) fn control(&self) -> Control<'_> {
        Control {
            cancelled: Some(match &self.listener {
                Some(listener) => &listener.cancelled,
                None => interrupt::watch(),
            }),
            deadline: self.deadline,
            progress: match &self.listener {
                Some(listener) => Some(&*listener.progress),
                None => None,
            },
        }
    }
    /// Returns true if the time limit is over.
    pub(crate) fn is_late(&self) -> bool {
        self.deadline.is_some_and(|d| Instant::now() >= d)
    }
    /// A line on stderr about something that may be wrong.
    pub(crate) fn warn(&self, message: impl Display) {
        if self.listener.is_some() {
            let mut warnings = self.warnings.lock().unwrap_or_else(PoisonError::into_inner);
            warnings.push(memory::plain(&message.to_string()));
        } else if !self.global.quiet {
            say(format_args!("warning: {message}"));
        }
    }
    /// A line on stderr about what is going on.
    pub(crate) fn say(&self, message: impl Display) {
        if self.listener.is_none() && !self.global.quiet {
            say(message);
        }
    }
    /// A line on stderr about what is going on, with -v.
    pub(crate) fn note(&self, message: impl Display) {
        if self.global.verbose > 0 {
            self.say(message);
        }
    }
    /// Says why a part of the work has no result, where the rest has one.
    pub(crate) fn complain(&self, failure: &Failure) {
        match self.listener {
            Some(_) => self.warn(&failure.message),
            None => say(failure.text()),
        }
    }
    /// Prints a message before the work is done: the text, or the document with --json.
    pub(crate) fn announce(&self, json: Value, text: String) -> Result<(), Failure> {
        if self.listener.is_some() {
            return Ok(());
        }
        let bytes = if self.global.json {
            document(true, json)
        } else {
            text.into_bytes()
        };
        to_stdout(&bytes).map_err(|e| Failure::file(Path::new("stdout"), "write", &e))
    }
    /// Returns the progress of a stage.
    pub(crate) fn progress(&self) -> Progress<'_> {
        Progress::new(
            self.listener.as_ref(),
            self.whole.as_ref(),
            self.global.quiet,
        )
    }
    /// Hands the result over to a caller, who may want more of it than its document.
    pub(crate) fn hand_over(&self, product: impl FnOnce() -> Product) {
        if self.listener.is_some() {
            let mut held = self.product.lock().unwrap_or_else(PoisonError::into_inner);
            *held = Some(product());
        }
    }
    /// Returns what was handed over, and the warnings.
    pub(crate) fn into_parts(self) -> (Option<Product>, Vec<String>) {
        let product = self.product.into_inner();
        let warnings = self.warnings.into_inner();
        (
            product.unwrap_or_else(PoisonError::into_inner),
            warnings.unwrap_or_else(PoisonError::into_inner),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations() {
        assert_eq!(duration("30s"), Ok(Duration::from_secs(30)));
        assert_eq!(duration("1.5m"), Ok(Duration::from_secs(90)));
        assert_eq!(duration("250ms"), Ok(Duration::from_millis(250)));
        assert_eq!(duration("7"), Ok(Duration::from_secs(7)));
        for bad in ["", "s", "1y", "-1s", "1e999s"] {
            assert!(duration(bad).is_err(), "{bad}");
        }
    }
}
