//! Loops whose result does not depend on the number of threads: fixed chunks, each row written by one thread,
//! and one result for each chunk, read back in order.

use crate::error::SolverError;
use rayon::{ThreadPool, ThreadPoolBuilder, prelude::*};
use std::{mem, process};

/// Rows per chunk. Small enough to balance liquefied against elastic soil between threads, large enough that
/// handing a chunk over (about a microsecond) stays below a tenth of its work.
pub const CHUNK: usize = 32;

/// Domains below this many rows run on the calling thread: a barrier would cost more than it shares out.
pub const FEWEST_THREADED_ROWS: usize = 256;

/// The threads of one simulation, and of no other; none where the calling thread does all.
#[derive(Debug, Default)]
pub struct Pool(Option<Threads>);

impl Pool {
    /// So many threads; one needs no pool.
    ///
    /// # Errors
    /// [`SolverError::Threads`] if they cannot be started.
    pub fn new(threads: usize) -> Result<Self, SolverError> {
        Ok(Self((threads > 1).then(|| Threads::start(threads)).transpose()?))
    }

    /// Does work whose loops are shared out among the threads.
    ///
    /// A process that was forked has none of the threads of the one before: it starts its own.
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
        // Threads of another process cannot be told to end, and their locks may be held for ever.
        if let Some(threads) = self.0.take_if(|threads| threads.process != process::id()) {
            mem::forget(threads);
        }
    }
}

/// Threads, and the process that they live in.
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

/// Up to three row-wise arrays that a loop writes together; unit slices stand for the ones it does not need.
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
