//! `isoform studio`: what its server does for its page, and for nobody else.
#![cfg(unix)]

use crate::common::*;
use crate::serve::{Server, status};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

/// A ball whose radius is its parameter.
const BALL: &str = "-- @param a[1] radius typical=2 min=1 max=3
my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; my_model = hfSphere(x, c, a[1]); }";

/// A server of the project in a folder.
fn studio(folder: &Folder, files: &[&str]) -> Server {
    let project = folder.path("project");
    let words = ["studio", "--no-open", "--project", &project];
    Server::of(&[&words, files].concat())
}

impl Server {
    /// Sends a body as the page does.
    fn send(&self, method: &str, path: &str, body: &str) -> String {
        let origin = format!("http://127.0.0.1:{}", self.port);
        let length = body.len();
        self.ask(
            method,
            &format!("{}{path}", self.path),
            &format!("Origin: {origin}\r\nContent-Length: {length}\r\n\r\n{body}"),
        )
    }
    /// Returns the body of an answer.
    fn get(&self, path: &str) -> String {
        let answer = self.ask("GET", &format!("{}{path}", self.path), "");
        body(&answer)
    }
    /// Does the work of a request; returns its messages.
    fn work(&self, request: &Value) -> Vec<Value> {
        let answer = self.send("POST", "run", &request.to_string());
        let lines = answer.lines().filter(|line| line.starts_with('{'));
        lines
            .map(|line| serde_json::from_str(line).expect(line))
            .collect()
    }
}

fn exists(folder: &Folder, name: &str) -> bool {
    Path::new(&folder.path(name)).exists()
}

fn body(answer: &str) -> String {
    let body = answer.split_once("\r\n\r\n").expect("an answer").1;
    body.to_owned()
}

#[test]
fn a_request_is_a_command_with_its_progress_and_its_document() {
    let f = Folder::new("studio-work");
    let ball = f.file("ball.hf", BALL);
    let server = studio(&f, &[&ball]);
    let state: Value = serde_json::from_str(&server.get("project")).expect("JSON");
    assert_eq!(state["opened"], json!(["ball.hf"]));
    let request = json!({"verb": "mesh", "model": "ball.hf", "output": ["ball.stl"],
        "surface_only": true});
    let messages = server.work(&request);
    let line = messages[0]["command"].as_str().expect("a command");
    assert_eq!(
        line,
        "isoform mesh --output=ball.stl --surface-only -- ball.hf"
    );
    assert!(messages.iter().any(|m| m["progress"]["phase"].is_string()));
    let answer = &messages[messages.len() - 1]["answer"];
    assert_eq!(answer["exit"], 0);
    // The command gives the same file and the same document.
    let o = isoform(&[
        "--json",
        "mesh",
        &ball,
        "-o",
        &f.path("own.stl"),
        "--surface-only",
    ]);
    let own: Value = serde_json::from_str(&stdout(&o)).expect("JSON");
    assert_eq!(own["certificate"], answer["document"]["certificate"]);
    let bytes = |name: &str| fs::read(f.path(name)).expect("written");
    assert_eq!(bytes("own.stl"), bytes("project/ball.stl"));
    let failed = server.work(&json!({"verb": "mesh", "model": "none.hf"}));
    let failure = &failed[failed.len() - 1]["failure"];
    assert!(
        failure["hint"]
            .as_str()
            .is_some_and(|hint| hint.contains("HyperFun"))
    );
}

#[test]
fn requests_outside_of_the_project_are_refused() {
    let f = Folder::new("studio-outside");
    f.file("secret.hf", BALL);
    let server = studio(&f, &[]);
    for request in [
        json!({"verb": "inspect", "file": "../secret.hf"}),
        json!({"verb": "inspect", "file": f.path("secret.hf")}),
        json!({"verb": "inspect", "file": "-"}),
        json!({"verb": "mesh", "model": "x^2 + y^2 + z^2 = 1", "output": ["../out.stl"]}),
        json!({"verb": "mesh", "model": "x^2 + y^2 + z^2 = 1", "output": ["project.json"]}),
        json!({"verb": "view", "file": ["cup"], "serve": true}),
        json!({"verb": "studio"}),
        json!({"verb": "run", "file": "x"}),
        json!({}),
        json!([1]),
    ] {
        let messages = server.work(&request);
        assert!(
            messages[0]["failure"].is_object(),
            "{request}: {messages:?}"
        );
    }
    for file in [
        json!("../secret.hf"),
        json!(f.path("secret.hf")),
        json!("-"),
        json!(null),
    ] {
        let scene = server.send("POST", "scene", &json!({"file": [file]}).to_string());
        assert_eq!(status(&scene), 422, "{scene}");
    }
    for name in [
        "..%2fx.hf",
        "%2fetc%2fpasswd",
        "a%00",
        ".x",
        "a%2fb",
        "project.json",
        "",
        "%zz",
    ] {
        let put = server.send("PUT", &format!("files/{name}"), "x");
        assert_eq!(status(&put), 404, "{name}");
    }
    for (link, target) in [
        ("secret.hf", "../secret.hf"),
        ("zero.xyz", "/dev/zero"),
        ("up", ".."),
    ] {
        let link = f.path(&format!("project/{link}"));
        std::os::unix::fs::symlink(target, link).expect("a link");
    }
    for file in ["secret.hf", "zero.xyz", "up/secret.hf"] {
        let messages = server.work(&json!({"verb": "inspect", "file": file}));
        assert!(messages[0]["failure"].is_object(), "{file}: {messages:?}");
        let answer = server.ask("GET", &format!("{}files/{file}", server.path), "");
        assert_eq!(status(&answer), 404, "{file}");
    }
    let ball = json!({"verb": "mesh", "model": "x^2 + y^2 + z^2 = 1", "output": ["up/out.stl"]});
    assert!(server.work(&ball)[0]["failure"].is_object());
    assert_eq!(status(&server.send("DELETE", "files/a.hf", "")), 405);
    let foreign = "Origin: http://evil.example\r\nContent-Length: 2\r\n\r\n{}";
    let path = format!("{}run", server.path);
    assert_eq!(status(&server.ask("POST", &path, foreign)), 403);
    let unsaid = "Content-Length: 2\r\n\r\n{}";
    assert_eq!(status(&server.ask("POST", &path, unsaid)), 403);
    assert!(!exists(&f, "out.stl") && exists(&f, "project"));
}

#[test]
fn the_state_is_kept_and_a_window_that_is_late_is_told() {
    let f = Folder::new("studio-state");
    let server = studio(&f, &[]);
    let put = |server: &Server, base: u64, state: &str| {
        server.send("PUT", &format!("project?base={base}"), state)
    };
    assert_eq!(status(&put(&server, 1, r#"{"a": 1}"#)), 200);
    let late = put(&server, 1, r#"{"a": 2}"#);
    assert_eq!(status(&late), 409);
    let told: Value = serde_json::from_str(&body(&late)).expect("JSON");
    assert_eq!(
        (&told["version"], &told["document"]),
        (&json!(2), &json!({"a": 1}))
    );
    for bad in ["", "[]", "{", "\"x\""] {
        assert_eq!(status(&put(&server, 2, bad)), 400, "{bad}");
    }
    assert_eq!(
        status(&server.send("PUT", "files/a%20%C3%A9.hf", BALL)),
        200
    );
    // Without a chance to say anything (SIGKILL).
    drop(server);
    let server = studio(&f, &[]);
    let state: Value = serde_json::from_str(&server.get("project")).expect("JSON");
    assert_eq!(state["document"], json!({"a": 1}));
    assert_eq!(server.get("files/a%20%C3%A9.hf"), BALL);
    drop(server);
    f.file("project/project.json", "{\"a\":");
    let server = studio(&f, &[]);
    let state: Value = serde_json::from_str(&server.get("project")).expect("JSON");
    assert_eq!(state["document"], Value::Null);
    assert!(
        exists(&f, "project/project.damaged.json"),
        "nothing is thrown away"
    );
}

#[test]
fn pictures_are_of_files_and_of_texts_and_errors_have_their_place() {
    let f = Folder::new("studio-scene");
    let server = studio(&f, &[]);
    let scene = |text: &str| {
        let request = json!({"file": [{"name": "ball.hf", "text": text}]});
        server.send("POST", "scene", &request.to_string())
    };
    let good = scene(BALL);
    assert_eq!(status(&good), 200);
    assert!(good.contains("\"kind\":\"model\"") && good.contains("\"arrays\":[]"));
    let wrong = scene(&BALL.replace("hfSphere", "hfSpere"));
    assert_eq!(status(&wrong), 422);
    let failure: Value = serde_json::from_str(&body(&wrong)).expect("JSON");
    assert_eq!(failure["failure"]["where"]["line"], 2);
    assert_eq!(failure["failure"]["where"]["file"], "ball.hf");
}
