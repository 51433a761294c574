//! Memory that svl shares with a program: faster than pipes, which copy everything twice.

use std::fs::File;
use std::io::Result;

/// An unnamed file in memory. While svl holds it, a program opens it by its path and maps it; it
/// disappears when both have ended, however they end.
#[derive(Debug)]
pub(super) struct SharedMemory(File);

#[cfg(target_os = "linux")]
impl SharedMemory {
    /// `None` if the system has no such memory.
    pub(super) fn new() -> Option<Self> {
        let flags = rustix::fs::MemfdFlags::CLOEXEC;
        let file = rustix::fs::memfd_create("svl", flags).ok()?;
        Some(Self(file.into()))
    }

    pub(super) fn path(&self) -> String {
        use std::os::fd::AsRawFd;
        format!("/proc/{}/fd/{}", std::process::id(), self.0.as_raw_fd())
    }

    /// Writes `bytes` at offset 0, and NaN at the offset of the disparities, so that a program that
    /// does not write them is detected. The file has at least `size` bytes afterwards.
    pub(super) fn write(&self, bytes: &[u8], disparities_at: u64, size: u64) -> Result<()> {
        use std::os::unix::fs::FileExt;
        if self.0.metadata()?.len() < size {
            self.0.set_len(size)?;
        }
        self.0.write_all_at(bytes, 0)?;
        let nan = f32::NAN.to_le_bytes();
        self.0.write_all_at(&nan, disparities_at)
    }

    /// Reads `count` bytes from the offset `at` on into `memory`.
    pub(super) fn read(&self, at: u64, count: usize, mut memory: Vec<u8>) -> Result<Vec<u8>> {
        memory.resize(count, 0);
        std::os::unix::fs::FileExt::read_exact_at(&self.0, &mut memory, at)?;
        Ok(memory)
    }
}

/// Other systems only have pipes.
#[cfg(not(target_os = "linux"))]
impl SharedMemory {
    pub(super) fn new() -> Option<Self> {
        None
    }

    pub(super) fn path(&self) -> String {
        String::new()
    }

    pub(super) fn write(&self, _: &[u8], _: u64, _: u64) -> Result<()> {
        Err(std::io::ErrorKind::Unsupported.into())
    }

    pub(super) fn read(&self, _: u64, _: usize, _: Vec<u8>) -> Result<Vec<u8>> {
        Err(std::io::ErrorKind::Unsupported.into())
    }
}
