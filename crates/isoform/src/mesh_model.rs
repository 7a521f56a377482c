//! Mesh of a model with its certificate.

use crate::meshing::{Meshable, bounded_complement, meshable};
use crate::report::brief;
use crate::{
    RegionCertificate, certified_adaptation, certified_mesh, certified_regions,
    default_size_within, solid_of,
};
use isoform_check::{Certificate, Limits};
use isoform_control::Control;
use isoform_field::hyperfun::Model;
use isoform_field::{Jump, RunField, SolidError};
use isoform_geom::{Aabb, Field, Mesh, OnePiece, Point3, Solid, UnionFind, cross, dot, sub};
use isoform_mesh::features::ExtentError;
use isoform_mesh::{
    MeshError, Meshed, Options, Region, Warning, WarningKind, check_nodes, mean_edge, own_sizes,
};
use isoform_num::{Interval, Jet2, Real};
use std::collections::BTreeMap;
use std::fmt;

/// Longest edge of a surface that keeps its own sizes, in mean lengths: the long triangles of CAD
/// systems are divided.
const MAX_EDGE_LENGTH_RATIO: f64 = 1.5;

/// Options of the mesh of a model.
///
/// ```
/// use isoform::{MeshModelOptions, mesh};
/// let options = MeshModelOptions {
///     mesh: mesh::Options { surface_only: true, ..mesh::Options::default() },
///     ..MeshModelOptions::default()
/// };
/// assert_eq!(options.size, None); // a fortieth of the diagonal
/// ```
#[derive(Clone, Debug, Default)]
pub struct MeshModelOptions {
    /// Target length of edges, the largest one if sizes vary, in model units. `None` for a fortieth
    /// of the diagonal, or for the lengths of a given mesh.
    pub size: Option<f64>,
    /// Limits of the quantities that the certificate checks.
    pub limits: Limits,
    /// All other options. Its `size` is ignored.
    pub mesh: Options,
}

impl MeshModelOptions {
    /// Returns the options of the surface alone, in a region if one is given, for pages and
    /// pictures.
    pub fn of_surface(region: Option<Aabb>) -> Self {
        Self {
            mesh: Options {
                surface_only: true,
                region,
                ..Options::default()
            },
            ..Self::default()
        }
    }
}

/// Reason why a model has no mesh.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshModelError {
    /// The model does not describe a solid.
    #[error(transparent)]
    Solid(#[from] SolidError),
    /// The program is not an expression, and no box was given: a search for it would have to
    /// examine all of space.
    #[error("the program is no expression, so that its box cannot be found")]
    NoBox,
    /// The function is negative in a bounded set and positive all around it.
    #[error(
        "the solid has no end: f is negative only within ({}) to ({}), and inside is f >= 0: is the \
         sign reversed?", brief_point(bounds.lo), brief_point(bounds.hi)
    )]
    InsideOut {
        /// Box that contains the outside of the solid.
        bounds: Aabb,
    },
    /// The function jumps through 0, and the jump cannot be made a wall.
    #[error(transparent)]
    Jump(#[from] Jump),
    /// A region does not describe a solid.
    #[error("region {name}: {error}")]
    Region {
        /// Name of the region.
        name: String,
        /// Reason why it does not.
        error: SolidError,
    },
    /// The mesher has no result.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Mesh of a model, with its certificate.
#[derive(Debug)]
pub struct ModelMesh {
    /// Mesh, with the features of the model.
    pub meshed: Meshed,
    /// Certificate of the whole mesh.
    pub certificate: Certificate,
    /// Options of the mesher, with the chosen edge length.
    pub options: Options,
    /// Certificate of each region; empty unless regions were requested.
    pub regions: Vec<RegionCertificate>,
    /// Number of triangles that were removed, since no points lie near them.
    pub cut: usize,
    /// True if a box cuts the outside of a bounded set: the sign is probably reversed.
    pub is_inside_out: bool,
}

/// Remark on a mesh, in addition to its warnings.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum MeshNote {
    /// Solids touch in a point or along a line.
    Touching,
    /// A box cuts the solid.
    Caps,
    /// Parts of the solid outside of its box are not excluded by proof.
    BoxNotProved,
    /// Further feature curves are not excluded by proof.
    FeaturesNotProved,
    /// Triangles without points near them were left out, so that the surface has a border.
    Cut,
    /// The box is filled except for a bounded set in which the function is negative.
    InsideOut,
    /// Small pieces are not connected to the rest.
    Loose {
        /// Number of pieces of the solid.
        pieces: usize,
        /// Volume and centre of each small one.
        small: Vec<(f64, Point3)>,
    },
}

impl fmt::Display for MeshNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Loose { pieces, small } => return write_small_pieces(f, *pieces, small),
            Self::Touching => {
                "bodies touch without crossing: the solid has no surface there that a mesh could \
                 follow; move them apart, or into each other"
            }
            Self::Caps => "the box cuts the solid: the cuts are parts named cap",
            Self::BoxNotProved => {
                "nothing more of the solid was found far outside of its box, but that is not \
                 proved; --box says where to look"
            }
            Self::Cut => {
                "no points lie near a part of the surface: it is left out, and the surface has a \
                 border there; --close keeps it as a part named unseen"
            }
            Self::InsideOut => {
                "the function is positive all around a bounded set, and what is meshed is the box \
                 without that: inside is f >= 0; if the sign is reversed, write -f"
            }
            Self::FeaturesNotProved => {
                "it is not proved that every feature curve was found; a smaller --size looks closer"
            }
        })
    }
}

impl ModelMesh {
    /// Returns true if all certificates hold, without warnings.
    pub fn is_as_asked(&self) -> bool {
        self.holds() && self.meshed.warnings.is_empty()
    }

    /// Returns true if the certificate of the whole and those of all regions hold.
    pub fn holds(&self) -> bool {
        let mut all = self.regions.iter().map(|region| &region.certificate);
        self.certificate.is_ok() && all.all(Certificate::is_ok)
    }

    /// Returns remarks on the mesh.
    pub fn notes(&self) -> Vec<MeshNote> {
        let is_pinched = self
            .certificate
            .surface
            .as_ref()
            .is_some_and(|s| !s.pinched_nodes.is_empty() || !s.crowded_edges.is_empty());
        let notes = [
            (is_pinched, MeshNote::Touching),
            (!self.meshed.caps.is_empty(), MeshNote::Caps),
            (!self.meshed.region_certified, MeshNote::BoxNotProved),
            (!self.meshed.features.certified, MeshNote::FeaturesNotProved),
            (self.cut > 0, MeshNote::Cut),
            (self.is_inside_out, MeshNote::InsideOut),
        ];
        let there = notes.into_iter().filter(|note| note.0);
        let there = there.map(|note| note.1);
        there.chain(small_pieces(&self.meshed.mesh)).collect()
    }
}

/// Maximum volume of a piece that is probably a crumb, as a share of the largest piece's volume. A
/// larger one would report intended small pieces.
const MAX_CRUMB_VOLUME_SHARE: f64 = 0.01;
/// Maximum number of small pieces that the message lists.
const MAX_LISTED_PIECES: usize = 5;

/// Writes the message about small pieces.
fn write_small_pieces(
    f: &mut fmt::Formatter<'_>,
    pieces: usize,
    small: &[(f64, Point3)],
) -> fmt::Result {
    let (n, percent) = (small.len(), 100.0 * MAX_CRUMB_VOLUME_SHARE);
    let are = if n == 1 { "is" } else { "are" };
    write!(
        f,
        "{n} of {pieces} pieces {are} smaller than {percent} % of the largest and {are} joined to \
         nothing:"
    )?;
    for (i, (volume, at)) in small.iter().take(MAX_LISTED_PIECES).enumerate() {
        let comma = if i == 0 { "" } else { "," };
        write!(
            f,
            "{comma} volume {} at ({})",
            brief(*volume),
            brief_point(*at)
        )?;
    }
    f.write_str(if n > MAX_LISTED_PIECES { ", ..." } else { "" })
}

/// Returns the pieces of a mesh that are small compared to the largest; `None` without any. In a
/// mesh of the surface, each outward shell bounds a piece.
fn small_pieces(mesh: &Mesh) -> Option<MeshNote> {
    let mesh = mesh.simplices();
    let place = |v: u32| mesh.points[v as usize];
    // Volumes of simplices; of triangles, those of the cones over them from the first point.
    let apex = *mesh.points.first()?;
    let of = |nodes: &[u32], [a, b, c, d]: [Point3; 4]| {
        (nodes[0], dot(sub(b, a), cross(sub(c, a), sub(d, a))) / 6.0)
    };
    let mut sets = UnionFind::new(mesh.points.len());
    let volumes: Vec<(u32, f64)> = if mesh.tets.is_empty() {
        for t in &mesh.triangles {
            sets.unite(t[0], t[1]);
            sets.unite(t[0], t[2]);
        }
        let cone = |t: &[u32; 3]| of(t, [apex, place(t[0]), place(t[1]), place(t[2])]);
        mesh.triangles.iter().map(cone).collect()
    } else {
        for t in &mesh.tets {
            t[1..].iter().for_each(|v| {
                sets.unite(t[0], *v);
            });
        }
        mesh.tets.iter().map(|t| of(t, t.map(place))).collect()
    };
    // Pieces, in the order of their first nodes.
    let mut pieces: BTreeMap<u32, (f64, Aabb)> = BTreeMap::new();
    for (node, volume) in volumes {
        let piece = pieces.entry(sets.root(node)).or_insert((0.0, Aabb::EMPTY));
        piece.0 += volume;
        piece.1.add(place(node));
    }
    pieces.retain(|_, piece| piece.0 > 0.0);
    let largest = pieces
        .values()
        .fold(0.0, |most: f64, piece| most.max(piece.0));
    let small = pieces
        .values()
        .filter(|piece| piece.0 < MAX_CRUMB_VOLUME_SHARE * largest);
    let small: Vec<(f64, Point3)> = small.map(|piece| (piece.0, piece.1.center())).collect();
    (!small.is_empty()).then_some(MeshNote::Loose {
        pieces: pieces.len(),
        small,
    })
}

/// Meshes a model with the values `a` of its parameters directly from the function, and certifies
/// the mesh: topology, shape, distances, feature curves and corners. Missing values are those of
/// [`parameter_values`](crate::parameter_values): a fitted program needs none.
///
/// ```
/// use isoform::{Control, MeshModelOptions, mesh_model, template};
/// let ball = template("sphere").expect("a template of the gallery").model();
/// let made = mesh_model(&ball, &[0.0, 0.0, 0.0, 1.0], &MeshModelOptions::default(), &Control::default())?;
/// let surface = made.certificate.surface.as_ref().expect("was looked at");
/// assert!(made.certificate.is_ok() && surface.euler == 2);
/// assert!((surface.volume / 4.18879 - 1.0).abs() < 0.01);
/// # Ok::<(), isoform::MeshModelError>(())
/// ```
///
/// # Errors
/// [`MeshModelError`] if the model is not a solid, its mesh cannot be computed, or on a stop.
pub fn mesh_model(
    model: &Model,
    a: &[f64],
    options: &MeshModelOptions,
    control: &Control<'_>,
) -> Result<ModelMesh, MeshModelError> {
    mesh_model_or_adapt(model, a, &[], None, options, control)
}

/// Region of a model: its intersection with another model.
#[derive(Clone, Copy, Debug)]
pub struct RegionModel<'a> {
    /// Name of the region.
    pub name: &'a str,
    /// Model that contains the region.
    pub model: &'a Model,
    /// Values of the parameters of that model.
    pub values: &'a [f64],
}

/// Meshes a model in several regions, each with its own tetrahedra; see
/// [`isoform_mesh::mesh_regions`]. The whole and each region are certified.
///
/// ```
/// use isoform::field::hyperfun::{Mode, Model};
/// use isoform::{Control, MeshModelOptions, RegionModel, mesh_model_regions};
/// let text = "core(x[3], a[1]) { core = 0.5^2 - x[1]^2 - x[2]^2 - x[3]^2; }
///     my_model(x[3], a[1]) { my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2; }";
/// let model = Model::parse(text, Mode::Default)?;
/// let core = model.clone().object(Some("core"))?;
/// let options = MeshModelOptions { size: Some(0.1), ..MeshModelOptions::default() };
/// let region = RegionModel { name: "core", model: &core, values: &[0.0] };
/// let made = mesh_model_regions(&model, &[0.0], &[region], &options, &Control::default())?;
/// assert!(made.holds());
/// assert_eq!(made.meshed.mesh.regions, ["core", "rest"]);
/// let core = made.regions[0].certificate.surface.as_ref().expect("was looked at");
/// assert!((core.volume / (4.18879 / 8.0) - 1.0).abs() < 0.02);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`MeshModelError`] if the model or a region is not a solid, the mesh cannot be computed, or on a
/// stop.
pub fn mesh_model_regions(
    model: &Model,
    a: &[f64],
    regions: &[RegionModel<'_>],
    options: &MeshModelOptions,
    control: &Control<'_>,
) -> Result<ModelMesh, MeshModelError> {
    mesh_model_or_adapt(model, a, regions, None, options, control)
}

/// Adapts a mesh from another source, tetrahedra or a surface, to the model that it approximates,
/// and certifies it like a mesh of a model.
///
/// # Errors
/// [`MeshModelError`] if the model is not a solid, the mesh is invalid or has layers, or on a stop.
pub fn adapt_to_model(
    given: &Mesh,
    model: &Model,
    a: &[f64],
    options: &MeshModelOptions,
    control: &Control<'_>,
) -> Result<ModelMesh, MeshModelError> {
    mesh_model_or_adapt(model, a, &[], Some(given), options, control)
}

fn mesh_model_or_adapt(
    model: &Model,
    a: &[f64],
    regions: &[RegionModel<'_>],
    given: Option<&Mesh>,
    options: &MeshModelOptions,
    control: &Control<'_>,
) -> Result<ModelMesh, MeshModelError> {
    control.report("model", 0.0);
    if let Some(mesh) = given {
        no_layers(&options.mesh, "in a mesh that is adapted")?;
        check_given(mesh)?;
    }
    let Meshable { solid, is_run, .. } =
        match meshable(model, a, options.mesh.region, None, control) {
            // A function that is positive everywhere fills the box: the matrix of a composite.
            Err(MeshModelError::Solid(SolidError::NoSurface { inside: true }))
                if options.mesh.region.is_some() =>
            {
                Meshable {
                    solid: Box::new(OnePiece::new(AllSpace, model.name())),
                    is_run: false,
                    parts: None,
                }
            }
            solid => solid?,
        };
    if is_run {
        runs_somewhere(model, a, options.mesh.region)?;
    }
    let mut are_run = is_run;
    let mut solids = Vec::new();
    for region in regions {
        let (solid, is_run) = solid_of(region.model, region.values).map_err(|error| {
            let name = region.name.to_owned();
            MeshModelError::Region { name, error }
        })?;
        are_run |= is_run;
        solids.push(solid);
    }
    let named = regions.iter().zip(&solids).map(|(region, solid)| Region {
        name: region.name,
        solid: solid.as_ref(),
    });
    let regions: Vec<Region<'_>> = named.collect();
    let mut made = mesh_solid_regions(solid.as_ref(), &regions, given, options, control)?;
    if are_run {
        let warning = Warning::of_all(WarningKind::NotProved);
        made.meshed.warnings.push(warning);
    }
    Ok(made)
}

/// Refuses a program that is run statement by statement and fails at the corners and at the centre
/// of the box.
pub(crate) fn runs_somewhere(
    model: &Model,
    a: &[f64],
    region: Option<Aabb>,
) -> Result<(), SolidError> {
    let Some(region) = region else {
        return Ok(());
    };
    let corner = |i: usize| std::array::from_fn(|k| [region.lo, region.hi][i >> k & 1][k]);
    let points: Vec<Point3> = std::iter::once(region.center())
        .chain((0..8).map(corner))
        .collect();
    match RunField::new(model, a)?.fault(&points) {
        Some(error) => Err(error.into()),
        None => Ok(()),
    }
}

/// Refuses layers, except in a mesh of one solid.
pub(crate) fn no_layers(options: &Options, what: &'static str) -> Result<(), MeshError> {
    match options.layers {
        Some(_) => Err(MeshError::NoLayers { what }),
        None => Ok(()),
    }
}

/// Refuses a mesh that cannot be adapted: one with missing nodes, or with wedges, which would not
/// stay thin.
fn check_given(mesh: &Mesh) -> Result<(), MeshError> {
    if mesh.has_layers() {
        let why = "has wedges or quadrilaterals: only triangles and tetrahedra are adapted";
        return Err(MeshError::Input {
            why: why.to_owned(),
        });
    }
    check_nodes(mesh)
}

/// Field that is positive in all of space.
struct AllSpace;

impl Field for AllSpace {
    fn value(&self, _: Point3) -> f64 {
        1.0
    }
    fn jet(&self, _: Point3) -> Jet2 {
        Jet2::constant(1.0)
    }
    fn bounds(&self, _: Aabb) -> Interval {
        Interval::constant(1.0)
    }
}

/// Meshes a solid and certifies the mesh; chooses an edge length if none is given.
pub(crate) fn mesh_solid(
    solid: &dyn Solid,
    options: &MeshModelOptions,
    control: &Control<'_>,
) -> Result<ModelMesh, MeshModelError> {
    mesh_solid_regions(solid, &[], None, options, control)
}

fn mesh_solid_regions(
    solid: &dyn Solid,
    regions: &[Region<'_>],
    given: Option<&Mesh>,
    options: &MeshModelOptions,
    control: &Control<'_>,
) -> Result<ModelMesh, MeshModelError> {
    let size = match options.size {
        Some(size) => size,
        None => {
            own_size(solid, given, options, control).map_err(|e| explained(e, solid, control))?
        }
    };
    let mut inner = Options {
        size,
        ..options.mesh.clone()
    };
    let is_surface = |mesh: &&Mesh| mesh.tets.is_empty();
    if let Some(mesh) = given.filter(is_surface)
        && options.size.is_none()
        && inner.sizes.is_none()
    {
        // A surface keeps its smaller triangles.
        inner.sizes = Some(own_sizes(mesh));
    }
    let limits = options.limits;
    let explained = |e| explained(e, solid, control);
    let (meshed, certificate, certificates) = if let Some(mesh) = given {
        let (meshed, whole) =
            certified_adaptation(mesh, solid, &inner, limits, control).map_err(explained)?;
        (meshed, whole, Vec::new())
    } else if regions.is_empty() {
        let (meshed, whole) = certified_mesh(solid, &inner, limits, control).map_err(explained)?;
        (meshed, whole, Vec::new())
    } else {
        certified_regions(solid, regions, &inner, limits, control).map_err(explained)?
    };
    // The matrix of a composite, or of a cell, is filled on purpose.
    let may_be =
        options.mesh.region.is_some() && regions.is_empty() && inner.periodic == [false; 3];
    let is_inside_out = may_be && bounded_complement(solid, control).is_some();
    Ok(ModelMesh {
        is_inside_out,
        meshed,
        certificate,
        regions: certificates,
        options: inner,
        cut: 0,
    })
}

/// Returns the mesher's error; for an unbounded solid whose complement is bounded, that of a
/// reversed sign.
pub(crate) fn explained(
    error: MeshError,
    solid: &dyn Solid,
    control: &Control<'_>,
) -> MeshModelError {
    if let MeshError::Extent(ExtentError::Unbounded { .. }) = error
        && let Some(bounds) = bounded_complement(solid, control)
    {
        return MeshModelError::InsideOut { bounds };
    }
    error.into()
}

/// Formats a point for messages.
fn brief_point(p: Point3) -> String {
    p.map(brief).join(", ")
}

/// Returns the default edge length: that of a given mesh, or one that suits the solid.
fn own_size(
    solid: &dyn Solid,
    given: Option<&Mesh>,
    options: &MeshModelOptions,
    control: &Control<'_>,
) -> Result<f64, MeshError> {
    Ok(match given {
        Some(mesh) if mesh.tets.is_empty() => MAX_EDGE_LENGTH_RATIO * mean_edge(mesh),
        Some(mesh) => mean_edge(mesh),
        None => default_size_within(solid, &options.mesh, control)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ImplicitSurface, LiveModel};
    use isoform_field::hyperfun::Mode;
    use isoform_mesh::Layers;

    /// Regions, blocks and meshes from other sources cannot have layers, and layers are not
    /// adapted.
    #[test]
    fn layers_are_grown_of_a_model_alone() {
        let ball = "ball(x[3], a[1]) { ball = 1 - x[1]^2 - x[2]^2 - x[3]^2; }";
        let ball = Model::parse(ball, Mode::Default).expect("a program");
        let mut options = MeshModelOptions {
            size: Some(0.5),
            ..MeshModelOptions::default()
        };
        options.mesh.layers = Some(Layers {
            parts: vec!["ball".to_owned()],
            first: 0.01,
            growth: 1.2,
            count: 5,
        });
        let control = Control::default();
        let region = RegionModel {
            name: "core",
            model: &ball,
            values: &[0.0],
        };
        let refused = |made: Result<ModelMesh, MeshModelError>, why: &str| {
            let error = made.expect_err("no mesh").to_string();
            assert!(error.contains(why), "{error}");
        };
        let regions = mesh_model_regions(&ball, &[0.0], &[region], &options, &control);
        refused(regions, "in regions");
        let mut given = Mesh::from_triangles(vec![[0.0; 3]; 6], vec![[0, 1, 2]]);
        let adapted = adapt_to_model(&given, &ball, &[0.0], &options, &control);
        refused(adapted, "adapted");
        options.mesh.layers = None;
        given.wedges = vec![[0, 1, 2, 3, 4, 5]];
        let adapted = adapt_to_model(&given, &ball, &[0.0], &options, &control);
        refused(adapted, "has wedges");
    }

    fn meshed(body: &str, options: &MeshModelOptions) -> Result<ModelMesh, MeshModelError> {
        let text = format!("my_model(x[3], a[1]) {{ {body} }}");
        let model = Model::parse(&text, Mode::Default).expect("a program");
        mesh_model(&model, &[], options, &Control::default())
    }

    /// Sliders move free parameters, and tied ones follow.
    #[test]
    fn tied_parameters_of_live_models_follow() {
        let text = "-- @param a[1] r length typical=2\n-- @param a[2] h length tie=2*r + 1\n\
                    my_model(x[3], a[2]) { array c[3]; c = [0, 0, 0]; \
                    my_model = min(hfCylinderZ(x, c, a[1]), min(x[3], a[2] - x[3])); }";
        let model = Model::parse(text, Mode::Default).expect("a program");
        let live = LiveModel::new(&model, &[], None, &Control::default());
        let mut live = live.expect("a surface").expect("an expression");
        let names: Vec<&str> = live.parameters.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(
            (names, live.values.as_slice()),
            (vec!["r"], &[2.0, 5.0][..])
        );
        assert!((live.distances(&[[0.0, 0.0, 5.5]])[0] + 0.5).abs() < 1e-12);
        live.values[0] = 1.0;
        assert!((live.distances(&[[0.0, 0.0, 3.5]])[0] + 0.5).abs() < 1e-12);
    }

    /// A staircase of three steps, each a unit deep and half a unit high.
    #[test]
    fn jumps_are_walls() {
        let stairs = "k = floor(x[1]); sides = min(min(x[1], 3 - x[1]), min(x[2], 2 - x[2])); \
                      my_model = min(min(0.5*(k + 1) - x[3], x[3]), sides);";
        let options = MeshModelOptions {
            size: Some(0.4),
            ..MeshModelOptions::default()
        };
        let made = meshed(stairs, &options).expect("a mesh");
        let surface = made.certificate.surface.as_ref().expect("was looked at");
        assert!(made.is_as_asked() && surface.euler == 2);
        assert!((surface.volume / (2.0 * (0.5 + 1.0 + 1.5)) - 1.0).abs() < 1e-9);
        let screw = "my_model = min(2 + 0.1*atan2(x[2], x[1]) - x[3], 1 - x[1]^2 - x[2]^2) & x[3];";
        let error = meshed(screw, &options).expect_err("a jump").to_string();
        assert!(
            error.starts_with("`atan2` at 1:47 jumps near (-"),
            "{error}"
        );
    }

    #[test]
    fn a_reversed_sign_is_told() {
        let options = MeshModelOptions::default();
        let ball = "x[1]^2 + (x[2] - 7)^2 + x[3]^2 - 0.01";
        let outside = meshed(&format!("my_model = {ball};"), &options);
        let Err(MeshModelError::InsideOut { bounds }) = outside else {
            panic!("{outside:?}");
        };
        assert!((bounds.center()[1] - 7.0).abs() < 0.05 && bounds.size()[0] < 0.3);
        // A half space and its complement are unbounded.
        let half = meshed("my_model = x[1];", &options).expect_err("no end");
        assert!(matches!(half, MeshModelError::Mesh(_)), "{half}");
        let mut within = MeshModelOptions::of_surface(Some(Aabb {
            lo: [-1.0, 6.0, -1.0],
            hi: [1.0, 8.0, 1.0],
        }));
        within.size = Some(0.1);
        let notes = |body: &str| meshed(body, &within).expect("a mesh").notes();
        assert!(notes(&format!("my_model = {ball};")).contains(&MeshNote::InsideOut));
        assert!(!notes(&format!("my_model = -({ball});")).contains(&MeshNote::InsideOut));
        assert!(!notes("my_model = x[1];").contains(&MeshNote::InsideOut));
    }

    #[test]
    fn small_pieces_are_told() {
        let two = |r: f64| {
            format!(
                "my_model = max(1 - x[1]^2 - x[2]^2 - x[3]^2, {} - (x[1] - 3)^2 - x[2]^2 - x[3]^2);",
                r * r
            )
        };
        for surface_only in [true, false] {
            let mut options = MeshModelOptions {
                size: Some(0.1),
                ..MeshModelOptions::default()
            };
            options.mesh.surface_only = surface_only;
            let notes = |r: f64| meshed(&two(r), &options).expect("a mesh").notes();
            let crumbs = notes(0.2);
            let crumb = crumbs.iter().find_map(|note| match note {
                MeshNote::Loose { pieces, small } => Some((*pieces, small.clone())),
                _ => None,
            });
            let (pieces, small) = crumb.expect("a crumb");
            assert_eq!((pieces, small.len()), (2, 1));
            assert!((small[0].0 / (4.18879 * 0.008) - 1.0).abs() < 0.2);
            assert!((small[0].1[0] - 3.0).abs() < 0.1);
            assert!(
                !notes(0.9)
                    .iter()
                    .any(|n| matches!(n, MeshNote::Loose { .. }))
            );
        }
    }

    #[test]
    fn a_loop_without_end_is_told_at_its_place() {
        let options = MeshModelOptions::default();
        let error = meshed(
            "i = 0; while i < 3 loop i = i; endloop; my_model = 1 - x[1];",
            &options,
        );
        let error = error.expect_err("no end").to_string();
        assert!(error.starts_with("1:31: stopped after"), "{error}");
        // An error in a branch that is never taken does no harm.
        let within = MeshModelOptions {
            size: Some(0.5),
            ..MeshModelOptions::of_surface(Some(Aabb {
                lo: [-2.0; 3],
                hi: [2.0; 3],
            }))
        };
        let body =
            "i = 1; if x[1] > 5 then i = x[i + 8]; endif; my_model = 1 - x[1]^2 - x[2]^2 - x[3]^2;";
        assert!(meshed(body, &within).is_ok());
    }

    #[test]
    fn a_fitted_program_needs_no_values() {
        let ball =
            "my_model(x[3], a[1]) { array c[3]; c = [0, 0, 0]; my_model = hfSphere(x, c, a[1]); }";
        let ball = Model::parse(ball, Mode::Default).expect("a program");
        let fixed = Model::parse(&ball.print_fitted(&[1.5], None), Mode::Default);
        let fixed = fixed.expect("a program");
        assert_eq!(fixed.n_params(), 1);
        let options = MeshModelOptions {
            size: Some(0.5),
            ..MeshModelOptions::default()
        };
        let made = mesh_model(&fixed, &[], &options, &Control::default()).expect("a mesh");
        assert!(made.certificate.is_ok());
        let again = adapt_to_model(
            &made.meshed.mesh,
            &fixed,
            &[],
            &options,
            &Control::default(),
        );
        assert!(again.is_ok_and(|again| again.certificate.is_ok()));
        let surface = ImplicitSurface::of_model(&fixed, &[]).expect("a surface");
        assert_eq!(surface.field.value([1.5, 0.0, 0.0]), 0.0);
        let mut broken = made.meshed.mesh.clone();
        broken.tets[1][2] = 1 << 30;
        let error = adapt_to_model(&broken, &fixed, &[], &options, &Control::default());
        assert_eq!(
            error.expect_err("no such node").to_string(),
            format!(
                "the mesh given has node 1073741824 in tetrahedron 1, but {} nodes (from 0)",
                broken.points.len()
            )
        );
        let many = mesh_model(&fixed, &[1.0, 2.0], &options, &Control::default());
        let many = many.expect_err("one parameter, which is not used");
        assert_eq!(many.to_string(), "2 values for 1 parameters");
    }
}
