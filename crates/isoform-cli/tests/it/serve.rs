//! `isoform view --serve`: what it gives, to whom, and what it lives through.
#![cfg(unix)]

use crate::common::*;
use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Longer than anything takes that is awaited, on a busy machine.
const PATIENCE: Duration = Duration::from_secs(30);

/// A running server, ended with the test.
pub(crate) struct Server {
    child: Child,
    pub(crate) port: u16,
    /// The path of the page.
    pub(crate) path: String,
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Server {
    fn start(args: &[&str]) -> Self {
        Self::of(&[&["view", "--serve"], args].concat())
    }

    /// Starts the program with these words.
    pub(crate) fn of(words: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_isoform"))
            .args(words)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("it runs");
        let mut line = String::new();
        let mut stdout = BufReader::new(child.stdout.take().expect("a pipe"));
        stdout.read_line(&mut line).expect("an address");
        let rest = line.trim().strip_prefix("http://127.0.0.1:");
        let (port, path) = rest.and_then(|r| r.split_once('/')).expect(&line);
        Self {
            child,
            port: port.parse().expect("a port"),
            path: format!("/{path}"),
        }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).expect("it listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("set");
        stream
    }

    /// The answer to a request as it is typed; empty where the connection is cut.
    fn raw(&self, request: &str) -> String {
        let mut stream = self.connect();
        // The server may refuse before it has read everything.
        let _ = stream.write_all(request.as_bytes());
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    /// The answer to a request as a browser sends it, with more lines.
    pub(crate) fn ask(&self, method: &str, path: &str, more: &str) -> String {
        let port = self.port;
        self.raw(&format!(
            "{method} {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n{more}\r\n"
        ))
    }

    fn page(&self) -> String {
        self.ask("GET", &self.path, "")
    }

    /// What the page is told behind these news.
    fn news(&self, after: &str) -> Value {
        let answer = self.ask("GET", &format!("{}news?after={after}", self.path), "");
        let (_, body) = answer.split_once("\r\n\r\n").expect("an answer");
        serde_json::from_str(body).expect("JSON")
    }

    /// Waits until the page is told what is looked for.
    fn wait(&self, what: &str, is_it: impl Fn(&Value) -> bool) -> Value {
        let start = Instant::now();
        let mut news = self.news("-1");
        while !is_it(&news) {
            assert!(start.elapsed() < PATIENCE, "waited for {what}: {news}");
            news = self.news(&news["news"].to_string());
        }
        news
    }

    fn is_alive(&mut self) -> bool {
        self.child.try_wait().expect("asked").is_none()
    }

    /// Sends a signal; the exit code.
    fn end(&mut self, signal: &str) -> i32 {
        let pid = self.child.id().to_string();
        let sent = Command::new("kill").args([signal, &pid]).status();
        assert!(sent.expect("kill runs").success());
        self.child.wait().expect("it ends").code().expect("a code")
    }
}

pub(crate) fn status(answer: &str) -> u16 {
    let word = answer.split(' ').nth(1).unwrap_or("0");
    word.parse().unwrap_or(0)
}

#[test]
fn the_page_is_given_with_what_reloading_needs_and_no_more() {
    let f = Folder::new("serve-page");
    let file = f.file("four.xyz", POINTS);
    let server = Server::start(&[&file]);
    let answer = server.page();
    assert_eq!(status(&answer), 200);
    let (head, page) = answer.split_once("\r\n\r\n").expect("an answer");
    let head = head.to_ascii_lowercase();
    for line in [
        "content-type: text/html; charset=utf-8",
        "cache-control: no-store",
        "x-content-type-options: nosniff",
        "referrer-policy: no-referrer",
        "cross-origin-resource-policy: same-origin",
        "frame-ancestors 'none'",
    ] {
        assert!(head.contains(line), "{line} in {head}");
    }
    assert!(!head.contains("access-control-"), "{head}");
    let policy = |page: &str| {
        let (_, rest) = page.split_once("Content-Security-Policy\" content=\"")?;
        Some(rest.split_once('"')?.0.to_owned())
    };
    let served = policy(page).expect("a policy");
    assert!(served.contains("connect-src 'self'") && !served.contains("unsafe"));
    let o = isoform(&["view", &file, "-o", "-"]);
    let written = policy(&stdout(&o)).expect("a policy");
    assert!(!written.contains("connect-src"), "{written}");
    assert!(!stdout(&o).contains("isoform-version"));
}

#[test]
fn a_changed_file_is_another_page_and_a_touched_one_is_not() {
    let f = Folder::new("serve-change");
    let file = f.file("four.xyz", POINTS);
    let server = Server::start(&[&file]);
    let first = server.wait("the first page", |_| true);
    assert_eq!(
        (&first["page"], &first["failure"]),
        (&1.into(), &Value::Null)
    );
    f.file("four.xyz", POINTS);
    let touched = server.wait("a second look", |news| news["news"] != first["news"]);
    assert_eq!(touched["page"], 1, "the same bytes");
    f.file("four.xyz", format!("{POINTS}1 1 1\n"));
    server.wait("another page", |news| news["page"] == 2);
    assert!(server.page().contains("\"count\":5"));
    // As editors write: beside it, and renamed.
    let beside = f.file("four.tmp", format!("{POINTS}1 1 1\n2 2 2\n"));
    fs::rename(beside, &file).expect("renamed");
    server.wait("a renamed file", |news| news["page"] == 3);
    assert!(server.page().contains("\"count\":6"));
}

#[test]
fn what_cannot_be_read_is_told_and_the_last_page_stays() {
    let f = Folder::new("serve-broken");
    let ball = "my_model(x[3], a[1]) { array c[3]; c = [0,0,0]; my_model = hfSphere(x, c, 1); }";
    let file = f.file("ball.hf", ball);
    let mut server = Server::start(&[&file]);
    let fails = |what: &str, word: &str| {
        server.wait(what, |news| {
            let failure = news["failure"].as_str();
            failure.is_some_and(|text| text.contains(word))
        });
        assert_eq!(status(&server.page()), 200);
    };
    f.file("ball.hf", &ball[..60]);
    fails("half a file", "ball.hf:1:");
    f.file("ball.hf", "my_model(x[3], a[1]) { my_model = \u{0}; }");
    fails("no program", "ball.hf:1:35");
    f.file("ball.hf", "(".repeat(200_000));
    fails("deep nesting", "ball.hf:1:1:");
    fs::remove_file(&file).expect("removed");
    fails("no file", "ball.hf");
    fs::create_dir(&file).expect("made");
    fails("a folder", "not a file");
    fs::remove_dir(&file).expect("removed");
    let made = Command::new("mkfifo").arg(&file).status();
    assert!(made.expect("mkfifo runs").success());
    fails("a pipe", "not a file");
    fs::remove_file(&file).expect("removed");
    let larger = ball.replace("c, 1", "c, 2");
    f.file("ball.hf", &larger);
    let news = server.wait("a good file", |news| news["failure"].is_null());
    assert_eq!(news["page"], 2);
    assert!(server.is_alive());
}

#[test]
fn only_pages_of_this_server_are_answered() {
    let f = Folder::new("serve-door");
    let file = f.file("four.xyz", POINTS);
    f.file("secret.txt", "the-secret");
    let server = Server::start(&[&file]);
    let (port, path) = (server.port, server.path.clone());
    let host = |line: &str| status(&server.raw(&format!("GET {path} HTTP/1.1\r\n{line}\r\n")));
    assert_eq!(host(&format!("Host: localhost:{port}\r\n")), 200);
    for foreign in ["evil.example", "127.0.0.1", "127.0.0.1:1", "[::1]", ""] {
        assert_eq!(host(&format!("Host: {foreign}\r\n")), 421, "{foreign}");
    }
    assert_eq!(host(&format!("Host: evil.example:{port}\r\n")), 421);
    assert_eq!(host(""), 400);
    let twice = format!("Host: 127.0.0.1:{port}\r\nHost: 127.0.0.1:{port}\r\n");
    assert_eq!(host(&twice), 400);
    assert_eq!(
        status(&server.raw(&format!("GET {path} HTTP/1.0\r\n\r\n"))),
        400
    );
    let through =
        format!("GET http://evil.example{path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n");
    assert_eq!(status(&server.raw(&through)), 421);
    let origin = |name: &str| status(&server.ask("GET", &path, &format!("Origin: {name}\r\n")));
    assert_eq!(origin(&format!("http://127.0.0.1:{port}")), 200);
    assert_eq!(origin("null"), 403);
    assert_eq!(origin("http://evil.example"), 403);
    for name in [
        "secret.txt",
        "../secret.txt",
        "%2e%2e/secret.txt",
        "four.xyz",
        "news/x",
    ] {
        for before in ["/", &path, "//", "/x/../"] {
            let answer = server.ask("GET", &format!("{before}{name}"), "");
            assert_eq!(status(&answer), 404, "{before}{name}");
        }
    }
    assert_eq!(
        status(&server.ask("GET", "/", "")),
        404,
        "the token is needed"
    );
    assert!(
        TcpStream::connect(("::1", port)).is_err(),
        "127.0.0.1 alone"
    );
}

#[test]
fn other_methods_than_reading() {
    let f = Folder::new("serve-methods");
    let file = f.file("four.xyz", POINTS);
    let server = Server::start(&[&file]);
    let head = server.ask("HEAD", &server.path, "");
    let (head, body) = head.split_once("\r\n\r\n").expect("an answer");
    assert_eq!((status(head), body), (200, ""));
    let size = server
        .page()
        .split_once("\r\n\r\n")
        .expect("an answer")
        .1
        .len();
    let told = format!("content-length: {size}");
    assert!(
        head.to_ascii_lowercase().contains(&told),
        "{told} in {head}"
    );
    for method in [
        "POST", "PUT", "DELETE", "OPTIONS", "TRACE", "PATCH", "CONNECT", "FOO",
    ] {
        let answer = server.ask(method, &server.path, "Content-Length: 0\r\n");
        assert!(
            (400..500).contains(&status(&answer)),
            "{method}: {answer:.80}"
        );
        assert!(!answer.contains("isoform"), "{method}");
    }
    let upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\n";
    assert_eq!(
        status(&server.ask("GET", &server.path, upgrade)),
        200,
        "a page, no socket"
    );
}

#[test]
fn broken_and_oversized_requests_end_themselves_alone() {
    let f = Folder::new("serve-junk");
    let file = f.file("four.xyz", POINTS);
    let mut server = Server::start(&[&file]);
    let long = "A".repeat(1 << 20);
    let own = format!("Host: 127.0.0.1:{}", server.port);
    for junk in [
        "\0\u{1}\u{2}\r\n\r\n",
        "GET / HTTP/9.9\r\nHost: x\r\n\r\n",
        "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
        "\u{16}\u{3}\u{1}\u{2}",
        &format!("GET /{long} HTTP/1.1\r\n{own}\r\n\r\n"),
        &format!("GET / HTTP/1.1\r\n{own}\r\nX: {long}\r\n\r\n"),
        &format!(
            "GET / HTTP/1.1\r\n{own}\r\n{}\r\n",
            "X: y\r\n".repeat(10_000)
        ),
        &format!("POST / HTTP/1.1\r\n{own}\r\nContent-Length: 1000000\r\n\r\n{long}"),
        &format!("POST / HTTP/1.1\r\n{own}\r\nContent-Length: -1\r\n\r\n"),
        &format!("POST / HTTP/1.1\r\n{own}\r\nTransfer-Encoding: chunked\r\n\r\nZ\r\n"),
    ] {
        let answer = server.raw(junk);
        let is_refused = matches!(status(&answer), 0 | 400..=499);
        assert!(is_refused, "{:.40}: {:.80}", junk, answer);
    }
    assert_eq!(status(&server.page()), 200);
    assert!(server.is_alive());
}

#[test]
fn connections_that_only_hold_their_place_do_not_lock_others_out() {
    let f = Folder::new("serve-slow");
    let file = f.file("four.xyz", POINTS);
    let server = Server::start(&[&file]);
    let mut idle: Vec<TcpStream> = (0..100).map(|_| server.connect()).collect();
    for stream in &mut idle[..50] {
        let _ = stream.write_all(b"GET / HT");
    }
    let start = Instant::now();
    assert_eq!(status(&server.page()), 200);
    assert!(start.elapsed() < PATIENCE, "{:?}", start.elapsed());
}

#[test]
fn it_ends_by_signals_as_asked_for() {
    let f = Folder::new("serve-end");
    let file = f.file("four.xyz", POINTS);
    for signal in ["-INT", "-TERM"] {
        let mut server = Server::start(&[&file]);
        let _waiting = server.connect();
        assert_eq!(server.end(signal), 0, "{signal}");
        assert!(TcpStream::connect(("127.0.0.1", server.port)).is_err());
    }
}

#[test]
fn the_document_tells_the_address_at_once_and_is_the_only_one() {
    let f = Folder::new("serve-json");
    let file = f.file("four.xyz", POINTS);
    let child = Command::new(env!("CARGO_BIN_EXE_isoform"))
        .args(["view", "--serve", "--json", &file])
        .stdout(Stdio::piped())
        .spawn();
    let mut server = Server {
        child: child.expect("it runs"),
        port: 0,
        path: String::new(),
    };
    let mut stdout = BufReader::new(server.child.stdout.take().expect("a pipe"));
    let mut text = String::new();
    while !text.ends_with("\n}\n") {
        assert!(stdout.read_line(&mut text).expect("text") > 0, "{text}");
    }
    let told: Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!((&told["ok"], &told["verb"]), (&true.into(), &"view".into()));
    assert_eq!(told["layers"][0]["kind"], "points");
    let address = told["address"].as_str().expect("an address");
    assert!(address.starts_with("http://127.0.0.1:"), "{address}");
    assert_eq!(server.end("-INT"), 0);
    let mut rest = String::new();
    stdout.read_to_string(&mut rest).expect("text");
    assert_eq!(rest, "", "nothing follows");
}

#[test]
fn what_cannot_be_served_is_refused_before() {
    let f = Folder::new("serve-refused");
    let file = f.file("four.xyz", POINTS);
    let empty = f.file("empty.xyz", "");
    let page = f.path("page.html");
    let serve = |args: &[&str]| isoform(&[&["view", "--serve"], args].concat());
    assert_eq!(code(&serve(&["-"])), 1);
    assert_eq!(code(&serve(&[&file, "-o", &page])), 1);
    assert_eq!(code(&serve(&[&file, "--time-limit", "9s"])), 1);
    assert_eq!(code(&serve(&[&file, "--port", "70000"])), 1);
    assert_eq!(code(&serve(&[&empty])), 2);
    assert_eq!(code(&serve(&[&f.path("none.xyz")])), 2);
    assert_eq!(code(&isoform(&["view", &file])), 1, "a page needs a name");
    let server = Server::start(&[&file]);
    let o = serve(&[&file, "--port", &server.port.to_string(), "--json"]);
    assert_eq!(code(&o), 4, "{}", stderr(&o));
    assert_eq!(document(&o)["error"]["code"], "port");
}
