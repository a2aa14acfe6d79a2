//! Linear BVH on the device: hierarchy with boxes, costs and collapsing bottom-up in one pass (Apetrei 2014).
//!
//! `glsl/bvh/lbvh.glsl` is the device's side; the twin is [`super::twin::lbvh`]: the same bytes.

use super::encode::Encode;
use super::geometry::Input;
use super::method::Hierarchy;
use super::scratch::{BuildPhase, Scratch};
use crate::gpu::shaders::{self, Shader};
use crate::gpu::{Kernel, Step, arguments};

pub(super) struct Lbvh;

impl Hierarchy for Lbvh {
    fn steps(&self, encode: &Encode, input: &Input, arguments: &arguments::Build) -> Vec<Step> {
        let kernel = encode.lbvh_kernel(&shaders::BVH_LBVH_HIERARCHY, input);
        vec![Step::new("hierarchy", kernel, arguments, encode.tiles())]
    }

    fn persistent(&self, encode: &Encode, input: &Input, shader: &'static Shader) -> [Kernel; 2] {
        [encode.reset_kernel(&shaders::BVH_LBVH_RESET), encode.lbvh_kernel(shader, input)]
    }

    // As glsl/bvh/lbvh_workgroup.comp lays it out as well.
    fn plan(&self, encode: &Encode, scratch: &mut Scratch) {
        scratch.take_codes(BuildPhase::Hierarchy);
        scratch.take_ends(BuildPhase::Hierarchy);
        scratch.take_sort();
        scratch.take_child_costs(encode.child_order);
    }

    fn writes_weights(&self) -> bool {
        false
    }
}
