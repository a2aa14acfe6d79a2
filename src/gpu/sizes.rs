//! How much memory something takes.

/// Bytes that the caller gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sizes {
    /// The structure: what stays.
    pub structure: u64,
    /// Scratch memory, free again when the work has run and its report, if there is one, has been read.
    pub scratch: u64,
    /// What both addresses are multiples of.
    pub alignment: u64,
}
