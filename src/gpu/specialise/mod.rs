//! Specialisation before the driver sees a module: its constants get their values, and what their values leave out goes.
//!
//! A shader here is one module for all that it can do, and constants choose (no variants). Of a large one they leave less than a fifth. A
//! driver reads all of it first, and then takes out what no branch reaches: with its code in lavapipe's cache, a quick check of LBVHs and
//! wide trees took 5.3 s, and takes 1.7 s so. SwiftShader takes nothing out, and for each loop looks for paths through all that is left,
//! breadth first, taking a block once for each path to it (`Spirv::Function::ExistsPath`): each of n `if`s in sequence doubled the time.
//!
//! - [`constants`] gives constants their values, and tells values that follow from them;
//! - [`branches`] leaves out blocks that no branch reaches;
//! - [`uses`] leaves out what nothing uses.
//!
//! Modules are ours, from an optimising compiler: one function, everything inlined, structured control flow, selectors of switches in one
//! word. What is not known stays as it is.

mod branches;
mod constants;
mod uses;

use constants::Constants;
use std::collections::HashMap;

/// The module whose specialisation constants have the values that `constants` names by number, without what that leaves out. `spirv` is a
/// valid module.
pub(super) fn specialised(spirv: &[u32], constants: &HashMap<u32, u32>) -> Vec<u32> {
    let mut known = Constants::of(constants, spirv);
    let folded = known.folded(spirv);
    uses::without_unused(&branches::without_unreached(&folded, &mut known))
}

#[cfg(all(test, feature = "compile-shaders"))]
pub(super) mod tests {
    use super::*;
    use crate::gpu::shaders;
    use crate::gpu::spirv::{BOUND, HEADER_WORDS, push};
    use rspirv::dr::{Function, Module, Operand, load_words};
    use rspirv::spirv::Op;
    use std::collections::HashSet;

    pub(in crate::gpu) fn words_of(spirv: &[u8]) -> Vec<u32> {
        ash::util::read_spv(&mut std::io::Cursor::new(spirv)).expect("whole words")
    }

    /// Constants of all numbers that shaders have: each of one value, and of values that differ.
    pub(in crate::gpu) fn choices() -> Vec<HashMap<u32, u32>> {
        let all = |value: fn(u32) -> u32| (0..31).map(|number| (number, value(number))).collect();
        vec![HashMap::new(), all(|_| 1), all(|_| 2), all(|number| 8 >> (number % 4)), all(|number| 16 + number % 3)]
    }

    fn ids(operands: &[Operand]) -> impl Iterator<Item = u32> + '_ {
        operands.iter().filter_map(Operand::id_ref_any)
    }

    /// That what is named is there, what a phi lists are the blocks before, and each loop has one way back.
    pub(in crate::gpu) fn assert_whole(module: &Module, what: &str) {
        let defined: HashSet<u32> = module.all_inst_iter().filter_map(|i| i.result_id).collect();
        for instruction in module.all_inst_iter() {
            let types = instruction.result_type.into_iter();
            for id in types.chain(ids(&instruction.operands)) {
                assert!(defined.contains(&id), "{what}: %{id} is nowhere: {instruction:?}");
            }
        }
        module.functions.iter().for_each(|function| assert_structured(function, what));
    }

    fn assert_structured(function: &Function, what: &str) {
        let labels: Vec<u32> = function.blocks.iter().map(|block| block.label_id().expect("a label")).collect();
        let place = |label: u32| labels.iter().position(|&l| l == label);
        let mut before: Vec<Vec<u32>> = vec![Vec::new(); labels.len()];
        for (block, &label) in function.blocks.iter().zip(&labels) {
            let end = block.instructions.last().expect("an end");
            let condition = usize::from(matches!(end.class.opcode, Op::BranchConditional | Op::Switch));
            let targets: HashSet<u32> = ids(&end.operands).skip(condition).collect();
            for target in targets {
                before[place(target).unwrap_or_else(|| panic!("{what}: no block %{target}"))].push(label);
            }
        }
        for (at, block) in function.blocks.iter().enumerate() {
            for instruction in &block.instructions {
                let operands: Vec<u32> = ids(&instruction.operands).collect();
                match instruction.class.opcode {
                    Op::Phi => {
                        let mut from: Vec<u32> = operands.chunks_exact(2).map(|pair| pair[1]).collect();
                        from.sort_unstable();
                        before[at].sort_unstable();
                        assert_eq!(from, before[at], "{what}: {instruction:?}");
                    }
                    Op::LoopMerge => {
                        assert!(operands.iter().all(|&label| place(label).is_some()), "{what}: {instruction:?}");
                        let back = before[at].iter().filter(|&&label| place(label) >= Some(at));
                        assert_eq!(back.count(), 1, "{what}: ways back of {instruction:?}");
                    }
                    Op::SelectionMerge => assert!(place(operands[0]).is_some(), "{what}: {instruction:?}"),
                    _ => {}
                }
            }
        }
    }

    #[test]
    fn every_shader_is_whole_by_any_constants_and_keeps_no_specialisation_constant() {
        for shader in shaders::ALL {
            for spirv in [Some(shader.spirv), shader.by_table].into_iter().flatten() {
                for constants in choices() {
                    let what = format!("{}, {constants:?}", shader.name);
                    let module = load_words(specialised(&words_of(spirv), &constants)).expect("SPIR-V");
                    assert_whole(&module, &what);
                    let is_left = |i: &&rspirv::dr::Instruction| {
                        matches!(
                            i.class.opcode,
                            Op::SpecConstant
                                | Op::SpecConstantTrue
                                | Op::SpecConstantFalse
                                | Op::SpecConstantComposite
                                | Op::SpecConstantOp
                        )
                    };
                    let left: Vec<_> = module.types_global_values.iter().filter(is_left).collect();
                    assert!(left.is_empty(), "{what}: {left:?}");
                }
            }
        }
    }

    /// Seven eighths of what can do everything.
    #[test]
    fn a_build_by_one_workgroup_is_as_long_as_what_its_constants_ask_for() {
        let shader = shaders::ALL.iter().find(|shader| shader.name == "bvh/lbvh_workgroup").expect("it is there");
        let words = words_of(shader.spirv);
        let of_defaults = [(0, 8), (1, 32), (2, 4), (3, 0), (4, 1), (5, 0), (6, 0), (7, 0), (30, 65535), (29, 1)];
        let short = specialised(&words, &HashMap::from(of_defaults));
        assert!(short.len() * 5 < words.len(), "{} of {} words", short.len(), words.len());
    }

    /// A module of one function over blocks, with a condition of number 0 and another that nobody knows.
    fn module(blocks: &[Vec<u32>]) -> Vec<u32> {
        let instruction = |opcode: u32, operands: &[u32]| {
            let mut words = Vec::new();
            push(&mut words, opcode, operands.iter().copied());
            words
        };
        let head = [
            instruction(71, &[KNOWN, 1, 0]),
            instruction(20, &[BOOL]),
            instruction(21, &[UINT, 32, 0]),
            instruction(19, &[VOID]),
            instruction(33, &[VOID_FUNCTION, VOID]),
            instruction(49, &[BOOL, KNOWN]),
            instruction(43, &[UINT, ONE, 1]),
            instruction(43, &[UINT, TWO, 2]),
            instruction(54, &[VOID, MAIN, 0, VOID_FUNCTION]),
        ];
        let mut words = vec![0; HEADER_WORDS];
        words[0] = 0x0723_0203;
        words[1] = 0x0001_0500;
        words[BOUND] = 100;
        [vec![words], head.to_vec(), blocks.to_vec(), vec![instruction(56, &[])]].concat().concat()
    }

    const BOOL: u32 = 1;
    const UINT: u32 = 2;
    const VOID: u32 = 3;
    const VOID_FUNCTION: u32 = 4;
    const KNOWN: u32 = 5;
    const ONE: u32 = 6;
    const TWO: u32 = 7;
    const MAIN: u32 = 8;

    fn block(label: u32, rest: &[(u32, &[u32])]) -> Vec<u32> {
        let mut words = Vec::new();
        push(&mut words, 248, [label]);
        rest.iter().for_each(|(opcode, operands)| push(&mut words, *opcode, operands.iter().copied()));
        words
    }

    fn opcodes(words: &[u32]) -> Vec<Op> {
        let module = load_words(words).expect("SPIR-V");
        assert_whole(&module, "a small module");
        let blocks = module.functions[0].blocks.iter();
        blocks.flat_map(|block| block.instructions.iter().map(|i| i.class.opcode)).collect()
    }

    /// What the value of an `if`'s two ends is stands behind it: an atomic that adds it.
    fn an_if() -> Vec<u32> {
        module(&[
            block(10, &[(247, &[13, 0]), (250, &[KNOWN, 11, 12])]),
            block(11, &[(224, &[ONE, ONE, ONE]), (249, &[13])]),
            block(12, &[(225, &[ONE, TWO]), (249, &[13])]),
            block(13, &[(245, &[UINT, 20, ONE, 11, TWO, 12]), (224, &[20, 20, 20]), (253, &[])]),
        ])
    }

    #[test]
    fn of_an_if_that_is_known_one_side_stays() {
        let both = opcodes(&an_if());
        assert_eq!(both.iter().filter(|&&op| op == Op::SelectionMerge).count(), 1);
        for (value, stays) in [(1, true), (0, false)] {
            let got = opcodes(&specialised(&an_if(), &HashMap::from([(0, value)])));
            let of_first = [Op::Branch, Op::ControlBarrier, Op::Branch, Op::Phi, Op::ControlBarrier, Op::Return];
            let of_second = [Op::Branch, Op::MemoryBarrier, Op::Branch, Op::Phi, Op::ControlBarrier, Op::Return];
            assert_eq!(got, if stays { of_first } else { of_second });
        }
    }

    #[test]
    fn a_loop_that_ends_at_once_keeps_a_way_back_that_nothing_takes() {
        let words = module(&[
            block(10, &[(249, &[11])]),
            block(11, &[(245, &[UINT, 20, ONE, 10, 21, 13]), (246, &[14, 13, 0]), (249, &[12])]),
            block(12, &[(250, &[KNOWN, 13, 14])]),
            block(13, &[(128, &[UINT, 21, 20, ONE]), (224, &[21, 21, 21]), (249, &[11])]),
            block(14, &[(224, &[20, 20, 20]), (253, &[])]),
        ]);
        // Where it does not end, what is behind it is not reached.
        let endless = opcodes(&specialised(&words, &HashMap::from([(0, 1)])));
        assert_eq!(endless.iter().filter(|&&op| op == Op::ControlBarrier).count(), 1);
        assert_eq!(endless.last(), Some(&Op::Unreachable));
        let ended = opcodes(&specialised(&words, &HashMap::from([(0, 0)])));
        let expected =
            [Op::Branch, Op::Phi, Op::LoopMerge, Op::Branch, Op::Branch, Op::Branch, Op::ControlBarrier, Op::Return];
        assert_eq!(ended, expected);
    }

    #[test]
    fn a_switch_that_is_known_stays_around_its_one_case() {
        let words = module(&[
            block(10, &[(247, &[13, 0]), (251, &[TWO, 13, 1, 11, 2, 12])]),
            block(11, &[(224, &[ONE, ONE, ONE]), (249, &[13])]),
            block(12, &[(225, &[ONE, TWO]), (249, &[13])]),
            block(13, &[(253, &[])]),
        ]);
        let got = opcodes(&specialised(&words, &HashMap::new()));
        assert_eq!(got, [Op::SelectionMerge, Op::Switch, Op::MemoryBarrier, Op::Branch, Op::Return]);
    }

    #[test]
    fn values_that_follow_from_constants_are_known_and_what_nothing_uses_goes() {
        // A condition that follows from two sides that agree, through a phi, an addition and a comparison.
        let words = module(&[
            block(10, &[(247, &[13, 0]), (250, &[KNOWN, 11, 12])]),
            block(11, &[(249, &[13])]),
            block(12, &[(249, &[13])]),
            block(
                13,
                &[
                    (245, &[UINT, 20, ONE, 11, TWO, 12]),
                    (128, &[UINT, 21, 20, ONE]),
                    (170, &[BOOL, 22, 21, TWO]),
                    (247, &[15, 0]),
                    (250, &[22, 14, 15]),
                ],
            ),
            block(14, &[(224, &[ONE, ONE, ONE]), (249, &[15])]),
            block(15, &[(253, &[])]),
        ]);
        let is_there = |value| opcodes(&specialised(&words, &HashMap::from([(0, value)])));
        assert_eq!(is_there(1), [Op::Branch, Op::Branch, Op::Branch, Op::ControlBarrier, Op::Branch, Op::Return]);
        assert_eq!(is_there(0), [Op::Branch, Op::Branch, Op::Branch, Op::Return]);
    }
}
