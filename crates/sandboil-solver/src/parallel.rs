//! Loops whose result does not depend on the number of threads: fixed chunks, each row written by one thread,
//! and one result for each chunk, read back in order.

use crate::error::SolverError;
use rayon::{ThreadPool, ThreadPoolBuilder, prelude::*};
use std::{mem, process};

/// Rows per chunk. Small enough to balance the work of liquefied and elastic soil between threads, and large
/// enough that the overhead of a chunk (about a microsecond) is less than a tenth of its work.
pub const CHUNK: usize = 32;

/// Domains below this many rows run on the calling thread: synchronising threads would cost more than it
/// gains.
pub const FEWEST_THREADED_ROWS: usize = 256;

/// The threads of one simulation; `None` if the calling thread does all work.
#[derive(Debug, Default)]
pub struct Pool(Option<Threads>);

impl Pool {
    /// A pool of `threads` threads; one thread needs no pool.
    ///
    /// # Errors
    /// [`SolverError::Threads`] if they cannot be started.
    pub fn new(threads: usize) -> Result<Self, SolverError> {
        Ok(Self((threads > 1).then(|| Threads::start(threads)).transpose()?))
    }

    /// Does work whose loops are shared among the threads.
    ///
    /// A forked process does not have the threads of its parent: it starts new ones.
    ///
    /// # Errors
    /// [`SolverError::Threads`] if they cannot be started.
    pub fn run<R: Send>(&mut self, work: impl FnOnce() -> R + Send) -> Result<R, SolverError> {
        let Some(threads) = &mut self.0 else { return Ok(work()) };
        if threads.process != process::id() {
            let started = Threads::start(threads.pool.current_num_threads())?;
            mem::forget(mem::replace(threads, started));
        }
        Ok(threads.pool.install(work))
    }
}

impl Drop for Pool {
    fn drop(&mut self) {
        // Threads of another process cannot be stopped, and waiting for their locks may never end.
        if let Some(threads) = self.0.take_if(|threads| threads.process != process::id()) {
            mem::forget(threads);
        }
    }
}

/// Threads, and the process in which they run.
#[derive(Debug)]
struct Threads {
    pool: ThreadPool,
    process: u32,
}

impl Threads {
    fn start(threads: usize) -> Result<Self, SolverError> {
        let built = ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = built.map_err(|error| SolverError::Threads { threads, reason: error.to_string() })?;
        Ok(Self { pool, process: process::id() })
    }
}

/// Number of chunks of `rows` rows: the length of the results of [`for_each_chunk`].
pub fn chunks(rows: usize) -> usize {
    rows.div_ceil(CHUNK)
}

/// Up to three row-wise arrays that a loop writes together. A slice of units takes the place of an array that
/// it does not need.
pub struct Rows<'a, A, B = (), C = ()> {
    /// First array.
    pub a: &'a mut [A],
    /// Second array, of the same length.
    pub b: &'a mut [B],
    /// Third array, of the same length.
    pub c: &'a mut [C],
}

/// Calls `work(first_row, rows, result)` on every chunk.
pub fn for_each_chunk<A: Send, B: Send, C: Send, R: Send>(
    threaded: bool,
    rows: Rows<'_, A, B, C>,
    results: &mut [R],
    work: impl Fn(usize, Rows<'_, A, B, C>, &mut R) + Sync + Send,
) {
    let Rows { a, b, c } = rows;
    if threaded && a.len() >= FEWEST_THREADED_ROWS {
        a.par_chunks_mut(CHUNK)
            .zip(b.par_chunks_mut(CHUNK))
            .zip(c.par_chunks_mut(CHUNK))
            .zip(results.par_iter_mut())
            .enumerate()
            .for_each(|(chunk, (((a, b), c), result))| work(chunk * CHUNK, Rows { a, b, c }, result));
    } else {
        let chunks = a.chunks_mut(CHUNK).zip(b.chunks_mut(CHUNK)).zip(c.chunks_mut(CHUNK));
        for (chunk, (((a, b), c), result)) in chunks.zip(results.iter_mut()).enumerate() {
            work(chunk * CHUNK, Rows { a, b, c }, result);
        }
    }
}
