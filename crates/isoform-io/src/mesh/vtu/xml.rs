//! As much XML as VTK's files need.

/// Text with the characters replaced that XML keeps for itself.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
