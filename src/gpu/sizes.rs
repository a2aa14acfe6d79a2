//! How much memory something takes.

/// Memory that the caller provides for a build, in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizes {
    /// Bytes of the structure, which stays.
    pub structure: u64,
    /// Bytes of scratch memory. It is free again when the work has run and its report, if any, has been read.
    pub scratch: u64,
    /// Both addresses must be multiples of this.
    pub alignment: u64,
}
