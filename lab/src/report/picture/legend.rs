//! The strip below a picture that says what its colours mean.

use super::colour;
use crate::report::raster::rasterise;
use crate::report::theme::{self, INK, PAPER};
use crate::{Error, Result};
use image::{Rgb, RgbImage};

/// In units of the strip.
const HEIGHT: u32 = 44;

/// `image` with a strip below it that `content` draws, as SVG, for a width in units of the strip.
pub(super) fn below(image: RgbImage, content: impl FnOnce(f32) -> String) -> Result<RgbImage> {
    let (width, height) = image.dimensions();
    let scale = (width as f32 / 560.0).clamp(0.25, 3.0);
    let strip_height = (HEIGHT as f32 * scale).round() as u32;
    let units = width as f32 / scale;
    let svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{units}\" height=\"{HEIGHT}\" font-family=\"sans-serif\">\
         <rect width=\"{units}\" height=\"{HEIGHT}\" fill=\"{}\"/>{}</svg>",
        theme::hex(PAPER.light),
        content(units)
    );
    let strip = rasterise(&svg, (width, strip_height), scale)
        .map_err(|reason| Error::Chart { chart: "the legend".into(), reason })?;
    let mut whole = RgbImage::new(width, height + strip_height);
    image::imageops::replace(&mut whole, &image, 0, 0);
    for (i, pixel) in strip.pixels().iter().enumerate() {
        let (x, y) = (i as u32 % width, i as u32 / width);
        whole.put_pixel(x, height + y, Rgb([pixel.red(), pixel.green(), pixel.blue()]));
    }
    Ok(whole)
}

/// A line of text.
pub(super) fn text((x, y): (f32, f32), anchor: &str, words: &str) -> String {
    let ink = theme::hex(INK.light);
    format!("<text x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\" font-size=\"12\" fill=\"{ink}\">{words}</text>")
}

/// `image` above what the colours of a heat map mean: at the dark and at the bright end, and in words between them.
pub(super) fn with_scale(image: RgbImage, [low, high]: [String; 2], middle: &str) -> Result<RgbImage> {
    below(image, |width| {
        const STOPS: u32 = 16;
        let stops: String = (0..=STOPS)
            .map(|i| {
                let place = i as f32 / STOPS as f32;
                let Rgb([r, g, b]) = colour(place);
                format!("<stop offset=\"{place}\" stop-color=\"rgb({r},{g},{b})\"/>")
            })
            .collect();
        format!(
            "<defs><linearGradient id=\"heat\">{stops}</linearGradient></defs>\
             <rect x=\"10\" y=\"8\" width=\"{bar}\" height=\"12\" fill=\"url(#heat)\"/>{}{}{}",
            text((10.0, 36.0), "start", &low),
            text((width / 2.0, 36.0), "middle", middle),
            text((width - 10.0, 36.0), "end", &high),
            bar = width - 20.0,
        )
    })
}
