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

/// What a pointer into the push constants led to.
enum Argument {
    /// What was loaded at the start.
    Loaded(u32),
    /// A member of an array, by a number that is not known at the start: the pointer into the row, and what its loads are aligned to.
    Indexed(Instruction, [Operand; 2]),
}

/// Has the entry point load the row of its workgroup before all else; what used its arguments uses what was loaded. (Where they are loaded
/// in the middle of a shader instead, where invocations have parted, SwiftShader writes elsewhere, and crashes.)
fn read_rows(module: &mut Module, function: usize, given: &Given<'_>) {
    let is_use = |i: &Instruction| i.operands.contains(&Operand::IdRef(given.variable));
    let instructions = module.functions[function].blocks.iter().flat_map(|block| &block.instructions);
    let uses: Vec<Instruction> = instructions.filter(|i| is_use(i)).cloned().collect();
    if uses.is_empty() {
        return;
    }
    let is_entry =
        module.functions[function].def_id().is_some_and(|id| module.entry_points[0].operands[1] == Operand::IdRef(id));
    assert!(is_entry, "{} reads its arguments in a function: tell build/by_table.rs how", given.name);
    let mut begin = Vec::new();
    let row = find_row(module, given, &mut begin);
    // What is loaded of a row, by where it lies in it; and what is at the end of each pointer that led into the push constants.
    let mut loaded: BTreeMap<Vec<u32>, u32> = BTreeMap::new();
    let mut arguments: BTreeMap<u32, Argument> = BTreeMap::new();
    for chain in uses {
        let is_chain = matches!(chain.class.opcode, Op::AccessChain | Op::InBoundsAccessChain);
        assert!(is_chain, "{} reads its arguments by {:?}: tell build/by_table.rs how", given.name, chain.class.opcode);
        let path: Vec<u32> = chain.operands[1..].iter().map(Operand::unwrap_id_ref).collect();
        let is_constant = |id: &u32| module.types_global_values.iter().any(|i| i.result_id == Some(*id));
        let is_known = path.iter().all(is_constant);
        let id = chain.result_id.expect("chains have an id");
        let (mut into_row, ty, aligned) = chain_into(module, &row, chain);
        let argument = if is_known {
            Argument::Loaded(*loaded.entry(path).or_insert_with(|| {
                let [at, value] = std::array::from_fn(|_| new_id(module));
                into_row.result_id = Some(at);
                let operands = [Operand::IdRef(at)].into_iter().chain(aligned).collect();
                begin.extend([into_row, Instruction::new(Op::Load, Some(ty), Some(value), operands)]);
                value
            }))
        } else {
            Argument::Indexed(into_row, aligned)
        };
        arguments.insert(id, argument);
    }
    let blocks = &mut module.functions[function].blocks;
    for block in blocks.iter_mut() {
        use_arguments(&mut block.instructions, &arguments, given.name);
    }
    // Variables come first.
    let instructions = &mut blocks[0].instructions;
    let behind = instructions.iter().position(|i| i.class.opcode != Op::Variable).expect("blocks have an end");
    instructions.splice(behind..behind, begin);
}

/// The operands of a pointer into the row of the workgroup, before those of a pointer into the block. `begin` loads them.
fn find_row(module: &mut Module, given: &Given<'_>, begin: &mut Vec<Instruction>) -> [Operand; 3] {
    let word = declare(module, Op::TypeInt, None, [32, 0].map(Operand::LiteralBit32).to_vec());
    let zero = declare(module, Op::Constant, Some(word), vec![Operand::LiteralBit32(0)]);
    let [to_address, to_word] = [(StorageClass::PushConstant, given.table), (StorageClass::Input, word)]
        .map(|(class, to)| pointer(module, class, to));
    let [at_address, address, at_number, number] = std::array::from_fn(|_| new_id(module));
    let first_of = |of: u32| vec![Operand::IdRef(of), Operand::IdRef(zero)];
    begin.extend([
        Instruction::new(Op::AccessChain, Some(to_address), Some(at_address), first_of(given.variable)),
        Instruction::new(Op::Load, Some(given.table), Some(address), vec![Operand::IdRef(at_address)]),
        Instruction::new(Op::AccessChain, Some(to_word), Some(at_number), first_of(given.group)),
        Instruction::new(Op::Load, Some(word), Some(number), vec![Operand::IdRef(at_number)]),
    ]);
    [address, zero, number].map(Operand::IdRef)
}

/// A pointer into the push constants as one into the row; the type of what it leads to, and what loads of it are aligned to.
fn chain_into(module: &mut Module, row: &[Operand; 3], mut chain: Instruction) -> (Instruction, u32, [Operand; 2]) {
    let ty = declared(module, chain.result_type.expect("chains have a type")).operands[1].unwrap_id_ref();
    let is_address = declared(module, ty).class.opcode == Op::TypePointer;
    chain.result_type = Some(pointer(module, StorageClass::PhysicalStorageBuffer, ty));
    chain.operands.splice(..1, row.clone());
    let bytes = Operand::LiteralBit32(if is_address { 8 } else { 4 });
    (chain, ty, [Operand::MemoryAccess(MemoryAccess::ALIGNED), bytes])
}

/// Puts arguments in the place of what was loaded of the push constants.
fn use_arguments(instructions: &mut Vec<Instruction>, arguments: &BTreeMap<u32, Argument>, name: &str) {
    let argument_of = |id: Option<u32>| id.and_then(|id| arguments.get(&id));
    instructions.retain(|i| !matches!(argument_of(i.result_id), Some(Argument::Loaded(_))));
    for instruction in instructions {
        if let Some(Argument::Indexed(chain, _)) = argument_of(instruction.result_id) {
            *instruction = chain.clone();
        }
        let used = instruction.operands.iter().find_map(|operand| argument_of(operand.id_ref_any()));
        let Some(argument) = used else { continue };
        let op = instruction.class.opcode;
        assert!(op == Op::Load, "{name} reads its arguments by {op:?}: tell build/by_table.rs how");
        match argument {
            Argument::Loaded(value) => {
                let copied = vec![Operand::IdRef(*value)];
                *instruction = Instruction::new(Op::CopyObject, instruction.result_type, instruction.result_id, copied);
            }
            Argument::Indexed(_, aligned) => {
                instruction.operands.truncate(1);
                instruction.operands.extend(aligned.clone());
            }
        }
    }
}
