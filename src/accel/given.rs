//! What the calls check of the handles and addresses that they are given.

use super::serialize::ALIGNMENT;
use crate::{Error, Result};
use ash::vk;
use ash::vk::Handle;

/// The address of a structure that a call cannot do without.
pub(super) fn not_null(field: &str, structure: vk::AccelerationStructureKHR) -> Result<u64> {
    match structure.as_raw() {
        0 => Err(Error::Argument(format!("{field} is null; create it first"))),
        address => Ok(address),
    }
}

/// Memory for a serialised structure.
pub(super) fn aligned(field: &str, address: u64) -> Result<u64> {
    if address == 0 || !address.is_multiple_of(ALIGNMENT) {
        return Err(Error::Argument(format!(
            "{field}.deviceAddress is {address:#x}; it must be a multiple of {ALIGNMENT} and not zero"
        )));
    }
    Ok(address)
}
