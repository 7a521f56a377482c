//! A server of the loopback address, for browsers of this machine.
//!
//! Reading and writing of the protocol is hyper's, with limits on the size of a request's head, on
//! the time that it takes to come, and on the number of connections. A connection carries one
//! request.

use super::door::Door;
use http_body_util::{Either, Full};
use hyper::body::{Body, Bytes, Frame, Incoming};
use hyper::header::{
    ALLOW, CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderName, HeaderValue,
    REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS,
};
use hyper::http::request::Parts;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use std::convert::Infallible;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, mpsc};
use tokio::time::{sleep, timeout};

/// Connections at a time; more wait. A browser has up to six, and one that only holds its place is
/// ended after [`HEAD`].
const SEATS: usize = 64;
/// The time in which the head of a request comes.
const HEAD: Duration = Duration::from_secs(5);
/// Bytes of the head of a request. Ours have a few hundred, browsers send up to a few thousand.
const MOST_HEAD: usize = 16 << 10;

/// Body of an answer: whole, or as its parts come.
pub(crate) type Content = Either<Full<Bytes>, Parted>;

/// Content of a server.
pub(crate) trait Answers: Send + Sync + 'static {
    /// The time of a whole connection.
    const LIFE: Duration;
    /// Policy of the pages.
    fn policy(&self) -> &HeaderValue;
    /// Answers an admitted request for a path behind the token.
    fn answer(
        &self,
        path: &str,
        head: &Parts,
        body: Incoming,
    ) -> impl Future<Output = Result<Response<Content>, StatusCode>> + Send;
}

/// A body whose parts come one by one.
pub(crate) struct Parted {
    parts: mpsc::UnboundedReceiver<Bytes>,
    /// Set when the other side is gone.
    is_left: Arc<AtomicBool>,
}

impl Parted {
    /// Returns a body, the sender of its parts, and the mark that nobody reads them any more.
    pub(crate) fn new() -> (Self, mpsc::UnboundedSender<Bytes>, Arc<AtomicBool>) {
        let (sender, parts) = mpsc::unbounded_channel();
        let is_left = Arc::new(AtomicBool::new(false));
        let body = Self {
            parts,
            is_left: Arc::clone(&is_left),
        };
        (body, sender, is_left)
    }
}

impl Body for Parted {
    type Data = Bytes;
    type Error = Infallible;
    fn poll_frame(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        let next = self.get_mut().parts.poll_recv(context);
        next.map(|part| part.map(|bytes| Ok(Frame::data(bytes))))
    }
}

impl Drop for Parted {
    fn drop(&mut self) {
        self.is_left.store(true, Ordering::Relaxed);
    }
}

/// Begins to answer on this port of the loopback address, or on a free one (0); returns the address
/// of the page.
pub(crate) fn open(port: u16, answers: impl Answers) -> io::Result<String> {
    let listener = std::net::TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
    listener.set_nonblocking(true)?;
    let door = Door {
        port: listener.local_addr()?.port(),
        token: token()?,
    };
    let own = SocketAddr::from((Ipv4Addr::LOCALHOST, door.port));
    let address = format!("http://{own}/{}/", door.token);
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    let site = Arc::new(Site { door, answers });
    std::thread::Builder::new().spawn(move || {
        runtime.block_on(async {
            // Fails only outside of a runtime.
            let listener = TcpListener::from_std(listener).expect("a runtime is there");
            accept(site, listener).await;
        });
    })?;
    Ok(address)
}

/// 128 random bits, in hexadecimal digits.
fn token() -> io::Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(io::Error::other)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Data that all connections share.
struct Site<A> {
    door: Door,
    answers: A,
}

/// Takes connections, as many at a time as there are seats.
async fn accept<A: Answers>(site: Arc<Site<A>>, listener: TcpListener) {
    let seats = Arc::new(Semaphore::new(SEATS));
    loop {
        let seat = Arc::clone(&seats).acquire_owned().await;
        let Ok((stream, _)) = listener.accept().await else {
            // Out of file descriptors, or the other side is gone: neither lasts.
            sleep(Duration::from_millis(50)).await;
            continue;
        };
        let site = Arc::clone(&site);
        tokio::spawn(async move {
            // A connection that breaks off concerns nobody but its other side.
            let _ = timeout(A::LIFE, site.serve(stream)).await;
            drop(seat);
        });
    }
}

impl<A: Answers> Site<A> {
    /// Answers the one request of a connection.
    async fn serve(&self, stream: TcpStream) -> hyper::Result<()> {
        let answer = service_fn(async |request: Request<Incoming>| {
            let (head, body) = request.into_parts();
            let answer = match self.door.admit(&head) {
                Ok(path) => self.answers.answer(path, &head, body).await,
                Err(status) => Err(status),
            };
            let mut answer = answer.unwrap_or_else(refusal);
            self.seal(&mut answer);
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

    /// Adds what keeps an answer where it belongs: nothing stores it, frames it, or learns its
    /// address.
    fn seal(&self, answer: &mut Response<Content>) {
        let fixed = |name: &'static str| HeaderName::from_static(name);
        let headers = answer.headers_mut();
        headers.extend([
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
        headers
            .entry(CONTENT_SECURITY_POLICY)
            .or_insert_with(|| self.answers.policy().clone());
    }
}

/// Returns the policy of a server's pages as a header: `policy`, and that nothing frames them.
pub(crate) fn unframed(policy: &str) -> HeaderValue {
    let policy = format!("{policy}; frame-ancestors 'none'");
    // Hashes and fixed words are ASCII.
    HeaderValue::from_str(&policy).unwrap_or(HeaderValue::from_static("default-src 'none'"))
}

/// Returns the number in `?NAME=N`.
pub(crate) fn number(head: &Parts, name: &str) -> Option<u64> {
    let value = head.uri.query()?.strip_prefix(name)?;
    value.strip_prefix('=')?.parse().ok()
}

/// Returns the answer to a request that is not let in.
fn refusal(status: StatusCode) -> Response<Content> {
    let why = status.canonical_reason().unwrap_or_default();
    let text = format!("{why}\n");
    let mut answer = response(status, "text/plain; charset=utf-8", text);
    if status == StatusCode::METHOD_NOT_ALLOWED {
        let methods = HeaderValue::from_static("GET, HEAD");
        answer.headers_mut().insert(ALLOW, methods);
    }
    answer
}

/// Returns an answer of bytes of a kind.
pub(crate) fn response(
    status: StatusCode,
    kind: &'static str,
    body: impl Into<Bytes>,
) -> Response<Content> {
    let mut answer = Response::new(Either::Left(Full::new(body.into())));
    *answer.status_mut() = status;
    let kind = HeaderValue::from_static(kind);
    answer.headers_mut().insert(CONTENT_TYPE, kind);
    answer
}
