//! Random damage to files.

use proptest::prelude::*;

/// Change of a file at a position given as a share of its length.
#[derive(Clone, Debug)]
pub(crate) enum Damage {
    Cut(f64),
    Flip(f64, u8),
    /// Overwrites with bytes.
    Put(f64, Vec<u8>),
    /// Inserts bytes.
    Insert(f64, Vec<u8>),
    /// Repeats a part.
    Repeat(f64, f64),
}

pub(crate) fn damage() -> impl Strategy<Value = Damage> {
    let share = || prop_oneof![0.0..1.0, 0.0..0.1];
    let bytes = || {
        prop_oneof![
            prop::collection::vec(any::<u8>(), 1..12),
            Just(vec![0xff; 8]),
            Just(vec![0xff, 0xff, 0xff, 0x7f]),
            Just(vec![0; 8]),
            prop::sample::select(vec![
                "nan",
                "-1",
                "1e999",
                "4294967295",
                "99999999999999999999",
                "18446744073709551615",
                "\n",
                " ",
                "\0",
                "\r",
                "#",
                "1.5"
            ])
            .prop_map(|s| s.as_bytes().to_vec()),
        ]
    };
    prop_oneof![
        share().prop_map(Damage::Cut),
        (share(), any::<u8>()).prop_map(|(s, b)| Damage::Flip(s, b)),
        (share(), bytes()).prop_map(|(s, b)| Damage::Put(s, b)),
        (share(), bytes()).prop_map(|(s, b)| Damage::Insert(s, b)),
        (share(), share()).prop_map(|(s, t)| Damage::Repeat(s, t)),
    ]
}

pub(crate) fn apply(bytes: &mut Vec<u8>, damage: &Damage) {
    let n = bytes.len();
    let at = |share: f64| (share * n as f64) as usize;
    match damage {
        _ if n == 0 => {}
        Damage::Cut(s) => bytes.truncate(at(*s)),
        Damage::Flip(s, b) => bytes[at(*s)] ^= b,
        Damage::Put(s, new) => bytes
            .iter_mut()
            .skip(at(*s))
            .zip(new)
            .for_each(|(b, n)| *b = *n),
        Damage::Insert(s, new) => {
            bytes.splice(at(*s)..at(*s), new.iter().copied());
        }
        Damage::Repeat(s, t) => {
            let (a, b) = (at(s.min(*t)), at(s.max(*t)));
            let part = bytes[a..b].to_vec();
            bytes.splice(b..b, part);
        }
    }
}
