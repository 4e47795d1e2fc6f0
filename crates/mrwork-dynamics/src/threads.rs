//! Distribution of work over threads, the calling thread included: with one thread, nothing is handed over.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::DynamicsError;

/// Whether the caller wants to cancel its batch; each simulating thread asks about every millisecond.
pub type StopRequested<'a> = dyn Fn() -> bool + Sync + 'a;

/// Applies `work` to every item on the next free thread; results in the order of the items.
///
/// # Errors
/// If the threads cannot be started.
pub(crate) fn on_threads<I: Send, T: Send>(
    threads: usize,
    items: Vec<I>,
    work: impl Fn(I) -> T + Sync,
) -> Result<Vec<T>, DynamicsError> {
    let count = items.len();
    let queue = Mutex::new(items.into_iter().enumerate());
    let results = Mutex::new(Vec::with_capacity(count));
    let share = || {
        let mut own = Vec::with_capacity(count);
        // In a block of its own, so that the queue is unlocked while the item is processed.
        while let Some((index, item)) = { queue.lock().unwrap_or_else(PoisonError::into_inner).next() } {
            own.push((index, work(item)));
        }
        results.lock().unwrap_or_else(PoisonError::into_inner).append(&mut own);
    };
    let others = threads.min(count).saturating_sub(1);
    if others == 0 {
        share();
    } else {
        pool(others)?.in_place_scope(|scope| {
            for _ in 0..others {
                scope.spawn(|_| share());
            }
            share();
        });
    }
    let mut results = results.into_inner().unwrap_or_else(PoisonError::into_inner);
    results.sort_unstable_by_key(|&(index, _)| index);
    Ok(results.into_iter().map(|(_, result)| result).collect())
}

/// Most threads of a batch, beyond those of any machine.
const MOST: usize = 1024;

/// `threads`, or the number of processors for 0; at most [`MOST`].
pub(crate) fn thread_count(threads: usize) -> usize {
    let asked =
        if threads > 0 { threads } else { std::thread::available_parallelism().map_or(1, usize::from) };
    asked.min(MOST)
}

/// The pool of that many threads, started once in a process and cached.
///
/// A forked process has the pools of its parent without their threads, so it starts its own.
fn pool(threads: usize) -> Result<Arc<rayon::ThreadPool>, DynamicsError> {
    type Pools = BTreeMap<(u32, usize), Arc<rayon::ThreadPool>>;
    static POOLS: Mutex<Pools> = Mutex::new(BTreeMap::new());
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let key = (std::process::id(), threads);
    if let Some(pool) = pools.get(&key) {
        return Ok(Arc::clone(pool));
    }
    let started = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = Arc::new(started.map_err(|error| DynamicsError::Threads(error.to_string()))?);
    pools.insert(key, Arc::clone(&pool));
    Ok(pool)
}
