//! Generates the tables of embedded files: the templates of the gallery, one file each in
//! examples/templates, and the scan in examples/scans.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

const SCAN: &str = "ycb_065-d_cup.ply";

/// Returns a folder of examples. In the repository it is a link; in a package it is a folder next
/// to this program; in a clone without links (Windows) it is found directly.
fn folder(root: &Path, name: &str) -> io::Result<PathBuf> {
    let linked = root.join(name);
    let folder = if linked.is_dir() {
        linked
    } else {
        root.join("../../examples").join(name)
    };
    fs::canonicalize(folder)
}

fn main() -> io::Result<()> {
    let root = PathBuf::from(env::var("CARGO_MANIFEST_DIR").unwrap_or_default());
    let templates = folder(&root, "templates")?;
    println!("cargo::rerun-if-changed={}", templates.display());
    let mut files: Vec<PathBuf> = fs::read_dir(&templates)?
        .filter_map(|e| Some(e.ok()?.path()))
        .filter(|p| p.extension().is_some_and(|e| e == "hf"))
        .collect();
    files.sort();
    let mut table = String::from("&[\n");
    for file in &files {
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        println!("cargo::rerun-if-changed={}", file.display());
        table += &format!(
            "    ({name:?}, include_str!({:?})),\n",
            file.display().to_string()
        );
    }
    table += "]\n";
    let out = PathBuf::from(env::var("OUT_DIR").unwrap_or_default());
    fs::write(out.join("gallery.rs"), table)?;
    let scan = folder(&root, "scans")?.join(SCAN).display().to_string();
    fs::write(out.join("scan.rs"), format!("include_bytes!({scan:?})\n"))
}
