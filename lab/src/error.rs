//! What can go wrong in the laboratory, each with the thing, the rule and the remedy.

/// The laboratory's result.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// What can go wrong in the laboratory. Each message names the thing, the rule it broke and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// What can go wrong in the library.
    #[error(transparent)]
    Library(#[from] hedgerow::Error),
    /// A file cannot be read or written.
    #[error("{path}: {source}; check the path and its permissions")]
    File {
        /// The file or folder.
        path: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file is not what its name says; the message begins with `file:line:` or `file:` and ends with the remedy.
    #[error("{0}")]
    Malformed(String),
    /// The scene cannot be used (no triangles, non-finite vertices, an unknown name).
    #[error("{0}")]
    Scene(String),
    /// An option or argument has a value that cannot be used.
    #[error("{0}")]
    Argument(String),
    /// No Vulkan loader or no device at all.
    #[error("no Vulkan: {0}; install a Vulkan driver (on Debian: libvulkan1 and mesa-vulkan-drivers)")]
    NoVulkan(String),
    /// The device asked for does not exist.
    #[error("unknown device {asked:?}; there are: {available}; choose one with --device or HEDGEROW_DEVICE")]
    NoSuchDevice {
        /// What was asked for.
        asked: String,
        /// The devices there are, as `index: name`.
        available: String,
    },
    /// The device has too little memory.
    #[error(
        "{what} needs {needed} bytes of device memory, {available} are there; take a smaller scene or another device"
    )]
    OutOfMemory {
        /// What the memory was for.
        what: String,
        /// Bytes needed.
        needed: u64,
        /// Bytes the device has.
        available: u64,
    },
    /// A dispatch did not finish in time.
    #[error("{what} did not finish within {seconds} s; the device may hang: try another device or a smaller scene")]
    Timeout {
        /// What was running.
        what: String,
        /// The bound that ran out.
        seconds: u64,
    },
    /// The validation layers complained (with `--validation`, or in the tests).
    #[error("Vulkan validation: {0}")]
    Validation(String),
    /// A chart of the report cannot be drawn.
    #[error("the chart {chart} cannot be drawn: {reason}; the records in results.jsonl are complete without it")]
    Chart {
        /// Its name.
        chart: String,
        /// What the drawing library says.
        reason: String,
    },
}

/// What fails while a device records is told as the library's error; what is the laboratory's own keeps its message.
impl From<Error> for hedgerow::Error {
    fn from(error: Error) -> hedgerow::Error {
        match error {
            Error::Library(error) => error,
            other => hedgerow::Error::Argument(other.to_string()),
        }
    }
}

impl Error {
    /// For `map_err`: names the Vulkan call that failed.
    pub fn vulkan(call: &'static str) -> impl Fn(hedgerow::ash::vk::Result) -> Error {
        move |result| Error::Library(hedgerow::Error::Vulkan { call, result })
    }

    /// For `map_err`: names the file that failed.
    pub fn file(path: impl AsRef<std::path::Path>) -> impl Fn(std::io::Error) -> Error {
        let path = path.as_ref().display().to_string();
        move |source| Error::File { path: path.clone(), source }
    }

    /// Whether an option or argument was wrong, here or in the library.
    pub fn is_argument(&self) -> bool {
        matches!(self, Error::Argument(_) | Error::Library(hedgerow::Error::Argument(_)))
    }
}
