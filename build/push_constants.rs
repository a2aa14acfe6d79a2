//! What a pass takes. Passes of one family share a block of push constants in GLSL, which names all that any of them may read.
//! Each shader is left with the members that it does read, side by side, in the order of the block: a pass takes no more than it
//! says, and a block may have more than the 128 bytes that Vulkan promises.

use crate::reflection::{bytes_of, declared, members, push_constants};
use rspirv::binary::Assemble;
use rspirv::dr::{Instruction, Module, Operand, load_bytes};
use rspirv::spirv::{Decoration, Op};
use std::collections::{BTreeMap, BTreeSet};

/// Bytes of push constants that every device has.
const MOST_BYTES: u32 = 128;

/// A member of the block, or of a struct in it: one index, or two.
type Path = Vec<u32>;

/// What a shader reads: a member of the new block.
struct Member {
    ty: u32,
    /// Where it lies in the declared block.
    declared_at: u32,
    /// Where it lies in the new one.
    at: u32,
    bytes: u32,
}

/// The same shader with a block of what it reads, and where these members lie in the declared block: offsets and bytes.
pub fn only_what_is_read(name: &str, spirv: &[u8]) -> (Vec<u8>, Vec<(u32, u32)>) {
    let mut module = load_bytes(spirv).expect("SPIR-V of shaderc");
    let Some((variable, block)) = push_constants(&module) else { return (spirv.to_vec(), Vec::new()) };
    let Some(read) = read_members(&module, variable, block) else {
        let bytes = bytes_of(&module, block);
        return (spirv.to_vec(), vec![(0, bytes)]);
    };
    let mut at = 0;
    let mut kept: BTreeMap<Path, Member> = BTreeMap::new();
    for path in read {
        let (ty, declared_at) = member_of(&module, block, &path);
        let bytes = bytes_of(&module, ty);
        let is_address = declared(&module, ty).class.opcode == Op::TypePointer;
        assert!(!is_address || at % 8 == 0, "{name}: a pointer behind an odd word; put pointers first in the block");
        kept.insert(path, Member { ty, declared_at, at, bytes });
        at += bytes;
    }
    assert!(at <= MOST_BYTES, "{name} reads {at} bytes of push constants: at most {MOST_BYTES} are there");
    let ranges = joined(kept.values().map(|member| (member.declared_at, member.bytes)));
    redeclare(&mut module, block, &kept);
    rename_uses(&mut module, variable, &kept);
    (module.assemble().into_iter().flat_map(u32::to_le_bytes).collect(), ranges)
}

fn is_chain(instruction: &Instruction, variable: u32) -> bool {
    matches!(instruction.class.opcode, Op::AccessChain | Op::InBoundsAccessChain)
        && instruction.operands[0] == Operand::IdRef(variable)
}

/// The number that an index is, where it is a constant.
fn index_of(module: &Module, index: &Operand) -> Option<u32> {
    let index = declared_anywhere(module, index.unwrap_id_ref())?;
    (index.class.opcode == Op::Constant).then(|| index.operands[0].unwrap_literal_bit32())
}

fn declared_anywhere(module: &Module, id: u32) -> Option<&Instruction> {
    module.types_global_values.iter().find(|i| i.result_id == Some(id))
}

/// The type of a member, and its offset in the declared block.
fn member_of(module: &Module, block: u32, path: &[u32]) -> (u32, u32) {
    path.iter().fold((block, 0), |(ty, offset), &member| {
        let (ty, in_struct) = members(module, ty)[member as usize];
        (ty, offset + in_struct)
    })
}

/// The members that a module reads, and of structs among them those that it reads, unless it loads the struct as a whole; `None`
/// where it loads the block as a whole, or reads nothing.
fn read_members(module: &Module, variable: u32, block: u32) -> Option<BTreeSet<Path>> {
    let mut read = BTreeSet::new();
    let in_functions = module.functions.iter().flat_map(|f| &f.blocks).flat_map(|block| &block.instructions);
    for instruction in in_functions.filter(|i| i.operands.contains(&Operand::IdRef(variable))) {
        if !is_chain(instruction, variable) {
            return None;
        }
        let member = index_of(module, &instruction.operands[1])?;
        let (ty, _) = member_of(module, block, &[member]);
        let is_struct = declared(module, ty).class.opcode == Op::TypeStruct;
        let inner = instruction.operands.get(2).filter(|_| is_struct).and_then(|index| index_of(module, index));
        read.insert([member].into_iter().chain(inner).collect::<Path>());
    }
    // What is loaded as a whole is not divided.
    let whole: Vec<Path> = read.iter().filter(|path| path.len() == 1).cloned().collect();
    read.retain(|path| path.len() == 1 || !whole.contains(&path[..1].to_vec()));
    (!read.is_empty()).then_some(read)
}

/// Leaves the block with these members.
fn redeclare(module: &mut Module, block: u32, kept: &BTreeMap<Path, Member>) {
    let declaration = module.types_global_values.iter_mut().find(|i| i.result_id == Some(block));
    let members = kept.values().map(|member| Operand::IdRef(member.ty)).collect();
    declaration.expect("blocks are declared").operands = members;
    let of_block = |i: &Instruction| i.class.opcode == Op::MemberDecorate && i.operands[0] == Operand::IdRef(block);
    module.annotations.retain(|i| !of_block(i));
    for (member, place) in kept.values().zip(0..) {
        let operands = vec![
            Operand::IdRef(block),
            Operand::LiteralBit32(place),
            Operand::Decoration(Decoration::Offset),
            Operand::LiteralBit32(member.at),
        ];
        module.annotations.push(Instruction::new(Op::MemberDecorate, None, None, operands));
    }
}

/// Has every use of a member name its place in the new block.
fn rename_uses(module: &mut Module, variable: u32, kept: &BTreeMap<Path, Member>) {
    let mut chains: Vec<Instruction> = module.all_inst_iter().filter(|i| is_chain(i, variable)).cloned().collect();
    for chain in &mut chains {
        let indices = || chain.operands[1..].iter().map_while(|index| index_of(module, index));
        let is_kept = |length: &usize| kept.contains_key(&indices().take(*length).collect::<Path>());
        let length = (1..=2).find(is_kept).expect("what is read is kept");
        let path: Path = indices().take(length).collect();
        let place = kept.keys().position(|known| *known == path).expect("just found") as u32;
        let ty = declared(module, chain.operands[1].unwrap_id_ref()).result_type.expect("constants have a type");
        let index = Operand::IdRef(constant(module, ty, place));
        chain.operands.splice(1..1 + length, [index]);
    }
    for chain in module.all_inst_iter_mut().filter(|i| is_chain(i, variable)) {
        let new = chains.iter().find(|new| new.result_id == chain.result_id).expect("made from it");
        *chain = new.clone();
    }
}

/// A constant of a type.
fn constant(module: &mut Module, ty: u32, value: u32) -> u32 {
    let operands = vec![Operand::LiteralBit32(value)];
    let is_it =
        |i: &&Instruction| i.class.opcode == Op::Constant && i.result_type == Some(ty) && i.operands == operands;
    if let Some(known) = module.types_global_values.iter().find(is_it) {
        return known.result_id.expect("constants have an id");
    }
    let header = module.header.as_mut().expect("shaderc writes one");
    let id = header.bound;
    header.bound += 1;
    module.types_global_values.push(Instruction::new(Op::Constant, Some(ty), Some(id), operands));
    id
}

/// Ranges that touch are one.
fn joined(ranges: impl Iterator<Item = (u32, u32)>) -> Vec<(u32, u32)> {
    let mut joined: Vec<(u32, u32)> = Vec::new();
    for (offset, bytes) in ranges {
        match joined.last_mut() {
            Some((before, length)) if *before + *length == offset => *length += bytes,
            _ => joined.push((offset, bytes)),
        }
    }
    joined
}
