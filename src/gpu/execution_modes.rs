//! How a device runs a shader, where it leaves that open: added to a module when its pipeline is made.
//!
//! The SPIR-V of a shader is compiled once for all devices, and a device takes no module that asks for what it lacks.
//!
//! - *Reconvergence* (`SPV_KHR_maximal_reconvergence`): invocations that part at a branch go on together behind it.
//! - *Floats* (`SPV_KHR_float_controls`, part of Vulkan 1.2): subnormal numbers are kept; so are infinities, NaN and the sign of zero;
//!   results are rounded to the nearest. The host does so, and Vulkan lets a device do otherwise.

use super::spirv::{HEADER_WORDS, Instructions, op};
use ash::vk;

const MAXIMALLY_RECONVERGES: u32 = 6023;
const EXTENSION: &[u8] = b"SPV_KHR_maximal_reconvergence\0";
const FLOAT_BITS: u32 = 32;

/// A mode of floats, and the capability that it needs.
struct FloatMode {
    capability: u32,
    mode: u32,
}

const DENORM_PRESERVE: FloatMode = FloatMode { capability: 4464, mode: 4459 };
const SIGNED_ZERO_INF_NAN_PRESERVE: FloatMode = FloatMode { capability: 4466, mode: 4461 };
const ROUNDING_MODE_RTE: FloatMode = FloatMode { capability: 4467, mode: 4462 };

/// What a device has of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct ExecutionModes {
    pub maximal_reconvergence: bool,
    pub denorm_preserve: bool,
    pub signed_zero_inf_nan_preserve: bool,
    pub rounding_mode_rte: bool,
}

impl ExecutionModes {
    /// Those of floats that the device has, and no other.
    pub fn of_floats(instance: &ash::Instance, physical_device: vk::PhysicalDevice) -> ExecutionModes {
        let mut floats = vk::PhysicalDeviceFloatControlsProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut floats);
        // SAFETY: the handles are live, and both structures are Vulkan's.
        unsafe { instance.get_physical_device_properties2(physical_device, &mut properties) };
        ExecutionModes {
            maximal_reconvergence: false,
            denorm_preserve: floats.shader_denorm_preserve_float32 != vk::FALSE,
            signed_zero_inf_nan_preserve: floats.shader_signed_zero_inf_nan_preserve_float32 != vk::FALSE,
            rounding_mode_rte: floats.shader_rounding_mode_rte_float32 != vk::FALSE,
        }
    }

    fn floats(self) -> impl Iterator<Item = FloatMode> {
        [
            (self.denorm_preserve, DENORM_PRESERVE),
            (self.signed_zero_inf_nan_preserve, SIGNED_ZERO_INF_NAN_PRESERVE),
            (self.rounding_mode_rte, ROUNDING_MODE_RTE),
        ]
        .into_iter()
        .filter_map(|(is_there, mode)| is_there.then_some(mode))
    }

    /// The module whose one entry point has these modes. `spirv` is a valid module.
    pub fn added_to(self, spirv: &[u32]) -> Vec<u32> {
        let mut words = spirv[..HEADER_WORDS].to_vec();
        let mut is_extended = false;
        for instruction in Instructions(&spirv[HEADER_WORDS..]) {
            let opcode = instruction[0] & 0xffff;
            // Capabilities are the first section of a module, extensions the second.
            if !is_extended && opcode != op::CAPABILITY {
                self.floats().for_each(|float| words.extend([2 << 16 | op::CAPABILITY, float.capability]));
                words.extend(if self.maximal_reconvergence { extension() } else { Vec::new() });
                is_extended = true;
            }
            words.extend_from_slice(instruction);
            // Entry points and execution modes are sections next to each other, and there is one entry point.
            if opcode == op::ENTRY_POINT {
                let entry = instruction[2];
                if self.maximal_reconvergence {
                    words.extend([3 << 16 | op::EXECUTION_MODE, entry, MAXIMALLY_RECONVERGES]);
                }
                let mode = |float: FloatMode| [4 << 16 | op::EXECUTION_MODE, entry, float.mode, FLOAT_BITS];
                self.floats().for_each(|float| words.extend(mode(float)));
            }
        }
        words
    }
}

fn extension() -> Vec<u32> {
    let name = EXTENSION.chunks(4).map(|four| {
        let mut bytes = [0; 4];
        bytes[..four.len()].copy_from_slice(four);
        u32::from_le_bytes(bytes)
    });
    let name: Vec<u32> = name.collect();
    [vec![(name.len() as u32 + 1) << 16 | op::EXTENSION], name].concat()
}

#[cfg(all(test, feature = "compile-shaders"))]
mod tests {
    use super::*;
    use crate::gpu::shaders;
    use rspirv::dr::{Module, Operand, load_words};
    use rspirv::spirv::{Capability, ExecutionMode};

    const ALL: ExecutionModes = ExecutionModes {
        maximal_reconvergence: true,
        denorm_preserve: true,
        signed_zero_inf_nan_preserve: true,
        rounding_mode_rte: true,
    };

    fn modes_of(module: &Module) -> Vec<ExecutionMode> {
        let entry = &module.entry_points[0].operands[1];
        let of_entry = module.execution_modes.iter().filter(|mode| mode.operands[0] == *entry);
        of_entry
            .filter_map(|mode| match mode.operands[1..] {
                [Operand::ExecutionMode(mode)] => Some(mode),
                [Operand::ExecutionMode(mode), Operand::LiteralBit32(FLOAT_BITS)] => Some(mode),
                _ => None,
            })
            .collect()
    }

    #[test]
    fn a_module_gains_what_is_asked_for_and_nothing_else() {
        let floats = [
            (Capability::DenormPreserve, ExecutionMode::DenormPreserve),
            (Capability::SignedZeroInfNanPreserve, ExecutionMode::SignedZeroInfNanPreserve),
            (Capability::RoundingModeRTE, ExecutionMode::RoundingModeRTE),
        ];
        for shader in shaders::ALL {
            let before = ash::util::read_spv(&mut std::io::Cursor::new(shader.spirv)).expect("whole words");
            assert_eq!(ExecutionModes::default().added_to(&before), before);
            let after = ALL.added_to(&before);
            let (old, new) = (load_words(&before).expect("SPIR-V"), load_words(&after).expect("SPIR-V"));
            let names = |module: &Module| -> Vec<String> {
                module.extensions.iter().map(|e| e.operands[0].unwrap_literal_string().to_owned()).collect()
            };
            assert_eq!(names(&new), [vec!["SPV_KHR_maximal_reconvergence".into()], names(&old)].concat());
            let modes = modes_of(&new);
            assert!(modes.contains(&ExecutionMode::MaximallyReconvergesKHR), "{}", shader.name);
            for (capability, mode) in floats {
                let declared = new.capabilities.iter().filter(|c| c.operands[0] == Operand::Capability(capability));
                assert_eq!((declared.count(), modes.contains(&mode)), (1, true), "{}: {mode:?}", shader.name);
            }
            assert_eq!(new.all_inst_iter().count(), old.all_inst_iter().count() + 2 + 2 * floats.len());
        }
    }
}
