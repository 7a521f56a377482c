//! The boundary layers of `isoform mesh --layers`.

use crate::arguments;
use crate::failure::Failure;
use isoform::mesh::Layers;

/// Default ratio of the thicknesses of consecutive layers: suits flow near a wall, and grows slowly
/// enough for other uses.
const GROWTH: f64 = 1.2;
/// Default number of layers.
const COUNT: usize = 5;

/// Faces with boundary layers, and the thickness of the layers.
#[derive(clap::Args)]
#[group(id = "MeshLayers")]
pub(super) struct Args {
    /// Grow layers of wedges inward from these parts of the surface, for flow near walls; * in a
    /// name stands for any characters
    #[arg(
        long,
        value_name = "PART,...",
        value_delimiter = ',',
        conflicts_with_all = ["regions", "periodic", "surface_only", "blocks", "adapt"]
    )]
    pub(super) layers: Vec<String>,
    /// Thickness of the first of the --layers, which lies on the surface
    #[arg(long, value_name = "LENGTH", requires = "layers", allow_negative_numbers = true, value_parser = arguments::positive)]
    first: Option<f64>,
    /// Ratio of the thicknesses of consecutive --layers [default: 1.2]
    #[arg(long, value_name = "FACTOR", requires = "layers", allow_negative_numbers = true, value_parser = arguments::positive)]
    growth: Option<f64>,
    /// Number of --layers [default: 5]
    #[arg(long, value_name = "N", requires = "layers")]
    layer_count: Option<usize>,
}

/// Converts the arguments to options of the library; `None` without --layers.
pub(super) fn read(args: &Args, order: Option<u32>) -> Result<Option<Layers>, Failure> {
    if args.layers.is_empty() {
        return Ok(None);
    }
    let mut parts: Vec<String> = Vec::new();
    for part in args.layers.iter().map(|part| part.trim()) {
        if !parts.iter().any(|known| known == part) {
            parts.push(part.to_owned());
        }
    }
    if parts.iter().any(String::is_empty) {
        return Err(Failure::usage("--layers has an empty name")
            .hint("names of parts, or patterns as 'wall*', with a comma between two"));
    }
    if order == Some(2) {
        return Err(Failure::usage("--layers does not go with --order 2")
            .hint("leave out one of them: wedges have straight edges"));
    }
    let Some(first) = args.first else {
        return Err(
            Failure::usage("--layers needs the thickness of the first one")
                .hint("--first 0.01: five of them, each 1.2 times as thick, are 0.0744 together"),
        );
    };
    Ok(Some(Layers {
        parts,
        first,
        growth: args.growth.unwrap_or(GROWTH),
        count: args.layer_count.unwrap_or(COUNT),
    }))
}
