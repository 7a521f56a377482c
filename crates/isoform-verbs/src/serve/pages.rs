//! The newest page of files, and news of it.

use super::server::{self, Answers, Content, number, response, unframed};
use hyper::body::{Bytes, Incoming};
use hyper::header::HeaderValue;
use hyper::http::request::Parts;
use hyper::{Method, Response, StatusCode};
use isoform_view::{Page, served_policy};
use serde_json::json;
use std::io;
use std::time::Duration;
use tokio::sync::watch;
use tokio::time::timeout;

/// Longest time that a request for news waits.
const PATIENCE: Duration = Duration::from_secs(20);

/// Page and state that browsers see.
#[derive(Clone, Debug)]
struct ServedPage {
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
    fn new(page: &Page) -> Self {
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

/// A page that is being served.
pub(super) struct Pages {
    address: String,
    shown: watch::Sender<ServedPage>,
}

impl Pages {
    /// Begins to serve a page on this port of the loopback address, or on a free one (0).
    pub(super) fn open(port: u16, page: &Page) -> io::Result<Self> {
        let (shown, seen) = watch::channel(ServedPage::new(page));
        let visitors = Visitors {
            shown: seen,
            policy: unframed(&served_policy()),
        };
        let address = server::open(port, visitors)?;
        Ok(Self { address, shown })
    }

    /// The address of the page.
    pub(super) fn address(&self) -> &str {
        &self.address
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

/// Content of the answers.
struct Visitors {
    shown: watch::Receiver<ServedPage>,
    policy: HeaderValue,
}

impl Answers for Visitors {
    /// Enough for a page of a million points to a slow reader.
    const LIFE: Duration = Duration::from_secs(60);

    fn policy(&self) -> &HeaderValue {
        &self.policy
    }

    /// The page, or news when there are some.
    async fn answer(
        &self,
        path: &str,
        head: &Parts,
        _unread: Incoming,
    ) -> Result<Response<Content>, StatusCode> {
        if head.method != Method::GET && head.method != Method::HEAD {
            return Err(StatusCode::METHOD_NOT_ALLOWED);
        }
        let mut shown = self.shown.clone();
        match path {
            "" => {
                let page = shown.borrow().page.clone();
                Ok(response(StatusCode::OK, "text/html; charset=utf-8", page))
            }
            "news" => {
                let after = number(head, "after");
                let other = shown.wait_for(|shown| Some(shown.news) != after);
                // In vain: what was told before is told again.
                let _ = timeout(PATIENCE, other).await;
                let news = shown.borrow().document();
                Ok(response(StatusCode::OK, "application/json", news))
            }
            _ => Err(StatusCode::NOT_FOUND),
        }
    }
}
