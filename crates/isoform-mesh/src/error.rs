//! Why there is no mesh, and where it may not follow the solid.

use crate::features::ExtentError;
use crate::regions::REST;
use isoform_control::Stopped;
use isoform_geom::Point3;

/// Why there is no mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// The solid has no box.
    #[error(transparent)]
    Extent(ExtentError),
    /// An option has no meaning.
    #[error("{name} must be {wanted}, not {}", short(*.value))]
    Option {
        /// The option.
        name: &'static str,
        /// What it must be.
        wanted: &'static str,
        /// What it is.
        value: f64,
    },
    /// The mesh would not fit.
    #[error("a mesh of size {size} takes about {needed} MiB, {allowed} MiB are allowed")]
    Memory {
        /// Edge length asked for.
        size: f64,
        /// MiB by estimate.
        needed: u64,
        /// MiB allowed.
        allowed: u64,
    },
    /// The machine has less memory than the mesh takes, whatever is allowed.
    #[error("there is not enough memory: {needed} MiB more are needed")]
    NoMemory {
        /// MiB that are needed at once.
        needed: u64,
    },
    /// The function is not a number at a place where the mesh needs it.
    #[error("the function is not a number near ({}, {}, {})", .at[0], .at[1], .at[2])]
    NotANumber {
        /// Where.
        at: Point3,
    },
    /// A region has the name of another one, or that of what is left.
    #[error("{}", if .name.eq_ignore_ascii_case(REST) {
        format!("no region may be called {REST}, as what is left is")
    } else {
        format!("two regions are called {name}")
    })]
    RegionName {
        /// The name.
        name: String,
    },
    /// A unit cell without a box.
    #[error("a periodic mesh needs a box: the cell that repeats")]
    NoBox,
    /// A model that is to repeat has something else on two sides of its box.
    #[error(
        "the model does not repeat along {axis}: of ({}, {}, {}) and the place opposite, one is \
         inside and one outside{}",
        .at[0], .at[1], .at[2],
        if .region.is_empty() { String::new() } else { format!(" of region {region}") }
    )]
    NotPeriodic {
        /// The axis across which the sides lie.
        axis: char,
        /// A place on the lower side.
        at: Point3,
        /// The region that is another one at the opposite place; empty for the model itself.
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
        /// The axis across which the side lies.
        axis: char,
        /// A place on the lower side.
        at: Point3,
        /// The region whose surface it is; empty for the model itself.
        region: String,
    },
    /// Layers of wedges that go with none of the other options.
    #[error("there are no layers {what}")]
    NoLayers {
        /// What they do not go with.
        what: &'static str,
    },
    /// No part of the surface has a name that layers are asked for on.
    #[error("no part of the surface is called {pattern}; its parts are {}", .parts.join(", "))]
    NoPart {
        /// The name, or pattern of names.
        pattern: String,
        /// The parts that there are.
        parts: Vec<String>,
    },
    /// Layers that would have to end where the surface goes on smoothly, or where it turns away.
    #[error(
        "layers on {part} cannot end at {other}, near ({}, {}, {}): the two parts meet smoothly \
         there, or at an edge that the solid turns around",
        .at[0], .at[1], .at[2]
    )]
    LayersEnd {
        /// The part that has layers.
        part: String,
        /// The part beside it that has none.
        other: String,
        /// Where they meet.
        at: Point3,
    },
    /// Layers that are thicker than the solid has room for.
    #[error(
        "layers {thickness:.3e} thick {}",
        match .at {
            Some(p) => format!("have no room near ({}, {}, {})", p[0], p[1], p[2]),
            None => "leave nothing of the solid".to_owned(),
        }
    )]
    NoRoom {
        /// Thickness of all layers.
        thickness: f64,
        /// Where they have no room; nowhere if there is no place.
        at: Option<Point3>,
    },
    /// A part with layers whose slopes are not known over boxes.
    #[error("there are no layers on {part}: bounds of its slope are not known")]
    NoSlopes {
        /// The part.
        part: String,
    },
    /// The solid is so thin or small that no lattice point or edge meets it.
    #[error("nothing of the solid is seen at size {size}")]
    TooCoarse {
        /// Edge length asked for.
        size: f64,
    },
    /// A mesh given to be adapted is no volume mesh of the solid.
    #[error("the mesh given {why}")]
    Input {
        /// What is wrong with it.
        why: String,
    },
    /// Blocks that cannot be made.
    #[error(
        "there cannot be {} x {} x {} blocks: this size has room for 1 x 1 x 1 to {} x {} x {}",
        .asked[0], .asked[1], .asked[2], .most[0], .most[1], .most[2]
    )]
    Blocks {
        /// Blocks asked for, by axis.
        asked: [usize; 3],
        /// Blocks that are possible, by axis.
        most: [usize; 3],
    },
    /// Blocks that do not meet face to face.
    #[error(
        "{count} faces between blocks have no partner, one near ({}, {}, {})",
        .at[0], .at[1], .at[2]
    )]
    Apart {
        /// How many faces.
        count: usize,
        /// Where one of them is.
        at: Point3,
    },
    /// A fault of the mesher.
    #[error("the mesher made an error of its own: {what}")]
    Internal {
        /// What it left.
        what: String,
    },
    /// Stopped from outside or by time.
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

/// A place where the mesh may not be what was asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Warning {
    /// What happened.
    pub kind: WarningKind,
    /// Where, as far as there is one place.
    pub at: Option<Point3>,
}

/// What may keep a mesh from following the solid.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum WarningKind {
    /// The limit of memory was met before sizes were as small as asked for.
    SizesCutShort,
    /// Sheets of the surface lie closer together than the lattice resolves.
    TooFine,
    /// Tetrahedra, this many, could not be cut to the end.
    NotCut(usize),
    /// A face of the surface that lies on no single part.
    StrayFace,
    /// A vertex that is not on the surface.
    VertexOff,
    /// A node in the middle of an edge that is not on the surface.
    MiddleOff,
    /// A vertex of a mesh given from elsewhere that is far from the model.
    VertexFar,
    /// An edge of the model that the mesh given has no edges for.
    EdgeLost,
    /// The program is run statement by statement: nothing is known of its edges.
    NotProved,
    /// The solid has surface where the mesh has none: features too small for it.
    Missed,
    /// The mesh is in pieces where the solid hangs together, or closes what is open.
    Torn,
    /// A region without tetrahedra.
    EmptyRegion(String),
    /// The solid has surface where the mesh has none, for the layers leave nothing there.
    MissedByLayers,
    /// Layers are thinner than asked for where the surface bends much.
    ThinLayers {
        /// Thickness of all layers where they are thinnest.
        thickness: f64,
    },
    /// The solid does not quite repeat: its surface at one side of a unit cell is not where it is
    /// at the opposite side.
    SidesApart {
        /// The axis across which the sides lie.
        axis: char,
        /// How far the two are apart.
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
    /// A warning that concerns the whole mesh.
    pub fn of_all(kind: WarningKind) -> Self {
        Self { kind, at: None }
    }

    /// A warning of a place.
    pub(crate) fn at(kind: WarningKind, at: Point3) -> Self {
        Self { kind, at: Some(at) }
    }

    /// One warning for each of the places.
    pub(crate) fn each(kind: WarningKind, places: impl IntoIterator<Item = Point3>) -> Vec<Self> {
        places
            .into_iter()
            .map(|at| Self::at(kind.clone(), at))
            .collect()
    }
}

/// A number as text: with a power of ten where its zeros would fill the line.
fn short(value: f64) -> String {
    match value.abs() {
        size if size > 0.0 && !(1e-6..1e15).contains(&size) => format!("{value:e}"),
        _ => value.to_string(),
    }
}
