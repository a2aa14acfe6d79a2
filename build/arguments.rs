//! The push constants of all shaders as Rust structs, and what of them each shader takes: `arguments.rs`. GLSL declares each block
//! once, and its SPIR-V is read here.
//!
//! A block `NameArguments` becomes `struct Name`. An address is a `u64`, and its ending `_address` is left out.

use crate::reflection::{bytes_of, declared, members, name_of, push_constants};
use crate::table::{constant_of, file_of, out_dir};
use rspirv::dr::{Instruction, Module};
use rspirv::spirv::Op;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;

/// The members of a struct, and their types.
type Members = Vec<(String, String)>;

/// A struct of the host.
struct Struct {
    members: Members,
    /// Of a block: its passes, with the members that each takes. Empty for what lies in a block.
    passes: Vec<(String, Vec<String>)>,
}

type Structs = BTreeMap<String, Struct>;

/// Writes `arguments.rs` from the shaders of these names, compiled without optimisation.
pub fn write(names: &[String]) {
    let mut structs = Structs::new();
    let mut takes = String::new();
    let mut states = BTreeMap::new();
    for name in names {
        let path = out_dir().join("named").join(file_of(name));
        let module = rspirv::dr::load_bytes(fs::read(&path).expect("just compiled")).expect("SPIR-V of shaderc");
        let block = push_constants(&module).map(|(_, block)| block);
        let rust_name = block.map_or(String::new(), |block| block_name(&module, block, name));
        let ranges = ranges_of(name);
        if let Some(block) = block {
            add(&module, block, &rust_name, &mut structs);
            let passes = &mut structs.get_mut(&rust_name).expect("just added").passes;
            passes.push((name.clone(), taken(&module, block, &ranges)));
        }
        for (state, bytes) in states_of(&module) {
            let known = *states.entry(state.clone()).or_insert(bytes);
            assert_eq!(known, bytes, "{state} has another size in {name}");
        }
        let constant = constant_of(name);
        writeln!(takes, "    pub const {constant}: Takes = Takes {{ block: {rust_name:?}, ranges: &{ranges:?} }};")
            .expect("writing to a string");
    }
    let mut text = String::new();
    for (name, bytes) in &states {
        let constant = snake(name).to_uppercase();
        writeln!(text, "/// Bytes of a `{name}` of the shaders.\npub const {constant}_BYTES: u64 = {bytes};")
            .expect("writing to a string");
    }
    for (name, item) in &structs {
        text += &definition(name, item);
    }
    write!(text, "/// What each shader takes of its block.\npub mod takes {{\n    use super::Takes;\n{takes}}}\n")
        .expect("writing to a string");
    fs::write(out_dir().join("arguments.rs"), text).expect("OUT_DIR can be written");
}

fn definition(name: &str, Struct { members, passes }: &Struct) -> String {
    let fields: String = members.iter().map(|(name, ty)| format!("    pub {name}: {ty},\n")).collect();
    let of_pass = |(pass, takes): &(String, Vec<String>)| format!("/// - `{pass}`: {}\n", takes.join(", "));
    let passes: String = passes.iter().map(of_pass).collect();
    let what = if passes.is_empty() {
        "Lies in a block".to_owned()
    } else {
        format!("What these passes take:\n///\n{passes}///")
    };
    let block = if passes.is_empty() {
        String::new()
    } else {
        format!("impl Block for {name} {{\n    const NAME: &'static str = {name:?};\n}}\n")
    };
    format!(
        "/// {what}\n#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]\n#[repr(C, packed(4))]\n\
         pub struct {name} {{\n{fields}}}\n{block}"
    )
}

/// Structs in memory of which a build has one: their bytes are part of what it asks the caller for.
const STATES: [&str; 5] = ["BuildState", "KdMerge", "KdState", "RebraidState", "SplitState"];

/// Those of [`STATES`] in a module, and their bytes.
fn states_of(module: &Module) -> Vec<(String, u32)> {
    let is_struct = |i: &&Instruction| i.class.opcode == Op::TypeStruct;
    let structs = module.types_global_values.iter().filter(is_struct).filter_map(|i| i.result_id);
    let named = structs.filter_map(|id| Some((id, name_of(module, id, None)?.to_owned())));
    named.filter(|(_, name)| STATES.contains(&name.as_str())).map(|(id, name)| (name, bytes_of(module, id))).collect()
}

/// `ThisName` as `this_name`.
fn snake(name: &str) -> String {
    let parts = name.chars().map(|c| if c.is_uppercase() { format!("_{}", c.to_lowercase()) } else { c.to_string() });
    parts.collect::<String>().trim_start_matches('_').to_owned()
}

fn block_name(module: &Module, block: u32, shader: &str) -> String {
    let name = name_of(module, block, None).expect("shaders are compiled with names");
    let stem = name.strip_suffix("Arguments");
    stem.unwrap_or_else(|| panic!("{shader}: the block {name} must end in Arguments")).to_owned()
}

/// The ranges of its block that a shader takes, as [`Compiler::make`](crate::compile::Compiler::make) has left them.
fn ranges_of(shader: &str) -> Vec<(u32, u32)> {
    let text = fs::read_to_string(out_dir().join(format!("{}.takes", file_of(shader)))).expect("just written");
    let numbers = |line: &str| line.split_once(' ').map(|(at, bytes)| Some((at.parse().ok()?, bytes.parse().ok()?)));
    text.lines().map(|line| numbers(line).flatten().expect("two numbers a line")).collect()
}

/// Names of the members that lie in these ranges; of structs among them, those of their own.
fn taken(module: &Module, block: u32, ranges: &[(u32, u32)]) -> Vec<String> {
    let is_taken = |offset: u32| ranges.iter().any(|&(at, bytes)| (at..at + bytes).contains(&offset));
    let mut names = Vec::new();
    for ((ty, offset), member) in members(module, block).into_iter().zip(0..) {
        let name = member_name(module, block, member);
        if declared(module, ty).class.opcode == Op::TypeStruct {
            let inner = members(module, ty).into_iter().zip(0..).filter(|((_, inner), _)| is_taken(offset + inner));
            names.extend(inner.map(|(_, member)| format!("`{name}.{}`", member_name(module, ty, member))));
        } else if is_taken(offset) {
            names.push(format!("`{name}`"));
        }
    }
    names
}

fn member_name(module: &Module, block: u32, member: u32) -> String {
    let name = name_of(module, block, Some(member)).expect("shaders are compiled with names");
    name.trim_end_matches("_address").to_owned()
}

/// Adds a struct of a module, which must be what others of its name are; returns its bytes.
fn add(module: &Module, id: u32, name: &str, structs: &mut Structs) -> u32 {
    let mut end = 0;
    let mut fields = Members::new();
    for ((ty, offset), member) in members(module, id).into_iter().zip(0..) {
        let (ty, bytes) = rust_type(module, ty, structs);
        assert_eq!(offset, end, "{name}: member {member} does not lie behind the one before; use scalar layout");
        end = offset + bytes;
        fields.push((member_name(module, id, member), ty));
    }
    let known =
        structs.entry(name.to_owned()).or_insert_with(|| Struct { members: fields.clone(), passes: Vec::new() });
    assert_eq!(known.members, fields, "another shader's {name} has other members; name one of them otherwise");
    end
}

/// The type that the host has for one in a block, and its bytes.
fn rust_type(module: &Module, id: u32, structs: &mut Structs) -> (String, u32) {
    let ty = declared(module, id);
    let operand = |i: usize| ty.operands[i].unwrap_id_ref();
    match ty.class.opcode {
        Op::TypeInt => (if ty.operands[1].unwrap_literal_bit32() == 1 { "i32" } else { "u32" }.into(), 4),
        Op::TypeFloat => ("f32".into(), 4),
        Op::TypePointer => ("u64".into(), 8),
        Op::TypeVector | Op::TypeArray => {
            let (element, bytes) = rust_type(module, operand(0), structs);
            let count = match ty.class.opcode {
                Op::TypeVector => ty.operands[1].unwrap_literal_bit32(),
                _ => declared(module, operand(1)).operands[0].unwrap_literal_bit32(),
            };
            // Two words are an address.
            let is_address = ty.class.opcode == Op::TypeVector && (element.as_str(), count) == ("u32", 2);
            (if is_address { "u64".into() } else { format!("[{element}; {count}]") }, bytes * count)
        }
        Op::TypeStruct => {
            let name = name_of(module, id, None).expect("shaders are compiled with names").to_owned();
            let bytes = add(module, id, &name, structs);
            (name, bytes)
        }
        other => panic!("{other:?} in a block of push constants: tell build/arguments.rs what the host has for it"),
    }
}
