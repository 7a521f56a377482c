//! Makes the table of the embedded gallery from examples/templates/*.hf: a template is one file
//! there and nothing else.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let folder = Path::new(&env::var("CARGO_MANIFEST_DIR").unwrap_or_default())
        .join("../../examples/templates");
    println!("cargo::rerun-if-changed={}", folder.display());
    let mut files: Vec<PathBuf> = match fs::read_dir(&folder) {
        Ok(entries) => entries
            .filter_map(|e| Some(e.ok()?.path()))
            .filter(|p| p.extension().is_some_and(|e| e == "hf"))
            .collect(),
        Err(_) => Vec::new(),
    };
    files.sort();
    let mut table = String::from("&[\n");
    for file in &files {
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        let file = fs::canonicalize(file)?;
        println!("cargo::rerun-if-changed={}", file.display());
        table += &format!(
            "    ({name:?}, include_str!({:?})),\n",
            file.display().to_string()
        );
    }
    table += "]\n";
    fs::write(
        Path::new(&env::var("OUT_DIR").unwrap_or_default()).join("gallery.rs"),
        table,
    )
}
