//! What the name of a per-point value says: one table for all formats whose columns have names.

use crate::collect::{Collector, ColorScale};
use isoform_geom::Point3;

/// Where a value of a row goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Role {
    /// A coordinate.
    Position(usize),
    /// A component of the normal.
    Normal(usize),
    /// Red, green or blue.
    Color(usize),
    /// A value of a column.
    Column(usize),
    /// Nothing is kept of it.
    Ignored,
}

/// Position, normal or colour by name; `None` for any other column.
pub(crate) fn role_named(name: &str) -> Option<Role> {
    Some(match name.to_ascii_lowercase().as_str() {
        "x" | "points:0" => Role::Position(0),
        "y" | "points:1" => Role::Position(1),
        "z" | "points:2" => Role::Position(2),
        "nx" | "n_x" | "normal_x" | "normalx" | "normals:0" => Role::Normal(0),
        "ny" | "n_y" | "normal_y" | "normaly" | "normals:1" => Role::Normal(1),
        "nz" | "n_z" | "normal_z" | "normalz" | "normals:2" => Role::Normal(2),
        "red" | "r" | "diffuse_red" => Role::Color(0),
        "green" | "g" | "diffuse_green" => Role::Color(1),
        "blue" | "b" | "diffuse_blue" => Role::Color(2),
        _ => return None,
    })
}

/// The roles of the values of a row, in their order.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    /// Role of each value of a row.
    pub(crate) roles: Vec<Role>,
    /// Names of the columns, in the order of their numbers.
    pub(crate) columns: Vec<String>,
    /// What the numbers of colours mean, where the format says so.
    pub(crate) scale: Option<ColorScale>,
    /// Whether all three components of a normal are there.
    normals: bool,
    /// Whether all three components of a colour are there.
    colors: bool,
}

impl Layout {
    /// By names; a name that comes twice is a column the second time.
    pub(crate) fn named<'a>(names: impl IntoIterator<Item = &'a str>) -> Self {
        let mut layout = Self::default();
        for name in names {
            let role = match role_named(name) {
                Some(role) if !layout.roles.contains(&role) => role,
                _ => layout.column(name),
            };
            layout.roles.push(role);
        }
        layout
    }
    /// A new column of this name.
    pub(crate) fn column(&mut self, name: &str) -> Role {
        self.columns.push(name.to_owned());
        Role::Column(self.columns.len() - 1)
    }
    /// Takes the role of value `i` away.
    pub(crate) fn ignore(&mut self, i: usize) {
        if let Role::Column(k) = std::mem::replace(&mut self.roles[i], Role::Ignored) {
            self.columns.remove(k);
            for role in &mut self.roles {
                if let Role::Column(j) = role
                    && *j > k
                {
                    *j -= 1;
                }
            }
        }
    }
    /// Whether a value of the row has this role.
    pub(crate) fn has(&self, role: Role) -> bool {
        self.roles.contains(&role)
    }
    /// The first coordinate that is missing.
    pub(crate) fn missing_coordinate(&self) -> Option<&'static str> {
        (0..3)
            .find(|&k| !self.has(Role::Position(k)))
            .map(|k| ["x", "y", "z"][k])
    }
    /// Tells the collector what will come. Incomplete triples are no normals and no colours and are
    /// ignored.
    pub(crate) fn announce(&mut self, collector: &mut Collector) {
        self.normals = (0..3).all(|k| self.has(Role::Normal(k)));
        self.colors = (0..3).all(|k| self.has(Role::Color(k)));
        if self.normals {
            collector.with_normals();
        }
        if self.colors {
            collector.with_colors(self.scale.unwrap_or(ColorScale::Guess));
        }
        collector.with_columns(self.columns.iter().cloned());
    }
    /// Offers a row; call [`announce`](Self::announce) before.
    #[inline]
    pub(crate) fn offer(&self, collector: &mut Collector, values: &[f64]) {
        let (mut p, mut n, mut c): (Point3, Point3, Point3) = ([f64::NAN; 3], [0.0; 3], [0.0; 3]);
        for (role, &v) in self.roles.iter().zip(values) {
            match *role {
                Role::Position(k) => p[k] = v,
                Role::Normal(k) => n[k] = v,
                Role::Color(k) => c[k] = v,
                Role::Column(_) | Role::Ignored => {}
            }
        }
        let Some(slot) = collector.offer(p) else {
            return;
        };
        if self.normals {
            collector.set_normal(slot, n);
        }
        if self.colors {
            collector.set_color(slot, c);
        }
        if !self.columns.is_empty() {
            for (role, &v) in self.roles.iter().zip(values) {
                if let Role::Column(k) = *role {
                    collector.set_column(slot, k, v);
                }
            }
        }
    }
}
