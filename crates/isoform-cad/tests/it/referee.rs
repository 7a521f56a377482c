//! Volumes, areas and signed distances that another CAD kernel computes (tests/data/step).

use crate::common::{open_sides, prepared, read};
use isoform_testdata::{data, files, stem};
use serde_json::Value;

/// Distance up to which figures agree, relative to the size of a part.
const TOLERANCE: f64 = 1e-9;

#[test]
fn figures_agree_with_those_of_another_kernel() {
    let text = std::fs::read_to_string(data("step/expected.json")).expect("a file");
    let rows: Vec<Value> = serde_json::from_str(&text).expect("rows");
    assert_eq!(rows.len(), files("step", "step").len());
    for row in rows {
        let name = row["file"].as_str().expect("a name");
        let shape = prepared(read(&data(&format!("step/{name}")))).expect(name);
        assert_eq!(open_sides(&shape), 0, "{name}");
        let measures = shape.measures();
        assert_eq!(
            (measures.open_edges, measures.by_triangles),
            (0, 0),
            "{name}"
        );
        let size = shape.bounds().diagonal();
        // Where edges are off their faces, either is as good.
        let tolerance = TOLERANCE + 10.0 * measures.gap / size;
        let volume = measures.volume.expect("a solid");
        for (found, expected) in [(volume, &row["volume"]), (measures.area, &row["area"])] {
            let expected = expected.as_f64().expect("a number");
            let off = (found / expected - 1.0).abs();
            assert!(off < 10.0 * tolerance, "{name}: {found} {expected}");
        }
        for point in row["points"].as_array().expect("points") {
            let [x, y, z, expected] = [0, 1, 2, 3].map(|k| point[k].as_f64().expect("a number"));
            let found = shape.signed_distance([x, y, z]).expect("a distance");
            assert!(
                (found - expected).abs() < tolerance * size,
                "{name}: {found} {point}"
            );
        }
    }
}

#[test]
fn units_names_and_parts_are_those_of_the_file() {
    let known = [
        ("assembly-ap214", "mm", "AUTOMOTIVE_DESIGN", 5),
        ("loft-ap203", "mm", "CONFIG_CONTROL_DESIGN", 1),
        (
            "mixed-ap242-inch",
            "in",
            "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF",
            1,
        ),
    ];
    for path in files("step", "step") {
        let file = read(&path);
        let name = stem(&path);
        assert!(file.remarks.is_empty(), "{name}: {:?}", file.remarks);
        if let Some(known) = known.iter().find(|k| k.0 == name) {
            let found = (file.unit.as_str(), file.schema.as_str(), file.parts);
            assert_eq!(found, (known.1, known.2, known.3), "{name}");
        }
    }
}
