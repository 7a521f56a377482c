//! Decoding of binary numbers to f64: integers of 8 to 64 bits and floats of 32 and 64, in both
//! byte orders. Integers of 64 bits are rounded beyond 2⁵³.

/// Type of a number in a binary file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum NumberType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl NumberType {
    /// Returns the type for a name used by PLY and other formats, in lower case.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" | "bool" | "boolean" | "byte" | "ubyte" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "long" | "int64" => Self::I64,
            "ulong" | "uint64" => Self::U64,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }
    /// Returns the size in bytes.
    pub(crate) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
    /// Decodes a number from the first bytes, of which there must be enough.
    #[inline]
    pub(crate) fn decode(self, bytes: &[u8], big: bool) -> f64 {
        /// Returns the first N bytes in little-endian order.
        fn take<const N: usize>(bytes: &[u8], big: bool) -> [u8; N] {
            let mut b: [u8; N] = std::array::from_fn(|i| bytes[i]);
            if big {
                b.reverse();
            }
            b
        }
        match self {
            Self::I8 => f64::from(bytes[0] as i8),
            Self::U8 => f64::from(bytes[0]),
            Self::I16 => f64::from(i16::from_le_bytes(take(bytes, big))),
            Self::U16 => f64::from(u16::from_le_bytes(take(bytes, big))),
            Self::I32 => f64::from(i32::from_le_bytes(take(bytes, big))),
            Self::U32 => f64::from(u32::from_le_bytes(take(bytes, big))),
            Self::I64 => i64::from_le_bytes(take(bytes, big)) as f64,
            Self::U64 => u64::from_le_bytes(take(bytes, big)) as f64,
            Self::F32 => f64::from(f32::from_le_bytes(take(bytes, big))),
            Self::F64 => f64::from_le_bytes(take(bytes, big)),
        }
    }
}
