//! Answers to the requests of the page.

use super::project::{Project, is_name, is_plain};
use super::{scene, work};
use crate::context::pool;
use crate::failure::Failure;
use crate::serve::server::{Answers, Content, Parted, number, response, unframed};
use http_body_util::{BodyExt, Either, Limited};
use hyper::body::{Bytes, Incoming};
use hyper::header::{CONTENT_DISPOSITION, CONTENT_SECURITY_POLICY, HeaderValue};
use hyper::http::request::Parts;
use hyper::{Method, Response, StatusCode};
use isoform_view::{studio, studio_policy};
use serde_json::{Value, json};
use std::fs;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;
use tokio::time::timeout;

/// Bytes of a request or of a state: programs of hundreds of pages, and the steps of long work.
const MOST_REQUEST: usize = 64 << 20;
/// Longest time that a request for news waits.
const PATIENCE: Duration = Duration::from_secs(20);
/// Policy of a page that a verb wrote: it runs apart from this server, which does not answer it.
const APART: &str = "sandbox allow-scripts allow-downloads allow-popups";

/// The project, and the page.
pub(super) struct Desk {
    project: Arc<Project>,
    page: Bytes,
    policy: HeaderValue,
    /// Number of the next file that comes in.
    turn: AtomicU64,
    /// Number of threads of a request.
    threads: Option<u16>,
}

impl Desk {
    pub(super) fn new(project: Project, threads: Option<u16>) -> Self {
        Self {
            threads,
            project: Arc::new(project),
            page: studio().into(),
            policy: unframed(&studio_policy()),
            turn: AtomicU64::new(0),
        }
    }
}

impl Answers for Desk {
    /// Work may take hours; the page ends it by closing the connection.
    const LIFE: Duration = Duration::from_secs(30 * 24 * 3600);

    fn policy(&self) -> &HeaderValue {
        &self.policy
    }

    async fn answer(
        &self,
        path: &str,
        head: &Parts,
        body: Incoming,
    ) -> Result<Response<Content>, StatusCode> {
        let is_read = [Method::GET, Method::HEAD].contains(&head.method);
        match (path, head.method.as_str()) {
            ("", _) if is_read => Ok(response(
                StatusCode::OK,
                "text/html; charset=utf-8",
                self.page.clone(),
            )),
            ("run", "POST") => Ok(self.run(whole(body).await?)),
            ("scene", "POST") => self.picture(whole(body).await?).await,
            ("project", _) if is_read => Ok(document(StatusCode::OK, &self.project.state())),
            ("project", "PUT") => self.store(head, &whole(body).await?),
            ("news", _) if is_read => {
                let after = number(head, "after");
                let mut news = self.project.news();
                let other = news.wait_for(|version| Some(*version) != after);
                // In vain: the version known is sent again.
                let _ = timeout(PATIENCE, other).await;
                let version = *news.borrow();
                Ok(document(StatusCode::OK, &json!({"version": version})))
            }
            ("example", _) if is_read => Ok(response(
                StatusCode::OK,
                "application/octet-stream",
                isoform::EXAMPLE_SCAN_FILE,
            )),
            ("files", _) if is_read => Ok(document(StatusCode::OK, &self.project.files())),
            _ => {
                let name = path.strip_prefix("files/").and_then(decoded);
                let name = name.filter(|name| is_name(name));
                let name = name.ok_or(StatusCode::NOT_FOUND)?;
                match head.method.as_str() {
                    "PUT" => self.put(&name, body).await,
                    _ if is_read => Self::get(&name, head),
                    _ => Err(StatusCode::METHOD_NOT_ALLOWED),
                }
            }
        }
    }
}

impl Desk {
    /// Begins the work of a request, whose messages are the parts of the answer.
    fn run(&self, bytes: Bytes) -> Response<Content> {
        let (body, messages, is_left) = Parted::new();
        let threads = self.threads;
        // Requests at one time have pools of their own: a long one holds up no other.
        std::thread::spawn(move || match pool(threads).build() {
            Ok(pool) => pool.install(|| work::run(&bytes, &messages, is_left)),
            Err(error) => work::refuse(&Failure::usage(error.to_string()), &messages),
        });
        let mut answer = response(StatusCode::OK, "application/x-ndjson", "");
        *answer.body_mut() = Either::Right(body);
        answer
    }

    /// Makes a picture; a request that is given up ends the work.
    async fn picture(&self, bytes: Bytes) -> Result<Response<Content>, StatusCode> {
        let leaving = Leaving(Arc::new(AtomicBool::new(false)));
        let is_left = Arc::clone(&leaving.0);
        let threads = self.threads;
        let made = tokio::task::spawn_blocking(move || match pool(threads).build() {
            Ok(pool) => pool.install(|| scene::packed(&bytes, is_left)),
            Err(error) => Err(Failure::usage(error.to_string())),
        });
        let made = made.await.map_err(|_| StatusCode::INTERNAL_SERVER_ERROR)?;
        drop(leaving);
        Ok(match made {
            Ok(bytes) => response(StatusCode::OK, "application/octet-stream", bytes),
            Err(failure) => failed(&failure),
        })
    }

    /// Stores the state of the page.
    fn store(&self, head: &Parts, bytes: &[u8]) -> Result<Response<Content>, StatusCode> {
        let base = number(head, "base").ok_or(StatusCode::BAD_REQUEST)?;
        let state = serde_json::from_slice(bytes).map_err(|_| StatusCode::BAD_REQUEST)?;
        if !matches!(state, Value::Object(_)) {
            return Err(StatusCode::BAD_REQUEST);
        }
        Ok(match self.project.store(base, state) {
            Ok(Some(version)) => document(StatusCode::OK, &json!({"version": version})),
            Ok(None) => document(StatusCode::CONFLICT, &self.project.state()),
            Err(failure) => failed(&failure),
        })
    }

    /// Stores a file that the page sends, completely or not at all.
    async fn put(&self, name: &str, mut body: Incoming) -> Result<Response<Content>, StatusCode> {
        let turn = self.turn.fetch_add(1, Ordering::Relaxed);
        let folder = self.project.folder();
        let part = folder.join(format!(".{turn}.{}.part", std::process::id()));
        let kept = async {
            let mut file = fs::File::create(&part)?;
            while let Some(frame) = body.frame().await {
                let frame = frame.map_err(std::io::Error::other)?;
                if let Some(bytes) = frame.data_ref() {
                    file.write_all(bytes)?;
                }
            }
            file.flush()?;
            fs::rename(&part, folder.join(name))
        };
        let kept = kept.await;
        Ok(match kept {
            Ok(()) => document(StatusCode::OK, &json!({"name": name})),
            Err(error) => {
                let _ = fs::remove_file(&part);
                failed(&Failure::file(Path::new(name), "write", &error))
            }
        })
    }

    /// Returns a file: a page to be seen with `?open`, else bytes to be kept.
    fn get(name: &str, head: &Parts) -> Result<Response<Content>, StatusCode> {
        let path = Path::new(name);
        let bytes = match is_plain(path) {
            true => fs::read(path).map_err(|_| StatusCode::NOT_FOUND)?,
            false => return Err(StatusCode::NOT_FOUND),
        };
        let is_page = name.ends_with(".html") && head.uri.query() == Some("open");
        let mut answer = if is_page {
            response(StatusCode::OK, "text/html; charset=utf-8", bytes)
        } else {
            response(StatusCode::OK, "application/octet-stream", bytes)
        };
        if is_page {
            let policy = HeaderValue::from_static(APART);
            answer.headers_mut().insert(CONTENT_SECURITY_POLICY, policy);
        } else {
            let kept = HeaderValue::from_static("attachment");
            answer.headers_mut().insert(CONTENT_DISPOSITION, kept);
        }
        Ok(answer)
    }
}

/// Reads the body of a request.
async fn whole(body: Incoming) -> Result<Bytes, StatusCode> {
    let read = Limited::new(body, MOST_REQUEST).collect().await;
    let read = read.map_err(|_| StatusCode::PAYLOAD_TOO_LARGE)?;
    Ok(read.to_bytes())
}

/// Sets a mark when it is dropped.
struct Leaving(Arc<AtomicBool>);

impl Drop for Leaving {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Returns the answer of a failure.
fn failed(failure: &Failure) -> Response<Content> {
    document(StatusCode::UNPROCESSABLE_ENTITY, &work::refusal(failure))
}

/// Returns an answer of JSON.
fn document(status: StatusCode, document: &Value) -> Response<Content> {
    response(status, "application/json", document.to_string())
}

/// Decodes `%XX` in a part of a path; `None` if it is not UTF-8 then.
fn decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let [first, after @ ..] = rest {
        rest = after;
        if *first != b'%' {
            bytes.push(*first);
            continue;
        }
        let digits = after.get(..2)?;
        bytes.push(u8::from_str_radix(str::from_utf8(digits).ok()?, 16).ok()?);
        rest = &after[2..];
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_decoded() {
        assert_eq!(decoded("a%20b%C3%A9.ply").as_deref(), Some("a b\u{e9}.ply"));
        for bad in ["%", "%4", "%zz", "%ff", "a%c3"] {
            assert_eq!(decoded(bad), None, "{bad}");
        }
    }
}
