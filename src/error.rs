//! What can go wrong, each with the thing, the rule and the remedy.

/// The library's result.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What can go wrong in the library. Each message names the thing, the rule it broke and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An option or argument has a value that cannot be used.
    #[error("{0}")]
    Argument(String),
    /// The device lacks something that the library requires.
    #[error("{device} cannot be used, it lacks: {}; choose another device or a newer driver", missing.join(", "))]
    Unsupported {
        /// The device.
        device: String,
        /// Everything that is missing, not only the first.
        missing: Vec<String>,
    },
    /// A Vulkan call failed.
    #[error("{call} failed: {result:?}")]
    Vulkan {
        /// The call.
        call: &'static str,
        /// What it returned.
        result: ash::vk::Result,
    },
    /// A structure breaks a rule of its layout; says which node and which rule.
    #[error("invalid structure: {0}")]
    InvalidStructure(String),
}

impl Error {
    /// For `map_err`: names the Vulkan call that failed.
    pub fn vulkan(call: &'static str) -> impl Fn(ash::vk::Result) -> Error {
        move |result| Error::Vulkan { call, result }
    }
}
