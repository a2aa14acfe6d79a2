//! LBVHs of few triangles, each built by one workgroup that does all phases: two to a dispatch, or all of a batch.
//!
//! A chain of dispatches costs a small build more than its work; many small builds in a batch need no barriers between them this way.
//! Arguments of two fit into the push constants. Where the caller has memory for them, those of all lie there.

use super::encode::Encode;
use super::geometry::Input;
use crate::Result;
use crate::gpu::arguments::{self, BUILD_STATE_BYTES};
use crate::gpu::{ArgumentTable, Kernel, Step, shaders};
use std::collections::HashMap;

/// The label of the dispatches.
pub(super) const PHASE: &str = "build";
/// Builds that fit into the push constants.
const AT_ONCE: usize = 2;
/// With the bytes of a build's state: the arguments lie in a table. The twin of that in glsl/bvh/lbvh_workgroup.comp.
const IN_TABLE: u32 = 1 << 31;

/// A build that one workgroup does.
pub(super) struct SmallBuild<'a> {
    pub encode: &'a Encode,
    /// Leaves of one primitive each, whatever `encode` says: subtrees are weighed later.
    pub single: bool,
    pub input: &'a Input,
    /// Addresses of structure and scratch memory.
    pub memory: [u64; 2],
}

/// The dispatches of the builds, which need no barrier between them; their arguments go into `table`, if there is one.
pub(super) fn steps(small: &[SmallBuild<'_>], mut table: Option<&mut ArgumentTable>) -> Result<Vec<Step>> {
    // What fills the push constants together must be of one kind.
    let mut kinds: HashMap<(Kernel, u32, [u32; 2]), Vec<arguments::Small>> = HashMap::new();
    let mut order = Vec::new();
    for &SmallBuild { encode, single, input, memory: [structure, scratch] } in small {
        let (geometry, formats) = encode.checked(input)?;
        let kernel = encode.lbvh_kernel(&shaders::BVH_LBVH_WORKGROUP, input);
        let costs = [encode.collapse.c_t.to_bits(), encode.collapse.c_i.to_bits()];
        let flags = encode.code_kind() | u32::from(encode.collapse.enabled && !single) << 25 | encode.build_flags << 26;
        let kind = (kernel, flags, costs);
        let builds = kinds.entry(kind.clone()).or_default();
        if builds.is_empty() {
            order.push(kind);
        }
        builds.push(arguments::Small {
            vertices: geometry.vertices,
            indices: geometry.indices,
            transform: geometry.transform,
            structure,
            scratch,
            vertex_stride: geometry.vertex_stride,
            vertex_count: geometry.vertex_count,
            formats,
            primitive_count: encode.count,
        });
    }
    let mut steps = Vec::new();
    for kind in order {
        let (kernel, codes_and_flags, costs) = &kind;
        let step = |builds: [arguments::Small; AT_ONCE], count: usize, table: u32| {
            let arguments = arguments::BuildAlone {
                builds,
                step_cost: f32::from_bits(costs[0]),
                test_cost: f32::from_bits(costs[1]),
                codes_and_flags: *codes_and_flags,
                state_bytes: BUILD_STATE_BYTES as u32 | table,
            };
            Step::new(PHASE, kernel.clone(), &arguments, count as u32)
        };
        let builds = &kinds[&kind];
        match &mut table {
            Some(table) if builds.len() > AT_ONCE => {
                let first = arguments::Small { vertices: table.put(builds)?, ..builds[0] };
                steps.push(step([first; AT_ONCE], builds.len(), IN_TABLE));
            }
            _ => steps.extend(builds.chunks(AT_ONCE).map(|pair| {
                let mut builds = [pair[0]; AT_ONCE];
                builds[..pair.len()].copy_from_slice(pair);
                step(builds, pair.len(), 0)
            })),
        }
    }
    Ok(steps)
}
