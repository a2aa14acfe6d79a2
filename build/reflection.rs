//! What SPIR-V says of its types: their names, members, offsets and bytes.

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, Op, StorageClass};

/// The declaration of a type or a constant.
pub fn declared(module: &Module, id: u32) -> &Instruction {
    module.types_global_values.iter().find(|i| i.result_id == Some(id)).expect("what is used is declared")
}

/// The name of a type, or of one of its members.
pub fn name_of(module: &Module, id: u32, member: Option<u32>) -> Option<&str> {
    let target: Vec<_> = [Operand::IdRef(id)].into_iter().chain(member.map(Operand::LiteralBit32)).collect();
    let op = if member.is_some() { Op::MemberName } else { Op::Name };
    let mut names = module.debug_names.iter().filter(|i| i.class.opcode == op);
    names.find_map(|i| i.operands.strip_prefix(&target[..])?.first().map(Operand::unwrap_literal_string))
}

/// The number that a decoration gives a type, or one of its members.
pub fn decoration(module: &Module, id: u32, member: Option<u32>, decoration: Decoration) -> Option<u32> {
    let mut target: Vec<_> = [Operand::IdRef(id)].into_iter().chain(member.map(Operand::LiteralBit32)).collect();
    target.push(Operand::Decoration(decoration));
    let mut values = module.annotations.iter().filter_map(|i| i.operands.strip_prefix(&target[..])?.first());
    values.next().map(Operand::unwrap_literal_bit32)
}

/// The variable that holds a module's push constants, and its struct.
pub fn push_constants(module: &Module) -> Option<(u32, u32)> {
    let is_variable = |i: &&Instruction| {
        i.class.opcode == Op::Variable && i.operands[0] == Operand::StorageClass(StorageClass::PushConstant)
    };
    let variable = module.types_global_values.iter().find(is_variable)?;
    let pointer = declared(module, variable.result_type.expect("variables have a type"));
    Some((variable.result_id.expect("variables have an id"), pointer.operands[1].unwrap_id_ref()))
}

/// The members of a struct that lies in memory: types, offsets.
pub fn members(module: &Module, block: u32) -> Vec<(u32, u32)> {
    let offset = |member| decoration(module, block, Some(member), Decoration::Offset).expect("blocks have offsets");
    let types = declared(module, block).operands.iter().map(Operand::unwrap_id_ref);
    types.zip(0..).map(|(ty, member)| (ty, offset(member))).collect()
}

/// Bytes of a type in memory; 0 for an array without end.
pub fn bytes_of(module: &Module, id: u32) -> u32 {
    let ty = declared(module, id);
    let operand = |i: usize| ty.operands[i].unwrap_id_ref();
    match ty.class.opcode {
        Op::TypeInt | Op::TypeFloat => ty.operands[0].unwrap_literal_bit32() / 8,
        Op::TypeVector => bytes_of(module, operand(0)) * ty.operands[1].unwrap_literal_bit32(),
        Op::TypeArray => stride_of(module, id) * declared(module, operand(1)).operands[0].unwrap_literal_bit32(),
        Op::TypeRuntimeArray => 0,
        Op::TypePointer => 8,
        Op::TypeStruct => {
            let last = members(module, id).last().copied();
            last.map_or(0, |(ty, offset)| offset + bytes_of(module, ty))
        }
        other => panic!("{other:?} lies in memory that the host shares: tell build/reflection.rs its bytes"),
    }
}

/// The stride of an array in memory.
pub fn stride_of(module: &Module, array: u32) -> u32 {
    decoration(module, array, None, Decoration::ArrayStride).expect("arrays in memory have a stride")
}
