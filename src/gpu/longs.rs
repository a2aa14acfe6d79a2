//! Structs in buffers, loaded and stored in elements of 64 bits.
//!
//! Where each lane of a CPU's driver loads and stores for itself, by a branch and a move, an element of 64 bits takes as long as one of 32,
//! and half as many are enough. Sources know nothing of it, for a device need not have such integers: a module is rewritten when
//! its pipeline is made.
//!
//! What is rewritten are loads and stores of whole structs, vectors and arrays in buffers that are words without gaps, at addresses that are
//! multiples of 8: nodes, records, clusters. Two words go at once; nothing else changes.

use super::spirv::{BOUND, HEADER_WORDS, Instructions, op, opcode, push};
use std::collections::{BTreeMap, HashMap};

const CAPABILITY_INT64: u32 = 11;
/// The storage class of buffers: they are known by their addresses.
const PHYSICAL_STORAGE_BUFFER: u32 = 5349;
const BLOCK: u32 = 2;
const OFFSET: u32 = 35;
const ARRAY_STRIDE: u32 = 6;
/// Of memory operands: the alignment follows; others see the access.
const ALIGNED: u32 = 2;
const NON_PRIVATE_POINTER: u32 = 32;
const WORD_BYTES: u32 = 4;
const LONG_BYTES: u32 = 8;

/// The module with elements of 64 bits where that can be. `spirv` is a valid module without specialisation constants, and the device has
/// 64-bit integers.
pub(super) fn in_longs(spirv: &[u32]) -> Vec<u32> {
    let declared = Declarations::of(spirv);
    let accesses = Instructions(&spirv[HEADER_WORDS..]).filter_map(|instruction| declared.access(instruction));
    let Some(most_words) = accesses.map(|access| access.words).max() else { return spirv.to_vec() };
    let mut module = Rewriter::new(spirv, &declared, most_words);
    Instructions(&spirv[HEADER_WORDS..]).for_each(|instruction| module.rewrite(instruction));
    module.words[BOUND] = module.added.bound;
    module.words
}

enum Type {
    Scalar { bits: u32, is_uint: bool },
    Vector { of: u32, count: u32 },
    Array { of: u32, count: u32 },
    Struct(Vec<u32>),
    Pointer { class: u32, to: u32 },
}

/// What a module declares, as far as accesses need it.
#[derive(Default)]
struct Declarations {
    types: BTreeMap<u32, Type>,
    /// Of the members of structs.
    offsets: HashMap<(u32, u32), u32>,
    strides: HashMap<u32, u32>,
    constants: HashMap<u32, u32>,
    /// The types of pointers, by the pointers.
    pointers: HashMap<u32, u32>,
    has_int64: bool,
}

/// A load or a store that is rewritten.
struct Access {
    of: u32,
    words: u32,
    operands: u32,
}

impl Declarations {
    fn of(spirv: &[u32]) -> Declarations {
        let mut declared = Declarations::default();
        Instructions(&spirv[HEADER_WORDS..]).for_each(|instruction| declared.learn(instruction));
        declared
    }

    fn learn(&mut self, instruction: &[u32]) {
        let mut ty = |id, ty| drop(self.types.insert(id, ty));
        match (opcode(instruction), &instruction[1..]) {
            (op::CAPABILITY, &[capability]) => self.has_int64 |= capability == CAPABILITY_INT64,
            (op::TYPE_INT, &[id, bits, sign]) => ty(id, Type::Scalar { bits, is_uint: sign == 0 }),
            (op::TYPE_FLOAT, &[id, bits]) => ty(id, Type::Scalar { bits, is_uint: false }),
            (op::TYPE_VECTOR, &[id, of, count]) => ty(id, Type::Vector { of, count }),
            (op::TYPE_ARRAY, &[id, of, length]) => {
                if let Some(&count) = self.constants.get(&length) {
                    ty(id, Type::Array { of, count });
                }
            }
            (op::TYPE_STRUCT, &[id, ref members @ ..]) => ty(id, Type::Struct(members.to_vec())),
            (op::TYPE_POINTER, &[id, class, to]) => ty(id, Type::Pointer { class, to }),
            (op::CONSTANT, &[_, id, value]) => drop(self.constants.insert(id, value)),
            (op::MEMBER_DECORATE, &[id, member, OFFSET, at]) => drop(self.offsets.insert((id, member), at)),
            (op::DECORATE, &[id, ARRAY_STRIDE, stride]) => drop(self.strides.insert(id, stride)),
            (op::ACCESS_CHAIN | op::IN_BOUNDS_ACCESS_CHAIN | op::BITCAST, &[ty, id, ..]) => {
                self.pointers.insert(id, ty);
            }
            _ => {}
        }
    }

    /// The words of a type in memory, if it has nothing else there and no gaps.
    fn words(&self, ty: u32) -> Option<u32> {
        match *self.types.get(&ty)? {
            Type::Scalar { bits, .. } => (bits == 32).then_some(1),
            Type::Vector { of, count } => Some(self.words(of)? * count),
            Type::Array { of, count } => {
                let each = self.words(of)?;
                (self.strides.get(&ty) == Some(&(each * WORD_BYTES))).then_some(each * count)
            }
            Type::Struct(ref members) => (0..).zip(members).try_fold(0, |before, (member, &of)| {
                let is_next = self.offsets.get(&(ty, member)) == Some(&(before * WORD_BYTES));
                is_next.then_some(before + self.words(of)?)
            }),
            Type::Pointer { .. } => None,
        }
    }

    /// What an instruction accesses, if that is rewritten.
    fn access(&self, instruction: &[u32]) -> Option<Access> {
        let (pointer, operands, alignment) = match (opcode(instruction), &instruction[1..]) {
            (op::LOAD, &[_, _, pointer, operands, alignment]) => (pointer, operands, alignment),
            (op::STORE, &[pointer, _, operands, alignment]) => (pointer, operands, alignment),
            _ => return None,
        };
        let is_plain = operands & ALIGNED != 0 && operands & !(ALIGNED | NON_PRIVATE_POINTER) == 0;
        let Some(&Type::Pointer { class: PHYSICAL_STORAGE_BUFFER, to: of }) =
            self.types.get(self.pointers.get(&pointer)?)
        else {
            return None;
        };
        let words = self.words(of)?;
        (is_plain && alignment % LONG_BYTES == 0 && words > 1).then_some(Access { of, words, operands })
    }

    /// The types of a composite's members; of a scalar none.
    fn members(&self, ty: u32) -> Vec<u32> {
        match self.types.get(&ty) {
            Some(&Type::Vector { of, count } | &Type::Array { of, count }) => vec![of; count as usize],
            Some(Type::Struct(members)) => members.clone(),
            _ => Vec::new(),
        }
    }

    fn find(&self, is_it: impl Fn(&Type) -> bool) -> Option<u32> {
        self.types.iter().find(|(_, ty)| is_it(ty)).map(|(&id, _)| id)
    }
}

/// What a module gets in addition.
struct Additions {
    bound: u32,
    decorations: Vec<u32>,
    /// Types and constants.
    declarations: Vec<u32>,
}

impl Additions {
    fn id(&mut self) -> u32 {
        self.bound += 1;
        self.bound - 1
    }

    fn declare(&mut self, opcode: u32, operands: &[u32]) -> u32 {
        let id = self.id();
        push(&mut self.declarations, opcode, [id].into_iter().chain(operands.iter().copied()));
        id
    }

    fn constant(&mut self, ty: u32, value: u32) -> u32 {
        let id = self.id();
        push(&mut self.declarations, op::CONSTANT, [ty, id, value]);
        id
    }

    /// Pointers to an element of a buffer, and to the buffer.
    fn buffer_of(&mut self, element: u32, bytes: u32) -> (u32, u32) {
        let array = self.declare(op::TYPE_RUNTIME_ARRAY, &[element]);
        let buffer = self.declare(op::TYPE_STRUCT, &[array]);
        push(&mut self.decorations, op::DECORATE, [array, ARRAY_STRIDE, bytes]);
        push(&mut self.decorations, op::DECORATE, [buffer, BLOCK]);
        push(&mut self.decorations, op::MEMBER_DECORATE, [buffer, 0, OFFSET, 0]);
        let mut pointer = |to| self.declare(op::TYPE_POINTER, &[PHYSICAL_STORAGE_BUFFER, to]);
        (pointer(element), pointer(buffer))
    }
}

/// What is written so far, and the types and constants that it needs.
struct Rewriter<'a> {
    declared: &'a Declarations,
    added: Additions,
    words: Vec<u32>,
    uint: u32,
    /// Two words, and 64 bits.
    pair: u32,
    long: u32,
    /// Pointers to an element, and to a buffer of them.
    to_uint: u32,
    to_long: u32,
    to_uints: u32,
    to_longs: u32,
    /// 0, 1, …
    indices: Vec<u32>,
}

impl<'a> Rewriter<'a> {
    fn new(spirv: &[u32], declared: &'a Declarations, most_words: u32) -> Rewriter<'a> {
        let mut words = spirv[..HEADER_WORDS].to_vec();
        if !declared.has_int64 {
            push(&mut words, op::CAPABILITY, [CAPABILITY_INT64]);
        }
        let mut added = Additions { bound: spirv[BOUND], decorations: Vec::new(), declarations: Vec::new() };
        // Scalars and vectors may not be declared twice.
        let mut unsigned = |width| {
            let is_it = |ty: &Type| matches!(ty, Type::Scalar { bits, is_uint: true } if *bits == width);
            declared.find(is_it).unwrap_or_else(|| added.declare(op::TYPE_INT, &[width, 0]))
        };
        let (uint, long) = (unsigned(32), unsigned(64));
        let is_pair = |ty: &Type| matches!(ty, Type::Vector { of, count: 2 } if *of == uint);
        let pair = declared.find(is_pair).unwrap_or_else(|| added.declare(op::TYPE_VECTOR, &[uint, 2]));
        let (to_uint, to_uints) = added.buffer_of(uint, WORD_BYTES);
        let (to_long, to_longs) = added.buffer_of(long, LONG_BYTES);
        let indices = (0..most_words).map(|index| added.constant(uint, index)).collect();
        Rewriter { declared, added, words, uint, pair, long, to_uint, to_long, to_uints, to_longs, indices }
    }

    fn rewrite(&mut self, instruction: &[u32]) {
        // A module has decorations before its types, and those and constants before its functions.
        match opcode(instruction) {
            op::TYPE_VOID..=op::TYPE_FORWARD_POINTER => self.words.append(&mut self.added.decorations),
            op::FUNCTION => self.words.append(&mut self.added.declarations),
            _ => {}
        }
        match (self.declared.access(instruction), &instruction[1..]) {
            (Some(access), &[ty, result, pointer, ..]) if opcode(instruction) == op::LOAD => {
                self.load(&access, ty, result, pointer);
            }
            (Some(access), &[pointer, value, ..]) => self.store(&access, pointer, value),
            _ => self.words.extend_from_slice(instruction),
        }
    }

    /// Writes an instruction that gives a value of a type.
    fn give(&mut self, opcode: u32, ty: u32, operands: &[u32]) -> u32 {
        let id = self.added.id();
        push(&mut self.words, opcode, [ty, id].into_iter().chain(operands.iter().copied()));
        id
    }

    /// Where each element of an access lies, whose first word is the one named; the last is one word, where they are odd.
    fn elements(&mut self, access: &Access, pointer: u32) -> Vec<(u32, u32)> {
        let longs = self.give(op::BITCAST, self.to_longs, &[pointer]);
        let mut all: Vec<(u32, u32)> = Vec::new();
        for word in (0..access.words).step_by(2) {
            let (buffer, to, index) = if word + 1 < access.words {
                (longs, self.to_long, word / 2)
            } else {
                (self.give(op::BITCAST, self.to_uints, &[pointer]), self.to_uint, word)
            };
            let operands = [buffer, self.indices[0], self.indices[index as usize]];
            all.push((word, self.give(op::ACCESS_CHAIN, to, &operands)));
        }
        all
    }

    fn load(&mut self, access: &Access, ty: u32, result: u32, pointer: u32) {
        let mut words = Vec::new();
        for (word, at) in self.elements(access, pointer) {
            if word + 1 == access.words {
                words.push(self.give(op::LOAD, self.uint, &[at, access.operands, LONG_BYTES]));
                continue;
            }
            let long = self.give(op::LOAD, self.long, &[at, access.operands, LONG_BYTES]);
            let pair = self.give(op::BITCAST, self.pair, &[long]);
            words.extend([0, 1].map(|half| self.give(op::COMPOSITE_EXTRACT, self.uint, &[pair, half])));
        }
        let parts = self.parts(ty, &mut words.into_iter());
        push(&mut self.words, op::COMPOSITE_CONSTRUCT, [ty, result].into_iter().chain(parts));
    }

    /// The members of a value that consists of these words.
    fn parts(&mut self, ty: u32, words: &mut impl Iterator<Item = u32>) -> Vec<u32> {
        self.declared.members(ty).into_iter().map(|of| self.value(of, words)).collect()
    }

    fn value(&mut self, ty: u32, words: &mut impl Iterator<Item = u32>) -> u32 {
        if self.declared.members(ty).is_empty() {
            let word = words.next().expect("as many words as the type has");
            return if ty == self.uint { word } else { self.give(op::BITCAST, ty, &[word]) };
        }
        let parts = self.parts(ty, words);
        self.give(op::COMPOSITE_CONSTRUCT, ty, &parts)
    }

    fn store(&mut self, access: &Access, pointer: u32, value: u32) {
        let mut words = Vec::new();
        self.take_apart(access.of, value, &mut Vec::new(), &mut words);
        for (word, at) in self.elements(access, pointer) {
            let first = words[word as usize];
            let element = match words.get(word as usize + 1) {
                Some(&second) => {
                    let pair = self.give(op::COMPOSITE_CONSTRUCT, self.pair, &[first, second]);
                    self.give(op::BITCAST, self.long, &[pair])
                }
                None => first,
            };
            push(&mut self.words, op::STORE, [at, element, access.operands, LONG_BYTES]);
        }
    }

    /// The words of a value's part at `path`.
    fn take_apart(&mut self, ty: u32, value: u32, path: &mut Vec<u32>, words: &mut Vec<u32>) {
        let members = self.declared.members(ty);
        if members.is_empty() {
            let operands: Vec<u32> = [value].into_iter().chain(path.iter().copied()).collect();
            let word = self.give(op::COMPOSITE_EXTRACT, ty, &operands);
            words.push(if ty == self.uint { word } else { self.give(op::BITCAST, self.uint, &[word]) });
        }
        for (member, of) in (0..).zip(members) {
            path.push(member);
            self.take_apart(of, value, path, words);
            path.pop();
        }
    }
}

#[cfg(all(test, feature = "compile-shaders"))]
mod tests {
    use super::*;
    use crate::gpu::shaders;
    use crate::gpu::specialise::specialised;
    use crate::gpu::specialise::tests::{assert_whole, choices, words_of};
    use rspirv::dr::{Instruction, Module, Operand, load_words};
    use rspirv::spirv::{Op, StorageClass};
    use std::collections::BTreeSet;

    fn of_type(module: &Module, id: u32) -> &Instruction {
        let is_it = |i: &&Instruction| i.result_id == Some(id);
        module.types_global_values.iter().find(is_it).expect("a type")
    }

    /// Bytes of a value in memory; of a runtime array none.
    fn bytes(module: &Module, ty: u32) -> u32 {
        let ty = of_type(module, ty);
        let id = |at: usize| ty.operands[at].unwrap_id_ref();
        match ty.class.opcode {
            Op::TypeInt | Op::TypeFloat => ty.operands[0].unwrap_literal_bit32() / 8,
            Op::TypeVector => bytes(module, id(0)) * ty.operands[1].unwrap_literal_bit32(),
            Op::TypeArray => bytes(module, id(0)) * of_type(module, id(1)).operands[0].unwrap_literal_bit32(),
            Op::TypeStruct => ty.operands.iter().map(|of| bytes(module, of.unwrap_id_ref())).sum(),
            _ => 0,
        }
    }

    /// Bytes of all loads and all stores of buffers, and how many have more than 64 bits at an address that is a multiple of 8.
    fn accesses(module: &Module) -> ([u32; 2], usize) {
        let results = module.all_inst_iter().filter_map(|i| Some((i.result_id?, i.result_type?)));
        let types: HashMap<u32, u32> = results.collect();
        let mut all = ([0, 0], 0);
        for access in module.all_inst_iter().filter(|i| matches!(i.class.opcode, Op::Load | Op::Store)) {
            let pointer = of_type(module, types[&access.operands[0].unwrap_id_ref()]);
            if pointer.operands[0] != Operand::StorageClass(StorageClass::PhysicalStorageBuffer) {
                continue;
            }
            let bytes = bytes(module, pointer.operands[1].unwrap_id_ref());
            all.0[usize::from(access.class.opcode == Op::Store)] += bytes;
            let aligned = |operand: &Operand| matches!(operand, Operand::LiteralBit32(to) if to % LONG_BYTES == 0);
            all.1 += usize::from(bytes > LONG_BYTES && access.operands.iter().any(aligned));
        }
        all
    }

    #[test]
    fn every_shader_is_whole_in_longs_and_accesses_as_many_bytes() {
        let mut rewritten = 0;
        for shader in shaders::ALL {
            for constants in choices() {
                let what = format!("{}, {constants:?}", shader.name);
                let before = specialised(&words_of(shader.spirv), &constants);
                let after = in_longs(&before);
                let (old, new) = (load_words(&before).expect("SPIR-V"), load_words(&after).expect("SPIR-V"));
                assert_whole(&new, &what);
                let ((bytes, _), (of_new, large)) = (accesses(&old), accesses(&new));
                assert_eq!((of_new, large), (bytes, 0), "{what}");
                assert_eq!(in_longs(&after), after, "{what}: nothing is left to do");
                rewritten += usize::from(after != before);
                // Types but structs, arrays and pointers are declared once.
                let mut once = BTreeSet::new();
                for ty in &new.types_global_values {
                    if matches!(ty.class.opcode, Op::TypeInt | Op::TypeFloat | Op::TypeVector) {
                        assert!(once.insert(format!("{:?}", (ty.class.opcode, &ty.operands))), "{what}: {ty:?}");
                    }
                }
            }
        }
        assert!(rewritten > 100, "{rewritten}");
    }

    /// A module that loads a struct of a vector of three, a word and another, by a pointer of a class with an alignment.
    fn load(class: u32, alignment: u32) -> Module {
        let ids: [u32; 12] = std::array::from_fn(|i| i as u32 + 1);
        let [void, function, uint, float, vector, node, buffer, to_buffer, to_node, zero, at, main] = ids;
        let mut words = vec![0x0723_0203, 0x0001_0500, 0, 32, 0];
        let instructions: &[(u32, &[u32])] = &[
            (op::CAPABILITY, &[1]),
            (op::MEMBER_DECORATE, &[node, 0, OFFSET, 0]),
            (op::MEMBER_DECORATE, &[node, 1, OFFSET, 12]),
            (op::MEMBER_DECORATE, &[node, 2, OFFSET, 16]),
            (op::MEMBER_DECORATE, &[buffer, 0, OFFSET, 0]),
            (op::TYPE_VOID, &[void]),
            (33, &[function, void]),
            (op::TYPE_INT, &[uint, 32, 0]),
            (op::TYPE_FLOAT, &[float, 32]),
            (op::TYPE_VECTOR, &[vector, float, 3]),
            (op::TYPE_STRUCT, &[node, vector, uint, float]),
            (op::TYPE_STRUCT, &[buffer, node]),
            (op::TYPE_POINTER, &[to_buffer, class, buffer]),
            (op::TYPE_POINTER, &[to_node, class, node]),
            (op::CONSTANT, &[uint, zero, 0]),
            (59, &[to_buffer, at, class]),
            (op::FUNCTION, &[void, main, 0, function]),
            (op::LABEL, &[20]),
            (op::ACCESS_CHAIN, &[to_node, 21, at, zero]),
            (op::LOAD, &[node, 22, 21, ALIGNED, alignment]),
            (253, &[]),
            (op::FUNCTION_END, &[]),
        ];
        instructions.iter().for_each(|(opcode, operands)| push(&mut words, *opcode, operands.iter().copied()));
        let module = load_words(in_longs(&words)).expect("SPIR-V");
        assert_whole(&module, "a load");
        module
    }

    #[test]
    fn two_words_go_at_once_where_their_address_is_a_multiple_of_eight() {
        let loads = |class, alignment| -> Vec<u32> {
            let module = load(class, alignment);
            let instructions = module.functions[0].blocks[0].instructions.iter();
            instructions
                .filter(|i| i.class.opcode == Op::Load)
                .map(|i| bytes(&module, i.result_type.expect("of a load")))
                .collect()
        };
        let workgroup = 4;
        assert_eq!(loads(PHYSICAL_STORAGE_BUFFER, 16), [8, 8, 4]);
        assert_eq!(loads(PHYSICAL_STORAGE_BUFFER, 8), [8, 8, 4]);
        assert_eq!(loads(PHYSICAL_STORAGE_BUFFER, 4), [20]);
        assert_eq!(loads(workgroup, 8), [20]);
    }
}
