//! Maximal reconvergence, added to a module when its pipeline is made (`SPV_KHR_maximal_reconvergence`).
//!
//! The SPIR-V of a shader is compiled once for all devices, and a device without the extension takes no module that asks for it.

const HEADER_WORDS: usize = 5;
const OP_EXTENSION: u32 = 10;
const OP_ENTRY_POINT: u32 = 15;
const OP_EXECUTION_MODE: u32 = 16;
const OP_CAPABILITY: u32 = 17;
const MAXIMALLY_RECONVERGES: u32 = 6023;
const EXTENSION: &[u8] = b"SPV_KHR_maximal_reconvergence\0";

/// The module whose one entry point reconverges maximally. `spirv` is a valid module.
pub(super) fn maximal(spirv: &[u32]) -> Vec<u32> {
    let mut words = spirv[..HEADER_WORDS].to_vec();
    let mut is_extended = false;
    for instruction in Instructions(&spirv[HEADER_WORDS..]) {
        let opcode = instruction[0] & 0xffff;
        // Capabilities and extensions are the first two sections of a module.
        if !is_extended && !matches!(opcode, OP_CAPABILITY | OP_EXTENSION) {
            words.extend(extension());
            is_extended = true;
        }
        words.extend_from_slice(instruction);
        // Entry points and execution modes are sections next to each other, and there is one entry point.
        if opcode == OP_ENTRY_POINT {
            words.extend([3 << 16 | OP_EXECUTION_MODE, instruction[2], MAXIMALLY_RECONVERGES]);
        }
    }
    words
}

fn extension() -> Vec<u32> {
    let name = EXTENSION.chunks(4).map(|four| {
        let mut bytes = [0; 4];
        bytes[..four.len()].copy_from_slice(four);
        u32::from_le_bytes(bytes)
    });
    let name: Vec<u32> = name.collect();
    [vec![(name.len() as u32 + 1) << 16 | OP_EXTENSION], name].concat()
}

/// The instructions of a module behind its header, each with its first word.
struct Instructions<'a>(&'a [u32]);

impl<'a> Iterator for Instructions<'a> {
    type Item = &'a [u32];

    fn next(&mut self) -> Option<&'a [u32]> {
        let length = (self.0.first()? >> 16) as usize;
        let (instruction, rest) = self.0.split_at_checked(length.max(1))?;
        self.0 = rest;
        Some(instruction)
    }
}

#[cfg(all(test, feature = "compile-shaders"))]
mod tests {
    use super::*;
    use crate::gpu::shaders;
    use rspirv::dr::{Operand, load_words};
    use rspirv::spirv::ExecutionMode;

    #[test]
    fn a_module_gains_the_extension_and_the_mode_and_nothing_else() {
        for shader in shaders::ALL {
            let before = ash::util::read_spv(&mut std::io::Cursor::new(shader.spirv)).expect("whole words");
            let after = maximal(&before);
            let (old, new) = (load_words(&before).expect("SPIR-V"), load_words(&after).expect("SPIR-V"));
            let names = |module: &rspirv::dr::Module| -> Vec<String> {
                module.extensions.iter().map(|e| e.operands[0].unwrap_literal_string().to_owned()).collect()
            };
            assert_eq!(names(&new), [names(&old), vec!["SPV_KHR_maximal_reconvergence".into()]].concat());
            let entry = new.entry_points[0].operands[1].clone();
            let modes = new.execution_modes.iter().filter(|mode| {
                mode.operands == [entry.clone(), Operand::ExecutionMode(ExecutionMode::MaximallyReconvergesKHR)]
            });
            assert_eq!(modes.count(), 1, "{}", shader.name);
            assert_eq!(new.execution_modes.len(), old.execution_modes.len() + 1);
            assert_eq!(new.all_inst_iter().count(), old.all_inst_iter().count() + 2);
        }
    }
}
