//! How long work runs: without Python's lock, on threads of its own, with Ctrl-C and progress.
//!
//! The work goes to a pool of threads. The thread that called waits for it, and looks every
//! [`PAUSE`] whether Python has a signal for it, and what the work says of its progress. A signal,
//! or an exception out of the callback of progress, sets the flag that cancels the work. The
//! exception comes out once the work has ended; work that [`run`] does, which owns what it works
//! on, is left to itself where it has not ended after [`PATIENCE`].
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
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time between two looks at signals and progress.
const PAUSE: Duration = Duration::from_millis(40);
/// How long work may go on after an exception: most of it looks at its flag more often, and ends.
const PATIENCE: Duration = Duration::from_secs(1);
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

/// What the work and the thread that waits for it share.
#[derive(Default)]
struct Shared {
    stop: Arc<AtomicBool>,
    news: Arc<News>,
    is_heard: bool,
}

impl Shared {
    fn new(asked: &Asked<'_>) -> Self {
        Self {
            is_heard: asked.progress.is_some(),
            ..Self::default()
        }
    }

    /// Calls the work with a control; a panic in it is caught.
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

/// Does work that owns what it works on, as long as nobody stops it; an exception of Python (a
/// signal, or one out of the callback) comes before what the work gives back.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    asked: &Asked<'_>,
    work: impl FnOnce(&Control<'_>) -> T + Send + 'static,
) -> PyResult<T> {
    owned(py, asked, Shared::new(asked), work)
}

/// Does work that owns what it works on, with what it shares with the thread that waits.
fn owned<T: Send + 'static>(
    py: Python<'_>,
    asked: &Asked<'_>,
    shared: Shared,
    work: impl FnOnce(&Control<'_>) -> T + Send + 'static,
) -> PyResult<T> {
    let pool = Pool::take(asked.threads)?;
    let shared = Arc::new(shared);
    let (done, ended) = mpsc::sync_channel(1);
    let (theirs, limit, held) = (shared.clone(), asked.time_limit, pool.clone());
    pool.threads.spawn(move || {
        let result = theirs.call(limit, work);
        // Nobody else would know that the pool is free again.
        held.give_back();
        // Nobody may wait for it any more.
        let _ = done.send(result);
    });
    let listener = Listener::new(asked, &shared, Some(PATIENCE));
    py.detach(move || listener.wait(&ended)).answer()
}

/// The same for a verb, which is told of the time limit by its arguments.
pub(crate) fn listened<T: Send + 'static>(
    py: Python<'_>,
    asked: &Asked<'_>,
    work: impl FnOnce(isoform_verbs::Listener) -> T + Send + 'static,
) -> PyResult<T> {
    let unlimited = Asked {
        threads: asked.threads,
        time_limit: None,
        progress: asked.progress.clone(),
    };
    let shared = Shared::new(asked);
    let (news, cancelled) = (shared.news.clone(), shared.stop.clone());
    let listener = isoform_verbs::Listener {
        cancelled,
        progress: Box::new(move |phase, done| news.tell(phase, done)),
    };
    owned(py, &unlimited, shared, move |_| work(listener))
}

/// The same for work that borrows what it works on, and ends soon once it is cancelled.
pub(crate) fn scoped<T: Send>(
    py: Python<'_>,
    asked: &Asked<'_>,
    work: impl FnOnce(&Control<'_>) -> T + Send,
) -> PyResult<T> {
    let pool = Pool::take(asked.threads)?;
    let shared = Shared::new(asked);
    let (done, ended) = mpsc::sync_channel(1);
    let listener = Listener::new(asked, &shared, None);
    let limit = asked.time_limit;
    let (threads, shared) = (&pool.threads, &shared);
    let waited = py.detach(move || {
        threads.in_place_scope(move |scope| {
            scope.spawn(move |_| {
                // The one who waits for it is there until it comes.
                let _ = done.send(shared.call(limit, work));
            });
            listener.wait(&ended)
        })
    });
    pool.give_back();
    waited.answer()
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
    shared: &'a Shared,
    patience: Option<Duration>,
}

/// What came of waiting.
struct Waited<T> {
    /// What the work gives back; none where its thread is gone, or it is waited for no more.
    result: Option<std::thread::Result<T>>,
    /// The exception that ended it.
    raised: Option<PyErr>,
}

impl<T> Waited<T> {
    fn answer(self) -> PyResult<T> {
        match (self.raised, self.result) {
            (Some(raised), _) => Err(raised),
            (None, Some(Ok(result))) => Ok(result),
            (None, _) => Err(Trouble::internal().into()),
        }
    }
}

impl<'a> Listener<'a> {
    fn new(asked: &Asked<'_>, shared: &'a Shared, patience: Option<Duration>) -> Self {
        let callback = asked.progress.as_ref().map(|p| p.clone().unbind());
        Self {
            callback,
            shared,
            patience,
        }
    }

    /// Waits for the work, and listens meanwhile.
    fn wait<T>(&self, ended: &Receiver<std::thread::Result<T>>) -> Waited<T> {
        let (mut raised, mut since) = (None, None);
        loop {
            let (result, mut is_over) = match ended.recv_timeout(PAUSE) {
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
                return Waited { result, raised };
            }
        }
    }

    /// Passes progress on, and lets Python handle its signals.
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

/// Pools that no call uses, of the process that made them.
static IDLE: Mutex<Idle> = Mutex::new(Idle {
    process: 0,
    pools: Vec::new(),
});

struct Idle {
    process: u32,
    pools: Vec<Pool>,
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
#[derive(Clone)]
struct Pool {
    size: usize,
    threads: Arc<ThreadPool>,
}

impl Pool {
    /// A pool of that many threads, one for each core by default.
    fn take(threads: Option<usize>) -> PyResult<Self> {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let size = threads.unwrap_or_else(cores);
        if size == 0 || size > u16::MAX.into() {
            return Err(Trouble::usage(format!("{size} threads: at least 1 is needed")).into());
        }
        match Self::kept(size) {
            Some(pool) => Ok(pool),
            None => Ok(Self::new(size)?),
        }
    }

    /// A pool that was kept.
    fn kept(size: usize) -> Option<Self> {
        let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
        idle.forget_others();
        let place = idle.pools.iter().position(|pool| pool.size == size)?;
        Some(idle.pools.swap_remove(place))
    }

    fn new(size: usize) -> Result<Self, Trouble> {
        let builder = ThreadPoolBuilder::new().num_threads(size).stack_size(STACK);
        let made = builder.build();
        let threads = made.map_err(|e| Trouble::new("threads", format!("no threads: {e}")))?;
        let threads = Arc::new(threads);
        Ok(Self { size, threads })
    }

    /// Keeps the pool for the next call.
    fn give_back(self) {
        let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
        idle.forget_others();
        if idle.pools.len() < MOST_IDLE {
            idle.pools.push(self);
        }
    }
}
