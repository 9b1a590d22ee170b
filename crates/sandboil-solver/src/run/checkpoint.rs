//! A simulation as bytes. All that a step reads is stored as it is, the weight tables included, so that nothing has to
//! be rebuilt to the last bit.
//!
//! ```text
//! magic             8 bytes
//! format version    u32
//! build             u32, of the sources that wrote it
//! length of note    u64
//! note              whatever the caller wants to find again
//! simulation        postcard
//! checksum          u32, CRC-32 of all before
//! ```
//!
//! Numbers are little endian. The layout of a simulation is that of its types, which change with the sources: bytes of
//! another build are refused rather than misread.

use crate::error::StateError;
use crc32fast::Hasher;
use serde::{Serialize, de::DeserializeOwned};
use std::io::{self, Write};

/// What the bytes of every state begin with.
pub const MAGIC: &[u8] = b"SANDBOIL";
/// Raised when what stands around a simulation changes.
const FORMAT_VERSION: u32 = 1;
/// Sums up what passes through, and keeps the error that postcard would lose.
struct Summed<W> {
    to: W,
    sum: Hasher,
    failure: Option<io::Error>,
}

impl<W> Summed<W> {
    fn kept<T>(&mut self, outcome: io::Result<T>) -> io::Result<T> {
        outcome.map_err(|error| {
            let kind = error.kind();
            self.failure = Some(error);
            kind.into()
        })
    }
}

impl<W: Write> Write for Summed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let outcome = self.to.write(bytes);
        let taken = self.kept(outcome)?;
        self.sum.update(&bytes[..taken]);
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        let outcome = self.to.flush();
        self.kept(outcome)
    }
}

/// What distinguishes the sources that this program was built from.
const BUILD: [u8; 4] = match u32::from_str_radix(env!("SANDBOIL_SOURCES"), 16) {
    Ok(sum) => sum.to_le_bytes(),
    Err(_) => panic!("the build script gives a number in base 16"),
};

/// Writes a state and a note.
///
/// # Errors
/// Those of `to`.
pub fn write(state: &impl Serialize, note: &[u8], to: impl Write) -> io::Result<()> {
    let mut to = Summed { to, sum: Hasher::new(), failure: None };
    let outcome = write_summed(state, note, &mut to);
    let Summed { mut to, sum, failure } = to;
    failure.map_or(outcome, Err)?;
    to.write_all(&sum.finalize().to_le_bytes())?;
    to.flush()
}

fn write_summed(state: &impl Serialize, note: &[u8], to: &mut impl Write) -> io::Result<()> {
    for part in [MAGIC, &FORMAT_VERSION.to_le_bytes(), &BUILD, &(note.len() as u64).to_le_bytes(), note] {
        to.write_all(part)?;
    }
    postcard::to_io(state, to).map(|_| ()).map_err(io::Error::other)
}

/// What stands in the bytes of a state.
struct Parts<'a> {
    build: [u8; 4],
    note: &'a [u8],
    state: &'a [u8],
}

fn parts(bytes: &[u8]) -> Result<Parts<'_>, StateError> {
    const SHORT: StateError = StateError::Damaged("it ends too early");
    let rest = bytes.strip_prefix(MAGIC).ok_or(StateError::Foreign)?;
    let (version, _) = rest.split_first_chunk().ok_or(SHORT)?;
    match u32::from_le_bytes(*version) {
        FORMAT_VERSION => {}
        found => return Err(StateError::Version { found, needed: FORMAT_VERSION }),
    }
    let (summed, sum) = bytes.split_last_chunk().ok_or(SHORT)?;
    if crc32fast::hash(summed) != u32::from_le_bytes(*sum) {
        return Err(StateError::Damaged("its checksum is not that of its bytes"));
    }
    let rest = summed.get(MAGIC.len() + version.len()..).ok_or(SHORT)?;
    let (build, rest) = rest.split_first_chunk().ok_or(SHORT)?;
    let (length, rest) = rest.split_first_chunk().ok_or(SHORT)?;
    let length = usize::try_from(u64::from_le_bytes(*length)).map_err(|_| SHORT)?;
    let (note, state) = rest.split_at_checked(length).ok_or(SHORT)?;
    Ok(Parts { build: *build, note, state })
}

/// The note that was stored with a state, which may be that of another build.
///
/// # Errors
/// Bytes that are no state, of another format version or damaged.
pub fn note(bytes: &[u8]) -> Result<&[u8], StateError> {
    Ok(parts(bytes)?.note)
}

/// The state.
///
/// # Errors
/// Bytes that are no state, of another format version or build, or damaged.
pub fn read<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, StateError> {
    let Parts { build: found, state, .. } = parts(bytes)?;
    if found != BUILD {
        return Err(StateError::Build);
    }
    match postcard::take_from_bytes(state) {
        Ok((state, [])) => Ok(state),
        _ => Err(StateError::Damaged("it does not say what a simulation does")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Takes so many bytes, then fails.
    struct Full {
        room: usize,
        flushes: bool,
    }

    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.room == 0 {
                return Err(io::Error::other("full"));
            }
            let taken = bytes.len().min(self.room);
            self.room -= taken;
            Ok(taken)
        }

        fn flush(&mut self) -> io::Result<()> {
            if self.flushes { Ok(()) } else { Err(io::Error::other("cannot flush")) }
        }
    }

    #[test]
    fn what_cannot_be_written_is_told_in_the_words_of_the_writer() {
        let state = vec![1.0_f64; 100];
        let mut whole = Vec::new();
        write(&state, b"note", &mut whole).unwrap();
        assert_eq!(read::<Vec<f64>>(&whole), Ok(state.clone()));
        for room in 0..whole.len() {
            let told = write(&state, b"note", Full { room, flushes: true }).unwrap_err().to_string();
            assert_eq!(told, "full", "{room}");
        }
        let told = write(&state, b"note", Full { room: whole.len(), flushes: false }).unwrap_err();
        assert_eq!(told.to_string(), "cannot flush");
    }
}
