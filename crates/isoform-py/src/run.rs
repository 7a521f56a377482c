//! Execution of work: without Python's lock, on separate threads, with Ctrl-C and progress.
//!
//! The work runs in a thread pool. The calling thread waits for it; every [`POLL_INTERVAL`] it
//! checks for pending Python signals and passes on the progress of the work. A signal, or an
//! exception in the progress callback, sets the flag that cancels the work. The exception is raised
//! when the work has ended. Work started by [`run`] owns its data and is abandoned if it still runs
//! after [`CANCEL_TIMEOUT`].
//!
//! Each call takes a pool that no other call uses, so that concurrent calls do not wait for each
//! other. Threads do not survive a fork: pools belong to the process that created them.

use crate::error::CallError;
use isoform::Control;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Interval between checks for signals and progress.
const POLL_INTERVAL: Duration = Duration::from_millis(40);
/// Maximum time to wait for cancelled work; most work checks its flag more often.
const CANCEL_TIMEOUT: Duration = Duration::from_secs(1);
/// Stack size of a thread, in bytes: that of the main thread of a program. Trees of deeply nested
/// models are traversed recursively.
const STACK_BYTES: usize = 8 << 20;
/// Maximum number of idle pools kept for later calls.
const MAX_IDLE_POOLS: usize = 8;

/// Limits common to all calls that take time.
#[derive(Default)]
pub(crate) struct CallLimits<'py> {
    /// Number of threads; `None` for all cores.
    pub(crate) threads: Option<usize>,
    /// Time limit in seconds, after which the best result so far is returned.
    pub(crate) time_limit: Option<f64>,
    /// Callback that receives the phase and its completed share.
    pub(crate) progress: Option<Bound<'py, PyAny>>,
}

impl<'py> FromPyObject<'_, 'py> for CallLimits<'py> {
    type Error = PyErr;

    /// Converts a tuple of threads, seconds and callback.
    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let (threads, time_limit, progress) = given.extract()?;
        Ok(Self {
            threads,
            time_limit,
            progress,
        })
    }
}

/// State shared by the work and the thread that waits for it.
#[derive(Default)]
struct SharedState {
    stop: Arc<AtomicBool>,
    news: Arc<ProgressReports>,
    is_heard: bool,
}

impl SharedState {
    fn new(asked: &CallLimits<'_>) -> Self {
        Self {
            is_heard: asked.progress.is_some(),
            ..Self::default()
        }
    }

    /// Calls the work with a control, and catches a panic in it.
    fn call<T>(
        &self,
        limit: Option<f64>,
        work: impl FnOnce(&Control<'_>) -> T,
    ) -> std::thread::Result<T> {
        let tell = |phase: &str, done: f64| self.news.tell(phase, done);
        let mut control = Control {
            cancelled: Some(&self.stop),
            ..Control::default()
        };
        if self.is_heard {
            control.progress = Some(&tell);
        }
        let control = limit.map_or(control, |s| control.for_seconds(s));
        catch_unwind(AssertUnwindSafe(|| work(&control)))
    }
}

/// Runs work that owns its data. A Python exception (from a signal or from the callback) takes
/// precedence over the result.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    asked: &CallLimits<'_>,
    work: impl FnOnce(&Control<'_>) -> T + Send + 'static,
) -> PyResult<T> {
    owned(py, asked, SharedState::new(asked), work)
}

/// Runs work that owns its data, with the state shared with the waiting thread.
fn owned<T: Send + 'static>(
    py: Python<'_>,
    asked: &CallLimits<'_>,
    shared: SharedState,
    work: impl FnOnce(&Control<'_>) -> T + Send + 'static,
) -> PyResult<T> {
    let pool = CallPool::take(asked.threads)?;
    let shared = Arc::new(shared);
    let (done, ended) = mpsc::sync_channel(1);
    let (theirs, limit, held) = (shared.clone(), asked.time_limit, pool.clone());
    pool.threads.spawn(move || {
        let result = theirs.call(limit, work);
        // Only this thread knows that the pool is free again.
        held.give_back();
        // The receiver may have stopped waiting.
        let _ = done.send(result);
    });
    let listener = WorkListener::new(asked, &shared, Some(CANCEL_TIMEOUT));
    py.detach(move || listener.wait(&ended)).answer()
}

/// Runs a verb like [`run`]; its arguments contain the time limit.
pub(crate) fn listened<T: Send + 'static>(
    py: Python<'_>,
    asked: &CallLimits<'_>,
    work: impl FnOnce(isoform_verbs::Listener) -> T + Send + 'static,
) -> PyResult<T> {
    let unlimited = CallLimits {
        threads: asked.threads,
        time_limit: None,
        progress: asked.progress.clone(),
    };
    let shared = SharedState::new(asked);
    let (news, cancelled) = (shared.news.clone(), shared.stop.clone());
    let listener = isoform_verbs::Listener {
        cancelled,
        progress: Box::new(move |phase, done| news.tell(phase, done)),
    };
    owned(py, &unlimited, shared, move |_| work(listener))
}

/// Runs work that borrows its data and ends soon after cancellation.
pub(crate) fn scoped<T: Send>(
    py: Python<'_>,
    asked: &CallLimits<'_>,
    work: impl FnOnce(&Control<'_>) -> T + Send,
) -> PyResult<T> {
    let pool = CallPool::take(asked.threads)?;
    let shared = SharedState::new(asked);
    let (done, ended) = mpsc::sync_channel(1);
    let listener = WorkListener::new(asked, &shared, None);
    let limit = asked.time_limit;
    let (threads, shared) = (&pool.threads, &shared);
    let waited = py.detach(move || {
        threads.in_place_scope(move |scope| {
            scope.spawn(move |_| {
                // The receiver waits until the result is sent.
                let _ = done.send(shared.call(limit, work));
            });
            listener.wait(&ended)
        })
    });
    pool.give_back();
    waited.answer()
}

/// Runs short work without Python's lock; it cannot be cancelled.
pub(crate) fn shortly<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let result = py.detach(|| catch_unwind(AssertUnwindSafe(work)));
    result.map_err(|_| CallError::internal().into())
}

/// Latest progress of the work, with the phases begun since the last report.
#[derive(Default)]
struct ProgressReports(Mutex<Vec<(String, f64)>>);

impl ProgressReports {
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

/// State of the thread that waits for the work.
struct WorkListener<'a> {
    callback: Option<Py<PyAny>>,
    shared: &'a SharedState,
    patience: Option<Duration>,
}

/// Outcome of waiting.
struct WaitOutcome<T> {
    /// Result of the work; `None` if its thread has vanished or the work was abandoned.
    result: Option<std::thread::Result<T>>,
    /// Python exception that ended the work.
    raised: Option<PyErr>,
}

impl<T> WaitOutcome<T> {
    fn answer(self) -> PyResult<T> {
        match (self.raised, self.result) {
            (Some(raised), _) => Err(raised),
            (None, Some(Ok(result))) => Ok(result),
            (None, _) => Err(CallError::internal().into()),
        }
    }
}

impl<'a> WorkListener<'a> {
    fn new(asked: &CallLimits<'_>, shared: &'a SharedState, patience: Option<Duration>) -> Self {
        let callback = asked.progress.as_ref().map(|p| p.clone().unbind());
        Self {
            callback,
            shared,
            patience,
        }
    }

    /// Waits for the work, and handles signals and progress meanwhile.
    fn wait<T>(&self, ended: &Receiver<std::thread::Result<T>>) -> WaitOutcome<T> {
        let (mut raised, mut since) = (None, None);
        loop {
            let (result, mut is_over) = match ended.recv_timeout(POLL_INTERVAL) {
                Ok(result) => (Some(result), true),
                Err(RecvTimeoutError::Timeout) => (None, false),
                Err(RecvTimeoutError::Disconnected) => (None, true),
            };
            if raised.is_none() {
                raised = self.listen().err();
            }
            if raised.is_some() {
                self.shared.stop.store(true, Ordering::Relaxed);
                let waited = since.get_or_insert_with(Instant::now).elapsed();
                is_over |= self.patience.is_some_and(|patience| waited >= patience);
            }
            if is_over {
                return WaitOutcome { result, raised };
            }
        }
    }

    /// Passes on progress, and lets Python handle its signals.
    fn listen(&self) -> PyResult<()> {
        let news = self.shared.news.take();
        Python::attach(|py| {
            for (phase, done) in news {
                let Some(callback) = &self.callback else {
                    break;
                };
                let answer = callback.call1(py, (phase, done.clamp(0.0, 1.0)))?;
                if answer.is(pyo3::types::PyBool::new(py, false)) {
                    self.shared.stop.store(true, Ordering::Relaxed);
                }
            }
            py.check_signals()
        })
    }
}

/// Idle pools of the process that created them.
static IDLE_POOLS: Mutex<IdlePools> = Mutex::new(IdlePools {
    process: 0,
    pools: Vec::new(),
});

struct IdlePools {
    process: u32,
    pools: Vec<CallPool>,
}

impl IdlePools {
    /// Discards pools of a parent process after a fork: their threads do not exist in this process,
    /// so dropping the pools would wait forever.
    fn forget_others(&mut self) {
        let process = std::process::id();
        if self.process != process {
            self.process = process;
            std::mem::forget(std::mem::take(&mut self.pools));
        }
    }
}

/// Thread pool used by one call.
#[derive(Clone)]
struct CallPool {
    size: usize,
    threads: Arc<ThreadPool>,
}

impl CallPool {
    /// Takes a pool with this number of threads; by default one per core.
    fn take(threads: Option<usize>) -> PyResult<Self> {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let size = threads.unwrap_or_else(cores);
        if size == 0 || size > u16::MAX.into() {
            return Err(CallError::usage(format!("{size} threads: at least 1 is needed")).into());
        }
        match Self::kept(size) {
            Some(pool) => Ok(pool),
            None => Ok(Self::new(size)?),
        }
    }

    /// Takes an idle pool of this size; `None` if there is none.
    fn kept(size: usize) -> Option<Self> {
        let mut idle = IDLE_POOLS.lock().unwrap_or_else(PoisonError::into_inner);
        idle.forget_others();
        let place = idle.pools.iter().position(|pool| pool.size == size)?;
        Some(idle.pools.swap_remove(place))
    }

    fn new(size: usize) -> Result<Self, CallError> {
        let builder = ThreadPoolBuilder::new()
            .num_threads(size)
            .stack_size(STACK_BYTES);
        let made = builder.build();
        let threads = made.map_err(|e| CallError::new("threads", format!("no threads: {e}")))?;
        let threads = Arc::new(threads);
        Ok(Self { size, threads })
    }

    /// Keeps the pool for the next call.
    fn give_back(self) {
        let mut idle = IDLE_POOLS.lock().unwrap_or_else(PoisonError::into_inner);
        idle.forget_others();
        if idle.pools.len() < MAX_IDLE_POOLS {
            idle.pools.push(self);
        }
    }
}
