//! The push constants of all shaders as Rust structs: `arguments.rs`. GLSL declares each block once, and its SPIR-V is read here.
//!
//! A block `NameArguments` becomes `struct Name`. An address is a `u64`, and its ending `_address` is left out.

use crate::table::{file_of, out_dir};
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, Op, StorageClass};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;

/// The members of a struct, and their types.
type Members = Vec<(String, String)>;

/// A struct of the host: its members, and what it is.
type Structs = BTreeMap<String, (Members, String)>;

/// Writes `arguments.rs` from the shaders of these names, compiled without optimisation.
pub fn write(names: &[String]) {
    let mut structs = Structs::new();
    for name in names {
        let path = out_dir().join("named").join(file_of(name));
        let module = rspirv::dr::load_bytes(fs::read(&path).expect("just compiled")).expect("SPIR-V of shaderc");
        if let Some(block) = push_constants(&module) {
            let block_name = name_of(&module, block, None).expect("shaders are compiled with names");
            let rust_name = block_name.strip_suffix("Arguments");
            let rust_name = rust_name.unwrap_or_else(|| panic!("{name}: the block {block_name} must end in Arguments"));
            add(
                &module,
                block,
                rust_name,
                &format!("Push constants of `{name}` and whichever has the same block"),
                &mut structs,
            );
        }
    }
    let mut text = String::new();
    for (name, (members, what)) in &structs {
        let fields: String = members.iter().map(|(name, ty)| format!("    pub {name}: {ty},\n")).collect();
        writeln!(
            text,
            "/// {what}.\n#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]\n#[repr(C, packed(4))]\n\
             pub struct {name} {{\n{fields}}}"
        )
        .expect("writing to a string");
    }
    fs::write(out_dir().join("arguments.rs"), text).expect("OUT_DIR can be written");
}

/// The struct of a module's push constants.
fn push_constants(module: &Module) -> Option<u32> {
    let is_pointer = |i: &&Instruction| {
        i.class.opcode == Op::TypePointer && i.operands[0] == Operand::StorageClass(StorageClass::PushConstant)
    };
    let mut pointees = module.types_global_values.iter().filter(is_pointer).map(|i| i.operands[1].unwrap_id_ref());
    pointees.find(|&id| ty(module, id).class.opcode == Op::TypeStruct)
}

/// Adds a struct of a module, which must be what others of its name are; returns its bytes.
fn add(module: &Module, id: u32, name: &str, what: &str, structs: &mut Structs) -> u32 {
    let mut end = 0;
    let mut members = Members::new();
    for (operand, member) in ty(module, id).operands.iter().zip(0..) {
        let (ty, bytes) = rust_type(module, operand.unwrap_id_ref(), structs);
        let offset = offset_of(module, id, member);
        assert_eq!(offset, end, "{name}: member {member} does not lie behind the one before; use scalar layout");
        end = offset + bytes;
        let member = name_of(module, id, Some(member)).expect("shaders are compiled with names");
        members.push((member.trim_end_matches("_address").to_owned(), ty));
    }
    let (known, _) = structs.entry(name.to_owned()).or_insert_with(|| (members.clone(), what.to_owned()));
    assert_eq!(*known, members, "{what}: another shader's {name} has other members; name one of them otherwise");
    end
}

fn ty(module: &Module, id: u32) -> &Instruction {
    module.types_global_values.iter().find(|i| i.result_id == Some(id)).expect("types are declared")
}

fn name_of(module: &Module, id: u32, member: Option<u32>) -> Option<&str> {
    let target: Vec<_> = [Operand::IdRef(id)].into_iter().chain(member.map(Operand::LiteralBit32)).collect();
    let op = if member.is_some() { Op::MemberName } else { Op::Name };
    let mut names = module.debug_names.iter().filter(|i| i.class.opcode == op);
    names.find_map(|i| i.operands.strip_prefix(&target[..])?.first().map(Operand::unwrap_literal_string))
}

fn offset_of(module: &Module, id: u32, member: u32) -> u32 {
    let target = [Operand::IdRef(id), Operand::LiteralBit32(member), Operand::Decoration(Decoration::Offset)];
    let mut values = module.annotations.iter().filter_map(|i| i.operands.strip_prefix(&target[..])?.first());
    values.next().expect("members of a block have offsets").unwrap_literal_bit32()
}

/// The type that the host has for one in a block, and its bytes.
fn rust_type(module: &Module, id: u32, structs: &mut Structs) -> (String, u32) {
    let ty = ty(module, id);
    let operand = |i: usize| ty.operands[i].unwrap_id_ref();
    match ty.class.opcode {
        Op::TypeInt => (if ty.operands[1].unwrap_literal_bit32() == 1 { "i32" } else { "u32" }.into(), 4),
        Op::TypeFloat => ("f32".into(), 4),
        Op::TypePointer => ("u64".into(), 8),
        Op::TypeVector | Op::TypeArray => {
            let (element, bytes) = rust_type(module, operand(0), structs);
            let count = match ty.class.opcode {
                Op::TypeVector => ty.operands[1].unwrap_literal_bit32(),
                _ => self::ty(module, operand(1)).operands[0].unwrap_literal_bit32(),
            };
            // Two words are an address.
            let is_address = ty.class.opcode == Op::TypeVector && (element.as_str(), count) == ("u32", 2);
            (if is_address { "u64".into() } else { format!("[{element}; {count}]") }, bytes * count)
        }
        Op::TypeStruct => {
            let name = name_of(module, id, None).expect("shaders are compiled with names").to_owned();
            let bytes = add(module, id, &name, &format!("`{name}` of the shaders"), structs);
            (name, bytes)
        }
        other => panic!("{other:?} in a block of push constants: tell build/arguments.rs what the host has for it"),
    }
}
