//! Linear BVH on the device: hierarchy with boxes, costs and collapsing bottom-up in one pass (Apetrei 2014).
//!
//! `glsl/bvh/lbvh.glsl` is the device's side; the twin is [`super::twin::lbvh`]: the same bytes.

use super::encode::Encode;
use super::geometry::Input;
use super::method::Hierarchy;
use crate::gpu::{Kernel, Step, arguments, shaders};

pub(super) struct Lbvh;

impl Hierarchy for Lbvh {
    fn steps(&self, encode: &Encode, input: &Input, arguments: &arguments::Build) -> Vec<Step> {
        let kernel = encode.reading_kernel(&shaders::BVH_LBVH_HIERARCHY, input);
        vec![Step::new("hierarchy", kernel, arguments, encode.tiles())]
    }

    fn persistent(&self, encode: &Encode, input: &Input) -> [Kernel; 2] {
        let all = encode.reading_kernel(&shaders::BVH_LBVH_PERSISTENT, input);
        [encode.reset_kernel(&shaders::BVH_LBVH_RESET), all]
    }

    fn scratch_bytes(&self, _count: u64) -> u64 {
        0
    }
}
