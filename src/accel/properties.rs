//! Figures of structures that the device knows, written where the device or the host can read them.

use super::Device;
use super::given::not_null;
use crate::gpu::arguments;
use crate::gpu::{Kernel, Recorder, shaders};
use crate::{Error, Result};
use ash::vk;

/// A property of a structure that the device can report.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Property {
    /// Bytes of a compacted copy.
    CompactedSize = 0,
    /// Bytes in memory when serialised, head and handles included.
    SerializedSize = 1,
    /// Handles of a serialised top level.
    BottomLevelPointers = 2,
    /// Bytes that are in use: those of a clone.
    Size = 3,
    /// Nodes of the tree: each has two children.
    NodeCount = 4,
    /// The bits of an `f32`: the SAH cost ([`Header::sah`](crate::bvh::layout::Header::sah)).
    Sah = 5,
    /// The bits of an `f32`: how many times the SAH cost is what it was at the last build
    /// ([`Header::sah_growth`](crate::bvh::layout::Header::sah_growth)); when updates have made it large, build again.
    SahGrowth = 6,
    /// Bits of [`status`](crate::bvh::layout::status): zero is a structure without a blemish.
    Status = 7,
}

impl TryFrom<vk::QueryType> for Property {
    type Error = Error;

    fn try_from(query: vk::QueryType) -> Result<Property> {
        match query {
            vk::QueryType::ACCELERATION_STRUCTURE_COMPACTED_SIZE_KHR => Ok(Property::CompactedSize),
            vk::QueryType::ACCELERATION_STRUCTURE_SERIALIZATION_SIZE_KHR => Ok(Property::SerializedSize),
            vk::QueryType::ACCELERATION_STRUCTURE_SERIALIZATION_BOTTOM_LEVEL_POINTERS_KHR => {
                Ok(Property::BottomLevelPointers)
            }
            vk::QueryType::ACCELERATION_STRUCTURE_SIZE_KHR => Ok(Property::Size),
            other => {
                Err(Error::Argument(format!("{other:?} asks nothing of an acceleration structure; take a Property")))
            }
        }
    }
}

/// Structures whose addresses fit into the push constants beside the rest.
const STRUCTURES_AT_ONCE: usize = 14;

impl Device<'_> {
    /// `vkCmdWriteAccelerationStructuresPropertiesKHR`, but for where the results go: a `u64` each, from the device address
    /// `results` on, a multiple of 8. (The driver's call writes a query pool, which no shader can.) A barrier from
    /// `COMPUTE_SHADER` with `SHADER_WRITE` makes them visible, to the host by `HOST` with `HOST_READ`.
    ///
    /// # Errors
    /// A structure is null; the address is zero or not a multiple of 8. Nothing is recorded then.
    ///
    /// # Safety
    /// `commands` is being recorded, outside a render pass, on a queue with compute. Handles, the address and the memory behind
    /// them stay valid until it has run; the structures are built, and there is room for as many results.
    pub unsafe fn cmd_write_acceleration_structures_properties(
        &self,
        commands: vk::CommandBuffer,
        structures: &[vk::AccelerationStructureKHR],
        property: Property,
        results: vk::DeviceAddress,
    ) -> Result<()> {
        if results == 0 || !results.is_multiple_of(8) {
            return Err(Error::Argument(format!(
                "the results' address is {results:#x}; it must be a multiple of 8 and not zero"
            )));
        }
        let not_null = |(i, &structure)| not_null(&format!("structures[{i}]"), structure);
        let addresses: Vec<u64> = structures.iter().enumerate().map(not_null).collect::<Result<_>>()?;
        for (i, &structure) in structures.iter().enumerate() {
            if let Some(checks) = &self.checks {
                checks.reads(&format!("structures[{i}]"), structure)?;
            }
        }
        // SAFETY: the caller's promise.
        let mut recorder = unsafe { Recorder::new(self.context, commands) };
        let kernel = Kernel::new(&shaders::ACCEL_PROPERTIES, STRUCTURES_AT_ONCE as u32, &[]);
        for (i, chunk) in addresses.chunks(STRUCTURES_AT_ONCE).enumerate() {
            let mut structures = [0; STRUCTURES_AT_ONCE];
            structures[..chunk.len()].copy_from_slice(chunk);
            let results = results + (8 * STRUCTURES_AT_ONCE * i) as u64;
            let arguments =
                arguments::Properties { results, property: property as u32, count: chunk.len() as u32, structures };
            recorder.dispatch(&kernel, &arguments, 1)?;
        }
        Ok(())
    }
}
