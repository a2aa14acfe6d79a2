//! Many small jobs in one dispatch: the same shader with its arguments in a table in memory, a row for each workgroup.
//!
//! A shader that one workgroup runs takes what it reads of its block of push constants. Here it takes the address of a table instead, whose
//! rows are that block, and workgroup i reads row i. `src/gpu/table.rs` makes such dispatches.

use crate::reflection::{bytes_of, declared, members, push_constants};
use rspirv::binary::Assemble;
use rspirv::dr::{Instruction, Module, Operand, load_bytes};
use rspirv::spirv::{BuiltIn, Decoration, MemoryAccess, Op, StorageClass};
use std::collections::BTreeMap;

/// Rows begin at multiples of this: `ArgumentTable::ALIGNMENT` in src/gpu/table.rs.
const ALIGNMENT: u32 = 16;

/// The same shader with its arguments in a table.
pub fn by_table(name: &str, spirv: &[u8]) -> Vec<u8> {
    let mut module = load_bytes(spirv).expect("SPIR-V of shaderc");
    let (variable, block) = push_constants(&module).expect("a shader of one workgroup takes arguments");
    for built_in in [BuiltIn::WorkgroupId, BuiltIn::NumWorkgroups, BuiltIn::GlobalInvocationId] {
        let is_it = |i: &Instruction| i.operands.contains(&Operand::BuiltIn(built_in));
        assert!(
            !module.annotations.iter().any(is_it),
            "{name} reads {built_in:?}, where it is the only workgroup; define HEDGEROW_ONE_WORKGROUP"
        );
    }
    let table = declare_table(&mut module, block);
    let group = declare_group(&mut module);
    for function in 0..module.functions.len() {
        read_rows(&mut module, function, &Given { name, variable, table, group });
    }
    module.assemble().into_iter().flat_map(u32::to_le_bytes).collect()
}

/// What functions read rows by.
struct Given<'a> {
    name: &'a str,
    /// The push constants: the table's address.
    variable: u32,
    /// A pointer to the table.
    table: u32,
    /// The number of the workgroup: a vector of three.
    group: u32,
}

fn new_id(module: &mut Module) -> u32 {
    let header = module.header.as_mut().expect("shaderc writes one");
    header.bound += 1;
    header.bound - 1
}

fn decorate(module: &mut Module, operands: Vec<Operand>) {
    let op = if matches!(operands[1], Operand::LiteralBit32(_)) { Op::MemberDecorate } else { Op::Decorate };
    module.annotations.push(Instruction::new(op, None, None, operands));
}

fn offset(module: &mut Module, of: u32, member: u32, at: u32) {
    let [member, at] = [member, at].map(Operand::LiteralBit32);
    decorate(module, vec![Operand::IdRef(of), member, Operand::Decoration(Decoration::Offset), at]);
}

/// Declares what is not declared yet, behind all else; returns its id.
fn declare(module: &mut Module, op: Op, ty: Option<u32>, operands: Vec<Operand>) -> u32 {
    let is_it = |i: &&Instruction| i.class.opcode == op && i.result_type == ty && i.operands == operands;
    if let Some(known) = module.types_global_values.iter().find(is_it) {
        return known.result_id.expect("types and constants have one");
    }
    let id = new_id(module);
    module.types_global_values.push(Instruction::new(op, ty, Some(id), operands));
    id
}

fn pointer(module: &mut Module, class: StorageClass, to: u32) -> u32 {
    declare(module, Op::TypePointer, None, vec![Operand::StorageClass(class), Operand::IdRef(to)])
}

/// Has the block be the address of a table of what it was; returns the type of that.
fn declare_table(module: &mut Module, block: u32) -> u32 {
    let [row, rows, table, address] = std::array::from_fn(|_| new_id(module));
    let stride = bytes_of(module, block).next_multiple_of(ALIGNMENT);
    for ((_, at), member) in members(module, block).into_iter().zip(0..) {
        offset(module, row, member, at);
    }
    let is_of_block = |i: &Instruction| i.class.opcode == Op::MemberDecorate && i.operands[0] == Operand::IdRef(block);
    module.annotations.retain(|i| !is_of_block(i));
    offset(module, table, 0, 0);
    offset(module, block, 0, 0);
    decorate(module, vec![Operand::IdRef(table), Operand::Decoration(Decoration::Block)]);
    let array_stride = [Operand::Decoration(Decoration::ArrayStride), Operand::LiteralBit32(stride)];
    decorate(module, [Operand::IdRef(rows)].into_iter().chain(array_stride).collect());
    // The block is of these: they are declared before it.
    let at = module.types_global_values.iter().position(|i| i.result_id == Some(block)).expect("blocks are declared");
    let members = std::mem::replace(&mut module.types_global_values[at].operands, vec![Operand::IdRef(address)]);
    let class = Operand::StorageClass(StorageClass::PhysicalStorageBuffer);
    let types = [
        Instruction::new(Op::TypeStruct, None, Some(row), members),
        Instruction::new(Op::TypeRuntimeArray, None, Some(rows), vec![Operand::IdRef(row)]),
        Instruction::new(Op::TypeStruct, None, Some(table), vec![Operand::IdRef(rows)]),
        Instruction::new(Op::TypePointer, None, Some(address), vec![class, Operand::IdRef(table)]),
    ];
    module.types_global_values.splice(at..at, types);
    address
}

/// The variable that has the number of the workgroup.
fn declare_group(module: &mut Module) -> u32 {
    let word = declare(module, Op::TypeInt, None, [32, 0].map(Operand::LiteralBit32).to_vec());
    let words = declare(module, Op::TypeVector, None, vec![Operand::IdRef(word), Operand::LiteralBit32(3)]);
    let pointer = pointer(module, StorageClass::Input, words);
    let id = new_id(module);
    let class = vec![Operand::StorageClass(StorageClass::Input)];
    module.types_global_values.push(Instruction::new(Op::Variable, Some(pointer), Some(id), class));
    let built_in = [Operand::Decoration(Decoration::BuiltIn), Operand::BuiltIn(BuiltIn::WorkgroupId)];
    decorate(module, [Operand::IdRef(id)].into_iter().chain(built_in).collect());
    for entry in &mut module.entry_points {
        entry.operands.push(Operand::IdRef(id));
    }
    id
}

/// Has a function read its arguments from the row of its workgroup.
fn read_rows(module: &mut Module, function: usize, given: &Given<'_>) {
    let is_use = |i: &Instruction| i.operands.contains(&Operand::IdRef(given.variable));
    let blocks = &module.functions[function].blocks;
    let uses: Vec<Instruction> = blocks.iter().flat_map(|b| &b.instructions).filter(|i| is_use(i)).cloned().collect();
    if uses.is_empty() {
        return;
    }
    let word = declare(module, Op::TypeInt, None, [32, 0].map(Operand::LiteralBit32).to_vec());
    let zero = declare(module, Op::Constant, Some(word), vec![Operand::LiteralBit32(0)]);
    let [to_address, to_word] = [(StorageClass::PushConstant, given.table), (StorageClass::Input, word)]
        .map(|(class, to)| pointer(module, class, to));
    let [at_address, address, at_number, number] = std::array::from_fn(|_| new_id(module));
    let first_of = |of: u32| vec![Operand::IdRef(of), Operand::IdRef(zero)];
    let begin = [
        Instruction::new(Op::AccessChain, Some(to_address), Some(at_address), first_of(given.variable)),
        Instruction::new(Op::Load, Some(given.table), Some(address), vec![Operand::IdRef(at_address)]),
        Instruction::new(Op::AccessChain, Some(to_word), Some(at_number), first_of(given.group)),
        Instruction::new(Op::Load, Some(word), Some(number), vec![Operand::IdRef(at_number)]),
    ];
    // What is read where: pointers into the row, and what their loads are aligned to.
    let mut chains: BTreeMap<u32, (Instruction, u32)> = BTreeMap::new();
    for mut chain in uses {
        let is_chain = matches!(chain.class.opcode, Op::AccessChain | Op::InBoundsAccessChain);
        assert!(is_chain, "{} reads its arguments by {:?}: tell build/by_table.rs how", given.name, chain.class.opcode);
        let to = declared(module, chain.result_type.expect("chains have a type")).operands[1].unwrap_id_ref();
        let is_address = declared(module, to).class.opcode == Op::TypePointer;
        chain.result_type = Some(pointer(module, StorageClass::PhysicalStorageBuffer, to));
        chain.operands.splice(..1, [address, zero, number].map(Operand::IdRef));
        chains.insert(chain.result_id.expect("chains have an id"), (chain, if is_address { 8 } else { 4 }));
    }
    let blocks = &mut module.functions[function].blocks;
    for instruction in blocks.iter_mut().flat_map(|block| &mut block.instructions) {
        if let Some((chain, _)) = instruction.result_id.and_then(|id| chains.get(&id)) {
            *instruction = chain.clone();
        }
        let reads = instruction.operands.iter().find_map(|operand| match operand {
            Operand::IdRef(id) => chains.get(id),
            _ => None,
        });
        if let Some((_, alignment)) = reads {
            let op = instruction.class.opcode;
            assert!(op == Op::Load, "{} reads its arguments by {op:?}: tell build/by_table.rs how", given.name);
            let aligned = [Operand::MemoryAccess(MemoryAccess::ALIGNED), Operand::LiteralBit32(*alignment)];
            instruction.operands.truncate(1);
            instruction.operands.extend(aligned);
        }
    }
    // Variables come first.
    let instructions = &mut blocks[0].instructions;
    let behind = instructions.iter().position(|i| i.class.opcode != Op::Variable).expect("blocks have an end");
    instructions.splice(behind..behind, begin);
}
