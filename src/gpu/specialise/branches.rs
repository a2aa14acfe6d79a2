//! Blocks that no branch reaches, once conditions are known, left out of a module's functions.
//!
//! What is left is structured control flow still (SPIR-V specification, 2.11). An `if` whose condition is known goes, with what it names as
//! its merge block; a `switch` stays around its one case, for a `break` deep in that must lead out of something. Loops stay: one that
//! is never gone round keeps a block that would go back.

use super::constants::Constants;
use crate::gpu::spirv::{BOUND, HEADER_WORDS, Instructions, op, opcode, push};
use std::collections::{HashMap, HashSet};

/// The module without what no branch reaches; with its constants folded. As it is where that would take a loop's way back.
pub(super) fn without_unreached(spirv: &[u32], constants: &mut Constants<'_>) -> Vec<u32> {
    let mut undefined = Undefined { next: spirv[BOUND], of_type: Vec::new() };
    let (mut globals, mut functions) = (Vec::new(), Vec::new());
    let mut instructions = Instructions(&spirv[HEADER_WORDS..]);
    while let Some(instruction) = instructions.next() {
        if opcode(instruction) != op::FUNCTION {
            globals.extend_from_slice(instruction);
            continue;
        }
        functions.extend_from_slice(instruction);
        let body = instructions.by_ref().take_while(|instruction| opcode(instruction) != op::FUNCTION_END);
        let body: Vec<&[u32]> = body.collect();
        let blocks_from = body.iter().position(|i| opcode(i) == op::LABEL).unwrap_or(body.len());
        body[..blocks_from].iter().for_each(|parameter| functions.extend_from_slice(parameter));
        let function = Function::of(&body[blocks_from..]);
        let Some(reached) = function.reached(constants) else { return spirv.to_vec() };
        function.write(&reached, &mut undefined, &mut functions);
        push(&mut functions, op::FUNCTION_END, []);
    }
    let mut words = spirv[..HEADER_WORDS].to_vec();
    words[BOUND] = undefined.next;
    words.extend(globals);
    for (ty, id) in undefined.of_type {
        push(&mut words, op::UNDEF, [ty, id]);
    }
    words.extend(functions);
    words
}

/// Values that nobody looks at, one for each type that has asked for one.
struct Undefined {
    next: u32,
    of_type: Vec<(u32, u32)>,
}

impl Undefined {
    fn of(&mut self, ty: u32) -> u32 {
        if let Some(&(_, id)) = self.of_type.iter().find(|(of, _)| *of == ty) {
            return id;
        }
        self.of_type.push((ty, self.next));
        self.next += 1;
        self.next - 1
    }
}

struct Block<'a> {
    label: u32,
    body: Vec<&'a [u32]>,
    /// Names the end of an `if`, a `switch` or a loop that begins here.
    merge: Option<&'a [u32]>,
    end: &'a [u32],
}

impl Block<'_> {
    /// Where the block may branch to, whatever is known.
    fn targets(&self) -> Vec<u32> {
        match (opcode(self.end), &self.end[1..]) {
            (op::BRANCH, &[to]) => vec![to],
            (op::BRANCH_CONDITIONAL, &[_, yes, no, ..]) => vec![yes, no],
            (op::SWITCH, &[_, otherwise, ref cases @ ..]) => {
                [otherwise].into_iter().chain(cases.chunks_exact(2).map(|case| case[1])).collect()
            }
            _ => Vec::new(),
        }
    }

    /// The one of its targets that a known condition chooses.
    fn chosen(&self, constants: &Constants<'_>) -> Option<u32> {
        match (opcode(self.end), &self.end[1..]) {
            (op::BRANCH_CONDITIONAL, &[condition, yes, no, ..]) => {
                Some(if constants.value(condition)? != 0 { yes } else { no })
            }
            (op::SWITCH, &[selector, otherwise, ref cases @ ..]) => {
                let value = constants.value(selector)?;
                let case = cases.chunks_exact(2).find(|case| case[0] == value);
                Some(case.map_or(otherwise, |case| case[1]))
            }
            _ => None,
        }
    }

    fn is_loop(&self) -> bool {
        self.merge.is_some_and(|merge| opcode(merge) == op::LOOP_MERGE)
    }
}

/// Of each block of a function, by its place: whether it is reached, and where it then goes.
struct Reached {
    is: Vec<bool>,
    targets: Vec<Vec<u32>>,
}

struct Function<'a> {
    blocks: Vec<Block<'a>>,
    /// The place of a block by its label.
    places: HashMap<u32, usize>,
}

impl<'a> Function<'a> {
    /// That of the instructions from the first label on.
    fn of(instructions: &[&'a [u32]]) -> Function<'a> {
        let mut blocks: Vec<Block<'a>> = Vec::new();
        for &instruction in instructions {
            match (opcode(instruction), blocks.last_mut()) {
                (op::LABEL, _) => {
                    blocks.push(Block { label: instruction[1], body: Vec::new(), merge: None, end: instruction });
                }
                (op::SELECTION_MERGE | op::LOOP_MERGE, Some(block)) => block.merge = Some(instruction),
                (_, Some(block)) => {
                    block.body.push(instruction);
                    block.end = instruction;
                }
                (_, None) => {}
            }
        }
        // The last instruction of each says where it goes.
        for block in &mut blocks {
            block.body.pop();
        }
        let places = blocks.iter().enumerate().map(|(place, block)| (block.label, place)).collect();
        Function { blocks, places }
    }

    /// What is reached, as far as constants tell; none where a loop would lose its way back. What is found to be constant on the way
    /// may tell more, so this goes on until nothing is new.
    fn reached(&self, constants: &mut Constants<'_>) -> Option<Reached> {
        loop {
            let reached = self.reached_by(constants);
            let mut is_new = false;
            for (block, _) in self.blocks.iter().zip(&reached.is).filter(|&(_, &is)| is) {
                for instruction in &block.body {
                    is_new |= match opcode(instruction) {
                        op::PHI => self.evaluate_phi(instruction, block.label, &reached, constants),
                        _ => constants.evaluate(instruction),
                    };
                }
            }
            if !is_new {
                return self.loops_go_back(&reached).then_some(reached);
            }
        }
    }

    fn reached_by(&self, constants: &Constants<'_>) -> Reached {
        let mut reached = Reached { is: vec![false; self.blocks.len()], targets: vec![Vec::new(); self.blocks.len()] };
        let mut places = vec![0];
        while let Some(place) = places.pop() {
            if std::mem::replace(&mut reached.is[place], true) {
                continue;
            }
            let block = &self.blocks[place];
            let targets = block.targets();
            // A way back stays, whatever its condition is.
            let goes_back = targets.iter().any(|target| self.places[target] <= place);
            let chosen = if goes_back { None } else { block.chosen(constants) };
            reached.targets[place] = chosen.map_or(targets, |target| vec![target]);
            places.extend(reached.targets[place].iter().map(|target| self.places[target]));
        }
        reached
    }

    fn is_taken(&self, from: u32, to: u32, reached: &Reached) -> bool {
        let from = self.places[&from];
        reached.is[from] && reached.targets[from].contains(&to)
    }

    fn evaluate_phi(&self, phi: &[u32], label: u32, reached: &Reached, constants: &mut Constants<'_>) -> bool {
        if constants.value(phi[2]).is_some() {
            return false;
        }
        let taken = phi[3..].chunks_exact(2).filter(|pair| self.is_taken(pair[1], label, reached));
        let mut values = taken.map(|pair| constants.value(pair[0]));
        let Some(Some(first)) = values.next() else { return false };
        let is_constant = values.all(|value| value == Some(first));
        is_constant && constants.learn(phi[1], phi[2], first)
    }

    fn loops_go_back(&self, reached: &Reached) -> bool {
        let loops = self.blocks.iter().enumerate().filter(|&(place, block)| reached.is[place] && block.is_loop());
        loops.into_iter().all(|(place, header)| {
            let goes_on = self.places[&header.merge.expect("a loop")[2]];
            let is_way_back = |from: usize| reached.is[from] && reached.targets[from].contains(&header.label);
            !reached.is[goes_on] || (place..self.blocks.len()).any(is_way_back)
        })
    }

    fn write(&self, reached: &Reached, undefined: &mut Undefined, words: &mut Vec<u32>) {
        // Blocks that are named as an end or as a way back are there, reached or not.
        let (mut ends, mut ways_back) = (HashSet::new(), HashMap::new());
        for (block, _) in self.blocks.iter().zip(&reached.is).filter(|&(_, &is)| is) {
            match block.merge {
                Some(&[_, end, goes_on, ..]) if block.is_loop() => {
                    ends.insert(end);
                    ways_back.insert(goes_on, block.label);
                }
                Some(&[_, end, ..]) => {
                    ends.insert(end);
                }
                _ => {}
            }
        }
        for (place, block) in self.blocks.iter().enumerate() {
            if reached.is[place] {
                self.write_block(place, reached, undefined, words);
            } else if let Some(&header) = ways_back.get(&block.label) {
                push(words, op::LABEL, [block.label]);
                push(words, op::BRANCH, [header]);
            } else if ends.contains(&block.label) {
                push(words, op::LABEL, [block.label]);
                push(words, op::UNREACHABLE, []);
            }
        }
    }

    fn write_block(&self, place: usize, reached: &Reached, undefined: &mut Undefined, words: &mut Vec<u32>) {
        let block = &self.blocks[place];
        // Where a loop goes on in a block that is not reached, that comes back with values that nobody sees.
        let goes_on = block.merge.filter(|_| block.is_loop()).map(|merge| merge[2]);
        let comes_back = goes_on.filter(|goes_on| !reached.is[self.places[goes_on]]);
        push(words, op::LABEL, [block.label]);
        for instruction in &block.body {
            if opcode(instruction) != op::PHI {
                words.extend_from_slice(instruction);
                continue;
            }
            let taken = instruction[3..].chunks_exact(2);
            let taken = taken.filter(|pair| self.is_taken(pair[1], block.label, reached)).flatten().copied();
            let back = comes_back.map(|from| [undefined.of(instruction[1]), from]);
            push(words, op::PHI, instruction[1..3].iter().copied().chain(taken).chain(back.into_iter().flatten()));
        }
        let is_chosen = block.targets().len() != reached.targets[place].len();
        let is_switch = opcode(block.end) == op::SWITCH;
        if let Some(merge) = block.merge.filter(|_| !is_chosen || is_switch || block.is_loop()) {
            words.extend_from_slice(merge);
        }
        match reached.targets[place][..] {
            [to] if is_chosen && is_switch => push(words, op::SWITCH, [block.end[1], to]),
            [to] if is_chosen => push(words, op::BRANCH, [to]),
            _ => words.extend_from_slice(block.end),
        }
    }
}
