//! How far the picture is from that of `hedgerow render`.

use crate::Result;
use image::RgbImage;

/// Of all pixels, those that may differ by more than one level of 255.
///
/// The program makes rays in double precision, this engine in floats. So a direction differs by about 3e-8 of its length, which is
/// 2e-5 of a pixel. A ray that passes an edge closer than that may meet the other triangle there. With four rays a pixel and about one
/// edge, that is one pixel of 7,000 where the mesh is, and most of the triangles beside edges look nearly the same.
const OTHER_TRIANGLE: f64 = 1e-4;

/// Of all pixels, those that may differ at all: Vulkan lets a shader's `pow` be off by about a millionth. A colour that close to the
/// middle between two of 255 levels may become the other one.
const OTHER_LEVEL: f64 = 1e-3;

/// Says how many pixels differ.
///
/// # Errors
/// More of them differ than the bounds let.
pub fn compare(ours: &RgbImage, theirs: &RgbImage) -> Result<()> {
    if ours.dimensions() != theirs.dimensions() {
        let (ours, theirs) = (ours.dimensions(), theirs.dimensions());
        return Err(format!("the pictures have {ours:?} and {theirs:?} pixels; draw both in one size").into());
    }
    let difference = |(a, b): (&image::Rgb<u8>, &image::Rgb<u8>)| (0..3).map(|i| a.0[i].abs_diff(b.0[i])).max();
    let differences: Vec<u8> = ours.pixels().zip(theirs.pixels()).filter_map(difference).collect();
    let over = |level: u8| differences.iter().filter(|&&d| d > level).count();
    let (any, more, pixels) = (over(0), over(1), differences.len());
    let most = differences.iter().max().copied().unwrap_or(0);
    println!("{any} of {pixels} pixels differ, {more} by more than 1 of 255, none by more than {most}");
    let within = |count: usize, share: f64| count as f64 <= share * pixels as f64;
    if within(more, OTHER_TRIANGLE) && within(any, OTHER_LEVEL) {
        Ok(())
    } else {
        Err(format!(
            "the pictures differ too much: of all pixels, {OTHER_LEVEL} may differ, {OTHER_TRIANGLE} by more than 1 of 255"
        )
        .into())
    }
}
