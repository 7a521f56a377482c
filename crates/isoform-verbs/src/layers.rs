//! Files as layers: what `view` and `render` show of them.

use crate::arguments;
use crate::context::Context;
use crate::disk;
use crate::failure::Failure;
use crate::formula;
use crate::kind::{self, is_fitted};
use crate::language::Language;
use crate::memory::{self, MapObject, Object};
use crate::mesh::settings::Settings;
use crate::mesh::work::no_mesh;
use crate::model::{GivenModel, SolidModel};
use crate::parameters::Given;
use crate::solids::FoundSolids;
use crate::triangulate::{self, HalfWidth};
use crate::{gallery, scan, solids, spline};
use isoform::cad::PreparedShape;
use isoform::field::hyperfun::Model;
use isoform::geom::{Aabb, Mesh, PointCloud, RationalPatch};
use isoform::io::{FilePatch, MeshPoints, is_patch_file, read_patches};
use isoform::mesh::MeshError;
use isoform::{
    ExactSolid, Implicit, LiveModel, MeshModelError, MeshModelOptions, PatchesError,
    RationalSurface, Unseen, mesh_model, mesh_spline, solid_of, undefined_at,
};
use serde_json::Value;
use std::path::Path;
use std::sync::Arc;

/// Options for reading files, common to all verbs that show them.
#[derive(clap::Args)]
pub(crate) struct LayerOptions {
    #[command(flatten)]
    given: Given,
    /// Half the width of a box around the origin; or x,y,z of the lower and of the upper corner
    /// [default: that of the file, or one that shows a surface without an end]
    #[arg(long = "box", value_name = "B", allow_hyphen_values = true, value_parser = place)]
    region: Option<ViewRegion>,
    /// Show files that may be both as points or as meshes [default: PLY as points, OBJ, STL, OFF
    /// and 3MF as meshes]
    #[arg(long = "as", value_name = "KIND", value_enum)]
    kind: Option<TriangleDisplay>,
    #[command(flatten)]
    language: Language,
}

/// Form in which a file with points and triangles is shown.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum TriangleDisplay {
    Points,
    Mesh,
}

/// Region of a model to show.
#[derive(Clone, Debug)]
pub(crate) enum ViewRegion {
    /// A cube about the origin.
    Around(HalfWidth),
    /// A box.
    Box(Aabb),
}

impl ViewRegion {
    /// The box.
    pub(crate) fn region(&self) -> Aabb {
        match self {
            Self::Around(half) => Aabb {
                lo: [-half.near; 3],
                hi: [half.near; 3],
            },
            Self::Box(region) => *region,
        }
    }
}

/// Reads half a width, or six numbers.
pub(crate) fn place(text: &str) -> Result<ViewRegion, String> {
    if text.contains(',') {
        arguments::region(text).map(ViewRegion::Box)
    } else {
        triangulate::half_width(text).map(ViewRegion::Around)
    }
}

/// Content of a file as a layer.
pub(crate) enum Layer {
    Points(PointCloud),
    Model(Box<LiveLayer>),
    /// A model in the place of whose function its mesh is shown.
    Meshed(Mesh),
    Mesh(Mesh),
    /// The mesh of a function of `implicitize`, which stands for a smooth surface.
    Spline(Mesh),
    Solid(ExactSolid),
    /// The shape of a STEP file of another program.
    Shape(Box<PreparedShape>),
    Patches(Vec<Patch>),
    Map(Arc<MapObject>),
}

/// A model whose function is shown itself.
pub(crate) struct LiveLayer {
    pub(crate) live: LiveModel,
    pub(crate) title: Option<String>,
    pub(crate) model: Box<Model>,
    /// Values of its parameters.
    pub(crate) values: Vec<f64>,
}

/// A patch of a file.
pub(crate) struct Patch {
    pub(crate) patch: RationalPatch,
    pub(crate) name: String,
    /// The largest distance from its surface that the file tells.
    pub(crate) distance: Option<f64>,
}

impl Layer {
    /// Returns the kind of the layer in a word, as in reports.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Points(_) => "points",
            Self::Model(_) | Self::Meshed(_) => "model",
            Self::Mesh(_) | Self::Spline(_) => "mesh",
            Self::Solid(_) | Self::Shape(_) => "solid",
            Self::Patches(_) => "patches",
            Self::Map(_) => "map",
        }
    }
}

/// Capabilities of the verb that shows the layers.
pub(crate) struct Shower {
    /// Returns true if the verb can show a model's function itself.
    pub(crate) can_draw: fn(&LiveModel) -> bool,
    /// Why the mesh of a model is shown instead.
    pub(crate) why_mesh: &'static str,
}

/// The column of points that says how far they are from a model.
const DEVIATION: &str = "deviation";
/// Largest difference between a column of deviations and the deviations measured from the next
/// model, relative to the column, as root mean squares, for the column to belong to that model.
/// Measured distances are of first order, which changes them by a few per cent near edges; a larger
/// share would accept the deviations of another model.
const OWN: f64 = 0.05;

/// Removes the deviations of a file's points if they were measured from a model other than the
/// first one among the layers, or with other parameters. Deviations are then measured again.
pub(crate) fn drop_foreign_deviations(layers: &mut [Layer]) {
    let model = layers.iter().find_map(|layer| match layer {
        Layer::Model(model) => Some(model.live.clone()),
        _ => None,
    });
    let Some(model) = model else { return };
    for layer in layers {
        let Layer::Points(cloud) = layer else {
            continue;
        };
        let own = cloud.columns.iter().find(|c| c.name == DEVIATION);
        let Some(own) = own else { continue };
        let pairs = own.values.iter().zip(model.deviations(cloud));
        let (mut squares, mut differences) = (0.0, 0.0);
        for (own, measured) in pairs.filter(|(a, b)| a.is_finite() && b.is_finite()) {
            squares += own * own;
            differences += (own - measured).powi(2);
        }
        if differences > OWN * OWN * squares {
            cloud.columns.retain(|c| c.name != DEVIATION);
        }
    }
}

/// The name of a file without its folder.
pub(crate) fn base_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    memory::name(Path::new(name))
}

/// A file being read.
struct File<'a> {
    path: &'a Path,
    name: &'a str,
    reading: &'a LayerOptions,
    shower: &'a Shower,
    context: &'a Context,
}

/// Reads a file as a layer.
pub(crate) fn read(
    path: &Path,
    reading: &LayerOptions,
    shower: &Shower,
    context: &Context,
) -> Result<Layer, Failure> {
    let file = File {
        path,
        name: &base_name(path),
        reading,
        shower,
        context,
    };
    file.read()
}

impl File<'_> {
    fn read(&self) -> Result<Layer, Failure> {
        let path = self.path;
        match memory::find(path) {
            Some(Object::Map(map)) => return Ok(Layer::Map(map)),
            Some(Object::Function(function)) => return self.fitted(&function.0),
            _ => {}
        }
        if path != Path::new("-")
            && let Some(file) = solids::find(path)?
        {
            return match file {
                FoundSolids::Own(file) => {
                    solids::divided(path, *file, None, self.context).map(Layer::Solid)
                }
                FoundSolids::Shape(mut file) => {
                    let shape = solids::prepared(path, &mut file, None, self.context)?;
                    Ok(Layer::Shape(Box::new(shape)))
                }
            };
        }
        if kind::is_json(path) {
            return self.document();
        }
        if kind::is_model(path) || gallery::is_named(path)? {
            let model = gallery::model(path, &self.reading.language, self.context)?;
            return self.model(model);
        }
        if scan::is_mesh(path, None) {
            return self.mesh();
        }
        self.points()
    }

    /// Points, or the mesh that they are the corners of.
    fn points(&self) -> Result<Layer, Failure> {
        let path = self.path;
        let (cloud, report) =
            scan::read_points(path, None, None, MeshPoints::Vertices, self.context)?;
        let usual = if report.format == "ply" {
            TriangleDisplay::Points
        } else {
            TriangleDisplay::Mesh
        };
        let kind = self.reading.kind.unwrap_or(usual);
        let is_mesh = !cloud.triangles.is_empty() && kind == TriangleDisplay::Mesh;
        if is_mesh && path != Path::new("-") {
            return self.mesh();
        }
        self.warn_all(&report.warnings);
        if cloud.points.is_empty() {
            let message = format!("{}: there are no points", path.display());
            return Err(Failure::input("no-points", message)
                .hint("isoform inspect shows what is in the file"));
        }
        Ok(Layer::Points(cloud))
    }

    fn warn_all(&self, warnings: &[impl std::fmt::Display]) {
        for warning in warnings {
            self.context
                .warn(format_args!("{}: {warning}", self.path.display()));
        }
    }

    fn mesh(&self) -> Result<Layer, Failure> {
        let (mesh, report) = scan::read_mesh_file(self.path, None)?;
        self.warn_all(&report.warnings);
        if mesh.triangles.is_empty() && mesh.quads.is_empty() {
            let message = format!("{}: there are no triangles", self.path.display());
            return Err(Failure::input("no-triangles", message)
                .hint("isoform inspect shows what is in the file"));
        }
        Ok(Layer::Mesh(mesh))
    }

    fn region(&self) -> Option<Aabb> {
        self.reading.region.as_ref().map(ViewRegion::region)
    }

    /// A model that moves; one that cannot be shown itself as its mesh.
    fn model(&self, model: GivenModel) -> Result<Layer, Failure> {
        let name = self.name;
        let solid = model.solid(self.path, &self.reading.given, self.region(), self.context)?;
        let SolidModel {
            model,
            values,
            region,
            is_surface,
        } = solid;
        let control = self.context.control();
        let settings = Settings {
            region,
            ..Settings::default()
        };
        let live = LiveModel::new(&model, &values, region, &control);
        let live = live.map_err(|e| no_mesh(&e, name, &settings))?;
        if let Some(mut live) = live.filter(self.shower.can_draw) {
            live.is_surface = is_surface;
            return Ok(Layer::Model(Box::new(LiveLayer {
                live,
                title: model.info().title.clone(),
                model: Box::new(model),
                values,
            })));
        }
        let options = MeshModelOptions::of_surface(region);
        let made = mesh_model(&model, &values, &options, &control);
        let made = made.map_err(|e| no_mesh(&e, name, &settings))?;
        if !made.certificate.is_ok() {
            // What the mesher made of places without a value is nothing to be shown.
            let (solid, _) =
                solid_of(&model, &values).map_err(|e| no_mesh(&e.into(), name, &settings))?;
            if let Some(at) =
                undefined_at(solid.as_ref(), &Aabb::from_points(&made.meshed.mesh.points))
            {
                let undefined = MeshModelError::Mesh(MeshError::NotANumber { at });
                return Err(no_mesh(&undefined, name, &settings));
            }
        }
        self.context
            .warn(format_args!("{name}: {}", self.shower.why_mesh));
        Ok(Layer::Meshed(made.meshed.mesh))
    }

    /// Returns the layer of a JSON document: patches, a function fitted to points, a polynomial, or
    /// a map.
    fn document(&self) -> Result<Layer, Failure> {
        let text = disk::text(disk::read_file(self.path)?);
        let json: Value = serde_json::from_str(&text).unwrap_or_default();
        if is_patch_file(&json) {
            return self.patches(&json);
        }
        if is_fitted(&json) {
            return self.fitted(&spline::of_document(self.path, &json)?);
        }
        if let Some(formula) = formula::of_document(self.path, &json)? {
            return self.model(GivenModel::Formula(Box::new(formula)));
        }
        let (surface, stated) = triangulate::read(self.path, false)?;
        if surface.is_map() {
            self.map(surface, stated)
        } else {
            self.patches(&json)
        }
    }

    /// Patches, with the distances that their file tells.
    fn patches(&self, json: &Value) -> Result<Layer, Failure> {
        let wrong = |e: &dyn std::fmt::Display| {
            Failure::input("not_patches", format!("{}: {e}", self.path.display()))
                .hint("see Patches in docs/rational.md")
        };
        let found = read_patches(json).map_err(|e| wrong(&e))?;
        let told = |k: usize| json["patches"][k]["max_distance"].as_f64();
        let shown = |(k, p): (usize, &FilePatch)| -> Result<Patch, Failure> {
            Ok(Patch {
                patch: p.patch().map_err(|e| wrong(&e))?,
                name: p.name.clone(),
                distance: told(k),
            })
        };
        let list = found
            .iter()
            .enumerate()
            .map(shown)
            .collect::<Result<_, _>>()?;
        Ok(Layer::Patches(list))
    }

    /// The surface of a function that was fitted to points.
    fn fitted(&self, function: &Implicit) -> Result<Layer, Failure> {
        let made = mesh_spline(
            function,
            Unseen::Cut,
            &MeshModelOptions::of_surface(None),
            &self.context.control(),
        );
        let made = made.map_err(|e| no_mesh(&e, self.name, &Settings::default()))?;
        Ok(Layer::Spline(made.meshed.mesh))
    }

    /// A rational surface.
    fn map(&self, map: RationalSurface, stated: Option<HalfWidth>) -> Result<Layer, Failure> {
        let (name, context) = (self.name, self.context);
        let given = match &self.reading.region {
            Some(ViewRegion::Around(half)) => Some(half),
            Some(ViewRegion::Box(_)) => {
                return Err(Failure::usage("maps are cut by a cube about the origin")
                    .hint("--box B, half the width of the cube"));
            }
            None => stated.as_ref(),
        };
        let around = given.map(HalfWidth::surface_box);
        let around = around.or_else(|| match &map {
            RationalSurface::Map(map) => triangulate::shown_box(map, context),
            RationalSurface::Patches(_) => None,
        });
        let Some(around) = around else {
            return Err(Failure::usage(format!(
                "{}: --box with one number is needed",
                self.path.display()
            )));
        };
        let options = map.options(&around, context.global.time_limit);
        let made = map.triangulate(options, false, &context.control());
        let mut made = made.map_err(|e| match e {
            PatchesError::Stopped => triangulate::nothing(name, None, context),
            e => Failure::usage(format!("{}: {e}", self.path.display())),
        })?;
        let of_map = made.maps.pop().zip(made.analyses.pop());
        let (Some((map, analysis)), false) = (of_map, made.surface.triangles.is_empty()) else {
            let nothing = triangulate::nothing(name, Some((&made.surface, &made.options)), context);
            return Err(nothing);
        };
        for finding in &made.surface.findings {
            context.note(format_args!("{name}: {finding}"));
        }
        Ok(Layer::Map(Arc::new(MapObject {
            map,
            surface: made.surface,
            analysis,
            half_width: around.half_width.to_f64_fast(),
        })))
    }
}
