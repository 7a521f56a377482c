//! Checks of requests before they are answered.
//!
//! The server listens on the loopback address alone, but every page that a browser of this machine
//! has open can send requests there. A request must therefore carry the path that only the printed
//! address has; it must be meant for this server (a foreign host name that resolves to it is "DNS
//! rebinding"); and if it comes from a page, that must be a page of this server.

use hyper::header::{HOST, HeaderValue, ORIGIN};
use hyper::http::request::Parts;
use hyper::{Method, StatusCode};

/// Names and token of the server.
#[derive(Clone, Debug)]
pub(crate) struct Door {
    /// The port that the server listens on.
    pub(crate) port: u16,
    /// The first part of every path.
    pub(crate) token: String,
}

impl Door {
    /// Returns the part of the path behind the token, or the status with which a request is
    /// refused.
    pub(crate) fn admit<'r>(&self, request: &'r Parts) -> Result<&'r str, StatusCode> {
        self.check_host(request)?;
        self.check_origin(request)?;
        let path = request.uri.path().strip_prefix('/');
        match path.and_then(|path| path.split_once('/')) {
            Some((token, path)) if token == self.token => Ok(path),
            _ => Err(StatusCode::NOT_FOUND),
        }
    }

    /// Returns true if it is one of the names of this server, as `Host` has it.
    fn is_own(&self, host: &[u8]) -> bool {
        ["127.0.0.1", "localhost"].iter().any(|name| {
            let own = format!("{name}:{}", self.port);
            host.eq_ignore_ascii_case(own.as_bytes())
        })
    }

    /// A request names the server that it is meant for, once.
    fn check_host(&self, request: &Parts) -> Result<(), StatusCode> {
        let mut hosts = request.headers.get_all(HOST).iter();
        let (Some(host), None) = (hosts.next(), hosts.next()) else {
            return Err(StatusCode::BAD_REQUEST);
        };
        let in_target = request.uri.authority();
        let is_own = self.is_own(host.as_bytes())
            && in_target.is_none_or(|name| self.is_own(name.as_str().as_bytes()));
        is_own.then_some(()).ok_or(StatusCode::MISDIRECTED_REQUEST)
    }

    /// Checks that a request comes from a page of this server. Pages say whose page it is, except
    /// where a link is followed, which changes nothing.
    fn check_origin(&self, request: &Parts) -> Result<(), StatusCode> {
        let is_own = |origin: &HeaderValue| {
            let name = origin.as_bytes().strip_prefix(b"http://");
            name.is_some_and(|name| self.is_own(name))
        };
        let mut origins = request.headers.get_all(ORIGIN).iter().peekable();
        let may_lack_one = [Method::GET, Method::HEAD].contains(&request.method);
        ((may_lack_one || origins.peek().is_some()) && origins.all(is_own))
            .then_some(())
            .ok_or(StatusCode::FORBIDDEN)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyper::Request;

    fn judge(uri: &str, headers: &[(&str, &str)]) -> Result<String, u16> {
        judge_method(Method::GET, uri, headers)
    }

    fn judge_method(method: Method, uri: &str, headers: &[(&str, &str)]) -> Result<String, u16> {
        let door = Door {
            port: 4000,
            token: "abc".into(),
        };
        let mut request = Request::builder().method(method).uri(uri);
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        let (parts, ()) = request.body(()).expect("a request").into_parts();
        let path = door.admit(&parts).map(str::to_owned);
        path.map_err(|status| status.as_u16())
    }

    #[test]
    fn hosts() {
        let page = |host| judge("/abc/", &[("host", host)]);
        assert_eq!(page("127.0.0.1:4000"), Ok(String::new()));
        assert_eq!(page("LocalHost:4000"), Ok(String::new()));
        for foreign in [
            "evil.example:4000",
            "127.0.0.1.evil.example:4000",
            "127.0.0.1",
            "127.0.0.1:4001",
            "127.0.0.1:04000",
            "127.1:4000",
            "[::1]:4000",
            "0.0.0.0:4000",
            "x@127.0.0.1:4000",
            "",
        ] {
            assert_eq!(page(foreign), Err(421), "{foreign}");
        }
        assert_eq!(judge("/abc/", &[]), Err(400));
        let own = ("host", "127.0.0.1:4000");
        assert_eq!(judge("/abc/", &[own, own]), Err(400));
        assert_eq!(
            judge("http://127.0.0.1:4000/abc/x", &[own]),
            Ok("x".to_owned())
        );
        assert_eq!(judge("http://evil.example/abc/", &[own]), Err(421));
    }

    #[test]
    fn origins() {
        let own = ("host", "127.0.0.1:4000");
        for method in [Method::GET, Method::POST, Method::PUT] {
            let page = |origin| judge_method(method.clone(), "/abc/", &[own, ("origin", origin)]);
            assert_eq!(page("http://127.0.0.1:4000"), Ok(String::new()));
            for foreign in [
                "null",
                "https://127.0.0.1:4000",
                "http://127.0.0.1:4001",
                "http://evil.example",
                "",
            ] {
                assert_eq!(page(foreign), Err(403), "{foreign}");
            }
        }
        assert_eq!(judge_method(Method::POST, "/abc/", &[own]), Err(403));
    }

    #[test]
    fn paths() {
        let at = |uri| judge(uri, &[("host", "127.0.0.1:4000")]);
        assert_eq!(at("/abc/?x"), Ok(String::new()));
        assert_eq!(at("/abc/news?after=7"), Ok("news".to_owned()));
        for other in ["/", "/abc", "/abcd/", "//abc/"] {
            assert_eq!(at(other), Err(404), "{other}");
        }
    }
}
