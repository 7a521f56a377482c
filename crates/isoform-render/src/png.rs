//! PNG files of pictures.

use crate::color::Color;
use crate::picture::Picture;
use std::io::Cursor;

/// Encodes a picture as PNG with 24 bits per pixel, without text and time.
///
/// # Errors
///
/// If the picture has no pixels, or more than the format allows.
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

/// Encodes a picture with few colours as PNG: pixels are indices of the palette, whose first colour
/// is transparent.
///
/// # Errors
///
/// If the picture is empty, or larger than the format allows.
pub fn write_indexed_png(
    size: [u32; 2],
    pixels: &[u8],
    palette: &[Color],
) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette.as_flattened());
    encoder.set_trns(&[0][..]);
    // Shades vary little from row to row.
    encoder.set_filter(png::Filter::Up);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indexed_pictures_read_back() {
        let (palette, pixels) = ([[0; 3], [9, 8, 7], [255, 0, 1]], [0, 1, 2, 2, 1, 0]);
        let bytes = write_indexed_png([3, 2], &pixels, &palette).expect("it is a picture");
        let decoder = png::Decoder::new(Cursor::new(bytes));
        let mut reader = decoder.read_info().expect("a header");
        let info = reader.info().clone();
        assert_eq!(
            (info.width, info.height, info.trns.as_deref()),
            (3, 2, Some(&[0][..]))
        );
        assert_eq!(info.palette.as_deref(), Some(palette.as_flattened()));
        let mut read = vec![0; 6];
        reader.next_frame(&mut read).expect("the pixels");
        assert_eq!(read, pixels);
        assert!(write_indexed_png([0, 0], &[], &palette).is_err());
    }
}
