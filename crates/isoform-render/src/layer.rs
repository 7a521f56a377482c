//! Layers of a scene: models, points, meshes, patches, maps and solids, with their colours.

use crate::color::{Color, Scale, part_color};
use crate::exact::{Exact, Forms};
use crate::model::Model;
use crate::section::Section;
use crate::shade;
use crate::surface::{Lid, MIN_INCIDENCE_SINE, Paint, Surface, cut_of, is_closed, quality};
use isoform::geom::{Aabb, Mesh, Point3, PointCloud, RationalPatch, Solid, distance_squared};
use isoform::tess::{Map, Surface as MapSurface};
use isoform::{Control, Stopped, flat_triangles};
use std::collections::HashSet;
use std::fmt;

/// Quantity by which a layer is coloured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorBy {
    /// One colour for all.
    None,
    /// Part, face, patch or unit triangle of parameters.
    Part,
    /// Deviation, positive outside.
    Deviation,
    /// Quality of triangles or tetrahedra.
    Quality,
    /// Parameter u.
    U,
    /// Parameter v.
    V,
    /// Largest distance of a patch from its surface, as given in its file.
    Bound,
    /// Colours of the file.
    File,
}

impl ColorBy {
    /// All quantities with their names.
    pub const ALL: [(&'static str, Self); 8] = [
        ("none", Self::None),
        ("part", Self::Part),
        ("deviation", Self::Deviation),
        ("quality", Self::Quality),
        ("u", Self::U),
        ("v", Self::V),
        ("bound", Self::Bound),
        ("file", Self::File),
    ];

    /// Returns its name.
    pub fn name(self) -> &'static str {
        let found = Self::ALL.iter().find(|(_, by)| *by == self);
        found.map_or("none", |(name, _)| name)
    }
}

impl fmt::Display for ColorBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Meaning of the colours of a layer.
#[derive(Clone, Debug, PartialEq)]
pub enum Key {
    /// Scale of values.
    Scale(Scale),
    /// Names with their colours.
    Parts(Vec<(String, Color)>),
}

/// Curve drawn on a layer.
#[derive(Clone, Debug)]
pub(crate) struct Polyline {
    pub(crate) points: Vec<Point3>,
    pub(crate) color: Color,
}

/// Geometry of a layer.
#[derive(Debug)]
pub(crate) enum Body {
    Model {
        /// True if the surface has two sides and no caps.
        is_surface: bool,
        model: Box<Model>,
        /// Colours of its pieces; `None` if parts have no colours.
        colors: Option<Vec<Color>>,
    },
    Surface(Box<Surface>),
    Points {
        points: Vec<Point3>,
        /// One colour for each point, or one for all.
        colors: Vec<Color>,
        /// Distance by which points may lie behind a surface and still be visible: a model does not
        /// hide points that lie inside it by their deviation.
        lift: f64,
    },
}

/// Layer of a scene.
#[derive(Debug)]
pub struct Layer {
    /// Name of the object.
    pub name: String,
    /// Kind of the object, in a word.
    pub kind: &'static str,
    /// Quantity by which it is coloured.
    pub color_by: ColorBy,
    /// Quantities by which it can be coloured.
    pub modes: Vec<ColorBy>,
    /// Meaning of its colours; `None` if they have none.
    pub key: Option<Key>,
    pub(crate) body: Body,
    pub(crate) curves: Vec<Polyline>,
}

/// Patch with its name and distance.
#[derive(Clone, Debug)]
pub struct Patch {
    /// Patch.
    pub patch: RationalPatch,
    /// Name of the patch.
    pub name: String,
    /// Largest distance from the surface that it approximates; `None` if unknown.
    pub distance: Option<f64>,
}

/// Model to be shown.
pub struct ShownModel<'a> {
    /// Function of the model.
    pub solid: Box<dyn Solid>,
    /// Box of its surface, or the part of it to be shown.
    pub bounds: Aabb,
    /// True if the box cuts the solid.
    pub is_cut: bool,
    /// True to draw the surface with two sides and without caps.
    pub is_surface: bool,
    /// Names of its parts in the order of their colours; pieces with other names follow.
    pub names: &'a [String],
}

impl fmt::Debug for ShownModel<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ShownModel")
            .field("bounds", &self.bounds)
            .field("is_cut", &self.is_cut)
            .finish_non_exhaustive()
    }
}

/// Largest number of an entity that a legend lists; it has no room for more.
const MAX_LISTED_ENTITY: f64 = 999.0;

/// Returns the requested quantity if it is available, else the default.
fn chosen(asked: Option<ColorBy>, modes: &[ColorBy], usual: ColorBy) -> ColorBy {
    asked.filter(|by| modes.contains(by)).unwrap_or(usual)
}

impl Layer {
    /// Creates the layer of a model, whose function itself is drawn.
    pub fn model(
        name: &str,
        shown: ShownModel<'_>,
        asked: Option<ColorBy>,
        control: &Control<'_>,
    ) -> Result<Self, Stopped> {
        let modes = vec![ColorBy::None, ColorBy::Part];
        let color_by = chosen(asked, &modes, ColorBy::None);
        let model = Model::new(shown.solid, shown.bounds, shown.is_cut, control)?;
        let mut seen = HashSet::new();
        let all = shown.names.iter().chain(model.names());
        let names: Vec<&String> = all.filter(|n| seen.insert(n.as_str())).collect();
        let number = |name: &String| names.iter().position(|n| *n == name).unwrap_or(0);
        let is_parts = color_by == ColorBy::Part;
        let colors = is_parts.then(|| {
            let pieces = model.names().iter();
            pieces.map(|n| part_color(number(n))).collect()
        });
        let key = is_parts.then(|| parts_key(names.iter().map(|n| (*n).clone())));
        Ok(Self {
            name: name.to_owned(),
            kind: "model",
            color_by,
            modes,
            key,
            body: Body::Model {
                is_surface: shown.is_surface,
                model: Box::new(model),
                colors,
            },
            curves: Vec::new(),
        })
    }

    /// Creates a layer of points, with the given deviations or those of the column `deviation`, if
    /// any. Points with a value above 0 in a column `outlier` are left out of all statistics.
    pub fn points(
        name: &str,
        cloud: &PointCloud,
        deviation: Option<&[f64]>,
        asked: Option<ColorBy>,
    ) -> Self {
        let column = |name: &str| {
            let found = cloud.columns.iter().find(|c| c.name == name);
            found.map(|c| c.values.as_slice())
        };
        let deviation = deviation.or(column("deviation"));
        let has_colors = !cloud.colors.is_empty() && cloud.colors.len() == cloud.points.len();
        let mut modes = vec![ColorBy::None];
        let entities = column("entity");
        modes.extend(entities.map(|_| ColorBy::Part));
        modes.extend(deviation.map(|_| ColorBy::Deviation));
        modes.extend(has_colors.then_some(ColorBy::File));
        let usual = match (entities, has_colors) {
            (Some(_), _) => ColorBy::Part,
            (None, true) => ColorBy::File,
            (None, false) => ColorBy::None,
        };
        let color_by = chosen(asked, &modes, usual);
        let (mut key, mut lift) = (None, 0.0);
        let colors = match (color_by, deviation) {
            (ColorBy::Part, _) => {
                let entities = entities.unwrap_or_default();
                let most = entities.iter().fold(-1.0, |most: f64, e| most.max(*e));
                let names = (0..=most.min(MAX_LISTED_ENTITY) as i64).take_while(|_| most >= 0.0);
                key = Some(parts_key(names.map(|e| format!("entity {e}"))));
                entities.iter().map(|e| entity_color(*e)).collect()
            }
            (ColorBy::Deviation, Some(values)) => {
                let outlier = column("outlier").unwrap_or_default();
                let is_out = |i: usize| outlier.get(i).is_some_and(|v| *v > 0.0);
                let all = values.iter().enumerate();
                let counted: Vec<f64> = all.filter(|(i, _)| !is_out(*i)).map(|v| *v.1).collect();
                let scale = Scale {
                    outliers: values.len() - counted.len(),
                    ..Scale::of_deviations(&counted, None)
                };
                let color = |(i, v): (usize, &f64)| {
                    if is_out(i) {
                        shade::OUTLIER
                    } else {
                        scale.color(*v)
                    }
                };
                let colors = values.iter().enumerate().map(color).collect();
                // Points up to one and a half scales behind a surface are visible, but no farther
                // than a twentieth of the cloud's size.
                let most = 0.05 * cloud.bounds().diagonal();
                lift = (1.5 * scale.upper).min(most);
                key = Some(Key::Scale(scale));
                colors
            }
            (ColorBy::File, _) => cloud.colors.clone(),
            _ => vec![shade::POINT],
        };
        Self {
            name: name.to_owned(),
            kind: "points",
            color_by,
            modes,
            key,
            body: Body::Points {
                points: (0..cloud.points.len()).map(|i| cloud.absolute(i)).collect(),
                colors,
                lift,
            },
            curves: Vec::new(),
        }
    }

    /// Creates the layer of a mesh: its triangles with their edges, and its feature curves. If it
    /// has tetrahedra, a section shows the cut through them. A wedge is drawn as three tetrahedra,
    /// a quadrilateral as two triangles.
    pub fn mesh(
        name: &str,
        mesh: &Mesh,
        asked: Option<ColorBy>,
        section: Option<&Section>,
    ) -> Self {
        Self::triangles(name, "mesh", mesh, asked, section)
    }

    /// Creates the layer of a solid with exact faces, drawn by its triangles with smooth shading
    /// and without their edges.
    pub fn solid(
        name: &str,
        mesh: &Mesh,
        asked: Option<ColorBy>,
        section: Option<&Section>,
    ) -> Self {
        let mut layer = Self::triangles(name, "solid", mesh, asked, section);
        if let Body::Surface(surface) = layer.body {
            let mut surface = surface.smoothed();
            surface.has_edges = false;
            layer.body = Body::Surface(Box::new(surface));
        }
        layer
    }

    /// Creates the layer of a model that is drawn by a mesh instead of its function.
    pub fn meshed_model(
        name: &str,
        mesh: &Mesh,
        asked: Option<ColorBy>,
        section: Option<&Section>,
    ) -> Self {
        Self {
            kind: "model",
            ..Self::solid(name, mesh, asked.or(Some(ColorBy::None)), section)
        }
    }

    fn triangles(
        name: &str,
        kind: &'static str,
        mesh: &Mesh,
        asked: Option<ColorBy>,
        section: Option<&Section>,
    ) -> Self {
        let mesh = &*mesh.simplices();
        let (triangles, parts) = flat_triangles(mesh);
        let has_parts = parts.len() == triangles.len() && !mesh.parts.is_empty();
        let (modes, columns) = modes_of(mesh, has_parts);
        let usual = if kind == "solid" && has_parts {
            ColorBy::Part
        } else {
            ColorBy::None
        };
        let color_by = chosen(asked, &modes, usual);
        let values = columns.iter().find(|(by, _)| *by == color_by).map(|c| c.1);
        let each = |values: &[f64]| {
            triangles
                .iter()
                .map(|t| t.map(|i| values[i as usize]))
                .collect()
        };
        let paint = match (color_by, values) {
            (ColorBy::Part, _) => Paint::Parts((0..mesh.parts.len()).map(part_color).collect()),
            (ColorBy::Quality, _) => {
                let corner = |i: u32| mesh.points[i as usize];
                let all = triangles
                    .iter()
                    .map(|t| [quality(t.map(corner)); 3])
                    .collect();
                let title = "quality of triangles";
                Paint::Values(all, Scale::sequential(title, 1.0, triangles.len()))
            }
            (ColorBy::Deviation, Some(values)) => {
                Paint::Values(each(values), Scale::of_deviations(values, None))
            }
            (by, Some(values)) => {
                let scale = Scale::sequential(by.name(), 1.0, values.len());
                Paint::Values(each(values), scale)
            }
            _ => Paint::Plain(shade::MESH),
        };
        let key = match &paint {
            Paint::Values(_, scale) => Some(Key::Scale(scale.clone())),
            Paint::Parts(_) => Some(parts_key(mesh.parts.iter().cloned())),
            _ => None,
        };
        let mut surface = Surface::new(mesh.points.clone(), triangles, paint);
        surface.lid = lid_of(&surface, mesh, section);
        surface.parts = if has_parts { parts } else { Vec::new() };
        surface.has_edges = true;
        let points = |edge: &[u32; 2]| edge.map(|i| mesh.points[i as usize]).to_vec();
        let edges = mesh.edges.iter();
        let curves = edges.map(|e| Polyline {
            points: points(e),
            color: shade::LINE,
        });
        Self {
            name: name.to_owned(),
            kind,
            color_by,
            modes,
            key,
            body: Body::Surface(Box::new(surface)),
            curves: curves.collect(),
        }
    }

    /// Creates a layer of rational patches. Triangles locate the intersections with rays; points
    /// and normals are those of the patches.
    pub fn patches(name: &str, patches: &[Patch], asked: Option<ColorBy>) -> Self {
        let mut modes = vec![ColorBy::None, ColorBy::Part, ColorBy::U, ColorBy::V];
        let bounds: Vec<Option<f64>> = patches.iter().map(|p| p.distance).collect();
        if bounds.iter().any(Option::is_some) {
            modes.push(ColorBy::Bound);
        }
        let color_by = chosen(asked, &modes, ColorBy::Part);
        let grid = PatchTriangles::new(patches);
        let colors = || (0..patches.len()).map(part_color).collect();
        let by_uv = |k: usize| grid.corners.iter().map(|c| c.map(|uv| uv[k])).collect();
        let count = patches.len();
        let paint = match color_by {
            ColorBy::Part => Paint::Chequered(colors()),
            ColorBy::U => Paint::Values(by_uv(0), Scale::sequential("u", 1.0, count)),
            ColorBy::V => Paint::Values(by_uv(1), Scale::sequential("v", 1.0, count)),
            ColorBy::Bound => {
                let most = bounds.iter().flatten().fold(0.0, |m: f64, v| m.max(*v));
                let title = "largest distance from the surface";
                let value = |p: &u32| [bounds[*p as usize].unwrap_or(f64::NAN); 3];
                Paint::Values(
                    grid.parts.iter().map(value).collect(),
                    Scale::sequential(title, most, count),
                )
            }
            _ => Paint::Plain(shade::MAP),
        };
        let key = match &paint {
            Paint::Values(_, scale) => Some(Key::Scale(scale.clone())),
            Paint::Chequered(_) => Some(parts_key(patches.iter().map(|p| p.name.clone()))),
            _ => None,
        };
        let mut surface = Surface::new(grid.points, grid.triangles, paint);
        // The triangles of patches that overlap are at most this far apart.
        let apart = 1e-3 * surface.bounds().diagonal();
        surface.ranks = (grid.parts.clone(), apart);
        surface.lift = lift_of(patches, surface.bounds().diagonal());
        surface.parts = grid.parts;
        let all = patches.iter().map(|p| p.patch.clone()).collect();
        surface.exact = Some((Exact::Patches(all), grid.corners));
        Self {
            name: name.to_owned(),
            kind: "patches",
            color_by,
            modes,
            key,
            body: Body::Surface(Box::new(surface)),
            curves: Vec::new(),
        }
    }

    /// Creates the layer of a rational surface. Triangles locate the intersections with rays;
    /// points and normals are those of the map. Double curves are drawn on it.
    pub fn map(name: &str, map: &Map, drawn: &MapSurface, asked: Option<ColorBy>) -> Self {
        let modes = vec![ColorBy::None, ColorBy::Part, ColorBy::U, ColorBy::V];
        let color_by = chosen(asked, &modes, ColorBy::None);
        let by_uv = |k: usize| drawn.corners.iter().map(|c| c.map(|uv| uv[k])).collect();
        let scale = |name: &str| {
            let title = format!("{name} of the unit triangles");
            Scale::sequential(&title, 1.0, drawn.triangles.len())
        };
        let (paint, key) = match color_by {
            ColorBy::Part => (
                Paint::Parts(CHARTS.iter().map(|c| c.1).collect()),
                Some(Key::Parts(CHARTS.map(|(n, c)| (n.to_owned(), c)).to_vec())),
            ),
            ColorBy::U => (
                Paint::Values(by_uv(0), scale("u")),
                Some(Key::Scale(scale("u"))),
            ),
            ColorBy::V => (
                Paint::Values(by_uv(1), scale("v")),
                Some(Key::Scale(scale("v"))),
            ),
            _ => (Paint::Plain(shade::MAP), None),
        };
        let mut surface = Surface::new(drawn.points.clone(), drawn.triangles.clone(), paint);
        surface.parts = drawn.charts.iter().map(|c| u32::from(*c)).collect();
        let forms = Forms::new(map, drawn);
        surface.exact = Some((Exact::Map(forms), drawn.corners.clone()));
        let arcs = drawn.double_curve.iter().map(|arc| arc.points.clone());
        // Solitary arcs are dashed: no sheet of the surface passes through them.
        let dash = surface.bounds().diagonal() / 90.0;
        let solitary = drawn.solitary_arcs.iter().flat_map(|arc| dashes(arc, dash));
        let curve = |points: Vec<Point3>| Polyline {
            points,
            color: shade::DOUBLE,
        };
        Self {
            name: name.to_owned(),
            kind: "map",
            color_by,
            modes,
            key,
            body: Body::Surface(Box::new(surface)),
            curves: arcs.chain(solitary).map(curve).collect(),
        }
    }

    /// Returns the distance along a ray by which it may be behind another layer and still be
    /// visible.
    pub(crate) fn most_lift(&self) -> f64 {
        match &self.body {
            Body::Surface(surface) => surface.lift / MIN_INCIDENCE_SINE,
            _ => 0.0,
        }
    }

    /// Returns true if the function of a model is drawn.
    pub fn is_function(&self) -> bool {
        matches!(self.body, Body::Model { .. })
    }

    /// Returns the box of the layer; empty if there is nothing to show.
    pub fn bounds(&self) -> Aabb {
        match &self.body {
            Body::Model { model, .. } => model.bounds,
            Body::Surface(surface) => surface.bounds(),
            Body::Points { points, .. } => Aabb::from_points(points),
        }
    }
}

/// Returns the distance by which patches are lifted: one and a half times their largest distance
/// from the surface that they approximate, to allow for its curvature, but at most a hundredth of
/// their size, which also applies if a distance is unknown.
fn lift_of(patches: &[Patch], diagonal: f64) -> f64 {
    let distances = patches.iter().map(|p| p.distance.unwrap_or(f64::INFINITY));
    (1.5 * distances.fold(0.0, f64::max)).min(0.01 * diagonal)
}

/// Returns every second stretch of a curve, each of the given length.
fn dashes(points: &[Point3], dash: f64) -> Vec<Vec<Point3>> {
    let (mut runs, mut run) = (Vec::new(), Vec::new());
    let mut done = 0.0;
    for pair in points.windows(2) {
        let length = distance_squared(pair[0], pair[1]).sqrt();
        let count = (2.0 * length / dash).ceil().clamp(1.0, 1e4);
        for k in 0..count as usize {
            let at = |k: usize| -> Point3 {
                let share = k as f64 / count;
                std::array::from_fn(|i| pair[0][i] + share * (pair[1][i] - pair[0][i]))
            };
            let number = ((done + k as f64 / count * length) / dash) as u64;
            let is_drawn = number.is_multiple_of(2);
            if is_drawn {
                if run.is_empty() {
                    run.push(at(k));
                }
                run.push(at(k + 1));
            } else if !run.is_empty() {
                runs.push(std::mem::take(&mut run));
            }
        }
        done += length;
    }
    runs.extend((!run.is_empty()).then_some(run));
    runs
}

/// Names and colours of the unit triangles of a map.
const CHARTS: [(&str, Color); 4] = [
    ("s ≥ 0, t ≥ 0", [150, 190, 225]),
    ("s ≤ 0, t ≥ 0", [238, 190, 130]),
    ("s ≤ 0, t ≤ 0", [150, 200, 160]),
    ("s ≥ 0, t ≤ 0", [205, 165, 205]),
];

/// Returns the colour of a point by the number of its entity; negative for none.
fn entity_color(entity: f64) -> Color {
    if entity >= 0.0 {
        part_color(entity as usize)
    } else {
        shade::OUTLIER
    }
}

fn parts_key(names: impl Iterator<Item = String>) -> Key {
    Key::Parts(names.enumerate().map(|(i, n)| (n, part_color(i))).collect())
}

/// Returns the quantities by which a mesh can be coloured, with their columns.
fn modes_of(mesh: &Mesh, has_parts: bool) -> (Vec<ColorBy>, Vec<(ColorBy, &[f64])>) {
    let mut modes = vec![ColorBy::None];
    modes.extend(has_parts.then_some(ColorBy::Part));
    modes.push(ColorBy::Quality);
    let mut columns: Vec<(ColorBy, &[f64])> = Vec::new();
    for column in &mesh.columns {
        let by = match column.name.as_str() {
            "deviation" | "distance" => ColorBy::Deviation,
            "u" => ColorBy::U,
            "v" => ColorBy::V,
            _ => continue,
        };
        if column.values.len() == mesh.points.len() {
            modes.push(by);
            columns.push((by, &column.values));
        }
    }
    (modes, columns)
}

/// Returns the boundary of the solid that is filled where a section cuts a mesh.
fn lid_of(surface: &Surface, mesh: &Mesh, section: Option<&Section>) -> Lid {
    match section {
        Some(section) if !mesh.tets.is_empty() => {
            let cut = cut_of(&mesh.points, &mesh.tets, section, &mesh.tet_regions);
            Lid::Cut(Box::new(cut))
        }
        Some(_) if is_closed(&surface.points, &surface.triangles) => Lid::Own,
        _ => Lid::Open,
    }
}

/// Triangles of patches.
#[derive(Default)]
struct PatchTriangles {
    points: Vec<Point3>,
    triangles: Vec<[u32; 3]>,
    parts: Vec<u32>,
    corners: Vec<[[f64; 2]; 3]>,
}

impl PatchTriangles {
    /// Returns two triangles for each square of each patch, except squares with a corner at
    /// infinity.
    fn new(patches: &[Patch]) -> Self {
        let squares = match patches.len() {
            0..=80 => 32,
            81..=400 => 16,
            _ => 8,
        };
        let at = |i: u32| f64::from(i) / f64::from(squares);
        let mut grid = Self::default();
        for (k, shown) in patches.iter().enumerate() {
            let first = grid.points.len() as u32;
            for i in 0..=squares {
                grid.points
                    .extend((0..=squares).map(|j| shown.patch.point(at(i), at(j))));
            }
            let node = |i: u32, j: u32| first + i * (squares + 1) + j;
            for (i, j) in (0..squares).flat_map(|i| (0..squares).map(move |j| (i, j))) {
                let [a, b, c, d] = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
                for t in [[a, b, c], [a, c, d]] {
                    grid.add(
                        k as u32,
                        t.map(|(i, j)| node(i, j)),
                        t.map(|(i, j)| [at(i), at(j)]),
                    );
                }
            }
        }
        grid
    }

    fn add(&mut self, part: u32, triangle: [u32; 3], corners: [[f64; 2]; 3]) {
        let is_finite = |i: u32| self.points[i as usize].iter().all(|v| v.is_finite());
        if triangle.into_iter().all(is_finite) {
            self.triangles.push(triangle);
            self.parts.push(part);
            self.corners.push(corners);
        }
    }
}

/// Scene: layers, and the plane that cuts them.
#[derive(Debug, Default)]
pub struct Scene {
    /// Layers of the scene.
    pub layers: Vec<Layer>,
    /// Section plane; `None` if nothing is cut.
    pub section: Option<Section>,
}

impl Scene {
    /// Returns the box of all layers; empty if there is nothing.
    pub fn bounds(&self) -> Aabb {
        let mut all = Aabb::EMPTY;
        for bounds in self
            .layers
            .iter()
            .map(Layer::bounds)
            .filter(|b| !b.is_empty())
        {
            all.add(bounds.lo);
            all.add(bounds.hi);
        }
        all
    }

    /// Returns true if the plane leaves any of the box of all layers.
    pub fn is_left(&self) -> bool {
        let b = self.bounds();
        let Some(section) = &self.section else {
            return !b.is_empty();
        };
        let corner = |i: usize| std::array::from_fn(|k| [b.lo, b.hi][i >> k & 1][k]);
        !b.is_empty() && (0..8).any(|i| section.keeps(corner(i)))
    }
}
