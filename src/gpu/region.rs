//! Memory of the caller's.

use crate::{Error, Result};

/// A range of device memory: an address and a length.
///
/// Passes take the memory that they write as regions, and refuse one that is too small or misaligned. For memory that they only
/// read an address is enough, as in Vulkan: counts and strides say how long it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Region {
    /// Device address of the first byte.
    pub address: u64,
    /// Length in bytes.
    pub bytes: u64,
}

impl Region {
    /// Memory of which only the address is known, as in Vulkan's build structs. The caller vouches that it is large enough.
    pub const fn unbounded(address: u64) -> Region {
        Region { address, bytes: u64::MAX - address }
    }

    /// Whether only the address is known.
    pub(crate) const fn is_unbounded(&self) -> bool {
        self.bytes == u64::MAX - self.address
    }

    /// The rest after the first `bytes`.
    pub(crate) const fn behind(self, bytes: u64) -> Region {
        Region { address: self.address + bytes, bytes: self.bytes.saturating_sub(bytes) }
    }

    /// The address, if there are as many bytes as are needed from there on.
    ///
    /// # Errors
    /// [`Error::Argument`] names what the memory is for, what it has and what it needs.
    pub(crate) fn checked(&self, what: &str, needs: u64, alignment: u64) -> Result<u64> {
        let Region { address, bytes } = *self;
        if bytes < needs {
            return Err(Error::Argument(format!("{what} of {bytes} bytes, {needs} are needed; give more")));
        }
        if !address.is_multiple_of(alignment) {
            return Err(Error::Argument(format!("{what} at {address:#x}; its address is a multiple of {alignment}")));
        }
        Ok(address)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_that_is_too_small_or_lies_wrong_is_refused_by_name() {
        let region = Region { address: 0x1010, bytes: 100 };
        assert_eq!(region.checked("scratch memory", 100, 16).expect("enough"), 0x1010);
        let error_of =
            |needs, alignment| region.checked("scratch memory", needs, alignment).expect_err("refused").to_string();
        assert!(error_of(101, 16).contains("scratch memory of 100 bytes, 101 are needed"));
        assert!(error_of(100, 32).contains("scratch memory at 0x1010; its address is a multiple of 32"));
    }
}
