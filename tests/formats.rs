//! The structs that lie in memory are the same on host and device: offsets, sizes and names, from SPIR-V reflection. And what must be
//! `precise`, or handed over at barriers, is so in the shaders that are compiled.

use crate::reflection::{bytes_of, declared, decoration, members, name_of, push_constants, stride_of};
use hedgerow::accel::serialize::Head;
use hedgerow::bvh::geometry::Geometry;
use hedgerow::bvh::layout::{BoxRecord, Child, GeometryEntry, Header, InstanceRecord, Node, Triangle};
use hedgerow::bvh::split::SplitReference;
use hedgerow::bvh::wide::quantised::QuantisedNode;
use hedgerow::geometry::Aabb;
use hedgerow::gpu::shaders;
use hedgerow::kdtree::layout as kdtree;
use hedgerow::trace::kd::TreeEntry;
use hedgerow::trace::{Hit, Ray};
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, MemoryAccess, MemorySemantics, Op, StorageClass};
use std::collections::{BTreeMap, BTreeSet};
use std::mem::offset_of;
use std::path::Path;

/// A struct: its bytes, and name, offset and bytes of each member.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Layout {
    bytes: usize,
    members: Vec<(String, usize, usize)>,
}

/// The [`Layout`] of a Rust struct: `layout_of!(Arguments { keys, values })`, with all its members.
macro_rules! layout_of {
    ($name:ty { $($member:ident),* $(,)? }) => {{
        let member = |name: &str, at: usize, bytes: usize| (name.to_string(), at, bytes);
        Layout {
            bytes: size_of::<$name>(),
            members: vec![$(member(
                stringify!($member),
                std::mem::offset_of!($name, $member),
                bytes_of_member(|s: &$name| &s.$member),
            )),*],
        }
    }};
}
fn bytes_of_member<S, M>(_: fn(&S) -> &M) -> usize {
    size_of::<M>()
}

/// The structs in memory, by their name in GLSL, as the host sees them.
fn structs() -> BTreeMap<&'static str, Layout> {
    let mut node = layout_of!(Node { children });
    let right = offset_of!(Node, children) + size_of::<Child>();
    node.members = vec![("left".into(), 0, size_of::<Child>()), ("right".into(), right, size_of::<Child>())];
    let mut header = layout_of!(Header {
        magic,
        kind,
        status,
        primitive_count,
        root,
        active,
        node_slots,
        code_bits,
        inner_nodes,
        geometry_count,
        geometry_flags,
        build_flags,
        area_scale,
        cost,
        built_cost,
        built_area,
        split_from,
        child_order,
        pairs,
        near_node,
        far_sides,
        reserved
    });
    // `active` is a reserved word of GLSL.
    header.members[5].0 = "active_count".into();
    // Formats and flags are one word there.
    let mut geometry =
        layout_of!(Geometry { vertices, indices, transform, vertex_stride, vertex_count, vertex_format, first });
    geometry.members[5] = ("formats".into(), offset_of!(Geometry, vertex_format), 4);
    let mut kd_header = layout_of!(kdtree::KdHeader {
        magic,
        kind,
        status,
        primitive_count,
        lo,
        node_count,
        hi,
        reference_count,
        active,
        inner_nodes,
        leaves,
        empty_leaves,
        geometry_count,
        geometry_flags,
        build_flags,
        depth,
        area_scale,
        reach,
        node_room,
        reference_room,
        record_room,
        replaced_nodes,
        replaced_references,
        reserved
    });
    kd_header.members[8].0 = "active_count".into();
    BTreeMap::from([
        ("Child", layout_of!(Child { lo, index, hi, count })),
        ("Node", node),
        ("Triangle", layout_of!(Triangle { v0, v1, v2, primitive })),
        ("Reference", layout_of!(SplitReference { lo, primitive, hi, left_out })),
        ("BoxRecord", layout_of!(BoxRecord { lo, hi, primitive })),
        ("GeometryEntry", layout_of!(GeometryEntry { first, flags })),
        ("FarBox", layout_of!(Aabb { lo, hi })),
        (
            "Instance",
            layout_of!(InstanceRecord {
                to_object,
                to_world,
                structure,
                index_and_mask,
                offset_and_flags,
                instance,
                start,
                slots,
                records
            }),
        ),
        (
            "QuantisedNode",
            layout_of!(QuantisedNode { origin, exponents_and_nodes, first_child, first_record, counts, lo, hi }),
        ),
        ("Header", header),
        ("KdHeader", kd_header),
        ("KdNode", layout_of!(kdtree::KdNode { first, second })),
        ("Geometry", geometry),
        ("SerializedHead", layout_of!(Head { version, serialized_bytes, structure_bytes, handle_count })),
        ("Ray", layout_of!(Ray { origin, t_min, direction, t_max })),
        ("Hit", layout_of!(Hit { t, primitive, u, v })),
        ("TreeEntry", layout_of!(TreeEntry { structure, first, reserved })),
    ])
}

/// The unoptimised SPIR-V of a shader, which still has the names.
struct Reflection(Module);

impl Reflection {
    fn of(shader: &str) -> Reflection {
        let path = Path::new(env!("OUT_DIR")).join("named").join(format!("{}.spv", shader.replace('/', ".")));
        let bytes = std::fs::read(&path).expect("build.rs wrote it");
        Reflection(rspirv::dr::load_bytes(bytes).expect("SPIR-V of shaderc"))
    }

    /// The structs that lie in memory and whose names are `wanted`, as the device sees them. Headers that foreign shaders include
    /// put the library's name before theirs: it is left out.
    fn structs<'a>(&'a self, wanted: impl Fn(&str) -> bool + 'a) -> impl Iterator<Item = (&'a str, Layout)> {
        let structs = self.0.types_global_values.iter().filter(|i| i.class.opcode == Op::TypeStruct);
        structs.filter_map(move |i| {
            let name = name_of(&self.0, i.result_id?, None)?;
            let name = name.strip_prefix("Hedgerow").unwrap_or(name);
            Some((name, wanted(name).then(|| self.layout(i)).flatten()?))
        })
    }

    /// The layout of a struct; `None` for one that lies in no memory and so has no offsets.
    fn layout(&self, block: &Instruction) -> Option<Layout> {
        let id = block.result_id?;
        let members = block.operands.iter().zip(0..).map(|(ty, member)| {
            let name = name_of(&self.0, id, Some(member))?.trim_end_matches("_address").to_string();
            let offset = decoration(&self.0, id, Some(member), Decoration::Offset)?;
            Some((name, offset as usize, bytes_of(&self.0, ty.unwrap_id_ref()) as usize))
        });
        let members = members.collect::<Option<Vec<_>>>()?;
        Some(Layout { bytes: members.last().map_or(0, |(_, offset, bytes)| offset + bytes), members })
    }
}

/// In scalar layout the stride of an array is the size of its element.
fn assert_strides(module: &Module) {
    let is_array = |i: &&Instruction| matches!(i.class.opcode, Op::TypeArray | Op::TypeRuntimeArray);
    for array in module.types_global_values.iter().filter(is_array) {
        let id = array.result_id.expect("types have an id");
        if decoration(module, id, None, Decoration::ArrayStride).is_some() {
            let element = array.operands[0].unwrap_id_ref();
            assert_eq!(stride_of(module, id), bytes_of(module, element), "an array of {:?}", declared(module, element));
        }
    }
}

#[test]
fn structs_in_memory_are_the_same_on_host_and_device() {
    let host = structs();
    let mut seen = BTreeSet::new();
    for shader in shaders::ALL {
        assert_strides(&Reflection::of(shader.name).0);
        for (name, device) in Reflection::of(shader.name).structs(|name| host.contains_key(name)) {
            assert_eq!(host[name], device, "{name} in {}: host left, device right", shader.name);
            seen.insert(name.to_string());
        }
    }
    assert!(seen.iter().eq(host.keys().copied()), "every struct is met in some shader: {seen:?}");
}

/// What `build/push_constants.rs` has made of them.
#[test]
fn a_pass_has_push_constants_that_it_reads_and_no_others() {
    let mut divided = 0;
    for shader in shaders::ALL {
        let module = rspirv::dr::load_bytes(shader.spirv).expect("SPIR-V of shaderc");
        let Some((variable, block)) = push_constants(&module) else { continue };
        let taken: u32 = shader.takes.ranges.iter().map(|(_, bytes)| bytes).sum();
        assert!(taken <= 128 && taken == bytes_of(&module, block), "{}: {taken} bytes", shader.name);
        let reads = |member: usize| {
            let of_it = |i: &Instruction| match &i.operands[..] {
                [Operand::IdRef(base), Operand::IdRef(index), ..] if *base == variable => {
                    declared(&module, *index).operands[0].unwrap_literal_bit32() as usize == member
                }
                _ => false,
            };
            module.all_inst_iter().filter(|i| i.class.opcode == Op::AccessChain).any(of_it)
        };
        let members = members(&module, block).len();
        assert!((0..members).all(reads), "{}: {:?}", shader.name, shader.takes);
        divided += u32::from(shader.takes.ranges.len() > 1);
    }
    assert!(divided > 0, "some passes share a block and take different parts of it");
}

/// Whether every operation of a kind that rounds is one that must not be contracted with others.
fn are_all_precise(module: &Module, op: Op) -> bool {
    let target = |i: &Instruction| match &i.operands[..] {
        [Operand::IdRef(id), Operand::Decoration(Decoration::NoContraction)] => Some(*id),
        _ => None,
    };
    let precise: BTreeSet<u32> = module.annotations.iter().filter_map(target).collect();
    let blocks = module.functions.iter().flat_map(|f| &f.blocks);
    let mut operations = blocks.flat_map(|b| &b.instructions).filter(|i| i.class.opcode == op);
    operations.all(|i| i.result_id.is_some_and(|id| precise.contains(&id)))
}

/// Where shaderc unrolls a loop, its copies are not `precise` any more: then the bits depend on the driver.
#[test]
fn what_is_precise_in_a_source_is_so_in_its_shader() {
    let mut precise_shaders = 0;
    for shader in shaders::ALL {
        let optimised = rspirv::dr::load_bytes(shader.spirv).expect("SPIR-V of shaderc");
        let source = Reflection::of(shader.name).0;
        for op in [Op::FAdd, Op::FSub, Op::FMul, Op::FDiv] {
            let is_precise = are_all_precise(&source, op);
            assert!(!is_precise || are_all_precise(&optimised, op), "{}: {op:?}", shader.name);
            precise_shaders += u32::from(is_precise);
        }
    }
    assert!(precise_shaders > 0, "some shaders are precise throughout");
}

/// What points to memory of a class, by id.
fn pointers_to(module: &Module, class: StorageClass) -> BTreeSet<u32> {
    let points_there =
        |i: &&Instruction| i.class.opcode == Op::TypePointer && i.operands.contains(&Operand::StorageClass(class));
    let types: BTreeSet<_> = module.types_global_values.iter().filter(points_there).map(|i| i.result_id).collect();
    module.all_inst_iter().filter(|i| types.contains(&i.result_type)).filter_map(|i| i.result_id).collect()
}

/// The loads and stores through `pointers`, each with what follows the pointer.
fn accesses_of<'m>(module: &'m Module, pointers: &'m BTreeSet<u32>) -> impl Iterator<Item = &'m [Operand]> {
    module.all_inst_iter().filter_map(|i| match (i.class.opcode, &i.operands[..]) {
        (Op::Load | Op::Store, [Operand::IdRef(pointer), rest @ ..]) if pointers.contains(pointer) => Some(rest),
        _ => None,
    })
}

/// The semantics of all barriers.
fn barriers_of(module: &Module) -> impl Iterator<Item = MemorySemantics> {
    let semantics = |id: u32| {
        let constant = module.types_global_values.iter().find(|i| i.result_id == Some(id)).expect("a constant");
        MemorySemantics::from_bits_retain(constant.operands[0].unwrap_literal_bit32())
    };
    module.all_inst_iter().filter_map(move |i| match (i.class.opcode, i.operands.last()) {
        (Op::ControlBarrier | Op::MemoryBarrier, Some(&Operand::IdMemorySemantics(id))) => Some(semantics(id)),
        _ => None,
    })
}

/// What `build/memory_model.rs` has made of them.
#[test]
fn shared_memory_is_handed_over_at_barriers_alone() {
    let (mut accesses, mut barriers) = (0, 0);
    for shader in shaders::ALL {
        let module = rspirv::dr::load_bytes(shader.spirv).expect("SPIR-V of shaderc");
        for rest in accesses_of(&module, &pointers_to(&module, StorageClass::Workgroup)) {
            accesses += 1;
            assert!(!rest.iter().any(|operand| matches!(operand, Operand::IdScope(_))), "{}: {rest:?}", shader.name);
        }
        for semantics in barriers_of(&module).filter(|s| s.contains(MemorySemantics::WORKGROUP_MEMORY)) {
            barriers += 1;
            let both = MemorySemantics::MAKE_AVAILABLE | MemorySemantics::MAKE_VISIBLE;
            assert!(semantics.contains(MemorySemantics::ACQUIRE_RELEASE | both), "{}: {semantics:?}", shader.name);
        }
    }
    assert!(accesses > 0 && barriers > 0, "{accesses} accesses, {barriers} barriers");
}

/// Barriers order non-private accesses alone: where one orders buffers, every access to them is.
#[test]
fn what_barriers_order_in_buffers_is_not_private() {
    let (mut accesses, mut ordering) = (0, 0);
    for shader in shaders::ALL {
        let module = rspirv::dr::load_bytes(shader.spirv).expect("SPIR-V of shaderc");
        if !barriers_of(&module).any(|semantics| semantics.contains(MemorySemantics::UNIFORM_MEMORY)) {
            continue;
        }
        ordering += 1;
        for rest in accesses_of(&module, &pointers_to(&module, StorageClass::PhysicalStorageBuffer)) {
            accesses += 1;
            let is_shared = rest.iter().any(|operand| {
                matches!(operand, Operand::MemoryAccess(access) if access.contains(MemoryAccess::NON_PRIVATE_POINTER))
            });
            assert!(is_shared, "{}: {rest:?}", shader.name);
        }
    }
    assert!(accesses > 0 && ordering > 0, "{accesses} accesses in {ordering} shaders");
}
