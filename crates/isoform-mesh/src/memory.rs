//! Bounds on the available memory, and checked allocation of large tables.
//!
//! An allocation that fails ends the process, and one that succeeds may end it later, as systems
//! overcommit memory. So tables that grow with the number of lattice cells are compared with the
//! memory of the machine first.

use crate::error::MeshError;

/// Returns the bytes of memory that this process may have: of the machine, swap included, or of the
/// container in which it runs. `u64::MAX` if the system does not report it.
pub(crate) fn of_machine() -> u64 {
    let read = |path: &str| std::fs::read_to_string(path).ok();
    let all = read("/proc/meminfo").and_then(|text| total(&text));
    // Control groups of version 2; "max" means unbounded.
    let group = read("/sys/fs/cgroup/memory.max").and_then(|text| text.trim().parse().ok());
    let all = all.unwrap_or(u64::MAX).min(group.unwrap_or(u64::MAX));
    // WebAssembly has addresses for 4 GiB.
    all.min(usize::MAX as u64)
}

/// Returns the memory and swap reported by a text in the format of /proc/meminfo, in bytes.
fn total(text: &str) -> Option<u64> {
    let of = |name: &str| -> Option<u64> {
        let line = text.lines().find_map(|line| line.strip_prefix(name))?;
        let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
        kibibytes.checked_mul(1024)
    };
    Some(of("MemTotal:")?.saturating_add(of("SwapTotal:").unwrap_or(0)))
}

/// Checks that the machine has this many bytes, which must be a lower bound of what is used.
///
/// # Errors
/// [`MeshError::NoMemory`].
pub(crate) fn check(needed: u64) -> Result<(), MeshError> {
    if needed > of_machine() {
        return Err(none(needed));
    }
    Ok(())
}

/// Allocates a table of `n` equal values.
///
/// # Errors
/// [`MeshError::NoMemory`] if the system cannot provide it.
pub(crate) fn table<T: Copy>(value: T, n: usize) -> Result<Vec<T>, MeshError> {
    let bytes = (n as u64).saturating_mul(size_of::<T>() as u64);
    check(bytes)?;
    let mut table = Vec::new();
    table.try_reserve_exact(n).map_err(|_| none(bytes))?;
    table.resize(n, value);
    Ok(table)
}

fn none(needed: u64) -> MeshError {
    MeshError::NoMemory {
        // In MiB.
        needed: needed / (1 << 20),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_and_swap_are_told() {
        let text = "MemTotal:       16384 kB\nMemFree: 3 kB\nSwapTotal:        1024 kB\n";
        assert_eq!(total(text), Some((16384 + 1024) * 1024));
        assert_eq!(total("MemTotal: 5 kB"), Some(5 * 1024));
        assert_eq!((total(""), total("MemTotal: many kB")), (None, None));
    }

    #[test]
    fn what_is_not_there_is_refused() {
        assert_eq!(table(7_u32, 3), Ok(vec![7; 3]));
        for n in [usize::MAX, usize::MAX / 4, 1 << 50] {
            let error = table(7_u32, n).expect_err("petabytes");
            assert!(matches!(error, MeshError::NoMemory { .. }), "{error}");
        }
    }
}
