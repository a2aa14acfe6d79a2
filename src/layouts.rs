//! The structs that host and device share are the same on both sides: offsets, sizes and names, from SPIR-V reflection.
//!
//! A module declares its push constants with `gpu::push_constants!`; every shader of the table must find its module in
//! `arguments_of`, so that a new one cannot be forgotten. Names may differ by the ending `_address`.

use crate::accel::serialize::Head;
use crate::bvh::geometry::Geometry;
use crate::bvh::layout::{BoxRecord, Child, GeometryEntry, Header, Instance, Node, Triangle};
use crate::bvh::split::Reference;
use crate::bvh::wide::quantised::QuantisedNode;
use crate::gpu::shaders;
use crate::kdtree::layout as kdtree;
use crate::trace::kd::TreeEntry;
use crate::trace::{Hit, Ray};
use crate::{accel, bvh, gpu, trace};
use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, MemorySemantics, Op, StorageClass};
use std::collections::{BTreeMap, BTreeSet};
use std::mem::offset_of;
use std::path::Path;

/// A struct: its bytes, and name, offset and bytes of each member.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Layout {
    pub bytes: usize,
    pub members: Vec<(String, usize, usize)>,
}

/// The [`Layout`] of a Rust struct: `layout_of!(Arguments { keys, values })`, with all its members.
macro_rules! layout_of {
    ($name:ty { $($member:ident),* $(,)? }) => {{
        let member = |name: &str, at: usize, bytes: usize| (name.to_string(), at, bytes);
        crate::layouts::Layout {
            bytes: size_of::<$name>(),
            members: vec![$(member(
                stringify!($member),
                std::mem::offset_of!($name, $member),
                crate::layouts::bytes_of_member(|s: &$name| &s.$member),
            )),*],
        }
    }};
}
pub(crate) use layout_of;

pub(crate) fn bytes_of_member<S, M>(_: fn(&S) -> &M) -> usize {
    size_of::<M>()
}

/// The push constants of each shader, as the host sees them.
fn arguments_of(shader: &str) -> Option<Layout> {
    let (room, name) = shader.split_once('/')?;
    let is = |prefix: &str| name == prefix || name.strip_prefix(prefix).is_some_and(|rest| rest.starts_with('_'));
    Some(match room {
        "accel" if is("copy") => accel::push_constants::copy(),
        "accel" if is("entries") => accel::push_constants::entries(),
        "accel" if is("geometries") => accel::push_constants::geometries(),
        "accel" if is("properties") => accel::push_constants::properties(),
        "accel" if is("rebraid") => accel::push_constants::rebraid(),
        "accel" if is("ranges") => accel::push_constants::ranges(),
        "accel" if is("serialize") => accel::push_constants::serialize(),
        "kdtree" if is("merge_seed") => crate::kdtree::merge::push::push_constants(),
        "kdtree" if is("merge_setup") || is("merge_restore") => crate::kdtree::merge::push_constants(),
        "kdtree" if is("build") || is("merge") => crate::kdtree::builder::push_constants(),
        "bvh" if is("compact") => bvh::compact::push_constants(),
        "bvh" if is("epo") => bvh::epo::push_constants(),
        "bvh" if is("lbvh_workgroup") => bvh::lbvh_workgroup::push_constants(),
        "bvh" if ["encode", "lbvh", "collapse", "hlbvh", "hploc", "ploc"].into_iter().any(is) => {
            bvh::encode::push_constants()
        }
        "bvh" if is("quality") => bvh::quality::push_constants(),
        "bvh" if is("refit") => bvh::refit::push_constants(),
        "bvh" if is("wide") => bvh::wide::device::push_constants(),
        "bvh" if is("split") => bvh::split::push_constants(),
        "bvh" if is("reinsertion") => bvh::reinsertion::push_constants(),
        "gpu" if is("fill") => gpu::fill::push_constants(),
        "gpu" if is("radix_sort") => gpu::radix_sort::push_constants(),
        "gpu" if is("reduce") => gpu::reduce::push_constants(),
        "gpu" if is("scan") => gpu::scan::push_constants(),
        "trace" if is("tracer") => trace::tracer::push_constants(),
        _ => return None,
    })
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
        reserved
    });
    // `active` is a reserved word of GLSL.
    header.members[5].0 = "active_count".into();
    // Formats and flags are one word there.
    let mut geometry =
        layout_of!(Geometry { vertices, indices, transform, vertex_stride, vertex_count, vertex_format, first });
    geometry.members[5] = ("formats".into(), offset_of!(Geometry, vertex_format), 4);
    let mut kd_header = layout_of!(kdtree::Header {
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
        ("Reference", layout_of!(Reference { lo, primitive, hi, left_out })),
        ("BoxRecord", layout_of!(BoxRecord { lo, hi, primitive })),
        ("GeometryEntry", layout_of!(GeometryEntry { first, flags })),
        (
            "Instance",
            layout_of!(Instance {
                to_object,
                to_world,
                structure,
                index_and_mask,
                offset_and_flags,
                instance,
                start,
                start_count,
                reserved
            }),
        ),
        (
            "QuantisedNode",
            layout_of!(QuantisedNode { origin, exponents_and_nodes, first_child, first_record, counts, lo, hi }),
        ),
        ("Header", header),
        ("KdHeader", kd_header),
        ("KdNode", layout_of!(kdtree::Node { first, second })),
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

    /// The push constants, as the device sees them.
    fn arguments(&self) -> Option<Layout> {
        let is_pointer = |i: &&Instruction| {
            i.class.opcode == Op::TypePointer && i.operands[0] == Operand::StorageClass(StorageClass::PushConstant)
        };
        let pointee = |i: &Instruction| self.ty(i.operands[1].unwrap_id_ref());
        let pointees = self.0.types_global_values.iter().filter(is_pointer).map(pointee);
        pointees.filter(|t| t.class.opcode == Op::TypeStruct).find_map(|t| self.layout(t))
    }

    /// The structs that lie in memory and whose names are `wanted`, as the device sees them. Headers that foreign shaders include
    /// put the library's name before theirs: it is left out.
    fn structs<'a>(&'a self, wanted: impl Fn(&str) -> bool + 'a) -> impl Iterator<Item = (&'a str, Layout)> {
        let structs = self.0.types_global_values.iter().filter(|i| i.class.opcode == Op::TypeStruct);
        structs.filter_map(move |i| {
            let name = self.name(i.result_id?, None)?;
            let name = name.strip_prefix("Hedgerow").unwrap_or(name);
            Some((name, wanted(name).then(|| self.layout(i)).flatten()?))
        })
    }

    fn ty(&self, id: u32) -> &Instruction {
        self.0.types_global_values.iter().find(|i| i.result_id == Some(id)).expect("types are declared")
    }

    /// The name of a type, or of one of its members.
    fn name(&self, id: u32, member: Option<u32>) -> Option<&str> {
        let target: Vec<_> = [Operand::IdRef(id)].into_iter().chain(member.map(Operand::LiteralBit32)).collect();
        let op = if member.is_some() { Op::MemberName } else { Op::Name };
        let mut names = self.0.debug_names.iter().filter(|i| i.class.opcode == op);
        names.find_map(|i| i.operands.strip_prefix(&target[..])?.first().map(Operand::unwrap_literal_string))
    }

    fn decoration(&self, id: u32, member: Option<u32>, decoration: Decoration) -> Option<usize> {
        let mut target: Vec<_> = [Operand::IdRef(id)].into_iter().chain(member.map(Operand::LiteralBit32)).collect();
        target.push(Operand::Decoration(decoration));
        let mut values = self.0.annotations.iter().filter_map(|i| i.operands.strip_prefix(&target[..])?.first());
        values.next().map(|value| value.unwrap_literal_bit32() as usize)
    }

    /// The layout of a struct; `None` for one that lies in no memory and so has no offsets.
    fn layout(&self, block: &Instruction) -> Option<Layout> {
        let id = block.result_id?;
        let members = block.operands.iter().zip(0..).map(|(ty, member)| {
            let name = self.name(id, Some(member))?.trim_end_matches("_address").to_string();
            let offset = self.decoration(id, Some(member), Decoration::Offset)?;
            Some((name, offset, self.bytes(ty.unwrap_id_ref())))
        });
        let members = members.collect::<Option<Vec<_>>>()?;
        Some(Layout { bytes: members.last().map_or(0, |(_, offset, bytes)| offset + bytes), members })
    }

    /// Bytes of a type in memory; 0 for an array without end.
    fn bytes(&self, id: u32) -> usize {
        let ty = self.ty(id);
        let operand = |i: usize| ty.operands[i].unwrap_id_ref();
        match ty.class.opcode {
            Op::TypeInt | Op::TypeFloat => ty.operands[0].unwrap_literal_bit32() as usize / 8,
            Op::TypeVector => self.bytes(operand(0)) * ty.operands[1].unwrap_literal_bit32() as usize,
            Op::TypeArray => {
                let length = self.ty(operand(1)).operands[0].unwrap_literal_bit32() as usize;
                length * self.stride(id, operand(0))
            }
            Op::TypeRuntimeArray => {
                self.stride(id, operand(0));
                0
            }
            Op::TypePointer => 8,
            Op::TypeStruct => self.layout(ty).map_or(0, |l| l.bytes),
            other => panic!("{other:?} lies in memory that the host shares"),
        }
    }

    /// The stride of an array, which in scalar layout is the size of its element.
    fn stride(&self, array: u32, element: u32) -> usize {
        let stride = self.decoration(array, None, Decoration::ArrayStride).expect("arrays in memory have a stride");
        assert_eq!(stride, self.bytes(element), "the stride of an array of {:?}", self.name(element, None));
        stride
    }
}

#[test]
fn push_constants_are_the_same_on_host_and_device() {
    for shader in shaders::ALL {
        let device =
            Reflection::of(shader.name).arguments().unwrap_or_else(|| panic!("{} has no push constants", shader.name));
        let mut host = arguments_of(shader.name)
            .unwrap_or_else(|| panic!("{} is new: say its arguments in src/layouts.rs", shader.name));
        // The host's struct may end in padding, up to its alignment.
        assert!(host.bytes <= 128 && (device.bytes..device.bytes + 8).contains(&host.bytes), "{}", shader.name);
        host.members.retain(|(name, ..)| name != "padding");
        assert_eq!(host.members, device.members, "{}: host left, device right", shader.name);
    }
}

#[test]
fn structs_in_memory_are_the_same_on_host_and_device() {
    let host = structs();
    let mut seen = BTreeSet::new();
    for shader in shaders::ALL {
        for (name, device) in Reflection::of(shader.name).structs(|name| host.contains_key(name)) {
            assert_eq!(host[name], device, "{name} in {}: host left, device right", shader.name);
            seen.insert(name.to_string());
        }
    }
    assert!(seen.iter().eq(host.keys().copied()), "every struct is met in some shader: {seen:?}");
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

/// What `build/shared_memory.rs` has made of them.
#[test]
fn shared_memory_is_handed_over_at_barriers_alone() {
    let (mut accesses, mut barriers) = (0, 0);
    for shader in shaders::ALL {
        let module = rspirv::dr::load_bytes(shader.spirv).expect("SPIR-V of shaderc");
        let is_shared = |i: &&Instruction| i.operands.contains(&Operand::StorageClass(StorageClass::Workgroup));
        let types: BTreeSet<_> = module.types_global_values.iter().filter(is_shared).map(|i| i.result_id).collect();
        let pointers: BTreeSet<_> =
            module.all_inst_iter().filter(|i| types.contains(&i.result_type)).filter_map(|i| i.result_id).collect();
        let semantics = |id: u32| {
            let constant = module.types_global_values.iter().find(|i| i.result_id == Some(id)).expect("a constant");
            MemorySemantics::from_bits_retain(constant.operands[0].unwrap_literal_bit32())
        };
        for i in module.all_inst_iter() {
            match (i.class.opcode, &i.operands[..]) {
                (Op::Load | Op::Store, [Operand::IdRef(pointer), rest @ ..]) if pointers.contains(pointer) => {
                    accesses += 1;
                    assert!(
                        !rest.iter().any(|operand| matches!(operand, Operand::IdScope(_))),
                        "{}: {i:?}",
                        shader.name
                    );
                }
                (Op::ControlBarrier | Op::MemoryBarrier, [.., Operand::IdMemorySemantics(id)]) => {
                    let has = |of: MemorySemantics| semantics(*id).contains(of);
                    if has(MemorySemantics::WORKGROUP_MEMORY) {
                        barriers += 1;
                        let both = MemorySemantics::MAKE_AVAILABLE | MemorySemantics::MAKE_VISIBLE;
                        assert!(has(MemorySemantics::ACQUIRE_RELEASE | both), "{}: {i:?}", shader.name);
                    }
                }
                _ => {}
            }
        }
    }
    assert!(accesses > 0 && barriers > 0, "{accesses} accesses, {barriers} barriers");
}
