//! The binary, as a user runs it.

use crate::common::*;
use serde_json::Value;
use std::fs;
use std::io::Write;
use std::process::{Command, Stdio};

const BALL: &str = "-- @param a[1] radius length start=2 : of the ball
my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; my_model = hfSphere(x, c, a[1]); }
flat(x[2], a[1], s[2]) { s[2] = x[1]; flat = sqrt(x[1]); }
";

#[test]
fn the_table_goes_to_stdout_or_to_a_file() {
    let f = Folder::new("table");
    let (hf, p) = (
        f.file("ball.hf", BALL),
        f.file("p.csv", "# points\n0.10,0,0,more\n\n1,2,2\n"),
    );
    let want = "x,y,z,f\n0.10,0,0,3.99\n1,2,2,-5.0\n";
    let o = isoform(&["eval", &hf, "--points", &p]);
    assert_eq!(
        (code(&o), stdout(&o), stderr(&o)),
        (0, want.to_owned(), String::new())
    );
    let out = f.file("out.csv", "old");
    let o = isoform(&["eval", &hf, "--points", &p, "-o", &out, "--params=3"]);
    assert_eq!((code(&o), stdout(&o).as_str()), (0, ""));
    assert_eq!(
        fs::read_to_string(&out).expect("written"),
        "x,y,z,f\n0.10,0,0,8.99\n1,2,2,0.0\n"
    );
    assert_eq!(
        fs::read_dir(&f.0).expect("there").count(),
        3,
        "no temporary file is left"
    );
    // What eval writes it reads again.
    let o = isoform(&["eval", &hf, "--points", &out]);
    assert_eq!(stdout(&o), want);
}

#[test]
fn parameters_are_given_in_order_by_name_or_by_ties() {
    let f = Folder::new("parameters");
    let text = "-- @param a[1] r length typical=2\n-- @param a[2] h length tie=2*r\n\
                my_model(x[3], a[3]) { my_model = a[1] + 10*a[2] + 100*a[3] - x[1]; }";
    let (hf, p) = (f.file("m.hf", text), f.file("p.csv", "0,0,0\n"));
    let run = |params: &[&str]| isoform(&[&["eval", &hf, "--points", &p][..], params].concat());
    let value = |params: &str| {
        let o = run(&["--params", params]);
        let table = stdout(&o);
        (
            code(&o),
            table
                .rsplit(',')
                .next()
                .unwrap_or_default()
                .trim()
                .to_owned(),
        )
    };
    assert_eq!(value("a[3]=5"), (0, "542.0".to_owned()));
    assert_eq!(value("3,A[3]=5"), (0, "563.0".to_owned()));
    assert_eq!(value("R=1,a[3]=0"), (0, "21.0".to_owned()));
    let o = run(&["--params", "3,9,5"]);
    assert!(stdout(&o).contains("563.0") && stderr(&o).contains("a[2] (h) is tied"));
    for (params, why) in [
        (&[][..], "a[3] has no value\n  try: --params a[3]=1"),
        (&["--params", "1,w=2"], "no parameter is called w"),
        (&["--params", "1,r=2"], "r is given twice"),
        (&["--params", "r=2,1"], "NAME=NUMBER"),
        (
            &["--params", "1,2,3,4"],
            "4 parameters for `my_model`, which has 3",
        ),
    ] {
        let o = run(params);
        assert!(code(&o) == 1 && stderr(&o).contains(why), "{}", stderr(&o));
    }
}

#[test]
fn failing_rows_leave_the_others() {
    let f = Folder::new("rows");
    let (hf, p) = (f.file("ball.hf", BALL), f.file("p.csv", "4 9\n-1 9\n"));
    let args = ["eval", &hf, "--points", &p, "--object", "FLAT"];
    let o = isoform(&args);
    assert_eq!(code(&o), 3);
    assert_eq!(
        stdout(&o),
        "x,y,f,s1,s2\n4,9,2.0,0.0,4.0\n-1,9,error:3:46:square root of the negative number -1,,\n"
    );
    assert!(stderr(&o).contains("1 of 2 rows"));
    assert_eq!(stderr(&isoform(&[&args[..], &["-q"]].concat())), "");
    let p = f.file("bad.csv", "-1 9\n");
    let o = isoform(&["eval", &hf, "--points", &p, "--object", "flat", "--json"]);
    assert_eq!(
        (code(&o), document(&o)["ok"].clone()),
        (4, Value::Bool(false))
    );
}

#[test]
fn errors_have_a_place_and_a_caret() {
    let f = Folder::new("errors");
    let (hf, p) = (
        f.file("bad.hf", "my_model(x[3], a[1])\n{\tmy_model = w; }"),
        f.file("p.csv", "1,2,3\n"),
    );
    let o = isoform(&["eval", &hf, "--points", &p]);
    assert_eq!(code(&o), 2);
    let text = stderr(&o);
    assert!(
        text.starts_with(&format!("error: {hf}:2:14: `w` has no value here")),
        "{text}"
    );
    assert!(
        text.contains("\n 2 | { my_model = w; }\n   |              ^"),
        "{text}"
    );
    let o = isoform(&["eval", &hf, "--points", &p, "--json"]);
    let error = document(&o)["error"].clone();
    assert_eq!(
        (
            error["where"]["line"].as_u64(),
            error["where"]["column"].as_u64()
        ),
        (Some(2), Some(14))
    );
    assert_eq!(error["code"], "syntax");

    let hf = f.file("ball.hf", BALL);
    let o = isoform(&[
        "eval",
        &hf,
        "--points",
        &f.file("q.csv", "1,2,3\n1,oops,3\n"),
    ]);
    assert!(
        code(&o) == 2 && stderr(&o).contains("q.csv:2:3: `oops`"),
        "{}",
        stderr(&o)
    );
    let o = isoform(&["eval", &hf, "--points", &f.path("absent.csv")]);
    assert!(code(&o) == 2 && stderr(&o).contains("absent.csv"));
    let o = isoform(&[
        "eval",
        &hf,
        "--points",
        &p,
        "-o",
        &f.path("no/such/folder.csv"),
    ]);
    assert!(code(&o) == 2 && stderr(&o).contains("folder.csv"));
}

#[test]
fn wrong_usage_exits_1() {
    let f = Folder::new("usage");
    let (hf, p) = (f.file("ball.hf", BALL), f.file("p.csv", "1,2,3\n"));
    for extra in [
        &["--params", "1,2"][..],
        &["--params", "one"],
        &["--object", "cube"],
        &["--threads", "0"],
        &["--time-limit", "soon"],
        &["--nothing"],
    ] {
        let o = isoform(&[&["eval", &hf, "--points", &p], extra].concat());
        assert!(
            code(&o) == 1 && !o.stderr.is_empty() && o.stdout.is_empty(),
            "{extra:?}"
        );
        let o = isoform(&[&["eval", &hf, "--points", &p, "--json"], extra].concat());
        assert!(
            code(&o) == 1 && document(&o)["error"]["code"] == "usage",
            "{extra:?}"
        );
    }
    assert_eq!(code(&isoform(&[])), 1);
    assert_eq!(code(&isoform(&["eval"])), 1);
    let help = isoform(&["eval", "--help"]);
    assert!(code(&help) == 0 && stdout(&help).contains("isoform eval part.hf"));
    assert!(stdout(&isoform(&["completions", "bash"])).contains("isoform"));
}

#[test]
fn threads_do_not_change_a_byte() {
    let f = Folder::new("threads");
    let hf = f.file("ball.hf", BALL);
    let points: String = (0..20_000)
        .map(|i| format!("{},{},1\n", f64::from(i) * 0.37, f64::from(i % 17)))
        .collect();
    let p = f.file("p.csv", points);
    let run = |n: &str| isoform(&["eval", &hf, "--points", &p, "--threads", n]).stdout;
    let one = run("1");
    assert!(one.len() > 20_000 && one == run("3"));
}

#[test]
fn a_closed_pipe_is_no_error() {
    let f = Folder::new("pipe");
    let hf = f.file("ball.hf", BALL);
    let p = f.file("p.csv", "1.5,2.5,3.5\n".repeat(50_000));
    let mut child = Command::new(env!("CARGO_BIN_EXE_isoform"))
        .args(["eval", &hf, "--points", &p])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    drop(child.stdout.take());
    let o = child.wait_with_output().expect("it ends");
    assert_eq!((code(&o), stderr(&o)), (0, String::new()));
}

#[test]
fn stdin_is_a_dash() {
    let f = Folder::new("stdin");
    let p = f.file("p.csv", "1,0,0\n");
    let mut child = Command::new(env!("CARGO_BIN_EXE_isoform"))
        .args(["eval", "-", "--points", &p, "-o", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("it starts");
    child
        .stdin
        .take()
        .expect("a pipe")
        .write_all(BALL.as_bytes())
        .expect("written");
    let o = child.wait_with_output().expect("it ends");
    assert_eq!(stdout(&o), "x,y,z,f\n1,0,0,3.0\n");
}

#[test]
fn late_rows_say_so() {
    let f = Folder::new("late");
    let hf = f.file(
        "slow.hf",
        "m(x[1], a[1]) { v = 0; while v < 100000 loop v = v + 1; endloop; m = v; }",
    );
    let p = f.file("p.csv", "1\n".repeat(2000));
    let o = isoform(&["eval", &hf, "--points", &p, "--time-limit", "100ms"]);
    assert!(
        code(&o) == 3 && stdout(&o).contains("time limit"),
        "{}",
        stderr(&o)
    );
    assert_eq!(stdout(&o).lines().count(), 2001);
}

#[test]
fn old_comments_in_latin_1_are_read() {
    let f = Folder::new("latin");
    let hf = f.file(
        "old.hf",
        b"-- gr\xf6\xdfer\r\nmy_model(x[3],a[1]){ my_model=1; }\r\n",
    );
    let o = isoform(&["eval", &hf, "--points", &f.file("p.csv", "0,0,0")]);
    assert_eq!((code(&o), stdout(&o).as_str()), (0, "x,y,z,f\n0,0,0,1.0\n"));
}
