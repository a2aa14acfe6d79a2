//! What the shaders' SPIR-V uses is what `gpu::requirements` asks of a device, and nothing else.

use hedgerow::gpu::shaders;
use rspirv::dr::{Module, Operand, load_bytes};
use rspirv::spirv::{BuiltIn, Capability, Decoration, Op};

fn modules() -> impl Iterator<Item = (&'static str, Module)> {
    let all = shaders::ALL.iter().chain(hedgerow_lab::shaders::ALL);
    all.map(|shader| (shader.name, load_bytes(shader.spirv).expect("SPIR-V of shaderc")))
}

/// What a device must have for a capability, as src/gpu/requirements.rs checks it; `None` where it is not required.
fn required(capability: Capability) -> Option<&'static str> {
    Some(match capability {
        Capability::Shader => "Vulkan",
        Capability::PhysicalStorageBufferAddresses => "bufferDeviceAddress",
        Capability::VulkanMemoryModel => "vulkanMemoryModel",
        Capability::VulkanMemoryModelDeviceScope => "vulkanMemoryModelDeviceScope",
        Capability::GroupNonUniform => "basic subgroup operations",
        Capability::GroupNonUniformVote => "vote subgroup operations",
        Capability::GroupNonUniformBallot => "ballot subgroup operations",
        Capability::GroupNonUniformArithmetic => "arithmetic subgroup operations",
        Capability::GroupNonUniformShuffle => "shuffle subgroup operations",
        _ => return None,
    })
}

/// What a module needs that stands beside one without it, and is taken where the device has it: `gpu::Optional`.
fn of_the_module(shader: &str, capability: Capability) -> bool {
    capability == Capability::Int64 && shader.ends_with("_int64")
}

/// What the driver's peers need beyond it: their pipelines are made only where `DriverTracing` is there.
fn of_the_driver(shader: &str, capability: Capability) -> bool {
    match capability {
        Capability::RayQueryKHR => ["measure/ray_query", "measure/driver_probe"].contains(&shader),
        Capability::RayTracingKHR => shader.starts_with("measure/driver_"),
        _ => false,
    }
}

#[test]
fn every_capability_of_a_shader_is_required_of_the_device() {
    for (name, module) in modules() {
        for declared in &module.capabilities {
            let Operand::Capability(capability) = declared.operands[0] else { unreachable!("OpCapability names one") };
            let known =
                required(capability).is_some() || of_the_module(name, capability) || of_the_driver(name, capability);
            assert!(known, "{name} needs {capability:?}, which src/gpu/requirements.rs does not ask for");
        }
    }
}

/// Where subgroups may be smaller than the device says, the built-in still says what the device says: kernels count subgroups instead
/// (`gl_NumSubgroups`) and ask ballots who is there.
#[test]
fn no_shader_reads_the_size_of_subgroups() {
    let reads: Vec<_> = modules()
        .filter(|(_, module)| {
            module.annotations.iter().any(|a| {
                a.operands.contains(&Operand::Decoration(Decoration::BuiltIn))
                    && a.operands.contains(&Operand::BuiltIn(BuiltIn::SubgroupSize))
            })
        })
        .map(|(name, _)| name)
        .collect();
    assert!(reads.is_empty(), "{reads:?} read gl_SubgroupSize");
}

/// Otherwise the feature `subgroupBroadcastDynamicId` would be required; a shuffle takes any lane.
#[test]
fn broadcasts_are_from_lanes_known_when_a_pipeline_is_made() {
    for (name, module) in modules() {
        let is_constant = |id: u32| module.types_global_values.iter().any(|value| value.result_id == Some(id));
        for broadcast in module.all_inst_iter().filter(|i| i.class.opcode == Op::GroupNonUniformBroadcast) {
            let lane = broadcast.operands.last().and_then(Operand::id_ref_any).expect("the lane is the last operand");
            assert!(is_constant(lane), "{name} broadcasts from a lane that is known when it runs: take a shuffle");
        }
    }
}
