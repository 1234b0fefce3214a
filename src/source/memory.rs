//! The memory of the machine, which bounds what is read.

use std::fs;

/// Bytes of memory that this process may have, where the system says so.
pub fn of_machine() -> Option<u64> {
    let machine = kilobytes_of("/proc/meminfo", "MemTotal:");
    // A container's limit may be less.
    let limit =
        fs::read_to_string("/sys/fs/cgroup/memory.max").ok().and_then(|text| text.trim().parse().ok());
    [machine, limit].into_iter().flatten().min()
}

/// Reads a line of a file of the system such as `MemTotal:  1024 kB`, in bytes.
pub(crate) fn kilobytes_of(file: &str, key: &str) -> Option<u64> {
    let text = fs::read_to_string(file).ok()?;
    let value = text.lines().find_map(|line| line.strip_prefix(key))?;
    value.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}
