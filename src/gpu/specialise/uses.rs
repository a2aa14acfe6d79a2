//! What nothing uses, left out of a module: values, variables, constants and types, and what is said of them.
//!
//! Which words of an instruction are ids is not looked up: each word that could be one counts as a use, and so something stays now and then.

use crate::gpu::spirv::{BOUND, HEADER_WORDS, Instructions, op, opcode, push};

const BUILT_IN: u32 = 11;
const WORKGROUP_SIZE: u32 = 25;
/// Of the operands of a load.
const VOLATILE: u32 = 1;
/// Of GLSL.std.450, what writes through a pointer.
const MODF: u32 = 35;
const FREXP: u32 = 51;

/// The module without what nothing uses.
pub(super) fn without_unused(spirv: &[u32]) -> Vec<u32> {
    let instructions: Vec<&[u32]> = Instructions(&spirv[HEADER_WORDS..]).collect();
    let is_used = used(&instructions, spirv[BOUND] as usize);
    let is_used = |id: u32| is_used.get(id as usize).copied().unwrap_or(false);
    let mut words = spirv[..HEADER_WORDS].to_vec();
    for instruction in instructions {
        match role(instruction) {
            Role::Gives(id) | Role::Tells(id) if !is_used(id) => {}
            Role::EntryPoint => {
                let name_words = instruction[3..].iter().position(|word| word >> 24 == 0).map_or(0, |last| last + 1);
                let (named, interface) = instruction[1..].split_at(2 + name_words);
                let interface = interface.iter().filter(|&&id| is_used(id));
                push(&mut words, op::ENTRY_POINT, named.iter().chain(interface).copied());
            }
            _ => words.extend_from_slice(instruction),
        }
    }
    words
}

/// What an instruction is there for.
enum Role {
    /// An id, and nothing else.
    Gives(u32),
    /// Something of an id: of a value, a variable or a type. Of what acts nothing is said that matters.
    Tells(u32),
    EntryPoint,
    /// What it does: it stays.
    Acts,
}

fn role(instruction: &[u32]) -> Role {
    match (opcode(instruction), &instruction[1..]) {
        // The constant that says how large workgroups are.
        (op::DECORATE, &[_, BUILT_IN, WORKGROUP_SIZE]) => Role::Acts,
        (op::NAME | op::MEMBER_NAME | op::TYPE_FORWARD_POINTER | op::DECORATE | op::MEMBER_DECORATE, &[id, ..]) => {
            Role::Tells(id)
        }
        (op::ENTRY_POINT, _) => Role::EntryPoint,
        (op::EXT_INST, &[_, _, _, MODF | FREXP, ..]) => Role::Acts,
        (op::LOAD, &[_, _, _, operands, ..]) if operands & VOLATILE != 0 => Role::Acts,
        // Types.
        (19..=38, &[id, ..]) => Role::Gives(id),
        // Values without an effect: constants, variables, loads, composites, conversions, arithmetic, comparisons, bits, OpPhi, OpCopyLogical.
        (
            op::UNDEF | op::EXT_INST | 41..=52 | 59 | op::LOAD | 65..=68 | 77..=84 | 109..=124 | 126..=205 | 245 | 400,
            &[_, id, ..],
        ) => Role::Gives(id),
        _ => Role::Acts,
    }
}

/// Whether something that stays needs an id, for each id that is given.
fn used(instructions: &[&[u32]], bound: usize) -> Vec<bool> {
    let mut given_by: Vec<Option<&[u32]>> = vec![None; bound];
    let mut ids: Vec<u32> = Vec::new();
    for instruction in instructions {
        match role(instruction) {
            Role::Gives(id) => given_by[id as usize] = Some(instruction),
            Role::Acts => ids.extend_from_slice(&instruction[1..]),
            Role::EntryPoint => ids.push(instruction[2]),
            Role::Tells(_) => {}
        }
    }
    let mut is_used = vec![false; bound];
    while let Some(id) = ids.pop() {
        let Some(&Some(given)) = given_by.get(id as usize) else { continue };
        if !std::mem::replace(&mut is_used[id as usize], true) {
            ids.extend_from_slice(&given[1..]);
        }
    }
    is_used
}
