//! Small files that tests write, and loading them.
#![allow(dead_code, reason = "each test binary uses its part")]

use hedgerow_lab::Result;
use hedgerow_lab::scene::{self, LoadOptions, Scene};

/// A folder that goes away with the test.
pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Folder {
        Folder(tempfile::tempdir().expect("a temporary folder"))
    }

    /// Writes a file and returns its path.
    pub fn bytes(&self, name: &str, content: &[u8]) -> String {
        let path = self.0.path().join(name);
        std::fs::write(&path, content).expect("a file in a temporary folder");
        path.display().to_string()
    }

    pub fn file(&self, name: &str, content: &str) -> String {
        self.bytes(name, content.as_bytes())
    }

    pub fn path(&self) -> &std::path::Path {
        self.0.path()
    }
}

pub fn load(spec: &str) -> Result<Scene> {
    scene::load(spec, &LoadOptions::default())
}

/// Packs as `zstd` does.
pub fn pack(bytes: &[u8]) -> Vec<u8> {
    ruzstd::encoding::compress_to_vec(bytes, ruzstd::encoding::CompressionLevel::Fastest)
}
