//! Any text as a HyperFun program: parsed, checked, printed, compiled and evaluated, without a
//! panic and without a hang.
//!
//! `cargo +nightly fuzz run hyperfun -- -rss_limit_mb=1024 -timeout=10`
#![no_main]

use isoform_field::Graph;
use isoform_field::hyperfun::{Mode, Model};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let text = String::from_utf8_lossy(data);
    for mode in [Mode::Default, Mode::Strict] {
        let Ok(mut model) = Model::parse(&text, mode) else {
            continue;
        };
        model.set_step_limit(10_000);
        let pretty = model.pretty();
        let again = Model::parse(&pretty, mode).expect("what is printed is a program");
        assert_eq!(again.pretty(), pretty);
        let a = vec![0.75; model.n_params()];
        let mut evaluator = model.evaluator::<f64>();
        for value in [0.5, 0.0, -3.0] {
            let _ = evaluator.eval(&vec![value; model.dimension()], &a, &[]);
        }
        let _ = model.compile(&mut Graph::new());
        Model::parse(&model.print_fitted(&a, None), mode).expect("a fitted program is a program");
    }
});
