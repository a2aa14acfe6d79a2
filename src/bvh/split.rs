//! Splitting of large triangles before a build: each becomes several references with tighter boxes (Karras and Aila 2013, "Fast
//! Parallel Construction of High-Quality Bounding Volume Hierarchies", section 5).
//!
//! A triangle's *weight* is X · (A_box − A_ideal): the half area of its box, less that of as many boxes as one likes (half the
//! sum of the components of its edges' cross product), times X = 2⁻ⁱ for the most important plane that its box crosses, i being
//! how many halvings of the scene's longest extent the plane's spacing is. It has s = ⌊∛(F · weight)⌋ splits, or as many as one
//! triangle may have, F the greatest that keeps the sum of all within the budget. The planes are those that halve the scene's
//! box along each axis, over and over; a part is split at the one of the greatest spacing that lies inside of its box, and the
//! other splits are given to the two halves by their longest sides.
//!
//! What the paper leaves to floats is in integers here, so that every device finds the same references: weights count eighths of
//! octaves, a histogram of them gives F by bisection, and the cube root is the integer one. No invocation splits a triangle to
//! the end: each finds one reference, going down the triangle's splits from its box, so that a triangle of a thousand splits
//! keeps no other waiting. Nothing is read back; references that there are not are left out as triangles that are not finite are.
//!
//! A record is in the tree once for each part, with the same bytes. So rays may be shown a triangle several times, which changes
//! no closest hit; and a leaf's box holds the part alone. [`super::twin::split`] is the twin, and says why no ray loses a hit.
//! `glsl/bvh/split.glsl` is the device's side.

use super::encode::Encode;
use super::geometry::{Geometry, GeometryFlags, Input, Source};
use super::scratch::Scratch;
use crate::gpu::arguments;
use crate::gpu::scan::{self, Scan};
use crate::gpu::{Context, Step, shaders};
use crate::{Error, Result};
use bytemuck::{Pod, Zeroable};

/// How much may be split.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SplitOptions {
    /// Splits, at most, as a part of the primitives: 0 to [`SplitOptions::MOST_FRACTION`]. Structure and scratch memory grow by
    /// as much.
    pub fraction: f32,
    /// Splits of one triangle, at most: 1 to [`SplitOptions::MOST_SPLITS`].
    pub most: u32,
}

impl SplitOptions {
    /// The paper's 30% more references than triangles, at most; and at most 7 splits of each, which measured well
    /// (docs/notes/splitting.md).
    pub const DEFAULT: SplitOptions = SplitOptions { fraction: 0.3, most: 7 };
    /// As many splits as triangles.
    pub const MOST_FRACTION: f32 = 1.0;
    /// What the budget alone bounds, as the paper has it, but for this.
    pub const MOST_SPLITS: u32 = 1023;

    /// The most splits of this many primitives.
    pub fn budget(&self, primitive_count: u32) -> u32 {
        (f64::from(self.fraction) * f64::from(primitive_count)) as u32
    }

    /// # Errors
    /// A fraction or a number of splits out of range.
    pub fn check(&self) -> Result<()> {
        if !(0.0..=SplitOptions::MOST_FRACTION).contains(&self.fraction) {
            return Err(Error::Argument(format!(
                "split by {}: the fraction of splits is 0 to {}",
                self.fraction,
                SplitOptions::MOST_FRACTION
            )));
        }
        if !(1..=SplitOptions::MOST_SPLITS).contains(&self.most) {
            return Err(Error::Argument(format!(
                "at most {} splits of a triangle: that is 1 to {}",
                self.most,
                SplitOptions::MOST_SPLITS
            )));
        }
        Ok(())
    }
}

impl Default for SplitOptions {
    fn default() -> SplitOptions {
        SplitOptions::DEFAULT
    }
}

/// A part of a triangle: what a leaf of a split tree holds. 32 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SplitReference {
    /// Least corner of a box that the part is in.
    pub lo: [f32; 3],
    /// The triangle; `u32::MAX` if there is no such part.
    pub primitive: u32,
    /// Greatest corner.
    pub hi: [f32; 3],
    /// 0; or why it is in no leaf: a bit of [`super::layout::status`], or `1 << 31`.
    pub left_out: u32,
}

/// The splitting before a build, for one device and a number of triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Split {
    /// Triangles of the input.
    pub primitives: u32,
    most: u32,
    scan: Scan,
}

impl Split {
    pub fn new(context: &Context, options: &SplitOptions, primitives: u32) -> Split {
        Split { primitives, most: options.most, scan: Scan::new(context, primitives) }
    }

    /// Bytes of the sums over tiles of triangles, the last of which is the number of all splits.
    pub fn sums_bytes(&self) -> u64 {
        4 * u64::from(self.scan.sums_words())
    }

    /// # Errors
    /// The geometry wants its primitives to be met once.
    pub fn check(&self, input: &Input) -> Result<()> {
        match input.source {
            Source::One(geometry) if geometry.flags.bits() & GeometryFlags::NO_DUPLICATES.bits() != 0 => {
                Err(Error::Argument(
                    "a geometry that must show rays each primitive once is not split; build without split, or drop its flag"
                        .into(),
                ))
            }
            _ => Ok(()),
        }
    }

    /// The dispatches before those of [`Encode`]; what follows needs a barrier before. Label: `split`.
    pub fn steps(&self, encode: &Encode, input: &Input, build: &arguments::Build, scratch: &Scratch) -> Vec<Step> {
        let (counts, sums) = (build.part(scratch.split_counts), build.part(scratch.split_sums));
        let (Geometry { vertices, indices, transform, vertex_stride, vertex_count, .. }, formats) = input.for_kernels();
        let arguments = arguments::Split {
            vertices,
            indices,
            transform,
            state: build.part(build.parts.split),
            references: build.part(build.parts.references),
            counts,
            total: sums + self.sums_bytes() - 4,
            vertex_stride,
            vertex_count,
            formats,
            primitive_count: self.primitives,
            reference_count: build.primitive_count,
            most_splits: self.most,
        };
        let step = |shader, groups| Step::new("split", encode.unsplit_kernel(shader, input), &arguments, groups);
        let tiles = encode.tiles_of(self.primitives);
        let scanned = scan::ScanBuffers { values: counts, results: counts, sums };
        let before_scan = [
            step(&shaders::BVH_SPLIT_RESET, 1),
            step(&shaders::BVH_SPLIT_BOUNDS, tiles),
            step(&shaders::BVH_SPLIT_GRID, 1),
            step(&shaders::BVH_SPLIT_WEIGH, tiles),
            step(&shaders::BVH_SPLIT_FACTOR, 1),
            step(&shaders::BVH_SPLIT_COUNT, tiles),
        ];
        let references = step(&shaders::BVH_SPLIT_REFERENCES, encode.tiles_of(build.primitive_count));
        before_scan.into_iter().chain(self.scan.steps("split", &scanned)).chain([references]).collect()
    }
}
