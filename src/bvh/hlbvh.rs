//! HLBVH on the device: treelets of the radix tree under a top that the surface area heuristic splits, level by level.
//!
//! Pantaleoni and Luebke 2010; Garanzha, Pantaleoni, McAllister 2011. `glsl/bvh/hlbvh.glsl` is the device's side; the twin is
//! [`super::twin::hlbvh`] with [`Bvh2::collapsed`](super::layout::Bvh2::collapsed): the same bytes.

use super::codes::Codes;
use super::encode::Encode;
use super::geometry::Input;
use super::method::Hierarchy;
use super::scratch::{BuildPhase, Scratch};
use crate::gpu::shaders::{self, Shader};
use crate::gpu::{Kernel, Step, arguments};

/// How [`Method::Hlbvh`](super::builder::Method::Hlbvh) cuts the radix tree into treelets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Treelets {
    /// The first bits of the code that the primitives of a treelet share; `None`: the bits that it takes to number the primitives.
    pub bits: Option<u32>,
    /// The most primitives of a treelet, 1 or more.
    pub primitives: u32,
}

impl Treelets {
    /// On sponza the tree costs 1.04 times a full sweep's. With 15 bits and 128 primitives it costs 1.09 times that, and takes two
    /// thirds of the time to build.
    pub const DEFAULT: Treelets = Treelets { bits: None, primitives: 64 };

    /// How many bits of these codes are taken for this many primitives.
    pub fn bits(&self, codes: Codes, primitive_count: u32) -> u32 {
        let numbering = 32 - (primitive_count.max(2) - 1).leading_zeros();
        self.bits.unwrap_or(numbering).min(codes.bits)
    }
}

/// Levels of the top that are recorded. On the host, tops of three scenes have 15 to 18 levels; of what is left behind so many
/// here, a workgroup finishes each task alone.
fn levels(count: u32) -> u32 {
    /// `LEVELS` in hlbvh.glsl.
    const MOST: u32 = 32;
    (u32::BITS - count.leading_zeros() + 6).min(MOST)
}

fn kernel(encode: &Encode, treelets: &Treelets, shader: &'static Shader, input: &Input) -> Kernel {
    /// `BY_COUNT` in hlbvh.glsl: pipelines do not depend on the number of primitives.
    const BY_COUNT: u32 = u32::MAX;
    let constants = [treelets.primitives, treelets.bits.unwrap_or(BY_COUNT)];
    encode.reading_kernel_with(shader, input, &constants)
}

impl Hierarchy for &Treelets {
    fn steps(&self, encode: &Encode, input: &Input, arguments: &arguments::Build) -> Vec<Step> {
        let step = |shader, level, groups| {
            let arguments = arguments::Build { level, ..*arguments };
            Step::new("hierarchy", kernel(encode, self, shader, input), &arguments, groups)
        };
        let (levels, tiles, groups) = (levels(encode.count), encode.tiles(), encode.shared_tiles());
        let before_top = [
            step(&shaders::BVH_HLBVH_TREELETS, 0, tiles),
            step(&shaders::BVH_HLBVH_COUNT, 0, tiles),
            step(&shaders::BVH_HLBVH_SCAN, 0, 1),
            step(&shaders::BVH_HLBVH_GATHER, 0, tiles),
        ];
        let top = (0..levels).map(|level| step(&shaders::BVH_HLBVH_SPLIT, level, groups));
        let behind = [&shaders::BVH_HLBVH_FINISH, &shaders::BVH_HLBVH_WEIGH].map(|shader| step(shader, levels, groups));
        before_top.into_iter().chain(top).chain(behind).collect()
    }

    fn persistent(&self, encode: &Encode, input: &Input, shader: &'static Shader) -> [Kernel; 2] {
        [&shaders::BVH_HLBVH_RESET, shader].map(|shader| kernel(encode, self, shader, input))
    }

    fn plan(&self, encode: &Encode, scratch: &mut Scratch) {
        scratch.take_weights(BuildPhase::Hierarchy);
        scratch.take_codes(BuildPhase::Hierarchy);
        scratch.take_child_costs(None);
        scratch.take_sort();
        scratch.take_clusters(BuildPhase::Gather, BuildPhase::Above);
        let top_costs = ["costs of left children above", "costs of right children above"];
        scratch.parts.top_costs = top_costs.map(|name| scratch.take_words(name, BuildPhase::Above, BuildPhase::Above));
        scratch.parts.orders = ["clusters of even levels", "clusters of odd levels"]
            .map(|name| scratch.take_words(name, BuildPhase::Gather, BuildPhase::Top));
        scratch.take_tasks();
        scratch.take_sums(encode.shape.workgroup, BuildPhase::Gather, BuildPhase::Gather);
        scratch.take_ends(BuildPhase::Gather);
    }
}
