//! Property tests of the language: no input causes a panic or an endless loop, and printed programs
//! are read back identically.

use isoform_field::Graph;
use isoform_field::hyperfun::{Mode, Model};
use isoform_num::Jet2;
use proptest::prelude::*;

const PROGRAMS: [&str; 5] = [
    include_str!("../../../../tests/data/hyperfun/comp_testpart.hf"),
    include_str!("../../../../tests/data/hyperfun/comp_sakepot.hf"),
    include_str!("../../../../tests/data/hyperfun/comp_twisted_taper.hf"),
    "-- @param a[1] radius length min=0.1 max=5 start=1 unit=mm : of the ball
-- @param a[2] h length tie=2*radius + 1
b(x[2], a[2], s[2]) { array c[4]; c = [1,-2,3.5e1,.5]; i = 1; while i <= 4 and c[i] < 99 loop s[i/2] = c[i]; i = i + 1; endloop; b = s[1]^2 - -x[1]; }
my_model(x[2], a[2]) { array t[2]; t[1] = 1; if not (x[1] > 2) or (a[1]+1)*2 /= 3 then t[2] = ~x[2]; else t[2] = 0; endif; my_model = b(x, a, t) | t[2] & 1 \\ 2 @ 3; }",
    "my_model(x[3], a[3]) { array o[3], tb[12], en[4], q[6]; o = [0,0,0]; tb = [1,2,3,4,5,6,7,8,9,10,11,12]; en = [1,2,3,4]; q = [0,0,0,1,1,1];
  t = hfA_SmoothLookUpTable(x[1], o, tb, en) + hfConvCurve(x, q, en, 0.1) + hfSpaceMapExp(x, a, a, o) + hfBezierVolume(x, 2, 2, 2, q, tb);
  my_model = hfA_Spline(o, tb, t, 0, 1) + hfDSub(t, x[1], 1, 0.5) + hfConvArc(x, a, a, a, a, a, a, 0) + hfA_Turbulence(x, 4) + hfSawtooth(t, 5, 1, 1); }",
];

const WORDS: [&str; 60] = [
    "my_model",
    "b",
    "v",
    "c",
    "x",
    "a",
    "s",
    "array",
    "if",
    "then",
    "else",
    "endif",
    "while",
    "loop",
    "endloop",
    "and",
    "or",
    "not",
    "xor",
    "1",
    "0",
    "2.5",
    "1e300",
    "1e-300",
    ".5",
    "99999999",
    "+",
    "-",
    "*",
    "/",
    "^",
    "~",
    "|",
    "&",
    "\\",
    "@",
    "<",
    "<=",
    ">",
    ">=",
    "=",
    "/=",
    "(",
    ")",
    "[",
    "]",
    "{",
    "}",
    ",",
    ";",
    "hfSphere",
    "hfBlock",
    "hfTwistZ",
    "sqrt",
    "max",
    "mod",
    "hfSawtooth",
    "--",
    "\n",
    "é",
];

/// Calls all operations on a program.
fn exercise(text: &str) {
    for mode in [Mode::Default, Mode::Strict] {
        let Ok(mut m) = Model::parse(text, mode) else {
            continue;
        };
        m.set_step_limit(20_000);
        let pretty = m.pretty();
        match Model::parse(&pretty, mode) {
            Ok(again) => assert_eq!(again.pretty(), pretty),
            Err(e) => panic!("{e}\n{pretty}\n{text}"),
        }
        let names: Vec<String> = m.objects().map(str::to_owned).collect();
        for name in names {
            let m = m.clone().object(Some(&name)).expect("it is there");
            let (x, a) = (vec![0.5; m.dimension()], vec![1.25; m.n_params()]);
            let _ = m.eval(&x, &a, &[]);
            let _ = m.eval(&vec![0.0; m.dimension()], &vec![-1.0; m.n_params()], &[]);
            let jets: Vec<Jet2> = x.iter().map(|v| Jet2::variable(*v, 0)).collect();
            let _ = m.eval_with(&jets, &vec![Jet2::variable(1.0, 1); m.n_params()]);
            let _ = m.compile(&mut Graph::new());
            let fitted = m.print_fitted(&a, None);
            assert!(Model::parse(&fitted, mode).is_ok(), "{fitted}");
            let _ = Model::parse(&m.print_with_start(&a), mode);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn soup_of_words(words in prop::collection::vec(prop::sample::select(&WORDS[..]), 0..80)) {
        let soup = words.join(" ");
        exercise(&soup);
        exercise(&format!("my_model(x[3], a[2]) {{ array c[3]; c = [1,2,3]; v = 1; {soup} my_model = v; }}"));
        exercise(&format!("my_model(x[3], a[2]) {{ array c[3]; v = 1; my_model = {soup}; }}"));
    }

    #[test]
    fn characters(text in "\\PC*") {
        exercise(&text);
    }

    #[test]
    fn changed_programs(
        which in 0..PROGRAMS.len(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), prop::sample::select(&WORDS[..]), 0..3u8), 1..6),
    ) {
        let mut words: Vec<String> = split(PROGRAMS[which]);
        for (at, word, how) in changes {
            let i = at.index(words.len());
            match how {
                0 => words[i] = word.to_owned(),
                1 => words.insert(i, word.to_owned()),
                _ => { words.remove(i); }
            }
        }
        exercise(&words.concat());
    }
}

/// Splits a text into words, numbers and single characters, whose concatenation is the text.
fn split(text: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut in_word = false;
    for c in text.chars() {
        let letter = c.is_alphanumeric() || c == '_' || c == '.';
        match words.last_mut() {
            Some(word) if letter && in_word => word.push(c),
            _ => words.push(c.to_string()),
        }
        in_word = letter;
    }
    words
}

#[test]
fn programs_as_they_are() {
    for program in PROGRAMS {
        assert_eq!(split(program).concat(), program);
        Model::parse(program, Mode::Default).unwrap_or_else(|e| panic!("{e}\n{program}"));
        exercise(program);
    }
}
