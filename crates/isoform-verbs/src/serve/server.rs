//! The server: the newest page, and news of it.
//!
//! Reading and writing of the protocol is hyper's, with limits on the size of a request's head,
//! on the time that it takes to come, on the time of a whole connection and on their number. A
//! request's body is never read.

use super::door::{Door, PageRequest};
use http_body_util::Full;
use hyper::body::{Bytes, Incoming};
use hyper::header::{
    ALLOW, CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderName, HeaderValue,
    REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS,
};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use isoform_view::{Page, served_policy};
use serde_json::json;
use std::convert::Infallible;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, watch};
use tokio::time::{sleep, timeout};

/// Connections at a time; more wait. A browser has up to six, and one that only holds its place is
/// ended after [`HEAD`].
const SEATS: usize = 64;
/// The time in which the head of a request comes.
const HEAD: Duration = Duration::from_secs(5);
/// The time of a whole connection, which carries one request: enough for a page of a million
/// points to a slow reader.
const LIFE: Duration = Duration::from_secs(60);
/// Longest time that a request for news waits.
const PATIENCE: Duration = Duration::from_secs(20);
/// Bytes of the head of a request. Ours have a few hundred, browsers send up to a few thousand.
const MOST_HEAD: usize = 16 << 10;

/// Page and state that browsers see.
#[derive(Clone, Debug)]
pub(super) struct ServedPage {
    /// Counts all changes of what follows.
    news: u64,
    /// Counts the pages.
    version: u64,
    /// Bytes of the page.
    page: Bytes,
    /// Reason for the lack of a newer page.
    failure: Option<String>,
}

impl ServedPage {
    /// The first page.
    pub(super) fn new(page: &Page) -> Self {
        Self {
            news: 1,
            version: 1,
            page: page.served(1).into(),
            failure: None,
        }
    }

    /// Replaces the page; files with a new time and unchanged content give an equal page.
    fn show(&mut self, page: &Page) {
        self.news += 1;
        self.failure = None;
        if self.page != page.served(self.version) {
            self.version += 1;
            self.page = page.served(self.version).into();
        }
    }

    /// No other page, and why.
    fn fail(&mut self, why: &str) {
        self.news += 1;
        self.failure = Some(why.to_owned());
    }

    /// Returns the state that is sent to the page.
    fn document(&self) -> String {
        json!({"news": self.news, "page": self.version, "failure": self.failure}).to_string()
    }
}

/// A running server.
pub(super) struct Site {
    door: Door,
    shown: watch::Sender<ServedPage>,
}

impl Site {
    /// Begins to answer on this port of the loopback address, or on a free one (0).
    pub(super) fn open(port: u16, shown: ServedPage) -> io::Result<Self> {
        let listener = std::net::TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        listener.set_nonblocking(true)?;
        let door = Door {
            port: listener.local_addr()?.port(),
            token: token()?,
        };
        let (shown, seen) = watch::channel(shown);
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()?;
        let answers = Answers {
            door: Arc::new(door.clone()),
            shown: seen,
        };
        std::thread::Builder::new().spawn(move || {
            runtime.block_on(async {
                // Fails only outside of a runtime.
                let listener = TcpListener::from_std(listener).expect("a runtime is there");
                answers.accept(listener).await;
            });
        })?;
        Ok(Self { door, shown })
    }

    /// The address of the page.
    pub(super) fn address(&self) -> String {
        let own = SocketAddr::from((Ipv4Addr::LOCALHOST, self.door.port));
        format!("http://{own}/{}/", self.door.token)
    }

    /// Shows another page.
    pub(super) fn show(&self, page: &Page) {
        self.shown.send_modify(|shown| shown.show(page));
    }

    /// Keeps the page, and says why.
    pub(super) fn fail(&self, why: &str) {
        self.shown.send_modify(|shown| shown.fail(why));
    }
}

/// 128 random bits, in hexadecimal digits.
fn token() -> io::Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(io::Error::other)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Data that all connections share.
#[derive(Clone)]
struct Answers {
    door: Arc<Door>,
    shown: watch::Receiver<ServedPage>,
}

impl Answers {
    /// Takes connections, as many at a time as there are seats.
    async fn accept(&self, listener: TcpListener) {
        let seats = Arc::new(Semaphore::new(SEATS));
        loop {
            let seat = Arc::clone(&seats).acquire_owned().await;
            let Ok((stream, _)) = listener.accept().await else {
                // Out of file descriptors, or the other side is gone: neither lasts.
                sleep(Duration::from_millis(50)).await;
                continue;
            };
            let answers = self.clone();
            tokio::spawn(async move {
                // A connection that breaks off concerns nobody but its other side.
                let _ = timeout(LIFE, answers.serve(stream)).await;
                drop(seat);
            });
        }
    }

    /// Answers the one request of a connection.
    async fn serve(&self, stream: TcpStream) -> hyper::Result<()> {
        let answer = service_fn(async |request: Request<Incoming>| {
            let (parts, _unread) = request.into_parts();
            let answer = match self.door.judge(&parts) {
                Ok(asked) => self.answer(asked).await,
                Err(status) => refusal(status),
            };
            Ok::<_, Infallible>(answer)
        });
        http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(HEAD)
            .max_buf_size(MOST_HEAD)
            .keep_alive(false)
            .serve_connection(TokioIo::new(stream), answer)
            .await
    }

    /// The page, or news when there are some.
    async fn answer(&self, asked: PageRequest) -> Response<Full<Bytes>> {
        let mut shown = self.shown.clone();
        match asked {
            PageRequest::Page => {
                let page = shown.borrow().page.clone();
                response(StatusCode::OK, "text/html; charset=utf-8", page)
            }
            PageRequest::News(after) => {
                let other = shown.wait_for(|shown| Some(shown.news) != after);
                // In vain: what was told before is told again.
                let _ = timeout(PATIENCE, other).await;
                let news = shown.borrow().document();
                response(StatusCode::OK, "application/json", news.into())
            }
        }
    }
}

/// An answer to a request that is not let in.
fn refusal(status: StatusCode) -> Response<Full<Bytes>> {
    let why = status.canonical_reason().unwrap_or_default();
    let mut answer = response(
        status,
        "text/plain; charset=utf-8",
        format!("{why}\n").into(),
    );
    if status == StatusCode::METHOD_NOT_ALLOWED {
        let methods = HeaderValue::from_static("GET, HEAD");
        answer.headers_mut().insert(ALLOW, methods);
    }
    answer
}

/// An answer with what keeps it where it belongs: nothing stores it, frames it, or learns its
/// address.
fn response(status: StatusCode, kind: &'static str, body: Bytes) -> Response<Full<Bytes>> {
    let policy = served_policy() + "; frame-ancestors 'none'";
    let fixed = |name: &'static str| HeaderName::from_static(name);
    let mut answer = Response::new(Full::new(body));
    *answer.status_mut() = status;
    answer.headers_mut().extend([
        (CONTENT_TYPE, HeaderValue::from_static(kind)),
        (CACHE_CONTROL, HeaderValue::from_static("no-store")),
        (X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
        (REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
        (
            fixed("cross-origin-resource-policy"),
            HeaderValue::from_static("same-origin"),
        ),
        (
            fixed("cross-origin-opener-policy"),
            HeaderValue::from_static("same-origin"),
        ),
    ]);
    if let Ok(policy) = HeaderValue::from_str(&policy) {
        answer.headers_mut().insert(CONTENT_SECURITY_POLICY, policy);
    }
    answer
}
