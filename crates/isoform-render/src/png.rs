//! Pictures as PNG files.

use crate::picture::Picture;
use std::io::Cursor;

/// The bytes of a PNG file: 24 bits a pixel, no text and no time in it.
///
/// # Errors
/// If the picture has no pixels, or more than the format takes.
pub fn write_png(picture: &Picture) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = png::Encoder::new(&mut bytes, picture.size[0], picture.size[1]);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(picture.pixels.as_flattened())?;
    writer.finish()?;
    Ok(bytes.into_inner())
}
