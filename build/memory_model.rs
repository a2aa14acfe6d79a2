//! What glslang leaves out of the Vulkan memory model, and what it puts in too much.
//!
//! *Buffers.* Barriers order non-private accesses alone. glslang drops `nonprivate` of a block that is a buffer reference, so every access to
//! a buffer would be private, and a compiler might move it across the barrier behind which another invocation reads it. Here each becomes
//! what `BUFFER` in `glsl/gpu/pass.glsl` says, in shaders that order buffers at all: those that trace only read.
//!
//! *Shared memory* is handed over at barriers, not at every access. glslang has each access to a `shared` variable make its value available
//! or visible to the workgroup, as if it were `workgroupcoherent`, and leaves that out of its barriers. Mesa takes such an access for a
//! fence: on lavapipe an `mfence` each, which was 40% of the time of a kd-tree's build (bunny: 413 ms with, 241 ms without). Nothing here
//! reads what another invocation has written without a barrier between (or an atomic, which needs none), so the barriers do it: an access
//! stays non-private, and a barrier that releases or acquires shared memory makes it available or visible as well (Vulkan memory model,
//! "Availability and Visibility").

use rspirv::binary::Assemble;
use rspirv::dr::{Instruction, Module, Operand, load_bytes};
use rspirv::spirv::{MemoryAccess, MemorySemantics, Op, StorageClass};
use std::collections::BTreeSet;

/// The same shader with buffers and shared memory as above.
pub fn applied(spirv: &[u8]) -> Vec<u8> {
    let mut module = load_bytes(spirv).expect("SPIR-V of shaderc");
    if orders_buffers(&module) {
        accesses_of(&mut module, StorageClass::PhysicalStorageBuffer, share);
    }
    accesses_of(&mut module, StorageClass::Workgroup, leave_to_barriers);
    strengthen_barriers(&mut module);
    module.assemble().into_iter().flat_map(u32::to_le_bytes).collect()
}

/// Whether a barrier orders what lies in buffers.
fn orders_buffers(module: &Module) -> bool {
    let barriers: BTreeSet<u32> = module.all_inst_iter().filter_map(semantics_of).collect();
    let of_barriers = |i: &&Instruction| i.result_id.is_some_and(|id| barriers.contains(&id));
    module.types_global_values.iter().filter(of_barriers).any(|constant| {
        let semantics = MemorySemantics::from_bits_truncate(constant.operands[0].unwrap_literal_bit32());
        semantics.contains(MemorySemantics::UNIFORM_MEMORY)
    })
}

/// Does `change` to every load and store through a pointer to `class`.
fn accesses_of(module: &mut Module, class: StorageClass, change: fn(&mut Instruction)) {
    let pointers = pointers_to(module, class);
    let is_there = |operand: &Operand| matches!(operand, Operand::IdRef(id) if pointers.contains(id));
    let accesses = module.all_inst_iter_mut().filter(|i| matches!(i.class.opcode, Op::Load | Op::Store));
    accesses.filter(|i| i.operands.first().is_some_and(is_there)).for_each(change);
}

fn pointers_to(module: &Module, class: StorageClass) -> BTreeSet<u32> {
    let points_there =
        |i: &&Instruction| i.class.opcode == Op::TypePointer && i.operands[0] == Operand::StorageClass(class);
    let types: BTreeSet<u32> =
        module.types_global_values.iter().filter(points_there).filter_map(|i| i.result_id).collect();
    let has_type = |i: &&Instruction| i.result_type.is_some_and(|ty| types.contains(&ty));
    module.all_inst_iter().filter(has_type).filter_map(|i| i.result_id).collect()
}

/// Makes an access to a buffer non-private. All of them say how they are aligned, so there is something to add it to.
fn share(instruction: &mut Instruction) {
    let access = instruction.operands.iter_mut().find_map(|operand| match operand {
        Operand::MemoryAccess(access) => Some(access),
        _ => None,
    });
    *access.expect("an access by address is aligned") |= MemoryAccess::NON_PRIVATE_POINTER;
}

/// Drops availability and visibility, and the scopes that go with them, of an access to shared memory.
fn leave_to_barriers(instruction: &mut Instruction) {
    instruction.operands.retain(|operand| !matches!(operand, Operand::IdScope(_)));
    for operand in &mut instruction.operands {
        if let Operand::MemoryAccess(access) = operand {
            access.remove(MemoryAccess::MAKE_POINTER_AVAILABLE | MemoryAccess::MAKE_POINTER_VISIBLE);
        }
    }
}

/// Has every barrier that orders shared memory hand it over.
fn strengthen_barriers(module: &mut Module) {
    let barriers: BTreeSet<u32> = module.all_inst_iter().filter_map(semantics_of).collect();
    for id in barriers {
        let constant =
            module.types_global_values.iter().find(|i| i.result_id == Some(id)).expect("semantics are constants");
        let (ty, old) = (constant.result_type, constant.operands[0].unwrap_literal_bit32());
        let new = handing_over(MemorySemantics::from_bits_truncate(old)).bits();
        if new != old {
            let header = module.header.as_mut().expect("shaderc writes one");
            let strong = header.bound;
            header.bound += 1;
            let operands = vec![Operand::LiteralBit32(new)];
            module.types_global_values.push(Instruction::new(Op::Constant, ty, Some(strong), operands));
            for barrier in module.all_inst_iter_mut().filter(|i| semantics_of(i) == Some(id)) {
                *barrier.operands.last_mut().expect("it has semantics") = Operand::IdMemorySemantics(strong);
            }
        }
    }
}

/// The semantics of a barrier, which are its last operand.
fn semantics_of(instruction: &Instruction) -> Option<u32> {
    match (instruction.class.opcode, instruction.operands.last()) {
        (Op::ControlBarrier | Op::MemoryBarrier, Some(&Operand::IdMemorySemantics(id))) => Some(id),
        _ => None,
    }
}

fn handing_over(semantics: MemorySemantics) -> MemorySemantics {
    let both = MemorySemantics::ACQUIRE_RELEASE | MemorySemantics::SEQUENTIALLY_CONSISTENT;
    let if_any = |of: MemorySemantics, more: MemorySemantics| {
        if semantics.intersects(of | both) { more } else { MemorySemantics::empty() }
    };
    if !semantics.contains(MemorySemantics::WORKGROUP_MEMORY) {
        return semantics;
    }
    semantics
        | if_any(MemorySemantics::RELEASE, MemorySemantics::MAKE_AVAILABLE)
        | if_any(MemorySemantics::ACQUIRE, MemorySemantics::MAKE_VISIBLE)
}
