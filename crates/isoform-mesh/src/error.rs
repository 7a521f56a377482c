//! Errors and warnings of the mesher.

use crate::features::ExtentError;
use crate::names::REST;
use isoform_control::Stopped;
use isoform_geom::Point3;

/// Error that prevents a mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// The bounding box of the solid was not found.
    #[error(transparent)]
    Extent(ExtentError),
    /// An option has an invalid value.
    #[error("{name} must be {wanted}, not {}", short(*.value))]
    Option {
        /// Name of the option.
        name: &'static str,
        /// Description of valid values.
        wanted: &'static str,
        /// Given value.
        value: f64,
    },
    /// The mesh would exceed the memory limit.
    #[error("a mesh of size {size} takes about {needed} MiB, {allowed} MiB are allowed")]
    Memory {
        /// Requested edge length.
        size: f64,
        /// Estimated memory, in MiB.
        needed: u64,
        /// Memory limit, in MiB.
        allowed: u64,
    },
    /// The machine has too little memory for the mesh, whatever the limit.
    #[error("there is not enough memory: {needed} MiB more are needed")]
    NoMemory {
        /// Failed allocation, in MiB.
        needed: u64,
    },
    /// The function is not a number at a point where the mesh needs it.
    #[error("the function is not a number near ({}, {}, {})", .at[0], .at[1], .at[2])]
    NotANumber {
        /// The point.
        at: Point3,
    },
    /// Two regions have one name, or a region has the name of the remainder.
    #[error("{}", if .name.eq_ignore_ascii_case(REST) {
        format!("no region may be called {REST}, as what is left is")
    } else {
        format!("two regions are called {name}")
    })]
    RegionName {
        /// The name.
        name: String,
    },
    /// A periodic mesh without a box.
    #[error("a periodic mesh needs a box: the cell that repeats")]
    NoBox,
    /// The model differs on two opposite sides of a unit cell.
    #[error(
        "the model does not repeat along {axis}: of ({}, {}, {}) and the place opposite, one is \
         inside and one outside{}",
        .at[0], .at[1], .at[2],
        if .region.is_empty() { String::new() } else { format!(" of region {region}") }
    )]
    NotPeriodic {
        /// Axis across which the sides lie.
        axis: char,
        /// Point on the lower side.
        at: Point3,
        /// Region that contains only one of the two points; empty for the model itself.
        region: String,
    },
    /// The surface of a unit cell lies in a side of its box.
    #[error(
        "the surface{} lies in a side of the box across {axis}, near ({}, {}, {}): whether the \
         cell goes on there as it ends is not to be told",
        if .region.is_empty() { String::new() } else { format!(" of region {region}") },
        .at[0], .at[1], .at[2]
    )]
    InSide {
        /// Axis across which the side lies.
        axis: char,
        /// Point on the lower side.
        at: Point3,
        /// Region whose surface lies there; empty for the model itself.
        region: String,
    },
    /// Layers of wedges, with an option that excludes them.
    #[error("there are no layers {what}")]
    NoLayers {
        /// The conflicting option, in words.
        what: &'static str,
    },
    /// No part of the surface matches a name given for layers.
    #[error("no part of the surface is called {pattern}; its parts are {}", .parts.join(", "))]
    NoPart {
        /// Name, or pattern of names.
        pattern: String,
        /// Names of all parts.
        parts: Vec<String>,
    },
    /// Layers would have to end where the surface continues smoothly, or at a concave edge.
    #[error(
        "layers on {part} cannot end at {other}, near ({}, {}, {}): the two parts meet smoothly \
         there, or at an edge that the solid turns around",
        .at[0], .at[1], .at[2]
    )]
    LayersEnd {
        /// Part with layers.
        part: String,
        /// Adjacent part without layers.
        other: String,
        /// Point where they meet.
        at: Point3,
    },
    /// The layers are thicker than the solid allows.
    #[error(
        "layers {thickness:.3e} thick {}",
        match .at {
            Some(p) => format!("have no room near ({}, {}, {})", p[0], p[1], p[2]),
            None => "leave nothing of the solid".to_owned(),
        }
    )]
    NoRoom {
        /// Total thickness of the layers.
        thickness: f64,
        /// Point where they do not fit; `None` if nothing of the solid remains.
        at: Option<Point3>,
    },
    /// Layers were requested on a part without slope bounds over boxes.
    #[error("there are no layers on {part}: bounds of its slope are not known")]
    NoSlopes {
        /// Name of the part.
        part: String,
    },
    /// The solid is so thin or small that the lattice does not detect it.
    #[error("nothing of the solid is seen at size {size}")]
    TooCoarse {
        /// Requested edge length.
        size: f64,
    },
    /// A mesh given for adaptation is not a valid mesh of the solid.
    #[error("the mesh given {why}")]
    Input {
        /// Reason, as a clause after "the mesh given".
        why: String,
    },
    /// Invalid numbers of blocks.
    #[error(
        "there cannot be {} x {} x {} blocks: this size has room for 1 x 1 x 1 to {} x {} x {}",
        .asked[0], .asked[1], .asked[2], .most[0], .most[1], .most[2]
    )]
    Blocks {
        /// Requested blocks per axis.
        asked: [usize; 3],
        /// Maximum number of blocks per axis.
        most: [usize; 3],
    },
    /// The faces of neighbouring blocks do not match.
    #[error(
        "{count} faces between blocks have no partner, one near ({}, {}, {})",
        .at[0], .at[1], .at[2]
    )]
    Apart {
        /// Number of faces without a partner.
        count: usize,
        /// Point on one of them.
        at: Point3,
    },
    /// Internal error (a bug in isoform).
    #[error("the mesher made an error of its own: {what}")]
    Internal {
        /// Description of the error.
        what: String,
    },
    /// Cancelled, or out of time.
    #[error("stopped")]
    Stopped,
}

impl From<Stopped> for MeshError {
    fn from(_: Stopped) -> Self {
        Self::Stopped
    }
}

impl From<ExtentError> for MeshError {
    fn from(error: ExtentError) -> Self {
        match error {
            ExtentError::Stopped => Self::Stopped,
            ExtentError::NotANumber { at } => Self::NotANumber { at },
            error => Self::Extent(error),
        }
    }
}

/// A place where the mesh may not meet the request.
#[derive(Clone, Debug, PartialEq)]
pub struct Warning {
    /// Kind of the warning.
    pub kind: WarningKind,
    /// Place; `None` if it concerns the whole mesh.
    pub at: Option<Point3>,
}

/// Reasons why a mesh may not follow the solid.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum WarningKind {
    /// The memory limit was reached before sizes were as small as requested.
    SizesCutShort,
    /// Sheets of the surface lie closer together than the lattice resolves.
    TooFine,
    /// This many tetrahedra could not be cut completely.
    NotCut(usize),
    /// A face of the surface does not lie on a single part.
    StrayFace,
    /// A vertex is not on the surface.
    VertexOff,
    /// A mid node is not on the surface.
    MiddleOff,
    /// A vertex of the given mesh is far from the model.
    VertexFar,
    /// An edge of the model is not matched by edges of the given mesh.
    EdgeLost,
    /// The program is executed statement by statement, so that its edges are unknown.
    NotProved,
    /// The solid has surface where the mesh has none: features too small for it.
    Missed,
    /// The mesh is disconnected where the solid is connected, or closes a hole of the solid.
    Torn,
    /// A region without tetrahedra.
    EmptyRegion(String),
    /// The solid has surface where the mesh has none, because the layers consume the solid there.
    MissedByLayers,
    /// Layers are thinner than requested where the surface is strongly curved.
    ThinLayers {
        /// Smallest total thickness of the layers.
        thickness: f64,
    },
    /// The solid is not exactly periodic: its surface differs between opposite sides of a unit
    /// cell.
    SidesApart {
        /// Axis across which the sides lie.
        axis: char,
        /// Distance between the two surfaces.
        by: f64,
    },
}

impl std::fmt::Display for WarningKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Self::SidesApart { axis, by } = self {
            return write!(
                f,
                "the model does not quite repeat along {axis}: at opposite places of the box its \
                 surface is {by:.1e} apart"
            );
        }
        if let Self::NotCut(count) = self {
            return write!(
                f,
                "{count} tetrahedra could not be cut to the end: pieces touch too often for this \
                 size"
            );
        }
        if let Self::ThinLayers { thickness } = self {
            return write!(
                f,
                "the surface bends too much for layers as thick as asked for: here they are \
                 {thickness:.3e} thick"
            );
        }
        if let Self::EmptyRegion(name) = self {
            return write!(
                f,
                "region {name} has no tetrahedra: nothing of the solid lies in it alone, or less \
                 than the size shows"
            );
        }
        f.write_str(match self {
            Self::SizesCutShort => {
                "sizes were not refined as far as asked for: the limit of memory was met"
            }
            Self::TooFine => "the surface is finer than the mesh can resolve here",
            Self::NotCut(_) => "tetrahedra could not be cut to the end",
            Self::EmptyRegion(_) => "a region has no tetrahedra",
            Self::ThinLayers { .. } => "layers are thinner than asked for",
            Self::SidesApart { .. } => "the model does not quite repeat",
            Self::StrayFace => "a face of the surface lies on no single part",
            Self::VertexOff => "a vertex could not be brought onto the surface",
            Self::MiddleOff => "a mid-edge node could not be brought onto the surface",
            Self::VertexFar => "a vertex of the mesh given lies nowhere near the model",
            Self::EdgeLost => "the mesh given cannot be made to follow an edge of the model",
            Self::Missed => {
                "the mesh misses a part of the solid that is smaller than its triangles; a smaller \
                 --size shows it"
            }
            Self::MissedByLayers => {
                "the mesh misses a part of the solid: the layers leave nothing of it, or it is \
                 smaller than the triangles; thinner layers or a smaller --size show it"
            }
            Self::Torn => {
                "the mesh is in pieces where the solid hangs together, or closes a narrow hole; a \
                 smaller --size shows it"
            }
            Self::NotProved => {
                "the program is no expression: it was meshed as one smooth part, its edges are \
                 rounded and nothing is proved"
            }
        })
    }
}

impl Warning {
    /// Creates a warning that concerns the whole mesh.
    pub fn of_all(kind: WarningKind) -> Self {
        Self { kind, at: None }
    }

    /// Creates a warning about a place.
    pub(crate) fn at(kind: WarningKind, at: Point3) -> Self {
        Self { kind, at: Some(at) }
    }

    /// Creates one warning per place.
    pub(crate) fn each(kind: WarningKind, places: impl IntoIterator<Item = Point3>) -> Vec<Self> {
        places
            .into_iter()
            .map(|at| Self::at(kind.clone(), at))
            .collect()
    }
}

/// Formats a number, in scientific notation if it is very small or very large.
fn short(value: f64) -> String {
    match value.abs() {
        size if size > 0.0 && !(1e-6..1e15).contains(&size) => format!("{value:e}"),
        _ => value.to_string(),
    }
}
