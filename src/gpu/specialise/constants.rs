//! Specialisation constants, folded into a module's words, and values that follow from constants.

use crate::gpu::spirv::{BOUND, HEADER_WORDS, Instructions, op, opcode, push};
use std::collections::HashMap;

const SPEC_ID: u32 = 1;

/// What is known of ids.
pub(super) struct Constants<'a> {
    /// The values that are given, by number.
    given: &'a HashMap<u32, u32>,
    /// The number of a specialisation constant.
    numbers: HashMap<u32, u32>,
    /// The types of which values are words: 32-bit integers, and booleans as 0 and 1.
    is_bool: HashMap<u32, bool>,
    values: Vec<Option<u32>>,
    composites: HashMap<u32, Vec<u32>>,
}

impl<'a> Constants<'a> {
    /// Those of a module, of which nothing is known yet.
    pub fn of(given: &'a HashMap<u32, u32>, spirv: &[u32]) -> Constants<'a> {
        let (numbers, is_bool, composites) = Default::default();
        Constants { given, numbers, is_bool, values: vec![None; spirv[BOUND] as usize], composites }
    }

    /// The module with plain constants alone. Those are declared before they are used, so that all are known then.
    pub fn folded(&mut self, spirv: &[u32]) -> Vec<u32> {
        let mut words = spirv[..HEADER_WORDS].to_vec();
        for instruction in Instructions(&spirv[HEADER_WORDS..]) {
            self.fold(instruction, &mut words);
        }
        words
    }

    /// The word that an id is known to be.
    pub fn value(&self, id: u32) -> Option<u32> {
        self.values.get(id as usize).copied().flatten()
    }

    /// Takes a value for known, if its type is one of words. Whether that is new.
    pub fn learn(&mut self, ty: u32, id: u32, value: u32) -> bool {
        let is_new = self.value(id).is_none() && self.is_bool.contains_key(&ty);
        if is_new {
            self.values[id as usize] = Some(value);
        }
        is_new
    }

    /// Learns what an instruction in a function gives, if that follows from constants. Whether it is new.
    pub fn evaluate(&mut self, instruction: &[u32]) -> bool {
        let &[_, ty, id, ref operands @ ..] = instruction else { return false };
        if !self.is_bool.contains_key(&ty) || self.value(id).is_some() {
            return false;
        }
        self.evaluated(opcode(instruction), operands).is_some_and(|value| self.learn(ty, id, value))
    }

    fn fold(&mut self, instruction: &[u32], words: &mut Vec<u32>) {
        let opcode = opcode(instruction);
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
                self.values[id as usize] = Some(u32::from(opcode == op::CONSTANT_TRUE));
            }
            (op::CONSTANT, &[ty, id, value]) => {
                self.learn(ty, id, value);
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
                return push(words, op::CONSTANT_COMPOSITE, instruction[1..].iter().copied());
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
        self.numbers.get(&id).and_then(|number| self.given.get(number)).copied().unwrap_or(default)
    }

    /// Declares a plain constant.
    fn declare(&mut self, ty: u32, id: u32, value: u32, words: &mut Vec<u32>) {
        if self.is_bool.get(&ty) == Some(&true) {
            push(words, if value == 0 { op::CONSTANT_FALSE } else { op::CONSTANT_TRUE }, [ty, id]);
        } else {
            push(words, op::CONSTANT, [ty, id, value]);
        }
        self.learn(ty, id, value);
    }

    /// The value of an operation on constants; `None` for what no shader here does.
    fn evaluated(&self, operation: u32, operands: &[u32]) -> Option<u32> {
        let value = |id: u32| self.value(id);
        match (operation, operands) {
            (op::COMPOSITE_EXTRACT, &[composite, member]) => {
                return value(*self.composites.get(&composite)?.get(member as usize)?);
            }
            (op::COPY_OBJECT, &[id]) => return value(id),
            (op::SELECT, &[condition, yes, no]) => return value(if value(condition)? != 0 { yes } else { no }),
            // One side is enough.
            (op::LOGICAL_AND | op::BITWISE_AND, &[a, b]) if value(a) == Some(0) || value(b) == Some(0) => {
                return Some(0);
            }
            (op::LOGICAL_OR, &[a, b]) if value(a) == Some(1) || value(b) == Some(1) => return Some(1),
            _ => {}
        }
        let (a, b) = match *operands {
            [a] => (value(a)?, 0),
            [a, b] => (value(a)?, value(b)?),
            _ => return None,
        };
        let signed = |value: u32| value as i32;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_take_the_values_that_are_given_and_operations_on_them_are_done() {
        let instruction =
            |opcode: u32, operands: &[u32]| [&[(operands.len() as u32 + 1) << 16 | opcode], operands].concat();
        let [uint, boolean, three, given, default, sum, is_less] = [1, 2, 3, 4, 5, 6, 7];
        let header = vec![0, 0, 0, 8, 0];
        let before = [
            header.clone(),
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
            header,
            instruction(op::TYPE_INT, &[uint, 32, 0]),
            instruction(op::TYPE_BOOL, &[boolean]),
            instruction(op::CONSTANT, &[uint, three, 3]),
            instruction(op::CONSTANT, &[uint, given, 20]),
            instruction(op::CONSTANT_TRUE, &[boolean, default]),
            instruction(op::CONSTANT, &[uint, sum, 23]),
            instruction(op::CONSTANT_FALSE, &[boolean, is_less]),
        ];
        let (given, before) = (HashMap::from([(0, 20)]), before.concat());
        let mut constants = Constants::of(&given, &before);
        assert_eq!(constants.folded(&before), after.concat());
        assert_eq!([sum, is_less].map(|id| constants.value(id)), [Some(23), Some(0)]);
    }
}
