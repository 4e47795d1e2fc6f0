//! Work shared among threads, the calling one included, so that a single thread never waits for another.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::error::DynamicsError;

/// Asked about every millisecond by each thread that simulates: whether the caller wants its batch back unfinished.
pub type StopRequested<'a> = dyn Fn() -> bool + Sync + 'a;

/// `work` on every item, each taken by the next thread that is free; results in the order of the items.
///
/// # Errors
/// Where the threads cannot be started.
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
        // A statement of its own, so that the queue is free again while the item is worked on.
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

/// That many threads, or as many as there are processors for 0.
pub(crate) fn thread_count(threads: usize) -> usize {
    if threads > 0 { threads } else { std::thread::available_parallelism().map_or(1, usize::from) }
}

/// The pool of that many threads; pools are started once and kept.
fn pool(threads: usize) -> Result<Arc<rayon::ThreadPool>, DynamicsError> {
    static POOLS: Mutex<BTreeMap<usize, Arc<rayon::ThreadPool>>> = Mutex::new(BTreeMap::new());
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(pool) = pools.get(&threads) {
        return Ok(Arc::clone(pool));
    }
    let started = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = Arc::new(started.map_err(|error| DynamicsError::Threads(error.to_string()))?);
    pools.insert(threads, Arc::clone(&pool));
    Ok(pool)
}
