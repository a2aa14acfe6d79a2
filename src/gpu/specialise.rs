//! Specialisation constants, folded into a module's words: for drivers that set their values and fold nothing
//! ([`Workarounds::folded_constants`](super::Workarounds)).
//!
//! What is left are plain constants. A branch on one is for the driver's optimiser to take out.

use std::collections::HashMap;

const HEADER_WORDS: usize = 5;
const SPEC_ID: u32 = 1;

/// Opcodes of SPIR-V that declare constants, or name one.
mod op {
    pub const CONSTANT_TRUE: u32 = 41;
    pub const CONSTANT_FALSE: u32 = 42;
    pub const CONSTANT: u32 = 43;
    pub const CONSTANT_COMPOSITE: u32 = 44;
    pub const SPEC_CONSTANT_TRUE: u32 = 48;
    pub const SPEC_CONSTANT_FALSE: u32 = 49;
    pub const SPEC_CONSTANT: u32 = 50;
    pub const SPEC_CONSTANT_COMPOSITE: u32 = 51;
    pub const SPEC_CONSTANT_OP: u32 = 52;
    pub const TYPE_BOOL: u32 = 20;
    pub const TYPE_INT: u32 = 21;
    pub const DECORATE: u32 = 71;
    pub const COMPOSITE_EXTRACT: u32 = 81;
}

/// The module whose specialisation constants have the values that `constants` names by number. `spirv` is a valid module.
pub(super) fn folded(spirv: &[u32], constants: &HashMap<u32, u32>) -> Vec<u32> {
    let mut folder = Folder::of(constants);
    let mut words = spirv[..HEADER_WORDS].to_vec();
    let mut rest = &spirv[HEADER_WORDS..];
    while let Some(&first) = rest.first() {
        let (instruction, behind) = rest.split_at((first >> 16).max(1) as usize);
        folder.fold(instruction, &mut words);
        rest = behind;
    }
    words
}

/// What is known of ids, from the declarations so far: those of constants come before they are used.
struct Folder<'a> {
    constants: &'a HashMap<u32, u32>,
    /// The number of a specialisation constant.
    numbers: HashMap<u32, u32>,
    /// The types of which values are words: 32-bit integers, and booleans as 0 and 1.
    is_bool: HashMap<u32, bool>,
    values: HashMap<u32, u32>,
    composites: HashMap<u32, Vec<u32>>,
}

impl<'a> Folder<'a> {
    fn of(constants: &'a HashMap<u32, u32>) -> Folder<'a> {
        let (numbers, is_bool, values, composites) = Default::default();
        Folder { constants, numbers, is_bool, values, composites }
    }

    fn fold(&mut self, instruction: &[u32], words: &mut Vec<u32>) {
        let opcode = instruction[0] & 0xffff;
        match (opcode, &instruction[1..]) {
            (op::DECORATE, &[id, SPEC_ID, number]) => {
                self.numbers.insert(id, number);
                return;
            }
            (op::TYPE_BOOL, &[ty]) => {
                self.is_bool.insert(ty, true);
            }
            (op::TYPE_INT, &[ty, 32, _]) => {
                self.is_bool.insert(ty, false);
            }
            (op::CONSTANT_TRUE | op::CONSTANT_FALSE, &[_, id]) => {
                self.values.insert(id, u32::from(opcode == op::CONSTANT_TRUE));
            }
            (op::CONSTANT, &[ty, id, value]) if self.is_bool.contains_key(&ty) => {
                self.values.insert(id, value);
            }
            (op::SPEC_CONSTANT_TRUE | op::SPEC_CONSTANT_FALSE, &[ty, id]) => {
                let default = u32::from(opcode == op::SPEC_CONSTANT_TRUE);
                return self.declare(ty, id, self.given(id, default), words);
            }
            (op::SPEC_CONSTANT, &[ty, id, default]) => {
                return self.declare(ty, id, self.given(id, default), words);
            }
            (op::CONSTANT_COMPOSITE | op::SPEC_CONSTANT_COMPOSITE, [_, id, members @ ..]) => {
                self.composites.insert(*id, members.to_vec());
                words.push(instruction[0] & !0xffff | op::CONSTANT_COMPOSITE);
                words.extend_from_slice(&instruction[1..]);
                return;
            }
            (op::SPEC_CONSTANT_OP, &[ty, id, operation, ref operands @ ..]) => {
                if let Some(value) = self.is_bool.get(&ty).and_then(|_| self.evaluated(operation, operands)) {
                    return self.declare(ty, id, value, words);
                }
            }
            _ => {}
        }
        words.extend_from_slice(instruction);
    }

    fn given(&self, id: u32, default: u32) -> u32 {
        self.numbers.get(&id).and_then(|number| self.constants.get(number)).copied().unwrap_or(default)
    }

    /// Declares a plain constant.
    fn declare(&mut self, ty: u32, id: u32, value: u32, words: &mut Vec<u32>) {
        if self.is_bool.get(&ty) == Some(&true) {
            words.extend([3 << 16 | if value == 0 { op::CONSTANT_FALSE } else { op::CONSTANT_TRUE }, ty, id]);
        } else {
            words.extend([4 << 16 | op::CONSTANT, ty, id, value]);
        }
        if self.is_bool.contains_key(&ty) {
            self.values.insert(id, value);
        }
    }

    /// The value of an operation on constants; `None` for what no shader here does.
    fn evaluated(&self, operation: u32, operands: &[u32]) -> Option<u32> {
        if let (op::COMPOSITE_EXTRACT, &[composite, member]) = (operation, operands) {
            return self.values.get(self.composites.get(&composite)?.get(member as usize)?).copied();
        }
        let values: Option<Vec<u32>> = operands.iter().map(|id| self.values.get(id).copied()).collect();
        let signed = |value: u32| value as i32;
        let values = values?;
        let [a, b, c] = std::array::from_fn(|i| values.get(i).copied().unwrap_or(0));
        Some(match operation {
            126 => a.wrapping_neg(),
            128 => a.wrapping_add(b),
            130 => a.wrapping_sub(b),
            132 => a.wrapping_mul(b),
            134 => a.checked_div(b)?,
            135 => signed(a).checked_div(signed(b))? as u32,
            137 => a.checked_rem(b)?,
            164 | 170 => u32::from(a == b),
            165 | 171 => u32::from(a != b),
            166 | 197 => a | b,
            167 | 199 => a & b,
            168 => u32::from(a == 0),
            169 => [c, b][usize::from(a != 0)],
            172 => u32::from(a > b),
            173 => u32::from(signed(a) > signed(b)),
            174 => u32::from(a >= b),
            175 => u32::from(signed(a) >= signed(b)),
            176 => u32::from(a < b),
            177 => u32::from(signed(a) < signed(b)),
            178 => u32::from(a <= b),
            179 => u32::from(signed(a) <= signed(b)),
            194 => a.checked_shr(b)?,
            195 => signed(a).checked_shr(b)? as u32,
            196 => a.checked_shl(b)?,
            198 => a ^ b,
            200 => !a,
            _ => return None,
        })
    }
}

#[cfg(all(test, feature = "compile-shaders"))]
mod tests {
    use super::*;
    use crate::gpu::shaders;
    use rspirv::dr::load_words;
    use rspirv::spirv::Op;

    #[test]
    fn no_shader_keeps_a_specialisation_constant() {
        for shader in shaders::ALL {
            let words = ash::util::read_spv(&mut std::io::Cursor::new(shader.spirv)).expect("whole words");
            let module = load_words(folded(&words, &HashMap::from([(0, 8)]))).expect("SPIR-V");
            let left = module.types_global_values.iter().filter(|i| {
                matches!(
                    i.class.opcode,
                    Op::SpecConstant
                        | Op::SpecConstantTrue
                        | Op::SpecConstantFalse
                        | Op::SpecConstantComposite
                        | Op::SpecConstantOp
                )
            });
            let left: Vec<_> = left.map(|i| i.operands.clone()).collect();
            assert!(left.is_empty(), "{}: {left:?}", shader.name);
        }
    }

    #[test]
    fn constants_take_the_values_that_are_given_and_operations_on_them_are_done() {
        let instruction =
            |opcode: u32, operands: &[u32]| [&[(operands.len() as u32 + 1) << 16 | opcode], operands].concat();
        let [uint, boolean, three, given, default, sum, is_less] = [1, 2, 3, 4, 5, 6, 7];
        let before = [
            vec![0; HEADER_WORDS],
            instruction(op::DECORATE, &[given, SPEC_ID, 0]),
            instruction(op::DECORATE, &[default, SPEC_ID, 1]),
            instruction(op::TYPE_INT, &[uint, 32, 0]),
            instruction(op::TYPE_BOOL, &[boolean]),
            instruction(op::CONSTANT, &[uint, three, 3]),
            instruction(op::SPEC_CONSTANT, &[uint, given, 1]),
            instruction(op::SPEC_CONSTANT_TRUE, &[boolean, default]),
            instruction(op::SPEC_CONSTANT_OP, &[uint, sum, 128, given, three]),
            instruction(op::SPEC_CONSTANT_OP, &[boolean, is_less, 176, sum, three]),
        ];
        let after = [
            vec![0; HEADER_WORDS],
            instruction(op::TYPE_INT, &[uint, 32, 0]),
            instruction(op::TYPE_BOOL, &[boolean]),
            instruction(op::CONSTANT, &[uint, three, 3]),
            instruction(op::CONSTANT, &[uint, given, 20]),
            instruction(op::CONSTANT_TRUE, &[boolean, default]),
            instruction(op::CONSTANT, &[uint, sum, 23]),
            instruction(op::CONSTANT_FALSE, &[boolean, is_less]),
        ];
        assert_eq!(folded(&before.concat(), &HashMap::from([(0, 20)])), after.concat());
    }
}
