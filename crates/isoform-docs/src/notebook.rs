//! Conversion of notebooks to pages: cells as Markdown, with their saved outputs.

use serde_json::Value;

/// Converts a notebook to Markdown: its texts, its code, and below each code cell its printed
/// output and pictures.
///
/// # Errors
/// If the text is not a notebook.
pub(crate) fn markdown(notebook: &str) -> Result<String, String> {
    let json: Value = serde_json::from_str(notebook).map_err(|e| e.to_string())?;
    let cells = json["cells"].as_array().ok_or("it has no cells")?;
    let cells: Vec<String> = cells.iter().map(cell).collect();
    Ok(cells.join("\n\n"))
}

/// Returns text that is saved as one string or as a list of lines.
fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(lines) => lines.iter().filter_map(Value::as_str).collect(),
        _ => String::new(),
    }
}

fn cell(cell: &Value) -> String {
    let source = text(&cell["source"]);
    if cell["cell_type"] != "code" {
        return source;
    }
    let mut shown = format!("```python\n{source}\n```");
    for output in cell["outputs"].as_array().into_iter().flatten() {
        if let Some(drawn) = picture(output, &text(&cell["metadata"]["alt"])) {
            shown += &format!("\n\n{drawn}");
            continue;
        }
        let printed = match output["output_type"].as_str() {
            Some("stream") => text(&output["text"]),
            _ => text(&output["data"]["text/plain"]),
        };
        if !printed.trim().is_empty() {
            shown += &format!("\n\n```\n{}\n```", printed.trim_end());
        }
    }
    shown
}

/// Returns the picture of an output with its alternative text; `None` if the output has no picture.
fn picture(output: &Value, alt: &str) -> Option<String> {
    let data = text(&output["data"]["image/png"]);
    let data: String = data.split_whitespace().collect();
    (!data.is_empty()).then(|| format!("![{alt}](data:image/png;base64,{data})"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_and_outputs_in_their_order() {
        let notebook = r##"{"cells": [
            {"cell_type": "markdown", "metadata": {}, "source": ["# A\n", "text"]},
            {"cell_type": "code", "metadata": {"alt": "a dot"}, "source": "print(1)", "outputs": [
                {"output_type": "stream", "name": "stdout", "text": ["1\n"]},
                {"output_type": "display_data",
                 "data": {"image/png": "AA\nBB", "text/plain": "<Figure>"}}]}]}"##;
        let want = "# A\ntext\n\n```python\nprint(1)\n```\n\n```\n1\n```\n\n\
                    ![a dot](data:image/png;base64,AABB)";
        assert_eq!(markdown(notebook).as_deref(), Ok(want));
        assert!(markdown("{}").is_err() && markdown("# A").is_err());
    }
}
