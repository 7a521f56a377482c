//! Meaning of the names of per-point values: one table for all formats with named columns.

use crate::collect::{Collector, ColorScale};
use isoform_geom::Point3;

/// Destination of a value of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Role {
    /// Coordinate.
    Position(usize),
    /// Component of the normal.
    Normal(usize),
    /// Red, green or blue.
    Color(usize),
    /// Value of a column.
    Column(usize),
    /// Discarded.
    Ignored,
}

/// Returns the position, normal or colour of a name; `None` for any other column.
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

/// Roles of the values of a row, in order.
#[derive(Debug, Default)]
pub(crate) struct RowLayout {
    /// Role of each value of a row.
    pub(crate) roles: Vec<Role>,
    /// Names of the columns, by column index.
    pub(crate) columns: Vec<String>,
    /// Scale of colours; `None` if the format does not state it.
    pub(crate) scale: Option<ColorScale>,
    /// True if all three components of a normal are present.
    normals: bool,
    /// True if all three components of a colour are present.
    colors: bool,
}

impl RowLayout {
    /// Creates the layout of named values; a repeated name becomes a column.
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
    /// Adds a column of this name.
    pub(crate) fn column(&mut self, name: &str) -> Role {
        self.columns.push(name.to_owned());
        Role::Column(self.columns.len() - 1)
    }
    /// Marks value `i` as ignored.
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
    /// Returns true if a value of the row has this role.
    pub(crate) fn has(&self, role: Role) -> bool {
        self.roles.contains(&role)
    }
    /// Returns the name of the first missing coordinate.
    pub(crate) fn missing_coordinate(&self) -> Option<&'static str> {
        (0..3)
            .find(|&k| !self.has(Role::Position(k)))
            .map(|k| ["x", "y", "z"][k])
    }
    /// Announces the values of the rows to the collector. Incomplete normals and colours are
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
    /// Passes a row to the collector; [`announce`](Self::announce) must be called before.
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
