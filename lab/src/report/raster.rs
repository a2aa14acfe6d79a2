//! SVG to pixels, with fonts that the program carries: a machine without any gives the same picture.

use resvg::{tiny_skia, usvg};

/// Draws `svg` into `width` × `height` pixels, each of its units `scale` pixels large.
///
/// # Errors
/// What is wrong with the SVG or the size, in a few words.
pub fn rasterise(svg: &str, (width, height): (u32, u32), scale: f32) -> Result<tiny_skia::Pixmap, String> {
    let mut options = usvg::Options { font_family: "Noto Sans".into(), ..usvg::Options::default() };
    let fonts = options.fontdb_mut();
    fonts.load_font_data(notosans::REGULAR_TTF.to_vec());
    fonts.load_font_data(notosans::BOLD_TTF.to_vec());
    fonts.set_sans_serif_family("Noto Sans");
    let tree = usvg::Tree::from_str(svg, &options).map_err(|e| e.to_string())?;
    let mut pixels = tiny_skia::Pixmap::new(width, height).ok_or("too large")?;
    resvg::render(&tree, tiny_skia::Transform::from_scale(scale, scale), &mut pixels.as_mut());
    Ok(pixels)
}
