//! Serialising and deserialising, plainly.

use crate::accel::serialize::{Head, VERSION};
use crate::bvh::layout::{self, Header, MAGIC};
use crate::{Error, Result};

/// What the device writes of a structure's bytes.
///
/// # Errors
/// [`Error::InvalidStructure`]: they are not those of a structure.
pub fn write(structure: &[u8]) -> Result<Vec<u8>> {
    let (header, sizes) = parts_of(structure)?;
    let structure = &structure[..sizes.bytes as usize];
    let head = Head::of(&header, &sizes);
    let mut memory = bytemuck::bytes_of(&head).to_vec();
    for handle in head.handles(&sizes) {
        memory.extend_from_slice(&structure[handle]);
    }
    memory.extend_from_slice(structure);
    Ok(memory)
}

/// The structure that the device reads out of the memory, with the handles that stand there.
///
/// # Errors
/// [`Error::InvalidStructure`]: another version wrote it, or it is cut off. (The device makes an empty structure of it.)
pub fn read(memory: &[u8]) -> Result<Vec<u8>> {
    let invalid = |what: &str| Error::InvalidStructure(format!("serialised: {what}"));
    let head = memory.get(..size_of::<Head>()).ok_or_else(|| invalid("shorter than its head"))?;
    let head: Head = bytemuck::pod_read_unaligned(head);
    if head.version != VERSION {
        return Err(invalid("another version wrote it; build the structure again"));
    }
    let handles = size_of::<Head>()..(size_of::<Head>() as u64 + 8 * head.handle_count) as usize;
    let (handles, structure) = (memory.get(handles.clone()), memory.get(handles.end..));
    let (Some(handles), Some(structure)) = (handles, structure) else { return Err(invalid("shorter than it says")) };
    let (header, sizes) = parts_of(structure)?;
    if head != Head::of(&header, &sizes) {
        return Err(invalid("its head and the structure's header say different sizes"));
    }
    let mut structure = structure[..sizes.bytes as usize].to_vec();
    for (at, handle) in head.handles(&sizes).zip(handles.chunks_exact(8)) {
        structure[at].copy_from_slice(handle);
    }
    Ok(structure)
}

/// The header of a structure's bytes, and where its parts lie.
fn parts_of(structure: &[u8]) -> Result<(Header, layout::BvhOffsets)> {
    let invalid = |what: &str| Error::InvalidStructure(what.into());
    let header = structure.get(..size_of::<Header>()).ok_or_else(|| invalid("shorter than its header"))?;
    let header: Header = bytemuck::pod_read_unaligned(header);
    let record_bytes = layout::record_bytes(header.kind).filter(|_| header.magic == MAGIC);
    let sizes = header.offsets(record_bytes.ok_or_else(|| invalid("of another kind or version"))?);
    if (structure.len() as u64) < sizes.bytes {
        return Err(invalid("shorter than its header says"));
    }
    Ok((header, sizes))
}
