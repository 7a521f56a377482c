//! What all tests of the binary share.

use serde_json::Value;
use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The unit sphere as a map.
pub(crate) const SPHERE: &str =
    r#"{"X": "2*s", "Y": "2*t", "Z": "s^2 + t^2 - 1", "W": "s^2 + t^2 + 1"}"#;
/// The unit square.
pub(crate) const PATCH: &str = r#"{"patches": [{"degree": [1, 1], "max_distance": 1e-6,
    "control": [[[0, 0, 0, 1], [0, 1, 0, 1]], [[1, 0, 0, 1], [1, 1, 0, 1]]]}]}"#;
/// Four points, as a table.
pub(crate) const POINTS: &str = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
/// A ball of radius 3 with a void of radius 2 and a ball of radius 1 within.
pub(crate) const NESTED: &str = "m(x[3], a[1]) { r = x[1]^2 + x[2]^2 + x[3]^2; \
    m = ((9 - r) & (r - 4)) | (1 - r); }\n";
/// A boss of radius 1 on a plate of radius 2, joined by a parabola of width 0.3 that turns about z.
pub(crate) const FILLET: &str = "m(x[3], a[1]) { r = sqrt(x[1]*x[1] + x[2]*x[2]); \
    top = -x[3]; side = 1 - r; h = max(0.3 - abs(top - side), 0); \
    joined = max(top, side) + h*h/1.2; \
    m = min(joined, min(2 - r, min(x[3] + 0.5, 1 - x[3]))); }\n";

/// Points of a disc of radius 5 and height 2 about (1, 2, 3), without noise.
pub(crate) fn disc() -> String {
    let point = |i: u32| {
        let (t, w) = (f64::from(i) * 2.399_963, (f64::from(i) * 0.754_878).fract());
        let [r, z] = match i % 4 {
            0 => [5.0, 2.0 * w],
            1 => [5.0 * w.sqrt(), 0.0],
            2 => [5.0 * w.sqrt(), 2.0],
            _ => [5.0, 2.0 * (1.0 - w)],
        };
        format!("{} {} {}\n", 1.0 + r * t.cos(), 2.0 + r * t.sin(), 3.0 + z)
    };
    (0..3000).map(point).collect()
}

/// A folder of its own for each test, removed at the end.
pub(crate) struct Folder(pub(crate) PathBuf);

impl Folder {
    pub(crate) fn new(test: &str) -> Self {
        static NUMBER: AtomicUsize = AtomicUsize::new(0);
        let (process, number) = (std::process::id(), NUMBER.fetch_add(1, Ordering::Relaxed));
        let path = std::env::temp_dir().join(format!("isoform-{test}-{process}-{number}"));
        fs::create_dir_all(&path).expect("a folder for the test");
        Self(path)
    }
    pub(crate) fn file(&self, name: &str, text: impl AsRef<[u8]>) -> String {
        fs::write(self.0.join(name), text).expect("written");
        self.path(name)
    }
    pub(crate) fn path(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }
    pub(crate) fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.0.join(name)).expect("a file")
    }
    pub(crate) fn text(&self, name: &str) -> String {
        String::from_utf8(self.bytes(name)).expect("text")
    }
    pub(crate) fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&self.bytes(name)).expect("JSON")
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

pub(crate) fn isoform(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_isoform"))
        .args(args)
        .output()
        .expect("it runs")
}
/// Runs `recover` in the folder.
pub(crate) fn recover(f: &Folder, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_isoform"))
        .arg("recover")
        .args(args)
        .current_dir(&f.0)
        .output()
        .expect("it runs")
}
pub(crate) fn code(o: &Output) -> i32 {
    o.status.code().expect("it ends by itself")
}
pub(crate) fn stdout(o: &Output) -> String {
    String::from_utf8(o.stdout.clone()).expect("text")
}
pub(crate) fn stderr(o: &Output) -> String {
    String::from_utf8(o.stderr.clone()).expect("text")
}
pub(crate) fn document(o: &Output) -> Value {
    serde_json::from_slice(&o.stdout).unwrap_or_else(|e| panic!("{e}: {}", stdout(o)))
}
/// Runs `triangulate MAP ... --json`; the code and the document.
pub(crate) fn triangulate(map: &str, more: &[&str]) -> (i32, Value) {
    let o = isoform(&[&["triangulate", map, "--json", "-q"], more].concat());
    (code(&o), document(&o))
}
