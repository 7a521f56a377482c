use super::*;
use isoform_num::Jet1;

fn model(text: &str) -> Model {
    Model::parse(text, Mode::Default).unwrap_or_else(|e| panic!("{e}\n{text}"))
}
fn refused(text: &str) -> SyntaxError {
    Model::parse(text, Mode::Default)
        .err()
        .unwrap_or_else(|| panic!("accepted: {text}"))
}
fn body(text: &str) -> String {
    format!("my_model(x[3],a[1]){{ {text} }}")
}
fn value(text: &str, x: f64) -> f64 {
    match model(&body(text)).eval(&[x, 0.0, 0.0], &[0.0], &[]) {
        Ok(e) => e.f,
        Err(e) => panic!("{e}\n{text}"),
    }
}
fn fault(text: &str, x: f64) -> RunError {
    let m = model(&body(text));
    m.eval(&[x, 0.0, 0.0], &[0.0], &[])
        .err()
        .unwrap_or_else(|| panic!("no error: {text}"))
}

#[test]
fn operators_of_one_level_go_from_left_to_right() {
    assert_eq!(value("my_model = -2^2;", 0.0), 4.0);
    assert_eq!(value("my_model = 2^3^2;", 0.0), 64.0);
    assert_eq!(value("my_model = 2^-2;", 0.0), 0.25);
    assert_eq!(value("my_model = 8/4/2 - 3 - 1;", 0.0), -3.0);
    assert!((value("my_model = 1|2+3;", 0.0) - (3.0 + 5f64.sqrt() + 3.0)).abs() < 1e-15);
    assert!((value("my_model = 1-2|3;", 0.0) - (2.0 + 10f64.sqrt())).abs() < 1e-15);
}

#[test]
fn conditions_have_one_level_and_chain() {
    let holds = |c: &str| value(&format!("v=0; if {c} then v=1; endif; my_model=v;"), 9.0) == 1.0;
    assert!(!holds("1=1 or 1=2 and 1=2"));
    assert!(holds("2<=x[1]<5.5"));
    assert!(!holds("not 1=2"));
    assert!(holds("not (1=2)"));
    assert!(holds("(x[1]+1)*2 > 3"));
    assert!(holds("((x[1]+1)*2 > 3) and ((x[1])) /= 2"));
    assert!(holds("not not x[1]"));
    assert!(!holds("0.0000001"));
}

#[test]
fn in_place_maps_work_from_right_to_left() {
    let p = "array p[3]; p = [1, 2, 3]; ";
    assert_eq!(
        value(
            &format!("{p} my_model = p[1] + 10*hfShift3D(p, 1, 0, 0) + p[1];"),
            0.0
        ),
        0.0 + 10.0 + 1.0
    );
    // The shift stands right of both readings of p[1], except the last.
    assert_eq!(
        value(
            &format!("{p} my_model = atan2(0, p[1]) + hfShift3D(p, 1, 0, 0);"),
            0.0
        ),
        1.0
    );
    assert_eq!(
        value(
            &format!("{p} my_model = max(hfShift3D(p, 5, 0, 0), p[1]);"),
            0.0
        ),
        1.0
    );
}

#[test]
fn objects_get_copies_and_give_back_s() {
    let text = "inner(x[1], a[1], s[2]) { s = [5, 6]; t = a[1]; inner = t; }
                my_model(x[1], a[1], s[2]) { v = inner(x, a, s); my_model = v + s[1] + 10*s[2]; }";
    let e = model(text).eval(&[0.0], &[7.0], &[]).expect("it runs");
    assert_eq!((e.f, e.s), (72.0, vec![5.0, 6.0]));
    let text = "inner(x[3], a[1]) { t = hfShift3D(x, 1, 1, 1); inner = x[1]; }
                my_model(x[3], a[1]) { my_model = inner(x, a) + 10*x[1]; }";
    assert_eq!(
        model(text)
            .eval(&[2.0, 0.0, 0.0], &[0.0], &[])
            .expect("it runs")
            .f,
        21.0
    );
}

#[test]
fn attributes_come_in_and_go_out() {
    let m = model("m(x[1], a[1], s[2]) { s[1] = s[2] + 1; m = 0; }");
    assert_eq!(
        m.eval(&[0.0], &[0.0], &[3.0, 4.0]).expect("it runs").s,
        [5.0, 4.0]
    );
    assert_eq!(m.eval(&[0.0], &[0.0], &[]).expect("it runs").s, [1.0, 0.0]);
    assert_eq!(model("m(x[1], a[1]) { m = s[1]; }").n_attributes(), 0);
}

#[test]
fn errors_are_reported_where_the_reference_does() {
    for (text, column) in [
        ("my_model = w;", 33),
        ("my_model = 1 ", 36),
        ("x[1]=2; my_model = 1;", 22),
        ("s = 2; my_model = s;", 26),
        ("array c[2]; c=[1+1,2]; my_model = c[1];", 38),
        ("array c[3]; c=[1,2]; my_model = c[1];", 40),
        ("my_model=1; y=2;", 34),
        ("v=0; array c[3]; my_model=v;", 27),
        ("array c[0]; my_model=1;", 30),
        ("my_model=max(2);", 36),
        ("my_model=sin(2,3);", 36),
        ("my_model=hfSphere(x,1,2);", 42),
        ("v=0; if x[1]>0 then v=1; my_model=v;", 47),
        ("v=0; while v<1 v=v+1; endloop; my_model=v;", 37),
        ("v=0; if x[1]>0 xor x[2]>0 then v=1; endif; my_model=v;", 37),
        ("my_model=x[1] ? 2;", 36),
        ("my_model=my_model+1;", 31),
        ("my_model=x;", 32),
        ("my_model=x[1)];", 34),
        ("sin=1; my_model=2;", 22),
        ("array sin[2]; my_model=2;", 28),
        ("v=v; my_model=2;", 24),
    ] {
        let e = refused(&body(text));
        assert_eq!((e.line, e.column), (1, column), "{text}: {e}");
    }
    assert_eq!(refused("").column, 1);
    assert_eq!(
        refused("m(x[3],a[1]){ m=1; }\nm(x[3],a[1]){ m=2; }").line,
        2
    );
    let e = refused("b(x[3],a[2]){ b=1; }\nmy_model(x[3],a[1]){ my_model=b(x,a); }");
    assert_eq!((e.line, e.column), (2, 35));
    assert!(refused("b(x[3],a[1]){ b=1; }\nmy_model(x[3],a[1]){ my_model=b(1,2); }").column == 33);
}

#[test]
fn run_time_errors_have_positions() {
    for (text, column) in [
        ("my_model=1/(x[1]-x[1]);", 32),
        ("my_model=sqrt(0-1-abs(x[1]));", 31),
        ("my_model=asin(2);", 31),
        ("my_model=0^0;", 32),
        ("my_model=(0-2)^0.5;", 36),
        ("i=4; my_model=x[i];", 38),
        ("i=0; my_model=x[i];", 38),
        ("if x[1]>100 then v=1; endif; my_model=v;", 60),
        ("array c[3]; c[1]=1; my_model=c[2];", 51),
        ("array c[3]; c[1]=1; my_model=hfSphere(x,c,1);", 62),
        ("my_model=tan(1.5707963);", 31),
        ("my_model=mod(1,0);", 31),
        ("my_model=exp(1000);", 22),
        ("v=0; while 1 loop v=v+1; endloop; my_model=v;", 27),
    ] {
        let e = fault(text, 0.0);
        assert_eq!((e.line, e.column), (1, column), "{text}: {e}");
    }
    assert_eq!(value("my_model = 1/(1+exp(1000));", 0.0), 0.0);
}

#[test]
fn calls_that_multiply_are_stopped() {
    let mut text = "o0(x[1], a[1]) { o0 = 1; }\n".to_owned();
    for i in 1..60 {
        text += &format!(
            "o{i}(x[1], a[1]) {{ o{i} = o{0}(x,a) + o{0}(x,a); }}\n",
            i - 1
        );
    }
    let mut m = model(&text).object(Some("O59")).expect("it is there");
    m.set_step_limit(100_000);
    assert!(m.eval(&[0.0], &[0.0], &[]).is_err());
    assert!(m.compile(&mut Graph::new()).is_err());
}

#[test]
fn nesting_is_bounded() {
    let nested = |n: usize, open: &str, close: &str| {
        body(&format!(
            "my_model = {}1{};",
            open.repeat(n),
            close.repeat(n)
        ))
    };
    for (open, close) in [("(", ")"), ("- ", ""), ("abs(", ")"), ("x[", "]")] {
        let deep = model(&nested(MAX_NESTING_DEPTH as usize, open, close));
        let _ = (
            deep.eval(&[1.0; 3], &[0.0], &[]),
            deep.pretty(),
            deep.compile(&mut Graph::new()),
        );
        assert!(
            refused(&nested(MAX_NESTING_DEPTH as usize + 1, open, close))
                .message
                .contains("deep"),
            "{open}"
        );
        assert!(
            refused(&nested(200_000, open, close))
                .message
                .contains("deep"),
            "{open}"
        );
    }
    let conditions = |n: usize| {
        body(&format!(
            "if {}1{} then v=1; endif; my_model=1;",
            "(".repeat(n),
            ")".repeat(n)
        ))
    };
    let _ = model(&conditions(MAX_NESTING_DEPTH as usize - 1)).eval(&[1.0; 3], &[0.0], &[]);
    assert!(refused(&conditions(100_000)).message.contains("deep"));
    let ifs = |n: usize| {
        body(&format!(
            "{} v=1; {} my_model=1;",
            "if x[1]>0 then ".repeat(n),
            "endif;".repeat(n)
        ))
    };
    let _ = model(&ifs(MAX_NESTING_DEPTH as usize - 1)).compile(&mut Graph::new());
    assert!(refused(&ifs(100_000)).message.contains("deep"));
    // Calls are nested, too; a long sum is not.
    let mut chain = "o0(x[1], a[1]) { o0 = 1; }\n".to_owned();
    for i in 1..400 {
        chain += &format!("o{i}(x[1], a[1]) {{ o{i} = o{}(x,a); }}\n", i - 1);
    }
    assert!(refused(&chain).message.contains("deep"));
    let sum = model(&body(&format!("my_model = 0{};", "+1".repeat(300_000))));
    assert_eq!(
        sum.eval(&[0.0; 3], &[0.0], &[]).expect("it runs").f,
        300_000.0
    );
}

#[test]
fn memory_is_bounded() {
    assert!(
        refused("m(x[3],a[1]) { array c[999999999]; m=1; }")
            .message
            .contains("items")
    );
    assert!(
        refused("m(x[1e300],a[1]) { m=1; }")
            .message
            .contains("items")
    );
    assert!(
        refused("m(x[3],a[1]) { array c[600000], d[600000]; m=1; }")
            .message
            .contains("items")
    );
}

#[test]
fn warns_where_documented_precedence_differs() {
    let warned = |e: &str| model(&body(&format!("my_model = {e};"))).warnings().len();
    assert_eq!(warned("x[1]-1|2+3"), 1);
    assert_eq!(warned("1|2-3+4"), 1);
    assert_eq!(warned("x[1]-1|2*3"), 0);
    assert_eq!(warned("(1|2)+3"), 0);
    assert_eq!(warned("1+2|3"), 0);
    assert_eq!(warned("sin(1&2+3)"), 1);
}

#[test]
fn documented_precedence_is_a_switch() {
    let text = body("my_model = 1 - 2|3 + 4 & 5*2;");
    let m = Model::parse_with(&text, Mode::Default, Precedence::Documented).expect("a program");
    let union = -1.0 + 7.0 + 50f64.sqrt();
    let want = union + 10.0 - (union * union + 100.0).sqrt();
    assert_eq!(m.eval(&[0.0; 3], &[0.0], &[]).expect("it runs").f, want);
    assert!(m.warnings().is_empty());
    assert_eq!(
        Model::parse_with(&m.pretty(), Mode::Default, Precedence::Documented)
            .expect("a program")
            .pretty(),
        m.pretty()
    );
}

#[test]
fn objects_are_chosen_by_folded_name() {
    let m = model("ball(x[3],a[1]){ ball=7; }\nmy_model(x[3],a[1]){ my_model=8; }");
    assert_eq!(m.name(), "my_model");
    assert_eq!(
        m.clone().object(Some("BALL")).expect("it is there").name(),
        "ball"
    );
    let e = m.object(Some("cube")).expect_err("it is not there");
    assert_eq!((e.name.as_str(), e.objects.len()), ("cube", 2));
    assert_eq!(
        model("p(x[3],a[1]){ p=7; } q(x[3],a[1]){ q=7; }").name(),
        "p"
    );
}

#[test]
fn jets_give_derivatives_by_coordinates_and_parameters() {
    let m =
        model("m(x[2], a[1]) { if x[1] > 0 then v = a[1]*x[1]^2; else v = x[2]; endif; m = v; }");
    let x = [Jet1::<3>::variable(3.0, 0), Jet1::variable(1.0, 1)];
    let f = m.eval_with(&x, &[Jet1::variable(2.0, 2)]).expect("it runs");
    assert_eq!((f.v, f.g), (18.0, [12.0, 0.0, 9.0]));
    // The derivative by an exponent that happens to be an integer.
    let m = model("m(x[1], a[1]) { m = x[1]^a[1]; }");
    let f = m
        .eval_with(&[Jet1::<2>::variable(3.0, 0)], &[Jet1::variable(2.0, 1)])
        .expect("it runs");
    assert_eq!((f.v, f.g), (9.0, [6.0, 9.0 * 3f64.ln()]));
}

#[test]
fn what_cannot_be_an_expression_says_why() {
    let why = |t: &str| {
        let mut model = model(&body(t));
        model.set_step_limit(100_000);
        model.compile(&mut Graph::new()).expect_err(t)
    };
    let e = why("my_model = x[x[1]];");
    assert_eq!((e.column, e.why.contains("index")), (35, true));
    assert!(
        why("v=0; while v<x[1] loop v=v+1; endloop; my_model=v;")
            .why
            .contains("loop")
    );
    assert!(
        why("v=0; while 1 loop v=v+1; endloop; my_model=v;")
            .why
            .contains("steps")
    );
    assert!(
        why("my_model = hfSawtooth(x[1], a[1], 1, 1);")
            .why
            .contains("terms")
    );
}

#[test]
fn branches_merge() {
    let m = model(&body(
        "v=1; if x[1]>0 then v=2; w=3; else v=4; endif; if x[1]>0 then v=v+w; endif; my_model=v;",
    ));
    let mut g = Graph::new();
    let root = m.compile(&mut g).expect("it compiles");
    assert_eq!(g.eval(root, &[1.0, 0.0, 0.0], &[0.0]), 5.0);
    assert_eq!(g.eval(root, &[-1.0, 0.0, 0.0], &[0.0]), 4.0);
}

#[test]
fn parts_are_named_after_variables_and_centres() {
    let text = "my_model(x[3], a[3]) { array c1[3], c2[3]; c1[1]=a[1]; c1[2]=0; c1[3]=0; c2[1]=a[2]; c2[2]=1; c2[3]=1;
                ball = hfSphere(x, c1, a[3]); both = ball | hfCylinderZ(x, c2, 2);
                my_model = both \\ hfEllipsoid(x, a, 1, 2, 3); }";
    let mut g = Graph::new();
    let root = model(text).compile(&mut g).expect("it compiles");
    let names: Vec<&str> = (0..g.len())
        .filter_map(|i| g.name(NodeId(i as u32)))
        .collect();
    for name in ["ball", "both", "c2", "my_model", "ellipsoid"] {
        assert!(names.contains(&name), "{name} in {names:?}");
    }
    assert!(!names.contains(&"c1"));
    assert_eq!(g.name(root), Some("my_model"));
}

const ANNOTATED: &str = "-- @title A ball on a rod
-- @fits two pieces
-- @pose rigid
-- @unit mm
-- @param a[1] radius length min=0.1 max=50 start=5 unit=mm : of the ball
-- an ordinary comment
my_model(x[3], a[4]) {
  -- @param a[2] rod length tie=2*radius + a[3]/4 - 1 : of the rod
  -- @param a[4] tilt angle fixed=0.5
  array c[3]; c = [0,0,0]; my_model = hfSphere(x, c, a[1]) | hfCylinderZ(x, c, a[2]); }
";

#[test]
fn annotations_describe_parameters() {
    let m = model(ANNOTATED);
    let p = m.params();
    assert_eq!(
        p.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(),
        ["radius", "rod", "a[3]", "tilt"]
    );
    let value = |v: f64| Some(Amount::Value(v));
    assert_eq!(
        (p[0].kind, p[0].min, p[0].max, p[0].start),
        (QuantityKind::Length, value(0.1), value(50.0), value(5.0))
    );
    assert_eq!(
        (p[0].unit.as_deref(), p[0].description.as_str()),
        (Some("mm"), "of the ball")
    );
    assert_eq!(
        p[1].tie,
        Some(Tie {
            constant: -1.0,
            terms: vec![(0, 2.0), (2, 0.25)]
        })
    );
    assert_eq!(
        (p[3].fixed, p[3].kind),
        (Some(Fixed::At(0.5)), QuantityKind::Angle)
    );
    assert_eq!(m.info().pose, Some(Pose::Rigid));
    assert_eq!(m.info().title.as_deref(), Some("A ball on a rod"));
    assert_eq!(m.info().place, None);
    let placed = ANNOTATED.replace("rigid", "rigid at 1 -2e1 3.5 turned 0 0 3.141592653589793");
    let place = model(&placed).info().place.clone().expect("a place");
    assert_eq!((place.translation, place.scale), ([1.0, -20.0, 3.5], 1.0));
    let half_turn = [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]];
    for (row, wanted) in place
        .rotation
        .iter()
        .flatten()
        .zip(half_turn.iter().flatten())
    {
        assert!((row - wanted).abs() < 1e-15);
    }
}

#[test]
fn amounts_are_numbers_or_shares_of_the_data() {
    let m =
        model("-- @param a[1] r length min=2.5% start=50%x max=120%z\nm(x[3], a[1]) { m = 1; }");
    let p = &m.params()[0];
    assert_eq!(
        (p.min, p.start, p.max),
        (
            Some(Amount::OfDiagonal(0.025)),
            Some(Amount::OfExtent(0.5, 0)),
            Some(Amount::OfExtent(1.2, 2))
        )
    );
    let box_ = [3.0, 4.0, 12.0];
    let near = |a: Option<Amount>, want: f64| {
        assert!((a.map_or(f64::NAN, |a| a.resolve(box_)) - want).abs() < 1e-12)
    };
    near(p.min, 0.025 * 13.0);
    near(p.start, 1.5);
    near(p.max, 14.4);
}

#[test]
fn typical_values_stand_in_where_none_are_given() {
    let text = "-- @param a[1] r length start=40% typical=3\n-- @param a[2] h length start=2\n\
                -- @param a[3] d length start=10%\nm(x[3], a[3]) { m = a[1] + a[2] + a[3]; }";
    let m = model(text);
    assert_eq!(m.params()[0].typical, Some(3.0));
    assert_eq!(
        crate::parameter_values::<f64>(&m, &[]).map_err(|e| e.to_string()),
        Err("a[3] (d) has no value".to_owned())
    );
    assert_eq!(
        crate::parameter_values(&m, &[1.0, 5.0, 4.0]),
        Ok(vec![1.0, 5.0, 4.0])
    );
}

#[test]
fn ties_follow_the_other_values_and_unused_parameters_need_none() {
    let text = "inner(x[3], a[5]) { inner = a[2] - x[1]; }\n\
                -- @param a[1] r length typical=2\n-- @param a[2] h length tie=2*r + w - 1\n\
                -- @param a[4] w length fixed=7\nm(x[3], a[5]) { m = inner(x, a); }";
    let m = model(text).object(Some("m")).expect("an object");
    let values = |given: &[f64]| crate::parameter_values(&m, given);
    assert_eq!(values(&[]), Ok(vec![2.0, 10.0, 0.0, 7.0, 0.0]));
    assert_eq!(values(&[5.0, 99.0]), Ok(vec![5.0, 16.0, 0.0, 7.0, 0.0]));
    // The parameters of a tie are required, although the program does not use them.
    let bare = model("-- @param a[2] h length tie=2*a[1]\nm(x[3], a[3]) { m = a[2] - x[1]; }");
    assert_eq!(
        crate::parameter_values::<f64>(&bare, &[]).map_err(|e| e.to_string()),
        Err("a[1] has no value".to_owned())
    );
    // A computed index may refer to any parameter.
    let any = model("m(x[3], a[2]) { i = 1; m = a[i] - x[1]; }");
    assert_eq!(
        crate::parameter_values::<f64>(&any, &[]).map_err(|e| e.to_string()),
        Err("a[1], a[2] have no values".to_owned())
    );
}

#[test]
fn sums_of_solids_are_warned_of_where_they_are_used_as_solids() {
    let head = "array c[3]; c = [0, 0, 0]; u = hfSphere(x, c, 2); v = hfCylinderZ(x, c, 1);";
    let warned = |body: &str| {
        let text = format!(
            "part(x[3], a[2]) {{ {head} part = u | v; }} m(x[3], a[2]) {{ {head} {body} }}"
        );
        let warnings = model(&text).warnings().to_vec();
        warnings
            .iter()
            .map(|w| w.message.chars().nth(1).expect("long"))
            .collect::<String>()
    };
    for (body, want) in [
        ("m = u - v;", "-"),
        ("m = u + v;", "+"),
        ("m = (u & v) + v;", "+"),
        ("w = u - v; m = w & x[3];", "-"),
        ("w = -v + u; m = w;", "+"),
        ("m = min(u - v, x[3]);", "-"),
        ("m = part(x, a) - v;", "-"),
        ("m = u - (v + 0.1);", "-"),
        ("m = ~(u + v);", "+"),
        (
            "i = 0; w = u; while i < 3 loop w = w - v; i = i + 1; endloop; m = w;",
            "-",
        ),
        ("if a[1] > 0 then w = u - v; else w = u; endif; m = w;", "-"),
        ("w = u - v; k = u + v; m = w | k;", "-+"),
        // Intended formulas.
        ("m = u - 0.5;", ""),
        ("m = u + v + sqrt(u^2 + v^2);", ""),
        ("m = (u | v) + 0.3/(1 + u^2 + v^2);", ""),
        ("m = a[1]*u + (1 - a[1])*v;", ""),
        ("m = a[1] - abs(u - v);", ""),
        ("h = max(1 - abs(u - v), 0); m = min(u, v) - h*h/4;", ""),
        ("m = min(u, v) - max(u - v, 0)*0.1;", ""),
        ("m = u - x[3];", ""),
        ("m = (u - v)^2 - 0.1;", ""),
        ("m = u \\ v | (u & v);", ""),
        (
            "m = hfBlobby(x, c, c, c, c, c, 1) + hfBlobby(x, c, c, c, c, c, 1);",
            "",
        ),
    ] {
        assert_eq!(warned(body), want, "{body}");
    }
    let w = model(
        "m(x[3], a[1]) {\n array c[3];\n c = [0, 0, 0];\n m = hfSphere(x, c, 1) - hfSphere(x, c, 2); }",
    );
    assert_eq!((w.warnings()[0].line, w.warnings()[0].column), (4, 24));
}

#[test]
fn loops_within_loops_are_read_in_linear_time() {
    // Twice the work per level would take a million years.
    let depth = 60;
    let text = format!(
        "m(x[3], a[1]) {{ array c[3]; c = [0, 0, 0]; u = 1; {} u = u + hfSphere(x, c, 1); {} m = u; }}",
        "while (u < 3) loop ".repeat(depth),
        "endloop; ".repeat(depth),
    );
    let m = model(&text);
    assert!(m.warnings().iter().all(|w| w.line == 1));
}

#[test]
fn an_index_beyond_its_array_is_an_error_at_its_place() {
    for (text, want) in [
        (
            "m(x[3], a[2]) {\n  m = a[3] - x[1]; }",
            "2:9: a[3]: m has 2 parameters",
        ),
        (
            "m(x[3], a[1]) { m = a[0]; }",
            "1:23: a[0]: m has 1 parameter, counted from 1",
        ),
        (
            "m(x[3], a[1]) { m = x[4]; }",
            "1:23: x[4]: m has 3 coordinates",
        ),
        (
            "m(x[3], a[1]) { array c[2]; c[5] = 1; m = 1; }",
            "1:31: c[5]: c has 2 items",
        ),
    ] {
        let m = model(text);
        let error = m
            .eval(&[0.0; 3], &[0.0; 2][..m.n_params()], &[])
            .expect_err("no value");
        assert_eq!(error.to_string(), want);
    }
}

#[test]
fn bad_annotations_have_positions() {
    let bad = |line: &str, column: usize, word: &str| {
        let e = refused(&format!("\n-- @param {line}\nm(x[3], a[2]) {{ m = 1; }}"));
        assert_eq!((e.line, e.column), (2, column), "{line}: {e}");
        assert!(e.message.contains(word), "{e}");
    };
    bad("a[3] r", 11, "does not exist");
    bad("b[1] r", 11, "a[i]");
    bad("a[1] r size", 18, "length");
    bad("a[1] r length mn=3", 25, "min=");
    bad("a[1] r length min=three", 29, "not a number");
    bad("a[1] r length min=3 max=2", 11, "above");
    bad("a[1] r length min=3%z max=2%z", 11, "above");
    bad("a[1] r length min=3%q", 31, "%q");
    bad("a[1] r length start=9 max=2", 11, "bounds");
    bad("a[1] r length typical=1 min=2", 11, "bounds");
    bad("a[1] r length typical=3%z", 33, "not a number");
    bad("a[1] r tie=a[2]*a[2]", 27, "linear");
    bad("a[1] r tie=q", 22, "no parameter");
    bad("a[1] r tie=r+1", 22, "free");
    let pose = |pose: &str| refused(&format!("-- @pose {pose}\nm(x[3], a[2]) {{ m = 1; }}"));
    for (of, column, said) in [
        ("sideways", 10, "rigid"),
        ("rigid near 1 2 3", 16, "at X Y Z"),
        ("rigid at 1 2", 22, "number"),
        ("rigid at 1 2 x", 23, "number"),
        ("rigid at 1 2 3 4", 25, "turned"),
        ("axis turned 1 nan 3", 24, "number"),
    ] {
        let e = pose(of);
        assert!(
            e.message.contains(said) && e.column == column,
            "{of}: {e:?}"
        );
    }
    assert!(
        refused("m(x[3], a[1]) { m = 1; }\n-- @param a[1] r")
            .message
            .contains("no object")
    );
    assert!(
        refused("-- @param a[1] r\n-- @param a[2] R\nm(x[3], a[2]) { m = 1; }")
            .message
            .contains("already")
    );
    assert_eq!(
        model("-- @author me\nm(x[3], a[2]) { m = 1; }")
            .warnings()
            .len(),
        1
    );
    assert_eq!(
        model("-- mail me @ home\nm(x[3], a[2]) { m = 1; }")
            .warnings()
            .len(),
        0
    );
}

#[test]
fn fitted_programs_have_the_values_inside() {
    let at = [0.3, 0.2, -1.0];
    for text in [
        ANNOTATED.to_owned(),
        ANNOTATED.replace("my_model", "rod"),
        format!("b(x[3],a[1]) {{ b = 1; }} {ANNOTATED}"),
    ] {
        let (m, a) = (model(&text), [1.5, 0.1, 0.0, 1e-7]);
        let chosen = m.name().to_owned();
        let want = m.eval(&at, &a, &[]).expect("it runs").f;
        let printed = m.print_fitted(&a, None);
        assert!(printed.contains("-- an ordinary comment"));
        let again = model(&printed);
        assert_eq!(again.name(), "my_model", "{chosen}");
        assert_eq!(again.eval(&at, &a, &[]).map(|e| e.f), Ok(want), "{printed}");
    }
    let turn = Placement {
        rotation: [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        translation: [1.0, -2.0, 3.0],
        scale: 2.0,
    };
    let m = model(
        "-- template\nmy_model(x[3], a[1], s[2]) { s[1] = 4; my_model = x[1] + 10*x[2] + 100*x[3] + a[1]; }",
    );
    let moved = model(&m.print_fitted(&[7.0], Some(&turn)));
    // p = Rᵀ(x − t)/2 with x − t = (2, 4, −6): R maps (4, −2, −6) to it.
    let e = moved.eval(&[3.0, 2.0, -3.0], &[7.0], &[]).expect("it runs");
    assert_eq!((e.f, e.s), (2.0 - 10.0 - 300.0 + 7.0, vec![4.0, 0.0]));
}

/// Other readers of a fitted program see constants, which are defaults of the parameters here.
#[test]
fn values_of_fitted_programs_are_defaults() {
    let text = "-- @pose rigid at 1 2 3
-- @param a[1] radius length min=0 max=9 start=5% unit=mm : of the ball
-- @param a[2] height length tie=2*radius
-- @param a[3] shift x fixed=1
my_model(x[3], a[3]) { my_model = a[1] - x[1]*a[2] + a[3]; }";
    let printed = model(text).print_fitted(&[2.0, 4.0, 1.0], None);
    let fitted = model(&printed);
    assert_eq!(fitted.warnings(), []);
    let params = fitted.params();
    let typical: Vec<_> = params.iter().map(|p| p.typical).collect();
    assert_eq!(typical, [Some(2.0), Some(4.0), Some(1.0)]);
    assert_eq!(params[0].name, "radius");
    assert_eq!(params[0].start, Some(Amount::Value(2.0)));
    assert_eq!(params[1].tie, model(text).params()[1].tie);
    assert_eq!(params[2].fixed, Some(Fixed::At(1.0)));
    assert_eq!(fitted.info().place, None);
    let at = |a: &[f64]| fitted.eval(&[1.0, 0.0, 0.0], a, &[]).map(|e| e.f);
    assert_eq!(at(&[3.0, 5.0, 10.0]), Ok(3.0 - 5.0 + 10.0));
    let mut graph = Graph::new();
    let root = fitted.compile(&mut graph).expect("an expression");
    assert_eq!(graph.eval(root, &[1.0, 0.0, 0.0], &[3.0, 5.0, 10.0]), 8.0);
    assert_eq!(fitted.used_params(), [true; 3]);
    // Fitted again, and called by another object, whose own parameters are ignored.
    let twice = model(&fitted.print_fitted(&[1.0, 2.0, 3.0], None));
    assert_eq!(twice.params()[0].name, "radius");
    assert_eq!(
        twice
            .eval(&[1.0, 0.0, 0.0], &[1.0, 2.0, 4.0], &[])
            .map(|e| e.f),
        Ok(3.0)
    );
    let caller = model(&format!(
        "{printed}\nouter(x[3], a[3]) {{ outer = my_model(x, a); }}"
    ));
    let outer = caller.object(Some("outer")).expect("it is there");
    assert_eq!(
        outer.eval(&[1.0, 0.0, 0.0], &[9.0; 3], &[]).map(|e| e.f),
        Ok(2.0 - 4.0 + 1.0)
    );
    assert_eq!(outer.used_params(), [false; 3]);
    // Edited manually.
    let changed = model(&printed.replace("b = [2.0, 4.0", "b = [2.5, 4.0"));
    assert!(changed.warnings()[0].message.contains("is tied: it is 5"));
    for (from, to) in [
        ("@values b of", "@values c of"),
        ("@values b of", "@values b by"),
        ("of my_model_template", "of my_model"),
        ("my_model(x[3], a[3])\n", "my_model(x[3], a[2])\n"),
        ("-- @values", "-- @param a[1] twice\n-- @values"),
    ] {
        assert!(printed.contains(from), "{printed}");
        let broken = printed.replace(from, to);
        assert!(Model::parse(&broken, Mode::Default).is_err(), "{broken}");
    }
}

#[test]
fn calls_of_a_renamed_object_follow() {
    let text = "my_model(x[1], a[1]) { my_model = a[1]*x[1]; } other(x[1], a[1]) { my_model_template = 2; other = my_model(x, a); }";
    let printed = model(text).print_fitted(&[5.0], None);
    let m = model(&printed);
    assert_eq!(m.eval(&[2.0], &[5.0], &[]).expect("it runs").f, 10.0);
    assert_eq!(
        m.object(Some("other"))
            .expect("it is there")
            .eval(&[2.0], &[3.0], &[])
            .expect("it runs")
            .f,
        6.0
    );
}

#[test]
fn start_values_are_replaced_in_place() {
    let m = model(ANNOTATED);
    let text = m.print_with_start(&[1.25, 2.0, 3.0, 0.5]);
    assert!(
        text.contains("max=50 start=1.25 unit=mm : of the ball"),
        "{text}"
    );
    assert!(
        text.contains("tie=2*radius + a[3]/4 - 1 start=2.0 : of the rod"),
        "{text}"
    );
    let again = model(&text);
    assert_eq!(again.params()[1].tie, m.params()[1].tie);
    let starts: Vec<Option<f64>> = again
        .params()
        .iter()
        .map(|p| p.start.and_then(Amount::value))
        .collect();
    assert_eq!(starts, [Some(1.25), Some(2.0), None, Some(0.5)]);
}

#[test]
fn printing_keeps_double_negation() {
    let m = model(&body("my_model = 1 - - -x[1]^2;"));
    let text = m.pretty();
    assert_eq!(model(&text).pretty(), text);
    assert_eq!(
        model(&text)
            .eval(&[3.0, 0.0, 0.0], &[0.0], &[])
            .expect("it runs")
            .f,
        -8.0
    );
}

#[test]
fn the_library_lists_itself() {
    let all = library();
    let sphere = all
        .iter()
        .find(|f| f.names[0] == "hfSphere")
        .expect("it is there");
    assert_eq!(sphere.signature, "hfSphere(x, center, R)");
    assert!(all.iter().any(|f| f.names.contains(&"hfCylZ")));
}

#[test]
fn a_strange_size_of_point_is_refused_or_the_sentinel() {
    let text = "m(x[2], a[3]) { m = hfSphere(x, a, 1); }";
    assert!(refused(text).message.contains("3 items"));
    let strict = Model::parse(text, Mode::Strict).expect("the reference takes it");
    assert_eq!(
        strict.eval(&[0.0; 2], &[0.0; 3], &[]).expect("it runs").f,
        -1111111111111.0
    );
}

/// `--` begins a comment: an error says so if the rest is invalid, else a warning.
#[test]
fn a_comment_that_looks_like_a_difference_is_said() {
    for (text, place) in [
        ("my_model = x[1]--0.03;", (1, 16)),
        ("my_model = x[1]--x[2];", (1, 16)),
        ("my_model = (x[1])--(3);", (1, 18)),
        ("my_model = 2 --.5;", (1, 14)),
        ("r = x[1]--0.03;\nmy_model = r;", (1, 9)),
    ] {
        let e = refused(&format!(
            "m(x[3], a[1]) {{\n{}}}",
            text.replace("my_model", "m")
        ));
        let (line, column) = (
            place.0 + 1,
            place.1 - if text.starts_with('m') { 7 } else { 0 },
        );
        let said = format!("the `--` in line {line}, column {column} begins a comment");
        assert!(e.message.contains(&said), "{text}: {e}");
        assert_eq!(e.hint, "");
    }
    // Comments that do not look like operands do not cause warnings.
    for text in [
        "m = x[1] -- minus\n}",
        "m = x[1] --minus\n}",
        "m = 1; --0.03\n{",
    ] {
        let e = refused(&format!("m(x[3], a[1]) {{ {text}"));
        assert!(!e.message.contains("comment"), "{text}: {e}");
    }
    let split = model("m(x[3], a[1]) {\nm = x[1]--0.03\n + 1; --2\n}");
    let warnings = split.warnings();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert_eq!((warnings[0].line, warnings[0].column), (2, 9));
    assert!(warnings[0].message.contains("comment"));
}

#[test]
fn reserved_names_are_said_to_be() {
    for (text, column, words) in [
        (
            "m(x[3], a[1]) { s = a[1]; m = 1; }",
            21,
            "`s` is reserved, the array of attributes",
        ),
        (
            "m(x[3], a[1]) { a = 2; m = 1; }",
            17,
            "reserved, the array of parameters",
        ),
        (
            "m(x[3], a[1]) { x[1] = 2; m = 1; }",
            17,
            "reserved, the array of coordinates",
        ),
        (
            "m(x[3], a[1]) { loop = 2; m = 1; }",
            17,
            "reserved, a word of the language",
        ),
        (
            "m(x[3], a[1]) { hfSphere = 2; m = 1; }",
            17,
            "reserved, a function of the library",
        ),
        (
            "m(x[3], a[1]) { if x[1] > 0 then a = 2; endif; m = 1; }",
            34,
            "reserved",
        ),
        (
            "m(x[3], a[1]) { array s[3]; m = 1; }",
            23,
            "reserved, the array of attributes",
        ),
        (
            "s(x[3], a[1]) { s = 1; }",
            1,
            "reserved, the array of attributes",
        ),
    ] {
        let e = refused(text);
        assert_eq!((e.line, e.column), (1, column), "{text}: {e}");
        assert!(e.message.contains(words), "{text}: {e}");
    }
    assert!(
        !refused("m(x[3], a[1]) { s = [; m = 1; }")
            .message
            .contains("reserved")
    );
    assert!(
        !refused("m(x[3], a[1]) { s[1] = 2 m = 1; }")
            .message
            .contains("reserved")
    );
}

/// Block evaluation and pointwise evaluation agree bitwise in values, and in attributes and errors.
#[test]
fn blocks_of_points_are_evaluated_like_points() {
    let text = "my_model(x[3], a[2], s[2]) {
      array c[3];
      c = [0.25, 0, 0];
      s[1] = s[1] + x[1];
      if (x[2] > 0) then q = 1/x[1]; s[2] = 3; else q = sqrt(x[3]); endif;
      i = 0;
      while_loop (i < 3) loop i = i + 1; q = q*a[1] + i; endloop;
      my_model = hfSphere(x, c, a[2]) | q;
    }"
    .replace("while_loop", "while");
    let m = model(&text);
    let values = [-1.0, -0.3, 0.0, 0.7];
    let points: Vec<[f64; 3]> = (0..BlockEvaluator::POINTS)
        .map(|k| [values[k % 4], values[k / 4 % 4], values[2 + k / 16]])
        .collect();
    let a = [0.9, 1.5];
    let mut block = m.block_evaluator();
    // Two runs: the second is independent of the first.
    for points in [&points[..], &points[7..20]] {
        let found = block.eval(points, &a);
        assert!(found.iter().any(Result::is_ok) && found.iter().any(Result::is_err));
        for (p, found) in points.iter().zip(found) {
            let one = m.eval(p, &a, &[]);
            let bits = |e: Evaluation| {
                let s: Vec<u64> = e.s.iter().map(|v| v.to_bits()).collect();
                (e.f.to_bits(), s)
            };
            assert_eq!(found.map(bits), one.map(bits), "{p:?}");
        }
    }
}

/// A function of a file: f = 1 − x² − 2 y² + x z, bounded over boxes by interval arithmetic.
struct Saddle;

impl isoform_geom::Field for Saddle {
    fn value(&self, p: [f64; 3]) -> f64 {
        self.jet(p).v
    }
    fn jet(&self, p: [f64; 3]) -> isoform_num::Jet2 {
        saddle(std::array::from_fn(|i| {
            isoform_num::Jet2::variable(p[i], i)
        }))
    }
    fn bounds(&self, region: isoform_geom::Aabb) -> isoform_num::Interval {
        saddle(std::array::from_fn(|i| {
            isoform_num::Interval::new(region.lo[i], region.hi[i])
        }))
    }
}

fn saddle<R: Real>([x, y, z]: [R; 3]) -> R {
    R::constant(1.0) - x.square() - R::constant(2.0) * y.square() + x * z
}

/// Returns a program whose files all have the function of [`Saddle`].
fn with_files(text: &str) -> Model {
    let mut found = model(text);
    for file in 0..found.files().len() {
        let function = Imported::new("scan", std::sync::Arc::new(Saddle));
        found.set_file(file, function, Some("/far/away".to_owned()));
    }
    found
}

#[test]
fn functions_of_files_are_terms() {
    let text = "my_model(x[3],a[1]) {
        array p[3];
        p[1] = 2*x[1]; p[2] = x[2] - 1; p[3] = sin(x[3]);
        moved = mesh(p, \"part.stl\", 0.5);
        same = mesh(p, \"part.stl\", 0.5);
        my_model = (surface(\"scan.json\")*x[2] + moved - a[1]*same) & (3 - x[1]);
    }";
    let found = with_files(text);
    let files: Vec<_> = found.files().iter().map(|f| (f.kind, f.accuracy)).collect();
    assert_eq!(
        files,
        [(FileKind::Mesh, Some(0.5)), (FileKind::Surface, None)]
    );
    assert_eq!(found.files()[0].path, "part.stl");
    let fitted = found.print_fitted(&[0.25], None);
    assert_eq!(
        fitted.matches("mesh(p, \"/far/away\", 0.5)").count(),
        2,
        "{fitted}"
    );
    assert!(fitted.contains("surface(\"/far/away\")*x[2]"), "{fitted}");
    let again = with_files(&found.pretty());
    assert_eq!(again.pretty(), found.pretty());
    let pieces = crate::Pieces::of_model(&found, &[0.25]).expect("an expression");
    let mut random = fastrand::Rng::with_seed(3);
    for _ in 0..100 {
        let p: [f64; 3] = std::array::from_fn(|_| 4.0 * random.f64() - 2.0);
        let moved = saddle([2.0 * p[0], p[1] - 1.0, p[2].sin()]);
        let (u, v) = (saddle(p) * p[1] + 0.75 * moved, 3.0 - p[0]);
        let want = u + v - u.hypot(v);
        for program in [&found, &again] {
            let f = program.eval(&p, &[0.25], &[]).expect("a value").f;
            assert!((f - want).abs() < 1e-12 * (1.0 + want.abs()), "{f} {want}");
        }
        compiled(&pieces, p, u);
    }
}

/// Compares the first piece of a model and its derivatives with its value u at a point.
fn compiled(pieces: &crate::Pieces, p: [f64; 3], u: f64) {
    use isoform_geom::Solid;
    let jet = pieces.jet(0, p);
    assert!((jet.v - u).abs() < 1e-12 * (1.0 + u.abs()), "{} {u}", jet.v);
    let h = 1e-5;
    let region = isoform_geom::Aabb {
        lo: p,
        hi: p.map(|v| v + 0.1),
    };
    let mut range = [isoform_num::Interval::ALL];
    pieces.bounds(&[0], region, &mut range);
    assert!(range[0].width() < 20.0, "{:?}", range[0]);
    for i in 0..3 {
        let at = |by: f64| {
            let mut q = p;
            q[i] += by;
            pieces.gradient(0, q)
        };
        let slope = (at(h).0 - at(-h).0) / (2.0 * h);
        assert!((jet.g[i] - slope).abs() < 1e-6, "{} {slope}", jet.g[i]);
        let bend = (at(h).1[i] - at(-h).1[i]) / (2.0 * h);
        let second = jet.second(i, i);
        assert!((second - bend).abs() < 1e-6, "{second} {bend}");
        assert!(range[0].contains(at(0.07).0), "{:?}", range[0]);
    }
}

#[test]
fn names_of_file_functions_stay_free() {
    assert_eq!(
        value("mesh = 2; surface = mesh + 1; my_model = surface;", 0.0),
        3.0
    );
    let object = "mesh(x[3],a[1]) { mesh = x[1]; } my_model(x[3],a[1]) { my_model = mesh(x, a); }";
    let found = model(object).eval(&[4.0, 0.0, 0.0], &[0.0], &[]);
    assert_eq!(found.map(|e| e.f), Ok(4.0));
}

#[test]
fn files_that_were_not_read_fail_where_they_are_called() {
    let text = "my_model(x[3],a[1]) {\n  my_model = mesh(\"part.stl\");\n}";
    let error = model(text)
        .eval(&[0.0; 3], &[0.0], &[])
        .expect_err("no file");
    assert_eq!((error.line, error.column), (2, 14));
    assert!(error.message.contains("part.stl"), "{error}");
    let error = model(text).compile(&mut Graph::new()).expect_err("no file");
    assert!(error.fails && error.why.contains("part.stl"), "{error}");
    for (text, column) in [
        ("my_model(x[2],a[1]) { my_model = mesh(\"a\"); }", 34),
        ("my_model(x[3],a[1]) { my_model = mesh(\"a\", a[1]); }", 44),
        ("my_model(x[3],a[1]) { my_model = mesh(\"a\", 0); }", 44),
        ("my_model(x[3],a[1]) { my_model = surface(\"a\", 1); }", 45),
        ("my_model(x[3],a[1]) { my_model = surface(a, \"b\"); }", 42),
        ("my_model(x[3],a[1]) { my_model = surface(\"a\"; }", 45),
        ("my_model(x[3],a[1]) { my_model = mesh(x, \"a\" }", 46),
    ] {
        assert_eq!(refused(text).column, column, "{text}: {}", refused(text));
    }
}
