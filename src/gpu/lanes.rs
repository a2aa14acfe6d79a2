//! Workgroups that are one subgroup: there an invocation's number in the workgroup may be that in the subgroup.
//!
//! A driver of a CPU knows the latter, its lanes being constants. lavapipe finds the former by eight divisions, and LLVM finds it anew behind
//! each barrier and in loops: a fifth of the samples of kernels that build small trees by one workgroup (docs/notes/rays.md). Sources know
//! nothing of it, for most devices have several subgroups in a workgroup: a module is rewritten when its pipeline is made.

use super::spirv::{HEADER_WORDS, Instructions, op, opcode, push};

const BUILT_IN: u32 = 11;
const LOCAL_INVOCATION_INDEX: u32 = 29;
const SUBGROUP_LOCAL_INVOCATION_ID: u32 = 41;
/// The capability that the latter needs.
const GROUP_NON_UNIFORM: u32 = 61;

/// The module with invocations numbered by their subgroup. `spirv` is a valid module whose workgroup is one full subgroup.
pub(super) fn numbered_by_subgroup(spirv: &[u32]) -> Vec<u32> {
    let instructions = || Instructions(&spirv[HEADER_WORDS..]);
    let variable = |built_in| {
        instructions().find_map(|instruction| match (opcode(instruction), &instruction[1..]) {
            (op::DECORATE, &[id, BUILT_IN, found]) if found == built_in => Some(id),
            _ => None,
        })
    };
    let Some(index) = variable(LOCAL_INVOCATION_INDEX) else { return spirv.to_vec() };
    // An entry point has one variable for each built-in value.
    let lane = variable(SUBGROUP_LOCAL_INVOCATION_ID);
    let has_capability = instructions().any(|i| opcode(i) == op::CAPABILITY && i[1] == GROUP_NON_UNIFORM);
    let mut words = spirv[..HEADER_WORDS].to_vec();
    if !has_capability {
        push(&mut words, op::CAPABILITY, [GROUP_NON_UNIFORM]);
    }
    for instruction in instructions() {
        match (opcode(instruction), &instruction[1..], lane) {
            (op::DECORATE, &[id, BUILT_IN, LOCAL_INVOCATION_INDEX], None) => {
                push(&mut words, op::DECORATE, [id, BUILT_IN, SUBGROUP_LOCAL_INVOCATION_ID]);
            }
            (op::LOAD, &[ty, result, from, ref operands @ ..], Some(lane)) if from == index => {
                push(&mut words, op::LOAD, [ty, result, lane].into_iter().chain(operands.iter().copied()));
            }
            _ => words.extend_from_slice(instruction),
        }
    }
    words
}

#[cfg(all(test, feature = "compile-shaders"))]
mod tests {
    use super::*;
    use crate::gpu::shaders;
    use rspirv::dr::{Module, Operand, load_words};
    use rspirv::spirv::{BuiltIn, Capability, Decoration, Op};

    fn variables(module: &Module, built_in: BuiltIn) -> Vec<u32> {
        let is_it = |operands: &[Operand]| {
            operands[1..] == [Operand::Decoration(Decoration::BuiltIn), Operand::BuiltIn(built_in)]
        };
        let decorated = module.annotations.iter().filter(|a| a.class.opcode == Op::Decorate && is_it(&a.operands));
        decorated.map(|a| a.operands[0].unwrap_id_ref()).collect()
    }

    fn uses(module: &Module, variables: &[u32]) -> Vec<(Op, Option<u32>)> {
        let instructions = module.functions.iter().flat_map(|f| f.all_inst_iter());
        let uses = instructions
            .filter(|i| i.operands.iter().any(|o| o.id_ref_any().is_some_and(|id| variables.contains(&id))));
        uses.map(|i| (i.class.opcode, i.result_id)).collect()
    }

    #[test]
    fn what_was_loaded_from_the_one_number_is_loaded_from_the_other_and_nothing_else_changes() {
        let mut with_both = 0;
        for shader in shaders::ALL {
            let words = ash::util::read_spv(&mut std::io::Cursor::new(shader.spirv)).expect("whole words");
            let rewritten = numbered_by_subgroup(&words);
            let (before, after) = (load_words(&words).expect("SPIR-V"), load_words(&rewritten).expect("SPIR-V"));
            let indices = variables(&before, BuiltIn::LocalInvocationIndex);
            if indices.is_empty() {
                assert_eq!(words, rewritten, "{}", shader.name);
                continue;
            }
            let lanes = variables(&before, BuiltIn::SubgroupLocalInvocationId);
            with_both += usize::from(!lanes.is_empty());
            let all = [indices.clone(), lanes].concat();
            let found = variables(&after, BuiltIn::SubgroupLocalInvocationId);
            assert_eq!(found.len(), 1, "{}", shader.name);
            assert_eq!(uses(&after, &found), uses(&before, &all), "{}", shader.name);
            assert!(uses(&before, &all).iter().all(|&(op, _)| op == Op::Load), "{}", shader.name);
            assert!(uses(&after, &variables(&after, BuiltIn::LocalInvocationIndex)).is_empty(), "{}", shader.name);
            let needed = [Operand::Capability(Capability::GroupNonUniform)];
            assert_eq!(after.capabilities.iter().filter(|c| c.operands == needed).count(), 1, "{}", shader.name);
            let added = usize::from(!before.capabilities.iter().any(|c| c.operands == needed));
            assert_eq!(after.all_inst_iter().count(), before.all_inst_iter().count() + added, "{}", shader.name);
        }
        assert!(with_both > 0, "no shader has both numbers");
    }
}
