//! How long work runs: without Python's lock, on threads of its own, with Ctrl-C and progress.
//!
//! The work goes to a pool of threads. The thread that called waits for it, and looks every
//! [`PAUSE`] whether Python has a signal for it, and what the work says of its progress. A signal,
//! or an exception out of the callback of progress, sets the flag that cancels the work; the
//! exception comes out once the work has ended.
//!
//! A call takes a pool that no other call uses, so that calls of several threads do not wait for
//! one another. Threads do not survive a fork: pools belong to the process that made them.

use crate::error::Trouble;
use isoform::Control;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Time between two looks at signals and progress.
const PAUSE: Duration = Duration::from_millis(40);
/// Bytes of stack of a thread: those of a program's first one. Trees of deeply nested models are
/// walked by recursion.
const STACK: usize = 8 << 20;
/// Pools that are kept for the next call.
const MOST_IDLE: usize = 8;

/// What every verb that takes time takes.
#[derive(Default)]
pub(crate) struct Asked<'py> {
    /// Threads to use; by default all cores.
    pub(crate) threads: Option<usize>,
    /// Seconds after which the work ends with the best so far.
    pub(crate) time_limit: Option<f64>,
    /// Is called with the phase and the share of it that is done.
    pub(crate) progress: Option<Bound<'py, PyAny>>,
}

impl<'py> FromPyObject<'_, 'py> for Asked<'py> {
    type Error = PyErr;

    /// From a tuple of threads, seconds and callback.
    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let (threads, time_limit, progress) = given.extract()?;
        Ok(Self {
            threads,
            time_limit,
            progress,
        })
    }
}

/// Does the work as long as nobody stops it; an exception of Python (a signal, or one out of the
/// callback) comes before what the work gives back.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    asked: &Asked<'_>,
    work: impl FnOnce(&Control<'_>) -> T + Send,
) -> PyResult<T> {
    let pool = Pool::take(asked.threads)?;
    let (stop, news) = (AtomicBool::new(false), News::default());
    let tell = |phase: &str, done: f64| news.tell(phase, done);
    let mut control = Control {
        cancelled: Some(&stop),
        ..Control::default()
    };
    let callback = asked.progress.as_ref().map(|p| p.clone().unbind());
    if callback.is_some() {
        control.progress = Some(&tell);
    }
    let control = asked.time_limit.map_or(control, |s| control.for_seconds(s));
    let listener = Listener {
        callback,
        news: &news,
        stop: &stop,
    };
    let (result, raised) = py.detach(|| {
        let (done, ended) = mpsc::sync_channel(1);
        pool.threads().in_place_scope(|scope| {
            let control = &control;
            scope.spawn(move |_| {
                let result = catch_unwind(AssertUnwindSafe(|| work(control)));
                // The one who waits for it is there until it comes.
                let _ = done.send(result);
            });
            listener.wait(&ended)
        })
    });
    pool.give_back();
    match (raised, result) {
        (Some(raised), _) => Err(raised),
        (None, Some(Ok(result))) => Ok(result),
        (None, _) => Err(Trouble::internal().into()),
    }
}

/// Does work without Python's lock that is over before anybody would stop it.
pub(crate) fn shortly<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let result = py.detach(|| catch_unwind(AssertUnwindSafe(work)));
    result.map_err(|_| Trouble::internal().into())
}

/// What the work last said of its progress, and the phases that have begun since it was heard.
#[derive(Default)]
struct News(Mutex<Vec<(String, f64)>>);

impl News {
    fn tell(&self, phase: &str, done: f64) {
        let mut news = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match news.last_mut().filter(|last| last.0 == phase) {
            Some(last) => last.1 = last.1.max(done),
            None => news.push((phase.to_owned(), done)),
        }
    }
    fn take(&self) -> Vec<(String, f64)> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// The thread that waits for the work.
struct Listener<'a> {
    callback: Option<Py<PyAny>>,
    news: &'a News,
    stop: &'a AtomicBool,
}

/// What work gives back, none where its thread is gone, and the exception that ended it.
type Waited<T> = (Option<std::thread::Result<T>>, Option<PyErr>);

impl Listener<'_> {
    /// Waits for the work, and listens meanwhile.
    fn wait<T>(&self, ended: &Receiver<std::thread::Result<T>>) -> Waited<T> {
        let mut raised = None;
        loop {
            let (result, over) = match ended.recv_timeout(PAUSE) {
                Ok(result) => (Some(result), true),
                Err(RecvTimeoutError::Timeout) => (None, false),
                Err(RecvTimeoutError::Disconnected) => (None, true),
            };
            if raised.is_none() {
                raised = self.listen().err();
            }
            if raised.is_some() {
                self.stop.store(true, Ordering::Relaxed);
            }
            if over {
                return (result, raised);
            }
        }
    }

    /// Passes progress on, and lets Python handle its signals.
    fn listen(&self) -> PyResult<()> {
        let news = self.news.take();
        Python::attach(|py| {
            for (phase, done) in news {
                let Some(callback) = &self.callback else {
                    break;
                };
                let answer = callback.call1(py, (phase, done.clamp(0.0, 1.0)))?;
                if answer.is(pyo3::types::PyBool::new(py, false)) {
                    self.stop.store(true, Ordering::Relaxed);
                }
            }
            py.check_signals()
        })
    }
}

/// Pools that no call uses, of the process that made them.
static IDLE: Mutex<Idle> = Mutex::new(Idle {
    process: 0,
    pools: Vec::new(),
});

struct Idle {
    process: u32,
    /// With their numbers of threads.
    pools: Vec<(usize, ThreadPool)>,
}

impl Idle {
    /// Forgets the pools of the process that this one was forked from: their threads do not exist
    /// here, and would be waited for.
    fn forget_others(&mut self) {
        let process = std::process::id();
        if self.process != process {
            self.process = process;
            std::mem::forget(std::mem::take(&mut self.pools));
        }
    }
}

/// A pool that one call uses.
struct Pool {
    size: usize,
    pool: ThreadPool,
}

impl Pool {
    /// A pool of that many threads, one for each core by default.
    fn take(threads: Option<usize>) -> PyResult<Self> {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let size = threads.unwrap_or_else(cores);
        if size == 0 || size > u16::MAX.into() {
            return Err(Trouble::usage(format!("{size} threads: at least 1 is needed")).into());
        }
        let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
        idle.forget_others();
        let place = idle.pools.iter().position(|(n, _)| *n == size);
        let kept = place.map(|place| idle.pools.swap_remove(place).1);
        drop(idle);
        let made = kept.map_or_else(
            || {
                ThreadPoolBuilder::new()
                    .num_threads(size)
                    .stack_size(STACK)
                    .build()
            },
            Ok,
        );
        let pool = made.map_err(|e| Trouble::new("threads", format!("no threads: {e}")))?;
        Ok(Self { size, pool })
    }

    fn threads(&self) -> &ThreadPool {
        &self.pool
    }

    /// Keeps the pool for the next call.
    fn give_back(self) {
        let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
        idle.forget_others();
        if idle.pools.len() < MOST_IDLE {
            idle.pools.push((self.size, self.pool));
        }
    }
}
