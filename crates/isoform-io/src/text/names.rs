//! Names of columns: the coordinate, normal or colour that a name stands for, and the unit in it.
//!
//! Instruments write `X [mm]`, `PosX`, `X-Koordinate`, `Easting (m)` or `n_x`. A name is split into
//! words; one of them is the axis, one may be a unit, and all others must be known: `Deviation X`
//! is not a coordinate.

use super::separator::Separator;
use crate::input::unit_named;
use crate::roles::{Role, role_named};

/// Words that may accompany the letter of an axis.
const COORDINATE_WORDS: [&str; 39] = [
    "coord",
    "coords",
    "coordinate",
    "coordinates",
    "pos",
    "position",
    "point",
    "points",
    "pt",
    "pnt",
    "loc",
    "location",
    "scan",
    "measured",
    "actual",
    "value",
    "axis",
    "global",
    "world",
    "cartesian",
    "vertex",
    "koordinate",
    "koordinaten",
    "koord",
    "wert",
    "messwert",
    "punkt",
    "ist",
    "achse",
    "coordonnée",
    "coordonnee",
    "coordenada",
    "coordinata",
    "valeur",
    "valor",
    "координата",
    "座標",
    "坐标",
    "좌표",
];
/// Words that mark the component of a normal.
const NORMAL_WORDS: [&str; 5] = ["normal", "normals", "normale", "norm", "n"];
/// Words that may accompany the name of a colour.
const COLOR_WORDS: [&str; 5] = ["color", "colour", "rgb", "diffuse", "scan"];
/// Surveying terms by axis.
const SURVEY_WORDS: [&[&str]; 3] = [
    &[
        "easting",
        "eastings",
        "east",
        "rechtswert",
        "ostwert",
        "ost",
        "est",
        "este",
    ],
    &[
        "northing",
        "northings",
        "north",
        "hochwert",
        "nordwert",
        "nord",
        "norte",
    ],
    &[
        "elevation",
        "elev",
        "height",
        "altitude",
        "höhe",
        "hoehe",
        "cota",
        "quota",
    ],
];
/// Letters for axes in surveying.
const SURVEY_LETTERS: [&str; 3] = ["e", "n", "h"];
/// Words that may accompany surveying terms.
const SURVEY_CONTEXT_WORDS: [&str; 7] = [
    "utm",
    "grid",
    "local",
    "ellipsoidal",
    "orthometric",
    "gps",
    "gnss",
];

/// Precedence of the role of a name; the first is preferred.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum NamePrecedence {
    /// Bare name, or with a unit.
    Exact,
    /// Name with other words.
    Decorated,
    /// Surveying term.
    Survey,
    /// Surveying letter.
    Letter,
}

/// Meaning of a name.
struct ColumnMeaning {
    /// Role and its precedence; `None` for a column.
    role: Option<(Role, NamePrecedence)>,
    /// Unit in the name.
    unit: Option<&'static str>,
}

/// Splits a name into words in lower case; `PosX` has two.
fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut before = ' ';
    for c in name.chars() {
        if !c.is_alphanumeric() || (before.is_lowercase() && c.is_uppercase()) {
            words.push(String::new());
        }
        if c.is_alphanumeric()
            && let Some(word) = words.last_mut()
        {
            word.extend(c.to_lowercase());
        }
        before = c;
    }
    words.retain(|w| !w.is_empty());
    words
}

/// Returns the index of the letter x, y or z.
fn axis(word: &str) -> Option<usize> {
    ["x", "y", "z"].iter().position(|a| *a == word)
}

/// Splits a word at an axis letter at either end, as in `xcoord` or `posx`: the axis and the rest.
fn split_axis(word: &str) -> Option<(usize, &str)> {
    (0..3).find_map(|k| {
        let letter = ["x", "y", "z"][k];
        let rest = word
            .strip_prefix(letter)
            .or_else(|| word.strip_suffix(letter))?;
        let is_known = COORDINATE_WORDS.contains(&rest) || NORMAL_WORDS.contains(&rest);
        (is_known || (rest.len() > 1 && unit_named(rest).is_some())).then_some((k, rest))
    })
}

impl ColumnMeaning {
    /// Interprets a name. A name that ends in `_`, as written by this crate, is that of a column.
    fn interpret(name: &str) -> Self {
        if name.ends_with('_') {
            return Self {
                role: None,
                unit: None,
            };
        }
        let mut words = words(name);
        let mut unit = None;
        if words.len() > 1
            && let Some(last) = words.last().and_then(|w| unit_named(w))
        {
            unit = Some(last);
            words.pop();
            while words.len() > 1 && words.last().is_some_and(|w| matches!(&**w, "in" | "unit")) {
                words.pop();
            }
        }
        let bare = match name.find(['(', '[']) {
            Some(at) if at > 0 => name[..at].trim_end(),
            _ => name,
        };
        let whole = match &words[..] {
            [only] => role_named(only),
            _ => None,
        };
        let role = match whole.or_else(|| role_named(bare)) {
            Some(role) => Some((role, NamePrecedence::Exact)),
            None => Self::interpret_decorated(&words, &mut unit)
                .or_else(|| Self::interpret_surveying(&words)),
        };
        Self { role, unit }
    }

    /// Finds an axis or a colour among known words.
    fn interpret_decorated(
        words: &[String],
        unit: &mut Option<&'static str>,
    ) -> Option<(Role, NamePrecedence)> {
        let (mut k, mut is_normal, mut color) = (None, false, None);
        for word in words {
            let word = &**word;
            if let Some(a) = axis(word).filter(|_| k.is_none()) {
                k = Some(a);
            } else if let Some((a, rest)) = split_axis(word).filter(|_| k.is_none()) {
                k = Some(a);
                is_normal |= NORMAL_WORDS.contains(&rest);
                *unit = unit.or(unit_named(rest));
            } else if let Some(c @ Role::Color(_)) = role_named(word).filter(|_| color.is_none()) {
                color = Some(c);
            } else if NORMAL_WORDS.contains(&word) {
                is_normal = true;
            } else if !COORDINATE_WORDS.contains(&word) && !COLOR_WORDS.contains(&word) {
                return None;
            }
        }
        let role = match (k, color) {
            (Some(k), None) if is_normal => Role::Normal(k),
            (Some(k), None) => Role::Position(k),
            (None, Some(color)) if !is_normal => color,
            _ => return None,
        };
        Some((role, NamePrecedence::Decorated))
    }

    /// Finds a surveying term among known words.
    fn interpret_surveying(words: &[String]) -> Option<(Role, NamePrecedence)> {
        if let [letter] = words
            && let Some(k) = SURVEY_LETTERS.iter().position(|l| l == letter)
        {
            return Some((Role::Position(k), NamePrecedence::Letter));
        }
        let mut found = None;
        for word in words.iter().map(|w| &**w) {
            let k = SURVEY_WORDS.iter().position(|names| names.contains(&word));
            if k.is_some() && found.is_none() {
                found = k;
            } else if !COORDINATE_WORDS.contains(&word) && !SURVEY_CONTEXT_WORDS.contains(&word) {
                return None;
            }
        }
        found.map(|k| (Role::Position(k), NamePrecedence::Survey))
    }
}

/// Returns true if a column of this name, next to coordinates `x`, `y` and `z`, would be read as
/// one of them, as a normal or as a colour.
pub(crate) fn has_role(name: &str) -> bool {
    match ColumnMeaning::interpret(name).role {
        Some((Role::Position(_), rank)) => rank == NamePrecedence::Exact,
        role => role.is_some(),
    }
}

/// Columns with recognised names.
pub(super) struct InterpretedNames {
    /// Names, with recognised ones replaced by those of their roles: `x`, `ny`, `red`.
    pub(super) names: Vec<String>,
    /// Distinct units of the coordinates.
    pub(super) units: Vec<&'static str>,
}

/// Interprets the names of columns; `None` if a coordinate is missing.
pub(super) fn interpret_names(names: &[String]) -> Option<InterpretedNames> {
    let meanings: Vec<ColumnMeaning> = names.iter().map(|n| ColumnMeaning::interpret(n)).collect();
    let first = |role: Role| {
        let ranks = meanings
            .iter()
            .enumerate()
            .filter_map(|(i, m)| match m.role {
                Some((r, rank)) if r == role => Some((rank, i)),
                _ => None,
            });
        ranks.min()
    };
    let places = [0, 1, 2].map(|k| first(Role::Position(k)));
    let [Some(x), Some(y), Some(z)] = places else {
        return None;
    };
    // Single letters mean axes only in pairs: `n` may be a count.
    if (x.0 == NamePrecedence::Letter) != (y.0 == NamePrecedence::Letter) {
        return None;
    }
    let mut told = names.to_vec();
    let mut units = Vec::new();
    for (k, (_, i)) in [x, y, z].into_iter().enumerate() {
        ["x", "y", "z"][k].clone_into(&mut told[i]);
        if let Some(unit) = meanings[i].unit
            && !units.contains(&unit)
        {
            units.push(unit);
        }
    }
    for (names, role) in [
        (["nx", "ny", "nz"], Role::Normal as fn(usize) -> Role),
        (["red", "green", "blue"], Role::Color),
    ] {
        // Incomplete triples remain ordinary columns.
        if let [Some(a), Some(b), Some(c)] = [0, 1, 2].map(|k| first(role(k))) {
            for (name, (_, i)) in names.into_iter().zip([a, b, c]) {
                name.clone_into(&mut told[i]);
            }
        }
    }
    Some(InterpretedNames { names: told, units })
}

/// Returns true if the names include longitude and latitude.
pub(super) fn are_angles(names: &[String]) -> bool {
    let is = |words: [&str; 3]| {
        names
            .iter()
            .any(|n| words.contains(&&*n.to_ascii_lowercase()))
    };
    is(["lat", "latitude", "breite"]) && is(["lon", "longitude", "lng"])
}

/// Splits a line into names; a unit in brackets after a blank belongs to the preceding name.
pub(super) fn split(line: &str) -> Vec<String> {
    let (separator, _) = Separator::detect(line);
    let mut names: Vec<String> = Vec::new();
    for (_, field) in separator.split(line) {
        let name = field
            .trim_matches(['"', '\''])
            .trim_start_matches("//")
            .trim();
        match names.last_mut() {
            Some(before) if separator == Separator::Blank && name.starts_with(['(', '[']) => {
                *before += " ";
                *before += name;
            }
            _ => names.push(name.to_owned()),
        }
    }
    names
}

/// Parses a line of units below the names: one per name, with or without brackets, or empty.
pub(super) fn unit_row(line: &str) -> Option<Vec<&'static str>> {
    let (separator, _) = Separator::detect(line);
    let units = separator.split(line).map(|(_, field)| {
        let bare = field.trim_matches(['(', ')', '[', ']', ' ']).to_lowercase();
        match &*bare {
            "" | "-" => Some(""),
            unit => unit_named(unit),
        }
    });
    let units: Vec<&str> = units.collect::<Option<_>>()?;
    units.iter().any(|u| !u.is_empty()).then_some(units)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_many_instruments() {
        let places = |header: &str| {
            let names = split(header);
            let told = interpret_names(&names)?;
            let at = |n: &str| told.names.iter().position(|m| m == n);
            Some(([at("x")?, at("y")?, at("z")?], told.units))
        };
        for (header, want) in [
            ("name,x,y,z", ([1, 2, 3], vec![])),
            ("Point ID,X [mm],Y [mm],Z [mm]", ([1, 2, 3], vec!["mm"])),
            ("X_mm;Y_mm;Z_mm", ([0, 1, 2], vec!["mm"])),
            ("Z in mm;Y in mm;X in mm", ([2, 1, 0], vec!["mm"])),
            ("X / m\tY / m\tZ / m", ([0, 1, 2], vec!["m"])),
            ("Xmm Ymm Zmm", ([0, 1, 2], vec!["mm"])),
            ("X [mm] Y [mm] Z [mm]", ([0, 1, 2], vec!["mm"])),
            ("X (inch),Y (inch),Z (inch)", ([0, 1, 2], vec!["in"])),
            ("X [µm],Y [µm],Z [µm]", ([0, 1, 2], vec!["um"])),
            (
                "Nr;X-Koordinate;Y-Koordinate;Z-Koordinate",
                ([1, 2, 3], vec![]),
            ),
            ("PosX PosY PosZ", ([0, 1, 2], vec![])),
            (
                "Coordonnée X;Coordonnée Y;Coordonnée Z",
                ([0, 1, 2], vec![]),
            ),
            (
                "Номер,Координата X,Координата Y,Координата Z",
                ([1, 2, 3], vec![]),
            ),
            ("nx,ny,nz,x,y,z", ([3, 4, 5], vec![])),
            (
                "Normal X,Normal Y,Normal Z,Point X,Point Y,Point Z",
                ([3, 4, 5], vec![]),
            ),
            (
                "Nominal X,Nominal Y,Nominal Z,Actual X,Actual Y,Actual Z",
                ([3, 4, 5], vec![]),
            ),
            (
                "Deviation X,Deviation Y,Deviation Z,X,Y,Z",
                ([3, 4, 5], vec![]),
            ),
            (
                "Northing (ft),Easting (ft),Elevation (ft)",
                ([1, 0, 2], vec!["ft"]),
            ),
            ("Pkt;Rechtswert;Hochwert;Höhe", ([1, 2, 3], vec![])),
            ("P,N,E,Z,D", ([2, 1, 3], vec![])),
            ("Points:0,Points:1,Points:2", ([0, 1, 2], vec![])),
            (
                "cartesianX,cartesianY,cartesianZ,intensity",
                ([0, 1, 2], vec![]),
            ),
            ("\"Point, ID\",\"X\",\"Y\",\"Z\"", ([1, 2, 3], vec![])),
        ] {
            assert_eq!(places(header), Some(want), "{header}");
        }
        for header in [
            "n,x,z",
            "dx,dy,dz",
            "Deviation X,Deviation Y,Deviation Z",
            "max,may,maz",
        ] {
            assert_eq!(places(header), None, "{header}");
        }
    }

    #[test]
    fn normals_and_colours_have_names_too() {
        let names = split("X,Y,Z,Normal_X,Normal Y,NormalZ,Color R,G,Blue (0-255),Intensity");
        let told = interpret_names(&names).expect("named").names;
        let want = [
            "x",
            "y",
            "z",
            "nx",
            "ny",
            "nz",
            "red",
            "green",
            "blue",
            "Intensity",
        ];
        assert_eq!(told, want);
    }
}
