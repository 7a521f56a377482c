//! Prints a summary of a point file: `cargo run --release -p isoform-io --example points -- FILE
//! [MAX_POINTS]`.

use isoform_io::{ReadOptions, Source, inspect, read};
use std::path::Path;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let Some(file) = arguments.next() else {
        return eprintln!("usage: points FILE [MAX_POINTS]");
    };
    let options = ReadOptions {
        max_points: arguments.next().and_then(|n| n.parse().ok()),
        ..ReadOptions::default()
    };
    let start = std::time::Instant::now();
    match read(Source::Path(Path::new(&file)), None, &options) {
        Ok((cloud, report)) => {
            eprintln!("read in {:.1?}", start.elapsed());
            println!("{:#?}", inspect(&cloud, &report));
            eprintln!("read and inspected in {:.1?}", start.elapsed());
        }
        Err(e) => eprintln!("{e}\n  {}", e.hint),
    }
}
